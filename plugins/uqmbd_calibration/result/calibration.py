"""Result of a calibration."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.extend import typechecked
from uqmbd.results import load, save
from uqmbd_calibration.records import short
from uqmbd_calibration.result.checks import outliers_in_words, several_maxima
from uqmbd_calibration.result.marginals import CURVED, joint_distribution

__all__ = ["Calibration", "reduction_in_words"]


KIND = "calibration"


@typechecked(values=False)
@dataclass(frozen=True, eq=False)
class Calibration:
    """Posterior of the inputs of a study, as returned by `calibrate`.

    Parameters
    ----------
    tree : xarray.DataTree
        Groups in the layout of ArviZ. ``posterior`` and ``prior`` (chain, draw) contain the inputs in their units, and
        the estimated noise levels as ``noise[output]``. ``posterior_predictive`` and ``prior_predictive`` contain
        random measurements for some of the draws. ``log_likelihood`` contains each value, for some of the draws if
        there are many values. The other groups of ArviZ are ``observed_data``, ``sample_stats`` and ``constant_data``,
        the standard deviation of the noise. Additional groups are ``fit`` (means of predictions), ``residuals``
        (divided by the noise), ``summary`` and ``marginals``. A variable has the name of its output, or
        ``output[record]`` if several records contain the output.

    Raises
    ------
    uqmbd.StudyError
        If the tree was not computed by `calibrate`.

    Examples
    --------
    >>> import chaospy
    >>> import uqmbd
    >>> from uqmbd_calibration import Record, Series, calibrate
    >>> from uqmbd_collocation import Collocation
    >>> from uqmbd_springs import SpringDamper
    >>> stiffness = uqmbd.RandomVariable("stiffness", chaospy.Normal(100, 10), units="N/m")
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    >>> mass = mechanism.body("mass", mass=1, position=1)
    >>> spring = mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness, free_length=1))
    >>> mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    >>> record = Record("tap test", [Series("frequency", [], [1.67, 1.68, 1.66], "Hz", noise=0.01)])
    >>> study = uqmbd.Study("oscillator", mechanism)
    >>> found = calibrate(study, record, surrogate=Collocation(order=3), draws=200, chains=2)
    >>> found.names, found.unidentified
    (('stiffness',), ())
    >>> found.realisations < 200
    True
    """

    tree: xr.DataTree
    made_by: Any = field(default=None, repr=False)
    """Objects of the computation, with its surrogates; `calibrate` reuses them. They are not saved."""

    def __post_init__(self) -> None:
        if not isinstance(self.tree, xr.DataTree) or self.tree.attrs.get("kind") != KIND:
            raise uqmbd.StudyError(
                f"Calibration: the type of tree is {type(self.tree).__name__}; expected the tree of a calibration."
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the calibrated inputs; an input of one machine has a name such as ``stiffness[rig 2]``."""
        return tuple(str(name) for name in self.tree["marginals"].to_dataset()["input"].values)

    @property
    def realisations(self) -> int:
        """Total number of realisations of the mechanism."""
        return int(self.tree.attrs["realisations"])

    @property
    def checks(self) -> dict[str, Any]:
        """Results of the checks.

        ``even`` states whether realisations at draws of the posterior confirm the surrogate. ``widened`` states whether
        the errors of the surrogate widen the posterior. ``surrogate`` is the list of these checks in order. Each check
        contains its number of ``draws`` and the effective ``share`` of their weights. It also contains the largest
        ``shift`` of a mean in standard deviations, and its standard error ``chance``. ``converged``, ``rhat`` and
        ``ess`` describe the chains. ``modes`` contains the shares of the maxima of the posterior, and ``unsampled`` the
        shares of maxima with less than a fifth of the expected draws. ``unseen`` is the number of maxima of the
        surrogate that were not searched on the mechanism. ``far`` lists inputs far from their priors. ``model``
        describes each output of each record: its p-value ``p``, the times ``where`` the model does not explain the
        record, ``outliers``, and ``rejected``.
        """
        return dict(json.loads(self.tree.attrs["checks"]))

    @property
    def unidentified(self) -> tuple[str, ...]:
        """Combinations of inputs that the records are expected to determine less well than the prior.

        An example is ``0.71 k1 - 0.71 k2``, with each input divided by the standard deviation of its prior. An input
        whose distribution is not normal is replaced by its standard normal variable.
        """
        return tuple(one["name"] for one in json.loads(self.tree.attrs["unidentified"]))

    def summary(self) -> xr.Dataset:
        """Return a table of the inputs and the estimated noise levels.

        Returns
        -------
        xarray.Dataset
            ``prior_mean``, ``prior_sd``, ``mean``, ``sd``, and ``lower`` and ``upper`` of the 95 % interval, in
            ``units``; ``reduction``, one minus the ratio of posterior to prior standard deviation; ``unreliable``,
            whether the model contradicts a record of this input, so that ``reduction`` is wrong; ``rhat`` and ``ess``;
            ``noise``, whether the row is a noise level. Prior moments of a noise level are missing, because its prior
            is very wide.
        """
        return self.tree["summary"].to_dataset()

    def variables(self, machine: str = "", inputs: Sequence[str] | None = None) -> tuple[uqmbd.RandomVariable, ...]:
        """Return the posterior as dependent random variables, with the names and units of the inputs.

        The marginal distributions are smooth, and a Gaussian copula describes the dependence. The copula is an
        approximation if the dependence is nonlinear. All methods accept these variables.

        Parameters
        ----------
        machine : str
            Machine whose inputs are returned, if some inputs have a separate value for each machine.
        inputs : sequence of str, optional
            Names of inputs; the other inputs are integrated out. Default: all inputs.

        Returns
        -------
        tuple of uqmbd.RandomVariable

        Raises
        ------
        uqmbd.StudyError
            If there is no such machine or input.

        Warns
        -----
        uqmbd.StudyWarning
            If the dependence of two inputs is too nonlinear for the copula.
        """
        ending = f"[{machine}]"
        machines = sorted({name.split("[", 1)[1][:-1] for name in self.names if name.endswith("]")})
        if not isinstance(machine, str) or (machine and machine not in machines) or (machines and not machine):
            raise uqmbd.StudyError(
                f"Calibration.variables: machine is {machine!r}; "
                + (
                    f"expected one of {', '.join(map(repr, machines))}."
                    if machines
                    else "no machine, because no input is individual."
                )
            )
        chosen = [name for name in self.names if not name.endswith("]") or name.endswith(ending)]
        if inputs is not None:
            known = [name.removesuffix(ending) for name in chosen]
            names = list(inputs) if isinstance(inputs, (list, tuple, set, frozenset)) else []
            if not names or any(not isinstance(name, str) or name not in known for name in names):
                raise uqmbd.StudyError(
                    f"Calibration.variables: inputs is {short(inputs)}; expected a sequence of names out of "
                    f"{', '.join(map(repr, known))}."
                )
            chosen = [name for name, one in zip(chosen, known, strict=True) if one in inputs]
        units = [str(unit) for unit in self.summary()["units"].sel(input=chosen).values]
        plain = [name.removesuffix(ending) for name in chosen]
        tables = self.tree["marginals"].to_dataset()
        distribution = joint_distribution(tables, chosen)
        if "curvature" in tables:
            own = np.argwhere(np.triu(tables["curvature"].sel(input=chosen, other=chosen).values) > CURVED)
            if len(own):
                pairs = "; ".join(f"{plain[i]} and {plain[j]}" for i, j in own.tolist())
                warnings.warn(
                    f"Calibration.variables: the posterior of {pairs} is curved, so a Gaussian copula does not "
                    "represent it well. Predictions with these variables may have a larger spread than with the "
                    "posterior draws in tree['posterior'].",
                    uqmbd.StudyWarning,
                    stacklevel=2,
                )
        if len(chosen) == 1:
            return (uqmbd.RandomVariable(plain[0], distribution, units[0]),)
        return uqmbd.random_vector(plain, distribution, units)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the calibration to a netCDF file, completely or not at all; `load` and `xarray.open_datatree` read it.

        Parameters
        ----------
        path : path-like
            Path that ends in ``.nc``.

        Returns
        -------
        pathlib.Path
            Path of the written file.
        """
        return save(self.tree, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Calibration:
        """Return the calibration in a file written by `save`.

        Parameters
        ----------
        path : path-like
            Path of the file.

        Returns
        -------
        Calibration

        Raises
        ------
        uqmbd.StudyError
            If the file cannot be read or does not contain a calibration.
        """
        return cls(load(path))

    def __repr__(self) -> str:
        about = self.tree.attrs
        return f"<calibration of study {about['study']!r}: {len(self.names)} inputs, {self.realisations} realisations>"

    def __str__(self) -> str:
        data, checks = self.summary(), self.checks
        rows = [("input", "prior", "posterior", "units", "95 % interval", "reduction of std", "R-hat", "ESS")]
        for k, name in enumerate(data["input"].values.tolist()):
            one = data.isel(input=k)
            rows.append(
                (
                    str(name),
                    _pair(one["prior_mean"], one["prior_sd"]),
                    _pair(one["mean"], one["sd"]),
                    str(one["units"].item()),
                    f"{float(one['lower']):.6g} to {float(one['upper']):.6g}",
                    "" if bool(one["noise"]) else reduction_in_words(one),
                    f"{float(one['rhat']):.3f}",
                    f"{float(one['ess']):.0f}",
                )
            )
        widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
        lines = ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]
        lines += [] if checks["converged"] else ["the chains have not converged"]
        lines += [text] if (text := several_maxima(checks)) else []
        if missing := sum(checks.get("unsampled", ())):
            lines.append(
                f"other maxima contain about {100 * missing:.0f} % of the probability, but the sampled draws contain "
                "less than a fifth of the number expected there"
            )
        state = (
            "verified by realisations of the mechanism"
            if checks["even"]
            else "not verified by realisations of the mechanism; errors of the surrogate widen the posterior"
        )
        lines.append(f"{self.realisations} realisations; {state}")
        if self.unidentified:
            lines.append(f"not identified: {'; '.join(self.unidentified)}")
        lines += [
            f"not explained by the model: {one['output']} of record {one['record']!r} (p = {one['p']:.1g})"
            + (f": {outliers_in_words(one)}" if one.get("outlier_values") else "")
            for one in checks["model"]
            if one["rejected"]
        ]
        return "\n".join(lines)


def reduction_in_words(one: xr.Dataset) -> str:
    """Return the reduction of uncertainty of an input as text; "unreliable" if the model contradicts the record."""
    if "unreliable" in one and bool(one["unreliable"]):
        return "unreliable"
    return f"{100 * max(float(one['reduction']), 0.0):.1f} %"


def _pair(mean: Any, sd: Any) -> str:
    """Return a mean and a standard deviation as text, with two digits of the standard deviation."""
    middle, width = float(mean), float(sd)
    if np.isnan(middle):
        return ""
    digits = max(0, 1 - int(np.floor(np.log10(width)))) if width > 0 else 6
    if digits > 7 or abs(middle) >= 1e7:
        return f"{middle:.7g} ± {width:.2g}"
    return f"{middle:.{digits}f} ± {width:.{digits}f}"
