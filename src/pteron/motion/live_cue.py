"""A live cue: set points of a simulator's drives, computed tick by tick from a vehicle's samples.

The filters are those of a recorded motion. A follower with limits of speed and acceleration stands
behind them, so that whatever the samples are the platform stays in a proved box, starts from home
along a proved line and returns there when samples stop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from pteron.dynamics import drive_forces
from pteron.errors import DataError, ModelError
from pteron.kernels import Array, numeric
from pteron.kinematics import joint_rates
from pteron.kinematics.evaluate import finite_pose
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.manipulator.readings import to_readings
from pteron.motion.cueing import WITHIN, Cue, expect_free_platform, prove_box
from pteron.motion.trajectories.limits import limits_of
from pteron.motion.washout import Washout, WashoutFilter, compress
from pteron.result import Result
from pteron.shapes import PoseLike
from pteron.workspace import Box, Proof, conditions, home_pose, prove
from pteron.workspace.conditions import keeps
from pteron.workspace.regions import Segment

RATE = 250.0
"""Set points per second."""

TIMEOUT = 0.3
"""Time without a sample, s, after which the platform returns: 18 datagrams at 60 Hz."""

_GENTLE = 0.3
"""Share of the acceleration that starting and returning take."""

_SPAN = 3.0
"""Time constant of the follower's linear zone in ticks: from 2 on its discrete poles are stable and
do not oscillate."""

_ARRIVED = 1e-7
"""Distance, as a share of the way, at which a start or a return is complete."""

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


class Follower:
    """A point that follows a moving target with limits of position, speed and acceleration.

    Acceleration is constant within a tick. Near the target the error decays with two equal poles,
    far from it the point accelerates and brakes as fast as it may (time-optimal in discrete time;
    J. Han, IEEE Trans. Ind. Electron. 56(3), 2009). Whatever the target does, it can always brake
    before its end of travel: with c = L - |y| - |v| h / 2 the next speed towards the end is at most
    A (sqrt(h^2 + 2 c / A) - h).

    Parameters
    ----------
    half, speed, acceleration : array, shape (k,)
        Ends of travel on both sides of 0, L, and limits of speed, V, and acceleration, A.
    step : float
        The tick h, s.
    """

    def __init__(self, half: Array, speed: Array, acceleration: Array, step: float) -> None:
        self._half, self._speed, self._most, self._step = half, speed, acceleration, step
        self.position, self.velocity = np.zeros_like(half), np.zeros_like(half)
        self.acceleration = np.zeros_like(half)
        self._target: tuple[Array, Array] | None = None

    def place(self, position: Array) -> None:
        """Set the point at rest at a position."""
        self.position, self.velocity = position, np.zeros_like(position)
        self.acceleration = np.zeros_like(position)
        self._target = None

    def retarget(self) -> None:
        """Forget the target: the next one is another."""
        self._target = None

    def advance(self, target: Array, rate: Array, share: float = 1.0) -> None:
        """Advance by a tick towards a target and its rate (k,), at a share of the acceleration."""
        h, y, v = self._step, self.position, self.velocity
        before, rate_before = (target, rate) if self._target is None else self._target
        self._target = target, rate
        most = share * self._most
        wanted = (rate - rate_before) / h
        wanted = wanted + _time_optimal(y - before, v - rate_before, most, _SPAN * h)
        wanted = np.minimum(np.maximum(wanted, -most), most)
        a, halfway = self._most, 0.5 * h * v
        upper = a * (np.sqrt(h * h + 2.0 * np.maximum(self._half - y - halfway, 0.0) / a) - h)
        lower = -a * (np.sqrt(h * h + 2.0 * np.maximum(self._half + y + halfway, 0.0) / a) - h)
        velocity = np.minimum(v + h * wanted, np.minimum(upper, self._speed))
        velocity = np.maximum(velocity, np.maximum(lower, -self._speed))
        self.position = y + 0.5 * h * (v + velocity)
        self.velocity, self.acceleration = velocity, (velocity - v) / h


def _time_optimal(error: Array, rate: Array, most: Array, span: float) -> Array:
    """Return the acceleration (k,) that removes an error soonest without overshoot."""
    zone = most * span * span
    drift = span * rate
    ahead = error + drift
    far = drift + 0.5 * np.sign(ahead) * (np.sqrt(zone * (zone + 8.0 * np.abs(ahead))) - zone)
    near = drift + ahead
    aim = np.where(np.abs(ahead) <= zone, near, far)
    return -most * np.clip(aim / zone, -1.0, 1.0)


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
    each, rest = round(duration / _COARSE), round(pause / _COARSE)
    samples = np.zeros((6 * (each + rest), 6))
    for k, amount in enumerate(amounts):
        samples[k * (each + rest) : k * (each + rest) + each, k] = amount
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
    return _within_drives(robot, region, proof, resting, speed, acceleration)


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


def _within_drives(
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
    held = np.abs([drive_forces(robot, poses, v, zero) for v in (zero, moving, -moving)])
    base = drive_forces(robot, poses, zero, zero)
    gains = np.abs([drive_forces(robot, poses, zero, unit) - base for unit in units])
    needed, free = np.tensordot(acceleration, gains, 1), _SAFETY * limits.force - held.max(axis=0)
    if (free <= 0.0).any():
        k, i = np.unravel_index(int(free.argmin()), free.shape)
        joint = robot.legs[i].joint
        raise ModelError(
            f"leg {i + 1}: its drive gives {limits.force[i]:.4g} {joint.force_unit}, but to hold "
            f"the platform in the box, friction included, takes up to "
            f"{held[:, k, i].max():.4g} {joint.force_unit}: lower the payload, or take a stronger "
            "drive",
            subject=robot.name,
        )
    acceleration = min(1.0, float((free / needed).min())) * acceleration
    used = np.tensordot(acceleration, gains, 1) + held.max(axis=0)
    shares_used = (
        speed_share * factor if np.isfinite(limits.speed).any() else math.nan,
        float((used / limits.force).max()) if np.isfinite(limits.force).any() else math.nan,
    )
    return CueLimits(region, proof, home, speed, acceleration, *shares_used)


class LiveCue:
    """The set points of a live cue, a tick at a time, without sockets or clocks.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    limits : CueLimits
        Its box, home and limits.
    washout : Washout, optional
        The filters.
    rate : float
        Ticks per second.
    timeout : float
        Time without a sample, s, after which the platform returns home.

    Attributes
    ----------
    pose, velocity, acceleration : array, shape (m,)
        The platform's motion after the last tick: m, rad and s.
    joints : array, shape (n,)
        The set points: readings of the drives, m or rad.
    phase : str
        "home", "starting", "cueing" or "returning".
    """

    def __init__(
        self,
        robot: RobotLike,
        limits: CueLimits,
        washout: Washout | None = None,
        *,
        rate: float = RATE,
        timeout: float = TIMEOUT,
    ) -> None:
        self._robot, self._limits, step = as_manipulator(robot), limits, 1.0 / rate
        for name, number in (("rate", rate), ("timeout", timeout)):
            if not 0.0 < number < math.inf:
                raise DataError(f"{name}: {number!r} given, a number above 0 expected")
        self._filter = WashoutFilter(washout or Washout(), step)
        self._half = 0.5 * np.ptp(limits.region.box, axis=0)
        self._center, self._way = limits.center, limits.center - limits.home
        self._follower = Follower(self._half, limits.speed, limits.acceleration, step)
        # Along the way home a share from -1 (home) to 1 (the middle).
        reach = np.maximum(0.5 * np.abs(self._way), 1e-9 * self._half)
        slowest, least = (limits.speed / reach).min(), (limits.acceleration / reach).min()
        self._share = Follower(np.ones(1), np.full(1, slowest), np.full(1, least), step)
        self._share.place(-np.ones(1))
        self._patience = math.ceil(timeout * rate)
        self._silent, self._held = self._patience + 1, np.zeros(6)
        self._stopping = False
        self._inverse = numeric(self._robot, "inverse_kinematics")
        self._inverse.tier.fetch(at_any_cost=True)  # now, not in the middle of a motion
        self.phase = "home"
        self._set_pose()

    def stop(self) -> None:
        """Return home, whatever comes."""
        self._stopping = True

    @property
    def is_stopping(self) -> bool:
        """Whether the platform returns home for good."""
        return self._stopping

    @property
    def at_home(self) -> bool:
        """Whether the platform rests at home."""
        return self.phase == "home"

    def advance(self, sample: Array | None) -> Array:
        """Return the set points (n,) after a tick with the newest sample (6,), None without one."""
        if sample is None:
            self._silent += 1
        else:
            self._silent, self._held = 0, sample
        is_live = self._silent <= self._patience and not self._stopping
        at_middle = self._share.position[0] == 1.0
        if at_middle and is_live:
            self._cue()
        elif at_middle and not self._is_centered():
            self._return_to_middle()
        else:
            self._travel(is_live)
        self._set_pose()
        return self.joints

    def _cue(self) -> None:
        """Advance the filters, and the platform towards what they ask for."""
        if self.phase != "cueing":
            self._filter.reset()
            self._follower.retarget()
            self.phase = "cueing"
        target = compress(self._filter.advance(self._held), WITHIN * self._half)
        self._follower.advance(target[0], target[1])

    def _return_to_middle(self) -> None:
        """Advance the platform towards the middle of the box."""
        if self.phase != "returning":
            self._follower.retarget()
            self.phase = "returning"
        zero = np.zeros_like(self._half)
        self._follower.advance(zero, zero, _GENTLE)

    def _is_centered(self) -> bool:
        """Return whether the platform rests in the middle of the box; place it there if so."""
        follower = self._follower
        if (np.abs(follower.position) > _ARRIVED * self._half).any() or (
            np.abs(follower.velocity) > _ARRIVED * self._limits.speed
        ).any():
            return False
        follower.place(np.zeros_like(self._half))
        return True

    def _travel(self, is_live: bool) -> None:
        """Advance along the line between home and the middle."""
        end = 1.0 if is_live else -1.0
        if self.phase == "home" and not is_live:
            return
        phase = "starting" if is_live else "returning"
        if self.phase != phase:
            self._share.retarget()
            self.phase = phase
        share = self._share
        share.advance(np.full(1, end), np.zeros(1), _GENTLE)
        if abs(share.position[0] - end) <= _ARRIVED and abs(share.velocity[0]) <= _ARRIVED:
            share.place(np.full(1, end))
            self.phase = phase if is_live else "home"

    def _set_pose(self) -> None:
        """Compute the pose, its derivatives and the set points."""
        share, follower = self._share, self._follower
        offset = 0.5 * (share.position[0] - 1.0)
        self.pose = self._center + follower.position + offset * self._way
        self.velocity = follower.velocity + 0.5 * share.velocity[0] * self._way
        self.acceleration = follower.acceleration + 0.5 * share.acceleration[0] * self._way
        joints, _ = self._inverse(self.pose)
        self.joints = to_readings(self._robot, joints)

    pose: Array
    velocity: Array
    acceleration: Array
    joints: Array
    phase: str
