"""Likely mistakes in the readings of a whole log: order, signs, steps, zeros and scales."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pteron.calibration.fit import Fitter
from pteron.calibration.guess import Guess, Unknown, UnknownBlock, number_unknowns
from pteron.calibration.measurements import Measurements
from pteron.calibration.mistake import (
    Mistake,
    leg_orders,
    reorder_readings,
    transform_joints,
    travel_ends,
)
from pteron.calibration.start import starting_poses
from pteron.calibration.thresholds import OFF_TOLERANCES
from pteron.calibration.unknowns import TOLERANCES
from pteron.errors import DataError

QUICK_MODES = 3
"""Freedom up to which all assembly modes of a row take milliseconds; of hexapods a tenth second."""

_WIDE_ZERO = 0.3

_WIDE_ANGLE = 1.0

_WIDE_SCALE = 0.5
"""Widths of a search for zeros (of a leg's size; rad) and scales that may be anything."""

_COMMON = 0.1
"""Spread of the joints' scales, as a share of them, up to which one scale of all is tried.

Chosen: geometry within tolerances moves single scales of small machines by up to 6 %."""

_STEPS = (
    (2.0, "half", "as with half the lead or twice the steps"),
    (0.5, "twice", "as with twice the lead or half the steps"),
    (4.0, "a quarter", "as with a quarter of the lead"),
    (0.25, "four times", "as with four times the lead"),
    (0.8, "1.25 times", "as with pulleys of 16 teeth for 20"),
    (1.25, "0.8 times", "as with pulleys of 20 teeth for 16"),
    (10.0, "a tenth", "as of cm for mm"),
    (0.1, "ten times", "as of mm for cm"),
    (float(np.pi / 180.0), "180/pi times", "as of degrees for radians"),
    (float(180.0 / np.pi), "pi/180", "as of radians for degrees"),
    (1.0 / (2.0 * np.pi), "2 pi times", "as of radians for turns"),
    (2.0 * np.pi, "1/(2 pi)", "as of turns for radians"),
    (1e-3, "1000 times", "as of mm for m"),
    (25.4e-3, "1/0.0254 times", "as of inches for m"),
)
"""Factors that mend readings, what the readings then are, and a likely cause."""


def swapped_legs(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield likely mistakes: readings in another order of the legs."""
    names = guess.robot.joint_names
    for order in leg_orders(guess):
        moved = [i for i, k in enumerate(order) if i != k]
        if len(moved) == 2:
            i, j = moved
            text = (
                f"the readings of legs {i + 1} and {j + 1} ({names[i]} and {names[j]}) are "
                "swapped: exchange the columns"
            )
        else:
            where = ", ".join(f"{names[i]} under {names[k]}" for i, k in enumerate(order))
            text = f"the readings stand in another order of the legs ({where}): rename the columns"

        def undo(rows: Measurements, order: tuple[int, ...] = order) -> Measurements:
            """Return the measurements with the legs' readings in another order."""
            return reorder_readings(rows, order)

        yield Mistake(text, undo)


def reversed_joints(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield likely mistakes: joints whose readings count the other way.

    About zero, or between the ends of their travel.
    """
    names, legs = guess.robot.joint_names, guess.robot.legs
    count = len(names)
    ways = [("reverse the signs of the columns", np.zeros(count))]
    if all(leg.limits is not None for leg in legs):
        ends = np.array([sum(leg.limits or ()) for leg in legs])
        if np.abs(ends).max() > 0.0:
            ways.append(("they count from the other end of the limits", ends))
    for advice, ends in ways:
        for joints in (range(count), *((i,) for i in range(count))):
            turned = np.isin(np.arange(count), joints)
            yield Mistake(
                f"the readings of {_listed_joints(joints, names)} are reversed: {advice}",
                transform_joints(guess, np.where(turned, ends, 0.0), np.where(turned, -1.0, 1.0)),
            )


def wrong_steps(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield likely mistakes: joints read in wrong steps, from zero or from an end of the travel."""
    names = guess.robot.joint_names
    count = len(names)
    for factor, size, cause in _STEPS:
        for where, end in travel_ends(guess.robot):
            for joints in (range(count), *((i,) for i in range(count))):
                factors = np.where(np.isin(np.arange(count), joints), factor, 1.0)
                yield Mistake(
                    f"the readings of {_listed_joints(joints, names)}{where} are {size} as large "
                    f"as they should be, {cause}: give steps, lead or gear ratio as they are",
                    transform_joints(guess, (1.0 - factors) * end, factors),
                )


def wrong_zeros_and_scales(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield likely mistakes: wrong zeros and scales of a few joints, or of all, fitted to rows."""
    for kinds in (("zeros",), ("scales",), ("scales", "zeros")):
        everything = range(len(guess.robot.legs))
        fitted = _fit_readings(measurements, guess, dict.fromkeys(kinds, everything))
        if fitted is None:
            continue
        far = {kind: _far_joints(guess, fitted, kind) for kind in kinds}
        count = sum(map(len, far.values()))
        if 0 < count < len(kinds) * len(everything):
            few = _fit_readings(measurements, guess, {k: far[k] for k in kinds if far[k]})
            if few is not None:
                yield from _name_readings(guess, few, count)
        if kinds == ("scales",):
            yield from _common_scale(guess, fitted)
        yield from _name_readings(guess, fitted, len(kinds) * len(everything))


def _fit_readings(
    measurements: Measurements, guess: Guess, joints: Mapping[str, Iterable[int]]
) -> Guess | None:
    """Return the guess with zeros and scales of some joints as rows show them; None: no fit."""
    legs = guess.robot.legs
    travel = [_WIDE_ZERO * leg.size if leg.joint.unit == "m" else _WIDE_ANGLE for leg in legs]
    widths = {"zeros": travel, "scales": [_WIDE_SCALE] * len(legs)}
    blocks = number_unknowns(
        UnknownBlock(
            kind,
            "",
            tuple(Unknown("", kind, "", widths[kind][i]) for i in chosen),
            (),
            tuple(chosen),
        )
        for kind, chosen in joints.items()
    )
    try:
        poses = starting_poses(guess, measurements, modes=guess.robot.freedom <= QUICK_MODES)
        return Fitter(measurements, blocks, guess, poses).run().guess
    except DataError:
        return None


def _far_joints(guess: Guess, fitted: Guess, kind: str) -> tuple[int, ...]:
    """Return the joints whose zero or scale is beyond its tolerance."""
    units = [leg.joint.unit for leg in guess.robot.legs]
    if kind == "scales":
        off = np.abs(fitted.scales / guess.scales - 1.0) / TOLERANCES["scales"]
    else:
        least = [TOLERANCES["zeros" if unit == "m" else "zeros, rad"] for unit in units]
        off = np.abs(fitted.zeros - guess.zeros) / np.array(least)
    return tuple(np.flatnonzero(off > OFF_TOLERANCES).tolist())


def _common_scale(guess: Guess, fitted: Guess) -> Iterator[Mistake]:
    """Yield a common scale of all readings, if the joints' scales agree."""
    factors = fitted.scales / guess.scales
    factor = float(np.median(factors))
    count = len(factors)
    spread = float(np.ptp(factors))
    if count > 1 and spread < min(_COMMON * abs(factor), abs(factor - 1.0)):
        text = (
            f"the readings of all joints are about {1.0 / factor:.3g} times as large as they "
            "should be: give steps, lead or gear ratio as they are"
        )
        yield Mistake(text, transform_joints(guess, np.zeros(count), np.full(count, factor)), 1)


def _name_readings(guess: Guess, fitted: Guess, freedom: int) -> Iterator[Mistake]:
    """Yield the zeros and scales of a fit beyond their tolerances, as a single mistake."""
    legs, names = guess.robot.legs, guess.robot.joint_names
    far = {kind: _far_joints(guess, fitted, kind) for kind in ("scales", "zeros")}
    texts = []
    for i, (leg, name) in enumerate(zip(legs, names, strict=True)):
        zero, scale = fitted.zeros[i] - guess.zeros[i], fitted.scales[i] / guess.scales[i]
        if i in far["scales"]:
            texts.append(f"joint {i + 1} ({name}) reads {1.0 / scale:.4g} times what it should")
        if i in far["zeros"]:
            size = f"{1e3 * zero:+.3g} mm"
            if leg.joint.unit != "m":
                size = f"{np.degrees(zero):+.3g} degrees"
            texts.append(f"the zero of joint {i + 1} ({name}) is off by {size}")
    if not texts:
        return

    def undo(measurements: Measurements) -> Measurements:
        """Return the measurements with the guess's readings at the joints of the fit."""
        return replace(measurements, readings=guess.readings(fitted.joints(measurements.readings)))

    yield Mistake(
        f"{', '.join(texts)}: home the machine again or mend its step units, or give the legs "
        "reading = { zero = .., scale = .. }",
        undo,
        freedom,
    )


def _listed_joints(joints: Sequence[int], names: Sequence[str]) -> str:
    """Return joints by number and name; "all joints" where it is all of them."""
    if len(joints) == len(names):
        return "all joints"
    return f"joint {joints[0] + 1} ({names[joints[0]]})"
