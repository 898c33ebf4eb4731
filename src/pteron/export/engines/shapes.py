"""Shapes that show a machine in engines' files, at its home pose: bars, boxes, guides and axles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pteron.export.engines.parts import BASE, BodyShape, Tree, TreeBody
from pteron.kernels import Array
from pteron.tolerances import SAME

_THICK = 0.011
"""Radius of a link, as a share of the machine's size; other shapes are in proportion."""

_APART = 0.018
"""Half the drawn distance of parallel rods, as a share of the machine's size."""

_SPARE = 0.25
"""Length of a guide without limits, each way, as a share of the machine's size."""

_OVERLAP = 0.55
"""Length of each of the two parts of a telescopic body, as a share of the whole."""


def add_shapes(opened: Tree) -> Tree:
    """Return the tree with a shape for each body, and for guides and axles on the base."""
    thick = _THICK * opened.size
    looks: list[list[BodyShape]] = [[] for _ in opened.bodies]
    base: list[tuple[int, BodyShape]] = []
    for i, (leg, closing) in enumerate(zip(opened.robot.legs, opened.closings, strict=False)):
        chain = [k for k, body in enumerate(opened.bodies) if body.color == i + 1]
        bodies = [opened.bodies[k] for k in chain]
        for k, shapes in zip(chain, _leg(bodies, closing.point, leg.bar, opened.size), strict=True):
            looks[k] += shapes
        base += [(i + 1, shape) for shape in _stand(bodies[0], opened.size)]
    _platform(opened, looks, thick)
    pairs = zip(opened.bodies, looks, strict=True)
    shown = tuple(replace(body, shapes=tuple(shapes)) for body, shapes in pairs)
    return replace(opened, bodies=shown, base=tuple(base))


def _leg(
    bodies: Sequence[TreeBody], end: Array, bar: Sequence[float] | None, size: float
) -> list[list[BodyShape]]:
    """Return the shapes of a leg's bodies; the last one is doubled where rods are parallel."""
    thick, shapes = _THICK * size, []
    origins = [*(body.origin for body in bodies), end]
    for k, body in enumerate(bodies):
        start, stop, radius = origins[k], origins[k + 1], thick
        is_prismatic = body.joints[-1].is_prismatic
        if is_prismatic and k == 0:
            axis = 2.6 * thick * body.joints[-1].axis
            shapes.append([BodyShape("box", np.array([start - axis, start + axis]), 1.9 * thick)])
            continue
        if np.linalg.norm(stop - start) < SAME:  # the next one slides in this one
            stop, radius = start + _OVERLAP * (end - start), 1.4 * thick
        elif is_prismatic:
            start = stop - _OVERLAP * (stop - start)
        ends = np.array([start, stop])
        if bar is None or k < len(bodies) - 1:
            shapes.append([BodyShape("capsule", ends, radius)])
            continue
        side = _APART * size * np.array(bar)
        pair = [BodyShape("capsule", ends + sign * side, 0.6 * thick) for sign in (1.0, -1.0)]
        bars = [BodyShape("capsule", np.array([p - side, p + side]), 0.6 * thick) for p in ends]
        shapes.append(pair + bars)
    return shapes


def _stand(first: TreeBody, size: float) -> list[BodyShape]:
    """Return the fixed part of a leg's first joint: a guide, or an axle."""
    joint, thick = first.joints[0], _THICK * size
    if joint.is_prismatic:
        low, high = joint.limits or (joint.home - _SPARE * size, joint.home + _SPARE * size)
        reach = np.array([[low - joint.home - 3.0 * thick], [high - joint.home + 3.0 * thick]])
        return [BodyShape("cylinder", joint.point + reach * joint.axis, 0.8 * thick)]
    half = 2.6 * thick * joint.axis
    return [BodyShape("cylinder", np.array([joint.point - half, joint.point + half]), 1.8 * thick)]


def _platform(opened: Tree, looks: list[list[BodyShape]], thick: float) -> None:
    """Add the shapes of the platform's bodies: arms from their origins to where others close."""
    platform, bodies = opened.robot.platform, opened.bodies
    p, axes = platform.placement(opened.home)
    axis = axes[2]
    for closing in opened.closings:
        for k in (closing.one, closing.other):
            if bodies[k].color == 0:
                looks[k].append(_arm(bodies[k].origin, closing.point, thick))
    hub = np.array([p - 0.8 * thick * axis, p + 0.8 * thick * axis])
    looks[opened.platform].append(BodyShape("cylinder", hub, 2.2 * thick))
    tool = p + np.array(platform.tool) @ axes
    if np.linalg.norm(tool - p) > SAME:
        looks[opened.platform].append(_arm(p, tool, 0.8 * thick))
    for k, body in enumerate(bodies):
        turns = body.parent != BASE and not body.joints[0].is_prismatic
        if body.color == 0 and turns and k != opened.platform:
            # What turns about P: a block, so that it is seen to turn.
            half = 2.4 * thick * body.axes[:, 0]
            middle = body.origin - 2.2 * thick * axis
            looks[k].append(BodyShape("box", np.array([middle - half, middle + half]), thick))
        elif body.color == 0 and not looks[k]:
            looks[k].append(_arm(p, body.origin, thick))


def _arm(start: Array, stop: Array, radius: float) -> BodyShape:
    """Return a capsule between two points (3,), of a radius in m."""
    return BodyShape("capsule", np.array([start, stop]), radius)
