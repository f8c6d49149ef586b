"""Verification realisations are followed from event to event until one knows an error of an event time."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.extend import AlignedElement, GermBox, GermSpace, VerificationPoints, labels
from uqmbd.randomness import JointInput
from uqmbd.results import AlignedChaos
from uqmbd_collocation.alignment import followed
from uqmbd_collocation.alignment.aligned_elements import with_event_errors


@pytest.mark.parametrize("unknown", [0, 1, 3, 5, 7, 8])
@pytest.mark.parametrize("most", [5000, 14, 10, 8, 1])
def test_realisations_are_followed_until_an_error_is_known(unknown: int, most: int) -> None:
    """In the first ones another event occurs; the number that is followed keeps to the allowed realisations."""
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))]))
    box, nodes = GermBox.whole(space), 12
    points = VerificationPoints.drawn(space, 8, seed=0, stream=1)
    edges = np.array([[0.0, 1.0, 2.0], [0.0, 0.1, 0.0]])
    element = AlignedElement.through(box, ("stop", ""), edges, np.zeros((2, 2, 1, 3)), "events")
    chaos = AlignedChaos((element,), np.array([[0], [1]]), labels(["x"], ["a"], [0.0, 1.5]))
    asked: list[int] = []

    def event_times(values: np.ndarray, sequence: tuple[str, ...]) -> np.ndarray:
        """Return times at which the event occurs 0.25 s late."""
        asked.append(len(values))
        ends = element.table.edges_at(space.evaluate(points.germs[: len(values)], chaos.multi_index))[:, 1:2] + 0.25
        ends[:unknown] = np.nan
        return ends

    source: Any = SimpleNamespace(event_times=event_times)
    found = with_event_errors(chaos, box, source, points, nodes, most - len(points)).elements[0].event_errors
    room = max(most - len(points), 1)
    assert asked[-1] == min(max(unknown + 1, followed(nodes, len(points))), len(points), room)
    assert np.isfinite(found[0]) == (asked[-1] > unknown)
    assert not np.isfinite(found[0]) or 0.05 < found[0] < 1.0
