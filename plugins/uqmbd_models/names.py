"""Names of a file as names of a mechanism: valid, and each once."""

from __future__ import annotations

import re
from collections.abc import Iterable

__all__ = ["Names"]

TAKEN = ("ground", "time", ".", "..")


class Names:
    """Names that are given away.

    Examples
    --------
    >>> names = Names()
    >>> names.take("arm/elbow"), names.take("arm/elbow", "joint"), names.take("arm/elbow", "joint"), names.take("time")
    ('arm_elbow', 'arm_elbow_joint', 'arm_elbow_joint_2', 'time_')
    """

    def __init__(self, taken: Iterable[str] = ()) -> None:
        self.taken = {*TAKEN, *taken}

    def take(self, name: str, suffix: str = "") -> str:
        """Return the name, or the nearest one that is free and valid."""
        plain = re.sub("[\x00-\x1f\x7f-\x9f/\ud800-\udfff\ufffe\uffff]", "_", name).strip() or "unnamed"
        found = plain
        if found in self.taken:
            found = f"{plain}_{suffix}"
        number = 2
        while found in self.taken:
            found = f"{plain}_{suffix}_{number}" if suffix else f"{plain}_{number}"
            number += 1
        self.taken.add(found)
        return found
