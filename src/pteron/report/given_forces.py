"""Warnings of a report where the forces in a motion's file are not those that the machine needs."""

from __future__ import annotations

import numpy as np

from pteron.dynamics import drive_forces
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.playback import Playback

_CLEAR = 0.1
"""RMS of a difference, as a share of the largest force's, above which it is a warning: no friction
of a good drive and no smoothing of a log is as large, while a payload is."""


def force_doubts(robot: Manipulator, playback: Playback) -> tuple[str, ...]:
    """Return a warning if the forces in a motion's file belong to another load.

    A report shows the forces that the machine needs. The reader of a file that was made with a
    payload would otherwise take them for the file's.
    """
    motion, loaded = playback.motion, ""
    if playback.payload:
        loaded = f"its column payload has up to {playback.payload:g} kg"
    if playback.forces is None:
        return (f"{playback.source}: {loaded}: is that in the machine?",) if loaded else ()
    path = motion.pose, motion.velocity, motion.acceleration
    needed = np.asarray(drive_forces(robot, *path, smooth=True))
    differences = _rms(playback.forces - needed)
    leg = int(differences.argmax())
    # The largest force of all legs is the measure: a leg that bears nothing has only noise.
    if differences[leg] <= _CLEAR * max(_rms(needed).max(), _rms(playback.forces).max()):
        return ()
    there, here = (np.abs(forces[:, leg]).max() for forces in (playback.forces, needed))
    unit = robot.legs[leg].joint.force_unit
    why = loaded or "was it made with a payload or a tool?"
    return (
        f"{playback.source or 'the motion'}: its forces are not those that {robot.name} needs for "
        f"it, which are shown: the peak of leg {leg + 1} is {there:.4g} {unit} there and "
        f"{here:.4g} {unit} here; {why} (pteron report has --payload and --tool)",
    )


def _rms(forces: Array) -> Array:
    """Return the root mean square over time of forces (T, n): (n,)."""
    return np.asarray(np.sqrt(np.mean(forces**2, axis=0)))
