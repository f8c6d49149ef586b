"""An alignment that a mechanism does not allow: the reason, and advice if it was requested by name."""

from __future__ import annotations

from typing import Any

import uqmbd

__all__ = ["EndsEarlyWarning", "Impossible", "without_clock"]


class EndsEarlyWarning(UserWarning):
    """Samples of a surrogate do not reach the last output time."""


class Impossible(uqmbd.StudyError):
    """A family that is impossible; where it is one of several, the message has the reason alone."""

    def __init__(self, label: str, reason: str, advice: str) -> None:
        super().__init__(f"{label}: {reason}. {advice}")
        self.parts = label, reason, advice

    @property
    def reason(self) -> str:
        """Why, without advice."""
        return self.parts[1]

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self.parts


def without_clock(problem: uqmbd.extend.Problem, why: str) -> Impossible:
    """Return the error of phases where there is no clock."""
    if problem.model.events:
        return Impossible(
            problem.label,
            f"alignment='phase' needs a clock that no event resets, as impacts do; there is none: {why}",
            "Take alignment='events', which compares motions between events, or alignment='auto', which takes "
            "what follows each output best; or leave alignment out.",
        )
    return Impossible(
        problem.label,
        f"alignment='phase' needs a clock, and there is none: {why}",
        "Observe an angle that grows, name it by clock=, or leave alignment out.",
    )
