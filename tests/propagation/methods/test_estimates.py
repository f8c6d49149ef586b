"""What a method would take is known, shown and held against the machine before anything is computed."""

from __future__ import annotations

import dataclasses
import re
import tracemalloc

import chaospy
import numpy as np
import psutil
import pytest
from typer.testing import CliRunner

import uqmbd
from uqmbd.cli.app import app
from uqmbd.propagation.budget import timing_of
from uqmbd.propagation.methods import obstacle_of
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce


def loads(count, times=(0.0, 0.5, 1.0), outputs=1):
    """A mass under a force that is the sum of many random ones."""
    variables = [uqmbd.RandomVariable(f"load_{k}", chaospy.Uniform(0, 1), units="N") for k in range(count)]
    mechanism = uqmbd.Mechanism("loads", uqmbd.Translational())
    mass = mechanism.body("mass", mass=2.0)
    mechanism.add(PointForce("force", mass, (0, 0), (sum(variables), 0)))
    for k in range(outputs):
        mechanism.output(f"x_{k}", (1 + k) * mass.position[0], units="m")
    return uqmbd.Study("loads", mechanism, times, [])


def remedy(words):
    """Options that a sentence names: ``Use a=1, b='c' without d= (...``."""
    named = re.search(r"Use (.*?)(?: without (.*?))? \(", words)
    assert named, words
    given = dict(re.findall(r"(\w+)=('[^']*'|\d+)", named[1]))
    options = {name: text.strip("'") if text[0] == "'" else int(text) for name, text in given.items()}
    return options | dict.fromkeys(re.findall(r"(\w+)=", named[2] or ""))


@pytest.mark.parametrize("count", [4, 10, pytest.param(20, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "method",
    [
        Galerkin(),
        Galerkin(order=2, elements=2),
        Galerkin(order=2, nodes=6),
        Collocation(),
        Collocation(order=2, rule="clenshaw-curtis"),
        Collocation(order=4),
        Collocation(nodes=7),
    ],
    ids=lambda m: f"{m.name}-{m.order}-{m.nodes}-{m.elements}-{m.rule}",
)
def test_many_inputs_work_or_are_reported_what_works(method, count):
    study = loads(count)
    words = obstacle_of(method, study)
    if count == 4:
        assert words is None
    if words is not None:
        tried = dataclasses.replace(method, **remedy(words))
        assert obstacle_of(tried, study) is None
        assert tried.estimate(study).realisations < 20_100


def test_a_basis_that_would_fill_the_memory_is_not_begun():
    tracemalloc.start()
    for kind, order in (("tensor", 6), ("total", 30), ("hyperbolic", 2000)):
        with pytest.raises(uqmbd.StudyError, match=f"the {kind} set of order {order} has more than"):
            uqmbd.extend.index_set(20, order, kind)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1e9


@pytest.mark.slow
@pytest.mark.parametrize(
    "method",
    [
        MonteCarlo(samples=300, seed=1),
        Collocation(order=6, index_set="tensor", verify=0),
        Collocation(method="regression", order=2, samples=200),
        Galerkin(order=5, verify=0),
    ],
    ids=lambda m: f"{m.name}-{getattr(m, 'method', '')}",
)
def test_the_estimate_is_of_the_size_of_what_is_used(method):
    """Where the arrays are what matters: many times and outputs."""
    study = loads(2, np.linspace(0, 1, 4000), outputs=4)
    estimate = method.estimate(study)
    study.propagate(method)  # nothing that is compiled once counts
    tracemalloc.start()
    node = study.propagate(method)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert node.attrs["realisations"] == estimate.realisations
    assert 0.3 < estimate.memory / peak < 3


@pytest.mark.thorough
@pytest.mark.parametrize(
    "method",
    [
        MonteCarlo(samples=10**6, keep=10**6),
        Collocation(order=5, method="regression", samples=5000, max_realisations=10**5),
        Galerkin(order=5),
    ],
    ids=lambda m: m.name,
)
def test_what_this_machine_cannot_hold_is_refused_before_it_is_allocated(method):
    study = loads(3, np.linspace(0, 1, 10**7 if method.name != "monte-carlo" else 10**5))
    assert method.estimate(study).memory > psutil.virtual_memory().total
    assert "of memory" in obstacle_of(method, study)


def test_check_shows_what_each_method_takes(tmp_path):
    script = tmp_path / "study.py"
    script.write_text(
        "import chaospy, numpy as np, uqmbd\n"
        "from uqmbd_collocation import Collocation\n"
        "from uqmbd_galerkin import Galerkin\n"
        "from uqmbd_montecarlo import MonteCarlo\n"
        "speed = uqmbd.RandomVariable('speed', chaospy.Normal(3, 0.2))\n"
        "mechanism = uqmbd.Mechanism('fall', uqmbd.Translational(gravity=(0, -9.81)))\n"
        "stone = mechanism.body('stone', mass=1, velocity=(0, speed))\n"
        "mechanism.output('height', stone.position[1])\n"
        "study = uqmbd.Study('fall', mechanism, np.linspace(0, 1, 5), [MonteCarlo(samples=70), Collocation(order=2),\n"
        "    Galerkin(order=4), Collocation(adaptive='order', max_realisations=123, label='adaptive')])\n"
    )
    said = CliRunner().invoke(app, ["check", str(script)], env={"COLUMNS": "200"}).output
    rows = {line.split()[0]: line for line in said.split("estimate ")[1].splitlines()[1:] if line}
    for label, count in {"monte-carlo": "70", "collocation": "19", "galerkin": "21", "adaptive": "up to 123"}.items():
        assert re.match(rf"{label} +{count} +(up to |below )?[\d.]+ (s|min)", rows[label])
        assert re.search(r"[\d.]+ kB +(up to )?[\d.]+ kB", rows[label])
    assert "samples=70" in said
    assert "keep=" not in said  # as by default


def counted_study(samples):
    """Return a study whose problems note how many realisations are asked for at once, and these numbers."""
    study, computed = loads(2), []

    class Counted(uqmbd.Study):
        def problem(self, *arguments):
            problem = super().problem(*arguments)
            realise = problem.realise
            object.__setattr__(problem, "realise", lambda values: (computed.append(len(values)), realise(values))[1])
            return problem

    return Counted("loads", study.mechanism, study.times, [MonteCarlo(samples=samples)]), computed


def test_times_are_those_of_the_largest_number_that_was_timed():
    """With a clock that counts realisations: 1, 8, 64, as far as the limit allows."""
    counted, computed = counted_study(5000)

    def clock():
        return 0.01 * sum(computed)

    for limit, count in ((0.005, 1), (0.1, 8), (1.0, 64)):
        timing = timing_of(counted, counted.propagators[0], limit, clock)
        assert timing.count == count
        assert timing.each == pytest.approx(0.01)
        assert timing.seconds(counted.propagators[0], counted) == pytest.approx(50.0)


def test_what_a_chunk_costs_besides_is_not_taken_for_that_of_a_realisation():
    """A clock of 50 ms for whatever is computed together and 0.1 ms for each: 500 samples take 0.1 to 0.5 s, not 25 s."""
    counted, computed = counted_study(500)

    def clock():
        return 0.05 * len(computed) + 1e-4 * sum(computed)

    timing = timing_of(counted, counted.propagators[0], clock=clock)
    assert timing.seconds(counted.propagators[0], counted) < 1.0
    assert clock() < 1.0


def test_a_run_refuses_what_it_cannot_hold_and_does_the_rest():
    study = loads(3, np.linspace(0, 1, 101))
    large = MonteCarlo(samples=10**9, keep=10**9, label="large")
    study = uqmbd.Study("loads", study.mechanism, study.times, [large, Collocation(order=1)])
    with pytest.warns(
        uqmbd.MethodFailedWarning, match="the method 'large' failed: .* of memory for 1000000000 stored samples"
    ):
        tree = study.run()
    assert "collocation" in tree.children and "large" not in tree.children
