"""Variables of the template of a page's moving picture: frames of the motion, speeds, words."""

from __future__ import annotations

from typing import Any

import numpy as np

from pteron.manipulator import Manipulator
from pteron.report.motion_frames import Frames, scene
from pteron.report.quantities import coordinate, force
from pteron.report.typeset import embed_json, resource
from pteron.tolerances import ROUNDING

_SHORT = 3.0
"""Duration, s, below which a motion is slowed down for the eye."""

_PACES = (
    (0.0, 0.1, "10 % of real speed"),
    (0.0, 0.4, "40 % of real speed"),
    (0.0, 1.0, "real time"),
    (10.0, 4.0, "4 times real speed"),
    (60.0, 16.0, "16 times real speed"),
)
"""Least duration of a motion, s, speed of its playback, and name of the speed."""


def stage(robot: Manipulator, shown: Frames, **words: str) -> dict[str, Any]:
    """Return the template's variables for the moving picture of a machine, without its pictures.

    The words are what the machine is `doing`, what the `still` picture shows, and the
    `force_title` over the forces of the moment.
    """
    joints, drawn = [leg.joint for leg in robot.legs], scene(robot, shown)
    return {
        "robot": robot,
        "shown": shown,
        "legs": range(len(robot.legs)),
        "grid": drawn["grid"],
        "force": force(joints),
        "coordinate": coordinate(joints),
        "gravity": gravity_words(robot),
        "paired": any(leg.bar for leg in robot.legs),
        "paces": [(pace, text) for least, pace, text in _PACES if shown.duration >= least],
        "pace": 0.4 if shown.duration < _SHORT else 1.0,
        "script": resource("picture.js") + resource("play.js"),
        "scene": embed_json(drawn),
        **words,
    }


def gravity_words(robot: Manipulator) -> str:
    """Return a clause on the direction of gravity in the picture of a planar machine."""
    gravity, frame = np.array(robot.gravity), np.array(robot.platform.frame)
    if not gravity.any():
        return "there is no gravity"
    x, y, _ = frame @ gravity / np.linalg.norm(gravity)
    if np.hypot(x, y) <= ROUNDING:
        return "gravity acts along the normal"
    return "gravity acts along the arrow"
