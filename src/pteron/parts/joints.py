"""Joints and guides that links are hung on: what they bear, their size, mass and price."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path

import numpy as np

from pteron.kernels import Array
from pteron.parts.lists import NOT_NEGATIVE, POSITIVE, expected_number, read_parts

JOINT_PARTS = Path(__file__).parent / "joints.csv"
"""The list of the package."""

KINDS = {
    "ball": "a ball joint",
    "universal": "a universal joint",
    "revolute": "a bearing of one axis",
    "guide": "the carriage on a rail",
}
"""The joints that a part may be."""


@dataclass(frozen=True)
class JointPart:
    """A joint or a carriage.

    Parameters
    ----------
    name : str
        Its name.
    joint : str
        One of `KINDS`.
    force, moment : float
        Permissible static load, N and N m; together, the sum of both shares is at most 1.
    diameter : float
        Of its outline, m; of a rail its width.
    mass : float
        kg.
    price : float
        0 where the list has none.
    """

    name: str
    joint: str
    force: float = expected_number(POSITIVE)
    diameter: float = expected_number(POSITIVE)
    mass: float = expected_number(NOT_NEGATIVE)
    moment: float = expected_number(POSITIVE, default=inf)
    price: float = expected_number(NOT_NEGATIVE, default=0.0)

    def load_share(self, force: Array, moment: Array) -> Array:
        """Return the load as a share of the permissible one, 1 at the limit."""
        return np.asarray(force / self.force + moment / self.moment)


def read_joints(path: str | Path) -> tuple[JointPart, ...]:
    """Return the joints of a CSV or Parquet file; see `read_parts`."""
    return read_parts(path, JointPart, KINDS)


def cheapest_joint(
    parts: Sequence[JointPart], kind: str, force: Array, moment: Array
) -> JointPart | None:
    """Return the cheapest joint of a kind that bears a load, the lightest of equals; else None."""
    bearing = [p for p in parts if p.joint == kind and p.load_share(force, moment).max() <= 1.0]
    return min(bearing, key=lambda part: (part.price, part.mass), default=None)
