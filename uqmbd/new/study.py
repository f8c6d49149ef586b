"""`uqmbd new study`: a script that runs, to start from."""

from __future__ import annotations

from pathlib import Path

from uqmbd.new.names import check_module, check_study_name
from uqmbd.new.writing import rendered, write

__all__ = ["new_study"]


def new_study(name: str, folder: Path = Path(), *, typings: bool = False, force: bool = False) -> list[Path]:
    """Write a study script.

    `name`: of the script, without ``.py``, and of its study; `folder`: where it is written; made if it does not
    exist; `typings`: whether a hint for checkers of types is written beside it, too,
    ``typings/chaospy/__init__.pyi``; `force`: whether files that are there are overwritten. Return what was written,
    the script first. Raise StudyError if there can be no script of this name, or a file is there already.
    """
    check_study_name(name)
    check_module(name, name, folder)
    texts = rendered("study", {"name": name}, replaced={"NAME.py": f"{name}.py"})
    if typings:
        texts |= {Path("typings") / path: text for path, text in rendered("typings", {}).items()}
    return write(texts, folder, force=force)
