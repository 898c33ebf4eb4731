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
from pteron.workspace.boxes import halved
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


@dataclass(frozen=True)
class Proof:
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
        told = ", ".join(map(str, self.causes))
        if self.holds:
            count = len(self.conditions)
            return f"proved: every pose keeps all {count} conditions (boxes: {self.boxes})"
        if self.counterexample is not None:
            return (
                f"not so: pose {self.counterexample.round(6).tolist()} does not serve: {self.why}"
            )
        assert self.undecided is not None
        low, high = (corner.round(6).tolist() for corner in self.undecided)
        return f"not decided of poses from {low} to {high}: {told}; the region may touch that edge"

    @property
    def why(self) -> str:
        """The conditions that the counterexample fails: the leg, and by how much."""
        if self.counterexample is None:
            return ""
        margins = numeric(self.robot, "reach")(self.counterexample)[0]
        joints = {(j.leg, j.noun): j for j in limited_joints(self.robot, self.counterexample)}
        told = []
        left = condition_margins(self.robot, self.causes, self.counterexample)
        for condition, room in zip(self.causes, left.tolist(), strict=True):
            joint = joints.get((condition.leg, condition.cause.split(" at ")[0]))
            text = str(condition)
            if joint is not None:
                text += f" ({joint.value:.4g} {joint.unit} of {joint.limits_text('{:g}'.format)})"
            elif condition.floor:
                text += f" ({room + condition.floor:.4g}, at least {condition.floor:.4g} asked)"
            elif condition.leg and margins[condition.leg - 1] < 0.0:
                text += f" (it misses the pose by {-margins[condition.leg - 1]:.3g} m)"
            told.append(text)
        return ", ".join(told)


def prove(
    robot: RobotLike,
    region: Region,
    *,
    type_i: float = 0.0,
    type_ii: float = 0.0,
    given: tuple[Condition, ...] | None = None,
    most: int = 1_000_000,
) -> Proof:
    """Prove that every pose of a region keeps reach, limits and floors, or show one that does not.

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
    asked = conditions(robot, type_i=type_i, type_ii=type_ii)
    if given is not None:
        asked = (*given, *(c for c in asked if c.what != "room"))
    test = interval_test(robot, asked)
    left, open_, seen = box[None], np.array([test.all]), 0
    least = _THINNEST * (box[1] - box[0])
    sizes = np.where(box[0] < box[1], box[1] - box[0], 1.0)
    while True:
        parts, still = [], []
        for start in range(0, len(left), _SLICE):
            part, bits = left[start : start + _SLICE], open_[start : start + _SLICE]
            meets = ~region.misses(part[:, 0], part[:, 1])
            part, bits = part[meets], bits[meets]
            seen += len(part)
            outside, bits = test(part[:, 0], part[:, 1], bits)
            parts.append(part[outside | (bits != 0)])
            still.append(bits[outside | (bits != 0)])
        left, open_ = np.concatenate(parts), np.concatenate(still)
        if not seen:
            raise DataError("region: it holds no pose, so that nothing can be proved of it")
        if not len(left):
            return Proof(True, robot, region, asked, boxes=seen)
        found = _counterexample(robot, test, region, left)
        if found is not None:
            left_there = condition_margins(robot, asked, found)
            # Out of reach limits are undefined: the cause is the reach.
            fails = left_there < 0.0
            fails = fails if fails.any() else np.isnan(left_there)
            failed = tuple(asked[c] for c in np.flatnonzero(fails))
            return Proof(False, robot, region, asked, found, causes=failed, boxes=seen)
        sides = left[:, 1] - left[:, 0]
        if 2 * len(left) > most or (sides <= least).all():
            smallest = int(np.prod(np.where(sides > 0.0, sides, 1.0), axis=1).argmin())
            causes = tuple(c for k, c in enumerate(asked) if int(open_[smallest]) >> k & 1)
            return Proof(
                None, robot, region, asked, None, left[smallest], causes=causes, boxes=seen
            )
        left, open_ = halved(left, sizes), np.repeat(open_, 2)


def expect_space(robot: Manipulator, name: str) -> None:
    """Refuse a cylinder, the argument of this name, of a machine without x, y and z in its pose."""
    lengths = robot.platform.lengths
    if len(lengths) != 3:
        motion, places = robot.platform.motion, ", ".join(lengths) or "no lengths"
        raise DataError(
            f"{name}: a cylinder is a set of places in x, y and z, and the pose of {robot.name} "
            f"({motion}) has {places}; give a Box"
        )


def _counterexample(
    robot: Manipulator, test: IntervalTest, region: Region, boxes: Array
) -> Array | None:
    """Return a pose of the region that is proved to fail: a middle or a corner of boxes."""
    tried = boxes[:: max(len(boxes) // _TRIED, 1)]
    varies = np.flatnonzero((tried[:, 0] < tried[:, 1]).any(axis=0))
    poses = [0.5 * (tried[:, 0] + tried[:, 1])]
    for corner in np.ndindex(*(2,) * len(varies)):
        pose = tried[:, 0].copy()
        pose[:, varies] = tried[:, corner, varies]
        poses.append(pose)
    every = np.concatenate(poses)
    every = every[region.holds(every)]
    failing = every[~(condition_margins(robot, test.given, every) >= 0.0).all(axis=-1)]
    proved: NDArray[np.bool_] = test(failing, failing, np.full(len(failing), test.all))[0]
    return failing[proved.argmax()] if proved.any() else None
