"""The readers of uqmbd: URDF and MJCF."""

from __future__ import annotations

import uqmbd
from uqmbd_models.building import build
from uqmbd_models.extraction import extract
from uqmbd_models.files import load
from uqmbd_models.inertia import INERTIA
from uqmbd_models.urdf import read_urdf

__all__ = ["MJCF", "URDF"]


class URDF:
    """Robots in the Unified Robot Description Format.

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
        self, path: str, floating: bool = False, fuse: bool = True, outputs: bool = True, inertia: str = "refuse"
    ) -> uqmbd.extend.ImportedMechanism:
        """Return the mechanism, see `uqmbd.from_urdf`.

        Parameters
        ----------
        path : str
            The file.
        floating : bool
            See `uqmbd.from_urdf`.
        fuse, outputs : bool
            See `uqmbd.from_urdf`.
        inertia : {"refuse", "as stated", "repair"}
            See `uqmbd.from_urdf`.

        Raises
        ------
        uqmbd.StudyError
            If the file cannot be read or used, with the line and the element.
        """
        if inertia not in INERTIA:
            known = ", ".join(map(repr, INERTIA))
            raise uqmbd.StudyError(f"from_urdf: inertia is {inertia!r}; expected one of {known}.")
        return build(read_urdf(path, floating), fuse_all=fuse, outputs=outputs, inertia=inertia)


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
    ) -> uqmbd.extend.ImportedMechanism:
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
        return build(extract(load(path), keyframe=keyframe), fuse_all=fuse, outputs=outputs)
