"""Test a component: derivatives, compiled forms, and laws that apply to every mechanism."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism import Component, Space, effective_parameters
from uqmbd.propagation import Propagator
from uqmbd.testing.components.axes import check_axes
from uqmbd.testing.components.bench import REALISATIONS, Bench, own_coordinates
from uqmbd.testing.components.cases import component_cases, name_of
from uqmbd.testing.components.dissipation import check_dissipation
from uqmbd.testing.components.effects import check_effects
from uqmbd.testing.components.energy import check_energy
from uqmbd.testing.components.events import check_events
from uqmbd.testing.components.inertia import check_inertia
from uqmbd.testing.components.loads import feasible_state, loads_at
from uqmbd.testing.components.methods import check_studies
from uqmbd.testing.components.motion import displaced, random_turn, virtual_motions
from uqmbd.testing.components.motion_rates import check_motion_rates
from uqmbd.testing.components.units import check_units
from uqmbd.units import spelling

__all__ = ["check_component"]


@typechecked(values=False)
def check_component(
    component: type[Component],
    *,
    spaces: tuple[type[Space], ...] | None = None,
    given: Mapping[str, Any] | None = None,
    internal: bool = True,
    conservative: bool = True,
    dissipative: bool = True,
    propagators: Sequence[str | Propagator] | None = None,
    seed: int = 0,
) -> None:
    """Check a component in mechanisms with random poses and values, in every space that it declares.

    - The parameters have units and descriptions, each has an effect, and all may be random. Auxiliary states without
      stated units, which outputs do not record, also have an effect.
    - Units of parameters and auxiliary states agree with the terms: energies are in J, and force times velocity is in
      W. The rate of a state is in its units per second, and terms of a sum have equal units.
    - The exact Jacobian agrees with central differences of the residual.
    - Simultaneous and separate computations of realisations agree.
    - Between two bodies: forces and moments cancel (action and reaction). Forces and moments do not
      depend on the common displacement and rotation of the bodies.
    - Events with velocity jumps: the speed of the impact is the rate of its gap, and impulses act only between the
      bodies.
    - Vectors and moments are in the declared axes: their forces rotate with the body, or with the world.
    - Potentials and constraints without time conserve energy.
    - Virtual work creates no energy: no small closed motion of the bodies gains energy, at any speeds of its parts.
      Auxiliary states do not grow while the bodies rest, and their forces oppose the motion that changes them. The
      coefficients of impacts are in their ranges.
    - In the motion of the component (`uqmbd.Component.motion`), rates are the rates of angles and
      displacements. Angles, displacements and rates do not depend on the pose of the whole mechanism.
    - Every installed propagator runs a study of a small mechanism with the component, and the results agree.

    Parameters
    ----------
    component : type
        Subclass of `uqmbd.Component`.
    spaces : tuple of types, optional
        Spaces of the check. Default: all spaces that the component declares.
    given : mapping, optional
        Fixed values, by parameter, for parameters that require special values.
    internal : bool
        Whether a component of several bodies acts only between them, so that action equals reaction.
    conservative : bool
        Whether the energy must be constant if there are only potentials and constraints without time.
    dissipative : bool
        Whether forces of `uqmbd.VirtualWork`, auxiliary states and impacts must not create energy. False for motors,
        controllers and intentionally unstable components.
    propagators : sequence of str or Propagator, optional
        Methods that run a study with the component, by name (with low-cost settings) or as objects. Default: all
        installed methods. ``()`` runs no study and is faster.
    seed : int
        Seed of the random poses and values.

    Raises
    ------
    AssertionError
        If a check fails; the message states the check and the case.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd.testing import check_component
    >>> class Spring(uqmbd.Component):
    ...     \"\"\"A spring without length.\"\"\"
    ...     stiffness = uqmbd.Parameter("N/m", "spring rate")
    ...     def terms(self, p):
    ...         d = p.body_j.position - p.body_i.position
    ...         yield uqmbd.Potential(p.stiffness * d.dot(d) / 2)
    >>> check_component(Spring, spaces=(uqmbd.Planar,))
    """
    _check_declaration(component)
    unknown = sorted(set(given or ()) - set(component.parameters()))
    usage = f"{component.__name__}{component.signature()}"
    assert not unknown, (
        f"check_component: the argument 'given' contains {unknown[0]!r}; expected parameters of {usage}."
    )
    _check_some_effect(component, component.spaces if spaces is None else spaces, given or {})
    for space in component.spaces if spaces is None else spaces:
        rng = np.random.default_rng([seed, zlib.crc32(f"{component.__name__} {space.__name__}".encode())])
        for number, case in enumerate(component_cases(component, space, given or {}, rng)):
            bench = Bench.of(f"{name_of(component, space)}, {case.title}", case, rng)
            if number == 0:
                check_units(bench.title, case.component, case.mechanism.space)
            check_jacobian(bench, rng)
            check_broadcasting(bench, rng)
            check_events(bench, rng, between=internal and case.free and len(component.bodies) > 1)
            check_inertia(bench, rng)
            if number == 0:
                check_effects(bench, rng, set(given or ()))
                check_axes(bench, rng)
            if conservative:
                check_energy(bench, rng)
            if internal and case.free and len(component.bodies) > 1:
                _check_mechanics(bench, rng)
            if dissipative:
                check_dissipation(bench, np.random.default_rng([seed, number]))
            if number == 0 and type(case.component).motion is not Component.motion:
                _check_motion(bench, np.random.default_rng(seed))
        check_studies(component, space, given or {}, rng, propagators, conservative=conservative)


def _check_declaration(component: type[Component]) -> None:
    assert component.__doc__, f"{component.__name__} has no docstring; describe the component in one sentence."
    for key, parameter in component.parameters().items():
        assert parameter.description, f"{component.__name__}.{key} has no description; pass one to uqmbd.Parameter."
        numeric = parameter.kind != "option"
        assert parameter.units or not numeric, (
            f"{component.__name__}.{key} has no units; declare its units, or '1' for a pure number."
        )
        text = spelling(f"{component.__name__}.{key}", parameter.units) if numeric else ""
        assert not text, text


def _check_some_effect(component: type[Component], spaces: Sequence[type[Space]], given: Mapping[str, Any]) -> None:
    """Require that some term contains each parameter, in at least one space and with at least one option."""
    unused = set(component.parameters())
    for space in (*spaces, *(other for other in component.spaces if other not in spaces)):
        rng = np.random.default_rng(0)
        try:
            for case in component_cases(component, space, given if space in spaces else {}, rng):
                unused -= effective_parameters(case.component, case.mechanism.space)
                if not unused:
                    return
        except (AssertionError, StudyError):
            if space in spaces:
                raise
    raise AssertionError(
        f"{component.__name__}: no term contains the declared parameter {min(unused)!r}, in any space and with any "
        "option. Use it in terms(), or delete its declaration."
    )


def check_jacobian(bench: Bench, rng: np.random.Generator) -> None:
    """Compare ``dr/dy + c dr/dy'`` with central differences; variables without an entry must have no effect."""
    state, parameters, h = bench.state(rng), bench.parameters(bench.inputs), 1e-5
    rows = bench.kernel("residual")[1]
    assert np.isfinite(bench.evaluate("residual", state, parameters)).all(), (
        f"{bench.title}: a term is not finite in a random pose with random parameter values. It contains a division "
        "by zero, or a root, logarithm or power outside its domain. Restrict the argument (sympy.Max, "
        "sympy.Piecewise), or declare minimum=, maximum= or example= of the parameters."
    )
    entries = dict(zip(bench.kernel("jacobian")[1], bench.evaluate("jacobian", state, parameters).T, strict=True))
    for letter, rate in (("q", "dq"), ("s", "ds"), ("v", "dv"), ("l", None), ("m", None)):
        for k in range(state[letter].shape[1] if letter in state else 0):
            ahead, behind = dict(state), dict(state)
            for sign, moved in ((1, ahead), (-1, behind)):
                step = np.zeros_like(state[letter])
                step[:, k] = sign * h
                moved[letter] = state[letter] + step
                if rate:
                    moved[rate] = state[rate] + state["c"] * step
            upper, lower = (bench.evaluate("residual", moved, parameters) for moved in (ahead, behind))
            for row, difference in zip(rows, ((upper - lower) / (2 * h)).T, strict=True):
                exact = entries.get((row, (letter, k)), np.zeros(REALISATIONS))
                error = abs(exact - difference).max()
                assert error < 1e-6 * (1 + abs(difference).max() + abs(upper).max()), (
                    f"{bench.title}: the derivative of residual {row} with respect to {letter}[{k}] is {exact}; "
                    f"central differences give {difference}."
                )


def check_broadcasting(bench: Bench, rng: np.random.Generator) -> None:
    state = bench.state(rng)
    together = bench.evaluate("residual", state, bench.parameters(bench.inputs))
    for k in range(REALISATIONS):
        one = {letter: values[[k]] for letter, values in state.items()}
        alone = bench.evaluate("residual", one, bench.parameters(bench.inputs[[k]]))
        assert np.array_equal(together[[k]], alone), (
            f"{bench.title}: the residual of a realisation depends on other realisations of the ensemble; expected "
            "independent realisations."
        )
    assert np.isfinite(together).all(), f"{bench.title}: the residual is not finite at a random state."


def _check_mechanics(bench: Bench, rng: np.random.Generator) -> None:
    """Check action and reaction, and the independence from position and orientation of the whole mechanism."""
    instance, space = bench.instance, bench.case.mechanism.space
    for parameters in bench.parameters(bench.inputs):
        q, s, v, time = feasible_state(bench, parameters, rng)
        here = loads_at(instance, q, s, v, time, parameters)
        scale = 1 + abs(here.force).max(initial=0)
        own = own_coordinates(instance)
        motions = virtual_motions(space, q, own)
        power = abs(motions @ here.force).max()
        assert power < 1e-9 * scale, (
            f"{bench.title}: its forces and torques on the bodies do not cancel: in a rigid motion of "
            f"all bodies, their virtual work is {power:.2g}; expected 0. Apply every force together "
            "with its reaction, at the same point."
        )
        power = abs(here.gradient @ motions.T).max(initial=0)
        assert power < 1e-7 * (1 + abs(here.gradient).max(initial=0)), (
            f"{bench.title}: its reactions do not cancel: a rigid motion of all bodies changes a constraint."
        )
        turn, shift = random_turn(space, rng), rng.uniform(-1, 1, space.dimension)
        moved = displaced(space, turn, q, shift, own)
        there = loads_at(instance, moved, s, displaced(space, turn, v, own=own), time, parameters)
        error = abs(there.force - displaced(space, turn, here.force, own=own)).max(initial=0)
        assert error < 1e-9 * scale, (
            f"{bench.title}: its forces change by {error:.2g} when the whole mechanism is translated and rotated; "
            "expected no change."
        )
        assert abs(there.violation).max(initial=0) < 1e-7, (
            f"{bench.title}: its constraints are violated when the whole mechanism is translated and rotated; "
            "expected no change."
        )
        # rates of vectors rotate with the mechanism; zero rates remain zero
        allowed = v - np.linalg.lstsq(here.gradient, here.rate, rcond=1e-10)[0] if len(here.rate) else v
        there = loads_at(instance, moved, s, displaced(space, turn, allowed, own=own), time, parameters)
        error = abs(there.rate).max(initial=0)
        assert error < 1e-7 * (1 + abs(here.rate).max(initial=0)), (
            f"{bench.title}: admissible velocities violate its constraints by {error:.2g} when the whole mechanism "
            "is translated and rotated; expected no change."
        )


def _check_motion(bench: Bench, rng: np.random.Generator) -> None:
    parameters = bench.parameters(bench.inputs)[0]
    q, s, v, time = feasible_state(bench, parameters, rng)
    check_motion_rates(bench, 0, q, v, loads_at(bench.instance, q, s, v, time, parameters).gradient, rng)
