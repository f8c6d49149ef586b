"""What a method would take, found out before anything is computed or allocated."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Estimate", "readable"]


@dataclass(frozen=True)
class Estimate:
    """What a method would take for a study.

    Parameters
    ----------
    realisations : int
        How many it computes.
    memory : int
        Bytes of the arrays that it holds at once.
    detail : str
        What they are for, as "3542 nodes, 1771 terms".
    at_most : bool
        Whether it is the most that a method may take that finds out by itself, rather than what it will.

    Examples
    --------
    >>> Estimate(500, 64_000_000, "500 samples").words
    '500 realisations, 64 MB'
    >>> Estimate(5000, 3_200_000_000, at_most=True).words
    'up to 5000 realisations, 3.2 GB'
    """

    realisations: int
    memory: int
    detail: str = ""
    at_most: bool = False

    @property
    def words(self) -> str:
        """Both numbers, for people."""
        some = "" if self.realisations == 1 else "s"
        return f"{'up to ' if self.at_most else ''}{self.realisations} realisation{some}, {readable(self.memory)}"


def readable(size: int) -> str:
    """Return a number of bytes for people.

    Examples
    --------
    >>> readable(950), readable(12_300), readable(2_000_000_000)
    ('1 kB', '12 kB', '2 GB')
    """
    for power, unit in ((12, "TB"), (9, "GB"), (6, "MB")):
        if size >= 10**power:
            return f"{size / 10**power:.2g} {unit}" if size < 10 ** (power + 2) else f"{size / 10**power:.0f} {unit}"
    return f"{max(1, round(size / 1000))} kB"
