"""A calibration's unknowns and a guess of their values: machine, zeros, scales, marks, frame, ...

`Guess.apply_step` takes a step in the unknowns; `Block` groups those that are moved together.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pteron.bodies.vectors import rotation_matrices
from pteron.calibration.measurements import TOOL, Measurements, Place, ReferencePlane
from pteron.equations.variations import Variation, vary_geometry
from pteron.manipulator import Manipulator

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Unknown:
    """One number that a calibration seeks.

    Attributes
    ----------
    name : str
        "legs[2].lower_length", "zeros[1]", "planes.bed.offset", "instrument about z".
    group : str
        Unknowns that share `free` and `prior`; "setup" for marks, planes, anchors and frame.
    unit : str
        "m", "rad" or "".
    tolerance : float
        Standard deviation about the value as drawn, before anything is measured; inf: none.
    """

    name: str
    group: str
    unit: str
    tolerance: float


@dataclass(frozen=True)
class Guess:
    """Values of all unknowns of a calibration.

    Attributes
    ----------
    robot : Manipulator
        The machine; its joint coordinates are q = zeros + scales * readings.
    zeros, scales : array, shape (n,)
        m or rad, and 1.
    marks, anchors : mapping
        Points (3,), m: on the platform, in its frame, and in the base frame.
    planes : mapping
        Normal and offset, (4,).
    turn, shift : array, shapes (3, 3) and (3,)
        A point y of the instrument's frame is at turn y + shift in the base frame, m.
    """

    robot: Manipulator
    zeros: Array
    scales: Array
    marks: Mapping[str, Array]
    anchors: Mapping[str, Array] = field(default_factory=dict)
    planes: Mapping[str, Array] = field(default_factory=dict)
    turn: Array = field(default_factory=lambda: np.eye(3))
    shift: Array = field(default_factory=lambda: np.zeros(3))

    @classmethod
    def drawn(cls, robot: Manipulator, measured: Measurements) -> Guess:
        """Return the guess before a fit: the machine as drawn, its surroundings as described."""
        setup = measured.setup
        marks = {TOOL: Place(robot.platform.tool or (0.0, 0.0, 0.0))} | dict(setup.marks)
        planes = {TOOL: ReferencePlane()} | dict(setup.planes)
        return cls(
            robot,
            np.array([leg.reading.zero if leg.reading else 0.0 for leg in robot.legs]),
            np.array([leg.reading.scale if leg.reading else 1.0 for leg in robot.legs]),
            {name: np.array(mark.at) for name, mark in marks.items()},
            {name: np.array(place.at) for name, place in setup.anchors.items()},
            {name: np.array([*plane.normal, plane.offset]) for name, plane in planes.items()},
        )

    def joints(self, readings: Array) -> Array:
        """Return the joint coordinates (N, n) of readings."""
        return self.zeros + self.scales * readings

    def readings(self, joints: Array) -> Array:
        """Return the readings (N, n) at joint coordinates."""
        return (joints - self.zeros) / self.scales

    def mark_points(self, names: Iterable[str]) -> Array:
        """Return the points (N, 3) of marks, in the platform's frame, m."""
        order = {name: k for k, name in enumerate(self.marks)}
        return np.stack([*self.marks.values()])[[order[name] for name in names]]

    def points(self, marks: Sequence[str], poses: Array) -> Array:
        """Return the positions (N, 3) of the rows' marks at poses, in the base frame, m."""
        place, axes = self.robot.platform.placement(poses)
        return np.asarray(place + np.einsum("nij,ni->nj", axes, self.mark_points(marks)))

    def apply_step(self, blocks: Sequence[UnknownBlock], step: Array) -> Guess:
        """Return the guess after a step in all unknowns."""
        guess = self
        for block in blocks:
            guess = block.move(guess, step[block.where])
        return guess


@dataclass(frozen=True)
class UnknownBlock:
    """Unknowns of one kind, and their slice of the vector of all unknowns."""

    kind: str
    """"geometry", "zeros", "scales", "mark", "plane", "anchor" or "frame"."""
    name: str
    unknowns: tuple[Unknown, ...]
    changes: tuple[Variation, ...] = ()
    legs: tuple[int, ...] = ()
    where: slice = field(default_factory=lambda: slice(0))

    def move(self, guess: Guess, step: Array) -> Guess:
        """Return a guess whose unknowns of this block are moved by a step."""
        if self.kind == "geometry":
            return replace(guess, robot=vary_geometry(guess.robot, self.changes, step))
        if self.kind in ("zeros", "scales"):
            numbers = getattr(guess, self.kind).copy()
            numbers[list(self.legs)] += step
            return replace(guess, **{self.kind: numbers})
        if self.kind in ("mark", "anchor"):
            places = getattr(guess, f"{self.kind}s")
            moved: Any = {**places, self.name: places[self.name] + step}
            return replace(guess, **{f"{self.kind}s": moved})
        if self.kind == "plane":
            normal, offset = guess.planes[self.name][:3], guess.planes[self.name][3]
            tilted = normal + plane_axes(normal) @ step[:2]
            plane = np.append(tilted / np.linalg.norm(tilted), offset + step[2])
            return replace(guess, planes={**guess.planes, self.name: plane})
        turn = rotation_matrices(step[3:]) @ guess.turn
        return replace(guess, turn=turn, shift=guess.shift + step[:3])

    def values(self, guess: Guess) -> Array:
        """Return the block's values (k,) in a guess; 0 for a direction, which is turned."""
        if self.kind in ("zeros", "scales"):
            return np.asarray(getattr(guess, self.kind)[list(self.legs)])
        if self.kind in ("mark", "anchor"):
            return np.asarray(getattr(guess, f"{self.kind}s")[self.name])
        if self.kind == "plane":
            return np.array([0.0, 0.0, guess.planes[self.name][3]])
        if self.kind == "frame":
            return np.concatenate([guess.shift, np.zeros(3)])
        return np.array([change.value(guess.robot) for change in self.changes])


def number_unknowns(blocks: Iterable[UnknownBlock], start: int = 0) -> tuple[UnknownBlock, ...]:
    """Return blocks with consecutive slices of the unknowns, from `start` on."""
    placed_blocks = []
    for block in blocks:
        stop = start + len(block.unknowns)
        placed_blocks.append(replace(block, where=slice(start, stop)))
        start = stop
    return tuple(placed_blocks)


def tolerances_of(blocks: Sequence[UnknownBlock]) -> Array:
    """Return the tolerances (p,) of all unknowns; inf where there is none."""
    return np.array([unknown.tolerance for block in blocks for unknown in block.unknowns])


def variances(slopes: Array, covariance: Array) -> Array:
    """Return the variances (N,) of vectors with slopes (N, k, p), for a covariance (p, p)."""
    return np.asarray(np.einsum("nip,pq,niq->n", slopes, covariance, slopes, optimize=True))


def plane_axes(normal: Array) -> Array:
    """Return two unit vectors (3, 2) at right angles to a normal, nearest to the base's axes."""
    least = np.argsort(np.abs(normal), kind="stable")[:2]
    first = np.eye(3)[min(least)] - normal[min(least)] * normal
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)], axis=-1)
