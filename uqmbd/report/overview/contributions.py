"""Contributions of plugin sections to the first screen, as data for its template."""

from __future__ import annotations

from uqmbd.report.charts import Views, charted, checked_chart
from uqmbd.report.sections import Content, FirstScreen
from uqmbd.results.assessment import LEVELS

__all__ = ["contributed"]

ROWS, STATEMENTS = 6, 7
"""Maximum number of rows and statements of one section."""


def contributed(screen: FirstScreen) -> Content:
    """Return the template data of one section."""
    statements = sorted(screen.statements, key=lambda one: one.level)
    return {
        "title": screen.title,
        "heads": list(screen.heads),
        "rows": [list(row) for row in screen.rows[:ROWS]],
        "more": max(len(screen.rows) - ROWS, 0),
        "statements": [
            {"level": one.level, "sign": LEVELS[one.level][0], "name": one.name, "text": one.text}
            for one in statements[:STATEMENTS]
        ],
        "more_statements": max(len(statements) - STATEMENTS, 0),
        "figures": [
            charted(
                Views([checked_chart(one) for one in group.charts], group.choose),
                group.alt,
                group.caption,
                "",
                still=True,
            )
            for group in screen.charts
        ],
    }
