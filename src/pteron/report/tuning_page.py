"""The HTML page of a tuned controller: its gains, margins, Bode plot, poles and trials."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pteron.motion import Tuning
from pteron.motion.motion import told_pose
from pteron.plots import bode_figure, poles_figure
from pteron.report.typeset import template

if TYPE_CHECKING:
    import polars as pl


def tuning_page(tuning: Tuning, trials: pl.DataFrame) -> str:
    """Return the page of a tuning and its trials, as HTML without reference to another file."""
    robot, controller = tuning.robot, tuning.controller
    worst = tuning.margins[tuning.worst]
    moment = tuning.moments[tuning.worst]
    at = "In the workspace, at rest" if np.isnan(moment) else f"In the motion, at {moment:.3g} s"
    bandwidth = None if controller.bandwidth is None else float(np.max(controller.bandwidth))
    return template("tuning.html.j2").render(
        robot=robot,
        tuning=tuning,
        controller=controller,
        kind=controller.what.replace("_", " ").capitalize(),
        bandwidth=bandwidth,
        required=tuning.required,
        least=tuning.least,
        gains=tuning.gains(),
        each={
            name: np.min([getattr(one, name) for one in tuning.margins], axis=0)
            for name in ("gain", "phase", "delay")
        },
        where=f"{at}, at pose {told_pose(tuning.states[tuning.worst, 0])}.",
        figures={
            "bode": bode_figure(worst.frequencies, worst.drive_loops, robot.joint_names),
            "poles": poles_figure(worst.loop.poles),
        },
        trials=trials.to_dicts(),
        length="rad" if robot.platform.angular.all() else "m",
        degrees=180.0 / np.pi,
    )
