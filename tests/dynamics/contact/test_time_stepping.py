"""Bodies with one or two rough feet move as by Moreau's time stepping with Newton's and Coulomb's laws [1]_.

Three feet in a line are no test: they close at the same instant, and the order in which a time step finds them closed
changes the impact.  Steps of other sizes, and feet that count as closed at small gaps, lead to other motions.

.. [1] J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, Nonsmooth Mechanics and
   Applications, Springer 1988.
"""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd_contact import PlaneImpact
from uqmbd_drivers import PositionDriver
from uqmbd_joints import Prismatic

G, INERTIA, END = 9.81, 0.02, 0.6
FEET = {"foot": (0.1,), "legs": (-0.1, 0.1), "belt": (-0.1, 0.1), "wedge": (-0.1, 0.1)}
RANGES = {
    "height": (0.25, 0.3), "angle": (-0.3, 0.3), "vx": (-1, 1), "spin": (-3, 3), "mu": (0.05, 0.4), "tilt": (-0.25, 0.25),
    "run": (-1, 1), "slope": (0.4, 0.7),
}  # fmt: skip
STEPS = (600, 2400)
SWEEPS = 30
NUMBERS = {name: uqmbd.RandomVariable(name, chaospy.Uniform(*limits)) for name, limits in RANGES.items()}


def normals(kind, x):
    """Return the normal (x, y) of the plane of each foot, not normalised."""
    if kind == "wedge":
        return [(x["slope"], 1 + 0 * x["slope"]), (-x["slope"], 1 + 0 * x["slope"])]
    lean = 0 * x["tilt"] if kind == "belt" else x["tilt"]
    return [(lean, 1 + 0 * lean)] * len(FEET[kind])


def body_on_feet(kind):
    """A square body above planes: the ground, a belt that runs, or two slopes."""
    mechanism = uqmbd.Mechanism(kind, uqmbd.Planar(gravity=(0, -G)))
    x = NUMBERS
    motion = {"velocity": (x["vx"], 0), "angular_velocity": x["spin"]}
    body = mechanism.body("body", mass=1, inertia=INERTIA, position=(0, x["height"]), angle=x["angle"], **motion)
    ground = mechanism.ground
    if kind == "belt":
        ground = mechanism.body("belt", mass=1, inertia=1, velocity=(x["run"], 0))
        mechanism.add(Prismatic("guide", mechanism.ground, ground, (0, 0), (0, 0), (1, 0), (1, 0)))
        mechanism.add(PositionDriver("motor", mechanism.ground, ground, (0, 0), (0, 0), (1, 0), x["run"] * uqmbd.t))
    for k, (place, up) in enumerate(zip(FEET[kind], normals(kind, x), strict=True)):
        law = {"restitution": 0, "friction": x["mu"]}
        mechanism.add(PlaneImpact(f"foot{k}", ground, body, (0, 0), (place, -0.1), up, **law))
    for name, value in {"x": body.position[0], "y": body.position[1], "angle": body.angle}.items():
        mechanism.output(name, value)
    return mechanism


def stepped(kind, x, steps):
    """Return positions and angles (3, B) at the end; impulses by projected Gauss-Seidel sweeps over the feet."""
    h, mass = END / steps, np.array([1, 1, INERTIA])[:, None]
    zero = 0 * x["vx"]
    q, v = np.array([zero, x["height"], x["angle"]]), np.array([x["vx"], zero, x["spin"]])
    planes = [np.array(up) / np.hypot(*up) for up in normals(kind, x)]
    runs = x["run"] if kind == "belt" else zero
    for _ in range(steps):
        q = q + h / 2 * v
        v[1] -= h * G
        c, s = np.cos(q[2]), np.sin(q[2])
        rows = []
        for place, (nx, ny) in zip(FEET[kind], planes, strict=True):
            rx, ry = c * place + s * 0.1, s * place - c * 0.1
            across, along = np.array([nx, ny, rx * ny - ry * nx]), np.array([ny, -nx, -rx * nx - ry * ny])
            active = (q[0] + rx) * nx + (q[1] + ry) * ny <= 0
            sizes = [np.sum(d * d / mass, axis=0) for d in (across, along)]
            rows.append((across, along, *sizes, active, np.zeros_like(zero), np.zeros_like(zero)))
        for _ in range(SWEEPS if any(row[4].any() for row in rows) else 0):
            for across, along, normal_size, size, active, pushed, rubbed in rows:
                new = np.where(active, np.maximum(0, pushed - np.sum(across * v, axis=0) / normal_size), 0)
                v += across / mass * (new - pushed)
                pushed[:] = new
                most = x["mu"] * pushed
                new = np.clip(rubbed - (np.sum(along * v, axis=0) - runs * along[0]) / size, -most, most)
                v += along / mass * (new - rubbed)
                rubbed[:] = new
        q = q + h / 2 * v
    return q


@pytest.mark.thorough
@pytest.mark.parametrize("kind", FEET)
def test_bodies_on_feet_move_as_by_time_stepping(kind):
    """The difference is of first order in the step, at most 6 m/s times the step."""
    mechanism = body_on_feet(kind)
    values = mechanism.inputs.from_uniform(np.random.default_rng(4).uniform(size=(24, len(mechanism.inputs))))
    x = dict(zip(mechanism.inputs.names, values.T, strict=True))
    x |= {name: np.zeros(len(values)) for name in RANGES.keys() - x.keys()}
    ensemble = Ensemble(build(mechanism), values)
    found = integrate(ensemble, np.array([0, END]), 1e-8)
    assert not any(found.messages)
    ends = ensemble.outputs(found.times, found.states)[:, :, -1].T
    coarse, fine = (np.abs(ends - stepped(kind, x, steps))[:2].max(axis=0) for steps in STEPS)
    assert fine.max() < 6 * END / STEPS[1]
    assert np.median(fine) < 0.5 * np.median(coarse)
