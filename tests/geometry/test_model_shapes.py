"""Shapes of URDF and MJCF files; files outside of the model's folder are not read."""

import numpy as np
import pytest

import uqmbd
from uqmbd.shapes import Box, Cylinder, Mesh, Sphere
from uqmbd_geometry import add_model_shapes

from .solids import box, write_stl

pytestmark = pytest.mark.usefixtures("trimesh")

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'

ARM = f"""<robot name="arm">
<link name="base"/>
<link name="upper">{INERTIAL}
  <visual><origin xyz="0.5 0 0" rpy="0 1.5707963267948966 0"/><geometry><cylinder radius="0.1" length="1"/></geometry></visual>
  <visual><geometry><mesh filename="meshes/part.stl" scale="0.001 0.001 0.001"/></geometry></visual>
  <collision><geometry><box size="1 2 3"/></geometry></collision>
</link>
<link name="tool">{INERTIAL}<visual><origin xyz="0 0 0.2"/><geometry><sphere radius="0.3"/></geometry></visual></link>
<joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/></joint>
<joint name="flange" type="fixed"><parent link="upper"/><child link="tool"/><origin xyz="1 0 0" rpy="1.5707963267948966 0 0"/></joint>
</robot>"""


@pytest.fixture
def arm(tmp_path):
    (tmp_path / "meshes").mkdir()
    write_stl(tmp_path / "meshes" / "part.stl", *box((100, 200, 300)))
    file = tmp_path / "arm.urdf"
    file.write_text(ARM)
    return file


def test_shapes_of_a_urdf_file_belong_to_their_bodies(arm):
    mechanism = uqmbd.from_urdf(str(arm))
    assert len(add_model_shapes(mechanism)) == 0
    cylinder, part, sphere = mechanism.bodies["upper"].shapes
    assert isinstance(cylinder, Cylinder) and isinstance(part, Mesh) and isinstance(sphere, Sphere)
    ends = cylinder.surface([float(x) for x in cylinder.expressions])[0]
    assert ends[:, 0].min() == pytest.approx(0) and ends[:, 0].max() == pytest.approx(1)
    assert np.ptp(part.vertices, axis=0) == pytest.approx([0.1, 0.2, 0.3], rel=1e-6)
    # the tool is fixed to the upper arm at (1, 0, 0), turned about x: its z axis is the arm's -y axis
    assert [float(x) for x in sphere.position] == pytest.approx([1, -0.2, 0], abs=1e-12)


def test_collision_shapes_of_a_urdf_file(arm):
    mechanism = uqmbd.from_urdf(str(arm))
    add_model_shapes(mechanism, which="collision")
    (shape,) = mechanism.bodies["upper"].shapes
    assert isinstance(shape, Box) and [float(x) for x in shape.size] == [1, 2, 3]
    with pytest.raises(uqmbd.StudyError, match="which is 'shown'"):
        add_model_shapes(mechanism, which="shown")


@pytest.mark.parametrize("name", ["../secret.stl", "/etc/passwd", "package://../secret.stl", "meshes/link.stl"])
def test_files_outside_of_the_folder_are_not_read(arm, name):
    folder = arm.parent / "model"
    (folder / "meshes").mkdir(parents=True)
    write_stl(arm.parent / "secret.stl", *box((1, 1, 1)))
    (folder / "meshes" / "link.stl").symlink_to(arm.parent / "secret.stl")
    file = folder / "arm.urdf"
    file.write_text(ARM.replace("meshes/part.stl", name))
    rows = add_model_shapes(uqmbd.from_urdf(str(file)))
    assert ["outside of" in row.why or "is not in" in row.why for row in rows] == [True]


def test_shapes_of_an_mjcf_file(tmp_path):
    pytest.importorskip("mujoco", reason="mujoco is not installed: shapes of MJCF files are not verified")
    write_stl(tmp_path / "part.stl", *box((1, 2, 3)))
    file = tmp_path / "arm.xml"
    file.write_text(
        '<mujoco><asset><mesh name="part" file="part.stl"/></asset><worldbody><geom type="plane" size="1 1 1"/>'
        '<body name="upper" pos="0 0 1"><joint type="hinge" axis="0 0 1"/>'
        '<geom type="mesh" mesh="part"/><geom type="capsule" size="0.1 0.5" pos="1 0 0" contype="0" conaffinity="0"/>'
        "</body></worldbody></mujoco>"
    )
    mechanism = uqmbd.from_mjcf(str(file))
    assert len(add_model_shapes(mechanism)) == 0
    part, capsule = mechanism.bodies["upper"].shapes
    vertices = part.surface([float(x) for x in part.expressions])[0]
    assert np.ptp(vertices, axis=0) == pytest.approx([1, 2, 3], rel=1e-6)
    assert [float(x) for x in capsule.expressions] == pytest.approx([1, 0, 0, 0.1, 1.0])
    again = uqmbd.from_mjcf(str(file))
    add_model_shapes(again, which="collision")
    assert len(again.bodies["upper"].shapes) == 1
