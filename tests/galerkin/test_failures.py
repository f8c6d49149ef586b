"""What cannot be done is said beforehand or where it happens: one clear line each, never a plausible wrong answer."""

from __future__ import annotations

import re
import warnings

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd import results
from uqmbd.dynamics import ProjectedEnsemble
from uqmbd.dynamics.integration import ida
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Distance
from uqmbd_springs import SpringDamper


def fragile(lowest):
    """A bob between two rods from posts 1.8 m apart: rods below 0.9 m do not reach each other."""
    length = uqmbd.RandomVariable("length", chaospy.Uniform(lowest, 1.3))
    mechanism = uqmbd.Mechanism("fragile", uqmbd.Translational())
    bob = mechanism.body("bob", mass=1, position=(0, 0.5))
    for name, x in (("left", -0.9), ("right", 0.9)):
        mechanism.add(Distance(name, mechanism.ground, bob, (x, 0), (0, 0), length=length))
    mechanism.output("y", bob.position[1], units="m")
    return mechanism


def swinging(spread=0.3):
    """A spring of very random stiffness: phases part, and no polynomial of low order follows for long."""
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(100 * (1 - spread), 100 * (1 + spread)))
    mechanism = uqmbd.Mechanism("swinging", uqmbd.Translational())
    body = mechanism.body("body", mass=1, position=(1, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, body, (0, 0), (0, 0), stiffness))
    mechanism.output("x", body.position[0], units="m")
    mechanism.output("speed", body.velocity[0], units="m/s")
    return mechanism


TIMES = np.linspace(0, 3, 61)


def test_node_that_cannot_be_assembled_is_named_before_any_integration(monkeypatch):
    def never(*arguments, **keywords):
        raise AssertionError("integrated")

    monkeypatch.setattr(ProjectedEnsemble, "integrate", never)
    monkeypatch.setattr(uqmbd.extend.Problem, "realise", never)
    study = uqmbd.Study("fragile", fragile(0.6), [0.0, 1.0])
    expected = r"galerkin: 2 of 4 nodes cannot be assembled, the first at length = 0\.64\d+: .*(left|right).*Truncate"
    with pytest.raises(uqmbd.AssemblyError, match=expected):
        study.propagate(Galerkin())
    obstacle = Galerkin().obstacle(study)
    assert obstacle.startswith("2 of 4 nodes cannot be assembled") and "Truncate the distributions" in obstacle


def test_verification_realisation_that_fails_is_a_warning():
    """All nodes exist, but not all of the support: the tail of it shows among the verification points."""
    study = uqmbd.Study("fragile", fragile(0.87), [0.0, 0.1])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        node = study.propagate(Galerkin(order=1, verify=64))
    first = str(caught[0].message)
    assert re.match(r"galerkin: \d+ of 64 verification realisations failed. .*part of the support", first)
    assert "\n" not in first
    assert 0 < node.attrs["failures"] < 20
    assert node.attrs["verification"] + node.attrs["failures"] == 64
    results.validate(node)


def test_error_above_ten_per_cent_names_output_and_time():
    study = uqmbd.Study("swinging", swinging(), TIMES)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        node = study.propagate(Galerkin(order=2))
    (warning,) = caught
    text = str(warning.message)
    assert warning.category is uqmbd.SurrogateWarning and "\n" not in text
    chaos = results.PolynomialChaos.from_dataset(node["chaos"].to_dataset())
    for name, time in chaos.horizon(0.1).items():
        assert re.search(f"{name!r} (at [0-9]+ of [0-9]+ times )?from t = {time:g} s to t = ", text)
    # it is right: against the closed form the error is as large
    k = np.linspace(70, 130, 20001)[:, None]
    x = np.cos(np.sqrt(k) * TIMES)
    error = np.abs(node["statistics"]["std"].sel(output="x") - x.std(axis=0)) / x.std(axis=0).max()
    assert float(error.max()) > 0.05
    assert float(error.sel(time=slice(0, 0.5 * chaos.horizon(0.1)["x"])).max()) < 0.05


def test_what_is_right_warns_of_nothing(mechanisms):
    """An output without motion, known to rounding only, is no reason for a warning either."""
    study = uqmbd.Study("quiet", swinging(0.01), np.linspace(0, 0.5, 11))
    body = study.mechanism.bodies["body"]
    study.mechanism.output("side", body.position[1], units="m")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        study.propagate(Galerkin(order=2))


@pytest.mark.thorough
@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_stop_at_ends_the_run_at_the_horizon(integrator, tmp_path):
    study = uqmbd.Study("stopped", swinging(), TIMES, [Galerkin(order=2, stop_at=0.05, integrator=integrator)])
    with pytest.warns(
        UserWarning, match=r"results end at t = [\d.]+ s of 3 s, because the stated error exceeds stop_at = 0.05 for "
    ):
        tree = study.run()
    node = tree["galerkin"]
    end = node.attrs["ends_at"]
    assert 0.3 < end < 1.5
    statistics = node["statistics"]
    before, after = statistics.sel(time=slice(0, end)), statistics.sel(time=slice(end + 1e-9, None))
    for name in ("mean", "std", "variance", "skewness", "kurtosis"):
        assert np.isfinite(before[name]).all() and np.isnan(after[name]).all()
    assert np.array_equal(statistics["time"], TIMES)
    assert float(node["chaos"]["time"][-1]) == end
    assert float(node["chaos"]["verification_error"].max()) <= 0.05
    results.validate(tree)
    results.save(tree, tmp_path / "results.nc")
    results.validate(results.load(tmp_path / "results.nc"))
    # beside a whole result it is compared over what both have, and is not the reference
    with pytest.warns(UserWarning):
        whole = uqmbd.Study("whole", swinging(), TIMES).propagate(Galerkin(order=2, label="whole"))
    comparison = results.compare({"galerkin": node, "whole": whole})
    assert comparison.attrs["reference"] == "whole"
    assert comparison["compared_until"].values.tolist() == [end, 3.0]
    assert (comparison["std_difference_max"].sel({"method": "galerkin"}) < 1e-4).all()


def test_motion_that_ends_keeps_what_there_is(monkeypatch):
    """Neither integrator can go on: results up to there, from the one that came further, and the reason."""
    monkeypatch.setattr("uqmbd.dynamics.integration.dop853.STEPS", 12)
    monkeypatch.setattr(ida, "STEPS", 5)
    study = uqmbd.Study("ended", swinging(0.05), np.array([0, 0.1, 0.2, 3.0]))
    with pytest.warns(
        UserWarning,
        match=r"the integration of the projected equations ended early; results end at t = 0.2 s of 3 s. Reason: .*steps",
    ):
        node = study.propagate(Galerkin(order=2, verify=0))
    assert node.attrs["ends_at"] == 0.2 and node.attrs["integrated_by"] == "dop853"
    assert node["statistics"]["mean"].notnull().sum() == 6
    results.validate(node)


def test_start_without_a_solution_is_an_error(monkeypatch, mechanisms, project):
    projected = project(mechanisms["pendulum"](), 1)
    monkeypatch.setattr(
        type(projected.coupled),
        "solve",
        lambda self, state, time, tolerance: (np.full((3, 9), np.nan), np.zeros((3, 0))),
    )
    with pytest.raises(uqmbd.AssemblyError, match="projected equations have no consistent start.*Raise the order"):
        projected.start  # noqa: B018 - built once


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"order": -1}, "order is -1; expected a whole number, 0 or more"),
        ({"order": 2.0}, "order is 2.0"),
        ({"order": True}, "order is True"),
        ({"verify": -3}, "verify is -3"),
        ({"index_set": "full"}, "index_set is 'full'; expected one of 'total', 'tensor'"),
        ({"rule": "simpson"}, "rule is 'simpson'"),
        ({"linear_solver": "lu"}, "linear_solver is 'lu'; expected one of 'auto', 'dense'"),
        ({"integrator": "euler"}, "integrator is 'euler'"),
        ({"transform": "none"}, "transform is 'none'"),
        ({"nodes": 0}, "nodes is .*0.*; expected a whole number, 1 or more"),
        ({"nodes": ()}, "nodes is .*expected a whole number, 1 or more"),
        ({"nodes": "many"}, "nodes is 'many'"),
        ({"nodes": 4, "rule": "sobol", "samples": 9}, "nodes requires rule='gauss'"),
        ({"rule": "sobol"}, "rule='sobol' requires samples=, the number of samples"),
        ({"rule": "sobol", "samples": 0}, "samples is 0"),
        ({"stop_at": -0.1}, "stop_at is -0.1"),
        ({"stop_at": 0.1, "verify": 0}, "stop_at is 0.1, but verify is 0"),
    ],
)
def test_bad_options_are_reported(options, words):
    with pytest.raises(uqmbd.StudyError, match=words):
        Galerkin(**options)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"order": 3, "nodes": 2}, "does not resolve the 10 terms of the basis"),
        ({"nodes": (3, 3, 3)}, r"nodes has 3 numbers for 2 inputs \(length, mass\)"),
        ({"order": 2, "nodes": 150}, "too many for a coupled problem"),
        pytest.param({"order": 200}, r"Use order=\d+, rule=.sobol.", marks=pytest.mark.thorough),
        ({"rule": "sobol", "samples": 5}, "does not resolve"),
        ({"order": 3, "rule": "smolyak", "level": 3}, "negative weights"),
    ],
)
def test_rules_that_do_not_fit_are_reported_before_anything_is_computed(mechanisms, options, words):
    study = uqmbd.Study("rules", mechanisms["pendulum"](), [0.0, 0.1])
    with pytest.raises(uqmbd.StudyError, match=words):
        study.propagate(Galerkin(**options))
    assert Galerkin(**options).obstacle(study)


def test_nothing_random_and_no_moments():
    mechanism = uqmbd.Mechanism("sure", uqmbd.Translational())
    body = mechanism.body("body", mass=1)
    mechanism.output("x", body.position[0])
    study = uqmbd.Study("sure", mechanism, [0.0, 1.0])
    assert (
        Galerkin()
        .obstacle(study)
        .startswith("mechanism 'sure' has no random variables; declare a uqmbd.RandomVariable")
    )
    with pytest.raises(uqmbd.StudyError, match="mechanism 'sure' has no random variables"):
        study.propagate(Galerkin())
    heavy = uqmbd.RandomVariable("mass", chaospy.Trunc(chaospy.Cauchy(), 0.1, None))
    mechanism = uqmbd.Mechanism("heavy", uqmbd.Translational())
    mechanism.output("x", mechanism.body("body", mass=heavy).position[0])
    assert "moments" in Galerkin().obstacle(uqmbd.Study("heavy", mechanism, [0.0, 1.0]))


def test_what_fits_has_no_obstacle(mechanisms):
    assert Galerkin().obstacle(uqmbd.Study("fits", mechanisms["pendulum"](), [0.0, 1.0])) is None


SCRIPT = """
import chaospy, numpy as np, uqmbd
from uqmbd_galerkin import Galerkin
from uqmbd_springs import SpringDamper
from uqmbd_joints import Distance
stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform({low}, 130))
mechanism = uqmbd.Mechanism("swinging", uqmbd.Translational())
body = mechanism.body("body", mass=1, position=(1, 0))
mechanism.add(SpringDamper("spring", mechanism.ground, body, (0, 0), (0, 0), stiffness))
{more}
mechanism.output("x", body.position[0], units="m")
study = uqmbd.Study("swinging", mechanism, np.linspace(0, 2, 41), [Galerkin(order=2)])
"""

RODS = """
for name, x in (("left", -0.9), ("right", 0.9)):
    mechanism.add(Distance(name, mechanism.ground, body, (x, 0), (0, 0), length=stiffness / 100))
"""


@pytest.mark.thorough
def test_command_line_says_it_in_one_line(tmp_path, command):
    script = tmp_path / "swinging.py"
    script.write_text(SCRIPT.format(low=70, more=""))
    run = command("run", script, "--out", tmp_path / "out")
    assert run.returncode == 0, run.stderr
    said = [line for line in run.stderr.splitlines() if "Warning" in line]
    assert len(said) == 1
    assert said[0].startswith(
        "Warning: galerkin: the stated error of the surrogate exceeds 10% of the standard deviation: 'x' "
    )


def test_check_and_run_say_when_it_does_not_fit(tmp_path, command):
    script = tmp_path / "fragile.py"
    script.write_text(SCRIPT.format(low=72, more=RODS).replace("position=(1, 0)", "position=(0, 0.5)"))
    found = command("check", script)
    assert found.returncode == 0 and "no: " in found.stdout and "cannot be assembled" in " ".join(found.stdout.split())
    run = command("run", script, "--out", tmp_path / "out")
    assert run.returncode == 1
    (line,) = [line for line in run.stderr.splitlines() if line.startswith("Error")]
    assert line.startswith("Error: galerkin: ") and "stiffness = 7" in line and "Truncate the distributions" in line
