"""Coefficients from realisations: projection and regression against closed forms and brute force."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from uqmbd import extend
from uqmbd.errors import StudyError


def legendre(x: np.ndarray, order: int) -> np.ndarray:
    """Return orthonormal Legendre polynomials of the uniform distribution on [-1, 1], from numpy."""
    return np.polynomial.legendre.legvander(x, order) * np.sqrt(2 * np.arange(order + 1) + 1)


def test_projection_recovers_a_polynomial() -> None:
    """A response within the span comes back exactly, in the shape (P, O, T)."""
    nodes, weights = np.polynomial.legendre.leggauss(6)
    psi = legendre(nodes, 5)
    true = np.random.default_rng(0).normal(size=(6, 2, 3))
    found = extend.project(np.einsum("kp,pot->kot", psi, true), psi, weights / 2)
    np.testing.assert_allclose(found, true, atol=1e-14)


def test_regression_recovers_a_polynomial() -> None:
    """So does regression at random points, with an error of rounding; and it agrees with numpy's solver."""
    x = np.random.default_rng(1).uniform(-1, 1, 20)
    psi = legendre(x, 5)
    true = np.random.default_rng(2).normal(size=(6, 2, 3))
    exact = np.einsum("kp,pot->kot", psi, true)
    fit = extend.least_squares(exact, psi)
    np.testing.assert_allclose(fit.coefficients, true, atol=1e-13)
    assert fit.leave_one_out.shape == (2, 3) and fit.leave_one_out.max() < 1e-25
    assert fit.condition == pytest.approx(np.linalg.cond(psi))
    noisy = exact + np.random.default_rng(3).normal(size=exact.shape)
    expected = np.linalg.lstsq(psi, noisy.reshape(20, -1), rcond=None)[0].reshape(6, 2, 3)
    np.testing.assert_allclose(extend.least_squares(noisy, psi).coefficients, expected, atol=1e-12)


def test_leave_one_out_is_what_its_name_says() -> None:
    """The error from the hat matrix is that of fitting anew without each sample, times the stated correction."""
    rng = np.random.default_rng(4)
    x = rng.uniform(-1, 1, 15)
    psi, response = legendre(x, 4), (np.exp(2 * x) + 0.1 * rng.normal(size=15))[:, None, None]
    left_out = []
    for k in range(15):
        others = np.arange(15) != k
        coefficients = np.linalg.lstsq(psi[others], response[others, 0, 0], rcond=None)[0]
        left_out.append(response[k, 0, 0] - psi[k] @ coefficients)
    relative = np.mean(np.square(left_out)) / np.var(response)
    correction = 15 / (15 - 5) * (1 + np.trace(np.linalg.inv(psi.T @ psi / 15)) / 15)
    found = extend.least_squares(response, psi).leave_one_out
    assert found[0, 0] == pytest.approx(relative * correction, rel=1e-10)


def test_leave_one_out_of_small_spreads() -> None:
    """A large mean takes no digits from the error; samples that agree have none; saturated fits cannot tell."""
    rng = np.random.default_rng(5)
    x = rng.uniform(-1, 1, 12)
    psi, spread = legendre(x, 3), np.exp(x)[:, None]
    small = extend.least_squares(1e3 + spread * 1e-3, psi).leave_one_out
    np.testing.assert_allclose(small, extend.least_squares(spread, psi).leave_one_out, rtol=1e-5)
    assert extend.least_squares(np.full((12, 1), 0.1), psi).leave_one_out.tolist() == [0.0]
    assert np.isinf(extend.least_squares(spread[:4], psi[:4]).leave_one_out).all()
    alone = np.concatenate([psi, np.eye(12)[:, :1]], axis=1)  # a term that only the first sample sees
    assert np.isinf(extend.least_squares(spread, alone).leave_one_out).all()


SCRIPT = """
import hashlib, numpy as np
from uqmbd import extend
rng = np.random.default_rng(0)
psi, response, weights = rng.normal(size=(700, 286)), rng.normal(size=(700, 3, 101)), rng.uniform(size=700)
fit = extend.least_squares(response, psi)
found = [extend.project(response, psi, weights), fit.coefficients, fit.leave_one_out]
print(hashlib.sha256(b"".join(a.tobytes() for a in found)).hexdigest())
"""


@pytest.mark.thorough
def test_bits_do_not_depend_on_threads() -> None:
    """One thread or two: the same bits."""
    hashes = set()
    for threads in ("1", "2"):
        env = os.environ | {f"{name}_NUM_THREADS": threads for name in ("OMP", "OPENBLAS", "MKL")}
        run = subprocess.run([sys.executable, "-c", SCRIPT], env=env, capture_output=True, text=True, check=True)
        hashes.add(run.stdout)
    assert len(hashes) == 1


def test_bad_input() -> None:
    """Sizes are said with both numbers; failed realisations are refused with their row."""
    psi = legendre(np.linspace(-1, 1, 4), 5)
    with pytest.raises(StudyError, match="there are 6 terms and 4 samples"):
        extend.least_squares(np.ones((4, 1)), psi)
    with pytest.raises(
        StudyError,
        match=r"'response' has the shape \(5, 1\), and 'psi' has the shape \(4, 6\); expected \(K, \.\.\.\) and \(K, P\)",
    ):
        extend.least_squares(np.ones((5, 1)), psi)
    with pytest.raises(StudyError, match="do not determine the 2 terms"):
        extend.least_squares(np.ones((4, 1)), np.ones((4, 2)))
    with pytest.raises(StudyError, match="'response' contains a number that is not finite in row 2"):
        extend.project([[1.0], [1.0], [np.nan], [1.0]], psi, np.ones(4))
    with pytest.raises(StudyError, match="one number for each of the 4 nodes"):
        extend.project(np.ones((4, 1)), psi, np.ones(3))
