"""Checks of public functions' arguments against their type hints, before a function runs.

`public.publish` lets `checking` wrap the public functions of a package; classes that a user makes
are decorated with `checked_arguments`.
Machines and arrays of states are checked by the functions, which convert them anyway.
"""

from __future__ import annotations

import collections.abc
import inspect
import math
import operator
import os
import sys
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from functools import cache, update_wrapper
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from pteron.errors import DataError, PteronError, shorten

_CHECKED_LATER = {
    *("RobotLike", "PoseLike", "PoseLike | None", "JointsLike", "JointsLike | None"),
    "OnFailure",
}
"""Type hints of arguments that the functions themselves check, at no cost."""

_LOOKED_AT = 1000
"""Longest sequence whose elements are checked; of longer ones only the type is."""

_LARGEST = 2**63
"""Whole numbers must be smaller in size: they count or index elements of arrays, in 64 bits."""


_Class = TypeVar("_Class")


class Between(NamedTuple):
    """The bounds of a number, both included, as an annotation of its type hint."""

    least: float
    most: float = math.inf


class _Kind(NamedTuple):
    """A kind of argument: its name in messages, and its test."""

    words: str
    holds: Callable[[Any], bool]


def with_checked_arguments(function: types.FunctionType) -> types.FunctionType:
    """Return the function with a check of its arguments against its type hints before each call."""
    hints = {hint for key, hint in function.__annotations__.items() if key != "return"}
    return _add_check(function) if hints - _CHECKED_LATER - {"bool"} else function


def checked_arguments(decorated: type[_Class]) -> type[_Class]:
    """Decorate a class so that its constructor checks arguments against their type hints.

    It is for classes that users construct and that have no checks of their own.
    """
    any_class: Any = decorated
    any_class.__init__ = _add_check(any_class.__init__)
    return decorated


def expect_kinds(
    function: Callable[..., Any], args: tuple[Any, ...], named: Mapping[str, Any]
) -> None:
    """Raise one `DataError` for all arguments that do not match the function's type hints.

    Raises
    ------
    DataError
        If there are some.
    """
    wrong = []
    kinds, order, others = _kinds_of(function)
    names = [*order, *[others] * (len(args) - len(order))]
    arguments = [*zip(names, args, strict=False), *named.items()]
    for name, argument in arguments:
        kind, default = kinds.get(name, (None, None))
        if kind is not None and argument is not default and not kind.holds(argument):
            wrong.append(f"{name}: {shorten(argument)} given, {kind.words} expected")
    if wrong:
        raise DataError("; ".join(wrong))


def expect(holds: object, name: str, actual: object, expected: object) -> None:
    """Raise a `DataError` ("name: actual given, expected expected") unless `holds` is true.

    Parameters
    ----------
    holds : bool
        The condition.
    name, given, wanted : str, object, object
        The argument, what was given, and what is expected.

    Raises
    ------
    DataError
        If it does not hold.

    Examples
    --------
    >>> from pteron.arguments import expect
    >>> expect(-1.0 >= 0.0, "corner", -1.0, "0 m or more")
    Traceback (most recent call last):
    pteron.errors.DataError: corner: -1.0 given, 0 m or more expected
    """
    if not holds:
        raise DataError(f"{name}: {actual} given, {expected} expected")


def expect_share(name: str, share: float) -> None:
    """Raise a `DataError` unless a number is above 0 and below 1.

    Raises
    ------
    DataError
        If it is not, or is NaN.
    """
    expect(0.0 < share < 1.0, name, repr(share), "a share above 0 and below 1")


def number_or_nan(argument: object) -> float:
    """Return the value converted to float; NaN if it is not a number.

    Examples
    --------
    >>> from pteron.arguments import number_or_nan
    >>> number_or_nan(2), number_or_nan("two")
    (2.0, nan)
    """
    try:
        return float(argument)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return float("nan")


def expect_one_of(
    choices: Sequence[str], error: type[PteronError] = DataError, **arguments: object
) -> None:
    """Raise an error for each named argument whose value is not among the choices."""
    for name, argument in arguments.items():
        if argument not in choices:
            raise error(f"{name}: {argument!r} is not one of {', '.join(choices)}")


def expect_to_fit(name: str, count: object, numbers: float) -> None:
    """Raise a `DataError` if `numbers` floats exceed this computer's memory.

    Parameters
    ----------
    name, given : str, object
        The argument that says how many there are, and its value.
    numbers : float
        How many numbers of 8 bytes it takes to hold them.

    Raises
    ------
    DataError
        If they are more than the memory holds.
    """
    if 8.0 * numbers > _memory():
        raise DataError(
            f"{name}: {count} given, which takes {8e-9 * numbers:.3g} GB of memory; this computer "
            f"has {1e-9 * _memory():.3g} GB: give less"
        )


@cache
def _memory() -> float:
    """Return the size of this computer's memory, bytes."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # Windows does not tell it this way
        return 16e9


def _add_check(function: types.FunctionType) -> types.FunctionType:
    """Return the function with a check of its arguments against its type hints before each call."""
    expect = expect_kinds

    def call(*args: Any, **named: Any) -> Any:
        """Call the function after a check of its arguments."""
        expect(function, args, named)
        return function(*args, **named)

    # With the globals of its module: a doctest is looked for where they are the module's.
    wrapper = types.FunctionType(
        call.__code__, function.__globals__, function.__name__, None, call.__closure__
    )
    return typing.cast(types.FunctionType, update_wrapper(wrapper, function))


@cache
def _kinds_of(
    function: Callable[..., Any],
) -> tuple[dict[str, tuple[_Kind | None, Any]], list[str], str]:
    """Return the kind and default of each argument, positional names, and the name of *args."""
    kinds, order, others = {}, [], ""
    for name, argument in inspect.signature(function).parameters.items():
        if argument.kind is argument.VAR_POSITIONAL:
            others = name
        elif argument.kind is not argument.KEYWORD_ONLY:
            order.append(name)
        hinted = argument.annotation not in {argument.empty, *_CHECKED_LATER}
        if argument.kind is not argument.VAR_KEYWORD and hinted:
            kinds[name] = (_kind(_hint(function, argument.annotation)), argument.default)
    return kinds, order, others


def _hint(function: Callable[..., Any], annotation: Any) -> Any:
    """Return the object of a type hint; `Any` if its names exist for type checkers only."""
    try:
        return eval(annotation, function.__globals__) if isinstance(annotation, str) else annotation
    except NameError:
        return Any


def _kind(hint: Any) -> _Kind | None:
    """Return the check for values of a type hint; None if the hint allows any value."""
    if hint in _PLAIN:
        return _PLAIN[hint]
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if np.ndarray in (hint, origin) or _has_shape(hint):
        return _Kind("an array", _is_array)
    if origin in (typing.Union, types.UnionType):
        # ArrayLike is a union too, and one with another flattens it.
        numbers = set(inner) >= _ARRAY_LIKE
        kinds = [
            _alternative(choice) for choice in inner if not (numbers and choice in _ARRAY_LIKE)
        ]
        return _either([*kinds, *([_Kind("real numbers", _are_numbers)] if numbers else [])])
    if origin is typing.Annotated and isinstance(inner[1], Between):
        return _with_bounds(_kind(inner[0]), inner[1])
    if origin is typing.Literal:
        choices = tuple({type(choice) for choice in inner})
        return _Kind(
            join_words(
                [f'"{choice}"' if isinstance(choice, str) else repr(choice) for choice in inner]
            ),
            lambda argument: isinstance(argument, choices),
        )
    kind: Any = origin or hint
    if not isinstance(kind, type):
        return None
    if kind is collections.abc.Callable:
        return _Kind("a function", callable)
    if issubclass(kind, Mapping):
        return _Kind("a mapping", lambda argument: isinstance(argument, Mapping))
    if issubclass(kind, collections.abc.Iterable) and kind.__module__ in _COLLECTIONS:
        every = _kind(inner[0]) if inner else None
        if kind is tuple and Ellipsis not in inner:
            return _sequence(every, count=len(inner))
        return _sequence(every, lazy=not issubclass(kind, collections.abc.Collection))
    if getattr(kind, "_is_protocol", False) and not getattr(kind, "_is_runtime_protocol", False):
        return None
    article = "an" if kind.__name__[0] in "AEIO" else "a"
    called = _CALLED.get(kind.__name__, f"{article} {kind.__name__}")
    return _Kind(called, lambda argument: isinstance(argument, kind))


def _has_shape(hint: Any) -> bool:
    """Return whether a type hint is an array type of jaxtyping."""
    jaxtyping = sys.modules.get("jaxtyping")
    return (
        jaxtyping is not None
        and isinstance(hint, type)
        and issubclass(hint, jaxtyping.AbstractArray)
    )


def _alternative(hint: Any) -> _Kind | None:
    """Return the check for a member of a union type; a literal allows its choices only."""
    kind = _kind(hint)
    if kind is None or typing.get_origin(hint) is not typing.Literal:
        return kind
    choices = typing.get_args(hint)
    return _Kind(
        kind.words,
        lambda argument: any(argument is choice or argument == choice for choice in choices),
    )


def _either(kinds: list[_Kind | None]) -> _Kind | None:
    """Return the check that accepts what any of the kinds accepts; None if one is None."""
    known = [kind for kind in kinds if kind is not None]
    if len(known) < len(kinds):
        return None
    words = [kind.words for kind in known if kind.words != "None"]
    return _Kind(join_words(words), lambda argument: any(kind.holds(argument) for kind in known))


def join_words(words: Sequence[str], last: str = "or") -> str:
    """Return words joined by commas, and by "or", or another word, before the last."""
    return f" {last} ".join([", ".join(words[:-1]), words[-1]] if words[:-1] else words)


def _with_bounds(kind: _Kind | None, bounds: Between) -> _Kind | None:
    """Return a check for numbers restricted to bounds, also in its words; None for None."""
    if kind is None:
        return None
    least, most = bounds
    words = f"of {least:g} or more" if most == math.inf else f"from {least:g} to {most:g}"
    return _Kind(
        f"{kind.words} {words}", lambda argument: kind.holds(argument) and least <= argument <= most
    )


def _sequence(every: _Kind | None, *, lazy: bool = False, count: int | None = None) -> _Kind:
    """Return the check for a sequence of elements of a kind; `lazy` accepts iterators too."""

    def holds(argument: Any) -> bool:
        """Return whether an argument is a sequence of the right length with valid elements."""
        if isinstance(argument, str | bytes | Mapping) or not hasattr(argument, "__iter__"):
            return False
        if np.ndim(argument) == 0 if isinstance(argument, np.ndarray) else lazy:
            return lazy
        if not hasattr(argument, "__len__") or count not in (None, len(argument)):
            return False
        return every is None or len(argument) > _LOOKED_AT or all(map(every.holds, argument))

    called = "a sequence" if count is None else f"{count} values"
    return _Kind(f"{called} (each {every.words})" if every else called, holds)


def _is_number(argument: Any) -> bool:
    """Return whether an argument is a real scalar: no bool, no text, no array with axes."""
    if isinstance(argument, bool | np.bool_ | str | bytes) or not hasattr(argument, "__float__"):
        return False
    try:
        return np.ndim(argument) == 0 and float(argument) is not None
    except (TypeError, ValueError, OverflowError):
        return False


def _is_array(argument: Any) -> bool:
    """Return whether an argument is an array or nested sequence of real numbers."""
    return _are_numbers(argument) and np.ndim(argument) > 0


def _is_whole(argument: Any) -> bool:
    """Return whether an argument is an integer of less than 64 bits, and not a bool."""
    if isinstance(argument, bool | np.bool_):
        return False
    try:
        return abs(operator.index(argument)) < _LARGEST
    except TypeError:
        return False


def _are_numbers(argument: Any) -> bool:
    """Return whether NumPy can convert an argument to real numbers; text is refused."""
    if isinstance(argument, str | bytes) or argument is None:
        return False
    try:
        array = np.asarray(argument)
        if array.dtype.kind == "O":
            array = array.astype(float) if not _has_text(array) else array
    except (TypeError, ValueError, OverflowError):
        return False
    return array.dtype.kind in "biuf"


def _has_text(array: np.ndarray[Any, Any]) -> bool:
    """Return whether an array of objects has text elements."""
    return any(isinstance(element, str | bytes) for element in array.flat)


_ARRAY_LIKE = set(typing.get_args(ArrayLike))
_CALLED = {"HasColumns": "a data frame", "Path": "a path"}
"""Kinds that have a word of their own."""

_COLLECTIONS = ("builtins", "collections.abc")

_PLAIN: dict[Any, _Kind | None] = {
    Any: None,
    object: None,
    None: _Kind("None", lambda value: value is None),
    type(None): _Kind("None", lambda value: value is None),
    bool: _Kind("True or False", lambda value: isinstance(value, bool | np.bool_)),
    int: _Kind("a whole number", _is_whole),
    float: _Kind("a number", _is_number),
    str: _Kind("a text", lambda value: isinstance(value, str)),
    os.PathLike: _Kind("a path", lambda value: isinstance(value, os.PathLike)),
}
