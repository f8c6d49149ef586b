"""Does a propagator do what a study expects of it: right moments, the same bits, failures counted, nothing lost."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path

from uqmbd.errors import StudyError
from uqmbd.propagation import Propagator
from uqmbd.results import load, save
from uqmbd.testing.propagators.executors import Recorder
from uqmbd.testing.propagators.moments import check_moments, check_schema, difference
from uqmbd.testing.propagators.sizes import check_sizes
from uqmbd.testing.propagators.subject import Subject, quiet
from uqmbd.testing.propagators.survival import check_failures, check_nothing_random, check_resume
from uqmbd.testing.solutions import CASES

__all__ = ["check_propagator"]


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
    subject = Subject.of(propagator)
    wanted = list(CASES) if moments is True else list(moments or ())
    for name in wanted:
        if name not in CASES:
            raise StudyError(f"check_propagator: there is no case {name!r}; there are: {', '.join(CASES)}.")
        _check_case(subject, name, tolerance)
    _check_schema(subject)
    _check_label(subject)
    _check_reproducibility(subject, Recorder() if workers is None else workers, seeds=seeds)
    if failures:
        check_failures(subject)
    if resume:
        check_resume(subject)
    if nothing_random:
        check_nothing_random(subject)
    _check_storage(subject)
    check_sizes(subject)


def _check_case(subject: Subject, name: str, tolerance: float) -> None:
    known, what = CASES[name](), f"{subject.title}: case {name!r}"
    with quiet():
        obstacle = subject.given.obstacle(known.study)
    assert obstacle is None, f"{what}: moments: its method obstacle says: {obstacle!r}; expected None."
    node = subject.node(known.study, "moments")
    check_schema(node, subject.given, known.study, what)
    check_moments(node, known, tolerance, what)


def _check_schema(subject: Subject) -> None:
    study = CASES["pendulum"]().study
    check_schema(subject.node(study, "schema"), subject.given, study, subject.title)


def _check_storage(subject: Subject) -> None:
    node = subject.node(CASES["pendulum"]().study, "storage")
    with tempfile.TemporaryDirectory() as folder:
        with subject.unbroken(CASES["pendulum"]().study, "storage"):
            again = load(save(node, Path(folder) / "node.nc"))
        assert not (found := difference(node, again)), f"{subject.title}: storage: after save and load, {found}."
        attributes = {name: (value, again.attrs.get(name)) for name, value in node.attrs.items()}
    lost = {name: pair for name, pair in attributes.items() if repr(pair[0]) != repr(pair[1])}
    assert not lost, f"{subject.title}: storage: attributes (before, after) save and load: {lost}."


def _check_label(subject: Subject) -> None:
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


def _check_reproducibility(subject: Subject, workers: int | Executor, *, seeds: bool) -> None:
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
