"""The result of a command: the data that `--json` prints, and what a person reads in its place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from typer import Exit

from pteron.cli.terminal import file_lines, show, show_json


@dataclass(frozen=True)
class CommandResult:
    """The result of a command.

    Attributes
    ----------
    data : object
        For a program.
    printout : callable or sequence of str and Table
        For a person: lines and tables, or what prints them.
    files : sequence
        The files that were written, printed after the rest.
    code : int
        The exit code.
    """

    data: Any
    printout: Callable[[], None] | Sequence[Any] = ()
    files: Sequence[object] = ()
    code: int = 0

    def tell(self, *, as_json: bool) -> None:
        """Print the result for a program or for a person, and exit with its exit code."""
        if as_json:
            show_json(self.data)
        elif callable(self.printout):
            self.printout()
            show(*file_lines(*self.files))
        else:
            show(*self.printout, *file_lines(*self.files))
        if self.code:
            raise Exit(self.code)
