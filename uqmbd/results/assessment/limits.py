"""Define limits of errors and intervals for the assessment of methods and outputs."""

from __future__ import annotations

__all__ = ["COARSE", "ENOUGH_SAMPLES", "EXACT", "LEAST_SAMPLES", "RARE", "ROUGH", "WELL", "WIDE"]

EXACT = 0.01
"""Stated error, over the standard deviation, sufficient for nearly all purposes; surrogates below it are resolved."""

WELL = 0.05
"""Stated error, over the standard deviation, up to which an output is reliable."""

COARSE = 0.1
"""Stated error, over the standard deviation, above which an output is unreliable, and a surrogate under-resolved."""

ROUGH = 0.15
"""Relative error of the standard deviation, at 95 % confidence, up to which samples are compared."""

LEAST_SAMPLES = 20
"""Minimum number of samples for a verdict; standard errors of fewer samples are too uncertain."""

ENOUGH_SAMPLES = 40
"""Minimum number of samples for a statement of agreement."""

WIDE = 0.5
"""Longer side of an interval, relative to the probability, up to which the probability is reliable."""

RARE = 1e-3
"""Upper end of an interval below which a probability is reliable for any width of the interval."""
