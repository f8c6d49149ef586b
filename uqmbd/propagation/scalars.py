"""Outputs without a time in every method: each is run on them as if they were outputs at one time."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

from uqmbd.errors import StudyError, UnusedInputWarning
from uqmbd.propagation.accuracy import with_integration_error
from uqmbd.results import InputInfo, Labels, with_scalars

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.propagation.problem import Problem
    from uqmbd.propagation.propagator import Propagator

__all__ = ["propagated"]


def propagated(propagator: Propagator, problem: Problem, *, check: bool = True) -> xr.DataTree:
    """Run a method on the outputs over time and on those without a time.

    The same method, with the same options, is run on both.  Realisations that both need are computed once; where all
    outputs come from statics, nothing is integrated for them.

    Parameters
    ----------
    propagator : Propagator
        The method.
    problem : Problem
        Of the study.
    check : bool
        Whether to measure the error of the time integration.

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
    if "statistics" not in found.children:
        raise StudyError(f"{problem.label}: its results have no child 'statistics'; expected a node of a propagator.")
    inputs = tuple(InputInfo(v.name, v.units, v.description) for v in problem.inputs.variables)
    return with_scalars(node, found, problem.label, Labels((), inputs, problem.times))


def _run(propagator: Propagator, problem: Problem, check: bool, *, mixed: bool = False) -> xr.DataTree:
    """Run a method on one kind of outputs."""
    with warnings.catch_warnings():
        if mixed:
            # an input that only one kind of output depends on is not unused
            warnings.simplefilter("ignore", UnusedInputWarning)
        node = propagator.propagate(problem)
    return with_integration_error(node, problem) if check else node
