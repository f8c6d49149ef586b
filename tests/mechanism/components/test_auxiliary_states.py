"""Auxiliary states of components in outputs, requirements, summaries and controllers, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.testing import check_component


class Chamber(uqmbd.Component):
    """A chamber whose pressure relaxes to a supply, and pushes a piston."""

    bodies, spaces = ("body",), (uqmbd.Line,)
    time_constant = uqmbd.Parameter("s", "time constant of filling", minimum=0, exclusive=True, example=0.5)
    supply = uqmbd.Parameter("Pa", "pressure of the supply", example=2)
    start = uqmbd.Parameter("Pa", "pressure at the start", example=1)
    area = uqmbd.Parameter("m^2", "area of the piston", minimum=0, example=0.3)

    def terms(self, p):
        """Fill, and push."""
        pressure = p.state("pressure", "Pa")
        yield uqmbd.Auxiliary(pressure, (p.supply - pressure) / p.time_constant, p.start)
        yield uqmbd.VirtualWork(p.area * pressure, p.body.velocity[0])


def filled(supply=3.0, time_constant=0.5, start=1.0, name="chamber", mechanism=None):
    mechanism = mechanism or uqmbd.Mechanism("cylinder", uqmbd.Line())
    piston = mechanism.body(f"piston of {name}", mass=2)
    given = {"supply": supply, "time_constant": time_constant, "start": start, "area": 0.25}
    return mechanism, mechanism.add(Chamber(name, piston, **given))


def test_outputs_and_summaries_follow_the_closed_form():
    """``p(t) = supply + (start - supply) exp(-t / T)`` of several chambers, in random values."""
    rng = np.random.default_rng(3)
    times = np.linspace(0, 2, 9)
    mechanism, values = uqmbd.Mechanism("bank", uqmbd.Line()), rng.uniform(0.5, 4, (3, 3))
    for k, (supply, constant, start) in enumerate(values):
        _, chamber = filled(supply, constant, start, f"chamber {k}", mechanism)
        p = chamber.state("pressure")
        mechanism.output(f"p{k}", p, units="Pa")
        mechanism.output(f"square {k}", p**2 + 2, units="Pa^2")
        mechanism.output(f"largest {k}", uqmbd.maximum(p), units="Pa")
        mechanism.output(f"integral {k}", uqmbd.integral(p), units="Pa s")
        middle = start + 0.5 * (supply - start)
        crossed = p >= middle if supply > start else p <= middle
        mechanism.output(f"half {k}", uqmbd.first_time(crossed), units="s")
    found = uqmbd.simulate(mechanism, times, rtol=1e-9)
    for k, (supply, constant, start) in enumerate(values):
        exact = supply + (start - supply) * np.exp(-times / constant)
        np.testing.assert_allclose(found[f"p{k}"], exact, rtol=1e-8)
        np.testing.assert_allclose(found[f"square {k}"], exact**2 + 2, rtol=1e-8)
        np.testing.assert_allclose(found[f"largest {k}"], max(exact[0], exact[-1]), rtol=1e-8)
        area = 2 * supply + (start - supply) * constant * (1 - np.exp(-2 / constant))
        np.testing.assert_allclose(found[f"integral {k}"], area, rtol=1e-7)
        half = constant * np.log(2)
        np.testing.assert_allclose(found[f"half {k}"], half if half <= 2 else np.nan, rtol=1e-7)


def test_requirements_and_every_method_take_a_state():
    """The pressure at 1 s is linear in a uniform supply: its mean, deviation and probability are exact."""
    pytest.importorskip("uqmbd_montecarlo")
    from uqmbd_collocation import Collocation
    from uqmbd_galerkin import Galerkin
    from uqmbd_montecarlo import MonteCarlo

    supply = uqmbd.extend.uniform_variable("supply", 2, 4, "Pa")
    mechanism, chamber = filled(supply, 0.5, 0.0)
    mechanism.output("pressure", chamber.state("pressure"), units="Pa")
    mechanism.require("safe", chamber.state("pressure") <= 3.0)
    methods = [MonteCarlo(samples=512, sampling="sobol", seed=1), Collocation(order=2), Galerkin(order=2)]
    tree = uqmbd.Study("s", mechanism, [0, 0.5, 1], methods).run()
    gain = 1 - np.exp(-2)
    for label in ("monte-carlo", "collocation", "galerkin"):
        statistics = tree[f"{label}/statistics"]
        tolerance = 0.01 if label == "monte-carlo" else 1e-6
        assert abs(float(statistics["mean"][0, -1]) - 3 * gain) < tolerance
        assert abs(float(statistics["std"][0, -1]) - gain / np.sqrt(3)) < tolerance
    probability = float(tree["monte-carlo/requirements"]["violation_probability"][0])
    assert abs(probability - (4 - 3 / gain) / 2) < 0.02


def test_a_controller_measures_a_state():
    mechanism, chamber = filled(3.0, 0.5, 0.0)
    seen = []

    def function(time, measured):
        seen.append((time, float(measured[0, 0])))
        return np.zeros((len(measured), 1))

    controller = uqmbd.Controller("gauge", [chamber.state("pressure")], {"none": "Pa"}, 10, function)
    mechanism.add(controller)
    mechanism.output("copy", controller.command("none"), units="Pa")
    uqmbd.simulate(mechanism, [0, 1], rtol=1e-9, check=False)
    for time, value in seen:
        assert abs(value - 3 * (1 - np.exp(-2 * time))) < 1e-7


@pytest.mark.parametrize("name", ["presure", "", "x", 3, None])
def test_an_unknown_state_lists_those_that_there_are(name):
    _, chamber = filled()
    with pytest.raises(uqmbd.StudyError, match="Its auxiliary states are: 'pressure'"):
        chamber.state(name)


def test_messages_name_what_to_do():
    mechanism, chamber = filled()
    piston = chamber.attached["body"]
    with pytest.raises(uqmbd.StudyError, match=r"mechanism.add\(...\) first"):
        Chamber("other", piston, time_constant=1, supply=1, start=1, area=1).state("pressure")
    with pytest.raises(uqmbd.StudyError, match="neither a position nor a velocity"):
        mechanism.start(chamber.state("pressure"), 2)
    other, _ = filled()
    with pytest.raises(uqmbd.StudyError, match="belongs to another mechanism"):
        other.output("p", chamber.state("pressure"), units="Pa")
    with pytest.warns(uqmbd.UnitsWarning, match="is in Pa"):
        mechanism.output("wrong", chamber.state("pressure"), units="N")


def hydraulic(rate, force, units):
    class Cylinder(uqmbd.Component):
        """A cylinder with a compressible fluid."""

        area = uqmbd.Parameter("m^2", "area", minimum=0, exclusive=True, example=0.5)
        volume = uqmbd.Parameter("m^3", "volume", minimum=0, exclusive=True, example=2.0)
        bulk = uqmbd.Parameter("Pa", "bulk modulus", minimum=0, exclusive=True, example=3.0)

        def terms(self, p):
            offset = p.body_j.position - p.body_i.position
            v = p.rate_of(p.let("length", sympy.sqrt(offset.dot(offset) + 1e-6)))
            pressure = p.state("pressure", units) if units else p.state("pressure")
            yield uqmbd.Auxiliary(pressure, rate(p, v, pressure), 0)
            yield uqmbd.VirtualWork(force(p, pressure), v)

    return Cylinder


def compressed(p, v, s):
    return -p.bulk / p.volume * p.area * v


UNITS = {
    "volume squared": (lambda p, v, s: -p.bulk / p.volume**2 * p.area * v, lambda p, s: s * p.area),
    "product": (lambda p, v, s: -p.bulk * p.volume * p.area * v, lambda p, s: s * p.area),
    "sum of unlike": (lambda p, v, s: -p.bulk / (p.volume + p.area) * p.area * v, lambda p, s: s * p.area),
    "force by volume": (compressed, lambda p, s: s * p.volume),
    "force by area squared": (compressed, lambda p, s: s * p.area**2),
    "no rate": (lambda p, v, s: compressed(p, v, s) * p.area / p.volume, lambda p, s: s * p.area),
}


@pytest.mark.thorough
@pytest.mark.parametrize("units", ["", "Pa", "N/m^2"])
def test_the_kit_compares_units_of_states(units):
    """With stated units, and with those that follow from the rate."""
    check_component(hydraulic(compressed, lambda p, s: s * p.area, units), spaces=(uqmbd.Planar,), propagators=())
    for name, case in UNITS.items():
        with pytest.raises(AssertionError, match="is in|adds"):
            check_component(hydraulic(*case, units), spaces=(uqmbd.Planar,), propagators=())
            raise ValueError(name)


@pytest.mark.thorough
def test_the_kit_rejects_wrong_stated_units():
    for units in ("N", "bar", "Pa s", "Pa/s"):
        with pytest.raises((AssertionError, uqmbd.StudyError)):
            check_component(
                hydraulic(compressed, lambda p, s: s * p.area, units), spaces=(uqmbd.Planar,), propagators=()
            )
