"""Descriptions of an FMU: modelDescription.xml of FMI 2.0 and 3.0, and buildDescription.xml of FMI 3.0."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from xml.etree import ElementTree as Xml

import uqmbd
from uqmbd_fmi.variables import Variable

__all__ = ["Description", "build_description", "model_description"]


@dataclass(frozen=True)
class Description:
    """Properties of an FMU that its description states."""

    name: str
    identifier: str
    token: str
    text: str
    times: tuple[float, float, float] | None
    tolerance: float | None
    derivatives: bool
    sources: tuple[str, ...]


def model_description(of: Description, variables: Sequence[Variable], fmi: int) -> str:
    """Return the text of modelDescription.xml; `fmi` is the major version."""
    tree = _version_2(of, variables) if fmi == 2 else _version_3(of, variables)
    Xml.indent(tree)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(tree, encoding="unicode") + "\n"


def build_description(of: Description) -> str:
    """Return the text of sources/buildDescription.xml of FMI 3.0."""
    root = Xml.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    build = Xml.SubElement(root, "BuildConfiguration", {"modelIdentifier": of.identifier})
    files = Xml.SubElement(build, "SourceFileSet", {"language": "C11"})
    for name in of.sources:
        Xml.SubElement(files, "SourceFile", {"name": name})
    Xml.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"


def _attributes(of: Description) -> dict[str, str]:
    return {
        "modelName": of.name,
        "description": of.text,
        "version": "1.0",
        "generationTool": f"uqmbd {uqmbd.__version__}",
        "generationDateAndTime": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        "variableNamingConvention": "flat",
    }


def _experiment(root: Xml.Element, of: Description) -> None:
    if of.times is None:
        return
    start, stop, step = of.times
    found = {"startTime": repr(start), "stopTime": repr(stop), "stepSize": repr(step)}
    if of.tolerance is not None:
        found["tolerance"] = repr(of.tolerance)
    Xml.SubElement(root, "DefaultExperiment", found)


def _units(root: Xml.Element, variables: Sequence[Variable]) -> None:
    names = sorted(
        {v.units for v in variables if v.units} | ({"s"} if any(v.causality == "time" for v in variables) else set())
    )
    if names:
        units = Xml.SubElement(root, "UnitDefinitions")
        for name in names:
            Xml.SubElement(units, "Unit", {"name": name})


def _numbers(v: Variable) -> dict[str, str]:
    """Return units, bounds and start of a variable as attributes."""
    found = {"unit": v.units} if v.units else {}
    known: Mapping[str, float | None] = {"min": v.low, "max": v.high, "start": v.start}
    return found | {name: repr(x) for name, x in known.items() if x is not None}


def _variability(v: Variable) -> str:
    if v.causality == "parameter":
        return "tunable" if v.tunable else "fixed"
    return "discrete" if v.truth else "continuous"


def _version_2(of: Description, variables: Sequence[Variable]) -> Xml.Element:
    root = Xml.Element("fmiModelDescription", {"fmiVersion": "2.0", **_attributes(of), "guid": of.token})
    simulation = Xml.SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": of.identifier,
            "canHandleVariableCommunicationStepSize": "true",
            "canGetAndSetFMUstate": "true",
            "canSerializeFMUstate": "true",
            "providesDirectionalDerivative": str(of.derivatives).lower(),
        },
    )
    files = Xml.SubElement(simulation, "SourceFiles")
    for name in of.sources:
        Xml.SubElement(files, "File", {"name": name})
    _units(root, variables)
    categories = Xml.SubElement(root, "LogCategories")
    for name in ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal", "logAll"):
        Xml.SubElement(categories, "Category", {"name": name})
    _experiment(root, of)
    declared = Xml.SubElement(root, "ModelVariables")
    for reference, v in enumerate(variables):
        about = {"name": v.name, "valueReference": str(reference)}
        if v.description:
            about["description"] = v.description
        if v.causality == "time":
            about |= {"causality": "independent", "variability": "continuous"}
        else:
            about |= {"causality": v.causality, "variability": _variability(v)}
        if v.causality in ("parameter", "output"):
            about["initial"] = "exact" if v.causality == "parameter" else "calculated"
        scalar = Xml.SubElement(declared, "ScalarVariable", about)
        Xml.SubElement(scalar, "Boolean" if v.truth else "Real", _numbers(v))
    structure = Xml.SubElement(root, "ModelStructure")
    places = {v.name: str(k + 1) for k, v in enumerate(variables)}
    for group in ("Outputs", "InitialUnknowns"):
        listed = Xml.SubElement(structure, group)
        for v in variables:
            if v.causality == "output":
                known = _dependencies(v, places, initial=group == "InitialUnknowns")
                Xml.SubElement(listed, "Unknown", {"index": places[v.name], **known})
    return root


def _version_3(of: Description, variables: Sequence[Variable]) -> Xml.Element:
    root = Xml.Element("fmiModelDescription", {"fmiVersion": "3.0", **_attributes(of), "instantiationToken": of.token})
    Xml.SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": of.identifier,
            "canHandleVariableCommunicationStepSize": "true",
            "canGetAndSetFMUState": "true",
            "canSerializeFMUState": "true",
            "providesDirectionalDerivatives": str(of.derivatives).lower(),
        },
    )
    _units(root, variables)
    categories = Xml.SubElement(root, "LogCategories")
    for name in ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal", "logAll"):
        Xml.SubElement(categories, "Category", {"name": name})
    _experiment(root, of)
    declared = Xml.SubElement(root, "ModelVariables")
    for reference, v in enumerate(variables):
        about = {"name": v.name, "valueReference": str(reference)}
        if v.description:
            about["description"] = v.description
        if v.causality == "time":
            about |= {"causality": "independent", "variability": "continuous"}
        else:
            about |= {"causality": v.causality, "variability": _variability(v)}
        if v.causality in ("parameter", "output"):
            about["initial"] = "exact" if v.causality == "parameter" else "calculated"
        Xml.SubElement(declared, "Boolean" if v.truth else "Float64", about | _numbers(v))
    structure = Xml.SubElement(root, "ModelStructure")
    references = {v.name: str(k) for k, v in enumerate(variables)}
    for group in ("Output", "InitialUnknown"):
        for v in variables:
            if v.causality == "output":
                known = _dependencies(v, references, initial=group == "InitialUnknown")
                Xml.SubElement(structure, group, {"valueReference": references[v.name], **known})
    return root


def _dependencies(of: Variable, places: Mapping[str, str], *, initial: bool) -> dict[str, str]:
    """Return the attribute of the variables that change an output directly; without it, programs assume all of them."""
    if of.depends is None:
        return {}
    names = of.starts if initial else of.depends
    return {"dependencies": " ".join(sorted((places[name] for name in names), key=int))}
