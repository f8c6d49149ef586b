"""Static equilibrium and eigenfrequencies, without uncertainty."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from uqmbd.arguments import fits, shown
from uqmbd.errors import AssemblyError, StudyError
from uqmbd.names import checked
from uqmbd.propagation.observed_model import build_observed_model, friction_at_rest, warn_of
from uqmbd.propagation.simulation.deterministic import input_point, variables_of

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.dynamics import Ensemble, Equilibrium, Model
    from uqmbd.mechanism import Mechanism

__all__ = ["eigenfrequencies", "static_equilibrium"]


@checked
def static_equilibrium(
    mechanism: Mechanism, values: Mapping[str, float] | None = None, time: float = 0.0
) -> xr.Dataset:
    """Compute the static equilibrium, at the means of the random variables or at given values.

    The search starts at the given pose, and moves the bodies in directions in which forces do positive work. If the
    given pose is exactly an unstable equilibrium, it is the result. During the search, the angles of rotational springs
    follow the bodies over any number of turns, and wheels roll. If the rest position of a wheel may depend on its path,
    the function raises an error.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism with at least one output.
    values : mapping, optional
        Values of random variables by name. Default: their means.
    time : float
        Time for the values of drivers and loads, s.

    Returns
    -------
    xarray.Dataset
        One variable for each output, with its units, at rest. The attribute ``stable`` is 0 if the equilibrium is
        unstable.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid.
    uqmbd.AssemblyError
        If there is no assembly or no equilibrium. The message names the body with the largest imbalance.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_springs import SpringDamper
    >>> mechanism = uqmbd.Mechanism("balance", uqmbd.Translational(gravity=(0, -10)))
    >>> pan = mechanism.body("pan", mass=2, position=(0, -1))
    >>> spring = mechanism.add(SpringDamper("spring", mechanism.ground, pan, (0, 0), (0, 0), 100, free_length=1))
    >>> mechanism.output("height", pan.position[1], units="m")
    >>> round(float(static_equilibrium(mechanism)["height"]), 9)
    -1.2
    """
    import xarray as xr

    from uqmbd.dynamics import Ensemble

    where = f"static_equilibrium {_named(mechanism, 'static_equilibrium')!r}"
    point = input_point(where, mechanism, values)
    model = build_observed_model(mechanism, _moment(time, where))
    warn_of(model, stacklevel=3)
    ensemble = Ensemble(model, np.array([list(point.values())]))
    found = _found(mechanism, ensemble)
    for finding in friction_at_rest(model, ensemble.values[0], every=True):
        warnings.warn(f"{finding.text}.", finding.category, stacklevel=3)
    states = np.concatenate([found.q, found.s, np.zeros_like(found.q)], axis=1)
    response = ensemble.outputs(np.array([model.time]), states[:, None, :])[0, :, 0]
    attrs = {"mechanism": mechanism.name, "stable": int(found.stable[0]), "steps": int(found.iterations[0])}
    return xr.Dataset(variables_of(model, response), coords={"time": ((), model.time, {"units": "s"})}, attrs=attrs)


@checked
def eigenfrequencies(
    mechanism: Mechanism, values: Mapping[str, float] | None = None, at: str = "equilibrium", time: float = 0.0
) -> xr.Dataset:
    """Compute eigenfrequencies and damping ratios of small motions, at the means of the inputs or at given values.

    For ``equilibrium`` and ``start``, drivers and loads are constant, with their values at `time`. For ``steady``,
    drivers continue to move with their rates at `time`.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism; outputs are not required.
    values : mapping, optional
        Values of random variables by name. Default: their means.
    at : {"equilibrium", "start", "steady"}
        State about which the motion is linearised. ``equilibrium``: the static equilibrium. ``start``: the assembled
        given pose, at rest. ``steady``: the steady motion, found from the assembled given pose (see `uqmbd.at_steady`;
        `uqmbd.eigenfrequency` states the frame of reference).
    time : float
        Time at which drivers and loads are evaluated, s.

    Returns
    -------
    xarray.Dataset
        Over the dimension ``mode``, in ascending order of frequency: ``frequency``, ``|eigenvalue| / 2 pi``, Hz;
        ``damping_ratio``, ``-Re(eigenvalue) / |eigenvalue|``; ``eigenvalue_real`` and ``eigenvalue_imaginary``, 1/s.
        An overdamped degree of freedom has two modes of damping ratio 1. An unstable degree of freedom has a mode of
        damping ratio -1; a rigid-body mode has frequency and damping ratio 0.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid.
    uqmbd.AssemblyError
        If there is no assembly, no equilibrium, or no steady motion.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_springs import SpringDamper
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    >>> mass = mechanism.body("mass", mass=2, position=(1, 0))
    >>> spring = mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), stiffness=8))
    >>> [round(float(f), 6) for f in eigenfrequencies(mechanism)["frequency"]]  # in both directions
    [0.31831, 0.31831]
    """
    import xarray as xr

    from uqmbd.dynamics import Ensemble, linearise, linearise_steady, steady_motions

    where = f"eigenfrequencies {_named(mechanism, 'eigenfrequencies')!r}"
    if not isinstance(at, str) or at not in ("equilibrium", "start", "steady"):
        raise StudyError(f"{where}: at={at!r}; expected 'equilibrium', 'start' or 'steady'.")
    point = input_point(where, mechanism, values)
    ensemble = Ensemble(_any_model(mechanism, _moment(time, where)), np.array([list(point.values())]))
    if at == "equilibrium":
        found = _found(mechanism, ensemble)
        modes, reasons = linearise(ensemble, found.q, found.s)
    elif at == "steady":
        modes, reasons = linearise_steady(ensemble, steady_motions(ensemble))
    else:
        start = ensemble.start
        if start.messages[0]:
            raise AssemblyError(f"mechanism {mechanism.name!r}: {start.messages[0]}")
        modes, reasons = linearise(ensemble, start.q, start.s)
    if reasons[0]:
        raise AssemblyError(f"mechanism {mechanism.name!r}: {reasons[0]}")
    values_of = modes.eigenvalues[0]
    return xr.Dataset(
        {
            "frequency": ("mode", modes.frequency[0], {"units": "Hz"}),
            "damping_ratio": ("mode", modes.damping_ratio[0], {"units": "1"}),
            "eigenvalue_real": ("mode", values_of.real.copy(), {"units": "1/s"}),
            "eigenvalue_imaginary": ("mode", values_of.imag.copy(), {"units": "1/s"}),
        },
        coords={"mode": np.arange(1, len(values_of) + 1)},
        attrs={"mechanism": mechanism.name, "at": at, "time": ensemble.model.time},
    )


def _named(mechanism: Mechanism, function: str) -> str:
    from uqmbd.mechanism import Mechanism

    if not isinstance(mechanism, Mechanism):
        raise StudyError(f"{function}: the mechanism is {mechanism!r}; expected a uqmbd.Mechanism.")
    return mechanism.name


def _moment(time: float, where: str) -> float:
    if not fits(time, float) or not np.isfinite(float(time)):
        raise StudyError(f"{where}: time is {shown(time)}; expected a number in s.")
    return float(time)


def _any_model(mechanism: Mechanism, time: float) -> Model:
    """Build a mechanism with or without outputs."""
    from uqmbd.dynamics import build

    if mechanism.outputs:
        model = build_observed_model(mechanism, time)
        warn_of(model, stacklevel=4)
        return model
    return mechanism.remembered(("model without outputs", time), lambda: build(mechanism, time))


def _found(mechanism: Mechanism, ensemble: Ensemble) -> Equilibrium:
    """Return the equilibrium of the only realisation of an ensemble."""
    from uqmbd.dynamics import static_equilibria

    found = static_equilibria(ensemble)
    if found.messages[0]:
        raise AssemblyError(f"mechanism {mechanism.name!r}: {found.messages[0]}")
    return found
