"""Accelerations, multipliers and rates of coefficients, of random chains, against the assembled equations."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.dynamics.equations import state_arguments
from uqmbd_joints import Prismatic, Revolute
from uqmbd_springs import SpringDamper, TorsionSpringDamper


def chain(angles, slides, speed=0.0, springs=(), spring=False, sigma=0.05, upper=3.0):
    """Planar rods of random length and mass on pins or slides, with springs between them, some with their own state."""
    length = uqmbd.RandomVariable("length", chaospy.Normal(1, sigma))
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(1, upper))
    mechanism = uqmbd.Mechanism("chain", uqmbd.Planar(gravity=(0, -9.81)))
    before, end, at = mechanism.ground, (0, 0), np.zeros(2)
    for k, angle in enumerate(angles):
        direction = np.array([np.cos(angle), np.sin(angle)])
        rod = mechanism.body(
            f"rod {k}", mass=mass * (k + 1), inertia=mass * length**2 / 12, position=tuple(at + length / 2 * direction),
            angle=angle, angular_velocity=speed if k + 1 == len(angles) and not (slides and k == 0) else 0,
        )  # fmt: skip
        if slides and k == 0:
            mechanism.add(Prismatic("slide", before, rod, end, (-length / 2, 0), tuple(direction), (1, 0)))
        else:
            mechanism.add(Revolute(f"pin {k}", before, rod, end, (-length / 2, 0)))
        if k in springs:
            mechanism.add(TorsionSpringDamper(f"torsion {k}", before, rod, stiffness=5, damping=mass / 10))
        before, end, at = rod, (length / 2, 0), at + length * direction
    if spring:
        mechanism.add(SpringDamper("spring", mechanism.ground, before, (0.3, 2), end, 30, 0.5, length))
    mechanism.output("x", before.position[0], units="m")
    return mechanism


ANGLES = st.floats(-3, 3) | st.sampled_from([0.0, 1e-133, 1e-9, 1e-4, np.pi / 2])

chains = st.builds(
    chain,
    st.lists(ANGLES, min_size=1, max_size=3),
    slides=st.booleans(),
    speed=st.floats(-2, 2),
    springs=st.sets(st.integers(0, 2)),
    spring=st.booleans(),
    sigma=st.sampled_from([0.01, 0.05]),
    upper=st.sampled_from([1.2, 3.0]),
)


def assembled(projected, state, time):
    """Solution of the projected index-1 system as one dense matrix."""
    model, n, terms = projected.model, projected.model.layout.coordinates, projected.terms
    found = model.evaluate("acceleration", state_arguments(time, projected.psi @ state), projected.ensemble.block)
    d, kept = found["d"][:, model.layout.kept], model.layout.kept
    size = n + len(kept)
    nodal = np.zeros((len(d), size, size))
    nodal[:, :n, :n], nodal[:, n:, :n], nodal[:, :n, n:] = found["mass"], d, d.transpose(0, 2, 1)
    right = np.concatenate([found["force"], found["gamma"][:, kept]], axis=1)
    whole = np.einsum("ik,kab,kj->iajb", projected.adjoint, nodal, projected.psi).reshape(terms * size, -1)
    expected = np.linalg.solve(whole, (projected.adjoint @ right).ravel()).reshape(terms, size)
    return expected[:, :n], expected[:, n:]


@pytest.mark.parametrize("angle", [1e-133, 1e-9, 1e-4])
@pytest.mark.parametrize("middle", [1.0, 1.5])
def test_rods_along_an_axis(project, angle, middle):
    """A coordinate that moves nothing in a pose has next to no mass: it says nothing of what rounding is."""
    projected = project(chain([angle, middle, angle], slides=True, speed=1.0, springs={1, 2}), order=1)
    found, multipliers, _ = projected.accelerations(projected.start.state, 0.0)
    for one, expected in zip((found, multipliers), assembled(projected, projected.start.state, 0.0), strict=True):
        np.testing.assert_allclose(one, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(mechanism=chains, order=st.integers(1, 3), index_set=st.sampled_from(["total", "tensor"]))
def test_coefficients_of_chains(project, mechanism, order, index_set):
    """Against LAPACK; and the stabilised index-2 residual, from other code, vanishes for what was found."""
    projected = project(mechanism, order, index_set=index_set)
    state, layout = projected.start.state, projected.model.layout
    a, multipliers, rates = projected.accelerations(state, 0.0)
    for found, expected in zip((a, multipliers), assembled(projected, state, 0.0), strict=True):
        scale = np.abs(expected).max(initial=1.0)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * scale)
    q, s, v = projected.split(state)
    y = projected.ensemble.pack(q, s, v, multipliers)
    residual = projected.residual(0.0, y, projected.ensemble.pack(v, rates, a, np.zeros_like(multipliers)))
    assert np.abs(residual).max() <= 1e-7 * max(1.0, np.abs(multipliers).max(initial=0.0), np.abs(a).max())
    assert layout.unknowns == residual.shape[1]
