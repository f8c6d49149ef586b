"""Names for plugins that add excitations, such as random processes, and outputs of the linearised mechanism."""

from __future__ import annotations

from uqmbd.mechanism import OutputSeries as OutputSeries
from uqmbd.mechanism import excitation as excitation
from uqmbd.mechanism import linear_output as linear_output
from uqmbd.randomness import combined_paths as combined_paths
from uqmbd.randomness import path_key as path_key
from uqmbd.units import same_units as same_units
