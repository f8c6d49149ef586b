"""Resumed runs: compare options and study with the stored chunks, and warn of differences."""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
import warnings
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from uqmbd.dynamics import Model
from uqmbd.errors import StudyWarning
from uqmbd.files import replacing
from uqmbd.propagation.execution.checkpoints import FOLDER, fingerprint
from uqmbd.randomness import JointInput
from uqmbd.typing import Array

__all__ = ["study_digest", "warn_of_changes"]

Options = dict[str, dict[str, str]]
"""Values of options, as text, by method."""

RECORD = "asked.json"
"""Name of the file with the requested options, next to the finished chunks."""

WIDTH = 40
"""Largest number of characters of an option value in a message."""


def study_digest(model: Model, inputs: JointInput, times: Array, rtol: float, integrator: str) -> str:
    """Return a hash of all data that affect the results of the methods of a study, including distributions."""
    text = hashlib.sha256(fingerprint(model, inputs, (rtol, integrator), (times.tobytes(),)))
    if len(inputs):
        text.update(inputs.from_uniform(np.full((1, len(inputs)), 0.3)).tobytes())
    return text.hexdigest()[:32]


def warn_of_changes(
    folder: Path,
    study: str,
    methods: Mapping[str, Mapping[str, Any]],
    extended: Mapping[str, Collection[str]],
    *,
    resume: bool,
    stacklevel: int,
) -> None:
    """Record study and options of a run, and warn if the data in the folder are from another study or other options.

    `study` is the digest of the study; `methods` contains the options by label. `extended` contains, by label, the
    names of options that may change without a restart: the run continues the stored data. `stacklevel` has the same
    meaning as in `warnings.warn`.
    """
    requested = {label: {name: _text(value) for name, value in options.items()} for label, options in methods.items()}
    place = folder / FOLDER / RECORD
    before = _read(place) if resume else None
    for sentence in [] if before is None else _differences(before, study, requested, extended, place.parent):
        warnings.warn(sentence, StudyWarning, stacklevel=stacklevel + 1)
    known = before[1] if before is not None and before[0] == study else {}
    # ignore an error, because the write of the first chunk reports a full disk
    with contextlib.suppress(OSError):
        place.parent.mkdir(parents=True, exist_ok=True)
        with replacing(place) as part:
            part.write_text(json.dumps({"study": study, "methods": known | requested}))


def _read(place: Path) -> tuple[str, Options] | None:
    """Return the digest of the study, and options by method; None if the file is missing or damaged."""
    with contextlib.suppress(OSError, ValueError, LookupError, TypeError, AttributeError):
        found = json.loads(place.read_bytes())
        return str(found["study"]), {str(label): dict(options) for label, options in found["methods"].items()}
    return None


def _differences(
    before: tuple[str, Options],
    study: str,
    requested: Options,
    extended: Mapping[str, Collection[str]],
    place: Path,
) -> list[str]:
    """Return a sentence for each method whose stored data are missing or have other options."""
    if before[0] != study:
        return [
            f"resume: the data in {place} belong to another study (mechanism, inputs, times, tolerance, integrator or "
            "version of uqmbd). They are not used, and the run starts from the beginning."
        ]
    sentences = []
    for label, options in requested.items():
        if (earlier := before[1].get(label)) is None:
            sentences.append(f"resume: {place} contains no data of {label}; this method starts from the beginning.")
            continue
        fixed = (options.keys() | earlier.keys()) - set(extended.get(label, ()))
        if changed := sorted(name for name in fixed if options.get(name) != earlier.get(name)):
            values = " and ".join(f"{name}={_short(options, name)}, not {_short(earlier, name)}" for name in changed)
            sentences.append(
                f"resume: {label} has options that differ from the data of {place} ({values}), and recomputes the "
                "realisations that depend on them."
            )
    return sentences


def _short(options: Mapping[str, str], name: str) -> str:
    text = options.get(name, "nothing")
    return text if len(text) <= WIDTH else text[: WIDTH - 4] + " ..."


def _text(value: Any) -> str:
    """Return the value of an option as a text that is the same in every process."""
    return re.sub(r" at 0x[0-9a-fA-F]+", "", json.dumps(value, default=_plain, sort_keys=True, ensure_ascii=False))


def _plain(value: Any) -> Any:
    return sorted(map(repr, value)) if isinstance(value, (set, frozenset)) else repr(value)
