"""Charts of the elements of a multi-element chaos, and of the error in each element."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.plugins import method_with_option
from uqmbd.report.charts import Axis, Band, Boxes, Chart, Column, Curve, draw_on_paper
from uqmbd.report.drawing import decades
from uqmbd.report.figures.selection import Results, label_of, nodes_of, of_output
from uqmbd.typing import Array
from uqmbd.wording import format_cells, format_number, typeset_units

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["SplitElements", "elements_chart", "elements_in_words", "has_elements", "split_elements", "split_pattern"]


PROBABILITY = "probability"

SPAN = 1e-3
"""Smallest value on the scale, relative to the largest value; smaller values are rounding errors."""

_BEYOND = 0.001
"""Probability beyond the visible range, at an infinite end of the support."""


def has_elements(node: xr.DataTree) -> bool:
    """Return whether a method split the germ space."""
    return "chaos" in node.children and {"lower", "upper"} <= set(map(str, node.children["chaos"].data_vars))


@typechecked
def split_pattern(results: Results, output: str | None = None) -> Figure:
    """Draw the elements of a multi-element chaos in the plane of the two most frequently split inputs.

    The colour is the largest stated error over time within each element, or the probability if there are no
    verification realisations. With more than two inputs, elements may overlap in this plane, and the largest error is
    on top. For a single input, or a single split input, the height is the error.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of these
        Node of a propagator with elements; if there are several nodes, the first one with elements is drawn.
    output : str, optional
        Output of the stated error; default: the largest error of all outputs.

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
    >>> from uqmbd.results import PiecewiseChaos, PolynomialChaos, propagator_node
    >>> from uqmbd.extend import labels
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
        method = method_with_option("elements", "")
        example = f", such as {method}(elements='adaptive')" if method else ""
        raise StudyError(f"These results contain no elements; use a method with elements{example}.")
    return draw_on_paper(elements_chart(node, output))


def elements_chart(node: xr.DataTree, output: str | None = None) -> Chart:
    """Chart the elements of a method: boxes in the plane of two inputs, or steps along a single split input.

    Raise StudyError if no such output exists.
    """
    found = split_elements(node, output)
    return _steps(found) if found.up is None else _boxes(found, found.up)


class SplitElements(NamedTuple):
    """Elements of a method in the plane of the two most frequently split inputs, or along a single input."""

    names: list[tuple[str, str]]  # name and units of the inputs; the first input is along the horizontal axis
    across: tuple[Array, Array]  # (E,): lower and upper ends of the elements
    up: tuple[Array, Array] | None  # (E,): ends in the other input; None for a single split input
    # (E,): largest stated error of each element, relative to the standard deviation; or probability of the element
    value: Array
    quantity: str  # name of the quantity in `value`
    probability: Array  # (E,)

    @property
    def stated(self) -> bool:
        """Return whether the values are stated errors."""
        return self.quantity != PROBABILITY


def split_elements(node: xr.DataTree, output: str | None = None) -> SplitElements:
    """Return the data of `split_pattern`.

    Raise StudyError if no such output exists.
    """
    data = node.children["chaos"].to_dataset()
    if output is not None:
        of_output(data, output)
    lower, upper = data["lower"].values, data["upper"].values
    value, quantity = _colour(data, output)
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
        quantity,
        np.asarray(data["probability"].values, dtype=float),
    )


def elements_in_words(node: xr.DataTree) -> str:
    """Describe the number of elements, the split inputs, and the position of the smallest elements as text."""
    data = node.children["chaos"].to_dataset()
    counts = _cuts(data["lower"].values, data["upper"].values)
    names = [str(n) for n in data["germ"].values]
    split = [f"{names[k]} at {n} {'place' if n == 1 else 'places'}" for k, n in enumerate(counts) if n]
    text = f"{label_of(node)} split the inputs into {data.sizes['element']} elements"
    if not split:
        return f"{text}: no split was needed."
    rest = [names[k] for k, n in enumerate(counts) if not n]
    text += f": {', '.join(split)}" + (f", {', '.join(rest)} not at all" if rest else "")
    computed = node.attrs.get("elements_computed")
    more = "" if computed is None else f" {int(computed)} elements were computed in total."
    return f"{text}.{more}"


def _cuts(lower: Array, upper: Array) -> list[int]:
    """Return the number of cuts along each germ."""
    inner = [np.setdiff1d(lower[:, k], lower[:, k].min()) for k in range(lower.shape[1])]
    inner += [np.setdiff1d(upper[:, k], upper[:, k].max()) for k in range(lower.shape[1])]
    d = lower.shape[1]
    return [len(np.union1d(inner[k], inner[k + d])) for k in range(d)]


def _colour(data: xr.Dataset, output: str | None) -> tuple[Array, str]:
    """Return the quantity (E,) that the colours of elements represent, and its name."""
    if "verification_error" not in data:
        return np.asarray(data["probability"].values, dtype=float), PROBABILITY
    error = data["verification_error"]
    if output is not None:
        error = error.isel(output=[str(name) for name in data["output"].values].index(output))
    rest = [dim for dim in error.dims if dim != "element"]
    return np.asarray(error.max(rest).values, dtype=float), "stated error / standard deviation"


def _frame(data: xr.Dataset, germ: int, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return the ends of the elements in units of the input; infinite ends are cut to the visible range."""
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
    except StudyError:  # the map from germs to inputs is not stored, so use values of the germ
        return sides[0], sides[1]
    return np.minimum(*found), np.maximum(*found)


def _ends(values: Array) -> tuple[float, float] | None:
    """Return the ends of a colour scale for positive values; None if the values differ by at most 5 %."""
    positive = values[values > 0]
    if not len(positive) or positive.max() <= 1.05 * positive.min():
        return None
    return max(float(positive.min()), SPAN * float(positive.max())), float(positive.max())


def _worst(values: Array) -> int:
    """Return the index of the largest value; NaN is ignored."""
    return int(np.argmax(np.where(np.isnan(values), -np.inf, values)))


def _boxes(found: SplitElements, up: tuple[Array, Array]) -> Chart:
    """Chart the elements as boxes in the plane of two inputs, ordered along the horizontal axis."""
    (x0, x1), (y0, y1) = found.across, up
    order = np.lexsort((y0 + y1, x0 + x1))
    x0, x1, y0, y1 = (side[order] for side in (x0, x1, y0, y1))
    scale, name, units = (100.0, "stated error", "% of std") if found.stated else (1.0, found.quantity, "")
    value = scale * found.value[order]
    (across, across_units), (name_up, units_up) = ((one, typeset_units(unit)) for one, unit in found.names)
    columns = [Column(name, value, units, digits=True)]
    if found.stated:
        columns.append(Column("probability", found.probability[order], "", digits=True))
    bands = (Band(f"{name_up} from, to", y0, y1),)
    curve = Curve("elements", (y0 + y1) / 2, bands, f"centre of {name_up}", columns=tuple(columns))
    ends = _ends(value)
    shades = ends or (0.0, float(np.nanmax(value, initial=0.0)))
    texts = tuple(_range(across, low, high, across_units) for low, high in zip(x0, x1, strict=True))
    return Chart(
        name_up,
        (x0 + x1) / 2,
        [curve],
        units=units_up,
        along=Axis(across, across_units, (float(x0.min()), float(x1.max())), texts=texts),
        ends=(float(y0.min()), float(y1.max())),
        boxes=Boxes(f"{name} in the element", units, x0, x1, value, shades, log=ends is not None),
        start=_worst(value),
    )


def _range(name: str, low: float, high: float, units: str) -> str:
    ends = [format_number(low), format_number(high)]
    if any("×" in end for end in ends):  # write both with the same power of ten
        first, last = format_cells([low, high], units)
        return f"{name} from {first.number} to {last}"
    return f"{name} from {ends[0]} to {ends[1]} {units}".strip()


def _steps(found: SplitElements) -> Chart:
    """Chart the value of each element over the single split input."""
    x0, x1 = found.across
    order = np.argsort(x0)
    value = (100.0 if found.stated else 1.0) * found.value[order]
    ends = _ends(value) if found.stated else None
    name = "stated error" if found.stated else found.quantity
    shown = value if ends is None else np.maximum(value, ends[0])
    up = (0.0, 1.05 * float(np.nanmax(value, initial=0.0)) or 1.0)
    if ends is not None:
        first, last = decades(ends[0], 1.5 * ends[1])
        up = float(f"1e{first}"), float(f"1e{last}")
    return Chart(
        f"{name} in the element",
        np.column_stack([x0[order], x1[order]]).ravel(),
        [Curve("elements", np.repeat(shown, 2), (), name, "filled")],
        units="% of std" if found.stated else "",
        axis=name,
        along=Axis(found.names[0][0], typeset_units(found.names[0][1])),
        ends=up,
        log=ends is not None,
        digits=True,
        start=2 * _worst(value),
    )
