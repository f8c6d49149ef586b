"""The kinds of plugins that `uqmbd new plugin` writes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["PLUGIN_KINDS", "PluginKind"]


@dataclass(frozen=True)
class PluginKind:
    """One kind of plugin: what its package offers, and by which hook.

    Attributes
    ----------
    title : str
        What the package is: "A component".
    what : str
        What is of this kind.
    example : str
        What the example does.
    module : str
        Of the package, where the example stands.
    page : str
        Of docs, which says all that may be written.
    noun : str
        What the hook returns.
    hook : str
        Empty for what is given to a component as it is.
    base : str
        Type of what the hook returns.
    registry : str
        Key of `uqmbd.plugins.KINDS` under which it is known by its name; empty without a hook.
    group : str
        Entry points of its hook.
    offers : {"class", "function"}
        What the package offers.
    by_class_name : bool
        Whether it is known by the name of its class, else by its attribute ``name``.
    """

    title: str
    what: str
    example: str
    module: str
    page: str
    noun: str = ""
    hook: str = ""
    base: str = ""
    registry: str = ""
    group: str = ""
    offers: Literal["class", "function"] = "class"
    by_class_name: bool = False


PLUGIN_KINDS = {
    "component": PluginKind(
        title="A component",
        what="a joint, driver, spring, load or contact",
        example="two points that attract each other",
        module="component",
        page="how-to/plugins/component.md",
        noun="components",
        hook="uqmbd_components",
        base="uqmbd.Component",
        registry="components",
        group="uqmbd",
        by_class_name=True,
    ),
    "law": PluginKind(
        title="A component with a law in a symbol",
        what="a component that takes an expression or a table of the user",
        example="two bodies that attract each other by a law of the user",
        module="component",
        page="how-to/plugins/law.md",
        noun="components",
        hook="uqmbd_components",
        base="uqmbd.Component",
        registry="components",
        group="uqmbd",
        by_class_name=True,
    ),
    "contact-law": PluginKind(
        title="A law of contact",
        what="normal force and friction of a contact",
        example="the law of Lankarani and Nikravesh",
        module="contact_law",
        page="how-to/plugins/contact_law.md",
        offers="function",
    ),
    "propagator": PluginKind(
        title="A propagator",
        what="a method that carries uncertainty",
        example="first-order perturbation",
        module="propagator",
        page="how-to/plugins/propagator.md",
        noun="propagators",
        hook="uqmbd_propagators",
        base="uqmbd.Propagator",
        registry="propagators",
        group="uqmbd",
    ),
    "integrator": PluginKind(
        title="An integrator",
        what="a solver in time",
        example="an explicit Runge-Kutta method of SciPy",
        module="integrator",
        page="how-to/plugins/integrator.md",
        noun="integrators",
        hook="uqmbd_integrators",
        base="uqmbd.Integrator",
        registry="integrators",
        group="uqmbd",
    ),
    "design": PluginKind(
        title="A sampling design",
        what="points in the unit cube",
        example="multiples of irrational numbers",
        module="design",
        page="how-to/plugins/sampling_design.md",
        noun="sampling designs",
        hook="uqmbd_designs",
        base="uqmbd.SamplingDesign",
        registry="designs",
        group="uqmbd",
    ),
    "section": PluginKind(
        title="A section of the report",
        what="a part of the HTML report",
        example="charts of how fast outputs change",
        module="section",
        page="how-to/plugins/report_section.md",
        noun="sections of the report",
        hook="uqmbd_report_sections",
        base="Section",
        registry="report_sections",
        group="uqmbd",
        by_class_name=True,
    ),
    "reader": PluginKind(
        title="A reader of model files",
        what="what turns a file of another program into a mechanism",
        example="tables of masses and springs",
        module="reader",
        page="how-to/other_models.md",
        noun="readers",
        hook="uqmbd_readers",
        registry="readers",
        group="uqmbd",
    ),
    "command": PluginKind(
        title="A command",
        what="what is typed after `uqmbd`",
        example="a list of the bodies of a study",
        module="command",
        page="how-to/plugins/command.md",
        noun="commands",
        hook="uqmbd_commands",
        base="uqmbd.Command",
        registry="commands",
        group="uqmbd.commands",
    ),
}
"""By the word that `--kind` takes."""
