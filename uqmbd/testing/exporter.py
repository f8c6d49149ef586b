"""Test an exporter: its options are usable, it reports refusals before an export, and it writes the requested file."""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.dynamics import compute_model_key
from uqmbd.errors import UqmbdError
from uqmbd.isolation import Isolated
from uqmbd.mechanism import Line, Mechanism
from uqmbd.plugins import KINDS, Exporter, registered_name
from uqmbd.propagation import Study, option_types
from uqmbd.randomness import GermSpace, uniform_variable
from uqmbd.results import PolynomialChaos, propagator_node
from uqmbd.results.schema import labels, statistics_dataset

__all__ = ["check_exporter"]

HOSTILE = 'a <b> & "c" é'
"""Name of an output, with characters that XML, shells and tables treat specially."""

OLD = "an older file"
"""Content of a file that an export replaces."""


@typechecked(values=False)
def check_exporter(
    exporter: type[Exporter], *, studies: Sequence[Study] = (), nodes: Sequence[xr.DataTree] = ()
) -> None:
    """Check an exporter on several studies: their mechanisms, and surrogates of these.

    - The exporter is a dataclass with a name, an ending and supported objects, and is made without arguments. Each
      field has an annotation that states the values of its option.
    - `refusal` returns the same text for the same study, and raises no error, even for a study without inputs or with
      unusual names.
    - An object without refusal is exported: the file exists and is not empty, and an older file is replaced.
    - All written files are next to the file, and their names begin like that of the file.
    - `export` returns a text for the terminal, and changes neither results nor mechanism. In a mechanism with
      controllers, only additions are found.
    - Results without a surrogate cause a `uqmbd.StudyError`.

    Parameters
    ----------
    exporter : type
        Dataclass that follows the protocol `uqmbd.extend.Exporter`.
    studies, nodes : sequence, optional
        Further studies, and for each of them the results of a method with a surrogate. At least one of all studies must
        be exportable, for each supported object.

    Raises
    ------
    AssertionError
        If a check fails; the message states the check.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> import uqmbd
    >>> from uqmbd.testing import check_exporter
    >>> @dataclass(frozen=True)
    ... class Means:
    ...     \"\"\"Export means as text.\"\"\"
    ...     name = "means"
    ...     suffix = ".txt"
    ...     exports = ("surrogate",)
    ...     digits: int = 6
    ...     def refusal(self, what, study):
    ...         return ""
    ...     def export(self, source, path, study):
    ...         _ = path.write_text(str(uqmbd.results.surrogate(source).mean.round(self.digits).tolist()))
    ...         return f"means    {path}"
    >>> check_exporter(Means)
    """
    _, problem = registered_name(exporter, KINDS["exporters"])
    name = getattr(exporter, "__name__", repr(exporter))
    assert not problem, f"{name} is a class {problem}."
    assert exporter.__doc__ and not exporter.__doc__.startswith(f"{name}("), (
        f"{name} has no docstring; describe the exporter in one sentence."
    )
    assert len(studies) == len(nodes), f"{name}: {len(studies)} studies and {len(nodes)} nodes; expected equal numbers."
    made: Any = None
    with Isolated() as work:
        made = exporter()
    assert not work.failed, f"{name} cannot be made without arguments ({work.reason}); give each field a default."
    types = option_types(exporter)
    missing = [field.name for field in dataclasses.fields(made) if field.name not in types]
    assert not missing, f"{name}: the field {missing[0]!r} has no annotation, which states the values of its option."
    cases: list[tuple[str, Study, xr.DataTree | None]] = [*_cases()]
    cases += [(f"given study {k + 1}", s, n) for k, (s, n) in enumerate(zip(studies, nodes, strict=True))]
    for what in exporter.exports:
        done, why = 0, ""
        for about, study, node in cases:
            where = f"{name}, {what}, {about}"
            told = _refusal(made, what, study, where)
            source = node if what == "surrogate" else study.mechanism
            why = told or why
            if not told and source is not None:
                _check_export(made, source, study, where)
                done += 1
        assert done, (
            f"{name} refuses the {what} of every study: {why} Pass a study that it exports, and results of a method: "
            "check_exporter(..., studies=[study], nodes=[study.propagate(method)])."
        )
        if what == "surrogate":
            _check_without_surrogate(made, f"{name}, surrogate")


def _refusal(made: Any, what: str, study: Study, where: str) -> str:
    """Return the reason of a refusal; check that it is a text, and that two calls return the same text."""
    found: list[Any] = []
    for _ in range(2):
        with Isolated() as work:
            found.append(made.refusal(what, study))
        assert not work.failed, f"{where}: refusal() raised {work.reason}; return the reason as a text."
    first, second = found
    assert isinstance(first, str), f"{where}: refusal() returned {first!r}; expected a text, empty without a reason."
    assert first == second, f"{where}: two calls of refusal() return different texts: {first!r} and {second!r}."
    return first


def _check_export(made: Any, source: Any, study: Study, where: str) -> None:
    """Export twice, the second time over an older file, and check files, text and source."""
    before: Any = source.copy(deep=True) if isinstance(source, xr.DataTree) else _content(source)
    with tempfile.TemporaryDirectory() as folder:
        for stem in ("one", "two"):
            path = Path(folder) / stem / f"{stem}{made.suffix}"
            path.parent.mkdir()
            if stem == "two":
                path.write_text(OLD, encoding="utf-8")
            text: Any = None
            with Isolated() as work:
                text = made.export(source, path, study)
            assert not work.failed, (
                f"{where}: export() raised {work.reason}. State what cannot be exported in refusal(), which "
                "`uqmbd check` and `uqmbd export` show beforehand."
            )
            assert isinstance(text, str) and text.strip(), (
                f"{where}: export() returned {text!r}; expected the text that the command prints."
            )
            assert path.is_file() and path.stat().st_size, (
                f"{where}: export() wrote no file {path.name}, or an empty one."
            )
            assert path.read_bytes() != OLD.encode(), f"{where}: export() did not replace the older file {path.name}."
            strange = sorted(
                x.name for x in Path(folder).rglob("*") if x.is_file() and not x.name.startswith(x.parent.name)
            )
            assert not strange, (
                f"{where}: export() wrote {strange[0]} next to {path.name}; names of further files begin with the name "
                "of the file."
            )
    same = source.identical(before) if isinstance(source, xr.DataTree) else _content(source) == before
    assert same, f"{where}: export() modified its source; modify a copy instead."


def _content(mechanism: Mechanism) -> tuple[object, ...]:
    """Return the revision, which shows additions, and a digest of all data, or None if the mechanism has no digest."""
    return mechanism.revision(), compute_model_key(mechanism)


def _check_without_surrogate(made: Any, where: str) -> None:
    """Export results that contain statistics only."""
    study, axes = _study([0.0, 1.0]), labels([("height", "m")], [], [0.0, 1.0])
    data = statistics_dataset(axes, mean=np.zeros((1, 2)), std=np.zeros((1, 2)))
    node = propagator_node("method", data, propagator="any", realisations=1, wall_time=0.0)
    with tempfile.TemporaryDirectory() as folder, Isolated() as work:
        made.export(node, Path(folder) / f"one{made.suffix}", study)
    assert isinstance(work.error, UqmbdError), (
        f"{where}: results without a surrogate cause {work.reason or 'no error'}; expected a uqmbd.StudyError, as of "
        "uqmbd.results.surrogate."
    )


def _study(times: Sequence[float], output: str = "height", *, random: bool = True) -> Study:
    """Return a study of a stone with a random speed."""
    speed = uniform_variable("speed", 2, 4, "m/s") if random else 3.0
    mechanism = Mechanism("stone", Line())
    stone = mechanism.body("stone", mass=1, velocity=speed)
    mechanism.output(output, stone.position[0], units="m")
    return Study("throw", mechanism, times)


def _node(study: Study) -> xr.DataTree | None:
    """Return results of a method: the exact surrogate of the stone, whose height is the time times the speed."""
    times, inputs = np.asarray(study.times), study.mechanism.inputs
    if not inputs.variables:
        return None
    space = GermSpace.of(inputs)
    axes = labels(
        [(name, "m") for name in study.mechanism.outputs], [(v.name, v.units) for v in inputs.variables], times
    )
    # the speed is 3 m/s, plus its standard deviation times the polynomial of degree one
    coefficients = np.array([3 * times, times / np.sqrt(3)])[:, None]
    chaos = PolynomialChaos(coefficients, np.array([[0], [1]]), space, axes)
    children = {"chaos": chaos.to_dataset()}
    return propagator_node(
        "method", chaos.statistics(), propagator="any", realisations=2, wall_time=0.0, children=children
    )


def _cases() -> list[tuple[str, Study, xr.DataTree | None]]:
    """Return studies with the results of a method; None if there is no surrogate."""
    made = {
        "a study with one input": _study([0.0, 0.5, 1.0]),
        "a study with an unusual name of an output": _study([0.0, 1.0], HOSTILE),
        "a study without inputs": _study([0.0, 1.0], random=False),
    }
    return [(about, study, _node(study)) for about, study in made.items()]
