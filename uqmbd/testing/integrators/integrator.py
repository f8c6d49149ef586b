"""Test an integrator against the requirements of studies: correct motions, reported failures, declared capabilities."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from uqmbd.arguments import typechecked
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
"""Change by the order of realisations that counts as rounding, relative to their magnitude."""


@typechecked(values=False)
def check_integrator(
    integrator: type[Integrator], *, tolerance: float = 100.0, rtols: tuple[float, ...] = RTOLS
) -> None:
    """Check an integrator on small mechanisms with closed-form motions.

    - *protocol*: the integrator has a name, is made without arguments, and declares capabilities by True or False.
    - *accuracy*: the errors of a thrown stone, an oscillator and a pendulum are within a multiple of ``rtol``, and
      decrease with it. Results are exactly at the output times, which are not evenly spaced. The start agrees with the
      ensemble.
    - *constraints*: states satisfy the constraints.
    - *reproducibility*: the same ensemble gives the same bits.
    - *independence*: the motion of a realisation does not depend on others in the ensemble. Order and copies have no
      effect; a separate integration changes it by at most a tenth of the allowed error at the smallest tolerance.
    - *failures*: realisations whose assembly or integration fails have a message, and are NaN afterwards; the others
      are correct.
    - *counters*: the counters state the cost of the integration.
    - *bounded_steps*: the integration restarts at jumps of forces, and respects the longest step.
    - *events*: a ball bounces in time, and the times of its impacts are returned.
    - *sampled_control*: a controller that pushes a body is sampled in time; with *events* also across its impacts.
    - *segments*: the segments of the motion of the ball are between its impacts.
    - *releases_gil*: simultaneous integrations of ensembles in several threads give the same bits as consecutive
    integrations.
    - *projected*: coefficients agree with the motions at the nodes; *stoppable*: the integration stops on request.

    The last six are checked only if the integrator declares them in its `Capabilities`.

    Parameters
    ----------
    integrator : type
        Class with the interface of an integrator of a plugin.
    tolerance : float
        Allowed errors, relative to the product of ``rtol`` and the largest value of an output over time.
    rtols : tuple of float
        Decreasing tolerances for *accuracy*.

    Raises
    ------
    AssertionError
        If a property is violated; the message states the property, the case and the numbers.

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
        """Convert an exception in the context to a violated property."""
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
            f"{what}: states have the shape {np.shape(found.states)}; expected {shape}. The axes are realisation, "
            "time, and state (coordinates, auxiliary states, velocities)."
        )
        assert len(found.messages) == shape[0] and all(isinstance(m, str) for m in found.messages), (
            f"{what}: messages are {found.messages!r:.100}; expected {shape[0]} strings, one for each realisation, "
            "empty if its integration succeeded."
        )
        assert np.array_equal(found.times, times), f"{what}: the returned times are {found.times}; expected {times}."
        return found

    def run(self, form: ClosedForm, prop: str, rtol: float = RTOL) -> Trajectories:
        """Integrate all realisations of a case, and require success."""
        found = self.integrated(form.ensemble(), form.times, prop, form.name, rtol)
        wrong = [k for k, message in enumerate(found.messages) if message]
        assert not wrong, (
            f"{self.title}: {prop}: {form.name}: realisation {wrong[0]} failed: {found.messages[wrong[0]]!r}; "
            "expected a trajectory up to the last time."
        )
        return found

    def right(self, form: ClosedForm, prop: str, found: Trajectories, rtol: float = RTOL) -> float:
        """Compare outputs with the closed form; return the largest error relative to the magnitude of the outputs."""
        expected = form.expected()
        response = form.ensemble().outputs(form.times, found.states)
        size = np.nanmax(np.abs(expected), axis=2, keepdims=True)
        error = np.abs(response - expected) / size
        error[np.isnan(error)] = np.inf
        k, output, time = np.unravel_index(int(np.argmax(error)), error.shape)
        worst = float(error[k, output, time])
        assert worst <= self.tolerance * rtol, (
            f"{self.title}: {prop}: {form.name}: with rtol={rtol:g} the "
            f"{form.model.outputs.names[output]} is {response[k, output, time]:.10g} at t = "
            f"{form.times[time]:g} s; expected {expected[k, output, time]:.10g}, with a relative error "
            f"of at most {self.tolerance * rtol:.1g} (error: {worst:.1g})."
        )
        return worst


def _check_protocol(integrator: Any) -> Capabilities:
    """Check properties that require no integration; return the declared capabilities."""
    shown = getattr(integrator, "__name__", repr(integrator))
    assert isinstance(integrator, type), (
        f"{shown}: protocol: the argument is not a class; expected a class with a method integrate."
    )
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
        raise AssertionError(
            f"integrator {name!r}: protocol: the class cannot be instantiated without arguments: {error}"
        ) from error
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
            f"{off:.2g}; expected equal states."
        )
        errors.append(subject.right(form, "accuracy", found, rtol))
        texts = off_constraints(ensemble, form.times, found.states, rtol)
        assert not texts, f"{subject.title}: constraints: {form.name}: {next(iter(texts.values()))[1]}."
        _check_counters(subject, form.name, found.counters)
    least = max(errors[0] / 30, 10 * rtols[-1])
    assert errors[-1] <= least, (
        f"{subject.title}: accuracy: {form.name}: the error falls from {errors[0]:.2g} with rtol={rtols[0]:g} to "
        f"{errors[-1]:.2g} with rtol={rtols[-1]:g}; expected at most {least:.2g}. Use the argument rtol for the "
        "error control."
    )


def _check_counters(subject: _IntegratorUnderTest, case: str, counters: Any) -> None:
    assert isinstance(counters, Counters), (
        f"{subject.title}: counters: {case}: the attribute 'counters' is {counters!r:.100}; expected "
        "uqmbd.extend.Counters."
    )
    assert max(counters.steps, counters.residuals, counters.accelerations) > 0, (
        f"{subject.title}: counters: {case}: steps, residuals and accelerations are all 0. Return at least one of "
        "them, e.g. uqmbd.extend.Counters(steps=...)."
    )


def _check_reproducibility(subject: _IntegratorUnderTest, form: ClosedForm) -> None:
    first, second = (subject.run(form, "reproducibility").states for _ in range(2))
    assert np.array_equal(first, second), (
        f"{subject.title}: reproducibility: {form.name}: the second run differs from the first by "
        f"{np.abs(first - second).max():.2g}; expected results that agree bit for bit."
    )


def _check_independence(subject: _IntegratorUnderTest, form: ClosedForm, rtol: float) -> None:
    """Compare realisations with integrations in another order, with copies, and separately.

    Order and copies must have no effect. In a separate integration, an integrator with common steps may take other
    steps. The change must be a part of the allowed error at the smallest tolerance `rtol`.
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
            f"{change:.2g}, relative to the largest state; expected at most {allowed:.1g}. Data of one realisation, "
            "such as its last step or its Jacobian, must not affect another one."
        )


def _check_threads(subject: _IntegratorUnderTest, form: ClosedForm) -> None:
    """Repeat an integration simultaneously in several threads."""
    alone = subject.run(form, "releases_gil").states
    with ThreadPoolExecutor(4) as executor:
        ensembles = [form.ensemble() for _ in range(8)]
        work = [executor.submit(subject.integrator().integrate, one, form.times, RTOL) for one in ensembles]
        with subject.unbroken("releases_gil", form.name):
            others = [one.result().states for one in work]
    differ = [other for other in others if not np.array_equal(other, alone)]
    assert not differ, (
        f"{subject.title}: releases_gil: {form.name}: integrations in several concurrent threads "
        f"differ by {np.abs(differ[0] - alone).max():.2g} from an integration in one thread; expected "
        "states that agree bit for bit."
    )


def _check_assembly_failures(subject: _IntegratorUnderTest) -> None:
    """Integrate an ensemble in which some realisations cannot be assembled."""
    study = fragile(0.8, 1.2)
    ensemble = Ensemble(study.model, np.array([[1.0], [0.8], [1.1]]))
    found = subject.integrated(ensemble, study.times, "failures", study.name)
    for k, (ok, reason) in enumerate(zip(ensemble.start.ok, ensemble.start.messages, strict=True)):
        what = f"{subject.title}: failures: {study.name}: realisation {k}"
        if ok:
            assert not found.messages[k], (
                f"{what} failed, although only another realisation cannot be assembled: {found.messages[k]!r}."
            )
            assert np.isfinite(found.states[k]).all(), (
                f"{what} has states that are not finite, but no message; expected the reason in messages."
            )
            continue
        assert found.messages[k], (
            f"{what} cannot be assembled, but has no message; expected the message of ensemble.start: {reason!r}."
        )
        assert np.isnan(found.states[k]).all(), f"{what} cannot be assembled, but has finite states; expected NaN."


def _check_failures(subject: _IntegratorUnderTest, form: ClosedForm) -> None:
    """Integrate realisations in which one integration fails."""
    expected = form.expected()
    found = subject.integrated(form.ensemble(), form.times, "failures", form.name)
    response = form.ensemble().outputs(form.times, found.states)
    for k, message in enumerate(found.messages):
        there = np.isfinite(expected[k]).all(axis=0)
        what = f"{subject.title}: failures: {form.name}: realisation {k}"
        if there.all():
            assert not message, (
                f"{what} failed, although only another realisation cannot be continued: {message!r}; expected a "
                "trajectory up to the last time."
            )
        else:
            assert message, (
                f"{what}: a force is not finite after t = {form.times[there][-1]:g} s, but the message of the "
                "realisation is empty; expected the reason in `messages`."
            )
            wrong = np.isfinite(found.states[k, ~there]).any()
            assert not wrong, f"{what}: states after the time of failure are finite; expected NaN."
        error = np.abs(response[k] - expected[k])[:, there] / np.nanmax(np.abs(expected[k]))
        assert np.nanmax(error, initial=0.0) <= subject.tolerance * RTOL, (
            f"{what}: the relative error before the failure is {np.nanmax(error):.2g}; expected at most "
            f"{subject.tolerance * RTOL:.1g}."
        )
        assert message or np.isfinite(response[k]).all(), (
            f"{what}: an output is NaN, but there is no message; expected the reason in messages."
        )


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
        f"{subject.title}: counters: {form.name}: the integrator counted {counted} events; expected at "
        f"least {least} impacts."
    )


def _check_event_times(
    subject: _IntegratorUnderTest, case: str, found: Trajectories, name: str, expected: Array
) -> None:
    what = f"{subject.title}: events: {case}: the times {name!r}"
    assert name in found.scalars, f"{what} are missing; Trajectories.scalars has {sorted(found.scalars)}."
    times = np.asarray(found.scalars[name], dtype=float)
    assert times.shape == expected.shape, f"{what} have the shape {times.shape}; expected {expected.shape}."
    assert np.array_equal(np.isnan(times), np.isnan(expected)), (
        f"{what} are {times}; expected {expected}, with NaN for realisations without this event."
    )
    error = float(np.nanmax(np.abs(times - expected)))
    assert error <= subject.tolerance * RTOL, f"{what} are {times}; expected {expected} (error: {error:.2g} s)."


def _check_segments(subject: _IntegratorUnderTest, form: ClosedForm) -> None:
    height, allowed = float(form.values[1]), subject.tolerance * RTOL
    ensemble = form.ensemble(form.values[1:2])
    what = f"{subject.title}: segments: {form.name}"
    with subject.unbroken("segments", form.name):
        made: Any = subject.integrator()
        motion = made.integrate_segments(ensemble, form.times, RTOL)
        segments, message = motion.segments, motion.message
    assert not message, f"{what}: the integration failed: {message!r}; expected a trajectory up to the last time."
    begin, end = float(form.times[0]), float(form.times[-1])
    moments = closed_forms.impacts(np.array([height]), end)[0]
    expected = np.concatenate([[begin], moments, [end]])
    edges = np.array([*(s.begin for s in segments), segments[-1].end])
    assert edges.shape == expected.shape and np.abs(edges - expected).max() <= allowed, (
        f"{what}: segments begin and end at {edges}; expected {expected}, the times of the impacts."
    )
    labels = [s.label for s in segments]
    assert labels == ["floor: impact"] * len(moments) + [""], (
        f"{what}: labels are {labels}; expected 'floor: impact' for each segment that ends with an impact, and '' "
        "for the last segment."
    )
    for k, segment in enumerate(segments):
        states = segment.states(np.array([segment.begin, segment.end]))
        speed = closed_forms.BOUNCE**k * np.sqrt(2 * closed_forms.GRAVITY * height)
        after, before = (speed if k else 0.0), -speed
        found = states[:, -1]
        assert abs(found[0] - after) <= allowed * 10 * speed, (
            f"{what}: at the start of segment {k} the ball has the speed {found[0]:.8g} m/s; expected {after:.8g} "
            "m/s, the speed immediately after the impact."
        )
        assert k == len(segments) - 1 or abs(found[1] - before) <= allowed * 10 * speed, (
            f"{what}: at the end of segment {k} the ball has the speed {found[1]:.8g} m/s; expected {before:.8g} "
            "m/s, the speed immediately before the impact."
        )
