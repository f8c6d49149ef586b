"""Structure, validity and tails of chaospy's distributions.

Distributions of other packages are converted to distributions of chaospy.
"""

from __future__ import annotations

from uqmbd.randomness.distributions.adopted import adopt_distribution, distribution_of
from uqmbd.randomness.distributions.around_number import distribution_about, is_distribution, leaves_range
from uqmbd.randomness.distributions.decomposed import AffineDistribution, is_dependent
from uqmbd.randomness.distributions.flaws import flaw_of
from uqmbd.randomness.distributions.table_functions import tabulated
from uqmbd.randomness.distributions.tails import FEWEST, Tail, heaviest_tail, tail_of

__all__ = [
    "FEWEST",
    "AffineDistribution",
    "Tail",
    "adopt_distribution",
    "distribution_about",
    "distribution_of",
    "flaw_of",
    "heaviest_tail",
    "is_dependent",
    "is_distribution",
    "leaves_range",
    "tabulated",
    "tail_of",
]
