"""Results of methods for requirements, for tables and for conditions on probabilities."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqmbd.arguments import Share, ShareOrNaN, typechecked
from uqmbd.names import ANY
from uqmbd.results.schema import comparable, fixed_width
from uqmbd.wording import format_interval, format_probability

__all__ = ["Answer", "answers", "compare_requirements", "differing", "meets", "unmet"]

VARIABLES = ("violation_probability", "violation_lower", "violation_upper", "violation_verdict")


@typechecked
@dataclass(frozen=True)
class Answer:
    """Result of a method for a requirement.

    Attributes
    ----------
    method, requirement, description, relation : str
        Label of the method; name, description and relation of the requirement.
    probability, lower, upper : float
        Probability of violation, and its 95 % interval.
    how : str
        Origin of these numbers, such as ``of 500 samples``.

    Examples
    --------
    >>> from uqmbd.results import Answer
    >>> some = Answer("monte-carlo", "clear", "it stays clear", "gap > 0", 0.02, 0.01, 0.04, "of 500 samples")
    >>> more = Answer("collocation", "clear", "it stays clear", "gap > 0", 0.10, 0.09, 0.11, "of its surrogate")
    >>> some.apart(more), some.meaning
    (True, 'it stays clear')
    >>> some.words
    '2.0 % (1.0 % to 4.0 %)'
    """

    method: str
    requirement: str
    description: str
    relation: str
    probability: ShareOrNaN
    lower: Share
    upper: Share
    how: str

    @property
    def words(self) -> str:
        """Text of the probability with its interval."""
        return format_interval(self.probability, self.lower, self.upper)

    @property
    def known(self) -> bool:
        """Whether the method states a probability; otherwise its interval is from 0 to 1."""
        return math.isfinite(self.probability)

    @property
    def meaning(self) -> str:
        """Text of the requirement."""
        return self.description or self.relation

    @property
    def relative_width(self) -> float:
        """Longer side of the interval, relative to the probability; infinite if the probability is 0 or unknown."""
        side = max(self.upper - self.probability, self.probability - self.lower)
        return side / self.probability if self.probability > 0 else math.inf

    def apart(self, other: Answer) -> bool:
        """Return whether the intervals of two methods are disjoint."""
        return self.lower > other.upper or other.lower > self.upper


def _data(nodes: Mapping[str, xr.DataTree]) -> dict[str, xr.Dataset]:
    """Return the datasets ``requirements`` by the label of the method; omit methods without one."""
    found = {label: node.children["requirements"] for label, node in nodes.items() if "requirements" in node.children}
    return {label: node.to_dataset() for label, node in found.items()}


@typechecked
def answers(nodes: Mapping[str, xr.DataTree]) -> dict[str, dict[str, Answer]]:
    """Return results by requirement and by label of the method, in the order of the study, with ``any`` last.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
        Propagator nodes by label.

    Examples
    --------
    >>> from uqmbd.extend import requirements_dataset
    >>> data = requirements_dataset(["overload"], violation_probability=[0.02], lower=[0.01], upper=[0.04])
    >>> found = answers({"mine": xr.DataTree.from_dict({"requirements": data})})
    >>> found["overload"]["mine"].words
    '2.0 % (1.0 % to 4.0 %)'
    """
    found: dict[str, dict[str, Answer]] = {}
    for label, data in _data(nodes).items():
        for k, name in enumerate(map(str, data["requirement"].values)):
            relation = str(data["relation"].values[k]) if "relation" in data.coords else ""
            lower, upper = data["interval"].values[k].tolist()
            about = (float(data["violation_probability"].values[k]), lower, upper, str(data.attrs.get("how", "")))
            answer = Answer(label, name, str(data["description"].values[k]), relation, *about)
            found.setdefault(name, {})[label] = answer
    return {name: found[name] for name in sorted(found, key=lambda name: name == ANY)}


def meets(found: Collection[Answer], allowed: float) -> bool | None:
    """Return whether a requirement is met with 95 % confidence; None if this is uncertain.

    The requirement is met if the upper ends of all methods are allowed. The requirement is not met if the lower end of
    one method is not allowed, and no method has an allowed upper end. Methods without a probability are ignored. An
    `allowed` probability of 1 is always met.
    """
    found = [one for one in found if one.known]
    if allowed >= 1:
        return True  # no probability exceeds 1
    if not found:
        return None
    if all(one.upper <= allowed for one in found):
        return True
    violated = any(one.lower > allowed for one in found) and not any(one.upper <= allowed for one in found)
    return False if violated else None


def met_by(found: Collection[Answer], allowed: float) -> list[Answer]:
    """Return the results of the methods by which a requirement is met, because their upper ends are allowed."""
    return [one for one in found if one.known and one.upper <= allowed]


def met_in_words(found: Collection[Answer], allowed: float) -> str:
    """Name the methods by which a requirement is met, not met or uncertain; empty if all methods are uncertain.

    >>> one = Answer("few", "clear", "", "", 0.02, 0.005, 0.05, "")
    >>> met_in_words([one, Answer("many", "clear", "", "", 0.02, 0.019, 0.021, "")], 0.03)
    'met by many, not certain by few'
    """
    verdicts = ("met", "not met", "not certain")
    words: dict[str, list[str]] = {verdict: [] for verdict in verdicts}
    for one in (one for one in found if one.known):
        words[verdicts[0 if one.upper <= allowed else 1 if one.lower > allowed else 2]].append(one.method)
    if not (words["met"] or words["not met"]):
        return ""
    return ", ".join(f"{verdict} by {' and '.join(labels)}" for verdict, labels in words.items() if labels)


@typechecked
def unmet(nodes: Mapping[str, xr.DataTree], probability: Share) -> list[str]:
    """Return the requirements that are not met, or not known to be met, with 95 % confidence.

    A requirement is met if every method with a known probability states an upper end of at most the allowed one. The
    requirement is not met if one method states a larger lower end, and no method states an allowed upper end.
    Otherwise, it is not known to be met; the sentence names the methods with an allowed upper end.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
        Propagator nodes by label.
    probability : float
        Allowed probability of violation.

    Returns
    -------
    list of str
        One sentence for each requirement, except ``any``.

    Examples
    --------
    Two methods of 1000 realisations each, of which 20 and 80 violate a requirement:

    >>> import numpy as np
    >>> import xarray as xr
    >>> from uqmbd.results import unmet
    >>> from uqmbd.extend import Violations
    >>> def node(violated):
    ...     margins = np.where(np.arange(1000) < violated, -1.0, 1.0)[:, None, None]
    ...     counted = Violations.of(margins, np.zeros(1000, dtype=bool))
    ...     return xr.DataTree.from_dict(dict(requirements=Violations.dataset(["clear"], [counted], [0.0])))
    >>> nodes = dict(few=node(20), many=node(80))
    >>> unmet(nodes, probability=0.2)
    []
    >>> print(unmet(nodes, probability=0.01)[0].partition(':')[0])
    requirement 'clear' is not met
    >>> print(unmet(nodes, probability=0.05)[0].partition(':')[0])
    requirement 'clear' is not known to be met
    """
    sentences = []
    for name, found in answers(nodes).items():
        met = meets(found.values(), probability)
        if not met and name != ANY:
            known = [one for one in found.values() if one.known]
            if not known:
                sentences.append(
                    f"requirement {name!r} is not known to be met, because no method states the probability of its "
                    f"violation; the allowed probability is {format_probability(probability)}"
                )
                continue
            wrong = [one for one in known if not one.upper <= probability]
            one = max(wrong, key=lambda one: one.upper)
            verdict, end = "is not known to be met", f"up to {format_probability(one.upper)}"
            if met is False:
                one = max(wrong, key=lambda one: one.lower)
                verdict, end = "is not met", f"at least {format_probability(one.lower)}"
            fine = " and ".join(f"{x.method}, {x.words}" for x in met_by(known, probability))
            sentences.append(
                f"requirement {name!r} {verdict}: it is violated with a probability of {end} by {one.method}, "
                f"{one.words}; the allowed probability is {format_probability(probability)}"
                + (f". The requirement is met according to {fine}" if fine else "")
            )
    return sentences


@typechecked
def compare_requirements(nodes: Mapping[str, xr.DataTree], reference: str) -> xr.Dataset | None:
    """Compare probabilities of violation; return None if no method states one.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
        Propagator nodes by label.
    reference : str
        Label of the reference. If it states no probability, the first method with a probability replaces it.

    Returns
    -------
    xarray.Dataset
        ``violation_probability``, ``violation_lower`` and ``violation_upper (method, requirement)``, NaN for methods
        without a probability. ``violation_verdict`` is ``reference``, ``agrees``, ``differs`` (disjoint intervals),
        ``not known`` (the method states no probability), or empty.

    Examples
    --------
    Two methods of 1000 realisations each, of which 20 and 80 violate a requirement:

    >>> import numpy as np
    >>> import xarray as xr
    >>> from uqmbd.results import compare_requirements
    >>> from uqmbd.extend import Violations
    >>> def node(violated):
    ...     margins = np.where(np.arange(1000) < violated, -1.0, 1.0)[:, None, None]
    ...     counted = Violations.of(margins, np.zeros(1000, dtype=bool))
    ...     return xr.DataTree.from_dict(dict(requirements=Violations.dataset(["clear"], [counted], [0.0])))
    >>> nodes = dict(few=node(20), many=node(80))
    >>> found = compare_requirements(nodes, reference="few").sel(requirement="clear")
    >>> found["violation_probability"].values.tolist(), found["violation_verdict"].values.tolist()
    ([0.02, 0.08], ['reference', 'differs'])
    """
    found = answers(nodes)
    if not found:
        return None
    methods, names = list(nodes), list(found)
    values = np.full((3, len(methods), len(names)), np.nan)
    verdicts = [["" for _ in names] for _ in methods]
    for column, by_method in enumerate(found.values()):
        # a method without a probability is not a reference, and does not agree with others
        known = {label: one for label, one in by_method.items() if one.known}
        base = known.get(reference) or next(iter(known.values()), None)
        for label, one in by_method.items():
            row = methods.index(label)
            values[:, row, column] = one.probability, one.lower, one.upper
            if base is None or not one.known:
                verdicts[row][column] = "not known"
            else:
                verdicts[row][column] = "reference" if one is base else "differs" if one.apart(base) else "agrees"
    dims = ("method", "requirement")
    about = {"comment": "probability that a requirement is violated, with its 95 % interval"}
    data = {name: (dims, part, about) for name, part in zip(VARIABLES[:3], values, strict=True)}
    coords = {"method": ("method", fixed_width(methods)), "requirement": ("requirement", fixed_width(names))}
    return xr.Dataset(data | {VARIABLES[3]: (dims, np.array(verdicts, dtype=np.str_))}, coords=coords)


@typechecked
def differing(nodes: Mapping[str, xr.DataTree]) -> Sequence[str]:
    """Return a sentence for each pair of methods whose intervals of a requirement do not overlap.

    `nodes`: propagator nodes by label.

    Two methods of 1000 realisations each, of which 20 and 80 violate a requirement:

    >>> import numpy as np
    >>> import xarray as xr
    >>> from uqmbd.results.requirements import differing, Violations
    >>> def node(violated):
    ...     margins = np.where(np.arange(1000) < violated, -1.0, 1.0)[:, None, None]
    ...     counted = Violations.of(margins, np.zeros(1000, dtype=bool))
    ...     return xr.DataTree.from_dict(dict(requirements=Violations.dataset(["clear"], [counted], [0.0])))
    >>> nodes = dict(few=node(20), many=node(80))
    >>> differing(nodes)
    ["few and many contradict each other on 'clear': 2.0 % (1.2 % to 3.1 %) and 8.0 % (6.4 % to 9.9 %)"]
    """
    sentences = []
    for name, found in answers(comparable(nodes)).items():
        labels = list(found)
        for k, one in enumerate(labels):
            sentences += [
                f"{one} and {other} contradict each other on {name!r}: {found[one].words} and {found[other].words}"
                for other in labels[k + 1 :]
                if found[one].apart(found[other])
            ]
    return sentences
