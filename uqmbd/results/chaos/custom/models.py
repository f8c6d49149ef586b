"""The interface of a model of a plugin, and its class by the name that results store."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Protocol, Self, runtime_checkable

import xarray as xr
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.typing import Array

__all__ = ["SurrogateModel", "absent_model", "made", "model_class", "model_problem"]

made: dict[str, type] = {}
"""Classes of the models that this process made itself, by name: those of a script are no plugins."""


@runtime_checkable
class SurrogateModel(Protocol):
    """Interface of a model that a plugin fits: outputs as functions of the inputs, and arrays to store it.

    A plugin registers the class by the hook ``uqmbd_surrogates``. Results store its name and its arrays. They are read
    again by the registered class: nothing in a file is executed.

    Attributes
    ----------
    name : str
        Of the class, as ``"gaussian-process"``; results store it.

    Examples
    --------
    >>> import numpy as np
    >>> from uqmbd.extend import SurrogateModel
    >>> class Line:
    ...     name = "line"
    ...     def __init__(self, slope):
    ...         self.slope = slope  # (I, O, T)
    ...     def evaluate(self, inputs):
    ...         return np.tensordot(inputs, self.slope, 1)
    ...     def arrays(self):
    ...         return {"slope": self.slope}
    ...     @classmethod
    ...     def from_arrays(cls, arrays):
    ...         return cls(arrays["slope"])
    >>> isinstance(Line(np.ones((1, 1, 2))), SurrogateModel)
    True
    """

    name: ClassVar[str]

    def evaluate(self, inputs: Array) -> Array:
        """Return the outputs (K, O, T) at inputs (K, I), in their units and in the order of ``problem.inputs.names``.

        An optional method ``gradient(inputs)`` returns the derivatives (K, I, O, T). An optional attribute ``remedy``
        states what makes the error smaller, as ``"add training nodes"``; warnings print it.
        """
        ...

    def arrays(self) -> Mapping[str, NDArray[Any]]:
        """Return what the model consists of: arrays of numbers, of any shapes, by names that are identifiers."""
        ...

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Make the model from its arrays; its values are the same to the bit."""
        ...


def model_problem(cls: type) -> str:
    """Return what keeps a class from being the model of a surrogate, or nothing."""
    for method in ("evaluate", "arrays", "from_arrays"):
        if not callable(getattr(cls, method, None)):
            return f"which has no method {method}; see uqmbd.extend.SurrogateModel"
    return ""


def _find(name: str) -> type | None:
    from uqmbd.plugins import surrogates

    found = surrogates()
    return found[name] if name in found else made.get(name)


def model_class(name: str) -> type:
    """Return the class of a model by the name that results store."""
    found = _find(name)
    if found is None:
        raise StudyError(
            f"The surrogate is a model {name!r}, which no installed plugin registers: its numbers are loaded, but it "
            "cannot be evaluated. Install the package that registers it by the hook uqmbd_surrogates."
        )
    return found


def absent_model(data: xr.Dataset | xr.DataTree) -> str:
    """Return why a stored surrogate cannot be evaluated here, or nothing."""
    try:
        model_class(str(data.attrs.get("model", "")))
    except StudyError as error:
        return str(error)
    return ""
