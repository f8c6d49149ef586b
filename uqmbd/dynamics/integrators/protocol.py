"""What an integrator is, and what it returns; those of the core and those of plugins alike."""

from __future__ import annotations

from typing import ClassVar, Literal, Protocol

from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.integration import Trajectories
from uqmbd.typing import Array

__all__ = ["Capability", "Integrator", "declares"]

Capability = Literal[
    "events", "projected", "segments", "paced", "watched", "delegates", "sampled", "unlocked", "recorded"
]


class Integrator(Protocol):
    """Class of an integrator, which is made without arguments.

    What more it can it declares by class attributes; what is not declared it cannot:

    ``events = True``
        It follows impacts and other events of a mechanism.
    ``projected = True``
        It integrates projected equations, as those of Galerkin, by a method
        ``integrate_projected(projected, times, rtol)``, which returns `uqmbd.ProjectedTrajectories`.
    ``segments = True``
        It follows a motion from event to event by a method ``integrate_segments(ensemble, times, rtol)``, which returns
        the `uqmbd.SegmentedMotion` of the only realisation of `ensemble`.
    ``paced = True``
        Its steps keep to what ``ensemble.pace(times, rtol)`` says: a longest step, and times at which it starts anew.
    ``watched = True``
        ``integrate_projected`` takes ``watch=``: a function that is given the coefficients (P, T, width) so far, NaN
        from the present time on, and returns true where it is to stop, or None.
    ``delegates = True``
        It may leave realisations to ``dop853`` or ``ida``, and names those in its counters.

    ``sampled = True``
        It samples controllers itself, by ``ensemble.sampling``, across events, too, if it follows these; of one that
        does not ``integrate`` is called from sample to sample, as ``integrate_projected`` is of all.

    ``unlocked = True``
        ``integrate`` works in compiled code that releases the lock of the interpreter, may run in several threads at
        once, and gives the same bits there: workers are threads then, where a mechanism has neither events nor
        controllers, which are followed in Python.  Else they are processes.

    ``recorded = True``
        ``integrate`` takes ``recording=True``, and then returns its own steps besides, in `Trajectories.path`: the
        motion between the output times, for outputs as `uqmbd.maximum`.  Others are asked for states at more times.

    ``linear_solvers``, a tuple of names, says that ``integrate_projected`` takes ``linear_solver=``.

    Attributes
    ----------
    name : str
        By which studies choose it.

    Examples
    --------
    Euler's method, which a plugin gives by the hook ``uqmbd_integrators``; here it is called by hand:

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
    ...         return uqmbd.Trajectories(times, np.stack(states, axis=1), tuple(ensemble.start.messages))
    >>> integrator: uqmbd.Integrator = Euler()
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
            K realisations.
        times : array, shape (T,)
            Output times, s; the first is the start.
        rtol : float
            Relative tolerance of the motion.

        Returns
        -------
        Trajectories
            A realisation that fails has a message, and does not disturb the others.
        """
        ...


def declares(cls: type, capability: Capability) -> bool:
    """Tell whether the class of an integrator declares a capability."""
    return getattr(cls, capability, False) is True
