"""Load imports and study scripts without garbage collection, and without installed but unused packages.

Loaded objects remain until the end. In a short run, repeated collections over them would take a tenth of the time (1.4
s of 11 s, by `gc.callbacks`).

To test whether data are arrays of Dask or of pint, xarray imports these packages if they are installed. These imports
take 0.6 of 5.9 s of a short run, by ``python -X importtime``. A class of a package that is not imported has no
instances, so the test can wait for the import. xarray has no setting for that, so this module changes a private
attribute of xarray. If that attribute has another form, the module changes nothing, and xarray imports the packages.
Only processes of the command line and of the viewer do this.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from uqmbd.late_imports import postpone_imports, when_loaded

__all__ = ["loading"]

SELDOM = 500_000
"""Number of new objects between two collections during the load: imports create fewer, scripts with garbage more."""

ARRAYS = {"dask": ("dask.array", "Array"), "pint": ("pint", "Quantity")}
"""Module and class of the arrays of a package, as in xarray."""


@contextmanager
def loading() -> Iterator[None]:
    """Run the garbage collector rarely within the context, and exclude the loaded objects from later runs.

    >>> before = gc.get_threshold()
    >>> with loading():
    ...     print(gc.get_threshold()[0])
    500000
    >>> gc.get_threshold() == before
    True
    """
    postpone_imports()
    thresholds = gc.get_threshold()
    gc.set_threshold(SELDOM, *thresholds[1:])
    try:
        yield
    finally:
        gc.freeze()
        gc.set_threshold(*thresholds)
        when_loaded("xarray", _defer_checks)


def _defer_checks() -> None:
    """Make xarray check for Dask and pint arrays only after these packages are imported."""
    compatibility, tools = (sys.modules.get(f"xarray.namedarray.{name}") for name in ("pycompat", "utils"))
    known, made = (getattr(compatibility, name, None) for name in ("_cached_duck_array_modules", "DuckArrayModule"))
    if isinstance(known, dict) and isinstance(made, type):
        for package in set(ARRAYS) - set(known):
            known[package] = _DeferredPackage(package, made)
    before = getattr(tools, "is_dask_collection", None)
    if callable(before) and not isinstance(before, _Collection):
        tools.is_dask_collection = _Collection(before)  # type: ignore[union-attr]  # it has one


class _DeferredPackage:
    """Substitute for xarray's record of a package, without an array class until the package is imported."""

    def __init__(self, package: str, made: type) -> None:
        self._package = package
        self._made = made
        self._known: Any = None

    def __getattr__(self, name: str) -> Any:
        if self._known is None:
            module, array = ARRAYS[self._package]
            if name == "type" and not hasattr(sys.modules.get(module), array):
                return ()
            self._known = self._made(self._package)
        return getattr(self._known, name)


class _Collection:
    """Return whether an object is a Dask collection; always false while Dask is not imported."""

    def __init__(self, before: Any) -> None:
        self._before = before

    def __call__(self, x: object) -> Any:
        return "dask" in sys.modules and self._before(x)
