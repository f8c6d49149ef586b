"""Failures, warnings and findings: each says where, what was given, what was expected, and what to try."""

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
    """Base of every error that uqmbd raises on purpose.

    Attributes
    ----------
    failed : mapping of str to str
        Where a run of a study ends because all its methods failed, the reason of each by its label; else empty.

    Examples
    --------
    It catches all that uqmbd raises on purpose, and nothing else:

    >>> import uqmbd
    >>> try:
    ...     uqmbd.Mechanism("", uqmbd.Planar())
    ... except uqmbd.UqmbdError as error:
    ...     print(type(error).__name__, dict(error.failed))
    StudyError {}
    """

    failed: Mapping[str, str] = MappingProxyType({})


class StudyError(UqmbdError, ValueError):
    """Something in a study script cannot be used: the message says what, and what was expected.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("cart", uqmbd.Line())
    >>> cart = mechanism.body("cart", mass=-1)
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: body 'cart': its mass is -1 kg; a mass cannot be negative.
    """


class AssemblyError(UqmbdError):
    """The mechanism cannot be assembled: the message names the joint and its residual.

    Examples
    --------
    Two rods of 1 m do not hold a point between pins that are 3 m apart:

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
    """The integration of the equations of motion stopped: the message says when and probably why.

    Examples
    --------
    A force that grows with the cube of the length drives a mass to infinity at a finite time:

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
    """Some constraint equations depend on others; they are named, and dropped.

    Examples
    --------
    Two wires hold a bead where one would:

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
    """Something that may be meant, and often is not; it is stored in the results as well (attribute ``warnings``).

    Examples
    --------
    What may be meant ends a script that makes errors of these warnings, as that of units:

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
    """How serious a `Finding` is.

    Attributes
    ----------
    NOTE
        It is often meant: lists show it, and a run gives no Python warning.
    WARNING
        It is seldom meant: a run gives a Python warning as well.

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
    """Something that is probably wrong with a study, which runs all the same; `uqmbd.findings` returns them.

    Attributes
    ----------
    severity : Severity
        How serious it is.
    place : str
        The part of the study, as ``body 'rod'``.
    message : str
        What was found there: a sentence that names the part, without the stop at its end.
    remedy : str
        What to try: a sentence without the stop at its end, or nothing.
    category : type of Warning or None
        Class of the Python warning that a run of the study gives; None: the check gives its own warning. A
        note has none.

    Raises
    ------
    StudyError
        If one of these is of another type.

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

    def __post_init__(self) -> None:
        if not isinstance(self.severity, Severity):
            raise StudyError(f"Finding: severity is {self.severity!r}; expected a member of uqmbd.extend.Severity.")
        for name in ("place", "message", "remedy"):
            if not isinstance(value := getattr(self, name), str):
                raise StudyError(f"Finding: {name} is {value!r}; expected a text.")
        if self.category is not None and not (isinstance(self.category, type) and issubclass(self.category, Warning)):
            raise StudyError(f"Finding: category is {self.category!r}; expected a class of warnings, or None.")

    @property
    def text(self) -> str:
        """Message and remedy, without the stop at their end.

        Examples
        --------
        >>> from uqmbd.extend import Finding, Severity
        >>> Finding(Severity.NOTE, "body 'rod'", "body 'rod' is not connected").text
        "body 'rod' is not connected"
        """
        return f"{self.message}. {self.remedy}" if self.remedy else self.message

    @property
    def warned(self) -> bool:
        """Whether a run gives a Python warning of it.

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
    """Units are spelt in another way than here, or do not fit what they are of (``docs/how-to/units.md``).

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
    (['UnitsWarning'], "output 'height': stone.x is in m, and its units are to be kg; l")
    """


class UnusedInputWarning(UserWarning):
    """No output of a study depends on a random variable.

    Examples
    --------
    The mass of what falls freely changes nothing:

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
    """A surrogate must not be relied on: it states a large error, or its mean is outside the range of its realisations.

    The message names the outputs, when and by how much, and what to try.  A stated error is reported where it exceeds
    10 % of the standard deviation, by more than the integration errs.

    Examples
    --------
    A polynomial of order 1 does not follow an oscillation whose frequency is random:

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
    """A method of a study gave no results; those of the others are there.

    Examples
    --------
    Two methods run, of which one cannot do what it is asked for:

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
    """A plugin could not be used; the program goes on without it.

    Examples
    --------
    A program that must not go on without a plugin makes an error of it:

    >>> import warnings
    >>> import uqmbd
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", uqmbd.extend.PluginWarning)
    ...     print(uqmbd.extend.propagator("monte-carlo").__name__)
    MonteCarlo
    """
