"""Outputs without a time in every method: each is run on them as if they were outputs at one time."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError, UnusedInputWarning
from uqmbd.propagation.execution import integrated_by
from uqmbd.propagation.integration_error import with_integration_error
from uqmbd.propagation.problem import Problem
from uqmbd.propagation.propagator import Propagator
from uqmbd.results import InputInfo, Labels, with_scalars
from uqmbd.results.chaos import verified_std
from uqmbd.results.statistics import settled
from uqmbd.threads import one_thread

__all__ = ["run_method"]


def run_method(propagator: Propagator, problem: Problem, *, check: bool = True) -> xr.DataTree:
    """Run a method on the outputs over time and on those without a time.

    The same method, with the same options, is run on both.  Realisations that both need are computed once; where all
    outputs come from statics, nothing is integrated for them.

    Returns
    -------
    xarray.DataTree
        The node of the method, with a child ``scalars`` if there are outputs without a time.
    """
    if problem.model.scalars is None:
        return _run(propagator, problem, check)
    over_time = bool(problem.model.outputs.names)
    node = _run(propagator, problem, check, mixed=True) if over_time else None
    found = _run(propagator, problem.without_time(), check, mixed=over_time)
    inputs = tuple(InputInfo(v.name, v.units, v.description) for v in problem.inputs.variables)
    return with_scalars(node, found, problem.label, Labels((), inputs, problem.times))


def _run(propagator: Propagator, problem: Problem, check: bool, *, mixed: bool = False) -> xr.DataTree:
    """Run a method on one kind of outputs."""
    with warnings.catch_warnings():
        if mixed:
            # an input that only one kind of output depends on is not unused
            warnings.simplefilter("ignore", UnusedInputWarning)
        with one_thread():
            node = _checked(propagator, problem, propagator.propagate(problem))
    for name, value in integrated_by(problem.observed.counters, problem.integrator).items():
        node.attrs.setdefault(name, value)
    node = with_integration_error(node, problem) if check else node
    statistics = node.children["statistics"]
    seen = verified_std(node, statistics["std"].shape)
    # in its place: a tree copies what is put into it
    statistics.dataset = settled(statistics.to_dataset(inherit=False), problem.rtol, seen)
    return node


def _checked(propagator: Propagator, problem: Problem, node: Any) -> xr.DataTree:
    """Return what a method gave, after a look at whether others can read it: its kind, its name, and its axes.

    Raises
    ------
    StudyError
        If it is no node with mean and standard deviation of the outputs at the times of the problem.
    """
    kind = type(propagator)
    who = f"{problem.label}: propagate of {kind.__module__}.{kind.__qualname__} returned"
    expected = "expected the xarray.DataTree that problem.node makes"
    if not isinstance(node, xr.DataTree):
        raise StudyError(f"{who} {type(node).__name__}; {expected}.")
    if node.name != problem.label:
        raise StudyError(f"{who} a node that is called {node.name!r}; {expected}, called {problem.label!r}.")
    if "statistics" not in node.children:
        raise StudyError(f"{who} a node without a child 'statistics'; {expected}.")
    statistics = node.children["statistics"].to_dataset()
    axes = problem.labels.output_coords()
    for name in ("mean", "std"):
        if name not in statistics.data_vars:
            raise StudyError(f"{who} a node whose statistics have no {name!r}; {expected}.")
        data = statistics[name]
        if data.dims != problem.labels.dims:
            raise StudyError(f"{who} a node whose {name!r} has the dimensions {data.dims}; {expected}.")
        for axis in ("output", "time"):
            given = data.coords[axis].values if axis in data.coords else None
            if given is None or not np.array_equal(given, axes[axis][1]):
                raise StudyError(f"{who} a node whose {name!r} is not at the {axis}s of the problem; {expected}.")
    return node
