"""TOML files, read safely and checked against pydantic models: every fault is told at once."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, Union, get_args, get_origin

from pteron.errors import PteronError, shown

if TYPE_CHECKING:
    from pydantic import ValidationError

Item = Callable[[str, int], str]
"""Names an item of a list: from its key and its number, counted from 1."""

_Model = TypeVar("_Model")

_LARGEST = 1 << 24
_PARTS = 16
_MANY = 20
"""Faults of a file that are told."""

_STRING_OR_COMMENT = re.compile(
    r'"""[^"\\]*(?:(?:\\.|"{1,2}(?!"))[^"\\]*)*"""'
    r"|'''.*?'''"
    r'|"[^"\\\n]*(?:\\.[^"\\\n]*)*"'
    r"|'[^'\n]*'"
    r"|#[^\n]*",
    re.DOTALL,
)
_LONG_KEY = re.compile(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{_PARTS}}}")


def read_toml(path: str | Path, error: type[PteronError], absent: str) -> dict[str, Any]:
    """Return what a TOML file holds.

    Parameters
    ----------
    path : str or path
        The file.
    error : type
        What is raised: a `ModelError` for a manipulator, a `DataError` for a log.
    absent : str
        What the message says if there is no such file.

    Raises
    ------
    PteronError
        If it cannot be read, or as `parsed_toml`.
    """
    source = shown(str(path), bare=True, longest=1000)
    try:
        with Path(path).open("rb") as file:
            data = file.read(_LARGEST + 1)
    except (FileNotFoundError, ValueError):  # ValueError: a NUL in the name
        raise error(f"{source}: {absent}") from None
    except OSError as reason:
        raise error(f"{source}: cannot be read ({reason.strerror or reason})") from None
    return parsed_toml(data, source, error)


def parsed_toml(data: bytes, source: str, error: type[PteronError]) -> dict[str, Any]:
    """Return what a TOML text holds.

    Parameters
    ----------
    data : bytes
        The text in UTF-8; a byte order mark before it is passed over.
    source : str
        What messages call it.
    error : type
        What is raised.

    Raises
    ------
    PteronError
        If it is not TOML, or is not meant to be read: nested too deeply, keys of very many parts,
        numbers of thousands of digits.
    """
    if len(data) > _LARGEST:
        raise error(f"{source}: has over {_LARGEST >> 20} MB; a TOML file of settings is short")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise error(f"{source}: not a TOML file (it is not UTF-8 text)") from None
    # The parser's time and memory grow with the square of a dotted key's length.
    if long := _LONG_KEY.search(_STRING_OR_COMMENT.sub("_", text)):
        start = shown(long[0], bare=True, longest=20)
        raise error(
            f"{source}: not a file of settings (the key {start} has over {_PARTS} parts); mend it"
        )
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as fault:
        reason = shown(str(fault), bare=True, longest=200)
    except RecursionError:
        reason = "its brackets are nested too deeply"
    except ValueError:  # of `int`
        reason = "a number in it has thousands of digits"
    raise error(f"{source}: not a TOML file ({reason})")


def validated(
    model: type[_Model],
    document: dict[str, Any],
    source: str,
    error: type[PteronError],
    item: Item | None = None,
) -> _Model:
    """Return what a document says as an instance of a pydantic model.

    Parameters
    ----------
    model : type
        A pydantic model or dataclass.
    document : dict
        What the file holds.
    source : str
        What messages call the file.
    error : type
        What is raised.
    item : callable, optional
        Names an item of a list; see `fault_lines`.

    Raises
    ------
    PteronError
        With all faults of the file, each on a line if there is more than one.
    """
    from pydantic import TypeAdapter, ValidationError

    try:
        return TypeAdapter(model).validate_python(document)
    except ValidationError as fault:
        raise error(told(source, fault_lines(fault, model, item))) from None


def told(source: str, lines: list[str]) -> str:
    """Return the message of a file's faults."""
    if len(lines) == 1:
        return f"{source}: {lines[0]}"
    more = [f"and {len(lines) - _MANY} more"] if len(lines) > _MANY else []
    return "\n  ".join([f"{source}: {len(lines)} faults", *lines[:_MANY], *more])


def fault_lines(error: ValidationError, model: Any, item: Item | None = None) -> list[str]:
    r"""Return a line for every fault that pydantic found: the key, what was given and expected.

    Parameters
    ----------
    error : ValidationError
        Of a file's content.
    model : type
        The pydantic model or dataclass that refused it. Aliases with a dot, such as
        ``"time.unit"``, are understood as keys of tables.
    item : callable, optional
        Returns what an item of a list is called, from its key and its number, counted from 1:
        ``("legs", 2)`` to ``"leg 2"``. By default ``"legs, item 2"``.

    Examples
    --------
    >>> from pydantic import BaseModel, ValidationError
    >>> class Machine(BaseModel, extra="forbid"):
    ...     gravity: tuple[float, float, float]
    ...     legs: list[dict[str, float]]
    >>> try:
    ...     Machine.model_validate({"gravity": 9.81, "legs": [{}, {"mass": "x"}], "nam": "a"})
    ... except ValidationError as error:
    ...     lines = fault_lines(error, Machine, lambda key, number: f"leg {number}")
    >>> print(*lines, sep="\n")
    gravity: 9.81 given, a list of 3 numbers expected
    leg 2: mass: 'x' given, a number expected
    nam: unknown key; the valid ones there are gravity, legs
    """
    lines = []
    for fault in error.errors(include_url=False):
        location = fault["loc"]
        # What a list of fixed length lacks is a fault of the list.
        if fault["type"] == "missing" and location and isinstance(location[-1], int):
            location = location[:-1]
        key = _key(location, item)
        line = f"{key}: {_fault(fault, model, location)}" if key else _fault(fault, model, location)
        if line not in lines:
            lines.append(line)
    return lines


def _key(location: tuple[int | str, ...], item: Item | None) -> str:
    key = ""
    for part in location:
        if not isinstance(part, int):
            key += ("" if not key or key.endswith(": ") else ".") + shown(part, bare=True)
        elif item is None:
            key += f", item {part + 1}"
        else:
            before, _, last = key.rpartition(": ")
            named = item(last, part + 1)
            key = f"{before}: {named}: " if before else f"{named}: "
    return key.removesuffix(": ")


def _fault(fault: Any, model: Any, location: tuple[int | str, ...]) -> str:
    kind, given = fault["type"], shown(fault["input"])
    context = fault.get("ctx", {})
    if kind == "value_error":
        return str(context["error"])
    if kind in ("extra_forbidden", "unexpected_keyword_argument"):
        table, _, _ = str(location[-1]).rpartition(".")
        valid = table_keys(_type_at(model, location[:-1]), table)
        if location[-1] in valid:
            return f"{given} given, a table expected"
        return f"unknown key; the valid ones there are {', '.join(valid)}"
    expected = _expected(_type_at(model, location))
    if kind == "missing" and fault["loc"] == location:
        return f"missing; the file must give {expected or 'it'}"
    bounds = {"greater_than": "above", "greater_than_equal": "of at least", "less_than": "below"}
    if kind in bounds:
        expected = f"a number {bounds[kind]} {next(iter(context.values())):g}"
    elif kind == "finite_number":
        expected = "a finite number"
    elif kind == "literal_error":
        expected = context["expected"]
    if not expected:
        return f"{given} given; {fault['msg'][0].lower()}{fault['msg'][1:]}"
    return f"{given} given, {expected} expected"


def table_keys(model: Any, table: str = "") -> list[str]:
    """Return the keys of a model, or of one of its tables where its aliases have dots."""
    before = f"{table}." if table else ""
    names = [name for name, _ in _fields(model) if name.startswith(before)]
    return list(dict.fromkeys(name.removeprefix(before).partition(".")[0] for name in names))


def _fields(model: Any) -> Iterator[tuple[str, Any]]:
    """Yield the keys that a pydantic model or dataclass takes, with their types."""
    fields = getattr(model, "model_fields", None) or getattr(model, "__pydantic_fields__", {})
    for name, field in fields.items():
        alias = field.validation_alias or field.alias or name
        for key in getattr(alias, "choices", [alias]):
            yield key, field.annotation


def _type_at(model: Any, location: tuple[int | str, ...]) -> Any:
    """Return the type that a model expects at a location, None where it is not known."""
    kind = _plain(model)
    for part in location:
        arguments = get_args(kind)
        if not isinstance(part, int):
            kind = dict(_fields(kind)).get(part, arguments[-1] if arguments else None)
        elif get_origin(kind) is tuple and Ellipsis not in arguments:
            kind = arguments[part] if part < len(arguments) else None
        else:
            kind = arguments[0] if arguments else None
        kind = _plain(kind)
    return kind


def _plain(kind: Any) -> Any:
    """Return a type without its annotations, and without None beside it."""
    while True:
        if get_origin(kind) is Annotated:
            kind = get_args(kind)[0]
        elif get_origin(kind) in (Union, UnionType):
            others = [one for one in get_args(kind) if one is not NoneType]
            if len(others) > 1:
                return kind
            kind = others[0]
        else:
            return kind


def _expected(kind: Any) -> str:
    """Return the words for a type; empty where there are none."""
    words = {float: "a number", int: "a whole number", str: "a text", bool: "true or false"}
    if kind in words:
        return words[kind]
    if get_origin(kind) in (tuple, list):
        arguments = get_args(kind)
        fixed = get_origin(kind) is tuple and Ellipsis not in arguments
        singular = _expected(_plain(arguments[0])).removeprefix("a ")
        several = f" of {f'{len(arguments)} ' if fixed else ''}{singular}s" if singular else ""
        return f"a list{several}"
    return "a table" if get_origin(kind) is dict or any(_fields(kind)) else ""
