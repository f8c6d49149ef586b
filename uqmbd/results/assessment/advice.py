"""Advice on the results of single methods: sizes of samples, and remedies for large stated errors."""

from __future__ import annotations

import math
from collections.abc import Iterable

import xarray as xr

from uqmbd.plugins import such_as
from uqmbd.results.assessment.judgements import Judgement
from uqmbd.results.assessment.limits import COARSE, WELL
from uqmbd.results.assessment.own_errors import own_error, replicates_of
from uqmbd.results.assessment.recommendation import resort
from uqmbd.results.chaos import spread_words
from uqmbd.results.statistics import rtol_of
from uqmbd.wording import format_at_most, format_count, format_integer

__all__ = ["advice_on_errors", "advice_on_rare_violations", "precision_of"]


def advice_on_rare_violations(names: Iterable[str]) -> str:
    """Return how to reduce the upper bounds of the probabilities of requirements without an observed violation."""
    return (
        f"{', '.join(names)}: ten times as many realisations without a violation would reduce the upper bound of "
        "the probability to a tenth. A method that searches for violations needs fewer"
        f"{such_as(searches_violations=True)}."
    )


def precision_of(label: str, node: xr.DataTree, found: list[Judgement], methods: int) -> str:
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


def advice_on_errors(node: xr.DataTree, found: list[Judgement]) -> tuple[str, ...]:
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


def _halving(node: xr.DataTree) -> str:
    """State the number of samples that halves an error."""
    sizes = ("statistics_samples", "sample_size", "realisations")
    count = next((int(node.attrs[name]) for name in sizes if name in node.attrs), 0)
    return f"{format_count(4 * count, 'sample')} instead of {format_integer(count)} would halve"
