"""The delay and the speeds with which friction falls: found with the values, and with intervals."""

from dataclasses import replace

import numpy as np
from logs_of_motions import Friction, log_of, machine
from mechanisms import CLIENTS
from scipy.interpolate import make_interp_spline

import pteron
from pteron.identification import Processing, Terms, identify
from pteron.identification.excitation import FourierMotion, Limits, found_lead
from pteron.identification.excitation.excitation import Excitation

SPEEDS = np.array([0.02, 0.03, 0.015])
FALLS = np.array([1.5, 2.0, 1.0])


def log(robot, *, noise, slower=1.0, rate=1000.0, late=0, seed=0):
    """Return a log of the machine with friction that falls, its forces some samples late."""
    plain = log_of(robot, seed=seed, period=4.0 * slower, duration=8.0 * slower, rate=rate)
    rates = make_interp_spline(plain.time, plain.joints, k=7)(plain.time, 1)
    forces = plain.forces + FALLS * np.sign(rates) * np.exp(-((rates / SPEEDS) ** 2))
    forces = forces + noise * np.random.default_rng(seed + 1).normal(size=forces.shape)
    later = plain.part(late, plain.rows)
    return replace(later, source=f"{seed}.csv", forces=forces[: plain.rows - late])


def truth(result):
    """Return the values that the machine has."""
    friction = Friction.of(3)
    return np.r_[result.model.base.values(result.robot), friction.values, FALLS]


def test_speeds_are_found_without_noise():
    robot = machine("tripteron")
    logs = [log(robot, noise=0.0), log(robot, noise=0.0, slower=4.0, rate=500.0, seed=3)]
    result = identify(robot, logs, terms=Terms(stribeck="auto"), cad=None)
    np.testing.assert_allclose(result.unknowns.speeds, SPEEDS, rtol=1e-4)
    np.testing.assert_allclose(result.estimate.values, truth(result), rtol=0, atol=2e-4)


@CLIENTS
def test_intervals_allow_for_speeds_and_delay_that_are_not_known():
    robot, held, clear = machine("tripteron"), 0, 0
    both = {"terms": Terms(stribeck="auto"), "processing": Processing(delay="auto"), "cad": None}
    for seed in range(3):
        slow = log(robot, noise=0.01, slower=4.0, rate=500.0, late=1, seed=10 + seed)
        result = identify(robot, [log(robot, noise=0.05, late=2, seed=20 + seed), slow], **both)
        assert result.verdict.grade == "trustworthy"
        low, high = result.unknowns.speed_intervals()
        clear += int(((low < SPEEDS) & (high > SPEEDS)).sum())
        errors = (result.estimate.values - truth(result)) / result.estimate.deviations
        held += int((np.abs(errors) < 1.96).sum())
        assert abs(result.unknowns.delay - 0.002) < 4.0 * result.unknowns.delay_deviation
    assert clear >= 7
    assert held >= 0.9 * 3 * len(truth(result))


def test_friction_that_does_not_fall_is_left_out_and_slow_passages_are_advised():
    robot = machine("tripteron")
    plain = log_of(robot, duration=8.0, rate=500.0, force_noise=0.1)
    result = identify(robot, plain, terms=Terms(stribeck="auto"), cad=None)
    assert not np.isfinite(result.unknowns.speeds).any()
    assert not [name for name in result.model.names if name.startswith("Fs")]
    assert any("is not seen to fall" in n and "excite ROBOT --stribeck" in n for n in result.notes)
    assert result.as_dict()["unknowns"]["stribeck_speeds"] == [None] * 3


@CLIENTS
def test_a_payload_that_is_carried_at_the_end_of_a_log_is_fitted_with_a_delay():
    robot = machine("tripteron")
    inertia = pteron.bodies.PlanarInertia(robot.platform.inertia.mass + 0.4, (0.0, 0.0), 0.01)
    heavy = replace(robot, platform=replace(robot.platform, inertia=inertia))
    parts = [
        log_of(one, duration=span, rate=500.0, force_noise=0.05, seed=seed, size=size)
        for one, span, seed, size in ((robot, 45.0, 0, 0.05), (heavy, 10.0, 1, 0.03))
    ]
    time = np.concatenate([parts[0].time, parts[1].time + 46.0])
    joints, forces = (np.vstack([getattr(one, n) for one in parts]) for n in ("joints", "forces"))
    both = replace(
        parts[0], time=time, joints=joints, forces=forces, payload=(time > 45.5).astype(int)
    )
    late = replace(both.part(1, both.rows), forces=both.forces[:-1])
    processing = Processing(delay="auto")
    result = identify(robot, late, terms=Terms(payload=True), processing=processing, cad=None)
    assert abs(result.unknowns.delay - 0.002) < 4.0 * result.unknowns.delay_deviation
    assert abs(result.estimate.value("m_L") - 0.4) < 0.02


def test_slow_passages_go_the_same_way_slowly_and_keep_the_limits():
    robot = pteron.load("tripteron")
    rng = np.random.default_rng(0)
    home = pteron.workspace.home_pose(robot)
    motion = FourierMotion(robot, "platform", 2.0, home, *(0.02 * rng.normal(size=(2, 3, 3))))
    limits = Limits(speed=2.0, acceleration=30.0)
    lead = found_lead(motion, limits)
    found = Excitation(
        motion, limits, "condition", *[None] * 3, lead, (), 1, 0, 1.0, interrupted=False
    )
    slow = found.slow()
    time = np.linspace(0.0, slow.duration, 4001)
    states, fast = slow.states(time), motion.states(np.linspace(0.0, 2.0, 400))
    assert slow.margins(limits).kept
    np.testing.assert_allclose(states.pose[0], states.pose[-1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(states.rates[[0, -1]], 0.0, atol=1e-12)
    fastest, usual = (np.abs(s.rates).max(axis=0) for s in (states, fast))
    assert (fastest < 0.21 * usual).all()

    # Each joint turns back as often as in a period of the motion.
    def turns(rates):
        return (np.diff(np.sign(rates), axis=0) != 0).sum(axis=0)

    assert (np.abs(turns(states.rates[1:-1]) - turns(fast.rates)) <= 1).all()
