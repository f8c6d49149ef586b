"""Run study scripts: Python files with a module-level `study`; errors refer to lines of the script."""

from __future__ import annotations

import builtins
import hashlib
import importlib
import importlib.machinery
import importlib.util
import inspect
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
from uqmbd.mechanism import Mechanism
from uqmbd.names import did_you_mean
from uqmbd.propagation.studies.study import Study

__all__ = ["load_mechanism", "load_study"]


@typechecked
def load_study(path: str | os.PathLike[str]) -> Study:
    """Run a study script and return its module-level ``study``.

    The script runs as a module with the name of the file. During this run, the folder of the script is first on
    ``sys.path``, as for a script that Python starts. Afterwards the folder is last on ``sys.path``, so that worker
    processes can import functions of the script. If a file has the name of an installed module, the script gets another
    module name. In this case, only forked worker processes can use functions and classes of the script.

    Parameters
    ----------
    path : str or Path
        Path of the script, a ``.py`` file.

    Returns
    -------
    Study
        Object with the name ``study`` in the script.

    Raises
    ------
    uqmbd.StudyError
        If the file is missing or is not a Python file, the script defines no `Study` named ``study``, or it raises an
        error. If the script raises an error, the message shows this error with its line, and the error is the cause of
        the exception.

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


def load_mechanism(path: str | os.PathLike[str]) -> tuple[Mechanism, Study | None]:
    """Run a script and return its mechanism and its study; a script without a study needs one module-level mechanism.

    Raise StudyError as `load_study`, and if the script has neither a study nor exactly one mechanism.
    """
    file = check_script(path)
    module = _run(file.resolve(), shown=str(path))
    if hasattr(module, "study"):
        study = _take_study(module, shown=str(path))
        return study.mechanism, study
    found = {id(value): value for value in vars(module).values() if isinstance(value, Mechanism)}
    if len(found) != 1:
        raise StudyError(
            f"{path} has no module-level `study`, and {len(found)} module-level mechanisms; expected a uqmbd.Study "
            "with the name study, or one uqmbd.Mechanism."
        )
    return next(iter(found.values())), None


def _run(file: Path, shown: str) -> ModuleType:
    """Run the script as a separate module, and remove the module after a failure."""
    folder = str(file.parent)
    sys.path.insert(0, folder)
    name = _module_name(file)
    previous = sys.modules.pop(name, None)
    loader = importlib.machinery.SourceFileLoader(name, str(file))
    spec = importlib.util.spec_from_file_location(name, file, loader=loader)
    assert spec is not None  # not None, because a loader is given
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    linecache.checkcache(str(file))
    try:
        # compile the text without the loader, so that a stale or unwritable __pycache__ has no effect
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
    """Return the name of the file as module name, or another name if this name is already in use."""
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
    """Return the module's `study` after a check of its type."""
    if not hasattr(module, "study"):
        others = [name for name, value in vars(module).items() if isinstance(value, Study)]
        hint = f" It contains the study {others[0]!r}; rename this variable to study." if others else ""
        raise StudyError(
            f"{shown} has no module-level `study`.{hint} Expected a line such as\n"
            "    study = uqmbd.Study(name, mechanism, times, propagators=[...])\n"
            "outside of every function and of `if __name__ == ...`."
        )
    study = module.study
    if not isinstance(study, Study):
        raise StudyError(f"In {shown}, `study` is {_described(study)}; expected a uqmbd.Study.")
    result: Study = study
    return result


def _explain(error: BaseException, file: Path, shown: str) -> str:
    """Return a message with an error and its position in the script."""
    if isinstance(error, SyntaxError) and error.filename:
        where = shown if _same_file(error.filename, file) else error.filename
        line = (error.text or "").strip()
        return f"{where}, line {error.lineno}:\n    {line}\n{type(error).__name__}: {error.msg}"
    text = traceback.format_exception_only(error)[-1].strip()
    if isinstance(error, StudyError):
        text = str(error)
    elif isinstance(error, SystemExit):
        text = f"the script exited (SystemExit: {error.code}) before uqmbd could use its study"
    text += _nearest(error, text) + _remedy(error)
    notes = "".join(f"\n{note}" for note in getattr(error, "__notes__", ()))
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if _same_file(frame.filename, file)]
    if not frames:
        return f"The script {shown} cannot run: {text}{notes}"
    frame = frames[-1]
    inside = "" if frame.name == "<module>" else f", in {frame.name}"
    return f"{shown}, line {frame.lineno}{inside}:\n    {_statement(frame)}\n{text}{notes}"


def _nearest(error: BaseException, text: str) -> str:
    """Suggest a name for a misspelt name or attribute; empty if the message has a suggestion or no name is similar."""
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
    """Return the name that an import did not find, and the available names."""
    whole = error.name or ""
    if not isinstance(error, ModuleNotFoundError):  # the module exists, but it has no such name
        wrong = re.match(r"cannot import name '(\w+)'", str(error))
        found = sys.modules.get(whole)
        return (wrong[1], [each for each in dir(found) if not each.startswith("_")]) if wrong and found else ("", [])
    parent, _, wrong_module = whole.rpartition(".")
    places = getattr(sys.modules.get(parent), "__path__", []) if parent else None
    known = [each.name for each in pkgutil.iter_modules(places)]
    return wrong_module, known if parent else [*known, *sys.stdlib_module_names]


def _remedy(error: BaseException) -> str:
    """Return advice if a numeric function received an expression; otherwise return an empty text."""
    import sympy

    written = (
        "\nThe argument is an expression, but functions of NumPy and math accept numbers only. Use functions of "
        "SymPy, e.g. sympy.sin(2 * uqmbd.t)."
    )
    cause = error.__cause__
    # NumPy calls a method of the expression; math converts the expression to a number
    if isinstance(error, TypeError) and isinstance(cause, AttributeError) and isinstance(cause.obj, sympy.Basic):
        return written
    place = error.__traceback__
    while place is not None and place.tb_next is not None:
        place = place.tb_next
    method = inspect.unwrap(sympy.Expr.__float__).__code__
    if isinstance(error, TypeError) and place is not None and place.tb_frame.f_code is method:
        return written
    return ""


def _statement(frame: traceback.FrameSummary) -> str:
    """Return the source of the statement of a frame; for a long statement, return its first and last lines."""
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
