"""What a command leaves behind: tables as CSV and Markdown, `metrics.json`, and one HTML page that needs no other file."""

from __future__ import annotations

import base64
import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .files import make_folder, replacing, write_json

Cell = str | int | float | None


@dataclass(frozen=True)
class Table:
    """A table of numbers and words.

    Attributes
    ----------
    name : str
        Of its files: `NAME.csv`.
    title : str
    columns : sequence of str
    rows : sequence of sequences
        None is what does not apply.
    note : str
        How to read it.
    """

    name: str
    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    note: str = ""

    def words(self) -> list[list[str]]:
        """Return the cells as a person reads them: four significant digits, a dash for nothing."""
        return [[_word(cell) for cell in row] for row in self.rows]

    def kinds(self) -> list[str]:
        """Return of each column what it holds, "words" or "numbers"."""
        return ["words" if any(isinstance(row[i], str) for row in self.rows) else "numbers" for i in range(len(self.columns))]

    def markdown(self) -> str:
        """Return the table in Markdown, with its title and note."""
        lines = [list(self.columns), *self.words()]
        widths = [max(len(line[i]) for line in lines) for i in range(len(self.columns))]
        padded = ["| " + " | ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) + " |" for line in lines]
        padded.insert(1, "|" + "|".join("-" * (width + 2) for width in widths) + "|")
        return "\n".join([f"## {self.title}", "", *padded, "", *([self.note, ""] if self.note else [])])

    def csv(self) -> str:
        """Return the table as CSV with all digits; what does not apply is empty."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows(["" if cell is None else cell for cell in row] for row in self.rows)
        return out.getvalue()

    def records(self) -> list[dict[str, Cell]]:
        """Return the rows by column; numbers that are not finite become None, which JSON can hold."""
        return [dict(zip(self.columns, map(_plain, row), strict=True)) for row in self.rows]


@dataclass(frozen=True)
class Report:
    """A title, what was done in words, tables, pictures (PNG files with captions), and what each measure means."""

    title: str
    paragraphs: Sequence[str]
    tables: Sequence[Table]
    pictures: Mapping[str, Path] = field(default_factory=dict)
    definitions: Mapping[str, str] = field(default_factory=dict)
    metrics: Mapping[str, Any] = field(default_factory=dict)

    def markdown(self) -> str:
        """Return all but the pictures in Markdown."""
        parts = [f"# {self.title}", "", *(f"{text}\n" for text in self.paragraphs), *(t.markdown() for t in self.tables)]
        if self.definitions:
            parts += ["## Definitions", "", *(f"- **{name}**: {text}" for name, text in self.definitions.items()), ""]
        return "\n".join(parts)


def write_report(folder: str | Path, report: Report) -> None:
    """Write `report.html`, `report.md`, `metrics.json` and a CSV per table into a folder.

    The page holds its pictures within itself, so that it can be sent to someone.

    Raises
    ------
    InputError
        If the folder cannot be written to.
    """
    folder = make_folder(folder)
    for table in report.tables:
        with replacing(folder / f"{table.name}.csv") as temporary:
            temporary.write_text(table.csv(), encoding="utf-8")
    with replacing(folder / "report.md") as temporary:
        temporary.write_text(report.markdown(), encoding="utf-8")
    numbers = {t.name: t.records() for t in report.tables} | dict(report.metrics)
    write_json(folder / "metrics.json", {"title": report.title, **numbers, "definitions": dict(report.definitions)})
    with replacing(folder / "report.html") as temporary:
        temporary.write_text(_page(report), encoding="utf-8")


def _page(report: Report) -> str:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent / "templates"), autoescape=True, undefined=StrictUndefined, trim_blocks=False
    )
    pictures = [
        {"caption": caption, "data": base64.b64encode(path.read_bytes()).decode("ascii")}
        for caption, path in report.pictures.items()
    ]
    return environment.get_template("report.html.j2").render(
        title=report.title,
        paragraphs=report.paragraphs,
        tables=report.tables,
        pictures=pictures,
        definitions=report.definitions,
    )


def _word(cell: Cell) -> str:
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "–"
    return f"{cell:.4g}" if isinstance(cell, float) else str(cell)


def _plain(cell: Cell) -> Cell:
    return None if isinstance(cell, float) and not math.isfinite(cell) else cell
