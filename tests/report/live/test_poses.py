"""The player's poses follow the sliders: they are those of the mechanism at the same inputs."""

import json

import chaospy
import numpy as np
import pytest

import uqmbd
from tests.mechanisms import pendulum
from uqmbd.errors import StudyError
from uqmbd.randomness import GermSpace
from uqmbd.report import motion, with_motion
from uqmbd.report.charts import json_script
from uqmbd.report.live import live_method, live_surrogate, packed_poses, pose_surrogate, with_poses
from uqmbd.results import load, propagator_nodes, save, surrogate
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper

POSED = """
const live = new LivePoses(given.data);
answer = given.germs.map((germs) => {
  const { poses, points, outside } = live.evaluate(germs);
  return { poses: Array.from(poses), points: points && Array.from(points), outside };
});
answer = { rows: answer, bodies: live.bodies, times: Array.from(live.times), width: live.width };
"""


def posed(node, data, germs):
    """What the page makes of germs."""
    return node(["poses.js"], POSED, {"data": json.loads(json_script(data)), "germs": germs.tolist()})


def line():
    """A mass on a spring that moves up and down, of random stiffness and height of its mark."""
    mechanism = uqmbd.Mechanism("line", uqmbd.Line(gravity=-9.81))
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(40, 50))
    mass = mechanism.body("mass", mass=1, position=(0.5,))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (1.0,), (0.0,), stiffness=stiffness, free_length=0.4))
    mechanism.output("x", mass.position[0], units="m")
    return mechanism


def turning():
    """A pendulum in the plane, of random length and mass, with loads."""
    return pendulum(loaded=True)


@pytest.mark.thorough
@pytest.mark.parametrize("make", [turning, line])
def test_poses_are_those_of_the_mechanism(node, make):
    """At inputs that are integrated: within ten times the stated error of each; points and radii to 1e-6 m."""
    mechanism = make()
    study = uqmbd.Study("posed", mechanism, np.linspace(0, 0.8, 41), [Collocation(order=5, label="c")])
    found = pose_surrogate(study, "c", frames=12)
    data = packed_poses(found)
    whole = surrogate(found["coordinates"])
    exact = motion(study, samples=6, frames=12)
    inputs = exact["inputs"].sel(input=list(whole.space.inputs)).values
    answer = posed(node, data, whole.space.to_germs(inputs))
    np.testing.assert_allclose(answer["times"], exact["time"].values)
    assert answer["bodies"] == exact["body"].values.tolist()
    shape = exact["pose"].shape
    poses = np.array([row["poses"] for row in answer["rows"]]).reshape(shape)
    stated = whole.verification_rms().max()
    assert stated < 1e-3
    assert np.abs(poses - exact["pose"].values).max() < 10 * stated + 1e-6
    assert np.ptp(poses, axis=0).max() > 100 * stated, "the poses differ between the realisations"
    if shape[-1] > 2:
        np.testing.assert_allclose(np.linalg.norm(poses[..., 2:], axis=-1), 1, rtol=1e-12)
    points = np.array([row["points"] for row in answer["rows"]]).reshape(shape[0], -1, exact.sizes["axis"] + 1)
    np.testing.assert_allclose(points[..., :-1], exact["local"].values, atol=1e-6)
    radii = exact["point_radius"].values if "point_radius" in exact else 0.0
    np.testing.assert_allclose(points[..., -1], radii + 0 * points[..., -1], atol=1e-6)
    assert GermSpace.from_dataset(found["coordinates/chaos"].to_dataset()).names == whole.space.names


@pytest.mark.thorough
def test_poses_are_kept_with_the_motion(tmp_path):
    """Of the recommended method; stored and read again they are the same; where none makes a surrogate, it is told."""
    methods = [MonteCarlo(samples=30, seed=1, label="mc"), Collocation(order=4, label="c")]
    study = uqmbd.Study("posed", turning(), np.linspace(0, 0.4, 9), methods)
    tree, problem = with_motion(study.run(), study)
    assert not problem and live_method(tree) == "c"
    made, problem = with_poses(tree, study)
    assert not problem and list(propagator_nodes(made)) == ["mc", "c"] and "pose_surrogate" not in tree.children
    again = load(save(made, tmp_path / "results.nc"))
    data = packed_poses(made["pose_surrogate"])
    assert json_script(packed_poses(again["pose_surrogate"])) == json_script(data)
    assert live_surrogate(made["mc"])["reason"] == with_poses(tree.drop_nodes("c"), study)[1]
    assert "unknown" in with_poses(tree.drop_nodes("motion"), study)[1]
    dear = tree.copy()
    dear["c"].attrs |= {"wall_time": 100.0, "realisations": made["pose_surrogate"].attrs["realisations"]}
    without, reason = with_poses(dear, study)
    assert "would take 100 s" in reason and without["motion"].attrs["no_surrogate"] == reason


def test_samples_alone_give_no_poses():
    study = uqmbd.Study("posed", turning(), np.linspace(0, 0.2, 5), [MonteCarlo(samples=4, seed=1, label="mc")])
    with pytest.raises(StudyError, match="no surrogate, so there is no surrogate of the poses"):
        pose_surrogate(study, "mc", frames=3)
