"""Files that are wrong in every way: a clear error that names the file, or a mechanism; never a failure from inside."""

from __future__ import annotations

import random
import re
import sys
import warnings

import pytest

import uqmbd
from uqmbd_models import MJCF, URDF
from uqmbd_models import files as files_module

ROBOT = """<robot name="r"><link name="base"/><link name="arm"><inertial><origin xyz="0.1 0 0" rpy="0 0.1 0"/>
<mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="hand"><inertial><mass value="0.5"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
</link><joint name="pin" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/><dynamics damping="0.1" friction="0.1"/></joint>
<joint name="slide" type="prismatic"><parent link="arm"/><child link="hand"/><origin xyz="0 0 1"/><axis xyz="1 0 0"/>
<mimic joint="pin" multiplier="0.5"/></joint></robot>"""

MODEL = """<mujoco model="m"><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody><body name="a">
<joint name="q" type="hinge" axis="0 1 0" range="-1 1" armature="0.1" stiffness="2"/><geom name="g" type="sphere" size="0.1"/>
<body name="b" pos="0 0 1"><joint name="s" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="1"
diaginertia="1 1 1"/></body></body></worldbody><equality><connect body1="b" anchor="0 0 0"/>
<joint joint1="s" joint2="q" polycoef="0 1 0 0 0"/></equality><keyframe><key name="k" qpos="0.1 0.2"/></keyframe></mujoco>"""

VALUES = (
    "",
    "nan",
    "inf",
    "-1",
    "0",
    "1e300",
    "a",
    "0 0",
    "0 0 0",
    "1 2 3 4 5 6 7 8",
    "ground",
    "pin",
    "q",
    "\u00e4/..",
)


def mutations(text, count):
    """Texts with one or two values, elements or characters changed, taken away or doubled."""
    rng = random.Random(7)
    for _ in range(count):
        changed = text
        for _ in range(rng.choice((1, 1, 2))):
            kind = rng.randrange(5)
            attributes = list(re.finditer(r'(\w+)="([^"]*)"', changed))
            if kind <= 1 and attributes:
                found = rng.choice(attributes)
                changed = changed[: found.start(2)] + rng.choice(VALUES) + changed[found.end(2) :]
            elif kind == 2 and attributes:
                found = rng.choice(attributes)
                changed = changed[: found.start()] + changed[found.end() :]
            elif kind == 3:
                found = rng.choice(list(re.finditer(r"<\w+[^<>]*/>", changed)))
                changed = changed[: found.start()] + rng.choice(("", 2 * found.group())) + changed[found.end() :]
            else:
                place = rng.randrange(len(changed))
                changed = changed[:place] + changed[place + rng.randrange(1, 30) :]
        yield changed


@pytest.mark.slow
@pytest.mark.parametrize(
    ("reader", "text", "ending"), [(URDF, ROBOT, "urdf"), (MJCF, MODEL, "xml")], ids=["urdf", "mjcf"]
)
@pytest.mark.filterwarnings("ignore::uqmbd.StudyWarning")
def test_a_changed_file_is_read_or_refused(reader, text, ending, tmp_path):
    if reader is MJCF:
        pytest.importorskip("mujoco", reason="the extra mujoco is not installed")
    path = tmp_path / f"wrong.{ending}"
    read, refused = 0, 0
    for changed in mutations(text, 150):
        path.write_text(changed, encoding="utf-8")
        try:
            reader().read(str(path))
            read += 1
        except uqmbd.StudyError as error:
            assert "wrong." in str(error), str(error)
            refused += 1
    assert read > 20 and refused > 20


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is not valid XML"),
        ("<mujoco/>", "it is MJCF: use uqmbd.from_mjcf"),
        ("<sdf/>", "the root element is <sdf>; expected <robot>"),
        (
            '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include filename="y"/></robot>',
            "is a xacro template (line 1: <xacro:include>); expand it first",
        ),
        ("\x00\x01\x02", "is not valid XML"),
    ],
)
def test_what_is_no_urdf_is_reported_without_mujoco(text, said, tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(uqmbd.StudyError, match=re.escape(said)):
        URDF().read(str(path))


def test_a_folder_and_a_file_that_is_not_there(tmp_path):
    with pytest.raises(uqmbd.StudyError, match="is a folder; expected a file"):
        URDF().read(str(tmp_path))
    with pytest.raises(uqmbd.StudyError, match="there is no such file"):
        MJCF().read(str(tmp_path / "nothing.xml"))


def test_without_mujoco_it_is_reported_what_to_install(tmp_path, monkeypatch):
    path = tmp_path / "model.xml"
    path.write_text(MODEL, encoding="utf-8")
    monkeypatch.setitem(sys.modules, "mujoco", None)
    said = r'from_mjcf parses .* which cannot be imported \(.+\)\. Install it with: pip install "uqmbd\[mujoco\]"'
    with pytest.raises(uqmbd.StudyError, match=said):
        MJCF().read(str(path))


def test_an_older_mujoco_is_reported(tmp_path, monkeypatch):
    path = tmp_path / "model.xml"
    path.write_text(MODEL, encoding="utf-8")
    old = type(sys)("mujoco")
    old.__version__ = "2.3.0"
    monkeypatch.setitem(sys.modules, "mujoco", old)
    with pytest.raises(uqmbd.StudyError, match=r"a later MuJoCo than 2\.3\.0"):
        files_module.load(str(path))


@pytest.mark.parametrize(
    ("keywords", "said"),
    [({"path": 3}, "path is 3; expected a text or a path"), ({"fuse": 1}, "fuse is 1; expected True")],
)
def test_arguments(keywords, said):
    with pytest.raises(uqmbd.StudyError, match=re.escape(said)):
        uqmbd.from_urdf(**{"path": "robot.urdf", **keywords})


def test_a_keyframe_that_is_not_there(tmp_path):
    pytest.importorskip("mujoco", reason="the extra mujoco is not installed")
    path = tmp_path / "model.xml"
    path.write_text(MODEL, encoding="utf-8")
    with pytest.raises(uqmbd.StudyError, match="the file has no keyframe 'home'; its keyframes are: 'k'"):
        MJCF().read(str(path), keyframe="home")


def test_what_mujoco_warns_of_is_in_the_table_and_in_no_file(tmp_path, monkeypatch, capfd):
    mujoco = pytest.importorskip("mujoco", reason="the extra mujoco is not installed")
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "model.xml"
    path.write_text(MODEL, encoding="utf-8")
    compiled = mujoco.MjSpec.compile

    def warning(spec):
        warnings.warn("the model is warned of", RuntimeWarning, stacklevel=2)
        return compiled(spec)

    monkeypatch.setattr(mujoco.MjSpec, "compile", warning)
    read = MJCF().read(str(path))
    assert sorted(x.name for x in tmp_path.iterdir()) == ["model.xml"]
    assert {row.what: row.names for row in read.not_taken}["warnings of MuJoCo"] == ("the model is warned of",)
    assert capfd.readouterr().out == ""


def test_importing_uqmbd_does_not_import_mujoco():
    import subprocess

    code = "import sys, uqmbd, uqmbd_models; uqmbd.from_urdf; print('mujoco' in sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "False"


def told(path):
    """What a URDF file says and its mechanism does not, by kind."""
    return {row.what: row.names for row in URDF().read(str(path)).not_taken}


def test_what_is_misspelt_in_a_urdf_is_reported(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(ROBOT, encoding="utf-8")
    assert "unknown elements and attributes" not in told(path)
    changes = {
        'damping="0.1"': 'dampng="0.1"',
        '<origin xyz="0 0 1"/>': '<origin xzy="0 0 1"/><foo/><!-- a comment -->',
        '<mass value="0.5"/>': '<mass value="0.5" unit="kg"/><com/>',
        "</robot>": '<lnik name="z"/></robot>',
    }
    text = ROBOT
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    assert set(told(path)["unknown elements and attributes"]) == {
        "dampng of <dynamics> of joint 'pin'",
        "xzy of <origin> of joint 'slide'",
        "<foo> of joint 'slide'",
        "unit of <mass> of link 'hand'",
        "<com> in <inertial> of link 'hand'",
        "<lnik> in <robot>",
    }


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        ('lower="2" upper="-2"', ("pin (2 to -2)",)),
        ('lower="0" upper="0"', ("pin (0 to 0)",)),
        ("", ("pin (0 to 0)",)),
        ('upper="1"', None),
    ],
)
def test_limits_without_a_range_are_reported(limits, expected, tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(ROBOT.replace('lower="-1" upper="1"', limits), encoding="utf-8")
    assert told(path).get("limits without a range") == expected
    assert URDF().read(str(path)).joints["pin"].limits == (None if expected else (0, 1))


BASE = '<link name="odom"/>'
ARM = '<link name="{}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
HINGE = '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/></joint>'


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        (
            BASE + ARM.format("arm") + HINGE.format("f", "floating", "odom", "arm"),
            "line 1: <joint> 'f': the floating joint has the parent link 'odom'; expected a link called world. Delete this joint "
            "and link 'odom' and pass floating=True, or rename that link to world.",
        ),
        (
            BASE + 2 * ARM.format("arm"),
            "line 1: <link> 'arm': line 1 already defines a link of this name; expected unique names",
        ),
        (
            BASE + ARM.format("a") + ARM.format("b") + HINGE.format("j", "continuous", "odom", "a") * 2,
            "line 1: <joint> 'j': line 1 already defines a joint of this name; expected unique names",
        ),
        (
            BASE + ARM.format("arm").replace('"1"', '"${mass}"', 1) + HINGE.format("j", "continuous", "odom", "arm"),
            "line 1: <mass> of link 'arm': value is '${mass}', a xacro expression. Expand the template first: xacro FILE.xacro",
        ),
        (BASE + ARM.format("arm"), "the model cannot move: none of its links (2 without the ground) has a joint"),
    ],
)
def test_what_is_no_robot_is_refused_with_what_to_do(inside, said, tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r">{inside}</robot>', encoding="utf-8")
    with pytest.raises(uqmbd.StudyError, match=re.escape(said)):
        URDF().read(str(path))


def test_a_robot_in_pieces_is_reported(tmp_path):
    path = tmp_path / "robot.urdf"
    pieces = BASE + ARM.format("arm") + ARM.format("loose") + HINGE.format("j", "continuous", "odom", "arm")
    path.write_text(f'<robot name="r">{pieces}</robot>', encoding="utf-8")
    assert told(path)["robots of several parts"] == ("odom", "loose")
    path.write_text(f'<robot name="r">{pieces.replace(ARM.format("loose"), "")}</robot>', encoding="utf-8")
    assert "robots of several parts" not in told(path)


def test_a_name_that_is_there_twice_in_mjcf_is_refused(tmp_path):
    pytest.importorskip("mujoco", reason="the extra mujoco is not installed")
    path = tmp_path / "model.xml"
    path.write_text(MODEL.replace('<joint name="s"', '<joint name="q"'), encoding="utf-8")
    with pytest.raises(uqmbd.StudyError, match=r"model\.xml.*repeated name 'q'"):
        MJCF().read(str(path))
