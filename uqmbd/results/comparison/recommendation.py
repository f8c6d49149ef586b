"""Which method to use, in words, with the reasons."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.results.comparison.integration_share import integration_shares
from uqmbd.results.comparison.verdicts import AGREES, DIFFERS, FEW, NO_SPREAD, REFERENCE, UNDER_RESOLVED
from uqmbd.wording import format_at_most, format_percent

__all__ = ["largest_error_words", "loose", "overall", "recommend", "recommended"]

GOOD, FAIR = 0.01, 0.05
"""Own errors, relative to the standard deviation: enough for nearly all purposes, and for most."""

SAME = 1e-9
"""Differences of results, over the largest standard deviation, that are rounding."""

AS_DEAR, AS_DEAR_TO_RUN = 1.25, 2.0
"""Ratios of costs up to which none is cheaper: of any, and of wall times for equal numbers of realisations."""

AS_GOOD = 1.5
"""Ratio of own errors up to which none is smaller."""

_ORDER = (DIFFERS, UNDER_RESOLVED, FEW, AGREES, REFERENCE, NO_SPREAD)


def overall(comparison: xr.Dataset, method: str) -> tuple[str, str, str]:
    """Return the worst verdict of a method: its kind, its words, and the outputs that share the kind.

    Outputs that do not vary count for nothing.  Of a method that agrees the third is the output with the largest error.

    Parameters
    ----------
    comparison : xarray.Dataset
        From :func:`uqmbd.results.compare`.
    method : str
        A label.

    Raises
    ------
    uqmbd.StudyError
        If a verdict is of an unknown kind, as in a file that was changed.

    Examples
    --------
    >>> import chaospy
    >>> import uqmbd
    >>> from uqmbd.results.comparison import overall
    >>> from uqmbd_collocation import Collocation
    >>> from uqmbd_montecarlo import MonteCarlo
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> mechanism.output("height", stone.position[0], units="m")
    >>> methods = [Collocation(order=1), MonteCarlo(samples=40, seed=2)]
    >>> tree = uqmbd.Study("throw", mechanism, [0, 1], methods).run()
    >>> kind, words, outputs = overall(tree["comparison"].to_dataset(), "monte-carlo")
    >>> kind
    'too few samples'
    """
    row = comparison.sel({"method": method})
    kinds = [str(kind) for kind in row["verdict_kind"].values]
    if unknown := set(kinds) - set(_ORDER):
        raise StudyError(f"comparison: verdict_kind is {min(unknown)!r}; expected one of {', '.join(_ORDER)}.")
    worst = min(kinds, key=_ORDER.index)
    shared = [k for k, kind in enumerate(kinds) if kind == worst]
    # in words the output of the largest error or difference, relative to its scale
    if worst in (AGREES, REFERENCE) and "stated_error_max" in row:
        size = row["stated_error_max"].values
    else:
        off = np.hypot(row["mean_difference_l2"].values, row["std_difference_l2"].values)
        scale = comparison["reference_std_max"].values
        size = np.nan_to_num(off / np.where(scale > 0, scale, np.inf), nan=0.0)
    first = max(shared, key=lambda k: size[k])
    names = [str(comparison["output"].values[k]) for k in sorted(shared, key=lambda k: k != first)]
    if worst in (AGREES, REFERENCE):
        which = f"the worst: {names[0]}" if len(names) > 1 else ""
    elif len(shared) == len(kinds) - kinds.count(NO_SPREAD):
        which = ""
    else:
        which = ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
    return worst, str(row["verdict"].values[first]), which


def loose(nodes: Mapping[str, xr.DataTree]) -> tuple[str, ...]:
    """Say that the time integration is too coarse for any recommendation, in a sentence, or nothing.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
        Methods by label.
    """
    shares = [
        (one, label)
        for label, node in nodes.items()
        for one in integration_shares(node.children["statistics"].to_dataset())
        if one.varies and one.share > FAIR
    ]
    if not shares:
        return ()
    worst, label = max(shares, key=lambda pair: pair[0].share)
    return (
        f"Lower rtol first: the error of the time integration is up to {format_percent(worst.share)} of the standard "
        f"deviation (of {worst.output}, with {label}), which the errors stated below do not hold.",
    )


def recommend(comparison: xr.Dataset) -> tuple[str, ...]:
    """Recommend a method, in sentences that can be read in a minute.

    The cheapest whose every output that varies is known at all times and agrees with the reference, and whose own error
    is at most 1 % of the standard deviation, or at most 5 %, or the least; then what is to be said of the others.  Of
    methods that differ by chance only, in cost and error, none is preferred.

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
    >>> from uqmbd.results import compare, propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels(["x"], [], [0.0, 1.0])
    >>> def node(label, std, cost, error):
    ...     known = {"std_error_mean": [[error, error]], "std_error_std": [[error, error]]}
    ...     statistics = statistics_dataset(axes, mean=[[0.0, 0.0]], std=[[std, std]], **known)
    ...     return propagator_node(label, statistics, propagator="p", realisations=cost, wall_time=0.01 * cost)
    >>> for sentence in recommend(compare([node("many", 1.0, 10000, 0.01), node("few", 0.99, 1000, 0.02)])):
    ...     print(sentence)
    Use few: it agrees with many, its stated error is at most 4.0 % of the standard deviation (at 0 s), and it is 10
    times cheaper than many (10 s instead of 1 min 40 s; 1000 realisations instead of 10000).
    """
    methods = [str(m) for m in comparison["method"].values]
    if len(methods) < 2 or "verdict" not in comparison or not comparison.sizes["output"]:
        return ()
    reference = str(comparison.attrs["reference"])
    found = {m: overall(comparison, m) for m in methods}
    errors = {m: _error(comparison, m) for m in methods}
    costs = _costs(comparison)
    if all(found[m][0] == NO_SPREAD for m in methods):
        return ("No output varies beyond the integration error: one realisation tells as much as any method.",)
    fit, equal, best = _choice(comparison, found, errors, costs)
    if not fit:
        lead = "Use none: there is none that knows all its statistics at all times and agrees with the reference."
    elif not equal:
        holed = any(_unknown(comparison, m) for m in methods)
        whole = ", and knows its statistics at all times" if holed else ""
        if any(found[m][0] == DIFFERS for m in methods) or holed:
            lead = (
                f"No other method agrees with {reference}, the reference{_known(comparison, reference)}{whole}: rely "
                "on none of them before the reasons below are understood."
            )
        else:
            lead = _unresolved(comparison, reference)
    elif not best:
        lead = (
            f"{_listed(methods, 'and')} are the same: equal results from equal numbers of realisations. Nothing speaks "
            f"for one of them{_known(comparison, reference)}."
        )
    else:
        lead = f"Use {_listed(equal, 'or')}: {_reasons(equal, fit, best, comparison, costs)}."
    others = [_other(comparison, m, reference, found[m]) for m in methods if m not in (*equal, reference)]
    if unknown := _unknown(comparison, reference):
        others.append(f"{reference}, the reference, {unknown}.")
    return (lead, *others)


def _unresolved(comparison: xr.Dataset, reference: str) -> str:
    """Say that no method checks the reference in all outputs, and which do in some."""
    kinds = comparison["verdict_kind"].transpose("output", "method")
    names = [str(name) for name in comparison["output"].values]
    agree = [str(m) for m in comparison["method"].values if (kinds.sel({"method": m}) == AGREES).any()]
    still = (kinds.sel({"method": reference}) == NO_SPREAD).values
    alone = (~(kinds == AGREES).any("method").values) & ~still
    lead = f"No other method is resolved well enough to check {reference}, the reference"
    rely = "rely on it as far as its stated error allows, and not on the others"
    if not agree or not alone.any():
        return f"{lead}{_known(comparison, reference)}: {rely}."
    on: dict[tuple[str, ...], list[str]] = {}
    for m in agree:
        of = kinds.sel({"method": m}).values
        on.setdefault(tuple(name for name, kind in zip(names, of, strict=True) if kind == AGREES), []).append(m)
    parts = [
        f"{_listed(ms, 'and')} agree{'s' if len(ms) == 1 else ''} with it on {_listed(_few(list(of)), 'and')}"
        for of, ms in on.items()
    ]
    missing = _few([name for name, is_alone in zip(names, alone, strict=True) if is_alone])
    known = _known(comparison.isel(output=alone), reference)
    return f"{lead}, on {_listed(missing, 'and')}{known}: {rely}. {_listed(parts, 'and')}."


def _few(names: list[str]) -> list[str]:
    """Return at most three names, and how many more there are."""
    return names if len(names) <= 3 else [*names[:2], f"{len(names) - 2} more"]


def recommended(comparison: xr.Dataset) -> tuple[str, ...]:
    """Return the methods that :func:`recommend` says to use, by their labels.

    Several where nothing speaks for one of them; none where it says to use none, or compares none.
    """
    methods = tuple(str(m) for m in comparison["method"].values)
    if "recommended" in comparison.attrs:  # also where outputs without a time have been compared
        return tuple(str(label) for label in json.loads(comparison.attrs["recommended"]))
    if len(methods) < 2 or "verdict" not in comparison or not comparison.sizes["output"]:
        return ()
    found = {m: overall(comparison, m) for m in methods}
    if all(kind == NO_SPREAD for kind, _, _ in found.values()):
        return methods
    errors = {m: _error(comparison, m) for m in methods}
    return tuple(_choice(comparison, found, errors, _costs(comparison))[1])


def _choice(
    comparison: xr.Dataset,
    found: Mapping[str, tuple[str, str, str]],
    errors: dict[str, float],
    costs: dict[str, float],
) -> tuple[list[str], list[str], str]:
    """Return which methods can be relied on, which of them to use, and the cheapest; empty: none, or all the same."""
    reference = str(comparison.attrs["reference"])
    fit = [m for m in found if found[m][0] in (AGREES, REFERENCE, NO_SPREAD) and not _unknown(comparison, m)]
    if not fit or fit == [reference]:
        return fit, [], ""
    same = _same(comparison, reference)
    if len(same) == len(found):
        return fit, list(found), ""
    best = _cheapest(fit, errors, costs)
    return fit, [m for m in fit if m == best or _equal(m, best, same, errors, costs, comparison)], best


def _unknown(comparison: xr.Dataset, method: str) -> str:
    """Say at how many times a method does not know its statistics, or nothing."""
    count = int(comparison["unknown_times"].sel({"method": method})) if "unknown_times" in comparison else 0
    return f"does not know its mean or standard deviation at {count} time{'' if count == 1 else 's'}" if count else ""


def _listed(names: list[str], last: str) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {last} {names[-1]}"


def _same(comparison: xr.Dataset, reference: str) -> list[str]:
    """Return the reference and the methods whose results and numbers of realisations are the same."""
    scale = comparison["reference_std_max"].values
    base = comparison.sel({"method": reference})
    found = []
    for method in (str(m) for m in comparison["method"].values):
        row = comparison.sel({"method": method})
        off = [row[f"{name}_difference_max"].values for name in ("mean", "std")]
        still = row["verdict_kind"].values == NO_SPREAD
        if all(np.all(still | (d <= SAME * scale)) for d in off) and row["realisations"] == base["realisations"]:
            found.append(method)
    return found


def _equal(
    one: str,
    best: str,
    same: list[str],
    errors: dict[str, float],
    costs: dict[str, float],
    comparison: xr.Dataset,
) -> bool:
    """Tell whether two methods that agree are as good and as dear as each other, but for chance."""
    if one in same and best in same:
        return True
    counts = [int(comparison["realisations"].sel({"method": m})) for m in (one, best)]
    ratio = AS_DEAR_TO_RUN if counts[0] == counts[1] else AS_DEAR
    dear = costs[one] <= ratio * costs[best]
    both = max(errors[one], errors[best])
    return dear and math.isfinite(both) and (both <= GOOD or both <= AS_GOOD * min(errors[one], errors[best]))


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


def _known(comparison: xr.Dataset, method: str) -> str:
    words = _largest(comparison, method)
    return f" ({words})" if words else ""


def _largest(comparison: xr.Dataset, method: str) -> str:
    """Say the largest error that a method states of any output; empty where it does not state it of all."""
    row = comparison.sel({"method": method})
    errors, times = row["stated_error_max"].values, row["stated_error_time"].values
    if not np.isfinite(errors).all():
        return ""
    worst = int(errors.argmax())
    names = row["output"].values
    return largest_error_words(float(errors[worst]), float(times[worst]), str(names[worst]) if len(names) > 1 else "")


def largest_error_words(share: float, time: float, output: str = "") -> str:
    """Say the largest error that a method states, as a share of the standard deviation.

    Parameters
    ----------
    share : float
    time : float
        When, s; NaN of an output without a time.
    output : str
        Of which output, where it is one of several.

    Examples
    --------
    >>> largest_error_words(0.02, 0.5), largest_error_words(0.02, math.nan, "x")
    ('stated error at most 2.0 % of the standard deviation (at 0.5 s)',
     'stated error at most 2.0 % of the standard deviation (of x)')
    """
    where = [f"of {output}"] if output else []
    where += [f"at {time:g} s"] if math.isfinite(time) else []
    whose = f" ({', '.join(where)})" if where else ""
    return f"stated error {format_at_most(share)} of the standard deviation{whose}"


def _reasons(equal: list[str], fit: list[str], best: str, comparison: xr.Dataset, costs: dict[str, float]) -> str:
    reference = str(comparison.attrs["reference"])
    if len(equal) > 1:
        parts = ["they agree" if reference in equal else f"they agree with {reference}"]
        parts += [f"{m}: {words}" for m in equal if (words := _largest(comparison, m))]
        return "; ".join((*parts, "what they cost differs by no more than chance"))
    others = [m for m in fit if m != reference]
    agree = f"with which {_listed(others, 'and')} {'agrees' if len(others) == 1 else 'agree'}"
    parts = [f"it agrees with {reference}" if best != reference else f"it is the reference, {agree}"]
    if words := _largest(comparison, best):
        parts.append(f"its {words.replace('stated error', 'stated error is', 1)}")
    other = reference if best != reference else max(costs, key=lambda m: costs[m])
    if other != best and costs[best] > 0 and costs[other] > 1.05 * costs[best]:
        ratio = costs[other] / costs[best]
        times = f"{ratio:.0f}" if ratio >= 9.95 else f"{ratio:.2g}"
        parts.append(f"it is {times} times cheaper than {other} ({_compared(comparison, best, other)})")
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])}, and {parts[-1]}"


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


def _other(comparison: xr.Dataset, method: str, reference: str, found: tuple[str, str, str]) -> str:
    kind, text, which = found
    if kind in (AGREES, NO_SPREAD) and (unknown := _unknown(comparison, method)):
        return f"{method} {unknown}; at the others it agrees with {reference}{_known(comparison, method)}."
    if kind in (AGREES, NO_SPREAD):
        return f"{method} agrees with {reference}{_known(comparison, method)}."
    where = f" ({which})" if which else ""
    said = {DIFFERS: f" from {reference}"}.get(kind, "")
    head, _, tail = text.partition(":")
    verb = {UNDER_RESOLVED: "is ", FEW: "has "}.get(kind, "")
    return f"{method}{where} {verb}{head}{said}:{tail}." if tail else (
        f"{method}{where}: {text}."
    )  # fmt: skip
