"""Find outputs of a chaos with a stated error above the limit, with the size of the error and its first time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uqmbd.arguments import NotNegative, NotNegativeOrInfinite, Size, shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.results.chaos import Surrogate, reference_spread
from uqmbd.results.schema import Labels
from uqmbd.typing import Array, Mask

__all__ = ["Exceedance", "find_exceedances", "errors_over_largest", "varying"]


@typechecked
@dataclass(frozen=True)
class Exceedance:
    """An output whose error exceeds a limit.

    Attributes
    ----------
    output : str
        Name of the output.
    row : int
        Index of the output.
    limit : float
        Limit of the error.
    begin : float
        First time at which the error exceeds the limit, s.
    above : int
        Number of times at which the error exceeds the limit.
    times : int
        Number of all times.
    largest : float
        Largest error over time.

    Examples
    --------
    >>> import numpy as np
    >>> import uqmbd
    >>> late = uqmbd.extend.Exceedance("height", row=0, limit=0.01, begin=1.5, above=3, times=10, largest=0.04)
    >>> print(late.words())
    'height' from t = 1.5 s on (error up to 0.04, above 0.01 at 3 of 10 times)
    """

    output: str
    row: Size
    limit: NotNegative
    begin: float
    above: Size
    times: Size
    largest: NotNegativeOrInfinite

    def words(self, note: str = "") -> str:
        """Describe the output, the first time at which its error is too large, and the largest error."""
        return (
            f"{self.output!r} from t = {self.begin:.6g} s on ({note}error up to {self.largest:.2g}, above "
            f"{self.limit:g} at {self.above} of {self.times} times)"
        )


@typechecked
def find_exceedances(labels: Labels, errors: Array, limit: NotNegativeOrInfinite, loud: Mask) -> Sequence[Exceedance]:
    """Find the outputs whose error exceeds a limit at some time.

    Parameters
    ----------
    labels : uqmbd.extend.Labels
        Labels of the outputs and times.
    errors : array, shape (O, T)
        Errors; NaN if unknown.
    limit : float
        Limit of the errors.
    loud : array of bool, shape (O,)
        Whether each output varies; see `varying`. Outputs that do not vary are excluded.

    Returns
    -------
    sequence of Exceedance
        Exceedances in the order of the outputs.

    Raises
    ------
    uqmbd.StudyError
        If shapes do not fit the labels.

    Examples
    --------
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd.extend import labels
    >>> axes = labels(["height", "speed"], [], [0.0, 1.0, 2.0])
    >>> errors = np.array([[0.001, 0.02, 0.04], [0.001, 0.002, 0.003]])
    >>> (one,) = uqmbd.extend.find_exceedances(axes, errors, limit=0.01, loud=np.array([True, True]))
    >>> one.output, one.begin, one.above, one.largest
    ('height', 1.0, 2, 0.04)
    """
    if labels.times is None or errors.shape != labels.shape or loud.shape != labels.shape[:1]:
        raise StudyError(
            f"find_exceedances: errors is {shown(errors)} and loud is {shown(loud)}; expected an error of each output "
            f"at each time and a truth value of each output, for {len(labels.outputs)} outputs over time."
        )
    found = []
    for row, (output, error) in enumerate(zip(labels.outputs, errors, strict=True)):
        if loud[row] and (above := error > limit).any():
            begin, largest = float(labels.times[above.argmax()]), float(error[above].max())
            found.append(Exceedance(output.name, row, limit, begin, int(above.sum()), len(error), largest))
    return found


@typechecked
def errors_over_largest(chaos: Surrogate) -> Array:
    """Return the ratio (O, T) of stated error to the largest standard deviation over time of each output.

    If all realisations nearly agree, as at nodal points, a chaos need not represent the small remaining variation.

    Parameters
    ----------
    chaos : uqmbd.results.Surrogate
        Surrogate of outputs over time, with verification realisations.

    Examples
    --------
    The chaos has ``0.3 psi`` at 2 s, where verification realisations have ``0.4 psi``:

    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd.results import PolynomialChaos
    >>> from uqmbd.extend import labels
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
    >>> axes = labels([("height", "m")], [("speed", "m/s")], [1.0, 2.0])
    >>> germs = np.array([[-1.0], [1.0]])
    >>> seen = np.array([[[-0.2, -0.4]], [[0.2, 0.4]]])
    >>> known = dict(verification_germs=germs, verification_response=seen)
    >>> chaos = PolynomialChaos([[[0.0, 0.0]], [[0.2, 0.3]]], [[0], [1]], space, axes, **known)
    >>> uqmbd.extend.errors_over_largest(chaos).round(4).tolist()
    [[0.0, 0.3333]]
    """
    largest = np.fmax.reduce(chaos.std, axis=-1, keepdims=True)
    relative = reference_spread(chaos.std) / np.where(largest > 0, largest, 1.0)
    return chaos.verification_error() * np.where(largest > 0, relative, 1.0)


@typechecked
def varying(chaos: Surrogate, rtol: NotNegative) -> Mask:
    """Return a mask (O,) of outputs that vary by more than the integration error, in the chaos or its verification.

    Parameters
    ----------
    chaos : uqmbd.results.Surrogate
        Surrogate of outputs over time.
    rtol : float
        Relative tolerance of the integration. The limit is the error of 100 steps, or of one step of an output
        with the same units if larger. That output may be a term of this output.

    Examples
    --------
    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd.results import PolynomialChaos
    >>> from uqmbd.extend import labels
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
    >>> axes = labels([("height", "m"), ("mass", "kg")], [("speed", "m/s")], [0.0, 1.0])
    >>> chaos = PolynomialChaos([[[0.0, 3.0], [1.0, 1.0]], [[0.0, 0.2], [0.0, 0.0]]], [[0], [1]], space, axes)
    >>> uqmbd.extend.varying(chaos, rtol=1e-6).tolist()
    [True, False]
    """
    outputs = chaos.labels.outputs
    size = np.fmax.reduce(np.abs(chaos.mean), axis=1)
    alike = np.array([size[[o.units == other.units for other in outputs]].max() for o in outputs])
    std = chaos.std
    if chaos.verification_response is not None:
        std = np.fmax(std, chaos.verification_std())
    return np.asarray(np.fmax.reduce(std, axis=1) > rtol * np.maximum(100 * size, alike))
