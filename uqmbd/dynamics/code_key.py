"""Keys of classes and functions registered by plugins, because their names do not identify the code."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from uqmbd.compiled import source_digest
from uqmbd.dynamics.code_digest import NoDigest
from uqmbd.dynamics.fingerprints import fingerprint
from uqmbd.dynamics.model_key import Digests
from uqmbd.mechanism import Line, Mechanism

__all__ = ["compute_code_key"]


def compute_code_key(value: type | Callable[..., Any]) -> str:
    """Return a digest of a class or function of a plugin or user; empty for the core, which has a version.

    If part of the content is unknown, the digest covers the known part and the sources.
    """
    if value.__module__.partition(".")[0] == "uqmbd":
        return ""
    try:
        digests = Digests(Mechanism("code", Line()))
        return hashlib.sha256(digests.of(value) + digests.code()).hexdigest()
    except NoDigest:
        return hashlib.sha256(fingerprint(value).encode() + _sources(value.__module__.partition(".")[0])).hexdigest()


@cache
def _sources(package: str) -> bytes:
    """Return a digest of the files of a package."""
    found: Sequence[str] = getattr(sys.modules.get(package), "__path__", ())
    return source_digest(map(Path, found))
