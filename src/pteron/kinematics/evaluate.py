"""`evaluate_kernel`: call a public function's kernel, with an error that names a failing state.

The kernel returns its values and, for each state, a status: 1 where they are valid, 0 where not.
The cause is determined only where a state fails.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.equations.machine import closure_of
from pteron.errors import DataError, PteronError, SingularPose, UnreachablePose
from pteron.kernels import Array, Selects, as_array, needs_of, numeric
from pteron.kernels.functions import ANGLES, TYPE_I, TYPE_II
from pteron.kinematics.architecture import is_singular_everywhere, singular_everywhere
from pteron.kinematics.unlikely_values import warn_of_unlikely
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.shapes import OnFailure, PoseLike
from pteron.tolerances import SAME

_Outputs = TypeVar("_Outputs")

_TYPED: tuple[type, ...] = (list, tuple)
"""Types of poses that a person types; only these are checked for unlikely units."""

_MILLIMETRES = 20.0
"""A pose this many leg sizes out of reach was perhaps given in millimetres."""


def evaluate_kernel(
    robot: RobotLike,
    what: str,
    on_failure: OnFailure,
    *arguments: PoseLike,
    base: Selects | None = None,
    wrench: bool = False,
) -> _Outputs:  # type: ignore[type-var]
    """Return the checked outputs of the kernel `what` at poses; a single output without tuple."""
    *results, status = numeric(robot, what, base=base, wrench=wrench).call(*arguments)
    good = status.item() if status.ndim == 0 else status.all()
    if not good or on_failure != "raise":
        expect_choice(on_failure)
        if not good:
            if on_failure == "raise":
                raise _failure(as_manipulator(robot), what, arguments, status, wrench)
            for part in results:
                part[status == 0.0] = np.nan
    if type(arguments[0]) in _TYPED:
        machine = as_manipulator(robot)
        warn_of_unlikely(machine, machine.coordinates, np.asarray(arguments[0], dtype=float))
    outputs: Any = results[0] if len(results) == 1 else tuple(results)
    return outputs  # type: ignore[no-any-return]


def evaluate_unchecked(
    robot: RobotLike, what: str, *arguments: PoseLike, base: Selects | None = None
) -> Any:
    """Return the outputs of the kernel `what` without checks: NaN or arbitrary if invalid."""
    *results, _ = numeric(robot, what, base=base)(*arguments)
    return results[0] if len(results) == 1 else tuple(results)


def expect_choice(on_failure: str) -> None:
    """Raise unless `on_failure` is "raise" or "nan"."""
    if on_failure not in ("raise", "nan"):
        raise DataError(f'on_failure: {on_failure!r} is neither "raise" nor "nan"')


def finite_rows(
    robot: Manipulator, raw: PoseLike, name: str, on_failure: OnFailure = "raise"
) -> Array:
    """Return `raw` as an array (..., m) of finite numbers; raise, or set NaN, where not finite.

    With ``on_failure="nan"`` rows that are not finite become NaN.
    """
    expect_choice(on_failure)
    names = robot.column_names
    columns = names.get(name, names["pose"])
    array = as_array(raw, name, (len(columns),), columns=columns)
    good = np.isfinite(array)
    if good.all():
        if type(raw) in _TYPED and columns is names["pose"]:
            warn_of_unlikely(robot, columns, array)
        return array
    if on_failure == "raise":
        raise _not_finite(name, array, tuple(int(i) for i in np.argwhere(~good)[0]))
    return np.where(good.all(axis=-1, keepdims=True), array, np.nan)


def finite_pose(robot: Manipulator, raw: PoseLike, name: str) -> Array:
    """Return a pose or a table of one row as an array (m,); raise unless it is finite."""
    array = finite_rows(robot, raw, name)
    if array.size != robot.freedom:
        raise DataError(f"{name}: {array.size // robot.freedom} poses given, 1 expected")
    return array.reshape(robot.freedom)


def _not_finite(name: str, array: Array, index: tuple[int, ...]) -> DataError:
    """Return the error for the array element at `index` that is not finite or is far too large."""
    expected = "a finite number" if not np.isfinite(array[index]) else "a number of sensible size"
    return DataError(f"{name}{list(index)}: {array[index]} given, {expected} expected")


def _failure(
    robot: Manipulator, what: str, arguments: tuple[PoseLike, ...], status: Array, wrench: bool
) -> PteronError:
    """Return the error for the first state at which the kernel `what` failed."""
    index = tuple(int(i) for i in np.argwhere(status == 0.0)[0])
    ports = [p for p in numeric(robot, what, wrench=wrench).inputs if not p.shared]
    for port, argument in zip(ports, arguments, strict=True):
        array = as_array(argument, port.name, port.shape, columns=port.columns)
        state = np.broadcast_to(array, status.shape + port.shape)[index]
        bad = np.argwhere(~(np.abs(state) < 1e70))
        if len(bad):
            lead = array.ndim - len(port.shape)
            at = index[len(index) - lead :] if lead else ()
            at = tuple(i if n > 1 else 0 for i, n in zip(at, array.shape, strict=False))
            return _not_finite(port.name, array, (*at, *(int(i) for i in bad[0])))
        if port.name == "pose":
            pose = state
            all_bad = np.broadcast_to(array, status.shape + port.shape)[status == 0.0]
    others = len(all_bad) - 1
    many = f" ({others + 1} such poses in the batch)" if others else ""
    return _bad_pose(robot, pose, needs_of(what), index, many, far=_is_any_far(robot, all_bad))


def singular_angles(
    robot: Manipulator, pose: Array, index: tuple[int, ...], many: str = ""
) -> SingularPose:
    """Return the error for a pose at which the platform's angles are singular coordinates."""
    first, second, third = robot.platform.angles
    return SingularPose(
        f"{place('pose', index)}: the angles are singular where {second} is +-90 degrees, not the "
        f"machine: {first} and {third} turn alike there, so that their rates are not determined; "
        f"keep away from it, or give the machine's file other angles{many}",
        kind="angles",
        measure=float(robot.platform.angle_measures(pose)),
        index=index,
    )


def no_place(index: tuple[int, ...], many: str = "") -> UnreachablePose:
    """Return the error for a pose at which a tripod's points cannot lie in its legs' planes."""
    return UnreachablePose(
        f"{place('pose', index)}: the planes of the legs have no place for the platform's points "
        f"at this roll and pitch; move the pose towards level, or the planes nearer to P{many}",
        leg=0,
        shortfall=0.0,
        index=index,
    )


def place(name: str, index: tuple[int, ...]) -> str:
    """Return the name of an element of a batch: "pose[3]", or "pose" for a single one."""
    return f"{name}[{', '.join(map(str, index))}]" if index else name


def _is_any_far(robot: Manipulator, poses: Array) -> bool:
    """Return whether any of the poses (K, m) is so far out of reach that it is probably in mm.

    The first failed pose may be near: a motion in millimetres may begin at zero.
    """
    misses = -numeric(robot, "reach")(poses)[0]
    return bool((misses > _MILLIMETRES * np.array([leg.size for leg in robot.legs])).any())


def _bad_pose(
    robot: Manipulator,
    pose: Array,
    needs: tuple[str, ...],
    index: tuple[int, ...],
    many: str,
    *,
    far: bool,
) -> PteronError:
    """Return the error that explains a failed pose: out of reach or singular, with the leg."""
    where = place("pose", index)
    margin, type_i, spread, _ = numeric(robot, "reach")(pose)
    if "rows" in needs:
        constant_rows = [leg.row_is_constant for leg in closure_of(robot).legs]
        type_i[constant_rows] = 1.0
    if np.isnan(margin).any():
        return no_place(index, many)
    if np.isnan(type_i).any():
        i = int(np.isnan(type_i).argmax())
        leg, shortfall = robot.legs[i], max(-float(margin[i]), 0.0)
        units = "is it in millimetres? lengths are in metres"
        doubt = units if far else "move the pose towards the legs' reach"
        return UnreachablePose(
            f"{where}: leg {i + 1} misses it by {shortfall:.3g} m: {leg.reach_text}; {doubt}{many}",
            leg=i + 1,
            shortfall=shortfall,
            index=index,
            millimetres=far,
        )
    for i, leg in enumerate(robot.legs):
        undetermined = bool(spread[i] <= SAME * leg.size)
        if type_i[i] <= TYPE_I and (needs != ("reach",) or undetermined):
            cause = (
                "its two ends coincide, so that its elbow may be anywhere"
                if undetermined
                else f"{leg.singular_text} (type I; measure {type_i[i]:.1e}, less than six "
                f"digits are left below {TYPE_I:.0e})"
            )
            return SingularPose(
                f"{where}: singular for leg {i + 1}: {cause}; move away from the edge of its reach"
                f"{many}",
                kind="elbow" if undetermined else "I",
                measure=float(type_i[i]),
                index=index,
                leg=i + 1,
            )
    if "angles" in needs and robot.platform.angle_measures(pose) <= ANGLES:
        return singular_angles(robot, pose, index, many)
    if is_singular_everywhere(robot):
        return singular_everywhere(robot, index)
    measure = abs(float(numeric(robot, "type_ii")(pose)[0]))
    return SingularPose(
        f"{where}: singular (type II; measure {measure:.1e}, less than six digits are left below "
        f"{TYPE_II:.0e}): the actuators no longer hold the platform; move away from it{many}",
        kind="II",
        measure=measure,
        index=index,
    )


def same_joints(
    robot: Manipulator, joints: Array, other: Array, tolerance: ArrayLike = SAME
) -> NDArray[np.bool_]:
    """Return where joint coordinates (..., n) are equal, up to full turns of cranks: (..., n)."""
    differences = np.abs(joints - other)
    cranks = np.array([leg.joint.unit == "rad" for leg in robot.legs])
    turn = 2.0 * np.pi
    differences = np.where(cranks, np.abs((differences + np.pi) % turn - np.pi), differences)
    return np.asarray(differences <= tolerance)
