"""Scripts that the workers of a Dask cluster may need."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

__all__ = ["study_files"]


def study_files(files: Sequence[Path]) -> Any:
    """Return a plugin for Dask that gives scripts to all workers, to those that come later too.

    Dask's own plugin imports a file on each worker, which runs a study where nothing of it is needed, and fails where
    it imports a module beside it.

    Parameters
    ----------
    files : sequence of Path
        The scripts.  What they import from beside them is found by workers that see these folders.
    """
    from distributed.diagnostics.plugin import WorkerPlugin

    contents = {file.name: file.read_bytes() for file in files}
    folders = [str(file.parent) for file in files]

    class StudyFiles(WorkerPlugin):  # type: ignore[misc]  # Dask has no types
        """Writes the scripts into a worker's own folder, where imports find them."""

        async def setup(self, worker: Any) -> None:
            for name, content in contents.items():
                await worker.upload_file(filename=name, data=content, load=False)
                # one of an earlier run, of this name, is not what is meant
                sys.modules.pop(Path(name).stem, None)
            importlib.invalidate_caches()
            sys.path += [folder for folder in folders if os.path.isdir(folder) and folder not in sys.path]

    return StudyFiles()
