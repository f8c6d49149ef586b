"""Functions of random inputs as the output of a body at rest, so that the answer is known and costs nothing."""

from __future__ import annotations

import warnings
from concurrent.futures import Executor, Future

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.results import PolynomialChaos

from ..mechanisms import driven_slider_crank


def resting_body(function, *distributions, times=(0.0, 1.0), **outputs):
    """A study whose output ``y`` is a function of inputs ``x0, x1, ...``, and others that are given by name."""
    inputs = [uqmbd.RandomVariable(f"x{k}", one) for k, one in enumerate(distributions)]
    mechanism = uqmbd.Mechanism("body at rest", uqmbd.Translational())
    body = mechanism.body("body", mass=1)
    for name, one in {"y": function, **outputs}.items():
        # the position is zero: an output is made of what a body does
        mechanism.output(name, one(*inputs) + 0 * body.position[0])
    return uqmbd.Study("resting", mechanism, times)


class Inline(Executor):
    """An executor that computes at once, counts, and gives up after so many chunks."""

    def __init__(self, most=10**9):
        self.chunks, self.most = 0, most

    def submit(self, function, /, *arguments, **named):
        """Compute."""
        if self.chunks == self.most:
            raise RuntimeError(f"no more than {self.most} chunks")
        self.chunks += 1
        future = Future()
        future.set_result(function(*arguments, **named))
        return future


@pytest.fixture(scope="session")
def resting():
    """Make a study of a function."""
    return resting_body


@pytest.fixture(scope="session")
def locking():
    """A slider-crank of which rods below 0.15 m lock: the study for a distribution of the rod's length."""

    def make(low, high):
        length = uqmbd.RandomVariable("rod_length", chaospy.Uniform(low, high), units="m")
        return uqmbd.Study("locking", driven_slider_crank(length), np.linspace(0, np.pi / 2, 9))

    return make


@pytest.fixture(scope="session")
def inline():
    """The class of an executor that counts chunks."""
    return Inline


@pytest.fixture(scope="session")
def chaos_of():
    """Read the chaos of a node."""
    return lambda node: PolynomialChaos.from_dataset(node["chaos"])


@pytest.fixture
def warned():
    """Do something, and return what it gave and the warnings that it made, as text."""

    def run(do):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            result = do()
        return result, [f"{one.category.__name__}: {one.message}" for one in caught]

    return run
