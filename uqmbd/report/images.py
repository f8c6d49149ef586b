"""Figures as images inside the report."""

from __future__ import annotations

import base64
import gc
import io
import re
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING

from uqmbd.report.ticks import freeze_ticks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["image", "svg"]

_FONTS = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', 'Noto Sans', 'DejaVu Sans', sans-serif"


def image(draw: Callable[[], Figure], alt: str, caption: str) -> dict[str, str]:
    """Return a figure as a data URI; one that cannot be drawn is a note in its place."""
    # A figure is thousands of objects in cycles: looking for garbage once after each, not all the while, saves a sixth.
    collecting = gc.isenabled()
    gc.disable()
    try:
        return {"source": svg(draw()), "alt": alt, "caption": caption, "problem": ""}
    except Exception as error:  # noqa: BLE001 - results of other packages may hold surprises; the tables must stand
        return {"source": "", "alt": alt, "caption": caption, "problem": f"{type(error).__name__}: {error}"}
    finally:
        if collecting:
            gc.enable()


def svg(figure: Figure) -> str:
    """Return a figure as the data URI of an SVG; its ticks can no longer change."""
    import matplotlib

    buffer = io.StringIO()
    # An image of its own (not inline markup), so that identifiers of many figures never clash, with text as text, which
    # is small, quickly written, and in the font of the page. The fixed salt makes equal results equal files.
    with warnings.catch_warnings(), matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "uqmbd"}):
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        freeze_ticks(figure)
        figure.savefig(buffer, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    drawn = re.sub(r"'DejaVu Sans'[^;\"]*sans-serif", _FONTS, buffer.getvalue())
    return "data:image/svg+xml;base64," + base64.b64encode(drawn.encode("utf-8", "replace")).decode("ascii")
