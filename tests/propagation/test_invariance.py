"""Stated errors have no units: scale and shift of outputs, and order and units of inputs, do not change them."""

from __future__ import annotations

import warnings

import chaospy
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import TorsionSpringDamper

METHODS = {
    "collocation": lambda: Collocation(order=2, verify=12),
    "regression": lambda: Collocation(order=2, method="regression", samples=24, verify=12),
    "elements": lambda: Collocation(order=1, elements=2, verify=12),
    "phase": lambda: Collocation(order=2, alignment="phase", verify=12),
    "galerkin": lambda: Galerkin(order=2, verify=12),
    "monte-carlo": lambda: MonteCarlo(samples=60, seed=4),
}
STATED = ("verification_error", "verification_factor", "sobol_first", "sobol_total", "skewness", "kurtosis")
SCALED = ("std_error_mean", "std_error_std", "std", "integration_error")


def study(scale: float, shift: float, unit: float, *, exchanged: bool) -> uqmbd.Study:
    """A torsion pendulum with random length and stiffness: its angle and the height of its end, in two scales."""
    declared = {
        "length": lambda: uqmbd.RandomVariable("length", unit * chaospy.Uniform(0.9, 1.1), units="m"),
        "stiffness": lambda: uqmbd.RandomVariable("stiffness", unit * chaospy.Normal(12.0, 0.6), units="N m/rad"),
    }
    made = {name: declared[name]() / unit for name in sorted(declared, reverse=exchanged)}
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    rod = mechanism.body("rod", mass=1, inertia=0.1, position=(0, -0.5), angular_velocity=4)
    pin = mechanism.add(Revolute("pin", mechanism.ground, rod, point_i=(0, 0), point_j=(0, 0.5)))

    def spring() -> None:
        spring = TorsionSpringDamper("spring", mechanism.ground, rod, stiffness=made["stiffness"], damping=0.05)
        mechanism.add(spring)

    if exchanged:
        spring()
    mechanism.output("angle", pin.angle, units="rad")
    height = rod.point((0, -made["length"] / 2))[1]
    mechanism.output("height", height, units="m")
    mechanism.output("other", scale * height + shift, units="m")
    if not exchanged:
        spring()
    return uqmbd.Study("pendulum", mechanism, np.linspace(0, 3, 31), [])


def statistics(
    method: str, scale: float = 1.0, shift: float = 0.0, unit: float = 1.0, exchanged: bool = False
) -> xr.Dataset:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        node = study(scale, shift, unit, exchanged=exchanged).propagate(METHODS[method]())
    return node["statistics"].to_dataset()


def close(one: xr.DataArray, other: xr.DataArray, factor: float = 1.0, rtol: float = 1e-4) -> None:
    size = float(np.abs(one).max())
    np.testing.assert_allclose(other.values, factor * one.values, rtol=rtol, atol=abs(factor) * 1e-5 * size)


@pytest.mark.thorough
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("scale", "shift"), [(1e6, 0.0), (-1e-7, 1e-5), (3.0, 400.0)])
def test_scale_and_shift_of_an_output_change_no_stated_error(method: str, scale: float, shift: float) -> None:
    found = statistics(method, scale, shift)
    one, other = (found.sel(output=name).isel(time=slice(1, None)) for name in ("height", "other"))
    for name in STATED:
        if name in found:
            sign = np.sign(scale) if name == "skewness" else 1.0
            close(one[name], other[name], sign)
    for name in SCALED:
        if name in found:
            close(one[name], other[name], abs(scale), rtol=0.3 if name == "integration_error" else 1e-4)


@pytest.mark.thorough
@pytest.mark.parametrize("method", [name for name in METHODS if name != "monte-carlo"])
@pytest.mark.parametrize(("unit", "exchanged"), [(1000.0, False), (1e-3, False), (1.0, True)])
def test_order_and_units_of_inputs_change_no_stated_error(method: str, unit: float, exchanged: bool) -> None:
    plain, changed = statistics(method), statistics(method, unit=unit, exchanged=exchanged)
    if "input" in changed.dims:
        changed = changed.sel(input=plain["input"])
    for name in (*STATED, *SCALED):
        if name in plain:
            close(plain[name].isel(time=slice(1, None)), changed[name].isel(time=slice(1, None)), rtol=0.02)
