"""What mechanisms, studies, results and chaoses show of themselves."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.report.notebook.charts import alive, motion_charts, noted, output_charts, surrogate_charts, too_large
from uqmbd.report.notebook.tables import ROWS, mechanism_tables, options_of, page, picture, table
from uqmbd.wording import format_duration, format_integer, format_number, typeset_units

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.mechanism import Mechanism
    from uqmbd.propagation import Study
    from uqmbd.results import PolynomialChaos

__all__ = ["chaos_html", "mechanism_html", "result_html", "study_html"]


def mechanism_html(mechanism: Mechanism) -> str:
    """Return bodies, components, random inputs and outputs as tables, beside a picture of the assembled pose.

    Parameters
    ----------
    mechanism : Mechanism
        Any, also an empty or unfinished one.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("fall", uqmbd.Translational())
    >>> stone = mechanism.body("stone", mass=2)
    >>> "stone" in mechanism_html(mechanism) and "<svg" not in mechanism_html(mechanism)
    True
    """
    space = f"{type(mechanism.space).__name__.lower()} mechanism"
    return page(f"{mechanism.name} – {space}", mechanism_tables(mechanism), picture(mechanism))


def study_html(study: Study) -> str:
    """Return times, methods and the mechanism of a study.

    Parameters
    ----------
    study : Study
        Any.
    """
    times = study.times
    facts = [
        ("times", f"{len(times)}, from {format_number(times[0])} s to {format_number(times[-1])} s")
        if len(times) > 1
        else ("times", "none"),
        ("relative tolerance", format_number(study.rtol)),
        ("integrator", study.integrator),
        ("start", study.start),
    ]
    methods = [(p.node_name, type(p).__name__, options_of(p)) for p in study.propagators]
    parts = [table("", ("study", ""), facts), table("Methods", ("label", "type", "options"), methods)]
    parts.append(noted("What is probably wrong with it is not known", lambda: _findings(study)))
    inner = f"<details><summary>{escape(study.mechanism.name)}</summary>{mechanism_html(study.mechanism)}</details>"
    return alive(page(f"{study.name} – study", "".join(parts), "") + inner + motion_charts(study))


def _findings(study: Study) -> str:
    """Return what is probably wrong with a study, a paragraph each."""
    import warnings

    from uqmbd.propagation import findings

    if too_large(study):
        return "<p>It is large: what is probably wrong with it is not looked for. uqmbd.findings does.</p>"
    with warnings.catch_warnings():
        # a run gives them
        warnings.simplefilter("ignore")
        return "".join(f"<p>{escape(str(one))}</p>" for one in findings(study))


def chaos_html(chaos: PolynomialChaos) -> str:
    """Return inputs, size, results at the end and how far to trust them.

    Parameters
    ----------
    chaos : PolynomialChaos
        Any.
    """
    labels = chaos.labels
    mean, std = (np.asarray(x).reshape(len(labels.outputs), -1)[:, -1] for x in (chaos.mean, chaos.std))
    rows = [
        (output.name, typeset_units(output.units), format_number(float(mean[k])), format_number(float(std[k])))
        for k, output in enumerate(labels.outputs)
    ]
    when = "" if labels.times is None else f" at t = {format_number(labels.times[-1])} s"
    index = getattr(chaos, "multi_index", None)
    size = ""
    if index is not None:
        size = f"<p>Order {int(index.max(initial=0))}, {len(index)} term{'s' * (len(index) != 1)}.</p>"
    inputs = [(i.name, i.description, typeset_units(i.units)) for i in labels.inputs]
    parts = [
        size,
        table("Inputs", ("name", "distribution", "units"), inputs),
        table(f"Outputs{when}", ("name", "units", "mean", "standard deviation"), rows),
    ]
    if chaos.verification_germs is not None:
        parts += [f"<p>{escape(text)}</p>" for text in getattr(chaos, "verdicts", tuple)()]
    return alive(page("polynomial chaos", "".join(parts), "") + surrogate_charts(chaos))


def result_html(tree: xr.DataTree, outputs: Sequence[str] | None = None) -> str:
    """Return methods, requirements and charts of the outputs over time of the result of a study.

    Parameters
    ----------
    tree : xarray.DataTree
        The result of a study, or the node of one method.
    outputs : sequence of str, optional
        Which are drawn; default: the six most uncertain ones.

    Raises
    ------
    StudyError
        If the tree is no result, or has not all of the outputs.
    """
    from uqmbd.report.sections import most_uncertain
    from uqmbd.report.view import StudyResult
    from uqmbd.results import answers

    result = StudyResult.of(tree)
    if not result.methods:
        raise StudyError("The tree has the result of no method; expected what Study.run returns, or one of its nodes.")
    every = [*result.histories, *result.scalar_names]
    if outputs is not None and (isinstance(outputs, str) or (unknown := [x for x in outputs if x not in every])):
        named = repr(outputs) if isinstance(outputs, str) else ", ".join(map(repr, unknown))
        raise StudyError(f"outputs is or has {named}; expected a list of some of: {', '.join(map(repr, every))}.")
    drawn = most_uncertain(result) if outputs is None else [x for x in outputs if x in result.histories]
    methods = [
        (label, format_integer(m.realisations), format_integer(m.failures), format_duration(m.wall_time))
        for label, m in result.methods.items()
    ]
    required = [(name, one.method, one.words) for name, by in answers(result.nodes).items() for one in by.values()]
    scalars = [
        (name, label, format_number(float(of["mean"])), format_number(float(of["std"])), typeset_units(m.units(name)))
        for label, m in result.scalars.items()
        for name, of in ((name, m.of(name)) for name in m.names if outputs is None or name in outputs)
    ]
    found = result.assessment
    said = [*result.problems, *found.contradictions, *map(str, result.findings), *found.recommendation, *found.reasons]
    lines = [f"{one.sign} {one.word} {one.name}: {one.reason}" for one in found.reliability[:ROWS]]
    rest = len(found.reliability) - len(lines)
    lines += [f"{rest} more, none worse"] if rest else []
    reliability = "".join(f"<li>{escape(line)}</li>" for line in lines)
    parts = [
        *(f"<p>{escape(text)}</p>" for text in said),
        f"<p>How reliable is this result?</p><ul>{reliability}</ul>" if reliability else "",
        table("Methods", ("label", "realisations", "failed", "time"), methods),
        table("Requirements", ("requirement", "method", "violated with a probability of"), required),
        table("Outputs without a time", ("name", "method", "mean", "standard deviation", "units"), scalars),
    ]
    left = len(result.histories) - len(drawn)
    more = f"<p>Of {len(result.histories)} outputs over time, {len(drawn)} are drawn.</p>" if left else ""
    return alive(page(f"{result.study} – results", "".join(parts), "") + output_charts(result, drawn) + more)
