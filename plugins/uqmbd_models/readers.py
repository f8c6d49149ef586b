"""Readers of URDF and MJCF."""

from __future__ import annotations

import os
from typing import Literal

import uqmbd
from uqmbd_models.building import build
from uqmbd_models.extraction import extract
from uqmbd_models.files import load
from uqmbd_models.urdf import read_urdf

__all__ = ["MJCF", "URDF"]


@uqmbd.extend.typechecked
class URDF:
    """Reader of robots in the Unified Robot Description Format.

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
        self,
        path: str | os.PathLike[str],
        floating: bool = False,
        fuse: bool = True,
        outputs: bool = True,
        inertia: Literal["refuse", "as stated", "repair"] = "refuse",
    ) -> uqmbd.extend.ImportedMechanism:
        """Return the mechanism; see `uqmbd.from_urdf`.

        Parameters
        ----------
        path : str or path
            Path of the file.
        floating : bool
            See `uqmbd.from_urdf`.
        fuse, outputs : bool
            See `uqmbd.from_urdf`.
        inertia : {"refuse", "as stated", "repair"}
            See `uqmbd.from_urdf`.

        Returns
        -------
        uqmbd.extend.ImportedMechanism

        Raises
        ------
        uqmbd.StudyError
            If the file cannot be read or used; the message states the line and the element.
        """
        return build(read_urdf(os.fspath(path), floating), fuse_all=fuse, outputs=outputs, inertia=inertia)


@uqmbd.extend.typechecked
class MJCF:
    """Reader of models in the format of MuJoCo.

    Examples
    --------
    >>> import uqmbd_models
    >>> uqmbd_models.MJCF.name
    'mjcf'
    >>> uqmbd_models.MJCF().read("no_such_model.xml")
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: from_mjcf: no_such_model.xml: there is no such file; expected the path of an MJCF file.
    """

    name = "mjcf"

    def read(
        self, path: str | os.PathLike[str], keyframe: str | int | None = None, fuse: bool = True, outputs: bool = True
    ) -> uqmbd.extend.ImportedMechanism:
        """Return the mechanism; see `uqmbd.from_mjcf`.

        Parameters
        ----------
        path : str or path
            Path of the file.
        keyframe : str or int, optional
            See `uqmbd.from_mjcf`.
        fuse, outputs : bool
            See `uqmbd.from_mjcf`.
        """
        return build(extract(load(os.fspath(path)), keyframe=keyframe), fuse_all=fuse, outputs=outputs)
