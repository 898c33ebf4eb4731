"""Export of kinematics for LinuxCNC: a component around the exported C, with INI and HAL lines.

The component has the three functions that LinuxCNC 2.8 and 2.9 require of a kinematics module, and
converts millimetres and degrees. A machine whose joints are linear in x, y and z may use LinuxCNC's
own matrixkins instead, for which the numbers are written too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pteron.equations.machine import Machine, closure_of
from pteron.export.c import c_texts
from pteron.export.descriptions import banner
from pteron.export.functions import exported_functions
from pteron.export.names import add_checksum, prefix_of
from pteron.export.start_pose import start_pose
from pteron.export.writing import write_export
from pteron.kernels import Array
from pteron.kernels.code import render_template
from pteron.kinematics import inverse_kinematics, jacobian
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.manipulator.readings import remove_readings
from pteron.platforms import Platform
from pteron.platforms.joints import platform_joints

_MILLIMETRES = 1000.0
"""Units of length of LinuxCNC in a metre."""

_DEGREES = 180.0 / math.pi
"""Units of angle of LinuxCNC in a radian."""

_LONGEST = 26
"""Characters of a module's name before "kins": rtapi.h has 31 in all (RTAPI_NAME_LEN)."""

_THEIRS = (
    *("corexy", "genhex", "genser", "gentriv", "lineardelta", "matrix", "max", "penta", "puma"),
    *("rose", "rotarydelta", "rotate", "scara", "tripod", "triv", "user"),
)
"""Names of LinuxCNC 2.9's own kinematics modules, before "kins"."""


_LETTERS = dict.fromkeys(("roll", "rx", "alpha"), "A") | dict.fromkeys(("pitch", "ry", "beta"), "B")
_LETTERS |= dict.fromkeys(("yaw", "rz"), "C") | {"x": "X", "y": "Y", "z": "Z"}
"""Axes of LinuxCNC for coordinates; phi has that of its axis."""


@dataclass(frozen=True)
class LinuxCncAxis:
    """A coordinate of the pose and the axis of LinuxCNC that it is."""

    letter: str
    field: str
    """Field of EmcPose."""
    name: str
    scale: float
    """LinuxCNC's units, mm or degrees, per m or rad; negative where it counts the other way."""


@dataclass(frozen=True)
class _Joint:
    """A joint of the INI and HAL files, in mm or degrees."""

    name: str
    angular: bool
    scale: float
    middle: float | None
    """Rad: a crank's angle is given less than half a turn from it; None of what is no crank."""
    home: float
    counted: tuple[float, float] | None
    """The coordinate where its drive reads 0, mm or degrees, and its scale; None: as the joint."""
    least: float | None
    most: float | None
    speed: float | None
    """These, and `home`, in mm or degrees, the speed per second; None where the file has none."""


@dataclass(frozen=True)
class _Arm:
    """The vector from P to the tool, m along the pose's lengths: still + cos phi a + sin phi b."""

    still: Array
    cosine: Array
    sine: Array

    @classmethod
    def from_platform(cls, platform: Platform) -> _Arm:
        """Return the arm of a platform that does not tilt."""
        x, y, z = (platform.directions @ axis for axis in platform.frame)
        a, b, c = platform.tool
        if not platform.angles:
            return cls(a * x + b * y + c * z, np.zeros_like(x), np.zeros_like(x))
        return cls(c * z, a * x + b * y, a * y - b * x)

    def __bool__(self) -> bool:
        return any(part.any() for part in (self.still, self.cosine, self.sine))

    @property
    def turns(self) -> bool:
        """Whether the arm depends on phi."""
        return bool(self.cosine.any())

    @property
    def rows(self) -> list[list[float]]:
        """The coefficients (still, cos phi, sin phi) of each length."""
        parts = (part.tolist() for part in (self.still, self.cosine, self.sine))
        return [list(row) for row in zip(*parts, strict=True)]


@dataclass(frozen=True)
class _TurnedArm:
    """The vector from P to the tool of a platform that tilts, which turns as that does."""

    zero: Array
    """At angles zero, m, in the base frame."""
    turns: tuple[tuple[Array, int], ...]
    """Axes and the places of their angles in the pose, in the order in which they turn it."""
    upright: Array
    """The platform's z at angles zero, along which HAL's offsets of the tool count."""
    directions: Array

    @classmethod
    def from_platform(cls, platform: Platform, pose: Array) -> _TurnedArm:
        """Return the arm of a platform that tilts, with the axes it turns about at a pose."""
        places = {name: k for k, name in enumerate(platform.coordinates)}
        # A tripod's yaw, which is none of the pose, does not move the tool along its z.
        chain = platform_joints(platform, pose)
        turns = [(j.axis, places[j.name]) for j in chain if not j.is_prismatic and j.name in places]
        *_, upright = frame = np.array(platform.frame)
        zero = np.array(platform.tool) @ frame
        return cls(zero, tuple(reversed(turns)), upright, platform.directions)


def export_linuxcnc(robot: RobotLike, folder: str | Path = ".") -> list[Path]:
    """Write a machine's kinematics for LinuxCNC, with lines for its INI and HAL files.

    The component is built by `halcompile --install NAMEkins.comp` and gives LinuxCNC 2.8 and 2.9
    `kinematicsForward`, `kinematicsInverse` and `kinematicsType`. Axes X, Y and Z are the position
    of the tool, in mm; for planar machines X and Y are its two lengths; phi, in degrees, is A, B or
    C where the platform turns about x, y or z, else C. Joints are in mm or degrees. Of the poses
    that joints allow, forward kinematics return the one nearest to the last.

    Of a platform that tilts, A, B and C are roll, pitch and yaw (rx, ry and rz; A and B are alpha
    and beta), in degrees, as `genhexkins` has them, in whose place the component may stand: it has
    its pins `tool-offset` and `spindle-offset`, `x` to `c` and `fwd-kins-fail`, and shows the
    machine's points at `base.N.x` to `platform.N.z`; what else that one sets is here the file's.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; its name becomes the files' prefix.
    folder : path
        Where; made if it is missing.

    Returns
    -------
    list of Path
        NAMEkins.comp, NAME.ini, NAME.hal, and for machines linear in x, y and z
        NAME_matrixkins.hal.

    Raises
    ------
    ModelError
        If the machine has no pose to home at.
    OutputError
        If the folder cannot be written.

    Examples
    --------
    >>> import pteron, tempfile
    >>> from pteron.export import export_linuxcnc
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     files = export_linuxcnc(pteron.load("quadrupteron"), folder)
    >>> [path.name for path in files]
    ['quadrupteronkins.comp', 'quadrupteron.ini', 'quadrupteron.hal']
    """
    machine = as_manipulator(robot)
    robot = remove_readings(machine)  # LinuxCNC converts them itself, by SCALE and HOME_OFFSET
    prefix = prefix_of(robot)
    closed = closure_of(robot).closed_form
    names = ("inverse_kinematics", "direct_kinematics" if closed else "direct_step")
    exported = exported_functions(
        robot, names, specialised=True, wrench=False, output="force", base=None
    )
    texts = c_texts(robot, exported)
    home = start_pose(robot)
    axes, joints = linuxcnc_axes(robot), tuple(_joints(machine, home))
    platform, seen = robot.platform, home.copy()
    seen[~platform.angular] += platform.directions @ (platform.tool @ platform.placement(home)[1])
    tilted = _TurnedArm.from_platform(platform, home) if platform.tilts else None
    arm = None if tilted else _Arm.from_platform(platform)
    places = {a.letter: f"{a.scale * at:z.6f}" for a, at in zip(axes, seen, strict=True)}
    variables = {
        "banner": [line for line in banner(robot, "LinuxCNC") if "SI units" not in line],
        "prefix": prefix,
        "upper": prefix.upper(),
        "name": _component(prefix),
        # One file, since halcompile takes one.
        "code": texts[f"{prefix}.h"] + texts[f"{prefix}.c"].partition("#include <math.h>\n")[2],
        "axes": axes,
        "joints": joints,
        "freedom": robot.freedom,
        "modes": exported[1].outputs[0].shape[0] if closed else 0,
        "lengths": len(platform.lengths),
        "free": platform.turning_axis is not None and bool(robot.wraps.any()),
        "places": [places.get(letter, "0") for letter in "XYZABC"],
        "planar": platform.plane_normal is not None,
        "arm": arm if tilted is None else bool(platform.lengths),
        "tilted": tilted,
        "points": [
            (_MILLIMETRES * np.array([leg.guide_point, leg.platform_point])).tolist()
            for leg in robot.legs
        ],
        "number": repr,
    }
    files = {
        f"{_component(prefix)}.comp": render_template("pteron.export", "kins.comp.j2", **variables),
        f"{prefix}.ini": render_template("pteron.export", "linuxcnc.ini.j2", **variables),
        f"{prefix}.hal": render_template("pteron.export", "linuxcnc.hal.j2", **variables),
    }
    if arm is not None and _linear(robot):
        rows = np.asarray(jacobian(robot, np.zeros(3)))
        zero = np.asarray(evaluate_unchecked(robot, "joint_coordinates", np.zeros(3)))
        offsets = _MILLIMETRES * (zero - rows @ arm.still)
        files[f"{prefix}_matrixkins.hal"] = render_template(
            "pteron.export", "matrixkins.hal.j2", rows=rows.tolist(), offsets=offsets, **variables
        )
    # halcompile reads what the locale says: nothing but ASCII.
    plain = {name: text.encode("ascii", "replace").decode() for name, text in files.items()}
    return write_export(folder, plain)


def _component(prefix: str) -> str:
    """Return a module name that LinuxCNC can load and does not use itself."""
    if prefix in _THEIRS or len(prefix) > _LONGEST:
        prefix = add_checksum(prefix, prefix, _LONGEST)
    return f"{prefix}kins"


def _linear(robot: Manipulator) -> bool:
    """Return whether the joints are linear in x, y and z, which are all of the pose."""
    legs = Machine.numeric(robot).legs
    return robot.platform.coordinates == ("x", "y", "z") and all(
        leg.row_is_constant for leg in legs
    )


def linuxcnc_axes(robot: Manipulator) -> tuple[LinuxCncAxis, ...]:
    """Return the LinuxCNC axes of the pose's coordinates."""
    axes = []
    for name, unit in zip(robot.coordinates, robot.units, strict=True):
        if name in _LETTERS:
            letter, angle = _LETTERS[name], unit == "rad"
            field = letter.lower() if angle else f"tran.{letter.lower()}"
            axes.append(LinuxCncAxis(letter, field, name, _DEGREES if angle else _MILLIMETRES))
            continue
        axis = np.array(robot.platform.axis)
        place = int(np.abs(axis).argmax())
        aligned = np.abs(axis[place]) > 1.0 - 1e-12 and robot.platform.plane_normal is None
        letter = "ABC"[place] if aligned else "C"
        sign = float(np.sign(axis[place])) if aligned else 1.0
        axes.append(LinuxCncAxis(letter, letter.lower(), name, sign * _DEGREES))
    return tuple(axes)


def _joints(robot: Manipulator, home: Array) -> Iterator[_Joint]:
    """Yield the legs' joints with scales, home position and limits, in mm and degrees."""
    coordinates = inverse_kinematics(robot, home)
    for i, (leg, at) in enumerate(zip(robot.legs, coordinates, strict=True), start=1):
        angular = leg.joint.unit == "rad"
        scale = _DEGREES if angular else _MILLIMETRES
        least, most = leg.limits or (None, None)
        speed = leg.drive.max_speed if leg.drive else None
        middle, turns = None, 0.0
        if leg.goes_round:  # limits may hold half a turn, where angles jump
            middle = 0.0 if leg.limits is None else sum(leg.limits) / 2.0
            turns = math.floor((middle - at) / (2.0 * math.pi) + 0.5)
        yield _Joint(
            f"{leg.joint.coordinate}{i}",
            angular,
            scale,
            middle,
            scale * (float(at) + 2.0 * math.pi * turns),
            (scale * leg.reading.zero, leg.reading.scale) if leg.reading else None,
            *(None if v is None else scale * v for v in (least, most, speed)),
        )
