"""A tuned machine simulated: errors, forces and energy as its loop or its drives change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pteron.arguments import expect
from pteron.controllers import Controller
from pteron.errors import DataError, PteronError
from pteron.kernels import Array
from pteron.legs import Drive
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import Motion
from pteron.motion.simulation import Sensors, Simulation, simulate
from pteron.motion.trajectories.limits import limits_of
from pteron.motion.trajectories.tool import tool_path
from pteron.result import Result

if TYPE_CHECKING:
    import polars as pl

_REST = 0.2
"""Time that a motion's last pose is held in a trial, s."""

_SETTLED = 0.02
"""Distance from the last pose that counts as settled, as a share of the greatest error."""

_LEAST = 1e-6
"""The least such distance, m or rad."""


_UNKNOWN = (float("nan"),) * 7
"""Figures of a trial that did not come to its end."""


@dataclass(frozen=True, eq=False, repr=False)
class GainTrial(Result):
    """Figures of a machine's motion under a controller, and of the rest at its end.

    Attributes
    ----------
    error, rms_error : float
        Greatest and root mean square distance of the tool from where it is to be, m (rad of a
        machine that only turns), in the motion.
    settling : float
        Time from the motion's end until the tool stays within 2 % of the greatest error, or 1 um,
        of where it comes to rest, s; NaN where it does not in 0.2 s.
    overshoot : float
        How far it goes beyond the last place along the way it came, m or rad.
    peak_force, rms_force : float
        The greatest of the drives', as shares of their `max_force`; without it, N or N m.
    energy : float
        What the drives give, J; what they take back by braking is not taken off.
    stopped : str
        Why the trial ended early, with no figures then; else empty.
    """

    error: float
    rms_error: float
    settling: float
    overshoot: float
    peak_force: float
    rms_force: float
    energy: float
    stopped: str


def trial(
    robot: RobotLike,
    motion: Motion,
    controller: Controller,
    *,
    model: RobotLike | None = None,
    sensors: Sensors | None = None,
    delay: float = 0.0,
) -> GainTrial:
    """Simulate a motion and the rest at its end; return errors, forces and energy as a trial.

    The parameters, and the errors raised, are those of `simulate`.
    """
    robot = as_manipulator(robot)
    simulation = simulate(
        robot,
        motion,
        controller,
        duration=motion.duration + _REST,
        model=model,
        sensors=sensors,
        delay=delay,
    )
    if simulation.stopped:
        return GainTrial(*_UNKNOWN, simulation.stopped)
    moving = simulation.time <= motion.duration
    off = _tool_places(robot, simulation.pose) - _tool_places(robot, simulation.reference.pose)
    errors = np.linalg.norm(off, axis=-1)
    most = limits_of(robot).force
    shares = simulation.forces / np.where(np.isfinite(most), most, 1.0)
    power = np.maximum(simulation.forces * simulation.motor_rates, 0.0).sum(axis=-1)
    return GainTrial(
        float(errors[moving].max()),
        float(np.sqrt((errors[moving] ** 2).mean())),
        *_settling_figures(simulation, motion, off, moving),
        float(np.abs(shares).max()),
        float(np.sqrt((shares**2).mean(axis=0)).max()),
        float(np.trapezoid(power, simulation.time)),
        "",
    )


def trials(
    robot: RobotLike,
    motion: Motion,
    controller: Controller,
    *,
    bandwidths: Sequence[float] = (),
    delays: Sequence[float] = (),
    encoders: Sequence[float] = (),
    stiffnesses: Sequence[float] = (),
    model: RobotLike | None = None,
    sensors: Sensors | None = None,
    delay: float = 0.0,
) -> pl.DataFrame:
    """Return a table of simulated trials: bandwidth, delay, encoder or stiffness varied singly.

    Parameters
    ----------
    robot, motion, controller, model, sensors, delay
        As `simulate` has them; what does not change.
    bandwidths : sequence of float
        Bandwidths of the controller, rad/s.
    delays : sequence of float
        From a sample to the drives' force, s.
    encoders : sequence of float
        Steps of the encoders at the joints, m or rad; 0 is exact, and so are rates then.
    stiffnesses : sequence of float
        Factors on the stiffness of all transmissions, whose machine bends.

    Returns
    -------
    DataFrame
        Columns: changed ("bandwidth", "delay", "encoder" or "stiffness"), value, and those of
        `Trial`. A trial that cannot be made tells why in `stopped`.

    Examples
    --------
    >>> from pteron.controllers import FeedForwardPD
    >>> from pteron.motion import pick_and_place, trials
    >>> motion = pick_and_place("five-bar")
    >>> trials("five-bar", motion, FeedForwardPD(), delays=[0.0, 1e-3])["changed"].to_list()
    ['delay', 'delay']
    """
    import polars as pl

    robot, sensors = as_manipulator(robot), sensors or Sensors()
    plain: dict[str, Any] = (
        {"proportional": None, "derivative": None} if hasattr(controller, "damping") else {}
    )
    if not isinstance(controller, Controller):
        raise DataError("controller: one such as FeedForwardPD() expected")
    if len(stiffnesses) and not bends(robot):
        raise DataError(
            f"stiffnesses: given, but no transmission of {robot.name} bends; give its drives "
            "elastic = { stiffness = ... } in its file"
        )
    usual: dict[str, Any] = {"robot": robot, "motion": motion, "model": model}
    usual |= {"controller": controller, "sensors": sensors, "delay": delay}
    variations: list[tuple[str, float, dict[str, Any]]] = [
        *(
            ("bandwidth", b, {"controller": replace(controller, bandwidth=b, **plain)})
            for b in bandwidths
        ),
        *(("delay", d, {"delay": d}) for d in delays),
        *(("encoder", e, {"sensors": replace(sensors, encoder=e)}) for e in encoders),
        *(("stiffness", k, {"robot": _stiffer(robot, k)}) for k in stiffnesses),
    ]
    rows = []
    for changed, setting, other in variations:
        try:
            figures = trial(**usual | other)
        except PteronError as error:
            figures = GainTrial(*_UNKNOWN, str(error))
        rows.append({"changed": changed, "value": float(setting), **asdict(figures)})
    return pl.DataFrame(rows)


def bends(robot: Manipulator) -> bool:
    """Return whether a machine has an elastic transmission."""
    return any(leg.drive and leg.drive.elastic for leg in robot.legs)


def _stiffer(robot: Manipulator, factor: float) -> Manipulator:
    """Return the machine with the stiffness of all transmissions multiplied by a factor."""
    expect(0.0 < factor < np.inf, "stiffnesses", f"{factor:g}", "factors above 0")

    def stiffen(drive: Drive | None) -> Drive | None:
        """Return a drive with its stiffness multiplied by `factor`.

        A drive without elastic transmission is unchanged.
        """
        if drive is None or drive.elastic is None:
            return drive
        stiffness = factor * drive.elastic.stiffness
        return replace(drive, elastic=replace(drive.elastic, stiffness=stiffness))

    legs = tuple(replace(leg, drive=stiffen(leg.drive)) for leg in robot.legs)
    return replace(robot, legs=legs)


def _tool_places(robot: Manipulator, poses: Array) -> Array:
    """Return the tool's positions (..., k), m, at poses (..., m); the poses if k is zero."""
    zero_rates = np.zeros_like(poses)
    place = tool_path(robot.platform, poses, zero_rates, zero_rates)[0]
    return place if place.shape[-1] else poses


def _settling_figures(
    simulation: Simulation, motion: Motion, errors: Array, moving: NDArray[np.bool_]
) -> tuple[float, float]:
    """Return settling time, s, and overshoot after a motion's end; NaN if it ends in motion."""
    after = errors[~moving]
    if not len(after) or np.abs(motion.velocity[-1]).max() > 1e-6:
        return float("nan"), float("nan")
    band = max(_SETTLED * float(np.linalg.norm(errors[moving], axis=-1).max()), _LEAST)
    outside = np.flatnonzero(np.linalg.norm(after - after[-1], axis=-1) > band)
    settled = (
        float(simulation.time[~moving][outside[-1]] - motion.duration) if len(outside) else 0.0
    )
    if len(outside) and outside[-1] >= len(after) - 2:
        settled = float("nan")
    places = _tool_places(simulation.robot, motion.pose)
    displacements = places[-1] - places
    lengths = np.linalg.norm(displacements, axis=-1)
    last = (
        displacements[np.flatnonzero(lengths > 0.01 * lengths.max())[-1]]
        if lengths.max()
        else after[0]
    )
    direction = last / (np.linalg.norm(last) or 1.0)
    return settled, max(float((after @ direction).max()), 0.0)
