"""Studies that start from static equilibrium: in every propagator, in chunks, and in what is remembered of them."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.propagation.execution.chunks import compute_chunk
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Prismatic
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce, SpringDamper

G = 9.81
TIMES = np.linspace(0, 0.6, 13)


def scale(velocity=None, push=False):
    """A pan on a spring of random stiffness in a guide: it hangs at -m g / k."""
    mechanism = uqmbd.Mechanism("scale", uqmbd.Planar(gravity=(0, -G)))
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(80, 120), units="N/m")
    pan = mechanism.body("pan", mass=2, inertia=0.1, position=(0, 0.3), velocity=velocity)
    mechanism.add(Prismatic("guide", mechanism.ground, pan, (0, 0), (0, 0), (0, 1), (0, 1)))
    mechanism.add(SpringDamper("spring", mechanism.ground, pan, (0, 1), (0, 0), stiffness, free_length=1))
    if push:
        mechanism.add(PointForce("push", pan, (0, 0), (0, uqmbd.step(uqmbd.t, 0.12, 0, 0.23, 5.0))))
    mechanism.output("y", pan.position[1], units="m")
    mechanism.output("speed", pan.velocity[1], units="m/s")
    return mechanism


def hanging(k):
    return -2 * G / k


@pytest.mark.parametrize("integrator", ["auto", "ida"])
def test_nothing_moves_that_starts_in_equilibrium(integrator):
    """Every sample stays at -m g / k of its own."""
    study = uqmbd.Study(
        "scale", scale(), TIMES, [MonteCarlo(samples=70, seed=1)], integrator=integrator, start="equilibrium"
    )
    tree = study.run()
    samples = tree["monte-carlo/samples"]
    k = samples["inputs"].values[:, 0]
    y = samples["response"].sel(output="y").values
    np.testing.assert_allclose(y, np.tile(hanging(k)[:, None], len(TIMES)), atol=1e-7)
    assert tree.attrs["start"] == "equilibrium" and tree["monte-carlo"].attrs["start"] == "equilibrium"


def test_a_stated_velocity_is_held_in_equilibrium():
    """y = -m g / k + v / omega sin(omega t)."""
    data = uqmbd.simulate(scale(velocity=(0, 0.4)), TIMES, {"stiffness": 100.0}, rtol=1e-9, start="equilibrium")
    omega = np.sqrt(100 / 2)
    np.testing.assert_allclose(data["y"], hanging(100) + 0.4 / omega * np.sin(omega * TIMES), atol=1e-7)
    np.testing.assert_allclose(data["speed"], 0.4 * np.cos(omega * TIMES), atol=1e-6)
    assert data.attrs["start"] == "equilibrium"


def test_the_drawn_pose_is_the_default():
    """It then starts where it is drawn."""
    mechanism = scale()
    assert uqmbd.Study("scale", mechanism, TIMES).start == "drawn"
    drawn = uqmbd.simulate(mechanism, TIMES)
    assert float(drawn["y"][0]) == pytest.approx(0.3) and drawn.attrs["start"] == "drawn"
    # one mechanism serves both
    assert float(uqmbd.simulate(mechanism, TIMES, start="equilibrium")["y"][0]) == pytest.approx(hanging(100))
    assert float(uqmbd.simulate(mechanism, TIMES)["y"][0]) == pytest.approx(0.3)


@pytest.mark.thorough
def test_all_propagators_start_alike():
    """Pushed out of equilibrium: collocation and Galerkin agree, and both with integrals over the stiffness."""
    propagators = [Collocation(order=4), Galerkin(order=4)]
    tree = uqmbd.Study("scale", scale(push=True), TIMES, propagators, rtol=1e-9, start="equilibrium").run()
    nodes, weights = np.polynomial.legendre.leggauss(12)
    k, weights = 100 + 20 * nodes, weights / 2
    mean = weights @ hanging(k)
    std = np.sqrt(weights @ (hanging(k) - mean) ** 2)
    for label in ("collocation", "galerkin"):
        statistics = tree[f"{label}/statistics"].to_dataset().sel(output="y")
        assert float(statistics["mean"][0]) == pytest.approx(mean, abs=1e-7)
        assert float(statistics["std"][0]) == pytest.approx(std, rel=1e-4)
        assert tree[label].attrs["start"] == "equilibrium"
    one, other = (tree[f"{label}/statistics"].to_dataset() for label in ("collocation", "galerkin"))
    for name in ("mean", "std"):
        np.testing.assert_allclose(one[name], other[name], atol=2e-5)
    assert float(one["mean"].sel(output="y")[-1]) > mean + 0.02


def test_where_a_chunk_starts_is_part_of_its_key():
    """A run that is resumed must not take chunks of the other start; and chunks start where they should."""
    mechanism = scale()
    propagator = MonteCarlo(samples=10, seed=1)
    problems = [uqmbd.Study("s", mechanism, TIMES, start=x).problem(propagator) for x in ("drawn", "equilibrium")]
    values = np.array([[90.0], [110.0]])
    keys = {problem.runner.chunk_store(problem).key(values) for problem in problems}
    assert len(keys) == 2
    chunk = compute_chunk(problems[1].packed, values, TIMES, 1e-6)
    np.testing.assert_allclose(chunk.response[:, 0, 0], hanging(values[:, 0]), atol=1e-9)
    np.testing.assert_allclose(problems[1].ensemble(values).start.q[:, 1], hanging(values[:, 0]), atol=1e-9)
    np.testing.assert_allclose(problems[0].ensemble(values).start.q[:, 1], 0.3, atol=1e-12)


def test_samples_without_equilibrium_have_failed():
    """A spring too weak to be one lets its mass fall; the others are fine."""
    mechanism = uqmbd.Mechanism("weak", uqmbd.Translational(gravity=(0, -G)))
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(-100, 900), units="N/m")
    mass = mechanism.body("stone", mass=1)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), stiffness))
    mechanism.output("y", mass.position[1], units="m")
    found = (
        uqmbd.Study("weak", mechanism, TIMES, start="equilibrium")
        .problem(MonteCarlo(samples=3))
        .realise(np.array([[-50.0], [200.0], [400.0]]))
    )
    assert found.status.tolist() == [1, 0, 0]
    assert "no static equilibrium" in found.messages[0] and "body 'stone'" in found.messages[0]
    np.testing.assert_allclose(found.response[1:, 0, -1], [-G / 200, -G / 400], atol=1e-7)


def test_mistakes():
    """Words that mean no start are told."""
    with pytest.raises(uqmbd.StudyError, match="start is 'rest'; expected 'drawn'"):
        uqmbd.Study("scale", scale(), TIMES, start="rest")
    with pytest.raises(uqmbd.StudyError, match="start is 3; expected 'drawn'"):
        uqmbd.simulate(scale(), TIMES, start=3)


SCRIPT = """
import chaospy
import numpy as np
import uqmbd
from uqmbd_joints import Revolute
from uqmbd_springs import TorsionSpringDamper

length = uqmbd.RandomVariable("length", chaospy.Normal(1.0, 0.02), units="m")
mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0.0, {gravity})))
rod = mechanism.body("rod", mass=1, inertia=1 / 12, position=(length / 2, 0))
mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length / 2, 0)))
mechanism.add(TorsionSpringDamper("damper", mechanism.ground, rod, stiffness=0, damping={damping}))
mechanism.output("angle", rod.angle, units="rad")
study = uqmbd.Study("pendulum", mechanism, np.linspace(0, 1, 51), start="{start}")
"""


@pytest.mark.thorough
def test_check_shows_natural_frequencies(tmp_path, capsys):
    """sqrt(m g l / J) with its damping; nothing where nothing vibrates."""
    from uqmbd.cli.check import show_check

    path = tmp_path / "equilibrium_check_study.py"

    def said(**values):
        path.write_text(SCRIPT.format(**values))
        show_check(path)
        return capsys.readouterr().out

    about = 1 / 12 + 1 / 4
    omega = np.sqrt(G / 2 / about)
    said_now = said(gravity=-G, damping=0.1, start="drawn")
    damping = 0.1 / (2 * about * omega)
    assert f"frequencies {omega / 2 / np.pi:.4g} ({100 * damping:.2g} % damped) Hz, at the means" in said_now
    assert "in static equilibrium" in said_now and "start       in the given pose" in said_now
    assert "the static equilibrium for its inputs" in said(gravity=-G, damping=0, start="equilibrium")
    assert "frequencies" not in said(gravity=0.0, damping=0, start="drawn")
