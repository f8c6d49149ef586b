"""One self-contained HTML file with everything a study found: it opens offline, prints, and reads on a phone."""

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

__all__ = ["Section", "write_report"]


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
        The result of a study.
    path : path-like
        Of the HTML file; folders on the way are made. An earlier report is replaced only by a complete one. In the
        folder of a run the name ``report.html`` is taken by what uqmbd wrote alone: a report of another origin is moved
        to a folder ``previous-N`` there, and anything else is an error.
    sections : sequence of Section
        Sections of plugins, shown after the outputs. One that raises, or returns no text, becomes a note with its name
        and the reason, and a `uqmbd.extend.PluginWarning`. One that returns an empty text is left out.
    folder : path-like, optional
        Folder for a file of every figure of the core's sections (SVG, the animation as GIF). The name of a file
        consists of the names of output and figure; one that cannot be drawn is a warning. Default: nowhere.

    Returns
    -------
    pathlib.Path
        The path.

    Raises
    ------
    StudyError
        If the tree holds no propagator, the file cannot be written, or something of the user has its name in the folder
        of a run; if the tree was read from a file whose content does not keep to the schema.

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
    """Return the page, and what its sections show."""
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
    screens = [_first_screen(section, tree) for section in sections]
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
        scripts=page_scripts() if _charted(contents) or any(CHARTED in one["html"] for one in of_plugins) else None,
    )
    return text, contents


def _into_run(page: str, contents: dict[str, Content], target: Path, figures: Path | None) -> Path:
    """Write a report, and figures beside it, to the folder of a run: only what uqmbd wrote there is replaced."""
    run = target.parent
    beside = figures is not None and figures.resolve() == (run / FIGURES).resolve()
    previous = move_unlisted(run, [REPORT, *([FIGURES] if beside else [])])
    if previous is not None:
        warnings.warn(f"the earlier report in {run} was moved to {previous}", StudyWarning, stacklevel=3)
    with scratch(run) as place:
        new = place / "new" / FIGURES if beside else figures
        if new is not None:
            new.parent.mkdir(parents=True, exist_ok=True)
            write_images(contents, new)
        written = sorted(new.iterdir()) if beside and new is not None and new.is_dir() else []
        _write(page, target)
        record(run, [REPORT, *(f"{FIGURES}/{one.name}" for one in written)], [target, *written])
        if beside and new is not None and written:
            with replacing(run / FIGURES) as part:
                new.rename(part)
    return target


def _charted(content: object) -> bool:
    """Return whether anything in nested lists and dictionaries is the data of a chart, a player or sliders."""
    if isinstance(content, Mapping):
        return not {"chart", "player", "explorer"}.isdisjoint(content) or any(map(_charted, content.values()))
    return isinstance(content, (list, tuple)) and any(_charted(value) for value in content)


def _built_in(
    sections: Sequence[TemplateSection], result: StudyResult, contents: dict[str, Content], **more: Any
) -> Iterator[dict[str, str]]:
    """Make sections of the core, and keep what each shows under its name; `more`: further content."""
    from markupsafe import Markup

    for section in sections:
        content = section.content(result)
        if content is not None:
            content |= more
            contents[section.name] = content
            html = Markup(section.fragment(result, content))
            yield {"title": section.title, "anchor": section.name, "html": html, "problem": ""}


def _of_plugin(section: Section, tree: xr.DataTree, anchor: str) -> dict[str, str]:
    """Make a section of a plugin; if it fails, a warning names it, and the other sections are unaffected."""
    from markupsafe import Markup

    kind = type(section)
    title, fragment, problem = kind.__name__, "", ""
    with Isolated() as work:
        given: Any = section.title
        if not isinstance(given, str):
            raise TypeError(f"title is a {type(given).__name__}; expected a text")
        title = str(given)
    problem = work.reason
    # it may do to its copy what it likes
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


def _first_screen(section: Section, tree: xr.DataTree) -> Content | None:
    """Return what a section adds to the first screen; None if nothing; a failure is a warning and a note."""
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
    """Undo what a section changes of the settings of Matplotlib, which is not loaded for sections that do without."""
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
            # Names may hold lone surrogates (from file names); they must not cost the report.
            written.write_text(page, encoding="utf-8", errors="replace")
            os.replace(written, target)
    except OSError as error:
        raise StudyError(f"The report cannot be written to {str(target)!r}: {error.strerror or error}.") from error
    return target
