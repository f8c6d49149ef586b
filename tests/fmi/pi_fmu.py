"""The PI controller of `pi_controller.c` as an FMU of FMI 2.0 or 3.0, written and compiled without the exporter."""

from __future__ import annotations

import zipfile
from pathlib import Path

from uqmbd_fmi.compiling import compile_library, find_compiler, host

SOURCE = Path(__file__).with_name("pi_controller.c")
TOKEN = "{9f1c5a52-6f0f-4a70-8a57-6d7a8d1f0a11}"
VARIABLES = (
    ("y", "input", 0.0),
    ("kp", "parameter", 3.0),
    ("ki", "parameter", 0.1),
    ("r", "parameter", 2.0),
    ("limit", "parameter", 1e9),
    ("u", "output", None),
)


def write_pi(folder, fmi=2, changes=()):
    """Write the FMU and return its path; `changes` are pairs of texts to replace in the description."""
    on = host()
    library = folder / on.folder(fmi) / f"pi{on.suffix}"
    assert compile_library(find_compiler(), SOURCE.parent, [SOURCE.name], library, on) is not None
    described = _version_2() if fmi == 2 else _version_3()
    for before, after in changes:
        assert before in described
        described = described.replace(before, after)
    path = folder / f"pi{fmi}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", described)
        archive.write(library, library.relative_to(folder).as_posix())
    return path


def _version_2():
    rows = "".join(
        f'<ScalarVariable name="{name}" valueReference="{k}" causality="{kind}" variability='
        f'"{"fixed" if kind == "parameter" else "continuous"}"'
        + (f'><Real start="{start}"/>' if start is not None else ' initial="calculated"><Real/>')
        + "</ScalarVariable>"
        for k, (name, kind, start) in enumerate(VARIABLES)
    )
    return (
        f'<fmiModelDescription fmiVersion="2.0" modelName="pi" guid="{TOKEN}"><CoSimulation modelIdentifier="pi" '
        f'canHandleVariableCommunicationStepSize="true"/><ModelVariables>{rows}</ModelVariables><ModelStructure>'
        '<Outputs><Unknown index="6"/></Outputs><InitialUnknowns><Unknown index="6"/></InitialUnknowns>'
        "</ModelStructure></fmiModelDescription>"
    )


def _version_3():
    rows = "".join(
        f'<Float64 name="{name}" valueReference="{k}" causality="{kind}" variability='
        f'"{"fixed" if kind == "parameter" else "continuous"}"'
        + (f' start="{start}"/>' if start is not None else ' initial="calculated"/>')
        for k, (name, kind, start) in enumerate(VARIABLES)
    )
    return (
        f'<fmiModelDescription fmiVersion="3.0" modelName="pi" instantiationToken="{TOKEN}"><CoSimulation '
        f'modelIdentifier="pi" canHandleVariableCommunicationStepSize="true"/><ModelVariables>{rows}'
        '<Float64 name="time" valueReference="6" causality="independent" variability="continuous"/></ModelVariables>'
        '<ModelStructure><Output valueReference="5"/><InitialUnknown valueReference="5"/></ModelStructure>'
        "</fmiModelDescription>"
    )
