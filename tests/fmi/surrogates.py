"""Surrogates of every kind, with coefficients at random, and nodes that hold them."""

from __future__ import annotations

import chaospy
import numpy as np
import xarray as xr

import uqmbd
from uqmbd.extend import AlignedElement, GermBox, GermSpace, JointInput, QuasiPeriodicElement, labels
from uqmbd.results import AlignedChaos, ComposedChaos, PiecewiseChaos, PolynomialChaos, QuasiPeriodicChaos

TIMES = np.array([0.0, 0.1, 0.25, 0.5, 0.75, 1.0])


def random_inputs(*names_and_laws):
    """Random variables by name and distribution."""
    return [uqmbd.RandomVariable(name, law, units="m") for name, law in names_and_laws]


def plain_inputs():
    """A normal and a uniform input."""
    return random_inputs(("a", chaospy.Normal(3, 0.2)), ("b", chaospy.Uniform(-1, 2)))


def dependent():
    """A normal vector, and a Gaussian copula of tabulated and lognormal marginals."""
    vector = uqmbd.random_vector(["a", "b"], chaospy.MvNormal([1.0, 2.0], [[0.04, 0.03], [0.03, 0.09]]), ["m", "kg"])
    copula = chaospy.Nataf(chaospy.J(chaospy.Weibull(2.0), chaospy.LogNormal(0, 0.3)), [[1, 0.6], [0.6, 1]])
    return [*vector, *uqmbd.random_vector(["c", "d"], copula)]


FAMILIES = {
    "normal": chaospy.Normal(3, 0.2),
    "uniform": chaospy.Uniform(-1, 2),
    "lognormal": chaospy.LogNormal(0.1, 0.4),
    "shifted lognormal": 2 - chaospy.LogNormal(0.1, 0.4),
    "beta": chaospy.Beta(2, 3, -1, 1),
    "gamma": chaospy.Gamma(2.5, 0.3),
    "exponential": chaospy.Exponential(2.0),
    "truncated": chaospy.TruncNormal(-1, 1.5, 0.2, 1),
    "triangle": chaospy.Triangle(0, 0.3, 1),
    "weibull": chaospy.Weibull(1.4),
    "student": chaospy.StudentT(12),
    "discrete": chaospy.DiscreteUniform(1, 4),
}


def coefficients(rng, terms, *shape):
    """Random coefficients that fall with the number of the term."""
    return rng.normal(size=(terms, *shape)) / (1 + np.arange(terms)).reshape(-1, *(1,) * len(shape))


def polynomial(inputs, order=3, outputs=("y", "z"), times=TIMES, seed=0, box=None, verified=True):
    """A plain chaos with random coefficients, with verification realisations."""
    rng = np.random.default_rng(seed)
    space = GermSpace.of(JointInput.of(inputs)) if box is None else box.local
    terms = space.basis(order)
    axes = labels([(name, "m") for name in outputs], [(name, "m") for name in space.inputs], times)
    shape = (len(outputs),) if times is None else (len(outputs), len(times))
    values = coefficients(rng, len(terms), *shape)
    known = {}
    if verified:
        germs = space.from_uniform(rng.uniform(0.1, 0.9, (8, len(inputs))))
        known = {"verification_germs": germs, "verification_response": rng.normal(size=(8, *shape))}
    return PolynomialChaos(values, terms, space, axes, **known)


def aligned(inputs, outputs=("y", "z"), seed=0, boxes=1, seen="events"):
    """A chaos of three segments with random marker times, in one or two boxes."""
    rng = np.random.default_rng(seed)
    space = GermSpace.of(JointInput.of(inputs))
    terms = space.basis(2)
    whole = GermBox.whole(space)
    elements = []
    for k, box in enumerate([whole] if boxes == 1 else whole.split(1)):
        edges = 0.02 * coefficients(rng, len(terms), 4)
        edges[0] = 0.0, 0.3 + 0.02 * k, 0.6, 1.05
        edges[1:, 0] = 0.0
        values = coefficients(rng, len(terms), 3, len(outputs), 5 + k)
        elements.append(AlignedElement.through(box, ("hit", "hit", ""), edges, values, seen))
    axes = labels([(name, "m") for name in outputs], [(name, "m") for name in space.inputs], TIMES)
    return AlignedChaos(tuple(elements), terms, axes)


def harmonic(inputs, outputs=("y", "z"), seed=0):
    """A chaos of harmonics of two frequencies."""
    rng = np.random.default_rng(seed)
    space = GermSpace.of(JointInput.of(inputs))
    terms = space.basis(2)
    lattice = np.array([[1, 0], [0, 1], [1, -1], [2, 1]])
    frequencies = 0.1 * coefficients(rng, len(terms), 2)
    frequencies[0] = 5.0, 13.0
    o, h = len(outputs), len(lattice)
    waves = coefficients(rng, len(terms), o, h) + 1j * coefficients(rng, len(terms), o, h)
    element = QuasiPeriodicElement(
        GermBox.whole(space), frequencies, coefficients(rng, len(terms), o), coefficients(rng, len(terms), o), waves
    )
    axes = labels([(name, "m") for name in outputs], [(name, "m") for name in space.inputs], TIMES)
    return QuasiPeriodicChaos((element,), lattice, 0.05, terms, axes)


def piecewise(inputs):
    """A chaos of three elements."""
    space = GermSpace.of(JointInput.of(inputs))
    first, rest = GermBox.whole(space).split(0)
    boxes = (first, *rest.split(1))
    return PiecewiseChaos(tuple(polynomial(inputs, 2, seed=k, box=box) for k, box in enumerate(boxes)), boxes)


def composed(inputs):
    """A plain chaos until 0.5 s, and segments afterwards, for one output; the other output is plain."""
    parts = {"plain": polynomial(inputs, outputs=("y", "z"), verified=False), "late": aligned(inputs, outputs=("y",))}
    early = TIMES <= 0.5
    used = {"plain": np.array([early, np.ones(len(TIMES), dtype=bool)]), "late": ~early[None]}
    return ComposedChaos(parts, ("y", "z"), used)


def node(*surrogates):
    """A node of a method: outputs over time, and scalar outputs."""
    found = {}
    for one in surrogates:
        prefix = "" if one.labels.times is not None else "scalars/"
        found |= {prefix + path: data for path, data in one.to_datasets().items()}
    return xr.DataTree.from_dict(found, name="collocation")


def drawn(space, count, seed=1):
    """Random inputs of a germ space."""
    return space.to_inputs(
        space.from_uniform(np.random.default_rng(seed).uniform(0.001, 0.999, (count, space.dimension)))
    )


KINDS = {
    "plain": lambda: polynomial(plain_inputs()),
    "elements": lambda: piecewise(plain_inputs()),
    "events": lambda: aligned(plain_inputs()),
    "phase in elements": lambda: aligned(plain_inputs(), boxes=2, seen="phase"),
    "harmonics": lambda: harmonic(plain_inputs()),
    "composed": lambda: composed(plain_inputs()),
    "dependent": lambda: polynomial(dependent(), 2),
    "families": lambda: polynomial(random_inputs(*((n.replace(" ", "_"), x) for n, x in FAMILIES.items())), 1),
    "order 9": lambda: polynomial(plain_inputs(), 9),
}
