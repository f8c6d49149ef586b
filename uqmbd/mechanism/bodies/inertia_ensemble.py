"""Random inertia of maximum entropy on the cone of physical inertias (Batou and Soize 2012)."""

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
"""Size of a second moment, relative to the largest, that counts as zero."""

VARYING = {n: f"an inertia {of}" for n, of in enumerate(("with one random factor", "of a flat body", "of a body"), 1)}


@typechecked
@checked
def random_inertia(mean: Any, dispersion: float, name: str = "inertia") -> Any:
    r"""Make the inertia of a body random, so that every realisation is physically possible.

    An inertia tensor :math:`J` is physical only if no principal moment exceeds the sum of the other two.  Equivalently,
    the matrix of second moments of mass :math:`S = \tfrac{1}{2} \operatorname{tr}(J) I - J` is positive semi-definite.
    The random matrix is :math:`S = F G F^T`.  :math:`F F^T` is the mean of :math:`S`, and :math:`G` is a random
    Wishart matrix of mean :math:`I` with a real number of degrees of freedom.  Among all distributions with the given
    mean and dispersion, and with an inverse of finite variance, the distribution of :math:`S` has the largest entropy.

    Parameters
    ----------
    mean : float or array_like
        Mean inertia about the centre of mass, kg m^2, in the form for `Mechanism.body`. Planar body: one number.
        Spatial body: the diagonal, six entries ``(Jxx, Jyy, Jzz, Jxy, Jxz, Jyz)`` or a 3 x 3 matrix. All entries are
        numbers, not random variables.
    dispersion : float
        :math:`\delta = \sqrt{E \lVert G - I \rVert^2 / \lVert I \rVert^2}`, in Frobenius norms. In planar space, the
        dispersion is the coefficient of variation of the moment of inertia. In three dimensions, the second moments
        have the covariance
        :math:`\operatorname{cov}(S_{ij}, S_{kl}) = \frac{\delta^2}{4} (S_{ik} S_{jl} + S_{il} S_{jk})`, with means on
        the right-hand side. For a flat body, the factor is :math:`\delta^2 / 3`. Each moment of inertia of a ball thus
        has a coefficient of variation of :math:`\delta / 2`.
    name : str
        First part of the names of the random variables; every body needs a different one.

    Returns
    -------
    sympy.Expr or tuple of sympy.Expr
        Inertia for ``mechanism.body(inertia=...)``: one expression, or the six entries of the tensor. The inertia is a
        quadratic polynomial in independent random variables with normal (``NAME.12``) or chi distributions
        (``NAME.11``). Directions without extent have no variables: a flat body has three variables, a rod has one.

    Raises
    ------
    uqmbd.StudyError
        If `mean` is not the inertia of a body, is random, or is zero. The error also occurs if `dispersion` is so large
        that the inverse of the matrix, and therefore accelerations, have no finite variance. `dispersion` must be below
        0.816 in three dimensions. The limit is 0.774 for a flat body, and 0.707 for a rod and for a planar body.

    See Also
    --------
    uqmbd.random_body_inertia : random mass, centre of mass and inertia.
    uqmbd.Mechanism.randomise : random factors of the second moments along principal axes with fixed directions.

    Notes
    -----
    A. Batou and C. Soize, "Rigid multibody system dynamics with uncertain rigid bodies", Multibody System Dynamics 27
    (2012) 285-319; C. Soize, "A nonparametric model of random uncertainties for reduced matrix models in structural
    dynamics", Probabilistic Engineering Mechanics 15 (2000) 277-294.  In these models, mass, centre of mass and second
    moments divided by mass are independent. If the mass is also random, multiply all entries by the ratio of the mass
    to the mean mass.

    Single simulations use the means of the random variables. At these means, the tensor is smaller than its own mean,
    because it is quadratic in the random variables. For a planar body, the fraction is about :math:`\delta^2 / 4`. For
    a ball, the fractions of the three moments are about 0.50, 0.375 and 0.25 times :math:`\delta^2`.

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
        raise StudyError(
            f"{where}: the mean is zero, as for a point mass, and cannot vary; expected an inertia above zero."
        )
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
    """Mass, centre of mass and inertia of a body, in the form of the arguments of `Mechanism.body`.

    Attributes
    ----------
    mass : sympy.Expr
        Mass, kg.
    centre : tuple of sympy.Expr
        Coordinates of the centre of mass, m, in the frame of the given mean centre of mass.
    inertia : sympy.Expr or tuple of sympy.Expr
        Inertia about the centre of mass, kg m^2, in axes parallel to the same frame: one number in planar space, six
        entries in three dimensions.

    Examples
    --------
    `uqmbd.random_body_inertia` returns random mass properties. Here the mass properties are numbers:

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
    r"""Make mass, centre of mass and inertia of a body jointly random, with physically possible realisations only.

    The pseudo-inertia :math:`P = \int (1, x)(1, x)^T \mathrm{d}m` of a body contains its mass, and the first and second
    moments about the origin of a body frame.  A positive semi-definite pseudo-inertia is physical.  The random
    pseudo-inertia is :math:`P = F G F^T`, with its mean :math:`F F^T` and a random matrix :math:`G` of mean :math:`I`.
    Among all distributions with the given mean and dispersion, and with an inverse of finite variance, the distribution
    of :math:`P` has the largest entropy.

    Parameters
    ----------
    mass : float
        Mean mass, kg.  Mass, centre and inertia are numbers, not random variables.
    centre : array_like, shape (2,) or (3,)
        Mean centre of mass in a frame of the body, m; two numbers for a planar body.
    inertia : float or array_like
        Inertia about `centre`, kg m^2, in the form for `uqmbd.random_inertia`; 0, or (0, 0, 0), for a point mass.
    dispersion : float
        :math:`\delta = \sqrt{E \lVert G - I \rVert^2 / \lVert I \rVert^2}`, in Frobenius norms, so that
        :math:`\operatorname{cov}(P_{ij}, P_{kl}) = \frac{\delta^2}{n + 1} (P_{ik} P_{jl} + P_{il} P_{jk})` with
        :math:`n = 4` (3 for flat and for planar bodies, 2 for a rod, 1 for a point mass).
    name : str
        First part of the names of the random variables; every body needs a different one.

    Returns
    -------
    MassProperties
        Expressions in independent random variables. In three dimensions the mass has a coefficient of variation of
        :math:`\delta \sqrt{2/5} = 0.63\,\delta`. The centre of mass has the mean `centre` and, conditional on the mass,
        a normal distribution. The centre scatters by about :math:`\delta / \sqrt{5} = 0.45\,\delta` radii of gyration.
        The inertia about the centre of mass is independent of mass and centre of mass.

    Raises
    ------
    uqmbd.StudyError
        If the means are random, or are not physically possible. The error also occurs if `dispersion` is so large that
        the inverse of the matrix, and therefore accelerations, have no finite variance. `dispersion` must be below
        0.845 in three dimensions.

    See Also
    --------
    uqmbd.random_inertia : random inertia with deterministic mass and centre of mass.

    Notes
    -----
    In the model of A. Batou and C. Soize, Multibody System Dynamics 27 (2012) 285-319, mass, centre of mass and second
    moments divided by mass are independent, with separate dispersions. Here one random matrix with one dispersion
    contains all three quantities.  P. Wensing, S. Kim and J.-J. Slotine, IEEE Robotics and Automation Letters 3 (2018)
    60-67, show that a body is physical if its pseudo-inertia is positive.

    The mean of the inertia about the *mean* centre of mass is `inertia`.  The mean of the inertia about the random
    centre of mass is this value times :math:`1 - \delta^2 / (n + 1)`, because the centre of mass scatters.

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
            f"{where}: the centre is {shown(centre)}; expected two numbers in planar space, or three "
            "numbers in three dimensions."
        )
    planar = len(place) == 2
    heavy = _numbers(where, "mass", mass, [mass_number(where, mass)])[0]
    if heavy <= 0:
        raise StudyError(f"{where}: the mass is {heavy:g} kg; expected more than 0.")
    given = _numbers(where, "inertia", inertia, inertia_entries(where, Planar() if planar else Spatial(), inertia))
    # a planar body depends only on the sum of both second moments
    root = np.eye(2)[:, : 2 * (given[0] > 0)] * math.sqrt(given[0] / 2) if planar else _root(where, given)
    size = 1 + root.shape[1]
    delta = _dispersion(where, dispersion, size, f"a pseudo-inertia of rank {size}")
    if size == 1:
        return MassProperties(heavy * random_factor(name, delta), tuple(map(sympy.Float, place)), _none(planar))
    # P = F A (F A)^T with the triangular A: the mass depends only on the first entry of A, and the second moments about
    # the centre depend only on the last rows of A
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
    """Return the six entries of the inertia tensor from second moments of mass."""
    j = sympy.eye(3) * second.trace() - second
    return tuple(sympy.expand(j[i, k]) for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))


def _numbers(where: str, what: str, given: Any, entries: Any) -> list[float]:
    """Return entries as numbers; raise for random entries."""
    random = sorted({str(s) for x in entries for s in as_symbolic(x).free_symbols})
    if random:
        raise StudyError(
            f"{where}: the {what} is {shown(given)}, which depends on {', '.join(random)}; expected numbers."
        )
    return [float(x) for x in entries]


def _root(where: str, entries: list[float]) -> NDArray[np.float64]:
    """Return a factor F, (3, rank), of the second moments of mass F F^T: principal axes times roots of the moments."""
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
            f"{where}: because of rounding, the mean is physically impossible. Its principal moments are "
            f"{', '.join(f'{x:.6g}' for x in np.sort(moments))} kg m^2, and the largest exceeds the sum of the other "
            f"two. Use the nearest possible tensor: ({listed})."
        )
    extended = second > ROUNDING * largest
    return np.asarray(axes[:, extended] * np.sqrt(second[extended]), dtype=np.float64)


def _dispersion(where: str, dispersion: Any, size: int, what: str) -> float:
    """Check the dispersion of a random matrix: its inverse Wishart matrix must have a finite variance."""
    largest = math.sqrt((size + 1) / (size + 3))
    number = isinstance(dispersion, (int, float, np.number)) and not isinstance(dispersion, bool)
    if not number or not 0 < float(dispersion) < largest:
        raise StudyError(
            f"{where}: dispersion is {dispersion!r}; expected more than 0 and less than {largest:.4g} for {what}, such "
            "as 0.1. For larger values the variance of accelerations is infinite."
        )
    return float(dispersion)
