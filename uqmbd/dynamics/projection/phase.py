"""Projected ensemble with a phase as the independent variable, instead of the time.

Realisations are compared at equal phases of a clock instead of equal times. Let ``w(q, v, t) > 0`` be the rate of the
clock, rad/s, and ``p = 1 / w`` the time per phase, s/rad. A prime is the derivative with respect to the phase. The
equations of a realisation are::

    q' = p v,   M v' + D^T (p lambda) = p (Q - h),   D v' = p gamma,   t' = p

The time is a state. States and multipliers ``p lambda`` are expanded in the basis. Each equation is projected by the
same nodes and weights as the equations in time, ``Psi^T W r``. The projected constraints are ``E[Phi psi_j] = 0`` for
``Phi(q, t)`` and its rate. The result of each step is projected onto these constraints.

The phase is zero at the start, but the clocks of the realisations may start at different phases. In a first interval,
``p`` is ``c / w`` with a constant ``c`` for each realisation. The constants are such that all clocks have the same
phase at the end of the interval. After it, ``c`` is 1.

SciPy's DOP853 makes the steps, because the clock is an output, and the compiled integrator cannot evaluate outputs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from uqmbd.dynamics.integration import longest_step
from uqmbd.dynamics.projection.dop853 import SOLVED
from uqmbd.dynamics.projection.ensemble import ProjectedEquations
from uqmbd.errors import IntegrationError, StudyError
from uqmbd.plugins import method_with_option
from uqmbd.typing import Array

__all__ = ["PhaseMotion", "PhaseRates", "require_phase"]

PhaseRates = Callable[[Array, Array], Array]
"""Function of times (K,) and states (K, width) of the nodes that returns the rates (K,) of their phases, rad/s."""

STEADY = 0.02
"""Ratio of the clock's rate at a node to its mean rate since the start, below which the clock counts as stopped."""

SETTLED = np.pi / 2
"""Phase in rad above which the mean rate since the start is meaningful."""

EXCESS = 1e-3
"""Relative accuracy of the projection of a step onto the constraints."""

OWN = 1e-13
"""Relative tolerance of the time, so small that the absolute tolerance determines the error of this state."""


class PhaseMotion:
    """Coefficients of states and of the time as functions of the phase.

    Parameters
    ----------
    projected : ProjectedEquations
        Projected equations of an ensemble.
    rates : callable
        Clock, as in `PhaseRates`.
    times : array, shape (T,)
        Output times, s. Functions of time are sampled up to the last output time.
    rtol : float
        Relative tolerance.
    state : array, shape (P, width), optional
        Initial coefficients at the first output time. Default: coefficients of `projected.start`.
    ahead : array, shape (K,), optional
        Change of the clock phase of each node, rad, while the phase increases from 0 to `within`. Default: `within`.
    within : float
        Phase interval for the adjustment by `ahead`, rad.

    Raises
    ------
    uqmbd.StudyError
        If there are impacts or controllers, functions of time that are not smooth, or too many equations.

    Examples
    --------
    The phase is the displacement of a cart with a random speed.  The mean time for 13 m is ``13 ln(7/6)`` s:

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
    >>> motion = projected.in_phase(lambda times, states: states[..., -1], np.array([0.0, 3.0]))
    >>> float(motion.at(np.array([13.0]))[0, 0, -1].round(4)), float(round(13 * np.log(7 / 6), 4))
    (2.004, 2.004)
    """

    def __init__(
        self,
        projected: ProjectedEquations,
        rates: PhaseRates,
        times: Array,
        rtol: float,
        state: Array | None = None,
        ahead: Array | None = None,
        within: float = 0.0,
    ) -> None:
        self.projected, self._rates, self._rtol = projected, rates, rtol
        require_phase(projected)
        self._longest = self._smooth(times)
        first = projected.start.state if state is None else state
        self._layout = projected.model.layout
        self._shape = projected.terms, self._layout.width + 1
        self._begin = float(times[0])
        self._within, self._ahead = within, np.full(len(projected.psi), within) if ahead is None else ahead
        self._evaluations = self._steps = 0
        whole = np.zeros(self._shape)
        whole[:, :-1] = first
        # the first polynomial is 1
        whole[0, -1] = self._begin
        self._size = min(1.0, max(1e-3, float(np.abs(projected.ensemble.start.q).max(initial=0.0))))
        self._dense: Any = None
        self._start = whole.ravel()
        intervals = [(within, self._ahead / within)] if within else []
        self._intervals = [*intervals, (np.inf, np.ones(len(self._ahead)))]
        self._solver = self._start_interval(0.0, whole)

    def _start_interval(self, phase: float, whole: Array) -> Any:
        """Start the integration up to the phase at which the factors of the nodes' rates change."""
        bound, self._faster = self._intervals.pop(0)
        paces = self._paces(*self._nodal(whole))
        if not np.isfinite(paces).all():
            raise self._stopped_error(whole, phase)
        absolute, relative = np.full((2, *self._shape), self._rtol)
        absolute *= self._size
        absolute[:, -1], relative[:, -1] = self._rtol * float(paces.mean()), OWN
        tolerances = {"rtol": relative.ravel(), "atol": absolute.ravel()}
        from scipy.integrate import DOP853

        return DOP853(self._rate, phase, whole.ravel(), bound, max_step=self._most(paces), **tolerances)

    @property
    def counters(self) -> dict[str, int]:
        """Return steps, evaluations of the rates, and operations of the projected systems."""
        return {"steps": self._steps, "evaluations": self._evaluations, **self.projected.coupled.counters}

    def at(self, phases: Array) -> Array:
        """Integrate; return coefficients (P, N, width + 1) at increasing phases (N,), rad, with the time last.

        The phases must not precede the phases of the previous call.

        Raises
        ------
        uqmbd.IntegrationError
            If the clock stops at a node, or the equations cannot be integrated.
        """
        phases = np.asarray(phases, dtype=float)
        found, done = np.empty((len(phases), *self._shape)), 0
        while done < len(phases):
            now = int(np.searchsorted(phases, self._solver.t, "right"))
            if now > done:
                part = phases[done:now]
                dense = self._start[:, None] if self._dense is None else self._dense(part)
                found[done:now] = dense.T.reshape(-1, *self._shape)
                done = now
            else:
                self._step()
        return np.ascontiguousarray(found.swapaxes(0, 1))

    def _step(self) -> None:
        solver = self._solver
        with np.errstate(all="ignore"):
            solver.step()
        whole = solver.y.reshape(self._shape)
        if solver.status == "failed":
            nodal = self._nodal(whole)
            slowest = np.nanmin(self._rates(*nodal) / self._mean(nodal[0], solver.t))
            if slowest < 10 * STEADY:
                raise self._stopped_error(whole, solver.t)
            raise IntegrationError(
                f"mechanism {self.projected.model.name!r}: the projected equations cannot be integrated beyond the "
                f"phase {solver.t:.6g} rad, t = {whole[0, -1]:.6g} s in the mean: the step size became too small. "
                "The expansion may be invalid; raise the order, or use a method that integrates each realisation "
                "separately."
            )
        self._steps += 1
        # the interpolant belongs to the state before its projection onto the constraints
        self._dense = solver.dense_output()
        if self._layout.rank:
            whole = self._constrained(whole)
            solver.y = whole.ravel()
            solver.f = self._rate(solver.t, solver.y)
        times, states = self._nodal(whole)
        share = self._rates(times, states) / self._mean(times, solver.t)
        # the negated comparison counts NaN as a stopped clock
        if solver.t > SETTLED and not (share >= STEADY).all():
            raise self._stopped_error(whole, solver.t)
        if solver.status == "finished":
            self._solver = self._start_interval(solver.t, whole)
        else:
            solver.max_step = self._most(self._paces(times, states))

    def _nodal(self, whole: Array) -> tuple[Array, Array]:
        found = self.projected.psi @ whole
        return np.ascontiguousarray(found[:, -1]), np.ascontiguousarray(found[:, :-1])

    def _mean(self, times: Array, phase: float) -> Array:
        """Return the mean rates (K,) so far, rad/s."""
        early = phase < self._within
        passed = phase / self._within * self._ahead if early else phase + self._ahead - self._within
        return np.asarray(passed / np.maximum(times - self._begin, 1e-300))

    def _most(self, paces: Array) -> float:
        """Return the longest phase step for functions of time and forces with corners, from the largest pace, s/rad."""
        return float(self._longest / paces.max())

    def _paces(self, times: Array, states: Array) -> Array:
        """Return times per phase (K,), s/rad; NaN if the rate of the clock is not positive."""
        rates = self._rates(times, states)
        found: Array = np.divide(self._faster, rates, out=np.full(len(rates), np.nan), where=rates > 0)
        return found

    def rates(self, whole: Array) -> tuple[Array, Array]:
        """Return the derivatives by the phase.

        Parameters
        ----------
        whole : array, shape (P, width + 1)
            Coefficients of the states and the time.

        Returns
        -------
        rates : array, shape (P, width + 1)
            Derivatives; NaN if the rate of the clock is not positive at a node, or the iterations do not converge.
        multipliers : array, shape (P, kept)
            Multipliers of the independent equations, multiplied by the time per phase.
        """
        self._evaluations += 1
        projected, n, first = self.projected, self._layout.coordinates, self._layout.velocities
        times, states = self._nodal(whole)
        paces = self._paces(times, states)
        found = np.full(self._shape, np.nan)
        if not np.isfinite(paces).all():
            return found, np.full((self._shape[0], 0), np.nan)
        with projected.coupled.systems.in_phase(times, paces):
            solved, rates = projected.coupled.solve(whole[:, :-1], 0.0, SOLVED * self._rtol)
        # rates of coordinates: projected velocities, each multiplied by the node's time per phase
        found[:, :n] = projected.adjoint @ (paces[:, None] * states[:, first:])
        found[:, n:first] = rates
        found[:, first:-1] = solved[:, :n]
        found[:, -1] = projected.adjoint @ paces
        return found, solved[:, n:]

    def _rate(self, phase: float, flat: Array) -> Array:
        found, _ = self.rates(flat.reshape(self._shape))
        return np.asarray(found.ravel())

    def _constrained(self, whole: Array) -> Array:
        """Project coefficients onto the projected constraints at equal phase."""
        times, _ = self._nodal(whole)
        found = whole.copy()
        with self.projected.coupled.systems.in_phase(times, np.ones(len(times))):
            q, v = self.projected.coupled.excess(whole[:, :-1], 0.0, EXCESS)
        found[:, : self._layout.coordinates] -= q
        found[:, self._layout.velocities : -1] -= v
        return found

    def _stopped_error(self, whole: Array, phase: float) -> IntegrationError:
        times, states = self._nodal(whole)
        rates = self._rates(times, states)
        # near the start there is no mean rate for comparison
        share = rates / self._mean(times, phase) if phase > SETTLED else rates
        worst = int(np.argmin(np.where(np.isfinite(share), share, -np.inf)))
        ensemble = self.projected.ensemble
        values = ", ".join(f"{n} = {x:.6g}" for n, x in zip(ensemble.model.inputs, ensemble.values[worst], strict=True))
        return IntegrationError(
            f"the clock stands still, or nearly still, at the node {values}: at t = {times[worst]:.6g} s, "
            f"{phase / (2 * np.pi):.3g} turns from the start, its rate is {rates[worst]:.3g} rad/s"
            + (f" ({share[worst]:.2g} times the mean rate)" if phase > SETTLED else "")
        )

    def _smooth(self, times: Array) -> float:
        """Return the longest time step, s; refuse functions of time that are not smooth."""
        projected = self.projected
        intervals = projected.ensemble.pace(times, self._rtol)
        if len(intervals) > 1:
            raise StudyError(
                f"mechanism {projected.model.name!r}: with a phase as the independent variable, functions of time "
                "must be smooth, because each time has a different phase in each realisation. A function of time "
                f"starts, jumps or has a knot at t = {intervals[0].end:.6g} s. {_aligned('phase')}."
            )
        return min(intervals[0].longest, longest_step(projected.model.rough, times))


def _aligned(alignment: str) -> str:
    """Return the advice to use a method that integrates realisations separately, with an alignment."""
    return f"Use {method_with_option('alignment', 'a method with alignments')}(alignment={alignment!r})"


def require_phase(projected: ProjectedEquations) -> None:
    """Raise `uqmbd.StudyError` for mechanisms that exclude a phase as the independent variable.

    Sampling times of controllers and impacts have a different phase in each realisation.  Large mechanisms exceed the
    limit of the explicit integrator.
    """
    model = projected.model
    where = f"mechanism {model.name!r}: with a phase as the independent variable,"
    if model.controls:
        raise StudyError(f"{where} uqmbd cannot follow controllers, which sample in time. {_aligned('auto')}.")
    if names := dict.fromkeys(component for component, _, directions in model.events if directions):
        raise StudyError(
            f"{where} uqmbd cannot follow the impacts of {', '.join(map(repr, names))}. {_aligned('events')}."
        )
    if not projected.coupled.compiled:
        raise StudyError(f"{where} the explicit integrator is used, for which this mechanism is too large.")
