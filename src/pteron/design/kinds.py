"""Kinds of machines: each one of the catalog, of another size and other proportions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pteron.bodies.inertia import SpatialInertia, carried_values
from pteron.bodies.vectors import Vector
from pteron.design.requirement_tables import LinksTable
from pteron.errors import DataError
from pteron.indices.elasticity import MATERIALS
from pteron.indices.strength import Tube
from pteron.kernels import Array
from pteron.kinematics.sampling import search_ball
from pteron.manipulator import Manipulator, Radii, load
from pteron.manipulator.dimensions import Stock, cut_links
from pteron.manipulator.variants import turned
from pteron.parts.joints import JointPart
from pteron.platforms import Platform
from pteron.toml import joined_faults
from pteron.workspace import home_pose

KINDS: dict[str, tuple[str, str]] = {
    "delta": ("base_radius platform_radius crank", "z"),
    "linear-delta": ("base_radius platform_radius", "z"),
    "orthoglide": ("", "xyz"),
    "tripteron": ("crank", "xyz"),
    "delta-4": ("base_radius platform_radius crank", "z"),
    "h4": ("base_radius crank", "yz"),
    "par4": ("base_radius crank", "z"),
    "quadrupteron": ("crank", "xyz"),
    "hexa": ("base_radius platform_radius crank", "z"),
    "hexaglide": ("base_radius platform_radius", "yz"),
    "stewart": ("base_radius platform_radius", "z"),
    "five-bar": ("base_radius crank", "y"),
    "3-rrr": ("base_radius platform_radius crank", "xy"),
    "3-prr": ("base_radius platform_radius", "xy"),
    "3-rpr": ("base_radius platform_radius", "xy"),
    "3-rrr-point": ("base_radius crank", "xy"),
    "3-upu": ("base_radius platform_radius", "z"),
    "delta-redundant": ("base_radius platform_radius crank", "z"),
    "hexapteron": ("crank", ""),
    "pentapteron": ("platform_radius", ""),
    "5-rpur": ("base_radius platform_radius", "xyz"),
}
"""The dimensions of each kind that vary beside the size, and the coordinates of its place that do:
the others are those of its plane or axis of symmetry, or of its home pose."""

FOR_TILTS = ("hexapteron", "pentapteron", "5-rpur")
"""Kinds that are tried only for a job that tilts, or by name: each takes a minute or more, and for
a job without tilts there are simpler machines."""

_LAID = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""Rotation of machines that turn about z and x: about x and y, so that z tilts to every side."""

_POWERS = {"m": 3, "g": 4, "I": 5}
"""Exponents of the size by which masses, first and second moments scale."""

_RATIO = 0.4, 2.5
"""Least and greatest dimension over that of the catalog's machine of the same size."""

_SIZE = 0.25, 8.0
"""Least and greatest size of a machine over that of the workspace."""

_LARGEST = {"pentapteron": 20.0, "5-rpur": 40.0}
"""Greatest size of kinds whose workspace is a smaller share of their reach than that of others: the
largest level cube of the catalog's machines is a sixth and a fourteenth of the radius."""

_ALUMINIUM = 2700.0
"""kg/m^3."""

_LEAST_PAIR = 0.02
"""Least distance of the rods of a pair, m."""

_RAIL = 0.017
"""Half the width of a rail, m, before it is chosen by its load."""


@dataclass(frozen=True)
class Kind:
    """A kind of machine, whose designs are few numbers.

    Attributes
    ----------
    name : str
        In the catalog.
    needed : float
        The workspace's greatest side, m.
    links : LinksTable
        What moving parts are made of.
    tool : vector
        The tool's centre point in the platform's frame, m.
    free : bool
        Whether a cycle's time is one of the numbers.
    gravity : vector
        m/s^2.
    """

    name: str
    needed: float
    links: LinksTable
    tool: Vector = (0.0, 0.0, 0.0)
    free: bool = False
    gravity: Vector = (0.0, 0.0, -9.81)

    @cached_property
    def robot(self) -> Manipulator:
        """The catalog's machine of this kind, without limits of sliders.

        Sliders' limits follow from the task, and the cones of ball joints, also left out, from a
        machine's proportions.
        """
        template = _template(self.name)
        legs = []
        for leg in template.legs:
            cones = (f"{end}_cone" for end in ("base", "tip", "platform"))
            ends = dict.fromkeys(cone for cone in cones if hasattr(leg, cone))
            legs.append(replace(leg, **ends | ({"limits": None} if slides(leg) else {})))
        platform = replace(template.platform, tool=self.tool)
        robot = replace(template, legs=tuple(legs), platform=platform, radii=None, home=None)
        return replace(robot, gravity=self.gravity)

    @cached_property
    def like(self) -> Manipulator:
        """The machine whose compiled programs serve all machines of the kind."""
        return replace(self.robot, name="any")

    @cached_property
    def reach(self) -> tuple[Array, float]:
        """The catalog machine's home pose, and the radius of its reach, m."""
        template = _template(self.name)
        return home_pose(template), float(search_ball(template)[1])

    @cached_property
    def variables(self) -> dict[str, tuple[float, float]]:
        """Lower and upper bound of each design variable, by name; sizes and times as logarithms."""
        dimensions, places = KINDS[self.name]
        size = self.needed / self.reach[1]
        most = _LARGEST.get(self.name, _SIZE[1])
        ranges = {"size": (np.log(_SIZE[0] * size), np.log(most * size))}
        ranges |= dict.fromkeys(dimensions.split(), (np.log(_RATIO[0]), np.log(_RATIO[1])))
        ranges |= dict.fromkeys(places, (-0.6, 0.6))
        ranges |= {key: (0.0, len(stock) - 1e-9) for key, stock in self._choices.items()}
        return ranges | ({"time": (np.log(0.05), np.log(5.0))} if self.free else {})

    @cached_property
    def stocks(self) -> dict[str, list[str]]:
        """The names of the bar stock of upper and lower links, by link, the least stiff first."""

        def rigidity(name: str) -> float:
            """Return E (d^4 - d_i^4) of a stock."""
            stock, material = Stock.parse(name), MATERIALS[name.split("-")[0]]
            return material.young * (stock.outer**4 - stock.inner**4)

        return {
            "upper": sorted(self.links.upper, key=rigidity),
            "lower": sorted(self.links.lower, key=rigidity),
        }

    @cached_property
    def _choices(self) -> dict[str, Sequence[str]]:
        """The names of the bar stock by link, for links with more than one choice."""
        keys = {part_key for leg in self.robot.legs for part_key, *_ in leg.extents.values()}
        return {key: stock for key, stock in self.stocks.items() if key in keys and len(stock) > 1}

    @property
    def ranges(self) -> Array:
        """Lower and upper bounds of the design variables (2, V)."""
        return np.array(list(self.variables.values())).T

    @property
    def counts(self) -> Array:
        """Number of choices of each discrete design variable (V,); 0 for continuous variables."""
        return np.array([len(self._choices.get(name, ())) for name in self.variables])

    def numbers(self, point: Array) -> dict[str, float]:
        """Return design variables (V,) by name, logarithms undone: size factors, times in s."""
        return {
            name: float(setting if name in "xyz" or name in self._choices else np.exp(setting))
            for name, setting in zip(self.variables, point, strict=True)
        }

    def machine(self, point: Array) -> tuple[Manipulator, Array]:
        """Return the machine of design variables (V,), and the pose in its workspace's middle (m,).

        Raises
        ------
        ModelError
            If there is no such machine.
        """
        numbers = self.numbers(point)
        size, (home, reach) = numbers["size"], self.reach
        middle = np.where(self.robot.platform.angular, 0.0, size * home)
        for i, letter in enumerate(self.robot.coordinates):
            if letter in numbers and letter in "xyz":
                middle[i] += numbers[letter] * size * reach
            elif letter == "x" or (letter == "y" and "z" in KINDS[self.name][1]):
                middle[i] = 0.0
        return _build_machine(self.robot, numbers, self._stock(point), self.links), middle

    def link_stocks(self, point: Array) -> dict[str, str]:
        """Return the names of the bar stock of upper and lower links of design variables (V,)."""
        numbers = self.numbers(point)
        return {key: names[int(numbers.get(key, 0.0))] for key, names in self.stocks.items()}

    def _stock(self, point: Array) -> dict[str, Stock]:
        """Return the stock of each link, parsed from its name, for design variables (V,)."""
        return {key: Stock.parse(name) for key, name in self.link_stocks(point).items()}

    def tubes(self, robot: Manipulator, point: Array) -> dict[str, Tube]:
        """Return what the links of a machine of design variables (V,) are cut of, by their key."""
        keys = {key for leg in robot.legs for key, *_ in leg.extents.values()}
        rods = max(getattr(leg, "rods", 1) for leg in robot.legs)
        return {
            key: Tube(
                stock.outer,
                stock.inner,
                MATERIALS[name.split("-")[0]],
                rods if key == "lower" else 1,
                self.pair_spacing(robot) if key == "lower" and rods > 1 else np.inf,
            )
            for key, name in self.link_stocks(point).items()
            if key in keys or key == "lower"
            for stock in [Stock.parse(name)]
        }

    def pair_spacing(self, robot: Manipulator) -> float:
        """Return the distance of the two rods of a pair, m."""
        radius = float(np.linalg.norm(platform_points(robot), axis=1).max())
        return max(self.links.pair * radius, _LEAST_PAIR)

    def with_travel(self, leg: Any, travel: tuple[float, float], point: Array) -> Any:
        """Return a leg with travel limits (low, high), m; a ram with tubes of that length."""
        limited = replace(leg, limits=travel)
        if slides(leg):
            return limited
        return limited.with_bodies(_bodies(limited, 1.0, self._stock(point), self.links))


def _template(name: str) -> Manipulator:
    """Return the catalog's machine of a kind; one with two rotation axes has both level."""
    robot = load(name)
    return robot if robot.platform.second_axis is None else turned(robot, _LAID, gravity=False)


def platform_points(robot: Manipulator) -> Array:
    """Return the vectors (n, 3), m, from the platform's axis to its points at angles zero."""
    axis, frame = np.array(robot.platform.axis), np.array(robot.platform.frame)
    points = [np.array(leg.platform_point) @ frame + leg.fixed_offset for leg in robot.legs]
    return np.asarray(np.array(points) @ (np.eye(3) - np.outer(axis, axis)))


def with_joint_parts(
    robot: Manipulator, joints: Sequence[Sequence[Any]], parts: Sequence[Sequence[JointPart]]
) -> Manipulator:
    """Return the machine with the masses of its joints at the outer ends of its links.

    A rail's carriage, and joints on it, move with the slider. Rails are as wide as their part.
    """
    legs, rail = [], 0.0
    for leg, of_leg, chosen in zip(robot.legs, joints, parts, strict=True):
        bodies = dict(leg.bodies)
        ends = {key: (letter, high) for letter, (key, _, high, _) in leg.extents.items()}
        if slides(leg):
            ends["base"] = "p", 0.0
        for joint, part in zip(of_leg, chosen, strict=True):
            if joint.kind == "guide":
                rail = max(rail, 0.5 * part.diameter)
            if joint.link not in ends:
                continue
            letter, x = ends[joint.link]
            body: Any = bodies[letter]
            added = _point_mass(body, joint.parts * part.mass, x)
            bodies[letter] = body.of_values(np.add(body.values, added).tolist())
        legs.append(leg.with_bodies(bodies))
    radii = robot.radii and replace(robot.radii, guide=rail or robot.radii.guide)
    return replace(robot, legs=tuple(legs), radii=radii)


def _point_mass(body: Any, mass: float, x: float) -> list[float]:
    """Return the inertial parameters of a point mass, kg, at x, m, on a link's axis."""
    if isinstance(body, SpatialInertia):
        return carried_values(SpatialInertia, mass, (x, 0.0, 0.0), [0.0] * 6)
    middle = [0.0] * (len(body.kinds) - 3)
    return [mass, mass * x, *middle, mass * x**2] if len(body.kinds) > 1 else [mass]


def joint_kind(leg: Any) -> str:
    """Return what a drive of a leg must fit: "rad" of a crank, "slider" or "ram"."""
    if leg.joint.unit != "m":
        return "rad"
    return "slider" if slides(leg) else "ram"


def slides(leg: Any) -> bool:
    """Return whether a leg's joint slides on a guide, whose length follows from the travel."""
    return leg.joint.unit == "m" and leg.joint_axis is not None


def _lengths(leg: Any) -> set[str]:
    """Return the names of the length parameters that a leg has a value for."""
    keys = leg.every_key().items()
    return {name for name, key in keys if key.role == "length" and getattr(leg, name) is not None}


def _build_machine(
    robot: Manipulator, numbers: Mapping[str, float], stocks: Mapping[str, Stock], links: LinksTable
) -> Manipulator:
    """Return the machine scaled by the design `numbers`, with links cut from the given stock.

    Lengths grow with the size; inertias, except those of links, platform and carriages, grow with
    powers of it.
    """
    size, platform = numbers["size"], robot.platform
    axis, frame = np.array(platform.axis), np.array(platform.frame)
    flat = np.eye(3) - np.outer(axis, axis)
    wider = np.eye(3) + (numbers.get("base_radius", 1.0) - 1.0) * flat
    outer = np.eye(3) + (numbers.get("platform_radius", 1.0) - 1.0) * flat
    about = np.mean([leg.guide_point for leg in robot.legs], axis=0)
    legs, radius = [], 0.03
    for leg in robot.legs:
        dimensions: dict[str, Any] = {}
        lengths = _lengths(leg)
        for key, lengths_of_key in leg.metres.items():
            parts = np.array(lengths_of_key)
            if key == "guide_point":
                parts = about + wider @ (parts - about)
            elif key == "platform_point":
                parts = parts @ frame @ outer @ frame.T
            elif key == "fixed_offset":
                parts = outer @ parts
            if key in lengths and key.startswith("upper"):
                parts = numbers.get("crank", 1.0) * parts
            dimensions[key] = float(size * parts[0]) if key in lengths else tuple(size * parts)
        other = replace(leg, **dimensions)
        at = np.array(other.platform_point) @ frame + other.fixed_offset
        radius = max(radius, float(np.linalg.norm(flat @ at)))
        legs.append(other.with_bodies(_bodies(other, size, stocks, links)))
    mass = 0.5 * np.pi * radius**2 * links.plate * _ALUMINIUM
    moments = {"m": mass, "I": mass * radius**2 / 2.0, "Izz": mass * radius**2 / 2.0}
    moments |= dict.fromkeys(("Ixx", "Iyy"), mass * radius**2 / 4.0)
    plate = platform.inertia.of_values([moments.get(k, 0.0) for k in platform.inertia.kinds])
    bars = tuple(
        replace(bar, mass=size**3 * bar.mass, hinge=tuple(size * outer @ bar.hinge))
        for bar in platform.bars
    )
    carried = replace(platform, bars=bars, inertia=plate)
    upper, lower = (stocks[key].outer / 2.0 for key in ("upper", "lower"))
    radii = Radii(_RAIL, upper, lower, links.plate / 2.0)
    return replace(robot, legs=tuple(legs), platform=carried, radii=radii)


def _bodies(
    leg: Any, size: float, stocks: Mapping[str, Stock], links: LinksTable
) -> dict[str, Any]:
    """Return the bodies of a leg by name: links of stock, a carriage, others scaled with `size`."""
    bodies = {}
    for letter, body in leg.bodies.items():
        powers = (_POWERS["I" if k[0] == "I" else "g" if "g" in k else "m"] for k in body.kinds)
        grown = [v * size**p for v, p in zip(body.values, powers, strict=True)]
        bodies[letter] = body.of_values(grown)
        if slides(leg) and letter == "p":
            bodies[letter] = body.of_values([links.carriage] + [0.0] * (len(grown) - 1))
    return bodies | cut_links(leg, stocks)


def angle_counts(platform: Platform) -> tuple[int, int]:
    """Return how many of a platform's last angles tilt its z axis, and how many turn about it.

    Those that tilt come first: (0, 0), (0, 1), (2, 0) or (2, 1).
    """
    return 2 * platform.tilts, int(platform.spin_angle is not None)


def _hinges(turn: tuple[float, float] | None, platform: Platform) -> str:
    """Return what the hinges of a platform allow, in words; empty if that is enough."""
    if turn is None or platform.tilts or not platform.limits:
        return ""
    low, high = map(float, platform.limits)  # type: ignore[arg-type]
    return "" if low <= turn[0] and turn[1] <= high else f"turns from {low:.3g} to {high:.3g} rad"


def fitting_kinds(
    names: Sequence[str] | None, lengths: int, turn: tuple[float, float] | None, tilt: bool
) -> list[str]:
    """Return the names of the kinds of machine with a task's degrees of freedom; raise if none.

    `turn` is the range of turns, rad, which hinges of a platform may not allow.

    Raises
    ------
    DataError
        If one that is asked for cannot do it, or none can.
    """
    faults, kinds = [], []
    usual = [name for name in KINDS if tilt or name not in FOR_TILTS]
    for name in usual if names is None else names:
        platform = load(name).platform
        tilting, turning = angle_counts(platform)
        lacks = [
            text
            for text, holds in (
                (f"moves along {' '.join(platform.lengths)} only", len(platform.lengths) < lengths),
                ("does not turn", turn is not None and not turning),
                (f"{_hinges(turn, platform)} only", bool(_hinges(turn, platform))),
                ("does not tilt", tilt and not tilting),
            )
            if holds
        ]
        if not lacks:
            kinds.append(name)
        elif names is not None:
            faults.append(f"kinds: {name} {' and '.join(lacks)}, but the job asks for more")
    if not kinds and not faults:
        faults.append("no kind of machine in the catalog has these freedoms")
    if faults:
        raise DataError(joined_faults(faults))
    return kinds
