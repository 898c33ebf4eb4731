"""The machines of five freedoms, spherical legs and more legs than coordinates, as a person meets
them at the command line and on pages."""

import json
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from commands import done, read, refused
from exported_code import COMPILER

import pteron
from pteron.identification.excitation import Limits, margins, random_excitation
from pteron.manipulator.commented_file import commented_text
from pteron.motion import with_payload
from pteron.report.page import geometry
from pteron.workspace import largest_cube


def sentences(line):
    """Return the output of a command on one line."""
    return " ".join(read(line, COLUMNS="140").split())


def test_check_states_arcs_and_that_spherical_legs_have_no_ball_joint():
    text = sentences("check agile-eye")
    assert "90 deg, 90 deg" in text
    assert "Joints from base to platform: R revolute; actuated: the first R of SRRR." in text
    assert "SRRR: spherical, all axes meet." in text
    assert "Cranks at 0: horizontal, 90 deg above horizontal." in text
    arcs = json.loads(done("check spherical-3-rrr --json"))["legs"][0]["arcs"]
    assert arcs == {"crank_arc": 1.25, "link_arc": 1.4}


def test_check_names_the_angle_whose_limit_is_nearest():
    assert "to a limit of alpha (100 % is mid-range)" in sentences("check ankle-offset")


@pytest.mark.parametrize("name", ["agile-eye", "quadrupteron"])
def test_every_key_of_a_new_file_has_a_comment_once(name):
    first_leg = commented_text(name).partition("[[legs]] # 1")[2].partition("[[legs]] # 2")[0]
    lines = [line for line in first_leg.splitlines() if line.partition("=")[1]]
    assert not [line for line in lines if line.endswith("# ")]
    keys = [line.partition(" =")[0].lstrip("#") for line in lines]
    assert len(keys) == len(set(keys))


def test_the_largest_cube_is_on_homes_side_of_the_base():
    robot = pteron.load("3-upu")
    moved = replace(robot.legs[0], guide_point=(0.301, 0.001, -0.002))  # no mirror image is exact
    for machine in (robot, replace(robot, legs=(moved, *robot.legs[1:]))):
        cube = largest_cube(machine, [0.0, 0.0, 0.4])
        assert cube.proof is not None
        assert cube.proof.holds
        assert cube.center[2] > 0.3
        assert cube.edge > 0.18


def test_a_payload_at_the_point_of_rotation_is_doubted():
    with pytest.warns(pteron.UnlikelyValue, match="0.3 kg at P, .* has no effect: give its centre"):
        with_payload("agile-eye", 0.3)
    robot = pteron.load("agile-eye")
    loaded = with_payload(robot, 0.3, (0.05, 0.0, 0.0))
    forces = [pteron.inverse_dynamics(one, *np.zeros((3, 3))) for one in (robot, loaded)]
    assert np.abs(forces[1] - forces[0]).max() > 0.1
    with_payload("ankle-offset", 0.3)  # its P moves about the first axis


def test_the_page_shows_arcs_in_degrees_and_second_elbows():
    assert dict(geometry(pteron.load("agile-eye")))["crank arc"] == ["90\u00b0"] * 3
    assert dict(geometry(pteron.load("pentapteron")))["second elbow"] == [
        *("\u22121", "+1", "+1", "\u22121", "\u22121")
    ]


def test_klipper_has_no_motor_for_a_fourth_arm(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refused("export delta-redundant --klipper printer", "one motor for each of x, y and z", "has 4")


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_the_test_of_exported_code_forgives_rounding_where_a_column_is_zero(tmp_path):
    written = pteron.export_c("agile-eye", folder=tmp_path)
    files = [path for path in written if path.suffix == ".c"]
    program = tmp_path / "test"
    subprocess.run([COMPILER, "-std=c99", *files, "-lm", "-o", program], check=True)
    said = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    assert said == "all functions agree with the library\n"


def test_the_page_states_where_axes_that_do_not_meet_are(tmp_path):
    done(f"report ankle-offset --out {tmp_path}")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "turns about two axes that do not meet (2R)" in text
    assert "The first axis passes through (0, 0, 0) mm" in text
    assert "P is on the second one, (0, 0, \u221220) mm from there at" in text
    assert "P stays at" not in text


def test_direct_does_not_claim_every_pose_of_five_freedoms():
    assert "others may exist" in sentences("direct 5-rpur 0.3 0.3 0.3 0.3 0.3")
    assert "all assembly modes" in sentences("direct hexapteron 0 0 0 0 0 0")


def test_a_fault_has_the_name_that_the_file_uses(tmp_path):
    file = tmp_path / "eye.toml"
    text = commented_text("agile-eye").replace("[0.0, 0.0, -0.08]", "[0.0, 0.0, 0.0]")
    file.write_text(text, encoding="utf-8")
    with pytest.raises(pteron.ModelError, match="leg 1: platform_direction: zero has no direction"):
        pteron.load(file)


def test_a_limit_of_the_platforms_angles_is_no_legs():
    motion = random_excitation(pteron.load("agile-eye"), harmonics=2, seed=1)
    each = {margin.limit: margin.leg for margin in margins(motion, Limits())}
    assert each["passive_clearance"] is None
    assert each["type_i"] in (1, 2, 3)
