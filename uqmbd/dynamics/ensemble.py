"""Ensemble of K realisations of one model, the common numerical core of all propagators.

Length: the module contains one class, and its methods are the complete protocol of integrators.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from uqmbd.arguments import shown, typechecked
from uqmbd.dynamics.assembly import Start, assemble, gradient_lengths
from uqmbd.dynamics.contact import ContactEvaluator, event_times, impact
from uqmbd.dynamics.control import Sampling
from uqmbd.dynamics.equations import Model, state_arguments
from uqmbd.dynamics.integration import Interval, pace
from uqmbd.dynamics.linear import accelerations, excess
from uqmbd.dynamics.observation import energies, observe, observe_along
from uqmbd.dynamics.sampled_paths import SampledPaths
from uqmbd.dynamics.statics import equilibrium_start
from uqmbd.errors import StudyError
from uqmbd.mechanism import MEAN_KEY
from uqmbd.randomness import path_terms
from uqmbd.typing import Array, Index, Mask

__all__ = ["Ensemble", "referenced"]


class Ensemble:
    """K realisations of a model, with parameters evaluated once, and joint evaluation of residuals and Jacobians.

    Parameters
    ----------
    model : Model
        Compiled model.
    values : array, shape (K, input)
        Inputs of each realisation, in the order of ``model.inputs``.
    start : Start, optional
        Initial states, if known. Default: computed by the ensemble.
    until : float, optional
        Time in s until which sampled paths are needed; an integration extends them if necessary.
    paths : SampledPaths, optional
        Sampled paths of the realisations, if known.

    Examples
    --------
    Two wheels rotate at 6 rad/s and 7 rad/s:

    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(6, 7), units="rad/s")
    >>> mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    >>> wheel = mechanism.body("wheel", mass=1, inertia=1, angular_velocity=speed)
    >>> mechanism.output("angle", wheel.angle, units="rad")
    >>> study = uqmbd.Study("turning", mechanism, np.linspace(0, 2, 5), [Collocation(order=1)])
    >>> problem = study.problem(study.propagators[0])
    >>> ensemble = problem.ensemble(np.array([[6.0], [7.0]]))
    >>> len(ensemble), ensemble.start.ok.tolist()
    (2, [True, True])
    >>> ensemble.energies(np.array([0.0]), ensemble.start.state[:, None])[:, 0, 0].round(6).tolist()  # kinetic, J
    [18.0, 24.5]
    """

    def __init__(
        self,
        model: Model,
        values: Array,
        *,
        start: Start | None = None,
        until: float | None = None,
        paths: SampledPaths | None = None,
    ) -> None:
        self.model = model
        whole = np.atleast_2d(np.asarray(values, dtype=float))
        self.values, keys, weights = path_terms(whole, model.parameters.kernel.inputs, len(model.paths))
        self.parameters = model.parameters(self.values)
        self.paths = SampledPaths(model.paths, self.values, keys, weights) if paths is None and model.paths else paths
        """Sampled paths of excitations, if the model has any."""
        if self.paths is not None:
            self.paths.reach(model.time, model.time if until is None else until)
            self.paths.insert(self.parameters)
        self.block = np.ascontiguousarray(self.parameters[:, : model.block_parameters])
        """Parameters of the blocks, shape (K, parameter)."""
        self._given_start = start

    def __len__(self) -> int:
        return len(self.parameters)

    @cached_property
    def start(self) -> Start:
        """Consistent initial states, in static equilibrium if the model requires it (``start_at``)."""
        if self._given_start is not None:
            return self._given_start
        if self.model.start_at == "equilibrium":
            # given velocities apply to the equilibrium, not to the given pose
            drawn = assemble(replace(self.model, statements=(), conditions=None), self.parameters, self.model.time)
            found = equilibrium_start(Ensemble(self.model, self.values, start=drawn, paths=self.paths))
        else:
            found = assemble(self.model, self.parameters, self.model.time)
        if self.paths is None or not self.paths.failed:
            return found
        return replace(found, messages=tuple(self.paths.failed.get(k, x) for k, x in enumerate(found.messages)))

    @cached_property
    def breaks(self) -> Array:
        """Break times of each realisation, shape (K, break)."""
        added = np.tile(np.array(self.model.added_breaks), (len(self), 1))
        return np.concatenate([self.parameters[:, self.model.breaks], added], axis=1)

    def pace(self, times: Array, rtol: float = 1e-6) -> tuple[Interval, ...]:
        """Return the integration intervals for all integrators: ends of steps, and longest steps.

        Intervals end at times of possible jumps, and at knots of tables over time that matter at the tolerance.

        Parameters
        ----------
        times : array, shape (T,)
            Output times, s.
        rtol : float
            Relative tolerance.

        Returns
        -------
        tuple of (end, longest, jumps)
            Consecutive intervals of the integration. ``end`` is the end of the smooth interval, and ``longest`` the
            longest step, both in s. ``jumps`` is whether a quantity may jump at the end. At a knot only a third
            derivative jumps, and ``jumps`` is false.
        """
        return pace(self, np.asarray(times, dtype=float), rtol, knots=True)

    def sampling(self, times: Array) -> Sampling | None:
        """Return the samples of the controllers in one integration, for integrators that declare ``sampled_control``.

        Parameters
        ----------
        times : array, shape (T,)
            Output times, s.

        Returns
        -------
        Sampling or None
            Samples; None if the mechanism has no controllers.  The attribute ``times`` (N,) contains the times of
            changes of states, s.  ``after(number, states, members)`` returns the states right after one of these times,
            and the reasons of realisations that cannot continue.  ``jumps(time, states, members)`` returns the jumps
            of velocities due to commanded speeds.
        """
        return Sampling(self, times) if self.model.controls else None

    def select(self, members: Index) -> Ensemble:
        """Return the ensemble of the selected realisations."""
        if len(members) == len(self) and np.array_equal(members, np.arange(len(self))):
            return self
        paths = None if self.paths is None else self.paths.select(members)
        return Ensemble(self.model, self.values[members], start=self.start.select(members), paths=paths)

    def without_paths(self) -> Ensemble:
        """Return the ensemble with the mean of every sampled path, about which a mechanism is linearised.

        Returns
        -------
        Ensemble
            Ensemble with other inputs; the ensemble itself if the mechanism has no sampled paths.
        """
        if self.paths is None:
            return self
        values = self.values.copy()
        values[:, [family.column for family in self.model.paths]] = MEAN_KEY
        return Ensemble(self.model, values)

    def pack(self, q: Array, s: Array, v: Array, multipliers: Array) -> Array:
        """Return the unknowns ``y`` of states.

        Parameters
        ----------
        q, s, v : array, shape (K, ...)
            Coordinates, auxiliary states and velocities.
        multipliers : array, shape (K, rank)
            Multipliers of all independent `equations`; only those in ``y`` are used.

        Returns
        -------
        array, shape (K, n)
            Unknowns ``y``.
        """
        layout = self.model.layout
        y = np.zeros((len(q), layout.unknowns))
        where = layout.slices
        y[:, where["q"]], y[:, where["s"]], y[:, where["v"]] = q[:, layout.free], s, v[:, layout.free]
        y[:, where["l"]] = multipliers[:, np.searchsorted(layout.kept, layout.active)]
        return y

    def expand(self, y: Array) -> tuple[Array, Array, Array]:
        """Return all coordinates, auxiliary states and velocities ``(q, s, v)`` of unknowns ``y`` (K, ..., n)."""
        layout = self.model.layout
        where = layout.slices
        q = np.zeros((*y.shape[:-1], layout.coordinates))
        v = np.zeros_like(q)
        q[..., layout.free], v[..., layout.free] = y[..., where["q"]], y[..., where["v"]]
        held = self.frozen.reshape(len(self), *([1] * (y.ndim - 2)), -1)
        q[..., layout.frozen] = held
        return q, y[..., where["s"]], v

    @cached_property
    def frozen(self) -> Array:
        """Values of the frozen coordinates, shape (K, frozen)."""
        return np.ascontiguousarray(self.start.q[:, self.model.layout.frozen])

    @cached_property
    def gradient_lengths(self) -> Array:
        """Lengths of the gradients of all equations at the start, shape (K, equation); 1 without a gradient."""
        return gradient_lengths(self.model, self.start, self.block)

    def residual(self, time: float, y: Array, yp: Array) -> Array:
        """Return the stabilised index-2 residual.

        Parameters
        ----------
        time : float
            Time, s.
        y, yp : array, shape (K, n)
            Unknowns ``(q, s, v, lambda, mu)`` and their rates.

        Returns
        -------
        array, shape (K, n)
            Residual.
        """
        arguments = self.model.layout.index2_arguments(time, y, yp, self.frozen)
        return self.model.evaluators["residual"](arguments, self.block)

    @property
    def pattern(self) -> tuple[Index, Index]:
        """Row of each entry of the Jacobian, shape (nnz,), and first entry of each column, shape (n + 1,).

        The entries are sorted by columns: ``scipy.sparse.csc_array((values, rows, pointers), shape=(n, n))``.
        """
        return self.model.pattern

    def jacobian(self, time: float, y: Array, yp: Array, c: float) -> Array:
        """Return values of ``dr/dy + c dr/dy'`` on the structural pattern `pattern`, shape (K, nnz).

        Parameters
        ----------
        time : float
            Time, s.
        y, yp : array, shape (K, n)
            Unknowns, from `pack`, and their rates.
        c : float
            Factor of the derivative with respect to the rates, 1/s.

        Returns
        -------
        array, shape (K, nnz)
            Entries in the order of the pattern.
        """
        arguments = self.model.layout.index2_arguments(time, y, yp, self.frozen, c)
        return self.model.evaluators["jacobian"](arguments, self.block)

    def outputs(self, times: Array, states: Array) -> Array:
        """Evaluate the outputs along trajectories, consistent with the equations of motion at each time.

        Angles are unwrapped over the times (`OutputMap.unwrap`). If outputs are observed in separate intervals, they
        must be unwrapped again after joining.

        Parameters
        ----------
        times : array, shape (T,) or (K, T)
            Times in s of all realisations or of each.
        states : array, shape (K, T, 2 coordinate + state)
            Coordinates, auxiliary states and velocities; accelerations and reactions are computed.

        Returns
        -------
        array, shape (K, output, T)
            Outputs, in their units.
        """
        return observe_along(self, self.model.outputs, times, states)

    @property
    def events(self) -> tuple[tuple[str, str, bool], ...]:
        """Component and label of each event, and whether it is an impact; other events do not change the motion."""
        return tuple((component, label, bool(directions)) for component, label, directions in self.model.events)

    def rates(self, time: Array | float, states: Array) -> Array:
        """Return the rates of states from the equations of motion (index 1), for explicit integrators.

        Parameters
        ----------
        time : float, or array, shape (K,)
            Time, s.
        states : array, shape (K, 2 coordinate + state)
            Coordinates, auxiliary states and velocities, consistent with the constraints.

        Returns
        -------
        array, shape (K, 2 coordinate + state)
            Rates of the states; NaN if the equations are singular.
        """
        q, s, v = self.model.layout.split(states)
        a, _, rates = accelerations(self.model, q, s, v, time, self.block)
        return np.concatenate([v, rates, a], axis=1)

    def accelerations(self, time: Array | float, states: Array) -> tuple[Array, Array]:
        """Solve the equations of motion for accelerations and multipliers.

        Parameters
        ----------
        time : float, or array, shape (K,)
            Time, s.
        states : array, shape (K, 2 coordinate + state)
            States, as for `rates`.

        Returns
        -------
        tuple of array, shapes (K, coordinate) and (K, kept)
            Accelerations of all coordinates, and multipliers of the independent `equations`; NaN if the equations are
            singular.
        """
        return accelerations(self.model, *self.model.layout.split(states), time, self.block)[:2]

    def equations_of_motion(self, time: Array | float, states: Array) -> tuple[Array, Array, Array, Array]:
        """Return the matrices and vectors of ``M a + D^T lambda = f`` and ``D a = g`` for the independent `equations`.

        Parameters
        ----------
        time : float, or array, shape (K,)
            Time, s.
        states : array, shape (K, 2 coordinate + state)
            States, as for `rates`; they need not satisfy the constraints.

        Returns
        -------
        tuple of array
            M (K, coordinate, coordinate): mass matrix. f (K, coordinate): forces, including velocity-dependent inertia.
            D (K, kept, coordinate): Jacobian of the constraints. g (K, kept): right-hand side.
        """
        model = self.model
        found = model.evaluate("acceleration", state_arguments(time, *model.layout.split(states)), self.block)
        kept = model.layout.kept
        return found["mass"], found["force"], found["d"][:, kept], found["gamma"][:, kept]

    @property
    def equations(self) -> tuple[str, ...]:
        """Names of the independent constraint equations, without redundant ones, in the order of multipliers."""
        return tuple(self.model.equations[k] for k in self.model.layout.kept)

    @property
    def unknowns(self) -> dict[str, slice]:
        """Parts of the unknowns ``y`` of `residual`, by letter: ``q``, ``s``, ``v``, and multipliers ``l``, ``m``.

        ``q`` and ``v`` belong to the coordinates that no constraint freezes. ``l`` and ``m`` belong to the independent
        equations that freeze no coordinate.
        """
        return dict(self.model.layout.slices)

    def on_constraints(self, time: Array | float, states: Array) -> Array:
        """Project states near the constraints onto them, in position and velocity, by the least change.

        The error of the result is quadratic in the error of the states.

        Parameters
        ----------
        time : float, or array, shape (K,)
            Time, s.
        states : array, shape (K, 2 coordinate + state)
            States, as for `rates`.

        Returns
        -------
        array, shape (K, 2 coordinate + state)
            Projected states.

        Raises
        ------
        uqmbd.StudyError
            If the mechanism is too large for compiled linear algebra.
        """
        if self.model.system is None or self.model.system.programs is None:
            raise StudyError(
                f"mechanism {self.model.name!r} has too many equations to project states onto the constraints."
            )
        times = np.broadcast_to(np.asarray(time, dtype=float), (len(states),))
        q, v = excess(self.model, states, times, self.block)
        found: Array = states - np.concatenate([q, np.zeros((len(q), self.model.layout.states)), v], axis=1)
        return found

    def guards(self, time: Array | float, states: Array) -> Array:
        """Return guards of all `events`, shape (K, event); the guard of an impact is its gap, m.

        An event is a zero crossing of its guard from positive to negative values.


        Arguments are those of `rates`.

        Parameters
        ----------
        time : float, or array, shape (K,)
            Time, s.
        states : array, shape (K, 2 coordinate + state)
            States, as for `rates`.

        Returns
        -------
        array, shape (K, event)
            Guards, in the order of `events`.
        """
        if not self.model.events:
            return np.zeros((len(states), 0))
        return self._contacts.guards(np.broadcast_to(np.asarray(time, dtype=float), (len(states),)), states, self.block)

    def after_impact(self, time: Array | float, states: Array, closed: Mask) -> Array:
        """Return states right after impacts, from the laws of restitution and friction; only velocities change.

        Parameters
        ----------
        time, states
            Time and states right before the impact, as for `rates`.
        closed : array of bool, shape (K, event)
            Whether each gap is closed; bodies that approach each other at a closed gap collide.

        Returns
        -------
        array, shape (K, 2 coordinate + state)
            States right after the impact; NaN if no impulses satisfy the laws.
        """
        times = np.broadcast_to(np.asarray(time, dtype=float), (len(states),))
        after, n = states.copy(), self.model.layout.coordinates
        for k in range(len(states)):
            row, gaps = slice(k, k + 1), [j for j in np.flatnonzero(closed[k]).tolist() if self.events[j][2]]
            found = impact(self._contacts(times[row], states[row], self.block[row]), gaps, approach=0.0)
            after[k, -n:] += np.nan if found is None else found[0]
        return after

    def event_times(self, happened: Mapping[int, Sequence[tuple[float, int, str]]]) -> dict[str, Array]:
        """Return the times of events by name, for the ``scalars`` of `uqmbd.extend.Trajectories`.

        Outputs use them as `uqmbd.Component.event_time`.

        Parameters
        ----------
        happened : mapping of int to sequence of (float, int, str)
            Events of each realisation in the order of time: time, index in `events`, and label.

        Returns
        -------
        dict of str to array, shape (K,)
            Event times, s; NaN for realisations without the event.
        """
        return event_times(self, happened)

    @cached_property
    def _contacts(self) -> ContactEvaluator:
        return ContactEvaluator(self.model)

    @typechecked
    def energies(self, times: Array, states: Array) -> Array:
        """Return the kinetic and potential energies along trajectories.

        Parameters
        ----------
        times : array, shape (T,)
            Times, s.
        states : array, shape (K, T, 2 coordinate + state)
            States, as for `outputs`.

        Returns
        -------
        array, shape (K, 2, T)
            Energies, J, kinetic first.

        Raises
        ------
        uqmbd.StudyError
            If the shapes of the arguments are invalid.
        """
        shape = (len(self.block), states.shape[1] if states.ndim == 3 else 0, self.model.layout.width)
        if states.shape != shape or times.shape not in (shape[1:2], shape[:2]):
            raise StudyError(
                f"Ensemble.energies: times is {shown(times)} and states is {shown(states)}; expected times (T,) and "
                f"states of the shape ({shape[0]}, T, {shape[2]})."
            )
        return energies(self, times, states)


def referenced(model: Model, means: Array) -> Model:
    """Return the model with the start angles of its outputs near those at the means (input,).

    The model contains the angle at the means. The turns of a realisation are therefore independent of the other
    realisations of a batch and of the worker.  If the mechanism cannot start at the means, angles start within half a
    turn of zero.
    """
    turns, counted = model.outputs.turns, model.outputs.counted
    if not turns.any():
        return model
    ensemble = Ensemble(model, means[None, :])
    reference = np.zeros(len(turns))
    if ensemble.start.ok[0]:
        owner = np.zeros(1, dtype=np.int64)
        found = observe(ensemble, model.outputs, ensemble.start.state, np.array([model.time]), owner)[0]
        reference = np.where((turns > 0) & np.isfinite(found), found, 0.0)
    # rounding must not choose between the two ends of the range of atan2
    cut = (turns > 0) & ~counted & (np.abs(reference + turns / 2) <= 1e-9 * turns)
    return replace(model, outputs=replace(model.outputs, reference=np.where(cut, reference + turns, reference)))
