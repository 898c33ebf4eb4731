"""Interference: the distance of segments, and of a machine's bodies."""

from dataclasses import replace
from itertools import pairwise, product

import casadi as ca
import descriptions
import numpy as np
import pytest
import tilting
from mechanisms import CATALOG, TILTED, gated, random_machine
from scipy.optimize import lsq_linear, minimize

import pteron
from pteron.equations.clearance import squared_distance
from pteron.kernels import numeric
from pteron.motion import joint_guides, joint_points
from pteron.workspace import Box, clearance, conditions, interference, prove


@pytest.fixture(scope="module")
def distance():
    ends = [ca.SX.sym(f"p{i}", 3) for i in range(4)]
    square = squared_distance((ends[0], ends[1]), (ends[2], ends[3]))
    function = ca.Function("distance", ends, [ca.sqrt(square)])
    return lambda given: np.array(function(*np.moveaxis(given, 1, 0).swapaxes(-1, -2))).ravel()


def random_segments(count):
    """Return pairs of segments (K, 4, 3), among them parallel, collinear, crossing ones, points."""
    rng = np.random.default_rng(0)
    given = rng.normal(size=(count, 4, 3))
    parallel = given[: count // 4]
    parallel[:, 3] = parallel[:, 2] + rng.normal(size=(len(parallel), 1)) * (
        parallel[:, 1] - parallel[:, 0]
    )
    parallel[::3, 2:] -= (parallel[:, 2] - parallel[:, 0])[::3, None]  # collinear
    given[-10:, 1] = given[-10:, 0]
    given[-5:, 3] = given[-5:, 2]
    return given


def test_segments_are_as_far_apart_as_a_search_over_both_finds(distance):
    given = random_segments(120)
    for (p, p_end, q, q_end), found in zip(given, distance(given), strict=True):

        def square(at, p=p, u=p_end - p, q=q, v=q_end - q):
            return ((p + at[0] * u - q - at[1] * v) ** 2).sum()

        starts = [(0.5, 0.5), (0.0, 0.0), (1.0, 1.0)]
        runs = [minimize(square, s, bounds=[(0, 1)] * 2, tol=1e-14) for s in starts]
        least = np.sqrt(min(run.fun for run in runs))
        assert found == pytest.approx(least, abs=2e-7)
        assert found <= least + 1e-12


def test_capsules_are_as_far_apart_as_mujoco_says(distance):
    mujoco = pytest.importorskip("mujoco")
    given = random_segments(60)[:50]
    size = np.linalg.norm(given[:, 1] - given[:, 0], axis=-1)
    given = given[size > 0.1]
    for four in given:
        texts = (" ".join(map(repr, ends.ravel().tolist())) for ends in (four[:2], four[2:]))
        geoms = "".join(
            f'<body><geom type="capsule" size="0.03" fromto="{text}"/></body>' for text in texts
        )
        model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{geoms}</worldbody></mujoco>")
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        told = mujoco.mj_geomDistance(model, data, 0, 1, 100.0, None)
        assert distance(four[None])[0] - 0.06 == pytest.approx(told, abs=1e-6)


@pytest.mark.parametrize(
    "name", gated(["delta", "h4", "tripteron", "linear-delta", "3-rrr"], ["h4", "3-rrr"])
)
def test_bodies_are_where_they_are_drawn(name, distance):
    """The pictures' lines, cut into bodies here, have the same least distances."""
    robot = CATALOG[name]
    poses = pteron.random_poses(robot, 3, seed=1, type_ii=0.0)
    found = clearance(robot, poses)
    for k, pose in enumerate(poses):
        points = joint_points(robot, pose)
        bodies = {"platform": []}
        for i, (line, guide) in enumerate(
            zip(points.links, joint_guides(robot, pose), strict=True), start=1
        ):
            names = robot.legs[i - 1].names
            links = [names[letter] for letter in "ul" if letter in names]
            for link, ends in zip(links, pairwise(line), strict=True):
                bodies[f"leg {i} {link}"] = [ends]
            if guide.is_prismatic:
                bodies[f"leg {i} guide"] = [guide.path]
        for part in points.parts:
            bodies["platform"] += [(part.hub, corner) for corner in part.corners]
        for (one, other), value in zip(found.pairs, found.distances[k], strict=True):
            pairs = np.array([[*a, *b] for a in bodies[one] for b in bodies[other]])
            assert value == pytest.approx(distance(pairs).min(), abs=1e-12), (one, other)


def link_lines(robot, pose, i, q):
    """Return the lines of leg i, from 1, with two links in space: where trigonometry has them."""
    leg = robot.legs[i - 1]
    machine = descriptions.describe(robot)
    at = descriptions.places(machine, ca.SX(ca.DM(pose)))[i - 1]
    point, last, upper = (np.array(ca.evalf(v)).ravel() for v in (at.point, at.last, at.upper))
    names = [f"leg {i} {leg.names[letter]}" for letter in "ul"]
    if leg.type == "SRRR":  # the straight lines between its axes, at one distance from the centre
        size, p = np.linalg.norm(leg.platform_point), np.array(robot.platform.center)
        end = p + np.array(leg.platform_point) @ robot.platform.placement(pose)[1]
        start, knee = p + size * np.array(leg.direction), p + size * last
        return {names[0]: [(start, knee)], names[1]: [(knee, end)]}
    length = q if leg.type == "RPUR" else leg.upper_length
    knee = point - last
    start = knee - length * upper
    lines = {names[0]: [(start, knee)], names[1]: [(knee, point)]}
    if "p" in leg.names:
        ends = [np.array(leg.guide_point) + v * np.array(leg.joint_axis) for v in leg.limits]
        lines[f"leg {i} guide"] = [ends]
    return lines


def lines_of(robot, pose):
    """Return the lines of a tilting machine's bodies, by formulas of textbooks."""
    p, axes = robot.platform.placement(pose)
    points = [p + leg.platform_point @ axes for leg in robot.legs]
    found = {"platform": [(p, point) for point in points]}
    joints = pteron.inverse_kinematics(robot, pose)
    for i, (leg, q, point) in enumerate(zip(robot.legs, joints, points, strict=True), start=1):
        start = np.array(leg.guide_point)
        if leg.type in ("PRRS", "PRUR", "RPUR", "SRRR"):
            found |= link_lines(robot, pose, i, q)
            continue
        if leg.names.get("u") == "cylinder":
            found[f"leg {i}"] = [(start, point)]
            continue
        if "p" in leg.names:
            ends = [start + value * np.array(leg.joint_axis) for value in (*leg.limits, q)]
            found[f"leg {i} guide"], end = [ends[:2]], ends[2]
        else:
            d, a = np.array(leg.direction), np.array(leg.zero_direction)
            end = start + leg.upper_length * (np.cos(q) * a + np.sin(q) * np.cross(d, a))
            found[f"leg {i} crank"] = [(start, end)]
        found[f"leg {i} {leg.names['l']}"] = [(end, point)]
    return found


@pytest.mark.parametrize("name", gated(TILTED, ["stewart"]))
def test_bodies_of_tilting_machines_are_as_far_apart_as_least_squares_find(name):
    turn = tilting.rotation(np.random.default_rng(1))
    thick = {"guide": 0.001, "upper": 0.004, "lower": 0.003, "platform": 0.002}
    radii = {"guide": 0.001, "crank": 0.004, "cylinder": 0.004, "platform": 0.002}
    for robot in (TILTED[name], pteron.turned(TILTED[name], turn)):
        poses = pteron.random_poses(robot, 3, seed=1, type_ii=0.0)
        found = clearance(robot, poses, thick)
        assert {"leg 1", "leg 2"} <= {word[:5] for pair in found.pairs for word in pair}
        for pose, told in zip(poses, found.distances, strict=True):
            lines = lines_of(robot, pose)
            for (one, other), value in zip(found.pairs, told, strict=True):
                apart = []
                for (a, a_end), (b, b_end) in product(lines[one], lines[other]):
                    across = np.transpose([a_end - a, b - b_end])
                    near = lsq_linear(across, b - a, (0.0, 1.0), tol=1e-15)
                    apart.append(np.sqrt(2.0 * near.cost))
                # A ram has the thicker of its two parts.
                taken = sum(
                    radii.get(word.split()[-1], 0.003 if word.split()[2:] else 0.004)
                    if "upper" not in word
                    else 0.004
                    for word in (one, other)
                )
                assert value == pytest.approx(min(apart) - taken, abs=1e-9), (one, other)


def test_bodies_with_a_common_joint_are_left_out():
    pairs = clearance("five-bar", [0.0, 0.15]).pairs
    assert pairs == (
        ("leg 1 crank", "leg 2 crank"),
        ("leg 1 crank", "leg 2 lower link"),
        ("leg 1 lower link", "leg 2 crank"),
    )


def test_thickness_is_taken_off(tmp_path):
    robot, pose = CATALOG["delta"], [0.0, 0.0, -0.9]
    lines = clearance(robot, pose)
    thick = clearance(robot, pose, {"upper": 0.02, "platform": 0.01})
    taken = dict(zip(lines.pairs, lines.distances - thick.distances, strict=True))
    assert taken["leg 1 crank", "leg 2 crank"] == pytest.approx(0.04)
    assert taken["leg 1 crank", "platform"] == pytest.approx(0.03)
    assert taken["leg 1 rod", "leg 2 rod"] == pytest.approx(0.0)
    own = replace(robot, radii=pteron.manipulator.Radii(upper=0.02, platform=0.01))
    assert pteron.load(pteron.save(own, tmp_path / "thick.toml")) == own
    np.testing.assert_array_equal(clearance(own, pose).distances, thick.distances)
    assert thick.least == thick.distances.min()
    with pytest.raises(pteron.ModelError, match="upper: -1 m is negative"):
        clearance(robot, pose, {"upper": -1.0})
    with pytest.raises(pteron.DataError, match="'rods' is not one of guide, upper, lower"):
        clearance(robot, pose, {"rods": 1.0})


def test_rods_of_known_bars_are_two(tmp_path):
    robot = CATALOG["delta"]
    wide = replace(robot, legs=tuple(replace(leg, bar_length=0.08) for leg in robot.legs))
    assert pteron.load(pteron.save(wide, tmp_path / "wide.toml")) == wide
    pose = [0.02, 0.01, -0.9]
    one, two = clearance(robot, pose), clearance(wide, pose)
    rods = [k for k, pair in enumerate(two.pairs) if "rods" in pair[0] + pair[1]]
    assert rods
    assert (two.distances[rods] < one.distances[rods]).all()
    assert (two.distances[rods] > one.distances[rods] - 0.081).all()


def test_out_of_reach_is_nan_and_stays_in_its_row():
    robot = random_machine(1, "PRSS")
    poses = np.zeros((3, 4))
    poses[1, 0] = 9.0
    with pytest.raises(pteron.UnreachablePose, match=r"pose\[1\]"):
        clearance(robot, poses)
    found = clearance(robot, poses, on_failure="nan").distances
    np.testing.assert_array_equal(np.isnan(found).all(axis=-1), [False, True, False])
    np.testing.assert_array_equal(found[0], found[2])
    assert numeric(robot, "clearances")(poses)[0].shape == found.shape


def test_a_region_is_proved_free_of_interference_or_a_pose_shown():
    robot, region = CATALOG["five-bar"], Box((-0.01, 0.15), (0.01, 0.16))
    proof = prove(robot, region, given=(*conditions(robot), *interference(robot, 0.01)))
    assert proof.holds
    proof = prove(robot, region, given=interference(robot, {"upper": 0.06}))
    assert proof.holds is False
    assert clearance(robot, proof.counterexample, {"upper": 0.06}).least < 0.0
    assert "interference of upper links or cranks" in str(proof.causes[0])
