"""Test whether a hexapod of six rams is singular at every pose by the figures of the rams' ends.

Against a twist at the base's origin a ram from a to p + R b has the row (d, a x d) over its length,
d = p + R b - a. It is linear in the products of (1, a) with (1, b). So where these 16 numbers are
linearly dependent for the six rams, so are the rows, at every pose: as where both figures lie on
plane conics, and a projective map takes one to the other (Roeschel and Mick, Characterisation of
architecturally shaky platforms, 1998).
"""

from __future__ import annotations

import numpy as np

from pteron.equations.closing import holds_spheres
from pteron.equations.machine import Machine
from pteron.kernels import Array
from pteron.kernels.path_programs import spheres_kernel
from pteron.manipulator import Manipulator

ROUNDING = 1e-10
"""Singular values over the largest below this are rounding."""


def balance_of_rams(robot: Manipulator) -> str:
    """Return as text why a hexapod of rams is singular at every pose; '' if its points show none.

    The conditions are checked up to rounding of the points.
    """
    figures = ram_figures(robot)
    if figures is None:
        return ""
    base, top = figures
    if _vanishes(base, 1):
        return "all guide points lie on one line, about which no ram then has a moment"
    near, far = (_homogeneous_coordinates(figure / np.abs(figure).max()) for figure in (base, top))
    products = (near[:, :, None] * far[:, None, :]).reshape(len(base), -1)
    if not _vanishes(products, 5):
        return ""
    shares = np.linalg.svd(products)[0][:, -1]
    sizes = np.abs(shares)
    first = int((sizes > (1.0 - 1e-6) * sizes.max()).argmax())  # of equal ones, on any processor
    factors_text = ", ".join(f"{v:.4g}" for v in shares / shares[first] + 0.0)
    figures_text = _similarity_phrase(base, top) or _conics_phrase(base, top)
    return (
        f"{figures_text}rams that push with ({factors_text}) times their lengths "
        "leave the platform in balance at every pose"
    )


def ram_figures(robot: Manipulator) -> tuple[Array, Array] | None:
    """Return centred guide points and platform points (6, 3) of a hexapod of rams, m, or None.

    The result is None for any other machine, or if all points of a figure coincide.
    """
    if not (robot.platform.moves_freely and holds_spheres(Machine.numeric(robot))):
        return None
    joints = np.array([[1.0], [2.0]]) * np.ones(robot.joint_count)
    base, other = spheres_kernel(robot)(joints)[0]
    if not np.array_equal(base, other):
        return None  # joints move the near ends too: no rams
    top = np.array([leg.platform_point for leg in robot.legs])
    base, top = (figure - figure.mean(axis=0) for figure in (base, top))
    return (base, top) if base.any() and top.any() else None


def similarity(robot: Manipulator) -> tuple[float, float] | None:
    """Return a hexapod's scale factor platform/base figure, and its deviation from similar, m.

    The result is None if the machine is no hexapod of rams. The deviation is the greatest distance
    of a platform point from the image of its guide point.
    """
    figures = ram_figures(robot)
    if figures is None:
        return None
    turned, factor = _similar(*figures)
    return factor, float(np.linalg.norm(figures[1] - factor * turned, axis=1).max())


def _similar(base: Array, top: Array) -> tuple[Array, float]:
    """Return the base points (6, 3) rotated to fit the platform's, and the scale factor."""
    u, _, v = np.linalg.svd(base.T @ top)
    rotated = base @ u @ v
    return rotated, float((rotated * top).sum() / (rotated * rotated).sum())


def _vanishes(rows: Array, rank: int) -> bool:
    """Return whether a matrix has rank `rank` at most, up to rounding."""
    sigmas = np.linalg.svd(rows, compute_uv=False)
    return bool(sigmas[rank] <= ROUNDING * sigmas[0])


def _homogeneous_coordinates(figure: Array) -> Array:
    """Return points (n, d) in homogeneous coordinates (n, d + 1): a leading 1 each."""
    return np.hstack([np.ones((len(figure), 1)), figure])


def _similarity_phrase(base: Array, top: Array) -> str:
    """Return a phrase with the scale factor if base and platform points are similar, else ''."""
    turned, factor = _similar(base, top)
    if np.linalg.norm(top - factor * turned) > ROUNDING * np.linalg.norm(top):
        return ""
    where = " on a conic" if _conics_phrase(base) else ""
    return (
        f"the guide points and the platform points are similar figures{where}, the latter "
        f"{factor:.4g} times the former; "
    )


def _conics_phrase(*figures: Array) -> str:
    """Return a phrase if each set of points lies on a plane conic, else ''."""
    for figure in figures:
        if not _vanishes(figure, 2):
            return ""
        plane = figure @ np.linalg.svd(figure)[2][:2].T
        homogeneous = _homogeneous_coordinates(plane / np.abs(plane).max())
        squares = homogeneous[:, :, None] * homogeneous[:, None, :]
        if not _vanishes(squares.reshape(len(plane), -1), 5):
            return ""
    return (
        "guide points and platform points lie on conics, the one a projective image of the other; "
    )
