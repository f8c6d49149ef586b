"""Pictures of a mechanism: one pose with axes and names, and SVG drawings for pages and notebooks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.report.drawing import Drawing
from uqmbd.report.mechanisms.canvas import Canvas, canvas_for, painted
from uqmbd.report.mechanisms.film import Film
from uqmbd.report.mechanisms.labels import PlacedLabel, placed_names
from uqmbd.report.mechanisms.pose_data import PoseData
from uqmbd.report.mechanisms.sheet import Shape, Sheet, sheet_for
from uqmbd.report.mechanisms.sketch import Sketch, world
from uqmbd.typing import Array
from uqmbd.wording import format_number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from uqmbd.mechanism import Mechanism

__all__ = ["draw_named", "draw_pose", "mechanism", "still"]


@typechecked
def mechanism(mechanism: Mechanism, values: Mapping[str, float] | None = None, time: float = 0.0) -> Figure:
    """Draw a mechanism as assembled: bodies from their known points, joints, springs, drivers and loads.

    The shape of a body is the hull of its joint points, ends of springs, centre of mass and observed points. Components
    of plugins are also drawn from their points and axes. A mechanism that cannot be assembled is drawn in its given
    pose, and the title states this.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism with at least one body.
    values : mapping, optional
        Values of random variables by name; other variables are at their means.
    time : float
        Initial time, s.

    Returns
    -------
    matplotlib.figure.Figure
        Figure with axes in metres of equal scale; the view is plane, or orthographic in space.

    Raises
    ------
    uqmbd.StudyError
        If there is no body, or a value is invalid.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_joints import Revolute
    >>> pendulum = uqmbd.Mechanism("pendulum", uqmbd.Planar())
    >>> rod = pendulum.body("rod", mass=1, inertia=1, position=(0.5, 0))
    >>> pivot = pendulum.add(Revolute("pivot", pendulum.ground, rod, (0, 0), (-0.5, 0)))
    >>> sorted(text.get_text() for text in mechanism(pendulum).texts)
    ['pendulum', 'pivot', 'rod']
    """
    from uqmbd.report.mechanisms.body_poses import drawn_pose

    data = drawn_pose(mechanism, values, time)
    sketch, points = Sketch(data), world(data)[0, 0]
    made = canvas_for(sketch.extent(points))
    shapes = sketch.draw(made.sheet, points)
    made.draw(shapes)
    _write(made, *placed_names(sketch.labels(made.sheet, points), shapes, made.sheet.box))
    note = f"{mechanism.name} – as defined, because it cannot be assembled" if data.attrs["note"] else mechanism.name
    _title(made, note, warning=bool(data.attrs["note"]))
    return made.figure


def _title(made: Canvas, text: str, *, warning: bool) -> None:
    size = made.figure.get_size_inches()
    shown = made.figure.text(
        0.1 / size[0],
        1 - 0.08 / size[1],
        text,
        ha="left",
        va="top",
        fontsize=10,
        color="#B00020" if warning else "0.15",
    )
    shown.set_parse_math(False)


def _write(made: Canvas, names: Sequence[PlacedLabel], lines: Sequence[Shape]) -> None:
    """Write names, each with a thin line to its part if the part is not adjacent."""
    from matplotlib.patheffects import withStroke

    for one in names:
        label = one.label
        x, y = map(float, one.centre)
        text = made.figure.text(
            x, y, label.text, transform=made.figure.dpi_scale_trans, ha="center", va="center",
            fontsize=label.size, color=painted(label.colour), fontweight="bold" if label.bold else "normal", zorder=9,
        )  # fmt: skip
        text.set_parse_math(False)
        text.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
    made.draw(lines)


INCH = 72
WIDTH, LOWEST, HIGHEST = 6.4, 2.6, 4.6  # inches, equal to the size of the player on a wide page


def still(data: xr.Dataset) -> Drawing:
    """Draw a mechanism at the means of its inputs, and other realisations, at the time of their largest distance.

    `data` is the result of `uqmbd.report.motion`, or the node ``motion`` of results.
    """
    film = Film(data, WIDTH, INCH)
    bounds, frame = film.bounds, film.widest
    made, sheet, page = _empty(bounds)
    count = len(film.points) - 1
    alpha = f"{np.clip(5 / max(count, 1), 0.15, 0.6):.2f}"
    for (body, corners), outlines in zip(film.corners, film.outlines(sheet, frame), strict=True):
        looks: dict[str, Any] = {"stroke_width": 5 if len(corners) == 1 else 0.8, "stroke_opacity": alpha}
        for outline in outlines:
            made.line(page(outline), film.sketch.colour(body), **looks)
    _paint(made, film.shapes(sheet, frame), page)
    return made


def draw_named(data: xr.Dataset, realisation: int, time: float) -> Drawing:
    """Draw one realisation at the stored time nearest to a time in s, and the mechanism at the means as an outline."""
    frame = int(np.argmin(np.abs(data["time"].values - time)))
    return still(data.isel(realisation=[realisation, 0], time=[frame]))


def draw_pose(data: PoseData) -> Drawing:
    """Draw a mechanism in one pose, with the names of its bodies and components.

    `data` is the result of `drawn_pose`; a line above the drawing states why the mechanism is not assembled.
    """
    sketch, points = Sketch(data), world(data)[0, 0]
    bounds = sketch.extent(points)
    known = bounds[np.isfinite(bounds).all(axis=-1)]
    bounds = known if len(known) else np.zeros((1, bounds.shape[-1]))
    made, sheet, page = _empty(bounds)
    shapes = sketch.draw(sheet, points)
    _paint(made, shapes, page)
    names, lines = placed_names(sketch.labels(sheet, points), shapes, sheet.box)
    _paint(made, lines, page)
    for one in names:
        x, y = page(one.centre)
        size, weight = one.label.size, "bold" if one.label.bold else None
        made.text(
            round(x, 1), round(y + 0.35 * size, 1), one.label.text, one.label.colour, font_size=size,
            font_weight=weight, text_anchor="middle", stroke="#ffffff", stroke_width=2, paint_order="stroke",
        )  # fmt: skip
    if data.attrs["note"]:
        made.text(6, 12, "as defined, because it cannot be assembled", "limit", font_size=10)
    return made


def _empty(bounds: Array) -> tuple[Drawing, Sheet, Callable[[Array], Array]]:
    """Return a drawing with only a scale, its sheet, and the function from inches on the sheet to the drawing."""
    height = _height(bounds)
    sheet = sheet_for(bounds, WIDTH, height)
    made = Drawing(INCH * WIDTH, INCH * height)

    def page(places: Array) -> Array:
        return INCH * (places * [1, -1] + [0, height])

    _scale(made, sheet, page(np.array([0.15, 0.16])))
    return made, sheet, page


def _paint(made: Drawing, shapes: Iterable[Shape], page: Callable[[Array], Array]) -> None:
    for shape in sorted(shapes, key=lambda one: one.order):
        dashes = None if shape.style == "-" else " ".join(f"{shape.width * x:g}" for x in shape.style[1])
        edge = None if shape.edge == "none" else shape.edge
        opacity = None if shape.alpha == 1 else shape.alpha
        width = None if edge is None or shape.width == 1 else shape.width
        made.line(
            page(shape.vertices), edge, shape.face, closed=shape.closed, stroke_width=width, stroke_dasharray=dashes,
            opacity=opacity,
        )  # fmt: skip


def _height(bounds: Array) -> float:
    if bounds.shape[-1] == 3:
        return HIGHEST
    across, up = np.ptp(bounds, axis=0)
    unit = max(float(across), 0.25 * float(up), 1e-9) / (WIDTH - 1.0)
    return float(np.clip(up / unit + 1.0, LOWEST, HIGHEST))


def _scale(made: Drawing, sheet: Sheet, corner: Array) -> None:
    """Draw a scale bar in metres and, in space, the directions of the axes."""
    longest = 1.3 * sheet.unit
    power = 10.0 ** math.floor(math.log10(longest))
    length = next(x * power for x in (5, 2, 1) if x * power <= longest)
    end = corner + [INCH * length / sheet.unit, 0]
    tick = [0, -0.05 * INCH]
    made.line([corner + tick, corner, end, end + tick], "soft")
    made.text(round(end[0] + 6, 1), round(end[1] + 4, 1), f"{format_number(length)} m", "soft", font_size=12)
    if sheet.spatial:
        origin, *ends = sheet.project(np.concatenate([np.zeros((1, 3)), sheet.unit * np.eye(3)]))
        foot = corner + [0.35 * INCH, -0.59 * INCH]
        for letter, tip in zip("xyz", ends, strict=True):
            along = INCH * (tip - origin) * [1, -1]
            made.line([foot, foot + 0.3 * along], "soft")
            x, y = foot + 0.4 * along + [-2, 4]
            made.text(round(x, 1), round(y, 1), letter, "soft", font_size=12)
