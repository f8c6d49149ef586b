"""What is public is a list: few names for studies, more for plugins, and old names that warn."""

from __future__ import annotations

import importlib
import subprocess
import sys

import pytest

import uqmbd
from uqmbd import extend, report, results

MODULES = (
    "uqmbd",
    "uqmbd.extend",
    "uqmbd.laws",
    "uqmbd.results",
    "uqmbd.report",
    "uqmbd.shapes",
    "uqmbd.testing",
    "uqmbd.typing",
)

OLD = {
    "uqmbd": """
    AtMost Bounds Capabilities Clock Command Counters Dense Doubt ElementLimits ElementRefinement Ensemble Estimate
    Finding Frame GermBox GermSpace History Impact ImportedJoint ImportedMechanism Integrator JointAngle
    JointDisplacement Local Margins MassProperties MechanismTerms NamedFrame NodeFit Omission Omissions PhaseMotion
    Phases PluginWarning Problem Progress ProjectedEnsemble ProjectedTrajectories Propagator Quadrature Realisations
    Reduced Reductions Requirement SamplingDesign Segment SegmentedMotion Separation Severity Sizing Toleranced
    Trajectories TypedComponent VelocityConstraint Verification VerificationPoints aligned choose_clock
    clenshaw_curtis clock_at_means combination_coefficients counted_angle dense doubts errors_over_largest fit_nodes
    gauss_tensor gram_error half_angle index_set joint_frames law_at law_values mechanism_terms monte_carlo_rule
    nothing_random output_folder perpendiculars pool propagator quaternion_product refine_elements
    relative_quaternion require_clock require_outputs_over_time sampling_design sampling_designs smallest_rotation
    smolyak sparse_rule stated_tolerance uniform_variable varying watched_angles
    """,
    "uqmbd.results": """
    AlignedElement CircularMoments CountedQuantiles DEFAULT_PROBABILITIES InputInfo IntegrationShare Labels
    Landmarks LeastSquares Moments NodeRegression OutputInfo QuasiPeriodicElement SampleChunk SampleStoreChunks
    Violations chaos_from_dataset circular_of_components comparable differing happening integration_shares
    join_nodes joined_outputs labels least_squares node_parts own_statements project quantiles_of_chunks
    regress_on_nodes replicate_errors requirements_dataset sample_dataset statistics_dataset statistics_of_samples
    stored_as surrogate_parts with_reasons with_requirements with_scalars worst_integration_share
    """,
}
"""Names that moved, or became private, before version 0.1."""


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


@pytest.mark.parametrize(
    ("old", "now"), [("Doubt", "Exceedance"), ("doubts", "find_exceedances"), ("Landmarks", "Markers")]
)
def test_a_renamed_name_is_found_with_a_warning(old, now):
    for module in (uqmbd, extend) if old != "Landmarks" else (extend, results):
        with pytest.warns(DeprecationWarning, match=rf"uqmbd\.extend\.{now}\b") as told:
            assert getattr(module, old) is getattr(extend, now)
        assert [one.filename for one in told] == [__file__]


def test_the_renamed_name_of_the_report_is_found_with_a_warning():
    with pytest.warns(DeprecationWarning, match=r"uqmbd\.report\.series_style now") as told:
        assert report.style is report.series_style
    assert [one.filename for one in told] == [__file__]
    with pytest.raises(AttributeError, match="no attribute 'styles'"):
        _ = report.styles


@pytest.mark.parametrize("module", OLD)
def test_every_old_name_is_found(module):
    for name in OLD[module].split():
        with pytest.warns(DeprecationWarning, match="version 0.2"):
            assert getattr(importlib.import_module(module), name) is not None


@pytest.mark.parametrize("name", ["overall", "statements"])
def test_what_is_gone_says_what_to_use(name):
    with pytest.raises(AttributeError, match=r"use uqmbd\.results\.assess\(tree\)"):
        getattr(results, name)


def test_a_name_that_is_private_now_is_found_with_a_warning():
    with pytest.warns(DeprecationWarning, match="uqmbd.results.node_parts is not public any more"):
        assert results.node_parts is importlib.import_module("uqmbd.results.schema").node_parts


@pytest.mark.parametrize("module", MODULES)
def test_a_name_that_never_was_is_an_attribute_error(module):
    with pytest.raises(AttributeError, match="Ensembel"):
        importlib.import_module(module).Ensembel  # noqa: B018 - looking it up is the test


def test_every_name_for_plugins_is_loaded_when_it_is_used():
    heavy = "{'chaospy', 'xarray', 'sympy', 'scipy', 'numpy', 'sksundae'} & set(sys.modules)"
    code = f"import sys, uqmbd; uqmbd.extend; uqmbd.extend.Command; uqmbd.extend.PluginWarning; print({heavy})"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "set()"
