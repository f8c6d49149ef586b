"""Finished chunks on disk, so that an interrupted run loses nothing."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics import MarginValues, ScalarValues
from uqmbd.errors import StudyError
from uqmbd.files import replacing
from uqmbd.propagation.execution.chunks import Chunk
from uqmbd.results.storage import FOLDER, how_to_go_on, make

__all__ = ["FOLDER", "Checkpoint"]

Arrays = Mapping[str, NDArray[Any]]

_ABOUT = "_about"
"""What is noted with arrays, in JSON."""


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
        found = self.load_arrays(f"{key}.npz")
        if found is None:
            return None
        data, about = found
        scalars = None
        if "scalars" in data:
            said = data["scalar_status"], tuple(about["scalar_messages"]), data["scalar_censored"] != 0
            scalars = ScalarValues(data["scalars"], *said)
        margins = None
        if "margins" in data:
            margins = MarginValues(data["margins"], data["margin_status"], tuple(about["margin_messages"]))
        messages = tuple(about["messages"])
        return Chunk(data["response"], data["status"], messages, about["counters"], scalars, margins, about["seconds"])

    def save(self, key: str, chunk: Chunk) -> None:
        """Write a finished chunk; it is there as a whole or not at all."""
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
        """Return arrays and what was noted with them, or nothing: not there, or damaged in whatever way.

        Nothing is unpickled, and the checksums of all arrays are compared before any of them is read.
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
        except Exception:  # noqa: BLE001 - whatever is wrong with the file, the work is done again
            return None
        return (arrays, about) if whole else None

    def save_arrays(self, name: str, arrays: Arrays, about: Mapping[str, Any]) -> None:
        """Write arrays, and what is to be noted with them, as a whole or not at all.

        Raises
        ------
        StudyError
            If they cannot be written: the file, the reason, and how to go on.
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
            raise StudyError(f"{path} cannot be written: {reason}.{how_to_go_on(self.folder)}") from error
