"""The quantities that a design search may improve or bound, such as size, margins and forces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from functools import lru_cache, partial
from inspect import getdoc
from typing import Any, Literal

import numpy as np

from pteron.design.cycle_loads import best_motors, shortest_time
from pteron.design.worst_cases import worst_position_errors
from pteron.errors import shorten
from pteron.extensions import extension_names, load_extension
from pteron.indices import INDICES, Index, stiffness
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.motion import limits_of
from pteron.workspace import clearance

Cover = Literal["machine", "proved", "lattice", "places", "fine", "directions", "bound", "cycles"]
"""How far a quantity is known: see `COVERS`."""

COVERS: dict[Cover, str] = {
    "machine": "exact, from the machine's dimensions alone",
    "proved": "found by the search, then proved",
    "lattice": "at {places} sampled poses",
    "places": "at {places} sampled poses, and about the worst of them",
    "fine": "at {places} sampled poses, and about the worst of them",
    "directions": (
        "exact over all directions, at {places} sampled poses and about the worst of them"
    ),
    "bound": (
        "bounded from above over all directions, to first order, at {places} sampled poses and "
        "about the worst of them"
    ),
    "cycles": "at {times} times of the cycles{places}",
}
"""How far a quantity is known, in words."""

GROUP = "pteron.design"
"""Group of the entry points of other packages' quantities."""


@dataclass(frozen=True)
class DesignQuantity:
    """One quantity of a design.

    Attributes
    ----------
    unit : str
        Empty where it has none.
    about : str
        Its meaning, in a line.
    of : callable
        Takes a `Design`; NaN where there is none.
    of_machine : callable or None
        The same from the machine alone, where its poses do not matter: then gradients are known.
    cover : str
        How far it is known, a key of `COVERS`.
    name : str
        Its name in tables; of those of `quantities` it is their key.
    """

    unit: str
    about: str
    of: Callable[[Any], float]
    of_machine: Callable[[Manipulator], float] | None = None
    cover: Cover = "lattice"
    name: str = ""


def _sample_cover(
    unit: str,
    about: str,
    at: Callable[[Any, Array], Array],
    *,
    least: bool = False,
    cover: Cover = "places",
) -> DesignQuantity:
    """Return a design quantity: the extreme over the workspace of `at(design, poses)` (N,)."""
    sign = -1.0 if least else 1.0
    fine = cover == "fine"
    return DesignQuantity(unit, about, lambda d: d.worst(at, sign, fine=fine), cover=cover)


def machine_quantity(
    unit: str, about: str, of_machine: Callable[[Manipulator], float], name: str = ""
) -> DesignQuantity:
    """Return a design quantity whose value is `of_machine(robot)`."""
    of = partial(_evaluate_machine, of_machine)
    return DesignQuantity(unit, about, of, of_machine, "machine", name)


def _evaluate_machine(of_machine: Callable[[Manipulator], float], design: Any) -> float:
    """Return `of_machine` evaluated for the machine of a design."""
    return of_machine(design.robot)


def quantity_of(
    quantity: DesignQuantity | Callable[[Manipulator], float], name: str
) -> DesignQuantity:
    """Return a design quantity as it is; a function of a machine wrapped as one."""
    if isinstance(quantity, DesignQuantity):
        return quantity
    return machine_quantity("", (getdoc(quantity) or "").partition("\n")[0], quantity, name)


def _links(robot: Manipulator) -> float:
    """Return the sum of all link lengths of the legs, m."""
    return float(
        sum(q.value[0] for leg in robot.legs for q in leg.quantities if q.role == "length")
    )


def moving_mass(robot: Manipulator) -> float:
    """Return the mass of all moving bodies, kg."""
    legs = sum(body.values[0] for leg in robot.legs for body in leg.bodies.values())
    carried = sum(bar.mass for bar in robot.platform.bars)
    return float(legs + robot.platform.inertia.mass + carried)


def _size(design: Any) -> float:
    """Return the diagonal of the box around all joint points over the workspace, m."""
    points = design.values("joint_points")
    points = points.reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=-1)]
    if not len(points):
        return float("nan")
    return float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))


def _type_i(design: Any, poses: Array) -> Array:
    """Return the least type-I index of the legs at poses (N, m): (N,), NaN out of reach."""
    squares = design.values("squared_type_i", poses).min(axis=-1)
    return np.asarray(np.where(squares >= 0.0, np.sqrt(np.abs(squares)), np.nan))


def _type_ii(design: Any, poses: Array) -> Array:
    """Return the type-II index (N,) at poses (N, m), >= 0; 0 beyond the singularity."""
    return np.asarray(np.maximum(design.side * design.values("type_ii", poses), 0.0))


def _stroke(design: Any) -> float:
    """Return the largest joint travel relative to that of the initial machine (no unit)."""
    return float((design.strokes / design.reference_strokes).max())


def _drive_load(design: Any, poses: Array) -> Array:
    """Return the greatest ratio of drive force or speed to its limit at poses (N, m): (N,)."""
    limits = limits_of(design.robot)
    shares = design.forces(poses) / limits.force, design.speeds(poses) / limits.speed
    return np.asarray(np.maximum(*shares).max(axis=-1))


def _stiffness(design: Any, poses: Array) -> Array:
    """Return the least stiffness at the tool over directions at poses (N, m): (N,), N/m."""
    elastic = design.task.spec.elasticity.elasticity
    return np.asarray(stiffness(design.robot, poses, elastic, on_failure="nan").least)


def _accuracy(design: Any, poses: Array) -> Array:
    """Return the largest position errors of the tool at poses (N, m): (N,), m."""
    return worst_position_errors(design.robot, poses, design.task.spec.errors.tolerances)


def _cycle_time(design: Any) -> float:
    """Return the shortest time of all cycles within the drives' limits, with dwells, s."""
    robot, rests = design.loaded_robot, sum(cycle.dwell for cycle in design.task.spec.cycles)
    return float(rests) + sum(shortest_time(robot, motion) for motion in design.cycles)


_BUILT_IN = {
    "cube": DesignQuantity(
        "m",
        "edge of the largest cube that keeps the floors and limits",
        lambda d: d.cube.edge,
        cover="proved",
    ),
    "scale": DesignQuantity(
        "",
        "factor by which a workspace that floats can grow, 1 as it is asked for",
        lambda d: d.scale,
        cover="proved",
    ),
    "links": machine_quantity("m", "sum of the links' lengths", _links),
    "moving_mass": machine_quantity("kg", "mass of all that moves", moving_mass),
    "size": DesignQuantity(
        "m", "diagonal of the box that holds all joints at the poses of the workspace", _size
    ),
    "type_i": _sample_cover(
        "", "least type-I measure of a leg in the workspace", _type_i, least=True
    ),
    "type_ii": _sample_cover("", "least type-II measure in the workspace", _type_ii, least=True),
    "clearance": _sample_cover(
        "m",
        "least distance of two bodies in the workspace, with the file's radii",
        lambda d, poses: clearance(d.robot, poses, on_failure="nan").least,
        least=True,
        cover="fine",
    ),
    "stroke": DesignQuantity(
        "",
        "greatest travel of a joint in the workspace, over the width of its limits or, without "
        "them, over its travel in the machine to begin with",
        _stroke,
    ),
    "speed": _sample_cover(
        "m/s or rad/s",
        "greatest speed of a joint, at [motion] speed in any direction",
        lambda d, poses: d.speeds(poses).max(axis=-1),
        cover="directions",
    ),
    "force": _sample_cover(
        "N or N m",
        "greatest force of a drive, at [motion] speed and acceleration in any directions",
        lambda d, poses: d.forces(poses).max(axis=-1),
        cover="directions",
    ),
    "drive_load": _sample_cover(
        "",
        "greatest of these forces and speeds over what the file says a drive can do",
        _drive_load,
        cover="directions",
    ),
    "stiffness": _sample_cover(
        "N/m",
        "least stiffness at the tool, in its worst direction",
        _stiffness,
        least=True,
        cover="directions",
    ),
    "deflection": _sample_cover(
        "m",
        "most that the tool gives way under [elasticity] force",
        lambda d, poses: d.task.spec.elasticity.force / _stiffness(d, poses),
        cover="directions",
    ),
    "accuracy": _sample_cover(
        "m", "most that the tool may be off by all [errors] together", _accuracy, cover="bound"
    ),
    "cycle_time": DesignQuantity(
        "s",
        "shortest time of all cycles, each evenly faster or slower, by the drives of the file",
        _cycle_time,
        cover="cycles",
    ),
    "cycle_force": DesignQuantity(
        "N or N m",
        "greatest force of a drive over the cycles, one after the other with their rests",
        lambda d: d.cycle_loads.peak_forces.max(),
        cover="cycles",
    ),
    "cycle_speed": DesignQuantity(
        "m/s or rad/s",
        "greatest speed of a joint over the cycles",
        lambda d: d.cycle_loads.peak_speeds.max(),
        cover="cycles",
    ),
    "cycle_energy": DesignQuantity(
        "J",
        "energy that the drives give while they drive, all cycles once",
        lambda d: d.cycle_loads.given_energy.sum(),
        cover="cycles",
    ),
    "motor_margin": DesignQuantity(
        "",
        "least over joints of what the best motor of the list can do over what the cycles ask",
        lambda d: min(fit.margin for fit in best_motors(d.cycle_loads, d.task.motors)),
        cover="cycles",
    ),
}


@lru_cache(maxsize=1)
def quantities() -> dict[str, DesignQuantity]:
    """Return all design quantities by name: built-in, worst values of indices, and extensions'.

    Packages register quantities as entry points of the group `pteron.design`: a function of the
    machine or a `DesignQuantity`.
    """
    known = _BUILT_IN | {name: _worst(index) for name, index in INDICES.items()}
    for name in extension_names(GROUP):
        known.setdefault(name, quantity_of(load_extension(GROUP, name), name))
    return known


def _worst(index: Index) -> DesignQuantity:
    """Return the design quantity that is an index's worst value over the workspace."""
    word = "least" if index.better == "more" else "greatest"
    return _sample_cover(
        index.unit,
        f"{word} {index.title} in the workspace",
        lambda design, poses: design.values(index.name, poses),
        least=index.better == "more",
    )


def expect_quantity(name: str) -> str:
    """Return `name`; raise ValueError if no design quantity is called so."""
    names = quantities()
    if name in names:
        return name
    close = get_close_matches(name, names, n=1)
    guess = f'; did you mean "{close[0]}"?' if close else ""
    raise ValueError(f"{shorten(name)} is no quantity: {', '.join(names)}{guess}")
