"""Components that were made and never added to their mechanism."""

from __future__ import annotations

from uqmbd.errors import Finding, Severity
from uqmbd.mechanism.mechanism import Mechanism

__all__ = ["forgotten"]


def forgotten(mechanism: Mechanism) -> tuple[Finding, ...]:
    """Return findings on the components that touch bodies of a mechanism and were never passed to its `add`.

    A component that was replaced by another of its name, or rejected, does not count.
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
