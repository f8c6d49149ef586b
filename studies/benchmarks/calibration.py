"""Measure how well calibration finds known inputs: coverage of intervals, and errors relative to their lower bound.

There are two machines, each with true inputs drawn from the prior:

- slider-crank: it turns for 20 s; the record contains the position of the slider 20 times a second, with normal errors
  of 1 mm; unknown are the lengths of crank and rod (2 %) and the damping of the bearing (5 %), all normal;
- two masses: both frequencies (0.5 %) and the ratio of the masses in the first mode (2 %), each measured five times;
  unknown are both stiffnesses (20 %) and one mass (10 %), all lognormal.

uqmbd does not generate the records.  For the slider-crank, Runge-Kutta steps solve the one equation of the crank angle;
for the two masses, a quadratic equation has the roots.

Let ``J`` be the derivatives of the recorded values by the germs, divided by the noise.  Finite differences of these
direct models at the true inputs give ``J``.  For the model linearised there, ``(J^T J + 1)^-1`` is the covariance of
the posterior, with the information of the prior, which is 1 in germs.  This is the bound.  Its expectation over true
inputs bounds the mean square error of any estimate, up to the curvature of the model.  Van Trees' inequality bounds it
by the inverse of the expectation, which is smaller; the table also lists this bound.

For each input the table lists three numbers, all in germs: how often the 95 % interval contains the true input; the
root mean square distance from the posterior mean to the true input, over those of both bounds; and the mean width of
the interval over that of the bound.

Run: python studies/benchmarks/calibration.py [--truths N] [--from N] [--only CASE] [--save FILE] [--join FILES]
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import chaospy
import numpy as np
import sympy
from numpy.typing import NDArray

import uqmbd
from uqmbd_calibration import Record, Series, calibrate
from uqmbd_joints import Prismatic, Revolute
from uqmbd_springs import SpringDamper, Torque, TorsionSpringDamper

Array = NDArray[np.float64]

TIMES = np.linspace(0, 20, 401)
MILLIMETRE = 1e-3
REPEATED = 5
STEP = 1e-4
"""Step of finite differences, in germs."""


@dataclass(frozen=True)
class Case:
    """A machine with unknown inputs.

    Attributes
    ----------
    names : tuple of str
        Names of the inputs.
    direct : callable
        From inputs (K, input) to recorded values without errors (K, value), without code of uqmbd.
    noise : array, shape (value,)
        Standard deviations of one measurement.
    values, germs : callable
        From germs to inputs, and back.
    study : callable
        Creates the study.
    record : callable
        From values with errors (value, repetition) to a record.
    repeated : int
        Number of measurements of each value.
    """

    names: tuple[str, ...]
    direct: Callable[[Array], Array]
    noise: Array
    values: Callable[[Array], Array]
    germs: Callable[[Array], Array]
    study: Callable[[], uqmbd.Study]
    record: Callable[[Array], Record]
    repeated: int = 1


# the slider-crank


CRANK, ROD, SLIDER, TORQUE, GRAVITY = 0.36, 0.15, 0.10, 0.45, 9.81
MEANS, DEVIATIONS = np.array([0.15, 0.03, 0.35]), np.array([0.003, 0.0015, 0.007])
NAMES = ("crank_length", "damping", "rod_length")


def slider_places(inputs: Array, steps: int = 25) -> Array:
    """Return positions of the slider, shape (K, T), by Runge-Kutta steps of order 4 of the crank angle."""
    r, damping, length = (inputs[:, [k]] for k in range(3))

    def parts(angle: Array) -> tuple[Array, Array, Array, Array]:
        sine, cosine = np.sin(angle), np.cos(angle)
        s = -r * sine / length  # sine and cosine of the rod's angle, and its derivatives by the crank's
        c = np.sqrt(1 - s**2)
        b1 = -r * cosine / (length * c)
        b2 = (r * sine / length + s * b1**2) / c
        x1, x2 = -r * sine - length * s * b1, -r * cosine - length * (c * b1**2 + s * b2)
        m1, m2 = -r * sine - length / 2 * s * b1, -r * cosine - length / 2 * (c * b1**2 + s * b2)
        y1, y2 = r / 2 * cosine, -r / 2 * sine
        inertia = CRANK * r**2 / 3 + ROD * (m1**2 + y1**2 + length**2 / 12 * b1**2) + SLIDER * x1**2
        change = 2 * ROD * (m1 * m2 + y1 * y2 + length**2 / 12 * b1 * b2) + 2 * SLIDER * x1 * x2
        return inertia, change, GRAVITY * (CRANK + ROD) * r / 2 * cosine, r * cosine + length * c

    def rate(state: Array) -> Array:
        angle, speed = state[:, :1], state[:, 1:]
        inertia, change, weight, _ = parts(angle)
        return np.hstack([speed, (TORQUE - damping * speed - weight - change * speed**2 / 2) / inertia])

    state = np.tile([np.pi / 4, 0.0], (len(inputs), 1))
    h, found = (TIMES[1] - TIMES[0]) / steps, []
    for _ in TIMES:
        found.append(parts(state[:, :1])[3])
        for _ in range(steps):
            a = rate(state)
            b = rate(state + h / 2 * a)
            c = rate(state + h / 2 * b)
            d = rate(state + h * c)
            state = state + h / 6 * (a + 2 * b + 2 * c + d)
    return np.hstack(found)


def slider_crank() -> uqmbd.Study:
    """Return the study of the slider-crank."""
    crank_length, damping, rod_length = (
        uqmbd.RandomVariable(name, chaospy.Normal(mean, std), units=units)
        for name, mean, std, units in zip(NAMES, MEANS, DEVIATIONS, ("m", "N m s", "m"), strict=True)
    )
    pin = crank_length * sympy.cos(sympy.pi / 4)
    angle = -sympy.asin(pin / rod_length)
    place = pin + rod_length * sympy.cos(angle)
    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar(gravity=(0.0, -GRAVITY)))
    ground = mechanism.ground
    inertias = CRANK * crank_length**2 / 12, ROD * rod_length**2 / 12
    crank = mechanism.body("crank", CRANK, inertias[0], position=(pin / 2, pin / 2), angle=sympy.pi / 4)
    rod = mechanism.body("rod", ROD, inertias[1], position=((pin + place) / 2, pin / 2), angle=angle)
    slider = mechanism.body("slider", SLIDER, inertia=1e-4, position=(place, 0))
    mechanism.add(Revolute("crank_bearing", ground, crank, point_i=(0, 0), point_j=(-crank_length / 2, 0)))
    mechanism.add(Revolute("crank_pin", crank, rod, point_i=(crank_length / 2, 0), point_j=(-rod_length / 2, 0)))
    mechanism.add(Revolute("piston_pin", rod, slider, point_i=(rod_length / 2, 0), point_j=(0, 0)))
    mechanism.add(Prismatic("guide", ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.add(Torque("drive", crank, torque=TORQUE))
    mechanism.add(TorsionSpringDamper("bearing", ground, crank, stiffness=0, damping=damping))
    mechanism.output("slider_x", slider.position[0], units="m")
    return uqmbd.Study("slider-crank", mechanism, TIMES)


# two masses


STIFF, SPREAD = np.array([1.5, 0.8, 1.0]), np.array([0.2, 0.2, 0.1])
TWO = ("k1", "k2", "m2")


def modal_values(inputs: Array) -> Array:
    """Return both frequencies, Hz, and the ratio of the masses in the first mode, (K, 3), by a quadratic equation."""
    k1, k2, m2 = inputs.T
    half = (k1 + k2 + k2 / m2) / 2
    root = np.sqrt(half**2 - k1 * k2 / m2)
    first, second = half - root, half + root
    return np.stack([np.sqrt(first) / (2 * np.pi), np.sqrt(second) / (2 * np.pi), (k1 + k2 - first) / k2], axis=1)


def two_masses() -> uqmbd.Study:
    """Return the study of two masses in a row."""
    k1, k2, m2 = (
        uqmbd.RandomVariable(name, chaospy.LogNormal(mu=float(np.log(median)), sigma=float(s)), units=units)
        for name, median, s, units in zip(TWO, STIFF, SPREAD, ("N/m", "N/m", "kg"), strict=True)
    )
    mechanism = uqmbd.Mechanism("two_masses", uqmbd.Line())
    one, two = mechanism.body("one", mass=1.0, position=1), mechanism.body("two", mass=m2, position=2)
    mechanism.add(SpringDamper("s1", mechanism.ground, one, 0, 0, stiffness=k1, free_length=1))
    mechanism.add(SpringDamper("s2", one, two, 0, 0, stiffness=k2, free_length=1))
    mechanism.output("f1", uqmbd.eigenfrequency(1), units="Hz")
    mechanism.output("f2", uqmbd.eigenfrequency(2), units="Hz")
    mechanism.output("ratio", uqmbd.mode_shape(1, two.position[0], over=one.position[0]), units="1")
    return uqmbd.Study("two masses", mechanism)


MODAL_NOISE = np.array([0.005, 0.005, 0.02]) * modal_values(STIFF[None])[0]


def modal_record(measured: Array) -> Record:
    """Return a record of repeated measurements (3, R)."""
    about = zip(("f1", "f2", "ratio"), measured, ("Hz", "Hz", "1"), MODAL_NOISE, strict=True)
    return Record("modal test", [Series(name, [], values, units, float(noise)) for name, values, units, noise in about])


CASES = {
    "slider-crank": Case(
        names=NAMES,
        direct=slider_places,
        noise=np.full(len(TIMES), MILLIMETRE),
        values=lambda germs: MEANS + DEVIATIONS * germs,
        germs=lambda values: (values - MEANS) / DEVIATIONS,
        study=slider_crank,
        record=lambda measured: Record("run", [Series("slider_x", TIMES, measured[:, 0], "m", MILLIMETRE)]),
    ),
    "two masses": Case(
        names=TWO,
        direct=modal_values,
        noise=MODAL_NOISE,
        values=lambda germs: STIFF * np.exp(SPREAD * germs),
        germs=lambda values: np.log(values / STIFF) / SPREAD,
        study=two_masses,
        record=modal_record,
        repeated=REPEATED,
    ),
}


def records_of(case: Case, truths: int) -> tuple[Array, list[Record], Array]:
    """Draw true germs, and return them, their records, and their information ``J^T J`` without that of the prior."""
    random = np.random.default_rng(2026)
    germs = random.standard_normal((truths, len(case.names)))
    shifts = np.concatenate([np.zeros((1, len(case.names))), *(s * np.eye(len(case.names)) for s in (STEP, -STEP))])
    every = (germs[:, None] + shifts).reshape(-1, len(case.names))
    found = case.direct(case.values(every)).reshape(truths, len(shifts), -1)
    n = len(case.names)
    slopes = (found[:, 1 : n + 1] - found[:, n + 1 :]) / (2 * STEP) / case.noise * np.sqrt(case.repeated)
    errors = random.standard_normal((truths, found.shape[2], case.repeated)) * case.noise[:, None]
    return (
        germs,
        [case.record(clean[0][:, None] + e) for clean, e in zip(found, errors, strict=True)],
        (slopes @ slopes.transpose(0, 2, 1)),
    )


def run(name: str, first: int, truths: int, kept: Callable[[dict[str, object]], None]) -> None:
    """Calibrate with each record from the `first` on, and pass the accumulated results to `kept` after each."""
    case = CASES[name]
    germs, records, information = records_of(case, truths)
    study, rows = case.study(), []
    for k in range(first, truths):
        begin = time.perf_counter()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                found = calibrate(study, records[k], seed=k)
            except uqmbd.UqmbdError as error:
                print(f"{name} {k}: {error}", file=sys.stderr, flush=True)
                rows.append({"truth": k, "failed": str(error)})
                kept({"case": name, "information": information.tolist(), "rows": rows})
                continue
        posterior = found.tree["posterior"].dataset
        draws = case.germs(np.stack([posterior[x].values.ravel() for x in case.names], axis=1))
        low, middle, high = np.quantile(draws, [0.025, 0.5, 0.975], axis=0)
        bound = np.sqrt(np.diag(np.linalg.inv(information[k] + np.eye(len(case.names)))))
        row = {
            "truth": k,
            "held": ((low <= germs[k]) & (germs[k] <= high)).tolist(),
            "error": (draws.mean(axis=0) - germs[k]).tolist(),
            "width": (high - low).tolist(),
            "deviation": draws.std(axis=0).tolist(),
            "bound": bound.tolist(),
            "realisations": int(found.tree.attrs["realisations"]),
            "seconds": time.perf_counter() - begin,
            "warnings": [str(w.message) for w in caught],
        }
        rows.append(row)
        kept({"case": name, "information": information.tolist(), "rows": rows})
        z = np.array(row["error"]) / bound
        print(
            f"{name} {k}: error over bound {np.round(z, 2)}, width over the bound's "
            f"{np.round(np.array(row['width']) / (2 * 1.96 * bound), 2)}, {row['realisations']} realisations, "
            f"{row['seconds']:.1f} s {row['warnings'] or ''}",
            file=sys.stderr,
            flush=True,
        )


def table(name: str, information: Array, rows: list[dict[str, Any]]) -> str:
    """Format the results as a Markdown table."""
    case = CASES[name]
    good = [row for row in rows if "failed" not in row]
    if not good:
        return f"**{name}**: all {len(rows)} failed: {rows[0]['failed']}"
    error, bound, width, held = (np.array([row[x] for row in good]) for x in ("error", "bound", "width", "held"))
    vantrees = np.sqrt(np.diag(np.linalg.inv(information.mean(axis=0) + np.eye(len(case.names)))))
    spent = np.array([row["realisations"] for row in good])
    lines = [
        f"**{name}**: {len(rows)} truths, {len(rows) - len(good)} failures; realisations: median "
        f"{np.median(spent):.0f}, most {spent.max()}; with warnings {sum(bool(row['warnings']) for row in good)}; "
        f"{np.median([row['seconds'] for row in good]):.1f} s each",
        "",
        "| input | 95 % intervals that contain the truth | distance over the bound | over van Trees' bound "
        "| width over that of the bound | bound, in standard deviations of the prior |",
        "|---|---|---|---|---|---|",
    ]
    for i, one in enumerate(case.names):
        distance = np.sqrt(np.mean(error[:, i] ** 2))
        least = np.sqrt(np.mean(bound[:, i] ** 2))
        lines.append(
            f"| {one} | {held[:, i].sum()} of {len(good)} | {distance / least:.2f} | {distance / vantrees[i]:.2f} | "
            f"{np.mean(width[:, i] / (2 * 1.96 * bound[:, i])):.2f} | {least:.3g} |"
        )
    share = np.sqrt(np.mean((error / bound) ** 2))
    lines.append(f"| all | {held.sum()} of {held.size} | {share:.2f} | | | |")
    return "\n".join(lines)


def main() -> None:
    """Run the chosen cases, and print tables."""
    parser = argparse.ArgumentParser(description="Measure how well calibration finds known inputs.")
    parser.add_argument("--truths", type=int, default=100)
    parser.add_argument("--from", dest="first", type=int, default=0, help="number of the first truth to compute")
    parser.add_argument("--only", choices=CASES, action="append")
    parser.add_argument("--save", type=Path, help="JSON file for the rows")
    parser.add_argument("--join", type=Path, nargs="+", help="JSON files of parts to join in one table")
    given = parser.parse_args()
    if given.join:
        parts = [part for path in given.join for part in json.loads(path.read_text())]
    else:
        found: dict[str, dict[str, Any]] = {}

        def kept(part: dict[str, Any]) -> None:
            found[str(part["case"])] = part
            if given.save:
                given.save.write_text(json.dumps(list(found.values())))

        for name in given.only or CASES:
            run(name, given.first, given.truths, kept)
        parts = list(found.values())
    for name in dict.fromkeys(part["case"] for part in parts):
        own = [part for part in parts if part["case"] == name]
        rows = {row["truth"]: row for part in own for row in part["rows"]}
        information = np.array(max((part["information"] for part in own), key=len))
        print(table(name, information, list(rows.values())), end="\n\n")


if __name__ == "__main__":
    main()
