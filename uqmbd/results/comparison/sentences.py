"""How good each output of a method is, in one statement: what is worst first, and everywhere in the same words."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from uqmbd.results.chaos import stated_words, stored_surrogates, verdict_of_decay
from uqmbd.results.comparison.own_errors import OwnError, own_error
from uqmbd.results.statistics import rtol_of

__all__ = ["LIMIT", "NO_SPREAD", "STILL", "own_statements", "statements"]


LIMIT = 0.01
"""Error, relative to the standard deviation, up to which a surrogate is trusted."""

NO_SPREAD = "no spread"
"""Kind of a verdict on an output that does not vary."""

STILL = "does not vary beyond the integration error"
"""What is said of it."""

_REMEDIES = {"chaos": "raise the order", "elements": "allow more elements, or raise the order"}


def own_statements(node: xr.DataTree, own: OwnError | None = None) -> list[str]:
    """Say of each output of a method how large an error the method itself states.

    Parameters
    ----------
    node : xarray.DataTree
        A propagator's node, or its child ``scalars``.
    own : OwnError, optional
        What is known of its errors, at all its times.

    Returns
    -------
    list of str, length O
        ``does not vary beyond the integration error``; the stated error, of a surrogate with the time from which on it
        is above 1 %; of a chaos that states none how its coefficients have fallen; or ``states no error``.

    Examples
    --------
    >>> import chaospy
    >>> import uqmbd
    >>> from uqmbd.results.comparison import own_statements
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
            said.append(stated_words("surrogate", told, at, LIMIT, _REMEDIES["elements" if o in split else "chaos"]))
    return said


def statements(tree: xr.DataTree, nodes: Mapping[str, xr.DataTree]) -> dict[tuple[str, str], str]:
    """Return the one statement on each output of each method of a result.

    Parameters
    ----------
    tree : xarray.DataTree
        The result of a study.
    nodes : mapping of str to xarray.DataTree
        Its methods.

    Returns
    -------
    dict of (str, str) to str
        By label and output, those without a time included: the verdict of the comparison, which for a single method,
        and in results of earlier versions, is what the method states itself.

    Examples
    --------
    >>> import chaospy
    >>> import uqmbd
    >>> from uqmbd.results import propagator_nodes
    >>> from uqmbd.results.comparison import statements
    >>> from uqmbd_collocation import Collocation
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> mechanism.output("height", stone.position[0], units="m")
    >>> tree = uqmbd.Study("throw", mechanism, [0, 1], [Collocation(order=1)]).run()
    >>> statements(tree, propagator_nodes(tree))
    {('collocation', 'height'): 'stated error of the surrogate below 0.0001 % of the standard deviation (at 1 s)'}
    """
    found: dict[tuple[str, str], str] = {}
    data = tree.children["comparison"].to_dataset() if "comparison" in tree.children else xr.Dataset()
    for label, node in nodes.items():
        timeless = node.children.get("scalars")
        for part, dimension, verdict in ((node, "output", "verdict"), (timeless, "scalar", "scalar_verdict")):
            if part is None:
                continue
            names = [str(value) for value in part.children["statistics"].to_dataset()["output"].values]
            if verdict in data and label in data["method"].values:
                row = data[verdict].sel({"method": label})
                compared = dict(zip(map(str, row[dimension].values), map(str, row.values), strict=True))
            else:
                compared = {}
            own = own_statements(part) if any(not compared.get(name) for name in names) else [""] * len(names)
            found |= {(label, name): compared.get(name) or text for name, text in zip(names, own, strict=True)}
    return found


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
    return verdict_of_decay(name, coefficients, index, germs, times, LIMIT).removeprefix(f"{name}: ")
