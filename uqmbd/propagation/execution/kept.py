"""Chunks of a problem that are known already: stored by an interrupted run, or computed beside others."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

from uqmbd.propagation.execution.checkpoint import Checkpoint
from uqmbd.propagation.execution.chunks import Chunk, Kind
from uqmbd.propagation.execution.cost import Clock
from uqmbd.propagation.execution.ledger import Ledger
from uqmbd.typing import Array

__all__ = ["Kept", "Known"]

Known = dict[tuple[Kind, bytes], Chunk | tuple[Checkpoint, str]]
"""Chunks, or where they are stored, by kind and inputs."""


@dataclass(frozen=True)
class Kept:
    """What is known of the chunks of one kind of outputs, and where others are kept.

    Attributes
    ----------
    kind : {"outputs", "scalars", "requirements"}
        Of the chunks.
    partial : bool
        Whether some of the outputs without a time are asked for only; others of them may be asked for next.
    margins : bool
        Whether margins of requirements that are computed beside are held.
    fingerprint : bytes
        What the numbers of a chunk depend on besides its inputs.
    joins : bool
        Whether a realisation is known not to depend on those beside it.
    known : dict
        Chunks that were computed beside others; it grows.
    checkpoint : Checkpoint, optional
        Where chunks are stored.
    ledger : Ledger, optional
        What a run with a budget has computed for other sizes of the method.
    clock : Clock
        Told of the time that stored chunks took.
    """

    kind: Kind
    partial: bool
    margins: bool
    fingerprint: bytes
    joins: bool
    known: Known
    checkpoint: Checkpoint | None
    ledger: Ledger | None
    clock: Clock

    def key(self, part: Array) -> str:
        """Return the name under which the chunk of some inputs is stored."""
        text = hashlib.sha256()
        text.update(part.tobytes())
        text.update(self.fingerprint)
        return text.hexdigest()[:32]

    def find(self, part: Array) -> Chunk | None:
        """Return a chunk that need not be computed."""
        if (known := self.held(part)) is not None:
            return known
        key = self.key(part)
        found = self.ledger.find(part, self.key, join=self.joins) if self.ledger else None
        if found is None:
            found = self.checkpoint.load(key) if self.checkpoint else None
        if self.ledger:
            self.ledger.begin(len(part)) if found is None else self.ledger.reuse(len(part))
        if found is None:
            return None
        self.clock.recover(key, found.seconds)
        return self.note(part, found)

    def keep(self, part: Array, chunk: Chunk, seconds: float) -> Chunk:
        """Store a chunk with the wall time that was spent on it."""
        key = self.key(part)
        if self.ledger:
            self.ledger.keep(key, replace(chunk, seconds=seconds))
        if self.checkpoint:
            self.checkpoint.save(key, replace(chunk, seconds=seconds))
            self.clock.done(key)
        return self.note(part, chunk)

    def note(self, part: Array, chunk: Chunk, *, lost: bool = False) -> Chunk:
        """Hold what was computed beside the outputs of a chunk, and return it; `lost`: it is not stored."""
        found = chunk.beside(self.kind, margins=self.margins)
        if self.partial:
            found["scalars"] = replace(chunk, counters={})
        self.hold(part, found, lost=lost)
        return chunk

    def hold(self, part: Array, chunks: Mapping[Kind, Chunk], *, lost: bool = False) -> None:
        """Hold what was computed beside others; what lies on the disk is read there, and what is lost does not."""
        stored = None if lost else self.checkpoint and (self.checkpoint, self.key(part))
        for kind, chunk in chunks.items():
            self.known[kind, _digest(part)] = stored or chunk

    def held(self, part: Array) -> Chunk | None:
        """Return a chunk that was computed beside others."""
        found = None if self.kind == "outputs" else self.known.get((self.kind, _digest(part)))
        if not isinstance(found, tuple):
            return found
        checkpoint, key = found
        chunk = checkpoint.load(key)
        found = None if chunk is None else chunk.of(self.kind)
        return None if found is None else replace(found, counters={})


def _digest(part: Array) -> bytes:
    return hashlib.sha256(part.tobytes()).digest()
