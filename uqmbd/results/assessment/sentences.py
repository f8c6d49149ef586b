"""How good each output of a method is, in one statement: what is worst first, and everywhere in the same words."""

from __future__ import annotations

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.results.assessment.limits import EXACT
from uqmbd.results.assessment.own_errors import OwnError, own_error
from uqmbd.results.chaos import stated_words, stored_surrogates, verdict_of_decay
from uqmbd.results.statistics import rtol_of

__all__ = ["NO_SPREAD", "STILL", "own_statements"]


NO_SPREAD = "no spread"
"""Kind of a verdict on an output that does not vary."""

STILL = "does not vary beyond the integration error"
"""The sentence about it."""

_REMEDIES = {"chaos": "raise the order", "elements": "allow more elements, or raise the order"}


@typechecked
def own_statements(node: xr.DataTree, own: OwnError | None = None) -> list[str]:
    """Say of each output of a method how large an error the method itself states.

    `node`: a propagator's node, or its child ``scalars``; `own`: what is known of its errors, at all its times.
    Return ``does not vary beyond the integration error``; the stated error, of a surrogate with the time from which
    on it is above 1 %; of a chaos that states none how its coefficients have fallen; or ``states no error``.

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
    times = np.asarray(statistics["time"].values, dtype=float) if "time" in statistics["mean"].dims else None
    split = {row for part in stored_surrogates(node) if part.split for row in part.rows.tolist()}
    said = []
    for o, name in enumerate(str(value) for value in statistics["output"].values):
        known = np.isfinite(found.std[o])
        told = found.told[o, known]
        if not found.varies[o]:
            said.append(STILL)
        elif not told.size or np.isnan(told).any():
            said.append(_decay(node, name, o) or "states no error")
        elif found.samples:
            at = None if times is None else times[known]
            said.append(stated_words("samples", told, at, np.inf))
        else:
            at = None if times is None else times[known]
            said.append(stated_words("surrogate", told, at, EXACT, _REMEDIES["elements" if o in split else "chaos"]))
    return said


def _decay(node: xr.DataTree, name: str, output: int) -> str:
    """Say how the coefficients of an expansion at equal times have fallen; empty where there is none."""
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
