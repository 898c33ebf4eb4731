"""The workspace of each working mode, and contacts of modes: poses where an elbow changes side.

A leg changes a sign of its branch at an edge of its reach that both modes' workspaces meet.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pteron.kernels import Array
from pteron.kernels.bisection import bisect_condition
from pteron.kinematics.evaluate import finite_pose
from pteron.manipulator import RobotLike, as_manipulator, working_modes
from pteron.manipulator.variants import elbows_of
from pteron.result import Result
from pteron.shapes import PoseLike
from pteron.workspace.boxes import halve_boxes
from pteron.workspace.conditions import (
    IntervalTest,
    condition_margins,
    edge_causes,
    interval_test,
)
from pteron.workspace.paving import Paving, paving

_HALVINGS = 50
"""Bisections for a contact, between a box's corner inside an edge of reach and one beyond."""

_ROUNDS = 30
"""Most times that boxes are halved; after them it is not decided whether two modes meet."""

_MOST = 200_000
"""Most boxes about an edge of reach in which a contact is sought; with more it is not decided."""


@dataclass(frozen=True, eq=False, repr=False)
class Contact(Result):
    """Whether a machine can pass between two working modes through a type-I singularity.

    Attributes
    ----------
    elbows : pair of tuple of int
        The two modes, which differ in one sign of one leg.
    leg : int
        The leg, from 1: it is stretched or folded where they meet.
    cause : str
        The edge of reach there; empty where they do not meet.
    pose : array, shape (m,), or None
        A pose at which they meet, but for rounding.
    proved : bool
        Whether it is proved that they meet, or that they do not.
    """

    elbows: tuple[tuple[int, ...], tuple[int, ...]]
    leg: int
    cause: str
    pose: Array | None
    proved: bool


def mode_pavings(
    robot: RobotLike, pose: PoseLike, *, tolerance: float = 0.2
) -> dict[tuple[int, ...], Paving]:
    """Return the paving of every working mode at the orientation of a pose, by the legs' elbows.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (m,)
        Gives the orientation, m and rad.
    tolerance : float
        As for `paving`.

    Returns
    -------
    dict of tuple of int to Paving
    """
    robot = as_manipulator(robot)
    at = finite_pose(robot, pose, "pose")
    return {elbows_of(mode): paving(mode, at, tolerance=tolerance) for mode in working_modes(robot)}


def mode_contacts(pavings: dict[tuple[int, ...], Paving]) -> tuple[Contact, ...]:
    """Return whether the workspaces of each two modes that differ in a single sign meet.

    They meet where its leg is at an edge of its reach and all else is kept in both. In a box in
    which nothing but this edge is undecided, and beyond which two corners lie on either side of it,
    there is such a pose. Where no box may hold one they do not meet at this orientation.

    Parameters
    ----------
    pavings : dict
        The result of `mode_pavings`.

    Returns
    -------
    tuple of Contact
    """
    contacts = []
    for first, second in combinations(pavings, 2):
        signs = [
            (i + 1, edge_causes(edges))
            for i, leg in enumerate(pavings[first].robot.legs)
            for edges in leg.sign_edges.values()
        ]
        differs = [sign for sign, a, b in zip(signs, first, second, strict=True) if a != b]
        if len(differs) == 1:
            pair = pavings[first], pavings[second]
            contacts.append(_contact(*pair, (first, second), *differs[0]))
    return tuple(contacts)


def _contact(
    first: Paving,
    second: Paving,
    elbows: tuple[tuple[int, ...], tuple[int, ...]],
    leg: int,
    causes_of_edges: tuple[str, ...],
) -> Contact:
    """Return the contact of two working modes at a leg, by bisection of both pavings' boxes."""
    first_test, second_test = (interval_test(s.robot, s.conditions) for s in (first, second))
    edges = [
        k for k, c in enumerate(first.conditions) if c.leg == leg and c.cause in causes_of_edges
    ]
    boxes = np.concatenate([first.inner, first.boundary])
    for _ in range(_ROUNDS):
        low, high = first.corners(boxes)
        # Where an edge may be met; not only on the boundary, since links of one length fold inside.
        least = np.array([first_test.bounds(k, low, high)[0] for k in edges])
        candidates = np.flatnonzero((least <= 0.0).any(axis=0))
        for test in (first_test, second_test):
            outside, _ = test(low[candidates], high[candidates], np.full(len(candidates), test.all))
            candidates = candidates[~outside]
        boxes, low, high = boxes[candidates], low[candidates], high[candidates]
        if not len(boxes):
            return Contact(elbows, leg, "", None, True)
        causes = first_test.undecided_conditions(low, high) | second_test.undecided_conditions(
            low, high
        )
        for k in edges:
            alone = causes[:, k] & (causes.sum(axis=1) == 1)
            pose = _find_crossing(first, first_test, k, low[alone], high[alone])
            if pose is not None:
                return Contact(elbows, leg, first.conditions[k].cause, pose, True)
        if 2 * len(boxes) > _MOST:
            break
        boxes = halve_boxes(boxes, boxes[0, 1] - boxes[0, 0])
    return Contact(elbows, leg, "", None, False)


def _find_crossing(
    side: Paving, test: IntervalTest, k: int, low: Array, high: Array
) -> Array | None:
    """Return a pose where a condition changes its sign, bisected in a box; None without a box.

    One corner of the box is proved inside, another outside.
    """
    corners = np.array(list(np.ndindex(*(2,) * low.shape[1])))
    for a, b in zip(low, high, strict=True):
        poses = np.where(corners == 1, b, a)
        least, most, _ = test.bounds(k, poses, poses)
        if not ((least > 0.0).any() and (most < 0.0).any()):
            continue
        ends = poses[least.argmax()], poses[most.argmin()]
        return bisect_condition(
            lambda pose: condition_margins(side.robot, side.conditions, pose)[k] >= 0.0,
            *ends,
            _HALVINGS,
        )[0]
    return None
