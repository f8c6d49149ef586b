"""Results in files: netCDF, and Zarr for many samples, written whole or not at all."""

from __future__ import annotations

from uqmbd.results.storage.journal import Record
from uqmbd.results.storage.lazy import open
from uqmbd.results.storage.manifest import (
    FIGURES,
    PREVIOUS,
    check_names,
    has_manifest,
    in_manifest,
    is_ours,
    is_recognised,
    move_aside,
    move_unlisted,
    record,
    start_manifest,
    stores_of,
)
from uqmbd.results.storage.sample_store import SampleChunk, SampleStore, SampleStoreChunks
from uqmbd.results.storage.storage import errors_of_files, load, not_verified, read_root, save
from uqmbd.results.storage.unfinished import (
    FOLDER,
    WITHIN,
    begin,
    check_unfinished,
    computed,
    is_unfinished,
    make,
    resume_hint,
)
from uqmbd.results.storage.unfinished_store import ResponseFile, UnfinishedStore

__all__ = [
    "FIGURES",
    "FOLDER",
    "PREVIOUS",
    "WITHIN",
    "Record",
    "SampleChunk",
    "SampleStore",
    "SampleStoreChunks",
    "ResponseFile",
    "UnfinishedStore",
    "begin",
    "check_names",
    "check_unfinished",
    "computed",
    "errors_of_files",
    "has_manifest",
    "resume_hint",
    "in_manifest",
    "is_unfinished",
    "is_ours",
    "is_recognised",
    "load",
    "make",
    "move_unlisted",
    "move_aside",
    "not_verified",
    "open",
    "read_root",
    "record",
    "save",
    "start_manifest",
    "stores_of",
]
