"""Springs of any law, and bushings, against closed forms."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy
from scipy.special import ellipj

import uqmbd
from uqmbd_springs import Bushing, NonlinearSpringDamper, NonlinearTorsionSpringDamper, length, rate

TIMES = np.linspace(0, 3, 31)


def cubic(amplitude, stiffness, times):
    """``x'' = -k x^3`` from rest: ``x = A cn(A sqrt(k) t | 1/2)``."""
    return amplitude * ellipj(amplitude * np.sqrt(stiffness) * times, 0.5)[1]


def test_cubic_spring_with_a_random_coefficient(close):
    k = uqmbd.RandomVariable("k", chaospy.Uniform(3, 5), units="N/m^3")
    mechanism = uqmbd.Mechanism("duffing", uqmbd.Translational())
    mass = mechanism.body("mass", mass=1, position=(0.5, 0))
    mechanism.add(NonlinearSpringDamper("spring", mechanism.ground, mass, (-2, 0), (0, 0), law=k * (length - 2) ** 3))
    mechanism.output("x", mass.position[0], units="m")
    for value in (3.2, 4.7):
        data = uqmbd.simulate(mechanism, TIMES, values={"k": value}, rtol=1e-9)
        close(data["x"], cubic(0.5, value, TIMES), relative=1e-6)


@pytest.mark.parametrize("space", [uqmbd.Planar, uqmbd.Spatial])
def test_cubic_torsion_spring(space, close):
    flat = space is uqmbd.Planar
    mechanism = uqmbd.Mechanism("coil", space())
    inertia = 2 if flat else (1, 1, 2)
    pose = {"angle": 0.5} if flat else {"quaternion": (np.cos(0.25), 0, 0, np.sin(0.25))}
    body = mechanism.body("body", mass=1, inertia=inertia, **pose)
    axes = {} if flat else {"axis_i": (0, 0, 1), "axis_j": (0, 0, 1)}
    mechanism.add(NonlinearTorsionSpringDamper("coil", mechanism.ground, body, law=8 * length**3, **axes))
    sine = body.rotation[1, 0]
    mechanism.output("sine", sine, units="1")
    data = uqmbd.simulate(mechanism, TIMES, rtol=1e-9)
    close(data["sine"], np.sin(cubic(0.5, 4, TIMES)), relative=1e-6)


def test_quadratic_damper(close):
    """``m v' = -c v |v|``: x = m/c ln(1 + c v0 t / m)."""
    mechanism = uqmbd.Mechanism("dashpot", uqmbd.Translational())
    mass = mechanism.body("mass", mass=2, position=(1, 0), velocity=(3, 0))
    law = 0.8 * rate * sympy.Abs(rate)
    mechanism.add(NonlinearSpringDamper("damper", mechanism.ground, mass, (0, 0), (0, 0), law=law))
    mechanism.output("x", mass.position[0], units="m")
    data = uqmbd.simulate(mechanism, TIMES, rtol=1e-9)
    close(data["x"], 1 + 2 / 0.8 * np.log(1 + 0.8 * 3 * TIMES / 2), relative=1e-7)


def damped(start, mass, stiffness, damping, times):
    """Free vibration from rest."""
    d = damping / (2 * mass)
    w = np.sqrt(stiffness / mass - d**2)
    return start * np.exp(-d * times) * (np.cos(w * times) + d / w * np.sin(w * times))


@pytest.mark.thorough
def test_bushing_in_the_plane_is_three_oscillators(close):
    """Along both axes of a tilted frame i, and about it; small angles, of which twice the sine of the half is one."""
    tilt = 0.4
    mechanism = uqmbd.Mechanism("mount", uqmbd.Planar())
    frame = mechanism.body("frame", mass=1, inertia=1, angle=tilt, hold=True)
    c, s = np.cos(tilt), np.sin(tilt)
    body = mechanism.body("body", mass=2, inertia=0.5, position=(0.1 * c - 0.2 * s, 0.1 * s + 0.2 * c), angle=tilt)
    from uqmbd_joints import Fixed

    mechanism.add(Fixed("base", mechanism.ground, frame, (0, 0), (0, 0)))
    ends = ((0, 0), (0, 0))
    mechanism.add(Bushing("mount", frame, body, *ends, stiffness=(50, 80, 3), damping=(2, 1, 0.1)))
    x, y = body.position
    mechanism.output("along", c * x + s * y, units="m")
    mechanism.output("across", -s * x + c * y, units="m")
    data = uqmbd.simulate(mechanism, TIMES, rtol=1e-9)
    close(data["along"], damped(0.1, 2, 50, 2, TIMES), relative=1e-6)
    close(data["across"], damped(0.2, 2, 80, 1, TIMES), relative=1e-6)


def test_bushing_in_space_turns_back_like_a_pendulum(close):
    """A turn about one axis: energy k (2 sin(a/2) cos(a/2))^2 / 2 = k sin(a)^2 / 2, hence a pendulum in 2 a."""
    mechanism = uqmbd.Mechanism("mount", uqmbd.Spatial())
    speed = 1.2
    body = mechanism.body("body", mass=1, inertia=(0.4, 0.7, 0.9), angular_velocity=(0, 0, speed))
    mechanism.add(Bushing("mount", mechanism.ground, body, (0, 0, 0), (0, 0, 0), stiffness=(9, 9, 9, 5, 5, 5)))
    mechanism.output("sine", body.rotation[1, 0], units="1")
    data = uqmbd.simulate(mechanism, TIMES, rtol=1e-9)
    # J a'' = -k sin(a) cos(a): with b = 2 a a pendulum of w0^2 = k / J, b'(0) = 2 speed; swings with modulus speed / w0
    w0 = np.sqrt(5 / 0.9)
    sn = ellipj(w0 * TIMES, (speed / w0) ** 2)[0]
    half = np.arcsin(speed / w0 * sn)  # b / 2 = a
    close(data["sine"], np.sin(half), relative=1e-6)


def test_a_bushing_turns_in_the_axes_of_body_i_however_body_j_is_drawn(close):
    """Body j drawn turned by a quarter about z: a spin about x of body i still feels the stiffness about x."""
    mechanism = uqmbd.Mechanism("mount", uqmbd.Spatial())
    half = np.sqrt(0.5)
    # about the world's x: in the axes of body j, drawn turned by a quarter about z, that is -y
    body = mechanism.body(
        "body", mass=1, inertia=(0.9, 0.9, 0.9), quaternion=(half, 0, 0, half), angular_velocity=(0, -1.2, 0)
    )
    mechanism.add(Bushing("mount", mechanism.ground, body, (0, 0, 0), (0, 0, 0), stiffness=(9, 9, 9, 5, 70, 70)))
    # the second axis of body j starts along -x ... the first along y, which turns towards z
    mechanism.output("sine", body.rotation[2, 0], units="1")
    data = uqmbd.simulate(mechanism, TIMES, rtol=1e-9)
    w0 = np.sqrt(5 / 0.9)
    close(data["sine"], np.sin(np.arcsin(1.2 / w0 * ellipj(w0 * TIMES, (1.2 / w0) ** 2)[0])), relative=1e-6)


@pytest.mark.thorough
def test_bushing_with_a_full_matrix_conserves_energy(energy):
    rng = np.random.default_rng(3)
    root = rng.normal(size=(6, 6))
    mechanism = uqmbd.Mechanism("mount", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    body = mechanism.body("body", mass=1, inertia=(0.4, 0.7, 0.9), com=(0.1, 0, 0), angular_velocity=(1, 2, 0.5))
    matrix = root @ root.T + 20 * np.eye(6)
    matrix = (matrix + matrix.T) / 2
    mechanism.add(Bushing("mount", mechanism.ground, body, (0, 0, 0), (0.1, 0.2, 0.3), stiffness=matrix))
    total = energy(mechanism, TIMES, rtol=1e-9).sum(axis=0)
    assert np.ptp(total) < 1e-5 * np.ptp(energy(mechanism, TIMES, rtol=1e-9)[0])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"stiffness": (1, 2)}, "stiffness has 2 entries; expected one number, 6"),
        ({"stiffness": np.eye(6) + np.eye(6, k=1)}, "is not a symmetric matrix"),
    ],
)
def test_a_bushing_says_what_it_expects(given, message):
    mechanism = uqmbd.Mechanism("mount", uqmbd.Spatial())
    body = mechanism.body("body", mass=1, inertia=(1, 1, 1))
    with pytest.raises(uqmbd.StudyError, match=message):
        mechanism.add(Bushing("mount", mechanism.ground, body, (0, 0, 0), (0, 0, 0), **given))


def test_a_table_that_was_not_called_is_one_over_time_and_says_so(recwarn):
    mechanism = uqmbd.Mechanism("spring", uqmbd.Translational())
    mass = mechanism.body("mass", 2.0)
    table = uqmbd.spline([1, 2, 3], [-5, 0, 5])
    mechanism.add(NonlinearSpringDamper("called", mechanism.ground, mass, (-2, 0), (0, 0), law=table(length)))
    mechanism.add(NonlinearSpringDamper("both", mechanism.ground, mass, (-2, 0), (0, 0), law=table * length))
    assert not [w for w in recwarn if issubclass(w.category, uqmbd.StudyWarning)]
    with pytest.warns(uqmbd.StudyWarning, match=r"call it: uqmbd\.spline\(\.\.\.\)\(uqmbd_springs\.length\)"):
        mechanism.add(NonlinearSpringDamper("uncalled", mechanism.ground, mass, (-2, 0), (0, 0), law=table))
