"""Choose the elements of the germ space to split, by one rule for all methods of multi-element chaos.

Length: public names have examples, each of which needs a mechanism.
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
from uqmbd.propagation.chaos.verification_points import FEWEST
from uqmbd.randomness import GermBox, GermSpace
from uqmbd.results import AlignedChaos, PiecewiseChaos, PolynomialChaos, QuasiPeriodicChaos
from uqmbd.typing import Array

__all__ = ["ElementLimits", "ElementRefinement", "refine_elements"]

Expansion = PolynomialChaos | AlignedChaos | QuasiPeriodicChaos
Joined = TypeVar("Joined", PiecewiseChaos, AlignedChaos, QuasiPeriodicChaos)
OverTime = TypeVar("OverTime", AlignedChaos, QuasiPeriodicChaos)

TOGETHER = 0.25
"""Ratio to the largest contribution to the squared error above which elements are split in the same round."""


ALWAYS_ZERO = 1e-140
"""Largest magnitude, in the units of the output, of an output that counts as always zero."""

WRONG = 1e6
"""Ratio of squared error to variance if the error is unknown."""

LOST = 0.1
"""Ratio of error to local standard deviation above which the local variance selects the input to split."""


MANY = 10**6
"""Maximum number of elements."""


@typechecked
@dataclass(frozen=True)
class ElementLimits:
    """Limits on the number of elements, and stopping criteria.

    Parameters
    ----------
    elements : int, "adaptive" or None
        Final number of elements, or ``"adaptive"`` to split until the error is below the threshold. None: no split.
    most : int
        Largest number of elements of an adaptive refinement.
    threshold : float
        Limit of the estimated error of the surrogate: its root mean square over the germ space, relative to the largest
        standard deviation of each output over time.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid.

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
        """Check the limits."""
        whole = _whole(self.elements)
        for name, count in (("elements", whole), ("max_elements", _whole(self.most))):
            if count is not None and count > MANY:
                raise StudyError(f"{name} is more than {MANY}; expected a whole number up to {MANY}.")
        if self.elements not in ("adaptive", None) and (whole is None or whole < 1):
            raise StudyError(f"elements is {self.elements!r}; expected a whole number of 1 or more, or 'adaptive'.")
        if (_whole(self.most) or 0) < 1:
            raise StudyError(f"max_elements is {self.most!r}; expected a whole number, 1 or more.")
        usable = isinstance(self.threshold, (int, float, np.number)) and not isinstance(self.threshold, bool)
        if not (usable and 0 < float(self.threshold) < np.inf):
            raise StudyError(f"threshold is {self.threshold!r}; expected a number above 0, such as 0.01.")

    @property
    def adaptive(self) -> bool:
        """Return whether the error determines the number of elements."""
        return self.elements == "adaptive"

    @property
    def count(self) -> int:
        """Return the maximum number of elements."""
        return int(self.most if self.elements == "adaptive" else self.elements or 1)

    @property
    def computed(self) -> int:
        """Return the maximum number of computed elements, including replaced ones."""
        return 2 * self.count - 1

    @property
    def uncertain(self) -> bool:
        """Return whether only an upper bound of the number of realisations is known before the refinement."""
        return self.adaptive or self.count > 2

    def verified(self, count: Size, space: GermSpace | None = None) -> int:
        """Return the maximum number of verification realisations of all computed elements.

        Parameters
        ----------
        count : int
            Number of verification realisations of the whole germ space. Each element has its share, at least three.
        space : GermSpace, optional
            Germ space of the inputs. Default: a space of continuous inputs, whose elements are split into equal halves.

        Returns
        -------
        int
            Number of verification realisations; an upper bound for discrete inputs.

        Examples
        --------
        >>> ElementLimits(None).verified(16), ElementLimits(2).verified(16), ElementLimits(4).verified(16)
        (16, 32, 48)
        """
        if not count or self.elements is None:
            return count
        found, left, halves = max(FEWEST, count), self.count - 1, 2
        if space is not None and any(germ.values is not None for germ in space.germs):
            # upper bound for any probabilities of the halves: one half has the minimum, or rounding adds one
            return found + left * (max(FEWEST, count) + FEWEST)
        while left:  # the largest elements are split first: the halves of the whole space, then the quarters
            split = min(left, halves // 2)
            found += split * 2 * max(FEWEST, math.ceil(count / halves))
            left, halves = left - split, 2 * halves
        return found


@dataclass(frozen=True)
class ElementRefinement(Generic[Joined]):
    """Elements, and the history of their refinement.

    Attributes
    ----------
    chaos : PiecewiseChaos, AlignedChaos or QuasiPeriodicChaos
        Chaos of all elements together; a `PiecewiseChaos` ends at the last time that all elements have.
    steps : xarray.Dataset
        For each round of splitting: ``elements``, ``computed`` (all elements so far, including replaced ones) and
        ``error``. For each split: its ``round``, the split germ (``split_germ``) and the position (``split_at``).
    met : bool
        Whether the error is below the threshold.
    computed : int
        Number of computed elements, including replaced ones.
    kept : tuple of int
        Indices of the final elements, in the order of computation.

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
    """Element with its chaos, and its index in the order of computation."""

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
    further: Callable[[PiecewiseChaos, Sequence[int]], Sequence[PolynomialChaos]] | None = ...,
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
    further: Callable[[OverTime, Sequence[int]], Sequence[OverTime]] | None = ...,
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
    further: Callable[[Any, Sequence[int]], Sequence[Any]] | None = None,
) -> ElementRefinement[Any]:
    """Split the germ space in regions where a chaos is not accurate enough.

    In each round the error of every element is estimated: at each output and time, it is the larger of the energy of
    its top order and of the mean square at its verification realisations. The error is weighted by the probability of
    the element. Elements with the largest contributions are split at the median along the input with most energy of the
    top order. If the error exceeds a tenth of the local standard deviation, the local variance of each input has the
    same weight in this choice. The halves replace the elements, and new chaoses are computed for them. The result does
    not depend on the workers.

    Parameters
    ----------
    space : GermSpace
        Whole germ space.
    compute : callable
        Function that maps boxes to their chaoses, each on its ``box.local``. An element whose chaos ends before the
        others is split first.
    limits : ElementLimits
        Stopping criteria.
    label : str
        Label of the propagator.
    rtol : float
        Relative tolerance of the integration: smaller differences are not significant.
    affordable : callable, optional
        Function that returns, before each round, the number of elements that may still be split.
    lost : callable, optional
        Function of the index of an element in the order of computation. The function returns the share of realisations
        that the chaos does not represent. The error of these realisations is set to the largest standard deviation.
    further : callable, optional
        Function that verifies elements at further points at the end. The arguments of the function are the joined chaos
        and the indices of its elements in the order of computation. The function returns the chaoses of the elements,
        and the error is estimated again.

    Returns
    -------
    ElementRefinement
        Elements and the history of their refinement.

    Raises
    ------
    StudyError
        If `further` does not return one chaos for each element.

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
        contributions, scores = _contributions(parts, rtol, lost)
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
            reason = "max_realisations does not allow more elements"
            break
        chosen = _elements_to_split(parts, contributions, room)
        halves: dict[int, tuple[GermBox, GermBox]] = {}
        for k in chosen:
            germ = _germ_to_split(parts[k].box, scores[k])
            halves[k] = parts[k].box.split(germ)
            splits.append((len(rounds) - 1, germ, halves[k][0].upper[germ]))
        if not halves:
            reason = "no element can be split any further"
            break
        boxes = [half for k in chosen for half in halves[k]]
        found = [
            _TimedElement(b, c, computed + n)
            for n, (b, c) in enumerate(zip(boxes, _computed(compute, boxes), strict=True))
        ]
        computed += len(boxes)
        by_parent = {k: found[2 * n : 2 * n + 2] for n, k in enumerate(chosen)}
        parts = [p for k, part in enumerate(parts) for p in by_parent.get(k, [part])]
    chaos, remedy = _joined(parts, label), "Raise max_elements or the order"
    if further:
        again = returned("refine_elements: further", further(chaos, [p.number for p in parts]), Sequence[Expansion])
        if len(again) != len(parts):
            raise StudyError(
                f"refine_elements: the function 'further' returned {len(again)} polynomial chaoses for {len(parts)} "
                "elements; expected one for each element."
            )
        if any(part.chaos is not verified for part, verified in zip(parts, again, strict=True)):
            parts = [replace(part, chaos=verified) for part, verified in zip(parts, again, strict=True)]
            error = float(np.sqrt(_contributions(parts, rtol, lost)[0].sum(axis=0).max()))
            rounds.append((len(parts), computed, error))
            chaos = _joined(parts, label)
        if not reason:
            reason, remedy = "additional verification realisations show a larger error", "Raise verify"
    met = error <= limits.threshold
    if limits.adaptive and not met:
        warnings.warn(
            f"{label}: the estimated error with {len(parts)} elements is {error:.2g} of the largest standard "
            f"deviation, above the threshold {limits.threshold:g}. Reason: {reason}. {remedy}.",
            stacklevel=4,
        )
    elif len(parts) < limits.count and not met:
        warnings.warn(
            f"{label}: the refinement stopped at {len(parts)} instead of {limits.count} elements. Reason: {reason}.",
            stacklevel=4,
        )
    return ElementRefinement(chaos, _steps(space, rounds, splits), met, computed, tuple(p.number for p in parts))


def _computed(compute: Callable[[Sequence[GermBox]], Sequence[Expansion]], boxes: list[GermBox]) -> Sequence[Expansion]:
    """Compute the chaoses of boxes; raise StudyError unless there is one for each box."""
    found = returned("refine_elements: compute", compute(boxes), Sequence[Expansion])
    if len(found) != len(boxes):
        raise StudyError(
            f"refine_elements: the function 'compute' returned {len(found)} polynomial chaoses for {len(boxes)} "
            "boxes; expected one for each box."
        )
    return found


def _joined(parts: list[_TimedElement], label: str) -> PiecewiseChaos | AlignedChaos | QuasiPeriodicChaos:
    """Join the chaoses of all elements; join polynomial ones up to the last time that all of them have."""
    boxes = [p.box for p in parts]
    first: Any = parts[0].chaos
    if not isinstance(first, PolynomialChaos):
        found: AlignedChaos | QuasiPeriodicChaos = first.joined([p.chaos for p in parts], boxes)
        return found
    count = min(_times(p.chaos) for p in parts)
    if count < 2 <= max(_times(p.chaos) for p in parts):
        raise IntegrationError(
            f"{label}: an element has results only at the first output time, so no usable results remain. Increase "
            "max_elements, or raise the order."
        )
    plain = [_until(p.chaos, count) for p in parts if isinstance(p.chaos, PolynomialChaos)]
    return PiecewiseChaos(tuple(plain), tuple(boxes))


def _contributions(
    parts: list[_TimedElement], rtol: float, lost_share: Callable[[int], float] | None
) -> tuple[Array, Array]:
    """Return the contributions of elements to the squared error (E, C), and scores of germs for their split (E, d)."""
    count = min(_times(p.chaos) for p in parts)
    probability = np.array([p.box.probability for p in parts])
    moments = [_moments(p.chaos) for p in parts]
    mean, std = (np.stack([_columns(row, count) for row in rows]) for rows in zip(*moments, strict=True))
    centre = np.tensordot(probability, mean, axes=1)
    variance = np.tensordot(probability, std**2 + (mean - centre) ** 2, axes=1)
    # (O, T): relative to the largest standard deviation over time, or to the integration error
    known = np.isfinite(variance) & np.isfinite(centre)
    most, size = (np.where(known, x, 0.0).max(axis=1) for x in (variance, np.abs(centre)))
    scale = np.maximum(np.sqrt(most), 100 * rtol * size + 1e-300)
    # an output that is always zero, such as the force of an open contact, has no error; the ratio would be 0 / 0
    scale = np.where(scale > ALWAYS_ZERO, scale, np.inf)[:, None]
    errors, scores = [], []
    for part, spread in zip(parts, std, strict=True):
        chaos = part.chaos
        squared = _columns(chaos.top_energy, count)
        if chaos.verification_germs is not None:
            seen = _columns(chaos.verification_rms() ** 2, count)
            # the top order of a chaos of order 1 is its slope, which does not estimate an error
            squared = np.maximum(squared, seen) if int(chaos.multi_index.max()) > 1 else seen
        share = returned("refine_elements: lost", lost_share(part.number), float) if lost_share else 0.0
        own = part.box.probability * np.maximum(squared / scale**2, share)
        # an unknown error counts as the largest possible error
        unknown = ~(np.isfinite(squared) & np.isfinite(spread))
        own = np.where(unknown, WRONG * part.box.probability, own)
        # a chaos that ends early has no later results: its error counts as the largest possible error
        early = _times(chaos) == count < max(_times(p.chaos) for p in parts)
        errors.append(own.ravel() + (WRONG * part.box.probability if early else 0.0))
        # the top order of an invalid expansion may select any germ: also use the local variance
        lost = part.box.space.dimension > 1 and bool(squared.max() > LOST**2 * max(float((spread**2).max()), 1e-300))
        energies = [chaos.top_energy_germ, *([chaos.variance_germ] if lost else [])]
        shares = [np.stack([_columns(e, count) for e in w]) / scale**2 for w in energies]
        sums = [share.mean(axis=2).sum(axis=1) for share in shares]
        scores.append(np.sum([x / (x.sum() or 1.0) for x in sums], axis=0))
    return np.array(errors), np.array(scores)


def _moments(chaos: Expansion) -> tuple[Array, Array]:
    """Return mean and standard deviation of an element, which are scales of errors."""
    return chaos.rough_moments if isinstance(chaos, AlignedChaos) else (chaos.mean, chaos.std)


def _elements_to_split(parts: list[_TimedElement], contributions: Array, room: int) -> list[int]:
    """Return the indices of the elements to split next: the largest contribution, and similar ones."""
    size = contributions.max(axis=1)
    able = [k for k, p in enumerate(parts) if any(map(p.box.divisible, range(p.box.space.dimension)))]
    if not able:
        return []
    # equal contributions are ranked by probability
    ranked = sorted(able, key=lambda k: (-size[k], -parts[k].box.probability, k))
    limit = TOGETHER * size[ranked[0]]
    return sorted(k for k in ranked[:room] if size[k] >= limit)


def _germ_to_split(box: GermBox, scores: Array) -> int:
    """Return the germ for the split: the germ with the largest score, and of equal germs the most probable interval."""
    able = [k for k in range(len(scores)) if box.divisible(k)]
    return max(able, key=lambda k: (scores[k], box.probabilities[k], -k))


def _times(chaos: Expansion) -> int:
    return 1 if chaos.labels.times is None else len(chaos.labels.times)


def _columns(values: Array, count: int) -> Array:
    """Return values (O, T) or (O,) as (O, count)."""
    return values.reshape(len(values), -1)[:, :count]


def _until(chaos: PolynomialChaos, count: int) -> PolynomialChaos:
    """Return a chaos restricted to its first `count` times."""
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
