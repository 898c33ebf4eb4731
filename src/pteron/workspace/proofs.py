"""Proofs that a region of poses lies in the workspace, or a pose of it that does not."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pteron.arguments import expect
from pteron.errors import DataError
from pteron.kernels import Array, numeric
from pteron.kinematics.architecture import expect_regular
from pteron.kinematics.limits import limited_joints
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.progress import Progress
from pteron.result import Result
from pteron.workspace.boxes import halve_boxes
from pteron.workspace.conditions import (
    Condition,
    IntervalTest,
    condition_margins,
    conditions,
    interval_test,
)
from pteron.workspace.regions import Cylinder, Region

_TRIED = 4096
"""Undecided boxes whose middles and corners are tried as counterexamples, on each level."""

_SLICE = 1 << 16
"""Boxes tested at a time."""

_THINNEST = 1e-9
"""Share of the region's sides below which a box is not halved."""


@dataclass(frozen=True, eq=False, repr=False)
class Proof(Result):
    """The proof that a region lies in the workspace, or a pose of it that does not.

    Attributes
    ----------
    holds : bool or None
        True: every pose of it keeps all conditions. False: `counterexample` does not. None: it is
        not decided, as where the region touches the boundary.
    robot : Manipulator
        The machine.
    region : Box or Cylinder
        The region.
    conditions : tuple of Condition
        The conditions on its poses.
    counterexample : array, shape (m,), or None
        A pose of the region that is proved not to keep all of them.
    undecided : array, shape (2, m), or None
        The smallest box that is not decided.
    causes : tuple of Condition
        The conditions that the counterexample fails, or that are undecided in that box.
    boxes : int
        Number of boxes that were examined.
    """

    holds: bool | None
    robot: Manipulator = field(repr=False)
    region: Region
    conditions: tuple[Condition, ...] = field(repr=False)
    counterexample: Array | None = None
    undecided: Array | None = None
    causes: tuple[Condition, ...] = ()
    boxes: int = 0

    def __post_init__(self) -> None:
        assert not self.holds or self.boxes > 0, "a proof has examined something"

    def __str__(self) -> str:
        causes = ", ".join(map(str, self.causes))
        if self.holds:
            count = len(self.conditions)
            return f"proved: every pose meets all {count} conditions (boxes: {self.boxes})"
        if self.counterexample is not None:
            return f"disproved: pose {self.counterexample.round(6).tolist()} fails: {self.why}"
        assert self.undecided is not None
        low, high = (corner.round(6).tolist() for corner in self.undecided)
        return (
            f"undecided for poses from {low} to {high}: {causes}; the region may touch the boundary"
        )

    @property
    def why(self) -> str:
        """The conditions that the counterexample violates: the leg, and by how much."""
        if self.counterexample is None:
            return ""
        margins = numeric(self.robot, "reach")(self.counterexample)[0]
        joints = {(j.leg, j.noun): j for j in limited_joints(self.robot, self.counterexample)}
        texts = []
        remaining = condition_margins(self.robot, self.causes, self.counterexample)
        for condition, excess in zip(self.causes, remaining.tolist(), strict=True):
            joint = joints.get((condition.leg, condition.cause.split(" at ")[0]))
            text = str(condition)
            if joint is not None:
                text += f" ({joint.value:.4g} {joint.unit} of {joint.limits_text('{:g}'.format)})"
            elif condition.floor:
                value = excess + condition.floor
                text += f" ({value:.4g}, at least {condition.floor:.4g} required)"
            elif condition.leg and margins[condition.leg - 1] < 0.0:
                text += f" (it misses the pose by {-margins[condition.leg - 1]:.3g} m)"
            texts.append(text)
        return ", ".join(texts)


def prove(
    robot: RobotLike,
    region: Region,
    *,
    type_i: float = 0.0,
    type_ii: float = 0.0,
    given: tuple[Condition, ...] | None = None,
    most: int = 1_000_000,
    progress: Progress | None = None,
) -> Proof:
    """Return a proof that every pose of a region keeps the conditions, or a counterexample.

    Interval arithmetic decides of a box as a whole; a box that it does not decide is halved. A
    counterexample is a pose that fails by ordinary evaluation and by intervals.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine, in its working mode.
    region : Box or Cylinder
        The region of poses.
    type_i : float
        Least type-I measure of every leg; 0: it need only reach.
    type_ii : float
        Least size of the type-II measure; 0: it does not matter.
    given : tuple of Condition, optional
        Conditions in place of reach and limits; the floors come on top.
    most : int
        Undecided boxes at which it gives up.
    progress : callable, optional
        Called with the share of the region's volume that is decided, 0 to 1.

    Returns
    -------
    Proof

    Raises
    ------
    DataError
        If the region is none or holds no pose, its poses have not the machine's coordinates, it is
        a cylinder and the machine does not move in x, y and z, or a floor is negative.
    SingularPose
        If the machine is singular at every pose.

    Examples
    --------
    >>> from pteron.workspace import Box, prove
    >>> cube = Box((-0.05, -0.05, -0.05, 0.0), (0.05, 0.05, 0.05, 0.0))
    >>> prove("quadrupteron", cube, type_ii=0.6).holds
    True
    """
    robot = as_manipulator(robot)
    expect(isinstance(region, Region), "region", type(region).__name__, "a Box or a Cylinder")
    box = region.box
    if box.shape[1] != robot.freedom:
        names = ", ".join(robot.coordinates)
        raise DataError(f"region: {box.shape[1]} coordinates given, {names} expected")
    if isinstance(region, Cylinder):
        expect_space(robot, "region")
    expect_regular(robot)
    required = conditions(robot, type_i=type_i, type_ii=type_ii)
    if given is not None:
        required = (*given, *(c for c in required if c.what != "room"))
    test = interval_test(robot, required)
    boxes, open_bits, examined = box[None], np.array([test.all]), 0
    least = _THINNEST * (box[1] - box[0])
    sizes = np.where(box[0] < box[1], box[1] - box[0], 1.0)
    while True:
        parts, open_parts = [], []
        for start in range(0, len(boxes), _SLICE):
            block, bits = boxes[start : start + _SLICE], open_bits[start : start + _SLICE]
            meets = ~region.misses(block[:, 0], block[:, 1])
            block, bits = block[meets], bits[meets]
            examined += len(block)
            outside, bits = test(block[:, 0], block[:, 1], bits)
            parts.append(block[outside | (bits != 0)])
            open_parts.append(bits[outside | (bits != 0)])
        boxes, open_bits = np.concatenate(parts), np.concatenate(open_parts)
        if not examined:
            raise DataError("region: it holds no pose, so that nothing can be proved of it")
        sides = boxes[:, 1] - boxes[:, 0]
        if progress is not None:
            progress(1.0 - float(np.prod(sides / sizes + (sides == 0.0), axis=1).sum()))
        if not len(boxes):
            return Proof(True, robot, region, required, boxes=examined)
        counterexample = _find_counterexample(robot, test, region, boxes)
        if counterexample is not None:
            failed = _failed_conditions(robot, required, counterexample)
            return Proof(
                False, robot, region, required, counterexample, causes=failed, boxes=examined
            )
        if 2 * len(boxes) > most or (sides <= least).all():
            smallest = int(np.prod(np.where(sides > 0.0, sides, 1.0), axis=1).argmin())
            causes = tuple(c for k, c in enumerate(required) if int(open_bits[smallest]) >> k & 1)
            return Proof(
                None, robot, region, required, None, boxes[smallest], causes=causes, boxes=examined
            )
        boxes, open_bits = halve_boxes(boxes, sizes), np.repeat(open_bits, 2)


def _failed_conditions(
    robot: Manipulator, required: tuple[Condition, ...], pose: Array
) -> tuple[Condition, ...]:
    """Return the conditions that a pose violates or, if there are none, those undefined there."""
    margins = condition_margins(robot, required, pose)
    fails = margins < 0.0
    fails = fails if fails.any() else np.isnan(margins)
    return tuple(required[c] for c in np.flatnonzero(fails))


def expect_space(robot: Manipulator, name: str) -> None:
    """Raise DataError, naming an argument, if a cylinder is given but not x, y and z."""
    lengths = robot.platform.lengths
    if len(lengths) != 3:
        motion, places = robot.platform.motion, ", ".join(lengths) or "no lengths"
        raise DataError(
            f"{name}: a cylinder is a set of places in x, y and z, and the pose of {robot.name} "
            f"({motion}) has {places}; give a Box"
        )


def _find_counterexample(
    robot: Manipulator, test: IntervalTest, region: Region, boxes: Array
) -> Array | None:
    """Return a pose of the region that is proved to fail, among boxes' middles and corners."""
    sample = boxes[:: max(len(boxes) // _TRIED, 1)]
    varies = np.flatnonzero((sample[:, 0] < sample[:, 1]).any(axis=0))
    poses = [0.5 * (sample[:, 0] + sample[:, 1])]
    for corner in np.ndindex(*(2,) * len(varies)):
        pose = sample[:, 0].copy()
        pose[:, varies] = sample[:, corner, varies]
        poses.append(pose)
    candidates = np.concatenate(poses)
    candidates = candidates[region.holds(candidates)]
    margins = condition_margins(robot, test.conditions, candidates)
    failing = candidates[~(margins >= 0.0).all(axis=-1)]
    proved: NDArray[np.bool_] = test(failing, failing, np.full(len(failing), test.all))[0]
    return failing[proved.argmax()] if proved.any() else None
