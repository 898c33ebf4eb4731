"""The tables of a machine's TOML file as pydantic models, with a description of each key.

Imported only where a file is read or written, since pydantic slows the start.
"""

from __future__ import annotations

from typing import Any, Literal

from pteron.bodies.tables import (
    Bar,
    Geared,
    Number,
    PlanarBody,
    Six,
    SpatialBody,
    Table,
    Three,
    Two,
    key,
)
from pteron.manipulator.manipulator import STANDARD_GRAVITY
from pteron.platforms.kinds import TILTING, AngleOrder, Motion


class ConeTable(Table):
    """`{ axis, angle }`: the cone in which a ball joint holds its rod."""

    axis: Three = key("from the joint along the rod, in the frame of what holds it")
    angle: Number = key("the greatest angle between axis and rod, rad")


class StribeckTable(Table):
    """`{ force, speed }` of what dry friction has more at rest."""

    force: Number = key("what is added at rest, N or N m")
    speed: Number = key("by which most of it is gone, m/s or rad/s")


class LuGreTable(Table):
    """`{ stiffness, damping }` of the bristles of dry friction."""

    stiffness: Number = key("at the joint, N/m or N m/rad")
    damping: Number = key("at the joint, N s/m or N m s/rad", 0.0)


class ElasticTable(Table):
    """`{ stiffness, damping, backlash, encoder }` of a transmission that bends."""

    stiffness: Number = key("at the joint, N/m or N m/rad")
    damping: Number = key("at the joint, N s/m or N m s/rad", 0.0)
    backlash: Number = key("play in all, at the joint, m or rad", 0.0)
    encoder: Literal["motor", "joint", "both"] = key(
        'where it is: "motor", "joint", or "both", which tell a controller the joint\'s coordinate '
        "and the motor's rate",
        "motor",
    )


class WindingTable(Table):
    """`{ resistance, torque_constant, voltage }` of the motor's winding and its supply."""

    resistance: Number = key("ohm")
    torque_constant: Number = key("N m/A, which is V s/rad")
    voltage: Number = key("of the supply, V")


class WaveTable(Table):
    """`{ order, size, phase }` of a wave of the motor's torque."""

    order: Number = key("waves in a turn of the motor")
    size: Number = key("share of the torque (ripple), or N m at the motor (cogging)")
    phase: Number = key("rad", 0.0)


class DriveTable(Table):
    """The drive of a joint: at the joint, but for what is said to be the motor's."""

    coulomb: Number = key("dry friction, N or N m", 0.0)
    viscous: Number = key("N s/m or N m s", 0.0)
    offset: Number = key("a constant force, N or N m", 0.0)
    rotor_inertia: Number = key("of the motor and what turns with it, kg m^2", 0.0, 3e-5)
    ratio: Number | None = key(
        "motor angle over the joint's coordinate, rad/m or rad/rad; 1 if left out", None, 392.7
    )
    rest_speed: Number = key(
        "within which dry friction changes its sign smoothly, m/s or rad/s", 1e-3
    )
    stribeck: StribeckTable | None = key(
        "what dry friction has more at rest", None, {"force": 1.2, "speed": 0.01}
    )
    lugre: LuGreTable | None = key(
        "bristles by which dry friction acts in simulation, in place of sticking fast",
        None,
        {"stiffness": 1e6, "damping": 200.0},
    )
    rated_torque: Number | None = key(
        "of the motor, N m: what commands in per cent are of", None, 0.64
    )
    max_force: Number | None = key("what the drive can do, N or N m", None, 120.0)
    max_speed: Number | None = key("m/s or rad/s", None, 1.5)
    counts_per_turn: Number | None = key(
        "of the motor's encoder in a turn of the motor: what logs in counts are in", None, 131072.0
    )
    elastic: ElasticTable | None = key(
        "a transmission that bends; friction is then the motor's, before it",
        None,
        {"stiffness": 2e6, "damping": 300.0, "backlash": 1e-5},
    )
    current_time: Number | None = key("time constant of the current loop, s", None, 2e-4)
    curve: list[Two] = key(
        "greatest force by speed, at the joint: pairs of speed and force",
        [],
        [[0.0, 120.0], [1.0, 120.0], [1.5, 40.0]],
    )
    winding: WindingTable | None = key(
        "the motor's winding, whose supply limits what it gives at speed",
        None,
        {"resistance": 0.5, "torque_constant": 0.1, "voltage": 48.0},
    )
    ripple: list[WaveTable] = key(
        "waves of the motor's torque, as shares of it", [], [{"order": 6.0, "size": 0.02}]
    )
    cogging: list[WaveTable] = key(
        "waves of the motor's torque without current, N m at the motor",
        [],
        [{"order": 42.0, "size": 0.005}],
    )


class _Motion(Table):
    motion: Motion = key(
        '"3T": x, y, z. "3T1R": also phi, about axis. "2T": x, y in the plane across '
        'axis. "2T1R": also phi. Tilting: "3T3R", "3R" and "2R" about center, "1T2R" of a tripod'
    )
    axis: Three = key(
        "k, which the platform turns about; the normal of a planar machine's plane; "
        "the platform frame's z at angles zero",
        (0.0, 0.0, 1.0),
    )
    x_axis: Three | None = key(
        "the platform frame's x at angles zero; needed unless axis is base frame's z",
        None,
        [1.0, 0.0, 0.0],
    )


class PlatformTable(PlanarBody, _Motion):
    """`[platform]`: its body's origin is P, its frame turns with phi."""

    slides: bool = key(
        "whether phi slides the platform points, m/rad, as an I4's nacelle does", False
    )
    limits: Two | None = key(
        "least and greatest phi, rad, where hinges allow no more; may be several turns",
        None,
        [-0.8, 0.8],
    )
    tool: Three = key("the tool's centre point in the platform frame, m", (0.0, 0.0, 0.0))
    bars: list[Bar] = key(
        "parts that move with a hinge of the platform and do not turn",
        [],
        [{"mass": 0.1, "hinge": [0.05, 0.0, 0.0]}],
    )
    geared: list[Geared] = key(
        "balanced parts, such as a tool, that a gear turns with the platform",
        [],
        [{"inertia": 6e-5, "ratio": 4.0}],
    )


class TiltingTable(SpatialBody, _Motion):
    """`[platform]` that tilts: its body's origin is P, its frame turns by the pose's angles."""

    angles: AngleOrder = key(
        'of 3T3R and 3R, "rpy": R = Rz(yaw) Ry(pitch) Rx(roll). "xyz": R = Rx(rx) Ry(ry) Rz(rz)',
        "rpy",
    )
    center: Three | None = key(
        "of 3R and 2R: P, on the joint that the platform turns about, m", None, [0.0, 0.0, 0.1]
    )
    second_axis: Three | None = key(
        "of 2R: what beta turns about, at alpha = 0; alpha turns about axis", None, [0.0, 1.0, 0.0]
    )
    limits: list[Two] | None = key(
        "least and greatest of each angle, rad", None, [[-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5]]
    )
    tool: Three = key("the tool's centre point in the platform frame, m", (0.0, 0.0, 0.0))


class ReadingTable(Table):
    """`reading`: how a drive counts its joint: coordinate = zero + scale reading."""

    zero: Number = key("the coordinate where it reads 0, m or rad", 0.0)
    scale: Number = key("coordinate per unit of the reading", 1.0)


def platform_table(motion: Any) -> type[PlatformTable] | type[TiltingTable]:
    """Return what a platform of a motion holds; one that is not known as if it did not tilt."""
    return TiltingTable if motion in TILTING else PlatformTable


class RadiiTable(Table):
    """`radii`: how thick the bodies are, as capsules round their centre lines."""

    guide: Number = key("of a slider's guide, m", 0.0)
    upper: Number = key("of an upper link or a crank, m", 0.0)
    lower: Number = key("of a last link or each rod, m", 0.0)
    platform: Number = key("of the platform's arms, m", 0.0)


class ToolTable(Table):
    """`[[tools]]`: a tool that the platform can carry, which --tool and `with_tool` mount."""

    name: str = key("what it is called")
    point: Three = key("its centre point in the platform frame, m", (0.0, 0.0, 0.0))
    mass: Number = key("kg", 0.0)
    center_of_mass: Three | None = key(
        "in the platform frame, m; its point if left out", None, [0.0] * 3
    )
    central_inertia: Number | Six = key(
        "about its own centre of mass, kg m^2: along axis; where the platform tilts "
        "[Ixx, Ixy, Ixz, Iyy, Iyz, Izz]",
        0.0,
    )


class MachineTable(Table):
    """The whole file; each of `legs` is read by its own kind."""

    name: str = key("what the machine is called")
    gravity: Three = key("acceleration of gravity in the base frame, m/s^2", STANDARD_GRAVITY)
    radii: RadiiTable | None = key(
        "how thick the bodies are round their centre lines, m: for clearances",
        None,
        {"guide": 0.01, "upper": 0.01, "lower": 0.008, "platform": 0.01},
    )
    tools: list[ToolTable] = key(
        "tools that the platform can carry, beside what it is",
        [],
        [{"name": "gripper", "point": [0.0, 0.0, -0.08], "mass": 0.3}],
    )
    platform: PlatformTable = key("what the legs carry")
    legs: list[Any] = key("one table for each freedom of the platform")


class TiltingMachineTable(MachineTable):
    """The same of a machine whose platform tilts."""

    platform: TiltingTable = key("what the legs carry")  # type: ignore[assignment]
