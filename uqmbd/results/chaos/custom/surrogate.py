"""Provide a surrogate that evaluates a model of a plugin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.results.chaos.boxes import checked_weights, read_surrogate, verification_of
from uqmbd.results.chaos.custom.models import SurrogateModel, model_problem
from uqmbd.results.chaos.interface import Surrogate
from uqmbd.results.chaos.readouts import Readout, SampleBlocks
from uqmbd.results.schema import Labels
from uqmbd.results.storage import made_model, model_class, source_of_model
from uqmbd.typing import Array, Index, Mask

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox, GermSpace

__all__ = ["Custom", "CustomSurrogate"]

ROWS = 2048
"""Number of points at which a model is evaluated at once."""

PREFIX = "model_"
"""Prefix of the names of model arrays in a dataset; names of their dimensions end in a hyphen and a number.

Names of arrays are identifiers without hyphens, because a variable with the name of a dimension would be a coordinate.
"""

ROWS_OF = {"output": "row_of_output", "time": "row_of_time"}
"""Names of variables with indices of the model's outputs and times in a stored surrogate, by dimension."""

NO_TERMS = "A CustomSurrogate has no polynomial terms."

UNVERIFIED = (
    "This surrogate has no verification realisations, so it cannot state its error; pass verification_germs and "
    "verification_response to CustomSurrogate."
)


class Custom(Readout):
    """Readout of outputs from a model of a plugin."""

    name = "surrogate"


@typechecked
@dataclass(frozen=True, eq=False, repr=False)
class CustomSurrogate(Surrogate):
    """Outputs from a model of a plugin, with the interface of all surrogates: samples, statistics, stated errors.

    A propagator passes the results of `statistics` and `to_datasets` to `uqmbd.extend.Problem.node`.

    Parameters
    ----------
    model : SurrogateModel
        Model that evaluates the outputs and consists of arrays.
    space : GermSpace
        Germ space of the inputs, from ``problem.germ_space()``.
    labels : Labels
        Labels of the axes, with O outputs, I inputs and T times.
    verification_germs, verification_response : array, shapes (V, d) and (V, O, T), optional
        Verification realisations, which did not affect the model; the stated error is computed from them. Without them,
        requirements have intervals from 0 to 1.
    verification_weights : array, shape (V,), optional
        Weights of the verification realisations. Default: equal weights.

    Raises
    ------
    uqmbd.StudyError
        If the model has no name or lacks a method, or arrays have other shapes.

    Examples
    --------
    >>> from typing import ClassVar
    >>> import chaospy, uqmbd
    >>> import numpy as np
    >>> from uqmbd.extend import CustomSurrogate, GermSpace, labels
    >>> class Square:
    ...     name: ClassVar[str] = "square"
    ...     def evaluate(self, inputs):
    ...         return inputs[:, :, None] ** 2
    ...     def arrays(self):
    ...         return {}
    ...     @classmethod
    ...     def from_arrays(cls, arrays):
    ...         return cls()
    >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
    >>> mechanism.output("a", uqmbd.RandomVariable("a", chaospy.Uniform(0, 1)))
    >>> chaos = CustomSurrogate(Square(), GermSpace.of(mechanism.inputs), labels(["x"], ["a"], [0.0]))
    >>> chaos.evaluate([[0.5]]).tolist(), chaos.mean.round(3).tolist()
    ([[[0.25]]], [[0.333]])
    >>> CustomSurrogate.from_dataset(chaos.to_dataset()).evaluate([[0.5]]).tolist()
    [[[0.25]]]
    """

    model: SurrogateModel
    space: GermSpace
    labels: Labels
    verification_germs: Array | None = None
    verification_response: Array | None = None
    verification_weights: Array | None = None
    rows: tuple[tuple[int, ...], tuple[int, ...]] | None = None
    """Indices of the outputs and times of the model in this surrogate; None for all."""
    multi_index: Index = field(init=False)
    elements: tuple[Any, ...] = field(init=False, default=())

    _kind = Custom

    def __post_init__(self) -> None:
        """Check the model and the verification realisations."""
        kind, name = type(self.model), getattr(self.model, "name", None)
        if problem := model_problem(kind):
            raise StudyError(f"CustomSurrogate: model is a {kind.__qualname__}, {problem}.")
        if not isinstance(name, str) or not name.strip():
            raise StudyError(
                f"CustomSurrogate: the name of {kind.__qualname__} is {name!r}; expected a non-empty string."
            )
        made_model(name, kind)
        object.__setattr__(self, "multi_index", np.zeros((0, self.space.dimension), dtype=np.int64))
        weights = checked_weights(self.verification_weights, self.verification_germs)
        object.__setattr__(self, "verification_weights", weights)
        if self.verification_germs is None:
            return
        count = len(self.verification_germs)
        shapes: dict[str, tuple[int, ...]] = {
            "germs": (count, self.space.dimension),
            "response": (count, *self.labels.shape),
        }
        for part, shape in shapes.items():
            given = np.shape(getattr(self, f"verification_{part}"))
            if given != shape:
                raise StudyError(f"CustomSurrogate: verification_{part} has the shape {given}; expected {shape}.")

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.model.name!r} of {', '.join(self.germ_names)}>"

    @property
    def _remedy(self) -> str:
        return str(getattr(self.model, "remedy", ""))

    @property
    def _advice(self) -> str:
        return "pass more verification_germs and verification_response"

    @property
    def _verified(self) -> tuple[Array, Array, Array]:
        if self.verification_germs is None:
            raise StudyError(UNVERIFIED)
        return super()._verified

    @property
    def top_energy(self) -> Array:
        """Raise StudyError, because the model has no terms."""
        raise StudyError(NO_TERMS)

    @property
    def top_energy_germ(self) -> Array:
        """Raise StudyError, because the model has no terms."""
        raise StudyError(NO_TERMS)

    @property
    def _reader(self) -> Any:
        return self._kind()

    @property
    def _boxes(self) -> tuple[GermBox, ...]:
        from uqmbd.randomness import GermBox

        return (GermBox.whole(self.space),)

    def _evaluate(self, germs: Array) -> Array:
        return self._evaluate_inputs(np.asarray(self.space.to_inputs(germs), dtype=float))

    def _evaluate_inputs(self, points: Array) -> Array:
        found = np.empty((len(points), *self.labels.shape))
        for first in range(0, len(points), ROWS):
            part = points[first : first + ROWS]
            found[first : first + ROWS] = self._own(self.model.evaluate(part), (len(part),), "evaluate")
        return found

    def _at_inputs(self, points: Array) -> Array:
        self.space.to_germs(points)  # raises StudyError for points outside the distributions
        return self._evaluate_inputs(points)

    def _input_gradient(self, points: Array) -> Array:
        gradient = getattr(self.model, "gradient", None)
        if not callable(gradient):
            raise StudyError(
                f"The model {self.model.name!r} of this surrogate has no gradient; its class defines gradient(inputs)."
            )
        self.space.to_germs(points)  # raises StudyError for points outside the distributions
        return self._own(gradient(points), points.shape, "gradient")

    def _derivative(self, germs: Array, germ: int) -> Array:
        raise StudyError("A CustomSurrogate has derivatives with respect to inputs only; use gradient.")

    def _own(self, values: Any, begin: tuple[int, ...], method: str) -> Array:
        """Check values of the model, and return the values at outputs and times of this surrogate, (K, ..., O, T)."""
        found = np.asarray(values)
        rows, size = self.rows, len(begin)
        # this surrogate may have fewer outputs and times than its model
        known = found.ndim == size + 2 and found.shape[:size] == begin and found.dtype.kind in "fiu"
        whole = len(self.labels.outputs), len(self.labels.times) if self.labels.times is not None else 1
        fits = known and (found.shape[size:] == whole if rows is None else _reaches(found.shape[size:], rows))
        if not fits:
            expected = "outputs and times of all rows" if rows is not None else f"shape {(*begin, *whole)}"
            raise StudyError(
                f"{method} of the model {self.model.name!r} returned {found.dtype} of the shape {found.shape}; "
                f"expected real numbers, {expected}."
            )
        if not np.isfinite(found).all():
            raise StudyError(f"{method} of the model {self.model.name!r} returned values that are not finite.")
        if rows is not None:
            found = found[..., list(rows[0]), :][..., list(rows[1])]
        return np.asarray(found.reshape(*begin, *self.labels.shape), dtype=float)

    def _sampler(self, germs: Array) -> SampleBlocks:
        def columns(part: slice) -> Array:
            first, last, _ = part.indices(int(np.prod(self.labels.shape)))
            found = np.empty((len(germs), last - first))
            for k in range(0, len(germs), ROWS):
                some = self._evaluate(germs[k : k + ROWS])
                found[k : k + ROWS] = some.reshape(len(some), -1)[:, first:last]
            return found

        return SampleBlocks(columns, lambda part: np.ascontiguousarray(columns(part).T))

    def _without(self, terms: Mask, germs: Array) -> Array:
        raise StudyError(NO_TERMS)

    def _verdicts_of_decay(self, tolerance: float) -> tuple[str, ...]:
        raise StudyError(UNVERIFIED)

    def _variables(self, stated: bool) -> dict[str, Any]:
        whole = (range(len(self.labels.outputs)), range(len(self.labels.times) if self.labels.times is not None else 1))
        rows = [np.array(one, dtype=np.int64) for one in (self.rows or whole)]
        timed = self.labels.times is not None
        found: dict[str, Any] = {ROWS_OF["output"]: ("output", rows[0], {"long_name": "number in the model"})}
        found[ROWS_OF["time"]] = (("time",) if timed else (), rows[1] if timed else rows[1][0])
        for name, value in self.model.arrays().items():
            array = np.asarray(value)
            if not str(name).isidentifier() or array.dtype.kind not in "fiub":
                raise StudyError(
                    f"arrays of the model {self.model.name!r} contain {name!r} of the type {array.dtype}; expected "
                    "real numbers by names that are identifiers."
                )
            found[f"{PREFIX}{name}"] = (tuple(f"{PREFIX}{name}-{k}" for k in range(array.ndim)), array)
        return found

    def _dataset(self, *, stated: bool) -> xr.Dataset:
        name = self.model.name
        about = {"model": name, "model_source": source_of_model(name, type(self.model)), "remedy": self._remedy}
        return super()._dataset(stated=stated).assign_attrs(about)

    def _of(self, fewer: Mapping[str, Sequence[int]]) -> Self:
        # reuse the model, because another class may have the same name now
        return type(self)(**self._rest(self._dataset(stated=False).isel(dict(fewer))), model=self.model)

    @classmethod
    def _arguments(cls, dataset: xr.Dataset | xr.DataTree) -> dict[str, Any]:
        kind: Any = model_class(dataset)
        named = {str(name): values.values for name, values in dataset.variables.items()}
        arrays = {name.removeprefix(PREFIX): values for name, values in named.items() if name.startswith(PREFIX)}
        return {"model": kind.from_arrays(arrays), **cls._rest(dataset)}

    @classmethod
    def _rest(cls, dataset: xr.Dataset | xr.DataTree) -> dict[str, Any]:
        """Return the arguments of the constructor from a dataset, without the model."""
        data, labels, space = read_surrogate(dataset, cls._kind.name, tuple(ROWS_OF.values()))
        found = [np.atleast_1d(data[name].values).tolist() for name in ROWS_OF.values()]
        rows = tuple(found[0]), tuple(found[1])
        return {"space": space, "labels": labels, "rows": rows, **verification_of(data)}


def _reaches(shape: tuple[int, ...], rows: tuple[tuple[int, ...], tuple[int, ...]]) -> bool:
    """Return whether indices of outputs and times are within the shape of a model."""
    return all(min(own) >= 0 and max(own) < size for own, size in zip(rows, shape, strict=True) if own)
