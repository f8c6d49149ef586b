"""View of results for figures and sections: a tree is parsed once, and its parts have names and types."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import xarray as xr

from uqmbd.errors import Finding
from uqmbd.report.stored_motion import without_named
from uqmbd.results import failed_methods, propagator_nodes, varying
from uqmbd.results.assessment import (
    Assessment,
    IntegrationShare,
    OutputReliability,
    assess,
    integration_shares,
    own_statements,
)
from uqmbd.results.chaos import surrogate_parts
from uqmbd.results.schema import output_places, stored_findings, total_realisations
from uqmbd.results.statistics import rtol_of
from uqmbd.status import Status

__all__ = ["Method", "StudyResult"]


@dataclass(frozen=True, eq=False)
class Method:
    """Result of one method."""

    label: str
    node: xr.DataTree  # data of the figures

    @cached_property
    def statistics(self) -> xr.Dataset:
        """Return mean, standard deviation and other statistics of each output."""
        return self.node.children["statistics"].to_dataset()

    @cached_property
    def samples(self) -> xr.Dataset | None:
        """Return inputs, status and response of each stored sample."""
        return dataset_of(self.node, "samples")

    @cached_property
    def surrogate_data(self) -> xr.Dataset:
        """Return the data of the surrogate; if there are several kinds, return the kind with the most terms."""
        datasets = [data.to_dataset() for _, data in surrogate_parts(self.node).values()]
        return max(datasets, key=lambda data: int(data.sizes["term"]))

    @cached_property
    def scalars(self) -> Method | None:
        """Return the scalar outputs, as a separate result."""
        inner = self.node.children.get("scalars")
        return None if inner is None else Method(self.label, inner)

    @property
    def realisations(self) -> int:
        """Return the number of realisations for outputs over time, or for scalar outputs if there are no others."""
        return int(self.node.attrs.get("realisations", 0))

    @property
    def total_realisations(self) -> int:
        """Return the number of computed realisations, including those for scalar outputs or requirements only."""
        return total_realisations(self.node)

    @property
    def counted(self) -> int:
        """Return the number of realisations in the statistics."""
        return int(self.node.attrs.get("statistics_samples", self.realisations))

    @property
    def sample_size(self) -> int:
        """Return the number of samples, without realisations for other estimates such as Sobol' indices."""
        return int(self.node.attrs.get("sample_size", self.realisations))

    @property
    def failures(self) -> int:
        """Return the number of failed realisations."""
        return int(self.node.attrs.get("failures", 0))

    @property
    def wall_time(self) -> float:
        """Return the wall time, s."""
        return float(self.node.attrs.get("wall_time", math.nan))

    @property
    def population(self) -> str:
        """Return the source of the input distributions; empty if the source is the study."""
        return str(self.node.attrs.get("population", ""))

    @property
    def separate(self) -> bool:
        """Return whether realisations are computed separately, so that the cost per realisation is meaningful."""
        return self.realisations > 0 and "unknowns" not in self.node.attrs

    @property
    def fit(self) -> str:
        """Describe the method of the surrogate fit; empty for the default fit."""
        return str(self.node.attrs.get("fit", ""))

    @property
    def clock(self) -> str:
        """Describe the clock that defines equal phases, its range and its cost; empty without a clock."""
        known = self.node.attrs
        if "clock" not in known:
            return ""
        name = f"{str(known['clock'])!r}"
        kinds = {
            "angle": f"the angle {name}",
            "oscillation": f"the oscillation of {name}",
            "angle, oscillation": f"the angle {name}, or of its oscillation in realisations without full turns",
        }
        text = f"realisations are compared at equal phases of {kinds.get(str(known.get('clock_kind')), name)}"
        least, most = np.ravel(known.get("clock_turns", (math.nan, math.nan))).tolist()
        if math.isfinite(most) and most:
            text += f", with {least:.3g} to {most:.3g} turns until the last output time"
        if (longer := float(known.get("longer", 1.0))) > 1:
            text += f"; they were integrated for {longer:.3g} times the duration of the study"
        if stopped := float(known.get("standing", 0.0)):
            text += (
                f"; in about {stopped:.1%} of the realisations the clock stops, and these are compared at equal times"
            )
        return text

    @property
    def ends_at(self) -> float | None:
        """Return the last time of the results, s; None if this is the end of the study."""
        return None if "ends_at" not in self.node.attrs else float(self.node.attrs["ends_at"])

    @property
    def lacking(self) -> tuple[int, int] | None:
        """Return the number of realisations that lack a scalar output, and the total; None if all are complete."""
        inner = self.scalars
        return (inner.failures, inner.realisations) if inner is not None and inner.failures else None

    @cached_property
    def names(self) -> list[str]:
        """Return the names of the outputs."""
        return [str(name) for name in self.statistics["output"].values]

    @cached_property
    def places(self) -> dict[str, int]:
        """Return the index of each output by its name."""
        return {name: k for k, name in enumerate(self.names)}

    @property
    def histories(self) -> list[str]:
        """Return the names of the outputs over time."""
        return self.names if "time" in self.statistics.sizes else []

    @property
    def sampled(self) -> bool:
        """Return whether the method stored successful samples."""
        return self.samples is not None and bool(np.any(self.samples["status"] == Status.OK))

    @cached_property
    def statements(self) -> dict[str, str]:
        """Return the stated errors of each output, independent of other methods."""
        return dict(zip(self.names, own_statements(self.node), strict=True))

    def of(self, name: str) -> xr.Dataset:
        """Return the statistics of an output."""
        return self.statistics.isel(output=self.places[name])

    def units(self, name: str) -> str:
        """Return the units of an output."""
        return str(self.of(name)["output_units"].item())

    def varies(self, name: str) -> bool:
        """Return whether an output varies by more than the integration error."""
        return self._varying[self.places[name]]

    @cached_property
    def _varying(self) -> list[bool]:
        """Return whether each output varies; the result is cached, because it compares all outputs of equal units."""
        return [bool(one) for one in varying(self.statistics, rtol_of(self.node))]

    @cached_property
    def integration_shares(self) -> dict[str, IntegrationShare]:
        """Return the error of the time integration by output; empty if the results do not state it."""
        return {one.output: one for one in integration_shares(self.statistics)}

    def pairs(self, attribute: str) -> list[tuple[str, str]]:
        """Return the names and texts of an attribute that is a JSON object."""
        return pairs_of(self.node.attrs.get(attribute))


@dataclass(frozen=True, eq=False)
class StudyResult:
    """Result of a study."""

    tree: xr.DataTree
    methods: dict[str, Method]  # methods by label; times without any result are omitted

    @classmethod
    def of(cls, tree: xr.DataTree) -> StudyResult:
        """Parse a tree."""
        nodes = _drop_unknown_times(propagator_nodes(tree))
        return cls(tree, {label: Method(label, node) for label, node in nodes.items()})

    @property
    def nodes(self) -> dict[str, xr.DataTree]:
        """Return the nodes for figures of several methods."""
        return {label: method.node for label, method in self.methods.items()}

    @property
    def several(self) -> bool:
        """Return whether there is more than one method."""
        return len(self.methods) > 1

    @property
    def study(self) -> str:
        """Return the name of the study."""
        return str(self.tree.attrs.get("study", "study"))

    @property
    def mechanism(self) -> str:
        """Return the name of the mechanism."""
        return str(self.tree.attrs.get("mechanism", ""))

    @property
    def report_times(self) -> list[float] | None:
        """Return the times in s of distributions that the study requests; None: the figure chooses."""
        times = self.tree.attrs.get("report_times")
        return None if times is None else [float(t) for t in np.atleast_1d(times)]

    @property
    def over(self) -> dict[str, str]:
        """Return the other output over which an output is drawn, by the name of the output."""
        return dict(pairs_of(self.tree.attrs.get("over")))

    @cached_property
    def limits(self) -> list[dict[str, object]]:
        """Return requirements that limit outputs: ``requirement``, ``output``, ``limit`` and ``end``.

        ``end`` is ``highest`` or ``lowest`` for the largest or smallest allowed value, or empty if unknown.
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
        """Return the assessment of the whole tree: agreement, stated errors, reliability, recommendation."""
        return assess(self.tree)

    @cached_property
    def comparison(self) -> xr.Dataset | None:
        """Return differences and verdicts of two or more methods."""
        found = dataset_of(self.tree, "comparison")
        return None if found is None or found.sizes.get("method", 0) < 2 else found

    @cached_property
    def convergence(self) -> xr.Dataset | None:
        """Return the errors of methods at several levels."""
        return dataset_of(self.tree, "convergence")

    @cached_property
    def stored_motion(self) -> xr.Dataset | None:
        """Return the stored motion: at the means, in named realisations, and in other realisations."""
        return dataset_of(self.tree, "motion")

    @cached_property
    def motion(self) -> xr.Dataset | None:
        """Return the data of the animation: the motion at the means, and realisations, without named realisations."""
        data = self.stored_motion
        return None if data is None else without_named(data)

    @cached_property
    def histories(self) -> list[str]:
        """Return the names of all outputs over time, in the order of the study."""
        return list(dict.fromkeys(name for method in self.methods.values() for name in method.histories))

    @cached_property
    def scalars(self) -> dict[str, Method]:
        """Return the results of scalar outputs, by method."""
        return {label: m.scalars for label, m in self.methods.items() if m.scalars is not None}

    @cached_property
    def scalar_names(self) -> list[str]:
        """Return the names of all scalar outputs, in the order of the study."""
        return list(dict.fromkeys(name for method in self.scalars.values() for name in method.names))

    @cached_property
    def series(self) -> dict[str, str]:
        """Return the name of the series of each scalar output that belongs to one."""
        return {
            str(name): place.series
            for method in self.scalars.values()
            for name, place in zip(method.names, output_places(method.statistics), strict=True)
            if place
        }

    @cached_property
    def single_scalars(self) -> list[str]:
        """Return the names of the scalar outputs outside series; of all scalar outputs if there are no others."""
        return [name for name in self.scalar_names if name not in self.series] or self.scalar_names

    def distinct(self, reliability: Sequence[OutputReliability]) -> tuple[OutputReliability, ...]:
        """Reduce reliability to one output of each series and method, the least reliable one; the order remains."""
        seen: set[tuple[str, str]] = set()
        found = []
        for one in reliability:
            key = one.method, self.series.get(one.quantity, "")
            if one.kind != "scalar" or not key[1] or key not in seen:
                found.append(one)
            seen.add(key)
        return tuple(found)

    def alike(self, label: str) -> StudyResult:
        """Return the result of the methods with the same input distributions as a given method."""
        population = self.methods[label].population
        return replace(self, methods={k: m for k, m in self.methods.items() if m.population == population})

    def holders(self, name: str) -> dict[str, Method]:
        """Return the methods that have this output over time."""
        return {k: method for k, method in self.methods.items() if name in method.places and method.histories}

    @property
    def problems(self) -> list[str]:
        """Return sentences on methods without results, with the reasons, and on a failed comparison."""
        sentences = [f"{label} has no results: {reason}" for label, reason in failed_methods(self.tree).items()]
        problem = self.tree.children["comparison"].attrs.get("problem") if "comparison" in self.tree.children else None
        return sentences + ([f"The methods could not be compared: {problem}"] if problem else [])

    @property
    def findings(self) -> list[Finding]:
        """Return the findings of the study, then further findings of each method."""
        found = stored_findings(self.tree)
        known = {one.text for one in found}
        for label, method in self.methods.items():
            for part in method.node.subtree:
                mine = [one for one in stored_findings(part) if one.text not in known]
                found += [replace(one, place=label, message=f"{label}: {one.message}") for one in mine]
                known.update(one.text for one in mine)
        return found


def dataset_of(node: xr.DataTree, child: str) -> xr.Dataset | None:
    """Return the data of a child; None if the child is missing."""
    return node.children[child].to_dataset() if child in node.children else None


def pairs_of(text: object) -> list[tuple[str, str]]:
    """Return the names and texts of a JSON object; empty for other JSON values."""
    try:
        content = json.loads(text) if isinstance(text, str) else {}
    except ValueError:
        return [("", str(text))]
    if not isinstance(content, dict):
        return [("", str(text))]
    return [(str(k), _written(v)) for k, v in content.items()]


def _written(value: object) -> str:
    """Return a JSON value as text; a truth value becomes the text of the option."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def _drop_unknown_times(nodes: Mapping[str, xr.DataTree]) -> dict[str, xr.DataTree]:
    """Remove times at which no method has results, because all methods end earlier."""
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
