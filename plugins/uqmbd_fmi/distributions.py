"""Joint distribution of the inputs as a file: in the FMU, and as a parameter set (SSV) next to it."""

from __future__ import annotations

import json
import math
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np
import xarray as xr

from uqmbd import StudyError
from uqmbd.extend import GermSpace, typechecked
from uqmbd_fmi.variables import Variable

__all__ = ["PLACE", "distributions_text", "parameter_set", "read_distributions"]

PLACE = "extra/uqmbd/distributions.json"
"""Place of the file in an FMU."""

VALUES = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
COMMON = "http://ssp-standard.org/SSP1/SystemStructureCommon"
TYPE = "uqmbd.distribution"

ABOUT = (
    "Joint distribution of the inputs. 'inputs' describes each input for readers; 'germ_space' is the exact joint "
    "distribution, which uqmbd_fmi.read_distributions reads."
)


def distributions_text(space: GermSpace, random: Sequence[Variable]) -> str:
    """Return the joint distribution as text in JSON, with the description of each random variable."""
    inputs = [{"name": v.name, "units": v.units, "mean": v.start, "distribution": v.description} for v in random]
    stored = {"about": ABOUT, "format": 1, "inputs": inputs, "germ_space": _plain(space.to_dataset().to_dict())}
    return json.dumps(stored, indent=1, allow_nan=False) + "\n"


@typechecked
def read_distributions(path: str | Path) -> GermSpace:
    """Return the joint distribution of the inputs from an FMU, a parameter set (SSV) or a JSON file of an export.

    Parameters
    ----------
    path : str or pathlib.Path
        The FMU, or the file with the ending ``.ssv`` next to it, or the file ``distributions.json`` of the FMU.

    Returns
    -------
    uqmbd.extend.GermSpace
        Joint distribution: ``to_inputs`` maps independent germs to inputs, ``from_uniform`` random numbers to germs.

    Raises
    ------
    uqmbd.StudyError
        If the file does not exist or contains no distributions.

    Examples
    --------
    >>> import chaospy, tempfile, uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> from uqmbd_fmi import export_fmu, read_distributions
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> mechanism.output("height", stone.position[0], units="m")
    >>> tree = uqmbd.Study("throw", mechanism, [0, 1, 2], [Collocation(order=1)]).run()
    >>> folder = tempfile.TemporaryDirectory()
    >>> exported = export_fmu(tree["collocation"], f"{folder.name}/stone.fmu", compiler="none")
    >>> space = read_distributions(f"{folder.name}/stone.fmu")
    >>> folder.cleanup()
    >>> space.inputs, space.to_inputs([[1.0]]).tolist()
    (('speed',), [[3.2]])
    """
    file = Path(path)
    if not file.is_file():
        raise StudyError(f"read_distributions: the file {file} does not exist.")
    try:
        if zipfile.is_zipfile(file):
            with zipfile.ZipFile(file) as archive:
                text = archive.read(PLACE).decode()
        elif file.suffix == ".ssv":
            text = _annotation(file)
        else:
            text = file.read_text(encoding="utf-8")
        stored = json.loads(text)
        return GermSpace.from_dataset(xr.Dataset.from_dict(_arrays(stored["germ_space"])))
    except (KeyError, ValueError, TypeError, UnicodeDecodeError, Xml.ParseError) as error:
        raise StudyError(
            f"read_distributions: {file} contains no distributions of an export by uqmbd; expected an FMU of a "
            "mechanism or surrogate with random variables, or the file with the ending .ssv next to it."
        ) from error


def parameter_set(name: str, space: GermSpace, parameters: Sequence[Variable], random: Sequence[Variable]) -> str:
    """Return a parameter set of SSP 1.0 with the means of parameters, and the joint distribution as an annotation."""
    Xml.register_namespace("ssv", VALUES)
    Xml.register_namespace("ssc", COMMON)
    root = Xml.Element(f"{{{VALUES}}}ParameterSet", {"version": "1.0", "name": name})
    listed = Xml.SubElement(root, f"{{{VALUES}}}Parameters")
    for v in parameters:
        one = Xml.SubElement(listed, f"{{{VALUES}}}Parameter", {"name": v.name, "description": v.description})
        Xml.SubElement(one, f"{{{VALUES}}}Real", {"value": repr(v.start)} | ({"unit": v.units} if v.units else {}))
    units = sorted({v.units for v in parameters if v.units})
    if units:
        defined = Xml.SubElement(root, f"{{{VALUES}}}Units")
        for unit in units:
            Xml.SubElement(Xml.SubElement(defined, f"{{{COMMON}}}Unit", {"name": unit}), f"{{{COMMON}}}BaseUnit")
    notes = Xml.SubElement(root, f"{{{VALUES}}}Annotations")
    note = Xml.SubElement(notes, f"{{{COMMON}}}Annotation", {"type": TYPE})
    Xml.SubElement(note, "distributions").text = distributions_text(space, random)
    Xml.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"


def _annotation(file: Path) -> str:
    from defusedxml import ElementTree

    root = ElementTree.fromstring(file.read_text(encoding="utf-8"))
    for note in root.iter(f"{{{COMMON}}}Annotation"):
        found = note.find("distributions")
        if note.get("type") == TYPE and found is not None and found.text:
            return str(found.text)
    raise KeyError(TYPE)


def _plain(value: Any) -> Any:
    """Return a value for JSON: numbers that are not finite become texts."""
    if isinstance(value, dict):
        return {str(k): _plain(x) for k, x in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(x) for x in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return {"number": repr(value)}
    return value


def _arrays(value: Any) -> Any:
    """Restore numbers that are not finite."""
    if isinstance(value, dict):
        if set(value) == {"number"}:
            return float(value["number"])
        return {k: _arrays(x) for k, x in value.items()}
    return [_arrays(x) for x in value] if isinstance(value, list) else value
