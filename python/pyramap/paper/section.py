"""What an experiment hands to the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure


@dataclass(frozen=True)
class Table:
    """Texts in rows below a row of column names; all columns but the first are numbers."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Section:
    """One figure or table of the paper, as this library makes it.

    Attributes:
        name: Of its text, `texts/NAME.html`, and in `results.json`.
        title: Its heading.
        figures: The pictures, by name; the text says with `$NAME` where each goes.
        results: The numbers, ready for JSON.
        values: What else the text has places for.
        table: Goes where the text says `$table`.
    """

    name: str
    title: str
    figures: Mapping[str, Figure]
    results: Mapping[str, Any]
    values: Mapping[str, str]
    table: Table | None = None
