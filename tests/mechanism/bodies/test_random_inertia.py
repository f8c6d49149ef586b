"""Random inertia: inside the cone of physical ones, with the mean, the dispersion and the distribution that are stated."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.stats
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.mechanism import random_variables
from uqmbd.randomness import JointInput
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Revolute, Spherical
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import Torque

BODY = (0.02, 0.03, 0.04, 0.002, -0.003, 0.001)
FLAT = (0.01, 0.02, 0.03, 0.004, 0.0, 0.0)
ROD = (0.0, 0.02, 0.02)
PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def tensor(entries):
    """Symmetric matrices, shape (..., 3, 3), of six entries, (..., 6)."""
    found = np.empty((*np.shape(entries)[:-1], 3, 3))
    for k, (i, j) in enumerate(PLACES):
        found[..., i, j] = found[..., j, i] = np.asarray(entries)[..., k]
    return found


def second_moments(inertia):
    return np.trace(inertia, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) / 2 - inertia


def variables(entries):
    return sorted(set().union(*(random_variables(sympy.sympify(x)) for x in entries)), key=str)


def values(entries, inputs, numbers):
    """Entries, shape (K, entry), at numbers of their random variables, shape (K, input)."""
    function = sympy.lambdify(inputs, entries, "numpy")
    return np.stack(np.broadcast_arrays(*function(*numbers.T)), axis=-1)


def samples(entries, count, seed):
    inputs = variables(entries)
    uniform = scipy.stats.qmc.Sobol(len(inputs), seed=seed).random(count)
    return values(entries, inputs, JointInput.of(inputs).from_uniform(uniform))


def six(mean):
    return (*mean, 0, 0, 0) if len(mean) == 3 else mean


@pytest.mark.thorough
@pytest.mark.parametrize(("mean", "dispersion"), [(BODY, 0.1), (BODY, 0.8), (FLAT, 0.7), (ROD, 0.6), ((1, 1, 2), 0.4)])
def test_none_of_100000_samples_is_outside_the_cone(mean, dispersion):
    """Second moments of mass are positive semi-definite: so are moments of inertia, and the triangle inequality holds."""
    drawn = tensor(samples(uqmbd.random_inertia(mean, dispersion), 2**17, seed=2)[:100_000])
    moments = np.linalg.eigvalsh(drawn)
    size = moments[:, 2]
    outside = (moments[:, 0] < -1e-14 * size) | (moments[:, 2] > (moments[:, 0] + moments[:, 1]) * (1 + 1e-14))
    assert not outside.any()
    assert (np.linalg.eigvalsh(second_moments(drawn))[:, 0] >= -1e-14 * size).all()
    assert drawn.mean(axis=0) == pytest.approx(tensor(six(mean)), abs=4e-3 * max(mean))


def closed_covariance(mean, dispersion):
    """Covariance of the second moments of mass: ``delta^2 / (n + 1) (S_ik S_jl + S_il S_jk)``."""
    second = second_moments(tensor(np.array(six(mean), dtype=float)))
    rank = np.linalg.matrix_rank(second, tol=1e-10 * np.trace(second))
    both = np.einsum("ik,jl->ijkl", second, second) + np.einsum("il,jk->ijkl", second, second)
    return second, dispersion**2 / (rank + 1) * both


@settings(max_examples=8, deadline=None)
@given(
    st.lists(st.floats(0.05, 1), min_size=3, max_size=3),
    st.lists(st.floats(-1, 1), min_size=3, max_size=3),
    st.floats(0.02, 0.75),
    st.integers(2, 3),
)
@pytest.mark.thorough
def test_mean_and_covariance_are_exactly_those_that_are_stated(axes, turn, dispersion, rank):
    """Entries are quadratic in independent variables, so that Gauss rules of three points integrate them exactly."""
    axes = np.array(axes) * (np.arange(3) < rank)
    rotation = scipy.spatial.transform.Rotation.from_rotvec(turn).as_matrix()
    second = rotation @ np.diag(axes) @ rotation.T
    inertia = np.trace(second) * np.eye(3) - second
    entries = uqmbd.random_inertia(inertia, dispersion)
    inputs = variables(entries)
    assert len(inputs) == rank * (rank + 1) // 2
    space = uqmbd.extend.GermSpace.of(JointInput.of(inputs))
    rule = uqmbd.extend.gauss_tensor(space, 3)
    order = [JointInput.of(inputs).names.index(v.name) for v in inputs]
    drawn = second_moments(tensor(values(entries, inputs, space.to_inputs(rule.nodes)[:, order])))
    expected, covariance = closed_covariance([inertia[i, j] for i, j in PLACES], dispersion)
    mean = np.einsum("k,kij->ij", rule.weights, drawn)
    assert mean == pytest.approx(expected, abs=1e-10 * np.trace(expected))
    off = drawn - mean
    found = np.einsum("n,nij,nkl->ijkl", rule.weights, off, off)
    assert found == pytest.approx(covariance, abs=1e-9 * covariance.max())
    root = np.linalg.pinv(rotation @ np.diag(np.sqrt(axes)))
    whitened = root @ off @ root.T  # G - I
    stated = np.sqrt(np.einsum("n,nij->", rule.weights, whitened**2) / rank)
    assert stated == pytest.approx(dispersion, rel=1e-8)


@pytest.mark.thorough
def test_samples_are_those_of_a_wishart_distribution():
    """Eigenvalues of the second moments over their mean, against SciPy's Wishart matrices of the same degrees of freedom."""
    freedom = 16
    dispersion = np.sqrt(4 / freedom)
    drawn = second_moments(tensor(samples(uqmbd.random_inertia((1, 1, 1), dispersion), 2**14, seed=5))) * 2
    theirs = scipy.stats.wishart(freedom, np.eye(3) / freedom).rvs(2**14, random_state=6)
    ours, other = np.linalg.eigvalsh(drawn), np.linalg.eigvalsh(theirs)
    for k in range(3):
        assert scipy.stats.ks_2samp(ours[:, k], other[:, k]).pvalue > 1e-3
    assert scipy.stats.ks_2samp(drawn[:, 0, 1], theirs[:, 0, 1]).pvalue > 1e-3
    fewer = scipy.stats.wishart(freedom - 2, np.eye(3) / (freedom - 2)).rvs(2**14, random_state=6)
    assert scipy.stats.ks_2samp(ours[:, 0], np.linalg.eigvalsh(fewer)[:, 0]).pvalue < 1e-6  # the test can tell


@pytest.mark.parametrize(("mean", "count"), [(0.3, 1), (ROD, 1), (FLAT, 3), (BODY, 6)])
def test_a_flat_body_stays_flat_and_a_rod_a_rod(mean, count):
    made = uqmbd.random_inertia(mean, 0.2, "arm.inertia")
    entries = [made] if np.ndim(mean) == 0 else list(made)
    inputs = variables(entries)
    assert len(inputs) == count and all(v.name.startswith("arm.inertia") for v in inputs)
    drawn = samples(entries, 64, seed=1)
    if count == 1:  # one factor of all entries
        mean = np.atleast_1d(np.array(six(mean) if np.ndim(mean) else mean, dtype=float))
        factor = drawn.max(axis=1) / mean.max()
        assert drawn == pytest.approx(factor[:, None] * mean, rel=1e-12)
        assert inputs[0].mean == pytest.approx(1) and float(inputs[0].distribution.mom(2)) == pytest.approx(1.04)
    else:
        ranks = np.linalg.matrix_rank(second_moments(tensor(drawn)), tol=1e-9)
        assert set(ranks) == {2 if count == 3 else 3}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (((0.02, 0.03, 0.04), 0.9), "less than 0.8165"),
        (((0.01, 0.02, 0.03), 0.8), "less than 0.7746.*flat"),
        ((0.1, 0.75), "less than 0.7071"),
        ((0.1, 0), "dispersion is 0"),
        ((0.1, "much"), "dispersion is 'much'"),
        ((0, 0.1), "expected more than 0"),
        (((0, 0, 0), 0.1), "point mass"),
        ((-1, 0.1), "expected 0 or more"),
        (((1, 1, 3), 0.1), "the inertia tensor is physically impossible"),
        (((1, 1, 2.001), 0.1), r"Use the nearest possible tensor: \(1.0005, 1.0005, 2.001, "),
        ((uqmbd.RandomVariable("j", __import__("chaospy").Uniform(1, 2)), 0.1), "depends on j"),
        (((1, 2), 0.1), "expected a 3 x 3 matrix"),
    ],
)
def test_what_cannot_vary_so_is_refused(arguments, said):
    with pytest.raises(uqmbd.StudyError, match=said):
        uqmbd.random_inertia(*arguments)


def test_the_nearest_tensor_that_a_message_names_is_taken():
    assert len(variables(uqmbd.random_inertia((1.0005, 1.0005, 2.001, 0, 0, 0), 0.1))) == 3


def test_two_bodies_need_two_names():
    mechanism = uqmbd.Mechanism("two", uqmbd.Spatial())
    for name in ("a", "b"):
        body = mechanism.body(name, mass=1, inertia=uqmbd.random_inertia(BODY, 0.1), position=(0, 0, 0))
        mechanism.output(name, body.inertia[0])
    with pytest.raises(uqmbd.StudyError, match="exists twice"):
        list(mechanism.inputs.names)


def spinning_top(dispersion):
    """A top on a spherical joint, drawn aslant and spinning: its motion depends on all entries of the tensor."""
    mechanism = uqmbd.Mechanism("top", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    inertia = uqmbd.random_inertia((0.010, 0.012, 0.006, 0.001, 0.0005, -0.0008), dispersion, "top.inertia")
    top = mechanism.body("top", mass=1.0, inertia=inertia, position=(0.1, 0, 0.2), angular_velocity=(3, 1, 12))
    mechanism.add(Spherical("tip", mechanism.ground, top, at=(0, 0, 0)))
    mechanism.output("x", top.position[0], units="m")
    mechanism.output("z", top.position[2], units="m")
    return mechanism


@pytest.mark.thorough
@pytest.mark.parametrize("method", [Collocation(order=3), Galerkin(order=3)], ids=["collocation", "galerkin"])
def test_a_spatial_mechanism_by_chaos_and_by_monte_carlo(method):
    study = uqmbd.Study("top", spinning_top(0.1), np.linspace(0, 0.4, 5), [])
    sampled = study.propagate(MonteCarlo(samples=4000, seed=4))["statistics"].dataset
    found = study.propagate(method)["statistics"].dataset
    for name in ("mean", "std"):
        off = (found[name] - sampled[name]).values[:, 1:]
        noise = sampled[f"std_error_{name}"].values[:, 1:]
        assert (np.abs(off) <= 4 * noise + 1e-12).all(), name
    assert (sampled["std"].values[:, -1] > 1e-4).all()


def test_every_product_is_a_tensor_entry():
    """The order of the entries is that of a body: Jxx, Jyy, Jzz, Jxy, Jxz, Jyz."""
    entries = uqmbd.random_inertia(BODY, 1e-6)
    inputs = variables(entries)
    means = np.array([[v.mean for v in inputs]])
    assert values(entries, inputs, means)[0] == pytest.approx(BODY, rel=1e-9)


@pytest.mark.thorough
def test_a_planar_body_under_a_torque_has_the_moments_of_the_closed_form():
    """The angle is ``torque t^2 / (2 J)``, and 1 / J of a gamma distributed J has mean ``1 / (J0 (1 - delta^2))``."""
    inertia, dispersion = 0.3, 0.15
    mechanism = uqmbd.Mechanism("disk", uqmbd.Planar())
    disk = mechanism.body("disk", mass=1, inertia=uqmbd.random_inertia(inertia, dispersion, "disk.inertia"))
    mechanism.add(Revolute("axle", mechanism.ground, disk, point_i=(0, 0), point_j=(0, 0)))
    mechanism.add(Torque("drive", disk, torque=0.2))
    mechanism.output("angle", disk.angle, units="rad")
    assert mechanism.inputs.names == ("disk.inertia",)
    study = uqmbd.Study("disk", mechanism, [0, 0.5, 1], rtol=1e-9)
    freedom = 1 / dispersion**2
    factor = 0.5 * 0.2 / inertia
    mean = factor * freedom / (freedom - 1)
    std = mean / np.sqrt(freedom - 2)
    for method in (Collocation(order=6), Galerkin(order=6)):
        found = study.propagate(method)["statistics"].dataset
        assert float(found["mean"][0, -1]) == pytest.approx(mean, rel=1e-7)
        assert float(found["std"][0, -1]) == pytest.approx(std, rel=1e-5)


MASS, CENTRE = 2.0, (0.3, -0.1, 0.2)


def pseudo(mass, centre, second):
    """Pseudo-inertia, shape (..., n, n): mass, first and second moments about the origin of the frame."""
    extended = np.concatenate([np.ones((*np.shape(mass), 1)), centre], axis=-1)
    found = mass[..., None, None] * extended[..., :, None] * extended[..., None, :]
    found[..., 1:, 1:] += second
    return found


def drawn_bodies(body, numbers, inputs):
    """Mass (K,), centre (K, d) and second moments about it (K, d, d); half of the inertia each in the plane."""
    spatial = isinstance(body.inertia, tuple)
    inertia = body.inertia if spatial else (body.inertia,)
    found = values((body.mass, *body.centre, *inertia), inputs, numbers)
    dimension = len(body.centre)
    mass, centre, rest = found[:, 0], found[:, 1 : 1 + dimension], found[:, 1 + dimension :]
    return mass, centre, second_moments(tensor(rest)) if spatial else rest[:, 0]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("inertia", "dispersion"), [(BODY, 0.1), (BODY, 0.84), (FLAT, 0.8), (ROD, 0.7), ((1, 1, 2), 0.4)]
)
def test_none_of_100000_random_bodies_is_unphysical(inertia, dispersion):
    """All pseudo-inertias are positive semi-definite; mean and covariance are those of the closed form."""
    body = uqmbd.random_body_inertia(MASS, CENTRE, inertia, dispersion)
    inputs = variables((body.mass, *body.centre, *body.inertia))
    uniform = np.random.default_rng(5).random((100_000, len(inputs)))
    mass, centre, second = drawn_bodies(body, JointInput.of(inputs).from_uniform(uniform), inputs)
    size = np.trace(second, axis1=1, axis2=2)
    assert (mass > 0).all()
    assert (np.linalg.eigvalsh(second)[:, 0] >= -1e-14 * size).all()
    moments = np.linalg.eigvalsh(size[:, None, None] * np.eye(3) - second)
    assert (moments[:, 2] <= (moments[:, 0] + moments[:, 1]) * (1 + 1e-14)).all()
    found = pseudo(mass, centre, second)
    expected = pseudo(np.array(MASS), np.array(CENTRE), second_moments(tensor(np.array(six(inertia), dtype=float))))
    rank = np.linalg.matrix_rank(expected, tol=1e-10 * np.trace(expected))
    both = np.einsum("ik,jl->ijkl", expected, expected) + np.einsum("il,jk->ijkl", expected, expected)
    covariance = dispersion**2 / (rank + 1) * both
    deviation = np.sqrt(np.einsum("ijij->ij", covariance))
    assert (np.abs(found.mean(axis=0) - expected) <= 5 * deviation / np.sqrt(len(mass))).all()
    off = found - expected
    scale = np.einsum("ij,kl->ijkl", deviation, deviation)
    sampled = np.einsum("nij,nkl->ijkl", off, off) / len(mass)
    assert (np.abs(sampled - covariance) <= 0.06 * scale + 1e-14).all()
    # the scatter of the centre: that of a normal over chi distributed one
    freedom = (rank + 1) / dispersion**2
    about = second_moments(tensor(np.array(six(inertia), dtype=float))) / (MASS * (freedom - 2))
    assert np.cov(centre.T) == pytest.approx(about, abs=0.05 * about.max())


@pytest.mark.thorough
def test_mean_and_covariance_of_the_pseudo_inertia_are_exact():
    """It is quadratic in independent variables: a Gauss rule of three points integrates its products exactly."""
    body = uqmbd.random_body_inertia(MASS, CENTRE, FLAT, 0.5)
    inputs = variables((body.mass, *body.centre, *body.inertia))
    space = uqmbd.extend.GermSpace.of(JointInput.of(inputs))
    rule = uqmbd.extend.gauss_tensor(space, 3)
    order = [JointInput.of(inputs).names.index(v.name) for v in inputs]
    found = pseudo(*drawn_bodies(body, space.to_inputs(rule.nodes)[:, order], inputs))
    expected = pseudo(np.array(MASS), np.array(CENTRE), second_moments(tensor(np.array(FLAT))))
    assert np.einsum("k,kij->ij", rule.weights, found) == pytest.approx(expected, abs=1e-10)
    both = np.einsum("ik,jl->ijkl", expected, expected) + np.einsum("il,jk->ijkl", expected, expected)
    off = found - expected
    covariance = np.einsum("n,nij,nkl->ijkl", rule.weights, off, off)
    assert covariance == pytest.approx(0.5**2 / 4 * both, abs=1e-9)


@pytest.mark.thorough
def test_planar_bodies_rods_and_point_masses_are_random_too():
    body = uqmbd.random_body_inertia(2.0, (0.3, -0.1), 0.05, 0.4)
    inputs = variables((body.mass, *body.centre, body.inertia))
    uniform = np.random.default_rng(6).random((100_000, len(inputs)))
    mass, centre, inertia = drawn_bodies(body, JointInput.of(inputs).from_uniform(uniform), inputs)
    assert (mass > 0).all() and (inertia > 0).all()
    about_mean = inertia + mass * ((centre - [0.3, -0.1]) ** 2).sum(axis=1)
    # second moments about the mean centre: a Wishart matrix of two rows, whose trace varies by delta / 2
    assert about_mean.mean() == pytest.approx(0.05, rel=5e-3)
    assert about_mean.std() == pytest.approx(0.05 * 0.4 / 2, rel=0.02)
    assert mass.std() == pytest.approx(2 * 0.4 * np.sqrt(2 / 4), rel=0.02)
    assert inertia.mean() == pytest.approx(0.05 * (1 - 0.4**2 / 4), rel=5e-3)
    point = uqmbd.random_body_inertia(2.0, (0.3, -0.1, 0), (0, 0, 0), 0.4)
    assert point.inertia == (0,) * 6 and [float(x) for x in point.centre] == [0.3, -0.1, 0]


def test_a_body_with_random_mass_properties_moves():
    """The moment about a fixed axis is linear in the pseudo-inertia: so is the speed after a given push, over it."""
    mechanism = uqmbd.Mechanism("arm", uqmbd.Spatial())
    random = uqmbd.random_body_inertia(2.0, (0.5, 0, 0), (0.02, 0.05, 0.06), 0.1, name="arm")
    arm = mechanism.body("arm", mass=random.mass, inertia=random.inertia, position=random.centre)
    pivot = tuple(-x for x in random.centre)
    mechanism.add(
        Revolute("pivot", mechanism.ground, arm, point_i=(0, 0, 0), point_j=pivot, axis_i=(0, 0, 1), axis_j=(0, 0, 1))
    )
    mechanism.add(Torque("push", arm, torque=(0, 0, 3.0)))
    mechanism.output("inverse_moment", arm.angular_velocity[2] / (3.0 * 0.2))
    study = uqmbd.Study("arm", mechanism, [0, 0.2], [Collocation(order=2, method="regression", verify=0)])
    data = study.run()["collocation/statistics"]
    moment = 0.06 + 2 * 0.25
    # of a gamma distributed moment of this mean: 1 / moment has the mean n / (n - 1)
    variation = 0.1 * np.sqrt(2 / 5)
    assert data["mean"].values[0, 1] == pytest.approx((1 + variation**2) / moment, rel=2e-3)
    assert data["std"].values[0, 1] == pytest.approx(variation / moment, rel=0.05)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"mass": 0}, "mass is 0 kg; expected more than 0"),
        ({"centre": (1, 2, 3, 4)}, "two numbers in planar space, or three numbers"),
        ({"inertia": 0.1}, "inertia"),
        ({"inertia": (1, 1, 3)}, "the inertia tensor is physically impossible"),
        ({"dispersion": 0.9}, "less than 0.8452"),
        ({"centre": (uqmbd.t, 0, 0)}, "depends on"),
    ],
)
def test_random_bodies_that_cannot_be_are_refused(changes, said):
    arguments = {"mass": 1, "centre": (0, 0, 0), "inertia": (1, 1, 1), "dispersion": 0.1, **changes}
    with pytest.raises(uqmbd.StudyError, match=said):
        uqmbd.random_body_inertia(**arguments)
