"""The whole way, from records of a mechanism to its posterior."""

import chaospy
import numpy as np
import pytest
import xarray as xr
from scipy.stats import chi2

import uqmbd
from uqmbd_calibration import Bias, Calibration, Record, Series, calibrate
from uqmbd_collocation import Collocation
from uqmbd_springs import SpringDamper

TIMES = np.linspace(0.05, 3, 60)


def oscillator(stiffness=None, damping=None):
    """Make a study of a mass on a spring and a damper, let go 0.1 m beside its rest."""
    if stiffness is None:
        stiffness = uqmbd.RandomVariable("stiffness", chaospy.Normal(100.0, 10.0), units="N/m")
    if damping is None:
        damping = uqmbd.RandomVariable("damping", chaospy.Uniform(0.5, 1.5), units="N s/m")
    made = uqmbd.Mechanism("oscillator", uqmbd.Translational(gravity=(0, 0)))
    mass = made.body("mass", mass=1.0, position=(1.1, 0))
    made.add(
        SpringDamper(
            "spring",
            made.ground,
            mass,
            point_i=(0, 0),
            point_j=(0, 0),
            stiffness=stiffness,
            damping=damping,
            free_length=1.0,
        )
    )
    made.output("x", mass.position[0], units="m")
    return uqmbd.Study("oscillator", made, np.linspace(0, 3, 61), rtol=1e-8)


def motion(stiffness, damping, times=TIMES):
    """Return the position, by the formula of a damped oscillator."""
    decay = damping / 2
    omega = np.sqrt(stiffness - decay**2)
    turned = np.multiply.outer(omega, times)
    fading = np.exp(-np.multiply.outer(decay, times))
    return 1.0 + 0.1 * fading * (np.cos(turned) + (decay / omega)[..., None] * np.sin(turned))


def record(stiffness=112.0, damping=0.9, noise=0.005, seed=0, stated=True):
    """Make a record of the formula."""
    values = motion(np.array(stiffness), np.array(damping)) + noise * np.random.default_rng(seed).standard_normal(60)
    return Record("run 1", [Series("x", TIMES, values, "m", noise=noise if stated else None)])


def grid(measured, noise):
    """Return means and deviations (2,) of stiffness and damping by quadrature over a grid."""
    k, c = np.meshgrid(np.linspace(90, 130, 401), np.linspace(0.5, 1.5, 301), indexing="ij")
    misfit = motion(k, c) - measured
    density = np.exp(-0.5 * (misfit**2).sum(axis=-1) / noise**2 - 0.5 * ((k - 100) / 10) ** 2)
    density /= density.sum()
    mean = np.array([(density * k).sum(), (density * c).sum()])
    return mean, np.sqrt([(density * (k - mean[0]) ** 2).sum(), (density * (c - mean[1]) ** 2).sum()])


@pytest.fixture(scope="module")
def found():
    return calibrate(oscillator(), record(), seed=1)


@pytest.mark.thorough
def test_the_posterior_is_that_of_a_grid(found):
    mean, sd = grid(record()["x"].values, 0.005)
    posterior = found.tree["posterior"]
    for k, name in enumerate(("stiffness", "damping")):
        draws = posterior[name].values
        assert draws.mean() == pytest.approx(mean[k], abs=0.08 * sd[k])
        assert draws.std() == pytest.approx(sd[k], rel=0.06)
        assert posterior[name].attrs["units"] == ("N/m", "N s/m")[k]
    assert found.checks["even"] and not found.checks["widened"] and found.checks["converged"]
    assert found.realisations < 200
    assert found.unidentified == ()


@pytest.mark.thorough
def test_a_calibration_is_stored_as_it_is(found, tmp_path):
    path = found.save(tmp_path / "found.nc")
    again = Calibration.load(path)
    assert again.summary().identical(found.summary())
    assert str(again) == str(found) and again.checks == found.checks
    with xr.open_datatree(path, engine="h5netcdf") as tree:
        assert tree["posterior"].to_dataset().equals(found.tree["posterior"].to_dataset())


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::FutureWarning")
def test_arviz_takes_the_tree(found):
    import arviz

    taken = arviz.from_datatree(found.tree) if hasattr(arviz, "from_datatree") else found.tree
    table = arviz.summary(taken)
    assert list(table.index) == ["damping", "stiffness"] and (table["r_hat"].astype(float) < 1.02).all()
    # two inputs are fitted: the effective number of parameters by leave-one-out
    loo = arviz.loo(taken)
    assert float(loo.p if hasattr(loo, "p") else loo.p_loo) == pytest.approx(2.0, abs=0.8)


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::FutureWarning")
def test_the_groups_of_arviz_alone_are_handed_over(found):
    """Its schema knows no further ones; diagnostics of the draws are those that the calibration states."""
    import arviz

    tree = uqmbd.to_arviz(found)
    assert set(tree.children) == {
        "posterior", "prior", "posterior_predictive", "prior_predictive", "log_likelihood", "sample_stats", "observed_data",
        "constant_data",
    }  # fmt: skip
    assert tree["posterior/stiffness"].sizes["chain"] > 1 and tree["posterior/stiffness"].attrs["units"] == "N/m"
    assert tree.attrs["inference_library"] == "uqmbd"
    assert uqmbd.to_arviz(found.tree)["posterior"].equals(found.tree["posterior"])
    taken = arviz.from_datatree(tree) if hasattr(arviz, "from_datatree") else tree
    table = arviz.summary(taken, round_to="none")
    ours = found.summary().sel(input=list(table.index))
    assert np.allclose(table["mean"].astype(float), ours["mean"], rtol=1e-6)
    assert np.allclose(table["sd"].astype(float), ours["sd"], rtol=1e-2)
    with pytest.raises(uqmbd.StudyError, match="a calibration already contains draws"):
        uqmbd.to_arviz(found, draws=10)


@pytest.mark.thorough
def test_the_posterior_is_propagated_by_other_methods(found):
    from uqmbd_montecarlo import MonteCarlo

    by_name = {variable.name: variable for variable in found.variables()}
    study = oscillator(by_name["stiffness"], by_name["damping"])
    tree = study.with_propagators([MonteCarlo(samples=400, seed=1), Collocation(order=2)]).run()
    posterior = found.tree["posterior"]
    exact = motion(posterior["stiffness"].values.ravel(), posterior["damping"].values.ravel(), study.times)
    largest = exact.std(axis=0).max()
    for method, loose in (("monte-carlo", 0.15), ("collocation", 0.05)):
        statistics = tree[method]["statistics"]
        np.testing.assert_allclose(statistics["mean"].values[0], exact.mean(axis=0), atol=loose * largest)
        np.testing.assert_allclose(statistics["std"].values[0], exact.std(axis=0), atol=loose * largest)


PLAIN = Collocation(order=3)
"""Short records need no alignment."""


def moments(found, name):
    draws = found.tree["posterior"][name].values
    return draws.mean(), draws.std()


@pytest.mark.thorough
def test_the_noise_is_found_where_it_is_not_stated():
    found = calibrate(oscillator(), record(stated=False), surrogate=PLAIN, seed=1)
    mean, sd = moments(found, "noise[x]")
    # 60 values, two inputs: the deviation of a deviation is sigma / sqrt(2 n)
    assert mean == pytest.approx(0.005, abs=3 * 0.005 / np.sqrt(116)) and sd == pytest.approx(
        0.005 / np.sqrt(116), rel=0.3
    )
    stiffness, grid_sd = moments(found, "stiffness")
    expected, spread = grid(record()["x"].values, mean)
    assert stiffness == pytest.approx(expected[0], abs=0.1 * spread[0]) and grid_sd == pytest.approx(spread[0], rel=0.1)
    summary = found.summary().set_index(input="input")
    assert bool(summary["noise"].sel(input="noise[x]")) and np.isnan(summary["prior_sd"].sel(input="noise[x]"))


@pytest.mark.thorough
def test_an_outlier_does_not_move_a_robust_result():
    clean = record()
    values = clean["x"].values.copy()
    values[30] += 0.2
    spoilt = Record("spoilt", [Series("x", TIMES, values, "m", noise=0.005)])
    before = calibrate(oscillator(), clean, noise="student", surrogate=PLAIN, seed=1)
    after = calibrate(oscillator(), spoilt, noise="student", surrogate=before, seed=1)
    for name in ("stiffness", "damping"):
        (mean, sd), (moved, _) = moments(before, name), moments(after, name)
        assert abs(moved - mean) < 0.5 * sd
    assert not after.checks["model"][0]["rejected"] and after.checks["model"][0]["outliers"] == 1
    # normal noise follows it, and says so
    with pytest.warns(uqmbd.StudyWarning, match="1 of 60 values are more than 4 .* noise='student'"):
        normal = calibrate(oscillator(), spoilt, surrogate=before, seed=1)
    mean, sd = moments(before, "stiffness")
    assert abs(moments(normal, "stiffness")[0] - mean) > 2 * sd


@pytest.mark.thorough
@pytest.mark.parametrize("noise", ["normal", pytest.param("student", marks=pytest.mark.slow)])
def test_an_offset_is_a_bias(noise):
    shifted = Record("shifted", [Series("x", TIMES, record()["x"].values + 0.01, "m", noise=0.005)])
    with pytest.warns(uqmbd.StudyWarning, match="does not explain these values"):
        plain = calibrate(oscillator(), shifted, surrogate=PLAIN, noise=noise, seed=1)
    found = calibrate(oscillator(), shifted, surrogate=plain, noise=noise, bias={"x": Bias(sd=0.02)}, seed=1)
    reference = calibrate(oscillator(), record(), surrogate=plain, noise=noise, bias={"x": Bias(sd=0.02)}, seed=1)
    for name in ("stiffness", "damping"):
        (mean, sd), (expected, spread) = moments(found, name), moments(reference, name)
        # what the offset was does not matter
        assert mean == pytest.approx(expected, abs=0.15 * spread) and sd == pytest.approx(spread, rel=0.1)
    assert not found.checks["model"][0]["rejected"]
    fitted = found.tree["fit"]["x"].values - motion(np.array(112.0), np.array(0.9))
    assert fitted.mean() == pytest.approx(0.01, abs=0.003)


@pytest.mark.thorough
def test_operating_points_and_machines_of_their_own():
    first, second = record(damping=0.7)["x"], record(damping=1.2, seed=3)["x"]
    known = calibrate(
        oscillator(),
        [Record("a", [first], known={"damping": 0.7}), Record("b", [second], known={"damping": 1.2})],
        surrogate=PLAIN,
        seed=1,
    )
    assert known.names == ("stiffness",)
    machines = calibrate(
        oscillator(),
        [Record("a", [first], machine="A"), Record("b", [second], machine="B")],
        individual=["damping"],
        surrogate=PLAIN,
        seed=1,
    )
    assert machines.names == ("damping[A]", "damping[B]", "stiffness")
    for found, name, truth in (
        (known, "stiffness", 112.0),
        (machines, "stiffness", 112.0),
        (machines, "damping[A]", 0.7),
        (machines, "damping[B]", 1.2),
    ):
        mean, sd = moments(found, name)
        assert abs(mean - truth) < 3 * sd
    # two records say more than one: the deviation of the shared input by both is that of their information together
    single = calibrate(oscillator(), Record("a", [first], known={"damping": 0.7}), surrogate=PLAIN, seed=1)
    assert moments(known, "stiffness")[1] < 0.85 * moments(single, "stiffness")[1]
    assert [v.name for v in machines.variables("B")] == ["damping", "stiffness"]
    with pytest.raises(uqmbd.StudyError, match="expected one of 'A', 'B'"):
        machines.variables()


@pytest.mark.thorough
def test_an_unidentifiable_pair_is_named():
    k1 = uqmbd.RandomVariable("k1", chaospy.Normal(60, 6), units="N/m")
    k2 = uqmbd.RandomVariable("k2", chaospy.Normal(40, 6), units="N/m")
    found = calibrate(oscillator(stiffness=k1 + k2), record(), seed=1)
    assert found.unidentified == ("0.71 k1 - 0.71 k2",)
    draws = found.tree["posterior"]
    difference, together = draws["k1"] - draws["k2"], draws["k1"] + draws["k2"]
    assert float(difference.std()) == pytest.approx(6 * np.sqrt(2), rel=0.05)
    mean, sd = grid_of_sum()
    assert float(together.mean()) == pytest.approx(mean, abs=0.15 * sd) and float(together.std()) == pytest.approx(
        sd, rel=0.1
    )


def grid_of_sum():
    """Return mean and deviation of the stiffness where its prior has the deviation of a sum."""
    k, c = np.meshgrid(np.linspace(100, 125, 501), np.linspace(0.5, 1.5, 301), indexing="ij")
    misfit = motion(k, c) - record()["x"].values
    density = np.exp(-0.5 * (misfit**2).sum(axis=-1) / 0.005**2 - 0.5 * (k - 100) ** 2 / 72)
    density /= density.sum()
    mean = (density * k).sum()
    return mean, np.sqrt((density * (k - mean) ** 2).sum())


@pytest.mark.thorough
@pytest.mark.parametrize("stated", [True, False])
def test_a_wrong_model_is_noticed(stated):
    with pytest.warns(uqmbd.StudyWarning, match=r"record 'run 1', output 'x': .* at .* s\. The model is incomplete"):
        found = calibrate(oscillator(damping=0.0), record(stated=stated), surrogate=PLAIN, seed=1)
    (model,) = found.checks["model"]
    assert model["rejected"] and model["where"]
    assert "not explained by the model: x of record 'run 1'" in str(found)


@pytest.mark.thorough
def test_the_two_storey_oscillator_is_calibrated_from_frequency_and_mode():
    """U5 of the reference cases, as a mechanism: outputs without a time, measured five times."""
    import sympy

    k1 = uqmbd.RandomVariable("k1", chaospy.Uniform(0.8, 2.2), units="N/m")
    k2 = uqmbd.RandomVariable("k2", chaospy.Uniform(0.4, 1.2), units="N/m")
    made = uqmbd.Mechanism("storeys", uqmbd.Line())
    lower, upper = made.body("lower", mass=1, position=(1,)), made.body("upper", mass=1, position=(2,))
    ends = {"point_i": (0,), "point_j": (0,), "free_length": 1}
    made.add(SpringDamper("first", made.ground, lower, stiffness=k1, **ends))
    made.add(SpringDamper("second", lower, upper, stiffness=k2, **ends))
    made.output("eigenvalue", (2 * sympy.pi * uqmbd.eigenfrequency(1)) ** 2, units="1/s^2")
    made.output("ratio", uqmbd.mode_shape(1, upper.position[0], over=lower.position[0]))
    measured = Record(
        "laboratory",
        [
            Series("eigenvalue", [], [0.3860, 0.3922, 0.4157, 0.3592, 0.3615], "1/s^2", noise=0.0191),
            Series("ratio", [], [1.68245252, 1.71103903, 1.57876073, 1.58722342, 1.61878479], "", noise=0.0809),
        ],
    )
    found = calibrate(uqmbd.Study("storeys", made), measured, seed=1)
    for name, mean, sd in (("k1", 1.0086, 0.0264), ("k2", 0.9907, 0.0416)):
        assert moments(found, name) == (pytest.approx(mean, abs=0.1 * sd), pytest.approx(sd, rel=0.05))
    assert found.realisations < 200


@pytest.mark.slow
def test_draws_of_the_mechanism_itself_are_those_of_the_confirmed_surrogate(found):
    direct = calibrate(oscillator(), record(), on="mechanism", realisations=40_000, seed=2)
    for name in ("stiffness", "damping"):
        (mean, sd), (expected, spread) = moments(direct, name), moments(found, name)
        assert mean == pytest.approx(expected, abs=0.1 * spread) and sd == pytest.approx(spread, rel=0.06)


@pytest.mark.thorough
def test_the_same_seed_gives_the_same_bits_for_any_number_of_workers():
    about = {"surrogate": PLAIN, "seed": 3, "draws": 400, "chains": 2}
    one, two = (calibrate(oscillator(), record(), workers=workers, **about) for workers in (1, 2))
    assert one.tree.identical(two.tree)
    other = calibrate(oscillator(), record(), surrogate=one, seed=4, draws=400, chains=2)
    assert not one.tree["posterior"].equals(other.tree["posterior"])


def test_what_is_missing_is_named_with_its_extra(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "emcee", None)
    with pytest.raises(
        uqmbd.StudyError, match=r'not installed: emcee\. Install with: pip install "uqmbd\[calibration\]"'
    ):
        calibrate(oscillator(), record())


def discrete():
    return oscillator(damping=uqmbd.RandomVariable("damping", chaospy.DiscreteUniform(1, 3), units="N s/m"))


@pytest.mark.parametrize(
    "options, said",
    [
        ({"noise": "cauchy"}, "noise is 'cauchy'; expected 'normal' or 'student'"),
        ({"on": "paper"}, "on='paper'"),
        ({"realisations": 10}, "first surrogate needs 52. Increase realisations, e.g. to 104"),
        ({"draws": 3}, "draws is 3"),
        ({"seed": True}, "seed is True"),
        ({"bias": {"y": Bias(sd=1)}}, "bias has the key 'y'; expected outputs of the study, x"),
        ({"bias": {"x": 1.0}}, r"expected a mapping from outputs to Bias objects, e.g. .*Bias\(sd=0.5\)"),
        ({"individual": ["dampin"]}, "individual contains 'dampin'; expected names of inputs"),
        ({"individual": ["damping"]}, "requires the machine of every record, but record 'run 1' states no machine"),
        ({"surrogate": "collocation"}, "expected a method, e.g. Collocation"),
        ({"on": "mechanism"}, "needs at least [0-9]* realisations"),
    ],
)
def test_what_cannot_be_used_is_refused(options, said):
    with pytest.raises(uqmbd.StudyError, match=said):
        calibrate(oscillator(), record(), **options)


def test_options_that_nothing_takes_are_refused():
    damped = oscillator(damping=uqmbd.RandomVariable("damping", chaospy.Normal(1.0, 0.1), units="N s/m"))
    damped.mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    with pytest.raises(
        uqmbd.StudyError, match="bias has the key 'frequency', which is not an output of any record; expected some of x"
    ):
        calibrate(damped, record(), bias={"frequency": Bias(sd=0.1)})
    known = Record("run 1", record().series, known={"damping": 1.0}, machine="rig 1")
    with pytest.raises(uqmbd.StudyError, match="individual contains 'damping', whose value is known in all records"):
        calibrate(damped, known, individual=["damping"])


@pytest.mark.parametrize("count", [1, 2])
def test_noise_that_values_cannot_tell_beside_the_inputs_is_to_be_stated(count):
    few = Record("short", [Series("x", TIMES[:count], [1.05, 1.06][:count], "m")])
    with pytest.raises(
        uqmbd.StudyError,
        match=f"{count} different values of 'x' are too few to estimate its noise together with 2 inputs. State the "
        "noise",
    ):
        calibrate(oscillator(), few)


def test_readings_that_are_rounded_to_the_same_tell_no_noise():
    study = oscillator()
    study.mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    readings = Record("tap test", [Series("frequency", [], [1.61, 1.61, 1.61], "Hz")], known={"damping": 1.0})
    with pytest.raises(uqmbd.StudyError, match="1 different values of 'frequency' are too few to estimate its noise"):
        calibrate(study, readings)


def test_inputs_of_few_values_are_refused():
    with pytest.raises(uqmbd.StudyError, match="'damping' is discrete .3 values."):
        calibrate(discrete(), record())


@pytest.mark.thorough
def test_a_surrogate_of_other_times_is_not_used_again(found):
    shorter = Record("short", [Series("x", TIMES[:30], record()["x"].values[:30], "m", noise=0.005)])
    with pytest.raises(uqmbd.StudyError, match="a calibration with different inputs, outputs, times"):
        calibrate(oscillator(), shorter, surrogate=found)


@pytest.mark.parametrize("given", [{"sd": 0}, {"sd": -1}, {"sd": "1"}, {"sd": True}, {"sd": 1, "length": 0}])
def test_a_bias_has_positive_numbers(given):
    with pytest.raises(uqmbd.StudyError, match="expected a finite number above zero"):
        Bias(**given)


@pytest.mark.thorough
def test_times_that_differ_by_rounding_are_one():
    exact = np.array([0.1, 0.2, 0.3, 0.6, 0.7])
    rounded = np.array([1, 2, 3, 6, 7]) * 0.1
    assert np.any(exact != rounded)
    values = motion(np.array(105.0), np.array(1.0), exact)

    def posterior(times):
        both = [Record(name, [Series("x", at, values, "m", 0.01)]) for name, at in (("1", exact), ("2", times))]
        return calibrate(oscillator(), both).tree["posterior"]["stiffness"].values

    assert np.array_equal(posterior(rounded), posterior(exact))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:calibrate. the chains have not converged")
def test_a_curved_posterior_is_not_rejected():
    # inputs whose product is known, and which are not: predictions at their means are none of the record
    factors = [uqmbd.RandomVariable(name, chaospy.Normal(10.0, 2.0)) for name in ("area", "modulus")]
    made = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = made.body("mass", mass=1.0, position=1)
    made.add(SpringDamper("spring", made.ground, mass, 0, 0, factors[0] * factors[1], free_length=1))
    made.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    values = np.sqrt(104.5) / (2 * np.pi) + 0.01 * np.random.default_rng(0).standard_normal(10)
    found = calibrate(
        uqmbd.Study("oscillator", made), Record("tap test", [Series("frequency", [], values, "Hz", noise=0.01)])
    )
    (model,) = found.checks["model"]
    residual = (values - values.mean()) / 0.01
    assert not model["rejected"]
    # two inputs count as two that are fitted
    assert model["chi_square"] == pytest.approx(chi2.sf(residual @ residual, 8), abs=0.1)


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:calibrate")  # the chains follow a narrow curve slowly
def test_a_posterior_along_a_curve_is_not_cut_off():
    """One frequency determines the ratio of stiffness and mass, so that the posterior is a curve to its prior's ends."""
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(90, 110), units="N/m")
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(0.9, 1.1), units="kg")
    made = uqmbd.Mechanism("spring", uqmbd.Line())
    body = made.body("body", mass=mass)
    made.add(SpringDamper("spring", made.ground, body, -1, 0, stiffness=stiffness, free_length=1))
    made.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    study = uqmbd.Study("spring", made, [0, 1], [])
    exact = 10 / (2 * np.pi)
    found = calibrate(study, Record("run", [Series("frequency", [], [exact], "Hz", 1e-4 * exact)]), seed=1)
    draws = found.tree["posterior"]["mass"].values.ravel()
    # the likelihood depends on k / m = 100 (N/m)/kg only: the density of m on this line is proportional to m
    ends = np.array([0.9, 1.1])
    mean = np.diff(ends**3)[0] / 3 / (np.diff(ends**2)[0] / 2)
    std = np.sqrt(np.diff(ends**4)[0] / 4 / (np.diff(ends**2)[0] / 2) - mean**2)
    assert draws.mean() == pytest.approx(mean, abs=0.15 * std)
    assert draws.std() == pytest.approx(std, rel=0.15)
