"""Kernels compute what SymPy, NumPy and the C library say, in all eight lanes and for numbers of all kinds."""

from __future__ import annotations

import ctypes
import math
import pickle

import numpy as np
import pytest
import symengine as se
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from uqmbd import StudyError
from uqmbd.compiled import LANES, Kernel, compile_kernel, compile_operations

X, Y = sympy.symbols("x y", real=True)


def lanes(kernel: Kernel, arguments: np.ndarray) -> np.ndarray:
    """Evaluate rows (n, 8) as the driver does."""
    memory = [np.zeros((rows + 1) * LANES) for rows in (kernel.inputs, kernel.outputs)]
    x, y = (m[(s := -(m.ctypes.data // 8) % LANES) : s + len(m) - LANES].reshape(-1, LANES) for m in memory)
    x[:] = arguments
    ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(kernel.address)(x.ctypes.data, y.ctypes.data)
    return y


def of(*expressions: sympy.Expr) -> Kernel:
    return compile_kernel(se.symbols("x y"), [se.sympify(e) for e in expressions])


@settings(deadline=None, max_examples=30)
@given(st.integers(1, 11), st.integers(0, 2**32 - 1))
def test_a_compiled_elimination_solves_its_systems(size: int, seed: int) -> None:
    """Eight dense systems at once, against LAPACK; large ones are cut into blocks and parts of rows."""
    rng = np.random.default_rng(seed)
    matrix, right = rng.normal(size=(LANES, size, size)) + 2 * size * np.eye(size), rng.normal(size=(LANES, size))
    entry = {(i, j): i * size + j for i in range(size) for j in range(size)} | {
        (i, size): size**2 + i for i in range(size)
    }
    given_values = size**2 + size
    operations: list[tuple[str, int, int, int]] = []

    def made(kind: str, a: int, b: int = -1, c: int = -1) -> int:
        operations.append((kind, a, b, c))
        return given_values + len(operations) - 1

    inverses = []
    for k in range(size):  # by Gauss and Jordan
        inverses.append(made("inverse", entry[k, k]))
        for i in set(range(size)) - {k}:
            factor = made("product", entry[i, k], inverses[k])
            for j in range(k + 1, size + 1):
                entry[i, j] = made("difference", entry[i, j], factor, entry[k, j])
    found = [made("product", entry[k, size], inverses[k]) for k in range(size)]
    kernel = compile_operations(operations, range(given_values), found, given_values)
    arguments = np.concatenate([matrix.reshape(LANES, -1), right], axis=1).T
    np.testing.assert_allclose(lanes(kernel, arguments).T, np.linalg.solve(matrix, right[..., None])[..., 0], rtol=1e-9)


FUNCTIONS = {
    "sin": math.sin, "cos": math.cos, "tan": math.tan, "asin": math.asin, "acos": math.acos, "atan": math.atan,
    "sinh": math.sinh, "cosh": math.cosh, "tanh": math.tanh, "asinh": math.asinh, "acosh": math.acosh,
    "atanh": math.atanh, "exp": math.exp, "log": math.log, "erf": math.erf, "erfc": math.erfc, "gamma": math.gamma,
    "loggamma": math.lgamma, "Abs": abs, "floor": math.floor, "ceiling": math.ceil, "sqrt": math.sqrt,
}  # fmt: skip


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_are_those_of_the_c_library(name: str) -> None:
    """In every lane on its own, outside of their domain too."""
    kernel = of(getattr(sympy, name)(X))
    for values in np.array(
        [[0.1, 0.5, 0.9, 1.5, 3.5, 20.0, -0.3, -2.5], [-1.0, 1.0, 0.0, 7.25, -7.25, 1e-8, 40.0, 1e5]]
    ):
        found = lanes(kernel, np.array([values, values]))[0]
        for x, y in zip(values, found, strict=True):
            try:
                expected = FUNCTIONS[name](float(x))
            except OverflowError:
                expected = math.inf
            except ValueError:
                assert not math.isfinite(y)
                continue
            assert y == pytest.approx(expected, rel=4e-15, abs=2e-15)


def test_conditions_choose_lane_by_lane() -> None:
    kernel = of(
        sympy.Piecewise((X, (X > 0) & (Y <= 1)), (Y, (X < -1) | sympy.Ne(Y, 2)), (7, True)),
        sympy.Piecewise((1, sympy.Xor(X > 0, Y > 0)), (2, ~sympy.Eq(X, 0))),
        sympy.Max(X, Y, 1) - sympy.Min(X, 2 * Y),
        sympy.sign(X) * sympy.atan2(Y, X),
    )
    x = np.array([1.0, -2.0, 0.5, 0.0, -0.5, np.nan, 3.0, -0.0])
    y = np.array([0.5, 3.0, 2.0, 2.0, 2.0, 1.0, np.inf, -1.0])
    first, second, third, fourth = lanes(kernel, np.array([x, y]))
    np.testing.assert_array_equal(first, [1.0, 3.0, 7.0, 7.0, 7.0, 1.0, np.inf, -1.0])
    # a comparison with NaN does not hold
    np.testing.assert_array_equal(second, [2.0, 1.0, 2.0, 1.0, 1.0, 1.0, 2.0, np.nan])
    with np.errstate(invalid="ignore"):
        extremes = np.maximum(np.maximum(x, y), 1.0) - np.minimum(x, 2 * y)
        np.testing.assert_array_equal(third, extremes)
        np.testing.assert_allclose(fourth, np.sign(x) * np.arctan2(y, x), rtol=1e-15)


@settings(deadline=None, max_examples=20)
@given(st.fractions(-70, 70, max_denominator=3))
def test_powers(exponent) -> None:
    x = np.array([0.0, 1.0, 0.3, 2.0, 10.0, 0.97, 1.1, 3.0])
    found = lanes(of(X ** sympy.Rational(exponent)), np.array([x, x]))[0]
    with np.errstate(divide="ignore"):
        np.testing.assert_allclose(found, x ** float(exponent), rtol=5e-15)


def test_lanes_do_not_see_one_another() -> None:
    """The bits of a lane do not change with what stands beside it, nor with its place."""
    kernel = of(sympy.sin(X) * Y + X / Y, sympy.sqrt(X) ** 3 - Y * X)
    values = np.random.default_rng(1).uniform(0.1, 2.0, (2, LANES))
    together = lanes(kernel, values)
    for lane in range(LANES):
        alone = np.full((2, LANES), np.nan)
        alone[:, LANES - 1 - lane] = values[:, lane]
        np.testing.assert_array_equal(lanes(kernel, alone)[:, LANES - 1 - lane], together[:, lane])


def test_a_kernel_survives_pickling_as_code() -> None:
    kernel = of(X + 2 * Y)
    again = pickle.loads(pickle.dumps(kernel))
    assert again == kernel and again.address == kernel.address
    assert compile_kernel([], []).address == 0


def test_what_cannot_be_computed_is_named() -> None:
    with pytest.raises(StudyError, match=r"besselj"):
        of(X + sympy.besselj(0, Y))
    with pytest.raises(StudyError, match=r"not a real number"):
        of(sympy.I * X)
    with pytest.raises(StudyError, match=r"the symbol z, which is not an argument"):
        of(X + sympy.Symbol("z"))


def test_terms_that_the_search_for_common_subexpressions_loses_are_kept() -> None:
    """Derivatives may hold sums whose terms are not collected: the kernel is compared with a plain evaluation."""
    x, y = se.symbols("x y")
    kernel = compile_kernel([x, y], [e := ((x + y) ** 2 * se.sin(x * y)).diff(x).diff(y), e**2])
    found = lanes(kernel, np.full((2, LANES), 0.7))[:, 3]
    exact = float(e.subs({x: 0.7, y: 0.7}))
    np.testing.assert_allclose(found, [exact, exact**2], rtol=1e-13)
