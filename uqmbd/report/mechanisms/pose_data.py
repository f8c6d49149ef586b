"""Poses of a mechanism as arrays, before they become xarray data.

Drawings read only few properties of a dataset, and `PoseData` has these properties. The viewer draws from it, because
the import of xarray takes an eighth of the time until the first drawing. Stored motions are datasets.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["PoseData", "PoseVariable"]


@dataclass(frozen=True)
class PoseVariable:
    """Array with names of its dimensions."""

    dims: tuple[str, ...]
    values: NDArray[Any]
    attrs: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, given: Any) -> PoseVariable:
        """Return the variable of an entry of `xarray.Dataset`: dimensions, values, and attributes if there are any."""
        dims, values, *attrs = given
        return cls((dims,) if isinstance(dims, str) else tuple(dims), np.asarray(values), *attrs)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the array."""
        return self.values.shape

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, row: int) -> NDArray[Any]:
        return np.asarray(self.values[row])


@dataclass(frozen=True)
class PoseData:
    """Poses with the variables and attributes that the module `body_poses` describes.

    >>> data = PoseData.of({"local": (("realisation", "axis"), [[1.0, 2.0]])}, {"axis": ["x", "y"]}, {"note": ""})
    >>> data.sizes, "local" in data, data.to_dataset()["local"].sel(axis="y").item()
    ({'realisation': 1, 'axis': 2}, True, 2.0)
    """

    variables: Mapping[str, PoseVariable]
    coords: Mapping[str, PoseVariable]
    attrs: Mapping[str, Any]

    @classmethod
    def of(cls, data: Mapping[str, Any], coords: Mapping[str, Any], attrs: Mapping[str, Any]) -> PoseData:
        """Return poses from the arguments of `xarray.Dataset`."""
        labelled = {k: PoseVariable.of(x if isinstance(x, tuple) else (k, x)) for k, x in coords.items()}
        return cls({k: PoseVariable.of(x) for k, x in data.items()}, labelled, attrs)

    @property
    def sizes(self) -> dict[str, int]:
        """Sizes of the dimensions."""
        known = (*self.variables.values(), *self.coords.values())
        return {name: size for one in known for name, size in zip(one.dims, one.shape, strict=True)}

    def __contains__(self, name: str) -> bool:
        return name in self.variables or name in self.coords

    def __iter__(self) -> Iterator[str]:
        return iter(self.variables)

    def __getitem__(self, name: str) -> PoseVariable:
        return self.variables[name] if name in self.variables else self.coords[name]

    def isel(self, realisation: slice | Sequence[int]) -> PoseData:
        """Return the poses of some realisations."""

        def selected(one: PoseVariable) -> PoseVariable:
            if "realisation" not in one.dims:
                return one
            return PoseVariable(one.dims, np.asarray(one.values[realisation]), one.attrs)

        return PoseData({name: selected(one) for name, one in self.variables.items()}, self.coords, self.attrs)

    def to_dataset(self) -> xr.Dataset:
        """Return the poses as xarray data."""
        import xarray

        data, coords = (
            {name: (one.dims, one.values, dict(one.attrs)) for name, one in group.items()}
            for group in (self.variables, self.coords)
        )
        return xarray.Dataset(data, coords, self.attrs)
