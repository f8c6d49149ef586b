"""Interface of report sections, and sections of the core, which consist of plain data and a template."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import xarray as xr

from uqmbd.compiled import Store, cache_folder
from uqmbd.report.drawing import DARK_STYLE
from uqmbd.report.view import StudyResult

if TYPE_CHECKING:
    from jinja2 import Environment

__all__ = ["Content", "Section", "TemplateSection", "environment"]

Content = dict[str, Any]
"""Data of a template: texts, rows of tables, and images."""


class Section(Protocol):
    """A section that a plugin adds to the report.

    A section may also have a method ``first_screen(self, tree)``. This method returns a `uqmbd.report.FirstScreen` for
    the first screen of the report, or None.

    Examples
    --------
    The class that a plugin returns from the hook ``uqmbd_report_sections``:

    >>> import html
    >>> import xarray as xr
    >>> from uqmbd.report import Section
    >>> class Author:
    ...     title = "Author"
    ...     def render(self, tree):
    ...         return f"<p>{html.escape(tree.attrs['author'])}</p>"
    >>> section: Section = Author()
    >>> section.render(xr.DataTree(xr.Dataset(attrs=dict(author="Euler & Lagrange"))))
    '<p>Euler &amp; Lagrange</p>'
    """

    @property
    def title(self) -> str:
        """Return the heading of the section, plain text."""

    def render(self, tree: xr.DataTree) -> str:
        """Return an HTML fragment; the method must escape quoted data."""


@dataclass(frozen=True)
class TemplateSection:
    """Section with a template that renders its content."""

    title: str
    name: str  # name of the block in the template, and of the anchor on the page
    # maps the result of a study to the data of the template; None: the section is omitted
    content: Callable[[StudyResult], Content | None]
    template: str = "about_results.html.j2"  # file in ``templates``

    def render(self, tree: xr.DataTree) -> str:
        """Return the HTML of the section; empty if it is omitted."""
        result = StudyResult.of(tree)
        content = self.content(result)
        return "" if content is None else self.fragment(result, content)

    def fragment(self, result: StudyResult, content: Content) -> str:
        """Return the HTML of the section for given content."""
        template = environment().get_template(self.template)
        return "".join(template.blocks[self.name](template.new_context({**content, "several": result.several})))


_SETTINGS = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()[:16]
"""Digest of this module, which contains the settings of the template compiler."""


@functools.cache
def environment() -> Environment:
    """Return the template environment, which escapes all text that is not marked as HTML.

    Compiled templates are stored next to compiled kernels, with the same checks, because their compilation takes 2 % of
    a short run. Jinja compares the digest of a template with the digest in its stored bytecode.
    """
    from jinja2 import Environment, MemcachedBytecodeCache, PackageLoader, StrictUndefined
    from jinja2 import __version__ as version

    bytecode = MemcachedBytecodeCache(_TemplateCache(), prefix=f"template-{version}-{_SETTINGS}-")
    made = Environment(
        loader=PackageLoader(__package__),
        bytecode_cache=bytecode,
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.globals["still_on_dark"] = DARK_STYLE
    return made


class _TemplateCache:
    """Bytecode cache of templates, with the interface of Jinja."""

    def get(self, key: str) -> bytes:
        """Return the stored bytecode of a key of Jinja; empty if it is missing."""
        return Store(cache_folder()).get(key) or b""

    def set(self, key: str, value: bytes, timeout: int | None = None) -> None:  # noqa: ARG002 - as Jinja calls it
        """Store bytecode."""
        Store(cache_folder()).put(key, value)
