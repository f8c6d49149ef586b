"""Agreement, resolution, stated errors and reliability of random results, against rules that are written here again."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.stats
import xarray as xr
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd import extend, results
from uqmbd.propagation.observed_model import finding_attributes

LEVEL, TOLERANCE = 0.05, 1e-3
NEAR = 1e-6
"""Cases this near to a limit are drawn anew: rounding decides them."""


@st.composite
def methods(draw: st.DrawFn) -> list[dict]:
    """Draw two to four methods with the same outputs and times: samples, or surrogates that state an error."""
    seed, outputs, times = draw(st.integers(0, 2**31)), draw(st.integers(1, 3)), draw(st.sampled_from([1, 2, 7]))
    rng = np.random.default_rng(seed)
    mean, std = rng.normal(size=(outputs, times)), rng.uniform(0.5, 1, (outputs, times))
    found = []
    for k in range(draw(st.integers(2, 4))):
        sampled = draw(st.booleans())
        count = draw(st.sampled_from([10, 30, 60, 1000]))
        size = draw(st.sampled_from([1e-4, 4e-3, 0.03, 0.08, 0.3]))
        error = size * rng.uniform(0.5, 1, (outputs, times))
        off = draw(st.sampled_from([0.0, 0.0, 0.1, 2.0])) * rng.normal(size=(2, outputs, times))
        found.append({
            "label": f"m{k}", "sampled": sampled, "count": count if sampled else 0, "error": error,
            "mean": mean + off[0] * error, "std": np.maximum(std + off[1] * error, 0.05),
            "cost": draw(st.floats(0.1, 100.0)),
        })  # fmt: skip
    return found


def node_of(method: dict) -> xr.DataTree:
    names = [f"y{k}" for k in range(len(method["mean"]))]
    axes = extend.labels(names, [], np.arange(method["mean"].shape[1], dtype=float))
    errors = method["error"] * method["std"]
    known = {"std_error_mean": errors, "std_error_std": errors} if method["sampled"] else {}
    statistics = extend.statistics_dataset(axes, mean=method["mean"], std=method["std"], **known)
    if not method["sampled"]:
        statistics["verification_error"] = (("output", "time"), method["error"])
    about = {"propagator": "p", "options": {"samples": method["count"]} if method["sampled"] else {}}
    return results.propagator_node(
        method["label"], statistics, realisations=method["count"] or 9, wall_time=method["cost"], **about
    )


def mean_square(values: np.ndarray) -> float:
    """Root mean square over times that are 1 s apart, by trapezia."""
    if len(values) == 1:
        return abs(values[0])
    weights = np.full(len(values), 1.0)
    weights[[0, -1]] = 0.5
    return float(np.sqrt((weights * values**2).sum() / weights.sum()))


def spread(std: np.ndarray) -> np.ndarray:
    return np.maximum(std, 0.01 * std.max())


def bias(method: dict, o: int) -> np.ndarray:
    """Bound of the error of a surrogate from eight realisations, of which one in a hundred is larger."""
    if method["sampled"]:
        return np.zeros(method["mean"].shape[1])
    return math.sqrt(8 / scipy.stats.chi2.ppf(0.01, 8)) * method["error"][o] * spread(method["std"][o])


def noise(method: dict, o: int) -> np.ndarray:
    return method["error"][o] * method["std"][o] * method["sampled"]


def stated(method: dict, o: int) -> float:
    """Stated error over the standard deviation, averaged over time: of a surrogate; 0 of samples."""
    if method["sampled"]:
        return 0.0
    return mean_square(method["error"][o] * spread(method["std"][o])) / mean_square(method["std"][o])


def largest(method: dict, o: int) -> float:
    factor = 1.96 * method["std"][o] / spread(method["std"][o]) if method["sampled"] else 1.0
    return float((factor * method["error"][o]).max())


def whole(method: dict, o: int) -> float:
    return mean_square(1.96 * noise(method, o) + bias(method, o)) / mean_square(method["std"][o])


def clear(value: float, limit: float) -> bool:
    """Tell whether a value exceeds a limit, where rounding does not decide it."""
    assume(abs(value - limit) > NEAR * max(abs(limit), 1e-3))
    return value > limit


def critical(pair: list[dict], o: int, share: float, name: str) -> np.ndarray:
    """Return Student's quantile (T,) that the largest of T deviations exceeds with a probability `share` at most."""
    count = pair[0]["mean"].shape[1]
    noisy = [m for m in pair if m["sampled"]]
    if not noisy:
        return np.zeros(count)
    squares = [(m["error"][o] * (m["std"][o] if name == "mean" else 1.0)) ** 2 for m in noisy]
    free = [m["count"] - 1 if name == "mean" else max((m["count"] - 1) / 7, 1) for m in noisy]
    total = sum(squares)
    welch = total**2 / sum(s**2 / f for s, f in zip(squares, free, strict=True))
    return scipy.stats.t.isf(share / count / 2, welch)


def differs(one: dict, base: dict, o: int, share: float) -> bool:
    """Test mean and standard deviation at all times of an output, each at half the level."""
    pair = [one, base]
    slack = np.maximum(TOLERANCE * base["std"][o].max(), 1e-9 * np.abs(base["mean"][o]).max())
    slack = slack + bias(one, o) + bias(base, o)
    off = np.maximum(np.abs(one["mean"][o] - base["mean"][o]) - slack, 0)
    allowed = critical(pair, o, share, "mean") * np.hypot(noise(one, o), noise(base, o))
    found = [clear(a, b) for a, b in zip(off, allowed, strict=True)]
    errors = np.hypot(*(m["error"][o] * m["sampled"] for m in pair))
    bound = critical(pair, o, share, "std") * errors
    for k, (a, b) in enumerate(zip(one["std"][o], base["std"][o], strict=True)):
        nearer = max(a - slack[k], b) if a > b else min(a + slack[k], b)
        found.append(clear(abs(math.log(nearer / b)) if nearer > 0 else math.inf, bound[k]))
    return any(found)


def kind_of(one: dict, base: dict, o: int, share: float) -> str:
    beyond = differs(one, base, o, share)
    coarse = [clear(stated(m, o), 0.1) for m in (one, base)]
    rough = [
        m["sampled"] and clear(1.96 * mean_square(noise(m, o)) / mean_square(m["std"][o]), 0.15) for m in (one, base)
    ]
    few = [m["sampled"] and (m["count"] < 40 or r) for m, r in zip((one, base), rough, strict=True)]
    hardly = [m["sampled"] and m["count"] < 20 for m in (one, base)]
    if coarse[0]:
        return "under-resolved"
    if beyond and not coarse[1] and not any(hardly):
        return "differs"
    if beyond and not coarse[1] and hardly[1] and not hardly[0]:
        return "too few samples" if few[0] else "not verified"
    return "too few samples" if few[0] else "not verified" if few[1] or coarse[1] else "agrees"


@pytest.mark.thorough
@settings(max_examples=60, deadline=None)
@given(drawn=methods(), chosen=st.integers(0, 3))
def test_an_assessment_follows_from_its_rules(drawn: list[dict], chosen: int) -> None:
    check(drawn, chosen)


@pytest.mark.slow
@settings(max_examples=1500, deadline=None)
@given(drawn=methods(), chosen=st.integers(0, 3))
def test_many_assessments_follow_from_their_rules(drawn: list[dict], chosen: int) -> None:
    check(drawn, chosen)


def check(drawn: list[dict], chosen: int) -> None:
    base = drawn[chosen % len(drawn)]
    nodes = [node_of(method) for method in drawn]
    tree = results.study_tree(nodes, study="s", mechanism="m", reference=base["label"])
    found = results.assess(tree)
    outputs = range(len(base["mean"]))
    share = LEVEL / (len(drawn) - 1) / (2 * len(outputs))
    kinds = {(m["label"], o): "reference" if m is base else kind_of(m, base, o, share) for m in drawn for o in outputs}
    assert found.reference == base["label"]
    for m in drawn:
        for o in outputs:
            one = found.judgement(m["label"], f"y{o}")
            assert one.kind == kinds[m["label"], o], (m["label"], o, one.text)
            assert one.error == pytest.approx(largest(m, o), rel=1e-9)
            assert one.varies and not one.timeless

    # the cheapest of those that agree in all outputs, of which all are known to 1 %, else to 5 %, else the best known
    fit = [m for m in drawn if all(kinds[m["label"], o] in ("agrees", "reference") for o in outputs)]
    if fit == [base]:
        # the only one that is resolved is recommended if it is known to 10 %, whatever its kind
        poor = [clear(stated(base, o), 0.1) for o in outputs]
        others = [{kinds[m["label"], o] for o in outputs} for m in drawn if m is not base]
        alone = all("under-resolved" in kind and "differs" not in kind for kind in others)
        known = not clear(max(whole(base, o) for o in outputs), 0.1)
        assert found.recommended == ((base["label"],) if alone and known and not any(poor) else ())
    else:
        errors = {m["label"]: max(whole(m, o) for o in outputs) for m in fit}
        enough = [[m for m in fit if not clear(errors[m["label"]], limit)] for limit in (0.01, 0.05)]
        some = next((ms for ms in enough if ms), None)
        # realisations are the cost of runs of up to a minute
        short = all(not clear(m["cost"], 60) for m in drawn)
        best = (
            min(some, key=lambda m: (m["count"] or 9) if short else m["cost"])
            if some
            else min(fit, key=lambda m: errors[m["label"]])
        )
        assert best["label"] in found.recommended
        assert set(found.recommended) <= {m["label"] for m in fit}
        for label in found.recommended:
            assert label in found.recommendation[0]

    # each output by the first of those that are most reliable which knows it well, and agrees with the first
    order = list(dict.fromkeys([*found.recommended, base["label"], *(m["label"] for m in drawn)]))
    assert list(found.order) == order
    by_label = {m["label"]: m for m in drawn}
    for o in outputs:
        (one,) = found.of(f"y{o}")
        good = [label for label in order if kinds[label, o] in ("agrees", "reference")]
        shown = order[0]
        if kinds[shown, o] in ("agrees", "reference"):
            for limit in (0.05, 0.1):
                known = [label for label in good if not clear(largest(by_label[label], o), limit)]
                if known:
                    shown = known[0]
                    break
        error, kind = largest(by_label[shown], o), kinds[shown, o]
        level = 0 if clear(error, 0.1) else 1 if clear(error, 0.05) else 2
        if kind == "reference":
            others = [kinds[label, o] for label in by_label if label != base["label"]]
            kind = next((k for k in ("agrees", "differs") if k in others), "")
        if kind in ("differs", "under-resolved"):
            level = 0
        if kind == "too few samples":
            level = min(level, 1)
        assert (one.method, one.level) == (shown, level), one
    assert [one.level for one in found.reliability] == sorted(one.level for one in found.reliability)


def required(label: str, probability: float, lower: float, upper: float) -> xr.DataTree:
    axes = extend.labels(["x"], [], [0.0])
    node = results.propagator_node(
        label, extend.statistics_dataset(axes, mean=[[0.0]], std=[[1.0]]), propagator="p", realisations=9, wall_time=1.0
    )
    data = extend.requirements_dataset(["clear"], violation_probability=[probability], lower=[lower], upper=[upper])
    node["requirements"] = xr.DataTree(data)
    return node


@settings(max_examples=60, deadline=None)
@given(
    ends=st.lists(st.tuples(*3 * [st.floats(0, 1)]).map(sorted), min_size=1, max_size=3),
    allowed=st.floats(0.001, 0.999),
)
def test_a_requirement_is_as_reliable_as_its_interval(ends: list[list[float]], allowed: float) -> None:
    """The console, by `unmet`, and the first screen give one answer; intervals apart contradict each other."""
    nodes = [required(f"m{k}", p, low, high) for k, (low, p, high) in enumerate(ends)]
    tree = results.study_tree(nodes, study="s", mechanism="m", attrs={"allowed_probability": allowed})
    found = results.assess(tree)
    (one,) = found.of("clear", "requirement")
    surely_met = [high <= allowed for _, _, high in ends]
    surely_not = [low > allowed for low, _, _ in ends]
    expected = True if all(surely_met) else False if any(surely_not) and not any(surely_met) else None
    assert one.met is expected
    said = results.unmet(results.propagator_nodes(tree), allowed)
    assert [(" is not met" in text) for text in said] == ([] if expected else [expected is False])
    low, p, high = ends[int(one.method[1:])]
    if max(e[0] for e in ends) > min(e[2] for e in ends):
        assert one.level == 0 and "contradict each other" in one.reason and found.contradictions
        return
    assert not found.contradictions
    wide = max(high - p, p - low) / p if p > 0 else math.inf
    assert one.level == (0 if low <= 0 and high >= 1 else 2 if wide <= 0.5 or high <= 1e-3 else 1)


def test_a_method_that_misses_a_spread_is_not_said_to_have_nothing_to_know() -> None:
    """An output that one method takes for constant, at another value than the reference, is unreliable."""
    axes = extend.labels(["x"], [], [0.0, 1.0])
    nodes = []
    for label, mean in (("first", 1.0), ("second", 2.0)):
        statistics = extend.statistics_dataset(axes, mean=[[mean, mean]], std=[[0.0, 0.0]])
        nodes.append(results.propagator_node(label, statistics, propagator="p", realisations=9, wall_time=1.0))
    found = results.assess(results.study_tree(nodes, study="s", mechanism="m"))
    assert [one.kind for one in found.judgements] == ["no spread", "differs"]
    assert found.recommended == () and "No other method agrees with first" in found.recommendation[0]
    (one,) = found.of("x")
    assert (one.level, one.method) == (0, "first") and one.reason.endswith("; differs from second")
    third = results.propagator_node(
        "third", nodes[0]["statistics"].to_dataset(), propagator="p", realisations=9, wall_time=1.0
    )
    (one,) = results.assess(results.study_tree([*nodes, third], study="s", mechanism="m", reference="first")).of("x")
    assert one.level == 3 and "does not vary" in one.reason


@pytest.mark.parametrize(
    ("error", "word", "size"),
    [
        (0.4, "no", "40 % of the"),
        (0.07, "roughly", "7.0 % of the"),
        (0.03, "yes", "3.0 % of the"),
        (math.nan, "roughly", "an error of unknown size"),
    ],
)
def test_errors_that_no_method_states_lower_the_reliability(error, word, size):
    """A finding of the study estimates them; they survive the attributes of the results."""
    method = {"label": "m", "sampled": False, "count": 0, "error": np.full((1, 2), 1e-3), "cost": 1.0}
    node = node_of(method | {"mean": np.zeros((1, 2)), "std": np.ones((1, 2))})
    tree = results.study_tree([node], study="s", mechanism="m")
    assert results.assess(tree).reliability[0].word == "yes"
    finding = extend.Finding(extend.Severity.WARNING, "process 'road'", "it", hidden_errors=(("y0", error), ("z", 0.9)))
    tree.attrs |= finding_attributes([finding])
    (one,) = results.assess(tree).reliability
    assert one.word == word
    assert f"the stated error excludes {size}" in one.reason and "process 'road'" in one.reason


def test_small_errors_that_no_method_states_are_omitted():
    method = {"label": "m", "sampled": False, "count": 0, "error": np.full((1, 2), 1e-3), "cost": 1.0}
    tree = results.study_tree(
        [node_of(method | {"mean": np.zeros((1, 2)), "std": np.ones((1, 2))})], study="s", mechanism="m"
    )
    before = results.assess(tree).reliability
    tree.attrs |= finding_attributes([extend.Finding(extend.Severity.NOTE, "p", "it", hidden_errors=(("y0", 1e-3),))])
    assert results.assess(tree).reliability == before


@pytest.mark.parametrize("pairs", [[("x", 0.1)], (("x", -0.1),), (("x", 1),), (("x",),)])
def test_hidden_errors_are_pairs_of_a_name_and_an_error(pairs):
    with pytest.raises(uqmbd.StudyError, match="hidden_errors is"):
        extend.Finding(extend.Severity.NOTE, "p", "it", hidden_errors=pairs)
