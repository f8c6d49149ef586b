"""Compute the decay of the coefficients of a chaos with their order, and describe the accuracy of the chaos."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from uqmbd.results.chaos.stated_error import exceeds_locally, first_above, reference_spread, spread_words
from uqmbd.results.chaos.terms import constant_columns, standard_deviation
from uqmbd.results.schema import Labels, fixed_width, united
from uqmbd.results.statistics import divisor
from uqmbd.typing import Array, Index, Mask
from uqmbd.wording import format_at_most, format_part

__all__ = [
    "decay_dataset",
    "decay_rate",
    "energy_of_germs",
    "energy_of_orders",
    "top_order",
    "verdict_of_decay",
]


# Amplitudes below this fraction of the standard deviation are rounding errors, which do not decay.
_ROUNDING = 1e-14


def energy_of_orders(coefficients: Array, multi_index: Index) -> Array:
    """Return the sum of squared coefficients (N + 1, ...) of each total degree 0..N."""
    totals = multi_index.sum(axis=1)
    return _sums(coefficients, totals, int(totals.max()))


def energy_of_germs(coefficients: Array, multi_index: Index) -> Array:
    """Return the sum of squared coefficients (d, N + 1, ...) of the degrees 0..N in each germ."""
    top = int(multi_index.max(initial=0))
    return np.stack([_sums(coefficients, degrees, top) for degrees in multi_index.T])


def decay_rate(energy: Array) -> Array:
    """Fit the decay rate (...) of the energy (N + 1, ...), in decades of standard deviation per order.

    A line is fitted by least squares to the logarithm of the standard deviation in the terms of order n and above, for
    n = 1 .. N. This tail also decreases for odd and even responses. The rate is NaN if fewer than two orders have
    energy.
    """
    tail = np.sqrt(np.cumsum(energy[:0:-1], axis=0)[::-1])
    orders = np.arange(1.0, len(tail) + 1).reshape(-1, *[1] * (tail.ndim - 1))
    used = (tail > _ROUNDING * tail.max(axis=0, initial=0.0)) & (tail > np.finfo(float).tiny)
    count = used.sum(axis=0)
    logs = np.log10(np.where(used, tail, 1.0))
    mean = np.where(used, orders, 0.0).sum(axis=0) / np.maximum(count, 1)
    away = np.where(used, orders - mean, 0.0)
    spread = (away**2).sum(axis=0)
    slope = (away * logs).sum(axis=0) / divisor(spread)
    return np.where(count >= 2, -slope + 0.0, np.nan)


def decay_dataset(
    labels: Labels,
    germ_names: Sequence[str],
    energy: Array,
    by_germ: Array,
    constant: Mask,
    *,
    energy_note: str,
    rate_note: str,
) -> xr.Dataset:
    """Build a dataset of energies and decay rates.

    `energy` (N + 1, O, T): energy by order; `by_germ` (d, N + 1, O, T): energy by degree in each germ; `constant`
    (O, T): mask of constant outputs, whose rate is NaN; `energy_note`, `rate_note`: attributes.
    """
    dims, note = labels.dims, {"long_name": energy_note}
    rate = np.where(constant, np.nan, decay_rate(energy))
    return united(
        xr.Dataset(
            {
                "energy": (("order", *dims), energy, note),
                "energy_germ": (("germ", "degree", *dims), by_germ, note),
                "rate": (dims, rate, {"long_name": "decay per order", "comment": rate_note}),
            },
            coords={
                **labels.output_coords(),
                "order": np.arange(len(energy)),
                "germ": ("germ", fixed_width(germ_names)),
                "degree": np.arange(by_germ.shape[1]),
            },
        )
    )


def top_order(multi_index: Index) -> tuple[int, Mask]:
    """Return the largest degree of any input in an index set, and the mask (P,) of terms on the edge of the set."""
    # the edge consists of the terms of largest total degree, and of the terms in which an input has its largest degree:
    # the terms of order N in a total-degree set, the outer faces in a tensor set
    tops = multi_index.max(axis=0, initial=0)
    totals = multi_index.sum(axis=1)
    edge = np.any((multi_index == tops) & (multi_index > 0), axis=1) | ((totals == totals.max()) & (totals > 0))
    return int(tops.max(initial=0)), edge


def verdict_of_decay(
    name: str,
    coefficients: Array,
    multi_index: Index,
    germs: Sequence[str],
    times: Array | None,
    tolerance: float,
) -> str:
    """Return a text on the decay of the coefficients (P, T), or (P,) without times."""
    order, edge = top_order(multi_index)
    if order == 0:
        return f"{name}: order 0 contains only the mean, no spread; raise the order"
    columns = np.ascontiguousarray(coefficients.reshape(len(coefficients), -1))
    std = standard_deviation(columns)
    std[constant_columns(columns[0], std, len(columns))] = 0.0
    spread = reference_spread(std)
    share = np.where(std > 0, np.sqrt(np.sum(columns[edge] ** 2, axis=0)) / divisor(spread), 0.0)
    worst = int(share.argmax())
    whole = spread_words(times is not None and exceeds_locally(share, std, float(share[worst])))
    amount = format_part(float(share[worst]), whole)
    at = "" if times is None else f" at {times[worst]:g} s"
    if share[worst] <= tolerance:
        return (
            f"{name}: the terms of order {order} contribute {format_at_most(float(share[worst]), whole)}{at}. This "
            "indicates that the order is sufficient, but only verification realisations can prove it"
        )
    by_germ = [float(np.sum(columns[edge & (degrees > 0), worst] ** 2)) for degrees in multi_index.T]
    where = f"{amount} is in the terms of the highest order{at}, mostly of {germs[int(np.argmax(by_germ))]}"
    if times is None:
        return f"order {order} is not enough for {name}: {where}; raise the order"
    fine = np.flatnonzero(share <= tolerance)
    since = int(fine[-1]) + 1 if fine.size else 0
    if since == len(share):
        first = first_above(share, tolerance)
        when = f"at some times from {times[first or 0]:g} s on"
    else:
        when = f"after {times[since]:g} s" if since else "at any time"
    return f"order {order} is not enough for {name} {when}: {where}; raise the order"


def _sums(coefficients: Array, groups: Index, top: int) -> Array:
    """Return the sums (top + 1, ...) of squared coefficients (P, ...) by group; `groups` (P,) are numbers 0..top."""
    squares = coefficients.reshape(len(coefficients), -1) ** 2
    found = np.stack([squares[groups == n].sum(axis=0) for n in range(top + 1)])
    return found.reshape(top + 1, *coefficients.shape[1:])
