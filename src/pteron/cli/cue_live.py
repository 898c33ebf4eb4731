"""The loop of `pteron cue --listen`: datagrams in, set points out, by a clock, until a signal."""

from __future__ import annotations

import gc
import json
import math
import os
import select
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from pteron.cli.cue_options import LiveOptions
from pteron.cli.motion_table import box_lines, box_record
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import note, percent, plain, significant, table
from pteron.errors import DataError, shorten

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pteron.cli.motion_argument import Carried
    from pteron.manipulator import Manipulator
    from pteron.motion import CueLimits, LiveCue
    from pteron.motion.telemetry import Telemetry

    Address = tuple[Any, ...]

_DATAGRAM, _BUFFER = 2048, 1 << 16
"""Longest datagram and receive buffer, bytes: what waits is at most some ticks old."""

_DECODED = 100
"""Datagrams decoded in a tick, some 1 ms of work; what exceeds them is counted as a flood."""

_BIN, _BINS = 1e-5, 10_000
"""Width, s, and number of the bins in which delays are counted: 100 ms in all."""


def run_live(
    machine: Manipulator,
    motion: str | None,
    carried: Carried,
    where: dict[str, Any],
    live: LiveOptions,
) -> CommandResult:
    """Run a live cue until it is ended; return its summary."""
    from pteron.motion import LiveCue, cue, cue_limits
    from pteron.motion.live_cue import RATE
    from pteron.motion.telemetry import Telemetry

    telemetry = Telemetry(live.layout, live.flip.split(",") if live.flip else ())
    write = _writer(machine, live.set_points)
    if live.duration is not None and not live.duration > 0.0:
        raise DataError(f"--duration: {live.duration:g} given, a time above 0 s expected")
    with _open_sockets(live) as (receiver, sender, target):
        with spinner(f"Proving the box of {machine.name}"):
            recorded = None if motion is None else cue(machine, motion, **where)
            limits = cue_limits(machine, recorded=recorded, **where)
            follower = LiveCue(machine, limits, where["washout"], rate=RATE, timeout=live.timeout)
        _note_start(machine, live, limits)

        def send(number: int, seconds: float) -> bool:
            """Send the set points; return whether the system took them."""
            if target is None:
                return True
            try:
                sender.sendto(write(number, seconds, follower, telemetry.stamp), target)
            except OSError:
                return False
            return True

        loop = _Loop(follower, telemetry, receiver, send, 1.0 / RATE)
        with _ended_by_signals(follower.stop), _realtime_priority():
            loop.run(live.duration)
    return _summary(machine, carried, live, limits, loop)


class _Loop:
    """The clock of a live cue, with its counts of ticks and delays."""

    def __init__(
        self,
        cue: LiveCue,
        telemetry: Telemetry,
        receiver: socket.socket,
        send: Callable[[int, float], bool],
        step: float,
    ) -> None:
        self.cue, self.telemetry = cue, telemetry
        self._receiver, self._send, self._step = receiver, send, step
        self._arrival = 0.0
        self.ticks, self.late, self.unsent, self.seconds = 0, 0, 0, 0.0
        self.delays, self.longest = [0] * _BINS, 0.0

    def run(self, duration: float | None) -> None:
        """Run until the cue is stopped, or a time is over, and the platform rests at home."""
        import numpy as np

        self._drop_backlog()
        gc.collect()
        gc.disable()  # nothing here makes cycles, and a collection takes milliseconds
        begin, slots, phase = time.monotonic(), 0, self.cue.phase
        end = math.inf if duration is None else begin + duration
        try:
            while not (self.cue.is_stopping and self.cue.is_at_home):
                slots += 1
                deadline = begin + slots * self._step
                sample = self._receive(deadline)
                self.cue.advance(None if sample is None else np.array(sample))
                self.ticks += 1
                if not self._send(self.ticks, time.monotonic() - begin):
                    self.unsent += 1
                now = time.monotonic()
                if sample is not None:
                    self._count_delay(now - self._arrival)
                missed = int((now - deadline) / self._step)
                self.late, slots = self.late + missed, slots + missed
                if now >= end:
                    self.cue.stop()
                if phase != self.cue.phase:
                    phase = self.cue.phase
                    note(f"{now - begin:.1f} s: {phase}")
        finally:
            gc.enable()
        self.seconds = time.monotonic() - begin

    def _drop_backlog(self) -> None:
        """Discard the datagrams that came before the first tick."""
        while select.select([self._receiver], [], [], 0.0)[0]:
            with suppress(OSError):
                self._receiver.recv(1)

    def _receive(self, deadline: float) -> tuple[float, ...] | None:
        """Return the newest sample that arrives up to a time, s; None without one."""
        newest, decoded, flood = None, 0, 0
        while True:
            wait = deadline - time.monotonic()
            try:
                if not select.select([self._receiver], [], [], max(wait, 0.0))[0]:
                    break
                datagram = self._receiver.recv(_DATAGRAM + 1)
            except OSError:  # such as a message that a port is closed: nothing has come
                continue
            if decoded == _DECODED:
                flood += 1
            else:
                decoded += 1
                sample = self._read(datagram)
                if sample is not None:
                    newest, self._arrival = sample, time.monotonic()
            if wait <= 0.0 and (decoded == _DECODED or flood):
                break
        if flood:
            self.telemetry.count("flood", flood)
        return newest

    def _read(self, datagram: bytes) -> tuple[float, ...] | None:
        """Return the sample of a datagram; None without one."""
        if len(datagram) > _DATAGRAM:
            self.telemetry.count("wrong length")
            return None
        return self.telemetry.sample(datagram)

    def _count_delay(self, delay: float) -> None:
        """Count the time from a datagram's arrival until its set points were sent, s."""
        self.delays[min(int(delay / _BIN), _BINS - 1)] += 1
        self.longest = max(self.longest, delay)

    def delay_quantile(self, share: float) -> float:
        """Return the delay that a share of samples does not exceed, s; NaN without samples."""
        total, counted = sum(self.delays), 0
        for k, count in enumerate(self.delays):
            counted += count
            if total and counted >= share * total:
                return min((k + 1) * _BIN, self.longest)
        return math.nan


@contextmanager
def _open_sockets(
    live: LiveOptions,
) -> Iterator[tuple[socket.socket, socket.socket, Address | None]]:
    """Yield the socket that receives, the one that sends and where it sends to, if anywhere."""
    assert live.listen is not None
    family, address = _resolve(live.host, live.listen, "--listen")
    target_family, target = family, None
    if live.send is not None:
        host, _, port = live.send.rpartition(":")
        if not host or not port.isdigit():
            raise DataError(f"--send: {live.send!r} given, HOST:PORT expected, as 127.0.0.1:4124")
        target_family, target = _resolve(host.strip("[]"), int(port), "--send")
        if target == address:
            raise DataError(f"--send: {live.send} is where datagrams are received; give another")
    with (
        socket.socket(family, socket.SOCK_DGRAM) as receiver,
        socket.socket(target_family, socket.SOCK_DGRAM) as sender,
    ):
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        try:
            receiver.bind(address)
        except OSError as error:
            reason = os.strerror(error.errno or 0).lower()
            raise DataError(
                f"--listen: port {live.listen} of {live.host} cannot be used: {reason}; give "
                "another port"
            ) from None
        receiver.setblocking(False)
        yield receiver, sender, target


def _resolve(host: str, port: int, option: str) -> tuple[socket.AddressFamily, Address]:
    """Return the family and the address of a host and a port."""
    if not 0 < port < 1 << 16:
        raise DataError(f"{option}: port {shorten(port)} given, 1 to 65535 expected")
    try:
        addresses = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
    except (OSError, UnicodeError):
        raise DataError(f"{option}: {shorten(host)} is no address of a computer") from None
    return addresses[0][0], addresses[0][4]


def _writer(
    machine: Manipulator, name: str
) -> Callable[[int, float, LiveCue, float | None], bytes]:
    """Return the function that writes set points as a datagram."""

    def csv(number: int, seconds: float, cue: LiveCue, stamp: float | None) -> bytes:
        """Return number, time, s, and joints as a line."""
        return f"{number},{seconds:.4f},{_numbers(cue.joints)}\n".encode()

    names = machine.joint_names

    def as_json(number: int, seconds: float, cue: LiveCue, stamp: float | None) -> bytes:
        """Return number, time, phase, the newest sample's time stamp and joints as an object."""
        record = {"number": number, "t": seconds, "phase": cue.phase, "stamp": stamp}
        joints = dict(zip(names, cue.joints.tolist(), strict=True))
        pose = dict(zip(machine.coordinates, cue.pose.tolist(), strict=True))
        return json.dumps(record | {"joints": joints, "pose": pose}).encode()

    writers = {"csv": csv, "json": as_json}
    if name not in writers:
        raise DataError(f"--set-points: {shorten(name)} given, csv or json expected")
    return writers[name]


def _numbers(joints: NDArray[np.float64]) -> str:
    """Return numbers with seven decimals, separated by commas: 0.1 um."""
    return ",".join(f"{joint:.7f}" for joint in joints.tolist())


@contextmanager
def _ended_by_signals(stop: Callable[[], None]) -> Iterator[None]:
    """Call `stop` at the first Ctrl-C or request to end; a second one interrupts at once."""
    is_asked = False

    def handle(number: int, frame: object) -> None:
        nonlocal is_asked
        if is_asked:
            raise KeyboardInterrupt
        is_asked = True
        stop()

    numbers = signal.SIGINT, signal.SIGTERM
    handlers = [signal.signal(number, handle) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, handlers, strict=True):
            signal.signal(number, handler)


@contextmanager
def _realtime_priority() -> Iterator[None]:
    """Give this thread real-time priority, where the system allows it; else note that it does not.

    Under full load a thread of ordinary priority waits some milliseconds for a core.
    """
    try:
        scheduling = os.sched_getscheduler(0), os.sched_getparam(0)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except (AttributeError, OSError):
        note("Note: no real-time priority: set points may be late while other programs work")
        yield
        return
    try:
        yield
    finally:
        os.sched_setscheduler(0, *scheduling)


def _note_start(machine: Manipulator, live: LiveOptions, limits: CueLimits) -> None:
    """State on standard error where the cue listens and sends, and how to end it."""
    from pteron.viewer.guard import is_local_address

    if not is_local_address(live.host):
        note(
            f"Warning: --host {live.host}: anyone who can reach this machine over the network can "
            "move the platform"
        )
    going = "no set points are sent (--send HOST:PORT)" if live.send is None else f"to {live.send}"
    note(
        f"{machine.name} listens at {live.host}:{live.listen} for datagrams of layout "
        f"{live.layout}; {going}; Ctrl-C returns home and ends"
    )
    sys.stderr.flush()


def _summary(
    machine: Manipulator, carried: Carried, live: LiveOptions, limits: CueLimits, loop: _Loop
) -> CommandResult:
    """Return the summary of a live cue: delays, losses, faults, limits."""
    faults = dict(sorted(loop.telemetry.faults.items()))
    delays = {
        "median": loop.delay_quantile(0.5),
        "p99": loop.delay_quantile(0.99),
        "longest": loop.longest if loop.telemetry.accepted else math.nan,
    }
    record = {
        "robot": machine.name,
        **asdict(carried),
        "layout": live.layout,
        "duration": loop.seconds,
        "set_points": loop.ticks,
        "late": loop.late,
        "unsent": loop.unsent,
        "accepted": loop.telemetry.accepted,
        "faults": faults,
        "delay": {name: None if math.isnan(s) else s for name, s in delays.items()},
        "at_home": loop.cue.is_at_home,
        "center": limits.center.tolist(),
        "box": box_record(machine, limits.region),
        "proved": bool(limits.proof.holds),
        "speed_limits": limits.speed.tolist(),
        "acceleration_limits": limits.acceleration.tolist(),
    }
    rows = [(fault, str(count)) for fault, count in faults.items()]
    lines: list[Any] = [
        f"[bold]{plain(machine.name)}[/bold]{plain(str(carried))}, live for {loop.seconds:.4g} s: "
        f"{loop.ticks} set points; datagrams used: {loop.telemetry.accepted}",
        *box_lines(machine, limits.region),
        _limit_text(machine, limits),
    ]
    if loop.telemetry.accepted:
        ms = [f"{1e3 * seconds:.2f}" for seconds in delays.values()]
        lines.append(
            f"Delay from a datagram to its set points: median {ms[0]} ms, 99 % within {ms[1]} ms, "
            f"longest {ms[2]} ms"
        )
    if loop.late or loop.unsent:
        lines.append(f"Set points left out: {loop.late} by the clock, {loop.unsent} by the network")
    if rows:
        lines.append(table("datagrams not used", "count", rows=rows, numbers=("count",)))
    lines.append("The platform rests at home." if loop.cue.is_at_home else "It is not at home.")
    return CommandResult(record, lines)


def _limit_text(machine: Manipulator, limits: CueLimits) -> str:
    """Return the platform's limits and the share of the drives' that they take."""
    units = machine.platform.units
    speeds, accelerations = (
        " ".join(significant(number) for number in part.tolist())
        for part in (limits.speed, limits.acceleration)
    )
    text = (
        f"Limits of the platform by {' '.join(machine.coordinates)}: speed {speeds} "
        f"{units[0]}/s or {units[-1]}/s, acceleration {accelerations} {units[0]}/s^2 or "
        f"{units[-1]}/s^2"
    )
    shares = [
        f"{percent(share)} of the drives' {name}"
        for name, share in (("speed", limits.speed_share), ("force", limits.force_share))
        if not math.isnan(share)
    ]
    return text + (f", at most {' and '.join(shares)}" if shares else "")
