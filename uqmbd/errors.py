"""Failures and warnings that uqmbd raises: each says where, what was given, what was expected, and what to try."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

__all__ = [
    "AssemblyError",
    "IntegrationError",
    "MethodFailedWarning",
    "PluginWarning",
    "RedundantConstraintWarning",
    "StudyError",
    "StudyWarning",
    "UnitsWarning",
    "UnusedInputWarning",
    "UqmbdError",
]


class UqmbdError(Exception):
    """Base of every error that uqmbd raises on purpose.

    Attributes
    ----------
    failed : mapping of str to str
        Where a run of a study ends because all its methods failed, the reason of each by its label; else empty.
    """

    failed: Mapping[str, str] = MappingProxyType({})


class StudyError(UqmbdError, ValueError):
    """Something in a study script cannot be used: the message says what, and what was expected."""


class AssemblyError(UqmbdError):
    """The mechanism cannot be assembled: the message names the joint and its residual."""


class IntegrationError(UqmbdError):
    """The integration of the equations of motion stopped: the message says when and probably why."""


class RedundantConstraintWarning(UserWarning):
    """Some constraint equations depend on others; they are named, and dropped."""


class StudyWarning(UserWarning):
    """Something that may be meant, and often is not; it is stored in the results as well (attribute ``warnings``)."""


class UnitsWarning(StudyWarning):
    """Units are spelt in another way than here, or do not fit what they are of (``docs/how-to/units.md``)."""


class UnusedInputWarning(UserWarning):
    """A random variable enters nothing."""


class MethodFailedWarning(UserWarning):
    """A method of a study gave no results; those of the others are there."""


class PluginWarning(UserWarning):
    """A plugin could not be used; the program goes on without it."""
