"""Layouts of the datagrams by which driving and flight simulators report a vehicle's motion.

Each layout turns the bytes of a datagram into its time stamp and a sample in the vehicle's axes (x
ahead, y to the left, z up): accelerations, m/s^2, and angular rates, rad/s.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pteron.errors import DataError, shorten
from pteron.motion.cueing import COLUMNS
from pteron.tables.table import join_names

Sample = tuple[float, ...]
"""Accelerations ax ay az, m/s^2, and rates wx wy wz, rad/s."""

_GREATEST_ACCELERATION, _GREATEST_RATE = 200.0, 50.0
"""Bounds of plausible samples, m/s^2 and rad/s: the loads of a crash, and eight turns a second,
which no road vehicle or aeroplane survives."""

_RESTART = 1.0
"""A time stamp that is earlier by more than this, s, is a simulator that has begun again, not a
datagram that was overtaken on its way."""


class BadDatagram(ValueError):
    """A datagram that is not of its layout; its text is the kind of fault, to be counted."""


class Paused(Exception):
    """A datagram by which a simulator says that nothing moves, as in its menus."""


@dataclass(frozen=True)
class DatagramLayout:
    """A layout of datagrams.

    Attributes
    ----------
    title : str
        The simulator, for people.
    source : str
        The page that documents it.
    decode : callable
        Returns time stamp, s, and sample of a datagram; raises `BadDatagram` or `Paused`.
    """

    title: str
    source: str
    decode: Callable[[bytes], tuple[float, Sample]]


def _decode_json(datagram: bytes) -> tuple[float, Sample]:
    """Decode an object with the numbers t, ax, ay, az, wx, wy and wz."""
    try:
        record = json.loads(datagram)
        t, *sample = (float(record[name]) for name in COLUMNS)
    except (ValueError, TypeError, KeyError, RecursionError, OverflowError):
        raise BadDatagram("not of the layout") from None
    return t, tuple(sample)


def _decode_csv(datagram: bytes) -> tuple[float, Sample]:
    """Decode a line of seven numbers: t, ax, ay, az, wx, wy, wz."""
    if len(datagram) > 512:  # seven numbers of any digits fit
        raise BadDatagram("wrong length")
    try:
        t, *sample = map(float, datagram.split(b","))
    except ValueError:
        raise BadDatagram("not of the layout") from None
    if len(sample) != len(COLUMNS) - 1:
        raise BadDatagram("not of the layout")
    return t, tuple(sample)


_FORZA = struct.Struct("<iI12x3f12x3f")
"""IsRaceOn, TimestampMS, acceleration and angular velocity, in the car's axes x to the right, y up,
z ahead; between them three speeds of the engine and the velocity."""

_FORZA_LENGTHS = (232, 311, 324, 331)
"""Bytes of "Sled" and of "Dash" of Motorsport 7, Horizon 4 and later, and Motorsport (2023)."""


def _decode_forza(datagram: bytes) -> tuple[float, Sample]:
    """Decode a datagram of Forza's Data Out; its axes are left-handed."""
    if len(datagram) not in _FORZA_LENGTHS:
        raise BadDatagram("wrong length")
    racing, t, right, up, ahead, pitch, yaw, roll = _FORZA.unpack_from(datagram)
    if not racing:
        raise Paused
    # A rotation about a left-handed axis has the other sense; y to the left turns it once more.
    return 1e-3 * t, (ahead, -right, up, -roll, pitch, -yaw)


_OUTSIM = struct.Struct("<I12f")
"""Time, angular velocity, heading, pitch, roll, acceleration and velocity; the position follows,
and an identifier where one is set."""

_OUTSIM_LENGTHS = (64, 68)
"""Bytes without and with the identifier."""


def _decode_outsim(datagram: bytes) -> tuple[float, Sample]:
    """Decode an OutSim datagram; its vectors are in world axes, x and y on the ground, z up."""
    if len(datagram) not in _OUTSIM_LENGTHS:
        raise BadDatagram("wrong length")
    t, *numbers = _OUTSIM.unpack_from(datagram)
    rates, angles, acceleration = numbers[0:3], numbers[3:6], numbers[6:9]
    if not all(map(math.isfinite, angles)):
        raise BadDatagram("not a finite number")
    (a, b, c), (u, v, w) = (_to_car(vector, angles) for vector in (acceleration, rates))
    # The car's x is to the right, its y ahead.
    return 1e-3 * t, (b, -a, c, v, -u, w)


def _to_car(vector: Sequence[float], angles: Sequence[float]) -> tuple[float, float, float]:
    """Return a world vector in the car's axes: turned by heading (z), pitch (x), then roll (y)."""
    x, y, z = vector
    (sh, ch), (sp, cp), (sr, cr) = ((math.sin(angle), math.cos(angle)) for angle in angles)
    x, y = ch * x + sh * y, ch * y - sh * x
    y, z = cp * y + sp * z, cp * z - sp * y
    return cr * x - sr * z, y, cr * z + sr * x


LAYOUTS = {
    "json": DatagramLayout(
        "any program, an object with t ax ay az wx wy wz", "RFC 8259", _decode_json
    ),
    "csv": DatagramLayout(
        "FlightGear by its generic protocol, or any program: t,ax,ay,az,wx,wy,wz",
        "FlightGear, Docs/README.protocol",
        _decode_csv,
    ),
    "forza": DatagramLayout(
        'Forza Motorsport and Forza Horizon, "Data Out"',
        "https://support.forzamotorsport.net/hc/en-us/articles/21742934024211",
        _decode_forza,
    ),
    "outsim": DatagramLayout(
        "Live for Speed, OutSim",
        "Live for Speed, docs/InSim.txt; https://www.lfs.net/forum/thread/93701",
        _decode_outsim,
    ),
}
"""The layouts by the names that commands accept."""


class Telemetry:
    """The samples of a stream of datagrams: each is checked, and faults are counted by kind.

    Parameters
    ----------
    layout : str
        One of `LAYOUTS`.
    flip : sequence of str
        Columns whose sign is changed, such as "ay": for a simulator with other axes.

    Attributes
    ----------
    accepted : int
        Number of datagrams that gave a sample.
    stamp : float or None
        The time stamp of the last one, s.
    faults : dict of str to int
        Number of others by the kind of fault.
    """

    def __init__(self, layout: str, flip: Sequence[str] = ()) -> None:
        if layout not in LAYOUTS:
            raise DataError(f"layout: {shorten(layout)} given, {join_names(list(LAYOUTS))} known")
        unknown = sorted(set(flip) - set(COLUMNS[1:]))
        if unknown:
            raise DataError(
                f"flip: {shorten(unknown[0])} given, {join_names(list(COLUMNS[1:]))} expected"
            )
        self._decode = LAYOUTS[layout].decode
        self._signs = [-1.0 if name in flip else 1.0 for name in COLUMNS[1:]]
        self.stamp: float | None = None
        self.accepted = 0
        self.faults: dict[str, int] = {}

    def sample(self, datagram: bytes) -> Sample | None:
        """Return the sample of a datagram; None where it has none, which is counted."""
        try:
            t, sample = self._decode(datagram)
            self._check(t, sample)
        except Paused:
            self.count("simulator paused")
            return None
        except BadDatagram as fault:
            self.count(str(fault))
            return None
        self.stamp = t
        self.accepted += 1
        return tuple(sign * number for sign, number in zip(self._signs, sample, strict=True))

    def count(self, fault: str, number: int = 1) -> None:
        """Count datagrams that were not used, by the reason."""
        self.faults[fault] = self.faults.get(fault, 0) + number

    def _check(self, t: float, sample: Sample) -> None:
        """Raise BadDatagram unless time and sample are finite, plausible and later than before."""
        if not math.isfinite(t) or not all(map(math.isfinite, sample)):
            raise BadDatagram("not a finite number")
        largest = max(map(abs, sample[:3])), max(map(abs, sample[3:]))
        if largest[0] > _GREATEST_ACCELERATION or largest[1] > _GREATEST_RATE:
            raise BadDatagram("implausibly large")
        if self.stamp is not None and self.stamp - _RESTART <= t <= self.stamp:
            raise BadDatagram("late or repeated")
