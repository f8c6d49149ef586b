"""Modes of a flexible body as coordinates of a component: the energies of deformation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import sympy

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Vector
from uqmbd_flexible.drawn_nodes import NodeLines

__all__ = ["FlexibleModes"]


def _numbers(units: str, description: str) -> Any:
    return uqmbd.Parameter(units, description, kind="numbers", default=None)


class FlexibleModes(uqmbd.Component):
    """Modal coordinates of a flexible body in a floating frame of reference.

    The body carries the mass and inertia of the undeformed state; this component adds the energies of deformation. Make
    it by `uqmbd_flexible.flexible_body`. The parameters are the integrals of `uqmbd_flexible.ModalModel`, row by row.

    Examples
    --------
    One mode that does not couple with the motion of the body:

    >>> import uqmbd
    >>> import uqmbd_flexible
    >>> mechanism = uqmbd.Mechanism("free", uqmbd.Planar())
    >>> body = mechanism.body("body", mass=1, inertia=1)
    >>> modes = uqmbd_flexible.FlexibleModes("modes", body, modal_mass=(2,), stiffness=(8,), initial=(1,))
    >>> modes = mechanism.add(modes)
    >>> mechanism.output("q", modes.coordinate("mode 1"), units="m")
    >>> round(float(uqmbd.simulate(mechanism, [0, 1.5707963])["q"][-1]), 4)  # half a period of 2 rad/s
    -1.0
    """

    bodies = ("body",)
    spaces = (uqmbd.Planar, uqmbd.Spatial)
    drawn_by = ()
    modal_mass = uqmbd.Parameter("kg", "modal masses, row by row", kind="numbers", example=(2.0, 0.1, 0.1, 1.0))
    stiffness = uqmbd.Parameter(
        "N/m", "modal stiffness, row by row; or () with frequencies", kind="numbers", example=(50.0, 1.0, 1.0, 90.0)
    )
    frequencies = uqmbd.Parameter(
        "Hz", "natural frequencies of a diagonal stiffness", kind="numbers", default=None, minimum=0
    )
    damping = _numbers("N s/m", "modal damping, row by row")
    translation = _numbers("kg", "integrals of the shapes, row by row")
    rotation = _numbers("kg m", "integrals of position cross shape, row by row")
    gyration = _numbers("kg", "integrals of shape cross shape, row by row")
    linear = _numbers("kg m", "first-order change of inertia, row by row")
    quadratic = _numbers("kg", "second-order change of inertia, row by row")
    initial = _numbers("m", "values of the coordinates in the given pose")
    rates = _numbers("m/s", "rates of the coordinates at the start")
    largest = _numbers("m", "largest valid values of the coordinates")
    fastest = _numbers("rad/s", "largest valid angular speed of the body")
    lines: NodeLines | None = None
    """Nodes in drawings. They are no parameter, because equal bodies with other nodes share their equations."""

    if TYPE_CHECKING:

        def __init__(
            self, name: str, body: NamedFrame, modal_mass: Vector, stiffness: Vector, frequencies: Vector | None = None,
            damping: Vector = (), translation: Vector = (), rotation: Vector = (), gyration: Vector = (),
            linear: Vector = (), quadratic: Vector = (), initial: Vector = (), rates: Vector = (),
            largest: Vector = (), fastest: Vector = (),
        ) -> None: ...  # fmt: skip

    def prepare(self) -> Mapping[str, Any]:
        """Return the gravity of the space."""
        return {"gravity": tuple(self.attached["body"].space.gravity)}

    def coordinates(self) -> Mapping[str, uqmbd.extend.Coordinate]:
        """Return one coordinate for each mode."""
        count = _rows(len(self.modal_mass))
        given = {key: list(getattr(self, key) or ()) for key in ("initial", "rates", "largest", "frequencies")}
        if not len(self.stiffness) and not given["frequencies"]:
            raise uqmbd.StudyError("stiffness is empty and frequencies are missing; give one of them.")
        if given["frequencies"] and any(not x.is_zero for k, x in enumerate(self.modal_mass) if k % (count + 1)):
            raise uqmbd.StudyError("frequencies are given, but modal_mass is not diagonal; give stiffness instead.")
        for key, values in given.items():
            if values and len(values) != count:
                raise uqmbd.StudyError(f"{key} has {len(values)} numbers; expected {count}, one for each mode.")
        initial, rates, largest = given["initial"] or [0] * count, given["rates"], given["largest"]
        return {
            f"mode {k + 1}": uqmbd.extend.Coordinate(
                "m", initial[k], rates[k] if rates else None, float(largest[k]) if largest else None
            )
            for k in range(count)
        }

    def largest_speeds(self) -> Mapping[str, float]:
        """Return the angular speed of the body above which rotation stiffens the modes."""
        return {"body": float(self.fastest[0])} if self.fastest else {}

    def drawn_lines(self) -> Sequence[Sequence[Sequence[Any]]]:
        """Return the nodes as expressions in the coordinates."""
        if self.lines is None:
            return ()
        count = _rows(len(self.modal_mass))
        found: Sequence[Any] = self.lines.points([self.coordinate(f"mode {k + 1}") for k in range(count)])
        return found

    def terms(self, p: uqmbd.extend.Local) -> Iterator[Any]:
        """Yield the terms of deformation: kinetic energy, weight, elastic energy and damping forces."""
        m = _rows(len(p.modal_mass))
        q, dq = (sympy.Matrix([p.coordinate(f"mode {k + 1}", order) for k in range(m)]) for order in (0, 1))
        d, r = p.space.dimension, 1 if p.space.dimension == 2 else 3
        w = p.body.body_angular_velocity
        energy = _form(p.modal_mass, dq, dq) / 2
        if p.translation is not None:
            moved = p.body.rotation * _matrix(p.translation, d, m) * q
            energy += p.body.velocity.dot(p.rate_of(moved))
            yield uqmbd.Potential(-sympy.Matrix(p.gravity).dot(moved))
        momentum = sympy.zeros(r, 1)
        if p.rotation is not None:
            momentum += _matrix(p.rotation, r, m) * dq
        if p.gyration is not None:
            momentum += sympy.Matrix([_form(p.gyration[a * m * m : (a + 1) * m * m], q, dq) for a in range(r)])
        energy += w.dot(momentum)
        change = sympy.zeros(r, r)
        if p.linear is not None:
            half = sympy.Matrix(r, r, lambda a, b: sum(p.linear[(a * r + b) * m + k] * q[k] for k in range(m)))
            change += half + half.T
        if p.quadratic is not None:
            size = m * m
            change += sympy.Matrix(
                r, r, lambda a, b: _form(p.quadratic[(a * r + b) * size : (a * r + b + 1) * size], q, q)
            )
        energy += (w.T * change * w)[0] / 2
        yield uqmbd.Kinetic(energy)
        if len(p.stiffness):
            yield uqmbd.Potential(_form(p.stiffness, q, q) / 2)
        if p.frequencies is not None:
            heavy = [p.modal_mass[k * (m + 1)] * (2 * sympy.pi * p.frequencies[k]) ** 2 for k in range(m)]
            yield uqmbd.Potential(sum(stiff * x**2 for stiff, x in zip(heavy, q, strict=True)) / 2)
        if p.damping is not None:
            yield uqmbd.VirtualWork(-_matrix(p.damping, m, m) * dq, dq)


def _rows(entries: int) -> int:
    """Return the number of rows of a square matrix from its number of entries."""
    side = round(entries**0.5)
    if side * side != entries or not side:
        raise uqmbd.StudyError(f"modal_mass has {entries} entries; expected those of a square matrix, row by row.")
    return int(side)


def _matrix(entries: Any, rows: int, columns: int) -> sympy.Matrix:
    if len(entries) != rows * columns:
        raise uqmbd.StudyError(f"a matrix has {len(entries)} entries; expected {rows} times {columns}, row by row.")
    return sympy.Matrix(rows, columns, list(entries))


def _form(entries: Any, left: sympy.Matrix, right: sympy.Matrix) -> sympy.Expr:
    """Return the bilinear form of a square matrix, row by row."""
    return (left.T * _matrix(list(entries), len(left), len(right)) * right)[0]
