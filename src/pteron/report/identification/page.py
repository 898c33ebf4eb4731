"""The page of an identification: one HTML file that needs nothing else."""

from __future__ import annotations

import re
from importlib.resources import files

from markupsafe import Markup, escape

import pteron
from pteron.identification import Identification
from pteron.identification.result import AT_THE_FLOOR, LARGE, SMALL
from pteron.report.digits import significant
from pteron.report.environment import environment
from pteron.report.identification.contents import contents
from pteron.report.identification.figures import figures
from pteron.report.identification.names import typeset
from pteron.report.identification.parameters import measured

__all__ = ["page"]


def page(result: Identification, model_file: str | None = None) -> str:
    """Return the page of an identification.

    Parameters
    ----------
    result : Identification
        What it says.
    model_file : str, optional
        Name of the file of the machine with its identified bodies, beside the page.

    Returns
    -------
    str
        HTML without any reference to another file or address.
    """
    templates = environment(
        "report/identification",
        measured=lambda row: measured(row.value, row.half),
        percent=_percent,
        prose=_prose,
        typeset=typeset,
    )
    found = contents(result)
    return templates.get_template("page.html.j2").render(
        found=found,
        result=result,
        robot=result.robot,
        estimate=result.estimate,
        bodies=result.consistency,
        legs=range(len(result.robot.legs)),
        limits=(AT_THE_FLOOR, SMALL, LARGE),
        figures=figures(found),
        model_file=model_file,
        version=pteron.__version__,
        style=_resource("report", "page.css") + _resource("report.identification", "page.css"),
    )


def _prose(text: str) -> Markup:
    """Return a message with true minus signs, and options of the command line kept in one piece."""
    signed = re.sub(r"(?<![\w.-])-(?=\d)", "\u2212", str(escape(text)))
    return Markup(re.sub(r"--[a-z][a-z-]*(?: each)?", r"<code>\g<0></code>", signed))


def _percent(share: float) -> str:
    """Return a share in percent; what is nothing to speak of has no digits."""
    return "less than 0.01 %" if 0.0 <= share < 1e-4 else f"{significant(100.0 * share, 2)} %"


def _resource(package: str, name: str) -> Markup:
    return Markup((files(f"pteron.{package}") / name).read_text(encoding="utf-8"))
