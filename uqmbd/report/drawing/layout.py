"""The layout of figures that `arrange` has placed."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["arranged_layout", "is_arranged"]


@functools.cache
def arranged_layout() -> Any:
    """Return the class of the constrained layout of these figures, by which they are told from others."""
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    class ArrangedLayout(ConstrainedLayoutEngine):
        pass

    return ArrangedLayout


def is_arranged(figure: Figure) -> bool:
    """Tell whether `arrange` has placed the axes of a figure."""
    return isinstance(figure.get_layout_engine(), arranged_layout())
