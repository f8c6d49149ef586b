"""Whether to believe it: one line for each output and requirement, what is worst first."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

from uqmbd.report.overview.trusted import (
    ROUGHLY,
    WELL,
    answer_of,
    comparison_of,
    holder_of,
    populations,
    trusted_labels,
)
from uqmbd.report.view import Method, StudyResult
from uqmbd.results import answers
from uqmbd.results.comparison import (
    AGREES,
    DIFFERS,
    FEW,
    REFERENCE,
    STILL,
    UNDER_RESOLVED,
    largest_error_words,
    own_error,
)
from uqmbd.results.requirements import differing
from uqmbd.results.statistics import rtol_of
from uqmbd.wording import format_count, format_percent

__all__ = ["RARE", "Line", "belief"]

WIDE = 0.5
"""Half an interval, in shares of the probability, up to which that is known well."""

RARE = 1e-3
"""Probabilities that are known to be less than this are known well."""

SIGNS = ("✗", "!", "✓", "–")
WORDS = ("no", "roughly", "yes", "nothing to know")


@dataclass(frozen=True)
class Line:
    """What is to be believed of one quantity.

    Attributes
    ----------
    name : str
    level : int
        0: no, 1: roughly, 2: yes, 3: there is nothing to be uncertain about.
    text : str
        Why.
    error : float
        By which lines of a level are sorted.
    stated : str
        The stated error of an output in words; empty for others, and where it is not known.
    """

    name: str
    level: int
    text: str
    error: float = 0.0
    stated: str = ""

    @property
    def sign(self) -> str:
        """A letter, for those who see no colours."""
        return SIGNS[self.level]

    @property
    def word(self) -> str:
        """The level in a word."""
        return WORDS[self.level]


def belief(result: StudyResult) -> list[Line]:
    """Return a line for each requirement, output over time and output without a time, what is worst first."""
    found = [_of_requirement(result, name) for name in answers(result.nodes)]
    parts = populations(result)
    for part, scalar in itertools.product(parts, (False, True)):
        known: dict[str, list[Line]] = {}
        for name in part.scalar_names if scalar else part.histories:
            method = holder_of(part, name, scalar=scalar)
            if method is None:
                continue
            if method.label not in known:
                known[method.label] = _of_method(part, method, scalar=scalar)
            line = known[method.label][method.names.index(name)]
            if method.label != trusted_labels(part)[0]:
                line = replace(line, text=f"by {method.label}, {line.text}")
            found.append(line if len(parts) == 1 else replace(line, name=f"{name} ({method.label})"))
    order = {line.name: k for k, line in enumerate(found)}
    return sorted(found, key=lambda line: (line.level, -line.error, order[line.name]))


def _of_method(result: StudyResult, method: Method, *, scalar: bool) -> list[Line]:
    """Return a line for each output of a method."""
    own = own_error(method.node, rtol_of(method.node), dependence=False)
    errors, at = own.largest(None if scalar else method.statistics["time"].values)
    return [
        _line(result, method.label, name, _Known(float(errors[o]), float(at[o]), bool(own.varies[o]), scalar))
        for o, name in enumerate(method.names)
    ]


@dataclass(frozen=True)
class _Known:
    """The stated error of an output, when it is largest, and whether the output varies, and has no time."""

    error: float
    at: float
    varies: bool
    scalar: bool


def _line(result: StudyResult, label: str, name: str, known: _Known) -> Line:
    if not known.varies:
        return Line(name, 3, STILL)
    error, at, kind, other = known.error, known.at, "", ""
    if (row := _compared(result, name, scalar=known.scalar)) is not None and label in row.kinds:
        kind, other = row.verdict(label)
        # the number of the comparison, which stands elsewhere on the page, too
        error, at = row.errors.get(label, (error, at))
    said = largest_error_words(error, at) if math.isfinite(error) else "states no error"
    level = 1 if not math.isfinite(error) else 2 if error <= WELL else 1 if error <= ROUGHLY else 0
    if kind in (DIFFERS, UNDER_RESOLVED):
        level = 0
    elif kind == FEW:
        level = min(level, 1)
    words = {DIFFERS: f"differs from {other}", AGREES: f"agrees with {other}"}
    alone = (
        "no other method is resolved well enough to compare"
        if row is not None and len(row.kinds) > 1
        else "compared with nothing"
    )
    text = f"{said}; {words.get(kind, kind) or alone}"
    known_error = math.isfinite(error)
    return Line(name, level, text, error if known_error else ROUGHLY, said if known_error else "")


@dataclass(frozen=True)
class _Row:
    """What a comparison says of an output: kinds of verdicts and stated errors by method, and the reference."""

    kinds: dict[str, str]
    errors: dict[str, tuple[float, float]]
    reference: str

    def verdict(self, label: str) -> tuple[str, str]:
        """Return the kind for a method, and the other method; of the reference whether any agrees with it."""
        if self.kinds[label] != REFERENCE:
            return self.kinds[label], self.reference
        for kind in (AGREES, DIFFERS):
            for method, one in self.kinds.items():
                if one == kind:
                    return kind, method
        return "", ""


def _compared(result: StudyResult, name: str, *, scalar: bool) -> _Row | None:
    """Return what was compared of an output; None: nothing."""
    data = comparison_of(result)
    variable, dim = ("scalar_verdict_kind", "scalar") if scalar else ("verdict_kind", "output")
    if data is None or variable not in data or name not in data[dim].values:
        return None
    methods = [str(method) for method in data["method"].values]
    one = data.sel({dim: name})
    errors = {}
    if not scalar and {"stated_error_max", "stated_error_time"} <= set(data.data_vars):
        pairs = zip(one["stated_error_max"].values.tolist(), one["stated_error_time"].values.tolist(), strict=True)
        errors = dict(zip(methods, pairs, strict=True))
    kinds = {method: str(kind) for method, kind in zip(methods, one[variable].values, strict=True) if str(kind)}
    own = str(data.attrs.get("scalar_reference", "")) if scalar else ""
    return _Row(kinds, errors, own or str(data.attrs.get("reference", "")))


def _of_requirement(result: StudyResult, name: str) -> Line:
    """Say whether methods agree on a probability, and how wide its interval is."""
    found = answers(result.nodes)[name]
    one, of = answer_of(result, name), f"requirement {name}"
    if any(f"on {name!r}" in sentence for sentence in differing(result.nodes)):
        low, high = min(found.values(), key=lambda o: o.upper), max(found.values(), key=lambda o: o.lower)
        return Line(of, 0, f"{low.method} and {high.method} contradict each other", 1.0)
    wide = max(one.upper - one.probability, one.probability - one.lower)
    share = wide / one.probability if one.probability > 0 else math.inf
    level = 2 if share <= WIDE or one.upper <= RARE else 1
    if not math.isfinite(one.probability) or (one.lower <= 0 and one.upper >= 1):
        level = 0
    said = (
        f"its 95 % interval reaches {format_percent(share)} of the probability to a side"
        if math.isfinite(share)
        else f"violated in none of what was computed, {one.words}"
    )
    others = [other for other in found.values() if other.method != one.method]
    if others:
        said += f"; {format_count(len(found), 'method')} agree" if len(found) > 2 else f"; {others[0].method} agrees"
    else:
        said += "; compared with nothing"
    return Line(of, level, said, min(share, 1.0))
