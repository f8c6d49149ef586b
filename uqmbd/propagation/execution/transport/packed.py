"""Objects that travel to a worker once: what comes afterwards is their hash."""

from __future__ import annotations

import hashlib
import pickle
import threading
from collections import OrderedDict
from dataclasses import dataclass, field, replace
from typing import Any

__all__ = ["KEPT", "Missing", "Packed"]

KEPT = 4
"""Objects that a process keeps: those that were asked for last."""


class Missing(LookupError):
    """An object is not here, of which the hash alone was given."""


@dataclass(frozen=True)
class Packed:
    """A pickled object, or the hash of one that whoever gets it has already.

    Attributes
    ----------
    digest : str
        Of the bytes.
    data : bytes, optional
        The bytes.

    Examples
    --------
    >>> whole = Packed.of({"mass": 2.0})
    >>> whole.value()
    {'mass': 2.0}
    >>> whole.ticket.data is None, whole.ticket.value() is whole.value()
    (True, True)
    """

    digest: str
    data: bytes | None = field(default=None, repr=False, compare=False)

    @classmethod
    def of(cls, value: object) -> Packed:
        """Pack an object."""
        data = pickle.dumps(value)
        return cls(hashlib.sha256(data).hexdigest()[:32], data)

    @property
    def ticket(self) -> Packed:
        """The hash alone."""
        return replace(self, data=None)

    def value(self) -> Any:
        """Return the object; as long as it is one of the last few, always the same one.

        Raises
        ------
        Missing
            If there are no bytes, and it is none of those that are kept.
        """
        return _SHELF.value(self)


class _Shelf:
    """The last few objects."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._values: OrderedDict[str, Any] = OrderedDict()

    def value(self, packed: Packed) -> Any:
        with self._lock:
            if packed.digest in self._values:
                self._values.move_to_end(packed.digest)
                return self._values[packed.digest]
            if packed.data is None:
                raise Missing(packed.digest)
            value = self._values[packed.digest] = pickle.loads(packed.data)  # noqa: S301 - made by the same program
            while len(self._values) > KEPT:
                self._values.popitem(last=False)
            return value


_SHELF = _Shelf()
