"""What is public is a list: few names for studies, more for plugins, and old names that warn."""

from __future__ import annotations

import importlib
import subprocess
import sys

import pytest

import uqmbd
from uqmbd import extend, results

MODULES = ("uqmbd", "uqmbd.extend", "uqmbd.laws", "uqmbd.results", "uqmbd.report", "uqmbd.testing", "uqmbd.typing")


def test_authors_of_studies_read_a_short_list():
    assert len(uqmbd.__all__) <= 70 and len(results.__all__) <= 45
    terms = "Component Parameter Constraint Potential VirtualWork Kinetic Auxiliary Event hookimpl".split()
    assert set(terms) < set(uqmbd.__all__)
    assert {"Ensemble", "Trajectories", "Problem", "Integrator", "GermSpace", "Quadrature"} < set(extend.__all__)


def test_a_name_is_public_in_one_module():
    """`uqmbd.results.varying` is of statistics, `uqmbd.extend.varying` of a surrogate; no class has two places."""
    places: dict[str, list[str]] = {}
    for module in MODULES:
        found = importlib.import_module(module)
        for name in found.__all__:
            if isinstance(getattr(found, name), type):
                places.setdefault(name, []).append(module)
    assert {name: where for name, where in places.items() if len(where) > 1} == {}


@pytest.mark.parametrize(
    ("module", "name", "now"),
    [
        *(("uqmbd", name, extend) for name in ("Propagator", "GermSpace", "Ensemble", "smolyak", "Command", "Finding")),
        *(("uqmbd", name, uqmbd.laws) for name in ("law_at", "law_values")),
        *(("uqmbd.results", name, extend) for name in ("labels", "Labels", "sample_dataset", "least_squares")),
    ],
)
def test_an_old_name_is_the_new_one_with_a_warning(module, name, now):
    with pytest.warns(
        DeprecationWarning, match=rf"{module}\.{name} is {now.__name__}\.{name} now; .* version 0\.2"
    ) as told:
        assert getattr(importlib.import_module(module), name) is getattr(now, name)
    assert told[0].filename == __file__


def test_a_name_that_is_private_now_is_found_with_a_warning():
    with pytest.warns(DeprecationWarning, match="uqmbd.results.node_parts is not public any more"):
        assert results.node_parts is importlib.import_module("uqmbd.results.schema").node_parts


@pytest.mark.parametrize("module", MODULES)
def test_a_name_that_never_was_is_an_attribute_error(module):
    with pytest.raises(AttributeError, match="Ensembel"):
        importlib.import_module(module).Ensembel  # noqa: B018


def test_every_name_for_plugins_is_loaded_when_it_is_used():
    heavy = "{'chaospy', 'xarray', 'sympy', 'scipy', 'numpy', 'sksundae'} & set(sys.modules)"
    code = f"import sys, uqmbd; uqmbd.extend; uqmbd.extend.Command; uqmbd.extend.PluginWarning; print({heavy})"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "set()"
