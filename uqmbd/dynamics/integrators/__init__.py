"""Integration by name: protocol of integrators, integrators of the core, and checks of every result."""

from uqmbd.dynamics.integrators.built_in import Auto, Dop853, Ida
from uqmbd.dynamics.integrators.dispatch import (
    built_in_names,
    installed_integrators,
    integrate,
    integrator_class,
    require,
    require_for,
)
from uqmbd.dynamics.integrators.projected import ProjectedEnsemble
from uqmbd.dynamics.integrators.protocol import Capabilities, Capability, Integrator, capabilities_of

__all__ = [
    "Auto",
    "Capabilities",
    "Capability",
    "Dop853",
    "Ida",
    "Integrator",
    "ProjectedEnsemble",
    "built_in_names",
    "capabilities_of",
    "integrate",
    "integrator_class",
    "installed_integrators",
    "require",
    "require_for",
]
