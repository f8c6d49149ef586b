"""Coordinates of components: motions that are known without us, equal models of bodies, and what is refused."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.dynamics import build
from uqmbd.testing import check_component
from uqmbd_joints import Prismatic, Revolute
from uqmbd_springs import SpringDamper

TIMES = np.linspace(0, 1, 6)


class Pipe(uqmbd.Component):
    """A column of fluid in a pipe between a piston and an accumulator."""

    bodies, spaces = ("body",), (uqmbd.Line,)
    inertance = uqmbd.Parameter("kg/m^4", "mass of the fluid over the square of the area", minimum=0, exclusive=True)
    stiffness = uqmbd.Parameter("Pa/m^3", "pressure of the accumulator per volume", minimum=0)
    area = uqmbd.Parameter("m^2", "area of the piston", minimum=0)

    def coordinates(self):
        """Return the volume that entered the accumulator."""
        return {"volume": uqmbd.extend.Coordinate("m^3")}

    def terms(self, p):
        """Yield the inertia of the fluid, the accumulator, and the piston that moves the fluid."""
        volume, flow = p.coordinate("volume"), p.coordinate("volume", 1)
        yield uqmbd.Kinetic(p.inertance * flow**2 / 2)
        yield uqmbd.Potential(p.stiffness * volume**2 / 2)
        yield uqmbd.Constraint(volume - p.area * p.body.position[0], "continuity")


class Rotor(uqmbd.Component):
    """A rotor of a torsional train."""

    bodies, spaces = (), (uqmbd.Line,)
    inertia = uqmbd.Parameter("kg m^2", "second moment of mass", minimum=0, exclusive=True)
    start = uqmbd.Parameter("rad", "angle at the start", default=0)
    speed = uqmbd.Parameter("rad/s", "speed at the start", default=0)

    def coordinates(self):
        """Return the angle."""
        return {"angle": uqmbd.extend.Coordinate("rad", initial=self.start, rate=self.speed)}

    def terms(self, p):
        """Yield the kinetic energy."""
        yield uqmbd.Kinetic(p.inertia * p.coordinate("angle", 1) ** 2 / 2)


class Shaft(uqmbd.Component):
    """An elastic shaft between two angles."""

    bodies, spaces = (), (uqmbd.Line,)
    stiffness = uqmbd.Parameter("N m/rad", "torsional stiffness", minimum=0)
    angle_i = uqmbd.Parameter("rad", "angle of its first end")
    angle_j = uqmbd.Parameter("rad", "angle of its second end")

    def terms(self, p):
        """Yield the elastic energy."""
        yield uqmbd.Potential(p.stiffness * (p.angle_j - p.angle_i) ** 2 / 2)


class Mesh(uqmbd.Component):
    """A pair of gears between two angles."""

    bodies, spaces = (), (uqmbd.Line,)
    ratio = uqmbd.Parameter("1", "turns of the first angle for each turn of the second")
    angle_i = uqmbd.Parameter("rad", "first angle")
    angle_j = uqmbd.Parameter("rad", "second angle")

    def terms(self, p):
        """Yield the constraint."""
        yield uqmbd.Constraint(p.angle_i - p.ratio * p.angle_j, "mesh")


class Stop(uqmbd.Component):
    """An elastic or plastic stop of an angle."""

    bodies, spaces = (), (uqmbd.Line,)
    angle = uqmbd.Parameter("rad", "angle")
    limit = uqmbd.Parameter("rad", "largest angle")
    restitution = uqmbd.Parameter("1", "coefficient of restitution", minimum=0, maximum=1)

    def terms(self, p):
        """Yield the impact."""
        gap = p.let("gap", p.limit - p.angle)
        yield uqmbd.Event(gap, uqmbd.extend.Impact(p.rate_of(gap), restitution=p.restitution))


class Telescope(uqmbd.Component):
    """A mass on a spring that slides along the x axis of a body."""

    bodies, spaces = ("body",), (uqmbd.Planar,)
    mass = uqmbd.Parameter("kg", "mass of the tip", minimum=0, exclusive=True)
    stiffness = uqmbd.Parameter("N/m", "spring rate", minimum=0)
    length = uqmbd.Parameter("m", "length of the relaxed spring")
    gravity = uqmbd.Parameter("m/s^2", "acceleration of gravity", kind="vector")

    def coordinates(self):
        """Return the extension."""
        return {"extension": uqmbd.extend.Coordinate("m", initial=self.length)}

    def terms(self, p):
        """Yield the energies."""
        extension = p.coordinate("extension")
        place = p.body.position + p.body.rotation * sympy.Matrix([extension, 0])
        rate = p.rate_of(place)
        weight = p.mass * sympy.Matrix(p.gravity).dot(place)
        yield uqmbd.Kinetic(p.mass * rate.dot(rate) / 2)
        yield uqmbd.Potential(p.stiffness * (extension - p.length) ** 2 / 2 - weight)


def train(stiffness):
    """Return three equal rotors in a row, of which the first is turned by 0.1 rad."""
    mechanism = uqmbd.Mechanism("train", uqmbd.Line())
    rotors = [mechanism.add(Rotor(f"rotor {k}", inertia=1, start=0.1 * (k == 0))) for k in range(3)]
    for k in range(2):
        ends = [rotor.coordinate("angle") for rotor in rotors[k : k + 2]]
        mechanism.add(Shaft(f"shaft {k}", stiffness, *ends))
    mechanism.output("angle", rotors[0].coordinate("angle"), units="rad")
    mechanism.output("acceleration", rotors[0].coordinate("angle", 2), units="rad/s^2")
    return mechanism, rotors


@pytest.mark.parametrize("integrator", ["auto", "ida"])
def test_a_fluid_column_adds_its_inertance_to_a_piston(integrator):
    """The flow is the area times the speed, so the fluid adds the mass ``L A^2`` and the stiffness ``k A^2``."""
    mechanism = uqmbd.Mechanism("hydraulics", uqmbd.Line())
    piston = mechanism.body("piston", mass=2, velocity=0.3)
    pipe = mechanism.add(Pipe("pipe", piston, inertance=3e6, stiffness=5e8, area=1e-3))
    mechanism.output("volume", pipe.coordinate("volume"), units="m^3")
    mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    omega = np.sqrt(5e8 * 1e-6 / (2 + 3e6 * 1e-6))
    found = uqmbd.simulate(mechanism, TIMES, rtol=1e-9, integrator=integrator)
    assert np.allclose(found["volume"], 0.3e-3 / omega * np.sin(omega * TIMES), atol=1e-11)
    assert np.isclose(2 * np.pi * found["frequency"], omega, rtol=1e-10)
    assert uqmbd.check(mechanism).mobility == 1


def test_a_torsional_train_without_bodies_moves_as_its_closed_form():
    mechanism, _ = train(100)
    for k in (1, 2):
        mechanism.output(f"f{k}", uqmbd.eigenfrequency(k), units="Hz")
    slow, fast = 10.0, np.sqrt(300)
    for integrator in ("auto", "ida"):
        found = uqmbd.simulate(mechanism, TIMES, rtol=1e-9, integrator=integrator)
        exact = 0.1 * (1 / 3 + np.cos(slow * TIMES) / 2 + np.cos(fast * TIMES) / 6)
        assert np.allclose(found["angle"], exact, atol=1e-8)
        rate = -0.1 * (slow**2 * np.cos(slow * TIMES) / 2 + fast**2 * np.cos(fast * TIMES) / 6)
        assert np.allclose(found["acceleration"], rate, atol=1e-5)
        assert np.allclose([2 * np.pi * float(found[f"f{k}"]) for k in (1, 2)], [slow, fast], rtol=1e-9)


@pytest.mark.thorough
def test_samples_and_both_expansions_agree_on_the_spread_of_a_train():
    from uqmbd_collocation import Collocation
    from uqmbd_galerkin import Galerkin
    from uqmbd_montecarlo import MonteCarlo

    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(80, 120), units="N m/rad")
    mechanism, _ = train(stiffness)
    methods = [MonteCarlo(samples=2000), Collocation(order=5), Galerkin(order=5)]
    tree = uqmbd.Study("train", mechanism, TIMES, propagators=methods).run()
    spread = {name: tree[name]["statistics"]["std"].sel(output="angle").to_numpy() for name in tree.children if name in
              ("monte-carlo", "collocation", "galerkin")}  # fmt: skip
    assert np.allclose(spread["collocation"], spread["galerkin"], rtol=1e-3, atol=1e-6)
    assert np.allclose(spread["monte-carlo"], spread["galerkin"], rtol=0.06, atol=1e-6)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    slow, fast = np.sqrt(100 + 20 * nodes), np.sqrt(300 + 60 * nodes)
    end = 0.1 * (1 / 3 + np.cos(slow) / 2 + np.cos(fast) / 6)
    exact = np.sqrt(weights @ end**2 / 2 - (weights @ end / 2) ** 2)
    assert np.isclose(spread["galerkin"][-1], exact, rtol=1e-3)


def geared(start_i, start_j):
    """Return two rotors that a pair of gears connects; a shaft holds the first one."""
    mechanism = uqmbd.Mechanism("geared", uqmbd.Line())
    rotors = [
        mechanism.add(Rotor(name, inertia, start)) for name, inertia, start in (("i", 1, start_i), ("j", 2, start_j))
    ]
    mechanism.add(Mesh("mesh", 2, *(rotor.coordinate("angle") for rotor in rotors)))
    mechanism.add(Shaft("shaft", 9, rotors[0].coordinate("angle"), 0))
    mechanism.output("angle", rotors[0].coordinate("angle"), units="rad")
    mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    return mechanism


@pytest.mark.filterwarnings("ignore:.*assembly changed the initial value of coordinate 'i.angle' by 0.04 rad")
def test_a_constraint_between_coordinates_of_components_is_assembled_and_kept():
    mechanism = geared(0.2, 0.0)
    omega = np.sqrt(9 / (1 + 2 / 4))
    for integrator in ("auto", "ida"):
        found = uqmbd.simulate(mechanism, TIMES, rtol=1e-9, integrator=integrator)
        start = float(found["angle"][0])
        assert np.isclose(start, 0.16, rtol=1e-9)  # the nearest point of the constraint
        assert np.allclose(found["angle"], start * np.cos(omega * TIMES), atol=1e-8)
    assert np.isclose(2 * np.pi * found["frequency"], omega, rtol=1e-9)
    checked = uqmbd.check(mechanism)
    assert (checked.coordinates, checked.rank, checked.mobility) == (2, 1, 1)
    assert [str(x) for x in checked.moved] == ["'i.angle' by 0.04 rad"]
    assert not uqmbd.check(geared(0.2, 0.1)).moved


def test_an_impact_of_a_coordinate_of_a_component():
    mechanism = uqmbd.Mechanism("stop", uqmbd.Line())
    rotor = mechanism.add(Rotor("rotor", inertia=1, speed=1))
    stop = mechanism.add(Stop("stop", rotor.coordinate("angle"), limit=0.15, restitution=0.5))
    mechanism.output("angle", rotor.coordinate("angle"), units="rad")
    mechanism.output("first", stop.event_time("impact"), units="s")
    found = uqmbd.simulate(mechanism, [0, 0.1, 0.15, 0.25])
    assert np.allclose(found["angle"], [0, 0.1, 0.15, 0.1], atol=1e-9)
    assert np.isclose(found["first"], 0.15)


def test_start_conditions_and_summaries_contain_coordinates_of_components():
    mechanism = uqmbd.Mechanism("start", uqmbd.Line())
    rotor = mechanism.add(Rotor("rotor", inertia=1, speed=0))
    mechanism.add(Shaft("shaft", 4, rotor.coordinate("angle"), 0))
    mechanism.start(rotor.coordinate("angle"), 0.3)
    mechanism.output("angle", rotor.coordinate("angle"), units="rad")
    mechanism.output("lowest", uqmbd.minimum(rotor.coordinate("angle")), units="rad")
    found = uqmbd.simulate(mechanism, np.linspace(0, 2, 5), rtol=1e-9)
    assert np.allclose(found["angle"], 0.3 * np.cos(2 * np.linspace(0, 2, 5)), atol=1e-8)
    assert np.isclose(found["lowest"], -0.3, rtol=1e-6)


def crane(*, frames):
    """Return a pendulum with a mass that slides on it, which a spring pulls: by a coordinate, or by a second body."""
    mechanism = uqmbd.Mechanism("crane", uqmbd.Planar(gravity=(0, -9.81)))
    arm = mechanism.body("arm", mass=1, inertia=0.1)
    mechanism.add(Revolute("pin", mechanism.ground, arm, (0, 0), (0, 0)))
    if frames:
        telescope = mechanism.add(Telescope("telescope", arm, mass=2, stiffness=200, length=1, gravity=(0, -9.81)))
        tip = uqmbd.extend.AttachedFrame("tip", arm, (telescope.coordinate("extension"), 0))
    else:
        tip = mechanism.body("tip", mass=2, inertia=0, position=(1, 0))
        mechanism.add(Prismatic("slide", arm, tip, (0, 0), (0, 0), (1, 0), (1, 0)))
        mechanism.add(SpringDamper("spring", arm, tip, (-100, 0), (0, 0), stiffness=200, free_length=101))
    mechanism.add(
        SpringDamper("rope", mechanism.ground, tip, (1, 1), (0, 0), stiffness=30, free_length=0.5, damping=0.5)
    )
    for k, name in enumerate("xy"):
        mechanism.output(name, tip.position[k], units="m")
        mechanism.output(f"a{name}", tip.acceleration[k], units="m/s^2")
        mechanism.output(f"{name} at rest", uqmbd.at_equilibrium(tip.position[k]), units="m")
        mechanism.output(f"f{k}", uqmbd.eigenfrequency(k + 1), units="Hz")
        mechanism.output(f"force {name}", mechanism.components["pin"].reaction_force[k], units="N")
    mechanism.output("angle", arm.angle, units="rad")
    return mechanism


@pytest.mark.parametrize("integrator", ["auto", "ida"])
def test_an_attached_frame_moves_and_loads_as_a_second_body(integrator):
    """The same mechanism twice: positions, accelerations, reactions, rest, modes."""
    one, two = (
        uqmbd.simulate(crane(frames=frames), TIMES, rtol=1e-9, integrator=integrator) for frames in (True, False)
    )
    for name in one.data_vars:
        assert np.allclose(one[name], two[name], rtol=1e-6, atol=1e-7), name


def test_the_check_of_components_accepts_and_refuses():
    for component in (Pipe, Rotor, Telescope):
        check_component(component, propagators=())

    class Massless(Rotor):
        """A rotor whose angle has a spring instead of inertia."""

        speed = uqmbd.Parameter("N m/rad", "torsional stiffness")

        def coordinates(self):
            """Return the angle."""
            return {"angle": uqmbd.extend.Coordinate("rad", initial=self.start)}

        def terms(self, p):
            """Yield the elastic energy, and the inertia of another coordinate."""
            yield uqmbd.Potential(p.speed * p.coordinate("angle") ** 2 / 2)
            yield uqmbd.Constraint(p.inertia * p.coordinate("angle"))

    with pytest.raises(AssertionError, match="coordinate 'trial.angle' has no kinetic energy; yield a uqmbd.Kinetic"):
        check_component(Massless, propagators=())

    class Negative(Rotor):
        """A rotor with negative inertia."""

        def terms(self, p):
            """Yield a negative energy."""
            yield uqmbd.Kinetic(-p.inertia * p.coordinate("angle", 1) ** 2 / 2)

    with pytest.raises(AssertionError, match="negative kinetic energy"):
        check_component(Negative, propagators=())

    class Units(Rotor):
        """A rotor whose energy has the units of an angular momentum."""

        def terms(self, p):
            """Yield an energy in other units than J."""
            yield uqmbd.Kinetic(p.inertia * p.coordinate("angle", 1) / 2)

    with pytest.raises(AssertionError, match="in kg m\\^2"):
        check_component(Units, propagators=())


def declared(coordinates, terms=lambda p: [uqmbd.Kinetic(p.coordinate("x", 1) ** 2 / 2)]):
    """Return a component with coordinates and terms."""
    members = {"bodies": (), "spaces": (uqmbd.Line,), "coordinates": lambda self: coordinates}
    return type("Made", (uqmbd.Component,), {**members, "terms": lambda self, p: terms(p)})("made")


@pytest.mark.parametrize(
    ("coordinates", "message"),
    [
        ([1], "coordinates\\(\\) returned"),
        ({"x": 1}, "is 1; expected uqmbd.extend.Coordinate"),
        ({"x": uqmbd.extend.Coordinate("m", initial="far")}, "initial"),
        ({"x": uqmbd.extend.Coordinate("m", initial=(1, 2))}, "expected 1"),
        ({1: uqmbd.extend.Coordinate("m")}, "coordinate"),
    ],
)
def test_invalid_declarations_are_refused(coordinates, message):
    mechanism = uqmbd.Mechanism("bad", uqmbd.Line())
    with pytest.raises(uqmbd.StudyError, match=message):
        mechanism.add(declared(coordinates))


def test_unknown_coordinates_and_derivatives_are_refused():
    made = declared({"x": uqmbd.extend.Coordinate("m")})
    with pytest.raises(uqmbd.StudyError, match="has not been added to a mechanism"):
        made.coordinate("x")
    mechanism = uqmbd.Mechanism("bad", uqmbd.Line())
    mechanism.add(made)
    with pytest.raises(uqmbd.StudyError, match="no such coordinate.* Its coordinates are: 'x'"):
        made.coordinate("y")
    with pytest.raises(uqmbd.StudyError, match="the derivative is 3; expected 0, 1 or 2"):
        made.coordinate("x", 3)
    other = uqmbd.Mechanism("other", uqmbd.Line())
    rotor = other.add(Rotor("made", inertia=1))
    with pytest.raises(uqmbd.StudyError, match="belongs to another mechanism"):
        mechanism.output("angle", rotor.coordinate("angle"), units="rad")


def test_a_coordinate_without_inertia_is_named():
    mechanism = uqmbd.Mechanism("bad", uqmbd.Line())
    made = mechanism.add(declared({"x": uqmbd.extend.Coordinate("m")}, lambda p: [uqmbd.Potential(p.coordinate("x"))]))
    mechanism.output("x", made.coordinate("x"), units="m")
    with pytest.raises(uqmbd.StudyError, match="coordinate 'x' of 'made' can be accelerated without any force"):
        build(mechanism)


def test_a_steady_motion_with_coordinates_of_components_is_refused():
    mechanism, _ = train(100)
    mechanism.output("damping", uqmbd.at_steady(mechanism.components["rotor 0"].coordinate("angle")), units="rad")
    with pytest.raises(uqmbd.UqmbdError, match="steady motions with coordinates of components"):
        uqmbd.simulate(mechanism, TIMES)


def test_a_random_start_of_a_coordinate_is_an_input():
    start = uqmbd.RandomVariable("start", chaospy.Uniform(0.1, 0.2), units="rad")
    mechanism = uqmbd.Mechanism("random", uqmbd.Line())
    rotor = mechanism.add(Rotor("rotor", inertia=1, start=start))
    mechanism.output("angle", rotor.coordinate("angle"), units="rad")
    assert mechanism.inputs.names == ("start",)
    assert np.isclose(uqmbd.simulate(mechanism, TIMES)["angle"][-1], 0.15)
