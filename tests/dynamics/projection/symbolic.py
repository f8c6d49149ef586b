"""Variational Work by algebra: energies and virtual work averaged with exact moments, then the equations of motion.

The dissertation's way, for small mechanisms and low orders, as a proof that the projected residual of the fast way
(`uqmbd.extend.ProjectedEnsemble.residual`) is that of Variational Work.  In this order:

1. coordinates, velocities and multipliers are expanded in the basis, in every term of the mechanism;
2. the Lagrangian, the virtual work and the constraints are averaged, ``L = E[T - V]``, ``C = E[lambda . Phi]``,
   ``W = E[F . dr]``: polynomials in the coefficients, by exact rational moments of the germs;
3. the Euler-Lagrange equations in the coefficients are taken, ``d/dt dL/dv_j - dL/dq_j + dC/dq_j - dW/d(dq_j) = 0``,
   and the constraints ``dC/d(lambda_j) = 0`` with their rates.

Constraints between velocities alone, ``a . v + b = 0``, hold as ``E[(a . v + b) psi_j] = 0``.  Their reactions enter by
their virtual work, ``-E[lambda . (a . dq)]`` (Lagrange and d'Alembert).

No quadrature and no equation of motion of a realisation enters.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from functools import cache, cached_property
from itertools import product
from math import factorial, prod
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

import uqmbd
from uqmbd.typing import Array

from .exact import FAMILIES, Compiled, Sum, gradient, moment

__all__ = ["VariationalWork"]

LETTERS = ("q", "v", "a", "d", "l")
"""Coefficients of coordinates, velocities, accelerations, virtual displacements and multipliers."""


class VariationalWork:
    """Equations of the coefficients of a mechanism, by averaging its energies and its virtual work.

    Parameters
    ----------
    mechanism : uqmbd.Mechanism
        Its terms must be polynomials in coordinates, velocities, time and random variables, without auxiliary states;
        its random variables independent, and normal or uniform.
    multi_index : array of int, shape (P, input)
        Degrees of the polynomials, as from `uqmbd.extend.index_set`.

    Raises
    ------
    uqmbd.StudyError
        If a term or a distribution is of another kind.

    Examples
    --------
    A stone of random mass that falls: ``E[m psi_i psi_j] v_j' = -g E[m psi_i]``, here with ``m = 2 + xi``.

    >>> import chaospy, numpy as np, uqmbd
    >>> mass = uqmbd.RandomVariable("mass", chaospy.Normal(2, 1))
    >>> mechanism = uqmbd.Mechanism("falling", uqmbd.Translational(gravity=(0, -10)))
    >>> stone = mechanism.body("stone", mass=mass)
    >>> work = VariationalWork(mechanism, uqmbd.extend.index_set(1, 1))
    >>> rest, fall = np.zeros((2, 2)), np.array([[0.0, -10.0], [0.0, 0.0]])
    >>> found = work.residual(0.0, rest, rest, np.zeros((2, 0)), np.zeros((2, 0)), rest, fall)
    >>> float(abs(found[1]).max())
    0.0
    """

    def __init__(self, mechanism: uqmbd.Mechanism, multi_index: NDArray[np.int64]) -> None:
        self.terms = uqmbd.extend.mechanism_terms(mechanism)
        self.name = mechanism.name
        if self.terms.states:
            raise uqmbd.StudyError(
                f"mechanism {self.name!r}: the state {self.terms.states[0]} has a differential equation of its own, "
                "which the symbolic route does not know; use uqmbd.extend.ProjectedEnsemble."
            )
        self.degrees = [tuple(map(int, row)) for row in multi_index]
        self.n, self.P, self.holonomic = len(self.terms.coordinates), len(self.degrees), len(self.terms.constraints)
        self.m = self.holonomic + len(self.terms.velocity_constraints)  # those between velocities alone behind others
        self._germs(mechanism)
        widths = [*(self.n * self.P,) * 4, self.m * self.P]
        self.first = dict(zip(LETTERS, np.cumsum([0, *widths[:-1]]).tolist(), strict=True))
        self.time = sum(widths)  # the variable after all coefficients; then a 1
        self.multipliers = tuple(sympy.Symbol(f"_lambda{i}", real=True) for i in range(self.m))
        self.displacements = tuple(sympy.Symbol(f"_delta{i}", real=True) for i in range(self.n))
        lists = (self.terms.coordinates, self.terms.velocities, (), self.displacements, self.multipliers)
        self.where = {
            x: (letter, k) for letter, symbols in zip(LETTERS, lists, strict=True) for k, x in enumerate(symbols)
        }

    def _germs(self, mechanism: uqmbd.Mechanism) -> None:
        """Random variables as first-degree polynomials of germs, with rational factors."""
        space = uqmbd.extend.GermSpace.of(mechanism.inputs)
        self.families = tuple(germ.family for germ in space.germs)
        self.germs = tuple(sympy.Symbol(f"_germ{k}", real=True) for k in range(space.dimension))
        probe = np.array([0.0, 1.0, -1.0, 0.5])
        values = space.to_inputs(np.tile(probe[:, None], (1, space.dimension)))
        base, slope = values[0], (values[1] - values[2]) / 2
        linear = np.allclose(values, base + np.outer(probe, slope), rtol=1e-13, atol=0)
        if not (linear and space.independent and set(self.families) <= set(FAMILIES)):
            raise uqmbd.StudyError(
                f"mechanism {self.name!r}: the symbolic route has moments of independent normal and uniform inputs; "
                f"those of {', '.join(space.names)} are {', '.join(self.families)}. Use uqmbd.extend.ProjectedEnsemble."
            )
        self.inputs = {
            variable: sympy.Rational(float(a)) + sympy.Rational(float(b)) * germ
            for variable, a, b, germ in zip(mechanism.inputs.variables, base, slope, self.germs, strict=True)
        }
        norms: dict[str, Callable[[int], Any]] = {"hermite": factorial, "legendre": lambda k: 1 / (2 * k + 1)}
        squares = [prod(norms[f](k) for f, k in zip(self.families, row, strict=True)) for row in self.degrees]
        self.norms = np.sqrt(np.array(squares, dtype=float))

    def _variable(self, letter: str, k: int, j: int) -> int:
        """Return the number of the coefficient of polynomial j of the k-th symbol of a letter."""
        return int(self.first[letter]) + j * (self.m if letter == "l" else self.n) + k

    def _average(self, expression: sympy.Expr) -> Sum:
        """Insert the expansions and take the expectation: a polynomial in the coefficients."""
        e = sympy.nsimplify(sympy.sympify(expression).xreplace(self.inputs), rational=True)
        symbols = sorted(e.free_symbols & set(self.where), key=str)
        try:
            polynomial = sympy.Poly(e, *symbols, uqmbd.t, *self.germs)
        except sympy.PolynomialError:
            polynomial = None
        if polynomial is None or polynomial.free_symbols_in_domain:
            raise uqmbd.StudyError(
                f"mechanism {self.name!r}: the term {expression} is no polynomial; the symbolic route averages "
                "polynomials only. Use uqmbd.extend.ProjectedEnsemble, which integrates anything."
            )
        found: Sum = defaultdict(lambda: sympy.QQ(0))
        for powers, factor in polynomial.terms():
            exact = sympy.QQ.from_sympy(factor if factor.is_Rational else sympy.Rational(float(factor)))
            parts = [x for x, power in zip(symbols, powers, strict=False) for _ in range(power)]
            time, germ = (self.time,) * powers[len(symbols)], powers[len(symbols) + 1 :]
            for chosen in product(range(self.P), repeat=len(parts)):
                expected = self._expectation(germ, tuple(sorted(chosen)))
                if expected:
                    variables = (self._variable(*self.where[x], j) for x, j in zip(parts, chosen, strict=True))
                    found[tuple(sorted((*variables, *time)))] += exact * expected
        return found

    @cached_property
    def _expectation(self) -> Any:
        @cache
        def expectation(powers: tuple[int, ...], chosen: tuple[int, ...]) -> Any:
            found = sympy.QQ(1)
            for d, (family, power) in enumerate(zip(self.families, powers, strict=True)):
                found *= moment(family, power, tuple(sorted(self.degrees[j][d] for j in chosen if self.degrees[j][d])))
                if not found:
                    break
            return found

        return expectation

    def _sum(self, expressions: Any) -> Sum:
        total: Sum = defaultdict(lambda: sympy.QQ(0))
        for e in expressions:
            for monomial, factor in self._average(e).items():
                total[monomial] += factor
        return total

    @cached_property
    def averaged_lagrangian(self) -> Sum:
        """``E[T - V]``."""
        return self._sum([*self.terms.kinetic, *(-e for e in self.terms.potential)])

    @cached_property
    def averaged_constraints(self) -> Sum:
        """``E[lambda . Phi]``."""
        return self._sum([x * phi for x, phi in zip(self.multipliers, self.terms.constraints, strict=False)])

    @cached_property
    def averaged_velocity_constraints(self) -> Sum:
        """``E[lambda . (a . v + b)]``."""
        own = self.multipliers[self.holonomic :]
        return self._sum([x * psi for x, psi in zip(own, self.terms.velocity_constraints, strict=True)])

    @cached_property
    def averaged_holding_work(self) -> Sum:
        """``E[lambda . (a . dq)]``: minus the virtual work of reactions between velocities."""
        own, rates = (
            self.multipliers[self.holonomic :],
            list(zip(self.terms.velocities, self.displacements, strict=True)),
        )
        pairs = zip(own, self.terms.velocity_constraints, strict=True)
        return self._sum([x * sympy.Add(*(psi.diff(v) * d for v, d in rates)) for x, psi in pairs])

    @cached_property
    def averaged_work(self) -> Sum:
        """``E[F . dr]``: the virtual displacement ``dr`` is what the velocity is linear in, of displacements."""
        pairs = []
        for force, velocity in self.terms.work:
            rates = list(zip(self.terms.velocities, self.displacements, strict=True))
            pairs.append(force * sympy.Add(*(velocity.diff(v) * d for v, d in rates)))
        return self._sum(pairs)

    def expression(self, polynomial: Sum) -> sympy.Expr:
        """Write an average in symbols ``q0_1``: coordinate 0, polynomial 1, times the norm of that polynomial."""
        symbols = []
        for letter in LETTERS:
            count = self.m if letter == "l" else self.n
            symbols += [sympy.Symbol(f"{letter}{k}_{j}") for j in range(self.P) for k in range(count)]
        symbols.append(uqmbd.t)
        return sympy.Add(*(sympy.QQ.to_sympy(f) * sympy.Mul(*(symbols[x] for x in m)) for m, f in polynomial.items()))

    def _flow(self, polynomial: Sum) -> Sum:
        """Total derivative in time."""
        found: Sum = defaultdict(lambda: sympy.QQ(0))
        size = self.n * self.P
        for variable, part in gradient(polynomial).items():
            # coordinates flow with the velocities, these with the accelerations, which stand behind them
            rate = () if variable == self.time else (variable + size,)
            for monomial, factor in part.items():
                found[tuple(sorted((*monomial, *rate)))] += factor
        return found

    @cached_property
    def _equations(self) -> dict[str, Compiled]:
        """Euler-Lagrange equations, constraint forces, constraints and their rates: rows (polynomial, symbol)."""
        lagrangian, work = gradient(self.averaged_lagrangian), gradient(self.averaged_work)
        constraints, sliding = gradient(self.averaged_constraints), gradient(self.averaged_holding_work)
        velocities = gradient(self.averaged_velocity_constraints)
        rows: dict[str, list[Sum]] = {"motion": [], "holding": [], "sliding": [], "phi": [], "psi": []}
        for j, k in product(range(self.P), range(self.n)):
            q, v, d = (self._variable(letter, k, j) for letter in "qvd")
            motion: Sum = defaultdict(lambda: sympy.QQ(0))
            parts = ((1, self._flow(lagrangian.get(v, {}))), (-1, lagrangian.get(q, {})), (-1, work.get(d, {})))
            for sign, part in parts:
                for monomial, factor in part.items():
                    motion[monomial] += sign * factor
            rows["motion"].append(motion)
            rows["holding"].append(constraints.get(q, {}))
            rows["sliding"].append(sliding.get(d, {}))
        for j, k in product(range(self.P), range(self.m)):
            phi = constraints.get(self._variable("l", k, j), {})
            rows["phi"].append(phi)
            rows["psi"].append(
                velocities.get(self._variable("l", k, j), {}) if k >= self.holonomic else self._flow(phi)
            )
        return {name: Compiled.of(entries, self.time + 1) for name, entries in rows.items()}

    def residual(
        self, time: float, q: Array, v: Array, lam: Array, mu: Array, q_rate: Array, v_rate: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Residual of the stabilised index-2 form, of orthonormal coefficients.

        Parameters
        ----------
        time : float
            s.
        q, v, q_rate, v_rate : array, shape (P, coordinate)
            Coefficients of all coordinates and velocities, and their rates.
        lam, mu : array, shape (P, constraint)
            Coefficients of all multipliers, of the constraints and of their rates; of those between velocities last.

        Returns
        -------
        q, v, l, m : array
            ``q' - v + D^T mu``, ``M v' + h - Q + D^T lambda``, ``Phi`` and its rate, projected.  Constraints between
            velocities have no ``Phi`` and no part in ``D^T mu``; ``mu`` stands in its place.
        """
        norms, rows = self.norms[:, None], self._equations
        still = np.zeros_like(q)
        given = [(x / norms).ravel() for x in (q, v, v_rate, still, lam)]
        values = np.concatenate([*given, [time, 1.0]])
        held = values.copy()
        held[self.first["l"] : self.time] = (mu / norms).ravel()

        def shaped(name: str, at: Array) -> Array:
            found: Array = rows[name](at).reshape(self.P, -1) / norms
            return found

        phi = shaped("phi", values)
        phi[:, self.holonomic :] = mu[:, self.holonomic :]
        return (
            q_rate - v + shaped("holding", held),
            shaped("motion", values) + shaped("holding", values) + shaped("sliding", values),
            phi,
            shaped("psi", values),
        )

    def projected_residual(
        self, projected: uqmbd.extend.ProjectedEnsemble, time: float, y: Array, rates: Array
    ) -> Array:
        """Residual in the unknowns of a projected ensemble, for comparison with `uqmbd.extend.ProjectedEnsemble.residual`.

        Parameters
        ----------
        projected : uqmbd.extend.ProjectedEnsemble
            Of the same mechanism and basis; it says which coordinates are held for good and which equations are kept.
        time : float
            s.
        y, rates : array, shape (P, unknown)
            Coefficients of the unknowns ``(q, v, lambda, mu)``, and their rates.

        Returns
        -------
        array, shape (P, unknown)
        """
        layout = projected.model.layout
        where, free = layout.slices, layout.free
        q, v, q_rate, v_rate = (np.zeros((self.P, self.n)) for _ in range(4))
        q[:, layout.frozen] = projected.adjoint @ projected.ensemble.frozen
        q[:, free], v[:, free], q_rate[:, free], v_rate[:, free] = (
            x[:, where[letter]] for x, letter in ((y, "q"), (y, "v"), (rates, "q"), (rates, "v"))
        )
        lam, mu = (np.zeros((self.P, self.m)) for _ in range(2))
        # equations of positions first
        order = np.argsort(np.isin(np.arange(self.m), layout.nonholonomic), kind="stable")
        active = np.argsort(order)[layout.active]
        lam[:, active], mu[:, active] = y[:, where["l"]], y[:, where["m"]]
        found = self.residual(time, q, v, lam, mu, q_rate, v_rate)
        chosen = (free, free, active, active)
        return np.concatenate([x[:, k] for x, k in zip(found, chosen, strict=True)], axis=1)
