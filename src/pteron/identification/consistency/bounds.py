"""What is known of the bodies beforehand: limits of parameters, boxes that hold the bodies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.manipulator import Manipulator, parameter_names

Box = tuple[tuple[float, float], tuple[float, float]]
"""((xmin, xmax), (ymin, ymax)) in the body's frame, m."""


@dataclass(frozen=True)
class Limits:
    """Linear limits `matrix @ parameters <= right`, and what each one is called."""

    matrix: Array
    right: Array
    names: tuple[str, ...]

    def violations(self, values: Array, tolerance: Array) -> tuple[str, ...]:
        """Return the limits that parameters (N,) do not keep, and by how much, SI units."""
        over = self.matrix @ values - self.right
        return tuple(
            f"{name}: by {excess:.3g}"
            for name, excess, small in zip(self.names, over, tolerance, strict=True)
            if excess > small
        )


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
        pairs = {
            name: (self.lower[name], self.upper[name]) for name in self.lower.keys() & self.upper
        }
        if self.total_mass is not None:
            pairs["total_mass"] = self.total_mass
        for body, box in self.boxes.items():
            try:
                pairs[f"box of {body}, x"], pairs[f"box of {body}, y"] = (
                    (float(low), float(high)) for low, high in box
                )
            except (TypeError, ValueError):
                raise ModelError(
                    f"bounds: box of {body}: {box!r} is not ((xmin, xmax), (ymin, ymax))"
                ) from None
        for name, (low, high) in sorted(pairs.items()):
            if not low <= high:
                raise ModelError(f"bounds: {name}: lower limit {low:g} is above the upper {high:g}")

    def limits(self, robot: Manipulator) -> Limits:
        """Return the limits as rows on the N parameters.

        Raises
        ------
        ModelError
            If the machine has no such parameter or body.
        """
        names = parameter_names(robot)
        bodies = [name.removeprefix("m_") for name in names[len(robot.legs) :: 4]]
        rows: list[tuple[dict[str, float], float, str]] = []
        for side, sign, sense in ((self.lower, -1.0, ">="), (self.upper, 1.0, "<=")):
            for key, limit in side.items():
                if not np.isfinite(limit):
                    raise ModelError(f"bounds: {key}: {limit} is not a number")
                for name in _matching(key, names, "parameter"):
                    rows.append(({name: sign}, sign * limit, f"{name} {sense} {limit:g}"))
        for key, box in self.boxes.items():
            for body in _matching(key, bodies, "body"):
                rows.extend(_box_rows(body, box))
        if self.total_mass is not None:
            masses = [name for name in names if name.startswith("m_")]
            low, high = self.total_mass
            rows.append((dict.fromkeys(masses, -1.0), -low, f"total mass >= {low:g}"))
            rows.append((dict.fromkeys(masses, 1.0), high, f"total mass <= {high:g}"))
        matrix = np.zeros((len(rows), len(names)))
        for k, (terms, _, _) in enumerate(rows):
            for name, coefficient in terms.items():
                matrix[k, names.index(name)] = coefficient
        return Limits(
            matrix, np.array([right for _, right, _ in rows]), tuple(name for _, _, name in rows)
        )


def _matching(key: str, names: Iterable[str], what: str) -> list[str]:
    """Return the name itself, or those of all legs."""
    names = list(names)
    found = [name for name in names if key in (name, name.rstrip("0123456789"))]
    if not found:
        raise ModelError(f"bounds: {key!r} is no {what} of this machine: {', '.join(names)}")
    return found


def _box_rows(body: str, box: Box) -> list[tuple[dict[str, float], float, str]]:
    (x0, x1), (y0, y1) = box
    m, hx, hy, inertia = (f"{p}_{body}" for p in ("m", "mgx", "mgy", "I"))
    text = f"box of {body}"
    return [
        ({m: x0, hx: -1.0}, 0.0, f"{text}: centre of mass x >= {x0:g}"),
        ({m: -x1, hx: 1.0}, 0.0, f"{text}: centre of mass x <= {x1:g}"),
        ({m: y0, hy: -1.0}, 0.0, f"{text}: centre of mass y >= {y0:g}"),
        ({m: -y1, hy: 1.0}, 0.0, f"{text}: centre of mass y <= {y1:g}"),
        (
            {inertia: 1.0, hx: -(x0 + x1), hy: -(y0 + y1), m: x0 * x1 + y0 * y1},
            0.0,
            f"{text}: inertia that mass inside can have",
        ),
    ]
