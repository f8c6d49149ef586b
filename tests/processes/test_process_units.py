"""Units of outputs of the stationary response, and of processes."""

import re
import warnings

import pytest

import uqmbd
from uqmbd_processes import (
    RandomProcess,
    crossing_rate,
    estimated_psd,
    estimated_std,
    expected_maximum,
    exponential_covariance,
    fatigue_damage,
    iso8608,
    kaimal,
    kanai_tajimi,
    order_amplitude,
    stationary_psd,
    stationary_std,
    von_karman,
    white_noise,
)
from uqmbd_springs import PointForce, RadialTyre, SpringDamper

FORCE = RandomProcess("force", psd=white_noise(0.1, sided="two", per="rad/s", band=(0, 30)), units="N")

QUANTITIES = {
    "std": (lambda mass: stationary_std(mass.position[0]), ("m",)),
    "std of the mean": (lambda mass: stationary_std(mass.position[0] - 1.0), ("m",)),
    "psd": (lambda mass: stationary_psd(mass.position[0], 0.4), ("m^2/Hz", "m^2 s", "m^2 s/rad")),
    "psd per rad/s": (lambda mass: stationary_psd(mass.position[0], 3, sided="two", per="rad/s"), ("m^2 s/rad",)),
    "rate": (lambda mass: crossing_rate(mass.position[0], 0.1), ("1/s", "Hz")),
    "rate of a scaled response": (lambda mass: crossing_rate(7 * mass.position[0], 0.1), ("1/s",)),
    "maximum": (lambda mass: expected_maximum(mass.position[0], 600), ("m",)),
    "maximum by Poisson": (lambda mass: expected_maximum(mass.position[0], 600, rule="poisson"), ("m",)),
    "damage": (lambda mass: fatigue_damage(mass.position[0], 600, exponent=4, coefficient=9.0), ("1",)),
    "estimate": (lambda mass: estimated_psd(mass.position[0], 2, segment=9), ("m^2/Hz", "m^2 s", "m^2 s/rad")),
    "estimate per rad/s": (lambda mass: estimated_psd(mass.position[0], 2, segment=9, per="rad/s"), ("m^2 s/rad",)),
    "estimated std": (lambda mass: estimated_std(mass.position[0], skip=0.1), ("m",)),
    "order": (lambda mass: order_amplitude(mass.position[0], 3.0 * uqmbd.t, 2), ("m",)),
    "process": (lambda mass: stationary_std(FORCE()), ("N",)),
}


def oscillator():
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = mechanism.body("mass", mass=7, position=1.5)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, 9, damping=0.6, free_length=1.2))
    mechanism.add(PointForce("load", mass, 0, FORCE()))
    return mechanism, mass


@pytest.mark.parametrize("name", QUANTITIES)
@pytest.mark.parametrize("units", ["m", "mm", "N", "K", "m^2/Hz", "m^2 s", "m^2 s/rad", "mm^2/Hz", "1/s", "Hz", "1"])
def test_wrong_units_of_a_stationary_output_are_reported(name, units):
    make, right = QUANTITIES[name]
    mechanism, mass = oscillator()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", uqmbd.UnitsWarning)
        try:
            mechanism.output("x", make(mass), units=units)
        except uqmbd.StudyError as error:
            told.append(error)
    alike = {"m^2/Hz", "m^2 s", "m^2 s/rad"}, {"1/s", "Hz"}
    fits = set(right).union(*(group for group in alike if group & set(right)))
    assert bool(told) == (units not in fits)


def test_an_angle_in_other_units_is_reported():
    mechanism, mass = oscillator()
    with pytest.warns(uqmbd.UnitsWarning, match="mass.x is in m, but its declared units are rad"):
        mechanism.output("x", order_amplitude(mass.position[0], mass.position[0], 2), units="m")


def test_metres_as_millimetres_are_an_error():
    mechanism, mass = oscillator()
    mechanism.output("fits", 1000 * stationary_std(mass.position[0]), units="mm")
    with pytest.raises(uqmbd.StudyError, match="wrong by a factor of 1000. Write 1000"):
        mechanism.output("x", stationary_std(mass.position[0]), units="mm")
    with pytest.raises(uqmbd.StudyError, match="wrong by a factor of 1e[+]06"):
        mechanism.output("s", stationary_psd(mass.position[0], 0.4), units="mm^2/Hz")


def test_a_linear_output_without_a_power_has_unknown_units():
    found = uqmbd.extend.linear_output(_number)
    mechanism, mass = oscillator()
    mechanism.output("x", found(mass.position[0]), units="K")
    with pytest.raises(uqmbd.StudyError, match="expected known units and a power"):
        uqmbd.extend.linear_output(units="1/s")
    with pytest.raises(uqmbd.StudyError, match="units is 'foo'"):
        uqmbd.extend.linear_output(power=1, units="foo")


def _number(system):
    return system.mean, [""] * len(system)


def test_units_of_a_process_are_compared_with_its_spectrum():
    with pytest.raises(uqmbd.StudyError, match="'mm', but psd is the density of a process in m. Write units='m'"):
        RandomProcess("road", psd=iso8608("C"), over="distance", units="mm")
    for spectrum, units in ((kaimal(1, 9, 2), "m/s"), (von_karman(1, 9, 2), "m/s"), (kanai_tajimi(1, 9, 0.6), "m/s^2")):
        with pytest.raises(uqmbd.StudyError, match=f"Write units='{re.escape(units)}'"):
            RandomProcess("wind", psd=spectrum, units="m")
        assert RandomProcess("wind", psd=spectrum).units == units
    assert RandomProcess("road", psd=iso8608("C"), over="distance", units="metre").units == "metre"
    assert RandomProcess("noise", psd=white_noise(1.0, sided="one", per="Hz"), units="mm").units == "mm"


def road_in(units):
    road = RandomProcess("road", covariance=exponential_covariance(0.01, 5.0), over="distance", units=units, cutoff=1.0)
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Line(gravity=-9.81))
    wheel = mechanism.body("wheel", mass=40, position=0.3)
    mechanism.add(RadialTyre("tyre", mechanism.ground, wheel, 0, road(20 * uqmbd.t), radius=0.32, stiffness=180e3))
    return mechanism


def test_a_road_in_millimetres_is_refused_by_a_wheel():
    with pytest.raises(uqmbd.StudyError, match=r"RadialTyre 'tyre': road: road\(20\*t\) is in mm.* factor of 1000"):
        road_in("mm")


def test_a_road_of_another_dimension_is_found():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", uqmbd.UnitsWarning)
        (found,) = uqmbd.check(road_in("N")).units
    assert found.startswith("RadialTyre 'tyre': road: road(20*t) is in N, but its declared units are m")
    assert uqmbd.check(road_in("m")).units == ()


def test_unknown_units_of_a_process_are_reported():
    process = RandomProcess("road", covariance=exponential_covariance(0.01, 5.0), over="distance", units="squiggle")
    with pytest.warns(uqmbd.UnitsWarning, match="'road'.*squiggle"):
        process(20 * uqmbd.t)
