"""Return values of checks of studies, for plugins that add checks."""

from __future__ import annotations

from uqmbd.errors import Finding as Finding
from uqmbd.errors import Severity as Severity
