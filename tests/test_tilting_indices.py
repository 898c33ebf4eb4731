"""Indices of machines whose platforms tilt, against linear algebra on Jacobians by differences."""

from dataclasses import replace

import numpy as np
import pytest
import tilting
from mechanisms import TILTED, gated, scaled, several
from scipy.linalg import eigh

import pteron
from pteron.errors import ModelError
from pteron.indices import (
    Elasticity,
    Section,
    evaluate,
    geometric_sensitivities,
    indices_of,
    stiffness,
)
from pteron.workspace import home_pose

CASES = [("1T2R", ("RPS",)), ("2R", ("UPS", "PSS", "RSS"))]
CASES += [("1T2R", ("RPS", "PRS", "RRS")), ("3T3R", ("UPS",)), ("3R", ("UPS", "PSS", "RSS"))]


def twists(robot, pose):
    """Return d(v, omega) / d x' (6, m), by differences of P and of the axes."""
    columns, step = [], 1e-5
    for way in np.eye(len(pose)):
        (p1, r1), (p0, r0) = (
            robot.platform.placement(pose + side * step * way) for side in (1, -1)
        )
        turn = r1.T @ r0 / (4 * step)  # R(t) R(-t)^T, axes being rows
        spin = [turn[i - 1, i - 2] - turn[i - 2, i - 1] for i in range(3)]
        columns.append([*(p1 - p0) / (2 * step), *spin])
    return np.array(columns).T


@pytest.mark.parametrize(("motion", "kinds"), several(CASES, CASES[1:2]))
def test_indices_are_those_of_the_homogeneous_jacobian(motion, kinds):
    robot, home = tilting.machine(motion, kinds, 3)
    poses = tilting.states(robot, home, 3)[0]
    found = {name: evaluate(robot, name, poses) for name in indices_of(robot)}
    assert ("speed_least" in found) == bool(robot.platform.lengths)
    levers = np.array([leg.lever for leg in robot.legs])
    for k, pose in enumerate(poses):
        twist, axes = twists(robot, pose), robot.platform.placement(pose)[1]
        # Along which the index counts: the twist, omega, or the pose's own coordinates.
        basis = twist if motion in ("1T2R", "2R") else np.eye(6)[:, -len(pose) :]
        quasi = np.linalg.lstsq(basis, twist, rcond=None)[0]
        rows = levers[:, None] * pteron.jacobian(robot, pose) @ np.linalg.inv(quasi)
        lengths = len(robot.platform.lengths)
        points = [
            basis[:3] - np.cross(np.array(leg.platform_point) @ axes, basis[3:], axisb=0).T
            for leg in robot.legs
        ]
        square = np.mean([(one[:, lengths:] ** 2).sum(0).mean() for one in points])
        length = np.sqrt(square)
        rows[:, lengths:] /= length
        inverse = np.linalg.inv(rows)
        turning = {
            "condition": np.linalg.cond(rows),
            "manipulability": 1 / abs(np.linalg.det(rows)),
            "turning_speed": 1 / (length * np.linalg.norm(rows[:, lengths:], 2)),
            "turning_moment": length / np.linalg.norm(inverse[lengths:], 2),
            "turning_error": np.linalg.norm(inverse[lengths:]) / length,
        }
        moving = lengths and {
            "speed_least": 1 / np.linalg.norm(rows[:, :lengths], 2),
            "force_least": 1 / np.linalg.norm(inverse[:lengths], 2),
            "error": np.linalg.norm(inverse[:lengths]),
        }
        for name, value in (turning | (moving or {})).items():
            assert found[name][k] == pytest.approx(value, rel=1e-6), name


@pytest.mark.parametrize("shape", [(6, 6), (6, 5), (6, 3)])
def test_singular_values_of_six_columns(shape):
    import casadi as ca

    from pteron.equations.singular_values import singular_values

    matrix = ca.SX.sym("m", *shape)
    values = ca.Function("values", [matrix], [ca.vertcat(*singular_values(matrix))])
    rng = np.random.default_rng(0)
    for graded in (0.0, 2.0):
        for _ in range(20):
            one = rng.normal(size=shape) * 10.0 ** rng.uniform(-graded, graded, shape[1])
            found = np.sort(np.asarray(values(one)).ravel())[::-1]
            np.testing.assert_allclose(found, np.linalg.svd(one)[1], rtol=1e-11)


@pytest.mark.parametrize("factor", [1e3, 1e-3])
def test_natural_frequencies_with_elastic_links_do_not_depend_on_the_unit_of_length(factor):
    """A tripod written in mm has the same: its parasitic motions are held, whatever they count."""
    robot = pteron.load("sprint-z3")
    pose = np.add(home_pose(robot), [0.0, 0.1, -0.05])
    section = {"axial": 2e7, "bending": 4e3, "sideways": 4e3, "torsion": 3e3}
    # In N = kg m/s^2: forces scale with the length, E A too, E I with its third power.
    other = {key: value * factor ** (1 if key == "axial" else 3) for key, value in section.items()}
    at = np.where(robot.platform.angular, pose, factor * pose)
    plain, elastic = (
        stiffness(machine, where, Elasticity(2e6, Section(**part), Section(**part))).frequencies
        for machine, where, part in ((robot, pose, section), (scaled(robot, factor), at, other))
    )
    np.testing.assert_allclose(elastic, plain, rtol=1e-8)
    # T^T C^-1 T by hand, both at P: C has no direction in which nothing gives way.
    robot = replace(robot, platform=replace(robot.platform, tool=(0.0, 0.0, 0.0)))
    found = stiffness(robot, pose, Elasticity(2e6, Section(**section), Section(**section)))
    twists = pteron.twist(robot, pose, np.eye(3)).T
    stiff = twists.T @ np.linalg.solve(found.compliance, twists)
    squares = eigh(stiff, pteron.mass_matrix(robot, pose), eigvals_only=True)
    np.testing.assert_allclose(found.frequencies, np.sqrt(squares) / (2 * np.pi), rtol=1e-8)


@pytest.mark.parametrize("name", gated(["wrist", "ball-table", "stewart"], ["ball-table"]))
def test_stiffness_is_that_of_the_actuators_springs(name):
    """C = T J^-1 K^-1 J^-T T^T, T the tool's twist against the pose's rates."""
    robot, tool = TILTED[name], np.array([0.1, 0.02, -0.05])
    m = robot.freedom
    robot = replace(robot, platform=replace(robot.platform, tool=tuple(tool)))
    pose = home_pose(robot)
    pose[robot.platform.angular] += 0.05 * np.arange(1, 1 + robot.platform.angular.sum())
    springs = 1e5 * np.arange(1.0, m + 1.0)
    found = stiffness(robot, pose, Elasticity(tuple(springs)))
    rows = pteron.jacobian(robot, pose)
    moves = pteron.twist(robot, pose, np.eye(m))
    moves[:, :3] += np.cross(moves[:, 3:], tool @ robot.platform.placement(pose)[1])
    per_joint = moves.T @ np.linalg.inv(rows)
    exact = per_joint @ np.diag(1.0 / springs) @ per_joint.T
    np.testing.assert_allclose(found.compliance, exact, atol=1e-12 * np.abs(exact).max())
    mass = pteron.mass_matrix(robot, pose)
    squares = eigh(rows.T @ np.diag(springs) @ rows, mass, eigvals_only=True)
    np.testing.assert_allclose(found.frequencies, np.sqrt(squares) / (2 * np.pi), rtol=1e-9)
    assert found.directional_stiffness([0.0, 0.0, 1.0]) == pytest.approx(
        1.0 / exact[2, 2], rel=1e-9
    )
    if m < 6:
        with pytest.raises(ModelError, match=f"a platform of {m} freedoms does not give way"):
            _ = found.matrix
    # A platform point that is elsewhere moves the tool as the changed machine's poses say.
    told = geometric_sensitivities(robot, pose)
    k = told.names.index("leg 2: platform_point z")
    step, leg = 1e-6, robot.legs[1]
    x, y, z = leg.platform_point
    other = replace(leg, platform_point=(x, y, z + step))
    changed = replace(robot, legs=(robot.legs[0], other, *robot.legs[2:]))
    joints = pteron.inverse_kinematics(robot, pose)
    p, axes = robot.platform.placement(pteron.follow(changed, joints[None], pose)[0])
    before, turned = robot.platform.placement(pose)
    moved = robot.platform.directions @ (p + tool @ axes - before - tool @ turned)
    count = len(robot.platform.lengths)
    np.testing.assert_allclose(told.tool[:count, k], moved / step, atol=2e-5)
