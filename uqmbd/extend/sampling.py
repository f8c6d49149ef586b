"""Names for plugins that work with random inputs: germs, quadrature rules, index sets, sampling designs."""

from __future__ import annotations

from uqmbd.randomness import GermBox as GermBox
from uqmbd.randomness import GermSpace as GermSpace
from uqmbd.randomness import JointInput as JointInput
from uqmbd.randomness import Quadrature as Quadrature
from uqmbd.randomness import SamplingDesign as SamplingDesign
from uqmbd.randomness import Toleranced as Toleranced
from uqmbd.randomness import clenshaw_curtis as clenshaw_curtis
from uqmbd.randomness import combination_coefficients as combination_coefficients
from uqmbd.randomness import gauss_tensor as gauss_tensor
from uqmbd.randomness import gram_error as gram_error
from uqmbd.randomness import index_set as index_set
from uqmbd.randomness import monte_carlo_rule as monte_carlo_rule
from uqmbd.randomness import sampling_design as sampling_design
from uqmbd.randomness import sampling_designs as sampling_designs
from uqmbd.randomness import smolyak as smolyak
from uqmbd.randomness import sparse_rule as sparse_rule
from uqmbd.randomness import stated_tolerance as stated_tolerance
from uqmbd.randomness import uniform_variable as uniform_variable
