"""Data of stored surrogates for a page, evaluated by `surrogate.js`, and their accuracy after compression."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.plugins import InputTreatment, such_as
from uqmbd.randomness import GermBox, GermSpace
from uqmbd.report.charts import json_script, packed, packed_relative, unpacked
from uqmbd.report.live.compression import compressed, expanded
from uqmbd.report.live.polynomials import polynomial_of
from uqmbd.report.live.tables import germ_data, input_data
from uqmbd.results import (
    AlignedChaos,
    ComposedChaos,
    PiecewiseChaos,
    PolynomialChaos,
    QuasiPeriodicChaos,
    propagator_nodes,
    surrogate,
)
from uqmbd.results.assessment import recommended
from uqmbd.results.chaos import (
    AlignedElement,
    CustomSurrogate,
    QuasiPeriodicElement,
    Surrogate,
    absent_surrogate,
    reference_spread,
    spread_germs,
    surrogate_parts,
)
from uqmbd.typing import Array, Index, Mask
from uqmbd.wording import typeset_units

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["LARGEST", "live_method", "live_surrogate", "no_surrogate", "packed_surrogate", "shipped", "with_surrogate"]


SHARE = 0.1
"""Allowed compression error, relative to the stated error."""

LEAST = 1e-6
"""Minimum allowed compression error, relative to the standard deviation, for small or unknown stated errors."""

ROUNDING = 1e-14
"""Rounding error relative to the largest mean."""

PROBES = 256
"""Number of germ points for the measurement of the compression error."""

MARGIN = 0.6
"""Limit of the measured error, relative to the allowed error; below 1, because germ points do not cover all tails."""

TIGHTER = (1.0, 0.5, 0.2, 0.04, 0.008, 0.0)
"""Factors of the allowed error of coefficients, tried in turn until the error of outputs is allowed; 0: no
compression."""

RELATIVE = 2e-4
"""Allowed relative error of a stated error; a page shows two digits."""

PERIOD = 13
"""Maximum distance, in segments, at which similar earlier segments are searched."""

LARGEST = 4_000_000
"""Maximum number of characters of a surrogate in a page."""


def no_surrogate() -> str:
    """Return the reason why a page has no surrogate, with methods that compute one."""
    methods = such_as(InputTreatment.INTERPOLATE)
    return f"The results contain samples, but no surrogate. Add a method that computes one{methods}."


def live_method(tree: xr.DataTree) -> str:
    """Return the label of the method with the surrogate of a page; empty without a surrogate.

    The recommended method has priority. Otherwise, the method whose largest stated error is smallest is used; without
    stated errors, the first method.
    """
    nodes = {label: with_surrogate(node) for label, node in propagator_nodes(tree).items()}
    nodes = {label: node for label, node in nodes.items() if surrogate_parts(node)}
    compared = tree.children["comparison"].to_dataset() if "comparison" in tree.children else None
    advised = recommended(compared) if compared is not None and "method" in compared else ()
    for label in advised:
        if label in nodes:
            return label

    def largest(label: str) -> float:
        error = nodes[label].children["statistics"].to_dataset().get("verification_error")
        known = np.zeros(0) if error is None else error.values[np.isfinite(error.values)]
        return float(known.max()) if known.size else np.inf

    return min(nodes, key=largest, default="")


def with_surrogate(node: xr.DataTree) -> xr.DataTree:
    """Return the node of a method, or the node of its scalar outputs or margins if only these have a surrogate."""
    parts = (node, *(node.children[name] for name in ("scalars", "requirements") if name in node.children))
    return next((part for part in parts if surrogate_parts(part)), node)


def live_surrogate(node: xr.DataTree, most: int = LARGEST, *, at_the_end: bool = False) -> dict[str, Any]:
    """Return the surrogate of a method as data, or ``{"reason": ...}`` with the reason why it is missing.

    `node` is the node of a method, or its child ``scalars`` or ``requirements``; `most` is the maximum number of
    characters of data. `at_the_end` selects the last time, at which running margins refer to the whole motion.
    """
    if not surrogate_parts(node):
        return {"reason": absent_surrogate(node) or no_surrogate()}
    try:
        times = node.children["statistics"].to_dataset().sizes.get("time", 0)
        chaos = surrogate(node, times=[times - 1]) if at_the_end and times else surrogate(node)
        data = packed_surrogate(chaos)
    except StudyError as error:
        return {"reason": str(error)}
    size = len(json_script(data))
    if size > most:
        return {
            "reason": f"The size of the surrogate is {size / 1e6:.1f} MB, above the limit of {most / 1e6:.1f} MB for a "
            "page. Use a lower order, fewer output times or fewer outputs."
        }
    return data


def packed_surrogate(chaos: Surrogate) -> dict[str, Any]:
    """Return a surrogate as plain data.

    The coefficients are compressed. The root mean square compression error over `PROBES` germ points is limited for
    every output and time. The limit is one tenth of the stated error, or a millionth of the standard deviation if this
    is larger. `shipped` returns the surrogate with the compressed coefficients.

    The result is for `json_script`. The keys are ``outputs``, ``times``, ``inputs``, ``germs`` and ``parts``.
    ``stated_rms`` is the stated error (O, T) in the units of the outputs, or None without verification. ``loss`` is the
    largest ratio of actual to allowed compression error. ``fitted`` describes polynomials that replace the model of a
    plugin (see `polynomial_of`), or is None. Raise StudyError for a surrogate of another kind, or if the compression
    fails.
    """
    fitted = None
    if isinstance(chaos, CustomSurrogate):
        # the stated error of the polynomials refers to the verification realisations, not to the model
        chaos, fitted = polynomial_of(chaos)
    germs = spread_germs(chaos.space, PROBES, 0)
    values = chaos.evaluate_germs(germs).reshape(len(germs), len(chaos.labels.outputs), -1)
    if not np.isfinite(values).any():
        raise StudyError("The surrogate has no values at the output times.")
    known = chaos.verification_germs is not None
    shape = values.shape[1:]
    rms = chaos.verification_rms().reshape(shape) if known else np.zeros(shape)
    allowed = _allowed(values, rms)
    parts, worst = [], 0.0
    for part, rows, used in _parts(chaos):
        for tightened in TIGHTER:
            data = _part(part, tightened * allowed[rows], rows)
            made = _restored(part, data).evaluate_germs(germs).reshape(len(germs), len(rows), -1)
            lost = _root_mean_square(made - values[:, rows]) / allowed[rows]
            loss = float(np.max(lost, initial=0.0, where=used))
            if loss <= MARGIN:
                break
        else:
            raise StudyError(f"The compression error of the surrogate is {loss:.3g} times the allowed error.")
        parts.append(data if used.all() else {**data, "used": packed(used.astype(float), "int32")})
        worst = max(worst, loss)
    times = chaos.labels.times
    return {
        "outputs": [
            {"name": o.name, "units": typeset_units(o.units), "turn": float(o.turn)} for o in chaos.labels.outputs
        ],
        "times": None if times is None else packed(times),
        "inputs": input_data(chaos.space, chaos.labels),
        "germs": germ_data(chaos.space, chaos.verification_germs),
        "parts": parts,
        "stated_rms": packed_relative(rms, RELATIVE) if known else None,
        "loss": worst,
        "fitted": fitted,
    }


def shipped(chaos: Surrogate, data: Mapping[str, Any]) -> Surrogate:
    """Return the surrogate with the compressed coefficients of the page."""
    parts: list[Surrogate] = [
        _restored(part, own) for (part, _, _), own in zip(_parts(chaos), data["parts"], strict=True)
    ]
    if isinstance(chaos, ComposedChaos):
        return replace(chaos, parts=dict(zip(chaos.parts, parts, strict=True)))  # type: ignore[arg-type]
    return parts[0]


def _parts(chaos: Surrogate) -> list[tuple[Any, list[int], Mask]]:
    """Return the part of each kind, the indices of its outputs, and a mask (own outputs, T) of its times."""
    parts = dict(chaos.parts) if isinstance(chaos, ComposedChaos) else {"": chaos}
    used = (chaos.used if isinstance(chaos, ComposedChaos) else None) or {}
    names = [o.name for o in chaos.labels.outputs]
    found = []
    for key, part in parts.items():
        rows = [names.index(o.name) for o in part.labels.outputs]
        found.append((part, rows, np.asarray(used.get(key, np.ones(part.labels.shape, bool))).reshape(len(rows), -1)))
    return found


def _allowed(values: Array, rms: Array) -> Array:
    """Return the allowed root mean square compression error (O, T); `rms` (O, T) is the stated error."""
    there = np.isfinite(values)
    count = np.maximum(there.sum(axis=0), 1)
    mean = np.where(there, values, 0.0).sum(axis=0) / count
    std = _root_mean_square(values - mean)
    rounding = ROUNDING * np.abs(mean).max(axis=-1, keepdims=True)
    stated = np.where(np.isfinite(rms), rms, 0.0)
    floor = np.maximum(LEAST * reference_spread(std), rounding)
    return np.asarray(np.maximum(np.maximum(SHARE * stated, floor), np.finfo(float).tiny))


def _root_mean_square(values: Array) -> Array:
    """Return the root mean square over the first axis; NaN is ignored."""
    there = np.isfinite(values)
    square = np.where(there, values, 0.0) ** 2
    return np.asarray(np.sqrt(square.sum(axis=0) / np.maximum(there.sum(axis=0), 1)))


def _part(part: Surrogate, allowed: Array, rows: list[int]) -> dict[str, Any]:
    terms = part.multi_index
    if isinstance(part, PolynomialChaos | PiecewiseChaos):
        boxes = part.boxes if isinstance(part, PiecewiseChaos) else (GermBox.whole(part.space),)
        whole = part.coefficients.reshape(len(boxes), len(terms), len(rows), -1)
        own: dict[str, Any] = {"kind": "polynomial", "field": compressed(whole, allowed)}
    elif isinstance(part, AlignedChaos):
        boxes = tuple(e.box for e in part.elements)
        times = np.asarray(part.labels.times)
        own = {"kind": "segments", "elements": [_segments(e, times, allowed) for e in part.elements]}
    elif isinstance(part, QuasiPeriodicChaos):
        boxes = tuple(e.box for e in part.elements)
        own = {
            "kind": "waves",
            "lattice": packed(part.lattice, "int32"),
            "origin": float(part.origin),
            "elements": [_harmonics(e, allowed) for e in part.elements],
        }
    else:
        raise StudyError(f"A {type(part).__name__} cannot be evaluated in a page.")
    lower, upper = _ends(boxes)
    return {
        "outputs": rows,
        "degrees": packed(terms, "int32"),
        "lower": packed(lower),
        "upper": packed(upper),
        "recurrences": packed(_recurrences([box.local for box in boxes], terms)),
        **own,
    }


def _segments(element: AlignedElement, times: Array, allowed: Array) -> dict[str, Any]:
    """Pack segments; edges are not compressed, because an error in an edge changes the output by its slope."""
    terms, count, outputs, powers = element.segments.shape
    limits = np.empty((outputs, count, powers))
    for s in range(count):
        inside = (times >= element.edges[0, s]) & (times <= element.edges[0, s + 1])
        own = allowed[:, inside] if inside.any() else allowed
        # use the smallest limit within the segment only: at the start of the motion, the allowed error is almost zero
        limits[:, s] = own.min(axis=1, keepdims=True) / np.sqrt(powers)
    flat = element.segments.transpose(0, 2, 1, 3).reshape(1, terms, outputs, count * powers)
    # segments may be similar to segments of the previous turn, for example of a crank
    field = compressed(flat, limits.reshape(outputs, -1), [k * powers for k in range(1, min(PERIOD, count))])
    return {"edges": packed(element.edges), "segments": count, "powers": powers, "field": field}


def _harmonics(element: QuasiPeriodicElement, allowed: Array) -> dict[str, Any]:
    """Pack harmonics; frequencies and drifts are not compressed, because their errors grow with time."""
    both = np.concatenate([element.waves.real, -element.waves.imag], axis=2)
    limits = np.sqrt((allowed**2).mean(axis=1, keepdims=True) / max(both.shape[2], 1)) * np.ones(both.shape[2])
    return {
        "frequencies": packed(element.frequencies),
        "constants": packed(element.constants),
        "drifts": packed(element.drifts),
        "field": compressed(both[None], limits),
    }


def _ends(boxes: tuple[GermBox, ...]) -> tuple[Array, Array]:
    """Return the ends of elements (E, d); infinite at the ends of the support, which require no test."""
    lower, upper = (np.array([getattr(box, name) for box in boxes]) for name in ("lower", "upper"))
    bounds = np.array([germ.bounds for germ in boxes[0].space.germs])
    return np.where(lower > bounds[:, 0], lower, -np.inf), np.where(upper < bounds[:, 1], upper, np.inf)


def _recurrences(spaces: list[GermSpace], terms: Index) -> Array:
    """Return recurrence coefficients (E, d, 2, N) of orthonormal polynomials: alpha and the square root of beta."""
    highest = terms.max(axis=0)
    found = np.zeros((len(spaces), terms.shape[1], 2, int(highest.max(initial=0)) + 1))
    for e, space in enumerate(spaces):
        for k, germ in enumerate(space.germs):
            # an element with few values of a discrete germ has fewer polynomials than other elements
            most = highest[k] if germ.highest_degree is None else min(highest[k], germ.highest_degree)
            alpha, beta = germ.coefficients(int(most) + 1)
            found[e, k, :, : len(alpha)] = alpha, np.sqrt(beta)
    return found


def _restored(part: Any, data: Mapping[str, Any]) -> Any:
    """Return a surrogate of one kind with the compressed coefficients of the page."""
    if isinstance(part, PolynomialChaos):
        return replace(part, coefficients=expanded(data["field"])[0].reshape(part.coefficients.shape))
    if isinstance(part, PiecewiseChaos):
        whole = expanded(data["field"]).reshape(part.coefficients.shape)
        trios = zip(part.elements, whole, _places(part), strict=True)
        return PiecewiseChaos(tuple(replace(e, coefficients=own[there]) for e, own, there in trios), part.boxes)
    elements: list[Any] = []
    for element, own in zip(part.elements, data["elements"], strict=True):
        field = expanded(own["field"])[0]
        if isinstance(part, AlignedChaos):
            terms, count, outputs, powers = element.segments.shape
            segments = field.reshape(terms, outputs, count, powers).transpose(0, 2, 1, 3)
            elements.append(replace(element, segments=segments, edges=unpacked(own["edges"])))
        else:
            real, imaginary = np.split(field, 2, axis=2)
            others = {name: unpacked(own[name]) for name in ("frequencies", "constants", "drifts")}
            elements.append(replace(element, waves=real - 1j * imaginary, **others))
    return replace(part, elements=tuple(elements))


def _places(part: PiecewiseChaos) -> list[list[int]]:
    """Return the indices of the terms of each element among all terms."""
    place = {tuple(row): k for k, row in enumerate(part.multi_index.tolist())}
    return [[place[tuple(row)] for row in element.multi_index.tolist()] for element in part.elements]
