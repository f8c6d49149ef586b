"""Studies: one mechanism, some times, and the methods that are to be laid side by side.

Length: it is one class, whose public methods have examples.
"""

from __future__ import annotations

import copy
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from uqmbd.arguments import typechecked
from uqmbd.display import html_of
from uqmbd.errors import StudyError
from uqmbd.names import check_name, checked
from uqmbd.progress import Progress, choose_receiver
from uqmbd.propagation.budget import BudgetTerms
from uqmbd.propagation.convergence import check_convergence_of, with_convergence
from uqmbd.propagation.execution import opened, pool
from uqmbd.propagation.inputs import existence_of
from uqmbd.propagation.methods import Propagator, check_propagators, labelled, run_method
from uqmbd.propagation.observed_model import (
    build_observed_model,
    refuse_jumps,
    warn_once,
    warned_elsewhere,
)
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
from uqmbd.propagation.studies.checks import ranges, warned_findings
from uqmbd.propagation.studies.outcome import joined, run_methods

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.dynamics import Model
    from uqmbd.mechanism import Mechanism
    from uqmbd.propagation.problem import Problem

__all__ = ["Study"]


class Study:
    """A mechanism, output times, and propagators.

    Parameters
    ----------
    name : str
        What appears in data and reports.
    mechanism : Mechanism
        With at least one output.
    times : array_like, shape (T,), optional
        Output times, s, strictly increasing; the first is the start.  May be left out where all outputs are without a
        time and nothing moves for them, as frequencies; it is then 0 s alone.
    propagators : sequence of Propagator
        Methods, each with a label of its own.
    rtol : float
        Relative tolerance of the integration; 1e-6 if not given.
    integrator : str
        ``auto``: explicit and fast, and implicit by IDA for realisations that are stiff and for large mechanisms;
        ``ida``: IDA for all; ``dop853``: explicit for all; or one that a plugin registers.
    start : {"drawn", "equilibrium"}
        ``drawn``: as assembled from the drawn pose.  ``equilibrium``: every realisation in its own static equilibrium,
        found from there, at rest; velocities that the mechanism states are held there, and drivers that move at the
        start move what they drive.  A realisation without equilibrium has failed.
    report_times : sequence of float
        Times, s, at which the report shows distributions; by default it chooses some.
    convergence : mapping, optional
        Arguments of :meth:`converge`, which a run then computes after the methods, for the report's curves of error
        against cost: ``{"propagators": [Collocation, MonteCarlo(seed=1)], "order": [1, 2, 3], "samples": [50, 200],
        "reference": "monte-carlo"}``. The reference may be the label of a propagator of the study.
    max_step : float, optional
        Longest step of the integration, s; by default its error alone decides.  For what acts for a moment and depends
        on the state as well as on time, as a wave that runs along a mechanism: functions of time alone are looked at
        beforehand.  What lasts longer than the 8000th part of the times (and than a quarter of the time between two
        outputs) is found; what is shorter, if it is not small beside what the same function adds to it.
    breaks : sequence of float
        Times at which the integration starts anew, s, besides those of `uqmbd.step` and of the conditions of a
        `sympy.Piecewise` that are linear in time.

    Raises
    ------
    uqmbd.StudyError
        If something cannot be used; the message says what was expected.

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
        if not isinstance(mechanism, Mechanism):
            raise StudyError(f"study {name!r}: the mechanism is {mechanism!r}; expected a uqmbd.Mechanism.")
        self.mechanism = mechanism
        self.times = (
            check_timeless(mechanism, f"study {name!r}") if times is None else check_times(times, f"study {name!r}")
        )
        self.rtol = check_rtol(rtol, f"study {name!r}")
        self.integrator = check_integrator(integrator, f"study {name!r}")
        self.start = check_start(start, f"study {name!r}")
        self.max_step = check_max_step(max_step, f"study {name!r}")
        self.breaks = check_breaks(breaks, f"study {name!r}")
        self.report_times = check_report_times(report_times, self.times, f"study {name!r}")
        self.propagators = check_propagators(propagators, f"study {self.name!r}")
        self._compiled: tuple[tuple[int, ...], Model] | None = None
        self.convergence: Mapping[str, Any] | None = None
        if convergence is not None:
            self.convergence = check_convergence_of(self, convergence)

    def with_propagators(self, propagators: Iterable[Propagator]) -> Study:
        """Make a copy with other propagators.

        Parameters
        ----------
        propagators : sequence of Propagator
            Instead of those it has.

        Returns
        -------
        Study
            With the same mechanism.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> from uqmbd_collocation import Collocation
        >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
        >>> stone = mechanism.body("stone", mass=1, velocity=speed)
        >>> mechanism.output("height", stone.position[0], units="m")
        >>> study = uqmbd.Study("throw", mechanism, [0, 1, 2], [Collocation(order=1)])
        >>> [p.order for p in study.with_propagators([Collocation(order=2)]).propagators], study.propagators[0].order
        ([2], 1)
        """
        other = copy.copy(self)
        other.propagators = check_propagators(propagators, f"study {self.name!r}")
        return other

    def with_times(self, times: ArrayLike) -> Study:
        """Make a copy with other output times (T,), s, strictly increasing, the first of which is the start.

        Parameters
        ----------
        times : array_like, shape (T,)
            s.

        Returns
        -------
        Study
            With the same mechanism and methods.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> from uqmbd_collocation import Collocation
        >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
        >>> stone = mechanism.body("stone", mass=1, velocity=speed)
        >>> mechanism.output("height", stone.position[0], units="m")
        >>> study = uqmbd.Study("throw", mechanism, [0, 1, 2], [Collocation(order=1)])
        >>> study.with_times([0, 0.5]).times.tolist(), study.times.tolist()
        ([0.0, 0.5], [0.0, 1.0, 2.0])
        """
        other = copy.copy(self)
        other.times = check_times(times, f"study {self.name!r}")
        other.report_times = ()
        other._compiled = None
        return other

    @property
    def model(self) -> Model:
        """The compiled model (made when first needed), which the integrator of the study can integrate."""
        revision = self.mechanism.revision()
        if self._compiled is None or self._compiled[0] != revision:
            self._compiled = revision, self._made()
        return self._compiled[1]

    def _observed(self, mechanism: Mechanism) -> Model:
        return build_observed_model(mechanism, float(self.times[0]), self.start, self.max_step, self.breaks)

    def _made(self) -> Model:
        from uqmbd.dynamics import Ensemble, require_for

        if len(self.times) == 1:
            # outputs may have been added since
            check_timeless(self.mechanism, f"study {self.name!r}")
        model = self._observed(self.mechanism)
        require_for(model, self.integrator, f"study {self.name!r}")
        means = Ensemble(replace(model, start_at="drawn"), self.mechanism.inputs.means[None, :])
        refuse_jumps(means, self.times, self.rtol, f"study {self.name!r}, at the means of its inputs")
        return model

    @typechecked
    def problem(
        self,
        propagator: Propagator,
        executor: Executor | None = None,
        progress: Progress | bool | None = None,
        folder: Path | None = None,
    ) -> Problem:
        """Make the problem that a propagator is given.

        Parameters
        ----------
        propagator : Propagator
            At work.
        executor : concurrent.futures.Executor, optional
            Who computes; None: this process.
        progress : Progress or bool, optional
            As of `run`.
        folder : pathlib.Path, optional
            Where finished chunks are kept.

        Returns
        -------
        Problem
            Of the outputs over time, where there are some.

        Warns
        -----
        uqmbd.StudyWarning, uqmbd.RedundantConstraintWarning
            Of what was found in the mechanism, such as redundant equations: once, and not where a run warned of it.

        Examples
        --------
        >>> import chaospy
        >>> import numpy as np
        >>> import uqmbd
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

    def _watched(self, propagator: Propagator) -> Model | None:
        """Return the model that has what a method watches among its outputs, behind those of the mechanism."""
        if not (wanted := propagator.watches(self.mechanism)):
            return None

        def make() -> Model:
            mechanism = copy.copy(self.mechanism)
            for name, expression in wanted.items():
                mechanism.output(name, expression)
            return self._observed(mechanism)

        key = ("watched", float(self.times[0]), self.start, self.max_step, self.breaks, *wanted)
        return self.mechanism.remembered(key, make)

    @checked
    def propagate(
        self, propagator: Propagator, workers: int | Executor = 1, progress: Progress | bool | None = None
    ) -> xr.DataTree:
        """Run one propagator, which need not be among those of the study.

        Parameters
        ----------
        propagator : Propagator
            One of the study, or another.
        workers : int or concurrent.futures.Executor
            As of `run`.
        progress : Progress or bool, optional
            As of `run`.

        Returns
        -------
        xarray.DataTree
            The node of this propagator.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
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
        """Run all propagators: one that cannot do the study, or fails, does not keep the others from it.

        All are asked for what is in their way (`Propagator.obstacle`) before the first realisation is computed.

        Parameters
        ----------
        workers : int or concurrent.futures.Executor
            Number of workers, or who does the work: threads where the integrator is `unlocked`, else processes.
            Results do not depend on it.
        only : sequence of str, optional
            Labels of the propagators to run; all by default.
        progress : Progress or bool, optional
            Whom to tell; True: lines on standard error, in a notebook bars; False: nobody; None: notebooks only.
        folder : Path, optional
            Where to keep finished chunks: in ``unfinished`` while it runs, then in ``unsaved`` until
            `uqmbd.results.save` has stored the results in this folder.  One run at a time.
        resume : bool
            Go on with the chunks that a run left in `folder` which was interrupted, or was not saved; those of other
            options, or of another study, are of no use, which a `uqmbd.StudyWarning` says.
        finished : callable, optional
            Given the results of the methods and their comparison before curves of error against cost are computed, as
            `uqmbd run` does to store them.
        budget : int or str, optional
            How much is computed: realisations, or a time, as ``"30s"``, ``"10min"``, ``"2h"``.  The methods share it.
        accuracy : float or str, optional
            Each method takes as many samples, or as high an order, as its stated errors need, within the budget: 0.01
            or ``"1%"`` of what `uqmbd.results.stated_accuracy` says.
        planned : callable, optional
            Is given sentences on chosen sizes; without it an accuracy that is missed is a `uqmbd.StudyWarning`.

        Returns
        -------
        xarray.DataTree
            One node for each propagator, named by its label, and ``comparison``; and ``convergence`` if the study asks
            for it and all propagators are run.  Methods that failed have no node; the root attribute ``failed`` is a
            JSON object from their labels to the reasons.

        Raises
        ------
        uqmbd.UqmbdError
            If the mechanism cannot be used, or no method succeeded: then that of the first one, or whatever it raised.
        uqmbd.StudyError
            If options of a method or of the run cannot be used.

        Warns
        -----
        uqmbd.MethodFailedWarning
            For each method that cannot do the study, or failed, while another succeeded.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
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
            raise StudyError(
                f"study {self.name!r} has no propagators; give it some, "
                "as in propagators=[MonteCarlo(samples=500, seed=1)]."
            )
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
            # errors of the mechanism concern no method
            self.model  # noqa: B018 - built once
            found = warned_findings(self.with_propagators(chosen), stacklevel=3)
            outcome = run_methods(self, chosen, executor, progress, folder, terms, resume=resume)
            outcome.report(self.name, stacklevel=2)
            tree = joined(self, outcome, found)
            if finished is not None:
                finished(tree)
            if only is None and self.convergence is not None:
                tree = with_convergence(self, tree, executor, progress, folder, left_out=terms.bounds if terms else "")
            if folder:
                computed(folder, tree.attrs)
        return tree

    def predict_warnings(self, propagators: Sequence[Propagator] | None = None) -> tuple[str, ...]:
        """Predict which numbers leave their range, or change their sign, in some realisations.

        Parameters
        ----------
        propagators : sequence of Propagator, optional
            Methods that are to be run; those of the study by default.  A number is reported if at least 0.05
            realisations outside of its range are expected of the method with the most realisations.

        Returns
        -------
        tuple of str
            Sentences, without the full stop at their end.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> from uqmbd_montecarlo import MonteCarlo
        >>> mass = uqmbd.RandomVariable("mass", chaospy.Normal(0.2, 0.1), units="kg")
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
        >>> stone = mechanism.body("stone", mass=mass)
        >>> mechanism.output("height", stone.position[0], units="m")
        >>> study = uqmbd.Study("throw", mechanism, [0, 1, 2], [MonteCarlo(samples=100, seed=1)])
        >>> study.predict_warnings()[0][:79]
        "the mass of body 'stone' is outside of its range (0 or more) in 2.3 % of the re"
        """
        other = self if propagators is None else self.with_propagators(propagators)
        return tuple(finding.text for finding in ranges(other))

    def foretold(self, propagators: Sequence[Propagator] | None = None) -> tuple[str, ...]:
        """Return `predict_warnings()`; the old name is removed in version 0.2.

        Parameters
        ----------
        propagators : sequence of Propagator, optional
            Methods that are to be run.

        Returns
        -------
        tuple of str
            Sentences.

        Warns
        -----
        DeprecationWarning
            Always.

        Examples
        --------
        >>> import uqmbd
        >>> from uqmbd_montecarlo import MonteCarlo
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
        >>> mechanism.output("height", mechanism.body("stone", mass=1).position[0], units="m")
        >>> with warnings.catch_warnings(action="ignore"):
        ...     uqmbd.Study("throw", mechanism, [0, 1], [MonteCarlo(samples=10, seed=1)]).foretold()
        ()
        """
        text = "Study.foretold is Study.predict_warnings now; the old name is removed in version 0.2."
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return self.predict_warnings(propagators)

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

        As ``study.converge(Collocation, order=[1, 2, 3, 4])``: a dataset of both, by method, level and output.

        Parameters
        ----------
        propagators : Propagator, class of one, or sequence of these
            Each takes the first of `levels` that is an option of it; a class its default options otherwise.
        reference : xarray.DataTree, xarray.Dataset or Propagator, optional
            A node; a method that is run; or a dataset of what is known, as in closed form: `mean` and `std`
            ``(output, time)``.  Default: of the results the one that states the least error itself.
        workers : int or concurrent.futures.Executor
            As of `run`.
        progress : Progress or bool, optional
            As of `run`.
        **levels : sequence, or mapping of str to sequence
            Values of an option, as ``order=[1, 2, 3]`` or ``samples=[100, 400, 1600]``: for all methods that have it,
            or for those of some labels.

        Returns
        -------
        xarray.Dataset
            By ``method``, ``level`` and ``output``: ``mean_error_l2`` and ``std_error_l2``, norms over time of the
            differences to the reference over that of its mean, or standard deviation; ``mean_error_max`` and
            ``std_error_max``; ``stated_error``; ``realisations``; ``wall_time``, s; fitted orders ``mean_rate`` and
            ``std_rate``.

        Raises
        ------
        uqmbd.StudyError
            If there are no levels, a method has none of the options, or no level of any method succeeded.

        Examples
        --------
        The standard deviation of ``speed^2 / 2`` needs an order of 2, which is the reference of the others:

        >>> import chaospy
        >>> import uqmbd
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

    def _repr_html_(self) -> str | None:
        """Tables and a picture, for notebooks."""
        return html_of(self)

    def __repr__(self) -> str:
        names = ", ".join(p.node_name for p in self.propagators) or "no propagators"
        times = f"{len(self.times)} times to {self.times[-1]:g} s" if len(self.times) > 1 else "no times"
        return f"<study {self.name!r} of mechanism {self.mechanism.name!r}: {times}; {names}>"
