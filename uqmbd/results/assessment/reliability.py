"""Reliability of one quantity: an output, a scalar output, or the probability of a requirement."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import xarray as xr

from uqmbd.names import ANY
from uqmbd.results.assessment.judgements import Judgement
from uqmbd.results.assessment.limits import COARSE, EXACT, RARE, WELL, WIDE
from uqmbd.results.assessment.own_errors import NO_SPREAD, NO_VARIATION
from uqmbd.results.assessment.verdicts import AGREES, DIFFERS, FEW, REFERENCE, UNDER_RESOLVED, UNVERIFIED
from uqmbd.results.requirements import Answer, answers, meets
from uqmbd.results.schema import comparable, stored_findings
from uqmbd.wording import format_count, format_percent

__all__ = [
    "LEVELS",
    "OutputReliability",
    "hidden_errors",
    "output_reliability",
    "requirement_reliability",
    "with_hidden_error",
]

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


def output_reliability(
    by_method: Mapping[str, Judgement], order: list[str], reference: str, methods: int
) -> OutputReliability:
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


def requirement_reliability(
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


def _alone(methods: int, alike: int, lacking: str) -> str:
    """Return why a quantity of a method is not compared.

    `methods`: number of all methods; `alike`: number of methods with the same distributions of the inputs; `lacking`:
    end of the sentence "no other method ...", such as "states it".
    """
    if methods == 1:
        return "not compared: this is the only method"
    return f"not compared: no other method {lacking if alike > 1 else 'has the same distributions of the inputs'}"


def hidden_errors(tree: xr.DataTree) -> dict[str, tuple[float, str]]:
    """Return the largest error that findings report and no method states (NaN: unknown), and its place, by quantity."""
    found: dict[str, tuple[float, str]] = {}
    for finding in (one for node in tree.subtree for one in stored_findings(node)):
        for name, error in finding.hidden_errors:
            if name not in found or not error <= found[name][0]:
                found[name] = error, finding.place
    return found


def with_hidden_error(one: OutputReliability, error: float, place: str) -> OutputReliability:
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
