"""The readers of uqmbd: URDF and MJCF."""

from __future__ import annotations

import uqmbd
from uqmbd_models.building import build
from uqmbd_models.extraction import extract
from uqmbd_models.files import load
from uqmbd_models.grammar import limits, several_roots, unknown_words
from uqmbd_models.urdf import floating_base, links_without_mass, mimics, read_inertials, unread

__all__ = ["MJCF", "URDF"]


class URDF:
    """Robots as the Unified Robot Description Format tells them.

    Examples
    --------
    >>> import uqmbd_models
    >>> uqmbd_models.URDF.name
    'urdf'
    >>> uqmbd_models.URDF().read("no_such_robot.urdf")
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: from_urdf: no_such_robot.urdf: there is no such file; expected the path of a URDF file.
    """

    name = "urdf"

    def read(
        self, path: str, floating: bool = False, fuse: bool = True, outputs: bool = True
    ) -> uqmbd.ImportedMechanism:
        """Return the mechanism, see `uqmbd.from_urdf`.

        Parameters
        ----------
        path : str
            The file.
        floating : bool
            See `uqmbd.from_urdf`.
        fuse, outputs : bool
            See `uqmbd.from_urdf`.
        """
        loaded = load(path, "urdf")
        read_inertials(loaded)
        if floating:
            floating_base(loaded)
        couplings, wrong = mimics(loaded)
        found, void = limits(loaded.root)
        loaded.limits.update(found)
        told = [*unknown_words(loaded.root), *void, *several_roots(loaded.root, floating)]
        rows = [*links_without_mass(loaded), *unread(loaded), *wrong, *told]
        tree = extract(loaded, couplings=couplings, omissions=rows)
        return build(tree, fuse_all=fuse, outputs=outputs)


class MJCF:
    """Models in the format of MuJoCo.

    Examples
    --------
    >>> import uqmbd_models
    >>> uqmbd_models.MJCF.name
    'mjcf'
    >>> uqmbd_models.MJCF().read("no_such_model.xml")
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: from_mjcf: no_such_model.xml: there is no such file; expected the path of a MJCF file.
    """

    name = "mjcf"

    def read(
        self, path: str, keyframe: str | int | None = None, fuse: bool = True, outputs: bool = True
    ) -> uqmbd.ImportedMechanism:
        """Return the mechanism, see `uqmbd.from_mjcf`.

        Parameters
        ----------
        path : str
            The file.
        keyframe : str or int, optional
            See `uqmbd.from_mjcf`.
        fuse, outputs : bool
            See `uqmbd.from_mjcf`.
        """
        return build(extract(load(path, "mjcf"), keyframe=keyframe), fuse_all=fuse, outputs=outputs)
