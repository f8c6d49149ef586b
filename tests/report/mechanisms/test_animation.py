"""The mechanism in motion: poses against closed forms, pictures that move, and what the report makes of stored poses."""

from __future__ import annotations

import json
import re

import chaospy
import numpy as np
import pytest
import xarray as xr
from PIL import Image

import uqmbd
from uqmbd import results
from uqmbd.report import animate, motion, poses, with_motion, write_report
from uqmbd.report.mechanisms.film import Film
from uqmbd.report.mechanisms.sketch import world
from uqmbd_collocation import Collocation
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo

FRAMES = 12


@pytest.fixture(scope="module")
def study():
    """A wheel that turns at a random speed, with an eccentric point: all that moves is known."""
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 3), units="rad/s")
    reach = uqmbd.RandomVariable("reach", chaospy.Uniform(0.4, 0.6), units="m")
    mechanism = uqmbd.Mechanism("wheel <b>", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=1, inertia=1, angular_velocity=speed)
    mechanism.add(Revolute("axle", mechanism.ground, wheel, (0, 0), (0, 0)))
    mechanism.output("rim", wheel.point((reach, 0))[0], units="m")
    methods = [MonteCarlo(samples=6, seed=3), Collocation(order=6, verify=2)]
    return uqmbd.Study("wheel", mechanism, np.linspace(0.5, 2, 7), methods)


@pytest.fixture(scope="module")
def data(study):
    """The wheel's motion, of 5 realisations."""
    return motion(study, samples=5, frames=FRAMES)


def rim(data):
    """Eccentric point, (realisation, time, axis)."""
    return world(data)[:, :, data["point_kind"].values.tolist().index("observed")]


def expected(data):
    """Where it is: on a circle, at an angle that grows from the first time on."""
    inputs = data["inputs"].to_pandas()
    angle = inputs["speed"].to_numpy()[:, None] * (data["time"].values - data["time"].values[0])
    return inputs["reach"].to_numpy()[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def test_poses_are_those_of_the_closed_form(data):
    assert data["inputs"].sel(input="speed")[0] == pytest.approx(2) and len(set(data["inputs"][:, 0].values)) == 6
    np.testing.assert_allclose(rim(data), expected(data), atol=1e-5)  # ten tolerances; single precision
    assert data["time"].values[[0, -1]].tolist() == [0.5, 2.0] and data["time"].attrs["units"] == "s"


@pytest.mark.parametrize("method", ["monte-carlo", "collocation"])
def test_realisations_of_a_method_are_its_own(study, method):
    """Of Monte Carlo its samples, to the bit of their inputs; of a chaos evaluations of it, which converge."""
    data = motion(study, samples=4, frames=5, method=method)
    assert data.sizes["realisation"] == 5 and data.attrs["method"] == method
    np.testing.assert_allclose(rim(data), expected(data), atol=2e-4 if method == "collocation" else 3e-6)
    if method == "monte-carlo":
        node = study.propagate(study.propagators[0])
        own = node["samples"]["inputs"].sel(input=data["input"].values)[:4]
        np.testing.assert_array_equal(data["inputs"].values[1:], own.values)


def test_making_poses_leaves_the_mechanism_as_it_was(study):
    assert list(study.mechanism.outputs) == ["rim"]
    assert list(study.run(only=["monte-carlo"])["monte-carlo/statistics"]["output"].values) == ["rim"]


@pytest.mark.thorough
def test_spatial_points_turn_as_rotation_matrices_say():
    """The quaternions of the dataset against a rotation matrix of SciPy."""
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_rotvec([0.3, -0.5, 0.9])
    mechanism = uqmbd.Mechanism("thrown", uqmbd.Spatial())
    stone = mechanism.body("stone", mass=1, inertia=(1, 1, 1), com=(0.3, 0.2, 0.1), rotation=turned.as_matrix(), velocity=(1, 2, 3), angular_velocity=(0, 0, 0))  # fmt: skip
    mechanism.output("x", stone.position[0])
    data = motion(uqmbd.Study("thrown", mechanism, [0, 2]), frames=3)
    line = np.outer(data["time"], (1, 2, 3)) + turned.apply((0.3, 0.2, 0.1))
    np.testing.assert_allclose(world(data)[0, :, 0], line, atol=1e-5)
    assert data.sizes["realisation"] == 1  # nothing is random


@pytest.mark.thorough
def test_gif_shows_every_time(data, tmp_path):
    path = animate(data, tmp_path / "new" / "wheel.gif", seconds=1.2)
    pictures = []
    with Image.open(path) as film:
        assert film.n_frames == FRAMES
        assert film.info["duration"] == pytest.approx(100)
        for k in range(FRAMES):
            film.seek(k)
            pictures.append(np.asarray(film.convert("RGB"), dtype=int))
    # it moves, and what stands still does: the title, and the axes' labels
    assert abs(pictures[0] - pictures[6]).max() > 100
    assert abs(pictures[0] - pictures[6])[-25:, :].max() == 0


def test_realisations_make_a_cloud(data):
    """With realisations there are as many pale outlines as realisations; without, none."""
    assert sum(len(lines.get_segments()) for lines in Film(data, 4, 50).cloud(3)) == 5
    assert sum(len(lines.get_segments()) for lines in Film(data.isel(realisation=[0]), 4, 50).cloud(3)) == 0


def test_realisations_of_a_point_are_seen():
    """A ball without a size that is thrown at random: each realisation is a dot of its own, not only the mean one."""
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 9), units="m/s")
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational())
    ball = mechanism.body("ball", mass=1, position=(0, 0), velocity=(speed, 0))
    mechanism.output("x", ball.position[0], units="m")
    thrown = motion(uqmbd.Study("ball", mechanism, [0, 1], [MonteCarlo(samples=5, seed=1)]), samples=5, frames=3)
    film = Film(thrown, 6, 60)
    pictures = [np.asarray(frame, dtype=int) for frame in film.frames()]
    (axes,) = film.canvas.figure.axes
    places = axes.transData.transform(world(thrown)[1:, -1, 0, :2])
    changed = abs(pictures[-1] - pictures[0]).max(axis=-1) > 40
    for x, y in places:
        row, column = changed.shape[0] - round(y), round(x)
        assert changed[row - 3 : row + 4, column - 3 : column + 4].any()


def test_realisations_lie_above_the_bodies_and_beneath_the_joints(data):
    """Thin lines that are seen: above all that is filled with a body's colour, and no wider than its outline."""
    film = Film(data, 4, 50)
    (cloud,) = film.cloud(3)
    bodies = [s for s in film.shapes(film.canvas.sheet, 3) if s.edge == film.sketch.colour("wheel")]
    assert cloud.get_zorder() > 2 + max(s.order for s in bodies)
    assert cloud.get_linewidths()[0] < 1
    assert cloud.get_alpha() >= 0.3
    assert max(cloud.get_colors()[0][:3]) < 0.7


def test_pictures_of_moved_artists_are_those_of_new_ones(data):
    """A film moves what it has drawn; each of its pictures is the one that a film of that time alone begins with."""
    pictures = list(Film(data, 4, 50).frames())
    for frame in (0, 5, FRAMES - 1):
        film = Film(data, 4, 50)
        shown = film.points.copy()
        film.__dict__["points"] = shown[:, frame : frame + 1]
        film.__dict__["canvas"] = Film(data, 4, 50).canvas
        film.__dict__["reaches"] = film.sketch.reaches(shown[0])
        (alone,) = film.frames()
        below = 25  # beneath the time, which is written as text
        np.testing.assert_array_equal(alone[below:], pictures[frame][below:])


def test_a_still_is_where_realisations_are_farthest_apart(data):
    figure = poses(data)
    assert Film(data, 4, 50).widest == int(np.argmax(abs(rim(data) - rim(data)[:1]).max(axis=(0, 2))))
    assert any(text.get_text().startswith("t = ") for text in figure.texts)


def test_the_view_follows_what_goes_far():
    """A sled that travels a hundred times its length stays in the picture, as large as at rest."""
    mechanism = uqmbd.Mechanism("sled", uqmbd.Planar())
    sled = mechanism.body("sled", mass=1, inertia=1, velocity=(50, 0))
    mechanism.output("bow", sled.point((1, 0))[0])
    film = Film(motion(uqmbd.Study("sled", mechanism, [0, 2]), frames=4), 5, 50)
    assert film.followed
    np.testing.assert_allclose(film.points[0] - film.points[0, :1], 0, atol=1e-5)
    assert np.ptp(film.canvas.axes.get_xlim()) < 3


@pytest.mark.parametrize(
    ("words", "part"),
    [
        ({"samples": -1}, "samples is -1"),
        ({"frames": 1}, "frames is 1"),
        ({"method": "nothing"}, "no method 'nothing'; its methods are: monte-carlo, collocation"),
    ],
)
def test_mistakes(study, words, part):
    with pytest.raises(uqmbd.StudyError, match=part):
        motion(study, **words)


def test_mistakes_in_files(data, tmp_path, monkeypatch):
    with pytest.raises(uqmbd.StudyError, match=r"\.gif or \.mp4"):
        animate(data, tmp_path / "x.avi")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(uqmbd.StudyError, match="needs the program ffmpeg"):
        animate(data, tmp_path / "x.mp4")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.thorough
def test_a_film_is_handed_to_ffmpeg(data, tmp_path, monkeypatch):
    """A stand-in for ffmpeg counts the pictures that it is given."""
    program = tmp_path / "ffmpeg"
    program.write_text('#!/bin/sh\nfor last; do :; done\nwc -c > "$last"\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    film = Film(data, 6.4, 100)
    high, wide = next(film.frames()).shape[:2]
    assert int(animate(data, tmp_path / "x.mp4").read_text()) == FRAMES * high * wide * 3
    program.write_text("#!/bin/sh\necho unknown encoder >&2\nexit 1\n")
    with pytest.raises(uqmbd.StudyError, match="unknown encoder"):
        animate(data, tmp_path / "y.mp4")


@pytest.mark.thorough
def test_report_moves_from_the_stored_file_alone(study, tmp_path):
    """Stored, read again, drawn: the player's data, its still, the film as a file, and texts, without the mechanism."""
    tree, note = with_motion(study.run(only=["monte-carlo"]), study)
    assert note == ""
    results.validate(tree)
    assert list(results.propagator_nodes(tree)) == ["monte-carlo"]
    stored = results.load(results.save(tree, tmp_path / "results.nc"))
    xr.testing.assert_identical(stored["motion"].to_dataset(), tree["motion"].to_dataset())
    page = write_report(stored, tmp_path / "report.html", folder=tmp_path / "figures").read_text(encoding="utf-8")
    ((text, still, data),) = re.findall(
        r'<figure id="mechanism" class="player small"><svg class="still" role="img" aria-label="([^"]+)"(.*?)</svg>.*?<script type="application/json">(.*?)</script>',
        page, flags=re.DOTALL,
    )  # fmt: skip
    assert still.count("<path") > 20 and "image/gif" not in page
    assert "wheel &lt;b&gt;" in text and "20 realisations" in text and "largest distance between realisations" in text
    assert json.loads(data)["realisations"] == 21 and json.loads(data)["mechanism"] == "wheel <b>"
    assert "This page evaluates no surrogate: outputs and charts show the nearest of" in page  # samples alone
    with Image.open(tmp_path / "figures" / "motion.gif") as film:
        assert film.n_frames == 60


@pytest.mark.thorough
def test_report_without_motion_has_no_such_picture(study, tmp_path):
    page = write_report(study.run(only=["monte-carlo"]), tmp_path / "report.html").read_text(encoding="utf-8")
    assert 'id="mechanism"' not in page


def test_a_study_without_times_has_a_report_without_an_animation_and_without_a_problem(tmp_path):
    mechanism = uqmbd.Mechanism("rod", uqmbd.Planar(gravity=(0, -9.81)))
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(1, 2), units="kg")
    rod = mechanism.body("rod", mass=mass, inertia=1, position=(0, -0.5))
    mechanism.add(Revolute("axle", mechanism.ground, rod, (0, 0), (0, 0.5)))
    mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    study = uqmbd.Study("rod", mechanism, propagators=[MonteCarlo(samples=2)])
    tree, note = with_motion(study.run(), study)
    assert "no output times" in note and "no_motion" not in tree.attrs and "motion" not in tree.children
    page = write_report(tree, tmp_path / "report.html").read_text(encoding="utf-8")
    assert "The mechanism could not be drawn" not in page and 'id="mechanism"' not in page
    assert "not drawn, because the study has no results over time" in page and "contain no poses" not in page


@pytest.mark.thorough
def test_what_cannot_be_drawn_is_a_note(study, tmp_path):
    tree = study.run(only=["monte-carlo"])
    tree["motion"] = xr.DataTree(xr.Dataset({"nothing": 1}))
    page = write_report(tree, tmp_path / "report.html").read_text(encoding="utf-8")
    assert "The mechanism could not be drawn: KeyError" in page and 'id="outputs"' in page
    mechanism = uqmbd.Mechanism("torn", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=1, inertia=1)
    for place in (0, 1):
        mechanism.add(Revolute(f"axle {place}", mechanism.ground, wheel, (place, 0), (0, 0)))
    mechanism.output("x", wheel.position[0], units="m")
    without, note = with_motion(tree, uqmbd.Study("torn", mechanism, [0, 1]))
    assert without.attrs["no_motion"] == note and "AssemblyError" in note and "no_motion" not in tree.attrs
