"""Conversion of names in a file to valid and unique names of a mechanism."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

__all__ = ["Names"]

TAKEN = ("ground", "time", ".", "..")


class Names:
    """Set of used names.

    >>> names = Names()
    >>> names.take("arm/elbow"), names.take("arm/elbow", "joint"), names.take("arm/elbow", "joint"), names.take("time")
    ('arm_elbow', 'arm_elbow_joint', 'arm_elbow_joint_2', 'time_')
    """

    def __init__(self, taken: Iterable[str] = ()) -> None:
        self.taken = {*TAKEN, *taken}

    def take(self, name: str, suffix: str = "") -> str:
        """Return the name, or the most similar one that is unused and valid."""
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

    def take_all(self, names: Sequence[str], suffix: str) -> dict[int, str]:
        """Return the names by index; names that are valid and unused are assigned first, so that they do not change."""
        order = sorted(range(len(names)), key=lambda k: names[k] in self.taken)
        found = {k: self.take(names[k], suffix) for k in order}
        return {k: found[k] for k in range(len(names))}
