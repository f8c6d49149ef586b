"""The names of `uqmbd.results.requirements` and their modules, for type checkers and for lazy imports."""

from .counting import Violations as Violations
from .dataset import requirement_names as requirement_names
from .dataset import requirements_dataset as requirements_dataset
from .intervals import clopper_pearson as clopper_pearson
from .methods import requirements_of as requirements_of
from .reading import Answer as Answer
from .reading import answers as answers
from .reading import compare_requirements as compare_requirements
from .reading import differing as differing
from .reading import meets as meets
from .reading import met_in_words as met_in_words
from .reading import unmet as unmet
from .tightening import TightenedProbability as TightenedProbability
from .tightening import tightened_probabilities as tightened_probabilities
