"""The conformance kit for integrators: those of the core pass, and each check catches an integrator that breaks it."""

from __future__ import annotations

import threading
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import uqmbd
from uqmbd import plugins
from uqmbd.dynamics import built_in_names, capabilities_of, installed_integrators
from uqmbd.dynamics.integrators import Auto, Dop853, Ida
from uqmbd.testing import check_integrator

DECLARED = ("events", "projected", "segments", "bounded_steps", "stoppable")


def made(**own):
    """Return a class that does what the explicit integrator does but what is its own, and declares what is its own."""

    class Made:
        name = "made"

        def integrate(self, ensemble, times, rtol):
            return Dop853().integrate(ensemble, times, rtol)

    declared = {name: own.pop(name) for name in set(own) & {field.name for field in fields(uqmbd.extend.Capabilities)}}
    if declared:
        Made.capabilities = uqmbd.extend.Capabilities(**declared)
    for key, value in own.items():
        setattr(Made, key, value)
    return Made


def changed(change, **own):
    """Return a class whose trajectories are changed: by a function of the ensemble, times and trajectories."""

    def integrate(self, ensemble, times, rtol):
        return change(ensemble, times, Dop853().integrate(ensemble, times, rtol))

    return made(integrate=integrate, **own)


@pytest.mark.thorough
@pytest.mark.parametrize("integrator", [Auto, Dop853, Ida], ids=lambda cls: cls.name)
def test_those_of_the_core_pass(integrator):
    check_integrator(integrator)


def test_those_of_the_core_are_all_that_the_core_offers():
    assert list(installed_integrators().values())[:3] == [Auto, Ida, Dop853]
    assert plugins.KINDS["integrators"].reserved == built_in_names()


def test_what_is_not_declared_is_never_asked_for():
    def asked(*given, **options):
        raise RuntimeError("asked")

    check_integrator(made(integrate_projected=asked, integrate_segments=asked))


@pytest.mark.parametrize(
    ("integrator", "problem"),
    [
        (made(name=""), "`name` is ''; expected a string"),
        (made(integrate=None), "has no method integrate"),
        (made(capabilities={"events": True}), "`capabilities` is {'events': True}; expected uqmbd.extend.Capabilities"),
        (made(projected=True), "declares projected=True, but has no method integrate_projected"),
        (made(segments=True), "declares segments=True, but has no method integrate_segments"),
        (made(__init__=lambda self, steps: None), "cannot be instantiated without arguments"),
        (Dop853(), "the argument is not a class"),
    ],
)
def test_protocol(integrator, problem):
    with pytest.raises(AssertionError, match="protocol: .*" + problem):
        check_integrator(integrator)


def _even(self, ensemble, times, rtol):
    found = Dop853().integrate(ensemble, np.linspace(times[0], times[-1], len(times)), rtol)
    return replace(found, times=times)


def _loose(self, ensemble, times, rtol):
    return Dop853().integrate(ensemble, times, 1e-4)


def _coarse(self, ensemble, times, rtol):
    return Dop853().integrate(ensemble, times, 1e3 * rtol)


def _raising(self, ensemble, times, rtol):
    raise ZeroDivisionError("steps of no length")


@pytest.mark.parametrize(
    ("integrate", "problem"),
    [
        (_even, "accuracy: stone: with rtol=0.0001 the y is .*; expected"),
        (_coarse, "accuracy: oscillator: with rtol=.* the .*; expected .*, with a relative error of at most .*"),
        (_raising, "accuracy: stone: it raised ZeroDivisionError: steps of no length"),
        (lambda *given: np.zeros(3), "returned array.*; expected uqmbd.extend.Trajectories"),
    ],
)
def test_accuracy(integrate, problem):
    with pytest.raises(AssertionError, match=problem):
        check_integrator(made(integrate=integrate))


def test_an_error_that_does_not_fall_is_reported():
    with pytest.raises(
        AssertionError,
        match=r"accuracy: oscillator: the error falls from .*; expected at most .*\. Use the argument rtol",
    ):
        check_integrator(made(integrate=_loose), tolerance=1e9)


def _start_off(ensemble, times, found):
    states = found.states.copy()
    states[:, 0] += 1e-7
    return replace(found, states=states)


def _off_the_pin(ensemble, times, found):
    """Velocities, which are no output, are off the constraints of the pendulum."""
    states = found.states.copy()
    if ensemble.model.layout.rank > 1:
        states[-1, 2:, 5] += 1e-1
    return replace(found, states=states)


def _other_bits(ensemble, times, found):
    states = found.states.copy()
    states[:, 1:] *= 1 + 1e-12 * np.random.default_rng().normal()
    return replace(found, states=states)


def _worse_alone(ensemble, times, found):
    return replace(found, states=found.states * (1 + 1e-3)) if len(ensemble) == 1 else found


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda e, t, found: replace(found, states=found.states[:, :, :-1]), r"states have the shape \(3, 5, 3\)"),
        (lambda e, t, found: replace(found, messages=()), r"messages are \(\)"),
        (lambda e, t, found: replace(found, times=t + 1), "the returned times are"),
        (lambda e, t, found: replace(found, messages=("stiff",) * 3), "realisation 0 failed: 'stiff'"),
        (lambda e, t, found: replace(found, counters=uqmbd.extend.Counters()), "counters: stone: steps, residuals and"),
        (_start_off, "the states at the first time differ from ensemble.start by 1e-07"),
        (_off_the_pin, "constraints: pendulum: the state .* violates the constraints 'pin: pin"),
        (_other_bits, "reproducibility: pendulum: .*; expected results that agree bit for bit"),
        (_worse_alone, "accuracy|independence: oscillator: integrated alone .*, realisations change by 0.0"),
    ],
)
def test_what_is_returned(change, problem):
    with pytest.raises(AssertionError, match=problem):
        check_integrator(changed(change))


LEAK = 5e-7
"""Part of one realisation that enters another: less than the errors that *accuracy* allows."""


def _from_before(ensemble, times, found):
    """Begin each realisation with something of the one before."""
    return replace(found, states=found.states + LEAK * np.concatenate([0 * found.states[:1], found.states[:-1]]))


def _from_last(ensemble, times, found):
    return replace(found, states=found.states + LEAK * (found.states[-1:] - found.states))


def _from_mean(ensemble, times, found):
    return replace(found, states=found.states + LEAK * (found.states.mean(0) - found.states))


def _from_number(ensemble, times, found):
    """Depend on how many realisations there are."""
    return replace(found, states=found.states * (1 + LEAK * len(ensemble)))


def _from_place(ensemble, times, found):
    """Depend on the number of the realisation in its ensemble, as random numbers of one generator do."""
    return replace(found, states=found.states * (1 + LEAK * np.arange(len(ensemble))[:, None, None] / 10))


def _from_largest(ensemble, times, found):
    return replace(found, states=found.states + LEAK * np.abs(found.states).max(0) * (len(ensemble) > 1))


def _after_start(change):
    """Change states behind the start only, which is compared with that of the ensemble."""

    def changed_later(ensemble, times, found):
        states = change(ensemble, times, found).states
        return replace(found, states=np.concatenate([found.states[:, :1], states[:, 1:]], axis=1))

    return changed_later


LEAKS = {
    _from_before: "independence: .* in the reverse order .*, realisations change by",
    _from_last: "independence: .* in the reverse order .*, realisations change by",
    _from_place: "independence: .* in the reverse order .*, realisations change by",
    _from_mean: "accuracy|independence: .* alone .*, realisations change by",
    _from_number: "accuracy|independence: .* twice each .*, realisations change by",
    _from_largest: "accuracy|independence: .* alone .*, realisations change by",
}


@pytest.mark.thorough
@pytest.mark.parametrize(("leak", "words"), LEAKS.items(), ids=lambda x: getattr(x, "__name__", ""))
def test_leaks_between_realisations(leak, words):
    """What of another realisation enters is found, though it is less than the error that is allowed."""

    def integrate(self, ensemble, times, rtol):
        found = Dop853().integrate(ensemble, times, rtol)
        part = 0.02 * rtol / LEAK if "reverse" in words else 1.0  # falls with the tolerance, as errors do
        leaked = _after_start(leak)(ensemble, times, found).states
        return replace(found, states=found.states + part * (leaked - found.states))

    with pytest.raises(AssertionError, match=words):
        check_integrator(made(integrate=integrate))


@pytest.mark.thorough
def test_leak_by_the_first_step():
    """A step that one realisation leaves to the next."""

    def integrate(self, ensemble, times, rtol):
        start = ensemble.start
        states, messages = np.full((len(ensemble), len(times), start.state.shape[1]), np.nan), list(start.messages)
        first = None
        for k in np.flatnonzero(start.ok):
            one = ensemble.select(np.array([k]))
            found = solve_ivp(
                lambda t, y, one=one: one.rates(t, y[None])[0],
                (times[0], times[-1]), start.state[k], "DOP853", times, rtol=rtol, atol=1e-3 * rtol, first_step=first,
            )  # fmt: skip
            first = 1e-3 * (1 + k)
            for j, y in enumerate(found.y.T):
                states[k, j] = one.on_constraints(times[j], y[None])[0]
            messages[k] = "" if found.success else found.message
        return uqmbd.extend.Trajectories(times, states, tuple(messages), uqmbd.extend.Counters(accelerations=1))

    with pytest.raises(AssertionError, match="independence: .* in the reverse order .*, realisations change by"):
        check_integrator(made(integrate=integrate))


def _silent(ensemble, times, found):
    return replace(found, messages=("",) * len(ensemble))


def _filled(ensemble, times, found):
    return replace(found, states=np.where(np.isnan(found.states), 0.0, found.states))


def _all_fail(ensemble, times, found):
    return replace(found, messages=("failed",) * len(ensemble)) if any(found.messages) else found


def _silent_later(ensemble, times, found):
    return _silent(ensemble, times, found) if ensemble.start.ok.all() else found


def _filled_later(ensemble, times, found):
    return _filled(ensemble, times, found) if ensemble.start.ok.all() else found


def _all_fail_later(ensemble, times, found):
    return _all_fail(ensemble, times, found) if ensemble.start.ok.all() else found


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (_silent, "fragile: realisation 1 cannot be assembled, but has no message"),
        (_filled, "fragile: realisation 1 cannot be assembled, but has finite states; expected NaN"),
        (_all_fail, "fragile: realisation 0 failed, although only another realisation cannot be assembled: 'failed'"),
        (_silent_later, "fading: realisation 1: a force is not finite after t = 0.3 s, but the message .* is empty"),
        (_filled_later, "fading: realisation 1: states after the time of failure are finite"),
        (
            _all_fail_later,
            "fading: realisation 0 failed, although only another realisation cannot be continued: 'failed'",
        ),
    ],
)
def test_failures(change, problem):
    with pytest.raises(AssertionError, match="failures: " + problem):
        check_integrator(changed(change))


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("blind", "case"), [({"timed": None}, "pulse"), ({"max_step": np.inf}, "strip")], ids=["time", "longest step"]
)
def test_bounded_steps(blind, case):
    """One that does not see what ``ensemble.pace`` tells."""

    def integrate(self, ensemble, times, rtol):
        model = replace(ensemble.model, **blind)
        return Dop853().integrate(uqmbd.extend.Ensemble(model, ensemble.values, start=ensemble.start), times, rtol)

    check_integrator(made(integrate=integrate))
    with pytest.raises(AssertionError, match=f"bounded_steps: {case}: .* the speed is"):
        check_integrator(made(integrate=integrate, bounded_steps=True))


def _fallen(self, ensemble, times, rtol):
    """Through the floor."""
    model = replace(ensemble.model, events=())
    return Dop853().integrate(uqmbd.extend.Ensemble(model, ensemble.values, start=ensemble.start), times, rtol)


def _times(change):
    def integrate(self, ensemble, times, rtol):
        found = Dop853().integrate(ensemble, times, rtol)
        return replace(found, scalars=change(dict(found.scalars)))

    return integrate


def _uncounted(self, ensemble, times, rtol):
    found = Dop853().integrate(ensemble, times, rtol)
    return replace(found, counters=replace(found.counters, events=0))


@pytest.mark.parametrize(
    ("integrate", "problem"),
    [
        (_fallen, "events: ball: with rtol=1e-06 the height is -"),
        (_times(lambda found: {}), "events: ball: the times 'floor: impact 1' are missing"),
        (_times(lambda found: {k: x + 1e-3 for k, x in found.items()}), r"impact 1' are .* \(error: 0.001 s\)"),
        (
            _times(lambda found: {k: np.nan_to_num(x) for k, x in found.items()}),
            "with NaN for realisations without this event",
        ),
        (_times(lambda found: {k: x for k, x in found.items() if "impact" in k}), "'floor: passing 1' are missing"),
        (_uncounted, r"counters: ball: the integrator counted 0 events; expected at least 9 impacts"),
    ],
)
def test_events(integrate, problem):
    with pytest.raises(AssertionError, match=problem):
        check_integrator(made(integrate=integrate, events=True))


def _segments(change):
    def integrate_segments(self, ensemble, times, rtol):
        found = Dop853().integrate_segments(ensemble, times, rtol)
        return replace(found, segments=tuple(change(s) for s in found.segments))

    return integrate_segments


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda s: replace(s, begin=s.begin + 1e-3), "segments begin and end at"),
        (lambda s: replace(s, label="hit"), r"labels are \['hit'.*; expected 'floor: impact'"),
        (
            lambda s: replace(s, states=lambda at, s=s: s.states(at[::-1])),
            "at the start of segment 0 .*; expected 0 m/s,",
        ),
    ],
)
def test_segments(change, problem):
    with pytest.raises(AssertionError, match="segments: ball: .*" + problem):
        check_integrator(made(integrate_segments=_segments(change), segments=True))


def _projected(change):
    def integrate_projected(self, projected, times, rtol, watch=None):
        return change(Dop853().integrate_projected(projected, times, rtol, watch))

    return integrate_projected


@pytest.mark.parametrize(
    ("own", "problem"),
    [
        (_projected(lambda found: found.coefficients), "projected: oscillator: its method integrate_projected returned array"),
        (_projected(lambda found: replace(found, coefficients=0.99 * found.coefficients)), "relative error of the trajectories at the nodes is"),
        (_projected(lambda found: replace(found, message="stiff")), "projected: oscillator: the integration failed: 'stiff'"),
        (lambda self, projected, times, rtol, watch=None: Dop853().integrate_projected(projected, times, rtol),
         "stoppable: oscillator: the integrator did not call the function 'watch'"),
        (lambda self, projected, times, rtol: None, "projected: .* returned None"),
    ],
)  # fmt: skip
def test_projected(own, problem):
    with pytest.raises(AssertionError, match=problem):
        check_integrator(made(integrate_projected=own, projected=True, stoppable=True))


def test_threads():
    """An integrator whose numbers depend on the thread that computes them."""

    def integrate(self, ensemble, times, rtol):
        found = Dop853().integrate(ensemble, times, rtol)
        return replace(found, states=found.states + 1e-12 * (threading.current_thread() is not threading.main_thread()))

    check_integrator(made(integrate=integrate))
    with pytest.raises(AssertionError, match="'made': releases_gil: pendulum.*expected states that agree bit for bit"):
        check_integrator(made(integrate=integrate, releases_gil=True))


def test_declarations_of_before_are_read_with_a_warning():
    class Former(Dop853):
        name = "former"
        capabilities = None
        events = paced = unlocked = True

    with pytest.warns(
        DeprecationWarning, match=r"uqmbd.extend.Capabilities\(events=True, bounded_steps=True, releases_gil=True"
    ):
        found = capabilities_of(Former)
    assert found == uqmbd.extend.Capabilities(events=True, bounded_steps=True, releases_gil=True)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"events": 1}, "events is 1; expected True or False"),
        ({"linear_solvers": "dense"}, "linear_solvers is 'dense'; expected a tuple of names"),
        ({"stoppable": True}, "stoppable requires projected=True"),
        ({"linear_solvers": ("dense",)}, "linear_solvers requires projected=True"),
    ],
)
def test_capabilities_that_cannot_be(options, words):
    with pytest.raises(uqmbd.StudyError, match=words):
        uqmbd.extend.Capabilities(**options)
