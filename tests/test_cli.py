"""The command line as a person and as a program meet it."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from commands import PROGRAM, done, read, refused, run, without_styles
from mechanisms import CLIENTS, gated

import pteron
from pteron.cli.arguments import group_numbers
from pteron.manipulator.machine_warnings import machine_warnings
from pteron.manipulator.variants import with_elbows
from pteron.playback import playback
from pteron.report.given_forces import force_doubts

POSES = "x,y,z,phi\n0.01,0.02,-0.03,0.1\n0.02,-0.01,0.03,-0.2\n"
COMMANDS = (
    *("catalog", "check", "report", "inverse", "direct", "forces", "base", "excite", "identify"),
    *("cycle", "cue", "simulate", "size", "film", "play", "table1", "workspace", "design"),
)


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def frame(text: str) -> pl.DataFrame:
    return pl.read_csv(StringIO(text))


def motion(rows: int, robot: str = "quadrupteron") -> pl.DataFrame:
    """Return a table of random motions."""
    machine = pteron.load(robot)
    m = machine.freedom
    rates = np.random.default_rng(1).normal(size=(rows, 2 * m))
    values = np.hstack([pteron.random_poses(machine, rows), rates])
    names = [rate + name for rate in ("", "d", "dd") for name in machine.coordinates]
    return pl.DataFrame(dict(zip(names, values.T, strict=True)))


# Help and the program as a whole


def test_the_bare_command_shows_its_help():
    text = done("")
    assert text == done("--help")
    assert all(name in text for name in COMMANDS)
    assert len(text.splitlines()) <= 40, "it fits one screen"


@pytest.mark.parametrize("name", ["stewart", "rubin-m2-hexapod"])
def test_check_shows_equal_legs_in_one_row(name: str):
    text, each = done(f"check {name}", COLUMNS="100"), done(f"check {name} --all", COLUMNS="100")
    assert len(text.splitlines()) <= 30
    assert sum("UPS   " in line for line in text.splitlines()) == 1
    assert sum("UPS   " in line for line in each.splitlines()) == 6
    assert "1 to 6  ram at the base" in text
    assert each.count("ram at the base") == 6


def test_check_shows_the_range_of_legs_that_differ_at_home_alone(tmp_path):
    lines = run("new stewart").stdout.replace("[home]", "# [home]")
    file = tmp_path / "shifted.toml"
    file.write_text(f"{lines}\n[home]\npose = [0.1, 0.0, 2.0, 0.0, 0.0, 0.0]\n")
    text = done(f"check {file}", COLUMNS="100")
    at_home = json.loads(done(f"check {file} --json"))["legs"]
    lengths = [leg["at_home"] for leg in at_home]
    assert f"{min(lengths):.5g} to {max(lengths):.5g} m" in text


@pytest.mark.parametrize("command", COMMANDS)
def test_every_subcommand_has_help_with_an_example_in_60_columns(command: str):
    text = done(f"{command} --help")
    assert f"pteron {command}" in text.split("Examples")[1]
    assert "--json" in text
    assert max(map(len, text.splitlines())) <= 60
    assert "\x1b" not in text
    assert "bool" not in text, "a flag takes no value"


def test_the_version_is_the_library_s():
    assert done("--version") == f"pteron {pteron.__version__}\n"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("invrse quadrupteron", ["No such command 'invrse'", "'inverse'? See pteron --help"]),
        ("inverse", ["Missing argument 'ROBOT'", "see pteron inverse --help"]),
        ("inverse quadrupteron 0 0 0 0 --jsno", ["No such option: --jsno", "--json"]),
        ("inverse quadrupteron 0 0 0 0 --on-failure stop", ["'stop' is not one of", "'nan'"]),
        ("report quadrupteron", ["Missing option '--out'"]),
        ("catalog here", ["unexpected extra argument", "here"]),
    ],
)
def test_wrong_usage_is_one_line(line: str, words: list[str]):
    refused(line, *words)


def test_help_names_every_function_that_can_be_exported():
    text = "".join(run("export --help", COLUMNS="60").stdout.replace("\u2502", " ").split())
    with pytest.raises(pteron.ModelError) as caught:
        pteron.export_c(pteron.load("tripteron"), "none", "there")
    names = str(caught.value).split("choose from ")[1]
    assert f"repeat for several: {names}.".replace(" ", "") in text


def test_the_package_runs_as_a_module():
    command = [sys.executable, "-m", "pteron", "--version"]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    assert result.stdout == f"pteron {pteron.__version__}\n"


def test_help_loads_nothing_heavy():
    script = (
        "import sys, types, pathlib\n"
        # In place of pteron itself, whose import loads NumPy and CasADi.
        "package = types.ModuleType('pteron'); package.__path__ = [sys.argv.pop(1)]\n"
        "sys.modules['pteron'] = package\n"
        "from pteron.cli.main import main\n"
        "for words in ([], ['inverse'], ['base']):\n"
        "    sys.argv[1:] = [*words, '--help']\n"
        "    try:\n        main()\n    except SystemExit as end:\n        assert not end.code\n"
        "sys.stderr.write(' '.join(sys.modules))\n"
    )
    command = [sys.executable, "-c", script, str(Path(pteron.__file__).parent)]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    loaded = set(result.stderr.split())
    assert "pteron.cli.main" in loaded
    heavy = {"numpy", "casadi", "polars", "scipy", "sympy", "matplotlib", "jinja2"}
    assert loaded & heavy == set()


# Poses to joints


def test_joints_of_one_pose_with_negative_numbers():
    table = frame(done("inverse quadrupteron 0.01 -0.02 -3e-2 -.1"))
    assert table.columns == ["x", "y", "z", "phi", "rho1", "rho2", "rho3", "rho4"]
    expected = pteron.inverse_kinematics(pteron.load("quadrupteron"), [0.01, -0.02, -0.03, -0.1])
    np.testing.assert_array_equal(table.select("^rho.$").row(0), expected)


def test_options_may_stand_anywhere_among_the_numbers():
    text = done("inverse --json tripteron -0.01 0.02 -0.03")
    assert text == done("inverse tripteron -0.01 --json 0.02 -0.03")
    assert text == done("inverse tripteron --json -- -0.01 0.02 -0.03")
    assert json.loads(text)["x"] == -0.01


def test_numbers_go_behind_the_other_words():
    assert group_numbers(["r", "--out", "-1", "-2", "--", "-3", "--json"], ["--out"]) == [
        *("r", "--out", "-1", "--", "-2", "-3", "--json")
    ]
    assert group_numbers(["r", "--pose", "--json"], ["--pose"]) == ["r", "--pose", "--json"]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("inverse quadrupteron 0 0 0", ["3 values given, 4 expected: x y z phi"]),
        ("inverse tripteron 0 0 0 0", ["4 values given, 3 expected: x y z"]),
        ("inverse tripteron 0", ["1 value given"]),
        ("inverse tripteron 0 0 a", ["'a' is not a number", "x y z"]),
        ("inverse tripteron 0 0 -0.1.2", ["'-0.1.2' is not a number"]),
        ("inverse tripteron 0 0 nan", ["'nan' is not a finite number"]),
        ("inverse tripteron 0 0 -inf", ["'-inf' is not a finite number"]),
        ("inverse tripteron", ["no pose given; give x y z, or --table FILE"]),
        ("inverse tripteron 0 0 0 --table poses.csv", ["pose and --table given; give one"]),
        ("inverse quadrupteron 0 0 0.9 0", ["pose: leg", "misses it by", "move the pose"]),
        ("inverse quadruptron 0 0 0 0", ["neither a file nor a machine", 'mean "quadrupteron"']),
    ],
)
def test_a_pose_that_cannot_be_served_is_one_line(line: str, words: list[str]):
    assert "row" not in refused(line, *words)


def test_a_table_keeps_its_columns_and_rows():
    Path("poses.csv").write_text("t,x,y,z,note\n0.10,1e-2,0,0,a\n0.20,0,-0.02,0,\n")
    text = done("inverse tripteron --table poses.csv")
    first, second = text.splitlines()[1:]
    assert text.startswith("t,x,y,z,note,rho1,rho2,rho3\n")
    assert first.startswith("0.10,1e-2,0,0,a,")
    assert second.startswith("0.20,0,-0.02,0,,")
    expected = pteron.inverse_kinematics(pteron.load("tripteron"), [[0.01, 0, 0], [0, -0.02, 0]])
    np.testing.assert_array_equal(frame(text).select("^rho.$").to_numpy(), expected)


@pytest.mark.parametrize("ending", ["parquet", "CSV"])
def test_a_table_goes_from_file_to_file(ending: str):
    motion(50).write_parquet("motion.parquet")
    result = run(f"inverse quadrupteron --table motion.parquet --out out.{ending}")
    assert (result.exit_code, result.stdout) == (0, "")
    assert result.stderr == f"Wrote 50 rows to out.{ending}\n"
    read = pl.read_csv if ending.lower() == "csv" else pl.read_parquet
    written = read(f"out.{ending}")
    poses = motion(50).select("x", "y", "z", "phi").to_numpy()
    expected = pteron.inverse_kinematics(pteron.load("quadrupteron"), poses)
    np.testing.assert_array_equal(written.select("^rho.$").to_numpy(), expected)
    assert sorted(file.name for file in Path().iterdir()) == ["motion.parquet", f"out.{ending}"]


def test_a_table_may_be_written_over_itself_once():
    Path("poses.csv").write_text(POSES)
    assert run("inverse quadrupteron --table poses.csv --out poses.csv").exit_code == 0
    written = Path("poses.csv").read_text()
    assert written.startswith("x,y,z,phi,rho1")
    refused(
        "inverse quadrupteron --table poses.csv --out ./poses.csv",
        *("its own columns rho1, rho2, rho3, rho4 would be lost", "write to another file"),
    )
    assert Path("poses.csv").read_text() == written
    again = run("inverse quadrupteron --table poses.csv")
    assert again.stdout == written
    assert again.stderr == (
        "Note: poses.csv: columns rho1, rho2, rho3, rho4 replaced by the result\n"
    )


def test_json_is_one_object_for_a_pose_and_a_list_for_a_table():
    assert json.loads(done("inverse tripteron 0.01 0.02 0.03 --json"))["rho1"] == 0.01
    rows = json.loads(done("inverse quadrupteron --table - --json", POSES))
    assert [row["phi"] for row in rows] == [0.1, -0.2]
    assert set(rows[0]) == {"x", "y", "z", "phi", "rho1", "rho2", "rho3", "rho4"}
    assert json.loads(done("inverse tripteron 0 0 0 --json --out out.csv")) == {
        "out": "out.csv",
        "rows": 1,
        "empty": 0,
    }


def test_a_person_sees_a_table_of_60_columns(monkeypatch: pytest.MonkeyPatch):
    text = read("inverse quadrupteron 0.01 0.02 -0.03 0.1")
    assert "rho1 (m)" in text
    assert "-0.030000" in text
    motion(100).write_parquet("motion.parquet")
    result = run("inverse quadrupteron --table motion.parquet", TTY_COMPATIBLE="1")
    assert result.stderr == "40 of 100 rows shown; --out FILE writes them all\n"
    assert "row" in result.stdout
    assert max(map(len, without_styles(result.stdout).splitlines())) <= 60
    monkeypatch.setattr("pteron.cli.table_rows.SHOWN_ROWS", 2)
    text = read("direct quadrupteron 0.03 0.02 0.01 0.02")
    assert "mode" in text
    assert "3.141593" in text


@pytest.fixture
def mixed() -> str:
    """Return the file of a machine with one slider and two cranks."""
    return str(Path(__file__).with_name("data") / "mixed.toml")


def test_columns_and_units_are_those_of_the_joints(mixed: str):
    for robot, joints, forces in (
        ("delta", "theta1 theta2 theta3", "torque1 torque2 torque3"),
        (mixed, "rho1 theta2 theta3", "force1 torque2 torque3"),
    ):
        machine, pose = pteron.load(robot), [0.02, -0.01, -0.9]
        row = json.loads(done(f"inverse {robot} 0.02 -0.01 -0.9 --json"))
        found = [row[name] for name in joints.split()]
        assert found == pteron.inverse_kinematics(machine, pose).tolist()
        back = frame(done(f"direct {robot} {' '.join(map(str, found))}"))
        assert back.columns == ["row", *joints.split(), "mode", "x", "y", "z"]
        away = np.abs(back.select("x", "y", "z").to_numpy() - pose).max(axis=1)
        assert away.min() < 1e-12
        row = json.loads(done(f"forces {robot} --pose 0.02 -0.01 -0.9 --json"))
        expected = pteron.inverse_dynamics(machine, pose, [0.0] * 3, [0.0] * 3)
        assert [row[name] for name in forces.split()] == expected.tolist()
    assert "rho1 (m)  theta2 (rad)" in read(f"inverse {mixed} 0 0 -0.9")
    assert "force1 (N)  torque2 (N m)" in read(f"forces {mixed} --pose 0 0 -0.9")
    assert "is it in millimetres?" in refused("inverse delta 0 0 -900")
    degrees = run(f"direct {mixed} --table -", "rho1,theta2,theta3\n0.1,30,0\n").stderr
    assert "theta2, theta3 up to 30: are these degrees?" in degrees


# Rows that fail


@pytest.mark.parametrize(
    ("cells", "words"),
    [
        ("0,0,0.9,0", ["misses it by", "--on-failure nan"]),
        ("0,0,,0", ["column z", "the cell is empty", "empty with --on-failure nan"]),
        ("0,nan,0,0", ["column y", "'nan' given, a finite number expected"]),
        ("0,0,0,abc", ["column phi", "'abc' given, a number expected"]),
        ("0,0,0", ["has 3 cells, but the header names 4 columns"]),
    ],
)
def test_the_row_and_the_line_of_a_failure_are_named(cells: str, words: list[str]):
    Path("poses.csv").write_text("x,y,z,phi\n\n" + "0,0,0,0\n" * 16 + cells + "\n0,0,0,0\n")
    line = "inverse quadrupteron --table poses.csv --out out.csv"
    message = refused(line, "poses.csv: row 17 (line 19)", *words)
    assert "batch" not in message


def test_a_failure_in_a_later_chunk_has_the_row_of_the_table(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("pteron.cli.table_rows.CHUNK", 4)
    poses = np.zeros((18, 4))
    poses[16:, 2] = 0.9
    pl.DataFrame(poses, schema=["x", "y", "z", "phi"]).write_parquet("poses.parquet")
    message = refused(
        "inverse quadrupteron --table poses.parquet", "poses.parquet: row 17, pose: leg"
    )
    assert "(line" not in message


def test_rows_that_fail_may_stay_empty():
    text = "t,x,y,z,phi\n1,0,0,0.9,0\n2,0,0,0,0\n3,,0,0,0\n"
    result = run("inverse quadrupteron --table - --on-failure nan", text)
    assert result.exit_code == 0
    assert result.stderr == "Printed 3 rows, 2 of them without a result\n"
    assert result.stdout.splitlines()[1:] == [
        "1,0,0,0.9,0,,,,",
        "2,0,0,0,0,0.0,0.0,0.0,0.0",
        "3,,0,0,0,,,,",
    ]
    rows = json.loads(done("inverse quadrupteron --table - --on-failure nan --json", text))
    assert rows[0]["rho1"] is None
    assert rows[2]["x"] is None
    summary = run("inverse quadrupteron --table - --on-failure nan --json --out o.csv", text)
    assert json.loads(summary.stdout) == {"out": "o.csv", "rows": 3, "empty": 2}


def test_a_long_table_shows_a_bar_and_has_the_same_result(monkeypatch: pytest.MonkeyPatch):
    motion(100).write_csv("motion.csv")
    line = "forces quadrupteron --table motion.csv"
    expected = done(line)
    monkeypatch.setattr("pteron.cli.table_rows.LONG", 99)
    monkeypatch.setattr("pteron.cli.table_rows.CHUNK", 7)
    assert done(line) == expected
    monkeypatch.setenv("TTY_INTERACTIVE", "1")
    shown = run(line, FORCE_COLOR="1")
    assert shown.stdout == expected
    assert "motion.csv" in shown.stderr
    assert "100%" in shown.stderr


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("poses.csv", "", ["is empty", "name the columns"]),
        ("poses.csv", "x,y,z,phi\n", ["has no rows below its header"]),
        (
            "poses.csv",
            "x,y,z\n0,0,0\n",
            ["no column phi", "found: x, y, z", "needed: x, y, z, phi"],
        ),
        ("poses.csv", "x;y;z;phi\n0;0;0;0\n", ["separate the cells with commas"]),
        ("poses.xlsx", POSES, ["unknown ending '.xlsx'", ".csv or .parquet"]),
        ("poses.parquet", POSES, ["not a Parquet file"]),
        ("poses", POSES, ["no ending"]),
    ],
)
def test_a_bad_table_is_one_line(name: str, content: str, words: list[str]):
    Path(name).write_text(content)
    refused(f"inverse quadrupteron --table {name} --out out.csv", f"{name}: ", *words)


def test_a_table_that_cannot_be_printed_is_one_line():
    pl.DataFrame({"x": [0.0], "y": [0.0], "z": [0.0], "tags": [["a"]]}).write_parquet("in.parquet")
    refused("inverse tripteron --table in.parquet", "in.parquet: ", "CSV")
    assert json.loads(done("inverse tripteron --table in.parquet --json"))[0]["tags"] == ["a"]
    pl.DataFrame({"x": [0.0], "y": [0.0], "z": [0.0], "b": [b"\xff"]}).write_parquet("in.parquet")
    refused("inverse tripteron --table in.parquet --json", "in.parquet: ", "JSON")


def test_a_missing_table_is_one_line():
    refused("inverse quadrupteron --table poses.csv", "poses.csv: no such file")
    refused("inverse quadrupteron --table .", ".: is a folder")


@pytest.mark.parametrize(
    ("out", "words"),
    [
        ("nowhere/out.csv", ["there is no folder nowhere"]),
        ("out.xlsx", ["unknown ending '.xlsx'"]),
        (".", ["is a folder"]),
        ("/proc/out.csv", ["cannot be written"]),
    ],
)
def test_an_output_that_cannot_be_is_one_line(out: str, words: list[str]):
    refused(f"inverse tripteron 0 0 0 --out {out}", f"{out}: ", *words)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_may_not_be_written_is_one_line():
    Path("locked").mkdir(mode=0o500)
    refused("inverse tripteron 0 0 0 --out locked/out.csv", "locked/out.csv: cannot be written")


def test_values_in_other_units_are_doubted():
    for line in ("inverse quadrupteron 10 20 -30 0", "inverse quadrupteron 0 0 300 0"):
        assert "is it in millimetres?" in refused(line)
        assert refused(line).count("?") == 1
    assert "mm" not in refused("inverse quadrupteron 0 0 0.9 0")
    degrees = run("inverse quadrupteron --table -", "x,y,z,phi\n0,0,0,0\n0,0,0,45\n")
    assert (degrees.exit_code, degrees.stderr.count("\n")) == (0, 1)
    assert "phi up to 45: are these degrees?" in degrees.stderr
    assert "are these mm?" in run("direct tripteron --table -", "rho1,rho2,rho3\n25,0,0\n").stderr
    assert "degrees?" in run("forces quadrupteron --pose 0 0 0 45").stderr


# Joints to poses


def test_all_assembly_modes_of_one_machine():
    sliders = [0.03, 0.02, 0.01, 0.02]
    table = frame(done(f"direct quadrupteron {' '.join(map(str, sliders))}"))
    assert table.columns == [
        *("row", "rho1", "rho2", "rho3", "rho4", "mode", "x", "y", "z", "phi"),
    ]
    assert table["mode"].to_list() == [1, 2]
    poses = pteron.direct_kinematics(pteron.load("quadrupteron"), sliders)
    np.testing.assert_array_equal(table.select("x", "y", "z", "phi").to_numpy(), poses)
    rows = json.loads(done("direct tripteron 0.01 0.02 -0.03 --json"))
    assert [(row["row"], row["mode"]) for row in rows] == [(1, 1)]


def test_joints_beyond_their_limits_are_told_beside_the_numbers():
    told = run("direct delta 1.2 0.1 1.3").stderr
    assert told == (
        "Note: beyond the joints' limits: theta1 (1.2, limits -1.5 to 0.9 rad), "
        "theta3 (1.3, limits -1.5 to 0.9 rad)\n"
    )
    poses = "x,y,z\n0,0,-0.9\n0.7,0,-0.7\n0.6,0,-0.6\n"
    told = run("inverse delta --table -", poses).stderr
    assert told.startswith("Note: beyond the joints' limits: theta1 (in 2 of 3 rows, ")
    told = run("forces delta --pose 0.7 0 -0.7").stderr
    assert told.startswith("Note: beyond the joints' limits: theta1 (")


def test_joints_without_a_pose_fail_alone_and_stay_empty_in_a_table():
    refused("direct quadrupteron 9 0 0 0", "no pose has these joint coordinates")
    text = "t,rho1,rho2,rho3,rho4\n1,9,0,0,0\n2,0,0.001,0,0\n"
    result = run("direct quadrupteron --table -", text)
    table = frame(result.stdout)
    assert result.stderr.endswith("1 of them without a result\n")
    assert table["row"].to_list()[:2] == [1, 2]
    assert table["t"].to_list()[:2] == [1, 2]
    assert table.row(0)[-5:] == (None,) * 5
    assert table["mode"].to_list()[1:] == [1, 2][: len(table) - 1]
    refused("direct quadrupteron --table - --on-failure raise", "row 1 (line 2), ", stdin=text)


def test_joints_and_poses_lead_back_to_each_other():
    motion(30).select("x", "y", "z", "phi").write_csv("poses.csv")
    sliders = done("inverse quadrupteron --table poses.csv")
    back = run("direct quadrupteron --table -", sliders)
    assert back.stderr == ("Note: standard input: columns x, y, z, phi replaced by the result\n")
    found = frame(back.stdout).select("row", "x", "y", "z", "phi").to_numpy()
    for row, *pose in motion(30).select("x", "y", "z", "phi").with_row_index().iter_rows():
        poses = found[found[:, 0] == row + 1, 1:]
        assert np.abs(poses - pose).max(axis=1).min() < 1e-9


# Forces


def test_forces_of_one_motion():
    line = "forces quadrupteron --pose -0.01 0.02 0.03 -0.1 --velocity 0.1 -0.2 0 1"
    table = frame(done(f"{line} --acceleration -1 0 0 2 --wrench 0 0 -10 0.1"))
    robot = pteron.load("quadrupteron")
    state = [-0.01, 0.02, 0.03, -0.1], [0.1, -0.2, 0.0, 1.0], [-1.0, 0.0, 0.0, 2.0]
    expected = pteron.inverse_dynamics(robot, *state, [0.0, 0.0, -10.0, 0.1])
    np.testing.assert_array_equal(table.select("^force.$").row(0), expected)
    assert len(table.columns) == 20


def test_what_is_left_out_is_at_rest():
    robot, rest = pteron.load("tripteron"), np.zeros(3)
    row = json.loads(done("forces tripteron --pose 0,0,-0.01 --json"))
    expected = pteron.inverse_dynamics(robot, [0.0, 0.0, -0.01], rest, rest)
    assert [row[f"force{i}"] for i in (1, 2, 3)] == expected.tolist()


@CLIENTS
def test_the_working_mode_may_be_chosen():
    modes = pteron.working_modes(pteron.load("tripteron"))
    robot, rest = modes[0b010], np.zeros(3)
    row = json.loads(done("forces tripteron --pose 0 0 0.01 --elbows +-+ --json"))
    expected = pteron.inverse_dynamics(robot, [0.0, 0.0, 0.01], rest, rest)
    assert [row[f"force{i}"] for i in (1, 2, 3)] == expected.tolist()
    assert "force1" in json.loads(done("forces tripteron --pose 0 0 0 --elbows --- --json"))
    # A crank's angle depends on the side of its elbow.
    delta = with_elbows(pteron.load("delta"), [1, -1, 1])
    row = json.loads(run("inverse delta 0 0 -0.9 --elbows +-+ --json").stdout)
    angles = pteron.inverse_kinematics(delta, [0.0, 0.0, -0.9])
    assert [row[f"theta{i}"] for i in (1, 2, 3)] == angles.tolist()
    back = frame(run(f"direct delta {' '.join(map(str, angles))} --elbows +-+").stdout)
    assert np.abs(back.select("x", "y", "z").to_numpy() - [0, 0, -0.9]).max(axis=1).min() < 1e-9
    pteron.save(pteron.load("tripteron"), "robot.toml")
    assert json.loads(done("check robot.toml --elbows --+ --json"))["working_mode"] == "--+"
    # A P-R-U-R leg has two signs: the first of each leg alone, or all of them.
    five = json.loads(done("inverse pentapteron 0 0 0 0 0 --elbows --+-+ --json"))
    assert five == json.loads(done("inverse pentapteron 0 0 0 0 0 --elbows ---+++--+- --json"))
    refused(
        "inverse pentapteron 0 0 0 0 0 --elbows --+-", "5 or 10 signs + or - expected, one or two"
    )


@pytest.mark.parametrize("robot", ["quadrupteron", "delta", "five-bar", "3-rrr"])
def test_forces_of_a_table_with_and_without_a_wrench(robot: str):
    machine = pteron.load(robot)
    m = machine.freedom
    table = motion(20, robot)
    table.write_csv("motion.csv")
    states = np.split(table.to_numpy(), 3, axis=1)
    forces = frame(run(f"forces {robot} --table motion.csv").stdout)[machine.force_names].to_numpy()
    np.testing.assert_array_equal(forces, pteron.inverse_dynamics(machine, *states))
    wrench = np.random.default_rng(2).normal(size=(20, m))
    names = {"x": "fx", "y": "fy", "z": "fz", "phi": "mk"}
    loads = pl.DataFrame(wrench, schema=[names[one] for one in machine.coordinates])
    table.hstack(loads).write_csv("loaded.csv")
    forces = frame(run(f"forces {robot} --table loaded.csv").stdout)[machine.force_names].to_numpy()
    np.testing.assert_array_equal(forces, pteron.inverse_dynamics(machine, *states, wrench))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("--velocity 0 0 1", ["no pose given; give --pose with x y z"]),
        ("", ["no pose given; give --pose with x y z, or --table FILE"]),
        ("--pose", ["'--pose' requires an argument"]),
        ("--pose 0 0", ["--pose: 2 values given, 3 expected: x y z"]),
        ("--pose 0 0 0 --velocity 0 0 0 0", ["--velocity: 4 values", "dx dy dz"]),
        ("--pose 0 0 0 --wrench 0", ["--wrench: 1 value given, 3 expected: fx fy fz"]),
        ("--pose 0 0 0 --elbows ++", ["--elbows: '++' given, 3 signs", "such as +++"]),
        ("--pose 0 0 0 --elbows ++x", ["--elbows: '++x'"]),
        ("--pose 0 0 0 --table a.csv", ["give one of them"]),
    ],
)
def test_a_motion_that_cannot_be_served_is_one_line(line: str, words: list[str]):
    refused(f"forces tripteron {line}", *words)


def test_columns_missing_from_a_motion_are_named():
    motion(3).drop("ddphi").write_csv("motion.csv")
    refused("forces quadrupteron --table motion.csv", "no column ddphi", "found: x, y, z, phi, dx")
    motion(3).with_columns(fx=1.0).write_csv("loaded.csv")
    refused("forces quadrupteron --table loaded.csv", "no columns fy, fz, mk")


def test_a_singular_orientation_is_one_line():
    pose = f"0 0 0 {np.pi / 2}"
    refused(
        f"forces quadrupteron --pose {pose}", "pose: singular (type II; measure", "no longer hold"
    )
    table = motion(4).with_columns(phi=pl.Series([0.0, 0.1, np.pi / 2, 0.0]), x=0.0, y=0.0, z=0.0)
    table.write_csv("motion.csv")
    refused("forces quadrupteron --table motion.csv", "row 3 (line 4), pose: singular (type II")
    result = run("forces quadrupteron --table motion.csv --on-failure nan")
    assert frame(result.stdout)["force1"].is_null().to_list() == [False, False, True, False]


# Machines


def test_the_catalog_is_listed():
    listed = json.loads(done("catalog --json"))
    assert [robot["name"] for robot in listed] == list(pteron.catalog())
    text = done("catalog")
    assert all(name in text for name in pteron.catalog())
    assert max(map(len, read("catalog").splitlines())) <= 60


@pytest.mark.parametrize(
    "robot",
    gated(["quadrupteron", "delta", "mixed", "h4", "delta-4", "five-bar"], ["mixed", "five-bar"]),
)
def test_a_good_file_is_described(robot: str, mixed: str):
    machine = pteron.load(mixed if robot == "mixed" else robot)
    pteron.save(machine, "robot.toml")
    text = read("check robot.toml")
    assert "the file is valid; this machine can work." in text
    assert max(map(len, text.splitlines())) <= 60
    for noun in {leg.joint.noun for leg in machine.legs}:
        assert len(re.findall(rf"(?m)^Coordinate of a {noun}: ", text)) == 1
    found = json.loads(read("check robot.toml --json"))
    assert found["motion"] == machine.platform.motion
    assert [leg["type"] for leg in found["legs"]] == [leg.type for leg in machine.legs]
    assert found["legs"][1]["lengths"]["upper_length"] == machine.legs[1].upper_length
    assert all(f" {leg.type} " in text for leg in machine.legs)
    assert found["working_mode"] == "".join("+-"[leg.elbow < 0] for leg in machine.legs)
    home = found["home_pose"]
    assert np.isfinite(pteron.inverse_kinematics(machine, home)).all()
    at_home = pteron.kinematics.singular_orientations(
        machine, home[: len(machine.platform.lengths)]
    )
    assert found["singular_orientations"] == at_home.tolist()
    assert len(at_home) == (2 if robot in ("quadrupteron", "h4") else 0)
    assert ("at the home position" in text) == (robot == "h4")
    assert ("Singular orientations" in text) == machine.platform.turns
    assert found["tool"] == list(machine.platform.tool)
    assert ("Tool: " in text) == (robot == "h4")


def driven(robot, **more):
    drive = {"coulomb": 3.0, "viscous": 12.0, "rotor_inertia": 3e-5, "ratio": 392.7} | more
    legs = tuple(replace(leg, drive=pteron.legs.Drive(**drive)) for leg in robot.legs)
    return replace(robot, legs=legs)


@CLIENTS
def test_drives_are_a_table_and_data(mixed: str):
    robot = driven(pteron.load("quadrupteron"), stribeck=pteron.legs.Stribeck(1.0, 0.01))
    pteron.save(robot, "robot.toml")
    text = read("check robot.toml")
    assert max(map(len, text.splitlines())) <= 60
    assert re.search(r"dry friction \(N\) +3 ", text)
    assert re.search(r" +4\.626 ", text)
    assert json.loads(read("check robot.toml --json"))["legs"][0]["drive"] == {
        "coulomb": 3.0,
        "viscous": 12.0,
        "offset": 0.0,
        "rotor_inertia": 3e-5,
        "ratio": 392.7,
        "rest_speed": 0.001,
        "stribeck": {"force": 1.0, "speed": 0.01},
        "rated_torque": None,
        "max_force": None,
        "max_speed": None,
        "counts_per_turn": None,
        **dict.fromkeys(("elastic", "current_time", "winding", "lugre", "screw")),
        **{name: [] for name in ("curve", "ripple", "cogging")},
    }
    pteron.save(driven(pteron.load(mixed)), "mixed.toml")
    text = read("check mixed.toml")
    assert "3 N m" in text
    assert max(map(len, text.splitlines())) <= 60
    assert json.loads(read("check delta --json"))["legs"][0]["drive"] is None


def test_forces_of_drives_and_what_they_exceed():
    robot = driven(pteron.load("tripteron"), max_force=30.0, max_speed=1.5)
    pteron.save(robot, "robot.toml")
    state = "--pose 0,0,0 --velocity 1,0,-2 --acceleration 0,0,0"
    numbers = [0, 0, 0], [1, 0, -2], [0, 0, 0]
    rigid, driven_by = (
        pteron.inverse_dynamics(robot, *numbers),
        pteron.drive_forces(robot, *numbers),
    )
    for more, expected in (("", rigid), (" --drives", driven_by)):
        result = run(f"forces robot.toml {state}{more} --json")
        found = json.loads(result.stdout)
        np.testing.assert_allclose([found[f"force{i}"] for i in (1, 2, 3)], expected)
        # It is the drives that have limits: friction helps leg 3 to hold the weight.
        assert rigid[2] > 30.0 > driven_by[2]
        assert result.stderr == (
            "Note: leg 3: the motion takes up to 2 m/s, but its drive gives 1.5 m/s (max_speed)\n"
        )
    assert done("forces tripteron --pose 0,0,0 --drives") == done("forces tripteron --pose 0,0,0")


@CLIENTS
def test_colours_that_are_asked_for_bring_no_moving_pictures_into_a_pipe():
    plain, coloured = run("check quadrupteron"), run("check quadrupteron", FORCE_COLOR="1")
    assert "\x1b[" in coloured.stdout
    assert plain.stderr == coloured.stderr == ""


@CLIENTS
def test_a_name_is_no_markup():
    name = "[/red] [bold]odd[2J"
    Path("odd.toml").write_text(broken('name = "tripteron"', f'name = "{name}"'))
    assert f"{name}: the file is valid" in done("check odd.toml")
    coloured = run("check odd.toml", FORCE_COLOR="1")
    assert f"{name}: the file is valid" in re.sub(r"\x1b\[[0-9;]*m", "", coloured.output)
    refused("forces odd.toml --pose 0 0 0 --elbows x", name)
    Path("worse.toml").write_text(broken('name = "tripteron"', r'name = "odd\u001b[2J\u009b"'))
    assert not {"\x1b", "\x9b"} & {*refused("check worse.toml", "U+001B, U+009B")}


def symmetric() -> str:
    """Return a machine with fourfold symmetry, which is singular everywhere."""
    text = (
        'name = "cross"\n[platform]\nmotion = "3T1R"\n'
        "mass = 1.0\ncenter_of_mass = [0.0, 0.0]\ninertia = 0.01\n"
    )
    for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1)):
        text += (
            f"[[legs]]\nguide_point = [{0.2 * x}, {0.2 * y}, 0.0]\n"
            f"direction = [{-0.6 * y}, {0.6 * x}, 0.8]\n"
            f"platform_point = [{0.05 * x}, {0.05 * y}, 0.0]\n"
            "upper_length = 0.2\nlower_length = 0.2\nslider = { mass = 0.5 }\n"
            "upper = { mass = 0.3, center_of_mass = [0.1, 0.0], inertia = 0.004 }\n"
            "lower = { mass = 0.3, center_of_mass = [-0.1, 0.0], inertia = 0.004 }\n"
        )
    return text


def broken(old: str, new: str) -> str:
    pteron.save(pteron.load("tripteron"), "good.toml")
    text = Path("good.toml").read_text()
    Path("good.toml").unlink()
    assert old in text
    return text.replace(old, new)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("name =", "nmae =", ["nmae: unknown key; did you mean name?"]),
        ("elbow = 1", "elbw = 1", ["elbw: unknown key"]),
        ('motion = "3T"', 'motion = "4T"', ["platform.motion", "'4T'"]),
        ("[platform]", "[platform", ["not a TOML file", "line"]),
        ("upper_length = ", "upper_length = -", ["upper_length"]),
        ("[platform]", "[platform]\n\x07", ["not a TOML file"]),
    ],
)
def test_a_bad_file_is_one_line(old: str, new: str, words: list[str]):
    Path("bad.toml").write_text(broken(old, new))
    refused("inverse bad.toml 0 0 0", "bad.toml: ", *words)


def test_all_faults_of_a_file_are_told_at_once():
    Path("bad.toml").write_text(broken("elbow = 1", "elbw = 1").replace("name =", "nmae ="))
    result = run("check bad.toml")
    lines = result.stderr.splitlines()
    assert (result.exit_code, result.stdout, len(lines)) == (2, "", 4)
    assert all(line.startswith("Error: bad.toml: ") for line in lines)
    assert sum("elbw" in line for line in lines) == 3
    Path("bad.toml").write_text(broken("upper_length = ", "upper_length = -"))
    assert run("check bad.toml").stderr.count("is not positive") == 3


def test_what_is_possible_but_unlikely_is_doubted_aloud():
    robot = pteron.load("tripteron")
    leg = robot.legs[0]
    turned = pteron.bodies.PlanarInertia.of_body(leg.lower.mass, (0.09, 0.0), leg.lower.inertia)
    beyond = pteron.bodies.PlanarInertia.of_body(0.3, (0.25, 0.0), 0.02)
    legs = replace(leg, lower=turned), replace(robot.legs[1], upper=beyond), robot.legs[2]
    pteron.save(replace(robot, legs=legs), "odd.toml")
    result = run("check odd.toml")
    assert result.exit_code == 0
    first, second = result.stderr.splitlines()
    assert first.startswith("Warning: odd.toml: leg 1: lower: center_of_mass: x = 0.09 m is not")
    assert first.endswith("is it -0.09?")
    assert "leg 2: upper: center_of_mass: x = 0.25 m" in second
    verdict = "the file is valid; this machine can work. Check the 2 warnings above.\n"
    assert result.stdout.startswith(f"tripteron: {verdict}")
    found = json.loads(run("check odd.toml --json").stdout)
    assert len(found["doubts"]) == 2


def test_millimetres_in_a_file_are_doubted():
    robot = pteron.load("tripteron")
    assert all(machine_warnings(pteron.load(name)) == () for name in pteron.catalog())
    far = replace(robot.legs[0], upper_length=154.0, guide_point=(260.0, 0.0, 0.0))
    heavy = pteron.bodies.PlanarInertia.of_body(0.8, (0.006, -0.004), 2100.0)
    odd = replace(
        robot,
        gravity=(0.0, 0.0, -9810.0),
        platform=replace(robot.platform, inertia=heavy),
        legs=(far, *robot.legs[1:]),
    )
    found = machine_warnings(odd)
    # First the cause, in one line, and nothing that follows from it.
    assert [text.split(": ")[0] for text in found] == ["leg 1", "gravity", "platform"]
    assert found[0] == "leg 1: upper_length, guide_point: beyond 10 m: are these mm?"
    assert found[2].startswith("platform: inertia: 2100 kg m^2")


def test_lengths_in_millimetres_are_one_doubt_however_many():
    def scaled(values):
        return tuple(1000.0 * x for x in values)

    robot = pteron.load("par4")
    legs = tuple(
        replace(
            leg,
            **{key: scaled(leg.metres[key]) for key in leg.metres if "length" not in key},
            **{key: 1000.0 * leg.metres[key][0] for key in leg.metres if "length" in key},
        )
        for leg in robot.legs
    )
    bars = tuple(replace(bar, hinge=scaled(bar.hinge)) for bar in robot.platform.bars)
    tool = scaled(robot.platform.tool)
    platform = replace(robot.platform, bars=bars, tool=tool)
    assert machine_warnings(replace(robot, platform=platform, legs=legs)) == (
        "platform: tool, hinge of bars item 1, hinge of bars item 2; legs 1, 2, 3 and 4: "
        "upper_length, lower_length, guide_point, platform_point, fixed_offset: beyond 10 m: are "
        "these mm?",
    )
    bars = (replace(bars[0], hinge=(44.9, -44.9, 0.0)), robot.platform.bars[1])
    assert machine_warnings(replace(robot, platform=replace(robot.platform, bars=bars))) == (
        "platform: hinge of bars item 1: [44.9, -44.9, 0.0] m: are these mm?",
    )


def test_what_keeps_a_machine_from_working_and_what_is_doubted_are_lines_of_their_own():
    text = Path(pteron.save(pteron.load("linear-delta"), "mm.toml")).read_text()
    Path("mm.toml").write_text(text.replace("lower_length = 0.2294", "lower_length = 217.95", 1))
    told = run("check mm.toml")
    assert told.exit_code == 2
    doubt, error = told.stderr.splitlines()
    assert doubt == "Warning: mm.toml: leg 1: lower_length: 217.95 m: are these mm?"
    assert error.startswith("Error: mm.toml: no pose in reach of all legs keeps")
    assert "mm?" not in error


def test_a_machine_that_cannot_work_is_refused_with_the_file_s_name():
    Path("cross.toml").write_text(symmetric())
    refused("check cross.toml", "cross.toml: singular at every pose")
    refused("forces cross.toml --pose 0 0 0 0", "singular at every pose")
    refused("direct cross.toml 0 0 0 0", "singular at every pose")
    refused("check nowhere.toml", "nowhere.toml: neither a file nor a machine of the catalog")
    refused("check .", ".: cannot be read")
    Path("binary.toml").write_bytes(b"\xff\xfe\x00")
    refused("check binary.toml", "binary.toml: not a TOML file")


def test_a_machine_without_a_common_reach_is_refused():
    text = broken('name = "tripteron"', 'name = "short"')
    # Links of a centimetre, guides a decimetre apart.
    for leg in pteron.load("tripteron").legs:
        text = text.replace(f"upper_length = {leg.upper_length}", "upper_length = 0.01")
        text = text.replace(f"lower_length = {leg.lower_length}", "lower_length = 0.01")
    Path("short.toml").write_text(text)
    told = run("check short.toml")
    assert told.exit_code == 2
    *unlikely, error = told.stderr.splitlines()
    assert error.startswith("Error: short.toml: no pose is in reach of all legs")
    assert all(text.startswith("Warning: short.toml: leg") for text in unlikely)


# The report


@CLIENTS
def test_a_report_is_a_page_with_its_numbers(monkeypatch: pytest.MonkeyPatch):
    text = read("report tripteron --out one/two --elbows +-+")
    page = Path("one/two/report.html")
    assert page.read_text().lstrip().startswith("<!")
    assert sorted(file.name for file in page.parent.iterdir()) == ["report.html", "report.json"]
    written = json.loads(Path("one/two/report.json").read_text())
    assert written["elbows"] == [1, -1, 1]
    assert "16 (of 31 inertial parameters)" in " ".join(text.split())
    assert "peak force  RMS force" in text
    assert "singular phi" not in text
    assert f"Written: {page} (open it in a browser)" in text
    assert max(map(len, text.splitlines())) <= 60
    monkeypatch.setattr("pteron.report.write_report", lambda machine, folder, motion: page)
    shown = replace(pteron.load("tripteron"), gravity=(0.0, 0.0, -98.1))
    doubts = machine_warnings(shown)
    page.with_suffix(".json").write_text(json.dumps({**written, "doubts": doubts}))
    line = f"report {pteron.save(shown, 'odd.toml')} --out other"
    told = run(line).stderr.splitlines()
    assert told == [f"Warning: {doubts[0]}"]  # once: where it is loaded it is kept back
    page.with_suffix(".json").write_text(json.dumps(written))
    found = json.loads(read("report tripteron --out other --json"))
    assert found["page"] == str(page)
    assert found["home"] == written["home"]
    assert found["base_parameters"]["rank"] == 16
    assert "forces" not in found["cycle"]


@CLIENTS
def test_a_motion_is_a_page_or_in_a_report(monkeypatch: pytest.MonkeyPatch):
    done("cycle tripteron --to 0.1 0 0.05 --acceleration 5 --rate 200 --out way.csv")
    samples = len(pl.read_csv("way.csv"))
    text = done("play tripteron way.csv --out way.html --payload 0.5")
    assert re.search(rf"way.csv: \S+ s, {samples} samples\nWritten: way.html, 0\.\d MB", text)
    assert "way.csv" in Path("way.html").read_text("utf-8")
    found = json.loads(done("play tripteron --json"))
    assert found["page"] == "motion.html"
    assert found["bytes"] == Path("motion.html").stat().st_size
    assert (found["source"], found["log"]) == ("adept", False)
    seen = []

    def noted(machine, folder, motion):
        seen.append(motion)
        raise pteron.OutputError("noted")

    monkeypatch.setattr("pteron.report.write_report", noted)
    refused("report tripteron --out one --motion way.csv", "noted")
    assert len(seen[0].motion.time) == samples
    assert seen[0].source == "way.csv"


def test_a_report_has_the_payload_and_doubts_the_forces_of_another(monkeypatch):
    run("cycle tripteron --payload 1.5 --rate 50 --out loaded.csv")
    seen = []

    def noted(machine, folder, motion):
        seen.append((machine, force_doubts(machine, motion)))
        raise pteron.OutputError("noted")

    monkeypatch.setattr("pteron.report.write_report", noted)
    refused("report tripteron --out one --motion loaded.csv --payload 1.5", "noted")
    refused("report tripteron --out one --motion loaded.csv", "noted")
    (loaded, none), (bare, (doubt,)) = seen
    assert loaded.name == "tripteron with 1.5 kg"
    assert loaded.platform.inertia.mass == bare.platform.inertia.mass + 1.5
    assert none == ()
    peaks = r"loaded.csv: its forces are not .* the peak of leg 3 is 53\.\d+ N there and 34\.\d+ N"
    assert re.match(f"{peaks} here; was it made with a payload", doubt)
    frame = pl.read_csv("loaded.csv").with_columns(payload=1.5)
    frame.write_csv("column.csv")
    (doubt,) = force_doubts(bare, playback(bare, "column.csv"))
    assert "its column payload has up to 1.5 kg" in doubt


def test_a_motion_that_cannot_be_shown_is_one_line():
    Path("far.csv").write_text("t,x,y,z\n0,0,0,0\n1,0,0,0.1\n2,0,0,0.9\n")
    Path("empty.csv").write_text("")
    Path("words.csv").write_text("t,x,y,z\n0,0,0,zero\n1,0,0,0\n")
    refused("play tripteron far.csv", "far.csv: row 2 (line 3)", "its slider passes its limits")
    refused("report tripteron --out new --motion far.csv", "far.csv: row 2 (line 3)")
    refused("play tripteron empty.csv", "empty.csv")
    refused("play tripteron words.csv", "row 1 (line 2), column z: 'zero' given")
    refused("play tripteron none.csv", "none.csv: no such file")
    refused("play tripteron far.csv --payload -1", "-1.0 given, a mass of 0 kg or more expected")
    refused("play tripteron far.csv --cycle adept", "MOTION and --cycle given; give one of them")
    refused("play tripteron --out page.pdf", "page.pdf: a page is written", ".html")


def test_a_report_that_cannot_be_written_is_one_line():
    Path("file").write_text("mine")
    refused("report tripteron --out file", "file: cannot be written to as a folder (it is a file)")
    refused("report tripteron --out file/folder", "file/folder: cannot be written")
    refused("report tripteron --out /proc/here", "/proc/here: cannot be written")
    assert Path("file").read_text() == "mine"
    Path("cross.toml").write_text(symmetric())
    refused("report cross.toml --out .", "singular at every pose")


# Base parameters


def test_base_parameters_with_their_proof():
    text = done("base quadrupteron")
    assert text.startswith("m_p1 + m_u1 + 20.11 I_l1\n")
    assert "Exact rank 26 of 40" in text
    assert "\x1b" not in text
    found = json.loads(done("base quadrupteron --json"))
    assert (found["rank"], found["names"][0]) == (26, "m_p1")
    assert found == json.loads(done("base quadrupteron --format json"))


def test_base_parameters_in_other_forms():
    symbols = done("base quadrupteron --symbols")
    assert "ll1" in symbols.splitlines()[0]
    assert "share a symbol: s1y stands for s2x, s3y, s4x too; lu3 stands for ll3 too" in symbols
    assert "With --leg-symbols each leg has its own." in symbols
    own = done("base quadrupteron --leg-symbols")
    assert "I_u3 + (lu3^2/ll3^2) I_l3" in own
    assert "each with its symbol: s1y, s2x, s3y, s4x; lu3, ll3; lu2, lu4; ll2, ll4." in own
    table = done("base five-bar --format booktabs").splitlines()
    assert table[1] == r"\begin{table}"
    assert all(line.startswith("% ") for line in table[table.index(r"\end{table}") + 1 :])
    latex = done("base quadrupteron --format latex").splitlines()
    assert latex[0].startswith("m_{p1} + m_{u1}")
    assert all(line.startswith("% ") for line in latex[26:])
    python = done("base tripteron --format sympy --symbols").splitlines()
    assert sum(not line.startswith("# ") for line in python) == 16
    symbolic = json.loads(done("base tripteron --symbols --json"))
    assert len(symbolic["symbolic"]) == symbolic["rank"] == 16
    assert symbolic["geometry"]


def test_base_parameters_as_asked_for():
    kept = json.loads(done("base quadrupteron --keep I_l1,I_e --json"))["names"]
    assert {"I_l1", "I_e"} <= set(kept)
    assert json.loads(done("base quadrupteron --shared --json"))["rank"] < 26
    assert "Numerical rank 26" in done("base quadrupteron --method svd")
    refused("base quadrupteron --keep I_l1,I_x", "'I_x'")
    refused("base quadrupteron --method qr --symbols", "symbols", "exact")
    Path("cross.toml").write_text(symmetric())
    refused("base cross.toml", "singular at every pose")
    assert "Exact rank 13 of 25" in done("base delta --symbols")


def test_a_person_sees_base_parameters_with_values():
    text = read("base quadrupteron")
    assert "26 base parameters, sums of 40" in " ".join(text.split())
    assert "kg m^2" in text
    assert max(map(len, text.splitlines())) <= 60


def test_table_1_stands_printed_beside_computed(monkeypatch: pytest.MonkeyPatch):
    from pteron.report import table1

    text = done("table1")
    assert "26 of 26 base parameters of the paper" in text
    rows = json.loads(done("table1 --json"))
    assert rows[0]["printed"] == "m_p1 + m_u1 + 20.11 I_l1"
    assert all(row["agrees"] for row in rows)
    wrong = table1.Row("P_b1", "m_p1", "m_p1 + 2 m_u1", "m_p1 + m_u1", agrees=False, restored=False)
    monkeypatch.setattr(table1, "rows", lambda: (wrong,))
    result = run("table1")
    assert result.exit_code == 1
    assert "NO" in result.stdout
    assert "0 of 1 base parameters of the paper" in result.stdout
    assert run("table1 --json").exit_code == 1


# Pipes, interruptions and the like, some in a process of their own


def test_an_interruption_is_quiet(monkeypatch: pytest.MonkeyPatch):
    def interrupt(path: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("pteron.tables.read_table", interrupt)
    result = run("inverse tripteron --table poses.csv")
    assert (result.exit_code, result.stdout, result.stderr) == (130, "", "Interrupted\n")


@pytest.mark.skipif(os.name != "posix", reason="signals of another kind")
@pytest.mark.parametrize(
    "module",
    gated(["pteron", "numpy", "typer", "pteron.dynamics", "pteron.kernels"], ["pteron", "typer"]),
)
def test_an_interruption_while_modules_are_loaded_is_quiet(module: str):
    script = (
        "import os, signal, sys\n"
        "class Finder:\n"
        "    def find_spec(self, name, *more):\n"
        f"        if name == '{module}':\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Finder())\n"
    )
    command = [sys.executable, "-c", script + PROGRAM[-1], "forces", "tripteron", "--pose", "0,0,0"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (result.returncode, result.stdout, result.stderr) == (130, "", "Interrupted\n")


@pytest.mark.skipif(os.name != "posix", reason="signals of another kind")
def test_an_interruption_of_text_that_is_executed_has_its_exit_code(tmp_path: Path):
    (tmp_path / "sitecustomize.py").write_text(
        "import sys\n"
        "text = 'import os, signal\\nos.kill(os.getpid(), signal.SIGINT)\\nprint()'\n"
        "class Finder:\n"
        "    def find_spec(self, name, *more):\n"
        "        if name == 'pteron.dynamics':\n"
        "            exec(text)\n"
        "sys.meta_path.insert(0, Finder())\n"
    )
    paths = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    result = subprocess.run(
        [sys.executable, "-m", "pteron", "forces", "tripteron", "--pose", "0,0,0"],
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (result.returncode, result.stdout, result.stderr) == (130, "", "Interrupted\n")


def test_a_defect_of_pteron_is_not_hidden(monkeypatch: pytest.MonkeyPatch):
    def fail(path: str) -> None:
        raise RuntimeError("a defect")

    monkeypatch.setattr("pteron.tables.read_table", fail)
    assert isinstance(run("inverse tripteron --table poses.csv").exception, RuntimeError)


@CLIENTS
@pytest.mark.parametrize(("unbuffered", "as_json"), [("", []), ("1", ["--json"])])
def test_a_pipe_that_closes_ends_the_program_quietly(unbuffered: str, as_json: list[str]):
    motion(5000).write_csv("motion.csv")
    command = [*PROGRAM, "inverse", "quadrupteron", "--table", "motion.csv", *as_json]
    env = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=env
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.read(3)
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait() == 1


@CLIENTS
def test_a_pipeline_of_programs():
    first = subprocess.Popen(
        [*PROGRAM, "inverse", "quadrupteron", "--table", "-"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    second = subprocess.Popen(
        [*PROGRAM, "direct", "quadrupteron", "--table", "-", "--json"],
        stdin=first.stdout,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    assert first.stdin is not None
    assert first.stdout is not None
    first.stdout.close()
    first.stdin.write(POSES.encode())
    first.stdin.close()
    rows = json.loads(second.communicate()[0])
    assert (first.wait(), second.returncode) == (0, 0)
    assert {row["row"] for row in rows} == {1, 2}


@CLIENTS
@pytest.mark.skipif(os.name != "posix", reason="signals of another kind")
def test_a_wait_for_standard_input_can_be_interrupted():
    script = (
        "import sys\n"
        "class Input:\n"
        "    buffer = property(lambda self: self)\n"
        "    def read(self):\n"
        "        sys.stderr.write('reading\\n'); sys.stderr.flush()\n"
        "        return sys.__stdin__.buffer.read()\n"
        "sys.stdin = Input()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script + PROGRAM[-1], "inverse", "tripteron", "--table", "-"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == b"reading\n"
        time.sleep(0.2)
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=20) == 130
        assert process.stderr.read() == b"Interrupted\n"


@CLIENTS
@pytest.mark.skipif(os.name != "posix", reason="a shell of another kind")
@pytest.mark.parametrize(
    ("closed", "line", "status"),
    [
        (">&-", "inverse tripteron 0 0 0", 0),
        ("2>&-", "inverse tripteron 0 0 9", 2),
        ("<&-", "inverse tripteron --table -", 2),
    ],
)
def test_a_closed_stream_is_no_defect(closed: str, line: str, status: int):
    result = subprocess.run(
        f'"{sys.executable}" -c "{PROGRAM[-1]}" {line} {closed}',
        shell=True,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == status
    assert "Traceback" not in result.stderr
    assert result.stderr.count("\n") <= 1


@pytest.mark.parametrize("given", [None, "2"])
def test_linear_algebra_has_one_thread_unless_the_environment_says_otherwise(tmp_path, given):
    # NumPy reads it when it is imported: it counts what is there before.
    stand_in = tmp_path / "numpy.py"
    stand_in.write_text("import os; print(os.environ['OPENBLAS_NUM_THREADS']); os._exit(0)")
    paths = [str(tmp_path), os.environ.get("PYTHONPATH", "")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
    environment.pop("OPENBLAS_NUM_THREADS", None)
    if given is not None:
        environment["OPENBLAS_NUM_THREADS"] = given
    done = subprocess.run(
        [sys.executable, "-u", *PROGRAM[1:], "catalog"],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == [given or "1"]


@CLIENTS
def test_data_is_utf_8_in_every_locale():
    result = subprocess.run(
        [*PROGRAM, "inverse", "tripteron", "--table", "-"],
        input="größe,x,y,z\nä,0,0,0\n".encode(),
        capture_output=True,
        env={**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        check=True,
    )
    assert result.stdout.decode().startswith("größe,x,y,z,rho1,rho2,rho3\nä,")


@CLIENTS
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no full device here")
def test_a_full_disk_is_one_line():
    with Path("/dev/full").open("w") as full:
        result = subprocess.run(
            [*PROGRAM, "catalog"], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert result.returncode == 2
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith("Error: standard output: No space left")
