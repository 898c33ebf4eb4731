"""`pteron workspace`: maps of the reach and of performance indices, and proofs by intervals."""

from __future__ import annotations

from collections.abc import Collection
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pteron.atomic import checked_file
from pteron.cli.arguments import MachineArgument, about_pivot
from pteron.cli.certify import RequestedProofs
from pteron.cli.map_summary import map_data, map_rows, show_map
from pteron.cli.pose_ranges import pose_ranges, pose_text
from pteron.cli.progress import progress_bar, spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import file_lines, is_terminal, note, show, warn, write
from pteron.errors import DataError, ModelError, OutputError

if TYPE_CHECKING:
    from pteron.manipulator import Manipulator
    from pteron.maps import Grid, Map
    from pteron.workspace import ReachVolume

_PICTURES = (".png", ".svg", ".pdf")
"""Endings of pictures."""

_FILMS = (".mp4", ".gif")
"""Endings of films."""

_DATA = (".csv", ".parquet", ".npz", ".zarr")
"""Endings of maps' data."""

_SURFACES = (".vtk", ".vtu", ".ply", ".stl")
"""Endings of surfaces."""

_RIM = 0.04
"""Share of the reach's width that pictures show around it."""

_FRAMES = 61
"""Frames of a film where their number is not given."""

_FILM_POINTS = 120
"""Points along each axis of a film's pictures where their number is not given."""

_DPI = 200.0
"""Pixels an inch of pictures."""


def workspace(
    machine: MachineArgument,
    *,
    index: list[str] | None = None,
    slice_: str | None = None,
    points: int | None = None,
    out: str | None = None,
    certify: bool = False,
    prove: str | None = None,
    from_: str | None = None,
    tolerance: float | None = None,
    type_i: float | None = None,
    type_ii: float | None = None,
    pivot: str | None = None,
    engine: Literal["auto", "jax"] = "auto",
    workers: int | None = None,
    scheduler: str | None = None,
) -> CommandResult:
    """Map the workspace: its extent, what limits it, and an index of performance in it.

    The index is mapped over the poses of a grid; without --index, the distance to the boundary of
    the workspace is. A warning says if the machine is singular everywhere. Pictures hatch poses out
    of reach, and brighter is better; lengths are in mm, angles in degrees.

    Coordinates that --slice does not name vary over the workspace. Surfaces need three that vary; a
    film goes through the last of three.

    With --certify, --prove or --from nothing is mapped: interval arithmetic proves, rounding
    included, how large the workspace is at an orientation (--slice phi=VALUE), that every pose of a
    box is in reach and within limits, or how far the machine can go from a pose along and about
    each axis. If a box is not proved, the output names a pose and the reason, and the exit code is
    1.

    A .zarr store grows chunk by chunk: the same command resumes after an interruption. Workers of a
    cluster write to it, so they must reach it by the same path.

    Options
    -------
    --index INDEX: Index to map: condition, kappa, pressure_angle, ...; repeat for several.
        [default: the distance to the boundary of the workspace]
    --slice NAME=VALUE,...: Fixed coordinates, and ranges of others: z=0,phi=0 or z=0,phi=-1:1; m
        and rad. All others vary. [default: the plane through the home pose]
    --points: Points along each coordinate that varies. [default: 200 in a plane, 100 in space]
    --out FILE: A picture (.png .svg .pdf), data (.csv .parquet .npz .zarr), surfaces (.vtk .vtu
        .ply .stl) or a film (.mp4 .gif).

    Proofs
    ------
    --certify: Prove the size of the workspace, what limits it, and a cube inside.
    --prove NAME=LEAST:GREATEST,...: Prove that all poses of a box can be used:
        x=-0.05:0.05,y=0:0.1,z=0; m and rad.
    --from POSE: Prove how far it can go from a pose along each coordinate, and what stops it;
        numbers in m and rad, such as 0,0,-0.9, or home.
    --tolerance SHARE: With --certify: largest undecided share of the volume. [default: 0.05]
    --type-i FLOOR: In a proof: least type-I measure of every leg, 0 stretched or folded, 1 at best.
    --type-ii FLOOR: In a proof: least type-II measure, 0 where the drives cannot hold the platform.

    Computing
    ---------
    --engine: Engine that computes: jax uses an accelerator.
    --workers: Number of processes on this computer.
    --scheduler

    Examples
    --------
    pteron workspace delta
    pteron workspace quadrupteron --index kappa --slice z=0,phi=0 --out kappa.png
    pteron workspace quadrupteron --index condition --slice phi=0 --out condition.vtk
    pteron workspace robot.toml --index kappa --slice z=0 --points 400 --out kappa.zarr
    pteron workspace delta --certify
    pteron workspace delta --from 0,0,-0.9
    pteron workspace delta --prove x=-0.2:0.2,y=-0.2:0.2,z=-1.0:-0.8
    """
    proofs = RequestedProofs(certify, prove, tolerance, type_i, type_ii, from_)
    maps = {"index": index, "points": points, "out": out, "workers": workers}
    other = {"scheduler": scheduler, "engine": None if engine == "auto" else engine}
    proofs.check({**maps, **other}, slice_)
    machine = about_pivot(machine, pivot)
    warnings = _warnings(machine)
    if proofs.has_requests:
        return proofs.result(machine, slice_, warnings)
    from pteron.maps import map_index

    names = _checked_indices(machine, index or [])
    ending = _expect_output(out)
    if ending in (*_FILMS, *_SURFACES) and len(names) > 1:
        raise DataError(f"--index: {len(names)} given, and {out} shows one; give one")
    if scheduler is not None and ending != ".zarr":
        raise DataError(
            "--scheduler: the workers write to a store that all reach; give it with --out, such as "
            "--out map.zarr"
        )
    with spinner(f"Computing the reach of {machine.name}"):
        grid = _grid(machine, slice_, points, ending)
    warn(warnings)
    with spinner(f"Computing the reach of {machine.name}"):
        volume = _volume(machine, grid)
    warn(outside := _unreachable_slice_warnings(grid, volume))
    with progress_bar(f"Mapping {machine.name}") as tell:
        index_map = map_index(
            machine,
            names,
            grid,
            engine=engine,
            out=out if ending in (*_DATA, *_SURFACES) else None,
            scheduler=scheduler,
            workers=workers,
            progress=tell,
        )
    if out is not None and ending in (*_PICTURES, *_FILMS):
        _draw(index_map, out, ending)
    record = map_data(index_map, volume, [*warnings, *outside], out)
    return CommandResult(record, partial(_show, index_map, volume, record, out))


def _show(
    index_map: Map, volume: ReachVolume | None, record: dict[str, Any], out: str | None
) -> None:
    """Print a map on a terminal, or write its rows as CSV to a pipe; then list the files."""
    if is_terminal():
        show_map(index_map, volume, record)
    else:
        write(map_rows(record).write_csv())
    if out is not None:
        (show if is_terminal() else note)(*file_lines(out))


def _checked_indices(robot: Manipulator, names: list[str]) -> tuple[str, ...]:
    """Return the indices without duplicates, the margin by default; raise on unknown names."""
    from pteron.indices import INDICES, indices_of
    from pteron.maps.map import MARGIN

    known = (*indices_of(robot), MARGIN.name)
    for name in names:
        if name in known:
            continue
        if name in INDICES:
            raise DataError(
                f"--index: {name} is about turning, which {robot.name} does not; it has "
                f"{', '.join(known)}"
            )
        close = get_close_matches(name, known, 1)
        hint = f"did you mean {close[0]}? " if close else ""
        raise DataError(f"--index: {name!r} is not known; {hint}there are {', '.join(known)}")
    return tuple(dict.fromkeys(names)) or (MARGIN.name,)


def _expect_output(out: str | None) -> str:
    """Return the ending of a file; raise, before the work begins, if it cannot be written."""
    if out is None:
        return ""
    ending = Path(out).suffix.lower()
    if ending in _FILMS:
        from pteron.plots.films import checked_film

        checked_film(out)
    elif ending in (*_DATA, *_SURFACES):
        from pteron.maps.files import checked_map_file

        checked_map_file(out)
    elif ending not in _PICTURES:
        every = " ".join((*_PICTURES, *_DATA, *_SURFACES, *_FILMS))
        raise OutputError(f"{out}: {ending or 'no'} ending; give one of {every}")
    else:
        checked_file(out)
    return ending


def _warnings(robot: Manipulator) -> list[str]:
    """Return the warning that a layout is singular everywhere; empty where it is not."""
    from pteron.kinematics.architecture import is_singular_everywhere, singular_everywhere

    return [str(singular_everywhere(robot))] if is_singular_everywhere(robot) else []


def _grid(robot: Manipulator, text: str | None, points: int | None, ending: str) -> Grid:
    """Return the grid of poses of the slice, with the number of axes that the file needs."""
    from pteron.maps import pose_grid

    names = robot.coordinates
    constants, ranges = pose_ranges(text, "--slice")
    if ending in _FILMS:
        points = points or _FILM_POINTS
        if text is None and len(names) > 3:
            constants = _home(robot, [name for name in names[:-1] if name not in ("x", "y")])
    elif ending in _SURFACES and text is None and len(names) > 3:
        constants = _home(robot, robot.platform.angles)
    fixed = constants if text is not None or ending in (*_FILMS, *_SURFACES) else None
    grid = pose_grid(robot, fixed, ranges, points=points, rim=_RIM if ending else 0.0)
    count = len(grid.axes)
    varying = ", ".join(axis.name for axis in grid.axes)
    if ending in (*_FILMS, *_SURFACES) and count != 3:
        what = "a film goes through the last of" if ending in _FILMS else "surfaces need"
        raise DataError(f"--out: {what} three coordinates that vary, and here there vary {varying}")
    if ending in _PICTURES and count > 3:
        raise DataError(f"--out: a picture shows three coordinates, and here there vary {varying}")
    if ending in _FILMS and points and not any(len(span) > 2 for span in ranges.values()):
        return _with_frames(grid)
    return grid


def _home(robot: Manipulator, names: Collection[str]) -> dict[str, float]:
    """Return coordinates of the home pose by name."""
    from pteron.workspace import home_pose

    pairs = zip(robot.coordinates, home_pose(robot).tolist(), strict=True)
    return {name: coordinate for name, coordinate in pairs if name in names}


def _with_frames(grid: Grid) -> Grid:
    """Return a grid with as many values of the last coordinate as a film has frames."""
    from dataclasses import replace

    *axes, last = grid.axes
    return replace(grid, axes=(*axes, replace(last, count=_FRAMES)))


def _volume(robot: Manipulator, grid: Grid) -> ReachVolume | None:
    """Return the reach at the grid's orientation; None where that varies or the reach is empty."""
    from pteron.workspace import reach_volume

    if any(axis.unit == "rad" for axis in grid.axes) or len(robot.platform.lengths) < 2:
        return None
    try:
        return reach_volume(robot, grid.pose)
    except ModelError:
        return None


def _unreachable_slice_warnings(grid: Grid, volume: ReachVolume | None) -> list[str]:
    """Return warnings of fixed lengths at which nothing is in reach."""
    from pteron.platforms.coordinates import coordinate

    if volume is None:
        return []
    lengths = [name for name in grid.coordinates if coordinate(name).unit == "m"]
    fixed = grid.fixed_coordinates
    spans = zip(lengths, *volume.box.tolist(), strict=True)
    return [
        f"nothing is in reach at {pose_text(name, fixed[name])}: {name} goes from {low:.4g} to "
        f"{high:.4g} m at this orientation"
        for name, low, high in spans
        if name in fixed and not low <= fixed[name] <= high
    ]


def _draw(index_map: Map, out: str, ending: str) -> None:
    """Save a picture of a map, or a film of its first index, by the file's ending."""
    from pteron.plots import map_figure, map_film, save_figure

    if ending in _PICTURES:
        with spinner(f"Drawing {index_map.robot}"):
            save_figure(map_figure(index_map), out, dpi=_DPI)
        return
    with progress_bar(f"Filming {index_map.robot}") as tell:
        map_film(index_map, next(iter(index_map.values)), out, progress=tell)
