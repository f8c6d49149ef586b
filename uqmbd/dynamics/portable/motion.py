"""Motion of a mechanism as C source, for programs that integrate it without uqmbd."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.arguments import typechecked
from uqmbd.dynamics.assembly import equation_programs
from uqmbd.dynamics.ensemble import Ensemble, referenced
from uqmbd.dynamics.equations import Model, state_arguments
from uqmbd.dynamics.integration import explicit_method
from uqmbd.dynamics.model_building import build
from uqmbd.dynamics.observation import output_program
from uqmbd.dynamics.portable.c_source import SourceWriter, driver_sources
from uqmbd.dynamics.portable.commands import (
    MOST_MEASURED,
    MotionCommand,
    commands_of,
    measured_expressions,
    written_laws,
)
from uqmbd.dynamics.portable.dependencies import dependencies_of, nearby_values, without_effect
from uqmbd.dynamics.portable.header import is_real, is_whole, motion_header
from uqmbd.dynamics.portable.impacts import PARTS_OF_STEPS, contacts_of, impact_obstacle, written_contacts
from uqmbd.dynamics.portable.portable_motion import PortableMotion
from uqmbd.errors import StudyError
from uqmbd.mechanism import Mechanism
from uqmbd.typing import Array

__all__ = ["motion_refusal", "motion_source"]

POINTS = 8
"""Number of projected states of a step, and of coefficients of a series, as in dop853.h."""

MOST_KNOTS = 10_000
"""Maximum number of knots of tables over time: each knot takes 24 bytes on the stack of the integration."""

STAGES = 12 + 4 + 7 + 5 + 5 + 2 * POINTS
"""Number of states in the workspace of the explicit method: stages, interpolant, nodes, series and others."""


@typechecked
def motion_refusal(mechanism: Mechanism, times: ArrayLike = (0.0, 1.0), *, held: Sequence[str] = ()) -> str:
    """Return why the motion of a mechanism has no form in C, or an empty text.

    Parameters
    ----------
    mechanism : uqmbd.Mechanism
        Mechanism.
    times : array_like, shape (T,)
        Output times of a typical simulation, s; the first one is the start.
    held : sequence of str
        Names of inputs that change during the motion.

    Returns
    -------
    str
        Reason, which names the component; empty if the motion can be written in C.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
    >>> stone = mechanism.body("stone", mass=1)
    >>> mechanism.output("height", stone.position[0], units="m")
    >>> uqmbd.extend.motion_refusal(mechanism)
    ''
    """
    try:
        motion_source(mechanism, times, held=held)
    except StudyError as error:
        return str(error).partition(" cannot be written in C: ")[2] or str(error)
    return ""


@typechecked
def motion_source(
    mechanism: Mechanism, times: ArrayLike = (0.0, 1.0), *, held: Sequence[str] = (), rtol: float = 1e-6
) -> PortableMotion:
    """Write the motion of a mechanism as C source.

    Parameters
    ----------
    mechanism : uqmbd.Mechanism
        Mechanism with outputs over time. The laws of its controllers are part of the motion. The commands of
        controllers with functions become inputs of the motion, and their measured expressions become outputs; the
        program that integrates the motion calls these functions.
    times : array_like, shape (T,)
        Output times of a typical simulation, s. The first one is the start. They determine steps for functions of time.
    held : sequence of str
        Names of inputs that change during the motion, and are constant in each step. If they move constraints, the
        state is projected onto the moved constraints.
    rtol : float
        Relative tolerance of the typical simulation.

    Returns
    -------
    PortableMotion
        Source files, and names of inputs and outputs.

    Raises
    ------
    uqmbd.StudyError
        If the mechanism has impacts, tables or other parts without a form in C; the message names them.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
    >>> stone = mechanism.body("stone", mass=1)
    >>> mechanism.output("height", stone.position[0], units="m")
    >>> found = uqmbd.extend.motion_source(mechanism)
    >>> found.outputs, sorted(found.files)[:2]
    (('height',), ['assembly.c', 'assembly.h'])
    """
    grid = np.asarray(times, dtype=float)
    means = mechanism.inputs.means
    model = referenced(build(mechanism, float(grid[0])), means)
    ensemble = Ensemble(model, means[None, :])
    why = _obstacle(model) or _obstacle_of_time(model, ensemble, grid, rtol)
    if not why:
        try:
            unknown = sorted(set(held) - set(model.inputs))
            if unknown:
                raise StudyError(
                    f"the inputs {', '.join(map(repr, unknown))} do not exist; expected names of random variables: "
                    f"{', '.join(model.inputs) or 'none exist'}"
                )
            fixed = without_effect(mechanism, ensemble)
            if starting := sorted(set(held) & set(fixed)):
                why = "changes the start of the motion only, or nothing; leave it a parameter"
                raise StudyError(f"the input {starting[0]!r} {why}")
            moving = _moving(model, ensemble, held)
            commands = commands_of(mechanism, model)
            direct, at_start = dependencies_of(mechanism, ensemble, held, commands, moving)
            motion = _written(model, ensemble, grid, rtol, commands, moving)
            contacts = tuple(name for name, *_, directions in model.events if directions)
            return replace(motion, fixed=tuple(fixed), contacts=contacts, direct=direct, at_start=at_start)
        except StudyError as error:
            why = str(error)
    raise StudyError(f"The motion of mechanism {mechanism.name!r} cannot be written in C: {why.rstrip('.')}.")


def _obstacle(model: Model) -> str:
    """Return why the driver cannot integrate a model without Python, or an empty text."""
    if why := impact_obstacle(model):
        return why
    if model.speeds_commanded:
        return "a controller commands the speed of a driver; velocities after a jump of this speed require Python code"
    if model.paths or model.excitations:
        return "it has sampled paths or excitations"
    if model.start_at != "drawn":
        return "its realisations start in static equilibrium"
    if model.conditions is not None:
        return f"it has the start condition {model.conditions.names[0]!r}"
    if model.tables and len(model.tables.lines.random):
        return "it has a table over time whose argument depends on random variables"
    if model.system is None or model.system.programs is None:
        return "it has too many equations for compiled elimination"
    if not model.outputs.names:
        return "it has no output over time"
    return ""


def _obstacle_of_time(model: Model, ensemble: Ensemble, times: Array, rtol: float) -> str:
    if not ensemble.start.ok[0]:
        return ensemble.start.messages[0]
    if len(times) < 2:
        return "there is a single time"
    knots = len(model.tables.deviating(float(times[0]), float(times[-1]))[0]) if model.tables else 0
    if knots > MOST_KNOTS:
        within = f"{knots} knots between {times[0]:g} s and {times[-1]:g} s"
        return (
            f"its tables over time have {within}, but at most {MOST_KNOTS} are possible; use fewer knots or a shorter "
            "time"
        )
    breaks = ensemble.breaks[0]
    breaks = breaks[(breaks > times[0]) & (breaks < times[-1])]
    near = 1e-9 * float(np.abs(times).max())
    for interval in ensemble.pace(times, rtol)[:-1]:
        if interval.jumps and not np.any(np.abs(breaks - interval.end) <= near):
            return (
                f"a function of time jumps at {interval.end:g} s; a jump is possible only at a limit of sympy.Piecewise"
            )
    return _obstacle_of_speeds(model, ensemble, breaks, near) if model.rheonomic and model.layout.rank else ""


def _obstacle_of_speeds(model: Model, ensemble: Ensemble, breaks: Array, near: float) -> str:
    """Return the first time at which a prescribed speed jumps, as a reason; empty if there is none."""
    start, speeds = ensemble.start, list[Array]()
    for moment in breaks.tolist():
        for side in (-near, near):
            arguments = state_arguments(moment + side, start.q, start.s, start.v)
            speeds.append(model.evaluate("velocity", arguments, ensemble.block)["phi_t"][0])
        jump = np.abs(speeds[-1] - speeds[-2])
        if jump.max(initial=0.0) > 1e-6 * max(1.0, float(np.abs(speeds[-1]).max())):
            return (
                f"the speed that {model.owners[int(jump.argmax())]!r} prescribes jumps at {moment:g} s; velocities "
                "after a jump require Python code"
            )
    return ""


def _moving(model: Model, ensemble: Ensemble, held: Sequence[str]) -> list[int]:
    """Return the indices of the inputs that change during the motion and move constraints."""
    start, found = ensemble.start, list[int]()
    # at another time than the start, at which a factor of time may vanish
    arguments = state_arguments(model.time + 0.37, start.q, start.s, start.v)
    parameters = model.parameters(nearby_values(ensemble, held))[:, : model.block_parameters]
    for k, name in enumerate(held):
        same = [
            np.array_equal(
                model.evaluate(kind, arguments, parameters[:1])[part],
                model.evaluate(kind, arguments, parameters[k + 1 : k + 2])[part],
            )
            for kind, part in (("position", "phi"), ("velocity", "phi_t"), ("velocity", "d"))
        ]
        if not all(same):
            found.append(model.inputs.index(name))
    return found


def _written(
    model: Model,
    ensemble: Ensemble,
    times: Array,
    rtol: float,
    commands: tuple[MotionCommand, ...],
    moving: Sequence[int],
) -> PortableMotion:
    w, layout, programs = SourceWriter(), model.layout, model.system.programs
    touching = contacts_of(model)
    d = programs.dynamics if touching is None else touching[0]
    # with events, rejected steps need no decision, as in simulations
    method = explicit_method(rtol, guarded=bool(layout.rank) and touching is None, attempts=200_000)
    k = d.constraints
    empty = "{NULL, 0, 0}"
    closing, speeds = equation_programs(model)
    closing_text, closing_memory = w.equations(closing.equations)
    speeds_text, speeds_memory = w.equations(speeds)
    outputs = output_program(model, model.outputs, open_contacts=True)
    assert outputs is not None
    measured = measured_expressions(model)
    measuring = [output_program(model, loop.measure, open_contacts=True) for loop in model.controls]
    stated = np.concatenate([x.parameters for x in model.statements] or [np.zeros(0, dtype=np.int64)])
    initial, initial_states = None, np.zeros(0, dtype=np.int64)
    if layout.states:
        evaluator = model.evaluators["initial"]
        initial = evaluator.program(layout.width + 2, model.block_parameters)
        columns, (initial_states,) = evaluator.index.get("s", (np.zeros(0, dtype=np.int64), (initial_states,)))
        assert np.array_equal(columns, np.arange(len(columns)))
    longest = min((x.longest for x in ensemble.pace(times, rtol)), default=np.inf)
    if model.rough:
        longest = min(longest, float(np.diff(times).max()))
    longest = min(longest, model.max_step)
    if touching is not None:
        longest = min(longest, float(times[-1] - times[0]) / PARTS_OF_STEPS)
    knots, deviations = np.zeros((2, 0))
    if model.tables:
        knots, deviations = model.tables.deviating(float(times[0]), float(times[-1]))
    contacts, contact_rows, contact_sizes, contact_memory = written_contacts(w, model, touching)
    equations = 0 if k is None else len(k.residuals)
    rows = [
        outputs.rows,
        *(x.rows for x in measuring if x is not None),
        d.rows + equations + 1,
        0 if initial is None else initial.rows,
    ]
    size = 2 * d.rows + STAGES * layout.width + 2 * layout.coordinates + equations + 6 + POINTS**2 + 2 * len(d.turns)
    work = max(size, *rows)
    work = max(work + contact_memory, closing_memory, speeds_memory)
    turn = d.turns.shape[1] if d.turns.size else 0
    projections = {} if k is None else {"values": k.values, "drift": k.drift, "place": k.place, "move": k.move}
    problem = {
        **{"blocks": d.blocks, "width": d.width, "coordinates": d.coordinates, "velocities": d.velocities},
        **{"parameters": d.parameters, "time": d.width, "rows": d.rows, "motion": w.program(d.motion)},
        **{"rate": w.integers(d.rate), "turning": len(d.turns), "turn": d.turns.shape[1]},
        **{"turns": w.integers(d.turns[:, :1]) if turn else "NULL"},
        **{name: w.program(part) for name, part in projections.items()},
        "surplus": "NULL" if k is None else w.integers(k.surplus),
        "residuals": "NULL" if k is None else w.integers(k.residuals),
        **{"positions": 0 if k is None else k.positions, "equations": equations, "tableau": "&method"},
        **{"moving": repr(float(d.moving)), "surplus_allowed": repr(method.surplus), "stiff": repr(method.stiff)},
        **{"patience": "INT64_MAX", "refusals": method.refusals, "attempts": method.attempts},
        **{"guarded": int(method.guarded), "instants": 2, "places": w.recorded_places()},
        "contacts": "NULL" if touching is None else "&motion_contacts",
    }
    limits = [
        f"{{{w.texts([x.name])}, {x.index}, {_end(x.minimum)}, {_end(x.maximum)}, {int(x.exclusive)}}}"
        for x in model.limits
    ]
    tensors = [f"{{{w.texts([x.body])}, {w.integers(x.index)}}}" for x in model.tensors]
    seen = [
        f"{{{w.program(program.part)}, {w.integers(program.results)}, {len(program.results)}}}"
        for program in measuring
        if program is not None
    ]
    laws, pending = written_laws(w, model)
    most = max((len(x.measure.names) + len(x.held) for x in model.controls), default=0)
    constants = w.numbers(model.parameters.constants)
    random, kernel = w.integers(model.parameters.random), w.kernel(model.parameters.kernel)
    values = {
        "drawn_places": w.integers(model.drawn),
        "stated_places": w.integers(stated),
        "break_places": w.integers(model.breaks),
        "added_parameters": w.numbers(model.added_breaks),
        "knot_parameters": w.numbers(knots),
        "deviation_parameters": w.numbers(deviations),
        "constant_parameters": constants,
        "random_places": random,
        "equation_values": w.integers(closing.equations.values),
        "equation_names": w.texts(model.equations),
        "mirror_rows": w.integers(closing.cosines),
        "output_rows": w.integers(outputs.results),
        "output_turns": w.numbers(model.outputs.turns),
        "output_references": w.numbers(model.outputs.reference),
        "output_counted": w.integers(model.outputs.counted.astype(int)),
        "contact_rows": contact_rows,
        "initial_rows": "NULL" if initial is None else w.integers(initial.results),
        "initial_places": w.integers(initial_states),
        "moving_places": w.integers(moving),
        "command_places": w.integers([x.place for x in commands]),
        "measured_places": w.integers([which * MOST_MEASURED + number for _, which, number in measured]),
    }
    sizes = {
        "MOTION_INPUTS": len(model.inputs),
        "MOTION_OUTPUTS": len(model.outputs.names),
        "MOTION_RESULTS": len(outputs.results),
        "MOTION_COORDINATES": layout.coordinates,
        "MOTION_STATES": layout.states,
        "MOTION_WIDTH": layout.width,
        "MOTION_PARAMETERS": len(model.parameters.constants),
        "MOTION_RANDOM": len(model.parameters.random),
        "MOTION_BLOCK": model.block_parameters,
        "MOTION_STATED": len(stated),
        "MOTION_CONSTRAINTS": len(model.equations),
        "MOTION_EQUATIONS": equations,
        "MOTION_MIRRORS": len(closing.cosines),
        "MOTION_INITIAL": len(initial_states),
        "MOTION_BREAKS": len(model.breaks),
        "MOTION_ADDED": len(model.added_breaks),
        "MOTION_MOVING": len(moving),
        "MOTION_KNOTS": len(knots),
        "MOTION_WORK": work,
        "MOTION_LIMITS": len(limits),
        "MOTION_TENSORS": len(tensors),
        "MOTION_COMMANDS": len(commands),
        "MOTION_MEASURED": len(measured),
        "MOTION_LOOPS": len(seen),
        "MOTION_LAWS": len(laws),
        "MOTION_PENDING": pending,
        "MOTION_MOST_CONTROL": most,
        "MOTION_MOST_MEASURED": MOST_MEASURED,
        **contact_sizes,
        "MOTION_MOVES": int(bool(model.statements) or model.rheonomic),
    }
    data = [
        '/* Kernels and tables of the mechanism. */\n#include "motion.h"\n',
        w.source(),
        f"static const Tableau method = {w.tableau()};",
        f"const Contacts motion_contacts = {contacts};",
        "const Problem motion_problem = {" + ",\n    ".join(f".{name} = {x}" for name, x in problem.items()) + "};",
        f"const Equations motion_closing = {closing_text};",
        f"const Equations motion_speeds = {speeds_text};",
        f"const Turns motion_turns = {w.turns(closing.turns)};",
        f"const Program motion_outputs = {w.program(outputs.part)};",
        f"const Program motion_initial = {empty if initial is None else w.program(initial.part)};",
        f"Kernel *const motion_parameters = {kernel};",
        *(f"const int64_t *const motion_{name} = {x};" for name, x in values.items() if is_whole(name)),
        *(f"const double *const motion_{name} = {x};" for name, x in values.items() if is_real(name)),
        f"const char *const *const motion_equation_names = {values['equation_names']};",
        f"const char *const *const motion_event_names = {w.texts([name for name, *_ in model.events])};",
        f"const Limit motion_limits[] = {{{', '.join(limits) or '{NULL, 0, 0.0, 0.0, 0}'}}};",
        f"const Tensor motion_tensors[] = {{{', '.join(tensors) or '{NULL, NULL}'}}};",
        f"const Measurement motion_measurements[] = {{{', '.join(seen) or '{' + empty + ', NULL, 0}'}}};",
        f"const Law motion_laws[] = {{{', '.join(laws) or '{0}'}}};",
        f"const double motion_longest = {_end(longest)}, motion_duration = {float(times[-1] - times[0])!r};",
        "",
    ]
    # tables that a structure names must precede it
    kept = w.source()
    data[1] = kept
    declared = motion_header(sizes, values)
    found = {**driver_sources(contacts=touching is not None), "motion.h": declared, "motion_data.c": "\n".join(data)}
    return PortableMotion(
        found,
        tuple(model.inputs),
        tuple(model.outputs.names),
        tuple(model.outputs.units),
        commands,
        tuple(name for name, _, _ in measured),
    )


def _end(value: float) -> str:
    if np.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    return repr(float(value))
