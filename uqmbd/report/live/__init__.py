"""Interactive parts of a report: data for its scripts, and the scripts (JavaScript modules in this folder)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
