"""`LegKind`, the data of one leg: geometry, bodies, limits, drive; read `legs.leg` first."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from itertools import product
from random import Random
from typing import Any, ClassVar, Literal, NamedTuple, Self, get_args

import casadi as ca

from pteron.bodies.inertia import Inertia, PointMass
from pteron.bodies.motion import Expression
from pteron.bodies.parameters import LEG_BODIES
from pteron.bodies.vectors import Vector, complement
from pteron.legs.drive import Drive
from pteron.legs.keys import COMMON, FieldCondition, Key, KeyRole, parameters_section, sound_fields
from pteron.legs.leg import LegEquations, LegMotion, Passive
from pteron.legs.reading import Reading
from pteron.renamed import adopt_former_methods, former_attribute, former_name
from pteron.tolerances import ROUNDING
from pteron.toml import raise_faults


@dataclass(frozen=True)
class ActuatedJoint:
    """The names of an actuated joint: its columns, its units, a noun for messages, and its zero."""

    noun: str
    coordinate: str
    unit: str
    force: str
    force_unit: str
    zero: str = ""
    """The zero and the sense of the coordinate."""


_TURN = "rad", "torque", "N m"
SLIDER = ActuatedJoint(
    *("slider", "rho", "m", "force", "N"), "0 at its guide_point, positive along its axis"
)
CRANK = ActuatedJoint(
    *("crank", "theta", *_TURN),
    "0 along its zero_direction, positive by the right-hand rule about its axis",
)
SHAFT = ActuatedJoint("shaft", "theta", *_TURN, "its gear ratio times phi")

Role = Literal["point", "direction", "normal", "length", "number", "sign"]
"""The role of a quantity: a point or a unit vector in the base frame; a unit vector that no force
depends on, as an axis perpendicular to the kind's first direction; a length; a number; +1 or -1."""


class LegQuantity(NamedTuple):
    """A part of a leg's geometry that its equations need, or that rotates with the machine.

    `LegEquations` takes all of them by name, also those that it ignores.
    """

    name: str
    """The field of the leg that holds it; one without a field rotates with none."""
    role: Role
    value: Sequence[float]
    symbol: str = ""
    """The letters of a length or a direction: "lu" becomes lu1 for leg 1."""


Monomial = tuple[int, tuple[str, ...]]
"""An integer times a product of the leg's length symbols."""


class LegTransfer(NamedTuple):
    """A combination of a leg's parameters without effect on any force, in its length symbols."""

    reason: str
    """The reason, with {} for the leg's number."""
    entries: Mapping[tuple[str, str], Monomial]
    """The combination's factors, by (kind, body letter) of the parameter."""


class ReachBound(NamedTuple):
    """Every platform point in reach is within `radius` of a point, or of a line through it."""

    point: Vector
    line: Vector | None
    """The direction of a slider: the platform point is within `radius` of point + q line."""
    radius: float


_EquationsClass = type[LegEquations]


class LegKind(ABC):
    """The data of one leg: a kind of leg is a frozen dataclass with these fields and its own.

    `pteron.legs.keys.COMMON` describes them; a kind's own `keys` may override it.
    """

    guide_point: Vector
    platform_point: Vector
    fixed_offset: Vector
    elbow: int
    limits: tuple[float, float] | None
    drive: Drive | None
    reading: Reading | None

    type: ClassVar[str]
    """The value of the file's key `type`."""
    joint: ClassVar[ActuatedJoint]
    names: ClassVar[Mapping[str, str]] = {"p": "slider", "u": "upper link", "l": "lower link"}
    """The names of its bodies, by letter."""
    branches: ClassVar[tuple[int, ...]] = (1, -1)
    """The values that `elbow` may have."""
    sign_edges: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "elbow": ("stretched", "folded", "reach")
    }
    """The fields that hold the signs of its branch, with the edges of its reach, by their names in
    `LegEquations.edges`, where the branches of both signs meet."""
    follows_angle: ClassVar[bool] = False
    """Whether its joint follows the platform's angle, and not its platform point."""
    couples_vary: ClassVar[bool] = False
    """Whether its couples turn with the pose, so that they may leave its platform a turn within
    reach: conditions on poses then count the constraint measure as they count type II."""
    account: ClassVar[str] = ""
    """Its construction in a few sentences for a report; vectors by their letters r, d, e, k, s0."""
    measure_text: ClassVar[str] = ""
    """The meaning of its type-I measure, as a clause for a report."""
    has_constant_measure: ClassVar[bool] = False
    """Whether its type-I measure is 1 in every pose."""
    singular_text: ClassVar[str] = "it is stretched or folded"
    """Its configuration where that is zero, as a clause for messages."""
    keys: ClassVar[Mapping[str, Key]]
    """Its own fields, which are its TOML keys, and their descriptions; see `every_key`."""
    base_cones: ClassVar[tuple[str, ...]] = ()
    """The keys of cones whose axis is in the base frame."""
    platform_axes: tuple[Vector, ...] = ()
    """The axes about which its platform must turn, one after the other; none where any will do."""
    conditions: ClassVar[tuple[FieldCondition, ...]] = ()
    """Conditions between its fields."""
    equations_class: ClassVar[_EquationsClass]
    __dataclass_fields__: ClassVar[dict[str, Any]]

    def __init_subclass__(cls) -> None:
        adopt_former_methods(
            cls,
            closing="draw_closure",
            under="with_platform_frame",
            turned="map_vectors",
            passive="passive_joints",
            doubts="unlikely_values",
        )
        # The keys are the single source of the fields' descriptions.
        if cls.__doc__ and "keys" in vars(cls) and "Parameters\n" not in cls.__doc__:
            cls.__doc__ = cls.__doc__.rstrip() + parameters_section(cls.every_key())

    def __post_init__(self) -> None:
        sound, faults = self.check_fields({name: getattr(self, name) for name in self.every_key()})
        raise_faults(faults)
        for name, field_value in sound.items():
            object.__setattr__(self, name, field_value)

    @classmethod
    def check_fields(cls, fields: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
        """Return the valid fields of a leg, converted, and the faults of the others."""
        return sound_fields(fields, cls.every_key(), cls.conditions, cls.branches)

    @classmethod
    @cache
    def every_key(cls) -> dict[str, Key]:
        """Return all keys of this kind of leg by name, in the order of files and pages."""
        roles, keys = get_args(KeyRole), {**COMMON, **cls.keys}
        return dict(sorted(keys.items(), key=lambda named_key: roles.index(named_key[1].role)))

    @classmethod
    def sign_choices(cls) -> list[tuple[int, ...]]:
        """Return the values of `signs` in each branch of this kind of leg."""
        values = (cls.branches if name == "elbow" else (1, -1) for name in cls.sign_edges)
        return list(product(*values))

    @property
    def signs(self) -> dict[str, int]:
        """The signs of the leg's branch, 1 or -1, by their fields."""
        return {name: getattr(self, name) for name in self.sign_edges}

    @property
    def bodies(self) -> dict[str, Inertia]:
        """The inertia of the leg's bodies by letter: "p" slider, "u" upper, "l" lower link."""
        inertias: dict[str, Inertia] = {}
        for name, key in self.every_key().items():
            if key.body:
                field_value = getattr(self, name)
                inertias[key.body] = PointMass(field_value) if key.role == "slider" else field_value
        return {letter: inertias[letter] for letter in LEG_BODIES if letter in inertias}

    def with_bodies(self, bodies: Mapping[str, Any]) -> Self:
        """Return the leg with other inertia of its bodies, given by letter."""
        new = {}
        for name, key in self.keys.items():
            if key.body:
                body = bodies[key.body]
                new[name] = body.mass if key.role == "slider" else body
        return replace(self, **new)

    def with_length(self, body: str, length: float) -> Self | None:
        """Return the leg with its "upper" or "lower" link of another length, m.

        The result is None if the leg has no such link.
        """
        key = f"{body}_length"
        return replace(self, **{key: length}) if key in self.every_key() else None

    def with_zero(self, zero: float) -> Self | None:
        """Return the leg with its coordinate counted from `zero`, m or rad, or None.

        Limits and `reading` are shifted too, so that the drive's readings are unchanged. The result
        is None for coordinates whose zero is fixed, such as a ram's length.
        """
        changed = self.zero_at(zero)
        if changed is None:
            return None
        if self.limits is not None:
            changed["limits"] = tuple(limit - zero for limit in self.limits)
        if self.reading is not None:
            changed["reading"] = replace(self.reading, zero=self.reading.zero - zero)
        return replace(self, **changed)

    def zero_at(self, zero: float) -> dict[str, Any] | None:
        """Return the fields that count the joint coordinate from `zero`; None if it cannot."""
        return None

    @property
    def crank_at_zero(self) -> Vector | None:
        """The unit vector along which the crank points at joint coordinate 0.

        None without a crank.
        """
        return None

    def with_turned_crank(self, turn: Any) -> Self | None:
        """Return the leg with every direction v of its crank replaced by `turn(v)`, or None.

        None without a crank.
        """
        return None

    @property
    def goes_round(self) -> bool:
        """Whether a full turn of the actuated joint gives the same pose, as a crank's does."""
        return self.joint.unit == "rad" and not self.follows_angle

    @property
    @abstractmethod
    def quantities(self) -> tuple[LegQuantity, ...]:
        """The geometric quantities that the leg's equations need, except the platform point."""

    @abstractmethod
    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Return axes that span the platform rotations that the leg does not constrain.

        `axis` is the axis k about which the platform turns, or None.
        """

    def couples(self, motion: LegMotion, axis: Vector | None) -> Sequence[Expression] | None:
        """Return the leg's constraint couples (3, 1) on the platform, each of length 1 or less.

        They constrain rotations of the part of the platform that the leg carries; each vanishes
        where it loses its effect. `axis` is that of `free_axes`. The result is None if the file
        does not define the couples.
        """
        return [ca.SX(row) for row in complement(self.free_axes(axis))]

    @property
    def plane_normal(self) -> Vector | None:
        """The normal of the plane in which a planar leg keeps its platform point; else None."""
        return None

    def with_platform_frame(self, frame: Sequence[Vector]) -> Self:
        """Return the leg with a missing `direction` filled in from the platform's frame.

        `frame` is the platform's x, y and z at angles zero, in the base frame.
        """
        return self

    def with_platform_rotation(self, axes: Sequence[Vector], center: Vector | None) -> Self:
        """Return the leg with what it takes from its platform's rotation; raise if that is another.

        `axes` are the platform's rotation axes at angles zero, `center` is the point that stays, or
        None.
        """
        return self

    @property
    def joint_axis(self) -> Vector | None:
        """The unit vector along which the slider moves, or about which the crank turns.

        None where the driven joint moves with the leg, as a ram does.
        """
        return None

    @property
    def base_axis(self) -> Vector | None:
        """The axis of the leg's joint at the base, for pictures; None where it is not defined.

        None where it is not defined.
        """
        return self.joint_axis or self.plane_normal

    @property
    def screw_lead(self) -> float | None:
        """The lead of a ram's screw, m per turn of the piston about its axis; None without one."""
        return None

    @property
    def cylinder(self) -> float | None:
        """The length of a ram's cylinder from the base joint, m, for pictures; None without one."""
        return None

    @property
    def bar(self) -> Vector | None:
        """The direction from one parallel rod of the leg to the other; None without any.

        Pictures show such rods as two.
        """
        return None

    bar_length: float | None = None
    """The distance of its parallel rods, m; None if the file has none."""

    @property
    def lever(self) -> float:
        """Metres that the driven body's end moves per unit of its joint: 1 for a slider.

        It is meaningless for a joint that follows the platform's angle.
        """
        return 1.0

    @property
    def reach_bound(self) -> ReachBound | None:
        """A ball or cylinder that holds all platform points in reach; None without a bound."""
        return None

    @property
    def held_bound(self) -> ReachBound | None:
        """A bound on the platform points in reach while the actuated joint keeps its limits."""
        bound = self.reach_bound
        if bound is None or bound.line is None or self.limits is None:
            return bound
        low, high = self.limits
        way = 0.5 * (low + high)
        x, y, z = (
            p + way * component for p, component in zip(bound.point, bound.line, strict=True)
        )
        return ReachBound((x, y, z), None, bound.radius + 0.5 * (high - low))

    @property
    @abstractmethod
    def reach_text(self) -> str:
        """The leg's reach as a clause for messages: "its links span 0.1 to 0.4 m"."""

    @property
    def extents(self) -> dict[str, tuple[str, float, float, str]]:
        """Usual x of each body's centre of mass, by letter: TOML key, low, high (m), end names."""
        return {}

    def center_of_mass_warning(self, letter: str, x: float) -> str | None:
        """Return a warning if a body's centre of mass at x, m, lies beyond the body's ends."""
        if letter not in self.extents:
            return None
        _, low, high, ends = self.extents[letter]
        room = ROUNDING * (high - low)
        if low - room <= x <= high + room:
            return None
        turned = f"; is it {-x:g}?" if low <= -x <= high else ""
        return f"x = {x:g} m is not between {ends}: {low:g} to {high:g} m is usual{turned}"

    @property
    def metres(self) -> dict[str, Sequence[float]]:
        """All lengths of the leg, m, by key: a file in millimetres is recognised by them."""
        lengths: dict[str, Sequence[float]] = {
            q.name: q.value for q in self.quantities if q.role == "length"
        }
        for key in ("guide_point", "platform_point", "fixed_offset"):
            lengths[key] = getattr(self, key)
        if self.limits is not None and self.joint.unit == "m":
            lengths["limits"] = self.limits
        return lengths

    @property
    def size(self) -> float:
        """The length, m, that the leg's reach is relative to: the sum of its link lengths."""
        return sum(float(q.value[0]) for q in self.quantities if q.role == "length")

    def passive_joints(
        self, motion: LegMotion, zero_axes: Expression, axes: Expression
    ) -> list[Passive]:
        """Return the passive joints of the leg that have limits, with their values in this motion.

        The columns (3, 3) of `axes` are the platform's axes, of `zero_axes` at phi = 0.
        """
        return []

    def rod_couple(self, motion: LegMotion) -> Expression | None:
        """Return the couple (3, 1) that parallel rods transmit beside the axial force, or None.

        It is zero for a single rod; None for a leg whose joints determine its wrench.
        """
        return None

    def unlikely_values(self, axis: Vector | None) -> Iterator[str]:
        """Yield warnings about values that are valid but unlikely in this kind of leg.

        The platform turns about `axis`, if it does.
        """
        yield from ()

    def equations(self, values: Mapping[str, Expression] | None = None) -> LegEquations:
        """Return the leg's equations, for its own geometry or other `values` of its quantities."""
        if values is None:
            values = {q.name: ca.SX(ca.DM(list(q.value))) for q in self.quantities}
        return self.equations_class(**values)

    @property
    def platform_center(self) -> Vector | None:
        """The point about which its platform must turn; None if any will do."""
        return None

    def transfers(self, gravity: Vector) -> tuple[LegTransfer, ...]:
        """Return how inertial parameters transfer to others within the leg, and the reasons."""
        return ()

    @classmethod
    def draw_closure(
        cls, values: Mapping[str, Sequence[Fraction]], rng: Random
    ) -> tuple[list[Fraction], int] | None:
        """Return a random rational platform point that the leg reaches, and the elbow; or None.

        Base parameters are proved by it over the rationals, as well as modulo a prime.
        """
        return None

    def map_vectors(self, turn: Any, *, platform: bool = False) -> Self:
        """Return the leg with every vector v of the base frame replaced by `turn(v)`.

        If `platform`, vectors of the platform's frame are replaced too.
        """
        vectors = [q.name for q in self.quantities if q.role in ("point", "direction", "normal")]
        vectors += ["fixed_offset", *(["platform_point"] if platform else [])]
        cones = [*self.base_cones, *(["platform_cone"] if platform else [])]
        rotating = {name: getattr(self, name, None) for name in (*vectors, *cones)}
        rotated_fields = {
            name: replace(vector, axis=turn(vector.axis)) if name in cones else turn(vector)
            for name, vector in rotating.items()
            if vector is not None
        }
        return replace(self, **rotated_fields)

    turned = former_attribute("turned", "map_vectors")
    under = former_attribute("under", "with_platform_frame")
    at_zero = former_attribute("at_zero", "crank_at_zero")
    doubts = former_attribute("doubts", "unlikely_values")


def __getattr__(name: str) -> Any:
    return former_name(__name__, name)
