r"""Physically impossible inertia tensors: rejected, used as stated, or replaced by the nearest possible tensor.

A tensor J about the centre of mass belongs to a body if its matrix of second moments of mass, ``S = (tr(J) / 2) I -
J``, is positive semi-definite. S is the integral of ``x x^T`` over the mass. In principal axes, this condition is the
triangle inequality: no moment exceeds the sum of the others. The nearest possible tensor has the nearest S in the
Frobenius norm, with the same mass and centre of mass. This S is the original one with negative eigenvalues set to zero:
the projection onto the cone of positive semi-definite matrices (N. J. Higham, Linear Algebra and its Applications 103,
1988, 103-118, theorem 2.1).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import uqmbd
from uqmbd_models.fusing import Fused
from uqmbd_models.tree import Array, Inertial, Link, Tree

__all__ = ["Settled", "excess", "nearest", "settle"]

ROUNDING = 1e-12
"""Largest excess, relative to the largest moment of the body, that is a rounding error of this module."""

FILE_ROUNDING = 1e-14
"""Largest excess, relative to the largest moment of the model, that is a rounding error of the file."""


@dataclass(frozen=True)
class Settled:
    """Model with physically possible bodies."""

    tree: Tree
    # by index of the link: the excess of a stated tensor over a possible tensor, as a moment of inertia (kg m^2) about
    # an axis of the link, and this axis
    rotors: dict[int, tuple[float, Array]]
    rows: list[uqmbd.extend.Omission]  # changes of the model


def excess(inertia: Array) -> float:
    """Return the excess of the largest principal moment over the sum of the others, kg m^2.

    A positive excess is physically impossible. A negative moment also counts as an excess.

    >>> [round(excess(np.diag(x)), 3) for x in ((1, 2, 4), (1, 2, 3), (1, 1, 1), (-1, 2, 2))]
    [1.0, 0.0, -1.0, 1.0]
    """
    a, b, c = np.linalg.eigvalsh(inertia)
    return float(c - a - b)


def nearest(inertia: Array) -> Array:
    """Return the possible inertia tensor nearest in the Frobenius norm of the second moments.

    >>> nearest(np.diag([1.0, 2.0, 4.0])).round(3).tolist()
    [[1.5, 0.0, 0.0], [0.0, 2.5, 0.0], [0.0, 0.0, 4.0]]
    """
    values, vectors = np.linalg.eigh(np.trace(inertia) / 2 * np.eye(3) - inertia)
    moments = (vectors * np.maximum(values, 0.0)) @ vectors.T
    found: Array = np.trace(moments) * np.eye(3) - moments
    return found


def settle(tree: Tree, how: str, fused: tuple[Fused, ...], before: Tree) -> Settled:
    """Replace or divide physically impossible tensors.

    `tree`: model; `how`: treatment, with "refuse" left to `uqmbd.Mechanism.body`, which raises the error later;
    `fused`: links that were merged into links of the model; `before`: the model before merging.
    """
    tensors = {k: (link.inertial.inertia + link.inertial.inertia.T) / 2 for k, link in enumerate(tree.links) if k}
    scale = max((float(np.abs(np.linalg.eigvalsh(x)).max()) for x in tensors.values()), default=0.0)
    links = list(tree.links)
    rotors: dict[int, tuple[float, Array]] = {}
    rounded: list[str] = []
    repaired: list[str] = []
    stated: list[str] = []
    for k, tensor in tensors.items():
        link = links[k]
        more, moments = excess(tensor), np.linalg.eigvalsh(tensor)
        if more <= ROUNDING * np.abs(moments).max():
            continue
        text = f"{link.name} (largest moment {moments[2]:.4g}, the others {moments[0]:.4g} and {moments[1]:.4g} kg m^2)"
        if how == "repair" or more <= FILE_ROUNDING * scale:
            (repaired if more > FILE_ROUNDING * scale else rounded).append(text)
            links[k] = _with_inertia(link, nearest(tensor))
        elif how == "as stated":
            rotors[k], possible = _divided(tree.source, link, tensor, more)
            links[k] = _with_inertia(link, possible)
            stated.append(text)
    merged = {part.name for part in fused if part.link}
    hidden = [
        link.name
        for link in before.links
        if link.name in merged
        and excess(link.inertial.inertia) > max(ROUNDING * abs(link.inertial.inertia).max(), FILE_ROUNDING * scale)
    ]
    rows = [
        (
            "moments of inertia with rounding errors",
            rounded,
            "they are replaced by the nearest physically possible ones",
        ),
        (
            "physically impossible inertia",
            repaired,
            "repaired: it is replaced by the physically possible inertia with the nearest second moments of mass",
        ),
        (
            "physically impossible inertia",
            stated,
            "as stated: the body has the possible part, and a RotorInertia, NAME_excess, has the rest",
        ),
        (
            "physically impossible inertia of merged links",
            hidden,
            "as stated: it is included in the inertia of the merged body",
        ),
    ]
    found = [uqmbd.extend.Omission(what, tuple(names), why) for what, names, why in rows if names]
    return Settled(replace(tree, links=tuple(links)), rotors, found)


def _with_inertia(link: Link, inertia: Array) -> Link:
    """Return a link with another inertia tensor."""
    return replace(link, inertial=Inertial(link.inertial.mass, link.inertial.com, inertia))


def _divided(source: str, link: Link, tensor: Array, more: float) -> tuple[tuple[float, Array], Array]:
    """Divide a tensor into a possible one, and a moment about its axis of largest inertia."""
    moments, axes = np.linalg.eigh(tensor)
    if moments[0] < -ROUNDING * np.abs(moments).max():
        listed = ", ".join(f"{x:.4g}" for x in moments)
        line = f"line {link.line}: " if link.line else ""
        raise uqmbd.StudyError(
            f"{source}: {line}link {link.name!r}: a principal moment of inertia is negative ({listed} kg m^2), so that "
            "the kinetic energy could be negative; expected moments that are not negative. Correct the "
            'inertia, or use inertia="repair".'
        )
    axis = axes[:, 2]
    return (more, axis), tensor - more * np.outer(axis, axis)
