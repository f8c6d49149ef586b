"""Import of optional packages that are not part of the base installation."""

from __future__ import annotations

import importlib
from types import ModuleType

from uqmbd.errors import StudyError

__all__ = ["require_package"]


def require_package(module: str, purpose: str, install: str) -> ModuleType:
    """Import a module of an optional package.

    Parameters
    ----------
    module : str
        Dotted name of the module.
    purpose : str
        Feature that needs the module, as the subject of the message.
    install : str
        Requirement for pip, such as ``"uqmbd[learning]"``.

    Returns
    -------
    module
        Imported module.

    Raises
    ------
    uqmbd.StudyError
        If the package is not installed, or `module` is not the dotted name of a module.

    Examples
    --------
    >>> from uqmbd.extend import require_package
    >>> require_package("numpy.linalg", "a solver", "numpy").__name__
    'numpy.linalg'
    >>> require_package("no_such_package", "method 'kriging'", "my-package[kriging]")
    Traceback (most recent call last):
    uqmbd.errors.StudyError: method 'kriging' needs no_such_package, ... pip install "my-package[kriging]"
    """
    if not isinstance(module, str) or not all(part.isidentifier() for part in module.split(".")):
        raise StudyError(f"require_package: module is {module!r:.80}; expected the dotted name of a module.")
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise StudyError(
            f"{purpose} needs {PACKAGES.get(package, package)}, which is not installed or cannot be imported "
            f'({error}): pip install "{install}"'
        ) from error


PACKAGES = {"dask": "Dask", "dask_jobqueue": "dask-jobqueue", "distributed": "Dask", "sklearn": "scikit-learn"}
"""Names of packages that differ from the names of their modules, by module."""
