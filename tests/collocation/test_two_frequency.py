"""Chaos of frequencies and amplitudes: closed forms over long times, every rule, and what is refused."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.results import QuasiPeriodicChaos, load, save, study_tree, surrogate
from uqmbd_collocation import Collocation
from uqmbd_collocation.two_frequency.identification import identify
from uqmbd_collocation.two_frequency.lattice import ball
from uqmbd_collocation.two_frequency.series import Signals, fit_series, refine
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper, TorsionSpringDamper

STIFFNESS = uqmbd.RandomVariable("k", chaospy.Uniform(9.5, 10.5), units="N/m")


def coupled(ratio: float, end: float, count: int) -> uqmbd.Study:
    """Two masses of 1 kg between walls; the one frequency is that of a mass, the other about `ratio` times as high."""
    coupling = (ratio**2 - 1) / 2 * 10.0
    c = uqmbd.RandomVariable("c", chaospy.Uniform(0.97 * coupling, 1.03 * coupling), units="N/m")
    mechanism = uqmbd.Mechanism("coupled", uqmbd.Line())
    one = mechanism.body("one", mass=1, position=0.1)
    two = mechanism.body("two", mass=1, position=0.02)
    ground = mechanism.ground
    mechanism.add(SpringDamper("left", ground, one, 0, 0, stiffness=STIFFNESS, free_length=0))
    mechanism.add(SpringDamper("right", ground, two, 0, 0, stiffness=STIFFNESS, free_length=0))
    mechanism.add(SpringDamper("between", one, two, 0, 0, stiffness=c, free_length=0))
    mechanism.output("x", one.position[0], units="m")
    mechanism.output("v", two.velocity[0], units="m/s")
    return uqmbd.Study("coupled", mechanism, times=np.linspace(0, end, count), rtol=1e-10, propagators=[])


def damped() -> uqmbd.Study:
    """One of the masses, of which harmonics of the time that is studied tell nearly all."""
    mechanism = uqmbd.Mechanism("damped", uqmbd.Line())
    mass = mechanism.body("mass", mass=0.1, position=0.1)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, STIFFNESS, damping=0.005, free_length=0))
    mechanism.output("x", mass.position[0], units="m")
    return uqmbd.Study("damped", mechanism, times=np.linspace(0, 40, 401), rtol=1e-9, propagators=[])


def exact(inputs, times):
    """Outputs (K, 2, T) of the coupled oscillators, by their modes."""
    c, k = np.asarray(inputs).T[:, :, None]
    slow, fast = np.sqrt(k), np.sqrt(k + 2 * c)
    x = 0.06 * np.cos(slow * times) + 0.04 * np.cos(fast * times)
    v = -0.06 * slow * np.sin(slow * times) + 0.04 * fast * np.sin(fast * times)
    return np.stack([x, v], axis=1)


def relative(chaos, inputs, known):
    """Root mean square error (O, T) over the largest standard deviation of exact values (K, O, T)."""
    wrong = chaos.evaluate(inputs) - known
    assert np.isfinite(wrong).all()
    return np.sqrt((wrong**2).mean(axis=0)) / known.std(axis=0).max(axis=-1, keepdims=True)


def drawn(study, count):
    """Inputs (count, 2) as they are distributed, in the order of their names."""
    space = uqmbd.extend.GermSpace.of(study.mechanism.inputs)
    return space.to_inputs(space.from_uniform(np.random.default_rng(3).random((count, 2))))


@pytest.mark.thorough
@pytest.mark.parametrize("ratio", [1.7320508, 3.0, 3.002, 1.15])
def test_coupled_oscillators_whatever_the_ratio_of_frequencies(ratio):
    """Modes in closed form; at a ratio of 3 the middle node has one frequency only, and its neighbours have two."""
    study = coupled(ratio, 120, 601)
    node = study.propagate(Collocation(order=4, index_set="tensor", alignment="two-frequency"))
    inputs = drawn(study, 300)
    assert relative(surrogate(node), inputs, exact(inputs, study.times)).max() < 1e-3
    known = np.sqrt(10.0) * np.array([1.0, ratio])
    assert np.allclose([node.attrs["frequency_1"], node.attrs["frequency_2"]], known, rtol=2e-3)
    assert node.attrs["frequency_units"] == "rad/s"
    assert node.attrs["residual"] < 1e-5


@pytest.mark.thorough
def test_moments_are_those_of_gauss_nodes():
    """Mean, deviation and Sobol' indices after 60 periods, beside 120 x 120 Gauss nodes of the closed form."""
    study = coupled(1.7320508, 120, 61)
    node = study.propagate(Collocation(order=5, index_set="tensor", alignment="two-frequency"))
    chaos = surrogate(node)
    at, weight = np.polynomial.legendre.leggauss(120)
    space = uqmbd.extend.GermSpace.of(study.mechanism.inputs)
    grid = np.stack(np.meshgrid(at, at, indexing="ij"), axis=-1)
    weights = np.outer(weight, weight) / 4
    inputs = space.to_inputs(space.from_uniform((grid.reshape(-1, 2) + 1) / 2))
    y = exact(inputs, study.times).reshape(120, 120, 2, -1)
    mean = np.einsum("ij,ijot->ot", weights, y)
    variance = np.einsum("ij,ijot->ot", weights, (y - mean) ** 2)
    scale = np.sqrt(variance).max(axis=1, keepdims=True)
    assert (np.abs(chaos.mean - mean) / scale).max() < 3e-3
    assert (np.abs(chaos.std - np.sqrt(variance)) / scale).max() < 3e-3
    given = np.einsum("j,ijot->iot", weight / 2, y)
    first = np.einsum("i,iot->ot", weight / 2, (given - mean) ** 2)
    wrong = np.abs(chaos.sobol_first[0] * variance - first) / scale**2
    assert wrong.max() < 0.02
    assert np.isfinite(node["statistics"]["quantile"]).all()


@pytest.mark.thorough
@pytest.mark.parametrize(
    "options",
    [
        {"order": 3, "rule": "smolyak"},
        {"order": 3, "method": "regression"},
        {"order": 3, "method": "omp", "samples": 20},
        {"order": 1, "adaptive": "order", "tolerance": 1e-4},
        {"adaptive": "dimension", "tolerance": 1e-4},
        {"order": 2, "elements": 3},
        {"order": 2, "elements": "adaptive", "threshold": 1e-3},
    ],
)
def test_every_way_to_fit(options):
    study = coupled(1.7320508, 60, 121)
    node = study.propagate(Collocation(alignment="two-frequency", **options))
    inputs = drawn(study, 200)
    assert relative(surrogate(node), inputs, exact(inputs, study.times)).max() < 1e-2
    assert "elements" not in options or node.attrs["elements"] > 1
    assert node.attrs.get("tolerance_met", "True") == "True"


@pytest.mark.thorough
def test_angles_that_grow_and_what_follows_them():
    """A disc that spins freely: the angle is a drift, without any harmonic."""
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(5.0, 0.1), units="rad/s")
    mechanism = uqmbd.Mechanism("disc", uqmbd.Planar())
    body = mechanism.body("disc", mass=1, inertia=0.5, position=(0, 0), angle=0.3, angular_velocity=speed)
    mechanism.add(Revolute("axle", mechanism.ground, body, point_i=(0, 0), point_j=(0, 0)))
    mechanism.output("angle", body.angle, units="rad")
    mechanism.output("height", body.point((0.2, 0))[1], units="m")
    study = uqmbd.Study("disc", mechanism, times=np.linspace(2, 102, 401), rtol=1e-10, propagators=[])
    node = study.propagate(Collocation(order=2, alignment="two-frequency"))
    inputs = np.random.default_rng(1).normal(5.0, 0.1, (100, 1))
    angle = 0.3 + inputs * (study.times - study.times[0])
    known = np.stack([angle, 0.2 * np.sin(angle)], axis=1)
    assert relative(surrogate(node), inputs, known).max() < 1e-4
    assert "frequency_2" not in node.attrs and node.attrs["frequency_1"] == pytest.approx(5.0, rel=1e-6)
    assert np.isfinite(node["statistics"]["quantile"]).all()


@pytest.mark.thorough
def test_stored_and_read_without_the_mechanism(tmp_path):
    """Evaluation of what was stored has the same bits; of some times only, the same values."""
    study = coupled(1.7320508, 40, 81)
    node = study.propagate(Collocation(order=2, alignment="two-frequency"))
    save(study_tree([node], study="coupled", mechanism="coupled"), tmp_path / "results.nc")
    held = load(tmp_path / "results.nc")[node.name]
    points = drawn(study, 20)
    whole = surrogate(node).evaluate(points)
    known = QuasiPeriodicChaos.from_dataset(held["quasi_periodic"])
    np.testing.assert_array_equal(known.evaluate(points), whole)
    later = surrogate(held, "v", times=[7, 30, 77])
    np.testing.assert_allclose(later.evaluate(points)[:, 0], whole[:, 1, [7, 30, 77]], atol=1e-12)
    # closed forms of the parts
    assert np.allclose(known.frequencies(points)[:, 0], np.sqrt(points[:, 1]), rtol=1e-4)
    assert np.allclose(known.amplitudes(points)[:, 0].max(axis=1), 0.06, rtol=1e-3)


def pendulums(angle: float, end: float, count: int, damping: float = 0.0) -> uqmbd.Study:
    """A double pendulum of point masses, from rest."""
    length = uqmbd.RandomVariable("length", chaospy.Normal(1.0, 0.02), units="m")
    mechanism = uqmbd.Mechanism("double", uqmbd.Planar(gravity=(0, -9.81)))
    below = 0.6 * angle
    x, y = length * sympy.sin(angle), -length * sympy.cos(angle)
    first = mechanism.body("first", mass=1, inertia=0, position=(x, y), angle=angle)
    place = (x + sympy.sin(below), y - sympy.cos(below))
    second = mechanism.body("second", mass=1, inertia=0, position=place, angle=below)
    pivot = mechanism.add(Revolute("pivot", mechanism.ground, first, point_i=(0, 0), point_j=(0, length)))
    mechanism.add(Revolute("elbow", first, second, point_i=(0, 0), point_j=(0, 1)))
    if damping:
        mechanism.add(TorsionSpringDamper("damper", mechanism.ground, first, stiffness=0, damping=damping))
    mechanism.output("angle", first.angle, units="rad")
    mechanism.output("height", second.position[1], units="m")
    mechanism.output("force", pivot.reaction_force[1], units="N")
    return uqmbd.Study("double", mechanism, times=np.linspace(0, end, count), rtol=1e-9, propagators=[])


@pytest.mark.slow
def test_double_pendulum_beside_a_thousand_realisations():
    """At 17 degrees, 4 nodes, to 200 s, reactions too; the stated error is the true one within a factor of two."""
    study = pendulums(0.3, 200, 401)
    node = study.propagate(Collocation(order=3, alignment="two-frequency", verify=16))
    chaos = surrogate(node)
    samples = study.propagate(MonteCarlo(samples=1000, seed=9))["samples"]
    known = samples["response"].transpose("sample", "output", "time").values
    wrong = chaos.evaluate(samples["inputs"].values) - known
    error = np.sqrt((wrong**2).mean(axis=0))
    assert (error / known.std(axis=0).max(axis=-1, keepdims=True)).max() < 5e-4
    spread = np.maximum(chaos.std, 0.01 * chaos.std.max(axis=-1, keepdims=True))
    true, stated = error / spread, chaos.verification_error()
    for kind in (lambda x: np.sqrt((x**2).mean(axis=-1)), lambda x: x.max(axis=-1)):
        ratio = kind(stated) / kind(true)
        assert ((ratio > 0.5) & (ratio < 2)).all()


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("study", "why"),
    [
        (pendulums(2.1, 30, 61), "2.* of 2.* are not.*chaotic"),
        (pendulums(0.3, 60, 61, damping=0.05), "decays"),
        (damped(), "decays"),
    ],
    ids=["chaotic", "damped", "hardly damped"],
)
def test_other_motions_are_refused(study, why):
    with pytest.raises(uqmbd.StudyError, match=why):
        study.propagate(Collocation(order=1, alignment="two-frequency"))


def test_what_does_not_move_is_refused():
    mechanism = uqmbd.Mechanism("rest", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=0.0)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=STIFFNESS, free_length=0))
    mechanism.output("x", mass.position[0], units="m")
    study = uqmbd.Study("rest", mechanism, times=np.linspace(0, 5, 51), propagators=[])
    with pytest.raises(uqmbd.StudyError, match="needs oscillating motions, but no output oscillates"):
        study.propagate(Collocation(order=2, alignment="two-frequency"))


def test_options_that_mean_nothing_are_reported():
    with pytest.raises(uqmbd.StudyError, match="clock='x' requires alignment='phase'"):
        Collocation(alignment="two-frequency", clock="x")
    with pytest.warns(uqmbd.StudyWarning, match="max_elements=7 has no effect"):
        Collocation(alignment="two-frequency", max_elements=7)


@pytest.mark.slow
@settings(max_examples=4, deadline=None)
@given(st.integers(0, 10**6), st.floats(1.08, 5.0), st.booleans())
def test_series_are_found_again(seed, ratio, even):
    """Sums of harmonics with decaying amplitudes: frequencies of other realisations are those they were made of."""
    rng = np.random.default_rng(seed)
    lattice = ball(4, 2)
    lattice = lattice[np.abs(lattice).sum(axis=1) % 2 == (0 if even else 1)]
    size = 0.15 ** (np.abs(lattice).sum(axis=1) - (2 if even else 1))
    times = np.linspace(0, 150, 4096)
    wave = rng.normal(size=(2, len(lattice), 2)) * size[:, None]
    # the main lines are there in both outputs
    first = np.abs(lattice).sum(axis=1) == (2 if even else 1)
    wave[:, first] = np.sign(wave[:, first]) * (0.5 + np.abs(wave[:, first]))
    places = np.linspace(-1, 1, 4)[:, None]
    base = np.array([2.0, 2.0 * ratio]) * (1 + np.array([0.02, 0.035]) * places)
    # lines nearer than two resolutions of the window are not told apart by anybody
    lines = np.abs(base @ lattice.T)
    apart = np.abs(lines[:, first, None] - lines[:, None, ~first]).min(initial=np.inf)
    assume(min(apart, np.diff(np.sort(lines[:, first], axis=1), axis=1).min()) > 4 * 2 * np.pi / times[-1])
    signals = []
    for w in base:
        phase = times[:, None] * (lattice @ w)
        signals.append(Signals(times, 3.0 + 0.1 * times[:, None] + np.cos(phase) @ wave[0] + np.sin(phase) @ wave[1]))
    found = identify(signals, places)
    assert found is not None and not found.bad.any()
    # the same signals between and behind the samples
    later = np.linspace(0, 150, 999)
    for w, one in zip(base, found.series, strict=True):
        phase = later[:, None] * (lattice @ w)
        known = 3.0 + 0.1 * later[:, None] + np.cos(phase) @ wave[0] + np.sin(phase) @ wave[1]
        assert np.abs(one.at(later) - known).max() < 0.05 * np.abs(known - 3.0 - 0.1 * later[:, None]).max()
    # smooth from realisation to realisation: the base is the same combination of the frequencies in all
    combination = np.linalg.lstsq(base, np.array([one.frequencies for one in found.series]), rcond=None)[0]
    assert np.abs(base @ combination - [one.frequencies for one in found.series]).max() < 1e-3


def test_amplitudes_are_least_squares_and_frequencies_converge():
    """A guess that is off by a third of a turn at the end; the misfit falls to rounding."""
    times = np.linspace(0, 50, 2000)
    values = np.cos(3.0 * times) + 0.3 * np.sin(7.1 * times) - 2
    signals = Signals(times, values[:, None])
    lattice = np.array([[1, 0], [0, 1]])
    guess = np.array([3.0 + 2 / 50, 7.1 - 2 / 50])
    assert fit_series(signals, guess, lattice).residual[0] > 0.2
    found = refine(signals, guess, lattice)
    assert np.allclose(found.frequencies, [3.0, 7.1], atol=1e-9)
    assert np.allclose(found.amplitudes[:, 0], [-2, 0, 1, 0, 0, 0.3], atol=1e-7)
    assert found.residual[0] < 1e-7


def test_what_dies_down_is_refused_whatever_bases_its_realisations_have():
    """A damped double pendulum: one realisation looks like one frequency, another one like two."""
    mass = uqmbd.RandomVariable("mass", chaospy.Normal(0.5, 0.05), units="kg")
    shoulder, elbow = (
        uqmbd.RandomVariable(name, chaospy.LogNormal(mu=float(np.log(c)), sigma=0.3), units="N m s")
        for name, c in (("shoulder", 0.012), ("elbow", 0.006))
    )
    mechanism = uqmbd.Mechanism("double pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    a, b = 0.9, 0.5
    upper = mechanism.body("upper", 0.8, 0.0107, position=(0.2 * np.sin(a), -0.2 * np.cos(a)), angle=a)
    place = (0.4 * np.sin(a) + 0.15 * np.sin(b), -0.4 * np.cos(a) - 0.15 * np.cos(b))
    lower = mechanism.body("lower", mass, 0.0042, position=place, angle=b)
    joints = [
        mechanism.add(Revolute("A", mechanism.ground, upper, (0, 0), (0, 0.2))),
        mechanism.add(Revolute("B", upper, lower, (0, -0.2), (0, 0.15))),
    ]
    mechanism.add(TorsionSpringDamper("c1", mechanism.ground, upper, stiffness=0, damping=shoulder))
    mechanism.add(TorsionSpringDamper("c2", upper, lower, stiffness=0, damping=elbow))
    for joint in joints:
        mechanism.output(joint.name, joint.angle, units="rad")
    study = uqmbd.Study("double pendulum", mechanism, np.arange(201) / 20)
    with pytest.raises(uqmbd.StudyError, match="needs motions that are sums of harmonics .* decays"):
        study.with_propagators([Collocation(order=3, method="regression", samples=30, alignment="two-frequency")]).run()
