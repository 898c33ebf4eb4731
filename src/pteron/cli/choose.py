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

    The file states the requirements: workspace, payload, cycles, accuracy, stiffness, room, motors
    to choose from, and the objectives to minimise. All kinds of the catalog that have the degrees
    of freedom are searched; the best design of each is proved over the workspace, and its drives
    are listed with their margins at the worst place and in the worst direction.

    Notes on standard error report the kinds at the start, and each kind when it is finished.

    A folder gets choose.html, choose.json and a TOML file for each machine, with its drives.
    Finished kinds are kept there, so that the same command resumes after an interruption. The exit
    code is 1 if no machine meets all requirements.

    Arguments
    ---------
    JOB: Requirements, a TOML file.

    Options
    -------
    --out FOLDER: Folder for the results, and to resume from.
    --workers: Number of processes.

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
            note(f"Finished kinds are kept in {out}; the same command resumes there")
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
            note(f"Resumed from {self._out}: {', '.join(resumed)} finished before")
        if kinds:
            many = f"{len(kinds)} kinds" if len(kinds) > 1 else "One kind"
            each = " each" if len(kinds) > 1 else ""
            note(
                f"{many} with {self._evaluations} designs{each} to evaluate, the best of them to "
                f"be proved: {', '.join(kinds)}"
            )

    def finish(self, candidate: Candidate) -> None:
        """Print how many of a kind's designs are feasible."""
        self._done += 1
        verdict = "" if candidate.serves else "infeasible; "
        note(f"{self._done} of {self._count}: {candidate.kind}: {verdict}{candidate.count_text}")


def _show(choice: Choice) -> None:
    """Print the requirements, a table of the feasible kinds, and why others are infeasible."""
    serving = [candidate for candidate in choice.candidates if candidate.serves]
    objective = choice.job.objectives[0].replace("_", " ")
    best = f"[bold]{choice.best.kind}[/bold] is best by {objective}; " if choice.best else ""
    counts = f"{len(serving)} of {len(choice.candidates)} kinds of machines"
    show(
        f"{best}{counts} can meet all requirements.",
        f"Requirements: {plain('; '.join(choice.job.requirement_lines()))}",
    )
    rows = {candidate.kind: candidate.figure_texts for candidate in serving}
    shown = list(dict.fromkeys(key for row in rows.values() for key in row))
    if serving:
        table_rows = ((k, *(plain(row.get(n, "-")) for n in shown)) for k, row in rows.items())
        show(table("kind", *shown, rows=table_rows, numbers=tuple(shown), names=("kind",)))
    for candidate in serving:
        show(
            f"[bold]{candidate.kind}[/bold]: {plain(candidate.drive_text)}",
            f"  parts: {plain(candidate.part_text)}",
            f"  dimensions (mm): {candidate.dimension_text}",
            f"  {plain(candidate.proved)}",
            f"  {plain(candidate.clear)}",
            f"  drive margins, available over needed: {plain(candidate.margin_text)}",
            *(f"  {plain(candidate.cycle_text)}" for _ in range(bool(candidate.cycle_text))),
            *(f"  check: {plain(text)}" for text in candidate.checked),
        )
        limits = ((row.name, *row.texts) for row in candidate.limits)
        names = ("worst", "permitted", "margin")
        show(table("limit", *names, "place", rows=limits, numbers=names))
    for candidate in choice.candidates:
        if not candidate.serves:
            show(f"[bold]{candidate.kind}[/bold]: {plain(candidate.verdict)}")
    if serving:
        show("A place is that of the tool from the middle of the workspace.")
        show(*(f"[dim]Assumed: {plain(line)}[/dim]" for line in choice.assumption_lines()))
