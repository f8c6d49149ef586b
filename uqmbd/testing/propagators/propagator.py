"""Does a propagator do what a study expects of it: right moments, the same bits, failures counted, nothing lost.

Sizes of a method: what a run with a budget or an accuracy relies on.

Does a propagator survive what happens to studies: realisations that fail, interruptions, nothing that is random.
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

from uqmbd.errors import StudyError, UqmbdError
from uqmbd.propagation import Propagator
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
"""A message that contains none of these words tells nobody what to do."""


def check_failures(subject: PropagatorUnderTest) -> None:
    """Lengths below 0.9 m fail: a quarter of them, then all."""
    study, recorder, title = fragile(0.7, 1.5), RecordingExecutor(), f"{subject.title}: failures"
    with quiet() as told:
        try:
            node = study.propagate(subject.given, recorder)
        except Exception as error:
            check_error(error, f"{title}: where some realisations fail", "left")
        else:
            check_schema(node, subject.given, study, title)
            _check_account(node, recorder, [str(w.message) for w in told], title)
    # the mean of these inputs fails as well, with which a study does not begin: the model comes from the one above
    problem = dataclasses.replace(study.problem(subject.given), inputs=fragile(0.6, 0.8).mechanism.inputs)
    with quiet():
        try:
            node = subject.given.propagate(problem)
        except Exception as error:
            check_error(error, f"{title}: where all realisations fail", "left")
        else:
            mean = node.children["statistics"].to_dataset()["mean"].values.ravel()[-1]
            raise AssertionError(f"{title}: all realisations fail, and yet there are results: a mean of {mean:g}.")


def _check_account(node: xr.DataTree, recorder: RecordingExecutor, told: list[str], title: str) -> None:
    failed, count = len(recorder.reasons), node.attrs["failures"]
    assert count >= failed, f"{title}: {failed} realisations failed; the attribute 'failures' is {count}."
    computed = node.attrs["realisations"]
    assert computed >= recorder.realisations, (
        f"{title}: {recorder.realisations} realisations were computed; the attribute 'realisations' is {computed}."
    )
    texts = [*told, *(v for v in node.attrs.values() if isinstance(v, str))]
    for part in node.subtree:
        texts += part.to_dataset()["message"].values.tolist() if "message" in part.data_vars else []
    named = not failed or any(reason in text for reason in recorder.reasons for text in texts)
    assert named, (
        f"{title}: {failed} realisations failed, and nothing says why: neither a variable 'message', nor an attribute, "
        f"nor a warning contains a reason such as {recorder.reasons[0]!r}."
    )


def check_error(error: Exception, what: str, reason: str = "") -> None:
    """Check that an error is one of ours, names the reason (the joint that cannot be closed), and a remedy."""
    assert isinstance(error, UqmbdError), (
        f"{what}, it raised {type(error).__name__}: {error}; expected a uqmbd.UqmbdError that says what to try."
    )
    assert reason in str(error), f"{what}, the error does not say why: no {reason!r} (the joint that fails) in: {error}"
    assert REMEDY.search(str(error)), f"{what}, the error says nothing about what to try: {error}"


def check_resume(subject: PropagatorUnderTest) -> None:
    """Interrupt a run at its first finished chunk, and go on."""
    study = CASES["pendulum"]().study.with_propagators([subject.given])
    title, whole, rest = f"{subject.title}: resume", RecordingExecutor(), RecordingExecutor()
    with subject.unbroken(study, "resume"), quiet():
        undisturbed = study.run(whole).children[subject.given.node_name]
    assert whole.chunks, (
        f"{title}: it computed nothing through problem.realise or problem.stream, which keep what is finished; if it "
        "computes in another way, say so: resume=False."
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with subject.unbroken(study, "resume"), quiet():
            try:
                study.run(progress=Interrupter(), folder=folder)
                stopped = False
            except Interruption:
                stopped = True
        assert stopped, f"{title}: the run went on after an interruption, which is a BaseException as that of Ctrl-C."
        with subject.unbroken(study, "resume"), quiet():
            resumed = study.run(rest, folder=folder, resume=True).children[subject.given.node_name]
    assert rest.chunks < whole.chunks, (
        f"{title}: the resumed run computed {rest.chunks} chunks of realisations, as the whole one does "
        f"({whole.chunks}): what was finished is lost. Do inputs depend on more than the seed?"
    )
    found = difference(undisturbed, resumed)
    assert not found, f"{title}: the resumed run gives other results than an undisturbed one: {found}."
    for attribute in ("realisations", "failures"):
        one, two = undisturbed.attrs[attribute], resumed.attrs[attribute]
        assert one == two, (
            f"{title}: attribute {attribute!r} is {two} after a resumed run, {one} after an undisturbed one."
        )


def check_nothing_random(subject: PropagatorUnderTest) -> None:
    """Expect an error that says what to do, and the same from `uqmbd check`."""
    study, title = certain(), f"{subject.title}: nothing random"
    with quiet():
        try:
            subject.given.propagate(study.problem(subject.given))
        except StudyError as error:
            check_error(error, title)
        except Exception as error:
            raise AssertionError(
                f"{title}: it raised {type(error).__name__}: {error}; expected a StudyError."
            ) from error
        else:
            raise AssertionError(
                f"{title}: there are results though nothing is random; raise a uqmbd.StudyError that says so. If the "
                "method has an answer there, say so: nothing_random=False."
            )
        obstacle = subject.given.obstacle(study)
    assert obstacle, (
        f"{title}: it raises an error, but its method obstacle returns {obstacle!r}; expected a sentence that says why."
    )


ACCURACY = 0.3
"""That is asked for: coarse, so that it costs little."""


def check_sizes(subject: PropagatorUnderTest) -> None:
    """Check that larger sizes take more, that options say them, and that a chosen one gives the same bits again."""
    study, given, title = CASES["stone"]().study, subject.given, f"{subject.title}: sizes"
    with subject.unbroken(study, "sizes"), quiet():
        sizing = given.sizing(study, ACCURACY)
    if sizing is None:
        return
    assert hasattr(given, sizing.option), (
        f"{title}: its sizing names the option {sizing.option!r}, which it does not have."
    )
    sizes = sorted({sizing.largest(number) for number in (0, sizing.least, 2 * sizing.least, 5 * sizing.least)})
    assert sizes[0] == sizing.least, (
        f"{title}: the least size is {sizing.least}, and there is a smaller one, {sizes[0]}."
    )
    costs = []
    for size in sizes:
        with subject.unbroken(study, "sizes"), quiet():
            made = sizing.at(size)
            estimate = made.estimate(study)
        assert getattr(made, sizing.option) == size, (
            f"{title}: at({size}) has {sizing.option}={getattr(made, sizing.option)!r}; expected {size}."
        )
        assert made.node_name == given.node_name, f"{title}: at({size}) is called {made.node_name!r}."
        costs.append(math.nan if estimate is None else estimate.realisations)
    assert not any(math.isnan(cost) for cost in costs), f"{title}: estimate is None; a budget needs what a size takes."
    assert costs == sorted(costs), f"{title}: sizes {sizes} take {costs} realisations; a larger one took less."
    with subject.unbroken(study, "sizes"), quiet():
        tree = study.with_propagators([given]).run(accuracy=ACCURACY, budget=max(20 * int(costs[-1]), 5000))
    about = json.loads(tree.attrs["budget"])["methods"][given.node_name]
    if sizing.of == "moments":
        assert about["stated"] is not None, f"{title}: no error is stated, so that no accuracy is ever reached."
    with subject.unbroken(study, "sizes"), quiet():
        again = study.propagate(sizing.at(about["size"]))
    found = difference(tree.children[given.node_name], again)
    assert not found, f"{title}: the chosen size {about['size']} gives other results when it is run again: {found}."


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
    """Check a propagator on small mechanisms whose answers are known.

    - *schema*: the node keeps to `uqmbd.results.validate`; outputs, inputs, units, times, options, seed are as given.
    - *moments*: mean and standard deviation of a thrown stone, an oscillator and a pendulum are right within errors
      that the method itself states and a tolerance; so are first-order Sobol' indices, where there are any.
    - *quantiles*: they are those of the exact distribution, within the errors of their samples.
    - *samples*: stored samples are draws of the joint distribution, and responses those of their inputs.
    - *stated errors*: errors that the method states are not smaller than the true ones. A surrogate is compared with
      the exact outputs at realisations that it has not seen.
    - *costs*: stated and predicted realisations are those that are computed.
    - *storage*: the node is the same after a round trip through netCDF.
    - *label*: it names the node and its place in the result of a study; by default the registered name does.
    - *reproducibility*: the same object gives the same bits, and with other workers, too; another seed gives others.
    - *failures*: realisations that cannot be assembled are counted with their reason, or there is an error with
      a remedy; statistics hold no NaN. Where all fail, there is an error.
    - *resume*: a run that was interrupted goes on with what is finished, to the same bits.
    - *sizes*: where it has some (`uqmbd.extend.Propagator.sizing`), larger ones take more, and one that an accuracy has
      chosen gives the same bits without one.
    - *nothing random*: a study without random variables is a `uqmbd.StudyError` with a remedy.

    Parameters
    ----------
    propagator : Propagator, or callable that returns one
        A method with options that suffice for the cases, which are as smooth as mechanisms are. A callable is given
        ``label=`` and ``seed=`` where a check changes these: ``functools.partial(MonteCarlo, samples=500)``.
    tolerance : float
        Error of the moments that is allowed beside the stated ones, relative to the largest standard deviation of an
        output over time.
    moments : bool or sequence of {"stone", "oscillator", "pendulum"}
        Whether, or for which cases, moments are compared. The stone is linear in two inputs; the oscillator is a
        cosine of one input over 0.3 of its turns; the pendulum has two inputs and an output that is an angle.
    seeds : bool
        False for a method that has a field ``seed`` which, with these options, changes nothing.
    failures : bool
        False for a method that need not survive realisations that fail.
    resume : bool
        False for a method that computes nothing through `uqmbd.extend.Problem.realise` or
        `uqmbd.extend.Problem.stream`.
    nothing_random : bool
        False for a method that has an answer where nothing is random.
    workers : int or concurrent.futures.Executor, optional
        Whose bits are compared with those of this process; default an executor that computes here, on pickled copies.

    Raises
    ------
    AssertionError
        If a property is broken; the message names it, with the case and the numbers.
    uqmbd.StudyError
        If what is given is no propagator.

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
            raise StudyError(f"check_propagator: there is no case {name!r}; there are: {', '.join(CASES)}.")
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
    assert obstacle is None, f"{what}: moments: its method obstacle says: {obstacle!r}; expected None."
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
        assert not (found := difference(node, again)), f"{subject.title}: storage: after save and load, {found}."
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
            f"{subject.title}: label: with label={given!r} the results are called {nodes}, with the attribute 'label' "
            f"{found[1:]}; expected {expected!r}."
        )


def _check_reproducibility(subject: PropagatorUnderTest, workers: int | Executor, *, seeds: bool) -> None:
    study = CASES["pendulum"]().study
    first = subject.node(study, "reproducibility")
    found = difference(first, subject.node(study, "reproducibility", again=True))
    assert not found, f"{subject.title}: reproducibility: the second run gives other results than the first: {found}."
    found = difference(first, subject.node(study, "reproducibility", workers))
    assert not found, f"{subject.title}: reproducibility: other workers give other results: {found}."
    seed = getattr(subject.given, "seed", None)
    if seeds and seed is not None:
        other = subject.node(study, "reproducibility", seed=seed + 1)
        assert difference(first, other), (
            f"{subject.title}: reproducibility: seed={seed} and seed={seed + 1} give the same bits: the seed is "
            "ignored; if there is nothing random in the method with these options, say so: seeds=False."
        )
