"""Decorator that checks the arguments of public functions by their annotations."""

from __future__ import annotations

import ast
import contextlib
import functools
import inspect
import os
import sys
import textwrap
import types
import typing
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from uqmbd.arguments.annotations import Numbers, fits, for_each_annotation, is_array_type, members
from uqmbd.arguments.expected import refusal, shown
from uqmbd.errors import StudyError
from uqmbd.names import check_arguments, checked

__all__ = ["typechecked"]

F = TypeVar("F", bound=Callable[..., Any])

_CHECKED = (bool, int, float, complex, str, bytes, type, tuple, list, dict, set, frozenset, np.ndarray, Numbers)
"""Types whose values, or entries, are checked one by one."""

_HEAP = 1 << 9
"""Flag ``Py_TPFLAGS_HEAPTYPE`` of classes defined in Python code."""


@typing.overload
def typechecked(called: F) -> F: ...
@typing.overload
def typechecked(*, values: bool) -> Callable[[F], F]: ...
def typechecked(called: F | None = None, *, values: bool = True) -> F | Callable[[F], F]:
    """Check the arguments of a function, or of a class and its public methods, by their annotations.

    The check covers texts, numbers with their `Bounds`, truth values, words of a ``Literal``, paths and functions.
    It also covers instances of classes, sequences and mappings with their entries, and arrays.  It does not cover
    shapes and arguments declared as ``Any``.  A sequence is converted if the annotation is an array of NumPy.

    A ``float`` is a finite number.  ``Annotated[float, "or NaN"]`` also allows NaN, and
    ``Annotated[float, "or infinite"]`` infinity.

    Parameters
    ----------
    called : function or class
        Function or class written in Python.  For a dataclass, place this decorator above ``@dataclass``.
    values : bool
        False: check only that all arguments exist and none is missing, for functions that check their values with more
        specific messages.  Of a class, this covers the constructor.

    Returns
    -------
    function or class
        Checked function or class with the same signature.  A class is changed in place.

    Raises
    ------
    uqmbd.StudyError
        If `called` is not a function or class written in Python.  A call of the result raises this error if an argument
        does not fit.  The message states the argument, its value and the expected values.

    Examples
    --------
    >>> import uqmbd
    >>> @uqmbd.extend.typechecked
    ... def share(part: float, of: float = 1.0) -> float:
    ...     return part / of
    >>> share("0.5")
    Traceback (most recent call last):
    uqmbd.errors.StudyError: share: part is '0.5'; expected a number.
    """
    if called is None:
        return functools.partial(typechecked, values=values)
    if isinstance(called, type):
        written = bool(called.__flags__ & _HEAP)
    else:
        written = isinstance(called, types.FunctionType)
    if not written:
        raise StudyError(
            f"typechecked: the argument 'called' is {shown(called)}; expected a function or a class written in Python."
        )
    one: Any = called
    if not values:
        return typing.cast("F", checked(one))
    if not isinstance(called, type):
        return typing.cast("F", _of_function(called))
    for name, member in list(vars(one).items()):
        if name != "__init__" and name.startswith("_"):
            continue
        if isinstance(member, types.FunctionType):
            setattr(one, name, _of_function(member, one))
        elif isinstance(member, (classmethod, staticmethod)):
            setattr(one, name, type(member)(_of_function(member.__func__, one)))
    return called


def _of_function(function: Any, owner: type | None = None) -> Any:
    if hasattr(function, "__kinds__") or getattr(function, "__isabstractmethod__", False):
        return function
    signature = inspect.signature(function)
    what = function.__qualname__.removesuffix(".__init__").removesuffix(".__new__")
    bound = next(iter(signature.parameters), "") in ("self", "cls")
    kinds = functools.cache(lambda: _annotations(function, signature, owner))
    plain = _NamedParameters.of(signature)

    @functools.wraps(function)
    def call(*arguments: Any, **keywords: Any) -> Any:
        given: Any = None if plain is None else plain.bound(arguments, keywords)
        bind = None
        if given is None:
            try:
                bind = signature.bind(*arguments, **keywords)
            except TypeError:
                check_arguments(what, signature, arguments, keywords, bound=bound)
                raise
            given = bind.arguments
        for name, declared, parameter, fitting in kinds():
            if name not in given or type(given[name]) in fitting:
                continue
            if isinstance(given[name], (list, tuple)) and is_array_type(declared):
                with contextlib.suppress(TypeError, ValueError):  # rows of different lengths are not an array
                    given[name] = np.asarray(given[name])
            value = given[name]
            if value is parameter.default:
                continue
            entries = value if parameter.kind is parameter.VAR_POSITIONAL else (value,)
            entries = value.values() if parameter.kind is parameter.VAR_KEYWORD else entries
            for entry in entries:
                if not fits(entry, declared):
                    raise StudyError(f"{what}: {refusal(name, entry, declared)}")
        try:
            return function(**given) if bind is None else function(*bind.args, **bind.kwargs)
        except np.exceptions.AxisError as error:
            if "axis" not in given:
                raise
            raise StudyError(f"{what}: axis is {given['axis']}; {error}.") from None
        except MemoryError:
            sizes = [f"{k} is {shown(x)}" for k, x in given.items() if isinstance(x, np.ndarray)]
            text = f" ({'; '.join(sizes)})" if sizes else ""
            raise StudyError(
                f"{what}: the call needs more memory than is available{text}. Pass smaller arrays."
            ) from None

    call.__kinds__ = kinds  # type: ignore[attr-defined]
    return call


@for_each_annotation
def _fitting_types(annotation: Any) -> frozenset[type]:
    """Return the types all of whose values fit an annotation."""
    found = set[type]()
    every = members(annotation)
    for member in every:
        if member in (None, types.NoneType):
            found.add(types.NoneType)
        elif member is bool or (member is str and not any(typing.get_origin(x) is os.PathLike for x in every)):
            found.add(member)
        elif isinstance(member, type) and member not in _CHECKED and not getattr(member, "_is_protocol", False):
            module = member.__module__
            if not issubclass(member, (os.PathLike, np.generic)) and not module.startswith(("sympy", "typing")):
                found.add(member)
    return frozenset(found)


@dataclass(frozen=True)
class _NamedParameters:
    """Parameters of a signature that are all named; arguments are assigned without `inspect.Signature.bind`."""

    positional: tuple[str, ...]
    names: frozenset[str]
    required: frozenset[str]

    @classmethod
    def of(cls, signature: inspect.Signature) -> _NamedParameters | None:
        """Return the parameters, or None if some are not named."""
        every = signature.parameters.values()
        if any(p.kind not in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY) for p in every):
            return None
        positional = tuple(p.name for p in every if p.kind is p.POSITIONAL_OR_KEYWORD)
        required = frozenset(p.name for p in every if p.default is p.empty)
        return cls(positional, frozenset(signature.parameters), required)

    def bound(self, arguments: tuple[Any, ...], keywords: dict[str, Any]) -> dict[str, Any] | None:
        """Return the arguments by name; None if they do not fit the signature."""
        if len(arguments) > len(self.positional):
            return None
        given = dict(zip(self.positional, arguments, strict=False))
        if not (keywords.keys().isdisjoint(given) and keywords.keys() <= self.names):
            return None
        given.update(keywords)
        return given if self.required <= given.keys() else None


class _Absent:
    """Class without instances; replaces a class of a package that is not loaded."""


def _annotations(
    function: Any, signature: inspect.Signature, owner: type | None
) -> list[tuple[str, Any, inspect.Parameter, frozenset[type]]]:
    """Return names, annotations, parameters and always fitting types of the annotated arguments of a function."""
    found = []
    names: dict[str, Any] | None = None
    # a wrapper, for example by `contextlib.contextmanager`, has the globals of another module
    known = inspect.unwrap(function).__globals__
    if owner is not None:
        known = {**known, "Self": owner}
    for name, parameter in signature.parameters.items():
        declared = parameter.annotation
        if isinstance(declared, str):
            try:
                # the annotation is code of an imported module; no input of a user is evaluated
                declared = eval(declared, known)  # noqa: S307 - text of this package
            except NameError:
                names = _for_checkers(function) if names is None else names
                try:
                    declared = eval(declared, {**names, **known})  # noqa: S307 - the same
                except NameError as error:
                    raise StudyError(
                        f"{function.__qualname__}: typechecked cannot read the annotation {declared!r} of {name}: "
                        f"{error}. Import the name in the module {function.__module__}."
                    ) from None
        if declared is not parameter.empty and declared is not Any and not isinstance(declared, TypeVar):
            single = parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
            found.append((name, declared, parameter, _fitting_types(declared) if single else frozenset()))
    return found


def _for_checkers(function: Any) -> dict[str, Any]:
    """Return the imports of a module under ``TYPE_CHECKING``; placeholders replace modules that are not loaded."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(sys.modules[function.__module__])))
    except (KeyError, OSError, TypeError):  # there is no source file, for example in a notebook
        return {}
    found: dict[str, Any] = {}
    for block in tree.body:
        if not (isinstance(block, ast.If) and ast.unparse(block.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING")):
            continue
        for line in block.body:
            if isinstance(line, ast.Import):
                for alias in line.names:
                    name = alias.asname or alias.name.partition(".")[0]
                    found[name] = sys.modules.get(alias.name if alias.asname else name, types.SimpleNamespace())
            elif isinstance(line, ast.ImportFrom):
                module = sys.modules.get(line.module or "")
                found |= {x.asname or x.name: getattr(module, x.name, _Absent) for x in line.names}
    return found
