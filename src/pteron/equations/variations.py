"""The ways in which a machine's geometry may differ from its drawing, and machines that differ so.

Points, lengths and directions of every leg vary, as `LegKind.quantities` names them; a direction
turns, and what is perpendicular to it by definition turns along. What the machine's kind does not
allow, such as a tilt of a planar leg's axis, does not vary.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.equations.machine import number_places, numbers
from pteron.errors import ModelError
from pteron.legs import LegKind
from pteron.manipulator import Manipulator

Array = NDArray[np.float64]

Group = Literal["zeros", "scales", "lengths", "points", "directions", "tool", "radius", "angles"]
"""Names of groups of values, as `free` and `prior` of `calibrate` take them."""

AXIAL = ("radius", "angles")
"""Groups of guide points in cylinder coordinates: their common radius, and their angles."""

_TRIED = 1e-3
"""Amount, m or rad, by which each variation is tried; one that gives no machine is left out."""

_ALONG = 1e-9
"""Difference from 1 of the cosine up to which a direction lies along an axis."""

_AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Variation:
    """One way in which the geometry of a leg, or of the platform, may differ.

    Attributes
    ----------
    leg : int
        From 0; -1 for all legs, or for the platform.
    key : str
        The key of the robot's file that changes.
    axis : int or None
        Which component of a point; about which axis of the platform's frame a direction turns; None
        for a length.
    group : str
        "points", "lengths" or "directions"; or, of guide points about the platform's axis through
        the origin, as a printer's firmware counts them, the "radius" of all and the "angles".
    """

    leg: int
    key: str
    axis: int | None
    group: Group

    @property
    def name(self) -> str:
        """Its name: "legs[2].guide_point.x", "legs[2].direction about z"."""
        if self.group == "radius":
            return self.group
        owner = "platform" if self.leg < 0 else f"legs[{self.leg + 1}]"
        place = f"{owner}.{'angle' if self.group == 'angles' else self.key}"
        if self.axis is None:
            return place
        return f"{place}{' about ' if self.group == 'directions' else '.'}{_AXES[self.axis]}"

    @property
    def unit(self) -> str:
        """Its unit, "m" or "rad"."""
        return "rad" if self.group in ("directions", "angles") else "m"

    def value(self, robot: Manipulator) -> float:
        """Return the length on a machine, m; 0 for what turns."""
        if self.group == "radius":
            point, axis = np.array(robot.legs[0].guide_point), np.array(robot.platform.axis)
            return float(np.linalg.norm(np.cross(axis, point)))
        if self.unit == "rad":
            return 0.0
        held = getattr(robot.platform if self.leg < 0 else robot.legs[self.leg], self.key)
        return float(held if self.axis is None else held[self.axis])


@lru_cache(maxsize=32)
def variations(robot: Manipulator) -> tuple[Variation, ...]:
    """Return the ways in which a machine's geometry may differ, leg by leg, then the platform."""
    found: list[Variation] = []
    for i, leg in enumerate(robot.legs):
        for quantity in leg.quantities:
            role, key = quantity.role, quantity.name
            if role == "length":
                found.append(Variation(i, key, None, "lengths"))
            elif role == "point":
                found += [Variation(i, key, axis, "points") for axis in range(3)]
            elif role == "direction" and getattr(leg, key, None) is not None:
                found += _turns(robot, i, key, quantity.value)
        found += [Variation(i, "platform_point", axis, "points") for axis in range(3)]
    for key in robot.platform.turning_keys:
        if key == "center":
            found += [Variation(-1, key, axis, "points") for axis in range(3)]
        else:
            found += _turns(robot, -1, key, getattr(robot.platform, key))
    return tuple(v for v in found if v.group != "points" or _possible(robot, v))


def axial_variations(robot: Manipulator) -> tuple[Variation, ...]:
    """Return the radius of all guide points about the platform's axis, and their angles."""
    angles = (Variation(i, "guide_point", None, "angles") for i in range(len(robot.legs)))
    return Variation(-1, "guide_point", None, "radius"), *angles


def _turns(robot: Manipulator, leg: int, key: str, value: Sequence[float]) -> list[Variation]:
    """Return the turns of a direction; one about itself changes nothing."""
    along = np.abs(np.array(robot.platform.frame) @ value)
    about = [Variation(leg, key, axis, "directions") for axis in range(3)]
    turns = [v for v, a in zip(about, along, strict=True) if a < 1.0 - _ALONG]
    turns = [v for v in turns if _possible(robot, v)]
    if len(turns) == 3:
        del turns[int(along.argmax())]
    return turns


def _possible(robot: Manipulator, variation: Variation) -> bool:
    try:
        varied(robot, (variation,), np.array([_TRIED]))
    except ModelError:
        return False
    return True


def varied(robot: Manipulator, changes: Sequence[Variation], amounts: Array) -> Manipulator:
    """Return a machine whose geometry differs by the given amounts, m and rad.

    Raises
    ------
    ModelError
        If there is no such machine.
    """
    frame = np.array(robot.platform.frame)
    # The platform's are the last, as its number is -1.
    new: list[dict[str, Any]] = [{} for _ in (*robot.legs, robot.platform)]
    owners = (*robot.legs, robot.platform)
    turns: dict[tuple[int, str], Array] = {}
    for change, amount in zip(changes, amounts.tolist(), strict=True):
        if change.group in AXIAL:
            for i in range(len(robot.legs)) if change.leg < 0 else (change.leg,):
                point = np.array(new[i].get("guide_point", robot.legs[i].guide_point))
                outward, around = _about(frame[2], point)
                if change.group == "radius":
                    moved = point + amount * outward
                else:
                    cos, sin = np.cos(amount) - 1.0, np.sin(amount)
                    moved = point + np.linalg.norm(around) * cos * outward + sin * around
                new[i]["guide_point"] = tuple(moved.tolist())
            continue
        owner, fields = owners[change.leg], new[change.leg]
        if change.group == "directions":
            turn = turns.setdefault((change.leg, change.key), np.zeros(3))
            turn += amount * frame[change.axis or 0]
        elif change.axis is None:
            fields[change.key] = getattr(owner, change.key) + amount
        else:
            moved_point = list(fields.get(change.key, getattr(owner, change.key)))
            moved_point[change.axis] += amount
            fields[change.key] = tuple(moved_point)
    for (i, key), turn in turns.items():
        matrix = scipy.spatial.transform.Rotation.from_rotvec(turn).as_matrix()
        keys = turning_with(robot.legs[i], key) if i >= 0 else [key]
        if i < 0 and robot.platform.x_axis is not None:
            keys.append("x_axis")
        for name in keys:
            vector = np.array(new[i].get(name, getattr(owners[i], name)))
            new[i][name] = tuple((matrix @ vector).tolist())
    for i, leg in enumerate(robot.legs):
        _keep_perpendicular(leg, new[i], {key for k, key in turns if k == i})
    legs = tuple(replace(leg, **fields) for leg, fields in zip(robot.legs, new[:-1], strict=True))
    return replace(robot, legs=legs, platform=replace(robot.platform, **new[-1]))


def _keep_perpendicular(leg: LegKind, fields: dict[str, Any], turned: Collection[str]) -> None:
    """Make a leg's directions perpendicular again of which both were turned.

    One turn after the other leaves them so to first order alone.
    """
    for name, held in leg.every_key().items():
        if name in turned and held.across in turned:
            v, d = np.array(fields[name]), np.array(fields[held.across])
            v = v - (v @ d) / (d @ d) * d
            fields[name] = tuple((v / np.linalg.norm(v)).tolist())


def varied_numbers(robot: Manipulator, changes: Sequence[Variation], amounts: Array) -> Array:
    """Return the geometry (B, G) of machines that differ by amounts (B, K), m and rad.

    Each is that of `varied`, in the order of `equations.machine.numbers`, but that a derived axis
    may be another one in its plane. None is checked, and axial variations are not served.
    """
    places, frame = number_places(robot), np.array(robot.platform.frame)
    geometry = np.tile(numbers(robot), (len(amounts), 1))
    turns: dict[tuple[int, str], Array] = {}
    for change, amount in zip(changes, amounts.T, strict=True):
        if change.group == "directions":
            turn = turns.setdefault((change.leg, change.key), np.zeros((len(amounts), 3)))
            turn += amount[:, None] * frame[change.axis or 0]
        else:
            geometry[:, places[change.leg][change.key] + (change.axis or 0)] += amount
    for (leg, key), turn in turns.items():
        matrices = scipy.spatial.transform.Rotation.from_rotvec(turn).as_matrix()
        for row in _turned_rows(robot, leg, key, places[leg]):
            at = slice(row, row + 3)
            geometry[:, at] = np.einsum("bij,bj->bi", matrices, geometry[:, at])
    return geometry


def turning_with(leg: LegKind, key: str) -> list[str]:
    """Return the fields of a leg that turn with one of its directions: first that itself."""
    keys, roles = leg.every_key(), {q.name: q.role for q in leg.quantities}
    first = next(name for name, role in roles.items() if role == "direction")
    followers = [
        name
        for name, held in keys.items()
        if held.role == "direction"
        and name != key
        and getattr(leg, name) is not None
        and (held.across == key or (key == first and roles.get(name) == "normal"))
    ]
    return [key, *followers]


def _about(axis: Array, point: Array) -> tuple[Array, Array]:
    """Return the unit vector from an axis through the origin to a point, and axis x point."""
    outward = point - (point @ axis) * axis
    return outward / np.linalg.norm(outward), np.cross(axis, point)


Term = tuple[int, int, tuple[int, ...], int]
"""Row, variation, factors and sign of an entry of d(geometry)/d(variation).

The entry is a product of numbers of the geometry, or 1. The geometry is the vector of
`equations.machine.numbers`; so the slopes are known in any field."""


def slope_terms(robot: Manipulator, changes: Sequence[Variation]) -> list[Term]:
    """Return the slopes of a machine's geometry against its variations, but for axial ones."""
    places = number_places(robot)
    start = places[-1]["frame"]
    found: list[Term] = []
    for k, change in enumerate(changes):
        if change.group in AXIAL:
            continue
        at = places[change.leg]
        if change.group != "directions":
            found.append((at[change.key] + (change.axis or 0), k, (), 1))
            continue
        axis = start + 3 * (change.axis or 0)
        for row in _turned_rows(robot, change.leg, change.key, at):
            for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
                found.append((row + a, k, (axis + b, row + c), 1))
                found.append((row + a, k, (axis + c, row + b), -1))
    return found


def _turned_rows(robot: Manipulator, leg: int, key: str, at: Mapping[str, int]) -> list[int]:
    """Return where the vectors begin that turn with a direction, by the places of its owner."""
    if leg >= 0:
        return [at[name] for name in _turned(robot.legs[leg], key, at)]
    first = {"axis": "first_axis"}.get(key, key)
    start = at["frame"]
    return [at[first]] if first in at else [start, start + 3, start + 6]


def _turned(leg: LegKind, key: str, known: Collection[str]) -> list[str]:
    """Return a leg's quantities that turn with a direction: derived ones with its first."""
    names = [name for name in turning_with(leg, key) if name in known]
    if key == next(q.name for q in leg.quantities if q.role == "direction"):
        names += [
            q.name
            for q in leg.quantities
            if q.role in ("direction", "normal")
            and q.name not in names
            and not getattr(leg, q.name, None)
        ]
    return names


def slope_matrix(
    robot: Manipulator,
    changes: Sequence[Variation],
    terms: Sequence[Term],
    geometry: NDArray[Any],
    radial: Sequence[tuple[NDArray[Any], NDArray[Any]]] | None = None,
) -> NDArray[Any]:
    """Return d(geometry)/d(variations) of a machine, in floats or in the numbers of a field.

    Of a field `radial` has for each leg the unit vector from the platform's axis to its guide
    point, and a vector that turns it about the axis.
    """
    matrix = np.zeros((len(geometry), len(changes)), dtype=geometry.dtype)
    places = number_places(robot)
    for k, change in enumerate(changes):
        if change.group in AXIAL:
            for i in range(len(robot.legs)) if change.leg < 0 else (change.leg,):
                at = places[i]["guide_point"]
                point = geometry[at : at + 3]
                vectors = radial[i] if radial else _about(np.array(robot.platform.axis), point)
                matrix[at : at + 3, k] = vectors[change.group == "angles"]
    for row, k, factors, sign in terms:
        matrix[row, k] += sign * np.prod(geometry[list(factors)])
    return matrix
