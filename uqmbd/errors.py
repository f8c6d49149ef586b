"""Failures and warnings that uqmbd raises: each says where, what was given, what was expected, and what to try."""

from __future__ import annotations

__all__ = [
    "AssemblyError",
    "IntegrationError",
    "PluginWarning",
    "RedundantConstraintWarning",
    "StudyError",
    "UnusedInputWarning",
    "UqmbdError",
]


class UqmbdError(Exception):
    """Base of every error that uqmbd raises on purpose."""


class StudyError(UqmbdError, ValueError):
    """Something in a study script cannot be used: the message says what, and what was expected."""


class AssemblyError(UqmbdError):
    """The mechanism cannot be assembled: the message names the joint and its residual."""


class IntegrationError(UqmbdError):
    """The integration of the equations of motion stopped: the message says when and probably why."""


class RedundantConstraintWarning(UserWarning):
    """Some constraint equations depend on others; they are named, and dropped."""


class UnusedInputWarning(UserWarning):
    """A random variable enters nothing."""


class PluginWarning(UserWarning):
    """A plugin could not be used; the program goes on without it."""
