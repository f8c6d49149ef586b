"""Define and validate the layout of results: axes, datasets, and nodes of the tree."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
