"""Read the surrogates in the results of a method."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
import xarray as xr

from uqmbd.arguments import Bounds, fits, shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.plugins import InputTreatment, such_as
from uqmbd.results.chaos.composed import KINDS, ComposedChaos, Part
from uqmbd.results.chaos.custom import Custom
from uqmbd.results.chaos.stated_error import weighted_std
from uqmbd.results.storage import absent_model
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
    """Stored surrogate of some outputs: its kind, its dataset, and the indices of these outputs."""

    kind: str
    data: xr.Dataset
    rows: Index

    @property
    def equal_times(self) -> bool:
        """Whether the surrogate is a single expansion at equal times over the whole germ space."""
        data = self.data
        return (
            {"multi_index", "coefficients"} <= set(data.data_vars)
            and data["multi_index"].dims == ("term", "input")
            and data["coefficients"].dims[:2] == ("term", "output")
        )

    @property
    def split(self) -> bool:
        """Whether the surrogate consists of elements, so that more elements could improve it."""
        # an aligned surrogate of the whole germ space has one element
        return self.data.sizes.get("element", 0) > (0 if self.kind == "chaos" else 1)


@typechecked
def surrogate(
    node: xr.DataTree | xr.DataArray, output: str | None = None, times: Sequence[int] | None = None
) -> Part | ComposedChaos:
    """Return the surrogate of a method, of any kind.

    All kinds have the same methods for evaluation, samples, statistics and densities.

    Parameters
    ----------
    node : xarray.DataTree
        Node of a propagator, ``tree["LABEL"]``. Type checkers may regard it as a DataArray.
    output : str, optional
        Name of the only output to read, which is faster. Default: all.
    times : sequence of int, optional
        Indices of the only times to read. Default: all.

    Returns
    -------
    PolynomialChaos, PiecewiseChaos, AlignedChaos, QuasiPeriodicChaos, CustomSurrogate or ComposedChaos
        Surrogate of the method; a ComposedChaos if outputs have surrogates of different kinds and all are read. A
        CustomSurrogate has a model of a plugin.

    Raises
    ------
    StudyError
        If `node` is not the node of a propagator, or has no surrogate or no such output.

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
        raise StudyError(f"A {kind} contains no surrogate; expected the node of a method, tree['LABEL'].")
    parts = surrogate_parts(node)
    if why := absent_surrogate(node):
        raise StudyError(f"The propagator {node.name!r}: {why}")
    if not parts:
        methods = such_as(InputTreatment.INTERPOLATE)
        raise StudyError(f"The method {node.name!r} contains no surrogate. Use a method that computes one{methods}.")
    found, names = {}, []
    for name, (kind, part) in parts.items():
        data = part.to_dataset()
        own = [str(x) for x in data["output"].values]
        names += own
        if times is not None and "time" in data.sizes:
            count = data.sizes["time"]
            if not len(times) or not all(fits(k, Annotated[int, Bounds(0, count - 1)]) for k in times):
                raise StudyError(
                    f"surrogate: times is {shown(times)}; expected indices of times, from 0 to {count - 1}."
                )
            data = data.isel(time=list(times))
        if output is None:
            found[name] = (kind, data)
        elif output in own:
            found[name] = (kind, data.isel(output=own.index(output) + np.arange(1)))
    if not found:
        raise StudyError(f"The surrogate has no output {output!r}; its outputs are {', '.join(map(repr, names))}.")
    if list(found) == [""] or (output is not None and len(found) == 1):
        ((kind, data),) = found.values()
        return KINDS[kind](data)
    return ComposedChaos.from_datasets(found)


def surrogate_parts(node: xr.DataTree) -> dict[str, tuple[str, xr.DataTree]]:
    """Return the stored parts of the surrogates of a method, by name, each with the name of its kind.

    A composed surrogate has several named parts; any other surrogate has one part with an empty name. Surrogates whose
    plugin is not installed cannot be evaluated and are omitted.

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
    """Return why the surrogate of a method cannot be evaluated here; empty if it can, or without a surrogate."""
    name, composed = Custom.name, node.children.get("composed")
    holders = [node, *(composed.children.values() if composed is not None else ())]
    stored = [holder.children[name] for holder in holders if name in holder.children]
    return next((why for one in stored if (why := absent_model(one))), "")


def stored_surrogates(node: xr.DataTree) -> tuple[StoredSurrogate, ...]:
    """Return the stored surrogates, possibly none, in the node of a method or in its child ``scalars``."""
    found = []
    for kind, part in surrogate_parts(node).values():
        data = part.to_dataset()
        rows = data["place"].values if "place" in data else np.arange(data.sizes.get("output", 0))
        found.append(StoredSurrogate(kind, data, np.asarray(rows, dtype=np.intp)))
    return tuple(found)


def verified_std(node: xr.DataTree, shape: tuple[int, ...]) -> Array:
    """Return the standard deviation of the verification realisations, in the shape of the statistics of a method.

    The standard deviation is 0 for outputs without verification realisations.
    """
    found = np.zeros(shape)
    for _, data, rows in stored_surrogates(node):
        known = data.get("verification_response")
        if known is not None and known.shape[1:] == (len(rows), *shape[1:]):
            weights = data.get("verification_weights")
            found[rows] = weighted_std(known.values, np.ones(len(known)) if weights is None else weights.values)
    return found


def verified_range(node: xr.DataTree, shape: tuple[int, ...]) -> tuple[Array, Array, int]:
    """Return smallest and largest values (shape) of the verification realisations, NaN without any, and their number.

    If surrogates have different numbers of realisations, the smallest number is returned.
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
    """Return the number of independent input samples equivalent to the verification realisations; 0 without any."""
    weights = [data.get("verification_weights") for _, data, _ in stored_surrogates(node)]
    known = [w.values / w.values.sum() for w in weights if w is not None and w.size]
    return min((1 / float((w**2).sum()) for w in known), default=0.0) if len(known) == len(weights) else 0.0


def _kind(node: xr.DataTree) -> str:
    return next((name for name in KINDS if name in node.children), "")
