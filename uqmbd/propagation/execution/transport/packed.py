"""Objects that are sent to a worker once; later messages contain only the hash of the object."""

from __future__ import annotations

import hashlib
import pickle
import threading
from collections import OrderedDict
from dataclasses import dataclass, field, replace
from typing import Any

__all__ = ["CAPACITY", "Missing", "Packed"]

CAPACITY = 4
"""Maximum number of stored objects in a process, which removes the least recently used one first."""


class Missing(LookupError):
    """Error if a process received only the hash of an object that it does not store."""


@dataclass(frozen=True)
class Packed:
    """Pickled object, or only its hash if the receiver has the object already."""

    digest: str  # hash of the bytes
    data: bytes | None = field(default=None, repr=False, compare=False)  # the bytes

    @classmethod
    def of(cls, value: object) -> Packed:
        """Pack an object."""
        data = pickle.dumps(value)
        return cls(hashlib.sha256(data).hexdigest()[:32], data)

    @property
    def ticket(self) -> Packed:
        """Return the hash without the bytes."""
        return replace(self, data=None)

    def value(self) -> Any:
        """Return the object; the last few unpacked objects are cached.

        Raise Missing if neither the bytes nor a stored object are available.
        """
        return _SHELF.value(self)


class _ObjectCache:
    """Cache of the most recently used objects."""

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
            while len(self._values) > CAPACITY:
                self._values.popitem(last=False)
            return value


_SHELF = _ObjectCache()
