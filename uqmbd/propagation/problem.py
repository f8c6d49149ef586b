"""Problem of a propagator: computation of realisations, and the node of the results."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

from uqmbd.arguments import Count, NotNegative, Positive, Size, typechecked
from uqmbd.errors import StudyError, StudyWarning
from uqmbd.progress import stage
from uqmbd.propagation.annotations import MethodClass
from uqmbd.propagation.execution import (
    Arrays,
    History,
    Margins,
    Realisations,
    event_histories,
    solver_counters,
)
from uqmbd.propagation.observed_model import not_unique_attribute, step_attributes
from uqmbd.propagation.reduction import Reduction, Reductions
from uqmbd.propagation.runner import ProblemData
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
        Names of the study and the mechanism, and label of the running propagator.
    inputs : JointInput
        Random variables with their joint distribution.
    times : array, shape (T,)
        Output times, s.
    rtol : float
        Relative tolerance of the integration.
    integrator : str
        Name of the integrator.
    kind : {"outputs", "scalars", "requirements"}
        Kind of the outputs: outputs over time, scalar outputs, or margins of the requirements.
    over : array, optional
        Times of the study, if the outputs are scalar outputs or margins (`timeless`). For scalar outputs, `times`
        contains only the first time.
    chosen : tuple of str, optional
        Names of the selected scalar outputs, if the problem has only a subset.
    answers_requirements : bool
        Whether the method declares that it builds the child ``requirements`` of its node.
    model : Model
        Equations and outputs, compiled.
    method_label : str
        Label of the method; parts of its computation may have separate labels.
    watched : Model, optional
        Model with the outputs of the study and the expressions that the method observes (`Propagator.watches`).
    existence : Existence
        Existing moments of the outputs.
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

    @typechecked
    def realise(self, values: Array) -> Realisations:
        """Compute the response to each row of inputs, on all workers.

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs of the realisations, in the order of ``inputs.names``.

        Returns
        -------
        Realisations
            Realisations, with the same bits for any number of workers. A failure is a status, never an exception.
        """
        begin, parts = self.clock(), list(self.stream(values))
        return Realisations.joined(self.checked(values), parts, self.labels.shape, self.clock() - begin)

    @typechecked
    def margins(self, values: Array) -> Margins:
        """Compute the margins of the requirements for each row of inputs, on all workers.

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs of the realisations, in the order of ``inputs.names``.

        Returns
        -------
        Margins
            Margins of the realisations. Realisations whose outputs were computed before are reused.

        Raises
        ------
        uqmbd.StudyError
            If the mechanism has no requirements.
        """
        if not self.requirements:
            raise StudyError(
                f"{self.label}: the mechanism has no requirements; add one with mechanism.require(name, ...)."
            )
        own = self if self.kind == "requirements" else replace(self.of_requirements(), label=self.label)
        found = own.realise(values)
        if own is not self:
            self.runner.observed.counters.update(own.runner.observed.counters)
        return Margins.of(found, own.labels.shape)

    @typechecked
    def stream(self, values: Array) -> Iterator[Realisations]:
        """Compute the response to each row of inputs, in chunks of rows, in the order of the rows.

        Use this method for ensembles whose responses do not fit into memory.

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs of the realisations, in the order of ``inputs.names``.

        Yields
        ------
        Realisations
            Realisations of the next rows.
        """
        checked = self.checked(values)
        return self.runner.stream(self, checked) if len(checked) else iter(())

    @typechecked
    def reduce(
        self, values: Array, function: Reduction, arguments: tuple[Any, ...] = (), *, keep: Size = 0
    ) -> Reductions:
        """Compute the response to each row of inputs; the workers apply a function to the responses.

        Use this method for ensembles whose responses are too large to be stored in memory or sent. The amount of data
        that is sent and stored in memory does not grow with the number of responses. If the run has a folder, the
        process that computes a response writes it once, to the Zarr folder ``LABEL-samples.zarr``. A resumed run
        continues with the stored responses.

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs of the realisations, in the order of ``inputs.names``.
        function : callable
            Function of a module, which workers can import. The function maps `Realisations` of consecutive rows, the
            index of the first row, and `arguments` to arrays by name, without side effects.
        arguments : tuple
            Further arguments of `function`; plain data.
        keep : int
            Number of first realisations whose responses are returned.

        Returns
        -------
        Reductions
            Iterable of `Reduced`, in the order of the rows, with the same bits for any number of workers. The attribute
            ``store`` is the `uqmbd.results.SampleStore` of all responses, or None without a folder.
        """
        return Reductions(self, self.runner, self.checked(values), function, arguments, keep)

    @typechecked
    def run(self, function: Callable[..., Arrays], tasks: Sequence[tuple[Any, ...]]) -> Iterator[Arrays]:
        """Run tasks other than realisations on all workers, for methods with further computations.

        Parameters
        ----------
        function : callable
            Function of a module, which workers can import. The function maps the model (:attr:`model`) and a task to
            arrays by name, without side effects.
        tasks : sequence of tuple
            Further arguments of `function` for each task; plain data.

        Yields
        ------
        dict of str to numpy.ndarray
            Arrays of each task, in order, with the same bits for any number of workers. A resumed run does not repeat
            finished tasks.

        Raises
        ------
        uqmbd.IntegrationError
            If a task ends its worker, and then a second worker. The message states the number and function of the task.
        """
        return self.runner.run(self, function, tasks)

    @typechecked
    def timed(self, part: str) -> AbstractContextManager[None]:
        """Record the time within the context as a part of the wall time of the method.

        Methods may omit this call: the caller of the method measures the total time, and the time of realisations as
        integration. Time outside all parts is ``other``.

        Parameters
        ----------
        part : {"integration", "fitting", "verification", "error estimation"}
            Part of the method. Realisations computed within the last two parts belong to them; other realisations
            belong to ``integration``.

        Returns
        -------
        context manager
            Context that records its duration, without the duration of contexts within it.

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
            If there are no random inputs, or an input has no orthogonal polynomials.
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
        """Integrate realisations from event to event, for methods that expand event times; see `event_histories`.

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs of the realisations, in the order of ``inputs.names``.
        points : int
            Number of points in a segment, see `uqmbd.extend.AlignedElement.points`.
        least : int
            Minimum number of segments of each realisation. If necessary, the integration continues beyond the last
            output time, up to eight times the span of the output times.
        longer : float
            Length of the last segment of a motion without a further event, relative to the span of the output times.

        Returns
        -------
        list of History, length K
            Histories in the order of the rows.

        Raises
        ------
        uqmbd.StudyError
            If the integrator of the study cannot locate segments.
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
            Running propagator.
        statistics : xarray.Dataset
            Statistics from `uqmbd.extend.statistics_dataset`, or of a surrogate.
        samples : xarray.Dataset, optional
            Samples from `uqmbd.extend.sample_dataset` with ``kind="draws"``: draws from the joint distribution of the
            inputs.
        nodes : xarray.Dataset, optional
            Training points or quadrature nodes, from `uqmbd.extend.sample_dataset` with ``kind="nodes"``. Reports do
            not compute probabilities, quantiles or histograms from these points.
        realisations : int
            Number of computed realisations.
        wall_time : float
            Wall-clock time in s of a node that is built outside a study. Within a study, the run replaces this value
            with the measured time.
        counters, children, attrs : mapping, optional
            Solver counters, further datasets, further attributes.

        Returns
        -------
        xarray.DataTree
            Node that `uqmbd.results.validate` accepts.
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
