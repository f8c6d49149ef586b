"""`uqmbd check`: describe a study without running it, except for a few realisations."""

from __future__ import annotations

import dataclasses
import math
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.text import Text

from uqmbd import plugins
from uqmbd.cli.check.picture import draw_figure, require_format
from uqmbd.cli.tables import console, plain_table
from uqmbd.cli.terminal import plain_progress, shown_derivation
from uqmbd.errors import StudyError, UqmbdError
from uqmbd.garbage_collection import loading
from uqmbd.isolation import ERRORS_AND_EXITS, Isolated
from uqmbd.mechanism import ImportedMechanism, Mechanism
from uqmbd.plugins import InputTreatment, such_as
from uqmbd.propagation import (
    Estimate,
    Propagator,
    Timing,
    findings,
    load_study,
    obstacle_of,
    readable,
    timing_of,
    warned_elsewhere,
)
from uqmbd.wording import format_count, format_duration, format_integer, typeset_units

if TYPE_CHECKING:
    import xarray as xr
    from rich.console import Console

    from uqmbd.propagation import Study

__all__ = ["show_check"]

STARTS = {"drawn": "in the given pose", "equilibrium": "each realisation in the static equilibrium for its inputs"}
FREQUENCIES = 8  # maximum number of displayed natural frequencies


def show_check(script: Path, figure: Path | None = None) -> None:
    """Print bodies, equations, rank, redundancy, mobility, inputs and propagators of a study.

    `script` is the study script. `figure` is a file for a drawing of the mechanism, which need not be assembled.
    """
    if figure is not None:
        require_format(figure)
    with plain_progress(sys.stderr) as progress, shown_derivation(progress):
        _show_check(script, figure)


def _show_check(script: Path, figure: Path | None) -> None:
    """Load the study, and describe it."""
    import uqmbd

    with loading():
        study = load_study(script)
    if figure is not None:
        draw_figure(study, figure)
    if isinstance(study.mechanism, Mechanism):
        warned_elsewhere(study.mechanism, float(study.times[0]))  # its findings are listed below
    found: Any = uqmbd.check(study.mechanism)
    _require_integrator(study)
    screen = console()
    screen.print(Text(f"{study.name}: mechanism {study.mechanism.name}", style="bold"))
    screen.print(f"  bodies      {len(found.bodies)}: {', '.join(found.bodies)}", markup=False)
    many = len(study.times) > 1
    times = f"{len(study.times)}, from {study.times[0]:g} s to {study.times[-1]:g} s" if many else "none"
    screen.print(f"  times       {times}")
    screen.print(f"  start       {STARTS[_start(study)]}")
    for condition, kind in getattr(found, "conditions", ()):
        screen.print(f"  condition   {condition} ({kind}, at the start only)", markup=False)
    screen.print(f"  coordinates {found.coordinates}")
    screen.print(f"  equations   {described_equations(found)}")
    screen.print(f"  mobility    {_mobility(found)}")
    if found.redundant:
        redundant = ", ".join(found.redundant)
        screen.print(f"  redundant   {redundant} (follow from the others and are omitted)", markup=False)
    if found.not_unique:
        undetermined = ", ".join(found.not_unique)
        screen.print(f"  not unique  {undetermined} (redundant equations leave them undetermined)", markup=False)
    if found.mobility:
        _show_frequencies(screen, study)
    _show_omissions(screen, study.mechanism)
    _show_components(screen, found.components)
    _show_controllers(screen, getattr(found, "controllers", ()))
    _show_inputs(screen, found.inputs)
    _show_requirements(screen, study)
    _show_propagators(screen, study)
    _show_exporters(screen, study)
    _show_findings(screen, study)


def _require_integrator(study: Study) -> None:
    """Raise an error if the integrator of the study does not support its mechanism."""
    from uqmbd.dynamics import build, require_for

    integrator = getattr(study, "integrator", "auto")
    if integrator != "auto":
        require_for(build(study.mechanism, float(study.times[0])), integrator, f"study {study.name!r}")


def _mobility(found: Any) -> str:
    """Count the degrees of freedom; list degrees of freedom of velocities if velocity constraints reduce them.

    >>> from types import SimpleNamespace
    >>> _mobility(SimpleNamespace(mobility=3, velocity_mobility=2))
    '3 degrees of freedom of the positions, 2 of the velocities'
    """
    of_velocities = getattr(found, "velocity_mobility", found.mobility)
    text = f"{found.mobility} degree{'' if found.mobility == 1 else 's'} of freedom"
    return text if of_velocities == found.mobility else f"{text} of the positions, {of_velocities} of the velocities"


def described_equations(found: Any) -> str:
    """Count constraint equations of joints, and unit-length equations of half-angle pairs and quaternions.

    >>> from types import SimpleNamespace
    >>> described_equations(SimpleNamespace(equations=1, rank=1, unit_lengths=1, coordinates=4, bodies=("ball",)))
    "1 constraint equation, independent; it is the unit length of the body's half-angle pair, not of a joint"
    """
    count, units = found.equations, getattr(found, "unit_lengths", 0)
    text = f"{count} constraint equation{'' if count == 1 else 's'}"
    if count:
        text += f", {found.rank} of them independent" if count > 1 else ", independent" if found.rank else ", dependent"
    if not units:
        return text
    pair = "half-angle pair" if found.coordinates == 4 * len(found.bodies) else "quaternion"
    if count == units == 1:
        return f"{text}; it is the unit length of the body's {pair}, not of a joint"
    if units == 1:
        return f"{text}; one is the unit length of the body's {pair}, not of a joint"
    which = "all" if count == units else str(units)
    return f"{text}; {which} are the unit lengths of the bodies' {pair}s, not of joints"


def _show_omissions(screen: Console, mechanism: Mechanism) -> None:
    """Print the elements of a model file that the imported mechanism omits."""
    if not isinstance(mechanism, ImportedMechanism):
        return
    screen.print(f"  read from   {mechanism.source}, by {mechanism.read_by}", markup=False)
    table = plain_table("omitted or changed", "count", "elements", "reason")
    for row in mechanism.not_taken:
        table.add_row(Text(row.what), str(row.count), Text(row.listed), Text(row.why))
    screen.print()
    screen.print(table if len(mechanism.not_taken) else "The import is complete: nothing was omitted or changed.")


def _show_frequencies(screen: Console, study: Study) -> None:
    """Print natural frequencies and damping at the means, unless small motions are not vibrations."""
    try:
        modes, where = _modes(study)
    except StudyError:  # the mechanism has equations, but cannot move: a run reports the reason
        return
    if not (modes["frequency"] > 0).any():
        return
    kinds = []
    for f, damping in zip(modes["frequency"].values.tolist(), modes["damping_ratio"].values.tolist(), strict=True):
        # rounding must not be shown as damping
        kind = "" if abs(damping) < 1e-9 else f" ({100 * damping:.2g} % damped)"
        kind = " (decays)" if damping >= 1 else " (unstable)" if damping < -1e-9 else kind
        kinds.append(f"{f:.4g}{kind}")
    more = f" and {len(kinds) - FREQUENCIES} more" if len(kinds) > FREQUENCIES else ""
    screen.print(f"  frequencies {', '.join(kinds[:FREQUENCIES])}{more} Hz, at the means, {where}", markup=False)


def _modes(study: Study) -> tuple[xr.Dataset, str]:
    """Return modes about the static equilibrium; if there is none, about the given pose if the study starts there."""
    import uqmbd

    time = float(study.times[0])
    with warnings.catch_warnings():
        # redundant constraints are already listed
        warnings.simplefilter("ignore", uqmbd.RedundantConstraintWarning)
        try:
            return uqmbd.eigenfrequencies(study.mechanism, time=time), "in static equilibrium"
        except uqmbd.AssemblyError:
            if _start(study) == "equilibrium":
                raise
        return uqmbd.eigenfrequencies(study.mechanism, at="start", time=time), "in the given pose"


def _start(study: Study) -> str:
    """Describe the start of realisations; studies of other classes start at the given pose."""
    return str(getattr(study, "start", "drawn"))


def _show_components(screen: Console, components: tuple[tuple[str, str, int], ...]) -> None:
    table = plain_table("component", "type", "equations", right=1)
    for name, kind, equations in components:
        table.add_row(Text(name), Text(kind), str(equations))
    screen.print()
    screen.print(table if components else "There are no components: every body moves freely.")


def _show_controllers(screen: Console, controllers: tuple[tuple[str, str, str, str], ...]) -> None:
    table = plain_table("controller", "samples", "measures", "commands")
    for controller in controllers:
        table.add_row(*map(Text, controller))
    if controllers:
        screen.print()
        screen.print(table)


def _show_inputs(screen: Console, inputs: tuple[tuple[str, str, str], ...]) -> None:
    table = plain_table("random input", "distribution", "units")
    for name, distribution, units in inputs:
        table.add_row(Text(name), Text(distribution), Text(typeset_units(units)))
    screen.print()
    screen.print(table if inputs else "There are no random inputs: all realisations are equal.")


def _show_requirements(screen: Console, study: Study) -> None:
    """Print the requirements of the mechanism."""
    table = plain_table("requirement", "relation", "required", "description")
    for requirement in study.mechanism.requirements.values():
        when = "at all times" if requirement.over_time else "once"
        table.add_row(*map(Text, (requirement.name, requirement.relation, when, requirement.description)))
    if study.mechanism.requirements:
        screen.print()
        screen.print(table)


def _show_findings(screen: Console, study: Study) -> None:
    """Print the findings on the study."""
    screen.print()
    try:
        found = findings(study)
    except UqmbdError as error:  # for example a study without outputs, which is incomplete
        screen.print(f"Findings: not available. {error}", markup=False, soft_wrap=True)
        return
    screen.print(f"Findings: {len(found) or 'none'}")
    for finding in found:
        screen.print(str(finding), markup=False, soft_wrap=True)


def _show_propagators(screen: Console, study: Study) -> None:
    """Print the propagators of the study with their costs, and the other installed propagators."""
    table = plain_table("propagator", "type", "suitable", "non-default options")
    for propagator in study.propagators:
        names = (Text(propagator.node_name), Text(type(propagator).__name__))
        table.add_row(*names, _fit(propagator, study), Text(_options(propagator)))
    screen.print()
    screen.print(table if study.propagators else "The study has no propagators.")
    _show_estimates(screen, study)
    for propagator in study.propagators:
        for remark in _remarks(propagator, study):
            screen.print(f"{propagator.node_name}: {remark}.", markup=False)
    used = {type(propagator).name for propagator in study.propagators}
    others = sorted(set(plugins.propagators()) - used)
    if others:
        screen.print(f"Other installed propagators: {', '.join(others)}", markup=False)


def _show_exporters(screen: Console, study: Study) -> None:
    """Print the objects that the installed exporters can export."""
    for name, kind in plugins.exporters().items():
        exporter: Any = kind
        for what in exporter.exports:
            why = ""
            more = ""
            with Isolated(*ERRORS_AND_EXITS) as work:
                made = exporter()
                why = made.refusal(what, study) or (_no_surrogate(study) if what == "surrogate" else "")
                if not why and hasattr(made, "remark"):
                    more = made.remark(what, study)
            why = work.reason if work.failed else why
            text = f"no: {why}" if why else f"yes: uqmbd export --to FILE{exporter.suffix} --what {what}"
            if what == "surrogate" and not why and len(study.propagators) > 1:
                text += f" --method {'|'.join(_interpolating(study))}"
            text += f"; {more}" if more else ""
            screen.print(f"Export of the {what} ({name}): {text}", markup=False)


def _interpolating(study: Study) -> list[str]:
    """Return the labels of methods that approximate the outputs, and so may compute a surrogate."""
    return [one.node_name for one in study.propagators if one.input_treatment is not InputTreatment.SAMPLE]


def _no_surrogate(study: Study) -> str:
    """Return why no method of a study has a surrogate; empty if one may have it."""
    if _interpolating(study):
        return ""
    return f"no method of the study computes a surrogate; add one that does{such_as(InputTreatment.INTERPOLATE)}."


def _options(propagator: Any) -> str:
    """List the options that differ from the defaults.

    >>> from uqmbd_montecarlo import MonteCarlo
    >>> _options(MonteCarlo(samples=200, seed=1, label="reference"))
    'samples=200, seed=1'
    """
    given = []
    for option in dataclasses.fields(propagator):
        value, default = getattr(propagator, option.name), option.default
        if option.default_factory is not dataclasses.MISSING:
            default = option.default_factory()
        if option.name != "label" and (default is dataclasses.MISSING or repr(value) != repr(default)):
            given.append(f"{option.name}={value!r}")
    return ", ".join(given)


def _show_estimates(screen: Console, study: Study) -> None:
    """Print the estimated cost of each method: realisations, time, memory, disk."""
    known = [(p, found) for p in study.propagators if (found := _estimate(p, study)) is not None]
    if not known:
        return
    timing = timing_of(study, known[0][0])
    table = plain_table("estimate", "realisations", "time", "memory", "disk", "", right=5)
    table.columns[-1].justify = "left"
    for propagator, found in known:
        most = "up to " if found.at_most else ""
        table.add_row(
            Text(propagator.node_name),
            f"{most}{format_integer(found.realisations)}",
            _time(propagator, study, timing, most),
            f"{most}{readable(found.memory)}",
            "–" if found.disk is None else f"{most}{readable(found.disk)}",
            Text(found.detail, style="dim"),
        )
    screen.print()
    screen.print(table)
    if timing is not None:
        each = format_duration(timing.each) if timing.each >= 1e-3 else f"{1e6 * timing.each:.0f} μs"
        measured = f"{format_count(timing.count, 'realisation')}, {each} each"
        screen.print(
            f"Estimated times are for one worker, without statistics and report; measured by {measured}.", markup=False
        )
        screen.print("To choose sizes by time and accuracy: uqmbd run --budget 10min --accuracy 1%", markup=False)


def _time(propagator: Propagator, study: Study, timing: Timing | None, most: str) -> str:
    """Describe the predicted time of a method."""
    seconds = math.nan
    if timing is not None:
        with Isolated(*ERRORS_AND_EXITS), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            seconds = timing.seconds(propagator, study)
    if not math.isfinite(seconds):
        return "–"
    return f"{most}{format_duration(seconds, rough=True)}" if seconds >= 0.1 else "below 0.1 s"


def _fit(propagator: Any, study: Study) -> Text:
    """Return the statement of a propagator on whether it can compute this study; the default is that it can."""
    obstacle: Any = None
    with Isolated(*ERRORS_AND_EXITS) as work:
        obstacle = obstacle_of(propagator, study) if isinstance(propagator, Propagator) else None
    obstacle = work.reason if work.failed else obstacle
    return Text("yes", style="green") if obstacle is None else Text(f"no: {obstacle}", style="bold red")


def _estimate(propagator: Any, study: Study) -> Estimate | None:
    """Return the estimated cost of a propagator; None if it is unknown."""
    if not isinstance(propagator, Propagator) or not len(study.mechanism.inputs):
        return None
    found: Any = None
    with Isolated(*ERRORS_AND_EXITS):  # obstacles are reported there
        found = propagator.estimate(study)
    return found if isinstance(found, Estimate) else None


def _remarks(propagator: Any, study: Study) -> tuple[str, ...]:
    """Return the remarks of a propagator; obstacles are reported elsewhere."""
    found: tuple[str, ...] = ()
    if isinstance(propagator, Propagator):
        with Isolated(*ERRORS_AND_EXITS), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = tuple(map(str, propagator.remarks(study)))
    return found
