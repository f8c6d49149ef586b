"""Scripts that the workers of a Dask cluster may need."""

from __future__ import annotations

import importlib
import os
import sys
import types
from collections.abc import Sequence
from pathlib import Path
from typing import Any

__all__ = ["StudyFiles"]


class StudyFiles:
    """Copies of scripts for all present and future workers.

    Dask's own plugin imports a file on each worker. Such an import would run the study, which the worker may not need.
    It also fails if the study imports a module of its folder.

    `contents` contains the text of the scripts by file name. `folders` are the folders of the scripts. Workers with
    access to these folders can also import other modules in these folders.
    """

    def __init__(self, contents: dict[str, bytes], folders: Sequence[str]) -> None:
        self.contents = contents
        self.folders = tuple(folders)

    @classmethod
    def of(cls, files: Sequence[Path]) -> StudyFiles:
        """Read scripts."""
        return cls({file.name: file.read_bytes() for file in files}, [str(file.parent) for file in files])

    def plugin(self) -> Any:
        """Return a plugin for Dask's workers; only this method imports its base class `WorkerPlugin`.

        Workers import the other base class, `StudyFiles`, by its name. A worker without uqmbd therefore reports the
        missing package at once; otherwise its first task would terminate it.
        """
        from distributed.diagnostics.plugin import WorkerPlugin

        kind = types.new_class("StudyFilesPlugin", (type(self), WorkerPlugin))
        return kind(self.contents, self.folders)

    async def setup(self, worker: Any) -> None:
        """Write the scripts into the worker's local folder, from which it can import them."""
        for name, content in self.contents.items():
            await worker.upload_file(filename=name, data=content, load=False)
            # discard a module of this name from an earlier run
            sys.modules.pop(Path(name).stem, None)
        importlib.invalidate_caches()
        sys.path += [folder for folder in self.folders if os.path.isdir(folder) and folder not in sys.path]
