"""Reading of Klipper's printer.cfg: its sections, and the Delta that it describes."""

from __future__ import annotations

import configparser
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pteron.arguments import expect
from pteron.bodies.vectors import Vector, vector
from pteron.errors import DataError, ModelError, shorten
from pteron.legs import Drive, LegKind
from pteron.manipulator import Manipulator, load
from pteron.toml import expect_regular

_SAVED = "#*#"
"""Prefix of the lines that SAVE_CONFIG wrote; they override the lines above them."""

_STEPS = 200
"""Full steps a turn where the file does not say."""

_EFFECTOR = 0.02
"""Assumed radius of the rods' ends about P, m: Klipper has only the towers' radius less it."""

_POWERS = {"m": 1, "mgx": 2, "mgy": 2, "I": 3}
"""Powers of its length with which a bar's parameters grow, its mass a metre the same."""


class _Kind(NamedTuple):
    """One of Klipper's kinematics: the catalog's machine, and keys of lengths in mm."""

    template: str
    angles: tuple[float, float, float]
    """Degrees at which its towers stand where the file does not say."""
    template_angles: tuple[float, float, float]
    """Degrees at which the template's do."""
    printer: tuple[str, ...]
    tower: tuple[str, ...]


_KINDS = {
    "delta": _Kind(
        "linear-delta",
        (210.0, 330.0, 90.0),
        (210.0, 330.0, 90.0),
        ("delta_radius",),
        ("arm_length",),
    ),
    "rotary_delta": _Kind(
        "delta",
        (30.0, 150.0, 270.0),
        (0.0, 120.0, 240.0),
        ("shoulder_radius", "shoulder_height"),
        ("upper_arm_length", "lower_arm_length"),
    ),
}


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
    saved_lines = [re.sub("^ ", "", line) for line in saved if "SAVE_CONFIG" not in line]
    saved_lines = [line for line in saved_lines if "DO NOT EDIT" not in line]
    try:
        parser.read_string(text, source)
        parser.read_string("\n".join(saved_lines), source)
    except configparser.Error as error:
        reason = str(error).splitlines()[0]
        raise DataError(f"{source}: no printer.cfg of Klipper ({reason})") from None
    return parser


def setting(config: configparser.RawConfigParser, section: str, key: str) -> float | None:
    """Return a number of a printer.cfg; None if it is absent.

    Raises
    ------
    DataError
        If it is no number.
    """
    text = config.get(section, key, fallback=None)
    if text is None:
        return None
    try:
        number = float(text)
    except ValueError:
        raise DataError(f"[{section}] {key}: {shorten(text)} given, a number expected") from None
    expect(math.isfinite(number), f"[{section}] {key}", shorten(text), "a finite number")
    return number


def _way_a_turn(config: configparser.RawConfigParser, tower: str) -> float | None:
    """Return a joint's travel per motor turn, mm or rad; None if the file does not define it."""
    section = f"stepper_{tower}"
    turn = setting(config, section, "rotation_distance")
    text = config.get(section, "gear_ratio", fallback="")
    if text and config.get("printer", "kinematics", fallback="") == "rotary_delta":
        turn = 2.0 * math.pi
    for pair in filter(None, (part.strip() for part in text.split(","))):
        driven, _, driving = pair.partition(":")
        try:
            turn = None if turn is None else turn * float(driving) / float(driven)
        except (ValueError, ZeroDivisionError):
            raise DataError(f"[{section}] gear_ratio: {shorten(pair)} given, such as 5:1") from None
    return turn


def way_a_step(config: configparser.RawConfigParser, tower: str) -> float | None:
    """Return a joint's travel per motor step, mm or rad; None if the file does not define it."""
    section = f"stepper_{tower}"
    turn, micro = _way_a_turn(config, tower), setting(config, section, "microsteps")
    if turn is None or micro is None:
        return setting(config, section, "step_distance")  # as files said until 2021
    return turn / (micro * (setting(config, section, "full_steps_per_rotation") or _STEPS))


def from_klipper(config: str | Path, *, name: str = "printer") -> Manipulator:
    """Return the Delta that a Klipper configuration describes, of `delta` or `rotary_delta`.

    Its z = 0 is Klipper's, the bed. A joint coordinate is the carriage's height over it, or the
    angle of the upper arm, 0 where it is level, growing as it lifts; the upper limit is the end
    stop. Klipper does not know masses, nor the effector: those of the catalog's `linear-delta` or
    `delta` are taken, bars with the same mass a metre.

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
        If it is no printer.cfg of a printer with such kinematics, or lacks its numbers.

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
        source = shorten(str(config), bare=True, longest=1000)
        try:
            expect_regular(Path(config))
            text = Path(config).read_text(encoding="utf-8", errors="replace")
        except OSError as error:
            raise DataError(f"{source}: cannot be read ({error.strerror or error})") from None
    else:
        text = config
    parser = printer_cfg(text, source)
    name_of = parser.get("printer", "kinematics", fallback=None)
    kind = _KINDS.get(name_of or "")
    if kind is None:
        raise DataError(
            f"{source}: its [printer] kinematics are {shorten(name_of)}; {' and '.join(_KINDS)} "
            "are read, Deltas with sliders and with cranks"
        )

    def length(section: str, key: str, default: float | None = None) -> float:
        """Return a setting, m, of a section with mm; raise if it is missing or not positive."""
        millimetres = setting(parser, section, key)
        metres = default if millimetres is None else 1e-3 * millimetres
        if metres is None or metres <= 0.0:
            raise DataError(
                f"{source}: [{section}] {key}: {millimetres} given, mm above 0 expected"
            )
        return metres

    base = [length("printer", key) for key in kind.printer]
    first = {key: length("stepper_a", key) for key in (*kind.tower, "position_endstop")}
    legs = []
    template = load(kind.template)
    for tower, usual, template_angle, leg in zip(
        "abc", kind.angles, kind.template_angles, template.legs, strict=True
    ):
        section = f"stepper_{tower}"
        angle = setting(parser, section, "angle")
        lengths = [length(section, key, default) for key, default in first.items()]
        turn = math.radians((usual if angle is None else angle) - template_angle)
        try:
            legs.append((_crank if len(base) == 2 else _slider)(leg, turn, base, lengths))
        except ValueError:
            keys = ", ".join(kind.tower)
            raise DataError(
                f"{source}: [{section}] {keys}: too short to reach the z axis at its end stop"
            ) from None
        way = _way_a_turn(parser, tower)
        if way:
            factor = 1.0 if len(base) == 2 else 1e3
            legs[-1] = replace(legs[-1], drive=Drive(ratio=factor * 2.0 * math.pi / way))
    try:
        return replace(template, name=name, legs=tuple(legs))
    except ModelError as error:
        raise DataError(f"{source}: {error}") from None


def _slider(leg: LegKind, turn: float, base: list[float], lengths: list[float]) -> LegKind:
    """Return the catalog's leg turned about z, with Klipper's radius, arm and end stop."""
    (radius,), (arm, end) = base, lengths
    if arm <= radius:
        raise ValueError
    return replace(
        _place_leg(leg, turn, radius, 0.0, {"l": arm}),
        limits=(math.sqrt(max(0.0, arm**2 - 4.0 * radius**2)), end + math.sqrt(arm**2 - radius**2)),
    )


def _crank(leg: LegKind, turn: float, base: list[float], lengths: list[float]) -> LegKind:
    """Return the catalog's leg turned about z, with Klipper's shoulder, arms and end stop."""
    (radius, height), (upper, lower, end) = base, lengths
    moved = _place_leg(leg, turn, radius, height, {"u": upper, "l": lower})
    away = math.hypot(radius, end - height)
    if lower <= radius - upper:
        raise ValueError
    bend = math.acos((away**2 + upper**2 - lower**2) / (2.0 * away * upper))
    top = math.atan2(end - height, -radius) + bend
    out = np.array([*moved.guide_point[:2], 0.0])
    level: dict[str, Any] = {
        "zero_direction": vector((out / np.linalg.norm(out)).tolist(), "zero_direction")
    }
    return replace(moved, limits=(-0.5 * math.pi, top), **level)


def _place_leg(
    leg: LegKind, turn: float, radius: float, height: float, lengths: dict[str, float]
) -> LegKind:
    """Return a leg turned about z, at a radius and height, m, with new link lengths, m."""
    cos, sin = math.cos(turn), math.sin(turn)

    def turn_vector(v: Vector) -> Vector:
        """Return a vector (3,) turned about the z axis by the leg's angle."""
        return (cos * v[0] - sin * v[1], sin * v[0] + cos * v[1], v[2])

    moved = leg.map_vectors(turn_vector)
    out = np.array([*moved.guide_point[:2], 0.0]) / math.hypot(*moved.guide_point[:2])
    names = [quantity.name for quantity in leg.quantities if quantity.role == "length"]
    bodies = dict(moved.bodies)
    changes: dict[str, Any] = {}
    for name, (link, length) in zip(names, lengths.items(), strict=True):
        body, size = leg.bodies[link], length / getattr(leg, name)
        kinds = zip(body.kinds, body.values, strict=True)
        bodies[link] = type(body).of_values([v * size ** _POWERS[kind] for kind, v in kinds])
        changes[name] = length
    return replace(
        moved.with_bodies(bodies),
        guide_point=vector([*((radius + _EFFECTOR) * out)[:2].tolist(), height], "guide_point"),
        platform_point=vector((_EFFECTOR * out).tolist(), "platform_point"),
        **changes,
    )
