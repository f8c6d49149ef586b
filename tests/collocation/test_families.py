"""Families of alignment: each output takes the one that follows it best, by closed forms, and all are one node."""

from __future__ import annotations

import json
import re

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.results import AlignedChaos, ComposedChaos, PolynomialChaos, load, save, study_tree, surrogate, validate
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_joints import Revolute
from uqmbd_springs import SpringDamper, Torque

G = 9.81
HEIGHT = uqmbd.RandomVariable("h0", chaospy.Uniform(0.9, 1.1), units="m")
SPEED = uqmbd.RandomVariable("speed", chaospy.Uniform(9.0, 11.0), units="rad/s")
STIFFNESS = uqmbd.RandomVariable("k", chaospy.Uniform(90, 110), units="N/m")
RESTITUTION = 0.8


def plate(times):
    """A ball that bounces, and a plate that turns with a random speed."""
    mechanism = uqmbd.Mechanism("plate", uqmbd.Planar(gravity=(0, -G)))
    ground = mechanism.ground
    disc = mechanism.body("plate", mass=1, inertia=0.5, position=(2, 0), angle=0.3, angular_velocity=SPEED)
    mechanism.add(Revolute("axle", ground, disc, point_i=(2, 0), point_j=(0, 0)))
    ball = mechanism.body("ball", mass=1, inertia=0.1, position=(0, HEIGHT), velocity=(0, 0))
    mechanism.add(PlaneImpact("floor", ground, ball, (0, 0), (0, 0), (0, 1), restitution=RESTITUTION))
    mechanism.output("height", ball.position[1], units="m")
    mechanism.output("mark", disc.point((0.2, 0))[1], units="m")
    mechanism.output("angle", disc.angle, units="rad")
    return uqmbd.Study("plate", mechanism, times=times, rtol=1e-9, propagators=[])


def bouncing(height, times):
    """Heights (K, T) of a bouncing ball, closed form."""
    h = np.asarray(height)[:, None]
    speed, at = np.sqrt(2 * G * h), np.sqrt(2 * h / G)
    found = h - G * times**2 / 2
    for _ in range(12):
        speed = speed * RESTITUTION
        since = times - at
        found = np.where(since >= 0, speed * since - G * since**2 / 2, found)
        at = at + 2 * speed / G
    return found


def oscillator(end, count, damping=0.0, stiffness=(STIFFNESS,)):
    """Masses of 1 kg on springs, from 0.1 m at rest; the sum of their positions is an output, too."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    masses = []
    for n, k in enumerate(stiffness):
        mass = mechanism.body(f"mass{n}", mass=1, position=0.1)
        mechanism.add(
            SpringDamper(f"spring{n}", mechanism.ground, mass, 0, 0, stiffness=k, free_length=0, damping=damping)
        )
        masses.append(mass)
    mechanism.output("x", masses[0].position[0], units="m")
    if len(masses) > 1:
        mechanism.output("sum", sum(mass.position[0] for mass in masses), units="m")
    return uqmbd.Study("oscillator", mechanism, times=np.linspace(0, end, count), rtol=1e-9, propagators=[])


def damped(k, damping, times):
    """Positions (K, T), closed form."""
    rate = damping / 2
    frequency = np.sqrt(np.asarray(k)[:, None] - rate**2)
    return 0.1 * np.exp(-rate * times) * (np.cos(frequency * times) + rate / frequency * np.sin(frequency * times))


def told(node):
    """Families and errors by output, and what was left out."""
    return [json.loads(node.attrs[name]) for name in ("alignment", "alignment_error", "alignment_left_out")]


@pytest.fixture(scope="module")
def composed():
    study = plate(np.linspace(0, 1.5, 76))
    return study, study.propagate(Collocation(order=3, alignment="auto"))


@pytest.mark.thorough
def test_ball_beside_a_plate_that_turns(composed):
    """Events for the ball, phases for a point of the plate, and equal times for its angle: all by closed forms."""
    study, node = composed
    families, errors, left_out = told(node)
    assert families == {"height": "events", "mark": "phase", "angle": "plain"} and not left_out
    draw = np.random.default_rng(0)
    inputs = np.stack([draw.uniform(0.9, 1.1, 300), draw.uniform(9, 11, 300)], axis=1)
    assert list(study.mechanism.inputs.names) == ["h0", "speed"]
    angle = 0.3 + inputs[:, 1:] * study.times
    exact = np.stack([bouncing(inputs[:, 0], study.times), 0.2 * np.sin(angle), angle], axis=1)
    chaos = surrogate(node)
    assert isinstance(chaos, ComposedChaos)
    wrong = np.sqrt(((chaos.evaluate(inputs) - exact) ** 2).mean(axis=(0, 2))) / exact.std(axis=0).max(axis=-1)
    assert wrong.max() < 1e-3
    for k, name in enumerate(("height", "mark")):
        assert wrong[k] / 3 < errors[name] < 3 * wrong[k]
    # each of the others is far worse where it is not taken
    table = node["families"]["error"]
    assert float(table.sel(family="plain", output="height")) > 30 * errors["height"]
    assert float(table.sel(family="events", output="mark")) > 30 * errors["mark"]
    assert float(table.sel(family="phase", output="height")) > 30 * errors["height"]
    np.testing.assert_allclose(chaos.mean, exact.mean(axis=0), atol=0.05)


@pytest.mark.thorough
def test_statistics_of_one_node(composed, tmp_path):
    """Sobol' indices know which input each output depends on; a file without the mechanism has the same bits."""
    _, node = composed
    validate(study_tree([node], study="plate", mechanism="plate"))
    statistics = node["statistics"].to_dataset()
    for name in ("mean", "std", "quantile", "sobol_first", "sobol_total", "verification_error"):
        assert np.isfinite(statistics[name]).all(), name
    total = statistics["sobol_total"].isel(time=slice(1, None))
    for output, alone in (("height", "h0"), ("mark", "speed"), ("angle", "speed")):
        share = total.sel(output=output)
        np.testing.assert_allclose(share.sel(input=alone), 1, atol=0.02)
        np.testing.assert_allclose(share.sel(input=({"h0", "speed"} - {alone}).pop()), 0, atol=0.02)
    save(study_tree([node], study="plate", mechanism="plate"), tmp_path / "plate.nc")
    read = load(tmp_path / "plate.nc")[node.name]
    points = [[0.95, 9.5], [1.02, 10.7]]
    np.testing.assert_array_equal(surrogate(read).evaluate(points), surrogate(node).evaluate(points))
    np.testing.assert_array_equal(surrogate(read, "mark").evaluate(points), surrogate(node).evaluate(points)[:, 1:2])
    assert isinstance(surrogate(read, "mark"), AlignedChaos) and isinstance(surrogate(read, "angle"), PolynomialChaos)


@pytest.mark.thorough
def test_realisations_are_counted_once(composed):
    """Nodes of the plain family and of both others, and one set of verification realisations."""
    _, node = composed
    nodes = node["nodes"].to_dataset()
    assert node.attrs["verification"] == 16
    assert int((nodes["purpose"] == "verification").sum()) == 16
    followed = [int(((nodes["family"] == name) & (nodes["purpose"] == "fit")).sum()) for name in ("events", "phase")]
    # the nodes of the plain family are those of the phases, kinks of the ball or not, some of them followed twice
    assert followed == [16, 16] and 16 + 32 <= node.attrs["realisations"] <= 16 + 48


def test_short_damped_motion_stays_plain():
    """Over little more than a turn polynomials at equal times are as good as any: what is stored is one of these."""
    study = oscillator(1.0, 41, damping=1.0)
    node = study.propagate(Collocation(order=6, alignment="auto"))
    families, errors, left_out = told(node)
    assert families == {"x": "plain"} and "has none" in left_out["events"]
    assert "chaos" in node.children and "composed" not in node.children
    k = np.random.default_rng(0).uniform(90, 110, 200)
    exact = damped(k, 1.0, study.times)
    wrong = surrogate(node).evaluate(k[:, None])[:, 0] - exact
    assert np.sqrt((wrong**2).mean()) / exact.std(axis=0).max() < 2 * errors["x"] + 1e-6
    # nodes are those that were followed, at the output times; their last step is another one, since they go on
    alone = study.propagate(Collocation(order=6))
    np.testing.assert_allclose(surrogate(node).coefficients, surrogate(alone).coefficients, rtol=0, atol=1e-10)


@pytest.mark.thorough
def test_long_motion_takes_phases():
    """Over 24 turns; the plain family costs no realisation beyond those that are followed."""
    study = oscillator(15, 301)
    node = study.propagate(Collocation(order=4, alignment="auto"))
    families, errors, _ = told(node)
    assert families == {"x": "phase"} and "aligned" in node.children and node.attrs["clock"] == "x"
    table = node["families"]["error"].sel(output="x")
    assert float(table.sel(family="plain")) > 20 * float(table.sel(family="phase")) > 0
    k = np.random.default_rng(0).uniform(90, 110, 300)
    exact = damped(k, 0.0, study.times)
    wrong = np.sqrt(((surrogate(node).evaluate(k[:, None])[:, 0] - exact) ** 2).mean()) / exact.std(axis=0).max()
    assert wrong / 3 < errors["x"] < 3 * wrong
    alone = study.propagate(Collocation(order=4, alignment="phase"))
    assert node.attrs["realisations"] == alone.attrs["realisations"]
    np.testing.assert_array_equal(surrogate(node).evaluate(k[:9, None]), surrogate(alone).evaluate(k[:9, None]))


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")
def test_a_clock_that_is_no_output_is_no_output_of_other_families():
    """The angle of a pendulum is followed for its phase; two frequencies are fitted to its height from that motion."""
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -G)))
    length = uqmbd.RandomVariable("length", chaospy.Normal(1.0, 0.02), units="m")
    speed = uqmbd.RandomVariable("swing", chaospy.Uniform(2.0, 3.0), units="rad/s")
    rod = mechanism.body(
        "rod",
        mass=1,
        inertia=0.01,
        position=(0, -length),
        angle=-np.pi / 2,
        angular_velocity=speed,
        velocity=(speed * length, 0),
    )
    mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length, 0)))
    mechanism.output("height", rod.position[1], units="m")
    study = uqmbd.Study("pendulum", mechanism, np.linspace(0, 60, 7), propagators=[])
    node = study.propagate(Collocation(order=1, alignment="auto"))
    inputs = np.column_stack([np.linspace(0.97, 1.03, 9), np.linspace(2.1, 2.9, 9)])
    exact = study.problem(Collocation()).realise(inputs).response[:, 0]
    found = surrogate(node).evaluate(inputs)[:, 0]
    stated = node["statistics"]["verification_error"].values[0]
    assert np.sqrt(np.mean((found - exact) ** 2)) < 3 * np.nanmax(stated) * exact.std()


@pytest.mark.thorough
def test_what_no_family_follows_is_reported():
    """Two frequencies drift apart: one clock does not serve their sum, and the warning says from when on."""
    other = uqmbd.RandomVariable("other", chaospy.Uniform(140, 180), units="N/m")
    study = oscillator(12, 121, stiffness=(STIFFNESS, other))
    said = r"exceeds 10% of the standard deviation: .*'sum' .*from t = .* s to t = .* s \(up to [0-9]+ % at t = .*"
    with pytest.warns(uqmbd.SurrogateWarning, match=said):
        node = study.propagate(Collocation(order=2, alignment=("plain", "phase")))
    _, errors, _ = told(node)
    assert errors["sum"] > 0.05
    draw = np.random.default_rng(0)
    k = np.stack([draw.uniform(90, 110, 400), draw.uniform(140, 180, 400)], axis=1)
    exact = damped(k[:, 0], 0.0, study.times) + damped(k[:, 1], 0.0, study.times)
    chaos = surrogate(node, "sum")
    wrong = np.sqrt(((chaos.evaluate(k)[:, 0] - exact) ** 2).mean()) / exact.std(axis=0).max()
    assert wrong / 3 < errors["sum"] < 3 * wrong


def test_one_family_says_what_it_does_not_follow():
    """Two springs swing at two frequencies: the phase of one does not serve the sum, and the warning holds the truth."""
    other = uqmbd.RandomVariable("other", chaospy.Uniform(140, 180), units="N/m")
    study = oscillator(12, 121, stiffness=(STIFFNESS, other))
    with pytest.warns(uqmbd.SurrogateWarning, match="exceeds 10% of the standard deviation") as told_so:
        node = study.propagate(Collocation(order=2, alignment="phase", verify=40))
    (text,) = [str(one.message) for one in told_so]
    of_sum = text[text.index("'sum'") :]
    begin, largest = (float(re.search(f"{what} ([0-9.]+)", of_sum)[1]) for what in ("from t =", r"\(up to"))
    draw = np.random.default_rng(0)
    k = np.stack([draw.uniform(90, 110, 400), draw.uniform(140, 180, 400)], axis=1)
    exact = damped(k[:, 0], 0.0, study.times) + damped(k[:, 1], 0.0, study.times)
    spread = np.maximum(exact.std(axis=0), 0.01 * exact.std(axis=0).max())
    wrong = np.sqrt(((surrogate(node, "sum").evaluate(k)[:, 0] - exact) ** 2).mean(axis=0)) / spread
    assert wrong.max() / 2 < largest / 100 < 2 * wrong.max()
    assert wrong[study.times < begin].max() < 0.2 and wrong[study.times >= begin].max() > 0.1
    # one frequency is followed: not a word, which would be an error here
    oscillator(12, 121).propagate(Collocation(order=3, alignment="phase"))


def test_outputs_that_do_not_vary_are_followed():
    """A disc whose motion is prescribed by no input: its height is the same in all realisations but for rounding."""
    mechanism = plate(np.linspace(0, 1, 2)).mechanism
    other = mechanism.body("other", mass=1, inertia=0.1, position=(5, 0), angle=0.4, angular_velocity=2.0)
    mechanism.add(Revolute("pin", mechanism.ground, other, point_i=(5, 0), point_j=(0, 0)))
    mechanism.output("still", other.point((0.2, 0))[1], units="m")
    study = uqmbd.Study("still", mechanism, times=np.linspace(0, 0.6, 31), rtol=1e-9, propagators=[])
    node = study.propagate(Collocation(order=2, alignment=("plain", "events")))
    exact = 0.2 * np.sin(0.4 + 2.0 * study.times)
    np.testing.assert_allclose(node["statistics"]["mean"].sel(output="still"), exact, atol=1e-7)
    _, errors, _ = told(node)
    assert errors["still"] < 1e-6


def test_a_clock_that_impacts_reset_is_named_so():
    """A ball that bounces has no clock: the message names events and what goes with them."""
    mechanism = uqmbd.Mechanism("ball", uqmbd.Planar(gravity=(0, -G)))
    ball = mechanism.body("ball", mass=1, inertia=0.1, position=(0, HEIGHT), velocity=(0, 0))
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), restitution=RESTITUTION))
    mechanism.output("height", ball.position[1], units="m")
    study = uqmbd.Study("ball", mechanism, times=np.linspace(0, 1, 51), propagators=[])
    with pytest.raises(uqmbd.StudyError, match="no event .such as an impact. resets.*'events'.*'auto'"):
        study.propagate(Collocation(order=2, alignment="phase"))


def test_what_is_not_possible_is_left_out_or_refused():
    """A mass that comes to rest has neither clock nor events: auto says so, a name is refused."""
    study = oscillator(5, 51, damping=40)
    node = study.propagate(Collocation(order=2, alignment="auto"))
    families, _, left_out = told(node)
    assert families == {"x": "plain"} and set(left_out) == {"events", "phase"}
    assert "needs a clock, but there is none" in left_out["phase"]
    assert not any("use alignment=None" in reason or "with clock=" in reason for reason in left_out.values())
    with pytest.raises(uqmbd.StudyError, match="needs a clock, but there is none"):
        study.propagate(Collocation(order=2, alignment=("plain", "phase")))
    obstacle = Collocation(order=2, alignment=("plain", "events")).obstacle(study)
    assert obstacle is not None and "needs a mechanism with events" in obstacle
    assert Collocation(order=2, alignment="auto").obstacle(study) is None
    with pytest.raises(uqmbd.StudyError, match="needs a mechanism with events"):
        study.propagate(Collocation(order=2, alignment=("plain", "events")))


def test_estimate_counts_all_families():
    study = plate(np.linspace(0, 1, 11))
    counts = {
        names: Collocation(order=3, alignment=names).estimate(study).realisations
        for names in ("events", "phase", ("plain", "phase"), ("events", "phase"), ("plain", "events"), "auto")
    }
    # of 16 verification realisations 15 % of all 32 are also followed from event to event
    nodes, followed = 16, 4
    assert counts == {
        "events": 2 * nodes + 16 + followed,
        "phase": 2 * nodes + 16,
        ("plain", "phase"): 2 * nodes + 16,
        ("events", "phase"): 4 * nodes + 16 + followed,
        ("plain", "events"): 3 * nodes + 16 + followed,
        "auto": 6 * nodes + 16 + followed,
    }
    estimate = Collocation(order=3, alignment="auto").estimate(oscillator(1, 11))
    assert "left out: events" in estimate.detail


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"alignment": "auto", "verify": 0},
            "selects families by their errors at verification realisations, but verify is 0",
        ),
        ({"alignment": ("plain", "phase"), "elements": 4}, "contradicts elements=4: elements are refined for one"),
        ({"alignment": ("phase",)}, "expected a tuple of two or more different families"),
        ({"alignment": ("phase", "phase")}, "expected a tuple of two or more different families"),
        (
            {"alignment": ("phase", "impacts")},
            "alignment is .*'impacts'.*; expected one of 'events', 'phase', 'two-frequency', 'auto'",
        ),
        (
            {"alignment": "plain"},
            "alignment is 'plain'; expected one of 'events', 'phase', 'two-frequency', 'auto', or a tuple of 'plain'",
        ),
        ({"alignment": ("plain", "events"), "clock": "x"}, "clock='x' requires alignment='phase'"),
    ],
)
def test_options_that_contradict(options, message):
    with pytest.raises(uqmbd.StudyError, match=message):
        Collocation(**options)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "options",
    [
        {"order": 4, "rule": "smolyak"},
        {"order": 3, "method": "regression", "samples": 20},
        pytest.param({"order": 4, "method": "omp", "samples": 20}, marks=pytest.mark.slow),
        {"order": 1, "adaptive": "order", "tolerance": 1e-3},
        {"adaptive": "dimension", "tolerance": 1e-3},
    ],
)
def test_every_way_to_fit(options):
    """A disc that spins up from rest by a random torque: its angle is a polynomial, a point of it is not."""
    torque = uqmbd.RandomVariable("torque", chaospy.Normal(1.0, 0.05), units="N m")
    mechanism = uqmbd.Mechanism("disc", uqmbd.Planar())
    body = mechanism.body("disc", mass=1, inertia=0.5, position=(0, 0), angle=0.3)
    mechanism.add(Revolute("axle", mechanism.ground, body, point_i=(0, 0), point_j=(0, 0)))
    mechanism.add(Torque("drive", body, torque=torque))
    mechanism.output("height", body.point((0.2, 0))[1], units="m")
    mechanism.output("angle", body.angle, units="rad")
    study = uqmbd.Study("disc", mechanism, times=np.linspace(0, 10, 101), rtol=1e-9, propagators=[])
    node = study.propagate(Collocation(alignment="auto", **options))
    families, errors, _ = told(node)
    # of a low order, plain is better as long as the disc has hardly turned
    assert families["angle"] == "plain" and families["height"].rpartition(", ")[2].split()[0] == "phase"
    # a plain chaos of the height never settles; that counts for nobody
    assert node.attrs.get("tolerance_met", "True") == "True"
    drawn = np.random.default_rng(1).normal(1.0, 0.05, 300)
    angle = 0.3 + drawn[:, None] / 0.5 * study.times**2 / 2
    exact = np.stack([0.2 * np.sin(angle), angle], axis=1)
    wrong = np.sqrt(((surrogate(node).evaluate(drawn[:, None]) - exact) ** 2).mean(axis=(0, 2)))
    assert (wrong / exact.std(axis=0).max(axis=-1) < 1e-2).all() and max(errors.values()) < 1e-2
