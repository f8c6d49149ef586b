"""Differences between stored results in studies, inputs, options and versions."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import xarray as xr

from uqmbd.wording import typeset_units

__all__ = ["find_differences"]

INPUT = "input "
"""Prefix of the names of facts about inputs."""

_PASSED_OVER = frozenset(
    {"created", "command", "parts", "model", "limits", "failed", "script", "script_sha256", "allowed_probability"}
)


def find_differences(trees: Mapping[str, xr.DataTree]) -> list[tuple[str, dict[str, str]]]:
    """Return the differences between results, each with its name and the value in each result.

    `trees` are results of studies, by letter.
    """
    facts = {letter: _facts(tree) for letter, tree in trees.items()}
    # results of earlier versions do not list the parts of their mechanisms
    if all("parts" in tree.attrs for tree in trees.values()):
        facts = {letter: {**_parts(trees[letter]), **own} for letter, own in facts.items()}
    found = []
    if any(not _recorded(tree) for tree in trees.values()):
        # statistics alone do not state their inputs, so inputs may differ
        names_of = {
            letter: [n.removeprefix(INPUT) for n in one if n.startswith(INPUT)] for letter, one in facts.items()
        }
        known = {
            k: ", ".join(names_of[k]) or "none" if _recorded(tree) else "not recorded" for k, tree in trees.items()
        }
        found.append(("inputs", known))
        facts = {k: {n: x for n, x in one.items() if not n.startswith(INPUT)} for k, one in facts.items()}
    names = list(dict.fromkeys(name for one in facts.values() for name in one))
    for name in names:
        given = {letter: one.get(name, "–") for letter, one in facts.items()}
        # an option of a method that is missing in a result is no separate difference
        if len(set(given.values())) > 1 and not _of_absent(name, facts):
            found.append((name, given))
    return found


def _of_absent(name: str, facts: Mapping[str, Mapping[str, str]]) -> bool:
    method = name.split(": ")[0]
    return ": " in name and any(f"method {method}" not in one for one in facts.values())


def _facts(tree: xr.DataTree) -> dict[str, str]:
    from uqmbd.results import failed_methods, propagator_nodes

    nodes = propagator_nodes(tree)
    facts = {str(k): str(v) for k, v in tree.attrs.items() if k not in _PASSED_OVER}
    first = next(iter(nodes.values()), None)
    if first is not None:
        statistics = first.children["statistics"].to_dataset()
        facts["outputs"] = ", ".join(
            f"{n} [{u}]" for n, u in zip(statistics["output"].values, statistics["output_units"].values, strict=True)
        )
        if "time" in statistics.coords and statistics.sizes.get("time"):
            times = statistics["time"].values
            facts["times"] = f"{len(times)} from {times[0]:g} s to {times[-1]:g} s"
    for node in nodes.values():
        facts = {**_inputs(node), **facts}
    facts |= {f"method {label}": "failed" for label in failed_methods(tree)}
    for label, node in nodes.items():
        facts[f"method {label}"] = str(node.attrs.get("propagator", ""))
        if "seed" in node.attrs:
            facts[f"{label}: seed"] = str(node.attrs["seed"])
        for kind, text in (("option ", "options"), ("", "versions")):
            for name, value in _pairs(node.attrs.get(text)).items():
                facts[f"{label}: {kind}{name}" if kind else f"version of {name}"] = str(value)
    return facts


def _parts(tree: xr.DataTree) -> dict[str, str]:
    """Return the bodies, components and excitations of the mechanism as separate facts."""
    parts, model = _pairs(tree.attrs["parts"]), _pairs(tree.attrs.get("model"))
    facts = {f"body {name}": "yes" for name in parts.get("bodies", ())}
    facts |= {f"component {name}": str(kind) for name, kind in parts.get("components", {}).items()}
    return {**facts, **{f"excitation {name}": str(text) for name, text in model.get("excitations", {}).items()}}


def _recorded(tree: xr.DataTree) -> bool:
    """Return whether any method states its inputs, or states that it has no inputs."""
    from uqmbd.results import propagator_nodes

    nodes = propagator_nodes(tree).values()
    return not nodes or any(_stated(node) is not None for node in nodes)


def _stated(node: xr.DataTree) -> Any:
    """Return the dataset of a method that states its inputs."""
    kept = [node.children[child].to_dataset() for child in ("samples", "statistics", "chaos") if child in node.children]
    return next((data for data in kept if "input_description" in data.coords), None)


def _inputs(node: xr.DataTree) -> dict[str, str]:
    if (data := _stated(node)) is None:
        return {}
    columns = (data[name].values for name in ("input", "input_description", "input_units"))
    return {
        f"{INPUT}{n}": f"{text or 'not stated'} {typeset_units(units)}".strip()
        for n, text, units in zip(*columns, strict=True)
    }


def _pairs(text: object) -> dict[str, Any]:
    try:
        content = json.loads(text) if isinstance(text, str) else {}
    except ValueError:
        return {}
    return content if isinstance(content, dict) else {}
