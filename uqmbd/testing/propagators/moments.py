"""Compare nodes of propagators with reference data (schema, names, units, moments), and two nodes bit by bit."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.propagation import Propagator, Study
from uqmbd.results import validate
from uqmbd.results.chaos import stored_surrogates
from uqmbd.testing.solutions import ReferenceSolution
from uqmbd.typing import Array

__all__ = ["check_moments", "check_schema", "difference", "stated_errors"]


ERRORS = 5.0
"""Allowed error of an estimate, in standard errors; one in a million normal estimates exceeds it."""

SURROGATE = 3.0
"""Allowed error of moments of a surrogate, in verification errors, which come from few realisations."""

SILENT = 0.5
"""A stated error above this multiple of the output's standard deviation contains no information."""


def check_schema(node: xr.DataTree, propagator: Propagator, study: Study, what: str) -> None:
    """Check that a node conforms to the schema and states propagator and study; messages begin with `what`."""
    assert isinstance(node, xr.DataTree), (
        f"{what}: schema: the method 'propagate' returned {type(node).__name__}; expected xarray.DataTree."
    )
    assert "statistics" in node.children, f"{what}: schema: the node has no child 'statistics'."
    try:
        validate(node)
    except StudyError as error:
        raise AssertionError(f"{what}: schema: {error}") from None
    statistics = node.children["statistics"]
    model = study.model.outputs
    _same(statistics, "output", model.names, f"{what}: schema: names of outputs")
    _same(statistics, "output_units", model.units, f"{what}: schema: units of outputs")
    _same(statistics, "time", study.times.tolist(), f"{what}: schema: output times")
    if model.turns.any():
        _same(statistics, "output_angle", model.turns.tolist(), f"{what}: schema: outputs that are angles")
    inputs = study.mechanism.inputs
    for part in node.subtree:
        if "input" in part.coords and part.coords["input"].dims == ("input",) and "input_units" in part.coords:
            _same(part, "input", inputs.names, f"{what}: schema: {part.path}: names of inputs")
            _same(
                part,
                "input_units",
                [v.units for v in inputs.variables],
                f"{what}: schema: {part.path}: units of inputs",
            )
    expected: dict[str, Any] = {"propagator": propagator.name, "label": propagator.node_name}
    if hasattr(propagator, "seed"):
        expected["seed"] = propagator.seed
    for name, value in expected.items():
        found = node.attrs.get(name)
        assert found == value, f"{what}: schema: attribute {name!r} is {found!r}; expected {value!r}."
    assert node.name == propagator.node_name, (
        f"{what}: schema: the name of the node is {node.name!r}; expected {propagator.node_name!r}."
    )
    options = {f.name for f in dataclasses.fields(propagator)} - {"label"}
    missing = sorted(options - set(json.loads(node.attrs["options"])))
    assert not missing, f"{what}: schema: the attribute 'options' does not contain the option {missing[0]!r}."


def _same(node: xr.DataTree, name: str, expected: Any, what: str) -> None:
    found = node.coords[name].values.tolist() if name in node.coords else None
    assert found == list(expected), f"{what} are {found}; expected {list(expected)}."


def stated_errors(node: xr.DataTree) -> tuple[Array, Array]:
    """Return the allowed errors of mean and standard deviation from the statements of the method, each (output, time).

    The factor of standard errors is `ERRORS`. The root mean square error of a surrogate bounds the errors of its mean
    and standard deviation, and has the factor `SURROGATE`.
    """
    statistics = node.children["statistics"].to_dataset()
    shape = statistics["mean"].shape
    surrogate = np.zeros(shape)
    std = statistics["std"].values
    spread = np.maximum(std, 0.01 * std.max(axis=-1, keepdims=True))
    for _, data, rows in stored_surrogates(node):
        if "verification_error" in data:
            # several elements are independent, and the largest error bounds all errors
            error = data["verification_error"]
            stated = error.max([d for d in error.dims if d not in ("output", "time")]).values
        elif "verification_error" in statistics:
            stated = statistics["verification_error"].values[rows]
        else:
            continue
        surrogate[rows] = SURROGATE * stated * spread[rows]
    if "stated_error" in statistics:
        surrogate = np.maximum(surrogate, SURROGATE * statistics["stated_error"].values)
    names = ("std_error_mean", "std_error_std")
    noise = [ERRORS * statistics[n].values if n in statistics else np.zeros(shape) for n in names]
    return noise[0] + surrogate, noise[1] + surrogate


def check_moments(node: xr.DataTree, known: ReferenceSolution, tolerance: float, what: str) -> None:
    """Compare mean, standard deviation and, if given, first-order Sobol' indices with reference values.

    `tolerance` is the allowed error in addition to stated errors, relative to the largest standard deviation of an
    output over time. Messages begin with `what`.
    """
    statistics = node.children["statistics"].to_dataset()
    scale = known.std.max(axis=1, keepdims=True)
    for name, words, stated in zip(("mean", "std"), ("mean", "standard deviation"), stated_errors(node), strict=True):
        found, exact = statistics[name].values, getattr(known, name)
        error, allowed = np.abs(found - exact), stated + tolerance * scale
        # for a constant, closed form and integration agree except for rounding
        allowed = allowed + 1e-6 * scale
        bad = ~(error <= allowed)
        if bad.any():
            k = _worst(error / allowed)
            raise AssertionError(
                f"{what}: moments: the {words} of {_where(statistics, k)} is {found[k]:.6g}; the exact value is "
                f"{exact[k]:.6g}. The error {error[k]:.2g} exceeds {allowed[k]:.2g}, the sum of the stated error "
                f"{stated[k]:.2g} and of {tolerance:g} times the standard deviation {scale[k[0], 0]:.4g}."
            )
        silent = stated > SILENT * scale * (ERRORS if "std_error_mean" in statistics else SURROGATE)
        if silent.any():
            k = _worst(stated / scale)
            raise AssertionError(
                f"{what}: moments: the stated error of the {words} of {_where(statistics, k)} is {stated[k]:.2g}, "
                f"too large next to the standard deviation {scale[k[0], 0]:.2g}. Give the method finer settings, or "
                "correct the stated error."
            )
    if "sobol_first" in statistics and known.sobol_first is not None:
        _check_sobol(statistics, known.sobol_first, tolerance, what)


def _check_sobol(statistics: xr.Dataset, exact: Array, tolerance: float, what: str) -> None:
    found = statistics["sobol_first"].values
    allowed = np.full(found.shape, tolerance + 1e-6)
    if "sobol_first_interval" in statistics:  # 95 %: two standard errors on each side
        lower, upper = statistics["sobol_first_interval"].transpose("bound", ...).values
        allowed += ERRORS / 2 * np.maximum(upper - found, found - lower)
    wrong = np.isfinite(exact) & ~(np.abs(found - exact) <= allowed)
    if wrong.any():
        k = _worst(np.where(wrong, np.nan_to_num(np.abs(found - exact), nan=np.inf), 0))
        name = statistics["input"].values[k[0]]
        raise AssertionError(
            f"{what}: moments: the first-order Sobol' index of input {name!r} for {_where(statistics, k[1:])} is "
            f"{found[k]:.4g}; the exact value is {exact[k]:.4g}, and the allowed error is {allowed[k]:.2g}."
        )


def _worst(values: Array) -> tuple[Any, ...]:
    return np.unravel_index(int(np.argmax(np.nan_to_num(values, nan=np.inf))), values.shape)


def _where(statistics: xr.Dataset, index: tuple[Any, ...]) -> str:
    return f"{str(statistics['output'].values[index[0]])!r} at {statistics['time'].values[index[1]]:g} s"


def difference(one: xr.DataTree, two: xr.DataTree) -> str:
    """Return the first position at which the data of two nodes differ in a bit, or an empty text.

    Attributes and computing times are not compared.
    """
    first, second = ({p.path[len(n.path) :].strip("/"): p for p in n.subtree} for n in (one, two))
    if first.keys() != second.keys():
        return f"one result has the children {sorted(first)}, the other has {sorted(second)}"
    for path, part in first.items():
        a, b = part.to_dataset(inherit=False), second[path].to_dataset(inherit=False)
        if set(a.variables) != set(b.variables):
            return (
                f"{path!r} has the variables {sorted(map(str, a.variables))} in one result, "
                f"{sorted(map(str, b.variables))} in the other"
            )
        for name in a.variables:
            if found := _differs(a[name], b[name]):
                return f"{'/'.join(filter(None, (path, str(name))))!r} {found}"
    return ""


def _differs(a: xr.DataArray, b: xr.DataArray) -> str:
    x, y = a.values, b.values
    if x.shape != y.shape or x.dtype.kind != y.dtype.kind:
        return f"has the shape {x.shape} and the type {x.dtype} in one result, {y.shape} and {y.dtype} in the other"
    if x.dtype.kind != "f":
        return "" if np.array_equal(x, y) else "differs"
    if x.tobytes() == y.tobytes() or np.array_equal(x, y, equal_nan=True):
        return ""
    off = np.where((x == y) | (np.isnan(x) & np.isnan(y)), 0.0, np.nan_to_num(np.abs(x - y), nan=np.inf))
    k = _worst(off)
    place = ", ".join(
        f"{dim} {a.coords[dim].values[i] if dim in a.coords else i}" for dim, i in zip(a.dims, k, strict=True)
    )
    return (
        f"is {x[k]:.17g} in one result and {y[k]:.17g} in the other at {place}, the largest of "
        f"{np.count_nonzero(off)} differences"
    )
