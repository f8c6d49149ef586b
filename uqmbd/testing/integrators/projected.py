"""Test the integration of projected equations: coefficients must agree with the motions at the nodes."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from uqmbd.dynamics import (
    Ensemble,
    Integrator,
    ProjectedEnsemble,
    ProjectedTrajectories,
    capabilities_of,
    off_constraints,
)
from uqmbd.testing.solutions import ClosedForm, closed_forms
from uqmbd.typing import Array

__all__ = ["check_projected"]


RTOL = 1e-6
NODES = 3


def check_projected(integrator: type[Integrator], tolerance: float) -> None:
    """Check an integrator that declares ``projected``.

    `tolerance` is the allowed error, relative to the product of ``rtol`` and the magnitude of an output. If the numbers
    of terms and nodes are equal, the coefficients agree with the motions at the nodes. The coefficients of the stone
    agree with fewer terms, too, because its motion is linear in its random number.
    """
    cases = ((closed_forms.oscillator(), NODES), (closed_forms.pendulum(), NODES), (closed_forms.stone(), 2))
    for form, terms in cases:
        projected = _project_solution(form, terms)
        what = f"integrator {integrator.name!r}: projected: {form.name}"
        found = _integrated(integrator, projected, form.times, what)
        assert not found.message, (
            f"{what}: the integration failed: {found.message!r}; expected a trajectory up to the last time."
        )
        nodal = projected.nodal(found.coefficients)
        response = projected.ensemble.outputs(form.times, nodal)
        expected = form.expected(projected.ensemble.values[:, 0])
        error = np.abs(response - expected) / np.abs(expected).max(axis=2, keepdims=True)
        worst = float(np.nan_to_num(error, nan=np.inf).max())
        assert worst <= tolerance * RTOL, (
            f"{what}: with {terms} basis polynomials and {NODES} nodes, the relative error of the trajectories at "
            f"the nodes is {worst:.2g}; expected at most {tolerance * RTOL:.1g}."
        )
        off = off_constraints(projected.ensemble, form.times, nodal, RTOL)
        assert not off, f"{what}: at a node {next(iter(off.values()))[1]}."
    if capabilities_of(integrator).stoppable:
        _check_watched(integrator, closed_forms.oscillator())


def _check_watched(integrator: type[Integrator], form: ClosedForm) -> None:
    what = f"integrator {integrator.name!r}: stoppable: {form.name}"
    seen: list[Array] = []

    def watch(coefficients: Array) -> bool:
        seen.append(coefficients.copy())
        return True

    times = np.linspace(0, 5, 51)
    found = _integrated(integrator, _project_solution(form, NODES), times, what, watch=watch)
    assert seen, (
        f"{what}: the integrator did not call the function 'watch'; expected repeated calls during the integration."
    )
    assert np.isnan(found.coefficients[:, -1]).all() and not found.message, (
        f"{what}: the function 'watch' returned True to stop the integration, but the integration continued or "
        f"failed ({found.message!r}). Expected NaN after the stop, and no message."
    )


def _integrated(
    integrator: type[Integrator], projected: ProjectedEnsemble, times: Array, what: str, **options: Any
) -> ProjectedTrajectories:
    made: Any = integrator()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = made.integrate_projected(projected, times, RTOL, **options)
    except Exception as error:
        raise AssertionError(f"{what}: it raised {type(error).__name__}: {error}") from error
    shape = (projected.terms, len(times), projected.model.layout.width)
    assert isinstance(found, ProjectedTrajectories) and np.shape(found.coefficients) == shape, (
        f"{what}: its method integrate_projected returned {found!r:.100}; expected "
        f"uqmbd.extend.ProjectedTrajectories with coefficients of shape {shape}."
    )
    return found


def _project_solution(form: ClosedForm, terms: int) -> ProjectedEnsemble:
    """Project realisations at Gauss nodes within the range of a case's values onto Legendre polynomials."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    low, high = form.values.min(), form.values.max()
    values = (low + high) / 2 + (high - low) / 2 * nodes
    psi = np.asarray(np.polynomial.legendre.legvander(nodes, terms - 1) * np.sqrt(2 * np.arange(terms) + 1), float)
    return ProjectedEnsemble(Ensemble(form.model, values[:, None]), psi, weights / 2)
