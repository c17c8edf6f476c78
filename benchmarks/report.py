"""Where measurements go: one JSON line each as soon as it is known, a table and a plot at the end."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from materials.foundation.errors import InputError
from materials.foundation.files import make_folder, replacing

FIGURE_KEYS = ("name", "ours", "peer", "theirs", "ratio", "unit", "error_reached")
PROOF_KEYS = ("name", "value", "bound", "holds")


class Report:
    """Collects the figures or the proofs of one run.

    Parameters
    ----------
    folder : path
        Where `bench.jsonl` or `proof.jsonl`, `.md` and `.png` go.
    kind : {"bench", "proof"}
        Name of the files. Lines are appended to those of earlier runs; table and plot show this run alone.
    """

    def __init__(self, folder: str | Path, kind: str) -> None:
        self.folder, self.kind = make_folder(folder), kind
        self.lines: list[dict[str, Any]] = []
        self.failures: list[tuple[str, str]] = []

    @property
    def _file(self) -> Path:
        return self.folder / f"{self.kind}.jsonl"

    def figure(
        self, *, name: str, ours: float, unit: str, peer: str = "", theirs: float | None = None, error_reached: float | None = None
    ) -> None:
        """Record a measurement and, where there is a peer, the ratio ours / theirs.

        Parameters
        ----------
        name : str
            What was measured: `wet frame 640 x 270`.
        ours, theirs : float
            Median of each [unit].
        unit : str
            `s`, `Mray/s`, `MiB`, …; it tells whether more is better.
        peer : str
            Whom we measure against, with its version.
        error_reached : float, optional
            Error against the converged reference that both reached; a comparison of times means nothing without it.
        """
        ratio = None if theirs is None or theirs == 0 else ours / theirs
        self._add(dict(zip(FIGURE_KEYS, (name, ours, peer, theirs, ratio, unit, error_reached), strict=True)))

    def proof(self, *, name: str, value: float, bound: float, holds: bool) -> None:
        """Record a number, the bound that was claimed for it, and whether the claim holds."""
        self._add(dict(zip(PROOF_KEYS, (name, value, bound, bool(holds)), strict=True)))

    def failed(self, name: str, reason: str) -> None:
        """Remember a module that could not run to its end."""
        self.failures.append((name, " ".join(reason.split())))

    @property
    def all_hold(self) -> bool:
        return not self.failures and all(line.get("holds", True) for line in self.lines)

    def finish(self) -> str:
        """Write the table and the plot; return the table."""
        table = self._table()
        with replacing(self.folder / f"{self.kind}.md") as temporary:
            temporary.write_text(table, encoding="utf-8")
        if self.lines:
            self._plot()
        return table

    def _add(self, line: dict[str, Any]) -> None:
        plain = {key: _plain(line["name"], key, value) for key, value in line.items()}
        self.lines.append(plain)
        # Appended at once: a later crash costs no earlier line.
        with self._file.open("a", encoding="utf-8") as file:
            file.write(json.dumps(plain, ensure_ascii=False, allow_nan=False) + "\n")

    def _table(self) -> str:
        keys = FIGURE_KEYS if self.kind == "bench" else PROOF_KEYS
        rows = [list(keys)] + [[_word(line[key]) for key in keys] for line in self.lines]
        widths = [max(len(row[i]) for row in rows) for i in range(len(keys))]
        written = ["| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |" for row in rows]
        written.insert(1, "|" + "|".join("-" * (width + 2) for width in widths) + "|")
        written += [""] + [f"not measured: {name}: {reason}" for name, reason in self.failures] if self.failures else []
        return "\n".join(written) + "\n"

    def _plot(self) -> None:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(9, 1.2 + 0.4 * len(self.lines)), layout="constrained")
        axes = figure.subplots()
        names = [line["name"] for line in self.lines]
        if self.kind == "bench":
            shown = [(line["ratio"] if line["ratio"] else math.nan) for line in self.lines]
            axes.barh(names, shown, color="tab:blue")
            labels = [f"{_word(line['ours'])} {line['unit']} / {_word(line['theirs'])} {line['peer']}" for line in self.lines]
            axes.set_xlabel("ours / theirs")
        else:
            # Value over bound, so that unlike quantities share an axis.
            shown = [line["value"] / line["bound"] if line["bound"] else math.nan for line in self.lines]
            axes.barh(names, shown, color=["tab:green" if line["holds"] else "tab:red" for line in self.lines])
            labels = [f"{_word(line['value'])} (bound {_word(line['bound'])})" for line in self.lines]
            axes.set_xlabel("value / bound")
        axes.axvline(1, color="black", linewidth=1)
        for row, (length, label) in enumerate(zip(shown, labels, strict=True)):
            start = 0 if math.isnan(length) else max(length, 0)
            axes.annotate(label, (start, row), xytext=(4, 0), textcoords="offset points", va="center", fontsize=8)
        axes.margins(x=0.45)
        axes.invert_yaxis()
        with replacing(self.folder / f"{self.kind}.png") as temporary:
            figure.savefig(temporary, dpi=110)


def _plain(name: str, key: str, value: Any) -> Any:
    """Turn NumPy's scalars into Python's and refuse what JSON cannot hold."""
    value = value.item() if hasattr(value, "item") else value
    if isinstance(value, float) and not math.isfinite(value):
        raise InputError("be finite", got=value, key=f"{key} of {name!r}")
    return value


def _word(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "NO"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
