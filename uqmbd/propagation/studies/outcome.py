"""Run the methods of a study one after another; if one fails, the others still run."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uqmbd.errors import Finding, MethodFailedWarning, StudyError, UqmbdError
from uqmbd.isolation import ERRORS_AND_EXITS, Isolated, reason_of, release
from uqmbd.logs import methods
from uqmbd.progress import AtMost, Progress, choose_receiver, expected, failed
from uqmbd.propagation.budget import BudgetedRun, BudgetTerms, BudgetTooSmallError
from uqmbd.propagation.execution import explained, study_digest, warn_of_changes
from uqmbd.propagation.methods import Estimate, Propagator, Studied, obstacle_of, run_method
from uqmbd.propagation.observed_model import finding_attributes, mechanism_attributes, step_attributes

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Outcome", "joined", "planned", "run_methods"]

UNSTATED = 1000
"""Assumed number of realisations of a method that does not state its number."""


@dataclass(frozen=True)
class Outcome:
    """Results and errors of the methods of a study."""

    nodes: tuple[xr.DataTree, ...]  # nodes of the successful methods
    errors: Mapping[str, BaseException]  # errors of the other methods, by label
    attrs: Mapping[str, str] = field(default_factory=dict)
    """Further attributes of the root."""

    @property
    def reasons(self) -> dict[str, str]:
        """Return the reasons of failed methods, by label."""
        return {label: reason_of(error).removeprefix(f"{label}: ") for label, error in self.errors.items()}

    @property
    def attribute(self) -> dict[str, str]:
        """Return `attrs` and the root attribute ``failed``, a JSON object from label to reason, if methods failed."""
        failed = {"failed": json.dumps(self.reasons, ensure_ascii=False)} if self.errors else {}
        return {**failed, **self.attrs}

    def report(self, study: str, stacklevel: int) -> None:
        """Warn of each failed method; if no method succeeded, raise the first error, which lists the others."""
        if self.nodes:
            for label, reason in self.reasons.items():
                text = f"study {study!r}: the method {label!r} failed: {reason}"
                warnings.warn(text, MethodFailedWarning, stacklevel=stacklevel + 1)
            return
        first, *others = self.errors
        error = self.errors[first]
        # a budget that is too small for every method is an invalid argument
        refused = all(isinstance(one, BudgetTooSmallError) for one in self.errors.values())
        if isinstance(error, UqmbdError) and not refused:
            error.failed = self.reasons
        for label in others:
            error.add_note(f"The method {label!r} failed as well: {self.reasons[label]}")
        raise error


def run_methods(
    study: Studied,
    propagators: Sequence[Propagator],
    executor: Executor | None,
    progress: Progress | bool | None = None,
    folder: Path | None = None,
    terms: BudgetTerms | None = None,
    *,
    resume: bool = False,
) -> Outcome:
    """Run methods; collect all obstacles before the computation of the first realisation.

    With `terms`, a budget and an accuracy determine the sizes of the methods. A run with these sizes as options gives
    the same bits.
    """
    shown = choose_receiver(progress)
    if folder is not None:
        _warn_of_changes(study, propagators, folder, resume=resume)
    if terms is not None:
        expected(shown, dict.fromkeys(p.node_name for p in propagators))
        return _run_within(study, propagators, BudgetedRun(study, terms, executor, shown, folder, resume))
    errors: dict[str, BaseException] = {}
    for propagator in propagators:
        if (error := _obstacle(propagator, study)) is not None:
            errors[propagator.node_name] = error
    expected(shown, {p.node_name: None if p.node_name in errors else _count(p, study) for p in propagators})
    for label, error in errors.items():
        failed(shown, label)
        methods.info("%s: fails: %s", label, error)
    nodes = []
    for propagator in propagators:
        if propagator.node_name in errors:
            continue
        with Isolated(*ERRORS_AND_EXITS) as work, explained(executor):
            nodes.append(run_method(propagator, study.problem(propagator, executor, shown, folder)))
        if work.error is not None:
            release(work.error)
            errors[propagator.node_name] = work.error
            failed(shown, propagator.node_name)
            methods.info("%s: fails: %s", propagator.node_name, work.error)
    order = [p.node_name for p in propagators if p.node_name in errors]
    return Outcome(tuple(nodes), {label: errors[label] for label in order})


def _warn_of_changes(study: Studied, propagators: Sequence[Propagator], folder: Path, *, resume: bool) -> None:
    """Record options, and warn of options that differ from the options of the stored chunks."""
    options, extended = {}, {}
    for propagator in propagators:
        label, sizing = propagator.node_name, None
        options[label] = {f.name: getattr(propagator, f.name) for f in fields(propagator) if f.name != "label"}
        with Isolated(*ERRORS_AND_EXITS):  # the run of the method reports the error
            sizing = propagator.sizing(study, None)
        extended[label] = (sizing.option,) if sizing is not None and sizing.extends else ()
    digest = study_digest(study.model, study.mechanism.inputs, study.times, study.rtol, study.integrator)
    warn_of_changes(folder, digest, options, extended, resume=resume, stacklevel=4)


def _run_within(study: Studied, propagators: Sequence[Propagator], within: BudgetedRun) -> Outcome:
    """Run methods at automatically chosen sizes."""
    for propagator in propagators:
        if (error := _obstacle(within.smallest(propagator), study)) is not None:
            within.errors[propagator.node_name] = error
    within.run([p for p in propagators if p.node_name not in within.errors])
    within.pass_on_warnings(stacklevel=3)
    for label in within.errors:
        failed(within.progress, label)
    order = [p.node_name for p in propagators]
    nodes = tuple(within.nodes[label] for label in order if label in within.nodes)
    errors = {label: within.errors[label] for label in order if label in within.errors}
    return Outcome(nodes, errors, within.attribute())


def _count(propagator: Propagator, study: Studied) -> int | None:
    """Return the number of realisations of a method, or its maximum; None if unknown."""
    found: Any = None
    with Isolated(*ERRORS_AND_EXITS):
        found = propagator.estimate(study)
    if not isinstance(found, Estimate):
        return None
    return AtMost(int(found.realisations)) if found.at_most else int(found.realisations)


def planned(study: Studied, propagators: Sequence[Propagator]) -> int:
    """Return the largest number of realisations of any method, at the sizes in the study."""
    counts = [_count(propagator, study) for propagator in propagators]
    return max((UNSTATED if count is None else int(count) for count in counts), default=UNSTATED)


def _obstacle(propagator: Propagator, study: Studied) -> BaseException | None:
    """Return the obstacle of a method as an error."""
    found: Any = None
    with Isolated(*ERRORS_AND_EXITS) as isolated:
        found = obstacle_of(propagator, study)
    if isolated.error is not None:
        release(isolated.error)
        return isolated.error
    if found is None:
        return None
    label, kind = propagator.node_name, type(propagator)
    if not isinstance(found, str):
        return StudyError(
            f"{label}: the method obstacle() of {kind.__module__}.{kind.__qualname__} returned "
            f"{type(found).__name__}; expected a string or None."
        )
    return StudyError(f"{label}: the method cannot run this study: {found}")


def joined(study: Studied, outcome: Outcome, found: Sequence[Finding]) -> xr.DataTree:
    """Join the results of methods; if their comparison fails, store the reason and keep the results.

    The findings `found` on the study, and the settings of the study, are attributes of the root.
    """
    import xarray as xr

    from uqmbd.results import study_tree
    from uqmbd.results.schema import join_nodes

    attrs = {
        "rtol": study.rtol,
        "integrator": study.integrator,
        "start": study.start,
        **step_attributes(study.max_step, study.breaks),
        **({"report_times": list(study.report_times)} if study.report_times else {}),
        **study.mechanism.remembered("attributes", lambda: mechanism_attributes(study.mechanism)),
        **finding_attributes(found),
    }
    about: dict[str, Any] = {
        "study": study.name,
        "mechanism": study.mechanism.name,
        "attrs": {**attrs, **outcome.attribute},
    }
    with Isolated(*ERRORS_AND_EXITS) as work:
        return study_tree(outcome.nodes, **about)
    warnings.warn(
        f"study {study.name!r}: the comparison of the methods failed: {work.reason}", UserWarning, stacklevel=3
    )
    tree = join_nodes(outcome.nodes, **about)
    tree["comparison"] = xr.DataTree(xr.Dataset(attrs={"problem": work.reason}))
    return tree
