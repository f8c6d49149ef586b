"""Statistics of all samples, from a store or during the run, if the results contain only the first samples."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

import uqmbd
from uqmbd.extend import CircularMoments, CountedQuantiles, Labels, quantiles_of_chunks
from uqmbd.results import SampleStore
from uqmbd.typing import Array, Mask

__all__ = ["AllSamples", "Passing", "Stored", "together"]


class AllSamples(Protocol):
    """Statistics of all samples, and repeated access to their responses."""

    def statistics(self) -> dict[str, Array]:
        """Return the statistics that cannot be computed from moments."""

    def responses(self, first: int, last: int) -> Array:
        """Return responses (K, output, time) of samples `first` to `last`; NaN for failed samples."""


Watch = Callable[[int, Array, Mask], None]


class Passing:
    """Quantiles, extremes and directions of streamed samples, with memory independent of their number.

    With `again`, an unnamed temporary file stores the responses, so that they can be read again; it is deleted at the
    end.
    """

    def __init__(self, labels: Labels, again: bool, independent: bool = True) -> None:
        self._shape, self._turns = labels.shape, np.asarray(labels.turns, dtype=float)
        self._quantiles = CountedQuantiles(independent=independent)
        self._directions = CircularMoments.of(np.empty((0, *labels.shape)), self._turns)
        self._file: Any = tempfile.TemporaryFile() if again else None
        self._bytes = 8 * int(np.prod(labels.shape))

    def add(self, first: int, response: Array, fine: Mask) -> None:
        """Add samples from index `first` on: responses (K, output, time), and the mask (K,) of successful samples.

        Raise StudyError if the temporary file cannot be written.
        """
        good = response if fine.all() else response[fine]
        self._quantiles.add(good)
        self._directions = self._directions.merge(CircularMoments.of(good, self._turns))
        if self._file is None:
            return
        whole = np.where(fine.reshape(-1, *[1] * (response.ndim - 1)), response, np.nan)
        try:
            self._file.seek(first * self._bytes)
            self._file.write(np.ascontiguousarray(whole).tobytes())
            self._file.flush()
        except OSError as error:
            raise uqmbd.StudyError(
                "MonteCarlo with sobol_indices cannot write the samples to a temporary file in "
                f"{tempfile.gettempdir()}: {error.strerror}. Run the study in a run folder, or set TMPDIR to a "
                "folder with more space."
            ) from error

    def close(self) -> None:
        """Delete the temporary file."""
        if self._file is not None:
            self._file.close()

    def statistics(self) -> dict[str, Array]:
        """Return quantiles, errors (and intervals for independent samples), extremes, and statistics of directions."""
        return self._quantiles.statistics() | self._directions.statistics()

    def responses(self, first: int, last: int) -> Array:
        """Return responses (K, output, time) of samples `first` to `last`; NaN for failed samples."""
        self._file.seek(first * self._bytes)
        found = np.frombuffer(self._file.read((last - first) * self._bytes))
        return found.reshape(last - first, *self._shape)


class Stored:
    """Quantiles, extremes and directions of samples in a store, with exact quantiles.

    `labels` names the outputs.
    """

    def __init__(self, store: SampleStore, labels: Labels, independent: bool = True) -> None:
        self._store, self._labels, self._independent = store, labels, independent
        self._chunks = self._of([output.name for output in labels.outputs])

    def _of(self, names: list[str]) -> Any:
        every = names == [output.name for output in self._store.labels.outputs]
        return self._store.chunks(None if every else names)

    def statistics(self) -> dict[str, Array]:
        """Return quantiles (with intervals for independent samples), extremes, and statistics of directions."""
        turns = np.asarray(self._labels.turns, dtype=float)
        found = quantiles_of_chunks(self._chunks, independent=self._independent)
        if not np.any(turns):
            return found
        directions = CircularMoments.of(np.empty((0, *self._labels.shape)), turns)
        for part in self._chunks:
            good = part.response if part.good.all() else part.response[part.good]
            directions = directions.merge(CircularMoments.of(good, turns))
        return found | directions.statistics()

    def responses(self, first: int, last: int) -> Array:
        """Return responses (K, output, time) of samples `first` to `last`; NaN for failed samples."""
        found, size = [], self._store.size
        for number in range(first // size, (last - 1) // size + 1):
            part = self._chunks[number]
            rows = slice(max(first - part.first, 0), last - part.first)
            found.append(np.where(part.good[rows, None, None], part.response[rows], np.nan))
        return np.concatenate(found)


def together(watching: Sequence[Watch]) -> Watch:
    """Return a function that passes samples to each function of `watching`."""

    def tell(first: int, response: Array, fine: Mask) -> None:
        for one in watching:
            one(first, response, fine)

    return tell
