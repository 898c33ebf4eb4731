"""Klipper's configuration of a machine: generic_cartesian, delta or rotary_delta.

What Klipper computes is in its klippy/kinematics/ (generic_cartesian.py with kinematic_stepper.py,
delta.py, rotary_delta.py) and klippy/chelper/ (kin_generic.c, kin_delta.c, kin_rotary_delta.c). It
takes machines that move x, y and z alone: those whose joints are linear in the pose, and Deltas as
regular as its own few numbers say.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import casadi as ca
import numpy as np

from pteron.atomic import write_texts
from pteron.equations.machine import Machine
from pteron.errors import ModelError
from pteron.export.c import prefix_of
from pteron.export.descriptions import banner
from pteron.kernels import Array
from pteron.kernels.code import rendered
from pteron.kinematics import inverse_kinematics, jacobian, random_poses
from pteron.kinematics.evaluate import unchecked
from pteron.legs.leg import Sphere
from pteron.manipulator import Manipulator, expect_manipulator

_SAME = 1e-6
"""Metres, or a unit vector's part, that a machine may differ from what Klipper takes."""

_ZERO = 5e-13
"""A coefficient below it is left out: over a metre it is less than a picometre."""

_LEAST_DETERMINANT = 1e-5
"""Below it Klipper (generic_cartesian.py) holds that the steppers cannot move all axes."""

_INSTEAD = "use --linuxcnc, or --c for a controller of your own"


@dataclass(frozen=True)
class Section:
    """A section of the configuration: entries, with None for what only the builder knows."""

    title: str
    entries: tuple[tuple[str, str | None], ...]
    comments: tuple[str, ...] = ()


def export_klipper(robot: Manipulator, folder: str | Path = ".") -> list[Path]:
    """Write the kinematic sections of a Klipper configuration, NAME.cfg.

    A machine whose joints are linear in the pose, as a Tripteron, becomes `generic_cartesian`; a
    Delta with vertical guides `delta`; one with cranks `rotary_delta`, if its towers or shoulders
    stand as regularly as Klipper has them. X, Y and Z are the position of P in mm, not of the tool.
    Pins, speeds and homing are left to who builds the machine.

    Parameters
    ----------
    robot : Manipulator
        The machine; its name becomes the file's.
    folder : path
        Where; made if it is missing.

    Returns
    -------
    list of Path
        The file written.

    Raises
    ------
    ModelError
        If Klipper cannot move this machine: what differs, and what to use instead.
    OutputError
        If the folder cannot be written.

    Examples
    --------
    >>> import pteron, tempfile
    >>> from pteron.export import export_klipper
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     (path,) = export_klipper(pteron.load("tripteron-oblique"), folder)
    ...     print(next(line for line in path.read_text().splitlines() if "carriages:" in line))
    carriages: 1.063829787234042*x+0.310283687943262*z
    """
    expect_manipulator(robot)
    if robot.platform.coordinates != ("x", "y", "z"):
        pose = ", ".join(robot.platform.coordinates)
        raise ModelError(
            f"{robot.name}: Klipper moves x, y and z alone, and this machine's pose is {pose}; "
            f"{_INSTEAD}"
        )
    sections = tuple(_sections(robot))
    prefix = prefix_of(robot)
    text = rendered(
        "pteron.export",
        "klipper.cfg.j2",
        banner=[line for line in banner(robot, "Klipper configuration") if "SI units" not in line],
        sections=sections,
        tool=[1000.0 * v for v in robot.platform.tool],
    )
    return write_texts(folder, {f"{prefix}.cfg": text})


def _sections(robot: Manipulator) -> Iterator[Section]:
    machine = Machine.of(robot)
    if all(leg.row_is_constant for leg in machine.legs):
        return _cartesian(robot)
    centers = [_Center.of(machine, i) for i in range(3)]
    if all(center is not None for center in centers):
        found = [center for center in centers if center is not None]
        if all(center.slides for center in found):
            return _delta(robot, found)
        if not any(center.slides for center in found):
            return _rotary(robot, found)
    raise ModelError(
        f"{robot.name}: its legs are neither all linear in the pose, nor those of a Delta with "
        f"guides or with cranks, which is what Klipper knows; {_INSTEAD}"
    )


# Machines whose joints are linear in the pose


def _cartesian(robot: Manipulator) -> Iterator[Section]:
    rows = np.asarray(jacobian(robot, np.zeros(3)))
    offsets = 1000.0 * np.asarray(unchecked(robot, "joint_coordinates", np.zeros(3)))
    size = float(np.linalg.det(rows.T @ rows))
    if size < _LEAST_DETERMINANT:
        raise ModelError(
            f"{robot.name}: its directions are so close to a plane (det(J^T J) = {size:.1e}) that "
            f"Klipper, which asks for 1e-5, refuses them; {_INSTEAD}"
        )
    yield Section("printer", (("kinematics", "generic_cartesian"), *_SPEEDS))
    box, comments = _box(robot, rows, offsets)
    straight = ((np.abs(rows) > _ZERO).sum(axis=1) == 1).all()
    homing = (
        "Each slider moves along one axis: its end stop is that axis' own."
        if straight
        else "The sliders move along oblique directions, but Klipper homes x, y and z: an end stop "
        "at a slider is none of an axis. Home with [homing_override] and SET_KINEMATIC_POSITION."
    )
    for axis, (least, most) in zip("xyz", box, strict=True):
        yield Section(
            f"carriage {axis}",
            (
                ("position_min", least),
                ("position_max", most),
                ("position_endstop", None),
                ("endstop_pin", None),
            ),
            (homing, *comments) if axis == "x" else (),
        )
    for i, (leg, row, offset) in enumerate(zip(robot.legs, rows, offsets, strict=True), start=1):
        joint = f"{leg.joint.coordinate}{i}"
        yield Section(
            f"stepper {joint}",
            (
                ("carriages", _sum(row)),
                ("rotation_distance", _rotation_distance(robot, i - 1)),
                *_PINS,
            ),
            (f"Its position is {joint} in mm {_signed(-offset)} mm.",),
        )


def _sum(row: Array) -> str:
    """Return a linear combination as kinematic_stepper.py reads it: no blanks, no exponents."""
    terms: list[str] = []
    for axis, value in zip("xyz", row, strict=True):
        if abs(value) <= _ZERO:
            continue
        sign = "-" if value < 0.0 else "+" if terms else ""
        text = f"{abs(value):.15f}".rstrip("0").rstrip(".")
        terms.append(sign + (axis if text == "1" else f"{text}*{axis}"))
    return "".join(terms)


def _box(
    robot: Manipulator, rows: Array, offsets: Array
) -> tuple[list[tuple[str | None, str | None]], tuple[str, ...]]:
    """Return ranges of x, y and z, mm, that keep the joints' limits, and what to say of them."""
    if any(leg.limits is None for leg in robot.legs):
        return [(None, None)] * 3, ("The machine's file has no limits of the joints.",)
    limits = 1000.0 * np.array([leg.limits for leg in robot.legs]) - offsets[:, None]
    middle = np.linalg.solve(rows, limits.mean(axis=1))
    # The largest cube about the middle; along axes that a slider has for itself, all of its way.
    half = np.ptp(limits, axis=1) / 2.0
    sides = np.full(3, (half / np.abs(rows).sum(axis=1)).min())
    for row, reach in zip(rows, half, strict=True):
        (own,) = np.nonzero(np.abs(row) > _ZERO)
        if len(own) == 1 and (np.abs(rows[:, own[0]]) > _ZERO).sum() == 1:
            sides[own[0]] = reach / abs(row[own[0]])
    grid = middle + sides * np.array(list(product(np.linspace(-1.0, 1.0, 9), repeat=3)))
    reached = np.isfinite(inverse_kinematics(robot, grid / 1000.0, on_failure="nan")).all(axis=1)
    told = ["This box keeps the joints' limits; Klipper checks the box and no leg's reach."]
    if not reached.all():
        share = 100.0 * (1.0 - reached.mean())
        told.append(
            f"In {share:.0f} % of it a leg does not reach: make it smaller, by `pteron workspace`."
        )
    box = [(f"{m - s:.6g}", f"{m + s:.6g}") for m, s in zip(middle, sides, strict=True)]
    return [(least, most) for least, most in box], tuple(told)


# Deltas


@dataclass(frozen=True)
class _Center:
    """Where the centre of the sphere that P moves on is while a joint q is held.

    It is at + q along, or at + along cos(q) + across sin(q); P is the platform's reference point.
    """

    leg: int
    at: Array
    along: Array
    across: Array | None
    radius: float

    @property
    def slides(self) -> bool:
        return self.across is None

    @classmethod
    def of(cls, machine: Machine, leg: int) -> _Center | None:
        """Return that of a leg, None if its platform point is not on a sphere, or P moves else."""
        q = ca.SX.sym("q")
        locus, offset = machine.legs[leg].locus(q), machine.platform.offsets[leg]
        if not isinstance(locus, Sphere):
            return None
        function = ca.Function(
            "center", [q], [locus.center - offset.a - offset.still, locus.radius]
        )

        def center(value: float) -> Array:
            return np.array(function(value)[0]).ravel()

        radius = float(function(0.0)[1])
        start, step = center(0.0), center(1.0) - center(0.0)
        if np.allclose(center(2.0), start + 2.0 * step, rtol=0.0, atol=1e-12):
            return cls(leg, start, step, None, radius)
        half, quarter = center(math.pi), center(0.5 * math.pi)
        at = 0.5 * (start + half)
        along, across = start - at, quarter - at
        if np.allclose(
            center(1.0), at + math.cos(1.0) * along + math.sin(1.0) * across, 0.0, 1e-12
        ):
            return cls(leg, at, along, across, radius)
        return None


def _delta(robot: Manipulator, centers: Sequence[_Center]) -> Iterator[Section]:
    """Yield the sections of `delta`: stepper = z + sqrt(arm^2 - (x - tower x)^2 - ...)."""
    radii, angles, rises = [], [], []
    for i, center in enumerate(centers, start=1):
        rise = center.along[2]
        if np.abs(center.along[:2]).max() > _SAME:
            raise _differs(robot, i, "its guide is not vertical, along z", "delta")
        radii.append(float(np.hypot(*center.at[:2])))
        angles.append(_degrees(center.at))
        rises.append(float(np.sign(rise)))
    radius = _common(robot, radii, "is {:.6g} mm from the z axis", "delta")
    arms = [center.radius for center in centers]
    _longer(robot, arms, radius)
    # Klipper's carriage is above the platform; ours is where inverse kinematics puts it.
    poses = random_poses(robot, 50, seed=1, type_i=0.02, type_ii=0.0, limits=False)
    joints = inverse_kinematics(robot, poses)
    for i, (center, rise) in enumerate(zip(centers, rises, strict=True), start=1):
        height = center.at[2] + rise * joints[:, i - 1]
        if not (height > poses[:, 2]).all():
            told = "its slider is below the platform, and Klipper has it above: turn the model over"
            raise _differs(robot, i, told, "delta")
    yield Section(
        "printer",
        (
            ("kinematics", "delta"),
            *_SPEEDS,
            ("delta_radius", _mm(radius)),
            ("minimum_z_position", None),
            ("print_radius", None),
        ),
        ("Klipper's z is the pose's z, in mm.",),
    )
    for name, center, rise, arm, angle in zip("abc", centers, rises, arms, angles, strict=True):
        leg = robot.legs[center.leg]
        joint = f"{leg.joint.coordinate}{center.leg + 1}"
        top = None
        if leg.limits is not None:
            highest = center.at[2] + rise * leg.limits[1 if rise > 0.0 else 0]
            top = _mm(highest - math.sqrt(arm**2 - radius**2))
        yield Section(
            f"stepper_{name}",
            (
                ("angle", _number(angle)),
                ("arm_length", _mm(arm)),
                ("position_endstop", top),
                ("rotation_distance", _rotation_distance(robot, center.leg)),
                ("endstop_pin", None),
                *_PINS,
            ),
            (
                f"Its position is {'' if rise > 0.0 else '-'}{joint} in mm "
                f"{_signed(1000.0 * center.at[2])} mm.",
                *_top(top, "carriage"),
            ),
        )


def _rotary(robot: Manipulator, centers: Sequence[_Center]) -> Iterator[Section]:
    """Yield the sections of `rotary_delta`: arms that turn in vertical planes through z."""
    kind = "rotary_delta"
    radii, heights, angles, lifts, zeros = [], [], [], [], []
    for i, center in enumerate(centers, start=1):
        assert center.across is not None  # it turns
        out = np.array([*center.at[:2], 0.0]) / np.hypot(*center.at[:2])
        axis = np.cross(center.along, center.across)
        axis /= np.linalg.norm(axis)
        if abs(axis[2]) > _SAME:
            raise _differs(robot, i, "its crank's axis is not horizontal", kind)
        aside = 1000.0 * float(center.at @ axis)
        if abs(aside) > 1000.0 * _SAME:
            told = f"its crank's plane passes the z axis at {abs(aside):.6g} mm, not through it"
            raise _differs(robot, i, told, kind)
        lifts.append(float(np.sign(np.cross(out, [0.0, 0.0, 1.0]) @ axis)))
        zeros.append(math.atan2(center.along[2], center.along @ out))
        radii.append(float(np.hypot(*center.at[:2])))
        heights.append(float(center.at[2]))
        angles.append(_degrees(center.at))
    radius = _common(robot, radii, "has its shoulder {:.6g} mm from the z axis", kind)
    height = _common(robot, heights, "has its shoulder at z = {:.6g} mm", kind)
    uppers = [float(np.linalg.norm(center.along)) for center in centers]
    arms = [center.radius for center in centers]
    bed = _bed(robot, radius, height, uppers, arms)
    _outside(robot, centers, lifts, zeros, height)
    tops = [
        _rotary_top(robot.legs[k].limits, lift, zero, radius, upper, arm)
        for k, (lift, zero, upper, arm) in enumerate(zip(lifts, zeros, uppers, arms, strict=True))
    ]
    yield Section(
        "printer",
        (
            ("kinematics", kind),
            *_SPEEDS,
            ("shoulder_radius", _mm(radius)),
            ("shoulder_height", _mm(height - bed)),
            ("minimum_z_position", None),
        ),
        (
            f"Klipper's z = 0, the bed, is the pose's z = {1000.0 * bed:.6g} mm.",
            "Its z counts from there; for another bed change shoulder_height and the end stops.",
        ),
    )
    for k, name in enumerate("abc"):
        leg = robot.legs[k]
        joint = f"{leg.joint.coordinate}{k + 1}"
        top = tops[k]
        end = None if top is None else _mm(height + top - bed)
        yield Section(
            f"stepper_{name}",
            (
                ("angle", _number(angles[k])),
                ("upper_arm_length", _mm(uppers[k])),
                ("lower_arm_length", _mm(arms[k])),
                ("position_endstop", end),
                ("gear_ratio", _gear(robot, k)),
                ("endstop_pin", None),
                *_PINS,
            ),
            (
                f"Its position is {'' if lifts[k] > 0.0 else '-'}{joint} in rad "
                f"{_signed(zeros[k])} rad: 0 where the arm is level, growing as it lifts.",
                *_top(end, "arm"),
            ),
        )


def _outside(
    robot: Manipulator,
    centers: Sequence[_Center],
    lifts: Sequence[float],
    zeros: Sequence[float],
    height: float,
) -> None:
    """Refuse a machine whose elbows are not where kin_rotary_delta.c takes them: outside.

    The platform is below the shoulders; of the two elbows it takes that of the greater angle.
    """
    poses = random_poses(robot, 500, seed=1, type_i=0.05, type_ii=0.0, limits=False)
    poses = poses[poses[:, 2] < height]
    if len(poses) == 0:
        raise ModelError(
            f"{robot.name}: its platform is above the shoulders, and Klipper's rotary_delta has it "
            f"below: turn the model over; or {_INSTEAD}"
        )
    joints = inverse_kinematics(robot, poses)
    for i, (center, lift, zero) in enumerate(zip(centers, lifts, zeros, strict=True)):
        out = np.array([*center.at[:2], 0.0]) / np.hypot(*center.at[:2])
        angle = lift * joints[:, i] + zero
        wrist = poses - center.at
        down = np.arctan2(wrist[:, 2], wrist @ out)
        if (np.sin(angle - down) < 0.0).any():
            told = (
                "its elbow is inside while the platform is below, and Klipper has it outside; turn "
                "a model over whose platform is above"
            )
            raise _differs(robot, i + 1, told, "rotary_delta")


def _bed(
    robot: Manipulator, radius: float, height: float, uppers: Sequence[float], arms: Sequence[float]
) -> float:
    """Return the pose's z of Klipper's bed: 0 if the shoulders are above it, else the lowest z."""
    if height > _SAME:
        return 0.0
    reach = min(
        math.sqrt((upper + arm) ** 2 - radius**2) for upper, arm in zip(uppers, arms, strict=True)
    )
    return math.floor(1000.0 * (height - reach)) / 1000.0


def _rotary_top(
    limits: tuple[float, float] | None,
    lift: float,
    zero: float,
    radius: float,
    upper: float,
    arm: float,
) -> float | None:
    """Return z over the shoulder, on the axis, where a crank is as high as its limits let it."""
    if limits is None:
        return None
    angle = zero + lift * limits[1 if lift > 0.0 else 0]
    across = radius + upper * math.cos(angle)
    if abs(across) >= arm:
        return None
    return upper * math.sin(angle) - math.sqrt(arm**2 - across**2)


# What the kinds share

_SPEEDS: tuple[tuple[str, None], ...] = (("max_velocity", None), ("max_accel", None))
_PINS: tuple[tuple[str, None], ...] = (
    ("step_pin", None),
    ("dir_pin", None),
    ("enable_pin", None),
    ("microsteps", None),
)


def _differs(robot: Manipulator, leg: int, told: str, kind: str) -> ModelError:
    return ModelError(f"{robot.name}: Klipper's {kind} does not fit leg {leg}: {told}; {_INSTEAD}")


def _common(robot: Manipulator, values: Sequence[float], told: str, kind: str) -> float:
    """Return the value that the legs share.

    Raises
    ------
    ModelError
        If they do not, by more than a micrometre.
    """
    for i, value in enumerate(values[1:], start=2):
        if abs(value - values[0]) > _SAME:
            one, other = (round(1000.0 * v, 6) + 0.0 for v in (value, values[0]))
            text = f"{told.format(one)}, leg 1 {other:.6g} mm"
            raise _differs(robot, i, text, kind)
    return float(np.mean(values))


def _longer(robot: Manipulator, arms: Sequence[float], radius: float) -> None:
    for i, arm in enumerate(arms, start=1):
        if arm <= radius:
            told = f"its rod of {1000.0 * arm:.6g} mm is shorter than the radius, {_mm(radius)} mm"
            raise _differs(robot, i, told, "delta")


def _degrees(point: Array) -> float:
    angle = math.degrees(math.atan2(point[1], point[0])) % 360.0
    return 0.0 if 360.0 - angle < 1e-9 else angle


def _mm(metres: float) -> str:
    return _number(1000.0 * metres)


def _number(value: float) -> str:
    text = f"{value:.12f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def _signed(value: float) -> str:
    return f"{'-' if value < 0.0 else '+'} {abs(value):.9g}"


def _top(end: str | None, what: str) -> tuple[str, ...]:
    if end is None:
        return ()
    return (f"position_endstop: the {what} at its upper limit; measure it on the machine.",)


def _rotation_distance(robot: Manipulator, leg: int) -> str | None:
    """Return mm a turn of the motor, None where the machine's file does not say."""
    drive = robot.legs[leg].drive
    if drive is None or drive.ratio is None:
        return None
    return _number(2000.0 * math.pi / abs(drive.ratio))


def _gear(robot: Manipulator, leg: int) -> str | None:
    drive = robot.legs[leg].drive
    return None if drive is None or drive.ratio is None else f"{_number(abs(drive.ratio))}:1"
