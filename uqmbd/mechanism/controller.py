"""Sampled controllers: functions or laws that compute commands from measured numbers at sample times."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.components import Auxiliary, Component, Local
from uqmbd.mechanism.control_law import ControlLaw, traced_law
from uqmbd.mechanism.expressions import flatten, numbers, shown
from uqmbd.names import check_name, check_units, checked, did_you_mean
from uqmbd.randomness import RandomVariable, Symbol, Symbolic
from uqmbd.units import without_quantities

MANY = 1000
"""Largest number of measured quantities."""

__all__ = ["Controller", "HeldStates", "HeldSymbol"]

Number = Any
"""A number, or an expression in random variables."""


class HeldSymbol(Symbolic, Symbol):
    """Symbol of a command or a state of a controller, which is constant from one sample to the next."""

    owner: Controller
    index: int  # index among the commands, then the states, of its controller

    def __new__(cls, owner: Controller, index: int, name: str) -> HeldSymbol:
        """Make a symbol that stores its controller and its index."""
        self: HeldSymbol = sympy.Symbol.__xnew__(cls, name, real=True)
        self.owner, self.index = owner, index
        self.units = dict(enumerate(owner.commands.values())).get(index, "")
        return self

    def __init__(self, *args: Any) -> None:
        """Accept the arguments of ``__new__``."""

    def _hashable_content(self) -> tuple[Any, ...]:
        return (*super()._hashable_content(), id(self.owner))


class Controller:
    """Sampled controller: a function or a law of measured outputs, evaluated `rate` times a second.

    Add a controller with `Mechanism.add`. The commands (`command`) of the controller are symbols for component
    parameters that accept laws, such as the torque of ``Torque`` or the speed of ``SpeedDriver``. Expressions and
    outputs may also contain commands. Commands are constant from one sample to the next (zero-order hold), so they are
    constants in the equations of motion.

    The states of a controller are numbers that are stored from one sample to the next, such as the integral of a PI
    controller. Each realisation has separate states. At each sample, uqmbd calls ``function(time, measured, state)``
    for a group of realisations, without `state` if the controller has no states. The arguments are

    - `time`: time of the sample, s, a float. Samples are at the start of the study and then every ``1 / rate``, up to
      and including the last output time.
    - `measured`: array, shape (realisation, measured), in the order of the parameter `measured`, with the values right
      before the sample.
    - `state`: array, shape (realisation, state), in the order of the parameter `state`: the states from the previous
      sample, or the initial values at the first sample.

    The function returns the commands, an array of shape (realisation, commanded). A controller with states returns the
    pair (commands, new states), and the new states have the shape (realisation, state). The new states replace the
    states right at the sample. Commands act after `delay`; `limits` apply to commands only. For a single command, an
    array of shape (realisation,) or one number for all realisations is also valid. The same rules apply to states.
    The last entry of the returned tuple may be a dictionary from failed rows to reasons: ``(commands, reasons)``, or
    ``(commands, new states, reasons)``. These realisations fail, and their messages contain the reasons.

    The grouping of realisations is unspecified. Each row of the result must therefore depend only on the same row of
    the arguments, and on no other changing data. The function must not store data outside the `state`. uqmbd tests this
    requirement: it calls the function again with single rows and other parts of the group. Different results end the
    method with an error. In a group of one realisation, the second call is at the samples 0, 1, 2, 4, 8 and so on;
    otherwise it is at each sample.

    A `law` defines the commands by expressions instead. uqmbd calls ``law(time, measured, state)`` once, with symbols:
    `measured` and `state` are tuples of SymPy symbols. The law returns one expression or a sequence of expressions for
    the commands, and, with states, the pair (commands, new states). The expressions may contain `uqmbd.RandomVariable`.
    uqmbd compiles a law and evaluates it without Python, in a fraction of the time of a function.

    Parameters
    ----------
    name : str
        Name of the controller, unique among bodies, components and controllers.
    measured : sequence
        Names of outputs of the mechanism, or scalar expressions as in outputs. Outputs with ``angle=True``, which are
        known only up to whole turns, are invalid.
    commanded : sequence of str, or mapping of str to str
        Names of the commands. A mapping from names to units also states the units, which `uqmbd check` shows.
    rate : float
        Sampling rate, Hz.
    function : callable, optional
        Function that computes the commands, as described above; required without a `law`. Worker processes must be able
        to import or unpickle it; a function of a module or a script is suitable.
    state : sequence, or mapping of str to number, optional
        Initial values of the states, as numbers or expressions in random variables. A mapping also names the states.
    delay : float
        Time from a sample until its commands act, s. The delay may be longer than a sampling period.
    limits : pair, or mapping of str to pair, optional
        Smallest and largest value of each command, as numbers or expressions in random variables. None: no limit. One
        pair applies to every command.
    initial : number, or mapping of str to number
        Initial values of the commands, as numbers or expressions in random variables. Initial values apply until the
        first commands act, in static equilibrium, and in the linearisation about the equilibrium.
    law : callable, optional
        Law that returns the commands as expressions, as described above, instead of a `function`.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid.

    Notes
    -----
    At an output time that is a sample time, outputs contain the commands, states, accelerations and reactions right
    after the sample.  If a prescribed speed jumps at a sample time, the controller measures the speed after the jump.
    A realisation with a command or state that is not finite fails, with a status and a message; the other realisations
    continue.  A result of a wrong shape, or an exception in the function, ends the method.  Reference for zero-order
    hold and sampled systems: K. J. Astrom, B. Wittenmark, Computer-Controlled Systems, 3rd ed., Prentice Hall 1997,
    chapter 2.

    Examples
    --------
    A sampled PD controller moves a mass to x = 1 m:

    >>> import numpy as np, uqmbd
    >>> from uqmbd_springs import PointForce
    >>> mechanism = uqmbd.Mechanism("cart", uqmbd.Translational())
    >>> cart = mechanism.body("cart", mass=2)
    >>> def pd(time, measured):
    ...     position, speed = measured.T
    ...     return 8 * (1 - position) - 8 * speed
    >>> controller = uqmbd.Controller(
    ...     measured=[cart.position[0], cart.velocity[0]], commanded={"force": "N"}, rate=50, function=pd,
    ...     limits=(-5, 5),
    ... )
    >>> motor = mechanism.add(PointForce("motor", cart, (0, 0), (controller.command("force"), 0)))
    >>> controller = mechanism.add(controller)
    >>> mechanism.output("x", cart.position[0], units="m")
    >>> mechanism.output("force", controller.command("force"), units="N")
    >>> found = uqmbd.simulate(mechanism, [0, 1, 5])
    >>> [round(float(value), 3) for value in found["x"]], float(found["force"][0])
    ([0.0, 0.584, 0.999], 5.0)

    The same controller as a law, whose arguments are symbols:

    >>> def pd(time, measured):
    ...     position, speed = measured
    ...     return 8 * (1 - position) - 8 * speed
    >>> compiled = uqmbd.Controller(
    ...     measured=[cart.position[0], cart.velocity[0]], commanded={"force": "N"}, rate=50, law=pd, limits=(-5, 5),
    ... )
    """

    @checked
    def __init__(
        self,
        name: str = "controller",
        measured: Sequence[Any] = (),
        commanded: Sequence[str] | Mapping[str, str] = (),
        rate: float = 100.0,
        function: Callable[..., Any] | None = None,
        state: Sequence[Number] | Mapping[str, Number] | None = None,
        delay: float = 0.0,
        limits: Any = None,
        initial: Number | Mapping[str, Number] = 0.0,
        law: Callable[..., Any] | None = None,
    ) -> None:
        self.name = check_name(name, "Controller")
        where = self.where = f"Controller {name!r}"
        self.measured = _measured(where, measured)
        names = [commanded] if isinstance(commanded, str) else commanded
        texts = isinstance(names, (Mapping, Sequence)) and all(isinstance(k, str) for k in names)
        if not texts or not names:
            raise StudyError(
                f"{where}: commanded is {shown(commanded)}; expected the names of its commands, e.g. ['torque'], or "
                "a mapping from names to units, e.g. {'torque': 'N m'}."
            )
        units = names if isinstance(names, Mapping) else dict.fromkeys(names, "")
        if len(units) != len(names):
            raise StudyError(
                f"{where}: commanded is {shown(commanded)}, which contains a name twice; give each name once."
            )
        self.commands = {check_name(k, f"{where}: command"): check_units(u, f"{where}: {k}") for k, u in units.items()}
        self.rate = _positive(where, "rate", without_quantities(f"{where}: rate", rate, "Hz"), "samples per second, Hz")
        self.delay = _number(where, "delay", without_quantities(f"{where}: delay", delay, "s"), "s")
        if self.delay < 0:
            raise StudyError(f"{where}: delay is {self.delay:g}; expected a time of 0 s or more.")
        if function is not None and law is not None:
            raise StudyError(f"{where}: function and law are both given; expected one of them.")
        key, given = ("function", function) if law is None else ("law", law)
        if not callable(given) or isinstance(given, type):
            raise StudyError(
                f"{where}: {key} is {shown(given)}; expected a function of (time, measured), or of (time, measured, "
                "state), that returns the commands."
            )
        self.function = function
        entries = dict(state) if isinstance(state, Mapping) else {str(k): x for k, x in enumerate(flatten_state(state))}
        self.states: dict[str, sympy.Expr] = {
            check_name(k, f"{where}: state"): _value(where, f"state {k!r}", x) for k, x in entries.items()
        }
        self.law: ControlLaw | None = None
        if law is not None:
            self.law = traced_law(where, law, len(self.measured), tuple(self.commands), tuple(self.states))
        self.initial = {k: sympy.S.Zero for k in self.commands} | _by_command(
            where, "initial", initial, self.commands, lambda key, x: _value(where, key, x)
        )
        none = (-sympy.oo, sympy.oo)
        limited = {} if limits is None else _by_command(where, "limits", limits, self.commands, _pair(where))
        self.limits = {k: limited.get(k, none) for k in self.commands}
        for key, (low, high) in self.limits.items():
            first = self.initial[key]
            if any(x.is_number and x.is_negative for x in (first - low, high - first)):
                raise StudyError(
                    f"{where}: the initial value of {key!r} is {first}, outside of its limits {low} to {high}."
                )

    def command(self, name: str | None = None) -> sympy.Symbol:
        """Return the symbol of a command, for parameters of components and for outputs.

        Parameters
        ----------
        name : str, optional
            Name of the command. Optional if the controller has only one command.
        """
        names = list(self.commands)
        if name is None and len(names) == 1:
            name = names[0]
        return self._symbol(name, names, 0, "command")

    def state(self, name: str | int) -> sympy.Symbol:
        """Return the symbol of a state, for outputs; its value changes at samples only.

        Parameters
        ----------
        name : str or int
            Name of the state, or its number if states have no names.
        """
        return self._symbol(str(name), list(self.states), len(self.commands), "state")

    @property
    def values(self) -> tuple[sympy.Expr, ...]:
        """Initial values of all commands, then of all states."""
        return (*self.initial.values(), *self.states.values())

    @property
    def numbers(self) -> list[Any]:
        """All values that may contain random variables."""
        law = () if self.law is None else self.law.results
        return [*self.values, *flatten(list(self.limits.values())), *self.measured, *law]

    def _symbol(self, name: str | None, names: list[str], first: int, what: str) -> sympy.Symbol:
        if not isinstance(name, str) or name not in names:
            listed = ", ".join(map(repr, names)) or "none"
            given, near = (repr(name), did_you_mean(name, names)) if isinstance(name, str) else (shown(name), "")
            raise StudyError(f"{self.where}: the controller has no {what} {given}{near or '.'} Available: {listed}.")
        return HeldSymbol(self, first + names.index(name), f"{self.name}.{name}")

    def __repr__(self) -> str:
        return f"<Controller {self.name!r}: {', '.join(self.commands)}; {self.rate:g} Hz>"


class HeldStates(Component):
    """Component that yields the commands and states of a controller as auxiliary states with zero rates."""

    bodies = ()
    offered = True

    def __init__(self, controller: Controller) -> None:
        super().__init__(controller.name)
        self.controller = controller
        self.values = {"start": controller.values}

    def terms(self, p: Local) -> list[Auxiliary]:
        """Return a constant state for every command and every controller state."""
        return [Auxiliary(p.state(str(k)), 0, x) for k, x in enumerate(p.start)]

    def reaction_point(self, p: Local) -> sympy.Matrix:
        """Return zeros: a controller has no reactions."""
        return sympy.zeros(p.space.dimension, 1)


def flatten_state(state: Any) -> list[Any]:
    """Return the values of states without names."""
    return [] if state is None else flatten(state)


def _measured(where: str, measured: Any) -> tuple[Any, ...]:
    array = hasattr(measured, "tolist") and 0 < getattr(measured, "ndim", 1) and len(measured) <= MANY
    if isinstance(measured, str) or not (isinstance(measured, Sequence) or array):
        raise StudyError(
            f"{where}: measured is {shown(measured)}; expected a sequence of names of outputs, or of scalar "
            "expressions such as body.position[0]."
        )
    found = flatten(list(measured))
    if not found:
        raise StudyError(f"{where}: measured is empty; expected names of outputs, or scalar expressions.")
    accepted: list[Any] = []
    for k, x in enumerate(found):
        if isinstance(x, str):
            accepted.append(x)
        else:
            accepted.append(numbers(where, f"measured[{k}]", x, 1, "a scalar expression, or the name of an output")[0])
    return tuple(accepted)


def _number(where: str, key: str, value: Any, units: str) -> float:
    entry = numbers(where, key, value, 1, units)[0]
    if not entry.is_number:
        raise StudyError(f"{where}: {key} is {shown(value)}; expected a number ({units}), without random variables.")
    return float(entry)


def _positive(where: str, key: str, value: Any, units: str) -> float:
    found = _number(where, key, value, units)
    if not (found > 0 and math.isfinite(found)):
        raise StudyError(f"{where}: {key} is {found:g}; expected a positive number ({units}).")
    return found


def _value(where: str, key: str, value: Any) -> sympy.Expr:
    entry = numbers(where, key, value, 1)[0]
    strange = sorted((s for s in entry.free_symbols if not isinstance(s, RandomVariable)), key=str)
    if strange:
        raise StudyError(
            f"{where}: {key} is {shown(value)}, which contains {strange[0]}; expected a number, or an expression in "
            "random variables."
        )
    return entry


def _pair(where: str) -> Callable[[str, Any], tuple[sympy.Expr, sympy.Expr]]:
    def checked_pair(key: str, value: Any) -> tuple[sympy.Expr, sympy.Expr]:
        pair = list(value) if isinstance(value, (tuple, list)) or getattr(value, "shape", None) == (2,) else []
        if len(pair) != 2:
            raise StudyError(f"{where}: {key} is {shown(value)}; expected a pair (smallest, largest), or None.")
        low, high = (
            bound if x is None or _infinite(x) else _value(where, key, x)
            for x, bound in zip(pair, (-sympy.oo, sympy.oo), strict=True)
        )
        if low.is_number and high.is_number and not low < high:
            raise StudyError(f"{where}: {key} is {shown(value)}; expected (smallest, largest) with smallest < largest.")
        return low, high

    return checked_pair


def _infinite(value: Any) -> bool:
    return value in (sympy.oo, -sympy.oo) or (isinstance(value, float) and math.isinf(value))


def _by_command(
    where: str, key: str, value: Any, commands: Mapping[str, str], settled: Callable[[str, Any], Any]
) -> dict[str, Any]:
    """Return the value of an argument for each command, from one value for all commands or a mapping by command."""
    if not isinstance(value, Mapping):
        return {name: settled(key, value) for name in commands}
    for name in value:
        if name not in commands:
            listed = ", ".join(map(repr, commands))
            raise StudyError(
                f"{where}: {key} has the key {name!r}, which is not a command; the commands are: {listed}."
            )
    return {name: settled(f"{key}[{name!r}]", x) for name, x in value.items() if x is not None}
