"""Variables of an FMU, as its description and its C source state them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from uqmbd import StudyError
from uqmbd_fmi.tables import text

__all__ = ["Variable", "check_names", "variable_table"]


@dataclass(frozen=True)
class Variable:
    """Variable of an FMU; its value reference is its position among the variables."""

    name: str
    causality: Literal["time", "parameter", "input", "output"]
    description: str = ""
    units: str = ""
    start: float | None = None
    low: float | None = None
    high: float | None = None
    truth: bool = False
    tunable: bool = False
    content: str = ""
    """Entry of the C table of contents."""
    depends: tuple[str, ...] | None = None
    """Inputs that change an output at a communication point, without a step; None: not stated."""
    starts: tuple[str, ...] = ()
    """Inputs and parameters that change it in initialisation mode."""


def check_names(variables: Sequence[Variable]) -> None:
    """Raise StudyError if two variables have the same name, or a name contains a line break or a tab."""
    seen: set[str] = set()
    for one in variables:
        if one.name in seen:
            raise StudyError(
                f"Two variables of the FMU have the name {one.name!r}; rename the output or input of this name, "
                "because statistics have the name of their output with an ending."
            )
        if set(one.name) & set("\n\r\t"):
            raise StudyError(f"The name {one.name!r} contains a line break or a tab; expected a name without them.")
        seen.add(one.name)


def variable_table(variables: Sequence[Variable]) -> str:
    """Return the C tables of variables and of their contents."""
    rows = [
        f"{{{text(v.name)}, {'BOOLEAN' if v.truth else 'REAL'}, {v.causality.upper()}, {int(v.tunable)}}}"
        for v in variables
    ]
    return (
        "const Variable model_variables[] = {\n    "
        + ",\n    ".join(rows)
        + f"}};\nconst unsigned model_variable_count = {len(rows)};\n"
    )
