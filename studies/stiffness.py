"""The slider-crank by Galerkin at orders 0 to 6: a higher order does not make the projected equations stiffer.

Run as a script it prints a table of stiffness, singularity and accuracy for each order.  With ``--agile-eye`` it also
prints one for the Agile Eye::

    OMP_NUM_THREADS=1 python studies/stiffness.py [--orders 6] [--agile-eye]

Spectra are those of the index-1 equations of motion, linearised on the constraint manifold.  Let N be an orthonormal
basis of the null space of the (projected) constraint Jacobian C at a state.  Nearby states have the coordinates
``u = N^T (q - q0)`` and ``w = N^T (v - v0)``.  To first order ``dq = N du`` and ``dv = N dw + L du``, where
``C L = -(C v)_q N`` preserves the velocity constraints.  The equations are ``u' = w, w' = N^T a(q, v, t)``.  C and
``(C v)_q`` are exact; central differences approximate the derivatives of the accelerations along these directions.  A
realisation is the special case of one node and one term.  Auxiliary states are constant.
"""

import argparse
import json
import warnings
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from slider_crank import mechanism

import uqmbd
from uqmbd.results import PolynomialChaos
from uqmbd_galerkin import Galerkin

Array = NDArray[np.float64]

ORDERS = 6
PROBES = 5
"""Number of states along the motion at which spectra are computed."""
STEP = 1e-5
"""Step of the central differences, relative to the magnitude of a coordinate or velocity."""

study = uqmbd.Study(
    "stiffness",
    mechanism,
    times=np.linspace(0, 2, 401),
    propagators=[Galerkin(order=p, label=f"galerkin-{p}") for p in range(ORDERS + 1)],
)


@dataclass(frozen=True)
class Spectra:
    """Smallest and largest magnitude of eigenvalues along a motion, 1/s."""

    smallest: float
    largest: float

    def __str__(self) -> str:
        return f"{self.smallest:.2f} .. {self.largest:.1f}"


def projection(
    of: uqmbd.Study, order: int
) -> tuple[uqmbd.extend.ProjectedEnsemble, list[uqmbd.extend.ProjectedEnsemble]]:
    """Return the projected equations of an order, and a separate system for each realisation at their nodes."""
    problem = of.problem(Galerkin(order=order))
    space = uqmbd.extend.GermSpace.of(problem.inputs, "rosenblatt")
    rule = uqmbd.extend.gauss_tensor(space, order + 1)
    values = space.to_inputs(rule.nodes)
    basis = space.evaluate(rule.nodes, uqmbd.extend.index_set(space.dimension, order, "total"))
    whole = uqmbd.extend.ProjectedEnsemble(problem.ensemble(values), basis, rule.weights)
    one = np.ones((1, 1))
    return whole, [uqmbd.extend.ProjectedEnsemble(problem.ensemble(v[None]), one, np.ones(1)) for v in values]


def tangent(projected: uqmbd.extend.ProjectedEnsemble, state: Array, time: float) -> tuple[Array, Array]:
    """Return directions along the constraints at a state: N and L of the module docstring, (coordinates, freedom)."""
    where, count = projected.model.layout.slices, projected.terms
    _, multipliers, _ = projected.accelerations(state, time)
    unknowns = projected.ensemble.pack(*projected.split(state), multipliers)
    whole = projected.jacobian(time, unknowns, np.zeros_like(unknowns), 0.0)
    whole = whole.reshape(count, unknowns.shape[1], count, unknowns.shape[1])

    def block(rows: str, columns: str) -> Array:
        found = whole[:, where[rows]][..., where[columns]]
        return found.reshape(found.shape[0] * found.shape[1], -1)

    constraints = block("l", "q")
    if not len(constraints):
        return np.eye(constraints.shape[1]), np.zeros((constraints.shape[1],) * 2)
    _, values, right = np.linalg.svd(constraints)
    rank = int(np.sum(values > 1e-10 * values[0]))
    null = right[rank:].T
    return null, -np.asarray(np.linalg.lstsq(constraints, block("m", "q") @ null, rcond=None)[0], dtype=np.float64)


def spectrum(projected: uqmbd.extend.ProjectedEnsemble, state: Array, time: float) -> NDArray[np.complex128]:
    """Return eigenvalues of the linearised equations of motion on the constraint manifold, 1/s."""
    layout = projected.model.layout
    free, count = layout.free, projected.terms
    velocities = layout.coordinates + layout.states + free
    null, keeping = tangent(projected, state, time)
    freedom = null.shape[1]

    def along(dq: Array, dv: Array) -> Array:
        """Differentiate the accelerations in tangent coordinates."""
        both = []
        for sign in (1.0, -1.0):
            moved = state.copy()
            moved[:, free] += sign * STEP * dq.reshape(count, -1)
            moved[:, velocities] += sign * STEP * dv.reshape(count, -1)
            both.append(projected.accelerations(moved, time)[0][:, free].ravel())
        return np.asarray(null.T @ (both[0] - both[1]) / (2 * STEP))

    matrix = np.zeros((2 * freedom, 2 * freedom))
    matrix[:freedom, freedom:] = np.eye(freedom)
    for k in range(freedom):
        matrix[freedom:, k] = along(null[:, k], keeping[:, k])
        matrix[freedom:, freedom + k] = along(np.zeros(len(null)), null[:, k])
    return np.asarray(np.linalg.eigvals(matrix), dtype=complex)


def spectra(parts: list[uqmbd.extend.ProjectedEnsemble], times: Array) -> Spectra:
    """Return extreme magnitudes of eigenvalues along the motions, over all systems."""
    probes = np.linspace(0, len(times) - 1, PROBES + 1).astype(int)[1:]
    found: list[Array] = []
    for part in parts:
        path = part.integrate(times).coefficients
        found += [np.abs(spectrum(part, path[:, k], float(times[k]))) for k in probes if np.isfinite(path[:, k]).all()]
    every = np.concatenate(found)
    return Spectra(float(every.min()), float(every.max()))


def horizon(node: xr.DataTree, limit: float) -> str:
    """Return the time until which the stated error of all outputs is below a share of their standard deviation."""
    if node["chaos"].sizes["term"] == 1:
        return "-"
    ends = PolynomialChaos.from_dataset(node["chaos"].to_dataset()).horizon(limit).values()
    passed = [t for t in ends if t is not None]
    return f"{min(passed):.3g}" if passed else "end"


def row(of: uqmbd.Study, order: int) -> tuple[str, ...]:
    """Return the row of one order."""
    explicit = of.propagate(Galerkin(order=order, integrator="dop853"))
    implicit = of.propagate(Galerkin(order=order, integrator="ida", verify=0))
    whole, alone = projection(of, order)
    by, ida = (json.loads(node.attrs["solver_counters"]) for node in (explicit, implicit))
    known = explicit.children["diagnostics"].to_dataset()
    return (
        str(order),
        str(explicit.attrs["nodes"]),
        str(explicit.attrs["unknowns"]),
        f"{by['steps']:.0f}",
        f"{by['accelerations']:.0f}",
        f"{by['iterations'] / by['systems']:.1f}",
        f"{ida['residuals']:.0f}",
        f"{ida.get('factorisations', 0):.0f}",
        f"{ida['jacobian_products']:.0f}" if "jacobian_products" in ida else "-",
        str(spectra([whole], of.times)),
        str(spectra(alone, of.times)),
        f"{float(known['smallest_singular_value'].min()):.4f}",
        f"{float(known['smallest_singular_value_nodes'].min()):.4f}",
        f"{float(known['constraint_rms'].max()):.0e}",
        f"{float(known['top_order_share'].max()):.1g}",
        horizon(explicit, 0.01),
        horizon(explicit, 0.1),
    )


COLUMNS = (
    "order", "nodes", "un-\nknowns", "steps", "evalu-\nations", "itera-\ntions", "IDA:\nresid.", "factor-\nisat.",
    "Krylov\nprod.", "|eigenvalues|\nprojected, 1/s", "|eigenvalues|\nrealisations, 1/s", "sing.\nvalue", "of\nnodes",
    "con-\nstraints", "top\norder", "1 %\nuntil, s", "10 %\nuntil, s",
)  # fmt: skip
CAPTION = (
    "Steps, evaluations and iterations (of the coupled accelerations, per system): explicit integrator. Residuals, "
    "factorisations and Krylov products: IDA. Singular value: the smallest of the projected constraint Jacobian, and "
    "of all nodes, over time. Constraints: largest root of E[|Phi|^2]. Top order: its largest share of the variance of "
    "the coordinates. Last two columns: time until which the stated error stays below 1 % and 10 % of the standard "
    "deviation of every output."
)


def table(of: uqmbd.Study, orders: int) -> Table:
    """Return diagnostics of a study by order."""
    found = Table(title=f"{of.mechanism.name}, {of.times[-1]:g} s", caption=CAPTION, caption_justify="left")
    for column in COLUMNS:
        found.add_column(column, justify="right")
    for order in range(orders + 1):
        found.add_row(*row(of, order))
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--orders", type=int, default=ORDERS, help=f"highest order (default {ORDERS})")
    parser.add_argument("--agile-eye", action="store_true", help="add the Agile Eye")
    options = parser.parse_args()
    console = Console(width=180)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the last columns show these errors
        console.print(table(study, options.orders))
        if options.agile_eye:
            import agile_eye

            console.print(table(agile_eye.study, options.orders))


if __name__ == "__main__":
    main()
