"""Provide elements of a surrogate, and readouts, which compute outputs at times from coefficients of an element."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self, TypeAlias

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.results.schema import Labels
from uqmbd.threads import one_thread
from uqmbd.typing import Array, Index, Mask

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox, GermSpace

__all__ = [
    "Composed",
    "GermElement",
    "OverTime",
    "Piece",
    "Plain",
    "Readout",
    "SampledPiece",
    "SampleBlocks",
    "TermCoefficients",
]


class SampleBlocks(NamedTuple):
    """Functions that return samples for a slice of the O x T columns, as arrays (K, c) or transposed (c, K)."""

    columns: Callable[[slice], Array]
    rows: Callable[[slice], Array]


@dataclass(frozen=True, eq=False)
class GermElement:
    """Part of the germ space with coefficient arrays (P, ...), whose first axis is terms."""

    box: GermBox

    @property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """Coefficient arrays (P, ...) by name."""
        return {f.name: x for f in fields(self) if isinstance(x := getattr(self, f.name), np.ndarray)}

    def _among(self, box: GermBox, terms: int, rows: Sequence[int]) -> Self:
        """Return the element in another box with `terms` terms: present coefficients at `rows`, 0 elsewhere."""
        wide = {name: np.zeros((terms, *x.shape[1:]), np.result_type(x, float)) for name, x in self.arrays.items()}
        for name, x in self.arrays.items():
            wide[name][list(rows)] = x
        changes: dict[str, Any] = {"box": box, **wide}
        return replace(self, **changes)

    def _without(self, terms: Mask) -> Self:
        """Return the element with coefficients of masked terms (P,) set to 0."""
        shape = {name: (-1, *(1,) * (x.ndim - 1)) for name, x in self.arrays.items()}
        fewer: dict[str, Any] = {name: x * ~terms.reshape(shape[name]) for name, x in self.arrays.items()}
        return replace(self, **fewer)


@dataclass(frozen=True, eq=False)
class TermCoefficients(GermElement):
    """Coefficients (P, ...) of outputs at fixed times."""

    coefficients: Array


Piece: TypeAlias = "tuple[GermSpace, Index, GermElement]"  # an element with its local germ space and its terms (P, d)


@dataclass(frozen=True, eq=False)
class SampledPiece(ABC):
    """Samples in one element: their indices (K,), in any order, and basis (K, P)."""

    element: Any
    rows: NDArray[np.intp]
    basis: Array

    @abstractmethod
    def evaluate(self, outputs: slice, times: Array, found: Array) -> None:
        """Evaluate some outputs at increasing times (T,), into rows of (N, C, T)."""

    @abstractmethod
    def evaluate_change(self, change: Array, times: Array, found: Array) -> None:
        """Evaluate the first-order change of all outputs due to a basis change (K, P), into rows of (N, O, T)."""


class Readout:
    """Readout from coefficients to outputs at times; `name` is the name of the dataset of a surrogate."""

    name: ClassVar[str]


class OverTime(Readout, ABC):
    """Readout of outputs at any time, from elements with the same terms; moments come from samples."""

    needed: ClassVar[tuple[str, ...]]  # required variables of a dataset
    of_times: ClassVar[str]  # feature that needs times, for the message on outputs without times

    @abstractmethod
    def at(self, element: Any, rows: NDArray[np.intp], basis: Array) -> SampledPiece:
        """Prepare samples of an element from their indices (K,) and basis (K, P)."""

    def since(self, labels: Labels) -> Array:
        """Return times since an origin (T,), s."""
        return np.asarray(labels.times)

    @abstractmethod
    def variables(self, elements: Sequence[Any]) -> dict[str, Any]:
        """Return elements as variables of a dataset."""

    @classmethod
    @abstractmethod
    def read(cls, data: xr.Dataset, boxes: Sequence[GermBox]) -> tuple[Self, tuple[Any, ...]]:
        """Return the readout and the elements of a dataset."""

    def samples(self, sampled: Sequence[SampledPiece], labels: Labels) -> SampleBlocks:
        """Return samples in the order of their indices, output by output."""
        times, number = self.since(labels), sum(len(one.rows) for one in sampled)
        count, size = len(times), len(labels.outputs) * len(times)

        def columns(part: slice) -> Array:
            # `evaluate` writes whole outputs, so process one output at a time to limit the memory
            first, last, _ = part.indices(size)
            found = np.empty((number, last - first))
            for output in range(first // count, -(-last // count)):
                begin, end = max(first, output * count), min(last, (output + 1) * count)
                values = np.empty((number, 1, end - begin))
                for one in sampled:
                    one.evaluate(
                        slice(output, output + 1), times[begin - output * count : end - output * count], values
                    )
                found[:, begin - first : end - first] = values[:, 0]
            return found

        return SampleBlocks(columns, lambda part: np.ascontiguousarray(columns(part).T))


@dataclass(frozen=True, eq=False)
class SampledTerms(SampledPiece):
    """Samples of outputs at fixed times; all outputs and times are evaluated."""

    @property
    def flat(self) -> Array:
        """Coefficients (P, O x T)."""
        found: Array = self.element.coefficients.reshape(len(self.element.coefficients), -1)
        return found

    def evaluate(self, outputs: slice, times: Array, found: Array) -> None:
        """Evaluate all outputs at all their times, into rows of (N, O, T)."""
        found[self.rows] = self.summed(self.basis, found.shape[1:])

    def evaluate_change(self, change: Array, times: Array, found: Array) -> None:
        """Evaluate the change due to a change of the basis (K, P), into rows of (N, O, T)."""
        found[self.rows] = self.summed(change, found.shape[1:])

    def summed(self, basis: Array, shape: tuple[int, ...]) -> Array:
        """Return the sum (K, O, T) of the terms, weighted by the basis (K, P)."""
        with one_thread():
            found: Array = basis @ self.flat
        return found.reshape(len(basis), *shape)


class Plain(Readout):
    """Readout of outputs that are polynomials of the germs at each time."""

    name = "chaos"

    def at(self, element: TermCoefficients, rows: NDArray[np.intp], basis: Array) -> SampledPiece:
        """Prepare samples of an element from their indices (K,) and basis (K, P)."""
        return SampledTerms(element, rows, basis)

    def since(self, labels: Labels) -> Array:
        """Return an empty array, because the coefficients belong to fixed times."""
        return np.zeros(0)

    def samples(self, sampled: Sequence[Any], labels: Labels) -> SampleBlocks:
        """Return samples element by element."""
        return SampleBlocks(
            lambda part: np.concatenate([one.basis @ one.flat[:, part] for one in sampled]),
            lambda part: np.concatenate(
                [np.ascontiguousarray(one.flat[:, part].T) @ one.basis.T for one in sampled], axis=1
            ),
        )


class Composed(Readout):
    """Placeholder for surrogates whose parts have separate readouts."""

    name = "composed"
