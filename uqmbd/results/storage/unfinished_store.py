"""Store samples during a run; the store is also the checkpoint of the chunks of the run.

The process that computes a chunk writes its responses once. A journal lists complete chunks, with checksums. At the end
the store moves next to the results. The journal of the store stays with the unfinished data until the results are
saved, so that a resumed run continues in place.
"""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.files import flush, replacing
from uqmbd.results.schema import Labels
from uqmbd.results.storage.chunk_file import checksum_of, encoded, read_checked, write_file
from uqmbd.results.storage.journal import Journal, Record
from uqmbd.results.storage.manifest import foreign_in_store, is_ours, move_unlisted, record
from uqmbd.results.storage.sample_store import MESSAGE, SampleStore
from uqmbd.results.storage.unfinished import make, resume_hint
from uqmbd.typing import Array, Index

__all__ = ["ResponseFile", "UnfinishedStore"]

_IDENTITY = "identity"


@dataclass(frozen=True)
class ResponseFile:
    """File to which a worker writes the responses of one chunk."""

    path: Path  # path of the file
    token: tuple[Path, str]  # a file and its content; a worker shares the folder if it reads the same content there
    chunk: tuple[int, ...]  # shape of a chunk; the last chunk may be partly filled
    checksum: int | None = None  # checksum of the written file

    @property
    def shared(self) -> bool:
        """Whether the worker and the main process share the folder."""
        try:
            return self.token[0].read_text() == self.token[1]
        except (OSError, ValueError):
            return False

    def load(self, count: int) -> Array | None:
        """Return the written responses, (K, output, time); None if the file is missing or was changed."""
        return None if self.checksum is None else read_checked(self.path, self.chunk, self.checksum, count)

    def put(self, response: Array) -> tuple[int, bytes | None]:
        """Write responses if the folder is shared; return the checksum and, if nothing was written, the content."""
        content = encoded(response, "<f8", self.chunk)
        checksum = checksum_of(content)
        if self.shared:
            # after a failed write, the main process writes the returned content and reports any error
            with contextlib.suppress(OSError):
                write_file(self.path, content)
                return checksum, None
        return checksum, content


class UnfinishedStore:
    """Store for samples of one kind of outputs of a method during their computation.

    `folder`: folder of the run; `place`: folder of the unfinished data of the method; `name`: final name of the store
    next to the results; `identity`: digest of all dependencies (a store with another identity is not continued);
    `count`: number of samples; `size`: number of samples in a chunk; `axes`: labels of the axes. Raise StudyError if
    the store cannot be created.
    """

    def __init__(
        self, folder: Path, place: Path, name: str | None, identity: str, count: int, size: int, axes: Labels
    ) -> None:
        self._folder, self._place, self._target = folder, place, None if name is None else folder / name
        self._journal = Journal(place / f"{identity}.journal")
        self._token = place / f"{identity}.token", secrets.token_hex(16)
        self._identity = identity
        self._records = np.full(-(-count // size), -1, dtype=np.int64)
        self._pending: list[tuple[Array, Index, Sequence[str]]] = []
        self._filled = 0
        try:
            make(folder)
            place.mkdir(exist_ok=True)
            with replacing(self._token[0], lasting=False) as part:
                part.write_text(self._token[1])
            for at, about in self._journal.places():
                number = about.get("number")
                if isinstance(number, int) and 0 <= number < len(self._records) and not about.get("lost"):
                    self._records[number] = at
            own = place / f"{identity}.zarr"
            begun = (self._records >= 0).any()
            there = [p for p in (self._target if begun else None, own) if p is not None and _identity(p) == identity]
            self._store = SampleStore(there[0] if there else own, count, size, axes)
            if len(there) != 1 or not self._store.fits():
                self._store = self._made(there, own)
        except OSError as error:
            raise self._failed(error) from error

    def _made(self, there: Sequence[Path], own: Path) -> SampleStore:
        """Create the store again, and move the recorded responses of earlier stores into it."""
        store = SampleStore(own, self._store.count, self._store.size, self._store.labels)
        # chunks beyond the present count may be requested later, for example after the pilot of a budget
        rest = self._place / f"{self._identity}.rest"
        folders = [rest, *(old / "response" for old in there)]
        with replacing(own, lasting=False) as part:
            made = SampleStore.create(part, store.count, store.size, store.labels, {_IDENTITY: self._identity})
            for old in folders:
                for number in np.flatnonzero(self._records >= 0).tolist():
                    place = made.place("response", number)
                    with contextlib.suppress(FileNotFoundError):
                        os.replace(old / place.name, place)
            for old in folders[1:]:
                for file in old.glob("[0-9]*"):
                    rest.mkdir(exist_ok=True)
                    os.replace(file, rest / file.name)
        for old in there:
            if old != own:
                foreign = foreign_in_store(old)
                if foreign:
                    raise FileExistsError(errno.EEXIST, "it contains files that uqmbd did not write", str(foreign[0]))
                shutil.rmtree(old)
        return store

    def __len__(self) -> int:
        """Return the number of chunks."""
        return len(self._records)

    def record(self, number: int) -> Record | None:
        """Return the record of a chunk; None if it has not been computed."""
        at = int(self._records[number])
        return None if at < 0 else self._journal.read(at)

    def shelf(self, number: int, checksum: int | None = None) -> ResponseFile:
        """Return the file of the responses of a chunk."""
        _, chunk = self._store.shapes("response")
        return ResponseFile(self._store.place("response", number), self._token, chunk, checksum)

    def keep(
        self, number: int, content: bytes | None, about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]
    ) -> None:
        """Record that a chunk is complete, and write its responses if no worker has written them.

        Raise StudyError, with the file, the reason and a remedy, if the chunk cannot be written.
        """
        try:
            if content is not None:
                write_file(self._store.place("response", number), content)
            self._records[number] = self._journal.append({**about, "number": number}, arrays)
        except OSError as error:
            raise self._failed(error) from error

    def fill(self, values: Array, status: Index, messages: Sequence[str]) -> None:
        """Write inputs (K, input), status (K,) and K messages of the next samples, in order."""
        self._pending.append((values, status, messages))
        if sum(len(batch[1]) for batch in self._pending) >= self._store.block:
            self._flush()

    def _flush(self) -> None:
        if not self._pending:
            return
        values, status = (np.concatenate([batch[k] for batch in self._pending]) for k in (0, 1))
        try:
            self._store.put("inputs", self._filled, values)
            self._store.put("status", self._filled, status)
            messages = [""] * len(status)
            if status.any():
                messages = [_shortened(m) for batch in self._pending for m in batch[2]]
            self._store.put(
                "message", self._filled, np.array(messages, dtype=f"<U{MESSAGE}" if any(messages) else "<U1")
            )
        except OSError as error:
            raise self._failed(error) from error
        self._filled += len(status)
        self._pending.clear()

    def finish(self) -> SampleStore:
        """Write the remaining samples and move the store to its final folder; all chunks must be complete."""
        self._flush()
        store = self._store
        try:
            for part in store.folder.glob("*/.*.part"):  # incomplete files of a killed worker
                part.unlink(missing_ok=True)
            if self._target is not None and store.folder != self._target:
                flush(store.folder)
                old = self._place / "old.zarr"
                shutil.rmtree(old, ignore_errors=True)
                if os.path.lexists(self._target):
                    if is_ours(self._folder, self._target.name):
                        os.replace(self._target, old)
                    else:
                        move_unlisted(self._folder, [self._target.name])
                # record the store before it is renamed, so that the manifest lists it even if the run is killed
                record(self._folder, [self._target.name], [store.folder])
                os.replace(store.folder, self._target)
                shutil.rmtree(old, ignore_errors=True)
            elif self._target is not None:
                record(self._folder, [self._target.name])
        except OSError as error:
            raise self._failed(error) from error
        if self._target is not None:
            self._store = SampleStore(self._target, store.count, store.size, store.labels)
        return self._store

    def _failed(self, error: OSError) -> StudyError:
        reason = error.strerror or str(error)
        where = error.filename or self._place
        return StudyError(f"{where} cannot be written: {reason}.{resume_hint(self._folder)}")


def _identity(folder: Path) -> str | None:
    return SampleStore.attribute(folder, _IDENTITY)


def _shortened(message: str) -> str:
    return message if len(message) <= MESSAGE else message[: MESSAGE - 4] + " ..."
