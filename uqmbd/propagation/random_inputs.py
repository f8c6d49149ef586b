"""Mechanisms in which nothing is random."""

from __future__ import annotations

from uqmbd.randomness import JointInput

__all__ = ["nothing_random"]


def nothing_random(inputs: JointInput, mechanism: str) -> str | None:
    """Return why a method that needs random inputs cannot do a study, in one sentence; None: it has some.

    Parameters
    ----------
    inputs : JointInput
        Of the mechanism.
    mechanism : str
        Its name.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> print(uqmbd.extend.nothing_random(mechanism.inputs, mechanism.name))
    nothing in mechanism 'stone' is random; declare a uqmbd.RandomVariable, or use uqmbd.simulate
    """
    if len(inputs):
        return None
    return f"nothing in mechanism {mechanism!r} is random; declare a uqmbd.RandomVariable, or use uqmbd.simulate"
