"""Check of the names and values of arguments of public functions against their annotations.

Arguments of functions and classes and options of methods are checked by the same rules.
"""

from uqmbd.arguments.annotations import (
    Axis,
    Bounds,
    Count,
    NotNegative,
    NotNegativeOrInfinite,
    OrInfinite,
    OrNaN,
    Positive,
    Seed,
    Share,
    ShareOrNaN,
    Size,
    bounded,
    each,
    fits,
    is_one,
    members,
    several,
)
from uqmbd.arguments.expected import refusal, returned, shown
from uqmbd.arguments.gate import typechecked

__all__ = [
    "Axis",
    "Bounds",
    "Count",
    "NotNegative",
    "NotNegativeOrInfinite",
    "OrInfinite",
    "OrNaN",
    "Positive",
    "Seed",
    "Share",
    "ShareOrNaN",
    "Size",
    "bounded",
    "each",
    "fits",
    "is_one",
    "members",
    "refusal",
    "returned",
    "several",
    "shown",
    "typechecked",
]
