"""The linearised equations with excitations: joints, reactions, random speeds, start times, means, other packages."""

from dataclasses import dataclass

import chaospy
import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_drivers import LinearSpeedDriver, PositionDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Fixed, Prismatic, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import RandomProcess, exponential_covariance, stationary_psd, stationary_std, white_noise
from uqmbd_processes.checks import UnusedProcesses
from uqmbd_springs import PointForce, SpringDamper, TorsionSpringDamper

FILTER = ([[-3.0, -50.0, -11.0], [1.0, 0, 0], [0, 1.0, 0]], [0.4, 0, 0], [0, 0, 1.0])
"""Of third order, so that the second rate of the process has a variance."""


def values(mechanism, times=(0, 1), **outputs):
    for name, expression in outputs.items():
        mechanism.output(name, expression)
    found = uqmbd.simulate(mechanism, list(times))
    return [float(found[name]) for name in outputs]


@pytest.mark.parametrize("space", ["plane", "space"])
def test_a_pendulum_on_a_moving_base_and_the_force_in_its_pin(space):
    """``J t'' + c t' + m g l t = -m l w''`` about the pin; the horizontal force is ``m (w'' + l t'')``."""
    m, inertia, length, c, g = 2.0, 0.3, 0.7, 0.9, 9.81
    base = RandomProcess("base", filter=FILTER, units="m")
    planar = space == "plane"
    mechanism = uqmbd.Mechanism("p", uqmbd.Planar(gravity=(0, -g)) if planar else uqmbd.Spatial(gravity=(0, 0, -g)))

    def vector(x, z):
        return (x, z) if planar else (x, 0, z)

    across = {} if planar else {"axis_i": (0, 1, 0), "axis_j": (0, 1, 0)}
    tensor = inertia if planar else (inertia, inertia, inertia)
    floor = mechanism.body("floor", mass=1, inertia=tensor)
    rod = mechanism.body("rod", mass=m, inertia=tensor, position=vector(0, -length))
    origin = vector(0, 0)
    mechanism.add(Prismatic("guide", mechanism.ground, floor, origin, origin, axis_i=vector(1, 0), axis_j=vector(1, 0)))
    mechanism.add(
        PositionDriver("motion", mechanism.ground, floor, origin, origin, axis_i=vector(1, 0), displacement=base())
    )
    pin = mechanism.add(Revolute("pin", floor, rod, origin, vector(0, length), **across))
    mechanism.add(TorsionSpringDamper("damper", floor, rod, stiffness=0, damping=c, **across))
    last = 1 if planar else 2
    found = values(
        mechanism,
        swing=stationary_std(rod.position[0] - floor.position[0]),
        force=stationary_std(pin.reaction_force[0]),
        upright=stationary_std(pin.reaction_force[last]),
    )
    whole = inertia + m * length**2
    system = np.zeros((5, 5))
    system[:3, :3] = FILTER[0]
    system[3, 4] = 1
    system[4, :] = [-m * length / whole, 0, 0, -m * g * length / whole, -c / whole]
    noise = np.zeros((5, 5))
    noise[0, 0] = 0.4**2
    covariance = solve_continuous_lyapunov(system, -noise)
    row = m * (np.array([1.0, 0, 0, 0, 0]) + length * system[4])
    exact = [length * np.sqrt(covariance[3, 3]), np.sqrt(row @ covariance @ row)]
    assert found[:2] == pytest.approx(exact, rel=1e-8)
    assert found[2] == pytest.approx(0, abs=1e-6)  # the weight does not change to first order


def oscillator(force, damping=0.6):
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=1)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=9, damping=damping, free_length=1))
    mechanism.add(PointForce("load", mass, 0, force))
    return mechanism, mass


def exact(correlation, damping=0.6):
    """Return the deviation of the oscillator under a force of the covariance ``exp(-|t| / correlation)``."""
    a = np.array([[0, 1, 0], [-9, -damping, 1], [0, 0, -1 / correlation]])
    return np.sqrt(solve_continuous_lyapunov(a, -np.diag([0, 0, 2 / correlation]))[0, 0])


def test_a_random_speed_changes_the_spectrum_of_each_realisation():
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(5, 15), units="m/s")
    road = RandomProcess("road", covariance=exponential_covariance(1.0, 4.0), over="distance", units="N")
    mechanism, mass = oscillator(road(speed * uqmbd.t - 3))
    mechanism.output("x", stationary_std(mass.position[0]))
    methods = [MonteCarlo(samples=12, seed=1), Collocation(order=6), Galerkin(order=6)]
    study = uqmbd.Study("speeds", mechanism, propagators=methods)
    tree = study.run()
    samples = tree["monte-carlo/scalars/samples"].to_dataset()
    expected = [exact(4.0 / v) for v in samples["inputs"].values[:, 0]]
    assert samples["response"].values[:, 0] == pytest.approx(expected, rel=1e-9)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    mean = sum(w / 2 * exact(4.0 / (10 + 5 * x)) for x, w in zip(nodes, weights, strict=True))
    for method in ("collocation", "galerkin"):
        assert float(tree[f"{method}/scalars/statistics"]["mean"][0]) == pytest.approx(mean, rel=1e-6), method


def test_the_start_time_and_the_pose_do_not_matter_in_a_linear_mechanism():
    road = RandomProcess("road", covariance=exponential_covariance(1.0, 4.0), over="distance", units="N", mean=3.0)
    for times, pose in (((0, 1), "equilibrium"), ((7, 8), "equilibrium"), ((7, 8), "start")):
        mechanism, mass = oscillator(road(10 * uqmbd.t))
        assert values(mechanism, times, x=stationary_std(mass.position[0], at=pose)) == pytest.approx(
            [exact(0.4)], rel=1e-9
        )
        assert values(mechanism, times, mean=uqmbd.at_equilibrium(mass.position[0])) == pytest.approx([1 + 3 / 9])


def test_a_nonlinear_spring_is_linearised_at_the_equilibrium_of_its_load():
    """A force ``x^3 - 1`` about x = 1 m has the stiffness 4 + 3 = 7 N/m."""
    noise = RandomProcess("noise", psd=white_noise(0.2, sided="two", per="rad/s"), units="N")
    mechanism = uqmbd.Mechanism("hard", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=0.9)
    x, v = mass.position[0], mass.velocity[0]
    mechanism.add(PointForce("spring", mass, 0, 5 - 4.0 * x - 1.0 * x**3 - 0.5 * v + noise()))
    assert values(mechanism, x=stationary_std(x)) == pytest.approx([np.sqrt(np.pi * 0.2 / (0.5 * 7))], rel=1e-8)


@pytest.mark.thorough
def test_workers_compute_the_same_responses():
    noise = RandomProcess("noise", psd=white_noise(0.2, sided="two", per="rad/s", band=(0, 30)), units="N")
    factor = uqmbd.RandomVariable("factor", chaospy.Uniform(1, 2), units="1")
    mechanism, mass = oscillator(factor * noise())
    mechanism.output("x", stationary_std(mass.position[0]))
    mechanism.output("s", stationary_psd(mass.position[0], 0.4))
    study = uqmbd.Study("workers", mechanism, propagators=[MonteCarlo(samples=40, seed=2)])
    one, two = study.run(), study.run(workers=2)
    first, second = (tree["monte-carlo/scalars/samples"]["response"].values for tree in (one, two))
    np.testing.assert_array_equal(first, second)


def test_a_prescribed_random_speed_is_refused():
    speed = RandomProcess("speed", covariance=exponential_covariance(1.0, 4.0), units="m/s")
    mechanism = uqmbd.Mechanism("belt", uqmbd.Planar())
    cart = mechanism.body("cart", mass=1, inertia=1)
    mechanism.add(Prismatic("guide", mechanism.ground, cart, (0, 0), (0, 0), axis_i=(1, 0), axis_j=(1, 0)))
    mechanism.add(LinearSpeedDriver("motor", mechanism.ground, cart, (0, 0), (0, 0), axis_i=(1, 0), speed=speed()))
    mechanism.output("x", stationary_std(cart.position[0], at="start"))
    with pytest.raises(uqmbd.AssemblyError, match="a random process prescribes a speed"):
        uqmbd.simulate(mechanism, [0, 1])


def test_a_fixed_body_transfers_the_force_of_its_load():
    noise = RandomProcess("noise", covariance=exponential_covariance(2.0, 4.0), units="N")
    mechanism = uqmbd.Mechanism("wall", uqmbd.Planar())
    plate = mechanism.body("plate", mass=1, inertia=1)
    wall = mechanism.add(Fixed("wall", mechanism.ground, plate, (0, 0), (0, 0)))
    mechanism.add(PointForce("load", plate, (0, 0), (noise(), 0)))
    assert values(mechanism, f=stationary_std(wall.reaction_force[0])) == pytest.approx([2.0], rel=1e-9)
    flat = RandomProcess("flat", psd=white_noise(0.5, sided="one", per="Hz", band=(2, 10)), units="N")
    mechanism.add(PointForce("other", plate, (0, 0), (0, flat())))
    assert values(mechanism, g=stationary_std(wall.reaction_force[1])) == pytest.approx([2.0], rel=1e-9)


@dataclass(frozen=True)
class Shaker:
    """An excitation of another package: only its name and units are required."""

    name: str
    units: str = "N"


@uqmbd.extend.linear_output
def gain(system, frequency):
    """Return the absolute value of the frequency response."""
    found = system.transfer(np.full((len(system), 1), frequency))
    return np.abs(found[:, 0, 0]), [""] * len(system)


def test_another_package_declares_an_output_of_the_linearised_mechanism():
    mechanism, mass = oscillator(uqmbd.extend.excitation(Shaker("shaker"), uqmbd.t))
    assert values(mechanism, g=gain(mass.position[0], 2.0)) == pytest.approx([1 / abs(9 - 4 + 1.2j)], rel=1e-12)
    with pytest.raises(uqmbd.StudyError, match="expected finite numbers"):
        gain(mass.position[0], np.nan)
    with pytest.raises(uqmbd.StudyError, match="at is the text 'rest'; expected 'equilibrium', 'start' or 'steady'"):
        gain(mass.position[0], 1.0, at="rest")


def test_a_process_that_no_output_reads_is_a_finding():
    noise = RandomProcess("gust", psd=white_noise(0.2, sided="two", per="rad/s"), units="N")
    mechanism, mass = oscillator(noise())
    mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    study = uqmbd.Study("unused", mechanism, propagators=[Collocation(order=1)])
    (finding,) = UnusedProcesses().find(study)
    assert finding.text.startswith("PointForce 'load' contains the random process 'gust', but no output depends")
    mechanism.output("x", stationary_std(mass.position[0]))
    assert not list(UnusedProcesses().find(study))


ROAD = RandomProcess("road", covariance=exponential_covariance(0.01, 5.0), over="distance", units="m")


@pytest.mark.parametrize(
    "write, text",
    [
        (lambda body: 2 * ROAD, r"without its argument; call it, such as road\(20 \* uqmbd.t\)"),
        (lambda body: 0.3 + ROAD, r"without its argument; call it, such as road\(20 \* uqmbd.t\)"),
        (lambda body: PointForce("s", body, 0, ROAD), r"'road' without its argument \(write road\(20 "),
        (lambda body: stationary_std(ROAD), r"'road' without its argument \(write road\(20 "),
        (
            lambda body: ROAD(body.position[0]),
            "The argument cannot depend on the motion of the mechanism",
        ),
        (lambda body: ROAD(uqmbd.t**2), "For several speeds, use a random variable"),
    ],
)
def test_a_process_without_a_linear_argument_is_refused_with_advice(write, text):
    mechanism = uqmbd.Mechanism("car", uqmbd.Line())
    body = mechanism.body("body", mass=1)
    with pytest.raises(uqmbd.StudyError, match=text):
        found = write(body)
        mechanism.add(found) if isinstance(found, uqmbd.Component) else None


def test_a_process_itself_is_no_output():
    mechanism = uqmbd.Mechanism("car", uqmbd.Line())
    with pytest.raises(uqmbd.StudyError, match="the expression is the random process 'road' without its argument"):
        mechanism.output("road", ROAD)
