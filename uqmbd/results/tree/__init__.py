"""Result of a study: a node for each method, with outputs over time and scalar outputs, and comparisons of both.

Scalar outputs, which have no time, are in the child ``scalars`` of a propagator's node. The child has the form of the
node itself, without the dimension ``time``: ``scalars/statistics``, ``scalars/samples`` or ``scalars/chaos``, and
attributes with the origin of these numbers.
"""

from __future__ import annotations

from uqmbd.results.tree.compared import compare_both, happening, scalar_nodes, study_tree
from uqmbd.results.tree.joined import joined_outputs, with_requirements, with_scalars

__all__ = [
    "compare_both",
    "happening",
    "joined_outputs",
    "scalar_nodes",
    "study_tree",
    "with_requirements",
    "with_scalars",
]
