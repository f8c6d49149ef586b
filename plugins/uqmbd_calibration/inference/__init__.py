"""Inference of the posterior of the inputs: likelihood, search, surrogates, draws, and checks with the mechanism."""

from __future__ import annotations

from uqmbd_calibration.inference.bias import Bias
from uqmbd_calibration.inference.blocks import FREEDOM, Block
from uqmbd_calibration.inference.climbing import Peaks, climb
from uqmbd_calibration.inference.identifiability import Direction, combination, directions, expected_covariance
from uqmbd_calibration.inference.inferring import PART, Inferred, Mode, PosteriorCheck, infer
from uqmbd_calibration.inference.machine_records import MachineRecords
from uqmbd_calibration.inference.maxima import shares_of
from uqmbd_calibration.inference.points import OperatingPoint
from uqmbd_calibration.inference.posterior import Posterior, Predictor
from uqmbd_calibration.inference.prior_surrogate import PriorSurrogate, default_methods, read_prior_surrogates
from uqmbd_calibration.inference.sampling import Draws, require_sampler, sample
from uqmbd_calibration.inference.searching import search, spread_over_prior
from uqmbd_calibration.inference.unknowns import LEVEL_SPREAD, Level, UnknownInput, Unknowns

__all__ = [
    "FREEDOM",
    "LEVEL_SPREAD",
    "PART",
    "Bias",
    "Block",
    "MachineRecords",
    "PosteriorCheck",
    "Direction",
    "Draws",
    "Inferred",
    "Level",
    "Mode",
    "OperatingPoint",
    "Peaks",
    "Posterior",
    "Predictor",
    "PriorSurrogate",
    "UnknownInput",
    "Unknowns",
    "climb",
    "combination",
    "default_methods",
    "directions",
    "expected_covariance",
    "infer",
    "read_prior_surrogates",
    "require_sampler",
    "sample",
    "search",
    "shares_of",
    "spread_over_prior",
]
