"""What a method of propagation is."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, Self

from uqmbd.errors import StudyError
from uqmbd.names import check_arguments, check_label, did_you_mean
from uqmbd.propagation.annotations import check_options, option_types, plain

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.mechanism import Mechanism
    from uqmbd.propagation.methods.estimate import Estimate, Sizing
    from uqmbd.propagation.problem import Problem

__all__ = ["Propagator", "check_propagators", "labelled"]


@dataclass(frozen=True, kw_only=True)
class Propagator(ABC):
    """A method that turns a problem into results; its options are its fields.

    A subclass is a frozen dataclass with keyword-only fields and a class attribute `name`.

    Parameters
    ----------
    label : str, optional
        Name of its results; default the registered name of the method.

    Raises
    ------
    uqmbd.StudyError
        If an option is unknown or has a value of a wrong type, or if the label cannot name the results of the method.

    Examples
    --------
    >>> from uqmbd_montecarlo import MonteCarlo
    >>> MonteCarlo(samples=100, seed=1, label="reference").node_name
    'reference'
    """

    name: ClassVar[str]
    requirements: ClassVar[bool] = False
    """Whether the method answers requirements itself: where `Problem.answers_requirements`, its node has the child
    ``requirements`` (`uqmbd.extend.requirements_dataset`).  Else it is run on the margins as if they were outputs."""
    label: str | None = None

    def __new__(cls, *arguments: Any, **options: Any) -> Self:
        """Refuse options that there are not, before ``__init__`` does so without a word on what there is."""
        taken = inspect.signature(cls.__init__).parameters
        unknown = [name for name in options if name not in taken]
        if unknown and not any(p.kind is p.VAR_KEYWORD for p in taken.values()):
            known = [name for name in taken if name != "self"]
            raise StudyError(
                f"{cls.__name__}: there is no option {unknown[0]!r}{did_you_mean(unknown[0], known) or '.'} "
                f"Its options are {', '.join(known)}."
            )
        check_arguments(cls.__name__, inspect.signature(cls.__init__), (None, *arguments), options, bound=True)
        check_options(cls, options)
        if options.get("label") is not None:
            check_label(options["label"])
        return super().__new__(cls)

    def __post_init__(self, *_: Any) -> None:
        """Make plain numbers of options with bounds, whatever kind of number they are given as."""
        annotations = option_types(type(self))
        for name in (field.name for field in fields(self) if field.init and field.name in annotations):
            object.__setattr__(self, name, plain(getattr(self, name), annotations[name]))

    @property
    def node_name(self) -> str:
        """The label, or the registered name."""
        return check_label(self.name if self.label is None else self.label)

    def obstacle(self, study: Any) -> str | None:
        """Return why this method cannot do a study, in one sentence, or None: `uqmbd check` shows it.

        A method may override it; it must not compute anything.

        Parameters
        ----------
        study : Study
        """
        return None

    def remarks(self, study: Any) -> tuple[str, ...]:
        """Return remarks on a study before it runs, as sentences without a full stop: `uqmbd check` shows them.

        A method may override it, and follow a realisation for it; by default there is nothing.

        Parameters
        ----------
        study : Study
        """
        return ()

    def watches(self, mechanism: Mechanism) -> Mapping[str, Any]:
        """Return what this method needs to know of each realisation besides the outputs: expressions by name.

        It finds them behind the outputs of `Problem.watching`.  A method may override it; by default there is nothing.

        Parameters
        ----------
        mechanism : Mechanism
            Of the study.
        """
        return {}

    def estimate(self, study: Any) -> Estimate | None:
        """Return what this method would take, or None if it cannot tell: `uqmbd check` shows it.

        A study that would take more memory than there is is refused before anything is computed.  A method may
        override it; it must neither compute nor allocate anything of that size.

        Parameters
        ----------
        study : Study

        Raises
        ------
        uqmbd.StudyError
            If it can tell already that it cannot do the study.
        """
        return None

    def sizing(self, study: Any, accuracy: float | None) -> Sizing | None:
        """Return how this method is made larger or smaller, or None if it cannot be: it then runs as it is.

        A run with a budget, or an accuracy, asks for it.  A method may override it, beside `estimate`, which tells
        what a size takes; it must not compute anything.

        Parameters
        ----------
        study : Study
        accuracy : float, optional
            What is asked for, for methods that end by themselves; None: as accurate as the budget allows.
        """
        return None

    @abstractmethod
    def propagate(self, problem: Problem) -> xr.DataTree:
        """Compute.

        Parameters
        ----------
        problem : Problem
            Inputs, outputs, times, and the means to compute realisations.

        Returns
        -------
        xarray.DataTree
            A node as `uqmbd.results.propagator_node` makes it.
        """


def check_propagators(propagators: Any, where: str) -> tuple[Propagator, ...]:
    """Return the propagators of a study, or say what is wrong with them."""
    if isinstance(propagators, (Propagator, type)):
        propagators = (propagators,)
    array = hasattr(propagators, "dtype")  # of numbers, and may be a huge one
    if array or isinstance(propagators, (str, bytes, Mapping)) or not isinstance(propagators, Iterable):
        raise StudyError(
            f"{where}: propagators is {propagators!r}; expected a list such as [MonteCarlo(samples=500, seed=1)]."
        )
    seen: set[str] = set()
    checked = tuple(propagators)
    for propagator in checked:
        if isinstance(propagator, type):
            raise StudyError(
                f"{where}: propagators holds the class {propagator.__name__}; "
                f"give it an object, as in {propagator.__name__}(...)."
            )
        if not isinstance(propagator, Propagator):
            raise StudyError(
                f"{where}: {propagator!r} is no propagator; expected objects such as MonteCarlo(samples=500, seed=1)."
            )
        if propagator.node_name in seen:
            raise StudyError(
                f"{where}: two propagators are called {propagator.node_name!r}; give each a label of "
                f"its own, e.g. {type(propagator).__name__}(..., label='{propagator.node_name}-2')."
            )
        seen.add(propagator.node_name)
    return checked


def labelled(propagators: Sequence[Propagator], only: Any, where: str) -> tuple[Propagator, ...]:
    """Return the propagators of some labels, or say which of them there are."""
    several = isinstance(only, Iterable) and not hasattr(only, "dtype")
    wanted = [only] if isinstance(only, str) else list(only) if several else []
    if not wanted or not all(isinstance(label, str) for label in wanted):
        raise StudyError(
            f"{where}: only is {only!r}; expected labels of its propagators: "
            f"{', '.join(p.node_name for p in propagators)}."
        )
    known = {p.node_name: p for p in propagators}
    unknown = [label for label in wanted if label not in known]
    if unknown:
        raise StudyError(f"{where} has no propagator {unknown[0]!r}; its propagators are: {', '.join(known)}.")
    return tuple(p for label, p in known.items() if label in wanted)
