"""Frames of a motion: the mechanism at the means of the inputs, and the cloud of other realisations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.report.drawing import mixed
from uqmbd.report.mechanisms.canvas import Canvas, canvas_for, painted
from uqmbd.report.mechanisms.pose_data import PoseData
from uqmbd.report.mechanisms.sheet import Shape, Sheet, hull, sheet_for
from uqmbd.report.mechanisms.sketch import Sketch, world
from uqmbd.report.mechanisms.symbols import Stroke
from uqmbd.typing import Array

__all__ = ["Film"]

OUTLINES = 40_000
"""Maximum number of body outlines in the cloud of an animation; above it, fewer realisations are drawn."""
HIGHEST = 4.6  # inches
THICK = 4.2
"""Width of links, points: thin, so that links do not hide the distance between realisations."""


@dataclass(frozen=True)
class Film:
    """Animation of a motion, which draws its frames in sequence."""

    data: xr.Dataset | PoseData  # result of `motion`, or a drawn pose
    width: float  # inches
    resolution: int  # pixels per inch

    @cached_property
    def sketch(self) -> Sketch:
        """Return the sketch that draws each pose."""
        return Sketch(self.data)

    @cached_property
    def followed(self) -> bool:
        """Return whether the view follows the mechanism, which it does if the travel exceeds four times the size."""
        points = world(self.data)[0][:, self.moving]
        if not points.size:
            return False
        size = np.nanmax(np.ptp(points, axis=1), initial=0.0)
        way = float(np.nanmax(abs(np.nanmean(points, axis=1) - np.nanmean(points[:1], axis=1)), initial=0.0))
        return bool(way > 4 * size > 0)

    @cached_property
    def moving(self) -> list[int]:
        """Return the indices of points that are not fixed to the ground."""
        owners = self.sketch.owners
        return [k for k, kind in enumerate(self.sketch.kinds) if kind != "direction" and owners[k] != "ground"]

    @cached_property
    def points(self) -> Array:
        """Return the drawn points and directions, shape (realisation, time, point, axis)."""
        points = world(self.data)
        outlines = len(self.sketch.bodies) * points.shape[1]
        points = points[: 1 + max(1, OUTLINES // outlines)]
        if self.followed:
            middle = np.nanmean(points[0][:, self.moving], axis=1)
            points[..., self.sketch.placed, :] -= (middle - middle[0])[None, :, None, :]
        return points

    @property
    def bounds(self) -> Array:
        """Return the points that the view must contain, shape (N, axis), m."""
        if not self.followed:
            points = self.sketch.extent(self.points)
        else:
            points = self.points[..., self.moving, :]
        known = points.reshape(-1, points.shape[-1])
        known = known[np.isfinite(known).all(axis=-1)]
        return known if len(known) else np.zeros((1, points.shape[-1]))

    @cached_property
    def canvas(self) -> Canvas:
        """Return axes that contain the whole motion."""
        made = canvas_for(
            self.bounds,
            width=self.width,
            labels=", in the frame that follows the mechanism" if self.followed else "",
        )
        made.figure.set_dpi(self.resolution)
        size = made.figure.get_size_inches()
        count = len(self.points) - 1
        method = self.data.attrs.get("method") or ""
        words = f"{self.data.attrs.get('mechanism', '')}: at the means of the inputs"
        words += f", and {count} realisations" + (f" of {method}" if method else "") if count else ""
        title = made.figure.text(
            0.1 / size[0], 1 - 0.07 / size[1], words, ha="left", va="top", fontsize=9, color="0.15"
        )
        title.set_parse_math(False)
        return made

    @cached_property
    def strokes(self) -> list[Stroke]:
        """Return the symbols as strokes, which are the same at all times."""
        return self.sketch.strokes(self.points[0], sheet_for(self.bounds, self.width, HIGHEST).unit)

    @cached_property
    def corners(self) -> list[tuple[str, list[int]]]:
        """Return the outlines of bodies as indices of points.

        A body has one outline for each line or shape; otherwise its outline contains all its points.
        """
        sketch, found = self.sketch, []
        for body in sketch.bodies:
            boxes = sketch.boxes.get(body, [])
            if body in sketch.lines:
                found += [(body, line) for line in sketch.lines[body]]
            else:
                found += [(body, self._corners_of(points)) for points in boxes or [sketch.points_of(body)]]
        return found

    def _corners_of(self, mine: list[int]) -> list[int]:
        """Return the distinct points of a body, and in the plane the corners of their hull."""
        local = self.data["local"].values[0]
        _, first = np.unique(np.round(local[mine], 9), axis=0, return_index=True)
        mine = [mine[k] for k in sorted(first)]
        if local.shape[-1] == 2 and len(mine) > 2:
            corners = hull(1e3 * local[mine])
            mine = [mine[int(np.argmin(np.hypot(*(1e3 * local[mine] - c).T)))] for c in corners]
        return mine

    @property
    def widest(self) -> int:
        """Return the time index with the largest distance between realisations."""
        kinds = self.sketch.kinds
        # ignore centres of mass: if their positions are random, they do not show the displacement of a body
        seen = [k for k in self.moving if kinds[k] != "com"] or self.moving
        apart = np.nan_to_num(abs(self.points[:, :, seen] - self.points[:1, :, seen]))
        spread = apart.max(axis=(0, 2, 3), initial=0.0)
        return int(np.argmax(spread))

    def shapes(self, sheet: Sheet, frame: int) -> list[Shape]:
        """Return the shapes of the mechanism at the means of its inputs."""
        return self.sketch.draw(sheet, self.points[0, frame], self.strokes, THICK)

    def cloud(self, frame: int) -> list[Any]:
        """Return the bodies of all realisations except the first as thin dark lines above the mechanism."""
        from matplotlib.collections import LineCollection

        made = []
        count = len(self.points) - 1
        alpha = float(np.clip(7.0 / max(count, 1), 0.2, 0.7))
        for (body, corners), outlines in zip(self.corners, self.outlines(self.canvas.sheet, frame), strict=True):
            # draw the cloud of a body of one point above its joint, which would hide it
            width, order = (5.0, 8.0) if len(corners) == 1 else (0.7, 5.45)
            colour = mixed(painted(self.sketch.colour(body)), "#000000", 0.3)
            lines = LineCollection(
                outlines, colors=[colour], linewidths=width, alpha=alpha,
                capstyle="round", joinstyle="round", transform=self.canvas.figure.dpi_scale_trans, zorder=order,
            )  # fmt: skip
            # snapping would move both ends of the line of a single point to the same pixel and hide it
            lines.set_snap(False)
            made.append(lines)
        return made

    def outlines(self, sheet: Sheet, frame: int) -> Iterator[list[Array]]:
        """Yield the lines of the cloud, inches, for each body in the order of `corners`."""
        places = sheet.project(self.points[1:, frame])
        for body, corners in self.corners:
            outlines = []
            for page in places[:, corners]:
                if not np.isfinite(page).all():
                    continue
                if body in self.sketch.lines:
                    outlines.append(page)
                    continue
                shown = hull(page) if sheet.spatial and len(page) > 3 else page
                shown = np.concatenate([shown, shown[:1]]) if len(shown) != 2 else shown
                outlines.append(shown + [[0, 0], *[[1e-3, 0]] * (len(shown) - 1)] if len(corners) == 1 else shown)
            yield outlines

    def write_time(self, frame: int) -> Any:
        """Write the time into the upper right corner."""
        size = self.canvas.figure.get_size_inches()
        text = self.canvas.figure.text(
            1 - 0.12 / size[0], 1 - 0.07 / size[1], "", ha="right", va="top", fontsize=9, color="0.15",
        )  # fmt: skip
        text.set_text(self._time(frame))
        return text

    def _time(self, frame: int) -> str:
        times = self.data["time"].values
        step = float(times[-1] - times[0]) / max(len(times) - 1, 1)
        digits = int(np.clip(1 - np.floor(np.log10(step)), 0, 9)) if step > 0 else 3
        return f"t = {times[frame]:.{digits}f} s"

    def frames(self) -> Iterator[NDArray[np.uint8]]:
        """Yield frames, shape (height, width, 3)."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        made = self.canvas
        canvas: Any = FigureCanvasAgg(made.figure)
        canvas.draw()
        # draw axes and title once, and all other objects, which may move, in every frame
        empty = canvas.copy_from_bbox(made.figure.bbox)
        renderer = canvas.get_renderer()
        text = self.write_time(0)
        # reuse artists at all times, because making an artist takes longer than drawing it
        cached: dict[tuple[Any, ...], list[Any]] = {}
        clouds = [made.own(lines) for lines in self.cloud(0)]
        for frame in range(self.points.shape[1]):
            canvas.restore_region(empty)
            for lines, outlines in zip(clouds, self.outlines(made.sheet, frame), strict=True):
                lines.set_segments(outlines)
            drawn = [*made.artists(self.shapes(made.sheet, frame), cached), *clouds]
            for artist in sorted(drawn, key=lambda one: one.get_zorder()):
                artist.draw(renderer)
            text.set_text(self._time(frame))
            text.draw(renderer)
            seen = np.asarray(canvas.buffer_rgba())
            picture = np.empty((*seen.shape[:2], 3), dtype=np.uint8)
            for colour in range(3):  # copying all three channels at once takes six times as long
                picture[..., colour] = seen[..., colour]
            yield picture
