"""`with_dimensions`: a machine like another one, of other radii, lengths and sections of links."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from pteron.bodies.inertia import SpatialInertia, carried_values, inertia_count
from pteron.bodies.vectors import Vector, interval, positive, vector
from pteron.errors import ModelError
from pteron.legs import LegKind
from pteron.legs.drive import Drive
from pteron.manipulator.joint_pairs import joint_circle
from pteron.manipulator.manipulator import Manipulator
from pteron.manipulator.robot_like import RobotLike, as_manipulator
from pteron.manipulator.stretched_links import with_stretched_bodies

_DENSITIES = {"steel": 7850.0, "aluminium": 2700.0, "carbon": 1600.0}
"""kg/m^3, ordinary ones; carbon is fibre in resin."""

LINKS = {"crank": "upper", "rod": "lower"}
"""The links of a leg by the words of owners, with the keys of their bodies."""

_STOCK = re.compile(r"(\w+)-(?:tube:([\d.]+)x([\d.]+)|rod:([\d.]+))")


@dataclass(frozen=True)
class Stock:
    """The stock that links are cut from: a round tube, or a rod.

    Parameters
    ----------
    density : float
        kg/m^3.
    outer, inner : float
        Diameters, m; the inner one of a rod is 0.
    """

    density: float
    outer: float
    inner: float = 0.0

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the bar stock that a text such as aluminium-tube:30x2 or steel-rod:8 (mm) names.

        Examples
        --------
        >>> from pteron.manipulator.dimensions import Stock
        >>> Stock.parse("aluminium-tube:30x2")
        Stock(density=2700.0, outer=0.03, inner=0.026)
        """
        match = _STOCK.fullmatch(text)
        if match is None or match[1] not in _DENSITIES:
            raise ModelError(
                f"{text!r} is no stock; MATERIAL-tube:DIAMETERxWALL or MATERIAL-rod:DIAMETER in mm "
                f"expected, of {', '.join(_DENSITIES)}, such as aluminium-tube:30x2"
            )
        outer = positive(match[2] or match[4], "diameter", "mm")
        wall = positive(match[3], "wall", "mm") if match[3] else outer / 2.0
        if 2.0 * wall > outer:
            raise ModelError(f"{text}: a wall of {wall:g} mm is more than half of {outer:g} mm")
        return cls(_DENSITIES[match[1]], outer / 1e3, round(outer - 2.0 * wall, 9) / 1e3)

    def link(self, kind: Any, low: float, high: float, count: int = 1) -> Any:
        """Return the inertia of `count` parallel links of this stock, from x = low to high, m."""
        length, squares = high - low, self.outer**2 + self.inner**2
        area = math.pi / 4.0 * (self.outer**2 - self.inner**2)
        mass, middle = count * self.density * area * length, (low + high) / 2.0
        inertia = mass * (3.0 * squares / 4.0 + length**2) / 12.0 + mass * middle**2
        if kind is SpatialInertia:
            tensor = mass * squares / 8.0, 0.0, 0.0, inertia, 0.0, inertia
            return kind.of_body(mass, (middle, 0.0, 0.0), tensor)
        return kind.of_body(mass, (middle, 0.0)[: len(kind.kinds) - 2], inertia)


def with_dimensions(
    robot: RobotLike,
    *,
    base_radius: float | None = None,
    platform_radius: float | None = None,
    crank: float | None = None,
    rod: float | None = None,
    limits: tuple[float, float] | None = None,
    stock: Mapping[str, str | Stock] | None = None,
    platform_mass: float | None = None,
    link_masses: Mapping[str, float] | None = None,
    rider: float | None = None,
    rider_center: Sequence[float] = (0.0, 0.0, 0.0),
    drive: Mapping[str, Any] | None = None,
) -> Manipulator:
    """Return a machine of the same kind with other dimensions, equal for all legs.

    Links of changed length keep their cross-section unless `stock` is given; so do a ram's cylinder
    and piston, which are as long as its shortest length. Joint limits, and the platform's mass and
    inertia, are unchanged unless given. The file's home is omitted if lengths or limits change.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine to begin with.
    base_radius : float, optional
        Greatest distance of a guide point from the axis, along the platform's, through the middle
        of them all, m: they move away from it, or towards it, by one factor.
    platform_radius : float, optional
        Greatest distance of a platform point from the platform's axis through P, m, likewise.
    crank, rod : float, optional
        Lengths of the cranks or upper links, and of the rods or lower links, m.
    limits : (float, float), optional
        Least and greatest joint coordinate: of rams the length, m.
    stock : mapping, optional
        What links are cut from, by their key, ``upper`` or ``lower``: see `Stock.parse`.
    platform_mass : float, optional
        Of the platform with its bars, kg: its inertia changes by the same factor, and by the square
        of the factor of `platform_radius` where that is given too.
    link_masses : mapping, optional
        Mass of each link, kg, by its key, ``upper`` or ``lower``: its inertia changes by the same
        factor.
    rider : float, optional
        Mass of what the platform always carries, kg: a point mass that is added to it.
    rider_center : vector
        Where it is in the platform's frame, m.
    drive : mapping, optional
        Values of the actuated joints' drives by the keys of the file, such as ``ratio``.

    Returns
    -------
    Manipulator

    Raises
    ------
    ModelError
        If the legs have no such dimension, or no machine has it.

    Examples
    --------
    >>> from pteron.manipulator import with_dimensions
    >>> robot = with_dimensions("delta", base_radius=0.2, stock={"lower": "carbon-tube:12x1"})
    >>> [round(x, 4) for x in robot.legs[0].guide_point]
    [0.2, 0.0, 0.0]
    >>> round(robot.legs[0].lower.mass, 4)
    0.1167
    """
    robot = as_manipulator(robot)
    if any(
        dimension is not None for dimension in (base_radius, platform_radius, crank, rod, limits)
    ):
        robot = replace(robot, home=None)
    if base_radius is not None:
        robot = _with_base(robot, positive(base_radius, "base_radius", "m"))
    growth = 1.0
    if platform_radius is not None:
        former = joint_circle(robot, "platform").radius
        robot = _with_platform(robot, positive(platform_radius, "platform_radius", "m"))
        growth = platform_radius / former
    for (name, body), dimension in zip(LINKS.items(), (crank, rod), strict=True):
        if dimension is not None:
            robot = _with_length(robot, name, body, positive(dimension, name, "m"))
    if limits is not None:
        checked_limits = interval(limits, "limits")
        robot = _with_legs(robot, (_with_limits(leg, checked_limits) for leg in robot.legs))
    for key, link_stock in (stock or {}).items():
        robot = _with_stock(
            robot, key, Stock.parse(link_stock) if isinstance(link_stock, str) else link_stock
        )
    for key, mass in (link_masses or {}).items():
        robot = _with_link_mass(robot, key, positive(mass, f"{key}_mass", "kg"))
    if platform_mass is not None:
        mass = positive(platform_mass, "platform_mass", "kg")
        robot = _with_mass(robot, mass, growth)
    if rider is not None:
        center = vector(rider_center, "rider_center")
        robot = _with_rider(robot, positive(rider, "rider", "kg"), center)
    if drive:
        legs = (replace(leg, drive=replace(leg.drive or Drive(), **drive)) for leg in robot.legs)
        robot = _with_legs(robot, legs)
    return robot


def _with_link_mass(robot: Manipulator, key: str, mass: float) -> Manipulator:
    """Return the machine with a mass, kg, of each leg's link of this key; inertia in proportion."""
    legs = []
    for leg in robot.legs:
        letters = [letter for letter, (name, *_) in leg.extents.items() if name == key]
        if not letters:
            raise ModelError(f"{key}_mass: the legs of {robot.name} have no link of this key")
        body: Any = leg.bodies[letters[0]]
        scaled = type(body).of_values([mass / body.mass * number for number in body.values])
        legs.append(leg.with_bodies({**leg.bodies, letters[0]: scaled}))
    return _with_legs(robot, legs)


def _with_rider(robot: Manipulator, mass: float, center: Vector) -> Manipulator:
    """Return the machine with a point mass, kg, at a point of the platform's frame, m."""
    inertia = robot.platform.inertia
    load = carried_values(type(inertia), mass, center, [0.0] * inertia_count(inertia.kinds))
    total = type(inertia).of_values([a + b for a, b in zip(inertia.values, load, strict=True)])
    return replace(robot, platform=replace(robot.platform, inertia=total))


def _with_limits(leg: LegKind, limits: tuple[float, float]) -> LegKind:
    """Return a leg with joint limits (low, high), m or rad; a ram with bodies of that length."""
    changed = replace(leg, limits=limits)
    return changed if changed.extents == leg.extents else with_stretched_bodies(leg, changed)


def _with_mass(robot: Manipulator, mass: float, growth: float) -> Manipulator:
    """Return the machine with a platform of this mass, kg, whose body has grown by a factor."""
    platform_inertia, bars = robot.platform.inertia, robot.platform.bars
    factor = mass / (platform_inertia.mass + sum(bar.mass for bar in bars))
    powers = (0 if kind == "m" else 2 if kind[0] == "I" else 1 for kind in platform_inertia.kinds)
    inertia = type(platform_inertia).of_values(
        [
            factor * growth**power * parameter
            for power, parameter in zip(powers, platform_inertia.values, strict=True)
        ]
    )
    bars = tuple(replace(bar, mass=factor * bar.mass) for bar in bars)
    return replace(robot, platform=replace(robot.platform, inertia=inertia, bars=bars))


def _with_legs(robot: Manipulator, legs: Iterable[LegKind]) -> Manipulator:
    """Return a copy of the machine with these legs."""
    return replace(robot, legs=tuple(legs))


def _with_base(robot: Manipulator, radius: float) -> Manipulator:
    """Return the machine with guide points moved to a greatest radius, m, about the axis."""
    points = np.array([leg.guide_point for leg in robot.legs])
    axis = np.array(robot.platform.axis)
    radial = (points - points.mean(axis=0)) @ (np.eye(3) - np.outer(axis, axis))
    factor = _factor("base_radius", radial, radius)
    scaled_points = points + (factor - 1.0) * radial
    pairs = zip(robot.legs, scaled_points, strict=True)
    return _with_legs(robot, (replace(leg, guide_point=_vector(p)) for leg, p in pairs))


def _with_platform(robot: Manipulator, radius: float) -> Manipulator:
    """Return the machine with platform points moved to a greatest radius, m, about the axis."""
    platform = robot.platform
    axis, frame = np.array(platform.axis), np.array(platform.frame)
    fixed = np.array([leg.fixed_offset for leg in robot.legs])
    points = np.array([leg.platform_point for leg in robot.legs])
    flat = np.eye(3) - np.outer(axis, axis)
    factor = _factor("platform_radius", (points @ frame + fixed) @ flat, radius)
    scaling = frame @ (np.eye(3) + (factor - 1.0) * flat) @ frame.T
    legs = (
        replace(
            leg,
            platform_point=_vector(point @ scaling),
            fixed_offset=_vector(offset + (factor - 1.0) * flat @ offset),
        )
        for leg, point, offset in zip(robot.legs, points, fixed, strict=True)
    )
    bars = tuple(
        replace(bar, hinge=_vector(np.array(bar.hinge) @ scaling)) for bar in platform.bars
    )
    return replace(robot, legs=tuple(legs), platform=replace(platform, bars=bars))


def _factor(name: str, radial: Any, radius: float) -> float:
    """Return the factor that scales vectors (n, 3) to a greatest length of `radius`, m."""
    greatest = float(np.linalg.norm(radial, axis=1).max())
    if greatest < 1e-9:
        raise ModelError(f"{name}: the points are on one line along the axis, and have no radius")
    return radius / greatest


def _vector(components: Any) -> Vector:
    """Return a point's coordinates, m, rounded to 12 decimals."""
    return vector([round(float(x), 12) + 0.0 for x in components], "point")


def _with_length(robot: Manipulator, name: str, body: str, length: float) -> Manipulator:
    """Return the machine with the length, m, of the named leg body changed in all legs."""
    changed = [leg.with_length(body, length) for leg in robot.legs]
    if not any(changed):
        raise ModelError(f"{name}: the legs of {robot.name} have no such length")
    pairs = zip(robot.legs, changed, strict=True)
    return _with_legs(
        robot, (with_stretched_bodies(old, new) if new else old for old, new in pairs)
    )


def _with_stock(robot: Manipulator, key: str, stock: Stock) -> Manipulator:
    """Return the machine with all links of a key, upper or lower, cut from a stock."""
    bodies_by_leg = [cut_links(leg, {key: stock}) for leg in robot.legs]
    if not any(bodies_by_leg):
        raise ModelError(f"{key}: no link of {robot.name}; upper or lower, which its legs have")
    pairs = zip(robot.legs, bodies_by_leg, strict=True)
    return _with_legs(robot, (leg.with_bodies({**leg.bodies, **links}) for leg, links in pairs))


def cut_links(leg: Any, stocks: Mapping[str, Stock]) -> dict[str, Any]:
    """Return by letter the inertia of a leg's links cut from the stocks of their keys."""
    rods = {"lower": getattr(leg, "rods", 1)}
    return {
        letter: stocks[key].link(type(leg.bodies[letter]), low, high, rods.get(key, 1))
        for letter, (key, low, high, _) in leg.extents.items()
        if key in stocks
    }
