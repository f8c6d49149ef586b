"""Dataset ``requirements`` of any method, from its results for margins as outputs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import typechecked
from uqmbd.results.chaos import surrogate, surrogate_parts
from uqmbd.results.requirements.counting import Violations
from uqmbd.results.requirements.dataset import requirement_names, requirements_dataset
from uqmbd.results.requirements.surrogates import sampled_requirements
from uqmbd.status import Status

if TYPE_CHECKING:
    from uqmbd.mechanism import Requirement

__all__ = ["requirements_of"]


@typechecked
def requirements_of(node: xr.DataTree, requirements: Sequence[Requirement], late: NDArray[np.bool_]) -> xr.Dataset:
    """Build the dataset ``requirements`` of a method from its node of margins.

    Parameters
    ----------
    node : xarray.DataTree
        Node whose outputs are the running margins at the output times.
    requirements : sequence of Requirement
        Requirements, in the order of the outputs.
    late : array of bool, shape (requirement,)
        Whether each margin is known only at the end. At earlier times, the node then contains the margin at the end.

    Returns
    -------
    xarray.Dataset
        Probabilities of violation from samples of the surrogate, if the method has one, otherwise from its
        realisations. If it has neither, every probability is NaN, with the interval from 0 to 1.

    Examples
    --------
    A method with only the mean of a margin does not state a probability:

    >>> import numpy as np
    >>> from uqmbd.results import propagator_node, requirements_of
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> def node(outputs, times, values):
    ...     axes = labels(outputs, [], times)
    ...     statistics = statistics_dataset(axes, mean=values, std=np.zeros_like(values))
    ...     return propagator_node("mine", statistics, propagator="perturbation", realisations=1, wall_time=0.1)
    >>> from uqmbd.extend import Requirement
    >>> clear = Requirement("clear", "it stays clear", "gap > 0", over_time=True)
    >>> found = requirements_of(node(["clear"], [0.0, 1.0], [[0.3, 0.2]]), [clear], np.array([False]))
    >>> found["violation_probability"].values.tolist(), found["interval"].values.tolist()
    ([nan], [[0.0, 1.0]])
    """
    times = node.children["statistics"].to_dataset()["time"].values
    if surrogate_parts(node):
        counted = int(node.attrs.get("failures", 0)) / max(int(node.attrs.get("realisations", 0)), 1)
        # `failed_share` is weighted: realisations that a method places in the tails have smaller weights
        lost = float(node.attrs.get("failed_share", counted))
        return sampled_requirements(
            requirements, late, lambda k: surrogate(node, times=[k % len(times)]), surrogate(node), lost, 0
        )
    if "samples" in node.children:
        samples = node.children["samples"].to_dataset()
        running = np.where(
            np.arange(len(times)) < np.where(late, len(times) - 1, 0)[:, None], np.inf, samples["response"]
        )
        return Violations.dataset(requirements, [Violations.of(running, samples["status"].values != Status.OK)], times)
    size = len(requirement_names(requirements))
    how = "the method provides neither samples nor a surrogate, so no probability can be computed"
    return requirements_dataset(
        requirements,
        violation_probability=np.full(size, np.nan),
        lower=np.zeros(size),
        upper=np.ones(size),
        attrs={"how": how},
    )
