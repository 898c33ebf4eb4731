"""Poses as the user gives them: checked once, at the boundary, before a kernel sees them."""

from __future__ import annotations

from functools import lru_cache
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike

from pteron.conventions import OnFailure
from pteron.errors import DataError, SingularPose, UnreachablePose
from pteron.kernels import Array, as_array, numeric
from pteron.kinematics.singularities import EVERYWHERE, is_singular_everywhere
from pteron.manipulator import Manipulator
from pteron.manipulator.vectors import norm

__all__ = ["SINGULAR", "blanked", "finite", "usable_poses"]

SINGULAR = 1e-9
"""Closeness (see `SingularPose`) at which a pose counts as singular. What is computed from J^-1 or
from 1/D loses as many digits as the closeness has zeros, so that half of them are left here."""


_CHOICES = get_args(OnFailure)


def finite(
    robot: Manipulator, value: ArrayLike, name: str, on_failure: OnFailure = "raise"
) -> Array:
    """Return an array (..., m) of finite numbers, or say which element is not one.

    Under ``on_failure="nan"`` a row with a number that is not finite becomes NaN as a whole: an
    infinity would make the kernels subtract infinities, where NaN is quiet.
    """
    if on_failure not in _CHOICES:
        raise DataError(f'on_failure: {on_failure!r} is neither "raise" nor "nan"')
    array = as_array(value, name, (robot.freedom,))
    good = np.isfinite(array)
    if good.all():
        return array
    if on_failure == "raise":
        index = tuple(int(i) for i in np.argwhere(~good)[0])
        raise DataError(f"{name}{list(index)}: {array[index]} given, a finite number expected")
    return np.where(good.all(axis=-1, keepdims=True), array, np.nan)


def usable_poses(
    robot: Manipulator,
    pose: ArrayLike,
    *,
    reach: bool = False,
    bent: bool = False,
    held: bool = False,
    on_failure: OnFailure = "raise",
) -> Array:
    """Return the poses (..., m), those that cannot be used replaced by NaN or refused.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    pose : array, shape (..., m)
        The poses.
    reach, bent, held : bool
        What the caller needs: that the links reach the pose; that no leg is stretched or folded
        (type I), which implies reach; that the sliders hold the platform (type II).
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises or becomes NaN.

    Raises
    ------
    DataError, UnreachablePose, SingularPose
        For the first pose, in memory order, that cannot be used.
    """
    poses = finite(robot, pose, "pose", on_failure)
    bad = np.isnan(poses[..., 0])
    if reach or bent:
        distance, margin, sine = numeric(robot, "reach")(poses)
        beyond = np.isnan(sine) & ~bad[..., None]
        coincident = _coincident(robot, poses, distance)
        failing = beyond | ((sine <= SINGULAR) if bent else coincident)
        if failing.any():
            if on_failure == "raise":
                index = np.argwhere(failing)[0]
                at, leg = tuple(int(i) for i in index[:-1]), int(index[-1])
                count = int(failing.any(axis=-1).sum())
                if beyond[(*at, leg)]:
                    raise _unreachable(robot, at, leg, distance, margin, count)
                undetermined = bool(coincident[(*at, leg)])
                raise _stretched(at, leg, float(sine[(*at, leg)]), undetermined, count)
            bad = np.asarray(bad | failing.any(axis=-1))
    if held:
        if is_singular_everywhere(robot):
            closeness: Array = np.zeros(poses.shape[:-1])
        else:
            closeness = np.abs(numeric(robot, "regularity")(poses))
        loose = closeness <= SINGULAR
        if on_failure == "raise" and loose.any():
            at = tuple(int(i) for i in np.argwhere(loose)[0])
            raise _loose(robot, at, poses[at], float(closeness[at]), int(loose.sum()))
        bad = np.asarray(bad | loose)
    return np.where(bad[..., None], np.nan, poses) if bad.any() else poses


def _coincident(robot: Manipulator, poses: Array, distance: Array) -> Array:
    """Return where R1 and R3 of a leg coincide, to rounding: its elbow may be anywhere.

    lu and ll are equal there, so that n = 0 is within reach.
    """
    spans = _spans(robot)
    if not (distance < 1e-6 * spans).any():
        return np.zeros(distance.shape, dtype=bool)
    far = np.abs(poses[..., :3]).sum(axis=-1, keepdims=True) + _guides(robot)
    return np.asarray(distance <= 1e-12 * spans + 1e-15 * far)


def blanked(values: Array, *states: Array) -> Array:
    """Return values (..., *shape) with NaN wherever one of the states (..., m) is NaN.

    A kernel's constant entries do not see its inputs; a failed state must not leave them behind.
    """
    lost = np.zeros((), dtype=bool)
    for state in states:
        lost = lost | np.isnan(state[..., 0])
    if not lost.any():
        return values
    axes = (1,) * (values.ndim - lost.ndim)
    return np.where(lost.reshape(lost.shape + axes), np.nan, values)


@lru_cache(maxsize=64)
def _spans(robot: Manipulator) -> Array:
    return np.array([leg.upper_length + leg.lower_length for leg in robot.legs])


@lru_cache(maxsize=64)
def _guides(robot: Manipulator) -> Array:
    return np.array([norm(leg.guide_point) for leg in robot.legs])


def _where(index: tuple[int, ...]) -> str:
    return f"pose[{', '.join(map(str, index))}]" if index else "pose"


def _others(count: int) -> str:
    return f" ({count} such poses in the batch)" if count > 1 else ""


def _unreachable(
    robot: Manipulator,
    index: tuple[int, ...],
    i: int,
    distance: Array,
    margin: Array,
    count: int,
) -> UnreachablePose:
    leg = robot.legs[i]
    shortfall = max(-float(margin[(*index, i)]), 0.0)
    lengths = leg.upper_length, leg.lower_length
    return UnreachablePose(
        f"{_where(index)}: leg {i + 1} misses it by {shortfall:.3g} m: its links span "
        f"{abs(lengths[0] - lengths[1]):.4g} to {sum(lengths):.4g} m, but the platform point is "
        f"{float(distance[(*index, i)]):.4g} m from R1; move the pose towards the legs' reach"
        f"{_others(count)}",
        leg=i + 1,
        shortfall=shortfall,
        index=index,
    )


def _stretched(
    index: tuple[int, ...], i: int, sine: float, coincident: bool, count: int
) -> SingularPose:
    what = (
        "R1 and R3 coincide, so that its elbow may be anywhere"
        if coincident
        else f"it is stretched or folded (type I; sine of the elbow's angle {sine:.1e})"
    )
    return SingularPose(
        f"{_where(index)}: singular for leg {i + 1}: {what}; move away from the edge of its reach"
        f"{_others(count)}",
        kind="elbow" if coincident else "I",
        closeness=sine,
        index=index,
    )


def _loose(
    robot: Manipulator, index: tuple[int, ...], pose: Array, closeness: float, count: int
) -> SingularPose:
    if is_singular_everywhere(robot):
        message = EVERYWHERE.format(name=robot.name)
    else:
        message = (
            f"{_where(index)}: singular orientation (type II), {closeness:.1e} rad from where the "
            f"sliders no longer hold the platform (phi = {np.degrees(pose[-1]):.4g} deg); turn "
            f"away from it{_others(count)}"
        )
    return SingularPose(message, kind="II", closeness=closeness, index=index)
