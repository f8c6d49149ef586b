"""Spectral moments of responses by quadrature over frequency, for all realisations, with an error estimate.

The axis is divided between the natural frequencies.  Around each of them ``w = w_i + s_i sinh(u)``, with the decay rate
``s_i``, turns a resonance into a smooth function of ``u``, however small its damping is.  Composite Gauss rules are
halved until two of them agree.  Beyond the first and the last interval, the integrand is a power of the frequency,
which is integrated in closed form; an integrand without a finite integral is rejected.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import uqmbd
from uqmbd_processes.lyapunov import inverses

__all__ = ["TOLERANCE", "density_of_response", "integrate_moments"]

if TYPE_CHECKING:
    from uqmbd.extend import LinearSystem

Array = NDArray[np.float64]

TOLERANCE = 1e-6
"""Largest relative error of a moment."""

ORDER = 12
"""Number of points of a panel."""

PANELS, MOST_PANELS = 2, 256
"""Smallest and largest number of panels of an interval."""

FAR = 1e4
"""Ratio of the first and last frequency of the quadrature to the smallest and largest rate."""

MARGIN = 0.02
"""Least distance of the exponent of the integrand from -1, at which the integral diverges."""

POINTS = 4_000_000
"""Largest number of evaluated frequencies at once."""


def density_of_response(system: LinearSystem, source: Any, channels: Sequence[int], frequencies: Array) -> Array:
    """Return the two-sided density per rad/s (K, F) of the response to one process, at frequencies (K, F), rad/s."""
    transfer = system.transfer(frequencies)
    speed = system.channels[channels[0]].speed[:, None]
    rate = np.abs(speed)
    # compute a response to the process at each point, because points are only partly coherent
    points: dict[tuple[float, ...], tuple[Any, Any]] = {}
    for k in channels:
        channel = system.channels[k]
        phase = frequencies * channel.offset[:, None] / speed if len(channels) > 1 else 0.0
        _, before = points.get(channel.source.point, (None, 0.0))
        points[channel.source.point] = channel.source, before + transfer[:, :, k] * np.exp(1j * phase)
    at = list(points.values())
    total = np.zeros(frequencies.shape)
    for k, (one, response) in enumerate(at):
        total += np.abs(response) ** 2
        for other, again in at[:k]:
            total += 2 * np.real(response * np.conj(again)) * one.coherence_with(other, frequencies / rate)
    return np.asarray(np.maximum(total, 0.0) * source.two_sided(frequencies / rate) / rate)


def integrate_moments(
    system: LinearSystem, source: Any, channels: Sequence[int], orders: Sequence[int], tolerance: float = TOLERANCE
) -> tuple[dict[int, Array], list[str]]:
    """Return the moments ``2 int w^k S dw`` over positive frequencies by order k, and reasons for NaN.

    `tolerance`: largest relative error.
    """
    count = len(system)
    result = {k: np.full(count, np.nan) for k in orders}
    reasons = [""] * count
    members = np.arange(count)
    before: dict[int, Array] = {}
    panels = PANELS
    grid = _FrequencyIntervals(system, source, channels)
    ends, beyond, refused = _tails(grid, orders)
    for k, reason in enumerate(refused):
        reasons[k] = reason
    members = np.array([k for k in members.tolist() if not reasons[k]], dtype=np.int64)
    fixed = grid.rounding(members, orders)
    fixed = {k: fixed[k] + beyond[k][members] for k in orders}
    while len(members):
        now = {k: found + ends[k][members] for k, found in grid.moments(members, panels, orders).items()}
        if before:
            scale = {k: np.where(now[k] == 0, 1.0, now[k]) for k in orders}
            steps = np.max([np.abs(now[k] - before[k]) / scale[k] for k in orders], axis=0)
            errors = steps + np.max([fixed[k] / scale[k] for k in orders], axis=0)
            good = steps <= tolerance / 10
            if panels >= MOST_PANELS:
                good[:] = True
            for member, error in zip(members[good].tolist(), errors[good].tolist(), strict=True):
                if not error <= tolerance:
                    reasons[member] = (
                        f"the quadrature of {system.name} over frequency has the relative error {error:.3g}, above "
                        f"{tolerance:g}; check the spectral density for jumps and narrow "
                        "peaks, and the mechanism for very different rates"
                    )
            for k in orders:
                result[k][members[good]] = now[k][good]
            now, fixed = ({k: found[~good] for k, found in x.items()} for x in (now, fixed))
            members = members[~good]
        before, panels = now, 2 * panels
    for k in orders:
        result[k][[bool(reason) for reason in reasons]] = np.nan
    return result, reasons


class _FrequencyIntervals:
    """Intervals of the quadrature of K realisations."""

    def __init__(self, system: LinearSystem, source: Any, channels: Sequence[int]) -> None:
        self.system, self.source, self.channels = system, source, channels
        speed = np.abs(system.channels[channels[0]].speed)
        values = system.eigenvalues
        sizes = np.maximum(np.abs(values), 1e-300)
        centres, widths = np.abs(values.imag), np.maximum(np.abs(values.real), 1e-9 * sizes)
        rates = sizes
        if math.isfinite(source.corner):
            corner = (source.corner * speed)[:, None]
            centres, widths = np.hstack([centres, corner]), np.hstack([widths, corner * source.corner_width])
            rates = np.hstack([rates, corner])
        if not rates.shape[1]:  # the response follows the process directly
            rates = speed[:, None] * min(max(source.band[0], 1.0), source.band[1])
            centres, widths = np.zeros_like(rates), rates
        low, high = (x * speed for x in source.band)
        self.low = np.where(low > 0, low, rates.min(axis=1) / FAR)
        self.high = np.where(np.isfinite(high), high, rates.max(axis=1) * FAR)
        self.open_low, self.open_high = source.band[0] == 0, math.isinf(source.band[1])
        order = np.argsort(centres, axis=1)
        self.centres, self.widths = (np.take_along_axis(x, order, axis=1) for x in (centres, widths))
        inner = (self.centres[:, 1:] + self.centres[:, :-1]) / 2
        first = np.minimum(rates.min(axis=1), np.where(self.centres[:, 0] > 0, self.centres[:, 0], np.inf)) / 2
        bounds = np.hstack([self.low[:, None], first[:, None], np.maximum(inner, first[:, None]), self.high[:, None]])
        self.bounds = np.clip(bounds, self.low[:, None], self.high[:, None])
        self.modal = _modal_errors(system)

    def density(self, frequencies: Array, members: NDArray[np.int64] | None = None) -> Array:
        """Return the density of the response of members at frequencies (K, F)."""
        system = self.system if members is None else select(self.system, members)
        return density_of_response(system, self.source, self.channels, frequencies)

    def moments(self, members: NDArray[np.int64], panels: int, orders: Sequence[int]) -> dict[int, Array]:
        """Return the moments within the bounds, with a number of panels of each interval."""
        intervals = self.bounds.shape[1] - 1
        per = max(1, POINTS // (intervals * panels * ORDER))
        parts = [self._moments(members[k : k + per], panels, orders) for k in range(0, len(members), per)]
        return {k: np.concatenate([part[k] for part in parts]) for k in orders}

    def rounding(self, members: NDArray[np.int64], orders: Sequence[int]) -> dict[int, Array]:
        """Return the errors of the moments by rounding of the eigenvalues and eigenvectors, to first order."""
        frequencies, factors = self._nodes(members, 2 * PANELS)
        values, seen, driven, errors = (x[members] for x in self.modal)
        gain = 1 / (1j * frequencies[:, :, None] - values[:, None, :])
        change = np.einsum("kfi,kij,kfj,kjc->kfc", gain * seen[:, None, :], errors, gain, driven, optimize=True)
        system = select(self.system, members)
        speed = np.abs(system.channels[self.channels[0]].speed)[:, None]
        source = self.source.two_sided(frequencies / speed) / speed
        change, response = (x[:, :, self.channels] for x in (change, system.transfer(frequencies)))
        first, second = np.real(change * np.conj(response)), np.abs(change) ** 2
        if len(self.channels) > 1:  # phases differ between points: bound the sum by absolute values
            first = (np.abs(change).sum(axis=2) * np.abs(response).sum(axis=2))[:, :, None]
            second = second * len(self.channels)
        scale = source * factors
        found: dict[int, Array] = {}
        for k in orders:
            parts = [np.abs((x.sum(axis=2) * scale * frequencies**k).sum(axis=1)) for x in (first, second)]
            found[k] = 8 * parts[0] + 4 * parts[1]
        return found

    def _moments(self, members: NDArray[np.int64], panels: int, orders: Sequence[int]) -> dict[int, Array]:
        frequencies, factors = self._nodes(members, panels)
        density = 2 * self.density(frequencies, members) * factors
        return {k: (density * frequencies**k).sum(axis=1) for k in orders}

    def _nodes(self, members: NDArray[np.int64], panels: int) -> tuple[Array, Array]:
        """Return the nodes and weights (K, F) with a number of panels of each interval."""
        nodes, weights = np.polynomial.legendre.leggauss(ORDER)
        unit = ((np.arange(panels)[:, None] + (nodes + 1) / 2) / panels).ravel()
        weight = np.tile(weights / 2 / panels, panels)
        bounds, centres, widths = self.bounds[members], self.centres[members], self.widths[members]
        begin, end = np.log(bounds[:, :1]), np.log(bounds[:, 1:2])
        places = [np.exp(begin + (end - begin) * unit)]
        slopes = [places[0] * (end - begin) * weight]
        for k in range(centres.shape[1]):
            centre, width = centres[:, k, None], widths[:, k, None]
            u0, u1 = (np.arcsinh((bounds[:, k + i, None] - centre) / width) for i in (1, 2))
            u = u0 + (u1 - u0) * unit
            places.append(np.maximum(centre + width * np.sinh(u), 0.0))
            slopes.append(width * np.cosh(u) * (u1 - u0) * weight)
        return np.hstack(places), np.hstack(slopes)


def _modal_errors(system: LinearSystem) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return eigenvalues, outputs and inputs of the modes, and the error of the modal matrix by extended precision."""
    values, right = np.linalg.eig(system.a)
    left = inverses(right)
    wide = right.astype(np.clongdouble)
    residual = (system.a.astype(np.longdouble) @ wide - wide * values[:, None, :]).astype(complex)
    left[system.defective] = 0.0  # these systems are solved at each frequency instead
    return values, (system.c[:, None, :] @ right)[:, 0], left @ system.b, left @ residual


def select(system: LinearSystem, members: NDArray[np.int64]) -> LinearSystem:
    """Return the systems of the selected realisations."""
    if len(members) == len(system):
        return system
    from dataclasses import replace

    channels = tuple(replace(c, speed=c.speed[members], offset=c.offset[members]) for c in system.channels)
    parts = {name: getattr(system, name)[members] for name in ("a", "b", "c", "e", "mean")}
    return uqmbd.extend.LinearSystem(**parts, channels=channels, name=system.name)


WORDS = {0: "variance", 1: "variance", 2: "variance of its rate", 4: "variance of its second rate"}
"""Name of the quantity of each order, for messages."""


def _tails(grid: _FrequencyIntervals, orders: Sequence[int]) -> tuple[dict[int, Array], dict[int, Array], list[str]]:
    """Return the integrals beyond the bounds, their errors, and reasons of realisations without an integral."""
    count = len(grid.system)
    found, errors = ({k: np.zeros(count) for k in orders} for _ in range(2))
    reasons = [""] * count
    for is_open, edge, sign in ((grid.open_low, grid.low, 1.0), (grid.open_high, grid.high, -1.0)):
        if not is_open:
            continue
        at = np.stack([edge, edge * 10.0**sign, edge * 100.0**sign], axis=1)
        density = grid.density(at)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope, further = (np.diff(np.log(density), axis=1) / np.diff(np.log(at), axis=1)).T
        nothing = (density[:, :2] <= 0).any(axis=1)
        for order in orders:
            exponent = np.where(nothing, -np.inf if sign < 0 else 0.0, slope + order)
            room = sign * (exponent + 1)
            usable = room > MARGIN
            with np.errstate(invalid="ignore"):
                share = 2 * density[:, 0] * edge ** (order + 1) / np.where(usable, room, 1.0)
                change = np.nan_to_num(np.abs(share * (further - slope) / np.where(usable, room, 1.0)), posinf=0.0)
            found[order] += np.where(nothing, 0.0, share)
            errors[order] += np.where(nothing, 0.0, change)
            for k in np.flatnonzero(~usable).tolist():
                which = "high" if sign < 0 else "low"
                reasons[k] = reasons[k] or (
                    f"{grid.system.name} has no {WORDS.get(order, 'spectral moment')}: its response to the random "
                    f"process {grid.source.name!r} does not decay towards {which} frequencies; give the process a "
                    f"band, or filter it"
                )
    return found, errors, reasons
