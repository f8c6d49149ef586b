"""Dead centres are named: poses that cannot be closed, velocities that cannot be realised, equations left out there."""

from __future__ import annotations

import re
import warnings

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.dynamics.assembly import assembly
from uqmbd.dynamics.model_building import build
from uqmbd_drivers import PositionDriver, RotationDriver
from uqmbd_joints import Distance, Fixed, Prismatic, Revolute, Spherical

TIMES = [0, 0.01]
QUICK = [*range(3), *(pytest.param(k, marks=pytest.mark.thorough) for k in range(3, 12))]


def along(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def bar(mechanism, name, begin, end, **about):
    """A bar from one point to another, with its centre in the middle."""
    d = np.subtract(end, begin)
    return mechanism.body(
        name, mass=1, inertia=0.01, position=tuple(np.add(begin, end) / 2), angle=float(np.arctan2(d[1], d[0])), **about
    )


def slider_crank(rng, *, folded, angle=0.0, beyond=None, size=1.0, less=0.0, **speeds):
    """Crank, rod and slider on a line of any direction; `angle` out of the dead centre; the slider is prescribed.

    Its place is `beyond` cranks out of reach, `less` this length.
    """
    crank, rod = size * rng.uniform(0.05, 0.5), size * rng.uniform(0.6, 2.0)
    line = rng.uniform(0, 2 * np.pi)
    turn = angle + (np.pi if folded else 0.0)
    pin = crank * along(line + turn)
    tilt = -np.arcsin(crank * np.sin(turn) / rod)
    wrist = pin + rod * along(line + tilt)
    mechanism = uqmbd.Mechanism("engine", uqmbd.Planar())
    a = bar(mechanism, "crank", (0, 0), pin, **speeds.get("crank", {}))
    b = bar(mechanism, "rod", pin, wrist)
    direction = tuple(along(line).tolist())
    about = {"velocity": tuple((speeds["slider"] * along(line)).tolist())} if "slider" in speeds else {}
    c = mechanism.body("piston", mass=1, inertia=0.01, position=tuple(wrist), angle=line, **about)
    mechanism.add(Revolute("main", mechanism.ground, a, (0, 0), (-crank / 2, 0)))
    mechanism.add(Revolute("pin", a, b, (crank / 2, 0), (-rod / 2, 0)))
    mechanism.add(Revolute("wrist", b, c, (rod / 2, 0), (0, 0)))
    mechanism.add(Prismatic("guide", mechanism.ground, c, (0, 0), (0, 0), direction, (1, 0)))
    if beyond is not None:
        reach = rod - crank if folded else rod + crank
        outwards = -1 if folded else 1
        place = reach + outwards * (beyond * crank - less)
        mechanism.add(PositionDriver("cylinder", mechanism.ground, c, (0, 0), (0, 0), direction, place))
    mechanism.output("x", c.position[0], units="m")
    mechanism.output("turning", a.angular_velocity, units="rad/s")
    return mechanism


def four_bar(rng, *, speed):
    """A four-bar whose crank and coupler are in line, so that the rocker turns back; its speed is stated."""
    while True:
        crank, coupler, rocker, base = rng.uniform(0.1, 0.3), *rng.uniform(0.4, 1.0, 3)
        sign = rng.choice([-1, 1])
        reach = coupler + sign * crank
        cosine = (reach**2 + base**2 - rocker**2) / (2 * reach * base)
        if abs(cosine) < 0.9 and abs((rocker**2 + reach**2 - base**2) / (2 * rocker * reach)) < 0.9:
            break
    end = reach * along(np.arccos(cosine))
    pin = sign * crank * end / reach
    mechanism = uqmbd.Mechanism("four-bar", uqmbd.Planar())
    a = bar(mechanism, "crank", (0, 0), pin)
    b = bar(mechanism, "coupler", pin, end)
    c = bar(mechanism, "rocker", end, (base, 0), angular_velocity=speed)
    mechanism.add(Revolute("O", mechanism.ground, a, at=(0, 0)))
    mechanism.add(Revolute("A", a, b, at=tuple(pin)))
    mechanism.add(Revolute("B", b, c, at=tuple(end)))
    mechanism.add(Revolute("G", mechanism.ground, c, at=(base, 0)))
    mechanism.output("x", b.position[0], units="m")
    return mechanism


def spatial_loop(rng, *, speed):
    """Crank, coupler on ball joints, rocker: the coupler is in the plane of the crank and its axis, and pulls in vain."""

    def unit():
        x = rng.normal(size=3)
        return x / np.linalg.norm(x)

    while True:
        axis, other = unit(), unit()
        a = np.cross(axis, unit())
        a *= rng.uniform(0.1, 0.4) / np.linalg.norm(a)
        d = rng.uniform(-2, 2) * a + rng.uniform(-1, 1) * axis
        lever = np.cross(other, unit())
        lever *= rng.uniform(0.3, 1.0) / np.linalg.norm(lever)
        b, push = a + d, abs(np.cross(other, lever) @ d)
        if push > 0.3 * np.linalg.norm(d) * np.linalg.norm(lever) and np.linalg.norm(d) > 0.2:
            break
    mechanism = uqmbd.Mechanism("loop", uqmbd.Spatial())
    middle = ((0, 0, 0) + a) / 2, (a + b) / 2, b - lever / 2
    inertia = (0.01, 0.01, 0.01)
    crank = mechanism.body("crank", mass=1, inertia=inertia, position=tuple(middle[0]))
    coupler = mechanism.body("coupler", mass=1, inertia=inertia, position=tuple(middle[1]))
    rocker = mechanism.body(
        "rocker", mass=1, inertia=inertia, position=tuple(middle[2]), angular_velocity=tuple(speed * other)
    )
    mechanism.add(Revolute("O", mechanism.ground, crank, at=(0, 0, 0), axis=tuple(axis)))
    mechanism.add(Spherical("A", crank, coupler, at=tuple(a)))
    mechanism.add(Spherical("B", coupler, rocker, at=tuple(b)))
    mechanism.add(Revolute("G", mechanism.ground, rocker, at=tuple(b - lever), axis=tuple(other)))
    mechanism.output("x", coupler.position[0], units="m")
    return mechanism


def refusal(mechanism, integrator="auto"):
    with pytest.raises(uqmbd.AssemblyError) as caught:
        uqmbd.simulate(mechanism, TIMES, integrator=integrator)
    return str(caught.value)


@pytest.mark.parametrize("seed", QUICK)
@pytest.mark.parametrize("folded", [False, True])
def test_what_is_out_of_reach_is_named(seed, folded):
    """The remedy is tried: by a little more than what is missing a length is changed, and the pose drawn bent."""
    beyond = 10 ** np.random.default_rng(seed).uniform(-6, -2)
    text = refusal(slider_crank(np.random.default_rng(seed), folded=folded, beyond=beyond))
    assert "dead centre" in text and "out of reach" in text, text
    assert "body 'crank'" in text and "body 'rod'" in text and "'pin'" in text and "'wrist'" in text
    crank = np.random.default_rng(seed).uniform(0.05, 0.5)
    missing = missing_length(text)
    assert abs(missing / (beyond * crank) - 1) < 0.06
    drawn = slider_crank(np.random.default_rng(seed), folded=folded, beyond=beyond, angle=0.05, less=1.1 * missing)
    uqmbd.simulate(drawn, TIMES, integrator="dop853")


def missing_length(text):
    found = re.search(r"about (\S+) m are missing", text)
    assert found is not None, text
    return float(found[1])


@pytest.mark.parametrize("gap", [pytest.param(1e-4, marks=pytest.mark.thorough), 0.3])
@pytest.mark.parametrize("bent", [pytest.param(0.0, marks=pytest.mark.thorough), 0.3])
def test_only_small_gaps_may_be_of_rounding(gap, bent):
    """Two links of 1 m between points that are farther apart than 2 m, held by a distance."""

    def links(length):
        mechanism = uqmbd.Mechanism("links", uqmbd.Planar())
        middle = along(bent)
        first = bar(mechanism, "first", (0, 0), middle)
        second = bar(mechanism, "second", middle, middle + along(-bent))
        mechanism.add(Revolute("base", mechanism.ground, first, (0, 0), (-0.5, 0)))
        mechanism.add(Revolute("elbow", first, second, (0.5, 0), (-0.5, 0)))
        mechanism.add(Distance("wire", mechanism.ground, second, (0, 0), (0.5, 0), length))
        mechanism.output("x", second.position[0], units="m")
        return mechanism

    text = refusal(links(2 + gap))
    assert "dead centre" in text and ("rounded" in text) == (gap < 1e-3), text
    missing = missing_length(text)
    assert abs(missing / gap - 1) < 0.06
    if bent:
        uqmbd.simulate(links(2 + gap - 1.1 * missing), TIMES, integrator="dop853")


@pytest.mark.parametrize("seed", QUICK)
@pytest.mark.parametrize("folded", [False, True])
def test_a_pose_that_may_go_either_way_is_named_and_how_far_out_of_it_to_draw(seed, folded):
    """The remedy is tried: drawn by so much out of the pose, to either side, the mechanism is assembled."""
    within = -(10 ** np.random.default_rng(seed).uniform(-6, -2))
    text = refusal(slider_crank(np.random.default_rng(seed), folded=folded, beyond=within))
    assert "dead centre" in text and "either side" in text and "body 'crank'" in text, text
    found = re.search(r"by about (\S+) m or rad", text)
    assert found is not None
    for side in (-1, 1):
        drawn = slider_crank(np.random.default_rng(seed), folded=folded, beyond=within, angle=side * float(found[1]))
        uqmbd.simulate(drawn, TIMES, integrator="dop853")


@pytest.mark.parametrize("seed", QUICK)
def test_velocities_that_a_dead_centre_cannot_realise_are_named(seed):
    rng = np.random.default_rng(seed)
    cases = (
        (
            slider_crank(rng, folded=bool(seed % 2), slider=rng.uniform(0.1, 5)),
            "body 'crank'",
            "velocity of body piston",
        ),
        (four_bar(rng, speed=rng.uniform(0.1, 5)), "body 'crank'", "angular_velocity of body rocker"),
        (spatial_loop(rng, speed=rng.uniform(0.1, 5)), "body 'crank'", "angular_velocity of body rocker"),
    )
    for mechanism, mover, stated in cases:
        text = refusal(mechanism)
        assert "dead centre" in text and stated in text, text
        assert mover in text.partition("dead centre")[2], text
        assert "give another pose" in text


def test_what_the_remedy_says_can_be_stated():
    rng = np.random.default_rng(1)
    uqmbd.simulate(slider_crank(rng, folded=False, crank={"angular_velocity": 2.0}), TIMES, integrator="dop853")


@pytest.mark.parametrize("integrator", ["auto", "dop853", "ida"])
def test_a_speed_that_is_magnified_beyond_all_digits_is_refused(integrator):
    """At an angle of 3e-7 the slider's speed determines nothing of the crank's, 1e7 times larger; at 1e-3 it does."""
    text = refusal(slider_crank(np.random.default_rng(2), folded=False, angle=3e-7, slider=1.0), integrator)
    assert "next to a dead centre" in text and "body 'crank'" in text and "give a pose farther along the motion" in text
    uqmbd.simulate(slider_crank(np.random.default_rng(2), folded=False, angle=1e-3, slider=1e-3), TIMES)


@pytest.mark.parametrize("seed", QUICK)
def test_speeds_are_not_refused_for_units_and_sizes(seed):
    """A regular pose determines speeds, whatever the size of the mechanism, in closed form."""
    rng = np.random.default_rng(seed)
    size, angle, speed = 10 ** rng.uniform(-6, 3), rng.uniform(0.5, 2.5), 10 ** rng.uniform(-4, -1)
    mechanism = slider_crank(np.random.default_rng(seed + 100), folded=False, angle=angle, size=size, slider=speed)
    again = np.random.default_rng(seed + 100)
    crank, rod = size * again.uniform(0.05, 0.5), size * again.uniform(0.6, 2.0)
    sine = crank / rod * np.sin(angle)
    rate = -speed / (crank * np.sin(angle) * (1 + crank / rod * np.cos(angle) / np.sqrt(1 - sine**2)))
    found = uqmbd.simulate(mechanism, [0, 0.01 / abs(rate)], check=False)
    assert abs(float(found["turning"][0]) / rate - 1) < 1e-5


@pytest.mark.parametrize("exponent", [-7, *(pytest.param(k, marks=pytest.mark.thorough) for k in (-9, -3, 0, 8))])
def test_a_start_condition_may_have_any_factor(exponent):
    mechanism = uqmbd.Mechanism("rotor", uqmbd.Planar())
    body = mechanism.body("rotor", mass=1, inertia=0.03, position=(0.3, 0))
    joint = mechanism.add(Revolute("hinge", mechanism.ground, body, at=(0, 0)))
    mechanism.output("speed", joint.speed, units="rad/s")
    mechanism.start(10.0**exponent * joint.speed, 1000 * 10.0**exponent)
    found = uqmbd.simulate(mechanism, [0, 1e-6], check=False)
    assert abs(float(found["speed"][0]) - 1000) < 1e-6


def test_fast_speeds_of_many_realisations_are_looked_at_together(watched_evaluator):
    """By numbers of evaluations: a driver's rate of 157 is fast, and regular; what is singular is found among them."""
    mechanism = uqmbd.Mechanism("rotor", uqmbd.Planar())
    body = mechanism.body("rotor", mass=1, inertia=0.03, position=(0.3, 0))
    mechanism.add(Revolute("hinge", mechanism.ground, body, at=(0, 0)))
    mechanism.add(RotationDriver("motor", mechanism.ground, body, 314 * uqmbd.t))
    mechanism.output("x", body.position[0], units="m")
    counts = []
    model = watched_evaluator(build(mechanism), "velocity", counts.append)
    found = assembly.assemble(model, model.parameters(np.zeros((300, 0))), 0.0)
    assert not any(found.messages)
    assert counts == [300]


@pytest.mark.thorough
def test_each_realisation_has_its_own_verdict(monkeypatch):
    """Of a crank that is drawn at random angles those next to the dead centre are refused, in blocks as at once."""
    mechanism = uqmbd.Mechanism("engine", uqmbd.Planar())
    angle = uqmbd.RandomVariable("angle", chaospy.Normal(1.0, 0.1))
    pin, tilt = (sympy.cos(angle), sympy.sin(angle)), -sympy.asin(sympy.sin(angle) / 3)
    wrist = pin[0] + 3 * sympy.cos(tilt)
    crank = mechanism.body("crank", mass=1, inertia=1, position=(pin[0] / 2, pin[1] / 2), angle=angle)
    rod = mechanism.body("rod", mass=1, inertia=1, position=((pin[0] + wrist) / 2, pin[1] / 2), angle=tilt)
    piston = mechanism.body("piston", mass=1, inertia=1, position=(wrist, 0), velocity=(1, 0))
    mechanism.add(Revolute("main", mechanism.ground, crank, (0, 0), (-0.5, 0)))
    mechanism.add(Revolute("pin", crank, rod, (0.5, 0), (-1.5, 0)))
    mechanism.add(Revolute("wrist", rod, piston, (1.5, 0), (0, 0)))
    mechanism.add(Prismatic("guide", mechanism.ground, piston, (0, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.output("x", piston.position[0], units="m")
    model = build(mechanism)
    angles = np.array([0.8, 3e-7, 1.0, 1e-4, 2e-7, -3e-7, 2.0])
    parameters = model.parameters(angles[:, None])
    for block in (1 << 20, 1):
        monkeypatch.setattr(assembly, "BLOCK", block)
        messages = assembly.assemble(model, parameters, 0.0).messages
        assert ["next to a dead centre" in m for m in messages] == [abs(x) < 1e-6 for x in angles], messages


@pytest.mark.parametrize("count", [2, 3])
def test_equations_that_are_left_out_in_a_dead_centre_are_distinguished(count):
    """Cranks that are parallel: drawn flat one equation is dropped that counts next to it.

    A third crank is redundant in any pose, which is no dead centre.
    """
    for angle, flat in ((0.0, True), (0.7, False)):
        mechanism = uqmbd.Mechanism("cranks", uqmbd.Planar())
        beam = mechanism.body("beam", mass=1, inertia=1, position=tuple(0.3 * along(angle)))
        for k in range(count):
            crank = mechanism.body(
                f"crank {k}", mass=1, inertia=1, position=tuple(np.array([k, 0]) + 0.15 * along(angle)), angle=angle
            )
            mechanism.add(Revolute(f"G{k}", mechanism.ground, crank, (k, 0), (-0.15, 0)))
            mechanism.add(Revolute(f"C{k}", crank, beam, (0.15, 0), (k, 0)))
        mechanism.output("x", beam.position[0], units="m")
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            build(mechanism)
        texts = [str(w.message) for w in caught if issubclass(w.category, uqmbd.RedundantConstraintWarning)]
        assert len(texts) == (flat or count == 3)
        assert all(("dead centre" in text) == flat for text in texts), texts


@pytest.mark.parametrize("seed", QUICK)
def test_what_is_no_dead_centre_is_not_called_one(seed):
    """Statements that contradict each other in every pose, and bars that do not fit, have other causes."""
    rng = np.random.default_rng(seed)
    turned = slider_crank(rng, folded=False, angle=rng.uniform(0.5, 2.5), slider=1.0, crank={"angular_velocity": 50.0})
    text = refusal(turned)
    assert "dead centre" not in text and "contradict" in text
    # a triangle of bars, one too long, on a frame
    mechanism = uqmbd.Mechanism("truss", uqmbd.Translational())
    corners = np.array([[0, 0], [1, 0], [0.5, 0.8]]) + rng.uniform(-0.1, 0.1, (3, 2))
    bodies = [mechanism.body(f"node {k}", mass=1, position=tuple(c)) for k, c in enumerate(corners)]
    mechanism.add(Fixed("hold", mechanism.ground, bodies[0], at=tuple(corners[0])))
    for i, j in ((0, 1), (1, 2), (0, 2)):
        length = float(np.linalg.norm(corners[i] - corners[j]))
        mechanism.add(Distance(f"bar {i}{j}", bodies[i], bodies[j], (0, 0), (0, 0), length))
        mechanism.add(Distance(f"long {i}{j}", bodies[i], bodies[j], (0, 0), (0, 0), length + rng.uniform(0.01, 0.03)))
    mechanism.output("x", bodies[1].position[0], units="m")
    text = refusal(mechanism)
    assert "cannot be closed" in text and "dead centre" not in text, text
