"""Calls of public names in which one argument is a text that leaves a file behind if it is executed as Python.

The calls are those of the examples in docstrings, so that all other arguments are right and the wrong one gets as far
as it can.  Each public name has an example.
"""

from __future__ import annotations

import ast
import contextlib
import doctest
import inspect
import io
import json
import math
import os
import re
import resource
import signal
import sys
import tempfile
import warnings
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import uqmbd

SECONDS = 20
"""Of processor time, after which a call counts as one that was accepted and computes."""


SHARE = float(os.environ.get("UQMBD_MALFORMED_SHARE", "0.125"))
"""Share of the values that the sweeps try for each argument, at least one; 1: all, which takes hours."""

MEMORY = 2 << 30
"""Bytes that a call may take."""


def _memory() -> int:
    """Return the bytes of address space that this process has."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    return pages * resource.getpagesize()


@dataclass(frozen=True)
class Probe:
    """A call, the argument that was replaced, by what, and what became of it."""

    call: str
    argument: str
    payload: str
    fate: str  # "refused", "accepted", "executed", or the name of a raw error
    message: str = ""


def payloads(mark: Path) -> dict[str, Any]:
    """Return a text that makes a file if it is executed, and containers with it."""
    code = f"__import__('pathlib').Path({str(mark)!r}).touch()"
    return {
        "text": code,
        "tuple": (code, code),
        "list": [code],
        "dict": {"a": code},
        "set": frozenset({code}),
        "nested": [(1, {code: (code,)}), [[code]]],
        "array": np.array([code, code]),
        "scalar array": _scalar_array((code,)),
        "NumPy text": np.str_(code),
    }


def _scalar_array(value: object) -> Any:
    """Return an array without dimensions that holds an object."""
    found = np.empty((), dtype=object)
    found[()] = value
    return found


Values = Callable[[Path], dict[str, Any]]
"""From the place of a mark to what takes the place of an argument, by its name."""


def chosen(name: str, target: int | str, keys: Iterable[str], share: float) -> list[str]:
    """Return a share of the values of an argument, at least one: the same ones in each run, others per argument."""
    ranked = sorted(keys, key=lambda key: zlib.crc32(f"{name}/{target}/{key}".encode()))
    return ranked[: max(1, math.ceil(share * len(ranked)))]


def added(made: Any, names: dict[str, Any]) -> None:
    """Use what an accepted call returned: numbers of a component are checked when it is added."""
    if isinstance(made, uqmbd.Component):
        for mechanism in [x for x in [*names.values()] if isinstance(x, uqmbd.Mechanism)]:
            mechanism.add(made)


Use = Callable[[Any, dict[str, Any]], None]


def probes(
    docstring: str,
    known: dict[str, Any],
    folder: Path,
    wanted: Callable[[str], bool],
    values: Values = payloads,
    use: Use = added,
    share: float = 1.0,
) -> list[Probe]:
    """Run the examples of a docstring, and at each call of uqmbd all variants of it with one wrong argument.

    Parameters
    ----------
    docstring : str
    known : dict
        Names that it uses: those of its module.
    folder : Path
        An empty one, for the trace.
    wanted : callable
        Tells of a call, by the name of the function, whether its variants are tried; asked once for a call.
    values : callable
        What takes the place of each argument.
    use : callable
        What is done with the result of a call that was accepted, and the names of the example.
    share : float
        Of the values of each argument.
    """
    found: list[Probe] = []
    mark = folder / "mark"
    parent = os.getpid()

    def call(function: Any, /, *given: Any, **named: Any) -> Any:
        name = _name_of(function)
        # classes and functions of an example make calls in the children, too: only those of the parent have variants
        if name and os.getpid() == parent and wanted(name):
            found.extend(variants(name, function, given, named, mark, names, values, use, share))
        return function(*given, **named)

    names: dict[str, Any] = {**known, "__probed_call__": call, "__name__": "__main__"}
    for example in doctest.DocTestParser().get_examples(docstring):
        if example.exc_msg or doctest.SKIP in example.options:
            continue
        tree = ast.fix_missing_locations(_Calls().visit(ast.parse(example.source)))
        with contextlib.redirect_stdout(io.StringIO()):
            exec(compile(tree, "<example>", "exec"), names)  # noqa: S102 - examples of this repository
    return found


class _Calls(ast.NodeTransformer):
    """Send every call through ``__probed_call__``."""

    def visit_Call(self, node: ast.Call) -> ast.AST:  # noqa: N802
        self.generic_visit(node)
        if isinstance(node.func, ast.Name) and node.func.id in ("super", "locals"):
            return node
        return ast.copy_location(
            ast.Call(ast.Name("__probed_call__", ast.Load()), [node.func, *node.args], node.keywords), node
        )


def _name_of(function: Any) -> str:
    """Return the full name of a function or class of uqmbd; empty for others."""
    module = getattr(function, "__module__", None) or ""
    name = getattr(function, "__qualname__", type(function).__qualname__)
    return f"{module}.{name}" if re.match(r"uqmbd(_\w+)?(\.|$)", module) else ""


def _targets(function: Any, given: tuple[Any, ...], named: dict[str, Any]) -> Iterator[int | str]:
    """Yield the arguments of a call: those that were given by place, then names of all others."""
    yield from range(len(given))
    known = list(named)
    if isinstance(function, type) and issubclass(function, uqmbd.Component):
        known += [key for key in function.parameters() if key not in known]
    try:
        signature = inspect.signature(function)
        bound = signature.bind_partial(*given, **named).arguments
        free = [k for k, x in signature.parameters.items() if x.kind in (x.POSITIONAL_OR_KEYWORD, x.KEYWORD_ONLY)]
        known += [key for key in free if key not in bound and key not in known]
    except (TypeError, ValueError):
        pass
    yield from known


def variants(
    name: str,
    function: Any,
    given: tuple[Any, ...],
    named: dict[str, Any],
    mark: Path,
    names: dict[str, Any],
    values: Values = payloads,
    use: Use = added,
    share: float = 1.0,
) -> Iterator[Probe]:
    """Try all variants of a call, in children of this process: none changes what the example works with."""
    keys = list(values(mark))
    cases = [(target, key) for target in _targets(function, given, named) for key in chosen(name, target, keys, share)]
    while cases:
        # no pipe: processes that a call started would hold it open
        with tempfile.TemporaryFile() as file:
            sys.stdout.flush(), sys.stderr.flush()
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DeprecationWarning)  # of threads: the child uses none
                child = os.fork()
            if not child:
                try:
                    os.setpgid(0, 0)
                    _try_in_child(function, given, named, cases, mark, names, file.fileno(), values, use)
                finally:  # an error would make the child run the tests that follow
                    os._exit(1)
            os.waitpid(child, 0)
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(child, signal.SIGKILL)
            file.seek(0)
            lines = [json.loads(line) for line in file]
        for (target, key), (fate, message) in zip(cases, lines, strict=False):
            yield Probe(name, str(target), key, fate, message)
        tried = len(lines)
        if not lines or lines[-1][0] not in ("accepted", "executed") and tried < len(cases):
            yield Probe(name, str(cases[tried][0]), cases[tried][1], "died", "")
            tried += 1
        cases = cases[tried:]


def _text(error: BaseException) -> str:
    """Return what an error says; text of foreign objects in it may raise another one."""
    try:
        return str(error)
    except Exception as other:  # noqa: BLE001 - str() of any object may raise anything
        return f"without a text: {type(other).__name__}"


def _try_in_child(
    function: Any,
    given: tuple[Any, ...],
    named: dict[str, Any],
    cases: list[tuple[int | str, str]],
    mark: Path,
    names: dict[str, Any],
    write: int,
    values: Values,
    use: Use,
) -> None:
    """Try variants of a call up to the first that is accepted, write what became of each, and end the process."""
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    null = os.open(os.devnull, os.O_RDWR)
    os.dup2(null, 1), os.dup2(null, 2)
    warnings.simplefilter("ignore")
    # what takes all the memory there is would end other programs
    resource.setrlimit(resource.RLIMIT_AS, (_memory() + MEMORY, resource.RLIM_INFINITY))
    for target, key in cases:
        payload = values(mark)[key]
        places, words = list(given), dict(named)
        if isinstance(target, int):
            places[target] = payload
        else:
            words[target] = payload
        mark.unlink(missing_ok=True)
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        signal.alarm(20 * SECONDS)
        fate, message = "accepted", ""
        try:
            use(function(*places, **words), names)
        except uqmbd.UqmbdError as error:
            fate, message = "refused", str(error)
        except BaseException as error:  # noqa: BLE001 - it is reported
            fate, message = type(error).__name__, _text(error)
        fate = "executed" if mark.exists() else fate
        os.write(write, (json.dumps([fate, message[:200]]) + "\n").encode())
        if fate in ("accepted", "executed"):
            break
    os._exit(0)
