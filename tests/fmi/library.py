"""A binary of an FMU, called without FMPy: the functions that the tests need, for FMI 2.0 and 3.0."""

from __future__ import annotations

import ctypes as c
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from uqmbd_fmi.compiling import host

TYPES = {"Real", "Float64", "Boolean"}


class Fmu:
    """An instance of an FMU, with the messages of its logger."""

    def __init__(self, path: Path, folder: Path, token: str | None = None) -> None:
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
        root = ElementTree.parse(folder / "modelDescription.xml").getroot()
        self.version = int(root.attrib["fmiVersion"][0])
        self.token = root.attrib["guid" if self.version == 2 else "instantiationToken"] if token is None else token
        name = root.find("CoSimulation").attrib["modelIdentifier"]
        on = host()
        self.library = c.CDLL(str(folder / on.folder(self.version) / f"{name}{on.suffix}"))
        self.messages: list[tuple[int, str]] = []
        self.references, self.truth = {}, set()
        for one in root.find("ModelVariables"):
            self.references[one.attrib["name"]] = int(one.attrib["valueReference"])
            if one.tag == "Boolean" or one.find("Boolean") is not None:
                self.truth.add(one.attrib["name"])
        self.instance = None
        self._instantiate()

    def call(self, name: str, *arguments) -> int:
        """Call a function of the instance, without the prefix of its version."""
        return getattr(self.library, f"fmi{self.version}{name}")(c.c_void_p(self.instance), *arguments)

    def _instantiate(self) -> None:
        token = self.token.encode()
        if self.version == 2:
            kind = c.CFUNCTYPE(None, c.c_void_p, c.c_char_p, c.c_int, c.c_char_p, c.c_char_p)
            self.log = kind(lambda env, name, status, category, text: self.messages.append((status, text.decode())))
            self.callbacks = (c.c_void_p * 5)(c.cast(self.log, c.c_void_p).value, None, None, None, None)
            make = self.library.fmi2Instantiate
            make.restype = c.c_void_p
            self.instance = make(b"one", 1, token, None, c.byref(self.callbacks), 0, 0)
        else:
            kind = c.CFUNCTYPE(None, c.c_void_p, c.c_int, c.c_char_p, c.c_char_p)
            self.log = kind(lambda env, status, category, text: self.messages.append((status, text.decode())))
            make = self.library.fmi3InstantiateCoSimulation
            make.restype = c.c_void_p
            no = c.c_bool(False)
            self.instance = make(b"one", token, None, no, no, no, no, None, c.c_size_t(0), None, self.log, None)

    def free(self) -> None:
        """Free the instance."""
        getattr(self.library, f"fmi{self.version}FreeInstance")(c.c_void_p(self.instance))

    def set(self, names, values) -> int:
        """Set variables by name."""
        references = (c.c_uint * len(names))(*(self.references[n] for n in names))
        numbers = (c.c_double * len(names))(*map(float, values))
        more = () if self.version == 2 else (c.c_size_t(len(names)),)
        return self.call(
            "SetReal" if self.version == 2 else "SetFloat64", references, c.c_size_t(len(names)), numbers, *more
        )

    def get(self, names) -> np.ndarray:
        """Return values of variables by name; raise an error for a status that is no success."""
        found = []
        for name in names:
            reference = (c.c_uint * 1)(self.references[name])
            of_truth = name in self.truth
            value = ((c.c_int if self.version == 2 else c.c_bool) if of_truth else c.c_double)()
            function = "GetBoolean" if of_truth else "GetReal" if self.version == 2 else "GetFloat64"
            more = () if self.version == 2 else (c.c_size_t(1),)
            status = self.call(function, reference, c.c_size_t(1), c.byref(value), *more)
            if status > 1:
                raise RuntimeError(f"{name}: status {status}, {self.messages[-1:]}")
            found.append(float(value.value))
        return np.array(found)

    def begin(self, start: float = 0.0, tolerance: float | None = None) -> int:
        """Initialise the instance."""
        given = (
            c.c_bool(tolerance is not None),
            c.c_double(tolerance or 0.0),
            c.c_double(start),
            c.c_bool(False),
            c.c_double(0),
        )
        if self.version == 2:
            status = self.call("SetupExperiment", *given) or self.call("EnterInitializationMode")
        else:
            status = self.call("EnterInitializationMode", *given)
        return status or self.call("ExitInitializationMode")

    def step(self, time: float, size: float) -> int:
        """Perform a step."""
        if self.version == 2:
            return self.call("DoStep", c.c_double(time), c.c_double(size), 1)
        flags = [c.c_bool() for _ in range(3)]
        return self.call(
            "DoStep", c.c_double(time), c.c_double(size), c.c_bool(True), *map(c.byref, flags), c.byref(c.c_double())
        )

    def reset(self) -> int:
        """Reset the instance."""
        return self.call("Reset")

    def along(self, times, values, outputs) -> np.ndarray:
        """Return outputs (O, T) at times, for values of parameters by name, from a new start."""
        assert self.reset() == 0
        assert self.set(list(values), list(values.values())) == 0
        assert self.begin(float(times[0])) <= 1, self.messages
        rows = [self.get(outputs)]
        for before, after in zip(times[:-1], times[1:], strict=True):
            assert self.step(float(before), float(after - before)) <= 1, self.messages
            rows.append(self.get(outputs))
        return np.array(rows).T

    def derivative(self, outputs, inputs, seed) -> np.ndarray:
        """Return a directional derivative."""
        unknown = (c.c_uint * len(outputs))(*(self.references[n] for n in outputs))
        known = (c.c_uint * len(inputs))(*(self.references[n] for n in inputs))
        direction, found = (c.c_double * len(inputs))(*seed), (c.c_double * len(outputs))()
        sizes = c.c_size_t(len(outputs)), c.c_size_t(len(inputs))
        words = (unknown, sizes[0], known, sizes[1], direction)
        words += (found,) if self.version == 2 else (sizes[1], found, sizes[0])
        assert self.call("GetDirectionalDerivative", *words) == 0, self.messages
        return np.array(found[:])
