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
"""Nodes beyond which the coupled problem is not set up."""
MOST_WORK = 2e10
"""Products that a remedy may be sought with: about a second."""
STREAM = 0x6A1E12
"""Random stream of the verification points."""
ALIASED = 0.5
"""Error of a rule for products of the basis beyond which it does not resolve the terms."""


@dataclass(frozen=True)
class Discretisation:
    """Options of `Galerkin` that choose basis and quadrature, and the `label` before messages.

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
                f"Galerkin: level is {self.level!r}, for rule='smolyak' without samples; rule is {self.rule!r}, "
                f"samples {self.samples!r}."
            )
        if self.samples is not None and self.rule == "gauss":
            raise uqmbd.StudyError(
                "Galerkin: samples is given, but rule='gauss' is a grid; give nodes, or a rule of samples, as 'sobol'."
            )
        if self.nodes is not None and self.rule != "gauss":
            other = "level" if self.rule == "smolyak" else "samples"
            raise uqmbd.StudyError(f"Galerkin: nodes is for rule='gauss'; for rule={self.rule!r} give {other}.")
        if self.rule == "smolyak" and self.level is None:
            raise uqmbd.StudyError("Galerkin: rule='smolyak' needs level=.")
        if self.rule not in ("gauss", "smolyak") and self.samples is None:
            raise uqmbd.StudyError(f"Galerkin: rule={self.rule!r} needs samples=how many.")

    @property
    def products(self) -> Terms:
        """The index set, chosen to suit if none is given."""
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
                f"{self.label}: the rule ({rule.name}) has negative weights, so averaged masses can be negative; "
                "use rule='gauss', or a rule with samples."
            )
        wrong = uqmbd.extend.gram_error(space, rule, terms)
        if wrong > ALIASED:
            raise uqmbd.StudyError(
                f"{self.label}: the rule ({rule.name}) does not resolve the {len(terms)} terms of the basis: it "
                f"integrates their products with an error of {wrong:.2g}; use more nodes, or a lower order."
            )
        return rule

    def node_count(self, space: uqmbd.extend.GermSpace) -> int:
        """Count the nodes of the rule without making it, where it may be large."""
        if self.rule == "smolyak":
            return len(uqmbd.extend.smolyak(space, int(self.level or 0)))
        if self.rule != "gauss":
            return int(self.samples or 1)
        total = math.prod(self._gauss_counts(space))
        if total > MOST_NODES:
            raise uqmbd.StudyError(
                f"{self.label}: {total} Gauss nodes for {space.dimension} inputs at order {self.order} are too "
                f"many for a coupled problem (at most {MOST_NODES}). {self._remedy(space)}"
            )
        return total

    def refuse_impacts(self, ensemble: uqmbd.extend.Ensemble, *, terms: int, nodes: int) -> None:
        """Raise StudyError where a mechanism has impacts that an expansion cannot represent.

        Impacts occur at a different time in each realisation. With as many terms as nodes the projected laws of impact
        hold at each node; with fewer the jump of one would be a jump of all. An event that only records a time is
        accepted.
        """
        names = dict.fromkeys(component for component, _, directions in ensemble.model.events if directions)
        if not names or terms == nodes:
            return
        # what makes as many terms as nodes of these options
        remedies = []
        if self.products != "tensor":
            remedies.append("index_set='tensor'")
        if self.rule != "gauss":
            remedies.append("rule='gauss' without samples=")
        elif self.nodes is not None:
            remedies.append("without nodes=")
        if self.weights is not None:
            remedies.append("without weights=")
        listed = ", ".join(map(repr, names))
        raise uqmbd.StudyError(
            f"{self.label}: at the impacts of {listed} velocities jump, at another time in each realisation, which "
            f"a Galerkin projection of {terms} terms on {nodes} nodes cannot follow; one of as many terms as nodes "
            f"can. Use it {' and '.join(remedies)}, better with elements='adaptive' too; or collocation with "
            "alignment='events'."
        )

    def _gauss_counts(self, space: uqmbd.extend.GermSpace) -> list[int]:
        """Nodes of each input."""
        if self.nodes is None:
            return [min(self.order + 1, germ.values or self.order + 1) for germ in space.germs]
        if len(self.nodes) not in (1, space.dimension):
            raise uqmbd.StudyError(
                f"{self.label}: nodes has {len(self.nodes)} numbers for {space.dimension} inputs "
                f"({', '.join(space.names)}); give one for each, or one for all."
            )
        return list(self.nodes) * (space.dimension if len(self.nodes) == 1 else 1)

    def _remedy(self, space: uqmbd.extend.GermSpace) -> str:
        """Options that this basis, or a smaller one, works with: tried, not guessed, from order 1 upwards."""
        given: tuple[Terms | None, ...] = ("total",) if self.elements is not None else (self.index_set, "total")
        plain = replace(self, rule="sobol", samples=1, level=None, nodes=None, elements=None)
        work, found = MOST_WORK, "Use weights=, so that inputs of little influence get fewer nodes, or collocation."
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
                break  # nor does any higher order
        return found
