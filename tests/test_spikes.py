"""Spikes in logs: groups of samples are found and left out; what a machine does is no spike."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from logs_of_motions import Friction, log_of, machine, motion, truth

import pteron
from pteron.identification import Processing, Terms, identification_model
from pteron.identification.estimators import weighted_least_squares
from pteron.identification.logs import Log, open_log, read_log, write_log
from pteron.identification.logs.spikes import force_spikes, joint_spikes
from pteron.identification.observation import observations_of
from pteron.identification.signals import preprocessing_for_log

log_of = partial(log_of, rate=500.0)  # rows are counted here

MACHINES = ("quadrupteron", "delta", "par4", "five-bar")
each_machine = pytest.mark.parametrize("name", MACHINES)


def stopped(time, at, within):
    """Return place, speed and acceleration along a path that stops: an emergency stop."""
    u = np.clip((time - at) / within, 0.0, 1.0)
    place = np.where(time < at, time, at + within * (u - u * u / 2.0))
    braking = (time >= at) & (time < at + within)
    return place, np.where(time < at, 1.0, 1.0 - u), np.where(braking, -1.0 / within, 0.0)


def started(time, period, ramp):
    """Return the same of moves with ramps, and rests between them."""
    phase = time % period
    speed = 2.0 * np.clip(np.minimum(phase, period / 2.0 - phase) / ramp, 0.0, 1.0)
    step = time[1] - time[0]
    return np.cumsum(speed) * step, speed, np.gradient(speed, step)


def correct(name, seed):
    """Return joints and forces of a correct log: fast moves, stops, rests, friction, noise."""
    rng, robot = np.random.default_rng(seed), machine(name)
    rate, rows = float(rng.choice([100.0, 250.0, 1000.0])), 1000
    time = np.arange(rows) / rate
    path = time, np.ones(rows), np.zeros(rows)
    if seed % 3 == 1:
        within = float(rng.choice([0.02, 0.05, 0.2]))
        path = stopped(time, rng.uniform(0.3, 0.7) * time[-1], within)
    elif seed % 3 == 2:
        path = started(time, float(rng.choice([1.0, 2.0])), 0.1)
    speed, braking = path[1][:, None], path[2][:, None]
    shape = {"period": float(rng.choice([1.0, 2.0, 4.0])), "harmonics": int(rng.integers(1, 7))}
    size = float(rng.choice([0.005, 0.02]))
    pose, velocity, acceleration = motion(robot, path[0], seed=seed, size=size, **shape)
    acceleration = acceleration * speed**2 + velocity * braking
    velocity = velocity * speed
    joints = pteron.inverse_kinematics(robot, pose)
    forces = pteron.inverse_dynamics(robot, pose, velocity, acceleration)
    friction = Friction.of(joints.shape[1])
    rates = pteron.kinematics.joint_rates(robot, pose, velocity).actuated
    forces = forces + float(rng.choice([0.0, 1.0, 5.0])) * friction.forces(rates)
    joints = joints + float(rng.choice([0.0, 1e-6, 1e-5])) * rng.normal(size=joints.shape)
    forces = forces + float(rng.choice([0.0, 0.1, 1.0])) * rng.normal(size=forces.shape)
    return joints, np.round(forces, 1) if seed % 2 else forces


@each_machine
def test_no_correct_log_is_accused(name):
    accused = []
    for seed in range(6):
        joints, forces = correct(name, seed)
        if any(joint_spikes(column).any() for column in joints.T) or any(
            force_spikes(column, joints, j).any() for j, column in enumerate(forces.T)
        ):
            accused.append(seed)
    assert accused == []


def put_in(values, rows, size):
    """Return values that are off by a size in groups of rows, and which these are."""
    off = np.zeros(len(values), dtype=bool)
    for first, stop in rows:
        off[first:stop] = True
    return np.where(off, values + size, values), off


GROUPS = ((500, 504), (1203, 1204), (3000, 3009), (3990, 3994))


@each_machine
@pytest.mark.parametrize("noise", [0.0, 1e-5])
def test_groups_of_samples_are_found_to_the_row(name, noise):
    log = log_of(machine(name), size=0.02, joint_noise=noise, force_noise=0.2)
    size = 0.02 if log.symbols[0].unit == "m" else 0.05
    for j in range(log.joints.shape[1]):
        for sign in (1.0, -1.0):
            values, off = put_in(log.joints[:, j], GROUPS, sign * size)
            np.testing.assert_array_equal(joint_spikes(values), off)
        # Where friction turns or the motion jerks, no force is a spike.
        values, off = put_in(log.forces[:, j], GROUPS, 3.0 * np.ptp(log.forces[:, j]))
        np.testing.assert_array_equal(force_spikes(values, log.joints, j), off)


def test_a_dropout_to_zero_is_found():
    log = log_of(machine("quadrupteron"))
    values = log.joints[:, 0].copy()
    moves = np.argmax(np.abs(values))
    values[moves : moves + 4] = 0.0
    assert np.flatnonzero(joint_spikes(values)).tolist() == list(range(moves, moves + 4))


def test_a_step_is_no_spike():
    log = log_of(machine("delta"))
    values = log.joints[:, 0].copy()
    values[1000:] += 0.05
    assert not joint_spikes(values).any()


def save(log: Log, path: Path, changes: dict[str, np.ndarray]) -> Path:
    frame = pl.read_csv(write_log(log, path))
    frame.with_columns(pl.Series(name, values) for name, values in changes.items()).write_csv(path)
    return path


def test_spikes_are_left_out_like_gaps_and_their_rows_are_named(tmp_path):
    robot = machine("tripteron")
    log = log_of(robot, joint_noise=1e-7)
    joint, off = put_in(log.joints[:, 1], GROUPS, 0.02)
    force, also = put_in(log.forces[:, 2], [(2000, 2004)], 500.0)
    path = save(log, tmp_path / "a.csv", {"rho2": joint, "force3": force})
    back = read_log(path, robot)
    kept = np.flatnonzero(~(off | also))
    np.testing.assert_array_equal(back.rows_in_file, kept)
    np.testing.assert_array_equal(back.joints, log.joints[kept])
    assert len(back.segments) == 6
    assert back.place(600) == f"{path}: row {kept[600] + 1}"
    assert back.part(600, 700).place(0) == back.part(0, 700).place(600) == back.place(600)
    first, second = back.findings
    assert (first.kind, first.row, first.column, first.count) == ("spike", 501, "rho2", 18)
    assert "rows 501 to 504, 1204, 3001 to 3009, 3991 to 3994, column rho2" in first.message
    assert "left out like a gap, not repaired" in first.message
    assert (second.row, second.column, second.count) == (2001, "force3", 4)


def test_spikes_on_the_borders_of_pieces_are_found(tmp_path):
    robot = machine("tripteron")
    log = log_of(robot)
    joint, off = put_in(log.joints[:, 1], [(998, 1002), (2000, 2004)], 0.02)
    path = save(log, tmp_path / "a.csv", {"rho2": joint})
    file = open_log(path, robot)
    file.rows_in_piece = 1000
    pieces = list(file.pieces())
    found = np.concatenate([piece.time for piece in pieces])
    np.testing.assert_array_equal(found, log.time[~off])
    assert file.findings[0].count == 8
    assert "rows 999 to 1002, 2001 to 2004" in file.findings[0].message.replace(
        "1000, 1001 to ", ""
    )


def test_too_many_spikes_are_said_and_left_in(tmp_path):
    robot = machine("tripteron")
    log = log_of(robot)
    groups = [(k, k + 4) for k in range(100, 3900, 100)]
    force, off = put_in(log.forces[:, 0], groups, 500.0)
    assert off.mean() > 0.01
    path = save(log, tmp_path / "a.csv", {"force1": force})
    back = read_log(path, robot)
    assert back.rows == log.rows
    assert "left in, for over 1% of the rows are spikes" in back.findings[0].message


@pytest.mark.parametrize("period", [None, 4.0])
def test_what_is_identified_does_not_suffer(tmp_path, period):
    robot = machine("tripteron")
    log = log_of(robot, joint_noise=1e-6, force_noise=0.1)
    joint, _ = put_in(log.joints[:, 1], [(1500, 1504), (2600, 2604)], 0.02)
    force, _ = put_in(log.forces[:, 0], [(700, 704)], 300.0)
    path = save(log, tmp_path / "a.csv", {"rho2": joint, "force1": force})
    back = read_log(path, robot)
    raw = replace(
        log,
        joints=np.column_stack([log.joints[:, 0], joint, log.joints[:, 2:]]),
        forces=np.column_stack([force, log.forces[:, 1:]]),
    )
    model = identification_model(robot, Terms())

    def worst(one):
        preprocessing = preprocessing_for_log(robot, one, Processing(period=period))
        found = weighted_least_squares(observations_of(model, one, preprocessing))
        return np.abs(found.values - truth(model)).max(), np.abs(
            (found.values - truth(model)) / found.deviations
        ).max()

    assert worst(back)[1] < 5.0
    assert worst(log)[1] < 5.0
    assert worst(raw)[0] > 3.0 * worst(back)[0]
