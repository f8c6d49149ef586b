"""Test a propagator against the requirements of studies.

The tests cover correct moments, bit-identical results, counts of failures and realisations, and sizes for runs with a
budget or an accuracy. They also cover failed realisations, interruptions, and studies without random variables.
"""

from __future__ import annotations

import dataclasses
import json
import math
import re
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path

import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError, UqmbdError
from uqmbd.propagation import Propagator
from uqmbd.propagation.methods import run_method
from uqmbd.results import load, save
from uqmbd.testing.propagators.costs import check_costs
from uqmbd.testing.propagators.distributions import check_quantiles, check_samples, check_stated_errors
from uqmbd.testing.propagators.executors import Interrupter, Interruption, RecordingExecutor
from uqmbd.testing.propagators.moments import check_moments, check_schema, difference
from uqmbd.testing.propagators.subject import PropagatorUnderTest, quiet
from uqmbd.testing.solutions import CASES, certain, fragile

__all__ = ["check_propagator"]

REMEDY = re.compile(
    r"\b(allow|check|choose|declare|give|increase|leave|raise|reduce|shorten|take|truncate|try|use)s?\b", re.IGNORECASE
)
"""A message must contain one of these words to name a remedy."""


def check_failures(subject: PropagatorUnderTest) -> None:
    """Check studies in which rods shorter than 0.9 m make realisations fail: a quarter of them, then all."""
    study, recorder, title = fragile(0.7, 1.5), RecordingExecutor(), f"{subject.title}: failures"
    with quiet() as caught:
        try:
            node = run_method(subject.given, study.problem(subject.given, recorder), check=False)
        except Exception as error:
            check_error(error, f"{title}: where some realisations fail", "left")
        else:
            check_schema(node, subject.given, study, title)
            _check_account(node, recorder, [str(w.message) for w in caught], title)
    # the mean of these inputs also fails, so a study cannot be built: use the model of the previous study
    problem = dataclasses.replace(study.problem(subject.given), inputs=fragile(0.6, 0.8).mechanism.inputs)
    with quiet():
        try:
            node = subject.given.propagate(problem)
        except Exception as error:
            check_error(error, f"{title}: where all realisations fail", "left")
        else:
            mean = node.children["statistics"].to_dataset()["mean"].values.ravel()[-1]
            raise AssertionError(
                f"{title}: the method returned results (a mean of {mean:g}) although all realisations failed; "
                "expected a uqmbd.UqmbdError."
            )


def _check_account(node: xr.DataTree, recorder: RecordingExecutor, caught: list[str], title: str) -> None:
    failed, count = len(recorder.reasons), node.attrs["failures"]
    assert count >= failed, (
        f"{title}: {failed} realisations failed, but the attribute 'failures' is {count}; expected at least the "
        "number of failures."
    )
    computed = node.attrs["realisations"]
    assert computed >= recorder.realisations, (
        f"{title}: the method computed {recorder.realisations} realisations, but the attribute "
        f"'realisations' is {computed}."
    )
    texts = [*caught, *(v for v in node.attrs.values() if isinstance(v, str))]
    for part in node.subtree:
        texts += part.to_dataset()["message"].values.tolist() if "message" in part.data_vars else []
    named = not failed or any(reason in text for reason in recorder.reasons for text in texts)
    assert named, (
        f"{title}: {failed} realisations failed, but the method does not report the reason. No variable 'message', "
        f"attribute or warning contains a reason such as {recorder.reasons[0]!r}."
    )


def check_error(error: Exception, what: str, reason: str = "") -> None:
    """Check that an error is an error of uqmbd with the reason (the joint that cannot be closed) and a remedy."""
    assert isinstance(error, UqmbdError), (
        f"{what}, the method raised {type(error).__name__}: {error}; expected a uqmbd.UqmbdError that states a remedy."
    )
    assert reason in str(error), (
        f"{what}, the error message does not state the reason: {reason!r}, the joint that fails, is missing in: {error}"
    )
    assert REMEDY.search(str(error)), f"{what}, the error message states no remedy: {error}"


def check_resume(subject: PropagatorUnderTest) -> None:
    """Interrupt a run at its first finished chunk, and resume it."""
    study = CASES["pendulum"]().study.with_propagators([subject.given])
    title, whole, rest = f"{subject.title}: resume", RecordingExecutor(), RecordingExecutor()
    with subject.unbroken(study, "resume"), quiet():
        undisturbed = study.run(whole).children[subject.given.node_name]
    assert whole.chunks, (
        f"{title}: the method did not use problem.realise or problem.stream, which store finished realisations. If "
        "the method computes realisations differently, pass resume=False."
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with subject.unbroken(study, "resume"), quiet():
            try:
                study.run(progress=Interrupter(), folder=folder)
                stopped = False
            except Interruption:
                stopped = True
        assert stopped, (
            f"{title}: the run continued after an interruption, a BaseException like KeyboardInterrupt. Do not catch "
            "BaseException."
        )
        with subject.unbroken(study, "resume"), quiet():
            resumed = study.run(rest, folder=folder, resume=True).children[subject.given.node_name]
    assert rest.chunks < whole.chunks, (
        f"{title}: the resumed run computed {rest.chunks} chunks of realisations, no fewer than the complete run "
        f"({whole.chunks}): finished realisations were not reused. Make the inputs depend only on the seed."
    )
    found = difference(undisturbed, resumed)
    assert not found, f"{title}: the results of a resumed and of an uninterrupted run differ: {found}."
    for attribute in ("realisations", "failures"):
        one, two = undisturbed.attrs[attribute], resumed.attrs[attribute]
        assert one == two, (
            f"{title}: the attribute {attribute!r} is {two} after a resumed run, but {one} after an uninterrupted run."
        )


def check_nothing_random(subject: PropagatorUnderTest) -> None:
    """Expect an error with advice, and the same error from `uqmbd check`."""
    study, title = certain(), f"{subject.title}: study without random inputs"
    with quiet():
        try:
            subject.given.propagate(study.problem(subject.given))
        except StudyError as error:
            check_error(error, title)
        except Exception as error:
            raise AssertionError(
                f"{title}: the method raised {type(error).__name__}: {error}; expected a uqmbd.StudyError."
            ) from error
        else:
            raise AssertionError(
                f"{title}: the method returned results; raise a uqmbd.StudyError. If the method can compute results "
                "without random inputs, pass nothing_random=False."
            )
        obstacle = subject.given.obstacle(study)
    assert obstacle, (
        f"{title}: 'propagate' raises an error, but 'obstacle' returns {obstacle!r}; expected a "
        "sentence that states the reason."
    )


ACCURACY = 0.3
"""Requested accuracy: coarse, so that the cost is low."""


def check_sizes(subject: PropagatorUnderTest) -> None:
    """Check that larger sizes cost more, that options set sizes, and that a chosen size gives the same bits again."""
    study, given, title = CASES["stone"]().study, subject.given, f"{subject.title}: sizes"
    with subject.unbroken(study, "sizes"), quiet():
        sizing = given.sizing(study, ACCURACY)
    if sizing is None:
        return
    assert hasattr(given, sizing.option), (
        f"{title}: 'sizing' refers to the option {sizing.option!r}, which the method does not have."
    )
    sizes = sorted({sizing.largest(number) for number in (0, sizing.least, 2 * sizing.least, 5 * sizing.least)})
    assert sizes[0] == sizing.least, (
        f"{title}: the smallest size is declared as {sizing.least}, but 'largest' returns the smaller size {sizes[0]}."
    )
    costs = []
    for size in sizes:
        with subject.unbroken(study, "sizes"), quiet():
            made = sizing.at(size)
            estimate = made.estimate(study)
        assert getattr(made, sizing.option) == size, (
            f"{title}: at({size}) returns a method with "
            f"{sizing.option}={getattr(made, sizing.option)!r}; expected {size}."
        )
        assert made.node_name == given.node_name, (
            f"{title}: at({size}) returns a method with the name {made.node_name!r}; expected the name "
            "of the given method."
        )
        costs.append(math.nan if estimate is None else estimate.realisations)
    assert not any(math.isnan(cost) for cost in costs), (
        f"{title}: 'estimate' returns None; expected the number of realisations of each size, which a budget needs."
    )
    assert costs == sorted(costs), (
        f"{title}: the sizes {sizes} need {costs} realisations; expected numbers that do not decrease with the size."
    )
    with subject.unbroken(study, "sizes"), quiet():
        tree = study.with_propagators([given]).run(accuracy=ACCURACY, budget=max(20 * int(costs[-1]), 5000))
    about = json.loads(tree.attrs["budget"])["methods"][given.node_name]
    if sizing.of == "moments":
        assert about["stated"] is not None, (
            f"{title}: the method states no error, so the run cannot verify the requested accuracy."
        )
    with subject.unbroken(study, "sizes"), quiet():
        again = study.propagate(sizing.at(about["size"]))
    found = difference(tree.children[given.node_name], again)
    assert not found, f"{title}: a second run with the chosen size {about['size']} gives different results: {found}."


@typechecked(values=False)
def check_propagator(
    propagator: Propagator | Callable[..., Propagator],
    *,
    tolerance: float = 0.01,
    moments: bool | Sequence[str] = True,
    seeds: bool = True,
    failures: bool = True,
    resume: bool = True,
    nothing_random: bool = True,
    workers: int | Executor | None = None,
) -> None:
    """Check a propagator on small mechanisms with known solutions.

    - *schema*: the node conforms to `uqmbd.results.validate`; outputs, inputs, units, times, options, seed are correct.
    - *moments*: the errors of mean and standard deviation of a thrown stone, an oscillator and a pendulum are within
      the stated errors and a tolerance. The same limit applies to first-order Sobol' indices, if any.
    - *quantiles*: quantiles agree with the exact distribution, within the errors of their samples.
    - *samples*: stored samples are draws from the joint distribution, and responses belong to their inputs.
    - *stated errors*: stated errors are not smaller than the true errors. A surrogate is compared with the exact
      outputs at realisations that it does not use.
    - *costs*: stated and predicted numbers of realisations agree with the computed number.
    - *storage*: the node is unchanged after a round trip through netCDF.
    - *label*: the label is the name of the node in the result of a study; the default is the registered name.
    - *reproducibility*: the same object gives the same bits, also with other workers; another seed gives other bits.
    - *failures*: realisations that cannot be assembled are counted with their reason, or there is an error with a
      remedy. Statistics contain no NaN. If all realisations fail, there is an error.
    - *resume*: an interrupted run continues with finished realisations, to the same bits.
    - *sizes*: larger sizes (`uqmbd.extend.Propagator.sizing`), if any, cost more. A size that an accuracy has chosen
      gives the same bits without the accuracy.
    - *nothing random*: a study without random variables is a `uqmbd.StudyError` with a remedy.

    Parameters
    ----------
    propagator : Propagator, or callable that returns one
        Method with sufficient options for the smooth test cases. A callable receives ``label=`` and ``seed=`` if a
        check changes these: ``functools.partial(MonteCarlo, samples=500)``.
    tolerance : float
        Allowed error of the moments in addition to stated errors, relative to the largest standard deviation of an
        output over time.
    moments : bool or sequence of {"stone", "oscillator", "pendulum"}
        Whether to compare moments, or cases of the comparison. The stone is linear in two inputs; the oscillator is a
        cosine of one input over 0.3 of its turns; the pendulum has two inputs and an angle as output.
    seeds : bool
        False for a method with a field ``seed`` that has no effect with these options.
    failures : bool
        False for a method that need not tolerate failed realisations.
    resume : bool
        False for a method that does not use `uqmbd.extend.Problem.realise` or `uqmbd.extend.Problem.stream`.
    nothing_random : bool
        False for a method that gives a result without random inputs.
    workers : int or concurrent.futures.Executor, optional
        Workers with results that must agree bit for bit with this process. Default: an executor that computes here, on
        pickled copies.

    Raises
    ------
    AssertionError
        If a property is violated; the message states the property, the case and the numbers.
    uqmbd.StudyError
        If the argument is not a propagator.

    Examples
    --------
    >>> from uqmbd.testing import check_propagator
    >>> from uqmbd_collocation import Collocation
    >>> check_propagator(Collocation(order=4))
    """
    subject = PropagatorUnderTest.of(propagator)
    wanted = list(CASES) if moments is True else list(moments or ())
    for name in wanted:
        if name not in CASES:
            raise StudyError(
                f"check_propagator: the argument 'moments' contains {name!r}; expected some of {', '.join(CASES)}."
            )
        _check_case(subject, name, tolerance)
    _check_schema(subject)
    check_costs(subject)
    _check_label(subject)
    _check_reproducibility(subject, RecordingExecutor() if workers is None else workers, seeds=seeds)
    if failures:
        check_failures(subject)
    if resume:
        check_resume(subject)
    if nothing_random:
        check_nothing_random(subject)
    _check_storage(subject)
    check_sizes(subject)


def _check_case(subject: PropagatorUnderTest, name: str, tolerance: float) -> None:
    known, what = CASES[name](), f"{subject.title}: case {name!r}"
    with quiet():
        obstacle = subject.given.obstacle(known.study)
    assert obstacle is None, f"{what}: moments: 'obstacle' returns {obstacle!r}; expected None."
    node = subject.node(known.study, "moments")
    check_schema(node, subject.given, known.study, what)
    check_moments(node, known, tolerance, what)
    check_stated_errors(node, known, what)
    check_quantiles(node, known, tolerance, what)
    check_samples(node, known, what)


def _check_schema(subject: PropagatorUnderTest) -> None:
    study = CASES["pendulum"]().study
    check_schema(subject.node(study, "schema"), subject.given, study, subject.title)


def _check_storage(subject: PropagatorUnderTest) -> None:
    node = subject.node(CASES["pendulum"]().study, "storage")
    with tempfile.TemporaryDirectory() as folder:
        with subject.unbroken(CASES["pendulum"]().study, "storage"):
            again = load(save(node, Path(folder) / "node.nc"))
        assert not (found := difference(node, again)), (
            f"{subject.title}: storage: saving and loading changes the result: {found}."
        )
        attributes = {name: (value, again.attrs.get(name)) for name, value in node.attrs.items()}
    lost = {name: pair for name, pair in attributes.items() if repr(pair[0]) != repr(pair[1])}
    assert not lost, f"{subject.title}: storage: attributes (before, after) save and load: {lost}."


def _check_label(subject: PropagatorUnderTest) -> None:
    study = CASES["stone"]().study
    for given, expected in (("a label, of its own", "a label, of its own"), (None, subject.given.name)):
        propagator = subject.make(label=given)
        with subject.unbroken(study, "label"), quiet():
            tree = study.with_propagators([propagator]).run()
        nodes = sorted(set(tree.children) - {"comparison"})
        found = [nodes, *(tree[n].attrs.get("label") for n in nodes)]
        assert found == [[expected], expected], (
            f"{subject.title}: label: with label={given!r} the results are in the nodes {nodes}, with the attribute "
            f"'label' {found[1:]}; expected {expected!r}."
        )


def _check_reproducibility(subject: PropagatorUnderTest, workers: int | Executor, *, seeds: bool) -> None:
    study = CASES["pendulum"]().study
    first = subject.node(study, "reproducibility")
    found = difference(first, subject.node(study, "reproducibility", again=True))
    assert not found, f"{subject.title}: reproducibility: the results of two identical runs differ: {found}."
    found = difference(first, subject.node(study, "reproducibility", workers))
    assert not found, f"{subject.title}: reproducibility: the results depend on the workers: {found}."
    seed = getattr(subject.given, "seed", None)
    if seeds and seed is not None:
        other = subject.node(study, "reproducibility", seed=seed + 1)
        assert difference(first, other), (
            f"{subject.title}: reproducibility: seed={seed} and seed={seed + 1} give identical results, so the "
            "method ignores the seed. If the method is deterministic with these options, pass seeds=False."
        )
