"""Display of objects in notebooks by functions that packages register as entry points.

The group is ``uqmbd.display``. The entry point's name consists of the package and the type, as ``uqmbd.Mechanism``. The
entry point refers to a function that converts the object to HTML. The first use of the entry point imports the
function.
"""

from __future__ import annotations

import functools
import importlib.metadata
from collections.abc import Callable
from typing import Any

from uqmbd.names import lineage

__all__ = ["display_function", "html_of"]

GROUP = "uqmbd.display"


def html_of(shown: object) -> str | None:
    """Return the HTML of an object, by the function for its type or its nearest base class; None if there is none.

    >>> import uqmbd
    >>> "fall" in html_of(uqmbd.Mechanism("fall", uqmbd.Planar())), html_of(1.0)
    (True, None)
    """
    drawn = next((_entry_points()[name] for name in lineage(type(shown)) if name in _entry_points()), None)
    html: str | None = None if drawn is None else drawn.load()(shown)
    return html


def display_function(name: str) -> Callable[..., Any]:
    """Return the function that a package registers under a name of the group; raise LookupError if there is none.

    >>> display_function("uqmbd.Mechanism").__name__
    'mechanism_html'
    """
    found = _entry_points().get(name)
    if found is None:
        raise LookupError(f"no installed package registers {name!r} in the entry-point group {GROUP!r}")
    function: Callable[..., Any] = found.load()
    return function


@functools.cache
def _entry_points() -> dict[str, importlib.metadata.EntryPoint]:
    return {found.name: found for found in importlib.metadata.entry_points(group=GROUP)}
