"""Reading of Klipper's printer.cfg: its sections, and the linear Delta that it describes."""

from __future__ import annotations

import configparser
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from pteron.bodies.vectors import Vector, vector
from pteron.errors import DataError, ModelError, shown
from pteron.legs import Drive, LegKind
from pteron.manipulator import Manipulator, load

_SAVED = "#*#"
"""Prefix of the lines that SAVE_CONFIG wrote; they override the lines above them."""

_ANGLES = (210.0, 330.0, 90.0)
"""Degrees at which Klipper's towers stand where the file does not say."""

_STEPS = 200
"""Full steps a turn where the file does not say."""

_EFFECTOR = 0.02
"""Assumed radius of the rods' ends about P, m: Klipper has only the towers' radius less it."""


def printer_cfg(text: str, source: str = "printer.cfg") -> configparser.RawConfigParser:
    """Return the sections of a printer.cfg, those that SAVE_CONFIG wrote over the others.

    Raises
    ------
    DataError
        If it is no such file.
    """
    parser = configparser.RawConfigParser(
        strict=False,
        delimiters=("=", ":"),
        inline_comment_prefixes=("#", ";"),
        allow_no_value=True,
    )
    saved = [line.removeprefix(_SAVED) for line in text.splitlines() if line.startswith(_SAVED)]
    kept = [re.sub("^ ", "", line) for line in saved if "SAVE_CONFIG" not in line]
    kept = [line for line in kept if "DO NOT EDIT" not in line]
    try:
        parser.read_string(text, source)
        parser.read_string("\n".join(kept), source)
    except configparser.Error as error:
        told = str(error).splitlines()[0]
        raise DataError(f"{source}: no printer.cfg of Klipper ({told})") from None
    return parser


def setting(config: configparser.RawConfigParser, section: str, key: str) -> float | None:
    """Return a number of a printer.cfg; None where it is not given.

    Raises
    ------
    DataError
        If it is no number.
    """
    text = config.get(section, key, fallback=None)
    if text is None:
        return None
    try:
        value = float(text)
    except ValueError:
        raise DataError(f"[{section}] {key}: {shown(text)} given, a number expected") from None
    if not math.isfinite(value):
        raise DataError(f"[{section}] {key}: {shown(text)} given, a finite number expected")
    return value


def millimetres_a_turn(config: configparser.RawConfigParser, tower: str) -> float | None:
    """Return a carriage's way a turn of its motor, mm; None where the file does not say."""
    section = f"stepper_{tower}"
    turn = setting(config, section, "rotation_distance")
    text = config.get(section, "gear_ratio", fallback="")
    for pair in filter(None, (part.strip() for part in text.split(","))):
        driven, _, driving = pair.partition(":")
        try:
            turn = None if turn is None else turn * float(driving) / float(driven)
        except (ValueError, ZeroDivisionError):
            raise DataError(f"[{section}] gear_ratio: {shown(pair)} given, such as 5:1") from None
    return turn


def millimetres_a_step(config: configparser.RawConfigParser, tower: str) -> float | None:
    """Return a carriage's way a step of its motor, mm; None where the file does not say."""
    section = f"stepper_{tower}"
    turn, micro = millimetres_a_turn(config, tower), setting(config, section, "microsteps")
    if turn is None or micro is None:
        return setting(config, section, "step_distance")  # as files said until 2021
    return turn / (micro * (setting(config, section, "full_steps_per_rotation") or _STEPS))


def from_klipper(config: str | Path, *, name: str = "printer") -> Manipulator:
    """Return the linear Delta that a Klipper configuration describes.

    Its z = 0 is Klipper's, the bed; a joint coordinate is the carriage's height over it, and the
    upper limit is the end stop. Klipper does not know masses, nor the effector: those of the
    catalog's `linear-delta` are taken, rods with the same mass a metre.

    Parameters
    ----------
    config : str or Path
        The text of a printer.cfg, or its path.
    name : str
        What the machine is called.

    Returns
    -------
    Manipulator

    Raises
    ------
    DataError
        If it is no printer.cfg of a printer with `kinematics: delta`, or lacks its numbers.

    Examples
    --------
    >>> from pteron.export import from_klipper
    >>> text = '''
    ... [printer]
    ... kinematics: delta
    ... delta_radius: 174.75
    ... [stepper_a]
    ... arm_length: 333.0
    ... position_endstop: 297.05
    ... [stepper_b]
    ... [stepper_c]
    ... '''
    >>> from_klipper(text).legs[0].lower_length
    0.333
    """
    source = "printer.cfg"
    if isinstance(config, Path) or "\n" not in config:
        source = shown(str(config), bare=True, longest=1000)
        try:
            text = Path(config).read_text(encoding="utf-8", errors="replace")
        except OSError as error:
            raise DataError(f"{source}: cannot be read ({error.strerror or error})") from None
    else:
        text = config
    parser = printer_cfg(text, source)
    kind = parser.get("printer", "kinematics", fallback=None)
    if kind != "delta":
        raise DataError(
            f"{source}: its [printer] kinematics are {shown(kind)}; delta is read, a linear Delta"
        )
    radius = setting(parser, "printer", "delta_radius")
    first = {key: setting(parser, "stepper_a", key) for key in ("arm_length", "position_endstop")}
    for section, key, value in (
        ("printer", "delta_radius", radius),
        *(("stepper_a", key, value) for key, value in first.items()),
    ):
        if value is None or value <= 0.0:
            raise DataError(f"{source}: [{section}] {key}: {value} given, mm above 0 expected")
    assert radius is not None
    legs = []
    template = load("linear-delta")
    for tower, usual, leg in zip("abc", _ANGLES, template.legs, strict=True):
        section = f"stepper_{tower}"
        own = {key: setting(parser, section, key) for key in ("angle", *first)}
        angle = usual if own["angle"] is None else own["angle"]
        arm, end = (own[key] or first[key] or 0.0 for key in first)
        if arm <= radius:
            raise DataError(f"{source}: [{section}] arm_length: {arm:g} is not above delta_radius")
        turn = millimetres_a_turn(parser, tower)
        legs.append(_leg(leg, math.radians(angle - usual), 1e-3 * radius, 1e-3 * arm, 1e-3 * end))
        if turn:
            legs[-1] = replace(legs[-1], drive=Drive(ratio=2000.0 * math.pi / turn))
    try:
        return replace(template, name=name, legs=tuple(legs))
    except ModelError as error:
        raise DataError(f"{source}: {error}") from None


def _leg(leg: LegKind, turn: float, radius: float, arm: float, end: float) -> LegKind:
    """Return the catalog's leg turned about z, with Klipper's radius, arm and end stop in m."""
    cos, sin = math.cos(turn), math.sin(turn)

    def turned(v: Vector) -> Vector:
        return (cos * v[0] - sin * v[1], sin * v[0] + cos * v[1], v[2])

    moved = leg.turned(turned)
    out = np.array([*moved.guide_point[:2], 0.0]) / math.hypot(*moved.guide_point[:2])
    size = arm / leg.size
    kinds = zip(leg.bodies["l"].kinds, leg.bodies["l"].values, strict=True)
    powers = {"m": 1, "mgx": 2, "I": 3}
    rods = type(leg.bodies["l"]).of_values([v * size ** powers[kind] for kind, v in kinds])
    (length,) = (quantity.name for quantity in leg.quantities if quantity.role == "length")
    lowest = math.sqrt(max(0.0, arm**2 - (2.0 * radius) ** 2))
    return replace(
        moved.with_bodies({**moved.bodies, "l": rods}),
        guide_point=vector(((radius + _EFFECTOR) * out).tolist(), "guide_point"),
        platform_point=vector((_EFFECTOR * out).tolist(), "platform_point"),
        limits=(lowest, end + math.sqrt(arm**2 - radius**2)),
        **{length: arm},
    )
