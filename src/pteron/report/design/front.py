"""`write_front`: the report of a search, its numbers, tables, figure and machines' files."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from pteron.atomic import write_texts
from pteron.design import FrontReport, start_design
from pteron.json_values import json_text
from pteron.plots import front_figure, save_figure
from pteron.tables import write_table


def write_front(report: FrontReport, folder: str | Path) -> list[Path]:
    """Write report.md, design.json, front.csv, front.parquet, front.png and the machines' files.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """
    figures = json_text(report.as_dict())
    texts = {"report.md": report.page(), "design.json": figures, **report.robots()}
    rows = report.table()
    return [
        *write_texts(folder, texts),
        write_table(rows, Path(folder) / "front.csv"),
        write_table(rows, Path(folder) / "front.parquet"),
        save_figure(draw_front(report), Path(folder) / "front.png"),
    ]


def draw_front(report: FrontReport) -> Figure:
    """Return the figure of a front, with the reported designs and the original machine."""
    front = report.front
    names = [o.quantity for o in front.task.spec.objectives]
    return front_figure(
        front.objectives,
        names,
        [front.task.unit(name) for name in names],
        start=[start_design(front.task).quantity(name) for name in names],
        chosen=front.selection,
    )
