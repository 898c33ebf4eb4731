"""Indices against second formulas, stiffness and errors against other methods."""

import warnings
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from differences import gradient
from mechanisms import CATALOG, gated, random_machine, states
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

import pteron
from pteron.equations.singular_values import singular_values
from pteron.errors import DataError, ModelError, SingularPose, UnreachablePose
from pteron.indices import (
    ALUMINIUM,
    INDICES,
    STEEL,
    Elasticity,
    Material,
    Section,
    Tolerances,
    evaluate,
    geometric_sensitivities,
    global_conditioning,
    indices_of,
    pose_error,
    stiffness,
)
from pteron.kernels import numeric
from pteron.kernels.c import compiler

MIXED = random_machine(0, "PRSU")


def homogeneous(robot, poses):
    """Return J without units, and L, by the definition."""
    rows = pteron.jacobian(robot, poses)
    held = [leg.platform_point[:2] for leg in robot.legs if not leg.follows_angle]
    length = np.sqrt(np.square(held).sum(-1).mean()) or 1.0
    for i, leg in enumerate(robot.legs):
        rows[:, i] *= length / np.abs(rows[:, i, -1:]) if leg.follows_angle else leg.lever
    if robot.platform.turns:
        rows[..., -1] /= length
    return rows, length


def expected(robot, poses):
    """Return every index by NumPy's decompositions, and by points moved by differences."""
    rows, length = homogeneous(robot, poses)
    k = len(robot.platform.lengths)
    inverse = np.linalg.inv(rows)
    sizes = np.linalg.svd(rows[..., :k], compute_uv=False)
    held = np.linalg.svd(inverse[:, :k], compute_uv=False)
    signs = np.stack(np.meshgrid(*[[1.0, -1.0]] * robot.freedom), -1).reshape(-1, robot.freedom)
    mass = pteron.mass_matrix(robot, poses)
    scale = np.ones(robot.freedom)
    scale[k:] = length
    found = {
        "condition": np.linalg.cond(rows),
        "manipulability": 1 / np.abs(np.linalg.det(rows)),
        "speed_least": 1 / sizes[:, 0],
        "speed_most": 1 / sizes[:, -1],
        "force_least": 1 / held[:, 0],
        "force_most": 1 / held[:, -1],
        "error": np.linalg.norm(inverse[:, :k], axis=(1, 2)),
        "error_worst": np.linalg.norm(inverse[:, :k] @ signs.T, axis=1).max(-1),
        "kappa": np.linalg.cond(mass / np.outer(scale, scale)),
    }
    if robot.platform.turns:
        found |= {
            "turning_speed": 1 / np.linalg.norm(rows[..., -1] * length, axis=-1),
            "turning_moment": length / np.linalg.norm(inverse[:, -1], axis=-1),
            "turning_error": np.linalg.norm(inverse[:, -1], axis=-1) / length,
            "turning_error_worst": np.abs(inverse[:, -1] @ signs.T).max(-1) / length,
        }
    # The platform points as they move: (B, n, 3, m).
    moves = gradient(lambda p: numeric(robot, "platform_points")(p)[0], poses)
    plain = pteron.jacobian(robot, poses)
    forces = plain[..., :k] @ robot.platform.directions  # dq/dc, as all points translate alike
    at, out = [], []
    for i, leg in enumerate(robot.legs):
        if leg.follows_angle:
            continue
        n = np.linalg.norm(forces[:, i], axis=-1)
        at.append(np.arccos(1 / (n * leg.lever)))
        way = (moves[:, i] @ np.linalg.inv(plain)[:, :, i, None])[..., 0]
        out.append(np.arccos(1 / (n * np.linalg.norm(way, axis=-1))))
    found |= {"pressure_angle": np.max(at, 0), "output_pressure_angle": np.max(out, 0)}
    if not any(leg.follows_angle for leg in robot.legs):
        stacked = moves.reshape(len(poses), -1, robot.freedom) / np.sqrt(robot.freedom)
        levers = np.array([leg.lever for leg in robot.legs])
        by_points = np.linalg.svd(levers[:, None] * plain @ np.linalg.pinv(stacked))[1]
        found["condition_points"] = by_points[:, 0] / by_points[:, robot.freedom - 1]
    return found


SOME = {
    "3-rrr": tuple(INDICES),
    "delta-4": ("condition", "turning_speed", "pressure_angle"),
    "mixed": ("condition", "force_least", "output_pressure_angle"),
}


@pytest.mark.parametrize("name", gated(SOME, ["delta-4", "mixed"]))
def test_indices_by_second_formulas(name):
    robot = MIXED if name == "mixed" else CATALOG[name]
    poses = states(robot, 20)[0]
    known = expected(robot, poses)
    assert set(known) <= set(indices_of(robot)) == set(INDICES)
    for index in SOME[name]:
        found = evaluate(robot, index, poses)
        np.testing.assert_allclose(found, known[index], rtol=1e-8, err_msg=index)


def test_the_orthoglide_s_published_speeds():
    """Chablat and Wenger made them 1/2 and 2 at the ends of the diagonal of its cube."""
    ends = np.array([-0.31058285412302 / np.sqrt(6), 0.31058285412302 / np.sqrt(18)])
    least, most = (
        evaluate("orthoglide", name, ends[:, None] * np.ones(3))
        for name in ("speed_least", "speed_most")
    )
    np.testing.assert_allclose(least.min(), 0.5, rtol=1e-9)
    np.testing.assert_allclose(most.max(), 2.0, rtol=1e-9)
    assert evaluate("orthoglide", "condition", np.zeros(3)) == pytest.approx(1.0, rel=1e-15)


@pytest.mark.parametrize("n", [2, 3, 4])
def test_singular_values(n):
    rng = np.random.default_rng(n)
    drawn = rng.normal(size=(500, n, n))
    drawn[100:200] *= np.logspace(-4, 0, n)
    drawn[200:300] *= np.logspace(0, -4, n)[:, None]
    left, _, right = np.linalg.svd(drawn[300:400])
    drawn[300:400] = left @ (np.sort(10.0 ** rng.uniform(-5, 0, (100, n, 1))) * right)
    drawn[400:] = np.linalg.qr(drawn[400:])[0]  # all equal
    drawn[0], drawn[1] = 0.0, np.ones((n, n))
    matrix = ca.SX.sym("matrix", n, n)
    function = ca.Function("sizes", [matrix], [ca.vertcat(*singular_values(matrix))])
    found = np.array(function.map(500)(np.hstack(drawn))).T
    exact = np.linalg.svd(drawn, compute_uv=False)
    np.testing.assert_allclose(np.sort(found)[2:, ::-1], exact[2:], rtol=1e-9)
    np.testing.assert_allclose(np.sort(found)[:2, ::-1], exact[:2], rtol=0, atol=1e-14)


def test_bad_poses_and_bad_words():
    poses = np.array([[0.0, 0.0, 0.0, 0.1], [9.0, 0.0, 0.0, 0.0], [0.01, 0.0, 0.0, np.pi / 2]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = {
            name: evaluate("quadrupteron", name, poses, on_failure="nan")
            for name in ("condition", "error")
        }
    assert np.isnan(found["condition"]).tolist() == [False, True, False]
    assert np.isnan(found["error"]).tolist() == [False, True, True]
    assert found["condition"][2] > 1e14
    assert found["error"][0] == evaluate("quadrupteron", "error", poses[0])
    with pytest.raises(UnreachablePose, match=r"pose\[1\]"):
        evaluate("quadrupteron", "condition", poses)
    with pytest.raises(SingularPose, match="type II"):
        evaluate("quadrupteron", "error", poses[2])
    with pytest.raises(DataError, match="index: 'speed' is not known; choose from condition, "):
        evaluate("tripteron", "speed", np.zeros(3))
    with pytest.raises(ModelError, match="'turning_error' is about turning, but this 3T platform"):
        evaluate("tripteron", "turning_error", np.zeros(3))


@pytest.mark.skipif(compiler() is None, reason="needs a C compiler")
def test_compiled_indices_return_the_same_bits():
    robot, poses = CATALOG["five-bar"], states(CATALOG["five-bar"], 40)[0]
    fast, plain = (pteron.compile(robot, "condition", target)(poses) for target in ("c", "vm"))
    np.testing.assert_array_equal(fast, plain)


def test_global_conditioning():
    robot = CATALOG["linear-delta"]
    center = pteron.workspace.home_pose(robot)
    box = center + np.array([[-0.05] * 3, [0.05] * 3])
    found = global_conditioning(robot, center, box=box, count=1 << 12)
    grid = np.linspace(-1, 1, 41)[1::2] * 0.05  # midpoints
    poses = center + np.stack(np.meshgrid(grid, grid, grid), -1).reshape(-1, 3)
    inside = 1 / np.linalg.cond(pteron.jacobian(robot, poses))
    assert found.share == 1.0
    assert abs(found.value - inside.mean()) < 5 * found.standard_error + 1e-4
    assert found.standard_error < 1e-3
    with pytest.raises(DataError, match="box: "):
        global_conditioning(robot, center, box=[center, center])


# Stiffness

SPRINGS = np.array([3e5, 5e5, 2e5, 4e5])


@pytest.mark.parametrize("robot", [CATALOG["3-rrr"], MIXED], ids=str)
def test_springs_at_the_joints_alone(robot):
    """K = J^T K_q J; natural frequencies by a generalised eigenvalue problem."""
    poses, springs = states(robot, 3)[0], SPRINGS[: robot.freedom]
    found = stiffness(robot, poses, Elasticity(tuple(springs)))
    rows = pteron.jacobian(robot, poses)
    exact = rows.mT @ (springs[:, None] * rows)
    scale = np.abs(exact).max()
    np.testing.assert_allclose(found.matrix, exact, rtol=0, atol=1e-9 * scale)
    squares = eigh(exact[0], pteron.mass_matrix(robot, poses)[0], eigvals_only=True)
    np.testing.assert_allclose(found.frequencies[0], np.sqrt(squares) / (2 * np.pi), rtol=1e-8)
    # Where direct kinematics, by Newton's method, has the platform as the loaded springs give way.
    pose, load = poses[0], 0.2 * np.linspace(1.0, -1.0, robot.freedom)
    given = pteron.inverse_kinematics(robot, pose) + np.linalg.solve(rows[0].T, load) / springs
    at = pose
    for _ in range(4):
        missed = pteron.inverse_kinematics(robot, at) - given
        at = at - np.linalg.solve(rows[0], missed)
    way = found.compliance[0] @ load
    np.testing.assert_allclose(at - pose, way, rtol=0, atol=1e-4 * np.abs(way).max())


def test_at_a_tool_a_force_is_a_moment_too():
    robot = CATALOG["3-rrr"]
    robot = replace(robot, platform=replace(robot.platform, tool=(0.05, -0.02, 0.0)))
    pose = states(CATALOG["3-rrr"], 1)[0][0]
    lever, angle = np.eye(3), pose[2]
    lever[:2, 2] = [
        -0.05 * np.sin(angle) + 0.02 * np.cos(angle),
        0.05 * np.cos(angle) + 0.02 * np.sin(angle),
    ]
    rows = pteron.jacobian(robot, pose)
    exact = lever @ np.linalg.inv(rows.T @ (SPRINGS[:3, None] * rows)) @ lever.T
    found = stiffness(robot, pose, Elasticity(tuple(SPRINGS[:3]))).compliance
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-9 * np.abs(exact).max())


def frame_compliance(robot, pose, spring, section):
    """Return the compliance of a Tripteron by finite elements: beams between joints (Lagrange)."""
    a, b, c, t = section.axial, section.bending, section.sideways, section.torsion

    def beam(way, z):
        length = np.linalg.norm(way)
        x = way / length
        turn = np.kron(np.eye(4), np.array([x, np.cross(z, x), z]))
        local = np.zeros((12, 12))
        for i, j in ((0, 6), (3, 9)):
            k = (a if i == 0 else t) / length
            local[np.ix_([i, j], [i, j])] = [[k, -k], [-k, k]]
        for e_i, places, s in ((b, [1, 5, 7, 11], 1), (c, [2, 4, 8, 10], -1)):
            n = length
            local[np.ix_(places, places)] = (e_i / n**3) * np.array(
                [
                    [12, s * 6 * n, -12, s * 6 * n],
                    [s * 6 * n, 4 * n**2, -s * 6 * n, 2 * n**2],
                    [-12, -s * 6 * n, 12, -s * 6 * n],
                    [s * 6 * n, 2 * n**2, -s * 6 * n, 4 * n**2],
                ]
            )
        return turn.T @ local @ turn

    size = 6 + 24 * 3
    stiff, ties = np.zeros((size, size)), []
    upper, lower = pteron.kinematics.link_vectors(robot, pose)
    for i, leg in enumerate(robot.legs):
        d, s = np.array(leg.direction), np.array(leg.platform_point)
        at = 6 + 24 * i
        for k, way in enumerate((upper[i], lower[i])):
            part = slice(at + 12 * k, at + 12 * k + 12)
            stiff[part, part] += beam(way, d)
        stiff[at : at + 3, at : at + 3] += spring * np.outer(d, d)
        across = np.linalg.svd(d[None])[2][1:]
        start, end, knee, tip = (range(at + 6 * k, at + 6 * k + 6) for k in range(4))
        for v in across:  # the guide, and three revolute joints
            for columns in (
                [(start[:3], v)],
                [(start[3:], v)],
                [(end[3:], v), (knee[3:], -v)],
                [(tip[3:], v), (range(3, 6), -v)],
            ):
                row = np.zeros(size)
                for places, value in columns:
                    row[list(places)] = value
                ties.append(row)
        for e in np.eye(3):
            row = np.zeros(size)
            row[list(end[:3])], row[list(knee[:3])] = e, -e
            ties.append(row)
            row = np.zeros(size)  # the tip moves with the platform: v + omega x s
            row[list(tip[:3])], row[:3], row[3:6] = e, -e, -np.cross(s, e)
            ties.append(row)
    ties = np.array(ties)
    ties /= np.linalg.norm(ties, axis=1, keepdims=True)
    scale = np.abs(stiff).max()
    whole = np.block([[stiff / scale, ties.T], [ties, np.zeros((len(ties), len(ties)))]])
    loads = np.zeros((len(whole), 3))
    loads[:3] = np.eye(3) / scale
    return np.linalg.solve(whole, loads)[:3]


def test_an_overconstrained_machine_as_a_frame_of_beams():
    robot, section = CATALOG["tripteron"], Section.tube(0.03, 0.003, ALUMINIUM)
    section = replace(section, sideways=0.6 * section.sideways)
    for pose in states(robot, 2)[0]:
        found = stiffness(robot, pose, Elasticity(1e6, upper=section, lower=section))
        exact = frame_compliance(robot, pose, 1e6, section)
        scale = np.abs(exact).max()
        np.testing.assert_allclose(found.compliance, exact, rtol=0, atol=1e-6 * scale)
        assert found.least <= found.directional_stiffness([1.0, 2.0, 3.0]) <= found.greatest


def test_a_published_tripteron():
    """Colours of deflection maps under 1 kN, by matrix structural analysis (MOstanin on GitHub).

    Tripteron-stiffness, figures maps/scatter_MSA_*.svg: 12 equal steps of the colour bar, at
    z = 0.9 m and y = 0.1 to 0.9 m; the code of IEEE Xplore's document 9290208.
    """
    plain = CATALOG["tripteron"]
    points = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    changes = {"platform_point": (0.0, 0.0, 0.0), "upper_length": 0.75, "lower_length": 0.75}
    legs = tuple(
        replace(leg, guide_point=point, direction=tuple(axis), elbow=-1, limits=None, **changes)
        for leg, point, axis in zip(plain.legs, points, np.eye(3), strict=True)
    )
    rod = Section.tube(0.15, 0.075, Material(70e9, 25.5e9))
    y = np.linspace(0.1, 0.9, 9)
    poses = np.stack([np.stack([np.full(9, x), y, np.full(9, 0.9)], -1) for x in (0.8, 0.9)])
    elasticity = Elasticity(1e6, upper=rod, lower=rod)
    found = stiffness(replace(plain, legs=legs), poses, elasticity).compliance
    along_x = [11, 10, 9, 8, 8, 7, 7, 6, 6]
    for load, ends, steps in (
        ([1e3, 0.0, 0.0], (1.1e-3, 1.4e-3), [along_x, along_x]),
        (
            [0.0, 0.0, 1e3],
            (1.1e-3, 1.4e-3),
            [[5, 5, 5, 6, 6, 7, 8, 8, 9], [6, 6, 6, 7, 7, 8, 9, 9, 10]],
        ),
        ([1e3, 1e3, 1e3], (2.0e-3, 2.6e-3), [[7] * 9, [8] * 9]),
    ):
        way = np.linalg.norm(found @ load, axis=-1)
        np.testing.assert_array_equal((12 * (way - ends[0]) / np.ptp(ends)).astype(int), steps)


def test_parallel_rods_as_six_springs():
    robot, distance, rod = CATALOG["linear-delta"], 0.08, Section.tube(0.01, 0.005, STEEL)
    pose = pteron.workspace.home_pose(robot) + np.array([0.02, -0.01, 0.01])
    p, whole = robot.platform.placement(pose)[0], np.zeros((6, 6))
    tips = numeric(robot, "joint_points")(pose)[0][:, 1]
    ends = numeric(robot, "platform_points")(pose)[0]
    for leg, tip, end in zip(robot.legs, tips, ends, strict=True):
        n = (end - tip) / leg.lower_length
        for side in (-0.5, 0.5):
            arm = end - p + side * distance * np.array(leg.bar_direction)
            g = np.concatenate([n, np.cross(arm, n)])
            whole += 0.5 * rod.axial / leg.lower_length * np.outer(g, g)
    found = stiffness(robot, pose, Elasticity(lower=rod, rod_distance=distance))
    exact = np.linalg.inv(whole)[:3, :3]
    np.testing.assert_allclose(found.compliance, exact, rtol=0, atol=1e-8 * np.abs(exact).max())


def test_stiffness_refuses_and_leaves_out():
    poses = np.array([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0]])
    found = stiffness("tripteron", poses, Elasticity(1e5), on_failure="nan")
    assert np.isnan(found.compliance[1]).all()
    assert np.isnan(found.least[1])
    assert found.least[0] == pytest.approx(1e5)
    with pytest.raises(UnreachablePose):
        stiffness("tripteron", poses, Elasticity(1e5))
    with pytest.raises(ModelError, match="actuators: 2 given, but tripteron has 3 legs"):
        stiffness("tripteron", poses[0], Elasticity((1e5, 1e5)))
    with pytest.raises(ModelError, match=r"wall: 0\.02 m given, at most half of the diameter"):
        Section.tube(0.03, 0.02, STEEL)


# Errors


def moved_parts(leg, names):
    """Return by the name of a dimension what leg 1 has where it is off by h."""
    name = "direction" if leg.type == "RSS" else "slider_direction"
    tilt = next(n for n in names if n.startswith(f"leg 1: {name} about "))
    d, axis = np.array(getattr(leg, name)), np.eye(3)["xyz".index(tilt[-1])]
    axis = axis - (axis @ d) * d
    axis /= np.linalg.norm(axis)

    def tilted(h):
        whole = Rotation.from_rotvec(h * axis).as_matrix()
        turned = (name, "zero_direction") if leg.type == "RSS" else (name,)
        return {key: tuple(whole @ getattr(leg, key)) for key in turned}

    found = {tilt: tilted}
    if leg.type == "RSS":
        found["leg 1: lower_length"] = lambda h: {"lower_length": leg.lower_length + h}
    else:
        x, y, z = leg.platform_point
        found["leg 1: platform_point y"] = lambda h: {"platform_point": (x, y + h, z)}
    return found


@pytest.mark.parametrize("name", ["quadrupteron-oblique", "delta-4"])
def test_sensitivities_against_machines_with_moved_parts(name):
    robot, step = CATALOG[name], 1e-4
    pose = states(robot, 1)[0][0]
    found = geometric_sensitivities(robot, pose)
    joints, rows = pteron.inverse_kinematics(robot, pose), pteron.jacobian(robot, pose)

    def settled(change):
        """Return where a machine is with the same joints, by Newton's method."""
        machine = replace(robot, legs=(replace(robot.legs[0], **change), *robot.legs[1:]))
        at = pose
        for _ in range(4):
            missed = pteron.inverse_kinematics(machine, at) - joints
            at = at - np.linalg.solve(rows, missed)
        return at

    for dimension, change in moved_parts(robot.legs[0], found.names).items():
        exact = (settled(change(step)) - settled(change(-step))) / (2 * step)
        one = found.matrix[:, found.names.index(dimension)]
        np.testing.assert_allclose(one, exact, rtol=0, atol=1e-4, err_msg=dimension)


@pytest.mark.parametrize("name", ["quadrupteron-oblique", "wrist", "ankle"])
def test_sensitivities_against_machines_with_another_centre_and_axes(name):
    """Of a platform that turns: its axis, or the centre and the axes about which it does."""
    robot, step = pteron.load(name), 1e-4
    pose = pteron.random_poses(robot, 1, seed=3)[0]
    found = geometric_sensitivities(robot, pose)
    own = [n for n in found.names if n.startswith("platform: ")]
    platform = robot.platform
    assert len(own) == 3 * (platform.center is not None) + 2 * len(turning_axes(platform))
    joints, rows = pteron.inverse_kinematics(robot, pose), pteron.jacobian(robot, pose)

    def settled(**change):
        """Return where a machine is with the same joints, by Newton's method."""
        machine = replace(robot, platform=replace(platform, **change))
        at = pose
        for _ in range(5):
            missed = pteron.inverse_kinematics(machine, at) - joints
            at = at - np.linalg.solve(rows, missed)
        return at

    for dimension in own:
        key, axis = dimension.removeprefix("platform: ").replace(" about", "").split()
        unit = np.array(platform.frame)["xyz".index(axis)]

        def changed(h, key=key, axis=axis, unit=unit):
            if key == "center":
                return {key: tuple(np.array(platform.center) + h * np.eye(3)["xyz".index(axis)])}
            turn = Rotation.from_rotvec(h * unit).as_matrix()
            keys = [key, *(["x_axis"] if platform.second_axis is None else [])]
            return {k: tuple(turn @ getattr(platform, k)) for k in keys}

        exact = (settled(**changed(step)) - settled(**changed(-step))) / (2 * step)
        column = found.matrix[:, found.names.index(dimension)]
        size = max(1.0, np.abs(exact).max())
        np.testing.assert_allclose(column, exact, rtol=0, atol=1e-4 * size, err_msg=dimension)


def turning_axes(platform):
    """Return the axes of a platform that its file names."""
    return (
        [platform.axis, platform.second_axis]
        if platform.second_axis
        else ([] if platform.center else [platform.axis])
    )


def test_errors_add_up():
    robot = CATALOG["quadrupteron"]
    robot = replace(robot, platform=replace(robot.platform, tool=(0.03, 0.0, -0.05)))
    pose = states(robot, 2)[0]
    plain = pose_error(robot, pose, Tolerances(joints=2e-5, backlash=(1e-5, 0.0, 0.0, 4e-5)))
    sizes = np.array([2.5e-5, 2e-5, 2e-5, 4e-5])
    lever = np.tile(np.eye(4), (2, 1, 1))
    lever[:, 0, 3], lever[:, 1, 3] = -0.03 * np.sin(pose[:, 3]), 0.03 * np.cos(pose[:, 3])
    parts = lever @ np.linalg.inv(pteron.jacobian(robot, pose)) * sizes
    np.testing.assert_allclose(plain.worst, np.abs(parts).sum(-1), rtol=1e-10)
    np.testing.assert_allclose(plain.deviation, np.linalg.norm(parts, axis=-1), rtol=1e-10)
    name = "leg 2: lower_length"
    more = pose_error(robot, pose, Tolerances(length=1e-5, point=1e-5, named={name: 0.0}))
    assert not more.parts[..., more.names.index(name)].any()
    assert (more.position > 0.0).all()
    with pytest.raises(DataError, match="named: quadrupteron has no dimension 'leg 9: x'"):
        pose_error(robot, pose, Tolerances(named={"leg 9: x": 1.0}))
    with pytest.raises(DataError, match="joints: -1 given"):
        pose_error(robot, pose, Tolerances(joints=-1.0))
