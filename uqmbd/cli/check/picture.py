"""`uqmbd check --figure`: a picture of the mechanism as a file."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from uqmbd.errors import StudyError

if TYPE_CHECKING:
    from uqmbd.propagation import Study

__all__ = ["draw_figure", "require_format"]

FORMATS = (".png", ".svg", ".pdf")


def require_format(path: Path) -> None:
    """Raise an error if a picture with this file name cannot be written.

    >>> require_format(Path("crank.docx"))
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: --figure crank.docx: expected a file name that ends in .png, .svg or .pdf.
    """
    if path.suffix.lower() not in FORMATS:
        raise StudyError(
            f"--figure {path}: expected a file name that ends in {', '.join(FORMATS[:-1])} or {FORMATS[-1]}."
        )


def draw_figure(study: Study, path: Path) -> None:
    """Draw the mechanism of a study at its start, and print the path of the file."""
    from uqmbd import report
    from uqmbd.errors import RedundantConstraintWarning

    with warnings.catch_warnings():
        # the check already reports this warning
        warnings.simplefilter("ignore", RedundantConstraintWarning)
        made = report.mechanism(study.mechanism, time=float(study.times[0]))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Glyph .* missing from font")
            made.savefig(path, dpi=150)
    except OSError as error:
        raise StudyError(f"--figure {path}: the picture cannot be written ({error.strerror or error}).") from error
    print(f"figure  {path}\n")
