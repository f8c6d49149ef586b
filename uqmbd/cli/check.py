"""`uqmbd check`: what a study would compute, found out without computing it."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.text import Text

from uqmbd import plugins
from uqmbd.cli.tables import console, plain_table
from uqmbd.propagation.script import load_study

if TYPE_CHECKING:
    from rich.console import Console

    from uqmbd.propagation import Study

__all__ = ["show_check"]


def show_check(script: Path) -> None:
    """Print bodies, equations, rank, redundancy, mobility, inputs and propagators of a study."""
    import uqmbd

    study = load_study(script)
    found: Any = uqmbd.check(study.mechanism)
    screen = console()
    screen.print(Text(f"{study.name}: mechanism {study.mechanism.name}", style="bold"))
    screen.print(f"  bodies      {len(found.bodies)}: {', '.join(found.bodies)}", markup=False)
    screen.print(f"  times       {len(study.times)}, from {study.times[0]:g} s to {study.times[-1]:g} s")
    screen.print(f"  coordinates {found.coordinates}")
    screen.print(f"  equations   {found.equations} constraint equations, {found.rank} of them independent")
    screen.print(f"  mobility    {found.mobility} degree{'' if found.mobility == 1 else 's'} of freedom")
    if found.redundant:
        redundant = ", ".join(found.redundant)
        screen.print(f"  redundant   {redundant} (follow from the others, and are left out)", markup=False)
    _show_components(screen, found.components)
    _show_inputs(screen, found.inputs, found.unused_inputs)
    _show_propagators(screen, study)


def _show_components(screen: Console, components: tuple[tuple[str, str, int], ...]) -> None:
    table = plain_table("component", "type", "equations", right=1)
    for name, kind, equations in components:
        table.add_row(Text(name), Text(kind), str(equations))
    screen.print()
    screen.print(table if components else "No components: every body moves freely.")


def _show_inputs(screen: Console, inputs: tuple[tuple[str, str, str], ...], unused: tuple[str, ...]) -> None:
    table = plain_table("random input", "distribution", "units")
    for name, distribution, units in inputs:
        table.add_row(Text(name), Text(distribution), Text(units))
    screen.print()
    screen.print(table if inputs else "No random inputs: every realisation is the same.")
    if unused:
        screen.print(f"Enters nothing: {', '.join(unused)}", markup=False)


def _show_propagators(screen: Console, study: Study) -> None:
    """Print the study's propagators with their options, and the others that are installed."""
    table = plain_table("propagator", "type", "fits", "options")
    for propagator in study.propagators:
        options = ", ".join(
            f"{option.name}={getattr(propagator, option.name)!r}"
            for option in dataclasses.fields(propagator)
            if option.name != "label"
        )
        names = (Text(propagator.node_name), Text(type(propagator).__name__))
        table.add_row(*names, _fit(propagator, study), Text(options))
    screen.print()
    screen.print(table if study.propagators else "The study has no propagators.")
    used = {type(propagator).name for propagator in study.propagators}
    others = sorted(set(plugins.propagators()) - used)
    if others:
        screen.print(f"Installed besides: {', '.join(others)}", markup=False)


def _fit(propagator: Any, study: Study) -> Text:
    """Ask a propagator whether it can do this study; one that does not tell can."""
    obstacle = propagator.obstacle(study) if hasattr(propagator, "obstacle") else None
    return Text("yes", style="green") if obstacle is None else Text(f"no: {obstacle}", style="bold red")
