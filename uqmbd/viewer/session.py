"""Answers to the requests of the viewer's page, computed from one mechanism."""

from __future__ import annotations

import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uqmbd.errors import StudyError, UqmbdError
from uqmbd.isolation import reason_of
from uqmbd.viewer.messages import Answer
from uqmbd.viewer.scene import motion_scene, pose_scene, structure

if TYPE_CHECKING:
    from uqmbd.mechanism import Mechanism
    from uqmbd.propagation import Study

__all__ = ["Session", "failure", "loaded"]

FRAMES = 90
"""Number of frames of a motion."""


class Session:
    """A mechanism and, unless it is None, the study that contains the mechanism."""

    def __init__(self, mechanism: Mechanism, study: Study | None) -> None:
        self.mechanism = mechanism
        self.study = study
        self.time = 0.0 if study is None or not len(study.times) else float(study.times[0])

    def opening(self) -> Iterator[Answer]:
        """Yield the scene at the means, then the findings, which take longer."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the findings contain these warnings
            parts = structure(self.mechanism, self.study)
        yield {"kind": "scene", **parts, **self._pose({})}
        yield {"kind": "findings", **self._findings()}

    def answer(self, request: Mapping[str, Any]) -> Answer:
        """Answer a request for a ``pose`` or ``motion`` at ``values`` of the inputs; the message may state an error."""
        values = {str(name): float(x) for name, x in dict(request.get("values") or {}).items()}
        number = {"number": request.get("number")}
        actions: dict[str, Callable[[Mapping[str, float]], Answer]] = {"pose": self._pose, "motion": self._motion}
        action = str(request.get("do"))
        try:
            if action not in actions:
                raise StudyError(f"the request {action!r} is unknown; expected pose or motion.")
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the findings contain these warnings
                return {"kind": action, **actions[action](values), **number}
        except Exception as error:  # noqa: BLE001 - laws of users run here
            return {**failure(error, None), **number, "kind": "refused", "of": action}

    def _pose(self, values: Mapping[str, float]) -> Answer:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the findings contain these warnings
            return pose_scene(self.mechanism, values, self.time)

    def _motion(self, values: Mapping[str, float]) -> Answer:
        from uqmbd.report.mechanisms import motion_at

        if self.study is None or len(self.study.times) < 2:
            raise StudyError("There are no times to simulate; define a study with at least two output times.")
        return motion_scene(self.mechanism, motion_at(self.study, values, FRAMES))

    def _findings(self) -> Answer:
        """Return findings of the study, and mobility and redundant constraints of the mechanism; or the problem."""
        from uqmbd.dynamics import check
        from uqmbd.propagation import findings

        found: Answer = {"findings": [], "redundant": [], "mobility": None, "problem": ""}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                facts = check(self.mechanism, self.time)
                found["redundant"] = list(facts.redundant)
                found["mobility"] = facts.mobility
                if self.study is not None:
                    listed = findings(self.study)
                    found["findings"] = [
                        {"severity": one.severity.value, "place": one.place, "text": f"{one.text}."} for one in listed
                    ]
            except UqmbdError as error:
                found["problem"] = str(error)
            except Exception as error:  # noqa: BLE001 - laws of users run here
                found["problem"] = reason_of(error)
        return found


def loaded(file: Path) -> Session:
    """Run a study script, and return the session of its mechanism."""
    from uqmbd.propagation import load_mechanism

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the findings contain these warnings
        mechanism, study = load_mechanism(file)
    if not mechanism.bodies:
        raise StudyError(f"mechanism {mechanism.name!r} has no bodies to draw; add one with mechanism.body(...).")
    return Session(mechanism, study)


def failure(error: BaseException, file: Path | None) -> Answer:
    """Return an error as a message, with the line of the script in which it occurred, or None if unknown."""
    cause = error.__cause__ if isinstance(error, StudyError) and error.__cause__ is not None else error
    line = None
    if file is not None:
        name = str(file.resolve())
        if isinstance(cause, SyntaxError) and cause.filename == name:
            line = cause.lineno
        else:
            lines = [x.lineno for x in traceback.extract_tb(cause.__traceback__) if x.filename == name]
            line = lines[-1] if lines else None
    return {"kind": "error", "message": reason_of(error), "line": line}
