"""`write_choice`: the page on a choice of machines, its numbers, and a file for each machine."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.figure import Figure

from pteron.atomic import write_texts
from pteron.design import Choice
from pteron.design.candidate import Candidate
from pteron.design.job import OBJECTIVES
from pteron.json_values import json_text
from pteron.manipulator import load
from pteron.plots import draw, fronts_figure
from pteron.report.typeset import template


def write_choice(choice: Choice, folder: str | Path) -> list[Path]:
    """Write choose.html, choose.json and KIND.toml for each feasible kind.

    Machines of an earlier choice that no longer serve are removed, if they are as they were
    written.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """
    texts = {"choose.html": page(choice), "choose.json": json_text(choice.as_dict())}
    earlier = _machines(Path(folder) / "choose.json")
    written = write_texts(folder, texts | choice.robots())
    for name, robot in earlier.items():
        file = Path(folder) / name
        if file not in written and file.is_file() and file.read_text(encoding="utf-8") == robot:
            file.unlink()
    return written


def _machines(file: Path) -> dict[str, str]:
    """Return the machine files of an earlier choice by name; empty if it is no choice."""
    try:
        kinds = json.loads(file.read_text(encoding="utf-8"))["kinds"]
        return {f"{kind['kind']}.toml": kind["robot"] for kind in kinds if kind["serves"]}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def reasons(choice: Choice, serving: list[Candidate]) -> list[str]:
    """Return the verdict on a choice, a sentence each."""
    first, tried = choice.job.objectives[0].replace("_", " "), len(choice.candidates)
    if not serving:
        alone = f"{choice.candidates[0].kind}, the one kind of machine that was tried, does not do"
        none = f"None of the {tried} kinds of machines that were tried does"
        return [f"{alone if tried == 1 else none} what is asked."]
    best, count = serving[0], len(serving)
    if tried == 1:
        does = f"{best.kind}, the one kind of machine that was tried, does what is asked."
    elif count == 1:
        does = (
            f"Of the {tried} kinds of machines that were tried {best.kind} alone does what is "
            "asked."
        )
    else:
        every = "Both" if tried == 2 else f"All {tried}"
        many = every if count == tried else f"{count} of the {tried}"
        does = (
            f"{many} kinds of machines that were tried do what is asked; {best.kind} has the "
            f"least {first}."
        )
    return [
        does,
        f"Drives: {best.drive_text}. Margins over what is asked: {best.margin_text}.",
    ]


def next_steps(choice: Choice, serving: list[Candidate]) -> list[str]:
    """Return the next steps after a choice, a sentence each."""
    if not serving:
        return [
            "See below what each kind misses by how much: ask for less of that, or give stronger "
            "motors under [motors]; then run the command again in another folder.",
        ]
    file = f"{serving[0].kind}.toml"
    motor_steps = [] if choice.job.motors.list else ["Put motors that you can buy under [motors]."]
    return [
        *motor_steps,
        f"pteron report {file} --out report shows the machine, pteron view {file} moves it.",
        f"pteron size {file} sizes its drives over your own cycles.",
    ]


def picture(candidate: Candidate) -> Figure:
    """Return the picture of a machine, its tool in the middle of its workspace."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / f"{candidate.kind}.toml"
        file.write_text(candidate.robot, encoding="utf-8")
        robot = load(file)
    return draw(robot, candidate.middle)


def page(choice: Choice) -> str:
    """Return the page as self-contained HTML."""
    serving = [candidate for candidate in choice.candidates if candidate.serves]
    headings = list(dict.fromkeys(key for candidate in serving for key in candidate.figure_texts))
    figure = None
    if len(serving) > 1 or any(len(candidate.front) > 1 for candidate in serving):
        first, second = list(serving[0].front[0])[:2]
        fronts = {
            candidate.kind: np.array([list(p.values())[:2] for p in candidate.front])
            for candidate in serving
        }
        units = [OBJECTIVES[name] or "as in the lists" for name in (first, second)]
        figure = fronts_figure(fronts, [first, second], units)
    return template("design/choice.html.j2").render(
        choice=choice,
        serving=serving,
        reasons=reasons(choice, serving),
        steps=next_steps(choice, serving),
        others=[candidate for candidate in choice.candidates if not candidate.serves],
        headings=headings,
        asked=choice.job.requirement_lines(),
        assumed=choice.assumption_lines(),
        figure=figure,
        pictures={candidate.kind: picture(candidate) for candidate in serving},
    )
