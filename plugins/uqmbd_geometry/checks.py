"""Checks of studies with clearances."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import sympy

import uqmbd
from uqmbd_geometry.clearances import INSIDE, instant_of

__all__ = ["ClearanceTimes"]


class ClearanceTimes:
    """Find clearances at times that the study does not simulate."""

    def find(self, study: Any) -> Iterator[uqmbd.extend.Finding]:
        """Yield a finding for the first output with a time before the first or after the last output time."""
        if not len(study.times):
            return
        begin, end = float(study.times[0]), float(study.times[-1])
        slack = INSIDE * (end - begin)
        for output in study.mechanism.observed():
            for part in sympy.preorder_traversal(output.expression):
                time = instant_of(part)
                if time is not None and not begin - slack <= time <= end + slack:
                    yield uqmbd.extend.Finding(
                        uqmbd.extend.Severity.WARNING,
                        f"output {output.name!r}",
                        f"the clearance {output.name!r} is requested at {time:g} s, but the study simulates {begin:g} "
                        f"to {end:g} s, so that every realisation fails",
                        f"Give clearance_over_time times from {begin:g} to {end:g} s",
                    )
                    return
