"""Exporter of FMUs for `uqmbd export`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import uqmbd
from uqmbd_fmi.compiling import check_compilers
from uqmbd_fmi.exporting import QUANTILES, export_fmu
from uqmbd_fmi.refusals import refusal

__all__ = ["FmuExporter"]


@dataclass(frozen=True)
class FmuExporter:
    """Export as an FMU; the fields are options of the command, as arguments of `export_fmu`."""

    name = "fmu"
    suffix = ".fmu"
    exports = ("surrogate", "mechanism")

    fmi: Literal[2, 3] = 2
    quantiles: tuple[float, ...] = QUANTILES
    compiler: str = "auto"
    windows: bool = False
    inputs: tuple[str, ...] = ()

    def refusal(self, what: str, study: Any) -> str:
        """Return why an object of a study cannot be exported."""
        try:
            check_compilers(self._compiler, windows=False)
        except uqmbd.StudyError as error:
            return f"--compiler {self.compiler}: {error}"
        try:
            check_compilers(None, self.windows)
        except uqmbd.StudyError as error:
            return f"--windows: {error}"
        if what == "surrogate":
            return (
                refusal(study)
                if not self.inputs
                else "--inputs is possible for a mechanism only; add --what mechanism."
            )
        return uqmbd.extend.motion_refusal(study.mechanism, study.times, held=self.inputs)

    @property
    def _compiler(self) -> str | None:
        """Argument `compiler` of `export_fmu`, which is None, the default, for the option "auto"."""
        return None if self.compiler == "auto" else self.compiler

    def remark(self, what: str, study: Any) -> str:
        """Return remarks: possible inputs, variables that can only be parameters, contacts, and omitted outputs."""
        if what == "surrogate":
            return ""
        motion = uqmbd.extend.motion_source(study.mechanism, study.times)
        found = []
        if possible := ",".join(name for name in motion.inputs if name not in motion.fixed):
            found.append(f"possible inputs: --inputs {possible}")
        if motion.fixed:
            found.append(f"parameters only, because they affect the initial state only: {', '.join(motion.fixed)}")
        if len(motion.contacts) > 1:
            names = ", ".join(motion.contacts)
            found.append(f"may end at an event with several closed contacts, of {names}")
        if omitted := ", ".join(study.mechanism.scalars):
            found.append(f"without the outputs {omitted}, because each is one number for a whole motion")
        return "; ".join(found)

    def export(self, source: Any, path: Path, study: Any) -> str:
        """Write the FMU and its parameter set."""
        done = export_fmu(
            source,
            path,
            fmi=self.fmi,
            quantiles=self.quantiles,
            compiler=self._compiler,
            windows=self.windows,
            times=tuple(study.times.tolist()),
            inputs=self.inputs,
            rtol=study.rtol,
        )
        lines = [f"FMU        {done.path} (FMI {self.fmi}.0, {done.size / 1000:.0f} kB)"]
        if done.parameters is not None:
            lines.append(f"inputs     {done.parameters} (means and joint distribution)")
        if isinstance(source, uqmbd.Mechanism) and source.scalars:
            omitted = ", ".join(source.scalars)
            lines.append(
                f"omitted    {omitted}: each is one number for a whole motion; an exported surrogate contains them"
            )
        if done.platforms:
            lines.append(f"binaries   {', '.join(done.platforms)}, compiled by {done.compiler}")
            if self.windows:
                lines.append("The binary for Windows was not run or tested.")
        else:
            reason = "" if self.compiler == "none" else ": no C compiler was found; `pip install ziglang` installs one"
            lines.append(f"binaries   none{reason}. The FMU contains its C sources, which some programs compile.")
        return "\n".join([*lines, done.warnings] if done.warnings else lines)
