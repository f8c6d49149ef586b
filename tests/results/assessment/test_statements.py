"""One statement on each output: outputs that do not vary count for nothing, equal runs are the same."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd import extend, results
from uqmbd_collocation import Collocation
from uqmbd_drivers import RotationDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Prismatic, Revolute
from uqmbd_montecarlo import MonteCarlo

TIMES = np.linspace(0.0, 1.0, 21)
STILL = "does not vary beyond the integration error"
DRIVEN = {"angle", "rate", "pin_x", "slider_y", "free_angle", "free_y"}


def slider_crank(seed: int) -> uqmbd.Mechanism:
    """A driven crank, whose rod and slider vary, and a body that flies: of random size, speed and spread."""
    rng = np.random.default_rng(seed)
    size, speed, spin = rng.uniform(0.05, 20), rng.uniform(0.5, 8), rng.uniform(-5, 5)
    length = uqmbd.RandomVariable("rod_length", chaospy.Uniform(0.98, 1.02), units="1")
    mass = uqmbd.RandomVariable("mass", chaospy.Normal(1, 0.02), units="kg")
    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar(gravity=(0, -9.81)))
    ground, rod_length = mechanism.ground, 3 * size * length
    crank = mechanism.body("crank", mass=1, inertia=0.1 * size**2)
    rod = mechanism.body("rod", mass=1, inertia=size**2, position=(size, 0))
    slider = mechanism.body("slider", mass=mass, inertia=0.1, position=(size + rod_length, 0))
    free = mechanism.body("free", mass=mass, inertia=0.1, position=(2, 1), angular_velocity=spin)
    mechanism.add(Revolute("A", ground, crank, (0, 0), (0, 0)))
    mechanism.add(Revolute("B", crank, rod, (size, 0), (0, 0)))
    joint = mechanism.add(Revolute("C", rod, slider, (rod_length, 0), (0, 0)))
    mechanism.add(Prismatic("D", ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.add(RotationDriver("drive", ground, crank, speed * uqmbd.t))
    mechanism.output("slider_x", slider.position[0], units="m")
    mechanism.output("slider_y", slider.position[1], units="m")
    mechanism.output("angle", crank.angle, units="rad")
    mechanism.output("rate", crank.angular_velocity, units="rad/s")
    mechanism.output("pin_x", crank.point((size, 0))[0], units="m")
    mechanism.output("force", joint.reaction_force[0], units="N")
    mechanism.output("free_angle", free.angle, units="rad")
    mechanism.output("free_y", free.position[1], units="m")
    return mechanism


def check_that_still_outputs_count_for_nothing(seed: int) -> None:
    methods = [MonteCarlo(samples=60, seed=seed), Collocation(order=2), Galerkin(order=2)]
    integrator, rtol = [("auto", 1e-6), ("ida", 1e-6), ("auto", 1e-4)][seed % 3]
    study = uqmbd.Study("s", slider_crank(seed), TIMES, methods, rtol=rtol, integrator=integrator)
    tree = study.run()
    found = tree["comparison"].to_dataset()
    still = found["output"].isin(list(DRIVEN)).values
    assert still.sum() == len(DRIVEN)
    for method in map(str, found["method"].values):
        row = found.sel({"method": method})
        assert ((row["verdict_kind"].values == "no spread") == still).all(), (method, row["verdict"].values)
        assert ((row["verdict"].values == STILL) == still).all()
        assert (row["own_error"].values[still] == 0).all() and (row["stated_error_max"].values[still] == 0).all()
        # and nothing has a share in a spread that is not there
        statistics = tree[method]["statistics"].to_dataset().isel(output=still)
        assert (statistics["skewness"] == 0).all() and (statistics["kurtosis"] == 3).all()
        if method != "monte-carlo":
            assert not any(statistics[name].any() for name in ("sobol_first", "sobol_total", "verification_error"))
    # the same is recommended as without them
    nodes = {label: only(node, ~still) for label, node in results.propagator_nodes(tree).items()}
    alone = results.compare(nodes, rtol=rtol)
    assert found.attrs["reference"] == alone.attrs["reference"]
    assert found.attrs["recommendation"].split("\n")[0] == alone.attrs["recommendation"].split("\n")[0]


def only(node: xr.DataTree, chosen: np.ndarray) -> xr.DataTree:
    """Return a node of some of its outputs."""
    parts = {part.path.removeprefix(node.path): part.to_dataset(inherit=False) for part in node.subtree}
    parts = {path or "/": d.isel(output=chosen) if "output" in d.dims else d for path, d in parts.items()}
    return xr.DataTree.from_dict(parts, name=node.name)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0])
@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")  # of a low order
def test_outputs_that_do_not_vary_count_for_nothing(seed: int) -> None:
    check_that_still_outputs_count_for_nothing(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 20))
def test_outputs_that_do_not_vary_count_for_nothing_in_any_mechanism(seed: int) -> None:
    check_that_still_outputs_count_for_nothing(seed)


def synthetic(label, mean, std, *, error=None, cost=100, wall_time=1.0, integration=None) -> xr.DataTree:
    """Return a node with means, deviations, errors relative to the deviation, and integration errors (O, T)."""
    mean, std = np.asarray(mean, dtype=float), np.asarray(std, dtype=float)
    axes = extend.labels([f"y{k}" for k in range(len(mean))], [], np.linspace(0, 1, mean.shape[1]))
    known = {} if error is None else {"std_error_mean": error * std, "std_error_std": error * std}
    statistics = extend.statistics_dataset(axes, mean=mean, std=std, **known)
    if integration is not None:
        statistics["integration_error"] = (("output", "time"), np.broadcast_to(integration, mean.shape))
    return results.propagator_node(label, statistics, propagator="p", realisations=cost, wall_time=wall_time)


@pytest.mark.thorough
@settings(max_examples=20, deadline=None)
@given(
    size=st.floats(1e-6, 1e6),
    error=st.floats(1e-9, 1e-2),
    ratio=st.one_of(st.floats(0.0, 1.0), st.floats(10.0, 1e3)),
    seed=st.integers(0, 2**31),
)
def test_what_varies_is_decided_by_the_integration_error(size: float, error: float, ratio: float, seed: int) -> None:
    """Noise up to the stated error is none; ten times of it is a spread; and it does not matter in which units."""
    rng = np.random.default_rng(seed)
    mean = size * np.cos(np.linspace(0, 3, 30))[None]
    std = ratio * error * size * rng.uniform(0.5, 1, (1, 30))
    node = synthetic("a", mean, std, integration=error * size)
    assert results.varies(node, "y0") == (ratio >= 10)


def test_an_error_that_swallows_the_end_leaves_the_beginning() -> None:
    """A chaotic motion: at the end the integration is as wrong as the output spreads, but not at the beginning."""
    t = np.linspace(0, 1, 50)
    node = synthetic("a", [np.cos(t)], [0.1 + 0 * t], integration=np.minimum(1e-9 * np.exp(30 * t), 0.5)[None])
    assert results.varies(node, "y0")


def test_without_a_measured_error_the_tolerance_stands_in() -> None:
    node = synthetic("a", np.ones((1, 5)), np.full((1, 5), 1e-8))
    statistics = node["statistics"].to_dataset()
    assert results.varying(statistics).tolist() == [True]
    assert results.varying(statistics, rtol=1e-6).tolist() == [False]
    assert not results.varies(results.study_tree([node], study="s", mechanism="m", attrs={"rtol": 1e-6})["a"], "y0")


def test_a_mean_that_is_wrong_is_reported_of_what_does_not_vary() -> None:
    """Without spread a difference of means is no part of it, and is no less wrong."""
    nodes = [synthetic(label, np.full((1, 4), mean), np.zeros((1, 4))) for label, mean in (("a", 1.0), ("b", 1.1))]
    verdict = results.compare(nodes, "a").sel({"method": "b"})
    assert verdict["verdict_kind"].item() == "differs"
    assert verdict["verdict"].item() == "differs: mean shifted by 0.1 at t = 0 s"


def test_where_nothing_varies_no_method_is_recommended() -> None:
    nodes = [
        synthetic(label, np.ones((2, 4)), np.full((2, 4), 1e-15), cost=cost) for label, cost in (("a", 9), ("b", 99))
    ]
    lead = results.recommend(results.compare(nodes))
    assert lead == ("No output varies beyond the integration error: one realisation is sufficient.",)


@pytest.mark.thorough
@settings(max_examples=8, deadline=None)
@given(noise=st.floats(0.5, 2.0), change=st.floats(-1, 1), seed=st.integers(0, 1000))
def test_equal_runs_are_the_same(noise: float, change: float, seed: int) -> None:
    """Equal results, wall times that differ by what else the machine did: none is recommended."""
    rng = np.random.default_rng(seed)
    mean, std = rng.normal(size=(2, 6)), rng.uniform(0.5, 1, (2, 6))
    nodes = [
        synthetic("A mc", mean, std, error=0.02, wall_time=10.0),
        synthetic("B mc", mean * (1 + 1e-14 * change), std, error=0.02, wall_time=10.0 * noise),
    ]
    lead, *others = results.recommend(results.compare(nodes, "A mc"))
    assert lead.startswith("A mc and B mc give equal results from equal numbers of realisations.")
    assert not others and "cheaper" not in lead and "Use" not in lead


def test_runs_that_are_equal_but_for_chance_are_equally_good() -> None:
    """Two seeds: their results and times differ by chance.  What costs a third is still preferred."""
    rng = np.random.default_rng(0)
    base = np.zeros((1, 6)), np.ones((1, 6))

    def node(label: str, **options) -> xr.DataTree:
        return synthetic(label, base[0] + 0.01 * rng.normal(), base[1] + 0.01 * rng.normal(), error=0.02, **options)

    nodes = [node("a", cost=2500, wall_time=100.0), node("b", cost=2500, wall_time=160.0)]
    lead, *others = results.recommend(results.compare(nodes, "a"))
    assert lead.startswith("Use a or b: they agree;") and "do not differ significantly" in lead and not others
    lead = results.recommend(results.compare([*nodes, node("c", cost=800, wall_time=30.0)], "a"))[0]
    assert lead.startswith("Use c: it agrees with a,") and "3.3 times cheaper than a" in lead
