"""The stated error of variances: Lyapunov's equation, quadrature and residues of high precision in random systems."""

import mpmath
import numpy as np
import pytest
import scipy.linalg

import uqmbd
from uqmbd_processes import PowerSpectralDensity, RandomProcess, exponential_covariance, kanai_tajimi
from uqmbd_processes.lyapunov import is_stable
from uqmbd_processes.quadrature import TOLERANCE
from uqmbd_processes.rational import CharacteristicPolynomials, rational_variance
from uqmbd_processes.spectral_moments import moments


def draw(rng, count, n):
    """Draw damped systems of n coupled masses: frequency ratios up to 1e4 and damping ratios down to 1e-5."""
    w, z = 10 ** rng.uniform(0, 4, (count, n)), 10 ** rng.uniform(-5, 0, (count, n))
    turn = np.linalg.qr(rng.normal(size=(count, n, n)))[0]
    weight = 10 ** rng.uniform(-0.5, 0.5, (count, n))
    a = np.zeros((count, 2 * n, 2 * n))
    a[:, :n, n:] = np.eye(n)
    for columns, values in ((slice(n), w**2), (slice(n, 2 * n), 2 * z * w)):
        a[:, n:, columns] = -weight[:, :, None] * (turn * values[:, None]) @ turn.transpose(0, 2, 1) * weight[:, None]
    b, c = np.zeros((count, 2 * n, 1)), np.zeros((count, 2 * n))
    b[:, n:, 0], c[:, :n] = rng.normal(size=(count, n)), rng.normal(size=(count, n))
    return a, b, c


def system(a, b, c, source):
    """Return the linear systems that respond to a process."""
    count = len(a)
    channel = uqmbd.extend.Channel(source, np.ones(count), np.zeros(count))
    return uqmbd.extend.LinearSystem(a, b, c, np.zeros((count, 3, 1)), np.zeros(count), (channel,), "y")


def processes(kind, length):
    """Return a process with a shaping filter, and one with the same density without a filter."""
    if kind == "exponential":
        density = PowerSpectralDensity(lambda w: length / np.pi / (1 + (length * w) ** 2), "two", "rad/s")
        return RandomProcess("f", covariance=exponential_covariance(1.0, length)), RandomProcess("f", psd=density)
    ground = kanai_tajimi(0.01, 1 / length, 0.02)
    return RandomProcess("f", psd=ground), RandomProcess("f", psd=PowerSpectralDensity(ground.function, "two", "rad/s"))


def residues(a, b, c, length):
    """Return the variance under the covariance ``exp(-|t| / length)`` by partial fractions with 50 digits."""
    with mpmath.workdps(50):
        values, vectors = mpmath.eig(mpmath.matrix(a.tolist()))
        right = mpmath.lu_solve(vectors, mpmath.matrix(b.tolist()))
        left = mpmath.matrix([c.tolist()]) * vectors
        rate = 1 / mpmath.mpf(length)
        shares = [left[k] * right[k] * mpmath.sqrt(2 * rate) / (x + rate) for k, x in enumerate(values)]
        poles, shares = [*values, -rate], [*shares, -sum(shares)]
        total = mpmath.mpf(0)
        for x, p in zip(shares, poles, strict=True):
            for y, q in zip(shares, poles, strict=True):
                total -= x * mpmath.conj(y) / (p + mpmath.conj(q))
        return float(total.real)


def compare(rng, count, n, kind, exact):
    """Compare both routes in random systems, and with residues in some; return the number of refused systems."""
    a, b, c = draw(rng, count, n)
    length = float(10 ** rng.uniform(-3, 1))
    (one, first), (two, second) = (moments(system(a, b, c, source), (0, 2)) for source in processes(kind, length))
    good = np.array([not x and not y for x, y in zip(first, second, strict=True)])
    assert is_stable(a).all()
    for k in (0, 2):
        assert two[k][good] == pytest.approx(one[k][good], rel=TOLERANCE, abs=0)
    assert all("above 1e-06" in x for x in (*first, *second) if x)
    if kind == "exponential":
        reference = [residues(a[k], b[k], c[k], length) for k in range(exact)]
        for found, reasons in ((one[0], first), (two[0], second)):
            kept = [k for k in range(exact) if not reasons[k]]
            assert found[kept] == pytest.approx([reference[k] for k in kept], rel=TOLERANCE, abs=0)
    return int((~good).sum())


@pytest.mark.parametrize("kind", ["exponential", "narrow"])
def test_both_routes_and_residues_agree_within_the_stated_error(kind):
    rng = np.random.default_rng(11)
    assert sum(compare(rng, 40, n, kind, 1 if n < 5 else 0) for n in (1, 2, 3, 4, 5)) <= 2


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["exponential", "narrow"])
@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6])
def test_both_routes_and_residues_agree_in_thousands_of_systems(n, kind):
    rng = np.random.default_rng(n)
    assert sum(compare(rng, 50, n, kind, 3) for _ in range(10)) <= 10


def test_a_rigid_body_motion_does_not_affect_the_error_of_other_motions():
    rng, length = np.random.default_rng(7), 0.3
    for _ in range(3):
        a, b, c = (x[0] for x in draw(rng, 1, 2))
        order = [0, 1, 4, 2, 3, 5]
        whole = np.zeros((6, 6))
        whole[:4, :4], whole[4, 5] = a, 1.0
        turn = np.kron(np.eye(2), np.linalg.qr(rng.normal(size=(3, 3)))[0])
        whole = turn @ whole[np.ix_(order, order)] @ turn.T
        driven = turn @ np.vstack([b, np.zeros((2, 1))])[order]
        seen = turn @ np.append(c, [1.0, 0.5])[order]
        for source in processes("exponential", length):
            found, reasons = moments(system(whole[None], driven[None], seen[None], source), (0,))
            assert reasons == [""]
            assert found[0] == pytest.approx([residues(a, b, c, length)], rel=TOLERANCE)


@pytest.mark.parametrize("damping", [2.0, 2.0 * (1 + 1e-9), 2.0 * (1 - 1e-12), 0.3, 40.0])
def test_an_oscillator_has_the_closed_form_also_with_equal_eigenvalues(damping):
    """For ``y'' + c y' + k y = f`` and the covariance ``exp(-r |t|)`` it is ``(c + r) / (c k (k + c r + r^2))``."""
    a, b, c = np.array([[[0.0, 1.0], [-1.0, -damping]]]), np.array([[[0.0], [1.0]]]), np.array([[1.0, 0.0]])
    assert is_stable(a).all()
    for source in processes("exponential", 0.5):
        found, reasons = moments(system(a, b, c, source), (0,))
        assert reasons == [""]
        assert found[0] == pytest.approx([(damping + 2) / (damping * (1 + 2 * damping + 4))], rel=TOLERANCE)


def test_stability_of_rigid_body_motions_and_slow_motions():
    free, slow = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0, 1.0], [-1e-6, -1e-8]])
    undamped = np.array([[0.0, 1.0], [-1e6, 0.0]])
    for a, expected in ((free, False), (slow, True), (undamped, False), (1e5 * slow, True), (slow.T, True)):
        assert is_stable(np.stack([a] * 3)).tolist() == [expected] * 3
    mixed = np.stack([free, slow, undamped])
    assert all(is_stable(mixed).tolist() == [False, True, False] for _ in range(20))


def test_clear_stability_is_that_of_the_eigenvalues():
    generator = np.random.default_rng(0)
    for n in range(1, 11):
        systems = generator.normal(size=(2000, n, n)) - generator.uniform(0, 4, size=(2000, 1, 1)) * np.eye(n)
        decays = np.linalg.eigvals(systems).real.max(axis=1) < 0
        np.testing.assert_array_equal(is_stable(systems), decays)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_bounds_of_variances_by_polynomials_contain_the_residues(n):
    rng, length = np.random.default_rng(n), 0.3
    a, b, c = draw(rng, 8, n)
    source = processes("exponential", length)[0]
    assert source.shape is not None
    value, error = rational_variance(system(a, b, c, source), CharacteristicPolynomials.of(a), source.shape, 0)
    usable = np.flatnonzero(np.isfinite(error))
    assert len(usable) >= 3
    expected = np.array([residues(a[k], b[k], c[k], length) for k in usable])
    assert (np.abs(value[usable] - expected) <= error[usable] + 1e-15 * expected).all()


def test_variances_by_polynomials_are_those_of_lyapunov_with_a_direct_response():
    """The sum of a position and of the force itself, at different speeds along the process."""
    rng, count = np.random.default_rng(3), 50
    a, b, c = draw(rng, count, 2)
    for kind in ("exponential", "narrow"):
        source = processes(kind, 0.3)[0]
        one = system(a, b, c, source)
        one.e[:, 0, 0], one.channels[0].speed[:] = rng.normal(size=count), rng.uniform(0.3, 30, count)
        value, error = rational_variance(one, CharacteristicPolynomials.of(a), source.shape, 0)
        # the augmented system of response and filter
        af, bf, cf = source.shape.matrices
        good = np.flatnonzero(error <= 1e-8 * value)
        assert len(good) > 20
        for k in good[:10].tolist():
            speed = one.channels[0].speed[k]
            whole = np.block([[a[k], b[k] * cf], [np.zeros((len(bf), 4)), speed * af]])
            noise = np.append(np.zeros(4), np.sqrt(speed) * bf)
            row = np.append(c[k], one.e[k, 0, 0] * cf)
            expected = row @ scipy.linalg.solve_continuous_lyapunov(whole, -np.outer(noise, noise)) @ row
            assert value[k] == pytest.approx(expected, rel=1e-5)


def test_polynomials_do_not_change_their_systems():
    """A matrix with one state has equal memory with and without a changed order of its axes."""
    systems = np.full((3, 1, 1), -2.0)
    found = CharacteristicPolynomials.of(systems)
    assert (systems == -2.0).all() and found.stable.all()


@pytest.mark.parametrize("n", [1, 2, 6, 9])
def test_polynomials_of_a_realisation_do_not_depend_on_the_others(n):
    rng = np.random.default_rng(n)
    a, b, c = rng.normal(size=(40, n, n)) - 3 * np.eye(n), rng.normal(size=(40, n)), rng.normal(size=(40, n))
    whole = CharacteristicPolynomials.of(a)
    numerators = whole.numerator(c, b)
    for k in range(40):
        one = CharacteristicPolynomials.of(a[k : k + 1])
        for own, other in zip(
            (*one.coefficients, *one.numerator(c[k : k + 1], b[k : k + 1])),
            (*whole.coefficients, *numerators),
            strict=True,
        ):
            assert own.value[0] == other.value[k] and own.error[0] == other.error[k]
