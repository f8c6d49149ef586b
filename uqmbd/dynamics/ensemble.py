"""The ensemble: K realisations of one model, the numerical heart that every propagator shares."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics.assembly import Start, assemble
from uqmbd.dynamics.index1 import accelerations, dense, state_arguments
from uqmbd.dynamics.model import Model

__all__ = ["Ensemble"]

Array = NDArray[np.float64]

OUTPUT_BLOCK = 2048
"""States that are observed at once: many more of them fall out of the processor's cache."""


class Ensemble:
    """K realisations of a model: parameters are evaluated once, then residuals and Jacobians for all together.

    Parameters
    ----------
    model : Model
        Compiled.
    values : array, shape (K, input)
        Inputs of each realisation, in the order of ``model.inputs``.
    """

    def __init__(self, model: Model, values: Array) -> None:
        self.model = model
        self.values = np.atleast_2d(np.asarray(values, dtype=float))
        self.parameters = model.parameters(self.values)
        self.block = np.ascontiguousarray(self.parameters[:, : model.block_parameters])
        """Parameters of the blocks, shape (K, parameter)."""

    def __len__(self) -> int:
        return len(self.parameters)

    @property
    def breaks(self) -> Array:
        """Break times of each realisation, shape (K, break)."""
        return self.parameters[:, self.model.breaks]

    def select(self, members: NDArray[np.int64]) -> Ensemble:
        """Make the ensemble of some realisations."""
        if len(members) == len(self) and np.array_equal(members, np.arange(len(self))):
            return self
        return Ensemble(self.model, self.values[members])

    def start(self, time: float) -> Start:
        """Assemble consistent initial states."""
        return assemble(self.model, self.parameters, time)

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
        arguments = self._arguments(time, y, yp, ())
        return self.model.evaluators["residual"](arguments, self.block)

    def jacobian(self, time: float, y: Array, yp: Array, c: float) -> Array:
        """Values of ``dr/dy + c dr/dy'`` on the structural pattern ``model.pattern``, shape (K, nnz)."""
        arguments = self._arguments(time, y, yp, (c,))
        return self.model.evaluators["jacobian"](arguments, self.block)

    def _arguments(self, time: float, y: Array, yp: Array, extra: tuple[float, ...]) -> Array:
        layout = self.model.layout
        n, d = layout.unknowns, layout.differential
        arguments = np.zeros((len(y), n + d + 2 + len(extra)))
        arguments[:, :n] = y
        arguments[:, n : n + d] = yp[:, :d]
        arguments[:, n + d] = time
        for k, x in enumerate(extra):
            arguments[:, n + d + 1 + k] = x
        return arguments

    def outputs(self, times: Array, y: Array) -> Array:
        """Evaluate the outputs along trajectories, consistent with the equations of motion at each time.

        Parameters
        ----------
        times : array, shape (T,)
            s.
        y : array, shape (K, T, n)
            Unknowns; accelerations and reactions are solved for again.

        Returns
        -------
        array, shape (K, output, T)
        """
        members, count = y.shape[0], y.shape[1]
        flat, time = y.reshape(members * count, -1), np.tile(times, members)
        owner = np.repeat(np.arange(members), count)
        result = np.empty((members * count, len(self.model.outputs.names)))
        for first in range(0, len(flat), OUTPUT_BLOCK):
            part = slice(first, first + OUTPUT_BLOCK)
            result[part] = self._observe(flat[part], time[part], owner[part])
        return result.reshape(members, count, -1).transpose(0, 2, 1)

    def _observe(self, y: Array, time: Array, owner: NDArray[np.int64]) -> Array:
        """Observe states ``y`` (S, n) of the realisations `owner` (S,) at times (S,)."""
        model, layout = self.model, self.model.layout
        where = layout.slices
        q, s, v = y[:, where["q"]], y[:, where["s"]], y[:, where["v"]]
        quaternions = model.quaternions()
        if quaternions.size:
            q = q.copy()
            e = q[:, quaternions]
            q[:, quaternions] = e / np.linalg.norm(e, axis=2, keepdims=True)
        parameters = self.block[owner]
        a, multipliers = np.zeros_like(q), np.zeros((len(q), layout.constraints))
        if model.outputs.accelerates:
            a, multipliers[:, layout.kept], _ = accelerations(model, q, s, v, time, parameters)
        state = np.concatenate([q, s, v, a, multipliers, time[:, None]], axis=1)
        return np.asarray(model.outputs(state, self.values[owner], parameters))

    def energies(self, times: Array, y: Array) -> Array:
        """Kinetic and potential energy along trajectories, J, shape (K, 2, T)."""
        where = self.model.layout.slices
        flat = y.reshape(-1, y.shape[2])
        arguments = state_arguments(
            flat[:, where["q"]], flat[:, where["s"]], flat[:, where["v"]], np.tile(times, len(y))
        )
        found = dense(self.model, "energy", arguments, np.repeat(self.block, y.shape[1], axis=0))["energy"]
        return found.reshape(len(y), y.shape[1], 2).transpose(0, 2, 1)
