"""The report as one HTML page that needs nothing else: styles, script, pictures and data inside."""

from __future__ import annotations

import re
from functools import partial
from importlib.metadata import version
from math import degrees, prod
from typing import Any

import numpy as np
from markupsafe import Markup, escape

from pteron.bodies.inertia import Inertia, with_center
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kernels.program_cache import cached_result
from pteron.legs import LegKind
from pteron.legs.drive_rows import drive_rows
from pteron.manipulator import Manipulator
from pteron.manipulator.files import DEFAULT_KIND
from pteron.motion.trajectories.pick_and_place import farthest_point
from pteron.platforms.coordinates import COORDINATES
from pteron.plots import (
    forces_figure,
    measure_figure,
    reach_figure,
    regularity_figure,
    robot_figure,
)
from pteron.plots.machine_figures import gravity_of
from pteron.reduction import BaseParameters
from pteron.reduction.expressions import html_symbol
from pteron.report.contents import Report
from pteron.report.costs import PAPER_CLAIM
from pteron.report.drive_figures import force_speed, power
from pteron.report.equal_rows import MergedSum, by_component, merge_legs, merge_sums, strokes
from pteron.report.motion_frames import line_samples
from pteron.report.moving_picture import stage
from pteron.report.quantities import SYMBOLS, angles_text, force, nouns, readable, speed
from pteron.report.typeset import compact, format_fixed, significant, template, triple
from pteron.short_numbers import runs_text
from pteron.tolerances import ROUNDING

_LONGEST = 200
"""Most characters of a sum that is shown; those of an oblique Quadrupteron have thousands."""


def page(report: Report) -> str:
    """Return the page of a report, as self-contained HTML."""
    robot = report.robot
    joints, standard = [leg.joint for leg in robot.legs], report.standard
    document = template(
        "page.html.j2",
        degrees=lambda angle, places=1: format_fixed(float(np.degrees(angle)), places),
        typeset_account=typeset_account,
        readable=readable,
        runs=runs_text,
        signed_one=lambda sign: "+1" if sign > 0 else "\u22121",
        signed=lambda text: re.sub(r"(?<![\w.-])-(?=\d)", "\u2212", text),
        typeset=lambda text: escape(text).replace("J^-T", Markup("<b>J</b><sup>\u2212T</sup>")),
        zip=zip,
    )
    tooled = any(robot.platform.tool)
    point, way = "the tool's centre point" if tooled else "P", "cycle" if standard else "motion"
    turned = angles_text(robot, report.home)
    home = f"home pose ({turned})" if turned else "home pose"
    return document.render(
        **stage(
            robot,
            report.shown,
            doing="on its pick-and-place cycle" if standard else "in motion",
            still=f"The {home}, with the way of {point} on the {way}.",
            picture_title=f"{robot.name} in its home pose",
            force_title=f"Drive {force(joints).name}",
        ),
        report=report,
        paper_claim=PAPER_CLAIM,
        of_the_paper=_is_of_the_paper(robot),
        cycle=report.cycle,
        standard=standard,
        way=way,
        farthest=farthest_point(robot),
        kinds=kinds(robot),
        followers=_followers(robot),
        geometry=by_component(geometry(robot)),
        drives=drive_rows(robot.legs),
        bodies=_merged_bodies(robot),
        strokes=strokes(report),
        measured=[i for i, leg in enumerate(robot.legs) if not leg.has_constant_measure],
        letters=_letters(robot),
        reasons=_reasons(robot),
        angle_measures=_angle_measures(report),
        speed=speed(joints),
        joint=nouns(joints),
        joint_units=dict.fromkeys(joint.unit for joint in joints),
        passive=_merged_passive(report),
        modes=prod(len(leg.sign_choices()) for leg in robot.legs),
        figures=_figures(report),
        sizing=report.sizing,
        motors=report.sizing.table().to_dicts(),
        total=report.sizing.power.sum(axis=1),
        sums=_merged_sums(report.base),
        symbols=_merged_symbols(report.base),
    )


def typeset_account(text: str) -> Markup:
    """Return an account of a leg with its vectors bold and its Greek letters Greek."""
    safe = str(escape(text)).replace(" . ", " \u00b7 ").replace(" - ", " \u2212 ")
    greek = {name: letters.symbol for name, letters in COORDINATES.items()} | SYMBOLS
    for name, symbol in greek.items():
        safe = safe.replace(name, symbol)
    safe = re.sub(r"(?<![;'])\b([rdekps])\b", r"<b>\1</b>", safe)
    return Markup(re.sub(r"\bs0\b", "<b>s</b><sub>0</sub>", safe))


def kinds(robot: Manipulator) -> list[tuple[LegKind, list[int]]]:
    """Return a leg of each kind, with the numbers, from 1, of all legs of that kind."""
    legs_of_kinds: dict[str, list[int]] = {}
    for i, leg in enumerate(robot.legs, start=1):
        legs_of_kinds.setdefault(leg.type, []).append(i)
    return [(robot.legs[members[0] - 1], members) for members in legs_of_kinds.values()]


def geometry(robot: Manipulator) -> list[tuple[str, list[str]]]:
    """Return the rows of the legs' geometry, mm: a name, and a text per leg."""
    roles = {"guide_point": "point"}
    # A leg with more lengths has those of the others among them, in its order.
    counts = {leg: sum(q.role == "length" for q in leg.quantities) for leg in robot.legs}
    for leg in sorted(robot.legs, key=counts.__getitem__, reverse=True):
        roles |= {name: key.role for name, key in leg.keys.items()}
    roles["platform_point"] = "point of the platform"
    if any(any(leg.fixed_offset) for leg in robot.legs):
        roles["fixed_offset"] = "point of the platform"
    order = (
        *("point", "direction", "point of the platform"),
        *("length", "number", "angle", "count", "sign"),
    )
    rows = []
    shown = [name for name, role in roles.items() if role in order and name != "elbow"]
    for name in sorted(shown, key=lambda name: order.index(roles[name])):
        role, texts = roles[name], []
        for leg in robot.legs:
            # A direction that the file leaves out may be another one's, or none.
            directions = [
                q.value for q in leg.quantities if q.name == name and q.role == "direction"
            ]
            size: Any = directions[0] if directions else getattr(leg, name, None)
            if size is None:
                texts.append("\u2013")
            elif role in ("length", "number"):
                texts.append(format_fixed(1e3 * size) if role == "length" else compact(size))
            elif role == "angle":
                texts.append(f"{compact(degrees(size))}\u00b0")
            elif role == "count":
                texts.append(str(size))
            elif role == "sign":
                texts.append(f"{size:+d}".replace("-", "\u2212"))
            else:
                # Micrometres, and directions to a ten-thousandth: no rounding is shown beyond.
                exact = np.round(size, 6 if "point" in role else 4) + 0.0
                texts.append(triple(exact, 1e3) if "point" in role else triple(exact, digits=3))
        if any(text != "\u2013" for text in texts):
            rows.append((name.replace("_", " "), texts))
    return rows


def bodies(robot: Manipulator) -> list[tuple[str, int | None, dict[str, float]]]:
    """Return every body: its name, its leg, from 0, and its mass, centre of mass and moment I."""
    inertias: list[tuple[str, int | None, Inertia]] = [
        (leg.names[letter], i, inertia)
        for i, leg in enumerate(robot.legs)
        for letter, inertia in leg.bodies.items()
    ]
    platform = robot.platform
    inertias.append(("platform", None, platform.inertia))
    rows = [(name, i, with_center(inertia)) for name, i, inertia in inertias]
    for bar in platform.bars:
        x, y, _ = bar.hinge
        rows.append(("bar at its hinge", None, {"m": bar.mass, "mgx": x, "mgy": y}))
    for part in platform.geared:
        rows.append((f"geared part, ratio {compact(part.ratio)}", None, {"I": part.inertia}))
    if platform.bars or platform.geared:
        rows.append(("platform with all of it", None, with_center(platform.total_inertia)))
    return rows


def _merged_bodies(robot: Manipulator) -> list[tuple[str, list[int], dict[str, float]]]:
    """Return the bodies of `bodies`, those of equal legs once, with the legs, from 1."""
    legs = merge_legs(((name, tuple(found.items())), i) for name, i, found in bodies(robot))
    return [(name, numbers, dict(inertia)) for (name, inertia), numbers in legs.items()]


def _merged_passive(report: Report) -> list[tuple[list[int], str, str, str]]:
    """Return the passive joints with limits, equal ones once: legs, name, place and limits."""
    rows = merge_legs(
        (
            (
                joint.noun if joint.leg or report.robot.platform.tilts else "\u03c6",
                readable(joint.value, joint.unit),
                joint.limits_text(readable),
            ),
            joint.leg - 1 if joint.leg else None,
        )
        for joint in report.passive
    )
    return [(legs, *row) for row, legs in rows.items()]


def _merged_sums(base: BaseParameters) -> list[MergedSum]:
    """Return the base parameters with their values, those that differ by the leg alone once."""
    values = [significant(float(value), 4) for value in _zero_rounding(base)]
    units = [base.parameters[k].unit for k in base.kept]
    return merge_sums(list(map(str, base.expressions("html"))), values, units)


def _letters(robot: Manipulator) -> list[tuple[str, str]]:
    """Return the letters of the legs' bodies with the bodies' names."""
    names_of_letters: dict[str, list[str]] = {}
    for leg in robot.legs:
        for letter in leg.bodies:
            names_of_letters.setdefault(letter, []).append(leg.names[letter])
    return [
        (letter, " or ".join(dict.fromkeys(names))) for letter, names in names_of_letters.items()
    ]


def _reasons(robot: Manipulator) -> list[str]:
    """Return why parameters form groups, from the legs and the platform."""
    transfers = [transfer.reason for leg in robot.legs for transfer in leg.transfers(robot.gravity)]
    rides = [
        f"{leg.names[letter]} and platform carry the platform point"
        for leg in robot.legs
        for letter in leg.equations_class.rides
    ]
    unturned = [] if robot.platform.angles else ["the platform does not turn"]
    return list(dict.fromkeys(reason.format("") for reason in (*transfers, *rides, *unturned)))


def _angle_measures(report: Report) -> list[str]:
    """Return phrases on how angles are scaled to lengths in the Jacobian's condition number."""
    legs, radius = report.robot.legs, report.jacobian.radius
    followers = [legs[i].joint.noun for i in _followers(report.robot)]
    measures = []
    if any(leg.goes_round for leg in legs):
        measures.append("a crank's angle measured as the way of its end")
    if radius is not None:
        platform = report.robot.platform
        whose, angle = ("its axis", "angle \u03c6") if platform.axis_angle else ("P", "angles")
        way = f"a point {format_fixed(1e3 * radius)} mm from {whose} (the root mean square distance"
        if platform.kind.point_unit == "m/rad":
            way = f"what slides, {format_fixed(1e3 * radius)} mm/rad (the root mean square"
        measures.append(f"the platform's {angle} as the way of {way} of the platform points)")
    measures += [f"the {noun}'s angle as \u03c6, whatever its ratio" for noun in followers]
    return measures


def _followers(robot: Manipulator) -> list[int]:
    """Return the legs, from 0, whose joint follows the platform's angle without a reach limit."""
    return [i for i, leg in enumerate(robot.legs) if leg.joint.unit == "rad" and not leg.goes_round]


def _figures(report: Report) -> dict[str, Any]:
    """Return the pictures by their names in the template."""
    robot, cycle, at = report.robot, report.cycle, report.orientations
    shown, standard = report.shown, report.standard
    # The cycle returns on its own path.
    out = slice(len(shown.time) // 2 + 1 if standard else None)
    path = shown.pose[out]
    machine = robot_figure(
        shown.still, shown.guides, gravity=gravity_of(robot), path=shown.points.tool[out]
    )
    label = f"drive {force([leg.joint for leg in robot.legs]).axis}"
    half = cycle.duration / 2.0 if standard else None
    some = line_samples(len(cycle.time))
    forces = forces_figure(cycle.time[some], report.forces[some], turning_point=half, ylabel=label)
    figures: dict[str, Any] = {
        "robot": machine,
        "forces": forces,
        "force_speed": force_speed(report.sizing),
        "power": power(report.sizing),
        "reach": [reach_figure(cut, path=path) for cut in report.slices],
    }
    if at is not None:
        turns = cycle.pose[:, at.coordinate]
        used = (float(turns.min()), float(turns.max())) if standard else None
        home = float(report.home[at.coordinate])
        figures["orientations"] = regularity_figure(
            at.angles, at.type_ii, at.singular, home=home, used=used
        )
    if report.measures is not None:
        measures = report.measures.type_i, report.measures.type_ii
        cut = report.measures.cut
        figures["measures"] = [
            measure_figure(cut, measure, path=path) if np.nanmin(measure) < 1.0 - ROUNDING else None
            for measure in measures
        ]
    return figures


def _zero_rounding(base: BaseParameters) -> Array:
    """Return the base parameters' values, those within rounding of zero set to zero."""
    base_values = base.values()
    units = np.array([base.parameters[k].unit for k in base.kept])
    largest = [np.abs(base_values[units == unit]).max() for unit in units]
    return np.where(np.abs(base_values) > 1e-12 * np.array(largest), base_values, 0.0)


def symbolic_sums(base: BaseParameters) -> dict[str, list[Any]] | None:
    """Return sums in symbols, and the symbols' values in m; None if absent or too long."""
    key = base.robot, base.parameters, base.kept, base.certificate.method, version("sympy")
    packages = "kinematics", "reduction", "report", "short_numbers"
    texts = cached_result(("symbols", *key), packages, partial(_symbolic_texts, base))
    if texts is None:
        return None
    sums, lengths = texts
    return {
        "sums": [Markup(line) for line in sums],
        "lengths": [(Markup(name), length) for name, length in lengths],
    }


def _merged_symbols(base: BaseParameters) -> dict[str, list[Any]] | None:
    """Return `symbolic_sums` with the sums that differ by the leg alone merged."""
    if (symbols := symbolic_sums(base)) is None:
        return None
    blank = [""] * len(symbols["sums"])
    return symbols | {"sums": merge_sums(symbols["sums"], blank, blank)}


def _symbolic_texts(base: BaseParameters) -> tuple[list[str], list[tuple[str, float]]] | None:
    """Return base parameters as HTML formulas with the lengths in them; None if too long."""
    try:
        lines = base.expressions(symbols=True)
    except ModelError:
        return None
    if max(map(len, lines)) > _LONGEST:
        return None
    used = {s.name for line in base.expressions("sympy", symbols=True) for s in line.free_symbols}
    by_symbol = base.geometry_values.items()
    lengths = [(str(html_symbol(name)), length) for name, length in by_symbol if name in used]
    return list(map(str, base.expressions("html", symbols=True))), lengths


def _is_of_the_paper(robot: Manipulator) -> bool:
    """Return whether a machine is a Quadrupteron: all its legs are of the paper's kind."""
    is_turning = robot.platform.turns and not robot.platform.planar
    return is_turning and {leg.type for leg in robot.legs} == {DEFAULT_KIND}
