"""Charts and drawings inside the report, figures of plugins in it, and figures as files."""

from __future__ import annotations

import base64
import gc
import html
import io
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uqmbd.arguments import typechecked
from uqmbd.files import no_link
from uqmbd.report.drawing.ticks import freeze_ticks
from uqmbd.report.drawing.vectors import UNWRITABLE, Drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["CHARTED", "drawn_source", "figure_html", "image_html", "still_image", "svg", "write_images"]

CHARTED = '<figure class="charted"'
"""How the figure of a chart begins; scripts of the page look for it."""

UNSEEN = "(This chart needs scripts; its numbers are in the tables.) "
"""What stands where no script draws a chart that has no picture."""

_FONTS = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', 'Noto Sans', 'DejaVu Sans', sans-serif"

_PLACES = re.compile(r' (?:d|x|y|points)="[^"]*"')
_BETWEEN = re.compile(r">\s+<")
_CURVED = re.compile("[A-KN-Y]")
_DIGITS = re.compile(r"(?<=\.\d\d)\d+")


LONGEST = 100
"""Characters of the name of a file: systems allow some 250 bytes."""


def _rounded(found: re.Match[str]) -> str:
    """Leave two decimals of places on the page, which are points: the eye sees a tenth, and files shrink by a third.

    What follows the start of a path is a line to there, unless it says otherwise: lines need no letter.
    """
    text = " ".join(_DIGITS.sub("", found.group()).split())
    return " " + (text if _CURVED.search(text) else text.replace(" L ", " "))


def drawn_source(draw: Callable[[], Figure]) -> str:
    """Return a figure as a data URI."""
    # A figure is thousands of objects in cycles: looking for garbage once after each, not all the while, saves a sixth.
    collecting = gc.isenabled()
    gc.disable()
    try:
        return svg(draw())
    finally:
        if collecting:
            gc.enable()


def still_image(
    make: Callable[[], Drawing], alt: str, caption: str, name: str, draw: Callable[[], Figure]
) -> dict[str, Any]:
    """Return a drawing that stands in the page; one that cannot be drawn is a note in its place.

    `make`: makes the drawing; `alt`, `caption`: what stands for it, and beneath it; `name`: of the file, if it is
    written to one; `draw`: makes the figure that is written to a file, if that is asked for.
    """
    found = {"drawing": "", "alt": alt, "caption": caption, "problem": "", "name": name}
    try:
        return found | {"drawing": make().inline(alt), "draw": draw}
    except Exception as error:  # noqa: BLE001 - results of other packages may hold surprises; the tables must stand
        return found | {"problem": f"{type(error).__name__}: {error}"}


@typechecked
def figure_html(draw: Callable[[], Figure], alt: str, caption: str) -> str:
    """Return a figure for a section of the report, as HTML; one that cannot be drawn is a note in its place.

    Parameters
    ----------
    draw : callable
        Makes the figure, of Matplotlib.
    alt, caption : str
        What stands for it, and beneath it: plain text.

    Returns
    -------
    str
        A fragment of HTML, with the figure as an SVG in it.

    Examples
    --------
    >>> from uqmbd.report import arrange, axes_grid
    >>> def draw():
    ...     figure, grid = axes_grid(1, 2.0)
    ...     _ = grid[0].plot([0, 1], [0, 1])
    ...     arrange(figure, grid)
    ...     return figure
    >>> figure_html(draw, "A line.", "It rises.").endswith('alt="A line."><figcaption>It rises.</figcaption></figure>')
    True
    """
    found = {"source": "", "alt": alt, "caption": caption, "problem": ""}
    try:
        found["source"] = drawn_source(draw)
    except Exception as error:  # noqa: BLE001 - results of other packages may hold surprises; the tables must stand
        found["problem"] = f"{type(error).__name__}: {error}"
    return image_html(found)


def image_html(found: Mapping[str, Any], chart: str = "") -> str:
    """Return a picture, or a chart, as HTML; ``chart``: JSON, safe in HTML, of the chart in its place."""
    text = {key: html.escape(found[key]) for key in ("source", "alt", "caption", "problem")}
    if found.get("note"):
        return f'<p class="note">{html.escape(found["note"])}</p>'
    if found["problem"]:
        told = f"This figure could not be drawn ({text['caption']}) {text['problem']}"
        return f'<p class="problem">{told}</p>'
    data = f'<script type="application/json">{chart}</script>' if chart else ""
    begin, picture = f"{CHARTED}>" if chart else "<figure>", f'<img src="{text["source"]}" alt="{text["alt"]}">'
    if chart and not found["source"]:
        begin, picture = f'{CHARTED} data-alt="{text["alt"]}">', f"<noscript>{UNSEEN}</noscript>"
    return f"{begin}{picture}<figcaption>{text['caption']}</figcaption>{data}</figure>"


def write_images(content: object, folder: Path) -> list[Path]:
    """Write all figures and films that have a name, anywhere in nested lists and dictionaries, to files.

    One that cannot be drawn is a warning; the others are written.

    `content`: what `charted` or `still_image` returned, within any lists and dictionaries; `folder`: made if it does
    not exist.  Files of the same names are replaced, others left. Return in the order of the content.
    """
    written: dict[Path, None] = {}
    for name, make in _named(content):
        try:
            source = make()
        except Exception as error:  # noqa: BLE001 - whatever a figure of other packages' results raises; others are written
            told = f"figure {name!r} is not written to {str(folder)!r}: {type(error).__name__}: {error}"
            warnings.warn(told, UserWarning, stacklevel=3)
            continue
        kind, data = source.removeprefix("data:image/").split(";base64,", 1)
        plain = re.sub(r"[^\w.+-]+", "-", name, flags=re.ASCII).strip("-.")
        # a long one keeps its end, which tells the figures of an output apart
        plain = plain if len(plain) <= LONGEST else f"{plain[: LONGEST // 2]}-{plain[-LONGEST // 2 :]}"
        number, target = 1, folder / f"{plain or 'figure'}.{kind.removesuffix('+xml')}"
        while target in written:  # names that differ in other signs only
            number += 1
            target = folder / f"{plain}-{number}.{kind.removesuffix('+xml')}"
        folder.mkdir(parents=True, exist_ok=True)
        with open(target, "wb", opener=no_link) as file:
            file.write(base64.b64decode(data))
        written[target] = None
    return list(written)


def _named(content: object) -> Iterator[tuple[str, Callable[[], str]]]:
    """Yield the name of each figure and film, and what makes it as a data URI: only who asks for files waits for it."""
    if isinstance(content, Mapping):
        name = str(content.get("name") or "")
        if name and content.get("draw"):
            yield name, partial(drawn_source, content["draw"])
        if name and content.get("moving"):
            yield name, content["moving"]
        for value in content.values():
            yield from _named(value)
    elif isinstance(content, (list, tuple)):
        for value in content:
            yield from _named(value)


def svg(figure: Figure) -> str:
    """Return a figure as the data URI of an SVG; its ticks can no longer change."""
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    buffer = io.StringIO()
    # An image of its own (not inline markup), so that identifiers of many figures never clash, with text as text, which
    # is small, quickly written, and in the font of the page. The fixed salt makes equal results equal files.
    with warnings.catch_warnings(), matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "uqmbd"}):
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        freeze_ticks(figure)
        # `savefig` would draw twice: once more for a layout, which is at rest
        canvas: Any = FigureCanvasSVG(figure)
        canvas.print_svg(buffer, metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    drawn = re.sub(r"'DejaVu Sans'[^;\"]*sans-serif", _FONTS, buffer.getvalue())
    # texts of other packages' results may hold what no XML may
    drawn = UNWRITABLE.sub("\N{REPLACEMENT CHARACTER}", _PLACES.sub(_rounded, drawn))
    drawn = _BETWEEN.sub("><", drawn)
    return "data:image/svg+xml;base64," + base64.b64encode(drawn.encode("utf-8", "replace")).decode("ascii")
