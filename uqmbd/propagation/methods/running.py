"""Outputs without a time, and requirements, in every method: each is run on them as if they were outputs over time.

Some outputs may not happen in a realisation (`uqmbd.first_time`).  It is left out then, and counted; the other outputs
have it.  Samples of those in which it happens are independent samples of it, given that it happens.  A surrogate of it
would go on where it does not happen, with nothing to tell how: the output is refused, alone.
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
from uqmbd.propagation.integration_error import with_integration_error
from uqmbd.propagation.methods.estimate import readable
from uqmbd.propagation.methods.propagator import Propagator
from uqmbd.propagation.methods.studied import Studied
from uqmbd.propagation.problem import Problem
from uqmbd.results import clopper_pearson, requirements_of
from uqmbd.results.chaos import stored_surrogates, verified_std, verified_trials
from uqmbd.results.schema import (
    CHILDREN,
    KIND,
    InputInfo,
    Labels,
    check_kind,
    check_probabilities,
    check_values,
    node_parts,
    statistics_dataset,
    with_default_reasons,
    with_units,
)
from uqmbd.results.statistics import settled
from uqmbd.results.tree import joined_outputs, with_requirements, with_scalars
from uqmbd.threads import one_thread
from uqmbd.wording import format_count

__all__ = ["obstacle_of", "run_method"]


FEW = 2
"""Realisations that statistics are made of, at least."""


def obstacle_of(propagator: Propagator, study: Studied) -> str | None:
    """Return in one sentence why a method cannot do a study, or None; estimate its memory before asking it."""
    if not len(study.mechanism.inputs):
        return propagator.obstacle(study)
    try:
        found = propagator.estimate(study)
    except StudyError as error:
        return str(error).removeprefix(f"{propagator.node_name}: ")
    if found is not None and not found.at_most and (there := _memory()) < found.memory:
        about = f" for {found.detail}" if found.detail else ""
        return (
            f"it would take about {readable(found.memory)} of memory{about}, and this machine has {readable(there)}; "
            "take fewer samples or nodes, a lower order, fewer outputs or fewer output times"
        )
    return propagator.obstacle(study)


def _memory() -> int:
    """Physical memory of this machine, bytes."""
    import psutil

    return int(psutil.virtual_memory().total)


def run_method(propagator: Propagator, problem: Problem, *, check: bool = True) -> xr.DataTree:
    """Run a method on the outputs over time, on those without a time, and on the margins of requirements.

    The same method, with the same options, runs on each kind. Realisations that several kinds need are computed once;
    where statics gives all outputs, nothing is integrated. A method that answers requirements itself
    (`Propagator.requirements`) does so in its first run. Without `check` the integration error is not measured, and
    requirements are answered only by such methods.

    The node has children ``scalars`` and ``requirements`` if there are such outputs; variables of one unit state it.
    Its attribute ``wall_time``, s, is the time of the whole run, and the sum of ``wall_time_integration``,
    ``wall_time_fitting``, ``wall_time_verification``, ``wall_time_error_estimation`` and ``wall_time_other``, for any
    method.
    """
    sizes = format_count(len(problem.inputs), "input"), format_count(len(problem.times), "output time")
    methods.info("%s: begins, %s, %s", problem.label, *sizes)
    with problem.runner.spending.whole(problem.clock) as spent:
        found = with_units(_run_all(propagator, problem, check))
    found.attrs.update(spent)
    if methods.isEnabledFor(logging.INFO):
        about = found.attrs
        methods.info(
            "%s: ends: %s realisations, %s failed, %.3g s",
            *(
                problem.label,
                about.get("realisations", "?"),
                about.get("failures", "?"),
                about.get("wall_time", np.nan),
            ),
        )
    return found


def _run_all(propagator: Propagator, problem: Problem, check: bool) -> xr.DataTree:
    """Run a method on all kinds of outputs."""
    if not check and (problem.model.outputs.names or problem.model.scalars is not None):
        problem = replace(problem, model=replace(problem.model, margins=None))
    model = problem.model
    if model.scalars is None and model.margins is None:
        return _run(propagator, problem, check)
    asked = [problem] if model.outputs.names else []
    asked += [problem.without_time()] if model.scalars is not None else []
    itself = bool(problem.requirements) and propagator.requirements
    if problem.requirements and not (itself and asked):
        asked.append(problem.of_requirements())
    answered = None
    nodes: dict[Kind, xr.DataTree] = {}
    for one in asked:
        given = replace(one, answers_requirements=itself and answered is None)
        announced = problem.label if one is asked[0] else ""
        run = partial(_run, propagator, check=check and one.kind != "requirements", announced=announced)
        with problem.runner.spending.whole(problem.clock) as spent:
            found = _run_scalars(run, propagator, given) if one.kind == "scalars" else run(given)
        found.attrs.update(spent)
        if given.answers_requirements:
            answered, found = _answered(propagator, problem.label, found)
        nodes[one.kind] = found
    inputs = tuple(InputInfo(v.name, v.units, v.description) for v in problem.inputs.variables)
    about = (problem.label, Labels((), inputs, problem.times))
    node = nodes.get("outputs")
    if "scalars" in nodes:
        node = with_scalars(node, nodes["scalars"], *about)
    if "requirements" in nodes:
        found = nodes["requirements"]
        if answered is None:
            answered = requirements_of(found, problem.requirements, model.margins.at_the_end)
        return with_requirements(node, found, *about, answered)
    if answered is not None and node is not None:
        return xr.DataTree.from_dict({**node_parts(node), "requirements": answered}, name=problem.label)
    return nodes["outputs"] if node is None else node


def _run_scalars(run: Callable[[Problem], xr.DataTree], propagator: Propagator, problem: Problem) -> xr.DataTree:
    """Run a method on the outputs without a time.

    Where some may not occur, ``statistics`` are those of the realisations in which they occur; ``censored`` (output,)
    is the share of the others (NaN for methods that do not sample the inputs), ``censored_bound`` (output,) its upper
    bound with 95 % confidence. Further children concern the outputs that always occur, or, without any, the first one
    with results. The attribute ``refused`` names the outputs without statistics, and the reasons.
    """
    if not any(problem.model.scalars.reaching):
        return run(problem)
    every = tuple(output.name for output in problem.labels.outputs)
    sure, nodes = every, list[xr.DataTree]()
    while sure:
        one = problem.choosing(sure)
        found, _, told = _one(run, one)
        late = [name for k, name in enumerate(sure) if one.runner.observed.missing[k]]
        if found is not None and not late:
            nodes.append(found)
            _tell(told)
            break
        sure = tuple(name for name in sure if name not in late)
    shares, refused = dict.fromkeys(sure, 0.0), dict[str, str]()
    trials = dict.fromkeys(sure, _trials(nodes[0], one.runner.observed) if sure else 0.0)
    for name in every:
        if name in sure:
            continue
        one = problem.choosing((name,))
        found, why, told = _one(run, one)
        if found is not None and (not one.runner.observed.missing or "samples" in found.children):
            _tell(told)  # what is refused needs no warnings of how it was found
        missing, counted = one.runner.observed.missing[0], one.runner.observed.counted
        samples = any("samples" in node.children for node in ([found] if found is not None else nodes))
        sampled, few = found is not None and samples, samples or (not nodes and counted - missing < FEW)
        # what a surrogate is made of is no sample of the inputs
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
    """Return how large a share may be of which a number of independent trials tell, with 95 % confidence."""
    return share if np.isnan(share) else float(clopper_pearson(share * trials, trials)[1])


def _trials(node: xr.DataTree, seen: Observed) -> float:
    """Return as how many independent samples of the inputs the realisations of a method count."""
    return seen.counted if "samples" in node.children else verified_trials(node)


def _one(
    run: Callable[[Problem], xr.DataTree], problem: Problem
) -> tuple[xr.DataTree | None, str, list[warnings.WarningMessage]]:
    """Run a method on outputs that may not happen; or why that is impossible; and of what it would warn."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            found, why = run(problem), ""
        except IntegrationError as error:
            if not problem.runner.observed.missing:
                raise
            found, why = None, str(error)
    return found, why, told


def _tell(told: list[warnings.WarningMessage]) -> None:
    """Warn of what a run that counts has warned of."""
    for warning in told:
        warnings.warn(warning.message, stacklevel=5)


def _late(seen: Observed, why: str, *, few: bool) -> str:
    """Return why an output that does not happen in some realisations has no statistics; `why`: what else went wrong."""
    missing, counted = seen.missing[0], seen.counted
    if missing == counted:
        words = "it does not happen in any realisation until the last output time; take later times"
    elif few:
        words = (
            f"it does not happen in {missing} of {counted} realisations until the last output time, and the others are "
            "too few; take later times, or more samples"
        )
    else:
        words = (
            f"it does not happen in {missing} of {counted} realisations, and a surrogate would go on beyond the "
            "others; take a method that samples, as MonteCarlo, later times, or a quantity that each realisation has, "
            "as uqmbd.maximum"
        )
    return f"{words}. Besides, realisations failed: {why.rstrip('.')}" if why and seen.failed else words


def _nothing(propagator: Propagator, problem: Problem) -> xr.DataTree:
    """Make a node without numbers."""
    unknown = np.full(problem.labels.shape, np.nan)
    statistics = statistics_dataset(problem.labels, mean=unknown, std=unknown)
    return problem.node(propagator, statistics, realisations=problem.runner.observed.counted)


def _answered(propagator: Propagator, label: str, node: xr.DataTree) -> tuple[xr.Dataset, xr.DataTree]:
    """Take the requirements that a method answers itself out of its node."""
    kind = type(propagator)
    if "requirements" not in node.children:
        raise StudyError(
            f"{label}: {kind.__module__}.{kind.__qualname__} declares that it answers requirements, and returned a "
            "node without a child 'requirements'; expected one of uqmbd.extend.requirements_dataset."
        )
    parts = node_parts(node)
    own = parts.pop("requirements")
    if {"violation_probability", "std_error", "interval"} <= set(own.data_vars):
        own = _stated(own, "requirements", propagator, label)
        _usable(lambda: check_probabilities(own, "requirements"), propagator, label)
    return own, xr.DataTree.from_dict(parts, name=node.name)


def _run(propagator: Propagator, problem: Problem, check: bool, announced: str = "") -> xr.DataTree:
    """Run a method on one kind of outputs; however many parts it computes, its progress ends once.

    `announced`: the label of the announced method whose realisations these are; empty: that of the problem.
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
            f"{problem.label}: realisations were computed on machines of more than one type, or of another than this: "
            f"{machines['machines']}. Their last bits may differ from those of another run with the same seed.",
            StudyWarning,
            stacklevel=4,
        )
    with problem.timed("error estimation"):
        node = with_integration_error(node, problem) if check else node
    progress.end()
    statistics = node.children["statistics"]
    seen = verified_std(node, statistics["std"].shape)
    # in its place: a tree copies what is put into it
    statistics.dataset = settled(statistics.to_dataset(inherit=False), problem.rtol, seen)
    # intervals of probabilities hold the error of the surrogate
    if problem.kind != "requirements" and (stored_surrogates(node) or "verification_error" in statistics):
        about = problem.label, problem.rtol, problem.runner.observed.extent
        warn_of_surrogates(node, *about, timeless=problem.timeless)
    return node


def _checked(propagator: Propagator, problem: Problem, node: Any) -> xr.DataTree:
    """Return the result of a method after validation of its type, name and axes.

    Raise StudyError if it is no node with mean and standard deviation of the outputs at the times of the problem. Raise
    it also if a statistic is impossible, such as a negative standard deviation, or a mean that is NaN without a reason.
    Warn if shape statistics or standard errors are NaN without a reason: they get the default one.
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
    """Give NaN without a reason the default one where a method need not state it, and warn."""
    found, lacking = with_default_reasons(data, end=end)
    if lacking:
        kind = type(propagator)
        words = "; ".join(f"{path}/{name} of {', '.join(map(repr, names))}" for name, names in lacking.items())
        warnings.warn(
            f"{label}: propagate of {kind.__module__}.{kind.__qualname__} returned NaN without a reason: {words}. The "
            "reason is recorded as 'not stated'. State it by uqmbd.extend.with_reasons.",
            StudyWarning,
            stacklevel=5,
        )
    return found


def _usable(check: Callable[[], None], propagator: Propagator, label: str) -> None:
    """Check values; say whose they are where they cannot be used."""
    kind = type(propagator)
    try:
        check()
    except StudyError as error:
        who = f"{label}: propagate of {kind.__module__}.{kind.__qualname__}"
        raise StudyError(f"{who} returned a node that cannot be used: {error}") from None
