"""Exporters from plugins, which `uqmbd export` uses."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar, Protocol

__all__ = ["Exporter"]


class Exporter(Protocol):
    """Protocol of an exporter to files of another program; a plugin offers the class by the hook ``uqmbd_exporters``.

    The class is a dataclass, and need not be derived from this protocol. The fields of the dataclass are options with
    defaults: ``uqmbd export STUDY.py --to FILE --steps 20`` sets the field ``steps``. The annotation of a field states
    its values. A field with truth values is a switch. A method ``remark(what, study)`` is optional: `uqmbd check` shows
    its text, such as possible values of options, if the object can be exported.

    Attributes
    ----------
    name : str
        Registered name.
    suffix : str
        Ending of the files, such as ``".fmu"``.  `uqmbd export` selects the exporter by the ending of the file.
    exports : tuple of str
        Supported objects: ``"surrogate"``, ``"mechanism"`` or both.  The first one is the default.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> from pathlib import Path
    >>> from typing import Any
    >>> import uqmbd
    >>> @dataclass(frozen=True)
    ... class Means:
    ...     name = "means"
    ...     suffix = ".txt"
    ...     exports = ("surrogate",)
    ...     digits: int = 6
    ...     def refusal(self, what: str, study: Any) -> str:
    ...         return ""
    ...     def export(self, source: Any, path: Path, study: Any) -> str:
    ...         mean = uqmbd.results.surrogate(source).mean
    ...         path.write_text(str(mean.round(self.digits).tolist()))
    ...         return f"means    {path}"
    >>> exporter: type[uqmbd.extend.Exporter] = Means
    """

    name: ClassVar[str]
    suffix: ClassVar[str]
    exports: ClassVar[tuple[str, ...]]

    def refusal(self, what: str, study: Any) -> str:
        """Return why an object of a study cannot be exported, as far as this is known before a run; empty if it can.

        Parameters
        ----------
        what : str
            One of `exports`.
        study : uqmbd.Study
            Study.  `uqmbd check` lists the reason.
        """
        ...

    def export(self, source: Any, path: Path, study: Any) -> str:
        """Write the file.

        Parameters
        ----------
        source : xarray.DataTree or uqmbd.Mechanism
            Results of a method, as from `uqmbd.Study.propagate`, for ``"surrogate"``; the mechanism of the study for
            ``"mechanism"``.
        path : pathlib.Path
            File to write, whose folder exists.
        study : uqmbd.Study
            Study, with its times and its tolerance.

        Returns
        -------
        str
            Lines that the command prints.
        """
        ...
