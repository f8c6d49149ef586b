"""State-space form of the linearised mechanism, for functions of plugins."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.typing import Array

__all__ = ["Channel", "LinearSystem"]

DEFECTIVE = 1e10
"""Condition number of eigenvectors from which on systems are solved at each frequency instead of by their modes."""


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

    With the excitations ``w(t)`` of all channels, the system is ``z' = a z + b w`` and ``y = mean + c z + e0 w + e1 w'
    + e2 w''``. This is the state-space form of the equations of motion within the constraints; the state has no units.

    Attributes
    ----------
    a : array, shape (K, n, n)
        System matrix, 1/s.
    b : array, shape (K, n, channel)
        Input matrix.
    c : array, shape (K, n)
        Output matrix.
    e : array, shape (K, 3, channel)
        Direct response to the excitations, and to their first and second rates. Values at the level of rounding are set
        to zero.
    mean : array, shape (K,)
        Value of the expression in the pose of the linearisation; NaN if it changes during the steady motion.
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
