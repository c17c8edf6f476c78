"""Reports of an evaluation; the code lies on the lowest floor, where the fit of materials reports too."""

from materials.foundation.report import Cell, Report, Table, write_report

__all__ = ["Cell", "Report", "Table", "write_report"]
