"""More legs than coordinates: forces, rates, poses, base sets, identification, laws, files.

Machines are drawn at random, with other strengths and pretensions; NumPy's pseudo-inverse and
another solver of quadratic programs check the forces.
"""

from dataclasses import replace

import loaded_logs
import logs_of_motions
import numpy as np
import pytest
import quadprog
from exported_code import compiled
from loaded_logs import LOAD, base_of, make_log
from logs_of_motions import log_of, machine
from mechanisms import CATALOG, CLIENTS, rod_leg, slider_leg
from scipy.interpolate import make_interp_spline

import pteron
from pteron.controllers import ComputedTorque
from pteron.dynamics import bias_forces, null_space
from pteron.identification import Log, Terms, identify, optimal_excitation
from pteron.identification.drive_gains import identify_drive_gains
from pteron.identification.logs.description import KnownPayload
from pteron.identification.payload import identify_payload
from pteron.indices import Elasticity
from pteron.kinematics import joint_rates
from pteron.kinematics.sampling import type_ii_sizes
from pteron.kinematics.unit_rows import unit_rows
from pteron.manipulator import Distribution, Manipulator, dumps, loads
from pteron.motion import pick_and_place, simulate
from pteron.workspace import home_pose, redundancy

POINT, DELTA = CATALOG["3-rrr-point"], CATALOG["delta-redundant"]
PRETENSION = Distribution(reference=(1.0, -2.0, 0.5), strengths=(1.0, 2.0, 0.7))


def eight_rams():
    """Return the Stewart platform with two rams more."""
    stewart = pteron.load("stewart")
    more = [
        replace(
            stewart.legs[i],
            guide_point=tuple(np.array(stewart.legs[i].guide_point) * [-0.9, 1.1, 1.0]),
            platform_point=tuple(np.array(stewart.legs[i].platform_point) * [-1.0, 0.8, 1.0]),
            limits=(0.1, 10.0),
            base_cone=None,
            platform_cone=None,
        )
        for i in (0, 2)
    ]
    return replace(stewart, name="8-ups", legs=(*stewart.legs, *more), home=None)


def four_of_two_kinds(seed):
    """Return a 3T machine of two P-R-R-R legs and two double rods, at random."""
    rng = np.random.default_rng(seed)
    directions = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    points = {"platform_point": (0.0, 0.0, 0.0)}
    legs = [slider_leg(rng, directions[k], np.zeros(3), **points) for k in (0, 1)]
    normals = directions[2], (directions[2] + 0.5 * directions[0]) / np.sqrt(1.25)
    legs += [rod_leg(rng, n, np.zeros(3), **points) for n in normals]
    return Manipulator("mixed", CATALOG["tripteron"].platform, tuple(legs))


TURN = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
TURN *= np.linalg.det(TURN)
MACHINES = {
    "3-rrr-point": POINT,
    "with pretension": replace(POINT, distribution=PRETENSION),
    "delta-redundant": DELTA,
    "turned": pteron.manipulator.turned(replace(DELTA, gravity=(1.0, 2.0, -9.0)), TURN),
    "8-ups": eight_rams(),
}


def states(robot, count=40, seed=0):
    """Return random poses, velocities and accelerations."""
    rng = np.random.default_rng(seed)
    poses = pteron.random_poses(robot, count, seed=seed)
    return poses, rng.normal(size=poses.shape), 5.0 * rng.normal(size=poses.shape)


def needed(robot, pose, velocity, acceleration):
    """Return what motion and gravity need along the pose's coordinates."""
    mass = pteron.mass_matrix(robot, pose)
    return np.einsum("rij,rj->ri", mass, acceleration) + bias_forces(robot, pose, velocity)


@pytest.mark.parametrize("name", MACHINES)
def test_forces_are_the_nearest_to_the_reference(name):
    robot = MACHINES[name]
    motion = states(robot)
    forces, rows = pteron.inverse_dynamics(robot, *motion), pteron.jacobian(robot, motion[0])
    strengths = np.array(robot.drive_strengths)
    reference = np.array((robot.distribution or Distribution()).reference or [0.0] * len(strengths))
    load = needed(robot, *motion) - reference @ rows
    weighted = strengths[:, None] * rows
    expected = np.einsum("rmn,rm->rn", np.linalg.pinv(weighted), load) * strengths + reference
    scale = np.abs(expected).max()
    np.testing.assert_allclose(forces, expected, atol=1e-12 * scale)
    again = pteron.forward_dynamics(robot, motion[0], motion[1], forces)
    np.testing.assert_allclose(again, motion[2], atol=1e-9)
    zeros = np.zeros((len(rows), robot.freedom, robot.redundancy))
    np.testing.assert_allclose(rows.mT @ null_space(robot, motion[0]), zeros, atol=1e-12)


@pytest.mark.parametrize("name", ["3-rrr-point", "delta-redundant", "8-ups"])
def test_the_regressor_belongs_to_no_reference(name):
    robot = MACHINES[name]
    motion = states(robot, 10)
    product = pteron.regressor(robot, *motion) @ pteron.parameters(robot)
    np.testing.assert_allclose(product, pteron.inverse_dynamics(robot, *motion), atol=1e-10)


def test_rates_are_those_of_least_squares():
    robot = MACHINES["with pretension"]
    pose, velocity, _ = states(robot)
    rows, strengths = pteron.jacobian(robot, pose), np.array(robot.drive_strengths)
    rates = joint_rates(robot, pose, velocity).actuated
    kernel = pteron.compile(robot, "platform_motion")
    wrong = rates + np.random.default_rng(3).normal(size=rates.shape)
    for given in (rates, wrong):
        found = kernel(pose, given, np.zeros_like(given))[0]
        expected = [
            np.linalg.lstsq(strengths[:, None] * row, strengths * rate, rcond=None)[0]
            for row, rate in zip(rows, given, strict=True)
        ]
        np.testing.assert_allclose(found, expected, atol=1e-10)


@pytest.mark.parametrize("name", ["3-rrr-point", "delta-redundant"])
def test_forces_within_limits_are_another_solvers(name):
    robot, count = MACHINES[name], 1000
    rng = np.random.default_rng(5)
    n = robot.joint_count
    strengths, reference = rng.uniform(0.5, 2.0, n), 0.2 * rng.normal(size=n)
    greatest = np.full(n, 1.5 if n == 3 else 9.0)
    shares = Distribution(True, tuple(reference), tuple(strengths), tuple(greatest))
    motion = [*states(robot, count, seed=6)]
    motion[2] = (0.5 if n == 3 else 3.0) * motion[2]
    within = pteron.inverse_dynamics(robot, *motion, distribution=shares, on_failure="nan")
    free = pteron.inverse_dynamics(robot, *motion, distribution=replace(shares, limits=False))
    kernel = pteron.compile(replace(robot, distribution=shares), "inverse_dynamics")
    held, rows = kernel(*motion), pteron.jacobian(robot, motion[0])
    infeasible = limited = missed = 0
    for k in range(count):
        size = strengths**2
        problem = np.diag(1.0 / size), reference / size
        bounds = np.hstack([rows[k], np.eye(n), -np.eye(n)])
        right = np.concatenate([rows[k].T @ free[k], -greatest, -greatest])
        try:
            expected = quadprog.solve_qp(*problem, bounds, right, robot.freedom)[0]
        except ValueError:
            assert np.isnan(within[k]).all()
            infeasible += 1
            continue
        np.testing.assert_allclose(within[k], expected, atol=1e-9)
        if np.isfinite(held[k]).all():
            np.testing.assert_allclose(rows[k].T @ held[k], rows[k].T @ free[k], atol=1e-6)
            assert (np.abs(held[k]) < greatest * (1.0 + 1e-8)).all()
        else:
            missed += 1
        limited += np.abs(within[k] - free[k]).max() > 1e-6
    assert infeasible > 20
    assert limited > 20
    assert missed < 0.02 * count


def test_what_no_forces_can_do_is_refused():
    rest, limits = np.zeros(2), Distribution(limits=True)
    with pytest.raises(pteron.DataError, match="no drive forces within max_force move the plat"):
        pteron.drive_forces(POINT, [0.3, 0.25], rest, [1e4, 0.0], distribution=limits)


def test_limits_are_those_of_the_drives_with_friction():
    limits = Distribution(limits=True, greatest=(0.5, 3.0, 3.0))
    state = [0.3, 0.25], [1.0, 0.4], [4.0, 0.0]
    free, held = (pteron.drive_forces(POINT, *state, distribution=d) for d in (None, limits))
    assert np.abs(free[0]) > 0.5
    assert np.abs(held[0]) == pytest.approx(0.5)
    rows = pteron.jacobian(POINT, state[0])
    np.testing.assert_allclose(held @ rows, free @ rows, atol=1e-12)


# Positions.


@pytest.mark.parametrize("name", ["3-rrr-point", "delta-redundant", "8-ups"])
def test_direct_kinematics_inverts_inverse(name):
    robot = MACHINES[name]
    poses = pteron.random_poses(robot, 20, seed=3)
    found = pteron.direct_kinematics(robot, pteron.inverse_kinematics(robot, poses))
    nearest = np.nanmin(np.abs(found - poses[:, None]).max(axis=-1), axis=1)
    assert nearest.max() < 1e-9
    assert np.isfinite(found[..., 0]).sum(axis=1).max() <= 2


def test_readings_that_contradict_each_other_have_a_residual():
    poses = np.linspace([0.0, 0.0, -0.62], [0.08, 0.05, -0.6], 40)
    joints = pteron.inverse_kinematics(DELTA, poses)
    np.testing.assert_allclose(pteron.follow(DELTA, joints, poses[0]), poses, atol=1e-12)
    noise = 1e-4 * np.random.default_rng(0).normal(size=joints.shape)
    found = pteron.follow(DELTA, joints + noise, poses[0])
    assert np.abs(found - poses).max() < 2e-4
    assert np.abs(pteron.inverse_kinematics(DELTA, found) - joints - noise).max() > 1e-5
    with pytest.raises(pteron.UnreachablePose, match="no pose has these joint coordinates"):
        pteron.direct_kinematics(DELTA, (joints + noise)[3])
    pose = pteron.direct_kinematics(DELTA, (joints + noise)[3], tolerance=1e-3)[0]
    np.testing.assert_allclose(pose, poses[3], atol=2e-4)


# Base parameters.


@pytest.mark.parametrize(
    ("robot", "rank"),
    [
        (POINT, 10),
        (replace(POINT, gravity=(2.0, -9.0, 0.0)), 16),
        (DELTA, 17),
        (MACHINES["8-ups"], 34),
    ],
)
def test_base_counts_by_three_methods(robot, rank):
    assert pteron.base_parameters(robot).rank == rank
    for method in ("svd", "qr"):
        assert pteron.base_parameters(robot, method).rank == rank


# Laws, simulation, exported code.


@pytest.mark.parametrize("robot", [replace(POINT, distribution=PRETENSION), DELTA])
def test_computed_torque_holds_internal_forces(robot):
    home = home_pose(robot)
    motion = pick_and_place(robot, home)
    run = simulate(robot, motion, ComputedTorque(), duration=0.3)
    assert run.stopped is None
    assert np.abs(run.pose - run.reference.pose).max() < 1e-5
    forces = pteron.drive_forces(robot, run.pose, run.velocity, run.acceleration, smooth=True)
    moving = np.abs(joint_rates(robot, run.pose, run.velocity).actuated).min(axis=1) > 0.05
    rows = null_space(robot, run.pose)
    internal, expected = (np.einsum("tni,tn->ti", rows, f)[moving] for f in (run.forces, forces))
    np.testing.assert_allclose(internal, expected, atol=0.02 * np.abs(forces).max())


def test_exported_code_shares_forces_and_says_what_it_did_not_find(tmp_path):
    shares = Distribution(limits=True, greatest=(1.5, 1.5, 1.5))
    robot = replace(POINT, distribution=shares)
    call, _ = compiled(robot, ["inverse_dynamics"], tmp_path)
    motion, inertia = states(robot, 200), pteron.parameters(robot)
    expected = pteron.inverse_dynamics(robot, *motion, on_failure="nan")
    codes = []
    for k in range(200):
        code, forces = call("inverse_dynamics", *(part[k] for part in motion), inertia, sizes=[3])
        codes.append(code)
        if code == 0:
            rows = pteron.jacobian(robot, motion[0][k])
            np.testing.assert_allclose(forces @ rows, expected[k] @ rows, atol=1e-6)
    assert 0 < codes.count(0) < 200
    assert codes.count(0) >= np.isfinite(expected[:, 0]).sum() - 4


# Identification.


@CLIENTS
@pytest.mark.parametrize("robot", [POINT, DELTA], ids=["3-rrr-point", "delta-redundant"])
def test_values_are_within_their_intervals_however_drives_fight(robot):
    excitation = optimal_excitation(robot, seed=0)
    motion = excitation.motion.at(np.arange(0.0, 10.0, 2e-3))
    joints = pteron.inverse_kinematics(robot, motion.pose)
    forces = pteron.drive_forces(robot, motion.pose, motion.velocity, motion.acceleration)
    cancelling, standard = null_space(robot, motion.pose), []
    noise = 0.02 * forces.std()
    for seed in range(4):
        rng = np.random.default_rng(seed)
        fight = np.cumsum(rng.normal(size=(len(forces), robot.redundancy)), axis=0)
        measured = forces + noise * rng.normal(size=forces.shape)
        measured += np.einsum("tnk,tk->tn", cancelling, 0.02 * fight + 3.0)
        log = Log.of(robot, motion.time, joints + 1e-6 * rng.normal(size=joints.shape), measured)
        found = identify(robot, log)
        standard.append((found.estimate.values - true_values(robot, found.model))
                        / found.estimate.deviations)  # fmt: skip
        np.testing.assert_allclose(
            found.estimate.noise.mean(),
            noise * np.sqrt(robot.freedom / robot.joint_count),
            rtol=0.2,
        )
    assert (np.abs(standard) < 2.0).mean() > 0.9


def fighting(name, draw, share=0.01):
    """Return a log with and without a payload, with noise, whose drives push against each other."""
    robot, rng, log = machine(name), np.random.default_rng(draw), make_log(name, 2, (1e-6, 0.0))
    pose = loaded_logs.motion(name, 2)[1][0]
    size = 0.3 * np.abs(log.forces).mean()
    fight = np.cumsum(rng.normal(size=(len(pose), robot.redundancy)), axis=0)
    internal = np.einsum("tnk,tk->tn", null_space(robot, pose), size * (1.0 + 0.02 * fight))
    forces = log.forces + internal
    noise = share * np.sqrt((forces**2).mean(axis=0))
    return replace(log, forces=forces + noise * rng.normal(size=forces.shape)), noise


@pytest.mark.parametrize("name", ["3-rrr-point", pytest.param("delta-redundant", marks=CLIENTS)])
def test_a_payload_is_found_however_drives_fight(name):
    robot, base, standard = machine(name), base_of(name), []
    exact = identify_payload(robot, fighting(name, 0, 0.0)[0], base=base)
    assert exact.mass == pytest.approx(LOAD.mass, rel=1e-4)
    for draw in range(4):
        found = identify_payload(robot, fighting(name, draw)[0], base=base)
        standard.append((found.mass - LOAD.mass) / found.deviations[0])
        assert found.deviations[0] < 0.06 * LOAD.mass
    assert np.abs(standard).max() < 3.5
    assert np.sqrt(np.square(standard).mean()) < 2.0


@pytest.mark.parametrize("name", ["3-rrr-point", pytest.param("delta-redundant", marks=CLIENTS)])
def test_drive_gains_are_found_however_drives_fight(name):
    robot, base, standard = machine(name), base_of(name), []
    gains = np.array([31.0, -24.0, 40.0, 10.0])[: robot.joint_count]
    payload = KnownPayload(LOAD.mass)

    def in_currents(log):
        about = replace(log.description, column_force_unit="A", payload=payload)
        return replace(log, forces=log.forces / gains, description=about)

    found = identify_drive_gains(robot, in_currents(make_log(name)), base=base)
    np.testing.assert_allclose(found.gains, gains, rtol=1e-9)
    for draw in range(4):
        log, noise = fighting(name, draw)
        found = identify_drive_gains(robot, in_currents(log), base=base)
        standard.append((found.gains - gains) / found.deviations)
        assert (found.deviations < 0.08 * np.abs(gains)).all()
        np.testing.assert_allclose(found.residual, noise / np.abs(gains), rtol=0.5)
    assert np.abs(standard).max() < 3.5
    assert np.sqrt(np.square(standard).mean()) < 2.0


@CLIENTS
@pytest.mark.parametrize("name", ["3-rrr-point", "delta-redundant"])
def test_the_speeds_of_friction_that_falls_are_found(name):
    robot = machine(name)
    speeds, falls = np.array([0.1, 0.15, 0.08, 0.12]), np.array([1.5, 2.0, 1.0, 1.7])
    speeds, falls = speeds[: robot.joint_count], falls[: robot.joint_count]
    for noise in (0.0, 0.02):
        logs = []
        for slower, rate in ((1.0, 1000.0), (4.0, 500.0)):
            about = {"period": 4.0 * slower, "size": 0.08}
            plain = log_of(robot, duration=8.0 * slower, rate=rate, **about)
            rates = make_interp_spline(plain.time, plain.joints, k=7)(plain.time, 1)
            forces = plain.forces + falls * np.sign(rates) * np.exp(-((rates / speeds) ** 2))
            rng = np.random.default_rng(int(slower))
            forces += noise * rng.normal(size=forces.shape)
            pose = logs_of_motions.motion(robot, plain.time, **about)[0]
            forces += np.einsum("tnk->tn", null_space(robot, pose))  # drives that fight
            logs.append(replace(plain, source=f"{slower:g}.csv", forces=forces))
        found = identify(robot, logs, terms=Terms(stribeck="auto"), cad=None)
        friction = logs_of_motions.Friction.of(robot.joint_count)
        truth = np.r_[found.model.base.values(robot), friction.values, falls]
        if not noise:
            np.testing.assert_allclose(found.unknowns.speeds, speeds, rtol=1e-4)
            np.testing.assert_allclose(found.estimate.values, truth, atol=2e-4)
            continue
        standard = (found.estimate.values - truth) / found.estimate.deviations
        assert (np.abs(standard) < 2.0).mean() > 0.85
        low, high = found.unknowns.speed_intervals()
        assert ((low < speeds) & (speeds < high)).mean() > 0.6


def true_values(robot, model):
    """Return the values of a model's terms for the machine as it is."""
    drive = robot.legs[0].drive
    known = {"coulomb": drive.coulomb, "viscous": drive.viscous, "offset": 0.0}
    base = iter(model.base.values(robot).tolist())
    values = np.array([next(base) if kind == "base" else known[kind] for kind in model.kinds])
    return values + model.known_values(dict.fromkeys(model.joins, drive.inertia))


# Files, refusals, warnings.


def test_a_distribution_survives_the_file():
    robot = replace(POINT, distribution=replace(PRETENSION, limits=True))
    text = dumps(robot)
    assert "[distribution]" in text
    assert loads(text) == robot


@pytest.mark.parametrize(
    ("robot", "change", "words"),
    [
        (CATALOG["delta"], {"distribution": Distribution()}, "as many legs as freedoms"),
        (POINT, {"distribution": Distribution(reference=(1.0,))}, "reference: 1 values given, 3"),
        (
            POINT,
            {"distribution": Distribution(strengths=(1.0, 0.0, 1.0))},
            "strengths: .* finite numbers above 0 expected",
        ),
        (POINT, {"legs": POINT.legs[:1]}, "1 given, .* needs 2 legs or more"),
        (
            POINT,
            {"legs": (replace(POINT.legs[0], drive=None), *POINT.legs[1:])},
            "strength of the drives of legs 1 is unknown",
        ),
        (
            replace(POINT, legs=tuple(replace(leg, drive=None) for leg in POINT.legs)),
            {"distribution": Distribution(limits=True)},
            "max_force is missing in the drive of legs 1, 2, 3",
        ),
    ],
)
def test_a_mistake_is_one_line(robot, change, words):
    with pytest.raises(pteron.ModelError, match=words):
        replace(robot, **change)


def test_an_index_that_no_redundant_machine_has_says_why():
    with pytest.raises(pteron.ModelError, match="is about joints that move alone"):
        pteron.indices.evaluate(POINT, "output_pressure_angle", [0.3, 0.25])


def test_a_machine_that_is_not_redundant_has_no_internal_forces():
    with pytest.raises(pteron.PteronError):
        redundancy(CATALOG["delta"], [0.0, 0.0, -0.9])


def test_internal_forces_of_a_wrong_zero_are_those_of_springs():
    """Against a platform on springs that is let go: the forces of K e less what it gives way."""
    found, pose = redundancy(DELTA, [0.02, 0.0, -0.6]), [0.02, 0.0, -0.6]
    rows, stiffness = pteron.jacobian(DELTA, pose), found.stiffness
    for i in range(4):
        error = np.zeros(4)
        error[i] = 1e-4 / DELTA.legs[i].lever
        root = np.sqrt(stiffness)
        way = np.linalg.lstsq(root[:, None] * rows, root * error, rcond=None)[0]
        expected = stiffness * (error - rows @ way)
        np.testing.assert_allclose(found.internal_force[i], expected, atol=1e-9)
        np.testing.assert_allclose(expected @ rows, 0.0, atol=1e-9)
    assert (found.least_singular_value > 0.1).all()


@pytest.mark.parametrize("name", ["3-rrr-point", "delta-redundant"])
def test_compliance_is_that_of_all_drives_springs(name):
    robot = MACHINES[name]
    springs = np.linspace(1e4, 5e4, robot.joint_count)
    pose = home_pose(robot) + 0.01
    rows = pteron.jacobian(robot, pose)
    found = pteron.indices.stiffness(robot, pose, Elasticity(actuators=tuple(springs)))
    expected = np.linalg.inv(rows.T @ (springs[:, None] * rows))
    np.testing.assert_allclose(found.compliance, expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("name", MACHINES)
def test_the_type_ii_measure_is_that_of_unit_wrenches(name):
    """It is 1 at most, and does not depend on a crank's or a ram's unit."""
    robot = MACHINES[name]
    poses = pteron.random_poses(robot, 2000, seed=4)
    measures = type_ii_sizes(robot, poses)
    assert 0.05 < measures.max() <= 1.0
    if robot.platform.angles:
        return
    unit = unit_rows(robot, poses).rows
    bound = (robot.joint_count / robot.freedom) ** (robot.freedom / 2)
    expected = np.sqrt(np.linalg.det(unit.mT @ unit)) / bound
    np.testing.assert_allclose(measures, expected, rtol=1e-9)


def test_mixed_legs_and_a_crank_more_are_machines_too():
    for seed in range(3):
        robot = four_of_two_kinds(seed)
        motion = states(robot, 10, seed)
        forces = pteron.inverse_dynamics(robot, *motion)
        rows = pteron.jacobian(robot, motion[0])
        np.testing.assert_allclose(np.einsum("rnm,rn->rm", rows, forces), needed(robot, *motion),
                                   atol=1e-9)  # fmt: skip
    planar = CATALOG["3-rrr"]
    more = replace(planar.legs[0], guide_point=tuple(0.8 * np.array(planar.legs[1].guide_point)))
    robot = replace(planar, legs=(*planar.legs, more), home=None)
    assert robot.redundancy == 1
    pose = pteron.random_poses(robot, 5)
    assert np.isfinite(pteron.inverse_dynamics(robot, pose, 0.0 * pose, 0.0 * pose)).all()
