"""An output takes the family with the least error at each time: never much worse than the best, by closed forms."""

from __future__ import annotations

import json
import warnings

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.results import ComposedChaos, load, save, study_tree, surrogate
from uqmbd.typing import Array
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_joints import Revolute
from uqmbd_springs import Torque

GRAVITY = 9.81


def disc(draw: np.random.Generator) -> tuple[uqmbd.Study, str, Array, Array]:
    """A disc that a random torque accelerates: a study, its family, drawn inputs (K, 1) and exact values (K, T)."""
    spread, inertia, angle = draw.uniform(0.01, 0.1), draw.uniform(0.3, 1), draw.uniform(-1, 1)
    times = np.linspace(0, draw.uniform(1.3, 3) * np.sqrt(4 * np.pi * inertia), 61)  # 1.7 turns to 9
    distribution = chaospy.Normal(1.0, spread)
    mechanism = uqmbd.Mechanism("disc", uqmbd.Planar())
    body = mechanism.body("disc", mass=1, inertia=inertia, position=(0, 0), angle=angle)
    mechanism.add(Revolute("axle", mechanism.ground, body, point_i=(0, 0), point_j=(0, 0)))
    mechanism.add(Torque("drive", body, torque=uqmbd.RandomVariable("torque", distribution, units="N m")))
    mechanism.output("y", body.point((0.2, 0))[1], units="m")
    mechanism.output("angle", body.angle, units="rad")
    drawn = draw.normal(1.0, spread, 400)
    exact = 0.2 * np.sin(angle + drawn[:, None] / inertia * times**2 / 2)
    return uqmbd.Study("disc", mechanism, times, rtol=1e-9, propagators=[]), "phase", drawn[:, None], exact


def ball(draw: np.random.Generator) -> tuple[uqmbd.Study, str, Array, Array]:
    """A ball that is dropped from a random height and bounces."""
    low, high, restitution = draw.uniform(0.6, 0.9), draw.uniform(1.0, 1.3), draw.uniform(0.6, 0.9)
    times = np.linspace(0, draw.uniform(0.8, 1.6), 61)
    mechanism = uqmbd.Mechanism("ball", uqmbd.Line(gravity=-GRAVITY))
    height = uqmbd.RandomVariable("h", chaospy.Uniform(low, high), units="m")
    body = mechanism.body("ball", mass=1, position=height)
    mechanism.add(PlaneImpact("floor", mechanism.ground, body, 0, 0, 1, restitution=restitution))
    mechanism.output("y", body.position[0], units="m")
    drawn = draw.uniform(low, high, 400)
    exact = np.array([_bouncing(h, restitution, times) for h in drawn])
    return uqmbd.Study("ball", mechanism, times, rtol=1e-9, propagators=[]), "events", drawn[:, None], exact


def _bouncing(height: float, restitution: float, times: Array) -> Array:
    impact = np.sqrt(2 * height / GRAVITY)
    found, speed = np.where(times < impact, height - GRAVITY * times**2 / 2, 0.0), restitution * GRAVITY * impact
    while impact < times[-1]:
        flight = 2 * speed / GRAVITY
        flying = (times >= impact) & (times < impact + flight)
        since = times[flying] - impact
        found[flying] = speed * since - GRAVITY * since**2 / 2
        impact, speed = impact + flight, restitution * speed
    return found


def check(kind: str, seed: int) -> str:
    """Compare a choice over time with each family alone; return the families of the output."""
    draw = np.random.default_rng(seed)
    study, family, drawn, exact = {"disc": disc, "ball": ball}[kind](draw)
    scale = exact.std(axis=0).max()
    order = int(draw.integers(1, 5))
    options = {"order": order, "verify": 24}

    def errors(alignment: object) -> tuple[Array, object]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            node = study.propagate(Collocation(alignment=alignment, **options))
            values = surrogate(node).evaluate(drawn)[:, 0]
        found = np.sqrt(np.mean((values - exact) ** 2, axis=0))
        return np.where(np.isfinite(found), found, np.inf), node

    chosen, node = errors(("plain", family))
    alone = np.minimum(errors(None)[0], errors(family)[0])
    assert np.all(chosen <= 1.5 * alone + 1e-3 * scale), (kind, seed, order, float(np.max(chosen / scale)))
    told: dict[str, str] = json.loads(node.attrs["alignment"])
    at = node["families"].to_dataset()["taken_at"].sel(output="y").values
    runs = [at[0], *(now for before, now in zip(at[:-1], at[1:], strict=True) if now != before)]
    assert [one.split()[0] for one in told["y"].split(", ")] == runs
    return told["y"]


@pytest.mark.thorough
@pytest.mark.parametrize(("kind", "seed"), [("disc", 0), ("disc", 1), ("ball", 0), ("ball", 1)])
def test_at_no_time_much_worse_than_the_best_family(kind: str, seed: int) -> None:
    check(kind, seed)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["disc", "ball"])
def test_at_no_time_much_worse_than_the_best_family_of_many_mechanisms(kind: str) -> None:
    found = [check(kind, seed) for seed in range(100, 120)]
    assert any(", " in words for words in found)


@pytest.mark.thorough
def test_a_change_of_families_is_stored_and_reported(tmp_path) -> None:
    """Of order 1 a disc that hardly turned is plain; then its phases count. The file and the report have both."""
    draw = np.random.default_rng(3)
    study, _, drawn, exact = disc(draw)
    study = uqmbd.Study(study.name, study.mechanism, study.times, [Collocation(order=1, alignment="auto")], rtol=1e-9)
    tree = study.run()
    node = tree["collocation"]
    told = json.loads(node.attrs["alignment"])["y"]
    assert told.startswith("plain, ") and " from " in told
    save(tree, tmp_path / "disc.nc")
    read = load(tmp_path / "disc.nc")["collocation"]
    found, again = surrogate(node), surrogate(read, "y")
    assert isinstance(found, ComposedChaos) and isinstance(again, ComposedChaos)
    np.testing.assert_allclose(again.evaluate(drawn)[:, 0], found.evaluate(drawn)[:, 0], rtol=1e-12, atol=1e-13)
    wrong = np.sqrt(np.mean((found.evaluate(drawn)[:, 0] - exact) ** 2, axis=0))
    stated = node["statistics"]["verification_error"].sel(output="y") * node["statistics"]["std"].sel(output="y")
    clear = wrong > 1e-3 * exact.std(axis=0).max()
    assert clear.any() and np.all(wrong[clear] < 4 * stated.values[clear])
    said = uqmbd.report.write_report(tree, tmp_path / "report.html").read_text(encoding="utf-8")
    assert "phase" in said and study_tree([node], study="s", mechanism="m")
