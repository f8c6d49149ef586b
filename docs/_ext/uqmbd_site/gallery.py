"""The gallery: a page for each study, with pictures of its results.

``uqmbd run`` runs each study and writes its report; the pages show pictures of these results.  A site that is built
without running the studies shows the small pictures in ``docs/pictures``.  ``python -m uqmbd_site store`` writes
them from the last runs, and ``python -m uqmbd_site compare`` lists those that differ.

sphinx-gallery is not used: it runs scripts that draw figures themselves, and a study only defines a computation.
"""

from __future__ import annotations

import ast
import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from uqmbd_site.reference import write_if_changed

__all__ = ["LIMIT", "changed_pictures", "store_pictures", "studies", "write_gallery"]

LIMIT = 900
"""Longest time of a study, s."""

TOPICS = {
    "First examples": ("pendulum", "slider_crank", "slider_crank_driven", "four_bar"),
    "Vehicles": ("motorcycle", "quarter_car", "quarter_car_paths", "half_car", "suspension"),
    "Random vibration": ("earthquake",),
    "Spatial mechanisms and robots": ("agile_eye", "robot", "crane"),
    "Flexible bodies": ("flexible_slider_crank",),
    "Contact and impacts": ("bouncing_ball", "bouncing_ball_compliant", "clearance"),
    "Long simulations": ("slider_crank_rotating", "long_time"),
    "Requirements, tolerances and design": ("limits", "tolerances", "undamped_oscillator"),
    "Numerical properties of the methods": ("stiffness", "kraichnan_orszag"),
    "Calibration from measurements": ("calibration", "two_storey_oscillator"),
}
"""Studies by topic; studies without a topic are shown at the end."""

COMPARISONS = {
    "Numerical properties of the methods": (
        ("Which method when", "/how-to/choose_method", "../pictures/methods_rotating.png",
         "Error against cost of all methods on 47 mechanisms, and how good the recommended method is."),
    ),
}  # fmt: skip
"""Pages with measurements that are shown next to the studies of a topic: title, page, picture and text."""

DRAWN = {"mechanism": "The mechanism", "output": "Mean and bands of an output by all methods, or densities"}
"""Pictures of a study, and their alternative texts."""

COLOURS = 32
"""Number of colours of stored pictures."""

DIFFERENCE = 0.03
"""Largest root mean square difference of the grey levels, of 1, of a stored picture and that of a new run."""

PICTURES = """
import sys
from pathlib import Path

import uqmbd
from uqmbd.results import load

folder = Path(sys.argv[1])


def write(figure, name):
    figure.savefig(folder / f"{name}.svg", bbox_inches="tight", metadata={"Date": None})
    figure.savefig(folder / f"{name}.png", bbox_inches="tight", dpi=90)


study = uqmbd.load_study(Path(sys.argv[2]))
write(uqmbd.report.mechanism(study.mechanism), "mechanism")
tree = load(folder / "results.nc")
found = [node.dataset["mean"] for node in tree.subtree if node.name == "statistics" and "time" in node.dataset.dims]
if found and found[0].sizes["output"]:
    figure = uqmbd.report.bands(tree, str(found[0]["output"].values[0]))
elif any(node.name == "scalars" for node in tree.subtree):
    figure = uqmbd.report.scalar_densities(tree)
else:  # of requirements alone
    figure = None
if figure:
    write(figure, "output")
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
        Whether to run studies without results.  Otherwise their pages show the stored pictures, and no report.

    Returns
    -------
    list of str
        What went wrong, study by study.
    """
    source = Path(source)
    root, problems, mechanisms = source.parent, [], {}
    for name, path in studies(root).items():
        kept = source / "_build" / "studies" / name
        problem = _computed(root, path, kept) if run else ""
        problems += [f"{path.relative_to(root)}: {problem}"] if problem else []
        pictures = {}
        for picture in DRAWN:
            for found in (kept / f"{picture}.svg", source / "pictures" / f"{name}-{picture}.png"):
                if picture not in pictures and found.exists():
                    pictures[picture] = f"pictures/{name}-{picture}{found.suffix}"
                    (source / "gallery" / "pictures").mkdir(parents=True, exist_ok=True)
                    shutil.copy2(found, source / "gallery" / pictures[picture])
        mechanisms |= {name: pictures["mechanism"]} if "mechanism" in pictures else {}
        report = source / "_build" / "extra" / "reports" / f"{name}.html"
        if (kept / "report.html").exists():
            report.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(kept / "report.html", report)
        write_if_changed(source / "gallery" / f"{name}.md", _page(root, path, pictures, report=report.exists()))
    write_if_changed(source / "gallery" / "index.md", _index(root, mechanisms))
    return problems


def store_pictures(source: Path) -> list[str]:
    """Store the pictures of the last runs with few colours in ``pictures``, and return their names."""
    (source / "pictures").mkdir(exist_ok=True)
    found = _drawn(source)
    for name, path in found.items():
        Image.open(path).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(
            source / "pictures" / name, optimize=True
        )
    return list(found)


def changed_pictures(source: Path) -> list[str]:
    """Return the names of stored pictures that differ from those of the last runs, and of those that are missing."""
    changed = []
    for name, path in _drawn(source).items():
        stored = source / "pictures" / name
        images = [Image.open(one).convert("L") for one in (stored, path)] if stored.exists() else []
        if not images or images[0].size != images[1].size:
            changed.append(name)
        else:
            old, new = (np.asarray(image, dtype=float) / 255 for image in images)
            changed += [name] if float(np.sqrt(np.mean((old - new) ** 2))) > DIFFERENCE else []
    return changed


def _drawn(source: Path) -> dict[str, Path]:
    """Return the pictures of the last runs by the names under which they are stored."""
    runs = source / "_build" / "studies"
    found = {f"{name}-{x}.png": runs / name / f"{x}.png" for name in studies(source.parent) for x in DRAWN}
    return {name: path for name, path in found.items() if path.exists()}


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


def _page(root: Path, path: Path, pictures: dict[str, str], *, report: bool) -> str:
    head, rest = _parts(path)
    name, shown = path.stem, path.relative_to(root).as_posix()
    lines = [f"# {_title(path)}", "", head, ""]
    for picture, file in pictures.items():
        lines += [f"![{DRAWN[picture]}]({file})", ""]
    if report:
        lines += ["```{raw} html", f'<p><a href="../reports/{name}.html">The report of this study</a></p>', "```", ""]
    lines += [rest, "", "```sh", f"uqmbd run {shown} --out results", "```", ""]
    return "\n".join([*lines, f"```{{literalinclude}} ../../{shown}", ":language: python", "```", ""])


def _index(root: Path, mechanisms: dict[str, str]) -> str:
    lines = [
        "# Gallery",
        "",
        "Each page shows a study, with pictures of its mechanism and of its results.",
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
            path = found[name]
            published = " (published benchmark)" if path.parent.name == "published" else ""
            lines += [f":::{{grid-item-card}} {_title(path)}{published}", f":link: {name}", ":link-type: doc"]
            lines += [f":img-top: {mechanisms[name]}"] if name in mechanisms else []
            lines += ["", _parts(path)[0], ":::", ""]
        for text, page, picture, words in COMPARISONS.get(title, ()):
            lines += [f":::{{grid-item-card}} {text}", f":link: {page}", ":link-type: doc", f":img-top: {picture}"]
            lines += ["", words, ":::", ""]
        lines += ["::::", "", "```{toctree}", ":hidden:", "", *chosen, "```", ""]
    lines += [
        "## Results",
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
