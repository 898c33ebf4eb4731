"""What is possible but unlikely is doubted aloud, in Python too: units, and the other elbows."""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from mechanisms import CATALOG, gated

import pteron
from pteron.manipulator import with_dimensions
from pteron.manipulator.machine_warnings import machine_warnings
from pteron.manipulator.tool import Tool
from pteron.manipulator.variants import with_elbows
from pteron.motion import line_path, with_payload
from pteron.playback import playback
from pteron.tables import Table
from pteron.workspace import Box, home_pose, pose_margins, prove
from pteron.workspace.mode_places import mode_places, mode_warnings


def mirrored(robot):
    """Return the machine with the other elbow of every leg that has two."""
    signs = [-leg.elbow if len(leg.branches) > 1 else leg.elbow for leg in robot.legs]
    return with_elbows(robot, signs)


def test_degrees_that_are_typed_are_answered_with_a_warning():
    with pytest.warns(pteron.UnlikelyValue, match="^phi up to 45: are these degrees"):
        typed = pteron.inverse_kinematics("quadrupteron", [0, 0, 0, 45])
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a program's arrays are taken as they are
        given = pteron.inverse_kinematics("quadrupteron", np.array([0.0, 0.0, 0.0, 45.0]))
    np.testing.assert_array_equal(typed, given)


def test_joints_in_degrees_or_millimetres_are_told_beside_the_missing_pose():
    with pytest.warns(
        pteron.UnlikelyValue, match="^theta1, theta2, theta3 up to 30: are these deg"
    ):
        poses = pteron.direct_kinematics("delta", [10.0, 20.0, 30.0], on_failure="nan")
    assert np.isnan(poses).all()
    with pytest.warns(pteron.UnlikelyValue, match="rho4 up to 80: are these mm"):
        pteron.direct_kinematics("quadrupteron", [30.0, 10.0, 20.0, 80.0], on_failure="nan")
    with pytest.raises(pteron.UnreachablePose, match=r"30\.0\]; theta1, .* are these degrees"):
        pteron.direct_kinematics("delta", [10.0, 20.0, 30.0])


def test_what_the_command_line_hints_at_is_warned_of_in_python():
    robot = pteron.load("quadrupteron")
    with pytest.warns(pteron.UnlikelyValue, match="500 kg, .* is it in grams"):
        with_payload(robot, 500.0)
    with pytest.warns(pteron.UnlikelyValue, match="^phi up to 6.5: are these degrees"):
        line_path(robot, [[0.0, 0.0, 0.0, 6.3], [0.0, 0.0, 0.0, 6.5]])
    columns = ["t", *robot.coordinates]
    data = np.column_stack([np.arange(5.0), *np.zeros((3, 5)), np.full(5, 6.4)])
    with pytest.warns(pteron.UnlikelyValue) as told:
        playback(robot, Table("a.csv", pl.DataFrame(data, schema=columns)))
    assert [str(one.message).partition(":")[2] for one in told] == [
        " phi up to 6.4: are these degrees? rad are expected",
        " t in steps of 1: are these ms? s are expected",
    ]


@pytest.mark.parametrize(
    ("old", "new", "question"),
    [
        ("limits = [-1.5, 0.9]", "limits = [-86.0, 51.0]", "limits: .* are these degrees"),
        ("upper_length = 0.42", "upper_length = 420.0", "upper_length: .* are these mm"),
        ("center_of_mass = [-0.5275]", "center_of_mass = [0.5275]", "x = 0.5275 m is not between"),
    ],
)
def test_a_file_is_doubted_where_it_is_loaded(old, new, question, tmp_path):
    """The catalog is not: a warning is an error in these tests."""
    text = (Path(pteron.manipulator.__file__).parent / "catalog" / "delta.toml").read_text("utf-8")
    assert old in text
    file = tmp_path / "delta.toml"
    file.write_text(text.replace(old, new, 1), "utf-8")
    with pytest.warns(pteron.UnlikelyValue, match=f"delta.toml: leg.* 1.*: .*{question}") as told:
        pteron.load(file)
    assert {one.filename for one in told} == {__file__}
    with pytest.warns(pteron.UnlikelyValue, match=question):
        pteron.parameters(file)


def test_bodies_that_pteron_wrote_are_not_doubted(tmp_path):
    """What identification finds for a body alone is one of many equivalent values."""
    robot = CATALOG["delta"]
    values = pteron.parameters(robot)
    values[[name.startswith("mgx_l") for name in pteron.parameter_names(robot)]] *= -1.0
    odd = pteron.with_parameters(robot, values)
    (told,) = machine_warnings(odd)  # three legs alike
    assert told.startswith("legs 1, 2 and 3: lower: center_of_mass: ")
    pteron.load(pteron.save(odd, tmp_path / "robot.toml"))  # a warning would be an error


def test_a_leg_that_turns_the_other_way_than_all_others_is_doubted():
    robot = CATALOG["delta"]
    odd = replace(robot.legs[1], direction=[-x for x in robot.legs[1].direction])
    legs = (robot.legs[0], odd, robot.legs[2])
    (told,) = machine_warnings(replace(robot, legs=legs))
    assert told.startswith("leg 2: direction: opposite to all other legs'")


def test_masses_in_grams_and_a_tool_in_millimetres_are_doubted():
    robot = CATALOG["linear-delta"]
    (told,) = machine_warnings(with_dimensions(robot, platform_mass=900.0))
    assert "900 kg" in told
    assert "is it in grams" in told
    robot = CATALOG["delta"]
    lower = robot.legs[0].lower
    heavy = type(lower).of_values([1e3 * value for value in lower.values])
    found = machine_warnings(
        replace(robot, legs=tuple(replace(leg, lower=heavy) for leg in robot.legs))
    )
    assert any("lower: mass" in text and "is it in grams" in text for text in found)
    tools = (Tool("pen", (0.0, 0.0, -45.0)),)
    (told,) = machine_warnings(replace(robot, tools=tools))
    assert "point of tools item 1" in told
    assert "are these mm" in told


def test_degrees_of_cranks_are_told_by_their_limits():
    with pytest.warns(pteron.UnlikelyValue, match="up to 10: are these degrees"):
        pteron.direct_kinematics("delta", [10.0, 10.0, 10.0])
    free = replace(CATALOG["delta"], legs=[replace(x, limits=None) for x in CATALOG["delta"].legs])
    pteron.direct_kinematics(free, [10.0, 10.0, 10.0])  # a crank may turn as often as it likes


def test_a_shaft_that_makes_many_turns_has_the_limits_it_has():
    robot = CATALOG["delta-4"]
    many = replace(robot, platform=replace(robot.platform, limits=(-20.0, 20.0)))
    assert machine_warnings(many) == (
        "platform: limits: [-20.0, 20.0] rad, more than a turn from phi = 0: are these degrees?",
    )
    angles = pteron.random_poses(many, 200)[:, 3]
    assert angles.min() < -15.0
    assert angles.max() > 15.0
    pose = [0.1, 0.0, -0.9, 18.0]
    joints = pteron.inverse_kinematics(many, pose)  # a warning here would be an error
    np.testing.assert_allclose(pteron.direct_kinematics(many, joints)[0], pose, atol=1e-9)


@pytest.mark.parametrize("name", gated(["delta", "delta-4", "h4", "par4"], ["delta", "h4"]))
def test_elbows_that_raise_a_hanging_machine_are_doubted(name):
    upside = mirrored(CATALOG[name])
    modes = mode_places(upside, home_pose(upside))
    (told,) = mode_warnings(modes)
    assert told.startswith("elbow: the platform stands ")
    assert told.endswith("is that the working mode that is meant?")
    (named,), (likely,) = ([m for m in modes if getattr(m, key)] for key in ("named", "likely"))
    assert (named.place, likely.place) == ("above", "below")
    assert f"with elbows {likely.signs} it hangs" in told
    right = mode_places(CATALOG[name], home_pose(CATALOG[name]))
    assert mode_warnings(right) == ()
    (named,) = (mode for mode in right if mode.named)
    assert named.likely
    assert named.place == "below"
    assert named.pose.tolist() == home_pose(CATALOG[name]).tolist()


@pytest.mark.parametrize(
    "name",
    gated(
        ["delta-omnid", "quadrupteron", "five-bar", "linear-delta"], ["quadrupteron", "five-bar"]
    ),
)
def test_machines_that_stand_or_have_no_such_side_are_not(name):
    modes = mode_places(CATALOG[name], home_pose(CATALOG[name]))
    assert mode_warnings(modes) == ()
    if name == "linear-delta":
        assert [mode.place for mode in modes if mode.named] == ["below"]


def test_a_steep_linear_delta_is_at_home_on_its_axis():
    """Beyond its own towers it has more margin."""
    steep = with_dimensions("linear-delta", base_radius=0.1, platform_radius=0.05, rod=0.4)
    home = home_pose(steep)
    assert home[:2].tolist() == [0.0, 0.0]
    beside = pose_margins(steep, [0.0, 0.315, 0.015]).least
    assert 0.3 < pose_margins(steep, home).least < 0.7 * beside


def test_the_home_of_a_symmetric_machine_is_on_its_axis():
    """Three equal places beside the axis, of which a search may find one or two."""
    robot = CATALOG["linear-delta"]
    legs = []
    for i, leg in enumerate(robot.legs):
        angle = 2.0 * np.pi * i / 3.0
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        sizes = {"lower_length": 0.36754, "limits": (-0.3, 0.3), "platform_point": 0.057 * out}
        legs.append(replace(leg, guide_point=0.2 * out, **sizes))
    wide = replace(robot, legs=tuple(legs))
    home = home_pose(wide)
    np.testing.assert_array_equal(home[:2], 0.0)
    others = pteron.random_poses(wide, 500, seed=3, type_i=0.0, type_ii=0.0)
    assert pose_margins(wide, home).least >= 0.75 * pose_margins(wide, others).least.max()


def test_boxes_beyond_all_numbers_are_refused():
    with pytest.raises(
        pteron.DataError, match=r"^low: .* a row of numbers of sensible size expected"
    ):
        prove("quadrupteron", Box([1e200] * 4, [2e200] * 4))
