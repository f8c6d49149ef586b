"""How far an aligned chaos must be followed: to its verification points, too."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.extend import AlignedElement, labels
from uqmbd.randomness import GermBox, GermSpace, JointInput
from uqmbd.results import AlignedChaos


def test_what_is_late_counts_verification_points_however_far_out_they_lie():
    """The last landmark is at 12 - 0.5 u s, and the times end at 10 s: at u = 6 it is 1 s too early, at samples never."""
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("u", chaospy.Normal(0, 1))]))
    edges = np.array([[0.0, 12.0], [0.0, -0.5]])
    element = AlignedElement(GermBox.whole(space), ("",), edges, np.zeros((2, 1, 1, 2)), "phase")
    about = ((element,), np.array([[0], [1]]), labels(["x"], ["u"], [0.0, 10.0]))
    # 4.5 of the samples that are farthest out is 0.25 s too early
    assert AlignedChaos(*about).late().max() < 0.5
    known = AlignedChaos(*about, np.array([[0.0], [6.0]]), np.zeros((2, 1, 2)))
    assert known.late().max() == pytest.approx(1.0)
