"""Measure low-fidelity models as control variates: their cost, explained variance, and gain on an equal budget.

By default the script uses pairs of a study and a low-fidelity one.  It runs some seeds of plain Monte Carlo, with the
low-fidelity study as control, and with a surrogate as control.  The gain is the stated variance reduction over the
ratio of the processor times of whole runs, including the realisations of the surrogate.  Tests verify that stated
reductions agree with the scatter of estimates.  With ``--tolerances`` the low-fidelity models are the same study at
looser tolerances.  The table then lists cost, remaining variances, and the best possible gain of two and three levels.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/low_fidelity.py [--tolerances] [--seeds N] [--only NAME ...]``.
"""

from __future__ import annotations

import argparse
import copy
import os
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import bouncing_ball
import bouncing_ball_compliant
import chaospy
import clearance
import long_time
import mechanisms
import motorcycle
import numpy as np
import pendulum
import robot
import slider_crank
import sympy
from measure import console, table_of
from numpy.typing import NDArray

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_joints import Fixed, Prismatic, Revolute
from uqmbd_montecarlo import LowFidelity, MonteCarlo
from uqmbd_montecarlo.allocation import equal_budget, optimum
from uqmbd_springs import PointForce, RotationalFriction, Torque, TorsionSpringDamper

Array = NDArray[np.float64]

LADDER = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
FINE = 1e-6
BRAKE = 0.3  # N s/m
STILL = 1e-3
"""Share of the largest deviation over time below which an output does not count."""


def continuous_robot() -> uqmbd.Mechanism:
    """Return the arm of the study with a continuous control law, without delay and limits."""
    mechanism = uqmbd.Mechanism("continuous", uqmbd.Planar(gravity=(0, -robot.GRAVITY)))
    upper_length, fore_length, friction = robot.UPPER, robot.FORE, robot.friction
    one, two = robot.upper_mass, robot.fore_mass
    upper = mechanism.body(
        "upper_arm", mass=one, inertia=one * upper_length**2 / 12, com=(upper_length / 2, 0), angle=robot.first
    )
    both = robot.first + robot.second
    fore = mechanism.body(
        "forearm",
        mass=two,
        inertia=two * fore_length**2 / 12,
        com=(fore_length / 2, 0),
        position=robot.elbow,
        angle=both,
    )
    payload = mechanism.body("payload", mass=robot.payload_mass, inertia=1e-4, position=robot.tip, angle=both)
    mechanism.add(Revolute("shoulder", mechanism.ground, upper, (0, 0), (0, 0)))
    mechanism.add(Revolute("elbow", upper, fore, (upper_length, 0), (0, 0)))
    mechanism.add(Fixed("grip", fore, payload, (fore_length, 0), (0, 0)))
    mechanism.add(RotationalFriction("shoulder_f", mechanism.ground, upper, friction, damping=0.2, transition=0.2))
    mechanism.add(RotationalFriction("elbow_f", upper, fore, friction / 2, damping=0.1, transition=0.2))
    x = uqmbd.t / robot.DURATION
    phase = 2 * sympy.pi * x**3 * (10 - 15 * x + 6 * x**2)
    px, py = (c + robot.RADIUS * f(phase) for c, f in zip(robot.CENTRE, (sympy.cos, sympy.sin), strict=True))
    elbow = sympy.acos((px**2 + py**2 - upper_length**2 - fore_length**2) / (2 * upper_length * fore_length))
    shoulder = sympy.atan2(py, px) - sympy.atan2(
        fore_length * sympy.sin(elbow), upper_length + fore_length * sympy.cos(elbow)
    )
    q = (upper.angle, fore.angle - upper.angle)
    v = (upper.angular_velocity, fore.angular_velocity - upper.angular_velocity)
    wanted = [
        r.diff(uqmbd.t, 2) + robot.DAMPING * (r.diff(uqmbd.t) - speed) + robot.STIFFNESS * (r - angle)
        for r, angle, speed in zip((shoulder, elbow), q, v, strict=True)
    ]
    m1, m2, m3 = robot.NOMINAL.values()
    own, tip = (m1 / 3 + m2 + m3) * upper_length**2, (m2 / 3 + m3) * fore_length**2
    coupled = (m2 / 2 + m3) * upper_length * fore_length
    mixed, turning = tip + coupled * sympy.cos(q[1]), coupled * sympy.sin(q[1])
    lift = (m2 / 2 + m3) * fore_length * robot.GRAVITY * sympy.cos(q[0] + q[1])
    first = (own + tip + 2 * coupled * sympy.cos(q[1])) * wanted[0] + mixed * wanted[1]
    first += (m1 / 2 + m2 + m3) * upper_length * robot.GRAVITY * sympy.cos(q[0]) + lift
    first -= turning * v[1] * (2 * v[0] + v[1])
    second = mixed * wanted[0] + tip * wanted[1] + turning * v[0] ** 2 + lift
    mechanism.add(Torque("shoulder_motor", upper, first - second))
    mechanism.add(Torque("elbow_motor", fore, second))
    outwards = sympy.Matrix([sympy.cos(phase), sympy.sin(phase)])
    miss = payload.position - sympy.Matrix(robot.CENTRE) - robot.RADIUS * outwards
    mechanism.output("path_error", 1000 * miss.dot(outwards), units="mm")
    mechanism.output("lead", 1000 * miss.dot(sympy.Matrix([-outwards[1], outwards[0]])), units="mm")
    mechanism.output("shoulder_torque", first, units="N m")
    mechanism.output("elbow_torque", second, units="N m")
    return mechanism


def crank(parts: int) -> uqmbd.Mechanism:
    """Return a slider-crank with an elastic rod of parts on hinges with stiff springs; one part is rigid."""
    a = uqmbd.RandomVariable("crank_length", chaospy.Normal(0.15, 0.003), units="m")
    b = uqmbd.RandomVariable("rod_length", chaospy.Normal(0.35, 0.007), units="m")
    torque = uqmbd.RandomVariable("torque", chaospy.Normal(0.1, 0.01), units="N m")
    mechanism = uqmbd.Mechanism(f"rod_of_{parts}", uqmbd.Planar(gravity=(0.0, -9.81)))
    ground, pin = mechanism.ground, a / sympy.sqrt(2)
    angle = -sympy.asin(pin / b)
    end = pin + b * sympy.cos(angle)
    wheel = mechanism.body(
        "crank", mass=0.36, inertia=0.36 * a**2 / 12, position=(pin / 2, pin / 2), angle=sympy.pi / 4
    )
    slider = mechanism.body("slider", mass=0.1, inertia=1e-4, position=(end, 0))
    mechanism.add(Revolute("bearing", ground, wheel, point_i=(0, 0), point_j=(-a / 2, 0)))
    half, mass, before, at = b / parts / 2, 0.15 / parts, wheel, (a / 2, 0)
    for k in range(parts):
        share = (k + 0.5) / parts
        place = (pin + (end - pin) * share, pin * (1 - share))
        rod = mechanism.body(f"rod{k}", mass=mass, inertia=mass * half**2 / 3, position=place, angle=angle)
        mechanism.add(Revolute(f"hinge{k}", before, rod, point_i=at, point_j=(-half, 0)))
        if k:
            mechanism.add(TorsionSpringDamper(f"bending{k}", before, rod, stiffness=500.0, damping=0.05))
        before, at = rod, (half, 0)
    wrist = mechanism.add(Revolute("wrist", before, slider, point_i=at, point_j=(0, 0)))
    mechanism.add(Prismatic("guide", ground, slider, point_i=(0, 0), point_j=(0, 0), axis_i=(1, 0), axis_j=(1, 0)))
    mechanism.add(Torque("drive", wheel, torque=torque))
    mechanism.add(TorsionSpringDamper("friction", ground, wheel, stiffness=0, damping=0.005))
    mechanism.output("slider_x", slider.position[0], units="m")
    mechanism.output("crank_angle", wheel.angle, units="rad")
    mechanism.output("pin_force", wrist.reaction_force[0], units="N")
    return mechanism


def ball_with_impacts() -> uqmbd.Mechanism:
    """Return the ball of the compliant floor with instantaneous impacts."""
    mechanism = uqmbd.Mechanism("impacts", uqmbd.Translational(gravity=(0, -9.81)))
    ball = mechanism.body("ball", mass=1, position=(0, bouncing_ball_compliant.drop), velocity=(0, 0))
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, (0, 0), (0, 0), normal_i=(0, 1), restitution=1.0))
    mechanism.output("height", ball.position[1], units="m")
    mechanism.output("velocity", ball.velocity[1], units="m/s")
    return mechanism


def brake(_: float, measured: Array) -> Array:
    """Return the braking force on a ball, N, shape (K, 1)."""
    return -BRAKE * measured


def slowed_ball(sampled: bool) -> uqmbd.Mechanism:
    """Return the ball with impacts and a braking thruster under a controller of 200 Hz, or a continuous one."""
    mechanism = uqmbd.Mechanism("sampled" if sampled else "at_all_times", uqmbd.Translational(gravity=(0, -9.81)))
    ball = mechanism.body("ball", mass=1, position=(0, bouncing_ball.drop), velocity=(0, 0))
    restitution = bouncing_ball.restitution
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), restitution=restitution))
    force = -BRAKE * ball.velocity[1]
    if sampled:
        controller = uqmbd.Controller(
            "controller", measured=[ball.velocity[1]], commanded={"thrust": "N"}, rate=200.0, function=brake
        )
        mechanism.add(controller)
        force = controller.command("thrust")
    mechanism.add(PointForce("thruster", ball, (0, 0), (0, force)))
    mechanism.output("height", ball.position[1], units="m")
    mechanism.output("velocity", ball.velocity[1], units="m/s")
    return mechanism


@dataclass(frozen=True)
class Pair:
    """A study, and a low-fidelity one.

    Attributes
    ----------
    fine, coarse : uqmbd.Study
    samples : int
        Samples of each estimate.
    cost : float
        Expected relative cost of a realisation of the low-fidelity study.
    words : str
        Description of both models.
    """

    fine: uqmbd.Study
    coarse: uqmbd.Study
    samples: int
    cost: float
    words: str


def pairs() -> dict[str, Callable[[], Pair]]:
    """Return the pairs, by name."""
    study = uqmbd.Study
    short = np.linspace(0, 2, 101)

    def rest(**options: Any) -> uqmbd.Study:
        return study("motorcycle", motorcycle.mechanism, motorcycle.study.times, start="equilibrium", **options)

    def links(rtol: float) -> uqmbd.Study:
        return study("links", mechanisms.links(6), np.linspace(0, 1, 51), rtol=rtol)

    def clearances(rtol: float) -> uqmbd.Study:
        return study("clearance", clearance.mechanism, clearance.study.times, rtol=rtol)

    ball = bouncing_ball_compliant.study
    return {
        "robot": lambda: Pair(
            robot.study,
            study("continuous", continuous_robot(), robot.study.times, rtol=1e-4),
            100,
            0.07,
            "controller of 100 Hz: continuous law",
        ),
        "slowed ball": lambda: Pair(
            study("sampled", slowed_ball(True), np.linspace(0, 2.4, 121)),
            study("at_all_times", slowed_ball(False), np.linspace(0, 2.4, 121), rtol=1e-4),
            60,
            0.02,
            "impacts, controller of 200 Hz: continuous law",
        ),
        "rod": lambda: Pair(
            study("elastic", crank(4), short),
            study("rigid", crank(1), short, rtol=1e-4),
            60,
            0.01,
            "rod of four parts on stiff springs: rigid",
        ),
        "motorcycle": lambda: Pair(
            rest(integrator="ida", rtol=1e-8), rest(rtol=1e-4), 60, 0.05, "IDA, 1e-8: explicit, 1e-4"
        ),
        "links": lambda: Pair(links(1e-8), links(1e-4), 200, 0.5, "tolerance 1e-8: 1e-4"),
        "clearance": lambda: Pair(clearances(1e-6), clearances(1e-3), 100, 0.6, "tolerance 1e-6: 1e-3"),
        "ball": lambda: Pair(
            ball, study("impacts", ball_with_impacts(), ball.times), 200, 1.0, "compliant floor: impacts"
        ),
    }


def counted(deviation: Array) -> NDArray[np.bool_]:
    """Return a mask of the outputs and times (O, T) that count."""
    found = deviation > STILL * deviation.max(axis=1, keepdims=True)
    return np.asarray(found)


def runs(study: uqmbd.Study, method: MonteCarlo, seeds: int) -> tuple[float, list[Any]]:
    """Return processor seconds of a run, and the nodes of some seeds."""
    seconds, nodes = [], []
    for seed in range(seeds + 1):
        begin = time.process_time()
        nodes.append(study.propagate(replace(method, seed=seed)))
        seconds.append(time.process_time() - begin)
    # the first run compiles
    return float(np.median(seconds[1:])), nodes[1:]


def compared(name: str, pair: Pair, seeds: int) -> tuple[str, ...]:
    """Return a row of the table."""
    plain, nodes = runs(pair.fine, MonteCarlo(samples=pair.samples), seeds)
    counts = counted(np.mean([node["statistics/std"].values for node in nodes], axis=0))
    cells = []
    low = LowFidelity(pair.coarse, cost=pair.cost)
    for control in (low, Collocation(order=2)):
        spent, nodes = runs(pair.fine, MonteCarlo(samples=pair.samples, control=control), seeds)
        gains = []
        for variable in ("variance_reduction", "variance_reduction_std"):
            stated = [
                np.ones(counts.shape) if variable not in n["statistics"] else n["statistics"][variable].values
                for n in nodes
            ]
            gains.append(np.median(stated, axis=0)[counts] * plain / spent)
        if control is low:
            total = np.median([node.attrs["control_realisations"] for node in nodes]) / pair.samples
            measured = [node.attrs.get("control_measured", "") for node in nodes]
            costs = [float(words.split(" took ")[1].split()[0]) for words in measured if words]
            cells += [f"{np.median(costs):.2g}" if costs else "", f"{total:.3g}", f"{spent / plain:.3g}"]
        cells.append(" and ".join(f"{np.median(of):.3g} ({np.quantile(of, 0.1):.3g})" for of in gains))
    return (name, pair.words, str(pair.samples), *cells)


def tolerance_cases() -> dict[str, tuple[uqmbd.Study, int]]:
    """Return studies, and numbers of timed realisations."""
    study = uqmbd.Study

    def ida(of: Any) -> uqmbd.Study:
        return study("ida", of.mechanism, of.study.times, start=of.study.start, integrator="ida")

    return {
        "pendulum": (pendulum.study, 800),
        "pendulum, 100 s": (study("long", pendulum.mechanism, np.linspace(0, 100, 1001)), 400),
        "slider-crank": (slider_crank.study, 800),
        "six links": (study("links", mechanisms.links(6), np.linspace(0, 1, 101)), 800),
        "three links, 10 s": (study("chaos", mechanisms.links(3), np.linspace(0, 10, 401)), 400),
        "five-bar": (study("five_bar", mechanisms.five_bar(True), np.linspace(0, 0.5, 101)), 400),
        "governor, 30 s": (study("governor", long_time.governor(), np.linspace(0, 30, 601)), 200),
        "bouncing ball": (bouncing_ball.study, 400),
        "clearance": (clearance.study, 64),
        "robot": (robot.study, 64),
        "slider-crank by IDA": (ida(slider_crank), 64),
        "motorcycle by IDA": (ida(motorcycle), 48),
    }


def tolerances(name: str, of: uqmbd.Study, count: int, rounds: int) -> tuple[str, ...]:
    """Return a row: cost of realisations by tolerance, and the best gains of two and three levels."""
    problems = {}
    for rtol in LADDER:
        one = copy.copy(of)
        one.rtol = rtol
        problems[rtol] = one.problem(MonteCarlo())
    inputs = problems[FINE].inputs
    values = inputs.from_uniform(np.random.default_rng(5).random((count, len(inputs))))
    problems[FINE].realise(values[:8])
    seconds: dict[float, list[float]] = {rtol: [] for rtol in LADDER}
    found = {}
    for _ in range(rounds):
        for rtol, problem in problems.items():
            begin = time.process_time()
            found[rtol] = problem.realise(values)
            seconds[rtol].append(time.process_time() - begin)
    cost = {rtol: min(each) / count for rtol, each in seconds.items()}
    good = np.logical_and.reduce([one.good for one in found.values()])
    responses = {rtol: one.response[good] for rtol, one in found.items()}
    fine = responses[FINE]
    counts = counted(fine.std(axis=0))

    def left(rtol: float) -> tuple[Array, Array]:
        parts = []
        for power in (1, 2):
            a, b = ((x[:, counts] - x[:, counts].mean(axis=0)) ** power for x in (fine, responses[rtol]))
            a, b = a - a.mean(axis=0), b - b.mean(axis=0)
            explained = (a * b).sum(axis=0) ** 2 / ((a * a).sum(axis=0) * (b * b).sum(axis=0) + 1e-300)
            parts.append(np.clip(1 - explained, 1e-12, 1))
        return parts[0], parts[1]

    coarse = [rtol for rtol in LADDER if rtol > FINE]
    shares = {rtol: left(rtol) for rtol in coarse}
    best = max(coarse, key=lambda rtol: gain_of_levels([(cost[rtol] / cost[FINE], shares[rtol][0])]))
    both = [gain_of_levels([(cost[best] / cost[FINE], shares[best][k])]) for k in (0, 1)]
    three = max(
        gain_of_levels([(cost[r] / cost[FINE], shares[r][0]) for r in (b, a)])
        for i, a in enumerate(coarse)
        for b in coarse[i + 1 :]
    )
    times = ", ".join(f"{1e6 * cost[rtol]:.0f}" for rtol in LADDER)
    remains = f"{np.median(shares[best][0]):.0e}, {np.median(shares[best][1]):.0e}"
    return name, times, f"{best:.0e}", remains, f"{both[0]:.2f}, {both[1]:.2f}", f"{three:.2f}"


def gain_of_levels(levels: list[tuple[float, Array]]) -> float:
    """Return the best median gain on an equal budget of levels from fine to coarse: cost, remaining variance (C,)."""
    (cost, share), *rest = levels
    if not rest:
        ratio = optimum(float(np.mean(share)), cost)
        # a level without further realisations is useless
        return 1.0 if ratio == 1 else float(np.median([equal_budget(float(one), ratio, cost) for one in share]))
    (cheap, poor), found = rest[0], 0.0
    for first in np.geomspace(1, 300, 40):
        for second in first * np.geomspace(1, 300, 40):
            variance = 1 - (1 - 1 / first) * (1 - share) - (1 / first - 1 / second) * (1 - poor)
            found = max(found, float(np.median(1 / (variance * (1 + cost * first + cheap * second)))))
    return found


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tolerances", action="store_true", help="the same study at looser tolerances")
    parser.add_argument("--seeds", type=int, default=5, help="runs of each kind (default 5)")
    parser.add_argument("--repeat", type=int, default=3, help="rounds of --tolerances (default 3)")
    parser.add_argument("--only", nargs="*", default=None, help="names of rows")
    options = parser.parse_args()
    rows: list[tuple[str, ...]] = []
    columns: tuple[str, ...]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        if options.tolerances:
            columns = (
                "study",
                f"us a realisation at {', '.join(f'{x:.0e}' for x in LADDER)}",
                "best level",
                "remaining variance: mean, deviation",
                "gain of two levels: mean, deviation",
                "of three",
            )
            for name, (of, count) in tolerance_cases().items():
                if options.only is None or name in options.only:
                    rows.append(tolerances(name, of, count, options.repeat))
                    print(*rows[-1], sep=" | ", file=sys.stderr, flush=True)
        else:
            columns = (
                "study",
                "model: low-fidelity model",
                "samples",
                "cost",
                "ratio",
                "time over plain",
                "gain: mean and deviation",
                "by Collocation(order=2)",
            )
            for name, make in pairs().items():
                if options.only is None or name in options.only:
                    rows.append(compared(name, make(), options.seeds))
                    print(*rows[-1], sep=" | ", file=sys.stderr, flush=True)
    table = table_of("Low-fidelity models as control variates:", *columns)
    for row in rows:
        table.add_row(*row)
    console.print(table)


if __name__ == "__main__":
    main()
