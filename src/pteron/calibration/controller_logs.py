"""Measurements from the files of Klipper, RepRapFirmware, Marlin and LinuxCNC, by content.

Klipper's printer.cfg has stable positions, steps from the end stops, which are joint readings. The
others log tool positions, computed by the controller from the geometry as drawn: the readings there
follow from the same geometry. Where the probe touched, the tool's height is 0.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pteron.calibration.measurements import Measurements
from pteron.errors import DataError, shorten, warn_unlikely
from pteron.export.linuxcnc import linuxcnc_axes
from pteron.export.printers.printer_cfg import printer_cfg, setting, way_a_step
from pteron.kinematics import inverse_kinematics
from pteron.manipulator import Manipulator
from pteron.manipulator.readings import to_readings
from pteron.toml import joined_faults

_TABLES = (".csv", ".parquet")
_LARGEST = 1 << 28
"""Most bytes that are read of a log."""

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_KLIPPER = re.compile(
    rf"probe:? at ({_NUMBER}),({_NUMBER}) (is z=|bed will contact at z=)({_NUMBER})"
)
_OFFSET = re.compile(rf"^\s*z_offset\s*[=:]\s*({_NUMBER})", re.MULTILINE)
_MARLIN = re.compile(rf"Bed X:\s*({_NUMBER})\s+Y:\s*({_NUMBER})\s+Z:\s*({_NUMBER})")
_G30 = re.compile(rf"G30\s+P(\d+)\s+X({_NUMBER})\s+Y({_NUMBER})", re.IGNORECASE)
_HEIGHTS = re.compile(rf"bed probe heights:\s*({_NUMBER}(?:[\s,]+{_NUMBER})*)", re.IGNORECASE)
_G33 = re.compile(
    rf"c:\s*{_NUMBER}(?:[\s.]+(?:Recv:)?[\s.]*(?:yz|zx|xy|x|y|z):\s*{_NUMBER})*", re.IGNORECASE
)
_G33_POINT = re.compile(rf"\b(c|yz|zx|xy|x|y|z):\s*({_NUMBER})", re.IGNORECASE)
_G33_ANGLES = {"x": 210.0, "xy": 270.0, "y": 330.0, "yz": 30.0, "z": 90.0, "zx": 150.0}
"""Where Marlin's G33 probes, degrees: a tower's own angle, or that between two."""
_G33_MEANS = 4
"""Number of points, P, from which G33 takes means."""
_MAP = "RepRapFirmware height map"


class _Touch(NamedTuple):
    """A touch of the probe, as a controller logs it."""

    place: str
    coordinates: dict[str, float]
    """By the letters of its axes, X to C, in mm and degrees."""
    height: float
    """Height of the tool over the plane, mm."""


def read_controller_log(
    path: str | Path, robot: Manipulator, g33_radius: float | None = None
) -> Measurements | None:
    """Read the measurements in a file that a controller wrote; None if it is none of these.

    - Klipper's printer.cfg: the stable positions of DELTA_CALIBRATE and DELTA_ANALYZE
      (`height0_pos`, `manual_height0_pos`, `distance0_pos1`). A joint is at the upper end of its
      limits where its end stop is.
    - Klipper's log: "probe at X,Y is z=Z", the tool then at `z_offset` over the bed.
    - RepRapFirmware's heightmap.csv, and a console's log with G30 P.. X.. Y.. and the "bed probe
      heights" of its G32; Marlin's "Bed X: Y: Z:" of G29 V4 and G30, and the report of its G33,
      which needs the radius on which it probes, m.
    - LinuxCNC's probe log, of (PROBEOPEN ..): lines of X Y Z A B C U V W; probe in machine
      coordinates.

    Raises
    ------
    DataError
        If it cannot be read, or it is one of these and something is missing in it.
    """
    file, source = Path(path), shorten(str(path), bare=True, longest=1000)
    if file.suffix.lower() == ".parquet" or not file.is_file():
        return None  # reported where tables are opened
    with file.open("rb") as opened:
        content = opened.read(_LARGEST if file.suffix.lower() != ".csv" else 1 << 20)
    text = content.decode("utf-8-sig", "replace")
    if file.suffix.lower() == ".csv" and not text.startswith(_MAP):
        return None
    try:
        if re.search(r"^(?:#\*# )?\[delta_calibrate\]", text, re.MULTILINE):
            return _read_stable_positions(robot, text, file.name)
        for find in (*_READERS, partial(_read_g33, radius=g33_radius), _read_linuxcnc):
            if touched := list(find(text, file.name)):
                return _touched_heights(robot, touched)
    except DataError as error:
        raise DataError(error.message, subject=source) from None
    if file.suffix.lower() in _TABLES:
        return None
    raise DataError(
        "neither a table (.csv, .parquet) nor a log of Klipper, RepRapFirmware, Marlin or LinuxCNC "
        "with places where a probe touched",
        subject=source,
    )


def _read_stable_positions(robot: Manipulator, text: str, source: str) -> Measurements:
    """Return the stable positions of a printer.cfg as readings."""
    config = printer_cfg(text, source)
    steps = [way_a_step(config, tower) for tower in "abc"]
    lacking = [f"[stepper_{t}]" for t, step in zip("abc", steps, strict=True) if not step]
    if lacking:
        raise DataError(
            f"{', '.join(lacking)} without rotation_distance and microsteps, or step_distance: "
            "stable positions are steps; give the whole printer.cfg"
        )
    ends, downwards = _end_stops(robot)
    away = downwards * np.array([step or 0.0 for step in steps])
    faults: list[str] = []
    rows: list[tuple[str, list[float], float, float, int]] = []

    def position(key: str) -> list[float]:
        """Return a key's three step counts; without them append a fault and return zeros."""
        words = config.get("delta_calibrate", key, fallback=None)
        cells = [] if words is None else words.split(",")
        try:
            counts = [float(cell) for cell in cells]
            if len(counts) != 3 or not np.isfinite(counts).all():
                raise ValueError
        except ValueError:
            faults.append(f"[delta_calibrate] {key}: {shorten(words)} given, steps a,b,c expected")
            return [0.0] * 3
        return counts

    for kind in ("height", "manual_height", "distance"):
        k = 0
        while (setting_value := setting(config, "delta_calibrate", f"{kind}{k}")) is not None:
            key = f"{kind}{k}_pos"
            if kind == "distance":
                rows.append((f"{key}1", position(f"{key}1"), np.nan, np.nan, -1))
                rows.append((f"{key}2", position(f"{key}2"), np.nan, setting_value, len(rows) - 1))
            else:
                rows.append((key, position(key), setting_value, np.nan, -1))
            k += 1
    if not rows:
        faults.append("[delta_calibrate]: no height0 nor distance0; run DELTA_CALIBRATE, save it")
    if faults:
        raise DataError(joined_faults(faults))
    keys, counts, heights, distances, origins = zip(*rows, strict=True)
    readings = to_readings(robot, ends + away * np.array(counts))
    return replace(
        Measurements.from_readings(robot, readings, heights=1e-3 * np.array(heights)),
        distances=1e-3 * np.array(distances),
        origins=np.array(origins),
        places=tuple(f"{source}, {key}" for key in keys),
    )


def _end_stops(robot: Manipulator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return joint coordinates (3,) at the end stops, and a downward mm, or rad, in SI (3,)."""
    ends, downwards = [], []
    for i, leg in enumerate(robot.legs, start=1):
        axis = leg.joint_axis
        if len(robot.legs) != 3 or leg.limits is None or not axis:
            raise DataError(
                f"stable positions count from three end stops, and leg {i} of {robot.name} is no "
                "slider or crank with limits; give them: the upper is the end stop"
            )
        # A crank lifts about an axis across the way out.
        out = np.cross([*leg.guide_point[:2], 0.0], [0.0, 0.0, 1.0])
        up = (axis[2] if leg.joint.unit == "m" else out @ np.array(axis)) > 0.0
        ends.append(leg.limits[1 if up else 0])
        downwards.append((-1.0 if up else 1.0) * (1e-3 if leg.joint.unit == "m" else 1.0))
    return np.array(ends), np.array(downwards)


def _read_height_map(text: str, source: str) -> Iterator[_Touch]:
    """Yield the points of RepRapFirmware's height map: z where the probe touched."""
    if not text.startswith(_MAP):
        return
    lines = text.splitlines()
    names = [cell.strip() for cell in lines[1].split(",")]
    texts = [cell.strip() for cell in lines[2].split(",")]
    header = dict(zip(names, texts, strict=False))
    axes = (("xmin", "xspacing"), ("ymin", "yspacing"))
    if "spacing" in header:  # of version 1, before 2.0
        axes = (("xmin", "spacing"), ("ymin", "spacing"))
    if "axis0" in header:  # since 3.4
        if (header["axis0"], header.get("axis1")) != ("X", "Y"):
            raise DataError("a height map over X and Y is read, and this one has other axes")
        axes = (("min0", "spacing0"), ("min1", "spacing1"))
    try:
        (x, dx), (y, dy) = ([float(header[key]) for key in pair] for pair in axes)
    except (KeyError, ValueError):
        raise DataError(
            f"line 3: {shorten(lines[2])} given, the grid of a height map expected"
        ) from None
    for j, line in enumerate(lines[3:]):
        for i, cell in enumerate(line.split(",")):
            # A point that was not probed is a bare 0.
            if cell.strip() in ("", "0"):
                continue
            try:
                z = float(cell)
            except ValueError:
                raise DataError(f"line {j + 4}: {shorten(cell)} given, a height expected") from None
            yield _Touch(
                f"{source}, line {j + 4}, column {i + 1}", _xyz(x + i * dx, y + j * dy, z), 0.0
            )


def _read_g30(text: str, source: str) -> Iterator[_Touch]:
    """Yield the points of G30 P.. X.. Y.. with the heights that RepRapFirmware's G32 answers."""
    reports = list(_HEIGHTS.finditer(text))
    if not reports:
        return
    points = {int(p): (float(x), float(y)) for p, x, y in _G30.findall(text)}
    heights = [float(z) for z in re.findall(_NUMBER, reports[-1][1])]
    if sorted(points) != list(range(len(heights))):
        raise DataError(
            f"{len(heights)} bed probe heights, and {len(points)} points G30 P.. X.. Y..; put the "
            "lines of bed.g into the log, P from 0"
        )
    for p, z in enumerate(heights):
        yield _Touch(f"{source}, G30 P{p}", _xyz(*points[p], z), 0.0)


def _read_klipper_log(text: str, source: str) -> Iterator[_Touch]:
    """Yield the touches of a probe in a Klipper log, with their heights."""
    offsets = [(m.start(), float(m[1])) for m in _OFFSET.finditer(text)]
    for match in _KLIPPER.finditer(text):
        x, y, word, z = match.groups()
        earlier_offsets = [offset for at, offset in offsets if at < match.start()]
        # It says where the probe touched, the tool above it, or where the tool would.
        height = earlier_offsets[-1] if earlier_offsets and word.startswith("is") else 0.0
        yield _Touch(_match_place(text, match, source), _xyz(float(x), float(y), float(z)), height)


def _read_marlin(text: str, source: str) -> Iterator[_Touch]:
    """Yield the points of Marlin's G29 and G30."""
    for match in _MARLIN.finditer(text):
        yield _Touch(_match_place(text, match, source), _xyz(*map(float, match.groups())), 0.0)


def _read_g33(text: str, source: str, radius: float | None) -> Iterator[_Touch]:
    """Yield the points of Marlin's G33: the middle, beneath the towers, and opposite to them.

    The last report is that of the settings that the log ends with. Of P4 to P10 a point on the
    radius is the mean of those about it.
    """
    reports = list(_G33.finditer(text)) if re.search(r"G33|\.Height:", text) else []
    if not reports:
        return
    report = reports[-1]
    heights = {name: float(z) for name, z in _G33_POINT.findall(report[0])}
    if len(heights) == 1:
        raise DataError("G33 P1 probes the middle alone, which shows no geometry; run G33 P3 V3")
    if radius is None:
        raise DataError(
            "a report of Marlin's G33 does not say on which radius it probes; give [g33] radius "
            "= .., m, in the TOML file beside it: DELTA_PRINTABLE_RADIUS less PROBING_MARGIN and "
            "the probe's offset"
        )
    many = re.search(r"G33\b[^\n]*\bP(\d+)", text)
    if many is None or int(many[1]) >= _G33_MEANS:
        warn_unlikely(
            f"{source}: G33 from P{_G33_MEANS} on reports means of neighbouring points, which are "
            "up to 7 % smaller than at the points themselves; P3 reports these"
        )
    place = _match_place(text, report, source)
    for name, z in heights.items():
        x, y = 0.0, 0.0
        if name != "c":
            angle = np.radians(_G33_ANGLES[name])
            x, y = 1e3 * radius * np.cos(angle), 1e3 * radius * np.sin(angle)
        yield _Touch(f"{place}, {name}", _xyz(x, y, z), 0.0)


def _read_linuxcnc(text: str, source: str) -> Iterator[_Touch]:
    """Yield the lines of LinuxCNC's probe log."""
    lines = [(k, line) for k, line in enumerate(text.splitlines(), start=1) if line.strip()]
    faults = []
    rows: list[tuple[int, list[float]]] = []
    for k, line in lines:
        cells = re.split(r"[\s,]+", line.strip())
        if all(re.fullmatch(_NUMBER, cell) for cell in cells) and 6 <= len(cells) <= 9:
            rows.append((k, [float(cell) for cell in cells]))
        else:
            faults.append(f"line {k}: {shorten(line.strip())} given, 6 to 9 numbers expected")
    if not rows or len(faults) > len(rows):
        return
    if faults:
        raise DataError(joined_faults(faults))
    for k, row in rows:
        yield _Touch(f"{source}, line {k}", dict(zip("XYZABCUVW", row, strict=False)), 0.0)


_READERS = (_read_height_map, _read_g30, _read_klipper_log, _read_marlin)


def _xyz(x: float, y: float, z: float) -> dict[str, float]:
    """Return coordinates, mm, by the letter of their axis."""
    return {"X": x, "Y": y, "Z": z}


def _match_place(text: str, match: re.Match[str], source: str) -> str:
    """Return the file and the line of a match, for messages."""
    return f"{source}, line {text.count(chr(10), 0, match.start()) + 1}"


def _touched_heights(robot: Manipulator, touched: Sequence[_Touch]) -> Measurements:
    """Return touched heights as measurements, with readings by the drawn machine's kinematics."""
    platform, axes = robot.platform, linuxcnc_axes(robot)
    places = [[touch.coordinates.get(axis.letter, 0.0) for axis in axes] for touch in touched]
    poses = np.array(places) / [axis.scale for axis in axes]
    tool = np.einsum("i,nij->nj", np.array(platform.tool), platform.placement(poses)[1])
    poses[:, ~platform.angular] -= tool @ platform.directions.T
    joints = inverse_kinematics(robot, poses, on_failure="nan")
    lost = np.isnan(joints).any(axis=-1)
    if lost.any():
        faults = [
            f"{touch.place}: the machine as drawn does not reach "
            f"{' '.join(f'{a.letter}{x:g}' for a, x in zip(axes, place, strict=True))}; "
            "is z = 0 the bed in its file?"
            for touch, place, bad in zip(touched, places, lost, strict=True)
            if bad
        ]
        if 2 * lost.sum() > len(lost):
            raise DataError(joined_faults(faults))
        others = f" and {len(faults) - 1} more" if len(faults) > 1 else ""
        warn_unlikely(f"{faults[0]} It is left out{others}.")
        touched = [touch for touch, bad in zip(touched, lost, strict=True) if not bad]
        joints = joints[~lost]
    heights = 1e-3 * np.array([touch.height for touch in touched])
    measurements = Measurements.from_readings(robot, to_readings(robot, joints), heights=heights)
    return replace(measurements, places=tuple(touch.place for touch in touched))
