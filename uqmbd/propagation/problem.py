"""The problem that a propagator is given: inputs, outputs and times as data, and the runner that computes them.

Length: it is one class, whose public methods have sections on arguments and results.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.arguments import Count, NotNegative, Positive, Size, shown, typechecked
from uqmbd.errors import StudyError, StudyWarning
from uqmbd.progress import Progress, stage
from uqmbd.propagation.annotations import MethodClass
from uqmbd.propagation.execution import (
    Arrays,
    History,
    Kind,
    Margins,
    Observed,
    Realisations,
    event_histories,
    solver_counters,
)
from uqmbd.propagation.inputs import Existence
from uqmbd.propagation.observed_model import not_unique_attribute, step_attributes
from uqmbd.propagation.problem_data import ProblemData
from uqmbd.propagation.reduction import Reduction, Reductions
from uqmbd.propagation.runner import Runner
from uqmbd.randomness import GermSpace
from uqmbd.results import propagator_node
from uqmbd.typing import Array

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Problem", "Realisations"]


@dataclass(frozen=True)
class Problem(ProblemData):
    """Inputs, outputs and times of a study, and the runner that computes realisations.

    Attributes
    ----------
    study, mechanism, label : str
        Names; `label` is that of the propagator at work.
    inputs : JointInput
        Random variables with their joint distribution.
    times : array, shape (T,)
        Output times, s.
    rtol : float
        Relative tolerance of the integration.
    integrator : str
        Name of the integrator.
    kind : {"outputs", "scalars", "requirements"}
        What the outputs are: those over time, those without a time, or the margins of the requirements.
    over : array, optional
        Given where they are not those over time (`timeless`): the times of the study.  Of outputs without a time
        `times` is then its first time only, at which they stand.
    chosen : tuple of str, optional
        Given where the outputs are some of those without a time only.
    answers_requirements : bool
        Whether the node has to have a child ``requirements``, of a method that declares to make it itself.
    model : Model
        Equations and outputs, compiled.
    method_label : str
        Label of the method; parts of its work may have labels of their own.
    watched : Model, optional
        Equations with the outputs of the study and those that the method asks for (`Propagator.watches`).
    existence : Existence
        Which moments of the outputs exist.
    runner : Runner
        Executor, progress, checkpoint, ledger, clock and cache.

    Examples
    --------
    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(6, 7), units="rad/s")
    >>> mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    >>> wheel = mechanism.body("wheel", mass=1, inertia=1, angular_velocity=speed)
    >>> mechanism.output("angle", wheel.angle, units="rad")
    >>> study = uqmbd.Study("turning", mechanism, np.linspace(0, 2, 5), [Collocation(order=1)])
    >>> problem = study.problem(study.propagators[0])
    >>> problem.label, problem.labels.shape, problem.timeless
    ('collocation', (1, 5), False)
    >>> space = problem.germ_space()
    >>> rule = uqmbd.extend.gauss_tensor(space, 2)
    >>> response = problem.realise(space.to_inputs(rule.nodes)).response
    >>> round(float(rule.weights @ response[:, 0, -1]), 4)  # mean angle after 2 s: 13 rad
    13.0
    """

    runner: Runner = field(default_factory=Runner, repr=False, compare=False)

    def __getattr__(self, name: str) -> Any:
        """Return what was an attribute of the problem and is one of its runner, with a warning, until 0.2."""
        now = {"beside": "again"}.get(name, name)
        if hasattr(type(self), name):  # a property of the problem that raised an AttributeError of its own
            return object.__getattribute__(self, name)
        if now not in ("again", "checkpoint", "each", "executor", "known", "ledger", "observed", "spending"):
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        text = f"problem.{name} is problem.runner.{now} now; the old name is removed in version 0.2."
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return getattr(self.runner, now)

    @property
    def progress(self) -> Progress:
        """Receives how much of the work is done."""
        return self.runner.progress

    def clock(self) -> float:
        """Return seconds, with those that an interrupted run has spent on what need not be computed again."""
        return self.runner.clock()

    @property
    def folder(self) -> Path | None:
        """Folder of the run's files, if it has one."""
        return self.runner.folder

    def without_time(self) -> Problem:
        """Return the problem of the outputs without a time; what is known of them is not computed again."""
        return self._of("scalars", self.whole_times[:1], self.existence)

    def choosing(self, names: tuple[str, ...]) -> Problem:
        """Return the problem of some outputs without a time; where one does not happen, a realisation is censored."""
        return replace(self, chosen=names).using(observed=Observed())

    def of_requirements(self) -> Problem:
        """Return the problem whose outputs are the margins of the requirements, the smallest until each time."""
        return self._of("requirements", self.whole_times, Existence({}, {}, {}))

    def _of(self, kind: Kind, times: Array, existence: Existence) -> Problem:
        part = self.part(f"{self.label}-{kind}")
        return replace(part, kind=kind, over=self.whole_times, chosen=None, times=times, existence=existence)

    @typechecked
    def part(self, label: str) -> Problem:
        """Return the problem of a part of the work, whose label and stored chunks are its own.

        Parameters
        ----------
        label : str
            Of the part, as ``f"{problem.label}: control"``.
        """
        return replace(self, label=label, runner=self.runner.of(label))

    def using(self, **changes: Any) -> Problem:
        """Return the same problem with another executor, progress, checkpoint, ledger, clock or record.

        Parameters
        ----------
        **changes
            Fields of ``problem.runner``: ``executor``, ``progress``, ``checkpoint``, ``ledger``, ``clock``,
            ``spending``, ``observed``, ``known``, ``again``.
        """
        return replace(self, runner=replace(self.runner, **changes))

    @typechecked
    def watching(self, times: Array | None = None) -> Problem:
        """Return the problem whose outputs are those of the study, then what is watched, at any times (T,).

        Raises
        ------
        uqmbd.StudyError
            If the times do not increase.
        """
        # margins, and what sums a motion up, are those of the times of the study
        model = replace(self.watched or self.model, margins=None)
        if times is not None:
            model = replace(model, scalars=None)
        times = self.times if times is None else np.array(times, dtype=float)
        if times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
            raise StudyError(f"{self.label}: times is {shown(times)}; expected increasing times (T,), s.")
        other = replace(self, model=model, watched=None, times=times)
        return other.using(observed=Observed())

    @typechecked
    def realise(self, values: Array) -> Realisations:
        """Compute the response to each row of inputs, on all workers.

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs, in the order of ``inputs.names``.

        Returns
        -------
        Realisations
            The same bits for any number of workers.  Failures are a status, never an exception.
        """
        begin, parts = self.clock(), list(self.stream(values))
        return Realisations.joined(self.checked(values), parts, self.labels.shape, self.clock() - begin)

    @typechecked
    def margins(self, values: Array) -> Margins:
        """Compute the margins of the requirements for each row of inputs, on all workers.

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs, in the order of ``inputs.names``.

        Returns
        -------
        Margins
            What is known of realisations whose outputs have been computed is not computed again.

        Raises
        ------
        uqmbd.StudyError
            If the mechanism has no requirements.
        """
        if not self.requirements:
            raise StudyError(f"{self.label}: there are no requirements; state one by mechanism.require(name, ...).")
        own = self if self.kind == "requirements" else replace(self.of_requirements(), label=self.label)
        found = own.realise(values)
        if own is not self:
            self.runner.observed.counters.update(own.runner.observed.counters)
        return Margins.of(found, own.labels.shape)

    @typechecked
    def stream(self, values: Array) -> Iterator[Realisations]:
        """Compute the response to each row of inputs, a chunk of rows at a time, in their order.

        For ensembles whose responses are too many to be held at once.

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs, in the order of ``inputs.names``.

        Yields
        ------
        Realisations
            Of the next rows.
        """
        checked = self.checked(values)
        return self.runner.stream(self, checked) if len(checked) else iter(())

    @typechecked
    def reduce(
        self, values: Array, function: Reduction, arguments: tuple[Any, ...] = (), *, keep: Size = 0
    ) -> Reductions:
        """Compute the response to each row of inputs, and have those who compute apply a function to it.

        For ensembles whose responses are too many to be held, or to be sent: what is handed over, and held, does not
        grow with their number.  Where the run has a folder, each response is written there once, by who computes it, to
        the Zarr folder ``LABEL-samples.zarr``; a run that was interrupted goes on with what is there.

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs, in the order of ``inputs.names``.
        function : callable
            Of a module, so that it can be sent to a worker: from `Realisations` of some consecutive rows, the index of
            the first of them, and `arguments` to arrays by name, by arithmetic alone.
        arguments : tuple
            Plain data.
        keep : int
            Of how many of the first realisations the responses are handed over.

        Returns
        -------
        Reductions
            An iterable of `Reduced`, in the order of the rows: the same bits for any number of workers.  Its attribute
            ``store`` is then the `uqmbd.results.SampleStore` of all responses, or None without a folder.
        """
        return Reductions(self, self.runner, self.checked(values), function, arguments, keep)

    @typechecked
    def run(self, function: Callable[..., Arrays], tasks: Sequence[tuple[Any, ...]]) -> Iterator[Arrays]:
        """Do work that is not a row of realisations, on all workers, as a method that solves parts of its own does.

        Parameters
        ----------
        function : callable
            Of a module, so that it can be sent to a worker: from the model (as of :attr:`model`) and a task to arrays
            by name, by arithmetic alone.
        tasks : sequence of tuple
            Further arguments; plain data.

        Yields
        ------
        dict of str to numpy.ndarray
            Of each task, in order; the same bits for any number of workers.  What an interrupted run had finished is
            not done again.

        Raises
        ------
        uqmbd.IntegrationError
            If a task ends the worker that does it, and another one, too: its number and function.
        """
        return self.runner.run(self, function, tasks)

    @typechecked
    def timed(self, part: str) -> AbstractContextManager[None]:
        """Record what is spent within as a part of the wall time of the method.

        The whole is measured by whoever runs the method, and so are realisations, as integration: a method need not do
        anything.  What is in no part is ``other``.

        Parameters
        ----------
        part : {"integration", "fitting", "verification", "error estimation"}
            Realisations that are computed within the last two belong to them, and to ``integration`` elsewhere.

        Returns
        -------
        context manager
            What is spent while it is open is recorded, less what is spent in parts within it.

        Raises
        ------
        uqmbd.StudyError
            If there is no such part.

        Examples
        --------
        ``with problem.timed("fitting"): coefficients = solve(matrix, response)``
        """
        return self.runner.spending.part(part, self.runner.clock)

    @typechecked
    def germ_space(self, transform: str = "rosenblatt") -> GermSpace:
        """Return the germs of the inputs; see `uqmbd.extend.GermSpace.of`.

        Raises
        ------
        uqmbd.StudyError
            Where nothing is random, or an input has no polynomials.
        """
        self.require_random()
        if awaited := [v.name for v in self.inputs.variables if getattr(v.distribution, "tabulated", False)]:
            stage(self.progress, f"{self.label}: tables of quantiles of {', '.join(awaited)}")
        try:
            return GermSpace.of(self.inputs, transform)
        except StudyError as error:
            raise StudyError(f"{self.label}: {error}") from None

    @typechecked
    def histories(self, values: Array, points: Count, least: Size = 1, longer: Positive = 1.0) -> list[History]:
        """Follow realisations from event to event, for methods that expand event times; see `event_histories`.

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs.
        points : int
            Points of a segment, see `uqmbd.extend.AlignedElement.points`.
        least : int
            Segments that each realisation is to have, for which it is followed beyond the last output time, at most
            eight times as long.
        longer : float
            Where no further event ends a motion, its last segment lasts so many times as long as the output times.

        Returns
        -------
        list of History, length K
            In the order of the rows.

        Raises
        ------
        uqmbd.StudyError
            If the integrator of the study cannot do so.
        """
        self.require("segments")
        if self.model.controls:
            self.require("sampled_control")
        ends, about = (float(self.times[0]), float(self.times[-1])), (points, least, self.integrator, longer)
        return event_histories(self.run, self.checked(values), ends, self.rtol, *about)

    @typechecked
    def node(
        self,
        propagator: MethodClass,
        statistics: xr.Dataset,
        samples: xr.Dataset | None = None,
        *,
        nodes: xr.Dataset | None = None,
        realisations: Size,
        wall_time: NotNegative = 0.0,
        counters: Mapping[str, Any] | None = None,
        children: Mapping[str, xr.Dataset] | None = None,
        attrs: Mapping[str, Any] | None = None,
    ) -> xr.DataTree:
        """Make the node of a propagator, with its options as provenance.

        Parameters
        ----------
        propagator : Propagator
            The method at work.
        statistics : xarray.Dataset
            From `uqmbd.extend.statistics_dataset`, or of a surrogate.
        samples : xarray.Dataset, optional
            From `uqmbd.extend.sample_dataset` with ``kind="draws"``: drawn from the joint distribution of the inputs.
        nodes : xarray.Dataset, optional
            From `uqmbd.extend.sample_dataset` with ``kind="nodes"``: training points or quadrature nodes, from which no
            probability, quantile or histogram is counted.
        realisations : int
            How many were computed.
        wall_time : float
            s, of a node that is made outside of a study: one that runs a method measures it, and puts it in its place.
        counters, children, attrs : mapping, optional
            Solver counters, further datasets, further attributes.

        Returns
        -------
        xarray.DataTree
            As `uqmbd.results.validate` wants it.
        """
        options = {f.name: getattr(propagator, f.name) for f in fields(propagator) if f.name != "label"}
        statistics, sentences = self.existence.applied(statistics)
        for sentence in sentences:
            warnings.warn(f"{self.label}: {sentence}.", StudyWarning, stacklevel=3)
        return propagator_node(
            self.label,
            statistics,
            samples,
            nodes=nodes,
            propagator=propagator.name,
            seed=options.get("seed"),
            options=options,
            realisations=realisations,
            wall_time=wall_time,
            solver_counters=solver_counters(counters or {}),
            children=children,
            attrs={
                "start": self.model.start_at,
                **step_attributes(self.model.max_step, self.model.added_breaks),
                **not_unique_attribute(self.model),
                **({"warnings": json.dumps(sentences)} if sentences else {}),
                **(attrs or {}),
            },
        )
