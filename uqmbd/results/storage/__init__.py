"""Results in files: netCDF and Zarr, written whole or not at all."""

from __future__ import annotations

from uqmbd.results.storage.sample_file import SampleFile, sample_file
from uqmbd.results.storage.sample_store import SampleChunk, SampleStore, SampleStoreChunks
from uqmbd.results.storage.storage import load, save
from uqmbd.results.storage.unfinished import FOLDER, clear, computed, how_to_go_on, reopen

__all__ = [
    "FOLDER",
    "SampleChunk",
    "SampleFile",
    "SampleStore",
    "SampleStoreChunks",
    "clear",
    "computed",
    "how_to_go_on",
    "load",
    "reopen",
    "sample_file",
    "save",
]
