"""The conformance kit finds what it is there to find: sound methods, each spoilt in one way."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd.extend import statistics_dataset
from uqmbd.progress import Silent as Silently
from uqmbd.testing import check_propagator
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

CALLS = itertools.count()


@dataclass(frozen=True, kw_only=True)
class Collocated(Collocation):
    """A sound method, with statistics and node open to damage."""

    order: int = 4

    def propagate(self, problem):
        node = super().propagate(problem)
        statistics = self.spoilt(node["statistics"].to_dataset())
        return self.wrapped(node.assign(statistics=xr.DataTree(statistics)))

    def spoilt(self, statistics):
        return statistics

    def wrapped(self, node):
        return node


class BiasedMean(Collocated):
    """Every mean is too large by 2 % of the standard deviation."""

    def spoilt(self, statistics):
        return statistics.assign(mean=statistics["mean"] + 0.02 * statistics["std"])


class WrongStd(Collocated):
    """The biased standard deviation of 20 samples."""

    def spoilt(self, statistics):
        factor = np.sqrt(19 / 20)
        return statistics.assign(std=statistics["std"] * factor, variance=statistics["variance"] * factor**2)


class SwappedOutputs(Collocated):
    """Outputs in the order of the alphabet, under the names in the order of the study."""

    def spoilt(self, statistics):
        return statistics.assign(mean=statistics["mean"].copy(data=statistics["mean"].values[::-1]))


class SwappedIndices(Collocated):
    """Sobol' indices of the other input."""

    def spoilt(self, statistics):
        if "sobol_first" not in statistics:
            return statistics
        return statistics.assign(
            sobol_first=statistics["sobol_first"].copy(data=statistics["sobol_first"].values[::-1])
        )


class NotANumber(Collocated):
    """A NaN among the means."""

    def spoilt(self, statistics):
        mean = statistics["mean"].copy(deep=True)
        mean[0, -1] = np.nan
        return statistics.assign(mean=mean)


class Excess(Collocated):
    """The excess in the place of the kurtosis."""

    def spoilt(self, statistics):
        return statistics.assign(kurtosis=statistics["kurtosis"] - 3)


class Renamed(Collocated):
    """Outputs without their blanks."""

    def spoilt(self, statistics):
        return statistics.assign_coords(output=[str(x).replace(" ", "_") for x in statistics["output"].values])

    def wrapped(self, node):
        return node.drop_nodes("chaos")


class Mixed(Collocated):
    """Outputs of one name in the statistics, of another in the chaos."""

    def spoilt(self, statistics):
        return statistics.assign_coords(output=["h", "v", "w"][: len(statistics["output"])])


class Unitless(Collocated):
    """Outputs without their units."""

    def spoilt(self, statistics):
        return statistics.assign_coords(output_units=("output", [""] * len(statistics["output"])))


class LostLabel(Collocated):
    """Always called by its registered name."""

    def propagate(self, problem):
        return super().propagate(replace(problem, label="collocation"))


class Unstorable(Collocated):
    """Holds a Python object."""

    def wrapped(self, node):
        return node.assign({"extra": xr.DataTree(xr.Dataset({"x": ("k", np.array([CALLS]))}))})


class Drifting(Collocated):
    """The second run differs from the first."""

    def spoilt(self, statistics):
        return statistics.assign(mean=statistics["mean"] + 1e-9 * next(CALLS))


class Foreign(Collocated):
    """Other workers, other numbers."""

    def propagate(self, problem):
        return super().propagate(replace(problem, rtol=problem.rtol if problem.runner.executor is None else 1e-5))


class Deaf(MonteCarlo):
    """A seed that is ignored."""

    def propagate(self, problem):
        node = MonteCarlo(samples=self.samples, seed=0).propagate(problem)
        node.attrs["seed"] = self.seed
        return node


class Boastful(MonteCarlo):
    """States a hundredth of its errors."""

    def propagate(self, problem):
        node = super().propagate(problem)
        statistics = node["statistics"].to_dataset()
        errors = {name: statistics[name] / 100 for name in ("std_error_mean", "std_error_std")}
        return node.assign(statistics=xr.DataTree(statistics.assign(errors)))


class Timid(Boastful):
    """States a hundred times its errors."""

    def propagate(self, problem):
        node = MonteCarlo.propagate(self, problem)
        statistics = node["statistics"].to_dataset()
        errors = {name: statistics[name] * 100 for name in ("std_error_mean", "std_error_std")}
        return node.assign(statistics=xr.DataTree(statistics.assign(errors)))


class Hidden(Collocated):
    """Failures are not counted."""

    def wrapped(self, node):
        node.attrs["failures"] = 0
        return node


@dataclass(frozen=True, kw_only=True)
class Plain(uqmbd.extend.Propagator):
    """Monte Carlo by hand, without a thought of what may go wrong: the base of the careless ones."""

    name: ClassVar[str] = "plain"
    samples: int = 80
    seed: int = 0

    def propagate(self, problem):
        uniform = np.random.default_rng(self.seed).random((self.samples, len(problem.inputs)))
        return self.summarised(problem, self.realised(problem, problem.inputs.from_uniform(uniform)))

    def realised(self, problem, values):
        return problem.realise(values)

    def summarised(self, problem, found, attrs=None):
        x = found.response[found.status == 0]
        mean, std = x.mean(axis=0), x.std(axis=0, ddof=1)
        statistics = statistics_dataset(problem.labels, mean=mean, std=std)
        return problem.node(self, statistics, realisations=len(found.status), wall_time=0.0, attrs=attrs)


class Silent(Plain):
    """Counts failures, tells no reason."""

    def summarised(self, problem, found, attrs=None):
        return super().summarised(problem, found, {"failures": found.failures})


class Bare(Plain):
    """Raises what NumPy raises."""

    def summarised(self, problem, found, attrs=None):
        np.linalg.cholesky(np.full((1, 1), -1.0 * found.failures) + np.eye(1))
        return super().summarised(problem, found)


class Curt(Plain):
    """Says that it failed."""

    def summarised(self, problem, found, attrs=None):
        if found.failures:
            raise uqmbd.IntegrationError("left: failed")
        return super().summarised(problem, found)


class Unexplained(Plain):
    """Says what to try, not why."""

    def summarised(self, problem, found, attrs=None):
        if found.failures:
            raise uqmbd.IntegrationError("Truncate the distributions.")
        return super().summarised(problem, found)


class Optimistic(Plain):
    """Keeps the last good value where all fail."""

    def summarised(self, problem, found, attrs=None):
        if found.failures:
            zero = np.zeros(problem.labels.shape)
            statistics = statistics_dataset(problem.labels, mean=zero, std=zero)
            attrs = {"failures": found.failures, "why": found.most_frequent_reason()}
            return problem.node(self, statistics, realisations=len(found.status), wall_time=0.0, attrs=attrs)
        return super().summarised(problem, found)


class Forgetful(Plain):
    """Draws other numbers whenever it is asked to go on."""

    def realised(self, problem, values):
        finished = problem.folder is not None and any((problem.folder / "unfinished").rglob("*.npz"))
        return problem.realise(values + 1e-9 * finished)


class Elsewhere(Plain):
    """Computes without the study's means."""

    def realised(self, problem, values):
        parts = [problem.using(checkpoint=None, executor=None).realise(values[k : k + 1]) for k in range(3)]
        return replace(
            parts[0],
            response=np.concatenate([p.response for p in parts]),
            status=np.concatenate([p.status for p in parts]),
        )


class Interminable(Plain):
    """Lets nothing stop it."""

    def realised(self, problem, values):
        try:
            return problem.realise(values)
        except BaseException:  # noqa: B036
            return problem.using(progress=Silently()).realise(values)


class Thawed(MonteCarlo):
    """A subclass with an option that nobody records, for it is no dataclass."""

    damping = 3


FAULTS = {
    BiasedMean: "moments: the mean of 'rise' at 1 s is .*; the exact value is .*exceeds",
    WrongStd: "moments: the standard deviation of 'rise' at 1 s is .*; the exact value is .*exceeds",
    SwappedOutputs: "moments: the mean of .*exceeds",
    SwappedIndices: "moments: the first-order Sobol' index of input .* is .*; the exact value is ",
    NotANumber: "moments: .*statistics/mean: found a value that is not finite at output height of the stone, time 1.0",
    Excess: "moments: .*statistics/kurtosis: found a value below 1",
    Renamed: r"moments: .* returned a node whose 'mean' is not at the outputs of the problem",
    Mixed: r"moments: .* returned a node whose 'mean' is not at the outputs of the problem",
    Unitless: r"schema: units of outputs are \['', ''\]; expected \['m', 'm/s'\]",
    LostLabel: "label: .* returned a node with the name 'collocation'; .* with the name 'a label, of its own'",
    Unstorable: "storage: .*Python objects",
    Drifting: "reproducibility: the results of two identical runs differ: 'statistics/mean' is .* at output",
    Foreign: "reproducibility: the results depend on the workers: 'statistics/mean' is .* and .* at output angle, time 0.4",
    Hidden: r"failures: \d+ realisations failed, but the attribute 'failures' is 0",
}


def made(kind, **options):
    """Make an object of a class that is to be a dataclass, as propagators are."""
    bare = "__dataclass_params__" not in vars(kind)
    return (dataclass(frozen=True, kw_only=True)(kind) if bare else kind)(**options)


@pytest.mark.thorough
@pytest.mark.parametrize(("kind", "words"), FAULTS.items(), ids=[c.__name__ for c in FAULTS])
def test_faults_of_a_surrogate_are_found(kind, words):
    with pytest.raises(AssertionError, match=words):
        check_propagator(made(kind), moments=["stone"])


SAMPLED = {
    Deaf: "reproducibility: seed=3 and seed=4 give identical results, so the method ignores the seed",
    Boastful: r"moments: the mean of .*exceeds .*the sum of the stated error .* and of 0.01 times the standard deviation",
    Timid: "moments: the stated error of the mean of .* is .*, too large next to the standard deviation",
}


@pytest.mark.parametrize(("kind", "words"), SAMPLED.items(), ids=[c.__name__ for c in SAMPLED])
def test_faults_of_sampling_are_found(kind, words):
    with pytest.raises(AssertionError, match=words):
        check_propagator(made(kind, samples=200, seed=3), moments=["stone"])


CARELESS = {
    Plain: "failures: [0-9]+ realisations failed, but the attribute 'failures' is 0",
    Silent: "failures: [0-9]+ realisations failed, but the method does not report the reason",
    Bare: "failures: where some realisations fail, the method raised LinAlgError: .*expected a uqmbd.UqmbdError",
    Curt: "failures: where some realisations fail, the error message states no remedy: left: failed",
    Unexplained: "failures: where some realisations fail, the error message does not state the reason: 'left'",
    Optimistic: r"failures: the method returned results \(a mean of 0\) although all realisations failed",
}


@pytest.mark.thorough
@pytest.mark.parametrize(("kind", "words"), CARELESS.items(), ids=[c.__name__ for c in CARELESS])
def test_careless_methods_are_found(kind, words):
    with pytest.raises(AssertionError, match=words):
        check_propagator(made(kind), moments=False)


UNSTEADY = {
    Forgetful: "resume: the resumed run computed 3 chunks of realisations, no fewer than the complete run",
    Elsewhere: "resume: the method did not use problem.realise or problem.stream",
    Interminable: "resume: the run continued after an interruption",
    Plain: "study without random inputs: the method returned results",
}


@pytest.mark.thorough
@pytest.mark.parametrize(("kind", "words"), UNSTEADY.items(), ids=[c.__name__ for c in UNSTEADY])
def test_lost_work_is_found(kind, words):
    with pytest.raises(AssertionError, match=words):
        check_propagator(made(kind), moments=False, failures=False)


@pytest.mark.thorough
def test_what_is_left_out_is_not_checked():
    check_propagator(made(Plain), moments=False, failures=False, nothing_random=False)
    check_propagator(made(Elsewhere), moments=False, failures=False, resume=False, nothing_random=False)


@pytest.mark.thorough
def test_obstacle_that_nobody_is_reported_of():
    class Mute(Collocated):
        def obstacle(self, study):
            return None

    with pytest.raises(
        AssertionError, match="study without random inputs: 'propagate' raises an error, but 'obstacle' returns None"
    ):
        check_propagator(made(Mute), moments=False)


def test_class_that_is_no_dataclass():
    with pytest.raises(AssertionError, match="Thawed: options: the class is not a frozen dataclass"):
        check_propagator(Thawed(samples=100))


@pytest.mark.parametrize(
    ("given", "options", "words"),
    [
        (lambda: 3, {}, "returned 3; expected a uqmbd.extend.Propagator"),
        (
            MonteCarlo(),
            {"moments": ["rock"]},
            "the argument 'moments' contains 'rock'; expected some of stone, oscillator, pendulum",
        ),
    ],
)
def test_wrong_use_is_an_error_of_its_own(given, options, words):
    with pytest.raises(uqmbd.StudyError, match=words):
        check_propagator(given, **options)
