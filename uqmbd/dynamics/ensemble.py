"""The ensemble: K realisations of one model, the numerical heart that every propagator shares.

Length: it is one class, whose methods are the whole protocol of integrators.
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
from uqmbd.dynamics.statics import equilibrium_start
from uqmbd.errors import StudyError
from uqmbd.typing import Array, Index, Mask

__all__ = ["Ensemble", "referenced"]


class Ensemble:
    """K realisations of a model: parameters are evaluated once, then residuals and Jacobians for all together.

    Parameters
    ----------
    model : Model
        Compiled.
    values : array, shape (K, input)
        Inputs of each realisation, in the order of ``model.inputs``.
    start : Start, optional
        Initial states, if they are known already.

    Examples
    --------
    Two wheels that turn at 6 and at 7 rad/s:

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

    def __init__(self, model: Model, values: Array, *, start: Start | None = None) -> None:
        self.model = model
        self.values = np.atleast_2d(np.asarray(values, dtype=float))
        self.parameters = model.parameters(self.values)
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
            # stated velocities belong to the equilibrium, not to the drawn pose
            drawn = assemble(replace(self.model, statements=(), conditions=None), self.parameters, self.model.time)
            return equilibrium_start(Ensemble(self.model, self.values, start=drawn))
        return assemble(self.model, self.parameters, self.model.time)

    @cached_property
    def breaks(self) -> Array:
        """Break times of each realisation, shape (K, break)."""
        added = np.tile(np.array(self.model.added_breaks), (len(self), 1))
        return np.concatenate([self.parameters[:, self.model.breaks], added], axis=1)

    def pace(self, times: Array, rtol: float = 1e-6) -> tuple[Interval, ...]:
        """Lay out an integration: where steps end, and how long they may be, for every integrator alike.

        Intervals end at times at which something jumps, and at knots of tables over time that count at the tolerance.

        Parameters
        ----------
        times : array, shape (T,)
            Output times, s.
        rtol : float
            Relative tolerance.

        Returns
        -------
        tuple of (end, longest, jumps)
            Intervals of the integration, one after the other: until when all is smooth, s, the longest step, s, and
            whether something may jump at the end; at a knot, where a third derivative jumps, nothing does.
        """
        return pace(self, np.asarray(times, dtype=float), rtol, knots=True)

    def sampling(self, times: Array) -> Sampling | None:
        """Return the samples of the controllers in one integration, for integrators that declare ``sampled``.

        Parameters
        ----------
        times : array, shape (T,)
            Output times, s.

        Returns
        -------
        Sampling or None
            None: the mechanism has no controllers.  Its ``times`` (N,) are those at which states change;
            ``after(number, states, members)`` gives the states right after one of them, and reasons of those who
            cannot go on; ``jumps(time, states, members)`` how velocities follow speeds that are commanded.
        """
        return Sampling(self, times) if self.model.controls else None

    def select(self, members: Index) -> Ensemble:
        """Return the ensemble of some realisations."""
        if len(members) == len(self) and np.array_equal(members, np.arange(len(self))):
            return self
        return Ensemble(self.model, self.values[members], start=self.start.select(members))

    def pack(self, q: Array, s: Array, v: Array, multipliers: Array) -> Array:
        """Unknowns ``y`` of states.

        Parameters
        ----------
        q, s, v : array, shape (K, ...)
            All coordinates, auxiliary states and velocities.
        multipliers : array, shape (K, rank)
            Of all kept equations; only those that are in ``y`` are used.

        Returns
        -------
        array, shape (K, n)
        """
        layout = self.model.layout
        y = np.zeros((len(q), layout.unknowns))
        where = layout.slices
        y[:, where["q"]], y[:, where["s"]], y[:, where["v"]] = q[:, layout.free], s, v[:, layout.free]
        y[:, where["l"]] = multipliers[:, np.searchsorted(layout.kept, layout.active)]
        return y

    def expand(self, y: Array) -> tuple[Array, Array, Array]:
        """Find all coordinates, auxiliary states and velocities of unknowns ``y``, shape (K, ..., n)."""
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
        """Lengths of the gradients of all equations at the start, shape (K, equation); 1 where there is none."""
        return gradient_lengths(self.model, self.start, self.block)

    def residual(self, time: float, y: Array, yp: Array) -> Array:
        """Stabilised index-2 residual.

        Parameters
        ----------
        time : float
            s.
        y, yp : array, shape (K, n)
            Unknowns ``(q, s, v, lambda, mu)`` and their rates.

        Returns
        -------
        array, shape (K, n)
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
        """Values of ``dr/dy + c dr/dy'`` on the structural pattern `pattern`, shape (K, nnz).

        Parameters
        ----------
        time : float
            s.
        y, yp : array, shape (K, n)
            Unknowns, as `pack` makes them, and their rates.
        c : float
            Factor of the derivative by the rates, 1/s.

        Returns
        -------
        array, shape (K, nnz)
            Entry by entry of the pattern.
        """
        arguments = self.model.layout.index2_arguments(time, y, yp, self.frozen, c)
        return self.model.evaluators["jacobian"](arguments, self.block)

    def outputs(self, times: Array, states: Array) -> Array:
        """Evaluate the outputs along trajectories, consistent with the equations of motion at each time.

        Outputs that are angles are unwrapped over the times (`OutputMap.unwrap`); what is observed in pieces of time
        is unwrapped once more when it is joined.

        Parameters
        ----------
        times : array, shape (T,) or (K, T)
            Of all realisations, or of each, s.
        states : array, shape (K, T, 2 coordinate + state)
            All coordinates, auxiliary states and velocities; accelerations and reactions are solved for.

        Returns
        -------
        array, shape (K, output, T)
        """
        return observe_along(self, self.model.outputs, times, states)

    @property
    def events(self) -> tuple[tuple[str, str, bool], ...]:
        """Component and label of each event, and whether it is an impact; other events change nothing."""
        return tuple((component, label, bool(directions)) for component, label, directions in self.model.events)

    def rates(self, time: Array | float, states: Array) -> Array:
        """Return the rates of states by the equations of motion (index 1), as an explicit integrator needs them.

        Parameters
        ----------
        time : float, or array, shape (K,)
            s.
        states : array, shape (K, 2 coordinate + state)
            Coordinates, auxiliary states and velocities, consistent with the constraints.

        Returns
        -------
        array, shape (K, 2 coordinate + state)
            NaN where the equations are singular.
        """
        q, s, v = self.model.layout.split(states)
        a, _, rates = accelerations(self.model, q, s, v, time, self.block)
        return np.concatenate([v, rates, a], axis=1)

    def accelerations(self, time: Array | float, states: Array) -> tuple[Array, Array]:
        """Solve the equations of motion for accelerations and multipliers.

        Parameters
        ----------
        time : float, or array, shape (K,)
            s.
        states : array, shape (K, 2 coordinate + state)
            As for `rates`.

        Returns
        -------
        tuple of array, shapes (K, coordinate) and (K, kept)
            Accelerations of all coordinates, and the multipliers of the kept `equations`; NaN where the equations are
            singular.
        """
        return accelerations(self.model, *self.model.layout.split(states), time, self.block)[:2]

    def equations_of_motion(self, time: Array | float, states: Array) -> tuple[Array, Array, Array, Array]:
        """Return the numbers of ``M a + D^T lambda = f`` and ``D a = g`` for the kept `equations`.

        Parameters
        ----------
        time : float, or array, shape (K,)
            s.
        states : array, shape (K, 2 coordinate + state)
            As for `rates`; they need not be on the constraints.

        Returns
        -------
        tuple of array
            M (K, coordinate, coordinate): the mass matrix. f (K, coordinate): the forces, with those of inertia.
            D (K, kept, coordinate): the Jacobian of the constraints. g (K, kept).
        """
        model = self.model
        found = model.evaluate("acceleration", state_arguments(time, *model.layout.split(states)), self.block)
        kept = model.layout.kept
        return found["mass"], found["force"], found["d"][:, kept], found["gamma"][:, kept]

    @property
    def equations(self) -> tuple[str, ...]:
        """Names of the kept constraint equations, in the order of multipliers: redundant ones are left out."""
        return tuple(self.model.equations[k] for k in self.model.layout.kept)

    @property
    def unknowns(self) -> dict[str, slice]:
        """Parts of the unknowns ``y`` of `residual`, by letter: ``q``, ``s``, ``v``, and multipliers ``l``, ``m``.

        ``q`` and ``v`` are the coordinates that no constraint freezes, and ``l`` and ``m`` the kept equations without
        those that freeze one.
        """
        return dict(self.model.layout.slices)

    def on_constraints(self, time: Array | float, states: Array) -> Array:
        """Project states that are nearly on the constraints onto them, in position and velocity, by the least change.

        Arguments and result are those of `rates`; the error is quadratic in that of the states.

        Parameters
        ----------
        time : float, or array, shape (K,)
            s.
        states : array, shape (K, 2 coordinate + state)
            As for `rates`.

        Returns
        -------
        array, shape (K, 2 coordinate + state)
            Corrected.

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
        """Guards of all `events`, shape (K, event): gaps of impacts, m; an event happens where one falls through zero.

        Arguments are those of `rates`.

        Parameters
        ----------
        time : float, or array, shape (K,)
            s.
        states : array, shape (K, 2 coordinate + state)
            As for `rates`.

        Returns
        -------
        array, shape (K, event)
            In the order of `events`.
        """
        if not self.model.events:
            return np.zeros((len(states), 0))
        return self._contacts.guards(np.broadcast_to(np.asarray(time, dtype=float), (len(states),)), states, self.block)

    def after_impact(self, time: Array | float, states: Array, closed: Mask) -> Array:
        """States right after impacts, by the laws of restitution and friction; other than velocities nothing changes.

        Parameters
        ----------
        time, states
            Right before, as for `rates`.
        closed : array of bool, shape (K, event)
            Gaps that are closed; bodies there that approach each other collide.

        Returns
        -------
        array, shape (K, 2 coordinate + state)
            NaN where no impulses satisfy the laws.
        """
        times = np.broadcast_to(np.asarray(time, dtype=float), (len(states),))
        after, n = states.copy(), self.model.layout.coordinates
        for k in range(len(states)):
            row, gaps = slice(k, k + 1), [j for j in np.flatnonzero(closed[k]).tolist() if self.events[j][2]]
            found = impact(self._contacts(times[row], states[row], self.block[row]), gaps, approach=0.0)
            after[k, -n:] += np.nan if found is None else found[0]
        return after

    def event_times(self, happened: Mapping[int, Sequence[tuple[float, int, str]]]) -> dict[str, Array]:
        """Name the times of events, for the ``scalars`` of `uqmbd.extend.Trajectories`.

        Outputs use them as `uqmbd.Component.event_time`.

        Parameters
        ----------
        happened : mapping of int to sequence of (float, int, str)
            By realisation, in the order of time: when, which of `events`, and its label.

        Returns
        -------
        dict of str to array, shape (K,)
            NaN where a realisation has no such event.
        """
        return event_times(self, happened)

    @cached_property
    def _contacts(self) -> ContactEvaluator:
        return ContactEvaluator(self.model)

    @typechecked
    def energies(self, times: Array, states: Array) -> Array:
        """Kinetic and potential energy along trajectories, J, shape (K, 2, T); arguments as of `outputs`.

        Parameters
        ----------
        times : array, shape (T,)
            s.
        states : array, shape (K, T, 2 coordinate + state)
            As for `outputs`.

        Returns
        -------
        array, shape (K, 2, T)
            J, kinetic first.

        Raises
        ------
        uqmbd.StudyError
            If shapes do not fit.
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

    The angle at the means belongs to the model, so that the turns of a realisation depend on the realisation alone:
    neither on the other realisations of a batch nor on the worker.  If the mechanism cannot start at the means, angles
    start within half a turn of zero.
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
