"""Components that were made and never added to their mechanism."""

from __future__ import annotations

from uqmbd.mechanism.body import Body
from uqmbd.mechanism.component import made_components
from uqmbd.mechanism.mechanism import Mechanism

__all__ = ["forgotten"]


def forgotten(mechanism: Mechanism) -> tuple[str, ...]:
    """Name the components that touch bodies of a mechanism and were never given to its `add`, a sentence each.

    Components are known as long as somebody holds them: one that was replaced by another of its name, or thrown away,
    as those of a notebook's cell that is run again, is none of them.

    Parameters
    ----------
    mechanism : Mechanism
        As it is about to be simulated.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_springs import PointForce
    >>> mechanism = uqmbd.Mechanism("pushed", uqmbd.Translational())
    >>> stone = mechanism.body("stone", mass=1)
    >>> push = PointForce("push", stone, (0, 0), (1, 0))
    >>> print(*forgotten(mechanism))
    PointForce 'push' of body 'stone' was made and never added, so that it has no effect; call ...
    >>> push = mechanism.add(push)
    >>> forgotten(mechanism)
    ()
    """
    found = []
    for component in made_components():
        if component.offered or component.name in mechanism.components:
            continue
        touched = [body for body in component.attached.values() if isinstance(body, Body)]
        if not touched or any(mechanism.bodies.get(body.name) is not body for body in touched):
            continue
        whose = " and ".join(repr(body.name) for body in touched)
        found.append(
            f"{type(component).__name__} {component.name!r} of {'body' if len(touched) == 1 else 'bodies'} {whose} was "
            "made and never added, so that it has no effect; call mechanism.add(...) with it"
        )
    return tuple(sorted(found))
