"""Names for authors of plugins; authors of studies need the names of `uqmbd` only.

Components, integrators, propagators, sampling designs, readers of models, checks, report sections and commands are
written with them; the plugins of uqmbd use no other names.  Everything is loaded when it is first used.
"""

from typing import Any

import lazy_loader

_public, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

_RENAMED = {"Doubt": "Exceedance", "Landmarks": "Markers", "doubts": "find_exceedances"}
"""New names by old names."""


def __getattr__(name: str) -> Any:
    """Load a public name; an old name is found with a warning, until 0.2."""
    if (now := _RENAMED.get(name)) is not None:
        import warnings

        text = f"uqmbd.extend.{name} was renamed to uqmbd.extend.{now}; version 0.2 removes the old name."
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return _public(now)
    return _public(name)
