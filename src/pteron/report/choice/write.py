"""`write_choice`: the page on a choice of machines, its numbers, and a file for each machine."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

import pteron
from pteron.atomic import write_texts
from pteron.design import Choice
from pteron.design.choosing.job import OBJECTIVES
from pteron.design.choosing.told import asked, assumed, cells, dimensions, drives, margins
from pteron.plots import fronts_figure, svg
from pteron.report.typeset import resource, template


def write_choice(choice: Choice, folder: str | Path) -> list[Path]:
    """Write choose.html, choose.json and KIND.toml for each kind that serves.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """
    data = json.dumps(choice.data(), indent=1, allow_nan=False) + "\n"
    texts = {"choose.html": page(choice), "choose.json": data, **choice.robots()}
    return write_texts(folder, texts)


def page(choice: Choice) -> str:
    """Return the page as HTML without reference to another file."""
    serving = [one for one in choice.candidates if one.serves]
    headings = list(dict.fromkeys(key for one in serving for key in cells(one)))
    figure = None
    if serving:
        first, second = list(serving[0].front[0])[:2]
        fronts = {one.kind: np.array([list(p.values())[:2] for p in one.front]) for one in serving}
        units = [OBJECTIVES[first], OBJECTIVES[second]]
        drawn = fronts_figure(fronts, [first, second], units)
        figure = svg(drawn, name="fronts", title="The best designs of each kind")
    return template("choice/page.html.j2").render(
        choice=choice,
        serving=serving,
        others=[one for one in choice.candidates if not one.serves],
        headings=headings,
        cells={one.kind: cells(one) for one in serving},
        dimensions=dimensions,
        drives=drives,
        margins=margins,
        asked=asked(choice.job),
        assumed=assumed(choice),
        figure=figure,
        version=pteron.__version__,
        style=resource("page.css"),
    )
