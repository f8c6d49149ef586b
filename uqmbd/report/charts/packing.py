"""Data of a page's scripts: long arrays as base64 of little-endian numbers, and JSON that is safe inside of HTML.

`arrays.js` reads the arrays.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Kind", "json_script", "packed", "unpacked"]

Kind = Literal["float32", "float64", "int32"]

_ESCAPES = str.maketrans({c: f"\\u{ord(c):04x}" for c in "<>&\u2028\u2029"})


def packed(values: ArrayLike, kind: Kind = "float64") -> dict[str, Any]:
    """Pack an array as data for JSON; NaN and infinities are kept.

    Raises
    ------
    ValueError
        If numbers do not fit in the kind: they are too large for it, or not whole.
    """
    given = np.asarray(values)
    with np.errstate(over="ignore", invalid="ignore"):
        made = given.astype(np.dtype(kind).newbyteorder("<"))
    fits = np.array_equal(made, given) if kind == "int32" else np.array_equal(np.isfinite(made), np.isfinite(given))
    if not fits:
        raise ValueError(f"The array has numbers that {kind} does not hold; use float64.")
    return {"kind": kind, "shape": list(made.shape), "base64": base64.b64encode(made.tobytes()).decode("ascii")}


def unpacked(data: Mapping[str, Any]) -> NDArray[Any]:
    """Return the array of `packed` data."""
    read = np.frombuffer(base64.b64decode(data["base64"]), dtype=np.dtype(data["kind"]).newbyteorder("<"))
    return read.reshape(data["shape"]).astype(data["kind"])


def json_script(data: Any) -> str:
    r"""Return JSON for `<script type="application/json">`: no text in it ends the element, or begins another one.

    Lone surrogates stay escaped, as all that is not ASCII.

    Raises
    ------
    ValueError
        If a number is not finite, which JSON does not hold: use None, or `packed` arrays.

    Examples
    --------
    >>> json_script({"name": "</script>"})
    '{"name":"\\u003c/script\\u003e"}'
    """
    return json.dumps(data, allow_nan=False, separators=(",", ":")).translate(_ESCAPES)
