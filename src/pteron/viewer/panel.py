"""The viewer's controls as plain data for its page, and the actions that the page asks for."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from typing import Any

import numpy as np

from pteron.errors import DataError
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.manipulator.variants import elbow_signs, elbows_of
from pteron.platforms.coordinates import SHOWN
from pteron.report.motion_frames import view_frame
from pteron.report.typeset import format_fixed
from pteron.viewer.pushing import DRIVES
from pteron.viewer.session import SPEEDS, STANDARD, Session
from pteron.viewer.slices import BEYOND, SERVES, choices
from pteron.viewer.state import pose_factors, pose_units

_Action = tuple[str, Callable[[], object]]
"""The name of an action, which undoing goes by, and the action."""

_NO_MODE = "none of them"
"""The choice shown where the pose is in no assembly mode of the list."""


def controls(session: Session) -> dict[str, Any]:
    """Return the controls of the page as plain data; lengths in mm, angles in degrees."""
    robot, factors = session.state.robot, pose_factors(session.state.robot)
    home = " ".join(format_fixed(x, 0).replace("\u2212", "-") for x in factors * session.home)
    units = [leg.joint.unit for leg in robot.legs]
    names = [f"{leg.joint.noun} {i}" for i, leg in enumerate(robot.legs, start=1)]
    return {
        "name": robot.name,
        "coordinates": _sliders(robot.coordinates, robot.units, session.pose_range),
        "joints": _sliders(names, units, session.joint_range),
        "forceUnits": [leg.joint.force_unit for leg in robot.legs],
        "lengths": len(robot.platform.lengths),
        "angles": len(robot.platform.angles),
        "hint": f"{' '.join(robot.coordinates)} in {pose_units(robot)}, such as {home}",
        "modes": [elbow_signs(mode) for mode in session.modes()],
        "planes": list(choices(robot)),
        "slice": [[SERVES, "in reach"], [BEYOND, "beyond a joint's limit"]],
        "speeds": list(SPEEDS),
        "drives": list(DRIVES),
        "standard": STANDARD,
    }


def _sliders(names: Sequence[str], units: Sequence[str], ranges: Array) -> list[dict[str, Any]]:
    """Return sliders for ranges (2, k) of quantities, in display units."""
    sliders = []
    for name, unit, (low, high) in zip(names, units, ranges.T, strict=True):
        word, factor = SHOWN[unit]
        least, most = np.floor(10.0 * factor * low) / 10.0, np.ceil(10.0 * factor * high) / 10.0
        span = {"least": float(least), "most": float(max(most, least + 0.1))}
        sliders.append({"name": name, "unit": word, **span})
    return sliders


def values(session: Session, joints: Array) -> dict[str, Any]:
    """Return the values of the controls, in mm and degrees."""
    state, motion = session.state, session.motion
    return {
        "where": _pose_text(state.robot, state.pose),
        "label": _label(state.robot, state.pose),
        "pose": _tenths(pose_factors(state.robot) * state.pose),
        "joints": _tenths(np.array(joints_in_display_units(state.robot, joints))),
        "payload": f"{state.payload:g}",
        "payloadDoubt": state.payload_doubt,
        "mode": elbow_signs(elbows_of(state.robot)),
        "screws": session.screws,
        "plane": session.plane,
        "speed": next(name for name, factor in SPEEDS.items() if factor == session.speed),
        "playing": session.playing,
        "pushing": session.push is not None,
        "preparing": session.preparing,
        "pushed": _push_text(session),
        "stiffness": session.push.stiffness if session.push else None,
        "time": session.time,
        "duration": motion.duration if motion else None,
        "title": session.title,
    }


def _pose_text(robot: Manipulator, pose: Array) -> str:
    """Return the text of a pose (m,), each unit named once."""
    coordinates, units = pose_factors(robot) * pose, (SHOWN[unit][0] for unit in robot.units)
    named = zip(robot.coordinates, coordinates, units, strict=True)
    groups = groupby(
        ((f"{name} {format_fixed(x)}", unit) for name, x, unit in named), lambda pair: pair[1]
    )
    parts = ((" ".join(text for text, _ in group), unit) for unit, group in groups)
    return ", ".join(f"{text}{unit if unit == '°' else f' {unit}'}" for text, unit in parts)


def _label(robot: Manipulator, pose: Array) -> str:
    """Return the label of a pose (m,) in the list of assembly modes."""
    parts = zip(pose_factors(robot) * pose, robot.platform.angular, strict=True)
    return " ".join(format_fixed(x) + "°" * bool(angle) for x, angle in parts)


def joints_in_display_units(robot: Manipulator, joints: Array) -> list[float]:
    """Return joint coordinates (n,) in mm and degrees."""
    coordinates: list[float] = (_joint_factors(robot) * joints).tolist()
    return coordinates


def span_values(session: Session, busy: Callable[[], bool]) -> dict[str, Any]:
    """Return the sliders' spans at this pose; those of joints are None if `busy` says so."""
    robot, joint_span = session.state.robot, session.joint_spans(busy)
    return {
        "pose": (pose_factors(robot) * session.pose_spans()).tolist(),
        "joint": None if joint_span is None else (_joint_factors(robot) * joint_span).tolist(),
    }


def assembly_values(session: Session) -> dict[str, Any]:
    """Return the list of assembly modes at this pose, which are slow to compute."""
    robot, (poses, now) = session.state.robot, session.assemblies()
    labels = [f"{k}: {_label(robot, pose)}" for k, pose in enumerate(poses, start=1)]
    return {
        "label": _label(robot, session.state.pose),
        "assemblies": labels if now is not None else [*labels, _NO_MODE],
        "assembly": len(labels) if now is None else now,
    }


def activity_text(session: Session) -> str:
    """Return a sentence on what the machine does."""
    name, state = session.state.robot.name, session.state
    if words := _push_text(session):
        return words
    if session.playing:
        return f"{name} moves: forces are those of the motion"
    moving = bool(state.velocity.any() or state.acceleration.any())
    return f"{name} {'at a moment of its motion' if moving else 'at rest'}"


def _push_text(session: Session) -> str:
    """Return the text of a push or of its preparation; empty without one."""
    if session.push is not None:
        return f"{session.push.does}. Pull at its platform."
    if session.preparing:
        return "Preparing the equations of motion: the first time takes some seconds."
    return ""


def action(session: Session, text: str) -> _Action:
    """Return name and action that a page's JSON request stands for.

    Raises
    ------
    DataError
        If it is nothing that a page asks for.
    """
    try:
        fields = json.loads(text)
        return _ACTIONS[fields["do"]](_Request(session, fields))
    except (ValueError, KeyError, TypeError, IndexError, OverflowError, RecursionError):
        raise DataError("the page asked for something unknown; load it again") from None


@dataclass(frozen=True)
class _Request:
    """A request of a page: its JSON fields, and the session it applies to.

    Methods return the name of an action, which undoing goes by, and the action.
    """

    session: Session
    fields: dict[str, Any]

    @property
    def robot(self) -> Manipulator:
        """The machine that the page shows."""
        return self.session.state.robot

    def number(self, key: str) -> float:
        """Return a finite number."""
        number = float(self.fields[key])
        if not np.isfinite(number):
            raise ValueError
        return number

    def index(self, count: int) -> int:
        """Return the place of a slider among `count`."""
        i = int(self.fields["i"])
        if not 0 <= i < count:
            raise IndexError
        return i

    def point(self, key: str) -> Array:
        """Return a point (3,) of the picture in the base frame, m."""
        x, y, z = (float(coordinate) for coordinate in self.fields[key])
        if not np.isfinite([x, y, z]).all():
            raise ValueError
        return np.array([x, y, z]) @ view_frame(self.robot)

    def coordinate(self) -> _Action:
        """Return the action that sets a coordinate of the pose."""
        i = self.index(self.robot.freedom)
        amount = self.number("value") / float(pose_factors(self.robot)[i])
        return f"pose{i}", lambda: self.session.set_coordinate(i, amount)

    def joint(self) -> _Action:
        """Return the action that sets a joint's coordinate."""
        i = self.index(self.robot.joint_count)
        amount = self.number("value") / float(_joint_factors(self.robot)[i])
        return f"joint{i}", lambda: self.session.set_joint(i, amount)

    def drag(self) -> _Action:
        """Return the action that drags the platform to a point, along an axis or freely."""
        axis = None if self.fields["axis"] is None else int(self.fields["axis"])
        to = self.point("to")
        if axis not in (None, 0, 1, 2):
            raise IndexError
        return "drag", lambda: self.session.drag(axis, to)

    def pull(self) -> _Action:
        """Return the action that pulls the platform by a spring from a grip to a point."""
        grip, to, stiffness = self.point("grip"), self.point("to"), self.number("stiffness")

        def act() -> None:
            """Pull the platform from the grip to the point; the stiffness is 0 to 1e6 N/m."""
            push = self.session.push
            if push is not None:
                push.stiffness = min(max(stiffness, 0.0), 1e6)
                push.pull(grip, to)

        return "pull", act

    def release(self) -> _Action:
        """Return the action that releases the spring."""

        def act() -> None:
            """Release the spring."""
            if self.session.push is not None:
                self.session.push.release()

        return "pull", act

    def assembly(self) -> _Action:
        """Return the action that goes to an assembly of the legs, by its number."""
        k = int(self.fields["i"])

        def act() -> None:
            """Set the session to the assembly of this number, if there are enough."""
            poses = self.session.assemblies()[0]
            if 0 <= k < len(poses):
                self.session.set_assembly(poses[k])

        return "assembly", act

    def mode(self) -> _Action:
        """Return the action that sets the working mode."""
        elbows = {elbow_signs(mode): mode for mode in self.session.modes()}[self.fields["mode"]]
        return "mode", lambda: self.session.set_working_mode(elbows)

    def speed(self) -> _Action:
        """Return the action that sets the speed of playback."""
        factor = SPEEDS[self.fields["speed"]]
        return "speed", lambda: setattr(self.session, "speed", factor)

    def plane(self) -> _Action:
        """Return the action that chooses the plane of the slice or map."""
        choices(self.robot)[name := self.fields["plane"]]
        return "plane", lambda: setattr(self.session, "plane", name)

    def seek(self) -> _Action:
        """Return the action that stops playback and seeks a time, s."""
        time = self.number("time")

        def act() -> None:
            """Stop playback and seek the time."""
            self.session.playing = False
            self.session.seek(time)

        return "time", act


_ACTIONS: dict[str, Callable[[_Request], _Action]] = {
    "coordinate": _Request.coordinate,
    "joint": _Request.joint,
    "drag": _Request.drag,
    "pull": _Request.pull,
    "release": _Request.release,
    "assembly": _Request.assembly,
    "mode": _Request.mode,
    "speed": _Request.speed,
    "seek": _Request.seek,
    "plane": _Request.plane,
    "type": lambda r: ("type", partial(r.session.type_pose, str(r.fields["text"]))),
    "payload": lambda r: ("payload", partial(r.session.set_payload, str(r.fields["text"]))),
    "home": lambda r: ("home", r.session.go_home),
    "screws": lambda r: ("screws", partial(setattr, r.session, "screws", bool(r.fields["on"]))),
    "undo": lambda r: ("undo", r.session.undo),
    "standard": lambda r: ("load", r.session.load_standard),
    "play": lambda r: ("play", partial(r.session.play, on=bool(r.fields["on"]))),
    "step": lambda r: ("step", partial(r.session.step, -1 if r.fields["back"] else 1)),
    "rest": lambda r: ("push", r.session.end_push),
}
"""The requests that a page may send, by their field `do`."""


def _joint_factors(robot: Manipulator) -> Array:
    """Return the factors (n,) from joint coordinates, m or rad, to display units."""
    return np.array([SHOWN[leg.joint.unit][1] for leg in robot.legs])


def _tenths(array: Array) -> list[float]:
    """Return an array as a list, rounded to tenths."""
    rounded: list[float] = (np.round(array, 1) + 0.0).tolist()
    return rounded
