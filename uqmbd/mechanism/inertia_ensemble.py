"""Random inertia that a body can have: maximum entropy on the cone of physical inertias (Batou and Soize 2012)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions import shown
from uqmbd.mechanism.geometry import Planar, Spatial
from uqmbd.mechanism.inertia import inertia_entries
from uqmbd.names import check_name, checked
from uqmbd.randomness import random_factor, random_root

__all__ = ["random_inertia"]

ROUNDING = 1e-12
"""A second moment of this size, relative to the largest, is zero."""


@checked
def random_inertia(mean: Any, dispersion: float, name: str = "inertia") -> Any:
    r"""Make the inertia of a body random, so that every value is that of a distribution of mass.

    A tensor of inertia is that of a body only if no principal moment is more than the sum of the other two: if the
    second moments of mass :math:`S = \tfrac{1}{2} \operatorname{tr}(J) I - J` are positive semi-definite.  This is the
    distribution of largest entropy among those with a given mean, a given dispersion, and an inverse of finite
    variance: :math:`S = F G F^T` with :math:`F F^T` the mean second moments and :math:`G` a random matrix of mean
    :math:`I` (a Wishart matrix of any real number of degrees of freedom).

    Parameters
    ----------
    mean : float or array_like
        Mean inertia about the centre of mass, kg m^2, as a body takes it: one number for a planar body; the diagonal,
        six entries ``(Jxx, Jyy, Jzz, Jxy, Jxz, Jyz)`` or a 3 x 3 matrix for a spatial one.  Plain numbers.
    dispersion : float
        :math:`\delta = \sqrt{E \lVert G - I \rVert^2 / \lVert I \rVert^2}`, in Frobenius norms.  In the plane it is the
        coefficient of variation of the moment of inertia.  In space the second moments have the covariance
        :math:`\operatorname{cov}(S_{ij}, S_{kl}) = \frac{\delta^2}{4} (S_{ik} S_{jl} + S_{il} S_{jk})` (a third for a
        flat body), so that each moment of inertia of a ball has a coefficient of variation of :math:`\delta / 2`.
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
    uqmbd.Mechanism.randomise : factors for the second moments along the principal axes, whose directions stay.

    Notes
    -----
    A. Batou and C. Soize, "Rigid multibody system dynamics with uncertain rigid bodies", Multibody System Dynamics 27
    (2012) 285-319; C. Soize, "A nonparametric model of random uncertainties for reduced matrix models in structural
    dynamics", Probabilistic Engineering Mechanics 15 (2000) 277-294.  There, mass, centre of mass and second moments
    over mass are independent; where the mass is random as well, multiply all entries by mass over mean mass.

    At the means of the random variables, where single simulations run, the tensor is smaller than its mean by about
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
    planar = not isinstance(mean, (str, np.ndarray)) and np.ndim(mean) == 0
    entries = inertia_entries(where, Planar() if planar else Spatial(), mean)
    random = sorted({str(s) for x in entries for s in x.free_symbols})
    if random:
        raise StudyError(f"{where}: the mean is {shown(mean)}, which depends on {', '.join(random)}; expected numbers.")
    numbers = [float(x) for x in entries]
    if planar:
        if numbers[0] <= 0:
            raise StudyError(f"{where}: the mean is {numbers[0]:g} kg m^2; expected more than 0, or nothing varies.")
        delta = _dispersion(where, dispersion, 1)
        return numbers[0] * random_factor(name, delta)
    root = _root(where, numbers)
    rank = root.shape[1]
    delta = _dispersion(where, dispersion, rank)
    if rank == 1:
        one = random_factor(name, delta)
        return tuple(x * one if x else sympy.S.Zero for x in numbers)
    factor = sympy.Matrix(root) * random_root(name, delta, rank).T
    second = factor * factor.T
    j = sympy.eye(3) * second.trace() - second
    return tuple(sympy.expand(j[i, k]) for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))


def _root(where: str, entries: list[float]) -> NDArray[np.float64]:
    """Return the root of the second moments of mass, shape (3, rank): their principal axes, scaled."""
    xx, yy, zz, xy, xz, yz = entries
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if not matrix.any():
        raise StudyError(f"{where}: the mean is zero, that of a point mass; nothing of it can vary.")
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


def _dispersion(where: str, dispersion: Any, size: int) -> float:
    """Check the dispersion of a random matrix: its inverse, an inverse Wishart matrix, has a finite variance."""
    largest = math.sqrt((size + 1) / (size + 3))
    number = isinstance(dispersion, (int, float, np.number)) and not isinstance(dispersion, bool)
    if not number or not 0 < float(dispersion) < largest:
        what = {1: "that varies in one number", 2: "of a flat body", 3: "of a body"}[size]
        raise StudyError(
            f"{where}: dispersion is {dispersion!r}; expected more than 0 and less than {largest:.4g} for an inertia "
            f"{what}, such as 0.1: beyond, its inverse has no finite variance, and so have accelerations."
        )
    return float(dispersion)
