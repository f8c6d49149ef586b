"""Charts of the report in outputs of notebooks, which contain the scripts of the charts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from uqmbd.wording import format_integer

if TYPE_CHECKING:
    from uqmbd.propagation import Study
    from uqmbd.report.view import StudyResult
    from uqmbd.results import PolynomialChaos

__all__ = ["FIRST_SCREEN", "alive", "motion_charts", "noted", "output_charts", "surrogate_charts", "too_large"]


FIRST_SCREEN = '<div class="answers">'
"""First characters of the first screen of a report."""

OPEN = 3
"""Number of initially visible charts; others are folded."""

MOST = 6
"""Maximum number of charts of the motion of a study, which may have many outputs."""

SAMPLES = 2048
"""Number of samples of a surrogate for the bands of its charts, sufficient for the visual resolution."""

LARGE = 50_000
"""Product of the numbers of bodies and output times above which a notebook computes no motion only for display."""


def alive(fragment: str) -> str:
    """Add the scripts of charts to HTML if it contains a chart."""
    from uqmbd.report.drawing import CHARTED
    from uqmbd.report.live import cell_html
    from uqmbd.report.sections import environment

    if CHARTED not in fragment and FIRST_SCREEN not in fragment:
        return fragment
    return cell_html(fragment, environment().get_template("cell.css.j2").render())


def output_charts(result: StudyResult, names: Sequence[str]) -> str:
    """Draw means and bands of some outputs over time for all methods."""
    return _folded([(name, _of_output(result, name)) for name in names])


def _of_output(result: StudyResult, name: str) -> str:
    """Draw an output over time (for a single time its density), and over another output if the study requests it."""
    from uqmbd.report.charts import several, still_html
    from uqmbd.report.drawing import image_html
    from uqmbd.report.sections import bands_chart, bands_of, only_density, over_chart

    found, chart = bands_chart(result, name), bands_of(result, name)
    holders = {label: method.node for label, method in result.holders(name).items()}
    if several(chart):
        html = still_html(chart, found["alt"], found["caption"])
    elif density := only_density(holders, name):
        html = still_html(density[0], density[1], density[1])
    else:
        html = image_html(found)
    along = over_chart(result, name)
    return html + (image_html(along, along.pop("chart", "")) if along else "")


def _folded(charts: Sequence[tuple[str, str]]) -> str:
    return "".join(
        f"<details{' open' * (k < OPEN)}><summary>{escape(name)}</summary>{html}</details>"
        for k, (name, html) in enumerate(charts)
    )


def surrogate_charts(chaos: PolynomialChaos) -> str:
    """Draw means and bands of the outputs of a surrogate over time."""
    return (
        ""
        if chaos.labels.times is None
        else noted("The outputs over time cannot be drawn", lambda: _of_surrogate(chaos))
    )


def _of_surrogate(chaos: PolynomialChaos) -> str:
    from uqmbd.report.sections import most_uncertain
    from uqmbd.report.view import StudyResult
    from uqmbd.results import propagator_node, study_tree

    statistics = chaos.statistics(samples=SAMPLES)
    node = propagator_node("surrogate", statistics, propagator="surrogate", realisations=SAMPLES, wall_time=0.0)
    result = StudyResult.of(study_tree([node], study="", mechanism=""))
    count = int(statistics["quantile"].attrs.get("samples", SAMPLES))
    text = f"<p>Bands are computed from {format_integer(count)} samples of the surrogate.</p>"
    return output_charts(result, most_uncertain(result)) + text


def motion_charts(study: Study) -> str:
    """Draw the outputs of a study over time at the means of its inputs."""
    if len(study.times) < 2 or not study.mechanism.outputs:
        return ""
    if too_large(study):
        return "<p>The study is large, so its motion at the means is not computed here. Use uqmbd.simulate.</p>"
    return noted("The motion at the means of the inputs cannot be drawn", lambda: _nominal(study))


def too_large(study: Study) -> bool:
    """Return whether a study is too large to compute a motion for display only."""
    return len(study.times) * len(study.mechanism.bodies) > LARGE


def _nominal(study: Study) -> str:
    import warnings

    from uqmbd.propagation import simulate
    from uqmbd.report.charts import Curve, chart_html

    with warnings.catch_warnings():
        # a run reports these warnings
        warnings.simplefilter("ignore")
        motion = simulate(
            study.mechanism, study.times, rtol=study.rtol, integrator=study.integrator, start=study.start, check=False,
            max_step=study.max_step if np.isfinite(study.max_step) else None, breaks=study.breaks,
        )  # fmt: skip
    charts = []
    for name in [x for x in study.mechanism.outputs if x in motion and motion[x].dims == ("time",)][:MOST]:
        curve = Curve("at the means of the inputs", motion[name].values)
        alt = f"{name} over time, at the means of the inputs."
        units = str(motion[name].attrs.get("units", ""))
        charts.append((name, chart_html(name, study.times, [curve], alt, "At the means of the inputs.", units=units)))
    return _folded(charts)


def noted(problem: str, make: Callable[[], str]) -> str:
    """Return the HTML that a function makes, or a note with `problem` and the error if the function fails."""
    try:
        return make()
    except Exception as error:  # noqa: BLE001 - to show an object must not fail
        return f"<p>{escape(problem)}: {escape(f'{type(error).__name__}: {error}')}</p>"
