"""The comparison of methods: differences known in closed form, and the choice of the reference."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from uqmbd import extend, results
from uqmbd.errors import StudyError

MakeNode = Callable[..., xr.DataTree]

TIMES = np.linspace(0.0, 2 * np.pi, 2001)


def _node(label: str, mean: np.ndarray, realisations: int = 10, **more: object) -> xr.DataTree:
    axes = extend.labels([("x", "m")], [], TIMES[: len(mean)])
    statistics = extend.statistics_dataset(axes, mean=[mean], std=[0.1 + 0.0 * mean], **more)
    return results.propagator_node(label, statistics, propagator="p", realisations=realisations, wall_time=2.0)


def test_differences_in_closed_form() -> None:
    """The difference a sin t has the maximum a and the root mean square a / sqrt(2) over its period."""
    nodes = {"a": _node("a", 0.0 * TIMES), "b": _node("b", 0.3 * np.sin(TIMES))}
    found = results.compare(nodes, reference="a").sel({"method": "b"})
    assert found["mean_difference_max"].item() == pytest.approx(0.3, rel=1e-6)
    assert found["mean_difference_l2"].item() == pytest.approx(0.3 / np.sqrt(2), rel=1e-6)
    assert found["std_difference_max"].item() == 0.0
    assert found["wall_time"].item() == 2.0


def test_single_method_is_well_formed(make_node: MakeNode) -> None:
    """With one method the comparison exists, and nothing differs."""
    found = results.study_tree([make_node("only")], study="s", mechanism="m")["comparison"].to_dataset()
    assert found.attrs["reference"] == "only"
    assert found.sizes == {"method": 1, "output": 3}
    assert float(abs(found["mean_difference_max"]).max()) == 0.0


def test_reference_rule() -> None:
    """Methods with standard errors come first, then more successes, then the order; the user may override."""
    errors = {"std_error_mean": [0.0 * TIMES], "std_error_std": [0.0 * TIMES]}
    few = _node("few", TIMES, 5, **errors)
    many, more = _node("many", TIMES, 1000), _node("more", TIMES, 1000)
    assert results.choose_reference({"many": many, "few": few}) == "few"
    assert results.choose_reference({"many": many, "more": more}) == "many"
    assert results.compare({"many": many, "few": few}, reference="many").attrs["reference"] == "many"
    with pytest.raises(StudyError, match="The reference is 'nobody'; expected one of the methods 'many'"):
        results.compare({"many": many}, reference="nobody")


def test_a_method_without_a_spread_that_others_have_is_no_reference() -> None:
    """A chaos of order 0 states that it has no error, for it has no spread to be wrong about."""
    axes = extend.labels([("x", "m")], [], TIMES)
    still = extend.statistics_dataset(axes, mean=[TIMES], std=[0.0 * TIMES])
    still["verification_error"] = (("output", "time"), [0.0 * TIMES])
    blind = results.propagator_node("blind", still, propagator="p", realisations=1000, wall_time=2.0)
    seeing = _node("seeing", TIMES)
    for nodes in ({"blind": blind, "seeing": seeing}, {"seeing": seeing, "blind": blind}):
        assert results.choose_reference(nodes) == "seeing"
    assert results.choose_reference({"blind": blind}) == "blind"


def test_different_axes_are_refused(make_node: MakeNode) -> None:
    """Other outputs or other times cannot be compared."""
    with pytest.raises(StudyError, match="same times"):
        results.compare({"a": _node("a", TIMES), "b": _node("b", TIMES[:10])})
    with pytest.raises(StudyError, match="same outputs"):
        results.compare({"a": _node("a", TIMES), "b": make_node("b")})


def test_one_time_and_no_time() -> None:
    """A single time, or none, is its own maximum and root mean square."""
    for times, shape in (([1.0], (1, 1)), (None, (1,))):
        axes = extend.labels(["x"], [], times)
        nodes = {
            k: results.propagator_node(
                k,
                extend.statistics_dataset(axes, mean=np.full(shape, value), std=np.zeros(shape)),
                propagator="p",
                realisations=1,
                wall_time=0.0,
            )
            for k, value in {"a": 1.0, "b": 3.0}.items()
        }
        found = results.compare(nodes).sel({"method": "b"})
        assert found["mean_difference_l2"].item() == found["mean_difference_max"].item() == 2.0


def _ended(label: str, mean: np.ndarray, count: int) -> xr.DataTree:
    """Return the node of a method whose results end after so many times."""
    node = _node(label, mean)
    whole = node["statistics"].to_dataset()
    node["statistics"] = xr.DataTree(whole.where(whole["time"] <= TIMES[count - 1]))
    node.attrs["ends_at"] = float(TIMES[count - 1])
    return node


def test_results_that_end_early_are_compared_as_far_as_they_go() -> None:
    """Beyond the end of a method there is nothing to compare; the others are compared over the whole time."""
    nodes = {
        "early": _ended("early", 0.5 + 0.0 * TIMES, 1001),
        "whole": _node("whole", 0.0 * TIMES),
        "other": _node("other", 0.3 * np.sin(TIMES)),
    }
    found = results.compare(nodes)
    assert found.attrs["reference"] == "whole"  # although the other was given first
    assert found["compared_until"].values.tolist() == [TIMES[1000], TIMES[-1], TIMES[-1]]
    early, other = (found.sel({"method": m}) for m in ("early", "other"))
    assert early["mean_difference_max"].item() == 0.5 and early["mean_difference_l2"].item() == pytest.approx(0.5)
    assert other["mean_difference_max"].item() == pytest.approx(0.3, rel=1e-6)
    assert found["reference_std_max"].item() == pytest.approx(0.1)
    # with it as the reference everything is over its time: a sin t has the maximum a at a quarter of the period
    reverse = results.compare(nodes, reference="early").sel({"method": "other"})
    assert reverse["mean_difference_max"].item() == pytest.approx(0.5)
    assert reverse["compared_until"].item() == TIMES[1000]


def test_results_without_a_common_time_differ_by_nobody_knows_what() -> None:
    """A method that ended before its first time has no difference, and does not stop the comparison."""
    nothing = _node("nothing", np.nan * TIMES)
    found = results.compare({"whole": _node("whole", TIMES), "nothing": nothing}, reference="whole")
    assert np.isnan(found["mean_difference_max"].sel({"method": "nothing"}).item())
    assert np.isnan(found["compared_until"].sel({"method": "nothing"}).item())
    assert found["mean_difference_max"].sel({"method": "whole"}).item() == 0.0


def test_schema_of_results_that_end_early() -> None:
    """NaN is allowed after the end that a node states, there only, and nothing else is."""
    node = _ended("early", TIMES, 1001)
    results.validate(node)
    wrong = _ended("early", TIMES, 1001)
    wrong.attrs["ends_at"] = float(TIMES[1500])
    with pytest.raises(StudyError, match="/statistics/mean: found a value that is not finite at output x, time 3.14"):
        results.validate(wrong)
    wrong.attrs["ends_at"] = float(TIMES[500])
    with pytest.raises(StudyError, match="a number after the end of the results at output x, time 1.57"):
        results.validate(wrong)
    for value in ("soon", float("nan"), 1.2345):
        wrong.attrs["ends_at"] = value
        with pytest.raises(StudyError, match="attribute 'ends_at' = "):
            results.validate(wrong)
    del wrong.attrs["ends_at"]
    with pytest.raises(StudyError, match="a value that is not finite"):
        results.validate(wrong)
