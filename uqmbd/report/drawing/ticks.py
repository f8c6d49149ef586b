"""Replace ticks by plain texts and marks before a figure is written, which is faster."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from uqmbd.report.drawing.style import is_arranged, tick_width

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["freeze_ticks"]


def freeze_ticks(figure: Figure) -> None:
    """Replace the ticks, grids and labels of two-dimensional axes by texts and lines with the same appearance.

    Matplotlib makes and measures five objects for every tick, which takes most of the time of a small figure. The
    limits of the axes must not change afterwards. The function supports major ticks at one side of each axis.

    >>> from matplotlib.figure import Figure
    >>> figure = Figure()
    >>> axes = figure.add_subplot()
    >>> axes.set_ylabel("x [m]") and None
    >>> freeze_ticks(figure)
    >>> [text.get_text() for text in axes.texts][-1]
    'x [m]'
    """
    if is_arranged(figure):
        figure.set_layout_engine("none")
        _label_at_rest(figure)
    for axes in figure.axes:
        if hasattr(axes, "get_zlim"):
            continue  # three-dimensional axes draw their own ticks
        axes.axis(axes.axis())  # fix the current limits
        _freeze(axes, "x")
        _freeze(axes, "y")


def _label_at_rest(figure: Figure) -> None:
    """Align the axis labels of each column of a grid, beyond the widest tick label of the column."""
    width, height = figure.get_size_inches()
    columns: dict[int, list[Axes]] = {}
    for axes in figure.axes:
        if (cell := axes.get_subplotspec()) is not None:
            columns.setdefault(cell.colspan.start, []).append(axes)
    for column in columns.values():
        room = max(tick_width(axes.yaxis) for axes in column)
        for axes in column:
            place = axes.get_position()
            axes.yaxis.set_label_coords(-room / (place.width * width), 0.5)
            axes.xaxis.set_label_coords(0.5, -0.26 / (place.height * height))


def _freeze(axes: Axes, direction: str) -> None:
    from matplotlib.transforms import ScaledTranslation

    across = direction == "x"
    axis: Any = axes.xaxis if across else axes.yaxis
    shown = axis.get_tick_params(which="major")
    low, high = sorted(axis.get_view_interval())
    places = list(axis.get_majorticklocs())
    texts = axis.get_major_formatter().format_ticks(places)
    slack = 1e-9 * (high - low)
    ticks = [(p, text) for p, text in zip(places, texts, strict=True) if low - slack <= p <= high + slack]
    transform = axes.get_xaxis_transform() if across else axes.get_yaxis_transform()
    far = not across and bool(shown.get("labelright"))
    end, sign = (1.0, 1) if far else (0.0, -1)
    size = shown.get("labelsize", 9)
    where = [p for p, _ in ticks]
    if where and shown.get("gridOn"):
        lines = axes.vlines if across else axes.hlines
        grid: dict[str, Any] = {"color": shown.get("grid_color", "0.9"), "lw": shown.get("grid_linewidth", 0.7)}
        lines(where, 0, 1, transform=transform, zorder=0.5, **grid)
    if where:
        marker = 3 if across else (1 if far else 0)  # ticks downwards, to the right, to the left
        xs, ys = (where, [end] * len(where)) if across else ([end] * len(where), where)
        axes.plot(xs, ys, ls="", marker=marker, ms=3.5, mew=0.8, color="black", transform=transform, clip_on=False)
    # distance from the axis: a mark of 3.5 points and a gap of 3.5 points
    shift = ScaledTranslation(0 if across else sign * 7 / 72, -7 / 72 if across else 0, axes.figure.dpi_scale_trans)
    if shown.get("labelbottom", shown.get("labelleft", True)) or far:
        side: dict[str, Any] = (
            {"ha": "center", "va": "top"} if across else {"ha": "left" if far else "right", "va": "center_baseline"}
        )
        for place, text in ticks:
            at = (place, end) if across else (end, place)
            axes.text(at[0], at[1], text, transform=transform + shift, fontsize=size, **side)
    offset = axis.get_major_formatter().get_offset()
    if offset:
        drop = ScaledTranslation(0, -20 / 72 if across else 4 / 72, axes.figure.dpi_scale_trans)
        corner, sides = ((1, 0), ("right", "top")) if across else ((0, 1), ("left", "bottom"))
        axes.text(corner[0], corner[1], offset, transform=axes.transAxes + drop, fontsize=9, ha=sides[0], va=sides[1])
    label = axis.label
    if label.get_text():
        x, y = label.get_position()
        axes.text(
            x,
            y,
            label.get_text(),
            transform=label.get_transform(),
            fontsize=label.get_fontsize(),
            rotation=label.get_rotation(),
            rotation_mode=label.get_rotation_mode(),
            ha=label.get_ha(),
            va=label.get_va(),
        )
    axis.set_visible(False)
