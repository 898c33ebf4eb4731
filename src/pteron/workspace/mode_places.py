"""Where the platform of a machine is in its working modes: above its base, below or inside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pteron.kernels import Array, geometry_only
from pteron.kinematics import inverse_kinematics
from pteron.kinematics.sampling import sample_poses
from pteron.manipulator import Manipulator
from pteron.manipulator.variants import elbow_signs, elbows_of, mode_elbows, with_elbows
from pteron.tolerances import ROUNDING
from pteron.workspace.margins import pose_margins

_DRAWN = 300
"""Random poses at which the modes are compared."""

_MOST = 8
"""Most modes that are compared all; of more the file's own, its opposite, all + and all -."""

_UPRIGHT = 0.1
"""Height of the platform over its base, as a share of a leg's length, from which it is clearly
above or below."""

_ALIKE = 0.7
"""Share of the best margin from which on a mode serves as well: of those one hangs, most likely."""


@dataclass(frozen=True)
class ModePlace:
    """A working mode at the best of several random poses.

    Attributes
    ----------
    elbows : tuple of int
        The signs of its legs' branches: one or two for each leg, in their order.
    place : {"above", "below", "inside"}
        Where the platform is there, seen along gravity from the base: the guide points, or where
        sliders are on their guides.
    depth : float
        How far below it, m; negative above.
    pose : array, shape (m,)
        The pose, m and rad.
    margin : float
        The least margin there (see `pose_margins`).
    named : bool
        Whether it is the file's own.
    likely : bool
        Whether it is the one that is likely meant: one that hangs below the base and has nearly the
        best margin, else that with the best; the file's own among equals.
    """

    elbows: tuple[int, ...]
    place: str
    depth: float
    pose: Array
    margin: float
    named: bool
    likely: bool

    @property
    def signs(self) -> str:
        """Its elbows as text for the option --elbows, such as ++-."""
        return elbow_signs(self.elbows)


def mode_places(robot: Manipulator, home: Array) -> tuple[ModePlace, ...]:
    """Return where the platform is in each working mode: at home in the file's, else at its best.

    None of a machine that has one mode, or that gravity does not tell above from below.
    """
    file_elbows, modes = elbows_of(robot), mode_elbows(robot)
    down, directions = np.array(robot.gravity), robot.platform.directions
    upright = ROUNDING * float(np.linalg.norm(down))
    if len(modes) == 1 or not np.linalg.norm(directions @ down) > upright:
        return ()
    if len(modes) > _MOST:
        columns = zip(file_elbows, zip(*modes, strict=True), strict=True)
        other = tuple(-s if -s in column else s for s, column in columns)
        modes = list(dict.fromkeys([file_elbows, other, modes[0], modes[-1]]))
    # Of a machine with a small share of its reach within limits there are fewer, or home alone.
    drawn = sample_poses(geometry_only(robot), _DRAWN, np.random.default_rng(0))
    poses = np.vstack([drawn, home])
    least = _UPRIGHT * max(leg.size for leg in robot.legs)
    candidates = []
    for signs in modes:
        mode = with_elbows(robot, signs)
        margins = _margins_in_reach(mode, poses)
        if not np.isfinite(margins).any():
            continue  # its reach depends on its elbows, and with these it reaches no pose
        best = len(poses) - 1 if signs == file_elbows else int(margins.argmax())
        depth = _depth(mode, poses[best])
        place = "below" if depth > least else "above" if depth < -least else "inside"
        candidates.append((signs, place, depth, poses[best], float(margins[best])))
    most = max(margin for *_, margin in candidates)
    alike = [candidate for candidate in candidates if candidate[-1] >= _ALIKE * most]
    hanging = [candidate for candidate in alike if candidate[1] == "below"] or alike
    likely = (
        file_elbows
        if file_elbows in [candidate[0] for candidate in hanging]
        else max(hanging, key=lambda candidate: candidate[-1])[0]
    )
    return tuple(
        ModePlace(*candidate, candidate[0] == file_elbows, candidate[0] == likely)
        for candidate in candidates
    )


def _margins_in_reach(robot: Manipulator, poses: Array) -> Array:
    """Return the least margin at poses (K, m), which is negative beyond limits; -inf elsewhere."""
    reached = np.isfinite(inverse_kinematics(robot, poses, on_failure="nan")).all(axis=-1)
    margins = np.full(len(poses), -np.inf)
    if reached.any():
        margins[reached] = np.nan_to_num(pose_margins(robot, poses[reached]).least, nan=-np.inf)
    return margins


def _depth(robot: Manipulator, pose: Array) -> float:
    """Return the depth of P, m, below the mean of the guide points or their sliders."""
    base = np.zeros(3)
    for leg, q in zip(robot.legs, inverse_kinematics(robot, pose), strict=True):
        slides = leg.joint.unit == "m" and leg.joint_axis is not None
        base += np.array(leg.guide_point) + (q * np.array(leg.joint_axis) if slides else 0.0)
    offset = robot.platform.placement(pose)[0] - base / len(robot.legs)
    return float(offset @ np.array(robot.gravity) / np.linalg.norm(robot.gravity))


def mode_warnings(modes: Sequence[ModePlace]) -> tuple[str, ...]:
    """Return a warning that another working mode may be meant, if the platform is above its base.

    Most machines hang below their base. One that stands above it, and that would hang there with
    other elbows and much the same margin, was perhaps given the wrong ones.
    """
    named = next((mode for mode in modes if mode.named), None)
    likely = next((mode for mode in modes if mode.likely), None)
    if named is None or likely is None or (named.place, likely.place) != ("above", "below"):
        return ()
    return (
        f"elbow: the platform stands {-named.depth:.2g} m above its base at "
        f"{_pose_text(named.pose)}; with elbows {likely.signs} it hangs {likely.depth:.2g} m below "
        f"it at {_pose_text(likely.pose)}: is that the working mode that is meant?",
    )


def _pose_text(pose: Array) -> str:
    """Return a pose as text, to three digits."""
    return f"({', '.join(f'{coordinate:.3g}' for coordinate in pose)})"
