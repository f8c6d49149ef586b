"""Check a study before its methods run: registry of checks of the core and of plugins, and their findings.

Checks of the assembled mechanism are in `uqmbd.dynamics.model_checks`; their findings are stored with the model.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

from uqmbd import plugins
from uqmbd.arguments import shown, typechecked
from uqmbd.errors import Finding, PluginWarning, Severity, StudyError, UnusedInputWarning
from uqmbd.isolation import ERRORS_AND_EXITS, Isolated
from uqmbd.mechanism import Mechanism
from uqmbd.propagation.inputs import POINTS, affordable, existence_of, unused_inputs
from uqmbd.propagation.methods import Studied
from uqmbd.propagation.observed_model import warned_elsewhere
from uqmbd.propagation.studies.outcome import planned

__all__ = ["Ranges", "findings", "warned_findings", "warning_of"]


@typechecked
def findings(study: Studied) -> list[Finding]:
    """Find probable mistakes in a study; `uqmbd check`, runs, notebooks and reports list the same findings.

    Parameters
    ----------
    study : Study
        Study to check, before or after a run. A few realisations are computed to find random inputs without effect.

    Returns
    -------
    list of Finding
        Findings; findings of the mechanism are first.

    Raises
    ------
    uqmbd.StudyError
        If `study` is not a study.
    uqmbd.UqmbdError
        If the mechanism cannot be used, for example if it cannot be assembled.

    Warns
    -----
    uqmbd.extend.PluginWarning
        If the check of a plugin fails; the other checks still run.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_joints import Revolute
    >>> mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    >>> rod = mechanism.body("rod", mass=1, inertia=1 / 12, angle=-90)
    >>> pivot = mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (0, 0)))
    >>> mechanism.output("angle", rod.angle, units="rad")
    >>> (finding,) = uqmbd.findings(uqmbd.Study("swing", mechanism, [0, 1]))
    >>> finding.place, finding.message, finding.remedy
    ("body 'rod'", "body 'rod' has the angle -90 rad, 14.3 turns", 'Write degrees as math.radians(-90)')
    """
    if not hasattr(study, "mechanism") or not hasattr(study, "times"):
        raise StudyError(f"findings: study is {shown(study)}; expected a uqmbd.Study.")
    mechanism: Any = study.mechanism
    if not isinstance(mechanism, Mechanism):
        return []  # a study of another class
    warned_elsewhere(mechanism, float(study.times[0]))
    found = [finding for kind in _built_in().values() for finding in kind().find(study)]
    for name, kind in plugins.checks().items():
        mine: list[Any] = []
        with Isolated(*ERRORS_AND_EXITS) as work:
            mine = list(kind().find(study))
        reason = work.reason if work.failed else ""
        if not reason and not all(isinstance(one, Finding) for one in mine):
            reason = f"the check returned {mine!r}; expected a sequence of uqmbd.extend.Finding"
        if reason:
            owner = plugins.owner("checks", name)
            warnings.warn(f"check {name!r} of {owner} failed: {reason}", PluginWarning, stacklevel=2)
        else:
            found += mine
    return list(dict.fromkeys(found))


def warning_of(study: Studied, finding: Finding) -> str:
    """Return the text of the Python warning of a finding; it names the study, unless the finding is of the model."""
    return f"{'' if finding in study.model.findings else f'study {study.name!r}: '}{finding.text}."


def warned_findings(study: Studied, stacklevel: int) -> list[Finding]:
    """Return the findings on a study, and issue a Python warning for each finding that is a warning."""
    found = findings(study)
    for finding in found:
        if finding.warned:
            warnings.warn(warning_of(study, finding), finding.category, stacklevel=stacklevel + 1)
    return found


class OfMechanism:
    """Findings of the assembled mechanism."""

    def find(self, study: Studied) -> Sequence[Finding]:
        """Return the findings of the model."""
        return study.model.findings


class Ranges:
    """Check for random parameters that leave their range, or change their sign."""

    def find(self, study: Studied) -> Sequence[Finding]:
        """Return findings on parameters that probably leave their range or change sign in the planned realisations."""
        from uqmbd.dynamics import find_risks, range_findings

        found = study.mechanism.remembered("risks", lambda: find_risks(study.mechanism))
        return range_findings(found, planned(study, study.propagators)) if found else ()


class UnusedInputs:
    """Check for random inputs without effect on outputs, if the study is large enough to justify the search."""

    def find(self, study: Studied) -> Iterable[Finding]:
        """Return the inputs without effect; the search changes each input separately."""
        mechanism, inputs = study.mechanism, study.mechanism.inputs
        used = mechanism.used_inputs()
        for name in inputs.names:
            if name not in used:
                message = f"the random input {name!r} has no effect; only other inputs of its random vector are used"
                yield Finding(Severity.NOTE, f"random input {name!r}", message)
        if not affordable(len(inputs), planned(study, study.propagators)):
            return
        settings = (study.times.tobytes(), study.rtol, study.integrator, study.start, study.max_step, study.breaks)
        about = (study.model, inputs, study.times, study.rtol, study.integrator)
        for name in mechanism.remembered(("idle", *settings), lambda: unused_inputs(*about)):
            if name in used:
                yield Finding(
                    Severity.WARNING,
                    f"random input {name!r}",
                    f"no output depends on the random input {name!r}; separate changes of this input at {POINTS + 1} "
                    "points changed no output",
                    "Remove it, or add an output that depends on it",
                    UnusedInputWarning,
                )


class MissingMoments:
    """Check for non-existent moments of outputs; each method issues Python warnings for its own results."""

    def find(self, study: Studied) -> Iterable[Finding]:
        """Return the outputs that grow with a heavy-tailed input."""
        found = study.mechanism.remembered("existence", lambda: existence_of(study.mechanism))
        for message in found.sentences(list(found.orders)):
            yield Finding(Severity.WARNING, "random inputs", message, category=None)


class CoreChecks:
    """Checks of the core."""

    @plugins.hookimpl
    def uqmbd_checks(self) -> Sequence[type]:
        """Return the checks of the core, in the order in which their findings are listed."""
        return [OfMechanism, Ranges, UnusedInputs, MissingMoments]


@cache
def _built_in() -> dict[str, type[Any]]:
    return plugins.core_offers(CoreChecks(), "checks")
