"""Store results in netCDF files, and many samples in Zarr folders; every write is atomic."""

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
from uqmbd.results.storage.models import absent_model, made_model, model_class, source_of_model
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
    "absent_model",
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
    "made_model",
    "make",
    "model_class",
    "move_unlisted",
    "move_aside",
    "not_verified",
    "open",
    "read_root",
    "record",
    "save",
    "source_of_model",
    "start_manifest",
    "stores_of",
]
