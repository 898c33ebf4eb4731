"""The session of one viewer: a machine's state, the motion that plays, and every action on them.

It knows nothing of a browser, and runs in one thread.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from pteron.dynamics import drive_forces
from pteron.errors import DataError, ModelError, warn_unlikely
from pteron.kernels import Array
from pteron.kinematics import inverse_kinematics, random_poses
from pteron.manipulator import Manipulator
from pteron.manipulator.variants import mode_elbows
from pteron.motion import Motion, pick_and_place
from pteron.motion.payload import payload_warning
from pteron.motion.trajectories.checks import check_motion
from pteron.platforms.nearest_pose import pose_nearest_frame
from pteron.viewer.boundary import follow_joints, is_allowed
from pteron.viewer.motion_files import motion_of_file
from pteron.viewer.pushing import DRIVES, Push
from pteron.viewer.slices import NONE
from pteron.viewer.state import (
    ViewerState,
    assembly_poses,
    current_assembly,
    load_payload,
    metres_hint,
    move_home,
    move_joint,
    move_platform,
    state_at_rest,
    state_in_motion,
    stop_motion,
    switch_assembly,
    switch_working_mode,
    typed_pose,
)
from pteron.workspace import bounding_box

SPEEDS = {"1/10": 0.1, "1/4": 0.25, "1/2": 0.5, "real time": 1.0, "2 x": 2.0}
"""Speeds of playback by name; 1 is real time."""

STANDARD = "standard pick-and-place cycle"
"""Name of the standard cycle as people read it."""

_DRAWN = 200
"""Number of random poses from which the sliders' ranges are taken."""

_MARGIN = 0.08
"""Share by which the range of poses is extended for sliders."""

_RIM = 0.05
"""Share by which the range of joint coordinates is extended for sliders."""

_KEPT = 200
"""Most states that can be undone."""

_ALONG = 241
"""Poses along each coordinate at which it is tested whether the platform may go there."""

_FRAME = 1.0 / 60.0
"""Time of a step of a motion, s."""


class Session:
    """State of a viewer session: pose, playback, pushes, and the actions on them.

    Attributes
    ----------
    state : ViewerState
        The machine now.
    motion : Motion or None
        What may be played, and its `title`.
    time : float
        Where in the motion the machine is, s from its beginning.
    playing : bool
    speed : float
        Seconds of the motion in one second.
    push : Push or None
        The machine's own motion, while somebody may pull at it.
    preparing : bool
        Whether its equations are being compiled.
    screws : bool
        Whether joint axes are shown, and `plane`, the name of the slice that is.
    """

    def __init__(self, robot: Manipulator, payload: float = 0.0) -> None:
        self._first = robot
        self.state = state_at_rest(robot)
        if payload:
            self.state = load_payload(self.state, repr(payload))
            if self.state.message:
                raise DataError(f"payload: {payload!r} given, a mass of 0 kg or more expected")
            if self.state.payload_doubt:
                warn_unlikely(payload_warning(robot, payload))
        self.motion: Motion | None = None
        self.title = ""
        self.time, self.playing, self.speed = 0.0, False, 1.0
        self.push: Push | None = None
        self.preparing = False
        self.screws, self.plane = False, NONE
        self._undo_states = list[ViewerState]()
        self._set_ranges()

    def _set_ranges(self) -> None:
        """Set the sliders' ranges, and random poses in reach, of this working mode."""
        robot, home = self.state.robot, self.state.pose
        self.home = home
        self.examples = home[None]
        with suppress(ModelError):
            drawn = random_poses(robot, _DRAWN, type_i=0.0, type_ii=0.0)
            # Some may be so near to a singular pose that they have no joint coordinates.
            known = np.isfinite(inverse_kinematics(robot, drawn, on_failure="nan")).all(axis=-1)
            self.examples = np.vstack([home, drawn[known]])
        lengths, platform = ~robot.platform.angular, robot.platform
        low, high = self.examples.min(axis=0), self.examples.max(axis=0)
        if lengths.any():
            with suppress(ModelError):  # guides without limits: a reach without end
                low[lengths], high[lengths] = bounding_box(robot, home)
        margin = _MARGIN * (high - low)
        low, high = low - margin, high + margin
        if platform.rotation_axes:
            # Beyond it the same orientations come again.
            most, turns = platform.angle_range, ~lengths
            whole_turn = platform.turning_axis is not None
            low[turns] = -most if whole_turn else np.maximum(low[turns], -most)
            high[turns] = most if whole_turn else np.minimum(high[turns], most)
            for name, limits in platform.angle_limits.items():
                i = platform.coordinates.index(name)
                low[i], high[i] = limits
        self.pose_range = np.array([low, high])
        joints = inverse_kinematics(robot, self.examples)
        low, high = joints.min(axis=0), joints.max(axis=0)
        rim = _RIM * (high - low)
        for i, leg in enumerate(robot.legs):
            free = (-np.pi, np.pi) if leg.goes_round else (low[i] - rim[i], high[i] + rim[i])
            low[i], high[i] = leg.limits or free
        self.joint_range = np.array([low, high])

    # What people do.

    def remember(self) -> None:
        """Save the state for `undo`."""
        if not self.playing and self.push is None:
            self._undo_states = [*self._undo_states[-_KEPT:], self.state]

    def undo(self) -> None:
        """Restore the state before the last action."""
        if not self._undo_states:
            self.state = stop_motion(self.state, "There is nothing to undo.")
            return
        self._end_motion()
        was = self._undo_states.pop()
        if was.robot != self.state.robot:
            self.state = move_home(was)
            self._set_ranges()
        self.state = stop_motion(was)

    def set_coordinate(self, i: int, coordinate: float) -> None:
        """Move the platform along one of its pose's coordinates, from 0, to a value in m or rad."""
        target = self.state.pose.copy()
        target[i] = coordinate
        self.set_pose(target)

    def set_pose(self, target: Array) -> None:
        """Move the platform to a pose (m,), or to the nearest reachable one."""
        self._end_motion()
        self.state = move_platform(self.state, target)

    def drag(self, axis: int | None, point: Array) -> None:
        """Move P to a point (3,), m, or turn the platform to point an axis at it."""
        platform, target = self.state.robot.platform, self.state.pose.copy()
        if axis is None:
            target[~platform.angular] = platform.directions @ point
        elif platform.angles:
            place, axes = platform.placement(target)
            turned = axes @ _rotation(axes[axis], point - place).T
            target = pose_nearest_frame(platform, target, turned)
        self.set_pose(target)

    def type_pose(self, text: str) -> None:
        """Move the platform to a pose entered in mm or degrees, by coordinate."""
        pose = typed_pose(self.state.robot, text)
        self.set_pose(pose)
        if hint := metres_hint(self.state.robot, pose):
            self.state = replace(self.state, message=f"{hint} {self.state.message}".strip())

    def set_joint(self, i: int, coordinate: float) -> None:
        """Move one joint, from 0, to a value in m or rad."""
        self._end_motion()
        self.state = move_joint(self.state, i, coordinate)

    def set_payload(self, text: str) -> None:
        """Set the payload from a text, kg."""
        self.state = load_payload(self.state, text)

    def go_home(self) -> None:
        """Move the platform to its home pose."""
        self._end_motion()
        self.state = move_home(self.state)

    def modes(self) -> list[tuple[int, ...]]:
        """Return the signs of every working mode."""
        return mode_elbows(self._first)

    def set_working_mode(self, elbows: Sequence[int]) -> bool:
        """Set the elbows' sides; return whether the machine has changed."""
        last_robot = self.state.robot
        self._end_motion()
        self.state = switch_working_mode(self.state, elbows)
        if self.state.robot == last_robot:
            return False
        state, dropped = self.state, self.motion is not None
        self.motion, self.title, self.time = None, "", 0.0
        # Ranges are those about the mode's home.
        home = move_home(state)
        self.state = home
        self._set_ranges()
        message = state.message
        if dropped:
            message = f"{message} The motion was of another working mode; load it again.".strip()
        self.state = stop_motion(state, message)
        return True

    def assemblies(self) -> tuple[Array, int | None]:
        """Return poses (K, m) with the present joint coordinates, and the present index."""
        poses = assembly_poses(self.state)
        return poses, current_assembly(self.state, poses)

    def set_assembly(self, pose: Array) -> None:
        """Move to another pose with the same joint coordinates."""
        self._end_motion()
        self.state = switch_assembly(self.state, pose)

    def _end_motion(self) -> None:
        """Stop playback and a push."""
        self.playing, self.push = False, None

    # What moves by itself.

    def prepare_push(self, drives: str) -> Push:
        """Return the push simulation of the machine; the first compilation takes seconds."""
        if drives not in DRIVES:
            raise DataError(f"drives: {drives!r} given, one of {', '.join(DRIVES)} expected")
        return Push(self.state.robot_with_payload, self.state.pose, drives)

    def begin_push(self, drives: str) -> None:
        """Begin the dynamic simulation at the present pose."""
        self.playing, self.push = False, self.prepare_push(drives)
        self.state = stop_motion(self.state)

    def end_push(self) -> None:
        """Stop the dynamic simulation, at rest at the present pose."""
        self.push = None
        self.state = stop_motion(self.state)

    def load(self, name: str, content: bytes) -> None:
        """Load a motion from a file's name and content; playback starts at its beginning."""
        motion = motion_of_file(self.state.robot, name, content, self.state.pose)
        self.take(motion, name)

    def load_standard(self) -> None:
        """Load the standard pick-and-place cycle about the home pose."""
        self.take(pick_and_place(self.state.robot, self.home), STANDARD)

    def take(self, motion: Motion, title: str) -> None:
        """Load a motion, checked to be feasible for the machine."""
        check_motion(self.state.robot, motion)
        self.push = None
        self.motion, self.title = motion, title
        self.playing = True
        self.seek(0.0)

    def play(self, *, on: bool) -> None:
        """Start or pause playback."""
        if self.motion is None:
            self.state = stop_motion(self.state, "There is no motion to play: load one first.")
            return
        self.push, self.playing = None, on

    def step(self, count: int) -> None:
        """Advance, or go back, by a number of sixtieths of a second of the motion."""
        self.playing = False
        self.seek(self.time + count * _FRAME)

    def seek(self, time: float) -> None:
        """Go to a time of the motion, s."""
        if self.motion is not None:
            self.time = min(max(time, 0.0), self.motion.duration)
            self.state = state_in_motion(self.state, self.motion, self.time)

    def advance(self, elapsed: float) -> None:
        """Advance playback by a time of the clock, s; the motion repeats at its end."""
        if self.push is not None:
            self.push.go(self.speed * elapsed)
            message = f"{self.push.stops}." if self.push.stops else ""
            pose, velocity = self.push.pose, self.push.velocity
            self.state = replace(self.state, pose=pose, velocity=velocity, message=message)
        elif self.motion is not None and self.playing:
            self.seek((self.time + self.speed * elapsed) % (self.motion.duration or 1.0))

    # What is shown.

    def pose_spans(self) -> Array:
        """Return the free range of each coordinate from here (2, m)."""
        robot, pose = self.state.robot, self.state.pose
        ends = np.array([pose, pose])
        for i, (low, high) in enumerate(self.pose_range.T):
            for row, end in enumerate((low, high)):
                line = np.tile(pose, (_ALONG, 1))
                line[:, i] = np.linspace(pose[i], end, _ALONG)
                free = is_allowed(robot, line)
                ends[row, i] = line[-1 if free.all() else max(0, int(free.argmin()) - 1), i]
        return ends

    def joint_spans(self, busy: Callable[[], bool] = lambda: False) -> Array | None:
        """Return the free range of each joint from here (2, n); None as soon as `busy` says so."""
        robot, pose = self.state.robot, self.state.pose
        joints = self.state.joints
        joint_ends = np.array([joints, joints])
        for i in range(len(joints)):
            for row in range(2):
                if busy():
                    return None
                target = joints.copy()
                target[i] = self.joint_range[row, i]
                last = follow_joints(robot, pose, joints, target)[0]
                joint_ends[row, i] = inverse_kinematics(robot, last)[i]
        return joint_ends

    def force_scale(self) -> Array:
        """Return the force of each drive, (n,), that has the standard arrow length.

        The largest of the motion, or at rest in the home pose; legs of one unit share a scale.
        """
        loaded = self.state.robot_with_payload
        zeros = np.zeros_like(self.home)
        states = [(self.home, zeros, zeros)]
        if self.motion is not None:
            states += list(
                zip(self.motion.pose, self.motion.velocity, self.motion.acceleration, strict=True)
            )
        pose, velocity, acceleration = (np.array(part) for part in zip(*states, strict=True))
        forces = drive_forces(loaded, pose, velocity, acceleration, on_failure="nan")
        sizes = np.nan_to_num(np.abs(forces)).max(axis=0)
        units = np.array([leg.joint.force_unit for leg in loaded.legs])
        return np.array([sizes[units == unit].max() or 1.0 for unit in units])


def _rotation(start: Array, end: Array) -> Array:
    """Return the smallest rotation (3, 3) from one direction to another."""
    a, b = start / np.linalg.norm(start), end / max(float(np.linalg.norm(end)), 1e-12)
    normal, cosine = np.cross(a, b), float(a @ b)
    if cosine < -1.0 + 1e-9:
        return np.eye(3)
    cross = np.array(
        [[0, -normal[2], normal[1]], [normal[2], 0, -normal[0]], [-normal[1], normal[0], 0]]
    )
    return np.asarray(np.eye(3) + cross + cross @ cross / (1.0 + cosine))
