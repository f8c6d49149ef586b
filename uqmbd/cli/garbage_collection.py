"""Imports and study scripts are loaded without a search for garbage, and without packages that only are installed.

What is loaded stays until the end: of a short run, a tenth of the time goes into looking through it again and again
(1.4 s of 11, by `gc.callbacks`).

To know whether data are arrays of Dask or of pint, xarray imports these packages wherever they are installed: 0.6 of
5.9 s of a short run, by ``python -X importtime``.  A class of a package that nobody has imported has no instances; so
the question waits until somebody imports it.  xarray has no setting for that.  What is set is private to xarray: where
it has another form, nothing is set, and the packages are imported as before.  This is done in processes of the command
line only.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

__all__ = ["loading"]

SELDOM = 500_000
"""New objects between two searches while loading, more than imports make: what a script leaves is still found."""

ARRAYS = {"dask": ("dask.array", "Array"), "pint": ("pint", "Quantity")}
"""The class of arrays of a package, as xarray has it."""


@contextmanager
def loading() -> Iterator[None]:
    """Search for garbage seldom while the context lasts, and never again among what it has made.

    >>> before = gc.get_threshold()
    >>> with loading():
    ...     print(gc.get_threshold()[0])
    500000
    >>> gc.get_threshold() == before
    True
    """
    thresholds = gc.get_threshold()
    gc.set_threshold(SELDOM, *thresholds[1:])
    try:
        yield
    finally:
        gc.freeze()
        gc.set_threshold(*thresholds)
        _defer_checks()


def _defer_checks() -> None:
    """Let xarray ask for arrays of Dask and pint when somebody has imported these packages, not before."""
    compatibility, tools = (sys.modules.get(f"xarray.namedarray.{name}") for name in ("pycompat", "utils"))
    known, made = (getattr(compatibility, name, None) for name in ("_cached_duck_array_modules", "DuckArrayModule"))
    if isinstance(known, dict) and isinstance(made, type):
        for package in set(ARRAYS) - set(known):
            known[package] = _Late(package, made)
    before = getattr(tools, "is_dask_collection", None)
    if callable(before) and not isinstance(before, _Collection):
        tools.is_dask_collection = _Collection(before)  # type: ignore[union-attr]  # it has one


class _Late:
    """What xarray knows of a package: nothing, until the class of its arrays is there."""

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
    """Whether something is a collection of Dask: nothing is while Dask is not imported."""

    def __init__(self, before: Any) -> None:
        self._before = before

    def __call__(self, x: object) -> Any:
        return "dask" in sys.modules and self._before(x)
