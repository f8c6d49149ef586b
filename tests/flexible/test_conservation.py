"""Free flexible bodies: momentum and energy do not change; stiff ones move as rigid bodies, spatial ones as planar."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import uqmbd
import uqmbd_flexible

TIMES = np.linspace(0, 0.2, 9)
PLANAR = {"length": 1, "area": 1e-4, "second_moment": 1e-9, "youngs_modulus": 2e9, "density": 7800, "modes": 2}
SPATIAL = {**PLANAR, "second_moment": (1e-9, 2e-9), "torsion": 2e-9}


def observed(rod):
    """Return the symbols of the coordinates of a flexible body, and those of their rates."""
    modes = rod.modes.coordinate_set
    return (*rod.body.q, *modes.q), (*rod.body.v, *modes.v)


def integrals_of_motion(mechanism, rod, motion):
    """Return linear and angular momentum and energy over time, from the energies as expressions.

    Both momenta are derivatives of the kinetic energy: by the velocity of the frame, and by the rates of its quaternion.
    """
    q, v = observed(rod)
    terms = uqmbd.extend.mechanism_terms(mechanism)
    energy = sum(terms.kinetic)
    space, d = mechanism.space, mechanism.space.dimension
    linear = [energy.diff(x) for x in v[:d]]
    about = space.moment(q[d : space.size], [energy.diff(x) for x in v[d : space.size]])
    arm, push = sympy.Matrix(q[:d]), sympy.Matrix(linear)
    about += arm.cross(push) if d == 3 else sympy.Matrix([arm[0] * push[1] - arm[1] * push[0]])
    function = sympy.lambdify((*q, *v), [*linear, *about, energy + sum(terms.potential)], cse=True)
    values = [motion[f"{k}"].to_numpy() for k in range(2 * len(q))]
    return np.array(function(*values))


def free(model, space, **pose):
    """Return a free flexible body, deformed at the start, with outputs of its whole state."""
    mechanism = uqmbd.Mechanism("free", space)
    initial = [0.004 / (k + 1) ** 2 if f < 500 else 0 for k, f in enumerate(model.frequencies)]
    rod = uqmbd_flexible.flexible_body(mechanism, "rod", model, initial=initial, rates=[0] * model.modes, **pose)
    q, v = observed(rod)
    for k, symbol in enumerate((*q, *v)):
        mechanism.output(f"{k}", symbol)
    return mechanism, rod


@pytest.mark.parametrize("integrator", ["auto", "ida"])
@pytest.mark.filterwarnings("ignore::uqmbd.UnitsWarning", "ignore:.*the angular speed of body:uqmbd.StudyWarning")
def test_a_free_planar_body_keeps_momentum_and_energy(integrator):
    mechanism, rod = free(
        uqmbd_flexible.Beam(**PLANAR), uqmbd.Planar(), velocity=(1, 2), angular_velocity=20, position=(0.3, 0)
    )
    found = integrals_of_motion(
        mechanism, rod, uqmbd.simulate(mechanism, TIMES, rtol=1e-9, integrator=integrator, check=False)
    )
    size = np.abs(found).max(axis=1)
    assert size.min() > 0.1
    assert (np.ptp(found, axis=1) < (1e-7 if integrator == "auto" else 1e-5) * size).all()


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.UnitsWarning", "ignore:.*the angular speed of body:uqmbd.StudyWarning")
def test_a_free_spatial_body_keeps_momentum_and_energy():
    model = uqmbd_flexible.Beam(**SPATIAL)
    mechanism, rod = free(model, uqmbd.Spatial(), velocity=(1, 2, 3), angular_velocity=(9, -12, 15))
    found = integrals_of_motion(mechanism, rod, uqmbd.simulate(mechanism, TIMES, rtol=1e-9, check=False))
    size = np.abs(found).max(axis=1)
    assert size.min() > 1e-4
    assert (np.ptp(found, axis=1) < 1e-7 * size.max()).all()
