"""Part of a section on the first screen of the report: a table, charts and statements, as plain data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.report.charts import Chart, checked_chart

__all__ = ["ChartGroup", "FirstScreen", "ReliabilityStatement"]


@typechecked
@dataclass(frozen=True)
class ReliabilityStatement:
    """A statement on the reliability of a result, with a sign.

    Attributes
    ----------
    level : {0, 1, 2, 3}
        0: unreliable, 1: uncertain, 2: verified, 3: information without a judgement.
    name : str
        Subject of the statement, plain text.
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


@typechecked
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
        Label of the choice that the buttons offer.

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


@typechecked
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
        Cells: a name, and a text for each other column. The page shows the first six rows, and the number of other
        rows.
    charts : sequence of ChartGroup
        Figures, at most three.
    statements : sequence of ReliabilityStatement
        Statements; the page sorts them by level, the least reliable first.

    Raises
    ------
    uqmbd.StudyError
        If a part has another type, if a row and the head differ in their number of cells, or if a chart is invalid.

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
        """Check the consistency of the parts."""
        where = "FirstScreen"
        for row in self.rows:
            if len(row) != 1 + len(self.heads):
                raise StudyError(f"{where}: a row is {row!r:.80}; expected {1 + len(self.heads)} texts, one a column.")
        if len(self.charts) > MOST_FIGURES:
            raise StudyError(f"{where}: charts has {len(self.charts)} entries; expected at most {MOST_FIGURES}.")
        for group in self.charts:
            titles = [checked_chart(chart).title for chart in group.charts]
            if not titles or len(set(titles)) < len(titles):
                raise StudyError(f"{where}: the charts have the titles {titles}; expected one or more, all different.")


MOST_FIGURES = 3
"""Maximum number of figures of one section on the first screen."""
