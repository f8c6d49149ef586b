"""Compare error and cost of a method at several orders or sample sizes."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.arguments import shown
from uqmbd.errors import StudyError
from uqmbd.isolation import ERRORS_AND_EXITS, Isolated, release
from uqmbd.plugins import method_with_option
from uqmbd.progress import Progress, choose_receiver
from uqmbd.propagation.convergence.reference import reference_node
from uqmbd.propagation.execution import explained, opened
from uqmbd.propagation.methods import Propagator, Studied, run_method
from uqmbd.typing import Array

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr

__all__ = ["check_convergence", "converge"]

Method = Propagator | type[Propagator]

MOST_LEVELS = 1000
"""Maximum number of levels of a method."""

SHAPES = ("mean_error_l2", "std_error_l2", "mean_error_max", "std_error_max", "stated_error")


@dataclass(frozen=True)
class _OptionSeries:
    """Method, its varied option, and the values of this option."""

    propagator: Propagator
    option: str
    values: tuple[Any, ...]


def converge(
    study: Studied,
    propagators: Method | Sequence[Method],
    *,
    reference: xr.DataTree | xr.Dataset | Propagator | None = None,
    workers: int | Executor = 1,
    progress: Progress | bool | None = None,
    folder: Path | None = None,
    **levels: Any,
) -> xr.Dataset:
    """Run methods at several levels of an option, and compare their errors with their costs; see `Study.converge`.

    A dataset as reference contains exact `mean` and `std` (output, time). By default the reference is the result with
    the smallest stated error, or, without stated errors, the last level of the first method. The errors of the
    reference are NaN. `folder` stores finished chunks during the run.

    The result has the dimensions ``method``, ``level`` and ``output``. ``mean_error_l2`` and ``std_error_l2`` are norms
    over time of the differences to the reference, relative to the norm of its mean or standard deviation.
    ``..._error_max`` is the largest difference, relative to the largest standard deviation of the reference.
    ``stated_error`` is the stated error of the standard deviation. ``problem`` contains the reason why a level failed,
    and is otherwise empty; numbers of failed levels are NaN.
    ``reference_mean_error`` and ``reference_std_error`` (output) are stated errors of the reference, NaN if none is
    stated. ``mean_rate`` and ``std_rate`` (method, output) are orders of convergence p, fitted to errors above the
    errors of the reference. For ``order``, p is the number of decades per order by which the error decreases. For
    other options, error ~ value^-p (1/2 for plain Monte Carlo). The rates are NaN for fewer than two such errors.
    Raise StudyError if there are no levels, if a method has none of the options, or if no level succeeded.
    """
    series, shown = _series(study, propagators, levels), choose_receiver(progress)
    with opened(workers) as executor:
        nodes: dict[tuple[int, int], xr.DataTree] = {}
        problems: dict[tuple[int, int], str] = {}
        # the reference is computed first, because all errors require it
        with explained(executor):
            base = reference_node(study, reference, executor, shown, folder)
        for m, one in enumerate(series):
            for k, value in enumerate(one.values):
                with Isolated(*ERRORS_AND_EXITS) as work:
                    label = f"{one.propagator.node_name}-{value}"
                    made = replace(one.propagator, label=label, **{one.option: value})
                    with _coarse_on_purpose(), explained(executor):
                        nodes[m, k] = run_method(made, study.problem(made, executor, shown, folder), check=False)
                if work.error is not None:
                    release(work.error)
                    problems[m, k] = work.reason
    if not nodes:
        raise StudyError(
            f"study {study.name!r}: no level of any method succeeded. Reason of the first failure: "
            f"{next(iter(problems.values()), 'none')}"
        )
    own = None
    if base is None:
        own = _most_converged(nodes)
        base = nodes[own]
    return _dataset(series, nodes, problems, base, own)


@contextmanager
def _coarse_on_purpose() -> Iterator[None]:
    """Suppress warnings of methods about low orders, because the convergence study measures their errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        yield


def _most_converged(nodes: dict[tuple[int, int], xr.DataTree]) -> tuple[int, int]:
    """Return the result with the smallest stated error; without stated errors, the last level of the first method."""
    from uqmbd.results import relative_errors

    stated = {key: relative_errors(node, node)["stated_error"] for key, node in nodes.items()}
    worst = {key: float(np.where(np.isnan(e), np.inf, e).max(initial=0.0)) for key, e in stated.items()}
    return min(nodes, key=lambda key: (worst[key], key[0], -key[1]))


def check_convergence(study: Studied, given: Method | Sequence[Method], levels: Mapping[str, Any]) -> None:
    """Raise a StudyError if the levels of `converge` do not suit the methods."""
    _series(study, given, levels)


def _example() -> str:
    return method_with_option("order", "Method")


def _series(study: Studied, given: Method | Sequence[Method], levels: Mapping[str, Any]) -> list[_OptionSeries]:
    if not levels:
        raise StudyError(
            f"converge: no levels are given; expected e.g. study.converge({_example()}, order=[1, 2, 3, 4])."
        )
    for name, values in levels.items():
        for one in values.values() if isinstance(values, Mapping) else [values]:
            if not _entries(one):
                raise StudyError(f"converge: {name} is {shown(one)}; expected a list of levels, e.g. {name}=[1, 2, 3].")
    methods = _entries(given) or [given]
    found: list[_OptionSeries] = []
    for method in methods:
        made = method() if isinstance(method, type) and issubclass(method, Propagator) else method
        if not isinstance(made, Propagator):
            raise StudyError(
                f"converge: {shown(method)} is not a propagator; expected a propagator class, e.g. "
                f"study.converge({_example()}, ...)."
            )
        options = [f.name for f in fields(made) if f.name != "label"]
        own = {name: v[made.node_name] for name, v in levels.items() if isinstance(v, Mapping) and made.node_name in v}
        usable = own or {name: v for name, v in levels.items() if not isinstance(v, Mapping)}
        chosen = next((name for name in usable if name in options), None)
        if chosen is None:
            raise StudyError(
                f"converge: {made.node_name} ({type(made).__name__}) has no option {' or '.join(usable or levels)}, "
                f"or no levels are given for it; its options are: {', '.join(options)}."
            )
        found.append(_OptionSeries(made, chosen, tuple(usable[chosen])))
    study.with_propagators([one.propagator for one in found])  # labels must differ
    known = [one.propagator.node_name for one in found]
    unknown = [x for v in levels.values() if isinstance(v, Mapping) for x in v if x not in known]
    if unknown:
        raise StudyError(f"converge: levels are given for {unknown[0]!r}; the methods are: {', '.join(known)}.")
    return found


def _entries(given: Any) -> list[Any]:
    """Return the entries of a sequence; empty for other objects, and for more than `MOST_LEVELS` entries."""
    if isinstance(given, (str, bytes, type)) or not isinstance(given, Collection) or getattr(given, "ndim", 1) == 0:
        return []
    return list(given) if len(given) <= MOST_LEVELS else []


def _dataset(
    series: list[_OptionSeries],
    nodes: dict[tuple[int, int], xr.DataTree],
    problems: dict[tuple[int, int], str],
    base: xr.DataTree,
    skip: tuple[int, int] | None,
) -> xr.Dataset:
    import xarray as xr

    from uqmbd.results import relative_errors

    statistics = base.children["statistics"].to_dataset()
    outputs = statistics["output"].values
    size = (len(series), max(len(one.values) for one in series))
    errors = {name: np.full((*size, len(outputs)), np.nan) for name in SHAPES}
    value, wall, runs = (np.full(size, np.nan) for _ in range(3))
    texts, names = (np.full(size, "", dtype=object) for _ in range(2))
    for m, one in enumerate(series):
        for k, number in enumerate(one.values):
            value[m, k] = float(number) if isinstance(number, (int, float)) else k
            texts[m, k], names[m, k] = problems.get((m, k), ""), f"{one.option} {number}"
            node = nodes.get((m, k))
            if node is None:
                continue
            wall[m, k] = float(node.attrs.get("wall_time", np.nan))
            runs[m, k] = float(node.attrs.get("realisations", np.nan))
            for name, found in relative_errors(node, base).items():
                if name in errors and ((m, k) != skip or name == "stated_error"):
                    errors[name][m, k] = found
    own = relative_errors(base, base)
    limits = {name: own[f"own_{name}_error"] for name in ("mean", "std")}
    rates = {name: _rates(series, value, errors[f"{name}_error_l2"], limits[name]) for name in ("mean", "std")}
    dims = ("method", "level", "output")
    data: dict[str, Any] = {name: (dims, found) for name, found in errors.items()}
    for name in ("mean", "std"):
        data[f"{name}_rate"] = (("method", "output"), rates[name], {"long_name": "order of convergence"})
        data[f"reference_{name}_error"] = ("output", limits[name], {"long_name": "own error of the reference"})
    return xr.Dataset(
        {
            **data,
            "value": (("method", "level"), value),
            "realisations": (("method", "level"), runs),
            "wall_time": (("method", "level"), wall, {"units": "s"}),
            "level_name": (("method", "level"), names.astype(np.str_)),
            "problem": (("method", "level"), texts.astype(np.str_)),
        },
        coords={
            "method": ("method", np.array([one.propagator.node_name for one in series], dtype=np.str_)),
            "option": ("method", np.array([one.option for one in series], dtype=np.str_)),
            "output": ("output", outputs),
            "output_units": ("output", statistics["output_units"].values),
        },
        attrs={"reference": str(base.attrs.get("label", base.name))},
    )


def _rates(series: list[_OptionSeries], value: Array, errors: Array, limits: Array) -> Array:
    """Fit the order of convergence (method, output) by least squares."""
    found = np.full((len(series), errors.shape[-1]), np.nan)
    for m, one in enumerate(series):
        for o in range(errors.shape[-1]):
            least = max(1e-13, float(np.nan_to_num(limits[o])))
            used = np.isfinite(errors[m, :, o]) & (errors[m, :, o] > least)
            x = value[m, used] if one.option == "order" else np.log10(np.maximum(value[m, used], 1e-300))
            if used.sum() >= 2 and np.ptp(x) > 0:
                found[m, o] = -np.polyfit(x, np.log10(errors[m, used, o]), 1)[0]
    return found
