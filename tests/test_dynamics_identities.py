"""Identities that the dynamics satisfies, whatever the machine; and how batches behave."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from differences import along, gradient
from mechanisms import (
    BATCH_SHAPES,
    CATALOG,
    MACHINES,
    MECHANISMS,
    gated,
    in_turn,
    relative_error,
    states,
)
from scipy.spatial.transform import Rotation

import pteron
from pteron.equations.machine import Machine
from pteron.kernels import program
from pteron.legs.leg import LegEquations

EVERY = in_turn(MACHINES)
TWO_LINKS = in_turn(MECHANISMS, share=2)
FEW = ["quadrupteron-oblique", "delta", "random 3T 0", "random PRR 0"]
SOME = in_turn(FEW, FEW, share=2)
COUNT = 100


def times(matrices, vectors):
    return (matrices @ vectors[..., None])[..., 0]


def transposed(matrices):
    return np.swapaxes(matrices, -1, -2)


def plain(robot, what):
    """Return a function as its equations are written, which is ready soonest."""
    return program(robot, what, plain=True).function


def joint_rates(robot, pose, velocity):
    return pteron.kinematics.joint_rates(robot, pose, velocity).actuated


@EVERY
def test_the_regressor_is_linear_in_the_parameters_and_the_papers(name):
    robot = MACHINES[name]
    motion = states(robot, COUNT)
    D = pteron.regressor(robot, *motion)
    assert D.shape == (COUNT, robot.freedom, len(pteron.parameter_names(robot)))
    forces = pteron.inverse_dynamics(robot, *motion)
    assert relative_error(D @ pteron.parameters(robot), forces) < 1e-12
    paper = plain(robot, "paper_regressor")
    found = np.array([paper(*state).full().T for state in zip(*motion, strict=True)])
    scale = np.abs(D).max(axis=(-2, -1), keepdims=True)
    assert (np.abs(found - D) / scale).max() < 1e-12


@SOME
def test_the_factors_of_equation_15_multiply_to_the_regressor(name):
    robot = MACHINES[name]
    motion = states(robot, COUNT)
    D = pteron.regressor(robot, *motion)
    J, sliders, link_jacobians, links, platform = pteron.compile(robot, "paper_terms")(*motion)
    with_slider = [i for i, leg in enumerate(robot.legs) if "p" in leg.bodies]
    columns = [len(leg.bodies[b].kinds) for b in "ul" for leg in robot.legs]
    blocks = [(transposed(J) @ sliders)[..., with_slider]]
    for i, own in enumerate(columns):
        blocks.append(transposed(link_jacobians[:, i]) @ links[:, i, :, :own])
    product = -np.linalg.solve(transposed(J), np.concatenate([*blocks, platform], axis=-1))
    scale = np.abs(D).max(axis=(-2, -1), keepdims=True)
    assert (np.abs(product - D) / scale).max() < 1e-12
    both = np.concatenate(pteron.kinematics.link_jacobians(robot, motion[0]), axis=1)
    np.testing.assert_allclose(link_jacobians, both, atol=1e-12)


@TWO_LINKS
def test_what_a_leg_needs_is_what_its_bodies_need(name):
    """The leg's own, cheaper form against the sum of J_b^T F_b over its bodies."""
    robot = MACHINES[name]
    machine = Machine.numeric(robot)
    x, dx, ddx = (ca.SX.sym(v, robot.freedom) for v in ("x", "dx", "ddx"))
    state = machine.state(x, dx, ddx)
    inertia, _ = machine.moments(ca.SX.eye(len(machine.parameters)))
    pairs = []
    for leg, at, point, bodies in zip(
        machine.legs, state.legs, state.platform.points, inertia, strict=True
    ):
        given = point, state.platform.rotation, machine.gravity, bodies
        for mass_by in (type(leg).point_mass_needs, LegEquations.point_mass_needs):
            forms = []
            for form in (type(leg).needs, LegEquations.needs):
                needs = form(leg, *given)
                riding = mass_by(leg, point, machine.gravity, needs.mass)
                joint, force = needs.joint + riding.joint, needs.point + riding.point
                forms.append(force + ca.mtimes(at.row.T / at.divisor, joint))
            pairs.append(forms)
    own, plain = (ca.vertcat(*forms) for forms in zip(*pairs, strict=True))
    function = ca.Function("needs", [x, dx, ddx], [own, plain])
    for motion in zip(*states(robot, 20), strict=True):
        found, expected = (value.full() for value in function(*motion))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@EVERY
def test_the_equation_of_motion(name):
    robot = MACHINES[name]
    pose, velocity, acceleration = states(robot, COUNT)
    M = pteron.mass_matrix(robot, pose)
    np.testing.assert_allclose(M, transposed(M), rtol=0, atol=1e-14 * np.abs(M).max())
    eigenvalues = np.linalg.eigvalsh(M)
    assert (eigenvalues[:, 0] > 1e-6 * eigenvalues[:, -1]).all()
    coriolis, values = plain(robot, "coriolis_matrix"), pteron.parameters(robot)
    C = np.array([coriolis(*x, values).full().T for x in zip(pose, velocity, strict=True)])
    g = pteron.gravity_forces(robot, pose)
    bias = pteron.bias_forces(robot, pose, velocity)
    forces = pteron.inverse_dynamics(robot, pose, velocity, acceleration)
    left = times(M, acceleration) + times(C, velocity) + g
    right = times(transposed(pteron.jacobian(robot, pose)), forces)
    assert relative_error(left, right) < 1e-11
    assert relative_error(times(C, velocity) + g, bias) < 1e-11
    still = pteron.bias_forces(robot, pose, 0 * velocity)
    np.testing.assert_allclose(still, g, rtol=0, atol=1e-14 * np.abs(bias).max())
    energy = (velocity * times(M, velocity)).sum(axis=-1) / 2
    np.testing.assert_allclose(pteron.kinetic_energy(robot, pose, velocity), energy, rtol=1e-12)


@SOME
def test_the_rate_of_the_mass_matrix_less_twice_c_is_skew(name):
    robot = MACHINES[name]
    pose, velocity, _ = states(robot, 20)
    mass = plain(robot, "mass_matrix")
    x, dx = ca.SX.sym("x", robot.freedom), ca.SX.sym("dx", robot.freedom)
    inertial = pteron.parameters(robot)
    rate = ca.Function("rate", [x, dx], [ca.jtimes(mass(x, inertial), x, dx)])
    C = pteron.coriolis_matrix(robot, pose, velocity)
    for state, c in zip(zip(pose, velocity, strict=True), C, strict=True):
        skew = rate(*state).full() - 2 * c
        np.testing.assert_allclose(skew, -skew.T, rtol=0, atol=1e-12 * np.abs(c).max())


@EVERY
def test_energies_power_and_gravity(name):
    robot = MACHINES[name]
    pose = pteron.random_poses(robot, 20, seed=6, type_i=0.5, type_ii=0.15)
    rng = np.random.default_rng(6)
    velocity, acceleration = rng.normal(size=pose.shape), 10 * rng.normal(size=pose.shape)

    def energy(t):
        t = t[:, None, None]
        x, dx = pose + t * velocity + t**2 / 2 * acceleration, velocity + t * acceleration
        return pteron.kinetic_energy(robot, x, dx) + pteron.potential_energy(robot, x)

    forces = pteron.inverse_dynamics(robot, pose, velocity, acceleration)
    power = (forces * joint_rates(robot, pose, velocity)).sum(axis=-1)
    # Energies of 10 J, rounded, over a step of 2e-5 s.
    np.testing.assert_allclose(along(energy, 2e-5), power, rtol=1e-9, atol=1e-7)
    slope = gradient(lambda x: pteron.potential_energy(robot, x), pose)
    np.testing.assert_allclose(pteron.gravity_forces(robot, pose), slope, rtol=0, atol=1e-8)


def test_potential_energy_is_zero_at_the_origin_of_the_base_frame():
    """Moving the whole machine by a metre along gravity costs its weight, exactly."""
    for name in FEW:
        robot = MACHINES[name]
        pose = states(robot, 5)[0]
        size = np.linalg.norm(robot.gravity)
        down = np.array(robot.gravity) / size
        legs = tuple(replace(leg, guide_point=tuple(leg.guide_point + down)) for leg in robot.legs)
        moved = pose.copy()
        moved[:, :3] += down
        lost = pteron.potential_energy(robot, pose) - pteron.potential_energy(
            replace(robot, legs=legs), moved
        )
        kinds = pteron.manipulator.parameter_data(robot)
        mass = sum(v for p, v in zip(kinds, pteron.parameters(robot), strict=True) if p.kind == "m")
        np.testing.assert_allclose(lost, mass * size, rtol=1e-13)


@EVERY
def test_forward_dynamics_inverts_inverse_dynamics_and_a_wrench_is_held(name):
    robot = MACHINES[name]
    pose, velocity, acceleration = states(robot, COUNT)
    wrench = 10 * np.random.default_rng(1).normal(size=pose.shape)
    free = pteron.inverse_dynamics(robot, pose, velocity, acceleration)
    loaded = pteron.inverse_dynamics(robot, pose, velocity, acceleration, wrench)
    for forces, load in ((free, None), (loaded, wrench)):
        found = pteron.forward_dynamics(robot, pose, velocity, forces, load)
        assert relative_error(found, acceleration) < 1e-10
    Jt = transposed(pteron.jacobian(robot, pose))
    np.testing.assert_allclose(times(Jt, loaded - free), -wrench, rtol=0, atol=1e-9)


def test_forward_dynamics_needs_no_pose_that_is_held():
    robot = CATALOG["quadrupteron"]
    rng = np.random.default_rng(2)
    pose = np.array([0.01, 0.02, -0.01, np.pi / 2])
    velocity, forces, wrench = rng.normal(size=(3, 4))
    acceleration = pteron.forward_dynamics(robot, pose, velocity, forces, wrench)
    left = pteron.mass_matrix(robot, pose) @ acceleration
    left += pteron.bias_forces(robot, pose, velocity)
    right = pteron.jacobian(robot, pose).T @ forces + wrench
    np.testing.assert_allclose(left, right, atol=1e-12 * np.abs(left).max())


@TWO_LINKS
def test_passive_friction_does_the_work_of_its_joint(name):
    robot = MACHINES[name]
    pose, velocity, _ = states(robot, 20)
    columns = pteron.compile(robot, "passive_friction")(pose, velocity)
    moved = pteron.kinematics.joint_rates(robot, pose, velocity)
    # Of a chain under a platform that turns, the last joint is the platform's own.
    own = moved.passive[..., :3] if robot.platform.turns else moved.passive
    rates = own.reshape(len(pose), -1)
    rates = np.hstack([rates[:, ~np.isnan(rates[0])], velocity[:, 3:]])
    power = np.einsum("rnc,rn->rc", columns, moved.actuated)
    assert columns.shape == (20, robot.freedom, rates.shape[1])
    np.testing.assert_allclose(power, rates**2, rtol=0, atol=1e-11 * (rates**2).max())


@EVERY
def test_the_platforms_motion_from_that_of_the_joints(name):
    robot = MACHINES[name]
    motion = states(robot, COUNT)
    rates = joint_rates(robot, *motion[:2])
    accelerations = pteron.kinematics.joint_accelerations(robot, *motion).actuated
    back = pteron.compile(robot, "platform_motion")(motion[0], rates, accelerations)
    assert relative_error(back[0], motion[1]) < 1e-10
    assert relative_error(back[1], motion[2]) < 1e-10


@SOME
def test_a_machine_turned_with_gravity_feels_the_same_forces(name):
    robot = MACHINES[name]
    rotation = Rotation.random(rng=len(name)).as_matrix()
    motion = states(robot, 20)
    moved = [np.concatenate([v[:, :3] @ rotation.T, v[:, 3:]], axis=-1) for v in motion]
    turned = pteron.turned(robot, rotation)
    forces = pteron.inverse_dynamics(robot, *motion)
    assert relative_error(pteron.inverse_dynamics(turned, *moved), forces) < 1e-11
    upright = pteron.turned(robot, rotation, gravity=False)
    assert upright.gravity == robot.gravity
    assert replace(upright, gravity=turned.gravity) == turned


# Batches.

STATE_FUNCTIONS = {
    "inverse_kinematics": 1,
    "link_vectors": 1,
    "jacobian": 1,
    "link_jacobians": 1,
    "joint_screws": 1,
    "mass_matrix": 1,
    "gravity_forces": 1,
    "potential_energy": 1,
    "joint_rates": 2,
    "coriolis_matrix": 2,
    "bias_forces": 2,
    "kinetic_energy": 2,
    "joint_accelerations": 3,
    "inverse_dynamics": 3,
    "forward_dynamics": 3,
    "regressor": 3,
}
"""The number of arrays (..., m) that each takes."""


def parts(result):
    """Return the arrays of a result."""
    if isinstance(result, pteron.kinematics.JointMotion):
        return list(vars(result).values())
    return list(result) if isinstance(result, tuple) else [np.asarray(result)]


def public(name):
    """Return the function of a name, whichever package has it."""
    return getattr(pteron if name in pteron.__all__ else pteron.kinematics, name)


@pytest.mark.parametrize("function", [*STATE_FUNCTIONS, "direct_kinematics"])
@pytest.mark.parametrize("name", gated(["quadrupteron", "delta", "random PRR 0"], ["delta"]))
def test_a_batch_is_its_single_calls_bit_for_bit(name, function):
    robot, call = MACHINES[name], public(function)
    if function == "direct_kinematics":
        arrays = [pteron.inverse_kinematics(robot, states(robot, 400)[0])]
    else:
        arrays = states(robot, 400)[: STATE_FUNCTIONS[function]]
    single = [parts(call(robot, *state)) for state in zip(*arrays, strict=True)]
    for shape in BATCH_SHAPES:
        count = int(np.prod(shape, dtype=int))
        batch = [a[:count].reshape(*shape, robot.freedom) for a in arrays]
        for k, found in enumerate(parts(call(robot, *batch))):
            assert found.shape == shape + single[0][k].shape
            assert found.dtype == np.float64
            flat = found.reshape(count, *single[0][k].shape)
            for i in range(count):
                np.testing.assert_array_equal(flat[i], single[i][k])


@pytest.mark.parametrize("function", [f for f, n in STATE_FUNCTIONS.items() if n > 1])
def test_leading_axes_broadcast(function):
    robot, call = CATALOG["quadrupteron"], public(function)
    pose, *rest = states(robot, 12)[: STATE_FUNCTIONS[function]]
    pose = pose[:4].reshape(4, 1, 4)
    rest = [rest[0][:3], *(one[0] for one in rest[1:])]
    whole = [np.broadcast_to(a, (4, 3, 4)) for a in (pose, *rest)]
    for found, expected in zip(
        parts(call(robot, pose, *rest)), parts(call(robot, *whole)), strict=True
    ):
        assert found.shape[:2] == (4, 3)
        np.testing.assert_array_equal(found, expected)


def test_a_wrench_broadcasts():
    robot = CATALOG["quadrupteron"]
    motion = [a[0] for a in states(robot, 1)]
    wrench = np.random.default_rng(0).normal(size=(2, 5, 4))
    found = pteron.inverse_dynamics(robot, *motion, wrench)
    assert found.shape == (2, 5, 4)
    np.testing.assert_array_equal(
        found[1, 3], pteron.inverse_dynamics(robot, *motion, wrench[1, 3])
    )


def test_arrays_need_not_be_contiguous_and_are_not_changed():
    robot = CATALOG["quadrupteron"]
    motion = states(robot, 600)
    expected = pteron.inverse_dynamics(robot, *(a[::2].copy() for a in motion))
    strided = [np.asfortranarray(a)[::2] for a in motion]
    np.testing.assert_array_equal(pteron.inverse_dynamics(robot, *strided), expected)
    for before, after in zip(motion, strided, strict=True):
        np.testing.assert_array_equal(before[::2], after)
    lists = [a[0].tolist() for a in motion]
    np.testing.assert_array_equal(pteron.inverse_dynamics(robot, *lists), expected[0])
