"""The HTML page of a tuned controller: its gains, margins, Bode plot, poles and trials."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pteron.controllers.feedback import Feedback
from pteron.manipulator import Manipulator
from pteron.motion import Tuning
from pteron.motion.trajectories.limits import limits_of
from pteron.plots import bode_figure, poles_figure
from pteron.report.quantities import readable
from pteron.report.typeset import template

if TYPE_CHECKING:
    import polars as pl

_KINDS = {
    "pd_gravity": "PD with gravity",
    "feed_forward_pd": "Feed-forward PD",
    "computed_torque": "Computed torque",
    "adaptive": "Adaptive",
    "adaptive_drives": "Adaptive, drives too",
}
"""Laws by name, as people read them."""


class _Changed(NamedTuple):
    """A quantity that trials vary: its heading, its column's head, {} for the unit, its factor."""

    heading: str
    column: str
    factor: float


_CHANGED = {
    "bandwidth": _Changed("bandwidths", "bandwidth (rad/s)", 1.0),
    "delay": _Changed("delays", "delay (ms)", 1e3),
    "encoder": _Changed("steps of the encoders", "step ({})", 1e6),
    "stiffness": _Changed("stiffnesses", "stiffness, over the file's", 1.0),
}


def tuning_page(tuning: Tuning, trials: pl.DataFrame) -> str:
    """Return the page of a tuning and its trials, as self-contained HTML."""
    robot, controller = tuning.robot, tuning.controller
    worst = tuning.margins[tuning.worst]
    moment = tuning.moments[tuning.worst]
    at = "In the workspace, at rest" if np.isnan(moment) else f"In the motion, at {moment:.3g} s"
    bandwidth = None if controller.bandwidth is None else float(np.max(controller.bandwidth))
    readings = " or ".join(dict.fromkeys(f"\u00b5{leg.joint.unit}" for leg in robot.legs))
    return template("tuning.html.j2", readable=readable).render(
        robot=robot,
        tuning=tuning,
        controller=controller,
        kind=_KINDS.get(controller.law_name, controller.law_name.replace("_", " ").capitalize()),
        bandwidth=bandwidth,
        required=tuning.required,
        least=tuning.least,
        gains=tuning.gains(),
        units=gain_units(tuning),
        forces=force_units(robot),
        each={
            name: np.min([getattr(margins, name) for margins in tuning.margins], axis=0)
            for name in ("gain", "phase", "delay")
        },
        at=at,
        pose=tuning.states[tuning.worst, 0],
        figures={
            "bode": bode_figure(worst.frequencies, worst.drive_loops, robot.joint_names),
            "poles": poles_figure(worst.loop.poles),
        },
        trials={
            name: [row for row in trials.to_dicts() if row["changed"] == name]
            for name in _CHANGED
            if len(trials) and name in trials["changed"]
        },
        changed={
            name: change._replace(column=change.column.format(readings))
            for name, change in _CHANGED.items()
        },
        length="rad" if robot.platform.angular.all() else "m",
        degrees=180.0 / np.pi,
    )


def gain_units(tuning: Tuning) -> list[str]:
    """Return the units of a joint's gains by kind; empty if joints differ."""
    units = {(leg.joint.force_unit, leg.joint.unit) for leg in tuning.robot.legs}
    if tuning.controller.law_name == "computed_torque":
        return ["1/s\u00b2", "1/s"]
    if len(units) > 1:
        return ["", ""]
    (force, unit) = units.pop()
    first = f"{force}/{unit}" if isinstance(tuning.controller, Feedback) else "1/s"
    return [first, f"{force} s/{unit}"]


def force_units(robot: Manipulator) -> list[str]:
    """Return the units of the trials' forces: shares if a drive's largest force is known."""
    known = zip(np.isfinite(limits_of(robot).force), robot.legs, strict=True)
    units = ("share" if sure else leg.joint.force_unit for sure, leg in known)
    return list(dict.fromkeys(units))
