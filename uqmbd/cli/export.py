"""`uqmbd export`: write the surrogate or the mechanism of a study as a file of another program."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uqmbd import plugins
from uqmbd.cli.run import parse_value, type_name
from uqmbd.errors import StudyError, UqmbdError
from uqmbd.garbage_collection import loading
from uqmbd.names import did_you_mean
from uqmbd.plugins import InputTreatment, such_as
from uqmbd.propagation import load_study, option_types

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.propagation import Study

__all__ = ["export_study"]


def export_study(
    script: Path,
    *,
    to: Path,
    what: str | None,
    method: str | None,
    results: Path | None,
    words: Sequence[str],
    progress: Any = None,
) -> None:
    """Write a file by the exporter of its ending.

    `script` is the study script, `to` the file. `what` is "surrogate" or "mechanism"; the default is the first one that
    the exporter supports. `method` is the label of the method with the surrogate. `results` is the folder of an earlier
    run; by default, the method runs. `words` are the options of the exporter.
    """
    kind = _exporter(to)
    exporter = _made(kind, words)
    chosen = kind.exports[0] if what is None else what
    if chosen not in kind.exports:
        raise StudyError(f"--what {what}: the exporter {kind.name!r} exports {' or '.join(kind.exports)} only.")
    if chosen != "surrogate" and (method is not None or results is not None):
        name = "--method" if method is not None else "--from"
        raise StudyError(f"{name} selects a surrogate, but --what is {chosen!r}; omit {name}.")
    if not to.parent.is_dir():
        raise StudyError(f"--to {to}: the folder {to.parent} does not exist; create it first.")
    with loading():
        study = load_study(script)
    if why := exporter.refusal(chosen, study):
        raise StudyError(f"{script}: the {chosen} cannot be exported to {kind.suffix}: {why}")
    source: Any = study.mechanism
    if chosen == "surrogate":
        source = _computed(study, method, progress) if results is None else _stored(study, method, results)
    try:
        print(exporter.export(source, to, study))
    except OSError as error:
        raise StudyError(f"{error.filename or to} cannot be written: {error.strerror or error}.") from error


def _exporter(to: Path) -> Any:
    """Return the class of the exporter for a file."""
    known: dict[str, Any] = {cls.suffix: cls for cls in reversed(list[Any](plugins.exporters().values()))}
    matching = [suffix for suffix in known if to.name.endswith(suffix) and to.name != suffix]
    if not matching:
        offered = ", ".join(f"{suffix} ({cls.name})" for suffix, cls in sorted(known.items())) or "none"
        raise StudyError(
            f"--to {to}: no exporter writes files with this ending. Endings of the installed exporters: {offered}. "
            f"{plugins.unusable()}".rstrip()
        )
    return known[max(matching, key=len)]


def _made(kind: Any, words: Sequence[str]) -> Any:
    """Return the exporter with options from the command line."""
    types = option_types(kind)
    fields = {field.name.replace("_", "-"): field for field in dataclasses.fields(kind) if field.init}
    options: dict[str, Any] = {}
    rest = list(words)
    while rest:
        word, equals, text = rest.pop(0).partition("=")
        field = fields.get(word.removeprefix("--")) if word.startswith("--") else None
        if field is None:
            listed = "; ".join(f"--{name}: {type_name(types.get(f.name, Any))}" for name, f in fields.items())
            meant = did_you_mean(word.removeprefix("--"), fields) or "."
            raise StudyError(
                f"{word}: the exporter {kind.name!r} has no such option{meant} Its options: {listed or 'none'}."
            )
        annotation = types.get(field.name, Any)
        if annotation is bool and not equals:
            options[field.name] = True
            continue
        if not equals:
            if not rest:
                raise StudyError(f"{word} has no value; expected {type_name(annotation)}.")
            text = rest.pop(0)
        try:
            options[field.name] = parse_value(text, annotation)
        except ValueError as error:
            raise StudyError(f"{word} {text}: expected {type_name(annotation)}.") from error
    try:
        return kind(**options)
    except UqmbdError:
        raise
    except (TypeError, ValueError) as error:
        raise StudyError(f"{' '.join(words)}: {error}") from error


def _computed(study: Study, method: str | None, progress: Any) -> xr.DataTree:
    """Run the method with the surrogate."""
    known = {propagator.node_name: propagator for propagator in study.propagators}
    if method is None and len(known) != 1:
        raise StudyError(
            f"study {study.name!r} has {len(known)} methods; select the method with the surrogate by --method LABEL"
            + (f". Its labels: {', '.join(known)}." if known else ".")
        )
    label = next(iter(known)) if method is None else method
    if label not in known:
        raise StudyError(
            f"--method {label}: the study has no such method{did_you_mean(label, known) or '.'} Its labels: "
            f"{', '.join(known)}."
        )
    return study.propagate(known[label], progress=progress)


def _stored(study: Study, method: str | None, folder: Path) -> xr.DataTree:
    """Return the results of the method with the surrogate, from the folder of a run."""
    from uqmbd.results import load, methods, surrogate

    source = folder if folder.is_file() else folder / "results.nc"
    if not source.exists():
        raise StudyError(f"--from {folder}: {source} does not exist; expected the folder of a run.")
    tree = load(source)
    if tree.attrs.get("study") != study.name:
        raise StudyError(
            f"--from {folder}: the results belong to study {tree.attrs.get('study')!r}, not {study.name!r}."
        )
    found = methods(tree)
    if method is not None and method not in found:
        raise StudyError(
            f"--method {method}: the results have no such method{did_you_mean(method, found) or '.'} Its labels: "
            f"{', '.join(found)}."
        )
    for label, node in found.items():
        if method is not None and label != method:
            continue
        try:
            surrogate(node)
        except StudyError:
            if method is not None:
                raise
            continue
        return node
    raise StudyError(
        f"--from {folder}: no method of these results has a surrogate. Add a method that computes one"
        f"{such_as(InputTreatment.INTERPOLATE)}."
    )
