"""Result of an allocation, as data and as a table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from uqmbd.typing import Array

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Allocation"]


@dataclass(frozen=True, eq=False)
class Allocation:
    """Tolerances that reach a probability at the least cost.

    Attributes
    ----------
    requirements : tuple of str
        Requirements that must not be violated.
    allowed : float
        Allowed probability of a violation.
    inputs, units, sources : tuple of str
        Changeable inputs, their units, and the sources of their tolerances.
    before, after : array, shape (n,)
        Half-widths of the present and of the allocated tolerances.
    sensitivity : array, shape (n,)
        Relative change of the probability for a relative change of each tolerance, at `after`.
    cost_before, cost_after : float
        Cost of all present tolerances, and of all allocated tolerances.
    cost_alike : float
        Cost of reaching the probability by one common factor.
    probability_before, probability : float
        Probability of a violation with the present tolerances (by the surrogate), and with the tolerances `after` (by
        realisations of the mechanism).
    std_error, lower, upper : float
        Standard error and 95 % interval of `probability`.
    realisations, failures : int
        Number of realisations in all steps, and number of failed realisations.
    surrogate_error : float
        Leave-one-out error of the last surrogate, relative to the standard deviation of the margins.
    notes : tuple of str
        Remarks that a reader must take into account.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_reliability import allocate
    >>> mechanism = uqmbd.Mechanism("stack", uqmbd.Planar())
    >>> mechanism.body("part", mass=1, inertia=1) and None
    >>> box, part = (
    ...     uqmbd.RandomVariable(name, uqmbd.tolerance(size, 0.1, 0.1, cpk=1), units="mm")
    ...     for name, size in (("box", 40.1), ("part", 40))
    ... )
    >>> mechanism.require("gap", box - part >= 0, description="the part goes into the box")
    >>> found = allocate(uqmbd.Study("stack", mechanism), "gap", 0.01, cost={"box": 1, "part": 1})
    >>> found.allowed, found.lower < found.probability < found.upper
    (0.01, True)
    >>> found.factors.round(1).tolist(), dict(found.dataset().sizes)["input"]
    ([0.9, 0.9], 2)
    """

    requirements: tuple[str, ...]
    allowed: float
    inputs: tuple[str, ...]
    units: tuple[str, ...]
    sources: tuple[str, ...]
    before: Array
    after: Array
    sensitivity: Array
    cost_before: float
    cost_after: float
    cost_alike: float
    probability_before: float
    probability: float
    std_error: float
    lower: float
    upper: float
    realisations: int
    failures: int
    surrogate_error: float
    notes: tuple[str, ...]

    @property
    def factors(self) -> Array:
        """Ratio of the allocated to the present tolerance of each input, shape (n,)."""
        return np.asarray(self.after / self.before)

    def dataset(self) -> xr.Dataset:
        """Return all results as a dataset with the dimension ``input``."""
        import xarray as xr

        named = {
            "tolerance_before": ("input", self.before),
            "tolerance_after": ("input", self.after),
            "factor": ("input", self.factors),
            "sensitivity": ("input", self.sensitivity),
        }
        numbers = (
            *(
                "allowed",
                "cost_before",
                "cost_after",
                "cost_alike",
                "probability_before",
                "probability",
                "std_error",
                "lower",
            ),
            *("upper", "realisations", "failures", "surrogate_error"),
        )
        coords = {
            "input": np.array(self.inputs, dtype=np.str_),
            "input_units": ("input", np.array(self.units, dtype=np.str_)),
            "source": ("input", np.array(self.sources, dtype=np.str_)),
        }
        attrs = {"requirements": ", ".join(self.requirements), "notes": "; ".join(self.notes)}
        return xr.Dataset({**named, **{name: getattr(self, name) for name in numbers}}, coords, attrs)

    def __str__(self) -> str:
        """Return the results as a table in text."""
        width = max(len("input"), *(len(name) for name in self.inputs))
        lines = [
            f"{'input':<{width}}  {'tolerance':>12}  {'changed to':>12}  {'factor':>6}  {'sensitivity':>11}  source"
        ]
        for row in zip(
            self.inputs, self.before, self.after, self.factors, self.sensitivity, self.units, self.sources, strict=True
        ):
            name, before, after, factor, slope, units, source = row
            lines.append(
                f"{name:<{width}}  {f'±{before:.4g} {units}':>12}  {f'±{after:.4g} {units}':>12}  {factor:>6.1%}  "
                f"{slope:>11.3g}  {source}"
            )
        lines.append(
            f"{', '.join(self.requirements)}: probability of violation {self.probability:.4g} (95 % interval "
            f"{self.lower:.4g} to {self.upper:.4g}), allowed {self.allowed:g}, before {self.probability_before:.4g}"
        )
        lines.append(
            f"cost {self.cost_before:.4g} before, {self.cost_after:.4g} after ({self.cost_alike:.4g} with one common "
            f"factor); {self.realisations} realisations"
            + (f", of which {self.failures} failed" if self.failures else "")
        )
        return "\n".join([*lines, *self.notes])
