"""Define the interface of a surrogate model of a plugin."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Protocol, Self, runtime_checkable

from numpy.typing import NDArray

from uqmbd.typing import Array

__all__ = ["SurrogateModel", "model_problem"]


@runtime_checkable
class SurrogateModel(Protocol):
    """Interface of a model that a plugin fits: outputs as functions of the inputs, and arrays for storage.

    A plugin registers the class by the hook ``uqmbd_surrogates``. Results store the name and the arrays of the model.
    The registered class reads these arrays; no content of a file is executed.

    Attributes
    ----------
    name : str
        Name of the class, such as ``"gaussian-process"``, which results store. Type checkers expect the annotation
        ``ClassVar[str]``.

    Examples
    --------
    >>> from typing import ClassVar
    >>> import numpy as np
    >>> from uqmbd.extend import SurrogateModel
    >>> class Line:
    ...     name: ClassVar[str] = "line"
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
        states how to reduce the error, such as ``"add training nodes"``; warnings print it.
        """
        ...

    def arrays(self) -> Mapping[str, NDArray[Any]]:
        """Return the data of the model: numeric arrays of any shape, by names that are identifiers."""
        ...

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Create the model from its arrays; its values are bitwise identical."""
        ...


def model_problem(cls: type) -> str:
    """Return why a class cannot be the model of a surrogate, or an empty text."""
    for method in ("evaluate", "arrays", "from_arrays"):
        if not callable(getattr(cls, method, None)):
            return f"which has no method {method}; see uqmbd.extend.SurrogateModel"
    return ""
