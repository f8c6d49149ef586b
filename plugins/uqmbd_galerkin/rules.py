"""Basis and quadrature of a Galerkin projection."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import uqmbd
from uqmbd.typing import Index

__all__ = ["MOST_NODES", "STREAM", "Discretisation", "Terms"]

Terms = Literal["total", "tensor", "hyperbolic"]

MOST_NODES = 20_000
"""Largest number of nodes of the coupled problem."""
MOST_WORK = 2e10
"""Largest number of products that the search for a remedy evaluates, in about a second."""
STREAM = 0x6A1E12
"""Random stream of the verification points."""
ALIASED = 0.5
"""A rule does not resolve the terms if its error for products of the basis exceeds this value."""


@dataclass(frozen=True)
class Discretisation:
    """Options of `Galerkin` that determine basis and quadrature, and the `label` for messages.

    Raise StudyError if options contradict each other.
    """

    label: str
    order: int
    index_set: Terms | None
    weights: tuple[float, ...] | None
    nodes: tuple[int, ...] | None
    rule: str
    samples: int | None
    level: int | None
    elements: int | Literal["adaptive"] | None
    seed: int

    def __post_init__(self) -> None:
        if self.rule not in ("gauss", "smolyak"):
            uqmbd.extend.sampling_design(self.rule, "Galerkin: rule", ("gauss", "smolyak"))
        if self.level is not None and (self.rule != "smolyak" or self.samples is not None):
            raise uqmbd.StudyError(
                f"Galerkin: level={self.level!r} requires rule='smolyak' without samples; rule is {self.rule!r}, and "
                f"samples is {self.samples!r}."
            )
        if self.samples is not None and self.rule == "gauss":
            raise uqmbd.StudyError(
                "Galerkin: samples cannot be combined with rule='gauss', a grid. Use nodes, or a "
                "sampling rule such as 'sobol'."
            )
        if self.nodes is not None and self.rule != "gauss":
            other = "level" if self.rule == "smolyak" else "samples"
            raise uqmbd.StudyError(f"Galerkin: nodes requires rule='gauss'; with rule={self.rule!r}, use {other}.")
        if self.rule == "smolyak" and self.level is None:
            raise uqmbd.StudyError("Galerkin: rule='smolyak' requires level=.")
        if self.rule not in ("gauss", "smolyak") and self.samples is None:
            raise uqmbd.StudyError(f"Galerkin: rule={self.rule!r} requires samples=, the number of samples.")

    @property
    def products(self) -> Terms:
        """Index set, with a default for the other options."""
        return self.index_set or ("total" if self.elements is None else "tensor")

    def basis(self, space: uqmbd.extend.GermSpace) -> Index:
        """Return the terms, shape (P, d)."""
        return space.basis(self.order, self.products, self.weights)

    def quadrature(self, space: uqmbd.extend.GermSpace, terms: Index) -> uqmbd.extend.Quadrature:
        """Return nodes and weights for a basis; raise StudyError if the rule does not suit the inputs or the basis."""
        if self.rule == "gauss":
            self.node_count(space)
            rule = uqmbd.extend.gauss_tensor(space, self._gauss_counts(space))
        elif self.rule == "smolyak":
            rule = uqmbd.extend.smolyak(space, int(self.level or 0))
        else:
            rule = uqmbd.extend.monte_carlo_rule(space, int(self.samples or 1), self.seed, self.rule)
        if not (rule.weights > 0).all():
            raise uqmbd.StudyError(
                f"{self.label}: the rule ({rule.name}) has negative weights, so projected masses can be negative. "
                "Use rule='gauss', or a sampling rule."
            )
        wrong = uqmbd.extend.gram_error(space, rule, terms)
        if wrong > ALIASED:
            raise uqmbd.StudyError(
                f"{self.label}: the rule ({rule.name}) does not resolve the {len(terms)} terms of the basis: it "
                f"integrates products of two terms with an error of {wrong:.2g}. Use more nodes, or a lower order."
            )
        return rule

    def node_count(self, space: uqmbd.extend.GermSpace) -> int:
        """Return the number of nodes of the rule; raise StudyError for too many Gauss nodes, without computing them."""
        if self.rule == "smolyak":
            return len(uqmbd.extend.smolyak(space, int(self.level or 0)))
        if self.rule != "gauss":
            return int(self.samples or 1)
        total = math.prod(self._gauss_counts(space))
        if total > MOST_NODES:
            raise uqmbd.StudyError(
                f"{self.label}: {total} Gauss nodes for {space.dimension} inputs at order {self.order} are too many "
                f"for a coupled problem; expected at most {MOST_NODES}. {self._remedy(space)}"
            )
        return total

    def refuse_impacts(self, ensemble: uqmbd.extend.Ensemble, *, terms: int, nodes: int) -> None:
        """Raise StudyError if a mechanism has impacts that an expansion cannot represent.

        Impacts occur at a different time in each realisation. With as many terms as nodes, the projected laws of impact
        are satisfied at each node. With fewer terms, the jump at one node would be a jump at all nodes. An event that
        only records a time is accepted.
        """
        names = dict.fromkeys(component for component, _, directions in ensemble.model.events if directions)
        if not names or terms == nodes:
            return
        # suggest options that give as many terms as nodes
        remedies = []
        if self.products != "tensor":
            remedies.append("set index_set='tensor'")
        if self.rule != "gauss":
            remedies.append("set rule='gauss' and omit samples")
        elif self.nodes is not None:
            remedies.append("omit nodes")
        if self.weights is not None:
            remedies.append("omit weights")
        listed = ", ".join(map(repr, names))
        raise uqmbd.StudyError(
            f"{self.label}: velocities or forces jump at the events of {listed}, at different times in each "
            f"realisation. A Galerkin projection of {terms} terms on {nodes} nodes cannot represent these jumps; it "
            f"needs as many terms as nodes. For Galerkin, {', '.join(remedies)}, preferably with elements='adaptive'. "
            "Or use collocation with alignment='events'. Smooth friction and compliant contacts have no jumps."
        )

    def _gauss_counts(self, space: uqmbd.extend.GermSpace) -> list[int]:
        """Return the number of nodes of each input."""
        if self.nodes is None:
            return [min(self.order + 1, germ.values or self.order + 1) for germ in space.germs]
        if len(self.nodes) not in (1, space.dimension):
            raise uqmbd.StudyError(
                f"{self.label}: nodes has {len(self.nodes)} numbers for {space.dimension} inputs "
                f"({', '.join(space.names)}); expected one number for each input, or one for all."
            )
        return list(self.nodes) * (space.dimension if len(self.nodes) == 1 else 1)

    def _remedy(self, space: uqmbd.extend.GermSpace) -> str:
        """Return options that allow this basis or a smaller one; try orders from 1 upwards."""
        given: tuple[Terms | None, ...] = ("total",) if self.elements is not None else (self.index_set, "total")
        plain = replace(self, rule="sobol", samples=1, level=None, nodes=None, elements=None)
        work, found = (
            MOST_WORK,
            "Use weights=, to reduce the number of nodes of inputs with little influence, or collocation.",
        )
        for order in range(1, self.order + 1):
            for kind in dict.fromkeys(given):
                try:
                    terms = replace(plain, order=order, index_set=kind).basis(space)
                except uqmbd.StudyError:
                    continue
                count = 2 ** math.ceil(math.log2(2 * len(terms)))
                while count <= MOST_NODES and (cost := count * len(terms) ** 2) <= work:
                    work -= cost
                    rule = uqmbd.extend.monte_carlo_rule(space, count, self.seed, "sobol")
                    if uqmbd.extend.gram_error(space, rule, terms) < 0.9 * ALIASED:
                        break
                    count *= 2
                else:
                    continue
                changed = [f"order={order}"] if order != self.order else []
                changed += [f"index_set={kind!r}"] if kind != self.index_set else []
                changed += ["rule='sobol'", f"samples={count}"]
                without = " without nodes=" if self.nodes else ""
                without = without if self.elements is None else " without elements="
                found = f"Use {', '.join(changed)}{without} ({len(terms)} terms), or weights=, or collocation."
                break
            else:
                break  # higher orders cannot work either
        return found
