"""Storage of germ spaces as plain arrays and texts."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.randomness.germs import Germ
from uqmbd.randomness.rosenblatt import Transform
from uqmbd.randomness.space.marginals import Marginal
from uqmbd.randomness.space.transforms import CorrelatedTransform, Group, Rosenblatt
from uqmbd.typing import Array

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["from_dataset", "to_dataset"]


CONDITIONAL = {True: "conditional, standard normal", False: "conditional, uniform"}
"""Kinds of map of a general joint distribution, stored as text, keyed by whether the germ is standard normal."""

COEFFICIENTS = ("shift", "scale", "mu", "sigma")
"""Numbers of a map, along the dimension ``germ_coefficient``."""

REQUIRED = (
    "germ_family", "germ_alpha", "germ_beta", "germ_parameter", "germ_bounds", "germ_group", "germ_order",
    "germ_factor", "germ_map", "germ_map_coefficient", "germ_map_bounds", "germ_table_of_germ", "germ_table_of_input",
)  # fmt: skip


def to_dataset(
    inputs: tuple[str, ...], names: tuple[str, ...], germs: tuple[Germ, ...], groups: tuple[Group, ...]
) -> xr.Dataset:
    """Return the parts of a germ space as a dataset; see :meth:`uqmbd.randomness.GermSpace.to_dataset`."""
    import xarray as xr

    dimension = len(germs)
    tables: list[Array] = []
    maps: dict[str, Any] = {
        "kind": [""] * dimension,
        "coefficient": np.full((dimension, 4), np.nan),
        "bounds": np.full((dimension, 2), np.nan),
        "table": np.full(dimension, -1),
    }
    group_of, order = np.zeros(dimension, dtype=int), np.zeros(dimension, dtype=int)
    factor = np.zeros((dimension, dimension))
    texts = [""] * dimension
    for number, group in enumerate(groups):
        columns = np.array(group.columns)
        group_of[columns] = number
        order[columns[list(group.order)]] = np.arange(len(columns))
        if isinstance(group, Rosenblatt):
            for column, normal in zip(columns, group.normal, strict=True):
                maps["kind"][column] = CONDITIONAL[normal]
            if group.joint is not None and group.joint.text:
                texts[min(columns)] = f"[{list(group.columns)}, {group.joint.text}]"
            continue
        factor[np.ix_(columns, columns)] = group.factor
        for column, marginal in zip(columns, group.marginals, strict=True):
            maps["kind"][column] = marginal.kind
            maps["coefficient"][column] = [getattr(marginal, c) for c in COEFFICIENTS]
            maps["bounds"][column] = marginal.bounds
            maps["table"][column] = _keep(marginal.table, tables)
    germ_tables = np.array([_keep(germ.table, tables) for germ in germs], dtype=int)
    longest = max((len(germ.alpha) for germ in germs), default=0)
    variables: dict[str, Any] = {
        "germ_family": ("germ", np.array([germ.family for germ in germs], dtype=np.str_)),
        "germ_alpha": (("germ", "germ_degree"), _padded([germ.alpha for germ in germs], longest)),
        "germ_beta": (("germ", "germ_degree"), _padded([germ.beta for germ in germs], longest)),
        "germ_parameter": (("germ", "germ_end"), _padded([np.array(germ.parameters) for germ in germs], 2)),
        "germ_bounds": (("germ", "germ_end"), np.array([germ.bounds for germ in germs]).reshape(-1, 2)),
        "germ_table_of_germ": ("germ", germ_tables),
        "germ_group": ("input", group_of),
        "germ_order": ("input", order),
        "germ_factor": (("input", "germ"), factor),
        "germ_map": ("input", np.array(maps["kind"], dtype=np.str_)),
        "germ_map_coefficient": (("input", "germ_coefficient"), maps["coefficient"]),
        "germ_map_bounds": (("input", "germ_end"), maps["bounds"]),
        "germ_table_of_input": ("input", maps["table"]),
    }
    if any(texts):
        variables["germ_joint"] = ("input", np.array(texts, dtype=np.str_))
    if tables:
        width = max(table.shape[1] for table in tables)
        filled = np.stack([_padded(list(table), width) for table in tables])
        variables["germ_table"] = (("germ_tabulated", "germ_row", "germ_knot"), filled)
    coords = {"germ": np.array(names, dtype=np.str_), "input": np.array(inputs, dtype=np.str_)}
    return xr.Dataset(variables, coords=coords)


def from_dataset(dataset: xr.Dataset) -> tuple[tuple[str, ...], tuple[Germ, ...], tuple[Group, ...]]:
    """Return names of inputs, germs and maps from a dataset of :func:`to_dataset`.

    Raise StudyError if a variable is missing.
    """
    missing = [name for name in ("germ", "input", *REQUIRED) if name not in dataset.variables]
    if missing:
        raise StudyError(
            f"The dataset contains no germ space, because {', '.join(missing)} is missing. Use a dataset from "
            "GermSpace.to_dataset()."
        )
    data = {name: dataset[name].values for name in REQUIRED}
    names = [str(name) for name in dataset["germ"].values]
    tables = [] if "germ_table" not in dataset else [_trimmed(table) for table in dataset["germ_table"].values]

    def table_at(place: int) -> Array | None:
        return None if place < 0 else tables[place]

    germs = tuple(
        Germ(
            name,
            str(data["germ_family"][k]),
            _finite(data["germ_alpha"][k]),
            _finite(data["germ_beta"][k]),
            tuple(float(p) for p in _finite(data["germ_parameter"][k])),
            _pair(data["germ_bounds"][k]),
            table_at(int(data["germ_table_of_germ"][k])),
        )
        for k, name in enumerate(names)
    )
    groups: list[Group] = []
    for number in range(int(data["germ_group"].max(initial=-1)) + 1):
        columns = tuple(int(c) for c in np.flatnonzero(data["germ_group"] == number))
        order = tuple(int(k) for k in np.argsort(data["germ_order"][list(columns)]))
        kinds = [str(data["germ_map"][c]) for c in columns]
        if kinds[0] in CONDITIONAL.values():
            text = str(dataset["germ_joint"].values[columns[0]]) if "germ_joint" in dataset.variables else ""
            if text:
                columns, joint = _joint(text)  # the distribution orders its components differently
                order = tuple(int(k) for k in np.argsort(data["germ_order"][list(columns)]))
            normal = tuple(str(data["germ_map"][c]) == CONDITIONAL[True] for c in columns)
            groups.append(Rosenblatt(columns, order, normal, joint if text else None))
            continue
        marginals = tuple(
            Marginal(
                kind,
                **dict(zip(COEFFICIENTS, map(float, data["germ_map_coefficient"][c]), strict=True)),
                bounds=_pair(data["germ_map_bounds"][c]),
                table=table_at(int(data["germ_table_of_input"][c])),
            )
            for c, kind in zip(columns, kinds, strict=True)
        )
        factor = np.array(data["germ_factor"][np.ix_(columns, columns)], dtype=float)
        groups.append(CorrelatedTransform(columns, marginals, factor, order))
    return tuple(str(name) for name in dataset["input"].values), germs, tuple(groups)


def _joint(text: str) -> tuple[tuple[int, ...], Transform]:
    try:
        columns, law = json.loads(text)
        return tuple(map(int, columns)), Transform.read(json.dumps(law))
    except (ValueError, TypeError, KeyError, AttributeError, ImportError, IndexError) as error:
        raise StudyError(
            f"The dataset contains a joint distribution that cannot be read ({error}): {text[:200]}. A later version "
            "wrote the dataset, or it is damaged. Build the GermSpace from the study again."
        ) from error


def _keep(table: Array | None, tables: list[Array]) -> int:
    """Append a table and return its index, or -1 without a table."""
    if table is None:
        return -1
    tables.append(table)
    return len(tables) - 1


def _padded(rows: list[Array], width: int) -> Array:
    filled = np.full((len(rows), width), np.nan)
    for row, values in zip(filled, rows, strict=True):
        row[: len(values)] = values
    return filled


def _finite(row: Array) -> Array:
    return np.array(row[~np.isnan(row)], dtype=float)


def _trimmed(table: Array) -> Array:
    return np.array(table[:, ~np.isnan(table[0])], dtype=float)


def _pair(row: Array) -> tuple[float, float]:
    return float(row[0]), float(row[1])
