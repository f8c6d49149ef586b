"""Calls of controller functions, and checks of their results."""

from __future__ import annotations

import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from uqmbd.dynamics.control.loop import ControlLoop
from uqmbd.errors import StudyError
from uqmbd.typing import Array

__all__ = ["called", "failures", "require_same"]


FLOAT = np.dtype(np.float64)
SAME = 1e-9
"""Allowed difference between results of a whole group and of a part of it, relative to the largest value."""


def called(
    loop: ControlLoop, time: float, measured: Array, state: Array, whole: int = 0
) -> tuple[Array, Array, dict[int, str]]:
    """Call the function of a controller at a time, s; return commands (M, command), states (M, state) and reasons.

    The arguments are measurements (M, measured) and states (M, state).  The third result contains the reason of each
    failed row.  The function may own the returned arrays, and change them in its next call.  Raises `uqmbd.StudyError`
    if the function raises, or its result has a wrong shape; the message mentions a call for a part of `whole` rows.
    """
    count = len(measured)
    assert loop.shipped is not None
    try:
        function = loop.shipped.function
        found = function(time, measured.copy(), state.copy()) if loop.states else function(time, measured.copy())
        if not loop.states and type(found) is np.ndarray and found.dtype == FLOAT:
            # most functions; this path takes no time for checks that it does not need
            width = len(loop.commands)
            if found.shape == (count, width):
                return found, measured[:, :0], {}
            if width == 1 and found.shape == (count,):
                return found[:, None], measured[:, :0], {}
    except StudyError as error:
        raise StudyError(f"Controller {loop.name!r}, at t = {time:.6g} s: {error}") from error
    except Exception as error:
        about = _again(count, whole)
        shapes = f"measured of shape {measured.shape}" + (f" and state of shape {state.shape}" if loop.states else "")
        raise StudyError(
            f"Controller {loop.name!r}: its function raised {type(error).__name__}: {error}{_place(error)}, at "
            f"t = {time:.6g} s with {shapes}{about}. uqmbd calls function(time, measured"
            f"{', state' * bool(loop.states)}), with a row of the arrays for each realisation of a group."
        ) from error
    where, reasons, about = f"Controller {loop.name!r}", dict[int, str](), _again(count, whole)
    if isinstance(found, tuple) and found and isinstance(found[-1], dict):
        found, reasons = (found[0] if len(found) == 2 else found[:-1]), _reasons(where, found[-1], count, time)
    if not loop.states:
        return _columns(where, "commands", found, loop.commands, count, time, about), np.zeros((count, 0)), reasons
    if not (isinstance(found, (tuple, list)) and len(found) == 2):
        raise StudyError(
            f"{where}: its function returned {_shown(found)} at t = {time:.6g} s; expected the pair (commands, state), "
            f"because the controller has the state{'s' * (len(loop.states) > 1)} {', '.join(map(repr, loop.states))}."
        )
    return (
        _columns(where, "commands", found[0], loop.commands, count, time, about),
        _columns(where, "the new state", found[1], loop.states, count, time, about),
        reasons,
    )


def _again(count: int, whole: int) -> str:
    """Return the end of a message about a call for a part of a group."""
    return f", called again for {count} of {whole}" if whole else ""


def failures(
    loop: ControlLoop,
    time: float,
    measured: Array,
    commands: Array,
    state: Array,
    low: Array,
    high: Array,
    reasons: Mapping[int, str],
) -> dict[int, str]:
    """Return messages for realisations (rows) that cannot continue after a call, some with the function's reasons."""
    found: dict[int, str] = {}
    for what, names, values in (("state", loop.states, state), ("command", loop.commands, commands)):
        for row in np.flatnonzero(~np.isfinite(values).all(axis=1)).tolist():
            k = int(np.argmin(np.isfinite(values[row])))
            found[row] = (
                f"Controller {loop.name!r}: its {what} {names[k]!r} is {values[row, k]:g} at t = {time:.6g} s, where "
                f"it measures {_seen(loop, measured[row])}"
            )
    for row in np.flatnonzero(~(low <= high).all(axis=1)).tolist():
        k = int(np.argmin(low[row] <= high[row]))
        found[row] = (
            f"Controller {loop.name!r}: the limits of {loop.commands[k]!r} are {low[row, k]:.6g} and "
            f"{high[row, k]:.6g}; expected a lower limit that is at most the upper limit"
        )
    for row, reason in reasons.items():
        found[row] = (
            f"Controller {loop.name!r} fails at t = {time:.6g} s, where it measures {_seen(loop, measured[row])}: "
            f"{reason.rstrip('.')}"
        )
    return found


def _seen(loop: ControlLoop, row: Array) -> str:
    """Return measured values of a realisation as text."""
    return ", ".join(f"{n} = {x:.6g}" for n, x in zip(loop.measure.names, row, strict=True))


def _reasons(where: str, given: Mapping[Any, Any], count: int, time: float) -> dict[int, str]:
    """Return the reasons of a result after a check of rows and texts."""
    for row, reason in given.items():
        whole = isinstance(row, (int, np.integer)) and not isinstance(row, bool) and 0 <= row < count
        if not whole or not isinstance(reason, str):
            raise StudyError(
                f"{where}: its function returned the reason {reason!r} for row {row!r} at t = {time:.6g} s; expected "
                f"a mapping from rows, 0 to {count - 1}, to texts."
            )
    return {int(row): reason for row, reason in given.items()}


def require_same(loop: ControlLoop, time: float, whole: Any, part: Any, count: int) -> None:
    """Raise an error unless a function returned equal results for a group and for a part of it."""
    for what, one, other in zip(("commands", "state"), whole, part, strict=True):
        if one.tobytes() == other.tobytes():
            continue
        scale = np.maximum(np.abs(one), np.abs(other)).max(initial=0.0)
        with np.errstate(invalid="ignore"):
            differs = np.abs(one - other) > SAME * scale
        differs |= np.isnan(one) != np.isnan(other)
        if differs.any():
            row, k = np.argwhere(differs)[0]
            group = (
                f"if it is called with the other {count - 1} realisations of its group, and {other[row, k]:.6g} with "
                "a part of them"
                if count > 1
                else f"first, and {other[row, k]:.6g} when it is called again with the same arguments"
            )
            raise StudyError(
                f"Controller {loop.name!r}: for the same realisation at t = {time:.6g} s its function returns the "
                f"{what} {one[row, k]:.6g} {group}. Each row of the result may depend on the same row of measured "
                "and state only: no means over realisations, no random numbers, and no memory except the state."
            )


def _columns(where: str, what: str, value: Any, names: tuple[str, ...], count: int, time: float, about: str) -> Array:
    """Return a result as an array (count, names)."""
    width = len(names)
    plain = type(value) is np.ndarray and value.dtype == np.float64
    if plain and (value.shape == (count, width) or (width == 1 and value.shape == (count,))):
        found: Array = value.reshape(count, width).copy()
        return found
    expected = f"expected an array of shape {(count, width)}, (realisation, {', '.join(names)})"
    if width == 1:
        expected += f", or of shape {(count,)}, or a number"
    else:
        expected += f", or a tuple of {width} entries of shape {(count,)}"
    if value is None or np.iscomplexobj(value):
        hint = "a return statement may be missing" if value is None else "these are complex numbers"
        raise StudyError(
            f"{where}: its function returned {_shown(value)} as {what} at t = {time:.6g} s{about} ({hint}); {expected}."
        )
    if any(np.ma.is_masked(x) for x in (value if isinstance(value, (tuple, list)) else (value,))):
        raise StudyError(
            f"{where}: its function returned a masked array with masked entries as {what} at t = {time:.6g} s{about}; "
            f"{expected}. For a realisation that has failed, return NaN instead of a masked entry."
        )
    try:
        if isinstance(value, tuple) and len(value) == width:
            columns = [np.asarray(x, dtype=float) for x in value]
            if all(x.shape in ((), (count,)) for x in columns):
                return np.column_stack([np.broadcast_to(x, (count,)) for x in columns])
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise StudyError(
            f"{where}: its function returned {_shown(value)} as {what} at t = {time:.6g} s{about}; {expected}."
        ) from None
    if array.shape == (count, width):
        return array.copy()
    if array.shape == () or (width == 1 and array.shape == (count,)):
        return np.broadcast_to(array.reshape(-1, 1), (count, width)).copy()
    raise StudyError(
        f"{where}: its function returned {what} of shape {array.shape} at t = {time:.6g} s{about}; {expected}."
    )


def _shown(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    if isinstance(value, (tuple, list)):
        return f"a {type(value).__name__} of {len(value)}"
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _place(error: BaseException) -> str:
    """Return file and line of an error as part of a sentence."""
    frames = traceback.extract_tb(error.__traceback__)[1:]
    return f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else ""
