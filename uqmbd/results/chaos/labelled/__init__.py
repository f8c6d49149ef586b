"""Surrogates and labels: inputs by their names in, values with dimensions, coordinates and units out."""

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
