"""Does a propagator survive what happens to studies: realisations that fail, interruptions, nothing that is random."""

from __future__ import annotations

import dataclasses
import re
import tempfile
from pathlib import Path

import xarray as xr

from uqmbd.errors import StudyError, UqmbdError
from uqmbd.testing.propagators.executors import Interrupter, Interruption, Recorder
from uqmbd.testing.propagators.moments import check_schema, difference
from uqmbd.testing.propagators.subject import Subject, quiet
from uqmbd.testing.solutions import CASES, certain, fragile

__all__ = ["check_failures", "check_nothing_random", "check_resume"]

REMEDY = re.compile(
    r"\b(allow|check|choose|declare|give|increase|leave|raise|reduce|shorten|take|truncate|try|use)s?\b", re.IGNORECASE
)
"""A message that contains none of these words tells nobody what to do."""


def check_failures(subject: Subject) -> None:
    """Lengths below 0.9 m fail: a quarter of them, then all."""
    study, recorder, title = fragile(0.7, 1.5), Recorder(), f"{subject.title}: failures"
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


def _check_account(node: xr.DataTree, recorder: Recorder, told: list[str], title: str) -> None:
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


def check_resume(subject: Subject) -> None:
    """Interrupt a run at its first finished chunk, and go on."""
    study = CASES["pendulum"]().study.with_propagators([subject.given])
    title, whole, rest = f"{subject.title}: resume", Recorder(), Recorder()
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


def check_nothing_random(subject: Subject) -> None:
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
