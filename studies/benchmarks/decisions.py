"""Cost of decisions: 32 double pendula with controllers or impacts, relative to the same without.

The controllers are a function and a law, at 100 Hz and at 1 kHz. A floor below the pendula is smooth or rough. The
table also contains the number of evaluations of the equations, of up to eight realisations each, relative to those
without decisions: a controller at 1 kHz needs at least one step for each millisecond.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/decisions.py [--repeat N] [--quick]``.
"""

from __future__ import annotations

import argparse
import os
import sys
from functools import partial
from pathlib import Path
from typing import Any

# this script times integrations alone, so it imports the core directly
os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path[:0] = [str(Path(__file__).resolve().parent)]

import chaospy
import numpy as np
from measure import Contender, interleave, show

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd_contact import PlaneImpact
from uqmbd_joints import Revolute
from uqmbd_springs import Torque

COUNT, TIMES = 32, np.linspace(0.0, 2.0, 101)
PLAIN = "plain"
FLOORS = {"smooth impacts": {}, "rough impacts": {"friction": 0.3}}


def torque(time: float, measured: Any) -> Any:
    """Return the torque of a PD controller, for arrays (realisation, measured)."""
    angle, speed = measured.T
    return -4.0 * angle - 0.8 * speed


def torque_law(time: Any, measured: Any) -> Any:
    """Return the same torque as an expression."""
    angle, speed = measured
    return -4.0 * angle - 0.8 * speed


def pendula(controller: dict[str, Any] | None = None, floor: dict[str, float] | None = None) -> Ensemble:
    """Return 32 double pendula of random length, with a controller or a floor."""
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.9, 1.1), units="m")
    mechanism = uqmbd.Mechanism("double pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    upper = mechanism.body("upper", mass=1, inertia=0.1, position=(length / 2, 0))
    lower = mechanism.body("lower", mass=1, inertia=0.1, position=(length + 0.5, 0))
    pivot = mechanism.add(Revolute("pivot", mechanism.ground, upper, (0, 0), (-length / 2, 0)))
    mechanism.add(Revolute("elbow", upper, lower, (length / 2, 0), (-0.5, 0)))
    if controller is not None:
        measured = [pivot.angle, upper.angular_velocity]
        loop = mechanism.add(uqmbd.Controller(measured=measured, commanded={"torque": "N m"}, **controller))
        mechanism.add(Torque("motor", upper, loop.command()))
    if floor is not None:
        plane: dict[str, Any] = {"point_i": (0, -1.0), "point_j": (0.5, 0), "normal_i": (0, 1)}
        mechanism.add(PlaneImpact("floor", mechanism.ground, lower, **plane, restitution=0.5, **floor))
    mechanism.output("x", lower.position[0], units="m")
    values = np.random.default_rng(0).uniform(0.9, 1.1, (COUNT, 1))
    ensemble = Ensemble(build(mechanism), values)
    assert ensemble.start.ok.all()
    return ensemble


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description="Time decisions.")
    parser.add_argument("--repeat", type=int, default=9)
    parser.add_argument("--quick", action="store_true", help="one round")
    options = parser.parse_args()
    laws: dict[str, dict[str, Any]] = {"law": {"law": torque_law}, "function": {"function": torque}}
    cases = {PLAIN: pendula()}
    for rate in (100, 1000):
        cases |= {f"{kind}, {rate} Hz": pendula({"rate": rate, **given}) for kind, given in laws.items()}
    cases |= {name: pendula(floor=floor) for name, floor in FLOORS.items()}
    contenders: list[Contender] = []
    least = 1
    for name, ensemble in cases.items():
        found = integrate(ensemble, TIMES, 1e-6, "auto")
        assert not any(found.messages), found.messages
        count = found.counters.accelerations
        least = count if name == PLAIN else least
        run = partial(integrate, ensemble, TIMES, 1e-6, "auto")
        contenders.append(Contender(name, run, PLAIN, notes=(str(count), f"{count / least:.1f}")))
    interleave(contenders, 1 if options.quick else options.repeat)
    show(f"{COUNT} double pendula, 2 s", contenders, ("evaluations", "relative"))


if __name__ == "__main__":
    main()
