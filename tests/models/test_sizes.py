"""MJCF files that ask for more than can be made end with one message, before MuJoCo makes anything."""

from __future__ import annotations

import random

import pytest

import uqmbd
from uqmbd_models.documents import parse
from uqmbd_models.sizes import COPIES, require_sizes

WORLD = '<worldbody><body name="a"><joint name="q"/><geom size="0.1"/></body>{}</worldbody>'.format

ABSURD = {
    "replicate": (WORLD('<replicate count="1000000000"><body><joint/><geom size="0.1"/></body></replicate>'), "<replicate> requires 1e+09 copies"),
    "replicates in replicates": (WORLD('<replicate count="2000">\n<replicate count="2000"><geom size="1"/></replicate></replicate>'), "line 2: <replicate> requires 4e+06 copies"),
    "a count that is no integer of the machine": (WORLD(f'<replicate count="{10**30}"/>'), "<replicate> requires 1e+30 copies"),
    "bodies in replicates": (WORLD('<replicate count="9000"><body/><body/></replicate>'), "<body> requires 1.8e+04 bodies in total"),
    "flexible grid": (WORLD('<flexcomp type="grid" count="100000 100000 100" name="f"/>'), "<flexcomp> requires 1e+12 bodies"),
    "composite": (WORLD('<body><composite type="cable" count="1000000000 1 1"/></body>'), "<composite> requires 1e+09 bodies"),
    "height field": ('<asset><hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/></asset>' + WORLD(""), "<hfield> requires 1e+10 entries"),
    "texture": ('<asset><texture name="t" builtin="flat" width="1000000" height="1000000"/></asset>' + WORLD(""), "<texture> requires 1e+12 entries"),
    "memory": ('<size memory="1000T"/>' + WORLD(""), "<size>: memory requires 1.1e+15 bytes"),
    "keyframes": ('<size nkey="2000000000"/>' + WORLD(""), "<size>: nkey requires 2e+09 entries"),
    "numbers of each body": ('<size nuser_body="20000000"/>' + WORLD(""), "<size>: nuser_body requires 2e+07 entries"),
    "numbers of a user": ('<size nuserdata="1e18"/>' + WORLD(""), "<size>: nuserdata requires 1e+18 entries"),
    "sensor": (WORLD("") + '<sensor><user dim="2000000000"/></sensor>', "<user> requires 2e+09 entries"),
    "elements in elements": (WORLD("<body>" * 20000 + "</body>" * 20000), "nested more than 500 levels deep"),
}  # fmt: skip


@pytest.mark.parametrize(("inside", "said"), ABSURD.values(), ids=ABSURD)
def test_absurd_sizes_end_in_one_message(inside, said, tmp_path):
    path = tmp_path / "model.xml"
    path.write_text(f"<mujoco>{inside}</mujoco>")
    with pytest.raises(uqmbd.StudyError) as error:
        uqmbd.from_mjcf(path)
    message = str(error.value)
    assert said in message and str(path) in message and "line " in message and "expected" in message


def test_absurd_sizes_of_an_included_file_are_found_there(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "grid.xml").write_text('<mujoco><worldbody>\n<replicate count="300"/></worldbody></mujoco>')
    path = tmp_path / "model.xml"
    path.write_text(
        f"<mujoco>{WORLD('<replicate count=' + chr(34) + '100' + chr(34) + '><include file=' + chr(34) + 'parts/grid.xml' + chr(34) + '/></replicate>')}</mujoco>"
    )
    with pytest.raises(uqmbd.StudyError, match=r"grid\.xml: line 2: <replicate> requires 3e\+04 copies"):
        uqmbd.from_mjcf(path)
    path.write_text('<mujoco><include file="model.xml"/><include file="absent.xml"/></mujoco>')
    require_sizes(str(path), parse("test", str(path), "mjcf").root)


def nested(rng, depth, count):
    """Random bodies and replicates, with what a count by recursion finds: bodies, and the largest number of copies."""
    text, bodies, most = "", 0, count
    for _ in range(rng.randrange(1, 4)):
        times = rng.choice((1, 2, 7, 30))
        inside, found, deepest = nested(rng, depth - 1, count * times) if depth else ("", 0, count * times)
        if rng.random() < 0.5:
            text += f'<replicate count="{times}">{inside}</replicate>'
            bodies, most = bodies + found, max(most, deepest)
        else:
            inside, found, deepest = nested(rng, depth - 1, count) if depth else ("", 0, count)
            text += f"<body>{inside}</body>"
            bodies, most = bodies + count + found, max(most, deepest)
    return text, bodies, most


def test_random_replicates_are_counted_as_by_recursion(tmp_path):
    path = tmp_path / "model.xml"
    refused = 0
    for seed in range(300):
        text, bodies, most = nested(random.Random(seed), seed % 5, 1)
        path.write_text(f"<mujoco><worldbody>{text}</worldbody></mujoco>")
        root = parse("test", str(path), "mjcf").root
        if max(bodies, most) <= COPIES:
            require_sizes(str(path), root)
            continue
        refused += 1
        with pytest.raises(uqmbd.StudyError, match="requires"):
            require_sizes(str(path), root)
    assert 20 < refused < 280


def test_files_that_include_each_other_twice_are_looked_at_once(tmp_path, monkeypatch):
    """24 levels, of which each would double the time: 16 million files."""
    read = []
    monkeypatch.setattr(
        "uqmbd_models.sizes.parse", lambda what, path, kind: read.append(path) or parse(what, path, kind)
    )
    levels = 24
    for k in range(levels):
        twice = f'<include file="{k + 1}.xml"/>' * 2
        (tmp_path / f"{k}.xml").write_text(f'<mujoco>{twice}<replicate count="1">{twice}</replicate></mujoco>')
    (tmp_path / f"{levels}.xml").write_text("<mujoco/>")
    path = str(tmp_path / "0.xml")
    require_sizes(path, parse("test", path, "mjcf").root)
    assert len(read) == levels
    (tmp_path / f"{levels}.xml").write_text("<mujoco><worldbody><body/></worldbody></mujoco>")
    with pytest.raises(uqmbd.StudyError, match="bodies in total"):
        require_sizes(path, parse("test", path, "mjcf").root)


def test_random_includes_are_counted_as_by_recursion(tmp_path):
    refused = 0
    for seed in range(60):
        rng, levels = random.Random(seed), 4
        files, includes = {"00": rng.randrange(3)}, {}  # bodies of each, and what it includes, how many times
        for level in range(levels):
            for name in [name for name in files if name[0] == str(level)]:
                under = [f"{level + 1}{rng.randrange(2)}" for _ in range(rng.randrange(4))]
                includes[name] = [(one, rng.choice((1, 3, 9, 30))) for one in under]
                files |= {one: rng.randrange(3) for one in under if one not in files}

        def count(name, copies, files=files, includes=includes):
            found, most = copies * files[name], copies
            for one, times in includes.get(name, ()):
                inner, deepest = count(one, copies * times)
                found, most = found + inner, max(most, deepest)
            return found, most

        for name, bodies in files.items():
            text = "<body/>" * bodies + "".join(
                f'<replicate count="{times}"><include file="{one}.xml"/></replicate>'
                for one, times in includes.get(name, ())
            )
            (tmp_path / f"{name}.xml").write_text(f"<mujoco><worldbody>{text}</worldbody></mujoco>")
        path = str(tmp_path / "00.xml")
        root = parse("test", path, "mjcf").root
        if max(count("00", 1)) <= COPIES:
            require_sizes(path, root)
            continue
        refused += 1
        with pytest.raises(uqmbd.StudyError, match="requires"):
            require_sizes(path, root)
    assert 5 < refused < 55
