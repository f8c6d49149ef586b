"""Checks of a calibration, as plain data, and the warnings that follow."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

import uqmbd
from uqmbd.typing import Array
from uqmbd_calibration.inference import PART, Mode, shares_of
from uqmbd_calibration.posterior_search import Found
from uqmbd_calibration.result.discrepancy import SIGNIFICANCE, Residuals, find_discrepancy

__all__ = ["checks_of", "outliers_in_words", "several_maxima", "warn_of"]


FAR = 4.0
"""Largest distance of an input from its prior median without a warning, in standard deviations of the prior."""


def checks_of(found: Found, of: list[Residuals]) -> dict[str, Any]:
    """Return the results of all checks."""
    inferred, unknowns = found.inferred, found.arrangement.unknowns
    values = sum(len(one.block.values) for one in of)
    spent = len(unknowns.inputs)
    others = shares_of([mode.log_mass for mode in inferred.modes])
    last = inferred.checks[-1] if inferred.checks else None
    return {
        "surrogate": [{**asdict(check), "chance": check.chance, "passed": check.passed} for check in inferred.checks],
        # draws from the mechanism itself need no check
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
    """Return the probabilities of maxima above `PART` with too few draws. `inputs` (K, D) contains the draws."""
    if len(modes) < 2:
        return []
    at = np.array([mode.vector[: inputs.shape[1]] for mode in modes])
    nearest = np.argmin(((inputs[:, None, :] - at) ** 2).sum(axis=2), axis=1)
    own = np.bincount(nearest, minlength=len(modes)) / len(inputs)
    return [float(share) for share, drawn in zip(shares, own, strict=True) if PART < share and drawn < 0.2 * share]


def warn_of(checks: Mapping[str, Any], stacklevel: int) -> None:
    """Warn if checks did not confirm the posterior, or if records contradict the model."""
    sentences = []
    if checks["widened"]:
        last = checks["surrogate"][-1] if checks["surrogate"] else None
        seen = "no realisations verified the posterior, and errors of the surrogate widen it"
        if last is not None:
            seen = (
                f"importance weights at {last['draws']} draws give an effective sample size of "
                f"{100 * last['share']:.0f} %. They shift the means of the posterior by up to {last['shift']:.2g} "
                f"standard deviations, with a standard error of {last['chance']:.2g} standard deviations. The "
                "surrogate was then fitted to these draws as well. Its errors widen the posterior, which was not "
                "verified again"
            )
        sentences.append(
            f"the {checks['realisations']} realisations of the mechanism do not verify the surrogate: {seen}. "
            "Increase realisations, or use another surrogate"
        )
    if not checks["converged"]:
        sentences.append(
            f"the chains have not converged: R-hat is {checks['rhat']:.3f}, the effective number of draws is "
            f"{checks['ess']:.0f}, and the {checks['steps']} steps are "
            f"{checks['steps'] / max(checks['correlation'], 1.0):.0f} times the correlation time of a walker. "
            "Increase draws"
        )
    if others := checks["unsampled"]:
        sentences.append(
            f"{len(others)} further maxima of the posterior contain about {100 * sum(others):.0f} % of the "
            "probability. The sampled draws contain less than a fifth of the number expected near these maxima. "
            "Increase realisations"
        )
    if checks["unseen"]:
        sentences.append(
            f"{checks['unseen']} further maxima of the surrogate have a similar probability, but no realisations "
            "verified them. Increase realisations, or use a prior that excludes wrong maxima"
        )
    for one in checks["far"]:
        sentences.append(
            f"the posterior mean of input {one['input']!r} is {abs(one['deviations']):.1f} prior standard deviations "
            f"{'above' if one['deviations'] > 0 else 'below'} the prior median, where the surrogate is less "
            "accurate. Check the prior, the record and the model"
        )
    for one in checks["model"]:
        if one["rejected"]:
            sentences.append(_rejection(one))
    for text in sentences:
        warnings.warn(f"calibrate: {text}.", uqmbd.StudyWarning, stacklevel=stacklevel + 1)


def several_maxima(checks: Mapping[str, Any]) -> str:
    """Return a text on the probabilities of the maxima above `PART`; empty if fewer than two of them have draws."""
    shares = [share for share in checks.get("modes", ()) if share > PART]
    if len(shares) - len(checks.get("unsampled", ())) < 2:
        return ""
    parts = [f"{100 * share:.0f} %" for share in shares]
    listed = ", ".join(parts[:-1]) + f" and {parts[-1]}"
    return f"the posterior has {len(shares)} maxima, with about {listed} of the probability"


def outliers_in_words(one: Mapping[str, Any]) -> str:
    """Return a text on the outliers of an output of a record, with their times and deviations."""
    sentences = []
    for outlier in one["outlier_values"]:
        where = f"at {outlier['time']:g} s" if "time" in outlier else f"(no. {outlier['number']})"
        sentences.append(
            f"{outlier['value']:.6g} {where}, {outlier['deviations']:.2g} standard deviations from the model"
        )
    return "; ".join(sentences)


def _rejection(one: Mapping[str, Any]) -> str:
    """Return a message that the model does not explain a record, with the times."""
    spans = ", ".join(f"{begin:.4g} to {end:.4g} s" for begin, end in one.get("where", []))
    where = f", above all at {spans}" if spans else ""
    hint = ". The model is incomplete, or " + (
        "the noise is larger than stated" if "chi_square" in one else "the errors are correlated in time"
    )
    if one["outlier_values"]:
        # the probability of residuals is known only if the noise is known
        beyond = (
            f"more than {FAR:g} standard deviations from the model" if "chi_square" in one else "far from all others"
        )
        hint = (
            f". {one['outliers']} of {one['values']} values are {beyond}: {outliers_in_words(one)}. If these are "
            "outliers, replace them by nan"
        ) + ("" if one["robust"] else " or use noise='student', because the calibrated inputs depend on these values")
    if one["p"] >= SIGNIFICANCE:
        return f"record {one['record']!r}, output {one['output']!r}: {hint.removeprefix('. ')}"
    return (
        f"record {one['record']!r}, output {one['output']!r}: the model does not explain these values with this noise "
        f"(p = {one['p']:.1g}, below {SIGNIFICANCE:g}){where}{hint}"
    )
