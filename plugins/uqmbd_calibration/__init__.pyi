"""The public names of this package: for type checkers, and for the lazy imports."""

from .calibrated import Calibrated as Calibrated
from .calibrating import calibrate as calibrate
from .inference import Bias as Bias
from .records import Record as Record
from .records import Series as Series
from .result import Calibration as Calibration
