"""A chart whose parts do not fit together is refused, with the part: columns, marks, references, places of a plane."""

from __future__ import annotations

import numpy as np
import pytest

from uqmbd.errors import StudyError
from uqmbd.report import Chart, Curve, chart_figure, charts_html
from uqmbd.report.charts import checked_chart
from uqmbd.report.charts.model import Column

TIMES = np.linspace(0, 1, 5)


def refused(curve: Curve, words: str, **more: object) -> None:
    chart = Chart("force", TIMES, [curve], **more)
    for use in (checked_chart, chart_figure, lambda one: charts_html([one], "a", "b")):
        with pytest.raises(StudyError, match=f"chart 'force': {words}"):
            use(chart)


@pytest.mark.parametrize(
    "values", [[1.0] * 4, [1.0] * 6, [], ["a"] * 4, 3.0, "abcde", np.ones((5, 2)), [[1.0, 2.0], 3.0]]
)
def test_columns_have_an_entry_for_each_place(values):
    refused(Curve("one", TIMES, columns=(Column("more", values),)), "curve 'one': column 'more' has the shape")


@pytest.mark.parametrize("values", [[1.0] * 5, ["a", "b", "c", "d", "e"], np.arange(5)])
def test_columns_of_numbers_or_names_are_taken(values):
    assert checked_chart(Chart("force", TIMES, [Curve("one", TIMES, columns=(Column("more", values),))]))


@pytest.mark.parametrize("mark", [(np.nan, 1.0), (0.5, np.inf), (1.0,), (1, 2, 3), 0.5, "ab", (0.5, "a"), None])
def test_marks_are_pairs_of_numbers(mark):
    refused(Curve("one", TIMES, marks=[(0.5, 0.5), mark]), "curve 'one': marks contain")


@pytest.mark.parametrize("key", ["references", "limits"])
@pytest.mark.parametrize("levels", [{"a": np.nan}, {"a": -np.inf}, {"a": "1"}, {"a": None}, [1.0], None])
def test_levels_are_finite_numbers_by_names(key, levels):
    refused(Curve("one", TIMES), f"{key} is", **{key: levels})


@pytest.mark.parametrize("places", [[1.0] * 4, np.ones((5, 1)), [np.inf] * 5])
def test_places_of_a_plane_fit_the_values(places):
    refused(Curve("one", TIMES, places=places), "places of 'one' (has|contains)")
