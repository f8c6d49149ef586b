"""What plugins need that add summaries of motions."""

from __future__ import annotations

from uqmbd.mechanism import summary as summary
