"""uqmbd: propagation of uncertain lengths, masses, stiffnesses and loads through multibody mechanisms.

A study script describes a mechanism and its random variables once, and all propagators use this description. All
propagators return xarray data that can be compared. The package loads each public name at its first use, so that
``import uqmbd`` takes little time. The names for plugins are in `uqmbd.extend`.
"""

from typing import Any

import lazy_loader

_public, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    """Load a public name; until 0.2, also load names moved to `uqmbd.extend` or `uqmbd.laws`, with a warning."""
    if name not in __all__ and not name.startswith("_"):
        home = _public("laws" if name in ("law_at", "law_values") else "extend")
        now = getattr(home, "_RENAMED", {}).get(name, name)
        if now in home.__all__:
            import warnings

            text = f"uqmbd.{name} is {home.__name__}.{now} now; the old name is removed in version 0.2."
            warnings.warn(text, DeprecationWarning, stacklevel=2)
            return getattr(home, now)
    return _public(name)
