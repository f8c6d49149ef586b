"""Digests of the content of functions and objects, for the `repr` of excitations given by functions of users."""

from __future__ import annotations

import copyreg
import hashlib
from typing import Any

from uqmbd.arguments import typechecked
from uqmbd.dynamics.code_digest import Content, NoDigest, is_library
from uqmbd.dynamics.model_key import Digests
from uqmbd.mechanism import Line, Mechanism

__all__ = ["content_key"]


class _Contents(Digests):
    """Digests that also include objects of libraries, by the data from which pickle restores them."""

    def parts(self, value: Any) -> Content:
        """Return the plain content of a value, and its parts."""
        try:
            return super().parts(value)
        except NoDigest:
            if (
                isinstance(value, type)
                or not is_library(type(value).__module__)
                or type(value).__module__ == "builtins"
            ):
                raise
        try:
            reduce = copyreg.dispatch_table.get(type(value))
            found = value.__reduce_ex__(4) if reduce is None else reduce(value)
        except Exception as error:
            raise NoDigest from error
        if isinstance(found, str):
            return ("named", str(getattr(value, "__module__", "")), found), ()
        return ("reduced", len(found)), [x if x is None or isinstance(x, tuple) else _plain(x) for x in found]


def _plain(value: Any) -> Any:
    """Return an iterator as a list."""
    return list(value) if hasattr(value, "__next__") else value


@typechecked
def content_key(value: Any) -> str | None:
    """Return a digest of all data that determine the values of a function.

    The digest contains code, constants, defaults, closures, named globals and called functions, and the content of
    arrays and objects. Libraries are identified by name. Equal digests in other processes and later runs mean equal
    values.

    Parameters
    ----------
    value : object
        Function, callable object or plain data.

    Returns
    -------
    str or None
        Digest; None if part of the content is unknown, for example a file that the function reads.

    Examples
    --------
    >>> content_key([1.0, 2.0]) == content_key([1.0, 2.0]), content_key([1.0, 2.0]) == content_key([1.0, 3.0])
    (True, False)
    """
    try:
        digests = _Contents(Mechanism("content", Line()))
        return hashlib.sha256(digests.of(value) + digests.code()).hexdigest()
    except (NoDigest, RecursionError):
        return None
