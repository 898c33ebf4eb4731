"""Faults that are told by name, or told to be beyond what a log can show."""

import json
from dataclasses import replace

import numpy as np
import pytest
from faulty_logs import RATE, brisk, clean, found, late_by, noisy
from logs_of_motions import log_of
from mechanisms import CLIENTS, gated
from scipy.interpolate import make_interp_spline

import pteron
from pteron.controllers import ComputedTorque, FeedForwardPD
from pteron.identification import (
    FaultIsolation,
    Limits,
    Log,
    LogError,
    Processing,
    Terms,
    identify,
    random_excitation,
)
from pteron.identification.logs import Description, KnownPayload
from pteron.identification.verdict import verdict_of
from pteron.legs import Drive, Elastic
from pteron.motion import simulate, with_payload


def refused(robot, log, reason, *words):
    with pytest.raises(LogError) as caught:
        found(robot, log)
    assert caught.value.reason == reason
    for word in words:
        assert word in str(caught.value)
    return str(caught.value)


# What columns show by themselves ---------------------------------------------------------------


def test_forces_that_never_change_are_refused_in_one_line():
    robot, log, _ = clean("delta")
    forces = noisy(log).forces.copy()
    forces[:, 1] = 3.0
    refused(robot, replace(log, forces=forces), "constant", "torque2 is 3 throughout")
    text = refused(robot, replace(log, forces=np.full_like(forces, -2.0)), "constant")
    assert all(f"torque{k} is -2 throughout" in text for k in (1, 2, 3))


@pytest.mark.parametrize(
    ("name", "said"), [("delta", "theta2 jumps by 6.28"), ("linear-delta", "rho2 ")]
)
def test_an_encoder_that_wraps_is_named(name, said):
    robot, log, _ = clean(name)
    joint = log.joints[:, 1]
    turn = 2.0 * np.pi if name == "delta" else 1.1 * np.ptp(joint)
    joints = log.joints.copy()
    joints[:, 1] = np.mod(joint - joint.mean(), turn)
    refused(robot, noisy(replace(log, joints=joints)), "wrapped", said, "wraps", "unwrap")


def test_a_wild_sample_of_a_joint_is_no_wrap():
    robot, log, _ = clean("linear-delta")
    joints = log.joints.copy()
    joints[500:503, 0] += 1.5 * np.ptp(joints[:, 0])
    assert found(robot, replace(log, joints=joints)).fault_isolation.tried


def test_drives_at_their_limit_are_named():
    robot, log, _ = clean("delta")
    log = noisy(log)
    low, high = log.forces.min(axis=0), log.forces.max(axis=0)
    clipped = np.clip(log.forces, 0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high)
    result = found(robot, replace(log, forces=clipped))
    assert result.verdict.grade != "trustworthy"
    assert "torque1 stays at its largest value" in result.causes[0]
    assert "saturation" in result.causes[0]
    assert result.causes[0] in result.verdict.reasons


def test_a_coarse_channel_is_not_at_its_limit():
    robot, log, _ = clean("delta", dry=0.2)
    log = noisy(log, noise=0.003)
    step = 0.005 * np.ptp(log.forces, axis=0)
    result = found(robot, replace(log, forces=np.round(log.forces / step) * step))
    assert not any("stays at its" in reason for reason in result.verdict.reasons)


# What repairs are proposed ---------------------------------------------------------------------


def test_gravity_that_points_the_other_way_is_named():
    robot, log, _ = clean("delta")
    fallen = replace(robot, gravity=tuple(-g for g in robot.gravity))
    text = refused(fallen, noisy(log), "contradicted", "Gravity is along -z", "machine's file")
    assert "gravity = [0, 0, -9.81]" in text


@pytest.mark.parametrize("flipped", gated([1, 3], [3]))
def test_one_flipped_force_is_one_flipped_force(flipped):
    robot, log, _ = clean("delta-4")
    log = noisy(log)
    signs = np.ones(4)
    signs[flipped] = -1.0
    text = refused(robot, replace(log, forces=signs * log.forces), "columns")
    assert f"torque{flipped + 1} has the sign flipped: " in text
    assert sum(f"torque{k}" in text for k in (1, 2, 3, 4)) == 1


def test_swapped_positions_and_what_is_equivalent_are_told():
    robot, log, _ = clean("delta-4")
    log = noisy(log)
    text = refused(robot, replace(log, joints=log.joints[:, [1, 0, 2, 3]]), "columns")
    assert "theta1 and theta2 are swapped" in text
    assert "torque1 and torque2 are swapped" in text
    assert "as well explained: " in text
    # Either way leads to a machine that exists.
    mended = found(
        robot, replace(log, joints=log.joints[:, [1, 0, 2, 3]], forces=log.forces[:, [1, 0, 2, 3]])
    )
    assert mended.verdict.grade == "trustworthy"
    assert mended.consistency.feasible


def test_legs_that_are_exchanged_are_called_so():
    robot, log, _ = clean("quadrupteron")
    log = noisy(log)
    order = [1, 0, 2, 3]
    other = replace(log, joints=log.joints[:, order], forces=log.forces[:, order])
    refused(robot, other, "columns", "leg 1 and leg 2 are exchanged, forces and joints alike")


# Scales of all forces and of time --------------------------------------------------------------


def with_phases(name, mass, **about):
    """Return a machine and its log without and with a payload."""
    robot, log, friction = clean(name)
    loaded = log_of(with_payload(robot, mass), friction=friction, **brisk(robot))
    rows = log.rows
    both = replace(
        log,
        time=np.arange(2 * rows) / RATE,
        joints=np.concatenate([log.joints, loaded.joints]),
        forces=np.concatenate([log.forces, loaded.forces]),
        payload=np.repeat([0, 1], rows),
        description=Description(**about),
    )
    return robot, noisy(both)


@CLIENTS
def test_a_factor_of_all_forces_is_told_by_a_known_payload():
    robot, log = with_phases("delta", 1.5, payload=KnownPayload(1.5))
    terms = Terms(payload=True)
    right = found(robot, log, terms=terms)
    assert right.verdict.grade == "trustworthy"
    assert "gain" not in (
        *right.fault_isolation.hidden,
        *(one.fault for one in right.fault_isolation.faults),
    )
    more = found(robot, replace(log, forces=1.1 * log.forces), terms=terms)
    (gain,) = more.fault_isolation.faults
    assert gain.fault == "gain"
    assert gain.sizes[0] == pytest.approx(0.1, abs=0.02)
    assert "All forces are" in gain.message
    assert more.verdict.grade != "trustworthy"


def test_a_factor_of_all_forces_that_no_log_can_show_is_said():
    robot, log, _ = clean("delta")
    result = identify(robot, replace(noisy(log), forces=0.5 * noisy(log).forces))
    assert result.fault_isolation.hidden[0] == "gain"
    # The log alone cannot; beside the drawing a half is no chance, and 5 % may be the drawing's.
    assert result.causes[0].startswith("All forces of the bodies are 0.5 times those of the draw")
    assert result.verdict.grade == "usable with care"
    five = identify(robot, replace(noisy(log), forces=1.05 * noisy(log).forces))
    assert "cannot show a common factor of all forces" in five.verdict.reasons[0]
    assert five.verdict.grade == "trustworthy"


@pytest.mark.parametrize("name", ["delta", "five-bar"])
def test_a_slow_clock_is_named_where_weight_tells_it(name):
    robot, log, _ = clean(name)
    result = found(robot, noisy(replace(log, time=0.97 * log.time)))
    named = {one.fault: one for one in result.fault_isolation.faults}
    if name == "five-bar":
        assert "clock" in result.fault_isolation.hidden
        first = result.verdict.reasons[0]
        assert first.startswith("These logs cannot show")
        assert "clock that runs too" in first
        return
    assert "clock" not in result.fault_isolation.hidden
    assert 1.0 + named["clock"].sizes[0] == pytest.approx(0.97**-2, abs=0.03)
    assert "clock ran" in named["clock"].message
    assert result.verdict.grade != "trustworthy"


@pytest.mark.parametrize("name", gated(["3-rpr", "stewart"], ["3-rpr"]))
def test_rotors_that_the_model_lacks_are_named_and_no_slow_clock_is_taken_for_them(name):
    """A ram turns with its leg: no other value takes in a motor's inertia, as a slider's mass does.

    Seen as weight that is too small for the inertia, it was called a clock that runs fast.
    """
    robot, log, _ = clean(name)
    curve = make_interp_spline(log.time, log.joints, k=7)
    growth = curve(log.time, 2)
    inertia = 0.5 * log.forces.std(axis=0) / growth.std(axis=0)
    result = found(robot, noisy(replace(log, forces=log.forces + inertia * growth)))
    first = result.fault_isolation.faults[0]
    assert first.fault == "rotors"
    assert first.matters
    np.testing.assert_allclose(first.sizes, inertia, atol=5.0 * first.deviations.max())
    assert "--rotors adds it" in first.message
    with_them = found(robot, noisy(log), terms=Terms(rotors=True))
    assert "rotors" not in with_them.fault_isolation.tried
    slow = found(robot, noisy(replace(log, time=0.97 * log.time)))
    assert "rotors" not in {one.fault for one in slow.fault_isolation.faults}


def test_rotors_heavier_than_what_is_there_are_not_trusted():
    robot, log, _ = clean("delta")
    about = Description(rotor_inertia=(5e-4,) * 3, ratio=(50.0,) * 3)
    result = identify(robot, noisy(replace(log, description=about)))
    assert result.consistency.distance > 5.0
    assert result.verdict.grade == "not trustworthy"
    assert result.verdict.reasons[1].startswith("No real bodies have these values")


# Where fault isolation is run ------------------------------------------------------


@CLIENTS
def test_play_is_named_where_a_drives_load_changes_direction(monkeypatch):
    """One encoder a drive, at the motor: the same drives without play are not accused of it."""
    monkeypatch.delenv("PTERON_KERNELS", raising=False)  # drives that bend take short steps
    drawn = pteron.load("five-bar")
    series = random_excitation(drawn, limits=Limits(2.0, 10.0, type_i=0.3), seed=0)
    motion = series.at(np.arange(5001) / 1000.0)
    rng = np.random.default_rng(0)
    named = {}
    for play in (0.0, 2e-3):
        # Rotors about as heavy as the machine at its joints, which swing at 50 Hz.
        soft = Elastic(3e-3 * (2.0 * np.pi * 50.0) ** 2, 0.6, backlash=play)
        drive = Drive(rotor_inertia=3e-3, elastic=soft)
        built = replace(drawn, legs=tuple(replace(leg, drive=drive) for leg in drawn.legs))
        run = simulate(built, motion, FeedForwardPD())
        size = 0.01 * np.sqrt((run.forces**2).mean(axis=0))
        forces = run.forces + size * rng.normal(size=run.forces.shape)
        result = identify(drawn, Log("log.csv", run.time, run.motors, forces))
        named[play] = result.fault_isolation.faults
    assert not any(one.fault == "play" for one in named[0.0])
    first = named[2e-3][0]
    assert first.fault == "play"
    assert first.matters
    assert first.labels == ("torque1", "torque2")
    assert "where the load changes direction" in first.message
    json.dumps(first.as_dict(), allow_nan=False)


@CLIENTS
def test_a_fault_shows_in_a_log_with_two_phases_too_long_to_be_looked_at_whole():
    robot, log = with_phases("five-bar", 0.02)
    late = replace(log, forces=late_by(log, 6e-3))
    rows = np.r_[np.tile(np.arange(2400), 5), np.tile(np.arange(2400, 4800), 5)]
    late = replace(
        late,
        time=np.arange(len(rows)) / RATE,
        joints=late.joints[rows],
        forces=late.forces[rows],
        payload=late.payload[rows],
    )
    result = found(robot, late, terms=Terms(payload=True))
    assert result.fault_isolation.tried
    assert "late for the positions; that is taken out" in result.causes[0]
    assert result.preprocessing[0].delay == pytest.approx(6e-3, abs=5e-4)
    mended = found(robot, late, terms=Terms(payload=True), processing=Processing(delay="auto"))
    assert mended.preprocessing[0].delay == pytest.approx(6e-3, abs=5e-4)


@CLIENTS
def test_a_fault_shows_that_is_in_the_second_log_alone():
    robot, log, friction = clean("delta")
    other = log_of(robot, friction=friction, seed=5, **brisk(robot))
    late = noisy(replace(other, source="late.csv", forces=late_by(other, 8e-3)), seed=1)
    result = found(robot, [noisy(log), late])
    assert result.fault_isolation.faults[0].matters
    assert result.verdict.grade != "trustworthy"


def test_where_fault_isolation_was_not_run_nothing_is_trusted():
    robot, log, _ = clean("delta")
    held = found(robot, noisy(log)).held_out
    nothing = np.full(3, np.nan)
    verdict = verdict_of(held, FaultIsolation((), (), nothing, nothing, "too short"), repeats=False)
    assert verdict.grade == "usable with care"
    assert "Fault isolation was not run: too short." in verdict.reasons


def motion_of(robot):
    return {key: value for key, value in brisk(robot).items() if key not in ("duration", "rate")}


# Without noise ---------------------------------------------------------------------------------


def held(name):
    """Return a machine, its log as `pteron simulate` writes it, half a step late, and friction."""
    robot, log, friction = clean(name)
    later = log_of(robot, time=log.time + 0.5 / RATE, friction=friction, **motion_of(robot))
    return robot, replace(log, forces=later.forces), friction


@CLIENTS
@pytest.mark.parametrize("name", gated(["delta", "par4"]))
def test_forces_held_from_sample_to_sample_are_no_fault_and_spoil_no_value(name):
    robot, log, friction = held(name)
    result = found(robot, log)
    assert result.verdict.grade == "trustworthy"
    assert not result.fault_isolation.faults
    assert not result.has_understated_errors
    assert result.unknowns.delay == pytest.approx(-0.5 / RATE, rel=1e-3)
    words = f"The positions are half a sample ({500.0 / RATE:.3g} ms) late for the forces"
    assert any(note.startswith(words) for note in result.notes)
    # What is left of the errors is next to nothing of what the delay makes when it is left in.
    left_in = found(robot, log, processing=Processing(delay=0.0))
    true = np.r_[result.model.base.values(robot), friction.values]
    off, spoiled = (np.abs(one.estimate.values - true) for one in (result, left_in))
    assert off.max() < 0.02 * spoiled.max()


@CLIENTS
def test_half_a_sample_that_noise_shows_as_a_little_more_is_taken_out_all_the_same():
    """0.6 of a sample, two tenths uncertain, was called a delay, and lowered the grade."""
    robot, log, _ = held("delta")
    size = 0.08 * np.sqrt((log.forces**2).mean(axis=0))
    noise = size * np.random.default_rng(2).normal(size=log.forces.shape)
    log = replace(log, forces=log.forces + noise)
    left_in = found(robot, log, processing=Processing(delay=0.0))
    assert left_in.fault_isolation.faults[0].sizes[0] * RATE == pytest.approx(-0.633, abs=0.01)
    result = found(robot, log)
    assert result.unknowns.delay < 0.0
    assert not result.fault_isolation.faults


@pytest.mark.parametrize("name", gated(["delta", "par4"], ["delta"]))
def test_a_delay_of_held_forces_that_is_left_in_marks_the_intervals(name):
    robot, log, _ = held(name)
    result = found(robot, log, processing=Processing(delay=0.0))
    assert [one.fault for one in result.fault_isolation.faults] == ["delay"]
    assert "half a sample" in result.fault_isolation.faults[0].message
    assert result.verdict.grade == "trustworthy"
    assert not result.fault_isolation.matters
    assert result.has_understated_errors
    assert "The stated errors of the values do not allow for that." in result.verdict.reasons


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_no_delay_is_taken_out_of_a_log_that_has_none(noise):
    robot, log, _ = clean("delta")
    result = found(robot, noisy(log, noise=noise) if noise else log)
    assert result.unknowns.delay == 0.0
    assert not result.notes
    assert not any(said.startswith("Friction is below zero") for said in result.verdict.reasons)


@pytest.mark.parametrize("gentle", [True, False])
def test_play_cannot_be_told_where_no_load_changes_its_direction(gentle):
    """The arms of a Delta carry its platform all the while, unless it moves fast."""
    robot = pteron.load("delta")
    limits = Limits(1.0, 4.0, type_i=0.3) if gentle else Limits(6.0, 80.0)
    series = random_excitation(robot, limits=limits, period=4.0, seed=3)
    motion = series.at(np.arange(4001) / 500.0)
    forces = pteron.inverse_dynamics(robot, motion.pose, motion.velocity, motion.acceleration)
    forces += 1e-3 * forces.std(axis=0) * np.random.default_rng(0).normal(size=forces.shape)
    joints = pteron.inverse_kinematics(robot, motion.pose)
    result = found(robot, Log("log.csv", motion.time, joints, forces))
    hidden = "Play (backlash) in the drives would not be seen"
    told = any(said.startswith(hidden) for said in result.verdict.reasons)
    assert told == gentle == ("play" in result.fault_isolation.hidden)
    assert ("play" in result.fault_isolation.tried) != gentle


@CLIENTS
def test_no_play_is_named_where_it_changes_next_to_nothing():
    """What sampling leaves without noise is largest where loads turn: 0.0001 % of the forces."""
    robot = pteron.load("delta")
    series = random_excitation(robot, limits=Limits(6.0, 80.0), period=4.0, seed=3)
    run = simulate(robot, series.at(np.arange(8001) / 1000.0), ComputedTorque())
    result = found(robot, Log("log.csv", run.time, run.joints, run.forces))
    assert not result.fault_isolation.faults
    assert result.verdict.grade == "trustworthy"


def test_friction_below_zero_is_told_before_all_else():
    """A joint that something pushes which no model has."""
    robot, log, friction = clean("delta")
    pushed = replace(friction, viscous=np.array([-0.3, 1.0, 1.0]) * friction.viscous)
    log = noisy(log_of(robot, friction=pushed, **brisk(robot)), noise=1e-3)
    hidden, first, *_ = found(robot, log).verdict.reasons
    assert hidden.startswith("These logs cannot show")
    below = "Friction is below zero beyond its interval, which is impossible: Fv1 = -"
    assert first.startswith(below)
    assert "Fv2" not in first
