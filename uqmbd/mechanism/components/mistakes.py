"""Advice on operations that are impossible with symbols, for errors in the terms of a component."""

from __future__ import annotations

__all__ = ["remedy"]

EXPECTED = "It is to yield terms (Kinetic, Potential, VirtualWork, Constraint, ...) that are written in what p offers."
"""Advice if no other applies."""

REMEDIES = (
    (
        "truth value",
        "Python's if, min, max and comparisons cannot decide on symbols: write sympy.Piecewise, sympy.Min, sympy.Max, "
        "or uqmbd.step for a smooth change.",
    ),
    (
        "loop of ufunc",
        "NumPy's functions take no symbols: write those of SymPy, sympy.sqrt for numpy.sqrt.",
    ),
    (
        "Cannot convert expression to float",
        "Functions of math, and float, take no symbols: write those of SymPy, sympy.sqrt for math.sqrt.",
    ),
    (
        "object is not iterable",
        f"Is `yield` missing, or `return` written for it? {EXPECTED}",
    ),
)
"""Parts of error messages of Python, NumPy and SymPy, and the advice for each."""


def remedy(error: Exception) -> str:
    """Return advice on the terms of a component, chosen by the message of Python's error.

    >>> remedy(TypeError("cannot determine truth value of Relational: x < 1"))[:45]
    "Python's if, min, max and comparisons cannot "
    >>> remedy(ValueError("?")) == EXPECTED
    True
    """
    return next((words for part, words in REMEDIES if part in str(error)), EXPECTED)
