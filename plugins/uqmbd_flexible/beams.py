"""Uniform beams by modes, for small deflections."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import sympy

import uqmbd
from uqmbd.extend import numbers, typechecked
from uqmbd.typing import Array
from uqmbd_flexible.integrals import NodalLayout, shape_integrals
from uqmbd_flexible.modal_model import ModalModel, NodeShape
from uqmbd_flexible.reduction import basis_of, diagonal_modes

__all__ = ["Beam"]

STATIONS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Places of recovered strains, as fractions of the length."""


@typechecked
def Beam(
    length: float,
    area: float,
    second_moment: Any,
    youngs_modulus: Any,
    density: float,
    modes: Annotated[int, uqmbd.extend.Bounds(0, 1000)] = 4,
    elements: Annotated[int, uqmbd.extend.Bounds(2, 1000)] = 20,
    poisson: float = 0.3,
    shear_factor: float | None = 5 / 6,
    torsion: float | None = None,
    depth: float | None = None,
    width: float | None = None,
    highest: float | None = None,
) -> ModalModel:
    """Uniform beam along the x axis of its frame, from the origin, with joints at nodes ``"start"`` and ``"end"``.

    The beam follows Timoshenko's theory with rotary inertia. Finite elements that are exact for static loads at their
    ends are reduced by constraint modes and fixed-interface modes, as in `craig_bampton`. Deflections are small:
    geometric stiffening, for example by a fast rotation, and the shortening by bending are not included.

    Parameters
    ----------
    length : float
        Length, m.
    area : float
        Area of the section, m^2.
    second_moment : float, or two floats
        Second moment of area, m^4, for bending in the plane. In space: ``(I_y, I_z)``, about the y and the z axis.
    youngs_modulus : number or expression
        Modulus of elasticity, Pa; may contain random variables.
    density : float
        Density, kg/m^3.
    modes : int
        Number of fixed-interface modes in addition to the static deformations of the two ends.
    elements : int
        Number of finite elements.
    poisson : float
        Poisson's ratio, for shear and torsion.
    shear_factor : float, or None
        Shear correction factor; None: no shear deformation.
    torsion : float, optional
        Torsion constant, m^4; required in space.
    depth, width : float, optional
        Extent of the section along y, and along z, m, for recovered strains at the surface.
    highest : float, optional
        Highest frequency of retained modes, Hz. Default: all modes.

    Returns
    -------
    ModalModel
        Modes of the free beam. Its nodes are ``"start"``, ``"end"`` and numbers from 0. It recovers ``"axial strain at
        s"``, with `depth` ``"bending strain at s"``, and in space with `width` ``"bending strain in z at s"``. The
        fractions s of the length are 0, 0.25, 0.5, 0.75 and 1.

    Raises
    ------
    uqmbd.StudyError
        If a number is not positive, or the arguments of a spatial beam are incomplete.

    Examples
    --------
    The lowest frequency of a free beam:

    >>> import numpy as np
    >>> import uqmbd_flexible
    >>> beam = uqmbd_flexible.Beam(length=1, area=1e-4, second_moment=1e-10, youngs_modulus=2e11, density=7800)
    >>> exact = 4.7300407449**2 / (2 * np.pi) * np.sqrt(2e11 * 1e-10 / 7800e-4)
    >>> round(float(beam.frequencies[0] / exact), 3)
    1.0
    """
    moments = np.atleast_1d(np.asarray(second_moment, dtype=float))
    given = {"length": length, "area": area, "density": density, "torsion": torsion, "depth": depth, "width": width}
    positive = {k: v for k, v in given.items() if v is not None}
    positive |= {f"second_moment[{k}]": float(v) for k, v in enumerate(moments)}
    for name, value in positive.items():
        if not value > 0:
            raise uqmbd.StudyError(f"Beam: {name} is {value:g}; expected a positive number.")
    if moments.shape not in ((1,), (2,)):
        raise uqmbd.StudyError(
            f"Beam: second_moment has {moments.size} numbers; expected one in the plane, or two in space."
        )
    modulus = numbers("Beam", "youngs_modulus", youngs_modulus, 1, "Pa", scalar=True)[0]
    spatial = len(moments) == 2
    if spatial and torsion is None:
        raise uqmbd.StudyError("Beam: torsion is missing; a spatial beam needs its torsion constant, m^4.")
    section = _BeamElement(length / elements, area, moments, density, poisson, shear_factor, torsion or 0.0)
    count, width_of_node = elements + 1, 6 if spatial else 3
    size = count * width_of_node
    stiffness, points = np.zeros((size, size)), []
    for k in range(elements):
        part = slice(k * width_of_node, (k + 2) * width_of_node)
        stiffness[part, part] += section.stiffness()
        for place, weight, rows in section.points():
            spread = np.zeros((rows.shape[0], size))
            spread[:, part] = rows
            points.append((k * section.length + place, weight, spread))
    d = 3 if spatial else 2
    places = np.zeros((len(points), d))
    places[:, 0] = [x for x, _, _ in points]
    weights = np.concatenate([x for _, x, _ in points])
    fieldwise = np.concatenate([x for _, _, x in points])  # matrix that maps degrees of freedom to motions of points
    mass = fieldwise.T @ (weights[:, None] * fieldwise)
    nodes = np.zeros((count, d))
    nodes[:, 0] = np.linspace(0, length, count)
    layout = NodalLayout(nodes, turns=True)
    ends = np.concatenate([np.arange(width_of_node), size - width_of_node + np.arange(width_of_node)])
    basis = basis_of("Beam", mass, stiffness, ends, modes)
    unit = 1.0 if modulus.free_symbols else float(modulus)
    limit = None if highest is None else highest / np.sqrt(unit)
    shapes, values = diagonal_modes("Beam", layout, mass, stiffness, basis, highest=limit)
    found = dict(shape_integrals(NodalLayout(places, turns=True), lambda x: weights[:, None] * x, fieldwise @ shapes))
    modal_mass = np.diag(np.diag(found["modal_mass"]))
    moved, turned = layout.parts(shapes)
    assert turned is not None
    known = [NodeShape(place, moved[k], turned[k]) for k, place in enumerate(nodes)]
    strains = _strains(shapes, section.length, elements, spatial=spatial, depth=depth, width=width)
    return ModalModel(
        **{**found, "modal_mass": modal_mass, "inertia": (found["inertia"] + found["inertia"].T) / 2},
        stiffness=sympy.diag(*(modulus * float(m * x) for m, x in zip(np.diag(modal_mass), values, strict=True))),
        nodes={**dict(enumerate(known)), "start": known[0], "end": known[-1]},
        lines=(range(count),),
        length=length,
        stresses=strains,
        stress_units="1",
    )


@dataclass(frozen=True)
class _BeamElement:
    """One element of a beam, with a modulus of elasticity of 1 Pa."""

    length: float
    area: float
    moments: Array  # about z in the plane; about y and z in space
    density: float
    poisson: float
    shear_factor: float | None
    torsion: float

    def _shear_ratio(self, moment: float) -> float:
        """Return the ratio of shear flexibility to bending flexibility."""
        if self.shear_factor is None:
            return 0.0
        return 24 * (1 + self.poisson) * moment / (self.shear_factor * self.area * self.length**2)

    def stiffness(self) -> Array:
        """Return the stiffness matrix, planar (6, 6) or spatial (12, 12)."""
        spatial = len(self.moments) == 2
        width = 6 if spatial else 3
        found = np.zeros((2 * width, 2 * width))
        axial = self.area / self.length * np.array([[1, -1], [-1, 1]])
        found[np.ix_([0, width], [0, width])] += axial
        if spatial:
            twist = self.torsion / (2 * (1 + self.poisson) * self.length) * np.array([[1, -1], [-1, 1]])
            found[np.ix_([3, 9], [3, 9])] += twist
        for rows, signs, moment in self._bending():
            bent = self._bending_stiffness(moment) * np.outer(signs, signs)
            found[np.ix_(rows, rows)] += bent
        return found

    def _bending(self) -> list[tuple[list[int], Array, float]]:
        """Return degrees of freedom (deflection, slope) of both ends, their signs, and the second moment, by plane."""
        one = np.ones(4)
        if len(self.moments) == 1:
            return [([1, 2, 4, 5], one, float(self.moments[0]))]
        about_y, about_z = map(float, self.moments)
        return [([1, 5, 7, 11], one, about_z), ([2, 4, 8, 10], np.array([1, -1, 1, -1]), about_y)]

    def _bending_stiffness(self, moment: float) -> Array:
        x, soft = self.length, self._shear_ratio(moment)
        near, far = (4 + soft) * x**2, (2 - soft) * x**2
        table = [
            [12, 6 * x, -12, 6 * x],
            [6 * x, near, -6 * x, far],
            [-12, -6 * x, 12, -6 * x],
            [6 * x, far, -6 * x, near],
        ]
        return np.array(table) * moment / ((1 + soft) * x**3)

    def points(self) -> list[tuple[float, Array, Array]]:
        """Return places, masses and motions of quadrature points, whose sum is the exact kinetic energy."""
        spatial = len(self.moments) == 2
        width, d = (6, 3) if spatial else (3, 2)
        found = []
        for node, weight in zip(*np.polynomial.legendre.leggauss(4), strict=True):
            s = (1 + float(node)) / 2
            share = float(weight) / 2 * self.length * self.density
            rows = np.zeros((width, 2 * width))
            rows[0, [0, width]] = 1 - s, s
            if spatial:
                rows[3, [3, 9]] = 1 - s, s
            for number, (places, signs, moment) in enumerate(self._bending()):
                across, slope = self._shapes(s, moment)
                rows[1 + number, places] = across * signs
                rows[(2 if not spatial else 5 - number), places] = slope * signs * (1 if number == 0 else -1)
            turning = [float(self.moments.sum()), *self.moments] if spatial else [float(self.moments[0])]
            weights = np.array([self.area] * d + turning) * share
            found.append((s * self.length, weights, rows))
        return found

    def _shapes(self, s: float, moment: float) -> tuple[Array, Array]:
        """Return deflection and rotation of the section for deflections and slopes of the ends."""
        x, soft = self.length, self._shear_ratio(moment)
        cubic = 2 * s**3 - 3 * s**2 - soft * s
        across = [
            cubic + 1 + soft,
            x * (s**3 - (2 + soft / 2) * s**2 + (1 + soft / 2) * s),
            -cubic,
            x * (s**3 - (1 - soft / 2) * s**2 - soft / 2 * s),
        ]
        turned = 6 / x * (s**2 - s)
        slope = [turned, 3 * s**2 - (4 + soft) * s + 1 + soft, -turned, 3 * s**2 - (2 - soft) * s]
        return np.array(across) / (1 + soft), np.array(slope) / (1 + soft)


def _strains(
    shapes: Array, length: float, elements: int, *, spatial: bool, depth: float | None, width: float | None
) -> dict[str, Array]:
    """Return rows of axial strain, and of bending strain at the surface, at `STATIONS`.

    The strains are interpolated between the middles of the elements.
    """
    size = 6 if spatial else 3
    table = shapes.reshape(elements + 1, size, -1)
    rates = np.diff(table, axis=0) / length  # constant axial strain and mean curvature of each element
    found: dict[str, Array] = {}
    middles = (np.arange(elements) + 0.5) / elements
    wanted: list[tuple[str, int, float]] = [("axial strain", 0, 1.0)]
    if depth is not None:
        wanted.append(("bending strain", 5 if spatial else 2, -depth / 2))
    if width is not None and spatial:
        wanted.append(("bending strain in z", 4, width / 2))
    for name, row, factor in wanted:
        for station in STATIONS:
            values = rates[:, row]
            k = int(np.clip(np.searchsorted(middles, station) - 1, 0, elements - 2))
            part = (station - middles[k]) / (middles[k + 1] - middles[k])
            found[f"{name} at {station:g}"] = factor * ((1 - part) * values[k] + part * values[k + 1])
    return found
