"""Lines of nodes along which drawings show a flexible body with its deformation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy

from uqmbd.typing import Array
from uqmbd_flexible.modal_model import ModalModel, NodeShape

__all__ = ["NodeLines"]

MOST_NODES = 200
"""Largest number of drawn nodes of a body; of more nodes, an even selection is drawn."""

NEGLIGIBLE = 1e-12
"""Displacements below this multiple of the largest displacement are rounding errors, and become zero."""


@dataclass(frozen=True, eq=False, repr=False)
class NodeLines:
    """Nodes of each drawn line; a line of one node is a dot."""

    places: tuple[Array, ...]  # of each line: (node, d), m
    shapes: tuple[Array, ...]  # of each line: displacement for a unit of each coordinate, (node, d, mode)

    @classmethod
    def of(cls, model: ModalModel) -> NodeLines | None:
        """Return the lines of a model, or its nodes as dots; None without nodes."""
        if model.lines:
            lines = [_selected([model.nodes[name] for name in line], len(model.lines)) for line in model.lines]
        else:
            nodes = list({id(x): x for x in model.nodes.values()}.values())
            lines = [[node] for node in _selected(nodes, 1)] if nodes else []
        if not lines:
            return None
        shapes = [np.array([x.translation for x in line]) for line in lines]
        limit = NEGLIGIBLE * max(float(np.abs(x).max(initial=0.0)) for x in shapes)
        return cls(
            tuple(np.array([x.position for x in line]) for line in lines),
            tuple(np.where(np.abs(x) <= limit, 0.0, x) for x in shapes),
        )

    def points(self, coordinates: Sequence[sympy.Expr]) -> list[list[list[Any]]]:
        """Return the points of each line, as expressions in the modal coordinates."""

        def entry(place: float, shape: Sequence[float]) -> sympy.Expr:
            return sympy.Add(place, *(x * q for x, q in zip(shape, coordinates, strict=True) if x))

        return [
            [
                [entry(*axis) for axis in zip(place, shape, strict=True)]
                for place, shape in zip(places.tolist(), shapes.tolist(), strict=True)
            ]
            for places, shapes in zip(self.places, self.shapes, strict=True)
        ]

    def __repr__(self) -> str:
        return f"<{len(self.places)} lines with {sum(map(len, self.places))} nodes>"


def _selected(nodes: Sequence[NodeShape], lines: int) -> list[NodeShape]:
    """Return an even selection of the nodes of one of several lines, with the first and the last."""
    most = max(MOST_NODES // lines, 2)
    if len(nodes) <= most:
        return list(nodes)
    return [nodes[k] for k in np.linspace(0, len(nodes) - 1, most).round().astype(int).tolist()]
