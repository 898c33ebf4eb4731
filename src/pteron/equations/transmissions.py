"""Motors and transmissions: elasticity, backlash, ripple, current lag, torque-speed limits.

`DriveKind` has the features of a machine's drives, so that others cost nothing; their numbers are
an input. The motor's coordinate is referred to the joint: its angle over the ratio.
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
    """Whether any has dry friction."""
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
    def from_robot(cls, robot: Manipulator) -> DriveKind:
        """Return which features (friction, elasticity, limits ...) the drives of a machine have."""
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
        """Whether any transmission is elastic."""
        return any(self.elastic)

    @property
    def extra_states(self) -> tuple[tuple[str, str], ...]:
        """Names of the drives' extra states, (n,) each, and of their time derivatives."""
        bends = ("motor", "motor_rate"), ("motor_rate", "motor_growth")
        lag_states = [("current", "change")] * any(self.lag) + [("bristle", "yield")] * any(
            self.lugre
        )
        return (*(bends if self.bends else ()), *lag_states)

    def parts(self, states: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return state vectors (..., Y) split by name: pose, velocity and extra drive states."""
        n, names = len(self.elastic), [name for name, _ in self.extra_states]
        m = (states.shape[-1] - n * len(names)) // 2
        by_name = {"pose": states[..., :m], "velocity": states[..., m : 2 * m]}
        starts = range(2 * m, states.shape[-1], n)
        return by_name | {
            name: states[..., k : k + n] for name, k in zip(names, starts, strict=True)
        }

    @property
    def plain(self) -> bool:
        """Whether no drive has an elastic transmission, lag, winding, ripple or other extra."""
        return not any(any(getattr(self, f.name)) for f in fields(self)[2:])


class Actuators:
    """The numbers of `actuator_numbers` by name, joint and index, as expressions or names."""

    def __init__(self, kind: DriveKind, vector: Expression) -> None:
        names = _names(kind)
        self._at = {name: vector[k] for k, name in enumerate(names)}

    def __call__(self, name: str, joint: int, k: int = 0) -> Expression:
        """Return the parameter `name` (with index k) of a joint's drive."""
        return self._at[name, joint, k]


def actuator_numbers(robot: Manipulator) -> NDArray[np.float64]:
    """Return the parameters (k,) of a machine's motors and transmissions, k >= 1."""
    numbers = []
    for name, joint, k in _names(DriveKind.from_robot(robot)):
        drive = robot.legs[joint].drive or Drive()
        bends, lugre = drive.elastic, drive.lugre
        number: Any = {
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
        if number is None:
            which, part = name.split("_")
            wave = getattr(drive, which)[k]
            size = wave.size * (drive.gear if which == "cogging" else 1.0)
            number = {"order": wave.order * drive.gear, "size": size, "phase": wave.phase}[part]
        numbers.append(float(number))
    return np.array(numbers or [0.0])


def actuator_count(kind: DriveKind) -> int:
    """Return the number of parameters that `actuator_numbers` returns for these drives."""
    return max(1, len(_names(kind)))


def _names(kind: DriveKind) -> list[tuple[str, int, int]]:
    """Return (name, joint, index) of each parameter of the motors and transmissions."""
    names: list[tuple[str, int, int]] = []
    for i in range(len(kind.elastic)):
        names += [(name, i, 0) for name in ("stiffness", "damping") if kind.elastic[i]]
        names += [("play", i, 0)] if kind.play[i] else []
        names += [("lag", i, 0)] if kind.lag[i] else []
        names += [(name, i, 0) for name in ("bristle", "drag") if kind.lugre[i]]
        names += [(name, i, 0) for name in ("stall", "back") if kind.winding[i]]
        names += [(name, i, k) for k in range(kind.curve[i]) for name in ("speed", "force")]
        for which in ("ripple", "cogging"):
            parts = [f"{which}_{part}" for part in ("order", "size", "phase")]
            names += [(part, i, k) for k in range(getattr(kind, which)[i]) for part in parts]
    return names


def transmission_force(
    kind: DriveKind, numbers: Actuators, i: int, deflection: Expression, rate: Expression
) -> Expression:
    """Return the force of joint i's elastic transmission, N or N m, from deflection and rate."""
    stiffness, damping = numbers("stiffness", i), numbers("damping", i)
    if not kind.play[i]:
        return stiffness * deflection + damping * rate
    half_play = numbers("play", i)
    ahead, behind = deflection - half_play, deflection + half_play
    return ca.if_else(ahead > 0, ca.fmax(stiffness * ahead + damping * rate, 0), 0) + ca.if_else(
        behind < 0, ca.fmin(stiffness * behind + damping * rate, 0), 0
    )


def limited_motor_force(
    kind: DriveKind, numbers: Actuators, i: int, force: Expression, rate: Expression
) -> Expression:
    """Return the commanded force limited to what motor i can give at its rate."""
    if kind.curve[i]:
        speed, most = ca.fabs(rate), numbers("force", i)
        for k in range(1, kind.curve[i]):
            low, high = (numbers("speed", i, j) for j in (k - 1, k))
            slope = (numbers("force", i, k) - numbers("force", i, k - 1)) / (high - low)
            most = most + slope * (ca.fmin(ca.fmax(speed, low), high) - low)
        force = ca.fmin(ca.fmax(force, -most), most)
    if kind.winding[i]:
        stall, back = numbers("stall", i), numbers("back", i) * rate
        force = ca.fmin(ca.fmax(force, -stall - back), stall - back)
    return force


def bristles(
    numbers: Actuators,
    i: int,
    deflection: Expression,
    rate: Expression,
    most: Expression,
    pace: Expression,
) -> tuple[Expression, Expression]:
    """Return LuGre friction of joint i, N or N m, and the rate of its bristle deflection.

    Sliding bristles follow the joint's rate with a rate constant of at most `pace`, 1/s.
    """
    stiffness, speed = numbers("bristle", i), ca.fabs(rate)
    side = ca.if_else(rate > 0, 1, 0) - ca.if_else(rate < 0, 1, 0)
    growth = ca.fmin(stiffness * speed / most, pace) * (side * most / stiffness - deflection)
    drag = numbers("drag", i) / (1 + numbers("drag", i) * speed / (4 * most))
    return stiffness * deflection + drag * growth, growth


def motor_force(
    kind: DriveKind, numbers: Actuators, i: int, force: Expression, motor: Expression
) -> Expression:
    """Return the force of motor i with ripple and cogging at its coordinate, N or N m."""
    ripple_factor, cogging_force = ca.SX(1), ca.SX(0)
    for which, total in (("ripple", ripple_factor), ("cogging", cogging_force)):
        for k in range(getattr(kind, which)[i]):
            order, size, phase = (numbers(f"{which}_{p}", i, k) for p in ("order", "size", "phase"))
            total = total + size * ca.sin(order * motor + phase)
        ripple_factor, cogging_force = (
            (total, cogging_force) if which == "ripple" else (ripple_factor, total)
        )
    return force * ripple_factor + cogging_force
