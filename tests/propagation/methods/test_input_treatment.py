"""A method states how it treats inputs, which decides the inputs and outputs that it accepts."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import ClassVar

import pytest

import uqmbd
from uqmbd.extend import InputTreatment
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import CommonPaths


def method_with(attribute, value, base=uqmbd.extend.Propagator):
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        return type("Method", (base,), {"name": "mine", attribute: value}), [str(one.message) for one in found]


def test_treatment_of_inputs_is_inherited():
    method = type("Derived", (MonteCarlo,), {"name": "derived"})
    assert method.input_treatment is InputTreatment.SAMPLE
    assert CommonPaths.input_treatment is InputTreatment.AVERAGE_PATHS
    assert Collocation.input_treatment is InputTreatment.INTERPOLATE


@pytest.mark.parametrize(
    ("former", "treatment"),
    [("accepts_keys", InputTreatment.AVERAGE_PATHS), ("samples_inputs", InputTreatment.SAMPLE)],
)
def test_former_attributes_are_read_with_a_warning(former, treatment):
    method, found = method_with(former, True)
    assert method.input_treatment is treatment
    assert len(found) == 1
    assert f"write input_treatment = uqmbd.extend.{treatment}" in found[0]
    method, found = method_with(former, False)
    assert (method.input_treatment, found) == (InputTreatment.INTERPOLATE, [])


def test_both_former_attributes_are_those_of_sampling():
    @dataclass(frozen=True, kw_only=True)
    class Sampler(uqmbd.extend.Propagator):
        input_treatment: ClassVar[InputTreatment] = InputTreatment.AVERAGE_PATHS

        def propagate(self, problem): ...

    with pytest.warns(DeprecationWarning, match="samples_inputs"):
        both = type("Both", (Sampler,), {"name": "both", "accepts_keys": True, "samples_inputs": True})
    assert both.input_treatment is InputTreatment.SAMPLE


@pytest.mark.parametrize("value", ["sample", None, True])
def test_other_values_are_rejected(value):
    with pytest.raises(
        uqmbd.StudyError, match=r"`input_treatment` is .*; expected one of uqmbd.extend.InputTreatment.I"
    ):
        method_with("input_treatment", value)
