"""Subset simulation by OpenTURNS: an independent estimate of a probability, in the same standard normal space.

It is not the default method: it accepts a single requirement, and the coefficient of variation of its estimate is 35 to
65 % in the examples of `docs/how-to/reliability.md`.
"""

from __future__ import annotations

import numpy as np
from scipy import stats

import uqmbd
from uqmbd.typing import Array
from uqmbd_reliability.analysis import Analysis
from uqmbd_reliability.estimating import ProbabilityEstimate, failing
from uqmbd_reliability.importance import Sampled
from uqmbd_reliability.ledger import BudgetExhausted, LimitState, LimitStateLedger

__all__ = ["MISSING", "available", "subset_probability"]


MISSING = (
    "method 'subset' requires OpenTURNS, which is not installed. Install it (pip install \"uqmbd[reliability]\"), "
    "or use method='auto', which needs no other package"
)

LEAST, BLOCK = 500, 100
"""Least number of points of a level, and number of points in one call. With a level of 300 points, OpenTURNS raises
errors for rare events."""

DEPENDENCE = 1.8
"""Ratio of the measured to the stated standard deviation; OpenTURNS ignores the dependence between levels."""


def available() -> bool:
    """Return whether OpenTURNS is installed."""
    try:
        import openturns
    except ImportError:
        return False
    return bool(openturns.__version__)


def subset_probability(limit: LimitState, dimension: int, *, most: int, seed: int) -> Analysis:
    """Estimate the probability that a single margin is below zero by OpenTURNS's subset sampling.

    Raise IntegrationError if `most` realisations are not enough.
    """
    import openturns as ot

    ledger = LimitStateLedger(limit, dimension, most)
    seen: dict[bytes, int] = {}
    trouble: list[BaseException] = []

    def evaluate(sample: object) -> Array:
        points = np.array(sample)
        first = ledger.count
        try:
            margins = ledger(points)
        except BaseException as error:
            # OpenTURNS converts every exception in a function to a RuntimeError
            trouble.append(error)
            raise
        seen.update({row.tobytes(): first + k for k, row in enumerate(points)})
        # a failed realisation does not stop a chain; the interval accounts for its unknown result
        return np.where(np.isnan(margins), 1e300, margins)

    # restore the global state of OpenTURNS's generator later
    before = ot.RandomGenerator.GetState()
    ot.RandomGenerator.SetSeed(seed)
    try:
        function = ot.PythonFunction(dimension, 1, func_sample=evaluate)
        vector = ot.CompositeRandomVector(function, ot.RandomVector(ot.Normal(dimension)))
        algorithm = ot.SubsetSampling(ot.ThresholdEvent(vector, ot.Less(), 0.0))
        algorithm.setMaximumOuterSampling(LEAST // BLOCK)
        algorithm.setBlockSize(BLOCK)
        algorithm.setKeepSample(True)
        algorithm.run()
    except Exception as error:
        if not trouble:
            raise uqmbd.IntegrationError(
                f"OpenTURNS's subset simulation failed: {error}. Use method='auto'."
            ) from error
        if not isinstance(trouble[0], BudgetExhausted):
            raise trouble[0] from None
        raise uqmbd.IntegrationError(
            f"OpenTURNS's subset simulation needs more than the allowed {most} realisations. Increase "
            "max_realisations, or use method='auto'."
        ) from None
    finally:
        ot.RandomGenerator.SetState(before)
    result = algorithm.getResult()
    probability = float(result.getProbabilityEstimate())
    cov = DEPENDENCE * float(result.getCoefficientOfVariation())
    last = np.array(algorithm.getInputSample(algorithm.getStepsNumber() - 1, algorithm.EVENT1))
    factor = float(np.exp(stats.norm.ppf(0.975) * np.sqrt(np.log1p(cov**2))))
    # count failures among the points of the first level, which are standard normal
    lost, most_lost = failing(np.zeros(0), LEAST, int(np.isnan(ledger.margins[:LEAST, 0]).sum()))
    known = max(1.0 - lost, 1e-12)
    one = ProbabilityEstimate(
        min(probability / known, 1.0),
        cov * probability / known,
        probability / factor,
        min(probability * factor + most_lost, 1.0),
    )
    rows = np.array([seen[row.tobytes()] for row in last])
    sampled = Sampled(last, np.full(len(last), probability), ledger.margins[rows], rows)
    notes = (f"by OpenTURNS {ot.__version__}, with its coefficient of variation multiplied by {DEPENDENCE:g}",)
    return Analysis((one,), (), sampled, ledger, notes, dependent=True)
