"""Errors, warnings and findings; each states the place, the given and the expected values, and a remedy."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

__all__ = [
    "AssemblyError",
    "Finding",
    "IntegrationError",
    "MethodFailedWarning",
    "PluginWarning",
    "RedundantConstraintWarning",
    "Severity",
    "StudyError",
    "StudyWarning",
    "SurrogateWarning",
    "UnitsWarning",
    "UnusedInputWarning",
    "UqmbdError",
]


class UqmbdError(Exception):
    """Base class of all errors that uqmbd raises on purpose.

    Attributes
    ----------
    failed : mapping of str to str
        Reason of each failed method of a study, by its label, if all methods failed; otherwise empty.

    Examples
    --------
    An ``except`` clause with this class catches all errors that uqmbd raises on purpose, and no others:

    >>> import uqmbd
    >>> try:
    ...     uqmbd.Mechanism("", uqmbd.Planar())
    ... except uqmbd.UqmbdError as error:
    ...     print(type(error).__name__, dict(error.failed))
    StudyError {}
    """

    failed: Mapping[str, str] = MappingProxyType({})


class StudyError(UqmbdError, ValueError):
    """A part of a study script is invalid; the message states this part and the expected values.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("cart", uqmbd.Line())
    >>> cart = mechanism.body("cart", mass=-1)
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: body 'cart': the mass is -1 kg; expected 0 or more.
    """


class AssemblyError(UqmbdError):
    """The mechanism cannot be assembled; the message states the joint and its residual.

    Examples
    --------
    Two rods of 1 m each cannot connect two pins at a distance of 3 m:

    >>> import uqmbd
    >>> from uqmbd_joints import Distance
    >>> mechanism = uqmbd.Mechanism("rods", uqmbd.Translational())
    >>> bead = mechanism.body("bead", mass=1, position=(1.5, 0.1))
    >>> left = mechanism.add(Distance("left", mechanism.ground, bead, (0, 0), (0, 0), length=1))
    >>> right = mechanism.add(Distance("right", mechanism.ground, bead, (3, 0), (0, 0), length=1))
    >>> mechanism.output("x", bead.position[0], units="m")
    >>> try:
    ...     uqmbd.simulate(mechanism, [0, 1])
    ... except uqmbd.AssemblyError as error:
    ...     print(str(error)[:52])
    mechanism 'rods' cannot be assembled: joint 'left' (
    """


class IntegrationError(UqmbdError):
    """The integration of the equations of motion stopped; the message states the time and the probable reason.

    Examples
    --------
    A force proportional to the cube of the length moves a mass to infinity in finite time:

    >>> import uqmbd
    >>> from uqmbd.laws import length
    >>> from uqmbd_springs import NonlinearSpringDamper
    >>> mechanism = uqmbd.Mechanism("runaway", uqmbd.Line())
    >>> mass = mechanism.body("mass", mass=1, position=1, velocity=1)
    >>> push = mechanism.add(NonlinearSpringDamper("push", mechanism.ground, mass, 0, 0, law=-10 * length**3))
    >>> mechanism.output("x", mass.position[0], units="m")
    >>> try:
    ...     uqmbd.simulate(mechanism, [0, 5])
    ... except uqmbd.IntegrationError as error:
    ...     print(str(error)[:45])
    mechanism 'runaway': the integration stopped
    """


class RedundantConstraintWarning(UserWarning):
    """Some constraint equations depend on others; the warning names the dependent equations, and uqmbd drops them.

    Examples
    --------
    One of two equal wires between the ground and a bead is redundant:

    >>> import warnings
    >>> import uqmbd
    >>> from uqmbd_joints import Distance
    >>> mechanism = uqmbd.Mechanism("two wires", uqmbd.Translational())
    >>> bead = mechanism.body("bead", mass=1, position=(1, 0))
    >>> for name in ("wire", "other wire"):
    ...     wire = mechanism.add(Distance(name, mechanism.ground, bead, (0, 0), (0, 0), length=1))
    >>> mechanism.output("x", bead.position[0], units="m")
    >>> with warnings.catch_warnings(record=True) as seen:
    ...     warnings.simplefilter("always")
    ...     motion = uqmbd.simulate(mechanism, [0, 1])
    >>> [warning.category.__name__ for warning in seen]
    ['RedundantConstraintWarning']
    >>> uqmbd.check(mechanism).redundant
    ('other wire: length',)
    """


class StudyWarning(UserWarning):
    """A part of a study is probably a mistake, but may be intended; results store the text (attribute ``warnings``).

    Examples
    --------
    A script converts these warnings to errors, here a warning about units:

    >>> import warnings
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
    >>> stone = mechanism.body("stone", mass=1)
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", uqmbd.StudyWarning)
    ...     try:
    ...         mechanism.output("height", stone.position[0], units="kg")
    ...     except uqmbd.StudyWarning as warning:
    ...         print(type(warning).__name__)
    UnitsWarning
    """


class Severity(enum.Enum):
    """Severity of a `Finding`.

    Attributes
    ----------
    NOTE
        The finding is often intended. Lists show it, but a run gives no Python warning.
    WARNING
        The finding is rarely intended. Lists show it, and a run gives a Python warning.

    Examples
    --------
    >>> from uqmbd.extend import Severity
    >>> [one.value for one in Severity]
    ['note', 'warning']
    """

    NOTE = "note"
    WARNING = "warning"


@dataclass(frozen=True)
class Finding:
    """A probable mistake in a study that can still run; `uqmbd.findings` returns all findings of a study.

    Attributes
    ----------
    severity : Severity
        Severity of the finding.
    place : str
        Part of the study, such as ``body 'rod'``.
    message : str
        Sentence about the finding that names the part, without the final full stop.
    remedy : str
        Sentence with advice, without the final full stop; may be empty.
    category : type of Warning or None
        Class of the Python warning that a run gives. None: the check itself gives the warning. A note gives no warning.
    hidden_errors : tuple of (str, float)
        Estimated errors that the stated errors of methods do not contain: the name of an output or a requirement, and
        the error of its standard deviation, relative to it. NaN: the error is unknown. The assessment of results
        includes these errors.

    Raises
    ------
    StudyError
        If an attribute has another type.

    Examples
    --------
    >>> from uqmbd.extend import Finding, Severity
    >>> finding = Finding(Severity.WARNING, "belt 'b'", "belt 'b' is drawn without tension", "Move its pulleys apart")
    >>> print(finding)
    Warning: belt 'b' is drawn without tension. Move its pulleys apart.
    """

    severity: Severity
    place: str
    message: str
    remedy: str = ""
    category: type[Warning] | None = field(default=StudyWarning, compare=False, repr=False)
    hidden_errors: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.severity, Severity):
            raise StudyError(f"Finding: severity is {self.severity!r}; expected a member of uqmbd.extend.Severity.")
        for name in ("place", "message", "remedy"):
            if not isinstance(value := getattr(self, name), str):
                raise StudyError(f"Finding: {name} is {value!r}; expected a text.")
        if self.category is not None and not (isinstance(self.category, type) and issubclass(self.category, Warning)):
            raise StudyError(f"Finding: category is {self.category!r}; expected a class of warnings, or None.")
        pairs = self.hidden_errors
        if not (isinstance(pairs, tuple) and all(isinstance(x, tuple) and len(x) == 2 for x in pairs)) or not all(
            isinstance(name, str) and isinstance(error, float) and not error < 0 for name, error in pairs
        ):
            raise StudyError(
                f"Finding: hidden_errors is {pairs!r}; expected a tuple of pairs of a name and an error, which is a "
                "float of 0 or more, or NaN."
            )

    @property
    def text(self) -> str:
        """Message and remedy, without the final full stop.

        Examples
        --------
        >>> from uqmbd.extend import Finding, Severity
        >>> Finding(Severity.NOTE, "body 'rod'", "body 'rod' is not connected").text
        "body 'rod' is not connected"
        """
        return f"{self.message}. {self.remedy}" if self.remedy else self.message

    @property
    def warned(self) -> bool:
        """Whether a run gives a Python warning about the finding.

        Examples
        --------
        >>> from uqmbd.extend import Finding, Severity
        >>> [Finding(severity, "body 'rod'", "body 'rod' is bent").warned for severity in Severity]
        [False, True]
        """
        return self.severity is Severity.WARNING and self.category is not None

    def __str__(self) -> str:
        return f"{self.severity.value.capitalize()}: {self.text}."


class UnitsWarning(StudyWarning):
    """Units differ from the spelling of uqmbd, or do not fit their quantity (``docs/how-to/units.md``).

    Examples
    --------
    >>> import warnings
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
    >>> stone = mechanism.body("stone", mass=1)
    >>> with warnings.catch_warnings(record=True) as seen:
    ...     warnings.simplefilter("always")
    ...     mechanism.output("height", stone.position[0], units="kg")
    ...     wrong = uqmbd.check(mechanism).units
    >>> [warning.category.__name__ for warning in seen], wrong[0][:63]
    (['UnitsWarning'], "output 'height': stone.x is in m, but its declared units are kg")
    """


class UnusedInputWarning(UserWarning):
    """No output of a study depends on a random variable.

    Examples
    --------
    The mass of a freely falling stone does not affect its height:

    >>> import warnings
    >>> import chaospy
    >>> import uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
    >>> stone = mechanism.body("stone", mass=uqmbd.RandomVariable("mass", chaospy.Uniform(1, 2), units="kg"))
    >>> mechanism.output("height", stone.position[0], units="m")
    >>> with warnings.catch_warnings(record=True) as seen:
    ...     warnings.simplefilter("always")
    ...     result = uqmbd.Study("fall", mechanism, [0, 1], [Collocation(order=1)]).run()
    >>> [warning.category.__name__ for warning in seen]
    ['UnusedInputWarning']
    """


class SurrogateWarning(UserWarning):
    """A surrogate is unreliable: its stated error is large, or its mean is outside the range of its realisations.

    A stated error is large if it exceeds both 10 % of the standard deviation and three times the integration error.  A
    mean is outside the range if its distance from the range exceeds both 1 % of the standard deviation and three times
    the integration error.  The message states at most five outputs with their times and largest deviations, relative to
    the standard deviation, and a remedy.

    Examples
    --------
    A polynomial of order 1 cannot approximate an oscillation with a random frequency:

    >>> import warnings
    >>> import chaospy
    >>> import uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> from uqmbd_springs import SpringDamper
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    >>> stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(1, 9), units="N/m")
    >>> body = mechanism.body("body", mass=1, position=1, velocity=0)
    >>> spring = mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, stiffness))
    >>> mechanism.output("x", body.position[0], units="m")
    >>> with warnings.catch_warnings(record=True) as seen:
    ...     warnings.simplefilter("always")
    ...     result = uqmbd.Study("swinging", mechanism, [0, 3, 6], [Collocation(order=1)]).run()
    >>> [warning.category.__name__ for warning in seen]
    ['SurrogateWarning']
    """


class MethodFailedWarning(UserWarning):
    """A method of a study gave no results; the results of the other methods are available.

    Examples
    --------
    One of two methods cannot run with the given options:

    >>> import warnings
    >>> import chaospy
    >>> import uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> from uqmbd_montecarlo import MonteCarlo
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> mechanism.output("height", stone.position[0], units="m")
    >>> methods = [MonteCarlo(samples=10, seed=1), Collocation(order=1, alignment="phase", clock="height")]
    >>> with warnings.catch_warnings(record=True) as seen:
    ...     warnings.simplefilter("always")
    ...     result = uqmbd.Study("fall", mechanism, [0, 1], methods).run()
    >>> [warning.category.__name__ for warning in seen], list(result.children)
    (['MethodFailedWarning'], ['monte-carlo', 'comparison'])
    """


class PluginWarning(UserWarning):
    """A plugin could not be used; the program continues without it.

    Examples
    --------
    A program that must not continue without a plugin converts the warning to an error:

    >>> import warnings
    >>> import uqmbd
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", uqmbd.extend.PluginWarning)
    ...     print(uqmbd.extend.propagator("monte-carlo").__name__)
    MonteCarlo
    """
