"""One motion without uncertainty."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.arguments import fits, refusal
from uqmbd.errors import (
    AssemblyError,
    IntegrationError,
    RedundantConstraintWarning,
    StudyError,
    StudyWarning,
    UqmbdError,
)
from uqmbd.names import checked
from uqmbd.propagation.integration_error import LEAST, LONG_NAME, deviation, equal_but_for_rounding, tighter
from uqmbd.propagation.observed_model import (
    build_observed_model,
    finding_attributes,
    not_unique_attribute,
    refuse_jumps,
    several_motions,
    step_attributes,
    warn_of,
)
from uqmbd.propagation.options import (
    check_breaks,
    check_integrator,
    check_max_step,
    check_rtol,
    check_start,
    check_times,
)
from uqmbd.typing import Array

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.dynamics import Ensemble, Model, Trajectories
    from uqmbd.mechanism import Mechanism

__all__ = ["input_point", "simulate", "variables_of"]


@checked
def simulate(
    mechanism: Mechanism,
    times: ArrayLike,
    values: Mapping[str, float] | None = None,
    rtol: float = 1e-6,
    integrator: str = "auto",
    start: str = "drawn",
    check: bool = True,
    max_step: float | None = None,
    breaks: Sequence[float] = (),
) -> xr.Dataset:
    """Compute one motion, at the means of the random variables or at given values.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism with at least one output.
    times : array_like, shape (T,)
        Output times, s, strictly increasing; the first is the initial time.
    values : mapping, optional
        Values of random variables by name. Default: their means.
    rtol : float
        Relative tolerance of the integration.
    integrator, start : str
        Name of the integrator and initial pose, as for `Study`.
    check : bool
        Whether to measure the integration error by a second integration at one hundredth of the tolerance. If its steps
        are the same, as between samples of a controller, a third integration has the tolerance 1e-13.
    max_step : float, optional
        Longest step of the integration, s, as for `Study`.
    breaks : sequence of float
        Times at which the integration restarts, s, as for `Study`.

    Returns
    -------
    xarray.Dataset
        One variable for each output, with its units, over the dimension ``time``. :func:`uqmbd.results.by_output` gives
        statistics the same form. Angles are unwrapped, as in a study, and have the length of a turn as an attribute.
        Scalar outputs have no dimension. If statics determines all outputs, the integration is omitted.

        With `check`, the coordinate ``integration_error`` (output, time) is the absolute error of each output, in its
        units (``output_units``). ``scalar_integration_error`` (scalar) is the absolute error of scalar outputs
        (``scalar_units``). Unknown errors are NaN, with the attribute ``reason``. If an output has one of these names,
        an underscore is appended to the name of the coordinate.

        For requirements, ``requirement_margin`` (requirement, time) is the smallest margin until each time;
        ``requirement_met`` (requirement) states whether each is met.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid.
    uqmbd.AssemblyError, uqmbd.IntegrationError
        If the mechanism cannot be assembled, or the integration stops.

    Examples
    --------
    >>> import numpy as np, uqmbd
    >>> mechanism = uqmbd.Mechanism("fall", uqmbd.Translational(gravity=(0, -10)))
    >>> stone = mechanism.body("stone", mass=1)
    >>> mechanism.output("height", stone.position[1], units="m")
    >>> round(float(simulate(mechanism, [0, 1, 2])["height"][-1]), 6)
    -20.0
    """
    import xarray as xr

    from uqmbd.dynamics import Ensemble, integrate, require_for
    from uqmbd.mechanism import Mechanism
    from uqmbd.propagation.execution import integrated_by, not_finite_output
    from uqmbd.results.schema import CF, as_text

    if not isinstance(mechanism, Mechanism):
        raise StudyError(f"simulate: the mechanism is {mechanism!r}; expected a uqmbd.Mechanism.")
    where = f"simulate {mechanism.name!r}"
    grid, rtol = check_times(times, where), check_rtol(rtol, where)
    check_integrator(integrator, where)
    check_start(start, where)
    if not fits(check, bool):
        raise StudyError(f"{where}: {refusal('check', check, bool)}")
    point = input_point(where, mechanism, values)
    longest, added = check_max_step(max_step, where), check_breaks(breaks, where)
    model = build_observed_model(mechanism, float(grid[0]), start, longest, added)
    warn_of(model, stacklevel=3)
    require_for(model, integrator, where)
    ensemble = Ensemble(model, np.array([list(point.values())]))
    moved = [one for one in (model.scalars, model.margins) if one is not None]
    if not model.outputs.names and not any(one.needs_motion for one in moved):
        still = {"Conventions": CF, "mechanism": mechanism.name, "start": start}
        alone = {} if model.scalars is None else _scalars(mechanism, ensemble, None)
        return as_text(with_margins(xr.Dataset(alone, attrs=still), mechanism.name, ensemble, grid))
    refuse_jumps(ensemble, grid, rtol, where)
    trajectories = integrate(ensemble, grid, rtol, integrator, between=model.needs_dense_output)
    if trajectories.messages[0]:
        message = f"mechanism {mechanism.name!r}: {trajectories.messages[0]}"
        raise (IntegrationError if np.isfinite(trajectories.states[0, 0]).all() else AssemblyError)(message)
    if beyond := model.beyond(grid, trajectories.states[0]):
        warnings.warn(f"{where}: {beyond}.", StudyWarning, stacklevel=3)
    response = ensemble.outputs(grid, trajectories.states)[0]
    if not np.isfinite(response).all():
        reason = not_finite_output(ensemble, 0, grid, trajectories.states[0], response)
        warnings.warn(f"{where}: {reason}.", stacklevel=3)
    counters = trajectories.counters
    if counters.two_motions:
        warnings.warn(f"{where}: {several_motions(trajectories.notes[0])}", StudyWarning, stacklevel=3)
    attrs = {
        "Conventions": CF,
        "mechanism": mechanism.name,
        "rtol": rtol,
        "integrator": integrator,
        **integrated_by(asdict(counters), integrator),
        "start": start,
        **step_attributes(longest, added),
        "residual_evaluations": counters.residuals,
        "jacobian_evaluations": counters.jacobians,
        **not_unique_attribute(model),
        **finding_attributes(model.findings),
    }
    variables = variables_of(model, response, "time")
    if model.scalars is not None:
        variables |= _scalars(mechanism, ensemble, trajectories)
    coords: dict[str, Any] = {"time": ("time", grid, {"units": "s", "long_name": "time"})}
    if check:
        coords |= _errors(ensemble, grid, rtol, trajectories, response, set(variables))
    data = xr.Dataset(variables, coords=coords, attrs=attrs)
    return as_text(with_margins(data, mechanism.name, ensemble, grid, trajectories))


def with_margins(
    data: xr.Dataset, name: str, ensemble: Ensemble, times: Array, trajectories: Trajectories | None = None
) -> xr.Dataset:
    """Add the margins of the requirements of one realisation, and whether each is met, if there are requirements."""
    from uqmbd.dynamics import margins_of

    if ensemble.model.margins is None:
        return data
    found, seen = margins_of(ensemble, times, trajectories), ensemble.model.margins
    if found.messages[0]:
        raise AssemblyError(f"mechanism {name!r}: {found.messages[0]}")
    taken = {str(x) for x in (*data.variables, *data.dims)}
    dimension, margin, met = (free_name(x, taken) for x in ("requirement", "requirement_margin", "requirement_met"))
    words = {"long_name": "smallest margin so far; below zero the requirement is violated"}
    names = np.array([one.name for one in seen.requirements], dtype=np.str_)
    over_time = "time" in data.dims
    dims = (dimension, "time") if over_time else (dimension,)
    values = found.running[0] if over_time else found.values[0]
    added = {margin: (dims, values, words), met: (dimension, found.values[0] >= 0)}
    return data.assign(added).assign_coords({dimension: names})


def _errors(
    ensemble: Ensemble, times: Array, rtol: float, first: Trajectories, response: Array, taken: set[str]
) -> dict[str, tuple[Any, ...]]:
    """Return coordinates with the integration error of one realisation."""
    from uqmbd.dynamics import integrate, scalars_of

    model, tight = ensemble.model, tighter(rtol)
    again: Trajectories | None = None
    reason = f"rtol is {rtol:g}; a smaller tolerance would not reduce the error"
    if tight is not None:
        reason = ""
        try:
            with warnings.catch_warnings():
                # the first integration has already issued this warning
                warnings.simplefilter("ignore", RedundantConstraintWarning)
                again = integrate(ensemble, times, tight, between=first.path is not None)
                if tight > LEAST and equal_but_for_rounding(np.abs(first.states - again.states), first.states):
                    # equal steps, for example from sample to sample of a controller, do not measure the error
                    tight = LEAST
                    again = integrate(ensemble, times, tight, between=first.path is not None)
            reason = again.messages[0]
        except UqmbdError as raised:
            reason = str(raised)
        reason = reason and f"integrating again with rtol {tight:g} failed: {reason}"
    comment = {"reason": reason} if reason else {"comment": f"against an integration with rtol {tight:g}"}
    found: dict[str, tuple[Any, ...]] = {}

    def add(names: tuple[str, ...], units: tuple[str, ...], dimension: str, error: Array, *more: str) -> None:
        name = free_name(f"{'scalar_' if dimension == 'scalar' else ''}integration_error", taken)
        beside = free_name(f"{dimension}_units", taken)
        dimension = free_name(dimension, taken)
        found[dimension] = (dimension, np.array(names, dtype=np.str_))
        found[beside] = (dimension, np.array(units, dtype=np.str_))
        one = {"units": units[0]} if len(set(units)) == 1 and units[0] else {}
        found[name] = ((dimension, *more), error, {"long_name": LONG_NAME, **one, **comment})

    if model.outputs.names:
        error = np.full((len(model.outputs.names), len(times)), np.nan)
        if again is not None and not reason:
            error = deviation(response, ensemble.outputs(times, again.states)[0], model.outputs.turns)
        add(model.outputs.names, model.outputs.units, "output", error, "time")
    if model.scalars is not None and model.scalars.needs_motion:
        values = scalars_of(ensemble, again).values[0] if again is not None and not reason else np.nan
        add(model.scalars.names, model.scalars.units, "scalar", np.abs(scalars_of(ensemble, first).values[0] - values))
    return found


def free_name(name: str, taken: set[str]) -> str:
    """Return a name that differs from all output names.

    >>> free_name("output", {"output"}), free_name("output", {"x"})
    ('output_', 'output')
    """
    while name in taken:
        name += "_"
    return name


def _scalars(mechanism: Mechanism, ensemble: Ensemble, trajectories: Trajectories | None) -> dict[str, tuple[Any, ...]]:
    """Return the variables of the scalar outputs."""
    from uqmbd.dynamics import scalars_of

    found, seen = scalars_of(ensemble, trajectories), ensemble.model.scalars
    if found.messages[0]:
        raise AssemblyError(f"mechanism {mechanism.name!r}: {found.messages[0]}")
    variables: dict[str, tuple[Any, ...]] = {}
    for k, (name, units) in enumerate(zip(seen.names, seen.units, strict=True)):
        late = bool(found.censored[0, k])
        variables[name] = (
            (),
            found.values[0, k],
            {**_about(name, units), **({"comment": seen.late[k]} if late else {})},
        )
        if late and seen.of_events(k):
            warnings.warn(
                f"simulate {mechanism.name!r}: {seen.late[k]}, so the output {name!r} is NaN. Use a later end time, or "
                "inspect the motion.",
                stacklevel=4,
            )
    return variables


def variables_of(model: Model, response: Array, *dimensions: str) -> dict[str, tuple[Any, ...]]:
    """Return the variables of a dataset from the response (output, ...) of one realisation."""
    seen = model.outputs
    return {
        name: (dimensions, response[k], {**_about(name, units), **({"turn": turn} if turn else {})})
        for k, (name, units, turn) in enumerate(zip(seen.names, seen.units, seen.turns.tolist(), strict=True))
    }


def _about(name: str, units: str) -> dict[str, str]:
    """Return the attributes of an output; unknown units are omitted."""
    return {"long_name": name, **({"units": units} if units else {})}


def input_point(where: str, mechanism: Mechanism, values: Mapping[str, float] | None) -> dict[str, float]:
    """Return the value of each random variable, in order: the given value, otherwise the mean."""
    inputs = mechanism.inputs
    point = {name: float(mean) for name, mean in zip(inputs.names, inputs.means, strict=True)}
    if values is not None and not isinstance(values, Mapping):
        raise StudyError(f"{where}: values is {values!r}; expected numbers by name, e.g. values={{'length': 0.15}}.")
    for name, value in (values or {}).items():
        if name not in point:
            listed = ", ".join(inputs.names) or "none"
            raise StudyError(f"{where}: values contains {str(name)!r}; expected names of random variables: {listed}.")
        try:
            point[name] = float(value)
        except (TypeError, ValueError):
            point[name] = float("nan")
        if not np.isfinite(point[name]):
            raise StudyError(f"{where}: the value of {name!r} is {value!r}; expected a finite number.")
    for variable in inputs.variables:
        if variable.is_key and not 0 <= point[variable.name] <= 1:
            raise StudyError(
                f"{where}: {variable.name} = {point[variable.name]:g} is not valid: this variable selects a sampled "
                "path; expected a number from 0 to 1."
            )
    return point
