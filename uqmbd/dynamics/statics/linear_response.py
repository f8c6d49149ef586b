"""Response of the linearised mechanism to excitations, for outputs that plugins compute from it.

Small motions about a pose at rest satisfy the constraints to first order: ``dq = N x + P w``, with a basis ``N`` of the
null space of ``D`` and ``D P = -dPhi/dw``.  The equations of motion along ``N`` and the rates of the auxiliary states
give ``z' = A z + B0 w + B1 w' + B2 w''`` for ``z = (x, x', s)``.  Multipliers and accelerations follow from the same
equations, so that every output has the form ``y = C z + D0 w + D1 w' + D2 w''``.  With the state
``z - (B1 + A B2) w - B2 w'`` the system is::

    z' = A z + B w              y = C z + E0 w + E1 w' + E2 w''
    B  = B0 + A B1 + A^2 B2     E0 = D0 + C (B1 + A B2)      E1 = D1 + C B2      E2 = D2
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import Instance, OutputMap, ParameterMap, excitations_of, state_arguments
from uqmbd.dynamics.linear import accelerations
from uqmbd.dynamics.statics.rest_equations import tangents
from uqmbd.dynamics.statics.unilateral import not_linear
from uqmbd.errors import StudyError
from uqmbd.mechanism import ORDERS, LinearOutput, Output, t
from uqmbd.randomness import RandomVariable
from uqmbd.typing import Array

__all__ = ["Channel", "LinearMap", "LinearSystem", "linear_map"]

CHUNK = 2048
"""Number of realisations that are linearised at once."""

ROUNDING = 1e-11
"""Direct response, relative to the whole response at the highest frequency of the mechanism, that counts as zero."""

DEFECTIVE = 1e10
"""Condition number of eigenvectors from which on systems are solved at each frequency instead of by their modes."""

PRESCRIBED = "a random process prescribes a speed, or a constraint contains a state; prescribe the position instead"


@dataclass(frozen=True)
class Channel:
    """Excitation of the linearised mechanism: a source at an argument, which is linear in time.

    Attributes
    ----------
    source : object
        Description of the excitation by a plugin.
    speed : array, shape (K,)
        Rate of the argument, in its units per s.
    offset : array, shape (K,)
        Argument at the time zero.

    Examples
    --------
    >>> import numpy as np
    >>> import uqmbd
    >>> from types import SimpleNamespace
    >>> road = SimpleNamespace(name="road", units="m")
    >>> rear = uqmbd.extend.Channel(road, np.array([20.0]), np.array([-2.5]))
    >>> float(-rear.offset[0] / rear.speed[0])  # delay, s
    0.125
    """

    source: Any
    speed: Array
    offset: Array


@dataclass(frozen=True)
class LinearSystem:
    """Response of one expression to the excitations of the linearised mechanism, in K realisations.

    With the excitations ``w(t)`` of all channels, ``z' = a z + b w`` and ``y = mean + c z + e0 w + e1 w' + e2 w''``.
    State-space form of the equations of motion within the constraints; the state has no units.

    Attributes
    ----------
    a : array, shape (K, n, n)
        System matrix, 1/s.
    b : array, shape (K, n, channel)
        Input matrix.
    c : array, shape (K, n)
        Output matrix.
    e : array, shape (K, 3, channel)
        Direct response to the excitations, and to their first and second rates. Rounding is set to zero.
    mean : array, shape (K,)
        Value of the expression in the pose of the linearisation.
    channels : tuple of Channel
        Excitations, in order.
    name : str
        The expression, for messages.

    Examples
    --------
    The frequency response of an oscillator, ``y'' + 0.2 y' + y = w``, at 1 rad/s:

    >>> import numpy as np
    >>> import uqmbd
    >>> a, b = np.array([[[0.0, 1.0], [-1.0, -0.2]]]), np.array([[[0.0], [1.0]]])
    >>> c, e = np.array([[1.0, 0.0]]), np.zeros((1, 3, 1))
    >>> system = uqmbd.extend.LinearSystem(a, b, c, e, np.zeros(1), (), "y")
    >>> bool(np.isclose(system.transfer(np.array([[1.0]]))[0, 0, 0], -5j))
    True
    """

    a: Array
    b: Array
    c: Array
    e: Array
    mean: Array
    channels: tuple[Channel, ...]
    name: str

    def __len__(self) -> int:
        return len(self.a)

    @cached_property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Eigenvalues of ``a``, 1/s, shape (K, n)."""
        return self._eigen[0]

    @cached_property
    def defective(self) -> NDArray[np.bool_]:
        """Whether equal eigenvalues have no separate eigenvectors, so that residues are unusable, shape (K,)."""
        vectors = self._eigen[1]
        if not vectors.shape[1]:
            return np.zeros(len(self), dtype=bool)
        return np.asarray(~(np.linalg.cond(vectors) < DEFECTIVE))

    @cached_property
    def residues(self) -> NDArray[np.complex128]:
        """Residues of the frequency response at the eigenvalues, shape (K, n, channel)."""
        values, vectors = self._eigen
        right = np.linalg.solve(vectors, self.b.astype(complex))
        return np.asarray((self.c[:, None, :] @ vectors)[:, 0, :, None] * right)

    @cached_property
    def _eigen(self) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        values, vectors = np.linalg.eig(self.a)
        return np.asarray(values, dtype=complex), np.asarray(vectors, dtype=complex)

    def transfer(self, frequencies: Array) -> NDArray[np.complex128]:
        """Return the frequency response ``y / w``.

        Parameters
        ----------
        frequencies : array, shape (K, F)
            Angular frequencies, rad/s.

        Returns
        -------
        array, shape (K, F, channel)
            Complex response to each excitation.

        Examples
        --------
        >>> import numpy as np
        >>> import uqmbd
        >>> a, b, c = np.array([[[-2.0]]]), np.array([[[2.0]]]), np.array([[1.0]])
        >>> low_pass = uqmbd.extend.LinearSystem(a, b, c, np.zeros((1, 3, 1)), np.zeros(1), (), "y")
        >>> round(float(abs(low_pass.transfer(np.array([[2.0]]))[0, 0, 0])) ** 2, 12)
        0.5
        """
        s = 1j * np.asarray(frequencies)[:, :, None]
        found = self.e[:, None, 0] + s * self.e[:, None, 1] + s**2 * self.e[:, None, 2]
        for k in range(self.a.shape[1]):
            found = found + self.residues[:, None, k] / (s - self.eigenvalues[:, None, k, None])
        found = np.asarray(found, dtype=complex)
        for k in np.flatnonzero(self.defective).tolist():
            systems = s[k][:, :, None] * np.eye(self.a.shape[1]) - self.a[k]
            direct = self.e[k, 0] + s[k] * self.e[k, 1] + s[k] ** 2 * self.e[k, 2]
            found[k] = direct + self.c[k] @ np.linalg.solve(
                systems, np.broadcast_to(self.b[k], (len(s[k]), *self.b[k].shape))
            )
        return found


@dataclass(frozen=True)
class LinearMap:
    """Compiled outputs of the linearised mechanism."""

    requests: tuple[tuple[Any, int, str, tuple[float, ...]], ...]
    """For each value: the declared function, the number of its expression, the pose, and further numbers."""
    seen: OutputMap
    """Expressions of the values, with all derivatives."""
    sources: tuple[Any, ...]
    arguments: ParameterMap
    """Speeds, then offsets, of the channels."""

    @property
    def poses(self) -> frozenset[str]:
        """Poses of the linearisations."""
        return frozenset(pose for _, _, pose, _ in self.requests)

    def evaluate(self, ensemble: Batch, pose: str, q: Array, s: Array) -> tuple[list[int], Array, list[str]]:
        """Evaluate the values of a pose (K, coordinate), (K, state) at rest.

        Return the numbers of the values, the values (K, value), and for each realisation the reason for missing values.
        """
        columns = [k for k, (_, _, at, _) in enumerate(self.requests) if at == pose]
        values, reasons = np.full((len(q), len(columns)), np.nan), [""] * len(q)
        for first in range(0, len(q), CHUNK):
            part = np.arange(first, min(first + CHUNK, len(q)))
            systems = self._systems(ensemble.select(part), q[part], s[part])
            for column, k in enumerate(columns):
                declared, number, _, numbers = self.requests[k]
                system = systems if isinstance(systems, list) else systems(number)
                if isinstance(system, list):
                    found: tuple[Array, Sequence[str]] = np.full(len(part), np.nan), system
                else:
                    found = declared.function(system, *numbers)
                values[part, column] = found[0]
                if any(found[1]):
                    for member, reason in zip(part.tolist(), found[1], strict=True):
                        reasons[member] = reasons[member] or reason
        lost = not_linear(ensemble, q, s)
        if any(lost):
            values[[bool(x) for x in lost]] = np.nan
            reasons = [first or second for first, second in zip(lost, reasons, strict=True)]
        return columns, values, reasons

    def _systems(self, ensemble: Batch, q: Array, s: Array) -> Callable[[int], LinearSystem] | list[str]:
        """Return a function from the number of an expression to its linear system, or the reasons why there is none."""
        model, count = ensemble.model, len(self.sources)
        speed, offset = np.split(self.arguments(ensemble.values), 2, axis=1)
        channels = tuple(Channel(x, speed[:, k], offset[:, k]) for k, x in enumerate(self.sources))
        layout, time, n = model.layout, model.time, model.layout.coordinates
        place, v = offset + time * speed, np.zeros_like(q)
        _, kept, _ = accelerations(model, q, s, v, time, ensemble.block)
        multipliers = np.zeros((len(q), layout.constraints))
        multipliers[:, layout.kept] = kept
        found = model.evaluate("linear", state_arguments(time, q, s, v, multipliers, v), ensemble.block)
        base = model.evaluate("acceleration", state_arguments(time, q, s, v), ensemble.block)
        own = ((found["s_q"] != 0).any(axis=2) | (found["s_s"] != 0).any(axis=2)).any(axis=0)
        own |= (found["s_c"] != 0).any(axis=(0, 2))
        if found["phi_c"][:, layout.nonholonomic].any() or found["phi_s"][:, :, own].any():
            return [PRESCRIBED] * len(q)
        mass, d = base["mass"], base["d"][:, layout.kept]

        def of_time(derivatives: Array) -> list[Array]:
            """Convert derivatives by coefficients to derivatives (K, row, channel) by excitations and their rates."""
            zero, one, two = np.moveaxis(derivatives.reshape(*derivatives.shape[:2], count, ORDERS), 3, 0)
            x, rate = place[:, None], speed[:, None]
            return [zero, (one - x * zero) / rate, (two - x * one + x**2 * zero / 2) / rate**2]

        gram = d @ d.transpose(0, 2, 1)
        follow = -d.transpose(0, 2, 1) @ _solve(gram, of_time(found["phi_c"][:, layout.kept])[0])
        basis = tangents(np.ascontiguousarray(d))
        free = basis.shape[2]
        size = 2 * free + int(own.sum())
        w = [slice(size + k * count, size + (k + 1) * count) for k in range(ORDERS)]

        def blank(rows: int) -> Array:
            return np.zeros((len(q), rows, size + ORDERS * count))

        dq, dv, ds = blank(n), blank(n), blank(layout.states)
        dq[:, :, :free], dq[:, :, w[0]] = basis, follow
        dv[:, :, free : 2 * free], dv[:, :, w[1]] = basis, follow
        ds[:, ~own] = found["s_v"][:, ~own] @ dq
        ds[:, np.flatnonzero(own), 2 * free + np.arange(int(own.sum()))] = 1.0
        force = found["v_q"] @ dq + found["v_v"] @ dv + found["v_s"] @ ds
        rates = found["s_q"] @ dq + found["s_v"] @ dv + found["s_s"] @ ds
        for k, part in enumerate(w):
            force[:, :, part] += of_time(found["v_c"])[k]
            rates[:, :, part] += of_time(found["s_c"])[k]
        across = basis.transpose(0, 2, 1)
        driven = force.copy()
        driven[:, :, w[2]] += mass @ follow
        along = -_solve(across @ mass @ basis, across @ driven)
        da = basis @ along
        da[:, :, w[2]] += follow
        dl = blank(layout.constraints)
        dl[:, layout.kept] = -_solve(gram, d @ (mass @ da + force))
        flow = np.concatenate([blank(free), along, rates[:, own]], axis=1)
        flow[:, np.arange(free), free + np.arange(free)] = 1.0
        a, b0, b1, b2 = flow[:, :, :size], *(flow[:, :, part] for part in w)
        carried = b1 + a @ b2
        state = np.concatenate([q, s, v, v, multipliers, np.full((len(q), 1), time)], axis=1)
        every = self.seen(state, ensemble.values, ensemble.block)
        expressions = len(self.seen.names)
        gradients = every[:, expressions:].reshape(len(q), expressions, -1)
        motion = np.concatenate([dq, ds, dv, da, dl], axis=1)
        fastest = np.sqrt(np.linalg.norm(a @ a, axis=(1, 2)))[:, None]

        def system(number: int) -> LinearSystem:
            gradient = gradients[:, number]
            row = (gradient[:, None, : motion.shape[1]] @ motion)[:, 0]
            for k, part in enumerate(w):
                row[:, part] += of_time(gradient[:, None, motion.shape[1] :])[k][:, 0]
            c = row[:, :size]
            b = b0 + a @ carried
            e = np.stack([row[:, part] for part in w], axis=1)
            e[:, 0] += np.einsum("kn,knc->kc", c, carried)
            e[:, 1] += np.einsum("kn,knc->kc", c, b2)
            powers = fastest[:, :, None] ** np.arange(ORDERS)[None, :, None]
            inside = np.einsum("kn,knc->kc", np.abs(c), np.abs(b)) / np.where(fastest == 0, 1.0, fastest)
            whole = (np.abs(e) * powers).max(axis=1) + inside
            e[np.abs(e) * powers <= ROUNDING * whole[:, None]] = 0.0
            return LinearSystem(a, b, c, e, every[:, number], channels, self.seen.names[number])

        return system


def _solve(matrix: Array, right: Array) -> Array:
    """Solve systems (K, m, m) for right-hand sides (K, m, columns)."""
    try:
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:  # a singular system must not affect the others
        return np.asarray(np.linalg.pinv(np.nan_to_num(matrix)) @ right)


def linear_map(
    found: Sequence[LinearOutput],
    instances: list[Instance],
    inputs: Sequence[RandomVariable],
    compiled: Callable[[Sequence[Output]], OutputMap],
) -> LinearMap | None:
    """Compile outputs of the linearised mechanism; `compiled` compiles expressions with all derivatives."""
    if not found:
        return None
    coefficients = excitations_of(instances)
    channels = [c for c in coefficients if c.order == 0]
    names: dict[str, Any] = {}
    for c in channels:
        name = c.source.source.name
        if names.setdefault(name, c.source) != c.source:
            raise StudyError(f"two different random processes have the name {name!r}; give each a different name.")
    if not channels:
        raise StudyError(
            f"output {str(found[0])!r} is a response to random processes, but no component of the mechanism contains "
            "one; use a process in a force, a driver or a road."
        )
    seen = sorted({x.seen for x in found}, key=str)
    requests = tuple((x.declared, seen.index(x.seen), x.at, x.numbers) for x in found)
    arguments = [*(c.argument.diff(t) for c in channels), *(c.argument.subs(t, 0) for c in channels)]
    return LinearMap(
        requests,
        compiled([Output(str(e), e, "") for e in seen]),
        tuple(c.source.source for c in channels),
        ParameterMap.of(arguments, inputs),
    )
