"""Kinds of plugins for `uqmbd new plugin`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from uqmbd.plugins import HookKind

__all__ = ["PLUGIN_KINDS", "PluginKind"]


@dataclass(frozen=True)
class PluginKind:
    """Kind of plugin: its classes, its hook and its example."""

    title: str  # title of the kind, such as "A component"
    what: str  # description of the kind
    example: str  # description of the example
    module: str  # name of the module with the example
    page: str  # page of docs that lists the possible contents
    registry: str  # key in `uqmbd.plugins.KINDS`
    base: str = ""  # type of the classes that the hook returns
    # key in `uqmbd.plugins.KINDS` of the model fitted by a method, a second class of the package; or empty
    fitted: str = ""
    fitted_base: str = ""

    @property
    def registered(self) -> HookKind:
        """Hook of the kind, and common properties of its classes."""
        from uqmbd.plugins import KINDS

        return KINDS[self.registry]

    @property
    def fitted_hook(self) -> str:
        """Name of the hook of the fitted model; empty if there is none."""
        from uqmbd.plugins import KINDS

        return KINDS[self.fitted].hook if self.fitted else ""


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
        what="a component whose law the user supplies, as an expression or a table",
        example="two bodies that attract each other by a law that the user supplies",
        module="component",
        page="how-to/plugins/law.md",
        registry="components",
        base="uqmbd.Component",
    ),
    "contact-law": PluginKind(
        title="A contact law",
        what="normal force and friction of a contact",
        example="the law of Lankarani and Nikravesh, by name",
        module="contact_law",
        page="how-to/plugins/contact_law.md",
        registry="contact_laws",
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
    "surrogate": PluginKind(
        title="A method with a surrogate",
        what="a model that is fitted to realisations, stored and evaluated",
        example="radial basis functions",
        module="surrogate",
        page="how-to/plugins/surrogate.md",
        registry="propagators",
        base="uqmbd.extend.Propagator",
        fitted="surrogates",
        fitted_base="uqmbd.extend.SurrogateModel",
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
    "exporter": PluginKind(
        title="An exporter",
        what="files of another program",
        example="tables of means and standard deviations",
        module="exporter",
        page="how-to/plugins/exporter.md",
        registry="exporters",
        base="uqmbd.extend.Exporter",
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
"""Kinds of plugins, by the value of `--kind`."""
