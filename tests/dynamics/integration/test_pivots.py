"""Regular poses in which a pivot of the fixed order of elimination vanishes: the order is chosen again."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import uqmbd
from uqmbd.dynamics import build
from uqmbd.dynamics.integration import singular_poses
from uqmbd_joints import Revolute

TIMES = np.linspace(0, 10, 101)
ARM_ANGLE, SHAFT, BALL, GRAVITY = 0.6, 0.05, 0.01, 9.81  # rad, kg m^2, kg m^2, m/s^2
CASES = [  # speed, arm, offset, mass and tolerance with which integrations stopped, at one pose
    (12.0, 0.3, 0.1, 1.0, 1e-11),
    (15.74134429486488, 0.23404123489594983, 0.10365342707393013, 0.5578120842257743, 6.6e-13),
    (7.614870135216742, 0.2722471950358917, 0.1318876363869628, 1.017011974017694, 2.2405904536639974e-12),
    (15.348430298883496, 0.39221414713548064, 0.039294970453758085, 0.6795214638612277, 5.047212247126417e-13),
]


def governor(speed, arm, offset, mass):
    """Two balls on hinged arms, on a shaft that turns freely."""
    mechanism = uqmbd.Mechanism("governor", uqmbd.Spatial(gravity=(0, 0, -GRAVITY)))
    shaft = mechanism.body("shaft", mass=1, inertia=(0.1, 0.1, SHAFT), angular_velocity=(0, 0, speed))
    mechanism.add(Revolute("bearing", mechanism.ground, shaft, at=(0, 0, 0), axis=(0, 0, 1)))
    for side, sign in (("left", -1), ("right", 1)):
        at = (sign * (offset + arm * np.sin(ARM_ANGLE)), 0, -arm * np.cos(ARM_ANGLE))
        ball = mechanism.body(side, mass=mass, inertia=(BALL, BALL, BALL), position=at)
        mechanism.add(Revolute(f"{side} hinge", shaft, ball, at=(sign * offset, 0, 0), axis=(0, 1, 0)))
    mechanism.output("speed", shaft.angular_velocity[2], units="rad/s")
    mechanism.output("height", ball.position[2], units="m")
    return mechanism


def reduced(speed, arm, offset, mass):
    """Return speeds and heights by Lagrange's equation of the angle of both arms, with the momentum conserved."""

    def inertia(angle):
        return SHAFT + 2 * (BALL + mass * (offset + arm * np.sin(angle)) ** 2)

    momentum = inertia(ARM_ANGLE) * speed

    def rate(_, state):
        angle, turning = state
        pull = (momentum / inertia(angle)) ** 2 * (offset + arm * np.sin(angle)) * np.cos(angle)
        return [turning, mass * arm * (pull - GRAVITY * np.sin(angle)) / (mass * arm**2 + BALL)]

    about = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14, "t_eval": TIMES}
    angle = solve_ivp(rate, TIMES[[0, -1]], [ARM_ANGLE, 0.0], **about).y[0]
    return momentum / inertia(angle), -arm * np.cos(angle)


@pytest.mark.thorough
@pytest.mark.parametrize("case", CASES)
def test_the_order_of_elimination_is_chosen_again(case):
    *dimensions, rtol = case
    found = uqmbd.simulate(governor(*dimensions), TIMES, rtol=rtol, integrator="dop853", check=False)
    speeds, heights = reduced(*dimensions)
    np.testing.assert_allclose(found["speed"], speeds, rtol=0, atol=1e-7 * dimensions[0])
    np.testing.assert_allclose(found["height"], heights, rtol=0, atol=1e-7 * dimensions[1])


@pytest.mark.slow
def test_random_governors_at_all_tolerances():
    """None stops, as six of 400 did; some steps next to such poses are accepted with errors above tight tolerances."""
    random, errors = np.random.default_rng(1), []
    for _ in range(200):
        dimensions = random.uniform(6, 16), random.uniform(0.2, 0.4), random.uniform(0.03, 0.15), random.uniform(0.5, 2)
        rtol = 10 ** random.uniform(-12.5, -6)
        found = uqmbd.simulate(governor(*dimensions), TIMES, rtol=rtol, integrator="dop853", check=False)
        speeds, heights = reduced(*dimensions)
        worst = np.abs(found["speed"].values - speeds).max() / dimensions[0]
        errors.append(max(worst, np.abs(found["height"].values - heights).max() / dimensions[1]) / max(rtol, 1e-9))
    assert np.max(errors) < 1500


@pytest.mark.parametrize(
    ("before", "after", "chosen"),
    [
        ([0.0, 1.0, np.nan, 0.1], [0.0, 1e-9, 1e-9, 1e-9], True),
        ([0.0, np.nan, np.nan, np.nan], [1e-9, 1e-9, 1e-9, 1e-9], True),
        ([0.0, np.nan, 1.0, 1.0], [0.0, np.nan, 0.0, 0.0], False),
        ([0.0, 1.0, 1.0, 1.0], [0.0, 0.5, 0.0, 0.0], False),
        ([0.0, 1.0, 1.0, 1.0], None, False),
        ([0.0, np.inf, 1.0, 1.0], None, False),
    ],
)
def test_a_residual_that_is_no_number_is_the_poorest(before, after, chosen, monkeypatch):
    """It is better than none; an order without compiled programs (None), or with unknown residuals, is not taken."""
    model = build(governor(12.0, 0.3, 0.1, 1.0))
    other = replace(model, system=replace(model.system, programs=None) if after is None else model.system)
    monkeypatch.setattr(singular_poses, "eliminated_anew", lambda *_: other)
    monkeypatch.setattr(singular_poses, "residuals", lambda one, *_: np.array(before if one is model else after))
    watcher = singular_poses.SingularPoseWatcher(model, np.zeros(1), 1e-6)
    assert watcher.reorder(0.0, np.zeros(model.layout.width), 0.1) is chosen
    assert watcher.model is (other if chosen else model)
    assert (watcher.reordered, watcher.no_better) == ((1, 0) if chosen else (0, 1))
