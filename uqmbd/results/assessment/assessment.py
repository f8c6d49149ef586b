"""Assess the reliability of a result: agreement of methods, stated errors, outputs, and the recommended method."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.results.assessment.advice import advice_on_errors, advice_on_rare_violations, precision_of
from uqmbd.results.assessment.differences import choose_reference
from uqmbd.results.assessment.error_sentences import own_statements
from uqmbd.results.assessment.judgements import Judgement, MethodVerdict, judgements_of, method_verdicts
from uqmbd.results.assessment.own_errors import NO_SPREAD, own_error
from uqmbd.results.assessment.recommendation import recommended
from uqmbd.results.assessment.reliability import (
    OutputReliability,
    hidden_errors,
    output_reliability,
    requirement_reliability,
    with_hidden_error,
)
from uqmbd.results.assessment.verdicts import DIFFERS, FEW, UNDER_RESOLVED, UNVERIFIED
from uqmbd.results.requirements import differing
from uqmbd.results.schema import propagator_nodes
from uqmbd.results.statistics import rtol_of, varying

__all__ = ["Assessment", "assess"]


@dataclass(frozen=True)
class Assessment:
    """Reliability of the result of a study.

    Attributes
    ----------
    reference : str
        Label of the reference method; empty if there is none.
    recommended : tuple of str
        Labels of the recommended methods; several if they are equally suitable.
    recommendation : tuple of str
        Sentences on the recommended method, or advice on a single method.
    reasons : tuple of str
        Sentences with the reasons against each of the other methods.
    judgements : tuple of Judgement
        Stated error of each output of each method, and whether methods agree on it.
    reliability : tuple of OutputReliability
        Reliability of each requirement, output and scalar output, the least reliable first.
    order : tuple of str
        Labels of all methods, the most reliable first.
    precision : tuple of str
        Sentences about the precision of standard deviations from samples.
    contradictions : tuple of str
        Sentences about requirements on which methods contradict each other.

    Examples
    --------
    >>> from uqmbd.results import assess, propagator_node, study_tree
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels(["x"], [], [0.0, 1.0])
    >>> def node(label, cost, error):
    ...     known = {"std_error_mean": [[error, error]], "std_error_std": [[error, error]]}
    ...     statistics = statistics_dataset(axes, mean=[[0.0, 0.0]], std=[[1.0, 1.0]], **known)
    ...     return propagator_node(label, statistics, propagator="p", realisations=cost, wall_time=0.01 * cost)
    >>> found = assess(study_tree([node("many", 10000, 0.01), node("few", 1000, 0.02)], study="s", mechanism="m"))
    >>> found.recommended, [(one.name, one.method, one.word) for one in found.reliability]
    (('few',), [('x', 'few', 'yes')])
    >>> found.reliability[0].reason
    'by few, stated error at most 3.9 % of the standard deviation (at 0 s); agrees with many'
    """

    reference: str
    recommended: tuple[str, ...]
    recommendation: tuple[str, ...]
    reasons: tuple[str, ...]
    judgements: tuple[Judgement, ...]
    reliability: tuple[OutputReliability, ...]
    order: tuple[str, ...]
    precision: tuple[str, ...]
    contradictions: tuple[str, ...]

    @property
    def verdicts(self) -> tuple[MethodVerdict, ...]:
        """Verdicts on the compared methods."""
        return method_verdicts(self.judgements)

    def judgement(self, method: str, output: str) -> Judgement:
        """Return the judgement of an output of a method.

        Parameters
        ----------
        method, output : str
            Label of the method, and name of the output.

        Raises
        ------
        uqmbd.StudyError
            If the method has no such output.
        """
        for one in self.judgements:
            if (one.method, one.output) == (method, output):
                return one
        known = ", ".join(f"{one.output!r} of {one.method!r}" for one in self.judgements)
        raise StudyError(f"The assessment has no output {output!r} of the method {method!r}; expected one of: {known}.")

    def of(self, quantity: str, kind: str = "output") -> tuple[OutputReliability, ...]:
        """Return the reliability of a quantity for each population of the inputs, the most reliable method first.

        Parameters
        ----------
        quantity : str
            Name of an output or a requirement.
        kind : {"output", "scalar", "requirement"}
            Kind of the quantity.
        """
        found = [one for one in self.reliability if (one.quantity, one.kind) == (quantity, kind)]
        return tuple(sorted(found, key=lambda one: self.order.index(one.method)))


@typechecked
def assess(tree: xr.DataTree) -> Assessment:
    """Assess the result of a study: errors, agreement of methods, reliability of each output, recommendation.

    The console, the report and notebooks print the assessment.

    Parameters
    ----------
    tree : xarray.DataTree
        Result of a study, or node of one method.

    Returns
    -------
    Assessment
        Assessment of the result.

    Examples
    --------
    >>> import chaospy
    >>> import uqmbd
    >>> from uqmbd.results import assess
    >>> from uqmbd_collocation import Collocation
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> mechanism.output("height", stone.position[0], units="m")
    >>> (one,) = assess(uqmbd.Study("throw", mechanism, [0, 1], [Collocation(order=1)]).run()).reliability
    >>> one.word, one.reason
    ('yes', 'stated error below 0.0001 % of the standard deviation (at 1 s); not compared: this is the only method')
    """
    nodes = propagator_nodes(tree)
    data = tree.children["comparison"].to_dataset() if "comparison" in tree.children else xr.Dataset()
    if "verdict_kind" not in data or "method" not in data.coords:  # file of an earlier version
        data = xr.Dataset()
    advised = [label for label in (recommended(data) if data else ()) if label in nodes]
    found = _judgements(nodes, data)
    populations: dict[str, dict[str, xr.DataTree]] = {}
    for label, node in nodes.items():
        populations.setdefault(str(node.attrs.get("population", "")), {})[label] = node
    orders = [_order(part, data, advised) for part in populations.values()]
    reference = str(data.attrs.get("reference", ""))
    order = [label for part in sorted(orders, key=lambda part: reference not in part) for label in part]
    reliability, rare = requirement_reliability(tree, nodes, advised)
    references = {False: reference, True: str(data.attrs.get("scalar_reference", reference))}
    for part in orders:
        own = {label: found[label] for label in nodes if label in part}
        for timeless in (False, True):
            by_output: dict[str, dict[str, Judgement]] = {}
            for judged in (each for of in own.values() for each in of if each.timeless == timeless):
                by_output.setdefault(judged.output, {})[judged.method] = judged
            quantities = [
                output_reliability(group, part, references[timeless], len(nodes)) for group in by_output.values()
            ]
            reliability += [replace(one, population=len(orders) > 1) for one in quantities]
    hidden = hidden_errors(tree)
    reliability = [with_hidden_error(one, *hidden.get(one.quantity, (0.0, ""))) for one in reliability]
    reliability.sort(key=lambda one: (one.level, -one.error))
    precision = tuple(filter(None, (precision_of(label, nodes[label], found[label], len(nodes)) for label in nodes)))
    text = str(data.attrs.get("recommendation", ""))
    lead, *reasons = text.split("\n")
    leads = (lead,) if lead else precision
    if not leads and len(nodes) == 1:
        leads = advice_on_errors(nodes[order[0]], found[order[0]])
    if rare:
        leads += (advice_on_rare_violations(rare),)
    return Assessment(
        reference,
        tuple(advised),
        leads,
        tuple(reasons),
        tuple(one for of in found.values() for one in of),
        tuple(reliability),
        tuple(order),
        precision,
        tuple(f"{sentence}." for sentence in differing(nodes)),
    )


def _judgements(nodes: Mapping[str, xr.DataTree], data: xr.Dataset) -> dict[str, list[Judgement]]:
    """Return the judgement of each output of each method, from the comparison or the statement of the method."""
    compared = {timeless: judgements_of(data, timeless=timeless) for timeless in (False, True)}
    found: dict[str, list[Judgement]] = {}
    for label, node in nodes.items():
        found[label] = []
        for timeless, part in ((False, node), (True, node.children.get("scalars"))):
            if part is None:
                continue
            known = {one.output: one for one in compared[timeless].get(label, ())}
            statistics = part.children["statistics"].to_dataset()
            names = [str(name) for name in statistics["output"].values]
            ones = [known.get(name, Judgement(label, name, timeless)) for name in names]
            if not all(one.text for one in ones):
                ones = [replace(one, text=one.text or own) for one, own in zip(ones, own_statements(part), strict=True)]
            if timeless or "stated_error_max" not in data or len(known) < len(ones):
                own = own_error(part, rtol_of(part), dependence=False)
                times = statistics["time"].values if "time" in statistics["mean"].dims and not timeless else None
                errors, at = (values.tolist() for values in own.largest(times))
                known_errors = zip(ones, errors, at, own.floored().tolist(), strict=True)
                ones = [replace(one, error=e, time=t, floored=f) for one, e, t, f in known_errors]
            moves = varying(statistics, rtol_of(part))
            found[label] += [replace(one, varies=_varies(one, bool(m))) for one, m in zip(ones, moves, strict=True)]
    return found


def _varies(one: Judgement, moves: bool) -> bool:
    """Return whether an output varies in a method (`moves`), or may vary because its verdict is not agreement."""
    return one.kind != NO_SPREAD and (moves or one.kind in (DIFFERS, UNDER_RESOLVED, FEW, UNVERIFIED))


def _order(nodes: Mapping[str, xr.DataTree], data: xr.Dataset, advised: Iterable[str]) -> list[str]:
    """Return the labels of methods of one population: recommended methods, the reference, then the given order.

    A reference is ignored if one of its outputs is constant but varies in other methods.
    """
    first = [label for label in advised if label in nodes]
    reference = str(data.attrs.get("reference", ""))
    if data and (reference not in nodes or (not first and _misses_variation(nodes, reference))):
        reference = choose_reference(nodes)
    return [label for label in dict.fromkeys([*first, reference, *nodes]) if label in nodes]


def _misses_variation(nodes: Mapping[str, xr.DataTree], label: str) -> bool:
    """Return whether any output is constant in a method but varies in another method."""
    moves = {}
    for other, node in nodes.items():
        statistics = node.children["statistics"].to_dataset()
        names = map(str, statistics["output"].values)
        moves[other] = dict(zip(names, varying(statistics, rtol_of(node)).tolist(), strict=True))
    return any(not m and any(other.get(name) for other in moves.values()) for name, m in moves[label].items())
