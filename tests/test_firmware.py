"""Printers' firmware: a Delta's numbers out and in, held against the firmware's formulas."""

import re
from dataclasses import replace

import numpy as np
import pytest
from firmware_logs import CFG

import pteron
from pteron.calibration import read_measurements
from pteron.errors import DataError
from pteron.export import export_klipper, export_marlin, export_reprap, from_klipper
from pteron.export.printers.linear_delta import LinearDelta
from pteron.export.printers.printer_cfg import printer_cfg, setting

TOWERS = {"X": 210.0, "Y": 330.0, "Z": 90.0}


def words(line):
    """Return the numbers of a line of G-code by their letters."""
    return {w[0]: [float(v) for v in w[1:].split(":")] for w in line.split()[1:]}


def firmware(path, *, marlin):
    """Return carriages' ways down from their end stops at places (K, 3), mm, as M665 has them."""
    lines = [line for line in path.read_text().splitlines() if line.startswith("M66")]
    m665, m666 = map(words, lines)
    ways = []
    for k, (axis, own) in enumerate(TOWERS.items()):
        angle = np.radians(own + m665[axis][0])
        tower = m665["R"][0] * np.array([np.cos(angle), np.sin(angle)])
        rod = m665["L"][0] + m665.get("ABC"[k], [0.0])[0] if marlin else m665["L"][k]
        below = np.sqrt(rod**2 - m665["R"][0] ** 2)
        # Marlin moves down from the switch by M666, to H; RepRapFirmware's switch is that above H.
        end = m665["H"][0] + below + (-1.0 if marlin else 1.0) * m666[axis][0]
        assert not marlin or m666[axis][0] <= 0.0

        def way(p, tower=tower, rod=rod, end=end):
            return end - p[:, 2] - np.sqrt(rod**2 - ((p[:, :2] - tower) ** 2).sum(axis=1))

        ways.append(way)
    return ways


def places(radius=100.0):
    turns = np.linspace(0.0, 2.0 * np.pi, 7)
    return np.stack([radius * np.cos(turns), radius * np.sin(turns), 5.0 + turns], axis=-1)


def uneven():
    """Return a printer with three rods and towers about their places, its legs in another order."""
    cfg = CFG.replace("[stepper_c]", "[stepper_c]\narm_length: 279.2\nangle: 91.5")
    robot = from_klipper(cfg, name="uneven")
    return replace(robot, legs=(robot.legs[1], robot.legs[2], robot.legs[0]))


@pytest.mark.parametrize("marlin", [True, False], ids=["marlin", "reprap"])
def test_m665_and_m666_move_the_carriages_as_the_machine_does(tmp_path, marlin):
    robot = uneven()
    (path,) = (export_marlin if marlin else export_reprap)(robot, tmp_path)
    assert "X is leg 3, Y is leg 1, Z is leg 2" in path.read_text()
    joints = pteron.inverse_kinematics(robot, 1e-3 * places())
    for way, leg in zip(firmware(path, marlin=marlin), (2, 0, 1), strict=True):
        down = 1e3 * (robot.legs[leg].limits[1] - joints[:, leg])
        np.testing.assert_allclose(way(places()), down, rtol=0.0, atol=5e-4)


def test_a_printers_configuration_comes_back_as_it_was(tmp_path):
    robot = from_klipper(CFG, name="printer")
    (path,) = export_klipper(robot, tmp_path)
    again, given = printer_cfg(path.read_text()), printer_cfg(CFG)
    for section, key in (
        ("printer", "delta_radius"),
        *((f"stepper_{t}", k) for t in "abc" for k in ("angle", "arm_length", "position_endstop")),
        ("stepper_a", "rotation_distance"),
    ):
        own = setting(given, section, key)
        usual = {"arm_length": 280.0, "angle": 90.0}.get(key)
        assert setting(again, section, key) == pytest.approx(own or usual, abs=1e-9)
    assert setting(again, "stepper_b", "rotation_distance") == pytest.approx(32.0)
    # Where Klipper's stable position is, and ours, by its delta.py.
    radius, joints = 141.553523, pteron.inverse_kinematics(robot, 1e-3 * places())
    for leg, angle, q in zip(robot.legs, (210.181908, 329.784204, 90.0), joints.T, strict=True):
        a = np.radians(angle)
        away = places()[:, :2] - radius * np.array([np.cos(a), np.sin(a)])
        height = places()[:, 2] + np.sqrt(280.0**2 - (away**2).sum(axis=1))
        np.testing.assert_allclose(1e3 * q, height, rtol=0.0, atol=1e-9)
        assert leg.limits[1] > 0.6
    assert from_klipper(path) == replace(robot, legs=from_klipper(path).legs)
    assert np.isfinite(pteron.inverse_dynamics(robot, [0.0, 0.0, 0.1], [0.0] * 3, [0.0] * 3)).all()


ROTARY = """[printer]
kinematics: rotary_delta
shoulder_radius: 33.9
shoulder_height: 412.9
[stepper_a]
microsteps: 16
gear_ratio: 107.000:16, 60:16
upper_arm_length: 170.0
lower_arm_length: 320.0
position_endstop: 252.0
[stepper_b]
microsteps: 16
gear_ratio: 107.000:16, 60:16
angle: 151.25
upper_arm_length: 170.6
[stepper_c]
microsteps: 16
gear_ratio: 107.000:16, 60:16
position_endstop: 251.2
[delta_calibrate]
height0: 252.0
height0_pos: 0, 0, 0
height1: 200.0
height1_pos: 2000.0, 1900.0, 2100.0
"""


def test_a_rotary_printer_comes_back_as_it_was_and_its_stable_positions_are_angles(tmp_path):
    robot = from_klipper(ROTARY)
    (path,) = export_klipper(robot, tmp_path)
    given, again = printer_cfg(ROTARY), printer_cfg(path.read_text())
    assert again["printer"]["kinematics"] == "rotary_delta"
    for section, key in (
        *(("printer", f"shoulder_{k}") for k in ("radius", "height")),
        *((f"stepper_{t}", f"{k}_arm_length") for t in "abc" for k in ("upper", "lower")),
        *((f"stepper_{t}", k) for t in "abc" for k in ("position_endstop", "angle")),
    ):
        usual = {"stepper_a": 30.0, "stepper_c": 270.0}.get(section)
        own = setting(given, section, key) or setting(given, "stepper_a", key) or usual
        assert setting(again, section, key) == pytest.approx(own, abs=1e-9)
    motor = 107.0 / 16.0 * 60.0 / 16.0
    assert again["stepper_b"]["gear_ratio"] == f"{motor:.9g}:1"
    # Its rotary_delta.py: 0 where an arm is level, elbows a lower arm away from the wrists.
    poses = 1e-3 * places(60.0)
    joints = pteron.inverse_kinematics(robot, poses)
    for leg, angle, q in zip(robot.legs, (30.0, 151.25, 270.0), joints.T, strict=True):
        out = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])
        elbow = (0.0339 + leg.upper_length * np.cos(q))[:, None] * out
        elbow[:, 2] = 0.4129 + leg.upper_length * np.sin(q)
        np.testing.assert_allclose(np.linalg.norm(poses - elbow, axis=1), 0.32, atol=1e-12)
    (tmp_path / "printer.cfg").write_text(ROTARY)
    found = read_measurements(robot, tmp_path / "printer.cfg")
    np.testing.assert_allclose(found.heights, [0.252, 0.2])
    ends = np.array([leg.limits[1] for leg in robot.legs])
    np.testing.assert_allclose(found.readings[0], ends, atol=1e-12)
    turned = 2.0 * np.pi / (200 * 16 * motor) * np.array([2000.0, 1900.0, 2100.0])
    np.testing.assert_allclose(found.readings[1], ends - turned, atol=1e-12)


def leaning(millimetres):
    """Return a printer whose second tower stands farther out, and leans."""
    robot = from_klipper(CFG, name="leaning")
    legs = list(robot.legs)
    out = np.array(legs[1].guide_point) / np.linalg.norm(legs[1].guide_point)
    lean = np.array([2e-3, 1e-3, 1.0])
    legs[1] = replace(
        legs[1],
        guide_point=tuple(legs[1].guide_point + 1e-3 * millimetres * out),
        slider_direction=tuple(lean / np.linalg.norm(lean)),
    )
    return replace(robot, legs=tuple(legs))


def test_what_the_firmware_cannot_say_is_told_with_its_effect(tmp_path):
    robot = leaning(0.5)
    found = LinearDelta.from_robot(robot)
    assert 2e-5 < found.deviation < 3e-4
    text = " ".join(export_reprap(robot, tmp_path)[0].read_text().split())
    assert f"up to {1e3 * found.deviation:.3f} mm from where it takes it to be" in text
    assert "mm from where it takes it" in " ".join(
        export_klipper(robot, tmp_path)[0].read_text().split()
    ).replace("# ", "")
    # Carriages where the firmware puts them: so far away is the tool, on the bed's rim at most.
    ways = firmware(export_reprap(robot, tmp_path)[0], marlin=False)
    asked = places(1e3 * found.bed)
    asked[:, 2] = 0.0
    ends = np.array([leg.limits[1] for leg in robot.legs])
    joints = ends - 1e-3 * np.stack([way(asked) for way in ways], axis=-1)
    poses = pteron.direct_kinematics(robot, joints)
    apart = np.linalg.norm(poses - 1e-3 * asked[:, None], axis=-1)
    assert np.nanmin(apart, axis=1).max() == pytest.approx(found.deviation, rel=0.3)
    with pytest.raises(pteron.ModelError, match="M665 does not fit leg 2"):
        export_marlin(leaning(30.0), tmp_path)


@pytest.mark.parametrize(
    ("robot", "told"),
    [("delta", "no linear Delta"), ("orthoglide", "its guide is not vertical")],
)
def test_other_machines_are_refused(tmp_path, robot, told):
    with pytest.raises(pteron.ModelError, match=told):
        export_marlin(robot, tmp_path)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (("kinematics: delta", "kinematics: corexy"), "kinematics are 'corexy'; delta and rotary"),
        (("delta_radius: 141.553523", ""), "delta_radius: None given, mm above 0"),
        (("arm_length: 280.0", "arm_length: 2o0"), "arm_length: '2o0' given, a number"),
        (("arm_length: 280.0", "arm_length: 100"), "[stepper_a] arm_length: too short to reach"),
        (("gear_ratio: 80:40", "gear_ratio: 80"), "gear_ratio: '80' given, such as 5:1"),
        (("[printer]", "printer"), "no printer.cfg of Klipper"),
    ],
)
def test_a_configuration_with_a_fault_is_refused_with_the_key(change, told):
    with pytest.raises(DataError, match=re.escape(told)):
        from_klipper(CFG.replace(*change))
