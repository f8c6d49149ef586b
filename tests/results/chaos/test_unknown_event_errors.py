"""An unknown error of an event time is not zero: it counts as the largest that is known of its element."""

from __future__ import annotations

from dataclasses import replace

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.extend import AlignedElement, GermBox, GermSpace, labels
from uqmbd.randomness import JointInput
from uqmbd.results import AlignedChaos

TERMS = np.array([[0], [1]])


def surrogate(errors: tuple[float, ...]) -> AlignedChaos:
    """Return an output that jumps at two events, whose times have these errors; three verification realisations."""
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))]))
    values, edges = np.zeros((2, 3, 1, 3)), np.zeros((2, 4))
    values[0, 1] = 1.0
    edges[0], edges[1, 1:3] = (0.0, 1.0, 2.0, 3.0), 0.2
    element = AlignedElement.through(GermBox.whole(space), ("on", "off", ""), edges, values, "events")
    element = replace(element, event_errors=errors)
    germs = np.array([[-0.5], [0.1], [0.6]])
    axes = labels(["x"], ["a"], np.linspace(0, 3, 31))
    plain = AlignedChaos((element,), TERMS, axes)
    return AlignedChaos((element,), TERMS, axes, germs, plain.evaluate_germs(germs))


@pytest.mark.parametrize("error", [0.01, 0.05])
def test_an_unknown_error_counts_as_the_largest_known_one(error: float) -> None:
    nan = float("nan")
    known = surrogate((error, error, nan)).verification_rms()
    for errors in ((error, nan, nan), (nan, error, nan)):
        np.testing.assert_array_equal(surrogate(errors).verification_rms(), known)
    assert (known[0] > 0).sum() > 6


def test_where_no_error_is_known_that_of_the_layer_is_unknown() -> None:
    """It is not zero: the stated error is unknown where an event may occur, and as before elsewhere."""
    nan = float("nan")
    found, exact = (surrogate(errors).verification_rms()[0] for errors in ((nan, nan, nan), (0.0, 0.0, 0.0)))
    times = np.linspace(0, 3, 31)
    # events are at 1 + 0.2 psi and 2 + 0.2 psi, where psi is at most the root of 3
    layers = np.minimum(abs(times - 1), abs(times - 2)) < 0.2 * np.sqrt(3)
    far = np.minimum(abs(times - 1), abs(times - 2)) > 0.25 * np.sqrt(3)
    assert np.isnan(found[layers]).all() and layers.sum() > 10
    np.testing.assert_array_equal(found[far], exact[far])


def test_an_output_that_does_not_jump_has_no_layer() -> None:
    nan = float("nan")
    chaos = surrogate((nan, nan, nan))
    (element,) = chaos.elements
    smooth = replace(chaos, elements=(replace(element, segments=np.ones_like(element.segments) * 0.0),))
    assert not smooth.verification_rms()[:, :5].any() and np.isfinite(smooth.verification_rms()).all()


def test_an_exception_does_not_leave_a_part_of_the_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """The error is that of all layers when it is asked for again."""
    chaos, expected = surrogate((0.05, 0.05, 0.0)), surrogate((0.05, 0.05, 0.0)).verification_rms()
    with monkeypatch.context() as patch:
        patch.setattr("uqmbd.results.chaos.segments.spread_germs", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            chaos.verification_rms()
    np.testing.assert_array_equal(chaos.verification_rms(), expected)
