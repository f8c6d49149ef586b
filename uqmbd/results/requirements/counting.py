"""Numbers of realisations that violate requirements, and probabilities of violation estimated from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from uqmbd.arguments import Size, typechecked
from uqmbd.errors import StudyError
from uqmbd.results.requirements.dataset import requirements_dataset
from uqmbd.results.requirements.intervals import clopper_pearson, of_replicates
from uqmbd.typing import Array, Index, Mask

if TYPE_CHECKING:
    from uqmbd.mechanism import Requirement

__all__ = ["Violations", "events", "failures_in"]


@typechecked
@dataclass(frozen=True)
class Violations:
    """Counts of violations in some realisations; the sum of several objects counts all of their realisations.

    Attributes
    ----------
    by_time : array of int, shape (event, T)
        Number of realisations that violate each requirement until each time. If there are several requirements, the
        last row counts violations of any of them.
    total, failed : int
        Number of realisations, and number of failed realisations, which count neither as safe nor as violations.

    Examples
    --------
    Four realisations of a requirement at two times: the third violates it at the second time, and the last failed:

    >>> import numpy as np
    >>> from uqmbd.extend import Violations
    >>> running = np.array([[[1.0, 1.0]], [[2.0, 0.5]], [[1.0, -1.0]], [[np.nan, np.nan]]])
    >>> found = Violations.of(running, np.array([False, False, False, True]))
    >>> found.by_time.tolist(), found.total, found.failed
    ([[0, 1]], 4, 1)
    >>> found.share.round(3).tolist(), (found + found).total
    ([[0.0, 0.333]], 8)
    """

    by_time: Index
    total: Size
    failed: Size

    @classmethod
    def of(cls, running: Array, failed: Mask) -> Violations:
        """Count violations from running margins (K, requirement, T); failed realisations are not violations.

        Parameters
        ----------
        running : array, shape (K, requirement, T)
            Smallest margins until each time.
        failed : array of bool, shape (K,)
            Whether each realisation failed.

        Returns
        -------
        Violations
            Counts, with a last row for the violation of any requirement if there are several.

        Raises
        ------
        StudyError
            If `failed` does not have one value for each realisation.
        """
        if running.ndim != 3 or failed.shape != running.shape[:1] or failed.dtype != bool:
            raise StudyError(
                f"Violations.of: running has the shape {running.shape}, failed {failed.shape} of {failed.dtype}; "
                "expected (K, requirement, T) and (K,) of truth values."
            )
        return cls(events(running[~failed]).sum(axis=0), len(running), int(np.count_nonzero(failed)))

    def __add__(self, other: Violations) -> Violations:
        return Violations(self.by_time + other.by_time, self.total + other.total, self.failed + other.failed)

    @property
    def share(self) -> Array:
        """Share of violations among successful realisations, shape (event, T); NaN if all failed."""
        return np.asarray(self.by_time / np.where(self.total > self.failed, self.total - self.failed, np.nan))

    @staticmethod
    def dataset(
        requirements: Sequence[Requirement | str], replicates: Sequence[Violations], times: ArrayLike
    ) -> xr.Dataset:
        """Build the dataset ``requirements`` of a propagator's node from counts.

        Parameters
        ----------
        requirements : sequence of Requirement
        replicates : sequence of Violations
            One element for independent realisations, or several independent replicates of a design whose points are
            dependent.
        times : array_like, shape (T,)
            Output times, s.

        Returns
        -------
        xarray.Dataset
            Dataset with ``violations (requirement)``, and the attributes ``realisations`` and ``failed``. Intervals
            come from Clopper and Pearson, or from the spread over replicates. Failed realisations count as safe for the
            lower end, and as violations for the upper end.

        Raises
        ------
        StudyError
            If there are no counts, or the counts are not at the given times.
        """
        if not len(replicates) or np.shape(times) != replicates[0].by_time.shape[1:]:
            raise StudyError(
                f"Violations.dataset: {len(replicates)} replicates and times of the shape {np.shape(times)} are "
                "given; expected at least one replicate, and one time for each column of counts."
            )
        whole = replicates[0]
        for one in replicates[1:]:
            whole = whole + one
        happened, good = whole.by_time, whole.total - whole.failed
        lower, _ = clopper_pearson(happened, whole.total)
        _, upper = clopper_pearson(happened + whole.failed, whole.total)
        share = whole.share
        error, how = np.sqrt(share * (1 - share) / max(good, 1)), "counts of independent realisations"
        if len(replicates) > 1:
            shares = np.stack([one.share for one in replicates])
            error, low, high = of_replicates(shares, good, lower, upper)
            lower, upper = failures_in(low, high, whole.failed / whole.total)
            lower, upper = np.minimum(lower, share), np.maximum(upper, share)
            how = f"spread over {len(replicates)} replicates"
        about: dict[str, Any] = {"realisations": whole.total, "failed": whole.failed, "how": how}
        found = {"violations": (("requirement",), happened[:, -1], {"long_name": "realisations that violate it"})}
        return requirements_dataset(
            requirements,
            violation_probability=share[:, -1],
            std_error=error[:, -1],
            lower=lower[:, -1],
            upper=upper[:, -1],
            times=times,
            violated_by=share,
            violated_by_interval=(lower, upper),
            variables=found,
            attrs=about,
        )


def events(running: Array) -> NDArray[np.bool_]:
    """Return a mask (K, event, T) of violations until each time from running margins (K, R, T).

    If there are several requirements, the last event is the violation of any of them.

    >>> events(np.array([[[1.0, -1.0], [2.0, 1.0]]])).tolist()
    [[[False, True], [False, False], [False, True]]]
    """
    violated = np.asarray(running < 0)
    if running.shape[1] < 2:
        return violated
    return np.concatenate([violated, violated.any(axis=1, keepdims=True)], axis=1)


def failures_in(lower: Array, upper: Array, share: float) -> tuple[Array, Array]:
    """Widen intervals by a share of failed realisations, which may be safe (lower end) or violations (upper end).

    >>> failures_in(np.array([0.1]), np.array([0.2]), 0.5)
    (array([0.05]), array([0.6]))
    """
    return lower * (1 - share), upper * (1 - share) + share
