"""Stored chunks of a problem, from an interrupted run or from a computation of other outputs."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics import MarginValues, Model, ScalarValues, compute_code_key, integrator_class
from uqmbd.errors import StudyError
from uqmbd.files import replacing
from uqmbd.propagation.execution.chunks import Chunk, Kind
from uqmbd.propagation.execution.cost import CostClock
from uqmbd.propagation.execution.ledger import Ledger
from uqmbd.randomness import JointInput
from uqmbd.results.storage import FOLDER, make, resume_hint
from uqmbd.typing import Array
from uqmbd.version import __version__

__all__ = ["FOLDER", "Checkpoint", "ChunkStore", "StoredChunks", "fingerprint"]


def fingerprint(
    model: Model, inputs: JointInput, integration: tuple[float, str], times: tuple[str | bytes, ...]
) -> bytes:
    """Return the hash of symbolic equations and outputs, options and version.

    `integration` contains the relative tolerance and the name of the integrator; `times` contains the output times and
    the requested kind. The hash contains the name of the integrator. The name identifies the code only if the
    integrator belongs to the core.
    """
    code = compute_code_key(integrator_class(integration[1]))
    options = (*integration, *([code] if code else []), model.start_at, model.max_step, model.added_breaks)
    parts = (model.digest, inputs.names, *options, *times, __version__)
    turns = model.outputs.turns
    # the whole turns of initial angles depend on the means of the inputs
    angles = (turns.tobytes(), inputs.means.tobytes()) if turns.any() else ()
    return hashlib.sha256(repr((*parts, *angles)).encode()).digest()


Arrays = Mapping[str, NDArray[Any]]

_ABOUT = "_about"
"""Name of the array with the metadata of the other arrays, in JSON."""


@dataclass(frozen=True)
class Checkpoint:
    """Store of the chunks of a method during a run, in the run's folder."""

    folder: Path
    label: str  # label of the method

    @property
    def place(self) -> Path:
        """Return the folder of the chunks."""
        return self.folder / FOLDER / hashlib.sha256(self.label.encode()).hexdigest()[:16]

    def load(self, key: str) -> Chunk | None:
        """Return a finished chunk; None if it is missing or its file is damaged."""
        found = self.load_arrays(f"{key}.npz")
        if found is None:
            return None
        data, about = found
        scalars = None
        if "scalars" in data:
            stored = data["scalar_status"], tuple(about["scalar_messages"]), data["scalar_censored"] != 0
            scalars = ScalarValues(data["scalars"], *stored)
        margins = None
        if "margins" in data:
            margins = MarginValues(data["margins"], data["margin_status"], tuple(about["margin_messages"]))
        messages = tuple(about["messages"])
        return Chunk(data["response"], data["status"], messages, about["counters"], scalars, margins, about["seconds"])

    def save(self, key: str, chunk: Chunk) -> None:
        """Write a finished chunk atomically."""
        about: dict[str, Any] = {"messages": chunk.messages, "counters": chunk.counters, "seconds": chunk.seconds}
        arrays: dict[str, Any] = {"response": chunk.response, "status": chunk.status}
        if chunk.scalars is not None:
            about["scalar_messages"] = chunk.scalars.messages
            arrays |= {"scalars": chunk.scalars.values, "scalar_status": chunk.scalars.status}
            arrays["scalar_censored"] = chunk.scalars.censored
        if chunk.margins is not None:
            about["margin_messages"] = chunk.margins.messages
            arrays |= {"margins": chunk.margins.running, "margin_status": chunk.margins.status}
        self.save_arrays(f"{key}.npz", arrays, about)

    def load_arrays(self, name: str) -> tuple[dict[str, NDArray[Any]], dict[str, Any]] | None:
        """Return arrays and their metadata; None if they are missing or damaged.

        The method unpickles no data, and compares the checksums of all arrays before it reads an array.
        """
        try:
            content = (self.place / name).read_bytes()
            with zipfile.ZipFile(io.BytesIO(content)) as file:
                if file.testzip() is not None:
                    return None
            with np.load(io.BytesIO(content), allow_pickle=False) as stored:
                arrays = {key: stored[key] for key in stored.files}
            about = json.loads(str(arrays.pop(_ABOUT)))
            whole = about["arrays"] == {key: [str(x.dtype), list(x.shape)] for key, x in arrays.items()}
        except Exception:  # noqa: BLE001 - a file with any damage is computed again
            return None
        return (arrays, about) if whole else None

    def save_arrays(self, name: str, arrays: Arrays, about: Mapping[str, Any]) -> None:
        """Write arrays and metadata atomically.

        Raise StudyError with the file, the reason and a remedy if they cannot be written.
        """
        path = self.place / name
        kinds = {key: [str(x.dtype), list(x.shape)] for key, x in arrays.items()}
        text = np.array(json.dumps({**about, "arrays": kinds}))
        try:
            make(self.folder)
            self.place.mkdir(exist_ok=True)
            with replacing(path) as part, part.open("wb") as file:
                np.savez(file, **{_ABOUT: text}, **arrays)  # type: ignore[arg-type]  # its stub takes names for options
        except OSError as error:
            reason = error.strerror or error
            raise StudyError(f"{path} cannot be written: {reason}.{resume_hint(self.folder)}") from error


StoredChunks = dict[tuple[Kind, bytes], Chunk | tuple[Checkpoint, str]]
"""Chunks, or references to their files, by kind and inputs."""


@dataclass(frozen=True)
class ChunkStore:
    """Store of the chunks of one kind of outputs, and of chunks of other kinds that were computed with them."""

    kind: Kind  # kind of the chunks
    partial: bool  # whether only some outputs without a time are requested; requests of other outputs may follow
    margins: bool  # whether to store the margins of requirements that are computed with the chunks
    fingerprint: bytes  # identifies all data, except the inputs, that affect the numbers of a chunk
    joinable: bool  # whether chunks can be joined to a larger chunk with the same bits
    known: StoredChunks  # chunks of other kinds; each computation adds chunks
    checkpoint: Checkpoint | None
    ledger: Ledger | None  # chunks that a run with a budget has computed for other sizes of the method
    clock: CostClock  # advances by the computing time of stored chunks

    def key(self, part: Array) -> str:
        """Return the name of the stored chunk of some inputs."""
        text = hashlib.sha256()
        text.update(part.tobytes())
        text.update(self.fingerprint)
        return text.hexdigest()[:32]

    def find(self, part: Array) -> Chunk | None:
        """Return a chunk that was already computed, or None."""
        if (known := self.find_companion(part)) is not None:
            return known
        key = self.key(part)
        found = self.ledger.find(part, self.key, join=self.joinable) if self.ledger else None
        if found is None:
            found = self.checkpoint.load(key) if self.checkpoint else None
        if self.ledger:
            self.ledger.begin(len(part)) if found is None else self.ledger.reuse(len(part))
        if found is None:
            return None
        self.clock.recover(key, found.seconds)
        return self.note(part, found)

    def keep(self, part: Array, chunk: Chunk, seconds: float) -> Chunk:
        """Store a chunk with the wall time of its computation."""
        key = self.key(part)
        if self.ledger:
            self.ledger.keep(key, replace(chunk, seconds=seconds))
        if self.checkpoint:
            self.checkpoint.save(key, replace(chunk, seconds=seconds))
            self.clock.done(key)
        return self.note(part, chunk)

    def note(self, part: Array, chunk: Chunk, *, lost: bool = False) -> Chunk:
        """Store the companions of a chunk, and return the chunk; if `lost`, there is no copy on disk."""
        found = chunk.companions(self.kind, margins=self.margins)
        if self.partial:
            found["scalars"] = replace(chunk, counters={})
        self.store_companions(part, found, lost=lost)
        return chunk

    def store_companions(self, part: Array, chunks: Mapping[Kind, Chunk], *, lost: bool = False) -> None:
        """Store chunks of other kinds for the inputs of a part, or references to their files if they are on disk."""
        stored = None if lost else self.checkpoint and (self.checkpoint, self.key(part))
        for kind, chunk in chunks.items():
            self.known[kind, _digest(part)] = stored or chunk

    def find_companion(self, part: Array) -> Chunk | None:
        """Return a chunk that was computed with another kind of outputs."""
        found = None if self.kind == "outputs" else self.known.get((self.kind, _digest(part)))
        if not isinstance(found, tuple):
            return found
        checkpoint, key = found
        chunk = checkpoint.load(key)
        found = None if chunk is None else chunk.of(self.kind)
        return None if found is None else replace(found, counters={})


def _digest(part: Array) -> bytes:
    return hashlib.sha256(part.tobytes()).digest()
