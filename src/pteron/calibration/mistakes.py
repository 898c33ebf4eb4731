"""Likely mistakes in a whole log, and how each is undone: units, order, signs, steps, zeros, frame.

They are in the order in which they are likely; `raw_faults` chooses among them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations, permutations, product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.calibration.fit import Fitter
from pteron.calibration.guess import Guess, Unknown, UnknownBlock, number_unknowns
from pteron.calibration.measurements import VALUES, Measurements
from pteron.calibration.start import starting_poses
from pteron.calibration.thresholds import OFF_TOLERANCES
from pteron.calibration.unknowns import TOLERANCES
from pteron.errors import DataError

Array = NDArray[np.float64]

QUICK_MODES = 3
"""Freedom up to which all assembly modes of a row take milliseconds; of hexapods a tenth second."""

_WIDE_ZERO = 0.3
_WIDE_ANGLE = 1.0
_WIDE_SCALE = 0.5
"""Widths of a search for zeros (of a leg's size; rad) and scales that may be anything."""

_COMMON = 0.1
"""Spread of the joints' scales, as a share of them, up to which one scale of all is tried.

Chosen: geometry within tolerances moves single scales of small machines by up to 6 %."""

_LARGE_HEIGHTS = 0.01
"""Spread of heights, as a share of the machine's size, from which they may be in millimetres.

Chosen: heights over a bed spread by 2e-5 of the size and more, which mm read as m make 2e-2."""

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


class Mistake(NamedTuple):
    """A mistake in a whole log: a sentence without a stop, and what undoes it."""

    text: str
    undo: Callable[[Measurements], Measurements]
    freedom: int = 0
    """Number of values that were fitted to name it."""


def likely_mistakes(measurements: Measurements, guess: Guess) -> Iterator[list[Mistake]]:
    """Yield groups of likely mistakes, the likeliest first; zeros and scales are fitted to rows."""
    kinds = (
        *(_wrong_units, _downward_heights, _swapped_marks, _turned_frames, _swapped_legs),
        *(_reversed_joints, _mirrored_frames, _shifted_rows),
    )
    for kind in kinds:
        yield list(kind(measurements, guess))
    yield [*_wrong_steps(measurements, guess), *_wrong_zeros_and_scales(measurements, guess)]


def order_mistakes(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield mistakes in the order of rows and the sign of heights.

    Of small residuals they make other small ones, which may look like noise.
    """
    for kind in (_downward_heights, _shifted_rows):
        yield from kind(measurements, guess)


def leg_orders(guess: Guess) -> Iterator[tuple[int, ...]]:
    """Yield the orders of the readings in which two legs are swapped.

    Of three legs also those in which they follow each other round.
    """
    count = len(guess.robot.legs)
    for i, j in combinations(range(count), 2):
        order = list(range(count))
        order[i], order[j] = j, i
        yield tuple(order)
    if count == 3:
        yield from ((1, 2, 0), (2, 0, 1))


def reorder_readings(measurements: Measurements, order: Sequence[int]) -> Measurements:
    """Return measurements whose readings of leg i are those of leg order[i]."""
    return replace(measurements, readings=measurements.readings[:, list(order)])


def _multiply_fields(factors: Mapping[str, ArrayLike]) -> Callable[[Measurements], Measurements]:
    """Return the change that multiplies fields of measurements by factors."""

    def undo(measurements: Measurements) -> Measurements:
        """Return the measurements with fields multiplied by the factors."""
        changed: Any = {
            name: getattr(measurements, name) * factor for name, factor in factors.items()
        }
        return replace(measurements, **changed)

    return undo


def _transform_joints(
    guess: Guess, offsets: Array, factors: Array
) -> Callable[[Measurements], Measurements]:
    """Return the change of readings that takes joint coordinates q to offset + factor q."""

    def undo(measurements: Measurements) -> Measurements:
        """Return the measurements with readings at the joint coordinates offset + factor q."""
        joints = offsets + factors * guess.joints(measurements.readings)
        return replace(measurements, readings=guess.readings(joints))

    return undo


def _wrong_units(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield units that were perhaps meant: smaller ones where values vary beyond the machine."""
    linear = np.array([leg.joint.unit == "m" for leg in guess.robot.legs])
    lengths = [
        f"{name}s" for name in ("position", "height", "distance") if name in measurements.kinds
    ]
    large = _large_lengths(measurements, guess, lengths)
    for factor, text in (
        (1e-3, "in millimetres"),
        (25.4e-3, "in inches"),
        (1e3, "1000 times too small, as of km for m"),
    ):
        factors: dict[str, ArrayLike] = dict.fromkeys(lengths, factor)
        if linear.any():
            factors["readings"] = np.where(linear, factor, 1.0)
        if factor < 1.0:
            factors = {name: factors[name] for name in factors if name in large}
        advice = f"are {text}: give them in metres"
        for name in factors:
            yield Mistake(f"the {name} {advice}", _multiply_fields({name: factors[name]}))
        if len(factors) > 1:
            yield Mistake(f"all lengths {advice}", _multiply_fields(factors))
    if not linear.all():
        turned = np.where(linear, 1.0, np.pi / 180.0)
        text = "the readings are in degrees: give them in radians"
        yield Mistake(text, _multiply_fields({"readings": turned}))
    if "angle" in measurements.kinds:
        text = "the measured angles are in degrees: give them in radians"
        yield Mistake(text, _multiply_fields({"angles": np.pi / 180.0}))


def _downward_heights(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield heights that perhaps count downwards."""
    if "height" in measurements.kinds:
        text = "the heights count downwards: reverse their signs"
        yield Mistake(text, _multiply_fields({"heights": -1.0}))


def _large_lengths(measurements: Measurements, guess: Guess, lengths: Sequence[str]) -> set[str]:
    """Return the fields of lengths that vary by more than the machine's size.

    Divided by 1000, distances would lie within tolerances of anything. Heights vary by less.
    """
    legs = guess.robot.legs
    size = max(leg.size for leg in legs)
    linear = [leg.joint.unit == "m" for leg in legs]
    lengths_read = {name: getattr(measurements, name) for name in lengths}
    lengths_read["readings"] = measurements.readings[:, linear]
    large = set()
    for name, columns in lengths_read.items():
        seen = columns[np.isfinite(columns)]
        least = _LARGE_HEIGHTS * size if name == "heights" else size
        if seen.size and np.median(np.abs(seen - np.median(seen))) > least:
            large.add(name)
    return large


def _swapped_marks(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield marks that were perhaps swapped."""
    for a, b in combinations(sorted(set(measurements.marks)), 2):

        def undo(rows: Measurements, a: str = a, b: str = b) -> Measurements:
            """Return the measurements with the marks a and b exchanged."""
            other = {a: b, b: a}
            return replace(rows, marks=tuple(other.get(name, name) for name in rows.marks))

        yield Mistake(
            f"the marks {a or 'tool'} and {b or 'tool'} are swapped: exchange their names", undo
        )


def _turned_frames(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield quarter turns of the instrument."""
    if not _whole_positions(measurements):
        return
    for turn in _signed_axes(1.0):
        text = (
            f"the instrument's frame is turned: its {_described_axes(turn)} of the base; turn the "
            'positions, or say [instrument] frame = "unknown"'
        )
        yield Mistake(text, _rotate_positions(turn))


def _mirrored_frames(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield columns of positions that were perhaps exchanged or reversed: axes of a left hand."""
    if _whole_positions(measurements):
        for turn in _signed_axes(-1.0):
            text = (
                f"the positions' columns are exchanged or reversed: {_described_axes(turn)} of the "
                "base; exchange the columns or reverse their signs"
            )
            yield Mistake(text, _rotate_positions(turn))


def _whole_positions(measurements: Measurements) -> bool:
    """Return whether positions are measured in the base frame, all three coordinates each."""
    seen = ~np.isnan(measurements.positions)
    complete = bool((seen.all(axis=1) == seen.any(axis=1)).all())
    return measurements.setup.frame_known and complete and bool(seen.any())


def _signed_axes(determinant: float) -> list[Array]:
    """Return the signed permutations (3, 3) of a determinant, without the identity."""
    matrices = [
        np.array(signs)[:, None] * np.eye(3)[list(order)]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]
    # Few changes first.
    matrices.sort(key=lambda matrix: -float(np.trace(matrix)))
    return [m for m in matrices[1:] if np.linalg.det(m) * determinant > 0.0]


def _described_axes(turn: Array) -> str:
    """Return the axes of a signed permutation in words: x along -y, for example."""
    return ", ".join(
        f"{'xyz'[k]} along {'-' if row.sum() < 0 else ''}{'xyz'[int(np.abs(row).argmax())]}"
        for k, row in enumerate(turn)
    )


def _rotate_positions(turn: Array) -> Callable[[Measurements], Measurements]:
    """Return the change of positions to the base frame, from a frame whose axes are rows."""
    return lambda measurements: replace(measurements, positions=measurements.positions @ turn)


def _swapped_legs(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield orders of the legs in which the readings perhaps stand."""
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


def _reversed_joints(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield joints whose readings perhaps count the other way.

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
                _transform_joints(guess, np.where(turned, ends, 0.0), np.where(turned, -1.0, 1.0)),
            )


def _shifted_rows(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield measurements that perhaps stand a row or two beside their readings."""
    if "distance" in measurements.kinds:  # rows name each other
        return
    for shift in (1, -1, 2, -2):

        def undo(rows: Measurements, shift: int = shift) -> Measurements:
            """Return the rows with all their values `shift` rows later; NaN beyond the ends."""
            changed: dict[str, Array] = {}
            for name in VALUES:
                column = np.roll(getattr(rows, name), shift, axis=0)
                column[: max(shift, 0)] = np.nan
                column[len(column) + min(shift, 0) :] = np.nan
                changed[name] = column
            moved: Any = changed
            return replace(rows, **moved)

        rows = "a row" if abs(shift) == 1 else f"{abs(shift)} rows"
        way = "before" if shift > 0 else "after"
        text = f"what was measured stands {rows} {way} its readings: shift one against the other"
        yield Mistake(text, undo)


def _wrong_steps(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield joints whose readings are perhaps in wrong steps, from zero or an end of the travel."""
    names, legs = guess.robot.joint_names, guess.robot.legs
    count = len(names)
    ends = [("", np.zeros(count))]
    if all(leg.limits is not None for leg in legs):
        limits = np.array([leg.limits for leg in legs])
        ends += [(" from the upper end", limits[:, 1]), (" from the lower end", limits[:, 0])]
    for factor, size, cause in _STEPS:
        for where, end in ends:
            for joints in (range(count), *((i,) for i in range(count))):
                factors = np.where(np.isin(np.arange(count), joints), factor, 1.0)
                yield Mistake(
                    f"the readings of {_listed_joints(joints, names)}{where} are {size} as large "
                    f"as they should be, {cause}: give steps, lead or gear ratio as they are",
                    _transform_joints(guess, (1.0 - factors) * end, factors),
                )


def _wrong_zeros_and_scales(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield zeros and scales that rows together show to be off, of few joints and of all."""
    for kinds in (("zeros",), ("scales",), ("scales", "zeros")):
        everything = range(len(guess.robot.legs))
        fitted = _fit_readings(measurements, guess, dict.fromkeys(kinds, everything))
        if fitted is None:
            continue
        far = {kind: _far_joints(guess, fitted, kind) for kind in kinds}
        count = sum(map(len, far.values()))
        if 0 < count < len(kinds) * len(everything):
            few = _fit_readings(
                measurements, guess, {kind: far[kind] for kind in kinds if far[kind]}
            )
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
        yield Mistake(text, _transform_joints(guess, np.zeros(count), np.full(count, factor)), 1)


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
