"""Figures of results, and a self-contained HTML report. Each name is loaded at its first use."""

import warnings
from typing import Any

import lazy_loader

_public, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    """Load a public name; until version 0.2, also load an old name, with a warning."""
    if name == "style":
        text = "uqmbd.report.style is uqmbd.report.series_style now; the old name is removed in version 0.2."
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return _public("series_style")
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _public(name)
