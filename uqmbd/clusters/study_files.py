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
    """Gives scripts to all workers, to those that come later too.

    Dask's own plugin imports a file on each worker. That would run a study although the worker needs nothing of it, and
    fails if the study imports a module next to it.

    `contents`: text of the scripts by file name; `folders`: where they are: what they import from beside them is
    found by workers that see these folders.
    """

    def __init__(self, contents: dict[str, bytes], folders: Sequence[str]) -> None:
        self.contents = contents
        self.folders = tuple(folders)

    @classmethod
    def of(cls, files: Sequence[Path]) -> StudyFiles:
        """Read scripts."""
        return cls({file.name: file.read_bytes() for file in files}, [str(file.parent) for file in files])

    def plugin(self) -> Any:
        """Return it as a plugin of Dask's workers, whose base is imported where it is used.

        What it does is found by its name: a worker without uqmbd says so, and would die of its first piece of work.
        """
        from distributed.diagnostics.plugin import WorkerPlugin

        kind = types.new_class("StudyFilesPlugin", (type(self), WorkerPlugin))
        return kind(self.contents, self.folders)

    async def setup(self, worker: Any) -> None:
        """Write the scripts into the worker's own folder, where imports find them."""
        for name, content in self.contents.items():
            await worker.upload_file(filename=name, data=content, load=False)
            # one of an earlier run, of this name, is not what is meant
            sys.modules.pop(Path(name).stem, None)
        importlib.invalidate_caches()
        sys.path += [folder for folder in self.folders if os.path.isdir(folder) and folder not in sys.path]
