"""Statics with dry friction and rigid contacts: ranges of rest by motions that stay or leave, and refusals."""

from __future__ import annotations

import warnings

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_contact import PlaneImpact
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import RandomProcess, stationary_std, white_noise
from uqmbd_springs import PointForce, RotationalFriction, SlidingFriction, SpringDamper, TorsionSpringDamper

G = 9.81
STIFFNESS, MASS, LIMIT = 200.0, 2.0, 3.0


def oscillator(away: float = 0.0, force=0.0, **friction) -> tuple[uqmbd.Mechanism, uqmbd.Body]:
    """A mass on a spring with friction, which hangs at -1 m without friction."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line(gravity=-G))
    mass = mechanism.body("mass", mass=MASS, position=away - 1.0, velocity=0)
    free = 1.0 - MASS * G / STIFFNESS
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, STIFFNESS, damping=2, free_length=free))
    mechanism.add(SlidingFriction("rub", mechanism.ground, mass, at=0, axis=1, **{"friction": LIMIT} | friction))
    mechanism.add(PointForce("push", mass, 0, force))
    return mechanism, mass


def stated(caught: list[warnings.WarningMessage]) -> float:
    """Return the only stated half width of a range."""
    (text,) = [str(x.message) for x in caught if "not unique" in str(x.message)]
    assert "'rub'" in text
    return float(text.partition("about ±")[2].split(" ")[0].rstrip("."))


def test_a_mass_rests_within_the_stated_range_and_leaves_beyond() -> None:
    mechanism, mass = oscillator()
    mechanism.output("x", mass.position[0], units="m")
    with pytest.warns(
        uqmbd.StudyWarning, match="x is -1 m, but may differ from this value by about ±0.015 m"
    ) as caught:
        assert float(uqmbd.static_equilibrium(mechanism)["x"]) == pytest.approx(-1)
    width = stated(list(caught))
    assert width == pytest.approx(LIMIT / STIFFNESS)
    for share, stays in ((0.99, True), (-0.99, True), (1.01, False), (-1.01, False)):
        moving, mass = oscillator(share * width)
        moving.output("x", mass.position[0], units="m")
        x = uqmbd.simulate(moving, [0, 2], check=False)["x"].values
        assert (abs(x[1] - x[0]) < 1e-9) == stays


def test_ranges_of_an_arm_are_those_of_its_moment_balance() -> None:
    """Two angles in series: each joint holds its moment, to first order as the weights act at small angles."""
    mechanism = uqmbd.Mechanism("arm", uqmbd.Planar(gravity=(0, -G)))
    arm = mechanism.body("arm", mass=1.5, inertia=0.1, position=(0, -0.4), angle=0)
    pin = mechanism.add(Revolute("pin", mechanism.ground, arm, (0, 0), (0, 0.4)))
    mechanism.add(RotationalFriction("rub", mechanism.ground, arm, friction=0.02))
    mechanism.output("angle", uqmbd.at_equilibrium(pin.angle), units="rad")
    with pytest.warns(uqmbd.StudyWarning, match="not unique") as caught:
        uqmbd.simulate(mechanism, [0, 1])
    assert stated(list(caught)) == pytest.approx(0.02 / (1.5 * G * 0.4), rel=1e-2)


def test_friction_without_stiffness_holds_any_pose() -> None:
    mechanism = uqmbd.Mechanism("slide", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=0.2)
    mechanism.add(SlidingFriction("rub", mechanism.ground, mass, at=0, axis=1, friction=1))
    mechanism.output("x", uqmbd.at_equilibrium(mass.position[0]), units="m")
    with pytest.warns(uqmbd.StudyWarning, match=r"is 0.2, but may differ from this value by any amount"):
        uqmbd.simulate(mechanism, [0, 1])


def test_a_block_on_an_incline_is_told_that_the_search_omits_its_friction() -> None:
    mechanism = uqmbd.Mechanism("incline", uqmbd.Line(gravity=-5))
    block = mechanism.body("block", mass=1)
    mechanism.add(SlidingFriction("rub", mechanism.ground, block, at=0, axis=1, friction=6))
    mechanism.output("x", block.position[0], units="m")
    with pytest.raises(uqmbd.AssemblyError, match="omits dry friction, which may hold the given pose"):
        uqmbd.static_equilibrium(mechanism)


def test_a_start_in_equilibrium_states_its_pose() -> None:
    mechanism, mass = oscillator(0.2)
    mechanism.output("x", mass.position[0], units="m")
    study = uqmbd.Study("rest", mechanism, [0, 1], start="equilibrium")
    (finding,) = [x for x in uqmbd.findings(study) if "not unique" in x.message]
    assert finding.place == "dry friction of 'rub'" and "starts in the pose without this friction" in finding.message
    study = uqmbd.Study("drawn", mechanism, [0, 1])
    assert not [x for x in uqmbd.findings(study) if "not unique" in x.message]


OUTPUTS = {
    "frequency": lambda mass: uqmbd.eigenfrequency(1),
    "at the start": lambda mass: uqmbd.eigenfrequency(1, at="start"),
    "damping": lambda mass: uqmbd.damping_ratio(1),
    "shape": lambda mass: uqmbd.mode_shape(1, mass.position[0], over=2 * mass.position[0]),
    "response": lambda mass: stationary_std(mass.position[0]),
}


@pytest.mark.parametrize("kind", OUTPUTS)
def test_linear_outputs_of_a_joint_that_sticks_are_refused(kind: str) -> None:
    wind = RandomProcess("wind", psd=white_noise(1, "one", "Hz"), over="time", units="N")
    mechanism, mass = oscillator(force=wind(uqmbd.t))
    mechanism.output("value", OUTPUTS[kind](mass))
    with pytest.raises(uqmbd.UqmbdError, match="not linear, because the dry friction of 'rub' sticks at rest"):
        uqmbd.simulate(mechanism, [0, 1])
    smooth, mass = oscillator(force=wind(uqmbd.t), transition=1.0)
    smooth.output("value", OUTPUTS[kind](mass))
    assert np.isfinite(float(uqmbd.simulate(smooth, [0, 1])["value"]))


def test_smooth_friction_at_rest_is_a_damper() -> None:
    """Damping ratio (c + f / transition) / (2 sqrt(k m))."""
    found = uqmbd.eigenfrequencies(oscillator(transition=1.0)[0])["damping_ratio"].values
    assert found == pytest.approx([(2 + LIMIT) / (2 * np.sqrt(STIFFNESS * MASS))], rel=1e-9)


def test_friction_on_a_driven_joint_does_not_matter() -> None:
    """A mass on a spring on a driven arm: sqrt(k / m), with dry friction of the driven pin."""
    mechanism = uqmbd.Mechanism("table", uqmbd.Planar())
    table = mechanism.body("table", mass=1, inertia=1)
    mechanism.add(Revolute("pin", mechanism.ground, table, (0, 0), (0, 0)))
    mechanism.add(RotationDriver("motor", mechanism.ground, table, angle=0.3 * uqmbd.t))
    mechanism.add(RotationalFriction("rub", mechanism.ground, table, friction=1))
    bob = mechanism.body("bob", mass=2, inertia=0.5, position=(1, 0))
    mechanism.add(Revolute("end", table, bob, (1, 0), (0, 0)))
    mechanism.add(TorsionSpringDamper("coil", mechanism.ground, bob, stiffness=8))
    found = uqmbd.eigenfrequencies(mechanism)["frequency"].values
    assert found == pytest.approx([np.sqrt(8 / 0.5) / (2 * np.pi)], rel=1e-9)


@pytest.mark.parametrize("at", ["equilibrium", "start"])
def test_rigid_contacts_are_refused_where_they_act(at: str) -> None:
    """The mass would hang at -1 m; a stop at -0.95 m holds it higher, and a stop at -1.2 m does not."""
    for place, reason in (
        (-0.95, "overlap by 0.05 m at 'stop'" if at == "equilibrium" else "'stop' is closed"),
        (-1.2, ""),
    ):
        mechanism, mass = oscillator(max(-1.0, place) + 1.0, friction=0)
        mechanism.add(PlaneImpact("stop", mechanism.ground, mass, place, 0, 1))
        if reason:
            with pytest.raises(uqmbd.AssemblyError, match=reason):
                uqmbd.eigenfrequencies(mechanism, at=at)
        else:
            found = uqmbd.eigenfrequencies(mechanism, at=at)["frequency"].values
            assert found == pytest.approx([np.sqrt(STIFFNESS / MASS) / (2 * np.pi)], rel=1e-9)


def test_a_steady_motion_against_dry_friction_is_refused() -> None:
    mechanism = uqmbd.Mechanism("turntable", uqmbd.Planar())
    table = mechanism.body("table", mass=1, inertia=1)
    ball = mechanism.body("ball", mass=1, inertia=1, position=(1, 0))
    mechanism.add(RotationDriver("motor", mechanism.ground, table, angle=2 * uqmbd.t))
    mechanism.add(Revolute("axle", mechanism.ground, table, (0, 0), (0, 0)))
    mechanism.add(Revolute("hinge", table, ball, (1, 0), (0, 0)))
    mechanism.add(SpringDamper("spring", table, ball, (2, 0), (0.1, 0), stiffness=9, free_length=0.5))
    mechanism.add(RotationalFriction("rub", table, ball, friction=0.01))
    mechanism.output("turn", uqmbd.at_steady(ball.position.norm()), units="m")
    with pytest.raises(uqmbd.UqmbdError, match="computed without dry friction, but the force of 'rub' acts"):
        uqmbd.simulate(mechanism, [0, 1])


def test_realisations_with_friction_fail_and_the_others_do_not() -> None:
    """Coulomb's force is clipped at zero: only realisations with a positive limit stick."""
    level = uqmbd.RandomVariable("level", chaospy.Uniform(-1, 1), units="N")
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = mechanism.body("mass", mass=MASS, position=1)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, STIFFNESS, free_length=1))

    class Rub(uqmbd.Component):
        bodies, spaces = ("body",), (uqmbd.Line,)
        limit = uqmbd.Parameter("N", "limit")

        def terms(self, p):
            yield uqmbd.extend.DryFriction(p.limit, p.body.velocity[0])

    mechanism.add(Rub("rub", mass, level))
    mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    study = uqmbd.Study("clipped", mechanism, [0, 1], propagators=[MonteCarlo(samples=32)])
    with pytest.warns(UserWarning, match="not linear, because the dry friction of 'rub' sticks"):
        node = study.run()["monte-carlo"]
    samples = node["scalars/samples"].dataset
    sticks, found = samples["inputs"].values.ravel() > 0, samples["response"].values.ravel()
    assert 5 < sticks.sum() < 27 and (np.isnan(found) == sticks).all()
    assert found[~sticks] == pytest.approx(np.sqrt(STIFFNESS / MASS) / (2 * np.pi), rel=1e-9)
