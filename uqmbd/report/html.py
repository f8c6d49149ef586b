"""One self-contained HTML file with everything a study found: it opens offline, prints, and reads on a phone."""

from __future__ import annotations

import functools
import os
import re
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import xarray as xr

from uqmbd.errors import PluginWarning, StudyError
from uqmbd.isolation import Isolated
from uqmbd.report import figures
from uqmbd.report.drawing import image, write_images
from uqmbd.report.figures import ENOUGH, scalars
from uqmbd.report.sections import (
    agreement,
    comparison,
    cost,
    error_against_cost,
    events,
    failures,
    heading,
    influence,
    input_rows,
    moving_picture,
    outputs,
    problems,
    provenance,
    statistics,
    study_attributes,
    summary,
    trust,
)
from uqmbd.results import propagator_nodes, scalar_nodes
from uqmbd.results.statistics import rtol_of

__all__ = ["Section", "write_report"]


_PERCENT = re.compile(r"(\d) %")


class Section(Protocol):
    """A section that a plugin adds to the report."""

    @property
    def title(self) -> str:
        """Heading of the section, plain text."""

    def render(self, tree: xr.DataTree) -> str:
        """Return an HTML fragment; what it quotes from the data it must escape itself."""


def write_report(
    tree: xr.DataTree,
    path: str | os.PathLike[str],
    *,
    sections: Sequence[Section] = (),
    folder: str | os.PathLike[str] | None = None,
) -> Path:
    """Write the report of a study.

    Parameters
    ----------
    tree : xarray.DataTree
        The result of a study.
    path : path-like
        Of the HTML file; folders on the way are made. An earlier report is replaced only by a complete one.
    sections : sequence of Section
        Sections of plugins, shown after the outputs. One that raises, or returns no text, becomes a note with its name
        and the reason, and a `uqmbd.PluginWarning`.
    folder : path-like, optional
        Where every figure of the report is written as a file, too (SVG, the animation as GIF), under its output's
        name and its own. Default: nowhere.

    Returns
    -------
    pathlib.Path
        The path.

    Raises
    ------
    StudyError
        If the tree holds no propagator, or the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from uqmbd.results import labels, propagator_node, statistics_dataset, study_tree
    >>> axes = labels([("x", "m")], [], [0.0, 1.0])
    >>> node = propagator_node("mine", statistics_dataset(axes, mean=[[0.0, 1.0]], std=[[0.0, 0.1]]),
    ...                        propagator="p", realisations=1, wall_time=0.0)
    >>> tree = study_tree([node], study="crank", mechanism="crank")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     "<title>crank" in write_report(tree, folder + "/report.html").read_text(encoding="utf-8")
    True
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    nodes = propagator_nodes(tree)
    if not nodes:
        raise StudyError("A report needs the result of at least one propagator; there is none.")
    nodes = _until_known(nodes)
    environment = Environment(
        loader=PackageLoader(__package__),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    shown: dict[str, Any] = dict(
        heading=heading(tree),
        problems=problems(tree),
        summary=summary(tree, nodes),
        statistics=statistics(tree, nodes),
        inputs=input_rows(nodes),
        motion=moving_picture(tree),
        inputs_figure=_inputs_figure(nodes) or _inputs_figure(scalar_nodes(nodes)),
        scalars=scalars(nodes),
        over_time=outputs(tree, nodes),
        events=events(nodes),
        influence=influence(nodes),
        trust=trust(nodes, tree),
        sections=[_section(section, tree) for section in sections],
        failures=[_failures(label, node) for label, node in nodes.items()],
        costs=[cost(label, node) for label, node in nodes.items()],
        comparison=comparison(tree),
        agreement=agreement(tree),
        growth=error_against_cost(tree, nodes),
        provenance=[provenance(label, node) for label, node in nodes.items()],
        study_attributes=study_attributes(tree),
        command=tree.attrs.get("command"),
        several=len(nodes) > 1,
    )
    target = _write(environment.get_template("report.html.j2").render(shown), Path(path))
    if folder is not None:
        try:
            write_images(shown, Path(folder))
        except OSError as error:
            raise StudyError(
                f"Figures cannot be written to {str(folder)!r}: {error.strerror or error}; the report is {target}."
            ) from error
    return target


def _until_known(nodes: Mapping[str, xr.DataTree]) -> dict[str, xr.DataTree]:
    """Leave out times at which no method has a result: where all end early."""
    ends = [node.attrs.get("ends_at") for node in nodes.values()]
    if any(end is None for end in ends):
        return dict(nodes)
    last = max(float(end) for end in ends if end is not None)

    def cut(data: xr.Dataset) -> xr.Dataset:
        return data.sel(time=slice(None, last)) if "time" in data.dims else data

    found = {label: node.map_over_datasets(cut) for label, node in nodes.items()}
    for label, node in found.items():
        node.attrs.setdefault("rtol", rtol_of(nodes[label]))
    return found


def _failures(label: str, node: xr.DataTree) -> dict[str, Any]:
    found = failures(label, node)
    for number, row in enumerate(found["reasons"], 1):
        group = row.pop("group")
        row["figure"] = (
            image(
                functools.partial(figures.failure_inputs, node, group),
                f"Inputs of the failed samples among those of the others. {' '.join(row['words'])}",
                "Each point is a sample: pale ones succeeded, dark ones failed for this reason.",
                f"failures-{label}-{number}",
            )
            if found["names"] and len(group.samples) >= ENOUGH
            else None
        )
    return found


def _inputs_figure(nodes: Mapping[str, xr.DataTree]) -> dict[str, str] | None:
    holders = (node for node in nodes.values() if "samples" in node.children)
    sampled = next((node for node in holders if node.children["samples"].sizes.get("input", 0)), None)
    if sampled is None:
        return None
    caption = f"The inputs as {sampled.attrs['label']} sampled them."
    return image(lambda: figures.inputs(sampled), "Histograms of the sampled inputs.", caption, "inputs")


def _section(section: Section, tree: xr.DataTree) -> dict[str, str]:
    """Make a section of a plugin; whatever goes wrong in it is told by its name, and costs nothing else."""
    from markupsafe import Markup
    from matplotlib import rc_context

    kind = type(section)
    title, fragment, problem = kind.__name__, "", ""
    with Isolated() as work:
        given: Any = section.title
        if not isinstance(given, str):
            raise TypeError(f"title is a {type(given).__name__}; a text is expected")
        title = str(given)
    problem = work.reason
    # it may do to its copy what it likes
    with Isolated() as work, rc_context():
        made: Any = section.render(tree.copy())
        if not isinstance(made, str):
            raise TypeError(f"render() returned a {type(made).__name__}; a text of HTML is expected")
        fragment = str(made)
    problem = problem or work.reason
    if problem:
        where = f"{kind.__module__}.{kind.__qualname__}"
        warnings.warn(f"report section {title!r} ({where}) is left out: {problem}", PluginWarning, stacklevel=3)
        return {"title": title, "html": "", "problem": f"{problem} ({where})"}
    return {"title": title, "html": Markup(fragment), "problem": ""}


def _write(page: str, target: Path) -> Path:
    page = _PERCENT.sub("\\1\N{NO-BREAK SPACE}%", page)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}.") as scratch:
            written = Path(scratch) / "report.html"
            # Names may hold lone surrogates (from file names); they must not cost the report.
            written.write_text(page, encoding="utf-8", errors="replace")
            os.replace(written, target)
    except OSError as error:
        raise StudyError(f"The report cannot be written to {str(target)!r}: {error.strerror or error}.") from error
    return target
