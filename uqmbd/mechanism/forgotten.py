"""Components that were made and never added to their mechanism."""

from __future__ import annotations

from uqmbd.errors import Finding, Severity
from uqmbd.mechanism.mechanism import Mechanism

__all__ = ["forgotten"]


def forgotten(mechanism: Mechanism) -> tuple[Finding, ...]:
    """Name the components that touch bodies of a mechanism and were never given to its `add`.

    One that was replaced by another of its name, or refused, is none of them.

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
    Warning: PointForce 'push' of body 'stone' was made and never added, so that it has no effect. Call ...
    >>> push = mechanism.add(push)
    >>> forgotten(mechanism)
    ()
    """
    touched: dict[tuple[str, str], list[str]] = {}
    for body in mechanism.bodies.values():
        for name, kind in body.drafts.items():
            if name not in mechanism.components:
                touched.setdefault((name, kind), []).append(repr(body.name))
    return tuple(
        Finding(
            Severity.WARNING,
            f"{kind} {name!r}",
            f"{kind} {name!r} of {'body' if len(bodies) == 1 else 'bodies'} {' and '.join(bodies)} was made and never "
            "added, so that it has no effect",
            "Call mechanism.add(...) with it",
        )
        for (name, kind), bodies in sorted(touched.items())
    )
