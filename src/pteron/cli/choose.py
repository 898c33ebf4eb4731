"""`pteron choose`: kinds of machines for a job, from a TOML file to a page and their files."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from pteron.cli.progress import progress_bar
from pteron.cli.result import CommandResult
from pteron.cli.terminal import note, plain, show, table
from pteron.errors import DataError

if TYPE_CHECKING:
    from pteron.design import Choice
    from pteron.design.candidate import Candidate

_NONE = 1
"""Exit code where no machine does the job."""


def choose(job: str, *, out: str | None = None, workers: int = 1) -> CommandResult:
    """Choose a machine for a job: which kind, which dimensions, which motors.

    The file says what the machine must do: workspace, payload, cycles, accuracy, stiffness, room,
    motors to choose from, and what is to be small. All kinds of the catalog that can do the motion
    are searched; the best design of each is proved over the workspace, and its drives are told
    with their margins at the worst place and in the worst direction.

    What is tried is told at the start, and each kind when it is finished, on standard error.

    A folder gets choose.html, choose.json and a TOML file for each machine, with its drives. Kinds
    that are finished are kept there, so that the same command goes on where it was ended. The exit
    code is 1 if no machine does the job.

    Arguments
    ---------
    JOB: What the machine must do, a TOML file.

    Options
    -------
    --out FOLDER: Write the results to a folder, and go on there if ended.
    --workers: Processes that do the work.

    Examples
    --------
    pteron choose task.toml
    pteron choose task.toml --out machines --workers 2
    """
    from pteron.design import choose_machine, read_job

    if workers < 1:
        raise DataError(f"--workers: {workers} given, 1 or more expected")
    requirements = read_job(job)
    if out is not None:
        from pteron.report.write import checked_folder

        checked_folder(out)
    log = _Log(requirements.search.evaluations, out)
    try:
        with progress_bar("Choosing") as bar:
            choice = choose_machine(
                requirements,
                folder=out,
                workers=workers,
                progress=bar,
                begun=log.begin,
                finished=log.finish,
            )
    except KeyboardInterrupt:
        if out is not None:
            note(f"What is finished is kept in {out}; the same command goes on there")
        raise
    files = []
    if out is not None:
        from pteron.report.design.choice import write_choice

        files = write_choice(choice, out)
    record = choice.as_dict() | ({"files": [str(file) for file in files]} if files else {})
    return CommandResult(record, partial(_show, choice), files, _NONE if choice.best is None else 0)


class _Log:
    """Notes on standard error: the kinds to search, and the result of each."""

    def __init__(self, evaluations: int, out: str | None) -> None:
        self._evaluations, self._out = evaluations, out
        self._count = self._done = 0

    def begin(self, kinds: Sequence[str], resumed: Sequence[str]) -> None:
        """Print the kinds to search, and those that are already finished in the folder."""
        self._count = len(kinds)
        if resumed:
            note(f"Gone on in {self._out}: {', '.join(resumed)} finished before")
        if kinds:
            many = f"{len(kinds)} kinds" if len(kinds) > 1 else "One kind"
            each = " each" if len(kinds) > 1 else ""
            note(
                f"{many} with {self._evaluations} designs{each} to rate, the best of them to be "
                f"proved: {', '.join(kinds)}"
            )

    def finish(self, candidate: Candidate) -> None:
        """Print how many of a kind's designs are feasible."""
        self._done += 1
        feasible = f"{candidate.kept} of {candidate.evaluated} designs keep all that is asked"
        verdict = feasible if candidate.serves else f"falls out; {feasible}"
        note(f"{self._done} of {self._count}: {candidate.kind}: {verdict}")


def _show(choice: Choice) -> None:
    """Print the requirements, a table of the feasible kinds, and why others are infeasible."""
    show("[bold]Asked[/bold]: " + plain("; ".join(choice.job.requirement_lines())))
    serving = [candidate for candidate in choice.candidates if candidate.serves]
    rows = {candidate.kind: candidate.figure_texts for candidate in serving}
    shown = list(dict.fromkeys(key for row in rows.values() for key in row))
    if serving:
        table_rows = ((k, *(plain(row.get(n, "-")) for n in shown)) for k, row in rows.items())
        show(table("kind", *shown, rows=table_rows, numbers=tuple(shown), names=("kind",)))
    for candidate in serving:
        show(
            f"[bold]{candidate.kind}[/bold]: {plain(candidate.drive_text)}",
            f"  mm: {candidate.dimension_text}",
            f"  {plain(candidate.proved)}",
            f"  {plain(candidate.clear)}",
            f"  margins: {plain(candidate.margin_text)}",
        )
    for candidate in choice.candidates:
        if not candidate.serves:
            verdict = candidate.summary().removeprefix(candidate.kind)
            show(f"[bold]{candidate.kind}[/bold]{plain(verdict)}")
    if serving:
        show(*(f"[dim]{plain(line)}[/dim]" for line in choice.assumption_lines()))
