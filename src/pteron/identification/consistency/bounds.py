"""Prior knowledge of the bodies: limits of parameters, and boxes that hold a body's mass."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from pteron.arguments import checked_arguments
from pteron.bodies.inertia import RodInertia, SpatialInertia
from pteron.bodies.parameters import body_places
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.manipulator import Manipulator, parameter_data

Box = tuple[tuple[float, float], ...]
"""((xmin, xmax), (ymin, ymax)) in the body's frame, m; and (zmin, zmax) of one that turns about any
axis."""


@dataclass(frozen=True)
class LinearLimits:
    """Linear limits `matrix @ parameters <= right`, each with its name."""

    matrix: Array
    right: Array
    names: tuple[str, ...]

    def violations(self, parameters: Array, tolerance: Array) -> tuple[str, ...]:
        """Return the limits that parameters (N,) violate, and by how much, SI units."""
        over = self.matrix @ parameters - self.right
        return tuple(
            f"{name}: by {excess:.3g}"
            for name, excess, small in zip(self.names, over, tolerance, strict=True)
            if excess > small
        )


@checked_arguments
@dataclass(frozen=True)
class Bounds:
    """Limits that the parameters of real bodies shall keep.

    Parameters
    ----------
    lower, upper : mapping of str to float
        Limits by parameter name, SI units: ``{"m_u1": 0.2}``, or ``{"m_u": 0.2}`` for all legs.
    boxes : mapping of str to ((xmin, xmax), (ymin, ymax))
        A box, m, that holds all of a body's mass, in the body's frame: of ``"u1"``, ``"l3"``,
        ``"e"``, or ``"u"`` for all legs. The centre of mass is inside, and since
        (x - xmin) (xmax - x) >= 0 wherever there is mass, and so for y,
        I <= (xmin + xmax) hx + (ymin + ymax) hy - m (xmin xmax + ymin ymax).
    total_mass : (float, float), optional
        Least and largest mass of all bodies together, kg.

    Raises
    ------
    ModelError
        If a lower limit is above its upper one, or a box is empty. Names are checked against the
        machine when they are used.

    Examples
    --------
    >>> from pteron.identification.consistency import Bounds
    >>> Bounds(lower={"m_u": 0.2}, boxes={"e": ((-0.06, 0.06), (-0.06, 0.06))}).lower
    {'m_u': 0.2}
    """

    lower: Mapping[str, float] = field(default_factory=dict)
    upper: Mapping[str, float] = field(default_factory=dict)
    boxes: Mapping[str, Box] = field(default_factory=dict)
    total_mass: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        pairs = {n: (self.lower[n], self.upper[n]) for n in self.lower.keys() & self.upper}
        if self.total_mass is not None:
            pairs["total_mass"] = self.total_mass
        for body, box in self.boxes.items():
            try:
                sides = [(float(low), float(high)) for low, high in box]
                _, _, *_ = sides
                pairs |= {
                    f"box of {body}, {axis}": side for axis, side in zip("xyz", sides, strict=False)
                }
            except (TypeError, ValueError):
                raise ModelError(
                    f"bounds: box of {body}: {box!r} is not ((xmin, xmax), (ymin, ymax))"
                ) from None
        for name, (low, high) in sorted(pairs.items()):
            if not low <= high:
                raise ModelError(f"bounds: {name}: lower limit {low:g} is above the upper {high:g}")

    def limits(self, robot: Manipulator) -> LinearLimits:
        """Return all limits as linear inequalities on the N parameters, with those of rods.

        The centre of mass of a rod is between its ends, whatever else is known.

        Raises
        ------
        ModelError
            If the machine has no such parameter or body.
        """
        columns = parameter_data(robot)
        places = body_places(columns)
        unit = np.eye(len(columns))
        rows: list[tuple[Array, float, str]] = []
        for side, sign, sense in ((self.lower, -1.0, ">="), (self.upper, 1.0, "<=")):
            for key, limit in side.items():
                if not np.isfinite(limit):
                    raise ModelError(f"bounds: {key}: {limit} is not a number")
                known = {p.name: f"{p.kind}_{p.body}" for p in columns}
                for name in _names_of_key(key, known, "parameter"):
                    row = sign * unit[list(known).index(name)]
                    rows.append((row, sign * limit, f"{name} {sense} {limit:g}"))
        for key, box in self.boxes.items():
            turning = {p.owner: p.body for p in columns if p.kind in ("I", "Izz")}
            for body in _names_of_key(key, turning, "body"):
                place = {kind: unit[column] for kind, column in places[body].items()}
                rows += [(row, 0.0, f"box of {body}: {what}") for row, what in _box(place, box)]
        for body, (low, high) in _rods(robot).items():
            place = {kind: unit[column] for kind, column in places[body].items()}
            rows.append((low * place["m"] - place["mgx"], 0.0, f"{body}: centre after its tip"))
            rows.append((place["mgx"] - high * place["m"], 0.0, f"{body}: centre before its end"))
        if self.total_mass is not None:
            total = sum(unit[place["m"]] for place in places.values())
            low, high = self.total_mass
            rows.append((-total, -low, f"total mass >= {low:g}"))
            rows.append((total, high, f"total mass <= {high:g}"))
        matrix = np.array([row for row, _, _ in rows]).reshape(len(rows), len(columns))
        return LinearLimits(
            matrix, np.array([right for _, right, _ in rows]), tuple(name for _, _, name in rows)
        )


def _rods(robot: Manipulator) -> dict[str, tuple[float, float]]:
    """Return the ends of each rod along its x axis, m, by body; without rods of no extent."""
    ends = {}
    for p in parameter_data(robot):
        if p.kind == "I" and p.legs:
            leg = robot.legs[p.legs[0] - 1]
            if p.body in leg.extents and leg.bodies[p.body].kinds == RodInertia.kinds:
                ends[p.owner] = leg.extents[p.body][1:3]
    return ends


def _names_of_key(key: str, known: Mapping[str, str], what: str) -> list[str]:
    """Return the names that a key stands for: itself, or all those with it as their stem."""
    names = [name for name, stem in known.items() if key in (name, stem)]
    if not names:
        raise ModelError(f"bounds: {key!r} is no {what} of this machine: {', '.join(known)}")
    return names


def _box(place: Mapping[str, Array], box: Box) -> Iterator[tuple[Array, str]]:
    """Yield rows that are at most 0 for a body inside a box, with the name of each."""
    solid = SpatialInertia.second_moments(place) if "Izz" in place else None
    inertia, least = place.get("I"), 0.0
    for k, (axis, (low, high)) in enumerate(zip("xyz", box, strict=False)):
        if (moment := place.get(f"mg{axis}")) is None:
            continue
        yield low * place["m"] - moment, f"centre of mass {axis} >= {low:g}"
        yield moment - high * place["m"], f"centre of mass {axis} <= {high:g}"
        if solid is not None:
            spread = solid[k][k] - (low + high) * moment + low * high * place["m"]
            yield spread, f"second moment along {axis} that mass inside can have"
        elif inertia is not None:
            inertia = inertia - (low + high) * moment
            least += low * high
    if inertia is not None:
        yield inertia + least * place["m"], "inertia that mass inside can have"
