"""Inputs, outputs and times of a study as data: what a runner computes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from uqmbd.arguments import Size, typechecked
from uqmbd.dynamics import Capability, Ensemble, Model, built_in_names, capabilities_of, integrator_class, require
from uqmbd.errors import StudyError
from uqmbd.mechanism import Requirement
from uqmbd.propagation.execution import Kind, Packed, chunk_size, fingerprint, needs_motion
from uqmbd.propagation.inputs import Existence, nothing_random
from uqmbd.randomness import JointInput, RandomVariable
from uqmbd.results.schema import InputInfo, Labels, OutputInfo, labels
from uqmbd.typing import Array

__all__ = ["ProblemData"]


@dataclass(frozen=True)
class ProblemData:
    """Inputs, outputs and times of a study; the fields are explained at `uqmbd.extend.Problem`."""

    study: str
    mechanism: str
    label: str
    inputs: JointInput
    times: Array
    rtol: float
    integrator: str
    model: Model = field(repr=False)
    kind: Kind = "outputs"
    over: Array | None = field(default=None, repr=False)
    chosen: tuple[str, ...] | None = None
    answers_requirements: bool = False
    method_label: str = field(default="", repr=False)
    """Label of the method; parts of its work may have labels of their own."""
    watched: Model | None = field(default=None, repr=False)
    """The model whose outputs are those of the study, and what the method watches besides (`Propagator.watches`)."""
    existence: Existence = field(default_factory=lambda: Existence({}, {}, {}), repr=False)
    """Which moments of the outputs exist."""

    @property
    def timeless(self) -> bool:
        """Whether the outputs are those without a time, given as if at one time, or margins of requirements.

        A method need not know: its results are given their form afterwards.  One that does not compute realisations (it
        solves for all together) must compute realisations here.
        """
        return self.kind != "outputs"

    @property
    def requirements(self) -> tuple[Requirement, ...]:
        """What the mechanism has to satisfy."""
        return () if self.model.margins is None else tuple(self.model.margins.requirements)

    @property
    def whole_times(self) -> Array:
        """Output times of the study, whatever the kind of outputs, shape (T,), s."""
        return self.times if self.over is None else self.over

    @typechecked
    def with_inputs(self, variables: Iterable[RandomVariable]) -> Self:
        """Return the problem with other distributions of some inputs, as after a calibration.

        Parameters
        ----------
        variables : iterable of RandomVariable
            Of the names and units of the inputs whose place they take, with finite moments; the others stay.

        Raises
        ------
        uqmbd.StudyError
            If one has a name that there is not, other units, or one that depends on others is replaced without them.
        """
        given = tuple(variables)
        try:
            inputs = self.inputs.replaced(given)
        except StudyError as error:
            raise StudyError(f"{self.label}: {error}") from None
        return replace(self, inputs=inputs, existence=self.existence.without({v.name for v in given}))

    @cached_property
    def labels(self) -> Labels:
        """Names and units of outputs, inputs and times, for `uqmbd.results`."""
        if self.kind == "requirements":
            outputs = [OutputInfo(requirement.name) for requirement in self.requirements]
        else:
            seen = self.model.scalars if self.kind == "scalars" else self.model.outputs
            turns = [0.0] * len(seen.names) if self.kind == "scalars" else seen.turns.tolist()
            outputs = [OutputInfo(*about) for about in zip(seen.names, seen.units, turns, strict=True)]
        if self.chosen is not None:
            outputs = [output for output in outputs if output.name in self.chosen]
        return labels(outputs, [InputInfo(v.name, v.units, v.description) for v in self.inputs.variables], self.times)

    @cached_property
    def packed(self) -> Packed:
        """The model, for workers."""
        return Packed.of(self.model)

    @typechecked
    def ensemble(self, values: Array) -> Ensemble:
        """Make the ensemble of some realisations, for methods that solve them together.

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs, in the order of ``inputs.names``.

        Returns
        -------
        Ensemble
            At its start.
        """
        return Ensemble(self.model, self.checked(values))

    @typechecked
    def chunk_of(self, count: Size) -> int:
        """Return how many of so many realisations are computed together, the same for all kinds of outputs."""
        return chunk_size(count, len(self.whole_times) * (len(self.model.outputs.names) + self.model.layout.width))

    @property
    def joins(self) -> bool:
        """Whether a realisation is known not to depend on those beside it: of the integrators of the core."""
        return self.integrator in built_in_names() or capabilities_of(integrator_class(self.integrator)).delegates

    def require_random(self) -> None:
        """Raise a `uqmbd.StudyError` where nothing is random.

        Raises
        ------
        uqmbd.StudyError
            If nothing is random.
        """
        if reason := nothing_random(self.inputs, self.mechanism):
            raise StudyError(f"{self.label}: {reason}.")

    @typechecked
    def require(self, needed: Capability, integrator: str | None = None, remedy: str = "") -> None:
        """Raise where an integrator lacks a capability that a method needs.

        A method that has its equations integrated by other means than `realise` asks for it, in `propagate` and in
        `Propagator.obstacle`.

        Parameters
        ----------
        needed : str
            Name of a field of `uqmbd.extend.Capabilities`: ``projected`` to integrate a
            `uqmbd.extend.ProjectedEnsemble`, ``segments`` for `histories`.
        integrator : str, optional
            Default: that of the study.
        remedy : str
            How to choose another one, before its name.

        Raises
        ------
        uqmbd.StudyError
            With those integrators that have it.
        """
        require(integrator or self.integrator, needed, self.label, remedy=remedy)

    @property
    def unlocked(self) -> bool:
        """Whether realisations are computed without the interpreter: no events, no controllers, no statics alone."""
        model, cls = self.model, integrator_class(self.integrator)
        moves = needs_motion(model, self.kind)
        return capabilities_of(cls).releases_gil and moves and not (model.events or model.controls)

    @cached_property
    def common_identity(self) -> bytes:
        """What the numbers of chunks of all kinds depend on."""
        return fingerprint(self.model, self.inputs, (self.rtol, self.integrator), (self.whole_times.tobytes(),))

    @cached_property
    def identity(self) -> bytes:
        """What the numbers of a chunk depend on besides its inputs: equations and outputs as symbols, and options."""
        if self.over is None:
            return self.common_identity
        kind = (self.kind, self.over.tobytes())
        return fingerprint(self.model, self.inputs, (self.rtol, self.integrator), kind)

    def checked(self, values: Array) -> Array:
        """Return rows of inputs as an array (K, input), or raise a `StudyError`."""
        array = np.atleast_2d(np.asarray(values, dtype=float))
        if array.ndim != 2 or array.shape[1] != len(self.inputs):
            raise StudyError(
                f"{self.label}: inputs have shape {np.shape(values)}; expected (realisations, {len(self.inputs)}), "
                f"the columns being {', '.join(self.inputs.names)}."
            )
        return array
