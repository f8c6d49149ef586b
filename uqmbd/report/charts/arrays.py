"""Arrays as compact data for JSON; `arrays.js` reads them.

A page contains only text, and its scripts decode an array when they draw a chart. Array formats of other packages are
for binary files, so this module defines a text format.
"""

from __future__ import annotations

import base64
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uqmbd.typing import Array

__all__ = ["Kind", "packed", "packed_relative", "packed_selection", "packed_within", "share_arrays", "unpacked"]


Kind = Literal["float32", "float64", "int32"]

LARGEST = 2.0**44
"""Largest magnitude of a number in steps. Scripts compute with 53 bits, and may compute powers of 2 with an error."""

BLOCK = 8
"""Number of integers in a block, all of the same width in bits. Eight integers of w bits have w bytes."""

ALIKE = 16
"""Number of neighbouring numbers that are rounded with a common step; the smallest of them determines the step."""

ROUNDING = 1e-13
"""Permitted rounding error, relative to the largest of these neighbouring numbers."""

# the pattern requires the shape of an array as `packed` writes it, so it does not match other scripts of a page
_REPEATED = re.compile(r'(?<=\],)"base64":"([A-Za-z0-9+/=]{100,})"')


def packed(values: ArrayLike, kind: Kind = "float64") -> dict[str, Any]:
    """Pack an array as data for JSON, bit for bit; NaN and infinities are preserved.

    Raise ValueError if the kind cannot represent the numbers because they are too large or not integers.
    """
    given = np.asarray(values)
    with np.errstate(over="ignore", invalid="ignore"):
        made = given.astype(np.dtype(kind).newbyteorder("<"))
    fits = np.array_equal(made, given) if kind == "int32" else np.array_equal(np.isfinite(made), np.isfinite(given))
    if not fits:
        raise ValueError(f"The array has numbers that {kind} cannot represent; use float64.")
    data: dict[str, Any] = {"kind": kind, "shape": list(made.shape)}
    if made.size > 2 and _spaced(made.ravel()[[0, -1]].tolist(), kind, made.size).tobytes() == made.tobytes():
        return data | {"ends": made.ravel()[[0, -1]].astype(float).tolist()}
    found = [data | {"base64": base64.b64encode(made.tobytes()).decode("ascii")}]
    if kind == "int32":
        found += [data | _whole(made.astype(np.int64), lag) for lag in (0, 1)]
    return min(found, key=lambda one: len(str(one)))


def packed_selection(values: ArrayLike, chosen: NDArray[np.intp]) -> dict[str, Any]:
    """Pack chosen entries of an array (N,), bit for bit; for equidistant numbers, store their indices."""
    every = np.asarray(values, dtype=float)
    whole = packed(every)
    if "ends" not in whole or len(chosen) == len(every):
        return packed(every[chosen])
    return {"kind": "float64", "shape": [len(chosen)], "ends": whole["ends"], "of": len(every)} | {
        "chosen": packed(chosen, "int32")
    }


def packed_relative(values: Array, part: float) -> dict[str, Any]:
    """Pack an array with errors up to `part` times each number, or up to the rounding error of its neighbours."""
    flat = np.asarray(values, dtype=float).ravel()
    known = np.where(np.isfinite(flat), np.abs(flat), 0.0)
    blocks = np.pad(known, (0, -len(known) % ALIKE)).reshape(-1, ALIKE)
    largest = blocks.max(axis=1)
    least = np.where(blocks > 0, blocks, np.inf).min(axis=1, initial=np.inf)
    # the smallest of the neighbours determines the step; a power of two represents numbers of few digits exactly
    allowed = np.where(largest > 0, np.maximum(part * least, ROUNDING * largest), part)
    steps = 2.0 ** np.floor(np.log2(1.95 * allowed))
    return packed_within(flat, 0.51 * np.repeat(steps, ALIKE)[: len(flat)]) | {"shape": list(np.shape(values))}


def packed_within(
    values: Array, allowed: ArrayLike, kind: Kind = "float64", lags: Sequence[int] = ()
) -> dict[str, Any]:
    """Pack an array (..., C) with errors up to `allowed`, which is positive, a scalar or of shape (C,).

    `lags` are possible distances of similar numbers in the flat array. Differences of such numbers or of neighbours are
    stored if they are shorter. If this does not save space, the array is packed bit for bit.
    """
    exact, limit = packed(values, kind), np.asarray(allowed, dtype=float)
    unknown = np.isnan(values)
    known = np.where(unknown, 0.0, values)
    if "base64" not in exact or not (np.isfinite(known).all() and np.isfinite(limit).all() and (limit > 0).all()):
        return exact
    found = [exact]
    # rounding to steps changes numbers by at most half a step
    power = np.floor(8 * np.log2(1.999 * limit)).astype(int)
    with np.errstate(over="ignore", divide="ignore"):
        whole = np.round(known / _steps(power))
    if np.abs(whole).max(initial=0.0) <= LARGEST:
        data = {"kind": kind, "shape": exact["shape"]}
        # positions at which NaN intervals begin and end
        turns = np.flatnonzero(np.diff(unknown.ravel().astype(int), prepend=0, append=0))
        data |= {"unknown": turns.tolist()} if len(turns) else {}
        steps = packed(power.ravel(), "int32")
        found += [data | _whole(whole.astype(np.int64), apart, steps) for apart in sorted({0, 1, *lags})]
    with np.errstate(over="ignore"):
        if np.isfinite(known.astype(np.float32)).all():
            found.append(packed(values, "float32"))
    fits = [one for one in found if one is exact or bool((np.abs(unpacked(one) - values) <= limit)[~unknown].all())]
    return min(fits, key=lambda one: len(str(one)))


def _whole(whole: NDArray[np.int64], lag: int, eighths: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return integers, or their differences at a distance `lag`, as data.

    `eighths`: steps as powers of the eighth root of 2.
    """
    flat = whole.ravel()
    if lag:
        flat = np.concatenate([flat[:lag], flat[lag:] - flat[:-lag]])
    return {"lag": lag, "eighths": eighths, "base64": base64.b64encode(_written(flat)).decode("ascii")}


def _steps(power: NDArray[Any]) -> Array:
    return np.asarray(2.0 ** (power / 8))


def unpacked(data: Mapping[str, Any]) -> NDArray[Any]:
    """Return the array of `packed` data."""
    kind, shape = np.dtype(data["kind"]), data["shape"]
    if "ends" in data:
        whole = _spaced(data["ends"], data["kind"], data.get("of", math.prod(shape)))
        return whole[unpacked(data["chosen"])] if "chosen" in data else whole.reshape(shape)
    content = base64.b64decode(data["base64"])
    if "lag" not in data:
        return np.frombuffer(content, dtype=kind.newbyteorder("<")).reshape(shape).astype(kind)
    steps = _read(content, math.prod(shape))
    if lag := data["lag"]:
        padded = np.zeros(-(-len(steps) // lag) * lag, dtype=np.int64)
        padded[: len(steps)] = steps
        steps = padded.reshape(-1, lag).cumsum(axis=0).ravel()[: len(steps)]
    step = np.ones(1) if data["eighths"] is None else _steps(unpacked(data["eighths"]))
    values = (steps.reshape(-1, step.size) * step).ravel()
    turns = data.get("unknown", [])
    for begin, end in zip(turns[::2], turns[1::2], strict=True):
        values[begin:end] = np.nan
    return values.reshape(shape).astype(kind)


def _spaced(ends: Sequence[float], kind: Kind, count: int) -> NDArray[Any]:
    """Return equidistant numbers (count,), as `arrays.js` computes them; zeros if they are infinite or NaN."""
    first, last = ends
    with np.errstate(all="ignore"):
        made = first + np.arange(count) * ((last - first) / (count - 1))
        made[-1] = last
        return (made if np.isfinite(made).all() else np.zeros(count)).astype(kind)


def share_arrays(page: str) -> tuple[str, list[str]]:
    """Replace each repeated array of a page by its index in a list; return the page and this list of encoded arrays."""
    counts = Counter(_REPEATED.findall(page))
    shared = {text: k for k, text in enumerate(text for text, count in counts.items() if count > 1)}

    def replaced(found: re.Match[str]) -> str:
        number = shared.get(found[1])
        return found[0] if number is None else f'"base64":{number}'

    return (_REPEATED.sub(replaced, page), list(shared)) if shared else (page, [])


def _written(whole: NDArray[np.int64]) -> bytes:
    """Return integers (N,) as bytes: size of a width, widths of the blocks, and blocks; the sign is the lowest bit."""
    folded = ((whole << 1) ^ (whole >> 63)).astype(np.uint64)
    blocks = np.pad(folded, (0, -len(folded) % BLOCK)).reshape(-1, BLOCK)
    widths = np.frexp(blocks.max(axis=1, initial=0).astype(float))[1]
    size = int(widths.max(initial=0)).bit_length()
    starts = np.cumsum(widths) - widths
    data = np.zeros(int(widths.sum()), dtype=np.uint8)
    for width in np.unique(widths[widths > 0]).tolist():
        own = widths == width
        data[starts[own][:, None] + np.arange(width)] = _bits(blocks[own], width)
    return bytes([size]) + bytes(_bits(widths.astype(np.uint64)[None], size)) + bytes(data)


def _read(content: bytes, count: int) -> NDArray[np.int64]:
    """Return the integers (count,) that `_written` wrote."""
    number, size = -(-count // BLOCK), content[0]
    if not size:
        return np.zeros(count, dtype=np.int64)
    begin = 1 + -(-number * size // 8)
    found = np.frombuffer(content, dtype=np.uint8)
    widths = _numbers(found[1:begin][None], size)[0, :number].astype(int)
    starts = begin + np.cumsum(widths) - widths
    blocks = np.zeros((number, BLOCK), dtype=np.uint64)
    for width in np.unique(widths[widths > 0]).tolist():
        own = widths == width
        blocks[own] = _numbers(found[starts[own][:, None] + np.arange(width)], width)
    folded = blocks.ravel()[:count]
    return ((folded >> np.uint64(1)).astype(np.int64)) ^ -((folded & np.uint64(1)).astype(np.int64))


def _bits(numbers: NDArray[np.uint64], width: int) -> NDArray[np.uint8]:
    """Return numbers (rows, N) as bytes (rows, bytes), each number with `width` bits, the lowest bit first."""
    bits = (numbers[:, :, None] >> np.arange(width, dtype=np.uint64)) & np.uint64(1)
    return np.packbits(bits.reshape(len(numbers), -1).astype(np.uint8), axis=1, bitorder="little")


def _numbers(content: NDArray[np.uint8], width: int) -> NDArray[np.uint64]:
    """Return the numbers (rows, N) of `_bits`."""
    bits = np.unpackbits(content, axis=1, bitorder="little")
    bits = bits[:, : bits.shape[1] // width * width].reshape(len(content), -1, width)
    places = np.uint64(1) << np.arange(width, dtype=np.uint64)
    return np.asarray((bits * places).sum(axis=2, dtype=np.uint64))
