"""Does an integrator do what studies expect of it: right motions, failures told, and all that it declares."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from uqmbd.dynamics import Capabilities, Counters, Ensemble, Integrator, Trajectories, capabilities_of, off_constraints
from uqmbd.errors import StudyError
from uqmbd.plugins import integrator_problem
from uqmbd.testing.integrators.projected import check_projected
from uqmbd.testing.solutions import ClosedForm, closed_forms, fragile
from uqmbd.typing import Array

__all__ = ["check_integrator"]


RTOLS = (1e-4, 1e-6, 1e-8)
RTOL = 1e-6

ORDER = 1e-9
"""Change by the order of realisations that is taken as rounding, over their size."""


def check_integrator(
    integrator: type[Integrator], *, tolerance: float = 100.0, rtols: tuple[float, ...] = RTOLS
) -> None:
    """Check an integrator on small mechanisms whose motions are known in closed form.

    - *protocol*: it has a name, is made without arguments, and declares capabilities by True or False.
    - *accuracy*: a thrown stone, an oscillator and a pendulum are right within a multiple of ``rtol``, and the error
      falls with it; output times, which are not evenly spaced, are met exactly; the start is that of the ensemble.
    - *constraints*: states keep to the constraints.
    - *reproducibility*: the same ensemble gives the same bits.
    - *independence*: the motion of a realisation does not depend on what else is in the ensemble: its order and copies
      change nothing, and alone it changes by a tenth of the allowed error at the smallest tolerance.
    - *failures*: realisations that cannot be assembled, or cannot go on, have a message and are NaN from there on; the
      others are right.
    - *counters*: they tell what the integration cost.
    - *bounded_steps*: the integration restarts where forces jump, and respects the longest step.
    - *events*: a ball bounces in time, and the times of its impacts are returned.
    - *sampled_control*: a controller that pushes a body is sampled in time; with *events* also across its impacts.
    - *segments*: the segments of that motion are those between its impacts.
    - *releases_gil*: ensembles that are integrated in several threads at once give the same bits as one after another.
    - *projected*: coefficients are those of the motions at the nodes; *stoppable*: it stops where it is asked to.

    The last six are checked only where the integrator declares them in its `Capabilities`.

    Parameters
    ----------
    integrator : type
        A class as that which a plugin offers.
    tolerance : float
        Errors that are allowed, over ``rtol`` and the largest value of an output over time.
    rtols : tuple of float
        Tolerances for *accuracy*, falling.

    Raises
    ------
    AssertionError
        If a property is broken; the message names it, with the case and the numbers.

    Examples
    --------
    >>> from uqmbd.testing import check_integrator
    >>> import uqmbd.plugins
    >>> for integrator in uqmbd.plugins.integrators().values():
    ...     check_integrator(integrator)
    """
    able = _check_protocol(integrator)
    subject = _IntegratorUnderTest(integrator, tolerance)
    for make in closed_forms.ACCURACY:
        _check_accuracy(subject, make(), rtols)
    _check_reproducibility(subject, closed_forms.pendulum())
    for make in (closed_forms.oscillator, closed_forms.pendulum):
        _check_independence(subject, make(), min(rtols))
    _check_assembly_failures(subject)
    _check_failures(subject, closed_forms.fading())
    if able.bounded_steps:
        for form in (closed_forms.pulse(), closed_forms.pulse(True), closed_forms.strip()):
            subject.right(form, "bounded_steps", subject.run(form, "bounded_steps"))
    if able.events:
        _check_events(subject, closed_forms.ball())
    if able.sampled_control:
        for floor in (False, True)[: 1 + able.events]:
            form = closed_forms.driven_ball(floor)
            subject.right(form, "sampled_control", subject.run(form, "sampled_control"))
    if able.segments:
        _check_segments(subject, closed_forms.ball())
    if able.releases_gil:
        _check_threads(subject, closed_forms.pendulum())
    if able.projected:
        check_projected(integrator, tolerance)


class _IntegratorUnderTest:
    """An integrator under test."""

    def __init__(self, integrator: type[Integrator], tolerance: float) -> None:
        self.integrator, self.tolerance = integrator, tolerance
        self.title = f"integrator {integrator.name!r}"

    @contextmanager
    def unbroken(self, prop: str, case: str) -> Iterator[None]:
        """Turn what it raises into a broken property."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                yield
        except Exception as error:
            if isinstance(error, AssertionError) and str(error).startswith(self.title):
                raise
            raise AssertionError(f"{self.title}: {prop}: {case}: it raised {type(error).__name__}: {error}") from error

    def integrated(self, ensemble: Ensemble, times: Array, prop: str, case: str, rtol: float = RTOL) -> Trajectories:
        """Integrate an ensemble, and check the form of the result."""
        with self.unbroken(prop, case):
            found: Any = self.integrator().integrate(ensemble, times, rtol)
        what = f"{self.title}: {prop}: {case}"
        assert isinstance(found, Trajectories), (
            f"{what}: its method integrate returned {found!r:.100}; expected uqmbd.extend.Trajectories."
        )
        shape = (len(ensemble), len(times), ensemble.model.layout.width)
        assert np.shape(found.states) == shape, (
            f"{what}: states have the shape {np.shape(found.states)}; expected {shape}: realisation, time, and "
            "coordinates, auxiliary states and velocities."
        )
        assert len(found.messages) == shape[0] and all(isinstance(m, str) for m in found.messages), (
            f"{what}: messages are {found.messages!r:.100}; expected {shape[0]} texts, empty where all went well."
        )
        assert np.array_equal(found.times, times), f"{what}: times are {found.times}; expected {times}."
        return found

    def run(self, form: ClosedForm, prop: str, rtol: float = RTOL) -> Trajectories:
        """Integrate all realisations of a case, which succeed."""
        found = self.integrated(form.ensemble(), form.times, prop, form.name, rtol)
        wrong = [k for k, message in enumerate(found.messages) if message]
        assert not wrong, (
            f"{self.title}: {prop}: {form.name}: realisation {wrong[0]} failed: {found.messages[wrong[0]]!r}; expected "
            "a motion to the last time."
        )
        return found

    def right(self, form: ClosedForm, prop: str, found: Trajectories, rtol: float = RTOL) -> float:
        """Hold outputs against the closed form; return the largest error over the size of the outputs."""
        expected = form.expected()
        response = form.ensemble().outputs(form.times, found.states)
        size = np.nanmax(np.abs(expected), axis=2, keepdims=True)
        error = np.abs(response - expected) / size
        error[np.isnan(error)] = np.inf
        k, output, time = np.unravel_index(int(np.argmax(error)), error.shape)
        worst = float(error[k, output, time])
        assert worst <= self.tolerance * rtol, (
            f"{self.title}: {prop}: {form.name}: with rtol={rtol:g} the {form.model.outputs.names[output]} is "
            f"{response[k, output, time]:.10g} at t = {form.times[time]:g} s; expected "
            f"{expected[k, output, time]:.10g}, within {self.tolerance * rtol:.1g} of its size (error: {worst:.1g})."
        )
        return worst


def _check_protocol(integrator: Any) -> Capabilities:
    """Check what can be seen without integrating; return the declared capabilities."""
    shown = getattr(integrator, "__name__", repr(integrator))
    assert isinstance(integrator, type), f"{shown}: protocol: it is no class; expected one with a method integrate."
    name = getattr(integrator, "name", None)
    assert isinstance(name, str) and name and "/" not in name, (
        f"{shown}: protocol: its class attribute `name` is {name!r}; expected a string without '/'."
    )
    problem = integrator_problem(integrator)
    assert not problem, f"integrator {name!r}: protocol: it is a class {problem}."
    try:
        able = capabilities_of(integrator)
    except StudyError as error:
        raise AssertionError(f"integrator {name!r}: protocol: {error}") from error
    try:
        integrator()
    except TypeError as error:
        raise AssertionError(f"integrator {name!r}: protocol: it cannot be made without arguments: {error}") from error
    return able


def _check_accuracy(subject: _IntegratorUnderTest, form: ClosedForm, rtols: tuple[float, ...]) -> None:
    errors = []
    for rtol in rtols:
        ensemble = form.ensemble()
        found = subject.run(form, "accuracy", rtol)
        start = np.concatenate([ensemble.start.q, ensemble.start.s, ensemble.start.v], axis=1)
        off = float(np.abs(found.states[:, 0] - start).max())
        assert off <= 1e-9, (
            f"{subject.title}: accuracy: {form.name}: the states at the first time differ from ensemble.start by "
            f"{off:.2g}; expected the same."
        )
        errors.append(subject.right(form, "accuracy", found, rtol))
        texts = off_constraints(ensemble, form.times, found.states, rtol)
        assert not texts, f"{subject.title}: constraints: {form.name}: {next(iter(texts.values()))[1]}."
        _check_counters(subject, form.name, found.counters)
    least = max(errors[0] / 30, 10 * rtols[-1])
    assert errors[-1] <= least, (
        f"{subject.title}: accuracy: {form.name}: the error falls from {errors[0]:.2g} with rtol={rtols[0]:g} to "
        f"{errors[-1]:.2g} with rtol={rtols[-1]:g}; expected {least:.2g} at most: is rtol used?"
    )


def _check_counters(subject: _IntegratorUnderTest, case: str, counters: Any) -> None:
    assert isinstance(counters, Counters), (
        f"{subject.title}: counters: {case}: they are {counters!r:.100}; expected uqmbd.extend.Counters."
    )
    assert max(counters.steps, counters.residuals, counters.accelerations) > 0, (
        f"{subject.title}: counters: {case}: steps, residuals and accelerations are all 0; expected at least one of "
        "them, uqmbd.extend.Counters(steps=...)."
    )


def _check_reproducibility(subject: _IntegratorUnderTest, form: ClosedForm) -> None:
    first, second = (subject.run(form, "reproducibility").states for _ in range(2))
    assert np.array_equal(first, second), (
        f"{subject.title}: reproducibility: {form.name}: the second run differs from the first by "
        f"{np.abs(first - second).max():.2g}; expected the same bits."
    )


def _check_independence(subject: _IntegratorUnderTest, form: ClosedForm, rtol: float) -> None:
    """Compare realisations with those that are integrated in another order, several times, and alone.

    The order and copies must not matter. Alone, an integrator that takes common steps may take others, so that the
    change is a part of what the smallest tolerance `rtol` allows; one that does not leak has none.
    """
    own = np.arange(len(form.values))
    changes = {
        "in the reverse order": (own[::-1], RTOL, ORDER),
        "in another order": (np.roll(own, 1), RTOL, ORDER),
        "twice each": (np.repeat(own, 2), RTOL, ORDER),
        **{f"alone (realisation {k})": (own[k : k + 1], rtol, subject.tolerance * rtol / 10) for k in own},
    }
    together = {at: subject.run(form, "independence", at).states for at in (RTOL, rtol)}
    for how, (members, at, allowed) in changes.items():
        found = subject.run(replace(form, values=form.values[members]), "independence", at).states
        change = float(np.abs(found - together[at][members]).max() / np.abs(together[at]).max())
        assert change <= allowed, (
            f"{subject.title}: independence: {form.name}: integrated {how} with rtol={at:g}, realisations change by "
            f"{change:.2g} of their size; expected {allowed:.1g} at most. Does something of one realisation, "
            "such as its last step or its Jacobian, enter another one?"
        )


def _check_threads(subject: _IntegratorUnderTest, form: ClosedForm) -> None:
    """Integrate in several threads at once what was integrated before."""
    alone = subject.run(form, "releases_gil").states
    with ThreadPoolExecutor(4) as executor:
        ensembles = [form.ensemble() for _ in range(8)]
        work = [executor.submit(subject.integrator().integrate, one, form.times, RTOL) for one in ensembles]
        with subject.unbroken("releases_gil", form.name):
            others = [one.result().states for one in work]
    differ = [other for other in others if not np.array_equal(other, alone)]
    assert not differ, (
        f"{subject.title}: releases_gil: {form.name}: in several threads at once states differ by "
        f"{np.abs(differ[0] - alone).max():.2g} from those that are integrated alone; expected the same bits."
    )


def _check_assembly_failures(subject: _IntegratorUnderTest) -> None:
    """Integrate an ensemble some of whose realisations cannot be assembled."""
    study = fragile(0.8, 1.2)
    ensemble = Ensemble(study.model, np.array([[1.0], [0.8], [1.1]]))
    found = subject.integrated(ensemble, study.times, "failures", study.name)
    for k, (ok, reason) in enumerate(zip(ensemble.start.ok, ensemble.start.messages, strict=True)):
        what = f"{subject.title}: failures: {study.name}: realisation {k}"
        if ok:
            assert not found.messages[k], f"{what} failed beside one that cannot be assembled: {found.messages[k]!r}."
            assert np.isfinite(found.states[k]).all(), f"{what}: its states are not all finite; it has no message."
            continue
        assert found.messages[k], (
            f"{what} cannot be assembled, and has no message; expected that of ensemble.start: {reason!r}."
        )
        assert np.isnan(found.states[k]).all(), f"{what} cannot be assembled; expected states that are NaN."


def _check_failures(subject: _IntegratorUnderTest, form: ClosedForm) -> None:
    """Integrate realisations one of which cannot go on."""
    expected = form.expected()
    found = subject.integrated(form.ensemble(), form.times, "failures", form.name)
    response = form.ensemble().outputs(form.times, found.states)
    for k, message in enumerate(found.messages):
        there = np.isfinite(expected[k]).all(axis=0)
        what = f"{subject.title}: failures: {form.name}: realisation {k}"
        if there.all():
            assert not message, f"{what} failed beside one that cannot go on: {message!r}; expected a motion."
        else:
            assert message, (
                f"{what} cannot go on after t = {form.times[there][-1]:g} s, where a force is no number, and has no "
                "message; expected the reason."
            )
            wrong = np.isfinite(found.states[k, ~there]).any()
            assert not wrong, f"{what}: states behind the time at which it failed are numbers; expected NaN."
        error = np.abs(response[k] - expected[k])[:, there] / np.nanmax(np.abs(expected[k]))
        assert np.nanmax(error, initial=0.0) <= subject.tolerance * RTOL, (
            f"{what}: before anything fails the error is {np.nanmax(error):.2g} of its size; expected "
            f"{subject.tolerance * RTOL:.1g} at most."
        )
        assert message or np.isfinite(response[k]).all(), f"{what}: it is NaN and has no message."


def _check_events(subject: _IntegratorUnderTest, form: ClosedForm) -> None:
    found = subject.run(form, "events")
    subject.right(form, "events", found)
    moments = closed_forms.impacts(form.values, float(form.times[-1]))
    for k, expected in enumerate(moments.T):
        _check_event_times(subject, form.name, found, f"floor: impact {k + 1}", expected)
    passing = np.sqrt(2 * (form.values - closed_forms.MARK) / closed_forms.GRAVITY)
    passing[passing > form.times[-1]] = np.nan
    _check_event_times(subject, form.name, found, "floor: passing 1", passing)
    counted, least = found.counters.events, int(np.isfinite(moments).sum())
    assert counted >= least, (
        f"{subject.title}: counters: {form.name}: {counted} events are counted; expected {least} impacts at least."
    )


def _check_event_times(
    subject: _IntegratorUnderTest, case: str, found: Trajectories, name: str, expected: Array
) -> None:
    what = f"{subject.title}: events: {case}: the times {name!r}"
    assert name in found.scalars, f"{what} are missing; Trajectories.scalars has {sorted(found.scalars)}."
    times = np.asarray(found.scalars[name], dtype=float)
    assert times.shape == expected.shape, f"{what} have the shape {times.shape}; expected {expected.shape}."
    assert np.array_equal(np.isnan(times), np.isnan(expected)), (
        f"{what} are {times}; expected {expected}, NaN where a realisation has no such event."
    )
    error = float(np.nanmax(np.abs(times - expected)))
    assert error <= subject.tolerance * RTOL, f"{what} are {times}; expected {expected} (error: {error:.2g} s)."


def _check_segments(subject: _IntegratorUnderTest, form: ClosedForm) -> None:
    height, allowed = float(form.values[1]), subject.tolerance * RTOL
    ensemble = form.ensemble(form.values[1:2])
    what = f"{subject.title}: segments: {form.name}"
    with subject.unbroken("segments", form.name):
        asked: Any = subject.integrator()
        motion = asked.integrate_segments(ensemble, form.times, RTOL)
        segments, message = motion.segments, motion.message
    assert not message, f"{what}: it failed: {message!r}; expected a motion to the last time."
    begin, end = float(form.times[0]), float(form.times[-1])
    moments = closed_forms.impacts(np.array([height]), end)[0]
    expected = np.concatenate([[begin], moments, [end]])
    edges = np.array([*(s.begin for s in segments), segments[-1].end])
    assert edges.shape == expected.shape and np.abs(edges - expected).max() <= allowed, (
        f"{what}: segments begin and end at {edges}; expected {expected}, the times of the impacts."
    )
    labels = [s.label for s in segments]
    assert labels == ["floor: impact"] * len(moments) + [""], (
        f"{what}: labels are {labels}; expected 'floor: impact' for each that an impact ends, and '' for the last."
    )
    for k, segment in enumerate(segments):
        states = segment.states(np.array([segment.begin, segment.end]))
        speed = closed_forms.BOUNCE**k * np.sqrt(2 * closed_forms.GRAVITY * height)
        after, before = (speed if k else 0.0), -speed
        found = states[:, -1]
        assert abs(found[0] - after) <= allowed * 10 * speed, (
            f"{what}: at the begin of segment {k} the ball has the speed {found[0]:.8g} m/s; expected {after:.8g}, "
            "that right after the impact."
        )
        assert k == len(segments) - 1 or abs(found[1] - before) <= allowed * 10 * speed, (
            f"{what}: at the end of segment {k} the ball has the speed {found[1]:.8g} m/s; expected {before:.8g}, "
            "that right before the impact."
        )
