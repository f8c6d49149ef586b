"""What a section of the report is, and how those of the core are made: plain data, shown by a template."""

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
"""What a template shows: texts, rows of tables, and images."""


class Section(Protocol):
    """A section that a plugin adds to the report.

    A section may also have a method ``first_screen(self, tree)``. It returns a `uqmbd.report.FirstScreen`, which the
    first screen of the report shows, or None.

    Examples
    --------
    What a plugin gives by the hook ``uqmbd_report_sections``:

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
        """Heading of the section, plain text."""

    def render(self, tree: xr.DataTree) -> str:
        """Return an HTML fragment; what it quotes from the data it must escape itself."""


@dataclass(frozen=True)
class TemplateSection:
    """A section whose content a template shows."""

    title: str
    name: str  # of its block in the template, and its anchor on the page
    # from the result of a study to what the template shows; None: the section is left out
    content: Callable[[StudyResult], Content | None]
    template: str = "about_results.html.j2"  # file in ``templates``

    def render(self, tree: xr.DataTree) -> str:
        """Return the HTML of the section; empty if it is left out."""
        result = StudyResult.of(tree)
        content = self.content(result)
        return "" if content is None else self.fragment(result, content)

    def fragment(self, result: StudyResult, content: Content) -> str:
        """Return the HTML of this content."""
        template = environment().get_template(self.template)
        return "".join(template.blocks[self.name](template.new_context({**content, "several": result.several})))


_SETTINGS = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()[:16]
"""Of this module, which sets how templates are compiled."""


@functools.cache
def environment() -> Environment:
    """Return what reads the templates: all that is not marked as HTML is escaped.

    Compiled templates are kept beside the compiled kernels, with the same checks: to compile them takes 2 % of a short
    run.  Jinja compares the digest of a template's source with that of what is kept.
    """
    from jinja2 import Environment, MemcachedBytecodeCache, PackageLoader, StrictUndefined
    from jinja2 import __version__ as version

    kept = MemcachedBytecodeCache(_TemplateCache(), prefix=f"template-{version}-{_SETTINGS}-")
    made = Environment(
        loader=PackageLoader(__package__),
        bytecode_cache=kept,
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.globals["still_on_dark"] = DARK_STYLE
    return made


class _TemplateCache:
    """The store of what is compiled, as Jinja asks for it."""

    def get(self, key: str) -> bytes:
        """Return what was kept by a key of Jinja; empty, which it takes for none, if nothing was."""
        return Store(cache_folder()).get(key) or b""

    def set(self, key: str, value: bytes, timeout: int | None = None) -> None:  # noqa: ARG002 - as Jinja calls it
        """Keep it."""
        Store(cache_folder()).put(key, value)
