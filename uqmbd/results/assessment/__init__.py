"""Assess the reliability of results: compare methods and their stated errors, and recommend a method."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
