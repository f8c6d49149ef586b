"""What the site of uqmbd has of its own: pages that are written from the code, and links into the repository."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from uqmbd_site.gallery import write_gallery
from uqmbd_site.interface import write_command_line, write_hooks
from uqmbd_site.reference import write_reference

if TYPE_CHECKING:
    from sphinx.application import Sphinx

__all__ = ["setup"]


def _write(app: Sphinx) -> None:
    from sphinx.util import logging

    write_reference(app.srcdir)
    write_command_line(app.srcdir)
    write_hooks(app.srcdir)
    for problem in write_gallery(app.srcdir, run=app.config.uqmbd_run_studies):
        logging.getLogger(__name__).warning(problem, type="uqmbd", subtype="study")


def setup(app: Sphinx) -> dict[str, Any]:
    """Register what writes pages, and what mends links."""
    from uqmbd_site.links import in_site, show_as_code

    app.add_config_value("uqmbd_run_studies", True, "env", [bool])
    app.connect("builder-inited", _write)
    app.connect("source-read", in_site)
    app.connect("missing-reference", show_as_code)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
