"""Which method to use, in words, with the reasons."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from uqmbd.results.verdicts import AGREES, DIFFERS, FEW, REFERENCE, UNDER_RESOLVED, percent

__all__ = ["overall", "recommend"]

GOOD, FAIR = 0.01, 0.05
"""Own errors, relative to the standard deviation: enough for nearly all purposes, and for most."""

_ORDER = (DIFFERS, UNDER_RESOLVED, FEW, AGREES, REFERENCE)


def overall(comparison: xr.Dataset, method: str) -> tuple[str, str, str]:
    """Return the worst verdict of a method: its kind, its words, and the outputs that share the kind.

    Parameters
    ----------
    comparison : xarray.Dataset
        From :func:`uqmbd.results.compare`.
    method : str
        A label.
    """
    row = comparison.sel({"method": method})
    kinds = [str(kind) for kind in row["verdict_kind"].values]
    worst = min(kinds, key=_ORDER.index)
    shared = [k for k, kind in enumerate(kinds) if kind == worst]
    # in words the output of the largest difference, relative to its scale
    off = np.hypot(row["mean_difference_l2"].values, row["std_difference_l2"].values)
    scale = comparison["reference_std_max"].values
    relative = np.nan_to_num(off / np.where(scale > 0, scale, np.inf), nan=0.0)
    first = max(shared, key=lambda k: relative[k])
    names = [str(comparison["output"].values[k]) for k in sorted(shared, key=lambda k: k != first)]
    which = "" if len(shared) == len(kinds) else ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
    return worst, str(row["verdict"].values[first]), which


def recommend(comparison: xr.Dataset) -> tuple[str, ...]:
    """Recommend a method, in sentences that can be read in a minute.

    The cheapest whose every output agrees with the reference, and whose own error is at most 1 % of the standard
    deviation, or at most 5 %, or the least; then what is to be said of the others.

    Parameters
    ----------
    comparison : xarray.Dataset
        From :func:`uqmbd.results.compare`, of two or more methods.

    Returns
    -------
    tuple of str
        The recommendation first, then a sentence for each other method.

    Examples
    --------
    >>> from uqmbd.results import compare, labels, propagator_node, statistics_dataset
    >>> axes = labels(["x"], [], [0.0, 1.0])
    >>> def node(label, std, cost, error):
    ...     known = {"std_error_mean": [[error, error]], "std_error_std": [[error, error]]}
    ...     statistics = statistics_dataset(axes, mean=[[0.0, 0.0]], std=[[std, std]], **known)
    ...     return propagator_node(label, statistics, propagator="p", realisations=cost, wall_time=0.01 * cost)
    >>> for sentence in recommend(compare([node("many", 1.0, 10000, 0.01), node("few", 0.99, 1000, 0.02)])):
    ...     print(sentence)
    Use few: it agrees with many, its own error, averaged over time, is below 5 % of the standard deviation, and it is
    10 times cheaper than many (10 s instead of 1 min 40 s; 1000 realisations instead of 10000).
    """
    methods = [str(m) for m in comparison["method"].values]
    if len(methods) < 2 or "verdict" not in comparison or not comparison.sizes["output"]:
        return ()
    reference = str(comparison.attrs["reference"])
    found = {m: overall(comparison, m) for m in methods}
    errors = {m: _error(comparison, m) for m in methods}
    costs = _costs(comparison)
    fit = [m for m in methods if found[m][0] in (AGREES, REFERENCE)]
    if fit == [reference]:
        best = ""
        lead = (
            f"No other method agrees with {reference}, the reference{_known(errors[reference])}: rely on none of them "
            "before the reasons below are understood."
        )
    else:
        best = _cheapest(fit, errors, costs)
        lead = f"Use {best}: {_reasons(best, reference, errors, comparison, costs)}."
    others = [_other(m, reference, found[m], errors[m]) for m in methods if m not in (best, reference)]
    return (lead, *others)


def _error(comparison: xr.Dataset, method: str) -> float:
    values = comparison["own_error"].sel({"method": method}).values
    return float(np.max(values)) if np.isfinite(values).all() else math.inf


def _costs(comparison: xr.Dataset) -> dict[str, float]:
    """Return what methods cost: wall times, or realisations where a wall time is not known."""
    methods = [str(m) for m in comparison["method"].values]
    times = comparison["wall_time"].values
    used = times if np.all(np.isfinite(times) & (times > 0)) else comparison["realisations"].values
    return dict(zip(methods, (float(v) for v in used), strict=True))


def _cheapest(methods: list[str], errors: dict[str, float], costs: dict[str, float]) -> str:
    for limit in (GOOD, FAIR):
        enough = [m for m in methods if errors[m] <= limit]
        if enough:
            return min(enough, key=lambda m: costs[m])
    return min(methods, key=lambda m: (errors[m], costs[m]))


def _known(error: float) -> str:
    if not math.isfinite(error):
        return ""
    return f" (own error, averaged over time, {_below(error)} of the standard deviation)"


def _below(error: float) -> str:
    """Write a bound, rounded up to 1, 2 or 5: an error is not known better.

    >>> _below(0.00034), _below(0.047), _below(2e-9), _below(0.13)
    ('below 0.05 %', 'below 5 %', 'below 0.001 %', 'below 20 %')
    """
    if error >= 1:
        return f"about {percent(error)}"
    for exponent in range(-5, 0):
        for step in (1, 2, 5, 10):
            if error <= step * 10.0**exponent:
                return f"below {100 * step * 10.0**exponent:g} %"
    return f"about {percent(error)}"


def _reasons(
    best: str, reference: str, errors: dict[str, float], comparison: xr.Dataset, costs: dict[str, float]
) -> str:
    agrees = f"it agrees with {reference}" if best != reference else "it is the reference, with which the others agree"
    parts = [agrees]
    if math.isfinite(errors[best]):
        parts.append(f"its own error, averaged over time, is {_below(errors[best])} of the standard deviation")
    other = reference if best != reference else max(costs, key=lambda m: costs[m])
    if other != best and costs[best] > 0 and costs[other] > 1.05 * costs[best]:
        ratio = costs[other] / costs[best]
        times = f"{ratio:.0f}" if ratio >= 9.95 else f"{ratio:.2g}"
        parts.append(f"it is {times} times cheaper than {other} ({_compared(comparison, best, other)})")
    return parts[0] if len(parts) == 1 else ", ".join(parts[:-1]) + f"{',' if len(parts) > 2 else ''} and {parts[-1]}"


def _compared(comparison: xr.Dataset, one: str, other: str) -> str:
    first, second = (comparison.sel({"method": m}) for m in (one, other))
    times = [float(d["wall_time"]) for d in (first, second)]
    counts = [int(d["realisations"]) for d in (first, second)]
    said = []
    if all(math.isfinite(t) and t > 0 for t in times):
        said.append(f"{_duration(times[0])} instead of {_duration(times[1])}")
    said.append(f"{counts[0]} realisations instead of {counts[1]}")
    return "; ".join(said)


def _duration(seconds: float) -> str:
    if seconds < 1:
        return f"{1000 * seconds:.0f} ms"
    if seconds < 60:
        return f"{seconds:.2g} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def _other(method: str, reference: str, found: tuple[str, str, str], error: float) -> str:
    kind, text, which = found
    if kind == AGREES:
        return f"{method} agrees with {reference}{_known(error)}."
    where = f" ({which})" if which else ""
    said = {DIFFERS: f" from {reference}"}.get(kind, "")
    head, _, tail = text.partition(":")
    verb = {UNDER_RESOLVED: "is ", FEW: "has "}.get(kind, "")
    return f"{method}{where} {verb}{head}{said}:{tail}." if tail else (
        f"{method}{where}: {text}."
    )  # fmt: skip
