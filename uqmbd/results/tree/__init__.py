"""The result of a study: the nodes of its methods, their outputs without a time, and the comparison of both.

Outputs without a time are the child ``scalars`` of a propagator's node.  It has the form of the node itself, without
the dimension ``time``: ``scalars/statistics``, ``scalars/samples`` or ``scalars/chaos``, and attributes that say how
these numbers came about.
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
