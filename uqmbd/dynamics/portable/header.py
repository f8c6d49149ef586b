"""Header of the tables of a motion in C."""

from __future__ import annotations

from typing import Any

from uqmbd.mechanism import LARGEST

__all__ = ["is_real", "is_whole", "motion_header"]

POOR = 1e-7
"""Relative residual of accelerations and reactions above which a program warns."""


def is_whole(name: str) -> bool:
    """Return whether a table contains integers."""
    return name.endswith(("_places", "_values", "_rows", "_counted"))


def is_real(name: str) -> bool:
    """Return whether a table contains numbers."""
    return name.endswith(("_parameters", "_turns", "_references"))


def motion_header(sizes: dict[str, int], values: dict[str, Any]) -> str:
    """Return the header of the tables."""
    enumerated = ",\n".join(f"    {name} = {size}" for name, size in sizes.items())
    tables = [f"extern const int64_t *const motion_{name};" for name in values if is_whole(name)]
    tables += [f"extern const double *const motion_{name};" for name in values if is_real(name)]
    return "\n".join(
        [
            "/* Sizes and tables of the motion of a mechanism. */",
            "#ifndef UQMBD_MOTION_H",
            "#define UQMBD_MOTION_H",
            "",
            '#include "tables.h"',
            '#include "waiting.h"',
            '#include "assembly.h"',
            "",
            f"enum {{\n{enumerated},\n}};",
            "",
            f"#define MOTION_LARGEST {LARGEST!r}",
            f"#define MOTION_POOR {POOR**2!r}",
            "",
            "/* Parameter with a range. */",
            "typedef struct {",
            "    const char *const *name;",
            "    int64_t index;",
            "    double minimum, maximum;",
            "    int exclusive;",
            "} Limit;",
            "",
            "/* Inertia tensor: six parameters Jxx, Jyy, Jzz, Jxy, Jxz, Jyz. */",
            "typedef struct {",
            "    const char *const *body;",
            "    const int64_t *index;",
            "} Tensor;",
            "",
            "/* Program of the measured values of a controller. */",
            "typedef struct {",
            "    Program program;",
            "    const int64_t *rows;",
            "    int64_t count;",
            "} Measurement;",
            "",
            "/* Controller with a law: of time, measured values, states and inputs, to commands and new states. */",
            "typedef struct {",
            "    const char *const *name;",
            "    int64_t measurement, measured, commands, states;",
            "    int64_t waiting, first; /* samples whose commands wait for the end of the delay, and their place */",
            "    double rate, delay;",
            "    Kernel *law;",
            "    const int64_t *held;          /* commands, then states: indices in the state */",
            "    const double *limits;         /* least commands, then largest ones */",
            "    const int64_t *random_limits; /* those that depend on inputs, by a kernel */",
            "    int64_t random;",
            "    Kernel *find_limits;",
            "    int accelerates; /* whether the last measured value is the residual of accelerations */",
            "} Law;",
            "",
            "extern const Problem motion_problem; /* without tolerances and times */",
            "extern const Equations motion_closing, motion_speeds;",
            "extern const Turns motion_turns;",
            "extern const Program motion_outputs, motion_initial;",
            "extern Kernel *const motion_parameters;",
            *tables,
            "extern const Contacts motion_contacts;",
            "extern const char *const *const motion_event_names;",
            "extern const char *const *const motion_equation_names;",
            "extern const Limit motion_limits[];",
            "extern const Tensor motion_tensors[];",
            "extern const Measurement motion_measurements[];",
            "extern const Law motion_laws[];",
            "extern const double motion_longest, motion_duration; /* longest step, duration of a simulation, s */",
            "",
            "#endif",
            "",
        ]
    )
