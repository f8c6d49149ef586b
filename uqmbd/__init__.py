"""uqmbd: how uncertainty in lengths, masses, stiffnesses and loads spreads through a multi-body mechanism.

A study script describes a mechanism and its random variables once; every propagator runs on that one description and
the results come back as xarray data that can be laid side by side.  Everything below is loaded when it is first used,
so that ``import uqmbd`` costs next to nothing.  Plugins need more names: see `uqmbd.extend`.
"""

from typing import Any

import lazy_loader

_public, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    """Load a public name; one that has moved to `uqmbd.extend` or `uqmbd.laws` is found with a warning, until 0.2."""
    if name not in __all__ and not name.startswith("_"):
        home = _public("laws" if name in ("law_at", "law_values") else "extend")
        now = getattr(home, "_RENAMED", {}).get(name, name)
        if now in home.__all__:
            import warnings

            text = f"uqmbd.{name} is {home.__name__}.{now} now; the old name is removed in version 0.2."
            warnings.warn(text, DeprecationWarning, stacklevel=2)
            return getattr(home, now)
    return _public(name)
