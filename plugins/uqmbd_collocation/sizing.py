"""Predicted costs of a collocation, and its sizes for a requested accuracy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import uqmbd
from uqmbd_collocation.alignment import followed
from uqmbd_collocation.families import FAMILIES, Family, impossible
from uqmbd_collocation.plans import Plans
from uqmbd_collocation.refinement import Limits

__all__ = ["TOLERANCE", "estimated", "possible_families", "sized"]

TOLERANCE = 1e-3
"""Default tolerance of a refinement, relative to the largest standard deviation of each output over time."""

FEW = 40
"""Number of stored values for each output and time in addition to coefficients: statistics and errors."""

BOUND = 10.0
"""Ratio of a requested accuracy to the tolerance of the refinement with an alignment that has to reach it. The ratio
exceeds 1, because the error bound from few verification realisations is larger than the change that ends the
refinement."""

ROOM = 0.9
"""Ratio of the error at the verification realisations, at which a refinement ends, to the requested accuracy. The ratio
is below 1, because the further realisations at extremes may increase the stated error."""

SPLIT_BOUND = 1.25
"""Ratio of a requested accuracy to the threshold of the elements that have to reach it."""


def possible_families(problem: uqmbd.extend.Problem, families: tuple[Family, ...]) -> tuple[tuple[Family, ...], str]:
    """Return the possible families, and messages on the omitted families."""
    reasons = {name: impossible(problem, name) for name in families}
    text = "; ".join(f"left out: {name}, {why}" for name, why in reasons.items() if why)
    return tuple(name for name in families if not reasons[name]), f"; {text}" if text else ""


def estimated(
    study: uqmbd.Study,
    space: uqmbd.extend.GermSpace,
    plans: Plans,
    limits: uqmbd.extend.ElementLimits,
    families: tuple[Family, ...],
    left_out: str,
) -> uqmbd.extend.Estimate:
    """Return the numbers of realisations, and the memory of their outputs and of the chaos.

    `families`: possible families of the alignment, empty for outputs at equal times; `left_out`: messages on the
    omitted families.
    """
    values = len(study.mechanism.outputs) * len(study.times) + len(study.mechanism.scalars)
    ways = families or FAMILIES[:1]
    if plans.adaptive != "no":
        most = plans.max_realisations * len(ways)
        detail = f"{most} realisations{left_out}"
        return uqmbd.extend.Estimate(most, 8 * 3 * most * values, detail, at_most=True, disk=8 * FEW * values)
    planned = plans.plan(space, plans.order)
    nodes, terms, boxes = len(planned.nodes), len(planned.multi_index), limits.computed
    one = (nodes + plans.verify) * (3 * values + terms) + 3 * terms * values
    disk = 8 * values * (FEW + boxes * terms)
    detail = f"{nodes} nodes, {terms} terms" + (f" in each of {boxes} elements" if boxes > 1 else "")
    if ways != ("plain",):
        # realisations at nodes are integrated longer, most of them twice; the number of elements is still unknown
        detail += ", with longer integrations; more elements if sequences of events or phases differ"
        # a plain chaos reads the trajectories that are integrated for a clock
        alone = nodes if "plain" in ways and "phase" not in ways else 0
        count = 2 * boxes * nodes * sum(name != "plain" for name in ways) + alone + plans.verify
        count += boxes * followed(nodes, plans.verify) if "events" in ways else 0
        detail += f"; families {', '.join(ways)}{left_out}" if len(ways) > 1 else left_out
        return uqmbd.extend.Estimate(count, 16 * boxes * one * len(ways), detail, disk=disk)
    count = boxes * nodes + limits.verified(plans.verify, space)
    further = bool(plans.verify) and boxes > 1  # elements whose errors are still unknown
    count += uqmbd.extend.VerificationPoints.further(count) if further else 0
    return uqmbd.extend.Estimate(count, 8 * boxes * one, detail, at_most=limits.uncertain or further, disk=disk)


def sized(
    changed: Callable[..., uqmbd.extend.Propagator],
    space: uqmbd.extend.GermSpace,
    plans: Plans,
    splits: uqmbd.extend.ElementLimits,
    limits: Limits,
    accuracy: float | None,
    *,
    aligned: bool,
) -> uqmbd.extend.Sizing | None:
    """Return options for an accuracy: the order; refinements and splits end at the accuracy or their limit.

    `changed`: function that returns the method with changed options; `splits`: limits of elements; `limits`: of a
    refinement; `aligned`: whether an alignment is used.
    """

    def tighter(factor: float) -> uqmbd.extend.Sizing:
        assert accuracy is not None
        found = sized(changed, space, plans, splits, limits, factor * accuracy, aligned=aligned)
        assert found is not None
        return found

    def to_limit(least: int, also: tuple[str, ...], options: dict[str, Any]) -> uqmbd.extend.Sizing:
        return uqmbd.extend.Sizing(
            option="max_realisations",
            at=lambda most: changed(max_realisations=most, **options),
            least=least,
            falls="itself",
            also=also,
            bound=plans.max_realisations,
            tighten=None if accuracy is None else tighter,
        )

    if plans.adaptive != "no":
        plain = not aligned and plans.verify > 0
        tolerance = limits.tolerance
        if accuracy is not None:
            tolerance = TOLERANCE if plain else accuracy / BOUND
        error = limits.error if accuracy is None or not plain else ROOM * accuracy
        also = () if accuracy is None else ("max_error", "tolerance") if plain else ("tolerance",)
        least = _first_nodes(space, plans, aligned=aligned) + plans.verify
        return to_limit(least, also, {"tolerance": tolerance, "max_error": error})
    given = any(getattr(plans, name) is not None for name in ("nodes", "level", "samples", "expansion"))
    if given or not plans.verify:
        return None
    if plans.elements == "adaptive":
        if aligned:
            return None
        threshold = splits.threshold if accuracy is None else accuracy / SPLIT_BOUND
        nodes = len(plans.plan(space, plans.order).nodes)
        return to_limit(nodes + splits.verified(plans.verify, space), ("threshold",), {"threshold": threshold})
    return uqmbd.extend.Sizing(option="order", at=lambda order: changed(order=order), least=1, falls="steps")


def _first_nodes(space: uqmbd.extend.GermSpace, plans: Plans, *, aligned: bool) -> int:
    """Return the number of nodes of the first step of a refinement."""
    if plans.adaptive == "dimension" and not aligned:
        # the middle, and the next level of each input; a tensor of them has too many nodes for many inputs
        return 1 + sum(min(3, germ.values or 3) - 1 for germ in space.germs)
    return len(plans.first_nodes(space))
