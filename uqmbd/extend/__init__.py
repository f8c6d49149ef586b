"""Names for authors of plugins; authors of studies need the names of `uqmbd` only.

Plugins use these names to define components, integrators, propagators, sampling designs, readers of models, checks,
report sections and commands. The plugins of uqmbd use no other names. Each name is loaded at its first use.
"""

from typing import Any

import lazy_loader

_public, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

_RENAMED = {"Doubt": "Exceedance", "Landmarks": "Markers", "doubts": "find_exceedances"}
"""New name of each renamed object, by its old name."""


def __getattr__(name: str) -> Any:
    """Load a public name; until version 0.2, also load an old name, with a warning."""
    if (now := _RENAMED.get(name)) is not None:
        import warnings

        text = f"uqmbd.extend.{name} was renamed to uqmbd.extend.{now}; version 0.2 removes the old name."
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return _public(now)
    return _public(name)
