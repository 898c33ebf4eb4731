"""Identities that the dynamics satisfies, whatever the machine; and how batches behave."""

from dataclasses import replace
from functools import lru_cache

import casadi as ca
import mechanisms
import numpy as np
import pytest
from differences import along, gradient
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanisms import BATCH_SHAPES, CATALOG, MECHANISMS, relative_error
from scipy.spatial.transform import Rotation

import pteron
from pteron.kernels import program

EVERY = pytest.mark.parametrize("name", MECHANISMS)
COUNT = 100

states = lru_cache(mechanisms.states)


def times(matrices, vectors):
    return (matrices @ vectors[..., None])[..., 0]


def transposed(matrices):
    return np.swapaxes(matrices, -1, -2)


@EVERY
def test_regressor_times_parameters_is_inverse_dynamics(name):
    robot = MECHANISMS[name]
    motion = states(robot, COUNT)
    D = pteron.regressor(robot, *motion)
    assert D.shape == (COUNT, robot.freedom, len(pteron.parameter_names(robot)))
    forces = pteron.inverse_dynamics(robot, *motion)
    assert relative_error(D @ pteron.parameters(robot), forces) < 1e-12


@EVERY
def test_the_papers_product_of_matrices_is_the_regressor(name):
    robot = MECHANISMS[name]
    motion = states(robot, COUNT)
    D = pteron.regressor(robot, *motion)
    scale = np.abs(D).max(axis=(-2, -1), keepdims=True)
    difference = pteron.compile(robot, "paper_regressor")(*motion) - D
    assert (np.abs(difference) / scale).max() < 1e-13


@EVERY
def test_the_factors_of_equation_15_multiply_to_the_regressor(name):
    robot = MECHANISMS[name]
    motion = states(robot, COUNT)
    J, sliders, link_jacobians, links, platform = pteron.compile(robot, "paper_terms")(*motion)
    blocks = [transposed(J) @ sliders]
    blocks += [transposed(link_jacobians[:, i]) @ links[:, i] for i in range(links.shape[1])]
    expected = -np.linalg.solve(transposed(J), np.concatenate([*blocks, platform], axis=-1))
    upper, lower = pteron.link_jacobians(robot, motion[0])
    np.testing.assert_allclose(link_jacobians, np.concatenate([upper, lower], axis=1), atol=1e-12)
    D = pteron.regressor(robot, *motion)
    scale = np.abs(D).max(axis=(-2, -1), keepdims=True)
    assert (np.abs(expected - D) / scale).max() < 1e-13


@EVERY
def test_the_mass_matrix_is_symmetric_and_positive_definite(name):
    robot = MECHANISMS[name]
    M = pteron.mass_matrix(robot, states(robot, COUNT)[0])
    np.testing.assert_allclose(M, transposed(M), rtol=0, atol=1e-14 * np.abs(M).max())
    eigenvalues = np.linalg.eigvalsh(M)
    assert (eigenvalues[:, 0] > 1e-6 * eigenvalues[:, -1]).all()


@EVERY
def test_the_equation_of_motion(name):
    robot = MECHANISMS[name]
    pose, velocity, acceleration = states(robot, COUNT)
    M = pteron.mass_matrix(robot, pose)
    C = pteron.coriolis_matrix(robot, pose, velocity)
    g = pteron.gravity_forces(robot, pose)
    bias = pteron.bias_forces(robot, pose, velocity)
    left = times(M, acceleration) + times(C, velocity) + g
    forces = pteron.inverse_dynamics(robot, pose, velocity, acceleration)
    right = times(transposed(pteron.jacobian(robot, pose)), forces)
    assert relative_error(left, right) < 1e-12
    assert relative_error(times(C, velocity) + g, bias) < 1e-12
    still = pteron.bias_forces(robot, pose, 0 * velocity)
    np.testing.assert_allclose(still, g, rtol=0, atol=1e-14 * np.abs(bias).max())


@EVERY
def test_the_rate_of_the_mass_matrix_less_twice_c_is_skew(name):
    robot = MECHANISMS[name]
    pose, velocity, _ = states(robot, 20)
    mass = program(robot, "mass_matrix").function
    x, dx = ca.SX.sym("x", robot.freedom), ca.SX.sym("dx", robot.freedom)
    inertial = pteron.parameters(robot)
    rate = ca.Function("rate", [x, dx], [ca.jtimes(mass(x, inertial), x, dx)])
    C = pteron.coriolis_matrix(robot, pose, velocity)
    for state, c in zip(zip(pose, velocity, strict=True), C, strict=True):
        skew = rate(*state).full() - 2 * c
        np.testing.assert_allclose(skew, -skew.T, rtol=0, atol=1e-13 * np.abs(c).max())


@EVERY
def test_the_mass_matrix_is_what_acceleration_costs(name):
    robot = MECHANISMS[name]
    pose, velocity, _ = states(robot, 20)
    rest = 0 * velocity
    M = pteron.mass_matrix(robot, pose)
    Jt = transposed(pteron.jacobian(robot, pose))
    still = pteron.inverse_dynamics(robot, pose, rest, rest)
    for k, axis in enumerate(np.eye(robot.freedom)):
        forces = pteron.inverse_dynamics(robot, pose, rest, rest + axis) - still
        # Gravity's forces, about 10 N, cancel in the difference.
        np.testing.assert_allclose(times(Jt, forces), M[..., k], rtol=0, atol=1e-12)


@EVERY
def test_kinetic_energy_is_the_mass_matrix_form(name):
    robot = MECHANISMS[name]
    pose, velocity, _ = states(robot, COUNT)
    form = (velocity * times(pteron.mass_matrix(robot, pose), velocity)).sum(axis=-1) / 2
    np.testing.assert_allclose(pteron.kinetic_energy(robot, pose, velocity), form, rtol=1e-12)


@EVERY
def test_gravity_forces_are_the_gradient_of_potential_energy(name):
    robot = MECHANISMS[name]
    poses = pteron.random_poses(robot, 20, seed=3, bend=0.5, hold=0.3)
    found = gradient(lambda x: pteron.potential_energy(robot, x), poses)
    # Energies of 10 J, rounded, over the step of 5e-5.
    np.testing.assert_allclose(pteron.gravity_forces(robot, poses), found, rtol=0, atol=1e-9)


def test_potential_energy_is_that_of_the_centres_of_mass():
    robot = CATALOG["quadrupteron-oblique"]
    pose = states(robot, 1)[0][0]
    frame = np.column_stack(robot.platform.frame)
    rotation = Rotation.from_rotvec(pose[3] * np.array(robot.platform.axis)).as_matrix() @ frame
    upper, lower = pteron.link_vectors(robot, pose)
    rho = pteron.inverse_kinematics(robot, pose)
    energy = 0.0
    for leg, l_u, l_l, slide in zip(robot.legs, upper, lower, rho, strict=True):
        slider = np.array(leg.guide_point) + slide * np.array(leg.e)
        point = pose[:3] + rotation @ leg.platform_point
        energy -= leg.slider_mass * np.dot(robot.gravity, slider)
        for origin, vector, body in ((slider, l_u, leg.upper), (point, l_l, leg.lower)):
            x = vector / np.linalg.norm(vector)
            gx, gy = body.center_of_mass
            center = origin + gx * x + gy * np.cross(leg.direction, x)
            energy -= body.mass * np.dot(robot.gravity, center)
    body = robot.platform.inertia
    center = pose[:3] + rotation @ [*body.center_of_mass, 0.0]
    energy -= body.mass * np.dot(robot.gravity, center)
    assert pteron.potential_energy(robot, pose) == pytest.approx(energy, rel=1e-14)


@EVERY
def test_power_of_the_actuators_is_the_rate_of_energy(name):
    robot = MECHANISMS[name]
    poses = pteron.random_poses(robot, 20, seed=6, bend=0.5, hold=0.3)
    rng = np.random.default_rng(6)
    velocity, acceleration = rng.normal(size=poses.shape), 10 * rng.normal(size=poses.shape)

    def energy(t):
        t = t[:, None, None]
        x, dx = poses + t * velocity + t**2 / 2 * acceleration, velocity + t * acceleration
        return pteron.kinetic_energy(robot, x, dx) + pteron.potential_energy(robot, x)

    forces = pteron.inverse_dynamics(robot, poses, velocity, acceleration)
    sliders = pteron.joint_rates(robot, poses, velocity).sliders
    power = (forces * sliders).sum(axis=-1)
    # Energies of 10 J, rounded, over a step of 2e-5 s.
    np.testing.assert_allclose(along(energy, 2e-5), power, rtol=1e-9, atol=1e-8)


@EVERY
def test_forward_dynamics_inverts_inverse_dynamics(name):
    robot = MECHANISMS[name]
    pose, velocity, acceleration = states(robot, COUNT)
    wrench = np.random.default_rng(1).normal(size=pose.shape)
    for load in (None, wrench):
        forces = pteron.inverse_dynamics(robot, pose, velocity, acceleration, load)
        found = pteron.forward_dynamics(robot, pose, velocity, forces, load)
        assert relative_error(found, acceleration) < 1e-10


def test_forward_dynamics_needs_no_regular_pose():
    robot = CATALOG["quadrupteron"]
    rng = np.random.default_rng(2)
    pose = np.array([0.01, 0.02, -0.01, np.pi / 2])
    velocity, forces, wrench = rng.normal(size=(3, 4))
    acceleration = pteron.forward_dynamics(robot, pose, velocity, forces, wrench)
    left = pteron.mass_matrix(robot, pose) @ acceleration
    left += pteron.bias_forces(robot, pose, velocity)
    right = pteron.jacobian(robot, pose).T @ forces + wrench
    np.testing.assert_allclose(left, right, atol=1e-12 * np.abs(left).max())


@EVERY
def test_a_wrench_is_held_through_the_transposed_jacobian(name):
    robot = MECHANISMS[name]
    motion = states(robot, COUNT)
    wrench = 10 * np.random.default_rng(3).normal(size=motion[0].shape)
    free = pteron.inverse_dynamics(robot, *motion)
    loaded = pteron.inverse_dynamics(robot, *motion, wrench)
    Jt = transposed(pteron.jacobian(robot, motion[0]))
    scale = np.abs(free).max()
    np.testing.assert_allclose(times(Jt, loaded - free), -wrench, rtol=0, atol=1e-13 * scale)
    np.testing.assert_array_equal(pteron.inverse_dynamics(robot, *motion, 0 * wrench), free)


@settings(deadline=None, derandomize=True, max_examples=40)
@given(
    st.sampled_from(sorted(MECHANISMS)),
    st.integers(0, 2**32 - 1),
    st.floats(0.01, 100.0),
)
def test_forces_are_linear_in_the_parameters(name, seed, factor):
    robot = MECHANISMS[name]
    motion = states(robot, 3, seed)
    values = pteron.parameters(robot)
    other = random_parameters(robot, seed)
    forces = pteron.inverse_dynamics(robot, *motion)
    others = pteron.inverse_dynamics(pteron.with_parameters(robot, other), *motion)
    scaled = pteron.inverse_dynamics(pteron.with_parameters(robot, factor * values), *motion)
    both = pteron.inverse_dynamics(pteron.with_parameters(robot, values + other), *motion)
    assert relative_error(scaled, factor * forces) < 1e-12
    size = np.abs(forces).max() + np.abs(others).max()
    np.testing.assert_allclose(both, forces + others, rtol=0, atol=1e-13 * size)


def random_parameters(robot, seed):
    """Return parameters of real bodies, in order."""
    rng = np.random.default_rng(seed)
    n = robot.freedom
    bodies = []
    for _ in range(2 * n + 1):
        mass, (x, y) = rng.uniform(0.1, 2.0), rng.uniform(-0.1, 0.1, 2)
        bodies += [mass, mass * x, mass * y, mass * (x * x + y * y) + rng.uniform(1e-4, 1e-2)]
    return np.array([*rng.uniform(0.1, 2.0, n), *bodies])


@settings(deadline=None, derandomize=True, max_examples=25)
@given(st.sampled_from(sorted(CATALOG)), st.integers(0, 2**32 - 1))
def test_the_identities_hold_for_random_bodies(name, seed):
    robot = CATALOG[name]
    robot = pteron.with_parameters(robot, random_parameters(robot, seed))
    pose, velocity, acceleration = states(robot, 3, seed)
    forces = pteron.inverse_dynamics(robot, pose, velocity, acceleration)
    left = times(pteron.mass_matrix(robot, pose), acceleration)
    left += pteron.bias_forces(robot, pose, velocity)
    assert relative_error(left, times(transposed(pteron.jacobian(robot, pose)), forces)) < 1e-12
    D = pteron.regressor(robot, pose, velocity, acceleration)
    assert relative_error(D @ pteron.parameters(robot), forces) < 1e-12


@settings(deadline=None, derandomize=True, max_examples=20)
@given(st.sampled_from(sorted(CATALOG)), st.integers(0, 2**32 - 1))
def test_a_machine_turned_with_gravity_feels_the_same_forces(name, seed):
    robot = CATALOG[name]
    rotation = Rotation.random(rng=seed).as_matrix()
    motion = states(robot, 5, seed)
    moved = [np.concatenate([v[:, :3] @ rotation.T, v[:, 3:]], axis=-1) for v in motion]
    forces = pteron.inverse_dynamics(robot, *motion)
    turned = pteron.turned(robot, rotation)
    assert relative_error(pteron.inverse_dynamics(turned, *moved), forces) < 1e-12
    upright = pteron.turned(robot, rotation, gravity=False)
    assert upright.gravity == robot.gravity
    same_gravity = replace(turned, gravity=robot.gravity)
    np.testing.assert_array_equal(
        pteron.inverse_dynamics(upright, *moved), pteron.inverse_dynamics(same_gravity, *moved)
    )


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
    "inverse_dynamics": 3,
    "forward_dynamics": 3,
    "regressor": 3,
}
"""The number of arrays (..., m) that each takes."""


def parts(result):
    """Return the arrays of a result."""
    if isinstance(result, pteron.JointMotion):
        return [result.sliders, result.upper_links, result.lower_links, result.revolute]
    if isinstance(result, tuple):
        return [array for part in result for array in parts(part)]
    return [np.asarray(result)]


@pytest.mark.parametrize("shape", BATCH_SHAPES, ids=str)
@pytest.mark.parametrize("function", STATE_FUNCTIONS)
@pytest.mark.parametrize("name", ["quadrupteron", "tripteron-oblique"])
def test_a_batch_is_its_single_calls_bit_for_bit(name, function, shape):
    robot, call = CATALOG[name], getattr(pteron, function)
    count = int(np.prod(shape, dtype=int))
    arrays = states(robot, count or 1)[: STATE_FUNCTIONS[function]]
    single = [parts(call(robot, *state)) for state in zip(*arrays, strict=True)]
    batch = [a[:count].reshape(*shape, robot.freedom) for a in arrays]
    for k, found in enumerate(parts(call(robot, *batch))):
        assert found.shape == shape + single[0][k].shape
        assert found.dtype == np.float64
        flat = found.reshape(count, *single[0][k].shape)
        for i in range(count):
            np.testing.assert_array_equal(flat[i], single[i][k])


@pytest.mark.parametrize("shape", BATCH_SHAPES, ids=str)
@pytest.mark.parametrize("name", ["quadrupteron", "tripteron-oblique"])
def test_a_batch_of_sliders_is_its_single_calls_bit_for_bit(name, shape):
    robot = CATALOG[name]
    count = int(np.prod(shape, dtype=int))
    sliders = pteron.inverse_kinematics(robot, states(robot, count or 1)[0])
    found = pteron.direct_kinematics(robot, sliders[:count].reshape(*shape, robot.freedom))
    k = 2 if robot.platform.turns else 1
    assert found.shape == (*shape, k, robot.freedom)
    flat = found.reshape(count, k, robot.freedom)
    for i in range(count):
        np.testing.assert_array_equal(flat[i], pteron.direct_kinematics(robot, sliders[i]))


@pytest.mark.parametrize("function", [f for f, n in STATE_FUNCTIONS.items() if n > 1])
def test_leading_axes_broadcast(function):
    robot, call = CATALOG["quadrupteron"], getattr(pteron, function)
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
    kept = [a.copy() for a in strided]
    np.testing.assert_array_equal(pteron.inverse_dynamics(robot, *strided), expected)
    for before, after in zip(kept, strided, strict=True):
        np.testing.assert_array_equal(before, after)
    lists = [a[0].tolist() for a in motion]
    np.testing.assert_array_equal(pteron.inverse_dynamics(robot, *lists), expected[0])
