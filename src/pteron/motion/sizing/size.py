"""`size`: forces, speeds and inertia at each drive over a cycle, integrated to loads (`Sizing`).

A cycle is one motion or several, with rests, as it stands or at many places of a workspace.

Integrals over the motion are Simpson's over each interval between two samples, of which the middle
is interpolated as `Motion.at` does: exact for cubics, and the error falls with the fourth power of
the interval where the motion is smooth.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pteron.arguments import expect
from pteron.errors import DataError
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import Motion, pose_text
from pteron.motion.sizing.drive_loads import Sizing
from pteron.motion.sizing.duty import DutyCycle
from pteron.motion.sizing.places import (
    TURNS,
    CyclePlace,
    expect_places_of,
    neighbours,
    places_in,
    region_fits,
    stays,
)
from pteron.workspace import Box, Region

_AT_REST = 1e-6
"""Share of the motion's greatest speed below which its end is at rest."""

_ROUNDING = 2e-9
"""Width of a range that is none but for rounding, m and rad."""

_SOUGHT = "peak_force", "rms_force", "peak_speed"
"""Quantities for which the search refines the worst places."""

_NEARER = {True: (0.5,) * 5, False: (0.65,) * 8}
"""Shares by which each round about the worst places is nearer than the one before, in a box or
in another region."""


def size(
    robot: RobotLike,
    motion: Motion | Sequence[Motion],
    *,
    dwell: float | Sequence[float] = 0.0,
    wrench: ArrayLike | None = None,
    places: Region | Sequence[CyclePlace] | Literal["workspace"] | None = None,
    friction: float = 0.0,
) -> Sizing:
    """Return the loads of a cycle on each drive of a machine: forces, speeds, their integrals.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine, with what its file says of the drives; `with_payload` gives it a payload.
    motion : Motion or sequence of Motion
        One cycle; of several motions one after the other.
    dwell : float or sequence of float
        Time for which the platform rests after each motion, s; the drives hold it there.
    wrench : array, shape (m,), optional
        Load on the platform at P all along: a force in N and, where it turns, a moment about k
        in N m; of a platform that tilts a force and a moment, (6,).
    places : Region, sequence of CyclePlace or "workspace", optional
        Where else the cycle is done, as a whole: at all places and turns about the vertical at
        which it stays in a region of poses, or in the workspace (with `least_margin` to
        singularities, at the home pose's angles), the platform turned as the path is, or not. A
        grid of places by 30 degrees of turn is looked at, and then ever nearer about the worst of
        each drive. By default it is as it stands. Of a
        motion with more than 241 samples as many moments are looked at.
    friction : float
        Dry friction of a drive that has none in the machine's file, as a share of the largest force
        on it in the cycle; 0.1 is usual of gears and screws.

    Returns
    -------
    Sizing

    Raises
    ------
    UnreachablePose, SingularPose
        If the machine cannot do a pose of the motion.
    DataError
        If a motion has another number of coordinates than the machine, its time does not ascend,
        or it is to be followed by a rest and does not end at rest; or it fits nowhere in a region.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import pick_and_place, size
    >>> robot = pteron.load("tripteron")
    >>> cycle = pick_and_place(robot, [0.0, 0.0, 0.0], scale=0.5, duration=0.5)
    >>> found = size(robot, cycle, dwell=0.1)
    >>> round(found.duration, 3), found.peak_forces.round(1)
    (0.6, array([78.1,  7.5, 47.7]))
    """
    robot = as_manipulator(robot)
    motions = [motion] if isinstance(motion, Motion) else list(motion)
    rests = np.ravel(np.asarray(dwell, dtype=float))
    rests = np.repeat(rests, len(motions)) if len(rests) == 1 else rests
    if len(rests) != len(motions) or not motions:
        raise DataError(
            f"dwell: {len(rests)} rests given, and {len(motions)} motions; give one for each motion"
        )
    for segment, pause in zip(motions, rests, strict=True):
        _check(robot, segment, float(pause))
    expect(np.isfinite(friction) and friction >= 0.0, "friction", friction, "a share of 0 or more")
    load = None if wrench is None else np.asarray(wrench, dtype=float)
    if load is not None and load.shape != (robot.freedom,):
        raise DataError(
            f"wrench: shape {load.shape} given, ({robot.freedom},) expected: one wrench for the "
            "whole motion"
        )
    cycle = DutyCycle(robot, tuple(motions), rests, load, friction)
    return cycle.loads_at() if places is None else _size_at_places(cycle, places)


def _size_at_places(
    cycle: DutyCycle, places: Region | Sequence[CyclePlace] | Literal["workspace"]
) -> Sizing:
    """Return the drive loads at given places, or in a region at a grid refined about the worst."""
    cycle = cycle.thin_out()
    if not (isinstance(places, Region) or places == "workspace"):
        return cycle.loads_at(expect_places_of(cycle.robot, places))
    robot, course = cycle.robot, cycle.course
    box, fits = region_fits(course, places if isinstance(places, Region) else None)
    known = dict.fromkeys(places_in(course, box, fits))
    itself = CyclePlace(tuple(course.middle.tolist()))
    if not isinstance(places, Region) or stays(course, itself, fits):
        known[itself] = None
    if not known:
        sizes = np.ptp(course.extent(0.0), axis=0)
        raise DataError(
            f"places: the cycle fits nowhere in the region: it is {pose_text(sizes)} wide, and the "
            f"region {pose_text(np.ptp(box, axis=0))} ({' '.join(robot.coordinates)}, m and rad)"
        )
    sizing = cycle.loads_at(tuple(known))
    worst: dict[tuple[str, int], tuple[float, CyclePlace]] = {}
    free = np.ptp(box, axis=0) > np.ptp(course.extent(0.0), axis=0) + _ROUNDING
    steps, turn = (
        free * np.ptp(box, axis=0) / 8.0,
        np.pi / TURNS if course.axis is not None else 0.0,
    )
    yaw = course.yaw * (steps == 0.0)
    boxed = isinstance(places, Box)
    for nearer in _NEARER[boxed]:
        for quantity in _SOUGHT:
            most = getattr(sizing, f"{quantity}s")
            for leg, i in enumerate(sizing.worst(quantity)):
                greatest = float(most[leg])
                if (quantity, leg) not in worst or greatest > worst[quantity, leg][0]:
                    worst[quantity, leg] = greatest, sizing.places[i]
        candidates = (
            n
            for place in dict.fromkeys(p for _, p in worst.values())
            for n in neighbours(place, steps, turn, yaw, oblique=not boxed)
        )
        new = [place for place in dict.fromkeys(candidates) if place not in known]
        new = [place for place in new if stays(course, place, fits)]
        if new:
            sizing = cycle.loads_at(tuple(new))
            known.update(dict.fromkeys(new))
        steps, turn = nearer * steps, nearer * turn
    return cycle.loads_at(tuple(known))


def _check(robot: Manipulator, motion: Motion, dwell: float) -> None:
    """Raise for a motion of wrong shape, an invalid rest, or a rest after an end in motion."""
    expected = (len(motion.time), robot.freedom)
    for name in ("pose", "velocity", "acceleration"):
        if getattr(motion, name).shape != expected:
            raise DataError(
                f"motion.{name}: shape {getattr(motion, name).shape} given, {expected} expected: a "
                f"row for each time, and {' '.join(robot.coordinates)} of {robot.name}"
            )
    motion.expect_ascending()
    expect(np.isfinite(dwell) and dwell >= 0.0, "dwell", dwell, "0 s or more")
    speeds = np.abs(motion.velocity)
    if dwell and (speeds[-1] > _AT_REST * speeds.max()).any():
        raise DataError(
            f"dwell: {dwell:g} s of rest asked for, but the motion does not end at rest; leave it "
            "out"
        )
