"""Falls that have ended for some realisations and not for others: statistics at the common end of a study.

Closed forms: of a fall with and without viscous drag until the ground, and of a ball that bounces until it rests.
"""

from __future__ import annotations

import json
import re

import chaospy
import numpy as np
import pytest
from scipy.stats import qmc

import uqmbd
from uqmbd import results
from uqmbd.report import write_report
from uqmbd.results import surrogate
from uqmbd_collocation import Collocation
from uqmbd_collocation.alignment import aligned_elements
from uqmbd_contact import PlaneImpact
from uqmbd_springs import PointForce

G = 9.81


def fall(height, times, speed=0.0, drag=0.0, restitution=0.0):
    """A ball of 1 kg that falls on a floor, from a height (m), with a speed (m/s), and a drag (kg/s)."""
    mechanism = uqmbd.Mechanism("fall", uqmbd.Line(gravity=-G))
    ball = mechanism.body("ball", mass=1, position=height, velocity=speed)
    if drag != 0:
        mechanism.add(PointForce("drag", ball, 0, -drag * ball.velocity[0]))
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, 0, 0, 1, restitution=restitution))
    mechanism.output("height", ball.position[0], units="m")
    return uqmbd.Study("fall", mechanism, times)


def fallen(times, height, speed=0.0, drag=0.0):
    """Heights (K, T) of falls that end on the floor."""
    h, v, c = (np.asarray(x, dtype=float).reshape(-1, 1) for x in (height, speed, drag))
    if not c.any():
        return np.maximum(h + v * times - G * times**2 / 2, 0)
    return np.maximum(h + (v + G / c) * -np.expm1(-c * times) / c - G * times / c, 0)


def bounced(times, height, restitution):
    """Heights (K, T) of a ball that bounces, with as many impacts as there may be."""
    at = np.sqrt(2 * np.asarray(height) / G)[:, None]
    found = np.where(times < at, np.asarray(height)[:, None] - G * times**2 / 2, 0.0)
    speed = restitution * G * at
    for _ in range(80):
        lasts = 2 * speed / G
        since = times - at
        found = np.where((since >= 0) & (since < lasts), speed * since - G * since**2 / 2, found)
        at, speed = at + lasts, speed * restitution
    return found


def check(node, values, exact, *, low=0.2, high=5.0, close=0.03):
    """Statistics against those of many samples (K, input), (K, T); return the ratios of stated and true errors."""
    statistics = node["statistics"].to_dataset().sel(output="height")
    for name in ("mean", "std", "skewness", "kurtosis", "quantile", "sobol_first", "sobol_total", "verification_error"):
        assert np.isfinite(statistics[name]).all(), name
    largest = exact.std(axis=0).max()
    assert np.abs(statistics["mean"] - exact.mean(axis=0)).max() < close * largest
    assert np.abs(statistics["std"] - exact.std(axis=0)).max() < close * largest
    quantiles = np.quantile(exact, statistics["probability"].values, axis=0)
    assert np.abs(statistics["quantile"].values - quantiles).max() < 2 * close * largest
    columns = np.stack([values[name] for name in statistics["input"].values.tolist()], axis=1)
    wrong = surrogate(node).evaluate(columns)[:, 0] - exact
    assert np.isfinite(wrong).all()
    true = np.sqrt((wrong**2).mean(axis=0)) / np.maximum(exact.std(axis=0), 0.01 * largest)
    # where it is that of the integration, it is stated apart
    large = true > 1e-4
    factor = statistics["verification_factor"].values[large]
    ratio = statistics["verification_error"].values[large] / true[large]
    # of sixteen realisations few may be in the air: the factor knows it
    assert ((ratio * factor > low) & (ratio < high * factor)).all()
    return ratio


def test_some_have_landed_and_others_have_not():
    """Half of them at the end; statistics are those of the closed form, over the uniform height."""
    height = uqmbd.RandomVariable("h", chaospy.Uniform(0.9, 1.1), units="m")
    times = np.linspace(0, 0.4515, 6)
    node = fall(height, times).propagate(Collocation(order=2, alignment="events"))
    h = 0.9 + 0.2 * (np.arange(4000) + 0.5) / 4000
    exact = fallen(times, h)
    assert 0.4 < np.mean(exact[:, -1] == 0) < 0.6
    check(node, {"h": h}, exact, close=0.003)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(8))
def test_random_falls(seed):
    """Random heights, speeds and drags of random distributions, to the end at which a random share has landed."""
    draw = np.random.default_rng(seed)
    top, spread = draw.uniform(0.5, 20), draw.uniform(0.03, 0.14)
    usual = np.sqrt(2 * top / G)
    heights = (
        chaospy.Uniform(top * (1 - 1.7 * spread), top * (1 + 1.7 * spread)),
        chaospy.Normal(top, top * spread),
        chaospy.LogNormal(np.log(top), spread),
    )
    speed = top / usual * draw.uniform(0.05, 0.25)
    distributions = {
        "h": heights[seed % 3],
        "v": (chaospy.Uniform(-speed, speed), chaospy.Normal(0, speed / 2))[seed % 2],
    }
    if seed >= 4:
        drag = draw.uniform(0.1, 1.5) / usual
        distributions["c"] = chaospy.Uniform(0.8 * drag, 1.2 * drag)
    units = {"h": "m", "v": "m/s", "c": "kg/s"}
    inputs = {name: uqmbd.RandomVariable(name, one, units=units[name]) for name, one in distributions.items()}
    uniform = np.clip(qmc.Sobol(len(inputs), seed=seed).random(2**14), 1e-9, 1 - 1e-9)
    values = {name: one.inv(uniform[:, k]) for k, (name, one) in enumerate(distributions.items())}
    order = ("h", "v", "c")[: len(inputs)]
    dense = np.linspace(0, 6 * usual, 600)
    landed = (fallen(dense, *(values[name][:1000] for name in order)) == 0).mean(axis=0)
    times = np.linspace(0, dense[np.argmax(landed >= draw.uniform(0.05, 0.95))], 9)
    exact = fallen(times, *(values[name] for name in order))
    study = fall(inputs["h"], times, inputs["v"], inputs.get("c", 0.0))
    node = study.propagate(Collocation(order=int(draw.integers(2, 5)), alignment="events", seed=seed))
    check(node, values, exact)


@pytest.mark.thorough
def test_a_ball_that_comes_to_rest_in_some_realisations_only():
    """At 3 s balls from up to 0.545 m rest, after 62 impacts; only events follow the others, and are chosen."""
    height = uqmbd.RandomVariable("h", chaospy.Uniform(0.5, 1.5), units="m")
    times = np.linspace(0, 3, 31)
    study = fall(height, times, restitution=0.8)
    node = study.propagate(Collocation(order=4, alignment="auto"))
    assert node.attrs["alignment"] == '{"height": "events"}'
    h = 0.5 + (np.arange(2000) + 0.5) / 2000
    ratio = check(node, {"h": h}, bounced(times, h, 0.8))
    assert ratio.size and (ratio > 0.3).all() and (ratio < 3).all()


@pytest.mark.thorough
def test_bounces_are_followed_as_far_as_samples_need_them():
    """At 2.5 s nodes have had at most seven impacts, and samples of the surrogate, which lie farther out, more."""
    distribution = chaospy.Normal(1.0, 0.12)
    height = uqmbd.RandomVariable("h", distribution, units="m")
    times = np.linspace(0, 2.5, 26)
    node = fall(height, times, restitution=0.8).propagate(Collocation(order=3, alignment="events"))
    h = distribution.inv((np.arange(4000) + 0.5) / 4000)
    check(node, {"h": h}, bounced(times, h, 0.8))


@pytest.mark.thorough
@pytest.mark.parametrize("factor", [1e-9, -1e-3, 1e9])
def test_the_stated_error_of_events_has_no_units(factor):
    """An output in other units, and from another zero, has the same errors, shares and verdict."""
    height = uqmbd.RandomVariable("h", chaospy.Uniform(0.9, 1.1), units="m")
    study = fall(height, np.linspace(0, 0.4515, 6))
    ball = study.mechanism.bodies["ball"]
    study.mechanism.output("other", factor * (ball.position[0] + 1000), units="mm")
    node = study.propagate(Collocation(order=1, alignment="events"))
    found = node["statistics"].to_dataset()
    for name in ("verification_error", "sobol_total", "kurtosis"):
        one, other = (found[name].sel(output=output).values for output in ("height", "other"))
        np.testing.assert_allclose(other, one, rtol=1e-4, atol=1e-6, err_msg=name)
    one, other = (words.split(": ", 1)[1] for words in surrogate(node).verdicts())
    assert one == other


def in_full(study, method, folder):
    """Run a study with one method, validate its result, and write its report; return the node."""
    study = uqmbd.Study(study.name, study.mechanism, study.times, [method])
    tree = study.run()
    results.validate(tree)
    said = write_report(tree, folder / "report.html").read_text(encoding="utf-8")
    node = tree[method.node_name]
    assert ("Results of collocation end at t = " in said) == ("ends_at" in node.attrs)
    return node


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.SurrogateWarning")
def test_samples_that_end_early_end_the_results(tmp_path):
    """At 2.5 s some samples of a surrogate of first order have no landmarks left; before, there are results."""
    height = uqmbd.RandomVariable("h", chaospy.Normal(1.0, 0.2), units="m")
    study = fall(height, np.linspace(0, 2.5, 26), restitution=0.8)
    with pytest.warns(UserWarning, match="not reach the last output time") as seen:
        node = in_full(study, Collocation(order=1, alignment="events"), tmp_path)
    (since,) = [float(m[1]) for w in seen if (m := re.search(r"NaN from t = ([0-9.]+) s on", str(w.message)))]
    end = node.attrs["ends_at"]
    assert end == study.times[study.times <= since].max()
    statistics = node["statistics"].to_dataset()
    for name in ("mean", "std", "skewness", "quantile", "sobol_first", "verification_error", "integration_error"):
        before, after = statistics[name].sel(time=slice(0, end)), statistics[name].sel(time=slice(end + 1e-9, None))
        assert np.isfinite(before).all() and after.size and np.isnan(after).all(), name
    assert np.array_equal(statistics["time"], study.times)
    values = np.linspace(0.4, 1.6, 50)[:, None]
    assert np.isfinite(surrogate(node).evaluate(values)).all()
    assert surrogate(node).labels.times[-1] == end


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.SurrogateWarning")
def test_outputs_of_other_families_go_on(monkeypatch, tmp_path):
    """Landmarks are not extended: the ball has no results at the end, with the reason; what stands still has."""
    monkeypatch.setattr(aligned_elements, "EXTENSIONS", 1)
    height = uqmbd.RandomVariable("h", chaospy.Normal(1.0, 0.2), units="m")
    study = fall(height, np.linspace(0, 1.5, 16), restitution=0.8)
    body = study.mechanism.body("free", mass=1, position=0)
    study.mechanism.output("free", height + 0 * body.position[0], units="m")
    with pytest.warns(UserWarning, match="not reach the last output time"):
        node = in_full(study, Collocation(order=2, alignment=("events", "plain"), verify=2), tmp_path)
    # before the first impact both are exact
    assert json.loads(node.attrs["alignment"]) == {"height": "plain, events from 0.4 s", "free": "plain"}
    assert "ends_at" not in node.attrs
    statistics = node["statistics"].to_dataset()
    for name in ("mean", "std", "sobol_total"):
        late = np.isnan(statistics[name].sel(output="height", time=1.5))
        assert late.all() and np.isfinite(statistics[name].sel(output="free")).all(), name
        reasons = json.loads(statistics[name].attrs["unknown"])
        assert list(reasons) == ["height"] and "do not reach this time" in reasons["height"]
