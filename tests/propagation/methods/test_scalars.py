"""Outputs without a time: frequencies, damping and values at equilibrium, in every method, against closed forms."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import chaospy
import numpy as np
import pytest
import sympy
from scipy.integrate import quad

import uqmbd
import uqmbd.propagation.execution.chunks as chunks
import uqmbd.propagation.runner as runners
from uqmbd.extend import statistics_dataset
from uqmbd.mechanism import MotionSymbol
from uqmbd.report import write_report
from uqmbd.report.mechanisms.animation import motion
from uqmbd.results import PolynomialChaos, load, save, validate
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Prismatic, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import Bushing, SpringDamper, TorsionSpringDamper

G, C = 9.81, 0.6
TIMES = np.linspace(0, 1, 6)
METHODS = [MonteCarlo(samples=300, seed=1), Collocation(order=5), Galerkin(order=5)]


def oscillator(over_time=False, damping=C):
    """A unit mass on a damped spring of random stiffness, drawn where the spring is free."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Planar(gravity=(0, -G)))
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(80, 120), units="N/m")
    pan = mechanism.body("pan", mass=1, inertia=0.1)
    mechanism.add(Prismatic("guide", mechanism.ground, pan, (0, 0), (0, 0), (0, 1), (0, 1)))
    spring = SpringDamper("spring", mechanism.ground, pan, (0, 1), (0, 0), stiffness, damping=damping, free_length=1)
    mechanism.add(spring)
    if over_time:
        mechanism.output("y", pan.position[1], units="m")
    mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    mechanism.output("damping", uqmbd.damping_ratio(1))
    mechanism.output("sag", -uqmbd.at_equilibrium(pan.position[1]), units="m")
    mechanism.output("pull", uqmbd.at_equilibrium(spring.reaction_force[1]), units="N")
    mechanism.output("stiffness_again", (2 * sympy.pi * uqmbd.eigenfrequency(1)) ** 2, units="N/m")
    return mechanism


CLOSED = {
    "frequency": lambda k: np.sqrt(k) / (2 * np.pi),
    "damping": lambda k: C / (2 * np.sqrt(k)),
    "sag": lambda k: G / k,
    "stiffness_again": lambda k: k,
}


def moments(function):
    """Mean and variance of a function of the stiffness, by adaptive quadrature."""
    mean = quad(function, 80, 120)[0] / 40
    return mean, quad(lambda k: (function(k) - mean) ** 2, 80, 120)[0] / 40


@pytest.fixture(scope="module")
def tree():
    return uqmbd.Study("oscillator", oscillator(), TIMES, METHODS).run()


@pytest.fixture(scope="module")
def mixed():
    return uqmbd.Study("oscillator", oscillator(over_time=True), TIMES, METHODS).run()


@pytest.mark.parametrize("name", CLOSED)
def test_means_and_variances_are_those_of_the_closed_forms(tree, name):
    mean, variance = moments(CLOSED[name])
    for label in ("collocation", "galerkin"):
        found = tree[f"{label}/scalars/statistics"].sel(output=name)
        np.testing.assert_allclose(found["mean"], mean, rtol=1e-7)
        np.testing.assert_allclose(found["variance"], variance, rtol=1e-5)
    samples = tree["monte-carlo/scalars/samples"]
    exact = CLOSED[name](samples["inputs"].values[:, 0])
    np.testing.assert_allclose(samples["response"].sel(output=name), exact, rtol=1e-7)
    found = tree["monte-carlo/scalars/statistics"].sel(output=name)
    assert abs(found["mean"] - mean) < 4 * found["std_error_mean"]
    assert abs(found["std"] - np.sqrt(variance)) < 4 * found["std_error_std"]


def test_the_spring_bears_the_weight_in_every_realisation(tree):
    """Balance: the force on the pan is m g, without scatter."""
    for label in ("monte-carlo", "collocation", "galerkin"):
        found = tree[f"{label}/scalars/statistics"].sel(output="pull")
        np.testing.assert_allclose(found["mean"], G, rtol=1e-7)
        assert float(found["std"]) < 1e-6


def test_the_schema_is_kept_without_outputs_over_time(tree):
    validate(tree)
    assert tree["monte-carlo/statistics"].sizes["output"] == 0 and tree["monte-carlo/statistics"].sizes["time"] == 6
    assert "time" not in tree["collocation/scalars/chaos"].dims and "samples" not in tree["monte-carlo"].children
    assert list(tree["galerkin/scalars/statistics"]["output_units"].values) == ["Hz", "", "m", "N", "N/m"]
    assert tree["galerkin/scalars"].attrs["fit"] == "evaluated at the nodes of the quadrature and projected there"
    assert tree["galerkin/scalars"].attrs["label"] == tree["galerkin"].attrs["label"] == "galerkin"
    assert tree["monte-carlo"].attrs["realisations"] == 300


@pytest.mark.thorough
def test_outputs_of_both_kinds_do_not_disturb_each_other(tree, mixed):
    validate(mixed)
    for label in ("monte-carlo", "collocation", "galerkin"):
        assert list(mixed[f"{label}/statistics"]["output"].values) == ["y"]
        for name in ("mean", "std", "quantile"):
            alone, beside = (t[f"{label}/scalars/statistics"][name] for t in (tree, mixed))
            np.testing.assert_allclose(beside, alone, rtol=1e-9, atol=1e-12)
    without = oscillator(over_time=True)
    without.scalars.clear()
    plain = uqmbd.Study("plain", without, TIMES, METHODS).run()
    for label in ("monte-carlo", "collocation", "galerkin"):
        np.testing.assert_array_equal(plain[f"{label}/statistics"]["std"], mixed[f"{label}/statistics"]["std"])


def test_methods_are_compared(tree):
    found = tree["comparison"]
    means = {m: tree[f"{m}/scalars/statistics"]["mean"].values for m in ("monte-carlo", "galerkin")}
    np.testing.assert_allclose(
        found["scalar_mean_difference"].sel({"method": "galerkin"}), abs(means["galerkin"] - means["monte-carlo"])
    )
    assert list(found["scalar"].values) == list(oscillator().scalars)
    assert (found["scalar_std_difference"].sel({"method": "monte-carlo"}) == 0).all()


@pytest.mark.thorough
def test_results_are_stored_and_the_chaos_is_evaluated_again(tree, mixed, tmp_path):
    for number, results in enumerate((tree, mixed)):
        back = load(save(results, tmp_path / f"{number}.nc"))
        assert back.identical(results)
        chaos = PolynomialChaos.from_dataset(back["galerkin/scalars/chaos"])
        names = [o.name for o in chaos.labels.outputs]
        np.testing.assert_allclose(
            chaos.evaluate([[93.0], [117.0]])[:, names.index("sag")], G / np.array([93.0, 117.0]), rtol=1e-5
        )


@pytest.mark.thorough
def test_nothing_is_integrated_for_statics(monkeypatch):
    def integrate(*given, **_):
        raise AssertionError("integrated")

    monkeypatch.setattr(chunks, "integrate", integrate)
    uqmbd.Study("oscillator", oscillator(), TIMES, METHODS[:2]).run()
    data = uqmbd.simulate(oscillator(), TIMES, {"stiffness": 100})
    np.testing.assert_allclose(data["frequency"], 10 / (2 * np.pi), rtol=1e-9)


def test_simulate_gives_scalars_without_a_dimension():
    data = uqmbd.simulate(oscillator(over_time=True), TIMES)
    assert data["y"].dims == ("time",) and data["sag"].dims == () and data["sag"].attrs["units"] == "m"
    np.testing.assert_allclose(data["sag"], G / 100, rtol=1e-9)


def watched(monkeypatch):
    """Note which chunks are computed: whether for outputs without a time alone."""
    seen = []

    def compute(*task):
        seen.append(task[-1])
        return chunks.compute_chunk(*task)

    monkeypatch.setattr(runners, "compute_chunk", compute)
    return seen


@pytest.mark.thorough
def test_realisations_are_computed_once_for_both_kinds(monkeypatch):
    seen = watched(monkeypatch)
    uqmbd.Study("oscillator", oscillator(over_time=True), TIMES, METHODS[:1]).run()
    # five chunks of samples, and two of the 15 realisations from which the error of the integration is measured
    assert seen == ["outputs"] * 7


@pytest.mark.thorough
def test_an_interrupted_run_goes_on(monkeypatch, tmp_path, mixed):
    """The first three chunks are kept; outputs without a time come with them."""
    study = uqmbd.Study("oscillator", oscillator(over_time=True), TIMES, METHODS[:1])
    done = []

    def stop(*task):
        if len(done) == 3:
            raise KeyboardInterrupt
        done.append(task)
        return chunks.compute_chunk(*task)

    monkeypatch.setattr(runners, "compute_chunk", stop)
    with pytest.raises(KeyboardInterrupt):
        study.run(folder=tmp_path)
    seen = watched(monkeypatch)
    again = study.run(folder=tmp_path, resume=True)
    assert seen == ["outputs"] * 4  # the two that were left, and two of realisations that are integrated again
    assert (
        again["monte-carlo/scalars/samples"].to_dataset().identical(mixed["monte-carlo/scalars/samples"].to_dataset())
    )


def test_workers_change_nothing(tree):
    with ThreadPoolExecutor(2) as executor:
        other = uqmbd.Study("oscillator", oscillator(), TIMES, METHODS[:1]).run(executor)
    kind = "monte-carlo/scalars/samples"
    assert other[kind].to_dataset().identical(tree[kind].to_dataset())


def chain():
    """Two masses in a row between springs of random stiffness."""
    mechanism = uqmbd.Mechanism("chain", uqmbd.Planar())
    inputs = [uqmbd.RandomVariable(f"k{n}", chaospy.Uniform(60, 140), units="N/m") for n in (1, 2)]
    bodies = []
    for n in (1, 2):
        body = mechanism.body(f"mass{n}", mass=n, inertia=0.1, position=(n, 0))
        mechanism.add(Prismatic(f"guide{n}", mechanism.ground, body, (n, 0), (0, 0), (1, 0), (1, 0)))
        bodies.append(body)
    first, second = bodies
    mechanism.add(SpringDamper("s1", mechanism.ground, first, (0, 0), (0, 0), inputs[0], free_length=1))
    mechanism.add(SpringDamper("s2", first, second, (0, 0), (0, 0), inputs[1], free_length=1))
    for n in (1, 2):
        mechanism.output(f"f{n}", uqmbd.eigenfrequency(n), units="Hz")
    mechanism.output("ratio", uqmbd.eigenfrequency(2) / uqmbd.eigenfrequency(1))
    return mechanism


def chain_frequencies(k1, k2):
    """Both frequencies, Hz, by NumPy: the stiffness scaled by the masses 1 and 2."""
    stiffness = np.array([[k1 + k2, -k2], [-k2, k2]])
    root = np.diag([1.0, 1 / np.sqrt(2)])
    return np.sqrt(np.linalg.eigvalsh(root @ stiffness @ root)) / (2 * np.pi)


@pytest.mark.thorough
def test_a_chain_of_masses_has_the_frequencies_of_its_matrices():
    tree = uqmbd.Study("chain", chain(), TIMES, [MonteCarlo(samples=60, seed=2), Collocation(order=6)]).run()
    samples = tree["monte-carlo/scalars/samples"]
    expected = np.array([chain_frequencies(*row) for row in samples["inputs"].values])
    response = samples["response"]
    np.testing.assert_allclose(response.sel(output=["f1", "f2"]), expected, rtol=1e-9)
    np.testing.assert_allclose(response.sel(output="ratio"), expected[:, 1] / expected[:, 0], rtol=1e-9)

    # Sobol' indices by a fine Gauss rule: variances of conditional means
    x, w = np.polynomial.legendre.leggauss(20)
    grid = np.array([[chain_frequencies(100 + 40 * a, 100 + 40 * b) for b in x] for a in x])
    w = w / 2
    mean = np.einsum("a,b,abo->o", w, w, grid)
    variance = np.einsum("a,b,abo->o", w, w, (grid - mean) ** 2)
    first = [w @ (np.einsum("b,abo->ao", w, grid) - mean) ** 2, w @ (np.einsum("a,abo->bo", w, grid) - mean) ** 2]
    found = tree["collocation/scalars/statistics"].sel(output=["f1", "f2"])
    np.testing.assert_allclose(found["mean"], mean, rtol=1e-6)
    np.testing.assert_allclose(found["variance"], variance, rtol=1e-3)
    np.testing.assert_allclose(found["sobol_first"], first / variance, atol=1e-3)
    np.testing.assert_allclose(found["sobol_total"], 1 - (first / variance)[::-1], atol=1e-3)


@pytest.mark.thorough
def test_a_spatial_body_has_no_modes_of_its_quaternion():
    """A door has one frequency, sqrt(k / J); there is no second one."""
    mechanism = uqmbd.Mechanism("door", uqmbd.Spatial())
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(4, 6), units="N m")
    door = mechanism.body("door", mass=3, inertia=(1, 0.8, 0.5), position=(0.4, 0, 0), quaternion=(1, 0, 0, 0))
    axis = {"axis_i": (0, 0, 1), "axis_j": (0, 0, 1)}
    mechanism.add(Revolute("hinge", mechanism.ground, door, (0, 0, 0), (-0.4, 0, 0), **axis))
    mechanism.add(TorsionSpringDamper("spring", mechanism.ground, door, stiffness, **axis))
    mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    samples = uqmbd.Study("door", mechanism, TIMES, [MonteCarlo(samples=20, seed=1)]).run()[
        "monte-carlo/scalars/samples"
    ]
    k = samples["inputs"].values[:, 0]
    expected = np.sqrt(k / (0.5 + 3 * 0.4**2)) / (2 * np.pi)
    np.testing.assert_allclose(samples["response"].values[:, 0], expected, rtol=1e-8)
    mechanism.output("second", uqmbd.eigenfrequency(2), units="Hz")
    with pytest.raises(uqmbd.AssemblyError, match="no eigenfrequency 2: 1 of its modes oscillate"):
        uqmbd.simulate(mechanism, TIMES)


def test_a_free_body_on_a_bushing_has_six_modes():
    """Three of translation, sqrt(k / m), three of rotation, sqrt(c / J)."""
    mechanism = uqmbd.Mechanism("block", uqmbd.Spatial())
    block = mechanism.body("block", mass=2, inertia=(1, 2, 3), quaternion=(1, 0, 0, 0))
    rates = (10, 20, 30, 40, 50, 60)
    mechanism.add(Bushing("mount", mechanism.ground, block, (0, 0, 0), (0, 0, 0), rates))
    for n in range(1, 7):
        mechanism.output(f"f{n}", uqmbd.eigenfrequency(n), units="Hz")
    data = uqmbd.simulate(mechanism, TIMES)
    expected = np.sort(np.sqrt(np.array(rates) / (2, 2, 2, 1, 2, 3))) / (2 * np.pi)
    np.testing.assert_allclose([float(data[f"f{n}"]) for n in range(1, 7)], expected, rtol=1e-7)


def test_rigid_body_modes_have_no_number():
    """Two masses joined by a spring drift freely, and oscillate with sqrt(k (1/m1 + 1/m2))."""
    mechanism = uqmbd.Mechanism("free", uqmbd.Planar())
    bodies = []
    for n in (1, 2):
        bodies.append(mechanism.body(f"mass{n}", mass=n, inertia=0.1, position=(n, 0)))
        mechanism.add(Prismatic(f"guide{n}", mechanism.ground, bodies[-1], (n, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.add(SpringDamper("spring", *bodies, (0, 0), (0, 0), 50, free_length=1))
    mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    found = float(uqmbd.simulate(mechanism, TIMES)["frequency"])
    assert found == pytest.approx(np.sqrt(50 * 1.5) / (2 * np.pi), rel=1e-9)


def test_realisations_without_a_mode_are_counted():
    """Damped beyond 2 sqrt(k m) the mass does not oscillate: a status and a reason, and no part in the mean."""
    damping = uqmbd.RandomVariable("damping", chaospy.Uniform(0, 30), units="N s/m")
    study = uqmbd.Study(
        "oscillator", oscillator(over_time=True, damping=damping), TIMES, [MonteCarlo(samples=100, seed=4)]
    )
    with pytest.warns(UserWarning, match="realisations failed; .* 0 of its modes oscillate"):
        node = study.run()["monte-carlo"]
    samples, scalars = node["samples"], node["scalars/samples"]
    names = list(scalars["input"].values)
    c, k = (scalars["inputs"].values[:, names.index(n)] for n in ("damping", "stiffness"))
    over = c > 2 * np.sqrt(k)
    assert 10 < over.sum() < 90 and not samples["status"].values.any()
    np.testing.assert_array_equal(scalars["status"].values, np.where(over, 4, 0))
    assert np.isnan(scalars["response"].values[over]).all() and node["scalars"].attrs["failures"] == over.sum()
    assert "0 of its modes oscillate" in str(scalars["message"].values[over][0])
    ratio = scalars["response"].sel(output="damping").values[~over]
    np.testing.assert_allclose(ratio, (c / (2 * np.sqrt(k)))[~over], rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize(("start", "expected"), [("drawn", np.cos(0.3)), ("equilibrium", 1.0)])
def test_modes_are_those_about_equilibrium_or_start(start, expected):
    """A rod on a pivot, drawn 0.3 rad aside: sqrt(3 g cos(angle) / (2 l))."""
    mechanism = uqmbd.Mechanism("rod", uqmbd.Planar(gravity=(0, -G)))
    angle = 0.3 - np.pi / 2
    where = (0.5 * np.cos(angle), 0.5 * np.sin(angle))
    rod = mechanism.body("rod", mass=1, inertia=1 / 12, position=where, angle=angle)
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-0.5, 0)))
    mechanism.output("there", (2 * sympy.pi * uqmbd.eigenfrequency(1, at="start")) ** 2)
    mechanism.output("rest", (2 * sympy.pi * uqmbd.eigenfrequency(1)) ** 2)
    mechanism.output("angle", uqmbd.at_equilibrium(rod.angle), units="rad")
    data = uqmbd.simulate(mechanism, TIMES, start=start)
    assert float(data["rest"]) == pytest.approx(1.5 * G, rel=1e-8)
    assert float(data["there"]) == pytest.approx(1.5 * G * expected, rel=1e-8)
    assert float(data["angle"]) == pytest.approx(-np.pi / 2, abs=1e-8)


@pytest.mark.thorough
def test_monte_carlo_knows_sobol_indices_and_controls():
    """The stiffness alone moves the frequency; a chaos takes nearly all variance off its mean."""
    damping = uqmbd.RandomVariable("damping", chaospy.Uniform(0.5, 1), units="N s/m")
    methods = [
        MonteCarlo(samples=100, seed=4, sobol_indices=True),
        MonteCarlo(samples=100, seed=4, control=Collocation(order=2), label="controlled"),
    ]
    tree = uqmbd.Study("oscillator", oscillator(damping=damping), TIMES, methods).run()
    indices = tree["monte-carlo/scalars/statistics"].sel(output="frequency")["sobol_total"]
    np.testing.assert_allclose(indices.sel(input=["damping", "stiffness"]), [0, 1], atol=0.2)
    controlled = tree["controlled/scalars/statistics"].sel(output="frequency")
    assert controlled["variance_reduction"] > 1000
    assert abs(controlled["mean"] - moments(CLOSED["frequency"])[0]) < 5 * controlled["std_error_mean"]


@dataclass(frozen=True, kw_only=True)
class AtMeans(uqmbd.extend.Propagator):
    """A method that knows nothing of outputs without a time."""

    name = "at-means"

    def propagate(self, problem):
        found = problem.realise(problem.inputs.means[None, :])
        spread = np.zeros(problem.labels.shape)
        statistics = statistics_dataset(problem.labels, mean=found.response[0], std=spread)
        return problem.node(self, statistics, realisations=1, wall_time=0.0)


def test_a_method_need_not_know_of_them():
    node = uqmbd.Study("oscillator", oscillator(over_time=True), TIMES).propagate(AtMeans())
    assert node["statistics"]["mean"].dims == ("output", "time")
    found = node["scalars/statistics"].sel(output="sag")["mean"]
    assert found.dims == () and float(found) == pytest.approx(G / 100)


def test_realisations_carry_them():
    study = uqmbd.Study("oscillator", oscillator(over_time=True), TIMES)
    found = study.problem(METHODS[0]).realise(np.array([[90.0], [110.0]]))
    np.testing.assert_allclose(found.scalars.values[:, 2], G / np.array([90.0, 110.0]))
    assert found.scalars.status.tolist() == [0, 0]


def test_an_integration_can_yield_them(monkeypatch):
    """What an integrator puts into its trajectories under a name: here when the pan is lowest, NaN for soft springs."""
    mechanism = oscillator(over_time=True, damping=0)
    for name in list(mechanism.scalars):
        del mechanism.scalars[name]
    mechanism.output("lowest", 1000 * MotionSymbol("lowest time"), units="ms")
    integrate = chunks.integrate

    def with_times(ensemble, times, rtol, method, between):
        k = ensemble.values[:, 0]
        found = np.where(k > 90, np.pi / np.sqrt(k), np.nan)
        return replace(integrate(ensemble, times, rtol), scalars={"lowest time": found})

    monkeypatch.setattr(chunks, "integrate", with_times)
    with pytest.warns(UserWarning, match="realisations failed; .*its motion has no lowest time"):
        node = uqmbd.Study("oscillator", mechanism, TIMES).propagate(MonteCarlo(samples=50, seed=1))
    samples = node["scalars/samples"]
    k = samples["inputs"].values[:, 0]
    stiff = k > 90
    np.testing.assert_allclose(samples["response"].values[stiff, 0], 1000 * np.pi / np.sqrt(k[stiff]))
    np.testing.assert_array_equal(samples["status"].values != 0, ~stiff)
    assert str(samples["message"].values[~stiff][0]) == "its motion has no lowest time"
    del mechanism.outputs["y"]
    with pytest.warns(UserWarning, match="1 of 3 nodes failed"):
        alone = uqmbd.Study("oscillator", mechanism, TIMES).propagate(Collocation(order=2, verify=0, nodes=3))
    assert int(alone["scalars"].attrs["failures"]) == 1  # the lowest of three Gauss nodes


@pytest.mark.thorough
def test_they_are_reported(mixed, tmp_path, capsys):
    from uqmbd.cli.tables import show_summary

    page = write_report(mixed, tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Scalar outputs" in page and "stiffness (100\xa0%)" in page and "could not be drawn" not in page
    show_summary(mixed, files={})
    said = capsys.readouterr().out
    assert "scalar outputs" in said and "1.589 ± 0.092" in said


@pytest.mark.thorough
def test_times_may_be_left_out_where_nothing_moves(tree, tmp_path):
    study = uqmbd.Study("oscillator", oscillator(), propagators=METHODS)
    assert "no times" in repr(study) and "none" in study._repr_html_()
    found = study.run()
    validate(found)
    for label in ("monte-carlo", "collocation", "galerkin"):
        for name in ("mean", "std"):
            one, other = (x[f"{label}/scalars/statistics"][name].values for x in (found, tree))
            np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-15)
    assert write_report(found, tmp_path / "report.html").exists()
    with pytest.raises(uqmbd.StudyError, match="no output times, so there is no motion"):
        motion(study)


def test_outputs_over_time_need_times():
    with pytest.raises(uqmbd.StudyError, match=r"study 's': times are missing; expected .*linspace.* for 'y'"):
        uqmbd.Study("s", oscillator(over_time=True), propagators=METHODS)
    moving = oscillator()
    moving.output("lowest", MotionSymbol("lowest time"), units="s")
    with pytest.raises(uqmbd.StudyError, match="times are missing; .* for 'lowest'"):
        uqmbd.Study("s", moving)
    later = oscillator()
    study = uqmbd.Study("s", later, propagators=METHODS)
    later.output("y", later.bodies["pan"].position[1], units="m")
    with pytest.raises(uqmbd.StudyError, match="times are missing"):
        study.run()


def test_misuse_is_one_clear_message():
    mechanism = oscillator()
    pan = mechanism.bodies["pan"]
    with pytest.raises(uqmbd.StudyError, match="combines"):
        mechanism.output("both", uqmbd.eigenfrequency(1) * pan.position[1])
    with pytest.raises(uqmbd.StudyError, match="an output with this name exists already"):
        mechanism.output("sag", pan.position[1])
    with pytest.raises(uqmbd.StudyError, match="omit angle=True"):
        mechanism.output("turn", uqmbd.at_equilibrium(pan.angle), units="rad", angle=True)
    with pytest.raises(uqmbd.StudyError, match="is only permitted in outputs"):
        mechanism.body("other", mass=uqmbd.eigenfrequency(1), inertia=1)
    with pytest.raises(uqmbd.StudyError, match="lowest frequency above zero"):
        uqmbd.eigenfrequency(0)
    with pytest.raises(uqmbd.StudyError, match="expected 'equilibrium', 'start' or 'steady'"):
        uqmbd.damping_ratio(1, at="drawn")
    with pytest.raises(uqmbd.StudyError, match="already contains a scalar output"):
        uqmbd.at_equilibrium(uqmbd.eigenfrequency(1))
    with pytest.raises(uqmbd.StudyError, match="expected one expression"):
        uqmbd.at_equilibrium(pan.position)
    for function in (uqmbd.maximum, uqmbd.integral, uqmbd.final, uqmbd.at_equilibrium):
        with pytest.raises(
            uqmbd.StudyError,
            match=f"^{function.__name__}: the argument is the constant 2, which is equal in every pose",
        ):
            function(2)
