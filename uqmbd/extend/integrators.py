"""Names for plugins that add an integrator: ensembles, trajectories, capabilities, counters."""

from __future__ import annotations

from uqmbd.dynamics import Capabilities as Capabilities
from uqmbd.dynamics import Counters as Counters
from uqmbd.dynamics import Ensemble as Ensemble
from uqmbd.dynamics import Integrator as Integrator
from uqmbd.dynamics import MechanismTerms as MechanismTerms
from uqmbd.dynamics import MotionCommand as MotionCommand
from uqmbd.dynamics import PhaseMotion as PhaseMotion
from uqmbd.dynamics import PortableMotion as PortableMotion
from uqmbd.dynamics import ProjectedEnsemble as ProjectedEnsemble
from uqmbd.dynamics import ProjectedTrajectories as ProjectedTrajectories
from uqmbd.dynamics import Segment as Segment
from uqmbd.dynamics import SegmentedMotion as SegmentedMotion
from uqmbd.dynamics import Trajectories as Trajectories
from uqmbd.dynamics import mechanism_terms as mechanism_terms
from uqmbd.dynamics import motion_refusal as motion_refusal
from uqmbd.dynamics import motion_source as motion_source
