"""Sobol' indices by pick-freeze: published values, honest intervals, and what is refused."""

from __future__ import annotations

import json
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import chaospy
import numpy as np
import pytest
import sympy
import xarray as xr

import uqmbd
from uqmbd.results import load, save, validate
from uqmbd_montecarlo import MonteCarlo
from uqmbd_montecarlo.pickfreeze import PickFreeze, SobolIndices

from .conftest import Quadrature, resting


def pick_freeze(a: np.ndarray, b: np.ndarray, mixed: np.ndarray) -> SobolIndices:
    return PickFreeze.of(np.arange(len(a)), len(a), a, b, mixed).indices()


def uniform(name: str, low: float, high: float) -> uqmbd.RandomVariable:
    return uqmbd.RandomVariable(name, chaospy.Uniform(low, high))


@pytest.fixture(scope="module")
def functions() -> uqmbd.Study:
    """Ishigami's function, Sobol's g-function in the same inputs, and a constant."""
    x = [uniform(f"x{k}", -np.pi, np.pi) for k in (1, 2, 3)]
    g = sympy.prod(
        [
            (sympy.Abs(4 * (v / (2 * sympy.pi) + sympy.Rational(1, 2)) - 2) + a) / (1 + a)
            for v, a in zip(x, G, strict=True)
        ]
    )
    ishigami = sympy.sin(x[0]) + 7 * sympy.sin(x[1]) ** 2 + x[2] ** 4 * sympy.sin(x[0]) / 10
    return resting({"ishigami": ishigami, "g": g, "fixed": None})


G = (0, 1, 4.5)


def g_function_indices() -> tuple[np.ndarray, np.ndarray]:
    """A. Saltelli and I. M. Sobol', Reliability Engineering and System Safety 50 (1995) 225-239."""
    parts = 1 / (3 * (1 + np.array(G)) ** 2)
    variance = np.prod(1 + parts) - 1
    totals = [parts[k] * np.prod(np.delete(1 + parts, k)) for k in range(3)]
    return parts / variance, np.array(totals) / variance


def ishigami_indices() -> tuple[np.ndarray, np.ndarray]:
    """T. Ishigami and T. Homma, ISUMA '90 (1990) 398-403, with a = 7, b = 0.1."""
    a, b = 7.0, 0.1
    one, two = 0.5 * (1 + b * np.pi**4 / 5) ** 2, a**2 / 8
    both = b**2 * np.pi**8 * (1 / 18 - 1 / 50)
    variance = one + two + both
    return np.array([one, two, 0.0]) / variance, np.array([one + both, two, both]) / variance


@pytest.mark.thorough
def test_published_indices_lie_in_the_intervals(functions: uqmbd.Study) -> None:
    node = functions.propagate(MonteCarlo(samples=2000, seed=1, sobol_indices=True))
    validate(node)
    found = node["statistics"].to_dataset().isel(time=1)
    assert found["sobol_first_interval"].dims == ("bound", "input", "output")
    assert found["bound"].values.tolist() == ["lower", "upper"]
    for output, indices in (("ishigami", ishigami_indices()), ("g", g_function_indices())):
        for name, exact in zip(("sobol_first", "sobol_total"), indices, strict=True):
            estimate, ends = (found[n].sel(output=output) for n in (name, f"{name}_interval"))
            np.testing.assert_allclose(estimate, exact, atol=0.1, err_msg=f"{output} {name}")
            lower, upper = ends.sel(bound="lower"), ends.sel(bound="upper")
            assert np.all((lower <= exact + 1e-12) & (exact - 1e-12 <= upper)), (output, name, ends.values)
            assert np.all((lower <= estimate + 1e-12) & (estimate - 1e-12 <= upper))
            assert np.all(upper - lower < 0.3)
    for name in ("sobol_first", "sobol_total", "sobol_first_interval", "sobol_total_interval"):
        assert np.all(found[name].sel(output="fixed") == 0.0)
    assert node.attrs["realisations"] == 1000 * (3 + 2)
    assert (node.attrs["sobol_rows"], node.attrs["sobol_rows_dropped"]) == (1000, 0)
    assert "1000 rows of 5 realisations" in node.attrs["sobol_summary"]


def test_intervals_hold_as_often_as_stated() -> None:
    """x1 + 2 x2 + x3 / 2 of uniform inputs, and an input that does nothing: shares of the squared slopes."""
    slopes, rows, repetitions = np.array([1.0, 2.0, 0.5, 0.0]), 100, 400
    exact = (slopes**2 / np.sum(slopes**2))[:, None]
    a, b = np.random.default_rng(0).uniform(-1, 1, (2, rows, repetitions, 4))
    mixed = np.where(np.eye(4, dtype=bool)[:, None, None], b, a)
    found = pick_freeze(a @ slopes, b @ slopes, mixed @ slopes)
    for estimate, ends in ((found.first, found.first_interval), (found.total, found.total_interval)):
        inside = ((ends[0] <= exact + 1e-12) & (exact - 1e-12 <= ends[1])).mean(axis=1)
        assert np.all((inside[:3] >= 0.88) & (inside[:3] <= 0.995)), inside
        assert inside[3] == 1.0  # known exactly: it changes nothing
        np.testing.assert_allclose(estimate.mean(axis=1, keepdims=True), exact, atol=0.02)


def test_mean_and_units_of_a_response_do_not_matter() -> None:
    generator = np.random.default_rng(0)
    a, b = generator.normal(size=(2, 300, 1))
    mixed = generator.normal(size=(2, 300, 1))
    one = pick_freeze(a, b, mixed)
    for other in (
        pick_freeze(1e-200 * a, 1e-200 * b, 1e-200 * mixed),
        pick_freeze(1e5 + a, 1e5 + b, 1e5 + mixed),
    ):
        np.testing.assert_allclose(other.first, one.first, rtol=1e-8)
        np.testing.assert_allclose(other.total_interval, one.total_interval, rtol=1e-8)


def test_estimates_are_those_of_jansen() -> None:
    generator = np.random.default_rng(0)
    a, b = generator.normal(size=(2, 300, 4))
    mixed = generator.normal(size=(2, 300, 4))
    found = pick_freeze(a, b, mixed)
    base = np.mean((b - a) ** 2, axis=0)
    np.testing.assert_allclose(found.first, 1 - np.mean((b - mixed) ** 2, axis=1) / base, rtol=1e-13)
    np.testing.assert_allclose(found.total, np.mean((a - mixed) ** 2, axis=1) / base, rtol=1e-13)


def test_blocks_do_not_matter() -> None:
    """More columns than fit a block have the indices that few have."""
    generator = np.random.default_rng(0)
    a, b = generator.normal(size=(2, 50, 3, 7))
    mixed = generator.normal(size=(2, 50, 3, 7))
    whole = pick_freeze(a, b, mixed)
    many = [np.tile(x, 4000) for x in (a, b, mixed)]
    parts = pick_freeze(*many)
    assert whole.first_interval.shape == (2, 2, 3, 7)
    for name in ("first", "total", "first_interval", "total_interval"):
        np.testing.assert_allclose(getattr(parts, name)[..., -7:], getattr(whole, name), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("scale", [1.0, 1e-170, 1e170])
def test_rows_that_come_in_parts_have_the_indices_of_all(scale: float) -> None:
    """Parts of any sizes, one without rows, rows that are missing, and parts of other sizes of responses."""
    generator = np.random.default_rng(0)
    a, b = scale * generator.normal(size=(2, 1000, 3))
    mixed = scale * generator.normal(size=(2, 1000, 3))
    for x in (a, b, mixed[0], mixed[1]):
        x[:300] *= 1e-6
    kept = np.flatnonzero(generator.random(1000) < 0.9)
    whole = PickFreeze.of(kept, 1000, a[kept], b[kept], mixed[:, kept])
    merged = None
    for rows in np.split(kept, [10, 10, 400, 555]):
        part = PickFreeze.of(rows, 1000, a[rows], b[rows], mixed[:, rows])
        merged = part if merged is None else merged.merge(part)
    np.testing.assert_array_equal(merged.rows, whole.rows)
    for name in ("first", "total", "first_interval", "total_interval"):
        np.testing.assert_allclose(getattr(merged.indices(), name), getattr(whole.indices(), name), rtol=1e-11)


@pytest.mark.thorough
def test_other_statistics_are_those_without_indices_and_seeds_give_the_same_bits(
    functions: uqmbd.Study, tmp_path
) -> None:
    plain = functions.propagate(MonteCarlo(samples=64, seed=3))["statistics"].to_dataset()
    study = functions.with_propagators([MonteCarlo(samples=64, seed=3, sobol_indices=True)])
    with ThreadPoolExecutor(2) as threads:
        one, two = study.run(), study.run(threads)
    statistics = one["monte-carlo/statistics"].to_dataset()
    xr.testing.assert_identical(statistics, two["monte-carlo/statistics"].to_dataset())
    for name in plain.data_vars:
        xr.testing.assert_identical(statistics[name].drop_vars("input", errors="ignore"), plain[name])
    save(one, tmp_path / "results.nc")
    validate(load(tmp_path / "results.nc"))
    other = functions.propagate(MonteCarlo(samples=64, seed=4, sobol_indices=True))["statistics"]
    assert not np.array_equal(other["sobol_first"], statistics["sobol_first"])


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:.*realisations failed:UserWarning")
@pytest.mark.filterwarnings("ignore:.*indices failed:UserWarning")
def test_fewer_realisations_at_once_give_the_same_indices() -> None:
    """An output that is not a number for some; keep holds 40 samples, or 10 rows of four."""
    a, b = uniform("a", 0, 1), uniform("b", 0, 1)
    study = resting({"y": sympy.sqrt(sympy.Rational(95, 100) - a) + b})
    whole = study.propagate(MonteCarlo(samples=200, seed=1, sobol_indices=True))
    parts = study.propagate(MonteCarlo(samples=200, seed=1, sobol_indices=True, keep=40))
    for name in ("sobol_first", "sobol_total", "sobol_first_interval", "sobol_total_interval"):
        np.testing.assert_allclose(parts["statistics"][name], whole["statistics"][name], rtol=1e-11, atol=1e-13)
    for name in ("failures", "realisations", "sobol_rows", "sobol_rows_dropped"):
        assert parts.attrs[name] == whole.attrs[name]


@pytest.mark.thorough
def test_indices_with_a_control(functions: uqmbd.Study) -> None:
    method = MonteCarlo(samples=100, seed=3, sobol_indices=True, control=Quadrature(order=2, nodes=3))
    node = functions.propagate(method)
    validate(node)
    assert node.attrs["realisations"] == 27 + 50 * 5
    alone = functions.propagate(MonteCarlo(samples=100, seed=3, sobol_indices=True))
    xr.testing.assert_identical(node["statistics"]["sobol_total"], alone["statistics"]["sobol_total"])


@pytest.mark.thorough
def test_falling_stone_of_random_speed_and_height() -> None:
    """y = h + v t: the share of the speed grows with time, in closed form; at the start the height is everything."""
    height = uqmbd.RandomVariable("height", chaospy.Normal(10, 0.5), units="m")
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.5), units="m/s")
    mechanism = uqmbd.Mechanism("fall", uqmbd.Translational(gravity=(0, -9.81)))
    stone = mechanism.body("stone", mass=1, position=(0, height), velocity=(0, speed))
    mechanism.output("y", stone.position[1], units="m")
    study = uqmbd.Study("fall", mechanism, [0.0, 1.0, 2.0])
    found = study.propagate(MonteCarlo(samples=600, seed=1, sobol_indices=True))["statistics"].isel(output=0)
    exact = np.array([[1.0, 0.5, 0.2], [0.0, 0.5, 0.8]])
    np.testing.assert_allclose(found["sobol_first"], exact, atol=0.1)
    np.testing.assert_allclose(found["sobol_first"][:, 0], exact[:, 0], atol=1e-12)
    for name in ("sobol_first", "sobol_total"):
        lower, upper = found[f"{name}_interval"]
        assert np.all((lower <= exact + 1e-9) & (exact - 1e-9 <= upper))


@pytest.mark.thorough
def test_rows_with_a_failure_are_left_out() -> None:
    """An output that is not a number where an input is large: the other rows still give the indices of the rest."""
    a, b = uniform("a", 0, 1), uniform("b", 0, 1)
    study = resting({"y": sympy.sqrt(sympy.Rational(95, 100) - a) + b})
    with pytest.warns(UserWarning) as told:
        node = study.propagate(MonteCarlo(samples=400, seed=1, sobol_indices=True))
    validate(node)
    samples, further = (str(w.message) for w in told)
    assert "of 400 realisations failed; the statistics are based on the successful ones" in samples
    assert "of 400 additional realisations for Sobol' indices failed" in further and "not finite" in further
    dropped = node.attrs["sobol_rows_dropped"]
    # a row has three draws of a beyond 0.95: those of A and B, which the mixed ones share
    assert 5 < dropped < 40
    assert node.attrs["sobol_rows"] == 200 - dropped
    assert f"{dropped} further rows" in node.attrs["sobol_summary"]
    kept = int((node["samples/status"] != 0).sum())
    assert node.attrs["failures"] > kept > 0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"sobol_indices": 100}, ["sobol_indices is 100", "True or False"]),
        ({"sobol_indices": True, "samples": 51}, ["samples is 51", "even"]),
        ({"sobol_indices": True, "sampling": "sobol", "samples": 16}, ["16 samples", "'sobol'", "32"]),
        ({"sobol_indices": True, "sampling": "halton", "samples": 100}, ["100", "'halton'", "96 or 128"]),
        ({"sobol_indices": True, "sampling": "sobol", "samples": 32}, ["samples is 32", "power of two", "64"]),
    ],
)
def test_bad_options_are_explained(options: dict, words: list[str]) -> None:
    with pytest.raises(uqmbd.StudyError) as caught:
        MonteCarlo(**options)
    for word in words:
        assert word in str(caught.value)


def test_dependent_inputs_are_refused_and_independent_vectors_not() -> None:
    method = MonteCarlo(samples=20, sobol_indices=True)
    k, c = uqmbd.random_vector(["k", "c"], chaospy.MvNormal([10, 1], [[1, 0.05], [0.05, 0.01]]))
    study = resting({"y": k + c})
    with pytest.raises(uqmbd.StudyError, match="'[kc]' and '[kc]' are dependent.*Collocation"):
        study.propagate(method)
    assert "are dependent" in method.obstacle(study)
    a, b = uqmbd.random_vector(["a", "b"], chaospy.J(chaospy.Normal(0, 1), chaospy.Uniform(0, 1)))
    independent = resting({"y": a + b})
    assert method.obstacle(independent) is None
    assert "sobol_first" in independent.propagate(method)["statistics"]


ANGLES = [uqmbd.RandomVariable(name, chaospy.Uniform(-np.pi, np.pi)) for name in "xyz"]


@pytest.mark.parametrize("sampling", ["sobol", "halton", "latin-hypercube"])
@pytest.mark.parametrize("keep", [20_000, 300])
def test_designs_give_indices_with_intervals_of_their_replicates(sampling: str, keep: int) -> None:
    """Ishigami's function, of which the indices are known; no more is computed than N (d + 2) realisations."""
    x, y, z = ANGLES
    study = resting({"f": sympy.sin(x) + 7 * sympy.sin(y) ** 2 + z**4 * sympy.sin(x) / 10})
    method = MonteCarlo(samples=512, seed=2, sampling=sampling, replicates=8, sobol_indices=True, keep=keep)
    node = study.propagate(method)
    validate(node)
    assert node.attrs["realisations"] == 256 * 5 and "the 8 replicates" in node.attrs["sobol_summary"]
    found = node["statistics"].to_dataset().isel(output=0, time=-1)
    one, two, both = (1 + np.pi**4 / 50) ** 2 / 2, 49 / 8, np.pi**8 * 8 / 22500
    whole = one + two + both
    for name, exact in (("first", [one, two, 0]), ("total", [one + both, two, both])):
        low, high = found[f"sobol_{name}_interval"].transpose("bound", "input").values
        center, reach = (high + low) / 2, (high - low) / 2
        assert (np.abs(center - np.array(exact) / whole) < 2.5 * reach).all() and (reach < 0.35).all()
    assert abs(float(found["mean"]) - 3.5) < 5 * float(found["std_error_mean"])
    assert abs(float(found["std"]) - np.sqrt(whole)) < 5 * float(found["std_error_std"])


def moving(threshold: float) -> uqmbd.Study:
    """A point that passes a place in some realisations, until the last time, and its largest place in all."""
    v, w = (uqmbd.RandomVariable(n, chaospy.Uniform(low, 2 - low)) for n, low in (("v", 0.5), ("w", 0.9)))
    mechanism = uqmbd.Mechanism("line", uqmbd.Line())
    point = mechanism.body("point", mass=1, position=0, velocity=v * w)
    mechanism.output("place", point.position[0], units="m")
    mechanism.output("arrival", uqmbd.first_time(point.position[0] >= threshold), units="s")
    mechanism.output("farthest", uqmbd.maximum(point.position[0]), units="m")
    return uqmbd.Study("line", mechanism, [0.0, 1.0])


@pytest.mark.thorough
@pytest.mark.parametrize("sampling", ["random", "sobol"])
@pytest.mark.parametrize("threshold", [0.6, 1.0, 1.4])
def test_an_output_that_may_not_happen_has_its_statistics(threshold: float, sampling: str) -> None:
    """They are those without indices, to the bit of independent samples; the others have indices, and one warning."""
    method = MonteCarlo(samples=128, seed=3, sampling=sampling, replicates=4, sobol_indices=True)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        node = moving(threshold).propagate(method)
    validate(node)
    texts = [str(w.message) for w in told]
    assert len(texts) == 1 and "output 'arrival' has no Sobol' indices: it does not occur in" in texts[0], texts
    found = node["scalars/statistics"].to_dataset()
    late = found.sel(output="arrival")
    assert np.isnan(late["sobol_first"]).all() and np.isnan(late["sobol_total_interval"]).all()
    assert "does not occur" in json.loads(found["sobol_first"].attrs["unknown"])["arrival"]
    assert (np.abs(found["sobol_first"].sel(output="farthest", input="v") - 1) < 0.25).all()
    assert (np.abs(node["statistics/sobol_first"].sel(output="place", input="v", time=1.0) - 1) < 0.25).all()
    if sampling == "random":
        plain = moving(threshold).propagate(replace(method, sobol_indices=False))["scalars/statistics"].to_dataset()
        for name in ("mean", "std", "quantile", "censored", "censored_bound", "std_error_mean"):
            np.testing.assert_array_equal(found[name].values, plain[name].values, err_msg=name)
    else:
        assert 0 < float(late["censored"]) < 1 and float(late["std"]) > 0


@pytest.mark.slow
def test_an_output_that_happens_at_all_samples_but_not_beside_has_no_indices() -> None:
    """Samples in which it happens, and pairs of inputs from two of them in which it does not: none is known."""
    speed, other = (uqmbd.RandomVariable(n, chaospy.Uniform(0.0, 1.0)) for n in ("speed", "other"))
    mechanism = uqmbd.Mechanism("line", uqmbd.Line())
    point = mechanism.body("point", mass=1, position=0, velocity=speed + other)
    mechanism.output("arrival", uqmbd.first_time(point.position[0] >= 0.35), units="s")
    study = uqmbd.Study("line", mechanism, [0.0, 1.0])
    seen = 0
    for seed in range(20):
        with warnings.catch_warnings(record=True):
            warnings.simplefilter("always")
            node = study.propagate(MonteCarlo(samples=8, seed=seed, sobol_indices=True))
        validate(node)
        found = node["scalars/statistics"].to_dataset().isel(output=0)
        happens = float(found["censored"]) == 0.0
        if happens and np.isnan(found["sobol_first"]).all():
            seen += 1
            assert np.isfinite(found["mean"]) and "of 8 realisations" in found["sobol_first"].attrs["unknown"]
    assert seen
