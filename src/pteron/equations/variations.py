"""Variations of a machine's geometry from its drawing, and machines with varied geometry.

Points, lengths and directions of every leg vary, as `LegKind.quantities` names them; a direction
rotates, and directions that are perpendicular to it by definition rotate with it. Arcs between axes
vary too, whose number in the geometry is the tangent of their half. Variations that
the machine's kind excludes, such as a tilt of a planar leg's axis, are left out.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pteron.bodies.vectors import rotation_matrices
from pteron.equations.machine import number_places, numbers
from pteron.errors import ModelError
from pteron.legs import LegKind
from pteron.manipulator import Manipulator
from pteron.tolerances import ROUNDING

Array = NDArray[np.float64]

Group = Literal["zeros", "scales", "lengths", "points", "directions", "tool", "radius", "angles"]
"""Names of groups of values, as `free` and `prior` of `calibrate` take them."""

AXIAL = ("radius", "angles")
"""Groups of guide points in cylinder coordinates: their common radius, and their angles."""

_TRIAL_AMOUNT = 1e-3
"""Amount, m or rad, by which each variation is tried; one that is no valid machine is left out."""

_AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Variation:
    """One degree of freedom of the geometry of a leg, or of the platform.

    Attributes
    ----------
    leg : int
        From 0; -1 for all legs, or for the platform.
    key : str
        The key of the robot's file that changes.
    axis : int or None
        Which component of a point; about which axis of the platform's frame a direction turns; None
        for a length and for an arc.
    group : str
        "points", "lengths" or "directions", which have the arcs; or, of guide points about the
        platform's axis through the origin, as a printer's firmware counts them, the "radius" of all
        and the "angles".
    """

    leg: int
    key: str
    axis: int | None
    group: Group

    @property
    def name(self) -> str:
        """The varied quantity's name: "legs[2].guide_point.x", "legs[2].direction about z"."""
        if self.group == "radius":
            return self.group
        owner = "platform" if self.leg < 0 else f"legs[{self.leg + 1}]"
        place = f"{owner}.{'angle' if self.group == 'angles' else self.key}"
        if self.axis is None:
            return place
        return f"{place}{' about ' if self.group == 'directions' else '.'}{_AXES[self.axis]}"

    @property
    def is_arc(self) -> bool:
        """Whether an arc between two axes of a leg varies."""
        return self.group == "directions" and self.axis is None

    @property
    def number(self) -> str:
        """The name of the leg's or platform's number in the geometry that varies."""
        return arc_number(self.key) if self.is_arc else self.key

    @property
    def unit(self) -> str:
        """The unit of the variation: "m" or "rad"."""
        return "rad" if self.group in ("directions", "angles") else "m"

    def value(self, robot: Manipulator) -> float:
        """Return the nominal value on a machine of what varies, m or rad; 0 for a rotation."""
        if self.group == "radius":
            point, axis = np.array(robot.legs[0].guide_point), np.array(robot.platform.axis)
            return float(np.linalg.norm(np.cross(axis, point)))
        if self.unit == "rad" and not self.is_arc:
            return 0.0
        quantity = getattr(robot.platform if self.leg < 0 else robot.legs[self.leg], self.key)
        return float(quantity if self.axis is None else quantity[self.axis])


def arc_number(key: str) -> str:
    """Return the name of an arc's number in the geometry, the tangent of its half."""
    return key.replace("_arc", "_tangent")


@lru_cache(maxsize=32)
def variations(robot: Manipulator) -> tuple[Variation, ...]:
    """Return all variations of a machine's points, lengths and directions, leg by leg."""
    candidates: list[Variation] = []
    for i, leg in enumerate(robot.legs):
        for quantity in leg.quantities:
            role, key = quantity.role, quantity.name
            if role == "length":
                candidates.append(Variation(i, key, None, "lengths"))
            elif role == "point":
                candidates += [Variation(i, key, axis, "points") for axis in range(3)]
            elif role == "direction" and getattr(leg, key, None) is not None:
                candidates += _turns(robot, i, key, quantity.value)
        candidates += [Variation(i, "platform_point", axis, "points") for axis in range(3)]
        arcs = (name for name, key in leg.every_key().items() if key.role == "angle")
        candidates += [Variation(i, name, None, "directions") for name in arcs]
    for key in robot.platform.turning_keys:
        if key in ("center", "axis_offset"):
            candidates += [Variation(-1, key, axis, "points") for axis in range(3)]
        else:
            candidates += _turns(robot, -1, key, getattr(robot.platform, key))
    return tuple(v for v in candidates if v.group != "points" or _possible(robot, v))


def axial_variations(robot: Manipulator) -> tuple[Variation, ...]:
    """Return the radius of all guide points about the platform's axis, and their angles."""
    angles = (Variation(i, "guide_point", None, "angles") for i in range(len(robot.legs)))
    return Variation(-1, "guide_point", None, "radius"), *angles


def _turns(robot: Manipulator, leg: int, key: str, direction: Sequence[float]) -> list[Variation]:
    """Return the rotations about base axes that change a direction of a leg or the platform."""
    axis_cosines = np.abs(np.array(robot.platform.frame) @ direction)
    rotations = [Variation(leg, key, axis, "directions") for axis in range(3)]
    turns = [v for v, a in zip(rotations, axis_cosines, strict=True) if a < 1.0 - ROUNDING]
    turns = [v for v in turns if _possible(robot, v)]
    if len(turns) == 3:
        del turns[int(axis_cosines.argmax())]
    return turns


def _possible(robot: Manipulator, variation: Variation) -> bool:
    """Return whether the machine with a small trial amount of the variation is valid."""
    try:
        vary_geometry(robot, (variation,), np.array([_TRIAL_AMOUNT]))
    except ModelError:
        return False
    return True


def vary_geometry(robot: Manipulator, changes: Sequence[Variation], amounts: Array) -> Manipulator:
    """Return the machine with its geometry varied by `amounts` (K,), m and rad.

    Raises
    ------
    ModelError
        If the varied geometry is invalid.
    """
    frame = np.array(robot.platform.frame)
    # The platform's are the last, as its number is -1.
    changed_fields: list[dict[str, Any]] = [{} for _ in (*robot.legs, robot.platform)]
    owners = (*robot.legs, robot.platform)
    turns: dict[tuple[int, str], Array] = {}
    for change, amount in zip(changes, amounts.tolist(), strict=True):
        if change.group in AXIAL:
            for i in range(len(robot.legs)) if change.leg < 0 else (change.leg,):
                point = np.array(changed_fields[i].get("guide_point", robot.legs[i].guide_point))
                outward, around = _radial_frame(frame[2], point)
                if change.group == "radius":
                    new_point = point + amount * outward
                else:
                    cos, sin = np.cos(amount) - 1.0, np.sin(amount)
                    new_point = point + np.linalg.norm(around) * cos * outward + sin * around
                changed_fields[i]["guide_point"] = tuple(new_point.tolist())
            continue
        owner, fields = owners[change.leg], changed_fields[change.leg]
        if change.group == "directions" and not change.is_arc:
            turn = turns.setdefault((change.leg, change.key), np.zeros(3))
            turn += amount * frame[change.axis or 0]
        elif change.axis is None:
            fields[change.key] = getattr(owner, change.key) + amount
        else:
            new_components = list(fields.get(change.key, getattr(owner, change.key)))
            new_components[change.axis] += amount
            fields[change.key] = tuple(new_components)
    for (i, key), turn in turns.items():
        matrix = rotation_matrices(turn)
        keys = rotating_keys(robot.legs[i], key) if i >= 0 else [key]
        if i < 0 and robot.platform.x_axis is not None:
            keys.append("x_axis")
        for name in keys:
            vector = np.array(changed_fields[i].get(name, getattr(owners[i], name)))
            changed_fields[i][name] = tuple((matrix @ vector).tolist())
    for i, leg in enumerate(robot.legs):
        _keep_perpendicular(leg, changed_fields[i], {key for k, key in turns if k == i})
    legs = tuple(
        replace(leg, **fields) for leg, fields in zip(robot.legs, changed_fields[:-1], strict=True)
    )
    return replace(robot, legs=legs, platform=replace(robot.platform, **changed_fields[-1]))


def _keep_perpendicular(leg: LegKind, fields: dict[str, Any], turned: Collection[str]) -> None:
    """Make directions of a leg perpendicular again, in `fields`, after both were rotated.

    Successive rotations keep them perpendicular to first order only.
    """
    for name, quantity in leg.every_key().items():
        if name in turned and quantity.across in turned:
            v, d = np.array(fields[name]), np.array(fields[quantity.across])
            v = v - (v @ d) / (d @ d) * d
            fields[name] = tuple((v / np.linalg.norm(v)).tolist())


def varied_numbers(robot: Manipulator, changes: Sequence[Variation], amounts: Array) -> Array:
    """Return the geometric numbers (B, G) of machines varied by amounts (B, K), m and rad.

    Each row is the geometry of `vary_geometry`, in the order of `equations.machine.numbers`, except
    that derived axes may be rotated in their plane. The geometry is not checked; axial variations
    are excluded.
    """
    places, frame = number_places(robot), np.array(robot.platform.frame)
    geometry = np.tile(numbers(robot), (len(amounts), 1))
    turns: dict[tuple[int, str], Array] = {}
    for change, amount in zip(changes, amounts.T, strict=True):
        if change.is_arc:
            row = places[change.leg][change.number]
            geometry[:, row] = np.tan(np.arctan(geometry[:, row]) + 0.5 * amount)
        elif change.group == "directions":
            turn = turns.setdefault((change.leg, change.key), np.zeros((len(amounts), 3)))
            turn += amount[:, None] * frame[change.axis or 0]
        else:
            geometry[:, places[change.leg][change.key] + (change.axis or 0)] += amount
    for (leg, key), turn in turns.items():
        matrices = rotation_matrices(turn)
        for row in _rotating_rows(robot, leg, key, places[leg]):
            at = slice(row, row + 3)
            geometry[:, at] = np.einsum("bij,bj->bi", matrices, geometry[:, at])
    return geometry


def rotating_keys(leg: LegKind, key: str) -> list[str]:
    """Return the fields of a leg that rotate with one of its directions, that one first."""
    keys, roles = leg.every_key(), {q.name: q.role for q in leg.quantities}
    first = next(name for name, role in roles.items() if role == "direction")
    followers = [
        name
        for name, quantity in keys.items()
        if quantity.role == "direction"
        and name != key
        and getattr(leg, name) is not None
        and (quantity.across == key or (key == first and roles.get(name) == "normal"))
    ]
    return [key, *followers]


def _radial_frame(axis: Array, point: Array) -> tuple[Array, Array]:
    """Return the unit radial vector from an axis through the origin to a point; axis x point."""
    outward = point - (point @ axis) * axis
    return outward / np.linalg.norm(outward), np.cross(axis, point)


Term = tuple[int, int, tuple[int, ...], int]
"""Row, variation, factors and sign of an entry of d(geometry)/d(variation).

The entry is a product of numbers of the geometry, or 1. The geometry is the vector of
`equations.machine.numbers`; so the slopes are known in any field."""


def slope_terms(robot: Manipulator, changes: Sequence[Variation]) -> list[Term]:
    """Return the non-zero terms of d(geometry)/d(variations), except for axial variations."""
    places = number_places(robot)
    start = places[-1]["frame"]
    terms: list[Term] = []
    for k, change in enumerate(changes):
        if change.group in AXIAL:
            continue
        at = places[change.leg]
        if change.is_arc:  # twice d tan(arc / 2)/d arc = 1 + tan(arc / 2)^2
            row = at[change.number]
            terms += [(row, k, (), 1), (row, k, (row, row), 1)]
            continue
        if change.group != "directions":
            terms.append((at[change.key] + (change.axis or 0), k, (), 1))
            continue
        axis = start + 3 * (change.axis or 0)
        for row in _rotating_rows(robot, change.leg, change.key, at):
            for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
                terms.append((row + a, k, (axis + b, row + c), 1))
                terms.append((row + a, k, (axis + c, row + b), -1))
    return terms


def _rotating_rows(robot: Manipulator, leg: int, key: str, at: Mapping[str, int]) -> list[int]:
    """Return the first rows, in the geometry vector, of vectors that turn with a direction."""
    if leg >= 0:
        return [at[name] for name in _rotating_quantities(robot.legs[leg], key, at)]
    first = {"axis": "first_axis"}.get(key, key)
    start = at["frame"]
    return [at[first]] if first in at else [start, start + 3, start + 6]


def _rotating_quantities(leg: LegKind, key: str, known: Collection[str]) -> list[str]:
    """Return the names of a leg's quantities that rotate with the direction `key`."""
    names = [name for name in rotating_keys(leg, key) if name in known]
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
    """Return the matrix (G, K) of d(geometry)/d(variations), in floats or numbers of a field.

    In a field the columns of arcs are doubled, so that they need no fraction, and `radial` has for
    each leg the unit vector from the platform's axis to its guide point, and the vector axis x
    point, along which it moves when it turns about the axis.
    """
    matrix = np.zeros((len(geometry), len(changes)), dtype=geometry.dtype)
    places = number_places(robot)
    for k, change in enumerate(changes):
        if change.group in AXIAL:
            for i in range(len(robot.legs)) if change.leg < 0 else (change.leg,):
                at = places[i]["guide_point"]
                point = geometry[at : at + 3]
                vectors = (
                    radial[i] if radial else _radial_frame(np.array(robot.platform.axis), point)
                )
                matrix[at : at + 3, k] = vectors[change.group == "angles"]
    for row, k, factors, sign in terms:
        matrix[row, k] += sign * np.prod(geometry[list(factors)])
    if matrix.dtype == float:
        matrix[:, [change.is_arc for change in changes]] *= 0.5
    return matrix
