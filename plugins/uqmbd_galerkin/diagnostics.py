"""Diagnostics of a projected motion: energy, constraints, norms, and the distance from a singular projection."""

from __future__ import annotations

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.typing import Array, Index

__all__ = ["motion_invariants"]


SINGULAR_VALUES = 9
"""Number of times at which singular values are computed."""


def motion_invariants(
    projected: uqmbd.extend.ProjectedEnsemble, times: Array, coefficients: Array, terms: Index
) -> xr.Dataset:
    """Return invariants of the projected motion over time, from the coefficients (P, T, width) of its states.

    ``energy`` is the expectation of kinetic and potential energy (J). ``constraint_rms`` is the square root of the sum
    of the expectations of the squared constraints, computed at the nodes. It is zero only in the limit of high order.
    ``quaternion_norm_rms`` is the root mean square deviation of nodal quaternions from unit length.
    ``top_order_share`` is the share of the variance of the coordinates in the terms of the highest degree. At some
    times (``probe_time``), the dataset contains two smallest singular values: of the projected constraint Jacobian, and
    of the constraint Jacobians of all nodes.
    """
    nodal = projected.nodal(coefficients)
    weights, model = projected.weights, projected.model
    energy = weights @ projected.ensemble.energies(times, nodal).sum(axis=1)
    drift = projected.constraints(times, nodal)
    quaternions = model.quaternions()
    norm = np.zeros(len(times))
    if quaternions.size:
        length = np.linalg.norm(nodal[:, :, quaternions], axis=3)
        norm = np.sqrt(np.einsum("k,ktb->t", weights, (length - 1.0) ** 2))
    degree = terms.sum(axis=1)
    variance = np.sum(coefficients[1:, :, : model.layout.coordinates] ** 2, axis=(0, 2))
    top = np.sum(coefficients[degree == degree.max(), :, : model.layout.coordinates] ** 2, axis=(0, 2))
    share = (
        np.divide(top, variance, out=np.zeros(len(times)), where=variance > 0) if degree.max() else np.zeros(len(times))
    )
    probes = np.unique(np.linspace(0, len(times) - 1, min(SINGULAR_VALUES, len(times))).astype(int))
    values, of_nodes = projected.smallest_singular_values(times[probes], coefficients[:, probes])
    return xr.Dataset(
        {
            "energy": ("time", energy, {"units": "J", "long_name": "expectation of kinetic and potential energy"}),
            "constraint_rms": ("time", drift, {"long_name": "root of the expectation of the squared constraints"}),
            "quaternion_norm_rms": (
                "time",
                norm,
                {"units": "1", "long_name": "deviation of nodal quaternions from unit length"},
            ),
            "top_order_share": (
                "time",
                share,
                {"units": "1", "long_name": "share of the variance of the coordinates in terms of the highest order"},
            ),
            "smallest_singular_value": (
                "probe_time",
                values,
                {
                    "long_name": "smallest singular value of the projected constraint Jacobian",
                    "comment": "accurate to 0.5 % or better",
                },
            ),
            "smallest_singular_value_nodes": ("probe_time", of_nodes, {"long_name": "smallest of all nodes"}),
        },
        coords={"time": ("time", times, {"units": "s"}), "probe_time": ("probe_time", times[probes], {"units": "s"})},
    )
