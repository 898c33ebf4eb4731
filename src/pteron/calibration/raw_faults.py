"""Likely mistakes in measurements, found before any fit: wrong units, swapped legs or marks, frame.

Measurements should lie within noise and tolerances of what the machine as drawn would give; where
they do not, each likely mistake is undone on trial, and told where they then do.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.calibration.guess import Block, Guess, tolerances_of
from pteron.calibration.measurements import Measurements
from pteron.calibration.residuals import MachineSlopes
from pteron.calibration.start import placed, starting_poses
from pteron.errors import DataError, UnlikelyValue

Array = NDArray[np.float64]

_FAR = 25.0
"""Median over rows of the mean squared residual, in variances of noise and tolerances, from which
mistakes are tried."""

_NEAR = 9.0
"""The same below which a mistake, undone, explains the residuals."""

_ROWS = 16
"""Rows that are examined, drawn at random."""

_NOISE = 1e-4
"""Assumed noise, m and rad: small beside the effect of tolerances."""


def raw_fault(given: Measurements, blocks: Sequence[Block], robot_guess: Guess) -> str | None:
    """Return the mistake, in words, that explains measurements far from the drawing; else None."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnlikelyValue)  # what is tried may well be unlikely
        return _fault(given, blocks, robot_guess)


def _fault(given: Measurements, blocks: Sequence[Block], robot_guess: Guess) -> str | None:
    # At random: rows at even steps might all be of one mark.
    some = np.random.default_rng(0).permutation(len(given)) < _ROWS
    rows = given.rows(some)
    now = _misfit(rows, blocks, robot_guess)
    if now < _FAR:
        return None
    for mistakes in _MISTAKES:
        tried = (
            (_misfit(mended, blocks, robot_guess), text)
            for text, mended in mistakes(rows, robot_guess)
        )
        found = [(left, text) for left, text in tried if left < min(_NEAR, 0.1 * now)]
        if found:
            return min(found)[1]
    return None


def _misfit(rows: Measurements, blocks: Sequence[Block], guess: Guess) -> float:
    """Return the rows' median of the mean squared residual, in variances; inf: no pose."""
    try:
        poses = starting_poses(guess, rows)
    except DataError:
        return np.inf
    start = placed(guess, rows, poses)
    slopes = MachineSlopes(guess.robot, blocks)
    at = slopes.rows(start, rows, poses, np.arange(len(rows)))
    tolerances = np.minimum(tolerances_of(blocks), 1.0)
    for block in blocks:
        if block.kind == "frame" and start.turn is not guess.turn:
            tolerances[block.where] = 0.0  # all rows together have fixed it
    scaled = at.slopes * tolerances
    width = at.residuals.shape[1]
    covariance = scaled @ np.swapaxes(scaled, -1, -2) + _NOISE**2 * np.eye(width)
    whitened = np.linalg.solve(covariance, at.residuals[..., None])[..., 0]
    squares = np.einsum("nk,nk->n", at.residuals, whitened)
    counts = np.maximum(at.measured.sum(axis=1), 1)
    return float(np.median(squares / counts))


def _units(given: Measurements, guess: Guess) -> Iterator[tuple[str, Measurements]]:
    """Yield units that were perhaps meant, and the measurements in them."""
    linear = np.array([leg.joint.unit == "m" for leg in guess.robot.legs])
    lengths = [name for name in ("position", "height", "distance") if name in given.kinds]
    for factor, text in ((1e-3, "in millimetres"), (1e3, "1000 times too small, as of km for m")):
        scaled = {f"{name}s": factor * getattr(given, f"{name}s") for name in lengths}
        if linear.any():
            scaled["readings"] = np.where(linear, factor, 1.0) * given.readings
        advice = f"are {text}: give them in metres"
        for name, values in scaled.items():
            yield f"the {name} {advice}", replace(given, **{name: values})
        if len(scaled) > 1:
            yield f"all lengths {advice}", replace(given, **scaled)
    if not linear.all():
        read = np.where(linear, given.readings, np.radians(given.readings))
        yield "the readings are in degrees: give them in radians", replace(given, readings=read)
    if "angle" in given.kinds:
        yield (
            "the measured angles are in degrees: give them in radians",
            replace(given, angles=np.radians(given.angles)),
        )


def _marks(given: Measurements, guess: Guess) -> Iterator[tuple[str, Measurements]]:
    """Yield marks that were perhaps swapped, and the measurements with them exchanged."""
    used = sorted(set(given.marks))
    for a, b in combinations(used, 2):
        other = {a: b, b: a}
        yield (
            f"the marks {a or 'tool'} and {b or 'tool'} are swapped: exchange their names",
            replace(given, marks=tuple(other.get(name, name) for name in given.marks)),
        )


def _frames(given: Measurements, guess: Guess) -> Iterator[tuple[str, Measurements]]:
    """Yield quarter turns of the instrument, and the measurements turned back."""
    if given.setup.frame_known and not np.isnan(given.positions).any():
        cube = scipy.spatial.transform.Rotation.create_group("O")
        for turn in np.round(cube[cube.magnitude() > 0.1].as_matrix()):
            # Rows of `turn` say where the instrument's x, y and z point.
            told = ", ".join(
                f"{'xyz'[k]} along {'-' if row.sum() < 0 else ''}{'xyz'[int(np.abs(row).argmax())]}"
                for k, row in enumerate(turn)
            )
            yield (
                f"the instrument's frame is turned: its {told} of the base; turn the positions, or "
                'say [instrument] frame = "unknown"',
                replace(given, positions=given.positions @ turn),
            )


def _legs(given: Measurements, guess: Guess) -> Iterator[tuple[str, Measurements]]:
    """Yield legs whose readings were perhaps swapped, and the measurements with them exchanged."""
    names = guess.robot.joint_names
    for i, j in combinations(range(len(names)), 2):
        order = list(range(len(names)))
        order[i], order[j] = j, i
        yield (
            f"the readings of legs {i + 1} and {j + 1} ({names[i]} and {names[j]}) are swapped: "
            "exchange the columns",
            replace(given, readings=given.readings[:, order]),
        )


_MISTAKES = (_units, _marks, _frames, _legs)
"""Likely mistakes, those that are quick to try first."""
