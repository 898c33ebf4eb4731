"""`pteron new` from an owner's measurements, and what is still as in the template."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from commands import done, refused, run

import pteron
from pteron.errors import ModelError
from pteron.kinematics.mid_stroke import at_mid_stroke, with_aimed_cones
from pteron.manipulator import Manipulator
from pteron.manipulator.joint_pairs import joint_circle, with_crank_planes, with_pairs
from pteron.manipulator.template import template_sentence, template_values
from pteron.workspace import limited_joints

SIMULATOR = (
    "new stewart --base-radius 600mm --base-pair 120mm --platform-radius 400mm "
    "--platform-pair 14deg --limits 700mm:1000mm --lead 5mm --gear 2 --rotor-inertia 1e-4 "
    "--platform-mass 40 --rider 80@0,0,0.5 --upper-mass 4 --lower-mass 1500g --cone 35deg"
)
ROTARY = (
    "new hexa --base-sides 50mm:110mm --platform-radius 5cm --platform-pair 20deg --crank 15mm "
    "--rod 140mm --crank-plane=-90deg --limits=-80:80deg --height 0.13 --platform-mass 100g"
)


def made(line, tmp_path, monkeypatch) -> Manipulator:
    """Return the machine of the file that a command line writes."""
    monkeypatch.chdir(tmp_path)
    result = run(f"{line} --out robot.toml")
    assert result.exit_code == 0, result.output
    return pteron.load("robot.toml")


def test_a_simulator_is_made_from_its_owners_measures(tmp_path, monkeypatch):
    robot = made(SIMULATOR, tmp_path, monkeypatch)
    bases = np.array([leg.guide_point for leg in robot.legs])
    tops = np.array([leg.platform_point for leg in robot.legs])
    assert np.linalg.norm(bases[:, :2], axis=1) == pytest.approx(0.6, abs=1e-9)
    assert np.linalg.norm(bases[0] - bases[1]) == pytest.approx(0.12, abs=1e-9)
    assert np.linalg.norm(tops[1] - tops[2]) == pytest.approx(0.8 * math.sin(math.radians(7)))
    assert [leg.limits for leg in robot.legs] == [(0.7, 1.0)] * 6
    # Mid-stroke, level, above the base: by Pythagoras.
    radial = np.linalg.norm((bases - tops)[0])
    assert robot.home == pytest.approx([0, 0, math.sqrt(0.85**2 - radial**2), 0, 0, 0], abs=1e-6)
    assert pteron.inverse_kinematics(robot, robot.home) == pytest.approx(0.85, abs=1e-6)
    drive = robot.legs[3].drive
    assert drive.ratio == pytest.approx(2 * 2 * math.pi / 0.005)
    assert drive.rotor_inertia == 1e-4
    inertia = robot.platform.inertia
    assert inertia.mass == pytest.approx(120.0)
    assert inertia.center_of_mass[2] == pytest.approx(80 * 0.5 / 120)
    # That of the template in proportion to mass and radius squared, and the rider's.
    template = pteron.load("stewart").platform.inertia
    plate = 40 / template.mass * 0.4**2 * template.inertia[0]
    assert inertia.inertia[0] == pytest.approx(plate + 80 * 0.25, rel=1e-9)
    assert [leg.upper.mass for leg in robot.legs] == pytest.approx([4.0] * 6)
    assert [leg.lower.mass for leg in robot.legs] == pytest.approx([1.5] * 6)
    joints = [joint for joint in limited_joints(robot, robot.home) if not joint.actuated]
    assert len(joints) == 12
    assert [joint.most for joint in joints] == pytest.approx([math.radians(35)] * 12)
    assert max(abs(joint.value) for joint in joints) < 1e-7


def test_a_rotary_platform_is_made_above_its_base(tmp_path, monkeypatch):
    robot = made(ROTARY, tmp_path, monkeypatch)
    bases = np.array([leg.guide_point for leg in robot.legs])
    sides = np.linalg.norm(bases - np.roll(bases, -1, axis=0), axis=1)
    assert sorted(sides) == pytest.approx([0.05] * 3 + [0.11] * 3, abs=1e-9)
    assert robot.home[2] == 0.13
    joints = pteron.inverse_kinematics(robot, robot.home)
    assert joints == pytest.approx(joints[0])
    assert abs(joints[0]) < 0.2
    # Cranks of a pair point at each other, along the line of its two joints.
    way = (bases[1] - bases[0]) / np.linalg.norm(bases[1] - bases[0])
    assert robot.legs[0].zero_direction == pytest.approx(way, abs=1e-9)
    assert robot.legs[1].zero_direction == pytest.approx(-way, abs=1e-9)
    assert robot.legs[0].limits == pytest.approx((-math.radians(80), math.radians(80)))


def test_what_is_still_as_in_the_template_is_said_by_every_command(tmp_path, monkeypatch):
    robot = made("new stewart --limits 2.6:3.6 --platform-mass 900", tmp_path, monkeypatch)
    keys = {value.key for value in template_values(robot)}
    assert keys == {
        *("base_radius", "base_pair", "platform_radius", "platform_pair", "cones"),
        *("platform_inertia", "upper", "lower"),
    }
    text = template_sentence(robot)
    assert "base_radius 3 m, base_pair 5 deg" in text
    assert text in run("new stewart --limits 2.6:3.6 --platform-mass 900 --json").stdout
    assert json.loads(done("check robot.toml --json"))["template"] == text
    assert f"Note: {text}" in " ".join(run("cycle robot.toml", COLUMNS="1000").stderr.split("\n"))
    confirmed = replace(robot.template, confirmed=(*robot.template.confirmed, *keys))
    pteron.save(replace(robot, template=confirmed), "confirmed.toml")
    assert json.loads(done("check confirmed.toml --json"))["template"] == ""
    # A changed value is no longer listed, the record is no part of the machine.
    other = replace(robot, legs=tuple(replace(leg, base_cone=None) for leg in robot.legs))
    assert "cones" in {value.key for value in template_values(other)} ^ keys
    assert replace(robot, template=None) == robot


def test_values_are_compared_for_every_machine_of_the_catalog():
    from pteron.manipulator.template_record import Template

    for name in pteron.catalog():
        robot = pteron.load(name)
        mine = replace(robot, name="mine", template=Template(name))
        keys = {value.key for value in template_values(mine)}
        assert {"base_radius", "platform_mass"} <= keys
        assert template_values(replace(mine, template=Template(name, tuple(keys)))) == []


def test_pairs_and_crank_planes_keep_the_symmetry():
    robot = with_pairs(pteron.load("hexa"), "platform", math.radians(30))
    circle = joint_circle(robot, "platform")
    assert circle.pair_angle == pytest.approx(math.radians(30))
    assert circle.radius == pytest.approx(joint_circle(pteron.load("hexa"), "platform").radius)
    planes = with_crank_planes(robot, math.radians(40))
    flat = np.array([leg.zero_direction for leg in planes.legs])
    angles = np.unwrap(np.arctan2(flat[:, 1], flat[:, 0]), period=math.tau)
    assert np.degrees(angles[:2]) == pytest.approx([-40.0, 40.0])
    # Positive rotation lowers every crank, as before.
    for leg, former in zip(planes.legs, robot.legs, strict=True):
        sense, before = (np.cross(each.direction, each.zero_direction)[2] for each in (leg, former))
        assert sense == pytest.approx(before, abs=1e-9)
    with pytest.raises(ModelError, match="the base joints of delta are not in pairs"):
        with_pairs(pteron.load("delta"), "base", 0.1)
    with pytest.raises(ModelError, match=r"below 120 deg expected for 3 pairs"):
        with_pairs(pteron.load("stewart"), "base", 3.0)


def test_cones_of_cranks_have_their_middle_along_the_rods():
    robot = at_mid_stroke(pteron.load("reachy-mini"))
    aimed = with_aimed_cones(robot, robot.home, 0.5)
    joints = [joint for joint in limited_joints(aimed, aimed.home) if "rod" in joint.noun]
    assert joints
    assert max(abs(joint.value) for joint in joints) < 1e-7


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("stewart --base-radius 600kg", "--base-radius: '600kg' given, a number above 0 in m (or"),
        ("stewart --base-pair 7", "--base-pair: 7 is no distance of two joints"),
        ("stewart --base-sides 0.3:0.1", "SHORT:LONG above 0 expected"),
        ("stewart --base-sides 0.1:0.3 --base-radius 1", "--base-sides and --base-radius given"),
        ("stewart --limits 0.5", "--limits: '0.5' given, LOW:HIGH expected"),
        ("stewart --height 9", "at the height 9 m no level pose is within reach"),
        ("delta --height 0.5", "one that moves freely (3T3R) expected"),
        ("delta --base-pair 0.1", "the base joints of delta are not in pairs"),
        ("delta --lead 5mm", "--lead: the actuated joints of delta turn; give --gear"),
        ("stewart --gear 3", "--gear: give --lead too"),
        ("stewart --crank-plane 90deg", "the legs of stewart have no cranks"),
        ("stewart --rider 80@0,0", "--rider: '0,0' given, MASS@X,Y,Z expected"),
        ("linear-delta --upper-mass 1", "have no link of this key"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(options, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert message in refused(f"new {options} --out robot.toml")


def test_a_rider_and_another_radius_do_not_hide_that_the_inertia_is_the_template_s(
    tmp_path, monkeypatch
):
    sizes = "new stewart --base-radius 600mm --platform-radius 400mm --limits 700mm:1100mm"
    inertia = "platform_inertia without the rider (per kg)"
    robot = made(f"{sizes} --rider 80@0,0,0.5", tmp_path, monkeypatch)
    assert robot.template.rider == (80.0, 0.0, 0.0, 0.5)
    assert {"platform_mass", "platform_inertia"} <= {value.key for value in template_values(robot)}
    text = json.loads(done("check robot.toml --json"))["template"]
    assert "platform_mass 1217 kg without the rider" in text
    assert inertia in text
    assert "forces and torques depend on these masses and inertias" in text
    sizes += " --overwrite --platform-mass 40"
    robot = made(f"{sizes} --rider 80@0,0,0.5", tmp_path, monkeypatch)
    # The platform's inertia is that of a body of its mass and radius.
    assert "platform_inertia (per kg and radius squared)" in template_sentence(robot)
    platform = robot.platform
    heavier = replace(platform.inertia, inertia=tuple(1.1 * v for v in platform.inertia.inertia))
    other = replace(robot, platform=replace(platform, inertia=heavier))
    assert "platform_inertia" not in template_sentence(other)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ("--base-radius 750", "--base-radius 750 is 750 m: if these are millimetres, write 750mm"),
        ("--limits 2500:3800", "is 3800 m: if these are millimetres, write 2500mm:3800mm"),
        ("--rider 80@0,0,500", "is 500 m: if these are millimetres, write 80@0,0,0.5"),
        ("--lead 5", "--lead 5 is 5 m: if these are millimetres, write 5mm"),
    ],
)
def test_lengths_that_are_likely_millimetres_are_doubted_at_once(
    options, line, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    result = run(f"new stewart {options} --out robot.toml")
    assert f"{line}\n" in result.stderr
    assert result.stderr.count("Warning") == 1
    assert "Warning" not in run("new stewart --base-radius 2 --lead 5mm --out m.toml").stderr
