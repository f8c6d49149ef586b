"""Where realisations are needed for an order, and how the chaos is found from them."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

import uqmbd
from uqmbd.typing import Array, Index
from uqmbd_collocation.fitting import Projection, Regression

if TYPE_CHECKING:
    from uqmbd_collocation.propagator import Collocation

__all__ = ["basis", "estimate", "plan", "verification_points"]


VERIFICATION = 0x7E51F1
"""Enters the seed of the verification points, which must be no points of a design."""
FEW = 100
"""Samples below which a sparse regression gets as many as an ordinary one by default."""


def basis(options: Collocation, space: uqmbd.GermSpace, order: int) -> Index:
    """Return the terms of an order, shape (P, d), without those that a germ of few values does not have."""
    multi_index = uqmbd.index_set(space.dimension, order, options.index_set, options.weights)
    for k, germ in enumerate(space.germs):
        if germ.values is not None:
            multi_index = multi_index[multi_index[:, k] < germ.values]
    return multi_index


def plan(options: Collocation, space: uqmbd.GermSpace, order: int, label: str) -> Projection | Regression:
    """Choose nodes and the way to fit them; nothing is computed yet.

    Raises
    ------
    uqmbd.StudyError
        If an option does not suit the inputs, or there would be more than ``max_realisations``.
    """
    multi_index = basis(options, space, order)
    if options.grid:
        if options.grid == "gauss":
            _check_number(options, space, order, math.prod(_gauss_counts(options, space, multi_index)))
        rule = _grid(options, space, order, multi_index)
        _check_number(options, space, order, len(rule))
        return Projection(rule, multi_index, _exact(options, rule, multi_index, space), label)
    count = options.samples or _enough(len(multi_index), options.method)
    _check_number(options, space, order, count)
    rule = _samples(options, space, count)
    if options.method == "projection":
        return Projection(rule, multi_index, False, label)
    return Regression(rule.nodes, multi_index, options.method, label)


def _enough(terms: int, method: str) -> int:
    """Return the default number of samples."""
    if method in ("omp", "lars"):
        return max(min(2 * terms, max(terms, FEW)), 3)
    return max(2 * terms, 2)


def estimate(options: Collocation, study: uqmbd.Study) -> uqmbd.Estimate:
    """Count realisations, and the memory of their outputs and of the chaos; nothing is computed."""
    space = uqmbd.GermSpace.of(study.mechanism.inputs, options.transform)
    values = len(study.mechanism.outputs) * len(study.times) + len(study.mechanism.scalars)
    if options.adaptive != "no":
        most = options.max_realisations
        return uqmbd.Estimate(most, 8 * 3 * most * values, f"{most} realisations", at_most=True)
    planned = plan(options, space, options.order, options.node_name)
    nodes, terms = len(planned.nodes), len(planned.multi_index)
    boxes, unknown = 1, options.alignment is not None
    if options.elements is not None:
        limits = uqmbd.ElementLimits(options.elements, options.max_elements, options.threshold)
        boxes, unknown = 2 * limits.count - 1, limits.adaptive
    one = (nodes + options.verify) * (3 * values + terms) + 3 * terms * values
    detail = f"{nodes} nodes, {terms} terms" + (f" in each of {boxes} elements" if boxes > 1 else "")
    return uqmbd.Estimate(boxes * nodes + options.verify, 8 * boxes * one, detail, at_most=unknown)


def verification_points(space: uqmbd.GermSpace, count: int, seed: int) -> Array:
    """Return germ points, shape (K, d), that no design uses."""
    if not count:
        return np.zeros((0, space.dimension))
    own = int(np.random.SeedSequence([seed, VERIFICATION]).generate_state(1)[0])
    return uqmbd.monte_carlo_rule(space, count, own, "sobol").nodes


def _check_number(options: Collocation, space: uqmbd.GermSpace, order: int, nodes: int) -> None:
    if nodes + options.verify <= options.max_realisations:
        return
    raise TooManyNodes(
        f"Collocation: order {order} with {space.dimension} inputs takes {nodes} nodes and {options.verify} "
        f"verification realisations, more than max_realisations = {options.max_realisations}. "
        f"{_remedy(options, space, order)}"
    )


class TooManyNodes(uqmbd.StudyError):
    """More realisations than are allowed."""


def _remedy(options: Collocation, space: uqmbd.GermSpace, order: int) -> str:
    """Options that this study works with: tried, not guessed."""
    plain: dict[str, Any] = {"rule": None, "nodes": None, "level": None, "samples": None, "adaptive": "no"}
    ways: list[dict[str, Any]] = [
        {"rule": "smolyak"},
        {"method": "regression"},
        {"method": "omp"},
        {"order": max(1, order - 1), "method": "regression"},
        {"order": 1, "method": "regression"},
    ]
    for way in ways:
        try:
            tried = replace(options, **{**plain, "elements": None, "max_realisations": 10**9, **way})
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                found = plan(tried, space, tried.order, "")
                total = len(found.nodes) + options.verify
                if total > options.max_realisations:
                    continue
                found.check(space)
        except (uqmbd.StudyError, Warning):  # a rule of a huge order may overflow
            continue
        given = ", ".join(f"{name}={value!r}" for name, value in way.items())
        left = [f"{name}=" for name in ("nodes", "level", "samples", "elements") if getattr(options, name) is not None]
        left += ["adaptive="] if options.adaptive != "no" else []
        left += ["rule="] if options.rule is not None and "rule" not in way else []
        without = f" without {', '.join(left)}" if left else ""
        return f"Use {given}{without} ({total} realisations), adaptive='dimension', or allow more."
    return "Use adaptive='dimension', or allow more."


def _gauss_counts(options: Collocation, space: uqmbd.GermSpace, multi_index: Index) -> list[int]:
    if options.nodes is None:
        return [int(n) + 1 for n in multi_index.max(axis=0)]
    if len(options.nodes) == 1:
        return [options.nodes[0]] * space.dimension
    if len(options.nodes) != space.dimension:
        raise uqmbd.StudyError(
            f"Collocation: nodes has {len(options.nodes)} entries; expected one number, or one for each of the "
            f"{space.dimension} inputs ({', '.join(space.names)})."
        )
    return list(options.nodes)


def _grid(options: Collocation, space: uqmbd.GermSpace, order: int, multi_index: Index) -> uqmbd.Quadrature:
    if options.grid == "gauss":
        return uqmbd.gauss_tensor(space, _gauss_counts(options, space, multi_index))
    if options.grid == "smolyak":
        return uqmbd.smolyak(space, order if options.level is None else options.level)
    if options.level is not None:
        return uqmbd.clenshaw_curtis(space, options.level)
    # 2^level + 1 nodes: exact for products of two polynomials of uniform germs
    levels = [max(1, int(np.ceil(np.log2(2 * n)))) if n else 0 for n in multi_index.max(axis=0)]
    _check_number(options, space, order, math.prod(2**level + 1 if level else 1 for level in levels))
    return uqmbd.clenshaw_curtis(space, levels)


def _exact(options: Collocation, rule: uqmbd.Quadrature, multi_index: Index, space: uqmbd.GermSpace) -> bool:
    """Whether products of the basis are known to be integrated exactly."""
    if options.grid == "gauss":
        degrees = multi_index.max(axis=0)
        return all(n > k for n, k in zip(_gauss_counts(options, space, multi_index), degrees, strict=True))
    return rule.exactness is not None and 2 * int(multi_index.sum(axis=1).max()) <= rule.exactness


def _samples(options: Collocation, space: uqmbd.GermSpace, count: int) -> uqmbd.Quadrature:
    if options.design != "latin-hypercube":
        return uqmbd.monte_carlo_rule(space, count, options.seed, options.design)
    from scipy.stats import qmc

    uniform = qmc.LatinHypercube(space.dimension, rng=np.random.default_rng(options.seed)).random(count)
    # the ends of the interval would map to infinity
    germs = space.from_uniform(np.clip(uniform, 2.0**-54, 1 - 2.0**-53))
    return uqmbd.Quadrature(germs, np.full(count, 1 / count), 0, f"{count} samples, latin-hypercube")
