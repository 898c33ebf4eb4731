"""Stiffness, damping and play of transmissions, from logs with an encoder on either side."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.dynamics import inverse_dynamics
from pteron.errors import DataError
from pteron.identification.logs import Log
from pteron.identification.signals import Processing, preprocessing_for_log, samples
from pteron.identification.signals.filters import SETTLING, lowpass
from pteron.kernels import Array
from pteron.legs import Drive, Elastic
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import interpolate_columns
from pteron.renamed import former_attribute
from pteron.result import Result
from pteron.shapes import PerJoint

_BLOCKS = 25
"""Stretches of a log whose errors count as independent."""

_RARE, _RARE_BLOCKS = 0.02, 4
"""Share of a log, and number of its stretches, in more than which a load must be on its rarer side
for the play to show."""

_CLEAR = 3.0
"""Standard deviations of a value from which it is more than noise."""

_SLOW = 0.03
"""Highest cut-off, as a share of the sampling rate: differences of faster vibrations, of which soft
drives are full, are smaller than their accelerations."""

_ACROSS = 2e-3
"""Share of a change of side by which a filtered one may be off."""


@dataclass(frozen=True, eq=False, repr=False)
class Transmissions(Result):
    """Transmissions between motors and joints: load = stiffness bent + damping bent'.

    Attributes
    ----------
    stiffness, damping, backlash : array, shape (n,)
        N/m, N s/m and m; N m/rad, N m s/rad and rad at cranks. Play is that from one side to the
        other; NaN where the load is nearly always on one side, which does not show it.
    stiffness_deviations, damping_deviations, backlash_deviations : array, shape (n,)
        Standard deviations, for a machine that is known exactly: the relative error of its forces
        is one of stiffness and damping beside these, and filters and coarse encoders add tenths of
        a percent, to damping some percents.
    """

    ROWS = "stiffness damping backlash stiffness_deviations damping_deviations backlash_deviations"

    stiffness: PerJoint
    damping: PerJoint
    backlash: PerJoint
    stiffness_deviations: PerJoint
    damping_deviations: PerJoint
    backlash_deviations: PerJoint

    def add_to(self, robot: RobotLike) -> Manipulator:
        """Return a machine with elastic drives; insignificant damping and play are 0."""
        robot = as_manipulator(robot)
        damping = _significant(self.damping, self.damping_deviations)
        play = _significant(self.backlash, self.backlash_deviations)
        bends = (part.tolist() for part in (self.stiffness, damping, play))
        legs = zip(robot.legs, *bends, strict=True)
        return replace(
            robot,
            legs=tuple(
                replace(leg, drive=replace(leg.drive or Drive(), elastic=Elastic(*elasticity)))
                for leg, *elasticity in legs
            ),
        )

    in_drives_of = former_attribute("in_drives_of", "add_to")


def _significant(estimates: Array, deviations: Array) -> Array:
    """Return values that differ from zero significantly, and 0 for the others."""
    return np.where(estimates > _CLEAR * deviations, estimates, 0.0)


def identify_transmissions(
    robot: RobotLike, log: Log, motors: ArrayLike, *, processing: Processing | None = None
) -> Transmissions:
    """Identify transmissions from joints and motors that were measured at the same instants.

    What is bent is motor less joint. The load is what the rigid bodies need in the joints' motion:
    forces of the log, their delay and friction do not matter. By least squares

        motor - joint = load / k + play sign(load) / 2 - (c / k) (motor - joint)' + constant

    of signals behind one filter, where the load is on one side; the constant is the encoders'.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine as it is, such as `Identification.machine` of the same log. Rotors' inertia that
        is in its bodies, where it was not known, makes loads and stiffness too large by its share.
    log : Log
        With the joints as the encoders behind the transmissions tell them.
    motors : array, shape (T, n)
        The motors' coordinates, counted at the joints.
    processing : Processing, optional
        How positions are smoothed and differentiated.

    Raises
    ------
    DataError
        If motors are not as many as joints, a payload is carried, or a load does not tell its
        transmission's stiffness.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> from pteron.identification import Log, identify_transmissions
    >>> robot, time = pteron.load("tripteron"), np.arange(4000) / 1000.0
    >>> joints = 0.1 * np.sin(np.outer(time, [9.0, 11.0, 13.0]))
    >>> motion = [joints, np.gradient(joints, time, axis=0)]
    >>> motion.append(np.gradient(motion[1], time, axis=0))
    >>> load = pteron.inverse_dynamics(robot, *motion)  # of this machine pose and joints are equal
    >>> log = Log("log", time, joints, load)
    >>> found = identify_transmissions(robot, log, joints + load / 1e5)
    >>> bool(np.allclose(found.stiffness, 1e5, rtol=1e-3))
    True
    """
    robot, motors = as_manipulator(robot), np.asarray(motors, float)
    if log.payload is not None and log.payload.any():
        raise DataError(f"{log.source}: a payload is carried; take the rows without (`Log.part`)")
    if motors.shape != log.joints.shape:
        raise DataError(f"motors: shape {motors.shape} given, {log.joints.shape} expected")
    how = preprocessing_for_log(robot, log, processing or Processing(derivatives="central"))
    how = replace(how, cutoff=min(how.cutoff or np.inf, _SLOW * how.rate))
    blocks = [block.states.part(block.fresh) for block in samples(robot, log, how)]
    time = np.concatenate([block.time for block in blocks])
    load = np.concatenate(
        [inverse_dynamics(robot, s.pose, s.velocity, s.acceleration) for s in blocks]
    )
    bent = lowpass(motors - log.joints, log.rate, how.cutoff)
    rate = np.gradient(bent, log.time, axis=0)
    side = lowpass(np.sign(interpolate_columns(time, load, log.time)), log.rate, how.cutoff)
    bent, rate, side = (interpolate_columns(log.time, s, time) for s in (bent, rate, side))
    edge = SETTLING / (how.cutoff or log.rate)
    inner = (time > time[0] + edge) & (time < time[-1] - edge)
    fits = [
        _fit_transmission(robot, j, *(signal[clear_rows, j] for signal in (bent, load, side, rate)))
        for j in range(robot.joint_count)
        for clear_rows in [inner & (np.abs(np.abs(side[:, j]) - 1.0) < _ACROSS)]
    ]
    return Transmissions(*np.array(fits).T)


def _fit_transmission(
    robot: Manipulator, j: int, bent: Array, load: Array, side: Array, rate: Array
) -> tuple[float, ...]:
    """Return stiffness, damping and backlash of a joint's transmission, and their deviations.

    These are the jackknife's, of whole stretches: errors last.
    """
    columns = np.column_stack([load, -rate, np.ones_like(load), np.sign(side)])
    blocks = np.array_split(np.arange(len(load)), _BLOCKS)
    rare = columns[:, 3] == -np.sign(columns[:, 3].sum())
    both_sides = rare.mean() > _RARE and sum(rare[block].any() for block in blocks) > _RARE_BLOCKS
    if not both_sides:
        columns, bent = columns[~rare, :3], bent[~rare]
        blocks = np.array_split(np.arange(len(bent)), _BLOCKS)

    def values(left_out: NDArray[np.int64]) -> tuple[float, float, float]:
        """Return stiffness, damping and backlash without the samples `left_out` (indices)."""
        rows, known = np.delete(columns, left_out, axis=0), np.delete(bent, left_out)
        sizes = np.linalg.norm(rows, axis=0)
        give, lag, *offsets = np.linalg.lstsq(rows / sizes, known)[0] / sizes
        return 1.0 / give, lag / give, 2.0 * offsets[1] if both_sides else np.nan

    estimates = values(np.zeros(0, np.int64))
    spread = np.sqrt(_BLOCKS - 1.0) * np.std([values(block) for block in blocks], axis=0)
    if not estimates[0] > _CLEAR * spread[0]:
        raise DataError(
            f"{robot.joint_names[j]}: its load does not tell how its transmission bends; record "
            "faster motions, or both sides with finer encoders"
        )
    return *estimates, *spread
