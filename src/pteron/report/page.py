"""The report as one HTML page that needs nothing else: styles, script, pictures and data inside."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any

import numpy as np
from markupsafe import Markup, escape

import pteron
from pteron.manipulator import parameter_names, parameter_units
from pteron.report.contents import Report
from pteron.report.digits import expression, fixed, symbol, triple
from pteron.report.environment import environment
from pteron.report.figures import figures
from pteron.report.scene import scene
from pteron.report.symbols import in_symbols

__all__ = ["page"]


def page(report: Report) -> str:
    """Return the page of a report.

    Parameters
    ----------
    report : Report
        What it says.

    Returns
    -------
    str
        HTML without any reference to another file or address.
    """
    templates = environment(
        "report",
        degrees=lambda angle, places=1: fixed(float(np.degrees(angle)), places),
        expression=expression,
        mm=lambda metres, places=1: fixed(1e3 * float(metres), places),
        symbol=symbol,
        triple=triple,
        typeset=lambda text: escape(text).replace("J^-T", Markup("<b>J</b><sup>\u2212T</sup>")),
        zip=zip,
    )
    robot = report.robot
    units = dict(zip(parameter_names(robot), parameter_units(robot), strict=True))
    return templates.get_template("page.html.j2").render(
        report=report,
        robot=robot,
        cycle=report.cycle,
        legs=range(len(robot.legs)),
        figures=figures(report),
        units=[units.get(name, "") for name in report.base.names],
        values=report.base.values(),
        symbols=in_symbols(report.base),
        version=pteron.__version__,
        style=_resource("page.css"),
        script=_resource("view.js"),
        scene=_data(scene(report)),
    )


def _resource(name: str) -> Markup:
    return Markup((files("pteron.report") / name).read_text(encoding="utf-8"))


def _data(value: Any) -> Markup:
    """Return JSON that cannot end the script element it stands in."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return Markup(text.replace("<", "\\u003c"))
