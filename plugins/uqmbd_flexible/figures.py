"""Figures of mode shapes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

import uqmbd
from uqmbd.extend import typechecked
from uqmbd_flexible.modal_model import ModalModel

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["mode_shapes"]

SHARE = 0.15
"""Largest drawn displacement, relative to the length of the body."""


@typechecked
def mode_shapes(model: ModalModel, modes: Annotated[int, uqmbd.extend.Bounds(1, 24)] = 6) -> Figure:
    """Draw the nodes of a flexible body in its lowest modes; the title of each mode states frequency and scale.

    Parameters
    ----------
    model : ModalModel
        Model with nodes.
    modes : int
        Largest number of modes.

    Returns
    -------
    matplotlib.figure.Figure
        Undeformed nodes in grey and displaced nodes in blue. A line connects each node of a beam with the next node.
        The scale is the factor of the displacement for a coordinate of 1 m. In space, the view is along the axis with
        the smallest extent of the displaced body.

    Raises
    ------
    uqmbd.StudyError
        If the model has no nodes.

    Examples
    --------
    >>> import uqmbd_flexible
    >>> beam = uqmbd_flexible.Beam(length=2, area=1e-4, second_moment=1e-9, youngs_modulus=2e11, density=7800)
    >>> figure = uqmbd_flexible.mode_shapes(beam, modes=2)
    >>> [axes.get_title() for axes in figure.axes]
    ['mode 1: 14.3 Hz, scale 0.3', 'mode 2: 39.3 Hz, scale 0.3']
    """
    from matplotlib.figure import Figure

    shapes = list({id(x): x for x in model.nodes.values()}.values())
    if not shapes:
        raise uqmbd.StudyError(
            "mode_shapes: the model has no nodes to draw. Give the nodes to the model: ModalModel(..., nodes={...})."
        )
    places = np.array([x.position for x in shapes])
    moved = np.array([x.translation for x in shapes])
    count = min(modes, model.modes)
    figure = Figure(figsize=(6.4, 1.6 * count), layout="constrained")
    frequencies = _frequencies(model)
    joined = all(x.rotation is not None for x in shapes)
    for k in range(count):
        scale = SHARE * model.length / max(float(np.linalg.norm(moved[:, :, k], axis=1).max()), 1e-300)
        drawn = places + scale * moved[:, :, k]
        seen = np.sort(np.argsort(-np.ptp(np.concatenate([places, drawn]), axis=0), kind="stable")[:2])
        axes: Any = figure.add_subplot(count, 1, k + 1)
        for points, colour in ((places, "0.6"), (drawn, "C0")):
            axes.plot(points[:, seen[0]], points[:, seen[1]], "-o" if joined else "o", color=colour, markersize=3)
        axes.set_title(f"mode {k + 1}: {frequencies[k]:.3g} Hz, scale {scale:.3g}")
        axes.set_xlabel(f"{'xyz'[seen[0]]} (m)")
        axes.set_ylabel(f"{'xyz'[seen[1]]} (m)")
        axes.set_aspect("equal", adjustable="datalim")
    return figure


def _frequencies(model: ModalModel) -> Any:
    """Return the frequency of each coordinate alone in Hz, at the means of random variables."""
    constant = model.at_means()
    stiffness = np.array(constant.stiffness.tolist(), dtype=float)
    return np.sqrt(np.maximum(np.diag(stiffness) / np.diag(model.modal_mass), 0.0)) / (2 * np.pi)
