"""The kinds of plugins that `uqmbd new plugin` writes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from uqmbd.plugins import HookKind

__all__ = ["PLUGIN_KINDS", "PluginKind"]


@dataclass(frozen=True)
class PluginKind:
    """One kind of plugin: what its package offers, and by which hook."""

    title: str  # what the package is: "A component"
    what: str  # what is of this kind
    example: str  # what the example does
    module: str  # of the package, where the example stands
    page: str  # of docs, which says all that may be written
    # key of `uqmbd.plugins.KINDS`, which knows its hook; empty for what is given to a component as it is
    registry: str = ""
    base: str = ""  # type of what the hook returns
    offers: Literal["class", "function"] = "class"  # what the package offers

    @property
    def registered(self) -> HookKind | None:
        """Its hook, and what the classes of it have in common; none for what is given to a component as it is."""
        from uqmbd.plugins import KINDS

        return KINDS[self.registry] if self.registry else None


PLUGIN_KINDS = {
    "component": PluginKind(
        title="A component",
        what="a joint, driver, spring, load or contact",
        example="two points that attract each other",
        module="component",
        page="how-to/plugins/component.md",
        registry="components",
        base="uqmbd.Component",
    ),
    "law": PluginKind(
        title="A component with a user-defined law",
        what="a component with an expression or a table from the user",
        example="two bodies that attract each other by a law from the user",
        module="component",
        page="how-to/plugins/law.md",
        registry="components",
        base="uqmbd.Component",
    ),
    "contact-law": PluginKind(
        title="A contact law",
        what="normal force and friction of a contact",
        example="the law of Lankarani and Nikravesh",
        module="contact_law",
        page="how-to/plugins/contact_law.md",
        offers="function",
    ),
    "propagator": PluginKind(
        title="A propagator",
        what="a method that propagates uncertainty",
        example="first-order perturbation",
        module="propagator",
        page="how-to/plugins/propagator.md",
        registry="propagators",
        base="uqmbd.extend.Propagator",
    ),
    "integrator": PluginKind(
        title="An integrator",
        what="a solver in time",
        example="an explicit Runge-Kutta method of SciPy",
        module="integrator",
        page="how-to/plugins/integrator.md",
        registry="integrators",
        base="uqmbd.extend.Integrator",
    ),
    "design": PluginKind(
        title="A sampling design",
        what="points in the unit cube",
        example="multiples of irrational numbers",
        module="design",
        page="how-to/plugins/sampling_design.md",
        registry="designs",
        base="uqmbd.extend.SamplingDesign",
    ),
    "section": PluginKind(
        title="A section of the report",
        what="a part of the HTML report",
        example="charts of the rates of outputs",
        module="section",
        page="how-to/plugins/report_section.md",
        registry="report_sections",
        base="Section",
    ),
    "reader": PluginKind(
        title="A reader of model files",
        what="conversion of a file of another program to a mechanism",
        example="tables of masses and springs",
        module="reader",
        page="how-to/other_models.md",
        registry="readers",
    ),
    "command": PluginKind(
        title="A command",
        what="a subcommand of `uqmbd`",
        example="a list of the bodies of a study",
        module="command",
        page="how-to/plugins/command.md",
        registry="commands",
        base="uqmbd.extend.Command",
    ),
}
"""By the word that `--kind` takes."""
