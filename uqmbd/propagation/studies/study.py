"""Studies: run and compare the methods of a study."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.names import check_name, checked
from uqmbd.plugins import InputTreatment, example_of
from uqmbd.progress import Progress, choose_receiver
from uqmbd.propagation.budget import BudgetTerms
from uqmbd.propagation.convergence import check_convergence_of, with_convergence
from uqmbd.propagation.execution import opened, pool
from uqmbd.propagation.inputs import existence_of
from uqmbd.propagation.methods import Propagator, check_propagators, labelled, run_method
from uqmbd.propagation.observed_model import warn_once, warned_elsewhere
from uqmbd.propagation.options import (
    check_breaks,
    check_folder,
    check_integrator,
    check_max_step,
    check_report_times,
    check_rtol,
    check_start,
    check_timeless,
    check_times,
)
from uqmbd.propagation.studies.checks import warned_findings
from uqmbd.propagation.studies.outcome import joined, run_methods
from uqmbd.propagation.studies.study_data import StudyData

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.mechanism import Mechanism
    from uqmbd.propagation.problem import Problem

__all__ = ["Study"]


class Study(StudyData):
    """A mechanism, output times, and propagators.

    Parameters
    ----------
    name : str
        Name of the study in data and reports.
    mechanism : Mechanism
        Mechanism with at least one output.
    times : array_like, shape (T,), optional
        Output times, s, strictly increasing; the first is the initial time. Times may be omitted if no output depends
        on time or requires a motion, as for natural frequencies. In this case, the default is the single time 0 s.
    propagators : sequence of Propagator
        Methods, each with a unique label.
    rtol : float
        Relative tolerance of the integration.
    integrator : str
        Name of the integrator. ``auto``: explicit, but implicit for stiff realisations and IDA for large mechanisms.
        ``dop853``: explicit for all realisations. ``radau``: implicit. ``ida``: IDA. Plugins register others.
    start : {"drawn", "equilibrium"}
        Initial pose of each realisation. ``drawn``: the given pose, assembled. ``equilibrium``: the static equilibrium
        of the realisation, at rest; the search starts from the given pose. At the equilibrium, stated velocities keep
        their values, and moving drivers move their bodies. A realisation without an equilibrium fails.
    report_times : sequence of float
        Times in s at which the report shows distributions. Default: times that the report chooses.
    convergence : mapping, optional
        Arguments of :meth:`converge`, for the curves of error against cost in the report. A run computes the curves
        after the methods. Example: ``{"propagators": [Collocation, MonteCarlo(seed=1)], "order": [1, 2, 3], "samples":
        [50, 200], "reference": "monte-carlo"}``. The reference may be the label of a propagator of the study.
    max_step : float, optional
        Longest step of the integration, s. Default: only the error estimate limits the step. Set a limit for short
        actions that depend on state and time, such as a wave that runs along a mechanism. Before the integration, uqmbd
        searches functions that depend only on time for short pulses. The search finds pulses that are longer than
        1/8000 of the simulated time and longer than a quarter of the output interval. The search also finds shorter
        pulses unless they are small compared with the rest of the function.
    breaks : sequence of float
        Times in s at which the integration restarts. The integration also restarts at the corners of `uqmbd.step`, and
        at changes of conditions of a `sympy.Piecewise` that are linear in time.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid; the message states the expected value.

    Examples
    --------
    >>> import chaospy, numpy as np, uqmbd
    >>> from uqmbd_montecarlo import MonteCarlo
    >>> mechanism = uqmbd.Mechanism("fall", uqmbd.Translational(gravity=(0, -9.81)))
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> stone = mechanism.body("stone", mass=1, velocity=(0, speed))
    >>> mechanism.output("height", stone.position[1], units="m")
    >>> study = Study("fall", mechanism, np.linspace(0, 1, 3), [MonteCarlo(samples=50, seed=1)])
    >>> sorted(study.run().children)
    ['comparison', 'monte-carlo']
    """

    @checked
    def __init__(
        self,
        name: str,
        mechanism: Mechanism,
        times: ArrayLike | None = None,
        propagators: Sequence[Propagator] = (),
        rtol: float = 1e-6,
        integrator: str = "auto",
        start: str = "drawn",
        report_times: Sequence[float] = (),
        convergence: Mapping[str, Any] | None = None,
        max_step: float | None = None,
        breaks: Sequence[float] = (),
    ) -> None:
        from uqmbd.mechanism import Mechanism

        self.name = check_name(name, "study")
        place = f"study {name!r}"
        if not isinstance(mechanism, Mechanism):
            raise StudyError(f"{place}: the mechanism is {mechanism!r}; expected a uqmbd.Mechanism.")
        self.mechanism = mechanism
        self.times = check_timeless(mechanism, place) if times is None else check_times(times, place)
        self.rtol = check_rtol(rtol, place)
        self.integrator = check_integrator(integrator, place)
        self.start = check_start(start, place)
        self.max_step = check_max_step(max_step, place)
        self.breaks = check_breaks(breaks, place)
        self.report_times = check_report_times(report_times, self.times, place)
        self.propagators = check_propagators(propagators, place)
        self.convergence = check_convergence_of(self, convergence)

    @typechecked
    def problem(
        self,
        propagator: Propagator,
        executor: Executor | None = None,
        progress: Progress | bool | None = None,
        folder: Path | None = None,
    ) -> Problem:
        """Make the problem for a propagator.

        Parameters
        ----------
        propagator : Propagator
            Propagator that solves the problem.
        executor : concurrent.futures.Executor, optional
            Executor that computes the realisations. Default: the calling process.
        progress : Progress or bool, optional
            Receiver of progress, as for `run`.
        folder : pathlib.Path, optional
            Folder that stores finished chunks. Default: none.

        Returns
        -------
        Problem
            Problem of the outputs over time, or of the scalar outputs if there are no outputs over time.

        Warns
        -----
        uqmbd.StudyWarning, uqmbd.RedundantConstraintWarning
            If the mechanism has redundant equations or a probable mistake. Each warning is issued only once, in a run
            or by this method.

        Examples
        --------
        >>> import chaospy, numpy as np, uqmbd
        >>> from uqmbd_collocation import Collocation
        >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
        >>> stone = mechanism.body("stone", mass=1, velocity=speed)
        >>> mechanism.output("height", stone.position[0], units="m")
        >>> study = uqmbd.Study("throw", mechanism, [0, 1, 2], [Collocation(order=1)])
        >>> problem = study.problem(study.propagators[0])
        >>> problem.realise(np.array([[3.0]])).response.round(4).tolist()  # 3 t
        [[[0.0, 3.0, 6.0]]]
        """
        from uqmbd.propagation.execution import Checkpoint
        from uqmbd.propagation.problem import Problem
        from uqmbd.propagation.runner import Runner

        warn_once(self.mechanism, self.model, stacklevel=2)
        return Problem(
            study=self.name,
            mechanism=self.mechanism.name,
            label=propagator.node_name,
            method_label=propagator.node_name,
            inputs=self.mechanism.inputs,
            times=self.times,
            rtol=self.rtol,
            integrator=self.integrator,
            model=self.model,
            watched=self._watched(propagator),
            existence=self.mechanism.remembered("existence", lambda: existence_of(self.mechanism)),
            runner=Runner(
                executor, choose_receiver(progress), Checkpoint(folder, propagator.node_name) if folder else None
            ),
        )

    @checked
    def propagate(
        self, propagator: Propagator, workers: int | Executor = 1, progress: Progress | bool | None = None
    ) -> xr.DataTree:
        """Run one propagator, which need not be one of the study.

        Parameters
        ----------
        propagator : Propagator
            Propagator to run.
        workers : int or concurrent.futures.Executor
            Number of workers, or an executor, as for `run`.
        progress : Progress or bool, optional
            Receiver of progress, as for `run`.

        Returns
        -------
        xarray.DataTree
            Results of this propagator, in the form of its node in the results of `run`.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd_collocation import Collocation
        >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
        >>> stone = mechanism.body("stone", mass=1, velocity=speed)
        >>> mechanism.output("height", stone.position[0], units="m")
        >>> study = uqmbd.Study("throw", mechanism, [0, 1, 2], [Collocation(order=1)])
        >>> node = study.propagate(Collocation(order=2))
        >>> node["statistics"]["std"].values.round(6).tolist()  # 0.2 t
        [[0.0, 0.2, 0.4]]
        """
        check_propagators([propagator], f"study {self.name!r}")
        warned_elsewhere(self.mechanism, float(self.times[0]))
        with pool(workers) as executor:
            found = run_method(propagator, self.problem(propagator, executor, progress))
        warned_findings(self.with_propagators((propagator,)), stacklevel=3)
        return found

    @checked
    def run(
        self,
        workers: int | Executor = 1,
        *,
        only: Sequence[str] | None = None,
        progress: Progress | bool | None = None,
        folder: Path | None = None,
        resume: bool = False,
        finished: Callable[[xr.DataTree], object] | None = None,
        budget: int | str | None = None,
        accuracy: float | str | None = None,
        planned: Callable[[str], object] | None = None,
    ) -> xr.DataTree:
        """Run all propagators; if one cannot compute the study, or fails, the others still run.

        The run checks all propagators for obstacles (`Propagator.obstacle`) before it computes the first realisation.

        Parameters
        ----------
        workers : int or concurrent.futures.Executor
            Number of workers, or an executor that computes the realisations. Workers are threads if the integrator
            releases the interpreter lock, otherwise processes. The results do not depend on the number of workers.
        only : sequence of str, optional
            Labels of the propagators to run. Default: all.
        progress : Progress or bool, optional
            Receiver of progress. True: lines on standard error, or bars in a notebook. False: no progress. Default:
            bars in notebooks only.
        folder : Path, optional
            Folder that stores finished chunks: in ``unfinished`` during the run, then in ``unsaved`` until
            `uqmbd.results.save` has stored the results in the folder. Only one run at a time can use the folder.
        resume : bool
            Whether to continue with chunks in `folder` from a run that was interrupted or not saved. Chunks of another
            study or of other options are not used; a `uqmbd.StudyWarning` reports such chunks.
        finished : callable, optional
            Function that receives the results; the run calls it before it computes curves of error against cost. The
            results then contain all methods and their comparison. `uqmbd run` stores the results by this function.
        budget : int or str, optional
            Number of realisations, or computing time, such as ``"30s"``, ``"10min"`` or ``"2h"``, that the methods
            share.
        accuracy : float or str, optional
            Required accuracy, as `uqmbd.results.stated_accuracy` defines it: 0.01 or ``"1%"``. Each method increases
            its number of samples or its order, within the budget, until its stated errors meet the accuracy.
        planned : callable, optional
            Function that receives sentences about the chosen sizes. Without this function, a `uqmbd.StudyWarning`
            reports an accuracy that was not reached.

        Returns
        -------
        xarray.DataTree
            One node for each propagator, named by its label, and ``comparison``. If the study has `convergence` and all
            propagators run, there is also a node ``convergence``. Methods that failed have no node. The root attribute
            ``failed`` is a JSON object that maps the labels of failed methods to the reasons.

        Raises
        ------
        uqmbd.UqmbdError
            If the mechanism cannot be used. If no method succeeds, the run raises the exception of the first method.
        uqmbd.StudyError
            If options of a method or of the run cannot be used.

        Warns
        -----
        uqmbd.MethodFailedWarning
            For each method that cannot compute the study or that fails, if another method succeeds.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd_collocation import Collocation
        >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
        >>> stone = mechanism.body("stone", mass=1, velocity=speed)
        >>> mechanism.output("height", stone.position[0], units="m")
        >>> study = uqmbd.Study("throw", mechanism, [0, 1, 2], [Collocation(order=1)])
        >>> result = study.run()
        >>> result["collocation/statistics/mean"].values.round(6).tolist()  # 3 t
        [[0.0, 3.0, 6.0]]
        """
        from uqmbd.propagation.execution import claimed
        from uqmbd.propagation.reduction import store_name
        from uqmbd.results.storage import begin, check_names, computed

        if not self.propagators:
            example = example_of(InputTreatment.SAMPLE)
            raise StudyError(f"study {self.name!r} has no propagators; add them, e.g. propagators=[{example}].")
        if finished is not None and not callable(finished):
            raise StudyError(f"study {self.name!r}: finished is {finished!r:.80}; expected a function of the results.")
        if planned is not None and not callable(planned):
            raise StudyError(f"study {self.name!r}: planned is {planned!r:.80}; expected a function of a text.")
        chosen = self.propagators if only is None else labelled(self.propagators, only, f"study {self.name!r}")
        progress = choose_receiver(progress)
        if folder is not None or resume is not False:
            folder = check_folder(folder, resume, f"study {self.name!r}")
        bounded = budget is not None or accuracy is not None
        terms = BudgetTerms.of(f"study {self.name!r}", budget, accuracy, planned) if bounded else None
        with claimed(folder) if folder else nullcontext(), opened(workers) as executor:
            if folder:
                check_names(folder, [store_name(method.node_name) for method in chosen])
                begin(folder, resume=resume)
            # errors of the mechanism do not belong to a method
            self.model  # noqa: B018 - built once
            found = warned_findings(self.with_propagators(chosen), stacklevel=3)
            outcome = run_methods(self, chosen, executor, progress, folder, terms, resume=resume)
            outcome.report(self.name, stacklevel=3)
            tree = joined(self, outcome, found)
            if finished is not None:
                finished(tree)
            if only is None and self.convergence is not None:
                tree = with_convergence(self, tree, executor, progress, folder, left_out=terms.bounds if terms else "")
            if folder:
                computed(folder, tree.attrs)
        return tree

    @checked
    def converge(
        self,
        propagators: Propagator | type[Propagator] | Sequence[Propagator | type[Propagator]],
        *,
        reference: xr.DataTree | xr.Dataset | Propagator | None = None,
        workers: int | Executor = 1,
        progress: Progress | bool | None = None,
        **levels: Any,
    ) -> xr.Dataset:
        """Run methods over lists of orders or sample numbers, and compare errors with costs.

        For example, ``study.converge(Collocation, order=[1, 2, 3, 4])``.

        Parameters
        ----------
        propagators : Propagator, class of one, or sequence of these
            Methods to compare. Each method varies its first option that is in `levels`. If a class is given, its other
            options have their default values.
        reference : xarray.DataTree, xarray.Dataset or Propagator, optional
            Reference of the errors: a node of results, a method to run, or a dataset of exact values, with `mean` and
            `std` ``(output, time)``. Default: the result with the smallest stated error.
        workers : int or concurrent.futures.Executor
            Number of workers, or an executor, as for `run`.
        progress : Progress or bool, optional
            Receiver of progress, as for `run`.
        **levels : sequence, or mapping of str to sequence
            Values of an option, such as ``order=[1, 2, 3]`` or ``samples=[100, 400, 1600]``, for all methods with this
            option. A mapping from labels to values sets the values of each method separately.

        Returns
        -------
        xarray.Dataset
            Errors and costs over ``method``, ``level`` and ``output``. ``mean_error_l2`` and ``std_error_l2`` are L2
            norms over time of the differences from the reference. The norms are relative to the norm of the mean or
            standard deviation of the reference. ``mean_error_max`` and ``std_error_max`` are the largest differences,
            relative to the largest standard deviation of the reference. ``stated_error``, ``realisations`` and
            ``wall_time`` (s) are given for each result. ``mean_rate`` and ``std_rate`` are fitted orders of
            convergence.

        Raises
        ------
        uqmbd.StudyError
            If there are no levels, if a method has none of the options, or if no level succeeds.

        Examples
        --------
        The standard deviation of ``speed^2 / 2`` requires an order of 2; this result is the reference of the others:

        >>> import chaospy, uqmbd
        >>> from uqmbd_collocation import Collocation
        >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
        >>> stone = mechanism.body("stone", mass=1, velocity=speed)
        >>> mechanism.output("height", speed**2 / 2, units="m^2/s^2")
        >>> study = uqmbd.Study("throw", mechanism, [0, 1, 2], [Collocation(order=1)])
        >>> found = study.converge(Collocation, order=[1, 2, 3])
        >>> found["std_error_l2"].sel(output="height").values.round(4).tolist()[0][:2]
        [0.0011, nan]
        """
        from uqmbd.propagation.convergence import converge

        return converge(self, propagators, reference=reference, workers=workers, progress=progress, **levels)
