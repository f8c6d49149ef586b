"""Describe the stated errors of a method by one sentence for each output."""

from __future__ import annotations

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.results.assessment.limits import EXACT
from uqmbd.results.assessment.own_errors import NO_VARIATION, OwnError, own_error
from uqmbd.results.chaos import stated_words, stored_surrogates, verdict_of_decay
from uqmbd.results.statistics import rtol_of

__all__ = ["own_statements"]


@typechecked
def own_statements(node: xr.DataTree, own: OwnError | None = None) -> list[str]:
    """Return a sentence on the stated error of each output of a method.

    `node`: node of a propagator, or its child ``scalars``; `own`: its errors at all times, if already collected. A
    sentence is ``does not vary beyond the integration error``, the stated error, or ``states no error``. The stated
    error of a surrogate is given with the time from which it exceeds 1 %. For a chaos without stated error, the
    sentence describes the decay of its coefficients.

    >>> import chaospy
    >>> import uqmbd
    >>> from uqmbd.results.assessment import own_statements
    >>> from uqmbd_collocation import Collocation
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> mechanism.output("height", stone.position[0], units="m")
    >>> tree = uqmbd.Study("throw", mechanism, [0, 1], [Collocation(order=1)]).run()
    >>> own_statements(tree["collocation"])
    ['stated error of the surrogate below 0.0001 % of the standard deviation (at 1 s)']
    """
    found = own_error(node, rtol_of(node), dependence=False) if own is None else own
    statistics = node.children["statistics"].to_dataset()
    variables = statistics.variables
    times = np.asarray(variables["time"].values, dtype=float) if "time" in variables["mean"].dims else None
    sentences = []
    for o, name in enumerate(str(value) for value in variables["output"].values):
        known = np.isfinite(found.std[o])
        stated = found.stated_at[o, known]
        if not found.varies[o]:
            sentences.append(NO_VARIATION)
        elif not stated.size or np.isnan(stated).any():
            sentences.append(_decay(node, name, o) or "states no error")
        elif found.drawn:
            at = None if times is None else times[known]
            sentences.append(stated_words("samples", stated, at, np.inf, std=found.std[o, known]))
        else:
            at = None if times is None else times[known]
            source, remedy = found.words[o]
            sentences.append(stated_words(source, stated, at, EXACT, remedy, found.std[o, known]))
    return sentences


def _decay(node: xr.DataTree, name: str, output: int) -> str:
    """Return a text on the decay of coefficients of an expansion at equal times; empty if there is none."""
    part = next((x for x in stored_surrogates(node) if x.equal_times and output in x.rows), None)
    if part is None or part.data["coefficients"].ndim > 3:
        return ""
    data, dims = part.data, part.data["coefficients"].dims
    row = part.rows.tolist().index(output)
    coefficients, index = data["coefficients"].values[:, row], data["multi_index"].values
    germs = [str(value) for value in data["germ" if "germ" in data.coords else "input"].values]
    times = np.asarray(data["time"].values, dtype=float) if "time" in dims else None
    if times is not None:
        known = np.isfinite(coefficients).all(axis=0)
        coefficients, times = coefficients[:, known], times[known]
        if not len(times):
            return ""
    return verdict_of_decay(name, coefficients, index, germs, times, EXACT).removeprefix(f"{name}: ")
