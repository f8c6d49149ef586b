"""The gallery: each study is run as `uqmbd run` does, and its pictures are those of its results.

sphinx-gallery runs scripts that draw figures themselves.  A study defines what is to be computed and calls nothing; the
command line runs it, writes its report, and keeps its results.  So the pages are written from these.
"""

from __future__ import annotations

import ast
import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

from uqmbd_site.reference import write_if_changed

__all__ = ["LIMIT", "studies", "write_gallery"]

LIMIT = 900
"""Longest time of a study, s."""

TOPICS = {
    "To begin with": ("pendulum", "slider_crank", "slider_crank_driven", "four_bar"),
    "Vehicles": ("motorcycle", "quarter_car", "suspension"),
    "Mechanisms in space, and robots": ("agile_eye", "robot"),
    "Contact and impacts": ("bouncing_ball", "bouncing_ball_compliant", "clearance"),
    "Long times": ("slider_crank_rotating", "long_time"),
    "Limits, tolerances and choices of a design": ("limits", "tolerances", "undamped_oscillator"),
    "Numerics of the methods": ("stiffness", "kraichnan_orszag"),
    "Records of a machine": ("calibration", "two_storey_oscillator"),
}
"""Studies by what they are examples of; those that stand in none are shown at the end."""

PICTURES = """
import sys
from pathlib import Path

import uqmbd
from uqmbd.results import load

folder = Path(sys.argv[1])
study = uqmbd.load_study(Path(sys.argv[2]))
uqmbd.report.mechanism(study.mechanism).savefig(folder / "mechanism.svg", bbox_inches="tight", metadata={"Date": None})
tree = load(folder / "results.nc")
found = [node.dataset["mean"] for node in tree.subtree if node.name == "statistics" and "time" in node.dataset.dims]
if found and found[0].sizes["output"]:
    figure = uqmbd.report.bands(tree, str(found[0]["output"].values[0]))
elif any(node.name == "scalars" for node in tree.subtree):
    figure = uqmbd.report.scalar_densities(tree)
else:  # of requirements alone
    figure = None
if figure:
    figure.savefig(folder / "output.svg", bbox_inches="tight", metadata={"Date": None})
"""
"""What draws a mechanism, and its first output, in a process of its own."""


def studies(root: Path) -> dict[str, Path]:
    """Return all studies by the names of their pages: the project's own, then published ones."""
    found = [*sorted((root / "studies").glob("*.py")), *sorted((root / "studies" / "published").glob("*.py"))]
    return {path.stem: path for path in found}


def write_gallery(source: str | Path, *, run: bool = True) -> list[str]:
    """Write a page for each study into ``gallery``, with pictures of its results if it is run.

    Parameters
    ----------
    source : path
        Folder of the sources of the site.
    run : bool
        Whether studies are run whose results are not there; without it their pages have no pictures.

    Returns
    -------
    list of str
        What went wrong, study by study.
    """
    source = Path(source)
    root, problems = source.parent, []
    for name, path in studies(root).items():
        kept = source / "_build" / "studies" / name
        problem = _computed(root, path, kept) if run else ""
        problems += [f"{path.relative_to(root)}: {problem}"] if problem else []
        pictures = [picture for picture in ("mechanism.svg", "output.svg") if (kept / picture).exists()]
        for picture in pictures:
            (source / "gallery" / "pictures").mkdir(parents=True, exist_ok=True)
            shutil.copy2(kept / picture, source / "gallery" / "pictures" / f"{name}-{picture}")
        report = source / "_build" / "extra" / "reports" / f"{name}.html"
        if (kept / "report.html").exists():
            report.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(kept / "report.html", report)
        write_if_changed(source / "gallery" / f"{name}.md", _page(root, path, pictures, report=report.exists()))
    write_if_changed(source / "gallery" / "index.md", _index(root))
    return problems


def _computed(root: Path, path: Path, kept: Path) -> str:
    """Run a study unless it was, and return what went wrong, or nothing."""
    key = hashlib.sha256(path.read_bytes()).hexdigest()
    if (kept / "key").exists() and (kept / "key").read_text() == key:
        return ""
    environment = {**os.environ, "PYTHONPATH": f"{root}{os.pathsep}{root / 'plugins'}", "MPLBACKEND": "Agg"}
    for command in (
        ["-m", "uqmbd", "run", str(path), "--out", str(kept), "--workers", "2"],
        ["-c", PICTURES, str(kept), str(path)],
    ):
        try:
            done = subprocess.run(
                [sys.executable, *command],
                cwd=root, env=environment, capture_output=True, text=True, timeout=LIMIT, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return f"takes longer than {LIMIT} s"
        if done.returncode:
            return done.stderr[-500:]
    (kept / "key").write_text(key)
    return ""


def _parts(path: Path) -> tuple[str, str]:
    """Return the first sentence of a study's docstring, and the rest."""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or path.stem
    head, _, rest = text.partition("\n\n")
    return " ".join(head.split()), rest


def _title(path: Path) -> str:
    return path.stem.replace("_", " ").capitalize()


def _page(root: Path, path: Path, pictures: list[str], *, report: bool) -> str:
    head, rest = _parts(path)
    name, shown = path.stem, path.relative_to(root).as_posix()
    lines = [f"# {_title(path)}", "", head, ""]
    words = {"mechanism.svg": "The mechanism", "output.svg": "Mean and bands of an output by all methods, or densities"}
    for picture in pictures:
        lines += [f"![{words[picture]}](pictures/{name}-{picture})", ""]
    if report:
        lines += ["```{raw} html", f'<p><a href="../reports/{name}.html">The report of this study</a></p>', "```", ""]
    lines += [rest, "", "```sh", f"uqmbd run {shown} --out results", "```", ""]
    return "\n".join([*lines, f"```{{literalinclude}} ../../{shown}", ":language: python", "```", ""])


def _index(root: Path) -> str:
    lines = [
        "# Gallery",
        "",
        "Each page is a study. Its pictures and its report are those of its run when the site was built.",
        "",
    ]
    found = studies(root)
    topics = {title: [name for name in names if name in found] for title, names in TOPICS.items()}
    topics["Others"] = [name for name in found if not any(name in names for names in TOPICS.values())]
    for title, chosen in topics.items():
        if not chosen:
            continue
        lines += [f"## {title}", "", "::::{grid} 1 2 2 3", ":gutter: 2", ""]
        for name in chosen:
            path, picture = found[name], f"pictures/{name}-mechanism.svg"
            published = " (published benchmark)" if path.parent.name == "published" else ""
            lines += [f":::{{grid-item-card}} {_title(path)}{published}", f":link: {name}", ":link-type: doc"]
            lines += [f":img-top: {picture}"] if (root / "docs" / "gallery" / picture).exists() else []
            lines += ["", _parts(path)[0], ":::", ""]
        lines += ["::::", "", "```{toctree}", ":hidden:", "", *chosen, "```", ""]
    lines += [
        "## What was found",
        "",
        "```{toctree}",
        ":maxdepth: 1",
        "",
        "/project/findings",
        "/project/benchmarks",
        "```",
        "",
    ]
    return "\n".join(lines)
