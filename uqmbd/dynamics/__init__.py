"""Dynamics: derivation of the equations, kernels, model, ensemble, assembly, integration.

Only this package imports scikit-sundae. `uqmbd.compiled` compiles the SymEngine expressions that it derives.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
