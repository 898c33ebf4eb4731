"""Exciting trajectories: the motions, their limits, the search, and what is written."""

from __future__ import annotations

import json
import multiprocessing
import signal
import sys
import threading
import tomllib
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import casadi as ca
import numpy as np
import polars as pl
import pytest
from logs_of_motions import machine
from mechanisms import CATALOG, CLIENTS, NIGHTLY, gated, random_machine, with_elbows
from typer.testing import CliRunner

import pteron
from pteron.cli.main import app
from pteron.identification.excitation import (
    Conditioning,
    FourierMotion,
    Limits,
    conditioning,
    margins,
    optimal_excitation,
    random_excitation,
    scaled_condition,
    stacked_regressor,
)
from pteron.identification.excitation.conditioning import condition_with_penalty
from pteron.identification.excitation.limits import UNITS
from pteron.identification.excitation.random_motions import shrink_into_limits
from pteron.identification.excitation.search_program import measure
from pteron.identification.logs import read_log
from pteron.processes import LostWorkerError, WorkerPool

MACHINES = {
    **CATALOG,
    "quadrupteron +-+-": with_elbows(CATALOG["quadrupteron"], "+-+-"),
    "random 3T1R": random_machine(0, True),
    "random 3T": random_machine(0, False),
}
PLAIN = {"COLUMNS": "100", "NO_COLOR": "1", "FORCE_COLOR": None, "TTY_COMPATIBLE": None}

each_machine = pytest.mark.parametrize(
    "name",
    gated(["quadrupteron +-+-", "random 3T1R", "random 3T"], ["quadrupteron +-+-", "random 3T"]),
)
FAMILY = ["linear-delta", "five-bar", "3-rrr", "delta-4", "par4"]
each_space = pytest.mark.parametrize("space", ["platform", "joints"])


@lru_cache(maxsize=64)
def drawn(name: str, space: str, seed: int = 1) -> FourierMotion:
    return random_excitation(MACHINES[name], space=space, harmonics=2, period=4.0, seed=seed)


def forces_and_held(robot, state):
    """Return the forces in a motion, and those of rest in its poses: (2, T, n)."""
    moving = pteron.inverse_dynamics(robot, state.pose, state.velocity, state.acceleration)
    still = np.zeros_like(state.pose)
    return np.stack([moving, pteron.inverse_dynamics(robot, state.pose, still, still)])


@lru_cache(maxsize=8)
def small(criterion: str = "condition", space: str = "platform", robot: str = "tripteron"):
    """Return a search small enough for a test."""
    # One start may end in a local minimum: the Delta's best one gains 1.86, the next one 2.44.
    two = (criterion, space) == ("condition", "platform") and robot in ("tripteron", "delta")
    return optimal_excitation(
        machine(robot),
        space=space,
        harmonics=2,
        period=4.0,
        criterion=criterion,
        starts=2 if two else 1,
        draws=6,
        workers=1,
    )


# The motions


@each_space
@each_machine
def test_derivatives_are_those_of_finite_differences(name: str, space: str):
    motion = drawn(name, space)
    time = np.linspace(0.1, 3.7, 9)
    step = 1e-4
    before, now, after = (motion.at(time + k * step) for k in (-1, 0, 1))
    for value, rate in (("pose", "velocity"), ("velocity", "acceleration")):
        found = (getattr(after, value) - getattr(before, value)) / (2.0 * step)
        assert found == pytest.approx(getattr(now, rate), abs=1e-5)
    sliders = [motion.joints(time + k * step) for k in (-1, 0, 1)]
    for k in (0, 1):
        found = (sliders[2][k] - sliders[0][k]) / (2.0 * step)
        assert found == pytest.approx(sliders[1][k + 1], abs=1e-5)


@each_space
@each_machine
def test_platform_and_sliders_are_one_motion(name: str, space: str):
    robot, motion = MACHINES[name], drawn(name, space)
    time = np.linspace(0.0, 4.0, 23)
    state, (rho, drho, ddrho) = motion.at(time), motion.joints(time)
    assert pteron.inverse_kinematics(robot, state.pose) == pytest.approx(rho, abs=1e-12)
    rates = pteron.kinematics.joint_rates(robot, state.pose, state.velocity)
    seconds = pteron.kinematics.joint_accelerations(
        robot, state.pose, state.velocity, state.acceleration
    )
    assert rates.actuated == pytest.approx(drho, abs=1e-11)
    assert seconds.actuated == pytest.approx(ddrho, abs=1e-10)


@pytest.mark.parametrize("name", gated(FAMILY, ["3-rrr"]))
def test_every_machine_has_motions_that_keep_the_limits(name: str):
    limits = Limits(speed=2.0, acceleration=20.0, force=200.0)
    motion = random_excitation(CATALOG[name], harmonics=2, period=4.0, limits=limits, seed=1)
    found = margins(motion, limits)
    assert found.kept
    assert min(margin.least for margin in found) < 0.2
    if name in ("3-rrr", "par4"):
        with pytest.raises(pteron.DataError, match=r'"joints" given, .* closed form; choose "pl'):
            random_excitation(CATALOG[name], space="joints", harmonics=2, limits=limits)
    else:
        joints = random_excitation(
            CATALOG[name], space="joints", harmonics=2, period=4.0, limits=limits, seed=1
        )
        assert margins(joints, limits).kept


@CLIENTS
def test_rams_of_little_stroke_have_motions_too():
    """Some random centers keep the limits so barely that no motion about them does."""
    robot = pteron.load("rubin-m2-hexapod")
    motion = random_excitation(robot, harmonics=2, period=4.0, seed=1)
    assert margins(motion, Limits.of(robot)).kept
    poses = motion.at(np.linspace(0.0, 4.0, 50)).pose
    assert (np.ptp(poses, axis=0) > 1e-5).all()


@CLIENTS
@pytest.mark.parametrize("name", gated(["five-bar", "par4"]))
def test_a_motion_of_every_machine_can_be_improved(name: str):
    found = optimal_excitation(
        CATALOG[name],
        harmonics=3,
        period=3.0,
        limits=Limits(speed=6.0, acceleration=100.0),
        starts=1,
        draws=4,
        workers=1,
    )
    assert found.margins.kept
    assert found.gain > 1.2
    assert found.frame(100.0).columns[1:3] == ["theta1", "theta2"]


@each_space
def test_the_motion_is_periodic(space: str):
    motion = drawn("quadrupteron", space)
    one, next_one = motion.at(np.array([0.3, 1.0])), motion.at(np.array([4.3, 13.0]))
    assert one.pose == pytest.approx(next_one.pose, abs=1e-12)
    assert one.acceleration == pytest.approx(next_one.acceleration, abs=1e-11)


def test_the_other_assembly_mode_is_another_motion_of_the_same_sliders():
    motion = drawn("quadrupteron", "joints")
    other = replace(motion, mode=1 - motion.mode)
    time = np.array([0.2, 1.4])
    assert motion.joints(time)[0] == pytest.approx(other.joints(time)[0])
    assert np.abs(motion.at(time).pose - other.at(time).pose).max() > 1.0


def test_the_angle_does_not_jump_at_half_a_turn():
    robot = CATALOG["quadrupteron"]
    legs = tuple(
        replace(leg, platform_point=tuple(-x for x in leg.platform_point)) for leg in robot.legs
    )
    robot = replace(robot, legs=legs)
    center = np.array([0.0, 0.0, 0.0, np.pi])
    swing = 0.015 * np.random.default_rng(3).normal(size=(2, 2, 4))
    joints = pteron.inverse_kinematics(robot, center)
    motion = FourierMotion(
        robot,
        "joints",
        5.0,
        joints,
        *swing,
        mode=int(pteron.kinematics.assembly_mode(robot, center)),
    )
    angle = motion.at(motion.uniform_times(2000)).pose[:, 3]
    assert np.ptp(angle) > 0.1
    assert np.abs(np.diff(angle)).max() < 0.05


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"space": "sliders"}, "space: 'sliders'"),
        ({"period": 0.0}, "period: 0.0 s"),
        ({"sines": np.zeros((2, 3))}, "same number of harmonics"),
        ({"center": np.zeros(4)}, "center"),
        ({"cosines": np.zeros((0, 3)), "sines": np.zeros((0, 3))}, "at least one"),
    ],
)
def test_a_motion_that_is_none_is_refused(changes: dict, words: str):
    good = {
        "robot": CATALOG["tripteron"],
        "space": "platform",
        "period": 1.0,
        "center": np.zeros(3),
        "cosines": np.zeros((1, 3)),
        "sines": np.zeros((1, 3)),
    }
    with pytest.raises(pteron.DataError, match=words):
        FourierMotion(**(good | changes))


def test_sliders_without_a_pose_are_refused_with_the_time():
    motion = drawn("quadrupteron", "joints")
    wild = motion.with_coefficients(100.0 * motion.coefficients)
    with pytest.raises(pteron.UnreachablePose, match=r"time .* s: no pose"):
        wild.at(np.linspace(0.0, 4.0, 50))


# The limits


@each_space
@each_machine
def test_random_motions_keep_the_limits_and_are_as_large_as_they_allow(name: str, space: str):
    motion = drawn(name, space)
    limits = Limits()
    found = margins(motion, limits, 10_000)
    assert found.kept
    coefficients = motion.coefficients
    coefficients[1:] *= 1.05
    assert not margins(motion.with_coefficients(coefficients), limits).kept


@each_space
def test_margins_are_those_of_the_public_functions(space: str):
    robot, motion = CATALOG["quadrupteron"], drawn("quadrupteron", space)
    limits = Limits(speed=(0.5, 1.0, 1.5, 2.0), force=200.0)
    found = margins(motion, limits)
    assert [m.limit for m in found] == [
        *("type_i", "type_ii", "joint_clearance", "speed", "acceleration", "force")
    ]
    state = motion.at(motion.uniform_times(4000))
    forces = np.abs(forces_and_held(robot, state)).max(axis=0)
    assert found["force"].least == pytest.approx(200.0 - forces.max(), abs=0.05)
    speeds = np.abs(motion.joints(state.time)[1])
    assert found["speed"].least == pytest.approx((np.array(limits.speed) - speeds).min(), abs=1e-4)
    force = found["force"]
    at = motion.at(np.array([force.time]))
    there = np.abs(forces_and_held(robot, at)).max(axis=(0, 1))
    assert there[force.leg - 1] == pytest.approx(200.0 - force.least)


@pytest.mark.parametrize(
    ("limits", "space"),
    [
        (Limits(speed=0.05), "platform"),
        (Limits(acceleration=(0.3, 0.2, 0.1, 0.3)), "joints"),
        (Limits(type_i=0.9), "platform"),
        (Limits(type_ii=0.97), "joints"),
        (Limits(joint_clearance=0.28), "platform"),
        (Limits(force=31.4), "platform"),
    ],
)
def test_every_limit_binds_when_it_is_the_tight_one(limits: Limits, space: str):
    robot = CATALOG["quadrupteron"]
    motion = random_excitation(robot, space=space, harmonics=2, period=4.0, limits=limits)
    found = margins(motion, limits, 20_000)
    tight = next(name for name in UNITS if getattr(limits, name) != getattr(Limits(), name))
    assert found.kept
    size = {"joint_clearance": 0.3}.get(tight, 1.0)
    scale = getattr(limits, tight) if tight in ("speed", "force") else size
    assert found[tight].least < 0.01 * scale


@CLIENTS
@pytest.mark.parametrize(
    "search", gated([random_excitation, optimal_excitation], [optimal_excitation])
)
def test_passive_joints_and_phi_keep_their_limits(search):
    robot = CATALOG["par4"]
    given = {"limits": None, "platform_cone": pteron.legs.Cone((0.0, 0.0, 1.0), 1.3)}
    robot = replace(robot, legs=tuple(replace(leg, **given) for leg in robot.legs))
    limits, few = Limits(speed=10.0, acceleration=100.0, passive_clearance=0.55), {}
    if search is optimal_excitation:
        few = {"starts": 1, "draws": 4, "workers": 1, "criterion": "logdet"}
    found = search(robot, harmonics=2, period=2.0, limits=limits, **few)
    motion = getattr(found, "motion", found)
    pose = motion.at(motion.uniform_times(20_000)).pose
    shares = pteron.workspace.pose_margins(robot, pose).joints
    assert 0.55 <= shares.min() < 0.56
    assert np.abs(pose[:, 3]).max() < 0.45 * np.pi / 4
    found = margins(motion, limits)["passive_clearance"].least  # exact between the samples
    assert found == pytest.approx(shares.min() - 0.55, abs=1e-6)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"type_i": 0.999}, "limits: type_i of at least 0.999 is impossible: leg 3"),
        ({"joint_clearance": 0.4}, "limits: joint_clearance of at least 0.4 m is impossible"),
        ({"force": 20.0}, r"limits: force of at most 20.0 N is impossible: leg 1 .* 31.08"),
    ],
)
def test_limits_that_the_machine_cannot_keep_at_rest_are_named(given: dict, words: str):
    for search in (random_excitation, optimal_excitation):
        with pytest.raises(pteron.ModelError, match=words) as caught:
            search(CATALOG["quadrupteron"], limits=Limits(**given))
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"speed": 0.0}, "speed 0.0 given"),
        ({"speed": [1.0, -1.0, 1.0]}, "speed"),
        ({"acceleration": "fast"}, "acceleration 'fast'"),
        ({"force": float("nan")}, "force nan"),
        ({"type_i": 1.0}, "type_i 1 given"),
        ({"type_ii": -0.1}, "type_ii -0.1"),
        ({"joint_clearance": -1.0}, "joint_clearance -1"),
        ({"passive_clearance": 1.0}, "passive_clearance 1 given, at least 0 and below 1"),
    ],
)
def test_limits_that_are_none_are_refused(given: dict, words: str):
    with pytest.raises(pteron.DataError, match=words):
        Limits(**given)


def test_limits_for_another_number_of_sliders_are_refused():
    with pytest.raises(pteron.DataError, match="3 numbers for speed, one expected or 4"):
        random_excitation(CATALOG["quadrupteron"], limits=Limits(speed=(1.0, 1.0, 1.0)))


def test_a_motion_beyond_its_limits_is_shrunk_about_its_center_until_it_keeps_them():
    motion = drawn("tripteron", "platform")
    coefficients = motion.coefficients
    coefficients[1:] *= 1.5
    found = shrink_into_limits(motion.with_coefficients(coefficients), Limits())
    assert found.center == pytest.approx(motion.center)
    assert found.coefficients[1:] == pytest.approx(motion.coefficients[1:], rel=0.02)
    assert margins(found, Limits(), 20_000).kept


# How good a motion is


def test_the_scaled_condition_number_does_not_depend_on_units():
    matrix = np.random.default_rng(0).normal(size=(40, 5))
    assert scaled_condition(matrix * 10.0 ** np.arange(5)) == pytest.approx(
        scaled_condition(matrix)
    )
    assert scaled_condition(np.eye(4)) == 1.0
    assert scaled_condition(np.ones((4, 2))) == np.inf
    assert scaled_condition(np.diag([1.0, 0.0])) == np.inf


def test_a_column_that_is_short_beside_others_counts_as_so_much_worse():
    root = np.linalg.qr(np.random.default_rng(0).normal(size=(40, 5)), mode="r")
    assert condition_with_penalty(root, np.zeros(5)) == pytest.approx(scaled_condition(root))
    root /= np.linalg.norm(root, axis=0)
    found = condition_with_penalty(root * [1.0, 1.0, 1e-3, 1.0, 1.0], np.full(5, 0.1))
    expected = scaled_condition(root) * 1.01**2 * np.sqrt(1.0 + 1e4)
    assert found == pytest.approx(expected)


@CLIENTS
def test_a_motion_that_moves_everything_is_sought():
    # A turn of a hundredth of a radian shows the shaft's values as well as any, made length 1.
    limits = Limits(acceleration=40.0)
    found = optimal_excitation(
        "delta-4", harmonics=2, starts=2, draws=30, limits=limits, workers=1, seed=1
    )
    assert np.ptp(found.motion.at(found.motion.uniform_times(100)).pose[:, 3]) > 0.1


def test_conditioning_is_that_of_the_stacked_regressor():
    motion = drawn("quadrupteron", "joints")
    base = pteron.base_parameters(motion.robot)
    found = conditioning(motion, base, 120)
    matrix = stacked_regressor(motion, base, motion.uniform_times(120))
    state = motion.at(motion.uniform_times(120))
    forces = pteron.inverse_dynamics(motion.robot, state.pose, state.velocity, state.acceleration)
    assert matrix @ base.values() == pytest.approx(forces.ravel(), abs=1e-9)
    assert found.scaled == pytest.approx(scaled_condition(matrix), rel=1e-8)
    assert found.unscaled == pytest.approx(np.linalg.cond(matrix), rel=1e-8)
    assert found.nominal == pytest.approx(np.linalg.cond(matrix * base.values()), rel=1e-8)
    information = matrix.T @ matrix / 120
    assert found.logdet == pytest.approx(np.linalg.slogdet(information)[1], abs=1e-6)


@pytest.mark.parametrize("doublings", [0, 2, 4])
def test_the_measure_is_above_the_condition_number_by_no_more_than_it_says(doublings: int):
    matrix = np.random.default_rng(1).normal(size=(30, 6)) * 10.0 ** np.arange(6)
    symbol = ca.MX.sym("M", 6, 6)
    value = measure(symbol, "condition", doublings, [0.0])
    function = ca.Function("f", [symbol], [value, ca.gradient(value, symbol)])
    found, gradient = (np.array(x) for x in function(matrix.T @ matrix))
    exact = np.log(scaled_condition(matrix))
    assert exact <= found.item() <= exact + np.log(6) / 2**doublings
    step = 1e-6 * matrix.T @ matrix * np.random.default_rng(2).normal(size=(6, 6))
    step = step + step.T
    both = [float(function(matrix.T @ matrix + s * step)[0]) for s in (1.0, -1.0)]
    assert 0.5 * (both[0] - both[1]) == pytest.approx((gradient * step).sum(), rel=1e-5)


def test_the_measure_of_the_volume_is_the_log_det():
    matrix = np.random.default_rng(1).normal(size=(30, 6)) * 10.0 ** np.arange(6)
    found = ca.evalf(measure(ca.MX(ca.DM(matrix.T @ matrix)), "logdet", 0, [0.0]))
    assert float(found) == pytest.approx(-np.linalg.slogdet(matrix.T @ matrix)[1] / 6)


# The search


@pytest.mark.parametrize(
    ("robot", "space", "gain"),
    [
        pytest.param("tripteron", "platform", 2.0, marks=NIGHTLY),
        pytest.param("quadrupteron", "joints", 3, marks=NIGHTLY),
        pytest.param("delta", "platform", 2.0, marks=NIGHTLY),
        ("mixed", "joints", 3.0),
    ],
)
def test_the_search_finds_better_than_random_and_keeps_every_limit(robot, space, gain):
    found = small("condition", space, robot)
    assert found.gain > gain
    assert found.margins.kept
    assert margins(found.motion, found.limits, 40_000).kept
    assert found.conditioning == conditioning(found.motion, pteron.base_parameters(machine(robot)))
    assert found.draws == 6
    for start in found.starts:
        assert start.after.scaled <= start.before.scaled
    assert min(s.after.scaled for s in found.starts) == found.conditioning.scaled
    assert any(start.finished for start in found.starts)


@CLIENTS
def test_the_other_criterion_makes_the_volume_smaller():
    found = small("logdet")
    assert found.criterion == "logdet"
    assert found.conditioning.logdet > found.random.logdet + 1.0
    assert found.margins.kept


@CLIENTS
def test_a_search_on_oblique_axes_with_force_limits_keeps_them():
    robot = CATALOG["tripteron-oblique"]
    limits = Limits(speed=0.3, acceleration=1.5, force=(11.0, 24.0, 33.0))
    found = optimal_excitation(
        robot, harmonics=2, period=4.0, limits=limits, starts=1, draws=3, workers=1
    )
    assert found.gain > 1.2
    assert margins(found.motion, limits, 20_000).kept
    state = found.motion.at(found.motion.uniform_times(2000))
    forces = pteron.inverse_dynamics(robot, state.pose, state.velocity, state.acceleration)
    assert (np.abs(forces).max(axis=0) < limits.force).all()


@CLIENTS
def test_processes_find_the_same_as_this_one_and_so_does_the_seed_again():
    again = optimal_excitation(
        CATALOG["tripteron"], harmonics=2, period=4.0, starts=2, draws=6, workers=2
    )
    assert again.motion.coefficients == pytest.approx(small().motion.coefficients, abs=1e-9)
    assert [s.draw for s in again.starts] == [s.draw for s in small().starts]
    other = random_excitation(CATALOG["tripteron"], harmonics=2, seed=1)
    same = random_excitation(CATALOG["tripteron"], harmonics=2, seed=1)
    assert (other.coefficients == same.coefficients).all()


@CLIENTS
def test_starts_whose_processes_fail_are_improved_here():
    multiprocessing.set_executable("/bin/false")
    try:
        found = optimal_excitation(
            CATALOG["tripteron"], harmonics=2, period=4.0, starts=2, draws=6, workers=2, seconds=3.0
        )
    finally:
        multiprocessing.set_executable(sys.executable)
    assert found.gain > 1.5


@pytest.mark.parametrize("error", [OSError("handle is closed"), ValueError("bad fds_to_keep")])
def test_a_pool_that_breaks_while_a_process_starts_has_lost_a_worker(error, monkeypatch):
    def submit(*_):
        raise error

    monkeypatch.setattr(ProcessPoolExecutor, "submit", submit)
    with pytest.raises(LostWorkerError), WorkerPool(2, script=False) as pool:
        pool.start(print)


@CLIENTS
def test_an_interrupt_ends_the_processes_too():
    shares = []

    def progress(share: float) -> None:
        shares.append(share)
        if share > 0.1:
            raise KeyboardInterrupt

    found = optimal_excitation(
        CATALOG["tripteron"],
        harmonics=2,
        period=4.0,
        starts=2,
        draws=2,
        workers=2,
        progress=progress,
    )
    assert found.interrupted
    assert found.seconds < 30.0
    assert found.margins.kept


@pytest.mark.parametrize("share", [0.02, 0.3])
def test_an_interrupt_keeps_the_best_until_then(share: float):
    seen = []

    def progress(done: float) -> None:
        seen.append(done)
        if done >= share:
            raise KeyboardInterrupt

    found = optimal_excitation(
        CATALOG["tripteron"],
        harmonics=2,
        period=4.0,
        starts=2,
        draws=6,
        workers=1,
        progress=progress,
    )
    assert found.interrupted
    assert found.margins.kept
    assert found.conditioning.scaled <= found.random.scaled
    assert (found.gain > 1.0) == (share > 0.1)
    assert seen == sorted(seen)


@CLIENTS
@pytest.mark.timeout(120)
def test_an_interrupt_during_the_program_ends_it_at_once():
    robot = CATALOG["quadrupteron"]
    interrupted = []

    def progress(share: float) -> None:
        if share >= 0.1 and not interrupted:
            interrupted.append(share)
            main = threading.main_thread().ident
            threading.Timer(1.0, signal.pthread_kill, (main, signal.SIGINT)).start()

    found = optimal_excitation(robot, starts=2, draws=2, workers=1, seconds=1e4, progress=progress)
    assert found.interrupted


@CLIENTS
def test_time_cuts_the_search_and_a_result_is_there_all_the_same():
    found = optimal_excitation(CATALOG["quadrupteron"], seconds=0.5, draws=50, workers=1)
    # A choice of ten motions at least; one was tried on a machine that was busy.
    assert 10 <= found.draws <= 50
    assert found.margins.kept
    assert f"{found.draws} random motions drawn" in found.progress_text
    assert f"condition number {found.conditioning.scaled:.3g}" in found.progress_text


def test_a_motion_that_would_not_identify_the_machine_is_said_to():
    """With one harmonic some parameters all but depend on others."""
    found = optimal_excitation(
        CATALOG["tripteron"], harmonics=1, starts=1, draws=10, workers=1, seconds=1.0
    )
    bad = replace(found, conditioning=replace(found.conditioning, scaled=6165.0))
    assert "does not identify all base parameters" in bad.progress_text
    assert "--shared" in bad.progress_text
    good = replace(found, conditioning=replace(found.conditioning, scaled=50.0))
    assert "leaves" not in good.progress_text


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"criterion": "trace"}, "criterion: 'trace'"),
        ({"starts": 0}, "starts: 0"),
        ({"draws": 0}, "draws: 0"),
        ({"workers": 0}, "workers: 0"),
        ({"seconds": -1.0}, "seconds: -1"),
        ({"harmonics": 0}, "harmonics: 0"),
        ({"space": "sliders"}, "space: 'sliders'"),
    ],
)
def test_what_the_search_cannot_do_is_refused(given: dict, words: str):
    with pytest.raises(pteron.DataError, match=words):
        pteron.identification.optimal_excitation(CATALOG["tripteron"], **given)


# What is written


@CLIENTS
def test_the_table_for_the_controller(tmp_path: Path):
    found = small()
    robot = found.motion.robot
    path = found.write_csv(tmp_path / "motion.csv", rate=50.0, periods=2)
    frame = pl.read_csv(path)
    legs, pose = range(1, 4), robot.coordinates
    assert frame.columns == [
        "t",
        *(f"rho{i}" for i in legs),
        *pose,
        *(f"drho{i}" for i in legs),
        *(f"ddrho{i}" for i in legs),
        *(f"d{c}" for c in pose),
        *(f"dd{c}" for c in pose),
        *(f"force{i}" for i in legs),
    ]
    assert len(frame) == 801  # two periods of 4 s, and a lead of one before and behind
    assert frame["t"].to_numpy() == pytest.approx(np.arange(801) / 50.0)
    state = [frame.select([f"{d}{c}" for c in pose]).to_numpy() for d in ("", "d", "dd")]
    forces = frame.select([f"force{i}" for i in legs]).to_numpy()
    assert pteron.inverse_dynamics(robot, *state) == pytest.approx(forces)
    rho = frame.select([f"rho{i}" for i in legs]).to_numpy()
    assert pteron.inverse_kinematics(robot, state[0]) == pytest.approx(rho)
    assert rho[200:400] == pytest.approx(rho[400:600])
    text = tomllib.loads(found.write_toml(tmp_path / "motion.toml", periods=2).read_text())
    assert text["motion"] == {"period": 4.0, "start": 4.0, "end": 12.0, "assembly_mode": 1}


@pytest.mark.parametrize(
    ("given", "words"),
    [({"rate": 0.0}, "rate: 0"), ({"periods": 0}, "periods: 0"), ({"rate": 0.01}, "0 samples")],
)
def test_a_table_without_samples_is_refused(given: dict, words: str, tmp_path: Path):
    with pytest.raises(pteron.DataError, match=words):
        small().write_csv(tmp_path / "motion.csv", **given)
    assert not list(tmp_path.iterdir())


def run(line: str):
    return CliRunner(env=PLAIN).invoke(app, line.split())


QUICK = "--harmonics 2 --period 4 --starts 1 --draws 4 --workers 1"


@CLIENTS
def test_the_command_writes_both_files_and_a_table(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run(f"excite tripteron {QUICK} --out motion.csv --rate 100")
    assert (result.exit_code, result.stderr) == (0, "")
    for words in (
        "best of 4 random",
        "scaled to length 1",
        "type-I measure",
        "speed (m/s)",
        "motion.toml",
    ):
        assert words in result.stdout
    assert len(pl.read_csv("motion.csv")) == 2001
    # What belongs to the logs of the motions is understood where logs are read.
    about = read_log("motion.csv", pteron.load("tripteron")).description
    assert (about.period, about.start, about.end) == (4.0, 4.0, 16.0)
    held_out = read_log("motion-held-out.csv", pteron.load("tripteron"))
    assert held_out.description.period is None
    assert held_out.duration >= 10.0


@CLIENTS
def test_the_command_says_what_it_leaves_out(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # A base parameter of the five-bar is 0: its column has no nominal size.
    result = run(f"excite five-bar {QUICK} --seconds 0.5")
    assert result.exit_code == 0
    assert result.stderr == ("Note: no file will be written; --out FILE.csv saves the motion\n")
    assert "inf" not in result.stdout
    assert "nan" not in result.stdout
    assert "nominal value is 0" in " ".join(result.stdout.split())
    assert not list(tmp_path.iterdir())
    found = json.loads(run(f"excite five-bar {QUICK} --seconds 0.5 --json").stdout)
    assert found["conditioning"]["nominal"] is None


@CLIENTS
def test_the_command_prints_json(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run(f"excite quadrupteron {QUICK} --space joints --seconds 1 --elbows +-+- --json")
    assert (result.exit_code, result.stderr) == (0, "")
    found = json.loads(result.stdout)
    assert found["conditioning"]["scaled"] <= found["random"]["scaled"]
    assert np.shape(found["motion"]["cosines"]) == (2, 4)
    assert found["limits"]["type_i"] == 0.25
    assert all(margin["least"] >= 0.0 for margin in found["margins"])
    assert found["files"] == []
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("excite tripteron --out there/motion.csv", "no folder there"),
        (
            "excite tripteron --type-i 0.9999 --out motion.csv",
            "type_i of at least 0.9999 is impossible",
        ),
        ("excite tripteron --speed -1", "speed -1"),
        ("excite tripteron --period -1", "period: -1"),
        ("excite tripteron --space sliders", "'sliders' is not one of"),
    ],
)
def test_the_command_refuses_in_one_line(line: str, words: str, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run(line)
    assert result.exit_code == 2
    assert words in result.stderr
    assert result.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_help_has_an_example_in_60_columns():
    result = CliRunner(env=PLAIN | {"COLUMNS": "60"}).invoke(app, ["excite", "--help"])
    assert "pteron excite quadrupteron --out exciting.csv" in result.stdout
    assert max(map(len, result.stdout.splitlines())) <= 60


def test_worst_is_the_answer_where_the_machine_cannot_be():
    motion = drawn("quadrupteron", "joints")
    wild = motion.with_coefficients(100.0 * motion.coefficients)
    base = pteron.base_parameters(motion.robot)
    assert conditioning(wild, base) == Conditioning(np.inf, np.inf, np.inf, -np.inf)
    assert not margins(wild, Limits()).kept
