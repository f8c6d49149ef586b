"""What a section adds to the first screen of the report: a table, charts and statements, as plain data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from uqmbd.errors import StudyError
from uqmbd.report.charts import Chart, checked_chart

__all__ = ["ChartGroup", "FirstScreen", "ReliabilityStatement"]


@dataclass(frozen=True)
class ReliabilityStatement:
    """A statement on the reliability of a result, with a sign.

    Attributes
    ----------
    level : {0, 1, 2, 3}
        0: unreliable, 1: uncertain, 2: verified, 3: information without a judgement.
    name : str
        What it is about, plain text.
    text : str
        One sentence, plain text.

    Examples
    --------
    >>> from uqmbd.report import ReliabilityStatement
    >>> ReliabilityStatement(2, "chains", "they converged; R-hat is at most 1.001").level
    2
    """

    level: Literal[0, 1, 2, 3]
    name: str
    text: str


@dataclass(frozen=True)
class ChartGroup:
    """Charts of one figure: buttons select the visible one, and paper shows all.

    Attributes
    ----------
    charts : sequence of Chart
        One or more, with different titles.
    alt, caption : str
        Description of the figure, and the text below it: plain text.
    choose : str
        What the buttons choose.

    Examples
    --------
    >>> from uqmbd.report import Chart, ChartGroup, Curve
    >>> bars = Chart("error", ["coarse", "fine"], [Curve("mine", [2.0, 0.1], drawn="bars")], "by mesh", "%", "mesh")
    >>> ChartGroup([bars], "Errors by mesh.", "The finer the better.").choose
    'Chart'
    """

    charts: Sequence[Chart]
    alt: str
    caption: str
    choose: str = "Chart"


@dataclass(frozen=True)
class FirstScreen:
    """The part of a section on the first screen: a table, charts and statements.

    The page escapes all texts. The table and the statements are above the results of the study, and the charts are next
    to the picture of the mechanism.

    Attributes
    ----------
    title : str
        Heading of the first column of the table.
    heads : sequence of str
        Headings of its other columns.
    rows : sequence of sequence of str
        Cells: a name, and a text for each other column. The first six rows are shown, and the number of the others.
    charts : sequence of ChartGroup
        Figures, three at most.
    statements : sequence of ReliabilityStatement
        They are shown by level, the least reliable first.

    Raises
    ------
    uqmbd.StudyError
        If a part has another type, a row has another number of cells than the head, or a chart is not valid.

    Examples
    --------
    >>> from uqmbd.report import FirstScreen, ReliabilityStatement
    >>> said = ReliabilityStatement(2, "masses", "they were weighed.")
    >>> screen = FirstScreen("Part", ("Mass",), [("rod", "1.2 kg")], statements=[said])
    >>> screen.rows[0]
    ('rod', '1.2 kg')
    """

    title: str
    heads: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    charts: Sequence[ChartGroup] = ()
    statements: Sequence[ReliabilityStatement] = ()

    def __post_init__(self) -> None:
        """Check that the parts fit together."""
        where = "FirstScreen"
        _texts(f"{where}: title and heads are", [self.title, *self.heads])
        for row in self.rows:
            _texts(f"{where}: a row is", row)
            if isinstance(row, str) or len(row) != 1 + len(self.heads):
                raise StudyError(f"{where}: a row is {row!r:.80}; expected {1 + len(self.heads)} texts, one a column.")
        if len(self.charts) > MOST_FIGURES or not all(isinstance(one, ChartGroup) for one in self.charts):
            raise StudyError(f"{where}: charts is {self.charts!r:.80}; expected at most {MOST_FIGURES} ChartGroup.")
        for group in self.charts:
            _texts(f"{where}: the texts of a figure are", [group.alt, group.caption, group.choose])
            titles = [checked_chart(chart).title for chart in group.charts]
            if not titles or len(set(titles)) < len(titles):
                raise StudyError(f"{where}: the charts have the titles {titles}; expected one or more, all different.")
        for said in self.statements:
            if not isinstance(said, ReliabilityStatement) or said.level not in (0, 1, 2, 3):
                raise StudyError(
                    f"{where}: a statement is {said!r:.80}; expected a ReliabilityStatement of level 0, 1, 2 or 3."
                )
            _texts(f"{where}: the texts of a statement are", [said.name, said.text])


MOST_FIGURES = 3
"""Figures of one section on the first screen."""


def _texts(what: str, given: Sequence[object]) -> None:
    if not all(isinstance(one, str) for one in given):
        raise StudyError(f"{what} {given!r:.80}; expected texts.")
