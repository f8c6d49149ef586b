"""Results as xarray data: the schema of all propagators, statistics, assessment, and storage.

Each name is loaded at its first use.
"""

from typing import Any

import lazy_loader

from uqmbd.late_imports import when_loaded
from uqmbd.status import Status as Status

_public, _, _attached = lazy_loader.attach_stub(__name__, __file__)

_FOLDERS = ("assessment", "chaos", "requirements", "schema", "statistics", "storage", "tree")

# `propagator_nodes` is the earlier name of `methods`
__all__ = sorted({*_attached, "Status"} - {*_FOLDERS, "propagator_nodes"})

_MOVED = frozenset(
    """
    AlignedElement CircularMoments CountedQuantiles DEFAULT_PROBABILITIES InputInfo Labels Landmarks Moments
    OutputInfo QuasiPeriodicElement Violations labels least_squares project quantiles_of_chunks regress_on_nodes
    replicate_errors requirements_dataset sample_dataset statistics_dataset statistics_of_samples stored_as
    with_reasons
    """.split()
)
"""Names that were moved to `uqmbd.extend`."""


def __getattr__(name: str) -> Any:
    """Load a public name; until version 0.2, also load an object that was public here, with a deprecation warning."""
    if name in _attached or name.startswith("_"):
        return _public(name)
    import warnings

    import uqmbd

    if name in _MOVED:
        now = "Markers" if name == "Landmarks" else name
        found, text = getattr(uqmbd.extend, now), f"is uqmbd.extend.{now} now"
    else:
        folders = [_public(folder) for folder in _FOLDERS]
        owners = [folder for folder in folders if name in folder.__all__]
        if not owners:
            hint = "; it was removed, use uqmbd.results.assess(tree)" if name in ("overall", "statements") else ""
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}{hint}")
        found, text = getattr(owners[0], name), "is not public any more"
    warnings.warn(f"uqmbd.results.{name} {text}; the name is removed here in version 0.2.", DeprecationWarning, 2)
    return found


def __dir__() -> list[str]:
    return list(__all__)


def _register() -> None:
    """Register the accessor ``.uqmbd`` of xarray data."""
    import uqmbd.results.accessor  # noqa: F401 - its import registers the accessor


when_loaded("xarray", _register)
