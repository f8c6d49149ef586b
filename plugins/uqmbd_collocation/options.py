"""Options of a collocation, checked: values that cannot be used, and options that contradict each other."""

from __future__ import annotations

import dataclasses
import warnings
from numbers import Real
from operator import index
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

import uqmbd

if TYPE_CHECKING:
    from uqmbd_collocation.propagator import Collocation

__all__ = ["GRIDS", "Adaptive", "Method", "Rule", "Terms", "Transform", "check_options"]

Method = Literal["projection", "regression", "omp", "lars"]
Rule = Literal["gauss", "smolyak", "clenshaw-curtis", "sobol", "latin-hypercube", "halton", "random"]
Terms = Literal["total", "tensor", "hyperbolic"]
Adaptive = Literal["no", "order", "dimension"]
Transform = Literal["rosenblatt", "nataf"]

GRIDS = ("gauss", "smolyak", "clenshaw-curtis")

_LEAST = {"order": 0, "level": 0, "samples": 2, "max_realisations": 1, "verify": 0, "seed": 0}
_CHOICES = {"index_set": Terms, "method": Method, "rule": Rule, "adaptive": Adaptive, "transform": Transform}


def check_options(options: Collocation) -> None:
    """Raise where an option cannot be used; put numbers of any kind into plain ones.

    Raises
    ------
    uqmbd.StudyError
        Which option, what was given, what was expected.
    """
    for name, least in _LEAST.items():
        value = getattr(options, name)
        if value is not None or name not in ("level", "samples"):
            _set(options, name, _whole(name, value, least))
    for name, kind in _CHOICES.items():
        value, known = getattr(options, name), get_args(kind)
        if value not in known and not (name == "rule" and value is None):
            raise uqmbd.StudyError(f"Collocation: {name} is {value!r}; expected one of {', '.join(map(repr, known))}.")
    if options.nodes is not None:
        _set(options, "nodes", tuple(_whole("nodes", n, 1) for n in np.atleast_1d(options.nodes).tolist()))
    if options.weights is not None:
        if not isinstance(options.weights, (int, float, tuple, list, np.ndarray)):
            raise uqmbd.StudyError(
                f"Collocation: weights is {options.weights!r}; expected a number for each input, in their order."
            )
        _set(options, "weights", tuple(_positive("weights", w) for w in np.atleast_1d(options.weights).tolist()))
    _set(options, "tolerance", _positive("tolerance", options.tolerance))
    _check_contradictions(options)


def _check_contradictions(options: Collocation) -> None:
    uqmbd.ElementLimits(
        "adaptive" if options.elements is None else options.elements, options.max_elements, options.threshold
    )
    if options.elements is not None:
        if options.adaptive != "no":
            raise uqmbd.StudyError(
                f"Collocation: elements={options.elements!r} contradicts adaptive={options.adaptive!r}; elements are "
                "refined by splitting, at a fixed order."
            )
        if not options.order:
            raise uqmbd.StudyError(
                "Collocation: elements are split by their top order; order is 0, expected 1 or more."
            )
    if options.alignment is not None:
        if options.alignment != "events":
            raise uqmbd.StudyError(
                f"Collocation: alignment is {options.alignment!r}; expected 'events', or leave it out."
            )
        _refuse(options, ("nodes", "level", "samples", "elements", "rule"), "alignment='events', which has its own")
        if options.method != "projection" or options.adaptive != "no":
            raise uqmbd.StudyError(
                "Collocation: alignment='events' projects on Gauss nodes at a fixed order; leave method and adaptive "
                "as they are by default."
            )
    if options.method != "projection" and options.rule in GRIDS:
        raise uqmbd.StudyError(
            f"Collocation: method={options.method!r} fits samples, but rule={options.rule!r} is a grid; use "
            "rule='sobol', 'latin-hypercube', 'halton' or 'random', or method='projection'."
        )
    if options.adaptive == "dimension":
        _check_adaptive_dimension(options)
    if options.adaptive == "order":
        _refuse(options, ("nodes", "level", "samples"), "adaptive='order', which chooses it for each order")
        if options.rule == "latin-hypercube":
            raise uqmbd.StudyError(
                "Collocation: rule='latin-hypercube' cannot be extended, so that adaptive='order' would use no "
                "realisation again; use rule='sobol'."
            )
    for name, rules in {"nodes": ("gauss",), "level": ("smolyak", "clenshaw-curtis")}.items():
        if options.design not in rules:
            expected = " or ".join(f"rule={rule!r}" for rule in rules)
            _refuse(options, (name,), f"rule={options.design!r}; it is for {expected}")
    defaults = {f.name: f.default for f in dataclasses.fields(options)}
    for names, used, what in (
        (("tolerance",), options.adaptive != "no" or options.alignment is not None, "adaptive='no'"),
        (("max_elements",), options.elements is not None or options.alignment is not None, "elements=None"),
        (("threshold",), options.elements is not None, "elements=None"),
    ):
        for name in names if not used else ():
            if (given := getattr(options, name)) != defaults[name]:
                text = f"Collocation: {name}={given!r} has no effect with {what}; leave it out, or change the latter."
                warnings.warn(text, uqmbd.StudyWarning, stacklevel=5)
    if options.grid:
        _refuse(options, ("samples",), f"rule={options.grid!r}, a grid; give nodes or level, or a rule such as 'sobol'")


def _check_adaptive_dimension(options: Collocation) -> None:
    if options.method != "projection" or options.rule not in (None, "smolyak"):
        raise uqmbd.StudyError(
            "Collocation: adaptive='dimension' refines a sparse grid; leave method and rule as they are by default."
        )
    _refuse(
        options, ("nodes", "level", "samples", "weights"), "adaptive='dimension', which finds out what each input needs"
    )
    if options.index_set != "total":
        raise uqmbd.StudyError(
            f"Collocation: index_set={options.index_set!r} contradicts adaptive='dimension', which chooses the terms."
        )


def _refuse(options: Collocation, names: tuple[str, ...], by: str) -> None:
    for name in names:
        if getattr(options, name) is not None:
            raise uqmbd.StudyError(f"Collocation: {name}={getattr(options, name)!r} means nothing with {by}.")


def _whole(name: str, value: Any, least: int) -> int:
    try:
        number = index(value)
    except TypeError:
        number = least - 1
    if number < least or isinstance(value, bool):
        raise uqmbd.StudyError(f"Collocation: {name} is {value!r}; expected a whole number, {least} or more.")
    return number


def _positive(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, Real) or not 0 < float(value) < np.inf:
        raise uqmbd.StudyError(f"Collocation: {name} is {value!r}; expected a number above 0.")
    return float(value)


def _set(options: Collocation, name: str, value: Any) -> None:
    object.__setattr__(options, name, value)
