"""The names of `uqmbd.propagation.budget` and their modules, for type checkers and for lazy imports."""

from .amounts import Amount as Amount
from .amounts import accuracy_of as accuracy_of
from .amounts import allowed_of as allowed_of
from .amounts import budget_of as budget_of
from .reach import BudgetTooSmallError as BudgetTooSmallError
from .sharing import BudgetedRun as BudgetedRun
from .sharing import BudgetTerms as BudgetTerms
from .timing import Timing as Timing
from .timing import timing_of as timing_of
