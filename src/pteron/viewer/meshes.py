"""The meshes that the viewer draws with: cylinder, ball, cube, plane faces and cells of a grid."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from pteron.kernels import Array

Mesh = tuple[Array, NDArray[np.int64]]
"""Vertices (V, 3), and faces (F, 3), the numbers of their vertices."""

_SIDES = 12
"""Sides of a cylinder, and meridians of a ball."""

_RINGS = 7
"""Rings of a ball's vertices, its poles included."""


def cylinder(top: float = 1.0) -> Mesh:
    """Return an open cylinder about z, of radius and length 1 about its middle; a cone at top 0."""
    angles = np.linspace(0.0, 2.0 * np.pi, _SIDES, endpoint=False)
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    low = np.column_stack([ring, np.full(_SIDES, -0.5)])
    high = np.column_stack([top * ring, np.full(_SIDES, 0.5)])
    i = np.arange(_SIDES)
    k = np.roll(i, -1)
    faces = np.vstack(
        [np.column_stack([i, k, k + _SIDES]), np.column_stack([i, k + _SIDES, i + _SIDES])]
    )
    return np.vstack([low, high]), faces


def ball() -> Mesh:
    """Return a ball of radius 1."""
    polar = np.linspace(0.0, np.pi, _RINGS)
    angles = np.linspace(0.0, 2.0 * np.pi, _SIDES, endpoint=False)
    theta, phi = (grid.ravel() for grid in np.meshgrid(polar, angles, indexing="ij"))
    vertices = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1
    )
    faces = []
    for i, j in product(range(_RINGS - 1), range(_SIDES)):
        here, beside = i * _SIDES + j, i * _SIDES + (j + 1) % _SIDES
        faces += [(here, here + _SIDES, beside + _SIDES), (here, beside + _SIDES, beside)]
    return vertices, np.array(faces)


def cube() -> Mesh:
    """Return a cube of side 1 about its middle; each face has corners of its own, for its light."""
    corners = np.array([(-0.5, -0.5, 0.5), (0.5, -0.5, 0.5), (0.5, 0.5, 0.5), (-0.5, 0.5, 0.5)])
    top = np.eye(3)
    sides = [top, np.roll(top, 1, axis=0), np.roll(top, 2, axis=0)]
    vertices = np.vstack([corners @ (sign * side) for side in sides for sign in (1.0, -1.0)])
    quad = np.array([(0, 1, 2), (0, 2, 3)])
    faces = [quad[:, :: 1 if i % 2 == 0 else -1] + 4 * i for i in range(6)]
    return vertices, np.vstack(faces)


def fan(outline: Array) -> Mesh:
    """Return the plane face inside an outline (k, 3), as triangles about its middle."""
    count = len(outline)
    i = np.arange(count)
    faces = np.column_stack([np.full(count, count), i, np.roll(i, -1)])
    return np.vstack([outline, outline.mean(axis=0)]), faces


def cells(first: Array, second: Array, inside: NDArray[np.bool_]) -> Mesh:
    """Return the cells of a grid whose four corners (B, A) are inside, in its plane, (V, 2)."""
    x, y = np.meshgrid(first, second)
    vertices = np.stack([x.ravel(), y.ravel()], axis=-1)
    corner = np.arange(inside.size).reshape(inside.shape)
    whole = inside[:-1, :-1] & inside[1:, :-1] & inside[:-1, 1:] & inside[1:, 1:]
    a, b = corner[:-1, :-1][whole], corner[:-1, 1:][whole]
    c, d = corner[1:, 1:][whole], corner[1:, :-1][whole]
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    used, packed = np.unique(faces, return_inverse=True)
    return vertices[used], packed.reshape(-1, 3)
