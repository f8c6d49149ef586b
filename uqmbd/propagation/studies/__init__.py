"""Studies: a mechanism, times and methods, their import from scripts, and their execution."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
