"""Every propagator that is installed, with its options: whoever adds one has it tested here."""

from __future__ import annotations

import functools

import pytest

from uqmbd import plugins
from uqmbd.propagation.execution.workers import pool
from uqmbd.testing import check_propagator

# What a method needs to be accurate on the cases, and the options that make it another method.
QUICK = {
    "monte-carlo": {
        "random": {"samples": 300, "seed": 1},
    },
    "collocation": {
        "projection": {"order": 3},
    },
    "galerkin": {
        "explicit": {"order": 3, "integrator": "dop853"},
    },
}
SLOW = {
    "monte-carlo": {
        "sobol": {"samples": 256, "sampling": "sobol"},
        "latin-hypercube": {"samples": 256, "sampling": "latin-hypercube"},
        "pick-freeze": {"samples": 300, "sobol_indices": True},
    },
    "collocation": {
        "adaptive": {"adaptive": "order"},
        "regression": {"order": 3, "method": "regression"},
        "adaptive dimensions": {"adaptive": "dimension"},
        "smolyak": {"order": 3, "rule": "smolyak", "level": 3},
        "tensor": {"order": 3, "index_set": "tensor"},
        "omp": {"order": 3, "method": "omp", "samples": 40},
    },
    "galerkin": {
        "ida": {"order": 3, "integrator": "ida"},
        "samples": {"order": 3, "rule": "sobol", "samples": 64},
        "tensor": {"order": 3, "index_set": "tensor"},
    },
}


@pytest.fixture(scope="module")
def two_workers():
    """Two processes, for all variants."""
    with pool(2) as executor:
        yield executor


def variants(table):
    """A variant of each method at least: its options by default."""
    return [
        pytest.param(name, options, id=f"{name}-{words}")
        # common paths need sampled paths, which the cases of the kit do not have: tests/processes/test_motion.py
        for name in sorted(set(plugins.propagators()) - {"common-paths"})
        for words, options in table.get(name, {"defaults": {}} if table is QUICK else {}).items()
    ]


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "options"), variants(QUICK))
def test_propagator(name, options, two_workers):
    check_propagator(plugins.propagator(name)(**options), workers=two_workers)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "options"), variants(SLOW))
def test_more_options(name, options):
    check_propagator(plugins.propagator(name)(**options))


@pytest.mark.slow
def test_control_variate():
    control = plugins.propagator("collocation")(order=3)
    check_propagator(plugins.propagator("monte-carlo")(samples=200, control=control))


@pytest.mark.thorough
def test_callable_instead_of_an_object():
    check_propagator(
        functools.partial(plugins.propagator("collocation"), order=2), moments=["stone"], failures=False, resume=False
    )
