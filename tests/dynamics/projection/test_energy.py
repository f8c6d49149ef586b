"""E[T + V] is conserved where nothing dissipates: the equations are those of an averaged Lagrangian."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.integrate

import uqmbd
from uqmbd.dynamics.linear.index1 import accelerations
from uqmbd_galerkin import Galerkin

# the mass of a pendulum changes its energy, which is looked at, and not its motion
pytestmark = pytest.mark.filterwarnings(
    "ignore:.*no output depends on the random input 'mass':uqmbd.UnusedInputWarning"
)

CASES = {
    "pendulum": ({"speed": 4.0}, np.linspace(0, 3, 31)),
    "slider_crank": ({}, np.linspace(0, 1, 31)),
    "spatial_pendulum": ({}, np.linspace(0, 3, 31)),
}


def drift(mechanism, times, rtol, **options):
    """Largest change of the averaged energy, over the range of the averaged kinetic energy."""
    study = uqmbd.Study("energy", mechanism, times, rtol=rtol)
    found = study.propagate(Galerkin(order=2, verify=0, **({"nodes": 5} | options)))["diagnostics"]["energy"].values
    return float(np.abs(found - found[0]).max())


QUICK = ("pendulum-ida", "spatial_pendulum-dop853")


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "integrator"),
    [
        pytest.param(name, by, id=f"{by}-{name}", marks=() if f"{name}-{by}" in QUICK else pytest.mark.thorough)
        for name in CASES
        for by in ("dop853", "ida")
    ],
)
def test_averaged_energy_is_kept_and_better_with_the_tolerance(mechanisms, name, integrator):
    """Random length and mass; the scale of energies is m g l, about 1 J for the slider-crank and 10 J else."""
    options, times = CASES[name]
    scale = 0.5 if name == "slider_crank" else 10.0
    loose, tight = (drift(mechanisms[name](**options), times, rtol, integrator=integrator) for rtol in (1e-5, 1e-8))
    limit = 1e-7 if integrator == "dop853" else 1e-5
    assert tight < limit * scale
    assert tight < 0.05 * loose or loose < 1e-10 * scale


@pytest.mark.thorough
def test_kept_with_any_number_of_nodes(mechanisms):
    """The rule of the quadrature defines the average: with 3 or 7 nodes the energy of that average is kept."""
    for nodes in ((3,), (7,)):
        assert drift(mechanisms["pendulum"](speed=4.0), np.linspace(0, 1, 11), 1e-9, nodes=nodes) < 1e-7


def accelerations_projected(projected, times, rtol):
    """The negative control: nodal accelerations, projected; nothing of the averaged Lagrangian is left."""
    ensemble, model = projected.ensemble, projected.model
    shape = projected.start.state.shape

    def rate(time, z):
        q, s, v = projected.split(projected.psi @ z.reshape(shape))
        a = accelerations(model, q, s, v, time, ensemble.block)[0]
        return np.concatenate([projected.adjoint @ v, projected.adjoint @ a], axis=1).ravel()

    found = scipy.integrate.solve_ivp(
        rate, (times[0], times[-1]), projected.start.state.ravel(), "DOP853", times, rtol=rtol, atol=rtol
    )
    return found.y.T.reshape(len(times), *shape).transpose(1, 0, 2)


@pytest.mark.thorough
def test_projected_accelerations_do_not_keep_it(mechanisms, project):
    """Same nodes, same basis, a tolerance that lets the drift be that of the equations: a thousand times more.

    The drift of ours is that of rounding and of the iteration's tolerance: 1e-8 to 4e-8, after some starts that differ
    by rounding 3e-7.
    """
    times = CASES["pendulum"][1]
    projected = project(mechanisms["pendulum"](speed=4.0), 2, nodes=5)
    drifts = []
    for coefficients in (
        accelerations_projected(projected, times, 1e-9),
        projected.integrate(times, 1e-9, "dop853").coefficients,
    ):
        nodal = projected.nodal(coefficients)
        energy = projected.weights @ projected.ensemble.energies(times, nodal).sum(axis=1)
        drifts.append(np.abs(energy - energy[0]).max())
    control, ours = drifts
    assert ours < 1e-6
    assert control > 1e5 * ours


@pytest.mark.thorough
def test_constraints_and_norms_are_reported(mechanisms):
    """The projected constraints hold to rounding; those at the nodes only as the order grows."""
    rms = []
    for order in (1, 2, 3):
        study = uqmbd.Study("norms", mechanisms["pendulum"](speed=4.0), np.linspace(0, 1, 11))
        found = study.propagate(Galerkin(order=order, verify=0))["diagnostics"]
        assert {"constraint_rms", "quaternion_norm_rms", "top_order_share"} <= set(found.data_vars)
        assert (found["smallest_singular_value"] > 0.1).all() and found["probe_time"][0] == 0
        rms.append([float(found[name].max()) for name in ("constraint_rms", "quaternion_norm_rms")])
    assert (np.diff(np.log10(rms), axis=0) < -0.3).all()
