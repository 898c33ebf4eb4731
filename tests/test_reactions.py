"""Reactions: statics that was published, virtual work, momentum, least norm."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import tilting
from differences import OFFSETS
from mechanisms import CATALOG, gated, in_turn, random_machine, scaled, states

import pteron
from pteron.errors import DataError, ModelError, UnreachablePose
from pteron.export import export_mjcf, export_pinocchio, export_sdf, export_urdf
from pteron.export.engines.formatting import look, number, row, small
from pteron.indices import Elasticity, Section, reactions, stiffness

ROUTER = Path(__file__).parent / "data" / "router_reactions.csv"


def test_the_published_router():
    """All of its numbers, also those that the least norm chooses."""
    table = pl.read_csv(ROUTER, comment_prefix="#")
    poses = table.select("x", "y", "z").to_numpy()[::12] * 1e-3
    found = reactions("tripteron-router", poses, wrench=[80.0, 80.0, -120.0])
    printed = table.drop("x", "y", "z", "leg", "joint").to_numpy().astype(float)
    printed = printed.reshape(4, 3, 4, 5)
    np.testing.assert_allclose(found.forces, printed[..., :3], rtol=0, atol=6e-6)
    for leg, across in enumerate(([1, 2], [0, 2], [0, 1])):
        moments = found.moments[:, leg] * 1e3
        np.testing.assert_allclose(moments[..., across], printed[:, leg, :, 3:], rtol=0, atol=6e-4)
        np.testing.assert_allclose(moments[..., leg], 0.0, atol=1e-6)
    # Its self-stresses are moments alone, so that their unit does not matter: N mm, say.
    other = reactions("tripteron-router", poses, wrench=[80.0, 80.0, -120.0], length=1e-3)
    np.testing.assert_allclose(other.forces, found.forces, rtol=0, atol=1e-8)
    np.testing.assert_allclose(other.moments, found.moments, rtol=0, atol=1e-8)
    assert found.redundancy == 3
    assert found.names[0] == ("P0", "R1", "R2", "R3")


RANDOM = ("PRSU", "SSSSI", "CCC")
SOME = ("3-rpr", "delta", "delta-4", "tripteron-oblique", "CCC", "SSSSI")
EVERY = in_turn([*CATALOG, *RANDOM], SOME, share=3)


@EVERY
def test_actuators_give_what_virtual_work_says(name):
    robot = random_machine(0, name) if name in RANDOM else CATALOG[name]
    motion = states(robot, 3)
    wrench = np.linspace(-30.0, 40.0, robot.freedom)
    found = reactions(robot, *motion, wrench)
    expected = pteron.inverse_dynamics(robot, *motion, wrench)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found.actuators, expected, rtol=0, atol=1e-11 * scale)
    if name not in RANDOM:
        assert (found.unheld < 1e-8 * scale).all()
        planar, stiff = robot.platform.planar, name.startswith(("quad", "trip"))
        expected = 3 * (robot.joint_count - 1) if planar else 3 * stiff
        # Four pairs of rods hold three rotations.
        assert found.redundancy == expected + (name == "delta-redundant")


def test_what_the_base_gives_changes_the_momentum():
    """The sum of what guides and cranks pass on is that of m (a - g), found by differences."""
    robot = random_machine(0, "PRSU")
    pose, velocity, acceleration = (part[0] for part in states(robot, 1))
    step = 2e-4
    t = (OFFSETS * step)[:, None]
    way = pose + t * velocity + 0.5 * t * t * acceleration
    moments = []
    for axis in np.eye(3):  # the sum of m r along each axis, as a potential energy
        weighed = replace(robot, gravity=tuple(-axis))
        found, here = (pteron.potential_energy(weighed, p) for p in (way, pose))
        second = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5])
        moments.append((second @ (found[:4] + found[:3:-1]) - 205 / 72 * here) / step**2)
    mass = sum(body.mass for leg in robot.legs for body in leg.bodies.values())
    mass += robot.platform.total_inertia.mass
    needed = np.array(moments) - mass * np.array(robot.gravity)
    wrench = np.array([3.0, -4.0, 5.0, 0.2])
    found = reactions(robot, pose, velocity, acceleration, wrench)
    total = found.forces[:, 0].sum(axis=0) + wrench[:3]
    np.testing.assert_allclose(total, needed, rtol=0, atol=1e-5 * np.abs(needed).max())


@pytest.mark.parametrize("motion", gated(tilting.LEGS, ("1T2R", "2R")))
def test_a_platform_that_tilts_gets_from_its_legs_what_newton_and_euler_ask(motion):
    """Its momentum by differences: with S(t) the integral of r(0) r(t)^T dm, that of r x r''."""
    robot, home = tilting.machine(motion, tilting.LEGS[motion], 3)
    pose, velocity, acceleration = (part[0] for part in tilting.states(robot, home, 1))
    wrench = 10.0 * np.random.default_rng(1).normal(size=6)
    found = reactions(robot, pose, velocity, acceleration, wrench)
    forces = pteron.inverse_dynamics(robot, pose, velocity, acceleration, wrench)
    np.testing.assert_allclose(found.actuators, forces, rtol=0, atol=1e-11 * np.abs(forces).max())
    # The legs of a platform with five freedoms hold the sixth together.
    holders = sum(leg.type in ("PRUR", "RPUR") for leg in robot.legs)
    assert found.redundancy == max(holders - 1, 0)
    assert found.unheld < (1e-8 if holders > 1 else 1e-9)  # by least squares where several do
    if robot.platform.center:  # the joint there gives the rest
        return
    step = 2e-4
    t = (OFFSETS * step)[:, None]
    way = pose + t * velocity + 0.5 * t * t * acceleration
    body = robot.platform.inertia
    spread = 0.5 * np.trace(body.tensor) * np.eye(3) - body.tensor
    place, axes = robot.platform.placement(np.vstack([way, pose]))
    arm = body.first_moment @ axes
    first, now, here = body.mass * place + arm, axes[-1].T, place[-1]
    integral = np.einsum("i,bj->bij", first[-1], place) + np.einsum("i,bj->bij", here, arm)
    integral = integral + now @ spread @ axes
    side = [-1 / 560, 8 / 315, -1 / 5, 8 / 5]
    weights = np.array([*side, *side[::-1], -205 / 72]) / step**2
    bent = [np.tensordot(weights, part, 1) for part in (first, integral)]
    needed = bent[0] - body.mass * np.array(robot.gravity)
    turning = bent[1] - bent[1].T
    about = np.array([turning[1, 2], turning[2, 0], turning[0, 1]])
    about -= np.cross(first[-1], robot.gravity)
    last = [np.flatnonzero(np.isfinite(leg[:, 0]))[-1] for leg in found.points]
    points, passed, moments = (
        np.array([leg[k] for leg, k in zip(part, last, strict=True)])
        for part in (found.points, found.forces, found.moments)
    )
    on_balls = [leg.type not in ("PRUR", "RPUR") for leg in robot.legs]
    np.testing.assert_allclose(moments[on_balls], 0.0, atol=1e-9)
    left = 1e-7 * np.abs(forces).max() if holders else 1e-5  # where forces are large
    np.testing.assert_allclose(passed.sum(0) + wrench[:3], needed, atol=left)
    whole = np.cross(points, passed).sum(0) + moments.sum(0) + np.cross(here, wrench[:3])
    np.testing.assert_allclose(whole + wrench[3:], about, atol=left)


def test_least_norm_and_what_is_no_load():
    pose = states(CATALOG["3-prr"], 3)[0]
    lengths = 0.05, 0.5
    found = [reactions("3-prr", pose, length=length) for length in lengths]

    def norm(one, length):
        return np.sqrt((one.forces**2).sum((1, 2, 3)) + (one.moments**2).sum((1, 2, 3)) / length**2)

    assert (norm(found[0], lengths[0]) < norm(found[1], lengths[0])).all()
    assert (norm(found[1], lengths[1]) < norm(found[0], lengths[1])).all()
    assert not found[0].is_unique
    # A moment that would tilt the platform goes into the joints, not into the actuators.
    tilted = reactions("3-prr", pose, moment=np.cross([0.0, 0.0, 1.0], [2.0, -3.0, 0.0]))
    np.testing.assert_allclose(tilted.actuators, found[0].actuators, rtol=0, atol=1e-9)
    assert np.abs(tilted.moments - found[0].moments).max() > 0.5


def test_bad_poses_and_bad_words():
    pose = np.array([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [0.01, 0.0, 0.0]])
    found = reactions("tripteron", pose, on_failure="nan")
    one = reactions("tripteron", pose[2])
    assert np.isnan(found.forces[1]).all()
    assert np.isnan(found.actuators[1]).all()
    np.testing.assert_array_equal(found.moments[2], one.moments)
    with pytest.raises(UnreachablePose, match=r"pose\[1\]"):
        reactions("tripteron", pose)
    with pytest.raises(DataError, match="length: 0 m given"):
        reactions("tripteron", pose[0], length=0.0)
    # What no leg holds is told: hinges on bars of single legs leave this platform free to tilt.
    free = random_machine(0, "PRSU")
    assert reactions(free, states(free, 1)[0][0]).unheld > 0.01


def scaled_pose(robot, pose, factor):
    lengths = len(robot.platform.lengths)
    return np.concatenate([factor * pose[..., :lengths], pose[..., lengths:]], axis=-1)


@EVERY
def test_reactions_do_not_depend_on_the_unit_of_length(name):
    robot = random_machine(0, name) if name in RANDOM else CATALOG[name]
    pose, tilt = states(robot, 1)[0][0], np.array([1.0, -2.0, 3.0])
    wrench = np.linspace(-30.0, 40.0, robot.freedom)
    here = reactions(robot, pose, wrench=wrench, moment=tilt)
    largest = np.nanmax(np.abs(here.forces))
    for factor in (1e-3, 1e5):
        at = scaled_pose(robot, pose, factor)
        whole = wrench * np.where(np.array(robot.coordinates) == "phi", factor, 1.0)
        there = reactions(scaled(robot, factor), at, wrench=whole, moment=factor * tilt)
        assert there.redundancy == here.redundancy
        np.testing.assert_allclose(there.forces, here.forces, rtol=0, atol=1e-9 * largest)
        moments = there.moments / factor
        np.testing.assert_allclose(moments, here.moments, rtol=0, atol=1e-9 * largest)
        np.testing.assert_allclose(there.unheld, here.unheld, rtol=0, atol=1e-9 * largest)


@pytest.mark.parametrize("name", ["delta", "quadrupteron"])
def test_stiffness_does_not_depend_on_the_unit_of_length(name):
    robot = CATALOG[name]
    pose = states(robot, 1)[0][0]
    found = []
    for factor in (1.0, 1e-3, 1e5):
        link = Section(1e6, *3 * (2e3 * factor**2,))
        elasticity = Elasticity(upper=link, lower=link, rod_distance=0.05 * factor)
        one = scaled(robot, factor)
        compliance = stiffness(one, scaled_pose(robot, pose, factor), elasticity).compliance
        turns = np.where(np.array(robot.coordinates) == "phi", factor, 1.0)
        found.append(compliance * turns * turns[:, None] / factor)
    assert np.abs(found[0]).max() > 0.0
    for one in found[1:]:
        np.testing.assert_allclose(one, found[0], rtol=0, atol=1e-8 * np.abs(found[0]).max())


def test_a_rod_along_its_own_guide_is_where_its_leg_is_best(tmp_path):
    """Joints of a single rod are counted about an axis across the guide: no NaN where J is regular.

    Universal joints about the guide are singular there, while the leg is at its best.
    """
    robot = pteron.load(Path(__file__).parent / "data" / "rod-along-guide.toml")
    pose, velocity = np.zeros(3), np.array([1.0, 2.0, 3.0])
    rod = pteron.kinematics.link_vectors(robot, pose)[1][2]
    np.testing.assert_allclose(np.cross(robot.legs[2].slider_direction, rod), 0.0, atol=1e-12)
    screws = pteron.kinematics.joint_screws(robot, pose)[2]
    rates = pteron.kinematics.joint_rates(robot, pose, velocity)
    joints = np.append(rates.actuated[2], rates.passive[2])
    there = ~np.isnan(joints)
    twist = pteron.kinematics.twist(robot, pose, velocity)
    np.testing.assert_allclose(
        joints[there] @ screws[there], [*twist[3:], *twist[:3]], rtol=0, atol=1e-12
    )
    assert there.sum() == 6, "P, a universal joint, a ball joint"
    found = reactions(robot, pose, velocity, np.ones(3))
    assert np.isfinite(found.actuators).all()
    for export in (export_urdf, export_sdf, export_pinocchio, export_mjcf):
        for path in export(robot, tmp_path):
            assert not re.search(r"\bnan\b", path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_an_export_never_writes_what_is_no_number(value):
    for form in (number, small, row, look):
        with pytest.raises(ModelError, match=r"is (nan|inf) in its home pose"):
            form(value)
