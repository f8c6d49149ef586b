"""Convert inputs by name to points of a surrogate, and its values to arrays with dimensions, coordinates and units."""

from __future__ import annotations

from uqmbd.results.chaos.labelled.points import Named, Points, TableLike, points_of
from uqmbd.results.chaos.labelled.statistics import (
    DERIVATIVE,
    VALUE,
    labelled_array,
    surrogate_statistics,
)

__all__ = [
    "DERIVATIVE",
    "VALUE",
    "TableLike",
    "Named",
    "Points",
    "labelled_array",
    "points_of",
    "surrogate_statistics",
]
