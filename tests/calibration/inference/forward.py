"""Records of models that are formulas: what the sampler and the search are tested on."""

from dataclasses import dataclass

import numpy as np

from uqmbd_calibration.inference import Block, MachineRecords, Posterior, UnknownInput, Unknowns


def block(values, noise=0.1, *, times=None, modes=None, robust=False, level=-1, first=0, variance=None):
    """Make a block of values."""
    values = np.asarray(values, dtype=float)
    count = len(values)
    return Block(
        record="record",
        output="y",
        units="m",
        times=np.zeros(0) if times is None else np.asarray(times, dtype=float),
        values=values,
        row=0,
        columns=np.arange(count),
        noise=noise,
        level=level,
        modes=np.zeros((count, 0)) if modes is None else modes,
        robust=robust,
        first=first,
        variance=np.zeros(count) if variance is None else variance,
    )


class Formula:
    """A point whose realisations are values of a function of standard normal variables."""

    def __init__(self, function, inputs, most=10_000):
        self.function, self.most = function, most
        self.points = np.zeros((0, inputs))
        self.spent = self.failures = 0

    @property
    def left(self):
        return self.most - self.spent

    def run(self, normals):
        first = len(self.points)
        self.points = np.concatenate([self.points, normals])
        self.spent += len(normals)
        return np.arange(first, first + len(normals))

    def values(self, rows, blocks):
        found = self.function(self.points[rows])
        return [found[:, one.columns] for one in blocks]


@dataclass
class Model:
    """A posterior of a formula."""

    posterior: Posterior
    point: Formula


def model(function, inputs, blocks, levels=(), coefficients=0, most=10_000, surrogate=None):
    """Make the posterior of a formula, by it or by a surrogate of it."""
    names = tuple(UnknownInput(f"x{k}", k) for k in range(inputs))
    unknowns = Unknowns(names, coefficients, tuple(levels))
    point = Formula(function, inputs, most)
    case = MachineRecords(point, np.arange(inputs), tuple(blocks))
    return Model(Posterior(unknowns, (case,), (predictor(surrogate or function)(case),)), point)


def predictor(function):
    """Make what predicts the blocks of a case."""
    return lambda case: lambda normals: [function(normals)[:, one.columns] for one in case.blocks]


def builder(made, function):
    """Make what a search asks for: the posterior of some of the values, by a surrogate."""
    return lambda cases: Posterior(made.posterior.unknowns, cases, tuple(predictor(function)(one) for one in cases))
