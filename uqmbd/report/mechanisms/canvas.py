"""Canvas of a mechanism drawing: axes in metres with equal scale, and a page in inches above them.

Shapes have sizes in inches, so that joints look the same for every size of mechanism and in every file format. The
positions of shapes follow from the axes, plane or spatial.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.report.drawing import ROLES
from uqmbd.report.mechanisms.sheet import MARGIN, VIEW, Shape, Sheet
from uqmbd.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Canvas", "canvas_for", "painted"]


LEFT, RIGHT, BOTTOM, TOP = 0.72, 0.15, 0.5, 0.34  # inches around the axes
SIDES = 0.68  # inches around the box of a spatial view, for ticks and labels
LOWEST, HIGHEST = 1.9, 5.2  # inches: height of plane axes


def painted(role: str | None) -> str:
    """Return the colour of a role in a figure."""
    if role is not None and role.startswith("#"):
        return role
    return "none" if role in (None, "none") else ROLES[str(role)][0]


@dataclass(frozen=True)
class Canvas:
    """Axes and page of a mechanism drawing."""

    figure: Figure
    axes: Axes
    sheet: Sheet  # positions of points on the page

    def artists(self, shapes: Iterable[Shape], cached: dict[tuple[Any, ...], list[Any]] | None = None) -> list[Any]:
        """Make the Matplotlib artists, from back to front, without adding them to the figure.

        `cached` contains artists of earlier calls by style, which are moved and reused; new artists are added to it.
        """
        from matplotlib.patches import PathPatch
        from matplotlib.path import Path

        cached = {} if cached is None else cached
        taken: Counter[tuple[Any, ...]] = Counter()
        made: list[Any] = []
        for shape in sorted(shapes, key=lambda s: s.order):
            vertices = shape.vertices
            if shape.closed:
                codes = [Path.MOVETO, *[Path.LINETO] * (len(vertices) - 1), Path.CLOSEPOLY]
                path = Path(np.concatenate([vertices, vertices[:1]]), codes)
            else:
                path = Path(vertices)
            looks = (shape.edge, shape.face, shape.width, shape.style, shape.order, shape.alpha)
            alike = cached.setdefault(looks, [])
            if taken[looks] == len(alike):
                patch = PathPatch(
                    path, edgecolor=painted(shape.edge), facecolor=painted(shape.face), lw=shape.width,
                    ls=shape.style, alpha=shape.alpha, capstyle="round", joinstyle="round", zorder=2 + shape.order,
                    transform=self.figure.dpi_scale_trans,
                )  # fmt: skip
                alike.append(self.own(patch))
            alike[taken[looks]].set_path(path)
            made.append(alike[taken[looks]])
            taken[looks] += 1
        return made

    def own(self, artist: Any) -> Any:
        """Attach an artist to the figure, and clip it to plane axes."""
        artist.set_figure(self.figure)
        if not self.sheet.spatial:
            artist.set_clip_path(self.axes.patch)
        return artist

    def draw(self, shapes: Iterable[Shape]) -> None:
        """Add shapes to the figure."""
        for artist in self.artists(shapes):
            clip = artist.get_clip_path()
            self.figure.add_artist(artist)
            artist.set_clip_path(clip)


def canvas_for(points: Array, *, width: float = 6.4, labels: str = "") -> Canvas:
    """Make axes that contain all points.

    `points` (N, 2 or 3) are in m; points that are not finite are ignored. `width` is the width of the figure, inches.
    `labels` is the text after the letter of the axes.

    >>> import numpy as np
    >>> made = canvas_for(np.array([[0.0, 0.0], [2.0, 0.5]]))
    >>> a, b, c = made.sheet.project(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    >>> bool(np.isclose(b[0] - a[0], c[1] - a[1]))
    True
    """
    known = points[np.isfinite(points).all(axis=-1)]
    if not len(known):
        known = np.zeros((1, points.shape[-1]))
    low, high = known.min(axis=0), known.max(axis=0)
    return _space(low, high, width, labels) if points.shape[-1] == 3 else _plane(low, high, width, labels)


def _plane(low: Array, high: Array, width: float, labels: str) -> Canvas:
    from matplotlib.figure import Figure

    inner = width - LEFT - RIGHT
    size = high - low
    floor = 1e-9 + 0.25 * float(size.max()) if size.max() > 0 else 0.5
    unit = max(float(size[0]), floor) / (inner - 2 * MARGIN)
    height = float(np.clip(size[1] / unit + 2 * MARGIN, LOWEST, HIGHEST))
    unit = max(unit, float(size[1]) / (height - 2 * MARGIN))
    centre = (low + high) / 2
    figure = Figure(figsize=(width, height + BOTTOM + TOP))
    whole = height + BOTTOM + TOP
    axes = figure.add_axes((LEFT / width, BOTTOM / whole, inner / width, height / whole))
    axes.set_xlim(centre[0] - unit * inner / 2, centre[0] + unit * inner / 2)
    axes.set_ylim(centre[1] - unit * height / 2, centre[1] + unit * height / 2)
    axes.set_aspect("equal")
    axes.grid(color="0.93", lw=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8.5, colors="0.35")
    axes.set_xlabel(f"x{labels} [m]", fontsize=9, color="0.25")
    axes.set_ylabel(f"y{labels} [m]", fontsize=9, color="0.25")
    # fixed positions of the labels save the measurement of ticks
    axes.xaxis.set_label_coords(0.5, -0.27 / height)
    axes.yaxis.set_label_coords(-0.5 / inner, 0.5)
    corner = np.array([axes.get_xlim()[0], axes.get_ylim()[0]])

    def project(points: Array) -> Array:
        page: Array = np.array([LEFT, BOTTOM]) + (points - corner) / unit
        return page

    def depth(points: Array) -> Array:
        return np.zeros(points.shape[:-1])

    box = (LEFT, BOTTOM, width - RIGHT, BOTTOM + height)
    return Canvas(figure, axes, Sheet(project, depth, unit, box, spatial=False))


def _space(low: Array, high: Array, width: float, labels: str) -> Canvas:
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]

    reach = float((high - low).max()) or 0.5
    half = np.maximum((high - low) / 2, 0.2 * reach) * 1.15
    centre = (low + high) / 2
    figure = Figure(figsize=(width, width))
    axes: Any = Axes3D(
        figure, (0.0, 0.0, 1.0, 1.0), computed_zorder=False, proj_type="ortho", azim=VIEW[1], elev=VIEW[0]
    )
    figure.add_axes(axes)
    for name, middle, extent in zip("xyz", centre, half, strict=True):
        getattr(axes, f"set_{name}lim")(middle - extent, middle + extent)
        axis: Any = getattr(axes, f"{name}axis")
        axis.set_pane_color((0.97, 0.975, 0.98, 1.0))
        axis._axinfo["grid"].update(color="0.9", linewidth=0.7)
        axis.set_tick_params(labelsize=8, colors="0.35", pad=1)
        axis.set_major_locator(_few())
        getattr(axes, f"set_{name}label")(f"{name}{labels} [m]", fontsize=9, color="0.25")
    axes.set_box_aspect(tuple(half))
    # pass a tuple, because Matplotlib would scale an array in place
    corners = centre + half * np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    across, up = np.ptp(_onto_page(figure, axes)(corners)[0], axis=0)
    # enlarge the box until its ticks and labels just fit, because mplot3d has wide margins
    zoom = min((width - 2 * SIDES) / across, (0.9 * width - 2 * SIDES) / up)
    height = zoom * float(up) + 2 * SIDES
    figure.set_figheight(height)
    # shift the axes to the left, because the labels of the vertical axis are on the right
    axes.set_position((-0.18 / width, (height - width) / 2 / height, 1.0, width / height))
    axes.set_box_aspect(tuple(half), zoom=zoom)
    along = _onto_page(figure, axes)

    def project(points: Array) -> Array:
        return along(points)[0]

    def depth(points: Array) -> Array:
        return along(points)[1]

    ends = project(np.concatenate([centre[None], centre + reach * np.eye(3)]))
    # in an orthographic view of equal scale, the squared lengths of projected unit vectors add up to two
    inches = np.sqrt(np.sum((ends[1:] - ends[0]) ** 2) / 2) / reach
    box = (0.1, 0.1, width - 0.1, height - TOP)
    return Canvas(figure, axes, Sheet(project, depth, 1 / float(inches), box, spatial=True))


def _onto_page(figure: Figure, axes: Any) -> Callable[[Array], tuple[Array, Array]]:
    """Return the function that maps points in space (..., 3) to the page (..., 2), inches, and to their depth."""
    from mpl_toolkits.mplot3d import proj3d

    axes.apply_aspect()
    matrix = axes.get_proj()
    to_inches = (axes.transData + figure.dpi_scale_trans.inverted()).frozen()

    def along(points: Array) -> tuple[Array, Array]:
        flat = points.reshape(-1, 3)
        x, y, z = proj3d.proj_transform(flat[:, 0], flat[:, 1], flat[:, 2], matrix)
        page = to_inches.transform(np.column_stack([x, y]))
        return page.reshape(*points.shape[:-1], 2), np.asarray(z, dtype=float).reshape(points.shape[:-1])

    return along


def _few() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10])
