"""Conversion of joint distributions of chaospy to maps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.randomness.distributions import is_dependent
from uqmbd.randomness.rosenblatt.copulas import FAMILIES, Archimedean, Copula, Elliptical, triangular
from uqmbd.randomness.rosenblatt.expressions import NotUnderstood, owners_of, read
from uqmbd.randomness.rosenblatt.laws import AffineJoint, Chain, ChainStep, Copulated, JointLaw, Single
from uqmbd.randomness.rosenblatt.members import conditional
from uqmbd.randomness.rosenblatt.vectors import NormalMixture, Vector

__all__ = ["joint_law", "mixture_of"]


Places = Mapping[tuple[int, int], int]
"""See :func:`uqmbd.randomness.rosenblatt.expressions.read`."""


def joint_law(distribution: Any) -> JointLaw:
    """Return the map of a joint distribution of chaospy.

    Raise NotUnderstood if the structure of a part is unknown. Raise StudyError, whose message is part of a sentence, if
    a part is not a valid distribution.

    >>> import chaospy
    >>> a = chaospy.Uniform(1, 2)
    >>> law = joint_law(chaospy.J(chaospy.Normal(3 * a, 0.1), a))
    >>> law.order, law.given
    ((1, 0), (frozenset({1}), frozenset()))
    >>> law.inverse(np.array([[0.5], [0.25]]), np.empty((0, 1))).ravel().tolist()
    [3.75, 1.25]
    """
    return _law(distribution, {})


def _law(distribution: Any, places: Places) -> JointLaw:
    import chaospy

    if len(distribution) == 1:
        return Single(conditional(distribution, places))
    given = distribution._parameters
    if isinstance(distribution, chaospy.J):
        return _chain(distribution, places)
    if isinstance(distribution, chaospy.CopulaDistribution):
        return Copulated(_copula(given["trans"]), _law(given["dist"], places))
    if isinstance(distribution, (chaospy.MvNormal, chaospy.MvLogNormal, chaospy.MvStudentT)):
        return _vector(distribution, places)
    if isinstance(distribution, chaospy.GaussianKDE):  # chaospy represents mixtures as kernel densities
        return mixture_of(distribution)
    if isinstance(distribution, chaospy.Trunc):
        if is_dependent(distribution._dist):
            raise StudyError(
                f"chaospy does not truncate dependent variables correctly ({distribution}); truncate the marginal "
                "distributions, and combine them with chaospy.Nataf(chaospy.J(...), correlation)"
            )
        singles = [Single(conditional(distribution, places, k)) for k in range(len(distribution))]
        return Chain(tuple(ChainStep((k,), law) for k, law in enumerate(singles)), _count(places))
    if isinstance(distribution, (chaospy.Add, chaospy.Multiply, chaospy.Negative)):
        return _operated(distribution, places)
    raise NotUnderstood(str(distribution))


def _chain(distribution: Any, places: Places) -> Chain:
    """Return the map of a joint distribution; members of an enclosing one, at `places`, precede its own members."""
    owners = owners_of(distribution)
    groups: dict[int, tuple[Any, list[int]]] = {}
    for column in map(int, distribution._rotation):
        owner = owners[column][1]
        groups.setdefault(id(owner), (owner, []))[1].append(column)
    outside = _count(places)
    known = dict(places)
    steps: list[ChainStep] = []
    waiting = list(groups.values())
    while waiting:
        unknown: NotUnderstood | None = None
        # chaospy sorts components: a vector may precede a variable on which another component of it depends
        for one in waiting:
            owner, columns = one[0], sorted(one[1], key=lambda k: int(owners[k][0]))
            if len(columns) != len(owner):
                raise NotUnderstood(str(owner))
            try:
                law = _law(owner, known)
            except NotUnderstood as part:
                unknown = unknown or part
                continue
            steps.append(ChainStep(tuple(columns), law))
            known |= {(id(owner), place): outside + k for place, k in enumerate(columns)}
            waiting = [other for other in waiting if other is not one]
            break
        else:
            assert unknown is not None
            raise unknown
    return Chain(tuple(steps), outside)


def _count(places: Places) -> int:
    """Return the number of variables of the larger distribution to which the places belong."""
    return 1 + max(places.values(), default=-1)


def _copula(trans: Any) -> Copula:
    import chaospy

    family = type(trans).__name__
    if isinstance(trans, chaospy.Archimedean) and family in FAMILIES:
        return Archimedean(family, float(np.ravel(trans._parameters["theta"])[0]), len(trans))
    if family in ("nataf", "t_copula"):
        order = tuple(int(k) for k in trans._rotation)
        permute = np.asarray(trans._permute)
        correlation = permute.T @ np.asarray(trans._correlation, dtype=float) @ permute
        deviation = np.sqrt(np.diag(correlation))
        freedom = float(np.ravel(trans._parameters["df"])[0]) if family == "t_copula" else np.inf
        return Elliptical(triangular(correlation / np.outer(deviation, deviation), order), order, freedom)
    raise NotUnderstood(str(trans))


def _vector(distribution: Any, places: Places) -> Vector:
    import chaospy

    given, order = distribution._parameters, tuple(int(k) for k in distribution._rotation)
    logarithmic = isinstance(distribution, chaospy.MvLogNormal)
    mean, matrix = given["mu" if logarithmic else "mean"], given["sigma" if logarithmic else "covariance"]
    student = isinstance(distribution, chaospy.MvStudentT)
    freedom = read(distribution._dist._owners[0][1]._parameters["a"], {}) if student else np.inf
    if isinstance(matrix, chaospy.Distribution) or not isinstance(freedom, float):
        raise NotUnderstood(str(distribution))
    covariance = np.asarray(matrix, dtype=float)
    if covariance.ndim < 2:
        covariance = np.diag(np.broadcast_to(covariance, len(order)).astype(float))
    centre = tuple(read(mean, places, k) for k in range(len(order)))
    return Vector(centre, triangular(covariance, order), order, freedom, logarithmic)


def mixture_of(distribution: Any) -> NormalMixture:
    """Return a mixture or kernel density of chaospy, of any dimension."""
    centres = np.asarray(distribution._samples, dtype=float).T
    order = tuple(int(k) for k in distribution._rotation)
    weights = np.broadcast_to(np.asarray(distribution.weights, dtype=float), len(centres)).astype(float)
    covariance = np.broadcast_to(distribution._covariance, (len(centres), *distribution._covariance.shape[1:]))
    factors = np.stack([triangular(np.asarray(one, dtype=float), order) for one in covariance])
    return NormalMixture(weights, centres, factors, order)


def _operated(distribution: Any, places: Places) -> AffineJoint:
    import chaospy

    left, right = distribution._parameters["left"], distribution._parameters["right"]
    places_of = range(len(distribution))
    if isinstance(distribution, chaospy.Negative):
        return AffineJoint(_law(left, places), (0.0,) * len(left), (-1.0,) * len(left))
    inner, other = (left, right) if isinstance(left, chaospy.Distribution) else (right, left)
    if isinstance(other, chaospy.Distribution):
        raise NotUnderstood(str(distribution))
    values = tuple(read(other, places, k) for k in places_of)
    if isinstance(distribution, chaospy.Add):
        return AffineJoint(_law(inner, places), values, (1.0,) * len(values))
    return AffineJoint(_law(inner, places), (0.0,) * len(values), values)
