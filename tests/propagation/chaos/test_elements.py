"""Multi-element collocation and Galerkin: convergence, splitting, parallel work, resuming, detection, the report."""

from __future__ import annotations

import io
import warnings
from concurrent.futures import Executor, Future

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd import report
from uqmbd.extend import labels
from uqmbd.randomness import JointInput
from uqmbd.report.figures.elements import elements_in_words
from uqmbd.results import PiecewiseChaos, PolynomialChaos, validate
from uqmbd.results.chaos import chaos_from_dataset
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Distance

U = chaospy.Uniform(-1, 1)


class Inline(Executor):
    """An executor that computes at once, counts, and gives up after so many pieces of work."""

    def __init__(self, most=10**9):
        self.done, self.most = 0, most

    def submit(self, function, /, *arguments, **named):
        """Compute."""
        if self.done == self.most:
            raise RuntimeError(f"no more than {self.most}")
        self.done += 1
        future = Future()
        future.set_result(function(*arguments, **named))
        return future


class Floor(uqmbd.Component):
    """A compliant floor at height 0: it pushes with its stiffness times the depth."""

    bodies = ("body",)
    stiffness = uqmbd.Parameter("N/m", "of the floor")

    def terms(self, p):
        """Yield its virtual work."""
        height, speed = p.body.point((0, 0))[1], p.body.point_velocity((0, 0))[1]
        yield uqmbd.VirtualWork(p.stiffness * sympy.Max(-height, 0), speed)


def resting(function, *distributions):
    """A study whose output ``y`` is a function of inputs x0, x1, ..."""
    inputs = [uqmbd.RandomVariable(f"x{k}", one) for k, one in enumerate(distributions)]
    mechanism = uqmbd.Mechanism("body at rest", uqmbd.Translational())
    body = mechanism.body("body", mass=1)
    mechanism.output("y", function(*inputs) + 0 * body.position[0])
    return uqmbd.Study("resting", mechanism, (0.0, 1.0))


def swing():
    """A bob on a rod of random length with a random push."""
    mechanism = uqmbd.Mechanism("swing", uqmbd.Translational(gravity=(0, -9.81)))
    length = uqmbd.RandomVariable("length", chaospy.Normal(1, 0.02), units="m")
    push = uqmbd.RandomVariable("push", chaospy.Uniform(0.1, 0.2), units="m/s")
    bob = mechanism.body("bob", mass=1, position=(0, -length), velocity=(push, 0))
    mechanism.add(Distance("rod", mechanism.ground, bob, (0, 0), (0, 0), length=length))
    mechanism.output("x", bob.position[0], units="m")
    return uqmbd.Study("swings", mechanism, np.linspace(0, 1, 6), rtol=1e-9)


def ball(stiffness=1e5, end=1.6, count=161):
    """A ball of 1 kg that is dropped from a random height on a compliant floor."""
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -9.81)))
    height = uqmbd.RandomVariable("drop", chaospy.Uniform(0.9, 1.1), units="m")
    body = mechanism.body("ball", mass=1, position=(0, height), velocity=(0, 0))
    mechanism.add(Floor("floor", body, stiffness))
    mechanism.output("height", body.position[1], units="m")
    return uqmbd.Study("ball", mechanism, np.linspace(0, end, count), rtol=1e-7)


def chaos(node):
    """The chaos of a node."""
    return chaos_from_dataset(node["chaos"])


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")  # few elements of low orders at a kink
def test_convergence_at_a_kink():
    """|x - 0.3|: the error of the variance, known in closed form, falls with the elements; the kink is cornered."""
    study = resting(lambda x, y: sympy.Abs(x - 0.3) + y / 100, U, U)
    mean = (1.3**2 + 0.7**2) / 4
    variance = (1.3**3 + 0.7**3) / 6 - mean**2 + 1 / 30000
    wrong = []
    for elements in (2, 4, 8):
        node = study.propagate(Collocation(order=2, elements=elements))
        assert chaos(node).coefficients.shape[0] == elements == node.attrs["elements"]
        wrong.append(abs(float(node["statistics/variance"][0, 0]) - variance))
    assert wrong[1] < wrong[0] / 3 and wrong[2] < wrong[1] / 3 and wrong[2] < 3e-3 * variance
    found = chaos(node)
    # split along x alone, the smallest and worst element at the kink
    assert np.all(np.array([b.upper for b in found.boxes])[:, 1] == 1)
    worst = int(found.element_errors()[:, 0, 0].argmax())
    assert found.boxes[worst].lower[0] <= 0.3 <= found.boxes[worst].upper[0]
    assert found.probabilities[worst] == found.probabilities.min()
    np.testing.assert_allclose(node["statistics/sobol_first"][:, 0, 0], [1, 0], atol=1e-3)


@pytest.mark.thorough
def test_adaptive_step():
    """A jump of height 1 and a slope: the threshold is met, and moments and indices are those of the closed form."""
    study = resting(lambda x, y: sympy.Piecewise((1.0, x > 0.25), (0.0, True)) + y / 4, U, U)
    # between a face and the next node the place of the jump is unknown, which single realisations feel
    with pytest.warns(uqmbd.SurrogateWarning, match="exceeds 10% of the standard deviation: 'y'"):
        node = study.propagate(Collocation(order=2, elements="adaptive", threshold=0.02, max_realisations=10**5))
    step, slope = 0.375 * 0.625, 1 / 48
    assert node.attrs["threshold_met"] == "True"
    statistics = node["statistics"].isel(output=0, time=0)
    assert float(statistics["mean"]) == pytest.approx(0.375, abs=2e-3)
    assert float(statistics["variance"]) == pytest.approx(step + slope, rel=5e-3)
    np.testing.assert_allclose(statistics["sobol_first"], np.array([step, slope]) / (step + slope), atol=5e-3)
    steps = node["elements"]
    assert set(steps["split_germ"].values.tolist()) == {"x0"}
    assert steps["computed"].values[-1] == 2 * node.attrs["elements"] - 1 == node.attrs["elements_computed"]
    assert node.attrs["realisations"] == node["nodes"].sizes["node"]
    assert set(node["nodes/element"].values.tolist()) == {-1, *range(node.attrs["elements"])}
    validate(node)


@pytest.mark.thorough
def test_smooth_is_as_without_elements():
    """On a smooth motion elements give what a plain chaos of a higher order gives, both methods alike."""
    study = swing()
    truth = study.propagate(Collocation(order=7))["statistics"]
    scale = truth["std"].max()
    for method in (Collocation, Galerkin):
        node = study.propagate(method(order=3, elements=4))
        for name in ("mean", "std"):
            assert float(abs(node["statistics"][name] - truth[name]).max() / scale) < 2e-5
        np.testing.assert_allclose(node["statistics/sobol_total"][..., 1:], truth["sobol_total"][..., 1:], atol=1e-3)
        assert float(node["statistics/verification_error"].max()) < 1e-3
        one = study.propagate(method(order=3, elements="adaptive"))
        assert one.attrs["elements"] == 1 and one.attrs["threshold_met"] == "True"
        validate(node)


@pytest.mark.thorough
@pytest.mark.parametrize("method", [Collocation, Galerkin])
def test_workers_and_resuming(method, tmp_path):
    """Who computes does not matter, to the bit; what was finished before an interruption is not done again."""
    mechanism, propagator = swing().mechanism, method(order=1, elements=4)
    study = uqmbd.Study("swings", mechanism, np.linspace(0, 1, 3), [propagator])
    alone = study.propagate(propagator)
    name = propagator.name
    together = study.run(workers=Inline())[name]
    for variable in ("coefficients", "lower", "verification_response"):
        np.testing.assert_array_equal(together["chaos"][variable], alone["chaos"][variable])
    whole, broken = Inline(), Inline(most=2)
    study.run(workers=whole)
    with pytest.raises(RuntimeError, match="no more than 2"):
        study.run(workers=broken, folder=tmp_path)
    rest = Inline()
    resumed = study.run(workers=rest, folder=tmp_path, resume=True)[name]
    assert rest.done == whole.done - 2
    np.testing.assert_array_equal(resumed["chaos"]["coefficients"], alone["chaos"]["coefficients"])


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")  # few elements of low orders at a kink
def test_detection():
    """A plain chaos at a jump names output and input, and proposes elements; smooth responses raise no suspicion."""
    jump = resting(lambda x, y: sympy.Piecewise((1.0, x > 0.1), (0.0, True)) + y / 4, U, U)
    with pytest.warns(UserWarning, match=r"y looks discontinuous.* in x0 from t = 0 s on.*elements='adaptive'"):
        node = jump.propagate(Collocation(order=4))
    assert "in x0" in chaos(node).verdicts()[0]
    for order in (2, 3, 5):
        # warnings are errors
        smooth = resting(lambda x, y: sympy.exp(x + y / 2) + x * y, U, U).propagate(Collocation(order=order))
        assert chaos(smooth).discontinuities() == (None,)
    assert chaos(swing().propagate(Galerkin(order=3))).discontinuities() == (None,)


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")  # few elements of low orders at a kink
def test_limits_and_options():
    """An unmet threshold is said, and so are options that cannot be used."""
    study = resting(lambda x: sympy.Piecewise((1.0, x > 0.3), (0.0, True)), U)
    with pytest.warns(UserWarning, match="above the threshold 0.01. Reason: max_elements is 3"):
        node = study.propagate(Collocation(order=2, elements="adaptive", max_elements=3))
    assert node.attrs["threshold_met"] == "False"
    with pytest.warns(UserWarning, match="max_realisations"):
        study.propagate(Collocation(order=2, elements="adaptive", max_realisations=40))
    for options, words in (
        ({"elements": 0}, "1 or more, or 'adaptive'|expected a whole number or 'adaptive'"),
        ({"elements": "many"}, "expected a whole number or 'adaptive'"),
        ({"elements": 3, "order": 0}, "order"),
        ({"elements": "adaptive", "threshold": -1}, "threshold is -1"),
        ({"elements": "adaptive", "max_elements": 0}, "max_elements is 0"),
    ):
        for method in (Collocation, Galerkin):
            with pytest.raises(uqmbd.StudyError, match=words):
                method(**options)
    with pytest.raises(uqmbd.StudyError, match="contradicts"):
        Collocation(elements=2, adaptive="order")
    with pytest.raises(uqmbd.StudyError, match="stop_at"):
        Galerkin(elements=2, stop_at=0.1)


@pytest.mark.thorough
@pytest.mark.parametrize("both", [True, False])
def test_report(both):
    """The pattern has a patch for each element, of one split input a level; words count the splits."""

    def function(x, y, z):
        return sympy.Abs(x - 0.3) + (sympy.Abs(y + 0.5) / 2 if both else y / 2) + z / 9

    node = resting(function, U, chaospy.Normal(), U).propagate(Collocation(order=2, elements=7))
    figure = report.split_pattern(node)
    figure.savefig(io.BytesIO(), format="png", dpi=40)
    axes = figure.axes[0]
    assert axes.get_xlabel() == "x0" and axes.get_ylabel() == ("x1" if both else "stated error [% of std]")
    count = len(axes.collections[0].get_paths()) if both else len(axes.lines[0].get_xdata()) // 2
    assert count == 7
    words = elements_in_words(node)
    assert "into 7 elements: x0 at " in words and "x2 not at all" in words and "13 elements were computed" in words
    assert isinstance(chaos(node), PiecewiseChaos)
    report.coefficient_decay(node, "y", times=[])
    report.histograms(node, "y")
    with pytest.raises(uqmbd.StudyError, match="contain no elements"):
        report.split_pattern(resting(lambda x: x, U).propagate(Collocation(order=1)))


@pytest.mark.slow
def test_bouncing_ball():
    """After two impacts the deviation is within 1 % of its maximum, with 16 to 32 elements that the rule finds."""
    study = ball()
    problem = study.problem(Collocation())
    space = uqmbd.extend.GermSpace.of(problem.inputs)
    # the converged reference: Gauss rules on 100 panels
    points, rule = np.polynomial.legendre.leggauss(6)
    edges = np.linspace(-1, 1, 101)
    germs = ((edges[1:] + edges[:-1])[:, None] / 2 + points / 100).ravel()
    weights = np.tile(rule / 200, 100)
    response = problem.realise(space.to_inputs(germs[:, None])).response[:, 0]
    mean = weights @ response
    std = np.sqrt(weights @ (response - mean) ** 2)
    node = study.propagate(Galerkin(order=2, elements="adaptive"))
    assert 16 <= node.attrs["elements"] <= 32 and node.attrs["threshold_met"] == "True"
    assert abs(node["statistics/std"].values[0] - std).max() < 0.01 * std.max()
    assert abs(node["statistics/mean"].values[0] - mean).max() < 0.01 * std.max()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        plain = study.propagate(Collocation(order=4))
    assert "height looks discontinuous, or has a kink, in drop" in chaos(plain).verdicts()[0]


@pytest.mark.slow
def test_only_the_guilty_input_is_split():
    """With a random stiffness too, elements are split in the drop height only."""
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Normal(1e5, 5e3), units="N/m")
    node = ball(stiffness, 1.3, 66).propagate(Collocation(order=2, elements=8))
    assert set(node["elements/split_germ"].values.tolist()) == {"drop"}


@pytest.mark.thorough
@pytest.mark.parametrize("method", [Collocation, Galerkin], ids=lambda m: m.name)
@pytest.mark.parametrize("elements", [4, "adaptive"])
def test_an_output_that_is_always_zero_does_not_count(method, elements):
    """With and without it the same elements are split, and nothing is warned of beside."""
    found = []
    for more in ((), ("x",)):
        mechanism = uqmbd.Mechanism("falling", uqmbd.Translational(gravity=(0, -10)))
        body = mechanism.body("body", mass=1, position=(0, 0.1 * (uqmbd.RandomVariable("h", U) + 2)))
        mechanism.add(Floor("floor", body, 5000))
        mechanism.output("z", body.position[1])
        for name in more:
            mechanism.output(name, body.position[0])
        options = {"order": 2, "elements": elements, "index_set": "tensor", "verify": 2}
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            warnings.simplefilter("ignore", uqmbd.StudyWarning)
            warnings.simplefilter("ignore", UserWarning)
            node = uqmbd.Study("falling", mechanism, np.linspace(0, 0.5, 11), [method(**options)]).run()[method.name]
        found.append(node["statistics"]["std"].sel(output="z").values)
    assert found[0] == pytest.approx(found[1], rel=1e-12)


@pytest.mark.parametrize("told", [True, False])
def test_what_a_chaos_does_not_follow_counts_as_an_error(told):
    """Realisations beyond 0.3 move otherwise: elements get so small there that few of them are mixed."""
    space = uqmbd.extend.GermSpace.of(JointInput.of([uqmbd.RandomVariable("x", U)]), "rosenblatt")
    axes, shares = labels(["y"], ["x"], [0.0, 1.0]), list[float]()

    def compute(boxes):
        for box in boxes:
            low, high = box.lower[0], box.upper[0]
            beyond = float(np.clip((high - 0.3) / (high - low), 0, 1))
            shares.append(min(beyond, 1 - beyond))
        line = np.array([[[0.0, 0.0]], [[1.0, 1.0]], [[0.0, 0.0]]])
        return [PolynomialChaos(line, [[0], [1], [2]], box.local, axes) for box in boxes]

    limits = uqmbd.extend.ElementLimits("adaptive", 40, 0.05)
    found = uqmbd.extend.refine_elements(space, compute, limits, label="", lost=shares.__getitem__ if told else None)
    mixed = sum(shares[k] * box.probability for k, box in zip(found.kept, found.chaos.boxes, strict=True))
    assert found.met
    assert (mixed <= 0.05**2) == told == (len(found.kept) > 1)
