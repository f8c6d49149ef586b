"""Compare errors of methods with their costs, if a reference is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.results.assessment.accuracy import stated_accuracy
from uqmbd.results.assessment.error_norms import relative_errors
from uqmbd.results.assessment.own_errors import own_error
from uqmbd.results.schema import total_realisations
from uqmbd.results.statistics import rtol_of

__all__ = ["error_against_cost"]


@typechecked
def error_against_cost(
    nodes: Mapping[str, xr.DataTree], reference: str, accuracies: Sequence[float] = (0.1, 0.01, 0.001)
) -> xr.Dataset:
    """Return errors, costs and regrets of methods, compared with a reference.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
        Propagator nodes by label, with the same outputs and times (`align`).
    reference : str
        Label of the reference, for example a run with many realisations.
    accuracies : sequence of float
        Accuracies for which the regret is computed, in the measure of `stated_accuracy`.

    Returns
    -------
    xarray.Dataset
        Variables by ``method``, all methods but the reference:

        - ``mean_error``, ``std_error``: largest difference from the reference over outputs and times, relative to the
          largest standard deviation of the output over time. Infinite if a statistic is unknown at some time.
        - ``stated_accuracy``: stated error in the same measure, with 95 % confidence.
        - ``realisations``, ``wall_time`` (s): costs.

        ``regret (method, accuracy)``: number of realisations, divided by the smallest number among methods whose errors
        are at most the accuracy. NaN for methods with larger errors, and for accuracies below the stated accuracy of
        the reference. The
        attribute ``reference_accuracy`` contains the stated accuracy of the reference. Outputs that do not vary are
        ignored.

    Raises
    ------
    uqmbd.StudyError
        If there is no method but the reference, the reference is unknown, an accuracy is not positive, or outputs or
        times differ.

    Examples
    --------
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels(["x"], [], [0.0, 1.0])
    >>> def node(label, std, cost, error=1e-4):
    ...     known = {"std_error_mean": [[error, error]], "std_error_std": [[error, error]]}
    ...     statistics = statistics_dataset(axes, mean=[[0.0, 0.0]], std=[[std, std]], **known)
    ...     return propagator_node(label, statistics, propagator="p", realisations=cost, wall_time=0.01 * cost)
    >>> nodes = {"many": node("many", 1.0, 10000), "some": node("some", 1.004, 300), "few": node("few", 1.05, 20)}
    >>> found = error_against_cost(nodes, "many", (0.1, 0.01))
    >>> found["std_error"].round(6).values.tolist(), found["regret"].values.tolist()
    ([0.004, 0.05], [[15.0, 1.0], [1.0, nan]])
    """
    if reference not in nodes:
        raise StudyError(f"The reference is {reference!r}; expected one of the methods {', '.join(map(repr, nodes))}.")
    if len(nodes) < 2:
        raise StudyError(f"The only method is the reference {reference!r}; give at least one further method.")
    if any(not 0 < accuracy < np.inf for accuracy in accuracies):
        raise StudyError(f"accuracies are {list(accuracies)}; expected positive numbers, such as 0.01 for 1 %.")
    others = {label: node for label, node in nodes.items() if label != reference}
    base = nodes[reference]
    errors = np.array([_largest_errors(node, base) for node in others.values()])
    counts = np.array([total_realisations(node) for node in others.values()], dtype=np.int64)
    own = stated_accuracy(base, rtol=rtol_of(base)).value
    limits = np.array(accuracies, dtype=float)
    reached = (errors.max(axis=1)[:, None] <= limits) & (own <= limits)
    costs = np.where(reached, counts[:, None], np.inf)
    least = costs.min(axis=0, initial=np.inf)
    stated = [stated_accuracy(node, rtol=rtol_of(node)).value for node in others.values()]
    times = [float(node.attrs.get("wall_time", np.nan)) for node in others.values()]
    return xr.Dataset(
        {
            "mean_error": ("method", errors[:, 0]),
            "std_error": ("method", errors[:, 1]),
            "stated_accuracy": ("method", np.array(stated, dtype=float)),
            "realisations": ("method", counts),
            "wall_time": ("method", np.array(times), {"units": "s"}),
            "regret": (
                ("method", "accuracy"),
                np.where(reached, costs / np.where(np.isinf(least), 1.0, least), np.nan),
            ),
        },
        coords={"method": np.array(list(others), dtype=np.str_), "accuracy": limits},
        attrs={"reference": reference, "reference_accuracy": own},
    )


def _largest_errors(node: xr.DataTree, base: xr.DataTree) -> tuple[float, float]:
    """Return the largest errors of mean and standard deviation over outputs and times."""
    pairs = [(node, base)]
    if "scalars" in base.children:
        if "scalars" not in node.children:
            return np.inf, np.inf
        pairs.append((node.children["scalars"], base.children["scalars"]))
    found = [0.0], [0.0]
    for one, other in pairs:
        if not other.children["statistics"].sizes["output"]:
            continue
        # `relative_errors` excludes unknown times, and compares outputs and times
        errors, varies = relative_errors(one, other), own_error(other, rtol_of(other), dependence=False).varies
        known = [np.isfinite(x.children["statistics"].to_dataset()["std"].values) for x in (one, other)]
        gaps = (known[1] & ~known[0]).reshape(len(varies), -1).any(axis=1)
        for name, values in zip(("mean", "std"), found, strict=True):
            values += np.where(gaps, np.inf, errors[f"{name}_error_max"])[varies].tolist()
    return max(found[0]), max(found[1])
