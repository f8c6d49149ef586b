"""Several alignments from shared realisations; each output uses the alignment with the smallest verified error.

If different alignments are most accurate at different times, an output uses several alignments.
"""

from __future__ import annotations

import contextlib
import json
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal, get_args

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import AlignedChaos, ComposedChaos, PiecewiseChaos, PolynomialChaos, QuasiPeriodicChaos
from uqmbd.typing import Array
from uqmbd_collocation.alignment import (
    CombinedTrajectories,
    EndsEarlyWarning,
    EventTrajectories,
    Impossible,
    PhaseTrajectories,
    Runs,
    align,
    chosen_over_time,
    runs_in_words,
    taken_values,
)
from uqmbd_collocation.expanded import Expanded
from uqmbd_collocation.plain import expand, warn_of_discontinuities
from uqmbd_collocation.plans import Plans
from uqmbd_collocation.refinement import Limits, UnmetWarning
from uqmbd_collocation.runs import DerivedSource
from uqmbd_collocation.two_frequency import expand_series

__all__ = ["FAMILIES", "Family", "expand_families", "impossible"]

Family = Literal["plain", "events", "phase", "two-frequency"]
FAMILIES: tuple[Family, ...] = get_args(Family)
"""Families of alignments that an option can name."""

Way = Literal[Family, "events+phase"]
COMBINED: Final = "events+phase"
"""Name of the family with event and phase markers; it is tried if the families `events` and `phase` succeed."""

SIMPLEST: tuple[Way, ...] = ("plain", "events", "phase", COMBINED, "two-frequency")
"""Order of preference of families with equal errors."""

FIRST: tuple[Way, ...] = ("phase", "events", COMBINED, "plain", "two-frequency")
"""Order of computation: later families reuse the realisations of earlier families."""

ENOUGH = 0.01
"""Errors, relative to the largest standard deviation over time, that are small enough.

If errors are at most this share, the family `two-frequency` is tried only if the option names it."""

Part = PolynomialChaos | PiecewiseChaos | AlignedChaos | QuasiPeriodicChaos


@dataclass
class _FamilyContext:
    """Data shared by the families."""

    problem: uqmbd.extend.Problem
    space: uqmbd.extend.GermSpace
    plans: Plans
    limits: uqmbd.extend.ElementLimits
    tolerance: Limits
    phase: PhaseTrajectories
    events: EventTrajectories | None = None
    both: CombinedTrajectories | None = None
    given: uqmbd.extend.Verification | None = None
    found: dict[Way, Expanded] = field(default_factory=dict)
    told: dict[Way, list[Warning]] = field(default_factory=dict)
    left_out: dict[Way, str] = field(default_factory=dict)
    beside: int = 0
    """Number of realisations that are not integrated to markers."""
    counters: Counter[str] = field(default_factory=Counter)
    """Counters of realisations that are not integrated to markers."""

    def expand(self, family: Way) -> Expanded:
        """Return the expansion of all outputs by a family; a new family needs an entry here."""
        if family == "phase":
            return self._aligned(self.phase)
        if family == "events":
            self.events = self.events or EventTrajectories(self.problem)
            return self._aligned(self.events)
        if family == COMBINED:
            self.both = CombinedTrajectories.of(self.problem, self.events, self.phase.clock)
            return self._aligned(self.both)
        if family == "two-frequency":
            found = expand_series(
                self.problem, self.space, self.plans, self.limits, self.tolerance, self.given, self.phase.known_motion
            )
            self.beside += found.realisations
            self.counters.update(found.counters)
            return found
        self.phase.events = self.events
        followed = self.phase.spent > 0 or self.events is not None
        source = _StoredRealisations(self.problem, self.phase) if followed else self.problem
        found, _ = expand(source, self.space, self.plans, self.tolerance, self.given, quiet=True)
        if not followed:
            self.beside += found.realisations
            self.counters.update(found.counters)
        return found

    def _aligned(self, paths: EventTrajectories | PhaseTrajectories | CombinedTrajectories) -> Expanded:
        found = align(self.problem, self.space, self.plans, paths, self.limits, self.tolerance, self.given)
        self.beside += found.realisations - paths.spent
        self.counters.update(found.counters - paths.counters)
        return found

    def follow_events(self) -> None:
        """Integrate the first nodes from event to event, if possible; the search for a clock uses them."""
        events = EventTrajectories(self.problem)
        with contextlib.suppress(uqmbd.UqmbdError):
            events.histories(self.space.to_inputs(self.plans.first_nodes(self.space)))
            self.events = self.phase.events = events

    def attempt(self, family: Way, wanted: bool) -> None:
        """Expand by a family; store the reason of a failure unless the option names the family."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                found = self.expand(family)
            except (uqmbd.StudyError, uqmbd.IntegrationError) as error:
                if wanted:
                    raise
                self.left_out[family] = self.reason(error)
                return
        self.told[family] = [one.message for one in caught if isinstance(one.message, Warning)]
        if self.given is None and found.chaos.verification_germs is not None:
            germs, response = found.chaos.verification_germs, found.chaos.verification_response
            weights = found.chaos.verification_weights
            assert response is not None and weights is not None
            # normalise to the mean 1, like the weights of drawn points
            points = uqmbd.extend.VerificationPoints(germs, len(weights) * weights)
            self.given = uqmbd.extend.Verification(self.space, points, response, len(germs))
        self.found[family] = found

    def worst(self) -> float:
        """Return the largest error of the outputs so far, divided by the largest standard deviation over time."""
        if self.given is None or not self.found:
            return np.inf
        size = np.abs(self.given.response).mean(axis=0)
        spread = _largest(self.given.std, size, self.problem.rtol)
        errors = [_errors(_verified(one.chaos, self.given)) for one in self.found.values()]
        return float(np.min([np.sqrt(np.mean(e**2, axis=-1)) / spread for e in errors], axis=0).max())

    def reason(self, error: Exception) -> str:
        """Return the reason of an error, without the method's name and without advice on one family."""
        if isinstance(error, Impossible):
            return error.reason
        return str(error).removeprefix(f"{self.problem.label}: ")

    @property
    def realisations(self) -> int:
        """Number of all computed realisations, including realisations for failed families."""
        return self.beside + sum(paths.spent for paths in (self.phase, self.events, self.both) if paths)

    @property
    def all_counters(self) -> Counter[str]:
        """Counters of all realisations."""
        return self.counters + self.phase.counters + (self.events.counters if self.events else Counter())


@dataclass(frozen=True)
class _StoredRealisations(DerivedSource):
    """Problem whose realisations are read from trajectories that were integrated for a clock."""

    problem: uqmbd.extend.Problem
    paths: PhaseTrajectories

    def realise(self, values: Array) -> uqmbd.extend.Realisations:
        """Return realisations from stored trajectories, and compute the missing realisations."""
        return self.paths.at_times(values)


def impossible(problem: uqmbd.extend.Problem, family: Family) -> str:
    """Return why a family is impossible, as far as this is known without realisations; otherwise an empty text."""
    try:
        if family == "events":
            EventTrajectories(problem)
            problem.require("segments")
    except Impossible as error:
        return error.reason
    except uqmbd.StudyError as error:
        return str(error).removeprefix(f"{problem.label}: ")
    return ""


def expand_families(
    problem: uqmbd.extend.Problem,
    space: uqmbd.extend.GermSpace,
    plans: Plans,
    limits: uqmbd.extend.ElementLimits,
    tolerance: Limits,
    names: Sequence[Family],
    clock: str | None,
    *,
    wanted: bool,
) -> Expanded:
    """Expand by several families; select for each output the smallest error at the verification realisations.

    With both events and phases, their combination is another family if it is possible. Raise StudyError or
    IntegrationError if all families are impossible. If `wanted` is true, raise the error as soon as any named family
    is impossible. If `wanted` is false, an impossible family is omitted.
    """
    work = _FamilyContext(
        problem, space, plans, limits, tolerance, PhaseTrajectories(problem, clock, tentative=not wanted)
    )
    ways: tuple[Way, ...] = (*names, COMBINED) if {"events", "phase"} <= set(names) else tuple(names)
    if not wanted and {"events", "phase"} <= set(names) and not impossible(problem, "events"):
        work.follow_events()
    for family in sorted(ways, key=FIRST.index):
        if family == COMBINED:
            if {"events", "phase"} <= set(work.found):
                work.attempt(family, wanted=False)
        elif not wanted and (why := impossible(problem, family)):
            work.left_out[family] = why
        elif wanted or family != "two-frequency" or work.worst() > ENOUGH:
            # the family of two frequencies needs separate realisations, so it comes last unless the option names it
            work.attempt(family, wanted)
    if not work.found:
        raise uqmbd.StudyError(f"{problem.label}: no family of alignment is possible. {_reasons(work.left_out)}")
    if work.given is None:
        raise uqmbd.IntegrationError(
            f"{problem.label}: all verification realisations failed, so no family of alignment can be selected by "
            "its error. Use a single family, such as alignment='phase', or alignment=None."
        )
    chaoses: dict[str, Part] = {
        name: _verified(work.found[name].chaos, work.given) for name in SIMPLEST if name in work.found
    }
    errors: dict[str, Array] = {name: _errors(chaos) for name, chaos in chaoses.items()}
    size = np.abs(work.given.response).mean(axis=0)
    spread = _largest(work.given.std, size, problem.rtol)
    over = {name: np.sqrt(np.mean(error**2, axis=-1)) / spread for name, error in errors.items()}
    taken = [chosen_over_time(work.given, chaoses, errors, over, k, spread[k]) for k in range(len(spread))]
    largest = _largest(taken_values(taken, {name: chaos.std for name, chaos in chaoses.items()}), size, problem.rtol)
    everywhere = {name for runs in taken for name, _, _ in runs}
    at_the_end = {runs[-1][0] for runs in taken}
    for name in work.found:
        for message in work.told[name]:
            # a warning on the tolerance applies only to the outputs that use the family
            ends = at_the_end if isinstance(message, EndsEarlyWarning) else everywhere
            if name in ends and not isinstance(message, UnmetWarning):
                warnings.warn(message, stacklevel=3)
    shares: dict[str, Array] = {**over, "taken": np.sqrt(np.mean(taken_values(taken, errors) ** 2, axis=-1)) / spread}
    return _composed(work, chaoses, taken, {name: error * spread / largest for name, error in shares.items()})


def _composed(
    work: _FamilyContext, chaoses: Mapping[str, Part], taken: Sequence[Runs], errors: Mapping[str, Array]
) -> Expanded:
    """Return the outputs as a combination of families.

    `errors` contains the errors (O,) of each family by its name, and the errors of the combination as "taken".
    """
    outputs = [o.name for o in work.problem.labels.outputs]
    times = np.asarray(work.problem.labels.times)
    words = [runs_in_words(runs, times) for runs in taken]
    names = np.full((len(outputs), len(times)), "", dtype="<U16")
    for k, runs in enumerate(taken):
        for name, first, last in runs:
            names[k, first:last] = name
    used = [name for name in SIMPLEST if (names == name).any()]
    rows = {name: np.flatnonzero((names == name).any(axis=1)).tolist() for name in used}
    parts: dict[str, Part] = {name: chaoses[name].selected(rows[name]) for name in used}
    if isinstance(at_equal_times := parts.get("plain"), PolynomialChaos):
        warn_of_discontinuities(at_equal_times, work.plans, work.problem.label)
    own = [work.found[name] for name in used]
    attrs: dict[str, Any] = {}
    for one in own:
        attrs |= one.attrs
    # the share of failures of one family does not apply to the combination
    attrs.pop("failed_share", None)
    attrs |= {
        "failures": sum(one.attrs["failures"] for one in work.found.values()),
        "fit": own[0].attrs["fit"] if len(own) == 1 else _fits(work, rows),
        **{name: max(one.attrs[name] for one in own) for name in ("terms", "highest_degree")},
        "verification": len(work.given) if work.given is not None else 0,
        "alignment": json.dumps(dict(zip(outputs, words, strict=True))),
        "alignment_error": json.dumps(dict(zip(outputs, errors["taken"].tolist(), strict=True))),
        "alignment_left_out": json.dumps(work.left_out),
    }
    if any("tolerance_met" in one.attrs for one in own):
        largest = float(np.max(errors["taken"]))
        attrs["tolerance_met"] = str(largest <= work.tolerance.tolerance)
        if largest > work.tolerance.tolerance:
            warnings.warn(
                f"{work.problem.label}: not all outputs met the tolerance {work.tolerance.tolerance:g}; the largest "
                f"error at the verification realisations is {largest:.2g}. Increase max_realisations.",
                UnmetWarning,
                stacklevel=4,
            )
    about = {
        "long_name": "error at the verification realisations",
        "comment": "root mean square over realisations and times, divided by the largest standard deviation over time",
    }
    table = xr.Dataset(
        {
            "error": (("family", "output"), np.array([errors[name] for name in chaoses]), about),
            "taken": (
                "output",
                np.array(words, dtype=np.str_),
                {"long_name": "families of alignment that the surrogate uses over time"},
            ),
            "taken_at": (("output", "time"), names, {"long_name": "family of the surrogate"}),
        },
        coords={
            "family": np.array(list(chaoses), dtype=np.str_),
            "output": np.array(outputs, dtype=np.str_),
            "time": ("time", times, {"units": "s"}),
        },
    )
    return Expanded(
        next(iter(parts.values()))
        if len(parts) == 1
        else ComposedChaos(parts, tuple(outputs), {name: names[rows[name]] == name for name in used}),
        work.realisations,
        work.all_counters,
        _nodes(work),
        attrs,
        {"families": table, **(own[0].children if len(own) == 1 else {})},
        own[0].leave_one_out if len(own) == 1 else None,
    )


def _fits(work: _FamilyContext, rows: Mapping[Way, Sequence[int]]) -> str:
    """Return a text that states the outputs and the fit of each family; `rows` contains the indices of the outputs."""
    outputs = [o.name for o in work.problem.labels.outputs]
    words = (f"{', '.join(outputs[k] for k in own)}: {work.found[name].attrs['fit']}" for name, own in rows.items())
    return "; ".join(words)


def _nodes(work: _FamilyContext) -> xr.Dataset:
    """Return the dataset of realisation points with the families that needed them."""
    about = {"long_name": "family that needed the realisation"}
    return xr.concat(
        [
            one.nodes.drop_vars("weight", errors="ignore").assign(
                family=("node", np.full(one.nodes.sizes["node"], name, dtype="<U16"), about)
            )
            for name, one in work.found.items()
        ],
        "node",
    )


def _verified(chaos: Any, given: uqmbd.extend.Verification) -> Part:
    """Return a chaos with the common verification realisations."""
    found: Part = replace(chaos, **given.known)
    return found


def _errors(chaos: Part) -> Array:
    """Return root-mean-square errors (O, T) at the verification realisations; infinite if the chaos is not finite."""
    found = chaos.verification_rms()
    return np.where(np.isfinite(found), found, np.inf)


def _largest(std: Array, size: Array, rtol: float) -> Array:
    """Return the maximum over time (O,) of `std` (O, T), or, if `std` is negligible, of the outputs' `size` (O, T)."""
    found, other = np.fmax.reduce(std, axis=-1), np.fmax.reduce(size, axis=-1)
    return np.asarray(np.where(found > rtol * other, found, np.where(other > 0, other, 1.0)))


def _reasons(left_out: Mapping[Way, str]) -> str:
    return " ".join(f"{name}: {why}" for name, why in left_out.items())
