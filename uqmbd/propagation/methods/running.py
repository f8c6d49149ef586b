"""Run every method on scalar outputs and requirements as if they were outputs over time.

An output may not occur in a realisation (`uqmbd.first_time`). The statistics of this output omit and count such a
realisation; statistics of other outputs include it. The remaining samples are independent samples of the output, under
the condition that it occurs. A surrogate would extrapolate to realisations without the output, with an unknown error.
A method with a surrogate therefore rejects this output, but no other output.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.errors import IntegrationError, StudyError, StudyWarning
from uqmbd.logs import methods
from uqmbd.progress import UntilTheEnd
from uqmbd.propagation.chaos import warn_of_surrogates
from uqmbd.propagation.execution import Kind, Observed, integrated_by, machine_attribute
from uqmbd.propagation.inputs import input_info
from uqmbd.propagation.integration_error import with_integration_error
from uqmbd.propagation.methods.estimate import readable
from uqmbd.propagation.methods.keys import refused_key, refused_output, require_keys_accepted
from uqmbd.propagation.methods.propagator import Propagator
from uqmbd.propagation.methods.studied import Studied
from uqmbd.propagation.observed_model import several_motions
from uqmbd.propagation.problem import Problem
from uqmbd.randomness import why_not_drawn
from uqmbd.results import clopper_pearson, requirements_of
from uqmbd.results.chaos import stored_surrogates, verified_std, verified_trials
from uqmbd.results.schema import (
    CHILDREN,
    KIND,
    Labels,
    check_kind,
    check_probabilities,
    check_values,
    node_parts,
    statistics_dataset,
    total_realisations,
    with_default_reasons,
    with_units,
)
from uqmbd.results.statistics import settled
from uqmbd.results.tree import joined_outputs, with_requirements, with_scalars
from uqmbd.threads import one_thread
from uqmbd.wording import format_count

__all__ = ["obstacle_of", "run_method"]


FEW = 2
"""Minimum number of realisations for statistics."""


def obstacle_of(propagator: Propagator, study: Studied) -> str | None:
    """Return the reason why a method cannot compute a study, in one sentence, or None; check the memory first."""
    if not len(study.mechanism.inputs):
        return propagator.obstacle(study)
    if refused := refused_key(propagator, study.mechanism.inputs) or refused_output(propagator, study.mechanism):
        return refused
    try:
        found = propagator.estimate(study)
    except StudyError as error:
        return str(error).removeprefix(f"{propagator.node_name}: ")
    if found is None or found.at_most:
        return propagator.obstacle(study)
    import psutil

    there = int(psutil.virtual_memory().total)
    if there < found.memory:
        about = f" for {found.detail}" if found.detail else ""
        return (
            f"the method needs about {readable(found.memory)} of memory{about}, but this machine has "
            f"{readable(there)}. Use fewer samples or nodes, a lower order, fewer outputs or fewer output times"
        )
    return propagator.obstacle(study)


def run_method(propagator: Propagator, problem: Problem, *, check: bool = True) -> xr.DataTree:
    """Run a method on the outputs over time, on scalar outputs, and on the margins of requirements.

    The same method, with the same options, runs on each kind. Realisations that several kinds require are computed
    once. If statics determines all outputs, the integration is omitted. A method that evaluates requirements without a
    separate run (`Propagator.requirements`) evaluates them in its first run. Without `check`, the integration error is
    not measured, and only such methods evaluate requirements.

    The node has the child ``scalars`` if there are scalar outputs, and ``requirements`` if there are requirements. If
    all values of a variable have the same unit, the variable has the unit as an attribute. The attribute ``wall_time``
    is the time of the whole run in s. For any method, ``wall_time`` is the sum of ``wall_time_integration``,
    ``wall_time_fitting``, ``wall_time_verification``, ``wall_time_error_estimation`` and ``wall_time_other``. The
    attribute ``further_realisations`` counts those that only scalar outputs or margins of requirements required.
    """
    require_keys_accepted(propagator, problem.inputs)
    sizes = format_count(len(problem.inputs), "input"), format_count(len(problem.times), "output time")
    methods.info("%s: begins, %s, %s", problem.label, *sizes)
    progress = UntilTheEnd(problem.progress, lasting=problem.label)
    problem = problem.using(progress=progress)
    with problem.runner.spending.whole(problem.clock) as spent:
        found, further = _run_all(propagator, problem, check)
        found = with_units(found)
    _require_draws(propagator, problem, found)
    if several := int(problem.runner.observed.counters["two_motions"]):
        where = f"in {several} realisations, two motions satisfy the laws of contact and friction at an event"
        warnings.warn(f"{problem.label}: {several_motions(where)}", StudyWarning, stacklevel=4)
    found.attrs.update(spent)
    if further:
        found.attrs["further_realisations"] = further
    if "scalars" in found.children:  # comparisons of scalar outputs need the costs of the whole method
        costs = {"method_realisations": total_realisations(found), "method_wall_time": found.attrs["wall_time"]}
        found.children["scalars"].attrs.update(costs)
    progress.end(float(found.attrs["wall_time"]))
    if methods.isEnabledFor(logging.INFO):
        about = found.attrs
        methods.info(
            "%s: finished: %s realisations, %s failed, %.3g s",
            *(
                problem.label,
                total_realisations(found),
                about.get("failures", "?"),
                about.get("wall_time", np.nan),
            ),
        )
    return found


def _require_draws(propagator: Propagator, problem: Problem, node: xr.DataTree) -> None:
    """Warn if samples cannot be draws from the joint distribution; reports count draws, but not nodes."""
    if node.attrs.get("population"):  # the method states that its samples have another distribution
        return
    samples = next((part for part in node.subtree if part.name == "samples" and "inputs" in part.data_vars), None)
    if samples is not None and (reason := why_not_drawn(problem.inputs, samples.dataset["inputs"].values)):
        kind = type(propagator)
        warnings.warn(
            f"{problem.label}: propagate of {kind.__module__}.{kind.__qualname__} returned samples that are not draws "
            f"from the joint distribution of the inputs: {reason}. Probabilities, quantiles and histograms that are "
            "computed from them are wrong. Pass training points and quadrature nodes as "
            'nodes=sample_dataset(..., kind="nodes").',
            StudyWarning,
            stacklevel=4,
        )


def _run_all(propagator: Propagator, problem: Problem, check: bool) -> tuple[xr.DataTree, int]:
    """Run a method on all kinds of outputs; return its node, and the number of realisations only for later kinds."""
    if not check and (problem.model.outputs.names or problem.model.scalars is not None):
        problem = replace(problem, model=replace(problem.model, margins=None))
    model = problem.model
    if model.scalars is None and model.margins is None:
        return _run(propagator, problem, check), 0
    problems = [problem] if model.outputs.names else []
    problems += [problem.without_time()] if model.scalars is not None else []
    itself = bool(problem.requirements) and propagator.requirements
    if problem.requirements and not (itself and problems):
        problems.append(problem.of_requirements())
    answered = None
    nodes: dict[Kind, xr.DataTree] = {}
    first = problem.runner.spending.computed
    for one in problems:
        given = replace(one, answers_requirements=itself and answered is None)
        announced = problem.label if one is problems[0] else ""
        run = partial(_run, propagator, check=check and one.kind != "requirements", announced=announced)
        with problem.runner.spending.whole(problem.clock) as spent:
            found = _run_scalars(run, propagator, given) if one.kind == "scalars" else run(given)
        found.attrs.update(spent)
        if given.answers_requirements:
            answered, found = _answered(propagator, problem.label, found)
        nodes[one.kind] = found
        first = problem.runner.spending.computed if one is problems[0] else first
    further = problem.runner.spending.computed - first
    inputs = tuple(map(input_info, problem.inputs.variables))
    about = (problem.label, Labels((), inputs, problem.times))
    node = nodes.get("outputs")
    if "scalars" in nodes:
        node = with_scalars(node, nodes["scalars"], *about)
    if "requirements" in nodes:
        found = nodes["requirements"]
        if answered is None:
            answered = requirements_of(found, problem.requirements, model.margins.at_the_end)
        return with_requirements(node, found, *about, answered), further
    if answered is not None and node is not None:
        return xr.DataTree.from_dict({**node_parts(node), "requirements": answered}, name=problem.label), further
    return nodes["outputs"] if node is None else node, further


def _run_scalars(run: Callable[[Problem], xr.DataTree], propagator: Propagator, problem: Problem) -> xr.DataTree:
    """Run a method on the scalar outputs.

    For an output that may not occur, ``statistics`` refer to the realisations in which the output occurs. ``censored``
    (output,) is the share of the other realisations (NaN for methods that do not sample the inputs). ``censored_bound``
    (output,) is the upper bound of this share with 95 % confidence. Further children contain the outputs that always
    occur, or, if there are none, the first output with results. The attribute ``refused`` contains the outputs without
    statistics, and the reasons.
    """
    if not any(problem.model.scalars.reaching):
        return run(problem)
    every = tuple(output.name for output in problem.labels.outputs)
    sure, nodes = every, list[xr.DataTree]()
    while sure:
        one = problem.choosing(sure)
        found, _, caught = _one(run, one)
        late = [name for k, name in enumerate(sure) if one.runner.observed.missing[k]]
        if found is not None and not late:
            nodes.append(found)
            _tell(caught)
            break
        sure = tuple(name for name in sure if name not in late)
    shares, refused = dict.fromkeys(sure, 0.0), dict[str, str]()
    trials = dict.fromkeys(sure, _trials(nodes[0], one.runner.observed) if sure else 0.0)
    for name in every:
        if name in sure:
            continue
        one = problem.choosing((name,))
        found, why, caught = _one(run, one)
        if found is not None and (not one.runner.observed.missing or "samples" in found.children):
            _tell(caught)  # omit the warnings of rejected outputs
        missing, counted = one.runner.observed.missing[0], one.runner.observed.counted
        samples = any("samples" in node.children for node in ([found] if found is not None else nodes))
        sampled, few = found is not None and samples, samples or (not nodes and counted - missing < FEW)
        # the realisations of a surrogate are not a sample of the inputs
        shares[name] = missing / counted if missing == counted or samples or not missing else np.nan
        trials[name] = counted if samples else _trials(found, one.runner.observed) if found is not None else 0.0
        if found is None or (missing and not sampled):
            refused[name] = why = _late(one.runner.observed, why, few=few)
            warnings.warn(f"{problem.label}: output {name!r} has no statistics: {why}.", StudyWarning, stacklevel=3)
            found = _nothing(propagator, one)
        nodes.append(found)
    may = dict(zip(every, problem.model.scalars.reaching, strict=True))
    bounds = [_bound(shares[name], trials[name]) if may[name] else 0.0 for name in every]
    return joined_outputs(nodes, problem.label, [shares[name] for name in every], bounds, refused, every)


def _bound(share: float, trials: float) -> float:
    """Return the upper bound, at 95 % confidence, of a share that was observed in independent trials."""
    return share if np.isnan(share) else float(clopper_pearson(share * trials, trials)[1])


def _trials(node: xr.DataTree, seen: Observed) -> float:
    """Return the number of independent samples that are equivalent to the realisations of a method."""
    return seen.counted if "samples" in node.children else verified_trials(node)


def _one(
    run: Callable[[Problem], xr.DataTree], problem: Problem
) -> tuple[xr.DataTree | None, str, list[warnings.WarningMessage]]:
    """Run a method on outputs that may not occur; return the node or the obstacle, and the warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            found, why = run(problem), ""
        except IntegrationError as error:
            if not problem.runner.observed.missing:
                raise
            found, why = None, str(error)
    return found, why, caught


def _tell(caught: list[warnings.WarningMessage]) -> None:
    """Issue the warnings of a run whose results are used."""
    for warning in caught:
        warnings.warn(warning.message, stacklevel=5)


def _late(seen: Observed, why: str, *, few: bool) -> str:
    """Return the reason why an output without values in some realisations has no statistics; `why` is appended."""
    missing, counted = seen.missing[0], seen.counted
    if missing == counted:
        words = "its event does not occur in any realisation up to the last output time; use a later end time"
    elif few:
        words = (
            f"its event does not occur in {missing} of {counted} realisations up to the last output time, and the "
            "other realisations are too few. Use a later end time, or more samples"
        )
    else:
        words = (
            f"its event does not occur in {missing} of {counted} realisations, where a surrogate would be an "
            "extrapolation. Use a sampling method, a later end time, or a quantity that exists in every realisation, "
            "such as uqmbd.maximum"
        )
    return f"{words}. In addition, realisations failed: {why.rstrip('.')}" if why and seen.failed else words


def _nothing(propagator: Propagator, problem: Problem) -> xr.DataTree:
    """Make a node that contains no numbers."""
    unknown = np.full(problem.labels.shape, np.nan)
    statistics = statistics_dataset(problem.labels, mean=unknown, std=unknown)
    return problem.node(propagator, statistics, realisations=problem.runner.observed.counted)


def _answered(propagator: Propagator, label: str, node: xr.DataTree) -> tuple[xr.Dataset, xr.DataTree]:
    """Extract from a node the requirements that the method has evaluated."""
    kind = type(propagator)
    if "requirements" not in node.children:
        raise StudyError(
            f"{label}: {kind.__module__}.{kind.__qualname__} declares that it computes requirements, but returned a "
            "node without a child 'requirements'; expected the dataset of uqmbd.extend.requirements_dataset."
        )
    parts = node_parts(node)
    own = parts.pop("requirements")
    if {"violation_probability", "std_error", "interval"} <= set(own.data_vars):
        own = _stated(own, "requirements", propagator, label)
        _usable(lambda: check_probabilities(own, "requirements"), propagator, label)
    return own, xr.DataTree.from_dict(parts, name=node.name)


def _run(propagator: Propagator, problem: Problem, check: bool, announced: str = "") -> xr.DataTree:
    """Run a method on one kind of outputs; report the end of its progress once, even if the method has several parts.

    `announced` is the label of the announced method to which the realisations belong; empty: label of the problem.
    """
    progress = UntilTheEnd(problem.progress, {problem.label: announced or problem.label})
    problem = problem.using(progress=progress)
    with one_thread():
        node = _checked(propagator, problem, propagator.propagate(problem))
    for name, value in integrated_by(problem.runner.observed.counters, problem.integrator).items():
        node.attrs.setdefault(name, value)
    if machines := machine_attribute(problem.runner.observed.counters):
        node.attrs.update(machines)
        warnings.warn(
            f"{problem.label}: realisations were computed on machines of several types, or of a type other than this "
            "one: "
            f"{machines['machines']}. Their last bits may differ from those of another run with the same seed.",
            StudyWarning,
            stacklevel=4,
        )
    with problem.timed("error estimation"):
        node = with_integration_error(node, problem) if check else node
    progress.end()
    statistics = node.children["statistics"]
    held = bool(stored_surrogates(node))
    seen = verified_std(node, problem.labels.shape) if held else None
    data = statistics.to_dataset(inherit=False)
    if (found := settled(data, problem.rtol, seen)) is not data:
        # the dataset is replaced in place, because a tree copies inserted nodes
        statistics.dataset = found
    # intervals of probabilities include the error of the surrogate
    if problem.kind != "requirements" and (held or "verification_error" in statistics.data_vars):
        about = problem.label, problem.rtol, problem.runner.observed.extent
        warn_of_surrogates(node, *about, timeless=problem.timeless)
    return node


def _checked(propagator: Propagator, problem: Problem, node: Any) -> xr.DataTree:
    """Return the result of a method after validation of its type, name and axes.

    Raise StudyError if the result is not a node with mean and standard deviation of the outputs at the times of the
    problem. Raise StudyError also for impossible statistics, such as a negative standard deviation, or a mean that is
    NaN without a reason. Warn if shape statistics or standard errors are NaN without a reason, and add the default
    reason.
    """
    kind = type(propagator)
    who = f"{problem.label}: propagate of {kind.__module__}.{kind.__qualname__} returned"
    expected = "expected the xarray.DataTree that problem.node returns"
    if not isinstance(node, xr.DataTree):
        raise StudyError(f"{who} {type(node).__name__}; {expected}.")
    if node.name != problem.label:
        raise StudyError(f"{who} a node with the name {node.name!r}; {expected}, with the name {problem.label!r}.")
    if "statistics" not in node.children:
        raise StudyError(f"{who} a node without a child 'statistics'; {expected}.")
    statistics = node.children["statistics"].to_dataset()
    for name, child in node.children.items():
        if name == "samples" or (name in CHILDREN and KIND in child.attrs):
            check_kind(child.to_dataset(), name, who.removesuffix(" returned"))
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
    end = node.attrs.get("ends_at", np.inf)
    last = float(end) if isinstance(end, (int, float, np.number)) else np.inf
    stated = _stated(statistics, "statistics", propagator, problem.label, end=last)
    if stated is not statistics:
        node.children["statistics"].dataset = stated
    _usable(lambda: check_values(stated, "statistics", end=last), propagator, problem.label)
    return node


def _stated(data: xr.Dataset, path: str, propagator: Propagator, label: str, *, end: float = np.inf) -> xr.Dataset:
    """Add the default reason to NaN statistics without a reason, if a method may omit it, and warn."""
    found, lacking = with_default_reasons(data, end=end)
    if lacking:
        kind = type(propagator)
        words = "; ".join(f"{path}/{name} of {', '.join(map(repr, names))}" for name, names in lacking.items())
        warnings.warn(
            f"{label}: propagate of {kind.__module__}.{kind.__qualname__} returned NaN without a reason: {words}. "
            "uqmbd records the reason 'not stated'. State the reason with uqmbd.extend.with_reasons.",
            StudyWarning,
            stacklevel=5,
        )
    return found


def _usable(check: Callable[[], None], propagator: Propagator, label: str) -> None:
    """Run a check of values; the error on unusable values states their source."""
    kind = type(propagator)
    try:
        check()
    except StudyError as error:
        who = f"{label}: propagate of {kind.__module__}.{kind.__qualname__}"
        raise StudyError(f"{who} returned an invalid node: {error}") from None
