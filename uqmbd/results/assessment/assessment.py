"""Assess the reliability of a result: agreement of methods, stated errors, outputs, and the recommended method.

Length: one class holds all results of the assessment, and each property has a docstring.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.names import ANY
from uqmbd.plugins import such_as
from uqmbd.results.assessment.differences import choose_reference
from uqmbd.results.assessment.error_sentences import own_statements
from uqmbd.results.assessment.judgements import Judgement, MethodVerdict, judgements_of, method_verdicts
from uqmbd.results.assessment.limits import COARSE, EXACT, RARE, WELL, WIDE
from uqmbd.results.assessment.own_errors import NO_SPREAD, NO_VARIATION, own_error, replicates_of
from uqmbd.results.assessment.recommendation import recommended, resort
from uqmbd.results.assessment.verdicts import AGREES, DIFFERS, FEW, REFERENCE, UNDER_RESOLVED, UNVERIFIED
from uqmbd.results.chaos import spread_words
from uqmbd.results.requirements import Answer, answers, differing, meets
from uqmbd.results.schema import comparable, propagator_nodes, stored_findings
from uqmbd.results.statistics import rtol_of, varying
from uqmbd.wording import format_at_most, format_count, format_integer, format_percent

__all__ = ["LEVELS", "Assessment", "OutputReliability", "assess"]

LEVELS = (("✗", "no"), ("!", "roughly"), ("✓", "yes"), ("–", "constant"))
"""Signs (readable without colours) and words of the levels of reliability."""


@dataclass(frozen=True)
class OutputReliability:
    """Reliability of one quantity: an output, a scalar output, or the probability of a requirement."""

    quantity: str  # its name
    kind: Literal["output", "scalar", "requirement"]
    method: str  # method of the displayed numbers
    level: int  # 0: unreliable, 1: roughly known, 2: reliable, 3: constant
    reason: str  # reason for the level
    error: float = 0.0  # sort key within a level
    met: bool | None = None  # whether a requirement is met; None: uncertain, or no allowed probability is stated
    population: bool = False  # whether the result contains several distributions of the inputs

    @property
    def name(self) -> str:
        """Name of the quantity, with the method if there are several populations."""
        if self.kind == "requirement":
            return f"requirement {self.quantity}"
        return f"{self.quantity} ({self.method})" if self.population else self.quantity

    @property
    def sign(self) -> str:
        """Sign of the level."""
        return LEVELS[self.level][0]

    @property
    def word(self) -> str:
        """Word for the level."""
        return LEVELS[self.level][1]


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
    reliability : tuple of Reliability
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
    reliability, rare = _of_requirements(tree, nodes, advised)
    references = {False: reference, True: str(data.attrs.get("scalar_reference", reference))}
    for part in orders:
        own = {label: found[label] for label in nodes if label in part}
        for timeless in (False, True):
            by_output: dict[str, dict[str, Judgement]] = {}
            for one in (one for of in own.values() for one in of if one.timeless == timeless):
                by_output.setdefault(one.output, {})[one.method] = one
            quantities = [_of_output(group, part, references[timeless], len(nodes)) for group in by_output.values()]
            reliability += [replace(one, population=len(orders) > 1) for one in quantities]
    hidden = _hidden_errors(tree)
    reliability = [_with_hidden_error(one, *hidden.get(one.quantity, (0.0, ""))) for one in reliability]
    reliability.sort(key=lambda one: (one.level, -one.error))
    precision = tuple(filter(None, (_precision(label, nodes[label], found[label], len(nodes)) for label in nodes)))
    text = str(data.attrs.get("recommendation", ""))
    lead, *reasons = text.split("\n")
    leads = (lead,) if lead else precision
    if not leads and len(nodes) == 1:
        leads = _lacking(nodes[order[0]], found[order[0]])
    if rare:
        leads += (
            f"{', '.join(rare)}: ten times as many realisations without a violation would reduce the upper bound of "
            "the probability to a tenth. A method that searches for violations needs fewer"
            f"{such_as(searches_violations=True)}.",
        )
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
    """Return whether an output varies in a method (`moves`), or may vary because the method does not agree."""
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


def _of_output(by_method: Mapping[str, Judgement], order: list[str], reference: str, methods: int) -> OutputReliability:
    """Assess an output by the first method in `order` with this output, or by a more accurate method that agrees.

    `by_method`: judgements of the output; `order`: methods of the same population, the most reliable first;
    `methods`: number of all methods.
    """
    first, *others = (by_method[label] for label in order if label in by_method)
    shown = first
    if first.kind in (AGREES, REFERENCE):
        agree = [first, *(one for one in others if one.kind in (AGREES, REFERENCE))]
        known = [one for limit in (WELL, COARSE) for one in agree if one.error <= limit]
        shown = known[0] if known else first
    by = f"by {shown.method}, " if 1 < methods == len(order) else ""
    kind: Literal["scalar", "output"] = "scalar" if shown.timeless else "output"
    # an inaccurate reference says nothing about the method
    verdict, other = shown.kind if shown.kind != UNVERIFIED else "", reference
    if verdict and shown.method == reference:  # find methods that agree or differ
        others = [one for one in by_method.values() if one is not shown]
        pairs = [(k, one.method) for k in (AGREES, NO_SPREAD, DIFFERS) for one in others if one.kind == k]
        verdict, other = pairs[0] if pairs else ("", "")
    if not shown.varies and verdict != DIFFERS:
        return OutputReliability(shown.output, kind, shown.method, 3, f"{by}{NO_VARIATION}")
    level = 2 if shown.error <= WELL else 1 if shown.error <= COARSE or not math.isfinite(shown.error) else 0
    level = {DIFFERS: 0, UNDER_RESOLVED: 0, FEW: min(level, 1)}.get(verdict, level)
    compared = sum(bool(one.kind) for one in by_method.values()) > 1
    alone = "no other method is accurate enough for a comparison" if compared else ""
    if not compared and len(by_method) == 1:
        alone = _alone(methods, len(order), "has this output")
    words = (
        {DIFFERS: f"differs from {other}", AGREES: f"agrees with {other}"}.get(verdict, verdict)
        or alone
        or "not compared"
    )
    error, statement = (
        shown.error if math.isfinite(shown.error) else COARSE,
        shown.stated if shown.varies else NO_VARIATION,
    )
    return OutputReliability(shown.output, kind, shown.method, level, f"{by}{statement}; {words}", error)


def _of_requirements(
    tree: xr.DataTree, nodes: Mapping[str, xr.DataTree], advised: list[str]
) -> tuple[list[OutputReliability], list[str]]:
    """Assess requirements; also list requirements without an observed violation whose upper bound is large.

    The numbers come from a recommended method, otherwise from the method with the narrowest interval.
    """
    found, rare = [], []
    allowed = tree.attrs.get("allowed_probability")
    same = comparable(nodes)
    comparables = answers(same)
    for name, every in answers(nodes).items():
        alike = comparables.get(name, every)
        narrow = min(alike.values(), key=lambda one: (not one.known, one.upper - one.lower))
        one = next((alike[label] for label in advised if label in alike and alike[label].known), narrow)
        met = None if allowed is None else meets(every.values(), float(allowed))
        level, reason, error = _of_probability(one, list(alike.values()), len(nodes), len(same))
        found.append(OutputReliability(name, "requirement", one.method, level, reason, error, met=met))
        if name != ANY and one.probability == 0 and one.upper > RARE:
            rare.append(name)
    return found, rare


def _hidden_errors(tree: xr.DataTree) -> dict[str, tuple[float, str]]:
    """Return the largest error that no method states, NaN if unknown, and its place in the study, by quantity."""
    found: dict[str, tuple[float, str]] = {}
    for finding in (one for node in tree.subtree for one in stored_findings(node)):
        for name, error in finding.hidden_errors:
            if name not in found or not error <= found[name][0]:
                found[name] = error, finding.place
    return found


def _with_hidden_error(one: OutputReliability, error: float, place: str) -> OutputReliability:
    """Return the reliability of a quantity with an error that no method states, relative to the standard deviation."""
    if error <= EXACT:
        return one
    timed = one.kind != "requirement"
    both = error + (one.error if timed and one.level == 2 else 0.0)
    level = 0 if both > COARSE else 1 if math.isnan(both) or both > WELL else 2
    # small probabilities change by more than the standard deviation
    level = min(level, 2 if timed else 1)
    size = "an error of unknown size" if math.isnan(error) else f"{format_percent(error)} of the standard deviation"
    reason = f"{one.reason}; the stated error excludes {size} (see the finding about {place})"
    return replace(one, level=min(one.level, level), reason=reason, error=max(one.error, min(error, 1.0)))


def _alone(methods: int, alike: int, lacking: str) -> str:
    """Return why a quantity of a method is not compared.

    `methods`: number of all methods; `alike`: number of methods with the same distributions of the inputs; `lacking`:
    property that no other of these methods has.
    """
    if methods == 1:
        return "not compared: this is the only method"
    return f"not compared: no other method {lacking if alike > 1 else 'has the same distributions of the inputs'}"


def _of_probability(one: Answer, found: list[Answer], methods: int, same: int) -> tuple[int, str, float]:
    """Return the level, the reason and the error of a probability, from agreement of methods and interval width.

    `methods`: number of all methods; `same`: number of methods with the input distributions of the study.
    """
    if any(a.apart(b) for a in found for b in found):
        low, high = min(found, key=lambda o: o.upper), max(found, key=lambda o: o.lower)
        return 0, f"{low.method} and {high.method} contradict each other", 1.0
    share = one.relative_width
    level = 2 if share <= WIDE or one.upper <= RARE else 1
    if not math.isfinite(one.probability) or (one.lower <= 0 and one.upper >= 1):
        level = 0
    text = (
        f"the longer side of its 95 % interval is {format_percent(share)} of the probability"
        if math.isfinite(share)
        else f"no violation occurred, {one.words}"
    )
    known = [other for other in found if other.known]
    others = [other.method for other in known if other.method != one.method] if one.known else []
    agree = f"{format_count(len(known), 'method')} agree" if len(others) > 1 else f"{''.join(others)} agrees"
    by = f"by {one.method}, " if methods > 1 else ""
    return level, f"{by}{text}; {agree if others else _alone(methods, same, 'states it')}", min(share, 1.0)


def _precision(label: str, node: xr.DataTree, found: list[Judgement], methods: int) -> str:
    """Return a text on the precision of standard deviations and a sufficient sample size; empty if unknown."""
    if "samples" not in node.children or "std_error_std" not in node.children["statistics"].data_vars:
        return ""
    stated = [one for one in found if math.isfinite(one.time) and one.varies and 0 < one.error < math.inf]
    if not stated:
        return ""
    one = max(stated, key=lambda one: one.error)
    if one.error <= WELL:
        verdict = "This is enough for most purposes"
    elif one.error <= COARSE:
        verdict = "The second digit of the standard deviation is uncertain"
    else:
        verdict = "This is a rough estimate, and more samples are needed"
    better = f"{_halving(node)} the stated error"
    if replicates_of(node):
        better += ", or more, because this sampling design often converges faster"
    if node.attrs.get("statistics_samples", math.inf) < node.attrs.get("realisations", 0):
        better = "another method estimates the standard deviation more accurately"
    subject = f"The stated error of {label}" if methods > 1 else "The stated error"
    of_which = f"of {one.output}, " if len(stated) > 1 else ""
    return (
        f"{subject} is {format_at_most(one.error, spread_words(one.floored))} ({of_which}at {one.time:g} s, with 95 % "
        f"confidence). {verdict}; {better}."
    )


def _halving(node: xr.DataTree) -> str:
    """State the number of samples that halves an error."""
    sizes = ("statistics_samples", "sample_size", "realisations")
    count = next((int(node.attrs[name]) for name in sizes if name in node.attrs), 0)
    return f"{format_count(4 * count, 'sample')} instead of {format_integer(count)} would halve"


def _lacking(node: xr.DataTree, found: list[Judgement]) -> tuple[str, ...]:
    """Return advice on a single method with an unreliable output; empty if all of its outputs are reliable."""
    some = [one for one in found if one.varies and WELL < one.error < math.inf]
    if not some:
        return ()
    one = max(some, key=lambda one: one.error)
    inner = node.children.get("scalars", node)
    sampled = "samples" in node.children or "samples" in inner.children
    if sampled:
        return (f"{one.output} has a {one.stated}: {_halving(node)} this error.",)
    part = inner if one.timeless else node
    names = [str(name) for name in part.children["statistics"].to_dataset()["output"].values]
    needed = resort(own_error(part, rtol_of(node), dependence=False).words[names.index(one.output)][1])
    return (f"{one.output} has a {one.stated}. {'Do not use its statistics. ' * (one.error > COARSE)}{needed}.",)
