"""Vectors of bodies and reactions of components are all of one kind."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd_joints import Fixed, Revolute

SPACES = {"spatial": uqmbd.Spatial(gravity=(0, -9.81, 0)), "planar": uqmbd.Planar(gravity=(0, -9.81)), "points": uqmbd.Translational(gravity=(0, -9.81))}  # fmt: skip
MASS, ARM = 2.0, 0.5


def bracket(space):
    """A body that is fixed to the ground, its centre of mass at an arm from the joint."""
    mechanism = uqmbd.Mechanism("bracket", space)
    d = space.dimension
    inertia = {} if not space.turns else {"inertia": (1, 1, 1) if d == 3 else 1}
    position = (ARM, 0, 0)[:d]
    body = mechanism.body("body", mass=MASS, position=position, **inertia)
    at = (-ARM, 0, 0)[:d]
    weld = mechanism.add(Fixed("weld", mechanism.ground, body, (0, 0, 0)[:d], at))
    return mechanism, body, weld


def vectors(space):
    _, body, weld = bracket(space)
    found = {
        "position": body.position,
        "velocity": body.velocity,
        "acceleration": body.acceleration,
        "point": body.point(body.position),
        "force": weld.reaction_force,
    }
    if space.turns:
        found["quaternion"] = body.quaternion
        found["quaternion rate"] = body.quaternion_rate
    if space.dimension == 3:
        found |= {"moment": weld.reaction_moment, "spin": body.angular_velocity}
    return found


@pytest.mark.parametrize("space", SPACES.values(), ids=SPACES)
def test_vectors_are_columns_of_one_kind(space):
    for name, vector in vectors(space).items():
        size = space.size - space.dimension if name.startswith("quaternion") else space.dimension
        assert type(vector) is type(sympy.Matrix([1])) and vector.shape == (size, 1), name
        assert (
            len(vector) == size and list(vector) == [vector[k] for k in range(size)] and vector[-1] == vector[size - 1]
        )
        ones = sympy.ones(size, 1)
        assert vector.dot(vector) == sum(x**2 for x in vector) and vector.dot(ones) == sum(vector)
        assert (vector.norm() ** 2).expand() == vector.dot(vector).expand()
        assert 2 * vector - vector / 2 == sympy.Rational(3, 2) * vector
        assert (vector.T * vector)[0] == vector.dot(vector) and vector + ones == sympy.Matrix([x + 1 for x in vector])
        if len(vector) == 3:
            assert vector.cross(vector) == sympy.zeros(3, 1)


@pytest.mark.parametrize("space", SPACES.values(), ids=SPACES)
def test_outputs_of_vectors_are_the_numbers_that_they_should_be(space):
    """What a weld carries: the weight, and its moment about the joint."""
    mechanism, body, weld = bracket(space)
    down = sympy.Matrix([0, -1, 0][: space.dimension])
    mechanism.output("force", weld.reaction_force.norm(), units="N")
    mechanism.output("along", weld.reaction_force.dot(down), units="N")
    mechanism.output("turned", (body.rotation.T * weld.reaction_force)[1], units="N")
    mechanism.output("together", (weld.reaction_force + MASS * body.acceleration)[1])
    expected = {"force": MASS * 9.81, "along": -MASS * 9.81, "turned": MASS * 9.81, "together": MASS * 9.81}
    if space.turns:
        mechanism.output("length", body.quaternion.norm())
        expected["length"] = 1
    if space.dimension == 3:
        mechanism.output("moment", weld.reaction_moment.norm(), units="N m")
        mechanism.output("axial", weld.reaction_moment.dot(body.position.cross(down)) / ARM)
        expected |= {"moment": MASS * 9.81 * ARM, "axial": -MASS * 9.81 * ARM}
    found = uqmbd.simulate(mechanism, [0, 0.1])
    for name, value in expected.items():
        np.testing.assert_allclose(found[name], value, rtol=1e-8, err_msg=name)


def test_a_moment_in_the_plane_is_a_number_as_the_angular_velocity_is():
    mechanism, body, weld = bracket(SPACES["planar"])
    for number in (weld.reaction_moment, body.angular_velocity):
        assert isinstance(number, sympy.Symbol) and number[0] == number
    mechanism.output("power", weld.reaction_moment * body.angular_velocity, units="W")


def test_a_vector_is_no_output_and_no_force_of_a_law():
    mechanism, body, weld = bracket(SPACES["spatial"])
    for vector in (weld.reaction_force, weld.reaction_moment, body.quaternion, body.position):
        with pytest.raises(uqmbd.StudyError, match="has [34] components; record them one by one"):
            mechanism.output("vector", vector)
    with pytest.raises(uqmbd.StudyError, match=r"depends on weld.reaction_force\[0\]"):
        mechanism.add(
            Revolute("other", mechanism.ground, body, 1.0 * weld.reaction_force, (0, 0, 0), (0, 0, 1), (0, 0, 1))
        )
