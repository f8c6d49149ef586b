"""Recommend a method in words, with reasons."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.results.assessment.integration_share import integration_shares
from uqmbd.results.assessment.judgements import Judgement, judgements_of, largest_error, worst
from uqmbd.results.assessment.limits import COARSE, EXACT, WELL
from uqmbd.results.assessment.own_errors import NO_SPREAD
from uqmbd.results.assessment.verdicts import AGREES, DIFFERS, FEW, REFERENCE, UNDER_RESOLVED, UNVERIFIED
from uqmbd.wording import format_at_most, format_percent

__all__ = ["advice", "loose", "recommend", "recommended", "resort"]

SAME = 1e-9
"""Difference of results, relative to the largest standard deviation, below which it counts as rounding."""

FIXED_COSTS = 60.0
"""Wall time in s of every method, up to which realisations measure the cost.

Compilation, fits and quantiles have a fixed cost: 0.1 s for samples, up to 10 s for a choice of alignments. This cost
does not grow with the mechanism, but dominates the wall times of shorter runs. If wall times decided there, the method
recommended for 10 % would need 18 times the realisations of the best method (`studies/methods`).
"""

SIMILAR_COST, SIMILAR_WALL_TIME = 1.25, 2.0
"""Cost ratios up to which costs count as equal: in general, and of wall times for equal numbers of realisations."""

AS_GOOD = 1.5
"""Ratio of own errors up to which the errors count as equal."""


@dataclass(frozen=True)
class _RatedMethod:
    """Ratings of a method.

    ``same``: whether results and number of realisations are equal to those of the reference. ``met``: whether the
    stated accuracy reaches the requested accuracy; False if none was requested. ``timed``: whether the cost is a wall
    time.
    """

    label: str
    found: list[Judgement]
    error: float
    cost: float
    wall_time: float
    realisations: int
    unknown: int
    same: bool
    accuracy: float
    met: bool
    timed: bool

    @property
    def kind(self) -> str:
        return worst(self.found)[0].kind

    @property
    def known(self) -> str:
        """Largest stated error of the method, in brackets."""
        return f" ({words})" if (words := largest_error(self.found)) else ""

    @property
    def gaps(self) -> str:
        """Text on the number of times with unknown statistics."""
        plural = "" if self.unknown == 1 else "s"
        return f"has no mean or standard deviation at {self.unknown} time{plural}" if self.unknown else ""

    def equals(self, other: _RatedMethod) -> bool:
        """Test whether two agreeing methods have equal errors and costs within random variation."""
        if self.same and other.same:
            return True
        ratio = SIMILAR_WALL_TIME if self.realisations == other.realisations else SIMILAR_COST
        errors = sorted((self.error, other.error))
        close = errors[1] <= EXACT or errors[1] <= AS_GOOD * errors[0] or (self.met and other.met)
        return self.cost <= ratio * other.cost and math.isfinite(errors[1]) and close


def loose(nodes: Mapping[str, xr.DataTree]) -> tuple[str, ...]:
    """Return a sentence if the time integration is too coarse for any recommendation; otherwise an empty tuple."""
    shares = [
        (one, label)
        for label, node in nodes.items()
        for one in integration_shares(node.children["statistics"].to_dataset())
        if one.varies and one.share > WELL
    ]
    if not shares:
        return ()
    worst, label = max(shares, key=lambda pair: pair[0].share)
    size = format_at_most(worst.share, worst.whole)
    return (
        f"Reduce rtol first: the error of the time integration is {size} (of {worst.output}, with "
        f"{label}). Stated errors do not contain it.",
    )


@typechecked
def recommend(comparison: xr.Dataset) -> tuple[str, ...]:
    """Recommend a method, in sentences that can be read in a minute.

    The recommended method has the lowest cost of all methods whose outputs are known at all times and agree with the
    reference. If the run requested an accuracy, the method must reach it; if none reaches it, the method with the best
    stated accuracy is recommended. Samples that reach it are recommended even if every other method misses it and
    disagrees. Without a requested accuracy, the own error of the method must be at most 1 % of the standard deviation.
    If no method meets this limit, the limit is 5 %; after that, the method with the smallest error is recommended.
    Outputs that do not vary are ignored. Methods whose costs and errors differ only by chance are equally recommended.
    Costs are numbers of realisations if each wall time is at most a minute, and wall times otherwise.

    Parameters
    ----------
    comparison : xarray.Dataset
        Comparison of two or more methods, from :func:`uqmbd.results.compare`.

    Returns
    -------
    tuple of str
        Sentences: the recommendation first, then one for each other method.

    Examples
    --------
    >>> from uqmbd.results import compare, propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels(["x"], [], [0.0, 1.0])
    >>> def node(label, std, cost, error):
    ...     known = {"std_error_mean": [[error, error]], "std_error_std": [[error, error]]}
    ...     statistics = statistics_dataset(axes, mean=[[0.0, 0.0]], std=[[std, std]], **known)
    ...     return propagator_node(label, statistics, propagator="p", realisations=cost, wall_time=0.01 * cost)
    >>> for sentence in recommend(compare([node("many", 1.0, 10000, 0.01), node("few", 0.99, 1000, 0.02)])):
    ...     print(sentence)
    Use few: it agrees with many, its stated error is at most 4.0 % of the standard deviation (at 0 s), and it is 10
    times cheaper than many (10 s instead of 1 min 40 s for the whole method; 1000 realisations instead of 10000).
    """
    return advice(comparison)[1]


def recommended(comparison: xr.Dataset) -> tuple[str, ...]:
    """Return the labels of the methods that :func:`recommend` recommends.

    There are several labels if methods are equivalent. There is no label if no method can be recommended, or if methods
    are not compared.
    """
    if "recommended" in comparison.attrs:  # includes the comparison of scalar outputs
        return tuple(str(label) for label in json.loads(comparison.attrs["recommended"]))
    return advice(comparison)[0]


def advice(comparison: xr.Dataset) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the labels of recommended methods, and sentences with reasons; nothing for a single method.

    There are several labels if the methods are equivalent. The first sentence is the recommendation.
    """
    if comparison.sizes["method"] < 2 or "verdict" not in comparison or not comparison.sizes["output"]:
        return (), ()
    methods = _methods(comparison)
    base = next(m for m in methods if m.label == str(comparison.attrs["reference"]))
    if all(m.kind == NO_SPREAD for m in methods):
        lead = "No output varies beyond the integration error: one realisation is sufficient."
        return tuple(m.label for m in methods), (lead,)
    fit = [m for m in methods if m.kind in (AGREES, REFERENCE, NO_SPREAD) and not m.unknown]
    use: list[_RatedMethod] = []
    if not fit:
        lead = "No method is recommended: none has all statistics at all times and agrees with the reference."
    elif fit == [base] and (poor := json.loads(str(comparison.attrs.get("reference_under_resolved", "[]")))):
        remedy = str(comparison.attrs.get("reference_remedy", "")).rstrip(".")
        lead = (
            f"No method is recommended: for {_joined(_few(poor), 'and')} the stated error of {base.label}, the "
            f"reference{base.known}, is above {format_percent(COARSE)} of the standard deviation. {resort(remedy)}."
        )
    elif fit == [base] and _only_samples_reach(methods, base, comparison):
        use, percent = [base], 100 * float(comparison.attrs["requested_accuracy"])
        lead = f"Use {base.label}: no other method reaches the requested accuracy of {percent:g} %{base.known}."
    elif fit == [base]:
        lead = _alone(methods, base)
        if base.error <= COARSE and all(m.kind == UNDER_RESOLVED and not m.unknown for m in methods if m is not base):
            use = [base]
    elif len(fit) == len(methods) and all(m.same for m in methods):
        use = methods
        lead = (
            f"{_listed(methods, 'and')} give equal results from equal numbers of realisations. None is "
            f"preferable{base.known}."
        )
    else:
        best = _cheapest(fit, requested="requested_accuracy" in comparison.attrs)
        use = [m for m in fit if m is best or m.equals(best)]
        lead = f"{_missed(comparison, methods)}Use {_listed(use, 'or')}: {_reasons(use, fit, best, base, methods)}."
    others = [_other(m, base) for m in methods if m not in (*use, base)]
    if base.gaps:
        others.append(f"{base.label}, the reference, {base.gaps}.")
    return tuple(m.label for m in use), (lead, *others)


def _only_samples_reach(methods: list[_RatedMethod], base: _RatedMethod, comparison: xr.Dataset) -> bool:
    """Return whether the reference consists of samples and is the only method that reaches the requested accuracy.

    The standard errors of samples are valid for any mechanism. A surrogate that missed the accuracy may understate its
    error. An example is a bimodal stiffness: a chaos of order 24 states 1.8 %, but its standard deviation is 3 % wrong.
    """
    sampled = bool(comparison.attrs.get("reference_sampled", 0))
    return sampled and base.met and not any(m.met for m in methods if m is not base)


def _missed(comparison: xr.Dataset, methods: list[_RatedMethod]) -> str:
    """Return a sentence if no method reaches the requested accuracy; otherwise an empty text."""
    if "requested_accuracy" not in comparison.attrs or any(m.met for m in methods):
        return ""
    return f"No method reaches the requested accuracy of {100 * float(comparison.attrs['requested_accuracy']):g} %. "


def _methods(comparison: xr.Dataset) -> list[_RatedMethod]:
    """Return the ratings of methods.

    Costs are realisations if a wall time is unknown, or if all are too short to depend on the mechanism.
    """
    found, scale = judgements_of(comparison), comparison["reference_std_max"].values
    unknown = comparison["unknown_times"].values if "unknown_times" in comparison else [0] * len(found)
    times, counts = comparison["wall_time"].values, comparison["realisations"].values
    timed = bool(np.all(np.isfinite(times) & (times > 0))) and times.max() > FIXED_COSTS
    costs = times if timed else counts
    requested = float(comparison.attrs.get("requested_accuracy", 0.0))
    accuracies = comparison["stated_accuracy"].values if requested else [math.inf] * len(found)
    base = list(found).index(str(comparison.attrs["reference"]))
    off = [comparison[f"{name}_difference_max"].values for name in ("mean", "std")]
    still = comparison["verdict_kind"].values == NO_SPREAD
    made = []
    for k, (label, of) in enumerate(found.items()):
        own = comparison["own_error"].values[k]
        error = float(np.max(own)) if np.isfinite(own).all() else math.inf
        same = all(np.all(still[k] | (d[k] <= SAME * scale)) for d in off) and bool(counts[k] == counts[base])
        numbers = (error, float(costs[k]), float(times[k]), int(counts[k]), int(unknown[k]))
        accuracy = float(accuracies[k])
        made.append(_RatedMethod(label, of, *numbers, same, accuracy, accuracy <= requested, timed))
    return made


def _alone(methods: list[_RatedMethod], base: _RatedMethod) -> str:
    """Return a message that all other methods are unreliable, because they differ or are under-resolved."""
    holed = any(m.unknown for m in methods)
    if any(m.kind == DIFFERS for m in methods) or holed:
        whole = " and has all statistics at all times" if holed else ""
        return (
            f"No other method agrees with {base.label}, the reference{base.known}{whole}: do not rely on any of these "
            "methods before you understand the reasons below."
        )
    lead = f"No other method is accurate enough to verify {base.label}, the reference"
    rely = f"use only {base.label}, within its stated error"
    agreed = {m.label: tuple(one.output for one in m.found if one.kind == AGREES) for m in methods}
    checked = {name for names in agreed.values() for name in names}
    missing = [one for one in base.found if one.varies and one.output not in checked]
    if not checked or not missing:
        return f"{lead}{base.known}: {rely}."
    on: dict[tuple[str, ...], list[str]] = {}
    for label, names in agreed.items():
        if names:
            on.setdefault(names, []).append(label)
    parts = [
        f"{_joined(ms, 'and')} agree{'s' if len(ms) == 1 else ''} with {base.label} on "
        f"{_joined(_few(list(names)), 'and')}"
        for names, ms in on.items()
    ]
    known = f" ({words})" if (words := largest_error(missing)) else ""
    few = _few([one.output for one in missing])
    return f"{lead}, on {_joined(few, 'and')}{known}: {rely}. {_joined(parts, 'and')}."


def resort(remedy: str) -> str:
    """Return advice on a large stated error: first the remedy that the method states, then sampling.

    >>> resort("raise the order"), resort("")
    ('Raise the order; if that does not reduce the error, use a sampling method', 'Use a sampling method')
    """
    then = "; if that does not reduce the error, use a sampling method"
    return f"{remedy[:1].upper()}{remedy[1:]}{then}" if remedy else "Use a sampling method"


def _few(names: list[str]) -> list[str]:
    """Return at most three names, and the number of other names."""
    return names if len(names) <= 3 else [*names[:2], f"{len(names) - 2} more"]


def _listed(methods: list[_RatedMethod], last: str) -> str:
    return _joined([m.label for m in methods], last)


def _joined(names: list[str], last: str) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {last} {names[-1]}"


def _cheapest(methods: list[_RatedMethod], *, requested: bool) -> _RatedMethod:
    if requested and (known := [m for m in methods if math.isfinite(m.accuracy)]):
        if enough := [m for m in known if m.met]:
            return min(enough, key=lambda m: m.cost)
        return min(known, key=lambda m: (m.accuracy, m.cost))
    for limit in (EXACT, WELL):
        if enough := [m for m in methods if m.error <= limit]:
            return min(enough, key=lambda m: m.cost)
    return min(methods, key=lambda m: (m.error, m.cost))


def _reasons(
    use: list[_RatedMethod],
    fit: list[_RatedMethod],
    best: _RatedMethod,
    base: _RatedMethod,
    methods: list[_RatedMethod],
) -> str:
    if len(use) > 1:
        parts = ["they agree" if base in use else f"they agree with {base.label}"]
        parts += [f"{m.label}: {words}" for m in use if (words := largest_error(m.found))]
        return "; ".join((*parts, "their costs do not differ significantly"))
    others = [m for m in fit if m is not base]
    agree = f"with which {_listed(others, 'and')} {'agrees' if len(others) == 1 else 'agree'}"
    parts = [f"it agrees with {base.label}" if best is not base else f"it is the reference, {agree}"]
    if best.met:
        size = format_at_most(best.accuracy, "the largest standard deviation")
        parts.append(f"its stated error is {size} (of mean and standard deviation)")
    elif words := largest_error(best.found):
        parts.append(f"its {words.replace('stated error', 'stated error is', 1)}")
    other = base if best is not base else max(methods, key=lambda m: m.cost)
    if other is not best and best.cost > 0 and other.cost > 1.05 * best.cost:
        ratio = other.cost / best.cost
        times = f"{ratio:.0f}" if ratio >= 9.95 else f"{ratio:.2g}"
        parts.append(f"it is {times} times cheaper than {other.label} ({_compared(best, other)})")
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])}, and {parts[-1]}"


def _compared(one: _RatedMethod, other: _RatedMethod) -> str:
    sentences = []
    if one.timed:
        sentences.append(f"{_duration(one.wall_time)} instead of {_duration(other.wall_time)} for the whole method")
    sentences.append(f"{one.realisations} realisations instead of {other.realisations}")
    return "; ".join(sentences)


def _duration(seconds: float) -> str:
    if seconds < 1:
        return f"{1000 * seconds:.0f} ms"
    if seconds < 60:
        return f"{seconds:.2g} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def _other(method: _RatedMethod, base: _RatedMethod) -> str:
    one, which = worst(method.found)
    if one.kind in (AGREES, NO_SPREAD):
        gaps = f"{method.gaps}; at the other times it " if method.unknown else ""
        message = f"; {words}" if (words := largest_error(method.found)) else ""
        return f"{method.label} {gaps}agrees with {base.label}{message}."
    where = f" ({which})" if which else ""
    message = {DIFFERS: f" from {base.label}"}.get(one.kind, "")
    head, _, tail = one.text.partition(":")
    verb = {UNDER_RESOLVED: "is ", UNVERIFIED: "is ", FEW: "has "}.get(one.kind, "")
    return f"{method.label}{where} {verb}{head}{message}:{tail}." if tail else f"{method.label}{where}: {one.text}."
