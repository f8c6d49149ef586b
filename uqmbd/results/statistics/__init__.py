"""Compute statistics of samples: moments, quantiles, angles, rotations, and errors from replicates."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
