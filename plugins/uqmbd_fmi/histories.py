"""Function of a controller that is an FMU: one instance for each history of measured values.

A controller function must return equal results for equal arguments, for every grouping of realisations, but an FMU
has an internal state. The state of the controller is therefore a hash of all samples so far. Each instance belongs to
one history, and the hash selects it. If no instance has this history, a new one repeats its samples.
"""

from __future__ import annotations

import hashlib
import struct
import threading
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from uqmbd import StudyError
from uqmbd.typing import Array
from uqmbd_fmi.running import FmuError, FmuInstance, LoadedFmu, Setting

__all__ = ["FmuFunction", "STATES"]

STATES = ("history 1", "history 2")
"""States of the controller: the two halves of the hash."""

HALF = 1 << 26
"""Number of values of each half of a hash. A state is an integer divided by this power of two, so no digit is lost."""

INSTANCES = 1024
"""Largest number of instances of a process; a group has at most 512 realisations."""

REPEATED = 10_000
"""Largest number of samples of a history that a new instance can repeat."""

NEAR = 1e-6
"""Difference of the times of a sample and of the FMU, in sampling periods, that counts as rounding."""

RECENT = 4
"""Number of last samples of a history from which a realisation can continue."""

Key = tuple[int, int]
"""The two halves of a hash."""

BEGIN: Key = (0, 0)
"""State before the first sample."""


@dataclass
class _CallHistory:
    """Instance with its samples until a failure, and the results of the last samples by their number.

    After sample number `failed`, the history has no instance and stores no more samples.
    """

    start: float
    first: bytes = b""
    instance: FmuInstance | None = None
    rows: list[bytes] = field(default_factory=list)
    count: int = 0
    failed: int | None = None
    results: dict[int, tuple[bytes, Array, Key, str]] = field(default_factory=dict)


@dataclass(frozen=True)
class FmuFunction:
    """Function of a controller, ``function(time, measured, state)``, whose commands an FMU computes.

    The measured values are the values of the inputs, then of the parameters. The fields `inputs`, `parameters` and
    `outputs` contain value references of the FMU.
    """

    name: str
    content: bytes = field(repr=False)
    rate: float
    inputs: tuple[int, ...]
    parameters: tuple[int, ...]
    outputs: tuple[int, ...]
    settings: tuple[Setting, ...] = ()

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields; instances belong to one process."""
        return {k: x for k, x in self.__dict__.items() if k != "_pool"}

    def __call__(self, time: float, measured: Array, state: Array) -> tuple[Array, Array, dict[int, str]]:
        """Return commands (K, output), new states (K, 2), and reasons of failed rows."""
        pool = self.__dict__.get("_pool")
        if pool is None:
            object.__setattr__(self, "_pool", pool := _Pool(self))
        commands, after = np.full((len(measured), len(self.outputs)), np.nan), np.zeros((len(measured), 2))
        reasons: dict[int, str] = {}
        with pool.lock:
            for row, (values, halves) in enumerate(zip(measured, state, strict=True)):
                if not np.isfinite(values).all():
                    reasons[row] = f"the measured values for FMU {self.name!r} are not finite"
                    continue
                commands[row], key, reason = pool.advance(_key(halves), time, values)
                after[row] = np.array(key) / HALF
                if reason:
                    reasons[row] = reason
        return commands, after, reasons


class _Pool:
    """Instances and histories of a controller in a process."""

    def __init__(self, function: FmuFunction) -> None:
        self.function, self.lock = function, threading.Lock()
        self.loaded: LoadedFmu | None = None
        self.histories: OrderedDict[int, _CallHistory] = OrderedDict()
        self.places: dict[Key, tuple[_CallHistory, int]] = {}
        self.begins: dict[bytes, _CallHistory] = {}

    def advance(self, key: Key, time: float, values: Array) -> tuple[Array, Key, str]:
        """Return outputs (output,), the new hash and the reason of a failure after a sample of a realisation."""
        row = (np.asarray(values, dtype=float) + 0.0).tobytes()  # a zero has one sign
        if key == BEGIN:
            first = struct.pack("d", time) + row
            history, number = self.begins.get(first), 0
        else:
            if key not in self.places:
                raise StudyError(
                    f"FMU {self.function.name!r}: the state at t = {time:.6g} s does not belong to a realisation that "
                    "was simulated before. The internal state of an FMU cannot be averaged or expanded in polynomials. "
                    "Use methods that integrate single realisations, such as Monte Carlo and collocation, not Galerkin."
                )
            history, number = self.places[key]
        if history is not None and number in history.results and history.results[number][0] == row:
            self.histories.move_to_end(id(history))
            _, outputs, after, reason = history.results[number]
            return outputs, after, reason
        after = _hashed(key, time, row)
        if history is None or history.count != number:
            history = self._repeated(time, history, number)
            if key == BEGIN:
                history.first = first
                self.begins[first] = history
        self._add(history)
        at = history.start + number / self.function.rate
        if abs(at - time) > NEAR / self.function.rate:
            raise StudyError(
                f"FMU {self.function.name!r} is at t = {at:.6g} s, but the sample is at t = {time:.6g} s; a method "
                "must call the controller at every sample."
            )
        outputs, reason = self._stepped(history, number, row)
        history.results[number] = row, outputs, after, reason
        if number - RECENT in history.results:
            old = history.results.pop(number - RECENT)[2]
            if self.places.get(old, (None,))[0] is history:
                del self.places[old]
        self.places[after] = history, number + 1
        return outputs, after, reason

    def _repeated(self, time: float, other: _CallHistory | None, number: int) -> _CallHistory:
        """Return a history that begins with the first samples of another one."""
        if other is None or not number:
            return _CallHistory(time)
        if other.failed is not None and number > other.failed:
            return _CallHistory(other.start, count=number, failed=other.failed)
        if len(other.rows) < number:
            raise StudyError(
                f"a realisation needed a replay of {number} past samples of FMU {self.function.name!r}; only "
                f"{len(other.rows)} are stored. Use another integrator, or a lower rate."
            )
        found = _CallHistory(other.start)
        for k, row in enumerate(other.rows[:number]):
            self._stepped(found, k, row)
        return found

    def _stepped(self, history: _CallHistory, number: int, row: bytes) -> tuple[Array, str]:
        """Perform the step of a sample; return outputs (output,) and the reason of a failure."""
        of, failed = self.function, np.full(len(self.function.outputs), np.nan)
        history.count = number + 1
        if history.failed is not None:
            return failed, f"FMU {of.name!r} has failed before"
        values = np.frombuffer(row).tolist()
        inputs = dict(zip(of.inputs, values, strict=False))
        if number < REPEATED:
            history.rows.append(row)
        try:
            if number == 0:
                if self.loaded is None:
                    self.loaded = LoadedFmu(of.content, of.name)
                # without inputs and parameters, the only measured value is the time
                parameters = dict(zip(of.parameters, values[len(of.inputs) :], strict=False))
                history.instance = FmuInstance(self.loaded, of.settings, parameters, inputs, history.start)
            assert history.instance is not None
            at = history.start + number / of.rate
            outputs = history.instance.step(inputs, at, 1 / of.rate, of.outputs)
        except FmuError as error:
            if history.instance is not None:
                history.instance.release()
            history.instance, history.failed = None, number
            return failed, str(error)
        bad = "" if np.isfinite(outputs).all() else f"an output of FMU {of.name!r} is not finite"
        return outputs, bad

    def _add(self, history: _CallHistory) -> None:
        """Make a history the newest one, and release the oldest ones beyond the limit."""
        self.histories[id(history)] = history
        self.histories.move_to_end(id(history))
        while len(self.histories) > INSTANCES:
            _, old = self.histories.popitem(last=False)
            if old.instance is not None:
                old.instance.release()
            for _, _, key, _ in old.results.values():
                if self.places.get(key, (None,))[0] is old:
                    del self.places[key]
            if self.begins.get(old.first) is old:
                del self.begins[old.first]


def _key(halves: Array) -> Key:
    """Return the hash of a state; a state that is no hash has the key (-1, -1)."""
    scaled = np.asarray(halves, dtype=float) * HALF
    whole = np.rint(scaled)
    if not np.all(np.abs(scaled - whole) < 0.01):
        return -1, -1
    return int(whole[0]), int(whole[1])


def _hashed(key: Key, time: float, row: bytes) -> Key:
    """Return the hash of a history and its next sample, which never equals the hash of the start."""
    digest = hashlib.blake2b(struct.pack("qqd", *key, time) + row, digest_size=8).digest()
    number = int.from_bytes(digest, "little")
    return number % HALF, max(1, (number // HALF) % HALF)
