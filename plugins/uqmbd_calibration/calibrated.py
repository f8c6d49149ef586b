"""Method that runs another method with the posterior distribution in place of the prior distribution."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import xarray as xr

import uqmbd
from uqmbd_calibration.result import Calibration

__all__ = ["Calibrated"]


KEPT = (
    "posterior", "prior", "posterior_predictive", "prior_predictive", "observed_data", "constant_data", "fit",
    "residuals", "summary",
)  # fmt: skip
"""Groups of a calibration that are stored in results, because the report shows them."""


@dataclass(frozen=True)
class Calibrated(uqmbd.extend.Propagator):
    """Run a method with the posterior of a calibration in place of the distributions of the inputs.

    Inputs without calibration keep their distributions. If a study does not have all the calibrated inputs, the method
    uses the marginal posterior of the inputs that the study has. A study can run the method with the prior and with
    the posterior, so that its report shows the effect of the records. The report does not count the difference as an
    error of a method.

    Parameters
    ----------
    method : uqmbd.extend.Propagator
        Any method, such as ``Collocation(order=3)``.
    calibration : Calibration
        The posterior.
    machine : str
        Machine whose inputs are used, if some inputs have a separate value for each machine.
    label : str, optional
        Name of the results. Default: ``calibrated``.

    Raises
    ------
    uqmbd.StudyError
        In a run, if the study has none of the calibrated inputs, or has one of them in other units.

    Examples
    --------
    >>> import chaospy, numpy as np, uqmbd
    >>> from uqmbd_calibration import Record, Series, calibrate
    >>> from uqmbd_collocation import Collocation
    >>> stiffness = uqmbd.RandomVariable("stiffness", chaospy.Normal(100, 10), units="N/m")
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    >>> mass = mechanism.body("mass", mass=1, position=1)
    >>> from uqmbd_springs import SpringDamper
    >>> spring = mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness, free_length=1))
    >>> mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    >>> record = Record("tap test", [Series("frequency", [], [1.67, 1.68, 1.66], "Hz", noise=0.01)])
    >>> study = uqmbd.Study("oscillator", mechanism)
    >>> found = calibrate(study, record)
    >>> methods = [Collocation(order=3, label="before"), Calibrated(Collocation(order=3), found, label="after")]
    >>> tree = study.with_propagators(methods).run()
    >>> [round(float(tree[label]["scalars/statistics"]["std"].item()), 3) for label in ("before", "after")]
    [0.08, 0.006]
    """

    name: ClassVar[str] = "calibrated"
    method: uqmbd.extend.Propagator
    calibration: Calibration
    machine: str = ""

    def __post_init__(self, *_: Any) -> None:
        """Check the arguments, and copy the attribute `requirements` of the method."""
        super().__post_init__()
        for name, kind, example in (
            ("method", uqmbd.extend.Propagator, "a method, e.g. Collocation(order=3)"),
            ("calibration", Calibration, "the result of calibrate(), or of Calibration.load(path)"),
        ):
            if not isinstance(getattr(self, name), kind):
                given = type(getattr(self, name)).__name__
                raise uqmbd.StudyError(f"Calibrated: the type of {name} is {given}; expected {example}.")
        object.__setattr__(self, "requirements", self.method.requirements)

    def _common_inputs(self, names: tuple[str, ...]) -> list[str]:
        """Return the inputs of a study that are calibrated."""
        found = {name.removesuffix(f"[{self.machine}]") for name in self.calibration.names}
        return [name for name in names if name in found]

    def _no_common_inputs(self, names: tuple[str, ...]) -> str:
        return (
            f"the calibration has the inputs {', '.join(map(repr, self.calibration.names))}, but the study has "
            f"{', '.join(map(repr, names)) or 'none'}. Use the same input names in both"
        )

    def obstacle(self, study: uqmbd.Study) -> str | None:
        """Return why the study cannot run: no calibrated input, or the obstacle of the method; None if it can run."""
        if not self._common_inputs(study.mechanism.inputs.names):
            return self._no_common_inputs(study.mechanism.inputs.names)
        return self.method.obstacle(study)

    def remarks(self, study: uqmbd.Study) -> tuple[str, ...]:
        """Return the remarks of the method, and a remark on the inputs that keep their distributions."""
        shared = self._common_inputs(study.mechanism.inputs.names)
        kept = [name for name in study.mechanism.inputs.names if name not in shared]
        own = (f"the calibration does not change the distributions of {', '.join(map(repr, kept))}",) if kept else ()
        return (*self.method.remarks(study), *own)

    def watches(self, mechanism: uqmbd.Mechanism) -> Mapping[str, Any]:
        """Return the additional quantities that the method observes."""
        return self.method.watches(mechanism)

    def propagate(self, problem: uqmbd.extend.Problem) -> xr.DataTree:
        """Run the method with the posterior, and add the calibration to its results."""
        problem.require_random()
        shared = self._common_inputs(problem.inputs.names)
        if not shared:
            raise uqmbd.StudyError(f"{problem.label}: {self._no_common_inputs(problem.inputs.names)}.")
        node = self.method.propagate(problem.with_inputs(self.calibration.variables(self.machine, inputs=shared)))
        records = self.calibration.tree.attrs["records"]
        whole = ", ".join([records] if isinstance(records, str) else list(records))
        node.attrs |= {
            "propagator": self.name,
            "method": self.method.name,
            "options": json.dumps(
                {"method": repr(self.method), "calibration": repr(self.calibration), "machine": self.machine}
            ),
            "population": f"posterior of {', '.join(shared)} from {whole}",
        }
        model = problem.model
        first = "outputs" if model.outputs.names else "scalars" if model.scalars is not None else "requirements"
        if problem.kind == first:
            tree = self.calibration.tree
            kept = {name: tree[name].to_dataset() for name in KEPT if name in tree.children}
            node["calibration"] = xr.DataTree.from_dict({"/": xr.Dataset(attrs=tree.attrs), **kept})
        return node
