"""Advice on impossible operations with symbols, for errors in the terms of a component."""

from __future__ import annotations

__all__ = ["remedy"]

EXPECTED = (
    "The method terms() must yield terms (Kinetic, Potential, VirtualWork, Constraint, ...) that are functions of "
    "the quantities of p."
)
"""Advice on an error of unknown cause."""

REMEDIES = (
    (
        "truth value",
        "Python's if, min, max and comparisons do not support symbols. Use sympy.Piecewise, sympy.Min, sympy.Max, "
        "or uqmbd.step for a smooth change.",
    ),
    (
        "loop of ufunc",
        "NumPy functions do not support symbols. Use SymPy functions, such as sympy.sqrt instead of numpy.sqrt.",
    ),
    (
        "Cannot convert expression to float",
        "float() and functions of the module math do not support symbols. Use SymPy functions, such as sympy.sqrt "
        "instead of math.sqrt.",
    ),
    (
        "object is not iterable",
        f"Check that the method uses `yield`, not `return`. {EXPECTED}",
    ),
)
"""Parts of error messages of Python, NumPy and SymPy, and the advice for each."""


def remedy(error: Exception) -> str:
    """Return advice on an error in the terms of a component, chosen by the message of Python.

    >>> remedy(TypeError("cannot determine truth value of Relational: x < 1"))[:45]
    "Python's if, min, max and comparisons do not "
    >>> remedy(ValueError("?")) == EXPECTED
    True
    """
    return next((words for part, words in REMEDIES if part in str(error)), EXPECTED)
