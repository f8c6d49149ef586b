"""Time 1,000 realisations of an open chain of six links with random masses: uqmbd against MuJoCo's RK4 rollout.

The comparison is at equal error.  MuJoCo (extra ``bench``) has a model for each realisation; their creation is not
timed.  Errors are those of the angles, relative to a solution of the equations of the angles by a Runge-Kutta method of
order 8.  Both run on one thread.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/open_chain.py [--repeat N] [--quick]``.
"""

from __future__ import annotations

import argparse
import copy
import os
import sys
from pathlib import Path
from typing import Any

# this script times parts of the core (integration without outputs), so it imports the core directly
os.environ.setdefault("OMP_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE)]

import mechanisms
import mujoco as installed_mujoco
import numpy as np
from measure import Contender, console, interleave, matched, show
from mechanisms import GRAVITY, LINK
from mujoco import rollout
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import uqmbd
from uqmbd.dynamics import Ensemble, integrate
from uqmbd_montecarlo import MonteCarlo

Array = NDArray[np.float64]
mujoco: Any = installed_mujoco
"""MuJoCo as `Any`: it defines its names at import, so type checkers do not find them."""

NUMBER, JUDGED = 6, 16
WANTED = 1e-5
"""Median over the samples of the largest error of any angle at any time over its range."""
LADDER = (1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 3e-5, 2e-5, 1e-5, 7e-6, 5e-6, 3e-6, 2e-6, 1e-6, 5e-7)
STEPS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20)
"""Numbers of steps of MuJoCo between two output times."""
PEER, WHOLE = "MuJoCo, RK4 rollout", "uqmbd, whole study"


def reference(masses: Array, times: Array) -> Array:
    """Return angles from hanging down, shape (link, T), by the equations of an open chain of uniform rods."""
    length, n = LINK["length"], len(masses)
    beyond = np.concatenate([np.cumsum(masses[::-1])[::-1][1:], [0.0]])
    later = np.maximum.outer(np.arange(n), np.arange(n))
    coupling = length**2 * (masses / 2 + beyond)[later]
    coupling[np.diag_indices(n)] = length**2 * (masses / 3 + beyond)
    weight = GRAVITY * length * (masses / 2 + beyond)

    def rate(_: float, z: Array) -> NDArray[Any]:
        angle, speed = z[:n], z[n:]
        apart = angle[:, None] - angle
        force = -(coupling * np.sin(apart)) @ speed**2 - weight * np.sin(angle)
        return np.concatenate([speed, np.linalg.solve(coupling * np.cos(apart), force)])

    start = np.concatenate([np.full(n, LINK["angle"]), np.zeros(n)])
    found = solve_ivp(rate, (times[0], times[-1]), start, "DOP853", times, rtol=1e-11, atol=1e-12)
    return np.asarray(found.y[:n])


def peer_models(masses: Array) -> list[Any]:
    """Return the chain for MuJoCo, one model for each row of masses."""
    length, inner = LINK["length"], ""
    for k in reversed(range(NUMBER)):
        inner = (
            f'<body pos="0 0 {-length if k else 0}"><joint type="hinge" axis="0 -1 0"/>'
            f'<inertial pos="0 0 {-length / 2}" mass="1" diaginertia="1 1 1"/>{inner}</body>'
        )
    text = f"""
        <mujoco>
        <option gravity="0 0 {-GRAVITY}" integrator="RK4"><flag constraint="disable" contact="disable"/></option>
        <worldbody>{inner}</worldbody></mujoco>"""
    made = mujoco.MjModel.from_xml_string(text)
    models = []
    for row in masses:
        model = copy.copy(made)
        model.body_mass[1:] = row
        model.body_inertia[1:] = (row * length**2 / 12)[:, None]
        mujoco.mj_setConst(model, mujoco.MjData(model))
        models.append(model)
    return models


def rolled(models: list[Any], data: Any, times: Array, steps: int) -> Array:
    """Return angles from hanging down by MuJoCo, shape (K, link, T)."""
    for model in models:
        model.opt.timestep = (times[1] - times[0]) / steps
    # time, angles of the joints, speeds
    start = np.zeros(1 + 2 * NUMBER)
    start[1] = LINK["angle"]
    count = steps * (len(times) - 1)
    states = np.asarray(rollout.rollout(models, data, np.tile(start, (len(models), 1)), nstep=count)[0])
    joint = np.concatenate([np.tile(start, (len(models), 1, 1)), states[:, steps - 1 :: steps]], axis=1)
    return np.cumsum(joint[:, :, 1 : 1 + NUMBER], axis=2).transpose(0, 2, 1)


def error(found: Array, expected: Array) -> Array:
    """Return the error of each sample with a reference solution."""
    found = found[: len(expected)]
    return np.asarray((np.abs(found - expected).max(axis=2) / np.ptp(expected, axis=2)).max(axis=1))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=5, help="rounds that count (default 5)")
    parser.add_argument("--quick", action="store_true", help="128 samples, two rounds")
    options = parser.parse_args()
    samples, repeat = (128, 2) if options.quick else (1000, options.repeat)
    times = np.linspace(0, LINK["end"], 201)
    mechanism = mechanisms.links(NUMBER)

    def study(rtol: float) -> uqmbd.Study:
        return uqmbd.Study("links", mechanism, times, [MonteCarlo(samples=samples, seed=1)], rtol=rtol)

    coarse = study(1e-3)
    model, values = coarse.model, np.asarray(coarse.run()["monte-carlo/samples"]["inputs"])
    expected = np.array([reference(row, times) for row in values[:JUDGED]])
    models, data = peer_models(values), mujoco.MjData(peer_models(values[:1])[0])

    def ours(values: Array, rtol: float) -> Array:
        ensemble = Ensemble(model, values)
        return ensemble.outputs(times, integrate(ensemble, times, rtol).states)

    rtol, _ = matched(lambda x: float(np.median(error(ours(values[:JUDGED], x), expected))), LADDER, WANTED)
    steps, _ = matched(
        lambda k: float(np.median(error(rolled(models[:JUDGED], data, times, int(k)), expected))), STEPS, WANTED
    )
    of_ours, of_theirs = (
        error(found, expected)
        for found in (ours(values[:JUDGED], rtol), rolled(models[:JUDGED], data, times, int(steps)))
    )

    def note(found: Array) -> str:
        return f"{np.median(found):.0e}, {found.max():.0e}"

    fine, ready = study(rtol), Ensemble(model, values)
    fine.model  # noqa: B018 - compiled now
    assert ready.start.ok.all()
    notes = f"{rtol:.0e}", note(of_ours)
    contenders = [
        Contender(WHOLE, lambda: fine.propagate(fine.propagators[0]), PEER, notes=notes),
        Contender("uqmbd, states and outputs", lambda: ours(values, rtol), PEER, notes=notes),
        Contender("uqmbd, integration, assembled", lambda: integrate(ready, times, rtol), PEER, notes=notes),
        Contender(
            PEER,
            lambda: rolled(models, data, times, int(steps)),
            PEER,
            notes=(f"{int(steps)} steps an output", note(of_theirs)),
        ),
    ]
    interleave(contenders, repeat)
    for c in contenders:
        c.notes = (*c.notes, f"{1e6 * float(np.median(c.cpu)) / samples:.3g}")
    columns = ("tolerance", "median, largest error", "us a realisation")
    show(f"Open chain of {NUMBER} links, {samples} realisations, {repeat} rounds", contenders, columns, unit="s")
    theirs = np.array(contenders[-1].cpu)
    for c in contenders[:-1]:
        ratio = theirs / np.array(c.cpu)
        console.print(f"{PEER} over {c.name}: {np.median(ratio):.1f} ({ratio.min():.1f} to {ratio.max():.1f})")


if __name__ == "__main__":
    main()
