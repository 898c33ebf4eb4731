"""Figures of six rams' ends for which a hexapod's platform can move while all rams are held.

Two kinds follow from the figures alone: line-symmetric motions (Borel and Bricard, 1906) and
translations. `direct_kinematics` detects others at its joint coordinates.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np

from pteron.kernels import Array
from pteron.kinematics.ram_figures import ROUNDING, ram_figures
from pteron.manipulator import Manipulator


def self_motions_of_rams(robot: Manipulator) -> tuple[str, ...]:
    """Return phrases on the poses at which a hexapod's platform can move with its rams fixed.

    The conditions are checked up to rounding of the points.
    """
    figures = ram_figures(robot)
    if figures is None:
        return ()
    return tuple(
        text for text in (_half_turn_phrase(*figures), _translation_phrase(*figures)) if text
    )


def _half_turn_phrase(base: Array, top: Array) -> str:
    """Return a phrase if the hexapod has line-symmetric self-motions (paired legs), else ''.

    After this displacement and any half turn the two legs of a pair are equally long, so that three
    lengths leave one of the four parameters of a half turn free.
    """
    for order in permutations(range(6)):
        if any(k == i or order[k] != i for i, k in enumerate(order)):
            continue
        crossed = top[list(order)]
        u, _, v = np.linalg.svd(crossed.T @ base)
        u[:, 2] *= np.linalg.det(u @ v)
        if np.linalg.norm(crossed @ u @ v - base) <= ROUNDING * np.linalg.norm(base):
            pairs = ", ".join(f"{i + 1} and {k + 1}" for i, k in enumerate(order) if i < k)
            return (
                f"where a half turn takes the platform points of legs {pairs} to each other's "
                "guide points (line-symmetric, Borel and Bricard)"
            )
    return ""


def _translation_phrase(base: Array, top: Array) -> str:
    """Return a phrase if the hexapod can translate with its rams fixed in some orientation.

    P then moves on spheres about that line. For v perpendicular to it and w = R^T v, base v = top
    w: the null space of (base, -top) contains a plane of such pairs with |v| = |w|.
    """
    sizes, axes = np.linalg.svd(np.hstack([base, -top]))[1:]
    null = axes[sizes <= ROUNDING * sizes[0]]
    longer = np.linalg.eigvalsh(null[:, :3] @ null[:, :3].T - null[:, 3:] @ null[:, 3:].T)
    above, below = (longer > ROUNDING).sum(), (longer < -ROUNDING).sum()
    if len(longer) - max(above, below) < 2:
        return ""
    return (
        "at any place, in an orientation in which the rams' vectors differ along one line at most "
        "(a translation)"
    )
