"""A picture of a mechanism in one pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from uqmbd.arguments import typechecked
from uqmbd.report.mechanisms.canvas import Canvas, canvas_for, painted
from uqmbd.report.mechanisms.labels import Placed, placed_names
from uqmbd.report.mechanisms.sheet import Shape
from uqmbd.report.mechanisms.sketch import Sketch, world

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from uqmbd.mechanism import Mechanism

__all__ = ["mechanism"]


@typechecked
def mechanism(mechanism: Mechanism, values: Mapping[str, float] | None = None, time: float = 0.0) -> Figure:
    """Draw a mechanism as it is assembled: bodies from what is known of them, joints, springs, drivers and loads.

    A body is what its joint points, ends of springs, centre of mass and observed points span.  Components of plugins
    are drawn from their points and axes, too.  A mechanism that cannot be assembled is shown as drawn, and the title
    says so.

    Parameters
    ----------
    mechanism : Mechanism
        With at least one body.
    values : mapping, optional
        Values of random variables by name; the others are at their means.
    time : float
        Initial time, s.

    Returns
    -------
    matplotlib.figure.Figure
        Axes in metres, of equal scale; a plane view, in space an orthographic one.

    Raises
    ------
    uqmbd.StudyError
        If there is no body, or a value cannot be used.

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
    note = f"{mechanism.name} – as drawn: it cannot be assembled" if data.attrs["note"] else mechanism.name
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


def _write(made: Canvas, names: Sequence[Placed], lines: Sequence[Shape]) -> None:
    """Write names, and a thin line to what they name where that is not at hand."""
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
