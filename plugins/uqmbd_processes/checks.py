"""Checks of studies with random processes."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy
from numpy.typing import NDArray

import uqmbd
from uqmbd_processes.densities import PowerSpectralDensity
from uqmbd_processes.paths import KNOTS_PER_WAVE
from uqmbd_processes.process import RandomProcess
from uqmbd_processes.spectral_moments import moments

__all__ = ["LostVariance", "UnusedProcesses"]

if TYPE_CHECKING:
    from uqmbd.extend import LinearSystem

MUCH = 0.01
"""Share of the variance above the cutoff that outputs lose; a cutoff with a larger share is probably a mistake."""


LITTLE = 1e-3
"""Share of the variance that outputs may lose by a suggested lower cutoff."""

FACTORS = (1.0, 0.5, 0.25, 0.125, 0.0625, 0.03125, 0.015625)
"""Cutoffs, relative to those of the study, whose losses are computed."""

ROUGH = 1e-4
"""Largest relative error of the variances from which the lost shares are computed."""

APART = 1e-12
"""Response, relative to the largest state, that counts as a rounding error."""

REMEDY = "Give the process a higher cutoff=, or a spectrum with a lower band"
"""Advice for paths that change much of a variance."""

NONE = "its linear response is zero"

UNITS = {"distance": "cycle/m", "time": "Hz"}
"""Unit of the frequency of a process."""


class UnusedProcesses:
    """Find random processes that act on a mechanism whose outputs do not depend on them."""

    def find(self, study: Any) -> Iterator[uqmbd.extend.Finding]:
        """Yield a finding for each process of each component, if no output depends on a random process."""
        mechanism = study.mechanism
        if any(getattr(x, "declared", None) is not None for o in mechanism.observed() for x in _parts(o.expression)):
            return
        if any(variable.is_key for variable in mechanism.inputs.variables):
            return
        for component in mechanism.components.values():
            for name in sorted(process.name for process in _processes(component)):
                place = f"{type(component).__name__} {component.name!r}"
                yield uqmbd.extend.Finding(
                    uqmbd.extend.Severity.WARNING,
                    place,
                    f"{place} contains the random process {name!r}, but no output depends on this process",
                    "Record an output such as stationary_std(...), or an output over time",
                )


class LostVariance:
    """Find the share of the variance of outputs that sampled paths change, by the linear response."""

    def find(self, study: Any) -> Iterator[uqmbd.extend.Finding]:
        """Yield one finding on all processes whose sampled paths lack a part of the variance, if there are any."""
        mechanism = study.mechanism
        if not any(variable.is_key for variable in mechanism.inputs.variables):
            return
        expressions = _expressions_over_time(mechanism)
        found = {p.name: p for component in mechanism.components.values() for p in _processes(component)}
        lossy = {name: p for name, p in sorted(found.items()) if math.isfinite(p.variance) and p.lost_variance}
        if not lossy or not expressions:
            return
        every, unknown = _lost_shares(mechanism, expressions, float(study.times[0]))
        shares = {output: found[0] for output, found in every.items()}
        curved = dict.fromkeys(unknown, False)
        for output, expression in expressions:
            if output in unknown:
                curved[output] |= _is_curved(expression)
        parts = [f"{_percent(share)} of {output!r}" for output, share in shares.items()]
        parts += [f"an unknown share of {output!r} ({reason or NONE})" for output, reason in unknown.items()]
        much = any(unknown.values()) or max(shares.values(), default=0.0) > MUCH
        advice = REMEDY if max(shares.values(), default=0.0) > MUCH else ""
        if not much and not unknown and (lower := _lower_cutoff(list(every.values()))) is not None:
            factor, loss = lower
            names = " and ".join(f"{_rounded(p, factor):g} {UNITS[p.over]} for {name!r}" for name, p in lossy.items())
            lost = f"{max(100 * loss, 1e-3):.2g} %"
            advice = (
                f"A lower cutoff= needs fewer steps: with {names}, no variance of an output changes by more than {lost}"
            )
        ends = [f"{_limit(p)} for {name!r}" for name, p in lossy.items()]
        yield uqmbd.extend.Finding(
            uqmbd.extend.Severity.WARNING if much else uqmbd.extend.Severity.NOTE,
            f"random process {next(iter(lossy))!r}",
            f"sampled paths of random processes resolve frequencies up to a limit ({', '.join(ends)}); higher "
            f"frequencies {_effect(lossy.values())}. This changes the variance of the linear response at the means by "
            f"{', '.join(parts)}{_averaged(lossy.values())}",
            advice,
            hidden_errors=_errors_of_std(shares, [name for name, why in unknown.items() if why or curved[name]]),
        )


def _errors_of_std(shares: dict[str, float], unknown: list[str]) -> tuple[tuple[str, float], ...]:
    """Return relative errors of standard deviations from changed shares of variances; NaN for unknown shares."""
    known = [(output, 1.0 - math.sqrt(max(1.0 - share, 0.0))) for output, share in shares.items()]
    return (*known, *((output, math.nan) for output in unknown))


def _is_curved(expression: Any) -> bool:
    """Return whether an expression is nonlinear in quantities of the motion, so that it may vary without a slope."""
    moving = {s for s in _symbols(expression) if not isinstance(s, uqmbd.RandomVariable) and s != uqmbd.t}
    return any(expression.diff(s).free_symbols & moving for s in moving)


@uqmbd.extend.linear_output(power=0)
def _lost_share(system: LinearSystem, factor: float) -> tuple[NDArray[np.float64], list[str]]:
    """Return the share of the variance that sampled paths change, with the cutoffs times a factor.

    The share is -1 without a variance.
    """
    if _is_apart(system):
        return np.full(len(system), -1.0), [""] * len(system)
    whole, reasons = moments(system, (0,), ROUGH)
    sources = [channel.source for channel in system.channels]
    own = [k for k, p in enumerate(sources) if math.isfinite(p.variance) and p.lost_variance]
    tails = tuple(replace(system.channels[k], source=_tail(sources[k], factor)) for k in own)
    lost, more = moments(replace(system, b=system.b[:, :, own], e=system.e[:, :, own], channels=tails), (0,), ROUGH)
    with np.errstate(all="ignore"):
        share = np.where(whole[0] == 0, -1.0, lost[0] / whole[0])
        return share, [one or other for one, other in zip(reasons, more, strict=True)]


def _is_apart(system: LinearSystem) -> bool:
    """Return whether the responses of an output to all processes are rounding errors of the states."""
    frequencies = np.abs(system.eigenvalues)
    frequencies = np.where(frequencies > 0, frequencies, 1.0)
    identity = np.eye(system.a.shape[1])
    states = np.linalg.solve(1j * frequencies[:, :, None, None] * identity - system.a[:, None], system.b[:, None])
    most = np.abs(states).max(axis=(1, 2, 3), initial=0.0) * np.abs(system.c).max(axis=1, initial=0.0)
    responses = np.abs(system.transfer(frequencies)).max(axis=(1, 2), initial=0.0)
    return bool((responses <= APART * most).all() and not system.e.any())


@dataclass(frozen=True)
class _Density:
    """Density of a process, with the same text at all points of the process."""

    text: str
    function: Callable[[NDArray[np.float64]], NDArray[np.float64]] = field(repr=False)

    def __call__(self, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.function(frequency)


def _effect(processes: Iterable[RandomProcess]) -> str:
    """Return whether paths omit the frequencies that they do not resolve, or fold them to lower frequencies."""
    found = {"are folded to lower frequencies" if p.paths == "filter" else "are missing" for p in processes}
    return " or ".join(sorted(found))


def _limit(process: RandomProcess) -> str:
    """Return the highest frequency of paths, and the number of terms of an expansion."""
    frequency = process.sampled_band[1] / (2 * math.pi)
    terms = "" if process.expansion_terms is None else f" ({process.expansion_terms} terms)"
    return f"{frequency:.4g} {UNITS[process.over]}{terms}"


def _averaged(processes: Iterable[RandomProcess]) -> str:
    """Return a remark on processes whose paths are not stationary, or an empty text."""
    expanded = any(p.expansion_terms is not None for p in processes)
    if not expanded:
        return ""
    return (
        ". The omitted terms of expansions also have lower frequencies; their shares are means over the length, with "
        "the weight of Hann's window"
    )


def _percent(share: float) -> str:
    return "below 0.001 %" if share < 1e-5 else f"{100 * share:.2g} %"


def _rounded(process: RandomProcess, factor: float) -> float:
    """Return a lower cutoff, Hz or cycle/m, rounded up to two digits."""
    value = factor * process.sampled_band[1] / (2 * math.pi)
    if process.paths == "filter":  # the band ends at half of the frequency of the knots
        value /= KNOTS_PER_WAVE / 2
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / unit - 1e-9) * unit


def _lower_cutoff(every: list[list[float]]) -> tuple[float, float] | None:
    """Return the lowest factor of the cutoffs at which all outputs lose little, and the loss; None if there is none."""
    losses = [max(column) for column in zip(*every, strict=True)]
    found = [(factor, loss) for factor, loss in zip(FACTORS, losses, strict=True) if factor < 1 and loss <= LITTLE]
    return found[-1] if found else None


def _tail(process: RandomProcess, factor: float) -> RandomProcess:
    """Return a process with the density that sampled paths change, if the cutoff is multiplied by a factor.

    Paths of harmonics have no frequencies above their band.  Paths of filters fold these frequencies into their band.
    Expansions omit eigenfunctions, whose spectra also contain lower frequencies.
    """
    angular: Any = "rad/s" if process.over == "time" else "rad/m"
    text = "".join(process.description.values())
    changed = process.changed_density
    if changed is None:
        function = _Density(text, process.two_sided)
        low = max(factor * process.sampled_band[1], process.band[0])
    else:
        function, low = _Density(f"{text} {factor}", partial(changed, factor)), process.band[0]
    density = PowerSpectralDensity(function, "two", angular, (low, process.band[1]))
    return replace(process, psd=density, covariance=None, filter=None, record=None, cutoff=None, paths="harmonics")


def _expressions_over_time(mechanism: Any) -> list[tuple[str, Any]]:
    """Return names and expressions over time of outputs, requirements, and summaries in both."""
    found = [(output.name, output.expression) for output in mechanism.outputs.values()]
    for output in (*mechanism.scalars.values(), *mechanism.margins.values()):
        requirement = mechanism.requirements.get(output.name) if output.name in mechanism.margins else None
        if requirement is not None and requirement.over_time:
            found.append((output.name, output.expression))
        else:
            summaries = sorted((x for x in _parts(output.expression) if hasattr(x, "further")), key=str)
            found += [(output.name, part) for x in summaries for part in (x.args[0], *x.further)]
    return found


def _lost_shares(
    mechanism: Any, expressions: list[tuple[str, Any]], time: float
) -> tuple[dict[str, list[float]], dict[str, str]]:
    """Return the largest lost shares of the variance, for each factor, and reasons of unknown shares, by name.

    The shares are computed at the means of random variables. The reason is an empty text if the linear response of an
    expression is zero.
    """
    shares: dict[str, list[float]] = {}
    unknown: dict[str, str] = {}
    for name, expression in expressions:
        seen = copy.copy(mechanism)
        seen.outputs, seen.scalars, seen.requirements, seen.margins, seen._memory = {}, {}, {}, {}, {}
        try:
            for number, factor in enumerate(FACTORS):
                seen.output(f"share {number}", _lost_share(expression, factor))
            found = uqmbd.simulate(seen, [time, time + 1.0])
            share = [float(found[f"share {number}"]) for number in range(len(FACTORS))]
        except (uqmbd.StudyError, uqmbd.AssemblyError, uqmbd.IntegrationError) as error:
            unknown[name] = str(error).rstrip(".")
            continue
        if share[0] < 0:
            unknown[name] = ""
        else:
            shares[name] = [max(pair) for pair in zip(share, shares.get(name, share), strict=True)]
    return {name: share for name, share in shares.items() if name not in unknown}, unknown


def _parts(expression: Any) -> set[Any]:
    """Return the functions in an expression."""
    found: set[Any] = expression.atoms(sympy.Function) if isinstance(expression, sympy.Basic) else set()
    return found


def _processes(component: Any) -> list[RandomProcess]:
    """Return the processes in the parameters of a component."""
    symbols = {s for value in component.values.values() for s in _symbols(value)}
    sources = {id(s.source.source): s.source.source for s in symbols if _is_process(s)}
    return list(sources.values())


def _symbols(value: Any) -> set[Any]:
    """Return the symbols in a value of a component."""
    if isinstance(value, (sympy.Basic, sympy.MatrixBase)):
        return set(value.free_symbols)
    return {s for part in value for s in _symbols(part)} if isinstance(value, (tuple, list)) else set()


def _is_process(symbol: Any) -> bool:
    return isinstance(getattr(getattr(symbol, "source", None), "source", None), RandomProcess)
