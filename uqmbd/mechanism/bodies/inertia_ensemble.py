"""Random inertia that a body can have: maximum entropy on the cone of physical inertias (Batou and Soize 2012)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.bodies.inertia import inertia_entries, mass_number
from uqmbd.mechanism.expressions import as_symbolic, flatten, numbers, shown
from uqmbd.mechanism.geometry import Planar, Spatial
from uqmbd.names import check_name, checked
from uqmbd.randomness import random_factor, random_root

__all__ = ["MassProperties", "random_body_inertia", "random_inertia"]

ROUNDING = 1e-12
"""A second moment of this size, relative to the largest, is zero."""

VARYING = {
    n: f"an inertia {of}" for n, of in enumerate(("that varies in one number", "of a flat body", "of a body"), 1)
}


@typechecked
@checked
def random_inertia(mean: Any, dispersion: float, name: str = "inertia") -> Any:
    r"""Make the inertia of a body random, so that every value is that of a distribution of mass.

    A tensor of inertia is that of a body only if no principal moment is more than the sum of the other two: if the
    second moments of mass :math:`S = \tfrac{1}{2} \operatorname{tr}(J) I - J` are positive semi-definite.  This is the
    distribution of largest entropy among those with a given mean, a given dispersion, and an inverse of finite
    variance: :math:`S = F G F^T`. Here :math:`F F^T` are the mean second moments, and :math:`G` is a random matrix of
    mean :math:`I`. It is a Wishart matrix of any real number of degrees of freedom.

    Parameters
    ----------
    mean : float or array_like
        Mean inertia about the centre of mass, kg m^2, as a body takes it: one number for a planar body; the diagonal,
        six entries ``(Jxx, Jyy, Jzz, Jxy, Jxz, Jyz)`` or a 3 x 3 matrix for a spatial one.  Plain numbers.
    dispersion : float
        :math:`\delta = \sqrt{E \lVert G - I \rVert^2 / \lVert I \rVert^2}`, in Frobenius norms.  In the plane it is the
        coefficient of variation of the moment of inertia. In space the second moments have the covariance
        :math:`\operatorname{cov}(S_{ij}, S_{kl}) = \frac{\delta^2}{4} (S_{ik} S_{jl} + S_{il} S_{jk})` (a third for a
        flat body). So each moment of inertia of a ball has a coefficient of variation of :math:`\delta / 2`.
    name : str
        Beginning of the names of the random variables; every body needs its own.

    Returns
    -------
    sympy.Expr or tuple of sympy.Expr
        What ``mechanism.body(inertia=...)`` takes: one expression, or the six entries of the tensor, in independent
        random variables: quadratic polynomials in normal ones (``NAME.12``) and chi distributed ones (``NAME.11``).
        What has no extent stays so: a flat body has three variables, a rod one.

    Raises
    ------
    uqmbd.StudyError
        If `mean` is no inertia of a body, is random itself or zero, or the inverse has no finite variance, so that
        accelerations have none: `dispersion` has to be below 0.816 in space (a flat body 0.774, a rod and in the plane
        0.707).

    See Also
    --------
    uqmbd.random_body_inertia : mass and centre of mass are random, too.
    uqmbd.Mechanism.randomise : factors for the second moments along the principal axes, whose directions stay.

    Notes
    -----
    A. Batou and C. Soize, "Rigid multibody system dynamics with uncertain rigid bodies", Multibody System Dynamics 27
    (2012) 285-319; C. Soize, "A nonparametric model of random uncertainties for reduced matrix models in structural
    dynamics", Probabilistic Engineering Mechanics 15 (2000) 277-294.  There, mass, centre of mass and second moments
    over mass are independent; where the mass is random as well, multiply all entries by mass over mean mass.

    Single simulations use the means of the random variables. There the tensor is smaller than its mean by about
    :math:`\delta^2 / 4`, since it is quadratic in them.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("top", uqmbd.Spatial())
    >>> body = mechanism.body("top", mass=1, inertia=uqmbd.random_inertia((0.02, 0.02, 0.03), 0.1, "top.inertia"))
    >>> mechanism.output("moment", body.inertia[2])
    >>> mechanism.inputs.names
    ('top.inertia.11', 'top.inertia.12', 'top.inertia.13', 'top.inertia.22', 'top.inertia.23', 'top.inertia.33')
    """
    check_name(name, "random_inertia, name")
    where = f"random_inertia({name!r})"
    planar = not isinstance(mean, (str, list, tuple)) and np.ndim(mean) == 0
    given = _numbers(where, "mean", mean, inertia_entries(where, Planar() if planar else Spatial(), mean))
    if planar:
        if given[0] <= 0:
            raise StudyError(f"{where}: the mean is {given[0]:g} kg m^2; expected more than 0.")
        delta = _dispersion(where, dispersion, 1, VARYING[1])
        return given[0] * random_factor(name, delta)
    if not any(given):
        raise StudyError(f"{where}: the mean is zero, that of a point mass; nothing of it can vary.")
    root = _root(where, given)
    rank = root.shape[1]
    delta = _dispersion(where, dispersion, rank, VARYING[rank])
    if rank == 1:
        one = random_factor(name, delta)
        return tuple(x * one if x else sympy.S.Zero for x in given)
    factor = sympy.Matrix(root) * random_root(name, delta, rank).T
    return _tensor(factor * factor.T)


@typechecked
@dataclass(frozen=True)
class MassProperties:
    """Mass, centre of mass and inertia of a body, as `Mechanism.body` takes them.

    Attributes
    ----------
    mass : sympy.Expr
        kg.
    centre : tuple of sympy.Expr
        Coordinates of the centre of mass in the frame in which its mean was given, m.
    inertia : sympy.Expr or tuple of sympy.Expr
        About the centre of mass, parallel to that frame, kg m^2: one number in the plane, six entries in space.

    Examples
    --------
    As `uqmbd.random_body_inertia` gives them; without a dispersion they are the mean:

    >>> import uqmbd
    >>> disc = uqmbd.extend.MassProperties(mass=2.0, centre=(0.1, 0.0), inertia=0.5)
    >>> mechanism = uqmbd.Mechanism("disc", uqmbd.Planar())
    >>> body = mechanism.body("disc", mass=disc.mass, inertia=disc.inertia, com=disc.centre)
    >>> body.mass, list(body.com)
    (2.00000000000000, [0.100000000000000, 0.0])
    """

    mass: sympy.Expr
    centre: tuple[sympy.Expr, ...]
    inertia: Any


@typechecked
@checked
def random_body_inertia(mass: Any, centre: Any, inertia: Any, dispersion: float, name: str = "body") -> MassProperties:
    r"""Make mass, centre of mass and inertia of a body random together, so that every value is that of a body.

    A body has the pseudo-inertia :math:`P = \int (1, x)(1, x)^T \mathrm{d}m`: mass, first and second moments about the
    origin of a frame of the body.  It is that of a distribution of mass if it is positive semi-definite.  This is the
    distribution of largest entropy with a given mean, a given dispersion, and an inverse of finite variance:
    :math:`P = F G F^T` with :math:`F F^T` the mean and :math:`G` a random matrix of mean :math:`I`.

    Parameters
    ----------
    mass : float
        Mean mass, kg.  A plain number, as all means.
    centre : array_like, shape (2,) or (3,)
        Mean centre of mass, m, in a frame of the body; two numbers for a planar body.
    inertia : float or array_like
        Inertia about it, kg m^2, as `uqmbd.random_inertia` takes it; 0, or (0, 0, 0), for a point mass.
    dispersion : float
        :math:`\delta = \sqrt{E \lVert G - I \rVert^2 / \lVert I \rVert^2}`, in Frobenius norms, so that
        :math:`\operatorname{cov}(P_{ij}, P_{kl}) = \frac{\delta^2}{n + 1} (P_{ik} P_{jl} + P_{il} P_{jk})` with
        :math:`n = 4` (3 for flat and for planar bodies, 2 for a rod, 1 for a point mass).
    name : str
        Beginning of the names of the random variables; every body needs its own.

    Returns
    -------
    MassProperties
        Expressions in independent random variables.  In space the mass has a coefficient of variation of
        :math:`\delta \sqrt{2/5} = 0.63\,\delta`.  The centre of mass has the mean that is given, is normal given the
        mass, and scatters by about :math:`\delta / \sqrt{5} = 0.45\,\delta` radii of gyration.  The inertia about the
        centre of mass is independent of both.

    Raises
    ------
    uqmbd.StudyError
        If the means are those of no body or random themselves, or the inverse has no finite variance, so that
        accelerations have none: `dispersion` has to be below 0.845 in space.

    See Also
    --------
    uqmbd.random_inertia : mass and centre of mass are certain.

    Notes
    -----
    In the model of A. Batou and C. Soize, Multibody System Dynamics 27 (2012) 285-319, mass, centre of mass and second
    moments over mass are independent, with a dispersion each; here one matrix with one dispersion holds them all.  That
    a body is physical if its pseudo-inertia is positive: P. Wensing, S. Kim and J.-J. Slotine, IEEE Robotics and
    Automation Letters 3 (2018) 60-67.

    The mean of the inertia about the *mean* centre of mass is `inertia`.  That about the random centre is smaller by
    the factor :math:`1 - \delta^2 / (n + 1)`, since the centre scatters.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("arm", uqmbd.Spatial())
    >>> random = uqmbd.random_body_inertia(2.0, (0.5, 0, 0), (0.02, 0.05, 0.06), 0.1, name="arm")
    >>> body = mechanism.body("arm", mass=random.mass, inertia=random.inertia, position=random.centre)
    >>> len(mechanism.inputs.names), random.mass
    (10, 2.0*arm.11**2)
    """
    check_name(name, "random_body_inertia, name")
    where = f"random_body_inertia({name!r})"
    coordinates = flatten(centre)
    place = _numbers(where, "centre", centre, numbers(where, "centre", coordinates, len(coordinates), "m"))
    if len(place) not in (2, 3):
        raise StudyError(
            f"{where}: the centre is {shown(centre)}; expected two numbers in the plane, or three in space."
        )
    planar = len(place) == 2
    heavy = _numbers(where, "mass", mass, [mass_number(where, mass)])[0]
    if heavy <= 0:
        raise StudyError(f"{where}: the mass is {heavy:g} kg; expected more than 0.")
    given = _numbers(where, "inertia", inertia, inertia_entries(where, Planar() if planar else Spatial(), inertia))
    # of a planar body only the sum of both second moments matters
    root = np.eye(2)[:, : 2 * (given[0] > 0)] * math.sqrt(given[0] / 2) if planar else _root(where, given)
    size = 1 + root.shape[1]
    delta = _dispersion(where, dispersion, size, f"a pseudo-inertia of rank {size}")
    if size == 1:
        return MassProperties(heavy * random_factor(name, delta), tuple(map(sympy.Float, place)), _none(planar))
    # P = F A (F A)^T with the triangular A: the mass has its first entry alone, and what is left of the second moments
    # by the centre has its last rows alone
    lower = random_root(name, delta, size).T
    shift = sympy.Matrix(root) * lower[1:, 0] / (math.sqrt(heavy) * lower[0, 0])
    factor = sympy.Matrix(root) * lower[1:, 1:]
    second = factor * factor.T
    moved = tuple(sympy.expand(c + x) for c, x in zip(place, shift, strict=True))
    about = sympy.expand(second.trace()) if planar else _tensor(second)
    return MassProperties(heavy * lower[0, 0] ** 2, moved, about)


def _none(planar: bool) -> Any:
    return sympy.S.Zero if planar else (sympy.S.Zero,) * 6


def _tensor(second: sympy.Matrix) -> tuple[sympy.Expr, ...]:
    """Return the six entries of the inertia of second moments of mass."""
    j = sympy.eye(3) * second.trace() - second
    return tuple(sympy.expand(j[i, k]) for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))


def _numbers(where: str, what: str, given: Any, entries: Any) -> list[float]:
    """Return entries as numbers, or refuse random ones."""
    random = sorted({str(s) for x in entries for s in as_symbolic(x).free_symbols})
    if random:
        raise StudyError(
            f"{where}: the {what} is {shown(given)}, which depends on {', '.join(random)}; expected numbers."
        )
    return [float(x) for x in entries]


def _root(where: str, entries: list[float]) -> NDArray[np.float64]:
    """Return the root of the second moments of mass, shape (3, rank): their principal axes, scaled."""
    xx, yy, zz, xy, xz, yz = entries
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if not matrix.any():
        return np.zeros((3, 0))
    if any((xy, xz, yz)):
        moments, axes = np.linalg.eigh(matrix)
    else:
        moments, axes = np.array([xx, yy, zz]), np.eye(3)
    second = moments.sum() / 2 - moments
    largest = second.max()
    if second.min() < -ROUNDING * largest:
        nearest = (axes * np.maximum(second, 0)) @ axes.T
        tensor = np.trace(nearest) * np.eye(3) - nearest
        listed = ", ".join(f"{x:.9g}" for x in tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
        raise StudyError(
            f"{where}: the mean is that of no body, by rounding: its principal moments are "
            f"{', '.join(f'{x:.6g}' for x in np.sort(moments))} kg m^2, and the largest is more than the sum of the "
            f"other two. Take the nearest tensor of a body: ({listed})."
        )
    extended = second > ROUNDING * largest
    return np.asarray(axes[:, extended] * np.sqrt(second[extended]), dtype=np.float64)


def _dispersion(where: str, dispersion: Any, size: int, what: str) -> float:
    """Check the dispersion of a random matrix: its inverse, an inverse Wishart matrix, has a finite variance."""
    largest = math.sqrt((size + 1) / (size + 3))
    number = isinstance(dispersion, (int, float, np.number)) and not isinstance(dispersion, bool)
    if not number or not 0 < float(dispersion) < largest:
        raise StudyError(
            f"{where}: dispersion is {dispersion!r}; expected more than 0 and less than {largest:.4g} for {what}, such "
            "as 0.1. For larger values the variance of accelerations is infinite."
        )
    return float(dispersion)
