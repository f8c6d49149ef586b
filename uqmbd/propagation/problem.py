"""The problem that a propagator is given."""

from __future__ import annotations

import hashlib
import pickle
import time as clock
from collections import Counter
from collections.abc import Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from uqmbd import __version__
from uqmbd.dynamics import Ensemble, Model
from uqmbd.errors import StudyError
from uqmbd.propagation.checkpoint import Checkpoint
from uqmbd.propagation.chunks import CHUNK, Chunk, compute_chunk
from uqmbd.propagation.progress import Progress, Silent
from uqmbd.randomness import JointInput
from uqmbd.results import InputInfo, Labels, OutputInfo, labels, propagator_node

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.propagation.propagator import Propagator

__all__ = ["Problem", "Realisations"]

Array = NDArray[np.float64]

AHEAD = 64
"""Chunks that are computed or held ahead of the one that is wanted next."""


@dataclass(frozen=True)
class Realisations:
    """Responses of a mechanism to given inputs.

    Attributes
    ----------
    values : array, shape (K, input)
        The inputs.
    response : array, shape (K, output, time)
        NaN where a realisation failed.
    status : array of int, shape (K,)
        0: fine; `uqmbd.results.STATUS_MEANINGS` names the others.
    messages : tuple of str
        Reason of each failure, else empty.
    counters : dict
        Solver counters, summed.
    wall_time : float
        s.
    """

    values: Array
    response: Array
    status: NDArray[np.int64]
    messages: tuple[str, ...]
    counters: dict[str, float]
    wall_time: float

    @property
    def failures(self) -> int:
        """How many failed."""
        return int(np.count_nonzero(self.status))

    def most_frequent_reason(self) -> str:
        """Return the reason that most failures share (numbers aside), in its first wording."""
        reasons = [m for m in self.messages if m]
        if not reasons:
            return ""
        shapes = ["".join(c for c in m if not c.isdigit()) for m in reasons]
        return reasons[shapes.index(Counter(shapes).most_common(1)[0][0])]


@dataclass(frozen=True)
class Problem:
    """Inputs, outputs and times of a study, and the means to compute realisations.

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
    """

    study: str
    mechanism: str
    label: str
    inputs: JointInput
    times: Array
    rtol: float
    integrator: str
    model: Model = field(repr=False)
    executor: Executor | None = field(default=None, repr=False)
    progress: Progress = field(default_factory=Silent, repr=False)
    checkpoint: Checkpoint | None = field(default=None, repr=False)

    @property
    def labels(self) -> Labels:
        """Names and units of outputs, inputs and times, for `uqmbd.results`."""
        seen = self.model.outputs
        outputs = [OutputInfo(*about) for about in zip(seen.names, seen.units, seen.turns.tolist(), strict=True)]
        variables = self.inputs.variables
        return labels(outputs, [InputInfo(v.name, v.units, v.description) for v in variables], self.times)

    @cached_property
    def _packed(self) -> bytes:
        return pickle.dumps(self.model)

    def ensemble(self, values: Array) -> Ensemble:
        """Make the ensemble of some realisations, for methods that solve them together.

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs, in the order of ``inputs.names``.
        """
        return Ensemble(self.model, self._checked(values))

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
        begin = clock.perf_counter()
        parts = list(self.stream(values))
        counters: Counter[str] = Counter()
        for part in parts:
            counters.update(part.counters)
        empty = np.zeros((0, len(self.model.outputs.names), len(self.times)))
        return Realisations(
            self._checked(values),
            np.concatenate([empty, *(p.response for p in parts)]),
            np.concatenate([np.zeros(0, dtype=np.int64), *(p.status for p in parts)]),
            tuple(m for p in parts for m in p.messages),
            dict(counters),
            clock.perf_counter() - begin,
        )

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
        values = self._checked(values)
        self.progress.start(self.label, len(values))
        begin = clock.perf_counter()
        parts = [np.ascontiguousarray(values[k : k + CHUNK]) for k in range(0, len(values), CHUNK)]
        for index, chunk in self._chunks(parts):
            now = clock.perf_counter()
            yield Realisations(
                parts[index], chunk.response, chunk.status, chunk.messages, dict(chunk.counters), now - begin
            )
            begin = now
            self.progress.advance(self.label, len(chunk.status))
        self.progress.finish(self.label)

    def _chunks(self, parts: list[Array]) -> Iterator[tuple[int, Chunk]]:
        """Finished chunks in order; each is stored as soon as it is finished."""
        ready: dict[int, Chunk] = {}
        running: dict[Future[Chunk], int] = {}
        submitted = 0
        try:
            for wanted in range(len(parts)):
                while wanted not in ready:
                    # some in reserve for every worker, but never all at once: results must not pile up
                    while submitted < len(parts) and len(running) + len(ready) < AHEAD:
                        index, submitted = submitted, submitted + 1
                        found = self.checkpoint.load(self._key(parts[index])) if self.checkpoint else None
                        if found is not None:
                            ready[index] = found
                        elif self.executor is None:
                            ready[index] = self._keep(parts[index], compute_chunk(*self._task(parts[index])))
                        else:
                            running[self.executor.submit(compute_chunk, *self._task(parts[index]))] = index
                        if self.executor is None:
                            break
                    if wanted in ready:
                        break
                    for future in wait(running, return_when=FIRST_COMPLETED).done:
                        index = running.pop(future)
                        ready[index] = self._keep(parts[index], future.result())
                yield wanted, ready.pop(wanted)
        finally:
            for future in running:
                future.cancel()

    def _task(self, part: Array) -> tuple[bytes, Array, Array, float, str]:
        return self._packed, part, self.times, self.rtol, self.integrator

    def _keep(self, part: Array, chunk: Chunk) -> Chunk:
        if self.checkpoint:
            self.checkpoint.save(self._key(part), chunk)
        return chunk

    @property
    def folder(self) -> Path | None:
        """Folder of the run's files, if it has one."""
        return self.checkpoint.folder if self.checkpoint else None

    def _key(self, part: Array) -> str:
        text = hashlib.sha256()
        text.update(part.tobytes())
        text.update(self._fingerprint)
        return text.hexdigest()[:32]

    @cached_property
    def _fingerprint(self) -> bytes:
        """What the numbers of a chunk depend on besides its inputs: equations and outputs as symbols, and options."""
        model = self.model
        options = (self.rtol, self.integrator, model.start_at)
        parts = (model.digest, self.inputs.names, *options, self.times.tobytes(), __version__)
        turns = model.outputs.turns
        # angles start near those at the means
        angles = (turns.tobytes(), self.inputs.means.tobytes()) if turns.any() else ()
        return hashlib.sha256(repr((*parts, *angles)).encode()).digest()

    def _checked(self, values: Array) -> Array:
        array = np.atleast_2d(np.asarray(values, dtype=float))
        if array.ndim != 2 or array.shape[1] != len(self.inputs):
            raise StudyError(
                f"{self.label}: inputs have shape {np.shape(values)}; expected (realisations, {len(self.inputs)}), "
                f"the columns being {', '.join(self.inputs.names)}."
            )
        return array

    def node(
        self,
        propagator: Propagator,
        statistics: xr.Dataset,
        samples: xr.Dataset | None = None,
        *,
        realisations: int,
        wall_time: float,
        counters: Mapping[str, Any] | None = None,
        children: Mapping[str, xr.Dataset] | None = None,
        attrs: Mapping[str, Any] | None = None,
    ) -> xr.DataTree:
        """Make the node of a propagator, with its options as provenance.

        Parameters
        ----------
        propagator : Propagator
            The method at work.
        statistics, samples : xarray.Dataset
            From `uqmbd.results`.
        realisations : int
            How many were computed.
        wall_time : float
            s.
        counters, children, attrs : mapping, optional
            Solver counters, further datasets, further attributes.
        """
        options = {f.name: getattr(propagator, f.name) for f in fields(propagator) if f.name != "label"}
        return propagator_node(
            self.label,
            statistics,
            samples,
            propagator=propagator.name,
            realisations=realisations,
            wall_time=wall_time,
            seed=options.get("seed"),
            options=options,
            solver_counters=counters,
            children=children,
            attrs={"start": self.model.start_at, **(attrs or {})},
        )
