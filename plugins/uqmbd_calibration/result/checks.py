"""Checks of a calibration, as plain data, and the warnings that follow."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

import uqmbd
from uqmbd.typing import Array
from uqmbd_calibration.inference import Mode
from uqmbd_calibration.posterior_search import Found
from uqmbd_calibration.result.discrepancy import DOUBT, Residuals, find_discrepancy

__all__ = ["checks_of", "named_strays", "warn_of"]


PART = 0.01
"""Probability of another maximum of the posterior above which a warning reports it."""

FAR = 4.0
"""Standard deviations of the prior by which an input may be away from its median without a word."""


def checks_of(found: Found, of: list[Residuals]) -> dict[str, Any]:
    """Return all that was checked."""
    inferred, unknowns = found.inferred, found.arrangement.unknowns
    values = sum(len(one.block.values) for one in of)
    spent = len(unknowns.inputs)
    masses = np.array([mode.log_mass for mode in inferred.modes])
    others = np.exp(masses - masses.max()) / np.exp(masses - masses.max()).sum() if len(masses) else np.ones(0)
    last = inferred.checks[-1] if inferred.checks else None
    return {
        "surrogate": [{**asdict(check), "chance": check.chance, "passed": check.passed} for check in inferred.checks],
        # draws of the mechanism itself need no check
        "even": bool(last.passed if last is not None else not inferred.widened),
        "widened": inferred.widened,
        "realisations": sum(point.spent for point in found.arrangement.points),
        "failures": sum(point.failures for point in found.arrangement.points),
        "converged": inferred.draws.converged,
        "rhat": float(inferred.draws.rhat.max()),
        "ess": float(inferred.draws.ess.min()),
        "acceptance": inferred.draws.acceptance,
        "correlation": inferred.draws.correlation,
        "steps": inferred.draws.steps,
        "modes": [float(share) for share in others],
        "unsampled": _unsampled(inferred.modes, others, inferred.draws.flat[:, :spent]),
        "unseen": inferred.unseen,
        "far": [
            {"input": one.name, "deviations": float(away)}
            for one, away in zip(unknowns.inputs, inferred.draws.flat.mean(axis=0)[:spent], strict=True)
            if abs(away) > FAR
        ],
        "model": [find_discrepancy(one, spent * len(one.block.values) / values) for one in of],
        "notes": list(found.notes),
        "method": found.method,
    }


def _unsampled(modes: Sequence[Mode], shares: Array, inputs: Array) -> list[float]:
    """Return the shares of the maxima that draws (K, D) of the inputs are not about, though they might have been."""
    if len(modes) < 2:
        return []
    at = np.array([mode.vector[: inputs.shape[1]] for mode in modes])
    nearest = np.argmin(((inputs[:, None, :] - at) ** 2).sum(axis=2), axis=1)
    own = np.bincount(nearest, minlength=len(modes)) / len(inputs)
    return [float(share) for share, drawn in zip(shares, own, strict=True) if PART < share and drawn < 0.2 * share]


def warn_of(checks: Mapping[str, Any], stacklevel: int) -> None:
    """Warn if the posterior is not confirmed, or records contradict the model."""
    said = []
    if checks["widened"]:
        last = checks["surrogate"][-1] if checks["surrogate"] else None
        seen = "it was not checked, and its errors widen the posterior"
        if last is not None:
            seen = (
                f"of the weights at {last['draws']} draws {100 * last['share']:.0f} % are effective, and means shift "
                f"by up to {last['shift']:.2g} sd, each with a standard error of {last['chance']:.2g} sd. The "
                "surrogate has since been fitted to these draws, too, and its errors widen the posterior, which was "
                "not checked again"
            )
        said.append(
            f"the surrogate is not confirmed by the mechanism with {checks['realisations']} realisations: {seen}. "
            "Allow more realisations, or give another surrogate"
        )
    if not checks["converged"]:
        said.append(
            f"the chains have not converged: R-hat is {checks['rhat']:.3f}, effective draws are {checks['ess']:.0f}, "
            f"and {checks['steps']} steps are {checks['steps'] / max(checks['correlation'], 1.0):.0f} times what a "
            "walker takes to forget where it was"
        )
    if others := checks["unsampled"]:
        said.append(
            f"there are {len(others)} more maxima of the posterior with about {100 * sum(others):.0f} % of its mass; "
            "no draws are about these"
        )
    if checks["unseen"]:
        said.append(
            f"{checks['unseen']} more maxima of the surrogate are about as likely, and were not followed on the "
            "mechanism; allow more realisations, or a prior that says which of them is meant"
        )
    for one in checks["far"]:
        said.append(
            f"input {one['input']!r} is found {abs(one['deviations']):.1f} standard deviations "
            f"{'above' if one['deviations'] > 0 else 'below'} the median of its prior: the prior, the record or the "
            "model is wrong, and so far out the surrogate is less exact"
        )
    for one in checks["model"]:
        if one["doubted"]:
            said.append(_doubt(one))
    for text in said:
        warnings.warn(f"calibrate: {text}.", uqmbd.StudyWarning, stacklevel=stacklevel + 1)


def named_strays(one: Mapping[str, Any]) -> str:
    """Name the outliers of an output of a record: where they are, and how far away."""
    said = []
    for stray in one["strays"]:
        where = f"at {stray['time']:g} s" if "time" in stray else f"(no. {stray['number']})"
        said.append(f"{stray['value']:.6g} {where}, {stray['deviations']:.2g} standard deviations away")
    return "; ".join(said)


def _doubt(one: Mapping[str, Any]) -> str:
    """Return a message that a record is not one that the model gives, and where."""
    spans = ", ".join(f"{begin:.4g} to {end:.4g} s" for begin, end in one.get("where", []))
    where = f", above all at {spans}" if spans else ""
    hint = "; something is missing in the model, or the noise is larger than stated"
    if one["strays"]:
        # the chance of residuals is known where the noise is
        beyond = f"beyond {FAR:g} standard deviations" if "chi_square" in one else "far from all others"
        hint = (
            f"; {one['outliers']} of {one['values']} values are {beyond}: {named_strays(one)}. If these are outliers, "
            "leave them out (nan)"
        ) + ("" if one["robust"] else " or use noise='student': what is found of the inputs depends on them")
    if one["p"] >= DOUBT:
        return f"record {one['record']!r}, output {one['output']!r}: {hint.removeprefix('; ')}"
    return (
        f"record {one['record']!r}, output {one['output']!r}: the model does not give such values with this noise "
        f"(p = {one['p']:.1g}, below {DOUBT:g}){where}{hint}"
    )
