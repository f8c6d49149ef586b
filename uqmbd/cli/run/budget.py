"""`--budget` and `--accuracy`: values, conflicts with other options, and the outcome."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from uqmbd.errors import StudyError
from uqmbd.propagation import accuracy_of, budget_of

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.propagation import Study

__all__ = ["check_sizes", "choices", "missed", "too_small_for"]


def choices(budget: str | None, accuracy: str | None) -> dict[str, Any]:
    """Return the arguments of `Study.run` after a check; empty without a request.

    >>> choices(None, None)
    {}
    """
    if budget is None and accuracy is None:
        return {}
    budget_of(budget, "--budget")
    accuracy_of(accuracy, "--accuracy")
    return {"budget": budget, "accuracy": accuracy, "planned": _print_sentence}


def check_sizes(settings: Sequence[str], study: Study, chosen: dict[str, Any], only: Sequence[str]) -> None:
    """Raise an error if a setting concerns an option that a budget or an accuracy chooses."""
    if not chosen:
        return
    known = {p.node_name: p for p in study.propagators if not only or p.node_name in only}
    requested = " and ".join(f"--{name}" for name in ("budget", "accuracy") if chosen[name] is not None)
    for setting in settings:
        label, _, option = setting.partition("=")[0].strip().rpartition(".")
        sizing = known[label].sizing(study, accuracy_of(chosen["accuracy"])) if label in known else None
        if sizing is not None and option in (sizing.option, *sizing.also):
            raise StudyError(
                f"--set {setting} contradicts {requested}, which chooses {option} of {label}; omit one of them."
            )


def missed(tree: xr.DataTree) -> list[str]:
    """Return sentences on the methods that do not reach the requested accuracy."""
    methods = json.loads(tree.attrs.get("budget", "{}")).get("methods", {})
    reached = " and ".join(label for label, about in methods.items() if about.get("met"))
    also = f". The requested accuracy is reached by {reached}" if reached else ""
    return [
        f"accuracy of {label}: {about['summary']}{also}"
        for label, about in methods.items()
        if about.get("met") is False
    ]


def too_small_for(tree: xr.DataTree) -> list[str]:
    """Return the labels of methods whose smallest size exceeds the budget."""
    return list(json.loads(tree.attrs.get("budget", "{}")).get("too_small_for", []))


def _print_sentence(sentence: str) -> None:
    print(sentence, file=sys.stderr, flush=True)
