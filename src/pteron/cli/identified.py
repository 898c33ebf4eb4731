"""What the terminal shows of an identification."""

from __future__ import annotations

from shutil import get_terminal_size
from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

from pteron.cli.screen import show, table

if TYPE_CHECKING:
    from pteron.identification import Identification
    from pteron.report.identification import Written

__all__ = ["show_identification"]

_NARROW = 56
"""Width of a terminal below which tables leave out what the page has anyway."""

_COLORS = {"trustworthy": "green", "usable with care": "yellow", "not trustworthy": "red"}


def show_identification(result: Identification, files: Written) -> None:
    """Print a verdict, the errors, the values, what was found in the logs, and the files."""
    verdict = result.verdict
    worst = max(float(prediction.nrms.max()) for prediction in result.held_out)
    color = _COLORS[verdict.grade]
    show(
        f"[bold {color}]{escape(result.robot.name)}: {verdict.grade}[/bold {color}], "
        f"held-out error up to {worst:.3g} %"
    )
    show(_errors(result), _values(result))
    show(*(escape(text) for text in (*verdict.reasons, *verdict.next_steps, *_bodies(result))))
    for finding in result.findings:
        show(f"[yellow]Note:[/yellow] {escape(finding.message)}")
    show(*(f"Written: {escape(str(path))}" for path in files.paths))


def _errors(result: Identification) -> Table:
    from pteron.report.digits import significant

    headings = ("held-out NRMS (%)", "noise", "no friction")[: 2 if _narrow() else 3]
    made = table("actuator", *headings, numbers=headings)
    several = len(result.held_out) > 1
    for prediction in result.held_out:
        columns = prediction.nrms, prediction.floor, prediction.nrms_without_friction
        for i, values in enumerate(zip(*columns[: len(headings)], strict=True), start=1):
            where = f" in {prediction.source}" if several else ""
            made.add_row(escape(f"{i}{where}"), *(significant(value) for value in values))
    return made


def _values(result: Identification) -> Table:
    from pteron.report.digits import significant
    from pteron.report.identification import measured, parameter_rows

    headings = ("value", "+- 95 %", "rel. (%)")
    numbers = headings[: 2 if _narrow() else 3]
    made = table("parameter", *numbers, *(() if _narrow() else ("unit",)), "", numbers=numbers)
    made.caption = "Base parameters are sums, named by one term; the page has them in full."
    for row in parameter_rows(result):
        value, half = map(_plain, measured(row.value, row.half))
        relative = ">999" if row.relative >= 9.995 else _plain(significant(100.0 * row.relative, 2))
        mark = "" if not row.weak else "[yellow]unseen[/]" if row.unseen else "[yellow]weak[/]"
        rest = () if _narrow() else (relative, row.unit)
        made.add_row(escape(row.name), value, half, *rest, mark)
    return made


def _narrow() -> bool:
    return get_terminal_size().columns < _NARROW


def _plain(number: str) -> str:
    """Return a number with the minus that every terminal has."""
    return number.replace("\u2212", "-").replace("\u221e", "inf")


def _bodies(result: Identification) -> tuple[str, ...]:
    found = result.consistency
    if found is None:
        return result.notes
    border = f"; at the border: {', '.join(found.at_border)}" if found.at_border else ""
    if found.feasible:
        lines = [f"Real bodies have exactly these base parameters{border}."]
    else:
        lines = [
            "No real bodies have exactly these base parameters; the nearest are "
            f"{found.distance:.2g} standard deviations away{border}."
        ]
    if not found.cad_feasible:
        lines.append(f"The CAD model itself is not real: {'; '.join(found.cad_violations)}.")
    return (*lines, *result.notes)
