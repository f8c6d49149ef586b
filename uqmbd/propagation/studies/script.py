"""Study scripts: a Python file with a module-level `study`; errors in it are reported with lines of the script."""

from __future__ import annotations

import builtins
import hashlib
import importlib
import importlib.machinery
import importlib.util
import linecache
import os
import pkgutil
import re
import sys
import traceback
from pathlib import Path
from types import ModuleType

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.files import check_script
from uqmbd.names import did_you_mean
from uqmbd.propagation.studies.study import Study

__all__ = ["load_study"]


@typechecked
def load_study(path: str | os.PathLike[str]) -> Study:
    """Run a study script and return its module-level ``study``.

    The script runs as a module named like the file, with its folder first on ``sys.path``, as if it had been started by
    Python; afterwards the folder stays last on ``sys.path``, so that worker processes can import the functions that the
    script defines. A file with the name of an installed module gets another module name. Worker processes can then use
    its functions and classes only if these processes are forked.

    Parameters
    ----------
    path : str or Path
        The script, a ``.py`` file.

    Returns
    -------
    Study
        The object that the script calls ``study``.

    Raises
    ------
    uqmbd.StudyError
        If there is no such file, it is not a Python file, it raises, or its ``study`` is missing or is no study. If the
        script raises, the message shows the line of the script and the error, and the error is the cause.

    Examples
    --------
    >>> import tempfile
    >>> lines = (
    ...     "import uqmbd",
    ...     "mechanism = uqmbd.Mechanism('fall', uqmbd.Translational(gravity=(0, -9.81)))",
    ...     "stone = mechanism.body('stone', mass=1)",
    ...     "mechanism.output('height', stone.position[1], units='m')",
    ...     "study = uqmbd.Study('fall', mechanism, [0, 1])",
    ... )
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     script = Path(folder) / "falling_stone.py"
    ...     _ = script.write_text(chr(10).join(lines))
    ...     load_study(script).name
    'fall'
    """
    file = check_script(path)
    return _take_study(_run(file.resolve(), shown=str(path)), shown=str(path))


def _run(file: Path, shown: str) -> ModuleType:
    """Run the script as a module of its own; on failure nothing of it stays behind."""
    folder = str(file.parent)
    sys.path.insert(0, folder)
    name = _module_name(file)
    previous = sys.modules.pop(name, None)
    loader = importlib.machinery.SourceFileLoader(name, str(file))
    spec = importlib.util.spec_from_file_location(name, file, loader=loader)
    assert spec is not None  # there is a loader
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    linecache.checkcache(str(file))
    try:
        # Compiled from the text, not by the loader: a stale or unwritable __pycache__ then has no say.
        exec(compile(file.read_bytes(), str(file), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        if previous is not None:
            sys.modules[name] = previous
        raise StudyError(_explain(error, file, shown)) from error
    finally:
        if folder in sys.path:
            sys.path.remove(folder)
    if folder not in sys.path:
        sys.path.append(folder)
    return module


def _module_name(file: Path) -> str:
    """Name the script's module after the file, unless that name belongs to something else already."""
    name = file.stem
    existing = sys.modules.get(name)
    if existing is not None:
        free = _same_file(getattr(existing, "__file__", None), file)
    else:
        try:
            elsewhere = importlib.machinery.PathFinder.find_spec(
                name, [entry for entry in sys.path if not _same_file(entry, file.parent)]
            )
        except (ImportError, ValueError):
            elsewhere = None
        free = elsewhere is None and name not in sys.builtin_module_names
    if free and "." not in name:
        return name
    digest = hashlib.sha256(str(file).encode()).hexdigest()[:8]
    return f"uqmbd_study_{re.sub(r'[^A-Za-z0-9_]', '_', name)}_{digest}"


def _same_file(one: str | None, other: Path) -> bool:
    return one is not None and Path(one).resolve() == other


def _take_study(module: ModuleType, shown: str) -> Study:
    """Return the module's `study` after a look at what it is."""
    if not hasattr(module, "study"):
        others = [name for name, value in vars(module).items() if isinstance(value, Study)]
        hint = f" It holds a study named {others[0]!r}: rename it." if others else ""
        raise StudyError(
            f"{shown} has no module-level `study`.{hint} Expected a line such as\n"
            "    study = uqmbd.Study(name, mechanism, times, propagators=[...])\n"
            "outside of every function and of `if __name__ == ...`."
        )
    study = module.study
    if not isinstance(study, Study):
        raise StudyError(f"In {shown}, `study` is {_described(study)}; a uqmbd.Study is expected.")
    result: Study = study
    return result


def _explain(error: BaseException, file: Path, shown: str) -> str:
    """Tell where in the script an error came up, and which."""
    if isinstance(error, SyntaxError) and error.filename:
        where = shown if _same_file(error.filename, file) else error.filename
        line = (error.text or "").strip()
        return f"{where}, line {error.lineno}:\n    {line}\n{type(error).__name__}: {error.msg}"
    text = traceback.format_exception_only(error)[-1].strip()
    if isinstance(error, StudyError):
        text = str(error)
    elif isinstance(error, SystemExit):
        text = f"the script ended itself (SystemExit: {error.code}) before it could be used"
    text += _nearest(error, text) + _remedy(error)
    notes = "".join(f"\n{note}" for note in getattr(error, "__notes__", ()))
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if _same_file(frame.filename, file)]
    if not frames:
        return f"{shown} cannot be run: {text}{notes}"
    frame = frames[-1]
    inside = "" if frame.name == "<module>" else f", in {frame.name}"
    return f"{shown}, line {frame.lineno}{inside}:\n    {_statement(frame)}\n{text}{notes}"


def _nearest(error: BaseException, text: str) -> str:
    """Name what a misspelt name or attribute may mean; empty where the text does, or nothing is near."""
    name, known = getattr(error, "name", None), list[str]()
    if not isinstance(name, str) or "did you mean" in text.lower():
        return ""
    if isinstance(error, ImportError):
        return did_you_mean(*_imported(error))
    if isinstance(error, AttributeError) and error.obj is not None:
        known = dir(error.obj)
    elif isinstance(error, NameError):
        frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)][-1:]
        known = [each for frame in frames for each in (*frame.f_locals, *frame.f_globals, *dir(builtins))]
    return did_you_mean(name, [each for each in known if name.startswith("_") or not each.startswith("_")])


def _imported(error: ImportError) -> tuple[str, list[str]]:
    """Return the name that an import did not find, and those that there are in its place."""
    whole = error.name or ""
    if not isinstance(error, ModuleNotFoundError):  # a name of a module that is there
        wrong = re.match(r"cannot import name '(\w+)'", str(error))
        found = sys.modules.get(whole)
        return (wrong[1], [each for each in dir(found) if not each.startswith("_")]) if wrong and found else ("", [])
    parent, _, wrong_module = whole.rpartition(".")
    places = getattr(sys.modules.get(parent), "__path__", []) if parent else None
    known = [each.name for each in pkgutil.iter_modules(places)]
    return wrong_module, known if parent else [*known, *sys.stdlib_module_names]


def _remedy(error: BaseException) -> str:
    """Say what to write where a function of numbers was given an expression; empty for anything else."""
    import sympy

    written = (
        "\nIt was given an expression, and functions of NumPy and math compute with numbers alone: write those of "
        "SymPy, as sympy.sin(2 * uqmbd.t)."
    )
    cause = error.__cause__
    # NumPy looks for a method of the expression; math asks it for its value
    if isinstance(error, TypeError) and isinstance(cause, AttributeError) and isinstance(cause.obj, sympy.Basic):
        return written
    place = error.__traceback__
    while place is not None and place.tb_next is not None:
        place = place.tb_next
    if isinstance(error, TypeError) and place is not None and place.tb_frame.f_code is sympy.Expr.__float__.__code__:
        return written
    return ""


def _statement(frame: traceback.FrameSummary) -> str:
    """Return the source of a frame's statement; of one over many lines the first and the last."""
    first = frame.lineno or 0
    last = frame.end_lineno or first
    lines = [linecache.getline(frame.filename, number).rstrip() for number in range(first, last + 1)]
    if len(lines) > 6:
        lines = [*lines[:4], "        ...", lines[-1]]
    indent = min((len(line) - len(line.lstrip()) for line in lines if line.strip()), default=0)
    return "\n    ".join(line[indent:] for line in lines)


def _described(value: object) -> str:
    kind = "a class" if isinstance(value, type) else f"of type {type(value).__name__}"
    text = repr(value)
    return f"{text if len(text) <= 60 else text[:57] + '...'} ({kind})"
