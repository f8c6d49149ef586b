"""Matrices of finite element programs from files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
import scipy.sparse

import uqmbd
from uqmbd.extend import typechecked

__all__ = ["read_matrix"]


@typechecked
def read_matrix(path: str | Path, name: str | None = None) -> Any:
    """Read a sparse matrix from a Matrix Market file or a ``.npz`` file.

    Parameters
    ----------
    path : str or Path
        File with the ending ``.mtx``, ``.mtx.gz`` or ``.npz``. Symmetric storage is expanded.
    name : str, optional
        Name of the array in an ``.npz`` file with several arrays. Default: the only array, or a matrix stored by
        `scipy.sparse.save_npz`.

    Returns
    -------
    scipy.sparse.csc_array
        Matrix.

    Raises
    ------
    uqmbd.StudyError
        If the file does not exist, has another format, or contains no such array.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> import uqmbd_flexible
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.savez(f"{folder}/beam.npz", mass=np.eye(2), stiffness=np.array([[1, -1], [-1, 1]]))
    ...     found = uqmbd_flexible.read_matrix(f"{folder}/beam.npz", "stiffness")
    >>> found.shape
    (2, 2)
    """
    file = Path(path)
    where = f"read_matrix {str(file)!r}"
    if not file.is_file():
        raise uqmbd.StudyError(f"{where}: there is no such file.")
    try:
        if file.name.endswith((".mtx", ".mtx.gz")):
            return scipy.sparse.csc_array(scipy.io.mmread(file))
        if file.name.endswith(".npz"):
            return _read_archive(where, file, name)
    except (ValueError, OSError, TypeError) as error:
        raise uqmbd.StudyError(f"{where}: the file cannot be read: {error}") from error
    raise uqmbd.StudyError(f"{where}: the ending is {file.suffix!r}; expected .mtx, .mtx.gz or .npz.")


def _read_archive(where: str, file: Path, name: str | None) -> Any:
    with np.load(file, allow_pickle=False) as archive:
        names = list(archive.files)
        if "indptr" in names and name is None:
            return scipy.sparse.csc_array(scipy.sparse.load_npz(file))
        if name is None and len(names) == 1:
            name = names[0]
        if name not in names:
            raise uqmbd.StudyError(
                f"{where}: {'no name is given' if name is None else f'there is no array {name!r}'}; the file contains "
                f"{', '.join(map(repr, names)) or 'no array'}."
            )
        return scipy.sparse.csc_array(archive[name])
