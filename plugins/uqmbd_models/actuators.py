"""What actuators do without any control: joints get their rotors and damping, and forces are listed as omissions."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

import uqmbd

__all__ = ["passive"]


def passive(mujoco: ModuleType, spec: Any) -> tuple[dict[str, tuple[float, float]], list[uqmbd.extend.Omission]]:
    """Read what actuators add to joints, and tell the rest of what acts without control.

    Inertia and damping are those of the actuator's side of the gear: a joint has the square of the gear ratio of it.

    Parameters
    ----------
    mujoco : module
    spec : mujoco.MjSpec
        A parsed file; versions before the fourth have no such numbers.

    Returns
    -------
    dict
        Damping and inertia of each of the freedoms of joints, by the names of the joints.
    list of uqmbd.extend.Omission
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
            told = _bias(mujoco, actuator)
            biased += [f"{name} ({told}{_geared(gear)})"] if told else []
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
            "they act on no joint; add inertia and dampers of these numbers",
        ),
        ("nonlinear damping of actuators", curved, "its linear part is taken"),
        ("forces of actuators without control", biased, "add springs, dampers or torques of these numbers"),
    ]
    return found, [uqmbd.extend.Omission(what, tuple(names), why) for what, names, why in rows if names]


def _geared(gear: float) -> str:
    return "" if gear == 1 else f", gear {gear:g}"


def _bias(mujoco: ModuleType, actuator: Any) -> str:
    """Say what an actuator does by itself: the spring and damper of a servo; nothing if they are zero."""
    constant, spring, damper = map(float, actuator.biasprm[:3])
    if actuator.biastype != mujoco.mjtBias.mjBIAS_AFFINE:
        kind = str(actuator.biastype.name).removeprefix("mjBIAS_").lower()
        return f"of the kind {kind}"
    servo = actuator.gaintype == mujoco.mjtGain.mjGAIN_FIXED and float(actuator.gainprm[0]) == -spring
    parts = [f"force {constant:g}"] if constant else []
    parts += [f"kp {-spring:g}"] if spring else []
    if damper:  # the compiler makes a damping ratio, which is positive, a rate
        parts.append(f"dampratio {damper:g}" if servo and damper > 0 else f"kv {-damper:g}")
    return ", ".join(parts)
