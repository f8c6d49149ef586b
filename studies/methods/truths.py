"""True statistics of the mechanisms, with their errors: stored, one small file for each mechanism.

A closed form, or an integration at a thousandth of the tolerance, is evaluated at eight independent scramblings of a
Sobol' sequence.  The error of a statistic is the larger of two numbers: the standard error over the eight parts, and
the difference between half of the points and all of them.  Where there is a closed form, ``route`` is the largest
difference between it and an integration; elsewhere it is the change when the integration is 100 times tighter.  Both
are relative to the largest standard deviation of the output.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

from uqmbd_montecarlo import MonteCarlo

from .cases import CASES, Array, Reference, index_estimates

__all__ = ["FOLDER", "LEVELS", "QUANTILES", "Truth", "compute_truth", "load_truth"]

FOLDER = Path(__file__).resolve().parent / "truths"
PARTS = 8
"""Independent scramblings of the Sobol' sequence."""
CLOSED, INTEGRATED = 19, 14
"""Binary logarithms of the numbers of points: with a closed form, and without one."""
PAIRS, PAIRS_INTEGRATED = 14, 9
"""Binary logarithms of the numbers of points of Sobol' indices."""
MORE = {"disc, weight and friction": (16, 13)}
"""Both for mechanisms whose response oscillates many times over the inputs."""
QUANTILES = 0.01, 0.99
LEVELS = 1e-1, 1e-2, 1e-3, 1e-4
"""Probabilities of violation, as far as 50 points or more are beyond them."""
CHUNK = 2**15
"""Points that are evaluated at once."""


@dataclass(frozen=True)
class Truth:
    """Statistics of a mechanism at few times, with their errors.

    Attributes
    ----------
    outputs : tuple of str
        Names.
    values, errors : dict
        ``mean``, ``std``, ``quantile_0.01``, ``quantile_0.99`` (output, time); ``first``, ``total`` Sobol' indices
        (input, output, time); ``probability`` (level,).
    scale : array
        Largest standard deviation over time, (output, 1).
    levels : dict
        Limits of the first output at the last time, by name of the requirement.
    route : float
        Largest difference to the second route, over the largest standard deviation.
    """

    outputs: tuple[str, ...]
    values: Mapping[str, Array]
    errors: Mapping[str, Array]
    scale: Array
    levels: Mapping[str, float]
    route: float


def output_names(reference: Reference, known: Collection[str]) -> tuple[str, ...]:
    """Return the outputs of a mechanism that a reference solution has."""
    names = [*reference.mechanism.outputs, *reference.mechanism.scalars]
    return tuple(name for name in names if name in known)


def responses(reference: Reference, points: Array) -> Array:
    """Return all outputs (K, output, T) at points (K, input) of the unit cube; outputs without a time repeat."""
    parts = []
    for k in range(0, len(points), CHUNK):
        found = reference.responses(reference.inputs.from_uniform(points[k : k + CHUNK]), reference.coarse)
        own = [found[name] for name in output_names(reference, found)]
        count = max(y.shape[1] for y in own)
        parts.append(np.stack([np.broadcast_to(y, (len(y), count)) for y in own], axis=1))
    return np.concatenate(parts)


def scrambled(width: int, power: int, part: int) -> Array:
    """Return 2**power points of an independently scrambled Sobol' sequence, in (0, 1)."""
    points = qmc.Sobol(width, rng=np.random.default_rng([2026, part])).random_base2(power)
    return np.clip(points, 1e-12, 1 - 1e-12)


def with_errors(whole: Array, parts: Array, half: Array) -> tuple[Array, Array]:
    """Return a statistic and its error: over the parts (PARTS, ...), and against that of half of the points."""
    over_parts = np.std(parts, axis=0, ddof=1) / np.sqrt(len(parts))
    return whole, np.fmax(over_parts, np.abs(whole - half))


def statistics(y: Array) -> dict[str, Array]:
    """Return mean, standard deviation and quantiles (output, T) of responses (K, output, T); failures are left out."""
    found = {"mean": np.nanmean(y, axis=0), "std": np.nanstd(y, axis=0)}
    for q, value in zip(QUANTILES, np.nanquantile(y, QUANTILES, axis=0), strict=True):
        found[f"quantile_{q:g}"] = value
    return found


def sobol_indices(reference: Reference, power: int, part: int) -> dict[str, Array]:
    """Return first and total indices (input, output, T) of one part."""
    d = len(reference.inputs)
    both = scrambled(2 * d, power, part)
    one, two = both[:, :d], both[:, d:]
    first, second = responses(reference, one), responses(reference, two)
    found = []
    for i in range(d):
        mixed = one.copy()
        mixed[:, i] = two[:, i]
        found.append(index_estimates(first, second, responses(reference, mixed)))
    return {name: np.stack([pair[k] for pair in found]) for k, name in enumerate(("first", "total"))}


def second_route(reference: Reference, scale: Array) -> float:
    """Return the largest difference of 16 realisations between two routes, over the largest standard deviation."""
    tight = reference.study(reference.coarse, 1e-11 if reference.tested.exact is None else 1e-9)
    node = tight.propagate(MonteCarlo(samples=16, seed=2026))
    drawn = node["samples" if "samples" in node.children else "scalars/samples"]
    values = drawn["inputs"].transpose("sample", "input").values
    names = reference.mechanism.outputs, reference.mechanism.scalars
    found = []
    for own, group in zip(names, ("samples", "scalars/samples"), strict=True):
        if own and group.split("/")[0] in node.children:
            data = node[group]["response"].transpose("sample", "output", ...).values
            found += [data[:, k] if data.ndim == 3 else data[:, [k]] for k in range(len(own))]
    exact = reference.responses(values, reference.coarse)
    differences = [
        np.abs(y - exact[name]) for y, name in zip(found, [*names[0], *names[1]], strict=False) if name in exact
    ]
    return float(max(np.nanmax(d) / s for d, s in zip(differences, scale[:, 0], strict=True)))


def compute_truth(name: str, powers: tuple[int, int] | None = None) -> Truth:
    """Return the true statistics of a mechanism.

    `powers` are the binary logarithms of the numbers of points of the statistics and of the indices.
    """
    reference = Reference(CASES[name])
    closed = reference.tested.exact is not None
    usual = (CLOSED, PAIRS) if closed else (INTEGRATED, PAIRS_INTEGRATED)
    power, pairs = powers or MORE.get(name, usual)
    width, each = len(reference.inputs), power - 3
    parts = [responses(reference, scrambled(width, each, part)) for part in range(PARTS)]
    whole, half = np.concatenate(parts), np.concatenate(parts[: PARTS // 2])
    values, errors = {}, {}
    own, of_half, of_parts = statistics(whole), statistics(half), [statistics(part) for part in parts]
    for statistic, value in own.items():
        every = np.stack([part[statistic] for part in of_parts])
        values[statistic], errors[statistic] = with_errors(value, every, of_half[statistic])
    if width > 1 and not MonteCarlo(sobol_indices=True).obstacle(reference.study()):
        every_index = [sobol_indices(reference, pairs - 3, part) for part in range(PARTS)]
        for statistic in ("first", "total"):
            every = np.stack([part[statistic] for part in every_index])
            values[statistic], errors[statistic] = with_errors(
                every.mean(axis=0), every, every[: PARTS // 2].mean(axis=0)
            )
    last = whole[:, 0, -1]
    known = last[np.isfinite(last)]
    levels = {f"exceeds_{p:g}": float(f"{np.quantile(known, 1 - p):.6g}") for p in LEVELS if p * len(known) >= 50}
    limits = np.array(list(levels.values()))
    shares = np.stack([(part[:, 0, -1][:, None] > limits).mean(axis=0) for part in parts])
    values["probability"], errors["probability"] = with_errors(
        shares.mean(axis=0), shares, shares[: PARTS // 2].mean(axis=0)
    )
    scale = np.nanmax(values["std"], axis=1, keepdims=True)
    names = tuple([*reference.mechanism.outputs, *reference.mechanism.scalars][: len(scale)])
    return Truth(names, values, errors, scale, levels, second_route(reference, scale))


def path_of(name: str) -> Path:
    """Return the file of a mechanism's truth."""
    return FOLDER / f"{re.sub('[^a-z]+', '_', name.lower()).strip('_')}.json"


def store_truth(name: str, truth: Truth) -> None:
    """Write a truth: values to ten digits, errors to two."""

    def numbers(array: Array, digits: int) -> Any:
        rounded = [float(f"{x:.{digits}g}") for x in array.ravel()]
        return np.array([None if np.isnan(x) else x for x in rounded], dtype=object).reshape(array.shape).tolist()

    made = {
        "mechanism": name,
        "outputs": truth.outputs,
        "levels": truth.levels,
        "route": truth.route,
        "scale": numbers(truth.scale, 10),
        "values": {key: numbers(x, 10) for key, x in truth.values.items()},
        "errors": {key: numbers(x, 2) for key, x in truth.errors.items()},
    }
    FOLDER.mkdir(exist_ok=True)
    path_of(name).write_text(json.dumps(made) + "\n", encoding="utf-8")


def load_truth(name: str) -> Truth:
    """Read the truth of a mechanism, or compute and store it; NaN where there is none."""
    if not path_of(name).exists():
        store_truth(name, compute_truth(name))
    data = json.loads(path_of(name).read_text(encoding="utf-8"))
    values, errors = ({key: np.array(x, dtype=float) for key, x in data[part].items()} for part in ("values", "errors"))
    return Truth(
        tuple(data["outputs"]), values, errors, np.array(data["scale"], dtype=float), data["levels"], data["route"]
    )
