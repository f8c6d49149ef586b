"""What keeps a method from a study, found out before anything is computed or allocated."""

from __future__ import annotations

from uqmbd.errors import StudyError
from uqmbd.propagation.methods.estimate import readable
from uqmbd.propagation.methods.propagator import Propagator
from uqmbd.propagation.methods.studied import Studied

__all__ = ["obstacle_of"]


def obstacle_of(propagator: Propagator, study: Studied) -> str | None:
    """Return in one sentence why a method cannot do a study, or None; estimate its memory before asking it."""
    if not len(study.mechanism.inputs):
        return propagator.obstacle(study)
    try:
        found = propagator.estimate(study)
    except StudyError as error:
        return str(error).removeprefix(f"{propagator.node_name}: ")
    if found is not None and not found.at_most and (there := _memory()) < found.memory:
        about = f" for {found.detail}" if found.detail else ""
        return (
            f"it would take about {readable(found.memory)} of memory{about}, and this machine has {readable(there)}; "
            "take fewer samples or nodes, a lower order, fewer outputs or fewer output times"
        )
    return propagator.obstacle(study)


def _memory() -> int:
    """Physical memory of this machine, bytes."""
    import psutil

    return int(psutil.virtual_memory().total)
