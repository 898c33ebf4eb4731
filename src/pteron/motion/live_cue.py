"""A live cue: set points of a simulator's drives, computed tick by tick from a vehicle's samples.

The filters are those of a recorded motion. A follower with limits of speed and acceleration stands
behind them, so that whatever the samples are the platform stays in a proved box, starts from home
along a proved line and returns there when samples stop.
"""

from __future__ import annotations

import math

import numpy as np

from pteron.errors import DataError
from pteron.kernels import Array, numeric
from pteron.manipulator import RobotLike, as_manipulator
from pteron.manipulator.readings import to_readings
from pteron.motion.cue_limits import CueLimits
from pteron.motion.cueing import WITHIN
from pteron.motion.follower import Follower
from pteron.motion.washout import Washout, WashoutFilter, compress

RATE = 250.0
"""Set points per second."""

TIMEOUT = 0.3
"""Time without a sample, s, after which the platform returns: 18 datagrams at 60 Hz."""

_GENTLE = 0.3
"""Share of the acceleration that starting and returning take."""

_CATCHING = 2.0
"""Time, s, in which the acceleration that following may take grows from `_GENTLE` to all."""

_ARRIVED = 1e-7
"""Distance, as a share of the way, at which a start or a return is complete."""


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
        self._stopping, self._effort = False, 1.0
        self._growth = (1.0 - _GENTLE) * step / _CATCHING
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
    def is_at_home(self) -> bool:
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
            # After a silence the platform is on its way back: it catches up gently.
            self._effort, self.phase = _GENTLE, "cueing"
        position, rate = compress(self._filter.advance(self._held), WITHIN * self._half)[:2]
        self._effort = min(self._effort + self._growth, 1.0)
        self._follower.advance(position, rate, self._effort)

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
