"""Three mechanisms whose phases drift apart over long times: plain chaos fails, and aligned chaos stays accurate.

- ``slider-crank``: the rotating slider-crank of `slider_crank_rotating.py`, for 100 turns;
- ``pendulum``: the pendulum of `pendulum.py`, which swings freely, for 500 s;
- ``governor``: two balls on hinged arms open as their shaft turns faster, and reduce the torque of the engine that
  drives it.  The load and the masses of the balls are uncertain.  Each realisation therefore settles at a different
  speed, after an oscillating start.

At a fixed time, a polynomial of the inputs approximates an output for some turns only: then the phases of the
realisations are too far apart.  At equal phase of a clock the realisations stay similar, and the same nodes suffice for
all times.  Monte Carlo runs for comparison.  Run as a script it prints a table, and plots the error and the standard
deviation over time::

    OMP_NUM_THREADS=1 python studies/long_time.py [--figure long_time.png]
"""

import argparse
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import chaospy
import numpy as np
import pendulum
import slider_crank_rotating
import sympy
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

import uqmbd
from uqmbd.results import surrogate
from uqmbd_collocation import Collocation
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import RotationalFriction, Torque

Array = NDArray[np.float64]

REALISATIONS = 40
"""Number of independent realisations that errors are measured against."""
LIMIT = 0.01
"""Error relative to the largest standard deviation of an output at which a horizon ends."""


def governor() -> uqmbd.Mechanism:
    """Return an engine with a governor: its torque falls as the balls rise, against a viscous load."""
    load = uqmbd.RandomVariable("load", chaospy.Normal(0.25, 0.005), units="N m s/rad")
    ball_mass = uqmbd.RandomVariable("ball_mass", chaospy.Normal(1.0, 0.02), units="kg")
    arm, offset, drawn = 0.3, 0.05, 0.6
    made = uqmbd.Mechanism("governor", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    shaft = made.body("shaft", mass=1, inertia=(0.1, 0.1, 0.05), angular_velocity=(0, 0, 6.0))
    made.add(Revolute("bearing", made.ground, shaft, at=(0, 0, 0), axis=(0, 0, 1)))
    heights = []
    for side, sign in (("left", -1), ("right", 1)):
        at = (sign * (offset + arm * np.sin(drawn)), 0, -arm * np.cos(drawn))
        ball = made.body(side, mass=ball_mass, inertia=(0.002, 0.002, 0.002), position=at)
        made.add(Revolute(f"{side}_hinge", shaft, ball, at=(sign * offset, 0, 0), axis=(0, 1, 0)))
        made.add(RotationalFriction(f"{side}_friction", shaft, ball, friction=0, damping=0.15, axis_i=(0, 1, 0)))
        heights.append(ball.position[2])
    made.add(Torque("load", shaft, torque=(0, 0, -load * shaft.angular_velocity[2])))
    made.add(Torque("engine", shaft, torque=(0, 0, -12.0 * sympy.Add(*heights) / 2)))
    made.output("speed", shaft.angular_velocity[2], units="rad/s")
    made.output("height", heights[0], units="m")
    made.output("ball_x", ball.position[0], units="m")
    return made


@dataclass(frozen=True)
class Case:
    """A mechanism, the length of its simulation, and the output in the figure.

    Attributes
    ----------
    mechanism : uqmbd.Mechanism
        With random inputs.
    end, count : float, int
        Last output time, s, and number of output times.
    shown : str
        Name of the output in the figure.
    """

    mechanism: uqmbd.Mechanism
    end: float
    count: int
    shown: str

    def study(self, end: float | None = None) -> uqmbd.Study:
        """Return the study up to its last time or an earlier one, with the same density of output times."""
        last = self.end if end is None else end
        times = np.linspace(0, last, 1 + round((self.count - 1) * last / self.end))
        return uqmbd.Study(self.mechanism.name, self.mechanism, times=times, rtol=1e-8, propagators=list(METHODS))


METHODS = (
    MonteCarlo(samples=500, seed=1),
    Collocation(order=3, label="plain"),
    Collocation(order=3, alignment="phase", label="aligned"),
)
CASES = {
    "slider-crank": Case(slider_crank_rotating.mechanism, 42.0, 4201, "pin_force"),
    "pendulum": Case(pendulum.mechanism, 500.0, 10001, "tip_height"),
    "governor": Case(governor(), 90.0, 1801, "ball_x"),
}

study = CASES["slider-crank"].study()


@dataclass(frozen=True)
class Comparison:
    """Results of the methods for a study, and errors of the chaoses.

    Attributes
    ----------
    study : uqmbd.Study
        The study.
    nodes : dict
        Results of the methods, xarray.DataTree, by name.
    errors : dict
        Errors of the chaoses, by name: root mean square over independent realisations, divided by the largest
        standard deviation of each output over time, shape (O, T).
    """

    study: uqmbd.Study
    nodes: Mapping[str, xr.DataTree]
    errors: Mapping[str, Array]

    def horizons(self, name: str) -> Array:
        """Return the time (O,) until which the error of each output stays below the limit, s."""
        return np.array([horizon(self.study.times, row) for row in self.errors[name]])


def horizon(times: Array, errors: Array, limit: float = LIMIT) -> float:
    """Return the last time before errors (T,) exceed a limit; inf if they never do."""
    above = np.flatnonzero(~(errors <= limit))
    return float(times[max(above[0] - 1, 0)]) if len(above) else np.inf


def realisations(of: uqmbd.Study, count: int = REALISATIONS, seed: int = 9) -> tuple[Array, Array]:
    """Return inputs (K, d) and responses (K, O, T) of independent realisations."""
    problem = of.problem(METHODS[0])
    space = problem.germ_space("rosenblatt")
    inputs = space.to_inputs(space.from_uniform(np.random.default_rng(seed).random((count, space.dimension))))
    return inputs, problem.realise(inputs).response


def errors(node: xr.DataTree, inputs: Array, responses: Array) -> Array:
    """Return the error (O, T) of a chaos at realisations, divided by their largest standard deviation over time."""
    wrong = surrogate(node).evaluate(inputs) - responses
    return np.sqrt((wrong**2).mean(axis=0)) / responses.std(axis=0).max(axis=-1, keepdims=True)


def compare(of: uqmbd.Study) -> Comparison:
    """Compute a study by all its methods, and measure the errors of the chaoses."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a plain chaos warns that it fails, which the study shows
        nodes = {method.node_name: of.propagate(method) for method in of.propagators}
    inputs, responses = realisations(of)
    return Comparison(of, nodes, {name: errors(nodes[name], inputs, responses) for name in ("plain", "aligned")})


def table(found: Mapping[str, Comparison]) -> Table:
    """Return a table of horizons, errors and costs."""
    made = Table(title=f"Errors against {REALISATIONS} independent realisations, over the largest standard deviation")
    for column in (
        "output",
        "until, s",
        "plain: 1 % until, s",
        "at the end",
        "aligned: 1 % until, s",
        "largest",
        "cost",
    ):
        made.add_column(column, justify="left" if column in ("output", "cost") else "right")
    for name, one in found.items():
        plain, aligned = (one.errors[method] for method in ("plain", "aligned"))
        ends = zip(one.horizons("plain"), one.horizons("aligned"), strict=True)
        attrs = one.nodes["aligned"].attrs
        cost = f"{attrs['realisations']} realisations, {attrs['longer']:.3g} times as long, clock {attrs['clock']}"
        for k, (output, (first, last)) in enumerate(zip(one.study.mechanism.outputs, ends, strict=True)):
            until = "the end" if np.isinf(last) else f"{last:.4g}"
            made.add_row(
                f"{name}: {output}",
                f"{one.study.times[-1]:g}",
                "the end" if np.isinf(first) else f"{first:.3g}",
                f"{plain[k, -1]:.2g}",
                until,
                f"{aligned[k].max():.1e}",
                cost if not k else "",
            )
    return made


def figure(found: Mapping[str, Comparison], cases: Mapping[str, Case]) -> Figure:
    """Plot error and standard deviation of each study over time, and the standard deviation near the end."""
    drawn = Figure(figsize=(13.3, 7.5), layout="constrained")
    rows = drawn.subplots(3, len(found), squeeze=False, height_ratios=(1.4, 1, 1))
    for (name, one), upper, middle, lower in zip(found.items(), *rows, strict=True):
        shown = cases[name].shown
        row = list(one.study.mechanism.outputs).index(shown)
        times, end = one.study.times, one.study.times[-1]
        units = one.study.mechanism.outputs[shown].units
        upper.set_title(f"{name}: {shown}")
        std = {key: node["statistics"]["std"].sel(output=shown).values for key, node in one.nodes.items()}
        for method in ("plain", "aligned"):
            at, most = largest(times, one.errors[method][row])
            upper.semilogy(at, 100 * most, color=COLOURS[method])
        upper.axhline(100 * LIMIT, color="0.4", linestyle="--", linewidth=1)
        upper.annotate("1 %", (end, 100 * LIMIT), (0, 3), textcoords="offset points", ha="right", color="0.3")
        upper.set_ylim(1e-5, 3e2)
        for method, values in std.items():
            middle.plot(*largest(times, values), color=COLOURS[method], **STYLES[method])
            late = times >= end - 0.012 * (end - times[0]) * (3 if name == "governor" else 1)
            lower.plot(times[late], values[late], color=COLOURS[method], **STYLES[method])
        middle.set_ylim(0, None)
        lower.set_ylim(0, None)
        upper.set_xlabel("time, s")
        middle.set_xlabel("time, s: largest of each hundredth")
        lower.set_xlabel("time, s: the end")
        if upper is rows[0][0]:
            upper.set_ylabel("error relative to the largest\nstandard deviation, %")
        middle.set_ylabel(f"standard deviation, {units}")
        lower.set_ylabel(f"standard deviation, {units}")
    drawn.legend(*rows[2][0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return drawn


COLOURS = {"monte-carlo": "0.75", "plain": "#d1495b", "aligned": "#00798c"}
STYLES = {
    "monte-carlo": {"linewidth": 5, "label": "Monte Carlo, 500 samples"},
    "plain": {"linewidth": 1, "label": "plain chaos"},
    "aligned": {"linewidth": 1.6, "label": "aligned chaos"},
}


def largest(times: Array, values: Array, parts: int = 100) -> tuple[Array, Array]:
    """Return the largest of values (T,) in each of `parts` intervals of the times, and the midpoints of these."""
    pieces = np.array_split(np.arange(len(times)), min(parts, len(times)))
    return np.array([times[k].mean() for k in pieces]), np.array([values[k].max() for k in pieces])


def main() -> None:
    """Print the table, and write the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--figure", type=Path, help="file for the figure (PNG, SVG, PDF)")
    options = parser.parse_args()
    found = {name: compare(case.study()) for name, case in CASES.items()}
    Console(width=180).print(table(found))
    if options.figure is not None:
        figure(found, CASES).savefig(options.figure, dpi=150)


if __name__ == "__main__":
    main()
