"""The state of a machine in the viewer, an immutable value, and the state after each action."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pteron.errors import DataError, PteronError, shorten
from pteron.kernels import Array
from pteron.kinematics import direct_kinematics, inverse_kinematics
from pteron.manipulator import Manipulator
from pteron.manipulator.variants import with_elbows
from pteron.motion import Motion
from pteron.motion.payload import add_payload as loaded_robot, payload_warning
from pteron.platforms.coordinates import SHOWN
from pteron.tolerances import SAME
from pteron.viewer.boundary import distance_text, follow_joints, is_allowed, stop_reason
from pteron.viewer.sliding import nearest_reachable_pose
from pteron.workspace import home_pose

_METRES = 3.0
"""Largest length, mm, up to which a hint asks whether it was typed in m."""


@dataclass(frozen=True, eq=False)
class ViewerState:
    """A machine at a pose, moving or at rest, with its payload.

    Attributes
    ----------
    robot : Manipulator
        The machine, in its working mode, without a payload.
    pose, velocity, acceleration : array, shape (m,)
        m, rad and s.
    payload : float
        At the tool's centre point, kg.
    message : str
        The reason why the last action was not done in full; else empty.
    """

    robot: Manipulator
    pose: Array
    velocity: Array
    acceleration: Array
    payload: float = 0.0
    message: str = ""

    @property
    def joints(self) -> Array:
        """The joint coordinates (n,), m or rad."""
        coordinates: Array = inverse_kinematics(self.robot, self.pose)
        return coordinates

    @property
    def robot_with_payload(self) -> Manipulator:
        """The machine with its payload."""
        return loaded_robot(self.robot, self.payload)

    @property
    def payload_doubt(self) -> str:
        """A sentence on why the payload is unlikely; empty if it is not."""
        doubt = payload_warning(self.robot, self.payload)
        return f"{doubt[:1].upper()}{doubt[1:]}"


def state_at_rest(robot: Manipulator, pose: Array | None = None) -> ViewerState:
    """Return a machine at rest in a pose, by default its home pose."""
    rest_pose = home_pose(robot) if pose is None else pose
    return ViewerState(robot, rest_pose, np.zeros_like(rest_pose), np.zeros_like(rest_pose))


def move_platform(state: ViewerState, target: Array) -> ViewerState:
    """Return the machine at rest at a pose (m,), or the nearest one that sliding reaches."""
    if not np.isfinite(target).all():
        return replace(state, message="The pose is to have finite numbers.")
    last, beyond = nearest_reachable_pose(state.robot, state.pose, target)
    if beyond is None:
        return _stop_at(state, target)
    distance = distance_text(state.robot, last, target)
    why = stop_reason(state.robot, beyond)
    return _stop_at(state, last, f"{why}. The platform is {distance} from the pose asked for.")


def move_joint(state: ViewerState, i: int, coordinate: float) -> ViewerState:
    """Return the machine with a joint, from 0, moved; the assembly mode is unchanged.

    It stops where a leg, a limit or the end of the assembly mode stops it.
    """
    joints = state.joints
    target = joints.copy()
    target[i] = coordinate
    last, beyond = follow_joints(state.robot, state.pose, joints, target)
    if beyond is None:
        return _stop_at(state, last)
    leg = state.robot.legs[i]
    why = stop_reason(state.robot, beyond if np.isfinite(beyond).all() else last)
    return _stop_at(state, last, f"{why}. The {leg.joint.noun} of leg {i + 1} stops there.")


def assembly_poses(state: ViewerState) -> Array:
    """Return the poses (K, m) with the same joint coordinates, in the robot's working mode."""
    try:
        poses = direct_kinematics(state.robot, state.joints, on_failure="nan")
    except PteronError:
        return state.pose[None]
    return np.asarray(poses[~np.isnan(poses).any(axis=-1)])


def current_assembly(state: ViewerState, poses: Array) -> int | None:
    """Return the index of the present pose among those of the assembly modes, or None."""
    differences = np.abs(poses - state.pose)
    around = np.abs((differences + np.pi) % (2.0 * np.pi) - np.pi)
    differences = np.where(state.robot.wraps, around, differences)
    near = np.flatnonzero((differences <= SAME).all(axis=-1))
    return int(near[0]) if len(near) else None


def switch_assembly(state: ViewerState, pose: Array) -> ViewerState:
    """Return the machine in another assembly mode, at a pose with the same joints."""
    if not is_allowed(state.robot, pose):
        why = stop_reason(state.robot, pose)
        return replace(state, message=f"This assembly mode is not possible. {why}.")
    return _stop_at(state, pose)


def switch_working_mode(state: ViewerState, elbows: Sequence[int]) -> ViewerState:
    """Return the machine with other elbow sides, at its pose or else at home."""
    robot = with_elbows(state.robot, elbows)
    other = replace(state, robot=robot)
    if is_allowed(robot, state.pose):
        return _stop_at(other, state.pose)
    try:
        home = home_pose(robot)
    except PteronError as error:
        return replace(state, message=f"This working mode is not possible: {error}")
    return _stop_at(other, home, "The pose is out of reach in this working mode: here is its home.")


def move_home(state: ViewerState) -> ViewerState:
    """Return the machine at rest in its home pose."""
    return _stop_at(state, home_pose(state.robot))


def load_payload(state: ViewerState, text: str) -> ViewerState:
    """Return the machine with a payload from a text, kg; an invalid one changes nothing."""
    try:
        mass = _number(text, "payload", "a mass of 0 kg or more")
        loaded_robot(state.robot, mass)
    except PteronError as error:
        return replace(state, message=f"{error}. The payload stays {state.payload:g} kg.")
    return replace(state, payload=mass, message="")


def typed_pose(robot: Manipulator, text: str) -> Array:
    """Return a pose from texts in the units of its coordinates, mm or degrees.

    Between numbers are blanks, semicolons or commas. Where blanks alone give the right count a
    comma within a number is its decimal sign, as where one number alone is typed.

    Examples
    --------
    >>> import pteron
    >>> robot = pteron.load("five-bar")
    >>> typed_pose(robot, "10 -20"), typed_pose(robot, "10,-20"), typed_pose(robot, "1,5; 20")
    (array([ 0.01, -0.02]), array([ 0.01, -0.02]), array([0.0015, 0.02  ]))
    """
    parts = (word.strip(",") for word in text.replace(";", " ").split())
    words = [word.replace(",", ".", 1) for word in parts if word]
    if len(words) != robot.freedom:
        words = text.replace(";", " ").replace(",", " ").split()
    names = " ".join(robot.coordinates)
    if len(words) != robot.freedom:
        raise DataError(
            f"pose: {len(words)} numbers given, {robot.freedom} expected: {names}, in "
            f"{pose_units(robot)}, with blanks or commas between them"
        )
    factors = pose_factors(robot)
    pairs = zip(words, robot.coordinates, strict=True)
    return np.array([_number(word, name, "a number") for word, name in pairs]) / factors


def metres_hint(robot: Manipulator, pose: Array) -> str:
    """Return a hint if lengths entered in mm are probably in m; else ""."""
    lengths = ~robot.platform.angular
    typed = 1e3 * pose[lengths]
    meant = np.where(lengths, 1e3 * pose, pose)
    if not 0.0 < np.abs(typed).max(initial=0.0) < _METRES or not is_allowed(robot, meant):
        return ""
    metres, millimetres = (" ".join(f"{x:g}" for x in np.round(v, 9)) for v in (typed, 1e3 * typed))
    return f"Lengths are typed in mm: is {metres} in m? That is {millimetres} here."


def pose_factors(robot: Manipulator) -> Array:
    """Return the factors (m,) from a pose in SI units to mm and degrees."""
    return np.array([SHOWN[unit][1] for unit in robot.units])


def pose_units(robot: Manipulator) -> str:
    """Return the units in which a pose is entered: "mm", "degrees" or "mm and degrees"."""
    words = {"m": "mm", "rad": "degrees"}
    return " and ".join(dict.fromkeys(words[unit] for unit in robot.units))


def _number(text: str, name: str, expected: str) -> float:
    """Return a text as a finite number; a `DataError` says what is expected."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        comma = "; write the decimal sign as a point" if "," in text else ""
        raise DataError(f"{name}: {shorten(text)} given, {expected} expected{comma}")
    return number


def state_in_motion(state: ViewerState, motion: Motion, time: float) -> ViewerState:
    """Return the machine's state in a motion at a time, s from its beginning."""
    pose, velocity, acceleration = motion.at(motion.time[0] + time)
    return replace(state, pose=pose, velocity=velocity, acceleration=acceleration, message="")


def stop_motion(state: ViewerState, message: str = "") -> ViewerState:
    """Return the machine at rest at its present pose."""
    return _stop_at(state, state.pose, message)


def _stop_at(state: ViewerState, pose: Array, message: str = "") -> ViewerState:
    """Return the state at rest at a pose, with a message."""
    zeros = np.zeros_like(pose)
    return replace(state, pose=pose, velocity=zeros, acceleration=zeros, message=message)
