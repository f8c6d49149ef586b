"""Public function of the calibration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from typing import Any, Literal

import numpy as np

import uqmbd
from uqmbd.extend import typechecked
from uqmbd_calibration.inference import Bias, require_sampler
from uqmbd_calibration.posterior_search import Found, find
from uqmbd_calibration.records import Record, check_size, checked_records, short
from uqmbd_calibration.result import Calibration, tree_of, warn_of

__all__ = ["calibrate"]


@typechecked(values=False)
def calibrate(
    study: uqmbd.Study,
    records: Record | Sequence[Record],
    *,
    surrogate: uqmbd.extend.Propagator | Calibration | None = None,
    realisations: int | None = None,
    draws: int = 4000,
    chains: int = 4,
    noise: Literal["normal", "student"] = "normal",
    bias: Mapping[str, Bias] | None = None,
    individual: Sequence[str] = (),
    on: Literal["surrogate", "mechanism"] = "surrogate",
    seed: int = 0,
    workers: int | Executor = 1,
    progress: uqmbd.extend.Progress | bool | None = None,
) -> Calibration:
    """Compute the posterior of the inputs of a study from records.

    The random variables of the study are the unknown inputs. Their distributions are the prior.

    Parameters
    ----------
    study : uqmbd.Study
        Study with the mechanism. Records have their own times, so only the first time of the study is used. All its
        times are used if a record contains a scalar output, or if no record has a later time.
    records : Record or sequence of Record
        Measurements.
    surrogate : uqmbd.extend.Propagator, optional
        Method that computes a surrogate, such as ``Collocation(order=4)``. Default: collocation of the highest order
        that needs at most 62 % of `realisations` (order 1: all of them), aligned if alignment has a smaller error.
        Alternatively, an earlier result of `calibrate` in this process, with records at the same times: the calibration
        reuses its surrogate, and counts the realisations of this surrogate again.
    realisations : int, optional
        Largest number of realisations of the mechanism for each operating point and machine, including realisations for
        the surrogate. Default: 200, or 45 for each random input if that is more. Each additional maximum of the
        posterior with more than 1 % of the probability may add half of this number.
    draws, chains : int
        Number of stored draws of the posterior, and of independent ensembles of walkers.
    noise : {"normal", "student"}
        Distribution of the noise; ``student`` is Student's t with 4 degrees of freedom, scaled by the stated noise, for
        records with outliers.
    bias : mapping of str to Bias, optional
        Error of the model for each output.
    individual : sequence of str
        Inputs with a separate value for each machine. All other inputs are common to all machines.
    on : {"surrogate", "mechanism"}
        Evaluation of the likelihood: by a surrogate that is compared with realisations, or by the mechanism itself.
        With four chains, ``mechanism`` needs at least 10,000 realisations, and usually 20,000 to 30,000 until the
        chains have converged. `realisations` must allow them; the default does not.
    seed : int
        Seed of the random numbers. The same seed gives the same bits for any number of workers.
    workers : int or concurrent.futures.Executor
        Number of workers, or the executor that computes the realisations.
    progress : uqmbd.extend.Progress or bool, optional
        Display of the progress, as for `uqmbd.Study.run`.

    Returns
    -------
    Calibration

    Raises
    ------
    uqmbd.StudyError
        If an argument does not fit the study, or emcee or ArviZ is not installed.

    Warns
    -----
    uqmbd.StudyWarning
        If realisations of the mechanism contradict the posterior, chains have not converged, the posterior has other
        maxima, or the model cannot explain a record.

    Examples
    --------
    The stiffness ``(2 pi 1.67)^2``, N/m, of an oscillator of 1 kg, whose frequency was measured three times:

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
    >>> (posterior,) = found.variables()
    >>> abs(posterior.mean - 110.1) < 1
    True
    """
    given = checked_records(records, study)
    require_sampler()
    if not isinstance(on, str) or on not in ("surrogate", "mechanism"):
        raise uqmbd.StudyError(f"calibrate: on={on!r}; expected 'surrogate' or 'mechanism'.")
    further = 0
    if realisations is None:
        realisations = max(FEW, EACH * len(study.mechanism.inputs))
        further = realisations // 2
    _check(study, noise, bias, {"realisations": realisations, "draws": draws, "chains": chains, "seed": seed})
    if isinstance(individual, (str, bytes)) or not isinstance(individual, Sequence):
        raise uqmbd.StudyError(
            f"calibrate: individual is {short(individual)}; expected a list of input names, e.g. ['stiffness']."
        )
    with uqmbd.extend.pool(workers) as executor:
        found = find(
            study,
            given,
            surrogate=_method(surrogate),
            realisations=realisations,
            further=further,
            draws=draws,
            chains=chains,
            robust=noise == "student",
            bias=bias or {},
            individual=individual,
            mechanism=on == "mechanism",
            seed=seed,
            executor=executor,
            progress=progress,
        )
    about = {
        "kind": "calibration",
        "records": [record.name for record in given],
        "noise": noise,
        "on": on,
        "seed": seed,
        "surrogate": found.method,
    }
    made = Calibration(tree_of(study, found, seed, about), found)
    warn_of(made.checks, stacklevel=2)
    return made


def _method(surrogate: object) -> uqmbd.extend.Propagator | Found | None:
    """Return the method or the earlier results that provide the surrogate."""
    if surrogate is None or isinstance(surrogate, uqmbd.extend.Propagator):
        return surrogate
    if isinstance(surrogate, Calibration) and isinstance(surrogate.made_by, Found):
        return surrogate.made_by
    read = isinstance(surrogate, Calibration)
    raise uqmbd.StudyError(
        f"calibrate: surrogate is {surrogate!r}"
        + (", a calibration that was loaded from a file without its surrogate" if read else "")
        + "; expected a method, e.g. Collocation(order=4), or a result of calibrate() from this process."
    )


FEW, EACH = 200, 45
"""Default number of realisations: total minimum, and number for each input. They suffice for quadratic corrections
about a maximum and for checks."""

MANY = 10**8
"""Upper limit of realisations, draws and chains."""


def _check(study: uqmbd.Study, noise: object, bias: object, numbers: Mapping[str, Any]) -> None:
    """Raise StudyError if an option cannot be used."""
    if not isinstance(noise, str) or noise not in ("normal", "student"):
        raise uqmbd.StudyError(f"calibrate: noise is {noise!r}; expected 'normal' or 'student'.")
    if keys := [variable.name for variable in study.mechanism.inputs.variables if variable.is_key]:
        raise uqmbd.StudyError(
            f"calibrate: the outputs of study {study.name!r} depend on sampled paths of {keys[0]!r}, so the likelihood "
            "is not a smooth function of the inputs. Calibrate outputs of the stationary response, or replace the "
            "process by a spline through measured values of it."
        )
    least = {"realisations": 1, "draws": 100, "chains": 2, "seed": 0}
    for name, value in numbers.items():
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least[name]:
            raise uqmbd.StudyError(f"calibrate: {name} is {value!r}; expected a whole number, {least[name]} or more.")
        if name != "seed" and value > MANY:
            raise uqmbd.StudyError(f"calibrate: {name} is more than {MANY}; expected a whole number up to {MANY}.")
    if bias is None:
        return
    outputs = [*study.mechanism.outputs, *study.mechanism.scalars]
    if not isinstance(bias, Mapping) or not all(isinstance(one, Bias) for one in bias.values()):
        raise uqmbd.StudyError(
            f"calibrate: bias is {bias!r}; expected a mapping from outputs to Bias objects, e.g. {{'force': "
            "Bias(sd=0.5)}."
        )
    for name in bias:
        if not isinstance(name, str) or name not in outputs:
            raise uqmbd.StudyError(
                f"calibrate: bias has the key {name!r}; expected outputs of the study, {', '.join(outputs)}."
            )
        check_size(f"calibrate: bias of {name!r}", "sd", bias[name].sd)
