"""Controllers of a model: numbers, measured quantities, and indices of commands in the state.

The module also transfers user functions to worker processes.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.machinery
import inspect
import re
import sys
import sysconfig
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import cloudpickle
import numpy as np
import sympy

from uqmbd.compiled import Kernel, cached, compile_kernel
from uqmbd.dynamics.equations import Instance, OutputMap, ParameterMap, Placement, Tables, output_map, plain
from uqmbd.errors import Finding, Severity, StudyError
from uqmbd.mechanism import ControlLaw, Controller, HeldStates, HeldSymbol, Mechanism, Output, flatten, t
from uqmbd.names import did_you_mean
from uqmbd.randomness import RandomVariable
from uqmbd.typing import Array, Index

__all__ = ["ControlLoop", "Shipped", "loops_of", "require_controllers", "unused_commands"]

PLAIN = (type(None), bool, int, float, complex, str, bytes, type(...), np.generic)
DATA = (*PLAIN, np.ndarray, tuple, list, dict, set, frozenset)
CODE = ("co_argcount", "co_kwonlyargcount", "co_flags", "co_names", "co_varnames", "co_freevars", "co_code")
OF_CLASSES = (
    "__dict__",
    "__weakref__",
    "_abc_impl",
    "__slotnames__",
    "__module__",
    "__doc__",
    "__firstlineno__",
    "__static_attributes__",
)


def fingerprint(function: Callable[..., Any]) -> str:
    """Return a hash of the content of a callable.

    The hash includes the code with constants, defaults and closures, and the source of the module. It also includes
    named objects of this and other modules, such as functions and numbers.  For a ``functools.partial``, the hash
    includes functions and arguments; for an object, its class and attributes.  Libraries (standard library and
    installed packages) are included by name.  For an object that cannot be copied, the hash includes its text without
    the address, and its attributes.
    """
    return _Hashing().of(function).hex()


def parts(function: Any) -> Iterator[Any]:
    """Yield a callable and its parts, such as contents of partials and bound methods."""
    yield function
    inner: list[Any] = []
    if isinstance(function, functools.partial):
        inner = [function.func, *function.args, *function.keywords.values()]
    elif isinstance(function, MethodType):
        inner = [function.__func__, function.__self__]
    for part in inner:
        yield from parts(part)


class _Hashing:
    """Hashes of values, each computed once."""

    def __init__(self) -> None:
        self.known: dict[int, tuple[Any, bytes]] = {}

    def of(self, value: Any) -> bytes:
        if isinstance(value, PLAIN):
            return _joined([type(value).__name__.encode(), repr(value).encode()])
        if id(value) not in self.known:
            self.known[id(value)] = value, b"itself"
            self.known[id(value)] = value, _joined(self._seen(value))
        return self.known[id(value)][1]

    def _seen(self, value: Any) -> list[bytes]:
        kind = type(value)
        found = [f"{kind.__module__}.{kind.__qualname__}".encode()]
        if kind is np.ndarray:
            content = self.of(value.tolist()) if value.dtype.hasobject else value.tobytes()
            return [*found, repr((value.shape, value.dtype.str)).encode(), content]
        if kind in (tuple, list):
            return [*found, *map(self.of, value)]
        if kind in (set, frozenset):
            return [*found, *sorted(map(self.of, value))]
        if kind is dict:
            return [*found, *sorted(_joined([self.of(key), self.of(x)]) for key, x in value.items())]
        if isinstance(value, CodeType):
            return [*found, *(self.of(getattr(value, name)) for name in CODE), self.of(value.co_consts)]
        if isinstance(value, ModuleType):
            return [*found, _source(value) or value.__name__.encode()]
        if isinstance(value, (FunctionType, type)) and _of_library(value):
            return [*found, f"{value.__module__}.{value.__qualname__}".encode()]
        if isinstance(value, FunctionType):
            return found + self._function(value)
        if isinstance(value, type):
            content = {k: x for k, x in vars(value).items() if k not in OF_CLASSES and not inspect.isdatadescriptor(x)}
            gets = {k: x.fget for k, x in vars(value).items() if isinstance(x, property)}
            return [*found, value.__qualname__.encode(), *map(self.of, (value.__bases__, content, gets))]
        if isinstance(value, functools.partial):
            return [*found, *map(self.of, (value.func, value.args, value.keywords))]
        if isinstance(value, (MethodType, staticmethod, classmethod)):
            return [*found, self.of(value.__func__), self.of(getattr(value, "__self__", None))]
        return found + self._object(value)

    def _function(self, value: FunctionType) -> list[bytes]:
        source = _source(sys.modules.get(value.__module__ or ""))
        held = [_content(cell) for cell in value.__closure__ or ()]
        found = [source, *map(self.of, (value.__code__, value.__defaults__, value.__kwdefaults__, held))]
        names = sorted(_names(value.__code__))
        for name in names:
            if name not in value.__globals__:
                continue
            named = value.__globals__[name]
            # the source, if available, determines other objects
            if source and not (isinstance(named, (*DATA, ModuleType)) or callable(named)):
                continue
            found += [name.encode(), self.of(named)]
            if isinstance(named, ModuleType) and _source(named):
                found += [self.of(x) for x in (vars(named).get(name) for name in names) if isinstance(x, DATA)]
                found += [self.of(x) for x in (vars(named).get(name) for name in names) if callable(x)]
        return found

    def _object(self, value: Any) -> list[bytes]:
        """Return the data for pickle to restore an object."""
        found = [self.of(type(value))]
        if (wrapped := getattr(value, "__wrapped__", None)) is not None:
            found.append(self.of(wrapped))
        try:
            made = value.__reduce_ex__(4)
        except Exception:
            text = re.sub(r" at 0x[0-9a-fA-F]+", "", repr(value))
            return [*found, text.encode(), self.of(getattr(value, "__dict__", None))]
        if isinstance(made, str):
            return [*found, made.encode()]
        return found + [self.of(x if isinstance(x, PLAIN) or not isinstance(x, Iterator) else list(x)) for x in made]


def _joined(found: Iterable[bytes]) -> bytes:
    text = hashlib.sha256()
    for part in found:
        text.update(len(part).to_bytes(8, "little") + part)
    return text.digest()


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # the cell is still empty
        return None


def _names(code: CodeType) -> set[str]:
    """Return the names in a code object, including nested code objects."""
    return set(code.co_names).union(*(_names(x) for x in code.co_consts if isinstance(x, CodeType)))


def _source(module: ModuleType | None) -> bytes:
    """Return the source of a user module, or empty bytes."""
    if module is None or _of_library(module):
        return b""
    try:
        return inspect.getsource(module).encode()
    except (OSError, TypeError):  # a notebook or a compiled module
        return b""


@functools.cache
def _libraries() -> tuple[Path, ...]:
    paths = sysconfig.get_paths()
    return tuple(Path(paths[key]).resolve() for key in ("stdlib", "platstdlib", "purelib", "platlib"))


def _of_library(value: Any) -> bool:
    """Return whether a module, function or class belongs to an installed package."""
    module = value if isinstance(value, ModuleType) else sys.modules.get(getattr(value, "__module__", None) or "")
    if module is None or module.__name__ == "__main__":
        return False
    if module.__name__.partition(".")[0] == __name__.partition(".")[0]:
        return True
    if (file := getattr(module, "__file__", None)) is None:
        return module.__name__ in sys.builtin_module_names
    return any(folder in Path(file).resolve().parents for folder in _libraries())


@dataclass(frozen=True)
class Shipped:
    """Wrapper that makes any function picklable."""

    function: Callable[..., Any]
    owner: str  # owner of the function, for messages

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpacked, (self._packed(), self.owner)

    def digest(self) -> str:
        """Hash of the content of the function, equal in all processes."""
        return fingerprint(self.function)

    def _packed(self) -> bytes:
        modules = [
            module for name in sorted(_modules(self.function))
            if (module := sys.modules.get(name)) is not None and not _importable(module)
        ]  # fmt: skip
        try:
            for module in modules:
                cloudpickle.register_pickle_by_value(module)
            try:
                packed: bytes = cloudpickle.dumps(self.function)
            finally:
                for module in modules:
                    cloudpickle.unregister_pickle_by_value(module)
        except StudyError:
            raise
        except Exception as error:
            raise StudyError(
                f"{self.owner}: its function cannot be sent to the worker processes ({type(error).__name__}: {error}). "
                "Define it at the level of a module or a script, and let it use numbers and arrays only: no mechanism, "
                "open file or lock."
            ) from error
        return packed


def _modules(function: Any) -> set[str]:
    """Return the names of the modules of a callable and its parts."""
    names = {getattr(part, "__module__", None) for part in parts(function)}
    return {name for name in names if isinstance(name, str)}


def _unpacked(packed: bytes, owner: str) -> Shipped:
    return Shipped(cloudpickle.loads(packed), owner)


def _importable(module: ModuleType) -> bool:
    """Return whether another process finds a module by name (cloudpickle sends the main script by value)."""
    name = module.__name__
    if name == "__main__" or name in sys.builtin_module_names or "." in name:
        return True
    try:
        return importlib.machinery.PathFinder.find_spec(name) is not None
    except (ImportError, ValueError):
        return False


LONGEST_NAME = 40
"""Largest number of characters of a measured expression that messages use as its name."""
UNLIMITED = 1e300
"""Value that represents no limit."""


@dataclass(frozen=True)
class ControlLoop:
    """Controller of a model."""

    name: str
    rate: float  # samples per second, Hz
    delay: float  # time from a sample until its commands act, s
    measure: OutputMap  # measured quantities
    commands: tuple[str, ...]  # names of commands
    states: tuple[str, ...]  # names of states
    held: Index  # indices of the commands, then of the states, among the auxiliary states of the model
    limits: ParameterMap  # from inputs to the smallest values of the commands, then the largest
    shipped: Shipped | None = field(repr=False)  # the function; None: the controller has a law
    law: Kernel | None = field(repr=False)  # of (time, measured, states, inputs), to commands, then new states
    digest: str = field(default="", repr=False)
    """Hash of all data that affect the controller."""

    def bounds(self, values: Array) -> tuple[Array, Array]:
        """Return smallest and largest commands for inputs (K, input), shape (K, command) each."""
        found = self.limits(values)
        return found[:, : len(self.commands)], found[:, len(self.commands) :]


def loops_of(
    mechanism: Mechanism,
    instances: list[Instance],
    places: list[Placement],
    order: dict[str, int],
    inputs: Sequence[RandomVariable],
    sizes: tuple[int, int, int],
) -> tuple[ControlLoop, ...]:
    """Compile the controllers of a mechanism; arguments as for `output_map`."""
    found: list[ControlLoop] = []
    for instance, place in zip(instances, places, strict=True):
        if not isinstance(instance.component, HeldStates):
            continue
        controller = instance.component.controller
        measured = [_output(mechanism, controller, k, x) for k, x in enumerate(controller.measured)]
        low, high = zip(*controller.limits.values(), strict=True)
        shipped = None if controller.function is None else Shipped(controller.function, controller.where)
        bounds = [sympy.Float(np.sign(float(x)) * UNLIMITED) if x.is_infinite else x for x in (*low, *high)]
        found.append(
            ControlLoop(
                controller.name,
                controller.rate,
                controller.delay,
                output_map(measured, instances, places, order, inputs, sizes),
                tuple(controller.commands),
                tuple(controller.states),
                np.asarray(place.letters["s"], dtype=np.int64),
                ParameterMap.of(bounds, inputs),
                shipped,
                None if controller.law is None else _kernel(controller.law, inputs),
                _digest(controller, measured, shipped),
            )
        )
    return tuple(found)


def _kernel(law: ControlLaw, inputs: Sequence[RandomVariable]) -> Kernel:
    """Compile a law of (time, measured, states, inputs) to commands, then new states."""
    arguments = (t, *law.arguments, *inputs)
    symbols = {x: sympy.Symbol(f"_x{k}", real=True) for k, x in enumerate(arguments)}
    local = [plain(x).xreplace(symbols) for x in law.results]

    def make() -> Kernel:
        import symengine as se

        tables = Tables()
        expressions = tables.applied([tables.converted(x) for x in local])
        return compile_kernel([se.Symbol(f"_x{k}") for k in range(len(arguments))], expressions, tables=tables.known)

    kernel: Kernel = cached(("control law", len(arguments), sympy.srepr(sympy.Tuple(*local))), make)
    return kernel


def _digest(controller: Controller, measured: Sequence[Output], shipped: Shipped | None) -> str:
    about = (controller.name, controller.rate, controller.delay, list(controller.commands), list(controller.states))
    # readable texts omit tables and digits of numbers
    text = sympy.srepr((controller.values, tuple(controller.limits.values()), tuple(x.expression for x in measured)))
    law = sympy.srepr(controller.law.results) if shipped is None and controller.law is not None else ""
    return hashlib.sha256(f"{about} {text} {law if shipped is None else shipped.digest()}".encode()).hexdigest()


def require_controllers(mechanism: Mechanism) -> None:
    """Raise if the controller of a used command was not added, or a measured output is unknown."""
    places = [(f"{type(c).__name__} {c.name!r}", _entries(c.values.values())) for c in mechanism.all_components()]
    places += [(f"output {o.name!r}", [o.expression]) for o in mechanism.observed()]
    places += [(c.where, [x for x in c.measured if not isinstance(x, str)]) for c in mechanism.controllers.values()]
    for where, entries in places:
        for symbol in _held(entries):
            if mechanism.controllers.get(symbol.owner.name) is not symbol.owner:
                raise StudyError(
                    f"{where}: the expression contains {symbol}, but the controller {symbol.owner.name!r} was not "
                    f"added to mechanism {mechanism.name!r}; call mechanism.add(controller)."
                )
    for controller in mechanism.controllers.values():
        for k, entry in enumerate(controller.measured):
            _output(mechanism, controller, k, entry)


def unused_commands(mechanism: Mechanism) -> tuple[Finding, ...]:
    """Return findings on unused commands of each controller."""
    used: set[Any] = set()
    for component in mechanism.all_components():
        used |= _held(_entries(component.values.values()))
    used |= _held([o.expression for o in mechanism.observed()])
    used |= _held([x for c in mechanism.controllers.values() for x in c.measured if not isinstance(x, str)])
    found: list[Finding] = []
    for controller in mechanism.controllers.values():
        unused = [name for name in controller.commands if controller.command(name) not in used]
        if unused:
            listed = " and ".join(map(repr, unused))
            verb = "is" if len(unused) == 1 else "are"
            message = f"{controller.where}: the command{'s' * (len(unused) > 1)} {listed} {verb} not used"
            remedy = f"Pass controller.command({unused[0]!r}) to a component, e.g. as the torque of a Torque"
            found.append(Finding(Severity.WARNING, controller.where, message, remedy))
    return tuple(found)


def _output(mechanism: Mechanism, controller: Controller, k: int, entry: Any) -> Output:
    """Return the output of an entry of `measured`."""
    if not isinstance(entry, str):
        return Output(text if len(text := str(entry)) <= LONGEST_NAME else f"measured[{k}]", entry, "")
    if entry in mechanism.outputs and mechanism.outputs[entry].turn:
        raise StudyError(
            f"{controller.where}: measured[{k}] is the output {entry!r}, an angle that is known only up to whole "
            "turns (angle=True). Results count its turns, but a controller would measure a jump by a turn. Measure "
            "joint.angle or body.angle, which count turns. Or measure the expression of the output itself, which "
            "jumps by turns."
        )
    if entry in mechanism.outputs:
        return Output(entry, mechanism.outputs[entry].expression, mechanism.outputs[entry].units)
    if entry in mechanism.scalars:
        raise StudyError(
            f"{controller.where}: measured[{k}] is the output {entry!r}, which is a scalar output; a controller can "
            "measure only quantities that change over time."
        )
    listed = ", ".join(map(repr, mechanism.outputs)) or "none"
    near = did_you_mean(entry, list(mechanism.outputs)) or "."
    raise StudyError(
        f"{controller.where}: measured[{k}] is {entry!r}, but mechanism {mechanism.name!r} has no such output{near} "
        f"Its outputs are: {listed}. An expression, such as body.position[0], can be measured as well."
    )


def _entries(values: Any) -> list[Any]:
    return [x for value in values for x in flatten(value)]


def _held(entries: list[Any]) -> set[HeldSymbol]:
    return {s for x in entries for s in getattr(x, "free_symbols", ()) if isinstance(s, HeldSymbol)}
