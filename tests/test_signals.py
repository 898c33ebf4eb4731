"""From samples to states: noise, filters, derivatives, blocks, assembly modes."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from logs_of_motions import log_of, motion, pieces, without
from mechanisms import CATALOG, MECHANISMS, gated, states

import pteron
from pteron.errors import DataError
from pteron.identification.errors import LogError
from pteron.identification.logs import Description, Log
from pteron.identification.signals import (
    Decimation,
    Processing,
    States,
    central_differences,
    cutoff_of,
    fitted_series,
    lowpass,
    position_noise,
    preprocessing_for_log,
    samples,
    spline_motion,
    start_pose,
    uniform,
    white_noise,
)
from pteron.identification.signals.derivatives import LOST
from pteron.identification.signals.repetition import repeating_rows
from pteron.identification.signals.samples import blocks
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.workspace import home_pose

log_of = partial(log_of, rate=500.0)  # rows are counted here

RATE = 1000.0
TIME = np.arange(20_000) / RATE


def waves(time, derivative=0):
    """Return two signals of unit size at 0.4 and 1.5 Hz, or their derivatives."""
    w = 2.0 * np.pi * np.array([0.4, 1.5])
    return w**derivative * np.sin(w * time[:, None] + derivative * np.pi / 2.0)


# Noise


@pytest.mark.parametrize("size", [1e-7, 1e-3])
def test_white_noise_is_found_under_a_motion(size):
    noise = size * np.random.default_rng(0).normal(size=(len(TIME), 2))
    assert white_noise(waves(TIME) + noise) == pytest.approx(size, rel=0.05)


@pytest.mark.parametrize("step", [1e-6, 1e-4])
def test_a_grid_has_at_least_its_rounding_error(step):
    moving = np.round(waves(TIME) / step) * step
    # Standing still, rounding does not average out: the samples alone would say that it is zero.
    still = step * np.repeat([[3.0, 4.0], [4.0, 5.0]], 500, axis=0)
    # Rounding of a slow motion is not quite white.
    assert (np.abs(white_noise(moving) / step * np.sqrt(12.0) - 1.1) < 0.3).all()
    assert white_noise(still) == pytest.approx(step / np.sqrt(12.0), rel=1e-6)


def test_steps_such_as_those_of_dry_friction_are_no_noise():
    noise = 0.01 * np.random.default_rng(1).normal(size=(len(TIME), 2))
    jumps = 5.0 * np.sign(waves(TIME))
    assert white_noise(jumps + noise) == pytest.approx(0.01, rel=0.08)


def test_a_constant_signal_has_no_noise():
    assert np.array_equal(white_noise(np.full((100, 3), 0.25)), np.zeros(3))


# Low-pass filter


def jittered(size, seed=2):
    """Return noise as jitter of the sampling makes it: proportional to the speed."""
    noise = np.random.default_rng(seed).normal(size=(len(TIME), 2))
    speed = waves(TIME, 1)
    return size * noise * speed / np.sqrt((speed**2).mean(axis=0))


def test_noise_that_comes_and_goes_counts_by_its_mean():
    assert position_noise(waves(TIME) + jittered(1e-5)) == pytest.approx(1e-5, rel=0.05)


@pytest.mark.parametrize("size", [1e-6, 1e-2])
@pytest.mark.parametrize("steady", [True, False])
def test_a_cutoff_makes_the_error_of_the_acceleration_least(size, steady):
    noise = size * np.random.default_rng(2).normal(size=(len(TIME), 2))
    signal = waves(TIME) + (noise if steady else jittered(size))

    def error(cutoff):
        found = central_differences(lowpass(signal, RATE, cutoff), RATE)[1]
        off = (found - waves(TIME, 2)[LOST:-LOST])[2000:-2000]
        return np.sqrt((off**2).mean())

    cutoff = cutoff_of(signal, RATE)
    assert cutoff is not None
    assert error(cutoff) < 1.2 * min(error(other) for other in np.geomspace(2.0, 30.0, 20))


def test_more_noise_asks_for_a_lower_cutoff():
    noise = np.random.default_rng(3).normal(size=(len(TIME), 2))
    found = [cutoff_of(waves(TIME) + size * noise, RATE) for size in (1e-6, 1e-4, 1e-2)]
    assert found[0] > found[1] > found[2]


def test_signals_without_noise_need_no_filter():
    assert cutoff_of(waves(TIME), RATE) is None


def test_the_filter_shifts_nothing_and_has_the_gain_that_it_says():
    inside = slice(5000, -5000)
    for frequency in (1.0, 4.0, 8.0):
        wave = np.cos(2.0 * np.pi * frequency * TIME)[:, None]
        gain = 1.0 / (1.0 + (frequency / 4.0) ** 8)
        error = lowpass(wave, RATE, 4.0) - gain * wave
        # The bilinear transform bends frequencies by (pi f / rate)^2 / 3.
        assert np.abs(error[inside]).max() < 2e-3
    turned = lowpass(waves(TIME)[::-1], RATE, 4.0)[::-1]
    assert np.abs(turned - lowpass(waves(TIME), RATE, 4.0))[inside].max() < 1e-9


# Derivatives


def test_central_differences_are_of_eighth_order():
    errors = []
    for rate in (20.0, 40.0):
        time = np.arange(400) / rate
        found = central_differences(waves(time), rate)
        kept = time[LOST:-LOST]
        errors.append([np.abs(d - waves(kept, k)).max() for k, d in enumerate(found, start=1)])
    orders = np.log2(np.array(errors[0]) / errors[1])
    assert orders == pytest.approx(8.0, abs=0.4)


def test_central_differences_know_polynomials_of_eighth_degree():
    time = np.linspace(-1.0, 1.0, 41)
    first, second = central_differences((time**8)[:, None], 20.0)
    kept = time[LOST:-LOST]
    assert first[:, 0] == pytest.approx(8.0 * kept**7, abs=1e-11)
    assert second[:, 0] == pytest.approx(56.0 * kept**6, abs=1e-9)


@pytest.mark.parametrize("uneven", [False, True])
@pytest.mark.parametrize("cutoff", [None, 20.0])
def test_a_spline_follows_a_motion_and_its_derivatives(uneven, cutoff):
    rng = np.random.default_rng(4)
    time = TIME[:5000] + uneven * rng.uniform(-3e-4, 3e-4, 5000)
    inside = slice(500, -500)
    for k, (found, least) in enumerate(
        zip(spline_motion(time, waves(time), cutoff), (1e-8, 1e-6, 1e-4), strict=True)
    ):
        assert np.abs(found - waves(time, k))[inside].max() < least


def test_a_spline_with_a_cutoff_takes_noise_away():
    noise = 1e-4 * np.random.default_rng(5).normal(size=(5000, 2))
    time = TIME[:5000]
    value, _, second = spline_motion(time, waves(time) + noise, 10.0)
    raw = spline_motion(time, waves(time) + noise, None)[2]
    inside = slice(500, -500)
    # 20 knots a second share the noise of 1000 samples.
    assert (value - waves(time))[inside].std() == pytest.approx(1e-4 * np.sqrt(0.02), rel=0.2)
    assert (second - waves(time, 2))[inside].std() < 1e-3 * (raw - waves(time, 2))[inside].std()


# Fourier series


PERIOD = 2.5


def series(time, derivative=0):
    w = 2.0 * np.pi / PERIOD * np.array([1.0, 3.0])
    found = w**derivative * np.cos(w * time[:, None] + derivative * np.pi / 2.0)
    return found + 0.3 * (derivative == 0)


SAMPLINGS = {
    "one period": TIME[:2500],
    "four periods": TIME[:10_000],
    "four and a half": TIME[:11_250],
    "uneven": TIME[:10_000] + np.random.default_rng(6).uniform(-4e-4, 4e-4, 10_000),
    "with a gap": np.r_[TIME[:3000], TIME[4300:10_000]],
    "from elsewhere": TIME[:5000] + 1234.567,
    "a period that is no multiple of the step": np.arange(4000) * (PERIOD / 997.3),
}


@pytest.mark.parametrize("name", SAMPLINGS)
def test_a_series_is_found_with_its_harmonics(name):
    time = SAMPLINGS[name]
    found = fitted_series(time, series(time), PERIOD)
    assert found.harmonics == 3
    for k, least in enumerate((1e-11, 1e-10, 1e-9)):
        assert np.abs(found.at(time)[k] - series(time, k)).max() < least


@pytest.mark.parametrize("name", ["four and a half", "uneven", "with a gap"])
def test_noise_adds_no_harmonics_and_is_measured(name):
    time = SAMPLINGS[name]
    size = 1e-3
    noise = size * np.random.default_rng(7).normal(size=(len(time), 2))
    found = fitted_series(time, series(time) + noise, PERIOD)
    assert found.harmonics == 3
    assert found.noise == pytest.approx(size, rel=0.06)
    # Seven coefficients hold their share of the noise.
    error = found.at(time)[0] - series(time)
    assert np.sqrt((error**2).mean()) == pytest.approx(size * np.sqrt(7 / len(time)), rel=0.7)


def test_a_series_takes_the_harmonics_that_it_is_told():
    assert fitted_series(TIME[:5000], series(TIME[:5000]), PERIOD, highest=4.0).harmonics == 10


def test_a_gap_that_hides_a_part_of_the_period_is_refused():
    time = TIME[:700]  # of a period of 2500 samples
    with pytest.raises(DataError, match="period"):
        fitted_series(time, series(time), PERIOD)


# The parallel filter


@pytest.mark.parametrize("factor", [1, 5, 16])
@pytest.mark.parametrize("rows", [300, 333])
def test_decimation_keeps_an_equation_true(factor, rows):
    rng = np.random.default_rng(8)
    decimation = Decimation(factor)
    matrix, values = rng.normal(size=(rows, 3, 4)), rng.normal(size=4)
    filtered = decimation(matrix)
    assert filtered.shape == (len(decimation.centers(rows)), 3, 4)
    assert filtered @ values == pytest.approx(decimation(matrix @ values), abs=1e-12)


@pytest.mark.parametrize("factor", [1, 5, 16])
def test_decimation_is_a_convolution_at_its_centers(factor):
    signal = np.random.default_rng(9).normal(size=(400, 2))
    decimation = Decimation(factor)
    whole = np.column_stack([np.convolve(column, decimation.taps, "same") for column in signal.T])
    assert decimation(signal) == pytest.approx(whole[decimation.centers(400)], abs=1e-13)
    assert decimation.taps.sum() == pytest.approx(1.0, abs=1e-12)


def test_decimation_is_aligned_with_its_centers():
    # Linear phase: a line passes as it is.
    decimation = Decimation(7)
    line = np.arange(500.0)[:, None]
    assert decimation(line)[:, 0] == pytest.approx(decimation.centers(500), abs=1e-9)


@pytest.mark.parametrize("factor", [1, 3, 10])
def test_what_decimation_leaves_of_noise_is_as_it_says(factor):
    rng = np.random.default_rng(10)
    decimation = Decimation(factor)
    used = np.ones((400, 1))
    used[150:200] = 0.0
    noise = rng.normal(size=(400, 2000)) * used
    found = decimation(noise).std(axis=1)
    assert found == pytest.approx(decimation.noise(used)[:, 0], rel=0.1, abs=1e-12)
    assert decimation.noise(used)[0] == pytest.approx(np.linalg.norm(decimation.taps), rel=1e-12)


def test_what_decimation_leaves_of_white_noise_is_nearly_white():
    noise = np.random.default_rng(11).normal(size=(200_000, 1))
    left = Decimation(10)(noise)[:, 0]
    neighbours = np.corrcoef(left[1:], left[:-1])[0, 1]
    assert abs(neighbours) < 0.1


@pytest.mark.parametrize("rows", [0, 80, 81])
def test_decimation_of_a_few_rows(rows):
    decimation = Decimation(10)
    assert decimation(np.ones((rows, 2))).shape == (int(rows == 81), 2)
    assert len(decimation.centers(rows)) == int(rows == 81)


def test_no_band_is_no_decimation():
    assert Decimation.to_band(1000.0, None).factor == 1
    assert Decimation.to_band(1000.0, 499.0).factor == 1
    assert Decimation.to_band(1000.0, 50.0).factor == 10


# Blocks


def counted(rows, *, gaps=(), payload=None, rate=100.0, first_row=0):
    """Return a log whose sliders are the numbers of its rows; at each gap 5 steps are missing."""
    index = np.arange(rows)
    time = (index + 5 * np.searchsorted(gaps, index, side="right")) / rate
    numbers = np.tile(index[:, None].astype(float), (1, 3))
    phases = None if payload is None else np.asarray(payload)
    return Log("log.csv", time, numbers, numbers, payload=phases, first_row=first_row)


@pytest.mark.parametrize("size", [1, 7, 1000])
@pytest.mark.parametrize("margin", [1, 13])
@pytest.mark.parametrize("length", [1, 29, 200])
def test_blocks_tile_a_log_without_overlap_or_loss(size, margin, length):
    log = counted(200)
    fresh = []
    for block in blocks(pieces(log, length), margin, size, 100.0):
        assert block.rows <= size + 2 * margin
        numbers = block.joints[:, 0]
        assert np.array_equal(numbers, numbers[0] + np.arange(block.rows))
        assert block.first_row == numbers[0]
        fresh.append(numbers[margin : block.rows - margin])
    assert np.array_equal(np.concatenate(fresh), np.arange(margin, 200 - margin))


@pytest.mark.parametrize("length", [1, 31, 200])
def test_blocks_bridge_neither_gaps_nor_changes_of_the_payload(length):
    payload = np.r_[np.zeros(120, dtype=int), np.ones(80, dtype=int)]
    log = counted(200, gaps=(50,), payload=payload, first_row=1000)
    fresh = []
    for block in blocks(pieces(log, length), 4, 16, 100.0):
        numbers = block.joints[:, 0]
        assert np.array_equal(numbers, numbers[0] + np.arange(block.rows))
        assert np.ptp(block.payload) == 0
        assert block.first_row == 1000 + numbers[0]
        fresh.append(numbers[4:-4])
    expected = np.r_[4:46, 54:116, 124:196]
    assert np.array_equal(np.concatenate(fresh), expected)


def test_short_stretches_yield_nothing():
    log = counted(60, gaps=(8, 50))
    found = list(blocks([log], 5, 100, 100.0))
    assert [block.first_row for block in found] == [8]
    assert list(blocks([], 5, 100, 100.0)) == []


# States


each_kind = pytest.mark.parametrize(
    "name",
    gated(
        ["quadrupteron +-+-", "tripteron on a wall", "random 3T1R 1"],
        ["tripteron on a wall", "random 3T1R 1"],
    ),
)


@each_kind
def test_states_are_those_of_the_motion(name):
    robot = MECHANISMS[name]
    pose, velocity, acceleration = motion(robot, np.linspace(0.0, 4.0, 200))
    rates = pteron.kinematics.joint_rates(robot, pose, velocity)
    accelerations = pteron.kinematics.joint_accelerations(robot, pose, velocity, acceleration)
    sliders = pteron.inverse_kinematics(robot, pose)
    log = Log("log.csv", np.arange(200.0), sliders, sliders)
    found = States.from_joints(
        robot,
        (sliders, rates.actuated, accelerations.actuated),
        log.time,
        start_pose(robot, log),
    )
    assert found.pose == pytest.approx(pose, abs=1e-11)
    assert found.velocity == pytest.approx(velocity, abs=1e-9)
    assert found.acceleration == pytest.approx(acceleration, abs=1e-7)
    assert len(found.part(slice(3, 10))) == 7


def in_mode(robot, mode):
    """Return a log of poses in an assembly mode: the sign of the determinant tells it."""
    pose, _, _ = states(robot, 400)
    type_ii = evaluate_unchecked(robot, "type_ii", pose)
    pose = pose[(type_ii < 0.0) == bool(mode)]
    assert len(pose) > 10
    sliders = pteron.inverse_kinematics(robot, pose)
    return Log("log.csv", np.arange(float(len(pose))), sliders, sliders, pose=pose)


def mode_of_log(robot, log):
    """Return the assembly mode, from 0, that a log is taken to be in."""
    return pteron.kinematics.assembly_mode(robot, start_pose(robot, log))


@pytest.mark.parametrize("name", ["random 3T1R 1"])
@pytest.mark.parametrize("mode", [0, 1])
def test_a_measured_pose_says_the_assembly_mode(name, mode):
    robot = MECHANISMS[name]
    log = in_mode(robot, mode)
    turned = replace(log, pose=log.pose + 2.0 * np.pi * np.eye(4)[3])
    assert mode_of_log(robot, log) == mode_of_log(robot, turned) == mode


@pytest.mark.parametrize("name", ["random 3T1R 1"])
def test_a_declared_mode_comes_first_and_that_of_home_last(name):
    robot = MECHANISMS[name]
    log = in_mode(robot, 0)
    for mode in (1, 2):
        declared = replace(log, description=Description(assembly_mode=mode))
        assert mode_of_log(robot, declared) == mode - 1
    assert start_pose(robot, replace(log, pose=None)) == tuple(home_pose(robot))


def test_a_tripteron_has_one_assembly_mode():
    robot = CATALOG["tripteron"]
    log = log_of(robot, duration=1.0)
    assert mode_of_log(robot, log) == 0
    with pytest.raises(DataError, match=r"assembly_mode = 2; tripteron has 1$"):
        start_pose(robot, replace(log, description=Description(assembly_mode=2)))


def par4_log(mode=0, **more):
    """Return a log of a Par4, of the home pose's assembly mode or of what else its joints allow."""
    robot = CATALOG["par4"]
    log = log_of(robot, duration=2.0, harmonics=2, size=0.06, turn=0.6, **more)
    poses = motion(robot, log.time, harmonics=2, size=0.06, turn=0.6)[0]
    if mode:
        others = pteron.direct_kinematics(robot, log.joints[:1])[0]
        other = others[np.nanargmax(np.abs(others[:, 3] - poses[0, 3]))]
        poses = pteron.follow(robot, log.joints, other)
        assert np.abs(poses[:, 3]).min() > 1.5
    return robot, replace(log, pose=poses)


@pytest.mark.parametrize("mode", gated([0, 1], [1]))
def test_a_machine_without_closed_form_is_followed_in_the_mode_of_a_pose(mode):
    robot, log = par4_log(mode)
    still = (log.joints, np.zeros_like(log.joints), np.zeros_like(log.joints))
    found = States.from_joints(robot, still, log.time, start_pose(robot, log))
    assert found.pose == pytest.approx(log.pose, abs=1e-11)
    rows = pteron.direct_kinematics(robot, log.joints[0])
    row = np.nanargmin(np.abs(rows - log.pose[0]).max(axis=-1))
    about = Description(assembly_mode=int(row) + 1)
    declared = start_pose(robot, replace(log, pose=None, description=about))
    assert declared == pytest.approx(log.pose[0], abs=1e-11)
    if mode == 0:
        unsaid = start_pose(robot, replace(log, pose=None))
        found = States.from_joints(robot, still, log.time, unsaid)
        assert found.pose == pytest.approx(log.pose, abs=1e-11)
    with pytest.raises(DataError, match="assembly_mode = 5 is no pose that its joints have"):
        start_pose(robot, replace(log, description=Description(assembly_mode=5)))


def test_blocks_of_a_followed_motion_continue_each_other():
    robot, log = par4_log(1)
    treatment = preprocessing_for_log(robot, log, Processing(derivatives="central", band=100.0))
    found = [part.states.pose[part.fresh] for part in samples(robot, log, treatment, block=300)]
    assert len(found) > 2
    lost = (log.rows - sum(map(len, found))) // 2
    assert np.concatenate(found) == pytest.approx(log.pose[lost : log.rows - lost], abs=1e-11)


def test_a_followed_log_names_the_sample_that_it_does_not_come_to():
    robot, log = par4_log()
    still = np.zeros_like(log.joints)
    start = start_pose(robot, log)
    wild = log.joints.copy()
    wild[700] += [1.5, 0.0, -1.5, 0.0]
    with pytest.raises(LogError, match=r"row 701: no pose of par4 has the joints .*zeros$"):
        States.from_joints(robot, (wild, still, still), log.time, start)


def unreachable(log, row):
    """Return a log with one row that no pose has."""
    sliders = log.joints.copy()
    sliders[row] += [0.5, -0.5, 0.3, 0.4]
    return replace(log, joints=sliders)


@pytest.mark.parametrize(("row", "first"), [(300, 0), (1900, 5000)])
def test_a_sample_without_a_pose_is_named_in_any_block(row, first):
    robot = CATALOG["quadrupteron"]
    log = replace(log_of(robot, duration=4.0), first_row=first)
    treatment = preprocessing_for_log(robot, log)
    treatment = replace(treatment, derivatives="central", cutoff=None, band=100.0)
    broken = unreachable(log, row)
    for given in (broken, pieces(broken, 333)):
        with pytest.raises(LogError, match=": no pose of quadrupteron has the joints") as caught:
            list(samples(robot, given, treatment, block=250))
        assert caught.value.reason == "no pose"
        assert caught.value.place == f"log.csv: row {first + row + 1}"


def test_a_wrong_mode_is_told_from_a_wrong_machine():
    # A pose that is lost in one mode only does not exist here: both fail, and the hint is general.
    robot = CATALOG["quadrupteron"]
    log = unreachable(log_of(robot, duration=1.0), 100)
    treatment = preprocessing_for_log(robot, log, Processing(derivatives="central"))
    with pytest.raises(DataError, match="another machine"):
        list(samples(robot, log, replace(treatment, cutoff=None)))


def test_a_singular_sample_is_named():
    robot = CATALOG["tripteron"]
    pose, velocity, acceleration = states(robot, 30)
    rates = pteron.kinematics.joint_rates(robot, pose, velocity)
    accelerations = pteron.kinematics.joint_accelerations(robot, pose, velocity, acceleration)
    sliders = pteron.inverse_kinematics(robot, pose)
    motion_of = [sliders, rates.actuated, accelerations.actuated]
    _, margin, _ = evaluate_unchecked(robot, "reach", pose[17:18])
    leg = robot.legs[0]
    # Across the direction of leg 1, until the first leg is all but stretched.
    across = np.eye(3)[int(np.argmin(np.abs(leg.direction)))]
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        trial = pteron.inverse_kinematics(robot, pose[17] + middle * across, on_failure="nan")
        low, high = (low, middle) if np.isnan(trial).any() else (middle, high)
    assert margin.min() > 0.0
    sliders[17] = pteron.inverse_kinematics(robot, pose[17] + low * across)
    with pytest.raises(DataError, match="row 1018: a leg is all but stretched or folded"):
        States.from_joints(robot, tuple(motion_of), np.arange(30.0), pose[0], first_row=1000)


@pytest.mark.parametrize(("derivatives", "margin"), [("central", 0), ("spline", 37)])
def test_fresh_samples_of_blocks_tile_a_log(derivatives, margin):
    robot = CATALOG["tripteron"]
    # The knots of a spline are where a block says: noise falls on them in other ways.
    log = log_of(robot, duration=4.0, joint_noise=1e-6 * (derivatives == "central"))
    treatment = preprocessing_for_log(robot, log, Processing(derivatives=derivatives, cutoff=20.0))
    whole = list(samples(robot, log, treatment, margin=margin))
    assert len(whole) == 1
    found = list(samples(robot, pieces(log, 123), treatment, margin=margin, block=300))
    assert len(found) > 3
    for name, least in (
        ("time", 1e-12),
        ("pose", 1e-8),
        ("velocity", 1e-6),
        ("acceleration", 1e-4),
    ):
        joined = np.concatenate([getattr(part.states, name)[part.fresh] for part in found])
        expected = getattr(whole[0].states, name)[whole[0].fresh]
        assert joined.shape == expected.shape
        assert np.abs(joined - expected).max() < least * max(np.abs(expected).max(), 1.0)
    forces = np.concatenate([part.forces[part.fresh] for part in found])
    assert np.array_equal(forces, whole[0].forces[whole[0].fresh])


def test_a_log_shorter_than_the_edges_is_refused():
    robot = CATALOG["tripteron"]
    log = log_of(robot, duration=8.0)
    treatment = preprocessing_for_log(robot, log, Processing(derivatives="central", cutoff=5.0))
    with pytest.raises(DataError, match="shorter than the"):
        list(samples(robot, log.part(0, 900), treatment))


# Time stamps and treatment


def test_even_samples_are_left_alone():
    signal = waves(TIME)
    time, same = uniform(TIME, signal)
    assert same is signal
    assert time == pytest.approx(TIME, abs=1e-12)


def test_uneven_samples_are_brought_to_even_steps():
    time = TIME[:2000] + np.random.default_rng(12).uniform(-3e-4, 3e-4, 2000)
    even, found = uniform(time, waves(time))
    assert np.ptp(np.diff(even)) < 1e-12
    assert np.abs(found - waves(even)).max() < 1e-9


@pytest.mark.parametrize("derivatives", ["central", "spline"])
def test_uneven_samples_give_the_motion(derivatives):
    robot = CATALOG["quadrupteron"]
    rng = np.random.default_rng(13)
    time = np.arange(4000) / 500.0 + rng.uniform(-4e-4, 4e-4, 4000)
    log = log_of(robot, time=time)
    treatment = preprocessing_for_log(robot, log, Processing(derivatives=derivatives))
    (found,) = samples(robot, log, replace(treatment, cutoff=None))
    expected = motion(robot, found.states.time)
    assert found.states.pose == pytest.approx(expected[0], abs=1e-8)
    assert found.states.acceleration == pytest.approx(expected[2], abs=2e-3)


def test_the_data_choose_the_treatment():
    robot = CATALOG["quadrupteron"]
    clean, noisy = log_of(robot), log_of(robot, joint_noise=1e-5)
    assert preprocessing_for_log(robot, clean).derivatives == "spline"
    assert preprocessing_for_log(robot, noisy).derivatives == "central"
    known = replace(noisy, description=Description(period=4.0))
    periodic = preprocessing_for_log(robot, known)
    assert (periodic.derivatives, periodic.period) == ("periodic", 4.0)
    assert preprocessing_for_log(robot, known, rows=10**8).derivatives == "central"
    assert preprocessing_for_log(robot, noisy).joint_noise == pytest.approx(1e-5, rel=0.1)


def test_speeds_that_count_as_slow_are_a_share_of_the_usual_ones():
    robot = CATALOG["quadrupteron"]
    log = log_of(robot)
    pose, velocity, _ = motion(robot, log.time)
    usual = np.sqrt(
        (pteron.kinematics.joint_rates(robot, pose, velocity).actuated ** 2).mean(axis=0)
    )
    for share in (0.0, 0.02, 0.3):
        slow = preprocessing_for_log(robot, log, Processing(slow=share)).slow
        assert slow == pytest.approx(share * usual, rel=0.01, abs=1e-15)


WRONG = {
    "derivatives": ({"derivatives": "quick"}, "periodic, central, spline"),
    "cutoff of nothing": ({"cutoff": 0.0}, "cutoff: 0.0"),
    "band without end": ({"band": float("inf")}, "band: inf"),
    "period from behind": ({"period": -1.0}, "period: -1.0"),
    "all is slow": ({"slow": 1.0}, "slow: 1.0"),
    "cutoff beyond Nyquist": ({"cutoff": 250.0}, "below 250 Hz"),
    "band beyond Nyquist": ({"band": 300.0}, "below 250 Hz"),
    "no period": ({"derivatives": "periodic"}, "needs the period"),
    "less than a period": ({"derivatives": "periodic", "period": 9.0}, "less than its period"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_treatment_that_cannot_be_is_refused(case):
    given, message = WRONG[case]
    robot = CATALOG["tripteron"]
    log = log_of(robot)
    with pytest.raises(DataError, match=message):
        preprocessing_for_log(robot, log, Processing(**given))


def test_the_longest_stretch_decides_the_treatment():
    robot = CATALOG["tripteron"]
    log = log_of(robot, joint_noise=1e-5)
    whole, cut = (
        preprocessing_for_log(robot, log),
        preprocessing_for_log(robot, without(log, 400, 700)),
    )
    assert cut.rate == pytest.approx(whole.rate, rel=1e-9)
    assert cut.cutoff == pytest.approx(whole.cutoff, rel=0.5)


# The part that repeats


def led(time, period):
    """Return two coordinates that set off at 1 s, repeat from 3 s on, and rest from 13 s on."""
    begin, steady, end = np.clip(time - 1.0, 0.0, 2.0), np.clip(time, 3.0, 11.0), 13.0 - time
    end = 2.0 - np.clip(end, 0.0, 2.0)
    # A phase whose rate goes from 0 to 1, and back, without a jump of its second derivative.
    ramp = [2.0 * u**4 * (2.5 - 3.0 * u + u**2) for u in (begin / 2.0, 1.0 - end / 2.0)]
    return waves((ramp[0] + steady - ramp[1]) / period * 10.0)


@pytest.mark.parametrize("periods", [1, 2, 3])
@pytest.mark.parametrize("noise", [0.0, 1e-6, 1e-3])
def test_the_part_of_a_log_that_repeats_is_found_by_itself(periods, noise):
    time = np.arange(15_000) / RATE
    joints = led(time, 8.0 / periods) + noise * np.random.default_rng(0).normal(size=(15_000, 2))
    rows = repeating_rows(time, joints, 8.0 / periods)
    # The lead joins so smoothly that noise hides where.
    assert time[rows.start] == pytest.approx(3.0, abs=0.02 if noise < 1e-4 else 0.2)
    assert rows.stop - rows.start == pytest.approx(8000, abs=1)
    joints[5000:5004] += 0.3  # spikes
    again = repeating_rows(time, joints, 8.0 / periods)
    assert time[again.start] == pytest.approx(3.0, abs=0.3)
    assert again.stop - again.start == pytest.approx(8000, abs=1)


def test_nothing_repeats_in_a_motion_that_only_crosses_its_own_way():
    time = np.arange(15_000) / RATE
    there_and_back = np.abs(7.5 - time)[:, None] * [1.0, 0.5]
    assert repeating_rows(time, there_and_back, 5.0) is None
    assert repeating_rows(time, led(time, 4.0), 3.3) is None
    assert repeating_rows(time, np.zeros((15_000, 2)), 2.0) is None
    assert repeating_rows(time[:100], led(time[:100], 4.0), 2.0) is None
