"""Data of a study: mechanism, output times, methods, options and model; copies with other data."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Self

from numpy.typing import ArrayLike

from uqmbd.display import html_of
from uqmbd.propagation.methods import (
    Propagator,
    Studied,
    check_propagators,
    require_keys_accepted,
    require_smooth_outputs,
)
from uqmbd.propagation.observed_model import build_observed_model, refuse_jumps
from uqmbd.propagation.options import check_timeless, check_times
from uqmbd.propagation.studies.checks import Ranges

if TYPE_CHECKING:
    from uqmbd.dynamics import Model

__all__ = ["StudyData"]


class StudyData(Studied):
    """Mechanism, output times, methods and options of a study; `uqmbd.Study` documents them."""

    _compiled: tuple[tuple[int, ...], Model] | None = None

    def with_propagators(self, propagators: Iterable[Propagator]) -> Self:
        """Make a copy with other propagators.

        Parameters
        ----------
        propagators : sequence of Propagator
            Propagators of the copy.

        Returns
        -------
        Study
            Copy of the study with these propagators and the same mechanism.

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

    def with_times(self, times: ArrayLike) -> Self:
        """Make a copy with other output times.

        Parameters
        ----------
        times : array_like, shape (T,)
            Output times, s, strictly increasing; the first is the initial time.

        Returns
        -------
        Study
            Copy of the study with these times and the same mechanism and methods.

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
        """Return the compiled model for the integrator of the study; compile it at the first use."""
        from uqmbd.dynamics import Ensemble, require_for

        revision, place = self.mechanism.revision(), f"study {self.name!r}"
        if self._compiled is not None and self._compiled[0] == revision:
            return self._compiled[1]
        if len(self.times) == 1:
            # outputs may have been added since the study was made
            check_timeless(self.mechanism, place)
        model = build_observed_model(self.mechanism, float(self.times[0]), self.start, self.max_step, self.breaks)
        require_for(model, self.integrator, place)
        means = Ensemble(replace(model, start_at="drawn"), self.mechanism.inputs.means[None, :])
        refuse_jumps(means, self.times, self.rtol, f"{place}, at the means of its inputs")
        self._compiled = revision, model
        return model

    def _watched(self, propagator: Propagator) -> Model | None:
        """Return the model with the expressions that a method observes, after the outputs of the mechanism."""
        require_keys_accepted(propagator, self.mechanism.inputs)
        require_smooth_outputs(propagator, self.mechanism)
        if not (watched_expressions := propagator.watches(self.mechanism)):
            return None

        def make() -> Model:
            mechanism = copy.copy(self.mechanism)
            for name, expression in watched_expressions.items():
                mechanism.output(name, expression)
            return build_observed_model(mechanism, float(self.times[0]), self.start, self.max_step, self.breaks)

        key = ("watched", float(self.times[0]), self.start, self.max_step, self.breaks, *watched_expressions)
        return self.mechanism.remembered(key, make)

    def predict_warnings(self, propagators: Sequence[Propagator] | None = None) -> tuple[str, ...]:
        """Predict which numbers of the mechanism leave their range, or change sign, in some realisations.

        Parameters
        ----------
        propagators : sequence of Propagator, optional
            Methods to be run. Default: the methods of the study. A number is reported if the method with the most
            realisations is expected to have at least 0.05 realisations outside its range.

        Returns
        -------
        tuple of str
            Predicted warnings: sentences without the final full stop.

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
        return tuple(finding.text for finding in Ranges().find(other))

    def foretold(self, propagators: Sequence[Propagator] | None = None) -> tuple[str, ...]:
        """Return `predict_warnings()`; the old name is removed in version 0.2.

        Parameters
        ----------
        propagators : sequence of Propagator, optional
            Methods to be run. Default: the methods of the study.

        Returns
        -------
        tuple of str
            Predicted warnings.

        Warns
        -----
        DeprecationWarning
            At every call.

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
        text = "Study.foretold was renamed to Study.predict_warnings; version 0.2 removes the old name."
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return self.predict_warnings(propagators)

    def _repr_html_(self) -> str | None:
        """Return tables and a picture for notebooks."""
        return html_of(self)

    def __repr__(self) -> str:
        names = ", ".join(p.node_name for p in self.propagators) or "no propagators"
        times = f"{len(self.times)} times to {self.times[-1]:g} s" if len(self.times) > 1 else "no times"
        return f"<study {self.name!r} of mechanism {self.mechanism.name!r}: {times}; {names}>"
