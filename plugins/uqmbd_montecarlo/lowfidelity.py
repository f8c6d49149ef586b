"""Low-cost model as control variate: another study, computed at the samples and at further points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from numbers import Integral, Real
from typing import Any

import numpy as np

import uqmbd
from uqmbd.extend import typechecked
from uqmbd.typing import Array, Mask
from uqmbd_montecarlo.allocation import optimum
from uqmbd_montecarlo.control import controls
from uqmbd_montecarlo.controlledsums import ROUNDING
from uqmbd_montecarlo.jointmoments import JointMoments

__all__ = ["LowFidelity", "PairedControl", "mismatch"]


BLOCK = 2**18
"""Largest number of further realisations with inputs in memory at once."""

MOST = 10**9
"""Upper limit of `cost`, and of the number of realisations."""

LEAST_FURTHER = 2
"""Smallest number of further realisations from which their scatter can be estimated."""


@typechecked(values=False)
@dataclass(frozen=True)
class LowFidelity:
    """Low-cost study of the same outputs, for ``MonteCarlo(control=...)``.

    The mechanism of this study omits costly details with a small effect: for example, a rigid rod replaces an elastic
    one, or a continuous law replaces a sampled controller. The mechanism can also be the same, with a looser `rtol` or
    another integrator. Each input gets the value of the input with the same name in the controlled study. The
    distributions of the low-cost study have no effect. The low-cost study may lack some inputs.

    Parameters
    ----------
    study : uqmbd.Study
        Study with the same times, and with all outputs of the controlled study, by name. Other outputs are ignored.
    cost : float
        Cost of a realisation of this study, divided by the cost of a realisation of the controlled study. The ratio and
        the correlation at the samples determine the number of further realisations. The results state the ratio of the
        measured times.
    samples : int, optional
        Number of realisations of this study, including the realisations at the samples. Default: the optimum.

    Raises
    ------
    uqmbd.StudyError
        If `study` is not a study, or a number cannot be used.

    Examples
    --------
    >>> import warnings
    >>> import chaospy, numpy as np, uqmbd
    >>> from uqmbd_montecarlo import LowFidelity, MonteCarlo
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> def fall(drag):
    ...     mechanism = uqmbd.Mechanism("fall", uqmbd.Translational(gravity=(0, -9.81)))
    ...     stone = mechanism.body("stone", mass=1, velocity=(speed, 0))
    ...     mechanism.output("drop", stone.position[1] - drag * stone.position[0] ** 2, units="m")
    ...     return uqmbd.Study("fall", mechanism, np.linspace(0, 1, 3))
    >>> method = MonteCarlo(samples=50, seed=1, control=LowFidelity(fall(0.1), cost=0.01))
    >>> with warnings.catch_warnings():  # such short computing times are unreliable
    ...     warnings.filterwarnings("ignore", ".*Monte Carlo without control is more efficient")
    ...     node = fall(0.11).propagate(method)
    >>> bool((node["statistics/variance_reduction"].isel(time=-1) > 10).all())
    True
    """

    study: uqmbd.Study
    cost: float = 0.1
    samples: int | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.study, uqmbd.Study):
            raise uqmbd.StudyError(f"LowFidelity: study is {self.study!r}; expected a uqmbd.Study.")
        cost: Any = self.cost
        samples: Any = self.samples
        if isinstance(cost, bool) or not isinstance(cost, Real) or not 0 < self.cost <= MOST:
            raise uqmbd.StudyError(
                f"LowFidelity: cost is {cost!r}; expected a number above 0 and at most 1e9, e.g. 0.1."
            )
        object.__setattr__(self, "cost", float(cost))
        if samples is None:
            return
        if isinstance(samples, bool) or not isinstance(samples, Integral) or samples < 1:
            raise uqmbd.StudyError(f"LowFidelity: samples is {samples!r}; expected a whole number, 1 or more, or None.")
        if int(samples) > MOST:
            raise uqmbd.StudyError("LowFidelity: samples is more than 1e9; expected a whole number up to 1e9.")
        object.__setattr__(self, "samples", int(samples))

    def __repr__(self) -> str:
        more = "" if self.samples is None else f", samples={self.samples}"
        return f"LowFidelity({self.study.name!r}, cost={self.cost:g}{more})"


def check_samples(control: LowFidelity, samples: int) -> None:
    """Raise `uqmbd.StudyError` unless the control has more realisations than the controlled samples."""
    if control.samples is not None and control.samples < samples + LEAST_FURTHER:
        raise uqmbd.StudyError(
            f"MonteCarlo: samples is {samples}, but the control has samples={control.samples}. Expected "
            f"{samples + LEAST_FURTHER} or more for the control, which also needs realisations at additional samples."
        )


def further_realisations(control: LowFidelity, samples: int, left: float) -> int:
    """Return the number of further control realisations; `left`: share of the variance left by the control."""
    if control.samples is not None:
        return control.samples - samples
    count = round((optimum(left, control.cost) - 1.0) * samples)
    return count if count >= LEAST_FURTHER else 0


def mismatch(control: uqmbd.Study, inputs: dict[str, str], outputs: tuple[str, ...], times: Array) -> str | None:
    """Return why this study cannot be the control of a study with these inputs, outputs and times; None if it can.

    `inputs` maps names to units.
    """
    about = f"the control study {control.name!r}"
    if not np.array_equal(control.times, times):
        return f"{about} has different output times; expected the output times of the controlled study"
    own = control.mechanism.inputs.variables
    if strange := [v.name for v in own if v.name not in inputs]:
        return (
            f"{about} has the input {strange[0]!r}; expected only inputs of the controlled study, {', '.join(inputs)}"
        )
    if other := [v for v in own if v.units != inputs[v.name]]:
        return (
            f"{about} has the input {other[0].name!r} in {other[0].units!r}; expected the units "
            f"{inputs[other[0].name]!r}"
        )
    there = {*control.mechanism.outputs, *control.mechanism.scalars}
    if missing := [name for name in outputs if name not in there]:
        return (
            f"{about} has no output {missing[0]!r}; expected all outputs of the controlled study, {', '.join(outputs)}"
        )
    return None


class PairedControl:
    """Low-cost study at the inputs `values` (S, input) of samples and at further inputs, as a control variate.

    The mean of the control replaces the values of failed control realisations. This replacement reduces the
    correlation, but causes no bias. Raise StudyError if the study does not fit the problem.
    """

    def __init__(
        self, control: LowFidelity, method: uqmbd.extend.Propagator, problem: uqmbd.extend.Problem, values: Array
    ) -> None:
        self.control, self._problem = control, problem
        self.words = f"the study {control.study.name!r}"
        names = tuple(output.name for output in problem.labels.outputs)
        units = {variable.name: variable.units for variable in problem.inputs.variables}
        times = problem.times if problem.over is None else problem.over
        if reason := mismatch(control.study, units, names, times):
            raise uqmbd.StudyError(f"{problem.label}: {reason}.")
        made = control.study.problem(method, problem.runner.executor, problem.progress)
        self._cheap = _of_kind(made.using(clock=problem.runner.clock, spending=problem.runner.spending), problem, names)
        own = [output.name for output in self._cheap.labels.outputs]
        if missing := [name for name in names if name not in own]:
            raise uqmbd.StudyError(
                f"{problem.label}: the output {missing[0]!r} of the control study {control.study.name!r} has the "
                f"wrong kind; expected an output {'without a time' if problem.timeless else 'over time'}."
            )
        self._outputs = [own.index(name) for name in names]
        self._columns = [problem.inputs.names.index(name) for name in self._cheap.inputs.names]
        self._parts = self._stream(values, "control")
        self._ahead: list[tuple[Array, Mask]] = []
        self._spread: JointMoments | None = None
        self.centre = self.unit = np.zeros(0)
        self.realisations = self.failures = 0
        self.counters: dict[str, float] = {}
        self.alone = 0.0
        """Computing time of further realisations, s."""

    def _stream(self, values: Array, label: str) -> Iterator[tuple[Array, Mask]]:
        """Yield responses (K, C) at inputs of the controlled study, and the mask (K,) of successful realisations."""
        label = f"{self._problem.label}: {label}"
        own = self._problem.runner.of(label)
        problem = replace(self._cheap, label=label).using(checkpoint=own.checkpoint)
        for part in problem.stream(values[:, self._columns]):
            good = part.good
            self.realisations += len(good)
            self.failures += int(np.count_nonzero(~good)) - part.censored
            for name, number in part.counters.items():
                self.counters[name] = self.counters.get(name, 0) + number
            yield part.response[:, self._outputs].reshape(len(good), -1), good
            if self._problem.runner.ledger is not None:
                # a time budget includes the control; a budget of realisations applies only to the controlled study
                self._problem.runner.ledger.begin()

    def standardised(self, first: int, count: int) -> Array:
        """Return (control - centre) / unit, shape (count, C), at the next samples."""
        while sum(len(good) for _, good in self._ahead) < count:
            self._ahead.append(next(self._parts))
        response, good = (np.concatenate(parts) for parts in zip(*self._ahead, strict=True))
        self._ahead = [(response[count:], good[count:])]
        response, good = response[:count], good[:count]
        if not len(self.unit):
            # centre and unit only need to be near mean and deviation, because the estimates do not depend on them
            some = response[good] if good.any() else np.zeros((1, response.shape[1]))
            self.centre, deviation = some.mean(axis=0), some.std(axis=0)
            self.unit = np.where(deviation > ROUNDING * np.abs(self.centre), deviation, 1.0)
        return self._measured(response, good)

    def _measured(self, response: Array, good: Mask) -> Array:
        off = np.where(good[:, None], response - self.centre, 0.0)
        # differences at the level of rounding count as zero
        return np.asarray(np.where(np.abs(off) > ROUNDING * np.abs(self.centre), off / self.unit, 0.0))

    def further(self, count: int, seed: np.random.SeedSequence) -> JointMoments:
        """Compute the control at `count` further random inputs, and return the moments of `controls`.

        The seed must differ from the seed of the samples.
        """
        begin, inputs = self._problem.clock(), self._problem.inputs
        sizes = [min(BLOCK, count - done) for done in range(0, count, BLOCK)]
        found = JointMoments.of(np.zeros((0, 2, len(self.unit))))
        for k, (size, one) in enumerate(zip(sizes, seed.spawn(len(sizes)), strict=True)):
            uniform = uqmbd.extend.sampling_design("random").points(len(inputs), size, one)
            label = f"control alone {k + 1}" if len(sizes) > 1 else "control alone"
            for response, good in self._stream(inputs.from_uniform(uniform), label):
                found = found.merge(JointMoments.of(controls(self._measured(response, good))))
        self.alone = self._problem.clock() - begin
        self._spread = found
        return found

    @property
    def useful(self) -> Mask:
        """Mask (C,) of the outputs and times at which the control varies."""
        if self._spread is None:
            return np.zeros(len(self.unit), dtype=bool)
        return np.asarray(self._spread.products[0, 0] > 0)

    def close(self) -> None:
        """Cancel the running computations at samples."""
        self._parts.close()  # type: ignore[attr-defined]


def _of_kind(made: uqmbd.extend.Problem, problem: uqmbd.extend.Problem, names: tuple[str, ...]) -> uqmbd.extend.Problem:
    """Return the control problem `made` with only the named outputs, over time or scalar as in `problem`."""
    made = replace(made, model=replace(made.model, margins=None)).using(progress=problem.progress)
    if problem.kind == "outputs":
        return replace(made, model=replace(made.model, scalars=None))
    if problem.kind == "requirements":
        raise uqmbd.StudyError(
            f"{problem.label}: a control study requires outputs, but this study has only requirements; omit control."
        )
    if made.model.scalars is None:
        raise uqmbd.StudyError(
            f"{problem.label}: the control study has no scalar outputs; expected {', '.join(names)}."
        )
    made = made.without_time()
    return made if problem.chosen is None else made.choosing(names)
