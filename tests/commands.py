"""Pteron's command line, run in this process: what it prints, and its line where it refuses."""

from __future__ import annotations

import re
import sys
from pathlib import Path

from typer.testing import CliRunner, Result

from pteron.cli.main import app

PROGRAM = [sys.executable, "-c", "from pteron_command import main; main()"]


PLAIN = {"COLUMNS": "60", "NO_COLOR": "1", "FORCE_COLOR": None, "TTY_COMPATIBLE": None}


def run(line: str, stdin: str | None = None, **env: str) -> Result:
    """Run a command line without a shell."""
    return CliRunner(env={**PLAIN, **env}).invoke(app, line.split(), input=stdin)


def done(line: str, stdin: str | None = None, **env: str) -> str:
    """Return the standard output of a command line that must succeed, quietly."""
    result = run(line, stdin, **env)
    assert result.exception is None, result.stderr
    assert (result.exit_code, result.stderr) == (0, "")
    return result.stdout


def refused(line: str, *words: str, stdin: str | None = None) -> str:
    """Return the one line of a command line that must fail, and must leave nothing behind."""
    before = sorted(Path().iterdir())
    result = run(line, stdin)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    assert result.stderr.startswith("Error: ")
    # Lines to paste into a file may follow, from a table's name on.
    assert "\n" not in result.stderr.partition("\n[")[0].removesuffix("\n")
    for word in words:
        assert word in result.stderr
    assert sorted(Path().iterdir()) == before
    return result.stderr


def read(line: str, stdin: str | None = None, **env: str) -> str:
    """Return what a person reads on a terminal, without colours and bold letters."""
    result = run(line, stdin, **env, TTY_COMPATIBLE="1")
    assert result.exit_code == 0, result.output
    return without_styles(result.stdout)


def without_styles(text: str) -> str:
    """Return a terminal's text without colours and bold letters."""
    return re.sub(r"\x1b\[[0-9;]*m", "", text)
