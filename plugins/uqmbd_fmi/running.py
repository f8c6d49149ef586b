"""Instances of an FMU for co-simulation, run by FMPy: start, steps, and errors with the messages of the FMU."""

from __future__ import annotations

import copy
import functools
import io
import os
import shutil
import tempfile
import threading
import weakref
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uqmbd import StudyError

__all__ = ["FmuError", "FmuInstance", "LoadedFmu", "description_of", "fmpy_package"]

MESSAGES = 5
"""Number of messages of an instance that are stored."""

SETTERS = {"Real": "setReal", "Integer": "setInteger", "Enumeration": "setInteger"}
"""Functions of FMPy that set a type of FMI 2.0, if they are not named like the type."""


_CURRENT = threading.local()
"""Messages of the instance that a thread calls: an FMU calls its logger in the same thread."""


class FmuError(Exception):
    """An FMU that cannot continue; the text contains the function, its status, and the message of the FMU."""


def fmpy_package(where: str) -> Any:
    """Return the package FMPy; raise StudyError if it is not installed."""
    try:
        import fmpy
    except ImportError:
        raise StudyError(f'{where} needs the package FMPy: pip install "uqmbd[fmi]".') from None
    return fmpy


def description_of(content: bytes, where: str) -> Any:
    """Return the model description of an FMU that FMPy has read; raise StudyError if it is not readable."""
    fmpy = fmpy_package(where)
    try:
        return fmpy.read_model_description(io.BytesIO(content))
    except Exception as error:  # FMPy, its XML parser and its archive reader raise various types
        shown = " ".join(str(error).split())[:300]
        raise StudyError(
            f"{where}: FMPy cannot read the model description ({type(error).__name__}: {shown}); expected an FMU of "
            "FMI 2.0 or 3.0."
        ) from error


@dataclass(frozen=True)
class Setting:
    """A fixed value of an FMU variable."""

    type: str
    reference: int
    value: Any


class LoadedFmu:
    """An extracted FMU and its library, for all instances of a process."""

    def __init__(self, content: bytes, name: str) -> None:
        fmpy = fmpy_package(f"FMU {name!r}")
        self.name, self.description = name, description_of(content, f"FMU {name!r}")
        self.version = int(str(self.description.fmiVersion)[0])
        folder = Path(tempfile.mkdtemp(prefix="uqmbd_fmu_"))
        weakref.finalize(self, _removed, folder, os.getpid())
        fmpy.extract(io.BytesIO(content), str(folder))
        (folder / "resources").mkdir(exist_ok=True)
        from fmpy import fmi2, fmi3

        kind = fmi2.FMU2Slave if self.version == 2 else fmi3.FMU3Slave
        try:
            self.library = kind(
                guid=self.description.instantiationToken,
                modelIdentifier=self.description.coSimulation.modelIdentifier,
                unzipDirectory=str(folder),
                instanceName=name,
            )
        except Exception as error:  # FMPy raises an Exception
            raise StudyError(f"FMU {name!r}: its library cannot be loaded: {error}") from error


class FmuInstance:
    """An instance of an FMU after its initialisation, by a start time and by values of variables by reference.

    A function of the FMU with an error status raises FmuError.
    """

    def __init__(
        self,
        loaded: LoadedFmu,
        settings: Sequence[Setting],
        parameters: Mapping[int, float],
        inputs: Mapping[int, float],
        start: float,
    ) -> None:
        self.loaded, self.messages = loaded, deque[str](maxlen=MESSAGES)
        self.unit = copy.copy(loaded.library)
        experiment = loaded.description.defaultExperiment
        tolerance = getattr(experiment, "tolerance", None)
        about = {"tolerance": None if tolerance is None else float(tolerance), "startTime": start}
        self._called(self._created)
        # the library and its logger must exist until the instance is released
        self._release = weakref.finalize(self, _freed, self.unit, loaded)
        self._release.atexit = False
        for one in settings:
            setter = getattr(self.unit, SETTERS.get(one.type, f"set{one.type}"))
            self._called(setter, [one.reference], [one.value])
        self._set(parameters)
        if loaded.version == 2:
            self._called(self.unit.setupExperiment, **about)
            self._called(self.unit.enterInitializationMode)
        else:
            self._called(self.unit.enterInitializationMode, **about)
        self._set(inputs)
        self._called(self.unit.exitInitializationMode)

    def step(self, inputs: Mapping[int, float], time: float, size: float, outputs: Sequence[int]) -> Any:
        """Set inputs, perform a step, and return outputs (output,) at its end; arguments by value reference."""
        self._set(inputs)
        flags = self._called(self.unit.doStep, time, size)
        if flags is not None and (flags[1] or flags[2]):
            raise FmuError(f"FMU {self.loaded.name!r} ended its simulation in the step from t = {time:.6g} s")
        get = self.unit.getReal if self.loaded.version == 2 else self.unit.getFloat64
        return np.array(self._called(get, list(outputs)), dtype=float)

    def release(self) -> None:
        """Release the instance."""
        self._release()

    def _set(self, values: Mapping[int, float]) -> None:
        if values:
            put = self.unit.setReal if self.loaded.version == 2 else self.unit.setFloat64
            self._called(put, list(values), list(values.values()))

    def _created(self) -> None:
        if self.loaded.version == 2:
            self.unit.instantiate(callbacks=_callbacks(), loggingOn=True)
        else:
            self.unit.instantiate(loggingOn=True, logMessage=_note_of_3)

    def _called(self, function: Callable[..., Any], *values: Any, **options: Any) -> Any:
        """Call a function of FMPy; raise FmuError with the messages of the FMU if it fails."""
        self.messages.clear()
        _CURRENT.messages = self.messages
        try:
            return function(*values, **options)
        except Exception as error:  # FMPy raises FMICallException, or an Exception without an instance
            said = "; ".join(text.rstrip(". ") for text in self.messages)
            raise FmuError(
                f"FMU {self.loaded.name!r}: {str(error).rstrip('.')}" + (f". Its message: {said}" if said else "")
            ) from error


def _removed(folder: Path, process: int) -> None:
    """Remove the folder of an extracted FMU, in the process that made it."""
    if os.getpid() == process:
        shutil.rmtree(folder, ignore_errors=True)


def _callbacks() -> Any:
    """Return the callbacks of FMI 2.0, which FMPy connects with the logger of this module."""
    from ctypes import byref

    from fmpy.logging import addLoggerProxy

    callbacks, logger = _callbacks_of_2()
    # FMPy formats the messages, and sends them to the last logger that it was given; this one always exists
    callbacks.logger = logger
    addLoggerProxy(byref(callbacks))
    return callbacks


@functools.cache
def _callbacks_of_2() -> tuple[Any, Any]:
    """Return the callbacks of FMI 2.0 and their logger, which exist until the end of the process."""
    from fmpy import calloc, fmi2, free

    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
    callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
    return callbacks, fmi2.fmi2CallbackLoggerTYPE(_note_of_2)


def _note_of_2(environment: Any, name: bytes | None, status: int, category: bytes | None, text: bytes | None) -> None:
    _note(status, text)


def _note_of_3(environment: Any, status: int, category: bytes | None, text: bytes | None) -> None:
    _note(status, text)


def _note(status: int, text: bytes | None) -> None:
    """Store a message of at least the status warning, for the instance that this thread calls."""
    messages: deque[str] | None = getattr(_CURRENT, "messages", None)
    if status >= 1 and text and messages is not None:
        messages.append(" ".join(text.decode("utf-8", "replace").split()))


def _freed(unit: Any, loaded: LoadedFmu) -> None:
    """Release an instance of a library that is still loaded."""
    getattr(unit, f"fmi{loaded.version}FreeInstance")(unit.component)
