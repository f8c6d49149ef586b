"""Data of the page's charts, by what they show."""

from collections.abc import Callable
from functools import partial
from typing import Any

from uqmbd.report import figures
from uqmbd.report.charts import Chart, Views, page_data, several


def page_of(make: Callable[..., Chart | Views | None], *given: Any, **more: Any) -> dict[str, Any] | None:
    """Return what a page draws of a chart; None if there is nothing that lines could join."""
    shown = make(*given, **more)
    charts = shown.charts if isinstance(shown, Views) else [shown]
    return page_data(shown) if shown is not None and all(map(several, charts)) else None


bands_data = partial(page_of, figures.bands_chart)
decay_data = partial(page_of, figures.decay_chart)
densities_data = partial(page_of, figures.densities_chart)
elements_data = partial(page_of, figures.elements_chart)
error_cost_data = partial(page_of, figures.cost_chart)
errors_data = partial(page_of, figures.errors_chart)
failures_data = partial(page_of, figures.failures_chart)
inputs_data = partial(page_of, figures.inputs_chart)
orders_data = partial(page_of, figures.orders_chart)
over_data = partial(page_of, figures.over_chart)
scalars_data = partial(page_of, figures.scalars_chart)
settling_data = partial(page_of, figures.settling_chart)
violation_data = partial(page_of, figures.worst_violations_chart)
violations_data = partial(page_of, figures.violations_chart)
