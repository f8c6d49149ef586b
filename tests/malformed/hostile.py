"""Values that no argument expects, and what becomes of calls with them."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import sympy

import uqmbd

__all__ = ["HOSTILE", "hostile", "used"]


class Nothing:
    """Of no type that anything expects."""

    def __repr__(self) -> str:
        return "<nothing>"


def _raising(*_: Any, **__: Any) -> Any:
    """Raise an error, whatever it is called with."""
    raise ZeroDivisionError("of the function that is given")


def _foreign() -> Any:
    """Return a coordinate of a body of another mechanism."""
    mechanism = uqmbd.Mechanism("elsewhere", uqmbd.Planar())
    return mechanism.body("stranger", mass=1, inertia=1).position[0]


HOSTILE: dict[str, Any] = {
    "nan": float("nan"),
    "inf": float("inf"),
    "-inf": -np.inf,
    "minus one": -1,
    "zero": 0,
    "1e307": 1e307,
    "10**400": 10**400,
    "half": 0.5,
    "empty text": "",
    "text": "text",
    "lines": "a\nb",
    "digits": "5",
    "no units": "m^(1/0)",
    "null": "a\0b",
    "surrogate": "a\udcff",
    "bytes": b"a",
    "None": None,
    "True": True,
    "complex": 1j,
    "empty list": [],
    "empty dict": {},
    "list": [1.0],
    "nested": [[1.0, 2.0], [3.0]],
    "deep": [[[1.0]]],
    "nan in list": [0.0, float("nan")],
    "None in list": [None],
    "texts": ["1", "2"],
    "set": {1},
    "foreign symbol": _foreign(),
    "unknown symbol": sympy.Symbol("unknown"),
    "zoo": sympy.zoo,
    "NaT": np.datetime64("NaT"),
    "object": Nothing(),
    "class": dict,
    "function": len,
    "raising": _raising,
    "empty array": np.zeros(0),
    "flat array": np.zeros((2, 0)),
    "four axes": np.zeros((2, 2, 2, 2)),
    "masked": np.ma.masked_array([1.0, 2.0], mask=[True, False]),
    "masked number": np.ma.masked,
    "huge": np.broadcast_to(np.float64(1.0), (10**9,)),
    "object array": np.array([Nothing(), None], dtype=object),
    "matrix": sympy.Matrix(2, 3, range(6)),
    "range": range(3),
}
"""By name; an array that is huge by its shape takes no memory."""


def hostile(_: Path) -> dict[str, Any]:
    """Return them."""
    return HOSTILE


TIMES = (0.0, 0.001, 0.002)


def used(made: Any, names: dict[str, Any]) -> None:
    """Use what an accepted call returned: build, check and simulate mechanisms, run methods."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mechanisms = [x for x in [made, *names.values()] if isinstance(x, uqmbd.Mechanism)]
        if isinstance(made, uqmbd.Component):
            for mechanism in mechanisms:
                mechanism.add(made)
        if isinstance(made, uqmbd.extend.Propagator):
            _study(made).run(progress=False)
            return
        if isinstance(made, uqmbd.RandomVariable):
            mechanisms = [_mechanism(made)]
        studies = [x for x in (made,) if isinstance(x, uqmbd.Study)]
        for study in studies:
            uqmbd.check(study.mechanism, float(study.times[0]))
        for mechanism in mechanisms:
            if mechanism.bodies:
                uqmbd.check(mechanism)
                if mechanism.outputs or mechanism.scalars:
                    uqmbd.simulate(mechanism, TIMES)
        repr(made)


def _mechanism(speed: Any) -> uqmbd.Mechanism:
    mechanism = uqmbd.Mechanism("m", uqmbd.Line())
    mechanism.output("x", mechanism.body("b", mass=1, velocity=speed).position[0])
    return mechanism


def _study(method: uqmbd.extend.Propagator) -> uqmbd.Study:
    import chaospy

    mechanism = _mechanism(uqmbd.RandomVariable("speed", chaospy.Normal(1, 0.1)))
    mechanism.require("near", next(iter(mechanism.bodies.values())).position[0] <= 10)
    return uqmbd.Study("s", mechanism, TIMES, [method])
