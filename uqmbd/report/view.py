"""Results as figures and sections read them: a tree is parsed once, and its parts have names and types."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import xarray as xr

from uqmbd.errors import Finding, Severity
from uqmbd.results import failed_methods, propagator_nodes, varying
from uqmbd.results.assessment import Assessment, IntegrationShare, assess, integration_shares, own_statements
from uqmbd.results.chaos import surrogate_parts
from uqmbd.results.statistics import rtol_of
from uqmbd.status import Status

__all__ = ["Method", "StudyResult"]


@dataclass(frozen=True, eq=False)
class Method:
    """The result of one method."""

    label: str
    node: xr.DataTree  # what figures are drawn from

    @cached_property
    def statistics(self) -> xr.Dataset:
        """Mean, standard deviation and what else is known of each output."""
        return self.node.children["statistics"].to_dataset()

    @cached_property
    def samples(self) -> xr.Dataset | None:
        """Inputs, status and response of each sample that it kept."""
        return dataset_of(self.node, "samples")

    @cached_property
    def surrogate_data(self) -> xr.Dataset:
        """What a surrogate is stored in; where outputs have surrogates of several kinds, that with the most terms."""
        held = [data.to_dataset() for _, data in surrogate_parts(self.node).values()]
        return max(held, key=lambda data: int(data.sizes["term"]))

    @cached_property
    def scalars(self) -> Method | None:
        """Outputs without a time, as a result of their own."""
        inner = self.node.children.get("scalars")
        return None if inner is None else Method(self.label, inner)

    @property
    def realisations(self) -> int:
        """How many it computed."""
        return int(self.node.attrs.get("realisations", 0))

    @property
    def counted(self) -> int:
        """Of how many of these its statistics are."""
        return int(self.node.attrs.get("statistics_samples", self.realisations))

    @property
    def failures(self) -> int:
        """How many of these failed."""
        return int(self.node.attrs.get("failures", 0))

    @property
    def wall_time(self) -> float:
        """Seconds."""
        return float(self.node.attrs.get("wall_time", math.nan))

    @property
    def population(self) -> str:
        """Where the distributions of its inputs come from; empty: from the study."""
        return str(self.node.attrs.get("population", ""))

    @property
    def separate(self) -> bool:
        """Whether it computed realisations one by one, so that each has a cost; others solve all at once."""
        return self.realisations > 0 and "unknowns" not in self.node.attrs

    @property
    def fit(self) -> str:
        """How its surrogate was found; empty if in the usual way."""
        return str(self.node.attrs.get("fit", ""))

    @property
    def clock(self) -> str:
        """Of which clock realisations were compared at equal phase, how far it runs, and what that cost; or empty."""
        known = self.node.attrs
        if "clock" not in known:
            return ""
        name = f"{str(known['clock'])!r}"
        kinds = {
            "angle": f"the angle {name}",
            "oscillation": f"the oscillation of {name}",
            "angle, oscillation": f"the angle {name}, or of its oscillation in realisations without full turns",
        }
        said = f"realisations are compared at equal phases of {kinds.get(str(known.get('clock_kind')), name)}"
        least, most = np.ravel(known.get("clock_turns", (math.nan, math.nan))).tolist()
        if math.isfinite(most) and most:
            said += f", with {least:.3g} to {most:.3g} turns until the last output time"
        if (longer := float(known.get("longer", 1.0))) > 1:
            said += f"; they were integrated for {longer:.3g} times the duration of the study"
        if standing := float(known.get("standing", 0.0)):
            said += f"; in about {standing:.1%} of them it stands still, and they are compared at equal times"
        return said

    @property
    def ends_at(self) -> float | None:
        """Time at which its results end, before that of the study."""
        return None if "ends_at" not in self.node.attrs else float(self.node.attrs["ends_at"])

    @property
    def lacking(self) -> tuple[int, int] | None:
        """Realisations that have not all of the outputs without a time, and all; None if each has."""
        inner = self.scalars
        return (inner.failures, inner.realisations) if inner is not None and inner.failures else None

    @cached_property
    def names(self) -> list[str]:
        """Names of its outputs."""
        return [str(name) for name in self.statistics["output"].values]

    @property
    def histories(self) -> list[str]:
        """Names of its outputs over time."""
        return self.names if "time" in self.statistics.sizes else []

    @property
    def sampled(self) -> bool:
        """Whether it kept samples that succeeded."""
        return self.samples is not None and bool(np.any(self.samples["status"] == Status.OK))

    @cached_property
    def statements(self) -> dict[str, str]:
        """What it states of its own error at each output, whatever others say."""
        return dict(zip(self.names, own_statements(self.node), strict=True))

    def of(self, name: str) -> xr.Dataset:
        """Return the statistics of an output."""
        return self.statistics.isel(output=self.names.index(name))

    def units(self, name: str) -> str:
        """Return the units of an output."""
        return str(self.of(name)["output_units"].item())

    def varies(self, name: str) -> bool:
        """Return whether an output varies beyond the integration error."""
        return self._varying[self.names.index(name)]

    @cached_property
    def _varying(self) -> list[bool]:
        """Whether each output varies: found once, since it compares all outputs in the same units."""
        return [bool(one) for one in varying(self.statistics, rtol_of(self.node))]

    @cached_property
    def integration_shares(self) -> dict[str, IntegrationShare]:
        """The error of the time integration by output; empty where the results do not state it."""
        return {one.output: one for one in integration_shares(self.statistics)}

    def pairs(self, attribute: str) -> list[tuple[str, str]]:
        """Return the names and texts of an attribute that is a JSON object."""
        return pairs_of(self.node.attrs.get(attribute))


@dataclass(frozen=True, eq=False)
class StudyResult:
    """The result of a study."""

    tree: xr.DataTree
    methods: dict[str, Method]  # by label; times at which none of them has a result are left out

    @classmethod
    def of(cls, tree: xr.DataTree) -> StudyResult:
        """Parse a tree."""
        nodes = _drop_unknown_times(propagator_nodes(tree))
        return cls(tree, {label: Method(label, node) for label, node in nodes.items()})

    @property
    def nodes(self) -> dict[str, xr.DataTree]:
        """What figures of several methods are drawn from."""
        return {label: method.node for label, method in self.methods.items()}

    @property
    def several(self) -> bool:
        """Whether there is more than one method."""
        return len(self.methods) > 1

    @property
    def study(self) -> str:
        """Its name."""
        return str(self.tree.attrs.get("study", "study"))

    @property
    def mechanism(self) -> str:
        """Name of its mechanism."""
        return str(self.tree.attrs.get("mechanism", ""))

    @property
    def report_times(self) -> list[float] | None:
        """Times at which the study wants distributions to be shown; None: the figure chooses."""
        wanted = self.tree.attrs.get("report_times")
        return None if wanted is None else [float(t) for t in np.atleast_1d(wanted)]

    @property
    def over(self) -> dict[str, str]:
        """Outputs that are drawn over other ones, and over which."""
        return dict(pairs_of(self.tree.attrs.get("over")))

    @cached_property
    def limits(self) -> list[dict[str, object]]:
        """Requirements that are limits of outputs: ``requirement``, ``output``, ``limit``, and which ``end`` it is.

        It is the ``highest`` or ``lowest`` value that is allowed; empty, where results do not tell.
        """
        try:
            found = json.loads(self.tree.attrs.get("limits", "[]"))
            return [
                {k: one[k] for k in ("requirement", "output")}
                | {"limit": float(one["limit"]), "end": str(one.get("end", ""))}
                for one in found
            ]
        except (ValueError, TypeError, KeyError):
            return []

    def limits_of(self, name: str) -> dict[str, float]:
        """Return the limits of an output, by requirement."""
        return {str(one["requirement"]): float(str(one["limit"])) for one in self.limits if one["output"] == name}

    @cached_property
    def assessment(self) -> Assessment:
        """Agreement of methods, stated errors, reliability of outputs, and the recommendation: of the whole tree."""
        return assess(self.tree)

    @cached_property
    def comparison(self) -> xr.Dataset | None:
        """Differences and verdicts of two methods or more."""
        found = dataset_of(self.tree, "comparison")
        return None if found is None or found.sizes.get("method", 0) < 2 else found

    @cached_property
    def convergence(self) -> xr.Dataset | None:
        """Errors of methods at several levels."""
        return dataset_of(self.tree, "convergence")

    @cached_property
    def motion(self) -> xr.Dataset | None:
        """What the animation is made of: the means and realisations around them, without the named ones."""
        data = dataset_of(self.tree, "motion")
        return None if data is None else _without_named(data)

    @cached_property
    def histories(self) -> list[str]:
        """Names of all outputs over time, in the order of the study."""
        return list(dict.fromkeys(name for method in self.methods.values() for name in method.histories))

    @cached_property
    def scalars(self) -> dict[str, Method]:
        """Methods that have outputs without a time, as results of these."""
        return {label: m.scalars for label, m in self.methods.items() if m.scalars is not None}

    @cached_property
    def scalar_names(self) -> list[str]:
        """Names of all outputs without a time, in the order of the study."""
        return list(dict.fromkeys(name for method in self.scalars.values() for name in method.names))

    def alike(self, label: str) -> StudyResult:
        """Return the result of the methods whose inputs are distributed as those of a method."""
        wanted = self.methods[label].population
        return replace(self, methods={k: m for k, m in self.methods.items() if m.population == wanted})

    def holders(self, name: str) -> dict[str, Method]:
        """Return the methods that have this output over time."""
        return {label: method for label, method in self.methods.items() if name in method.histories}

    @property
    def problems(self) -> list[str]:
        """Which methods gave no results, and why, and what else could not be computed."""
        said = [f"{label} has no results: {reason}" for label, reason in failed_methods(self.tree).items()]
        problem = self.tree.children["comparison"].attrs.get("problem") if "comparison" in self.tree.children else None
        return said + ([f"The methods could not be compared: {problem}"] if problem else [])

    @property
    def findings(self) -> list[Finding]:
        """Probable mistakes in the study, each once: of the study, then of each method, with its label."""
        found = _findings_of(self.tree)
        known = {one.text for one in found}
        for label, method in self.methods.items():
            for part in method.node.subtree:
                mine = [one for one in _findings_of(part) if one.text not in known]
                found += [replace(one, place=label, message=f"{label}: {one.message}") for one in mine]
                known.update(one.text for one in mine)
        return found


def _without_named(data: xr.Dataset) -> xr.Dataset:
    """Return poses without the realisations of the attribute ``named``, which are no samples of the inputs."""
    try:
        rows = {int(one["realisation"]) for one in json.loads(str(data.attrs.get("named", "[]")))}
    except (KeyError, TypeError, ValueError):  # the node may come from anywhere
        return data
    if not rows or "realisation" not in data.dims:
        return data
    found = data.isel(realisation=[k for k in range(data.sizes["realisation"]) if k not in rows])
    found.attrs = {name: value for name, value in data.attrs.items() if name != "named"}
    return found


def dataset_of(node: xr.DataTree, child: str) -> xr.Dataset | None:
    """Return the data of a child; None if there is no such child."""
    return node.children[child].to_dataset() if child in node.children else None


def pairs_of(text: object) -> list[tuple[str, str]]:
    """Return the names and texts of a JSON object; what is none has no name."""
    try:
        content = json.loads(text) if isinstance(text, str) else {}
    except ValueError:
        return [("", str(text))]
    if not isinstance(content, dict):
        return [("", str(text))]
    return [(str(k), _written(v)) for k, v in content.items()]


def _written(value: object) -> str:
    """Write what JSON holds; a truth value as options have it that are a choice."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def _drop_unknown_times(nodes: Mapping[str, xr.DataTree]) -> dict[str, xr.DataTree]:
    """Leave out times at which no method has a result: where all end early."""
    ends = [node.attrs.get("ends_at") for node in nodes.values()]
    if not ends or any(end is None for end in ends):
        return dict(nodes)
    last = max(float(end) for end in ends if end is not None)

    def cut(data: xr.Dataset) -> xr.Dataset:
        return data.sel(time=slice(None, last)) if "time" in data.dims else data

    found = {label: node.map_over_datasets(cut) for label, node in nodes.items()}
    for label, node in found.items():
        node.attrs.setdefault("rtol", rtol_of(nodes[label]))
    return found


def _findings_of(node: xr.DataTree) -> list[Finding]:
    """Read the findings that a node stores; earlier versions, and methods, store texts of warnings."""
    for name in ("findings", "warnings"):
        try:
            stored = json.loads(node.attrs[name])
            if name == "findings":
                return [Finding(Severity(one.pop("severity")), **one) for one in stored]
            return [Finding(Severity.WARNING, "", str(said)) for said in stored] if isinstance(stored, list) else []
        except (AttributeError, KeyError, TypeError, ValueError):  # there are none, or somebody else wrote them
            continue
    return []
