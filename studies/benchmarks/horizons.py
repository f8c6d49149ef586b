"""Measure the horizon at 1 % of the largest standard deviation of chaoses, plain and aligned at equal phase.

All studies that rotate or oscillate use the same nodes for both.  Errors are root mean squares over 40 independent
realisations.  A horizon ends at the first output time with a larger error.  If it does not end, the ratio is a lower
bound.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/horizons.py [--only NAME ...] [--quick]``; `--quick` simulates a
tenth of the time.
"""

from __future__ import annotations

import argparse
import os
import runpy
import sys
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

os.environ.setdefault("OMP_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import long_time
import numpy as np
from measure import console, spent, table_of
from numpy.typing import NDArray

import uqmbd
from uqmbd_collocation import Collocation

Array = NDArray[np.float64]

CONSTANT = 1e-9
"""Standard deviation over the range of an output below which it is constant, as the angle of a driven crank."""


def mechanism_of(name: str) -> uqmbd.Mechanism:
    """Return a new copy of the mechanism of a study."""
    made: uqmbd.Mechanism = runpy.run_path(str(HERE.parent / f"{name}.py"))["mechanism"]
    return made


def with_random_torque() -> uqmbd.Mechanism:
    """Return the rotating slider-crank with a third input: different speeds make its phases drift apart."""
    made = mechanism_of("slider_crank_rotating")
    made.randomise("drive.torque", relative=0.02)
    return made


@dataclass(frozen=True)
class Case:
    """A study: factory of the mechanism, its last time (s) and number of times, and options of both collocations."""

    make: Callable[[], uqmbd.Mechanism]
    end: float
    count: int
    options: Mapping[str, Any] = field(default_factory=lambda: {"order": 3})


CASES = {
    "slider-crank, rotating": Case(lambda: mechanism_of("slider_crank_rotating"), 840.0, 1681),
    "slider-crank, rotating, to 36 s": Case(lambda: mechanism_of("slider_crank_rotating"), 36.0, 3601),
    "slider-crank, random torque": Case(with_random_torque, 36.0, 721),
    "slider-crank, driven": Case(lambda: mechanism_of("slider_crank_driven"), 20.0, 2001),
    "slider-crank, coming to rest": Case(lambda: mechanism_of("slider_crank"), 10.0, 1001),
    "pendulum": Case(lambda: mechanism_of("pendulum"), 500.0, 2501),
    "governor": Case(long_time.governor, 120.0, 1201),
    "Kraichnan-Orszag": Case(
        lambda: mechanism_of("published/kraichnan_orszag"),
        115.0,
        1151,
        {"order": 7, "elements": 32},
    ),
    "clearance": Case(lambda: mechanism_of("clearance"), 0.2, 401),
    "Agile Eye": Case(lambda: mechanism_of("agile_eye"), 3.0, 301, {"order": 4}),
}


def shown(value: float, end: float) -> str:
    """Format a horizon."""
    return f"> {end:g}" if np.isinf(value) else f"{value:.3g}"


def ratio(plain: float, aligned: float, end: float) -> str:
    """Format the ratio of two horizons."""
    if np.isinf(plain):
        return ""
    factor = min(aligned, end) / max(plain, 1e-300) if plain else np.inf
    return "" if np.isinf(factor) else f"{'> ' if np.isinf(aligned) else ''}{factor:.3g}"


def rows(case: Case, name: str, end: float) -> list[tuple[str, ...]]:
    """Compute a study by both methods, and return the rows of the table."""
    times = np.linspace(0, end, 1 + round((case.count - 1) * end / case.end))
    study = uqmbd.Study(name, case.make(), times=times, rtol=1e-9, propagators=[])
    inputs, responses = long_time.realisations(study)
    found: dict[str, Any] = {}
    costs: dict[str, float] = {}
    why = ""
    ways: dict[str, Literal["phase"] | None] = {"plain": None, "aligned": "phase"}
    for label, alignment in ways.items():
        method = Collocation(alignment=alignment, label=label, **case.options)

        def run(label: str = label, method: Collocation = method) -> None:
            found[label] = study.propagate(method)

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # the table shows these errors
                costs[label] = spent(run)
        except uqmbd.StudyError as error:
            why = "refused: no clock" if "there is none" in str(error) else f"refused: {error}"
    wrong = {label: long_time.errors(node, inputs, responses) for label, node in found.items()}
    constant = responses.std(axis=0).max(axis=-1) < CONSTANT * np.ptp(responses, axis=(0, 2))
    made = []
    for k, output in enumerate(study.mechanism.outputs):
        if constant[k]:
            continue
        first = long_time.horizon(times, wrong["plain"][k])
        row = [output, shown(first, end)]
        if "aligned" in wrong:
            last, attrs = long_time.horizon(times, wrong["aligned"][k]), found["aligned"].attrs
            row += [shown(last, end), ratio(first, last, end), f"{np.nanmax(wrong['aligned'][k]):.1e}"]
            row += [
                f"{attrs['clock']} ({attrs['clock_kind']})",
                f"{found['plain'].attrs['realisations']}, {attrs['realisations']}",
                f"{attrs['longer']:.3g}",
                f"{costs['plain']:.3g}, {costs['aligned']:.3g}",
            ]
        else:
            row += ["", "", "", why, f"{found['plain'].attrs['realisations']}", "", f"{costs['plain']:.3g}"]
        made.append(tuple(row))
    return made


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=list(CASES), help="some of the studies")
    parser.add_argument("--quick", action="store_true", help="a tenth of the time")
    options = parser.parse_args()
    columns = (
        "output",
        "plain: 1 % until, s",
        "aligned",
        "ratio",
        "largest error",
        "clock",
        "realisations, plain and aligned",
        "simulated time, factor",
        "processor time, s",
    )
    for name in options.only or CASES:
        case = CASES[name]
        table = table_of(f"Horizons at 1 % of the largest standard deviation: {name}", *columns)
        for row in rows(case, name, case.end / 10 if options.quick else case.end):
            table.add_row(*row)
        console.print(table)


if __name__ == "__main__":
    main()
