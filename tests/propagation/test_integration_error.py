"""Every result states the error of its time integration, measured on a few of its realisations."""

from __future__ import annotations

from typing import ClassVar

import chaospy
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd.extend import statistics_dataset
from uqmbd.results import propagator_node, validate
from uqmbd.testing.propagators.executors import RecordingExecutor
from uqmbd.wording import format_percent
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_drivers import RotationDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper

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
    expected = f"{format_percent(float(share))} of the spread"
    show_summary(tree, files={})
    line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("integration error"))
    assert line.split(maxsplit=2)[2] == expected
    write_report(tree, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8").replace("\xa0", " ")
    assert expected in page and "The integration error is at most" in page


def test_what_does_not_vary_beyond_the_error_is_told_over_its_size():
    """A driven angle has no spread to be compared with."""
    from uqmbd.results.assessment import integration_shares

    found = uqmbd.Study("s", crank(), TIMES, [MonteCarlo(samples=5, seed=1)]).run()["monte-carlo/statistics"]
    heading, tip = integration_shares(found.to_dataset())
    assert not heading.varies and heading.of_what == "of the mean"
    assert tip.varies and tip.of_what == "of the spread" and 0 <= tip.share < 1e-3
