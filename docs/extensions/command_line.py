"""The subcommands of `pteron`, as their own help describes them: a list, and pages by panel."""

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
    lines += ["| argument or option | meaning |", "| --- | --- |"]
    lines += [
        f"| `{call.replace('|', chr(92) + '|')}` | {plain(text)} |"
        for call, text in _rows(command, name)
    ]
    shown = [_STYLE.sub("", line).strip() for line in (command.epilog or "").splitlines()]
    examples = [f"$ {line}" for line in shown if line.startswith("pteron")]
    return [*lines, "", *(["```console", *examples, "```", ""] if examples else [])]


def panels() -> dict[str, dict[str, Any]]:
    """Return the subcommands by the panel of the program's help."""
    group: Any = get_command(program)
    found: dict[str, dict[str, Any]] = {}
    for name, command in group.commands.items():
        found.setdefault(command.rich_help_panel, {})[name] = command
    return found


def page_of(panel: str) -> str:
    """Return the name of a panel's page."""
    return panel.lower().replace(" ", "-")


def write_pages(app: Sphinx) -> None:
    """Write a page for each panel, where it has changed."""
    folder = app.srcdir / "reference" / "commands"
    folder.mkdir(exist_ok=True)
    wanted = {f"{page_of(panel)}.md": panel for panel in panels()}
    for old in folder.glob("*.md"):
        if old.name not in wanted:
            old.unlink()
    for name, panel in wanted.items():
        commands = ", ".join(f"`{command}`" for command in panels()[panel])
        text = (
            f"# Commands: {panel[0].lower()}{panel[1:]}\n\nThis page describes the subcommands "
            f"{commands} of `pteron`. [All commands](../command-line.md)\n\n"
            f"```{{command-panel}} {panel}\n```\n"
        )
        path = folder / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


class CommandPanel(SphinxDirective):
    """Show the subcommands of a panel."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        """Return the sections."""
        self.env.note_reread()
        commands = panels()[self.arguments[0]]
        parts = (section(command, name) for name, command in commands.items())
        text = "\n".join(chain.from_iterable(parts))
        return self.parse_text_to_nodes(text, allow_section_headings=True)


class CommandList(SphinxDirective):
    """List the subcommands by panel, with links to their pages."""

    def run(self) -> list[nodes.Node]:
        """Return a table for each panel, and the pages as children of this one."""
        self.env.note_reread()
        lines: list[str] = []
        for panel, commands in panels().items():
            lines += [f"## {panel}", "", "| command | what it does |", "| --- | --- |"]
            for name, command in commands.items():
                link = f"[`pteron {name}`](commands/{page_of(panel)}.md#pteron-{name})"
                lines.append(f"| {link} | {plain(command.help.split(chr(10) * 2)[0])} |")
            lines.append("")
        pages = [f"commands/{page_of(panel)}" for panel in panels()]
        lines += ["```{toctree}", ":hidden:", "", *pages, "```"]
        return self.parse_text_to_nodes("\n".join(lines), allow_section_headings=True)


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.connect("builder-inited", write_pages)
    app.add_directive("command-panel", CommandPanel)
    app.add_directive("command-list", CommandList)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
