"""uqmbd: how uncertainty in lengths, masses, stiffnesses and loads spreads through a multi-body mechanism.

A study script describes a mechanism and its random variables once; every propagator runs on that one description and
the results come back as xarray data that can be laid side by side.  Everything below is loaded when it is first used,
so that ``import uqmbd`` costs next to nothing.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
