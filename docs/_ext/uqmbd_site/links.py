"""Links: from pages into the repository, and from docstrings to names."""

from __future__ import annotations

import posixpath
import re
from pathlib import Path

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util.nodes import make_refnode

from uqmbd.plugins import KINDS
from uqmbd_site.gallery import studies

__all__ = ["in_site", "show_as_code"]

LINK = re.compile(r"\[([^\]]+)\]\((\.\.?/[^)#\s]+)(#[^)\s]*)?\)")
"""A relative link of Markdown: text, path, place."""

IN_SITE = {
    "README.md": "/index",
    "CHANGELOG.md": "/project/changelog",
    "studies/README.md": "/project/findings",
    "studies/benchmarks/README.md": "/project/benchmarks",
}
"""Pages of the site that hold a file of the repository."""


def in_site(app: Sphinx, name: str, source: list[str]) -> None:
    """Lead links out of the folder of pages to what the site has of it: the page of a study, or the path as text."""
    root = Path(app.srcdir).parent
    of_studies = {path.relative_to(root) for path in studies(root).values()}

    def changed(link: re.Match[str]) -> str:
        text, path, place = link.groups()
        target = posixpath.normpath(posixpath.join("docs", posixpath.dirname(name), path))
        if target.startswith("docs/") or not (root / target).exists():
            return link.group(0)
        page = IN_SITE.get(target) or (f"/gallery/{Path(target).stem}" if Path(target) in of_studies else None)
        if page:
            return f"[{text}]({page}.md{place or ''})"
        return f"{text} (`{target}`)" if text.strip("`") not in target else f"`{target}`"

    if str(app.env.doc2path(name)).endswith(".md"):
        source[0] = LINK.sub(changed, source[0])


def show_as_code(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.TextElement
) -> nodes.TextElement | None:
    """Show what is not of uqmbd as code, lead a hook to its page; a name of uqmbd without a page stays a warning."""
    target = node.get("reftarget", "")
    if node.get("refdomain") == "py" and target in {kind.hook for kind in KINDS.values()}:
        return make_refnode(app.builder, node["refdoc"], "reference/api/hooks", None, content)
    if node.get("refdomain") != "py" or target.split(".")[0].split("_")[0] == "uqmbd":
        return None
    return content
