"""Write the units of variables of results to ``attrs["units"]``, as read by CF tools, xarray and pint-xarray.

A variable along ``output`` has the units of its outputs. If these units differ, only the coordinate ``output_units``
states them. If they are equal, or one output is selected, the attribute states them, too.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

import numpy as np
import xarray as xr

__all__ = ["CF", "DIMENSIONLESS", "Role", "as_text", "product_of_units", "united", "units_of", "with_units"]

CF = "CF-1.11"
"""Conventions of datasets whose variables have one unit each."""

DIMENSIONLESS = "1"

Role = Literal["output", "output ** 2", "output / s", "output / input", "scalar", "input", "s", "1"]
"""Kind of the units of a variable: units of its outputs, their square, ..., or a fixed unit."""

_ROLES: Mapping[Role, tuple[str, ...]] = {
    "output": (
        *("mean", "std", "quantile", "quantile_error", "std_error_mean", "std_error_std", "smallest", "largest"),
        "quantile_interval",
        *(
            "circular_mean",
            "circular_std",
            "integration_error",
            "integration_error_rms",
            "stated_error",
            "response",
            "verification_response",
            "output_angle",
        ),
        *("coefficients", "segment_coefficients", "constant_coefficients", "cosine_coefficients", "sine_coefficients"),
        *("mean_difference_max", "mean_difference_l2", "std_difference_max", "std_difference_l2"),
        *("quantile_difference_max", "reference_std_max", "wasserstein"),
    ),
    "output ** 2": ("variance", "energy", "energy_germ"),
    "output / s": ("drift_coefficients",),
    "output / input": ("gradient",),
    "scalar": (
        *("scalar_mean_difference", "scalar_std_difference", "scalar_reference_std", "scalar_integration_error"),
    ),
    "input": ("inputs",),
    "s": ("stated_error_time",),
    "1": (
        *("skewness", "kurtosis", "sobol_first", "sobol_total", "sobol_second", "sobol_first_germ"),
        *(
            "sobol_total_germ",
            "sobol_second_germ",
            "sobol_first_interval",
            "sobol_total_interval",
            "verification_error",
            "verification_factor",
            "integration_error_factor",
            "leave_one_out",
        ),
        *("censored", "censored_bound", "verification_weights", "verification_germs", "germs"),
        *("mean_relative_l2", "std_relative_l2", "own_error", "stated_error_max", "detectable", "ks", "ks_by_chance"),
        *("violation_probability", "violated_by", "violated_by_interval"),
    ),
}
_ROLE = {name: role for role, names in _ROLES.items() for name in names}
_PLAIN = re.compile(r"[^\s*/^().·]+")


def product_of_units(over: str, under: str = DIMENSIONLESS, power: int = 1) -> str:
    """Return the units of a quotient or a power as text that pint and UDUNITS read; empty if a unit is unknown.

    `over`, `under`: units, empty if unknown; `power`: exponent of `over`.

    >>> product_of_units("m", "kg"), product_of_units("m/s", "N/m"), product_of_units("1", "kg")
    ('m/kg', '(m/s)/(N/m)', '1/kg')
    >>> product_of_units("m", power=2), product_of_units("m/s", power=2), product_of_units("1", power=2)
    ('m^2', '(m/s)^2', '1')
    >>> product_of_units("m", "m"), product_of_units("", "m")
    ('1', '')
    """
    if not over or not under:
        return ""
    if over == under and power == 1:
        return DIMENSIONLESS
    first = over if over == DIMENSIONLESS or power == 1 else f"{_enclosed(over)}^{power}"
    if under == DIMENSIONLESS:
        return first
    return f"{first if power != 1 or over == DIMENSIONLESS else _enclosed(over)}/{_enclosed(under)}"


def _enclosed(units: str) -> str:
    return units if _PLAIN.fullmatch(units) else f"({units})"


def units_of(variable: xr.DataArray) -> str | None:
    """Return the unit of a variable of results from its name and coordinates.

    `variable`: array with the coordinates ``output_units`` and ``input_units``, if it has outputs and inputs. The
    result is None for variables that are not in the schema, or without these coordinates; their attribute ``units`` is
    then valid. The result is empty if there are several units, or if units are unknown.

    >>> from uqmbd.extend import labels, statistics_dataset
    >>> both = statistics_dataset(labels([("x", "m"), ("F", "N")], [], [0.0]), mean=[[0.0], [1.0]], std=[[1.0], [1.0]])
    >>> units_of(both["std"]), units_of(both["variance"].sel(output="x")), units_of(both["kurtosis"])
    ('', 'm^2', '1')
    """
    coords = {str(name): _texts(one.variable) for name, one in variable.coords.items() if str(name).endswith("_units")}
    return _one_unit(str(variable.name), coords)


def _one_unit(name: str, coordinates: Mapping[str, Sequence[str]]) -> str | None:
    """Return the one unit of a variable by its name and coordinates of units; see :func:`units_of`."""
    role = _ROLE.get(name)
    if role is None:
        return None
    if role in ("1", "s"):
        return role
    kind, _, rest = role.partition(" ")
    first = coordinates.get(f"{kind}_units")
    if first is None:
        return None
    if rest == "** 2":
        return _one(product_of_units(units, power=2) for units in first)
    if rest == "/ s":
        return _one(product_of_units(units, "s") for units in first)
    if rest == "/ input":
        others = coordinates.get("input_units", [""])
        return _one(product_of_units(over, under) for over in first for under in others)
    return _one(first)


def united(data: xr.Dataset, *, copy: bool = True) -> xr.Dataset:
    """Write the unit of each variable of the schema with a single unit into ``attrs["units"]``.

    Variables that are not in the schema keep their attribute. Without `copy`, the dataset itself is changed.

    >>> import xarray
    >>> data = xarray.Dataset({"mean": ("output", [1.0, 2.0]), "mine": ("output", [1.0, 2.0], {"units": "K"})},
    ...                       coords={"output_units": ("output", ["m", "m"])})
    >>> {str(name): variable.attrs for name, variable in united(data).data_vars.items()}
    {'mean': {'units': 'm'}, 'mine': {'units': 'K'}}
    """
    # use variables instead of data arrays, which would select their coordinates each time
    known = {str(name): one for name, one in data.variables.items() if str(name).endswith("_units")}
    units = {name: (set(one.dims), _texts(one)) for name, one in known.items() if name in data.coords}
    changed = {}
    for name, variable in data.variables.items():
        if name not in _ROLE:
            continue
        own = {key: texts for key, (dims, texts) in units.items() if dims <= set(variable.dims)}
        unit = _one_unit(str(name), own)
        if unit is not None and unit != variable.attrs.get("units", ""):
            changed[name] = unit
    if not changed:
        return data
    found = data.copy() if copy else data
    for name, unit in changed.items():
        attrs = {key: value for key, value in found.variables[name].attrs.items() if key != "units"}
        found.variables[name].attrs = {**attrs, **({"units": unit} if unit else {})}
    return found


def as_text(data: xr.Dataset, *, copy: bool = True) -> xr.Dataset:
    """Convert text to the type `string`, because Zarr format 3 does not define fixed-width text.

    Without `copy`, the dataset itself is changed.

    >>> import xarray
    >>> as_text(xarray.Dataset(coords={"output": ["x"]}))["output"].encoding
    {'dtype': 'O'}
    """
    texts = [name for name, one in data.variables.items() if one.dtype.kind == "U" and one.encoding != {"dtype": "O"}]
    if not texts:
        return data
    found = data.copy() if copy else data
    for name in texts:
        found.variables[name].encoding = {"dtype": "O"}
    return found


def with_units(tree: xr.DataTree) -> xr.DataTree:
    """Write the units of the variables of all nodes of a result, as :func:`united` does, in place.

    The function also converts text by :func:`as_text`.

    >>> from uqmbd.extend import labels, statistics_dataset
    >>> data = statistics_dataset(labels([("x", "m")], [], [0.0]), mean=[[0.0]], std=[[1.0]]).drop_attrs()
    >>> with_units(xr.DataTree.from_dict({"mine/statistics": data}))["mine/statistics/std"].attrs
    {'units': 'm'}
    """
    for node in tree.subtree:
        if node.data_vars:
            data = node.to_dataset(inherit=False)
            if (found := as_text(united(data))) is not data:
                node.dataset = found
    return tree


def _texts(units: xr.Variable) -> list[str]:
    return [str(x) for x in np.atleast_1d(units.values)]


def _one(units: Iterable[str]) -> str:
    """Return the common unit; empty if units differ."""
    found = set(units)
    return found.pop() if len(found) == 1 else ""
