"""Mechanisms with reference solutions, for the table of stated errors.

A reference solution is a closed form for the same inputs, without code of uqmbd: harmonic and elliptic functions,
eigenvalues of linear systems, flights between impacts, and the exact recursion of sampled controllers.  Mechanisms
without one are integrated at a thousandth of the tolerance.  The module is long because each mechanism is next to its
reference solution.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import chaospy
import numpy as np
import scipy.stats
import sympy
from numpy.typing import NDArray
from scipy.special import ellipj

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent), str(HERE.parent / "published")]

import four_bar
import kraichnan_orszag
import slider_crank_rotating

import uqmbd
from uqmbd_contact import PlaneImpact
from uqmbd_drivers import PositionDriver, RotationDriver
from uqmbd_joints import Prismatic, Revolute
from uqmbd_springs import PointForce, SpringDamper, Torque, TorsionSpringDamper, haversine_bump

__all__ = ["MECHANISMS", "TestedMechanism"]

Array = NDArray[np.float64]
Inputs = Mapping[str, Array]
Exact = Callable[[Inputs, Array], dict[str, Array]]
"""From inputs (K, 1) by name and times (T,) to outputs (K, T) by name, or (K,) without a time."""

G = 9.81
K, C = "N/m", "N s/m"


@dataclass(frozen=True)
class TestedMechanism:
    """A mechanism, the times, s, its reference solution, and the options of the chaos.

    Attributes
    ----------
    kind : str
        Kind of the mechanism.
    make : callable
        Creates the mechanism.
    end, count : float, int
        Last time, s, and number of times.
    options : dict
        Options of `Collocation`; empty: the inputs are too many for a chaos at the cost of this table.
    exact : callable, optional
        Reference solution.
    helps : bool, optional
        Whether an aligned chaos stays accurate; None: the surrogate is not aligned.
    calibrated : bool
        Whether the table calibrates its inputs from records.
    start : str
        Start condition of the study.
    """

    kind: str
    make: Callable[[], uqmbd.Mechanism]
    end: float
    count: int
    options: Mapping[str, Any] = field(default_factory=dict)
    exact: Exact | None = None
    helps: bool | None = None
    calibrated: bool = False
    start: str = "drawn"

    @property
    def times(self) -> Array:
        """Output times, s."""
        return np.linspace(0, self.end, self.count)


def random(name: str, distribution: Any, units: str = "") -> uqmbd.RandomVariable:
    """Return an input."""
    return uqmbd.RandomVariable(name, distribution, units=units)


def uniform(name: str, low: float, high: float, units: str = "") -> uqmbd.RandomVariable:
    """Return a uniform input."""
    return random(name, chaospy.Uniform(low, high), units)


def normal(name: str, mean: float, std: float, units: str = "") -> uqmbd.RandomVariable:
    """Return a normal input."""
    return random(name, chaospy.Normal(mean, std), units)


# reference solutions of parts


def swing(t: Array, k: Any, c: Any = 0.0, x: Any = 0.1, v: Any = 0.0, m: Any = 1.0) -> dict[str, Array]:
    """Return position and velocity of a damped oscillator that starts at x with the speed v."""
    half = np.asarray(c / m, dtype=complex) / 2
    root = np.sqrt(half**2 - k / m)
    slow, fast = -half + root, -half - root
    a, b = (v - fast * x) / (2 * root), (slow * x - v) / (2 * root)
    one, two = a * np.exp(slow * t), b * np.exp(fast * t)
    return {"x": (one + two).real, "v": (slow * one + fast * two).real}


def linear(matrix: Array, start: Array, t: Array) -> Array:
    """Return the states (K, n, T) of linear systems with matrices (K, n, n) from their states (K, n) at the start."""
    values, vectors = np.linalg.eig(matrix)
    weights = np.linalg.solve(vectors, start[..., None].astype(complex))[..., 0]
    return np.einsum("kij,kj,kjt->kit", vectors, weights, np.exp(values[..., None] * t)).real


def of_second_order(stiffness: Array, damping: Array, mass: Array) -> Array:
    """Return the matrices (K, 2 n, 2 n) of first order; stiffness and damping (K, n, n), masses (K, n)."""
    count, n = mass.shape
    whole = np.zeros((count, 2 * n, 2 * n))
    whole[:, range(n), range(n, 2 * n)] = 1.0
    whole[:, n:, :n] = -stiffness / mass[..., None]
    whole[:, n:, n:] = -damping / mass[..., None]
    return whole


def in_a_row(values: list[Array]) -> Array:
    """Return matrices (K, n, n) of springs in a row (n values (K,)), the first of them at the ground."""
    n = len(values)
    whole = np.zeros((len(values[0]), n, n))
    for i, value in enumerate(values):
        whole[:, i, i] += value
        if i:
            whole[:, i - 1, i - 1] += value
            whole[:, i, i - 1] -= value
            whole[:, i - 1, i] -= value
    return whole


# oscillators


def oscillator(
    stiffness: Any, damping: Any = 0.0, position: Any = 0.1, velocity: Any = 0.0, cubic: float = 0.0, mass: Any = 1
) -> uqmbd.Mechanism:
    """Return a mass, 1 kg by default, on a spring."""
    made = uqmbd.Mechanism("oscillator", uqmbd.Line())
    body = made.body("mass", mass=mass, position=position, velocity=velocity)
    made.add(SpringDamper("spring", made.ground, body, 0, 0, stiffness=stiffness, free_length=0, damping=damping))
    if cubic:
        made.add(PointForce("hardening", body, 0, -cubic * body.position[0] ** 3))
    made.output("x", body.position[0], units="m")
    made.output("v", body.velocity[0], units="m/s")
    return made


def duffing(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the motion of the hardening spring."""
    begin, rate = x["begin"], np.sqrt(100.0 + 800.0 * x["begin"] ** 2)
    sn, cn, dn, _ = ellipj(rate * t, 400.0 * begin**2 / rate**2)
    return {"x": begin * cn, "v": -begin * rate * sn * dn}


def whole_turn() -> uqmbd.Mechanism:
    """Return an oscillator with a random initial phase over a whole turn."""
    phase = uniform("phase", 0, 2 * np.pi, "rad")
    return oscillator(uniform("k", 90, 110, K), 0, 0.1 * sympy.cos(phase), -sympy.sin(phase))


def two_frequencies() -> uqmbd.Mechanism:
    """Return two oscillators of incommensurable frequencies, and the sum of their positions."""
    made = uqmbd.Mechanism("two_frequencies", uqmbd.Line())
    for name, mean in (("slow", 30.0), ("fast", 100.0)):
        mass = made.body(name, mass=1, position=0.1)
        stiffness = uniform(f"k_{name}", 0.9 * mean, 1.1 * mean, K)
        made.add(SpringDamper(f"spring_{name}", made.ground, mass, 0, 0, stiffness=stiffness, free_length=0))
        made.output(name, mass.position[0], units="m")
    slow, fast = (body.position[0] for body in made.bodies.values())
    made.output("sum", slow + fast, units="m")
    return made


def two_motions(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the motion of the two oscillators."""
    found = {name: 0.1 * np.cos(np.sqrt(x[f"k_{name}"]) * t) for name in ("slow", "fast")}
    return {**found, "sum": found["slow"] + found["fast"]}


def lognormal_start() -> uqmbd.Mechanism:
    """Return a damped oscillator whose amplitude has a long tail."""
    return oscillator(uniform("k", 95, 105, K), 0.4, random("begin", chaospy.LogNormal(-2.3, 0.5), "m"))


def bimodal() -> uqmbd.Mechanism:
    """Return a damped oscillator whose stiffness has two modes."""
    mode = uniform("mode", -1, 1)
    spread = normal("spread", 0, 1)
    return oscillator(100 + 12 * sympy.tanh(20 * mode) + spread, 0.4)


def bimodal_motion(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the motion of the oscillator with two modes."""
    return swing(t, 100 + 12 * np.tanh(20 * x["mode"]) + x["spread"], 0.4)


def forced() -> uqmbd.Mechanism:
    """Return an oscillator with six uniform inputs that a harmonic force drives."""
    made = uqmbd.Mechanism("forced", uqmbd.Line())
    body = made.body(
        "mass", mass=1, position=uniform("x0", 0.45, 0.55, "m"), velocity=uniform("v0", -0.05, 0.05, "m/s")
    )
    stiffness, damping = uniform("k", 0.03, 0.04, K), uniform("b", 0.08, 0.12, C)
    made.add(SpringDamper("spring", made.ground, body, 0, 0, stiffness=stiffness, damping=damping, free_length=0))
    push = uniform("F", 0.08, 0.12, "N") * sympy.sin(uniform("w", 0.8, 1.2, "rad/s") * uqmbd.t)
    made.add(PointForce("push", body, 0, push))
    made.output("x", body.position[0], units="m")
    return made


def forced_motion(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the motion of the driven oscillator."""
    b, k, force, w = (x[name] for name in ("b", "k", "F", "w"))
    scale = force / ((k - w**2) ** 2 + (b * w) ** 2)
    sine, cosine = scale * (k - w**2), -scale * b * w
    free = swing(t, k, b, x["x0"] - cosine, x["v0"] - sine * w)
    return {"x": sine * np.sin(w * t) + cosine * np.cos(w * t) + free["x"]}


def dependent_rates() -> uqmbd.Mechanism:
    """Return an oscillator whose stiffness and damping depend on each other."""
    joint = chaospy.Nataf(chaospy.J(chaospy.Normal(100, 5), chaospy.LogNormal(-0.7, 0.3)), [[1, -0.6], [-0.6, 1]])
    k, c = uqmbd.random_vector(["k", "c"], joint, [K, C])
    return oscillator(k, c)


def dependent_masses() -> uqmbd.Mechanism:
    """Return an oscillator whose mass and stiffness are correlated normal inputs."""
    m, k = uqmbd.random_vector(["m", "k"], chaospy.MvNormal([1.0, 100.0], [[0.0009, 0.1], [0.1, 25.0]]), ["kg", K])
    return oscillator(k, 0.5, mass=m)


def forty_springs() -> uqmbd.Mechanism:
    """Return a mass on forty parallel springs."""
    stiffnesses = [random(f"k{i:02d}", chaospy.LogNormal(0.9, 0.2), K) for i in range(40)]
    made = uqmbd.Mechanism("forty", uqmbd.Line())
    body = made.body("mass", mass=1, position=0.1)
    for i, stiffness in enumerate(stiffnesses):
        made.add(SpringDamper(f"spring{i:02d}", made.ground, body, 0, 0, stiffness=stiffness, free_length=0))
    made.output("x", body.position[0], units="m")
    return made


def coupled() -> uqmbd.Mechanism:
    """Return two masses on springs with twelve uniform inputs."""
    a, b = ({name: uniform(name, *ends) for name, ends in COUPLED.items() if name.endswith(end)} for end in "12")
    made = uqmbd.Mechanism("springs", uqmbd.Line())
    one = made.body("one", mass=a["m1"], position=a["x1"], velocity=a["v1"])
    two = made.body("two", mass=b["m2"], position=b["x2"], velocity=b["v2"])
    made.add(SpringDamper("s1", made.ground, one, 0, 0, stiffness=a["k1"], free_length=a["L1"]))
    made.add(SpringDamper("s2", one, two, 0, 0, stiffness=b["k2"], free_length=b["L2"]))
    made.add(PointForce("d1", one, 0, -a["b1"] * one.velocity[0]))
    made.add(PointForce("d2", two, 0, -b["b2"] * two.velocity[0]))
    made.output("x1", one.position[0], units="m")
    made.output("x2", two.position[0], units="m")
    return made


COUPLED = {
    "m1": (0.9, 1.1), "m2": (1.4, 1.6), "k1": (7, 9), "k2": (39, 41), "L1": (0.4, 0.6), "L2": (0.9, 1.1),
    "b1": (0.7, 0.9), "b2": (0.4, 0.6), "x1": (0.4, 0.6), "v1": (-0.1, 0.1), "x2": (2.2, 2.3), "v2": (-0.1, 0.1),
}  # fmt: skip
"""Ends of the uniform inputs of the coupled springs."""


def coupled_motion(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the motion of the coupled springs."""
    v = {name: value[:, 0] for name, value in x.items()}
    damping = np.zeros((len(v["m1"]), 2, 2))
    damping[:, 0, 0], damping[:, 1, 1] = v["b1"], v["b2"]
    whole = of_second_order(in_a_row([v["k1"], v["k2"]]), damping, np.stack([v["m1"], v["m2"]], axis=1))
    rest = v["L1"], v["L1"] + v["L2"]
    begin = np.stack([v["x1"] - rest[0], v["x2"] - rest[1], v["v1"], v["v2"]], axis=1)
    found = linear(whole, begin, t)
    return {f"x{i + 1}": found[:, i] + rest[i][:, None] for i in range(2)}


CHAIN = ((100.0, 10.0), (2e3, 90.0), (5e3, 150.0))
"""Mean stiffness, N/m, and damping, N s/m, of the damped chain."""


def chain() -> uqmbd.Mechanism:
    """Make three bodies on a line with dampers, whose fast modes decay."""
    made = uqmbd.Mechanism("chain", uqmbd.Line())
    before: Any = made.ground
    for number, (stiffness, damping) in enumerate(CHAIN):
        body = made.body(f"body_{number}", mass=1 + number, position=0.1 * (number + 1))
        drawn = uniform(f"k_{number}", 0.8 * stiffness, 1.2 * stiffness, K)
        made.add(SpringDamper(f"spring_{number}", before, body, 0, 0, stiffness=drawn, damping=damping, free_length=0))
        before = body
    made.output("x", before.position[0], units="m")
    made.output("v", before.velocity[0], units="m/s")
    made.output("a", before.acceleration[0], units="m/s^2")
    return made


def chain_motion(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the motion of the last body of the chain."""
    stiffness = [x[f"k_{i}"][:, 0] for i in range(3)]
    count = len(stiffness[0])
    damping = in_a_row([np.full(count, c) for _, c in CHAIN])
    whole = of_second_order(in_a_row(stiffness), damping, np.tile([1.0, 2.0, 3.0], (count, 1)))
    found = linear(whole, np.tile([0.1, 0.2, 0.3, 0, 0, 0], (count, 1)), t)
    return {"x": found[:, 2], "v": found[:, 5], "a": np.einsum("kj,kjt->kt", whole[:, 5], found)}


# rotating


def disc(torque: Any, weight: float = 0.0, friction: Any = 0.0) -> uqmbd.Mechanism:
    """Return a disc that a torque accelerates against an eccentric weight and friction."""
    made = uqmbd.Mechanism("disc", uqmbd.Planar(gravity=(0, -G)))
    body = made.body("disc", mass=1, inertia=0.5, position=(0, 0), angle=0.3)
    made.add(Revolute("axle", made.ground, body, point_i=(0, 0), point_j=(0, 0)))
    made.add(Torque("drive", body, torque=torque - weight * sympy.cos(body.angle)))
    made.add(TorsionSpringDamper("friction", made.ground, body, stiffness=0, damping=friction))
    made.output("height", body.point((0.2, 0))[1], units="m")
    made.output("angle", body.angle, units="rad")
    return made


def disc_motion(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the motion of a disc without weight and friction."""
    angle = 0.3 + x["torque"] * t**2
    return {"height": 0.2 * np.sin(angle), "angle": angle}


def pendulum(length: Any, speed: Any) -> uqmbd.Mechanism:
    """Return a point mass on a rod that starts in the lower position."""
    made = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -G)))
    rod = made.body(
        "rod",
        mass=1,
        inertia=0,
        position=(0, -length),
        angle=-sympy.pi / 2,
        velocity=(speed * length, 0),
        angular_velocity=speed,
    )
    pivot = made.add(Revolute("pivot", made.ground, rod, point_i=(0, 0), point_j=(-length, 0)))
    made.output("height", rod.position[1], units="m")
    made.output("force", pivot.reaction_force[1], units="N")
    return made


def pendulum_motion(x: Inputs, t: Array) -> dict[str, Array]:
    """Return height and vertical force of a pendulum that swings or turns."""
    length, speed = x.get("length", np.ones_like(x["speed"])), x["speed"]
    rate = np.sqrt(G / length)
    modulus = speed / (2 * rate)
    over = modulus > 1
    swinging, turning = np.where(over, 0.5, modulus), np.where(over, modulus, 2.0)
    sn, cn, _, _ = ellipj(rate * t, swinging**2)
    turn, _, dn, _ = ellipj(rate * turning * t, 1 / turning**2)
    half = np.where(over, turn, swinging * sn)
    rates = np.where(over, 2 * rate * turning * dn, 2 * rate * swinging * cn)
    cosine = 1 - 2 * half**2
    return {"height": -length * cosine, "force": (G * cosine + length * rates**2) * cosine}


def driven() -> uqmbd.Mechanism:
    """Return a slider-crank whose crank turns at a random speed; its lengths are random, too."""
    crank, rod = normal("crank_length", 0.15, 0.002, "m"), normal("rod_length", 0.4, 0.004, "m")
    speed = uniform("speed", 5.8, 6.2, "rad/s")
    made = uqmbd.Mechanism("slider_crank", uqmbd.Planar())
    bodies = [made.body("crank", mass=1, inertia=0.01), made.body("rod", mass=1, inertia=0.01, position=(crank, 0))]
    slider = made.body("slider", mass=1, inertia=0.01, position=(crank + rod, 0))
    made.add(Revolute("A", made.ground, bodies[0], (0, 0), (0, 0)))
    made.add(Revolute("B", bodies[0], bodies[1], (crank, 0), (0, 0)))
    made.add(Revolute("C", bodies[1], slider, (rod, 0), (0, 0)))
    made.add(Prismatic("D", made.ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    made.add(RotationDriver("drive", made.ground, bodies[0], speed * uqmbd.t))
    made.output("x", slider.position[0], units="m")
    return made


def driven_motion(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the position of the slider."""
    crank, angle = x["crank_length"], x["speed"] * t
    return {"x": crank * np.cos(angle) + np.sqrt(x["rod_length"] ** 2 - (crank * np.sin(angle)) ** 2)}


def spinning() -> uqmbd.Mechanism:
    """Return a free symmetric body whose spin and wobble are random."""
    made = uqmbd.Mechanism("top", uqmbd.Spatial(gravity=(0, 0, 0)))
    spin, wobble = normal("spin", 8.0, 0.3, "rad/s"), normal("wobble", 2.0, 0.2, "rad/s")
    body = made.body("top", mass=1, inertia=(0.02, 0.02, 0.03), angular_velocity=(wobble, 0, spin))
    made.output("axis_x", body.rotation[0, 2], units="1")
    made.output("axis_y", body.rotation[1, 2], units="1")
    return made


def spinning_motion(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the axis of the body, which turns about the angular momentum."""
    momentum = np.stack([0.02 * x["wobble"][:, 0], 0 * x["spin"][:, 0], 0.03 * x["spin"][:, 0]], axis=1)
    size = np.linalg.norm(momentum, axis=1, keepdims=True)
    about, turned = momentum / size, size / 0.02 * t
    along = about[:, 2:]
    return {
        "axis_x": about[:, :1] * along * (1 - np.cos(turned)),
        "axis_y": -about[:, :1] * np.sin(turned),
    }


# contact and events


def bouncing(height: Array, stiffness: Any, restitution: Any, t: Array, bounces: int = 40) -> Array:
    """Return heights (K, T) of dropped balls that a spring to the floor and gravity pull down."""
    rate = np.sqrt(stiffness + 1e-9)
    down = G / rate**2
    found = -down + (height + down) * np.cos(rate * t)
    impact = np.arccos(down / (height + down)) / rate
    speed = restitution * rate * np.sqrt((height + down) ** 2 - down**2)
    for _ in range(bounces):
        since = t - impact
        found = np.where(since < 0, found, -down + down * np.cos(rate * since) + speed / rate * np.sin(rate * since))
        impact = impact + 2 * np.arctan(speed / (rate * down)) / rate
        speed = restitution * speed
    return np.where(t < impact, found, 0.0)


def ball(low: float = 150.0, high: float = 250.0) -> uqmbd.Mechanism:
    """Make a ball that a spring pulls to a floor, on which it bounces."""
    made = uqmbd.Mechanism("ball", uqmbd.Line(gravity=-G))
    body = made.body("ball", mass=1, position=uniform("drop", 0.9, 1.1, "m"))
    made.add(PlaneImpact("floor", made.ground, body, 0, 0, 1, restitution=0.7))
    stiffness = uniform("k", low, high, K)
    made.add(SpringDamper("spring", made.ground, body, 0, 0, stiffness=stiffness, free_length=0))
    made.output("height", body.position[0], units="m")
    return made


def dropped() -> uqmbd.Mechanism:
    """Make a ball that falls from a random height on a floor of random restitution."""
    made = uqmbd.Mechanism("dropped", uqmbd.Line(gravity=-G))
    body = made.body("ball", mass=1, position=uniform("drop", 0.9, 1.1, "m"))
    restitution = uniform("restitution", 0.75, 0.85)
    made.add(PlaneImpact("floor", made.ground, body, 0, 0, 1, restitution=restitution))
    made.output("height", body.position[0], units="m")
    return made


def flights(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the heights of the dropped ball."""
    impact = np.sqrt(2 * x["drop"] / G)
    found, speed = x["drop"] - G * t**2 / 2, x["restitution"] * G * impact
    for _ in range(40):
        since = t - impact
        found = np.where(since < 0, found, speed * since - G * since**2 / 2)
        impact, speed = impact + 2 * speed / G, x["restitution"] * speed
    return {"height": np.where(t < impact, found, 0.0)}


def walls() -> uqmbd.Mechanism:
    """Make a mass that two walls throw back and forth."""
    made = uqmbd.Mechanism("walls", uqmbd.Line())
    body = made.body("mass", mass=1, position=0.5, velocity=uniform("speed", 0.95, 1.05, "m/s"))
    made.add(PlaneImpact("left", made.ground, body, 0, 0, 1, restitution=1))
    made.add(PlaneImpact("right", made.ground, body, 1, 0, -1, restitution=1))
    made.output("x", body.position[0], units="m")
    return made


def walls_motion(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the position between the walls: a triangle wave."""
    return {"x": 1 - np.abs((0.5 + x["speed"] * t) % 2 - 1)}


def sinking() -> uqmbd.Mechanism:
    """Make a body that sinks with viscous drag until it rests on the ground."""
    made = uqmbd.Mechanism("sinking", uqmbd.Line(gravity=-G))
    body = made.body("body", mass=uniform("m", 0.9, 1.1, "kg"), position=uniform("h", 1.8, 2.2, "m"))
    made.add(PlaneImpact("bottom", made.ground, body, 0, 0, 1, restitution=0))
    made.add(PointForce("drag", body, 0, -uniform("c", 3.5, 4.5, C) * body.velocity[0]))
    made.output("z", body.position[0], units="m")
    return made


def sinking_motion(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the height of the sinking body."""
    rate = x["c"] / x["m"]
    return {"z": np.maximum(x["h"] - G / rate * (t + np.expm1(-rate * t) / rate), 0.0)}


def kink() -> uqmbd.Mechanism:
    """Make an oscillator whose spring is stiffer on one side."""
    made = uqmbd.Mechanism("kink", uqmbd.Line())
    mass = made.body("mass", mass=1, position=uniform("start", 0.08, 0.12, "m"))
    stiffness = uniform("k", 90, 110, K)
    way = mass.position[0]
    made.add(PointForce("spring", mass, 0, -stiffness * way - 150 * sympy.Max(way, 0)))
    made.output("x", way, units="m")
    made.output("v", mass.velocity[0], units="m/s")
    return made


def kink_motion(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the motion of the oscillator with a kink, half swing by half swing."""
    stiff, soft, start = np.sqrt(x["k"] + 150), np.sqrt(x["k"]), x["start"]
    period = np.pi / stiff + np.pi / soft
    quarter, since = np.pi / (2 * stiff), t % period
    other = (since >= quarter) & (since < quarter + np.pi / soft)
    folded = np.where(since < quarter, since, since - period)
    beyond = since - quarter
    return {
        "x": np.where(other, -start * stiff / soft * np.sin(soft * beyond), start * np.cos(stiff * folded)),
        "v": np.where(other, -start * stiff * np.cos(soft * beyond), -start * stiff * np.sin(stiff * folded)),
    }


def trampoline() -> uqmbd.Mechanism:
    """Make a ball that falls on a one-sided spring."""
    made = uqmbd.Mechanism("trampoline", uqmbd.Line(gravity=-G))
    body = made.body("ball", mass=1, position=uniform("drop", 0.45, 0.55, "m"))
    stiffness = uniform("k", 900, 1100, K)
    made.add(PointForce("bed", body, 0, stiffness * sympy.Max(-body.position[0], 0)))
    made.output("height", body.position[0], units="m")
    return made


def trampoline_motion(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the height over the one-sided spring: parabolas and parts of sines."""
    rate, drop = np.sqrt(x["k"]), x["drop"]
    speed, down = np.sqrt(2 * G * drop), G / rate**2
    fall = speed / G
    contact = 2 * (np.pi - np.arctan(speed / (rate * down))) / rate
    since = (t + fall) % (2 * fall + contact)
    inside = since - 2 * fall
    flying = speed * since - G * since**2 / 2
    return {
        "height": np.where(
            inside < 0, flying, down * (np.cos(rate * inside) - 1) - speed / rate * np.sin(rate * inside)
        )
    }


def friction() -> uqmbd.Mechanism:
    """Make an oscillator with smoothed dry friction."""
    made = oscillator(uniform("k", 90, 110, K), velocity=1.0)
    mass = made.bodies["mass"]
    made.add(PointForce("friction", mass, 0, -uniform("limit", 0.1, 0.3, "N") * sympy.tanh(50 * mass.velocity[0])))
    return made


def double_well() -> uqmbd.Mechanism:
    """Make a damped mass with two equilibria, which of them depends on the inputs."""
    made = uqmbd.Mechanism("well", uqmbd.Line())
    mass = made.body("mass", mass=1, position=uniform("start", -0.1, 0.4, "m"), velocity=0.0)
    way = mass.position[0]
    made.add(PointForce("wells", mass, 0, uniform("k", 9, 11, K) * way * (1 - way**2) - 1.5 * mass.velocity[0]))
    made.output("x", way, units="m")
    return made


# controllers


def held(force: Array, speed: Array, place: Array, step: float, m: Array, c: Any = 0.0) -> tuple[Array, Array]:
    """Return place and speed after a step of constant force on a mass with viscous friction."""
    if np.all(np.asarray(c) == 0):
        return place + speed * step + force / m * step**2 / 2, speed + force / m * step
    rate, end = c / m, force / c
    decay = np.exp(-rate * step)
    return place + end * step + (speed - end) * (1 - decay) / rate, end + (speed - end) * decay


def pd(time: float, measured: Array) -> Array:
    """Return the force of a sampled PD controller that moves a cart to 1 m."""
    place, speed = measured.T
    return 8 * (1 - place) - 6 * speed


def cart() -> uqmbd.Mechanism:
    """Make a cart with viscous friction and a sampled PD controller of 10 Hz."""
    made = uqmbd.Mechanism("cart", uqmbd.Line())
    body = made.body("cart", mass=uniform("m", 1.7, 2.3, "kg"))
    control = uqmbd.Controller(
        measured=[body.position[0], body.velocity[0]], commanded={"force": "N"}, rate=10, function=pd
    )
    made.add(PointForce("motor", body, 0, control.command("force") - uniform("c", 0.5, 1.5, C) * body.velocity[0]))
    made.add(control)
    made.output("x", body.position[0], units="m")
    made.output("v", body.velocity[0], units="m/s")
    return made


def cart_motion(x: Inputs, t: Array, limit: float = np.inf) -> dict[str, Array]:
    """Return the motion of the cart by its recursion; each output time is a whole number of samples of 0.1 s."""
    place = speed = np.zeros_like(x["m"])
    found: dict[str, list[Array]] = {"x": [], "v": []}
    wanted = np.round(t * 10).astype(int)
    for sample in range(wanted[-1] + 1):
        if sample in wanted:
            found["x"].append(place)
            found["v"].append(speed)
        force = np.clip(8 * (1 - place) - 6 * speed, -limit, limit)
        place, speed = held(force, speed, place, 0.1, x["m"], x["c"])
    return {name: np.hstack(parts) for name, parts in found.items()}


def pi_speed(time: float, measured: Array, state: Array) -> tuple[Array, Array]:
    """Return the force of a sampled PI controller of a speed of 1 m/s, and its new integral."""
    error = 1 - measured[:, 0]
    return 4 * error + 6 * state[:, 0], state + 0.05 * error[:, None]


def cruise() -> uqmbd.Mechanism:
    """Make a cart with a PI controller of 20 Hz whose force is limited."""
    made = uqmbd.Mechanism("cruise", uqmbd.Line())
    body = made.body("cart", mass=uniform("m", 1.7, 2.3, "kg"))
    control = uqmbd.Controller(
        measured=[body.velocity[0]], commanded={"force": "N"}, rate=20, function=pi_speed, state={"sum": 0},
        limits=(-3, 3),
    )  # fmt: skip
    made.add(PointForce("motor", body, 0, control.command("force") - uniform("c", 0.5, 1.5, C) * body.velocity[0]))
    made.add(control)
    made.output("v", body.velocity[0], units="m/s")
    return made


def cruise_motion(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the speed of the cart by its recursion; each output time is a whole number of samples of 0.05 s."""
    speed = total = place = np.zeros_like(x["m"])
    found, wanted = [], np.round(t * 20).astype(int)
    for sample in range(wanted[-1] + 1):
        if sample in wanted:
            found.append(speed)
        force = np.clip(4 * (1 - speed) + 6 * total, -3, 3)
        total = total + 0.05 * (1 - speed)
        place, speed = held(force, speed, place, 0.05, x["m"], x["c"])
    return {"v": np.hstack(found)}


class Actuator(uqmbd.Component):
    """A force that follows a command with a delay of first order."""

    bodies, spaces = ("body",), (uqmbd.Line,)
    delay = uqmbd.Parameter("s", "time constant")
    gain = uqmbd.Parameter("N/m", "force per error")
    damping = uqmbd.Parameter("N s/m", "force per speed")

    def terms(self, p):
        """Yield the state of the force, and its virtual work."""
        force = p.state("force")
        command = p.gain * (1 - p.body.position[0]) - p.damping * p.body.velocity[0]
        yield uqmbd.Auxiliary(force, (command - force) / p.delay, initial=0)
        yield uqmbd.VirtualWork(force, p.body.velocity[0])


def servo() -> uqmbd.Mechanism:
    """Make a mass in a continuous closed loop with a slow actuator."""
    made = uqmbd.Mechanism("servo", uqmbd.Line())
    body = made.body("mass", mass=uniform("m", 0.9, 1.1, "kg"))
    delay, gain = uniform("delay", 0.04, 0.06, "s"), uniform("gain", 18, 22, K)
    made.add(Actuator("actuator", body, delay=delay, gain=gain, damping=6.0))
    made.output("x", body.position[0], units="m")
    return made


def servo_motion(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the motion of the closed loop."""
    m, delay, gain = (x[name][:, 0] for name in ("m", "delay", "gain"))
    whole = np.zeros((len(m), 3, 3))
    whole[:, 0, 1], whole[:, 1, 2] = 1.0, 1 / m
    whole[:, 2, 0], whole[:, 2, 1], whole[:, 2, 2] = -gain / delay, -6.0 / delay, -1 / delay
    return {"x": 1 + linear(whole, np.tile([-1.0, 0.0, 0.0], (len(m), 1)), t)[:, 0]}


# stiff, censored, timeless


def stiff() -> uqmbd.Mechanism:
    """Make a strongly damped mass: one time constant of 1e-4 s, one of 1 s."""
    return oscillator(uniform("k", 9e3, 1.1e4, K), uniform("c", 0.9e4, 1.1e4, C), 0.1)


def van_der_pol() -> uqmbd.Mechanism:
    """Make a relaxation oscillation: the damping is negative near the middle."""
    made = uqmbd.Mechanism("relaxation", uqmbd.Line())
    mass = made.body("mass", mass=1, position=uniform("start", 1.8, 2.2, "m"))
    way, speed = mass.position[0], mass.velocity[0]
    made.add(PointForce("force", mass, 0, uniform("mu", 9, 11, C) * (1 - way**2) * speed - way))
    made.output("x", way, units="m")
    return made


def threshold() -> uqmbd.Mechanism:
    """Make an oscillator that passes a level in some realisations: its time is censored in the others."""
    made = oscillator(normal("k", 100, 4, K), 0.0, 0.0, normal("speed", 1.0, 0.1, "m/s"))
    made.output("passing", uqmbd.first_time(made.bodies["mass"].position[0] >= 0.095), units="s")
    made.output("peak", uqmbd.maximum(made.bodies["mass"].position[0]), units="m")
    return made


def threshold_motion(x: Inputs, t: Array) -> dict[str, Array]:
    """Return motion, first passage and peak; the first quarter of the swing is before the last time."""
    rate = np.sqrt(x["k"])
    size = (x["speed"] / rate)[:, 0]
    passes = size >= 0.095
    when = np.arcsin(0.095 / np.where(passes, size, 1.0)) / rate[:, 0]
    return {**swing(t, x["k"], 0.0, 0.0, x["speed"]), "passing": np.where(passes, when, np.nan), "peak": size}


def arm() -> uqmbd.Mechanism:
    """Make the reach of an arm of four links at rest, in eight uniform inputs; the distance has a kink."""
    made = uqmbd.Mechanism("arm", uqmbd.Planar())
    place_x = place_y = angle = sympy.Integer(0)
    for i in range(4):
        angle = angle + uniform(f"theta{i}", 0, 2 * np.pi, "rad")
        length = uniform(f"L{i}", 0, 1, "m")
        along, up = length * sympy.cos(angle), length * sympy.sin(angle)
        made.body(f"link{i}", mass=1, inertia=1, position=(place_x + along / 2, place_y + up / 2), angle=angle)
        place_x, place_y = place_x + along, place_y + up
    made.output("reach", sympy.sqrt(place_x**2 + place_y**2), units="m")
    return made


def arm_reach(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the reach of the arm."""
    angle = np.cumsum(np.hstack([x[f"theta{i}"] for i in range(4)]), axis=1)
    length = np.hstack([x[f"L{i}"] for i in range(4)])
    reach = np.hypot((length * np.cos(angle)).sum(axis=1), (length * np.sin(angle)).sum(axis=1))
    return {"reach": np.tile(reach[:, None], len(t))}


def modal() -> uqmbd.Mechanism:
    """Make two masses in a row with their frequencies as outputs."""
    k1, k2 = random("k1", chaospy.LogNormal(0.4, 0.2), K), random("k2", chaospy.LogNormal(-0.2, 0.2), K)
    made = uqmbd.Mechanism("two_masses", uqmbd.Line())
    one, two = made.body("one", mass=1.0, position=1), made.body("two", mass=1.0, position=2)
    made.add(SpringDamper("s1", made.ground, one, 0, 0, stiffness=k1, free_length=1))
    made.add(SpringDamper("s2", one, two, 0, 0, stiffness=k2, free_length=1))
    made.output("f1", uqmbd.eigenfrequency(1), units="Hz")
    made.output("f2", uqmbd.eigenfrequency(2), units="Hz")
    return made


def modal_frequencies(x: Inputs, t: Array) -> dict[str, Array]:
    """Return both frequencies, Hz."""
    k1, k2 = x["k1"][:, 0], x["k2"][:, 0]
    half = k1 / 2 + k2
    root = np.sqrt(half**2 - k1 * k2)
    return {"f1": np.sqrt(half - root) / (2 * np.pi), "f2": np.sqrt(half + root) / (2 * np.pi)}


def seat() -> uqmbd.Mechanism:
    """Make a driver on a seat in a quarter car over a bump: 14 inputs, two of them dependent."""

    def of(name: str, mean: float, spread: float, units: str) -> uqmbd.RandomVariable:
        return normal(name, mean, spread * mean, units)

    joint = chaospy.Nataf(
        chaospy.J(chaospy.Normal(2.0e4, 1e3), chaospy.LogNormal(mu=7.3, sigma=0.12)), [[1, -0.4], [-0.4, 1]]
    )
    k_s, c_s = uqmbd.random_vector(["k_susp", "c_susp"], joint, [K, C])
    height = random("bump_height", chaospy.Trunc(chaospy.Normal(0.06, 0.01), 0.03, 0.09), "m")
    speed = uniform("speed", 5, 9, "m/s")
    made = uqmbd.Mechanism("seat", uqmbd.Line(gravity=-G))
    road = made.body("road", mass=1.0, position=0.0)
    wheel = made.body("wheel", mass=of("m_wheel", 40, 0.03, "kg"), position=0.3)
    body = made.body("body", mass=of("m_body", 320, 0.05, "kg"), position=0.8)
    chair = made.body("seat", mass=of("m_seat", 20, 0.03, "kg"), position=1.1)
    driver = made.body("driver", mass=random("m_driver", scipy.stats.lognorm(0.18, scale=75), "kg"), position=1.4)
    bump = haversine_bump(height, 0.8, start=1.0, along=speed * uqmbd.t)
    made.add(PositionDriver("bump", made.ground, road, 0, 0, 1, displacement=bump))
    for name, below, above, k, c, length in (
        ("tyre", road, wheel, of("k_tyre", 2.0e5, 0.08, K), of("c_tyre", 100, 0.2, C), 0.3),
        ("suspension", wheel, body, k_s, c_s, 0.7),
        ("cushion", body, chair, of("k_seat", 1.5e4, 0.1, K), of("c_seat", 300, 0.15, C), 0.36),
        ("spine", chair, driver, of("k_driver", 4.5e4, 0.15, K), random("c_driver", chaospy.Gamma(16, 90), C), 0.32),
    ):
        made.add(SpringDamper(name, below, above, 0, 0, stiffness=k, damping=c, free_length=length))
    made.output("driver_acceleration", driver.acceleration[0], units="m/s^2")
    made.output("travel", body.position[0] - wheel.position[0], units="m")
    return made


def orszag(x: Inputs, t: Array) -> dict[str, Array]:
    """Return the solution of the Kraichnan-Orszag problem."""
    found = kraichnan_orszag.exact(t, next(iter(x.values()))[:, 0])
    return {f"y{i + 1}": found[:, i] for i in range(3)}


MECHANISMS: dict[str, TestedMechanism] = {
    "oscillator": TestedMechanism(
        "smooth", lambda: oscillator(uniform("k", 90, 110, K)), 60, 601, {"order": 4},
        lambda x, t: swing(t, x["k"]), True, True,
    ),
    "oscillator, normal": TestedMechanism(
        "smooth", lambda: oscillator(normal("k", 100, 4, K)), 60, 601, {"order": 3},
        lambda x, t: swing(t, x["k"]), True,
    ),
    "start phase over a turn": TestedMechanism(
        "smooth", whole_turn, 20, 401, {"order": 6},
        lambda x, t: swing(t, x["k"], 0.0, 0.1 * np.cos(x["phase"]), -np.sin(x["phase"])), True,
    ),
    "damped oscillator": TestedMechanism(
        "smooth", lambda: oscillator(uniform("k", 90, 110, K), uniform("c", 0.01, 0.03, C)), 40, 801, {"order": 3},
        lambda x, t: swing(t, x["k"], x["c"]), True, True,
    ),
    "hardening spring": TestedMechanism(
        "smooth", lambda: oscillator(100.0, position=normal("begin", 0.3, 0.03, "m"), cubic=800.0), 30, 601,
        {"order": 4}, duffing, True, True,
    ),
    "long tail": TestedMechanism(
        "smooth", lognormal_start, 4, 101, {"order": 4}, lambda x, t: swing(t, x["k"], 0.4, x["begin"]), None, True,
    ),
    "two frequencies": TestedMechanism("smooth", two_frequencies, 20, 401, {"order": 3}, two_motions, False, True),
    "two modes of stiffness": TestedMechanism("smooth", bimodal, 4, 101, {"order": 4}, bimodal_motion),
    "disc, normal torque": TestedMechanism(
        "rotating", lambda: disc(normal("torque", 1.0, 0.05, "N m")), 14.2, 285, {"order": 4}, disc_motion, True, True,
    ),
    "disc, weight and friction": TestedMechanism(
        "rotating",
        lambda: disc(random("torque", chaospy.LogNormal(0.3, 0.1), "N m"), 0.5, uniform("c", 0.1, 0.12, "N m s")),
        12, 241, {"order": 4}, None, True,
    ),
    "rotating slider-crank": TestedMechanism(
        "closed loop", lambda: slider_crank_rotating.mechanism, 18.0, 901, {"order": 3}, None, True
    ),
    "pendulum": TestedMechanism(
        "rotating", lambda: pendulum(normal("length", 1.0, 0.02, "m"), uniform("speed", 2.0, 3.0, "rad/s")), 60, 1201,
        {"order": 3}, pendulum_motion, True, True,
    ),
    "pendulum that may turn": TestedMechanism(
        "rotating", lambda: pendulum(1.0, uniform("speed", 5.0, 8.0, "rad/s")), 6, 121,
        {"order": 3, "max_elements": 6}, pendulum_motion, False,
    ),
    "driven slider-crank": TestedMechanism("closed loop", driven, 3.0, 61, {"order": 3}, driven_motion, None, True),
    "free top": TestedMechanism("rotating", spinning, 3.0, 61, {"order": 4}, spinning_motion, None, True),
    "Kraichnan-Orszag": TestedMechanism(
        "rotating", lambda: kraichnan_orszag.mechanism, 10.0, 101, {"order": 4}, orszag
    ),
    "four-bar": TestedMechanism("closed loop", lambda: four_bar.study.mechanism, 1.0, 51, {"order": 3}),
    "bouncing ball": TestedMechanism(
        "contact", ball, 1.2, 121, {"order": 3}, lambda x, t: {"height": bouncing(x["drop"], x["k"], 0.7, t)}
    ),
    "dropped ball": TestedMechanism("contact", dropped, 1.4, 141, {"order": 3}, flights),
    "mass between walls": TestedMechanism("contact", walls, 3.0, 61, {"order": 3}, walls_motion),
    "sinking body": TestedMechanism("contact", sinking, 1.05, 64, {"order": 3}, sinking_motion),
    "spring with a kink": TestedMechanism("contact", kink, 10.0, 201, {"order": 3}, kink_motion, None, True),
    "trampoline": TestedMechanism("contact", trampoline, 2.0, 101, {"order": 3}, trampoline_motion),
    "dry friction": TestedMechanism("contact", friction, 5.0, 201, {"order": 3}),
    "double well": TestedMechanism("contact", double_well, 6.0, 61, {"order": 5}),
    "sampled controller": TestedMechanism("controller", cart, 2.0, 21, {"order": 3}, cart_motion, None, True),
    "controller with limits": TestedMechanism("controller", cruise, 2.0, 41, {"order": 3}, cruise_motion, None, True),
    "servo with a slow actuator": TestedMechanism("controller", servo, 3.0, 61, {"order": 3}, servo_motion, None, True),
    "damped chain": TestedMechanism("stiff", chain, 4.0, 201, {"order": 3}, chain_motion, None, True),
    "strong damper": TestedMechanism("stiff", stiff, 3.0, 61, {"order": 3}, lambda x, t: swing(t, x["k"], x["c"])),
    "relaxation oscillation": TestedMechanism("stiff", van_der_pol, 20.0, 101, {"order": 4}),
    "six inputs": TestedMechanism(
        "many inputs", forced, 19.9, 101, {"order": 3, "method": "regression"}, forced_motion, None, True
    ),
    "twelve inputs": TestedMechanism(
        "many inputs", coupled, 9.9, 100, {"order": 2, "method": "regression"}, coupled_motion
    ),
    "forty inputs": TestedMechanism(
        "many inputs", forty_springs, 2.0, 41, {"order": 1, "method": "regression"},
        lambda x, t: swing(t, sum(x.values())),
    ),
    "reach of an arm": TestedMechanism("many inputs", arm, 0.001, 2, {}, arm_reach),
    "driver's seat": TestedMechanism(
        "many inputs", seat, 1.5, 151, {"order": 1, "method": "regression"}, start="equilibrium"
    ),
    "dependent stiffness and damping": TestedMechanism(
        "dependent inputs", dependent_rates, 4.0, 101, {"order": 3}, lambda x, t: swing(t, x["k"], x["c"]), None, True,
    ),
    "dependent mass and stiffness": TestedMechanism(
        "dependent inputs", dependent_masses, 4.0, 101, {"order": 3},
        lambda x, t: swing(t, x["k"], 0.5, m=x["m"]),
    ),
    "censored passage": TestedMechanism("censored", threshold, 1.0, 51, {"order": 4}, threshold_motion),
    "two natural frequencies": TestedMechanism("without motion", modal, 0.0, 1, {}, modal_frequencies, None, True),
}  # fmt: skip
