"""Proofs of a design's workspace, by intervals: every pose reaches, and no two bodies touch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pteron.design.rating import KindEvaluator, Rating
from pteron.design.workspace_samples import orientations, poses_about_tool
from pteron.kernels import Array
from pteron.manipulator import Manipulator, Radii
from pteron.motion.trajectories.tool import arm_motion, carries, tool_motion
from pteron.platforms import Platform
from pteron.workspace import Box, Cylinder, Proof, Region, interference, prove

_BOXES, _BOXES_CLEAR = 60_000, 1_000
"""Boxes after which a proof of reach is given up, and a proof that no two bodies touch, whose
boxes take longer."""

_LONGER = 0.05
"""Share of its travel by which a guide or ram is lengthened where a proof fails at its end."""


@dataclass(frozen=True)
class TurnedTool:
    """Poses whose tool is in a box, for a platform that turns about an axis beside the tool.

    Parameters
    ----------
    of_tool : Box
        Positions of the tool, as `tool_motion` has them, then the angle of the turn, m and rad.
    platform : Platform
        The platform that carries the tool.
    """

    of_tool: Box
    platform: Platform

    @property
    def box(self) -> Array:
        """Least and greatest pose (2, m)."""
        low, high = self.of_tool.box
        at, away = self._arm(low[None], high[None])
        return np.array([low - at[0] - away[0], high - at[0] + away[0]])

    def holds(self, poses: Array) -> NDArray[np.bool_]:
        """Return which poses (..., m) lie in it."""
        zeros = np.zeros_like(poses)
        return self.of_tool.holds(tool_motion(self.platform, poses, zeros, zeros)[0])

    def misses(self, low: Array, high: Array) -> NDArray[np.bool_]:
        """Return which boxes with corners (B, m) certainly have none of these poses."""
        at, away = self._arm(low, high)
        return self.of_tool.misses(low + at - away, high + at + away)

    def _arm(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Return the arm (B, m) from P to the tool at a box's middle angle, and its greatest error.

        Over half the box's range of angles the arm's end moves by its length times that at most.
        """
        platform, angular = self.platform, self.platform.angular
        middle, half = 0.5 * (low + high)[:, angular], 0.5 * (high - low)[:, -1:]
        zeros = np.zeros_like(middle)
        at, away = np.zeros_like(low), np.zeros_like(low)
        at[:, ~angular] = arm_motion(platform, middle, zeros, zeros)[0]
        away[:, ~angular] = (1.0 + 1e-12) * np.hypot(*platform.tool[:2]) * half
        return at, away


def proofs_of(evaluator: KindEvaluator, rating: Rating) -> tuple[list[Proof], Manipulator]:
    """Return proofs of the workspace, and the machine, its guides and rams lengthened if needed."""
    robot, floors = rating.robot, evaluator.job.floors
    assert robot is not None  # a design that keeps all requirements has one
    proofs: list[Proof] = []
    for _ in range(4):
        proofs = [
            prove(robot, region, type_i=floors.type_i, type_ii=floors.type_ii, most=_BOXES)
            for region in regions(evaluator, robot, rating.middle)
        ]
        causes = {c.leg for proof in proofs if not proof.holds for c in proof.causes}
        ended = {i for i in causes if i and robot.legs[i - 1].joint.unit == "m"}
        if not ended:
            break
        legs = list(robot.legs)
        for i in ended:
            low, high = legs[i - 1].limits or (0.0, 0.0)
            spare = _LONGER * (high - low)
            travel = low - spare, high + spare
            legs[i - 1] = evaluator.kind.with_travel(legs[i - 1], travel, rating.values)
        robot = replace(robot, legs=tuple(legs))
    return proofs, robot


def regions(evaluator: KindEvaluator, robot: Manipulator, middle: Array) -> list[Region]:
    """Return the workspace as regions: each pose of a list, else a box or cylinder an orientation.

    A range of turns without tilts is a coordinate of one box.
    """
    space, count = evaluator.job.workspace, len(robot.platform.lengths)
    if space.poses is not None:
        return [Box(tuple(pose), tuple(pose)) for pose in middle + evaluator.poses]
    if space.turn is not None and not space.tilts and space.radius is None:
        return [_turned_box(evaluator, robot, middle)]
    boxes: list[Region] = []
    half = np.zeros(robot.freedom)
    half[:count] = evaluator.half[:count]
    for pose in middle + poses_about_tool(robot, orientations(evaluator.job, robot)):
        if space.radius is not None and space.height is not None:
            boxes.append(Cylinder(tuple(pose.tolist()), space.radius, space.height))
        else:
            boxes.append(Box(tuple((pose - half).tolist()), tuple((pose + half).tolist())))
    return boxes


def _turned_box(evaluator: KindEvaluator, robot: Manipulator, middle: Array) -> Region:
    """Return the box of positions and turns of a workspace with a range of turns."""
    platform, count = robot.platform, len(robot.platform.lengths)
    assert evaluator.job.workspace.turn is not None  # the caller has checked it
    zeros = np.zeros((1, robot.freedom))
    level = tool_motion(platform, middle[None], zeros, zeros)[0][0]
    low, high = level.copy(), level.copy()
    low[:count] -= evaluator.half[:count]
    high[:count] += evaluator.half[:count]
    low[-1], high[-1] = evaluator.job.workspace.turn
    box = Box(tuple(low.tolist()), tuple(high.tolist()))
    return TurnedTool(box, platform) if carries(platform) and any(platform.tool[:2]) else box


def proof_sentence(evaluator: KindEvaluator, proofs: Sequence[Proof]) -> str:
    """Return what is proved of the workspace, in words."""
    space, boxes = evaluator.job.workspace, sum(proof.boxes for proof in proofs)
    if not all(proof.holds for proof in proofs):
        return (
            f"kept at {len(evaluator.poses)} sample poses; intervals over {boxes} boxes do not "
            "decide of all"
        )
    if space.poses is not None:
        statement = (
            f"every one of {len(proofs)} poses and orientations keeps reach, limits and floors"
        )
        between = f"; so do the cycles between them at {len(evaluator.between)} samples"
        return statement + (between if len(evaluator.between) else "")
    noun = "pose" if len(proofs) == 1 else f"position, at {len(proofs)} orientations,"
    statement = f"every {noun} keeps reach, limits and floors, by intervals over {boxes} boxes"
    return (
        f"proved at the sampled tilts alone: {statement}" if space.tilt else f"proved: {statement}"
    )


def is_clear(evaluator: KindEvaluator, robot: Manipulator, middle: Array) -> bool:
    """Say whether it is proved that no two bodies come nearer than the least clearance."""
    radii, least = robot.radii or Radii(), evaluator.job.floors.clearance / 2.0
    parts = (radii.guide, radii.upper, radii.lower, radii.platform)
    required = interference(robot, Radii(*(part + least for part in parts)))
    workspace = regions(evaluator, robot, middle)
    most = _BOXES_CLEAR // len(workspace)
    return all(prove(robot, region, given=required, most=most).holds for region in workspace)
