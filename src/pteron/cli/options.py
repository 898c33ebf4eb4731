"""Arguments and options of a subcommand, made from its parameters and its docstring.

A section of the docstring is a panel of the help, and a line in it an option or an argument, or
the name of an option that several subcommands share::

    --speed NUMBERS: Of the joints, m/s or rad/s. [default: the drives']

with the word that stands for its value and, where that is no value, the default. The parameter has
the same name, with an underscore behind it where Python has another use for the name. Positional
parameters are arguments, those that are given by keyword only are options.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, cleandoc, signature
from typing import Annotated, Any, get_type_hints

from typer import Argument, Context, Option

from pteron.cli import completion
from pteron.cli.arguments import MachineArgument, load_robot
from pteron.cli.exported_functions import FUNCTIONS
from pteron.cli.motion_argument import Carried
from pteron.cli.result import CommandResult

_SECTION = re.compile(r"\n\n(\w+)\n-+\n")
_LINE = re.compile(r"(\S+?)(?:, (-\w))?(?: (\S+))?: (.*?)(?: \[default: (.*)\])?$")

_OPTIONS = ("Arguments", "Options")
"""Sections whose options stand in the help's first panels."""

_SHARED = f"""\
ROBOT: A machine of the catalog (see pteron catalog) or a TOML file.
--table FILE: Read the rows of a .csv or .parquet file; - reads CSV from standard input.
--out FILE: Write the result to a .csv or .parquet file.
--elbows SIGNS: Working mode: the side to which each leg bends, one sign a leg, such as ++-+, or
    two for each PRUR leg. [default: the file's]
--on-failure: Stop at a row that fails (raise), or leave its results empty (nan).
--payload MASS@X,Y,Z: Payload of the platform: its mass, kg, such as 0.5, at the tool's centre
    point; its centre of mass in the platform's frame, m, as in 0.5@0,0,-0.03; and its moment of
    inertia about that, kg m^2, as in 0.5@0,0,-0.03@2e-4. [default: none]
--pivot X,Y,Z: Point of the platform that poses refer to, in the platform's frame, m, such as the
    head of a rider; angles turn the platform about it. [default: P, the platform's own]
--tool NAME: Mount a tool that the machine's file lists under tools.
--cycle CYCLE: adept, the standard pick-and-place cycle, or the table of a motion.
--duration: Duration of the standard cycle, s. [default: tool acceleration up to 10 m/s^2]
--scheduler ADDRESS: Address of a Dask cluster that does the work, tcp://host:8786; it does not
    authenticate its clients.
--function NAME: Function to write; repeat for several: {", ".join(FUNCTIONS)}.
--json: Print the result as JSON, for programs.
"""
"""Options that several subcommands share, and those whose help is more than text."""

_COMPLETION = {
    **dict.fromkeys(("ROBOT", "KIND", "FILE", "SPEC", "--robot", "--model"), completion.machines),
    "--index": completion.indices,
    "--keep": completion.parameters,
    "--function": completion.functions,
}


def parsed_command(
    command: Callable[..., CommandResult | None], *, general: bool = False
) -> Callable[..., None]:
    """Return the function from which Typer makes a subcommand.

    Its `machine` is loaded from ROBOT in the working mode of --elbows, what it carries is read from
    --payload and --tool, and its result is printed for a person or, with --json, for a program.
    A parameter whose type is a dataclass stands for an option for each of its fields. A `general`
    command builds and compiles functions for a topology, not for a machine.
    """
    hints, arguments = get_type_hints(command), signature(command).parameters
    options: dict[str, Parameter] = {}
    groups = {name: hints[name] for name in arguments if _is_group(hints[name])}
    for name, argument in arguments.items():
        if hints[name] is MachineArgument:
            options["robot"] = argument.replace(name="robot", annotation=str)
        elif hints[name] is Carried:
            options |= {each: _option(each, str | None) for each in ("payload", "tool")}
        elif name in groups:
            kinds = get_type_hints(groups[name])
            options |= {
                field.name: _option(field.name, kinds[field.name], default=field.default)
                for field in fields(groups[name])
            }
        else:
            options[name] = argument.replace(annotation=hints[name])
    if "machine" in arguments:
        options.setdefault("elbows", _option("elbows", str | None))
    options.setdefault("json", _option("json", bool, default=False))

    @wraps(command)
    def run(**chosen: Any) -> None:
        """Run the command with the values of its options and the machine of its file, if any."""
        passed = {name: argument for name, argument in chosen.items() if name in arguments}
        if "before" in vars(command):  # a missing extra is told before a machine is read
            vars(command)["before"](passed)
        if "carried" in arguments:
            passed["carried"] = Carried.from_options(chosen["payload"], chosen["tool"])
        for name, group in groups.items():
            passed[name] = group(**{field.name: chosen[field.name] for field in fields(group)})
        if "machine" in arguments:
            quiet = "warns" in vars(command)  # the command tells the file's warnings itself
            passed["machine"] = load_robot(chosen["robot"], chosen["elbows"], quiet=quiet)
        with _share_programs() if general else nullcontext():
            outcome = command(**passed)
            if outcome is not None:
                outcome.tell(as_json=chosen["json"])

    run.__dict__["__signature__"] = Signature(list(options.values()))
    run.__annotations__ = {name: option.annotation for name, option in options.items()}
    return run


def _share_programs() -> AbstractContextManager[None]:
    """Return a context in which machines of equal structure share their compiled programs."""
    from pteron.kernels import sharing_programs

    return sharing_programs()


def _is_group(hint: Any) -> bool:
    """Return whether a parameter's type is a group of options."""
    return isinstance(hint, type) and is_dataclass(hint) and hint not in (MachineArgument, Carried)


def _option(name: str, kind: Any, *, default: Any = None) -> Parameter:
    """Return a keyword-only parameter of a signature, from which Typer makes an option."""
    return Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=kind)


def help_of(command: Callable[..., None]) -> dict[str, Any]:
    """Set the Typer options of a command's parameters; return its help and its epilog."""
    text, *sections = _SECTION.split(cleandoc(command.__doc__ or ""))
    parts = dict(zip(sections[::2], sections[1::2], strict=True))
    examples = parts.pop("Examples", "")
    help_by_name: dict[str, dict[str, Any]] = {}
    for title, lines in [("Options", _SHARED), *parts.items()]:
        for line in re.sub(r"\n +", " ", lines).splitlines():
            # An option that several subcommands share stands in a panel by its name alone.
            name, about = (line, help_by_name[line]) if line in help_by_name else _read(line)
            help_by_name[name] = about if title in _OPTIONS else about | {"rich_help_panel": title}
    hints, options = get_type_hints(command), []
    for name, parameter in signature(command).parameters.items():
        key, kind = name.rstrip("_").replace("_", "-"), hints[name]
        if parameter.kind is parameter.KEYWORD_ONLY:
            about = dict(help_by_name.get(f"--{key}", {}))
            kind = Annotated[kind, Option(f"--{key}", *about.pop("short", ()), **about)]
        elif kind is not Context:
            kind = Annotated[kind, Argument(**help_by_name.get(key, {}))]
        options.append(parameter.replace(annotation=kind))
    command.__dict__["__signature__"] = Signature(options)
    paragraphs = (" ".join(part.split()) for part in text.split("\n\n"))
    end = "\n\n".join(["[bold]Examples[/bold]", *examples.splitlines()])
    return {"help": "\n\n".join(paragraphs), "epilog": end}


def _read(line: str) -> tuple[str, dict[str, Any]]:
    """Return the name of an argument or option, and the settings for Typer."""
    match = _LINE.match(line)
    assert match is not None, line
    name, short, metavar, text, default = match.groups()
    about: dict[str, Any] = {"help": text, "autocompletion": _COMPLETION.get(name)}
    if not name.startswith("-"):
        return name.lower().rstrip("."), about | {"metavar": name}
    about |= {"metavar": metavar, "show_default": default or True}
    return name, about | ({"short": (short,)} if short else {})
