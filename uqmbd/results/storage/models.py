"""Look up surrogate model classes of plugins by the names that results store; no file content is executed."""

from __future__ import annotations

import warnings

import xarray as xr

from uqmbd.errors import StudyError, StudyWarning
from uqmbd.plugins import owner, surrogates

__all__ = ["absent_model", "made_model", "model_class", "source_of_model", "warn_of_absent_models"]

_made: dict[str, list[type]] = {}
"""Model classes that this process defined, such as classes of a script, by name; the newest class is last."""


def made_model(name: str, kind: type) -> None:
    """Register the class of a model of this process by its name, for the evaluation of stored surrogates.

    Raises StudyError if a plugin registers another class by this name; warns with StudyWarning if the code of an
    earlier class of this name differs.
    """
    registered, known = surrogates().get(name, kind), _made.setdefault(name, [])
    if registered is not kind:
        raise StudyError(
            f"CustomSurrogate: the name of {kind.__qualname__} is {name!r}, which "
            f"{owner('surrogates', name)} registers for another class, so uqmbd would evaluate a "
            "stored surrogate with that class. Use another name."
        )
    if kind in known:
        return
    from uqmbd.dynamics import compute_code_key  # local import: reading results needs no equations of motion

    known.append(kind)
    earlier = known[-2] if len(known) > 1 else kind
    if earlier is not kind and compute_code_key(earlier) != compute_code_key(kind):
        warnings.warn(
            f"CustomSurrogate: the class {kind.__qualname__} of {kind.__module__} replaces another class with the "
            f"name {name!r}, {earlier.__qualname__} of {earlier.__module__}. The new class evaluates stored "
            "surrogates with this name. If both classes are needed, use another name.",
            StudyWarning,
            stacklevel=4,
        )


def source_of_model(name: str, kind: type) -> str:
    """Return the package that registers a model class, or its module; results store this name for error messages."""
    return owner("surrogates", name) if surrogates().get(name) is kind else f"module {kind.__module__}"


def model_class(data: xr.Dataset | xr.DataTree) -> type:
    """Return the model class that a dataset names."""
    name, source = str(data.attrs.get("model", "")), str(data.attrs.get("model_source", ""))
    found = surrogates().get(name, next(reversed(_made.get(name, ())), None))
    if found is None:
        origin = f"a model {name!r} of {source}" if source else f"a model {name!r}"
        raise StudyError(
            f"The surrogate is {origin}, which no installed plugin registers. Its data are loaded, but it cannot be "
            "evaluated. Install the package that registers it with the hook uqmbd_surrogates."
        )
    return found


def absent_model(data: xr.Dataset | xr.DataTree) -> str:
    """Return why a stored surrogate cannot be evaluated on this computer, or an empty text."""
    try:
        model_class(data)
    except StudyError as error:
        return str(error)
    return ""


def warn_of_absent_models(tree: xr.DataTree, source: str) -> None:
    """Warn once for each model that no installed plugin registers."""
    stored = [part for part in tree.subtree if part.name == "surrogate" and "model" in part.attrs]
    for why in dict.fromkeys(absent_model(part) for part in stored):
        if why:
            warnings.warn(f"{source}: {why}", StudyWarning, stacklevel=5)
