"""The numbers of a machine as HTML for the panel: values with units, and colours with words."""

from __future__ import annotations

from html import escape

import numpy as np

from pteron.plots.canvas import LEG_COLORS
from pteron.report.quantities import nouns, readable
from pteron.report.typeset import fixed, significant
from pteron.viewer.readings import Level, Readings, level
from pteron.viewer.state import ViewerState

_COLORS: dict[Level, tuple[str, str]] = {
    "far": ("#d9efe3", "#0b5a34"),
    "near": ("#fbe8c6", "#7a4b00"),
    "close": ("#f8d7d4", "#8c1d14"),
}
"""Background and ink, which differ enough for every eye; the words say the same."""

_STYLE = """<style>
.pt{font-size:12px;line-height:1.35;padding:0 .8em;font-variant-numeric:tabular-nums}
.pt table{width:100%;border-collapse:collapse;margin:.1em 0 .3em}
.pt th{font-weight:600;text-align:right;padding:.05em .2em;opacity:.75}
.pt td{text-align:right;padding:.05em .2em;white-space:nowrap}
.pt th:first-child,.pt td:first-child{text-align:left}
.pt .leg{display:inline-block;width:.75em;height:.75em;border-radius:50%;margin-right:.35em}
.pt .far,.pt .near,.pt .close{border-radius:.3em;padding:.02em .4em}
"""

PLACES = 2
"""Decimal places of a force."""


def status(message: str, *, empty: str) -> str:
    """Return what became of the last action; where all went well, what is said instead."""
    background, ink = _COLORS["near" if message else "far"]
    return (
        '<div role="status" style="font-size:12px;line-height:1.4;margin:.2em .8em;'
        f'padding:.35em .6em;border-radius:.4em;background:{background};color:{ink}">'
        f"{escape(message or empty)}</div>"
    )


def readout(state: ViewerState, found: Readings) -> str:
    """Return the numbers of a state as HTML."""
    robot = state.robot
    limited = not np.isnan(found.shares).all()
    rows = []
    for i, leg in enumerate(robot.legs):
        force = found.forces[i]
        cells = [
            f'<span class="leg" style="background:{LEG_COLORS[i]}"></span>{i + 1}',
            readable(float(found.joints[i]), leg.joint.unit),
            "\u2013" if np.isnan(force) else f"{fixed(force, PLACES)} {leg.joint.force_unit}",
        ]
        if limited:
            cells.append(_share(float(found.shares[i])))
        rows.append("".join(f"<td>{cell}</td>" for cell in cells))
    names = ["leg", nouns([leg.joint for leg in robot.legs]), "drive"]
    names += ["of its most"] if limited else []
    head = "".join(f"<th>{name}</th>" for name in names)
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    colors = "".join(
        f".pt .{name}{{background:{back};color:{ink}}}" for name, (back, ink) in _COLORS.items()
    )
    return (
        f'{_STYLE}{colors}</style><div class="pt"><table class="legs"><tr>{head}</tr>{body}</table>'
        f'<table class="measures">{_measures(found)}</table>{_fault(found)}</div>'
    )


def _measures(found: Readings) -> str:
    """Return the condition number and the three reserves, each 1 at best."""
    leg, joint = int(found.type_i.argmin()), int(found.clearances.argmin())
    lines = [
        (f"leg {leg + 1} to its end (type I)", float(found.type_i[leg])),
        ("to where drives lose hold (type II)", found.type_ii),
        (f"leg {joint + 1} to a joint's limit", float(found.clearances[joint])),
    ]
    condition = significant(found.condition)
    rows = [f"<tr><td>condition number of J</td><td>{condition}</td><td></td></tr>"]
    for name, value in lines:
        how = level(value)
        rows.append(
            f"<tr><td>{name}</td><td>{fixed(100.0 * value, 0)} %</td>"
            f'<td><span class="{how}">{how}</span></td></tr>'
        )
    return "".join(rows)


def _share(share: float) -> str:
    if np.isnan(share):
        return "\u2013"
    how: Level = "far" if share <= 0.8 else "near" if share <= 1.0 else "close"
    words = {"far": "", "near": " near", "close": " too much"}[how]
    return f'<span class="{how}">{fixed(100.0 * share, 0)} %{words}</span>'


def _fault(found: Readings) -> str:
    return f"<p>No forces here: {escape(found.fault)}</p>" if found.fault else ""
