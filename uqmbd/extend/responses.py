"""Arguments of outputs of the linearised mechanism."""

from __future__ import annotations

from uqmbd.dynamics.statics import Channel as Channel
from uqmbd.dynamics.statics import LinearSystem as LinearSystem
