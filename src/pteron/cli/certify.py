"""`pteron workspace --certify` and `--prove`: proofs about a workspace, by intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from pteron.cli.pose_ranges import box_of, pose_ranges, pose_spans, pose_text, span_text
from pteron.cli.progress import progress_bar, spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import note, percent, plain, show, table, warn
from pteron.cli.travels import travel_result
from pteron.errors import DataError, ModelError
from pteron.json_values import json_fields

if TYPE_CHECKING:
    from pteron.kernels import Array
    from pteron.manipulator import Manipulator
    from pteron.workspace import Box, Inscribed, Paving, Proof

_NOT_PROVED = 1
"""Exit code for a region that is not proved."""

TOLERANCE = 0.05
"""Default of the greatest undecided share of a volume; smaller ones take longer than seconds."""

_SHAPES = {1: ("length", "interval"), 2: ("area", "square"), 3: ("volume", "cube")}
"""Nouns for the size of a workspace and the shape inscribed in it, by its number of lengths."""

_MAY_BE_SINGULAR = (
    "Reach and joint limits are proved; poses may be singular. --type-ii FLOOR excludes poses near "
    "type-II singularities."
)
"""A note under proofs without a least type-II measure."""


@dataclass(frozen=True)
class RequestedProofs:
    """The proofs that the options ask for.

    Parameters
    ----------
    certify : bool
        Whether to prove the size of the whole workspace at an orientation.
    prove : str or None
        A box of poses to prove, as typed.
    tolerance : float or None
        Greatest undecided share of the workspace.
    type_i, type_ii : float or None
        Least singularity measures; None for no bound.
    start : str or None
        A pose, as typed, from which the travel is to prove.
    """

    certify: bool
    prove: str | None
    tolerance: float | None
    type_i: float | None
    type_ii: float | None
    start: str | None = None

    @property
    def has_requests(self) -> bool:
        """Whether there is anything to prove."""
        return self.certify or self.prove is not None or self.start is not None

    @property
    def floors(self) -> dict[str, float]:
        """The least measures by name, 0 for no bound."""
        return {"type_i": self.type_i or 0.0, "type_ii": self.type_ii or 0.0}

    def check(self, maps: Mapping[str, object], slice_: str | None) -> None:
        """Raise DataError on options that have no effect together, or numbers out of range."""
        numbers = {"tolerance": self.tolerance, "type-i": self.type_i, "type-ii": self.type_ii}
        other = {**maps, "slice": slice_, "certify": self.certify or None}
        if self.start is not None:
            _expect_none({**other, "prove": self.prove, "tolerance": self.tolerance}, "--from")
        elif self.prove is not None:
            _expect_none(other, "--prove")
            _expect_none({"tolerance": self.tolerance}, "--prove, but with --certify")
        elif self.certify:
            _expect_none(maps, "--certify")
        else:
            _expect_none(numbers, "a map, but with --certify, --prove or --from")
        for name, number in numbers.items():
            least = "above 0" if name == "tolerance" else "of 0 or more"
            if number is not None and not (number > 0.0 or (number == 0.0 and name != "tolerance")):
                raise DataError(f"--{name}: {number:g} given, a number {least} expected")

    def result(self, robot: Manipulator, slice_: str | None, warnings: list[str]) -> CommandResult:
        """Run the proof and return its result; the exit code is 1 if a box is not proved."""
        if self.start is not None:
            return travel_result(robot, self.start, self.floors, warnings)
        if self.prove is None:
            pose = _orientation(robot, slice_)
            proved = self._certify if robot.platform.lengths else self._certify_tilt
            return proved(robot, pose, warnings)
        from pteron.workspace import prove

        region = _region(robot, self.prove)
        warn(warnings)
        type_i, type_ii = self.type_i or 0.0, self.type_ii or 0.0
        with progress_bar(f"Proving a region for {robot.name}") as bar:
            proof = prove(robot, region, type_i=type_i, type_ii=type_ii, progress=bar)
        lines = [f"[bold]{plain(robot.name)}[/bold]: {_spans(robot, region)}", plain(str(proof))]
        lines += self._unsure if proof.holds else []
        record = _proof(proof, self.floors) | {"warnings": warnings}
        return CommandResult(record, lines, code=0 if proof.holds else _NOT_PROVED)

    @property
    def _unsure(self) -> list[str]:
        """The warning that type-II singularities are not excluded; empty where they are."""
        return [] if self.type_ii else [_MAY_BE_SINGULAR]

    def _certify_tilt(self, robot: Manipulator, pose: Array, warnings: list[str]) -> CommandResult:
        """Prove the largest tilt to every side at a pose, and return it as data and lines."""
        from pteron.workspace import conditions, largest_tilt

        warn(warnings)
        required = conditions(robot, **self.floors)
        with progress_bar(f"Proving how far {robot.name} leans") as bar:
            leans = largest_tilt(robot, pose, given=required, progress=bar)
        record = {"robot": robot.name, "floors": self.floors, "tilt": leans.tilt}
        lines = [
            _heading(robot, dict(list(_angles(robot, pose).items())[2:]), self.floors),
            f"Proved: the platform can tilt by {math.degrees(leans.tilt):.4g} deg in all "
            "directions.",
        ]
        return CommandResult(record | {"proved": True, "warnings": warnings}, lines + self._unsure)

    def _certify(self, robot: Manipulator, pose: Array, warnings: list[str]) -> CommandResult:
        """Prove bounds of the workspace's volume at a pose's angles, and its largest cube."""
        from pteron.workspace import conditions, largest_cube, paving

        warn(warnings)
        tolerance = TOLERANCE if self.tolerance is None else self.tolerance
        required = conditions(robot, **self.floors)
        with spinner(f"Proving the workspace of {robot.name}"):
            paved = paving(robot, pose, tolerance=tolerance, given=required)
            _ = paved.boundary_shares  # takes time, too
            try:
                cube = largest_cube(robot, pose, given=required)
            except ModelError:
                cube = None
        if not paved.complete:
            note(f"Warning: too many boxes: the gap is still above {percent(tolerance)}")
        contents = paved, pose, self.floors, cube
        return CommandResult(
            _paving_data(*contents) | {"warnings": warnings}, partial(_show, *contents)
        )


def _expect_none(options: Mapping[str, object], what: str) -> None:
    """Raise DataError on options that have no effect beside `what`."""
    for name, option in options.items():
        if option is not None and option != []:
            raise DataError(f"--{name}: does not go with {what}")


def _orientation(robot: Manipulator, slice_: str | None) -> Array:
    """Return a pose at the orientation of --slice, else the home pose."""
    import numpy as np

    from pteron.maps.grid import expect_coordinates
    from pteron.workspace import home_pose

    constants, ranges = pose_ranges(slice_, "--slice")
    expect_coordinates(robot, constants, ranges)
    angles = robot.platform.angles or ("phi",)
    if set(constants) - set(angles) or ranges:
        expected = ",".join(f"{name}=VALUE" for name in angles)
        raise DataError(f"--slice: with --certify only {expected}, the orientation, is expected")
    pose = np.array([constants.get(name, 0.0) for name in robot.coordinates])
    return pose if constants else home_pose(robot)


def _region(robot: Manipulator, text: str) -> Box:
    """Return the box that a text of pose ranges states; raise where a coordinate has no range."""
    spans = pose_spans(robot, text, "--prove", "; a proof is of all poses between")
    every = ", ".join(robot.coordinates)
    missing = [name for name in robot.coordinates if name not in spans]
    if missing:
        raise DataError(f"--prove: no {', '.join(missing)}; a region says all of {every}")
    return box_of([spans[name] for name in robot.coordinates])


def _paving_data(
    paved: Paving, pose: Array, floors: dict[str, float], cube: Inscribed | None
) -> dict[str, Any]:
    """Return a paving's volumes, box counts, boundary shares and largest cube as JSON data."""
    return {
        "robot": paved.robot.name,
        "held": _angles(paved.robot, pose),
        "floors": floors,
        **json_fields(inner=paved.inner_volume, outer=paved.outer_volume, unit=paved.unit),
        "gap": paved.gap if paved.inner_volume else None,
        "complete": paved.complete,
        "boxes": {"inner": len(paved.inner), "undecided": len(paved.boundary)},
        "boundary": paved.boundary_shares,
        "cube": cube and {**json_fields(edge=cube.edge, center=cube.center), "proved": True},
    }


def _proof(proof: Proof, floors: dict[str, float]) -> dict[str, Any]:
    """Return a proof as JSON data: region, verdict, counterexample or undecided pose, causes."""
    pose, undecided = proof.counterexample, proof.undecided
    low, high = proof.region.box.tolist()
    return {
        "robot": proof.robot.name,
        "region": dict(zip(proof.robot.coordinates, zip(low, high, strict=True), strict=True)),
        "floors": floors,
        "proved": proof.holds,
        "pose": None if pose is None else pose.tolist(),
        "undecided": None if undecided is None else undecided.tolist(),
        "causes": [str(condition) for condition in proof.causes],
        "why": proof.why or None,
        "conditions": [str(condition) for condition in proof.conditions],
        "boxes": proof.boxes,
    }


def _show(paved: Paving, pose: Array, floors: dict[str, float], cube: Inscribed | None) -> None:
    """Print the proved volumes, the largest cube, and the share of the boundary by cause."""
    from pteron.workspace import home_poses

    robot, shares, (noun, shape) = paved.robot, paved.boundary_shares, _SHAPES[len(paved.axes)]
    show(_heading(robot, _angles(robot, pose), floors))
    if not paved.outer_volume:
        show("Proved: no position is reachable under these conditions.")
        return
    show(
        f"Proved {noun} of the workspace: between {paved.inner_volume:.5g} and "
        f"{paved.outer_volume:.5g} {paved.unit}, gap {percent(paved.gap)} "
        f"({len(paved.inner)} boxes inside, {len(paved.boundary)} undecided)"
    )
    if home_poses(robot).mirror is not None:
        show("Poses on both sides of the base count; home is on one of them.")
    if cube is None:
        show(f"No {shape} inside the workspace was found.")
    else:
        center = zip(robot.coordinates, cube.center.round(6).tolist(), strict=True)
        lengths = robot.platform.lengths
        coordinates = ", ".join(pose_text(name, q) for name, q in center if name in lengths)
        show(f"Largest {shape} found, proved inside: edge {cube.edge:.4g} m, centre {coordinates}")
    undistinguished = 1.0 - sum(shares.values())
    causes = {plain(cause): share for cause, share in shares.items()}
    causes |= {"several of these": undistinguished} if undistinguished > 0.0 else {}
    rows = ((cause, percent(share)) for cause, share in causes.items())
    number = "share of the boundary"
    show(table("what limits the workspace", number, rows=rows, numbers=(number,)))
    if not floors["type_ii"]:
        show(_MAY_BE_SINGULAR)


def _heading(robot: Manipulator, angles: Mapping[str, float], floors: dict[str, float]) -> str:
    """Return the first line of a printout: the machine, the fixed angles, the nonzero floors."""
    where = ", ".join(pose_text(name, angle) for name, angle in angles.items())
    minimums = ", ".join(f"{name} {floor:g}" for name, floor in floors.items() if floor)
    text = f"[bold]{plain(robot.name)}[/bold]{f' at {where}' if where else ''}"
    return f"{text}, poses with at least {minimums}" if minimums else text


def _angles(robot: Manipulator, pose: Array) -> dict[str, float]:
    """Return the angles (rad) of a pose by coordinate."""
    pairs = zip(robot.coordinates, pose.tolist(), strict=True)
    return {name: angle for name, angle in pairs if name in robot.platform.angles}


def _spans(robot: Manipulator, region: Box) -> str:
    """Return a box of poses as text: each coordinate's value, or its range."""
    spans = zip(robot.coordinates, region.low, region.high, strict=True)
    return ", ".join(
        pose_text(name, low) if low == high else span_text(name, low + 0.0, high + 0.0)
        for name, low, high in spans
    )
