"""Writing Zarr folders such that nothing is at work there any more when a write has failed.

Zarr writes the chunks of an array at the same time.  Where one fails, the others go on behind the back of the caller,
and make the folder again that he has just removed.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import xarray as xr
from zarr.storage import LocalStore

from uqmbd.results.storage.chunks import chunks_of

if TYPE_CHECKING:
    from zarr.core.buffer import Buffer

__all__ = ["write_zarr"]

_TEXT = {"dtype": "O"}
"""Text of any width, which xarray writes as Zarr's type `string`."""

PATIENCE = 60.0
"""Longest wait, s, for writes that are under way when another has failed."""


def write_zarr(tree: xr.DataTree, path: Path, zarr_format: Literal[2, 3] = 2) -> None:
    """Write a tree to a folder that does not exist; when this returns or fails, nobody writes there any more."""
    writes = _Writes()
    encoding = {
        node.path: {
            name: {"chunks": chunks_of(variable), **(_TEXT if zarr_format == 3 and variable.dtype.kind == "U" else {})}
            for name, variable in node.variables.items()
            if variable.size
        }
        for node in tree.subtree
    }

    class Store(LocalStore):
        async def set(self, key: str, value: Buffer) -> None:
            await writes.count(lambda: LocalStore.set(self, key, value))

        async def set_if_not_exists(self, key: str, value: Buffer) -> None:
            await writes.count(lambda: LocalStore.set_if_not_exists(self, key, value))

    try:
        # The specification of format 3 has no fixed-width text and no consolidated metadata yet (both warn).
        tree.to_zarr(Store(path), zarr_format=zarr_format, encoding=encoding, consolidated=zarr_format == 2)
    except BaseException:
        writes.end()
        raise


class _Writes:
    """How many writes are under way, and whether more may begin."""

    def __init__(self) -> None:
        self.lock, self.busy, self.ended = threading.Lock(), 0, False

    async def count(self, write: Callable[[], Awaitable[Any]]) -> None:
        """Do a write, unless writing has ended."""
        with self.lock:
            if self.ended:
                raise OSError("writing has ended")
            self.busy += 1
        try:
            await write()
        finally:
            with self.lock:
                self.busy -= 1

    def end(self) -> None:
        """Let no write begin, and wait for those that have begun."""
        with self.lock:
            self.ended = True
        begin = time.monotonic()
        while self.busy and time.monotonic() - begin < PATIENCE:
            time.sleep(0.01)
