"""One container for every kind of surrogate: its readout, its datasets, and a choice of outputs and times."""

from __future__ import annotations

import numpy as np
import pytest

import uqmbd
from uqmbd.results import propagator_node, surrogate

from ...report.live.chaoses import KINDS, boxes_of, chaos_of, space_of

NAMES = {"polynomial": "chaos", "elements": "chaos", "events": "aligned", "waves": "quasi_periodic"}


@pytest.fixture(params=KINDS)
def chaos(request):
    space = space_of(["uniform", "normal"])
    return request.param, chaos_of(request.param, space, boxes_of(space, [(0, 0), (1, 1)]), 2, 5)


def germs_of(chaos, count=40):
    return chaos.space.from_uniform(np.random.default_rng(2).random((count, chaos.space.dimension)))


def test_stored_and_read_again_it_is_the_same_to_the_bit(chaos):
    """Through the node of a method, as its readout names the dataset."""
    kind, made = chaos
    assert made.readout.name == NAMES.get(kind, "composed")
    node = propagator_node(
        "mine", made.statistics(), propagator="p", realisations=1, wall_time=0.0, children=made.to_datasets()
    )
    again = surrogate(node)
    assert type(again) is type(made)
    germs = germs_of(made)
    np.testing.assert_array_equal(again.evaluate_germs(germs), made.evaluate_germs(germs))
    np.testing.assert_array_equal(again.verification_error(), made.verification_error())


def test_some_outputs_and_times_have_the_values_that_they_have_in_the_whole(chaos):
    """Up to rounding: products of matrices add fewer columns in another order."""
    _, made = chaos
    few = made.selected(outputs=[1], times=[3, 30])
    assert few.labels.shape == (1, 2) and few.labels.outputs == made.labels.outputs[1:]
    germs = germs_of(made)
    wanted = made.evaluate_germs(germs)[:, 1:, [3, 30]]
    np.testing.assert_allclose(few.evaluate_germs(germs), wanted, rtol=1e-9, atol=1e-12 * np.nanmax(np.abs(wanted)))
    assert made.selected(range(2), range(33)) is made
    for wrong in ("x", [0.5]):
        with pytest.raises(uqmbd.StudyError, match="outputs is .*; expected a sequence of whole numbers"):
            made.selected(wrong)
    for wrong in ([2], [-1], []):
        with pytest.raises(
            uqmbd.StudyError, match="along 'output' are .* expected at least one index, each from 0 to 1"
        ):
            made.selected(wrong)


def test_indices_of_pairs_that_samples_do_not_tell_are_refused(chaos):
    """Moments of polynomials have them; those of samples say what to take instead."""
    kind, made = chaos
    if kind in ("polynomial", "elements"):
        assert np.all(made.sobol_second.sum(axis=(0, 1)) / 2 + made.sobol_first.sum(axis=0) <= 1 + 1e-9)
    else:
        with pytest.raises(
            uqmbd.StudyError, match="This surrogate has no Sobol' indices of pairs.* Use sobol_first and sobol_total"
        ):
            _ = made.sobol_second
