"""Studies: what they take, and that results depend on nothing but the study."""

from __future__ import annotations

import concurrent.futures
import copy
import dataclasses
import inspect
import pickle
import re
import subprocess
import sys
import textwrap

import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd_montecarlo import MonteCarlo
from uqmbd_montecarlo.gathering import uniform_samples

from ..conftest import fragile, oscillator

TIMES = np.linspace(0, 0.5, 6)


def response(tree, label="monte-carlo"):
    return tree[label]["samples"]["response"].values


def same(one, two):
    """Bit by bit."""
    return one.tobytes() == two.tobytes()


def test_same_seed_gives_the_same_bits_and_another_gives_others(swing, results):
    again = swing.propagate(MonteCarlo(samples=100, seed=3))
    assert same(again["samples"]["response"].values, response(results))
    other = swing.propagate(MonteCarlo(samples=100, seed=4))
    assert not np.array_equal(other["samples"]["inputs"].values, results["monte-carlo"]["samples"]["inputs"].values)


def test_mechanism_described_again_gives_the_same_bits(results):
    study = uqmbd.Study("again", oscillator(), TIMES, [MonteCarlo(samples=100, seed=3)])
    assert same(response(study.run()), response(results))


@pytest.mark.thorough
def test_results_do_not_depend_on_who_computes_them(swing, results):
    assert same(response(swing.run(workers=2)), response(results))
    with concurrent.futures.ThreadPoolExecutor(2) as threads:
        assert same(response(swing.run(workers=threads)), response(results))
        assert threads.submit(int, 3).result() == 3  # it is still open


def test_realise_gives_the_same_bits_for_the_same_chunk(swing):
    problem = swing.problem(swing.propagators[0])
    values = problem.inputs.from_uniform(np.random.default_rng(0).uniform(0.05, 0.95, (100, 2)))
    short, long = problem.realise(values[:64]), problem.realise(values)
    assert same(short.response, long.response[:64])
    assert short.failures == 0 and short.most_frequent_reason() == ""


def test_tree(swing, results):
    assert sorted(results.children) == ["comparison", "monte-carlo"]
    node = results["monte-carlo"]
    assert node["samples"].sizes == {"sample": 100, "output": 2, "time": 6, "input": 2}
    assert list(node["samples"]["input"].values) == ["length", "push"]
    assert int(np.count_nonzero(node["samples"]["status"])) == 0


def test_chosen_propagators(swing):
    study = swing.with_propagators([MonteCarlo(samples=4, label="a"), MonteCarlo(samples=5, label="b")])
    assert sorted(study.run(only=["b"]).children) == ["b", "comparison"]
    assert sorted(study.run(only="a").children) == ["a", "comparison"]
    with pytest.raises(uqmbd.StudyError, match="study 'swings' has no propagator 'c'; its propagators are: a, b"):
        study.run(only=["a", "c"])


class Recorder:
    """Progress as a list."""

    def __init__(self):
        self.told = []

    def start(self, label, total):
        self.told.append(("start", label, total))

    def advance(self, label, count=1):
        self.told.append(("advance", label, count))

    def finish(self, label):
        self.told.append(("finish", label))


def test_progress_adds_up(swing):
    recorder = Recorder()
    swing.run(progress=recorder)
    assert recorder.told[0] == ("start", "monte-carlo", 100) and recorder.told[-1] == ("finish", "monte-carlo")
    assert sum(told[2] for told in recorder.told[1:-1]) == 100


@pytest.mark.thorough
def test_finished_chunks_are_used_again_and_then_removed(swing, results, tmp_path):
    class Impatient(Recorder):
        def advance(self, label, count=1):
            super().advance(label, count)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        swing.run(folder=tmp_path, progress=Impatient())
    assert len(list(tmp_path.rglob("*.npz"))) == 1
    tree = swing.run(folder=str(tmp_path), resume=True)
    assert same(response(tree), response(results))
    # what was computed is kept until the results of this run are stored there
    assert list(tmp_path.rglob("*.npz"))
    uqmbd.results.save(tree, tmp_path / "results.nc")
    assert not list(tmp_path.rglob("*.npz"))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Given(uqmbd.extend.Propagator):
    """Somebody else's propagator: a few given points."""

    name = "given"

    def propagate(self, problem):
        values = problem.inputs.means + np.array([[0, 0], [0.01, 0.01]])
        found = problem.realise(values)
        statistics = uqmbd.extend.statistics_dataset(
            problem.labels, mean=found.response.mean(axis=0), std=found.response.std(axis=0)
        )
        return problem.node(self, statistics, realisations=2, wall_time=found.wall_time)


def test_propagator_of_somebody_else(swing):
    node = swing.propagate(Given())
    assert node.name == "given" and isinstance(node, xr.DataTree)
    assert Given().obstacle(swing) is None


def test_problem_checks_inputs(swing):
    problem = swing.problem(Given())
    with pytest.raises(uqmbd.StudyError, match=r"given: inputs have shape \(2, 3\); expected \(realisations, 2\)"):
        problem.realise(np.zeros((2, 3)))


STUDIES = {
    "mechanism": (dict(mechanism="swing"), "the mechanism is 'swing'; expected a uqmbd.Mechanism"),
    "one time": (dict(times=[1.0]), "times have shape (1,); expected a one-dimensional sequence of at least two"),
    "a time": (dict(times=2.0), "times have shape ()"),
    "table of times": (dict(times=[[0, 1], [2, 3]]), "times have shape (2, 2)"),
    "texts": (dict(times=["now", "then"]), "expected numbers in s, e.g. numpy.linspace"),
    "complex": (dict(times=[0, 1j]), "expected numbers in s"),
    "not finite": (dict(times=[0, np.nan, 1]), "times[1] is not finite"),
    "standing": (dict(times=[0, 1, 1]), "times do not increase: times[1] is 1, and times[2] is 1"),
    "falling": (dict(times=[0, 2, 1]), "times do not increase: times[1] is 2, and times[2] is 1"),
    "rtol": (dict(rtol=2), "rtol is 2; expected a number between 1e-13 and 0.1"),
    "rtol text": (dict(rtol="1e-6"), "rtol is '1e-6'"),
    "integrator": (dict(integrator="euler"), "integrator is 'euler'; expected one of: auto, ida, dop853"),
    "name": (dict(name="a/b"), "cannot contain '/'"),
    "class": (dict(propagators=[MonteCarlo]), "propagators contains the class MonteCarlo; expected an object"),
    "text": (dict(propagators="monte-carlo"), "propagators is 'monte-carlo'; expected a list such as"),
    "nothing": (dict(propagators=None), "propagators is None; expected a list"),
    "number": (dict(propagators=[500]), "500 is not a propagator"),
    "twice": (dict(propagators=[MonteCarlo(), MonteCarlo(samples=9)]), "two propagators have the label 'monte-carlo'; give each a different label"),
}  # fmt: skip


@pytest.mark.parametrize(("given", "words"), STUDIES.values(), ids=STUDIES)
def test_what_makes_no_study(given, words):
    arguments = {"name": "s", "mechanism": uqmbd.Mechanism("m", uqmbd.Planar()), "times": TIMES, "propagators": ()}
    with pytest.raises(uqmbd.StudyError, match=re.escape(words)):
        uqmbd.Study(**(arguments | given))


@pytest.mark.parametrize("workers", [0, -1, 1.5, "two", None, True])
def test_workers(swing, workers):
    with pytest.raises(uqmbd.StudyError, match="expected a number of workers, 1 or more, or a concurrent.futures.Ex"):
        swing.run(workers=workers)


def test_study_without_propagators_or_outputs(swing):
    with pytest.raises(uqmbd.StudyError, match="has no propagators; add them"):
        swing.with_propagators([]).run()
    mechanism = uqmbd.Mechanism("m", uqmbd.Planar())
    mechanism.body("b", mass=1, inertia=1)
    with pytest.raises(uqmbd.StudyError, match="mechanism 'm' has no outputs; add one"):
        uqmbd.Study("s", mechanism, TIMES, [MonteCarlo()]).run()


def test_nothing_random_is_an_obstacle_that_can_be_predicted():
    mechanism = uqmbd.Mechanism("m", uqmbd.Planar())
    mechanism.output("x", mechanism.body("b", mass=1, inertia=1).position[0])
    study = uqmbd.Study("s", mechanism, TIMES, [MonteCarlo()])
    assert "no random variables" in study.propagators[0].obstacle(study)
    with pytest.raises(uqmbd.StudyError, match="mechanism 'm' has no random variables; declare a uqmbd.RandomVariable"):
        study.run()


def test_samples_that_cannot_be_assembled_are_counted_named_and_left_out():
    study = uqmbd.Study("s", fragile(highest=5.0), TIMES, [MonteCarlo(samples=100, seed=1)])
    with pytest.warns(UserWarning, match="of 100 realisations failed") as told:
        node = study.run()["monte-carlo"]
    samples = node["samples"]
    length = samples["inputs"].sel(input="length").values
    short = length < 0.9  # two rods from posts 1.8 m apart
    assert 0 < short.sum() < 50
    assert np.array_equal(samples["status"].values == 1, short)
    assert np.isnan(samples["response"].values[short]).all() and np.isfinite(samples["response"].values[~short]).all()
    assert np.isfinite(node["statistics"]["mean"].values).all()
    mean = samples["response"].values[~short].mean(axis=0)
    assert node["statistics"]["mean"].values == pytest.approx(mean)
    (said,) = (str(w.message) for w in told)
    assert said.startswith(f"monte-carlo: {short.sum()} of 100 realisations failed; the statistics are based on the ")
    assert re.search(r"Most frequent reason: .*(left|right)", said)


def test_a_single_failure_is_a_warning():
    """The range of the length is such that of the draws of this seed only the shortest rod does not reach."""
    uniform = np.sort(uniform_samples("random", [40], 1, 1)[:, 0])
    # length = 0.5 + u (highest - 0.5) is below 0.9 for the first of them only
    highest = 0.5 + 0.4 / uniform[:2].mean()
    study = uqmbd.Study("s", fragile(highest=highest), TIMES)
    with pytest.warns(UserWarning, match="monte-carlo: 1 of 40 realisations failed"):
        study.propagate(MonteCarlo(samples=40, seed=1))


def test_too_many_failures_are_an_error_with_the_most_frequent_reason():
    study = uqmbd.Study("s", fragile(highest=1.5), TIMES, [MonteCarlo(samples=40, seed=1, max_failures=0.1)])
    with pytest.raises(uqmbd.IntegrationError) as caught:
        study.run()
    assert re.search(
        r"monte-carlo: \d+ of 40 samples failed, more than the share max_failures = 0.1", str(caught.value)
    )
    assert re.search(r"Most frequent reason: .*(left|right)", str(caught.value))


def test_reasons_are_compared_without_their_numbers():
    empty = np.zeros((4, 1))
    messages = ("", "left: 0.31", "right: 3", "left: 0.29")
    found = uqmbd.extend.Realisations(empty, empty, np.array([0, 1, 1, 1]), messages, {}, 0.0)
    assert found.most_frequent_reason() == "left: 0.31" and found.failures == 3


SCRIPT = """
    import sys
    import chaospy, numpy as np, uqmbd
    from uqmbd_montecarlo import MonteCarlo
    mechanism = uqmbd.Mechanism("fall", uqmbd.Translational(gravity=(0, -9.81)))
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2))
    stone = mechanism.body("stone", mass=1, velocity=(0, speed))
    mechanism.output("height", stone.position[1])
    study = uqmbd.Study("fall", mechanism, np.linspace(0, 1, 3), [MonteCarlo(samples=70, seed=1)])
"""


def run_script(path, ending):
    path.write_text(textwrap.dedent(SCRIPT) + textwrap.dedent(ending))
    return subprocess.run([sys.executable, path], capture_output=True, text=True, check=False, timeout=120)


@pytest.mark.thorough
def test_script_without_a_guard_runs_as_written_and_once(tmp_path):
    """Workers start without the script: what it prints is printed once, and two runs one after another work."""
    ending = """
        print("before")
        for k in (1, 2):
            print(study.run(workers=2)["monte-carlo"].attrs["failures"])
        print("after")
    """
    run = run_script(tmp_path / "unguarded.py", ending)
    assert (run.returncode, run.stderr, run.stdout.split()) == (0, "", ["before", "0", "0", "after"])


@pytest.mark.slow
def test_script_without_a_guard_may_define_what_its_workers_need(tmp_path):
    """A method of the script's own, whose work is sent to workers by its name, and a guard below it; all is said once."""
    ending = """
        import dataclasses
        def work(model, number):
            return {"square": np.array([number * number])}
        @dataclasses.dataclass(frozen=True, kw_only=True)
        class Own(uqmbd.extend.Propagator):
            name = "own"
            def propagate(self, problem):
                found = [float(a["square"][0]) for a in problem.run(work, [(2.0,), (3.0,)])]
                mean = np.full(problem.labels.shape, sum(found))
                statistics = uqmbd.extend.statistics_dataset(problem.labels, mean=mean, std=0 * mean)
                return problem.node(self, statistics, realisations=2, wall_time=0.0)
        study = study.with_propagators([Own()])
        print(float(study.run(workers=2)["own/statistics"]["mean"][0, 0]))
        if __name__ == "__main__":
            print("guarded")
    """
    run = run_script(tmp_path / "unguarded.py", ending)
    assert (run.returncode, run.stdout.split()) == (0, ["13.0", "guarded"]), run.stderr


@pytest.mark.thorough
def test_script_with_a_guard_runs_and_its_workers_ignore_interrupts_and_may_die(tmp_path):
    ending = """
        import os, signal
        def disposition():
            return signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        if __name__ == "__main__":
            from uqmbd.propagation.execution.workers import pool
            print(study.run(workers=2)["monte-carlo"]["samples"].sizes["sample"])
            try:
                with pool(2) as executor:
                    print(executor.submit(disposition).result())
                    executor.submit(os._exit, 3).result()
            except uqmbd.IntegrationError as error:
                print(error)
    """
    run = run_script(tmp_path / "guarded.py", ending)
    samples, ignored, message = run.stdout.splitlines()
    assert (samples, ignored) == ("70", "True"), run.stderr
    assert message.startswith("A worker process ended unexpectedly")


def test_misspelt_option_of_a_method_is_a_study_error_that_suggests():
    with pytest.raises(uqmbd.StudyError, match="MonteCarlo: unknown option 'sample'; did you mean 'samples'"):
        MonteCarlo(sample=100)
    with pytest.raises(uqmbd.StudyError, match=r"unknown option 'x'\. Its options are label, samples, seed"):
        MonteCarlo(x=100)
    one = MonteCarlo(samples=100, seed=2)
    assert pickle.loads(pickle.dumps(one)) == copy.copy(one) == dataclasses.replace(one) == one
    assert list(inspect.signature(MonteCarlo).parameters)[:3] == ["label", "samples", "seed"]


@pytest.mark.thorough
def test_realisations_are_the_same_in_chunks_of_any_size(swing):
    """Of many samples chunks are larger; the bits of each are those that it has among few."""
    problem = swing.problem(swing.propagators[0])
    many = problem.inputs.from_uniform(np.random.default_rng(1).random((16_384, len(problem.inputs))))
    sizes = [len(part.status) for part in problem.stream(many)]
    assert sizes == [512] * 32
    among_many = np.concatenate([part.response for part in problem.stream(many)])[400:600]
    assert same(among_many, problem.realise(many[400:600]).response)
