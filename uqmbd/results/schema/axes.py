"""Meaning of the axes of a propagator's arrays: outputs, inputs and times, with their units."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uqmbd.arguments import NotNegative, typechecked
from uqmbd.errors import StudyError
from uqmbd.names import unwritable

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["InputInfo", "Labels", "OutputInfo", "fixed_width", "labels", "output_index", "output_infos", "time_index"]


@typechecked
@dataclass(frozen=True)
class OutputInfo:
    """An output: its name as the user wrote it, its units (empty: none stated), and how long a turn is in these.

    `turn` is 0 unless the output is an angle; its values are unwrapped then.

    Parameters
    ----------
    name : str
        As the user wrote it.
    units : str
        Empty: none stated.
    turn : float
        Length of a turn, in these units; 0: it is no angle.

    Examples
    --------
    >>> import math
    >>> from uqmbd.extend import OutputInfo
    >>> OutputInfo("angle", "rad", turn=2 * math.pi).turn > OutputInfo("height", "m").turn
    True
    """

    name: str
    units: str = ""
    turn: NotNegative = 0.0


@typechecked
@dataclass(frozen=True)
class InputInfo:
    """A random input: its name, units, and its distribution in words, as in ``Normal(mu=0.15, sigma=0.003)``.

    Parameters
    ----------
    name : str
        As the user wrote it.
    units : str
        Empty: none stated.
    description : str
        Its distribution in words.

    Examples
    --------
    >>> from uqmbd.extend import InputInfo
    >>> InputInfo("length", "m", "Normal(mu=0.15, sigma=0.003)").units
    'm'
    """

    name: str
    units: str = ""
    description: str = ""


_Info = TypeVar("_Info", OutputInfo, InputInfo)


@typechecked
@dataclass(frozen=True, eq=False)
class Labels:
    """Meaning of the axes of a propagator's arrays; :func:`labels` makes it.

    Attributes
    ----------
    outputs : tuple of OutputInfo
    inputs : tuple of InputInfo
    times : numpy.ndarray or None
        Increasing, shape (T,), in seconds; None for outputs without a time.

    Examples
    --------
    >>> from uqmbd.extend import labels
    >>> axes = labels([("height", "m")], [("speed", "m/s")], [0.0, 0.5, 1.0])
    >>> axes.dims, axes.shape, axes.turns.tolist()
    (('output', 'time'), (1, 3), [0.0])
    >>> labels([("height", "m")], [("speed", "m/s")], None).dims  # without a time
    ('output',)
    """

    outputs: tuple[OutputInfo, ...]
    inputs: tuple[InputInfo, ...]
    times: NDArray[np.float64] | None

    @property
    def dims(self) -> tuple[str, ...]:
        """Dimensions of a statistic: ``("output", "time")``, or ``("output",)`` without times."""
        return ("output",) if self.times is None else ("output", "time")

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of a statistic: the sizes of :attr:`dims`."""
        return (len(self.outputs),) if self.times is None else (len(self.outputs), len(self.times))

    @property
    def turns(self) -> NDArray[np.float64]:
        """Length of a turn of each output, shape (O,): 0 unless it is an angle."""
        return np.array([o.turn for o in self.outputs], dtype=float)

    def output_coords(self) -> dict[str, Any]:
        """Return the coordinates ``output``, ``output_units``; for angles ``output_angle``; with times ``time``."""
        coords: dict[str, Any] = {
            "output": ("output", fixed_width(o.name for o in self.outputs)),
            "output_units": ("output", fixed_width(o.units for o in self.outputs)),
        }
        if np.any(self.turns):
            about = {
                "long_name": "length of a turn of an output that is an angle, else 0",
                "comment": "moments and quantiles of angles are those of the unwrapped angle, which counts turns",
            }
            coords["output_angle"] = ("output", self.turns, about)
        if self.times is not None:
            coords["time"] = ("time", self.times, {"units": "s", "long_name": "time"})
        return coords

    def input_coords(self) -> dict[str, Any]:
        """Return the coordinates ``input``, ``input_units`` and ``input_description``."""
        return {
            "input": ("input", fixed_width(i.name for i in self.inputs)),
            "input_units": ("input", fixed_width(i.units for i in self.inputs)),
            "input_description": ("input", fixed_width(i.description for i in self.inputs)),
        }


@typechecked
def labels(
    outputs: Iterable[OutputInfo | str | tuple[str, str] | tuple[str, str, Any]],
    inputs: Iterable[InputInfo | str | tuple[str, str] | tuple[str, str, str]],
    times: ArrayLike | None,
) -> Labels:
    """State the meaning of the axes of a propagator's arrays once.

    Parameters
    ----------
    outputs : iterable of OutputInfo, name, (name, units), or (name, units, turn)
        At least one. The length of a turn, in the units, is stated for angles.
    inputs : iterable of InputInfo, name, (name, units), or (name, units, description)
        May be empty.
    times : array_like or None
        Increasing finite times in seconds, shape (T,) with T >= 1; None for outputs without a time.

    Returns
    -------
    Labels

    Raises
    ------
    StudyError
        If a name is empty, contains ``/``, is ``time`` or occurs twice, a turn has no length, or if the times do not
        increase.

    Examples
    --------
    >>> axes = labels([("slider_x", "m"), "turns"], [("length", "m", "Normal(mu=0.15, sigma=0.003)")], [0.0, 0.5])
    >>> axes.shape
    (2, 2)
    >>> labels(["x", "x"], [], [0.0])
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: Output names must be unique: 'x' occurs twice.
    """
    given_outputs = tuple(_info(OutputInfo, o) for o in outputs)
    given_inputs = tuple(_info(InputInfo, i) for i in inputs)
    _check_names("Output", [o.name for o in given_outputs])
    _check_names("Input", [i.name for i in given_inputs])
    if not given_outputs:
        raise StudyError("A propagator needs at least one output; none was given.")
    for output in given_outputs:
        if not (isinstance(output.turn, (int, float)) and 0 <= output.turn < np.inf):
            raise StudyError(
                f"Output {output.name!r}: the length of a turn is {output.turn!r}; a positive number is expected, "
                "or 0 if it is no angle."
            )
    if times is None:
        return Labels(given_outputs, given_inputs, None)
    grid = np.array(times, dtype=float)
    if grid.ndim != 1 or grid.size == 0 or not np.all(np.isfinite(grid)) or np.any(np.diff(grid) <= 0.0):
        raise StudyError(
            f"Times must be a list of finite, increasing numbers (in seconds); shape {grid.shape} was given."
        )
    grid.setflags(write=False)
    return Labels(given_outputs, given_inputs, grid)


def output_infos(data: xr.Dataset) -> tuple[OutputInfo, ...]:
    """Read outputs from the coordinates that :meth:`Labels.output_coords` made."""
    names, units = data["output"].values, data["output_units"].values
    turns = data["output_angle"].values if "output_angle" in data.coords else np.zeros(len(names))
    return tuple(OutputInfo(str(n), str(u), float(t)) for n, u, t in zip(names, units, turns, strict=True))


def output_index(labels: Labels, name: str) -> int:
    """Return the number of an output."""
    names = [o.name for o in labels.outputs]
    if name not in names:
        raise StudyError(f"There is no output {name!r}; there are {', '.join(names)}.")
    return names.index(name)


def time_index(labels: Labels, time: float | None, *, needed: bool = False) -> tuple[int, ...]:
    """Return the index of a time; None if none is requested."""
    times = labels.times
    if times is None:
        if time is not None:
            raise StudyError(f"These outputs have no times; time = {time!r} was given.")
        return ()
    if time is None:
        if needed:
            raise StudyError(f"A time is needed, from {times[0]:g} s to {times[-1]:g} s.")
        return ()
    nearest = int(np.abs(times - time).argmin())
    if abs(times[nearest] - time) > 1e-9 * max(1.0, abs(float(times[-1] - times[0]))):
        raise StudyError(f"Time {time!r} s is none of the times; the nearest is {times[nearest]:g} s.")
    return (nearest,)


def fixed_width(values: Iterable[str]) -> NDArray[np.str_]:
    """Return texts as an array of fixed width, shape (N,)."""
    # Fixed-width text: the one string type that netCDF, Zarr and every supported NumPy agree on.
    return np.array([str(v) for v in values], dtype=np.str_)


def _info(kind: type[_Info], given: OutputInfo | InputInfo | str | tuple[Any, ...]) -> _Info:
    if isinstance(given, kind):
        return given
    if isinstance(given, str):
        return kind(given)
    if isinstance(given, tuple) and 1 <= len(given) <= len(fields(kind)):
        return kind(*given)
    raise StudyError(f"A name, a tuple (name, units) or {kind.__name__} is expected; {given!r} was given.")


def _check_names(kind: str, names: Sequence[str]) -> None:
    for k, name in enumerate(names):
        if not isinstance(name, str) or not name.strip() or "/" in name or name == "time":
            raise StudyError(f"{kind} names must not be empty, contain '/' or be 'time'; {name!r} was given.")
        if mark := unwritable(name):
            raise StudyError(f"{kind} name {name!r}: a name cannot contain {mark}.")
        if name in names[:k]:
            raise StudyError(f"{kind} names must be unique: {name!r} occurs twice.")
