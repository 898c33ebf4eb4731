"""Poses to slider coordinates and back."""

from __future__ import annotations

import numpy as np

from pteron.conventions import (
    BatchOfMatrices,
    BatchOfSliders,
    BatchOfVectors,
    OnFailure,
    PoseLike,
    SliderLike,
)
from pteron.errors import SingularPose, UnreachablePose
from pteron.kernels import numeric
from pteron.kinematics.poses import blanked, finite, usable_poses
from pteron.kinematics.singularities import EVERYWHERE, is_singular_everywhere
from pteron.manipulator import Manipulator

__all__ = ["direct_kinematics", "inverse_kinematics", "link_vectors"]


def inverse_kinematics(
    robot: Manipulator, pose: PoseLike, *, on_failure: OnFailure = "raise"
) -> BatchOfSliders:
    """Return the slider coordinates of poses: rho = d . (p + s - r), Eq. (4).

    They do not depend on the elbows; `slider_limits` are not applied.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    pose : array, shape (..., m)
        (x, y, z, phi), or (x, y, z) for 3T; m and rad.
    on_failure : {"raise", "nan"}
        Whether a pose out of a leg's reach raises, or gives NaN.

    Returns
    -------
    array, shape (..., n)
        m.

    Raises
    ------
    UnreachablePose
        If a leg's links do not reach a pose.

    Examples
    --------
    >>> import pteron
    >>> pteron.inverse_kinematics(pteron.load("quadrupteron"), [0.01, 0.02, 0.03, 0.0])
    array([0.03, 0.02, 0.01, 0.02])
    """
    poses = usable_poses(robot, pose, reach=True, on_failure=on_failure)
    sliders: BatchOfSliders = numeric(robot, "inverse_kinematics")(poses)
    return blanked(sliders, poses)


def link_vectors(
    robot: Manipulator, pose: PoseLike, *, on_failure: OnFailure = "raise"
) -> tuple[BatchOfVectors, BatchOfVectors]:
    """Return the vectors of the upper and lower links, Eqs. (6) and (7).

    Parameters
    ----------
    robot : Manipulator
        The machine; its elbows choose the branch.
    pose : array, shape (..., m)
        The poses, m and rad.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    l_u, l_l : array, shape (..., n, 3)
        From R1 to R2 and from R2 to R3, in the base frame, m.

    Raises
    ------
    UnreachablePose
        If a leg's links do not reach a pose.
    SingularPose
        If R1 and R3 of a leg coincide, so that its elbow is undetermined.
    """
    poses = usable_poses(robot, pose, reach=True, on_failure=on_failure)
    l_u, l_l = numeric(robot, "link_vectors")(poses)
    return blanked(l_u, poses), blanked(l_l, poses)


def direct_kinematics(
    robot: Manipulator, sliders: SliderLike, *, on_failure: OnFailure = "nan"
) -> BatchOfMatrices:
    """Return every pose with the given slider coordinates: all assembly modes, in closed form.

    The closures are linear in (p, cos phi, sin phi), so that a Quadrupteron has at most two poses
    and a Tripteron one. Each column stands for one assembly mode throughout: the two modes of a
    Quadrupteron are separated by its singular orientations.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    sliders : array, shape (..., n)
        Slider coordinates, m.
    on_failure : {"nan", "raise"}
        A mode that is not real is NaN: that is an answer, not a failure, hence the default. With
        "raise", sliders that no pose has raise.

    Returns
    -------
    array, shape (..., k, m)
        k = 2 for 3T1R, 1 for 3T. A row is NaN where the closures have no real solution, or where
        a leg's links do not reach the pose that solves them. phi lies in (-pi, pi].

    Raises
    ------
    SingularPose
        If the machine is singular at every pose.
    UnreachablePose
        With ``on_failure="raise"``, if sliders have no pose.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> robot = pteron.load("quadrupteron")
    >>> poses = pteron.direct_kinematics(robot, [0.03, 0.02, 0.01, 0.02])
    >>> np.round(poses, 12) + 0.0
    array([[0.01      , 0.02      , 0.03      , 0.        ],
           [0.01      , 0.02      , 0.03      , 3.14159265]])
    """
    if is_singular_everywhere(robot):
        raise SingularPose(EVERYWHERE.format(name=robot.name), kind="II", closeness=0.0, index=())
    given = finite(robot, sliders, "sliders", on_failure)
    found = numeric(robot, "direct_kinematics")(given)
    if robot.platform.turns:
        found[..., 3] = np.where(found[..., 3] <= -np.pi, np.pi, found[..., 3])
    poses = usable_poses(robot, found, reach=True, on_failure="nan")
    lost = np.isnan(poses).all(axis=(-2, -1))
    if on_failure == "raise" and lost.any():
        index = tuple(int(i) for i in np.argwhere(lost)[0])
        where = f"sliders[{', '.join(map(str, index))}]" if index else "sliders"
        raise UnreachablePose(
            f"{where}: no pose has these slider coordinates {given[index].tolist()} m",
            leg=0,
            shortfall=float("nan"),
            index=index,
        )
    return poses
