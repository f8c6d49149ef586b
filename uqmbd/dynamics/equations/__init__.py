"""Derivation and compilation of the equations of a mechanism, and the model that contains them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
