"""Checks of studies with clearances."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import sympy

import uqmbd
from uqmbd_geometry.clearances import is_clearance

__all__ = ["ClearanceMethods"]


class ClearanceMethods:
    """Find methods that approximate a clearance by a polynomial."""

    def find(self, study: Any) -> Iterator[uqmbd.extend.Finding]:
        """Yield a finding for each method that is not a sampling method, if an output is a clearance."""
        names = [
            output.name
            for output in study.mechanism.observed()
            if any(is_clearance(part) for part in sympy.preorder_traversal(output.expression))
        ]
        methods = [one.node_name for one in study.propagators if not one.accepts_keys]
        if names and methods:
            yield uqmbd.extend.Finding(
                uqmbd.extend.Severity.WARNING,
                f"output {names[0]!r}",
                f"the clearance {names[0]!r} is zero in contact and has kinks, but the methods {', '.join(methods)} "
                "approximate clearances by polynomials",
                "Use a sampling method, such as MonteCarlo, for clearances",
            )
