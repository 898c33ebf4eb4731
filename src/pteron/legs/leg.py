"""What a kind of leg must supply: read this page before writing another.

A leg makes one actuated joint follow one point of the platform. It knows the platform only through
the motion of that point, c, and of the platform's angle, phi. A kind of leg is two classes in one
file of this folder:

- a frozen dataclass under `LegKind`: the leg's data, its TOML keys, its bodies, and what of its
  geometry the equations need (`quantities`);
- a class under `LegEquations`: built from these quantities, in numbers or in symbols, it answers a
  motion of c and phi with the motion of its joint and of its bodies (`motion`), says how far it
  reaches (`reach`) and where c lies for a given joint (`locus`).

Two lines bind them: `MyLeg.equations_class = MyEquations`, and `pteron.legs.KINDS[MyLeg.type] =
MyLeg`, after which files may name the kind.

That is all: Jacobian, dynamics, regressor, energies, limits, drawings, logs, exported code follow.
`examples/new_leg.py` is a complete kind of leg. `needs`, `transfers` and `named` may be
overridden: a cheaper form of the same forces, the mass transfers that explain base parameters in
symbols, and names in exported code.

All vectors are in the base frame, columns (3, 1). An expression has no branch on a value: the side
of an elbow is a quantity, +1 or -1.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from random import Random
from typing import Any, ClassVar, Literal, NamedTuple, Self

import casadi as ca

from pteron.bodies.inertia import Inertia
from pteron.bodies.motion import (
    AngleMotion,
    BodyMotion,
    Expression,
    Moments,
    PointMotion,
    needed_wrench,
)
from pteron.bodies.vectors import Vector, numbers
from pteron.errors import ModelError


@dataclass(frozen=True)
class ActuatedJoint:
    """How an actuated joint is spoken of: names of its columns, units, and a noun for messages."""

    noun: str
    coordinate: str
    unit: str
    force: str
    force_unit: str


SLIDER = ActuatedJoint("slider", "rho", "m", "force", "N")
CRANK = ActuatedJoint("crank", "theta", "rad", "torque", "N m")

Role = Literal["point", "direction", "normal", "platform point", "length", "angle", "sign"]
"""What a quantity is: a point or a unit vector in the base frame; a unit vector perpendicular to
the kind's first direction; a point in the platform frame; a length; an angle; +1 or -1."""


class Quantity(NamedTuple):
    """A part of a leg's geometry that its equations need, or that turns with the machine.

    `LegEquations` takes them all by name, also those that it has no use for.
    """

    name: str
    """The field of the leg that holds it; one without a field turns with nothing."""
    role: Role
    value: Sequence[float]
    symbol: str = ""
    """How a length or a direction is written: "lu" becomes lu1 for leg 1."""


class Joint(NamedTuple):
    """One joint of a leg's chain, from the base to the platform; the actuated one comes first."""

    kind: Literal["P", "R"]
    axis: Expression
    """Unit vector, (3, 1)."""
    point: Expression
    """A point on the axis, (3, 1)."""
    row: Expression
    """(1, 4): d rate / d (c', phi')."""
    rate: Expression
    acceleration: Expression


class LegMotion(NamedTuple):
    """What a leg does when its platform point and the platform's angle move."""

    coordinate: Expression
    """q, m or rad."""
    rate: Expression
    acceleration: Expression
    row: Expression
    """(1, 4), with `divisor`: dq / d (c, phi) = row / divisor. Kept apart, since forces need no
    division by it: it vanishes where the leg is singular (type I)."""
    divisor: Expression
    bodies: dict[str, BodyMotion]
    """By letter: "p" (slider), "u" (upper link or crank), "l" (lower link or rod); those it has. A
    lower link's reference point is the platform point, and its x points there from the joint."""
    chain: tuple[Joint, ...]
    """The joints from the base to the platform, all of them: their screws times their rates are the
    platform's twist. Their points, in this order, are what is drawn."""
    links: tuple[Expression | None, Expression | None] = (None, None)
    """l_u and l_l, where the leg has them."""
    turning: tuple[tuple[Expression, Expression] | None, ...] = (None, None)
    """Rate and acceleration of the angles of upper and lower link about the leg's axis d, where
    that describes their motion."""


class Needs(NamedTuple):
    """The forces that a leg's bodies need, rows of K columns as their parameters have."""

    joint: Expression
    """(1, K): at the actuated joint."""
    point: Expression
    """(4, K): a force on the platform point, and a moment about k on the platform."""
    mass: Expression
    """(1, K): a mass that rides on the platform point, left to the platform to carry."""


class Reach(NamedTuple):
    """Whether, and how well, a leg reaches a point."""

    margin: Expression
    """Metres to the edge of its reach, in the plane in which its links move; negative beyond it."""
    discriminant: Expression
    """The radicand of its closure: below 0 out of reach."""
    scale: Expression
    """The discriminant over `scale` is the square of the type-I measure."""
    spread: Expression
    """Metres; where it vanishes the elbow may be anywhere. Where it never may: any length."""

    @property
    def type_i(self) -> Expression:
        """The type-I measure, without unit: 0 where the leg is singular, 1 at best, NaN beyond.

        What is divided by it loses as many digits as it has zeros.
        """
        return ca.sqrt(self.discriminant / self.scale)


class Plane(NamedTuple):
    """Where c may be for a given joint: normal . c = offset."""

    normal: Expression
    offset: Expression
    size: Expression
    """The size of the terms that the offset adds up, by which its rounding is judged."""


class Sphere(NamedTuple):
    """Where c may be for a given joint: |c - center| = radius."""

    center: Expression
    radius: Expression


Locus = Plane | Sphere

Monomial = tuple[int, tuple[str, ...]]
"""An integer times a product of the leg's length symbols."""


class Transfer(NamedTuple):
    """A combination of a leg's parameters that no force notices, in symbols of its lengths."""

    reason: str
    """Why, with {} where the leg's number goes."""
    entries: Mapping[tuple[str, str], Monomial]
    """By (kind, body letter) of the parameter."""


class ReachBound(NamedTuple):
    """Every platform point in reach is within `radius` of a point, or of a line through it."""

    point: Vector
    line: Vector | None
    radius: float


class LegEquations(ABC):
    """The equations of one leg, for one state."""

    kinds: ClassVar[Mapping[str, tuple[str, ...]]]
    """The kinds of parameters of each body, by letter: those of the leg's `bodies`."""
    rides: ClassVar[tuple[str, ...]] = ()
    """The bodies whose reference point is the platform point: their mass may be the platform's."""
    constant_row: Expression | None = None
    """dq/dc, (3, 1), if it does not depend on the pose (and q not on phi); see `closures`."""

    @abstractmethod
    def motion(self, point: PointMotion, angle: AngleMotion | None) -> LegMotion:
        """Return what the leg does; `angle` is None where the platform does not turn."""

    @abstractmethod
    def reach(self, c: Expression) -> Reach:
        """Return whether the leg reaches c."""

    @abstractmethod
    def locus(self, q: Expression) -> Locus:
        """Return where c may be while the actuated joint is at q."""

    def named(self, point: PointMotion, angle: AngleMotion | None) -> dict[str, Expression]:
        """Return what exported code calls by name: scalars, or vectors (2, 1) or (3, 1)."""
        return {}

    def needs(
        self,
        point: PointMotion,
        angle: AngleMotion | None,
        gravity: Expression,
        inertia: Mapping[str, Moments],
    ) -> Needs:
        """Return the forces that the leg's bodies need: Eqs. (13) and (14), J_b^T F_b summed.

        A kind of leg may say it more cheaply, giving what its joint carries to `Needs.joint` and
        what is a mass on its platform point to `Needs.mass`; the tests hold that against this.
        """
        motion = self.motion(point, angle)
        columns = next(iter(inertia.values())).m.shape[1]
        total = ca.SX(4, columns)
        for letter, body in motion.bodies.items():
            force, moment = needed_wrench(body, inertia[letter], gravity)
            total = total + ca.mtimes(body.velocity_row.T, force)
            if body.axes is not None:
                total = total + ca.mtimes(body.turning_row.T, moment)
        return Needs(ca.SX(1, columns), total, ca.SX(1, columns))

    def riding(self, point: PointMotion, gravity: Expression, mass: Expression) -> Needs:
        """Return what a mass (1, K) on the platform point needs, where the platform has it not."""
        none = ca.SX(1, mass.shape[1])
        force = ca.mtimes(point.acceleration - gravity, mass)
        return Needs(none, ca.vertcat(force, none), none)


_EquationsClass = type[LegEquations]


class LegKind(ABC):
    """The data of one leg: a kind of leg is a frozen dataclass with these fields and its own.

    Parameters
    ----------
    guide_point : vector
        r, where the leg is fixed in the base frame: a point of the slider's guide, where its
        coordinate is zero, or the centre of the crank's circle; m.
    platform_point : vector
        s0, from P to the platform point, in the platform frame, m.
    elbow : {1, -1}
        sigma, the side of the elbow: the leg's branch.
    limits : (float, float), optional
        Least and greatest joint coordinate, m or rad.
    """

    guide_point: Vector
    platform_point: Vector
    elbow: int
    limits: tuple[float, float] | None

    type: ClassVar[str]
    """What the file's key `type` says."""
    joint: ClassVar[ActuatedJoint]
    equations_class: ClassVar[_EquationsClass]
    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    @abstractmethod
    def bodies(self) -> dict[str, Inertia]:
        """The inertia of its bodies, by letter in the order "p", "u", "l"."""

    @abstractmethod
    def with_bodies(self, bodies: Mapping[str, Any]) -> Self:
        """Return the same leg with other inertia, by letter."""

    @property
    @abstractmethod
    def quantities(self) -> tuple[Quantity, ...]:
        """What of its geometry the equations need, but for the platform point."""

    @abstractmethod
    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Return axes that span those about which the leg lets the platform turn.

        `axis` is k of a platform that turns about it, or None.
        """

    @property
    @abstractmethod
    def joint_axis(self) -> Vector:
        """The unit vector along which the slider moves, or about which the crank turns."""

    @property
    def lever(self) -> float:
        """Metres that the actuated body's end moves per unit of the joint: 1 for a slider."""
        return 1.0

    @property
    @abstractmethod
    def reach_bound(self) -> ReachBound:
        """A bound on the platform points in reach."""

    @property
    @abstractmethod
    def reach_text(self) -> str:
        """How far it reaches, as a clause for messages: "its links span 0.1 to 0.4 m"."""

    @classmethod
    @abstractmethod
    def table(cls) -> dict[str, Any]:
        """Return the TOML keys of its own: name -> (type, default), as pydantic takes them.

        `...` is the default of what must be given. Every kind has `type`, `guide_point`,
        `platform_point`, `elbow` and `limits` besides.
        """

    @classmethod
    @abstractmethod
    def of_table(cls, table: Any) -> Self:
        """Build the leg from a table that has been read."""

    @abstractmethod
    def as_table(self) -> dict[str, Any]:
        """Return the TOML keys of its own, for `save`."""

    @property
    def extents(self) -> dict[str, tuple[str, float, float, str]]:
        """Where a body's mass is expected: its TOML key, least and greatest x, what is there."""
        return {}

    @property
    def size(self) -> float:
        """The length that its reach is measured by, m."""
        return sum(float(q.value[0]) for q in self.quantities if q.role == "length")

    def equations(self, values: Mapping[str, Expression] | None = None) -> LegEquations:
        """Return its equations, for its own geometry or for other values of the quantities."""
        if values is None:
            values = {q.name: ca.SX(ca.DM(list(q.value))) for q in self.quantities}
        return self.equations_class(**values)

    def transfers(self, gravity: Vector) -> tuple[Transfer, ...]:
        """Return the mass transfers within the leg, for gravity in the base frame."""
        return ()

    @classmethod
    def closing(
        cls, values: Mapping[str, Sequence[Fraction]], rng: Random
    ) -> tuple[list[Fraction], int] | None:
        """Return a random c - r in fractions that the leg closes without a root, and its elbow.

        With it base parameters are proved in fractions as well as modulo a prime.
        """
        return None

    def turned(self, turn: Any) -> Self:
        """Return the leg with every base-frame vector v replaced by `turn(v)`."""
        vectors = [q.name for q in self.quantities if q.role in ("point", "direction", "normal")]
        given = {name: getattr(self, name, None) for name in vectors}
        return replace(self, **{name: turn(v) for name, v in given.items() if v is not None})


def checked_limits(limits: Sequence[float] | None, unit: str) -> tuple[float, float] | None:
    """Return limits as two floats, the least first."""
    if limits is None:
        return None
    low, high = numbers(limits, "limits", 2)
    if low >= high:
        raise ModelError(f"limits: {low:g} {unit} is not below {high:g} {unit}; give [least, most]")
    return (low, high)


def checked_elbow(elbow: object) -> int:
    """Return the elbow's side, 1 or -1."""
    if elbow not in (1, -1):
        raise ModelError(f"elbow: {elbow!r} is neither 1 nor -1")
    return 1 if elbow == 1 else -1
