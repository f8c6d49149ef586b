"""Checks of the options that studies and simulations share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Sized
from numbers import Real
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.dynamics import built_in_names, installed_integrators
from uqmbd.errors import StudyError
from uqmbd.typing import Array
from uqmbd.units import without_quantities

if TYPE_CHECKING:
    from uqmbd.mechanism import Mechanism

__all__ = [
    "STARTS",
    "check_breaks",
    "check_folder",
    "check_integrator",
    "check_max_step",
    "check_report_times",
    "check_rtol",
    "check_start",
    "check_timeless",
    "check_times",
]


STARTS = ("drawn", "equilibrium")
"""Possible initial configurations of realisations."""


LONGEST, SHORTEST = 1e30, 1e-9
"""Largest time, and smallest distance between times, s: beyond these limits, steps leave the range of numbers."""

APART = 1e-14
"""Relative distance of times below which a step is smaller than the rounding error of time."""

MOST = 10**7
"""Maximum number of times: one output at these times has 80 MB."""

NAMED = 5
"""Maximum number of outputs in a message."""


def _real(value: Any) -> float:
    """Return a number of Python or NumPy as a float, infinite beyond 64 bits; NaN for anything else."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, Real):
        return float("nan")
    try:
        return float(value)
    except OverflowError:  # an integer may have hundreds of digits
        return float("inf")


def _some(times: Any, where: str) -> None:
    """Reject huge arrays, and arrays with masked entries."""
    if isinstance(times, Mapping):
        raise StudyError(f"{where} are {times!r:.80}; expected a sequence of numbers in s, e.g. [0.4].")
    size = 0
    if getattr(times, "ndim", None) != 0:  # an array without dimensions has no length, although its class has a length
        size = times.size if isinstance(times, np.ndarray) else len(times) if isinstance(times, Sized) else 0
    if size > MOST:
        raise StudyError(f"{where} are {size}; expected at most {MOST}.")
    if np.ma.is_masked(times):
        raise StudyError(f"{where} are {times!r}; expected numbers in s without masked values.")


def check_times(times: ArrayLike, where: str) -> Array:
    """Return output times as an array after a check."""
    times = without_quantities(f"{where}: times", times, "s")
    _some(times, f"{where}: times")
    try:
        grid = np.array(times, dtype=float)
        if any(isinstance(x, (str, bytes)) for x in np.asarray(times, dtype=object).ravel().tolist()):
            raise TypeError  # NumPy would read texts as numbers
    except (TypeError, ValueError, OverflowError):
        raise StudyError(
            f"{where}: times are {times!r}; expected numbers in s, e.g. numpy.linspace(0, 2, 401)."
        ) from None
    if grid.ndim != 1 or len(grid) < 2:
        raise StudyError(
            f"{where}: times have shape {grid.shape}; expected a one-dimensional sequence of at least two numbers, "
            "e.g. numpy.linspace(0, 2, 401)."
        )
    if np.asarray(times).dtype == bool:
        raise StudyError(f"{where}: times are {times!r}; expected numbers in s, e.g. numpy.linspace(0, 2, 401).")
    if not np.isfinite(grid).all():
        raise StudyError(f"{where}: times[{int(np.argmin(np.isfinite(grid)))}] is not finite; expected numbers in s.")
    wrong = np.flatnonzero(np.diff(grid) <= 0)
    if len(wrong):
        k = int(wrong[0])
        raise StudyError(
            f"{where}: times do not increase: times[{k}] is {grid[k]:g}, and times[{k + 1}] is {grid[k + 1]:g}; "
            "expected increasing output times."
        )
    steps, size = np.diff(grid), float(np.abs(grid).max())
    if size > LONGEST:
        raise StudyError(
            f"{where}: the largest of the times is {size:.3g} s; expected at most {LONGEST:g} s. Choose a larger unit "
            "of time."
        )
    if steps.min() < (least := max(SHORTEST, APART * size)):
        k = int(np.argmin(steps))
        # another unit of time changes both sides of the relative limit
        remedy = ", or choose a smaller unit of time" if steps[k] >= APART * size else ""
        raise StudyError(
            f"{where}: times[{k}] and times[{k + 1}] differ by {steps[k]:.3g} s; expected at least {least:.3g} s for "
            f"times up to {size:.3g} s. Remove one of the two times{remedy}."
        )
    grid.setflags(write=False)
    return grid


def check_timeless(mechanism: Mechanism, where: str) -> Array:
    """Return the single time 0 s of a study without output times; raise StudyError if outputs require times."""
    from uqmbd.mechanism import MotionSymbol

    timeless = (*mechanism.scalars.values(), *mechanism.margins.values())
    needing = [*mechanism.outputs, *(name for name, one in mechanism.requirements.items() if one.over_time)]
    needing += [o.name for o in timeless if o.name not in needing and o.expression.atoms(MotionSymbol)]
    if needing:
        more = f" and {len(needing) - NAMED} more" if len(needing) > NAMED else ""
        raise StudyError(
            f"{where}: times are missing; expected output times in s, e.g. times=numpy.linspace(0, 2, 401), for "
            f"{', '.join(map(repr, needing[:NAMED]))}{more}. Omit times only if no output depends on the motion, "
            "e.g. for eigenfrequencies."
        )
    grid = np.zeros(1)
    grid.setflags(write=False)
    return grid


def check_rtol(rtol: Any, where: str) -> float:
    """Return a relative tolerance after a check."""
    if not 1e-13 <= _real(rtol) <= 1e-1:
        raise StudyError(f"{where}: rtol is {rtol!r}; expected a number between 1e-13 and 0.1, e.g. 1e-6.")
    return float(rtol)


def check_integrator(integrator: str, where: str) -> str:
    """Return the name of an integrator after a check; the error on an unknown name lists the known names."""
    # integrators of the core do not require the load of plugins
    if isinstance(integrator, str) and (integrator in built_in_names() or integrator in installed_integrators()):
        return integrator
    raise StudyError(f"{where}: integrator is {integrator!r}; expected one of: {', '.join(installed_integrators())}.")


def check_max_step(max_step: Any, where: str) -> float:
    """Check the longest step, and return it in s; infinite without a limit."""
    max_step = without_quantities(f"{where}: max_step", max_step, "s")
    if max_step is None:
        return float("inf")
    if not 0 < _real(max_step) < float("inf"):
        raise StudyError(
            f"{where}: max_step is {max_step!r}; expected the largest integration step in s, a finite number above 0 "
            "such as 1e-3, or None for no limit."
        )
    return float(max_step)


def check_breaks(breaks: Any, where: str) -> tuple[float, ...]:
    """Check the times of integration restarts, and return them sorted, in s."""
    expectation = "expected times in s at which the integration restarts, e.g. breaks=[0.2, 0.21]"
    breaks = without_quantities(f"{where}: breaks", breaks, "s")
    single = getattr(breaks, "ndim", None) == 0
    if isinstance(breaks, (str, bytes)) or not isinstance(breaks, (Iterable, np.ndarray)) or single:
        raise StudyError(f"{where}: breaks are {breaks!r}; {expectation}.")
    _some(breaks, f"{where}: breaks")
    found = []
    for given in breaks:
        time = given.item() if getattr(given, "ndim", None) == 0 and hasattr(given, "item") else given
        if not np.isfinite(_real(time)):
            raise StudyError(f"{where}: breaks contain {time!r}; {expectation}, each a finite number.")
        found.append(float(time))
    return tuple(sorted(set(found)))


def check_start(start: str, where: str) -> str:
    """Return the initial configuration of realisations after a check against the possible choices."""
    if not isinstance(start, str) or start not in STARTS:
        raise StudyError(
            f"{where}: start is {start!r}; expected 'drawn' (the pose assembled from the given pose) or "
            "'equilibrium' (the static equilibrium of each realisation)."
        )
    return start


def check_report_times(times: Sequence[float], grid: Array, where: str) -> tuple[float, ...]:
    """Check that the times of distributions in a report are within the times of the study, and return them in s."""
    times = without_quantities(f"{where}: report_times", times, "s")
    _some(times, f"{where}: report_times")
    try:
        if any(isinstance(x, (str, bytes)) for x in (times, *times)):
            raise TypeError  # Python would read texts as numbers
        chosen = tuple(float(t) for t in times)
    except (TypeError, ValueError, OverflowError):
        raise StudyError(f"{where}: report_times are {times!r}; expected numbers in s, e.g. [0.4].") from None
    for t in chosen:
        if not grid[0] <= t <= grid[-1]:
            raise StudyError(
                f"{where}: report_times contains {t:g} s; expected times between {grid[0]:g} and {grid[-1]:g} s."
            )
    return chosen


def check_folder(folder: Any, resume: Any, where: str) -> Path | None:
    """Return the folder of finished chunks after a check."""
    if not isinstance(resume, bool):
        raise StudyError(f"{where}: resume is {resume!r}; expected True or False.")
    if folder is None:
        return None
    if not isinstance(folder, (str, PathLike)):
        raise StudyError(f"{where}: folder is {folder!r}; expected a path, e.g. 'results'.")
    if "\0" in str(folder):
        raise StudyError(f"{where}: folder is {folder!r}; a path cannot contain a null character.")
    return Path(folder)
