"""Protocol of integrators, and their capabilities."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import ClassVar, Literal, Protocol

from uqmbd.arguments import typechecked
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.integration import Trajectories
from uqmbd.errors import StudyError
from uqmbd.typing import Array

__all__ = ["Capabilities", "Capability", "Integrator", "capabilities_of"]

Capability = Literal[
    "events",
    "projected",
    "segments",
    "bounded_steps",
    "stoppable",
    "delegates",
    "sampled_control",
    "releases_gil",
    "dense_output",
]
"""Boolean fields of `Capabilities`."""

FORMER: Mapping[str, Capability] = {
    "events": "events",
    "projected": "projected",
    "segments": "segments",
    "paced": "bounded_steps",
    "watched": "stoppable",
    "delegates": "delegates",
    "sampled": "sampled_control",
    "unlocked": "releases_gil",
    "recorded": "dense_output",
}
"""Class attributes for capabilities before version 0.1; supported until 0.2."""


@typechecked(values=False)
@dataclass(frozen=True, kw_only=True)
class Capabilities:
    """Capabilities of an integrator beyond smooth motions.

    A missing capability that a study requires is an error before the computation.

    Parameters
    ----------
    events : bool
        Whether it handles impacts and locates other events of a mechanism.
    projected : bool
        Whether it integrates projected equations, such as Galerkin's, by a method
        ``integrate_projected(projected, times, rtol)``, which returns `uqmbd.extend.ProjectedTrajectories`.
    segments : bool
        Whether it integrates a motion from event to event by ``integrate_segments(ensemble, times, rtol)``, which
        returns the `uqmbd.extend.SegmentedMotion` of the only realisation of `ensemble`.
    bounded_steps : bool
        Whether its steps respect ``ensemble.pace(times, rtol)``: a longest step, and times of restarts.
    stoppable : bool
        Whether ``integrate_projected`` accepts ``watch=``: None, or a function of the coefficients (P, T, width) so
        far, which are NaN from the present time on. The function returns true to stop the integration.
    delegates : bool
        Whether it may leave realisations to ``dop853``, ``radau`` or ``ida``; it then names these in its counters.
    sampled_control : bool
        Whether it samples controllers by ``ensemble.sampling``, also across events if it handles events.  Otherwise
        uqmbd calls ``integrate`` from sample to sample. It calls ``integrate_projected`` from sample to sample in any
        case.
    releases_gil : bool
        Whether ``integrate`` runs compiled code that releases the global interpreter lock, and may run in several
        threads at once with the same bits as result.  Workers are then threads, unless the mechanism has events or
        controllers, which are handled in Python. Otherwise workers are processes.
    dense_output : bool
        Whether ``integrate`` accepts ``recording=True``, and then also returns its steps in `Trajectories.path`. The
        steps contain the motion between the output times, for outputs such as `uqmbd.maximum`. Integrators without this
        capability must compute states at more times.
    linear_solvers : tuple of str
        Names that ``integrate_projected`` accepts as ``linear_solver=``; empty: it does not accept the argument.

    Raises
    ------
    uqmbd.StudyError
        If a value is not true or false, or options of projected equations are declared without ``projected``.

    Examples
    --------
    >>> import uqmbd
    >>> uqmbd.extend.Capabilities(events=True, bounded_steps=True).projected
    False
    >>> uqmbd.extend.Capabilities(stoppable=True)
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: Capabilities: stoppable requires projected=True, because it is an option of ...
    """

    events: bool = False
    projected: bool = False
    segments: bool = False
    bounded_steps: bool = False
    stoppable: bool = False
    delegates: bool = False
    sampled_control: bool = False
    releases_gil: bool = False
    dense_output: bool = False
    linear_solvers: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in FORMER.values():
            if not isinstance(value := getattr(self, name), bool):
                raise StudyError(f"Capabilities: {name} is {value!r}; expected True or False.")
        if not isinstance(self.linear_solvers, tuple) or not all(isinstance(one, str) for one in self.linear_solvers):
            raise StudyError(
                f"Capabilities: linear_solvers is {self.linear_solvers!r}; expected a tuple of names, e.g. ('dense',)."
            )
        for option in ("stoppable", "linear_solvers"):
            if getattr(self, option) and not self.projected:
                raise StudyError(
                    f"Capabilities: {option} requires projected=True, because it is an option of integrate_projected."
                )


class Integrator(Protocol):
    """Class of an integrator, instantiated without arguments.

    A class attribute ``capabilities = uqmbd.extend.Capabilities(events=True)`` declares further capabilities; without
    this attribute the integrator handles smooth motions only.

    Attributes
    ----------
    name : str
        Name by which studies select the integrator.

    Examples
    --------
    A plugin provides Euler's method by the hook ``uqmbd_integrators``; this example calls the method directly:

    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_galerkin import Galerkin
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(6, 7), units="m/s")
    >>> mechanism = uqmbd.Mechanism("cart", uqmbd.Line())
    >>> cart = mechanism.body("cart", mass=1, velocity=speed)
    >>> mechanism.output("way", cart.position[0], units="m")
    >>> study = uqmbd.Study("rolling", mechanism, [0, 1, 2], [Galerkin(order=3)])
    >>> problem = study.problem(study.propagators[0])
    >>> class Euler:
    ...     name = "euler"
    ...     def integrate(self, ensemble, times, rtol):
    ...         state, states = ensemble.start.state, []
    ...         for time, step in zip(times, np.diff(times, append=times[-1])):
    ...             states.append(state)
    ...             state = state + step * ensemble.rates(time, state)
    ...         return uqmbd.extend.Trajectories(times, np.stack(states, axis=1), tuple(ensemble.start.messages))
    >>> integrator: uqmbd.extend.Integrator = Euler()
    >>> ensemble = problem.ensemble(np.array([[6.0], [7.0]]))
    >>> found = integrator.integrate(ensemble, problem.times, 1e-6)
    >>> ensemble.outputs(problem.times, found.states)[:, 0, -1].tolist()  # after 2 s, m
    [12.0, 14.0]
    """

    name: ClassVar[str]

    def integrate(self, ensemble: Ensemble, times: Array, rtol: float) -> Trajectories:
        """Integrate every realisation of an ensemble.

        Parameters
        ----------
        ensemble : Ensemble
            Ensemble of K realisations.
        times : array, shape (T,)
            Output times, s; the first is the initial time.
        rtol : float
            Relative tolerance of the motion.

        Returns
        -------
        Trajectories
            Trajectories. A realisation that fails has a message and does not affect the others.
        """
        ...


def capabilities_of(cls: type) -> Capabilities:
    """Return the declared capabilities of an integrator class.

    Raises `uqmbd.StudyError` if the value is not a `Capabilities`, or the class also has attributes from before 0.1.
    """
    found = getattr(cls, "capabilities", None)
    if found is None:
        found = _old_capabilities(cls)
    elif former := _old_attributes(cls):
        raise StudyError(
            f"integrator {getattr(cls, 'name', cls.__name__)!r}: the class attributes {', '.join(former)} have no "
            "effect next to `capabilities`; move them into uqmbd.extend.Capabilities(...)."
        )
    if not isinstance(found, Capabilities):
        name = getattr(cls, "name", cls.__name__)
        raise StudyError(
            f"integrator {name!r}: its attribute `capabilities` is {found!r}; expected uqmbd.extend.Capabilities(...)."
        )
    return found


def _old_attributes(cls: type) -> list[str]:
    """Return the names of class attributes for capabilities before 0.1."""
    former = [old for old in FORMER if getattr(cls, old, False) is True]
    return former + (["linear_solvers"] if getattr(cls, "linear_solvers", ()) else [])


@cache
def _old_capabilities(cls: type) -> Capabilities:
    """Return the capabilities from class attributes of versions before 0.1."""
    own = {FORMER[old]: True for old in _old_attributes(cls) if old in FORMER}
    named = getattr(cls, "linear_solvers", ())
    solvers = (named,) if isinstance(named, str) else tuple(named)
    if "projected" not in own:  # options of a missing method
        own.pop("stoppable", None)
        solvers = ()
    if not own and not solvers:
        return Capabilities()
    listed = ", ".join([*(f"{name}=True" for name in own), *([f"linear_solvers={solvers!r}"] if solvers else [])])
    warnings.warn(
        f"integrator {getattr(cls, 'name', cls.__name__)!r}: class attributes such as `events = True` are read until "
        f"0.2 only; write capabilities = uqmbd.extend.Capabilities({listed}).",
        DeprecationWarning,
        stacklevel=3,
    )
    return Capabilities(**own, linear_solvers=solvers)
