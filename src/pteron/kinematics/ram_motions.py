"""Figures of six rams' ends for which a hexapod's platform can move while all rams are held.

Two kinds are told from the figures alone: line-symmetric motions (Borel and Bricard, 1906) and
translations. Of others `direct_kinematics` looks for those at the joints that it is asked for.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np

from pteron.kernels import Array
from pteron.kinematics.ram_figures import ROUNDING, ram_figures
from pteron.manipulator import Manipulator


def self_motions_of_rams(robot: Manipulator) -> tuple[str, ...]:
    """Return at which poses a hexapod's platform can move while its rams are held, one line a kind.

    It is proved up to rounding of the points.
    """
    figures = ram_figures(robot)
    if figures is None:
        return ()
    return tuple(text for text in (_exchanged(*figures), _along_a_line(*figures)) if text)


def _exchanged(base: Array, top: Array) -> str:
    """Say so if a displacement takes platform points to guide points, those of two legs crosswise.

    After it and any half turn the two legs are equally long, so that three lengths leave one of the
    four numbers of a half turn free.
    """
    for order in permutations(range(6)):
        if any(k == i or order[k] != i for i, k in enumerate(order)):
            continue
        crossed = top[list(order)]
        left, _, right = np.linalg.svd(crossed.T @ base)
        left[:, 2] *= np.linalg.det(left @ right)
        if np.linalg.norm(crossed @ left @ right - base) <= ROUNDING * np.linalg.norm(base):
            pairs = ", ".join(f"{i + 1} and {k + 1}" for i, k in enumerate(order) if i < k)
            return (
                f"where a half turn takes the platform points of legs {pairs} to each other's "
                "guide points (line-symmetric, Borel and Bricard)"
            )
    return ""


def _along_a_line(base: Array, top: Array) -> str:
    """Say so if in some orientation R the vectors of all rams differ along one line, or not at all.

    P is then on spheres about that line. For v across it and w = R^T v, base v = top w: the null
    space of (base, -top) holds a plane of such pairs, |v| = |w|.
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
