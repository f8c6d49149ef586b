"""IDA of SUNDIALS through scikit-sundae, without output to the terminal and without ends of the process.

scikit-sundae prints the messages of SUNDIALS on an integration that fails; here they are part of the result.  The
solver for sparse matrices (SuperLU_MT) frees what only its first factorisation allocates: a solver that stopped before
that is never freed.  An exception of a callback is handed on as Python's C interface wants it, as an instance.
"""

from __future__ import annotations

import ctypes
import io
import re
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType, ModuleType
from typing import Any

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.typing import Array

__all__ = ["LARGEST", "SundialsSolution", "import_sundials", "solve"]


LARGEST = 1e100
"""Rates beyond which no step can be taken: their squares, and steps that suit them, leave the range of numbers."""


TOO_MUCH_WORK = -1
"""IDA_TOO_MUCH_WORK, a status of IDA."""


def import_sundials() -> ModuleType:
    """Import the module of IDA; without scikit-sundae this is a `uqmbd.StudyError`."""
    try:
        import sksundae.ida
    except ImportError as error:
        raise StudyError(
            "the integrator 'ida' needs scikit-sundae, which is not installed: 'pip install scikit-sundae' builds it "
            "from source where there is no wheel, with SUNDIALS and a compiler. Or choose integrator='dop853'."
        ) from error
    return sksundae.ida  # type: ignore[no-any-return]


@dataclass(frozen=True)
class SundialsSolution:
    """Result of an integration."""

    t: Array  # (R,): times that were reached, s; the last one is where an integration stopped
    y: Array  # (R, n): unknowns
    success: bool  # whether the end was reached
    message: str  # why it was not
    residuals: int = 0  # evaluations
    jacobians: int = 0  # evaluations
    too_much_work: bool = False  # whether it stopped for the number of its steps
    # (S,), (S, n), (S, n): times of the integrator's steps, unknowns and rates, if recorded
    steps: tuple[Array, Array, Array] | None = None


class _Callbacks:
    """Callbacks that store exceptions, and whether the matrix has been factorised."""

    def __init__(self) -> None:
        self.raised: BaseException | None = None
        self.factorised = False

    def residual(self, function: Callable[..., None]) -> Callable[..., None]:
        """Return IDA's callback of a residual."""

        def call(t: float, y: Array, yp: Array, res: Array) -> None:
            try:
                function(t, y, yp, res)
            except BaseException as error:
                self.raised = error
                raise

        return call

    def jacobian(self, function: Callable[..., None]) -> Callable[..., None]:
        """Return IDA's callback of a Jacobian."""

        def call(t: float, y: Array, yp: Array, res: Array, c: float, jac: Array) -> None:
            try:
                function(t, y, yp, res, c, jac)
            except BaseException as error:
                self.raised = error
                raise
            self.factorised = True

        return call


def solve(
    residual: Callable[..., None],
    options: dict[str, Any],
    times: Array,
    y: Array,
    yp: Array,
    *,
    recording: bool = False,
    **settings: Any,
) -> SundialsSolution:
    """Integrate by IDA from consistent values and rates (n,) at increasing times (T,), s, at least three.

    The options are ``linsolver`` and those that belong to it; the settings are tolerances and limits.  With `recording`
    the integrator's steps are returned, too, without any change of the others.  A failure within SUNDIALS is returned
    as a Solution; an exception of a callback is raised.
    """
    largest = float(np.abs(yp).max(initial=0.0))
    if not (np.isfinite(y).all() and largest <= LARGEST):
        what = f"rates up to {largest:.3g} at the start" if np.isfinite(largest) else "values that are not finite"
        return SundialsSolution(times[:1], y[None], success=False, message=f"{what}, for which there is no step")
    ida = import_sundials().IDA
    callbacks, said = _Callbacks(), io.StringIO()
    options = dict(options)
    if "jacfn" in options:
        options["jacfn"] = callbacks.jacobian(options["jacfn"])
    with _heard(said), _interrupted_by_instances():
        # filters are those of all threads: they are changed by one at a time
        with _lock, warnings.catch_warnings():
            # it takes the pattern for an approximation of its own, which the exact Jacobian replaces
            warnings.filterwarnings("ignore", message="Custom sparse Jacobian")
            solver = ida(callbacks.residual(residual), **options, **settings)
        try:
            if recording:
                return _solve_stepwise(solver, times, y, yp, int(settings["max_num_steps"]), said)
            found = solver.solve(times, y, yp)
        except (RuntimeError, KeyError, np.linalg.LinAlgError) as error:
            if callbacks.raised is not None:
                raise callbacks.raised from None
            return SundialsSolution(times[:1], y[None], success=False, message=_one_line(said, str(error)))
        finally:
            if options.get("linsolver") == "sparse" and not callbacks.factorised:
                ctypes.pythonapi.Py_IncRef(ctypes.py_object(solver))
    path = np.asarray(found.y).reshape(len(found.t), -1)
    return SundialsSolution(
        np.asarray(found.t),
        path,
        bool(found.success),
        "" if found.success else _one_line(said, str(found.message)),
        int(found.nfev),
        int(found.njev),
        found.status == TOO_MUCH_WORK,
    )


def _solve_stepwise(solver: Any, times: Array, y: Array, yp: Array, most: int, said: io.StringIO) -> SundialsSolution:
    """Integrate as `solve` does, and keep all steps."""
    solver.init_step(float(times[0]), y, yp)
    end, now = float(times[-1]), float(times[0])
    known, path, rates = [now], [np.array(y, dtype=float)], [np.array(yp, dtype=float)]
    reached, states = [now], [path[0]]
    found = None
    for wanted in times[1:].tolist():
        steps = 0
        while now < wanted:
            found, steps = solver.step(wanted, "onestep", end), steps + 1
            if not found.success or (steps > most and now < wanted):
                break
            if found.t > now:
                now = float(found.t)
                known.append(now)
                path.append(np.array(found.y, dtype=float))
                rates.append(np.array(found.yp, dtype=float))
        if found is not None and found.success and steps <= most and found.t != wanted:
            found = solver.step(wanted, "normal", end)
        assert found is not None
        reached.append(float(found.t))
        states.append(np.array(found.y, dtype=float))
        if not found.success or steps > most:
            break
    assert found is not None
    success, many = bool(found.success) and reached[-1] == end, steps > most or found.status == TOO_MUCH_WORK
    return SundialsSolution(
        np.array(reached),
        np.array(states),
        success,
        "" if success else f"more than {most} steps" if steps > most else _one_line(said, str(found.message)),
        int(found.nfev),
        int(found.njev),
        many,
        (np.array(known), np.array(path), np.array(rates)),
    )


def _one_line(said: io.StringIO, message: str) -> str:
    """Return the last message of SUNDIALS without its codes, or `message` if it printed nothing."""
    lines = [re.sub(r"^\[.*?\]\s*", "", line).strip() for line in said.getvalue().splitlines()]
    return next((line for line in reversed(lines) if line), message.strip()).rstrip(".")


@contextmanager
def _interrupted_by_instances() -> Iterator[None]:
    """Make Ctrl-C raise an instance: Python's own handler raises a class, on which scikit-sundae fails."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:
        yield
        return

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


class _Router(io.TextIOBase):
    """A standard output that each thread may redirect."""

    def __init__(self, stream: Any) -> None:
        self.stream, self.places = stream, dict[int, io.StringIO]()

    def write(self, text: str) -> int:
        """Write to the target of the thread."""
        place = self.places.get(threading.get_ident(), self.stream)
        return int(place.write(text) or 0) if place is not None else len(text)

    def flush(self) -> None:
        """Flush the stream behind."""
        if self.stream is not None:
            self.stream.flush()

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the stream has
        return getattr(self.stream, name)


_lock = threading.Lock()


@contextmanager
def _heard(place: io.StringIO) -> Iterator[None]:
    """Redirect the output of this thread; other threads print as before."""
    me = threading.get_ident()
    with _lock:
        if not isinstance(sys.stdout, _Router):
            sys.stdout = _Router(sys.stdout)
        router = sys.stdout
        before = router.places.get(me)
        router.places[me] = place
    try:
        yield
    finally:
        with _lock:
            if before is None:
                router.places.pop(me, None)
            else:
                router.places[me] = before
            if not router.places and sys.stdout is router:
                sys.stdout = router.stream
