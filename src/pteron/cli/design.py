"""`pteron design`: a search for a machine's best dimensions, with requirements in a TOML file.

With `--out` all evaluated designs are kept in a folder, from which a search that ended goes on.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pteron.cli.progress import progress_bar
from pteron.cli.result import CommandResult
from pteron.cli.terminal import note, plain, show, table
from pteron.errors import DataError
from pteron.extras import expect_extra

if TYPE_CHECKING:
    from pteron.design import Front, FrontReport, Spec

_GENERATIONS, _SURVEY = "generations", "survey"
"""Subfolders of the results for the designs evaluated by a search, and by `--sweep`."""

_MOST_WORKERS = 8
"""Greatest number of processes by default: a generation has only some designs for each."""


def design(
    spec: str,
    *,
    out: str | None = None,
    seed: int | None = None,
    sweep: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
) -> CommandResult:
    """Search for the best dimensions of a machine under requirements.

    The file names the initial machine, the numbers that may change, the constraints (a workspace,
    whose place may be free, floors and limits) and the quantities to bound, maximise or minimise:
    the largest cube, the links' length, an index, accuracy, stiffness, or what motors from a list
    must give to drive cycles with a payload. A search with several objectives ends in a Pareto
    front: the designs that no other design betters in every objective.

    With --out a folder gets front.csv, front.parquet, front.png, report.md with what changed and
    what is proved, design.json, and the best machines as TOML files. Evaluated designs are kept
    there, so that the same command resumes after an interruption, and ends in the same front.

    Arguments
    ---------
    SPEC: Requirements, a TOML file.

    Options
    -------
    --out FOLDER: Folder for the results, and to resume from.
    --seed: Seed of the random numbers. [default: the file's]
    --sweep: Evaluate this number of evenly spread designs (in whole files of 256), without search.
    --workers: Number of processes. [default: of a search one per core, up to 8]

    Examples
    --------
    pteron design search.toml --out best
    pteron design search.toml --out best --seed 7 --workers 4
    pteron design search.toml --out all --sweep 100000 --scheduler tcp://host:8786
    """
    expect_extra("design", "pymoo", "a search needs pymoo")
    from pteron.design import FrontReport, read_spec

    requirements = read_spec(spec)
    if sweep is not None and out is None:
        raise DataError("--sweep: needs --out, a folder for what is evaluated")
    if seed is not None and seed < 0:
        raise DataError(f"--seed: {seed} given, 0 or more expected")
    if seed is not None:
        requirements = requirements.with_seed(seed)
    if out is not None:
        from pteron.report.write import checked_folder

        checked_folder(out)
        _tell_resumed(Path(out))
    front = _search_front(requirements, out, sweep, workers, scheduler)
    summary = FrontReport(front)
    files = []
    if out is not None:
        from pteron.report.design.front import write_front

        files = write_front(summary, out)
    record = summary.as_dict() | ({"files": [str(file) for file in files]} if files else {})
    return CommandResult(record, partial(_show, summary), files)


def _tell_resumed(folder: Path) -> None:
    """Print that the search resumes from evaluated designs, if the folder has any."""
    for name, word in ((_GENERATIONS, "generations"), (_SURVEY, "blocks")):
        count = len([*(folder / name).glob("[0-9]*")])
        if count:
            note(f"Note: {folder / name}: resumed; an earlier run has begun {count} {word}")


def _search_front(
    spec: Spec, out: str | None, count: int | None, workers: int | None, scheduler: str | None
) -> Front:
    """Run a survey of `count` designs, or a search if `count` is None, and return its front."""
    from pteron.design import search, survey
    from pteron.maps.sweep import cores

    work: dict[str, Any] = {"workers": workers, "scheduler": scheduler}
    if count is not None:
        with progress_bar(f"Evaluating {count} designs") as tell:
            work["progress"] = tell
            return survey(spec, count, Path(str(out)) / _SURVEY, **work)
    with progress_bar("Searching") as tell:
        work["progress"] = tell
        if workers is None and scheduler is None:
            work["workers"] = min(cores(), _MOST_WORKERS)
        return search(spec, folder=None if out is None else Path(out) / _GENERATIONS, **work)


def _show(summary: FrontReport) -> None:
    """Print the requirements, the proofs at the start, and a table for each selected design."""
    front = summary.front
    name, _, counts = front.summary().partition(": ")
    show(f"[bold]{plain(name)}[/bold]: {counts}")
    show(*(f"Required: {plain(line)}" for line in front.task.spec.requirement_lines()))
    lines = (*summary.start.proofs, *summary.start.missing_quantities)
    show(*(f"Initial machine: {plain(line)}" for line in lines))
    numbers = ("initial", "design", "change")
    for reported in summary.selection:
        rows = (map(plain, change.cells) for change in reported.changes)
        show(
            "",
            f"[bold]{plain(reported.name.replace('-', ' ').capitalize())}[/bold]",
            table("quantity", *numbers, rows=rows, numbers=numbers),
            *(plain(line) for line in (*reported.proofs, *reported.covers)),
        )
