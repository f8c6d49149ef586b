"""Behaviour of many realisations (cases.md, "Behaviour")."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import scipy.sparse
import sympy

import uqmbd
from uqmbd.compiled import compilations
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Distance, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper

from ..mechanisms import driven_slider_crank


@pytest.mark.thorough
def test_samples_compile_nothing_twice(tmp_path, monkeypatch):
    """200 parameter samples of one model; the second study takes every kernel from the cache."""
    monkeypatch.setenv("UQMBD_CACHE", str(tmp_path))
    length = uqmbd.RandomVariable("rod_length", chaospy.Uniform(0.3, 0.4), units="m")
    times = np.linspace(0, 0.2, 5)

    def study():
        return uqmbd.Study("study", driven_slider_crank(length), times, [MonteCarlo(samples=200, seed=1)])

    first = study()
    first.model  # noqa: B018 - compiled when first needed
    compiled = compilations[0]
    node = first.propagate(MonteCarlo(samples=200, seed=1))
    # an integrator may compile one kernel when it first needs it, for all samples
    assert compilations[0] <= compiled + 1
    compiled = compilations[0]
    assert int((node["samples"]["status"] != 0).sum()) == 0
    second = study()
    second.propagate(MonteCarlo(samples=10, seed=2))
    uqmbd.simulate(second.mechanism, times, values={"rod_length": 0.31})
    assert compilations[0] == compiled


@pytest.mark.thorough
def test_failing_samples_are_reported_and_the_others_stand(close):
    """A rod shorter than the crank locks on the way: a status with a reason, and closed-form results elsewhere."""
    length = uqmbd.RandomVariable("rod_length", chaospy.Uniform(0.14, 0.25), units="m")
    mechanism = driven_slider_crank(length)
    times = np.linspace(0, np.pi / 2, 9)
    study = uqmbd.Study("study", mechanism, times, [MonteCarlo(samples=40, seed=4)])
    with pytest.warns(UserWarning, match="realisations failed; .*locks up"):
        samples = study.propagate(MonteCarlo(samples=40, seed=4))["samples"]
    lengths = samples["inputs"].sel(input="rod_length").values
    status = samples["status"].values
    locked = lengths < 0.15
    assert 1 < locked.sum() < 15
    np.testing.assert_array_equal(status != 0, locked)
    assert set(status[locked]) == {2}
    x = samples["response"].sel(output="x").values
    good, phi = lengths[~locked, None], 2 * times
    root = np.sqrt(np.maximum(good**2 - (0.15 * np.sin(phi)) ** 2, 0))
    close(x[~locked], 0.15 * np.cos(phi) + root, relative=1e-4)


@pytest.mark.thorough
def test_samples_that_cannot_be_assembled_are_reported_and_the_others_stand(close):
    """A lever of 1 m and a strut from a point 3 m away: nothing shorter than 2 m reaches."""
    length = uqmbd.RandomVariable("strut_length", chaospy.Uniform(1.95, 2.5), units="m")
    mechanism = uqmbd.Mechanism("triangle", uqmbd.Planar())
    lever = mechanism.body("lever", mass=1, inertia=1, angle=0.4)
    mechanism.add(Revolute("pivot", mechanism.ground, lever, (0, 0), (0, 0)))
    mechanism.add(Distance("strut", mechanism.ground, lever, (3, 0), (1, 0), length=length))
    mechanism.output("angle", lever.angle, units="rad")
    study = uqmbd.Study("study", mechanism, [0, 0.1, 0.2], [MonteCarlo(samples=40, seed=2)])
    with pytest.warns(UserWarning, match="realisations failed; .*'strut' cannot be closed"):
        node = study.propagate(MonteCarlo(samples=40, seed=2))
    samples = node["samples"]
    lengths, status = samples["inputs"].values[:, 0], samples["status"].values
    short = lengths < 2
    assert 1 < short.sum() < 15
    np.testing.assert_array_equal(status, np.where(short, 1, 0))
    messages = samples["message"].values[short]
    assert all("strut" in str(m) for m in messages)
    exact = np.arccos((10 - lengths[~short] ** 2) / 6)
    close(samples["response"].values[~short, 0, 0], exact, relative=1e-6)
    assert np.isfinite(node["statistics"]["mean"].values).all()
    close(node["statistics"]["mean"].values[0, 0], exact.mean(), relative=1e-6)


@pytest.mark.thorough
def test_single_failing_sample_leaves_the_others_as_they_are_alone(close):
    """The same realisation, computed with a failing one beside it and by itself."""
    length = uqmbd.RandomVariable("rod_length", chaospy.Uniform(0.14, 0.25), units="m")
    times = np.linspace(0, np.pi / 2, 9)
    mechanism = driven_slider_crank(length)
    study = uqmbd.Study("study", mechanism, times, [MonteCarlo(samples=2, seed=1)])
    found = study.problem(MonteCarlo(samples=2, seed=1)).realise(np.array([[0.2], [0.145], [0.24]]))
    assert list(found.status != 0) == [False, True, False]
    assert found.messages[1]
    for k, value in ((0, 0.2), (2, 0.24)):
        alone = uqmbd.simulate(mechanism, times, values={"rod_length": value})
        close(found.response[k, 0], alone.x, relative=1e-4)


@pytest.mark.parametrize("space", [uqmbd.Translational(gravity=(0, -9.81)), uqmbd.Planar(gravity=(0, -9.81))])
def test_random_mass_changes_weight_and_inertia(space, close):
    """y = -(m g / k) (1 - cos(sqrt(k / m) t)): the sag shows the weight, the period the inertia."""
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(1, 5), units="kg")
    mechanism = uqmbd.Mechanism("hanging", space)
    inertia = {} if space.name == "translational" else {"inertia": 0.1}
    body = mechanism.body("weight", mass=mass, **inertia)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, (0, 0), (0, 0), stiffness=40))
    mechanism.output("y", body.position[1])
    times = np.linspace(0, 3, 31)
    for m in (1.0, 3.0, 5.0):
        data = uqmbd.simulate(mechanism, times, values={"mass": m}, rtol=1e-8)
        close(data.y, -(m * 9.81 / 40) * (1 - np.cos(np.sqrt(40 / m) * times)), relative=1e-5)


@pytest.mark.thorough
def test_random_mass_and_length_change_a_pendulum(close):
    """Small swings of a rod with a bob: w^2 = (M l + m l / 2) g / (M l^2 + m l^2 / 3)."""
    bob = uqmbd.RandomVariable("bob", chaospy.Uniform(0.5, 2), units="kg")
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.5, 1.5), units="m")
    mechanism = uqmbd.Mechanism("clock", uqmbd.Spatial(gravity=(0, -9.81, 0)))
    rod_mass, total = 0.6, 0.6 + bob
    centre = (bob * length + rod_mass * length / 2) / total  # below the pivot
    about = bob * length**2 + rod_mass * length**2 / 3 - total * centre**2
    angle = 0.002
    rod = mechanism.body(
        "rod", mass=total, inertia=(about, sympy.Float(1e-3), about + 1e-3), com=(0, -centre, 0),
        quaternion=(np.cos(angle / 2), np.sin(angle / 2), 0, 0),
    )  # fmt: skip
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0, 0), (0, 0, 0), (1, 0, 0), (1, 0, 0)))
    mechanism.output("sine", rod.rotation[2, 1])
    times = np.linspace(0, 4, 41)
    for m, l in ((0.5, 1.5), (2.0, 0.5)):  # noqa: E741
        data = uqmbd.simulate(mechanism, times, values={"bob": m, "length": l}, rtol=1e-8)
        w = np.sqrt((m * l + rod_mass * l / 2) * 9.81 / (m * l**2 + rod_mass * l**2 / 3))
        close(data.sine, angle * np.cos(w * times), relative=1e-3)


@pytest.mark.thorough
def test_samples_of_very_different_speed_are_all_accurate():
    """Oscillators from 1 to 50 rad/s in one study: none is sacrificed to the average of the others."""
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(1, 2500), units="N/m")
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    mass = mechanism.body("mass", mass=1, position=(1, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), stiffness))
    mechanism.output("x", mass.position[0])
    times = np.linspace(0, 5, 51)
    study = uqmbd.Study("oscillator", mechanism, times, [MonteCarlo(samples=40, seed=5)])
    samples = study.propagate(study.propagators[0])["samples"]
    rate = np.sqrt(samples["inputs"].values[:, :1])
    error = np.abs(samples["response"].values[:, 0] - np.cos(rate * times)).max(axis=1)
    alone = uqmbd.simulate(mechanism, times, values={"stiffness": 2500})
    worst_alone = float(np.abs(alone.x - np.cos(50 * times)).max())
    assert error.max() < 5 * worst_alone


def test_rate_of_a_driver_may_be_random(close):
    rate = uqmbd.RandomVariable("rate", chaospy.Uniform(1, 9), units="rad/s")
    mechanism = uqmbd.Mechanism("crank", uqmbd.Planar())
    crank = mechanism.body("crank", mass=1, inertia=1)
    mechanism.add(Revolute("pivot", mechanism.ground, crank, (0, 0), (0, 0)))
    mechanism.add(RotationDriver("drive", mechanism.ground, crank, rate * uqmbd.t))
    mechanism.output("angle", crank.angle)
    times = np.linspace(0, 5, 6)
    for value in (1.0, 5.0, 8.5):
        close(uqmbd.simulate(mechanism, times, values={"rate": value}).angle, value * times, relative=1e-5)


def test_sample_with_a_singular_system_is_reported_and_the_others_stand():
    """Without mass a free particle has no acceleration; with mass it falls."""
    mass = uqmbd.RandomVariable("mass", chaospy.DiscreteUniform(0, 1), units="kg")
    mechanism = uqmbd.Mechanism("particle", uqmbd.Translational(gravity=(0, -9.81)))
    particle = mechanism.body("particle", mass=mass)
    mechanism.output("height", particle.position[1], units="m")
    study = uqmbd.Study("particle", mechanism, [0, 1, 2])
    with pytest.warns(UserWarning, match="realisations failed; .*singular"):
        node = study.propagate(MonteCarlo(samples=80, seed=1, max_failures=0.9))
    samples = node["samples"]
    massless = samples["inputs"].values[:, 0] == 0
    assert 0 < massless.sum() < 80
    assert np.array_equal(samples["status"].values != 0, massless)
    assert all("singular" in m for m in samples["message"].values[massless])
    assert np.allclose(node["statistics"]["mean"].values[0], [0, -9.81 / 2, -9.81 * 2], atol=1e-4)


@pytest.mark.thorough
def test_the_jacobian_on_its_pattern_is_the_derivative_of_the_residual():
    """``dr/dy + c dr/dyp`` from the entries, the pattern and no other attribute agrees with central differences."""
    length = uqmbd.RandomVariable("rod_length", chaospy.Uniform(0.3, 0.4), units="m")
    study = uqmbd.Study("study", driven_slider_crank(length), [0.0, 0.1], [MonteCarlo(samples=2, seed=1)])
    ensemble = study.problem(study.propagators[0]).ensemble(np.array([[0.32], [0.37]]))
    rows, pointers = ensemble.pattern
    n = len(pointers) - 1
    rng = np.random.default_rng(5)
    for c in (0.0, 1.0, -3.0):
        y, yp = rng.normal(size=(2, 2, n))
        values = ensemble.jacobian(0.05, y, yp, c)
        assert values.shape == (2, len(rows)) and pointers[-1] == len(rows)
        for k in range(2):
            found = scipy.sparse.csc_array((values[k], rows, pointers), shape=(n, n)).toarray()
            h, exact = 1e-6, np.zeros((n, n))
            for j, step in enumerate(np.eye(n) * h):
                ends = [ensemble.residual(0.05, y + s * step, yp + s * c * step)[k] for s in (1, -1)]
                exact[:, j] = (ends[0] - ends[1]) / (2 * h)
            np.testing.assert_allclose(found, exact, rtol=1e-5, atol=1e-5 * max(1.0, abs(exact).max()))
