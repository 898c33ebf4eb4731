"""Platforms that tilt, on machines drawn at random: kinematics, dynamics and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
import tilting
from lagrange import Lagrange
from mechanisms import in_turn

import pteron
from pteron.errors import ModelError
from pteron.kernels import numeric
from pteron.platforms import conformance as of_platforms

MIXED = [(motion, kinds, "rpy") for motion, kinds in tilting.LEGS.items()]
MIXED += [("3T3R", ("UPS",), "xyz"), ("3R", ("RSS",), "xyz"), ("1T2R", ("RPS",), "rpy")]
SOME = [*MIXED[: len(tilting.LEGS)], ("3R", ("RSS",), "xyz")]


EVERY = in_turn(
    MIXED,
    SOME,
    share=2,
    argument="drawn",
    indirect=True,
    ids=lambda case: f"{case[0]} {'-'.join(case[1])} {case[2]}",
)


@pytest.fixture
def drawn(request):
    motion, kinds, angles = request.param
    robot, home = tilting.machine(motion, kinds, 3, angles)
    return robot, tilting.states(robot, home, 12)


@EVERY
def test_platforms_conform(drawn):
    robot, _ = drawn
    for seed in range(3):
        assert of_platforms.faults(robot.platform, seed) == ()


@EVERY
def test_the_equation_of_motion_is_lagranges(drawn):
    robot, (x, dx, ddx) = drawn
    forces = pteron.inverse_dynamics(robot, x, dx, ddx)
    across = np.einsum("bnm,bn->bm", pteron.jacobian(robot, x), forces)
    moved = np.einsum("bij,bj->bi", pteron.mass_matrix(robot, x), ddx)
    moved += np.einsum("bij,bj->bi", pteron.coriolis_matrix(robot, x, dx), dx)
    moved += pteron.gravity_forces(robot, x)
    np.testing.assert_allclose(across, moved, atol=1e-11 * np.abs(moved).max())
    oracle = Lagrange(robot)
    np.testing.assert_allclose(oracle.forces(x, dx, ddx), forces, atol=1e-10 * np.abs(forces).max())
    back = pteron.forward_dynamics(robot, x, dx, forces)
    np.testing.assert_allclose(back, ddx, atol=1e-10)
    regressed = pteron.regressor(robot, x, dx, ddx) @ pteron.parameters(robot)
    np.testing.assert_allclose(regressed, forces, atol=1e-10 * np.abs(forces).max())


@EVERY
def test_a_wrench_does_its_work(drawn):
    robot, (x, dx, _) = drawn
    rng = np.random.default_rng(4)
    wrench = rng.normal(size=(len(x), 6))
    rest = 0 * x
    held = pteron.inverse_dynamics(robot, x, rest, rest, wrench)
    held -= pteron.inverse_dynamics(robot, x, rest, rest)
    power = np.einsum("bn,bnm,bm->b", held, pteron.jacobian(robot, x), dx)
    step = 1e-6
    (p1, r1), (p0, r0) = (robot.platform.placement(x + side * step * dx) for side in (1, -1))
    velocity = (p1 - p0) / (2 * step)
    turn = np.einsum("bij,bik->bjk", r1, r0) / (4 * step)  # R(t) R(-t)^T, axes being rows
    spin = np.stack([turn[:, i - 1, i - 2] - turn[:, i - 2, i - 1] for i in range(3)], -1)
    work = (wrench[:, :3] * velocity).sum(-1) + (wrench[:, 3:] * spin).sum(-1)
    np.testing.assert_allclose(power, -work, rtol=1e-6, atol=1e-6)


@EVERY
def test_a_step_finds_the_pose_of_joints(drawn):
    robot, (x, *_) = drawn
    x = x[np.abs(numeric(robot, "type_ii")(x)[0]) > 0.1]
    assert len(x) > 1
    joints = pteron.inverse_kinematics(robot, x)
    found, measure, bent, *_ = numeric(robot, "direct_step")(joints, x + 0.01)
    assert (bent == 0).all()
    assert (np.abs(measure) < 1.0).all()
    np.testing.assert_allclose(found, x, atol=1e-12)


@EVERY
def test_a_file_holds_all_of_it(drawn, tmp_path):
    robot, _ = drawn
    assert pteron.load(pteron.save(robot, tmp_path / "machine.toml")) == robot


@pytest.mark.parametrize(("motion", "kind"), [("3T3R", "UPS"), ("2R", "RSS"), ("1T2R", "PRS")])
def test_a_machine_turned_as_a_whole_needs_the_same_forces(motion, kind):
    robot, home = tilting.machine(motion, (kind,), 3)
    x, dx, ddx = tilting.states(robot, home, 5)
    turn = tilting.rotation(np.random.default_rng(8))
    moved = [np.array(v) for v in (x, dx, ddx)]
    if motion == "3T3R":
        for v in moved:
            v[:, :3] = v[:, :3] @ turn.T
    np.testing.assert_allclose(
        pteron.inverse_dynamics(pteron.turned(robot, turn), *moved),
        pteron.inverse_dynamics(robot, x, dx, ddx),
        atol=1e-10,
    )


def test_legs_that_do_not_go_under_a_platform_are_refused_with_the_reason():
    hexapod = tilting.machine("3T3R", ("UPS",), 1)[0]
    rotary = tilting.machine("3T3R", ("RSS",), 1)[0]
    tripod = tilting.machine("1T2R", ("RPS",), 1)[0]
    k = np.array(tripod.platform.axis)
    leaning = tilting.unit(np.array(tripod.legs[0].direction) + 0.1 * k)
    alike = [replace(leg, direction=tripod.legs[0].direction) for leg in tripod.legs]
    for platform, legs, words in (
        (hexapod.platform, hexapod.legs[:5], "5 given, but a 3T3R platform has 6 freedoms"),
        (hexapod.platform, tripod.legs * 2, "a RPS leg keeps its point in a plane"),
        (hexapod.platform, [replace(rotary.legs[0], rods=2)] * 6, "2 parallel rods hold an angle"),
        (hexapod.platform, pteron.load("quadrupteron").legs, "keeps a platform from tilting"),
        (tripod.platform, hexapod.legs[:3], "does not keep its point in a plane"),
        (tripod.platform, [replace(tripod.legs[0], direction=leaning)] * 3, "not stand upright"),
        (tripod.platform, alike, "the planes of all legs are parallel"),
        (pteron.load("3-rpr").platform, tripod.legs, "ends in a ball joint"),
        (
            hexapod.platform,
            [replace(leg, fixed_offset=(0.1, 0.0, 0.0)) for leg in hexapod.legs],
            "fixed_offset: a 3T3R platform tilts as one",
        ),
    ):
        with pytest.raises(ModelError, match=words):
            pteron.Manipulator("refused", platform, tuple(legs))
