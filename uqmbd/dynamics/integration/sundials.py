"""IDA of SUNDIALS through scikit-sundae, without terminal output and without termination of the process.

scikit-sundae prints the messages of SUNDIALS on a failed integration; here the messages are part of the result.  The
sparse solver (SuperLU_MT) frees memory that only its first factorisation allocates. A solver that stops before this
factorisation is therefore never freed.  Exceptions of callbacks are passed on as instances, as required by Python's C
interface.
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
"""Largest rate for which a step is possible: the square of a larger rate is outside the range of numbers."""


TOO_MUCH_WORK = -1
"""IDA_TOO_MUCH_WORK, a status of IDA."""


def import_sundials() -> ModuleType:
    """Import the module of IDA; raise `uqmbd.StudyError` if scikit-sundae is missing."""
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
    """Result of an integration by IDA."""

    t: Array  # (R,): reached times, s; the last is the stop of the integration
    y: Array  # (R, n): unknowns
    success: bool  # whether the end was reached
    message: str  # reason if the end was not reached
    residuals: int = 0  # number of residual evaluations
    jacobians: int = 0  # number of Jacobian evaluations
    too_much_work: bool = False  # whether the limit on steps caused the stop
    # (S,), (S, n), (S, n): times of the integrator's steps, unknowns and rates, if recorded
    steps: tuple[Array, Array, Array] | None = None


class _Callbacks:
    """Callbacks that record exceptions and the first factorisation of the matrix."""

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
    """Integrate by IDA from consistent values and rates (n,) at three or more increasing times (T,) in s.

    The options are ``linsolver`` and its parameters; the settings are tolerances and limits.  With `recording`, the
    result also contains the integrator's steps, with unchanged values at the given times.  A failure within SUNDIALS is
    returned as a solution; an exception of a callback is raised.
    """
    largest = float(np.abs(yp).max(initial=0.0))
    if not (np.isfinite(y).all() and largest <= LARGEST):
        what = f"rates up to {largest:.3g} at the start" if np.isfinite(largest) else "values that are not finite"
        return SundialsSolution(times[:1], y[None], success=False, message=f"{what}, so no step is possible")
    ida = import_sundials().IDA
    callbacks, output = _Callbacks(), io.StringIO()
    options = dict(options)
    if "jacfn" in options:
        options["jacfn"] = callbacks.jacobian(options["jacfn"])
    with _redirected_output(output), _interrupted_by_instances():
        # all threads share the filters: one thread at a time changes them
        with _lock, warnings.catch_warnings():
            # scikit-sundae uses the pattern for an approximate Jacobian, which the exact Jacobian replaces
            warnings.filterwarnings("ignore", message="Custom sparse Jacobian")
            solver = ida(callbacks.residual(residual), **options, **settings)
        try:
            if recording:
                return _solve_stepwise(solver, times, y, yp, int(settings["max_num_steps"]), output)
            found = solver.solve(times, y, yp)
        except (RuntimeError, KeyError, np.linalg.LinAlgError) as error:
            if callbacks.raised is not None:
                raise callbacks.raised from None
            return SundialsSolution(times[:1], y[None], success=False, message=_one_line(output, str(error)))
        finally:
            if options.get("linsolver") == "sparse" and not callbacks.factorised:
                ctypes.pythonapi.Py_IncRef(ctypes.py_object(solver))
    path = np.asarray(found.y).reshape(len(found.t), -1)
    return SundialsSolution(
        np.asarray(found.t),
        path,
        bool(found.success),
        "" if found.success else _one_line(output, str(found.message)),
        int(found.nfev),
        int(found.njev),
        found.status == TOO_MUCH_WORK,
    )


def _solve_stepwise(solver: Any, times: Array, y: Array, yp: Array, most: int, output: io.StringIO) -> SundialsSolution:
    """Integrate as in `solve`, and record all steps."""
    solver.init_step(float(times[0]), y, yp)
    end, now = float(times[-1]), float(times[0])
    known, path, rates = [now], [np.array(y, dtype=float)], [np.array(yp, dtype=float)]
    reached, states = [now], [path[0]]
    found = None
    for target in times[1:].tolist():
        steps = 0
        while now < target:
            found, steps = solver.step(target, "onestep", end), steps + 1
            if not found.success or (steps > most and now < target):
                break
            if found.t > now:
                now = float(found.t)
                known.append(now)
                path.append(np.array(found.y, dtype=float))
                rates.append(np.array(found.yp, dtype=float))
        if found is not None and found.success and steps <= most and found.t != target:
            found = solver.step(target, "normal", end)
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
        "" if success else f"more than {most} steps" if steps > most else _one_line(output, str(found.message)),
        int(found.nfev),
        int(found.njev),
        many,
        (np.array(known), np.array(path), np.array(rates)),
    )


def _one_line(output: io.StringIO, message: str) -> str:
    """Return the last message of SUNDIALS without its codes, or `message` if it printed nothing."""
    lines = [re.sub(r"^\[.*?\]\s*", "", line).strip() for line in output.getvalue().splitlines()]
    return next((line for line in reversed(lines) if line), message.strip()).rstrip(".")


@contextmanager
def _interrupted_by_instances() -> Iterator[None]:
    """Make Ctrl-C raise an instance, because scikit-sundae fails for the class from Python's default handler."""
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
    """Standard output that each thread can redirect separately."""

    def __init__(self, stream: Any) -> None:
        self.stream, self.places = stream, dict[int, io.StringIO]()

    def write(self, text: str) -> int:
        """Write a text to the target of the thread."""
        place = self.places.get(threading.get_ident(), self.stream)
        return int(place.write(text) or 0) if place is not None else len(text)

    def flush(self) -> None:
        """Flush the underlying stream."""
        if self.stream is not None:
            self.stream.flush()

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the stream has
        return getattr(self.stream, name)


_lock = threading.Lock()


@contextmanager
def _redirected_output(place: io.StringIO) -> Iterator[None]:
    """Redirect the standard output of this thread; other threads print as before."""
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
