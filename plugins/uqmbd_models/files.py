"""MJCF files, parsed by MuJoCo, with removal and count of unneeded elements before compilation.

Shapes are needed only to compute inertia; without the other shapes, their mesh files are not needed. Passive parts of
actuators add rotors and damping to joints; their forces are listed as omissions.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

import uqmbd
from uqmbd_models.documents import parse
from uqmbd_models.names import Names
from uqmbd_models.sizes import require_sizes

__all__ = ["ParsedFile", "listening", "load"]


def passive(mujoco: ModuleType, spec: Any) -> tuple[dict[str, tuple[float, float]], list[uqmbd.extend.Omission]]:
    """Return the passive parts of actuators in joints, and list other passive parts.

    Inertia and damping of the actuator are multiplied by the square of the gear ratio. `spec`: parsed file; MuJoCo
    before version 4 has no such numbers. Return damping and inertia of each freedom of joints, by the names of the
    joints.
    """
    transmissions, biases = mujoco.mjtTrn, mujoco.mjtBias
    joints = {joint.name for joint in spec.joints}
    found: dict[str, tuple[float, float]] = {}
    elsewhere: list[str] = []
    curved: list[str] = []
    biased: list[str] = []
    for k, actuator in enumerate(spec.actuators, 1):
        name = actuator.name or f"no. {k}"
        inertia = float(getattr(actuator, "armature", 0.0))
        damping, *more = np.atleast_1d(getattr(actuator, "damping", 0.0)).astype(float)
        gear = float(actuator.gear[0])
        if actuator.biastype != biases.mjBIAS_NONE:
            bias = _passive_force(mujoco, actuator)
            biased += [f"{name} ({bias}{_geared(gear)})"] if bias else []
        if not (inertia or damping or any(more)):
            continue
        on_joint = actuator.trntype in (transmissions.mjTRN_JOINT, transmissions.mjTRN_JOINTINPARENT)
        if not on_joint or actuator.target not in joints:
            elsewhere.append(f"{name} (armature {inertia:g}, damping {damping:g}{_geared(gear)})")
            continue
        curved += [name] if any(more) else []
        before = found.get(actuator.target, (0.0, 0.0))
        found[actuator.target] = before[0] + gear**2 * float(damping), before[1] + gear**2 * inertia
    rows = [
        (
            "rotors and damping of actuators",
            elsewhere,
            "they do not act on a joint; add inertia and dampers with these values",
        ),
        ("nonlinear damping of actuators", curved, "only its linear part is imported"),
        (
            "forces of actuators without control",
            biased,
            "they are not imported; add springs, dampers or torques with these values",
        ),
    ]
    return found, [uqmbd.extend.Omission(what, tuple(names), why) for what, names, why in rows if names]


def _geared(gear: float) -> str:
    return "" if gear == 1 else f", gear {gear:g}"


def _passive_force(mujoco: ModuleType, actuator: Any) -> str:
    """Return a description of the passive force of an actuator (spring and damper of a servo), or an empty text."""
    constant, spring, damper = map(float, actuator.biasprm[:3])
    if actuator.biastype != mujoco.mjtBias.mjBIAS_AFFINE:
        kind = str(actuator.biastype.name).removeprefix("mjBIAS_").lower()
        return f"of the kind {kind}"
    servo = actuator.gaintype == mujoco.mjtGain.mjGAIN_FIXED and float(actuator.gainprm[0]) == -spring
    parts = [f"force {constant:g}"] if constant else []
    parts += [f"kp {-spring:g}"] if spring else []
    if damper:  # the compiler converts a positive value, a damping ratio, to a rate
        parts.append(f"dampratio {damper:g}" if servo and damper > 0 else f"kv {-damper:g}")
    return ", ".join(parts)


INSTALL = 'pip install "uqmbd[mujoco]"'

SET_ASIDE = {
    "actuators": "they are not imported; add drivers or torques",
    "sensors": "they are not imported; define outputs of the mechanism",
    "tendons": "they are not imported; add springs or distance constraints",
    "flexes": "they are not imported, because bodies in uqmbd are rigid",
    "pairs": "contacts are not imported; add contact components of uqmbd_contact",
    "excludes": "they concern contacts, which are not imported",
    "skins": "they only affect rendering",
    "cameras": "they only affect rendering",
    "lights": "they only affect rendering",
    "tuples": "they do not affect the motion",
    "numerics": "they do not affect the motion",
    "texts": "they do not affect the motion",
    "plugins": "uqmbd does not run code of MuJoCo plugins",
}
"""Elements that are removed from a model, with reasons; the names are names of lists of `mujoco.MjSpec`."""

TITLES = {"pairs": "contact pairs", "excludes": "contact exclusions"}

AUTO, NEVER = 2, 0
"""Values of `inertiafromgeom`."""


@dataclass(frozen=True)
class ParsedFile:
    """Parsed MJCF file."""

    path: str
    mujoco: ModuleType
    spec: Any  # specification to compile
    omissions: list[uqmbd.extend.Omission] = field(default_factory=list)  # removed elements
    advice: list[str] = field(default_factory=list)  # warnings of MuJoCo's parser
    # damping and inertia of actuators, by the names of the joints
    rotors: dict[str, tuple[float, float]] = field(default_factory=dict)

    def error(self, reason: object) -> uqmbd.StudyError:
        """Return an error that names the file."""
        text = " ".join(str(reason).split())
        return uqmbd.StudyError(f"{self.path}: MuJoCo {self.mujoco.__version__} cannot compile the file: {text}")


def load(path: str) -> ParsedFile:
    """Parse a file, and remove unneeded elements.

    `path`: path of the file. Raise StudyError if MuJoCo is not installed, the file is not MJCF, or MuJoCo cannot create
    the model.
    """
    where = f"from_mjcf: {path}"
    root = parse(where, path, "mjcf").root
    if root.tag != "mujoco":
        hint = "; it is URDF: use uqmbd.from_urdf" if root.tag == "robot" else ""
        raise uqmbd.StudyError(f"{where}: line {root.line}: the root element is <{root.tag}>; expected <mujoco>{hint}.")
    require_sizes(path, root)
    mujoco = _mujoco()
    try:
        with listening(mujoco) as notes:
            spec = _spec(mujoco, path)
    except Exception as error:  # the parser raises errors of several types
        raise ParsedFile(path, mujoco, None).error(error) from None
    loaded = ParsedFile(path, mujoco, spec, advice=notes)
    try:
        _name(spec)
        _remove_unneeded(loaded)
    except (AttributeError, TypeError) as error:
        raise uqmbd.StudyError(
            f"from_mjcf needs a later MuJoCo than {mujoco.__version__} ({error}): {INSTALL} --upgrade"
        ) from None
    except ValueError as error:  # MuJoCo raises it for repeated names, for example
        raise loaded.error(error) from None
    return loaded


@contextmanager
def listening(mujoco: ModuleType) -> Iterator[list[str]]:
    """Collect the warnings of MuJoCo; otherwise it writes them to the terminal and to a file in the current folder."""
    lines: list[str] = []

    def note(text: object) -> None:
        lines.append(" ".join((text.decode(errors="replace") if isinstance(text, bytes) else str(text)).split()))

    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(note)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield lines
        for warning in caught:
            note(warning.message)
    finally:
        mujoco.set_mju_user_warning(before)
        lines[:] = dict.fromkeys(lines)


def _mujoco() -> ModuleType:
    try:
        import mujoco
    except ImportError as error:
        raise uqmbd.StudyError(
            f"from_mjcf parses the file with MuJoCo, which cannot be imported ({error}). Install it with: {INSTALL}"
        ) from None
    found: ModuleType = mujoco
    if not hasattr(mujoco, "MjSpec"):
        version = getattr(mujoco, "__version__", "this one")
        raise uqmbd.StudyError(f"from_mjcf needs a later MuJoCo than {version}: {INSTALL} --upgrade")
    return found


def _spec(mujoco: ModuleType, path: str) -> Any:
    """Parse a file by MuJoCo; a file with an unknown ending is passed as a text."""
    if Path(path).suffix.lower() == ".xml":
        return mujoco.MjSpec.from_file(path)
    return mujoco.MjSpec.from_string(Path(path).read_text(encoding="utf-8"))


def _name(spec: Any) -> None:
    """Give names to bodies and joints without a name."""
    bodies = list(spec.bodies)
    names = Names(body.name for body in bodies)
    for k, body in enumerate(bodies):
        if not body.name:
            body.name = names.take(f"body_{k}")
    joints = Names(joint.name for joint in spec.joints)
    for body in bodies:
        for joint in body.joints:
            if not joint.name:
                joint.name = joints.take(f"{body.name}_joint")


def _remove_unneeded(loaded: ParsedFile) -> None:
    """Remove unneeded elements of a model, and list them."""
    spec = loaded.spec
    spec.compiler.fusestatic = False
    spec.compiler.discardvisual = False
    equalities = loaded.mujoco.mjtEq
    taken = {equalities.mjEQ_CONNECT, equalities.mjEQ_WELD, equalities.mjEQ_JOINT}
    others = [equality for equality in spec.equalities if equality.type not in taken]
    _drop(
        loaded,
        "equality constraints of tendons and flexible bodies",
        others,
        "they are not imported, as the parts that they constrain",
    )
    rotors, rows = passive(loaded.mujoco, spec)
    loaded.rotors.update(rotors)
    for group, why in SET_ASIDE.items():
        _drop(loaded, TITLES.get(group, group), getattr(spec, group, ()), why)
        loaded.omissions.extend(rows if group == "actuators" else [])
    for key in spec.keys:
        key.act, key.ctrl = [], []
    _shapes(loaded)


def _drop(loaded: ParsedFile, what: str, elements: Iterable[Any], why: str) -> None:
    """Delete elements of a model, and list them."""
    found = list(elements)
    if found:
        names = tuple(getattr(x, "name", "") or f"no. {k}" for k, x in enumerate(found, 1))
        loaded.omissions.append(uqmbd.extend.Omission(what, names, why))
    for element in found:
        _delete(loaded.spec, element)


def _delete(spec: Any, element: Any) -> None:
    if hasattr(spec, "delete"):
        spec.delete(element)
    else:
        element.delete()


def _shapes(loaded: ParsedFile) -> None:
    """Delete shapes that are not needed for inertia, and their exclusive assets."""
    spec = loaded.spec
    always = spec.compiler.inertiafromgeom not in (AUTO, NEVER)
    inferred: list[str] = []
    colliding: list[str] = []
    for body in spec.bodies:
        geoms = list(body.geoms)
        colliding += [geom.name or f"of {body.name}" for geom in geoms if geom.contype or geom.conaffinity]
        needed = body.name != "world" and (always or not body.explicitinertial)
        if geoms and needed and spec.compiler.inertiafromgeom != NEVER:
            inferred.append(body.name)
            for geom in geoms:
                geom.material = ""
            continue
        for geom in geoms:
            _delete(spec, geom)
    used = {geom.meshname for geom in spec.geoms if geom.meshname}
    for mesh in list(spec.meshes):
        if mesh.name not in used and Path(mesh.file or "").stem not in used:
            _delete(spec, mesh)
        else:
            mesh.material = ""
    held = {name for equality in spec.equalities for name in (equality.name1, equality.name2)}
    for site in list(spec.sites):
        if site.name in held:
            site.material = ""
        else:
            _delete(spec, site)
    for group in ("hfields", "materials", "textures"):
        for element in list(getattr(spec, group)):
            _delete(spec, element)
    if colliding:
        why = "contacts are not imported; add contact components of uqmbd_contact"
        loaded.omissions.append(uqmbd.extend.Omission("shapes that collide", tuple(colliding), why))
    if inferred:
        why = "computed by MuJoCo from the density of their shapes, as the file does not state it"
        loaded.omissions.append(uqmbd.extend.Omission("masses and inertia", tuple(inferred), why))
