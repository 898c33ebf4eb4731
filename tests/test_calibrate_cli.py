"""`pteron calibrate`: files that agree with the terminal, refusals of one line."""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from commands import done, refused
from measured import built, positions
from mechanisms import CATALOG, CLIENTS

import pteron

DRAWN = CATALOG["linear-delta"]


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    log().write_csv("log.csv")


@lru_cache
def log() -> pl.DataFrame:
    readings, poses = positions(DRAWN, built(DRAWN), 30)
    columns = {f"rho{i}": readings[:, i - 1] for i in (1, 2, 3)}
    return pl.DataFrame(columns | dict(zip("xyz", poses.T, strict=True)))


@CLIENTS
def test_the_files_agree_with_the_terminal():
    text = done("calibrate log.csv --robot linear-delta --out found")
    folder = Path("found")
    names = ["calibration.html", "calibration.json", "firmware.toml", "robot.toml"]
    assert sorted(file.name for file in folder.iterdir()) == names
    data = json.loads((folder / "calibration.json").read_text("utf-8"))
    assert text.startswith(f"linear-delta: {data['verdict']['grade']}, {data['shown']} of ")
    for line in (*data["verdict"]["reasons"], *data["notes"]):
        assert f"{line}\n" in text
    # The full geometry of a printer is on the page.
    assert data["unseen"]
    assert "Not determined, kept as drawn" not in text
    assert f"The {len(data['values'])} values of the full geometry" in text
    for name in names:
        assert f"Written: {folder / name}\n" in text
    errors = data["held_out"]
    assert errors["after"]["position"] < 0.05 * errors["before"]["position"]
    assert pteron.load(folder / "robot.toml").legs != DRAWN.legs


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--robot linear-delta --out a", "give logs of measurements, or --plan"),
        ("log.csv --robot linear-delta --plan 5 --out a", "give logs of measurements, or --plan"),
        ("no.csv --robot linear-delta --out a", "no.csv"),
        ("log.csv --robot linear-delta --free rods --out a", "'rods': no group or value"),
        ("log.csv --robot linear-delta --prior p.toml --out a", "a standard deviation in m or rad"),
        ("log.csv --robot linear-delta --prior no.toml --out a", "no.toml: there is no such file"),
        ("log.csv --robot linear-delta --out log.csv", "it is a file"),
        ("--plan 9 --robot ankle --out plan.csv", "a point that stays where it is"),
        ("log.csv --plane z=0 --robot linear-delta --out a", "--plane goes with --plan"),
        (
            "--plan 9 --plane y=0 --measure heights --robot linear-delta --out plan.csv",
            "z=HEIGHT expected",
        ),
        (
            "--plan 9 --plane z=0.3 --measure heights --robot linear-delta --out plan.csv",
            "is proved to be in reach",
        ),
        ("log.csv --robot robot.toml --out .", "would replace a file that is read"),
    ],
)
def test_a_users_error_is_one_line_and_leaves_nothing(options: str, words: str):
    Path("p.toml").write_text("legs = [1.0]\n", "utf-8")
    pteron.save(DRAWN, "robot.toml")
    refused(f"calibrate {options}", words)


def test_planned_poses_are_a_table_that_the_machine_runs():
    text = done("calibrate --plan 9 --measure heights --robot linear-delta --out plan.csv")
    table = pl.read_csv("plan.csv")
    assert table.columns == ["x", "y", "z", "rho1", "rho2", "rho3"]
    poses, joints = table.select("x", "y", "z").to_numpy(), table.select("^rho.$").to_numpy()
    assert pteron.inverse_kinematics(DRAWN, poses) == pytest.approx(joints, abs=1e-12)
    assert len(table) == 9
    # On the printer's bed, and out to its rim.
    assert set(poses[:, 2]) == {0.0}
    assert np.hypot(*poses[:, :2].T).max() > 0.085
    assert "over the plane z = 0 mm, in a disc of radius 87 mm" in " ".join(text.split())
    assert "every pose in it is proved to be in reach" in " ".join(text.split())
    assert "From 54 poses on, some are held out" in " ".join(text.split())


def test_what_is_not_trustworthy_is_written_anyway_only_on_demand():
    readings, poses = log().select("^rho.$"), log().select("x", "y", "z")
    order = np.random.default_rng(0).permutation(len(poses))
    pl.concat([readings, poses[order]], how="horizontal").write_csv("mixed.csv")
    text = done("calibrate mixed.csv --robot linear-delta --out found")
    assert text.startswith("linear-delta: not trustworthy, ")
    assert "robot.toml is not written, as the calibration is not trustworthy (--anyway" in text
    assert sorted(path.name for path in Path("found").iterdir()) == [
        "calibration.html",
        "calibration.json",
    ]
    text = done("calibrate mixed.csv --robot linear-delta --out found --anyway")
    assert "Written: found/robot.toml" in text


def test_a_mistake_of_the_whole_log_is_the_first_sentence_and_undone_on_the_page():
    log().rename({"rho1": "rho2", "rho2": "rho1"}).write_csv("swapped.csv")
    text = done("calibrate swapped.csv --robot linear-delta --out found")
    assert text.startswith("linear-delta: not trustworthy, ")
    first = json.loads(Path("found/calibration.json").read_text("utf-8"))["verdict"]["reasons"][0]
    assert first.startswith("The readings of legs 1 and 2 (rho1 and rho2) are swapped: exchange")
    assert f"{first}\n" in text
    assert "(--anyway writes it)" in text
    assert not Path("found/robot.toml").exists()
    text = done("calibrate swapped.csv --robot linear-delta --out found --anyway")
    assert "belongs to the log with its mistake undone: correct the log" in text
    found, sound = pteron.load("found/robot.toml"), Path("sound/robot.toml")
    done("calibrate log.csv --robot linear-delta --out sound")
    poses = log().select("x", "y", "z").to_numpy()
    joints = [pteron.inverse_kinematics(robot, poses) for robot in (found, pteron.load(sound))]
    np.testing.assert_allclose(*joints, rtol=0.0, atol=1e-8)
