"""The drive of an actuated joint: friction, the motor's inertia, limits of force and speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pteron.bodies.vectors import number
from pteron.errors import ModelError
from pteron.toml import told


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
        _check(self, least=("force",), above=("speed",))


@dataclass(frozen=True)
class Drive:
    """The drive of an actuated joint; its values hold at the joint unless they name the motor.

    It must give ratio^2 rotor_inertia q'' + (coulomb + stribeck) s(q') + viscous q' + offset beside
    the force of the rigid bodies. s is the sign where forces are compared with logs, and
    tanh(q'/rest_speed) in simulation and on a controller.

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
    rated_torque : float, optional
        Of the motor, N m: what commands in per cent are of.
    counts_per_turn : float, optional
        Counts of the motor's encoder in a turn of the motor: what logs in counts are in.
    max_force, max_speed : float, optional
        What the drive can do, N and m/s, or N m and rad/s, at the joint.
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

    def __post_init__(self) -> None:
        _check(
            self,
            free=("offset",),
            least=("coulomb", "viscous", "rotor_inertia"),
            above=("rest_speed", "rated_torque", "max_force", "max_speed", "counts_per_turn"),
            nonzero=("ratio",),
        )

    @property
    def gear(self) -> float:
        """The ratio, 1 where it is left out."""
        return 1.0 if self.ratio is None else self.ratio

    @property
    def inertia(self) -> float:
        """The motor's inertia at the joint, ratio^2 rotor_inertia, kg or kg m^2."""
        return self.gear**2 * self.rotor_inertia

    @property
    def rated_force(self) -> float | None:
        """The motor's rated torque at the joint, N or N m."""
        return None if self.rated_torque is None else abs(self.gear) * self.rated_torque


def _check(
    part: Any,
    free: tuple[str, ...] = (),
    least: tuple[str, ...] = (),
    above: tuple[str, ...] = (),
    nonzero: tuple[str, ...] = (),
) -> None:
    """Make a dataclass' fields floats: any, at least zero, above zero or None, not zero or None."""
    faults: list[str] = []
    for name in (*free, *least, *above, *nonzero):
        given = getattr(part, name)
        if given is None and name in (*above, *nonzero):
            continue
        try:
            value = number(given, name)
        except ModelError as error:
            faults += error.faults
            continue
        object.__setattr__(part, name, value)
        if name in least and value < 0.0:
            faults.append(f"{name}: {value:g} given, 0 or more expected")
        elif (name in above and value <= 0.0) or (name in nonzero and value == 0.0):
            wanted = "another number than 0" if name in nonzero else "a number above 0"
            faults.append(f"{name}: {value:g} given, {wanted} expected")
    if faults:
        raise ModelError(told(faults), faults=faults)
