"""The reader of URDF: without MuJoCo, as a second reading has it, tolerant where others are, and clear where it refuses."""

from __future__ import annotations

import os
import random
import re
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

import uqmbd
from uqmbd_models import URDF, documents
from uqmbd_models.inertia import excess, nearest
from uqmbd_models.motion import place
from uqmbd_models.rotations import matrix
from uqmbd_models.urdf import read_urdf

from .plain_urdf import elements, plain

INERTIAL = (
    '<inertial><mass value="1"/><inertia ixx="{}" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'.format
)
BODY = (
    '<link name="base"/><link name="a">{}</link><joint name="j" type="continuous"><parent link="base"/>'
    '<child link="a"/><axis xyz="0 1 0"/></joint>'
).format

RICH = """<?xml version="1.0"?>
<!-- a robot with one of each -->
<robot name="rich" xmlns:drake="http://example.org">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="world"/>
  <link name="cart">
    <inertial><origin xyz="0.1 0 -0.2" rpy="0.3 -0.2 0.1"/><mass value="4"/>
      <inertia ixx="0.3" iyy="0.4" izz="0.5" ixy="0.01" ixz="-0.02" iyz="0.03"/></inertial>
    <visual><geometry><box size="1 1 1"/></geometry><material name="grey"/></visual>
    <collision><geometry><mesh filename="package://nowhere/cart.stl"/></geometry></collision>
  </link>
  <link name="arm"><inertial><origin xyz="0 0 0.25"/><mass value="1.5e0"/>
    <inertia ixx="0.04" iyy="0.05" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="tool"><visual><geometry><sphere radius="0.1"/></geometry></visual></link>
  <link name="jaw"><inertial><mass value=".2"/><inertia ixx="1e-3" iyy="2e-3" izz="1.5e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="ball"><inertial><mass value="0.3"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="plane" type="planar"><origin xyz="0 1 0" rpy="0.1 0 0"/><parent link="world"/><child link="cart"/><axis xyz="0 0 2"/></joint>
  <joint name="elbow" type="revolute"><origin xyz="0.1 0 0.2" rpy="0 0.5 -0.4"/><parent link="cart"/><child link="arm"/>
    <axis xyz="0 1 1"/><limit lower="-1.5" upper="2" effort="10" velocity="3"/><dynamics damping="0.2" friction="0.1"/></joint>
  <joint name="flange" type="fixed"><origin xyz="0 0 0.5"/><parent link="arm"/><child link="tool"/></joint>
  <joint name="grip" type="prismatic"><origin xyz="0 0.05 0"/><parent link="tool"/><child link="jaw"/><axis xyz="0 1 0"/>
    <mimic joint="elbow" multiplier="0.02" offset="0.01"/></joint>
  <joint name="loose" type="floating"><origin xyz="0 0 2" rpy="0 3.14159 0"/><parent link="world"/><child link="ball"/></joint>
  <transmission name="drive"/><gazebo reference="arm"><drake:x/></gazebo>
</robot>
"""

CHAIN = """<robot name="chain"><link name="base"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="one"><inertial><origin xyz="0.1 0 0" rpy="0 0.1 0"/><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="two"><inertial><mass value="0.5"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="pin" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="slide" type="prismatic"><parent link="one"/><child link="two"/><origin xyz="0 0 1" rpy="0 0 1"/><axis xyz="1 0 0"/></joint></robot>"""


@pytest.fixture
def file(tmp_path):
    """Write a file, and return its path."""

    def write(text):
        path = tmp_path / "robot.urdf"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return str(path)

    return write


def rows(read):
    """What was left out, by kind."""
    return {row.what: row.names for row in read.not_taken}


# -- what other readers take -------------------------------------------------------------------------------------------
TAKEN = {
    "prefix without a namespace": (
        f'<robot name="r">{BODY(INERTIAL(0.1))}<drake:group name="g"><drake:member link="a"/></drake:group></robot>',
        {"deviations from XML": ("prefix 'drake' without a namespace",), "elements of other programs": ("<drake:group> in <robot>",)},
    ),
    "attribute with a prefix": (
        f'<robot name="r">{BODY(INERTIAL(0.1)).replace("<axis", "<axis drake:x=" + chr(34) + "1" + chr(34))}</robot>',
        {"deviations from XML": ("prefix 'drake' without a namespace",), "elements of other programs": ("drake:x of <axis> of joint 'j'",)},
    ),
    "blank lines before the declaration": (
        f"\n  \r\n<?xml version='1.0'?><robot name='r'>{BODY(INERTIAL(0.1))}</robot>",
        {"deviations from XML": ("white space before <?xml",)},
    ),
    "byte order mark and a blank line": (
        b"\xef\xbb\xbf\n<?xml version='1.0' encoding='utf-8'?><robot name='r'>" + BODY(INERTIAL(0.1)).encode() + b"</robot>",
        {"deviations from XML": ("white space before <?xml",)},
    ),
    "dashes in a comment": (
        f"<robot name='r'><!-- ---- a -- b ---->{BODY(INERTIAL(0.1))}</robot>",
        {"deviations from XML": ("-- in a comment",)},
    ),
    "UTF-16": (f"<?xml version='1.0'?><robot name='r'>{BODY(INERTIAL(0.1))}</robot>".encode("utf-16"), {}),
    "a document type": (f"<!DOCTYPE robot><robot name='r'>{BODY(INERTIAL(0.1))}</robot>", {}),
    "a namespace for all": (f"<robot name='r' xmlns='http://example.org'>{BODY(INERTIAL(0.1))}</robot>", {}),
    "colour of five numbers": (
        "<robot name='r'>"
        + BODY('<visual><geometry><sphere radius="x"/></geometry><material><color rgba="1 1 1 1 1"/></material></visual>' + INERTIAL(0.1))
        + "</robot>",
        {},
    ),
    "no <inertia>": (
        f"<robot name='r'>{BODY('<inertial><origin xyz=' + repr('0 0 1') + '/><mass value=' + repr('1') + '/></inertial>')}</robot>",
        {"links without <inertia>": ("a",)},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("text", "listed"), TAKEN.values(), ids=TAKEN)
def test_files_that_other_readers_take_are_read_and_what_they_lack_is_listed(text, listed, file):
    read = URDF().read(file(text))
    assert list(read.bodies) == ["a"] and float(read.bodies["a"].mass) == 1
    found = rows(read)
    assert listed.items() <= found.items()
    assert ("deviations from XML" in listed) == ("deviations from XML" in found)


def test_links_without_mass_are_listed(file):
    text = (
        BODY(INERTIAL(0.1))
        + '<link name="tip"/><link name="shell"><visual/></link><link name="ghost"><inertial><mass value="0"/></inertial></link>'
    )
    for k, name in enumerate(("tip", "shell", "ghost")):
        text += f'<joint name="f{k}" type="fixed"><parent link="a"/><child link="{name}"/></joint>'
    found = rows(URDF().read(file(f'<robot name="r">{text}</robot>')))
    assert found["links without mass and shape"] == ("base", "tip") and found["links with a shape only"] == ("shell",)
    assert found["links whose mass is zero"] == found["links without <inertia>"] == ("ghost",)


def test_urdf_needs_no_mujoco(file, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    read = uqmbd.from_urdf(file(RICH))
    assert list(read.bodies) == ["cart_after_plane_TX", "cart_after_plane_TY", "cart", "arm", "jaw", "ball"]
    assert {name: joint.kind for name, joint in read.joints.items()} == {
        "plane_TX": "slide", "plane_TY": "slide", "plane_RZ": "hinge", "elbow": "hinge", "grip": "slide", "loose": "free",
    }  # fmt: skip
    assert read.joints["elbow"].limits == (-1.5, 2.0) and rows(read)["limits of joints"] == ("elbow",)


# -- what is refused ---------------------------------------------------------------------------------------------------
HEAD = "<?xml version='1.0'?>\n<!DOCTYPE robot ["
LINK = "]>\n<robot name='r'><link name='base'/><link name='&{};'/></robot>"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEAD + "<!ENTITY a 'x'>" + "".join(f"<!ENTITY {y} '{'&' + x + ';' * 1}{('&' + x + ';') * 9}'>" for x, y in zip("abcdefghi", "bcdefghij", strict=True)) + LINK.format("j"), "an entity"),
        (HEAD + "<!ENTITY a SYSTEM 'file:///etc/passwd'>" + LINK.format("a"), "an entity"),
        (HEAD + "<!ENTITY % a SYSTEM 'http://example.org/a.dtd'> %a;" + LINK.format("b"), "an entity"),
        (HEAD + "]>\n<robot name='r'><link name='&undeclared;'/></robot>", "undefined entity"),
        ("<!DOCTYPE robot SYSTEM 'robot.dtd'><robot name='r'>&a;</robot>", "line 1"),
    ],
)  # fmt: skip
def test_entities_and_other_documents_are_refused(text, said, file):
    with pytest.raises(uqmbd.StudyError, match=said) as error:
        URDF().read(file(text))
    assert "robot.urdf" in str(error.value) and "line " in str(error.value)


WRONG = [
    ('<mass value="1.5e0"/>', '<mass value="1_000"/>', "<mass> of link 'arm': value is '1_000'; expected a finite number"),
    ('<mass value="1.5e0"/>', '<mass value="-2"/>', "<mass> of link 'arm': value is '-2'; expected a number of at least 0"),
    ('<mass value=".2"/>', '<mass value="nan"/>', "<mass> of link 'jaw': value is 'nan'; expected a finite number"),
    ('ixx="0.3"', 'ixx="x"', "<inertia> of link 'cart': ixx is 'x'; expected a finite number"),
    ('xyz="0 0 0.25"', 'xyz="0 0"', "<origin> of link 'arm': xyz is '0 0'; expected three finite numbers"),
    ('rpy="0 0.5 -0.4"', 'rpy="0 0.5 inf"', "<origin> of joint 'elbow': rpy is '0 0.5 inf'; expected three finite numbers"),
    ('xyz="0 1 1"', 'xyz="0 0 0"', "<axis> of joint 'elbow': xyz is zero; expected a direction"),
    ('damping="0.2"', 'damping="-0.2"', "<dynamics> of joint 'elbow': damping is '-0.2'; expected a number of at least 0"),
    ('upper="2"', 'upper="2,5"', "<limit> of joint 'elbow': upper is '2,5'; expected a finite number"),
    ('type="revolute"', 'type="hinge"', "<joint> 'elbow': the type is 'hinge'; expected one of revolute"),
    ('<child link="arm"/>', "", "<joint> 'elbow': it has no <child>"),
    ('<child link="arm"/>', '<child link="leg"/>', "<child> of joint 'elbow': the file has no link 'leg'"),
    ('<child link="arm"/>', '<child link="cart"/>', "<joint> 'elbow': the joint connects link 'cart' to itself"),
    ('<child link="jaw"/>', '<child link="arm"/>', "<joint> 'grip': link 'arm' is already the child of joint 'elbow'"),
    ('<parent link="world"/><child link="cart"/>', '<parent link="arm"/><child link="cart"/>', "link 'cart' is its own ancestor"),
    ('<mimic joint="elbow"', '<mimic joint="grip"', "<mimic> of joint 'grip': joint 'grip' mimics itself"),
    ('<mimic joint="elbow"', '<mimic joint="plane"', "<mimic> of joint 'grip': joint 'grip' mimics 'plane', but 'plane' is planar. Both joints"),
    ('multiplier="0.02"', 'multiplier="two"', "<mimic> of joint 'grip': multiplier is 'two'"),
    ('<link name="tool">', "<link>", "<link>: it has no name"),
    ("</robot>", "", "is not valid XML: line"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "said"), WRONG, ids=[said for *_, said in WRONG])
def test_a_malformed_file_is_refused_with_line_and_element(old, new, said, file):
    assert RICH.count(old) == 1
    path = file(RICH.replace(old, new))
    with pytest.raises(uqmbd.StudyError) as error:
        URDF().read(path)
    message = str(error.value)
    assert said in message and path in message
    line = RICH[: RICH.index(old)].count("\n") + 1
    if "is its own ancestor" not in said:
        assert re.search(rf"line {line if old != '</robot>' else line + 1}\b", message), message


def test_joints_that_mimic_each_other_in_a_circle_are_refused(file):
    text = RICH.replace('<dynamics damping="0.2" friction="0.1"/>', '<mimic joint="grip"/>')
    with pytest.raises(uqmbd.StudyError, match="mimic each other in a cycle"):
        URDF().read(file(text))


def test_pipes_and_huge_files_are_refused_before_they_are_read(file, tmp_path, monkeypatch):
    os.mkfifo(tmp_path / "pipe.urdf")
    with pytest.raises(uqmbd.StudyError, match="is a pipe or a device"):
        uqmbd.from_urdf(tmp_path / "pipe.urdf")
    monkeypatch.setattr(documents, "LARGEST", 100)
    with pytest.raises(uqmbd.StudyError, match="expected a file of at most 100"):
        uqmbd.from_urdf(file(RICH))


def test_lines_count_from_the_first_one_of_the_file(file):
    text = "\n\n<?xml version='1.0'?>\n<!-- a\n -- b -->\n<robot name='r'>\n<link name='a'>\n<inertial><mass value='x'/></inertial></link></robot>"
    with pytest.raises(uqmbd.StudyError, match="line 8: <mass> of link 'a'"):
        URDF().read(file(text))


# -- any file ----------------------------------------------------------------------------------------------------------
VALUES = (
    "", "nan", "inf", "-1", "0", "1e300", "1e-300", "-0", "a", "0 0", "0 0 0", "3 -4 12", "1 2 3 4 5", "1_0", "1,5", "0x10", "\u0663", "\u00e4/..",
    "world", "cart", "arm", "elbow", "grip", "fixed", "floating", "planar", "continuous", "${x}", "&amp;", "a\nb", " 0.5 ", "1e999", "x" * 300,
)  # fmt: skip
PARTS = (
    "<x/>",
    "<link/>",
    "<y:z/>",
    "<!-- - -- -->",
    "<![CDATA[<]]>",
    "&#0;",
    "&a;",
    "<?p?>",
    "<",
    ">",
    "\x00",
    "\xff",
    "<joint/>",
    "\n",
)


def changed(rng, text):
    """A text with one to three values, names, elements or bytes changed, taken away, doubled or exchanged."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        kind = rng.randrange(8)
        attributes = list(re.finditer(r'([\w:]+)="([^"]*)"', text))
        single = list(re.finditer(r"<\w+[^<>]*/>", text))
        if kind <= 2 and attributes:
            found = rng.choice(attributes)
            value = rng.choice(VALUES) if rng.random() < 0.6 else rng.choice(attributes).group(2)
            text = text[: found.start(2)] + value + text[found.end(2) :]
        elif kind == 3 and attributes:
            found = rng.choice(attributes)
            text = text[: found.start()] + text[found.end() :]
        elif kind == 4 and single:
            found = rng.choice(single)
            text = (
                text[: found.start()]
                + rng.choice(("", 2 * found.group(), rng.choice(single).group()))
                + text[found.end() :]
            )
        elif kind == 5:
            place_ = rng.randrange(len(text) + 1)
            text = text[:place_] + rng.choice(PARTS) + text[place_:]
        elif kind == 6 and attributes:
            found = rng.choice(attributes)
            text = text[: found.start(1)] + rng.choice(("xyz", "value", "x:y", "link", "name")) + text[found.end(1) :]
        else:
            start = rng.randrange(len(text) + 1)
            text = text[:start] + text[start + rng.randrange(1, 40) :]
    return text


def agrees(path, text):
    """Compare a file with the second reading: poses, masses, joints, mimics."""
    tree, expected = read_urdf(path), plain(text)
    poses = place(tree, {k: joint.name for k, joint in enumerate(tree.joints)}).poses
    size = max([1.0, *(float(abs(x).max()) for x in expected.frames.values())])
    assert {link.name for link in tree.links} == {"world", *expected.frames}
    for k, link in enumerate(tree.links):
        if not k:
            continue
        mass, com, tensor = expected.masses[link.name]
        turn = matrix(poses[k].quaternion)
        np.testing.assert_allclose(poses[k].position, expected.frames[link.name][:3, 3], rtol=0, atol=1e-12 * size)
        np.testing.assert_allclose(turn, expected.frames[link.name][:3, :3], rtol=0, atol=1e-12)
        assert link.inertial.mass == mass
        reach = size + abs(link.inertial.com).max()
        np.testing.assert_allclose(poses[k].point(link.inertial.com), com, rtol=0, atol=1e-12 * reach)
        np.testing.assert_allclose(
            turn @ link.inertial.inertia @ turn.T, tensor, rtol=0, atol=1e-12 * abs(tensor).max()
        )
    kinds = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide"}
    joints = {joint.name: joint for joint in tree.joints if joint.kind != "free"}
    assert len(joints) == sum(3 if kind == "planar" else 1 for kind, *_ in expected.joints.values())
    for name, (kind, point, axis, damping, friction) in expected.joints.items():
        joint = joints[name if kind in kinds else f"{name}_RZ"]
        assert joint.kind == kinds.get(kind, "hinge") and (joint.damping, joint.friction) == (damping, friction)
        pose = poses[joint.link]
        np.testing.assert_allclose(pose.position, point, rtol=0, atol=1e-12 * size)
        np.testing.assert_allclose(matrix(pose.quaternion) @ joint.axis, axis, rtol=0, atol=1e-12)
    couplings = {x.joint: (x.other, x.coefficients[1], x.coefficients[0]) for x in tree.couplings}
    assert couplings == expected.mimics


def sweep(file, seeds):
    """Read changed files: each is refused in one sentence that names it, or agrees with the second reading."""
    read, refused = 0, 0
    for seed in seeds:
        rng = random.Random(seed)
        text = changed(rng, rng.choice((RICH, CHAIN))).encode("utf-8", "surrogatepass")
        path = file(text)
        try:
            read_urdf(path)
        except uqmbd.StudyError as error:
            message = str(error)
            assert path in message and len(message) < 1200 and re.search(r"line \d+", message), message
            refused += 1
            continue
        agrees(path, re.sub(rb"<!--.*?-->", b"", text, flags=re.DOTALL))
        read += 1
    return read, refused


def test_changed_files_agree_with_a_second_reading_or_are_refused(file):
    read, refused = sweep(file, range(150))
    assert read > 30 and refused > 30


@pytest.mark.slow
def test_many_changed_files_agree_with_a_second_reading_or_are_refused(file):
    read, refused = sweep(file, range(1000, 2500))
    assert read > 300 and refused > 300


def test_the_second_reading_is_one():
    assert len(elements(RICH.encode()).findall("joint")) == 5
    found = plain(RICH.encode())
    np.testing.assert_allclose(found.frames["ball"][:3, 3], (0, 0, 2))
    assert found.joints["elbow"][3:] == (0.2, 0.1) and found.mimics == {"grip": ("elbow", 0.02, 0.01)}


# -- inertia -----------------------------------------------------------------------------------------------------------
def second_moments(tensor):
    """Integral of ``x x^T`` over the mass of a body, from its inertia."""
    return np.trace(tensor) / 2 * np.eye(3) - tensor


# squares of what is drawn are far from underflow
ENTRIES = st.floats(-1, 1).map(lambda x: round(x, 9))
TENSORS = st.tuples(st.lists(ENTRIES, min_size=6, max_size=6), st.integers(-12, 9))


@given(TENSORS)
@settings(max_examples=100, deadline=None)
def test_the_repaired_inertia_is_the_nearest_in_second_moments(drawn):
    """Conditions that hold at the projection onto a convex cone, and nowhere else (Moreau)."""
    entries, power = drawn
    tensor = np.zeros((3, 3))
    tensor[np.triu_indices(3)] = entries
    tensor = (tensor + tensor.T) * 10.0**power
    stated, found = second_moments(tensor), second_moments(nearest(tensor))
    size = np.linalg.norm(stated)
    assert np.linalg.eigvalsh(found).min() >= -1e-14 * size
    assert np.linalg.eigvalsh(found - stated).min() >= -1e-14 * size
    assert abs(np.trace(found @ (found - stated))) <= 1e-13 * size**2
    assert excess(nearest(tensor)) <= 1e-13 * size
    if excess(tensor) <= 0:
        np.testing.assert_allclose(nearest(tensor), tensor, rtol=0, atol=1e-14 * size)


@pytest.mark.thorough
def test_no_search_finds_a_nearer_one():
    """A body's second moments are L L^T: the least distance over all L, by a general method."""
    rng = np.random.default_rng(5)
    for _ in range(20):
        tensor = rng.normal(size=(3, 3))
        tensor = tensor + tensor.T
        stated = second_moments(tensor)

        def distance(x, stated=stated):
            factor = x.reshape(3, 3)
            return np.linalg.norm(factor @ factor.T - stated) ** 2

        best = min(minimize(distance, rng.normal(size=9), tol=1e-14).fun for _ in range(5))
        assert np.linalg.norm(second_moments(nearest(tensor)) - stated) ** 2 == pytest.approx(best, rel=1e-6, abs=1e-9)


@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.integers(-9, 9))
@settings(max_examples=100, deadline=None)
def test_points_with_mass_have_no_excess(seed, count, power):
    rng = np.random.default_rng(seed)
    points, masses = rng.normal(size=(count, 3)) * 10.0**power, rng.uniform(0.1, 1, count)
    moments = np.einsum("k,ki,kj->ij", masses, points, points)
    tensor = np.trace(moments) * np.eye(3) - moments
    assert excess(tensor) <= 1e-12 * np.trace(tensor)


ROD = (
    '<robot name="r">\n<link name="base"/>\n<link name="a"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>\n'
    '<inertia ixx="0.1" iyy="0.5" izz="0.2" ixy="0" ixz="0" iyz="0"/></inertial></link>\n'
    '<joint name="j" type="continuous"><parent link="base"/><child link="a"/><axis xyz="{}"/></joint></robot>'
).format


def test_inertia_that_no_body_has_is_refused_with_what_to_do(file):
    with pytest.raises(uqmbd.StudyError) as error:
        uqmbd.from_urdf(file(ROD("0 1 0")))
    for part in ("line 3: body 'a'", "0.5 > 0.3", 'inertia="repair"', 'inertia="as stated"'):
        assert part in str(error.value)
    with pytest.raises(uqmbd.StudyError, match="inertia is 'mend'; expected one of 'refuse', 'as stated', 'repair'"):
        uqmbd.from_urdf(file(ROD("0 1 0")), inertia="mend")


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("how", "axis", "moment"),
    [("as stated", "0 1 0", 0.5), ("repair", "0 1 0", 0.5), ("as stated", "1 0 0", 0.1), ("repair", "1 0 0", 0.2)],
)
def test_a_pendulum_with_inertia_as_stated_or_repaired(how, axis, moment, file):
    """(m l^2 + J) q'' = -m g l sin q from an angle of 1 rad: J of the file, or half the excess more."""
    read = uqmbd.from_urdf(file(ROD(axis).replace("<axis", f'<origin rpy="{axis}"/><axis')), inertia=how)
    assert rows(read)["physically impossible inertia"] == ("a (largest moment 0.5, the others 0.1 and 0.2 kg m^2)",)
    times = np.linspace(0, 1, 11)
    found = uqmbd.simulate(read, times, rtol=1e-9, check=False)["j"]
    whole = 2 * 0.5**2 + moment
    exact = solve_ivp(
        lambda t, y: (y[1], -2 * 9.81 * 0.5 * np.sin(y[0]) / whole),
        (0, 1),
        (1, 0),
        t_eval=times,
        rtol=1e-11,
        atol=1e-12,
    )
    np.testing.assert_allclose(found, exact.y[0] - 1, rtol=0, atol=1e-7)


@pytest.mark.thorough
def test_a_free_body_with_inertia_as_stated_obeys_eulers_equations(file):
    """J w' = T - w x J w with the tensor of the file, turned in the link, and a torque in body axes."""
    text = (
        '<robot name="r"><link name="a"><inertial><origin xyz="0 0 0" rpy="0.3 -0.4 0.5"/><mass value="2"/>'
        '<inertia ixx="0.1" iyy="0.5" izz="0.2" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>'
    )
    from uqmbd_springs import Torque

    read = uqmbd.from_urdf(file(text), floating=True, inertia="as stated")
    body = read.bodies["a"]
    read.add(Torque("torque", body, (0.3, 0.2, -0.4), frame="body"))
    for k in range(3):
        read.output(f"w{k}", (body.rotation.T * body.angular_velocity)[k], units="rad/s")
    times = np.linspace(0, 2, 11)
    found = uqmbd.simulate(read, times, rtol=1e-9, check=False)
    turn = plain(text.encode()).masses["a"][2]

    def rate(t, w):
        return np.linalg.solve(turn, (0.3, 0.2, -0.4) - np.cross(w, turn @ w))

    exact = solve_ivp(rate, (0, 2), np.zeros(3), t_eval=times, rtol=1e-11, atol=1e-12).y
    np.testing.assert_allclose([found[f"w{k}"] for k in range(3)], exact, rtol=0, atol=1e-7)
    assert np.abs(exact).max() > 1


def test_a_negative_moment_can_be_repaired_only(file):
    text = ROD("0 1 0").replace('ixx="0.1"', 'ixx="-0.1"')
    for how, said in (
        ("refuse", "not positive semi-definite"),
        ("as stated", "a principal moment of inertia is negative"),
    ):
        with pytest.raises(uqmbd.StudyError, match=said):
            uqmbd.from_urdf(file(text), inertia=how)
    values = uqmbd.from_urdf(file(text), inertia="repair").bodies["a"].terms.values["inertia"]
    # second moments 0.4, -0.2, 0.1: without the negative one
    np.testing.assert_allclose([float(x) for x in values], (0.1, 0.5, 0.4, 0, 0, 0), rtol=0, atol=1e-15)


@pytest.mark.parametrize("scale", [1e-12, 1e-6, 1.0, 1e6, 1e12])
def test_what_is_rounding_depends_on_the_model_and_not_on_its_units(scale, file):
    text = (
        f'<robot name="r"><link name="base"/><link name="a">{{}}</link><link name="b"><inertial><mass value="{scale}"/>'
        '<inertia ixx="{}" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="j" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/></joint>'
        '<joint name="k" type="continuous"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/></joint></robot>'
    ).format
    whole = INERTIAL(0.1 * scale).replace('"0.1"', f'"{0.1 * scale}"').replace('value="1"', f'value="{scale}"')
    read = uqmbd.from_urdf(file(text(whole, 4.076e-17 * scale)))
    assert len(rows(read)["moments of inertia with rounding errors"]) == 1
    values = [float(x) for x in read.bodies["b"].terms.values["inertia"]]
    np.testing.assert_allclose(values, np.array([1, 0.5, 0.5, 0, 0, 0]) * 4.076e-17 * scale, rtol=1e-12)
    with pytest.raises(uqmbd.StudyError, match="the inertia tensor is physically impossible"):
        uqmbd.from_urdf(file(text(whole, 1e-9 * scale)))


def test_a_merged_link_whose_inertia_no_body_has_is_listed(file):
    text = BODY(INERTIAL(0.1)) + f'<link name="b">{INERTIAL(0.3)}</link>'
    text += '<joint name="k" type="fixed"><parent link="a"/><child link="b"/><origin xyz="0 0 1"/></joint>'
    assert rows(uqmbd.from_urdf(file(f'<robot name="r">{text}</robot>')))[
        "physically impossible inertia of merged links"
    ] == ("b",)


FIXED = (
    f'<link name="world"/><link name="base">{INERTIAL(0.1)}</link><joint name="bolt" type="fixed"><parent link="world"/>'
    f'<child link="base"/></joint><link name="arm">{INERTIAL(0.1)}</link><joint name="j" type="continuous"><parent link="base"/>'
    '<child link="arm"/><axis xyz="0 1 0"/></joint>'
)


def test_a_fixed_joint_to_the_world_that_floating_replaces_is_listed(file):
    path = file(f'<robot name="r">{FIXED}</robot>')
    told = {one.what: one.names for one in uqmbd.from_urdf(path, floating=True).not_taken}
    assert told["fixed joints to the world"] == ("bolt",)
    assert "fixed joints to the world" not in {one.what for one in uqmbd.from_urdf(path).not_taken}


@pytest.mark.parametrize("angle", ["1e300", "-1e300", "2e6", "1e308"])
@pytest.mark.parametrize("place", ["joint", "inertial"])
def test_angles_that_say_nothing_of_a_direction_are_refused(file, place, angle):
    origin = f'<origin rpy="0 {angle} 0"/>'
    text = f'<robot name="r">{FIXED}</robot>'
    tag = '<joint name="j" type="continuous">' if place == "joint" else "<inertial>"
    with pytest.raises(
        uqmbd.StudyError,
        match=rf"rpy is '0 {re.escape(angle)} 0'; expected three angles in rad, of magnitude up to 1e\+06",
    ):
        uqmbd.from_urdf(file(text.replace(tag, tag + origin, 1)))
