"""What plugins need to check the arguments of their public functions and classes, and the options of their methods."""

from __future__ import annotations

from uqmbd.arguments import Bounds as Bounds
from uqmbd.arguments import typechecked as typechecked
