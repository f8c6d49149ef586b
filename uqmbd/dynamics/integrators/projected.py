"""Projected ensemble: integration by integrators with this capability, and check of the projected constraints."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from uqmbd.arguments import NotNegative, Positive, shown, typechecked
from uqmbd.dynamics.integration import position_jumps
from uqmbd.dynamics.integrators.dispatch import integrator_class, require, require_for
from uqmbd.dynamics.integrators.protocol import capabilities_of
from uqmbd.dynamics.integrators.sampled import projected_in_samples
from uqmbd.dynamics.projection import (
    LINEAR_SOLVERS,
    PhaseMotion,
    PhaseRates,
    ProjectedEquations,
    ProjectedTrajectories,
    Watch,
    projected_off,
    require_phase,
)
from uqmbd.errors import StudyError
from uqmbd.typing import Array

__all__ = ["ProjectedEnsemble"]


class ProjectedEnsemble(ProjectedEquations):
    """Realisations at quadrature nodes, projected onto a basis.

    Parameters
    ----------
    ensemble : Ensemble
        Ensemble of K realisations at the nodes.
    psi : array, shape (K, P)
        Values of the basis at the nodes.
    weights : array, shape (K,)
        Weights of the nodes, positive, with the sum 1.

    Raises
    ------
    uqmbd.AssemblyError
        If the mechanism cannot be assembled at a node.

    Examples
    --------
    Without forces on a cart, the mean and the spread of its speed are constant:

    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_galerkin import Galerkin
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(6, 7), units="m/s")
    >>> mechanism = uqmbd.Mechanism("cart", uqmbd.Line())
    >>> cart = mechanism.body("cart", mass=1, velocity=speed)
    >>> mechanism.output("way", cart.position[0], units="m")
    >>> study = uqmbd.Study("rolling", mechanism, [0, 1, 2], [Galerkin(order=3)])
    >>> problem = study.problem(study.propagators[0])
    >>> space = problem.germ_space()
    >>> rule = uqmbd.extend.gauss_tensor(space, 5)
    >>> psi = space.evaluate(rule.nodes, space.basis(3))
    >>> projected = uqmbd.extend.ProjectedEnsemble(problem.ensemble(space.to_inputs(rule.nodes)), psi, rule.weights)
    >>> found = projected.integrate(np.array([0.0, 2.0]))
    >>> found.coefficients.shape
    (4, 2, 2)
    >>> found.coefficients[:2, 1, -1].round(4).tolist()  # 6.5, and 0.5 over the root of 3
    [6.5, 0.2887]
    """

    @typechecked
    def integrate(
        self,
        times: Array,
        rtol: Positive = 1e-6,
        integrator: str = "auto",
        linear_solver: str = "auto",
        watch: Watch | None = None,
    ) -> ProjectedTrajectories:
        """Integrate the coefficients.

        Parameters
        ----------
        times : array, shape (T,)
            Output times, s, strictly increasing; the first is the initial time.
        rtol : float
            Relative tolerance of the integration.
        integrator : str
            Name of the integrator. ``dop853``: explicit, for the projected index-1 form. ``ida``: implicit, for the
            projected stabilised index-2 form. ``auto``: ``dop853``, or ``ida`` if the motion is stiff or ``dop853``
            fails. An integrator of a plugin needs ``projected=True`` in its capabilities.
        linear_solver : {"auto", "dense", "sparse", "krylov-nodal", "krylov-mean"}
            Linear solver of IDA. ``auto`` selects by the number of unknowns, and replaces the mean preconditioner if it
            breaks down.
        watch : callable, optional
            Function called at intervals with the coefficients so far; a true return value ends the integration.

        Returns
        -------
        ProjectedTrajectories
            Coefficients at the output times.

        Raises
        ------
        uqmbd.StudyError
            If a name is unknown, the integrator lacks a capability, or the mechanism is too large.
        """
        times, where = _increasing("integrate", times), f"mechanism {self.model.name!r}"
        if linear_solver not in LINEAR_SOLVERS:
            raise StudyError(f"linear_solver is {linear_solver!r}; expected one of: {', '.join(LINEAR_SOLVERS)}.")
        require(integrator, "projected", where)
        # other events only record their times
        if any(directions for *_, directions in self.model.events):
            require_for(self.model, integrator, where)
        if self.ensemble.model.rheonomic and (jumps := position_jumps(self.ensemble, times, rtol)):
            node, text = next(iter(jumps.items()))
            state = np.full((self.terms, len(times), self.model.layout.width), np.nan)
            state[:, 0] = self.start.state
            return ProjectedTrajectories(times, state, f"at node {node} {text}", "none", {})
        if self.model.controls and not any(directions for *_, directions in self.model.events):

            def solve(projected: ProjectedEquations, times: Array, rtol: float) -> ProjectedTrajectories:
                return _solved(projected, times, rtol, integrator, linear_solver, None)

            found = projected_in_samples(solve, self, times, rtol, watch)
        else:
            if self.model.controls:
                require(integrator, "sampled_control", where, "controllers")
            found = _solved(self, times, rtol, integrator, linear_solver, watch)
        first, text = projected_off(self, times, found.coefficients, rtol)
        if found.message or not text:
            return found
        coefficients = found.coefficients.copy()
        coefficients[:, max(1, first) :] = np.nan
        return replace(found, coefficients=coefficients, message=text)

    def require_phase(self) -> None:
        """Raise an error if a phase cannot be the independent variable for any clock.

        Raises
        ------
        uqmbd.StudyError
            If there are impacts or controllers, or too many equations.
        """
        require_phase(self)

    @typechecked
    def in_phase(
        self,
        rates: PhaseRates,
        times: Array,
        rtol: Positive = 1e-6,
        state: Array | None = None,
        ahead: Array | None = None,
        within: NotNegative = 0.0,
    ) -> PhaseMotion:
        """Start an integration of the coefficients with the phase of a clock as the independent variable.

        The phase counts from the start; the time is also an expanded state.  `ahead` brings nodes with different
        initial phases of the clock to the same phase.

        Parameters
        ----------
        rates : callable
            Clock, which maps times (K,), s, and states (K, 2 coordinate + state) of the nodes to the positive rates
            (K,) of their phases, rad/s.
        times : array, shape (T,)
            Output times, s, for the sampling of functions of time; the first is the start.
        rtol : float
            Relative tolerance.
        state : array, shape (P, 2 coordinate + state), optional
            Coefficients at the start.  Default: coefficients of the initial state of the ensemble.
        ahead : array, shape (K,), optional
            Change of the clock phase of each node, rad, while the phase passes `within` for the first time.
            Default: `within`.
        within : float
            Phase interval for the adjustment by `ahead`, rad.

        Returns
        -------
        PhaseMotion
            Motion. The method ``at(phases)`` continues the integration, and returns coefficients
            (P, N, 2 coordinate + state + 1) at phases (N,), rad. The time is after the states. ``counters`` contains
            the numbers of steps and operations.

        Raises
        ------
        uqmbd.StudyError
            If there are impacts or controllers, functions of time that are not smooth, or too many equations.
        uqmbd.IntegrationError
            If the initial rate of the clock is not positive at a node.
        """
        grid = _increasing("in_phase", times)
        shapes = {"state": (self.terms, self.model.layout.width), "ahead": (len(self.psi),)}
        for name, array in (("state", state), ("ahead", ahead)):
            if array is not None and not (np.shape(array) == shapes[name] and np.isfinite(array).all()):
                raise StudyError(
                    f"ProjectedEnsemble.in_phase: {name} is {shown(array)}; expected finite numbers of the shape "
                    f"{shapes[name]}."
                )
        return PhaseMotion(self, rates, grid, rtol, state, ahead, within)


def _increasing(what: str, times: Array) -> Array:
    """Return output times (T,), s; raise StudyError unless they are finite and strictly increasing."""
    grid = np.asarray(times, dtype=float)
    if grid.ndim != 1 or grid.size < 2 or not np.isfinite(grid).all() or not (np.diff(grid) > 0).all():
        raise StudyError(
            f"ProjectedEnsemble.{what}: times is {shown(times)}; expected two or more finite, increasing times."
        )
    return grid


def _solved(
    projected: ProjectedEquations, times: Array, rtol: float, name: str, linear_solver: str, watch: Watch | None
) -> ProjectedTrajectories:
    """Call an integrator with the options that it declares."""
    cls: Any = integrator_class(name)
    options: dict[str, Any] = {}
    able = capabilities_of(cls)
    if able.linear_solvers:
        options["linear_solver"] = linear_solver
    if able.stoppable:
        options["watch"] = watch
    found = cls().integrate_projected(projected, times, rtol, **options)
    shape = (projected.terms, len(times), projected.model.layout.width)
    if not isinstance(found, ProjectedTrajectories) or np.shape(found.coefficients) != shape:
        what = f"a {type(found).__name__}"
        if isinstance(found, ProjectedTrajectories):
            what = f"coefficients of shape {np.shape(found.coefficients)}"
        raise StudyError(
            f"the integrator {name!r}: its method integrate_projected returned {what}; expected "
            f"uqmbd.extend.ProjectedTrajectories with coefficients of shape {shape}."
        )
    return found if able.delegates else replace(found, integrator=name)
