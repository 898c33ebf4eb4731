"""Bad input to machines whose platforms tilt: one clear line each, in Python and commands."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import tilting
from commands import run
from mechanisms import CLIENTS, TILTED
from scipy.optimize import root
from scipy.spatial.transform import Rotation

import pteron
from pteron.errors import ModelError, SingularPose, UnlikelyValue, UnreachablePose
from pteron.manipulator.machine_warnings import machine_warnings
from pteron.workspace import home_pose, screw_lengths


def edited(robot, folder, *changes):
    """Return the path of a machine's file, in which texts are replaced."""
    path = pteron.save(robot, folder / "machine.toml")
    text = path.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_similar_hexagons_are_refused_with_the_reason(tmp_path):
    robot = TILTED["stewart"]
    legs = []
    for leg in robot.legs:
        legs.append(replace(leg, platform_point=tuple(0.4 * np.array(leg.guide_point))))
    alike = replace(robot, legs=tuple(legs))
    words = "guide points and the platform points are similar figures on a conic, the latter"
    assert words in pteron.kinematics.architecture(alike).reason
    with pytest.raises(SingularPose, match=words):
        pteron.random_poses(alike, 1)
    done = run(f"check {pteron.save(alike, tmp_path / 'alike.toml')}")
    assert done.exit_code == 2
    assert words in done.stderr


CIRCLE = np.array([[-0.6, -0.8], [-0.8, -0.6], [0, 1], [0.8, 0.6], [1, 0], [0.8, -0.6]])
PARABOLA = 0.5 * np.array([[-3, 9], [-2, 4], [0, 0], [0.5, 0.25], [1, 1], [2, 4]])
SIDES = np.array([[0, 0], [2, 0], [4, 0], [2.5, 1.5], [1, 3], [0.5, 1.5]])


@pytest.mark.parametrize(
    ("base", "top", "reason"),
    [
        (CIRCLE, PARABOLA, "lie on conics, the one a projective image of the other"),
        (SIDES, 0.6 * np.roll(SIDES, -1, axis=0), r"rams that push with \(1, -1, 1, -1, 1, -1\)"),
        (np.outer(CIRCLE[:, 0], [1, 2]), SIDES, "all guide points lie on one line"),
        (SIDES, 0.6 * SIDES, ""),
    ],
)
def test_figures_of_rams_that_balance_at_every_pose(base, top, reason):
    robot = TILTED["stewart"]
    flat = [np.column_stack([figure, np.zeros(6)]).tolist() for figure in (base, top)]
    free = {"limits": (0.1, 20.0), "base_cone": None, "platform_cone": None}
    legs = [
        replace(leg, guide_point=tuple(r), platform_point=tuple(s), **free)
        for leg, r, s in zip(robot.legs, *flat, strict=True)
    ]
    machine = replace(robot, legs=tuple(legs))
    found = pteron.kinematics.architecture(machine)
    assert re.search(reason, found.reason)
    assert found.proof == ("exact arithmetic" if reason else "one pose")
    assert (found.type_ii < 1e-12) == bool(reason)
    assert found.self_motions == ()
    if "push" in reason:
        oblique = pteron.turned(machine, tilting.rotation(np.random.default_rng(0)))
        assert "rams that push with (" in pteron.kinematics.architecture(oblique).reason


@CLIENTS
def test_equal_plates_are_told_to_move_with_their_rams_held(tmp_path):
    robot = TILTED["stewart"]
    azimuths = np.radians([-10.0, 10.0, 110.0, 130.0, 230.0, 250.0])
    plate = 1.5 * np.column_stack([np.cos(azimuths), np.sin(azimuths), np.zeros(6)])
    free = {"direction": None, "base_cone": None, "platform_cone": None}
    legs = tuple(
        replace(leg, guide_point=tuple(r), platform_point=tuple(-s), **free)
        for leg, r, s in zip(robot.legs, plate, np.roll(plate, 3, axis=0), strict=True)
    )
    done = run(f"check {pteron.save(replace(robot, legs=legs), tmp_path / 'plates.toml')}")
    assert done.exit_code == 0
    words = (
        "with its rams locked where a half turn takes the platform points of legs 1 and 4, 2 and 5"
    )
    assert words in " ".join(done.stdout.split())


@CLIENTS
def test_a_screws_length_is_that_of_a_ram_between_universal_joints(tmp_path):
    """Against the chain of its joints' rotations, solved by Powell's method."""
    robot, lead = TILTED["stewart"], 0.005
    legs = (robot.legs[0], replace(robot.legs[1], screw_lead=lead), *robot.legs[2:])
    robot = replace(robot, legs=legs)
    leg = robot.legs[1]
    axis = np.array(leg.direction)
    across = np.cross([0.0, 0.0, 1.0], axis)
    along, rng = np.cross(axis, across), np.random.default_rng(6)

    def turn(direction, angle):
        return Rotation.from_rotvec(angle * direction)

    def missed(angles, target):
        held = turn(axis, angles[0]) * turn(across, angles[1])
        piston = held * turn(along, angles[2])
        platform = piston * turn(across, angles[3]) * turn(axis, angles[4])
        end = leg.guide_point + angles[5] * held.apply(along)
        return np.append((platform * target[0].inv()).as_rotvec(), end - target[1])

    poses = home_pose(robot) + rng.uniform(-0.4, 0.4, (5, 6))
    for pose, added in zip(poses, screw_lengths(robot, poses), strict=True):
        place, rows = robot.platform.placement(pose)
        target = Rotation.from_matrix(rows.T), place + leg.platform_point @ rows
        length = pteron.inverse_kinematics(robot, pose)[1]
        found = root(missed, [0, 0, 0, 0, 0, length], args=(target,), tol=1e-14)
        assert np.abs(found.fun).max() < 1e-12
        assert added[1] == pytest.approx(lead * found.x[2] / (2.0 * np.pi), abs=1e-14)
        assert np.abs(added[1]) > 1e-5
        assert not np.delete(added, 1).any()
    done = run(f"check {pteron.save(robot, tmp_path / 'screw.toml')}")
    assert re.search(r"add up to [\d.]+ mm \(leg 2\)", done.stderr)


def test_rams_far_longer_than_the_platform_is_wide_are_not_singular():
    robot = TILTED["stewart"]
    far = tuple(replace(leg, limits=(0.01, 1e4)) for leg in robot.legs)
    assert not pteron.kinematics.architecture(replace(robot, legs=far)).singular


@CLIENTS
def test_points_in_line_are_the_reason():
    robot = tilting.machine("3R", ("UPS",), 4)[0]
    legs = [
        replace(leg, platform_point=(0.1 * k, 0.2 * k, 0.1 * k))
        for k, leg in enumerate(robot.legs, start=1)
    ]
    found = pteron.kinematics.architecture(replace(robot, legs=tuple(legs)))
    assert "all platform points lie on one line through P" in found.reason


def test_degrees_are_asked_about(tmp_path):
    wrist = TILTED["wrist"]
    robot = replace(
        wrist, platform=replace(wrist.platform, limits=((-30, 30), (-0.5, 0.5), (-9, 9)))
    )
    first, second = machine_warnings(robot)
    assert first == (
        "platform: limits: [-30.0, 30.0] rad, more than half a turn from roll = 0: are these "
        "degrees?"
    )
    assert "yaw = 0" in second
    with pytest.warns(UnlikelyValue, match="roll, pitch, yaw up to 5: are these degrees"):
        pteron.inverse_kinematics(wrist, [5.0, 2.0, 0.0])
    done = run(f"check {edited(wrist, tmp_path, ('angle = 1.2', 'angle = 70.0'))}")
    assert done.exit_code == 2
    assert "leg 1: platform_cone.angle: 70 rad given" in done.stderr
    assert "degrees" in done.stderr


def test_an_inertia_that_no_body_has_is_refused(tmp_path):
    path = edited(TILTED["wrist"], tmp_path, ("inertia = [0.0041,", "inertia = [0.0241,"))
    with pytest.raises(ModelError, match="belongs to no real body"):
        pteron.load(path)
    done = run(f"check {path}")
    assert done.exit_code == 2
    assert "platform.inertia: [0.0241" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_the_command_line_takes_angles_and_wrenches_of_a_platform_that_tilts(tmp_path):
    robot = TILTED["wrist"]
    pose, wrench = [0.1, 0.05, 0.02], [1.0, 2.0, 3.0, 0.0, 0.1, 0.2]
    words = " ".join(map(str, wrench))
    typed = json.loads(run(f"forces wrist --pose 0.1 0.05 0.02 --wrench {words} --json").stdout)
    expected = pteron.inverse_dynamics(robot, pose, [0.0] * 3, [0.0] * 3, wrench)
    np.testing.assert_allclose([typed[name] for name in robot.force_names], expected, rtol=1e-12)
    names = robot.column_names
    header = [*names["pose"], *names["velocity"], *names["acceleration"], *names["wrench"]]
    table = tmp_path / "motion.csv"
    row = [*pose, *[0.0] * 6, *wrench]
    table.write_text(f"{','.join(header)}\n{','.join(map(str, row))}\n", encoding="utf-8")
    (found,) = json.loads(run(f"forces wrist --table {table} --json").stdout)
    np.testing.assert_allclose([found[name] for name in robot.force_names], expected, rtol=1e-12)
    joints = json.loads(run("inverse wrist 0.1 0.05 0.02 --json").stdout)
    assert [*joints] == ["roll", "pitch", "yaw", "rho1", "rho2", "rho3"]


def test_random_poses_are_those_that_a_hexapod_takes():
    robot = TILTED["rubin-m2-hexapod"]
    poses = pteron.random_poses(robot, 50)
    joints = pteron.inverse_kinematics(robot, poses)
    low, high = np.array([leg.limits for leg in robot.legs]).T
    assert ((low <= joints) & (joints <= high)).all()
    assert np.abs(poses[:, 3:]).max() < 0.5
    assert np.ptp(poses[:, 2]) > 0.01


def test_planes_without_a_place_for_the_points_are_told():
    table = TILTED["ball-table"]
    legs = [
        replace(leg, guide_point=tuple(0.15 * np.array(leg.direction) + leg.guide_point))
        for leg in table.legs
    ]
    robot, pose = replace(table, legs=tuple(legs)), [0.12, 0.1, 0.1]
    for call in (
        lambda: pteron.inverse_kinematics(robot, pose),
        lambda: pteron.twist(robot, pose, [1.0, 0.0, 0.0]),
        lambda: pteron.pose_of(robot, [0.0, 0.0, 0.12], np.eye(3)),
    ):
        with pytest.raises(UnreachablePose, match="planes of the legs have no place"):
            call()
    assert np.isnan(pteron.twist(robot, pose, [1.0, 0.0, 0.0], on_failure="nan")).any()
    with pytest.raises(ModelError, match="no place for the points of a level platform"):
        home_pose(robot)
