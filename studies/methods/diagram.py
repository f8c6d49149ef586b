"""The decision diagram of the page on the choice of a method, drawn from the measured costs.

Each answer states how many realisations the method needs for 1 % of mean and standard deviation, over those of the best
method: the median over the mechanisms of its class that it can solve, and their number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
import xarray as xr

__all__ = ["QUESTIONS", "Question", "diagram"]

WIDTH, HEIGHT, GAP = 800, 74, 24
"""Size of the drawing and of its boxes."""
ACCURACY = 0.01
STYLE = (
    ".q{fill:#e8f1f8;stroke:#0072b2}.a{fill:#fdf1e6;stroke:#b35c00}.e{fill:#e7f4ea;stroke:#1b7837}text{fill:#1a1a1a}"
    ".l{stroke:#555;fill:none;stroke-width:1.4}.m{font-size:12px;fill:#444}"
)


@dataclass(frozen=True)
class Question:
    """A question of the diagram, and the method for the answer yes.

    Attributes
    ----------
    text, answer : tuple of str
        Lines of the question and of the answer.
    kinds, methods : tuple of str
        Kinds of mechanisms whose costs are stated, and the methods of the answer in the table of costs; empty: none.
    """

    text: tuple[str, ...]
    answer: tuple[str, ...]
    kinds: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()


QUESTIONS = (
    Question(("Is a violation rarer than 1 in 1000", "of interest?"), ("Reliability",)),
    Question(
        ("Do bodies hit each other, stick or slip,", "or can the motion end in several places?"),
        ('Collocation(alignment="events"),', "next to Sobol' points"),
        ("contact",),
        ("Collocation, alignment=events", "Collocation, alignment=auto", "Monte Carlo, sobol"),
    ),
    Question(
        ("Does it turn or swing for more than", "about ten periods?"),
        ('Collocation(alignment="auto")',),
        ("rotating",),
        ("Collocation, alignment=auto",),
    ),
    Question(
        ("More than five inputs that matter?",),
        ('Collocation(adaptive="dimension")',),
        ("many inputs",),
        ("Collocation, adaptive=dimension",),
    ),
)
"""Questions from top to bottom."""

LAST = Question(
    ("otherwise",),
    ("Collocation with --accuracy,", "next to Sobol' points"),
    ("smooth", "closed loop", "controller", "stiff", "dependent inputs"),
    ("Collocation", "Collocation, alignment=auto"),
)


def measured(costs: xr.Dataset, question: Question) -> str:
    """Return the cost of the answer over the best cost, as text; empty if nothing was measured.

    The cost of an answer with several methods is that of the best of them: a study runs them side by side.
    """
    if not question.methods:
        return ""
    both = costs["realisations"].sel(question=["mean", "std"], accuracy=ACCURACY)
    both = both.max("question", skipna=False).isel(mechanism=np.isin(costs["kind"].values, question.kinds))
    best = both.min("method")
    among = np.isin(both["method"].values, question.methods)
    if not among.any():
        return ""
    own = both.isel(method=among).min("method")
    ratios = (own / best).values
    known, solved = int(np.isfinite(best).sum()), int(np.isfinite(ratios).sum())
    if not solved:
        return ""
    return f"{np.nanmedian(ratios):.1f} times the best ({solved} of {known} mechanisms)"


def box(kind: str, x: float, y: float, width: float, lines: Sequence[str], small: str = "") -> list[str]:
    """Return a box with centred lines; the last of them may be small."""
    drawn = [f'<rect class="{kind}" x="{x}" y="{y}" width="{width}" height="{HEIGHT}" rx="6"/>']
    every = [*lines, *([small] if small else [])]
    for k, line in enumerate(every):
        place = y + HEIGHT / 2 + 5 + 18 * (k - (len(every) - 1) / 2)
        style = ' class="m"' if small and k == len(every) - 1 else ""
        drawn.append(f'<text{style} x="{x + width / 2}" y="{place:g}" text-anchor="middle">{escape(line)}</text>')
    return drawn


def diagram(costs: xr.Dataset) -> str:
    """Return the diagram as SVG; `costs` is the table of costs."""
    drawn, y = [], 16.0
    for question in QUESTIONS:
        drawn += box("q", 20, y, 330, question.text)
        drawn += box("a", 430, y, 350, question.answer, measured(costs, question))
        middle = y + HEIGHT / 2
        drawn.append(f'<path class="l" d="M350,{middle} H424" marker-end="url(#m)"/>')
        drawn.append(f'<text x="385" y="{middle - 7}" text-anchor="middle">yes</text>')
        drawn.append(f'<path class="l" d="M185,{y + HEIGHT} V{y + HEIGHT + GAP - 4}" marker-end="url(#m)"/>')
        drawn.append(f'<text x="193" y="{y + HEIGHT + 16}">no</text>')
        y += HEIGHT + GAP
    drawn += box("e", 20, y, 330, LAST.answer, measured(costs, LAST))
    y += HEIGHT + 16
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {y:g}" width="{WIDTH}" role="img" '
        'aria-label="Which method: questions from top to bottom, with the method to use if the answer is yes" '
        'font-family="system-ui, sans-serif" font-size="14">'
    )
    marker = (
        '<defs><marker id="m" markerWidth="9" markerHeight="9" refX="7" refY="4" orient="auto">'
        '<path d="M0,0 L8,4 L0,8 z" fill="#555"/></marker></defs>'
    )
    ground = f'<rect width="{WIDTH}" height="{y:g}" fill="#ffffff"/>'
    return "\n".join([head, f"<style>{STYLE}</style>", marker, ground, *drawn, "</svg>", ""])
