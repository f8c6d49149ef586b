"""HTML of the viewer's page."""

from __future__ import annotations

import secrets
from html import escape
from importlib.resources import files

# the report would import NumPy and SciPy here, which delays the first picture
from uqmbd.javascript import joined_modules, surface_library

__all__ = ["viewer_page"]


def viewer_page(source: str) -> tuple[str, str]:
    """Return the page, and the nonce of its script and style; `source` is shown as the origin of the mechanism.

    >>> page, nonce = viewer_page("<study>.py")
    >>> "<study>" in page, "&lt;study&gt;.py" in page, nonce in page
    (False, True, True)
    """
    nonce = secrets.token_urlsafe(16)
    page = (files(__package__) / "page.html").read_text(encoding="utf-8")
    script = joined_modules("viewer.js") + "startViewer();\n"
    marks = {"@NONCE@": nonce, "@SOURCE@": escape(source), "@SURFACES@": surface_library(), "@SCRIPT@": script}
    for mark, text in marks.items():
        page = page.replace(mark, text)
    return page, nonce
