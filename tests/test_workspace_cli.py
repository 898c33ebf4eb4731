"""`pteron workspace` as a person and as a program meet it."""

import json
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from commands import done, read, refused, run
from mechanisms import gated

import pteron
from pteron.indices import evaluate
from pteron.maps import load_map
from pteron.workspace import conditions

SLICE = "--slice x=-0.1:0.1,y=0.05:0.17 --points 9"
"""Of a five-bar: next to nothing to compute."""


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_pipe_gets_a_row_an_index_and_json_all_that_is_known():
    asked = f"workspace five-bar --index kappa --index condition {SLICE}"
    rows = pl.read_csv(StringIO(done(asked)))
    data = json.loads(done(f"{asked} --json"))
    assert rows["index"].to_list() == ["kappa", "condition"]
    assert (data["poses"], data["held"], data["warnings"]) == (81, {}, [])
    for row, one in zip(rows.to_dicts(), data["indices"], strict=True):
        pose = [row["best_x"], row["best_y"]]
        assert pose == one["best_pose"]
        assert evaluate("five-bar", row["index"], pose) == pytest.approx(row["best"])
        assert row["best"] <= row["median"] <= row["worst"] == one["worst"]
    assert data["in_reach"] + sum(data["causes"].values()) == pytest.approx(1.0)
    assert data["reach"]["unit"] == "m^2"
    assert 0.0 < data["reach"]["volume"] < np.prod(np.diff(data["reach"]["box"], axis=0))


def test_a_person_reads_the_reach_what_ends_it_and_each_index():
    text = read(f"workspace five-bar --index condition {SLICE}")
    assert max(map(len, text.splitlines())) <= 60
    words = " ".join(text.split())
    grid = "Map: x -0.1 to 0.1 m, y 0.05 to 0.17 m: 81 poses"
    for part in ("Workspace: x ", "area ", grid, "best"):
        assert part in words
    assert "% out of reach of leg" in words
    assert "at x y (m)" in words


@pytest.mark.parametrize("ending", gated(["png", "svg", "csv", "npz", "zarr"], ["svg", "zarr"]))
def test_files_are_what_their_endings_say(ending):
    result = run(f"workspace five-bar --index condition {SLICE} --out map.{ending}")
    assert result.exit_code == 0, result.stderr
    assert f"Written: map.{ending}" in result.stderr
    if ending in ("png", "svg"):
        head = Path(f"map.{ending}").read_bytes()[:5]
        assert head == (b"\x89PNG\r" if ending == "png" else b"<?xml")
    else:
        assert load_map(f"map.{ending}").grid.shape == (9, 9)


def test_surfaces_and_films_take_three_coordinates():
    spans = "--slice x=-0.05:0.05:5,y=-0.05:0.05:5,phi=-0.2:0.2:3"
    for file in ("map.vtk", "map.gif"):
        assert run(f"workspace 3-prr --index condition {spans} --out {file}").exit_code == 0
        assert Path(file).stat().st_size > 500
        refused(f"workspace five-bar {SLICE} --out {file}", "three coordinates", "x, y")


def test_a_machine_that_is_singular_everywhere_is_told_so_first():
    robot = pteron.load("quadrupteron")
    pteron.save(replace(robot, legs=(robot.legs[0],) * 4), "flat.toml")
    result = run("workspace flat.toml --index condition --slice z=0,phi=0 --points 5")
    assert result.exit_code == 0
    assert result.stderr.startswith("Warning: quadrupteron: singular at every pose (type II)")


def test_where_nothing_is_in_reach_it_is_said_why():
    spans = "--slice x=-0.1:0.1,y=-0.1:0.1,z=0.9 --points 3"
    result = run(f"workspace tripteron --index condition {spans}")
    assert "Warning: nothing is in reach at z = 0.9 m: z goes from -0.17 to 0.3 m" in result.stderr
    assert result.exit_code == 0


def test_certify_tells_what_is_proved_of_the_workspace():
    data = json.loads(done("workspace five-bar --certify --tolerance 0.2 --json"))
    assert 0.0 < data["inner"] < data["outer"] < 1.2 * data["inner"]
    assert data["gap"] == pytest.approx(data["outer"] / data["inner"] - 1.0)
    assert data["cube"]["edge"] ** 2 < data["inner"]
    assert set(data["boundary"]) <= set(map(str, conditions("five-bar")))
    assert sum(data["boundary"].values()) <= 1.0 + 1e-12


def test_prove_ends_with_0_only_if_it_is_proved():
    proved = done("workspace five-bar --prove x=-0.01:0.01,y=0.14:0.15 --type-ii 0.1")
    assert "proved: every pose meets all 9 conditions" in proved
    result = run("workspace five-bar --prove x=-0.01:0.01,y=0.14:0.25 --json")
    data = json.loads(result.stdout)
    assert (result.exit_code, data["proved"]) == (1, False)
    with pytest.raises(pteron.UnreachablePose):
        pteron.inverse_kinematics("five-bar", data["pose"])
    assert "stretched (it misses the pose by" in data["why"]


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ("--prove x=0:1", "--prove: no y; a region says all of x, y"),
        ("--prove x=0:0.1:9,y=0.1", "a proof is of all poses between"),
        ("--prove x=0,y=100", "y up to 100: are these mm?"),
        ("--prove x=0,y=0.1 --tolerance 0.1", "--tolerance: does not go with --prove"),
        ("--certify --index kappa", "--index: does not go with --certify"),
        ("--certify --slice x=0", "only phi=VALUE"),
        ("--certify --tolerance 0", "--tolerance: 0 given, a number above 0 expected"),
        ("--type-ii 0.1", "--type-ii: does not go with a map"),
        ("--index kapa", "--index: 'kapa' is not known; did you mean kappa? there are condition"),
        ("--index turning_speed", "turning_speed is about turning, which five-bar does not"),
        ("--index kappa --index condition --out a.gif", "--index: 2 given, and a.gif shows one"),
        ("--slice z=0", "z: is no coordinate of five-bar, whose poses have x, y"),
        ("--slice x:0", "--slice: 'x:0' given; NAME=VALUE or NAME=LEAST:GREATEST[:COUNT]"),
        ("--slice x=100mm", "in m and rad without the unit"),
        ("--slice x=100", "x up to 100: are these mm? m are expected"),
        ("--slice x=0,x=1", "--slice: x given twice"),
        ("--out map.jpg", "map.jpg: .jpg ending; give one of .png"),
        ("--out nowhere/map.png", "there is no folder nowhere"),
        ("--scheduler tcp://localhost:9", "the workers write to a store that all reach"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(asked, words):
    refused(f"workspace five-bar {asked}", words)
