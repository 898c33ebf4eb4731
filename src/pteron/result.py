"""`Result`: what the results of all functions share, so that each is compared and shown alike."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np

if TYPE_CHECKING:
    import polars as pl
    from numpy.typing import NDArray

    from pteron.html_table import Overview

_LINE = 96
"""Most characters of a line that stands for a result."""

_FEW = 6
"""Most numbers of an array that a line has; of a longer one it has the shape."""

_HEADINGS = {"time": "t"}
"""Headings of columns that are not the fields' names; logs and motions are read with them."""

_POSES = ("center", "counterexample", "poses", "best_pose")
"""Fields of poses, other than `pose`."""


class NamedColumns(Protocol):
    """A machine as tables need it: the names of its columns."""

    @property
    def column_names(self) -> dict[str, tuple[str, ...]]:
        """Names of table columns by quantity: "pose", "joints" and so on."""


class Result:
    """The result of a function, with its figures as fields: a frozen dataclass.

    Results are equal if they are of one class and all fields are, arrays element by element, NaN
    as NaN; equal results have equal hashes. Their classes are dataclasses with ``frozen=True,
    eq=False, repr=False``.
    """

    SHOWN: ClassVar[str] = ""
    """The attributes that are shown, with a space between; all fields where it is empty."""

    ROWS: ClassVar[str] = ""
    """The attributes that are columns of `table`, with a space between: "name", or "name:k" where
    a row is an array of k axes. Where it is empty the table has one row; where it is a result, that
    one's table is this one's."""

    def as_dict(self) -> dict[str, Any]:
        """Return the result's fields as plain data in SI units; a machine becomes its name."""
        return {name: _plain(part) for name, part in _shown_parts(self)}

    def summary(self) -> str:
        """Return the result's fields as lines of text."""
        parts = [(name.replace("_", " "), part) for name, part in _shown_parts(self)]
        return "\n".join(line for name, part in parts for line in _lines(name, part))

    def table(self) -> pl.DataFrame:
        """Return the result as a table whose columns functions accept instead of arrays.

        Columns of poses and joints have the names of `Manipulator.column_names`, SI units and
        radians; those of a result without a machine are numbered, see `table_for`.
        """
        proof = getattr(self, "proof", None)
        return self.table_for(getattr(self, "robot", None) or getattr(proof, "robot", None))

    def table_for(self, robot: NamedColumns | None) -> pl.DataFrame:
        """Return the result as a table with the column names of a machine.

        Parameters
        ----------
        robot : Manipulator or None
            The machine; without one columns of poses and joints are numbered.
        """
        import polars as pl

        names = getattr(robot, "column_names", {})
        if not self.ROWS:
            return pl.DataFrame([dict(_row(self, names))])
        columns: dict[str, Any] = {}
        for name, _, axes in (word.partition(":") for word in self.ROWS.split()):
            part = getattr(self, name)
            if isinstance(part, Result):
                return part.table_for(robot)
            if isinstance(part, tuple) and part and isinstance(part[0], Result):
                rows = [dict(_row(each, names)) for each in part]
                headings = dict.fromkeys(heading for row in rows for heading in row)
                columns |= {heading: [row.get(heading) for row in rows] for heading in headings}
            else:
                columns |= _columns(name, np.asarray(part), int(axes or 0), names)
        return pl.DataFrame(columns).with_columns(pl.selectors.float().fill_nan(None))

    def _repr_html_(self) -> str:
        """Return the result as an HTML table, for notebooks."""
        from pteron.html_table import html_table  # Jinja

        return html_table(*self._overview())

    def _overview(self) -> Overview:
        """Return the result's table as an `Overview`, for notebooks."""
        from pteron.html_table import frame_overview

        title, _, about = repr(self)[1:-1].partition(": ")
        return frame_overview(title, about, self.table())

    def __repr__(self) -> str:
        """Return the result's class, machine and main values in one line."""
        robot = getattr(self, "robot", None)
        name = getattr(robot, "name", robot)
        title = f"<{type(self).__name__}" + (f" of {name!r}" if isinstance(name, str) else "")
        texts = (
            f"{name.replace('_', ' ')} {text}"
            for name, part in _shown_parts(self)
            if name != "robot" and (text := _short(part))
        )
        line = f"{title}: {', '.join(texts)}".removesuffix(": ")
        return f"{line if len(line) < _LINE else f'{line[: _LINE - 3]}...'}>"

    def __eq__(self, other: object) -> bool:
        """Return whether another result has the same class and equal fields."""
        return _equal_fields(self, other) if type(self) is type(other) else NotImplemented

    def __hash__(self) -> int:
        """Return a hash that equal results share."""
        # Without the type, whose hash differs from process to process: sets have one order.
        return hash(tuple(_hashable(part) for _, part in _compared_fields(self)))


def _shown_parts(result: Result) -> Iterator[tuple[str, Any]]:
    """Yield the names and values of the attributes that a result shows."""
    names = result.SHOWN.split() or [field.name for field in fields(result)]  # type: ignore[arg-type]
    return ((name, getattr(result, name)) for name in names)


def _compared_fields(result: object) -> Iterator[tuple[str, Any]]:
    """Yield the name and value of each field that equality compares."""
    for field in fields(result):  # type: ignore[arg-type]
        if field.compare:
            yield field.name, getattr(result, field.name)


def _equal_fields(first: object, second: object) -> bool:
    """Return whether two results have equal values in all compared fields."""
    return all(_equal(part, getattr(second, name)) for name, part in _compared_fields(first))


def _equal(first: Any, second: Any) -> bool:
    """Return whether two field values are equal: NaN equals NaN, arrays by elements."""
    if isinstance(first, np.ndarray) or isinstance(second, np.ndarray):
        first, second = np.asarray(first), np.asarray(second)
        both_nan = (first != first) & (second != second) if first.shape == second.shape else False
        return first.shape == second.shape and bool(np.all((first == second) | both_nan))
    if isinstance(first, list | tuple) and isinstance(second, list | tuple):
        return len(first) == len(second) and all(map(_equal, first, second))
    if isinstance(first, Mapping) and isinstance(second, Mapping):
        return first.keys() == second.keys() and all(_equal(first[k], second[k]) for k in first)
    if type(first) is not type(second):
        return bool(first == second)
    if hasattr(first, "equals"):  # a table
        return bool(first.equals(second))
    if is_dataclass(first) and not isinstance(first, Result):
        return first is second or _equal_fields(first, second)
    return bool(first == second or (first != first and second != second))


def _hashable(part: Any) -> Any:
    """Return a hashable key of a field value; equal values have equal keys."""
    if isinstance(part, np.ndarray):
        return part.shape, _hashable(part.flat[0].item()) if part.size else None
    if isinstance(part, list | tuple):
        return tuple(map(_hashable, part))
    if isinstance(part, Mapping):
        return frozenset(part)
    if is_dataclass(part) and not isinstance(part, Result):
        return type(part), tuple(_hashable(each) for _, each in _compared_fields(part))
    try:
        hash(part)
    except TypeError:
        return type(part)
    return "nan" if part != part else part


def _plain(part: Any) -> Any:
    """Return a field value as plain data: dictionaries, lists, numbers and texts."""
    if hasattr(part, "as_dict"):
        return part.as_dict()
    if hasattr(part, "column_names"):  # a machine
        return part.name
    if hasattr(part, "tolist"):
        return part.tolist()
    if isinstance(part, Mapping):
        return {str(key): _plain(each) for key, each in part.items()}
    if isinstance(part, list | tuple):
        return [_plain(each) for each in part]
    if is_dataclass(part):
        return {field.name: _plain(getattr(part, field.name)) for field in fields(part)}
    if part is None or isinstance(part, bool | int | float | str):
        return part
    return getattr(part, "__name__", None) or str(part)


def _short(part: Any) -> str:
    """Return a field value as short text; '' if it has none."""
    if isinstance(part, bool | np.bool_ | str | int | np.integer):
        return str(part)
    if isinstance(part, float | np.floating) or (isinstance(part, np.ndarray) and part.ndim == 0):
        return f"{part:.5g}"
    if isinstance(part, np.ndarray) and (part.ndim != 1 or len(part) > _FEW):
        return f"({', '.join(map(str, part.shape))})"
    if isinstance(part, np.ndarray | list | tuple):
        texts = [_short(each) for each in part[: _FEW + 1]]
        return f"[{', '.join(texts)}]" if len(part) <= _FEW and all(texts) else f"{len(part)}"
    return str(getattr(part, "name", ""))


def _lines(name: str, part: Any) -> list[str]:
    """Return the summary's lines on a field; [] if there is nothing to report."""
    if isinstance(part, Mapping):
        return [line for key, each in part.items() for line in _lines(f"{name}, {key}", each)]
    if isinstance(part, tuple) and part and all(isinstance(text, str) for text in part):
        return [f"{name}:", *(f"  {text}" for text in part)]
    text = repr(part)[1:-1] if isinstance(part, Result) else _short(part)
    return [f"{name}: {text}"] if text else []


def _row(result: Result, names: Mapping[str, Sequence[str]]) -> Iterator[tuple[str, Any]]:
    """Yield (heading, value) cells of a result as one table row."""
    for name, part in _shown_parts(result):
        heading = _HEADINGS.get(name, name)
        if part is None or isinstance(part, bool | str | int | float):
            yield heading, part
        elif isinstance(part, np.generic):
            yield heading, part.item()
        elif isinstance(part, Mapping):
            yield from ((f"{name}_{key}", number) for key, number in part.items())
        elif isinstance(part, np.ndarray) and part.ndim == 1:
            yield from zip(_headings(name, len(part), names), part.tolist(), strict=True)
        elif isinstance(part, tuple) and part and all(isinstance(x, int | float) for x in part):
            yield from zip(_headings(name, len(part), names), part, strict=True)
        elif isinstance(getattr(part, "name", None), str):
            yield heading, part.name


def _columns(
    name: str, part: NDArray[Any], axes: int, names: Mapping[str, Sequence[str]]
) -> dict[str, Any]:
    """Return table columns of an array by name, with its last `axes` axes flattened."""
    if axes == 0:
        return {_HEADINGS.get(name, name): part.ravel()}
    width = int(np.prod(part.shape[part.ndim - axes :]))
    rows = part.reshape(-1, width)
    return dict(zip(_headings(name, width, names), rows.T, strict=True))


def _headings(name: str, count: int, names: Mapping[str, Sequence[str]]) -> Sequence[str]:
    """Return `count` column headings for a field: the machine's names, or numbered ones."""
    named = names.get("pose" if name in _POSES else "joints" if name == "readings" else name, ())
    return named if len(named) == count else [f"{name}_{k}" for k in range(1, count + 1)]
