"""The report on a calibration: a whole page, the machine's file, and pictures of both machines."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from measured import built, positions
from mechanisms import CATALOG, CLIENTS
from page_reader import HOSTILE, Reader, strict

import pteron
from pteron.calibration import Measurements, calibrate
from pteron.errors import DataError, OutputError
from pteron.manipulator.machine_record import machine_record
from pteron.motion import joint_points
from pteron.motion.enlarged_points import enlarged_points, greatest_difference
from pteron.report.calibration import firmware_fit, value_rows, write_calibration

DRAWN = replace(CATALOG["linear-delta"], name=HOSTILE)
TRUE = built(DRAWN)


@lru_cache
def calibration():
    readings, poses = positions(DRAWN, TRUE, 30)
    return calibrate(DRAWN, Measurements.from_readings(DRAWN, readings, poses=poses))


@CLIENTS
def test_the_page_is_whole_and_says_the_verdict_first(tmp_path: Path):
    result = calibration()
    files = write_calibration(result, tmp_path / "a" / "b")
    text = files.page.read_text("utf-8")
    page = Reader(text)
    assert page.faults == page.open == page.sources == []
    assert page.ids[0] == "verdict"
    words = " ".join(page.text.split())
    for line in (*result.verdict.reasons, *result.observability.unseen):
        assert " ".join(line.split()).replace("-", "\u2212")[:40] in words.replace("-", "\u2212")
    for row in value_rows(result):
        assert row.found in words
        assert row.name in words
    # Arrows, the machine, residuals, the verdict's mark, and three slices before; what stays open
    # after has the lightest shade of their common scale.
    assert text.count("<svg") == 7
    assert text.count("below the second shade: it has no map") == 3
    assert "7 * 6" in words

    data = strict(files.numbers.read_text("utf-8"))
    assert data["rank"] == result.observability.rank
    assert [value["name"] for value in data["values"]] == [value.name for value in result.values]


@CLIENTS
def test_of_a_machine_that_turns_only_the_angles_are_mapped(tmp_path: Path):
    robot = pteron.load("ankle")
    poses, off = pteron.random_poses(robot, 30), np.array([0.01, -0.01])
    readings = pteron.inverse_kinematics(robot, poses)
    given = Measurements.from_readings(robot, readings + off, poses=poses)
    result = calibrate(robot, given, free=["zeros"])
    asked = np.array([0.1, -0.2])
    ends = pteron.inverse_kinematics(robot, asked) - np.outer(np.linspace(0.0, 1.0, 5), off)
    expected = pteron.follow(robot, ends, asked)[-1] - asked
    errors, left = result.errors(asked)
    np.testing.assert_allclose(errors[0], expected, rtol=0.0, atol=1e-9)
    assert left[0] < 1e-6 < 5e-3 < np.linalg.norm(expected)
    text = write_calibration(result, tmp_path).page.read_text("utf-8")
    assert "Before, in mrad" in text
    assert "the tool goes wrong" not in text


@CLIENTS
def test_the_file_holds_the_machine_as_found(tmp_path: Path):
    model = write_calibration(calibration(), tmp_path).model
    found = pteron.load(model)
    assert found == calibration().robot
    data = strict(model.with_name("calibration.json").read_text("utf-8"))
    assert data["calibrated_geometry"] == machine_record(found)["geometry"]
    assert data["machine"] == machine_record(DRAWN)
    comments = [line for line in model.read_text("utf-8").splitlines() if line.startswith("#")]
    assert any("Verdict: " in line for line in comments)
    assert any("identify them again" in line for line in comments)


def test_guides_that_tolerances_tilt_have_their_home_where_parallel_ones_have():
    homes = [pteron.workspace.home_pose(robot) for robot in (DRAWN, TRUE)]
    np.testing.assert_allclose(*homes, rtol=0.0, atol=0.1)


def test_a_file_that_is_read_is_not_replaced(tmp_path: Path):
    drawing = pteron.save(DRAWN, tmp_path / "robot.toml")
    before = drawing.read_bytes()
    with pytest.raises(OutputError, match="would replace a file that is read"):
        write_calibration(calibration(), tmp_path, sources=[drawing])
    assert [path.name for path in tmp_path.iterdir()] == ["robot.toml"]
    assert drawing.read_bytes() == before


def test_enlarged_once_a_machine_is_the_other():
    home = pteron.workspace.home_pose(DRAWN)
    drawn, found = (joint_points(robot, home) for robot in (DRAWN, TRUE))
    for one, other in zip(enlarged_points(drawn, found, 1.0).links, found.links, strict=True):
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-15)
    twice = enlarged_points(drawn, found, 2.0)
    assert greatest_difference(drawn, twice) == pytest.approx(
        2.0 * greatest_difference(drawn, found)
    )
    assert greatest_difference(drawn, drawn) == 0.0


def test_machines_of_other_kinds_are_not_compared():
    with pytest.raises(DataError, match="no machine to compare with"):
        pteron.plots.differences_figure("linear-delta", "delta")


def test_a_picture_says_how_many_times_differences_are_enlarged():
    robot = CATALOG["five-bar"]
    figure = pteron.plots.differences_figure(robot, built(robot, share=0.5), enlarge=20)
    assert figure.get_suptitle() == "differences 20 times enlarged"


def test_a_quantity_has_one_unit_and_values_that_changed_most_come_first(tmp_path: Path):
    text = write_calibration(calibration(), tmp_path).page.read_text("utf-8")
    assert "µm" not in text
    assert text.count("Before, in mm: up to ") == text.count("open after is up to 0.0") == 3
    sizes = [row.size for row in value_rows(calibration())]
    assert sizes == sorted(sizes, reverse=True)
    assert f"{len(sizes) - 12} more, which changed less" in text
    words = " ".join(Reader(text).text.split())
    assert "What to do next" in words
    assert "pteron view robot.toml" in words


def test_a_printer_gets_its_firmwares_values_first(tmp_path: Path):
    robot = CATALOG["linear-delta"]
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-0.055, 0.055, (2, 40))
    readings = pteron.inverse_kinematics(robot, np.stack([x, y, 0.0 * x], axis=-1))
    off = np.array([3e-4, -2e-4, 1e-4])  # of end stops
    given = Measurements.from_readings(
        robot, readings + off, heights=2e-5 * rng.standard_normal(40)
    )
    result = calibrate(robot, given)
    firmware = firmware_fit(result)
    assert firmware is not None
    assert [row.name for row in firmware.rows] == [
        "delta radius",
        *(f"angle of tower {k}" for k in (1, 2)),
        *(f"end stop of tower {k}" for k in (1, 2, 3)),
        *(f"rods of tower {k}" for k in (1, 2, 3)),
    ]
    assert {row.half for row in firmware.rows[6:]} == {"not shown by heights"}
    changes = [float(row.change.replace("\u2212", "-")) for row in firmware.rows[:6]]
    assert changes == pytest.approx([0.0, 0.0, 0.0, -0.3, 0.2, -0.1], abs=0.06)
    assert result.held_out is None
    assert "at 8 rows held out of the fit, the height error is 0.0" in firmware.sentence
    files = write_calibration(result, tmp_path, firmware=firmware)
    page = Reader(files.page.read_text("utf-8"))
    assert page.faults == page.open == []
    assert page.ids.index("firmware") < page.ids.index("errors")
    words = " ".join(page.text.split())
    assert "pteron export firmware.toml" in words
    assert strict(files.numbers.read_text("utf-8"))["firmware"]["values"][0]["unit"] == "mm"


def test_a_machine_that_is_no_printer_has_no_firmware():
    robot = pteron.load("five-bar")
    poses = pteron.random_poses(robot, 30)
    joints = pteron.inverse_kinematics(robot, poses)
    assert (
        firmware_fit(calibrate(robot, Measurements.from_readings(robot, joints, poses=poses)))
        is None
    )
