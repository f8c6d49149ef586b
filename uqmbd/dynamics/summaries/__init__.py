"""Summaries of a motion between the output times: extremes, integrals, first times, margins."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
