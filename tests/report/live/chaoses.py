"""Surrogates of every kind, with drawn distributions, orders and elements, as hypothesis draws them."""

from dataclasses import replace

import chaospy
import numpy as np
from hypothesis import strategies as st

import uqmbd
from uqmbd.extend import AlignedElement, QuasiPeriodicElement, labels
from uqmbd.randomness import GermBox, GermSpace, JointInput
from uqmbd.results import (
    AlignedChaos,
    ComposedChaos,
    PiecewiseChaos,
    PolynomialChaos,
    QuasiPeriodicChaos,
    propagator_node,
)

TIMES = np.linspace(0.0, 2.0, 33)
VERIFICATION = ("verification_germs", "verification_response", "verification_weights")
KINDS = ("polynomial", "elements", "events", "waves", "composed", "changing")

DISTRIBUTIONS = {
    "normal": lambda: chaospy.Normal(3.0, 0.2),
    "uniform": lambda: chaospy.Uniform(-1.0, 4.0),
    "beta": lambda: chaospy.Beta(2.0, 3.0, 1.0, 5.0),
    "gamma": lambda: chaospy.Gamma(2.5, 0.3),
    "lognormal": lambda: chaospy.LogNormal(0.0, 0.2),
    "triangle": lambda: chaospy.Triangle(0.0, 1.0, 3.0),
    "truncated": lambda: chaospy.TruncNormal(-1.0, 2.0, 0.0, 1.0),
    "discrete": lambda: chaospy.Binomial(7, 0.4),
}


def space_of(names):
    """The germ space of independent inputs of some distributions."""
    inputs = [uqmbd.RandomVariable(f"x{k}", DISTRIBUTIONS[name](), units="m") for k, name in enumerate(names)]
    return GermSpace.of(JointInput.of(inputs))


def boxes_of(space, splits):
    """Boxes that fill the space, from germs along which the first divisible one is split."""
    boxes = [GermBox.whole(space)]
    for number, germ in splits:
        box = boxes[number % len(boxes)]
        germ %= space.dimension
        if box.divisible(germ):
            boxes.remove(box)
            boxes += box.split(germ)
    return boxes


def decaying(draw, terms, *shape):
    """Coefficients (P, ...) that fall with the degree, smooth along the last axis as those of a motion."""
    along = np.linspace(0, 1, shape[-1])
    waves = np.array([0.4**n * np.cos(3 * n * along + draw.uniform(0, 6)) for n in range(12)])
    size = 0.2 ** terms.sum(axis=1).reshape(-1, *[1] * len(shape))
    return size * (draw.normal(size=(len(terms), *shape[:-1], len(waves))) @ waves)


def chaos_of(kind, space, boxes, order, seed, outputs=("x", "y"), error=1e-3, times=TIMES):
    """A surrogate of a kind; its verification realisations miss it by `error` (0: it has none)."""
    draw = np.random.default_rng(seed)
    if kind == "composed":
        parts = {
            "plain": chaos_of("polynomial", space, boxes, order, seed, outputs[1:], error),
            "events": chaos_of("events", space, boxes, order, seed, outputs[:1], error),
        }
        return ComposedChaos(parts, tuple(outputs))
    if kind == "changing":  # each output changes from one part to the other at times of its own
        parts = {one: chaos_of(one, space, boxes, order, seed, outputs, error) for one in ("polynomial", "events")}
        for name in parts:  # both have the same verification realisations
            parts[name] = replace(parts[name], **{x: getattr(parts["events"], x) for x in VERIFICATION})
        first = draw.random((len(outputs), len(times))) < 0.5
        return ComposedChaos(parts, tuple(outputs), {"polynomial": first, "events": ~first})
    terms = space.basis(order)
    axes = labels([(name, "m") for name in outputs], [(name, "m") for name in space.inputs], times)
    if kind == "polynomial":
        whole = decaying(draw, terms, len(outputs), len(times) if times is not None else 1)
        known = {"coefficients": whole if times is not None else whole[..., 0], "multi_index": terms}
        return verified(lambda more: PolynomialChaos(space=space, labels=axes, **known, **more), space, error, seed)
    if kind == "elements":
        elements = []
        for box in boxes:
            terms = box.local.basis(order)
            whole = decaying(draw, terms, len(outputs), len(times))

            def make(more, t=terms, w=whole, b=box):
                return PolynomialChaos(w, t, b.local, axes, **more)

            elements.append(verified(make, box.local, error, seed))
        return PiecewiseChaos(elements, boxes)
    terms = boxes[0].space.basis(
        min([order, *(b.local.germs[k].values or 99 for b in boxes for k in range(space.dimension))])
    )
    keep = [
        all(
            t <= (g.highest_degree if g.highest_degree is not None else 99)
            for b in boxes
            for t, g in zip(row, b.local.germs, strict=True)
        )
        for row in terms
    ]
    terms = terms[keep]
    if kind == "events":
        elements = []
        for box in boxes:
            edges = decaying(draw, terms, 4) * draw.choice([0.02, 0.3])
            edges[0] = 0.0, *np.sort(draw.uniform(0.3, 1.7, 2)), 2.1
            elements.append(AlignedElement(box, ("hit", "", ""), edges, decaying(draw, terms, 3, len(outputs), 7)))
        return verified(lambda more: AlignedChaos(tuple(elements), terms, axes, **more), space, error, seed)
    lattice = np.array([[1, 0], [0, 1], [2, -1], [3, 0]])
    elements = []
    for box in boxes:
        frequencies = decaying(draw, terms, 2) * 0.1
        frequencies[0] = 6.0, 9.5
        waves = decaying(draw, terms, len(outputs), 4) + 1j * decaying(draw, terms, len(outputs), 4)
        constants, drifts = decaying(draw, terms, len(outputs)), decaying(draw, terms, len(outputs))
        elements.append(QuasiPeriodicElement(box, frequencies, constants, drifts, waves))
    return verified(
        lambda more: QuasiPeriodicChaos(tuple(elements), lattice, 0.25, terms, axes, **more), space, error, seed
    )


def verified(make, space, error, seed):
    """A surrogate with realisations that differ from it by `error` of a size that grows with time."""
    bare = make({})
    if not error:
        return bare
    draw = np.random.default_rng(seed + 1)
    germs = space.from_uniform(draw.random((6, space.dimension)))
    values = bare.evaluate_germs(germs)
    response = values + error * draw.normal(size=values.shape) * np.nanstd(values)
    return make({"verification_germs": germs, "verification_response": np.nan_to_num(response)})


@st.composite
def chaoses(draw, kind):
    """A surrogate of a kind."""
    names = draw(st.lists(st.sampled_from(sorted(DISTRIBUTIONS)), min_size=1, max_size=3))
    space = space_of(names)
    splits = draw(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 2)), max_size=3))
    boxes = boxes_of(space, splits)
    error = draw(st.sampled_from([0.0, 1e-1, 1e-3, 1e-6]))
    return chaos_of(kind, space, boxes, draw(st.integers(0, 4)), draw(st.integers(0, 999)), error=error)


def falling(inputs, order=3):
    """Return the node of a chaos of one output that rises over time, of some inputs that matter less and less."""
    rng = np.random.default_rng(0)
    variables = [uqmbd.RandomVariable(f"k{k}", chaospy.Normal(1, 0.1)) for k in range(inputs)]
    space = GermSpace.of(JointInput.of(variables))
    indices = np.vstack([np.zeros((1, inputs), int), *(n * np.eye(inputs, dtype=int) for n in range(1, order + 1))])
    sizes = np.array([10.0 ** -(sum(row) + row.argmax()) if row.any() else 5.0 for row in indices])
    coefficients = (sizes * (1 + rng.uniform(size=len(sizes))))[:, None, None] * np.linspace(0.5, 1.0, 9)
    axes = labels([("x", "m")], [f"k{k}" for k in range(inputs)], np.linspace(0, 1, 9))
    chaos = PolynomialChaos(coefficients, indices, space, axes)
    return propagator_node(
        "mine", chaos.statistics(), propagator="p", realisations=3, wall_time=0.0,
        children={"chaos": chaos.to_dataset()},
    )  # fmt: skip
