"""Series of scalar quantities: one for each position along an axis, such as a frequency."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import Self

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions.timeless import is_scalar
from uqmbd.mechanism.expressions.user_values import shown
from uqmbd.names import SeriesPlace, check_units

__all__ = ["OutputSeries"]

TAKEN = ("bound", "input", "output", "probability", "propagator", "sample", "time")
"""Names of dimensions of results, which the axis of a series must not have."""


class OutputSeries(tuple[sympy.Expr, ...]):
    """Scalar quantities at positions along an axis, such as spectral densities over the frequency.

    `uqmbd.Mechanism.output` records a series as one scalar output for each position. Results find them together by the
    name of the series (`uqmbd.results.output`), and reports draw them over the axis.

    Parameters
    ----------
    quantities : iterable of expressions
        Scalar quantities.
    positions : sequence of float
        Increasing positions, one for each quantity.
    axis : str
        Name of the axis, such as ``"frequency"``, which becomes a dimension of results.
    units : str
        Units of the positions.

    Raises
    ------
    uqmbd.StudyError
        If the units or the name of the axis are invalid, or the positions do not increase.

    Examples
    --------
    >>> import uqmbd
    >>> found = uqmbd.extend.OutputSeries(map(uqmbd.eigenfrequency, (1, 2)), [1, 2], "mode", "1")
    >>> len(found), found.positions, found.axis
    (2, (1.0, 2.0), 'mode')
    """

    positions: tuple[float, ...]
    axis: str
    units: str

    def __new__(cls, quantities: Iterable[sympy.Expr], positions: Sequence[float], axis: str, units: str) -> Self:
        """Store the quantities and their positions."""
        self = super().__new__(cls, quantities)
        where = f"series over {axis}"
        if not isinstance(axis, str) or not axis.isidentifier() or axis in TAKEN:
            raise StudyError(
                f"OutputSeries: axis is {axis!r}; expected a name for a dimension of the results, such as 'frequency'. "
                f"The names {', '.join(map(repr, TAKEN))} are reserved."
            )
        self.positions = tuple(map(float, positions))
        self.axis, self.units = axis, check_units(units, where)
        if len(self.positions) != len(self):
            raise StudyError(
                f"{where}: {len(self.positions)} positions are given for {len(self)} quantities; expected one for each."
            )
        if not all(a < b for a, b in itertools.pairwise(self.positions)):
            raise StudyError(f"{where}: the positions are {shown(self.positions)}; expected increasing numbers.")
        return self

    def named(self, name: str) -> dict[str, tuple[sympy.Expr, SeriesPlace]]:
        """Return the quantities and their places by the names of their outputs, such as ``psd at 0.5 Hz``.

        Parameters
        ----------
        name : str
            Name of the series.

        Raises
        ------
        uqmbd.StudyError
            If an expression changes with time.

        Examples
        --------
        >>> import uqmbd
        >>> list(uqmbd.extend.OutputSeries([uqmbd.eigenfrequency(1)], [0.5], "speed", "m/s").named("rate"))
        ['rate at 0.5 m/s']
        """
        for quantity in self:
            if not is_scalar(quantity):
                raise StudyError(
                    f"output {name!r}: {shown(quantity)} is not a scalar quantity; a series contains only quantities "
                    "without a time, such as a standard deviation or an eigenfrequency."
                )
        units = "" if self.units in ("", "1") else f" {self.units}"
        digits = next(
            (k for k in range(6, 18) if len({f"{x:.{k}g}" for x in self.positions}) == len(self.positions)), 17
        )
        return {
            f"{name} at {position:.{digits}g}{units}": (quantity, SeriesPlace(name, position, self.axis, self.units))
            for quantity, position in zip(self, self.positions, strict=True)
        }
