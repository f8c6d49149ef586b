"""Accessor ``.uqmbd`` of xarray data, with methods for one output, a variable for each output, and the surrogate.

Importing `uqmbd.results` registers the accessor, and each function that makes or reads results imports this package. A
script that opens a file by xarray alone needs ``import uqmbd.results``: ``import uqmbd`` imports neither xarray nor
modules that need it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.results.chaos import ComposedChaos, Part, surrogate
from uqmbd.results.selection import by_output, output

__all__ = ["Accessor"]


@typechecked
@xr.register_datatree_accessor("uqmbd")  # type: ignore[no-untyped-call]  # of xarray
@xr.register_dataset_accessor("uqmbd")  # type: ignore[no-untyped-call]  # of xarray
@xr.register_dataarray_accessor("uqmbd")  # type: ignore[no-untyped-call]  # of xarray
class Accessor:
    """``data.uqmbd``: functions of `uqmbd.results` as methods of data.

    Parameters
    ----------
    data : xarray.DataTree, xarray.Dataset or xarray.DataArray
        Results of uqmbd.

    Examples
    --------
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> data = statistics_dataset(labels([("x", "m"), ("F", "N")], [], [0.0]), mean=[[0.0], [1.0]], std=[[1.0], [2.0]])
    >>> data.uqmbd.output("F")["std"].attrs["units"], list(data.uqmbd.by_output("mean"))
    ('N', ['x', 'F'])
    """

    def __init__(self, data: Any) -> None:
        self._data = data

    def output(self, name: str, *, input: str | None = None) -> xr.Dataset | xr.DataArray:
        """Return one output with its unit; see :func:`uqmbd.results.output`.

        Parameters
        ----------
        name : str
            Name of the output.
        input : str, optional
            Name of the input to select in variables along ``input``.

        Returns
        -------
        xarray.Dataset, or xarray.DataArray of one
            The output, or a DataArray if `data` is one.
        """
        found: xr.Dataset | xr.DataArray = output(self._data, name, input=input)
        return found

    def by_output(self, variable: str = "mean") -> xr.Dataset:
        """Return a variable for each output; see :func:`uqmbd.results.by_output`."""
        return by_output(self._data, variable)

    def surrogate(self, output: str | None = None, times: Sequence[int] | None = None) -> Part | ComposedChaos:
        """Return the surrogate of the method of this node; see :func:`uqmbd.results.surrogate`.

        Parameters
        ----------
        output : str, optional
            Name of the only output to read. Default: all.
        times : sequence of int, optional
            Indices of the times to read. Default: all.

        Raises
        ------
        uqmbd.StudyError
            If the data is not the node of a method with a surrogate.
        """
        return surrogate(self._data, output, times)
