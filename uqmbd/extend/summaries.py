"""Names for plugins that add summaries of motions."""

from __future__ import annotations

from uqmbd.dynamics.summaries import MotionPolynomials as MotionPolynomials
from uqmbd.mechanism import SummaryData as SummaryData
from uqmbd.mechanism import summary as summary
