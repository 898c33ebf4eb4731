"""Shell completion of arguments: names of machines, files, parameters, functions and indices."""

from __future__ import annotations

from pathlib import Path

from typer import Context

from pteron.cli.exported_functions import FUNCTIONS
from pteron.errors import PteronError


def machines(incomplete: str) -> list[str]:
    """Return the names of the catalog and the TOML files that begin with the typed text.

    Where there is none the shell goes on with the names of all files and folders.
    """
    from pteron.manipulator import catalog

    folder, _, _ = incomplete.rpartition("/")
    head = f"{folder}/" if "/" in incomplete else ""
    try:
        files = sorted(path.name for path in Path(head or ".").glob("*.toml"))
    except (OSError, ValueError):
        files = []
    names = [*catalog(), *(f"{head}{name}" for name in files)]
    return [name for name in names if name.startswith(incomplete)]


def functions(incomplete: str) -> list[str]:
    """Return the functions that can be exported whose names begin with the typed text."""
    return [name for name in FUNCTIONS if name.startswith(incomplete)]


def indices(ctx: Context, incomplete: str) -> list[str]:
    """Return the machine's performance indices whose names begin with the typed text."""
    from pteron.indices import INDICES, indices_of
    from pteron.manipulator import load

    robot = ctx.params.get("robot") or next(iter(ctx.args), "")
    try:
        names = indices_of(load(robot))
    except PteronError:
        names = tuple(INDICES)
    return [name for name in (*names, "margin") if name.startswith(incomplete)]


def parameters(ctx: Context, incomplete: str) -> list[str]:
    """Return inertial parameters of the machine that was named; the last of a list is completed."""
    from pteron.manipulator import load, parameter_names

    done, comma, last = incomplete.rpartition(",")
    # Where what is completed is an option's value, what stands before it is not parsed yet.
    robot = ctx.params.get("robot") or next(iter(ctx.args), "")
    try:
        names = parameter_names(load(robot))
    except PteronError:
        return []
    listed = done.split(",")
    return [f"{done}{comma}{n}" for n in names if n.startswith(last) and n not in listed]
