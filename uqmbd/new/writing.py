"""Writing of templates to files; existing files are replaced only on request."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from uqmbd.errors import StudyError
from uqmbd.files import no_link

__all__ = ["rendered", "write"]

TEMPLATES = Path(__file__).parent / "templates"
SUFFIX = ".jinja"
"""Suffix of files that are rendered; other files are copied unchanged."""


def rendered(folder: str, names: Mapping[str, Any], *, replaced: Mapping[str, str] | None = None) -> dict[Path, str]:
    """Render all files of a folder of templates.

    `folder` is relative to the folder of all templates. `names` are the variables of the templates. `replaced` maps
    parts of paths to new names. Return texts by path, relative to the target folder.
    """
    from jinja2 import Environment, StrictUndefined

    # delimiters that neither Python nor GitHub's workflows use
    environment = Environment(
        block_start_string="<%",
        block_end_string="%>",
        variable_start_string="<<",
        variable_end_string=">>",
        comment_start_string="<#",
        comment_end_string="#>",
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # noqa: S701 - the output is Python, TOML and Markdown with checked names
    )
    texts = {}
    for source in _files(TEMPLATES / folder):
        text = source.read_text(encoding="utf-8")
        parts = [(replaced or {}).get(part, part) for part in source.relative_to(TEMPLATES / folder).parts]
        path = Path(*parts)
        if path.suffix == SUFFIX:
            path = path.with_suffix("")
            path = path.with_name((replaced or {}).get(path.name, path.name))
            text = environment.from_string(text).render(**names)
        texts[path] = text
    return texts


def write(texts: Mapping[Path, str], folder: Path, *, force: bool) -> list[Path]:
    """Write texts into a folder, and return the paths.

    Raise StudyError, without writing, if a file exists already and `force` is False.
    """
    paths = [folder / path for path in texts]
    there = [str(path) for path in paths if path.exists() or path.is_symlink()]
    if there and not force:
        exist = "exists" if len(there) == 1 else "exist"
        raise StudyError(f"{', '.join(there)} {exist} already, and nothing was written; use --force to overwrite.")
    for path, text in zip(paths, texts.values(), strict=True):
        path.parent.mkdir(parents=True, exist_ok=True)
        # without --force, a file that was created since the check is also an error
        with open(path, "w" if force else "x", encoding="utf-8", newline="\n", opener=no_link) as file:
            file.write(text)
    return paths


def _files(folder: Path) -> Iterator[Path]:
    """Yield the files in a folder and its subfolders, sorted by name."""
    for path in sorted(folder.iterdir()):
        if path.is_dir():
            if path.name != "__pycache__":
                yield from _files(path)
        else:
            yield path
