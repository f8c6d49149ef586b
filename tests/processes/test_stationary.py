"""Stationary responses against Lyapunov's equation of SciPy, closed forms and quadrature, and refused responses."""

from dataclasses import replace
from math import gamma

import chaospy
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm, solve_continuous_lyapunov

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_drivers import PositionDriver
from uqmbd_joints import Prismatic
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import (
    PowerSpectralDensity,
    RandomProcess,
    crossing_rate,
    davenport_coherence,
    expected_maximum,
    exponential_covariance,
    fatigue_damage,
    iso8608,
    kaimal,
    stationary_psd,
    stationary_std,
    white_noise,
)
from uqmbd_springs import PointForce, RadialTyre, SpringDamper

ROAD = RandomProcess("road", covariance=exponential_covariance(0.01, 5.0), over="distance", units="m")
SPEED = 20.0


def quarter_car(road=ROAD, damping=0.0, mass=300.0):
    """Return a linear quarter car without lift-off, and its quantities."""
    car = uqmbd.Mechanism("quarter_car", uqmbd.Line(gravity=-9.81))
    wheel, body = car.body("wheel", mass=40, position=0.3), car.body("body", mass=mass, position=0.8)
    car.add(SpringDamper("suspension", wheel, body, 0, 0, stiffness=20_000, damping=1_200, free_length=0.65))
    ground, height = car.ground, road(SPEED * uqmbd.t)
    tyre = RadialTyre(
        "tyre", ground, wheel, 0, road=height, radius=0.32, stiffness=180_000, damping=damping, transition=1e-9
    )
    car.add(tyre)
    seen = {
        "height": body.position[0],
        "acceleration": body.acceleration[0],
        "travel": body.position[0] - wheel.position[0],
        "force": tyre.reaction_force[0],
        "deflection": wheel.position[0] - height,
    }
    return car, seen


def values(mechanism, **outputs):
    """Return scalar outputs at the means."""
    for name, expression in outputs.items():
        mechanism.output(name, expression)
    found = uqmbd.simulate(mechanism, [0, 1])
    return [float(found[name]) for name in outputs]


def matrices():
    """Return the system of the quarter car written by hand: states (zs, zu, zs', zu'), input, and outputs."""
    ks, cs, kt, ms, mu = 20e3, 1200.0, 180e3, 300.0, 40.0
    rows = np.array([[-ks, ks, -cs, cs], [ks, -ks - kt, cs, -cs]]) / np.array([[ms], [mu]])
    a = np.vstack([np.eye(4)[2:], rows])
    c = {"height": np.eye(4)[0], "acceleration": rows[0], "travel": np.array([1.0, -1, 0, 0])}
    c |= {"force": np.array([0, -kt, 0, 0.0]), "deflection": np.array([0, 1.0, 0, 0])}
    return a, np.array([0, 0, 0, kt / mu]), c, {"force": kt, "deflection": -1.0}


def response(name, frequency):
    a, b, c, e = matrices()
    return c[name] @ np.linalg.solve(1j * frequency * np.eye(4) - a, b) + e.get(name, 0.0)


def test_the_quarter_car_has_the_reference_deviations():
    """Reference of the issue, by Lyapunov's equation: road exp(-|d| / 5 m), 10 mm, 20 m/s, tyre without damping."""
    car, seen = quarter_car()
    found = values(car, **{name: stationary_std(seen[name]) for name in ("height", "acceleration", "travel", "force")})
    assert found == pytest.approx([0.013065, 1.164689, 0.009730, 693.730], rel=4e-5)
    assert found[1] == pytest.approx(1.164689, rel=5e-7)
    a, b, c, e = matrices()
    whole = np.block([[a, b[:, None]], [np.zeros((1, 4)), -SPEED / 5 * np.ones((1, 1))]])
    noise = np.zeros((5, 5))
    noise[4, 4] = 2 * SPEED / 5 * 0.01**2
    covariance = solve_continuous_lyapunov(whole, -noise)
    rows = [np.append(c[name], e.get(name, 0.0)) for name in ("height", "acceleration", "travel", "force")]
    assert found == pytest.approx([np.sqrt(row @ covariance @ row) for row in rows], rel=1e-8)


@pytest.mark.parametrize("name", ["height", "acceleration", "travel", "force", "deflection"])
def test_a_band_limited_road_agrees_with_quadrature_of_scipy(name):
    road = RandomProcess("road", psd=iso8608("C", band=(0.01, 10.0)), over="distance", units="m")
    car, seen = quarter_car(road)

    def density(w):
        n = w / (2 * np.pi * SPEED)
        return abs(response(name, w)) ** 2 * 256e-6 * (n / 0.1) ** -2 / (2 * np.pi * SPEED)

    bounds = 2 * np.pi * SPEED * np.array([0.01, 0.04, 0.08, 0.3, 0.8, 10.0])
    parts = [quad(density, x, y, epsrel=1e-11, limit=400)[0] for x, y in zip(bounds[:-1], bounds[1:], strict=True)]
    assert values(car, x=stationary_std(seen[name])) == pytest.approx([np.sqrt(sum(parts))], rel=1e-7)


@pytest.mark.parametrize("name", ["height", "acceleration", "travel", "force", "deflection"])
def test_quadrature_of_an_unbounded_spectrum_agrees_with_lyapunov(name):
    def density(w):
        return 0.01**2 * 5 / np.pi / (1 + (5 * w) ** 2)

    other = RandomProcess("road", psd=PowerSpectralDensity(density, sided="two", per="rad/m"), over="distance")
    (first, seen), (second, again) = quarter_car(), quarter_car(other)
    one, two = values(first, x=stationary_std(seen[name])), values(second, x=stationary_std(again[name]))
    assert one == pytest.approx(two, rel=1e-6)


def test_the_response_density_is_that_of_the_transfer_function():
    car, seen = quarter_car()
    frequencies = [0.5, 1.2, 11.0]
    parts = stationary_psd(seen["acceleration"], frequencies)
    found = values(car, **{f"f{k}": x for k, x in enumerate(parts)})

    def exact(f):
        k = 2 * np.pi * f / SPEED
        return abs(response("acceleration", 2 * np.pi * f)) ** 2 * 4 * 0.01**2 * 5 / (1 + (5 * k) ** 2) / SPEED

    assert found == pytest.approx([exact(f) for f in frequencies], rel=1e-9)
    other = quarter_car()
    two = stationary_psd(other[1]["acceleration"], 2 * np.pi * 1.2, sided="two", per="rad/s")
    assert values(other[0], x=two) == pytest.approx([exact(1.2) / (4 * np.pi)], rel=1e-9)


def oscillator(force, damping=0.6):
    """Return a unit mass on a spring of 9 N/m under a force, and its position."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=1)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=9, damping=damping, free_length=1))
    mechanism.add(PointForce("load", mass, 0, force))
    return mechanism, mass


def white(density=0.1):
    return RandomProcess("force", psd=white_noise(density, sided="two", per="rad/s"), units="N")


def test_an_oscillator_in_white_noise_has_the_moments_of_the_closed_form():
    """Variances ``pi S / (c k)`` and ``pi S / (c m)``; Rice, Davenport and Poisson from them."""
    mechanism, mass = oscillator(white()())
    x, n = mass.position[0], 3 / (2 * np.pi)
    s = np.sqrt(np.pi * 0.1 / (0.6 * 9))
    found = values(
        mechanism,
        x=stationary_std(x),
        v=stationary_std(mass.velocity[0]),
        rate=crossing_rate(x, 1.3),
        davenport=expected_maximum(x, 600.0),
        poisson=expected_maximum(x, 600.0, rule="poisson"),
    )
    g = np.sqrt(2 * np.log(n * 600))
    poisson = quad(lambda u: 1 - np.exp(-n * 600 * np.exp(-(u**2) / 2)), 0, 12, epsabs=1e-12, limit=200)[0]
    exact = [s, 3 * s, n * np.exp(-(0.3**2) / (2 * s**2)), 1 + s * (g + 0.5772156649 / g), 1 + s * poisson]
    assert found == pytest.approx(exact, rel=1e-8)
    assert exact[4] == pytest.approx(exact[3], rel=5e-3)


def test_a_random_factor_and_independent_processes_add_variances():
    scale = uqmbd.RandomVariable("scale", chaospy.Uniform(1, 3), units="1")
    other = RandomProcess("other", psd=white_noise(0.3, sided="one", per="rad/s"), units="N")
    mechanism, mass = oscillator(scale * white()() + other())
    mechanism.output("x", stationary_std(mass.position[0]))
    study = uqmbd.Study("scaled", mechanism, propagators=[MonteCarlo(samples=20, seed=3), Collocation(order=8)])
    tree = study.run()
    samples = tree["monte-carlo/scalars/samples"].to_dataset()
    factors = samples["inputs"].values[:, 0]
    exact = np.sqrt(np.pi * (0.1 * factors**2 + 0.15) / (0.6 * 9))
    assert samples["response"].values[:, 0] == pytest.approx(exact, rel=1e-9)
    mean = quad(lambda f: np.sqrt(np.pi * (0.1 * f**2 + 0.15) / 5.4) / 2, 1, 3)[0]
    assert tree["collocation/scalars/statistics"]["mean"].values == pytest.approx([mean], rel=1e-6)


def test_base_motion_by_a_driver_is_that_of_a_force_on_the_relative_motion():
    """Kanai and Tajimi: a displacement driver differentiates twice, and the relative motion has the filtered noise."""
    a, b, c = [[-2.0, -40.0, -9.0], [1.0, 0, 0], [0, 1.0, 0]], [1.0, 0, 0], [0, 0, 1.0]
    ground = RandomProcess("ground", filter=(a, b, c), units="m")
    mechanism = uqmbd.Mechanism("base", uqmbd.Planar())
    floor = mechanism.body("floor", mass=5, inertia=1)
    mass = mechanism.body("mass", mass=2, inertia=1, position=(1, 0))
    for body in (floor, mass):
        name = f"{body.name} guide"
        mechanism.add(Prismatic(name, mechanism.ground, body, (0, 0), (0, 0), axis_i=(1, 0), axis_j=(1, 0)))
    mechanism.add(
        PositionDriver("motion", mechanism.ground, floor, (0, 0), (0, 0), axis_i=(1, 0), displacement=ground())
    )
    mechanism.add(SpringDamper("spring", floor, mass, (0, 0), (0, 0), stiffness=30, damping=2, free_length=1))
    relative = mass.position[0] - floor.position[0]
    found = values(mechanism, r=stationary_std(relative), a=stationary_std(mass.acceleration[0]))
    # r'' + r' + 15 r = -w'', w'' = (2 w'' is the first state of the filter's second derivative)
    system = np.zeros((5, 5))
    system[:3, :3] = a
    system[3, 4], system[4, 3], system[4, 4] = 1, -15, -1
    system[4, :3] = [-1, 0, 0]
    noise = np.diag([1.0, 0, 0, 0, 0])
    # the filter's states are (w'', w', w)
    covariance = solve_continuous_lyapunov(system, -noise)
    absolute = np.array([0, 0, 0, -15.0, -1.0])
    assert found == pytest.approx([np.sqrt(covariance[3, 3]), np.sqrt(absolute @ covariance @ absolute)], rel=1e-8)


def test_two_wheels_on_one_track_see_the_road_with_a_delay():
    """Half car without pitch: two springs on one road; quadrature of the delayed sum by SciPy."""
    car = uqmbd.Mechanism("half", uqmbd.Line(gravity=-9.81))
    body = car.body("body", mass=500, position=0.5)
    for name, lead in (("front", 0.0), ("rear", -2.5)):
        tyre = RadialTyre(
            name, car.ground, body, 0, road=ROAD(SPEED * uqmbd.t + lead), radius=0.6, stiffness=2e4, damping=0,
            transition=1e-9,
        )  # fmt: skip
        car.add(tyre)
    car.add(SpringDamper("damper", car.ground, body, 0, 0, stiffness=0, damping=2e3, free_length=0.5))
    found = values(car, x=stationary_std(body.position[0]))

    def density(w):
        h = 2e4 / (-500 * w**2 + 2e3 * 1j * w + 4e4) * (1 + np.exp(-2.5j * w / SPEED))
        return 2 * abs(h) ** 2 * 0.01**2 * 5 / np.pi / SPEED / (1 + (5 * w / SPEED) ** 2)

    bounds = [0, 5, 9, 15, 40, 400]
    exact = sum(quad(density, x, y, epsrel=1e-10, limit=500)[0] for x, y in zip(bounds[:-1], bounds[1:], strict=True))
    assert found == pytest.approx([np.sqrt(exact)], rel=1e-5)


def test_wind_at_two_points_is_coherent_in_part():
    """The sum of two forces on one mass; quadrature of ``2 |H|^2 (1 + coherence) S`` by SciPy."""
    spectrum = kaimal(1.5, 340.2, 12.0)
    wind = RandomProcess("wind", psd=spectrum, units="m/s", coherence=davenport_coherence(10.0, 12.0))
    mechanism, mass = oscillator(5.0 * wind.at(0, 20)() + 5.0 * wind.at(0, 26)())

    def density(w):
        h = 5 / (9 - w**2 + 0.6j * w)
        return 4 * abs(h) ** 2 * (1 + np.exp(-10 * w / (2 * np.pi) * 6 / 12)) * spectrum.two_sided(np.array([w]))[0]

    bounds = [0, 0.05, 0.3, 1, 2.5, 2.9, 3.1, 3.5, 6, 30, 3000]
    parts = [quad(density, x, y, epsrel=1e-10, limit=400)[0] for x, y in zip(bounds[:-1], bounds[1:], strict=True)]
    assert values(mechanism, x=stationary_std(mass.position[0])) == pytest.approx([np.sqrt(sum(parts))], rel=1e-6)
    same, mass = oscillator(5.0 * wind.at(0, 20)() + 5.0 * wind.at(0, 20)())
    alone, other = oscillator(10.0 * RandomProcess("wind", psd=spectrum, units="m/s")())
    one, two = values(same, x=stationary_std(mass.position[0])), values(alone, x=stationary_std(other.position[0]))
    assert one == pytest.approx(two, rel=1e-9)


def test_a_field_needs_a_coherence_and_points():
    with pytest.raises(uqmbd.StudyError, match="the process has no coherence"):
        white().at(1, 2)
    wind = RandomProcess("wind", psd=kaimal(1.5, 340.2, 12.0), coherence=davenport_coherence(10.0, 12.0))
    with pytest.raises(uqmbd.StudyError, match="expected finite coordinates"):
        wind.at()


def test_sums_of_independent_processes_are_correlated():
    """``w2 = r w1 + sqrt(1 - r^2) w3``: the variance of the response to both has the term 2 r."""
    one, three = white()(), RandomProcess("third", psd=white_noise(0.1, sided="two", per="rad/s"), units="N")()
    mechanism, mass = oscillator(one + (0.6 * one + 0.8 * three))
    exact = np.sqrt((2 + 2 * 0.6) * np.pi * 0.1 / (0.6 * 9))
    assert values(mechanism, x=stationary_std(mass.position[0])) == pytest.approx([exact], rel=1e-8)


def test_fatigue_of_a_narrow_band_is_that_of_rayleigh_and_dirlik_agrees():
    """A lightly damped oscillator: Dirlik's sum is within a few per cent of the narrow band, which is an upper bound."""
    shape = RandomProcess("shape", filter=([[-9.0, -20.0], [1.0, 0.0]], [1.0, 0.0], [0.0, 1.0]), units="N")
    mechanism, mass = oscillator(shape(), damping=0.02)
    x, of = 1e6 * mass.position[0], {"exponent": 5.0, "coefficient": 1e30}
    narrow, dirlik, s, v = values(
        mechanism,
        narrow=fatigue_damage(x, 3600.0, rule="narrow_band", **of),
        dirlik=fatigue_damage(x, 3600.0, **of),
        s=stationary_std(x),
        v=stationary_std(1e6 * mass.velocity[0]),
    )
    exact = v / s / (2 * np.pi) * 3600 * (2 * np.sqrt(2) * s) ** 5 * gamma(3.5) / 1e30
    assert narrow == pytest.approx(exact, rel=1e-9)
    assert 0.85 * narrow < dirlik < 1.02 * narrow


def test_deviations_are_those_of_simulated_paths():
    """Sampled independently: the exact discretisation of the whole linear system over 20,000 s."""
    rng = np.random.default_rng(1)
    a, b, _, _ = matrices()
    whole = np.block([[a, b[:, None]], [np.zeros((1, 4)), np.array([[-4.0]])]])
    noise = np.zeros((5, 5))
    noise[4, 4] = 8e-4
    covariance = solve_continuous_lyapunov(whole, -noise)
    step = expm(whole * 0.05)
    root = np.linalg.cholesky(covariance - step @ covariance @ step.T + 1e-18 * np.eye(5))
    states = np.zeros((2000, 5))
    total, count = 0.0, 0
    for k in range(400):
        states = states @ step.T + rng.normal(size=states.shape) @ root.T
        if k >= 200:
            total, count = total + (states[:, 0] ** 2).sum(), count + len(states)
    car, seen = quarter_car()
    assert np.sqrt(total / count) == pytest.approx(values(car, x=stationary_std(seen["height"]))[0], rel=0.01)


@pytest.mark.parametrize(
    "make, quantity, message",
    [
        (lambda: quarter_car(damping=100.0), "force", "tyre.reaction_force.* has no variance.*'road' contains white"),
        (
            lambda: quarter_car(RandomProcess("road", psd=iso8608("C"), over="distance", units="m")),
            "height",
            "body.x has no variance.*'road' does not decay towards low frequencies",
        ),
        (
            lambda: quarter_car(
                RandomProcess("road", psd=replace(kaimal(1, 9, 2), units="m"), over="time", units="m"), damping=100.0
            ),
            "force",
            "does not decay towards high frequencies",
        ),
    ],
)
def test_a_response_without_a_variance_is_refused_by_name(make, quantity, message):
    car, seen = make()
    car.output("x", stationary_std(seen[quantity]))
    with pytest.raises(uqmbd.AssemblyError, match=message):
        uqmbd.simulate(car, [0, 1])


def test_crossings_of_a_response_with_a_white_rate_are_refused():
    mechanism, mass = oscillator(white()())
    mechanism.output("x", crossing_rate(mass.velocity[0], 0.0))
    with pytest.raises(uqmbd.AssemblyError, match="mass.x' has no variance of its rate"):
        uqmbd.simulate(mechanism, [0, 1])


def test_an_undamped_or_unstable_pose_is_refused():
    mechanism, mass = oscillator(white()(), damping=0)
    mechanism.output("x", stationary_std(mass.position[0]))
    with pytest.raises(uqmbd.AssemblyError, match="excite a motion that does not decay"):
        uqmbd.simulate(mechanism, [0, 1])
    mechanism, mass = oscillator(white()(), damping=-1)
    mechanism.output("x", stationary_std(mass.position[0]))
    with pytest.raises(uqmbd.AssemblyError, match="pose of the linearisation is unstable"):
        uqmbd.simulate(mechanism, [0, 1])


def test_a_rigid_body_motion_that_is_not_excited_does_not_matter():
    mechanism = uqmbd.Mechanism("plane", uqmbd.Translational())
    mass = mechanism.body("mass", mass=1, position=(0, 1))
    spring = -9 * (mass.position[1] - 1) - 0.6 * mass.velocity[1]
    mechanism.add(PointForce("load", mass, (0, 0), (0, white()() + spring)))
    mechanism.output("x", stationary_std(mass.position[1], at="start"))
    found = float(uqmbd.simulate(mechanism, [0, 1])["x"])
    assert found == pytest.approx(np.sqrt(np.pi * 0.1 / 5.4), rel=1e-7)


def test_white_noise_has_no_motion_in_time():
    mechanism, mass = oscillator(white()())
    mechanism.output("x", mass.position[0])
    with pytest.raises(uqmbd.StudyError, match="'force': the process has no finite variance, like white noise"):
        uqmbd.simulate(mechanism, [0, 1])


def test_two_processes_need_two_names():
    mechanism, mass = oscillator(white()() + white(0.2)())
    mechanism.output("x", stationary_std(mass.position[0]))
    with pytest.raises(uqmbd.StudyError, match="two different random processes have the name 'force'"):
        uqmbd.simulate(mechanism, [0, 1])


def test_a_mechanism_without_a_process_has_no_stationary_response():
    mechanism, mass = oscillator(3.0)
    mechanism.output("x", stationary_std(mass.position[0]))
    with pytest.raises(uqmbd.StudyError, match="no component of the mechanism contains one"):
        uqmbd.simulate(mechanism, [0, 1])
