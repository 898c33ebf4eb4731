"""TOML files: what must not hang, crash or flood the terminal, and how faults are told."""

from __future__ import annotations

import os
from typing import Annotated, Literal

import pytest
from pydantic import BaseModel, Field

import pteron
from pteron.errors import DataError, ModelError, shorten
from pteron.export import from_klipper
from pteron.toml import parsed_toml, read_toml, to_model


@pytest.mark.timeout(20)
@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"a = \xff", "it is not UTF-8 text"),
        (b"a = 1\na = 2", "Cannot overwrite a value"),
        (b"a = " + b"9" * 5000, "a number in it has thousands of digits"),
        (b"a = " + b"[" * 1000 + b"]" * 1000, "nested too deeply"),
        (b"a = " + b"{a = " * 1000 + b"1" + b"}" * 1000, "nested too deeply"),
        (b".".join([b"a"] * 20_000) + b" = 1", "the key a.a.a.a.a.a.a.a.a.a.... has over 16 parts"),
        (b"[" + b" . ".join([b'"a"'] * 20_000) + b"]", "has over 16 parts"),
        (b"a = {" + b".".join([b"a"] * 20_000) + b" = 1}", "has over 16 parts"),
        (b"a = '\x1b[31m'", r"Found invalid character '\x1b'"),
        (b"#" * (17 << 20), "has over 16 MB"),
        (b"a = 1" + b"0" * 40, "a whole number in it is beyond 64 bits"),
        (b"<?xml version='1.0'?>\n<robot name='r5'>", "this is URDF, not TOML"),
        (b"<mujoco model='r5'>", "this is MJCF, not TOML"),
        (b'{"name": "r5"}', "this is JSON, not TOML"),
    ],
    ids=[
        "encoding",
        "twice",
        "digits",
        "lists",
        "tables",
        "dots",
        "header",
        "inner",
        "escape",
        "MB",
        "whole number",
        "URDF",
        "MJCF",
        "JSON",
    ],
)
def test_what_is_no_file_of_settings_is_refused_at_once_in_one_line(text: bytes, words: str):
    with pytest.raises(ModelError) as caught:
        parsed_toml(text, "file.toml", ModelError)
    message = str(caught.value)
    assert message.startswith("file.toml: ")
    assert words in message
    assert message.isprintable()
    assert len(message) < 200


@pytest.mark.parametrize(
    "text",
    [
        b"\xef\xbb\xbfa = 1",
        b"a = 1 # " + b"a." * 100,
        b'a = "' + b"a." * 100 + b'"',
        b"a = '''" + b"a.\n" * 100 + b"'''",
        b"a = [" + b"1.5, " * 100 + b"]",
    ],
    ids=["mark", "comment", "string", "lines", "numbers"],
)
def test_what_only_looks_strange_is_read(text: bytes):
    assert list(parsed_toml(text, "file.toml", ModelError)) == ["a"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="FIFOs of POSIX")
def test_a_pipe_without_an_end_is_refused_before_it_is_opened(tmp_path):
    pipe = tmp_path / "robot.toml"
    os.mkfifo(pipe)
    with pytest.raises(ModelError, match="it is a pipe or a device, not a file"):
        pteron.load(pipe)
    with pytest.raises(DataError, match="it is a pipe or a device, not a file"):
        from_klipper(pipe)


def test_a_file_that_is_not_there_is_told_in_the_callers_words(tmp_path):
    for name in ("nowhere.toml", "nul\0.toml"):
        with pytest.raises(DataError, match=r"toml: no such log$"):
            read_toml(tmp_path / name, DataError, "no such log")
    with pytest.raises(ModelError, match="cannot be read"):
        read_toml(tmp_path, ModelError, "no such machine")


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]


class Leg(BaseModel, extra="forbid"):
    length: Number
    elbow: Literal[1, -1] = 1
    limits: tuple[Number, Number] | None = None


class Machine(BaseModel, extra="forbid"):
    name: str
    gravity: tuple[Number, Number, Number] = (0.0, 0.0, -9.81)
    legs: list[Leg]


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"gravity": 9.81}, "gravity: 9.81 given, a list of 3 numbers expected"),
        ({"gravity": [0, 0]}, "gravity: [0, 0] given, a list of 3 numbers expected"),
        ({"gravity": [0, 0, 1, 2]}, "gravity: [0, 0, 1, 2] given, a list of 3 numbers expected"),
        ({"gravity": [0, "down", 1]}, "gravity, item 2: 'down' given, a number expected"),
        ({"gravity": [0, 0, float("inf")]}, "gravity, item 3: inf given, a finite number expected"),
        ({"name": 3}, "name: 3 given, a text expected"),
        ({"legs": 3}, "legs: 3 given, a list of tables expected"),
        ({"legs": [3]}, "legs, item 1: 3 given, a table expected"),
        (
            {"legs": [{"length": 1.0}, {}]},
            "legs, item 2: length: missing; the file must give a number",
        ),
        ({"legs": [{"length": True}]}, "legs, item 1: length: True given, a number expected"),
        ({"legs": [{"length": 1.0, "elbow": 0}]}, "legs, item 1: elbow: 0 given, 1 or -1 expected"),
        (
            {"legs": [{"length": 1.0, "limits": 0.3}]},
            "legs, item 1: limits: 0.3 given, a list of 2 numbers expected",
        ),
        (
            {"legs": [{"length": 1.0, "l\x1bu": 1.0}]},
            r"legs, item 1: l\x1bu: unknown key; the valid ones there are length, elbow, limits",
        ),
    ],
)
def test_a_fault_says_where_what_was_given_and_what_was_expected(change, line):
    document = {"name": "toy", "legs": []} | change
    with pytest.raises(ModelError) as caught:
        to_model(Machine, document, "toy.toml", ModelError)
    assert str(caught.value) == f"toy.toml: {line}"


def test_all_faults_are_told_each_on_a_line_and_none_at_length():
    legs = [{"length": "x" * 10_000_000}] * 30
    with pytest.raises(ModelError) as caught:
        to_model(Machine, {"legs": legs}, "toy.toml", ModelError)
    lines = str(caught.value).splitlines()
    assert lines[0] == "toy.toml: 31 faults"
    assert lines[1] == "  name: missing; the file must give a text"
    assert lines[2].startswith("  legs, item 1: length: 'xxx")
    assert lines[-1] == "  and 11 more"
    assert max(map(len, lines)) < 150


@pytest.mark.parametrize(
    "value",
    ["a" * 10_000_000, [[[[[1] * 100] * 100] * 2] * 2] * 100, 10**5000, {"a": "b" * 10**6}],
    ids=["text", "lists", "integer", "table"],
)
def test_no_value_is_shown_at_length(value):
    assert len(shorten(value)) < 300
