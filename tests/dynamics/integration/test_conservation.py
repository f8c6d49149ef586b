"""What must not change: energy, momentum, quaternion norms, the choice between q and -q."""

from __future__ import annotations

import numpy as np
import pytest

import uqmbd
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Fixed, Prismatic, Revolute, Spherical
from uqmbd_springs import SpringDamper, TorsionSpringDamper

G = 9.81
INERTIA = (0.30, 0.25, 0.20, 0.03, -0.02, 0.04)  # full, positive definite


def spatial_double_pendulum(sign=1):
    """Two bodies with full inertia and offset centres of mass on skew hinges; `sign` chooses q or -q."""
    mechanism = uqmbd.Mechanism("double", uqmbd.Spatial(gravity=(0, 0, -G)))
    q = np.array([0.8, 0.3, -0.4, 0.2])
    q = sign * q / np.linalg.norm(q)
    upper = mechanism.body("upper", mass=1.5, inertia=INERTIA, com=(0.4, 0.1, -0.2), quaternion=q)
    lower = mechanism.body("lower", mass=0.8, inertia=INERTIA, com=(0.1, -0.3, 0.2), quaternion=q)
    mechanism.add(Revolute("A", mechanism.ground, upper, (0, 0, 0), (0, 0, 0), (0, 1, 0.2), (0, 1, 0)))
    mechanism.add(Revolute("B", upper, lower, (0.8, 0, 0), (-0.1, 0, 0), (1, 0, 1), (1, 0, 1)))
    return mechanism, lower


def planar_slider_crank():
    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar(gravity=(0, -G)))
    crank = mechanism.body("crank", mass=0.36, inertia=6.75e-4, position=(0.075, 0), angular_velocity=30)
    rod = mechanism.body("rod", mass=0.15, inertia=1.5e-3, com=(0.02, 0.01), position=(0.325, 0))
    slider = mechanism.body("slider", mass=0.1, inertia=1e-4, position=(0.5, 0))
    mechanism.add(Revolute("A", mechanism.ground, crank, (0, 0), (-0.075, 0)))
    mechanism.add(Revolute("B", crank, rod, (0.075, 0), (-0.175, 0)))
    mechanism.add(Revolute("C", rod, slider, (0.175, 0), (0, 0)))
    mechanism.add(Prismatic("D", mechanism.ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    return mechanism, slider


def spring_and_torsion_spring():
    """A sliding block with a spring of non-zero length to a lever with a torsion spring."""
    mechanism = uqmbd.Mechanism("springs", uqmbd.Planar(gravity=(0, -G)))
    block = mechanism.body("block", mass=1, inertia=0.1, position=(0.5, 0))
    lever = mechanism.body("lever", mass=0.7, inertia=0.05, position=(0.5, 0.9), angle=0.4)
    mechanism.add(Prismatic("rail", mechanism.ground, block, (0, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.add(Revolute("pivot", mechanism.ground, lever, (0, 1), (-0.5, 0)))
    mechanism.add(SpringDamper("spring", block, lever, (0.1, 0), (0.5, 0), stiffness=60, free_length=0.4))
    mechanism.add(TorsionSpringDamper("coil", mechanism.ground, lever, stiffness=4, free_angle=0.2))
    return mechanism, block


def spatial_coil():
    """A body between ground and a torsion spring on a tilted axis, with a spring across."""
    mechanism = uqmbd.Mechanism("coil", uqmbd.Spatial(gravity=(0, 0, -G)))
    axis = (1, 2, 2)
    body = mechanism.body("body", mass=1, inertia=INERTIA, com=(0.2, 0, 0.1))
    mechanism.add(Revolute("hinge", mechanism.ground, body, (0, 0, 0), (0, 0, 0), axis, axis))
    mechanism.add(TorsionSpringDamper("coil", mechanism.ground, body, 3, axis_i=axis, axis_j=axis, free_angle=1))
    mechanism.add(SpringDamper("spring", mechanism.ground, body, (1, 1, 0), (0.5, 0, 0), 20, free_length=0.3))
    return mechanism, body


def tumbling_body():
    """No gravity, no joint, full inertia, offset centre of mass."""
    mechanism = uqmbd.Mechanism("tumbling", uqmbd.Spatial())
    body = mechanism.body(
        "body", mass=1.7, inertia=INERTIA, com=(0.3, -0.2, 0.1), position=(1, 2, 3), velocity=(0.5, -1, 0.2),
        angular_velocity=(0.5, 4, -1),
    )  # fmt: skip
    return mechanism, body


MODELS = [spatial_double_pendulum, planar_slider_crank, spring_and_torsion_spring, spatial_coil, tumbling_body]


@pytest.mark.thorough
@pytest.mark.parametrize("model", MODELS, ids=lambda f: f.__name__)
def test_energy_is_kept(model, energy):
    kinetic, potential = energy(model()[0], np.linspace(0, 4, 81), rtol=1e-8)
    total = kinetic + potential
    scale = max(kinetic.max(), np.ptp(potential))
    assert scale > 0.1
    assert np.abs(total - total[0]).max() < 2e-5 * scale


def test_energy_drift_falls_with_the_tolerance(energy):
    drift = []
    for rtol in (1e-5, 1e-7, 1e-9):
        total = np.sum(energy(spatial_double_pendulum()[0], np.linspace(0, 2, 21), rtol), axis=0)
        drift.append(np.abs(total - total[0]).max())
    assert drift[2] < drift[1] < drift[0]
    assert drift[2] < 1e-3 * drift[0]


def test_momentum_of_a_free_body_is_kept(observe, series, close):
    mechanism, body = tumbling_body()
    com = (0.3, -0.2, 0.1)
    observe(mechanism, R=body.rotation, w=body.angular_velocity, r=body.point(com), v=body.point_velocity(com))
    data = uqmbd.simulate(mechanism, np.linspace(0, 10, 51), rtol=1e-9)
    xx, yy, zz, xy, xz, yz = INERTIA
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    rotation = series(data, "R").reshape(-1, 3, 3)
    w, r, v = (series(data, n) for n in "wrv")
    spin = np.einsum("tij,jk,tlk,tl->ti", rotation, tensor, rotation, w)
    close(v, np.tile(v[0], (51, 1)), relative=1e-5)
    close(spin, np.tile(spin[0], (51, 1)), relative=1e-5)
    total = spin + 1.7 * np.cross(r, v)
    close(total, np.tile(total[0], (51, 1)), relative=1e-5)


@pytest.mark.parametrize("rtol", [1e-5, 1e-7])
@pytest.mark.parametrize(
    "model", [spatial_double_pendulum, tumbling_body, planar_slider_crank], ids=lambda f: f.__name__
)
def test_quaternion_norms_after_ten_seconds(model, rtol, states_of):
    """Off by less than 10 rtol."""
    mechanism, body = model()
    mechanism.output("x", body.position[0])
    ensemble, states = states_of(mechanism, [0, 5, 10], rtol)
    quaternions = states[0][:, ensemble.model.quaternions()]  # (time, body, component): q comes first
    norms = np.linalg.norm(quaternions, axis=2)
    assert np.abs(norms - 1).max() < 10 * rtol


def test_position_constraints_stay_closed(observe, series):
    """The two hinge points of the double pendulum coincide after ten seconds."""
    mechanism, lower = spatial_double_pendulum()
    upper = mechanism.bodies["upper"]
    gap = upper.point((0.8, 0, 0)) - lower.point((-0.1, 0, 0))
    rate = upper.point_velocity((0.8, 0, 0)) - lower.point_velocity((-0.1, 0, 0))
    observe(mechanism, gap=gap, rate=rate)
    data = uqmbd.simulate(mechanism, np.linspace(0, 10, 11), rtol=1e-7)
    assert np.abs(series(data, "gap")).max() < 1e-6
    assert np.abs(series(data, "rate")).max() < 1e-5


# -- q and -q -----------------------------------------------------------------------------------------------------------
def every_joint(signs):
    """A chain with every joint, driver and spring; each body is drawn with q or -q."""
    mechanism = uqmbd.Mechanism("chain", uqmbd.Spatial(gravity=(0, 0, -G)))
    q = np.array([[0.8, 0.3, -0.4, 0.2], [0.1, 0.9, 0.3, -0.2], [0.5, -0.5, 0.5, 0.6], [0.2, 0.2, -0.9, 0.1]])
    q = q / np.linalg.norm(q, axis=1, keepdims=True) * np.array(signs)[:, None]
    bodies = [
        mechanism.body(f"b{k}", mass=1, inertia=INERTIA, com=(0.2, 0.1, 0), quaternion=q[k], position=(k, 0, 0))
        for k in range(4)
    ]
    ground, (a, b, c, d) = mechanism.ground, bodies
    axes = {"axis_i": (0, 1, 1), "axis_j": (0, 1, 1)}
    parts = [
        Revolute("A", ground, a, (0, 0, 0), (-0.2, 0, 0), **axes),
        RotationDriver("D", ground, a, 0.5 + 2 * uqmbd.t, **axes),
        Fixed("F", a, b, (0.5, 0, 0), (0, 0.2, 0)),
        Prismatic("P", b, c, (0, 0, 0), (0, 0, 0), (1, 0, 0), (0, 1, 0)),
        SpringDamper("S", b, c, (0, 0, 0), (0, 0, 0.1), 300, 2, 0.5),
        Spherical("B", c, d, (0.3, 0, 0), (-0.4, 0, 0)),
        TorsionSpringDamper("T", c, d, 0, 0.3, 0, (0, 0, 1), (0, 0, 1)),
    ]
    for part in parts:
        mechanism.add(part)
    for k, body in enumerate(bodies):
        for i in range(3):
            mechanism.output(f"r{k}{i}", body.position[i])
            mechanism.output(f"w{k}{i}", body.angular_velocity[i])
            mechanism.output(f"R{k}{i}", body.rotation[i, 1])
    for part in parts:
        for i in range(3):
            mechanism.output(f"{part.name}_force{i}", part.reaction_force[i])
            mechanism.output(f"{part.name}_moment{i}", part.reaction_moment[i])
    return mechanism


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:mechanism 'chain'. assembly moved:uqmbd.StudyWarning")
@pytest.mark.parametrize(
    "signs",
    [[1, -1, 1, -1], *(pytest.param(x, marks=pytest.mark.thorough) for x in ([-1, -1, -1, -1], [-1, 1, 1, -1]))],
    ids=str,
)
def test_both_signs_of_a_quaternion_give_the_same_outputs(signs):
    times = np.linspace(0, 1, 11)
    plain = uqmbd.simulate(every_joint([1, 1, 1, 1]), times, rtol=1e-8)
    other = uqmbd.simulate(every_joint(signs), times, rtol=1e-8)
    for name in plain.data_vars:
        scale = max(1.0, float(np.abs(plain[name]).max()))
        np.testing.assert_allclose(other[name], plain[name], rtol=0, atol=1e-6 * scale, err_msg=name)


def test_torsion_spring_feels_the_same_moment_for_both_signs():
    moments = []
    for sign in (1, -1):
        mechanism = uqmbd.Mechanism("coil", uqmbd.Spatial())
        q = sign * np.array([np.cos(0.4), 0, 0, np.sin(0.4)])
        body = mechanism.body("b", mass=1, inertia=(1, 1, 1), quaternion=q)
        axes = {"axis_i": (0, 0, 1), "axis_j": (0, 0, 1)}
        mechanism.add(Revolute("hinge", mechanism.ground, body, (0, 0, 0), (0, 0, 0), **axes))
        coil = mechanism.add(TorsionSpringDamper("coil", mechanism.ground, body, 2, free_angle=0.1, **axes))
        mechanism.output("moment", coil.reaction_moment[2])
        moments.append(uqmbd.simulate(mechanism, np.linspace(0, 3, 13), rtol=1e-8).moment)
    np.testing.assert_allclose(moments[0], -1.4 * np.cos(np.sqrt(2) * np.linspace(0, 3, 13)), atol=1e-4)
    np.testing.assert_allclose(moments[1], moments[0], atol=1e-6)
