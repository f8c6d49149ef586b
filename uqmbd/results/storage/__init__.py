"""Results in files: netCDF and Zarr, written whole or not at all."""

from __future__ import annotations

from uqmbd.results.storage.journal import Record
from uqmbd.results.storage.lazy import open
from uqmbd.results.storage.sample_store import SampleChunk, SampleStore, SampleStoreChunks
from uqmbd.results.storage.storage import load, save
from uqmbd.results.storage.unfinished import FOLDER, clear, computed, how_to_go_on, is_kept, reopen
from uqmbd.results.storage.unfinished_store import Shelf, UnfinishedStore

__all__ = [
    "FOLDER",
    "Record",
    "SampleChunk",
    "SampleStore",
    "SampleStoreChunks",
    "Shelf",
    "UnfinishedStore",
    "clear",
    "computed",
    "how_to_go_on",
    "is_kept",
    "load",
    "open",
    "reopen",
    "save",
]
