"""Display of objects in notebooks: an entry point of any package names the function that draws a type.

The group is ``uqmbd.display``.  The name is that of the type after that of its package, such as ``uqmbd.Mechanism``.
The value is a function from the object to a text of HTML; it is imported when the first object is shown.
"""

from __future__ import annotations

import functools
import importlib.metadata

from uqmbd.names import lineage

__all__ = ["html_of"]

GROUP = "uqmbd.display"


def html_of(shown: object) -> str | None:
    """Return the HTML of an object, as its type or the nearest base of it is drawn; None: as plain text.

    >>> import uqmbd
    >>> "fall" in html_of(uqmbd.Mechanism("fall", uqmbd.Planar())), html_of(1.0)
    (True, None)
    """
    drawn = next((_entry_points()[name] for name in lineage(type(shown)) if name in _entry_points()), None)
    html: str | None = None if drawn is None else drawn.load()(shown)
    return html


@functools.cache
def _entry_points() -> dict[str, importlib.metadata.EntryPoint]:
    return {found.name: found for found in importlib.metadata.entry_points(group=GROUP)}
