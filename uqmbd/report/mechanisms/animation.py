"""Animation of a mechanism: motion at the means of the inputs, with a cloud of realisations."""

from __future__ import annotations

import gc
import io
import os
import shutil
import subprocess
import tempfile
import time as clock
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import Bounds, Seed, typechecked
from uqmbd.errors import StudyError
from uqmbd.report.mechanisms.deformation import displacement_entries, displacements
from uqmbd.report.mechanisms.film import Film
from uqmbd.report.mechanisms.named_realisations import most_likely_violations, worst_realisations

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from uqmbd.propagation import Study

__all__ = [
    "animate",
    "check_target",
    "gif",
    "integrated_poses",
    "marked_points",
    "motion",
    "moved_axes",
    "observed_bodies",
    "pose_names",
    "poses",
    "with_motion",
]


SECONDS = (3.0, 8.0)
"""Shortest and longest default duration of an animation, s; other motions are slowed down or sped up."""
COLOURS = 80
"""Number of colours of a GIF; fewer colours give a smaller file."""
BUDGET = 4.0
"""Time that a run may spend on realisations that only the picture needs, s."""
STORED = 4_000_000
"""Maximum number of pose values that are stored with results."""


Width: TypeAlias = Annotated[float, Bounds(1, 100)]
"""Width of a picture, inches."""


@typechecked
def motion(
    study: Study,
    samples: Annotated[int, Bounds(0, 10**9)] = 20,
    frames: Annotated[int, Bounds(2, 10**6)] = 60,
    seed: Seed = 1,
    method: str | None = None,
) -> xr.Dataset:
    """Compute the motion of the bodies of a study, for `uqmbd.report.animate` and charts.

    Parameters
    ----------
    study : Study
        Study with at least one output.
    samples : int
        Number of realisations in addition to the realisation at the means of the inputs.
    frames : int
        Number of times, evenly spread over the study.
    seed : int
        Seed of the realisations.
    method : str, optional
        Label of a propagator of the study; its realisations are used. Default: further realisations are integrated.

    Returns
    -------
    xarray.Dataset
        ``pose (realisation, time, body, coordinate)``, ``local (realisation, point, axis)`` and further data of the
        drawing; realisation 0 is the motion at the means.

    Raises
    ------
    uqmbd.StudyError
        If a number is invalid, or the method stores neither samples nor a chaos.
    uqmbd.AssemblyError, uqmbd.IntegrationError
        If the motion of every realisation fails.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd.report import motion
    >>> mechanism = uqmbd.Mechanism("cart", uqmbd.Planar())
    >>> cart = mechanism.body("cart", mass=1, inertia=1, velocity=(2, 0))
    >>> mechanism.output("way", cart.position[0], units="m")
    >>> study = uqmbd.Study("rolling", mechanism, [0, 1])
    >>> data = motion(study, samples=0, frames=3)
    >>> data["pose"].sel(body="cart").values[0, :, 0].round(4).tolist()  # x, m
    [0.0, 1.0, 2.0]
    """
    from uqmbd.report.mechanisms.body_poses import motion as compute

    return compute(study, samples, frames, seed, method)


def observed_bodies(study: Study, frames: int, method: str) -> tuple[xr.DataTree, list[str]]:
    """Run a method again with the outputs `pose_names` at `frames` times; return its node and the names."""
    from uqmbd.report.mechanisms.body_poses import observed_bodies as run

    return run(study, np.linspace(study.times[0], study.times[-1], frames), method)


def pose_names(study: Study) -> list[str]:
    """Return the names of the coordinates of all bodies, sorted by body, and of the displacements `moved_axes`."""
    from uqmbd.report.mechanisms.body_poses import coordinate_names, displacement_names

    own = [name for body in study.mechanism.bodies for name in coordinate_names(study.mechanism, body)]
    return [*own, *displacement_names(study.mechanism, float(study.times[0]))]


def moved_axes(study: Study) -> tuple[int, list[tuple[int, int]]]:
    """Return the number of points that move in their bodies, and index and axis of each of their displacements."""
    from uqmbd.mechanism import collect_skeleton

    start = float(study.times[0])
    count = sum(bool(mark.moving) for mark in collect_skeleton(study.mechanism, start))
    return count, list(displacement_entries(study.mechanism, start))


def integrated_poses(study: Study, frames: int, values: NDArray[np.float64]) -> tuple[NDArray[np.float64], str]:
    """Return the quantities `pose_names` (K, T, name) at inputs (K, d), and the first reason of a failure or no text.

    The quantities are NaN where the integration failed.
    """
    from uqmbd.report.mechanisms.body_poses import integrated

    mechanism = study.mechanism
    q, message = integrated(study, np.linspace(study.times[0], study.times[-1], frames), values)
    entries = list(displacement_entries(mechanism, float(study.times[0])).values())
    bodies = q[..., : len(mechanism.bodies) * mechanism.space.size]
    return (
        np.concatenate([bodies, displacements(mechanism, entries, q, values)], axis=-1) if entries else bodies
    ), message


def marked_points(study: Study, values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the drawn points in body frames at inputs (K, d): points (K, N, axes) and radii (K, N), m."""
    from uqmbd.report.mechanisms.body_poses import marked_points as compute

    return compute(study.mechanism, values, float(study.times[0]))


@typechecked
def animate(data: xr.Dataset, path: str | os.PathLike[str], seconds: float | None = None, width: Width = 6.4) -> Path:
    """Write an animation.

    Parameters
    ----------
    data : xarray.Dataset
        Result of `motion`, or the node ``motion`` of results.
    path : path-like
        Path that ends in ``.gif``, or in ``.mp4``, which requires the program ffmpeg.
    seconds : float, optional
        Duration of the animation, s. Default: duration of the motion, but between 3 and 8 s.
    width : float
        Width, inches; an inch has 100 pixels.

    Returns
    -------
    pathlib.Path
        Path of the file.

    Raises
    ------
    uqmbd.StudyError
        If the path has another ending, ffmpeg is missing, or the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import uqmbd
    >>> from uqmbd.report import animate, motion
    >>> mechanism = uqmbd.Mechanism("cart", uqmbd.Planar())
    >>> cart = mechanism.body("cart", mass=1, inertia=1, velocity=(2, 0))
    >>> mechanism.output("way", cart.position[0], units="m")
    >>> study = uqmbd.Study("rolling", mechanism, [0, 1])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = animate(motion(study, samples=0, frames=3), f"{folder}/cart.gif", seconds=1, width=2)
    ...     print(path.name, path.stat().st_size > 100)
    cart.gif True
    """
    target = check_target(path)
    ending = target.suffix.lower()
    if seconds is not None and not 0 < seconds < 3600:
        raise StudyError(f"The duration of the animation is {seconds:g} s; expected a number between 0 and an hour.")
    program = shutil.which("ffmpeg")
    duration = seconds or _duration(data)
    film = Film(data, width, 100)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}.") as scratch:
            written = Path(scratch) / f"new{ending}"
            if ending == ".gif":
                written.write_bytes(_gif(list(film.frames()), duration))
            else:
                _mp4(film, duration, str(program), written)
            os.replace(written, target)
    except OSError as error:
        raise StudyError(f"The animation cannot be written to {str(target)!r}: {error.strerror or error}.") from error
    return target


def check_target(path: str | os.PathLike[str]) -> Path:
    """Return the file path of an animation after a check that it can be written.

    The path must end in ``.gif`` or ``.mp4``. Raise StudyError for another ending, or for ``.mp4`` if ffmpeg is
    missing.
    """
    target = Path(path)
    ending = target.suffix.lower()
    if ending not in (".gif", ".mp4"):
        raise StudyError(f"An animation is written as .gif or .mp4; {str(target)!r} has neither suffix.")
    if ending == ".mp4" and shutil.which("ffmpeg") is None:
        raise StudyError(
            f"{str(target)!r} needs the program ffmpeg, which is not on the PATH; install it, or write a .gif instead."
        )
    return target


def gif(data: xr.Dataset, width: float = 5.6, resolution: int = 84) -> bytes:
    """Return a small GIF animation for a page.

    `data` is the result of `motion`; `width` is in inches, `resolution` in pixels per inch.
    """
    # disable garbage collection: pictures have thousands of cyclic objects, and it would take a third of the time
    collecting = gc.isenabled()
    gc.disable()
    try:
        return _gif(list(Film(data, width, resolution).frames()), _duration(data))
    finally:
        if collecting:
            gc.enable()


@typechecked
def poses(data: xr.Dataset, time: float | None = None) -> Figure:
    """Draw all realisations of a motion at one time: the realisation at the means, and the others as a cloud.

    Parameters
    ----------
    data : xarray.Dataset
        Result of `motion`, or the node ``motion`` of results.
    time : float, optional
        Time, s. Default: the time of the largest distance between realisations.

    Returns
    -------
    matplotlib.figure.Figure

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd.report import motion, poses
    >>> mechanism = uqmbd.Mechanism("cart", uqmbd.Planar())
    >>> cart = mechanism.body("cart", mass=1, inertia=1, velocity=(2, 0))
    >>> mechanism.output("way", cart.position[0], units="m")
    >>> study = uqmbd.Study("rolling", mechanism, [0, 1])
    >>> figure = poses(motion(study, samples=0, frames=3), time=0.5)
    >>> type(figure).__name__
    'Figure'
    """
    film = Film(data, 6.4, 100)
    times = data["time"].values
    frame = film.widest if time is None else int(np.argmin(abs(times - time)))
    film.canvas.draw(film.shapes(film.canvas.sheet, frame))
    for artist in film.cloud(frame):
        film.canvas.figure.add_artist(artist)
        film.canvas.own(artist)
    film.write_time(frame)
    return film.canvas.figure


@typechecked
def with_motion(tree: xr.DataTree, study: Study) -> tuple[xr.DataTree, str]:
    """Add the node ``motion`` to results, so that their report can animate the mechanism.

    Errors in this function do not end a run.

    Parameters
    ----------
    tree : xarray.DataTree
        Result of a study.
    study : Study
        The study.

    Returns
    -------
    tree : xarray.DataTree
        Result with the node if it could be made; otherwise with the reason as attribute ``no_motion`` for the report.
        A study without output times has no motion, and its results have no such attribute.
    note : str
        Reason why the node is missing; otherwise empty.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd.report import with_motion
    >>> mechanism = uqmbd.Mechanism("cart", uqmbd.Planar())
    >>> cart = mechanism.body("cart", mass=1, inertia=1, velocity=(2, 0))
    >>> mechanism.output("way", cart.position[0], units="m")
    >>> study = uqmbd.Study("rolling", mechanism, [0, 1])
    >>> from uqmbd.results.schema import join_nodes
    >>> tree, note = with_motion(join_nodes([], study="rolling", mechanism="cart"), study)
    >>> "motion" in tree.children, note
    (True, '')
    """
    if len(study.times) < 2:
        return tree.copy(), "the study has no output times, so there is no motion to animate"
    try:
        from uqmbd.report.mechanisms.body_poses import motion as compute

        named = [*most_likely_violations(tree, study), *worst_realisations(tree, study)]
        begin = clock.perf_counter()
        alone = compute(study, samples=0, named=named)
        spent = clock.perf_counter() - begin
        size = alone["pose"].size + (alone["displacement"].size if "displacement" in alone else 0)
        most = min(20.0, BUDGET / max(spent, 1e-3), STORED / max(size, 1))
        data = compute(study, samples=int(most), named=named) if most >= 1 and "input" in alone.coords else alone
    except Exception as error:  # noqa: BLE001 - studies and plugins may raise anything; the results must remain
        reason = f"{type(error).__name__}: {error}"
        without = tree.copy()
        without.attrs["no_motion"] = reason
        return without, reason
    extended = tree.copy()
    extended["motion"] = xr.DataTree(data)
    return extended, ""


def _duration(data: xr.Dataset) -> float:
    times = data["time"].values
    return float(np.clip(times[-1] - times[0], *SECONDS))


def _gif(pictures: Sequence[NDArray[np.uint8]], seconds: float) -> bytes:
    """Encode pictures as GIF with one colour table."""
    from PIL import Image

    shown = [Image.fromarray(picture) for picture in pictures]
    # derive the colour table from pictures at several times, so that no colour is missing
    some = shown[:: max(1, len(shown) // 4)]
    sheet = Image.new("RGB", (some[0].width, sum(one.height for one in some)), "white")
    down = 0
    for one in some:
        sheet.paste(one, (0, down))
        down += one.height
    table = sheet.quantize(COLOURS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    reduced = [one.quantize(palette=table, dither=Image.Dither.NONE) for one in shown]
    each = max(20, round(1000 * seconds / len(reduced)))
    buffer = io.BytesIO()
    # the animation pauses at its end before it starts again
    lasting = [each] * (len(reduced) - 1) + [each + 700]
    reduced[0].save(buffer, "GIF", save_all=True, append_images=reduced[1:], duration=lasting, loop=0, optimize=False)
    return buffer.getvalue()


def _mp4(film: Film, seconds: float, program: str, path: Path) -> None:
    """Encode a film with ffmpeg."""
    pictures = film.frames()
    first = next(pictures)
    high, wide = first.shape[:2]
    rate = f"{film.points.shape[1] / seconds:.4f}"
    command = [program, "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{wide}x{high}"]
    # pad to an even width and height, which the common pixel format yuv420p requires
    command += ["-r", rate, "-i", "-", "-an", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white", "-pix_fmt", "yuv420p"]
    content = b"".join(picture.tobytes() for picture in (first, *pictures))
    done = subprocess.run([*command, str(path)], input=content, capture_output=True, check=False)  # noqa: S603
    if done.returncode or not path.exists():
        reason = done.stderr.decode("utf-8", "replace").strip().splitlines()
        raise StudyError(f"ffmpeg could not write the animation: {reason[-1] if reason else 'it reported no reason'}.")
