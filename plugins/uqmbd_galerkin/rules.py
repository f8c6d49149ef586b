"""Basis and quadrature of a Galerkin projection, and what it would take."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

import uqmbd
from uqmbd.typing import Index

if TYPE_CHECKING:
    from uqmbd_galerkin.propagator import Galerkin

__all__ = ["MOST_NODES", "basis", "estimate", "node_count", "quadrature"]


MOST_NODES = 20_000
"""Nodes beyond which the coupled problem is not set up."""
MOST_WORK = 5e10
"""Products that a remedy may be sought with: about a second."""
ALIASED = 0.5
"""Error of a rule for products of the basis beyond which it cannot tell the terms apart."""


def basis(options: Galerkin, space: uqmbd.GermSpace) -> Index:
    """Index set, without degrees that a germ of few values does not have: below them its basis is complete."""
    terms = uqmbd.index_set(space.dimension, options.order, options.products, options.weights)
    highest = [options.order if germ.values is None else germ.values - 1 for germ in space.germs]
    return np.asarray(terms[(terms <= highest).all(axis=1)])


def quadrature(options: Galerkin, label: str, space: uqmbd.GermSpace, terms: Index) -> uqmbd.Quadrature:
    """Return nodes and weights for a basis.

    Raises
    ------
    uqmbd.StudyError
        If the rule does not suit the inputs, or not the basis.
    """
    if options.rule == "gauss":
        node_count(options, space)
        counts = _gauss_counts(options, label, space)
        rule = uqmbd.gauss_tensor(space, counts)
    elif options.rule == "smolyak":
        rule = uqmbd.smolyak(space, int(options.level or 0))
    else:
        rule = uqmbd.monte_carlo_rule(space, int(options.samples or 1), options.seed, options.rule)
    if not (rule.weights > 0).all():
        raise uqmbd.StudyError(
            f"{label}: the rule ({rule.name}) has negative weights, with which averaged masses can be negative; "
            "use rule='gauss' or samples."
        )
    wrong = uqmbd.gram_error(space, rule, terms)
    if wrong > ALIASED:
        raise uqmbd.StudyError(
            f"{label}: the rule ({rule.name}) cannot tell the {len(terms)} terms of the basis apart (their "
            f"products are wrong by {wrong:.2g}); use more nodes, or a lower order."
        )
    return rule


def node_count(options: Galerkin, space: uqmbd.GermSpace) -> int:
    """Count the nodes of the rule without making it, where it may be large."""
    if options.rule == "smolyak":
        return len(uqmbd.smolyak(space, int(options.level or 0)))
    if options.rule != "gauss":
        return int(options.samples or 1)
    counts = _gauss_counts(options, options.node_name, space)
    total = math.prod(counts)
    if total > MOST_NODES:
        raise uqmbd.StudyError(
            f"{options.node_name}: {total} Gauss nodes for {space.dimension} inputs at order {options.order} are too "
            f"many for a coupled problem (at most {MOST_NODES}). {_remedy(options, space)}"
        )
    return total


def estimate(options: Galerkin, study: uqmbd.Study) -> uqmbd.Estimate:
    """Count nodes and terms, and the memory of what is known at all nodes and times."""
    space = uqmbd.GermSpace.of(study.mechanism.inputs, options.transform)
    if options.elements is not None:
        limits = uqmbd.ElementLimits(options.elements, options.max_elements, options.threshold)
        boxes, adaptive = 2 * limits.count - 1, limits.adaptive
    else:
        boxes, adaptive = 1, False
    nodes, terms = node_count(options, space), len(basis(options, space))
    model = study.problem(options).model
    layout, times = model.layout, len(study.times)
    outputs = len(study.mechanism.outputs)
    per_node = times * (layout.width + 2 * outputs) + layout.unknowns**2 + 2 * terms
    memory = 8 * (nodes * per_node + terms * times * (2 * layout.width + 2 * outputs))
    # an element is solved at a time, and leaves its coefficients
    memory += 8 * (boxes - 1) * terms * times * outputs
    detail = f"{nodes} nodes, {terms} terms" + (f" in each of {boxes} elements" if boxes > 1 else "")
    return uqmbd.Estimate(boxes * nodes + options.verify, memory, detail, at_most=adaptive)


def _gauss_counts(options: Galerkin, label: str, space: uqmbd.GermSpace) -> list[int]:
    """Nodes of each input."""
    if options.nodes is None:
        return [min(options.order + 1, germ.values or options.order + 1) for germ in space.germs]
    if len(options.nodes) not in (1, space.dimension):
        raise uqmbd.StudyError(
            f"{label}: nodes has {len(options.nodes)} numbers for {space.dimension} inputs ({', '.join(space.names)}); "
            "give one for each, or one for all."
        )
    return list(options.nodes) * (space.dimension if len(options.nodes) == 1 else 1)


def _remedy(options: Galerkin, space: uqmbd.GermSpace) -> str:
    """Options that this basis, or a smaller one, works with: tried, not guessed."""
    sets = dict.fromkeys((options.index_set, "total")) if options.elements is None else {"total": None}
    work = MOST_WORK
    for order in range(options.order, 0, -1):
        for kind in sets:
            given: dict[str, Any] = {"order": order, "index_set": kind, "rule": "sobol", "samples": 1}
            tried = replace(options, **given, level=None, nodes=None, elements=None, label=None)
            try:
                terms = basis(tried, space)
            except uqmbd.StudyError:
                continue
            count = 2 ** math.ceil(math.log2(2 * len(terms)))
            while count <= MOST_NODES and (cost := count * len(terms) ** 2) <= work:
                work -= cost
                rule = uqmbd.monte_carlo_rule(space, count, options.seed, "sobol")
                if uqmbd.gram_error(space, rule, terms) < 0.9 * ALIASED:
                    break
                count *= 2
            else:
                continue
            changed = [f"order={order}"] if order != options.order else []
            changed += [f"index_set={kind!r}"] if kind != options.index_set else []
            changed += ["rule='sobol'", f"samples={count}"]
            without = (
                " without elements=" if options.elements is not None else " without nodes=" if options.nodes else ""
            )
            return f"Use {', '.join(changed)}{without} ({len(terms)} terms), or weights=, or collocation."
    return "Use weights=, so that inputs of little influence get fewer nodes, or collocation."
