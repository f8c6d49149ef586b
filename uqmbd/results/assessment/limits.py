"""Limits of errors and intervals, by which methods and their outputs are assessed."""

from __future__ import annotations

__all__ = ["COARSE", "ENOUGH_SAMPLES", "EXACT", "LEAST_SAMPLES", "RARE", "ROUGH", "WELL", "WIDE"]

EXACT = 0.01
"""Stated error, over the standard deviation, that is enough for nearly all purposes; surrogates below miss nothing."""

WELL = 0.05
"""Stated error, over the standard deviation, up to which an output is reliable."""

COARSE = 0.1
"""Stated error, over the standard deviation, above which an output is unreliable, and a surrogate under-resolved."""

ROUGH = 0.15
"""Error of the standard deviation, relative, that samples must reach with 95 % confidence to be compared."""

LEAST_SAMPLES = 20
"""With fewer samples there is no verdict: their standard errors are too uncertain."""

ENOUGH_SAMPLES = 40
"""With fewer samples no agreement is stated."""

WIDE = 0.5
"""Longer side of an interval, over the probability, up to which a probability is reliable."""

RARE = 1e-3
"""Probabilities whose upper end is below are reliable for any width of the interval."""
