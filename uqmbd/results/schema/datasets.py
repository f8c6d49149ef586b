"""The data schema of a study, and builders that fill it from plain arrays.

A result is an :class:`xarray.DataTree` with one node per propagator, named by its label, and a node ``comparison``::

    /                          attrs: schema_version, study, mechanism, rtol, integrator, created, uqmbd_version, ...
    |-- monte-carlo            attrs: propagator, label, options, seed, wall_time, realisations, failures, ...
    |   |-- statistics         mean, std, variance, skewness, kurtosis (output, time),
    |   |                      quantile (probability, output, time); from samples: smallest, largest (output, time);
    |   |                      quantile_error (probability, output, time) if quantiles of samples are not exact;
    |   |                      quantile_interval (bound, probability, output, time) for independent samples and for
    |   |                      replicates of a design; circular_mean, circular_std (output, time) for angles;
    |   |                      integration_error, integration_error_rms, integration_error_factor (output, time), NaN
    |   |                      if unknown
    |   |-- samples            response (sample, output, time), inputs (sample, input), status, message (sample):
    |   |                      draws from the joint distribution of the inputs
    |   `-- nodes              same variables by ``node`` for training points, which no probability counts
    `-- comparison             mean_difference_max, std_difference_max (method, output), ...

A propagator labels its axes once (:func:`uqmbd.extend.labels`), and passes arrays to :func:`sample_dataset`,
:func:`statistics_dataset` and :func:`uqmbd.results.propagator_node`. Children outside the schema are allowed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.results.schema.axes import Labels, fixed_width
from uqmbd.results.schema.stated import StatedError, stated_variables
from uqmbd.results.schema.units import as_text, united
from uqmbd.results.schema.values import EVERY, real_numbers
from uqmbd.status import Status

__all__ = [
    "DEFAULT_PROBABILITIES",
    "CHILDREN",
    "SCHEMA_VERSION",
    "STATUS_MEANINGS",
    "check_kind",
    "check_shape",
    "check_version",
    "sample_dataset",
    "statistics_dataset",
]

SCHEMA_VERSION = 2
"""Version of the schema in results (root attribute ``schema_version``; results without it have version 0).

The version increases if a name is changed or removed, or if a meaning changes; additions do not change the version.
uqmbd reads results of earlier versions. Since version 2, each NaN in statistics has a reason.
"""

KIND = "kind"
"""Attribute of a dataset of realisations that states their purpose."""

CHILDREN: Mapping[str, str] = {"samples": "draws", "nodes": "nodes"}
"""Kinds of realisations by the child of a node that contains them."""

STATUS_MEANINGS: Mapping[int, str] = {int(status): status.meaning for status in Status}
"""Meanings of the integers of ``status``; a propagator may pass its own."""

DEFAULT_PROBABILITIES = (0.025, 0.05, 0.25, 0.5, 0.75, 0.95, 0.975)
"""Probabilities of the stored quantiles: the 50 %, 90 % and 95 % intervals and the median."""

_LONG_NAMES = {
    "mean": "mean",
    "std": "standard deviation",
    "variance": "variance",
    "skewness": "skewness",
    "kurtosis": "kurtosis",
    "quantile": "quantile",
    "quantile_error": "bound on the error of the quantile",
    "quantile_interval": "95 % interval of the quantile",
    "smallest": "smallest sample",
    "largest": "largest sample",
    "std_error_mean": "standard error of the mean",
    "std_error_std": "standard error of the standard deviation",
    "circular_mean": "circular mean",
    "circular_std": "circular standard deviation",
    "sobol_first": "first-order Sobol' index",
    "sobol_total": "total Sobol' index",
}
_COMMENTS = {
    "std": "root of the variance, which has the divisor N - 1 for independent samples, and N for a sampling design",
    "variance": "the divisor is N - 1 for independent samples (unbiased), and N for a sampling design",
    "skewness": "third standardised moment; 0 where the output does not vary",
    "kurtosis": "fourth standardised moment, not the excess: 3 for a normal; 3 where the output does not vary",
    "quantile": "NaN where the method states no quantile",
    "quantile_error": "largest possible difference between the stated quantile and the quantile of all samples",
    "quantile_interval": "from ranks of independent samples, or from replicates of a design; infinite with too few "
    "samples",
    "circular_mean": "mean direction, within half a turn of 0; NaN where directions cancel, and for outputs without "
    "angles",
    "circular_std": "sqrt(-2 ln R) with the length R of the mean direction; for n samples at most about sqrt(ln n) "
    "radians",
}


def check_version(attrs: Mapping[Any, Any], where: str) -> None:
    """Check that the schema of results is not later than the schema of this version.

    `attrs`: attributes of the root; `where`: file, for the message. Raise StudyError for later or invalid versions.

    >>> check_version({}, "old.nc")  # written before there were versions
    >>> check_version({"schema_version": 999}, "new.nc")
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: 'new.nc' has the schema version 999; this version of uqmbd reads versions up to 2. Read it
    with ...
    """
    version = attrs.get("schema_version", 0)
    if isinstance(version, (bool, np.bool_)) or not isinstance(version, (int, np.integer)) or version < 0:
        raise StudyError(f"{where!r} has the schema version {version!r:.80}; expected a whole number, 0 or more.")
    if version > SCHEMA_VERSION:
        raise StudyError(
            f"{where!r} has the schema version {version}; this version of uqmbd reads versions up to "
            f"{SCHEMA_VERSION}. Read it with the version of uqmbd that wrote it "
            f"({attrs.get('uqmbd_version', 'not stated')}), or with a later version."
        )


@typechecked
def sample_dataset(
    response: ArrayLike,
    inputs: ArrayLike,
    labels: Labels,
    *,
    status: ArrayLike | None = None,
    messages: Sequence[str] | None = None,
    meanings: Mapping[int, str] = STATUS_MEANINGS,
    copy: bool = True,
    kind: Literal["draws", "nodes"] | None = None,
) -> xr.Dataset:
    """Build the dataset ``samples`` or ``nodes``: responses and inputs, with a status and a reason for each sample.

    A sample whose status is not 0 is stored as NaN. A sample of status 0 that contains a NaN or an infinity becomes a
    failure (status 3, ``not_finite``), so that no mean becomes NaN. The message of this failure states the place.

    Parameters
    ----------
    response : array_like, shape (S, O, T), or (S, O) if the labels have no times
        Outputs of the samples, in their units.
    inputs : array_like, shape (S, I)
        Values of the random inputs, in their units.
    labels : Labels
        Labels of the axes, with O outputs, I inputs and T times.
    status : array_like of int, shape (S,), optional
        Status of each sample: 0 for success, otherwise a key of ``meanings``. Default: all 0.
    messages : sequence of str, length S, optional
        Reason of the failure of each sample; empty if it succeeded.
    meanings : mapping of int to str
        Meaning of each status, stored in the attributes ``flag_values`` and ``flag_meanings`` (CF conventions).
    copy : bool
        Whether to copy `response`. If False, an array of floats becomes part of the dataset, and its failed samples are
        set to NaN.
    kind : {"draws", "nodes"}, optional
        Kind of the rows. ``"draws"`` are drawn from the joint distribution of the inputs, also by a sampling design;
        probabilities, quantiles and histograms count them. ``"nodes"`` are training points or quadrature nodes, which
        are never counted. Results of a propagator must state the kind: a run rejects a dataset without it.

    Returns
    -------
    xarray.Dataset
        Variables ``response (sample, output, time)``, ``inputs (sample, input)``, ``status (sample)`` and
        ``message (sample)``. For nodes, the first dimension is ``node``.

    Raises
    ------
    StudyError
        If a shape does not fit the labels, or a status has no meaning.

    Examples
    --------
    >>> from uqmbd.extend import labels
    >>> axes = labels(["x"], ["k"], [0.0, 1.0])
    >>> samples = sample_dataset([[[1.0, 2.0]], [[1.0, float("nan")]]], [[3.0], [4.0]], axes, kind="draws")
    >>> samples["status"].values.tolist()
    [0, 3]
    >>> str(samples["message"][1].item())
    "output 'x' is not finite (nan) at t = 1 s"
    """
    values = real_numbers("response", response, copy=copy)
    count = values.shape[0] if values.ndim else 0
    check_shape("response", values, (count, *labels.shape), ("sample", *labels.dims))
    drawn = real_numbers("inputs", inputs)
    check_shape("inputs", drawn, (count, len(labels.inputs)), ("sample", "input"))
    stated = np.zeros(count) if status is None else real_numbers("status", status)
    check_shape("status", stated, (count,), ("sample",))
    reasons = [""] * count if messages is None else [str(m) for m in messages]
    if len(reasons) != count:
        raise StudyError(f"'messages' has {len(reasons)} entries; expected one string for each of the {count} samples.")
    unknown = sorted(set(np.unique(stated).tolist()) - set(meanings))
    if unknown:
        raise StudyError(f"The status {unknown[0]:g} is unknown; expected one of {dict(meanings)}.")
    flags = stated.astype(np.int32)

    finite = np.isfinite(values.reshape(count, -1)).all(axis=1)
    for k in np.flatnonzero(~finite & (flags == Status.OK)):
        where = np.unravel_index(int(np.argmin(np.isfinite(values[k]))), labels.shape)
        when = "" if labels.times is None else f" at t = {labels.times[where[1]]:g} s"
        flags[k] = Status.NOT_FINITE
        reasons[k] = f"output {labels.outputs[where[0]].name!r} is not finite ({values[k][where]:g}){when}"
    values[flags != Status.OK] = np.nan

    known = {**meanings, int(Status.NOT_FINITE): meanings.get(Status.NOT_FINITE, STATUS_MEANINGS[Status.NOT_FINITE])}
    flag_attrs = {
        "flag_values": np.array(sorted(known), dtype=np.int32),
        "flag_meanings": " ".join(known[k].replace(" ", "_") for k in sorted(known)),
    }
    # rows along another dimension cannot be mistaken for draws
    row = "node" if kind == "nodes" else "sample"
    return _labelled(
        xr.Dataset(
            {
                "response": (
                    (row, *labels.dims),
                    values,
                    {"long_name": "response", "comment": "NaN where status is not 0"},
                ),
                "inputs": ((row, "input"), drawn, {"long_name": "value of the input"}),
                "status": (row, flags, flag_attrs),
                "message": (row, fixed_width(reasons)),
            },
            coords={**labels.output_coords(), **labels.input_coords()},
            attrs={} if kind is None else {KIND: kind},
        )
    )


def check_kind(data: xr.Dataset, child: str, where: str) -> None:
    """Raise StudyError unless a dataset of realisations states the kind of the child that contains it."""
    stated, expected = data.attrs.get(KIND), CHILDREN[child]
    if stated == expected:
        return
    found = f"states that its rows are {stated!r}" if stated else "does not state the kind of its rows"
    raise StudyError(
        f"{where}: the dataset '{child}' {found}. 'samples' are draws from the joint distribution of the inputs: "
        "probabilities, quantiles and histograms count them. Training points and quadrature nodes are 'nodes'. Write "
        'samples=sample_dataset(..., kind="draws") or nodes=sample_dataset(..., kind="nodes").'
    )


@typechecked
def statistics_dataset(
    labels: Labels,
    *,
    mean: ArrayLike,
    std: ArrayLike,
    skewness: ArrayLike | None = None,
    kurtosis: ArrayLike | None = None,
    quantile: ArrayLike | None = None,
    quantile_error: ArrayLike | None = None,
    quantile_interval: ArrayLike | None = None,
    probability: ArrayLike | None = None,
    variance: ArrayLike | None = None,
    std_error_mean: ArrayLike | None = None,
    std_error_std: ArrayLike | None = None,
    smallest: ArrayLike | None = None,
    largest: ArrayLike | None = None,
    sobol_first: ArrayLike | None = None,
    sobol_total: ArrayLike | None = None,
    circular_mean: ArrayLike | None = None,
    circular_std: ArrayLike | None = None,
    stated_error: StatedError | None = None,
) -> xr.Dataset:
    """Build the dataset ``statistics`` of a propagator.

    Parameters
    ----------
    labels : Labels
        Labels of the axes, with O outputs, I inputs and T times.
    mean, std : array_like, shape (O, T)
        Mean and standard deviation, in the units of the outputs.
    skewness, kurtosis : array_like, shape (O, T), optional
        Standardised moments; the kurtosis is not the excess (3 for a normal distribution). Default: NaN, unknown.
    quantile : array_like, shape (P, O, T), optional
        Quantiles at `probability`. Default: NaN at the default probabilities.
    quantile_error : array_like, shape (P, O, T), optional
        Bound of the error of the quantiles, compared with the quantiles of all samples. Default: no error.
    quantile_interval : array_like, shape (2, P, O, T), optional
        Lower and upper ends of 95 % intervals of the quantiles; infinite if an end is unknown. Default: not stated.
    probability : array_like, shape (P,), optional
        Probabilities of the quantiles, increasing, between 0 and 1.
    variance : array_like, shape (O, T), optional
        Variance. Default: ``std**2``.
    std_error_mean, std_error_std : array_like, shape (O, T), optional
        Standard errors of mean and standard deviation, if the method estimates them.
    smallest, largest : array_like, shape (O, T), optional
        Smallest and largest sample, if the method has samples.
    sobol_first, sobol_total : array_like, shape (I, O, T), optional
        Sobol' indices of each input.
    circular_mean, circular_std : array_like, shape (O, T), optional
        Circular statistics of angles, in the units of the outputs; NaN for outputs that are not angles. All other
        statistics refer to the unwrapped angle.
    stated_error : StatedError, optional
        Absolute or relative error of mean and standard deviation, if it is not the standard error of samples. The
        variable ``stated_error`` contains it in the units of the outputs, and ``verification_error`` relative to the
        standard deviation. Comparisons, warnings and reports use it like the error of a surrogate.

    Returns
    -------
    xarray.Dataset
        Statistics.

    Raises
    ------
    StudyError
        If a shape does not fit the labels, or values are complex or masked.

    Examples
    --------
    >>> from uqmbd.extend import labels
    >>> axes = labels([("x", "m")], [], [0.0, 1.0])
    >>> statistics = statistics_dataset(axes, mean=[[0.0, 1.0]], std=[[0.0, 0.5]])
    >>> float(statistics["variance"].sel(output="x", time=1.0))
    0.25
    """
    unknown = np.full(labels.shape, np.nan)
    optional = {"skewness": skewness, "kurtosis": kurtosis, "quantile": quantile}
    silent = [name for name, value in optional.items() if value is None]
    levels = real_numbers("probability", DEFAULT_PROBABILITIES if probability is None else probability)
    if levels.ndim != 1 or not ((levels >= 0) & (levels <= 1)).all():
        raise StudyError(f"'probability' is {probability!r:.80}; expected a sequence of numbers between 0 and 1.")
    plain: dict[str, ArrayLike | None] = {
        "mean": mean,
        "std": std,
        "variance": np.square(real_numbers("std", std)) if variance is None else variance,
        "skewness": unknown if skewness is None else skewness,
        "kurtosis": unknown if kurtosis is None else kurtosis,
        "std_error_mean": std_error_mean,
        "std_error_std": std_error_std,
        "smallest": smallest,
        "largest": largest,
        "circular_mean": circular_mean,
        "circular_std": circular_std,
    }
    by_input: dict[str, ArrayLike | None] = {"sobol_first": sobol_first, "sobol_total": sobol_total}
    given = [(name, value, (), ()) for name, value in plain.items()]
    quantiles = np.full((len(levels), *labels.shape), np.nan) if quantile is None else quantile
    table: list[tuple[str, ArrayLike | None, tuple[str, ...], tuple[int, ...]]] = [
        *given,
        ("quantile", quantiles, ("probability",), (len(levels),)),
        ("quantile_error", quantile_error, ("probability",), (len(levels),)),
        ("quantile_interval", quantile_interval, ("bound", "probability"), (2, len(levels))),
        *((name, value, ("input",), (len(labels.inputs),)) for name, value in by_input.items()),
    ]
    variables: dict[str, Any] = {}
    for name, value, dims, sizes in table:
        if value is None:
            continue
        array = real_numbers(name, value)
        check_shape(name, array, (*sizes, *labels.shape), (*dims, *labels.dims))
        attrs = {"long_name": _LONG_NAMES[name]} | ({"comment": _COMMENTS[name]} if name in _COMMENTS else {})
        if name in silent:
            attrs["unknown"] = json.dumps({EVERY: "the method states no standard error"})
        variables[name] = ((*dims, *labels.dims), array, attrs)
    if stated_error is not None:
        variables |= stated_variables(labels, stated_error, variables["std"][1])
    coords = {
        **labels.output_coords(),
        "probability": ("probability", levels, {"units": "1", "long_name": "probability"}),
    }
    if quantile_interval is not None:
        coords |= {"bound": ("bound", fixed_width(("lower", "upper")))}
    if any(value is not None for value in by_input.values()):
        coords |= labels.input_coords()
    return _labelled(xr.Dataset(variables, coords=coords))


def _labelled(fresh: xr.Dataset) -> xr.Dataset:
    """Return a dataset that was just made, with units and types of texts."""
    return as_text(united(fresh, copy=False), copy=False)


def check_shape(name: str, array: NDArray[Any], expected: tuple[int, ...], dims: tuple[str, ...]) -> None:
    """Raise StudyError if the shape of an array differs from the expected shape."""
    if array.shape != expected:
        raise StudyError(f"'{name}' has the shape {array.shape}; expected ({', '.join(dims)}) = {expected}.")
