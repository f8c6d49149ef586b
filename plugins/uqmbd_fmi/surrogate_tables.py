"""C tables of a surrogate, and the variables of its FMU."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from uqmbd import StudyError
from uqmbd.extend import GermBox, GermSpace, stored_as
from uqmbd.results import ComposedChaos, PiecewiseChaos, methods, surrogate
from uqmbd.typing import Array
from uqmbd_fmi.tables import SourceTables, number, text
from uqmbd_fmi.variables import Variable, check_names, variable_table

__all__ = ["UnitModel", "input_means", "read_surrogates", "refusal_of_space", "refusal_of_surrogate", "surrogate_model"]

MEAN_NODES = 64
"""Number of Gauss nodes for the mean of an input that is a tabulated function of its germ."""

MARGINALS = {"affine": "AFFINE", "exponential": "EXPONENTIAL", "quantile": "QUANTILE"}


@dataclass(frozen=True)
class UnitModel:
    """Generated source files of a model by name, its variables, and its output times."""

    files: dict[str, str]
    variables: tuple[Variable, ...]
    times: tuple[float, float, float] | None
    """Start, stop and step of the default experiment, s."""
    space: GermSpace
    tolerance: float | None = None


def read_surrogates(node: xr.DataTree) -> list[Any]:
    """Return the surrogates of outputs over time and of scalar outputs of a method, as far as they exist.

    Raise StudyError if there is none.
    """
    found, reasons = [], []
    for part in (node, node.children.get("scalars")):
        if part is None:
            continue
        try:
            found.append((part, surrogate(part)))
        except StudyError as error:
            reasons.append(str(error))
    if not found:
        if labels := [label for label in methods(node) if label in node.children]:
            raise StudyError(f"A tree of results was given; expected the node of a method: {', '.join(labels)}.")
        hint = "Add such a method to the study, or export the mechanism."
        raise StudyError(f"{' '.join(dict.fromkeys(reasons))} {hint}")
    return found


def refusal_of_surrogate(one: Any) -> str:
    """Return why a surrogate cannot be written in C, or an empty text."""
    parts = one.parts.values() if isinstance(one, ComposedChaos) else (one,)
    for part in parts:
        kind = stored_as(part)
        if kind not in ("chaos", "aligned", "quasi_periodic"):
            names = ", ".join(o.name for o in part.labels.outputs)
            return (
                f"the surrogate of {names} is a {type(part).__name__}, whose model is Python code of a plugin; it has "
                "no form in C. Use a method with a polynomial chaos, such as collocation."
            )
    return refusal_of_space(one.space)


def refusal_of_space(space: GermSpace) -> str:
    """Return why the map from inputs to germs cannot be written in C, or an empty text."""
    for group in space.groups:
        if not hasattr(group, "marginals"):
            names = ", ".join(space.inputs[k] for k in group.columns)
            return (
                f"the inputs {names} are dependent, and their Rosenblatt transform is known numerically only; it has "
                'no form in C. Use a (log)normal vector or a Gaussian copula, or the method with transform="nataf".'
            )
    return ""


def input_means(space: GermSpace) -> Array:
    """Return the means (d,) of the inputs, in their units."""
    found = np.empty(space.dimension)
    for group in _marginal_groups(space):
        for row, (column, marginal) in enumerate(zip(group.columns, group.marginals, strict=True)):
            nodes, weights = _standard_rule(space, group, row)
            found[column] = weights @ marginal.to_input(nodes)
            if marginal.kind == "affine":
                found[column] = marginal.shift + marginal.scale * (weights @ nodes)
            elif marginal.kind == "exponential":
                found[column] = marginal.shift + marginal.scale * np.exp(marginal.mu + marginal.sigma**2 / 2)
    return found


def _marginal_groups(space: GermSpace) -> list[Any]:
    """Return the maps of the groups of inputs; all have marginals, as `refusal_of_space` has checked."""
    return list(space.groups)


def _standard_rule(space: GermSpace, group: Any, row: int) -> tuple[Array, Array]:
    """Return a Gauss rule of the standard variable of an input: its germ, or standard normal in a Gaussian copula."""
    germ = space.germs[group.columns[row]]
    most = germ.highest_degree
    nodes, weights = germ.gauss(MEAN_NODES if most is None else min(MEAN_NODES, most + 1))
    return nodes, weights


def surrogate_model(node: xr.DataTree, quantiles: Sequence[float], token: str, fmi: int) -> UnitModel:
    """Return the model of a method's surrogates; raise StudyError if they cannot be written in C."""
    known = read_surrogates(node)
    for _, one in known:
        if why := refusal_of_surrogate(one):
            raise StudyError(f"The surrogate of {node.name!r} cannot be exported: {why}")
    first = known[0][1]
    tables, variables = SourceTables(), list[Variable]()
    means = input_means(first.space)
    bounds = _supports(first.space)
    for k, info in enumerate(first.labels.inputs):
        low, high = bounds[k]
        variables.append(
            Variable(
                info.name,
                "parameter",
                f"Random input, {info.description}" if info.description else "Random input",
                info.units,
                start=float(means[k]),
                low=low if np.isfinite(low) else None,
                high=high if np.isfinite(high) else None,
                tunable=True,
                content=f"{{INPUT_VALUE, 0, {k}, NULL, NULL}}",
            )
        )
    sizes = _Sizes(len(means))
    rows = []
    for number_, (part, one) in enumerate(known):
        if tuple(one.space.inputs) != tuple(first.space.inputs):
            raise StudyError(
                f"The surrogates of {node.name!r} have the inputs {first.space.inputs} and {one.space.inputs}; "
                "expected the same inputs for outputs over time and scalar outputs."
            )
        rows.append(_surrogate_row(tables, one, sizes))
        variables += _output_variables(tables, part, one, number_, quantiles)
    if fmi == 3:
        variables.append(Variable("time", "time", "Time", "s", content="{TIME_VALUE, 0, 0, NULL, NULL}"))
    check_names(variables)
    data = "\n".join(
        [
            "/* Numbers of the surrogate. */",
            '#include "surrogate.h"',
            "",
            "#include <math.h>",
            "",
            tables.source(),
            f"const char model_token[] = {text(token)};",
            variable_table(variables),
            "const Content contents[] = {\n    " + ",\n    ".join(v.content for v in variables) + "};",
            "const Surrogate surrogates[] = {\n    " + ",\n    ".join(rows) + "};",
            f"const double start_values[] = {{{', '.join(number(x) for x in means.tolist())}}};",
            "const char *const input_names[] = {" + ", ".join(text(i.name) for i in first.labels.inputs) + "};",
            "",
        ]
    )
    timed = [one.labels.times for _, one in known if one.labels.times is not None and len(one.labels.times) > 1]
    times = None
    if timed:
        times = float(timed[0][0]), float(timed[0][-1]), float(np.min(np.diff(timed[0])))
    return UnitModel({"data.c": data, "sizes.h": sizes.header()}, tuple(variables), times, first.space)


class _Sizes:
    """Largest sizes of the elements, for the memory of an instance."""

    def __init__(self, inputs: int) -> None:
        self.inputs, self.terms, self.degree, self.edges = inputs, 1, 1, 2

    def header(self) -> str:
        """Return the C header of the sizes."""
        return (
            "/* Sizes of the surrogate. */\nenum {\n"
            f"    INPUTS = {self.inputs},\n    MOST_TERMS = {self.terms},\n    MOST_DEGREE = {self.degree},\n"
            f"    MOST_EDGES = {self.edges},\n}};\n"
        )


def _supports(space: GermSpace) -> list[tuple[float, float]]:
    found = {c: m.bounds for g in _marginal_groups(space) for c, m in zip(g.columns, g.marginals, strict=True)}
    return [found[k] for k in range(space.dimension)]


def _groups(tables: SourceTables, space: GermSpace) -> tuple[int, str]:
    rows = []
    for group in _marginal_groups(space):
        marginals = []
        for m in group.marginals:
            knots, values = (np.zeros(0), np.zeros(0)) if m.table is None else m.table
            step = float(knots[-1] - knots[0]) / (len(knots) - 1) if len(knots) else 1.0
            if len(knots) and not np.allclose(np.diff(knots), step, rtol=1e-9, atol=0):
                raise StudyError("A table of quantiles has knots that are not equidistant; it cannot be exported.")
            numbers = (m.shift, m.scale, m.mu, m.sigma, *m.bounds, float(knots[0]) if len(knots) else 0.0, step)
            marginals.append(
                f"{{{MARGINALS[m.kind]}, {', '.join(map(number, numbers))}, {len(knots)}, {tables.doubles(values)}}}"
            )
        rows.append(
            f"{{{len(group.columns)}, {tables.integers(group.columns)}, {tables.integers(group.order)}, "
            f"{tables.doubles(group.factor)}, {tables.structures('Marginal', marginals)}}}"
        )
    return len(rows), tables.structures("Group", rows)


def _surrogate_row(tables: SourceTables, one: Any, sizes: _Sizes) -> str:
    outputs, times = len(one.labels.outputs), one.labels.times
    width = 1 if times is None else len(times)
    owner, row = np.zeros((outputs, width), dtype=int), np.zeros((outputs, width), dtype=int)
    parts = [("", one)]
    if isinstance(one, ComposedChaos):
        parts = list(one.parts.items())
        for k, (name, part) in enumerate(parts):
            used = np.ones((len(part.labels.outputs), width), dtype=bool)
            if one.used is not None:
                used = np.asarray(one.used[name], dtype=bool).reshape(used.shape)
            for n, info in enumerate(part.labels.outputs):
                place = one.outputs.index(info.name)
                owner[place, used[n]], row[place, used[n]] = k, n
    else:
        row[:] = np.arange(outputs)[:, None]
    rows = [_part_row(tables, part, sizes) for _, part in parts]
    groups, group_table = _groups(tables, one.space)
    time_table = "NULL" if times is None else tables.doubles(times)
    return (
        f"{{{outputs}, {0 if times is None else width}, {time_table}, {groups}, {group_table}, {len(rows)}, "
        f"{tables.structures('Part', rows)}, {tables.integers(owner)}, {tables.integers(row)}}}"
    )


def _part_row(tables: SourceTables, part: Any, sizes: _Sizes) -> str:
    kind, outputs = stored_as(part), len(part.labels.outputs)
    boxes = part.boxes if isinstance(part, PiecewiseChaos) else [element.box for element in part.elements]
    elements = []
    for element, box in zip(part.elements, boxes, strict=True):
        terms = np.asarray(element.multi_index if isinstance(part, PiecewiseChaos) else part.multi_index)
        arrays = {"coefficients": "NULL", "edges": "NULL", "values": "NULL", "harmonic": "NULL, NULL, NULL, NULL, NULL"}
        segments, powers = 0, 0
        if kind == "chaos":
            arrays["coefficients"] = tables.doubles(element.coefficients)
        elif kind == "aligned":
            segments, powers = element.segments.shape[1], element.segments.shape[3]
            arrays["edges"], arrays["values"] = tables.doubles(element.edges), tables.doubles(element.segments)
            sizes.edges = max(sizes.edges, segments + 1)
        else:
            waves = np.asarray(element.waves)
            numbers = (element.frequencies, element.constants, element.drifts, waves.real, -waves.imag)
            arrays["harmonic"] = ", ".join(tables.doubles(x) for x in numbers)
        sizes.terms = max(sizes.terms, len(terms))
        elements.append(
            f"{{{_box_bounds(tables, box)}, {len(terms)}, {tables.integers(terms)}, "
            f"{_germ_table(tables, box.local, terms, sizes)}, {arrays['coefficients']}, {segments}, {powers}, "
            f"{arrays['edges']}, {arrays['values']}, {arrays['harmonic']}}}"
        )
    lattice, origin = (part.lattice, part.origin) if kind == "quasi_periodic" else (np.zeros((0, 0), dtype=int), 0.0)
    name = {"chaos": "PLAIN", "aligned": "SEGMENTS", "quasi_periodic": "HARMONICS"}[kind]
    return (
        f"{{{name}, {outputs}, {len(elements)}, {tables.structures('Element', elements)}, {lattice.shape[1]}, "
        f"{lattice.shape[0]}, {tables.integers(lattice)}, {number(origin)}}}"
    )


def _box_bounds(tables: SourceTables, box: GermBox) -> str:
    """Return the bounds of a box; a bound at an end of the support becomes infinite, because rounding may pass it."""
    low = [-np.inf if x <= g.bounds[0] else x for x, g in zip(box.lower, box.space.germs, strict=True)]
    high = [np.inf if x >= g.bounds[1] else x for x, g in zip(box.upper, box.space.germs, strict=True)]
    return f"{tables.doubles(low)}, {tables.doubles(high)}"


def _germ_table(tables: SourceTables, space: GermSpace, terms: Any, sizes: _Sizes) -> str:
    rows = []
    for germ, degree in zip(space.germs, terms.max(axis=0).tolist(), strict=True):
        alpha, beta = germ.coefficients(degree + 1)
        sizes.degree = max(sizes.degree, degree)
        rows.append(f"{{{degree}, {tables.doubles(alpha)}, {tables.doubles(np.sqrt(beta))}}}")
    return tables.structures("Germ", rows)


def _output_variables(
    tables: SourceTables, node: xr.DataTree, one: Any, number_: int, quantiles: Sequence[float]
) -> list[Variable]:
    shape = len(one.labels.outputs), -1
    statistics = [("mean", "Mean", one.mean), ("std", "Standard deviation", one.std)]
    if quantiles:
        found = one.quantiles(quantiles)
        statistics += [
            (f"quantile({p:g})", f"Quantile of probability {p:g}", q) for p, q in zip(quantiles, found, strict=True)
        ]
    errors = _stated_errors(node, one)
    between = _interpolation_errors(one)
    made = []
    for k, info in enumerate(one.labels.outputs):
        note = f" of {info.name}" + (", linear between output times" if one.labels.times is not None else "")

        def add(
            ending: str, text_: str, content: str, *, truth: bool = False, name: str = info.name, u: str = info.units
        ) -> None:
            made.append(Variable(name + ending, "output", text_, "" if truth else u, truth=truth, content=content))

        add("", f"Surrogate value of {info.name} at the inputs", f"{{OUTPUT_VALUE, {number_}, {k}, NULL, NULL}}")
        for ending, words, values in statistics:
            row = np.asarray(values).reshape(shape)[k]
            add(f".{ending}", words + note, f"{{STATISTIC, {number_}, {k}, {tables.doubles(row)}, NULL}}")
        if errors is not None:
            words = "Stated root mean square error of the value (errors of surrogate, integration and interpolation)"
            table = f"{tables.doubles(errors.reshape(shape)[k])}, {tables.doubles(between[k])}"
            add(".stated_error", words, f"{{STATED_ERROR, {number_}, {k}, {table}}}")
        add(
            ".valid",
            f"Whether {info.name} has a value: the inputs are in their supports, and the time is in the study",
            f"{{VALID, {number_}, {k}, NULL, NULL}}",
            truth=True,
        )
    return made


def _stated_errors(node: xr.DataTree, one: Any) -> Array | None:
    """Return stated errors (O, T) in units of the outputs; None without verification realisations."""
    if one.verification_germs is None:
        return None
    found = np.asarray(one.verification_rms())
    statistics = node.children.get("statistics")
    if statistics is not None and "integration_error_rms" in statistics.data_vars:
        integration = np.asarray(statistics.to_dataset()["integration_error_rms"].values)
        if integration.shape == found.shape:
            found = np.hypot(found, np.nan_to_num(integration))
    return found


def _interpolation_errors(one: Any) -> Array:
    """Return the largest errors (O, T - 1) of linear interpolation in each interval, as root mean squares over inputs.

    The error in the middle of an interval is ``h^2 / 8`` times the second derivative, with the length h of the
    interval. The function uses the larger of the second derivatives at both ends. Surrogates that are exact at any time
    have no interpolation error.
    """
    times, outputs = one.labels.times, len(one.labels.outputs)
    if times is None or len(times) < 2:
        return np.zeros((outputs, 0))
    found = np.zeros((outputs, len(times) - 1))
    if len(times) == 2:
        return found + np.nan
    parts = one.parts.values() if isinstance(one, ComposedChaos) else (one,)
    names = [info.name for info in one.labels.outputs]
    for part in parts:
        if stored_as(part) != "chaos":
            continue
        rows = [names.index(info.name) for info in part.labels.outputs]
        pieces = part.elements
        weights = [box.probability for box in part.boxes] if isinstance(part, PiecewiseChaos) else [1.0]
        total = np.zeros((len(rows), len(times) - 2))
        for piece, weight in zip(pieces, weights, strict=True):
            total += weight * (_second_differences(piece.coefficients, np.asarray(times)) ** 2).sum(axis=0)
        inner = np.sqrt(total)
        steps = np.diff(times) ** 2 / 8
        both = np.pad(inner, ((0, 0), (1, 1)), mode="edge")
        found[rows] = steps * np.maximum(both[:, :-1], both[:, 1:])
    return found


def _second_differences(values: Array, times: Array) -> Array:
    """Return second derivatives (..., T - 2) by differences at the inner times."""
    slopes = np.diff(values, axis=-1) / np.diff(times)
    return np.asarray(2 * np.diff(slopes, axis=-1) / (times[2:] - times[:-2]))
