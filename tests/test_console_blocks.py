"""Every command that a page shows runs, a page's commands in order, and prints what is shown.

`console_blocks` tells how a page is read and how outputs are compared. A command that is not run is
in `NOT_RUN`, with the reason and the test that runs it otherwise; what a page takes for granted is
made by `GIVEN`; a tolerance other than that of the last digit is in `TOLERANCES`. docs/from-log-to-
controller.md runs in test_walk.py, where its files are then used.
"""

from __future__ import annotations

import re
import subprocess

import pytest
from console_blocks import (
    EXIT_CODES,
    GIVEN,
    NOT_RUN,
    ROOT,
    TOLERANCES,
    Step,
    Tolerance,
    blocks,
    difference,
    entry,
    make_given,
    run,
    run_page,
    steps,
)
from documentation import TEXTS
from mechanisms import CLIENTS

import pteron
from pteron.kernels.c import compiler

# Commands that are not run.


# What a page takes for granted.


# Outputs.


ELSEWHERE = {"docs/from-log-to-controller.md": "test_walk.py"}
"""Pages whose commands run in another test, by `run_page` too."""

WITH_COMMANDS = [name for name, text in TEXTS.items() if steps(name, text)]


@CLIENTS
@pytest.mark.parametrize("name", [name for name in WITH_COMMANDS if name not in ELSEWHERE])
def test_commands_run_and_print_what_is_shown(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run_page(name, tmp_path)


PAGE = """
    # a remark
    pteron new delta \\
        --out robot.toml
    .venv/bin/pteron check robot.toml    # another remark

A file:

    name = "no console"

```console
$ pteron inverse delta 0 0 -0.9
x,y,z
0.12,-3.40e-05,7

done ...
```

    $ cp a b
"""


def test_blocks_are_read():
    found = steps("page", PAGE)
    assert [(step.line, step.command) for step in found] == [
        (3, "pteron new delta --out robot.toml"),
        (5, "pteron check robot.toml"),
        (12, "pteron inverse delta 0 0 -0.9"),
        (19, "cp a b"),
    ]
    assert [step.shown for step in found] == [
        (),
        (),
        ("x,y,z", "0.12,-3.40e-05,7", "done ..."),
        (),
    ]


@pytest.mark.parametrize(
    ("shown", "printed", "differs"),
    [
        ("a 0.12 b", "a 0.13\nb", ""),
        ("a 0.12 b", "a 0.14 b", "shown '0.12', printed '0.14'"),
        ("leg 2: 5 boxes", "leg 3: 5 boxes", "shown '2:', printed '3:'"),
        ("at most 3.4e-05", "at most 3.5e-05", ""),
        ("at most 3.4e-05", "at most 3.4e-06", "printed '3.4e-06'"),
        ("-0.01 m", "0.01 m", "printed '0.01'"),
        ("a ... z", "a b c z", ""),
        ("a ... z", "a b c", "shown 'z'"),
        ("a\n...\nk 1.0\n...", "a b k 1.1 c d", ""),
        ("a (y = ..., 2.0)", "a (y = 17.3, 2.1)", ""),
        ("a (y = ..., 2.0)", "a (y = 17.3, 2.4)", "shown '2.0)'"),
        ("a", "a b", "more is printed: b"),
        ("a b", "a", "no more is printed"),
        ("──── 1", "────── 1", ""),
    ],
)
def test_outputs_are_compared(shown, printed, differs):
    found = difference(shown, printed)
    assert differs in found
    assert bool(found) == bool(differs)


def test_a_tolerance_holds_on_its_lines_alone():
    table = (Tolerance(0.1, "an example", "^volume"),)
    assert difference("volume 100 m\ncount 10", "volume 109 m\ncount 10", table) == ""
    assert difference("volume 100 m\ncount 10", "volume 109 m\ncount 11", table)
    assert difference("volume 100 m", "volume 111 m", table)


@CLIENTS
def test_code_for_a_payload_is_that_of_the_exported_header(tmp_path, monkeypatch):
    """The lines of C on the page compile against what the page's command writes."""
    name = "docs/how-to/payloads-and-tools.md"
    if compiler() is None:
        pytest.skip("no C compiler")
    monkeypatch.chdir(tmp_path)
    make_given(name, tmp_path / "robot.toml")
    assert run(Step(name, 0, "pteron export robot.toml --c controller"), tmp_path)[0] == 0
    tool, found = (
        "\n".join(lines) for _, language, lines in blocks(TEXTS[name]) if language == "c"
    )
    start = '#include "my_robot.h"\nvoid carry(const double pose[4], const double velocity[4],'
    start += "const double acceleration[4], double forces[4])\n{\n"
    (tmp_path / "lines.c").write_text(f"{start}{tool}\n{found}\n}}\n", encoding="utf-8")
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-Icontroller"]
    done = subprocess.run([*compiler(), *flags, "lines.c"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (size,) = re.findall(r"double loaded\[(\d+)\]", tool)
    assert int(size) == len(pteron.parameters(pteron.load("robot.toml")))


def test_tables_name_commands_that_are_shown_and_tests_that_are_there():
    every = [step.command for name in WITH_COMMANDS for step in steps(name, TEXTS[name])]
    for table in (NOT_RUN, EXIT_CODES, TOLERANCES):
        for pattern in table:
            assert any(entry({pattern: True}, command) for command in every), pattern
    for reason, test in NOT_RUN.values():
        assert reason
        assert (ROOT / "tests" / test).is_file(), test
    assert all(t.reason for row in TOLERANCES.values() for t in row)
    for name, files in GIVEN.items():
        words = {word for step in steps(name, TEXTS[name]) for word in step.words}
        assert set(files) <= words, name
