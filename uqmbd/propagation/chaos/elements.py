"""Which elements of the germ space to split: the rule that all methods of multi-element chaos share.

Length: what is public has examples, which need a mechanism each.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import index
from typing import Any, Generic, Literal, TypeVar, overload

import numpy as np
import xarray as xr

from uqmbd.arguments import Positive, Size, returned, typechecked
from uqmbd.errors import IntegrationError, StudyError
from uqmbd.logs import refinement
from uqmbd.propagation.chaos.verification import FEWEST
from uqmbd.randomness import GermBox, GermSpace
from uqmbd.results import AlignedChaos, PiecewiseChaos, PolynomialChaos, QuasiPeriodicChaos
from uqmbd.typing import Array

__all__ = ["ElementLimits", "ElementRefinement", "refine_elements"]

Expansion = PolynomialChaos | AlignedChaos | QuasiPeriodicChaos
Joined = TypeVar("Joined", PiecewiseChaos, AlignedChaos, QuasiPeriodicChaos)
OverTime = TypeVar("OverTime", AlignedChaos, QuasiPeriodicChaos)

TOGETHER = 0.25
"""Elements whose contribution to the squared error is more than this part of the largest are split together."""


ALWAYS_ZERO = 1e-140
"""Largest size of an output, in its units, that is always zero."""

WRONG = 1e6
"""Squared error, over the variance, of what is not known."""

LOST = 0.1
"""Ratio of error to local standard deviation above which the local variance selects the input to split."""


MANY = 10**6
"""Elements, at most."""


@typechecked
@dataclass(frozen=True)
class ElementLimits:
    """How many elements, and when to end.

    Parameters
    ----------
    elements : int, "adaptive" or None
        A number that is split until it is reached, or ``"adaptive"``: until the error is below the threshold.  None:
        nothing is split.
    most : int
        Most elements of an adaptive refinement.
    threshold : float
        Estimated error of the surrogate, root mean square over the germ space, over the largest standard deviation of
        each output over time.

    Raises
    ------
    uqmbd.StudyError
        If one of them cannot be used.

    Examples
    --------
    >>> ElementLimits("adaptive").count
    32
    >>> ElementLimits(5).count
    5
    """

    elements: int | Literal["adaptive"] | None
    most: int = 32
    threshold: float = 0.01

    def __post_init__(self) -> None:
        """Check."""
        whole = _whole(self.elements)
        for name, count in (("elements", whole), ("max_elements", _whole(self.most))):
            if count is not None and count > MANY:
                raise StudyError(f"{name} is more than {MANY}; expected a whole number up to {MANY}.")
        if self.elements not in ("adaptive", None) and (whole is None or whole < 1):
            raise StudyError(f"elements is {self.elements!r}; expected a number, 1 or more, or 'adaptive'.")
        if (_whole(self.most) or 0) < 1:
            raise StudyError(f"max_elements is {self.most!r}; expected a whole number, 1 or more.")
        usable = isinstance(self.threshold, (int, float, np.number)) and not isinstance(self.threshold, bool)
        if not (usable and 0 < float(self.threshold) < np.inf):
            raise StudyError(f"threshold is {self.threshold!r}; expected a number above 0, such as 0.01.")

    @property
    def adaptive(self) -> bool:
        """Whether the error decides."""
        return self.elements == "adaptive"

    @property
    def count(self) -> int:
        """Most elements."""
        return int(self.most if self.elements == "adaptive" else self.elements or 1)

    @property
    def computed(self) -> int:
        """Most elements that are computed, those that are replaced too."""
        return 2 * self.count - 1

    @property
    def uncertain(self) -> bool:
        """Whether only the largest number of realisations is known before the elements are split."""
        return self.adaptive or self.count > 2

    def verified(self, count: Size) -> int:
        """Return the most verification realisations of all elements that are computed.

        Parameters
        ----------
        count : int
            Verification realisations of the whole germ space; an element has its share, and three at least.

        Returns
        -------
        int
            Their number, if elements are split into equal halves.

        Examples
        --------
        >>> ElementLimits(None).verified(16), ElementLimits(2).verified(16), ElementLimits(4).verified(16)
        (16, 32, 48)
        """
        if not count:
            return 0
        found, left, halves = max(FEWEST, count), self.count - 1, 2
        while left:  # the largest elements are split first: the halves of the whole, then their halves
            split = min(left, halves // 2)
            found += split * 2 * max(FEWEST, math.ceil(count / halves))
            left, halves = left - split, 2 * halves
        return found


@dataclass(frozen=True)
class ElementRefinement(Generic[Joined]):
    """Elements, and how they came about.

    Attributes
    ----------
    chaos : PiecewiseChaos, AlignedChaos or QuasiPeriodicChaos
        That of all elements together; a `PiecewiseChaos` up to the last time that all have.
    steps : xarray.Dataset
        Over the rounds of splitting: ``elements``, ``computed`` (all so far, replaced ones too), ``error``.  Over the
        splits: their ``round``, the germ that was split (``split_germ``) and where (``split_at``).
    met : bool
        Whether the error is below the threshold.
    computed : int
        Elements that were computed, replaced ones too.
    kept : tuple of int
        Which of them, in the order of computation, are the elements.

    Examples
    --------
    As `uqmbd.extend.refine_elements` gives it:

    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd.results import PolynomialChaos
    >>> from uqmbd.extend import project
    >>> from uqmbd.extend import labels
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(-1, 1), units="m/s")
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> space, axes = uqmbd.extend.GermSpace.of(mechanism.inputs), labels(["size"], ["speed"], [0.0])
    >>> def chaos_in(box):
    ...     rule, terms = uqmbd.extend.gauss_tensor(box.local, 4), box.local.basis(2)
    ...     size = np.abs(box.local.to_inputs(rule.nodes))[:, :, None]
    ...     psi = box.local.evaluate(rule.nodes, terms)
    ...     return PolynomialChaos(project(size, psi, rule.weights), terms, box.local, axes)
    >>> def compute(boxes):
    ...     return [chaos_in(box) for box in boxes]
    >>> refined = uqmbd.extend.refine_elements(space, compute, uqmbd.extend.ElementLimits(2), label="mine")
    >>> refined.computed, refined.kept, refined.steps["split_at"].values.round(6).tolist()
    (3, (1, 2), [0.0])
    """

    chaos: Joined
    steps: xr.Dataset
    met: bool
    computed: int
    kept: tuple[int, ...]


@dataclass(frozen=True)
class _TimedElement:
    """An element with its chaos, and when it was computed."""

    box: GermBox
    chaos: Expansion
    number: int


@overload
def refine_elements(
    space: GermSpace,
    compute: Callable[[Sequence[GermBox]], Sequence[PolynomialChaos]],
    limits: ElementLimits,
    *,
    label: str,
    rtol: float = ...,
    affordable: Callable[[], int] | None = ...,
    lost: Callable[[int], float] | None = ...,
) -> ElementRefinement[PiecewiseChaos]: ...


@overload
def refine_elements(
    space: GermSpace,
    compute: Callable[[Sequence[GermBox]], Sequence[OverTime]],
    limits: ElementLimits,
    *,
    label: str,
    rtol: float = ...,
    affordable: Callable[[], int] | None = ...,
    lost: Callable[[int], float] | None = ...,
) -> ElementRefinement[OverTime]: ...


@typechecked
def refine_elements(
    space: GermSpace,
    compute: Callable[[Sequence[GermBox]], Sequence[Any]],
    limits: ElementLimits,
    *,
    label: str,
    rtol: Positive = 1e-6,
    affordable: Callable[[], int] | None = None,
    lost: Callable[[int], float] | None = None,
) -> ElementRefinement[Any]:
    """Split the germ space where a chaos says that it is not enough.

    In each round the error of every element is estimated: at each output and time, it is the larger of the energy of
    its top order and of the mean square at its verification realisations. It is weighted by the probability of the
    element. Those with the largest contributions are split at the median along the input that has most of the energy of
    the top order. The local variance counts as much if the error is more than a tenth of the local standard deviation.
    The halves replace them, and are computed from the start. The result does not depend on who computes.

    Parameters
    ----------
    space : GermSpace
        The whole.
    compute : callable
        From boxes to their chaoses, each on its ``box.local``; one that ends before the others is split first.
    limits : ElementLimits
        When to end.
    label : str
        Of the propagator.
    rtol : float
        Relative tolerance of the integration: smaller differences have no meaning.
    affordable : callable, optional
        Says before each round how many elements may still be split.
    lost : callable, optional
        Says of an element, by its number in the order of computation, which share of its realisations the chaos does
        not follow: there it is as wrong as the largest standard deviation.

    Returns
    -------
    ElementRefinement
        The elements together.

    Warns
    -----
    UserWarning
        If the threshold of an adaptive refinement was not met.

    References
    ----------
    X. Wan and G. E. Karniadakis, Journal of Computational Physics 209 (2005) 617-642.

    Examples
    --------
    The size of a speed has a kink at zero, where the germ space is split:

    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd.results import PolynomialChaos
    >>> from uqmbd.extend import project
    >>> from uqmbd.extend import labels
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(-1, 1), units="m/s")
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> space, axes = uqmbd.extend.GermSpace.of(mechanism.inputs), labels(["size"], ["speed"], [0.0])
    >>> def chaos_in(box):
    ...     rule, terms = uqmbd.extend.gauss_tensor(box.local, 4), box.local.basis(2)
    ...     size = np.abs(box.local.to_inputs(rule.nodes))[:, :, None]
    ...     psi = box.local.evaluate(rule.nodes, terms)
    ...     return PolynomialChaos(project(size, psi, rule.weights), terms, box.local, axes)
    >>> def compute(boxes):
    ...     return [chaos_in(box) for box in boxes]
    >>> refined = uqmbd.extend.refine_elements(space, compute, uqmbd.extend.ElementLimits(2), label="mine")
    >>> refined.computed, refined.chaos.evaluate([[-0.4], [0.7]]).ravel().round(6).tolist()
    (3, [0.4, 0.7])
    """
    whole = GermBox.whole(space)
    parts = [_TimedElement(whole, _computed(compute, [whole])[0], 0)]
    computed, reason = 1, ""
    rounds: list[tuple[int, int, float]] = []
    splits: list[tuple[int, int, float]] = []
    while True:
        contributions, blame = _contributions(parts, rtol, lost)
        error = float(np.sqrt(contributions.sum(axis=0).max()))
        rounds.append((len(parts), computed, error))
        refinement.info("%s: %d elements, error %.3g, threshold %.3g", label, len(parts), error, limits.threshold)
        if limits.adaptive and error <= limits.threshold:
            break
        room = limits.count - len(parts)
        if not room:
            reason = f"max_elements is {limits.count}"
            break
        room = min(room, returned("refine_elements: affordable", affordable(), int)) if affordable else room
        if room < 1:
            reason = "max_realisations does not allow more"
            break
        chosen = _chosen(parts, contributions, room)
        halves: dict[int, tuple[GermBox, GermBox]] = {}
        for k in chosen:
            germ = _guilty(parts[k].box, blame[k])
            halves[k] = parts[k].box.split(germ)
            splits.append((len(rounds) - 1, germ, halves[k][0].upper[germ]))
        if not halves:
            reason = "no element can be split further"
            break
        boxes = [half for k in chosen for half in halves[k]]
        found = [
            _TimedElement(b, c, computed + n)
            for n, (b, c) in enumerate(zip(boxes, _computed(compute, boxes), strict=True))
        ]
        computed += len(boxes)
        by_parent = {k: found[2 * n : 2 * n + 2] for n, k in enumerate(chosen)}
        parts = [p for k, part in enumerate(parts) for p in by_parent.get(k, [part])]
    met = error <= limits.threshold
    if limits.adaptive and not met:
        warnings.warn(
            f"{label}: with {len(parts)} elements the estimated error is {error:.2g} of the largest standard "
            f"deviation; the threshold {limits.threshold:g} was not met. Reason: {reason}. Raise max_elements or the "
            "order.",
            stacklevel=4,
        )
    elif len(parts) < limits.count and not met:
        warnings.warn(f"{label}: {len(parts)} elements instead of {limits.count}. Reason: {reason}.", stacklevel=4)
    chaos = _joined(parts, label)
    return ElementRefinement(chaos, _steps(space, rounds, splits), met, computed, tuple(p.number for p in parts))


def _computed(compute: Callable[[Sequence[GermBox]], Sequence[Expansion]], boxes: list[GermBox]) -> Sequence[Expansion]:
    """Compute the chaoses of boxes; raise StudyError unless there is one for each box."""
    found = returned("refine_elements: compute", compute(boxes), Sequence[Expansion])
    if len(found) != len(boxes):
        raise StudyError(f"refine_elements: compute returned {len(found)} chaoses for {len(boxes)} boxes.")
    return found


def _joined(parts: list[_TimedElement], label: str) -> PiecewiseChaos | AlignedChaos | QuasiPeriodicChaos:
    """Join the chaoses of all elements; polynomial ones up to the last time that all have."""
    boxes = [p.box for p in parts]
    first: Any = parts[0].chaos
    if not isinstance(first, PolynomialChaos):
        found: AlignedChaos | QuasiPeriodicChaos = first.joined([p.chaos for p in parts], boxes)
        return found
    count = min(_times(p.chaos) for p in parts)
    if count < 2 <= max(_times(p.chaos) for p in parts):
        raise IntegrationError(
            f"{label}: an element has results at the first time only; nothing usable is left. Allow more elements, or "
            "raise the order."
        )
    plain = [_until(p.chaos, count) for p in parts if isinstance(p.chaos, PolynomialChaos)]
    return PiecewiseChaos(tuple(plain), tuple(boxes))


def _contributions(
    parts: list[_TimedElement], rtol: float, lost_share: Callable[[int], float] | None
) -> tuple[Array, Array]:
    """Return what each element adds to the squared error (E, C), and the energy of its top order by germ (E, d)."""
    count = min(_times(p.chaos) for p in parts)
    probability = np.array([p.box.probability for p in parts])
    moments = [_moments(p.chaos) for p in parts]
    mean, std = (np.stack([_columns(row, count) for row in rows]) for rows in zip(*moments, strict=True))
    centre = np.tensordot(probability, mean, axes=1)
    variance = np.tensordot(probability, std**2 + (mean - centre) ** 2, axes=1)
    # (O, T): relative to the largest standard deviation over time, or to what an integration can tell
    known = np.isfinite(variance) & np.isfinite(centre)
    most, size = (np.where(known, x, 0.0).max(axis=1) for x in (variance, np.abs(centre)))
    scale = np.maximum(np.sqrt(most), 100 * rtol * size + 1e-300)
    # an output that is always zero, as the force of a contact that is open, has no error: its square would be 0 / 0
    scale = np.where(scale > ALWAYS_ZERO, scale, np.inf)[:, None]
    errors, blame = [], []
    for part, spread in zip(parts, std, strict=True):
        chaos = part.chaos
        squared = _columns(chaos.top_energy, count)
        if chaos.verification_germs is not None:
            seen = _columns(chaos.verification_rms() ** 2, count)
            # the top order of order 1 is the slope, which is no error
            squared = np.maximum(squared, seen) if int(chaos.multi_index.max()) > 1 else seen
        share = returned("refine_elements: lost", lost_share(part.number), float) if lost_share else 0.0
        own = part.box.probability * np.maximum(squared / scale**2, share)
        # what is not known is as wrong as can be
        unknown = ~(np.isfinite(squared) & np.isfinite(spread))
        own = np.where(unknown, WRONG * part.box.probability, own)
        # one that ends early has no results afterwards: that is as wrong as can be
        early = _times(chaos) == count < max(_times(p.chaos) for p in parts)
        errors.append(own.ravel() + (WRONG * part.box.probability if early else 0.0))
        # where an expansion is not valid at all its top order may name anybody: the local variance is heard too
        lost = part.box.space.dimension > 1 and bool(squared.max() > LOST**2 * max(float((spread**2).max()), 1e-300))
        witnesses = [chaos.top_energy_germ, *([chaos.variance_germ] if lost else [])]
        shares = [np.stack([_columns(e, count) for e in w]) / scale**2 for w in witnesses]
        sums = [share.mean(axis=2).sum(axis=1) for share in shares]
        blame.append(np.sum([x / (x.sum() or 1.0) for x in sums], axis=0))
    return np.array(errors), np.array(blame)


def _moments(chaos: Expansion) -> tuple[Array, Array]:
    """Return mean and standard deviation of an element, with which errors are compared."""
    return chaos.rough_moments if isinstance(chaos, AlignedChaos) else (chaos.mean, chaos.std)


def _chosen(parts: list[_TimedElement], contributions: Array, room: int) -> list[int]:
    """Return the elements to split: the largest contribution, and those not much smaller, in their order."""
    size = contributions.max(axis=1)
    able = [k for k, p in enumerate(parts) if any(map(p.box.divisible, range(p.box.space.dimension)))]
    if not able:
        return []
    # of equals the most probable
    ranked = sorted(able, key=lambda k: (-size[k], -parts[k].box.probability, k))
    limit = TOGETHER * size[ranked[0]]
    return sorted(k for k in ranked[:room] if size[k] >= limit)


def _guilty(box: GermBox, blame: Array) -> int:
    """Return the germ to split along: that of most energy in the top order, or the widest if there is none."""
    able = [k for k in range(len(blame)) if box.divisible(k)]
    return max(able, key=lambda k: (blame[k], box.probabilities[k], -k))


def _times(chaos: Expansion) -> int:
    return 1 if chaos.labels.times is None else len(chaos.labels.times)


def _columns(values: Array, count: int) -> Array:
    """Return values (O, T) or (O,) as (O, count)."""
    return values.reshape(len(values), -1)[:, :count]


def _until(chaos: PolynomialChaos, count: int) -> PolynomialChaos:
    """Return a chaos of its first times."""
    if chaos.labels.times is None or len(chaos.labels.times) == count:
        return chaos
    known = chaos.verification_response
    return replace(
        chaos,
        coefficients=chaos.coefficients[:, :, :count],
        labels=replace(chaos.labels, times=chaos.labels.times[:count]),
        verification_response=None if known is None else known[:, :, :count],
    )


def _steps(space: GermSpace, rounds: list[tuple[int, int, float]], splits: list[tuple[int, int, float]]) -> xr.Dataset:
    names = np.array([space.names[germ] for _, germ, _ in splits], dtype=np.str_)
    note = {"long_name": "estimated error", "comment": "over the largest standard deviation of an output over time"}
    return xr.Dataset(
        {
            "elements": ("round", np.array([r[0] for r in rounds], dtype=np.int64)),
            "computed": ("round", np.array([r[1] for r in rounds], dtype=np.int64)),
            "error": ("round", np.array([r[2] for r in rounds], dtype=float), note),
            "split_round": ("split", np.array([s[0] for s in splits], dtype=np.int64)),
            "split_germ": ("split", names),
            "split_at": ("split", np.array([s[2] for s in splits], dtype=float)),
        }
    )


def _whole(value: Any) -> int | None:
    if isinstance(value, (bool, str)):
        return None
    try:
        return index(value)
    except TypeError:
        return None
