"""Phase-aligned chaos: closed forms over long times, every rule, clocks that stop, and what is refused."""

from __future__ import annotations

from contextlib import nullcontext

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.results import AlignedChaos, load, save, study_tree, surrogate
from uqmbd_collocation import Collocation
from uqmbd_joints import Revolute
from uqmbd_springs import PointForce, SpringDamper, Torque

STIFFNESS = uqmbd.RandomVariable("k", chaospy.Uniform(90, 110), units="N/m")
TORQUE = uqmbd.RandomVariable("torque", chaospy.Normal(1.0, 0.05), units="N m")
INERTIA = 0.5


def oscillator(end: float, count: int) -> uqmbd.Study:
    """A mass of 1 kg on a spring, from 0.1 m at rest."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=0.1)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=STIFFNESS, free_length=0))
    mechanism.output("x", mass.position[0], units="m")
    return uqmbd.Study("oscillator", mechanism, times=np.linspace(0, end, count), rtol=1e-9, propagators=[])


def disc(end: float, count: int) -> uqmbd.Study:
    """A disc that a random torque spins up from rest."""
    mechanism = uqmbd.Mechanism("disc", uqmbd.Planar())
    body = mechanism.body("disc", mass=1, inertia=INERTIA, position=(0, 0), angle=0.3)
    mechanism.add(Revolute("axle", mechanism.ground, body, point_i=(0, 0), point_j=(0, 0)))
    mechanism.add(Torque("drive", body, torque=TORQUE))
    mechanism.output("height", body.point((0.2, 0))[1], units="m")
    return uqmbd.Study("disc", mechanism, times=np.linspace(0, end, count), rtol=1e-9, propagators=[])


def relative(chaos, inputs, exact):
    """Root mean square error (O, T) over the largest standard deviation of exact values (K, O, T)."""
    wrong = chaos.evaluate(inputs) - exact
    assert np.isfinite(wrong).all()
    return np.sqrt((wrong**2).mean(axis=0)) / exact.std(axis=0).max(axis=-1, keepdims=True)


@pytest.mark.thorough
def test_oscillator_over_many_periods():
    """Closed form over 160 periods, whose phases differ by 15 turns: 5 nodes."""
    study = oscillator(100, 1001)
    node = study.propagate(Collocation(order=4, alignment="phase"))
    assert node.attrs["clock"] == "x" and node.attrs["clock_kind"] == "oscillation"
    assert 1 < node.attrs["longer"] < 1.3
    k = np.random.default_rng(0).uniform(90, 110, 200)
    exact = 0.1 * np.cos(np.sqrt(k)[:, None] * study.times)[:, None]
    assert relative(surrogate(node), k[:, None], exact).max() < 2e-3
    stated = node["statistics"]["verification_error"].max()
    assert stated < 4e-3


@pytest.mark.thorough
@pytest.mark.parametrize("end", [40, 100])
@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")  # of 11 %, where little is left
def test_oscillator_that_dies_down(end):
    """Closed form over up to 160 periods; nodes are at rest after 58 to 64 s, each after its number of swings."""
    damping = uqmbd.RandomVariable("c", chaospy.Uniform(0.18, 0.22), units="N s/m")
    mechanism = uqmbd.Mechanism("damped", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=0.1)
    spring = {"stiffness": STIFFNESS, "free_length": 0, "damping": damping}
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, **spring))
    mechanism.output("x", mass.position[0], units="m")
    study = uqmbd.Study("damped", mechanism, times=np.linspace(0, end, 20 * end + 1), rtol=1e-9, propagators=[])
    node = study.propagate(Collocation(order=4, alignment="phase"))
    assert node.attrs["clock"] == "x" and node.attrs["clock_kind"] == "oscillation"
    # a thousandth of the first swing is left where the decay is fastest; of the same phase, frequencies differ by 10 %
    if end > 60:
        first, last = node.attrs["clock_rests"]
        assert 0.9 * np.log(1000) / 0.11 < first < last < 1.1 * np.log(1000) / 0.11
    random = np.random.default_rng(0)
    inputs = np.stack([random.uniform(0.18, 0.22, 200), random.uniform(90, 110, 200)], axis=1)
    c, k = inputs.T[:, :, None]
    rate = np.sqrt(k - c**2 / 4)
    decay = np.exp(-c / 2 * study.times)
    exact = 0.1 * decay * (np.cos(rate * study.times) + c / 2 / rate * np.sin(rate * study.times))
    assert relative(surrogate(node), inputs, exact[:, None]).max() < 2e-3


@pytest.mark.thorough
def test_oscillation_about_a_middle_that_moves_away():
    """A force that grows moves the middle by three times the size of the swing: closed form over 64 periods."""
    mechanism = uqmbd.Mechanism("moving", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=0.1)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=STIFFNESS, free_length=0))
    mechanism.add(PointForce("force", mass, 0, 0.75 * uqmbd.t))
    mechanism.output("x", mass.position[0], units="m")
    study = uqmbd.Study("moving", mechanism, times=np.linspace(0, 40, 801), rtol=1e-9, propagators=[])
    node = study.propagate(Collocation(order=4, alignment="phase"))
    assert node.attrs["clock"] == "x" and node.attrs["clock_kind"] == "oscillation"
    k = np.random.default_rng(0).uniform(90, 110, 200)[:, None]
    rate = np.sqrt(k)
    exact = 0.1 * np.cos(rate * study.times) + 0.75 / k * (study.times - np.sin(rate * study.times) / rate)
    assert relative(surrogate(node), k, exact[:, None]).max() < 1e-3


@pytest.mark.parametrize(
    "options",
    [
        {"order": 4},
        {"order": 4, "rule": "smolyak"},
        {"order": 3, "method": "regression", "samples": 20},
        {"order": 4, "method": "omp", "samples": 20},
        {"order": 1, "adaptive": "order", "tolerance": 1e-4},
        {"adaptive": "dimension", "tolerance": 1e-4},
        {"order": 2, "elements": 3},
    ],
)
def test_every_way_to_fit(options):
    """A disc that spins up: 32 turns at the end, whose phases differ by 10 turns."""
    study = disc(14.2, 143)
    node = study.propagate(Collocation(alignment="phase", **options))
    assert node.attrs["clock"] == "disc" and node.attrs["clock_kind"] == "angle"
    torque = np.random.default_rng(1).normal(1.0, 0.05, 300)
    angle = 0.3 + torque[:, None] / INERTIA * study.times**2 / 2
    error = relative(surrogate(node), torque[:, None], 0.2 * np.sin(angle)[:, None])
    assert error.max() < 1e-2


def test_stored_and_read_without_the_mechanism(tmp_path):
    """Evaluation of what was stored has the same bits."""
    study = oscillator(20, 101)
    node = study.propagate(Collocation(order=2, alignment="phase"))
    save(study_tree([node], study="oscillator", mechanism="oscillator"), tmp_path / "results.nc")
    known = AlignedChaos.from_dataset(load(tmp_path / "results.nc")[node.name]["aligned"])
    points = np.linspace(91, 109, 7)[:, None]
    np.testing.assert_array_equal(known.evaluate(points), surrogate(node).evaluate(points))


def test_without_a_clock_nothing_is_aligned():
    """A mass that comes to rest has no phase."""
    mechanism = uqmbd.Mechanism("rest", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=0.1)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=STIFFNESS, free_length=0, damping=40))
    mechanism.output("x", mass.position[0], units="m")
    study = uqmbd.Study("rest", mechanism, times=np.linspace(0, 5, 51), propagators=[])
    with pytest.raises(uqmbd.StudyError, match="alignment='phase' needs a clock, but there is none: .*'x'"):
        study.propagate(Collocation(order=2, alignment="phase"))


def test_unknown_clock_is_refused_before_anything_is_computed():
    study = disc(3, 31)
    obstacle = Collocation(order=2, alignment="phase", clock="disk").obstacle(study)
    assert obstacle is not None and "clock is 'disk'" in obstacle
    with pytest.raises(uqmbd.StudyError, match="clock is 'disk'; expected the name of an output.*'height', 'disc'"):
        disc(3, 31).propagate(Collocation(order=2, alignment="phase", clock="disk"))


@pytest.mark.parametrize("options", [{"order": 4}, {"order": 1}, {"order": 0, "adaptive": "order"}])
def test_statistics_are_known_for_skewed_inputs(options):
    """Samples of the statistics lie farther out than nodes: landmarks are there for all of them."""
    torque = uqmbd.RandomVariable("torque", chaospy.LogNormal(0, 0.2), units="N m")
    mechanism = uqmbd.Mechanism("disc", uqmbd.Planar())
    body = mechanism.body("disc", mass=1, inertia=INERTIA, position=(0, 0), angle=0.3)
    mechanism.add(Revolute("axle", mechanism.ground, body, point_i=(0, 0), point_j=(0, 0)))
    mechanism.add(Torque("drive", body, torque=torque))
    mechanism.output("height", body.point((0.2, 0))[1], units="m")
    study = uqmbd.Study("disc", mechanism, times=np.linspace(0, 6, 61), propagators=[])
    # a straight line through phases of such a torque is wrong, and says so
    said = pytest.warns(uqmbd.SurrogateWarning, match="'height' (at|from)")
    with said if options == {"order": 1} else nullcontext():
        statistics = study.propagate(Collocation(alignment="phase", **options))["statistics"].to_dataset()
    for name in ("mean", "std", "quantile", "sobol_total", "verification_error"):
        assert np.isfinite(statistics[name]).all(), name


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:collocation")
@pytest.mark.parametrize("alignment", ["phase", ("plain", "phase")])
def test_a_surrogate_that_misses_everything_says_so(alignment):
    """At order 0 the surrogate is constant and the oscillator is not: stated errors are 1, as those of its chaos."""
    node = oscillator(5, 51).propagate(Collocation(order=0, alignment=alignment))
    stated = node["statistics"]["verification_error"].values
    np.testing.assert_array_equal(stated, surrogate(node).verification_error())
    assert (stated[:, 5:] > 0.9).all()
