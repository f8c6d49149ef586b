"""Integrators of plugins: what they cannot is an error before anything is computed, and results name who integrated."""

from __future__ import annotations

import sys

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd import plugins
from uqmbd.dynamics.integrators import capabilities_of, integrate
from uqmbd.testing.propagators.executors import RecordingExecutor
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper

TIMES = np.linspace(0, 1, 11)


class BackwardEuler:
    """Fixed small steps of first order, for mechanisms without constraints; it knows nothing of events."""

    name = "backward-euler"
    calls = 0

    def integrate(self, ensemble, times, rtol):
        type(self).calls += 1
        start = ensemble.start
        y = ensemble.pack(start.q, start.s, start.v, start.multipliers)
        states = [np.concatenate(ensemble.expand(y), axis=1)]
        rows, pointers = ensemble.model.pattern
        columns = np.repeat(np.arange(y.shape[1]), np.diff(pointers))
        for begin, end in zip(times[:-1], times[1:], strict=True):
            size = (end - begin) / 20
            for k in range(20):
                old = y.copy()
                for _ in range(3):
                    now, rate = begin + (k + 1) * size, (y - old) / size
                    residual = ensemble.residual(now, y, rate)
                    values = ensemble.jacobian(now, y, rate, 1 / size)
                    for one, (r, v) in enumerate(zip(residual, values, strict=True)):
                        matrix = np.zeros((y.shape[1],) * 2)
                        matrix[rows, columns] = v
                        y[one] -= np.linalg.solve(matrix, r)
            states.append(np.concatenate(ensemble.expand(y), axis=1))
        return uqmbd.extend.Trajectories(times, np.stack(states, axis=1), ("",) * len(ensemble))


class Projecting(BackwardEuler):
    """The same, that can integrate projected equations, too: it leaves them to the integrator of uqmbd."""

    name = "projecting"
    capabilities = uqmbd.extend.Capabilities(projected=True)

    def integrate_projected(self, projected, times, rtol):
        return projected.integrate(times, rtol, "dop853")


class Hopeful(BackwardEuler):
    """It claims to follow events."""

    name = "hopeful"
    capabilities = uqmbd.extend.Capabilities(events=True)


class Strange(BackwardEuler):
    """What it returns is nothing that can be used."""

    name = "strange"

    def integrate(self, ensemble, times, rtol):
        return np.zeros((len(ensemble), len(times)))


@pytest.fixture(autouse=True)
def installed(monkeypatch):
    """As if a plugin offered them."""
    found = plugins.registry.registered()
    classes = {cls.name: cls for cls in (BackwardEuler, Projecting, Hopeful, Strange)}
    registry = plugins.Registry(found.plugins, {**found.classes, "integrators": classes})
    monkeypatch.setattr(plugins.registry, "registered", lambda: registry)
    for cls in classes.values():
        monkeypatch.setattr(cls, "calls", 0)


def ball():
    mechanism = uqmbd.Mechanism("drop", uqmbd.Translational(gravity=(0, -9.81)))
    height = uqmbd.RandomVariable("height", chaospy.Uniform(0.9, 1.1), units="m")
    body = mechanism.body("ball", mass=1, position=(0, height))
    mechanism.add(PlaneImpact("floor", mechanism.ground, body, (0, 0), (0, 0), (0, 1), restitution=0.7))
    mechanism.output("y", body.position[1], units="m")
    return mechanism


def spring(stiffness=25.0, damping=0.0):
    mechanism = uqmbd.Mechanism("spring", uqmbd.Translational())
    amplitude = uqmbd.RandomVariable("amplitude", chaospy.Uniform(1.0, 1.2), units="m")
    mass = mechanism.body("mass", mass=1, position=(amplitude, 0))
    mechanism.add(
        SpringDamper(
            "spring", mechanism.ground, mass, (-2, 0), (0, 0), stiffness=stiffness, damping=damping, free_length=2
        )
    )
    mechanism.output("x", mass.position[0], units="m")
    return mechanism


@pytest.mark.parametrize("integrator", ["backward-euler", "ida"])
def test_no_ball_falls_through_the_floor(integrator, tmp_path):
    """Whoever cannot follow events is told before anything is computed, in every way to a result."""
    study = uqmbd.Study("drops", ball(), TIMES, [MonteCarlo(samples=4, seed=1)], integrator=integrator)
    workers = RecordingExecutor()
    ways = [
        lambda: uqmbd.simulate(study.mechanism, TIMES, integrator=integrator),
        lambda: study.run(workers, folder=tmp_path),
        lambda: study.propagate(MonteCarlo(samples=4, seed=1), workers),
        lambda: study.converge(MonteCarlo(seed=1), samples=[4, 8], workers=workers),
        lambda: uqmbd.report.motion(study, samples=2, frames=3),
    ]
    for way in ways:
        with pytest.raises(uqmbd.StudyError) as error:
            way()
        words = str(error.value)
        assert f"the integrator {integrator!r} cannot follow impacts and other events (floor: impact)" in words
        assert "integrator='auto'" in words and "'hopeful'" in words and "'ida'" not in words.split("Use")[1]
        assert ("does not declare events=True" in words) == (integrator == "backward-euler")
    assert workers.chunks == 0 and BackwardEuler.calls == 0


def test_the_command_check_tells_it(tmp_path, capsys):
    from uqmbd.cli.__main__ import main

    (tmp_path / "drops.py").write_text(
        "import numpy as np\nimport uqmbd\nfrom uqmbd_contact import PlaneImpact\n"
        "from uqmbd_montecarlo import MonteCarlo\n"
        "m = uqmbd.Mechanism('drop', uqmbd.Translational(gravity=(0, -9.81)))\n"
        "b = m.body('ball', mass=1, position=(0, 1))\n"
        "m.add(PlaneImpact('floor', m.ground, b, (0, 0), (0, 0), (0, 1), restitution=0.7))\n"
        "m.output('y', b.position[1])\n"
        "study = uqmbd.Study('drops', m, np.linspace(0, 1, 3), [MonteCarlo(samples=4)], integrator='backward-euler')\n"
    )
    with pytest.raises(SystemExit) as exit_:
        raise SystemExit(main(["check", str(tmp_path / "drops.py")]))
    assert exit_.value.code == 2
    assert "'backward-euler' cannot follow impacts" in capsys.readouterr().err


@pytest.mark.thorough
def test_galerkin_takes_no_other_integrator_than_that_of_the_study():
    """It says so; with one of its own, or one that integrates projected equations, it runs, and the results name it."""
    study = uqmbd.Study("s", spring(), TIMES, integrator="backward-euler")
    for propagator in (Galerkin(order=1), Galerkin(order=1, elements=2)):
        assert "'backward-euler' cannot integrate projected equations" in propagator.obstacle(study)
        with pytest.raises(uqmbd.StudyError, match=r"does not declare projected=True.*Galerkin\(integrator"):
            study.propagate(propagator)
    assert BackwardEuler.calls == 0
    # realisations of so poor an integrator would not verify it
    own = study.propagate(Galerkin(order=1, integrator="dop853", verify=0))
    assert own.attrs["integrated_by"] == "dop853"
    for propagator in (Galerkin(order=1, verify=0), Galerkin(order=1, elements=2, verify=0)):
        node = uqmbd.Study("s", spring(), TIMES, integrator="projecting").propagate(propagator)
        assert node.attrs["integrated_by"] == "projecting"
        exact = 1.1 * np.cos(5 * TIMES)
        np.testing.assert_allclose(node["statistics/mean"].sel(output="x"), exact, atol=1e-4)


def test_motions_from_event_to_event_are_those_of_the_core():
    """An aligned chaos follows its motions itself, by no integrator of a plugin."""
    study = uqmbd.Study("drops", ball(), TIMES, integrator="hopeful")
    propagator = Collocation(order=1, alignment="events")
    assert "'hopeful' cannot integrate from event to event" in propagator.obstacle(study)
    with pytest.raises(uqmbd.StudyError, match="integrator='auto', or 'dop853', 'radau'"):
        study.propagate(propagator)
    assert Hopeful.calls == 0


def test_who_declares_events_is_asked():
    found = uqmbd.simulate(ball(), TIMES, integrator="hopeful", check=False)
    assert Hopeful.calls == 1 and found.attrs["integrated_by"] == "hopeful"


@pytest.mark.parametrize("propagator", [MonteCarlo(samples=4, seed=1), Collocation(order=1)], ids=lambda p: p.name)
def test_results_name_who_integrated_and_how_wrong_it_is(propagator):
    """First order in steps of 5 ms, whatever the tolerance: against the closed form, and as it is stated."""
    study = uqmbd.Study("s", spring(), TIMES, [propagator], integrator="backward-euler")
    node = study.run()[propagator.node_name]
    assert node.attrs["integrated_by"] == "backward-euler"
    once = uqmbd.simulate(spring(), TIMES, integrator="backward-euler")
    wrong = np.abs(once["x"].values - 1.1 * np.cos(5 * TIMES)).max()
    assert wrong > 0.01, "it is a poor one"
    assert float(once["integration_error"].max()) == pytest.approx(wrong, rel=1e-3)
    stated = float(node["statistics/integration_error"].max())
    # the limit of 99 % of realisations from three of them: by a factor of at most 3.73 above the root mean square
    assert wrong / 1.2 < stated < 4.5 * wrong
    assert wrong / 1.2 < float(node["statistics/integration_error_rms"].max()) < 1.2 * wrong
    assert once.attrs["integrated_by"] == "backward-euler"


@pytest.mark.parametrize(
    ("mechanism", "integrator", "by"),
    [
        (spring(), "auto", "dop853"),
        (spring(), "ida", "ida"),
        (ball(), "radau", "radau"),
        (spring(stiffness=1e6, damping=1e5), "auto", "radau"),
        (ball(), "auto", "dop853"),
    ],
    ids=["soft", "by ida", "by radau", "stiff", "impacts"],
)
def test_results_say_what_auto_did(mechanism, integrator, by):
    study = uqmbd.Study("s", mechanism, TIMES, [MonteCarlo(samples=3, seed=1)], integrator=integrator)
    tree = study.run()
    assert tree.attrs["integrator"] == integrator
    assert tree["monte-carlo"].attrs["integrated_by"] == by
    assert uqmbd.simulate(mechanism, TIMES, integrator=integrator).attrs["integrated_by"] == by


def test_what_returns_the_wrong_kind_is_named():
    with pytest.raises(uqmbd.StudyError, match=r"the integrator 'strange': its method integrate returned a ndarray"):
        uqmbd.simulate(spring(), TIMES, integrator="strange")


@pytest.mark.parametrize("former", ["events", "projected", "paced", "delegates", "linear_solvers"])
def test_capabilities_that_are_declared_twice_are_refused(former):
    """Class attributes of before 0.1 next to `capabilities` are an error: they have no effect."""
    value = ("dense",) if former == "linear_solvers" else True
    both = type("Both", (), {"name": "both", "capabilities": uqmbd.extend.Capabilities(), former: value})
    with pytest.raises(
        uqmbd.StudyError,
        match=f"integrator 'both': the class attributes {former} have no effect next to `capabilities`",
    ):
        capabilities_of(both)
    alone = type("Alone", (), {"name": "alone", "capabilities": uqmbd.extend.Capabilities(events=True), former: False})
    if former != "linear_solvers":
        assert capabilities_of(alone).events


def test_an_integrator_that_declares_nonsense_does_not_hide_those_that_can(monkeypatch):
    """Only the chosen integrator is judged: the invalid class of another one raises no error."""
    broken = type("Broken", (), {"name": "broken", "capabilities": 3, "integrate": None})
    module = sys.modules[integrate.__module__]
    known = module.installed_integrators()
    monkeypatch.setattr(module, "installed_integrators", lambda: {"broken": broken, **known})
    with pytest.raises(
        uqmbd.StudyError, match="study 's': the integrator 'ida' cannot .*Use integrator='auto', or 'dop853', 'radau'"
    ):
        module.require("ida", "events", "study 's'")
