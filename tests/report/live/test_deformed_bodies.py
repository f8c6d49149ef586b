"""Drawings show flexible bodies deformed: nodes of pictures and pages are the nodes of the motion."""

import json

import chaospy
import numpy as np
import pytest

import uqmbd
from tests.mechanisms import pendulum
from uqmbd.report import motion
from uqmbd.report.charts import json_script
from uqmbd.report.live import collect_player_data, packed_poses, pose_surrogate
from uqmbd.report.mechanisms import Sketch, drawn_pose, magnification, motion_at, stated_pose, world
from uqmbd.results import surrogate
from uqmbd_collocation import Collocation
from uqmbd_flexible import Beam, flexible_body
from uqmbd_joints import Fixed, Revolute

TIMES = np.linspace(0, 0.2, 9)
BEAM = Beam(length=1.0, area=1e-4, second_moment=8.3e-10, youngs_modulus=5e9, density=7800, modes=0, elements=4)
SPACE_BEAM = Beam(
    length=1.0, area=1e-4, second_moment=(8e-10, 9e-10), torsion=1e-9, youngs_modulus=9e9, density=7800, modes=0,
    elements=4, highest=60,
)  # fmt: skip


def swinging(model=BEAM, initial=(), weight=0.5, observed=range(5)):
    """A beam that swings about a pin, with a mass at its tip; outputs are the positions of its nodes."""
    spatial = model.dimension == 3
    space = uqmbd.Spatial(gravity=(0, -9.81, 3)) if spatial else uqmbd.Planar(gravity=(0, -9.81))
    origin = (0, 0, 0) if spatial else (0, 0)
    mechanism = uqmbd.Mechanism("beam", space)
    rod = flexible_body(mechanism, "rod", model, initial=initial)
    tip = mechanism.body("tip", mass=weight, inertia=(1e-3,) * 3 if spatial else 1e-3, position=(1, *origin[1:]))
    axes = {"axis_i": (0, 0, 1), "axis_j": (0, 0, 1)} if spatial else {}
    mechanism.add(Revolute("pin", mechanism.ground, rod.node("start"), origin, origin, **axes))
    mechanism.add(Fixed("weld", rod.node("end"), tip, origin, origin))
    for node in observed:
        for axis, x in enumerate(rod.node_point(node)):
            mechanism.output(f"node {node} {axis}", x, units="m")
    return mechanism


@pytest.mark.thorough
@pytest.mark.parametrize("model", [BEAM, SPACE_BEAM], ids=["plane", "space"])
def test_drawn_nodes_are_outputs_of_the_motion(node, model):
    """Nodes of the drawing have the positions that outputs of a simulation have, and joints at nodes are closed."""
    mechanism = swinging(model)
    study = uqmbd.Study("beam", mechanism, TIMES, [])
    data, found = motion(study, samples=0, frames=len(TIMES)), uqmbd.simulate(mechanism, TIMES)
    points, sketch = world(data)[0], Sketch(data)
    (line,) = sketch.lines["rod"]
    wanted = np.array([[found[f"node {k} {axis}"].values for axis in range(model.dimension)] for k in range(5)])
    np.testing.assert_allclose(points[:, line], wanted.transpose(2, 0, 1), atol=2e-6)
    assert abs(data["displacement"].values).max() > 5e-3
    weld = next(part for part in sketch.parts if part.name == "weld")
    np.testing.assert_allclose(points[:, weld.points[0]], points[:, weld.points[1]], atol=1e-6)

    made = collect_player_data(data)
    assert made["lines"] == [[line], []] and made["displaced"]["factor"] == magnification(data, _size(made))
    script = """
    const mechanism = new Mechanism(given);
    const at = (scale) => { mechanism.magnified = scale; return Array.from(mechanism.times, (time) => mechanism.storedAt(0, time)); };
    const view = new View(given.bounds);
    view.fit(900);
    const palette = { ink: "#000000", paper: "#ffffff", soft: "#777777", dark: false };
    const shapes = mechanism.draw(view, mechanism.storedAt(0, mechanism.times[4]), palette);
    answer = { true: at(1), none: at(0), thrice: at(3), bent: shapes.filter((one) => one.points.length === 5 && !one.closed).length };
    """
    page = node(["mechanism.js", "view.js"], script, json.loads(json_script(made)))
    np.testing.assert_allclose(page["true"], points, atol=1e-4)
    np.testing.assert_allclose(page["none"], world(data.drop_vars("displacement"))[0], atol=1e-4)
    once, thrice = (np.array(page[key]) - page["none"] for key in ("true", "thrice"))
    np.testing.assert_allclose(thrice, 3 * once, atol=1e-12)
    assert page["bent"] == 2  # the rim and the face of the line through the five nodes


def _size(player):
    return max(high - low for low, high in zip(*player["bounds"], strict=True))


FOUND = """
const mechanism = new Mechanism(given.player);
const live = new LivePoses(given.data);
const at = (germs) => { const found = live.evaluate(germs); return Array.from(mechanism.times, (time) => mechanism.foundAt(found, time)); };
answer = { points: given.germs.map(at), error: live.largestError(mechanism.reaches) };
"""


@pytest.mark.thorough
@pytest.mark.parametrize(
    "method", [Collocation(order=4, label="c"), Collocation(order=4, elements=2, label="c")], ids=["plain", "elements"]
)
@pytest.mark.parametrize("model", [BEAM, SPACE_BEAM], ids=["plane", "space"])
def test_bodies_are_deformed_at_inputs_of_sliders_and_by_methods(node, model, method):
    """Points of the page at chosen inputs are those of a motion that is integrated at these inputs."""
    factor = uqmbd.RandomVariable("factor", chaospy.Uniform(0.98, 1.02))
    weight = uqmbd.RandomVariable("weight", chaospy.Uniform(0.45, 0.55), units="kg")
    mechanism = swinging(model.scaled(stiffness=factor), weight=weight, observed=[4])
    study = uqmbd.Study("beam", mechanism, TIMES / 20, [method])
    made = pose_surrogate(study, "c", frames=len(TIMES), known=surrogate(study.run()["c"]))
    exact = motion(study, samples=3, frames=len(TIMES))
    assert abs(exact["displacement"].values).max() > 1e-4
    space = surrogate(made["coordinates"]).space
    germs = space.to_germs(
        exact["inputs"].values[:, [list(exact["input"].values).index(name) for name in space.inputs]]
    )
    data = {"player": collect_player_data(exact), "data": packed_poses(made), "germs": germs.tolist()}
    page = node(["mechanism.js", "poses.js"], FOUND, json.loads(json_script(data)))
    points = world(exact)
    assert page["error"] < 2e-4
    allowed = 10 * page["error"] + 2e-6
    assert abs(exact["displacement"].values).max() > 5 * allowed  # points of undeformed bodies would differ by more
    np.testing.assert_allclose(page["points"], points, atol=allowed)

    drawn = motion(study, samples=3, frames=len(TIMES), method="c")
    again = world(drawn)
    for row, inputs in enumerate(drawn["inputs"].values[1:], 1):
        at = dict(zip(drawn["input"].values.tolist(), inputs, strict=True))
        wanted = world(motion_at(study, at, frames=len(TIMES)).to_dataset())[0]
        np.testing.assert_allclose(again[row], wanted, atol=2e-4)


def test_given_and_assembled_poses_are_deformed():
    """A pose with stated modal coordinates has its nodes at the positions that the shapes state."""
    initial = [0.01 * k for k in range(1, BEAM.modes + 1)]
    mechanism = uqmbd.Mechanism("free", uqmbd.Planar())
    flexible_body(mechanism, "rod", BEAM, position=(2, 3), initial=initial)
    for data in (stated_pose(mechanism), drawn_pose(mechanism)):
        (line,) = Sketch(data).lines["rod"]
        wanted = [np.array([2, 3]) + x.position + x.translation @ initial for x in map(BEAM.nodes.get, range(5))]
        np.testing.assert_allclose(world(data)[0, 0, line], wanted, atol=1e-6)


def test_nodes_without_lines_are_dots():
    """A model without lines is drawn as the hull of its nodes, with a dot at each node."""
    mechanism = uqmbd.Mechanism("free", uqmbd.Planar())
    flexible_body(mechanism, "rod", BEAM.replaced(lines=()))
    sketch = Sketch(drawn_pose(mechanism))
    assert sketch.lines == {} and sketch.kinds.count("node") == 5
    assert len({stroke.at for stroke in sketch.strokes(world(sketch.data)[0], 0.1) if stroke.clear}) >= 5


@pytest.mark.thorough
def test_lines_do_not_change_the_motion_or_other_pages():
    """Drawn nodes change no result, not even the size of the mechanism; pages of rigid mechanisms have no new data."""
    results = []
    for lines in ((), ((0, 1), (1, 2, 3))):
        found = uqmbd.simulate(swinging(BEAM.replaced(lines=lines)), TIMES)
        results.append([found[name].values for name in found.data_vars if name.startswith("node")])
    np.testing.assert_array_equal(*results)
    assert not {"displaced", "lines"} & set(collect_player_data(drawn_pose(pendulum())))


def test_wrong_lines_have_a_message():
    """An unknown node, and a point with too few coordinates or a rate, are errors that state the place."""
    with pytest.raises(uqmbd.StudyError, match="lines contains 'middle', which is not a node"):
        BEAM.replaced(lines=[("start", "middle")])

    class Odd(uqmbd.Component):
        bodies, spaces = ("body",), (uqmbd.Planar,)

        def terms(self, p):
            yield from ()

        def drawn_lines(self):
            return [[(0, 1, 2)]]

    mechanism = uqmbd.Mechanism("m", uqmbd.Planar())
    mechanism.add(Odd("odd", mechanism.body("body", mass=1, inertia=1)))
    with pytest.raises(uqmbd.StudyError, match=r"Odd 'odd': drawn_lines\(\) contains the point .* expected 2"):
        drawn_pose(mechanism)
