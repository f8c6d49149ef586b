"""Propagator under test: run it, or make it with another label or seed."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.plugins import InputTreatment, example_of
from uqmbd.propagation import Propagator, Study

__all__ = ["PropagatorUnderTest", "described", "quiet"]


@dataclass(frozen=True)
class PropagatorUnderTest:
    """Propagator under test, with a function that makes it with another label or seed."""

    make: Callable[..., Propagator]
    given: Propagator
    nodes: dict[Any, xr.DataTree] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, propagator: Propagator | Callable[..., Propagator]) -> PropagatorUnderTest:
        """Return the test object of a propagator, or of a callable that makes a propagator."""
        if isinstance(propagator, Propagator):
            parameters: Any = vars(type(propagator)).get("__dataclass_params__")
            assert parameters is not None and parameters.frozen, (
                f"{type(propagator).__name__}: options: the class is not a frozen dataclass. Decorate it with "
                "@dataclass(frozen=True, kw_only=True), so that its options are recorded and cannot change."
            )
            given = propagator
            return cls(lambda **changes: dataclasses.replace(given, **changes), given)
        made = propagator()
        if not isinstance(made, Propagator):
            raise StudyError(
                f"check_propagator: {propagator!r} returned {made!r}; expected a uqmbd.extend.Propagator as the "
                f"return value, e.g. {example_of(InputTreatment.SAMPLE)}."
            )
        return cls(propagator, made)

    @property
    def title(self) -> str:
        """Return the title for messages."""
        return described(self.given)

    def node(
        self, study: Study, prop: str, workers: int | Executor = 1, *, again: bool = False, **changes: Any
    ) -> xr.DataTree:
        """Run the method, or a variant of it, on a study; an error of the method violates the property `prop`.

        Results in this process are cached, unless `again` requests a repetition.
        """
        key = (study.name, *sorted(changes.items()))
        if workers == 1 and not again and key in self.nodes:
            return self.nodes[key]
        with self.unbroken(study, prop), quiet():
            node = study.propagate(self.make(**changes) if changes else self.given, workers)
        if workers == 1:
            self.nodes[key] = node
        return node

    @contextmanager
    def unbroken(self, study: Study, prop: str) -> Iterator[None]:
        """Convert an error in the context to a violated property."""
        try:
            yield
        except Exception as error:
            raise AssertionError(
                f"{self.title}: {prop}: study {study.name!r} raised {type(error).__name__}: {error}"
            ) from error


def described(propagator: Propagator) -> str:
    """Return the class of a propagator and its options that differ from the defaults, as text.

    >>> from uqmbd_montecarlo import MonteCarlo
    >>> described(MonteCarlo(samples=100, seed=0))
    'MonteCarlo(samples=100)'
    """
    given = {f.name: (getattr(propagator, f.name), f.default) for f in dataclasses.fields(propagator)}
    options = ", ".join(f"{name}={value!r}" for name, (value, default) in given.items() if value != default)
    return f"{type(propagator).__name__}({options})"


@contextmanager
def quiet() -> Iterator[list[warnings.WarningMessage]]:
    """Collect warnings in the context, because methods may issue warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield caught
