"""The viewer's controls as plain data for its page, and the actions that the page asks for."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from pteron.errors import DataError
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.platforms.coordinates import SHOWN
from pteron.report.motion_frames import view_frame
from pteron.report.typeset import fixed
from pteron.viewer.pushing import DRIVES
from pteron.viewer.session import SPEEDS, STANDARD, Session
from pteron.viewer.slices import BEYOND, SERVES, choices
from pteron.viewer.state import pose_factors, pose_units

_NO_MODE = "none of them"
"""The choice shown where the pose is in no assembly mode of the list."""


def controls(session: Session) -> dict[str, Any]:
    """Return what there is to move, choose and type; lengths in mm, angles in degrees."""
    robot, factors = session.state.robot, pose_factors(session.state.robot)
    home = " ".join(fixed(x, 0).replace("\u2212", "-") for x in factors * session.home)
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
        "modes": [signs(mode) for mode in session.modes()],
        "planes": list(choices(robot)),
        "slice": [[SERVES, "in reach"], [BEYOND, "beyond a joint's limit"]],
        "speeds": list(SPEEDS),
        "drives": list(DRIVES),
        "standard": STANDARD,
    }


def _sliders(names: Sequence[str], units: Sequence[str], ranges: Array) -> list[dict[str, Any]]:
    found = []
    for name, unit, (low, high) in zip(names, units, ranges.T, strict=True):
        word, factor = SHOWN[unit]
        least, most = np.floor(10.0 * factor * low) / 10.0, np.ceil(10.0 * factor * high) / 10.0
        span = {"least": float(least), "most": float(max(most, least + 0.1))}
        found.append({"name": name, "unit": word, **span})
    return found


def values(session: Session, joints: Array) -> dict[str, Any]:
    """Return where the controls stand."""
    state, motion = session.state, session.motion
    return {
        "where": _where(state.robot, state.pose),
        "label": _label(state.robot, state.pose),
        "pose": _tenths(pose_factors(state.robot) * state.pose),
        "joints": _tenths(np.array(shown_joints(state.robot, joints))),
        "payload": f"{state.payload:g}",
        "payloadDoubt": state.payload_doubt,
        "mode": signs(leg.elbow for leg in state.robot.legs),
        "screws": session.screws,
        "plane": session.plane,
        "speed": next(name for name, factor in SPEEDS.items() if factor == session.speed),
        "playing": session.playing,
        "pushing": session.push is not None,
        "preparing": session.preparing,
        "pushed": _pushed(session),
        "stiffness": session.push.stiffness if session.push else None,
        "time": session.time,
        "duration": motion.duration if motion else None,
        "title": session.title,
    }


def _where(robot: Manipulator, pose: Array) -> str:
    """Return a pose (m,) in a line, each unit once."""
    values, units = pose_factors(robot) * pose, (SHOWN[unit][0] for unit in robot.units)
    named = zip(robot.coordinates, values, units, strict=True)
    groups = groupby(((f"{name} {fixed(x)}", unit) for name, x, unit in named), lambda one: one[1])
    parts = ((" ".join(text for text, _ in group), unit) for unit, group in groups)
    return ", ".join(f"{text}{unit if unit == '°' else f' {unit}'}" for text, unit in parts)


def _label(robot: Manipulator, pose: Array) -> str:
    """Return a pose (m,) as the list of assembly modes has it."""
    parts = zip(pose_factors(robot) * pose, robot.platform.angular, strict=True)
    return " ".join(fixed(x) + "°" * bool(angle) for x, angle in parts)


def shown_joints(robot: Manipulator, joints: Array) -> list[float]:
    """Return joint coordinates (n,) in mm and degrees."""
    found: list[float] = (_joint_factors(robot) * joints).tolist()
    return found


def settled_values(session: Session, busy: Callable[[], bool]) -> dict[str, Any] | None:
    """Return what takes longer: assembly modes, and how far each slider may go from here.

    None if somebody acts meanwhile.
    """
    spans = session.spans(busy)
    if spans is None or busy():
        return None
    robot, factors = session.state.robot, pose_factors(session.state.robot)
    poses, now = session.assemblies()
    labels = [f"{k}: {_label(robot, pose)}" for k, pose in enumerate(poses, start=1)]
    pose_span, joint_span = spans
    return {
        "label": _label(robot, session.state.pose),
        "assemblies": labels if now is not None else [*labels, _NO_MODE],
        "assembly": len(labels) if now is None else now,
        "poseSpan": (factors * pose_span).tolist(),
        "jointSpan": (_joint_factors(robot) * joint_span).tolist(),
    }


def doing(session: Session) -> str:
    """Return what the machine does, in words."""
    name, state = session.state.robot.name, session.state
    if words := _pushed(session):
        return words
    if session.playing:
        return f"{name} moves: forces are those of the motion"
    moving = bool(state.velocity.any() or state.acceleration.any())
    return f"{name} {'at a moment of its motion' if moving else 'at rest'}"


def _pushed(session: Session) -> str:
    """Return what the machine does by itself, or is about to; empty where it does nothing."""
    if session.push is not None:
        return f"{session.push.does}. Pull at its platform."
    if session.preparing:
        return "Preparing the equations of motion: the first time takes some seconds."
    return ""


def action(session: Session, text: str) -> tuple[str, Callable[[], object]]:
    """Return the name of what a page asks for, JSON, and the action itself.

    Raises
    ------
    DataError
        If it is nothing that a page asks for.
    """
    try:
        asked = json.loads(text)
        name = asked["do"]
        found: tuple[str, Callable[[], object]] = _actions(session, asked)[name](asked)
        return found
    except (ValueError, KeyError, TypeError, IndexError, OverflowError, RecursionError):
        raise DataError("the page asked for something unknown; load it again") from None


def _actions(session: Session, asked: dict[str, Any]) -> dict[str, Any]:
    robot = session.state.robot

    def number(key: str) -> float:
        value = float(asked[key])
        if not np.isfinite(value):
            raise ValueError
        return value

    def place(count: int) -> int:
        i = int(asked["i"])
        if not 0 <= i < count:
            raise IndexError
        return i

    def point(key: str) -> Array:
        x, y, z = (float(value) for value in asked[key])
        if not np.isfinite([x, y, z]).all():
            raise ValueError
        return np.array([x, y, z]) @ view_frame(robot)

    def coordinate(_: Any) -> tuple[str, Callable[[], object]]:
        i = place(robot.freedom)
        value = number("value") / float(pose_factors(robot)[i])
        return f"pose{i}", lambda: session.set_coordinate(i, value)

    def joint(_: Any) -> tuple[str, Callable[[], object]]:
        i = place(robot.joint_count)
        value = number("value") / float(_joint_factors(robot)[i])
        return f"joint{i}", lambda: session.set_joint(i, value)

    def drag(_: Any) -> tuple[str, Callable[[], object]]:
        axis, to = None if asked["axis"] is None else int(asked["axis"]), point("to")
        if axis not in (None, 0, 1, 2):
            raise IndexError
        return "drag", lambda: session.drag(axis, to)

    def pull(_: Any) -> tuple[str, Callable[[], object]]:
        grip, to, stiffness = point("grip"), point("to"), number("stiffness")

        def act() -> None:
            if session.push is not None:
                session.push.stiffness = min(max(stiffness, 0.0), 1e6)
                session.push.pull(grip, to)

        return "pull", act

    def release(_: Any) -> tuple[str, Callable[[], object]]:
        def act() -> None:
            if session.push is not None:
                session.push.release()

        return "pull", act

    def assembly(_: Any) -> tuple[str, Callable[[], object]]:
        k = int(asked["i"])

        def act() -> None:
            poses = session.assemblies()[0]
            if 0 <= k < len(poses):
                session.set_assembly(poses[k])

        return "assembly", act

    def mode(_: Any) -> tuple[str, Callable[[], object]]:
        elbows = {signs(mode): mode for mode in session.modes()}[asked["mode"]]
        return "mode", lambda: session.set_working_mode(elbows)

    def speed(_: Any) -> tuple[str, Callable[[], object]]:
        factor = SPEEDS[asked["speed"]]
        return "speed", lambda: setattr(session, "speed", factor)

    def plane(_: Any) -> tuple[str, Callable[[], object]]:
        choices(robot)[name := asked["plane"]]
        return "plane", lambda: setattr(session, "plane", name)

    def seek(_: Any) -> tuple[str, Callable[[], object]]:
        time = number("time")

        def act() -> None:
            session.playing = False
            session.seek(time)

        return "time", act

    def plain(name: str, act: Callable[[], object]) -> Any:
        return lambda _: (name, act)

    return {
        "coordinate": coordinate,
        "joint": joint,
        "drag": drag,
        "pull": pull,
        "release": release,
        "assembly": assembly,
        "mode": mode,
        "speed": speed,
        "seek": seek,
        "type": plain("type", lambda: session.type_pose(str(asked["text"]))),
        "payload": plain("payload", lambda: session.set_payload(str(asked["text"]))),
        "home": plain("home", session.go_home),
        "screws": plain("screws", lambda: setattr(session, "screws", bool(asked["on"]))),
        "plane": plane,
        "undo": plain("undo", session.undo),
        "standard": plain("load", session.load_standard),
        "play": plain("play", lambda: session.play(on=bool(asked["on"]))),
        "step": plain("step", lambda: session.step(-1 if asked["back"] else 1)),
        "rest": plain("push", session.end_push),
    }


def _joint_factors(robot: Manipulator) -> Array:
    return np.array([SHOWN[leg.joint.unit][1] for leg in robot.legs])


def _tenths(array: Array) -> list[float]:
    found: list[float] = (np.round(array, 1) + 0.0).tolist()
    return found


def signs(mode: Any) -> str:
    """Return the sides of a working mode's elbows as signs."""
    return "".join("+" if side > 0 else "-" for side in mode)
