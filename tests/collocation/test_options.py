"""Options: what cannot be used, and what contradicts itself, is one clear error."""

from __future__ import annotations

import dataclasses
import json

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.cli.run.settings import apply_settings
from uqmbd_collocation import Collocation


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"weights": {"x": 2}}, ["weights is {'x': 2}", "a number above 0 for each input"]),
        ({"order": -1}, ["order is -1", "whole number, 0 or more"]),
        ({"order": 2.5}, ["order is 2.5"]),
        ({"order": True}, ["order is True"]),
        ({"order": "3"}, ["order is '3'"]),
        ({"verify": -1}, ["verify is -1"]),
        ({"seed": None}, ["seed is None"]),
        ({"max_realisations": 0}, ["max_realisations is 0"]),
        ({"index_set": "square"}, ["index_set is 'square'", "'total', 'tensor', 'hyperbolic'"]),
        ({"method": "guess"}, ["method is 'guess'", "'regression'"]),
        ({"rule": "simpson"}, ["rule is 'simpson'", "'clenshaw-curtis'"]),
        ({"adaptive": "yes"}, ["adaptive is 'yes'", "'dimension'"]),
        ({"transform": "copula"}, ["transform is 'copula'", "'nataf'"]),
        ({"tolerance": 0}, ["tolerance is 0"]),
        ({"tolerance": float("nan")}, ["tolerance is nan"]),
        ({"tolerance": "small"}, ["tolerance is 'small'"]),
        ({"nodes": (3, 0)}, ["nodes is (3, 0)"]),
        ({"nodes": "many"}, ["nodes is 'many'"]),
        ({"weights": (1, -1)}, ["weights is (1, -1)"]),
        ({"method": "regression", "rule": "gauss"}, ["fits samples, but rule='gauss' is a grid", "'sobol'"]),
        ({"adaptive": "dimension", "method": "omp"}, ["adaptive='dimension' refines a sparse grid"]),
        ({"adaptive": "dimension", "rule": "gauss"}, ["adaptive='dimension' refines a sparse grid"]),
        ({"adaptive": "dimension", "level": 3}, ["level=3 cannot be combined with adaptive='dimension'"]),
        ({"adaptive": "dimension", "weights": (1, 2)}, ["weights=(1.0, 2.0) cannot be combined"]),
        ({"adaptive": "dimension", "index_set": "tensor"}, ["index_set='tensor' contradicts"]),
        ({"adaptive": "order", "nodes": 3}, ["nodes=(3,) cannot be combined with adaptive='order'"]),
        ({"adaptive": "order", "method": "regression", "samples": 30}, ["samples=30 cannot be combined"]),
        ({"adaptive": "order", "method": "regression", "rule": "latin-hypercube"}, ["is not extendable"]),
        ({"rule": "smolyak", "nodes": (3, 3)}, ["nodes=(3, 3) cannot be combined with rule='smolyak'", "rule='gauss'"]),
        ({"level": 3}, ["level=3 cannot be combined with rule='gauss'", "'smolyak' or rule='clenshaw-curtis'"]),
        ({"samples": 100}, ["samples=100 cannot be combined with rule='gauss'"]),
        ({"method": "omp", "nodes": 4}, ["nodes=(4,) cannot be combined with rule='sobol'"]),
    ],
    ids=str,
)
def test_what_cannot_be_used(options, words):
    with pytest.raises(uqmbd.StudyError) as caught:
        Collocation(**options)
    for word in ("Collocation: ", *words):
        assert word in str(caught.value)


def test_numbers_of_any_kind_become_plain_ones():
    made = Collocation(order=np.int64(4), nodes=np.array([5, 6]), weights=[1, 2])
    assert (made.order, made.nodes, made.weights) == (4, (5, 6), (1.0, 2.0))
    made = Collocation(adaptive="order", tolerance=np.float32(0.5))
    assert made.tolerance == 0.5 and type(made.tolerance) is float
    json.dumps(dataclasses.asdict(made))


def test_options_from_the_command_line():
    settings = ["order=4", "nodes=5,6", "weights=1,2", "verify=0", "seed=3", "index_set=hyperbolic"]
    (changed,) = apply_settings([f"collocation.{text}" for text in settings], [Collocation()])
    assert changed == Collocation(order=4, nodes=(5, 6), weights=(1, 2), verify=0, seed=3, index_set="hyperbolic")
    (changed,) = apply_settings(["collocation.nodes=5", "collocation.rule=gauss"], [Collocation()])
    assert changed.nodes == (5,)
    (changed,) = apply_settings(["collocation.nodes=none"], [changed])
    assert changed.nodes is None
    with pytest.raises(uqmbd.StudyError, match=r"nodes is \('many',\)"):
        apply_settings(["collocation.nodes=many"], [Collocation()])
    with pytest.raises(uqmbd.StudyError, match="order is -2"):
        apply_settings(["collocation.order=-2"], [Collocation()])


NORMAL, CAUCHY = chaospy.Normal(0, 1), chaospy.Cauchy()


@pytest.mark.parametrize(
    ("distributions", "options", "words"),
    [
        ([NORMAL] * 2, {"method": "regression", "samples": 7}, ["10 terms", "the 7 samples", "at least 20"]),
        ([NORMAL] * 2, {"method": "omp", "samples": 2}, ["2 samples are too few"]),
        ([CAUCHY], {}, ["'x0'", "moments"]),
        ([NORMAL] * 2, {"nodes": 3}, ["does not resolve the 10 terms", "more nodes"]),
        ([NORMAL] * 2, {"nodes": (4, 4, 4)}, ["nodes has 3 entries", "x0, x1"]),
        ([NORMAL] * 2, {"weights": (1,)}, ["weights", "2 positive numbers"]),
        (
            [NORMAL] * 2,
            {"rule": "smolyak", "index_set": "tensor", "level": 3},
            ["not resolve 1 of the 16 terms", "level=4"],
        ),
        ([NORMAL] * 8, {}, ["65536 nodes", "16 verification", "max_realisations = 5000", "smolyak"]),
        ([NORMAL] * 8, {"rule": "clenshaw-curtis"}, ["needs 43046721 nodes", "smolyak"]),
        ([NORMAL] * 8, {"rule": "smolyak", "order": 5}, ["max_realisations = 5000", "method='regression'"]),
        ([NORMAL] * 2, {"method": "regression", "samples": 6000}, ["6000 nodes", "without samples="]),
        ([NORMAL] * 2, {"order": 4, "adaptive": "order", "max_realisations": 20}, ["25 nodes"]),
        ([NORMAL] * 2, {"adaptive": "dimension", "max_realisations": 10}, ["21 realisations"]),
    ],
    ids=lambda value: str(value) if isinstance(value, dict) else "",
)
def test_what_does_not_suit_the_inputs_is_reported_before_anything_is_computed(
    resting, inline, distributions, options, words
):
    study = resting(lambda *x: sum(x), *distributions)
    collocation = Collocation(**options)
    with pytest.raises(uqmbd.StudyError) as caught:
        # an executor that computes no chunk at all
        study.propagate(collocation, workers=inline(most=0))
    for word in words:
        assert word in str(caught.value)
    if options.get("adaptive") != "dimension":
        told = collocation.obstacle(study)
        assert told.removeprefix("collocation: ") == str(caught.value).removeprefix("collocation: ")


def test_nothing_random(resting):
    mechanism = uqmbd.Mechanism("certain", uqmbd.Translational())
    mechanism.output("y", mechanism.body("body", mass=1).position[1])
    study = uqmbd.Study("certain", mechanism, [0, 1])
    assert Collocation().obstacle(study).startswith("mechanism 'certain' has no random variables; declare a uqmbd.")
    with pytest.raises(uqmbd.StudyError, match="mechanism 'certain' has no random variables"):
        study.propagate(Collocation())


def test_what_can_be_done_has_no_obstacle(resting):
    study = resting(lambda a, b: a * b, NORMAL, NORMAL)
    assert all(Collocation(**o).obstacle(study) is None for o in ({}, {"adaptive": "dimension"}, {"method": "lars"}))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"tolerance": 1e-4}, "tolerance=0.0001 has no effect with adaptive='no'"),
        ({"threshold": 0.1}, "threshold=0.1 has no effect with elements=None"),
        ({"max_elements": 5}, "max_elements=5 has no effect with elements=None"),
    ],
)
def test_an_option_without_effect_is_reported(options, words):
    with pytest.warns(uqmbd.StudyWarning, match=words):
        Collocation(**options)


@pytest.mark.parametrize(
    "options",
    [
        {"tolerance": 1e-3},
        {"adaptive": "order", "tolerance": 1e-4},
        {"elements": 3, "threshold": 0.1},
        {"alignment": "events", "max_elements": 5},
    ],
)
def test_options_with_an_effect_are_not_reported(options, recwarn):
    Collocation(**options)
    assert not recwarn
