"""Label the axes of arrays of a propagator: outputs, inputs and times, with units."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uqmbd.arguments import NotNegative, typechecked
from uqmbd.errors import StudyError
from uqmbd.names import SeriesPlace, unwritable

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["InputInfo", "Labels", "OutputInfo", "fixed_width", "labels", "output_index", "output_infos", "time_index"]


@typechecked
@dataclass(frozen=True)
class OutputInfo:
    """Output with its name as declared by the user, its units, and the length of a full turn.

    If `turn` is not 0, the output is an angle, whose values are unwrapped.

    Parameters
    ----------
    name : str
        Name of the output, as declared.
    units : str
        Units of the output; empty if none are stated.
    turn : float
        Length of a turn, in these units; 0 if the output is not an angle.
    place : SeriesPlace, optional
        Place in a series of scalar outputs, such as spectral densities over the frequency.

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
    place: SeriesPlace | None = None


@typechecked
@dataclass(frozen=True)
class InputInfo:
    """Random input with its name, units, and a text on its distribution, such as ``Normal(mu=0.15, sigma=0.003)``.

    Parameters
    ----------
    name : str
        Name of the input, as declared.
    units : str
        Units of the input; empty if none are stated.
    description : str
        Distribution of the input, as text.
    key : bool
        Whether the input is the key of sampled paths (`uqmbd.extend.path_key`), on which no result depends smoothly.

    Examples
    --------
    >>> from uqmbd.extend import InputInfo
    >>> InputInfo("length", "m", "Normal(mu=0.15, sigma=0.003)").units
    'm'
    """

    name: str
    units: str = ""
    description: str = ""
    key: bool = False


_Info = TypeVar("_Info", OutputInfo, InputInfo)


@typechecked
@dataclass(frozen=True, eq=False)
class Labels:
    """Labels of the axes of arrays of a propagator; create them by :func:`labels`.

    Attributes
    ----------
    outputs : tuple of OutputInfo
        Name, units and turn of each output.
    inputs : tuple of InputInfo
        Name, units and distribution of each input.
    times : numpy.ndarray or None
        Output times, s, increasing, shape (T,); None for scalar outputs.

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
        """Length of a full turn of each output, shape (O,); 0 for outputs that are not angles."""
        return np.array([o.turn for o in self.outputs], dtype=float)

    def output_coords(self) -> dict[str, Any]:
        """Return the coordinates ``output``, ``output_units``; for angles ``output_angle``; with times ``time``.

        If outputs belong to series, the coordinates ``output_series``, ``output_position``, ``output_axis`` and
        ``output_axis_units`` contain their places.
        """
        coords: dict[str, Any] = {
            "output": ("output", fixed_width(o.name for o in self.outputs)),
            "output_units": ("output", fixed_width(o.units for o in self.outputs)),
        }
        if np.any(self.turns):
            about = {
                "long_name": "length of a turn of an output that is an angle, else 0",
                "comment": "moments and quantiles of angles refer to the unwrapped angle, which counts turns",
            }
            coords["output_angle"] = ("output", self.turns, about)
        places = [o.place for o in self.outputs]
        if any(places):
            known = [SeriesPlace("", math.nan, "", "") if place is None else place for place in places]
            coords["output_series"] = ("output", fixed_width(x.series for x in known))
            coords["output_position"] = ("output", np.array([x.position for x in known]))
            coords["output_axis"] = ("output", fixed_width(x.axis for x in known))
            coords["output_axis_units"] = ("output", fixed_width(x.units for x in known))
        if self.times is not None:
            coords["time"] = ("time", self.times, {"units": "s", "long_name": "time"})
        return coords

    def input_coords(self) -> dict[str, Any]:
        """Return the coordinates ``input``, ``input_units``, ``input_description``, and ``input_key`` of keys."""
        keys = [i.key for i in self.inputs]
        return ({"input_key": ("input", np.array(keys))} if any(keys) else {}) | {
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
    """Create the labels of the axes of arrays of a propagator.

    Parameters
    ----------
    outputs : iterable of OutputInfo, name, (name, units), or (name, units, turn)
        Outputs; at least one. For an angle, `turn` is the length of a turn in its units.
    inputs : iterable of InputInfo, name, (name, units), or (name, units, description)
        Inputs; may be empty.
    times : array_like or None
        Output times, s, increasing and finite, shape (T,) with T >= 1. None for scalar outputs.

    Returns
    -------
    Labels
        Labels of the axes.

    Raises
    ------
    StudyError
        If a name is empty, contains ``/``, is ``time``, or occurs twice. If a turn is negative or infinite, or times do
        not increase.

    Examples
    --------
    >>> axes = labels([("slider_x", "m"), "turns"], [("length", "m", "Normal(mu=0.15, sigma=0.003)")], [0.0, 0.5])
    >>> axes.shape
    (2, 2)
    >>> labels(["x", "x"], [], [0.0])
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: Output name 'x' occurs twice; expected unique names.
    """
    given_outputs = tuple(_info(OutputInfo, o) for o in outputs)
    given_inputs = tuple(_info(InputInfo, i) for i in inputs)
    _check_names("Output", [o.name for o in given_outputs])
    _check_names("Input", [i.name for i in given_inputs])
    if not given_outputs:
        raise StudyError("No output is given; expected at least one output of a propagator.")
    for output in given_outputs:
        if not (isinstance(output.turn, (int, float)) and 0 <= output.turn < np.inf):
            raise StudyError(
                f"Output {output.name!r}: the length of a turn is {output.turn!r}; expected a positive number, or 0 "
                "for an output that is not an angle."
            )
    if times is None:
        return Labels(given_outputs, given_inputs, None)
    grid = np.array(times, dtype=float)
    if grid.ndim != 1 or grid.size == 0 or not np.all(np.isfinite(grid)) or np.any(np.diff(grid) <= 0.0):
        raise StudyError(
            f"The times (shape {grid.shape}) are invalid; expected a sequence of finite, increasing numbers in s."
        )
    grid.setflags(write=False)
    return Labels(given_outputs, given_inputs, grid)


def output_infos(data: xr.Dataset) -> tuple[OutputInfo, ...]:
    """Read outputs from the coordinates of :meth:`Labels.output_coords`."""
    names, units = data["output"].values, data["output_units"].values
    turns = data["output_angle"].values if "output_angle" in data.coords else np.zeros(len(names))
    places = output_places(data)
    return tuple(
        OutputInfo(str(n), str(u), float(t), p) for n, u, t, p in zip(names, units, turns, places, strict=True)
    )


def output_places(data: xr.Dataset | xr.DataArray) -> list[SeriesPlace | None]:
    """Read the place of each output in its series; None for an output that belongs to no series."""
    if "output_series" not in data.coords:
        return [None] * data["output"].size
    parts = [np.atleast_1d(data[f"output_{name}"].values) for name in ("series", "position", "axis", "axis_units")]
    return [
        SeriesPlace(str(series), float(position), str(axis), str(units)) if series else None
        for series, position, axis, units in zip(*parts, strict=True)
    ]


def output_index(labels: Labels, name: str) -> int:
    """Return the index of an output."""
    names = [o.name for o in labels.outputs]
    if name not in names:
        raise StudyError(f"The results have no output {name!r}; the outputs are {', '.join(names)}.")
    return names.index(name)


def time_index(labels: Labels, time: float | None, *, needed: bool = False) -> tuple[int, ...]:
    """Return the index of a time as a tuple; empty if no time is requested."""
    times = labels.times
    if times is None:
        if time is not None:
            raise StudyError(f"time is {time!r}, but these outputs are scalar outputs without times; omit time.")
        return ()
    if time is None:
        if needed:
            raise StudyError(f"The time is missing; expected an output time from {times[0]:g} s to {times[-1]:g} s.")
        return ()
    nearest = int(np.abs(times - time).argmin())
    if abs(times[nearest] - time) > 1e-9 * max(1.0, abs(float(times[-1] - times[0]))):
        raise StudyError(f"The time {time!r} s is not an output time; the nearest output time is {times[nearest]:g} s.")
    return (nearest,)


def fixed_width(values: Iterable[str]) -> NDArray[np.str_]:
    """Return texts as an array of fixed width, shape (N,)."""
    # fixed-width text is the only string type that netCDF, Zarr and every supported NumPy support
    return np.array([str(v) for v in values], dtype=np.str_)


def _info(kind: type[_Info], given: OutputInfo | InputInfo | str | tuple[Any, ...]) -> _Info:
    if isinstance(given, kind):
        return given
    if isinstance(given, str):
        return kind(given)
    if isinstance(given, tuple) and 1 <= len(given) <= len(fields(kind)):
        return kind(*given)
    raise StudyError(f"The argument is {given!r}; expected a name, a tuple (name, units) or {kind.__name__}.")


def _check_names(kind: str, names: Sequence[str]) -> None:
    for k, name in enumerate(names):
        if not isinstance(name, str) or not name.strip() or "/" in name or name == "time":
            raise StudyError(f"{kind} name {name!r}: expected a non-empty name other than 'time' without '/'.")
        if mark := unwritable(name):
            raise StudyError(f"{kind} name {name!r}: a name must not contain {mark}.")
        if name in names[:k]:
            raise StudyError(f"{kind} name {name!r} occurs twice; expected unique names.")
