"""The drive of an actuated joint: friction, the motor's inertia, limits of force and speed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Literal

from pteron.bodies.vectors import number
from pteron.errors import ModelError, shorten
from pteron.legs.screw import Screw
from pteron.toml import keep_checked, raise_faults


def _number_check(
    condition: Callable[[float], bool], expectation: str, optional: bool = True
) -> Callable[[object, str], float | None]:
    """Return a validator that accepts a number if `condition` holds, and None if `optional`."""

    def check(value: object, key: str) -> float | None:
        """Return `value` as a number if it meets the condition; None if optional and omitted."""
        if value is None and optional:
            return None
        converted = number(value, key)
        if not condition(converted):
            raise ModelError(f"{key}: {converted:g} given, {expectation} expected")
        return converted

    return check


_non_negative = _number_check(lambda value: value >= 0.0, "0 or more", optional=False)
_positive = _number_check(lambda value: value > 0.0, "a number above 0")
_nonzero = _number_check(lambda value: value != 0.0, "another number than 0")


@dataclass(frozen=True)
class Stribeck:
    """Dry friction that a joint has at rest and loses as it moves: force exp(-(q'/speed)^2).

    Parameters
    ----------
    force : float
        Friction that is added to Coulomb's at rest, N or N m.
    speed : float
        m/s or rad/s.
    """

    force: float
    speed: float

    def __post_init__(self) -> None:
        keep_checked(self, {"force": _non_negative, "speed": _positive})


@dataclass(frozen=True)
class LuGre:
    """Dry friction by bristles that bend before they slide: the LuGre model.

    Bristles bent by z push with stiffness z + damping z', and z' = q' - stiffness |q'| z / f(q'),
    where f is the drive's dry friction. At rest they yield, like a stiff spring; the stiffer they
    are the nearer they come to friction that sticks fast. The damping is less where the joint is
    fast, below 4 f / |q'|, so that they never bring energy.

    Parameters
    ----------
    stiffness, damping : float
        At the joint, N/m and N s/m, or N m/rad and N m s/rad.
    """

    stiffness: float
    damping: float = 0.0

    def __post_init__(self) -> None:
        keep_checked(self, {"damping": _non_negative, "stiffness": _positive})


@dataclass(frozen=True)
class Elastic:
    """An elastic transmission between motor and joint: force k d + c d' at a deflection d.

    Parameters
    ----------
    stiffness, damping : float
        k and c at the joint, N/m and N s/m, or N m/rad and N m s/rad.
    backlash : float
        Play between motor and joint in all, at the joint, m or rad. Where there is any, the teeth
        push alone: they do not hold each other as they part.
    encoder : {"motor", "joint", "both"}
        Where the encoder is. With both, a controller of `pteron.controllers` is told the joint's
        coordinate and the motor's rate, as drives with two encoders have it.
    """

    stiffness: float
    damping: float = 0.0
    backlash: float = 0.0
    encoder: Literal["motor", "joint", "both"] = "motor"

    def __post_init__(self) -> None:
        keep_checked(
            self, {"damping": _non_negative, "backlash": _non_negative, "stiffness": _positive}
        )
        if self.encoder not in ("motor", "joint", "both"):
            raise ModelError(
                f'encoder: {self.encoder!r} given, "motor", "joint" or "both" expected'
            )


@dataclass(frozen=True)
class Winding:
    """A motor's winding, whose voltage is limited: R i + k w is at most the supply's.

    Parameters
    ----------
    resistance : float
        R, ohm.
    torque_constant : float
        k, N m/A, which is V s/rad too.
    voltage : float
        Of the supply, V.
    """

    resistance: float
    torque_constant: float
    voltage: float

    def __post_init__(self) -> None:
        keep_checked(self, dict.fromkeys(("resistance", "torque_constant", "voltage"), _positive))


@dataclass(frozen=True)
class Wave:
    """A wave of a motor's torque: size sin(order angle + phase), by the motor's angle.

    Parameters
    ----------
    order : float
        Waves in a turn of the motor.
    size : float
        Share of the torque (ripple), or N m at the motor (cogging).
    phase : float
        rad.
    """

    order: float
    size: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        keep_checked(self, {"size": number, "phase": number, "order": _positive})


@dataclass(frozen=True)
class Drive:
    """The drive of an actuated joint; its values hold at the joint unless they name the motor.

    It must give ratio^2 rotor_inertia q'' + (coulomb + stribeck) s(q') + viscous q' + offset beside
    the force of the rigid bodies. s is the sign where forces are compared with logs,
    tanh(q'/rest_speed) on a controller, and in simulation what rest asks for where a joint sticks.

    Parameters
    ----------
    coulomb, viscous, offset : float
        Friction, N, N s/m and N; at cranks N m, N m s and N m. A balancing spring is an offset.
    rotor_inertia : float
        Inertia of the motor about its own axis, with what turns with it, kg m^2.
    ratio : float, optional
        Motor angle over the joint's coordinate, rad/m or rad/rad; left out, the motor turns, or
        moves, as the joint does.
    rest_speed : float
        Half the width of the range of speeds within which dry friction changes its sign smoothly,
        m/s or rad/s.
    stribeck : Stribeck, optional
        What dry friction has more at rest.
    lugre : LuGre, optional
        Bristles by which dry friction acts in simulation, in place of sticking fast.
    rated_torque : float, optional
        Of the motor, N m: what commands in per cent are of.
    counts_per_turn : float, optional
        Counts of the motor's encoder in a turn of the motor: what logs in counts are in.
    max_force, max_speed : float, optional
        What the drive can do, N and m/s, or N m and rad/s, at the joint.
    elastic : Elastic, optional
        A transmission that bends. The friction is then the motor's, before it.
    current_time : float, optional
        Time constant of the current loop, s.
    curve : sequence of (speed, force), optional
        Greatest force by speed, at the joint, straight between: the motor's curve. Beyond the last
        speed there is the last force.
    winding : Winding, optional
        The motor's winding and its supply.
    ripple, cogging : sequence of Wave
        Waves of the motor's torque: as a share of it, and without current.
    screw : Screw, optional
        The ball screw that moves the joint: its inertia counts, and `size` counts its efficiency
        and its critical speed.
    """

    coulomb: float = 0.0
    viscous: float = 0.0
    offset: float = 0.0
    rotor_inertia: float = 0.0
    ratio: float | None = None
    rest_speed: float = 1e-3
    stribeck: Stribeck | None = None
    rated_torque: float | None = None
    max_force: float | None = None
    max_speed: float | None = None
    counts_per_turn: float | None = None
    elastic: Elastic | None = None
    current_time: float | None = None
    curve: tuple[tuple[float, float], ...] = ()
    winding: Winding | None = None
    ripple: tuple[Wave, ...] = ()
    cogging: tuple[Wave, ...] = ()
    lugre: LuGre | None = None
    screw: Screw | None = None

    def __post_init__(self) -> None:
        faults = self._wrong_parts()
        above = ("rest_speed", "rated_torque", "max_force", "max_speed", "counts_per_turn")
        checks = {
            "offset": number,
            **dict.fromkeys(("coulomb", "viscous", "rotor_inertia"), _non_negative),
            **dict.fromkeys((*above, "current_time"), _positive),
            "ratio": _nonzero,
        }
        try:
            keep_checked(self, checks)
        except ModelError as error:
            faults += error.faults
        faults += self._contradictions({fault.split(":")[0] for fault in faults})
        raise_faults(faults)

    def _wrong_parts(self) -> list[str]:
        """Return the faults of drive parts of a wrong type; convert lists to tuples in place."""
        faults = []
        parts: dict[str, type] = {
            "stribeck": Stribeck,
            "lugre": LuGre,
            "elastic": Elastic,
            "winding": Winding,
        }
        parts["screw"] = Screw
        for name, kind in parts.items():
            part = getattr(self, name)
            if part is not None and not isinstance(part, kind):
                article = "an" if name == "elastic" else "a"
                faults.append(f"{name}: {shorten(part)} given, {article} {kind.__name__} expected")
        for name in ("curve", "ripple", "cogging"):
            part = getattr(self, name)
            try:
                converted = tuple(() if part is None else part)
                if name == "curve":
                    converted = tuple((float(speed), float(force)) for speed, force in converted)
                    good = all(isfinite(number) for pair in converted for number in pair)
                else:
                    good = all(isinstance(wave, Wave) for wave in converted)
            except (TypeError, ValueError):
                good = False
            if good:
                object.__setattr__(self, name, converted)
            else:
                expectation = (
                    "pairs of numbers, speed and force," if name == "curve" else "a list of Wave"
                )
                faults.append(f"{name}: {shorten(part)} given, {expectation} expected")
        return faults

    def _contradictions(self, wrong: set[str]) -> list[str]:
        """Return the contradictions between the drive's parts, the names in `wrong` left out."""
        faults = []
        if "elastic" not in wrong and self.elastic and not self.rotor_inertia:
            faults.append(
                "elastic: needs rotor_inertia, since the motor moves by itself; give it, kg m^2"
            )
        if "lugre" not in wrong and self.lugre and not self.coulomb:
            faults.append("lugre: needs coulomb, the friction at which its bristles slide; give it")
        for name in sorted({"winding", "ripple", "cogging", "screw"} - wrong):
            if getattr(self, name) and self.ratio is None:
                faults.append(f"{name}: needs ratio, of the motor's angle; give it, 1 for none")
        curve = () if "curve" in wrong else self.curve
        speeds = [speed for speed, _ in curve]
        if curve and (speeds[0] < 0.0 or sorted({*speeds}) != speeds):
            faults.append("curve: speeds from 0 up expected, in ascending order")
        if any(force < 0.0 for _, force in curve):
            faults.append("curve: forces of 0 or more expected")
        most = max((force for _, force in curve), default=0.0)
        if curve and "max_force" not in wrong and (self.max_force or 0.0) > most:
            faults.append(
                f"max_force: {self.max_force:g} given, but the curve has {most:g} at most; leave "
                "one of them out, or make them agree"
            )
        return faults

    @property
    def gear(self) -> float:
        """The gear ratio: motor rad per rad of a crank or per m of a slider; 1 by default."""
        return 1.0 if self.ratio is None else self.ratio

    @property
    def inertia(self) -> float:
        """The inertia of rotor and screw reflected to the joint, kg or kg m^2.

        The rotor's is ratio^2 rotor_inertia.
        """
        return self.gear**2 * self.rotor_inertia + self.screw_inertia

    @property
    def screw_inertia(self) -> float:
        """The inertia of the screw reflected to the joint, kg; 0 without one."""
        return 0.0 if self.screw is None else self.screw.reflected_inertia

    @property
    def rated_force(self) -> float | None:
        """The motor's rated torque as a force at the joint, N or N m; None if not given."""
        return None if self.rated_torque is None else abs(self.gear) * self.rated_torque
