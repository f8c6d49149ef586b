"""Measure the cost of evaluating an aligned chaos relative to a plain one of the same mechanism, points and times.

The mechanisms are the rotating slider-crank over 36 s, some 80 turns, and a double pendulum with two frequencies over
200 s.  Each has 10,000 points, at many output times and at few.  The tables also list the products of a value, which
bound the time.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/evaluation.py [--repeat 9] [--points 10000]``.
"""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

os.environ.setdefault("OMP_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import chaospy
import numpy as np
from horizons import mechanism_of
from measure import Contender, interleave, show

import uqmbd
from uqmbd.results import AlignedChaos, QuasiPeriodicChaos, surrogate
from uqmbd_collocation import Collocation
from uqmbd_joints import Revolute

COUNTS = (3601, 1201, 401)


def double_pendulum() -> uqmbd.Mechanism:
    """Return a double pendulum of point masses that starts from rest, at 17 degrees."""
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.98, 1.02), units="m")
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(0.95, 1.05), units="kg")
    angle = 0.3
    x, y = np.sin(angle), -np.cos(angle)
    made = uqmbd.Mechanism("double_pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    upper = made.body("upper", mass=mass, inertia=1e-9, position=(length * x, length * y), angle=angle)
    lower = made.body("lower", mass=1, inertia=1e-9, position=((length + 1) * x, (length + 1) * y), angle=angle)
    made.add(Revolute("pivot", made.ground, upper, point_i=(0, 0), point_j=(0, length)))
    made.add(Revolute("joint", upper, lower, point_i=(0, 0), point_j=(0, 1)))
    made.output("upper", upper.angle, units="rad")
    made.output("lower", lower.angle, units="rad")
    return made


Alignment = Literal["phase", "two-frequency"]


@dataclass(frozen=True)
class Case:
    """A mechanism, its last time (s), and its kind of alignment."""

    mechanism: uqmbd.Mechanism
    end: float
    alignment: Alignment


CASES = {
    "slider-crank, rotating": Case(mechanism_of("slider_crank_rotating"), 36.0, "phase"),
    "double pendulum": Case(double_pendulum(), 200.0, "two-frequency"),
}


def chaos(case: Case, name: str, count: int, alignment: Alignment | None) -> Any:
    """Compute a chaos of order 3."""
    times = np.linspace(0, case.end, count)
    study = uqmbd.Study(name, case.mechanism, times=times, rtol=1e-9, propagators=[])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the plain chaos warns of its error
        return surrogate(study.propagate(Collocation(order=3, alignment=alignment)))


def products(made: Any, count: int) -> str:
    """Return the least number of multiply-adds of a value, by the parts of an evaluation."""
    terms = len(made.multi_index)
    if isinstance(made, AlignedChaos):
        (element,) = made.elements
        segments, outputs, powers = element.segments.shape[1:]
        combined, basis = terms * segments * powers / count, powers / outputs
        return f"{combined:.3g} coefficients, {powers} sum, {basis:.3g} polynomials"
    if isinstance(made, QuasiPeriodicChaos):
        (one,) = made.elements
        # the even and odd parts about the middle of a block serve two times
        return f"{(np.abs(one.waves).max(axis=0) > 0).sum(axis=1).mean():.3g} sum"
    return f"{terms} sum"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, default=9)
    parser.add_argument("--points", type=int, default=10_000)
    options = parser.parse_args()
    for name, case in CASES.items():
        for count in COUNTS:
            ways: tuple[Alignment | None, ...] = (None, case.alignment)
            made = {alignment or "plain": chaos(case, name, count, alignment) for alignment in ways}
            germs = np.random.default_rng(1).uniform(-1.7, 1.7, (options.points, made["plain"].space.dimension))
            contenders = [
                Contender(label, partial(one.evaluate_germs, germs), "plain", notes=(products(one, count),))
                for label, one in made.items()
            ]
            interleave(contenders, options.repeat)
            show(f"{name}: {options.points} points, {count} times", contenders, ("products of a value",))


if __name__ == "__main__":
    main()
