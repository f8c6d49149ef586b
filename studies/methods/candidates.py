"""All methods with four to six sizes each: what is compared on every mechanism."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any

from uqmbd import plugins
from uqmbd.extend import Propagator
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo
from uqmbd_reliability import Reliability

from .cases import TestedMechanism

__all__ = ["Candidate", "candidates"]

MOST = 5000
"""Most realisations of a quadrature rule, a regression or a chaos by elements."""
MOST_COUPLED = 400
"""Most Gauss nodes of a Galerkin system."""
SAMPLES = 32, 128, 512, 2048, 8192
"""Numbers of independent samples."""
SPACED = 64, 256, 1024, 4096
"""Numbers of points of designs in 16 replicates."""


@dataclass(frozen=True)
class Candidate:
    """A method with one of its sizes.

    Attributes
    ----------
    method : str
        The method with all options but the size.
    size : str
        The size.
    make : callable
        From a seed to the propagator.
    random : bool
        Whether the result depends on the seed by more than verification realisations.
    requirement : str, optional
        The only requirement whose probability it computes.
    """

    method: str
    size: str
    make: Callable[[int], Propagator]
    random: bool = False
    requirement: str | None = None


def candidates(tested: TestedMechanism, inputs: int, levels: Sequence[str]) -> Iterator[Candidate]:
    """Yield the methods that can run on a mechanism with a number of inputs; `levels` are names of requirements."""
    yield from sampling()
    yield from plain(inputs)
    if inputs <= 4:
        yield from divided(inputs)
        yield from aligned(tested, inputs)
    for order in range(1, 6):
        if (order + 1) ** inputs <= MOST_COUPLED:
            yield Candidate("Galerkin", f"order={order}", sized(Galerkin, order=order))
    yield from others()
    if inputs < 20:
        for level in levels:
            for most in (500, 1000, 2000, 4000):
                options = {"requirement": level, "max_realisations": most, "target_cov": 0.02}
                yield Candidate("Reliability", f"max_realisations={most}", sized(Reliability, **options), True, level)


def sized(kind: Callable[..., Propagator], **options: Any) -> Callable[[int], Propagator]:
    """Return a function that makes a propagator with a seed."""
    return lambda seed: kind(seed=seed, **options)


def without_seed(kind: Callable[..., Propagator]) -> Callable[[int], Propagator]:
    """Return a function that makes a propagator that has no seed."""
    return lambda seed: kind()


def sampling() -> Iterator[Candidate]:
    """Yield Monte Carlo by all designs, with and without a control variate."""
    for samples in SAMPLES:
        yield Candidate("Monte Carlo", f"samples={samples}", sized(MonteCarlo, samples=samples), True)
    for design in ("latin-hypercube", "sobol", "halton"):
        for samples in SPACED:
            made = sized(MonteCarlo, samples=samples, sampling=design)
            yield Candidate(f"Monte Carlo, {design}", f"samples={samples}", made, True)
    for samples in SAMPLES[1:4]:
        made = sized(MonteCarlo, samples=samples, control=Collocation(order=2))
        yield Candidate("Monte Carlo, control=Collocation(order=2)", f"samples={samples}", made, True)
    for samples in SAMPLES[1:4]:
        made = sized(MonteCarlo, samples=samples, sobol_indices=True)
        yield Candidate("Monte Carlo, sobol_indices", f"samples={samples}", made, True)


def plain(inputs: int) -> Iterator[Candidate]:
    """Yield collocation by every rule."""
    for order in range(1, 7):
        if (order + 1) ** inputs <= MOST:
            yield Candidate("Collocation", f"order={order}", sized(Collocation, order=order))
    for level in range(1, 6):
        if inputs > 1 and smolyak_size(inputs, level) <= MOST:
            made = sized(Collocation, rule="smolyak", level=level)
            yield Candidate("Collocation, smolyak", f"level={level}", made)
    for order in range(1, 5):
        if 2 * math.comb(inputs + order, order) <= MOST:
            made = sized(Collocation, method="regression", order=order)
            yield Candidate("Collocation, regression", f"order={order}", made, True)
    for samples in (32, 128, 512, 2048):
        made = sized(Collocation, method="lars", order=3 if inputs <= 12 else 2, samples=samples)
        yield Candidate("Collocation, lars", f"samples={samples}", made, True)
    for adaptive in ("order", "dimension"):
        for tolerance in (1e-1, 1e-2, 1e-3, 1e-4):
            made = sized(Collocation, adaptive=adaptive, tolerance=tolerance, max_realisations=MOST)
            yield Candidate(f"Collocation, adaptive={adaptive}", f"tolerance={tolerance:g}", made)


def smolyak_size(inputs: int, level: int) -> int:
    """Return about how many nodes a sparse grid has."""
    return sum(math.comb(inputs, k) * math.comb(level, k) * 2**k for k in range(min(inputs, level) + 1))


def divided(inputs: int) -> Iterator[Candidate]:
    """Yield chaoses by elements."""
    for most in (2, 8, 32, 128):
        if most * 3**inputs <= 4 * MOST:
            made = sized(Collocation, order=2, elements="adaptive", max_elements=most, threshold=1e-4)
            yield Candidate("Collocation, elements", f"max_elements={most}", made)


def aligned(tested: TestedMechanism, inputs: int) -> Iterator[Candidate]:
    """Yield chaoses with every alignment; those that a mechanism does not have fail at once."""
    for alignment in ("events", "phase", "two-frequency", "auto"):
        for order in range(1, 5):
            if (order + 1) ** inputs <= MOST // 5:
                made = sized(Collocation, order=order, alignment=alignment)
                yield Candidate(f"Collocation, alignment={alignment}", f"order={order}", made)


def others() -> Iterator[Candidate]:
    """Yield the propagators of other packages that are installed, as they are without options."""
    built_in = {kind.name for kind in (MonteCarlo, Collocation, Galerkin, Reliability)}
    for name, kind in plugins.propagators().items():
        if name not in built_in:
            random = "seed" in {one.name for one in fields(kind)}
            yield Candidate(name, "default", sized(kind) if random else without_seed(kind), random)
