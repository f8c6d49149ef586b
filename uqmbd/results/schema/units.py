"""Units of the variables of results: ``attrs["units"]``, as CF conventions, xarray and pint-xarray read it.

A variable along ``output`` has the units of its outputs.  Where these differ no attribute can say them, and the
coordinate ``output_units`` does; where they are the same, or one output is chosen, the attribute does.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Literal

import numpy as np
import xarray as xr

__all__ = ["CF", "DIMENSIONLESS", "Role", "as_text", "product_of_units", "united", "units_of", "with_units"]

CF = "CF-1.11"
"""Conventions of datasets whose variables have one unit each."""

DIMENSIONLESS = "1"

Role = Literal["output", "output ** 2", "output / s", "output / input", "scalar", "input", "s", "1"]
"""Kind of the units of a variable: those of its outputs, of these squared, ..., or a unit."""

_ROLES: Mapping[Role, tuple[str, ...]] = {
    "output": (
        *("mean", "std", "quantile", "quantile_error", "std_error_mean", "std_error_std", "smallest", "largest"),
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
        *("violation_probability", "violated_by"),
    ),
}
_ROLE = {name: role for role, names in _ROLES.items() for name in names}
_PLAIN = re.compile(r"[^\s*/^().·]+")


def product_of_units(over: str, under: str = DIMENSIONLESS, power: int = 1) -> str:
    """Write the units of a quotient or a power as text that pint and UDUNITS read; unknown units give unknown ones.

    `over`, `under`: units; empty: not known; `power`: of the first.

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
    """Return the one unit of a variable of results, by its name and the coordinates that it has.

    `variable`: with the coordinates ``output_units`` and ``input_units`` of its outputs and inputs, where it has
    some. Return none: the schema does not know the variable, and what it says itself holds.  Empty: there are
    several, or the units are not known.

    >>> from uqmbd.extend import labels, statistics_dataset
    >>> both = statistics_dataset(labels([("x", "m"), ("F", "N")], [], [0.0]), mean=[[0.0], [1.0]], std=[[1.0], [1.0]])
    >>> units_of(both["std"]), units_of(both["variance"].sel(output="x")), units_of(both["kurtosis"])
    ('', 'm^2', '1')
    """
    role = _ROLE.get(str(variable.name))
    if role is None:
        return None
    if role in ("1", "s"):
        return role
    kind, _, rest = role.partition(" ")
    given = variable.coords.get(f"{kind}_units")
    if given is None:
        return None
    first = _texts(given)
    if rest == "** 2":
        return _one(product_of_units(units, power=2) for units in first)
    if rest == "/ s":
        return _one(product_of_units(units, "s") for units in first)
    if rest == "/ input":
        others = _texts(variable.coords["input_units"]) if "input_units" in variable.coords else [""]
        return _one(product_of_units(over, under) for over in first for under in others)
    return _one(first)


def united(data: xr.Dataset) -> xr.Dataset:
    """Write the unit of each variable of the schema that has a single one into ``attrs["units"]``.

    A variable that the schema does not know keeps what it says.

    >>> import xarray
    >>> data = xarray.Dataset({"mean": ("output", [1.0, 2.0]), "mine": ("output", [1.0, 2.0], {"units": "K"})},
    ...                       coords={"output_units": ("output", ["m", "m"])})
    >>> {str(name): variable.attrs for name, variable in united(data).data_vars.items()}
    {'mean': {'units': 'm'}, 'mine': {'units': 'K'}}
    """
    found = data.copy()
    for name in found.variables:
        if name not in _ROLE:
            continue
        units = units_of(found[name])
        if units is None:
            continue
        attrs = {key: value for key, value in found.variables[name].attrs.items() if key != "units"}
        found[name].attrs = {**attrs, **({"units": units} if units else {})}
    return found


def as_text(data: xr.Dataset) -> xr.Dataset:
    """Convert text to the type `string`, because Zarr's format 3 does not define text of fixed width.

    >>> import xarray
    >>> as_text(xarray.Dataset(coords={"output": ["x"]}))["output"].encoding
    {'dtype': 'O'}
    """
    found = data.copy()
    for variable in found.variables.values():
        if variable.dtype.kind == "U":
            variable.encoding = {"dtype": "O"}
    return found


def with_units(tree: xr.DataTree) -> xr.DataTree:
    """Write the units of the variables of all nodes of a result, as :func:`united` does, in place.

    Text is stored as such, too, by :func:`as_text`.

    >>> from uqmbd.extend import labels, statistics_dataset
    >>> data = statistics_dataset(labels([("x", "m")], [], [0.0]), mean=[[0.0]], std=[[1.0]]).drop_attrs()
    >>> with_units(xr.DataTree.from_dict({"mine/statistics": data}))["mine/statistics/std"].attrs
    {'units': 'm'}
    """
    for node in tree.subtree:
        if node.data_vars:
            node.dataset = as_text(united(node.to_dataset(inherit=False)))
    return tree


def _texts(units: xr.DataArray) -> list[str]:
    return [str(x) for x in np.atleast_1d(units.values)]


def _one(units: Iterable[str]) -> str:
    """Return the common unit; empty if units differ."""
    found = set(units)
    return found.pop() if len(found) == 1 else ""
