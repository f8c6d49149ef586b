"""Error for an impossible alignment: the reason, and advice if an option names the alignment."""

from __future__ import annotations

from typing import Any

import uqmbd

__all__ = ["EndsEarlyWarning", "Impossible", "without_clock"]


class EndsEarlyWarning(UserWarning):
    """Warning if samples of a surrogate do not reach the last output time."""


class Impossible(uqmbd.StudyError):
    """Error if a family is impossible; if several families are tried, the message contains only the reason."""

    def __init__(self, label: str, reason: str, advice: str) -> None:
        super().__init__(f"{label}: {reason}. {advice}")
        self.parts = label, reason, advice

    @property
    def reason(self) -> str:
        """Reason, without advice."""
        return self.parts[1]

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self.parts


def without_clock(problem: uqmbd.extend.Problem, why: str) -> Impossible:
    """Return the error for alignment by phases without a clock."""
    if problem.model.events:
        return Impossible(
            problem.label,
            "alignment='phase' needs a clock that no event (such as an impact) resets, but the mechanism has none: "
            f"{why}",
            "Use alignment='events', which compares motions between events, alignment='auto', which selects the "
            "best family for each output, or alignment=None.",
        )
    return Impossible(
        problem.label,
        f"alignment='phase' needs a clock, but there is none: {why}",
        "Observe a growing angle, select it with clock=, or use alignment=None.",
    )
