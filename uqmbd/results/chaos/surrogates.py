"""The surrogate that a method's results hold, of its kind."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
import xarray as xr

from uqmbd.arguments import Bounds, fits, shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.results.chaos.composed import KINDS, ComposedChaos, Part
from uqmbd.results.chaos.custom import Custom, absent_model
from uqmbd.results.chaos.stated_error import weighted_std
from uqmbd.typing import Array, Index

__all__ = [
    "StoredSurrogate",
    "absent_surrogate",
    "stored_surrogates",
    "surrogate",
    "surrogate_parts",
    "verified_range",
    "verified_std",
    "verified_trials",
]


class StoredSurrogate(NamedTuple):
    """The stored surrogate of some outputs: its kind, its dataset, and the numbers of these outputs."""

    kind: str
    data: xr.Dataset
    rows: Index

    @property
    def equal_times(self) -> bool:
        """Whether it is one expansion at equal times over the whole germ space."""
        data = self.data
        return (
            {"multi_index", "coefficients"} <= set(data.data_vars)
            and data["multi_index"].dims == ("term", "input")
            and data["coefficients"].dims[:2] == ("term", "output")
        )

    @property
    def split(self) -> bool:
        """Whether it consists of elements, so that more elements would improve it."""
        # an aligned one that is not split has one element
        return self.data.sizes.get("element", 0) > (0 if self.kind == "chaos" else 1)


@typechecked
def surrogate(
    node: xr.DataTree | xr.DataArray, output: str | None = None, times: Sequence[int] | None = None
) -> Part | ComposedChaos:
    """Return the surrogate of a method: one polynomial chaos, one of elements, an aligned one, or one of several kinds.

    All of them evaluate, sample, and give statistics and densities alike.

    Parameters
    ----------
    node : xarray.DataTree
        The node of a propagator, ``tree["LABEL"]``, which to checkers of types may be a DataArray.
    output : str, optional
        Only this output is read, which is faster; default: all.
    times : sequence of int, optional
        Only these of its times are read, by their numbers; default: all.

    Returns
    -------
    PolynomialChaos, PiecewiseChaos, AlignedChaos, QuasiPeriodicChaos or ComposedChaos
        The last one where outputs have surrogates of different kinds, and all of them are read.

    Raises
    ------
    StudyError
        If it is no node, or holds no surrogate, or no such output.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> from uqmbd.randomness import GermSpace, JointInput
    >>> from uqmbd.results import PolynomialChaos, propagator_node
    >>> from uqmbd.extend import labels
    >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("k", chaospy.Normal(1, 0.1))]))
    >>> chaos = PolynomialChaos([[[1.0]], [[0.5]]], [[0], [1]], space, labels(["x"], ["k"], [0.0]))
    >>> node = propagator_node("mine", chaos.statistics(), propagator="p", realisations=2, wall_time=0.0,
    ...                        children={"chaos": chaos.to_dataset()})
    >>> surrogate(node, "x").evaluate([[1.2]]).round(9).tolist()
    [[[2.0]]]
    """
    if not isinstance(node, xr.DataTree):
        kind = type(node).__name__
        raise StudyError(f"A {kind} holds no surrogate; expected the node of a method, tree['LABEL'].")
    parts = surrogate_parts(node)
    if why := absent_surrogate(node):
        raise StudyError(f"The propagator {node.name!r}: {why}")
    if not parts:
        raise StudyError(f"The propagator {node.name!r} holds no surrogate; collocation and Galerkin make one.")
    found, names = {}, []
    for name, (kind, part) in parts.items():
        data = part.to_dataset()
        own = [str(x) for x in data["output"].values]
        names += own
        if times is not None and "time" in data.sizes:
            count = data.sizes["time"]
            if not len(times) or not all(fits(k, Annotated[int, Bounds(0, count - 1)]) for k in times):
                raise StudyError(
                    f"surrogate: times is {shown(times)}; expected numbers of times, from 0 to {count - 1}."
                )
            data = data.isel(time=list(times))
        if output is None:
            found[name] = (kind, data)
        elif output in own:
            found[name] = (kind, data.isel(output=own.index(output) + np.arange(1)))
    if not found:
        raise StudyError(f"There is no output {output!r}; there are {', '.join(map(repr, names))}.")
    if list(found) == [""] or (output is not None and len(found) == 1):
        ((kind, data),) = found.values()
        return KINDS[kind](data)
    return ComposedChaos.from_datasets(found)


def surrogate_parts(node: xr.DataTree) -> dict[str, tuple[str, xr.DataTree]]:
    """Return the stored parts of the surrogates of a method's outputs, each with the name of its kind.

    By the names of the parts that a composed one has; else there is one, without a name, or none. A model whose plugin
    is not installed cannot be evaluated, and is none.

    `node`: a propagator's node, or its child ``scalars``.

    >>> import chaospy
    >>> import uqmbd
    >>> from uqmbd.results.chaos import surrogate_parts
    >>> from uqmbd_collocation import Collocation
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> mechanism.output("height", stone.position[0], units="m")
    >>> tree = uqmbd.Study("throw", mechanism, [0, 1], [Collocation(order=1)]).run()
    >>> [(name, kind) for name, (kind, node) in surrogate_parts(tree["collocation"]).items()]
    [('', 'chaos')]
    """
    if absent_surrogate(node):
        return {}
    if kind := _kind(node):
        return {"": (kind, node.children[kind])}
    if "composed" not in node.children:
        return {}
    parts = node.children["composed"].children
    return {str(name): (kind, part.children[kind]) for name, part in parts.items() if (kind := _kind(part))}


def absent_surrogate(node: xr.DataTree) -> str:
    """Return why the surrogate of a method's node cannot be evaluated here; nothing where it can, or there is none."""
    name = Custom.name
    return absent_model(node.children[name]) if name in node.children else ""


def stored_surrogates(node: xr.DataTree) -> tuple[StoredSurrogate, ...]:
    """Return the surrogates in the node of a method, or in its child ``scalars``, without making them; may be none."""
    found = []
    for kind, part in surrogate_parts(node).values():
        data = part.to_dataset()
        rows = data["place"].values if "place" in data else np.arange(data.sizes.get("output", 0))
        found.append(StoredSurrogate(kind, data, np.asarray(rows, dtype=np.intp)))
    return tuple(found)


def verified_std(node: xr.DataTree, shape: tuple[int, ...]) -> Array:
    """Return the standard deviation of the verification realisations, of the shape of a method's statistics.

    0 where there are none.
    """
    found = np.zeros(shape)
    for _, data, rows in stored_surrogates(node):
        known = data.get("verification_response")
        if known is not None and known.shape[1:] == (len(rows), *shape[1:]):
            weights = data.get("verification_weights")
            found[rows] = weighted_std(known.values, np.ones(len(known)) if weights is None else weights.values)
    return found


def verified_range(node: xr.DataTree, shape: tuple[int, ...]) -> tuple[Array, Array, int]:
    """Return smallest and largest values (shape) of the verification realisations, NaN without any; and their number.

    Of surrogates with different numbers of realisations, the smallest of these.
    """
    low, high, counts = np.full(shape, np.nan), np.full(shape, np.nan), list[int]()
    for _, data, rows in stored_surrogates(node):
        known = data.get("verification_response")
        there = known is not None and len(known) > 0 and known.shape[1:] == (len(rows), *shape[1:])
        counts.append(len(known) if known is not None and there else 0)
        if known is not None and there:
            low[rows], high[rows] = np.fmin.reduce(known.values), np.fmax.reduce(known.values)
    return low, high, min(counts, default=0)


def verified_trials(node: xr.DataTree) -> float:
    """Return as how many independent samples of the inputs the verification realisations count; 0 without any."""
    weights = [data.get("verification_weights") for _, data, _ in stored_surrogates(node)]
    known = [w.values / w.values.sum() for w in weights if w is not None and w.size]
    return min((1 / float((w**2).sum()) for w in known), default=0.0) if len(known) == len(weights) else 0.0


def _kind(node: xr.DataTree) -> str:
    return next((name for name in KINDS if name in node.children), "")
