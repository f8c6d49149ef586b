"""Command `uqmbd new study`, which writes an executable example script."""

from __future__ import annotations

from pathlib import Path

from uqmbd.new.names import check_module, check_study_name
from uqmbd.new.writing import rendered, write

__all__ = ["new_study"]


def new_study(name: str, folder: Path = Path(), *, typings: bool = False, force: bool = False) -> list[Path]:
    """Write a study script.

    `name` is the name of the study and of the script without ``.py``. `folder` is created if it does not exist.
    `typings` also writes the stub file ``typings/chaospy/__init__.pyi`` for type checkers to `folder`. `force` allows
    overwriting existing files. Return the paths of the written files, the script first. Raise StudyError if a script
    cannot have this name, or a file exists already and `force` is False.
    """
    check_study_name(name)
    check_module(name, name, folder)
    texts = rendered("study", {"name": name}, replaced={"NAME.py": f"{name}.py"})
    if typings:
        texts |= {Path("typings") / path: text for path, text in rendered("typings", {}).items()}
    return write(texts, folder, force=force)
