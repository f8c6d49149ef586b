"""Chunks of realisations: computed anywhere, in any order, always the same."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics import INTEGRATORS, Ensemble, Model, Trajectories, integrate

__all__ = ["ASSEMBLY_FAILED", "CHUNK", "INTEGRATION_FAILED", "OK", "Chunk", "compute_chunk", "integrator_of"]

Array = NDArray[np.float64]

CHUNK = 64
"""Realisations of a chunk: fixed by sample index, so that results depend neither on workers nor on their number."""

OK, ASSEMBLY_FAILED, INTEGRATION_FAILED = 0, 1, 2


@dataclass(frozen=True)
class Chunk:
    """Results of one chunk.

    Attributes
    ----------
    response : array, shape (K, output, time)
        NaN where a realisation failed.
    status : array of int, shape (K,)
        0: fine, 1: not assembled, 2: integration failed.
    messages : tuple of str
        Reasons.
    counters : dict
        Solver counters.
    """

    response: Array
    status: NDArray[np.int64]
    messages: tuple[str, ...]
    counters: dict[str, float]


def integrator_of(name: str) -> Callable[[Ensemble, Array, float], Trajectories]:
    """Return the function that integrates an ensemble: the built-in one, or the method of a plugin's class."""
    if name in INTEGRATORS:
        return partial(integrate, method=name)
    from uqmbd import plugins

    method: Callable[[Ensemble, Array, float], Trajectories] = plugins.integrator(name)().integrate
    return method


@lru_cache(maxsize=4)
def _model(data: bytes) -> Model:
    model: Model = pickle.loads(data)  # noqa: S301 - made by the same program
    return model


def compute_chunk(data: bytes, values: Array, times: Array, rtol: float, integrator: str = "auto") -> Chunk:
    """Assemble, integrate and observe some realisations.

    Parameters
    ----------
    data : bytes
        The pickled model.
    values : array, shape (K, input)
        Inputs.
    times : array, shape (T,)
        Output times, s.
    rtol : float
        Relative tolerance.
    integrator : str
        Name of the integrator.
    """
    from threadpoolctl import threadpool_limits

    model = _model(data)
    # threads on blocks of some dozen rows cost a factor, and their number would change the last bits
    with threadpool_limits(limits=1):
        ensemble = Ensemble(model, values)
        trajectories = integrator_of(integrator)(ensemble, times, rtol)
        status = np.zeros(len(values), dtype=np.int64)
        for k, message in enumerate(trajectories.messages):
            if message:
                status[k] = INTEGRATION_FAILED if np.isfinite(trajectories.states[k, 0]).all() else ASSEMBLY_FAILED
        response = np.full((len(values), len(model.outputs.names), len(times)), np.nan)
        good = np.flatnonzero(status == OK)
        if len(good):
            response[good] = ensemble.select(good).outputs(times, trajectories.states[good])
    return Chunk(response, status, trajectories.messages, asdict(trajectories.counters))
