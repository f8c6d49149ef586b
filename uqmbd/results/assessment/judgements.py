"""Read from a comparison what each method states about its outputs, and whether it agrees with the reference."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.results.assessment.limits import COARSE
from uqmbd.results.assessment.own_errors import NO_SPREAD
from uqmbd.results.assessment.verdicts import AGREES, DIFFERS, FEW, REFERENCE, UNDER_RESOLVED, UNVERIFIED
from uqmbd.results.chaos import spread_words
from uqmbd.wording import format_at_most

__all__ = ["Judgement", "MethodVerdict", "judgements_of", "largest_error", "method_verdicts", "worst"]

_SIGNS = {REFERENCE: "•", AGREES: "✓", DIFFERS: "✗", UNDER_RESOLVED: "!", FEW: "?", UNVERIFIED: "?", NO_SPREAD: "–"}
_SHORT = {REFERENCE: "the reference", NO_SPREAD: "no output varies"}
"""Short texts of verdict kinds whose names are not suitable as texts."""

_ORDER = (DIFFERS, UNDER_RESOLVED, FEW, UNVERIFIED, AGREES, REFERENCE, NO_SPREAD)


@dataclass(frozen=True)
class Judgement:
    """Judgement of one output of one method."""

    method: str
    output: str
    timeless: bool = False  # whether the output has no time
    kind: str = ""  # kind of the verdict, from :func:`uqmbd.results.compare`; empty if the output is not compared
    text: str = ""  # statement on the output
    varies: bool = True  # whether the output varies
    error: float = math.inf  # largest stated error, over the standard deviation; infinite: none is stated
    time: float = math.nan  # time of the largest error, s; NaN for a scalar output
    floored: bool = False  # whether the lower limit of the denominator affects the largest stated error
    # distance of mean and standard deviation from the reference, over the largest standard deviation of the reference
    difference: float = 0.0

    @property
    def stated(self) -> str:
        """Stated error in words."""
        return (
            _error_words(self.error, self.time, floored=self.floored)
            if math.isfinite(self.error)
            else "states no error"
        )


def judgements_of(comparison: xr.Dataset, *, timeless: bool = False) -> dict[str, list[Judgement]]:
    """Return the judgements in a comparison by method, one for each output; methods without a verdict are omitted.

    If ``timeless``, the function reads the scalar outputs of the comparison of a study. Errors that are not in the
    comparison are infinite.
    """
    prefix, dim, end = ("scalar_", "scalar", "") if timeless else ("", "output", "_l2")
    if f"{prefix}verdict_kind" not in comparison or "method" not in comparison.coords:
        return {}
    outputs = [str(name) for name in comparison[dim].values]
    empty = np.full((comparison.sizes["method"], len(outputs)), np.nan)

    def read(name: str) -> Any:
        return comparison[name].transpose("method", dim).values if name in comparison else empty

    scale = comparison["scalar_reference_std" if timeless else "reference_std_max"].values
    off = np.hypot(read(f"{prefix}mean_difference{end}"), read(f"{prefix}std_difference{end}"))
    off = np.nan_to_num(off / np.where(scale > 0, scale, np.inf), nan=0.0)
    kinds, texts = read(f"{prefix}verdict_kind"), read(f"{prefix}verdict")
    errors, times = read(f"{prefix}stated_error_max"), read(f"{prefix}stated_error_time")
    floored = read(f"{prefix}stated_error_floored") == 1
    return {
        label: found
        for m, label in enumerate(map(str, comparison["method"].values))
        if (
            found := [
                Judgement(
                    label,
                    output,
                    timeless,
                    kind=str(kinds[m, o]),
                    text=str(texts[m, o]),
                    varies=str(kinds[m, o]) != NO_SPREAD,
                    error=math.inf if np.isnan(errors[m, o]) else float(errors[m, o]),
                    time=float(times[m, o]),
                    floored=bool(floored[m, o]),
                    difference=float(off[m, o]),
                )
                for o, output in enumerate(outputs)
                if str(kinds[m, o])
            ]
        )
    }


@dataclass(frozen=True)
class MethodVerdict:
    """Verdict on a compared method: the kind of its worst verdict, a sign, and words."""

    method: str
    kind: str
    text: str
    sign: str


def method_verdicts(judgements: Sequence[Judgement]) -> tuple[MethodVerdict, ...]:
    """Return one verdict for each compared method, from the verdicts on its outputs.

    >>> from uqmbd.results.assessment.judgements import Judgement, method_verdicts
    >>> (one,) = method_verdicts([Judgement("a", "x", kind="agrees", error=0.2, time=0.5)])
    >>> one.sign, one.text
    ('!', 'agrees; stated error at most 20 % of the standard deviation (at 0.5 s)')
    """
    found: dict[str, list[Judgement]] = {}
    for one in judgements:
        if one.kind:
            found.setdefault(one.method, []).append(one)
    return tuple(_method_verdict(label, of) for label, of in found.items())


def _method_verdict(label: str, found: Sequence[Judgement]) -> MethodVerdict:
    one, which = worst(found)
    text = _SHORT.get(one.kind, one.kind)
    if one.kind in (AGREES, REFERENCE) and (words := largest_error(found)):
        text += f"; {words}"
    elif which:
        text += f" ({which})"
    large = one.kind == AGREES and any(COARSE < each.error < math.inf for each in found)
    return MethodVerdict(label, one.kind, text, "!" if large else _SIGNS[one.kind])


def worst(found: Sequence[Judgement]) -> tuple[Judgement, str]:
    """Return the worst judgement on a method, and the names of the outputs with a judgement of this kind as text.

    For a method that agrees, the worst judgement has the largest stated error; otherwise the largest difference. The
    text is empty if the method agrees, or if all varying outputs have a judgement of this kind.

    Raise StudyError if a verdict has an unknown kind, as in a changed file.

    >>> from uqmbd.results.assessment.judgements import Judgement, worst
    >>> one, which = worst([Judgement("a", "x", kind="agrees"), Judgement("a", "y", kind="differs")])
    >>> one.output, which
    ('y', 'y')
    """
    if unknown := {one.kind for one in found} - set(_ORDER):
        raise StudyError(f"comparison: verdict_kind is {min(unknown)!r}; expected one of {', '.join(_ORDER)}.")
    kind = min((one.kind for one in found), key=_ORDER.index)
    shared = [one for one in found if one.kind == kind]
    first = max(shared, key=lambda one: one.error if kind in (AGREES, REFERENCE) else one.difference)
    if kind in (AGREES, REFERENCE) or len(shared) == sum(one.kind != NO_SPREAD for one in found):
        return first, ""
    names = [one.output for one in sorted(shared, key=lambda one: one is not first)]
    return first, ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")


def largest_error(found: Sequence[Judgement]) -> str:
    """Return the largest stated error of a method over its outputs; empty if it is not stated for all."""
    if not found or not all(math.isfinite(one.error) for one in found):
        return ""
    one = max(found, key=lambda one: one.error)
    return _error_words(one.error, one.time, one.output if len(found) > 1 else "", any(x.floored for x in found))


def _error_words(share: float, time: float, output: str = "", floored: bool = False) -> str:
    """Return a text on the largest stated error, as a share of the standard deviation, with its output and time (s).

    >>> _error_words(0.02, 0.5), _error_words(0.02, math.nan, "x")
    ('stated error at most 2.0 % of the standard deviation (at 0.5 s)',
     'stated error at most 2.0 % of the standard deviation (of x)')
    >>> _error_words(30.91, 5.55)
    'stated error larger than the standard deviation, up to 31 times as large (at 5.55 s)'
    >>> _error_words(0.02, 0.5, floored=True)
    'stated error at most 2.0 % of the standard deviation, taken as at least 1 % of its maximum (at 0.5 s)'
    """
    where = [f"of {output}"] if output else []
    where += [f"at {time:g} s"] if math.isfinite(time) else []
    place = f" ({', '.join(where)})" if where else ""
    return f"stated error {format_at_most(share, spread_words(floored))}{place}"
