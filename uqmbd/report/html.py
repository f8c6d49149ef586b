"""Write the report: one self-contained HTML file that works offline, in print and on phones."""

from __future__ import annotations

import os
import re
import sys
import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.errors import PluginWarning, StudyError, StudyWarning
from uqmbd.files import replacing, scratch
from uqmbd.isolation import Isolated
from uqmbd.report.charts import json_script, share_arrays
from uqmbd.report.drawing import CHARTED, write_images
from uqmbd.report.live import page_scripts
from uqmbd.report.overview import ANSWERS, contributed
from uqmbd.report.sections import (
    ABOUT_METHODS,
    ABOUT_RESULTS,
    Content,
    FirstScreen,
    Section,
    TemplateSection,
    environment,
)
from uqmbd.report.view import StudyResult
from uqmbd.results.storage import FIGURES, errors_of_files, has_manifest, move_unlisted, record

__all__ = ["Section", "first_screen", "write_report"]


REPORT = "report.html"
"""Name of a report in the folder of a run."""

_PERCENT = re.compile(r"(\d) %")


@typechecked
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
        Result of a study.
    path : path-like
        Path of the HTML file; missing folders are created. Only a complete report replaces an earlier report. In the
        folder of a run, ``report.html`` replaces only a file that uqmbd wrote. A report of another origin is moved to a
        folder ``previous-N`` there, and any other file of this name is an error.
    sections : sequence of Section
        Sections of plugins, which follow the outputs. A section that raises an error, or does not return a text,
        becomes a note with its name and the reason, and a `uqmbd.extend.PluginWarning`. A section with an empty text is
        omitted.
    folder : path-like, optional
        Folder for a file of every figure of the sections of the core (SVG, the animation as GIF). The name of a file
        consists of the names of output and figure. A figure that cannot be drawn gives a warning. Default: no files.

    Returns
    -------
    pathlib.Path
        Path of the report.

    Raises
    ------
    StudyError
        If the tree contains no propagator, or was read from a file whose content violates the schema. This error also
        occurs if the report cannot be written, or would replace a file of the user in the folder of a run.

    Examples
    --------
    >>> import tempfile
    >>> from uqmbd.results import propagator_node, study_tree
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels([("x", "m")], [], [0.0, 1.0])
    >>> node = propagator_node("mine", statistics_dataset(axes, mean=[[0.0, 1.0]], std=[[0.0, 0.1]]),
    ...                        propagator="p", realisations=1, wall_time=0.0)
    >>> tree = study_tree([node], study="crank", mechanism="crank")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     "<title>crank" in write_report(tree, folder + "/report.html").read_text(encoding="utf-8")
    True
    """
    with errors_of_files(tree):
        page, contents = _page(tree, sections)
    target, figures = Path(path), None if folder is None else Path(folder)
    try:
        if target.name == REPORT and has_manifest(target.parent):
            try:
                return _into_run(page, contents, target, figures)
            except OSError as error:
                where = error.filename or target.parent
                raise StudyError(f"{where} cannot be written: {error.strerror or error}.") from error
        target = _write(page, target)
        if figures is not None:
            write_images(contents, figures)
    except OSError as error:
        raise StudyError(
            f"Figures cannot be written to {str(folder)!r}: {error.strerror or error}; the report is {target}."
        ) from error
    return target


def _page(tree: xr.DataTree, sections: Sequence[Section]) -> tuple[str, dict[str, Content]]:
    """Return the HTML of the page, and the contents of its sections."""
    result = StudyResult.of(tree)
    if not result.methods:
        raise StudyError("A report needs the result of at least one propagator; the tree contains none.")
    contents: dict[str, Content] = {}
    of_plugins = [_of_plugin(section, tree, f"section-{k}") for k, section in enumerate(sections, 1)]
    shown = [
        *_built_in(ABOUT_RESULTS, result, contents),
        *(one for one in of_plugins if one["html"] or one["problem"]),
        *_built_in(ABOUT_METHODS, result, contents),
    ]
    screens = [first_screen(section, tree) for section in sections]
    (first,) = _built_in((ANSWERS,), result, contents, contributions=[one for one in screens if one])
    created = str(tree.attrs.get("created", ""))
    page = environment().get_template("report.html.j2")
    text = page.render(
        study=result.study,
        mechanism=result.mechanism,
        created=created,
        date=created.replace("T", " ").replace("+00:00", " UTC"),
        first=first,
        sections=shown,
        outputs=[output["name"] for output in contents.get("outputs", {}).get("outputs", ())],
        surfaces=bool((contents.get("answers", {}).get("mechanism") or {}).get("surfaces")),
        scripts=page_scripts() if _charted(contents) or any(CHARTED in one["html"] for one in of_plugins) else None,
    )
    return _with_shared(text), contents


def _with_shared(page: str) -> str:
    """Return a page in which each array of its charts occurs only once."""
    before, end, after = page.rpartition("</main>")
    before, arrays = share_arrays(before)
    data = f'\n<script type="application/json" id="shared-arrays">{json_script(arrays)}</script>' if arrays else ""
    return f"{before}{end}{data}{after}"


def _into_run(page: str, contents: dict[str, Content], target: Path, figures: Path | None) -> Path:
    """Write a report and its figures to the folder of a run, and replace only files of uqmbd."""
    run = target.parent
    inside = figures is not None and figures.resolve() == (run / FIGURES).resolve()
    previous = move_unlisted(run, [REPORT, *([FIGURES] if inside else [])])
    if previous is not None:
        warnings.warn(f"the earlier report in {run} was moved to {previous}", StudyWarning, stacklevel=3)
    with scratch(run) as place:
        new = place / "new" / FIGURES if inside else figures
        if new is not None:
            new.parent.mkdir(parents=True, exist_ok=True)
            write_images(contents, new)
        written = sorted(new.iterdir()) if inside and new is not None and new.is_dir() else []
        _write(page, target)
        record(run, [REPORT, *(f"{FIGURES}/{one.name}" for one in written)], [target, *written])
        if inside and new is not None and written:
            with replacing(run / FIGURES) as part:
                new.rename(part)
    return target


def _charted(content: object) -> bool:
    """Return whether nested lists and dictionaries contain the data of a chart, a player or sliders."""
    if isinstance(content, Mapping):
        return not {"chart", "player", "explorer"}.isdisjoint(content) or any(map(_charted, content.values()))
    return isinstance(content, (list, tuple)) and any(_charted(value) for value in content)


def _built_in(
    sections: Sequence[TemplateSection], result: StudyResult, contents: dict[str, Content], **more: Any
) -> Iterator[dict[str, str]]:
    """Make the sections of the core, with their contents by name; `more` contains further content."""
    from markupsafe import Markup

    for section in sections:
        content = section.content(result)
        if content is not None:
            content |= more
            contents[section.name] = content
            html = Markup(section.fragment(result, content))
            yield {"title": section.title, "anchor": section.name, "html": html, "problem": ""}


def _of_plugin(section: Section, tree: xr.DataTree, anchor: str) -> dict[str, str]:
    """Make a section of a plugin; a failure gives a warning that names it, and does not affect other sections."""
    from markupsafe import Markup

    kind = type(section)
    title, fragment, problem = kind.__name__, "", ""
    with Isolated() as work:
        given: Any = section.title
        if not isinstance(given, str):
            raise TypeError(f"title is a {type(given).__name__}; expected a text")
        title = str(given)
    problem = work.reason
    # the plugin receives a copy, which it may change
    with Isolated() as work, _own_settings():
        made: Any = section.render(tree.copy())
        if not isinstance(made, str):
            raise TypeError(f"render() returned a {type(made).__name__}; expected a text of HTML")
        fragment = str(made)
    problem = problem or work.reason
    if problem:
        where = f"{kind.__module__}.{kind.__qualname__}"
        warnings.warn(f"report section {title!r} ({where}) is omitted: {problem}", PluginWarning, stacklevel=4)
        return {"title": title, "anchor": anchor, "html": "", "problem": f"{problem} ({where})"}
    return {"title": title, "anchor": anchor, "html": Markup(fragment), "problem": ""}


def first_screen(section: Section, tree: xr.DataTree) -> Content | None:
    """Return the part of a section on the first screen, or None; a failure gives a warning and a note."""
    make = getattr(section, "first_screen", None)
    if make is None:
        return None
    with Isolated() as work, _own_settings():
        made: Any = make(tree.copy())
        if made is not None and not isinstance(made, FirstScreen):
            raise TypeError(f"first_screen() returned a {type(made).__name__}; expected a FirstScreen or None")
        return None if made is None else contributed(made)
    where = f"{type(section).__module__}.{type(section).__qualname__}"
    warnings.warn(f"the first screen of {where} is omitted: {work.reason}", PluginWarning, stacklevel=4)
    return {"problem": f"{work.reason} ({where})"}


@contextmanager
def _own_settings() -> Iterator[None]:
    """Restore the Matplotlib settings after a section; do not load Matplotlib for sections that do not use it."""
    earlier = sys.modules.get("matplotlib")
    try:
        with nullcontext() if earlier is None else earlier.rc_context():
            yield
    finally:
        if earlier is None and (loaded := sys.modules.get("matplotlib")):
            loaded.rc_file_defaults()


def _write(page: str, target: Path) -> Path:
    page = _PERCENT.sub("\\1\N{NO-BREAK SPACE}%", page)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}.") as scratch:
            written = Path(scratch) / "report.html"
            # names may contain lone surrogates (from file names), which must not prevent the report
            written.write_text(page, encoding="utf-8", errors="replace")
            os.replace(written, target)
    except OSError as error:
        raise StudyError(f"The report cannot be written to {str(target)!r}: {error.strerror or error}.") from error
    return target
