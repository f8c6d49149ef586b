"""Recorded steps, and polynomials on their parts: against NumPy's roots and integrals, and with little room."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from tests.mechanisms import pendulum
from uqmbd.compiled import PLACES, FittedPolynomials, Need, PartTable, StepHistory, recording
from uqmbd.dynamics import Ensemble, integrate
from uqmbd.dynamics.linear import excess
from uqmbd.propagation.observed_model import build_observed_model

NODES = 2 * PLACES - 1
LARGEST, SMALLEST, SO_FAR, INTEGRAL, REACHED = range(5)


def steps(edges, members=1):
    """Steps of some realisations between the same times; the only entry of a state is the time."""
    begin, end = np.tile(edges[:-1], members), np.tile(edges[1:], members)
    count = len(edges) - 1
    states = (begin[:, None] + PLACES * (end - begin)[:, None])[:, :, None]
    owner = np.repeat(np.arange(members), count)
    return StepHistory(owner, np.arange(len(owner)), begin, end, end, np.zeros(len(owner), dtype=bool), states)


def refined(course, needs, *functions, share=1e-9):
    """Resolve functions of the realisation and the time; the table, and how many parts were evaluated."""
    table, count = PartTable(len(functions), needs, share), len(course.owner)
    table.begin_with(course, np.arange(count), np.zeros(count), np.ones(count))
    while True:
        which, low, high = table.new
        _, times = course.states_of(which, low, high)
        owner = course.owner[which][:, None]
        if not table.refine(np.stack([f(owner, times) for f in functions], axis=1)):
            return table, table.count


def fitted(values, begin, end, column=0):
    """Polynomials through values (E, O, 8)."""
    series = chebyshev.chebfit(NODES, values.reshape(-1, 8).T, 7).T.reshape(values.shape)
    return FittedPolynomials(column, np.arange(len(values)), begin, end, values, series)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_peaks_are_those_at_the_roots_of_the_derivative(sign):
    """Of 200 polynomials whose coefficients fall as those of a resolved expression do."""
    rng = np.random.default_rng(0)
    series = rng.normal(size=(200, 1, 8)) * 0.2 ** np.arange(8)
    values = chebyshev.chebval(NODES, series.transpose(2, 0, 1))
    place, value = fitted(values, np.zeros(200), np.ones(200)).peaks(sign, np.arange(200))
    for k in range(200):
        roots = chebyshev.chebroots(chebyshev.chebder(series[k, 0]))
        inside = roots[np.isreal(roots) & (np.abs(roots) <= 1)].real
        at = np.concatenate([[-1, 1], inside])
        all_ = sign * chebyshev.chebval(at, series[k, 0])
        assert value[k] == pytest.approx(all_.max(), abs=1e-13)
        assert place[k] == pytest.approx(at[all_.argmax()], abs=1e-6)


def test_peaks_of_what_is_constant_or_not_finite():
    """A constant is largest at once; of what is not finite somewhere nothing is known."""
    values = np.array([np.full((1, 8), 3.0), np.append(np.arange(7.0), np.nan)[None]])
    place, value = fitted(values, np.zeros(2), np.ones(2)).peaks(1.0, np.array([0, 1]))
    assert place[0] == -1 and value[0] == 3
    assert np.isnan(value[1])


def test_smallest_values_so_far_are_those_of_many_times():
    """Of two realisations with five parts each, not above any value so far, and close to the smallest of 20,001."""
    edges, times = np.array([0, 0.7, 1.1, 1.9, 2.6, 3.0]), np.linspace(0, 3, 41)
    begin, end = np.tile(edges[:-1], 2), np.tile(edges[1:], 2)
    function = [lambda t: np.sin(3 * t) - 0.2 * t, lambda t: np.cos(2 * t) + 0.3 * t]
    own = np.repeat([0, 1], 5)
    nodes = begin[:, None] + PLACES * (end - begin)[:, None]
    values = np.stack([function[k](t) for k, t in zip(own, nodes, strict=True)])[:, None]
    found = fitted(values, begin, end).cumulative_minimum(np.array([0, 5]), times)
    dense = np.linspace(0, 3, 20_001)
    for row, f in zip(found, function, strict=True):
        so_far = np.minimum.accumulate(f(dense))[np.searchsorted(dense, times - 1e-12)]
        np.testing.assert_allclose(row, so_far, atol=2e-6)


def test_only_what_can_win_is_halved():
    """Eighty parts of a wave with six kinks, which grows: for its largest value the last peak is resolved, not each kink.

    For its integral each kink is enclosed by few parts, where halving takes some thirty.
    """

    def wave(_, t):
        return (1 + 0.05 * t) * np.abs(np.sin(t))

    course = steps(np.linspace(0, 20, 81))
    _, most = refined(course, [Need(LARGEST, 0.0, 0)], wave)
    table, every = refined(course, [Need(INTEGRAL, 0.0, 0)], wave)
    assert most < 90 < every < 80 + 15 * 6
    order = table.order
    total = (table.mean[order, 0] * (table.end[order] - table.begin[order])).sum()
    dense = np.linspace(0, 20, 4_000_001)
    assert total == pytest.approx(np.trapezoid(wave(0, dense), dense), abs=1e-7)
    begin, end = table.begin[order], table.end[order]
    np.testing.assert_array_equal(begin[1:], end[:-1])
    assert begin[0] == 0 and end[-1] == 20


def test_what_is_reached_is_resolved_where_it_is():
    """When a kinked wave reaches a level, by its closed form; parts afterwards are left alone."""

    def wave(_, t):
        return np.abs(np.sin(t)) - 0.999

    table, count = refined(steps(np.linspace(0, 20, 21)), [Need(REACHED, 0.0, 0)], wave)
    order = table.order
    part = order[np.searchsorted(table.end[order], np.arcsin(0.999))]
    assert table.error[part, 0] <= table.allowed[0, 0] and count < 40


def test_company_changes_no_bit():
    """Of three realisations that are halved together, and each alone."""
    waves = [lambda k, t: np.abs(np.sin((1 + 0.1 * k) * t)), lambda k, t: np.exp(np.cos(k * t))]
    needs = [Need(INTEGRAL, 0.0, 0), Need(SMALLEST, 500.0, 1), Need(SO_FAR, 0.0, 0)]
    together, _ = refined(steps(np.linspace(0, 9, 10), 3), needs, *waves)
    order, whole = together.order, together.course.owner[together.step[together.order]]
    for member in range(3):
        alone, _ = refined(steps(np.linspace(0, 9, 10)), needs, *(lambda _, t, f=f, m=member: f(m, t) for f in waves))
        mine = order[whole == member]
        for name in ("begin", "values", "coefficients", "error", "mean"):
            np.testing.assert_array_equal(getattr(alone, name)[alone.order], getattr(together, name)[mine])


def test_room_for_steps_changes_no_bit(monkeypatch):
    """A log that is full after eight steps, and one for all."""
    model, times = build_observed_model(pendulum(loaded=True), 0.0), np.linspace(0, 2, 5)
    values = np.stack([np.linspace(0.9, 1.1, 11), np.linspace(0.8, 1.2, 11)], axis=1)

    def run():
        ensemble = Ensemble(model, values)
        return integrate(ensemble, times, 1e-8, "dop853", between=True)

    whole = run()
    for name, size in (("ROOM", 1), ("LEAST", 8)):
        monkeypatch.setattr(recording, name, size)
    little = run()
    np.testing.assert_array_equal(little.states, whole.states)
    rows = [np.argsort(found.path.owner, kind="stable") for found in (whole, little)]
    for mine, theirs in zip(whole.path, little.path, strict=True):
        np.testing.assert_array_equal(mine[rows[0]], theirs[rows[1]])
    for member in range(11):
        ends = whole.path.ends[whole.path.owner == member]
        np.testing.assert_array_equal(ends[1:, 0], ends[:-1, 1])
        assert ends[0, 0] == 0 and ends[-1, 1] == 2


@pytest.mark.parametrize("method", ["dop853", "ida", "radau"])
@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-10])
def test_states_between_the_places_are_on_the_constraints(method, rtol):
    """To less than the tolerance of the integration: the places are on them, and polynomials follow."""
    ensemble = Ensemble(build_observed_model(pendulum(loaded=True), 0.0), np.array([[1.0, 1.0]]))
    path = integrate(ensemble, np.array([0.0, 2.0]), rtol, method, between=True).path
    count = len(path.owner)
    course = StepHistory(
        path.owner, np.arange(count), path.ends[:, 0], path.ends[:, 1], path.ends[:, 1], path.kept, path.states
    )
    states, times = course.states_of(np.arange(count), np.full(count, 0.13), np.full(count, 0.9))
    model, owner = ensemble.model, np.zeros(8 * count, dtype=np.int64)
    q, _ = excess(model, states.reshape(len(owner), -1), times.ravel(), ensemble.block[owner])
    assert np.abs(q).max() < max(0.3 * rtol, 1e-13)
