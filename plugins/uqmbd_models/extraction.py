"""Numbers of a model compiled by MuJoCo."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import uqmbd
from uqmbd_models.files import ParsedFile, listening
from uqmbd_models.rotations import inverse, matrix, product
from uqmbd_models.tree import Array, Coupling, Inertial, Link, LoopClosure, Tree, TreeJoint, remarks

__all__ = ["extract"]

KINDS = {0: ("free", 7, 6), 1: ("ball", 4, 3), 2: ("slide", 1, 1), 3: ("hinge", 1, 1)}
"""Kinds of joints by MuJoCo's number, with the lengths of their position and speed."""


FIELDS = {
    "body": ("pos", "quat", "mass", "inertia", "ipos", "iquat", "gravcomp"),
    "jnt": ("pos", "axis", "range", "stiffness"),
}
"""Attributes of bodies and joints that are read and must be finite."""


def extract(loaded: ParsedFile, keyframe: str | int | None = None) -> Tree:
    """Compile a model and return its content.

    `loaded`: parsed file; `keyframe`: initial state.
    """
    try:
        with listening(loaded.mujoco) as advice_lines:
            model = loaded.spec.compile()
    except Exception as error:  # the compiler raises errors of several types
        raise loaded.error(error) from None
    advice = tuple(dict.fromkeys([*loaded.advice, *advice_lines]))
    off = _disabled_features(loaded, model)
    _require_finite(loaded, model)
    links = _links(loaded, model)
    joints = _joints(loaded, model, off, *_state(loaded, model, keyframe))
    loops, coupled, rows = _equalities(loaded, model, off)
    rows = [*loaded.omissions, *rows, *_remarks(loaded, model, joints, off)]
    rows += (
        [uqmbd.extend.Omission("warnings of MuJoCo", advice, "MuJoCo issued them when it read the file")]
        if advice
        else []
    )
    gravity = np.zeros(3) if "GRAVITY" in off else np.array(model.opt.gravity)
    return Tree(
        loaded.spec.modelname,
        loaded.path,
        f"MuJoCo {loaded.mujoco.__version__}",
        gravity,
        links,
        joints,
        loops,
        coupled,
        tuple(rows),
    )


def _require_finite(loaded: ParsedFile, model: Any) -> None:
    """Raise StudyError if a number of a body or joint is not finite."""
    for group, count, name in (("body", model.nbody, model.body), ("jnt", model.njnt, model.joint)):
        for field in FIELDS[group]:
            values = np.reshape(getattr(model, f"{group}_{field}"), (count, -1)) if count else np.zeros((0, 1))
            for k in np.flatnonzero(~np.isfinite(values).all(axis=1)):
                what = f"{'body' if group == 'body' else 'joint'} {name(int(k)).name!r}"
                raise uqmbd.StudyError(
                    f"{loaded.path}: the {field} of {what} is {values[k].tolist()}; expected finite numbers."
                )
    for field in ("qpos0", "qpos_spring", "dof_damping", "dof_frictionloss", "dof_armature"):
        if not np.isfinite(getattr(model, field)).all():
            raise uqmbd.StudyError(
                f"{loaded.path}: {field} of MuJoCo's model contains values that are not finite; "
                "expected finite numbers."
            )


def _disabled_features(loaded: ParsedFile, model: Any) -> set[str]:
    """Return the names of features that the file disables."""
    flags = loaded.mujoco.mjtDisableBit.__members__
    off = {name.removeprefix("mjDSBL_") for name, bit in flags.items() if int(bit) & model.opt.disableflags}
    if "PASSIVE" in off:  # earlier versions of MuJoCo have one flag for springs and dampers
        off |= {"SPRING", "DAMPER"}
    return off | ({"EQUALITY", "FRICTIONLOSS", "LIMIT"} if "CONSTRAINT" in off else set())


def _state(loaded: ParsedFile, model: Any, keyframe: str | int | None) -> tuple[Array, Array]:
    """Return position and speed at the start."""
    if keyframe is None:
        return np.array(model.qpos0), np.zeros(model.nv)
    names = [model.key(k).name for k in range(model.nkey)]
    if isinstance(keyframe, str) and keyframe in names:
        number = names.index(keyframe)
    elif isinstance(keyframe, int) and not isinstance(keyframe, bool) and 0 <= keyframe < len(names):
        number = keyframe
    else:
        there = ", ".join(repr(name or k) for k, name in enumerate(names)) or "none"
        raise uqmbd.StudyError(f"{loaded.path}: the file has no keyframe {keyframe!r}; its keyframes are: {there}.")
    return np.array(model.key_qpos[number]), np.array(model.key_qvel[number])


def _links(loaded: ParsedFile, model: Any) -> tuple[Link, ...]:
    found = []
    for k in range(model.nbody):
        name = model.body(k).name
        turn = matrix(model.body_iquat[k])
        inertia = turn @ np.diag(model.body_inertia[k]) @ turn.T
        found.append(
            Link(
                name,
                int(model.body_parentid[k]),
                np.array(model.body_pos[k]),
                np.array(model.body_quat[k]),
                Inertial(float(model.body_mass[k]), np.array(model.body_ipos[k]), inertia),
                float(model.body_gravcomp[k]),
            )
        )
    return tuple(found)


def _joints(loaded: ParsedFile, model: Any, off: set[str], position: Array, speed: Array) -> tuple[TreeJoint, ...]:
    found = []
    for k in range(model.njnt):
        kind, size, freedoms = KINDS[int(model.jnt_type[k])]
        q, v = int(model.jnt_qposadr[k]), int(model.jnt_dofadr[k])
        place = slice(q, q + size)
        limits = None
        if model.jnt_limited[k]:
            limits = float(model.jnt_range[k][0]), float(model.jnt_range[k][1])
        damping, inertia = loaded.rotors.get(model.joint(k).name, (0.0, 0.0))
        found.append(
            TreeJoint(
                model.joint(k).name,
                kind,
                int(model.jnt_bodyid[k]),
                np.array(model.jnt_pos[k]),
                np.array(model.jnt_axis[k]),
                np.array(model.qpos0[place]),
                position[place],
                speed[v : v + freedoms],
                None if "LIMIT" in off else limits,
                0.0 if "SPRING" in off else float(model.jnt_stiffness[k]),
                np.array(model.qpos_spring[place]),
                0.0 if "DAMPER" in off else float(model.dof_damping[v]) + damping,
                0.0 if "FRICTIONLOSS" in off else float(model.dof_frictionloss[v]),
                float(model.dof_armature[v]) + inertia,
            )
        )
    return tuple(found)


def _equalities(
    loaded: ParsedFile, model: Any, off: set[str]
) -> tuple[tuple[LoopClosure, ...], tuple[Coupling, ...], list[uqmbd.extend.Omission]]:
    """Return loops and couplings from equality constraints, and list disabled constraints as omissions."""
    kinds = loaded.mujoco.mjtEq
    loops: list[LoopClosure] = []
    couplings: list[Coupling] = []
    left_out: list[str] = []
    for k in range(model.neq):
        words = {kinds.mjEQ_CONNECT: "connect", kinds.mjEQ_WELD: "weld", kinds.mjEQ_JOINT: "coupling"}
        kind = kinds(int(model.eq_type[k]))
        first, second = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        name = model.equality(k).name or f"{words[kind]}_{k + 1}"
        if not model.eq_active0[k] or "EQUALITY" in off:
            left_out.append(name)
        elif kind == kinds.mjEQ_JOINT:
            other = model.joint(second).name if second >= 0 else None
            couplings.append(Coupling(name, model.joint(first).name, other, tuple(map(float, model.eq_data[k][:5]))))
        else:
            loops.append(_loop(loaded, model, k, name, kind == kinds.mjEQ_WELD))
    rows = (
        [uqmbd.extend.Omission("equality constraints", tuple(left_out), "the file disables them")] if left_out else []
    )
    return tuple(loops), tuple(couplings), rows


def _loop(loaded: ParsedFile, model: Any, k: int, name: str, weld: bool) -> LoopClosure:
    """Return a loop between bodies, or between sites."""
    first, second, data = int(model.eq_obj1id[k]), int(model.eq_obj2id[k]), np.array(model.eq_data[k])
    turned = weld and data[10] > 0
    if int(model.eq_objtype[k]) == int(loaded.mujoco.mjtObj.mjOBJ_SITE):
        i, j = (int(model.site_bodyid[x]) for x in (first, second))
        points = np.array(model.site_pos[first]), np.array(model.site_pos[second])
        rotation = product(model.site_quat[first], inverse(model.site_quat[second]))
    else:
        i, j = first, second
        points = (data[3:6], data[:3]) if weld else (data[:3], data[3:6])
        rotation = data[6:10]
    return LoopClosure(name, i, j, *points, rotation if turned else None)


def _remarks(loaded: ParsedFile, model: Any, joints: Sequence[TreeJoint], off: set[str]) -> list[uqmbd.extend.Omission]:
    """Return remarks on features that the mechanism omits or changes."""
    rows = remarks(joints)

    def note(what: str, names: Sequence[str], why: str) -> None:
        if names:
            rows.append(uqmbd.extend.Omission(what, tuple(names), why))

    springs = [j.name for j in joints if j.stiffness and j.kind in ("ball", "free")]
    note(
        "springs of rotation in three dimensions",
        springs,
        "uqmbd has no rotational spring for these joints; of a free joint, the translational spring is imported",
    )
    for field, what in (("jnt_stiffnesspoly", "springs"), ("jnt_springyield", "yielding springs")):
        values = getattr(model, field, np.zeros(model.njnt))
        curved = [j.name for j, row in zip(joints, values, strict=True) if np.any(row)]
        note(f"nonlinear {what}", curved, "only their linear part is imported")
    damped = getattr(model, "dof_dampingpoly", np.zeros(model.nv))
    dofs = model.jnt_dofadr
    curved = [j.name for j, v in zip(joints, dofs, strict=True) if np.any(damped[v])]
    note("nonlinear damping", curved, "only its linear part is imported")
    mocap = [model.body(k).name for k in range(model.nbody) if model.body_mocapid[k] >= 0]
    note(
        "bodies with prescribed poses (mocap)",
        mocap,
        "they are fixed to the ground; add drivers to prescribe their motion",
    )
    medium = [name for name in ("density", "viscosity", "wind") if np.any(getattr(model.opt, name))]
    note("forces of the medium", medium, "uqmbd has no model of the surrounding fluid; add forces if they matter")
    compiler = loaded.spec.compiler
    why = "the file requests them; the mechanism has the changed masses and inertia"
    bounds = [x for x in ("boundmass", "boundinertia", "settotalmass") if getattr(compiler, x) > 0]
    bounds += ["balanceinertia"] if compiler.balanceinertia else []
    note("changes by MuJoCo's compiler", bounds, why)
    held = [model.equality(k).name or f"no. {k + 1}" for k in range(model.neq) if model.eq_active0[k]]
    note("softness of constraints", [] if "EQUALITY" in off else held, "loops and couplings are rigid in uqmbd")
    return rows
