"""Dataset ``requirements`` of a propagator's node: probabilities of violation with confidence intervals."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from uqmbd.arguments import shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.names import ANY
from uqmbd.results.requirements.intervals import LEVEL
from uqmbd.results.schema import check_shape, fixed_width, real_numbers
from uqmbd.typing import Array

if TYPE_CHECKING:
    from uqmbd.mechanism import Requirement

__all__ = ["requirement_names", "requirements_dataset"]

ANY_WORDS = "any of the requirements is violated"


@typechecked
def requirement_names(requirements: Sequence[Requirement | str]) -> tuple[str, ...]:
    """Return the names of the requirements, followed by ``any`` if there are several.

    Parameters
    ----------
    requirements : sequence of Requirement or str
        Requirements, or their names, in their order.

    Examples
    --------
    >>> requirement_names(["overload"]), requirement_names(["overload", "clearance"])
    (('overload',), ('overload', 'clearance', 'any'))
    """
    names = tuple(r if isinstance(r, str) else r.name for r in requirements)
    return (*names, ANY) if len(names) > 1 and ANY not in names else names


@typechecked
def requirements_dataset(
    requirements: Sequence[Requirement | str],
    *,
    violation_probability: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    std_error: ArrayLike | None = None,
    times: ArrayLike | None = None,
    violated_by: ArrayLike | None = None,
    violated_by_interval: tuple[ArrayLike, ArrayLike] | None = None,
    variables: Mapping[str, tuple[Any, ...]] | None = None,
    attrs: Mapping[str, Any] | None = None,
) -> xr.Dataset:
    """Build the dataset ``requirements`` of a propagator's node.

    Parameters
    ----------
    requirements : sequence of Requirement or str
        Requirements of the node, such as ``problem.requirements``. If there are several, all values have an additional
        last row ``any``, for the violation of any of them.
    violation_probability, lower, upper : array_like, shape (requirement,)
        Probabilities of violation, and ends of their 95 % intervals.
    std_error : array_like, shape (requirement,), optional
        Standard errors of the probabilities. Default: unknown, NaN.
    times : array_like, shape (T,), optional
        Output times in s of `violated_by`.
    violated_by : array_like, shape (requirement, T), optional
        Probability of a violation until each time.
    violated_by_interval : tuple of two array_like, shape (requirement, T), optional
        Lower and upper ends of the 95 % intervals of `violated_by`. Default: the intervals before the last time are
        unknown.
    variables, attrs : mapping, optional
        Further variables, as for `xarray.Dataset`, and attributes.

    Returns
    -------
    xarray.Dataset
        Probabilities of violation.

    Raises
    ------
    StudyError
        If shapes do not fit, or an interval does not contain its probability.

    Examples
    --------
    >>> found = requirements_dataset(["overload"], violation_probability=[0.02], lower=[0.01], upper=[0.04])
    >>> found["interval"].sel(requirement="overload", bound="upper").item()
    0.04
    """
    names = requirement_names(requirements)
    if violated_by_interval is not None and violated_by is None:
        raise StudyError("violated_by_interval is given without violated_by; expected both or neither.")
    known = {r.name: r for r in requirements if not isinstance(r, str)}
    shape, dims = (len(names),), ("requirement",)
    probability = real_numbers("violation_probability", violation_probability)
    ends = [real_numbers(name, end) for name, end in (("lower", lower), ("upper", upper))]
    error = np.full(shape, np.nan) if std_error is None else real_numbers("std_error", std_error)
    given = {"violation_probability": probability, "lower": ends[0], "upper": ends[1], "std_error": error}
    for name, values in given.items():
        check_shape(name, values, shape, dims)
    wrong = ~((ends[0] >= 0) & (ends[0] <= ends[1]) & (ends[1] <= 1))
    wrong |= np.isfinite(probability) & ((probability < ends[0] - 1e-12) | (probability > ends[1] + 1e-12))
    if wrong.any():
        k = int(np.argmax(wrong))
        raise StudyError(
            f"requirement {names[k]!r}: the probability is {probability[k]:g}, and its interval is {ends[0][k]:g} to "
            f"{ends[1][k]:g}; expected an interval within 0 to 1 that contains the probability."
        )
    about = {"long_name": "probability that the requirement is violated", "units": "1"}
    data: dict[str, Any] = {
        "violation_probability": (dims, probability, about),
        "std_error": (
            dims,
            error,
            {"long_name": "standard error of the probability", "units": "1", **_silent(names, error)},
        ),
        "interval": (
            (*dims, "bound"),
            np.stack(ends, axis=1),
            {"long_name": f"{LEVEL:.0%} interval of the probability", "level": LEVEL, "units": "1"},
        ),
    }
    words = {ANY: ANY_WORDS} | {name: r.description for name, r in known.items()}
    relations = {name: r.relation for name, r in known.items()}
    coords: dict[str, Any] = {
        "requirement": (dims, fixed_width(names)),
        "description": (dims, fixed_width(words.get(name, "") for name in names)),
        "relation": (dims, fixed_width(relations.get(name, "") for name in names)),
        "bound": ("bound", fixed_width(("lower", "upper"))),
    }
    if (violated_by is None) != (times is None):
        alone, other = ("times", "violated_by") if violated_by is None else ("violated_by", "times")
        raise StudyError(f"{alone} is given without {other}; expected both or neither.")
    if violated_by is not None:
        grid, over_time = real_numbers("times", times), real_numbers("violated_by", violated_by)
        if grid.ndim != 1 or not np.isfinite(grid).all():
            raise StudyError(f"times is {shown(times)}; expected finite times (T,).")
        check_shape("violated_by", over_time, (*shape, len(grid)), (*dims, "time"))
        about = {"long_name": "probability of a violation up to each time", "units": "1"}
        data["violated_by"] = ((*dims, "time"), over_time, about)
        if violated_by_interval is not None:
            low, high = (real_numbers("violated_by_interval", end) for end in violated_by_interval)
            for end in (low, high):
                check_shape("violated_by_interval", end, over_time.shape, (*dims, "time"))
            outside = ~((low >= 0) & (low <= over_time + 1e-12) & (over_time <= high + 1e-12) & (high <= 1))
            if (outside & np.isfinite(over_time)).any():
                k, n = (int(x) for x in np.argwhere(outside & np.isfinite(over_time))[0])
                raise StudyError(
                    f"requirement {names[k]!r}: the probability until t = {grid[n]:g} s is {over_time[k, n]:g}, and "
                    f"its interval is {low[k, n]:g} to {high[k, n]:g}; expected an interval within 0 to 1 that "
                    "contains the probability."
                )
            data["violated_by_interval"] = (
                (*dims, "bound", "time"),
                np.stack([low, high], axis=1),
                {"long_name": f"{LEVEL:.0%} interval of violated_by", "level": LEVEL, "units": "1"},
            )
        coords["time"] = ("time", grid, {"units": "s", "long_name": "time"})
    return xr.Dataset({**data, **(variables or {})}, coords=coords, attrs=dict(attrs or {}))


def _silent(names: Sequence[str], error: Array) -> dict[str, str]:
    """Return the attribute that lists the requirements (R,) without a stated standard error."""
    unknown = {name: "the method states no standard error" for name, x in zip(names, error, strict=True) if np.isnan(x)}
    return {"unknown": json.dumps(unknown)} if unknown else {}
