"""What a page is made of: a section is a template and its context; most are a text, plots and tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

if TYPE_CHECKING:
    import pandas as pd


class Written(Protocol):
    """A figure of the package plotly, which writes itself as JSON."""

    def to_json(self, *, engine: str) -> str:
        """Return data and layout."""


Figure: TypeAlias = dict[str, Any]  # data and layout as plain values for plotly.js


class Kind(StrEnum):
    """How a column of a table is shown."""

    TEXT = "text"
    NUMBER = "number"
    VERDICT = "verdict"
    LONG = "long"
    CODE = "code"


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One column of a table.

    Attributes:
        key: of the rows.
        title: heading, with the unit where there is one.
        kind: how it is shown.
    """

    key: str
    title: str
    kind: Kind = Kind.TEXT


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Rows for those who want the numbers; every table can be saved as CSV from the page.

    Attributes:
        title: in words; also the name of the CSV file.
        columns: in order; what is not named is not shown.
        rows: plain values; numbers are shown with four digits (counts in full) and saved with all.
        file: name of a file beside the page that holds all rows, where there may be more than a page shows.
        folded: whether it is closed at first.
        once: whether the page says text that is the same in every row once above, instead of in a column.
    """

    title: str
    columns: Sequence[Column]
    rows: Sequence[Mapping[str, Any]]
    file: str = ""
    folded: bool = False
    once: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Plot:
    """One figure of plotly.

    Attributes:
        name: its id on the page.
        figure: every axis with its unit; its title becomes the caption.
        time: whether x is the time of a case's runs: then it shares cursor, zoom and clock with the others.
        folded: what it shows, if it is closed at first and drawn when it is opened.
        choice: of what it is drawn, if its section shows the figures of one of several at a time.
    """

    name: str
    figure: Figure | Written
    time: bool = False
    folded: str = ""
    choice: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """One part of a page.

    Attributes:
        name: its id on the page, of letters, digits and hyphens.
        title: heading.
        says: what it comes to, in a sentence; below the heading of a page that it leads.
        text: what the reader must know to read it.
        plots, tables: shown below the text.
        template: file in reports/pages/templates; it may show more than the rest from `context`.
        context: for a template of its own.
    """

    name: str
    title: str
    says: str = ""
    text: str = ""
    plots: Sequence[Plot] = ()
    tables: Sequence[Table] = ()
    template: str = "section.html"
    context: Mapping[str, Any] = field(default_factory=dict)

    @property
    def choices(self) -> dict[str, list[Plot]]:
        """Plots by their choice, in order; one group if there is nothing to choose."""
        found: dict[str, list[Plot]] = {}
        for plot in self.plots:
            found.setdefault(plot.choice, []).append(plot)
        return found


def columns(**titles: str | tuple[str, Kind]) -> tuple[Column, ...]:
    """Columns from key=title or key=(title, kind)."""
    return tuple(
        Column(key=key, title=given) if isinstance(given, str) else Column(key=key, title=given[0], kind=given[1])
        for key, given in titles.items()
    )


def records(rows: pd.DataFrame) -> list[dict[str, Any]]:
    """A table of pandas as plain rows."""
    return [{str(k): v for k, v in record.items()} for record in rows.to_dict(orient="records")]
