"""`pteron new`: a file for a machine of one's own, from what its owner measures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pteron.cli.arguments import split_numbers
from pteron.cli.machines import catalog
from pteron.cli.progress import spinner
from pteron.cli.quantities import length_doubts, quantity, quantity_range, required_quantity
from pteron.cli.result import CommandResult
from pteron.cli.terminal import plain, warn, write
from pteron.errors import DataError, OutputError

if TYPE_CHECKING:
    from pteron.legs.screw import Screw
    from pteron.manipulator import Manipulator
    from pteron.manipulator.joint_pairs import Plate


@dataclass(frozen=True)
class Dimensions:
    """Dimensions of a machine, as typed."""

    base_radius: str | None = None
    base_pair: str | None = None
    base_sides: str | None = None
    platform_radius: str | None = None
    platform_pair: str | None = None
    platform_sides: str | None = None
    height: str | None = None
    crank: str | None = None
    rod: str | None = None
    crank_plane: str | None = None
    limits: str | None = None
    cone: str | None = None


@dataclass(frozen=True)
class Masses:
    """Masses of a machine, as typed."""

    platform_mass: str | None = None
    rider: str | None = None
    upper_mass: str | None = None
    lower_mass: str | None = None
    mass_from: list[str] | None = None


@dataclass(frozen=True)
class Transmission:
    """What moves the actuated joints, as typed."""

    lead: str | None = None
    gear: str | None = None
    screw: str | None = None
    efficiency: str | None = None
    rotor_inertia: str | None = None


def new(
    kind: str | None = None,
    *,
    dimensions: Dimensions,
    masses: Masses,
    transmission: Transmission,
    out: str | None = None,
    overwrite: bool = False,
) -> CommandResult:
    """Write a file for a machine of your own, with a comment that explains every key.

    The file describes a machine like KIND, for you to edit; without KIND the kinds are listed. The
    options apply to all legs. A length is in m, or has its unit behind it: 0.25, 250mm, 9.8in; an
    angle likewise, 0.17 or 10deg; a mass 0.3 or 300g. What is still as in KIND is listed, here and
    by check, report and cycle, until the file changes or confirms it.

    With dimensions of a hexapod, home is level where rams or cranks are at the middle of their
    limits, or at --height, and cones of ball joints have their middle along the legs there.

    Arguments
    ---------
    KIND: A machine of the catalog, or a TOML file.

    Dimensions
    ----------
    --base-radius LENGTH: Greatest distance of a base joint (guide point) from the machine's axis.
    --base-pair SIZE: Of joints in pairs: the distance between the two joints of a pair, or the
        angle between them seen from the axis, such as 12deg.
    --base-sides SHORT:LONG: Instead of both: the two distances between neighbouring base joints.
    --platform-radius LENGTH: Greatest distance of a platform joint from the platform's axis.
    --platform-pair SIZE: As --base-pair, on the platform.
    --platform-sides SHORT:LONG: As --base-sides, on the platform.
    --height LENGTH: Of a hexapod at home: height of the platform joints above the base joints;
        negative below them.
    --crank LENGTH: Length of the cranks or upper links.
    --rod LENGTH: Length of the rods or lower links.
    --crank-plane ANGLE: Of cranks in pairs: from outwards to the crank at 0, seen along the axis;
        90deg is away from the other crank of the pair, -90deg towards it.
    --limits LOW:HIGH: Limits of the actuated joints, m or rad or with a unit, such as
        -60deg:60deg; of rams the shortest and the longest length between the joints' centres.
    --cone ANGLE: Largest angle of a hexapod's legs from their direction at home, at the joints of
        base and platform.

    Masses
    ------
    --platform-mass MASS: Mass of the platform with its bars; its inertia is scaled with it.
    --rider MASS@X,Y,Z: What the platform always carries, a point mass in the platform's frame, m.
    --upper-mass MASS: Mass of each crank, upper link or cylinder; its inertia is scaled with it.
    --lower-mass MASS: Mass of each rod, lower link or piston; its inertia is scaled with it.
    --mass-from STOCK: Compute masses and inertias of links as if cut from aluminium-tube:30x2 or
        steel-rod:8 (mm); with upper= or lower= before it, of these links alone (repeat it).

    Transmission
    ------------
    --lead LENGTH: Travel of a ball screw or belt per turn of its shaft, such as 5mm.
    --gear RATIO: Turns of the motor per turn of the screw's shaft or of the crank.
    --screw DIAMETER:LENGTH: Root diameter of the ball screw and its length between the bearings,
        for its inertia and critical speed, such as 16mm:600mm.
    --efficiency SHARE: Efficiency of the screw, such as 0.9.
    --rotor-inertia INERTIA: Moment of inertia of the motor and what turns with it, kg m^2.

    Options
    -------
    --out FILE: The TOML file to write. [default: the screen]
    --overwrite: Replace an existing file.

    Examples
    --------
    pteron new
    pteron new delta --out robot.toml
    pteron new delta --base-radius 0.2 --crank 0.25 --rod 0.55 --mass-from aluminium-tube:30x2
    pteron new stewart --base-sides 0.1:0.9 --limits 700mm:1000mm --lead 5mm --rider 80@0,0,0.5
    """
    if kind is None:
        return catalog()
    from pteron.atomic import write_text
    from pteron.manipulator import load
    from pteron.manipulator.commented_file import commented_text
    from pteron.manipulator.files import catalog as names
    from pteron.manipulator.template import template_sentence
    from pteron.manipulator.template_record import Template

    if out is not None and Path(out).exists() and not overwrite:
        raise OutputError(f"{out}: is there already; name another file, or say --overwrite")
    given = {**vars(dimensions), **vars(masses), **vars(transmission)}
    given = {name: text for name, text in given.items() if text not in (None, [])}
    robot, comments, kept = load(kind), [], ""
    changed = None
    # Before it is said what cannot be made of such lengths.
    warn(_unit_doubts(robot, dimensions, masses, transmission))
    if given:
        with spinner(f"Making a machine after {robot.name}"):
            changed = _machine_of_options(robot, dimensions, masses, transmission)
        if kind in names():
            mass, center = _rider(masses.rider)
            rider = () if mass is None else (mass, *center)
            template = Template(kind, tuple(sorted(_confirmed_keys(given))), rider)
            changed = replace(changed, name=f"my {robot.name}", template=template)
            kept = template_sentence(changed)
        options = " ".join(
            f"--{name.replace('_', '-')} {part}"
            for name, text in given.items()
            for part in (text if isinstance(text, list) else [text])
        )
        comments = [f"By pteron new {kind} {options}", *([kept] if kept else [])]
    elif kind in names():
        changed_name = replace(robot, name=f"my {robot.name}", template=Template(kind))
        kept = template_sentence(changed_name)
    text = commented_text(kind, changed, comments)
    if out is not None:
        write_text(out, text)
    record = {"kind": kind, "file": out, "text": text, "template": kept}
    if out is None:
        return CommandResult(record, partial(write, text))
    written = f"Written: {plain(out)}. Put in your numbers, then: pteron check {plain(out)}"
    return CommandResult(record, [written, *([plain(kept)] if kept else [])])


_LONG_LEAD = 0.5
"""Lead, m a turn, and diameter of a screw, m, beyond which millimetres are likelier."""


def _unit_doubts(
    robot: Manipulator, size: Dimensions, masses: Masses, transmission: Transmission
) -> list[str]:
    """Return a line for each option whose lengths are likely in millimetres."""
    lengths = {f"--{name.replace('_', '-')}": text for name, text in vars(size).items()}
    angles = {"--crank-plane", "--cone"} | (
        {"--limits"} if robot.legs[0].joint.unit == "rad" else set()
    )
    lengths = {name: text for name, text in lengths.items() if name not in angles}
    small = {"--lead": transmission.lead, "--screw": transmission.screw}
    place = {"--rider": masses.rider if masses.rider and "@" in masses.rider else None}
    return [*length_doubts(lengths | place), *length_doubts(small, _LONG_LEAD)]


_CONFIRMS = {
    "base_sides": ("base_radius", "base_pair"),
    "platform_sides": ("platform_radius", "platform_pair"),
    "cone": ("cones",),
    "crank_plane": ("crank_zero",),
    "upper_mass": ("upper",),
    "lower_mass": ("lower",),
    "platform_mass": ("platform_mass",),
    "lead": ("drive",),
    "gear": ("drive",),
}
"""Keys of a template's values that an option changes, where they have another name."""


def _confirmed_keys(given: Mapping[str, Any]) -> set[str]:
    """Return the keys of a template's values that options give, even if to the same number."""
    from pteron.manipulator.dimensions import LINKS

    keys = {key for name in given for key in _CONFIRMS.get(name, (name,))}
    lengths = {name: f"{body}_length" for name, body in LINKS.items()}
    keys |= {lengths[name] for name in keys & lengths.keys()}
    stocks = [text.rpartition("=")[0] for text in given.get("mass_from", ())]
    links = {key for stock in stocks for key in ([stock] if stock else ["upper", "lower"])}
    known = {
        *("base_radius", "base_pair", "platform_radius", "platform_pair", "limits", "cones"),
        *("crank_zero", "platform_mass", "upper", "lower", "drive"),
    }
    known |= set(lengths.values())
    return (keys & known) | links


def _machine_of_options(
    robot: Manipulator, size: Dimensions, masses: Masses, transmission: Transmission
) -> Manipulator:
    """Return the machine with what the options give."""
    from pteron.kinematics.mid_stroke import at_mid_stroke, with_aimed_cones
    from pteron.manipulator import with_dimensions
    from pteron.manipulator.joint_pairs import PLATES, with_crank_planes, with_pairs

    rider, center = _rider(masses.rider)
    sides = {plate: _sides(plate, getattr(size, f"{plate}_sides"), size) for plate in PLATES}
    unit = robot.legs[0].joint.unit
    limits = size.limits and quantity_range("--limits", size.limits, unit)
    links = {"upper": masses.upper_mass, "lower": masses.lower_mass}
    changed = with_dimensions(
        robot,
        base_radius=quantity("--base-radius", size.base_radius, "m") or sides["base"][0],
        platform_radius=quantity("--platform-radius", size.platform_radius, "m")
        or sides["platform"][0],
        crank=quantity("--crank", size.crank, "m"),
        rod=quantity("--rod", size.rod, "m"),
        limits=limits or None,
        stock=_stocks(masses.mass_from),
        platform_mass=quantity("--platform-mass", masses.platform_mass, "kg"),
        link_masses={
            key: required_quantity(f"--{key}-mass", text, "kg")
            for key, text in links.items()
            if text
        },
        rider=rider,
        rider_center=center,
        drive=_drive(robot, transmission),
    )
    pairs = {"base": size.base_pair, "platform": size.platform_pair}
    for plate in PLATES:
        if (angle := _pair_angle(changed, plate, pairs[plate])) or (angle := sides[plate][1]):
            changed = with_pairs(changed, plate, angle)
    if size.crank_plane is not None:
        changed = with_crank_planes(
            changed, required_quantity("--crank-plane", size.crank_plane, "rad")
        )
    is_hexapod = robot.platform.moves_freely and all(leg.limits for leg in changed.legs)
    height = quantity("--height", size.height, "m", signed=True)
    cone = quantity("--cone", size.cone, "rad")
    if (is_hexapod and any(vars(size).values())) or height is not None or cone is not None:
        changed = at_mid_stroke(changed, height)
        assert changed.home is not None
        changed = with_aimed_cones(changed, changed.home, cone)
    return changed


def _sides(plate: Plate, text: str | None, size: Dimensions) -> tuple[float | None, float | None]:
    """Return the radius, m, and the angle of a pair, rad, of a hexagon by its two sides."""
    if text is None:
        return None, None
    option = f"--{plate}-sides"
    for name in ("radius", "pair"):
        if getattr(size, f"{plate}_{name}") is not None:
            raise DataError(f"{option} and --{plate}-{name} given; give one of them")
    short, long = quantity_range(option, text, "m")
    if not 0.0 < short < long:
        raise DataError(f"{option}: {text!r} given, SHORT:LONG above 0 expected, such as 0.1:0.4")
    # Joints on a circle: three short and three long chords of angles that sum up to a turn.
    radius = math.sqrt((short**2 + short * long + long**2) / 3.0)
    return radius, 2.0 * math.asin(short / (2.0 * radius))


def _pair_angle(robot: Manipulator, plate: Plate, text: str | None) -> float | None:
    """Return the angle of a pair, rad, from an angle with its unit, or a distance."""
    from pteron.manipulator.joint_pairs import joint_circle

    option = f"--{plate}-pair"
    if text is None:
        return None
    if text.strip().endswith(("deg", "rad")):
        return required_quantity(option, text, "rad")
    distance, radius = required_quantity(option, text, "m"), joint_circle(robot, plate).radius
    if not distance < 2.0 * radius:
        raise DataError(
            f"{option}: {text} is no distance of two joints at a radius of {radius:.4g} m; an "
            "angle has its unit behind it, such as 12deg"
        )
    return 2.0 * math.asin(distance / (2.0 * radius))


def _stocks(texts: list[str] | None) -> dict[str, str]:
    """Return the stock of the links by key; a stock without a key is for "upper" and "lower"."""
    stocks: dict[str, str] = {}
    for text in texts or ():
        key, _, stock = text.rpartition("=")
        stocks |= {key: stock} if key else dict.fromkeys(("upper", "lower"), stock)
    return stocks


def _rider(text: str | None) -> tuple[float | None, tuple[float, ...]]:
    """Return the mass, kg, and centre of mass, m, of what the platform always carries."""
    if text is None:
        return None, (0.0, 0.0, 0.0)
    mass, _, place = text.partition("@")
    expected = "MASS@X,Y,Z expected, kg and m, such as 80@0,0,0.5"
    center = split_numbers("--rider", place, ",", 3, expected) if place else (0.0, 0.0, 0.0)
    return required_quantity("--rider", mass, "kg"), center


def _screw(transmission: Transmission, lead: float) -> Screw:
    """Return the ball screw of the options, of this lead, m a turn."""
    from pteron.legs.screw import Screw

    size = transmission.screw and quantity_range("--screw", transmission.screw, "m")
    share = quantity("--efficiency", transmission.efficiency, "")
    diameter, length = size or (None, None)
    return Screw(lead, diameter, length, 1.0 if share is None else share)


def _drive(robot: Manipulator, transmission: Transmission) -> dict[str, Any]:
    """Return the values of the drives by key: the motor's angle per joint coordinate, inertia."""
    lead = quantity("--lead", transmission.lead, "m")
    gear = quantity("--gear", transmission.gear, "")
    inertia = quantity("--rotor-inertia", transmission.rotor_inertia, "kg m^2")
    slides = robot.legs[0].joint.unit == "m"
    if lead is not None and not slides:
        raise DataError(f"--lead: the actuated joints of {robot.name} turn; give --gear")
    if slides and gear is not None and lead is None:
        raise DataError("--gear: give --lead too, the travel per turn of the gear's shaft")
    values: dict[str, Any] = {}
    if transmission.screw is not None or transmission.efficiency is not None:
        if lead is None:
            raise DataError("--screw, --efficiency: give --lead too")
        values["screw"] = _screw(transmission, lead)
    if lead is not None or gear is not None:
        values["ratio"] = (gear or 1.0) * (2.0 * math.pi / lead if lead else 1.0)
    if inertia is not None:
        values["rotor_inertia"] = inertia
    return values
