"""`uqmbd animate` and `uqmbd check --figure`: files are written, and mistakes cost no computation."""

from __future__ import annotations

import textwrap

import pytest
import xarray as xr
from PIL import Image

import uqmbd

SCRIPT = """
    import chaospy
    import uqmbd
    from uqmbd_montecarlo import MonteCarlo
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 2))
    mechanism = uqmbd.Mechanism("fall", uqmbd.Translational(gravity=(0, -9.81)))
    stone = mechanism.body("stone", mass=1, velocity=(speed, 0))
    mechanism.output("x", stone.position[0], units="m")
    study = uqmbd.Study("fall", mechanism, [0, 0.5, 1], [MonteCarlo(samples=4, seed=1)])
"""


@pytest.fixture
def cli(command_line, tmp_path):
    """Run the command line in a folder with a script."""
    (tmp_path / "falling_stone.py").write_text(textwrap.dedent(SCRIPT))
    return command_line


@pytest.mark.thorough
def test_animate(cli, tmp_path):
    status, out, err = cli("animate", "falling_stone.py", "--samples", "3", "--fps", "5", "--seconds", "2")
    assert (status, err) == (0, "")
    with Image.open(tmp_path / "falling_stone.gif") as film:
        assert film.n_frames == 10 and film.info["duration"] == 200
    assert "10 frames in 2 s" in out and "2 times the duration of the motion" in out and "3 realisations" in out


@pytest.mark.thorough
def test_animate_a_method(cli, tmp_path):
    status, out, _ = cli("animate", "falling_stone.py", "--out", "a/b.gif", "--method", "monte-carlo", "--fps", "2")
    assert status == 0 and "4 realisations" in out and (tmp_path / "a" / "b.gif").exists()


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["--out", "x.avi"], "written as .gif or .mp4"),
        (["--method", "galerkin"], "no method 'galerkin'; its methods are: monte-carlo"),
        (["--fps", "0"], "--fps 0: expected positive numbers"),
        (["--seconds", "900"], "18000 frames"),
        (["--samples", "-1"], "--samples"),
    ],
)
def test_mistakes(cli, words, part):
    status, out, err = cli("animate", "falling_stone.py", *words)
    assert status == 2 and part in err and "Traceback" not in err and out == ""


def test_film_without_ffmpeg(cli, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    (tmp_path / "fails.py").write_text("raise RuntimeError('it ran')\n")
    status, _, err = cli("animate", "fails.py", "--out", "x.mp4")
    assert status == 2 and "ffmpeg, which is not on the PATH" in err


@pytest.mark.thorough
@pytest.mark.parametrize(("ending", "start"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_check_draws(cli, tmp_path, ending, start):
    status, out, _ = cli("check", "falling_stone.py", "--figure", f"new/figure.{ending}")
    assert status == 0 and "1: stone" in out and f"figure  new/figure.{ending}" in out
    assert (tmp_path / "new" / f"figure.{ending}").read_bytes().startswith(start)


def test_check_refuses_other_pictures_before_the_script_runs(cli, tmp_path):
    (tmp_path / "fails.py").write_text("raise RuntimeError('it ran')\n")
    status, _, err = cli("check", "fails.py", "--figure", "figure.docx")
    assert status == 2 and ".png, .svg or .pdf" in err
    (tmp_path / "file").write_text("")
    status, _, err = cli("check", "falling_stone.py", "--figure", "file/figure.png")
    assert status == 2 and "the picture cannot be written" in err


def test_check_draws_what_cannot_be_assembled(cli, tmp_path):
    with (tmp_path / "falling_stone.py").open("a") as script:
        script.write(
            "from uqmbd_joints import Distance\n"
            "mechanism.add(Distance('a', mechanism.ground, stone, (0, 0), (0, 0), 1))\n"
            "mechanism.add(Distance('b', mechanism.ground, stone, (5, 0), (0, 0), 1))\n"
        )
    status, out, err = cli("check", "falling_stone.py", "--figure", "figure.png")
    assert status == 1 and "cannot be assembled" in err
    assert "figure.png" in out and (tmp_path / "figure.png").exists()


@pytest.mark.thorough
def test_run_stores_poses_and_shows_them(cli, tmp_path):
    status, out, _ = cli("run", "falling_stone.py")
    assert status == 0 and "motion   results/motion.nc\n" in out
    from uqmbd.results import load

    assert "motion" not in load(tmp_path / "results" / "results.nc").children
    with xr.open_dataset(tmp_path / "results" / "motion.nc", engine="h5netcdf") as poses:
        assert poses["pose"].dims == ("realisation", "time", "body", "coordinate")
    (tmp_path / "results" / "report.html").unlink()
    assert cli("report", "results")[0] == 0
    page = (tmp_path / "results" / "report.html").read_text()
    assert 'class="player small"' in page and "could not be drawn" not in page


@pytest.mark.thorough
def test_a_run_outlives_a_picture_that_fails(cli, tmp_path, monkeypatch):
    monkeypatch.setattr(uqmbd.report.mechanisms.body_poses, "motion", lambda *_, **__: 1 / 0)
    status, _, err = cli("run", "falling_stone.py")
    assert status == 0 and "no animation of the mechanism: ZeroDivisionError" in err
    assert (tmp_path / "results" / "report.html").exists()


@pytest.mark.thorough
def test_poses_that_follow_inputs_are_kept_for_the_report(cli, tmp_path):
    """A report that is written again draws the mechanism at chosen inputs, too."""
    script = (tmp_path / "falling_stone.py").read_text().replace("MonteCarlo(", "Collocation(order=2), MonteCarlo(")
    (tmp_path / "second.py").write_text("from uqmbd_collocation import Collocation\n" + script)
    assert cli("run", "second.py")[0] == 0
    first = (tmp_path / "results" / "report.html").read_text()
    assert cli("report", "results")[0] == 0
    again = (tmp_path / "results" / "report.html").read_text()
    for page in (first, again):
        assert '"live":{"bodies"' in page and "could not be drawn" not in page
