"""Options of methods: numbers of any kind are made plain, whatever else a method's class has."""

from __future__ import annotations

from dataclasses import InitVar, dataclass, field
from fractions import Fraction
from typing import Annotated, ClassVar

import numpy as np
import pytest

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo
from uqmbd_reliability import Reliability


def test_numbers_of_any_kind_and_size_are_taken():
    entropy = np.random.SeedSequence(1).spawn(1)[0].entropy + 2**100
    assert MonteCarlo(seed=entropy).seed == entropy
    assert Collocation(adaptive="order", tolerance=Fraction(1, 8)).tolerance == 0.125
    assert Collocation(nodes=range(3, 5)).nodes == (3, 4)
    assert Collocation(nodes=np.array(2)).nodes == (2,)
    assert Collocation(weights=np.array([1, 2])).weights == (1.0, 2.0)


@pytest.mark.parametrize("wrong", [np.inf, -np.inf, np.nan, 0, -1, -Fraction(1, 3), "1", None, True])
def test_numbers_out_of_bounds_are_refused(wrong):
    with pytest.raises(uqmbd.StudyError, match="tolerance is .*; expected a (finite )?number above 0"):
        Collocation(tolerance=wrong)


HUGE = [10**12, 10**18, 10**400, np.int64(2**62), Fraction(10**400), 10**5000]


@pytest.mark.parametrize("wrong", HUGE, ids=["1e12", "1e18", "1e400", "2^62", "a fraction", "1e5000"])
def test_counts_and_orders_that_nothing_holds_are_refused(wrong):
    counts = [
        (MonteCarlo, "samples"), (MonteCarlo, "replicates"), (MonteCarlo, "keep"), (Collocation, "order"), (Collocation, "level"),
        (Collocation, "samples"), (Collocation, "nodes"), (Collocation, "verify"), (Collocation, "max_realisations"),
        (Collocation, "elements"), (Collocation, "max_elements"), (Galerkin, "order"), (Galerkin, "level"), (Galerkin, "nodes"),
        (Galerkin, "samples"), (Galerkin, "verify"), (Galerkin, "elements"), (Reliability, "max_realisations"),
    ]  # fmt: skip
    for method, name in counts:
        with pytest.raises(uqmbd.StudyError, match=name) as caught:
            method(**{name: wrong})
        assert len(str(caught.value)) < 300


@pytest.mark.parametrize("wrong", [10**400, Fraction(10**400), 10**5000], ids=["1e400", "a fraction", "1e5000"])
def test_numbers_beyond_those_of_64_bits_are_refused(wrong):
    for options in ({"tolerance": wrong}, {"weights": wrong}, {"weights": (1.0, wrong)}):
        with pytest.raises(uqmbd.StudyError, match=next(iter(options))) as caught:
            Collocation(**options)
        assert "at most 1e+06" in str(caught.value)
    assert MonteCarlo(seed=10**400).seed == 10**400


def test_level_by_the_deprecated_name():
    with pytest.warns(DeprecationWarning, match="deprecated"):
        assert Galerkin(rule="smolyak", samples=0).level == 0
    with pytest.raises(uqmbd.StudyError, match="samples is 0; expected a whole number, 1 or more"):
        Galerkin(rule="random", samples=0)


@dataclass(frozen=True, kw_only=True)
class Mine(uqmbd.extend.Propagator):
    """A method with fields that are no options."""

    name: ClassVar[str] = "mine"
    order: Annotated[int, uqmbd.extend.Bounds(0)] = 3
    cache: dict = field(init=False, repr=False, compare=False)
    extra: InitVar[int] = 1

    def propagate(self, problem):
        """Do nothing."""


def test_fields_that_are_no_options_are_left_alone():
    assert Mine(order=np.int64(2), extra=5).order == 2
    assert type(Mine(order=np.int64(2)).order) is int
