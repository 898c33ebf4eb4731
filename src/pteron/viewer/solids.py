"""The machine in one pose as bars, balls, blocks and plane faces, and arrows, for the viewer.

A bar is a cylinder from one point to another; all bars of a machine are copies of one mesh, and so
are all balls and all blocks, so that a browser draws each kind at once.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pteron.kernels import Array
from pteron.motion import Guide, JointPoints
from pteron.plots.canvas import INK, LEG_COLORS, MUTED, PAPER, REACH
from pteron.plots.machine_drawing import base_outline, rods
from pteron.plots.space_axes import upright
from pteron.viewer.meshes import Mesh, fan

_LINK, _ROD, _ARM, _GUIDE, _AXIS = 0.011, 0.006, 0.007, 0.008, 0.003
_JOINT, _CYLINDER = 0.016, 0.014
"""Radii as shares of the machine's size."""

_AXLE = 0.03
"""Half the length of a crank's axle, as such a share."""

_FRAME = 0.13
"""Length of a frame's axes, as such a share."""

_BLOCK = np.array([0.04, 0.04, 0.072])
"""Sides of a slider's block, as such shares, the one along its guide last."""


_Bar = tuple[Array, Array, float, str]
"""Ends, m, radius and colour."""

_Ball = tuple[Array, float, str]
"""Middle, m, radius and colour."""

_Block = tuple[Array, Array, str]
"""Middle, m, direction of the guide, and colour."""


def rgb(color: str) -> tuple[int, int, int]:
    """Return a colour such as "#0072b2" as three numbers from 0 to 255."""
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)


@dataclass(frozen=True, eq=False)
class Copies:
    """Copies of one mesh: where each is, how it is turned and stretched, and its colour.

    Attributes
    ----------
    positions : array, shape (K, 3)
        m.
    turns : array, shape (K, 4)
        Unit quaternions, w x y z.
    scales : array, shape (K, 3)
        Along the mesh's own x, y and z, m.
    colors : array of int, shape (K, 3)
    """

    positions: Array
    turns: Array
    scales: Array
    colors: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Solids:
    """The bodies of a machine; faces are of the platform's parts, or of the base."""

    bars: Copies
    balls: Copies
    blocks: Copies
    faces: tuple[Mesh, ...]


def machine_size(points: JointPoints, guides: Sequence[Guide]) -> float:
    """Return the greatest extent of a machine, guides included, m."""
    everything = np.vstack([*points.links, *(guide.path for guide in guides)])
    return float(np.ptp(everything, axis=0).max())


def moving_solids(points: JointPoints, guides: Sequence[Guide], size: float) -> Solids:
    """Return the moving bodies, the legs and the platform, of points in one pose."""
    bars, balls, blocks = list[_Bar](), list[_Ball](), list[_Block]()
    for i, (line, guide) in enumerate(zip(points.links, guides, strict=True)):
        color = LEG_COLORS[i]
        for start, end in pairwise(line[:-1]):
            bars.append((start, end, (_CYLINDER if points.rams[i] else _LINK) * size, color))
        single = points.bars[i] is None
        for start, end in rods(line, points.bars[i], size):
            thick = _LINK if single and not points.rams[i] else _ROD
            bars.append((start, end, thick * size, color))
        for joint in line[::2] if points.rams[i] else line:
            balls.append((joint, _JOINT * size, color))
        if guide.slides:
            blocks.append((line[0], guide.axis, color))
    for part in points.parts:
        for corner in part.corners:
            bars.append((part.hub, corner, _ARM * size, REACH))
        balls.append((part.hub, _JOINT * size, REACH))
    for axis in points.axes:
        bars.append((points.reference, points.reference + _FRAME * size * axis, _AXIS * size, INK))
    bars.append((points.reference, points.tool, _ROD * size, REACH))
    balls.append((points.tool, 0.8 * _JOINT * size, INK))
    balls.append((points.reference, 0.8 * _JOINT * size, PAPER))
    parts = [(part.corners, part.triangles) for part in points.parts if len(part.corners) > 2]
    faces = tuple(fan(corners) if solid is None else (corners, solid) for corners, solid in parts)
    return Solids(_bars(bars), _balls(balls), _blocks(blocks, size), faces)


def still_solids(
    points: JointPoints, guides: Sequence[Guide], size: float, corner: Array
) -> Solids:
    """Return the still bodies: guides, the cranks' axles and circles, the base and its frame."""
    bars, balls = list[_Bar](), list[_Ball]()
    for line, guide in zip(points.links, guides, strict=True):
        thick = _GUIDE if guide.slides else _AXIS
        for start, end in pairwise(guide.path):
            bars.append((start, end, thick * size, MUTED))
        if guide.slides:
            for end in guide.path[[0, -1]]:
                balls.append((end, 1.3 * _GUIDE * size, MUTED))
        else:
            axle = _AXLE * size * guide.axis
            bars.append((line[0] - axle, line[0] + axle, _JOINT * size, MUTED))
    base = base_outline(points, guides)
    for start, end in zip(base, np.roll(base, -1, axis=0), strict=True):
        bars.append((start, end, _ARM * size, MUTED))
    for axis in np.eye(3):
        bars.append((corner, corner + _FRAME * size * axis, _AXIS * size, INK))
    return Solids(
        _bars(bars), _balls(balls), _blocks([], size), (fan(base),) if len(base) > 2 else ()
    )


def arrows(
    starts: Array, ways: Array, radii: Sequence[float], colors: Sequence[str]
) -> tuple[Copies, Copies]:
    """Return the shafts and the heads of arrows from points (K, 3) along ways (K, 3), m.

    A way that is NaN or has no length is no arrow.
    """
    ways, starts = np.nan_to_num(ways), np.nan_to_num(starts)
    lengths = np.linalg.norm(ways, axis=-1)
    heads = np.minimum(6.0 * np.array(radii), 0.6 * lengths)
    units = np.divide(ways, lengths[:, None], out=np.zeros_like(ways), where=lengths[:, None] > 0.0)
    necks = starts + (lengths - heads)[:, None] * units
    tips = starts + ways
    shafts, cones = list[_Bar](), list[_Bar]()
    for i, (radius, color) in enumerate(zip(radii, colors, strict=True)):
        shafts.append((starts[i], necks[i], radius, color))
        cones.append((necks[i], tips[i], 2.6 * radius, color))
    return _bars(shafts), _bars(cones)


def _bars(found: Sequence[_Bar]) -> Copies:
    """Return bars as copies of a cylinder of radius and length 1 about its middle, along z."""
    starts, ends, radii, colors = _columns(found, 4)
    ways = ends.reshape(-1, 3) - starts.reshape(-1, 3)
    lengths = np.linalg.norm(ways, axis=-1)
    # One of no length is not seen.
    radii = np.where(lengths > 0.0, radii, 0.0)
    scales = np.stack([radii, radii, lengths], axis=-1)
    return Copies(starts.reshape(-1, 3) + ways / 2.0, from_z(ways), scales, _colors(colors))


def _balls(found: Sequence[_Ball]) -> Copies:
    """Return balls as copies of one of radius 1."""
    centers, radii, colors = _columns(found, 3)
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(found), 1))
    scales = np.repeat(radii[:, None], 3, axis=1)
    return Copies(centers.reshape(-1, 3), turns, scales, _colors(colors))


def _blocks(found: Sequence[_Block], size: float) -> Copies:
    """Return blocks as copies of a cube of side 1."""
    centers = np.array([center for center, _, _ in found]).reshape(-1, 3)
    turns = np.array([_turn_to(tuple(axis.tolist())) for _, axis, _ in found]).reshape(-1, 4)
    scales = np.tile(size * _BLOCK, (len(found), 1))
    return Copies(centers, turns, scales, _colors([color for _, _, color in found]))


def _columns(found: Sequence[tuple[Any, ...]], count: int) -> list[Any]:
    """Return the columns of rows as arrays; so many empty ones where there are no rows."""
    return [np.array(column) for column in zip(*found, strict=True)] or [np.empty(0)] * count


def _colors(found: Iterable[str]) -> NDArray[np.uint8]:
    return np.array([rgb(color) for color in found], dtype=np.uint8).reshape(-1, 3)


def from_z(ways: Array) -> Array:
    """Return unit quaternions (K, 4) that turn z along ways (K, 3); none where a way has no length.

    Examples
    --------
    >>> import numpy as np
    >>> from_z(np.array([[0.0, 0.0, 2.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])).round(3) + 0.0
    array([[1.   , 0.   , 0.   , 0.   ],
           [0.   , 1.   , 0.   , 0.   ],
           [0.707, 0.   , 0.707, 0.   ]])
    """
    lengths = np.linalg.norm(ways, axis=-1, keepdims=True)
    z = np.divide(ways, lengths, out=np.zeros_like(ways), where=lengths > 0.0)
    # Half way between z and the direction; opposite ones are turned about x.
    whole = np.stack([1.0 + z[:, 2], -z[:, 1], z[:, 0], np.zeros(len(z))], axis=-1)
    whole[(whole[:, 0] < 1e-9) & (lengths[:, 0] > 0.0)] = [0.0, 1.0, 0.0, 0.0]
    return np.asarray(whole / np.linalg.norm(whole, axis=-1, keepdims=True))


def quaternion(rotation: Array) -> Array:
    """Return the unit quaternion (4,), w x y z, of a rotation matrix (3, 3)."""
    # SciPy is slow to load, and here the only thing of it that would be.
    from scipy.spatial.transform import Rotation  # type: ignore[import-untyped]

    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    return np.array([w, x, y, z])


def axes_of(wxyz: Array) -> Array:
    """Return the axes (3, 3), one a row, of a frame that is turned by a unit quaternion (4,)."""
    from scipy.spatial.transform import Rotation

    w, x, y, z = wxyz
    return np.asarray(Rotation.from_quat([x, y, z, w]).as_matrix().T)


@lru_cache(maxsize=256)
def _turn_to(axis: tuple[float, ...]) -> Array:
    """Return the quaternion of a block whose guide is along an axis."""
    return quaternion(upright(np.array(axis)).T)
