"""The germs of all inputs, and the maps of their groups: dependent inputs together, each other one alone."""

from __future__ import annotations

from uqmbd.randomness.distributions import is_dependent
from uqmbd.randomness.germs import Germ
from uqmbd.randomness.joint import JointInput
from uqmbd.randomness.space.dependence import dependent_part
from uqmbd.randomness.space.families import independent_part
from uqmbd.randomness.space.transforms import Coupled, Group

__all__ = ["space_parts"]


def space_parts(inputs: JointInput, transform: str) -> tuple[tuple[Germ, ...], tuple[Group, ...]]:
    """Return the germs of all inputs, in order, and the maps of their groups."""
    germs: dict[int, Germ] = {}
    groups: list[Group] = []
    given = {id(v.joint): v.joint for v in inputs.variables}.values()
    for joint in (part for one in given for part in one.separated):
        columns = tuple(inputs.names.index(name) for name in joint.names)
        if len(columns) > 1 and is_dependent(joint.distribution):
            found, group = dependent_part(joint, columns, transform)
            groups.append(group)
            germs.update(zip(columns, found, strict=True))
            continue
        for place, (column, name) in enumerate(zip(columns, joint.names, strict=True)):
            alone = joint.distribution if len(columns) == 1 else joint.distribution[place]
            germs[column], marginal = independent_part(name, alone)
            groups.append(Coupled.single(column, marginal))
    return tuple(germs[k] for k in range(len(inputs))), tuple(groups)
