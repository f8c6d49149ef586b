"""Does a component mean what it says: derivatives, compiled forms, and the laws that every mechanism obeys."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics.block import Instance, instances_of
from uqmbd.dynamics.derivation import derive
from uqmbd.dynamics.evaluator import Evaluator
from uqmbd.dynamics.kernels import Kernel, cached, compile_kernel
from uqmbd.dynamics.model import Layout, evaluator
from uqmbd.dynamics.parameters import ParameterMap
from uqmbd.mechanism import Component, Space
from uqmbd.testing.cases import Case, cases, name_of
from uqmbd.testing.motion import displaced, random_turn, random_unit, virtual_motions

__all__ = ["check_component"]

Array = NDArray[np.float64]

REALISATIONS = 3


def check_component(
    component: type[Component],
    *,
    spaces: tuple[type[Space], ...] | None = None,
    given: Mapping[str, Any] | None = None,
    internal: bool = True,
    seed: int = 0,
) -> None:
    """Check a component in mechanisms with random poses and values, in every space it declares.

    - Its parameters have units and descriptions, each has an effect, and all may be random.
    - The exact Jacobian agrees with central differences of the residual.
    - The kernels of the component type and of the whole mechanism compute the same.
    - Between two bodies: what it exerts on them cancels (action and reaction), and does not depend on where the bodies
      are as a whole and how they are turned.

    Parameters
    ----------
    component : type
        A subclass of `uqmbd.Component`.
    spaces : tuple of types, optional
        Where to check; default all spaces that it declares.
    given : mapping, optional
        Values that are used as they are, by parameter, for those that need special ones.
    internal : bool
        Whether a component of several bodies acts between them alone, so that action equals reaction.
    seed : int
        Of the random poses and values.

    Raises
    ------
    AssertionError
        If something is wrong; the message says what, and in which case.

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
    for space in component.spaces if spaces is None else spaces:
        rng = np.random.default_rng([seed, zlib.crc32(f"{component.__name__} {space.__name__}".encode())])
        for number, case in enumerate(cases(component, space, given or {}, rng)):
            bench = Bench.of(f"{name_of(component, space)}, {case.title}", case, rng)
            _check_jacobian(bench, rng)
            _check_broadcasting(bench, rng)
            if number == 0:
                _check_fused(bench, rng)
                _check_effects(bench, rng, set(given or ()))
            if internal and case.free and len(component.bodies) > 1:
                _check_mechanics(bench, rng)


def _check_declaration(component: type[Component]) -> None:
    assert component.__doc__, f"{component.__name__} has no docstring; say what it is."
    for key, parameter in component.parameters().items():
        assert parameter.description, f"{component.__name__}.{key} has no description."
        numeric = parameter.kind != "option"
        assert parameter.units or not numeric, f"{component.__name__}.{key} has no units; '1' for a pure number."


@dataclass(frozen=True)
class Bench:
    """A case with everything that is evaluated for it, for some realisations of its parameters.

    Attributes
    ----------
    title : str
        For messages.
    instances : list of Instance
        The bodies', then the component's.
    layout : Layout
        With all constraint equations.
    parameters : ParameterMap
        From inputs to the parameters of all blocks.
    inputs : array, shape (K, input)
        Random.
    """

    title: str
    case: Case
    instances: list[Instance]
    layout: Layout
    parameters: ParameterMap
    inputs: Array
    kernels: dict[str, Evaluator]

    @classmethod
    def of(cls, title: str, case: Case, rng: np.random.Generator) -> Bench:
        """Derive and compile, one kernel for each component type."""
        mechanism = case.mechanism
        instances = instances_of(mechanism.all_components(), mechanism.space)
        constraints = sum(len(i.type.constraints) for i in instances)
        layout = Layout(
            coordinates=mechanism.space.size * len(mechanism.bodies),
            states=sum(len(i.type.states) for i in instances),
            constraints=constraints,
            kept=np.arange(constraints, dtype=np.int64),
        )
        expressions = [p for i in instances for p in i.parameters]
        variables = mechanism.inputs.variables
        uniform = rng.uniform(0.05, 0.95, (REALISATIONS, len(variables)))
        bench = cls(
            title,
            case,
            instances,
            layout,
            ParameterMap.of(expressions, variables),
            mechanism.inputs.from_uniform(uniform) if variables else uniform,
            {},
        )
        for kind in ("residual", "jacobian", "position", "initial"):
            bench.kernels[kind] = bench.compiled(kind, fuse=False)
        return bench

    def compiled(self, kind: str, *, fuse: bool) -> Evaluator:
        """Compile one kind of equations."""
        order = {name: k for k, name in enumerate(self.case.mechanism.bodies)}
        count = sum(len(i.parameters) for i in self.instances)
        return evaluator(kind, self.instances, order, self.layout, count, fuse=fuse)

    def state(self, rng: np.random.Generator, count: int = REALISATIONS) -> tuple[Array, Array, float]:
        """Return random unknowns, rates and a time; no constraint holds."""
        y = rng.normal(size=(count, self.layout.unknowns))
        y[:, : self.layout.coordinates] = random_coordinates(self.case, rng, count)
        return y, rng.normal(size=(count, self.layout.unknowns)), rng.uniform(0.1, 1.0)

    def residual(
        self, y: Array, rates: Array, time: float, parameters: Array, kernel: Evaluator | None = None
    ) -> Array:
        """Return the residual as a dense vector for each realisation."""
        kernel = kernel or self.kernels["residual"]
        found = np.zeros_like(y)
        found[:, [target[1] for target in kernel.targets]] = kernel(self._arguments(y, rates, (time,)), parameters)
        return found

    def jacobian(
        self, y: Array, rates: Array, time: float, c: float, parameters: Array, kernel: Evaluator | None = None
    ) -> Array:
        """Return ``dr/dy + c dr/dy'`` as a dense matrix for each realisation."""
        kernel = kernel or self.kernels["jacobian"]
        found = np.zeros((len(y), y.shape[1], y.shape[1]))
        columns, rows = [x[1] for x in kernel.targets], [x[2] for x in kernel.targets]
        found[:, rows, columns] = kernel(self._arguments(y, rates, (time, c)), parameters)
        return found

    def others(self, y: Array, time: float, parameters: Array) -> Array:
        """Return what else is computed: constraints with their gradients and cosines, initial auxiliary states."""
        n, k = self.layout.coordinates, self.layout.states
        arguments = np.zeros((len(y), 2 * n + k + 2))
        arguments[:, : 2 * n + k], arguments[:, 2 * n + k] = y[:, : 2 * n + k], time
        return np.concatenate([self.kernels[kind](arguments, parameters) for kind in ("position", "initial")], axis=1)

    def _arguments(self, y: Array, rates: Array, extra: tuple[float, ...]) -> Array:
        tail = np.tile([*extra, 0.0], (len(y), 1))
        return np.concatenate([y, rates[:, : self.layout.differential], tail], axis=1)


def random_coordinates(case: Case, rng: np.random.Generator, count: int) -> Array:
    """Return random poses of all bodies, shape (count, coordinates); quaternions have length one."""
    space = case.mechanism.space
    q = rng.uniform(-1, 1, (count, len(case.mechanism.bodies), space.size))
    if space.turns:
        q[..., space.dimension :] = random_unit(rng, q[..., space.dimension :].shape)
    return q.reshape(count, -1)


def _check_jacobian(bench: Bench, rng: np.random.Generator) -> None:
    y, rates, time = bench.state(rng)
    c, h = rng.uniform(1, 5), 1e-5
    parameters = bench.parameters(bench.inputs)
    exact = bench.jacobian(y, rates, time, c, parameters)
    for column in range(bench.layout.unknowns):
        step = np.zeros_like(y)
        step[:, column] = h
        ahead = bench.residual(y + step, rates + c * step, time, parameters)
        behind = bench.residual(y - step, rates - c * step, time, parameters)
        difference = (ahead - behind) / (2 * h)
        error = abs(exact[:, :, column] - difference).max()
        scale = 1 + abs(difference).max() + 1e-3 * abs(ahead).max()
        assert error < 1e-6 * scale, (
            f"{bench.title}: column {column} of the Jacobian differs from central differences by {error:.2g}."
        )


def _check_fused(bench: Bench, rng: np.random.Generator) -> None:
    y, rates, time = bench.state(rng)
    parameters = bench.parameters(bench.inputs)
    whole = bench.residual(y, rates, time, parameters, bench.compiled("residual", fuse=True))
    parts = bench.residual(y, rates, time, parameters)
    assert np.allclose(whole, parts, rtol=1e-12, atol=1e-12), f"{bench.title}: residuals of the two forms differ."
    whole = bench.jacobian(y, rates, time, 2.0, parameters, bench.compiled("jacobian", fuse=True))
    parts = bench.jacobian(y, rates, time, 2.0, parameters)
    assert np.allclose(whole, parts, rtol=1e-12, atol=1e-12), f"{bench.title}: Jacobians of the two forms differ."


def _check_broadcasting(bench: Bench, rng: np.random.Generator) -> None:
    y, rates, time = bench.state(rng)
    together = bench.residual(y, rates, time, bench.parameters(bench.inputs))
    for k in range(len(y)):
        alone = bench.residual(y[[k]], rates[[k]], time, bench.parameters(bench.inputs[[k]]))
        assert np.array_equal(together[[k]], alone), f"{bench.title}: a realisation depends on its neighbours."
    assert np.isfinite(together).all(), f"{bench.title}: the residual is not finite at a random state."


def _check_effects(bench: Bench, rng: np.random.Generator, given: set[str]) -> None:
    y, rates, time = bench.state(rng)

    def everything(inputs: Array) -> Array:
        parameters = bench.parameters(inputs)
        return np.concatenate([bench.residual(y, rates, time, parameters), bench.others(y, time, parameters)], axis=1)

    before = everything(bench.inputs)
    for column, name in enumerate(bench.case.mechanism.inputs.names):
        changed = bench.inputs.copy()
        changed[:, column] += 0.01
        assert not np.allclose(everything(changed), before, rtol=1e-9, atol=0), (
            f"{bench.title}: parameter {name!r} has no effect."
        )
    missing = _numeric(bench.case.component, given) - set(bench.case.mechanism.inputs.names)
    assert not missing, f"{bench.title}: parameter {min(missing)!r} is declared, but its value enters nothing."


def _numeric(component: Component, given: set[str]) -> set[str]:
    """Return the parameters that were given random values."""
    return {
        key
        for key, parameter in component.parameters().items()
        if parameter.kind != "option" and parameter.example is None and key not in given and key in component.given
    }


@dataclass(frozen=True)
class Loads:
    """What a component exerts on its bodies, at one state.

    Attributes
    ----------
    force : array, shape (n,)
        Generalised force of potentials and virtual work on the coordinates of its bodies.
    gradient : array, shape (m, n)
        ``d psi / d v`` of its constraints: reactions are combinations of its rows.
    violation : array, shape (m,)
        Constraints.
    """

    force: Array
    gradient: Array
    violation: Array


def _loads_kernel(instance: Instance) -> Kernel:
    derived = derive(instance.type)

    def make() -> Kernel:
        arguments = [x for *_, x in derived.arguments("initial")] + derived.p
        force = [a + b for a, b in zip(derived.potential_force, derived.work_force, strict=True)]
        return compile_kernel(arguments, [*force, *(x for row in derived.d for x in row), *derived.phi])

    result: Kernel = cached(("loads", instance.type.digest), make)
    return result


def _loads(instance: Instance, q: Array, s: Array, v: Array, time: float, parameters: Array) -> Loads:
    n, m = instance.type.coordinates, len(instance.type.constraints)
    found = _loads_kernel(instance)(np.concatenate([q, s, v, [time], parameters])[None, :])[0]
    return Loads(found[:n], found[n : n + m * n].reshape(m, n), found[n + m * n :])


def _check_mechanics(bench: Bench, rng: np.random.Generator) -> None:
    """Check action and reaction, and that nothing depends on the place and direction of the whole."""
    instance, space = bench.instances[-1], bench.case.mechanism.space
    own = slice(-len(instance.parameters), None) if instance.parameters else slice(0, 0)
    for parameters in bench.parameters(bench.inputs)[:, own]:
        q, s, v, time = _feasible(bench, parameters, rng)
        here = _loads(instance, q, s, v, time, parameters)
        scale = 1 + abs(here.force).max(initial=0)
        motions = virtual_motions(space, q)
        power = abs(motions @ here.force).max()
        assert power < 1e-9 * scale, (
            f"{bench.title}: what it exerts on its bodies does not cancel; its forces would do the work {power:.2g} if "
            "all bodies moved as one. Is every force paired with its reaction, at the point where it acts?"
        )
        power = abs(here.gradient @ motions.T).max(initial=0)
        assert power < 1e-7 * (1 + abs(here.gradient).max(initial=0)), (
            f"{bench.title}: its reactions do not cancel; a constraint changes if all bodies move as one."
        )
        turn, shift = random_turn(space, rng), rng.uniform(-1, 1, space.dimension)
        there = _loads(instance, displaced(space, turn, q, shift), s, displaced(space, turn, v), time, parameters)
        error = abs(there.force - displaced(space, turn, here.force)).max(initial=0)
        assert error < 1e-9 * scale, (
            f"{bench.title}: its forces change by {error:.2g} when everything is moved and turned as a whole."
        )
        assert abs(there.violation).max(initial=0) < 1e-7, (
            f"{bench.title}: its constraints are violated when everything is moved and turned as a whole."
        )


def _feasible(bench: Bench, parameters: Array, rng: np.random.Generator) -> tuple[Array, Array, Array, float]:
    """Return a random state of the component's bodies at which its constraints hold (Gauss-Newton, several starts)."""
    instance, case = bench.instances[-1], bench.case
    space, n = case.mechanism.space, instance.type.coordinates
    for _ in range(50):
        q = random_coordinates(case, rng, 1)[0]
        s, v, time = rng.normal(size=len(instance.type.states)), rng.normal(size=n), rng.uniform(0.1, 1.0)
        for _ in range(50):
            found = _loads(instance, q, s, v, time, parameters)
            if abs(found.violation).max(initial=0) < 1e-12:
                return q, s, v, time
            q = q - np.linalg.lstsq(found.gradient, found.violation, rcond=1e-10)[0]
            if space.turns:
                parts = q.reshape(-1, space.size)
                parts[:, space.dimension :] /= np.linalg.norm(parts[:, space.dimension :], axis=1, keepdims=True)
    raise AssertionError(f"{bench.title}: no state was found at which its constraints hold.")
