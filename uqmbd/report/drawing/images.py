"""Charts and drawings in the report, figures of plugins, and figures as files."""

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
"""First characters of the figure of a chart; scripts of the page search for this text."""

NEEDS_SCRIPTS = "(This chart needs scripts; its numbers are in the tables.) "
"""Text in place of a chart without a picture, if scripts do not run."""

_FONTS = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', 'Noto Sans', 'DejaVu Sans', sans-serif"

_PLACES = re.compile(r' (?:d|x|y|points)="[^"]*"')
_BETWEEN = re.compile(r">\s+<")
_CURVED = re.compile("[A-KN-Y]")
_ALIKE = re.compile(r'(<g[^>]*)>((?:<use [^>]*?( style="[^"]*")/>)(?:<use [^>]*?\3/>)+)</g>')
_NAMED = re.compile(r'(?<=id=")m[0-9a-f]{10}(?=")')
_DIGITS = re.compile(r"(?<=\.\d\d)\d+")


LONGEST = 100
"""Maximum number of characters of a file name; operating systems allow about 250 bytes."""


def _rounded(found: re.Match[str]) -> str:
    """Round coordinates on the page to 0.01 points; the eye resolves 0.1 points, and files become a third smaller.

    After the start of a path, a pair of coordinates without a letter is a line to this point.
    """
    text = " ".join(_DIGITS.sub("", found.group()).split())
    return " " + (text if _CURVED.search(text) else text.replace(" L ", " "))


def drawn_source(draw: Callable[[], Figure]) -> str:
    """Return a figure as a data URI."""
    # a figure has thousands of cyclic objects; it takes a sixth less time without garbage collection
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
    """Return the HTML of a drawing; a note replaces a drawing that fails.

    `make` makes the drawing; `alt` and `caption` are alternative text and caption. `name` is the name of the file of
    the figure, if files are requested, and `draw` makes this figure.
    """
    found = {"drawing": "", "alt": alt, "caption": caption, "problem": "", "name": name}
    try:
        return found | {"drawing": make().inline(alt), "draw": draw}
    except Exception as error:  # noqa: BLE001 - results of other packages may be invalid in any way; the tables must remain
        return found | {"problem": f"{type(error).__name__}: {error}"}


@typechecked
def figure_html(draw: Callable[[], Figure], alt: str, caption: str) -> str:
    """Return a figure for a section of the report as HTML; a note replaces a figure that fails.

    Parameters
    ----------
    draw : callable
        Function that makes the figure of Matplotlib.
    alt, caption : str
        Alternative text and caption: plain text.

    Returns
    -------
    str
        HTML fragment that contains the figure as an SVG.

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
    except Exception as error:  # noqa: BLE001 - results of other packages may be invalid in any way; the tables must remain
        found["problem"] = f"{type(error).__name__}: {error}"
    return image_html(found)


def image_html(found: Mapping[str, Any], chart: str = "") -> str:
    """Return a picture as HTML; ``chart`` is the JSON, safe in HTML, of a chart that replaces the picture."""
    text = {key: html.escape(found[key]) for key in ("source", "alt", "caption", "problem")}
    if found.get("note"):
        return f'<p class="note">{html.escape(found["note"])}</p>'
    if found["problem"]:
        message = f"This figure could not be drawn ({text['caption']}) {text['problem']}"
        return f'<p class="problem">{message}</p>'
    data = f'<script type="application/json">{chart}</script>' if chart else ""
    begin, picture = f"{CHARTED}>" if chart else "<figure>", f'<img src="{text["source"]}" alt="{text["alt"]}">'
    if chart and not found["source"]:
        begin, picture = f'{CHARTED} data-alt="{text["alt"]}">', f"<noscript>{NEEDS_SCRIPTS}</noscript>"
    return f"{begin}{picture}<figcaption>{text['caption']}</figcaption>{data}</figure>"


def write_images(content: object, folder: Path) -> list[Path]:
    """Write all named figures and films in nested lists and dictionaries to files.

    A figure that cannot be drawn gives a warning; the others are written.

    `content` contains return values of `charted` or `still_image`, within any lists and dictionaries. `folder` is
    created if missing. Files with the same names are replaced, and others remain. Return the paths in the order of the
    content.
    """
    written: dict[Path, None] = {}
    for name, make in _named(content):
        try:
            source = make()
        except Exception as error:  # noqa: BLE001 - a figure of other packages' results may raise anything; the others are written
            text = f"figure {name!r} is not written to {str(folder)!r}: {type(error).__name__}: {error}"
            warnings.warn(text, UserWarning, stacklevel=3)
            continue
        kind, data = source.removeprefix("data:image/").split(";base64,", 1)
        plain = re.sub(r"[^\w.+-]+", "-", name, flags=re.ASCII).strip("-.")
        # shorten a long name in its middle, because its end distinguishes the figures of an output
        plain = plain if len(plain) <= LONGEST else f"{plain[: LONGEST // 2]}-{plain[-LONGEST // 2 :]}"
        number, target = 1, folder / f"{plain or 'figure'}.{kind.removesuffix('+xml')}"
        while target in written:  # names may differ only in replaced characters
            number += 1
            target = folder / f"{plain}-{number}.{kind.removesuffix('+xml')}"
        folder.mkdir(parents=True, exist_ok=True)
        with open(target, "wb", opener=no_link) as file:
            file.write(base64.b64decode(data))
        written[target] = None
    return list(written)


def _named(content: object) -> Iterator[tuple[str, Callable[[], str]]]:
    """Yield the name of each figure and film, and the function that returns its data URI."""
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
    """Return a figure as the data URI of an SVG; the ticks of the figure become fixed."""
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    buffer = io.StringIO()
    # A separate image instead of inline markup avoids clashes of identifiers. Text elements instead of outlines of
    # letters are small, quickly written, and in the font of the page. With the fixed salt, equal results give equal
    # files.
    with warnings.catch_warnings(), matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "uqmbd"}):
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        freeze_ticks(figure)
        # `savefig` would draw twice, the second time for a layout that does not change
        canvas: Any = FigureCanvasSVG(figure)
        canvas.print_svg(buffer, metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    drawn = re.sub(r"'DejaVu Sans'[^;\"]*sans-serif", _FONTS, buffer.getvalue())
    # texts in results of other packages may contain characters that XML does not allow
    drawn = UNWRITABLE.sub("\N{REPLACEMENT CHARACTER}", _PLACES.sub(_rounded, drawn))
    drawn = _short_markers(_BETWEEN.sub("><", drawn))
    return "data:image/svg+xml;base64," + base64.b64encode(drawn.encode("utf-8", "replace")).decode("ascii")


def _short_markers(drawn: str) -> str:
    """Shorten an SVG: equal markers share one style, and their shapes have short names."""
    drawn = _ALIKE.sub(lambda found: f"{found[1]}{found[3]}>{found[2].replace(found[3], '')}</g>", drawn)
    for k, name in enumerate(dict.fromkeys(_NAMED.findall(drawn))):
        drawn = drawn.replace(name, f"m{k}")
    return drawn
