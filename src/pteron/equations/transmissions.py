"""Motors and transmissions as they are: bending, play, ripple, current, limits by speed.

`DriveKind` says which of these a machine's drives have, so that others cost nothing; their numbers
are an input. The motor's coordinate is counted at the joint: its angle over the ratio.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.bodies.motion import Expression
from pteron.legs import Drive
from pteron.legs.motor_limits import supply
from pteron.manipulator import Manipulator


@dataclass(frozen=True)
class DriveKind:
    """The features of the drives of a machine's joints, joint by joint."""

    dry: bool
    """Whether some have dry friction."""
    stribeck: bool
    elastic: tuple[bool, ...]
    play: tuple[bool, ...]
    lag: tuple[bool, ...]
    winding: tuple[bool, ...]
    lugre: tuple[bool, ...]
    curve: tuple[int, ...]
    """Points of the motor's curve."""
    ripple: tuple[int, ...]
    """Waves."""
    cogging: tuple[int, ...]

    @classmethod
    def of(cls, robot: Manipulator) -> DriveKind:
        """Return the kind of a machine's drives."""
        drives = [leg.drive or Drive() for leg in robot.legs]
        return cls(
            any((drive.coulomb or drive.stribeck) and not drive.lugre for drive in drives),
            any(drive.stribeck for drive in drives),
            tuple(drive.elastic is not None for drive in drives),
            tuple(bool(drive.elastic and drive.elastic.backlash) for drive in drives),
            tuple(drive.current_time is not None for drive in drives),
            tuple(drive.winding is not None for drive in drives),
            tuple(drive.lugre is not None for drive in drives),
            *(
                tuple(len(getattr(drive, name)) for drive in drives)
                for name in ("curve", "ripple", "cogging")
            ),
        )

    @property
    def bends(self) -> bool:
        """Whether some transmission bends."""
        return any(self.elastic)

    @property
    def more(self) -> tuple[tuple[str, str], ...]:
        """The states beyond pose and velocity, each (n,), and what their rates are called."""
        bends = ("motor", "motor_rate"), ("motor_rate", "motor_growth")
        own = [("current", "change")] * any(self.lag) + [("bristle", "yield")] * any(self.lugre)
        return (*(bends if self.bends else ()), *own)

    def parts(self, states: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return the parts of states (..., Y) by name: `pose`, `velocity` and those of `more`."""
        n, names = len(self.elastic), [name for name, _ in self.more]
        m = (states.shape[-1] - n * len(names)) // 2
        found = {"pose": states[..., :m], "velocity": states[..., m : 2 * m]}
        starts = range(2 * m, states.shape[-1], n)
        return found | {name: states[..., k : k + n] for name, k in zip(names, starts, strict=True)}

    @property
    def plain(self) -> bool:
        """Whether they are rigid and give at once what they are asked for."""
        return not any(any(getattr(self, f.name)) for f in fields(self)[2:])


class Actuators:
    """The numbers of `actuator_numbers`, taken one after another as expressions or names."""

    def __init__(self, kind: DriveKind, vector: Expression) -> None:
        names = _names(kind)
        self._at = {name: vector[k] for k, name in enumerate(names)}

    def __call__(self, name: str, joint: int, k: int = 0) -> Expression:
        """Return a number of a joint's drive."""
        return self._at[name, joint, k]


def actuator_numbers(robot: Manipulator) -> NDArray[np.float64]:
    """Return the numbers of a machine's motors and transmissions, at least one."""
    found = []
    for name, joint, k in _names(DriveKind.of(robot)):
        drive = robot.legs[joint].drive or Drive()
        bends, lugre = drive.elastic, drive.lugre
        value: Any = {
            "stiffness": bends and bends.stiffness,
            "damping": bends and bends.damping,
            "play": bends and bends.backlash / 2.0,
            "bristle": lugre and lugre.stiffness,
            "drag": lugre and lugre.damping,
            "lag": drive.current_time and 1.0 / drive.current_time,
            "stall": drive.winding and supply(drive)[0],
            "back": drive.winding and supply(drive)[1],
            "speed": drive.curve and drive.curve[min(k, len(drive.curve) - 1)][0],
            "force": drive.curve and drive.curve[min(k, len(drive.curve) - 1)][1],
        }.get(name)
        if value is None:
            which, part = name.split("_")
            wave = getattr(drive, which)[k]
            size = wave.size * (drive.gear if which == "cogging" else 1.0)
            value = {"order": wave.order * drive.gear, "size": size, "phase": wave.phase}[part]
        found.append(float(value))
    return np.array(found or [0.0])


def actuator_count(kind: DriveKind) -> int:
    """Return how many numbers `actuator_numbers` has."""
    return max(1, len(_names(kind)))


def _names(kind: DriveKind) -> list[tuple[str, int, int]]:
    """Return name, joint and place of each number."""
    found: list[tuple[str, int, int]] = []
    for i in range(len(kind.elastic)):
        found += [(name, i, 0) for name in ("stiffness", "damping") if kind.elastic[i]]
        found += [("play", i, 0)] if kind.play[i] else []
        found += [("lag", i, 0)] if kind.lag[i] else []
        found += [(name, i, 0) for name in ("bristle", "drag") if kind.lugre[i]]
        found += [(name, i, 0) for name in ("stall", "back") if kind.winding[i]]
        found += [(name, i, k) for k in range(kind.curve[i]) for name in ("speed", "force")]
        for which in ("ripple", "cogging"):
            parts = [f"{which}_{part}" for part in ("order", "size", "phase")]
            found += [(part, i, k) for k in range(getattr(kind, which)[i]) for part in parts]
    return found


def transmitted(
    kind: DriveKind, numbers: Actuators, i: int, bent: Expression, rate: Expression
) -> Expression:
    """Return the force that a bending transmission passes to its joint, of how it is bent."""
    stiffness, damping = numbers("stiffness", i), numbers("damping", i)
    if not kind.play[i]:
        return stiffness * bent + damping * rate
    half = numbers("play", i)
    ahead, behind = bent - half, bent + half
    return ca.if_else(ahead > 0, ca.fmax(stiffness * ahead + damping * rate, 0), 0) + ca.if_else(
        behind < 0, ca.fmin(stiffness * behind + damping * rate, 0), 0
    )


def wanted_force(
    kind: DriveKind, numbers: Actuators, i: int, asked: Expression, rate: Expression
) -> Expression:
    """Return what a motor's current is to give, after its limits at a speed."""
    if kind.curve[i]:
        speed, most = ca.fabs(rate), numbers("force", i)
        for k in range(1, kind.curve[i]):
            low, high = (numbers("speed", i, j) for j in (k - 1, k))
            slope = (numbers("force", i, k) - numbers("force", i, k - 1)) / (high - low)
            most = most + slope * (ca.fmin(ca.fmax(speed, low), high) - low)
        asked = ca.fmin(ca.fmax(asked, -most), most)
    if kind.winding[i]:
        stall, back = numbers("stall", i), numbers("back", i) * rate
        asked = ca.fmin(ca.fmax(asked, -stall - back), stall - back)
    return asked


def bristles(
    numbers: Actuators,
    i: int,
    bent: Expression,
    rate: Expression,
    most: Expression,
    pace: Expression,
) -> tuple[Expression, Expression]:
    """Return the friction of LuGre's bristles that slide at a friction of `most`, and their rate.

    They follow the rate of the joint no faster than at `pace`, 1/s, where they slide.
    """
    stiffness, speed = numbers("bristle", i), ca.fabs(rate)
    side = ca.if_else(rate > 0, 1, 0) - ca.if_else(rate < 0, 1, 0)
    growth = ca.fmin(stiffness * speed / most, pace) * (side * most / stiffness - bent)
    drag = numbers("drag", i) / (1 + numbers("drag", i) * speed / (4 * most))
    return stiffness * bent + drag * growth, growth


def motor_force(
    kind: DriveKind, numbers: Actuators, i: int, given: Expression, motor: Expression
) -> Expression:
    """Return what a motor gives with its ripple and cogging, where it stands."""
    share, more = ca.SX(1), ca.SX(0)
    for which, total in (("ripple", share), ("cogging", more)):
        for k in range(getattr(kind, which)[i]):
            order, size, phase = (numbers(f"{which}_{p}", i, k) for p in ("order", "size", "phase"))
            total = total + size * ca.sin(order * motor + phase)
        share, more = (total, more) if which == "ripple" else (share, total)
    return given * share + more
