"""Nodes of the realisations for an order, and the fit of the chaos."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

import uqmbd
from uqmbd.results import AlignedChaos, PiecewiseChaos, Status
from uqmbd.typing import Array, Index
from uqmbd_collocation.fitting import QuadratureProjection, Regression
from uqmbd_collocation.runs import CollocationRuns
from uqmbd_collocation.sparse import SOLVERS, linear_models
from uqmbd_collocation.sparse_grids import SparseProjection, fewest_nodes, level_of, levels_for, levels_of
from uqmbd_collocation.user_expansion import UserExpansion, UserProjection

__all__ = ["DEFAULT_ORDER", "STREAM", "Adaptive", "Method", "Plans", "Terms"]

Method = Literal["projection", "regression", "omp", "lars"]
Terms = Literal["total", "tensor", "hyperbolic"]
Adaptive = Literal["no", "order", "dimension"]

GRIDS = ("gauss", "smolyak", "clenshaw-curtis")

DEFAULT_ORDER = 3

STREAM = 0x7E51F1
"""Random stream of the verification points, which must differ from the points of a design."""

EXTREMES, FEWEST = 2, 8
"""Number of verification points at extremes; smallest number of verification points with which extremes are used."""
FEW = 100
"""The default number of samples of sparse regression is at most this number, or the number of terms if that is
larger."""


class TooManyNodes(uqmbd.StudyError):
    """Error if an option needs more than the allowed number of realisations."""


@dataclass(frozen=True)
class Plans:
    """Options of `Collocation` that determine the nodes, and the `label` for messages.

    If the order is None, the chaos contains all terms that the `level` of a sparse grid resolves. Raise StudyError if
    options contradict each other.
    """

    label: str
    order: int | None
    index_set: Terms
    weights: tuple[float, ...] | None
    method: Method
    rule: str | None
    nodes: tuple[int, ...] | None
    level: int | None
    samples: int | None
    adaptive: Adaptive
    elements: int | Literal["adaptive"] | None
    max_realisations: int
    verify: int
    seed: int
    expansion: UserExpansion | None = None

    def __post_init__(self) -> None:
        if self.expansion is not None:
            self._require_no_options()
            return
        if self.method in SOLVERS:
            linear_models(self.method)
        design = None if self.grid else uqmbd.extend.sampling_design(self.design, "Collocation: rule", GRIDS)
        if self.method != "projection" and self.rule in GRIDS:
            raise uqmbd.StudyError(
                f"Collocation: method={self.method!r} fits samples, but rule={self.rule!r} is a grid. Use "
                "rule='sobol', 'latin-hypercube', 'halton' or 'random', or method='projection'."
            )
        if self.adaptive == "dimension":
            if self.method != "projection" or self.rule not in (None, "smolyak"):
                raise uqmbd.StudyError(
                    "Collocation: adaptive='dimension' refines a sparse grid; omit the options method and rule."
                )
            self.refuse(
                ("nodes", "level", "samples", "weights"), "adaptive='dimension', which chooses the nodes of each input"
            )
            if self.index_set != "total":
                raise uqmbd.StudyError(
                    f"Collocation: index_set={self.index_set!r} contradicts adaptive='dimension', which chooses the "
                    "terms; omit index_set."
                )
        if self.adaptive == "order":
            self.refuse(("nodes", "level", "samples"), "adaptive='order', which chooses this option for each order")
            if design is not None and not design.extendable:
                raise uqmbd.StudyError(
                    f"Collocation: rule={self.rule!r} is not extendable, so adaptive='order' cannot reuse "
                    "realisations; use rule='sobol'."
                )
        for name, rules in {"nodes": ("gauss",), "level": ("smolyak", "clenshaw-curtis")}.items():
            if self.design not in rules:
                expected = " or ".join(f"rule={rule!r}" for rule in rules)
                self.refuse((name,), f"rule={self.design!r}; it requires {expected}")
        if self.grid:
            self.refuse(("samples",), f"rule={self.grid!r}, a grid; use nodes or level, or a rule such as 'sobol'")

    def _require_no_options(self) -> None:
        """Raise StudyError if an option is given that a user expansion and its rule already determine."""
        self.refuse(("rule", "level", "samples", "elements"), "expansion=, which has its own quadrature rule")
        for name, usual in (("method", "projection"), ("index_set", "total"), ("adaptive", "no")):
            if (value := getattr(self, name)) != usual:
                raise uqmbd.StudyError(
                    f"Collocation: {name}={value!r} cannot be combined with expansion=, whose terms and rule are "
                    f"given; omit {name}."
                )

    def refuse(self, names: tuple[str, ...], by: str) -> None:
        """Raise StudyError if one of the named options is given."""
        for name in names:
            if getattr(self, name) is not None:
                raise uqmbd.StudyError(f"Collocation: {name}={getattr(self, name)!r} cannot be combined with {by}.")

    @property
    def design(self) -> str:
        """Rule of the nodes, with a default for the method."""
        if self.rule is not None:
            return self.rule
        if self.adaptive == "dimension":
            return "smolyak"
        return "gauss" if self.method == "projection" else "sobol"

    @property
    def grid(self) -> str:
        """Name of the rule if it is a grid; otherwise empty."""
        return self.design if self.design in GRIDS else ""

    def plan(
        self, space: uqmbd.extend.GermSpace, order: int | None
    ) -> QuadratureProjection | SparseProjection | Regression | UserProjection:
        """Return nodes and fit without computing realisations.

        Raise StudyError if an option does not suit the inputs, or if more than ``max_realisations`` would be needed.
        """
        try:
            return self._planned(space, order)
        except TooManyNodes as error:
            remedy = self._remedy(space, DEFAULT_ORDER if order is None else order)
            raise TooManyNodes(f"{error} {remedy}") from None

    def _planned(
        self, space: uqmbd.extend.GermSpace, order: int | None
    ) -> QuadratureProjection | SparseProjection | Regression | UserProjection:
        """Return nodes and fit; if there are too many nodes, raise an error without advice."""
        if self.expansion is not None:
            given = self.expansion.plan(space, self.label)
            self._check_number(space, order, len(given.nodes))
            return given
        if self.grid == "smolyak":
            return self._sparse(space, order)
        if order is None:
            order = DEFAULT_ORDER
        terms = space.basis(order, self.index_set, self.weights)
        if self.grid:
            if self.grid == "gauss":
                self._check_number(space, order, math.prod(self._gauss_counts(space, terms)))
            rule = self._grid(space, order, terms)
            self._check_number(space, order, len(rule))
            return QuadratureProjection(rule, terms, self._exact(rule, terms, space), self.label)
        count = self.samples or _default_samples(len(terms), self.method)
        self._check_number(space, order, count)
        rule = uqmbd.extend.monte_carlo_rule(space, count, self.seed, self.design)
        if self.method == "projection":
            return QuadratureProjection(rule, terms, False, self.label)
        return Regression(rule.nodes, terms, self.method, self.label)

    def first_nodes(self, space: uqmbd.extend.GermSpace) -> Array:
        """Return the germ points (K, d) of the first step, whose realisations every run with these options needs."""
        if self.adaptive == "dimension":
            return uqmbd.extend.gauss_tensor(space, [min(3, germ.values or 3) for germ in space.germs]).nodes
        return self.plan(space, self.order).nodes

    @property
    def extremes(self) -> int:
        """Number of verification points at extremes; zero if there are few verification points."""
        return EXTREMES if self.verify >= FEWEST else 0

    def verification_points(self, space: uqmbd.extend.GermSpace, others: int = 0) -> uqmbd.extend.VerificationPoints:
        """Draw `verify` minus `others` verification points, which differ from the points of every design."""
        return uqmbd.extend.VerificationPoints.drawn(space, self.verify - others, self.seed, STREAM)

    def with_extremes(
        self, points: uqmbd.extend.VerificationPoints, runs: CollocationRuns, error: Array | None
    ) -> uqmbd.extend.VerificationPoints:
        """Return the points and two more at extremes of the outputs, from the realisations and errors (O, T) so far."""
        good = runs.status == Status.OK
        known = (runs.germs[good], runs.response[good])
        stream = STREAM + 1
        ends = uqmbd.extend.VerificationPoints.at_extremes(runs.space, self.verify, *known, self.seed, stream, error)
        germs, weights = (np.concatenate(pair) for pair in ((points.germs, ends.germs), (points.weights, ends.weights)))
        return uqmbd.extend.VerificationPoints(germs, weights)

    def points_of_elements(
        self, boxes: Sequence[uqmbd.extend.GermBox], done: int
    ) -> list[uqmbd.extend.VerificationPoints]:
        """Return the verification points of each new box; `done` is the number of earlier elements.

        If the only box is the whole germ space, its points are those of `verification_points`.
        """
        if len(boxes) == 1 and boxes[0].probability == 1.0:
            return [self.verification_points(boxes[0].space)]
        return uqmbd.extend.VerificationPoints.of_elements(boxes, done, self.verify, self.seed, STREAM)

    def further(self, chaos: PiecewiseChaos | AlignedChaos, spent: int) -> list[uqmbd.extend.VerificationPoints]:
        """Return further verification points in elements with large errors.

        `spent` realisations have been computed; at most `max_realisations` - `spent` points are returned.
        """
        room = max(self.max_realisations - spent, 0)
        points = uqmbd.extend.VerificationPoints.of_errors(chaos, spent, self.seed, STREAM)
        if (wanted := sum(map(len, points))) > room:
            points = uqmbd.extend.VerificationPoints.of_errors(chaos, spent, self.seed, STREAM, most=room)
            warnings.warn(
                f"{self.label}: the stated error is based on {sum(map(len, points))} of {wanted} additional "
                f"verification realisations, because max_realisations is {self.max_realisations}. Increase "
                "max_realisations.",
                stacklevel=3,
            )
        return points

    def _sparse(self, space: uqmbd.extend.GermSpace, order: int | None) -> SparseProjection:
        """Return the combination of all tensor grids of a level, or of those that resolve the terms of an order."""
        terms = None if order is None else space.basis(order, self.index_set, self.weights)
        if self.level is None:
            if terms is None:
                terms = space.basis(DEFAULT_ORDER, self.index_set, self.weights)
            self._check_number(space, order, len(terms), "at least ")
            levels = levels_for(space, terms)
            name = f"{len(levels)} levels of a sparse grid"
        else:
            self._check_number(space, order, fewest_nodes(space, self.level, self.max_realisations), "at least ")
            levels, name = levels_of(space, self.level), f"a sparse grid of level {self.level}"
            if terms is not None and (least := int(level_of(terms).sum(axis=1).max())) > self.level:
                lost = int(np.count_nonzero(level_of(terms).sum(axis=1) > self.level))
                raise uqmbd.StudyError(
                    f"Collocation: level={self.level} of rule='smolyak' does not resolve {lost} of the {len(terms)} "
                    f"terms of order={order}. Use order=None (all terms that the level resolves), level={least}, or "
                    "omit level (the fewest nodes that resolve the order)."
                )
        found = SparseProjection.of(space, levels, terms, self.label, name)
        self._check_number(space, order, len(found.nodes))
        return found

    def _check_number(self, space: uqmbd.extend.GermSpace, order: int | None, nodes: int, bound: str = "") -> None:
        if nodes + self.verify <= self.max_realisations:
            return
        what = f"level {self.level}" if order is None else f"order {order}"
        raise TooManyNodes(
            f"Collocation: {what} with {space.dimension} inputs needs {bound}{nodes} nodes and {self.verify} "
            f"verification realisations, more than max_realisations = {self.max_realisations}."
        )

    def _remedy(self, space: uqmbd.extend.GermSpace, order: int) -> str:
        """Return options for which the number of nodes is allowed, found by trial."""
        plain: dict[str, Any] = {"rule": None, "nodes": None, "level": None, "samples": None, "adaptive": "no"}
        plain["order"] = order
        ways: list[dict[str, Any]] = [
            {"rule": "smolyak"},
            {"method": "regression"},
            {"method": "omp"},
            {"order": max(1, order - 1), "method": "regression"},
            {"order": 1, "method": "regression"},
        ]
        for way in ways:
            try:
                tried = replace(self, **{**plain, "elements": None, "expansion": None, **way})
                with warnings.catch_warnings():
                    warnings.simplefilter("error")
                    found = tried._planned(space, tried.order)
                    found.check(space)
                    total = len(found.nodes) + self.verify
            except (uqmbd.StudyError, Warning):  # a rule of a high order may overflow
                continue
            given = ", ".join(f"{name}={value!r}" for name, value in way.items())
            left = [f"{name}=" for name in ("nodes", "level", "samples", "elements") if getattr(self, name) is not None]
            left += ["adaptive="] if self.adaptive != "no" else []
            left += ["rule="] if self.rule is not None and "rule" not in way else []
            without = f" without {', '.join(left)}" if left else ""
            return f"Use {given}{without} ({total} realisations), adaptive='dimension', or increase max_realisations."
        return "Use adaptive='dimension', or increase max_realisations."

    def _gauss_counts(self, space: uqmbd.extend.GermSpace, terms: Index) -> list[int]:
        if self.nodes is None:
            return [int(n) + 1 for n in terms.max(axis=0)]
        if len(self.nodes) not in (1, space.dimension):
            raise uqmbd.StudyError(
                f"Collocation: nodes has {len(self.nodes)} entries; expected one number for all inputs, or one "
                f"number for each of the {space.dimension} inputs ({', '.join(space.names)})."
            )
        return list(self.nodes) * (space.dimension if len(self.nodes) == 1 else 1)

    def _grid(self, space: uqmbd.extend.GermSpace, order: int, terms: Index) -> uqmbd.extend.Quadrature:
        if self.grid == "gauss":
            return uqmbd.extend.gauss_tensor(space, self._gauss_counts(space, terms))
        if self.level is not None:
            return uqmbd.extend.clenshaw_curtis(space, self.level)
        # 2^level + 1 nodes are exact for products of two polynomials of uniform germs
        levels = [max(1, int(np.ceil(np.log2(2 * n)))) if n else 0 for n in terms.max(axis=0)]
        self._check_number(space, order, math.prod(2**level + 1 if level else 1 for level in levels))
        return uqmbd.extend.clenshaw_curtis(space, levels)

    def _exact(self, rule: uqmbd.extend.Quadrature, terms: Index, space: uqmbd.extend.GermSpace) -> bool:
        """Return whether the rule integrates products of the basis exactly."""
        if self.grid == "gauss":
            degrees = terms.max(axis=0)
            return all(n > k for n, k in zip(self._gauss_counts(space, terms), degrees, strict=True))
        return rule.exactness is not None and 2 * int(terms.sum(axis=1).max()) <= rule.exactness


def _default_samples(terms: int, method: str) -> int:
    """Return the default number of samples."""
    if method in ("omp", "lars"):
        return max(min(2 * terms, max(terms, FEW)), 3)
    return max(2 * terms, 2)
