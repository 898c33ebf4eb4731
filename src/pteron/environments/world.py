"""The world of a Gymnasium environment: starts, steps and rewards, for many machines at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from math import hypot
from operator import or_
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pteron.environments.state import Bools, EpisodeState, HostGenerators
from pteron.errors import DataError
from pteron.kernels import Array, as_array, numeric
from pteron.kinematics.sampling import holding_measures
from pteron.manipulator import Manipulator
from pteron.motion import Machines, Motion, advance
from pteron.motion.simulation.plant import drive_states
from pteron.workspace import pose_margins
from pteron.workspace.margins import MarginScales, margin_scales, margins_from

LEVER = 0.1
"""Length that counts as much as a radian in the distance between poses, m."""

SPEED, TURN = 10.0, 100.0
"""Speeds of the platform, m/s and rad/s, above which an episode ends."""

EFFORT = 0.01
"""Weight of the mean square of the action in the reward."""

ENDS = 0.02
"""Margin to singularities and limits (see `PoseMargins`) below which an episode ends."""

_ANGLE = np.pi / 4.0
"""Greatest angle of starts and targets from home, rad."""

_HALVINGS = 20
"""Halvings of the way from home along a coordinate until its poses have margin enough: 1e-6."""

_APART = 2.0
"""Least distance between start and target, in tolerances."""

_GREATEST = float(np.finfo(np.float32).max)
"""Bound of an observed number that has none: as Gymnasium's own environments have it."""

_DRAWS = 16
"""Random poses drawn for each start and target."""

_SHARES = (1.0, 0.5, 0.25, 0.125)
"""Shares of the way from home to random poses that are tried in turn."""


class Constants(NamedTuple):
    """Arrays of a `World` that do not change, see there; `levers` (m,) are `LEVER` of angles.

    `speeds` (m,), m/s and rad/s, are those above which an episode ends.
    """

    home: Array
    forces: Array
    bounds: Array
    levers: Array
    speeds: Array
    margins: MarginScales


@dataclass(frozen=True)
class World:
    """A machine whose drives' forces an agent sets at every sample, and the task of the agent.

    Attributes
    ----------
    robot : Manipulator
        The machine.
    home : array, shape (m,)
        The pose about which starts and targets are drawn, m and rad.
    forces : array, shape (n,)
        What an action of 1 gives: each drive's max_force, or, where the file has none, enough to
        hold the platform twice and to accelerate it along every coordinate at 20 m/s^2.
    period : float
        Time of an action, s.
    step : float
        Of the integration, s.
    count : int
        Steps of an action.
    spread : float
        Half the side of the box about home, m, in which starts and targets are, or less where the
        machine's travel is.
    tolerance : float
        Distance to the target that is a success, m.
    box : array, shape (2, m)
        Ways from home, m and rad, down and up along each coordinate, within which they are drawn.
    least : float
        Margin, see `pteron.workspace.PoseMargins`, of starts and targets.
    motion : Motion or None
        What is to be followed, again and again; None where a pose is to be reached.
    machines : Machines or None
        The machine of each episode, where they are not all the same.
    """

    robot: Manipulator
    home: Array
    forces: Array
    period: float
    step: float
    count: int
    spread: float
    tolerance: float
    least: float
    motion: Motion | None
    machines: Machines | None = None
    box: Array | None = None

    @cached_property
    def bounds(self) -> Array:
        """Greatest absolute value of each number of an observation, (4 m,).

        Coordinates whose joints have no limits, angles without limits and speeds are unbounded.
        """
        robot = self.robot
        reach = []
        for leg in robot.legs:
            travel = max(map(abs, leg.limits)) if leg.limits else _GREATEST
            slides = travel if leg.joint.unit == "m" else 0.0
            reach.append(hypot(*leg.guide_point) + leg.size + slides + hypot(*leg.platform_point))
        limits = robot.platform.angle_limits
        pose = [
            min(max(reach), _GREATEST)
            if not turns
            else max(map(abs, limits[name]), default=_GREATEST)
            if name in limits
            else _GREATEST
            for name, turns in zip(robot.coordinates, robot.platform.angular, strict=True)
        ]
        # The state that ends an episode may be beyond a limit: half as far again is told truly.
        most = np.minimum(1.5 * np.array(pose), _GREATEST)
        rate = np.full(robot.freedom, _GREATEST)
        return np.concatenate([most, rate, most, rate])

    def observations(self, state: EpisodeState) -> NDArray[np.float32]:
        """Return observations (..., 4 m): pose and velocity of platform and target."""
        parts = [state.pose, state.velocity, *self.target(state)]
        bounds = self._constants.bounds
        return np.clip(np.concatenate(parts, axis=-1), -bounds, bounds).astype(np.float32)

    def target(self, state: EpisodeState) -> tuple[Array, Array]:
        """Return pose and velocity of the targets, (..., m) each."""
        if self.motion is None:
            return state.target, np.zeros_like(state.target)
        return self._reference(np.mod(state.clock, self.motion.duration))

    def distance(self, state: EpisodeState) -> Array:
        """Return the distance (...), m, of machines from their targets.

        A radian counts `LEVER` m.
        """
        return self.metres(self.target(state)[0] - state.pose)

    def metres(self, differences: Array) -> Array:
        """Return the norms (...), m, of pose differences (..., m); a radian counts `LEVER` m."""
        scaled = differences * self._constants.levers
        metres: Array = np.sqrt((scaled**2).sum(axis=-1))
        return metres

    def travel(self, spread: float) -> Array:
        """Return how far each coordinate can go down and up from home, (2, m), with margin left.

        The values are at most `spread` or, for angles, `_ANGLE`.
        """
        most = np.where(self.robot.platform.angular, _ANGLE, spread)
        shares = np.concatenate([[0.0], 0.5 ** np.arange(_HALVINGS, -1, -1.0)])
        signs = np.array([-1.0, 1.0])
        ways = signs[:, None, None, None] * shares[:, None] * np.diag(most)[:, None, :]
        keeps = self.margin_of(self.home + ways) >= self.least  # (2, m, shares)
        last = np.logical_and.accumulate(keeps, axis=-1).sum(axis=-1) - 1
        return np.asarray(signs[:, None] * shares[np.maximum(last, 0)] * most)

    def start_episodes(
        self, generators: Sequence[np.random.Generator], options: Mapping[str, Any] | None
    ) -> EpisodeState:
        """Return the initial states (B, m) of episodes, one for each random generator.

        Raises
        ------
        DataError
            If an option is unknown, or a pose is none that the machine may have.
        """
        numbers = np.stack([rng.random(self.number_count) for rng in generators])
        return self.episodes_from(numbers, options)

    @property
    def number_count(self) -> int:
        """How many random numbers an episode's start takes."""
        return 2 * _DRAWS * self.robot.freedom + (self.motion is not None)

    def episodes_from(self, numbers: Array, options: Mapping[str, Any] | None) -> EpisodeState:
        """Return initial states (B, m) of episodes from random numbers in [0, 1), (B, K)."""
        poses_given = {key: self._pose(key, option) for key, option in (options or {}).items()}
        chosen = {key: self.array(pose) for key, pose in poses_given.items()}
        shape = (len(numbers), 2, _DRAWS, self.robot.freedom)
        draws = 2.0 * numbers[:, : 2 * _DRAWS * self.robot.freedom].reshape(shape) - 1.0
        poses = self._feasible_poses(draws[:, 0], None)
        targets = self._feasible_poses(draws[:, 1], chosen.get("pose", poses))
        velocity, clock = np.zeros_like(poses), np.zeros_like(poses[:, 0])
        if self.motion is not None:
            clock = self.motion.duration * numbers[:, -1]
            if "pose" not in chosen:
                poses, velocity = self._reference(clock)
        start_poses = np.broadcast_to(chosen.get("pose", poses), poses.shape)
        return EpisodeState(
            start_poses,
            velocity,
            self._drive_states(start_poses, velocity),
            np.broadcast_to(chosen.get("target", targets), poses.shape),
            clock,
        )

    def _feasible_poses(self, draws: Array, others: Array | None) -> Array:
        """Return a pose (m,) with sufficient margin from each row of draws (B, D, m) in [-1, 1).

        The pose is apart from the other poses (m,) or (B, m). If all draws lack margin, they are
        moved nearer to home; home if none has margin there.
        """
        down, up = self._box
        draws = np.where(draws < 0.0, -draws * down, draws * up)
        home = self._constants.home
        feasible = np.zeros_like(draws[:, 0]) + home
        missing = np.ones_like(draws[:, 0, 0], dtype=bool)
        for share in _SHARES:
            poses = home + share * draws
            is_valid: Any = self.margin_of(poses) >= self.least
            if others is not None:
                distances = self.metres(poses - others[..., None, :])
                is_valid = is_valid & (distances > _APART * self.tolerance)
            first = is_valid.argmax(axis=-1)[:, None, None]
            has = (missing & is_valid.any(axis=-1))[:, None]
            feasible = np.where(has, np.take_along_axis(poses, first, axis=1)[:, 0], feasible)
            missing = missing & ~has[:, 0]
            if not missing.any():
                break
        return feasible

    def margin_of(self, poses: Array) -> Array:
        """Return the singularity margins (...) of poses, negative beyond a singularity.

        It is one of type II, or of the legs' constraints.
        """
        smallest = margins_from(self._kernel, self._constants.margins, poses).least
        sides = self._sides.items()
        beyond = reduce(or_, (self._kernel(name)(poses)[0] * side < 0.0 for name, side in sides))
        return np.where(beyond, -np.abs(smallest), smallest)

    @cached_property
    def _sides(self) -> dict[str, float]:
        """The `holding_measures` at the home pose, whose signs margins refer to."""
        names = holding_measures(self.robot)
        return {name: float(numeric(self.robot, name)(self.home)[0]) for name in names}

    def _pose(self, key: str, option: Any) -> Array:
        """Return the pose (m,) in the option `key` of a reset; raise if it is not feasible."""
        if key not in ("pose", "target"):
            raise DataError(f"options: {key!r} is unknown; the valid ones are pose, target")
        if key == "target" and self.motion is not None:
            raise DataError("options: a target given, but the target follows the motion")
        pose = np.asarray(option, dtype=float)
        if pose.shape != (self.robot.freedom,) or not np.isfinite(pose).all():
            names = " ".join(self.robot.coordinates)
            raise DataError(f"options: {key} is {option!r}, {names} expected, m and rad")
        if self.margin_of(self.array(pose[None]))[0] <= ENDS:
            raise DataError(
                f"options: {key} {pose.tolist()} is out of reach, singular, or beyond the joints' "
                f"limits; choose one near home, {self.home.round(4).tolist()}"
            )
        return pose

    def advance(
        self, state: EpisodeState, action: Array
    ) -> tuple[EpisodeState, Array, Array, Bools]:
        """Apply an action (..., n) for a period; return states, distances, rewards and end flags.

        reward = 1 - tanh(2 distance / spread) - 0.01 mean(action^2), at most 1; -1 where the
        episode ends.

        Raises
        ------
        DataError
            If the action has another shape, or is not of finite numbers.
        """
        action = np.clip(self._action(action, state.pose.shape), -1.0, 1.0)
        pose, velocity, drives, going = self._advance(state, action * self._constants.forces)
        new = EpisodeState(pose, velocity, drives, state.target, state.clock + self.period)
        distance = self.distance(new)
        reward = 1.0 - np.tanh(2.0 * distance / self.spread)
        reward = reward - EFFORT * (action**2).mean(axis=-1)
        ended = ~going | (self.margin_of(pose) < ENDS)
        ended = ended | (np.abs(velocity) > self._constants.speeds).any(axis=-1)
        return new, distance, np.where(ended, -1.0, reward), ended

    # What depends on where the arrays are: `DeviceWorld` has these on a GPU.

    @cached_property
    def _constants(self) -> Constants:
        """The world's constant arrays."""
        angular = self.robot.platform.angular
        return Constants(
            home=self.array(self.home),
            forces=self.array(self.forces),
            bounds=self.array(self.bounds),
            levers=self.array(np.where(angular, LEVER, 1.0)),
            speeds=self.array(np.where(angular, TURN, SPEED)),
            margins=MarginScales(*map(self.array, margin_scales(self.robot))),
        )

    @cached_property
    def _box(self) -> Array:
        """The box of starts and targets about home, (2, m), m and rad."""
        box: Array = self.array(self.travel(self.spread) if self.box is None else self.box)
        return box

    def _kernel(self, what: str) -> Any:
        """Return the kernel of a function of the machine, by name."""
        return numeric(self.robot, what)

    def _reference(self, clock: Array) -> tuple[Array, Array]:
        """Return pose and velocity (..., m) of the motion at times (...) since its begin, s."""
        assert self.motion is not None
        return self.motion.at(self.motion.time[0] + clock)[:2]

    def _drive_states(self, pose: Array, velocity: Array) -> Array:
        """Return the states (..., K) of drives that bend or lag, as at zero acceleration."""
        return drive_states(self.robot, pose, velocity)

    def _advance(self, state: EpisodeState, forces: Array) -> tuple[Array, Array, Array, Bools]:
        """Return pose, velocity and drives of machines after a period, and which can go on."""
        pose, velocity, drives, going = advance(
            *(self.robot, state.pose, state.velocity, forces, self.step, self.count),
            machines=self.machines,
            drives=state.drives,
        )
        return pose, velocity, drives, np.asarray(going, dtype=bool)

    def _action_array(self, action: Any) -> Array:
        """Return an action as an array of double precision."""
        return as_array(action, "action", ())

    def array(self, numbers: Any) -> Any:
        """Return numbers as an array where the world's arrays are."""
        return np.asarray(numbers)

    def tensor(self, array: Any, library: str) -> Any:
        """Return an array as the user is given it."""
        return array

    def host_state(self, state: EpisodeState) -> EpisodeState:
        """Return a state in NumPy's arrays."""
        return state

    def generators(self, count: int) -> Any:
        """Return `count` random generators, to be put."""
        return HostGenerators(count)

    def _action(self, action: Any, shape: tuple[int, ...]) -> Array:
        """Return an action as an array (..., n); raise for a wrong shape or non-finite numbers."""
        action_array = self._action_array(action)
        if action_array.shape != shape:
            raise DataError(f"action: shape {action_array.shape} given, {shape} expected")
        if not np.isfinite(action_array).all():
            raise DataError("action: not finite numbers given; numbers from -1 to 1 expected")
        return action_array

    def end_reason(self, pose: Array, velocity: Array) -> str:
        """Return as text why a machine's episode ended in this last state (m,)."""
        if (np.abs(velocity) > self._constants.speeds).any():
            return f"faster than {SPEED:g} m/s or {TURN:g} rad/s"
        margins = pose_margins(self.robot, pose)
        leg = int(margins.type_i.argmin()) + 1
        if margins.constraint < ENDS:
            return "next to a constraint singularity: the legs hardly hold the platform"
        if self.margin_of(pose[None])[0] < 0.0 <= margins.least or margins.type_ii < ENDS:
            return "next to a singularity of type II: the actuators hardly hold the platform"
        if margins.joints.min() < ENDS <= margins.type_i.min():
            return f"leg {int(margins.joints.argmin()) + 1} is at its joint's limit"
        return f"leg {leg} is at the end of its reach"
