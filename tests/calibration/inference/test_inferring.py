"""Search, corrections by realisations, and checks, on formulas with surrogates that are wrong in known ways."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from uqmbd_calibration.inference import climb, directions, expected_covariance, infer, sample, search
from uqmbd_calibration.inference.correcting import corrected
from uqmbd_calibration.inference.inferring import PosteriorCheck
from uqmbd_calibration.inference.maxima import PartOfPosterior, Parts, combined_draws, log_mass_of
from uqmbd_calibration.inference.settling import settle
from uqmbd_calibration.inference.working import CalibrationState

from . import forward

TIMES = np.linspace(0.1, 4.0, 40)


def decaying(z):
    """An oscillation whose frequency and decay are unknown."""
    omega, decay = 3.0 + 0.4 * z[:, :1], 0.3 * np.exp(0.3 * z[:, 1:2])
    return np.exp(-decay * TIMES) * np.cos(omega * TIMES)


def crude(z):
    """Its first-order polynomial at the mean: far off in the tails."""
    step = 1e-4 * np.eye(2)
    middle = decaying(np.zeros((1, 2)))
    slopes = [(decaying(step[k : k + 1]) - decaying(-step[k : k + 1])) / 2e-4 for k in range(2)]
    return middle + z[:, :1] * slopes[0] + z[:, 1:2] * slopes[1]


def inferred(function, surrogate, values, noise, *, most=200, inputs=2, **about):
    made = forward.model(function, inputs, [forward.block(values, noise, times=TIMES, **about)], most=most)
    case = made.posterior.cases[0]
    base = forward.predictor(surrogate)(case)
    build = forward.builder(made, surrogate)
    peaks = search(build, (case,), inputs, inputs, 1)
    error = np.mean((surrogate(SPREAD[:, :inputs]) - function(SPREAD[:, :inputs])) ** 2, axis=0)
    found = infer(made.posterior.unknowns, (case,), (base,), ([error],), peaks, draws=4000, chains=4, seed=2)
    return found, made


SPREAD = np.random.default_rng(0).standard_normal((64, 3))


def quadrature(function, values, noise, centre, sd):
    """Return mean and deviations of two unknowns by a grid about a point."""
    axes = [np.linspace(c - 7 * s, c + 7 * s, 201) for c, s in zip(centre, sd, strict=True)]
    z = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    log = -0.5 * ((function(z) - values) ** 2).sum(axis=1) / noise**2 - 0.5 * (z**2).sum(axis=1)
    weights = np.exp(log - log.max())
    weights /= weights.sum()
    mean = weights @ z
    return mean, np.sqrt(weights @ (z - mean) ** 2)


@pytest.mark.thorough
@pytest.mark.parametrize("truth", [(0.3, -0.4), (1.5, 1.0), (-1.8, 0.2)])
def test_realisations_mend_a_crude_surrogate(truth):
    noise = 0.02
    values = decaying(np.array([truth]))[0] + noise * np.random.default_rng(1).standard_normal(40)
    found, made = inferred(decaying, crude, values, noise)
    assert found.checks[-1].passed and not found.widened
    assert made.point.spent <= 200
    flat = found.draws.flat
    mean, sd = quadrature(decaying, values, noise, flat.mean(axis=0), flat.std(axis=0))
    np.testing.assert_allclose((flat.mean(axis=0) - mean) / sd, 0, atol=0.15)
    np.testing.assert_allclose(flat.std(axis=0), sd, rtol=0.08)
    # the crude surrogate alone is wrong by far
    alone = climb(
        made.posterior.part((made.posterior.cases[0],), (forward.predictor(crude)(made.posterior.cases[0]),)),
        np.array([truth]),
    )
    assert np.abs((alone.vectors[0] - mean) / sd).max() > 3


def relaxing(z):
    """A relaxation with three unknowns: amplitude, rate, and value in the end; its posterior has one maximum."""
    rate = 0.8 * np.exp(0.4 * z[:, 1:2])
    return (1 + 0.3 * z[:, :1]) * np.exp(-rate * TIMES) + 0.2 * np.tanh(0.4 * z[:, 2:3])


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6))
@example(seed=8100)  # the surrogate has its maximum where it is exact, with slopes that no step tests
def test_maxima_are_found_on_the_mechanism_whatever_the_slopes_of_the_surrogate(seed):
    """Slopes of the surrogate are wrong in size and in sign; SciPy climbs on the formula itself, from the truth."""
    generator = np.random.default_rng(seed)
    truth, wrong = generator.uniform(-2, 2, 3), generator.standard_normal((3, 40))
    noise = 10.0 ** generator.uniform(-3, -1)
    values = relaxing(truth[None])[0] + noise * generator.standard_normal(40)

    def surrogate(z):
        return relaxing(np.zeros((1, 3))) + 0.3 * z @ wrong

    made = forward.model(relaxing, 3, [forward.block(values, noise, times=TIMES)], most=400)
    case = made.posterior.cases[0]
    base = forward.predictor(surrogate)(case)
    work = CalibrationState(made.posterior.unknowns, (case,), (base,), ([np.zeros(40)],))
    peaks = search(forward.builder(made, surrogate), (case,), 3, 3, 1)
    modes, start, _ = settle(work, peaks)
    known = least_squares(
        lambda z: np.concatenate([(relaxing(z[None])[0] - values) / noise, z]), truth, xtol=1e-14, ftol=1e-14
    )
    away = start - known.x
    assert np.sqrt(away @ (known.jac.T @ known.jac) @ away) < 0.5
    assert modes[0].log_density == pytest.approx(-known.cost - 40 * np.log(noise) - 20 * np.log(2 * np.pi), abs=0.2)
    assert made.point.spent <= 200


@pytest.mark.slow
def test_where_realisations_do_not_suffice_the_errors_of_the_surrogate_widen_the_posterior():
    noise, held = 0.02, 0
    generator = np.random.default_rng(4)

    def slightly(z):
        return decaying(z) + 0.05 * np.sin(TIMES + 2 * z[:, :1])

    for _ in range(6):
        truth = 0.7 * generator.standard_normal(2)
        values = decaying(truth[None])[0] + noise * generator.standard_normal(40)
        found, made = inferred(decaying, slightly, values, noise, most=3)
        assert found.widened and not found.checks and made.point.spent <= 3
        low, high = np.quantile(found.draws.flat, [0.025, 0.975], axis=0)
        held += int(((low <= truth) & (truth <= high)).sum())
    # 12 intervals of 95 %
    assert held >= 10


@pytest.mark.thorough
def test_long_records_are_searched_from_their_beginning():
    """The phase goes round 30 times: the density has a maximum for nearly each turn."""
    times = np.linspace(0.05, 20, 400)

    def function(z):
        return np.sin((10 + 1.5 * z[:, :1]) * times)

    generator = np.random.default_rng(0)
    found, alone = 0, 0
    for k in range(5):
        truth = generator.standard_normal(1)
        values = function(truth[None])[0] + 0.1 * generator.standard_normal(400)
        made = forward.model(function, 1, [forward.block(values, 0.1, times=times)])
        peaks = search(forward.builder(made, function), made.posterior.cases, 1, 1, k)
        found += bool(abs(peaks.vectors[0, 0] - truth[0]) < 0.01)
        alone += bool(abs(climb(made.posterior, np.zeros((1, 1))).vectors[0, 0] - truth[0]) < 0.01)
    assert found == 5
    assert alone < 3


@pytest.mark.thorough
def test_a_second_maximum_is_reported():
    def function(z):
        return np.tile(z[:, :1] ** 2, (1, 40))

    values = 1.0 + 0.2 * np.random.default_rng(0).standard_normal(40)
    found, _ = inferred(function, function, values, 0.2, inputs=1)
    assert len(found.modes) == 2
    assert found.modes[0].vector[0] == pytest.approx(-found.modes[1].vector[0], abs=0.02)
    assert found.modes[0].log_mass == pytest.approx(found.modes[1].log_mass, abs=0.05)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), inputs=st.integers(1, 3), degree=st.integers(0, 2))
def test_corrections_are_exact_for_polynomials(seed, inputs, degree):
    import uqmbd

    generator = np.random.default_rng(seed)
    terms = uqmbd.extend.index_set(inputs, degree, "total")
    weights = generator.standard_normal((len(terms), 7))

    def polynomial(z):
        return np.prod(z[:, None, :] ** terms, axis=2) @ weights

    def base(z):
        return [np.sin(z[:, :1] * np.arange(7))]

    def real(z):
        return base(z)[0] + polynomial(z)

    points = generator.standard_normal((30, inputs))

    def measure(left):
        return (left**2).sum(axis=1) / 1e-12

    made = corrected(base, points, [real(points)], np.arange(inputs), np.zeros(inputs), np.eye(inputs), measure)
    other = generator.standard_normal((5, inputs))
    np.testing.assert_allclose(made(other)[0], real(other), atol=1e-6)


def test_errors_of_a_correction_are_those_of_realisations_that_are_left_out():
    generator = np.random.default_rng(0)
    points = generator.standard_normal((12, 1))
    real = np.sin(3 * points)
    about = (np.arange(1), np.zeros(1), np.eye(1), lambda left: (left**2).sum(axis=1) / 1e-12)

    def base(z):
        return [np.full((len(z), 1), np.nan)]

    made = corrected(base, points, [real], *about)
    assert made.base is None
    weights = np.exp(-0.25 * (points[:, 0] ** 2 - (points**2).min())) + 0.02
    left = []
    for k in range(12):
        others = np.arange(12) != k
        basis = np.polynomial.polynomial.polyvander(points[:, 0], made.degree)
        root = np.sqrt(weights)[others]
        own = np.linalg.lstsq(basis[others] * root[:, None], real[others, 0] * root, rcond=None)[0]
        left.append((real[k, 0] - basis[k] @ own) * np.sqrt(weights[k] / weights.sum()))
    np.testing.assert_allclose(made.errors[:, 0], left, rtol=1e-6)


def test_what_a_record_cannot_say_is_known_beforehand():
    """The sum of the first two alone matters, and the third: F = 25 a a', a = (1, 1, 0), and 4 for the third."""

    def function(z):
        return np.concatenate([np.tile(z[:, :1] + z[:, 1:2], (1, 25)), 2 * z[:, 2:]], axis=1)

    target = forward.model(function, 3, [forward.block(np.zeros(26), 1.0)]).posterior
    covariance = expected_covariance(target, np.zeros(0), 0)
    exact = np.eye(3)
    exact[:2, :2] = np.linalg.inv(np.eye(2) + 25 * np.ones((2, 2)))
    exact[2, 2] = 1 / 5
    np.testing.assert_allclose(covariance, exact, atol=1e-6)
    (one,) = directions(covariance, ["k1", "k2", "m"])
    assert one.name == "0.71 k1 - 0.71 k2" and one.variance == pytest.approx(1.0)


def test_directions_that_are_identified_are_not_named():
    assert directions(np.diag([0.4, 0.1]), ["a", "b"]) == ()
    assert [d.name for d in directions(np.diag([0.4, 0.9]), ["a", "b"])] == ["b"]


@pytest.mark.slow
def test_as_many_draws_are_kept_as_are_asked_for():
    def ridge(vectors):
        # thin and curved: walkers forget slowly
        return (
            -0.5 * (vectors**2).sum(axis=1)
            - 0.5 * (((1 + vectors[:, 0] / 5) * (1 + vectors[:, 1] / 5) - 1) / 1e-3) ** 2
        )

    factor = np.linalg.cholesky(np.linalg.inv(np.eye(2) + np.ones((2, 2)) / 25 / 1e-6))
    for asked, kept in ((4000, 1000), (101, 26)):
        assert sample(ridge, np.zeros(2), factor, draws=asked, chains=4, seed=1).vectors.shape == (4, kept, 2)


def test_the_standard_error_of_a_shift_is_that_of_uneven_weights():
    """Weights that do not depend on the inputs shift their means by chance alone: as often as a normal number would."""
    rng, beyond, largest = np.random.default_rng(3), 0, []
    for _ in range(400):
        draws, weights = rng.standard_normal((24, 9)), np.exp(rng.normal(size=24))
        weights /= weights.sum()
        shifts = np.abs(weights @ draws - draws.mean(axis=0))
        check = PosteriorCheck(24, 1 / (24 * float((weights**2).sum())), float(shifts.max()), 1.0, 0, 2)
        beyond += int((shifts > 1.96 * check.chance).sum())
        largest.append(check.shift / check.chance)
    assert 0.03 < beyond / (400 * 9) < 0.07
    assert 1.5 < np.median(largest) < 2.2  # of nine inputs: a large shift is no sign of an error
    assert PosteriorCheck(24, 1.0, 0.0, 1.0, 0, 2).chance == 0.0
    assert PosteriorCheck(24, 0.0, np.inf, np.inf, 24, 2).chance == np.inf


def two_normals(seed, inputs):
    """Make two normal densities of known shares; return log-density, means, factors of covariances and log-masses."""
    generator = np.random.default_rng(seed)
    means = generator.standard_normal((2, inputs))
    factors = np.array([np.linalg.qr(generator.standard_normal((inputs, inputs)))[0] for _ in range(2)])
    factors = factors * 10 ** generator.uniform(-2.5, -1.5, (2, 1, inputs))
    masses = generator.uniform(-3, 3, 2)
    covariances = factors @ factors.swapaxes(1, 2)

    def log_density(vectors):
        each = [
            mass
            - 0.5 * np.einsum("ki,ij,kj->k", vectors - mean, np.linalg.inv(cov), vectors - mean)
            - 0.5 * np.linalg.slogdet(cov)[1]
            for mass, mean, cov in zip(masses, means, covariances, strict=True)
        ]
        return np.logaddexp(*each)

    return log_density, means, np.linalg.cholesky(covariances), masses, np.linalg.inv(covariances)


@pytest.mark.thorough
@pytest.mark.parametrize("inputs", [1, 2, 6])
@pytest.mark.parametrize("seed", range(4))
def test_draws_about_two_maxima_are_in_proportion_to_their_probability(seed, inputs):
    """Two normal distributions far apart, of random shares, widths and directions."""
    log_density, means, factors, masses, hessians = two_normals(seed, inputs)
    parts, kept = Parts.separate(list(means), list(hessians))
    assert kept == [0, 1]
    found = []
    for k in range(2):
        density = parts.density(k, log_density)
        within = 4.0 + 3.0 * np.sqrt(inputs)
        draws = sample(density, means[k], factors[k], draws=1000, chains=2, seed=k, within=within)
        mass = log_mass_of(density, means[k], factors[k], draws, 7 + k, within)
        assert mass == pytest.approx(masses[k], abs=0.05)
        found.append(PartOfPosterior(None, means[k], draws, mass))
    both = combined_draws(found, seed)
    share = 1 / (1 + np.exp(masses[1] - masses[0]))
    assert both.vectors.shape == (2, 500, inputs)
    np.testing.assert_allclose((parts.of(both.flat) == 0).mean(), share, atol=0.02)
    # the order of the draws in a chain says nothing about their maximum
    halves = (parts.of(both.flat) == 0).reshape(2, 2, 250).mean(axis=2)
    np.testing.assert_allclose(halves, share, atol=0.15)


def test_maxima_that_are_near_share_their_draws():
    parts, kept = Parts.separate([np.zeros(2), np.array([2.0, 0.0]), np.array([0.0, 5.0])], 3 * [np.eye(2)])
    assert kept == [0, 2]
    assert parts.of(np.array([[0.0, 2.4], [0.0, 2.6]])).tolist() == [0, 1]


@pytest.mark.thorough
def test_a_posterior_with_two_maxima_is_that_of_a_quadrature():
    """The likelihood does not know the sign; the prior prefers none."""

    def function(z):
        return np.tile(np.abs(z[:, :1]) ** 1.5 + 0.1 * z[:, :1], (1, 40))

    values = 1.0 + 0.2 * np.random.default_rng(0).standard_normal(40)
    found, _ = inferred(function, function, values, 0.2, inputs=1)
    z = np.linspace(-3, 3, 60_001)
    log = -0.5 * ((function(z[:, None]) - values) ** 2).sum(axis=1) / 0.04 - 0.5 * z**2
    weights = np.exp(log - log.max())
    weights /= weights.sum()
    share = float(weights[z > 0].sum())
    flat = found.draws.flat[:, 0]
    assert not found.widened and len(found.modes) == 2 and 0.1 < share < 0.9
    assert (flat > 0).mean() == pytest.approx(share, abs=0.03)
    for side in (1, -1):
        own, there = flat[flat * side > 0], np.where(z * side > 0, weights, 0.0)
        mean = (there @ z) / there.sum()
        sd = np.sqrt((there @ (z - mean) ** 2) / there.sum())
        assert own.mean() == pytest.approx(mean, abs=0.15 * sd)
        assert own.std() == pytest.approx(sd, rel=0.1)
    # a prediction takes the surrogate about the nearest maximum
    at = np.array([[found.modes[0].vector[0]], [found.modes[1].vector[0]]])
    np.testing.assert_allclose(found.target.predictions(at)[0][0], function(at), atol=0.01)
