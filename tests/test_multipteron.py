"""The rest of the multipteron family and its kin: five freedoms, spherical legs, axes that do not
meet; on machines drawn at random, against Lagrange's equations, engines and dense searches."""

import json
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
import tilting
import trees
from commands import done
from lagrange import Lagrange
from mechanisms import CLIENTS, NIGHTLY, relative_error, scaled, several
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import pteron
from pteron.environments import PteronEnv
from pteron.equations.machine import numbers
from pteron.equations.variations import (
    slope_matrix,
    slope_terms,
    variations,
    varied_numbers,
    vary_geometry,
)
from pteron.errors import DataError, ModelError, SingularPose
from pteron.identification.excitation import Limits, margins, random_excitation
from pteron.indices import geometric_sensitivities
from pteron.kernels import numeric
from pteron.kinematics import constraint_measure, working_mode
from pteron.kinematics.singularities import best_holding
from pteron.legs import UPU
from pteron.legs.conformance import faults
from pteron.manipulator.variants import elbows_of, with_elbows
from pteron.motion import check_path, line_path, point_to_point
from pteron.motion.simulation.stops import first_singular, singularity_text
from pteron.motion.trajectories.scaling import keeps_margin
from pteron.platforms import Platform
from pteron.workspace import conditions, home_pose, paving, pose_margins
from pteron.workspace.examination import examine
from pteron.workspace.margins import least_margin_text
from pteron.workspace.modes import mode_contacts

COUNT, MOST = 20, 200
"""States of each machine, in the gate and in all."""

DRAWN = {
    "PRUR": ("3T2R", ("PRUR",)),
    "RPUR": ("3T2R", ("RPUR",)),
    "five freedoms, mixed": ("3T2R", ("PRUR", "UPS", "RPUR", "RSS", "PSS")),
    "PRRS": ("3T3R", ("PRRS",)),
    "six freedoms, mixed": ("3T3R", ("PRRS", "UPS", "RSS")),
    "SRRR": ("3R", ("SRRR",)),
    "a wrist, mixed": ("3R", ("SRRR", "UPS", "PSS")),
}


def upu(seed):
    """Return a machine with three U-P-U legs, and its home."""
    rng = np.random.default_rng(seed)
    base, height = tilting.rotation(rng), np.array([0.0, 0.0, 1.0])
    legs = []
    for k in range(3):
        angle = 2 * np.pi * k / 3 + 0.3 * rng.normal()
        way = np.array([np.cos(angle), np.sin(angle), 0.2 * rng.normal()])
        around = tilting.unit(np.cross([0.0, 0.0, 1.0], way) + 0.3 * rng.normal(size=3))
        s0 = 0.3 * way + 0.1 * rng.normal(size=3)
        length = float(np.linalg.norm(height + s0 - way))
        bodies = tilting.rod(rng, 0.4 * length), tilting.rod(rng, 0.4 * length, -1.0)
        point, direction = tuple(s0.tolist()), tuple((base @ around).tolist())
        limits = 0.5 * length, 1.6 * length
        legs.append(UPU(tuple(base @ way), point, *bodies, limits, direction=direction))
    axes = tuple(base[:, 2]), tuple(base[:, 0])
    platform = Platform("3T", tilting.planar(rng, 0.3), *axes)
    gravity = tuple(9.81 * np.array(tilting.unit(rng.normal(size=3))))
    return pteron.Manipulator("3-upu", platform, tuple(legs), gravity), base @ height


def offset(seed):
    """Return a machine of two legs under a platform whose axes do not meet, and its home."""
    kinds = [("RSS",), ("UPS",), ("PSS", "RSS")][seed % 3]
    robot, home = tilting.machine("2R", kinds, seed)
    away = 0.15 * np.random.default_rng(seed).normal(size=3)
    center = tuple((np.array(robot.platform.center) - away).tolist())
    platform = replace(robot.platform, center=center, axis_offset=tuple(away.tolist()))
    return replace(robot, platform=platform), home


def drawn(name, seed):
    """Return a machine drawn at random, and a pose about which it moves."""
    if name == "UPU":
        return upu(seed)
    return offset(seed) if name == "axis_offset" else tilting.machine(*DRAWN[name], seed)


NAMES = [*DRAWN, "UPU", "axis_offset"]
ALL = [(name, seed) for name in NAMES for seed in range(10)]
EVERY = pytest.mark.parametrize(
    ("name", "seed"), several(ALL, [(name, k % 3) for k, name in enumerate(NAMES)])
)


@EVERY
def test_a_machine_moves_as_lagrange_and_mujoco_say(name, seed):
    robot, home = drawn(name, seed)
    for leg in robot.legs:
        assert faults(leg, tilts=robot.platform.tilts, seed=seed) == ()
    states = tilting.states(robot, home, COUNT if seed < 3 else MOST, seed)
    forces = pteron.inverse_dynamics(robot, *states)
    assert relative_error(Lagrange(robot).forces(*states), forces) < 1e-9
    engine = trees.MuJoCo(robot, states[0][0], spin=False)
    projected, jacobian, gap = trees.projected(robot, engine, *states)
    assert gap < 1e-13
    assert relative_error(jacobian, pteron.jacobian(robot, states[0])) < 1e-10
    assert relative_error(projected, forces) < 1e-8
    regressed = pteron.regressor(robot, *states) @ pteron.parameters(robot)
    np.testing.assert_allclose(regressed, forces, atol=1e-9 * np.abs(forces).max())


@EVERY
def test_forward_inverts_inverse_and_a_file_holds_the_machine(name, seed, tmp_path):
    robot, home = drawn(name, seed)
    poses = tilting.states(robot, home, COUNT, seed)[0]
    poses = poses[np.abs(numeric(robot, "type_ii")(poses)[0]) > 0.02]
    joints = pteron.inverse_kinematics(robot, poses)
    if robot.platform.tilts:
        back = numeric(robot, "direct_step")(joints, poses + 0.003)[0]
    else:
        modes = pteron.direct_kinematics(robot, joints)
        nearest = np.nanargmin(np.abs(modes - poses[:, None]).max(axis=-1), axis=1)
        back = modes[np.arange(len(poses)), nearest]
    np.testing.assert_allclose(back, poses, atol=1e-10)
    assert pteron.load(pteron.save(robot, tmp_path / "machine.toml")) == robot


@pytest.mark.parametrize("name", ["PRUR", "RPUR", "SRRR", "UPU", "axis_offset"])
def test_a_machine_turned_as_a_whole_needs_the_same_forces(name):
    robot, home = drawn(name, 1)
    states = tilting.states(robot, home, 5)
    turn = tilting.rotation(np.random.default_rng(8))
    moved = [np.array(v) for v in states]
    if (lengths := len(robot.platform.lengths)) and name != "UPU":  # whose frame turns with it
        for v in moved:
            v[:, :lengths] = v[:, :lengths] @ turn.T
    for v in moved if name == "UPU" else ():
        v[:] = v @ turn.T
    np.testing.assert_allclose(
        pteron.inverse_dynamics(pteron.turned(robot, turn), *moved),
        pteron.inverse_dynamics(robot, *states),
        atol=1e-9,
    )


BASE = {
    "pentapteron": (85, 57, 55),
    "5-rpur": (100, 66, 56),
    "hexapteron": (64, 46, 42),
    "3-upu": (22, 10, 10),
    "agile-eye": (52, 33, 31),
    "spherical-3-rrr": (52, 33, 33),
    "ankle-offset": (24, 18, 18),
}
"""Parameters, and base parameters with gravity at random and along -z."""

ASKEW = (3.1, -5.2, 7.7)


@pytest.mark.parametrize(
    ("name", "method"),
    several(
        [(name, method) for name in BASE for method in ("exact", "svd", "qr")],
        [("hexapteron", "exact"), ("agile-eye", "exact"), ("ankle-offset", "svd"), ("3-upu", "qr")],
    ),
)
def test_base_parameters_are_as_many_as_derived(name, method):
    robot = pteron.load(name)
    count, general, upright = BASE[name]
    assert len(pteron.parameters(robot)) == count
    assert pteron.base_parameters(robot, method).rank == upright
    askew = replace(robot, gravity=ASKEW)
    assert pteron.base_parameters(askew, method).rank == general
    turned = pteron.turned(askew, tilting.rotation(np.random.default_rng(2)))
    assert pteron.base_parameters(turned, "svd").rank == general


def dense(robot, joints, count, seed):
    """Return the poses (K, m) of joints (n,) that a search from random poses finds."""
    rng = np.random.default_rng(seed)
    lengths = len(robot.platform.lengths)
    found = []
    for _ in range(count):
        start = np.concatenate(
            [rng.normal(size=lengths), rng.uniform(-3, 3, robot.freedom - lengths)]
        )
        best = least_squares(lambda x: closures(robot, x, joints), start, xtol=1e-15, ftol=1e-15)
        if np.abs(best.fun).max() < 1e-10:
            found.append(best.x)
    return np.array(found)


def closures(robot, pose, joints):
    """Return how far platform points are from the planes of held sliders or cranks."""
    p, axes = robot.platform.placement(pose)
    missed = []
    for leg, q in zip(robot.legs, joints, strict=True):
        c = p + np.array(leg.platform_point) @ axes
        if leg.type == "PRRS":
            d = np.array(leg.direction)
            missed.append(d @ (c - leg.guide_point - q * np.array(leg.e)))
            continue
        u, a = np.array(leg.direction), np.array(leg.zero_direction)
        lean = np.cos(q) * a + np.sin(q) * np.cross(u, a)
        w = np.cos(leg.crank_arc) * u + np.sin(leg.crank_arc) * lean
        v = (c - p) / np.linalg.norm(c - p)
        missed.append(w @ v - np.cos(leg.link_arc))
    return missed


@pytest.mark.parametrize(
    ("name", "seed"),
    several(
        [(name, seed) for name in ("PRRS", "SRRR") for seed in range(50)],
        [("PRRS", 2), ("SRRR", 1)],
    ),
)
def test_every_pose_is_found_and_none_is_false(name, seed):
    robot, home = drawn(name, seed)
    pose = tilting.states(robot, home, 1, seed)[0][0]
    joints = pteron.inverse_kinematics(robot, pose)
    listed = pteron.direct_kinematics(robot, joints, all_branches=True)
    listed = listed[np.isfinite(listed).all(axis=-1)]
    assert 0 < len(listed) <= 8
    assert np.abs(listed - pose).max(axis=-1).min() < 1e-9
    for other in listed:
        assert np.abs(closures(robot, other, joints)).max() < 1e-9
    places = [robot.platform.placement(other) for other in listed]
    for found in dense(robot, joints, 60, seed):
        if not np.isfinite(pteron.inverse_kinematics(robot, found, on_failure="nan")).all():
            continue  # out of a leg's reach
        p, axes = robot.platform.placement(found)
        away = [np.abs(p - q).max() + np.abs(axes - other).max() for q, other in places]
        assert min(away) < 1e-6


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=NIGHTLY) for k in range(1, 50))])
def test_every_pose_of_axes_that_do_not_meet(seed):
    robot, home = offset(seed)
    pose = tilting.states(robot, home, 1, seed)[0][0]
    joints = pteron.inverse_kinematics(robot, pose)
    listed = pteron.direct_kinematics(robot, joints, all_branches=True)
    assert np.nanmin(np.abs(listed - pose).max(axis=-1)) < 1e-9
    angles = np.linspace(-np.pi, np.pi, 13)[1:]
    for start in np.stack(np.meshgrid(angles, angles), axis=-1).reshape(-1, 2):
        found, _, bent, *_ = numeric(robot, "direct_step")(joints[None], start[None])
        if np.isfinite(found).all() and not bent[0]:
            away = np.abs(np.angle(np.exp(1j * (listed - found[0])))).max(axis=-1)
            assert np.nanmin(away) < 1e-7


def test_legs_and_platforms_that_do_not_fit_are_refused_in_a_line():
    penta, eye = pteron.load("pentapteron"), pteron.load("agile-eye")
    tsai, platform = pteron.load("3-upu"), penta.platform
    first = penta.legs[0]
    hexapod = pteron.load("stewart").legs
    for change, words in (
        (
            lambda: replace(
                penta, legs=(replace(first, slider_direction=(0.6, 0.0, 0.8)), *penta.legs[1:])
            ),
            "leg 1: slider_direction: [0.6, 0.0, 0.8] is 36.87 degrees from the platform's axis",
        ),
        (lambda: replace(platform, second_axis=(0.8, 0.0, 0.6)), "is not perpendicular to axis"),
        (lambda: replace(platform, x_axis=(1.0, 0.0, 0.0)), "x_axis: a 3T2R platform's frame"),
        (lambda: replace(penta, legs=penta.legs[:4]), "4 given, but a 3T2R platform has 5"),
        (lambda: replace(penta, legs=hexapod[:5]), "legs: none keeps a 3T2R platform from turning"),
        (lambda: replace(eye, legs=(first, *eye.legs[1:])), 'make the platform\'s motion "3T2R"'),
        (lambda: replace(penta, legs=(*penta.legs[:4], eye.legs[0])), 'make its motion "3R"'),
        (
            lambda: replace(eye.legs[0], crank_arc=4.0),
            "crank_arc: 4 rad given, one between 0 and pi",
        ),
        (
            lambda: replace(
                eye, legs=(replace(eye.legs[0], crank_arc=0.4, link_arc=0.3), *eye.legs[1:])
            ),
            "leg 1: crank_arc, link_arc: 0.4 and 0.3 rad do not close at angles zero",
        ),
        (
            lambda: replace(
                tsai, legs=tuple(replace(leg, direction=(0.0, 0.0, 1.0)) for leg in tsai.legs)
            ),
            "legs: the platform is free to turn about [0.0, 0.0, 1.0]",
        ),
        (
            lambda: replace(eye.platform, axis_offset=(0.0, 0.0, 0.1)),
            "axis_offset: a 3R platform has none",
        ),
    ):
        with pytest.raises(ModelError) as refused:
            change()
        assert words in str(refused.value)
        assert "\n" not in str(refused.value)


def test_a_guide_within_the_tolerance_of_a_file_is_made_exact():
    penta = pteron.load("pentapteron")
    rough = replace(penta.legs[0], slider_direction=(1.0, 0.0, 5e-7))
    (leg, *_) = replace(penta, legs=(rough, *penta.legs[1:])).legs
    assert leg.slider_direction == (1.0, 0.0, 0.0)


def radial_upu():
    """Return the 3-UPU with radial outer axes: its platform is free to turn on the middle line."""
    tsai = pteron.load("3-upu")
    legs = [replace(leg, direction=tilting.unit(leg.guide_point)) for leg in tsai.legs]
    return replace(tsai, name="radial", legs=tuple(legs))


def test_radial_universal_joints_leave_the_platform_free_to_turn():
    tsai, radial = pteron.load("3-upu"), radial_upu()
    assert abs(constraint_measure(radial, [0.0, 0.0, 0.4])) < 1e-12
    assert abs(constraint_measure(tsai, [0.0, 0.0, 0.4])) > 0.4
    assert "near a constraint singularity" in map(str, conditions(tsai, type_ii=0.1))
    warnings = examine(radial, np.array([0.0, 0.0, 0.4])).warnings
    assert any("constraint singularity" in warning for warning in warnings)


def test_all_that_keeps_away_from_type_ii_keeps_away_from_a_constraint_singularity():
    robot, middle = radial_upu(), np.array([0.0, 0.0, 0.4])
    best = float(best_holding(robot)[1])
    grid = np.stack(np.meshgrid(*np.linspace([-0.3, -0.3, 0.2], [0.3, 0.3, 0.6], 25).T), -1)
    shares = np.abs(constraint_measure(robot, grid.reshape(-1, 3))) / best
    assert 0.7 < shares.max() <= 1.0
    margins = pose_margins(robot, grid.reshape(-1, 3))
    np.testing.assert_allclose(margins.constraint, shares, rtol=1e-9)
    assert (margins.least <= shares + 1e-12).all()
    assert (pose_margins("stewart", pteron.workspace.home_pose("stewart")).constraint == 1.0).all()
    assert least_margin_text(robot, middle)[1].startswith("a constraint singularity")
    home = pteron.workspace.home_pose(robot)
    assert pose_margins(robot, home).constraint > 0.3
    drawn = pteron.random_poses(robot, 50, type_ii=0.1)
    assert np.abs(constraint_measure(robot, drawn)).min() >= 0.1
    path = np.linspace([0.1, 0.0, 0.4], [-0.1, 0.0, 0.4], 101)
    with pytest.raises(SingularPose, match="comes to a constraint singularity") as refused:
        point_to_point(robot, path[0], path[-1], duration=1.0)
    assert refused.value.kind == "constraint"
    assert first_singular(robot, path) == 50
    assert "let the platform turn" in singularity_text(robot, path[50])
    assert first_singular(pteron.load("3-upu"), path) is None
    assert not keeps_margin(robot, path, 0.01)
    assert keeps_margin(robot, path[:15], 0.01)
    limits = Limits(type_ii=0.25)
    states = random_excitation(robot, harmonics=2, limits=limits).states(np.linspace(0, 5, 400))
    assert np.abs(constraint_measure(robot, states.pose)).min() >= 0.25 * best
    env = PteronEnv(robot)
    with pytest.raises(DataError, match="singular"):
        env.reset(options={"pose": [1e-4, 0.0, 0.4]})
    assert "constraint" in env.world.end_reason(middle, np.zeros(3))


@pytest.mark.parametrize("name", ["pentapteron", "5-rpur"])
def test_poses_of_five_freedoms_are_searched(name):
    robot = pteron.load(name)
    poses = np.random.default_rng(3).uniform(-1, 1, (30, 5)) * [0.03, 0.03, 0.03, 0.2, 0.2]
    joints = pteron.inverse_kinematics(robot, poses)
    listed = pteron.direct_kinematics(robot, joints)
    away = np.abs(listed - poses[:, None]).max(axis=-1)
    np.testing.assert_allclose(np.nanmin(away, axis=1), 0.0, atol=1e-9)
    for one, q in zip(listed, joints, strict=True):
        real = one[np.isfinite(one).all(axis=-1)]
        np.testing.assert_allclose(pteron.inverse_kinematics(robot, real) - q, 0.0, atol=1e-9)


@np.errstate(invalid="ignore")
def closed(leg, c, a, b):
    """Return the joint coordinate of each branch of a P-R-U-R or R-P-U-R leg, by its signs."""
    w, n = c - leg.guide_point, np.cross(a, b)
    coordinates = {}
    for sigma, kappa in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        if leg.type == "PRUR" and leg.slides_along_axis:
            upper = (b @ w) * b + sigma * np.sqrt(leg.upper_length**2 - (b @ w) ** 2) * n
            m = n @ (w - upper)
            lower = m * n + kappa * np.sqrt(leg.lower_length**2 - m**2) * a
            coordinates[sigma, kappa] = (w - lower) @ leg.slider_direction
            continue
        h = a @ w
        v = w - h * a - kappa * np.sqrt(leg.lower_length**2 - h**2) * n
        if leg.type == "RPUR":
            coordinates[(kappa,)] = np.linalg.norm(v)
            continue
        ahead = v @ leg.slider_direction
        across = leg.upper_length**2 - v @ v + ahead**2
        coordinates[sigma, kappa] = ahead - sigma * np.sqrt(across)
    return coordinates


@pytest.mark.parametrize("name", ["pentapteron", "5-rpur"])
def test_every_sign_of_five_freedoms_is_a_working_mode(name):
    robot = pteron.load(name)
    modes = {elbows_of(mode): mode for mode in pteron.working_modes(robot)}
    assert len(modes) == {"pentapteron": 4**5, "5-rpur": 2**5}[name]
    assert next(iter(modes)) == (1,) * len(elbows_of(robot))
    rng = np.random.default_rng(4)
    pose = rng.uniform(-1, 1, 5) * [0.03, 0.03, 0.03, 0.2, 0.2]
    a, b = np.array(robot.platform.axis), np.array(robot.platform.second_axis)
    first, second = Rotation.from_rotvec(pose[3] * a), Rotation.from_rotvec(pose[4] * b)
    points = [pose[:3] + (first * second).apply(leg.platform_point) for leg in robot.legs]
    legs = [closed(leg, c, a, first.apply(b)) for leg, c in zip(robot.legs, points, strict=True)]
    for k in rng.choice(len(modes), 24, replace=False):
        signs, mode = list(modes.items())[k]
        count = len(signs) // 5
        own = [leg[signs[count * i : count * i + count]] for i, leg in enumerate(legs)]
        joints = numeric(mode, "joint_coordinates")(pose)[0]  # NaN out of reach
        np.testing.assert_allclose(joints, own, rtol=0, atol=1e-13)
        told = working_mode(robot, pose, np.nan_to_num(joints)).reshape(5, count)
        reached = np.isfinite(joints)
        assert reached.any()
        np.testing.assert_array_equal(told[reached], np.reshape(signs, (5, count))[reached])
        assert not told[~reached].any()


@pytest.mark.parametrize("name", ["5-rpur", pytest.param("pentapteron", marks=NIGHTLY)])
def test_poses_of_all_branches_of_five_freedoms(name):
    robot = pteron.load(name)
    poses = np.random.default_rng(5).uniform(-1, 1, (3, 5)) * [0.03, 0.03, 0.03, 0.2, 0.2]
    other = with_elbows(robot, [*elbows_of(robot)[:-1], -elbows_of(robot)[-1]])
    joints = pteron.inverse_kinematics(other, poses)
    every = pteron.direct_kinematics(robot, joints, all_branches=True)
    away = np.abs(every - poses[:, None]).max(axis=-1)
    np.testing.assert_allclose(np.nanmin(away, axis=1), 0.0, atol=1e-9)
    signs = working_mode(robot, every, joints[:, None])
    nearest = signs[np.arange(3), np.nanargmin(away, axis=1)]
    np.testing.assert_array_equal(nearest, [elbows_of(other)] * 3)
    np.testing.assert_array_equal(signs.all(axis=-1), np.isfinite(every[..., 0]))
    own = pteron.direct_kinematics(robot, joints, on_failure="nan")
    assert np.isfinite(own[..., 0]).sum() < np.isfinite(every[..., 0]).sum()


def test_modes_of_a_pentapteron_meet_where_one_link_is_stretched():
    robot = pteron.load("pentapteron")
    robot = replace(robot, legs=tuple(replace(leg, limits=(-0.6, 0.6)) for leg in robot.legs))
    signs = elbows_of(robot)
    modes = [robot, with_elbows(robot, [-signs[0], *signs[1:]])]
    pavings = {elbows_of(mode): paving(mode, np.zeros(5), tolerance=0.5) for mode in modes}
    (contact,) = mode_contacts(pavings)
    assert (contact.leg, contact.cause, contact.proved) == (1, "upper link", True)
    first, second = (pteron.inverse_kinematics(mode, contact.pose) for mode in modes)
    np.testing.assert_allclose(first, second, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", ["pentapteron", "5-rpur", "hexapteron", "agile-eye"])
def test_follow_keeps_to_random_motions(name):
    robot = pteron.load(name)
    rng = np.random.default_rng(0)
    size = np.where(robot.platform.angular, 0.15, 0.03)
    time = np.linspace(0.0, 1.0, 200)[:, None, None]
    waves = rng.normal(size=(2, 3, robot.freedom)) * size / np.arange(1, 4)[:, None] / 2
    turns = 2.0 * np.pi * np.arange(1, 4)[:, None] * time
    poses = (waves[0] * np.sin(turns) + waves[1] * (np.cos(turns) - 1.0)).sum(axis=1)
    joints = pteron.inverse_kinematics(robot, poses)
    followed = pteron.kinematics.follow(robot, joints, poses[0])
    np.testing.assert_allclose(followed, poses, atol=1e-9)


def test_counts_are_those_of_a_machine_of_another_size():
    robot = replace(pteron.load("pentapteron"), gravity=ASKEW)
    assert pteron.base_parameters(scaled(robot, 0.37), "svd").rank == 57


def test_margins_paths_and_simulations_count_the_constraint_singularity():
    robot, tsai = radial_upu(), pteron.load("3-upu")
    home = home_pose(robot)
    measure = abs(float(pteron.kinematics.constraint_measure(robot, home)))
    assert pose_margins(robot, home).least <= measure / best_holding(robot)[1]
    assert measure > 0.2
    np.testing.assert_allclose(home_pose(tsai), [0.0, 0.0, 0.395], atol=1e-12)
    named = replace(robot, home=(0.0, 0.0, 0.395))
    with pytest.raises(ModelError, match=r"home.pose: .* \(type-II or constraint singularity\)"):
        home_pose(named)
    across = line_path(robot, [[-0.1, 0.0, 0.4], [0.1, 0.0, 0.4]])
    with pytest.raises(pteron.SingularPose, match="comes to a constraint singularity, where"):
        check_path(robot, across)
    check_path(tsai, across)
    poses = np.linspace([-0.1, 0.0, 0.4], [0.1, 0.0, 0.4], 51)
    assert first_singular(tsai, poses) is None
    k = first_singular(robot, poses)
    assert "constraint singularity" in singularity_text(robot, poses[k])
    motion = random_excitation(tsai, harmonics=2, seed=1)
    at_poses = motion.states(np.linspace(0.0, motion.duration, 500)).pose
    measure = np.abs(pteron.kinematics.constraint_measure(tsai, at_poses)).min()
    share = measure / best_holding(tsai)[1]
    assert margins(motion, Limits())["type_ii"].least <= share - Limits().type_ii


def along_the_axis(seed):
    """Return a Pentapteron all of whose sliders move along the platform's first axis."""
    rng = np.random.default_rng(seed)
    penta, legs = pteron.load("pentapteron"), []
    for k in range(5):
        s0 = rng.uniform(-0.1, 0.1, 3)
        azimuth = 2.0 * np.pi * k / 5 + rng.uniform(-0.2, 0.2)
        w = -np.array([0.15 * np.cos(azimuth), 0.2 * np.sin(azimuth)])
        upper = np.sign(w[1]) * np.sqrt(0.25**2 - w[0] ** 2)
        drop = np.sqrt(0.25**2 - (w[1] - upper) ** 2)
        point = (*(s0[:2] - w), float(s0[2] + drop))
        signs = {"elbow": int(np.sign(w[1])), "second_elbow": -1}
        way = {"guide_point": point, "slider_direction": (0.0, 0.0, 1.0)}
        legs.append(replace(penta.legs[0], platform_point=tuple(s0), **way, **signs))
    return replace(penta, name="along", legs=tuple(legs), home=None)


def test_sliders_all_along_the_axis_hold_five_freedoms():
    # In 50 digits such machines have rank 5 at random poses, also where all platform points are in
    # one plane or on one circle; not where they are on one line along the second axis.
    for seed in range(3):
        robot = along_the_axis(seed)
        home = home_pose(robot)
        assert np.linalg.svd(pteron.jacobian(robot, home))[1][-1] > 1e-3
        examined = examine(robot, home)
        assert examined.modes
        assert examined.holding.least_singular_value > 0.02
    points = ((0.02 * k - 0.05, 0.0, 0.0) for k in range(5))
    straight = [replace(leg, platform_point=s0) for leg, s0 in zip(robot.legs, points, strict=True)]
    with pytest.raises(pteron.SingularPose, match=r"\(0, 0, 0, 0, 1\)"):
        home_pose(replace(robot, legs=tuple(straight)))


def test_arcs_vary_as_their_slopes_say():
    robot = pteron.load("spherical-3-rrr")
    changes = variations(robot)
    arcs = [k for k, change in enumerate(changes) if change.is_arc]
    assert [changes[k].name for k in arcs[:2]] == ["legs[1].crank_arc", "legs[1].link_arc"]
    assert changes[arcs[0]].value(robot) == 1.25
    slopes = slope_matrix(robot, changes, slope_terms(robot, changes), np.array(numbers(robot)))
    steps = 1e-6 * np.eye(len(changes))
    ahead, back = (varied_numbers(robot, changes, sign * steps) for sign in (1.0, -1.0))
    np.testing.assert_allclose(slopes, (ahead - back).T / 2e-6, atol=1e-9)
    varied = vary_geometry(robot, [changes[arcs[1]]], np.array([0.01]))
    assert varied.legs[0].link_arc == pytest.approx(1.41, abs=1e-15)
    np.testing.assert_allclose(
        numbers(varied), varied_numbers(robot, changes, 0.01 * np.eye(len(changes)))[arcs[1]]
    )


def test_an_error_of_an_arc_turns_the_platform():
    robot, pose = pteron.load("agile-eye"), np.array([0.1, 0.2, 0.1])
    found = geometric_sensitivities(robot, pose)
    slope = found.matrix[..., found.names.index("leg 2: link_arc")]
    legs = list(robot.legs)
    legs[1] = replace(legs[1], link_arc=legs[1].link_arc + 1e-6)
    joints = pteron.inverse_kinematics(robot, pose)
    moved = pteron.kinematics.follow(replace(robot, legs=tuple(legs)), joints[None], pose)[0]
    np.testing.assert_allclose((moved - pose) / 1e-6, slope, atol=1e-5)


@CLIENTS
def test_wrong_arcs_are_calibrated(tmp_path):
    robot, rng = pteron.load("spherical-3-rrr"), np.random.default_rng(2)
    arcs = np.array([[leg.crank_arc, leg.link_arc] for leg in robot.legs])
    arcs = arcs + rng.normal(0.0, 3e-3, (3, 2))
    legs = (
        replace(leg, crank_arc=float(a), link_arc=float(b))
        for leg, (a, b) in zip(robot.legs, arcs, strict=True)
    )
    true = replace(robot, legs=tuple(legs))
    poses = rng.uniform(-0.3, 0.3, (40, 3))
    columns = *robot.joint_names, *robot.coordinates
    rows = np.hstack([pteron.inverse_kinematics(true, poses), poses + rng.normal(0, 3e-5, (40, 3))])
    log = tmp_path / "log.csv"
    pl.DataFrame(rows, schema=columns).write_csv(log)
    done(f"calibrate {log} --robot spherical-3-rrr --out {tmp_path / 'out'}")
    record = json.loads((tmp_path / "out" / "calibration.json").read_text(encoding="utf-8"))
    assert record["verdict"]["grade"] == "trustworthy"
    found = pteron.load(tmp_path / "out" / "robot.toml")
    away = np.array([[leg.crank_arc, leg.link_arc] for leg in found.legs]) - arcs
    assert np.abs(away).max() < 1.5e-3
