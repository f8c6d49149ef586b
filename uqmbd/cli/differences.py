"""What differs between stored results besides their numbers: studies, inputs, options, versions."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import xarray as xr

__all__ = ["what_differs"]

_PASSED_OVER = frozenset({"created", "command", "parts", "failed"})


def what_differs(trees: Mapping[str, xr.DataTree]) -> list[tuple[str, dict[str, str]]]:
    """Return what differs between results: a name, and what each of them says.

    Parameters
    ----------
    trees : mapping of str to xarray.DataTree
        Results of studies, by letter.
    """
    facts = {letter: _facts(tree) for letter, tree in trees.items()}
    # results of earlier versions do not say what their mechanisms consist of
    if all("parts" in tree.attrs for tree in trees.values()):
        facts = {letter: {**_parts(trees[letter]), **own} for letter, own in facts.items()}
    names = list(dict.fromkeys(name for one in facts.values() for name in one))
    found = []
    for name in names:
        given = {letter: one.get(name, "–") for letter, one in facts.items()}
        # an option of a method that is not in a result at all is no difference of its own
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
    """Bodies and components of the mechanism, each a fact of its own."""
    parts = _pairs(tree.attrs["parts"])
    facts = {f"body {name}": "yes" for name in parts.get("bodies", ())}
    return {**facts, **{f"component {name}": str(kind) for name, kind in parts.get("components", {}).items()}}


def _inputs(node: xr.DataTree) -> dict[str, str]:
    for child in ("samples", "statistics", "chaos"):
        data: Any = node.children[child].to_dataset() if child in node.children else xr.Dataset()
        if "input_description" in data.coords:
            columns = (data[name].values for name in ("input", "input_description", "input_units"))
            return {
                f"input {n}": f"{text or 'not stated'} {units}".strip() for n, text, units in zip(*columns, strict=True)
            }
    return {}


def _pairs(text: object) -> dict[str, Any]:
    try:
        content = json.loads(text) if isinstance(text, str) else {}
    except ValueError:
        return {}
    return content if isinstance(content, dict) else {}
