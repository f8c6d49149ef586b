"""Results in the format of ArviZ: a tree of groups, whose variables have the dimensions ``chain`` and ``draw``.

ArviZ 1.x accepts a DataTree of xarray, so that this module does not need ArviZ.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from uqmbd.arguments import Count, Seed, typechecked
from uqmbd.errors import StudyError
from uqmbd.results import by_output, propagator_nodes, surrogate
from uqmbd.status import Status

__all__ = ["to_arviz"]

GROUPS = (
    "posterior", "posterior_predictive", "predictions", "log_likelihood", "log_prior", "sample_stats", "prior",
    "prior_predictive", "sample_stats_prior", "observed_data", "constant_data",
)  # fmt: skip
"""Groups of ArviZ' schema that are passed on unchanged; calibrations by `uqmbd_calibration` have eight of them."""

DRAWS = 1000
"""Default number of draws from a surrogate."""


@typechecked
def to_arviz(results: Any, draws: Count | None = None, seed: Seed | None = None) -> xr.DataTree:
    """Return results as a tree of groups in the format of ArviZ.

    Parameters
    ----------
    results : xarray.DataTree
        Results of a calibration (also from `uqmbd_calibration.calibrate`), or node of a method such as
        ``tree["monte-carlo"]``.
    draws : int, optional
        Number of draws: the first samples of a method (default: all), or draws from its surrogate (default: 1000). The
        number of draws of a calibration is fixed.
    seed : int, optional
        Seed of the draws from a surrogate. Default: 0. Equal seeds give bitwise equal draws.

    Returns
    -------
    xarray.DataTree
        For a calibration: those of its groups that ArviZ' schema defines, unchanged. `uqmbd_calibration` stores
        ``posterior``, ``prior``, ``posterior_predictive``, ``prior_predictive``, ``log_likelihood``, ``sample_stats``,
        ``observed_data`` and ``constant_data``. For a method: the group ``prior`` with a variable for each input, and
        the group ``prior_predictive`` with a variable for each output. The groups have one chain, and outputs over time
        have the dimension ``time``. If the inputs of the method are from a calibration, the groups are ``posterior``
        and ``posterior_predictive``. Variables have ``units``. Failed realisations and realisations without an output
        are excluded; the attribute ``left_out`` is their number.

    Raises
    ------
    uqmbd.StudyError
        If `results` contain several methods, or neither samples nor a surrogate.

    Examples
    --------
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, sample_dataset, statistics_dataset
    >>> axes = labels([("x", "m")], [("k", "N/m")], [0.0, 1.0])
    >>> samples = sample_dataset([[[1.0, 2.0]], [[1.5, 2.5]], [[1.2, 2.2]]], [[3.0], [4.0], [5.0]], axes)
    >>> statistics = statistics_dataset(axes, mean=[[1.2, 2.2]], std=[[0.2, 0.2]])
    >>> node = propagator_node("mine", statistics, samples, propagator="p", realisations=3, wall_time=0.0)
    >>> found = to_arviz(node)
    >>> list(found.children), found["prior_predictive/x"].sizes, found["prior/k"].attrs["units"]
    (['prior', 'prior_predictive'], Frozen({'chain': 1, 'draw': 3, 'time': 2}), 'N/m')
    """
    tree = getattr(results, "tree", results) if not isinstance(results, xr.DataTree) else results
    if not isinstance(tree, xr.DataTree):
        raise StudyError(
            f"to_arviz: the type of results is {type(results).__name__}; expected the node of a method "
            "or a calibration."
        )
    if tree.attrs.get("kind") == "calibration":
        if draws is not None or seed is not None:
            raise StudyError("to_arviz: a calibration already contains draws; omit draws= and seed=.")
        groups = {name: tree.children[name].to_dataset() for name in GROUPS if name in tree.children}
        return _tree(groups, {name: tree.attrs[name] for name in ("study", "mechanism") if name in tree.attrs})
    nodes = propagator_nodes(tree)
    if len(nodes) != 1:
        label = f", as to_arviz(tree[{next(iter(nodes))!r}])" if nodes else ""
        raise StudyError(
            f"to_arviz: the results of {len(nodes)} methods are given ({', '.join(map(repr, nodes)) or 'none'}); "
            f"expected one{label}."
        )
    ((label, node),) = nodes.items()
    parts = [node, *([node.children["scalars"]] if "scalars" in node.children else [])]
    sampled = [part for part in parts if "samples" in part.children]
    if sampled:
        if seed is not None:
            raise StudyError(f"to_arviz: {label!r} already has samples, so a seed has no effect; omit seed=.")
        inputs, outputs, left_out = _of_samples(sampled, draws)
    else:
        inputs, outputs, left_out = _of_surrogates(label, parts, draws or DRAWS, seed or 0)
    kind = "posterior" if node.attrs.get("population") else "prior"
    about = {"method": label, "left_out": left_out}
    return _tree({kind: _draws(inputs), f"{kind}_predictive": _draws(outputs)}, about)


def _of_samples(parts: list[xr.DataTree], draws: int | None) -> tuple[xr.Dataset, xr.Dataset, int]:
    """Return inputs and outputs of realisations without failures, and the number of excluded realisations."""
    data = [part.children["samples"].to_dataset().isel(sample=slice(draws)) for part in parts]
    count = min(one.sizes["sample"] for one in data)
    data = [one.isel(sample=slice(count)) for one in data]
    good = np.ones(count, dtype=bool)
    for one in data:
        good &= one["status"].values == Status.OK
        # in some realisations, a scalar output may have no value
        good &= np.isfinite(one["response"].values.reshape(count, -1)).all(axis=1)
    successful = [one.isel(sample=np.flatnonzero(good)) for one in data]
    outputs = xr.merge([by_output(one, "response") for one in successful], compat="override", join="override")
    return _by_input(successful[0]), outputs, int(count - good.sum())


def _of_surrogates(label: str, parts: list[xr.DataTree], draws: int, seed: int) -> tuple[xr.Dataset, xr.Dataset, int]:
    """Draw from the surrogates of a method at equal inputs; return inputs, outputs, and 0 excluded draws."""
    found: list[xr.Dataset] = []
    inputs: xr.Dataset | None = None
    for part in parts:
        if not part.children["statistics"].to_dataset().sizes.get("output"):
            continue
        try:
            chaos = surrogate(part)
        except StudyError:
            raise StudyError(
                f"to_arviz: {label!r} contains neither samples nor a surrogate; use a method that stores one of them."
            ) from None
        drawn, response = chaos.sample(draws, seed)
        axes = chaos.labels
        dims, coords = ("sample", *axes.dims), {**axes.output_coords(), **axes.input_coords()}
        data = xr.Dataset({"response": (dims, response), "inputs": (("sample", "input"), drawn)}, coords=coords)
        found.append(by_output(data, "response"))
        inputs = _by_input(data) if inputs is None else inputs
    assert inputs is not None
    return inputs, xr.merge(found, compat="override", join="override"), 0


def _by_input(data: xr.Dataset) -> xr.Dataset:
    """Return a dataset with a variable for each input."""
    names = [str(name) for name in data["input"].values]
    units = [str(unit) for unit in data["input_units"].values] if "input_units" in data.coords else [""] * len(names)
    values = data["inputs"].values
    return xr.Dataset(
        {
            name: ("sample", values[:, k], {"units": unit} if unit else {})
            for k, (name, unit) in enumerate(zip(names, units, strict=True))
        }
    )


def _draws(data: xr.Dataset) -> xr.Dataset:
    """Return samples as draws of one chain."""
    renamed = {name: f"{name}_" for name in ("chain", "draw") if name in data.variables}
    found = data.rename(renamed).rename(sample="draw").expand_dims("chain")
    order = ("chain", "draw", *(str(dim) for dim in found.dims if dim not in ("chain", "draw")))
    return found.assign_coords(chain=np.arange(1), draw=np.arange(found.sizes["draw"])).transpose(*order)


def _tree(groups: dict[str, xr.Dataset], about: dict[str, Any]) -> xr.DataTree:
    tree = xr.DataTree.from_dict(groups)
    tree.attrs |= {"inference_library": "uqmbd", **about}
    return tree
