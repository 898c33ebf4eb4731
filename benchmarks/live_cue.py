"""A live cue for ten minutes: delays, losses, garbage and a flood, and where the platform goes.

The drive of a car, made up of braking, corners and bumps, is sent to `pteron cue --listen` as 250
datagrams a second. Of them 2 % are lost and 5 % are damaged; three times a simulator is silent for
two seconds, and for five seconds 10 000 datagrams of garbage come each second. Delays are those
from the sending of a datagram until the kernel has its set points, by the kernel's clock.

    python benchmarks/live_cue.py [--robot FILE] [--seconds 600] [--quick]
"""

from __future__ import annotations

import argparse
import json
import math
import os
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np
from measuring import quick

import pteron
from pteron.manipulator import Manipulator

Received = tuple[float, dict[str, Any]]

RATE = 250
LOST, DAMAGED = 0.02, 0.05
PAUSES, PAUSE = (0.25, 0.5, 0.75), 2.0
INTERRUPTED = 5e-4
FLOOD, FLOOD_SECONDS, FLOOD_RATE = 0.6, 5.0, 10_000
_NANOSECONDS = getattr(socket, "SO_TIMESTAMPNS", 35)


def main() -> None:
    """Run the drive and print the figures."""
    options = argparse.ArgumentParser()
    options.add_argument("--robot", default="stewart")
    options.add_argument("--seconds", type=float, default=600.0)
    options.add_argument("--quick", action="store_true")
    chosen = options.parse_args()
    seconds = 4.0 if quick() else chosen.seconds
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as here:
        here.bind(("127.0.0.1", 0))
        here.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        here.setsockopt(socket.SOL_SOCKET, _NANOSECONDS, 1)
        here.setblocking(False)
        port = _free_port()
        command = [sys.executable, "-m", "pteron", "cue", "--listen", str(port), "--json"]
        command += ["--robot", chosen.robot, "--set-points", "json"]
        command += ["--send", f"127.0.0.1:{here.getsockname()[1]}"]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        ) as live:
            _await_first(here)
            with suppress(AttributeError, OSError):  # so that it sends in time under load
                os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
            sent, set_points = _drive(here, ("127.0.0.1", port), seconds)
            live.terminate()
            output, _ = live.communicate()
            set_points += list(_received(here))
    _print_figures(pteron.load(chosen.robot), json.loads(output), sent, set_points)


def _free_port() -> int:
    """Return a port that is free now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as tried:
        tried.bind(("127.0.0.1", 0))
        return int(tried.getsockname()[1])


def _await_first(here: socket.socket) -> None:
    """Wait until the first set points come."""
    while not list(_received(here)):
        time.sleep(0.01)


def _received(here: socket.socket) -> Iterator[Received]:
    """Yield the set points that have come, with the kernel's time of each, s."""
    while True:
        try:
            datagram, extra, _, _ = here.recvmsg(4096, 64)
        except BlockingIOError:
            return
        whole, part = struct.unpack("qq", extra[0][2][:16]) if extra else (time.time(), 0)
        yield whole + 1e-9 * part, json.loads(datagram)


def _motion(seconds: float) -> np.ndarray:
    """Return the samples (T, 6) of a drive: braking, corners, bumps and the body's turns."""
    t = np.arange(round(seconds * RATE)) / RATE
    rng = np.random.default_rng(0)
    bumps = np.convolve(rng.normal(size=(len(t), 1)).ravel(), np.ones(5) / 5.0, "same")
    surge = 5.0 * np.tanh(3.0 * np.sin(0.43 * t)) * (np.sin(0.11 * t) > -0.3)
    sway = 6.0 * np.tanh(2.0 * np.sin(0.29 * t + 1.0)) * (np.sin(0.17 * t) > -0.5)
    roll, pitch = -0.02 * np.gradient(sway, t), 0.02 * np.gradient(surge, t)
    return np.stack([surge, sway, 2.0 * bumps, roll, pitch, sway / 20.0], axis=-1)


def _drive(
    here: socket.socket, address: tuple[str, int], seconds: float
) -> tuple[dict[float, float], list[Received]]:
    """Send the drive; return when each time stamp was sent, s, and the set points with times."""
    rng, samples = np.random.default_rng(1), _motion(seconds)
    sent: dict[float, float] = {}
    set_points: list[Received] = []
    begin = time.monotonic()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for k, sample in enumerate(samples.tolist()):
            t = k / RATE
            wait = begin + t - time.monotonic()
            if wait > 0.0:
                time.sleep(wait)
            set_points += _received(here)
            share = t / seconds
            if share >= FLOOD and t - FLOOD * seconds < min(FLOOD_SECONDS, 0.1 * seconds):
                for _ in range(FLOOD_RATE // RATE):
                    out.sendto(rng.bytes(60), address)
            silence = min(PAUSE, 0.1 * seconds)
            if any(0.0 <= t - pause * seconds < silence for pause in PAUSES):
                continue
            if rng.uniform() < DAMAGED:
                out.sendto(_damaged(rng, sample, t), address)
            elif rng.uniform() >= LOST:
                begin_sending = time.time()
                out.sendto(_datagram(sample, t), address)
                # A sender that was interrupted meanwhile does not know when it sent.
                is_known = time.time() - begin_sending < INTERRUPTED
                sent[t] = begin_sending if is_known else math.nan
    return sent, set_points


def _datagram(sample: list[float], t: float) -> bytes:
    """Return a sample as a datagram of JSON."""
    names = ("t", "ax", "ay", "az", "wx", "wy", "wz")
    return json.dumps(dict(zip(names, [t, *sample], strict=True))).encode()


def _damaged(rng: np.random.Generator, sample: list[float], t: float) -> bytes:
    """Return a datagram that is no sample: cut, repeated, not finite, huge, or no JSON at all."""
    kind = rng.integers(5)
    if kind == 0:
        return _datagram(sample, t)[: rng.integers(1, 40)]
    if kind == 1:
        return _datagram(sample, t - 0.5)
    bad = [float("nan"), 1e30, float("-inf")][rng.integers(3)]
    return _datagram([bad, *sample[1:]], t) if kind == 2 else rng.bytes(int(rng.integers(1, 3000)))


def _print_figures(
    robot: Manipulator, record: dict[str, Any], sent: dict[float, float], set_points: list[Received]
) -> None:
    """Print delays, losses, faults, and what left the box, the limits or the rate."""
    delays: list[float] = []
    newest = None
    for arrival, point in set_points:
        if point["stamp"] != newest and point["stamp"] in sent and point["phase"] == "cueing":
            delays.append(1e3 * (arrival - sent[point["stamp"]]))
        newest = point["stamp"]
    low, high = np.array([record["box"][name] for name in robot.coordinates]).T
    poses = np.array([[p["pose"][name] for name in robot.coordinates] for _, p in set_points])
    joints = np.array([list(p["joints"].values()) for _, p in set_points])
    home, center = poses[-1], np.array(record["center"])
    way = center - home
    along = np.clip((poses - home) @ way / max(way @ way, 1e-30), 0.0, 1.0)
    is_on_way = np.abs(home + along[:, None] * way - poses).max(axis=1) < 1e-9
    outside = ~(((poses >= low) & (poses <= high)).all(axis=1) | is_on_way)
    limits = np.array([leg.limits for leg in robot.legs])
    beyond = ((joints < limits[:, 0]) | (joints > limits[:, 1])).any()
    step = 1.0 / RATE
    speed = np.abs(np.diff(poses, axis=0)).max(axis=0) / step
    change = np.abs(np.diff(poses, 2, axis=0)).max(axis=0) / step**2
    ms = np.array(delays)
    ms, unknown = ms[~np.isnan(ms)], int(np.isnan(ms).sum())
    own = {name: 1e3 * seconds for name, seconds in record["delay"].items()}
    print(f"{robot.name}: {record['duration']:.0f} s, {record['set_points']} set points, of which")
    print(f"  {len(set_points)} received; left out by the clock: {record['late']}")
    print(f"datagrams: {len(sent)} samples sent, {record['accepted']} used; not used:")
    for fault, count in record["faults"].items():
        print(f"  {fault}: {count}")
    print(
        f"delay from sending a sample to its set points: median {np.median(ms):.2f} ms, "
        f"99 % {np.quantile(ms, 0.99):.2f} ms, longest {ms.max():.2f} ms, "
        f"over 5 ms: {(ms > 5.0).sum()} of {len(ms)}; sender interrupted: {unknown}"
    )
    print(
        f"from its arrival, by the command's own clock: median {own['median']:.2f} ms, "
        f"99 % {own['p99']:.2f} ms, longest {own['longest']:.2f} ms"
    )
    print(
        f"poses outside the box and the way home: {outside.sum()}; joints beyond limits: {beyond}"
    )
    for name, most, limit in (
        ("speed", speed, record["speed_limits"]),
        ("acceleration", change, record["acceleration_limits"]),
    ):
        print(f"largest {name} over its limit: {(most / limit).max():.4f}")
    print(f"at home at the end: {record['at_home']}")


if __name__ == "__main__":
    main()
