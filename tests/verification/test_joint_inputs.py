"""Outputs of dependent inputs in closed form, by every method; surrogates that are evaluated in memory and from a file."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo
from uqmbd_reliability import Reliability


def carried(distribution, names=("p", "q")):
    """A body at p with the velocity q: the position at t is p + q t, the product of both an output of its own."""
    p, q = uqmbd.random_vector(names, distribution, ["m", "m/s"])
    mechanism = uqmbd.Mechanism("carrier", uqmbd.Line())
    body = mechanism.body("body", mass=1, position=p, velocity=q)
    mechanism.output("place", body.position[0], units="m")
    mechanism.output("product", p * q, units="m^2/s")
    return mechanism


def conditional():
    """p ~ U(1, 5), q ~ N(0.2 p, 0.05): the mean of p q is 0.2 E[p^2], of p + 2 q 1.4 E[p]."""
    p = chaospy.Uniform(1, 5)
    return chaospy.J(p, chaospy.Normal(0.2 * p, 0.05))


TIMES = np.array([0.0, 2.0])
MEAN = {"place": 1.4 * 3, "product": 0.2 * (9 + 4 / 3)}
# Var[p q] = Var[0.2 p^2] + 0.05^2 E[p^2], with Var[p^2] = (5^5 - 1) / 20 - (31 / 3)^2
VARIANCE = {"place": 1.4**2 * 4 / 3 + 4 * 0.05**2, "product": 0.04 * (3124 / 20 - (31 / 3) ** 2) + 0.05**2 * 31 / 3}


def statistics_of(method):
    study = uqmbd.Study("carried", carried(conditional()), TIMES, [method])
    return study.propagate(method)


@pytest.mark.parametrize(
    "method",
    [
        Collocation(order=2),
        Collocation(order=2, rule="random", method="regression", samples=40),
        Galerkin(order=2),
    ],
    ids=lambda method: type(method).__name__,
)
def test_polynomials_are_exact(method):
    node = statistics_of(method)
    data = node["statistics"].to_dataset()
    for name in MEAN:
        at = data.sel(output=name).isel(time=-1)
        assert float(at["mean"]) == pytest.approx(MEAN[name], rel=1e-9)
        assert float(at["std"]) ** 2 == pytest.approx(VARIANCE[name], rel=1e-9)
    assert uqmbd.results.surrogate(node).space.names == ("p", "q | p")


@pytest.mark.parametrize("sampling", ["random", "latin-hypercube", "sobol", "halton"])
def test_designs_of_monte_carlo(sampling):
    data = statistics_of(MonteCarlo(samples=512, sampling=sampling, seed=1))["statistics"].to_dataset()
    for name in MEAN:
        at = data.sel(output=name).isel(time=-1)
        assert float(at["mean"]) == pytest.approx(MEAN[name], rel=0.06)
        assert float(at["std"]) ** 2 == pytest.approx(VARIANCE[name], rel=0.15)


SURROGATES = {
    "conditional": conditional,
    "clayton": lambda: chaospy.Clayton(chaospy.J(chaospy.Uniform(1, 2), chaospy.Normal(3, 0.2)), 2.0),
    "gumbel": lambda: chaospy.Gumbel(chaospy.J(chaospy.Uniform(1, 2), chaospy.Normal(3, 0.2)), 1.5),
    "student": lambda: chaospy.MvStudentT(12, [1, 2], [[0.01, 0.006], [0.006, 0.02]]),
}


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "names"), [*((name, ("p", "q")) for name in SURROGATES), ("conditional", ("q", "p"))])
def test_a_surrogate_is_evaluated_in_memory_and_from_a_file(name, names, tmp_path):
    """In memory right after the run; from netCDF to the same bits; with values of inputs, draws and statistics."""
    mechanism = carried(SURROGATES[name](), names)
    tree = uqmbd.Study("carried", mechanism, TIMES, [Collocation(order=5)]).run()
    chaos = uqmbd.results.surrogate(tree["collocation"])
    x = mechanism.inputs.from_uniform(np.random.default_rng(3).uniform(0.1, 0.9, (20, 2)))
    p, q = x[:, list(mechanism.inputs.names).index(names[0])], x[:, list(mechanism.inputs.names).index(names[1])]
    values = chaos.evaluate(x)
    spread = (p + 2 * q).std()
    assert np.abs(values[:, 0, -1] - (p + 2 * q)).max() < 0.05 * spread
    uqmbd.results.save(tree, tmp_path / "result.nc")
    again = uqmbd.results.surrogate(uqmbd.results.load(tmp_path / "result.nc")["collocation"])
    assert np.array_equal(again.evaluate(x), values)
    assert np.array_equal(again.mean, chaos.mean)
    assert np.array_equal(again.space.to_germs(x), chaos.space.to_germs(x))


def test_the_nominal_motion_is_at_the_means():
    mechanism = carried(conditional())
    assert mechanism.inputs.means == pytest.approx([3.0, 0.6], rel=1e-12)
    motion = uqmbd.simulate(mechanism, TIMES)
    assert float(motion["place"][-1]) == pytest.approx(4.2, rel=1e-9)


@pytest.mark.thorough
def test_reliability_of_conditional_inputs():
    """P(p + 2 q > 6.5): given p it is a normal probability, integrated over the uniform p."""
    from scipy.integrate import quad
    from scipy.special import ndtr

    mechanism = carried(conditional())
    mechanism.require("reach", uqmbd.maximum(mechanism.outputs["place"].expression) <= 6.5)
    node = uqmbd.Study("carried", mechanism, TIMES, [Reliability()]).propagate(Reliability())
    exact = quad(lambda p: (1 - ndtr((6.5 - 1.4 * p) / 0.1)) / 4, 1, 5, points=[6.5 / 1.4])[0]
    found = float(np.ravel(node["requirements"].to_dataset()["violation_probability"].values)[0])
    assert found == pytest.approx(exact, rel=0.1)
