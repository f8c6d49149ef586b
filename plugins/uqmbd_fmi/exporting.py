"""Export of surrogates and mechanisms as FMUs."""

from __future__ import annotations

import importlib.resources
import re
import tempfile
import uuid
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import xarray as xr

import uqmbd
from uqmbd import StudyError
from uqmbd.extend import Bounds, typechecked
from uqmbd_fmi.compiling import WINDOWS, Platform, check_compilers, compile_library, find_compiler, host, zig
from uqmbd_fmi.description import Description, build_description, model_description
from uqmbd_fmi.distributions import PLACE, distributions_text, parameter_set
from uqmbd_fmi.mechanism_tables import mechanism_model
from uqmbd_fmi.surrogate_tables import UnitModel, surrogate_model

__all__ = ["Exported", "QUANTILES", "export_fmu"]

QUANTILES = (0.05, 0.5, 0.95)
"""Default probabilities of the quantiles of an FMU."""

SHARED = ("instance.c",)
"""Source files of all FMUs, in addition to the source files of the FMI version and of the model."""

SURROGATE = ("surrogate.c",)
"""Source files of a surrogate."""

MECHANISM = ("mechanism.c", "integration.c", "sampled_laws.c", "motion_memory.c", "driver.c", "motion_data.c")
"""Source files of a mechanism: files of the package, and files of its motion."""

HEADERS = {
    SURROGATE: ("model.h", "surrogate.h"),
    MECHANISM: ("model.h", "motion_memory.h", "integration.h", "sampled_laws.h"),
}
"""Headers of the package that the sources of a model need."""


@dataclass(frozen=True)
class Exported:
    """Files of an export.

    Attributes
    ----------
    path : pathlib.Path
        The FMU.
    parameters : pathlib.Path or None
        Parameter set (SSV) with the joint distribution of the random variables; None without random variables.
    platforms : tuple of str
        Platforms of the binaries in the FMU; empty for an FMU of sources.
    compiler : str
        Name of the C compiler; empty without binaries.
    warnings : str
        Messages of the compiler.
    size : int
        Size of the FMU in bytes.

    Examples
    --------
    >>> from pathlib import Path
    >>> from uqmbd_fmi import Exported
    >>> Exported(Path("stone.fmu"), None, ("x86_64-linux",), "cc", "", 33000).platforms
    ('x86_64-linux',)
    """

    path: Path
    parameters: Path | None
    platforms: tuple[str, ...]
    compiler: str
    warnings: str
    size: int


@typechecked
def export_fmu(
    source: xr.DataTree | xr.DataArray | uqmbd.Mechanism,
    path: str | Path,
    *,
    fmi: Literal[2, 3] = 2,
    quantiles: Annotated[Sequence[float], Bounds(0, 1)] = QUANTILES,
    compiler: str | None = None,
    windows: bool = False,
    times: Sequence[float] = (0.0, 1.0),
    inputs: Sequence[str] = (),
    rtol: Annotated[float, Bounds(1e-12, 0.1)] = 1e-6,
) -> Exported:
    """Export a surrogate or a mechanism as an FMU for co-simulation, with the joint distribution of its inputs.

    Parameters
    ----------
    source : xarray.DataTree or uqmbd.Mechanism
        Node of a method with a surrogate, ``tree["LABEL"]``, which type checkers may regard as a DataArray; or a
        mechanism.
    path : str or pathlib.Path
        File to write, with the ending ``.fmu``. The parameter set has the same name with the ending ``.ssv``.
    fmi : {2, 3}
        Major version of the standard: FMI 2.0 or FMI 3.0.
    quantiles : sequence of float
        Probabilities of the quantiles that the FMU provides.
    compiler : str, optional
        C compiler: the name of a program, ``"zig"`` for the compiler of the package ziglang, or ``"none"`` for an FMU
        of sources. Default: the first one of ``$CC``, cc, gcc, clang and zig.
    windows : bool
        Whether to add a binary for 64-bit Windows, which zig compiles. This binary is not tested.
    times : sequence of float
        For a mechanism: start, stop and further output times of the default experiment, s.
    inputs : sequence of str
        For a mechanism: names of random variables that become inputs of the FMU, such as forces and commands. They are
        constant in each communication step. All other random variables are parameters, which are fixed at the start.
    rtol : float
        For a mechanism: relative tolerance, unless the simulation sets one.

    Returns
    -------
    Exported
        Files, platforms, compiler and size of the export.

    Raises
    ------
    uqmbd.StudyError
        If the source cannot be exported, or the compiler does not exist.

    Examples
    --------
    >>> import chaospy, tempfile, uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> from uqmbd_fmi import export_fmu
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> mechanism.output("height", stone.position[0], units="m")
    >>> tree = uqmbd.Study("throw", mechanism, [0, 1, 2], [Collocation(order=1)]).run()
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     exported = export_fmu(tree["collocation"], f"{folder}/stone.fmu", compiler="none")
    >>> exported.path.name, exported.parameters.name, exported.platforms
    ('stone.fmu', 'stone.ssv', ())
    """
    target = Path(path)
    if target.suffix != ".fmu":
        raise StudyError(f"export_fmu: the path is {target}; expected a file with the ending .fmu.")
    if not target.parent.is_dir():
        raise StudyError(f"export_fmu: the folder {target.parent} does not exist; create it first.")
    check_compilers(compiler, windows)
    token = "{" + str(uuid.uuid4()) + "}"
    if isinstance(source, uqmbd.Mechanism):
        model = mechanism_model(source, times, tuple(inputs), rtol, token, fmi)
        about = f"Mechanism {source.name!r}, integrated by the driver of uqmbd"
        return _written(model, target, fmi, token, about, MECHANISM, compiler, windows)
    if not isinstance(source, xr.DataTree):
        raise StudyError(
            f"export_fmu: source is a {type(source).__name__}; expected a mechanism, or the node of a method, "
            "tree['LABEL']."
        )
    if inputs:
        raise StudyError(
            "export_fmu: only the export of a mechanism has the argument 'inputs'; a surrogate has parameters only."
        )
    levels = tuple(sorted(set(map(float, quantiles))))
    if levels and not 0 < levels[0] <= levels[-1] < 1:
        raise StudyError(f"export_fmu: quantiles is {levels}; expected probabilities between 0 and 1.")
    model = surrogate_model(source, levels, token, fmi)
    label = str(source.attrs.get("label", source.name))
    about = f"Surrogate of the method {label!r}, with the uncertainty of its inputs"
    return _written(model, target, fmi, token, about, SURROGATE, compiler, windows)


def _written(
    model: UnitModel,
    target: Path,
    fmi: Literal[2, 3],
    token: str,
    about: str,
    own: tuple[str, ...],
    compiler: str | None,
    windows: bool,
) -> Exported:
    """Compile a model and write its FMU."""
    variables, files = model.variables, dict(model.files)
    identifier = re.sub(r"\W", "_", target.stem, flags=re.ASCII) or "model"
    identifier = identifier if not identifier[0].isdigit() else f"_{identifier}"
    compiled = (*SHARED, f"fmi{fmi}.c", *own, "data.c")
    of = Description(
        target.stem, identifier, token, about, model.times, model.tolerance, model.tolerance is None, compiled
    )
    folder = importlib.resources.files("uqmbd_fmi") / "sources"
    for name in (*HEADERS[own], *compiled):
        if name not in files:
            files[name] = (folder / name).read_text(encoding="utf-8")
    parameters = [v for v in variables if v.causality == "parameter"]
    random = [v for v in variables if v.name in model.space.inputs]
    with tempfile.TemporaryDirectory(prefix="uqmbd_fmi_") as work:
        root = Path(work)
        (root / "sources").mkdir()
        for name, content in files.items():
            (root / "sources" / name).write_text(content, encoding="utf-8")
        if fmi == 3:
            (root / "sources/buildDescription.xml").write_text(build_description(of), encoding="utf-8")
        (root / "modelDescription.xml").write_text(model_description(of, variables, fmi), encoding="utf-8")
        if random:
            (root / PLACE).parent.mkdir(parents=True)
            (root / PLACE).write_text(distributions_text(model.space, random), encoding="utf-8")
        platforms, used, warnings = _binaries(root, identifier, compiled, fmi, compiler, windows)
        _pack(root, target)
    settings = None
    if random:
        settings = target.with_suffix(".ssv")
        settings.write_text(parameter_set(target.stem, model.space, parameters, random), encoding="utf-8")
    return Exported(target, settings, platforms, used, warnings, target.stat().st_size)


def _binaries(
    root: Path, identifier: str, sources: Sequence[str], fmi: int, compiler: str | None, windows: bool
) -> tuple[tuple[str, ...], str, str]:
    """Compile for this computer and for Windows; return the platforms, the compiler and its messages."""
    found: list[str] = []
    used, messages = "", []
    wanted: list[tuple[Any, Platform]] = []
    chosen = None if compiler == "none" else find_compiler(compiler)
    here = host()
    if chosen is not None and here is not None:
        wanted.append((chosen, here))
    if windows and here is not WINDOWS:
        cross = zig()
        assert cross is not None
        wanted.append((cross, WINDOWS))
    for one, on in wanted:
        to = root / on.folder(fmi) / f"{identifier}{on.suffix}"
        messages.append(compile_library(one, root / "sources", sources, to, on))
        for extra in to.parent.iterdir():
            if extra != to:
                extra.unlink()  # import libraries and debug information of Windows
        found.append(on.fmi3)
        used = used or one.name
    return tuple(found), used, "\n".join(m for m in messages if m)


def _pack(root: Path, target: Path) -> None:
    """Write a folder as a ZIP archive, with modelDescription.xml first."""
    names = sorted(p.relative_to(root).as_posix() for p in root.rglob("*") if p.is_file())
    names.sort(key=lambda name: name != "modelDescription.xml")
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name in names:
            archive.write(root / name, name)
