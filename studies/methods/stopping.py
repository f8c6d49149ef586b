"""Compare stated errors of refinements that ended at an accuracy with errors at fresh points.

Run with ``python -m studies.methods.stopping [NAME ...] [--accuracy 0.1] [--seeds 20]``.  A refinement ends when the
error at its verification points is small enough, which selects favourable errors.  Fresh points show how much.
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np

import uqmbd
from uqmbd.results import stated_accuracy, surrogate
from uqmbd_collocation import Collocation

from .cases import CASES, Reference
from .runs import answers, largest
from .truths import load_truth

__all__ = ["fresh_ratio"]

NAMES = "six inputs", "damped oscillator", "long tail"
POINTS, STREAM = 256, 991
"""Number of fresh points, and their random stream."""


def fresh_ratio(mechanism: str, accuracy: float, seed: int) -> tuple[float, float, float]:
    """Return stated error, root mean square at fresh points, and true error of mean and standard deviation."""
    reference, truth = Reference(CASES[mechanism]), load_truth(mechanism)
    study = reference.study()
    node = study.propagate(Collocation(adaptive="dimension", max_error=0.9 * accuracy, seed=seed))
    true = max(largest(answers(node)[question], truth, question)[0] for question in ("mean", "std"))
    chaos = surrogate(node)
    points = uqmbd.extend.VerificationPoints.drawn(chaos.space, POINTS, seed, STREAM)
    found = study.problem(Collocation()).realise(chaos.space.to_inputs(points.germs))
    weights = points.weights[found.good] / points.weights[found.good].sum()
    wrong = chaos.evaluate_germs(points.germs[found.good]) - found.response[found.good]
    error = np.sqrt(np.tensordot(weights, wrong**2, axes=1)).max(axis=1)
    scale, moves = chaos.std.max(axis=1), chaos.std.max(axis=1) > 1e-9 * np.abs(chaos.mean).max(axis=1)
    return stated_accuracy(node, rtol=study.rtol).value, float((error[moves] / scale[moves]).max()), true


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=NAMES, help="mechanisms with outputs over time")
    parser.add_argument("--accuracy", type=float, default=0.1)
    parser.add_argument("--seeds", type=int, default=20)
    options = parser.parse_args()
    for name in options.names:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = np.array([fresh_ratio(name, options.accuracy, seed) for seed in range(options.seeds)])
        ratio, above = found[:, 1] / found[:, 0], np.mean(found[:, 1] > options.accuracy)
        print(
            f"{name}: fresh over stated error {np.median(ratio):.2f}, at most {ratio.max():.2f}; above the accuracy in "
            f"{100 * above:.0f} %; true error at most {found[:, 2].max() / options.accuracy:.2f} of the accuracy"
        )


if __name__ == "__main__":
    main()
