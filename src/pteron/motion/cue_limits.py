"""The box, the way home and the limits of a live cue, proved or examined before it begins."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from pteron.dynamics import drive_forces
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kinematics import joint_rates
from pteron.kinematics.evaluate import finite_pose
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.cueing import Cue, expect_free_platform, prove_box
from pteron.motion.trajectories.limits import limits_of
from pteron.motion.washout import Washout, WashoutFilter
from pteron.result import Result
from pteron.shapes import PoseLike
from pteron.workspace import Box, Proof, conditions, home_pose, prove
from pteron.workspace.conditions import keeps
from pteron.workspace.regions import Segment

_REACH, _SAFETY = 2.0, 0.95
"""Limits of the platform over what the standard manoeuvre takes, where drives allow it; share of
the drives' limits that is used, since poses between those examined may take a little more."""

_POSES = 512
"""Poses of the box at which drives are examined, 64 of them its corners."""

_SHARES, _BOXES = np.linspace(0.0, 1.0, 65)[:, None], 20_000
"""Shares of the way from home at which poses are tried before its proof, and its most boxes."""

_MANOEUVRE = ((6.0, 6.0, 3.0, 0.5, 0.5, 0.5), 2.0, 10.0)
"""The standard manoeuvre: accelerations, m/s^2, and rates, rad/s, one after another, for 2 s each,
with 10 s between: hard braking and cornering of a car on tyres for the road."""

_COARSE = 0.01
"""Step of the standard manoeuvre, s: a third of the filters' shortest time constant."""


@dataclass(frozen=True, eq=False, repr=False)
class CueLimits(Result):
    """The box, the way to it and the limits of a live cue.

    Attributes
    ----------
    region : Box
        The box of poses that the platform stays in.
    proof : Proof
        The proof that all poses of the box lie in the workspace.
    home : array, shape (m,)
        The pose from which the platform starts and to which it returns.
    speed, acceleration : array, shape (m,)
        Limits of the platform, m/s and m/s^2, rad/s and rad/s^2.
    speed_share, force_share : float
        The most that these take of the drives' speed and force, in any of the poses examined; NaN
        where the drives state none.
    """

    region: Box
    proof: Proof = field(repr=False)
    home: Array
    speed: Array
    acceleration: Array
    speed_share: float
    force_share: float

    @property
    def center(self) -> Array:
        """The pose (m,) at the middle of the box."""
        return np.asarray(self.region.box.mean(axis=0))


def cue_limits(
    robot: RobotLike,
    *,
    washout: Washout | None = None,
    recorded: Cue | None = None,
    pose: PoseLike | None = None,
    home: PoseLike | None = None,
    type_ii: float = 0.0,
) -> CueLimits:
    """Return the proved box, the proved way to it and the limits within which a live cue moves.

    Parameters
    ----------
    robot : Manipulator, name or path
        A machine whose platform moves and turns freely (3T3R), x ahead, y to the left, z up.
    washout : Washout, optional
        The filters.
    recorded : Cue, optional
        A recorded motion: its box is taken. By default the box has the proportions of a standard
        manoeuvre: braking and cornering at 6 m/s^2, 3 m/s^2 upwards, 0.5 rad/s about each axis.
    pose : array, shape (m,), optional
        The middle; by default the place about which the largest box fits.
    home : array, shape (m,), optional
        Where the platform rests; by default the machine's home pose.
    type_ii : float
        Least type-II measure in the box.

    Returns
    -------
    CueLimits

    Raises
    ------
    ModelError
        If the platform does not move freely; if no box, or no straight way from home to its
        middle, is proved; if drives are too weak to hold the platform in the box.
    """
    robot = as_manipulator(robot)
    expect_free_platform(robot)
    amounts, duration, pause = _MANOEUVRE
    pulse, rest_steps = round(duration / _COARSE), round(pause / _COARSE)
    samples = np.zeros((6 * (pulse + rest_steps), 6))
    for k, amount in enumerate(amounts):
        samples[k * (pulse + rest_steps) : k * (pulse + rest_steps) + pulse, k] = amount
    demand = np.abs(WashoutFilter(washout or Washout(), _COARSE).run(samples)).max(axis=1)
    if recorded is None:
        region, proof = prove_box(robot, demand[0], pose, type_ii)
    else:
        region, proof = recorded.region, recorded.proof
        demand[1] = np.maximum(demand[1], np.abs(recorded.velocity).max(axis=0))
        demand[2] = np.maximum(demand[2], np.abs(recorded.acceleration).max(axis=0))
    resting = home_pose(robot) if home is None else finite_pose(robot, home, "home")
    if not region.holds(resting):
        _expect_proved_way(robot, resting, region.box.mean(axis=0), type_ii)
    speed, acceleration = (_REACH * part for part in demand[1:])
    return _limit_to_drives(robot, region, proof, resting, speed, acceleration)


def _expect_proved_way(robot: Manipulator, home: Array, center: Array, type_ii: float) -> None:
    """Raise ModelError unless the straight way from home to the middle is proved."""
    way, required = home + _SHARES * (center - home), conditions(robot, type_ii=type_ii)
    text = "a pose of it cannot be used"
    if keeps(robot, required, way).all():
        segment = Segment(tuple(home.tolist()), tuple(center.tolist()))
        proof = prove(robot, segment, given=required, most=_BOXES)
        if proof.holds:
            return
        text = str(proof)
    raise ModelError(
        f"no straight way from home {home.round(4).tolist()} to the middle "
        f"{center.round(4).tolist()} is proved: {text}; give another middle or another [home] pose",
        subject=robot.name,
    )


def _limit_to_drives(
    robot: Manipulator, region: Box, proof: Proof, home: Array, speed: Array, acceleration: Array
) -> CueLimits:
    """Return limits of the platform at which no drive exceeds its speed or its force."""
    low, high = region.box
    rng, m = np.random.default_rng(0), robot.freedom
    shares = rng.uniform(size=(_POSES, m))
    corners = (np.arange(2**m)[:, None] >> np.arange(m)) & 1
    shares[: len(corners)] = corners
    ways = home + np.linspace(0.0, 1.0, 16)[:, None] * (0.5 * (low + high) - home)
    poses, limits = np.concatenate([low + shares * (high - low), ways]), limits_of(robot)
    units, zero = np.eye(m)[:, None, :] * np.ones((len(poses), 1)), np.zeros_like(poses)
    slopes = np.abs([joint_rates(robot, poses, unit).actuated for unit in units])
    speed_share = float((np.tensordot(speed, slopes, 1) / limits.speed).max())
    factor = 1.0 if speed_share <= _SAFETY else _SAFETY / speed_share
    speed = factor * speed
    moving = speed * np.sign(rng.uniform(-1.0, 1.0, poses.shape))
    static_forces = np.abs([drive_forces(robot, poses, v, zero) for v in (zero, moving, -moving)])
    base = drive_forces(robot, poses, zero, zero)
    gains = np.abs([drive_forces(robot, poses, zero, unit) - base for unit in units])
    needed, free = (
        np.tensordot(acceleration, gains, 1),
        _SAFETY * limits.force - static_forces.max(axis=0),
    )
    if (free <= 0.0).any():
        k, i = np.unravel_index(int(free.argmin()), free.shape)
        joint = robot.legs[i].joint
        raise ModelError(
            f"leg {i + 1}: its drive gives {limits.force[i]:.4g} {joint.force_unit}, but to hold "
            "the platform in the box, friction included, takes up to "
            f"{static_forces[:, k, i].max():.4g} {joint.force_unit}: lower the payload, or take a "
            "stronger drive",
            subject=robot.name,
        )
    acceleration = min(1.0, float((free / needed).min())) * acceleration
    used = np.tensordot(acceleration, gains, 1) + static_forces.max(axis=0)
    shares_used = (
        speed_share * factor if np.isfinite(limits.speed).any() else math.nan,
        float((used / limits.force).max()) if np.isfinite(limits.force).any() else math.nan,
    )
    return CueLimits(region, proof, home, speed, acceleration, *shares_used)
