"""A live cue: datagrams are read or counted, and the platform stays in its box whatever comes."""

import json
import signal
import socket
import struct
import subprocess
import time
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from commands import PROGRAM, refused

import pteron
from pteron.errors import DataError, ModelError
from pteron.legs.drive import Drive
from pteron.motion import LiveCue, Washout, cue, cue_limits
from pteron.motion.follower import Follower
from pteron.motion.telemetry import LAYOUTS, Telemetry
from pteron.motion.washout import WashoutFilter
from pteron.workspace import Box, conditions, prove
from pteron.workspace.regions import Segment

STEP = 1 / 250
DRIVE = Drive(max_force=9000.0, max_speed=0.9)


@cache
def short_rams(drive=None):
    """A hexapod that rests near its rams' short stop."""
    robot = pteron.load("stewart")
    legs = tuple(replace(leg, limits=(3.0, 3.6), drive=drive) for leg in robot.legs)
    return replace(robot, legs=legs, home=(0.0, 0.0, 1.8, 0.0, 0.0, 0.0))


@cache
def limits():
    return cue_limits(short_rams(DRIVE))


def wild(count, seed=0):
    rng = np.random.default_rng(seed)
    samples = np.repeat(rng.uniform(-1.0, 1.0, (count // 5, 6)), 5, axis=0)
    return samples * [150.0, 150.0, 150.0, 40.0, 40.0, 40.0]


def lived(samples, **options):
    """Poses, velocities, accelerations and phases after each tick."""
    live = LiveCue(short_rams(DRIVE), limits(), **options)
    ticks = []
    for sample in samples:
        live.advance(sample)
        ticks.append((live.pose, live.velocity, live.acceleration, live.joints, live.phase))
    return [np.array(part) for part in zip(*ticks, strict=True)]


JSON = {"t": 2.0, "ax": 1.0, "ay": 2.0, "az": 3.0, "wx": 0.1, "wy": 0.2, "wz": 0.3}


def forza(length, racing=1):
    head = struct.pack(
        "<iI3f3f3f3f", racing, 2000, *[0.0] * 3, -2, 3, 1, *[0.0] * 3, 0.2, -0.3, -0.1
    )
    return head.ljust(length, b"\0")


def outsim(heading, pitch, roll, *, named=False):
    """An OutSim datagram of a car that is turned, with vectors by matrices of each turn."""
    (a, b, c), s = np.cos([heading, pitch, roll]), np.sin([heading, pitch, roll])
    turned = (
        np.array([[a, -s[0], 0], [s[0], a, 0], [0, 0, 1]])
        @ np.array([[1, 0, 0], [0, b, -s[1]], [0, s[1], b]])
        @ np.array([[c, 0, s[2]], [0, 1, 0], [-s[2], 0, c]])
    )
    acceleration, rates = turned @ [-2.0, 1.0, 3.0], turned @ [-0.2, 0.1, 0.3]
    numbers = [*rates, heading, pitch, roll, *acceleration, 0.0, 0.0, 0.0]
    return struct.pack("<I12f3i", 2000, *numbers, 7, 8, 9) + b"\1\0\0\0" * named


@pytest.mark.parametrize(
    ("layout", "datagram"),
    [
        ("json", json.dumps(JSON).encode()),
        ("csv", b"2.0,1,2,3,.1,.2,.3\n"),
        *(("forza", forza(length)) for length in (232, 311, 324, 331)),
        ("outsim", outsim(0.0, 0.0, 0.0)),
        ("outsim", outsim(0.7, -0.4, 0.3, named=True)),
    ],
)
def test_each_layout_gives_the_same_sample(layout, datagram):
    telemetry = Telemetry(layout)
    assert telemetry.sample(datagram) == pytest.approx((1.0, 2.0, 3.0, 0.1, 0.2, 0.3), abs=1e-6)
    assert (telemetry.stamp, telemetry.accepted, telemetry.faults) == (2.0, 1, {})
    flipped = Telemetry(layout, ["ay", "wz"])
    assert flipped.sample(datagram) == pytest.approx((1.0, -2.0, 3.0, 0.1, 0.2, -0.3), abs=1e-6)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_garbage_is_counted_and_never_raises(layout):
    telemetry, rng, count = Telemetry(layout), np.random.default_rng(0), 300
    lengths = [0, 64, 68, 232, 311, 324, 331]
    for k in range(count):
        size = lengths[k % 7] if k % 2 else int(rng.integers(0, 400))
        telemetry.sample(rng.bytes(size))
    assert telemetry.accepted + sum(telemetry.faults.values()) == count
    assert telemetry.accepted < 0.1 * count


def test_faults_are_told_apart():
    telemetry = Telemetry("json")

    def reason(**changed):
        before = dict(telemetry.faults)
        telemetry.sample(json.dumps(JSON | changed).encode())
        return [name for name, n in telemetry.faults.items() if n > before.get(name, 0)]

    assert reason(t=10.0) == []
    assert reason(t=10.0) == reason(t=9.5) == ["late or repeated"]
    assert reason(t=2.0) == []  # the simulator has begun again
    assert reason(t=3.0, ax=float("nan")) == reason(t=float("inf")) == ["not a finite number"]
    assert reason(t=3.0, wz=1e9) == reason(t=3.0, ax=-1e30) == ["implausibly large"]
    assert reason(t=3.0, ax="one") == reason(t=3.0, ax=[1]) == ["not of the layout"]
    paused = Telemetry("forza")
    assert paused.sample(forza(232, racing=0)) is None
    assert paused.faults == {"simulator paused": 1}
    deep = Telemetry("json")
    assert deep.sample(b"[" * 2000) is None
    for wrong in ({"layout": "x"}, {"layout": "json", "flip": ["x"]}):
        with pytest.raises(DataError, match="given"):
            Telemetry(**wrong)


def test_live_and_recorded_samples_pass_the_same_filters():
    time = np.arange(2000) * STEP
    samples = np.stack([np.sin((k + 1) * time) * [2, 2, 1, 0.1, 0.1, 0.1][k] for k in range(6)], -1)
    filters = WashoutFilter(Washout(), STEP)
    whole = filters.run(samples)
    filters.reset()
    one_by_one = np.stack([filters.advance(sample) for sample in samples], axis=1)
    assert (whole == one_by_one).all()
    columns = dict(zip(("ax", "ay", "az", "wx", "wy", "wz"), samples.T, strict=True))
    recorded = cue(short_rams(), {"t": time, **columns})
    free = replace(cue_limits(short_rams(), recorded=recorded), home=recorded.center)
    free = replace(free, speed=10 * free.speed, acceleration=10 * free.acceleration)
    live = LiveCue(short_rams(), free)
    for _ in range(100):  # from home, which is the middle here
        live.advance(samples[0] * 0.0)
    assert live.phase == "cueing"
    poses = []
    for sample in samples:
        live.advance(sample)
        poses.append(live.pose)
    # The filters stood at rest before the first sample, in the file and here.
    assert np.abs(poses - recorded.pose).max() < 2e-4 * np.ptp(recorded.pose, axis=0).max()


def test_a_follower_keeps_its_limits_whatever_its_target_does():
    rng = np.random.default_rng(1)
    half, speed, most = (
        np.array([0.1, 1.0, 0.02]),
        np.array([1.0, 0.5, 2.0]),
        np.array([5.0, 1.0, 9.0]),
    )
    follower = Follower(half, speed, most, STEP)
    for k in range(4000):
        far = 3.0 * half * rng.uniform(-1, 1, 3) * (k % 40 == 0) + follower.position * (k % 40 > 0)
        share = (1.0, 0.3)[k % 400 > 200]
        y, v = follower.position, follower.velocity
        follower.advance(far, rng.uniform(-3, 3, 3), share)
        assert (np.abs(follower.velocity) <= speed * (1 + 1e-12)).all()
        assert (np.abs(follower.acceleration) <= most * (1 + 1e-9)).all()
        np.testing.assert_allclose(follower.position, y + STEP * (v + follower.velocity) / 2)
        # Within the tick it is a parabola: its vertex counts where it lies there.
        a = follower.acceleration
        vertex = np.where(v * follower.velocity < 0.0, y - v * v / np.where(a, 2 * a, 1.0), y)
        for place in (follower.position, vertex):
            assert (np.abs(place) <= half * (1 + 1e-12)).all()
    for _ in range(3000):
        follower.advance(0.5 * half, np.zeros(3))
    np.testing.assert_allclose(follower.position, 0.5 * half, rtol=1e-9)


def test_whatever_comes_the_platform_stays_in_its_box_and_rests_at_home():
    silence, samples = [None], list(wild(1500))
    pose, velocity, acceleration, joints, phase = lived(
        [*(20 * silence), *samples, *(2000 * silence)]
    )
    kept = limits()
    assert kept.proof.holds
    assert set(phase) == {"home", "starting", "cueing", "returning"}
    is_cueing = phase == "cueing"
    assert is_cueing.sum() > 600
    assert kept.region.holds(pose[is_cueing]).all()
    assert (np.abs(velocity) <= kept.speed * (1 + 1e-9)).all()
    assert (np.abs(acceleration) <= kept.acceleration * (1 + 1e-6)).all()
    np.testing.assert_allclose(
        np.diff(pose, axis=0), STEP * (velocity[1:] + velocity[:-1]) / 2, atol=1e-7
    )
    assert phase[19] == phase[-1] == "home"
    np.testing.assert_array_equal(pose[-1], kept.home)
    low, high = np.array([leg.limits for leg in short_rams().legs]).T
    assert ((joints >= low) & (joints <= high)).all()
    np.testing.assert_allclose(joints, pteron.inverse_kinematics(short_rams(), pose), atol=1e-12)
    assert np.abs(np.diff(joints, axis=0)).max() <= DRIVE.max_speed * STEP
    forces = pteron.drive_forces(short_rams(DRIVE), pose, velocity, acceleration)
    assert np.abs(forces).max() <= DRIVE.max_force
    assert kept.speed_share <= 0.95
    assert kept.force_share <= 1.0


def test_without_datagrams_the_platform_returns_and_resumes_smoothly():
    wave = [np.array([3.0 * np.sin(0.02 * k), 0, 0, 0, 0, 0]) for k in range(800)]
    to_middle = 900 * [np.zeros(6)]
    ticks = [*to_middle, *wave, *(60 * [None]), *wave, *(120 * [None]), *(2 * to_middle), *wave]
    _, _, acceleration, _, phase = lived(ticks, timeout=0.3)
    # 0.24 s of silence are bridged, 0.48 s are not.
    assert set(phase[900:2560]) == {"cueing"}
    assert phase[2560 + 76] == "returning"
    assert phase[-1] == "cueing"
    assert (np.abs(acceleration) <= limits().acceleration * (1 + 1e-6)).all()


def test_after_a_short_silence_the_platform_catches_up_gently():
    time_ = STEP * np.arange(6000)
    gentle = np.zeros((6000, 6))
    gentle[:, 0], gentle[:, 1] = 1.5 * np.sin(2.0 * time_), 1.0 * np.cos(1.5 * time_)
    samples = list(gentle)
    silent = range(4000, 4120)  # 0.48 s
    for k in silent:
        samples[k] = None
    *_, acceleration, _, phase = lived(samples)
    assert {"returning", "cueing"} <= set(phase[4000:4400])
    most = np.abs(acceleration[4000:]) / limits().acceleration
    # As a start or a return, and a little more while the platform catches up: 0.4 s of 2 s.
    assert most.max() <= 0.3 + 0.7 * 0.2
    assert (np.abs(acceleration[5500:]) <= 1.3 * np.abs(acceleration[2500:4000]).max(axis=0)).all()


def test_the_box_is_where_the_motion_fits_and_the_way_there_is_proved():
    kept = limits()
    assert kept.center[2] > kept.home[2] + 0.05
    assert not kept.region.holds(kept.home)
    way = np.linspace(kept.home, kept.center, 200)
    assert prove(short_rams(), kept.region, given=conditions(short_rams())).holds
    for a, b in zip(way[:-1:20], way[19::20], strict=True):
        assert prove(short_rams(), Box(tuple(np.minimum(a, b)), tuple(np.maximum(a, b)))).holds


def test_what_cannot_be_is_refused():
    with pytest.raises(ModelError, match="its drive gives 50 N, but to hold the platform"):
        cue_limits(short_rams(Drive(max_force=50.0)))
    with pytest.raises(ModelError, match="no straight way from home"):
        cue_limits(short_rams(), home=[0.0, 0.0, 1.2, 0.0, 0.0, 0.0])
    with pytest.raises(ModelError, match="3T platform"):
        cue_limits("delta")
    with pytest.raises(DataError, match="timeout"):
        LiveCue(short_rams(), limits(), timeout=0.0)


def test_the_command_says_what_it_cannot_take():
    live = "cue --robot stewart --listen 41234"
    refused(f"{live} --send 127.0.0.1", "HOST:PORT expected")
    refused(f"{live} --send 127.0.0.1:41234", "where datagrams are received")
    refused(f"{live} --layout speedy", "json, csv, forza, outsim")
    refused(f"{live} --out cue.csv", "for a recorded motion")
    refused("cue --robot stewart --listen 70000", "1 to 65535")
    refused("cue --robot stewart", "no motion given")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        refused(f"cue --robot stewart --listen {port}", f"port {port} of 127.0.0.1", "in use")


@pytest.mark.skipif(not Path("/proc/net/udp").exists(), reason="the kernel's list of sockets")
def test_the_command_listens_to_this_computer_alone_and_ends_at_home(tmp_path):
    robot = pteron.save(short_rams(), tmp_path / "robot.toml")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as here:
        here.bind(("127.0.0.1", 0))
        here.settimeout(60.0)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        line = (
            f"cue --robot {robot} --listen {port} --send 127.0.0.1:{here.getsockname()[1]} --json"
        )
        with subprocess.Popen(
            [*PROGRAM, *line.split()], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as live:
            first = here.recv(1000)
            sockets = Path("/proc/net/udp").read_text().split()
            assert f"0100007F:{port:04X}" in sockets
            assert f"00000000:{port:04X}" not in sockets
            begin = time.monotonic()
            while (t := time.monotonic() - begin) < 1.5:
                here.sendto(json.dumps(JSON | {"t": t}).encode(), ("127.0.0.1", port))
                here.sendto(b"\xff{", ("127.0.0.1", port))
                time.sleep(0.01)
            live.send_signal(signal.SIGTERM)
            out, err = live.communicate(timeout=60)
            assert live.returncode == 0, err
    told = json.loads(out)
    assert told["at_home"]
    assert told["proved"]
    assert told["accepted"] > 20
    assert told["faults"]["not of the layout"] > 20
    assert "Ctrl-C returns home and ends" in err
    number, _, *joints = map(float, first.decode().split(","))
    assert (number, len(joints)) == (1.0, 6)
    np.testing.assert_allclose(
        joints, pteron.inverse_kinematics(short_rams(), short_rams().home), atol=1e-6
    )


def test_a_segment_meets_the_boxes_that_hold_a_pose_of_it():
    rng = np.random.default_rng(3)
    for level in (False, True):
        start, end = rng.uniform(-1.0, 1.0, (2, 6))
        if level:  # some coordinates do not change
            end[3:] = start[3:]
        segment = Segment(tuple(start), tuple(end))
        poses = start + rng.uniform(0.0, 1.0, (200, 1)) * (end - start)
        assert segment.holds(poses).all()
        assert not segment.holds(poses + 1e-6 * np.sign(rng.uniform(-1, 1, poses.shape))).any()
        assert not segment.holds(start - 0.01 * (end - start))
        sizes = rng.uniform(0.0, 0.3, (2, *poses.shape))
        assert not segment.misses(poses - sizes[0], poses + sizes[1]).any()
        beside = poses + np.where(np.arange(6) == 5, 0.5, 0.0)
        low, high = beside - 0.1 * (np.arange(6) == 5), beside + 0.1
        samples = start + np.linspace(0.0, 1.0, 5001)[:, None] * (end - start)
        inside = (low[:, None] <= samples) & (samples <= high[:, None])
        assert not (segment.misses(low, high) & inside.all(axis=-1).any(axis=1)).any()
        assert segment.misses(low, high).mean() > 0.9
