"""Nodes of the realisations for an order, and the fit of the chaos."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

import uqmbd
from uqmbd.typing import Array, Index
from uqmbd_collocation.fitting import QuadratureProjection, Regression
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
"""Random stream of the verification points, which must differ from points of a design."""
FEW = 100
"""Samples below which a sparse regression gets as many as an ordinary one by default."""


class TooManyNodes(uqmbd.StudyError):
    """More realisations than are allowed."""


@dataclass(frozen=True)
class Plans:
    """Options of `Collocation` that choose the nodes, and the `label` before messages.

    An order of None means all terms that the `level` of a sparse grid resolves. Raise StudyError if options contradict
    each other.
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
            self._only_given()
            return
        if self.method in SOLVERS:
            linear_models(self.method)
        design = None if self.grid else uqmbd.extend.sampling_design(self.design, "Collocation: rule", GRIDS)
        if self.method != "projection" and self.rule in GRIDS:
            raise uqmbd.StudyError(
                f"Collocation: method={self.method!r} fits samples, but rule={self.rule!r} is a grid; use "
                "rule='sobol', 'latin-hypercube', 'halton' or 'random', or method='projection'."
            )
        if self.adaptive == "dimension":
            if self.method != "projection" or self.rule not in (None, "smolyak"):
                raise uqmbd.StudyError(
                    "Collocation: adaptive='dimension' refines a sparse grid; leave method and rule as they are by "
                    "default."
                )
            self.refuse(
                ("nodes", "level", "samples", "weights"), "adaptive='dimension', which finds out what each input needs"
            )
            if self.index_set != "total":
                raise uqmbd.StudyError(
                    f"Collocation: index_set={self.index_set!r} contradicts adaptive='dimension', which chooses the "
                    "terms."
                )
        if self.adaptive == "order":
            self.refuse(("nodes", "level", "samples"), "adaptive='order', which chooses it for each order")
            if design is not None and not design.extendable:
                raise uqmbd.StudyError(
                    f"Collocation: rule={self.rule!r} cannot be extended, so that adaptive='order' would use no "
                    "realisation again; use rule='sobol'."
                )
        for name, rules in {"nodes": ("gauss",), "level": ("smolyak", "clenshaw-curtis")}.items():
            if self.design not in rules:
                expected = " or ".join(f"rule={rule!r}" for rule in rules)
                self.refuse((name,), f"rule={self.design!r}; it is for {expected}")
        if self.grid:
            self.refuse(("samples",), f"rule={self.grid!r}, a grid; give nodes or level, or a rule such as 'sobol'")

    def _only_given(self) -> None:
        """Refuse options that a given expansion and rule already determine."""
        self.refuse(("rule", "level", "samples", "elements"), "expansion=, which comes with a rule of its own")
        for name, usual in (("method", "projection"), ("index_set", "total"), ("adaptive", "no")):
            if (value := getattr(self, name)) != usual:
                raise uqmbd.StudyError(
                    f"Collocation: {name}={value!r} means nothing with expansion=, whose terms and rule are given."
                )

    def refuse(self, names: tuple[str, ...], by: str) -> None:
        """Raise where one of some options is given."""
        for name in names:
            if getattr(self, name) is not None:
                raise uqmbd.StudyError(f"Collocation: {name}={getattr(self, name)!r} means nothing with {by}.")

    @property
    def design(self) -> str:
        """The rule, chosen to suit the method if none is given."""
        if self.rule is not None:
            return self.rule
        if self.adaptive == "dimension":
            return "smolyak"
        return "gauss" if self.method == "projection" else "sobol"

    @property
    def grid(self) -> str:
        """The rule if it is a grid, else empty."""
        return self.design if self.design in GRIDS else ""

    def plan(
        self, space: uqmbd.extend.GermSpace, order: int | None
    ) -> QuadratureProjection | SparseProjection | Regression | UserProjection:
        """Choose nodes and fit without computing realisations.

        Raise StudyError if an option does not suit the inputs or more than ``max_realisations`` would be needed.
        """
        try:
            return self._planned(space, order)
        except TooManyNodes as error:
            remedy = self._remedy(space, DEFAULT_ORDER if order is None else order)
            raise TooManyNodes(f"{error} {remedy}") from None

    def _planned(
        self, space: uqmbd.extend.GermSpace, order: int | None
    ) -> QuadratureProjection | SparseProjection | Regression | UserProjection:
        """Choose nodes; too many are refused without a remedy."""
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
        count = self.samples or _enough(len(terms), self.method)
        self._check_number(space, order, count)
        rule = uqmbd.extend.monte_carlo_rule(space, count, self.seed, self.design)
        if self.method == "projection":
            return QuadratureProjection(rule, terms, False, self.label)
        return Regression(rule.nodes, terms, self.method, self.label)

    def first_nodes(self, space: uqmbd.extend.GermSpace) -> Array:
        """Return germ points, shape (K, d), where there are realisations in any case."""
        if self.adaptive == "dimension":
            return uqmbd.extend.gauss_tensor(space, [min(3, germ.values or 3) for germ in space.germs]).nodes
        return self.plan(space, self.order).nodes

    def verification_points(self, space: uqmbd.extend.GermSpace) -> uqmbd.extend.VerificationPoints:
        """Return points that no design uses."""
        return uqmbd.extend.VerificationPoints.drawn(space, self.verify, self.seed, STREAM)

    def points_of_elements(
        self, boxes: Sequence[uqmbd.extend.GermBox], done: int
    ) -> list[uqmbd.extend.VerificationPoints]:
        """Return points of the verification in each box, behind so many elements; of no split, those as always."""
        if len(boxes) == 1 and boxes[0].probability == 1.0:
            return [self.verification_points(boxes[0].space)]
        return uqmbd.extend.VerificationPoints.of_elements(boxes, done, self.verify, self.seed, STREAM)

    def _sparse(self, space: uqmbd.extend.GermSpace, order: int | None) -> SparseProjection:
        """Combine the tensor grids of a level, or few that resolve the terms of an order."""
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
                    f"terms of order={order}; use order=None (all terms that the level resolves), level={least}, or "
                    "no level (few nodes that resolve the order)."
                )
        found = SparseProjection.of(space, levels, terms, self.label, name)
        self._check_number(space, order, len(found.nodes))
        return found

    def _check_number(self, space: uqmbd.extend.GermSpace, order: int | None, nodes: int, bound: str = "") -> None:
        if nodes + self.verify <= self.max_realisations:
            return
        what = f"level {self.level}" if order is None else f"order {order}"
        raise TooManyNodes(
            f"Collocation: {what} with {space.dimension} inputs takes {bound}{nodes} nodes and {self.verify} "
            f"verification realisations, more than max_realisations = {self.max_realisations}."
        )

    def _remedy(self, space: uqmbd.extend.GermSpace, order: int) -> str:
        """Options that this study works with: tried, not guessed."""
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
            except (uqmbd.StudyError, Warning):  # a rule of a huge order may overflow
                continue
            given = ", ".join(f"{name}={value!r}" for name, value in way.items())
            left = [f"{name}=" for name in ("nodes", "level", "samples", "elements") if getattr(self, name) is not None]
            left += ["adaptive="] if self.adaptive != "no" else []
            left += ["rule="] if self.rule is not None and "rule" not in way else []
            without = f" without {', '.join(left)}" if left else ""
            return f"Use {given}{without} ({total} realisations), adaptive='dimension', or allow more."
        return "Use adaptive='dimension', or allow more."

    def _gauss_counts(self, space: uqmbd.extend.GermSpace, terms: Index) -> list[int]:
        if self.nodes is None:
            return [int(n) + 1 for n in terms.max(axis=0)]
        if len(self.nodes) not in (1, space.dimension):
            raise uqmbd.StudyError(
                f"Collocation: nodes has {len(self.nodes)} entries; expected one number, or one for each of the "
                f"{space.dimension} inputs ({', '.join(space.names)})."
            )
        return list(self.nodes) * (space.dimension if len(self.nodes) == 1 else 1)

    def _grid(self, space: uqmbd.extend.GermSpace, order: int, terms: Index) -> uqmbd.extend.Quadrature:
        if self.grid == "gauss":
            return uqmbd.extend.gauss_tensor(space, self._gauss_counts(space, terms))
        if self.level is not None:
            return uqmbd.extend.clenshaw_curtis(space, self.level)
        # 2^level + 1 nodes: exact for products of two polynomials of uniform germs
        levels = [max(1, int(np.ceil(np.log2(2 * n)))) if n else 0 for n in terms.max(axis=0)]
        self._check_number(space, order, math.prod(2**level + 1 if level else 1 for level in levels))
        return uqmbd.extend.clenshaw_curtis(space, levels)

    def _exact(self, rule: uqmbd.extend.Quadrature, terms: Index, space: uqmbd.extend.GermSpace) -> bool:
        """Return whether products of the basis are known to be integrated exactly."""
        if self.grid == "gauss":
            degrees = terms.max(axis=0)
            return all(n > k for n, k in zip(self._gauss_counts(space, terms), degrees, strict=True))
        return rule.exactness is not None and 2 * int(terms.sum(axis=1).max()) <= rule.exactness


def _enough(terms: int, method: str) -> int:
    """Return the default number of samples."""
    if method in ("omp", "lars"):
        return max(min(2 * terms, max(terms, FEW)), 3)
    return max(2 * terms, 2)
