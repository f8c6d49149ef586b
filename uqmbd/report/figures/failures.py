"""Charts of failed samples: groups of equal reasons, and the inputs that separate failed from successful samples."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.report.charts import Axis, Chart, Curve, Look, draw_on_paper
from uqmbd.report.figures.selection import Samples, label_of, runs_of, samples_of
from uqmbd.results import STATUS_MEANINGS
from uqmbd.status import Status
from uqmbd.typing import Array
from uqmbd.wording import format_count, format_number, typeset_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "FailedInputs",
    "FailureGroup",
    "FailureSeparation",
    "failed_inputs",
    "failure_inputs",
    "failure_reasons",
    "failures_chart",
    "separating_inputs",
]

_MOST_POINTS = 1500
ENOUGH = 3
"""Minimum number of failures of one kind for a comparison of inputs."""
# group 1: a name in quotes, which is not changed; group 2: a number that is not part of a word
_TOKENS = re.compile(r"""('[^']*'|"[^"]*")|(?<![\w.])([+\-−]?(?:\d+\.?\d*|\.\d+)(?:[eE][+\-]?\d+)?)(?![\w]|\.\d)""")
_BRACKETS = re.compile(r"\s*\([^()]*\)")


@dataclass(frozen=True, eq=False)
class FailureGroup:
    """Failed samples with the same reason: status as text, message with ranges of numbers, and sample indices."""

    kind: str
    text: str
    samples: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class FailureSeparation:
    """Degree to which an input separates failed from successful samples."""

    index: int  # index of the input
    # largest difference between the two empirical distribution functions (Kolmogorov and Smirnov), 0 to 1
    distance: float
    clear: bool  # whether the probability of such a distance by chance is below 1 %


def failure_reasons(node: Samples) -> list[FailureGroup]:
    """Group the failed samples of a method by their reason, the most frequent first.

    Messages that differ only in their numbers, or in remarks in brackets, count as one reason; differing numbers become
    a range.

    `node` is the node of a propagator that has ``samples``, or its samples.

    >>> from uqmbd.extend import labels, sample_dataset
    >>> messages = ["", "no step at t = 0.25 s (joint 'a')", "no step at t = 0.5 s (joint 'b')"]
    >>> axes = labels(["x"], ["k"], [0.0])
    >>> samples = sample_dataset([[[0.0]]] * 3, [[1.0]] * 3, axes, status=[0, 2, 2], messages=messages)
    >>> [(r.kind, r.text, len(r.samples)) for r in failure_reasons(samples)]
    [('integration failed', 'no step at t = 0.25 to 0.5 s', 2)]
    """
    samples = _runs(node)
    status = samples["status"].values
    flags = np.atleast_1d(samples["status"].attrs.get("flag_values", [])).tolist()
    meanings = dict(STATUS_MEANINGS)
    meanings |= zip(flags, str(samples["status"].attrs.get("flag_meanings", "")).split(), strict=False)
    messages = samples["message"].values
    groups: dict[tuple[str, str], list[int]] = {}
    for k in np.flatnonzero(~np.isin(status, [Status.OK, Status.CENSORED])):
        kind = meanings.get(int(status[k]), f"status {int(status[k])}").replace("_", " ")
        groups.setdefault((kind, _pattern(str(messages[k]))), []).append(int(k))
    ordered = sorted(groups.items(), key=lambda item: -len(item[1]))
    return [
        FailureGroup(kind, _joined([str(messages[k]) for k in which]), np.array(which)) for (kind, _), which in ordered
    ]


def _runs(node: Samples) -> xr.Dataset:
    found = runs_of(node)
    return samples_of(node) if found is None else found


def _pattern(message: str) -> str:
    return _TOKENS.sub(lambda found: found[1] or "#", _BRACKETS.sub("", message))


def _joined(messages: list[str]) -> str:
    """Merge messages of the same pattern; ranges replace numbers that differ."""
    if not messages[0]:
        return "no reason was reported"
    if len(set(messages)) == 1:
        return messages[0]
    plain = [_BRACKETS.sub("", message) for message in messages]
    written = [[found[2] for found in _TOKENS.finditer(text) if found[2]] for text in plain]
    columns = iter(zip(*written, strict=True))

    def merged(found: re.Match[str]) -> str:
        if found[1]:
            return found[1]
        column = sorted(set(next(columns)), key=lambda text: float(text.replace("−", "-")))
        return column[0] if len(column) == 1 else f"{column[0]} to {column[-1]}"

    return _TOKENS.sub(merged, plain[0])


def separating_inputs(node: Samples, reason: FailureGroup) -> list[FailureSeparation]:
    """Sort the inputs by their separation of samples that failed for a reason from successful samples.

    `node` is the node of a propagator that has ``samples``, or its samples. The input with the clearest separation is
    first.

    >>> import numpy as np
    >>> from uqmbd.extend import labels, sample_dataset
    >>> drawn = np.random.default_rng(0).random((200, 2))
    >>> status = np.where(drawn[:, 1] > 0.9, 1, 0)
    >>> samples = sample_dataset(np.zeros((200, 1, 1)), drawn, labels(["x"], ["a", "b"], [0.0]), status=status)
    >>> [(s.index, s.clear) for s in separating_inputs(samples, failure_reasons(samples)[0])]
    [(1, True), (0, False)]
    """
    samples = _runs(node)
    drawn, fine = samples["inputs"].values, samples["status"].values == Status.OK
    found = []
    for k in range(drawn.shape[1]):
        bad, good = np.sort(drawn[reason.samples, k]), np.sort(drawn[fine, k])
        both = np.concatenate([bad, good])
        if not len(good) or not np.all(np.isfinite(both)):
            found.append(FailureSeparation(k, 0.0, False))
            continue
        shares = [np.searchsorted(part, both, side="right") / len(part) for part in (bad, good)]
        distance = float(np.abs(shares[0] - shares[1]).max())
        critical = 1.63 * np.sqrt((len(bad) + len(good)) / (len(bad) * len(good)))
        found.append(FailureSeparation(k, distance, bool(distance > critical)))
    return sorted(found, key=lambda s: -s.distance)


def failure_words(node: Samples, reason: FailureGroup) -> list[str]:
    """Describe the inputs of failed samples by at most three sentences, one for each separating input."""
    samples = _runs(node)
    names, units = _input_labels(samples)
    after = [f" {typeset_units(one)}".rstrip() for one in units]
    if not names:
        return ["This method recorded no inputs."]
    drawn, fine = samples["inputs"].values, samples["status"].values == Status.OK
    sentences = []
    for separation in [s for s in separating_inputs(node, reason) if s.clear][:3]:
        k = separation.index
        bad, good, unit = drawn[reason.samples, k], drawn[fine, k], after[k]
        ranges = _ranges(np.sort(bad), np.sort(good))
        inside = sum(int(((good >= low) & (good <= high)).sum()) for low, high in ranges)
        spans = " or ".join(
            f"at {_short(low)}" if low == high else f"between {_short(low)} and {_short(high)}" for low, high in ranges
        )
        everything = drawn[:, k]
        others = (
            f"no sample with {'such a value' if len(ranges) == 1 else 'such values'} succeeded"
            if not inside
            else f"{format_count(inside, 'sample')} of that range succeeded"
        )
        sentences.append(
            f"{names[k]}: failed samples lie {spans}{unit} "
            f"(all samples {_short(float(everything.min()))} to {_short(float(everything.max()))}{unit}); {others}."
        )
    if not sentences and len(reason.samples) < ENOUGH:
        return ["These samples are too few to identify the responsible input."]
    if not sentences:
        return ["No single input separates these samples from the successful ones."]
    return sentences


def _short(value: float) -> str:
    return format_number(float(f"{value:.3g}"))


def _ranges(bad: NDArray[np.float64], good: NDArray[np.float64]) -> list[tuple[float, float]]:
    """Return the range of sorted failed values, or two ranges if most successful values are between them."""
    whole = [(float(bad[0]), float(bad[-1]))]
    if len(bad) < 2 or not len(good):
        return whole
    between = np.diff(np.searchsorted(good, bad))
    gap = int(between.argmax())
    if between[gap] < 0.5 * len(good):
        return whole
    return [(float(bad[0]), float(bad[gap])), (float(bad[gap + 1]), float(bad[-1]))]


def _input_labels(samples: xr.Dataset) -> tuple[list[str], list[str]]:
    names = [str(name) for name in samples["input"].values]
    units = [str(u) for u in samples["input_units"].values] if "input_units" in samples.coords else [""] * len(names)
    return names, units


@dataclass(frozen=True, eq=False)
class FailedInputs:
    """Samples in the one or two inputs that separate samples that failed for one reason most clearly."""

    # names, units: names and units of one or two inputs
    names: tuple[str, ...]
    units: tuple[str, ...]
    drawn: NDArray[np.float64]  # (S, 1) or (S, 2): inputs of all samples
    # fine, failed: indices of displayed samples; of many samples, only every second, third, ... one is displayed
    fine: NDArray[np.intp]
    failed: NDArray[np.intp]
    # count_fine, count_failed: total numbers of samples
    count_fine: int
    count_failed: int

    def places(self, which: NDArray[np.intp]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the positions of samples; for a single input, heights have no meaning and only separate the points."""
        if len(self.names) > 1:
            return self.drawn[which, 0], self.drawn[which, 1]
        # multiples of the golden ratio distribute the heights evenly
        return self.drawn[which, 0], np.asarray((which * 0.6180339887) % 1, dtype=float)


def failed_inputs(node: Samples, reason: int | FailureGroup) -> FailedInputs:
    """Return the data of `failure_inputs`.

    Raise StudyError if there are no such failures, or no inputs.
    """
    samples = _runs(node)
    names, units = _input_labels(samples)
    if isinstance(reason, int):
        reasons = failure_reasons(node)
        if not reasons:
            raise StudyError(f"The method {label_of(node)!r} has no failed realisations, so it has no reason {reason}.")
        if not 0 <= reason < len(reasons):
            raise StudyError(
                f"reason is {reason}; expected a number from 0 to {len(reasons) - 1}, because {label_of(node)!r} has "
                f"{len(reasons)} {'reason' if len(reasons) == 1 else 'reasons'} of failure."
            )
        reason = reasons[reason]
    if not names:
        raise StudyError(f"The study of {label_of(node)!r} has no random inputs, which this figure shows.")
    fine = np.flatnonzero(samples["status"].values == Status.OK)
    best = [s.index for s in separating_inputs(node, reason)[:2]]
    some, bad = (which[:: -(-len(which) // _MOST_POINTS)] if len(which) else which for which in (fine, reason.samples))
    drawn = np.asarray(samples["inputs"].values[:, best], dtype=float)
    of_best = tuple(names[k] for k in best), tuple(units[k] for k in best)
    return FailedInputs(*of_best, drawn, some, bad, len(fine), len(reason.samples))


def failures_chart(node: Samples, reason: int | FailureGroup) -> Chart:
    """Chart failed samples of one reason, and successful samples, over the inputs with the clearest separation.

    Raise StudyError if there are no such failures, or no inputs.
    """
    found = failed_inputs(node, reason)
    single = len(found.names) == 1
    shown = np.sort(np.concatenate([found.fine, found.failed]))
    curves = []
    for which, name, count, look in (
        (found.fine, "succeeded", found.count_fine, Look("quiet", (), shape="disc", size=4.5)),
        (found.failed, "failed", found.count_failed, Look("limit", (), shape="cross", size=7)),
    ):
        if len(which):
            x, y = (_spread(values, np.searchsorted(shown, which), len(shown)) for values in found.places(which))
            curves.append(Curve(f"{name} ({count})", y, (), "", look=look, places=x))
    return Chart(
        found.names[0] if single else found.names[1],
        shown.astype(float),
        curves,
        units="" if single else found.units[1],
        axis="" if single else found.names[1],
        along=Axis("sample", place_units="", before="sample ", whole=True),
        plane=Axis(found.names[0], typeset_units(found.units[0])),
        ends=(0.0, 1.0) if single else None,
        hidden=single,
        count=found.count_fine + found.count_failed,
        start=int(np.searchsorted(shown, found.failed[0])),
    )


def _spread(values: Array, at: NDArray[np.intp], count: int) -> Array:
    every = np.full(count, np.nan)
    every[at] = values
    return every


@typechecked
def failure_inputs(node: Samples, reason: int | FailureGroup = 0, *, ax: Axes | None = None) -> Figure:
    """Draw the inputs of samples that failed for one reason, and of successful samples.

    If there are several inputs, the figure shows the two with the clearest separation; a single input is a strip.

    Parameters
    ----------
    node : xarray.DataTree or xarray.Dataset
        Node of a propagator that has ``samples``, or its samples.
    reason : int or Reason
        Element of the result of :func:`failure_reasons`, or its index: 0 is the most frequent reason.
    ax : matplotlib.axes.Axes, optional
        Axes of an existing figure for the drawing and the legend. Default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    StudyError
        If there are no such failures, or no inputs.

    Examples
    --------
    >>> import numpy as np
    >>> from uqmbd.extend import labels, sample_dataset
    >>> drawn = np.random.default_rng(0).random((200, 2))
    >>> axes = labels(["x"], [("a", "m"), ("b", "kg")], [0.0])
    >>> samples = sample_dataset(np.zeros((200, 1, 1)), drawn, axes, status=np.where(drawn[:, 1] > 0.9, 1, 0))
    >>> axes = failure_inputs(samples).axes[0]
    >>> axes.get_xlabel(), axes.get_ylabel()
    ('b [kg]', 'a [m]')
    """
    chart = failures_chart(node, reason)
    return draw_on_paper(chart, ax=ax, height=2.2 if chart.hidden else 2.6)
