"""The directive `command-line`: every subcommand of `pteron`, as its own help says it."""

from __future__ import annotations

import re
from itertools import chain
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from typer.main import get_command

from pteron.cli.main import app as program

_STYLE = re.compile(r"\[/?(?:bold|dim|italic|cyan|green|yellow)\]")
_SPECIAL = re.compile(r"([|<>*_`\[\]$])")


def plain(text: str) -> str:
    """Return a help text in one line of Markdown, without the terminal's markup."""
    return _SPECIAL.sub(r"\\\1", " ".join(_STYLE.sub("", text).split()))


def _rows(command: Any, name: str) -> list[tuple[str, str]]:
    """Return what can be given to a subcommand, and what each is."""
    context = command.make_context(f"pteron {name}", [], resilient_parsing=True)
    records = (parameter.get_help_record(context) for parameter in command.params)
    return [(call.replace(" <str>", ""), text) for call, text in filter(None, records)]


def section(command: Any, name: str) -> list[str]:
    """Return the lines of a subcommand in Markdown."""
    told = [plain(part) for part in (command.help or "").split("\n\n")]
    lines = [f"## `pteron {name}`", "", *chain.from_iterable((part, "") for part in told)]
    lines += ["| given | what it is |", "| --- | --- |"]
    lines += [
        f"| `{call.replace('|', chr(92) + '|')}` | {plain(text)} |"
        for call, text in _rows(command, name)
    ]
    shown = [_STYLE.sub("", line).strip() for line in (command.epilog or "").splitlines()]
    examples = [f"$ {line}" for line in shown if line.startswith("pteron")]
    return [*lines, "", *(["```console", *examples, "```", ""] if examples else [])]


class CommandLine(SphinxDirective):
    """Show every subcommand."""

    def run(self) -> list[nodes.Node]:
        """Return the sections."""
        self.env.note_reread()
        group: Any = get_command(program)
        parts = (section(command, name) for name, command in group.commands.items())
        text = "\n".join(chain.from_iterable(parts))
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.add_directive("command-line", CommandLine)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
