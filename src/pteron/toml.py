"""TOML files, read and checked against pydantic models; one message lists a file's faults.

`read_toml` returns a file's content, `to_model` makes an object of it, `table_keys` has the keys
that it may have. A file that could exhaust memory or time (huge, deeply nested, keys of very many
parts) is refused.
"""

from __future__ import annotations

import errno
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pteron.errors import ModelError, PteronError, shorten

if TYPE_CHECKING:
    from pydantic import ValidationError

_Model = TypeVar("_Model")
_Node = dict[str, Any]

_BEYOND = 1 << 63
"""TOML has whole numbers of 64 bits; larger ones do not fit into a float either."""

_SNIFFED = 4096
"""Characters in which another language shows."""

_TAGS = {"robot": "URDF", "mujoco": "MJCF", "sdf": "SDF", "kdl": "KDL", "COLLADA": "COLLADA"}
"""Root elements of robot descriptions in XML."""

_LARGEST = 1 << 24
"""Bytes that a file may have: 16 MiB."""

_PARTS = 16
"""Parts that a dotted key, `a.b.c`, may have."""

_MANY = 20
"""Faults that one message lists; of more it tells the number."""

_BOUNDS = {
    "greater_than": "above",
    "greater_than_equal": "of at least",
    "less_than": "below",
    "less_than_equal": "of at most",
}
"""Words of messages for pydantic's kinds of fault."""

_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")
"""Pydantic's kinds of fault for a key that a table has not."""

_WORDS = {
    "number": "a number",
    "integer": "a whole number",
    "string": "a text",
    "boolean": "true or false",
    "object": "a table",
}
"""Words of messages for the types of a JSON schema."""

# Strings and comments are blanked before long keys are sought: dots in them are no keys.
_STRING_OR_COMMENT = re.compile(
    r'"""[^"\\]*(?:(?:\\.|"{1,2}(?!"))[^"\\]*)*"""'
    r"|'''.*?'''"
    r'|"[^"\\\n]*(?:\\.[^"\\\n]*)*"'
    r"|'[^'\n]*'"
    r"|#[^\n]*",
    re.DOTALL,
)
_DECIMAL_COMMA = re.compile(
    r"^[ \t]*[\w.-]+[ \t]*=[ \t]*([+-]?\d+,\d+)[ \t]*(?:#.*)?\r?$", re.MULTILINE
)
"""A line that gives a key a number with a decimal comma."""

_LONG_KEY = re.compile(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{_PARTS}}}")


def read_toml(path: str | Path, error: type[PteronError], absent: str) -> dict[str, Any]:
    """Return the content of a TOML file as a dictionary.

    `error` is the class of error to raise, `absent` its message if there is no such file.

    Raises
    ------
    PteronError
        If the file cannot be read, or as `parsed_toml`.
    """
    return parsed_toml(*toml_bytes(path, error, absent), error)


def toml_bytes(path: str | Path, error: type[PteronError], absent: str) -> tuple[bytes, str]:
    """Return the bytes of a TOML file (up to a maximum size), and its name for messages.

    Raises
    ------
    PteronError
        If the file cannot be read; see `read_toml`.
    """
    source = shorten(str(path), bare=True, longest=1000) or "''"
    try:
        expect_regular(Path(path))
        with Path(path).open("rb") as file:
            return file.read(_LARGEST + 1), source
    except (FileNotFoundError, ValueError):  # ValueError: a NUL in the name
        raise error(absent, subject=source) from None
    except OSError as reason:
        raise error(f"cannot be read ({reason.strerror or reason})", subject=source) from None


def expect_regular(path: Path) -> None:
    """Raise if a path is a FIFO or device, whose reading may never end.

    Raises
    ------
    OSError
        If it is one, as if the system had refused to read it.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        raise OSError(errno.EINVAL, "it is a pipe or a device, not a file")


def language_of(text: str) -> str:
    """Return which other language (URDF, JSON, YAML ...) a text is written in, or ''.

    Examples
    --------
    >>> from pteron.toml import language_of
    >>> language_of('<?xml version="1.0"?><robot name="r">'), language_of("name = 1")
    ('URDF', '')
    """
    start = text.lstrip("\ufeff \t\r\n")[:_SNIFFED]
    if start.startswith("<"):
        dialect = next((name for tag, name in _TAGS.items() if re.search(rf"<{tag}\b", start)), "")
        return dialect or "XML"
    if start.startswith("{"):
        return "JSON"
    return "YAML" if start.startswith(("%YAML", "---\n", "---\r\n")) else ""


def _integers(node: Any) -> Iterator[int]:
    """Yield all integers in a nested document."""
    if isinstance(node, bool):
        return
    if isinstance(node, int):
        yield node
    elif isinstance(node, dict | list):
        for part in node.values() if isinstance(node, dict) else node:
            yield from _integers(part)


def parsed_toml(content: bytes, source: str, error: type[PteronError]) -> dict[str, Any]:
    """Return the content of a TOML text as a dictionary; messages call it `source`.

    Raises
    ------
    PteronError
        If it is not TOML, or could exhaust memory or time: too large, nested too deeply, with keys
        of very many parts or numbers of thousands of digits.
    """
    if len(content) > _LARGEST:
        raise error(
            f"has over {_LARGEST >> 20} MB; a TOML file of settings is short", subject=source
        )
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise error("not a TOML file (it is not UTF-8 text)", subject=source) from None
    # The parser's time and memory grow with the square of a dotted key's length.
    if long := _LONG_KEY.search(_STRING_OR_COMMENT.sub("_", text)):
        start = shorten(long[0], bare=True, longest=20)
        raise error(
            f"not a file of settings (the key {start} has over {_PARTS} parts); mend it",
            subject=source,
        )
    if language := language_of(text):
        raise error(
            f"this is {language}, not TOML; pteron new --help says how to begin a file",
            subject=source,
        )
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as fault:
        reason = shorten(str(fault), bare=True, longest=200)
        if comma := _DECIMAL_COMMA.search(text):
            reason += f"; {comma[1]} has a decimal comma, write a point"
    except RecursionError:
        reason = "its brackets are nested too deeply"
    except ValueError:  # of `int`
        reason = "a number in it has thousands of digits"
    else:
        if all(abs(number) < _BEYOND for number in _integers(document)):
            return document
        reason = "a whole number in it is beyond 64 bits"
    raise error(f"not a TOML file ({reason})", subject=source)


def to_model(
    model: type[_Model], document: dict[str, Any], source: str, error: type[PteronError]
) -> _Model:
    """Return a document validated as a pydantic model or dataclass; raise with all faults.

    Raises
    ------
    PteronError
        With all faults of the file, each on a line if there is more than one.
    """
    from pydantic import TypeAdapter, ValidationError

    try:
        return TypeAdapter(model).validate_python(document)
    except ValidationError as fault:
        raise error(joined_faults(fault_lines(fault, model)), subject=source) from None


def joined_faults(lines: Sequence[str]) -> str:
    """Return a file's faults as text for an error, one line each, at most `_MANY`."""
    if len(lines) == 1:
        return lines[0]
    remainder = [f"and {len(lines) - _MANY} more"] if len(lines) > _MANY else []
    return "\n  ".join([f"{len(lines)} faults", *lines[:_MANY], *remainder])


def raise_faults(faults: Sequence[str]) -> None:
    """Raise a `ModelError` that lists all faults, if there are any."""
    if faults:
        raise ModelError(joined_faults(faults), faults=faults)


def keep_checked(
    part: object, checks: Mapping[str, Callable[[Any, str], object]], faults: Iterable[str] = ()
) -> None:
    """Replace a frozen dataclass's fields by their checked values; raise with all faults.

    A check is called with a field's value and name. `faults` are reported with those that the
    checks find.

    Raises
    ------
    ModelError
        If there are faults: it lists all of them.
    """
    all_faults = [*faults]
    for name, check in checks.items():
        try:
            object.__setattr__(part, name, check(getattr(part, name), name))
        except ModelError as error:
            all_faults += error.faults
    raise_faults(all_faults)


def fault_lines(
    error: ValidationError, model: Any, listed: set[tuple[str, ...]] | None = None
) -> list[str]:
    r"""Return a line for every pydantic fault: the key, the value, and what is expected.

    `model` is the pydantic model or dataclass that rejected a file's content. Aliases with a dot,
    such as ``"time.unit"``, are understood as keys of tables. A missing key is not reported if an
    unknown key is most similar to it. `listed` collects the lists of valid keys in messages, so
    that a file of several tables has each list once.

    Examples
    --------
    >>> from pydantic import BaseModel, ValidationError
    >>> class Machine(BaseModel, extra="forbid"):
    ...     gravity: tuple[float, float, float]
    ...     legs: list[dict[str, float]]
    >>> try:
    ...     Machine.model_validate({"gravity": 9.81, "legs": [{}, {"mass": "x"}], "nam": "a"})
    ... except ValidationError as error:
    ...     print(*fault_lines(error, Machine), sep="\n")
    gravity: 9.81 given, a list of 3 numbers expected
    legs, item 2: mass: 'x' given, a number expected
    nam: unknown key; the valid ones there are gravity, legs
    """
    schema = _schema(model)
    listed = set() if listed is None else listed
    faults = error.errors(include_url=False)
    meant = {_nearest_key(f["loc"], schema) for f in faults if f["type"] in _UNKNOWN}
    lines = []
    for fault in faults:
        if fault["type"] == "missing" and fault["loc"] in meant:
            continue  # it is there, misspelt
        if fault["type"] == "too_short" and len(fault["input"]) >= fault["ctx"]["min_length"]:
            continue  # some of its items are faults
        location = fault["loc"]
        # What a list of fixed length lacks is a fault of the list.
        if fault["type"] == "missing" and location and isinstance(location[-1], int):
            location = location[:-1]
        key = _key(location)
        lines.append(f"{key}: " * bool(key) + _fault(fault, schema, location, listed))
    return list(dict.fromkeys(lines))


def table_keys(model: Any) -> tuple[str, ...]:
    """Return the top-level keys of the files that a pydantic model describes."""
    return _keys(_schema(model), "")


def _key(location: tuple[int | str, ...]) -> str:
    """Return a value's location in a document as text: "legs, item 2: mass"."""
    key, link = "", ""
    for part in location:
        if isinstance(part, int):
            key += f"{link.replace('.', ', ')}item {part + 1}"
            link = ": "
        else:
            key += link + shorten(part, bare=True)
            link = "."
    return key


def _valid(location: tuple[int | str, ...], schema: _Node) -> tuple[str, tuple[str, ...]]:
    """Return the alias prefix of an unknown key's table, and the table's valid keys."""
    table, dot, _ = str(location[-1]).rpartition(".")
    return table + dot, _keys(_subschema(schema, location[:-1]), table + dot)


def _nearest_key(location: tuple[int | str, ...], schema: _Node) -> tuple[int | str, ...]:
    """Return the location of the valid key most similar to an unknown one; () if none is."""
    table, valid = _valid(location, schema)
    close = get_close_matches(str(location[-1]).removeprefix(table), valid, n=1)
    return (*location[:-1], table + close[0]) if close else ()


def _fault(
    fault: Any, schema: _Node, location: tuple[int | str, ...], listed: set[tuple[str, ...]]
) -> str:
    """Return the message of a pydantic fault: the value, and what is expected.

    `listed` has the lists of valid keys that an earlier fault of the file named.
    """
    kind, shown_input, context = fault["type"], shorten(fault["input"]), fault.get("ctx", {})
    if kind == "value_error":
        return str(context["error"])
    if kind in _UNKNOWN:
        table, valid = _valid(location, schema)
        if location[-1] in valid:
            return f"{shown_input} given, a table expected"
        meant = _nearest_key(location, schema)
        guess = f" did you mean {str(meant[-1]).removeprefix(table)}?" if meant else ""
        if valid in listed:
            return f"unknown key;{guess or ' the valid ones there are listed above'}"
        listed.add(valid)
        the = " The" if guess else " the"
        return f"unknown key;{guess}{the} valid ones there are {', '.join(valid)}"
    node = _subschema(schema, location)
    if kind == "list_type" and isinstance(fault["input"], dict):
        key = ".".join(str(part) for part in location)
        return f"[{key}] is one table, a list of tables expected; write [[{key}]] above each"
    expected = _words(node)
    is_key = all(isinstance(part, str) for part in location)
    if expected == "a table" and is_key and not isinstance(fault["input"], dict):
        key = ".".join(str(part) for part in location)
        keys = ", ".join(_keys(node, ""))
        return f"{shown_input} given, a table expected: [{key}]{f' with {keys}' if keys else ''}"
    if kind in ("too_short", "too_long") and "prefixItems" not in node:
        least, most = context.get("min_length"), context.get("max_length")
        count = f"at least {least}" if kind == "too_short" else f"at most {most}"
        return f"{shown_input} given, {expected} expected, {count} of them"
    if kind == "missing" and fault["loc"] == location:
        return f"missing; the file must give {expected or 'it'}"
    if kind in _BOUNDS:
        expected = f"a number {_BOUNDS[kind]} {next(iter(context.values())):g}"
    elif kind == "finite_number":
        expected = "a finite number"
    elif kind == "literal_error":
        expected = context["expected"]
    if not expected:
        return f"{shown_input} given; {fault['msg'][0].lower()}{fault['msg'][1:]}"
    return f"{shown_input} given, {expected} expected"


def _schema(model: Any) -> _Node:
    """Return the JSON schema of a pydantic model, with all references resolved."""
    from pydantic import TypeAdapter

    schema = TypeAdapter(model).json_schema(by_alias=True)

    def resolve_reference(node: Any) -> Any:
        """Return a JSON schema node with references resolved and null alternatives dropped."""
        if isinstance(node, list):
            return [resolve_reference(member) for member in node]
        if not isinstance(node, dict):
            return node
        if "$ref" in node:
            return resolve_reference(schema["$defs"][node["$ref"].rpartition("/")[2]])
        others = [member for member in node.get("anyOf", []) if member.get("type") != "null"]
        if len(others) == 1:
            return resolve_reference(others[0])
        return {key: resolve_reference(member) for key, member in node.items() if key != "$defs"}

    expanded: _Node = resolve_reference(schema)
    return expanded


def _subschema(node: _Node, location: tuple[int | str, ...]) -> _Node:
    """Return the part of a JSON schema that describes the value at a location."""
    for part in location:
        inner: Any
        if isinstance(part, int):
            several = node.get("prefixItems", [])
            inner = several[part] if part < len(several) else node.get("items")
        else:
            inner = node.get("properties", {}).get(part, node.get("additionalProperties"))
        node = inner if isinstance(inner, dict) else {}
    return node


def _keys(node: _Node, table: str) -> tuple[str, ...]:
    """Return the valid keys of a table in a JSON schema, without their alias prefix `table`."""
    inner = (k.removeprefix(table) for k in node.get("properties", {}) if k.startswith(table))
    return tuple(dict.fromkeys(name.partition(".")[0] for name in inner))


def _words(node: _Node) -> str:
    """Return a phrase for the values that a JSON schema allows ("a list of 3 numbers"), or ''."""
    if node.get("type") != "array":
        return _WORDS.get(node.get("type", ""), "")
    several = node.get("prefixItems", [])
    element = _words(several[0] if several else node.get("items", {}))
    count = f"{len(several)} " if several else ""
    element = element.removeprefix("a ")
    if element.startswith("list"):
        return f"a list of {count}lists{element.removeprefix('list')}"
    return f"a list of {count}{element}{'s' * (len(several) != 1)}" if element else "a list"
