"""Reasons why a study cannot be exported, as far as they are known before a run."""

from __future__ import annotations

from typing import Any

from uqmbd import StudyError
from uqmbd.extend import GermSpace
from uqmbd_fmi.surrogate_tables import refusal_of_space

__all__ = ["refusal"]


def refusal(study: Any) -> str:
    """Return why no surrogate of a study can be exported, or an empty text."""
    if not len(study.mechanism.inputs):
        return "the mechanism has no random input, so there is no surrogate."
    reasons = []
    for transform in ("rosenblatt", "nataf"):
        try:
            reasons.append(refusal_of_space(GermSpace.of(study.mechanism.inputs, transform)))
        except StudyError as error:
            reasons.append(str(error))
    return "" if "" in reasons else reasons[0]
