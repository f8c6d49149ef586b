"""Numbers that become random by pattern: their moments, their ranges, possible inertia, and mechanisms written by hand."""

from __future__ import annotations

import copy
import warnings

import chaospy
import numpy as np
import pytest
import scipy.integrate
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.mechanism import random_variables
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Prismatic, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import Bushing, Gravity, PointForce, RotationalFriction, SpringDamper


def rocker(mass=2.0, inertia=0.05, stiffness=50.0, friction=0.1, com=(0.1, 0.0), add=True):
    """A body on a pivot, a spring and friction, with gravity of its own, which takes mass and centre of mass from it."""
    mechanism = uqmbd.Mechanism("rocker", uqmbd.Planar(gravity=(0, -9.81)))
    arm = mechanism.body("arm", mass=mass, inertia=inertia, com=com, position=(0.5, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, arm, at=(0, 0)))
    mechanism.add(SpringDamper("spring", mechanism.ground, arm, (0, 1), (0, 0), stiffness=stiffness, free_length=0.8))
    mechanism.add(RotationalFriction("bearing", mechanism.ground, arm, friction=friction, transition=0.01))
    mechanism.add(Gravity("moon", arm, (0, 4)))
    mechanism.output("height", arm.position[1], units="m")
    mechanism.output("sag", uqmbd.at_equilibrium(arm.position[1]), units="m")
    return mechanism


def by_pattern():
    mechanism = rocker()
    mechanism.randomise(["*.mass", "*.inertia"], relative=0.05)
    mechanism.randomise("spring.stiffness", relative=0.04)
    mechanism.randomise("arm.com.x", absolute=0.01)
    return mechanism


def by_hand():
    made = {
        "mass": uqmbd.RandomVariable("arm.mass", lognormal(2, 0.1), "kg"),
        "inertia": uqmbd.RandomVariable("arm.inertia", lognormal(0.05, 0.0025), "kg m^2"),
        "stiffness": uqmbd.RandomVariable("spring.stiffness", chaospy.Normal(50, 2), "N/m"),
        "com": (uqmbd.RandomVariable("arm.com.x", chaospy.Normal(0.1, 0.01), "m"), 0.0),
    }
    return rocker(**made)


def lognormal(mean, std):
    variance = np.log1p((std / mean) ** 2)
    return chaospy.LogNormal(np.log(mean) - variance / 2, np.sqrt(variance))


@pytest.mark.parametrize(
    "error", [ValueError("no law"), ZeroDivisionError("x"), KeyError("arm"), RecursionError("deep")]
)
def test_a_function_that_raises_is_reported_with_the_number_that_it_was_given(error):
    def made(value):
        raise error

    with pytest.raises(uqmbd.StudyError) as caught:
        rocker().randomise("*.mass", distribution=made)
    told = str(caught.value)
    assert "distribution(2), of arm.mass, raised " + type(error).__name__ in told and str(error) in told
    assert caught.value.__cause__ is error


METHODS = [
    MonteCarlo(samples=8, seed=1),
    pytest.param(Collocation(order=1, verify=2), marks=pytest.mark.thorough),
    pytest.param(Galerkin(order=1, verify=0), marks=pytest.mark.thorough),
]


@pytest.mark.parametrize("method", METHODS)
def test_the_same_bits_as_written_by_hand(method):
    found = [uqmbd.Study("s", make(), np.linspace(0, 0.2, 3)).propagate(method) for make in (by_pattern, by_hand)]
    for part in ("statistics", "scalars/statistics"):
        for name in ("mean", "std"):
            a, b = (node[part][name].values for node in found)
            assert (a == b).all()
            assert name == "mean" or a.max() > 1e-5


def quantiles(variable, count=20001):
    return np.ravel(variable.distribution.inv((np.arange(count) + 0.5) / count))


numbers = st.floats(1e-3, 1e3)


@given(value=numbers, relative=st.floats(0.01, 1.5))
@settings(max_examples=30, deadline=None)
def test_masses_have_the_asked_deviation_and_stay_positive(value, relative):
    mechanism = uqmbd.Mechanism("m", uqmbd.Line())
    mechanism.body("b", mass=value)
    (mass,) = mechanism.randomise("b.mass", relative=relative)
    assert mass.mean == pytest.approx(value, rel=1e-9)
    # chaospy's own moments, by quadrature, and its quantiles, which samples are made of
    assert float(chaospy.Std(mass.distribution)) == pytest.approx(relative * value, rel=1e-5)
    assert quantiles(mass).min() > 0
    assert mass.units == "kg"


@given(value=st.floats(0.02, 0.98), share=st.floats(0.05, 0.3))
@settings(max_examples=30, deadline=None)
def test_numbers_between_two_ends_stay_there(value, share):
    """A coefficient of restitution: the deviation is that asked for, the range is kept."""
    mechanism = uqmbd.Mechanism("m", uqmbd.Line(-9.81))
    ball = mechanism.body("b", mass=1, position=1)
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, 0, 0, 1, restitution=value))
    std = share * min(value, 1 - value)
    (found,) = mechanism.randomise("floor.restitution", absolute=std)
    values = quantiles(found)
    assert values.min() >= 0
    assert values.max() <= 1
    np.testing.assert_allclose([values.mean(), values.std()], [value, std], rtol=5e-3)


rotations = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda e: sum(x * x for x in e) > 0.1)
seconds = st.tuples(*[st.one_of(st.just(0.0), st.floats(0.01, 5))] * 3).filter(lambda s: sum(x > 0 for x in s) > 0)


@pytest.mark.thorough
@given(
    second=seconds, e=st.one_of(st.just((1, 0, 0, 0)), rotations), relative=st.floats(0.02, 1), seed=st.integers(0, 99)
)
@settings(max_examples=40, deadline=None)
def test_every_inertia_is_that_of_a_body(second, e, relative, seed):
    """Tensors of any bodies, rods and plates among them: mean kept, no principal moment above the sum of the others."""
    e = np.array(e) / np.linalg.norm(e)
    turn = np.array(uqmbd.Spatial().rotation(list(e)).tolist(), dtype=float)
    tensor = turn @ (np.eye(3) * sum(second) - np.diag(second)) @ turn.T
    tensor = (tensor + tensor.T) / 2
    mechanism = uqmbd.Mechanism("m", uqmbd.Spatial())
    body = mechanism.body("b", mass=1, inertia=tensor)
    found = mechanism.randomise("b.inertia", relative=relative)
    # a principal moment of zero is rounding on a turned rod: then the whole tensor may have one factor
    assert len(found) in {1, sum(x > 0 for x in second)}
    for variable in found:
        assert variable.mean == pytest.approx(1, rel=1e-9)
        assert float(chaospy.Std(variable.distribution)) == pytest.approx(relative, rel=1e-5)
    entries = body.terms.values["inertia"]
    values = mechanism.inputs.from_uniform(np.random.default_rng(seed).random((20, len(found))))
    evaluate = sympy.lambdify(list(mechanism.inputs.variables), list(entries), "numpy")
    index = [[0, 3, 4], [3, 1, 5], [4, 5, 2]]
    for row in [np.ones(len(found)), *values]:
        j = np.array([float(x) for x in evaluate(*row)])[index]
        moments = np.linalg.eigvalsh(j)
        assert moments[0] >= -1e-9 * moments[2]
        assert moments[2] <= (moments[0] + moments[1]) * (1 + 1e-9) + 1e-9 * moments[2]
        if (row == 1).all():
            np.testing.assert_allclose(j, tensor, atol=1e-12 * abs(tensor).max())


def test_rounded_flat_bodies_keep_their_proportions():
    mechanism = uqmbd.Mechanism("m", uqmbd.Spatial())
    body = mechanism.body("plate", mass=1, inertia=(0.333, 0.333, 0.668))
    (one,) = mechanism.randomise("*.inertia", relative=0.3)
    assert one.name == "plate.inertia"
    assert [sympy.diff(x, one) for x in body.terms.values["inertia"]] == [0.333, 0.333, 0.668, 0, 0, 0]


def spatial():
    mechanism = uqmbd.Mechanism("arm", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    arm = mechanism.body("arm", mass=2, inertia=(0.02, 0.05, 0.06, 0.001, 0, 0), position=(0.5, 0, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, arm, at=(0, 0, 0), axis=(0, 1, 0)))
    mechanism.output("height", arm.position[2], units="m")
    mechanism.randomise("arm.inertia", relative=0.3)
    return mechanism


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("method", "tolerance"),
    [
        (Collocation(order=4), 1e-5),
        (Galerkin(order=4), 1e-5),
        (MonteCarlo(samples=1024, seed=1, sampling="sobol"), 2e-2),
    ],
)
def test_inertia_in_space_in_every_method(method, tolerance):
    """A pendulum whose equation has ``Jyy + m d^2``, integrated by SciPy at the nodes of a Gauss rule."""
    times = np.linspace(0, 0.3, 4)
    found = uqmbd.Study("arm", spatial(), times, rtol=1e-9).propagate(method)["statistics"]
    tensor = np.array([[0.02, 0.001, 0], [0.001, 0.05, 0], [0, 0, 0.06]])
    moments, axes = np.linalg.eigh(tensor)
    share = (moments.sum() / 2 - moments) * (1 - axes[1] ** 2)  # of each second moment in Jyy
    nodes, weights = np.polynomial.hermite_e.hermegauss(6)
    weights = weights / weights.sum()
    sigma = np.sqrt(np.log1p(0.3**2))
    factors = np.exp(sigma * nodes - sigma**2 / 2)
    mean, square = 0, 0
    for i, j, k in np.ndindex(6, 6, 6):
        inertia = share @ factors[[i, j, k]] + 2 * 0.5**2

        def rate(t, y, inertia=inertia):
            return [y[1], -2 * 9.81 * 0.5 * np.cos(y[0]) / inertia]

        height = 0.5 * np.sin(
            scipy.integrate.solve_ivp(rate, (0, 0.3), [0, 0], t_eval=times, rtol=1e-10, atol=1e-12).y[0]
        )
        mean = mean + weights[i] * weights[j] * weights[k] * height
        square = square + weights[i] * weights[j] * weights[k] * height**2
    std = np.sqrt(np.maximum(square - mean**2, 0))
    np.testing.assert_allclose(found["mean"].values[0], mean, rtol=tolerance, atol=1e-7)
    np.testing.assert_allclose(
        found["std"].values[0], std, rtol=10 * tolerance if tolerance < 1e-3 else 0.05, atol=1e-6
    )


def test_what_was_computed_before_is_computed_again():
    """Model, inputs, weights that components took from bodies, and copies that share bodies with the original."""
    mechanism = rocker()
    study = uqmbd.Study("s", mechanism, [0, 0.1])
    twin = copy.copy(mechanism)
    start = study.model
    assert study.model is start
    assert len(twin.inputs) == 0
    (mass,) = mechanism.randomise("arm.mass", relative=0.1)
    assert mechanism.bodies["arm"].mass == mass
    assert random_variables(mechanism.components["moon"].values["mass"]) == {mass}
    assert twin.inputs.names == ("arm.mass",)
    assert study.model is not start
    after = study.propagate(MonteCarlo(samples=4, seed=1))
    assert float(after["statistics"]["std"].max()) > 0


def test_joints_that_were_drawn_in_the_world_may_vary_in_their_bodies():
    mechanism = rocker()
    (x,) = mechanism.randomise("pivot.point_j.x", absolute=0.001)
    assert mechanism.components["pivot"].values["point_j"][0] == x
    assert x.mean == -0.5
    assert uqmbd.Study("s", mechanism, [0, 0.1]).propagate(MonteCarlo(samples=4, seed=1)).attrs["failures"] == 0


def test_what_joints_tell_of_their_motion_follows():
    """A displacement that was asked for before holds the old point, which is told; asked for again it holds the new one."""
    mechanism = uqmbd.Mechanism("slide", uqmbd.Planar())
    body = mechanism.body("body", mass=1, inertia=1, position=(0.3, 0))
    slide = mechanism.add(Prismatic("slide", mechanism.ground, body, (0, 0), (0.1, 0), (1, 0), (1, 0)))
    (x,) = mechanism.randomise("slide.point_j.x", absolute=0.01)
    assert x in slide.displacement.free_symbols
    with pytest.warns(uqmbd.StudyWarning, match=r"slide\.point_i(\.x)? was read before this call.*old number"):
        mechanism.randomise("slide.point_i.x", absolute=0.01)
    assert len(random_variables(slide.displacement)) == 2


def refused(pattern, *words, mechanism=None, **options):
    mechanism = mechanism or rocker()
    inputs = mechanism.inputs.names
    with pytest.raises(uqmbd.StudyError) as caught:
        mechanism.randomise(pattern, **options)
    for word in ("mechanism 'rocker': randomise(", *words):
        assert word in str(caught.value)
    assert mechanism.inputs.names == inputs


def test_messages():
    refused(
        "*.masss",
        "no quantity matches '*.masss'; did you mean 'arm.mass'?",
        "Available: arm.mass, arm.com",
        relative=0.1,
    )
    refused(["*.mass", "leg.com"], "no quantity matches 'leg.com'", relative=0.1)
    refused(3, "expected a pattern", relative=0.1)
    refused("*.mass", "no standard deviation is given")
    refused("*.mass", "relative and absolute are given", relative=0.1, absolute=0.1)
    for bad in (0, -1, True, "0.1", np.nan, np.inf):
        refused("*.mass", "relative is", "above 0", relative=bad)
    refused("*.mass", "expected 'normal'", "chaospy.Uniform(0.9, 1.1)", relative=0.1, distribution="gauss")
    refused("*.mass", "expected 'normal'", distribution=chaospy.Normal)
    refused("*.mass", "neither relative= nor absolute=", relative=0.1, distribution=chaospy.Uniform(0.9, 1.1))
    refused("*.mass", "arm.mass is 2, but must be 0 or more", "0.8", relative=0.4, distribution="normal")
    refused("*.mass", "uniform distribution would extend from", relative=0.8, distribution="uniform")
    refused("*.mass", "exceeds the range 0 or more", distribution=chaospy.Normal(1, 0.5))
    refused("*.mass", "expected a chaospy distribution of the number", distribution=lambda value: value)
    refused("spring.damping", "none of the selected quantities can be randomised: all of them are zero", relative=0.1)
    refused("spring.point_j", "spring.point_j is zero", relative=0.1)
    mechanism = rocker()
    mechanism.randomise("arm.mass", relative=0.05)
    refused("*.mass", "arm.mass is already random (arm.mass)", relative=0.1, mechanism=mechanism)
    mechanism = rocker(stiffness=uqmbd.RandomVariable("arm.mass", chaospy.Normal(50, 1)))
    refused(
        "arm.mass",
        "the mechanism already has a different random variable 'arm.mass'",
        relative=0.1,
        mechanism=mechanism,
    )
    mechanism = spatial()
    with pytest.raises(uqmbd.StudyError, match=r"already random \(arm\.inertia\.1, arm\.inertia\.2"):
        mechanism.randomise("arm.inertia", relative=0.1)
    mechanism = uqmbd.Mechanism("m", uqmbd.Spatial())
    mechanism.body("b", mass=1, inertia=(1, 1, 1))
    with pytest.raises(uqmbd.StudyError, match="inertia tensor, which absolute= could make physically impossible"):
        mechanism.randomise("b.inertia", absolute=0.1)


def test_warnings_name_what_is_left_and_what_was_read():
    mechanism = rocker()
    mechanism.randomise("arm.mass", relative=0.05)
    with pytest.warns(uqmbd.StudyWarning, match=r"not randomised: arm\.mass is already random"):
        assert [v.name for v in mechanism.randomise(["arm.mass", "arm.inertia"], relative=0.1)] == ["arm.inertia"]
    mechanism = rocker()
    weight = 9.81 * mechanism.bodies["arm"].mass
    mechanism.add(PointForce("lift", mechanism.bodies["arm"], (0, 0), (0, weight * sympy.sin(uqmbd.t))))
    with pytest.warns(uqmbd.StudyWarning, match=r"arm\.mass was read before this call.*old number") as told:
        mechanism.randomise("*.mass", relative=0.1)
    assert told[0].filename == __file__
    with pytest.warns(uqmbd.StudyWarning, match=r"lift\.force\.y is not a plain number"):
        mechanism.randomise(["lift.force", "spring.stiffness"], relative=0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # running, checking and drawing a mechanism read nothing for a user
        mechanism = rocker()
        uqmbd.simulate(mechanism, [0, 0.1])
        uqmbd.check(mechanism)
        uqmbd.report.mechanism(mechanism)
        mechanism._repr_html_()
        mechanism.randomise(["*.mass", "*.com.x", "*.inertia", "*.stiffness"], relative=0.1)


def test_distributions_of_ones_own():
    mechanism = rocker()
    (mass,) = mechanism.randomise("arm.mass", distribution=chaospy.Uniform(0.9, 1.1))
    np.testing.assert_allclose([quantiles(mass).min(), quantiles(mass).max()], [1.8, 2.2], rtol=1e-3)
    (k,) = mechanism.randomise("spring.stiffness", distribution=lambda value: chaospy.Triangle(value, value, value + 3))
    assert k.mean == pytest.approx(51)
    (x,) = mechanism.randomise("spring.free_length", absolute=0.1, distribution="uniform")
    np.testing.assert_allclose([quantiles(x).mean(), quantiles(x).std()], [0.8, 0.1], rtol=1e-3)
    (friction,) = mechanism.randomise("*.friction", relative=0.2, distribution="lognormal")
    np.testing.assert_allclose([quantiles(friction).mean(), quantiles(friction).std()], [0.1, 0.02], rtol=5e-3)


def test_a_component_that_cannot_take_it_leaves_all_as_it_was():
    class Stubborn(uqmbd.Component):
        """It wants a number."""

        bodies = ("body",)
        size = uqmbd.Parameter("m", "a number")

        def prepare(self):
            return {"double": float(self.size) * 2}

        def terms(self, p):
            yield uqmbd.Potential(p.double * p.body.position[1])

    mechanism = rocker()
    mechanism.add(Stubborn("stubborn", mechanism.bodies["arm"], size=3))
    with pytest.raises(uqmbd.StudyError, match=r"stubborn\.size .* needs a number"):
        mechanism.randomise(["arm.mass", "stubborn.size"], relative=0.1)
    assert len(mechanism.inputs) == 0
    assert mechanism.randomise("*.mass", relative=0.1)[0].mean == pytest.approx(2)


def test_names_with_the_characters_of_patterns_are_met_as_they_are():
    mechanism = uqmbd.Mechanism("m", uqmbd.Line())
    for name in ("b[0]", "b0", "b.com"):
        mechanism.body(name, mass=1)
    assert [v.name for v in mechanism.randomise("b[0].mass", relative=0.1)] == ["b[0].mass"]
    assert [v.name for v in mechanism.randomise("b.com.mass", relative=0.1)] == ["b.com.mass"]


def test_patterns_of_masses_and_inertia_mean_components_too_and_names_of_bodies_do_not():
    """As the page says; `body.inertia` tells what became of that of a body."""
    from uqmbd_springs import RotorInertia

    mechanism = uqmbd.Mechanism("driven", uqmbd.Spatial())
    arm = mechanism.body("arm", 1, (1, 2, 2.5))
    mechanism.add(RotorInertia("rotor", mechanism.ground, arm, 0.2, axis_i=(0, 1, 0)))
    only = mechanism.randomise([f"{name}.inertia" for name in mechanism.bodies], relative=0.01)
    x, y, z = only
    assert [str(v) for v in only] == ["arm.inertia.x", "arm.inertia.y", "arm.inertia.z"]
    changed = [float(e.subs({x: 2, y: 1, z: 1})) for e in arm.inertia]
    assert changed == pytest.approx([1, 3.75, 4.25, 0, 0, 0])  # twice the second moment 1.75
    with pytest.warns(uqmbd.StudyWarning, match="arm.inertia is already random"):
        assert [str(v) for v in mechanism.randomise("*.inertia", relative=0.01)] == ["rotor.inertia"]


def test_inertia_of_a_body_is_read_like_its_mass():
    flat = uqmbd.Mechanism("flat", uqmbd.Planar())
    assert flat.body("disc", 1, 0.3).inertia == 0.3
    stone = uqmbd.Mechanism("stone", uqmbd.Translational()).body("stone", mass=1)
    with pytest.raises(AttributeError, match="point mass"):
        _ = stone.inertia


def test_rows_of_numbers_are_refused_by_name() -> None:
    """One of them alone is an error; next to other quantities, a warning names them."""
    mechanism = uqmbd.Mechanism("bushing", uqmbd.Planar())
    body = mechanism.body("body", mass=1, inertia=1)
    mechanism.add(Bushing("bush", mechanism.ground, body, at=(0, 0), stiffness=(10, 20, 3)))
    mechanism.add(SpringDamper("spring", mechanism.ground, body, (0, 1), (0, 0), stiffness=5))
    for pattern in ("bush.stiffness", "bush.stiffness.x", "bush.stiff*"):
        with pytest.raises(uqmbd.StudyError, match="bush.stiffness is a row or a matrix.*Pass random variables when"):
            mechanism.randomise(pattern, relative=0.1)
    with pytest.warns(uqmbd.StudyWarning, match="not randomised: bush.stiffness is a row or a matrix"):
        (found,) = mechanism.randomise("*.stiffness", relative=0.1)
    assert found.name == "spring.stiffness"
