"""Logs taken at the motors, in another program's dialect: read by what the drives tell."""

from dataclasses import replace

import numpy as np
import pytest
from logs_of_motions import log_of, machine, truth
from mechanisms import CLIENTS
from typer.testing import CliRunner

import pteron
from pteron.cli.main import app
from pteron.errors import DataError
from pteron.identification import identify, open_log, read_log
from pteron.identification.logs import Description

RATIO, RATED, COUNTS = 300.0, 0.6, 131072.0


def driven():
    """Return a Tripteron whose motors are known; the second turns the other way."""
    robot = machine("tripteron")
    drives = [pteron.legs.Drive(ratio=s * RATIO, rated_torque=RATED) for s in (1.0, -1.0, 1.0)]
    drives = [replace(drive, counts_per_turn=COUNTS) for drive in drives]
    legs = [replace(leg, drive=one) for leg, one in zip(robot.legs, drives, strict=True)]
    return replace(robot, legs=tuple(legs))


def german(path, robot, *, unit="counts", decimals=0):
    """Write a log as a German drive's program does: decimal comma, ms, per cent, own names."""
    log = log_of(robot, duration=6.0, rate=500.0, force_noise=0.02)
    gear = np.array([leg.drive.ratio for leg in robot.legs])
    turns = log.joints * gear / (2.0 * np.pi)
    lag = {"counts": COUNTS * turns, "turns": turns, "mm": 1e3 * log.joints}[unit]
    percent = 100.0 * log.forces / (gear * RATED)
    names = [f"{word} Achse {i}" for word in ("Istlage", "Istmoment") for i in (1, 2, 3)]
    rows = [";".join(["Zeit", *names])]
    for t, q, f in zip(log.time, lag, percent, strict=True):
        cells = [f"{1e3 * t:.1f}", *(f"{v:.{decimals}f}" for v in q), *(f"{v:.3f}" for v in f)]
        rows.append(";".join(cells).replace(".", ","))
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return log


@pytest.mark.parametrize(("unit", "decimals"), [("counts", 0), ("turns", 7)])
def test_positions_and_forces_at_the_motor_are_taken_to_the_joint(tmp_path, unit, decimals):
    robot, path = driven(), tmp_path / "log.csv"
    plain = german(path, robot, unit=unit, decimals=decimals)
    path.with_suffix(".toml").write_text(
        f'[time]\nunit = "ms"\n[joints]\nunit = "{unit}"\n[forces]\nunit = "%"\n'
    )
    read = read_log(path, robot)
    np.testing.assert_allclose(read.joints, plain.joints, rtol=0, atol=1e-7)
    assert read.description.force_unit == "%"
    found = identify(robot, open_log(path, robot), cad=None)
    errors = (found.estimate.values - truth(found.model)) / found.estimate.deviations
    assert np.abs(errors).max() < 4.5
    assert any("100 % are 180 N, -180 N, 180 N" in one.message for one in found.findings)


def test_what_the_drives_do_not_tell_is_said_with_the_formula(tmp_path):
    robot, path = driven(), tmp_path / "log.csv"
    german(path, robot)
    told = Description(time_unit="ms", joint_unit="counts", column_force_unit="%")
    bare = machine("tripteron")
    with pytest.raises(DataError, match=r"no ratio and counts_per_turn \(legs 1, 2, 3\)"):
        open_log(path, bare, description=told)
    german(path, robot, unit="mm", decimals=4)
    log = read_log(path, bare, description=replace(told, joint_unit="mm"))
    with pytest.raises(DataError, match="per cent / 100 times rated_torque times ratio"):
        identify(bare, log)


@CLIENTS
def test_all_that_is_undeclared_is_told_at_once_as_lines_to_paste(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    robot = driven()
    pteron.save(robot, "robot.toml")
    german(tmp_path / "log.csv", robot, unit="mm", decimals=4)
    text = (tmp_path / "log.csv").read_text(encoding="utf-8")
    text = text.replace("Istlage Achse", "Geber").replace("Istmoment Achse", "Last")
    (tmp_path / "log.csv").write_text(text, encoding="utf-8")
    command = ["identify", "log.csv", "--robot", "robot.toml", "--out", "result"]
    refused = CliRunner().invoke(app, command)
    assert refused.exit_code != 0
    told, start, lines = refused.stderr.partition("\n[")
    assert "4 things are not told: (1) no columns for the sliders; (2)" in told
    (tmp_path / "log.toml").write_text((start + lines).replace('"N"', '"%"'), encoding="utf-8")
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.stderr
    assert done.stdout.startswith(f"{robot.name}: trustworthy")
