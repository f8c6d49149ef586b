"""Terms of a whole mechanism as expressions: the basis of its equations, for further derivations."""

from __future__ import annotations

from dataclasses import dataclass

import sympy

from uqmbd.arguments import typechecked
from uqmbd.dynamics.equations.block import Instance, instances_of
from uqmbd.dynamics.equations.expressions import TIME
from uqmbd.mechanism import AuxiliarySymbol, Mechanism, t

__all__ = ["MechanismTerms", "mechanism_terms"]


@dataclass(frozen=True)
class MechanismTerms:
    """Energies, virtual work and constraints of all bodies and components of a mechanism.

    Symbols are those of the bodies (``body.q``, ``body.v``), the random variables, `uqmbd.t`, and `states`.

    Attributes
    ----------
    coordinates, velocities : tuple of symbols
        Coordinates and velocities of all bodies, then of components, in the order of the states of an ensemble.
    kinetic, potential : tuple of expressions
        Energies, J, one for each body or component with such an energy.
    work : tuple of (force, velocity)
        Generalised forces are ``sum of force * d velocity / d v_i``.
    constraints : tuple of expressions
        Left-hand sides that equal zero, in the order of an ensemble's position equations.
    equations : tuple of str
        Names of the constraints.
    states, rates, initial : tuple of symbols, of expressions, of expressions
        Auxiliary differential states, ``state' = rate``, and their initial values.
    velocity_constraints : tuple of expressions
        Left-hand sides that equal zero, linear in velocities, in the order of an ensemble's velocity-only equations.
    velocity_equations : tuple of str
        Names of the velocity constraints.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
    >>> stone = mechanism.body("stone", mass=2)
    >>> terms = uqmbd.extend.mechanism_terms(mechanism)
    >>> terms.kinetic, terms.potential
    ((stone.x'**2,), (19.62*stone.x,))
    """

    coordinates: tuple[sympy.Symbol, ...]
    velocities: tuple[sympy.Symbol, ...]
    kinetic: tuple[sympy.Expr, ...]
    potential: tuple[sympy.Expr, ...]
    work: tuple[tuple[sympy.Expr, sympy.Expr], ...]
    constraints: tuple[sympy.Expr, ...]
    equations: tuple[str, ...]
    states: tuple[sympy.Symbol, ...] = ()
    rates: tuple[sympy.Expr, ...] = ()
    initial: tuple[sympy.Expr, ...] = ()
    velocity_constraints: tuple[sympy.Expr, ...] = ()
    velocity_equations: tuple[str, ...] = ()


@typechecked
def mechanism_terms(mechanism: Mechanism) -> MechanismTerms:
    """Collect the terms of all bodies and components of a mechanism.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism with the terms to collect.

    Returns
    -------
    MechanismTerms
        Terms of the mechanism.

    Raises
    ------
    uqmbd.StudyError
        If a component yields an object that is not a term.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("falling", uqmbd.Translational(gravity=(0, -10)))
    >>> stone = mechanism.body("stone", mass=2)
    >>> terms = uqmbd.extend.mechanism_terms(mechanism)
    >>> terms.potential[0]
    20*stone.y
    """
    kinetic: list[sympy.Expr] = []
    potential: list[sympy.Expr] = []
    work: list[tuple[sympy.Expr, sympy.Expr]] = []
    constraints: list[sympy.Expr] = []
    equations: list[str] = []
    velocity_constraints: list[sympy.Expr] = []
    velocity_equations: list[str] = []
    states: list[sympy.Symbol] = []
    rates: list[sympy.Expr] = []
    initial: list[sympy.Expr] = []
    for instance in instances_of(mechanism.all_components(), mechanism.space):
        block, own = instance.type, _states(instance)
        known = _globals(instance, own)
        whole = block.whole
        if block.kinetic != 0:
            kinetic.append(whole(block.kinetic).xreplace(known))
        if block.potential != 0:
            potential.append(whole(block.potential).xreplace(known))
        work += [(whole(f).xreplace(known), whole(w).xreplace(known)) for f, w in block.work]
        for e, label, holonomic in zip(block.constraints, block.labels, block.holonomic, strict=True):
            (constraints if holonomic else velocity_constraints).append(whole(e).xreplace(known))
            (equations if holonomic else velocity_equations).append(f"{instance.component.name}: {label}")
        states += own
        rates += [whole(e).xreplace(known) for e in block.rates]
        initial += [whole(e).xreplace(known) for e in block.initial]
    owners = mechanism.coordinate_owners()
    return MechanismTerms(
        tuple(x for one in owners for x in one.q),
        tuple(x for one in owners for x in one.v),
        tuple(kinetic),
        tuple(potential),
        tuple(work),
        tuple(constraints),
        tuple(equations),
        tuple(states),
        tuple(rates),
        tuple(initial),
        tuple(velocity_constraints),
        tuple(velocity_equations),
    )


def _states(instance: Instance) -> list[sympy.Symbol]:
    return [sympy.Symbol(f"{instance.component.name}.{name}", real=True) for name in instance.type.states]


def _globals(instance: Instance, states: list[sympy.Symbol]) -> dict[sympy.Basic, sympy.Expr]:
    """Return the meaning of each local symbol."""
    lists = {
        "q": [x for one in instance.owners for x in one.q],
        "v": [x for one in instance.owners for x in one.v],
        "s": states,
        "p": list(instance.parameters),
        "h": [
            sympy.Symbol(f"{x.component.name}.{x.state}", real=True) if isinstance(x, AuxiliarySymbol) else x
            for x in instance.held
        ],
    }
    known: dict[sympy.Basic, sympy.Expr] = {TIME: t}
    for letter, values in lists.items():
        known |= {sympy.Symbol(f"_{letter}{k}", real=True): value for k, value in enumerate(values)}
    return known
