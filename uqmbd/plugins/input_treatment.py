"""How a method treats its inputs, as a class of a method declares it."""

from __future__ import annotations

import enum
import warnings
from typing import Any

from uqmbd.errors import StudyError

__all__ = ["InputTreatment", "declared_treatment"]


class InputTreatment(enum.Enum):
    """Treatment of the inputs by a method; it decides which outputs and inputs the method accepts.

    Attributes
    ----------
    INTERPOLATE
        The method approximates the outputs by functions of the inputs. Outputs must be smooth functions of all inputs,
        so the method accepts neither keys of sampled paths (`uqmbd.extend.path_key`) nor summaries that are declared by
        ``uqmbd.extend.summary(smooth=False)``.
    AVERAGE_PATHS
        The method approximates the outputs in the parameters, and averages over sampled paths. It accepts keys.
    SAMPLE
        The method evaluates the outputs at random values of the inputs only. It accepts keys and all summaries.

    Examples
    --------
    >>> from uqmbd.extend import InputTreatment
    >>> from uqmbd_montecarlo import MonteCarlo
    >>> MonteCarlo.input_treatment is InputTreatment.SAMPLE
    True
    """

    INTERPOLATE = "interpolate"
    AVERAGE_PATHS = "average paths"
    SAMPLE = "sample"


_FORMER = {"accepts_keys": InputTreatment.AVERAGE_PATHS, "samples_inputs": InputTreatment.SAMPLE}
"""The meaning of class attributes from before 0.1 that are True; the last one that applies is valid."""


def declared_treatment(cls: Any) -> InputTreatment:
    """Return the treatment that the class of a method declares or inherits; accept attributes from before 0.1."""
    former = [old for old in _FORMER if vars(cls).get(old) is True]
    inherited = _FORMER[former[-1]] if former else cls.input_treatment
    found = vars(cls).get("input_treatment", inherited)
    if former:
        warnings.warn(
            f"method {cls.__name__}: class attributes such as `{former[-1]} = True` are read until 0.2 only; write "
            f"input_treatment = uqmbd.extend.{inherited}.",
            DeprecationWarning,
            stacklevel=4,
        )
    if not isinstance(found, InputTreatment):
        expected = ", ".join(f"uqmbd.extend.{one}" for one in InputTreatment)
        raise StudyError(
            f"method {cls.__name__}: its class attribute `input_treatment` is {found!r}; expected one of {expected}."
        )
    return found
