"""C tables of a mechanism, and the variables of its FMU."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

import uqmbd
from uqmbd import StudyError
from uqmbd.extend import GermSpace, motion_source
from uqmbd_fmi.surrogate_tables import UnitModel
from uqmbd_fmi.tables import number, text
from uqmbd_fmi.variables import Variable, check_names, variable_table

__all__ = ["mechanism_model"]


def mechanism_model(
    mechanism: uqmbd.Mechanism, times: Sequence[float], held: Sequence[str], rtol: float, token: str, fmi: int
) -> UnitModel:
    """Return the model of a mechanism; raise StudyError if its motion has no form in C."""
    grid = np.asarray(times, dtype=float)
    if len(grid) < 2 or not np.all(np.diff(grid) > 0):
        raise StudyError(f"export_fmu: times is {grid.tolist()}; expected at least two increasing times.")
    motion = motion_source(mechanism, tuple(grid.tolist()), held=held, rtol=rtol)
    means = mechanism.inputs.means
    variables = []
    by_name = {v.name: v for v in mechanism.inputs.variables}
    for k, name in enumerate(motion.inputs):
        known = by_name[name]
        variables.append(
            Variable(
                name,
                "input" if name in held else "parameter",
                f"{'Input, constant in each step' if name in held else 'Random input'}, {known.description}",
                known.units,
                start=float(means[k]),
                content=f"{{INPUT_VALUE, {k}}}",
            )
        )
    for k, command in enumerate(motion.commands):
        variables.append(
            Variable(
                command.name,
                "input",
                "Command, constant in each step",
                command.units,
                start=command.start,
                content=f"{{COMMAND_VALUE, {k}}}",
            )
        )
    about = [
        (name, f"Output {name} of the mechanism", units)
        for name, units in zip(motion.outputs, motion.units, strict=True)
    ]
    about += [(name, "Measured by a controller", "") for name in motion.measured]
    parameters = [v.name for v in variables if v.causality == "parameter"]
    time = ["time"] if fmi == 3 else []
    for k, (name, description, units) in enumerate(about):
        variables.append(
            Variable(
                name,
                "output",
                description,
                units,
                content=f"{{OUTPUT_VALUE, {k}}}",
                depends=(*motion.direct[k], *time),
                starts=(*parameters, *motion.at_start[k], *time),
            )
        )
    if fmi == 3:
        variables.append(Variable("time", "time", "Time", "s", content="{TIME_VALUE, 0}"))
    check_names(variables)
    starts = ", ".join(number(x) for x in means.tolist()) or "0.0"
    commanded = ", ".join(number(x.start) for x in motion.commands) or "0.0"
    data = "\n".join(
        [
            "/* Variables of the mechanism. */",
            '#include "model.h"',
            "",
            "enum { INPUT_VALUE, OUTPUT_VALUE, TIME_VALUE, COMMAND_VALUE };",
            "",
            "typedef struct {",
            "    int what, index;",
            "} Content;",
            "",
            "extern const Content contents[];",
            "extern const double start_values[];",
            "extern const double start_commands[];",
            "extern const double default_tolerance;",
            "",
            f"const char model_token[] = {text(token)};",
            variable_table(variables),
            "const Content contents[] = {" + ", ".join(v.content for v in variables) + "};",
            f"const double start_values[] = {{{starts}}};",
            f"const double start_commands[] = {{{commanded}}};",
            f"const double default_tolerance = {number(rtol)};",
            "",
        ]
    )
    experiment = float(grid[0]), float(grid[-1]), float(np.diff(grid).min())
    space = GermSpace.of(mechanism.inputs)
    return UnitModel({**motion.files, "data.c": data}, tuple(variables), experiment, space, rtol)
