"""Random damage to files: bytes, lines, numbers, keys, and the files of a folder."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np

__all__ = ["Chance", "damaged_bytes", "damaged_folder", "damaged_text"]

Chance = np.random.Generator

_NUMBER = re.compile(rb"(?<![\w.])[+-]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?(?![\w])")
_KEY = re.compile(rb'(?m)^\s*"?([\w.]+)"?\s*[=:]')
_OTHERS = (
    *(b"nan", b"inf", b"-inf", b"NaN", b"Infinity", b"1e308", b"-1e308", b"1e400", b"5e-324"),
    *(b"0", b"-0.0", b"-1", b"0.5", b"99999999999", b"9" * 400, b"-" + b"9" * 400, b"9" * 5000),
    *(b'"text"', b"''", b"true", b"false", b"null", b"[]", b"[1, 2]", b"{}", b"", b"1_0", b"0x1F"),
    *(b"2026-11-23", b"12:30", b"1,5", b"1.2.3", b"\xd9\xa1", b"=1+1"),
)
"""Texts that take the place of a number."""

_LONG = (b"1", b"0", b"a", b"[", b"{a = ", b"a.", b"(", b",", b"\n", b" ")
"""Texts that are repeated very often."""

_ODD = (
    *(b"\x00", b"\x01", b"\x07", b"\x1b[31m", b"\x7f", b"\r", b"\t", b"\xff", b"\xef\xbb\xbf"),
    *("\u202e".encode(), "\u2028".encode(), "\u0661".encode(), b'"', b"'", b"[", b"}", b"#", b"\\"),
)


def damaged_text(data: bytes, chance: Chance) -> bytes:
    """Return a text with a fault, or with two; one that has grown long has no second."""
    longest = len(data) + 2_000
    for _ in range(int(chance.integers(1, 3))):
        if len(data) > longest:
            break  # the patterns of numbers and keys here are slow on it
        data = _one_of(_TEXT, chance)(data, chance)
    return data


def damaged_bytes(data: bytes, chance: Chance) -> bytes:
    """Return bytes with a fault."""
    return _one_of(_BYTES, chance)(data, chance)


def damaged_folder(folder: Path, chance: Chance) -> None:
    """Damage a file of a folder, or lose it, or put another in its place."""
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    one, other = (files[int(k)] for k in chance.integers(len(files), size=2))
    what = int(chance.integers(8))
    if what == 0:
        one.unlink()
    elif what == 1:
        first, second = one.read_bytes(), other.read_bytes()
        one.write_bytes(second)
        other.write_bytes(first)
    elif what == 2:
        one.unlink()
        one.mkdir()
    elif what == 3 and one.parent != folder:
        shutil.rmtree(one.parent)
    elif what == 4:
        one.rename(one.with_name(f"{one.name}x"))
    elif one.suffix == ".json":
        one.write_bytes(damaged_text(one.read_bytes(), chance))
    else:
        one.write_bytes(damaged_bytes(one.read_bytes(), chance))


def _one_of(
    several: tuple[Callable[[bytes, Chance], bytes], ...], chance: Chance
) -> Callable[[bytes, Chance], bytes]:
    return several[int(chance.integers(len(several)))]


def _place(data: bytes, chance: Chance) -> int:
    return int(chance.integers(len(data) + 1))


def _span(data: bytes, chance: Chance) -> tuple[int, int]:
    low = _place(data, chance)
    return low, min(len(data), low + int(2 ** chance.uniform(0, 8)))


def _flipped(data: bytes, chance: Chance) -> bytes:
    changed = bytearray(data)
    for _ in range(int(chance.integers(1, 9)) if data else 0):
        changed[int(chance.integers(len(data)))] ^= 1 << int(chance.integers(8))
    return bytes(changed)


def _cut_short(data: bytes, chance: Chance) -> bytes:
    return data[: _place(data, chance)]


def _without(data: bytes, chance: Chance) -> bytes:
    low, high = _span(data, chance)
    return data[:low] + data[high:]


def _twice(data: bytes, chance: Chance) -> bytes:
    low, high = _span(data, chance)
    return data[:high] + data[low:]


def _zeroed(data: bytes, chance: Chance) -> bytes:
    low, high = _span(data, chance)
    return data[:low] + bytes(high - low) + data[high:]


def _longer(data: bytes, chance: Chance) -> bytes:
    return data + chance.bytes(int(chance.integers(1, 40)))


def _emptied(data: bytes, chance: Chance) -> bytes:
    return b"" if chance.random() < 0.2 else _flipped(data, chance)


def _lines_changed(data: bytes, chance: Chance) -> bytes:
    lines = data.splitlines(keepends=True)
    if len(lines) < 2:
        return data
    i, j = (int(k) for k in chance.integers(len(lines), size=2))
    what = int(chance.integers(3))
    if what == 0:
        lines[i], lines[j] = lines[j], lines[i]
    elif what == 1:
        del lines[i]
    else:
        lines.insert(j, lines[i])
    return b"".join(lines)


def _number_replaced(data: bytes, chance: Chance) -> bytes:
    found = list(_NUMBER.finditer(data))
    if not found:
        return data
    at = found[int(chance.integers(len(found)))]
    other = _OTHERS[int(chance.integers(len(_OTHERS)))]
    what = chance.random()
    if what < 0.2:
        other = repr(float(chance.normal()) * 10.0 ** int(chance.integers(-6, 7))).encode()
    elif what < 0.6:  # nearly as it was
        other = repr(float(at[0].replace(b",", b".")) * chance.uniform(0.9, 1.1)).encode()
        other = other.replace(b".", b",") if b"," in at[0] else other
    return data[: at.start()] + other + data[at.end() :]


def _key_changed(data: bytes, chance: Chance) -> bytes:
    found = list(_KEY.finditer(data))
    if not found:
        return _lines_changed(data, chance)
    at, other = (found[int(k)] for k in chance.integers(len(found), size=2))
    end = data.find(b"\n", at.end())
    what = int(chance.integers(3))
    if what == 0:
        return data[: at.start()] + data[end if end >= 0 else len(data) :]
    return data[: at.start(1)] + (other[1] if what == 1 else b"other") + data[at.end(1) :]


def _odd(data: bytes, chance: Chance) -> bytes:
    at = _place(data, chance)
    return data[:at] + _ODD[int(chance.integers(len(_ODD)))] + data[at:]


def _grown(data: bytes, chance: Chance) -> bytes:
    """Insert up to a megabyte of one digit or letter, or brackets that are never closed."""
    at, size = _place(data, chance), int(2 ** chance.uniform(6, 20))
    if chance.random() < 0.5 and (numbers := list(_NUMBER.finditer(data))):
        at = numbers[int(chance.integers(len(numbers)))].start()
    return data[:at] + _LONG[int(chance.integers(len(_LONG)))] * size + data[at:]


_BYTES = (_flipped, _flipped, _cut_short, _without, _twice, _zeroed, _longer, _emptied)
_TEXT = (
    *(_number_replaced, _number_replaced, _number_replaced, _key_changed, _lines_changed, _odd),
    *(_flipped, _cut_short, _without, _twice, _emptied, _grown),
)
