"""One self-contained HTML file with everything a study found: it opens offline, prints, and reads on a phone."""

from __future__ import annotations

import functools
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.report import content, figures, record
from uqmbd.report.convergence import design_of
from uqmbd.report.failures import ENOUGH
from uqmbd.report.images import image
from uqmbd.report.motion_section import moving_picture
from uqmbd.report.scalars import scalars
from uqmbd.report.surrogates import chaos_nodes, shown_methods
from uqmbd.report.trust import influence, trust
from uqmbd.report.verdicts import agreement
from uqmbd.results import choose_reference, propagator_nodes, scalar_nodes

__all__ = ["Section", "write_report"]


class Section(Protocol):
    """A section that a plugin adds to the report."""

    @property
    def title(self) -> str:
        """Heading of the section, plain text."""

    def render(self, tree: xr.DataTree) -> str:
        """Return an HTML fragment; what it quotes from the data it must escape itself."""


def write_report(tree: xr.DataTree, path: str | os.PathLike[str], *, sections: Sequence[Section] = ()) -> Path:
    """Write the report of a study.

    Parameters
    ----------
    tree : xarray.DataTree
        The result of a study.
    path : path-like
        Of the HTML file; folders on the way are made. An earlier report is replaced only by a complete one.
    sections : sequence of Section
        Sections of plugins, shown after the outputs. One that raises becomes a note with its name and the reason.

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
        loader=PackageLoader("uqmbd.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page = environment.get_template("report.html.j2").render(
        heading=content.heading(tree),
        summary=content.summary(tree, nodes),
        statistics=content.output_rows(nodes),
        inputs=content.input_rows(nodes),
        motion=moving_picture(tree),
        inputs_figure=_inputs_figure(nodes) or _inputs_figure(scalar_nodes(nodes)),
        scalars=scalars(nodes),
        outputs=[_output(tree, nodes, name) for name in content.output_names(nodes)],
        influence=influence(nodes),
        trust=trust(nodes),
        sections=[_section(section, tree) for section in sections],
        failures=[_failures(label, node) for label, node in nodes.items()],
        costs=[record.cost(label, node) for label, node in nodes.items()],
        comparison=content.comparison(tree),
        agreement=agreement(tree),
        provenance=[record.provenance(label, node) for label, node in nodes.items()],
        study_attributes=record.study_attributes(tree),
        command=tree.attrs.get("command"),
        several=len(nodes) > 1,
    )
    return _write(page, Path(path))


DENSITIES = 6
"""Most methods whose densities are drawn in one figure."""


def _until_known(nodes: Mapping[str, xr.DataTree]) -> dict[str, xr.DataTree]:
    """Leave out times at which no method has a result: where all end early."""
    ends = [node.attrs.get("ends_at") for node in nodes.values()]
    if any(end is None for end in ends):
        return dict(nodes)
    last = max(float(end) for end in ends if end is not None)

    def cut(data: xr.Dataset) -> xr.Dataset:
        return data.sel(time=slice(None, last)) if "time" in data.dims else data

    return {label: node.map_over_datasets(cut) for label, node in nodes.items()}


def _output(tree: xr.DataTree, nodes: Mapping[str, xr.DataTree], name: str) -> dict[str, Any]:
    every = {label: node for label, node in nodes.items() if content.has_output(node, name)}
    holders = shown_methods(every)
    lower = " Of a surrogate with several orders, only the highest is drawn." if len(holders) < len(every) else ""
    first = next(iter(holders.values()))
    varying = any(content.varies(node, name) for node in holders.values())
    drawn = [
        image(
            lambda: figures.bands(holders, name),
            f"Mean of {name} over time, with the bands that hold 50 % and 95 % of the realisations. "
            + content.in_words(first, name),
            "How it moves: the mean, and the bands in which 50 % and 95 % of the realisations lie." + lower,
        )
    ]
    if not varying:
        return {
            "name": name,
            "figures": drawn,
            "note": "The inputs have no influence on this output.",
            "words": "",
            "numbers": [],
        }
    sampled = {label: node for label, node in holders.items() if content.has_histograms(node)}
    deviation = image(
        lambda: figures.std_over_time(holders, name),
        f"Standard deviation of {name} over time. " + content.in_words(first, name),
        "When it is uncertain: the standard deviation over time; the shaded band is plus and minus two standard "
        "errors, where they are known.",
    )
    if sampled:
        label, node = next(iter(sampled.items()))
        from_surrogates = " (of a surrogate, from samples of it)" if chaos_nodes(every) else ""
        dense = dict(list((sampled | chaos_nodes(every)).items())[:DENSITIES])
        from_label = f" (samples of {label})" if len(nodes) > 1 else ""
        drawn += [
            image(
                lambda: figures.time_history_histogram(node, name),
                f"Time-history histogram of {name}: how many samples have which value at which time.",
                f"Where the samples are: the darker, the more of them have this value at this time{from_label}. "
                "White: none.",
            ),
            image(
                lambda: figures.histograms(dense, name, content.report_times(tree)),
                f"Probability densities of {name} at chosen times.",
                "How it is distributed at chosen times: bars are the histogram, curves a smooth estimate of the "
                f"density{from_surrogates}; the area under each is 1.",
            ),
            image(
                lambda: figures.convergence(node, name),
                f"Mean and standard deviation of {name} as samples are added. " + content.precision(node, name),
                _convergence_caption(node) + from_label + ".",
            ),
        ]
    compared = []
    if len(holders) > 1 and chaos_nodes(holders):
        reference = choose_reference(holders)
        compared.append(
            image(
                lambda: figures.differences(holders, name, reference=reference),
                f"Difference of the mean and the standard deviation of {name} between methods, over time.",
                f"How far the methods agree: the mean and the standard deviation of each, less those of {reference}. "
                "A shaded band is plus and minus two standard errors of these, where they are known.",
            )
        )
    words = [content.in_words(first, name), *(content.precision(node, name) for node in list(sampled.values())[:1])]
    return {
        "name": name,
        "figures": [*drawn, deviation, *compared],
        "note": "",
        "words": " ".join(filter(None, words)),
        "numbers": content.numbers(first, name),
    }


def _convergence_caption(node: xr.DataTree) -> str:
    design = design_of(node.attrs)
    if design.independent:
        return (
            "Whether there are enough samples: the estimates from the first samples only, and the band that holds the "
            "true value with 95 % confidence, at the time of the largest standard deviation"
        )
    return (
        f"Whether there are enough samples: the points of a {design.name} design count as a whole only, so the "
        "estimates are shown against the number of its independent replicates, with the band that holds the true value "
        "with 95 % confidence, at the time of the largest standard deviation"
    )


def _failures(label: str, node: xr.DataTree) -> dict[str, Any]:
    found = content.failures(label, node)
    for row in found["reasons"]:
        group = row.pop("group")
        row["figure"] = (
            image(
                functools.partial(figures.failure_inputs, node, group),
                f"Inputs of the failed samples among those of the others. {' '.join(row['words'])}",
                "Each point is a sample: pale ones succeeded, dark ones failed for this reason.",
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
    return image(lambda: figures.inputs(sampled), "Histograms of the sampled inputs.", caption)


def _section(section: Section, tree: xr.DataTree) -> dict[str, str]:
    from markupsafe import Markup

    title = str(getattr(section, "title", type(section).__name__))
    try:
        fragment = section.render(tree)
        if not isinstance(fragment, str):
            raise TypeError(f"render() returned a {type(fragment).__name__}; a text of HTML is expected")
    except Exception as error:  # noqa: BLE001 - a plugin may raise anything; the rest of the report must stand
        return {"title": title, "html": "", "problem": f"{type(error).__name__}: {error}"}
    return {"title": title, "html": Markup(fragment), "problem": ""}


def _write(page: str, target: Path) -> Path:
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
