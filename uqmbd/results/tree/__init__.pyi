"""The names of `uqmbd.results.tree` and their modules, for type checkers and for lazy imports."""

from .compared import compare_both as compare_both
from .compared import happening as happening
from .compared import scalar_nodes as scalar_nodes
from .compared import study_tree as study_tree
from .joined import joined_outputs as joined_outputs
from .joined import with_requirements as with_requirements
from .joined import with_scalars as with_scalars
