"""How large the reach is at constant orientation: its bounding box and its volume."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize  # type: ignore[import-untyped]

from pteron.conventions import PoseLike
from pteron.errors import DataError, ModelError
from pteron.kernels import Array, numeric
from pteron.kinematics.poses import finite
from pteron.manipulator import Manipulator
from pteron.workspace.reserve import clearances

__all__ = ["ReachVolume", "bounding_box", "reach_volume"]

_TOUCH = 1e-9
"""Metres by which the legs' reach must overlap to count as common."""


@dataclass(frozen=True)
class ReachVolume:
    """The set of positions in reach at one orientation, within the sliders' limits.

    Attributes
    ----------
    volume : float
        m^3, an estimate.
    standard_error : float
        Of the estimate, m^3.
    box : array, shape (2, 3)
        Least and greatest x, y and z in reach, m.
    count : int
        Number of random positions in the box that the estimate rests on.
    """

    volume: float
    standard_error: float
    box: Array
    count: int


def bounding_box(robot: Manipulator, pose: PoseLike) -> Array:
    """Return the box that bounds all positions in reach at the orientation of a pose.

    At constant orientation each leg's stretched length and each slider's limit bounds a convex set,
    so that each side of the box is a convex problem. What is too near to a leg with unequal links
    is not left out.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    pose : array, shape (m,)
        Gives the orientation, and where the search starts; m and rad.

    Returns
    -------
    array, shape (2, 3)
        Least and greatest x, y and z, m.

    Raises
    ------
    ModelError
        If no position is in reach at this orientation.

    Examples
    --------
    >>> import pteron
    >>> from pteron.workspace import bounding_box
    >>> bounding_box(pteron.load("tripteron"), [0.0, 0.0, 0.0]).round(3)
    array([[-0.17, -0.17, -0.17],
           [ 0.3 ,  0.3 ,  0.3 ]])
    """
    given = finite(robot, pose, "pose")
    spans = np.array([leg.upper_length + leg.lower_length for leg in robot.legs])

    def room(p: Array) -> Array:
        """Return how far inside every bound a position is, m."""
        at = np.concatenate([p, given[3:]])
        distance, _, _ = numeric(robot, "reach")(at)
        slides = clearances(robot, numeric(robot, "slider_coordinates")(at))
        return np.concatenate([spans - distance, slides[np.isfinite(slides)]])

    start = np.append(given[:3], float(room(given[:3]).min()))
    deepest = minimize(
        lambda v: -v[3],
        start,
        method="SLSQP",
        constraints={"type": "ineq", "fun": lambda v: room(v[:3]) - v[3]},
        options={"ftol": 1e-10, "maxiter": 200},
    ).x
    if room(deepest[:3]).min() < _TOUCH:
        raise ModelError(
            f"{robot.name}: no position is in reach of all legs, within the sliders' limits, at "
            f"the orientation of pose {given.tolist()}"
        )
    sides = np.empty((2, 3))
    for axis in range(3):
        for side, sign in enumerate((1.0, -1.0)):
            objective = sign * np.eye(3)[axis]
            found = minimize(
                lambda p, objective=objective: float(objective @ p),
                deepest[:3],
                jac=lambda p, objective=objective: objective,
                method="SLSQP",
                constraints={"type": "ineq", "fun": room},
                options={"ftol": 1e-10, "maxiter": 200},
            )
            sides[side, axis] = found.x[axis]
    return sides


def reach_volume(
    robot: Manipulator, pose: PoseLike, *, count: int = 50_000, seed: int = 0
) -> ReachVolume:
    """Return the volume in reach at the orientation of a pose, by random positions in its box.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    pose : array, shape (m,)
        Gives the orientation, and where the search for the box starts; m and rad.
    count : int
        Number of random positions.
    seed : int
        Of the random numbers.

    Returns
    -------
    ReachVolume

    Raises
    ------
    ModelError
        If no position is in reach at this orientation.
    DataError
        If there are no samples.
    """
    if count < 1:
        raise DataError(f"count: {count} given, at least 1 expected")
    given = finite(robot, pose, "pose")
    box = bounding_box(robot, given)
    poses = np.tile(given, (count, 1))
    poses[:, :3] = np.random.default_rng(seed).uniform(box[0], box[1], (count, 3))
    _, margin, _ = numeric(robot, "reach")(poses)
    slides = clearances(robot, numeric(robot, "slider_coordinates")(poses))
    share = float((np.minimum(margin, slides).min(axis=-1) >= 0.0).mean())
    whole = float(np.prod(box[1] - box[0]))
    return ReachVolume(
        share * whole, whole * float(np.sqrt(share * (1.0 - share) / count)), box, count
    )
