"""How the germ space was split into elements, and how large the error is in each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.report.drawing import arrange, log_axis, single_axes, with_units, wrapped
from uqmbd.report.figures.selection import Results, label_of, nodes_of, of_output
from uqmbd.typing import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["SplitElements", "elements_in_words", "has_elements", "split_elements", "split_pattern"]


PROBABILITY = "probability"

_BEYOND = 0.001
"""Probability of what lies beyond the frame at an end that is infinite."""


def has_elements(node: xr.DataTree) -> bool:
    """Tell whether a method split the germ space."""
    return "chaos" in node.children and {"lower", "upper"} <= set(map(str, node.children["chaos"].data_vars))


def split_pattern(results: Results, output: str | None = None) -> Figure:
    """Draw the elements of a multi-element chaos in the plane of the two inputs that were split most.

    Coloured by the stated error within each element, at its largest over time; without verification realisations by
    the probability.  With more than two inputs elements that lie behind one another are drawn over each other, the
    largest error on top.  Of a single input, or where one alone was split, the height is the error.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of these
        The node of a propagator with elements; of several the first that has any.
    output : str, optional
        Whose error; default: the largest of all outputs.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    StudyError
        If no method has elements, or no such output exists.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> from uqmbd.randomness import GermBox, GermSpace, JointInput
    >>> from uqmbd.results import PiecewiseChaos, PolynomialChaos, labels, propagator_node
    >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("k", chaospy.Uniform(0, 2))]))
    >>> axes, boxes = labels(["x"], ["k"], [0.0]), GermBox.whole(space).split(0)
    >>> parts = [PolynomialChaos([[[s]]], [[0]], b.local, axes) for s, b in zip((-1.0, 1.0), boxes)]
    >>> chaos = PiecewiseChaos(parts, boxes)
    >>> node = propagator_node("mine", chaos.statistics(), propagator="p", realisations=2, wall_time=0.0,
    ...                        children={"chaos": chaos.to_dataset()})
    >>> split_pattern(node).axes[0].get_xlabel()
    'k'
    """
    node = next((n for n in nodes_of(results).values() if has_elements(n)), None)
    if node is None:
        raise StudyError("None of these results has elements; use elements='adaptive' with collocation or Galerkin.")
    found = split_elements(node, output)
    figure, axes = single_axes(3.6)
    if found.up is None:
        _bars(axes, *found.across, found.value, found.what)
    else:
        _boxes(figure, axes, (*found.across, *found.up), found.value, found.what)
        axes.set_ylabel(wrapped(with_units(*found.names[1]), 34))
    axes.set_xlabel(wrapped(with_units(*found.names[0]), 60))
    arrange(figure, [axes], right=0.18 if found.up is None else 1.05, heights=(2.6,))
    return figure


class SplitElements(NamedTuple):
    """The elements of a method in the plane of the inputs that were split most, or along the only one.

    Attributes
    ----------
    names : list of tuple of str
        Name and units of the inputs: first that along the axis.
    across : tuple of array, shape (E,)
        Lower and upper ends of the elements.
    up : tuple of array, shape (E,), optional
        The same in the other input; None where one alone was split.
    value : array, shape (E,)
        The stated error of each element, over the standard deviation, at its largest; or its probability.
    what : str
        Which of the two it is.
    probability : array, shape (E,)
    """

    names: list[tuple[str, str]]
    across: tuple[Array, Array]
    up: tuple[Array, Array] | None
    value: Array
    what: str
    probability: Array

    @property
    def stated(self) -> bool:
        """Whether the values are errors."""
        return self.what != PROBABILITY


def split_elements(node: xr.DataTree, output: str | None = None) -> SplitElements:
    """Return what `split_pattern` draws.

    Raises
    ------
    StudyError
        If no such output exists.
    """
    data = node.children["chaos"].to_dataset()
    if output is not None:
        of_output(data, output)
    lower, upper = data["lower"].values, data["upper"].values
    value, what = _colour(data, output)
    counts = _cuts(lower, upper)
    ranked = sorted(range(len(counts)), key=lambda k: (-counts[k], k))
    chosen = ranked[: 2 if len(ranked) > 1 and counts[ranked[1]] else 1]
    names = [str(n) for n in data["germ"].values]
    units = dict(zip(map(str, data["input"].values), map(str, data["input_units"].values), strict=True))
    across, *rest = (_frame(data, germ, lower, upper) for germ in chosen)
    return SplitElements(
        [(names[k], units.get(names[k], "")) for k in chosen],
        across,
        rest[0] if rest else None,
        value,
        what,
        np.asarray(data["probability"].values, dtype=float),
    )


def elements_in_words(node: xr.DataTree) -> str:
    """Say how many elements there are, along which inputs they were split, and where the smallest lie."""
    data = node.children["chaos"].to_dataset()
    counts = _cuts(data["lower"].values, data["upper"].values)
    names = [str(n) for n in data["germ"].values]
    split = [f"{names[k]} at {n} {'place' if n == 1 else 'places'}" for k, n in enumerate(counts) if n]
    text = f"{label_of(node)} split the inputs into {data.sizes['element']} elements"
    if not split:
        return f"{text}: none was needed."
    rest = [names[k] for k, n in enumerate(counts) if not n]
    text += f": {', '.join(split)}" + (f", {', '.join(rest)} not at all" if rest else "")
    computed = node.attrs.get("elements_computed")
    more = "" if computed is None else f" On the way {int(computed)} elements were computed."
    return f"{text}.{more}"


def _cuts(lower: Array, upper: Array) -> list[int]:
    """Return at how many places each germ was split."""
    inner = [np.setdiff1d(lower[:, k], lower[:, k].min()) for k in range(lower.shape[1])]
    inner += [np.setdiff1d(upper[:, k], upper[:, k].max()) for k in range(lower.shape[1])]
    d = lower.shape[1]
    return [len(np.union1d(inner[k], inner[k + d])) for k in range(d)]


def _colour(data: xr.Dataset, output: str | None) -> tuple[Array, str]:
    """Return what colours each element, shape (E,), and its name."""
    if "verification_error" not in data:
        return np.asarray(data["probability"].values, dtype=float), PROBABILITY
    error = data["verification_error"]
    if output is not None:
        error = error.isel(output=[str(name) for name in data["output"].values].index(output))
    rest = [dim for dim in error.dims if dim != "element"]
    return np.asarray(error.max(rest).values, dtype=float), "stated error / standard deviation"


def _frame(data: xr.Dataset, germ: int, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return the ends of the elements in the units of the input, infinite ones as far as something can be seen."""
    from uqmbd.randomness import GermSpace

    space = GermSpace.from_dataset(data)
    whole = space.germs[germ]
    ends = whole.from_uniform(np.array([_BEYOND, 1 - _BEYOND]))
    inner = np.r_[lower[:, germ], upper[:, germ]]
    inner = inner[np.isfinite(inner)]
    low, high = (min(ends[0], inner.min(initial=np.inf)), max(ends[1], inner.max(initial=-np.inf)))
    sides = [np.where(np.isfinite(x), x, e) for x, e in ((lower[:, germ], low), (upper[:, germ], high))]
    if not space.independent:
        return sides[0], sides[1]
    try:
        middle = np.array([g.from_uniform(np.array([0.5]))[0] for g in space.germs])
        found = []
        for side in sides:
            points = np.tile(middle, (len(side), 1))
            points[:, germ] = side
            found.append(space.to_inputs(points)[:, germ])
    except StudyError:  # a map that is not stored: the germ itself is shown
        return sides[0], sides[1]
    return np.minimum(*found), np.maximum(*found)


def _bars(axes: Any, x0: Array, x1: Array, height: Array, what: str) -> None:
    """Draw elements along one input as bars."""
    order = np.argsort(x0)
    positive = height[height > 0]
    # errors of rounding need no room
    low = max(0.5 * float(positive.min()), 1e-4 * float(positive.max())) if positive.size else 0.0
    shown = np.maximum(height, low) if what != PROBABILITY else height
    axes.bar(x0[order], shown[order], x1[order] - x0[order], align="edge", color="#9CC5E3", edgecolor="#0B3C5D", lw=0.8)
    axes.set_xlim(x0.min(), x1.max())
    axes.set_ylabel("error in the element / std" if what != PROBABILITY else what)
    if what != PROBABILITY and positive.size:
        log_axis(axes, "y", low, 1.5 * float(height.max()), percent=True)


def _boxes(figure: Any, axes: Any, ends: tuple[Array, Array, Array, Array], colour: Array, what: str) -> None:
    """Draw elements in a plane, with a colour bar."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import LogNorm, Normalize

    x0, x1, y0, y1 = ends
    positive = colour[colour > 0]
    spread = positive.size and positive.max() > 1.05 * positive.min()
    if spread:
        norm: Any = LogNorm(max(float(positive.min()), 1e-3 * float(positive.max())), float(positive.max()))
    else:
        norm = Normalize(0, float(colour.max(initial=0.0)) or 1.0)
    tone = ScalarMappable(norm, "YlGnBu")
    order = np.argsort(colour, kind="stable")
    corners = np.stack(
        [np.stack([x0, y0], -1), np.stack([x1, y0], -1), np.stack([x1, y1], -1), np.stack([x0, y1], -1)], 1
    )
    shown = np.maximum(colour, norm.vmin) if spread else colour
    axes.add_collection(
        PolyCollection(list(corners[order]), facecolors=tone.to_rgba(shown[order]), edgecolors="0.25", linewidths=0.7)
    )
    axes.set_xlim(x0.min(), x1.max())
    axes.set_ylim(y0.min(), y1.max())
    axes.grid(visible=False)
    inset = axes.inset_axes((1.03, 0.0, 0.035, 1.0))
    bar = figure.colorbar(tone, cax=inset)
    bar.set_label(what, fontsize=9)
    bar.ax.tick_params(labelsize=8)
