"""Builders of datasets refuse what they would change silently."""

from typing import Any

import numpy as np
import pytest

from uqmbd import StudyError, extend


@pytest.mark.parametrize("status", [0.5, float("nan"), -1, 10**400, "one"], ids=repr)
def test_a_status_is_one_of_those_with_a_meaning(status: Any) -> None:
    axes = extend.labels(["x"], [], [0.0])
    with pytest.raises(StudyError, match="[Ss]tatus"):
        extend.sample_dataset([[[1.0]]], np.zeros((1, 0)), axes, status=[status])


@pytest.mark.parametrize("probability", [[[0.5]], 0.5, [2.0], [float("nan")], "text"], ids=repr)
def test_probabilities_of_quantiles_are_a_row_of_shares(probability: Any) -> None:
    axes = extend.labels(["x"], [], [0.0])
    with pytest.raises(StudyError, match="probability'? is"):
        extend.statistics_dataset(axes, mean=[[0.0]], std=[[0.0]], probability=probability)
