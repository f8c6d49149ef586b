"""Combine surrogates of different kinds, with the most accurate one for each output and time."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self, TypeVar

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.results.chaos.aligned import AlignedChaos
from uqmbd.results.chaos.custom import CustomSurrogate
from uqmbd.results.chaos.discontinuity import Discontinuity
from uqmbd.results.chaos.interface import Surrogate
from uqmbd.results.chaos.piecewise import PiecewiseChaos
from uqmbd.results.chaos.polynomial import PolynomialChaos
from uqmbd.results.chaos.quasi_periodic import QuasiPeriodicChaos
from uqmbd.results.chaos.readouts import Composed, SampleBlocks
from uqmbd.results.schema import Labels
from uqmbd.typing import Array, Mask

__all__ = ["KINDS", "ComposedChaos", "Part", "chaos_from_dataset", "stored_as"]

_Statement = TypeVar("_Statement")

Part = PolynomialChaos | PiecewiseChaos | AlignedChaos | QuasiPeriodicChaos | CustomSurrogate
"""Surrogates that can be stored."""


def chaos_from_dataset(dataset: xr.Dataset | xr.DataTree) -> PolynomialChaos | PiecewiseChaos:
    """Return the chaos of a result, of one element or of several, from its dataset `chaos`.

    `dataset`: dataset from `PolynomialChaos.to_dataset` or `PiecewiseChaos.to_dataset`. The values of the surrogate are
    bitwise identical. Raise StudyError for any other dataset.

    >>> import chaospy
    >>> import uqmbd
    >>> from uqmbd.results.chaos import chaos_from_dataset
    >>> from uqmbd_collocation import Collocation
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> mechanism.output("height", stone.position[0], units="m")
    >>> tree = uqmbd.Study("throw", mechanism, [0, 1], [Collocation(order=1)]).run()
    >>> chaos = chaos_from_dataset(tree["collocation/chaos"].to_dataset())
    >>> chaos.mean.round(6).tolist(), chaos.std.round(6).tolist()  # of 3 t and 0.2 t
    ([[0.0, 3.0]], [[0.0, 0.2]])
    """
    kind = PiecewiseChaos if "element" in dataset.dims else PolynomialChaos
    return kind.from_dataset(dataset)


_SEVERAL = "use to_datasets and from_datasets"

KINDS: Mapping[str, Callable[[xr.Dataset], Part]] = {
    "chaos": chaos_from_dataset,
    "aligned": AlignedChaos.from_dataset,
    "quasi_periodic": QuasiPeriodicChaos.from_dataset,
    "surrogate": CustomSurrogate.from_dataset,
}
"""Constructors of surrogates from a dataset, by the name of the dataset in a node."""


@typechecked
def stored_as(chaos: Part) -> str:
    """Return the name of the dataset in which a surrogate is stored.

    Parameters
    ----------
    chaos : surrogate
        Surrogate of one kind, not composed.

    Examples
    --------
    >>> import chaospy
    >>> import uqmbd
    >>> from uqmbd.results import surrogate
    >>> from uqmbd.extend import stored_as
    >>> from uqmbd_collocation import Collocation
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> mechanism.output("height", stone.position[0], units="m")
    >>> tree = uqmbd.Study("throw", mechanism, [0, 1], [Collocation(order=1)]).run()
    >>> name = stored_as(surrogate(tree["collocation"]))
    >>> name, name in tree["collocation"].children
    ('chaos', True)
    """
    return chaos.readout.name


@typechecked
@dataclass(frozen=True, eq=False, repr=False)
class ComposedChaos(Surrogate):
    """Outputs from surrogates of different kinds.

    Parameters
    ----------
    parts : mapping of str to surrogate
        Surrogates by a common name. Each has some of the outputs; all have the same times, inputs and verification
        realisations.
    outputs : sequence of str
        Names of all outputs, in their order.
    used : mapping of str to array of bool, optional
        Times at which each part gives its outputs, shape (outputs of the part, T). Default: all times. At each time,
        exactly one part gives an output.

    Attributes
    ----------
    multi_index : array of int, shape (P, d)
        Degrees of the terms of the part with the most terms.
    verification_germs, verification_response, verification_weights : array or None
        Verification realisations of the parts, if they agree; otherwise None.

    Raises
    ------
    uqmbd.StudyError
        If no part, or more than one, gives an output at a time.

    Examples
    --------
    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd.results import ComposedChaos, PolynomialChaos
    >>> from uqmbd.extend import labels
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 3), units="m/s")
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
    >>> def part(name, mean):
    ...     axes = labels([name], [("speed", "m/s")], [0.0])
    ...     return PolynomialChaos([[[mean]], [[0.5]]], [[0], [1]], space, axes)
    >>> chaos = ComposedChaos(dict(a=part("x", 1.0), b=part("y", 2.0)), ("y", "x"))
    >>> chaos.mean.ravel().tolist(), chaos.std.ravel().tolist()
    ([2.0, 1.0], [0.5, 0.5])
    """

    parts: Mapping[str, Part]
    outputs: tuple[str, ...]
    used: Mapping[str, Mask] | None = None
    labels: Labels = field(init=False)

    _kind = Composed

    def __post_init__(self) -> None:
        """Check that each output occurs once at each time."""
        if not self.parts:
            raise StudyError("ComposedChaos: parts is empty; expected at least one surrogate.")
        stated = self.used or {}
        for name, part in () if self.used is None else self.parts.items():
            if name not in stated or np.size(stated[name]) != np.prod(part.labels.shape):
                raise StudyError(
                    f"ComposedChaos: the argument 'used' has {'no entry' if name not in stated else 'another shape'} "
                    f"for the part {name!r}; expected truth values of the shape {part.labels.shape}."
                )
        object.__setattr__(self, "parts", dict(self.parts))
        object.__setattr__(self, "outputs", tuple(self.outputs))
        infos = {o.name: o for part in reversed([*self.parts.values()]) for o in part.labels.outputs}
        times = next(iter(self.parts.values())).labels.shape[1:]
        count = np.zeros((len(self.outputs), *times), dtype=int)
        if set(infos) == set(self.outputs):
            for rows, used in zip(self._rows, self._used, strict=True):
                count[rows] += used
        if set(infos) != set(self.outputs) or (count != 1).any() or len(set(self.outputs)) != len(self.outputs):
            names = (o.name for part in self.parts.values() for o in part.labels.outputs)
            raise StudyError(
                f"The parts of a ComposedChaos contain {', '.join(names)}; expected each of the outputs "
                f"{', '.join(self.outputs)} exactly once at each time."
            )
        first = next(iter(self.parts.values()))
        object.__setattr__(self, "labels", replace(first.labels, outputs=tuple(infos[name] for name in self.outputs)))
        object.__setattr__(self, "space", first.space)
        object.__setattr__(self, "elements", tuple(e for part in self.parts.values() for e in part.elements))
        alike = ("verification_germs", "verification_weights")
        same = all(np.array_equal(getattr(p, x), getattr(first, x)) for p in self.parts.values() for x in alike)
        known = same and first.verification_germs is not None
        response = self._gathered(lambda part: np.asarray(part.verification_response), 1) if known else None
        for name in alike:
            object.__setattr__(self, name, getattr(first, name) if known else None)
        object.__setattr__(self, "verification_response", response)
        longest = max((part.multi_index for part in self.parts.values()), key=len)
        object.__setattr__(self, "multi_index", longest)

    def __repr__(self) -> str:
        names = "; ".join(
            f"{name}: {', '.join(o.name for o in part.labels.outputs)}" for name, part in self.parts.items()
        )
        return f"<{type(self).__name__} of {', '.join(self.germ_names)} ({names})>"

    def _statistic(self, name: str, axis: int, part: Any = slice(None)) -> Array:
        return np.asarray(self._gathered(lambda one: one._statistic(name, axis), axis)[part])

    @property
    def shape_samples(self) -> int:
        """Number of surrogate samples for skewness and kurtosis, from the part with the fewest samples."""
        return min((part.shape_samples for part in self.parts.values() if part.shape_samples), default=0)

    def discontinuities(self) -> tuple[Discontinuity | None, ...]:
        """Return the suspected discontinuity of each output in the germ space; None if none, or not a polynomial.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> from uqmbd.results import ComposedChaos, PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("a", a)
        >>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
        >>> def part(name, mean):
        ...     return PolynomialChaos([[[mean]], [[0.5]]], [[0], [1]], space, labels([name], ["a"], [0.0]))
        >>> chaos = ComposedChaos(dict(first=part("x", 1.0), second=part("y", 2.0)), ("y", "x"))
        >>> chaos.discontinuities()  # none is suspected
        (None, None)
        """
        none = {name: (None,) * len(rows) for name, rows in zip(self.parts, self._rows, strict=True)}
        known = {name: p.discontinuities() for name, p in self.parts.items() if isinstance(p, PolynomialChaos)}
        return self._by_output(list((none | known).values()))

    def to_datasets(self) -> dict[str, xr.Dataset]:
        """Build the datasets of a propagator's node, by path below the node; see :meth:`from_datasets`.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> from uqmbd.results import ComposedChaos, PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("a", a)
        >>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
        >>> def part(name, mean):
        ...     return PolynomialChaos([[[mean]], [[0.5]]], [[0], [1]], space, labels([name], ["a"], [0.0]))
        >>> chaos = ComposedChaos(dict(first=part("x", 1.0), second=part("y", 2.0)), ("y", "x"))
        >>> sorted(chaos.to_datasets())
        ['composed/first/chaos', 'composed/second/chaos']
        """
        found = {}
        for (name, part), rows, used in zip(self.parts.items(), self._rows, self._used, strict=True):
            more: dict[str, Any] = {
                "place": ("output", np.array(rows), {"long_name": "number of the output in the study"})
            }
            if not used.all():
                about = {"long_name": "whether the surrogate uses this part for the output"}
                more["used"] = (part.labels.dims, used.astype(np.int8), about)
            found[f"composed/{name}/{stored_as(part)}"] = part.to_dataset().assign(more)
        return found

    @classmethod
    def from_datasets(cls, datasets: Mapping[str, tuple[str, xr.Dataset]]) -> ComposedChaos:
        """Return the surrogate from the kinds and datasets of its parts, without the mechanism.

        Raises
        ------
        uqmbd.StudyError
            If there are no datasets.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> from uqmbd.results import ComposedChaos, PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("a", a)
        >>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
        >>> def part(name, mean):
        ...     return PolynomialChaos([[[mean]], [[0.5]]], [[0], [1]], space, labels([name], ["a"], [0.0]))
        >>> chaos = ComposedChaos(dict(first=part("x", 1.0), second=part("y", 2.0)), ("y", "x"))
        >>> stored = chaos.to_datasets()
        >>> parts = {name: ("chaos", stored[f"composed/{name}/chaos"]) for name in ("first", "second")}
        >>> ComposedChaos.from_datasets(parts).mean.ravel().tolist()
        [2.0, 1.0]
        """
        if not datasets:
            raise StudyError("ComposedChaos.from_datasets: no datasets are given; expected one dataset for each part.")
        places = {
            str(name): int(place)
            for _, data in datasets.values()
            for name, place in zip(data["output"].values, data["place"].values, strict=True)
        }
        parts = {name: KINDS[kind](data) for name, (kind, data) in datasets.items()}
        used = {
            name: data["used"].values > 0 if "used" in data else np.ones(parts[name].labels.shape, dtype=bool)
            for name, (_, data) in datasets.items()
        }
        return cls(parts, tuple(sorted(places, key=lambda name: places[name])), used)

    def _of(self, fewer: Mapping[str, Sequence[int]]) -> Self:
        """Return the surrogate of some outputs and times, without unused parts."""
        rows = list(fewer.get("output", range(len(self.outputs))))
        times = fewer.get("time")
        parts, masks = {}, {}
        for (name, part), own, used in zip(self.parts.items(), self._rows, self._used, strict=True):
            masks[name] = used if times is None else used[:, list(times)]
            chosen = [k for row in rows if row in own and masks[name][k := own.index(row)].any()]
            masks[name] = masks[name][chosen]
            if chosen:
                parts[name] = part.selected(chosen, times)
        return replace(
            self,
            parts=parts,
            outputs=tuple(self.outputs[row] for row in rows),
            used={name: masks[name] for name in parts},
        )

    def _variables(self, stated: bool) -> dict[str, Any]:
        raise StudyError(f"A {type(self).__name__} consists of several datasets; {_SEVERAL}.")

    @classmethod
    def _arguments(cls, dataset: xr.Dataset | xr.DataTree) -> dict[str, Any]:
        raise StudyError(f"A {cls.__name__} consists of several datasets; {_SEVERAL}.")

    @property
    def _rows(self) -> list[list[int]]:
        return [[self.outputs.index(o.name) for o in part.labels.outputs] for part in self.parts.values()]

    def _why_unknown(self) -> dict[str, str]:
        return {name: why for part in self.parts.values() for name, why in part._why_unknown().items()}

    @property
    def _used(self) -> list[Mask]:
        """Masks of the times at which each part is used: (outputs of the part, T), or (outputs of the part,)."""
        if self.used is None:
            return [np.ones(part.labels.shape, dtype=bool) for part in self.parts.values()]
        return [np.asarray(self.used[name], dtype=bool).reshape(p.labels.shape) for name, p in self.parts.items()]

    def _gathered(self, read: Callable[[Part], Array], axis: int) -> Array:
        """Join values of the parts; outputs are along `axis`, and times, if any, along the next axis."""
        before, found = (slice(None),) * axis, None
        for part, rows, used in zip(self.parts.values(), self._rows, self._used, strict=True):
            values = read(part)
            if found is None:
                found = np.empty((*values.shape[:axis], len(self.outputs), *values.shape[axis + 1 :]), values.dtype)
            for k, row in enumerate(rows):
                where: tuple[Any, ...] = () if used[k].ndim == 0 else (used[k],)
                found[(*before, row, *where)] = values[(*before, k, *where)]
        assert found is not None
        return found

    def _evaluate(self, germs: Array) -> Array:
        return self._gathered(lambda part: part._evaluate(germs), 1)

    def _derivative(self, germs: Array, germ: int) -> Array:
        return self._gathered(lambda part: part._derivative(germs, germ), 1)

    def _sampler(self, germs: Array) -> SampleBlocks:
        drawn = [part._sampler(germs) for part in self.parts.values()]
        times = int(np.prod(self.labels.shape[1:]))
        owner = np.zeros((len(self.outputs), times), dtype=int)
        first = np.zeros(owner.shape, dtype=int)  # column of an output at a time in its part
        for k, (rows, used) in enumerate(zip(self._rows, self._used, strict=True)):
            for n, row in enumerate(rows):
                own = used[n].reshape(-1)
                owner[row, own] = k
                first[row, own] = n * times + np.flatnonzero(own)
        owners, columns = owner.reshape(-1), first.reshape(-1)
        # copy runs of consecutive columns of the same part
        breaks = np.flatnonzero((np.diff(owners) != 0) | (np.diff(columns) != 1)) + 1

        def pieces(part: slice) -> Sequence[tuple[SampleBlocks, slice]]:
            begin, end, _ = part.indices(len(owners))
            edges = [begin, *breaks[(breaks > begin) & (breaks < end)].tolist(), end]
            return [
                (drawn[owners[low]], slice(int(columns[low]), int(columns[low]) + high - low))
                for low, high in itertools.pairwise(edges)
                if high > low
            ]

        return SampleBlocks(
            lambda part: np.concatenate([one.columns(where) for one, where in pieces(part)], axis=1),
            lambda part: np.concatenate([one.rows(where) for one, where in pieces(part)], axis=0),
        )

    @cached_property
    def _stated_error(self) -> Array:
        return self._gathered(lambda part: part._stated_error, 0)

    @cached_property
    def _unseen(self) -> Array:
        return self._gathered(lambda part: part._unseen, 0)

    @cached_property
    def _constant(self) -> Mask:
        return np.asarray(self._gathered(lambda part: part._constant.astype(float), 0) > 0)

    def _suspicions(self) -> tuple[str, ...]:
        return self._by_output([part._suspicions() for part in self.parts.values()])

    def _verdicts_of_decay(self, tolerance: float) -> tuple[str, ...]:
        return self._by_output([part._verdicts_of_decay(tolerance) for part in self.parts.values()])

    def _by_output(self, statements: Sequence[tuple[_Statement, ...]]) -> tuple[_Statement, ...]:
        """Return a statement on each output, in order, from the part that provides the output at most times.

        `statements`: statements of each part on its outputs. A part with an empty statement is used only
        if the statements of all parts are empty.
        """
        found: dict[int, list[tuple[bool, int, _Statement]]] = {}
        for rows, used, own in zip(self._rows, self._used, statements, strict=True):
            for row, times, one in zip(rows, used, own, strict=True):
                found.setdefault(row, []).append((bool(one), int(np.sum(times)), one))
        return tuple(max(found[row], key=lambda one: one[:2])[2] for row in sorted(found))
