"""Warnings of legs that look swapped, that cross, or that differ from all others.

Guide points and platform points of most machines have a symmetry about the platform's axis. Where
another pairing of the same points has more of it than the file's, legs are likely exchanged.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, permutations

import numpy as np

from pteron.kernels import Array, numeric
from pteron.manipulator import Manipulator
from pteron.manipulator.manipulator import legs_text
from pteron.thresholds import CROSSING, ENDS, SAME_PLACE

_FEWEST = 3
"""Legs of a machine with a symmetry about an axis."""

_STRAYING = 2
"""Legs that a turn leads nowhere where one is out of place: that leg, and the one led to it."""

_ALL = 4
"""Most legs of which every pairing is tried, 24; of more each exchange of two, 15 for six legs."""


def layout_warnings(robot: Manipulator, home: Array) -> tuple[str, ...]:
    """Return warnings of legs that look swapped, cross at home (m,), or differ from all others."""
    return (
        *_swap_warnings(robot),
        *_crossing_warnings(robot, home),
        *_place_warnings(robot),
        *_length_warnings(robot),
    )


def _swap_warnings(robot: Manipulator) -> Iterator[str]:
    """Yield a pairing of guide and platform points with more symmetry than the file's."""
    count = len(robot.legs)
    if count < _FEWEST:
        return
    base, top = _figures(robot)
    identity = tuple(range(count))
    # Where the platform turns, points that are all shifted by one are a turn of the platform.
    reflections = not robot.platform.angles
    as_filed = _symmetries(base, top, identity, reflections=reflections)
    rated = [(_symmetries(base, top, p, reflections=reflections), p) for p in _pairings(count)]
    best, order = max(rated, key=lambda pair: pair[0])
    if best <= as_filed or best < _FEWEST:
        return
    moved = [i + 1 for i in identity if order[i] != i]
    yield (
        f"{legs_text(moved)}: look swapped: with their platform_points exchanged {best} turns"
        f"{' and reflections' if reflections else ''} about the axis leave the machine as it is, "
        f"now {as_filed}: is each joined to the right place on the platform?"
    )


def _pairings(count: int) -> Iterator[tuple[int, ...]]:
    """Yield pairings of guide points with platform points: all, or swaps if legs are many."""
    if count <= _ALL:
        yield from permutations(range(count))
        return
    for i, j in combinations(range(count), 2):
        order = list(range(count))
        order[i], order[j] = j, i
        yield tuple(order)


def _figures(robot: Manipulator, *, middles: bool = True) -> tuple[Array, Array]:
    """Return guide and platform points (n, 3) in the platform's frame, relative to its axis.

    Both count from the axis through their middles, or through the origins of both frames, over the
    greatest radius of each.
    """
    frame = np.array(robot.platform.frame)
    base = np.array([leg.guide_point for leg in robot.legs]) @ frame.T
    offsets = np.array([leg.fixed_offset for leg in robot.legs]) @ frame.T
    top = np.array([leg.platform_point for leg in robot.legs]) + offsets
    figures = [figure - middles * figure.mean(axis=0) for figure in (base, top)]
    sizes = [float(np.linalg.norm(figure[:, :2], axis=1).max()) or 1.0 for figure in figures]
    return figures[0] / sizes[0], figures[1] / sizes[1]


def _symmetries(base: Array, top: Array, order: Sequence[int], *, reflections: bool) -> int:
    """Return the number of turns, and reflections, that map each leg onto a leg."""
    legs = np.hstack([base, top[list(order)]])
    images = [_images(legs, turn) for turn in _turns(len(legs))]
    if reflections:
        angles = np.arctan2(base[:, 1], base[:, 0])
        images += [_images(legs, _mirror(a + b)) for a in angles for b in angles]
    return len({image for image in images if None not in image})


def _turns(count: int) -> list[Array]:
    """Return the rotation matrices (2, 2) of the multiples of a turn over `count`."""
    angles = 2.0 * np.pi * np.arange(count) / count
    return [np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in angles]


def _mirror(angle: float) -> Array:
    """Return the reflection of a plane in the line at half an angle."""
    return np.array([[np.cos(angle), np.sin(angle)], [np.sin(angle), -np.cos(angle)]])


def _images(legs: Array, plane: Array) -> tuple[int | None, ...]:
    """Return the leg onto which a map of the plane takes each leg (n, 6), or None."""
    image = legs.copy()
    for k in (0, 3):
        image[:, k : k + 2] = legs[:, k : k + 2] @ plane.T
    same = np.abs(image[:, None] - legs).max(axis=-1) <= SAME_PLACE
    return tuple(int(row.argmax()) if row.any() else None for row in same)


def _place_warnings(robot: Manipulator) -> Iterator[str]:
    """Yield a warning of the single leg that a symmetry of all other legs does not map."""
    count = len(robot.legs)
    if count <= _ALL:
        return  # of few legs, two or three in equal places are common
    legs = np.hstack(_figures(robot, middles=False))
    for fold in {count, count // 2} - {2}:
        turn = _turns(fold)[1]
        astray = [
            {i for i, image in enumerate(_images(legs, plane)) if image is None}
            for plane in (turn, turn.T)
        ]
        odd = astray[0] & astray[1]
        if max(map(len, astray)) == _STRAYING and len(odd) == 1:
            yield (
                f"leg {odd.pop() + 1}: guide_point or platform_point: out of place: turns by "
                f"{360 // fold} degrees about the axis lead each other leg to the place of a leg, "
                "but not this one: is it meant?"
            )


def _crossing_warnings(robot: Manipulator, home: Array) -> Iterator[str]:
    """Yield pairs of legs whose links cross at home, of spatial machines."""
    if robot.platform.plane_normal is not None:
        return
    links = [_segments(points) for points in numeric(robot, "joint_points")(home)[0]]
    for (i, first), (j, second) in combinations(enumerate(links, start=1), 2):
        distances = [_distance(*a, *b) for a in first for b in second]
        gap = min(distances, default=np.inf)
        if np.isfinite(gap):
            yield (
                f"legs {i} and {j}: their links cross at home, {1e3 * gap:.2f} mm apart: are "
                "they joined to the right places?"
            )


def _segments(points: Array) -> list[tuple[Array, Array]]:
    """Return a leg's links as pairs of points (3,), without very short links and NaN points."""
    points = points[np.isfinite(points).all(axis=-1)]
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    least = CROSSING * lengths.max(initial=0.0)
    return [(points[k], points[k + 1]) for k in np.flatnonzero(lengths > least)]


def _distance(start: Array, end: Array, other: Array, other_end: Array) -> float:
    """Return the distance, m, of two links that cross between their ends; else infinity."""
    way, other_way, offset = end - start, other_end - other, other - start
    system = np.array([[way @ way, -way @ other_way], [way @ other_way, -other_way @ other_way]])
    if abs(np.linalg.det(system)) < CROSSING**2 * (way @ way) * (other_way @ other_way):
        return np.inf  # parallel
    share, place = np.linalg.solve(system, [way @ offset, other_way @ offset])
    if not (ENDS < share < 1.0 - ENDS and ENDS < place < 1.0 - ENDS):
        return np.inf
    gap = float(np.linalg.norm(start + share * way - other - place * other_way))
    shorter = min(np.linalg.norm(way), np.linalg.norm(other_way))
    return gap if gap <= CROSSING * shorter else np.inf


def _length_warnings(robot: Manipulator) -> Iterator[str]:
    """Yield lengths of a leg that differ from those of all other legs, which are equal."""
    count = len(robot.legs)
    figures = _figures(robot)
    if count < _FEWEST or _symmetries(*figures, range(count), reflections=True) < _FEWEST:
        return  # no machine of equal legs
    each = [
        {q.name: float(q.value[0]) for q in leg.quantities if q.role == "length"}
        for leg in robot.legs
    ]
    for name in sorted(set(each[0]).intersection(*each[1:])):
        lengths = np.array([leg_lengths[name] for leg_lengths in each])
        middle = float(np.median(lengths))
        differ = np.abs(lengths - middle) > SAME_PLACE * abs(middle)
        if differ.sum() == 1:
            i = int(differ.argmax())
            yield (
                f"leg {i + 1}: {name}: {lengths[i]:g} m, while all other legs have {middle:g} m: "
                "is it meant?"
            )
