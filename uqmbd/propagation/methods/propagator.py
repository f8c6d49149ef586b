"""Interface of propagation methods."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, Self

from uqmbd.errors import StudyError
from uqmbd.names import check_arguments, check_label, did_you_mean
from uqmbd.plugins import InputTreatment, declared_treatment, example_of
from uqmbd.propagation.annotations import check_options, option_types, plain

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.mechanism import Mechanism
    from uqmbd.propagation.methods.estimate import Estimate, Sizing
    from uqmbd.propagation.problem import Problem

__all__ = ["Propagator", "check_propagators", "labelled"]


@dataclass(frozen=True, kw_only=True)
class Propagator(ABC):
    """Method that computes results of a problem; the fields of the class are the options.

    A subclass is a frozen dataclass with keyword-only fields and a class attribute `name`.

    Parameters
    ----------
    label : str, optional
        Name of the results. Default: the registered name of the method.

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
    """Whether the method evaluates requirements itself.

    If `Problem.answers_requirements` is true, the node of such a method has the child ``requirements``
    (`uqmbd.extend.requirements_dataset`). For other methods, uqmbd computes the margins of the requirements in a second
    run, as outputs.
    """
    input_treatment: ClassVar[InputTreatment] = InputTreatment.INTERPOLATE
    """Treatment of the inputs: interpolation, average over sampled paths, or sampling (`InputTreatment`)."""
    searches_violations: ClassVar[bool] = False
    """Whether the method searches for violations of requirements, and so finds rare ones at less cost than samples.

    Messages on rare violations name such methods.
    """
    label: str | None = None

    def __init_subclass__(cls, **options: Any) -> None:
        """Set the declared treatment of inputs after a check."""
        super().__init_subclass__(**options)
        cls.input_treatment = declared_treatment(cls)

    def __new__(cls, *arguments: Any, **options: Any) -> Self:
        """Reject unknown options before ``__init__`` does, with a message that lists the known options."""
        taken = inspect.signature(cls.__init__).parameters
        unknown = [name for name in options if name not in taken]
        if unknown and not any(p.kind is p.VAR_KEYWORD for p in taken.values()):
            known = [name for name in taken if name != "self"]
            raise StudyError(
                f"{cls.__name__}: unknown option {unknown[0]!r}{did_you_mean(unknown[0], known) or '.'} Its options "
                f"are {', '.join(known)}."
            )
        check_arguments(cls.__name__, inspect.signature(cls.__init__), (None, *arguments), options, bound=True)
        check_options(cls, options)
        if options.get("label") is not None:
            check_label(options["label"])
        return super().__new__(cls)

    def __post_init__(self, *_: Any) -> None:
        """Convert numeric options with bounds into Python numbers."""
        annotations = option_types(type(self))
        for name in (field.name for field in fields(self) if field.init and field.name in annotations):
            object.__setattr__(self, name, plain(getattr(self, name), annotations[name]))

    @property
    def node_name(self) -> str:
        """Return the label, or the registered name."""
        return check_label(self.name if self.label is None else self.label)

    def obstacle(self, study: Any) -> str | None:
        """Return the reason, in one sentence, why this method cannot compute a study, or None.

        `uqmbd check` shows the reason. A subclass may override this method; an override must not start computations.

        Parameters
        ----------
        study : Study
            Study to be run.
        """
        return None

    def remarks(self, study: Any) -> tuple[str, ...]:
        """Return remarks on a study before it runs, as sentences without a full stop.

        `uqmbd check` shows the remarks. A subclass may override this method, which then may integrate at most one
        realisation. By default there are no remarks.

        Parameters
        ----------
        study : Study
            Study to be run.
        """
        return ()

    def watches(self, mechanism: Mechanism) -> Mapping[str, Any]:
        """Return the expressions, by name, that this method observes in addition to the outputs.

        `Problem.watching` returns a problem in which these expressions are appended to the outputs. A subclass may
        override this method; by default there are no such expressions.

        Parameters
        ----------
        mechanism : Mechanism
            Mechanism of the study.
        """
        return {}

    def estimate(self, study: Any) -> Estimate | None:
        """Return the estimated cost of this method, or None if unknown.

        `uqmbd check` shows the cost. A study that would exceed the available memory is rejected before the computation.
        A subclass may override this method; an override must neither compute nor allocate data of the estimated size.

        Parameters
        ----------
        study : Study
            Study to be run.

        Raises
        ------
        uqmbd.StudyError
            If the estimate already shows that the method cannot compute the study.
        """
        return None

    def sizing(self, study: Any, accuracy: float | None) -> Sizing | None:
        """Return the possible sizes of this method, or None if its size is fixed.

        A run with a budget or an accuracy chooses one of the sizes. A subclass may override this method together with
        `estimate`, which states the cost of a size. An override must not start computations.

        Parameters
        ----------
        study : Study
            Study to be run.
        accuracy : float, optional
            Required accuracy, for methods that end automatically. None means the highest accuracy that the budget
            allows.
        """
        return None

    @abstractmethod
    def propagate(self, problem: Problem) -> xr.DataTree:
        """Compute the results.

        Parameters
        ----------
        problem : Problem
            Inputs, outputs and times, and the functions that compute realisations.

        Returns
        -------
        xarray.DataTree
            Node from `uqmbd.results.propagator_node`.
        """


def check_propagators(propagators: Any, where: str) -> tuple[Propagator, ...]:
    """Return the propagators of a study after a check."""
    if isinstance(propagators, (Propagator, type)):
        propagators = (propagators,)
    array = hasattr(propagators, "dtype")  # an array of numbers, which may be very large
    if array or isinstance(propagators, (str, bytes, Mapping)) or not isinstance(propagators, Iterable):
        raise StudyError(
            f"{where}: propagators is {propagators!r}; expected a list such as [{example_of(InputTreatment.SAMPLE)}]."
        )
    seen: set[str] = set()
    checked = tuple(propagators)
    for propagator in checked:
        if isinstance(propagator, type):
            raise StudyError(
                f"{where}: propagators contains the class {propagator.__name__}; expected an object, e.g. "
                f"{propagator.__name__}(...)."
            )
        if not isinstance(propagator, Propagator):
            raise StudyError(
                f"{where}: {propagator!r} is not a propagator; expected objects such as "
                f"{example_of(InputTreatment.SAMPLE)}."
            )
        if propagator.node_name in seen:
            raise StudyError(
                f"{where}: two propagators have the label {propagator.node_name!r}; give each a different label, "
                f"e.g. {type(propagator).__name__}(..., label='{propagator.node_name}-2')."
            )
        seen.add(propagator.node_name)
    return checked


def labelled(propagators: Sequence[Propagator], only: Any, where: str) -> tuple[Propagator, ...]:
    """Return the propagators with the given labels; the error on an unknown label lists the known labels."""
    several = isinstance(only, Iterable) and not hasattr(only, "dtype")
    chosen = [only] if isinstance(only, str) else list(only) if several else []
    if not chosen or not all(isinstance(label, str) for label in chosen):
        raise StudyError(
            f"{where}: only={only!r}; expected labels of its propagators: "
            f"{', '.join(p.node_name for p in propagators)}."
        )
    known = {p.node_name: p for p in propagators}
    unknown = [label for label in chosen if label not in known]
    if unknown:
        raise StudyError(f"{where} has no propagator {unknown[0]!r}; its propagators are: {', '.join(known)}.")
    return tuple(p for label, p in known.items() if label in chosen)
