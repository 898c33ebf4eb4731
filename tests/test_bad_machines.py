"""What a file may get wrong about a machine: one clear line each, and all of them at once."""

import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mechanisms import CATALOG, CLIENTS, NIGHTLY
from scipy.spatial.transform import Rotation

import pteron
from pteron import ModelError
from pteron.bodies import PlanarInertia
from pteron.legs.cones import Cone
from pteron.manipulator.machine_warnings import machine_warnings
from pteron.manipulator.manipulator import legs_text
from pteron.manipulator.variants import turned
from pteron.workspace import home_pose, pose_margins
from pteron.workspace.load_warnings import load_warnings

FOLDER = Path(pteron.__file__).parent / "manipulator" / "catalog"


def text_of(name):
    return (FOLDER / f"{name}.toml").read_text(encoding="utf-8")


BARS = re.search(r"(?ms)^\[\[platform.bars.*?\[\[platform.g", text_of("par4"))[0]

BAD = {
    "a crank whose zero direction is along its axis": (
        "five-bar",
        ["zero_direction = [1.0, 0.0, 0.0]", "zero_direction = [0.0, 0.0, -1.0]"],
        "leg 1: zero_direction: [0.0, 0.0, -1.0] is along direction [0.0, 0.0, 1.0]; give one at "
        "right angles to it",
    ),
    "a crank whose zero direction leans": (
        "five-bar",
        ["zero_direction = [1.0, 0.0, 0.0]", "zero_direction = [0.8, 0.0, 0.6]"],
        "leg 1: zero_direction: [0.8, 0.0, 0.6] is not perpendicular to direction [0.0, 0.0, 1.0]; "
        "[1.0, 0.0, 0.0] is",
    ),
    "a planar leg out of the plane": (
        "3-rrr",
        ["direction = [0.0, 0.0, 1.0]", "direction = [0.0, 0.6, 0.8]"],
        "leg 1: direction [0.0, 0.6, 0.8] is not along the platform's axis [0.0, 0.0, 1.0], the "
        "normal of its plane",
    ),
    "a planar slider out of the plane": (
        "3-prr",
        ["slider_direction = [1.0, 0.0, 0.0]", "slider_direction = [0.8, 0.0, 0.6]"],
        "leg 1: slider_direction: [0.8, 0.0, 0.6] is not perpendicular to the plane's normal "
        "[0.0, 0.0, 1.0]; [1.0, 0.0, 0.0] is",
    ),
    "a planar leg in space": (
        "3-rrr",
        ['motion = "2T1R"', 'motion = "3T"'],
        "leg 1: a RRR leg moves in a plane, which a 3T platform leaves; make the platform's motion "
        '"2T" or "2T1R", or give it another leg',
    ),
    "2T with three legs": (
        "3-prr",
        ['motion = "2T1R"', 'motion = "2T"'],
        "legs: their platform points are 0.1732 m apart, so that the platform is free to turn "
        "about its axis; a 2T platform needs one point for all",
    ),
    "2T with two points": (
        "five-bar",
        ["platform_point = [0.0, 0.0, 0.0]", "platform_point = [0.03, 0.04, 0.0]"],
        "legs: their platform points are 0.05 m apart, so that the platform is free to turn about "
        "its axis; a 2T platform needs one point for all",
    ),
    "a bar that the crank turns": (
        "delta",
        ["rods = 2", "rods = 2\nbar_direction = [1.0, 0.0, 0.0]"],
        "leg 1: bar_direction: [1.0, 0.0, 0.0] is not along direction [0.0, -1.0, 0.0], so that "
        "the crank turns the bar and with it the platform",
    ),
    "elbows in degrees": (
        "3-rrr",
        ["elbow = 1", "elbow = 1\nelbow_limits = [20.0, 160.0]"],
        "leg 1: elbow_limits: [20.0, 160.0] rad reaches beyond 0 to 3.142, where the angle always "
        "is; are these degrees?",
    ),
    "a cone in degrees": (
        "delta",
        ["rods = 2", "rods = 2\ntip_cone = { axis = [0.0, 0.0, 1.0], angle = 30.0 }"],
        "leg 1: tip_cone.angle: 30 rad given, one above 0 and up to pi expected; are these "
        "degrees?",
    ),
    "a crank whose zero direction leans and is too long": (
        "five-bar",
        ["zero_direction = [1.0, 0.0, 0.0]", "zero_direction = [2.0, 0.0, 0.5]"],
        "leg 1: zero_direction: [2.0, 0.0, 0.5] is not perpendicular to direction [0.0, 0.0, 1.0]; "
        "[1.0, 0.0, 0.0] is",
    ),
    "a shaft that turns about another axis": (
        "delta-4",
        ['"RUPU"', '"RUPU"\ndirection = [1.0, 0.0, 0.0]'],
        "leg 4: direction: [1.0, 0.0, 0.0] is not along the platform's axis [0.0, 0.0, 1.0], about "
        "which a shaft turns it; leave direction out",
    ),
    "a shaft that turns backwards": (
        "delta-4",
        ['"RUPU"', '"RUPU"\ndirection = [0.0, 0.0, -1.0]'],
        "leg 4: direction: [0.0, 0.0, -1.0] is the platform's axis [0.0, 0.0, 1.0] reversed; leave "
        "direction out, and give a negative ratio where the joint's angle counts the other way",
    ),
    "a shaft shorter than nothing": (
        "delta-4",
        ['"RUPU"', '"RUPU"\ntravel = [-0.3, 0.6]'],
        "leg 4: travel: -0.3 m given, but no length is below 0; give 0 or more",
    ),
    "a centre of mass beyond the rod": (
        "linear-delta",
        ["[-0.1147]", "[-0.9]"],
        "leg 1: lower.center_of_mass: x = -0.9 m is not between slider and platform, where its x "
        "is zero: -0.2294 to 0 m is usual; with it no real body has inertia 0.000701658 kg m^2",
    ),
    "true for 1": (
        "five-bar",
        ["elbow = 1", "elbow = true"],
        "leg 1: elbow: True given, 1 or -1 expected",
    ),
    "one table of bars": (
        "par4",
        [BARS, "[platform.bars]\nmass = 0.1\nhinge = [0.0, 0.0, 0.0]\n\n[[platform.g"],
        "platform.bars: [platform.bars] is one table, a list of tables expected; write "
        "[[platform.bars]] above each",
    ),
    "inertia about the centre of mass": (
        "five-bar",
        ["inertia = 0.000162", "inertia = 4.05e-5"],
        "leg 1: upper.inertia: 4.05e-05 kg m^2 belongs to no real body; with this mass and centre "
        "of mass, and about the reference point, it must be above 0.0001215 kg m^2; about the "
        "centre of mass? Then write 0.000162",
    ),
}
"""Catalog name, what of its first leg's text is replaced, and the line that is told."""

EVERYWHERE = {
    "single rods": (
        "delta",
        ["rods = 2", "rods = 1"],
        "legs: the platform is free to turn about several axes: legs 1, 2 and 3 keep it from no "
        "turn, as single rods do; turn a leg's direction, or the bar of its rods, elsewhere, or "
        "make rods double",
    ),
    "single rods under a platform that turns": (
        "par4",
        ["rods = 2", "rods = 1"],
        "legs: the platform is free to tilt about several axes: legs 1, 2, 3 and 4 keep it from no "
        "turn, as single rods do; turn a leg's direction, or the bar of its rods, elsewhere, or "
        "make rods double",
    ),
}
"""The same, replaced throughout."""


@pytest.mark.parametrize("case", [*BAD, *EVERYWHERE])
def test_bad_input_is_one_clear_line(case, tmp_path):
    name, (old, new), line = BAD.get(case) or EVERYWHERE[case]
    assert old in text_of(name)
    file = tmp_path / "bad.toml"
    file.write_text(text_of(name).replace(old, new, 1 if case in BAD else -1), encoding="utf-8")
    with pytest.raises(ModelError) as caught:
        pteron.load(file)
    first, *others = caught.value.faults
    assert first == line
    if others:  # the same of every leg
        assert {fault.split(":", 1)[1] for fault in others} == {line.split(":", 1)[1]}
    else:
        assert str(caught.value) == f"{file}: {line}"
    assert caught.value.subject == str(file)


def legs_of(name, change):
    return tuple(change(i, leg) for i, leg in enumerate(CATALOG[name].legs))


def refused(robot, *words, **changes):
    """Check that a machine is refused in one line that holds the words."""
    with pytest.raises(ModelError) as caught:
        replace(robot, **changes)
    assert "\n" not in str(caught.value)
    assert all(word in str(caught.value) for word in words), str(caught.value)


X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def test_a_platform_that_may_tilt_is_refused_as_far_as_the_file_tells():
    parallel = legs_of("linear-delta", lambda i, leg: replace(leg, bar_direction=Y))
    words = "free to turn about [0.0, 1.0, 0.0]: all directions are parallel to it"
    refused(CATALOG["linear-delta"], words, legs=parallel)
    # Where nobody says where the bars are, nothing is held against the machine.
    untold = legs_of("linear-delta", lambda i, leg: replace(leg, bar_direction=None))
    assert replace(CATALOG["linear-delta"], legs=untold).freedom == 3
    in_plane = legs_of("par4", lambda i, leg: replace(leg, direction=X, zero_direction=Y))
    words = "free to tilt about [1.0, 0.0, 0.0]: all directions lie in one plane with it and"
    refused(CATALOG["par4"], words, legs=in_plane)
    one = legs_of("delta", lambda i, leg: replace(leg, rods=1 + (i == 0)))
    words = "about [0.0, 1.0, 0.0]: legs 2 and 3 keep it from no turn, as single rods do, and the o"
    refused(CATALOG["delta"], words, legs=one)


def test_a_shaft_needs_an_angle_to_turn_and_turns_it_alone():
    robot = CATALOG["delta-4"]
    still = replace(robot.platform, motion="3T", geared=())
    words = "leg 4: a RUPU leg turns the platform, but this 3T platform does not turn"
    with pytest.raises(ModelError) as caught:
        replace(robot, platform=still)
    assert caught.value.faults[0].startswith(words)
    twice = (*robot.legs[:2], robot.legs[3], robot.legs[3])
    refused(robot, "legs 3 and 4: all turn the platform, which takes one such leg", legs=twice)


def test_a_shaft_turns_the_platform_about_its_axis_and_no_other(tmp_path):
    oblique = (2 / 3, -1 / 3, 2 / 3)
    robot = turned(CATALOG["delta-4"], Rotation.align_vectors([oblique], [Z])[0].as_matrix())
    axis = robot.platform.axis
    np.testing.assert_allclose(axis, oblique, atol=1e-15)
    shaft = replace(robot.legs[3], direction=None, ratio=-2.5)
    robot = replace(robot, legs=(*robot.legs[:3], shaft))
    pose, rates = home_pose(robot) + np.array([0.0, 0.0, 0.0, 0.3]), [0.1, -0.2, 0.3, 0.7]
    found = pteron.kinematics.joint_rates(robot, pose, rates)
    joints = np.nan_to_num([found.actuated[3], *found.passive[3]])
    twist = joints @ np.nan_to_num(pteron.kinematics.joint_screws(robot, pose)[3])
    np.testing.assert_allclose(twist[:3], 0.7 * np.array(axis), atol=1e-14)
    assert found.actuated[3] == pytest.approx(-2.5 * 0.7)
    for direction, words in [(X, "is not along"), (tuple(-a for a in axis), "reversed")]:
        other = replace(shaft, direction=direction)
        refused(
            robot, f"leg 4: direction: {list(direction)} is", words, legs=(*robot.legs[:3], other)
        )


def test_all_faults_are_told_at_once_those_of_the_machine_too(tmp_path):
    text = text_of("3-prr").replace("lower_length = 0.2", "lower_length = -0.2", 1)
    text = text.replace("limits = [0.05, 0.3]", "limits = [0.3, 0.05]", 1)
    text = text.replace("inertia = 0.00237530060951", "inertia = 0.0001", 1)
    text = text.replace("inertia = 0.0268381389195", "inertia = 0.0")
    text = text.replace("slider_direction = [-0.5, 0.8", "direction = [0.0, 1.0, 0.0]\n" + SLIDER)
    text = text.replace('motion = "2T1R"', 'motion = "2T"').replace('name = "3-prr"', 'name = " "')
    file = tmp_path / "bad.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ModelError) as caught:
        pteron.load(file)
    assert [fault.split(":")[0] for fault in caught.value.faults] == [
        "platform.inertia",
        "leg 1",
        "leg 1",
        "leg 1",
        "name",
        "leg 2",
    ]
    assert str(caught.value).splitlines()[0] == f"{file}: 6 faults"


def faults_in(text, tmp_path):
    """Return what is told of a file."""
    file = tmp_path / "bad.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ModelError) as caught:
        pteron.load(file)
    return caught.value.faults


KEYS = "name, gravity, radii, tools, home, distribution, template, owner, platform, legs"


def test_a_fault_hides_none_that_does_not_hang_on_it(tmp_path):
    text = text_of("par4").replace('motion = "3T1R"', 'motion = "3T"')
    assert [fault.split(":")[0] for fault in faults_in(text, tmp_path)] == [
        "platform.limits",
        "platform.geared",
    ]
    first, second, *others = text.split("[[legs]]")[1:]
    for old, new in [
        ("upper_length = 0.2", "upper_length = -0.2"),
        ("limits = [-0.9, 1.5]", "limits = [1.5, -0.9]"),
        ("mass = 0.35", "mass = -0.35"),
    ]:
        first = first.replace(old, new)
    second = second.replace("fixed_offset", "fixd_offset").replace("lower_length = 0.51\n", "")
    second = second.replace("zero_direction = [1.0, 0.0", "zero_direction = [0.0, 1.0")
    head = text.split("[[legs]]")[0].replace('name = "par4"', "nam = 1").replace("0.32", "-0.32", 1)
    found = faults_in("[[legs]]".join([head, first, second, *others]), tmp_path)
    assert [fault.split(": ")[0:2] for fault in found[:3]] == [
        ["nam", f"unknown key; did you mean name? The valid ones there are {KEYS}"],
        ["platform.bars, item 1", "mass"],
        ["platform.limits", "a 3T platform has no angle to limit"],
    ]
    assert [fault.split(": ")[0:2] for fault in found[4:]] == [
        ["leg 1", "upper.mass"],
        ["leg 1", "upper_length"],
        ["leg 1", "limits"],
        ["leg 2", "lower_length"],
        ["leg 2", "fixd_offset"],
        ["leg 2", "zero_direction"],
    ]


def test_a_misspelt_key_is_one_fault_a_leg_with_the_valid_keys_told_once(tmp_path):
    found = faults_in(text_of("delta").replace("upper_length", "upper_lenght"), tmp_path)
    meant = "upper_lenght: unknown key; did you mean upper_length?"
    keys = " The valid ones there are type, guide_point, "
    assert len(found) == 3
    assert found[0].startswith(f"leg 1: {meant}{keys}")
    assert found[1:] == tuple(f"leg {i}: {meant}" for i in (2, 3))
    found = faults_in(text_of("delta").replace("rods =", "zzz ="), tmp_path)
    listed = "zzz: unknown key; the valid ones there are listed above"
    assert found[1:] == tuple(f"leg {i}: {listed}" for i in (2, 3))


def test_a_leg_with_faults_is_held_against_the_platform_too(tmp_path):
    text = text_of("five-bar").replace("direction = [0.0, 0.0, 1.0]", "direction = [0.0, 0.6, 0.8]")
    text = text.replace("upper_length = 0.09", "upper_length = -0.09").replace(
        "[0.3, 3.4]", "[4, 3]"
    )
    found = faults_in(text.replace("elbow = -1", "elbow = 2"), tmp_path)
    assert [fault.split(":")[0] for fault in found] == ["leg 1"] * 2 + ["leg 2"] * 2 + [
        "leg 1",
        "leg 2",
    ]
    assert all("not along the platform's axis" in fault for fault in found[-2:])


def test_a_centre_of_mass_of_another_shape_is_one_fault(tmp_path):
    text = text_of("five-bar").replace("center_of_mass = [0.0, 0.0]", "center_of_mass = [0.0]")
    (only,) = faults_in(text, tmp_path)
    assert only == "platform.center_of_mass: [0.0] given, a list of 2 numbers expected"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("axis = [0.0, 0.0, 1.0]", "axis = [0.0, 1.0]"),
        ("lower_length", "fixed_offset = [0.1, 0.0]\nlower_length"),
    ],
)
def test_nothing_is_told_that_hangs_on_a_value_of_another_shape(old, new, tmp_path):
    text = text_of("five-bar").replace(old, new)
    # Whether both points coincide in the plane hangs on it.
    text = text.replace("platform_point = [0.0, 0.0, 0.0]", "platform_point = [0.1, 0.0, 0.0]", 1)
    found = faults_in(text, tmp_path)
    assert all(" given, a list of 3 numbers expected" in fault for fault in found), found


def test_legs_that_are_one_table_are_not_counted(tmp_path):
    head, leg, *_ = text_of("five-bar").split("[[legs]]")
    (only,) = faults_in(f"{head}[legs]{leg}", tmp_path)
    assert only == "legs: [legs] is one table, a list of tables expected; write [[legs]] above each"


SLIDER = "slider_direction = [-0.5, 0.0, 0.8660254037844386] # "


# Nothing in reach.


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        (
            "delta",
            {"upper_length": 0.05, "lower_length": 0.1},
            "no pose is in reach of all legs: at the best one they miss by 0.055 m (legs 1, 2 and "
            "3); bring the guide points nearer or lengthen the links",
        ),
        pytest.param(
            "five-bar",
            {"upper_length": 0.02, "lower_length": 0.02},
            "they miss by 0.019 m (legs 1 and 2)",
            marks=NIGHTLY,
        ),
        (
            "quadrupteron",
            {"upper_length": 0.02},
            "they miss by 0.045 m (legs 1 and 3), 0.039 m (legs 2 and 4)",
        ),
    ],
)
def test_rods_too_short_to_meet_are_named_with_what_they_lack(name, change, words):
    robot = replace(CATALOG[name], legs=legs_of(name, lambda i, leg: replace(leg, **change)))
    with pytest.raises(ModelError) as caught:
        home_pose(robot)
    assert words in str(caught.value)
    assert (caught.value.subject, caught.value.message) == (
        name,
        str(caught.value)[len(name) + 2 :],
    )


@CLIENTS
def test_a_cone_that_no_pose_or_next_to_none_keeps_is_named(monkeypatch):
    monkeypatch.setenv("PTERON_KERNELS", "auto")  # millions of poses are drawn

    def with_cone(axis, angle):
        first, *others = CATALOG["par4"].legs
        return replace(
            CATALOG["par4"], legs=(replace(first, platform_cone=Cone(axis, angle)), *others)
        )

    with pytest.raises(ModelError) as caught:
        home_pose(with_cone(Y, 0.8))
    assert "leg 1: rod at the platform at" in str(caught.value)
    assert "nan" not in str(caught.value)
    words = (
        r"only \d+ of \d+ random .* passive joints: leg 1: rod at the platform at 0.\d+ %; widen"
    )
    narrow = with_cone(Z, 0.05)
    with pytest.raises(ModelError, match=words):
        pteron.random_poses(narrow, 100)
    assert pose_margins(narrow, home_pose(narrow)).least > 0.3


@CLIENTS
def test_limits_that_no_pose_keeps_are_named_with_where_the_joints_are(monkeypatch):
    monkeypatch.setenv("PTERON_KERNELS", "auto")  # millions of poses are drawn
    robot = CATALOG["3-rrr"]
    elbows = legs_of("3-rrr", lambda i, leg: replace(leg, elbow_limits=(3.0, 3.1)))
    with pytest.raises(ModelError, match=r"legs 1, 2 and 3: elbow at .* to .* rad of 3 to 3\.1;"):
        home_pose(replace(robot, legs=elbows))
    far = legs_of("quadrupteron", lambda i, leg: replace(leg, limits=(1.0 + i, 2.0 + i)))
    with pytest.raises(ModelError, match=r"keeps the joints' limits; .*leg 4: slider at .* m of 4"):
        home_pose(replace(CATALOG["quadrupteron"], legs=far))


# What is possible but unlikely.


def crank(leg, **changes):
    body = leg.upper
    given = {"mass": body.mass, "center_of_mass": body.center_of_mass, "inertia": body.inertia}
    return PlanarInertia.of_body(**given | changes)


DOUBTS = {
    "limits: [-90.0, 90.0] rad: are these degrees?": lambda leg: {"limits": (-90.0, 90.0)},
    "upper: center_of_mass: x = -0.2463 m is not between": lambda leg: {
        "upper": crank(leg, center_of_mass=(-0.2463, 0.0))
    },
    "upper.center_of_mass: [0.2, 27.0] m: are these mm?": lambda leg: {
        "upper": crank(leg, center_of_mass=(0.2, 27.0), inertia=3000.0)
    },
    "upper: center_of_mass: 2.7 m beside it: are these mm?": lambda leg: {
        "upper": crank(leg, center_of_mass=(0.2, 2.7), inertia=30.0)
    },
    "kg m^2 leaves 2.07e+05 about the centre of mass": lambda leg: {
        "upper": crank(leg, inertia=207308.0)
    },
    "platform_point: 2.1 m from P, farther than the leg is long": lambda leg: {
        "platform_point": (2.1, 0.0, 0.0)
    },
    "fixed_offset: [125.0, 0.0, 0.0] m: are these mm?": lambda leg: {"fixed_offset": (125, 0, 0)},
}


@pytest.mark.parametrize("words", DOUBTS)
def test_a_leg_s_unlikely_numbers_are_doubted(words):
    robot = CATALOG["delta"]
    odd = replace(robot.legs[1], **DOUBTS[words](robot.legs[1]))
    found = machine_warnings(replace(robot, legs=(robot.legs[0], odd, robot.legs[2])))
    assert any(text.startswith("leg 2: ") and words in text for text in found), found
    assert not any(text.startswith("leg 1: ") for text in found)


def test_a_shaft_s_unlikely_numbers_are_doubted():
    robot = CATALOG["delta-4"]
    shaft = robot.legs[3]
    odd = replace(shaft, ratio=28.11, upper=shaft.lower, lower=shaft.upper, travel=(900.0, 1300.0))
    found = machine_warnings(replace(robot, legs=(*robot.legs[:3], odd)))
    for words in (
        "travel: [900.0, 1300.0] m: are these mm?",
        "ratio: 28.11",
        "upper: center_of_mass: x is neg",
        "lower: center_of_mass: x is po",
    ):
        assert any(text.startswith(f"leg 4: {words}") for text in found), words


def test_what_parallel_rods_would_keep_from_turning_is_asked_about():
    robot = CATALOG["delta-4"]
    rigid = legs_of(
        "delta-4",
        lambda i, leg: (
            leg if i == 3 else replace(leg, platform_point=leg.fixed_offset, fixed_offset=(0, 0, 0))
        ),
    )
    found = machine_warnings(replace(robot, legs=rigid))
    assert [text.split(": ")[0] for text in found] == ["legs 1, 2 and 3"]
    assert all("is the bar on a hinge there?" in text for text in found)
    # Alone on its hinge, a single rod lets the offset turn; a pair beside it would not.
    par4 = CATALOG["par4"]
    single = legs_of("par4", lambda i, leg: replace(leg, rods=1) if i < 2 else leg)
    found = machine_warnings(replace(par4, legs=single))
    assert [text.split(":")[0] for text in found] == ["leg 1", "leg 2"]
    assert all("no leg at this platform_point keeps it from turning" in text for text in found)
    one = legs_of("par4", lambda i, leg: replace(leg, rods=1) if i < 1 else leg)
    assert machine_warnings(replace(par4, legs=one)) == ()


SLIDERS, CRANKS = "quadrupteron", "delta"
DRIVE_DOUBTS = {
    "a ratio of 1 motor radians per metre (left out)": (SLIDERS, {"rotor_inertia": 3e-5}),
    "a ratio of 2 motor radians per metre: belts": (
        SLIDERS,
        {"rotor_inertia": 3e-5, "ratio": 2.0},
    ),
    "dry friction of 9 N is more than max_force, 8 N": (
        SLIDERS,
        {"coulomb": 7.0, "stribeck": pteron.legs.Stribeck(2.0, 0.01), "max_force": 8.0},
    ),
    "dry friction of 4 N m is more than rated_torque gives at the joint, 0.64 N m": (
        CRANKS,
        {"coulomb": 4.0, "rated_torque": 0.64},
    ),
    "max_force is 0.0019 times what rated_torque gives at the joint, 6.4e+04 N m": (
        CRANKS,
        {"rated_torque": 0.64, "ratio": 1e5, "max_force": 120.0},
    ),
    "rest_speed of 0.2 m/s smooths dry friction over much of": (
        SLIDERS,
        {"rest_speed": 0.2, "max_speed": 1.5},
    ),
    "stribeck.speed of 10 rad/s is beyond max_speed, 5 rad/s": (
        CRANKS,
        {"stribeck": pteron.legs.Stribeck(1.0, 10.0), "max_speed": 5.0},
    ),
    "vibrates at 0.87 Hz while the joint is held: are elastic.stiffness in N m/rad": (
        CRANKS,
        {"rotor_inertia": 1.0, "elastic": pteron.legs.Elastic(30.0)},
    ),
    "vibrates at 3.6e+04 Hz while the joint is held: are elastic.stiffness in N/m": (
        SLIDERS,
        {"rotor_inertia": 4e-7, "ratio": 300.0, "elastic": pteron.legs.Elastic(1.8e9)},
    ),
    "elastic.backlash of 0.1 rad is much: is it in rad?": (
        CRANKS,
        {"rotor_inertia": 0.1, "elastic": pteron.legs.Elastic(1e4, backlash=0.1)},
    ),
    "current_time of 0.2 s: current loops have": (CRANKS, {"current_time": 0.2}),
    "max_force is 120 N, but the winding gives 0.942 N at most": (
        SLIDERS,
        {"max_force": 120.0, "ratio": 392.7, "winding": pteron.legs.Winding(0.5, 1e-4, 12.0)},
    ),
    "max_speed is 1.5 m/s, but the winding's supply ends at 0.0012 m/s": (
        SLIDERS,
        {"max_speed": 1.5, "ratio": 400.0, "winding": pteron.legs.Winding(0.5, 100.0, 48.0)},
    ),
    "ripple of 2 times the torque: is its size a share": (
        CRANKS,
        {"ratio": 50.0, "ripple": (pteron.legs.Wave(6, 0.01), pteron.legs.Wave(12, -2.0))},
    ),
}


@pytest.mark.parametrize("words", DRIVE_DOUBTS)
def test_a_drive_s_unlikely_numbers_are_doubted(words):
    name, keys = DRIVE_DOUBTS[words]
    legs = legs_of(name, lambda i, leg: replace(leg, drive=pteron.legs.Drive(**keys)) if i else leg)
    found = machine_warnings(replace(CATALOG[name], legs=legs))
    assert all(text.split(": ")[1] == "drive" for text in found)
    others = legs_text(range(2, len(legs) + 1))
    assert next(text.split(":")[0] for text in found if words in text) == others, found


def test_drives_that_cannot_hold_the_home_pose_and_rotors_that_outweigh_all_are_doubted():
    robot = CATALOG["quadrupteron"]
    home = pteron.workspace.home_pose(robot)

    def found(**keys):
        legs = [replace(leg, drive=pteron.legs.Drive(**keys)) for leg in robot.legs]
        return load_warnings(replace(robot, legs=tuple(legs)), home)

    # Leg 1 carries the weight of 31 N; an offset of 5 N may hold it.
    (text,) = found(max_force=30.0)
    assert text.startswith("leg 1: drive: to hold the home pose takes 31.1 N, more than max_force")
    assert found(max_force=30.0, offset=-5.0) == ()
    assert found(max_force=32.0) == ()
    (text,) = found(rated_torque=0.1, ratio=300.0)
    assert "takes 31.1 N, more than rated_torque's force, 30 N" in text
    heavy = found(rotor_inertia=0.3, ratio=392.7)  # kg cm^2
    assert len(heavy) == 4
    assert "the rotor is 4.63e+04 kg at the joint" in heavy[0]
    assert heavy[0].endswith("is rotor_inertia in kg m^2?")
    assert found(rotor_inertia=3e-5, ratio=392.7) == ()


def test_nothing_in_the_catalog_is_doubted():
    assert {
        name: machine_warnings(robot) for name, robot in CATALOG.items() if machine_warnings(robot)
    } == {}


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("mass = 0.045", "mass = 5e-324", "inf times that of a uniform bar"),
        (
            "platform_point = [0.0, 0.0, 0.0]",
            "platform_point = [0.0, -1e308, 0.0]",
            "1e+308 m apart",
        ),
    ],
)
def test_numbers_whose_products_vanish_or_overflow_are_told(tmp_path, old, new, words):
    text = text_of("five-bar")
    assert old in text
    file = tmp_path / "bad.toml"
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    try:
        with warnings.catch_warnings(record=True) as unlikely:
            warnings.simplefilter("always")
            pteron.load(file)
        told = [str(warning.message) for warning in unlikely]
    except ModelError as error:
        told = error.faults
    assert any(words in line for line in told)
