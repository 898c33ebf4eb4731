"""`pteron design`: which dimensions are best for a workspace, its indices and its drives."""

from __future__ import annotations

import json as json_module
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import rich.table
from typer import Argument

from pteron.cli.arguments import Json, option
from pteron.cli.completion import machines
from pteron.cli.terminal import plain, progress_bar, show, show_json, table
from pteron.errors import DataError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pteron.design import Front, Spec, Summary, Told
    from pteron.design.search import Progress

_GENERATIONS, _SURVEY = "generations", "survey"
"""Folders in that of the results, for what is evaluated."""


def design(
    spec: Annotated[
        str,
        Argument(metavar="SPEC", help="What is asked, a TOML file.", autocompletion=machines),
    ],
    out: Annotated[
        str | None,
        option("out", "Write the results to a folder, and go on there if ended.", "FOLDER"),
    ] = None,
    seed: Annotated[int | None, option("seed", "Of all chance.", show_default="the file's")] = None,
    sweep: Annotated[
        int | None,
        option("sweep", "Evaluate so many designs spread evenly, instead of a search."),
    ] = None,
    workers: Annotated[
        int | None,
        option("workers", "Processes that do the work.", show_default="this one"),
    ] = None,
    scheduler: Annotated[
        str | None,
        option(
            "scheduler",
            "A Dask cluster that does it, tcp://host:8786; it has no lock of its own.",
            "ADDRESS",
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Search for the dimensions of a machine that are best for what is asked of it.

    The file names the machine to begin with, the numbers that may change, what must be kept
    (a workspace, floors and limits) and what is to be large or small: the largest cube, the links'
    length, an index, the drives' force, ... A search of several objectives has a front of best
    designs, each better than any other in something.

    A folder gets front.csv, front.parquet, front.png, report.md with what changed and what is
    proved, design.json, and the best machines as TOML files. What is evaluated is kept there, so
    that the same command goes on where it was ended, and ends in the same front.
    """
    from pteron.design import Summary, read_spec

    asked = read_spec(spec)
    if sweep is not None and out is None:
        raise DataError("--sweep: needs --out, a folder for what is evaluated")
    if seed is not None and seed < 0:
        raise DataError(f"--seed: {seed} given, 0 or more expected")
    if seed is not None:
        asked = asked.with_seed(seed)
    if out is not None:
        from pteron.report.write import checked_folder

        checked_folder(out)
    front = _found(asked, out, sweep, workers, scheduler)
    summary = Summary(front)
    files = [] if out is None else _write(summary, Path(out))
    if json:
        show_json(summary.data() | ({"files": [str(file) for file in files]} if files else {}))
        return
    _show(summary)
    show(*(f"Written: {plain(str(file))}" for file in files))


def _found(
    spec: Spec, out: str | None, count: int | None, workers: int | None, scheduler: str | None
) -> Front:
    from pteron.design import search, survey

    if count is not None:
        with progress_bar(f"Evaluating {count} designs", 1000) as advance:
            done = 0

            def tell(finished: int, chunks: int) -> None:
                nonlocal done
                advance(1000 * finished // chunks - done)
                done = 1000 * finished // chunks

            folder = Path(str(out)) / _SURVEY
            return survey(spec, count, folder, workers=workers, scheduler=scheduler, progress=tell)
    with _generations(spec) as told:
        return search(
            spec,
            folder=None if out is None else Path(out) / _GENERATIONS,
            workers=workers,
            scheduler=scheduler,
            progress=told,
        )


@contextmanager
def _generations(spec: Spec) -> Iterator[Progress]:
    with progress_bar("Searching", spec.search.generations) as advance:
        yield lambda number, count, best: advance(1)


def _write(summary: Summary, folder: Path) -> list[Path]:
    """Write the results to a folder, and return their paths."""
    from pteron.atomic import plain as plain_data
    from pteron.atomic import write_texts
    from pteron.plots import save_figure
    from pteron.tables import write_table

    rows = summary.table()
    figures = json_module.dumps(plain_data(summary.data()), indent=1, allow_nan=False) + "\n"
    texts = {"report.md": summary.page(), "design.json": figures, **summary.robots()}
    return [
        *write_texts(folder, texts),
        write_table(rows, folder / "front.csv"),
        write_table(rows, folder / "front.parquet"),
        save_figure(_figure(summary), folder / "front.png"),
    ]


def _figure(summary: Summary) -> Figure:
    from pteron.design import start_design
    from pteron.plots import front_figure

    front = summary.front
    names = [o.quantity for o in front.task.spec.objectives]
    return front_figure(
        front.objectives,
        names,
        [front.task.unit(name) for name in names],
        start=[start_design(front.task).quantity(name) for name in names],
        chosen=front.chosen,
    )


def _show(summary: Summary) -> None:
    front = summary.front
    show(
        f"[bold]{plain(front.task.robot.name)}[/bold]: {front.evaluated} designs evaluated, "
        f"{front.kept} keep all that is asked, {len(front)} on the front",
    )
    show(*(f"To begin with: {plain(line)}" for line in summary.start.proofs))
    for told in summary.chosen:
        show("", f"[bold]{plain(told.name.replace('-', ' '))}[/bold]", _changes(told))
        show(*(plain(line) for line in told.proofs))


def _changes(told: Told) -> rich.table.Table:
    made = table(
        *("what", "to begin with", "now", "change"), numbers=("to begin with", "now", "change")
    )
    for change in told.changes:
        made.add_row(
            plain(change.what), change.told(change.before), change.told(change.after), change.by
        )
    return made
