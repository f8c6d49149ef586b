"""Every result states the error of its time integration, measured on a few of its realisations."""

from __future__ import annotations

from typing import ClassVar

import chaospy
import numpy as np
import pytest
import sympy
import xarray as xr

import uqmbd
from uqmbd.extend import Realisations, statistics_dataset
from uqmbd.propagation.execution import Observed
from uqmbd.propagation.integration_error import stated_errors
from uqmbd.results import propagator_node, validate
from uqmbd.testing.propagators.executors import RecordingExecutor
from uqmbd.wording import format_percent
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_drivers import RotationDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce, SpringDamper

TIMES = np.linspace(0, 3, 13)
OMEGA = 7.0


def spring():
    """A mass on a spring of a random start: x = amplitude cos(omega t), a closed form that no tolerance enters."""
    mechanism = uqmbd.Mechanism("spring", uqmbd.Translational())
    amplitude = uqmbd.RandomVariable("amplitude", chaospy.Uniform(1.0, 1.2), units="m")
    mass = mechanism.body("mass", mass=1, position=(amplitude, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (-2, 0), (0, 0), stiffness=OMEGA**2, free_length=2))
    mechanism.output("x", mass.position[0], units="m")
    mechanism.output("v", mass.velocity[0], units="m/s")
    return mechanism


def crank(speed=40.0):
    """A driven crank of random length, which turns at a stated rate: its angle does not vary."""
    mechanism = uqmbd.Mechanism("crank", uqmbd.Planar())
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.9, 1.1), units="m")
    body = mechanism.body("crank", mass=1, inertia=0.1, position=(0, 0))
    mechanism.add(Revolute("pin", mechanism.ground, body, (0, 0), (0, 0)))
    mechanism.add(RotationDriver("motor", mechanism.ground, body, angle=speed * uqmbd.t))
    mechanism.output("heading", body.angle, units="rad", angle=True)
    mechanism.output("tip", body.point((length, 0))[0], units="m")
    return mechanism


def ball():
    """A ball that falls from a random height on a floor."""
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -9.81)))
    height = uqmbd.RandomVariable("height", chaospy.Uniform(0.9, 1.1), units="m")
    body = mechanism.body("ball", mass=1, position=(0, height))
    floor = mechanism.add(PlaneImpact("floor", mechanism.ground, body, (0, 0), (0, 0), (0, 1), restitution=0.7))
    mechanism.output("y", body.position[1], units="m")
    mechanism.output("second", floor.event_time("impact", 2), units="s")
    return mechanism


@pytest.fixture(scope="module")
def springs():
    return spring()


@pytest.mark.parametrize("rtol", [1e-4, 1e-6])
@pytest.mark.parametrize(
    "propagator",
    [MonteCarlo(samples=20, seed=1), Collocation(order=2), Galerkin(order=2), Galerkin(order=2, verify=0, label="g0")],
    ids=lambda p: p.node_name,
)
def test_the_stated_error_is_that_against_the_closed_form(springs, propagator, rtol):
    """Samples, and means of expansions, are wrong by what is stated, within a factor."""
    node = uqmbd.Study("s", springs, TIMES, [propagator], rtol=rtol).propagate(propagator)
    validate(node)
    stated = node["statistics/integration_error"]
    assert stated.dims == ("output", "time") and (stated[:, 0] < 1e-12).all()
    unit = np.array([np.cos(OMEGA * TIMES), -OMEGA * np.sin(OMEGA * TIMES)])
    if "samples" in node.children:
        amplitude = node["samples/inputs"].values[:, :, None]
        wrong = np.abs(node["samples/response"].values - amplitude * unit).max()
    else:
        wrong = np.abs(node["statistics/mean"].values - 1.1 * unit).max()
    assert 0.2 * wrong <= float(stated.max()) <= 10 * wrong


def test_no_method_need_do_anything(springs):
    """A propagator of somebody else, who knows nothing of it, and computes its realisations or none at all."""

    class Mine(uqmbd.extend.Propagator):
        name: ClassVar[str] = "mine"

        def propagate(self, problem):
            found = problem.realise(problem.inputs.means[None, :])
            data = statistics_dataset(problem.labels, mean=found.response[0], std=np.zeros(problem.labels.shape))
            return problem.node(self, data, realisations=1, wall_time=found.wall_time)

    class Table(uqmbd.extend.Propagator):
        name: ClassVar[str] = "table"

        def propagate(self, problem):
            zeros = np.zeros(problem.labels.shape)
            data = statistics_dataset(problem.labels, mean=zeros, std=zeros)
            return propagator_node(problem.label, data, propagator=self.name, realisations=0, wall_time=0.0)

    study = uqmbd.Study("s", springs, TIMES, [Mine(), Table()])
    tree = study.run()
    for label in ("mine", "table"):
        stated = tree[f"{label}/statistics/integration_error"]
        assert 0 < stated.max() < 1e-3
    once = uqmbd.simulate(springs, TIMES)
    assert float(tree["mine/statistics/integration_error"].sel(output="x").max()) == pytest.approx(
        float(once["integration_error"].sel(output="x").max())
    )


@pytest.mark.thorough
def test_same_bits_for_any_number_of_workers_and_after_a_resume(springs, tmp_path):
    propagators = [MonteCarlo(samples=150, seed=1), Collocation(order=2)]
    study = uqmbd.Study("s", springs, TIMES, propagators)
    # it pickles what it is given, as another process would have it
    alone, two = study.run(1), study.run(RecordingExecutor())

    class Stop(BaseException):
        pass

    class AtTheSecond:
        def start(self, label, total):
            if label == "collocation":
                raise Stop

        def advance(self, label, count=1):
            pass

        def finish(self, label):
            pass

    with pytest.raises(Stop):
        study.run(1, progress=AtTheSecond(), folder=tmp_path)
    kept = {path.parent.name for path in tmp_path.rglob("*.npz")}
    assert len(kept) == 2, "the second integration is kept beside the samples"
    resumed = study.run(RecordingExecutor(), folder=tmp_path, resume=True)
    for label in ("monte-carlo", "collocation"):
        first = alone[f"{label}/statistics/integration_error"].values
        assert np.isfinite(first).all() and first.max() > 0
        for other in (two, resumed):
            assert other[f"{label}/statistics/integration_error"].values.tobytes() == first.tobytes()


@pytest.mark.parametrize(("samples", "repeated"), [(40, 0), (160, 8)])
def test_workers_integrate_again_where_there_are_several(springs, samples, repeated):
    """The workers that compute the samples also repeat some of them; for three no workers are started."""
    workers = RecordingExecutor()
    node = uqmbd.Study("s", springs, TIMES).propagate(MonteCarlo(samples=samples, seed=1), workers)
    assert node.attrs["realisations"] == samples
    assert node["statistics/integration_error"].attrs["realisations"] == max(repeated, 3)
    assert workers.realisations == samples + repeated


def test_angles_are_compared_up_to_whole_turns():
    """A crank that is driven: its angle is that of the driver, whatever number of turns a realisation counts."""
    found = uqmbd.Study("s", crank(), TIMES, [MonteCarlo(samples=5, seed=1)]).run()["monte-carlo/statistics"]
    assert found["integration_error"].max() < 1e-4


def test_event_times_have_one_too():
    """The second impact of a ball from 1 m, and its height between the impacts."""
    node = uqmbd.Study("s", ball(), np.linspace(0, 1.4, 8), [MonteCarlo(samples=4, seed=1)]).run()["monte-carlo"]
    still = node["scalars/statistics/integration_error"]
    assert still.dims == ("output",) and 0 <= float(still[0]) < 1e-6
    assert np.isfinite(node["statistics/integration_error"]).all()


def held(time, measured):
    """Command no force."""
    return 0 * measured


def test_equal_steps_at_both_tolerances_do_not_hide_the_error():
    """Each step ends at a sample of a controller, and its error is below both tolerances."""
    mechanism = spring()
    mass = mechanism.bodies["mass"]
    controller = mechanism.add(uqmbd.Controller(measured=["x"], commanded={"force": "N"}, rate=16, function=held))
    mechanism.add(PointForce("push", mass, (0, 0), (controller.command("force"), 0)))
    true = 1.1 * np.cos(OMEGA * TIMES)
    once = uqmbd.simulate(mechanism, TIMES)
    same = uqmbd.simulate(mechanism, TIMES, rtol=1e-8, check=False)
    assert np.abs(once["x"] - same["x"]).max() < 1e-13, "the second integration has the same steps"
    wrong = np.abs(once["x"].values - true).max()
    assert 0.5 * wrong < float(once["integration_error"].sel(output="x").max()) < 2 * wrong
    assert once["integration_error"].attrs["comment"].endswith("rtol 1e-13")
    stated = uqmbd.Study("s", mechanism, TIMES).propagate(MonteCarlo(samples=5, seed=1))["statistics/integration_error"]
    assert stated.attrs["rtol"] == 1e-13
    assert 0.5 * wrong < float(stated.sel(output="x").max()) < 5 * wrong


def test_an_error_of_zero_is_at_the_level_of_rounding():
    """A body at constant velocity has no integration error at any tolerance."""
    from uqmbd.results.assessment import integration_shares

    mechanism = uqmbd.Mechanism("cart", uqmbd.Line())
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 2), units="m/s")
    cart = mechanism.body("cart", mass=1, velocity=speed)
    mechanism.output("v", cart.velocity[0], units="m/s")
    tree = uqmbd.Study("s", mechanism, [0, 1, 2], [MonteCarlo(samples=5, seed=1)]).run()
    (one,) = integration_shares(tree["monte-carlo/statistics"].to_dataset())
    assert one.error == 0
    assert one.sentence() == "The integration error is at the level of rounding."
    assert one.words() == "at the level of rounding"


def test_nothing_is_stated_where_nothing_is_integrated():
    mechanism = spring()
    mechanism.outputs.clear()
    mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    with pytest.warns(uqmbd.UnusedInputWarning, match="'amplitude'"):
        node = uqmbd.Study("s", mechanism, propagators=[MonteCarlo(samples=4, seed=1)]).run()["monte-carlo"]
    assert "integration_error" not in node["scalars/statistics"]


def test_where_the_tighter_integration_fails_the_results_stay(springs, monkeypatch):
    """The reason is told with a NaN."""
    from uqmbd.dynamics.integrators import built_in as integration

    real = integration.integrate_by_dop853

    def stubborn(ensemble, members, times, rtol, **options):
        found = real(ensemble, members, times, rtol, **options)
        if rtol > 1e-7:
            return found
        lost = np.full_like(found.states, np.nan)
        lost[:, 0] = found.states[:, 0]
        return type(found)(lost, ("no further",) * len(members), found.counters, (True,) * len(members))

    monkeypatch.setattr(integration, "integrate_by_dop853", stubborn)
    study = uqmbd.Study("s", springs, TIMES, [MonteCarlo(samples=5, seed=1)])
    statistics = study.run()["monte-carlo/statistics"]
    assert np.isfinite(statistics["mean"]).all()
    assert np.isnan(statistics["integration_error"]).all()
    assert "no further" in statistics["integration_error"].attrs["reason"]
    once = uqmbd.simulate(springs, TIMES)
    assert np.isnan(once["integration_error"]).all() and np.isfinite(once["x"]).all()


def test_a_simulation_states_it_beside_its_outputs(springs):
    """The data variables stay one per output; without the check nothing more is computed."""
    found = uqmbd.simulate(springs, TIMES)
    assert list(found.data_vars) == ["x", "v"]
    stated = found["integration_error"]
    assert stated.dims == ("output", "time") and stated.sel(output="v").attrs["long_name"]
    # 1.1 m is the mean of the amplitude
    wrong = np.abs(found["x"].values - 1.1 * np.cos(OMEGA * TIMES)).max()
    assert 0.5 * wrong <= float(stated.sel(output="x").max()) <= 2 * wrong
    without = uqmbd.simulate(springs, TIMES, check=False)
    assert "integration_error" not in without.coords and "output" not in without.coords
    xr.testing.assert_equal(found.drop_vars(["integration_error", "output", "output_units"], errors="ignore"), without)


def test_a_simulation_without_check_integrates_once(springs, monkeypatch):
    from uqmbd.dynamics.integrators import built_in as integration

    tolerances = []
    real = integration.integrate_by_dop853

    def counted(ensemble, members, times, rtol, **options):
        tolerances.append(rtol)
        return real(ensemble, members, times, rtol, **options)

    monkeypatch.setattr(integration, "integrate_by_dop853", counted)
    uqmbd.simulate(springs, TIMES, check=False)
    assert tolerances == [1e-6]
    uqmbd.simulate(springs, TIMES)
    assert tolerances == [1e-6, 1e-6, 1e-8]


def test_outputs_may_have_the_names_that_the_error_has():
    """An output that is called as the error, or as its dimension, keeps its name and values."""
    mechanism = uqmbd.Mechanism("fall", uqmbd.Translational(gravity=(0, -10)))
    stone = mechanism.body("stone", mass=1)
    for name in ("output", "integration_error", "output_units"):
        mechanism.output(name, stone.position[1], units="m")
    found = uqmbd.simulate(mechanism, [0, 1, 2])
    assert list(found.data_vars) == ["output", "integration_error", "output_units"]
    for name in found.data_vars:
        assert found[name].dims == ("time",) and float(found[name][-1]) == pytest.approx(-20)
    assert [name for name in found.coords if "error" in str(name)], "it is stated under another name"


@pytest.mark.thorough
def test_the_console_and_the_report_say_it(springs, tmp_path, capsys):
    """In proportion to the spread, so that a user sees which digit to believe."""
    from uqmbd.cli.tables import show_summary
    from uqmbd.report import write_report

    tree = uqmbd.Study("s", springs, TIMES, [Collocation(order=2)], rtol=1e-4).run()
    statistics = tree["collocation/statistics"]
    share = (statistics["integration_error"].max("time") / statistics["std"].max("time")).max()
    expected = f"{format_percent(float(share))} of the largest standard deviation"
    show_summary(tree, files={})
    line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("integration error"))
    assert line.split(maxsplit=2)[2] == expected
    write_report(tree, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8").replace("\xa0", " ")
    assert expected in page and "The integration error is at most" in page


def test_what_does_not_vary_beyond_the_error_is_reported_over_its_size():
    """A driven angle has no spread to be compared with."""
    from uqmbd.results.assessment import integration_shares

    found = uqmbd.Study("s", crank(), TIMES, [MonteCarlo(samples=5, seed=1)]).run()["monte-carlo/statistics"]
    heading, tip = integration_shares(found.to_dataset())
    assert not heading.varies and heading.whole == "the largest mean"
    assert tip.varies and tip.whole == "the largest standard deviation" and 0 <= tip.share < 1e-3


def taken(counts):
    """Return the numbers of the realisations that are integrated again, for chunks of given sizes."""
    seen, first = Observed(), 0
    for count in counts:
        values = np.arange(first, first + count)[:, None]
        response, status = np.zeros((count, 1, 1)), np.zeros(count, dtype=np.int64)
        seen.add(Realisations(values, response, status, ("",) * count, {}, 0.0))
        first += count
    return np.array(seen.values)[:, 0]


@pytest.mark.parametrize("counts", [[20], [64] * 8, [36, 500], [5, 5, 5, 200], [512] * 20, [1] * 100])
def test_one_of_twenty_is_integrated_again(counts):
    """At least three, at most a hundred, of the whole population, each once."""
    found, total = taken(counts), sum(counts)
    assert len(found) == max(3, min(100, total // 20))
    assert len(np.unique(found)) == len(found)
    if 60 <= total <= 2000 and max(counts) > 20:
        assert np.diff(np.r_[0, np.sort(found), total]).max() <= max(60, max(counts) / 3)


@pytest.mark.parametrize("tail", [0.0, 0.5, 1.0])
def test_errors_of_few_hold_for_their_population(tail):
    """Of 25 out of a population: lognormal sizes times a normal course over time, whose distribution is known."""
    random, inside, above = np.random.default_rng(5), [], []
    shape = np.linspace(0.1, 3, 30)
    true = shape * np.exp(tail**2)
    for _ in range(100):

        def drawn(count):
            sizes = np.exp(tail * random.standard_normal((count, 1, 1)))
            return np.abs(sizes * random.standard_normal((count, 1, 30)) * shape)

        rms, factor, quantile = stated_errors(drawn(25), np.inf)
        inside.append((np.abs(np.log(rms / true)) <= np.log(factor)).mean())
        above.append((drawn(1000) > quantile).mean())
    assert np.mean(inside) > (0.9 if tail < 1 else 0.7)
    assert np.mean(above) < 0.02 and np.quantile(above, 0.9) < 0.03


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_errors_scale_with_their_output(factor):
    wrong = np.abs(np.random.default_rng(2).standard_normal((25, 3, 7)))
    first, scaled = stated_errors(wrong, 500), stated_errors(factor * wrong, 500)
    for one, other, by in zip(first, scaled, (factor, 1.0, factor), strict=True):
        np.testing.assert_allclose(other, by * one, rtol=1e-12)


def lopsided(*, names=("k", "extra"), per_metre=1.0):
    """A mass on a spring that is stiffer on one side; the start has units of its own, and inputs the given names."""
    mechanism = uqmbd.Mechanism("lopsided", uqmbd.Line())
    start = uqmbd.RandomVariable("start", chaospy.Uniform(0.08 * per_metre, 0.12 * per_metre), units="m")
    stiffness = uqmbd.RandomVariable(names[0], chaospy.Uniform(90, 110), units="N/m")
    extra = uqmbd.RandomVariable(names[1], chaospy.Uniform(100, 200), units="N/m")
    mass = mechanism.body("mass", mass=1, position=start / per_metre)
    way = mass.position[0]
    mechanism.add(PointForce("spring", mass, 0, -stiffness * way - extra * sympy.Max(way, 0)))
    mechanism.output("x", way, units="m")
    mechanism.output("x_mm", 1e3 * way + 7e3, units="mm")
    return mechanism


class Given(uqmbd.extend.Propagator):
    """Realisations at points that are named, whatever the order of the inputs is."""

    name: ClassVar[str] = "given"

    def __init__(self, points):
        super().__init__()
        self.points = points

    def propagate(self, problem):
        found = problem.realise(np.column_stack([self.points[one.name] for one in problem.labels.inputs]))
        response = found.response
        data = statistics_dataset(problem.labels, mean=response.mean(axis=0), std=response.std(axis=0))
        return problem.node(self, data, realisations=len(response), wall_time=found.wall_time)


ERRORS = ("integration_error", "integration_error_rms", "integration_error_factor")


@pytest.mark.thorough
def test_units_and_order_of_inputs_and_shifts_of_outputs_change_no_stated_error():
    random = np.random.default_rng(3)
    start, stiffness, extra = (
        random.uniform(0.08, 0.12, 100),
        random.uniform(90, 110, 100),
        random.uniform(100, 200, 100),
    )

    def stated(mechanism, **points):
        study = uqmbd.Study("s", mechanism, TIMES, [Given(points)])
        return study.propagate(study.propagators[0])["statistics"]

    first = stated(lopsided(), start=start, k=stiffness, extra=extra)
    for other in (
        stated(lopsided(per_metre=1e3), start=1e3 * start, k=stiffness, extra=extra),
        stated(lopsided(names=("z", "a")), start=start, z=stiffness, a=extra),
    ):
        for name in ERRORS:
            np.testing.assert_allclose(other[name], first[name], rtol=1e-3, atol=1e-12)
    for name, by in zip(ERRORS, (1e3, 1e3, 1.0), strict=True):
        plain, scaled = (first[name].sel(output=output).values for output in ("x", "x_mm"))
        some = first["integration_error"].sel(output="x").values > 1e-10
        np.testing.assert_allclose(scaled[some], by * plain[some], rtol=1e-2)


def closed_form(start, stiffness, extra):
    """Positions (time,) of the lopsided spring: half periods of sines, on either side with a frequency of its own."""
    right, left = np.sqrt(stiffness + extra), np.sqrt(stiffness)
    way = (TIMES + np.pi / (2 * right)) % (np.pi / right + np.pi / left)
    ahead = way < np.pi / right
    return start * np.where(ahead, np.sin(right * way), -right / left * np.sin(left * (way - np.pi / right)))


@pytest.mark.thorough
def test_errors_of_a_spring_with_a_kink_are_those_against_its_closed_form():
    """For all samples: of the root mean square to a factor of two, and at most 2 % of them above the quantile."""
    node = uqmbd.Study("s", lopsided(), TIMES, [MonteCarlo(samples=300, seed=1)]).propagate(
        MonteCarlo(samples=300, seed=1)
    )
    inputs = node["samples/inputs"]
    true = np.array([closed_form(*(float(row.sel(input=name)) for name in ("start", "k", "extra"))) for row in inputs])
    wrong = np.abs(node["samples/response"].sel(output="x").values - true)
    rms, quantile = (node[f"statistics/{name}"].sel(output="x").values for name in (ERRORS[1], ERRORS[0]))
    assert node["statistics/integration_error"].attrs["realisations"] == 15
    assert 0.5 < np.sqrt((rms**2).mean() / (wrong**2).mean()) < 2
    assert (wrong[:, 1:] > quantile[1:]).mean() < 0.02
