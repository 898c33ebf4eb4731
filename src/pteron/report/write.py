"""`write_report`: the page and its numbers, as files."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path

from pteron.atomic import make_folder, write_text
from pteron.errors import PteronError
from pteron.manipulator import Manipulator

__all__ = ["write_report"]


def write_report(robot: Manipulator, folder: str | Path) -> Path:
    """Write the report on a machine: `report.html`, one page that needs no other file or network.

    `report.json` beside it holds the numbers. Each file is written whole or not at all.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    folder : str or path
        Where to write; made if it is missing.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    ModelError
        If the machine reaches no pose.
    SingularPose
        If the machine is singular at every pose.
    """
    # Matplotlib, SciPy and SymPy are behind these; the table of the paper needs none of them.
    from pteron.report.contents import contents
    from pteron.report.numbers import numbers
    from pteron.report.page import page

    there = Path(folder).exists()
    target = make_folder(folder)  # before the work, not after it
    try:
        report = contents(robot)
        html = page(report)
    except PteronError:
        if not there:
            with suppress(OSError):  # unless somebody has put something there meanwhile
                target.rmdir()
        raise
    write_text(
        target / "report.json", json.dumps(numbers(report), indent=1, allow_nan=False) + "\n"
    )
    return write_text(target / "report.html", html)
