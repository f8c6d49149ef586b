"""Finished chunks on disk, so that an interrupted run loses nothing."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uqmbd.dynamics import ScalarValues
from uqmbd.propagation.chunks import Chunk

__all__ = ["Checkpoint", "clear"]

FOLDER = "unfinished"


@dataclass(frozen=True)
class Checkpoint:
    """Where the chunks of one propagator are kept while it runs.

    Parameters
    ----------
    folder : Path
        Of the run.
    label : str
        Of the propagator.
    """

    folder: Path
    label: str

    @property
    def place(self) -> Path:
        """Folder of the chunks."""
        return self.folder / FOLDER / hashlib.sha256(self.label.encode()).hexdigest()[:16]

    def load(self, key: str) -> Chunk | None:
        """Return a finished chunk, or nothing (also where the file is damaged)."""
        try:
            with np.load(self.place / f"{key}.npz", allow_pickle=False) as data:
                extra = json.loads(str(data["extra"]))
                scalars = None
                if "scalars" in data:
                    reasons = tuple(extra["scalar_messages"])
                    scalars = ScalarValues(data["scalars"], data["scalar_status"], reasons)
                return Chunk(data["response"], data["status"], tuple(extra["messages"]), extra["counters"], scalars)
        except (OSError, ValueError, KeyError, EOFError):
            return None
        except Exception as error:  # noqa: BLE001 - zipfile has exceptions of its own for damage
            if type(error).__module__.startswith(("zip", "zlib")):
                return None
            raise

    def save(self, key: str, chunk: Chunk) -> None:
        """Write a finished chunk; it is there as a whole or not at all."""
        self.place.mkdir(parents=True, exist_ok=True)
        about: dict[str, Any] = {"messages": chunk.messages, "counters": chunk.counters}
        arrays: dict[str, Any] = {"response": chunk.response, "status": chunk.status}
        if chunk.scalars is not None:
            about["scalar_messages"] = chunk.scalars.messages
            arrays |= {"scalars": chunk.scalars.values, "scalar_status": chunk.scalars.status}
        extra = json.dumps(about)
        with tempfile.NamedTemporaryFile(dir=self.place, suffix=".part", delete=False) as file:
            np.savez(file, extra=np.array(extra), **arrays)
        os.replace(file.name, self.place / f"{key}.npz")


def clear(folder: Path) -> None:
    """Forget the chunks of a run that is finished, or that starts over."""
    with contextlib.suppress(FileNotFoundError):
        shutil.rmtree(folder / FOLDER)
