"""Check the consistency of the parts of a chart; the messages name inconsistent parts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.errors import StudyError
from uqmbd.report.charts.model import Axis, Chart, Curve
from uqmbd.typing import Array
from uqmbd.wording import typeset_units

__all__ = ["checked", "checked_chart"]


def _encodable(text: str) -> bool:
    """Return whether UTF-8 can encode a text; it cannot encode lone surrogates."""
    return not any("\ud800" <= letter <= "\udfff" for letter in text)


def checked(
    name: str, times: ArrayLike, given: Sequence[Curve], axis: str = "", *, categories: bool = False
) -> tuple[Array, list[Curve]]:
    """Return times and curves of a chart as arrays, after a check of their shapes and values.

    Times must increase. Along another `axis`, places may repeat, and a single place is sufficient. Bars require
    `categories`, because their distance determines the width of a bar. A StudyError names inconsistent parts.
    """
    where = f"chart {name!r}"
    if not isinstance(name, str):
        raise StudyError(f"{where}: its name is a {type(name).__name__}; expected a text.")
    if not _encodable(name):
        raise StudyError(
            f"chart {name!r}: its name contains half of a Unicode surrogate pair, which an HTML page cannot contain."
        )
    moments = _numbers(f"{where}: times", times)
    numbers = moments.ndim == 1 and bool(np.isfinite(moments).all())
    if axis and not (numbers and len(moments) > 0 and np.all(np.diff(moments) >= 0)):
        raise StudyError(
            f"{where}: the places along {axis!r} have the shape {moments.shape}; expected numbers that do not "
            "decrease, or names."
        )
    if not axis and not (numbers and len(moments) > 1 and np.all(np.diff(moments) > 0)):
        raise StudyError(
            f"{where}: times have the shape {moments.shape}; expected two or more finite, increasing numbers in s."
        )
    if isinstance(given, Curve) or not len(given) or not all(isinstance(curve, Curve) for curve in given):
        raise StudyError(f"{where}: curves is {given!r:.80}; expected a sequence of one or more uqmbd.report.Curve.")

    def fitting(part: str, values: ArrayLike) -> Array:
        found = _numbers(f"{where}: {part}", values)
        if found.shape != moments.shape or np.isinf(found).any():
            if found.shape == moments.shape:
                raise StudyError(f"{where}: {part} contains an infinity; expected numbers, or NaN for unknown values.")
            raise StudyError(f"{where}: {part} has the shape {found.shape}; expected {moments.shape}, as for times.")
        return found

    made = []
    for curve in given:
        texts = [curve.name, curve.quantity, *(band.name for band in curve.bands)]
        if not all(isinstance(text, str) for text in texts):
            raise StudyError(f"{where}: the names of a curve and its bands are {texts!r}; expected texts.")
        if curve.drawn not in ("line", "points", "bars", "dotted", "filled"):
            raise StudyError(
                f"{where}: curve {curve.name!r} is drawn as {curve.drawn!r}; "
                "expected dotted, filled, line, points or bars."
            )
        if curve.drawn == "bars" and not categories:
            raise StudyError(
                f"{where}: curve {curve.name!r} is drawn as bars, but its places are numbers; expected names as the "
                "places of a uqmbd.report.Chart, or a curve of points."
            )
        if len(curve.bands) > 2:
            raise StudyError(f"{where}: curve {curve.name!r} has {len(curve.bands)} bands; expected at most two.")
        bands = tuple(
            replace(
                band,
                low=fitting(f"the lower end of {band.name!r} of {curve.name!r}", band.low),
                high=fitting(f"the upper end of {band.name!r} of {curve.name!r}", band.high),
            )
            for band in curve.bands
        )
        values = fitting(f"curve {curve.name!r}", curve.values)
        if curve.places is not None:
            fitting(f"places of {curve.name!r}", curve.places)
        _check_columns(f"{where}: curve {curve.name!r}", curve, len(moments))
        made.append(replace(curve, values=values, bands=bands))
    names = [curve.name for curve in made]
    if len(set(names)) < len(names):
        raise StudyError(f"{where}: its curves are named {names}; expected a different name for each.")
    return moments, made


def _check_columns(where: str, curve: Curve, count: int) -> None:
    """Raise StudyError unless columns have one entry for each place, and marks are pairs of a place and a value."""
    for column in curve.columns:
        values = column.values
        given = () if isinstance(values, (str, bytes)) else np.shape(np.asarray(values, dtype=object))
        if given != (count,):
            raise StudyError(
                f"{where}: column {column.name!r} has the shape {given}; expected an entry for each of {count} places."
            )
    for mark in curve.marks:
        pair = mark if isinstance(mark, (Sequence, np.ndarray)) and not isinstance(mark, (str, bytes)) else ()
        if len(pair) != 2 or not all(map(_finite, pair)):
            raise StudyError(f"{where}: marks contain {mark!r}; expected a place and a value, both finite numbers.")


def _numbers(where: str, values: ArrayLike) -> Array:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise StudyError(f"{where}: {error}; expected real numbers.") from error


def checked_chart(chart: Chart) -> Chart:
    """Return a chart with arrays and a complete horizontal axis.

    Raise StudyError if its parts are inconsistent.
    """
    where = f"chart {chart.name!r}"
    texts = {key: getattr(chart, key) for key in ("title", "units", "across", "across_units")}
    if wrong := [f"{key} is {x!r}" for key, x in texts.items() if not isinstance(x, str) or not _encodable(x)]:
        raise StudyError(f"{where}: {', '.join(wrong)}; expected a text that an HTML page can contain.")
    names = _categories(chart)
    places = np.arange(1.0, len(names) + 1) if names else chart.places
    axis = chart.across or ("category" if names else "")
    moments, found = checked(chart.name, places, chart.curves, axis, categories=bool(names))
    for key, levels in (("limits", chart.limits), ("references", chart.references)):
        if not isinstance(levels, Mapping) or not all(map(_finite, levels.values())):
            raise StudyError(f"{where}: {key} is {levels!r}; expected a mapping from names to finite numbers.")
    ends = chart.ends
    if ends is not None and not (len(ends) == 2 and all(map(_finite, ends)) and ends[0] < ends[1]):
        raise StudyError(f"{where}: ends is {ends!r}; expected two finite numbers that increase.")
    if chart.log and (ends is None or ends[0] <= 0):
        raise StudyError(f"{where}: a logarithmic axis has ends {ends}; expected two ends above zero.")
    along = chart.along
    units = typeset_units(chart.across_units)
    if names:
        along = Axis(axis, units, (0.5, len(names) + 0.5), whole=True, texts=tuple(names), categories=True)
    elif axis:
        along = Axis(axis, units, _ends(moments))
    return replace(chart, places=moments, curves=found, along=along)


def _categories(chart: Chart) -> list[str]:
    """Return the names of the categories; empty if the places are numbers."""
    if isinstance(chart.places, str):
        raise StudyError(f"chart {chart.name!r}: places is the text {chart.places!r}; expected a list of names.")
    given = chart.places.tolist() if isinstance(chart.places, np.ndarray) else chart.places
    every = list(given) if isinstance(given, Sequence) else []
    named = [isinstance(one, str) for one in every]
    if any(named) and not all(named):
        raise StudyError(f"chart {chart.name!r}: places is {every!r:.80}; expected names or numbers, not both.")
    return list(map(str, every)) if any(named) else []


def _finite(value: object) -> bool:
    return isinstance(value, (int, float, np.number)) and bool(np.isfinite(value))


def _ends(places: Array) -> tuple[float, float]:
    low, high = float(places[0]), float(places[-1])
    room = 0.02 * (high - low) or 0.5 * abs(low) or 0.5
    return low - room, high + room
