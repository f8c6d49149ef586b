"""Result of a study: a node for each method, with outputs over time and scalar outputs, and comparisons of both.

Scalar outputs, which have no time, are in the child ``scalars`` of a propagator's node. The child has the form of the
node itself, without the dimension ``time``: ``scalars/statistics``, ``scalars/samples`` or ``scalars/chaos``, and
attributes with the origin of these numbers.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
