"""The names that authors of plugins need, in addition to those of `uqmbd` that authors of studies need.

Components, integrators, propagators, sampling designs, readers of models, checks, report sections and commands are
written with them; uqmbd's own plugins use nothing else.  Everything is loaded when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
