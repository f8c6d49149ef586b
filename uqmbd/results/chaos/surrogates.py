"""The surrogate that a method's results hold, of its kind."""

from __future__ import annotations

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.results.chaos.aligned import AlignedChaos
from uqmbd.results.chaos.piecewise import PiecewiseChaos
from uqmbd.results.chaos.polynomial import PolynomialChaos

__all__ = ["chaos_from_dataset", "surrogate"]


def surrogate(node: xr.DataTree, output: str | None = None) -> PolynomialChaos | PiecewiseChaos | AlignedChaos:
    """Return the surrogate of a method: one polynomial chaos, one of elements, or one that follows events.

    All of them evaluate, sample, and give statistics and densities alike.

    Parameters
    ----------
    node : xarray.DataTree
        The node of a propagator.
    output : str, optional
        Only this output is read, which is faster; default: all.

    Returns
    -------
    PolynomialChaos, PiecewiseChaos or AlignedChaos

    Raises
    ------
    StudyError
        If the node holds no surrogate, or no such output.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> from uqmbd.randomness import GermSpace, JointInput
    >>> from uqmbd.results import labels, propagator_node
    >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("k", chaospy.Normal(1, 0.1))]))
    >>> chaos = PolynomialChaos([[[1.0]], [[0.5]]], [[0], [1]], space, labels(["x"], ["k"], [0.0]))
    >>> node = propagator_node("mine", chaos.statistics(), propagator="p", realisations=2, wall_time=0.0,
    ...                        children={"chaos": chaos.to_dataset()})
    >>> surrogate(node, "x").evaluate([[1.2]]).round(9).tolist()
    [[[2.0]]]
    """
    kind = next((name for name in ("chaos", "aligned") if name in node.children), None)
    if kind is None:
        raise StudyError(f"The propagator {node.name!r} holds no surrogate; collocation and Galerkin make one.")
    data = node.children[kind].to_dataset()
    if output is not None:
        names = [str(name) for name in data["output"].values]
        if output not in names:
            raise StudyError(f"There is no output {output!r}; there are {', '.join(map(repr, names))}.")
        data = data.isel(output=names.index(output) + np.arange(1))
    return AlignedChaos.from_dataset(data) if kind == "aligned" else chaos_from_dataset(data)


def chaos_from_dataset(dataset: xr.Dataset | xr.DataTree) -> PolynomialChaos | PiecewiseChaos:
    """Make the chaos of a result, of one element or of several, from its dataset `chaos`.

    Raises
    ------
    StudyError
        If it is no such dataset.
    """
    kind = PiecewiseChaos if "element" in dataset.dims else PolynomialChaos
    return kind.from_dataset(dataset)
