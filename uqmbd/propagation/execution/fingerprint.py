"""What the numbers of a chunk depend on besides its inputs, as a hash."""

from __future__ import annotations

import hashlib

from uqmbd.dynamics import Model
from uqmbd.randomness import JointInput
from uqmbd.version import __version__

__all__ = ["fingerprint"]


def fingerprint(model: Model, inputs: JointInput, asked: tuple[float, str], times: tuple[str | bytes, ...]) -> bytes:
    """Hash equations and outputs as symbols, options, and the version.

    Parameters
    ----------
    model : Model
    inputs : JointInput
    asked : (float, str)
        Relative tolerance and integrator.
    times : tuple
        Output times, and what is wanted at them.
    """
    options = (*asked, model.start_at, model.max_step, model.added_breaks)
    parts = (model.digest, inputs.names, *options, *times, __version__)
    turns = model.outputs.turns
    # angles start near those at the means
    angles = (turns.tobytes(), inputs.means.tobytes()) if turns.any() else ()
    return hashlib.sha256(repr((*parts, *angles)).encode()).digest()
