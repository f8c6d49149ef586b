"""What public functions are given: arguments that exist, of the kinds that their annotations declare.

One judgement of values by annotations, for arguments of functions and classes and for options of methods.
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
    members,
    several,
)
from uqmbd.arguments.expected import refusal, returned, shown
from uqmbd.arguments.gate import typechecked
from uqmbd.arguments.kinds import fits, is_one

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
