"""Kinds of machines: each one of the catalog, of another size and other proportions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pteron.errors import DataError
from pteron.kernels import Array
from pteron.kinematics.sampling import search_ball
from pteron.manipulator import Manipulator, load
from pteron.manipulator.dimensions import Stock
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
}
"""Of each kind the dimensions that vary beside the size, and the coordinates of its place that do:
the others are those of its plane or axis of symmetry."""

_POWERS = {"m": 3, "g": 4, "I": 5}
"""Powers of the size with which masses, first and second moments grow."""

_RATIO = 0.4, 2.5
"""Least and greatest dimension over that of the catalog's machine of the same size."""

_SIZE = 0.25, 8.0
"""Least and greatest size of a machine over that of the workspace."""

_ALUMINIUM = 2700.0
"""kg/m^3."""


@dataclass(frozen=True)
class Build:
    """What moving parts are made of: a plate's thickness, m, and a carriage's mass, kg."""

    plate: float
    carriage: float


@dataclass(frozen=True)
class Kind:
    """A kind of machine, whose designs are few numbers.

    Attributes
    ----------
    name : str
        In the catalog.
    needed : float
        The workspace's greatest side, m.
    stocks : mapping of str to sequence of str
        What upper and lower links may be cut from.
    build : Build
        Of the other parts.
    free : bool
        Whether a cycle's time is one of the numbers.
    """

    name: str
    needed: float
    stocks: Mapping[str, Sequence[str]]
    build: Build
    free: bool = False

    @cached_property
    def robot(self) -> Manipulator:
        """The catalog's machine; what slides is without limits, for they follow from the job.

        So are the joints at a hexapod's rams, whose cones follow from its proportions.
        """
        found = load(self.name)
        legs = []
        for leg in found.legs:
            ends = {"limits": None} if slides(leg) else {}
            if hasattr(leg, "base_cone"):
                ends |= {"base_cone": None, "platform_cone": None}
            legs.append(replace(leg, **ends))
        return replace(found, legs=tuple(legs), radii=None)

    @cached_property
    def like(self) -> Manipulator:
        """The machine whose programs serve all machines of the kind."""
        return replace(self.robot, name="any")

    @cached_property
    def reach(self) -> tuple[Array, float]:
        """The catalog machine's home pose, and the radius of its reach, m."""
        found = load(self.name)
        return home_pose(found), float(search_ball(found)[1])

    @cached_property
    def variables(self) -> dict[str, tuple[float, float]]:
        """The numbers by name, with the least and the greatest value; sizes and times as logs."""
        dimensions, places = KINDS[self.name]
        size = self.needed / self.reach[1]
        found = {"size": (np.log(_SIZE[0] * size), np.log(_SIZE[1] * size))}
        found |= dict.fromkeys(dimensions.split(), (np.log(_RATIO[0]), np.log(_RATIO[1])))
        found |= dict.fromkeys(places, (-0.6, 0.6))
        found |= {key: (0.0, len(stock) - 1e-9) for key, stock in self._choices.items()}
        return found | ({"time": (np.log(0.05), np.log(5.0))} if self.free else {})

    @cached_property
    def _choices(self) -> dict[str, Sequence[str]]:
        keys = {own for leg in self.robot.legs for own, *_ in leg.extents.values()}
        return {key: stock for key, stock in self.stocks.items() if key in keys and len(stock) > 1}

    @property
    def ranges(self) -> Array:
        """Least and greatest value of each number (2, V)."""
        return np.array(list(self.variables.values())).T

    def numbers(self, values: Array) -> dict[str, float]:
        """Return numbers by name, as they are meant: sizes over the catalog's, times in s."""
        return {
            name: float(value if name in "xyz" or name in self._choices else np.exp(value))
            for name, value in zip(self.variables, values, strict=True)
        }

    def machine(self, values: Array) -> tuple[Manipulator, Array]:
        """Return the machine of a design, and the pose in the middle of its workspace.

        Raises
        ------
        ModelError
            If there is no such machine.
        """
        given = self.numbers(values)
        size, (home, reach) = given["size"], self.reach
        middle = np.where(self.robot.platform.angular, 0.0, size * home)
        for i, letter in enumerate(self.robot.coordinates):
            if letter in given and letter in "xyz":
                middle[i] += given[letter] * size * reach
            elif letter == "x" or (letter == "y" and "z" in KINDS[self.name][1]):
                middle[i] = 0.0
        stocks = {
            key: Stock.of(stock[int(given.get(key, 0.0))]) for key, stock in self.stocks.items()
        }
        return _built(self.robot, given, stocks, self.build), middle


def slides(leg: Any) -> bool:
    """Return whether a leg's joint slides on a guide, whose length follows from what it must do."""
    return leg.joint.unit == "m" and bool(_lengths(leg))


def _lengths(leg: Any) -> set[str]:
    return {q.name for q in leg.quantities if q.role == "length"}


def _built(
    robot: Manipulator, given: Mapping[str, float], stocks: Mapping[str, Stock], build: Build
) -> Manipulator:
    """Return a machine of another size, proportions and parts.

    Lengths grow with the size, other inertias than those of links, platform and carriages with
    its powers.
    """
    size, platform = given["size"], robot.platform
    axis, frame = np.array(platform.axis), np.array(platform.frame)
    flat = np.eye(3) - np.outer(axis, axis)
    wider = np.eye(3) + (given.get("base_radius", 1.0) - 1.0) * flat
    outer = np.eye(3) + (given.get("platform_radius", 1.0) - 1.0) * flat
    about = np.mean([leg.guide_point for leg in robot.legs], axis=0)
    legs, radius = [], 0.03
    for leg in robot.legs:
        found: dict[str, Any] = {}
        lengths = _lengths(leg)
        for key, values in leg.metres.items():
            parts = np.array(values)
            if key == "guide_point":
                parts = about + wider @ (parts - about)
            elif key == "platform_point":
                parts = parts @ frame @ outer @ frame.T
            elif key == "fixed_offset":
                parts = outer @ parts
            if key in lengths and key.startswith("upper"):
                parts = given.get("crank", 1.0) * parts
            found[key] = float(size * parts[0]) if key in lengths else tuple(size * parts)
        other = replace(leg, **found)
        at = np.array(other.platform_point) @ frame + other.fixed_offset
        radius = max(radius, float(np.linalg.norm(flat @ at)))
        legs.append(other.with_bodies(_bodies(other, size, stocks, build)))
    mass = 0.5 * np.pi * radius**2 * build.plate * _ALUMINIUM
    moments = {"m": mass, "I": mass * radius**2 / 2.0, "Izz": mass * radius**2 / 2.0}
    moments |= dict.fromkeys(("Ixx", "Iyy"), mass * radius**2 / 4.0)
    plate = platform.inertia.of_values([moments.get(k, 0.0) for k in platform.inertia.kinds])
    bars = tuple(
        replace(bar, mass=size**3 * bar.mass, hinge=tuple(size * outer @ bar.hinge))
        for bar in platform.bars
    )
    tool = tuple((size * np.array(platform.tool)).tolist())
    carried = replace(platform, bars=bars, inertia=plate, tool=tool)
    return replace(robot, legs=tuple(legs), platform=carried)


def _bodies(leg: Any, size: float, stocks: Mapping[str, Stock], build: Build) -> dict[str, Any]:
    """Return the bodies of a leg: links cut from stock, a carriage, or grown with the size."""
    found = {}
    for letter, body in leg.bodies.items():
        powers = (_POWERS["I" if k[0] == "I" else "g" if "g" in k else "m"] for k in body.kinds)
        grown = [v * size**p for v, p in zip(body.values, powers, strict=True)]
        found[letter] = body.of_values(grown)
        if slides(leg) and letter == "p":
            found[letter] = body.of_values([build.carriage] + [0.0] * (len(grown) - 1))
        key, low, high, _ = leg.extents.get(letter, ("", 0.0, 0.0, ""))
        if key in stocks:
            count = getattr(leg, "rods", 1) if key == "lower" else 1
            found[letter] = stocks[key].link(type(body), low, high, count)
    return found


def fitting_kinds(asked: Sequence[str] | None, lengths: int, turn: bool, tilt: bool) -> list[str]:
    """Return the kinds that can do a motion; of those asked for all must.

    Raises
    ------
    DataError
        If one that is asked for is none, or cannot do it.
    """
    faults, found = [], []
    for name in KINDS if asked is None else asked:
        if name not in KINDS:
            faults.append(f"kinds: {name!r} is none of {', '.join(KINDS)}")
            continue
        platform = load(name).platform
        lacks = [
            text
            for text, holds in (
                (f"moves along {' '.join(platform.lengths)} only", len(platform.lengths) < lengths),
                ("does not turn", turn and not platform.angles),
                ("does not tilt", tilt and len(platform.angles) < 3),
            )
            if holds
        ]
        if not lacks:
            found.append(name)
        elif asked is not None:
            faults.append(f"kinds: {name} {' and '.join(lacks)}, but the job asks for more")
    if faults:
        raise DataError("\n  ".join(faults))
    return found
