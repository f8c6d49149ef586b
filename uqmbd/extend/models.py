"""Return values of readers of model files."""

from __future__ import annotations

from uqmbd.mechanism import ImportedJoint as ImportedJoint
from uqmbd.mechanism import ImportedMechanism as ImportedMechanism
from uqmbd.mechanism import MassProperties as MassProperties
from uqmbd.mechanism import Omission as Omission
from uqmbd.mechanism import Omissions as Omissions
