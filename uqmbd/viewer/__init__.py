"""Viewer of a mechanism while it is built: a page on the loopback address that follows the study file."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
