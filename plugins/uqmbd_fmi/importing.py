"""FMUs as sampled controllers and forces of a mechanism."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import uqmbd
from uqmbd import StudyError
from uqmbd.extend import Bounds, typechecked
from uqmbd_fmi.histories import STATES, FmuFunction
from uqmbd_fmi.running import Setting, description_of, fmpy_package

__all__ = ["fmu_controller"]

REAL = ("Real", "Float64")
"""Types of variables that exchange numbers."""

SETTABLE: dict[str, type | tuple[type, ...]] = {
    "Integer": int,
    "Enumeration": int,
    "Boolean": bool,
    "String": str,
    "Int32": int,
    "Int64": int,
}
"""Types of parameters that have a fixed value, and the type of the value."""


@typechecked
def fmu_controller(
    name: str,
    path: str | Path,
    *,
    inputs: Mapping[str, Any],
    outputs: Sequence[str] | Mapping[str, str],
    rate: Annotated[float, Bounds(0, above=True)],
    parameters: Mapping[str, Any] | None = None,
    delay: Annotated[float, Bounds(0)] = 0.0,
    limits: Any = None,
    initial: Any = 0.0,
) -> uqmbd.Controller:
    """Return a sampled controller whose commands an FMU computes; a force is a command as well.

    At each sample, the FMU receives the measured values and performs a step of ``1 / rate``. Its outputs at the end of
    this step are the commands. They act at the sample, or after `delay`. A delay of ``1 / rate`` applies the outputs at
    the end of the step that computes them.

    Parameters
    ----------
    name : str
        Name of the controller, unique in the mechanism.
    path : str or pathlib.Path
        FMU for co-simulation, of FMI 2.0 or 3.0, with a binary for this platform.
    inputs : mapping of str to str or expression
        Measured quantity for each input of the FMU: the name of an output of the mechanism, or a scalar expression.
        Inputs of the FMU that are not in the mapping have their start values.
    outputs : sequence of str, or mapping of str to str
        Outputs of the FMU that are commands; a mapping also states their units.
    rate : float
        Sampling rate, Hz.
    parameters : mapping of str to number or expression, optional
        Value of each parameter of the FMU, which may contain random variables. Values of parameters that are integers,
        Booleans or texts must be fixed.
    delay : float
        Time from a sample until its commands act, s.
    limits, initial : optional
        Limits and initial values of the commands, as for `uqmbd.Controller`.

    Returns
    -------
    uqmbd.Controller
        Controller to add to a mechanism.

    Raises
    ------
    uqmbd.StudyError
        If FMPy is not installed, the FMU cannot be used, or it has no variable of a name.

    Notes
    -----
    Each realisation has a separate instance of the FMU, which is made at the first sample and never reset. If a
    function of the FMU returns an error status, its realisation fails, and the message contains the message of the FMU.
    Reference: Functional Mock-up Interface 2.0.4 and 3.0.1, https://fmi-standard.org.

    Examples
    --------
    >>> import chaospy, uqmbd, uqmbd_fmi
    >>> gain = uqmbd.RandomVariable("gain", chaospy.Uniform(2, 4))
    >>> controller = uqmbd_fmi.fmu_controller(  # doctest: +SKIP
    ...     "loop", "pi.fmu", inputs={"y": "speed"}, outputs={"u": "N m"}, rate=50, parameters={"gain": gain}
    ... )
    """
    where, file = f"fmu_controller {name!r}", Path(path)
    if not file.is_file():
        raise StudyError(f"{where}: the file {file} does not exist; expected an FMU.")
    fmpy_package(where)
    content = file.read_bytes()
    about = description_of(content, f"{where}: {file.name}")
    _check_kind(about, content, f"{where}: {file.name}", rate)
    variables = {one.name: one for one in about.modelVariables}
    at = f"{where}: {file.name}"
    into = [_variable(at, variables, key, "input").valueReference for key in inputs]
    settings, tuned, measured = list[Setting](), list[int](), list[Any](inputs.values())
    for key, value in (parameters or {}).items():
        one = _variable(at, variables, key, "parameter", (*REAL, *SETTABLE))
        if one.type in REAL:
            tuned.append(one.valueReference)
            measured.append(value)
            continue
        if type(value) is not SETTABLE[one.type]:
            raise StudyError(
                f"{at}: the parameter {key!r} is {value!r}; expected a value of the type {one.type}, without random "
                "variables."
            )
        settings.append(Setting(one.type, one.valueReference, value))
    commanded = outputs if isinstance(outputs, Mapping) else dict.fromkeys(outputs, "")
    out = [_variable(at, variables, key, "output").valueReference for key in commanded]
    function = FmuFunction(file.name, content, float(rate), tuple(into), tuple(tuned), tuple(out), tuple(settings))
    return uqmbd.Controller(
        name,
        measured=measured or [uqmbd.t],
        commanded=dict(commanded),
        rate=rate,
        function=function,
        state=dict.fromkeys(STATES, 0.0),
        delay=delay,
        limits=limits,
        initial=initial,
    )


def _check_kind(about: Any, content: bytes, where: str, rate: float) -> None:
    """Raise StudyError if the FMU cannot be run in steps on this platform, with several instances."""
    fmpy = fmpy_package(where)
    if not str(about.fmiVersion).startswith(("2.", "3.")):
        raise StudyError(f"{where}: the FMU is of FMI {about.fmiVersion}; expected FMI 2.0 or 3.0.")
    kind = about.coSimulation
    if kind is None:
        raise StudyError(
            f"{where}: the FMU is not for co-simulation; expected a co-simulation FMU, which contains its solver."
        )
    if kind.canBeInstantiatedOnlyOncePerProcess:
        raise StudyError(
            f"{where}: the FMU can be instantiated only once per process (canBeInstantiatedOnlyOncePerProcess); each "
            "realisation needs a separate instance."
        )
    platforms = fmpy.supported_platforms(io.BytesIO(content))
    if fmpy.platform not in platforms and fmpy.platform_tuple not in platforms:
        listed = ", ".join(platforms) or "none"
        raise StudyError(
            f"{where}: the FMU has no binary for {fmpy.platform_tuple}; its platforms are: {listed}. "
            "`fmpy compile FILE` adds a binary to an FMU with sources (c-code)."
        )
    internal = float(kind.fixedInternalStepSize or 0)  # FMPy returns the text of this attribute
    if internal and abs(round(1 / rate / internal) * internal * rate - 1) > 1e-9:
        raise StudyError(
            f"{where}: the FMU has steps of {internal:g} s; expected a rate of {1 / internal:g} Hz divided by a whole "
            f"number, not {rate:g} Hz."
        )


def _variable(
    where: str, variables: Mapping[str, Any], name: str, causality: str, types: tuple[str, ...] = REAL
) -> Any:
    """Return a variable of the FMU after a check of its causality and type."""
    known = [v.name for v in variables.values() if v.causality == causality and v.type in types]
    one = variables.get(name)
    if one is None or one.causality != causality:
        what = "not a variable of the FMU" if one is None else f"of the causality {one.causality!r}, not {causality!r}"
        listed = ", ".join(map(repr, known[:20])) or "none"
        raise StudyError(f"{where}: {name!r} is {what}. The {causality}s of the FMU are: {listed}.")
    if one.type not in types or one.dimensions:
        of = f"an array of {one.type}" if one.dimensions else f"of the type {one.type}"
        raise StudyError(f"{where}: the {causality} {name!r} is {of}; expected a scalar of {' or '.join(types)}.")
    return one
