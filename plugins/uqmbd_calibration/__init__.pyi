"""The public names of this package: for type checkers, and for the lazy imports."""

from .records import Record as Record
from .records import Series as Series
