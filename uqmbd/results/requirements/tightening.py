"""Probabilities of violation if the spread of one input is smaller, from a stored surrogate of margins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqmbd.randomness import GermSpace
from uqmbd.randomness.space import CorrelatedTransform
from uqmbd.results.chaos import Surrogate, spread_germs, surrogate, surrogate_parts
from uqmbd.results.requirements.counting import events, failures_in
from uqmbd.results.requirements.intervals import clopper_pearson
from uqmbd.results.requirements.surrogates import margin_bands, margins_of, signs_allow
from uqmbd.typing import Array

SAMPLES = 1 << 15
"""Number of samples of the surrogate for each input."""

__all__ = ["TightenedProbability", "tightened_probabilities"]


@dataclass(frozen=True)
class TightenedProbability:
    """Probability of one event if the standard deviation of one input is multiplied by a factor."""

    input: str
    probability: float
    lower: float
    upper: float


def tightened_probabilities(
    part: xr.DataTree, event: str, inputs: Sequence[str], factor: float = 0.5
) -> dict[str, TightenedProbability]:
    """Return the probability of an event for each input, if its deviations from its mean are multiplied by `factor`.

    `part`: the node ``requirements`` of a method. The result excludes dependent and discrete inputs. The result is
    empty if the surrogate does not follow the margin, or if the method has no verification realisations.
    """
    data = part.to_dataset()
    names = [str(name) for name in data["requirement"].values]
    if not surrogate_parts(part) or event not in names:
        return {}
    last = part.children["statistics"].sizes.get("time", 1) - 1
    chaos = surrogate(part, times=[last])
    if chaos.verification_germs is None or chaos.verification_response is None:
        return {}
    germs = spread_germs(chaos.space, SAMPLES, 0)
    before = margins_of(chaos, germs)
    bands = margin_bands(chaos, before)
    k = names.index(event)
    if not signs_allow(chaos, before)[2][k]:
        return {}
    lost = float(data.attrs.get("failed", 0.0))
    known = [one.name for one in chaos.labels.inputs]
    found = {}
    for name in inputs:
        if name in known and (moved := _tightened(chaos.space, germs, known.index(name), factor)) is not None:
            happened, least, most = _counts(chaos, moved, before, bands)[:, k]
            total = len(germs)
            lower, upper = failures_in(clopper_pearson(least, total)[0], clopper_pearson(most, total)[1], lost)
            found[name] = TightenedProbability(name, float(happened / total), float(lower), float(upper))
    return found


def _tightened(space: GermSpace, germs: Array, column: int, factor: float) -> Array | None:
    """Return germs (K, d) with the input of a column nearer to its mean by a factor; None if this is impossible."""
    group = next(one for one in space.groups if column in one.columns)
    if not isinstance(group, CorrelatedTransform) or len(group.columns) > 1 or space.germs[column].values is not None:
        return None
    (marginal,), moved = group.marginals, germs.copy()
    values = marginal.to_input(germs[:, column])
    middle = float(values.mean())
    moved[:, column] = marginal.to_germ(middle + factor * (values - middle))
    return moved if np.isfinite(moved).all() else None


def _counts(chaos: Surrogate, germs: Array, before: Array, bands: Array) -> Array:
    """Count events (3, event) at germs (K, d): with unchanged margins, and with margins plus and minus the error."""
    margins = margins_of(chaos, germs)
    error = np.empty_like(margins)
    for j, order in enumerate(np.argsort(before, axis=0).T):
        error[:, j] = np.interp(margins[:, j], before[order, j], bands[order, j])
    moved = (margins + shift for shift in (0.0, error, -error))
    return np.stack([events(one[:, :, None])[:, :, 0].sum(axis=0) for one in moved])
