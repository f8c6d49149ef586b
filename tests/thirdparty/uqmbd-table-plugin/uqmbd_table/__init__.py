"""Export means and standard deviations as a table, and the names of a mechanism as a list."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

import uqmbd

__all__ = ["Table"]


@dataclass(frozen=True)
class Table:
    """Exporter of tables of text; `digits` and `spread` are options of the command."""

    name: ClassVar[str] = "table"
    suffix: ClassVar[str] = ".tab"
    exports: ClassVar[tuple[str, ...]] = ("surrogate", "mechanism")

    digits: int = 6
    spread: bool = False

    def refusal(self, what: str, study: Any) -> str:
        """Return why an object cannot be exported: a surrogate of a single time."""
        return "the study has a single time." if what == "surrogate" and len(study.times) < 2 else ""

    def export(self, source: Any, path: Path, study: Any) -> str:
        """Write the file."""
        if isinstance(source, uqmbd.Mechanism):
            path.write_text("\n".join(source.bodies) + "\n")
            return f"{len(source.bodies)} bodies"
        chaos = uqmbd.results.surrogate(source)
        columns = [np.asarray(chaos.labels.times), *chaos.mean, *(chaos.std if self.spread else ())]
        np.savetxt(path, np.column_stack(columns), fmt=f"%.{self.digits}g")
        return f"{len(columns)} columns"


@uqmbd.hookimpl
def uqmbd_exporters() -> list[type[uqmbd.extend.Exporter]]:
    """Return the exporter of this package."""
    return [Table]
