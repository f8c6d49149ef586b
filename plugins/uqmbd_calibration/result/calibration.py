"""The result of a calibration."""

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
from uqmbd.results import load, save
from uqmbd_calibration.records import short
from uqmbd_calibration.result.checks import named_strays
from uqmbd_calibration.result.marginals import CURVED, joint_distribution

__all__ = ["Calibration", "learned"]


KIND = "calibration"


@dataclass(frozen=True, eq=False)
class Calibration:
    """Posterior of the inputs of a study; `calibrate` makes it.

    Parameters
    ----------
    tree : xarray.DataTree
        The groups of ArviZ: ``posterior`` and ``prior`` (chain, draw), in the units of the inputs, with the noise
        levels that were found as ``noise[output]``; ``posterior_predictive`` and ``prior_predictive``, values as they
        may have been measured, of some of the draws; ``observed_data``; ``log_likelihood`` of each value, of some of
        the draws where there are very many; ``sample_stats``; ``constant_data``, the standard deviation of the noise.
        Beside them ``fit`` (means of predictions), ``residuals`` (over the noise), ``summary`` and
        ``marginals``.  A variable is named like its output, or ``output[record]`` where several records have it.

    Raises
    ------
    uqmbd.StudyError
        If what is given was not made by `calibrate`.

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
    """Objects from which it was computed, with its surrogates; `calibrate` uses these again. It is not stored."""

    def __post_init__(self) -> None:
        if not isinstance(self.tree, xr.DataTree) or self.tree.attrs.get("kind") != KIND:
            raise uqmbd.StudyError(f"Calibration: {type(self.tree).__name__} is given; expected what calibrate() made.")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the inputs that were found; of one machine alone as ``stiffness[rig 2]``."""
        return tuple(str(name) for name in self.tree["marginals"].to_dataset()["input"].values)

    @property
    def realisations(self) -> int:
        """Realisations of the mechanism that it took, all together."""
        return int(self.tree.attrs["realisations"])

    @property
    def checks(self) -> dict[str, Any]:
        """Results of the checks.

        ``even`` and ``widened``: whether realisations at draws of the posterior confirm the surrogate, or its errors
        widen the posterior; ``surrogate``: those checks one after another. Each has the effective ``share`` of the
        weights of its ``draws``. Each also has the largest ``shift`` of a mean in standard deviations, and the standard
        error of a shift, ``chance``; ``converged``, ``rhat``, ``ess``; ``modes``: shares of the maxima of the posterior
        that were found, the sampled one first. ``unsampled`` are the shares of those without draws, and ``unseen`` the
        number of maxima of the surrogate that were not followed; ``far``: inputs that are found far from their priors;
        ``model``: for each output of each record whether it may have come from the model, ``p``, ``where`` in time it
        did not, ``outliers``, and ``doubted``.
        """
        return dict(json.loads(self.tree.attrs["checks"]))

    @property
    def unidentified(self) -> tuple[str, ...]:
        """Combinations of inputs on which the records are expected to contain less information than the prior.

        As ``0.71 k1 - 0.71 k2``, each over the standard deviation of its prior (of inputs that are not normal: of the
        standard normal variables that they are functions of).
        """
        return tuple(one["name"] for one in json.loads(self.tree.attrs["unidentified"]))

    def summary(self) -> xr.Dataset:
        """Return a table by input, and by noise level that was found.

        Returns
        -------
        xarray.Dataset
            ``prior_mean``, ``prior_sd``, ``mean``, ``sd``, ``lower`` and ``upper`` (of the 95 % interval), in
            ``units``; ``learned``, one minus the deviation of the posterior over that of the prior; ``doubted``,
            whether it was found from a record that the model does not give, so that ``learned`` is no knowledge;
            ``rhat`` and ``ess``; ``noise``, whether it is a noise level, whose prior is so wide that it has no
            moments here.
        """
        return self.tree["summary"].to_dataset()

    def variables(self, machine: str = "", inputs: Sequence[str] | None = None) -> tuple[uqmbd.RandomVariable, ...]:
        """Return the posterior as dependent random variables, with the names and units of the inputs.

        Their marginal distributions are smooth, and they depend on each other by a Gaussian copula: a posterior that is
        curved is approximated.  Every method takes them.

        Parameters
        ----------
        machine : str
            Whose, where inputs were found for each machine.
        inputs : sequence of str, optional
            Of which inputs, whatever the others are; by default all.

        Raises
        ------
        uqmbd.StudyError
            If there is no such machine, or no such input.

        Warns
        -----
        uqmbd.StudyWarning
            If the posterior of two of them is so curved that the copula does not hold it.
        """
        ending = f"[{machine}]"
        machines = sorted({name.split("[", 1)[1][:-1] for name in self.names if name.endswith("]")})
        if not isinstance(machine, str) or (machine and machine not in machines) or (machines and not machine):
            raise uqmbd.StudyError(
                f"Calibration.variables: machine is {machine!r}; "
                + (f"expected one of {', '.join(map(repr, machines))}." if machines else "no input is individual.")
            )
        chosen = [name for name in self.names if not name.endswith("]") or name.endswith(ending)]
        if inputs is not None:
            known = [name.removesuffix(ending) for name in chosen]
            names = list(inputs) if isinstance(inputs, (list, tuple, set, frozenset)) else []
            if not names or any(not isinstance(name, str) or name not in known for name in names):
                raise uqmbd.StudyError(
                    f"Calibration.variables: inputs is {short(inputs)}; expected a sequence with some of "
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
                    f"Calibration.variables: the posterior of {pairs} is curved, and a Gaussian copula is not: what is "
                    "predicted with these variables may spread more than the records say. Its draws are in "
                    "tree['posterior'].",
                    uqmbd.StudyWarning,
                    stacklevel=2,
                )
        if len(chosen) == 1:
            return (uqmbd.RandomVariable(plain[0], distribution, units[0]),)
        return uqmbd.random_vector(plain, distribution, units)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write it to a netCDF file, whole or not at all; `xarray.open_datatree` opens it as well as `load`.

        Parameters
        ----------
        path : path-like
            Ends in ``.nc``.

        Returns
        -------
        pathlib.Path
            The path.
        """
        return save(self.tree, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Calibration:
        """Read a file that `save` wrote.

        Raises
        ------
        uqmbd.StudyError
            If it is something else.
        """
        return cls(load(path))

    def __repr__(self) -> str:
        about = self.tree.attrs
        return f"<calibration of study {about['study']!r}: {len(self.names)} inputs, {self.realisations} realisations>"

    def __str__(self) -> str:
        data, checks = self.summary(), self.checks
        rows = [("input", "prior", "posterior", "units", "95 % interval", "learned", "R-hat", "ESS")]
        for k, name in enumerate(data["input"].values.tolist()):
            one = data.isel(input=k)
            rows.append(
                (
                    str(name),
                    _pair(one["prior_mean"], one["prior_sd"]),
                    _pair(one["mean"], one["sd"]),
                    str(one["units"].item()),
                    f"{float(one['lower']):.6g} to {float(one['upper']):.6g}",
                    "" if bool(one["noise"]) else learned(one),
                    f"{float(one['rhat']):.3f}",
                    f"{float(one['ess']):.0f}",
                )
            )
        widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
        lines = ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]
        lines += [] if checks["converged"] else ["the chains have not converged"]
        if missing := sum(checks.get("unsampled", ())):
            lines.append(f"other maxima, which no draws are about, have about {100 * missing:.0f} % of the mass")
        state = "confirmed by the mechanism" if checks["even"] else "not confirmed by the mechanism: widened"
        lines.append(f"{self.realisations} realisations; {state}")
        if self.unidentified:
            lines.append(f"not identified: {'; '.join(self.unidentified)}")
        lines += [
            f"doubted: {one['output']} of record {one['record']!r} (p = {one['p']:.1g})"
            + (f": {named_strays(one)}" if one.get("strays") else "")
            for one in checks["model"]
            if one["doubted"]
        ]
        return "\n".join(lines)


def learned(one: xr.Dataset) -> str:
    """Return the reduction of uncertainty of an input as text; "doubted" if the model contradicts the record."""
    if "doubted" in one and bool(one["doubted"]):
        return "doubted"
    return f"{100 * max(float(one['learned']), 0.0):.1f} %"


def _pair(mean: Any, sd: Any) -> str:
    """Write a mean and a deviation with two digits of the latter."""
    middle, width = float(mean), float(sd)
    if np.isnan(middle):
        return ""
    digits = max(0, 1 - int(np.floor(np.log10(width)))) if width > 0 else 6
    if digits > 7 or abs(middle) >= 1e7:
        return f"{middle:.7g} ± {width:.2g}"
    return f"{middle:.{digits}f} ± {width:.{digits}f}"
