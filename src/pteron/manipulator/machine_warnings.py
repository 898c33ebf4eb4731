"""Warnings about a machine: possible but unlikely values, most often a wrong unit or sign."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import hypot, pi, sqrt
from typing import Any

import numpy as np

from pteron.bodies.inertia import PlanarInertia, SpatialInertia
from pteron.bodies.vectors import Vector, cross
from pteron.legs import LegKind
from pteron.legs.drive_warnings import drive_warnings
from pteron.manipulator.manipulator import Manipulator, legs_text, unheld_axes
from pteron.platforms import Platform
from pteron.thresholds import STOUT_LINK
from pteron.tolerances import SAME

_LARGE = 10.0
"""Length, m, beyond which millimetres are likelier."""

_UNLIKE = 20.0
"""Greatest ratio of a link's central inertia to a uniform bar's, or the inverse: two masses at its
ends have 3."""

_DENSE = 300.0
"""Mass of a link over its length, kg/m, beyond which grams are likelier: steel 0.2 m thick."""

_STEEL = 7850.0
"""Density, kg/m^3."""

_HEAVY = 100.0
"""Mass of a platform over that of its legs, beyond which grams are likelier."""

_LEGS = 3
"""Least number of legs of which one can be an outlier."""

_PULL = 30.0
"""Gravity, m/s^2, beyond which another unit is likelier."""


def machine_warnings(robot: Manipulator, *, bodies: bool = True) -> tuple[str, ...]:
    """Return warnings about unlikely values in a machine, one line each.

    Each begins with the place: ``leg 2: lower: center_of_mass: ...``. Masses and inertias are
    checked if `bodies` is set.

    Examples
    --------
    >>> import pteron
    >>> from pteron.manipulator.machine_warnings import machine_warnings
    >>> machine_warnings(pteron.load("quadrupteron"))
    ()
    """
    platform, long_lengths = robot.platform, _long_lengths(robot)
    warnings = _millimetre_warnings(long_lengths)
    if hypot(*robot.gravity) > _PULL:
        warnings.append(f"gravity: {hypot(*robot.gravity):g} m/s^2: is that mm/s^2?")
    most = 2.0 * platform.angle_range
    turn = "a turn" if most > pi else "half a turn"
    warnings += [
        f"platform: limits: {list(limits)} rad, more than {turn} from {angle} = 0: are these "
        "degrees?"
        for angle, limits in platform.angle_limits.items()
        if max(map(abs, limits)) > most
    ]
    radius = max(hypot(*leg.platform_point) for leg in robot.legs)
    points = any("platform_point" in keys for keys in long_lengths.values())
    # Consequences of lengths in millimetres are not listed beside them.
    if bodies and radius > 0.0 and not points and 0 not in long_lengths:
        warnings += [f"platform: {text}" for text in _size_warnings(platform, radius)]
    if bodies:
        warnings += [f"platform: {text}" for text in _mass_warnings(platform, robot.legs)]
    axis = platform.rotation_axes[0] if len(platform.rotation_axes) == 1 else None
    legs_by_text: dict[str, list[int]] = {}
    for i, leg in enumerate(robot.legs, start=1):
        leg_warnings = () if i in long_lengths else _leg_warnings(leg, platform, bodies)
        for text in (*leg_warnings, *leg.unlikely_values(axis), *drive_warnings(leg)):
            legs_by_text.setdefault(text, []).append(i)
    warnings += [f"{legs_text(legs)}: {text}" for text, legs in legs_by_text.items()]
    if axis is not None:
        warnings += _turning_offsets(robot.legs, axis, platform.angles[0])
    warnings += _odd_directions(robot)
    warnings += _beside_the_pin(robot)
    return tuple(warnings)


def _beside_the_pin(robot: Manipulator) -> Iterator[str]:
    """Yield warnings about tool or mass beside the pin at which both legs of a five-bar meet."""
    platform = robot.platform
    if platform.plane_normal is None:
        return
    axes = unheld_axes(platform, robot.legs)
    if len(axes) != 1:
        return
    to_base = np.array(platform.frame).T
    pin = to_base @ robot.legs[0].platform_point + robot.legs[0].fixed_offset
    places = {"tool": platform.tool, "center_of_mass": platform.inertia.center_of_mass}
    places |= {f"point of tools item {i}": t.point for i, t in enumerate(robot.tools, start=1)}
    for key, place in places.items():
        # A planar body's centre of mass has two coordinates.
        point = to_base @ np.array([*place, 0.0][:3])
        beside = hypot(*np.cross(axes[0], point - pin))
        if beside > SAME:
            yield (
                f"platform: {key}: {1e3 * beside:.4g} mm beside the pin where the links meet, but "
                "no leg keeps the platform from turning about that pin; on an extended link it "
                "turns with the link, which this model does not: put it on the pin (0)"
            )


def _odd_directions(robot: Manipulator) -> Iterator[str]:
    """Yield warnings about legs with a direction opposite to all others', seen from the axis."""
    points = np.array([leg.guide_point for leg in robot.legs])
    axis = np.array(robot.platform.axis)
    out = (points - points.mean(axis=0)) @ (np.eye(3) - np.outer(axis, axis))
    radii = np.linalg.norm(out, axis=1, keepdims=True)
    if len(out) < _LEGS or radii.min() < SAME:
        return
    out /= radii
    frames = np.stack([out, np.cross(axis, out), np.broadcast_to(axis, out.shape)], axis=1)
    directions_by_leg = [
        {q.name: q.value for q in leg.quantities if q.role in ("direction", "normal")}
        for leg in robot.legs
    ]
    for name in sorted(set(robot.legs[0].every_key()).intersection(*directions_by_leg)):
        local_directions = np.einsum(
            "ijk,ik->ij", frames, [directions[name] for directions in directions_by_leg]
        )
        opposite = (np.abs(local_directions[:, None] + local_directions).max(axis=-1) < SAME).sum(
            axis=1
        )
        for i in np.flatnonzero(opposite == len(out) - 1) + 1:
            yield f"leg {i}: {name}: opposite to all other legs', seen from the axis: is it meant?"


def _mass_warnings(platform: Platform, legs: Sequence[LegKind]) -> Iterator[str]:
    """Yield a warning about a platform that is far heavier than all of its legs."""
    mass = platform.inertia.mass
    bodies: list[Any] = [body for leg in legs for body in leg.bodies.values()]
    carried = sum(getattr(body, "mass", 0.0) for body in bodies)
    if carried > 0.0 and mass > _HEAVY * carried:
        yield (
            f"mass: {mass:g} kg, {mass / carried:.3g} times that of all legs: is it in grams? kg "
            "are expected"
        )


def _long_lengths(robot: Manipulator) -> dict[int, dict[str, Sequence[float]]]:
    """Return lengths beyond `_LARGE` m by leg number (0 for the platform) and key."""
    platform = robot.platform
    lengths: dict[int, dict[str, Sequence[float]]] = {
        0: {
            "tool": platform.tool,
            "center_of_mass": platform.inertia.center_of_mass,
            **{f"point of tools item {i}": t.point for i, t in enumerate(robot.tools, start=1)},
            **{f"hinge of bars item {i}": b.hinge for i, b in enumerate(platform.bars, start=1)},
        }
    }
    for i, leg in enumerate(robot.legs, start=1):
        bodies: Any = {key: leg.bodies[at.body] for key, at in leg.every_key().items() if at.body}
        centers = {
            f"{key}.center_of_mass": body.center_of_mass
            for key, body in bodies.items()
            if hasattr(body, "center_of_mass")
        }
        lengths[i] = {**leg.metres, **centers}
    far = {
        i: {key: v for key, v in leg_lengths.items() if max(map(abs, v)) > _LARGE}
        for i, leg_lengths in lengths.items()
    }
    return {i: leg_lengths for i, leg_lengths in far.items() if leg_lengths}


def _millimetre_warnings(far: Mapping[int, Mapping[str, Sequence[float]]]) -> list[str]:
    """Return, in a list or [], a warning that lengths of these legs and keys are likely in mm."""
    if not far:
        return []
    legs_by_keys: dict[tuple[str, ...], list[int]] = {}
    for i, leg_lengths in far.items():
        legs_by_keys.setdefault(tuple(leg_lengths), []).append(i)
    where = "; ".join(
        f"{legs_text(legs) if legs[0] else 'platform'}: {', '.join(keys)}"
        for keys, legs in legs_by_keys.items()
    )
    first, *others = (length for leg_lengths in far.values() for length in leg_lengths.values())
    size = f"{first[0]:g}" if len(first) == 1 else f"{list(first)}"
    return [f"{where}: {f'beyond {_LARGE:g}' if others else size} m: are these mm?"]


def _leg_warnings(leg: LegKind, platform: Platform, bodies: bool) -> Iterator[str]:
    """Yield warnings about unlikely values of a leg, one line each."""
    far = hypot(*leg.platform_point)
    # A platform that tilts may have a pivot far away for its P.
    if 0.0 < leg.size < far and not platform.tilts:
        yield (
            f"platform_point: {far:g} m from P, farther than the leg is long: is it in the "
            "platform's frame?"
        )
    if leg.limits is not None and leg.joint.unit == "rad" and max(map(abs, leg.limits)) > 2.0 * pi:
        yield f"limits: {list(leg.limits)} rad: are these degrees?"
    for letter, (key, low, high, _) in leg.extents.items() if bodies else ():
        body: Any = leg.bodies[letter]
        if text := leg.center_of_mass_warning(letter, body.center_of_mass[0]):
            yield f"{key}: center_of_mass: {text}"
        length = high - low
        thick = sqrt(4.0 * body.mass / (pi * _STEEL * length))
        if body.mass > _DENSE * length:
            yield f"{key}: mass: {body.mass:g} kg on {length:g} m: is it in grams?"
        elif thick > STOUT_LINK * length and body.mass > platform.total_inertia.mass:
            yield (
                f"{key}: mass: {body.mass:g} kg on {length:g} m, more than the platform's "
                f"{platform.total_inertia.mass:g} kg: solid steel {1e3 * thick:.0f} mm thick: is "
                "it this machine's?"
            )
        yield from (f"{key}: {text}" for text in _inertia_warnings(body, high - low))


def _turning_offsets(legs: Sequence[LegKind], axis: Vector, angle: str) -> Iterator[str]:
    """Yield warnings about fixed offsets that no leg at the same hinge keeps from rotating."""
    keeps: dict[Vector, bool] = {}
    for leg in legs:
        free = np.array(leg.free_axes(None)).reshape(-1, 3)
        is_constrained = np.linalg.matrix_rank(np.vstack([free, axis])) > np.linalg.matrix_rank(
            free
        )
        keeps[leg.platform_point] = keeps.get(leg.platform_point, False) or bool(is_constrained)
    for i, leg in enumerate(legs, start=1):
        if hypot(*cross(leg.fixed_offset, axis)) > 0.0 and not keeps[leg.platform_point]:
            yield (
                f"leg {i}: fixed_offset: does not turn with {angle}, but no leg at this "
                "platform_point keeps it from turning"
            )


def _inertia_warnings(body: Any, length: float) -> Iterator[str]:
    """Yield warnings about a link's inertia that is far from that of a bar of its length."""
    beside = hypot(*body.center_of_mass[1:])
    if beside > length:
        yield f"center_of_mass: {beside:g} m beside it: are these mm?"
        return
    # About z, across the link.
    inertia = body.tensor[2, 2] if isinstance(body, SpatialInertia) else body.inertia
    central = inertia - body.mass * sum(x * x for x in body.center_of_mass[:2])
    # One by one: a product of small numbers may vanish.
    share = 12.0 * central / length / length / body.mass
    if not 1.0 / _UNLIKE <= share <= _UNLIKE:
        yield (
            f"inertia: {inertia:g} kg m^2 leaves {central:.3g} about the centre of mass, "
            f"{share:.2g} times that of a uniform bar: is it about the origin, in kg m^2?"
        )


def _size_warnings(platform: Platform, radius: float) -> Iterator[str]:
    """Yield warnings about platform masses or inertias too large for its radius, m."""
    body, size = platform.inertia, 3.0 * radius
    off = hypot(*body.center_of_mass)
    if off > size:
        yield f"center_of_mass: {off:g} m away: are these mm?"
    inertia = body.inertia if isinstance(body, PlanarInertia) else max(np.diag(body.tensor))
    if sqrt(inertia / body.mass) > 3.0 * size:
        yield (
            f"inertia: {inertia:g} kg m^2 with {body.mass:g} kg is mass "
            f"{sqrt(inertia / body.mass):g} m away: is it in kg m^2?"
        )
    for i, bar in enumerate(platform.bars, start=1):
        off = hypot(*bar.hinge)
        if off > size:
            yield (
                f"hinge of bars item {i}: {off:g} m from P, while the legs' points are within "
                f"{radius:g} m: is it in m, in the platform's frame?"
            )
    for i, part in enumerate(platform.geared, start=1):
        joined = part.ratio**2 * part.inertia
        away = sqrt(joined / platform.total_inertia.mass)
        if away > 3.0 * size:
            yield (
                f"geared item {i}: {part.ratio:g}^2 times {part.inertia:g} kg m^2 is the "
                f"platform's mass {away:g} m away: is it in kg m^2?"
            )
