"""Messages between the processes and the page of the viewer."""

from __future__ import annotations

import json
from typing import Any

__all__ = ["Answer", "as_json"]

Answer = dict[str, Any]
"""Message to the page: a dictionary that JSON can represent, with the key ``kind``."""


def as_json(answer: Answer) -> str:
    """Return JSON that every browser reads: NaN and infinity become null.

    >>> as_json({"a": [1.5, float("nan")]})
    '{"a": [1.5, null]}'
    """
    try:
        return json.dumps(answer, allow_nan=False)
    except ValueError:
        return json.dumps(json.loads(json.dumps(answer), parse_constant=lambda _: None))
