"""What the files of version 0.1 hold, as the public functions and commands read them.

`data/files-0.1/make.py` wrote the files and `values.json` with that version;
`test_earlier_files.py` reads them with the present one.
"""

import json
import re
import tomllib
from functools import partial
from pathlib import Path
from shutil import copytree
from tempfile import TemporaryDirectory

import meshio
import numpy as np
import pytest
from typer.testing import CliRunner

import pteron
from pteron.cli.main import app
from pteron.design import read_spec, search, survey
from pteron.errors import OutputError
from pteron.identification import read_log
from pteron.maps import load_map, map_index, pose_grid
from pteron.motion import read_motors

FOLDER = Path(__file__).parent / "data" / "files-0.1"
ROBOTS, MAPS, DESIGN = FOLDER / "robots", FOLDER / "maps", FOLDER / "design"
FIVE_BAR = ROBOTS / "five-bar.toml"


def command(*words):
    """Return what a command prints with --json."""
    done = CliRunner().invoke(app, [*map(str, words), "--json"], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


def machine(path):
    """Return all keys of a robot's file, and what is computed from them."""
    robot = pteron.load(path)
    state = json.loads((ROBOTS / "states.json").read_text())[path.name]
    with TemporaryDirectory() as folder:
        saved = tomllib.loads(pteron.save(robot, Path(folder) / "again.toml").read_text("utf-8"))
    return {
        "keys": saved,
        "parameters": dict(
            zip(pteron.parameter_names(robot), pteron.parameters(robot).tolist(), strict=True)
        ),
        "joints": pteron.inverse_kinematics(robot, state[0]).tolist(),
        "drive forces": pteron.drive_forces(robot, *state).tolist(),
        "clearance": float(pteron.workspace.clearance(robot, state[0]).least),
    }


def log(path):
    """Return the samples of a log of the machine that the first word of its name says."""
    found = read_log(path, ROBOTS / f"{path.stem.partition('.')[0]}.toml")
    return {
        "time": found.time.tolist(),
        "joints": found.joints.tolist(),
        "forces": found.forces.tolist(),
        **{
            name: array.tolist()
            for name, array in (("pose", found.pose), ("payload", found.payload))
            if array is not None
        },
        "period": found.description.period,
        "unit of forces": found.description.force_unit,
        "findings": [finding.kind for finding in found.findings],
    }


def identified(path):
    """Return the base parameters of an identification, as `pteron export --base` writes them."""
    with TemporaryDirectory() as folder:
        command("export", FIVE_BAR, "--base", path, "--c", folder)
        source = (Path(folder) / "five_bar.c").read_text("utf-8")
    table = re.search(r"_base_parameters\[\d+\] = \{\n(.*?)\n\};", source, re.DOTALL)[1]
    found = re.findall(r"(?m)^ *(\S+?),? /\* (.*) \*/$", table)
    return {text: float(value.strip("()")) for value, text in found}


def identified_machine(path):
    """Return all parameters of an identified machine."""
    return pteron.parameters(path).tolist()


def index_map(path):
    """Return the indices of a map over its grid."""
    found = load_map(path)
    return {
        "axes": {axis.name: axis.values.tolist() for axis in found.grid.axes},
        "status": found.status.tolist(),
        "indices": {name: values.tolist() for name, values in found.values.items()},
    }


def continued(path):
    """Return what comes of a map that was ended, and what of it was kept."""
    with TemporaryDirectory() as folder:
        place = copytree(path, Path(folder) / path.name)
        kept = _files(place)
        found = continued_map(place)
        new = _files(place)
        assert kept <= new
        return {"kept": len(kept), "computed": len(new - kept), **found}


def _files(place):
    """Return the names of files that are called after what is in them, and of a map's chunks."""
    return {file for file in place.rglob("*") if file.suffix == ".parquet" or file.name.isdecimal()}


def continued_map(path):
    """Compute the chunk that a map lacks; it is small, since most of it is out of reach."""
    grid = pose_grid(FIVE_BAR, {}, {"x": (-0.1, 50.0, 515), "y": (0.1, 50.0, 257)})
    found = map_index(FIVE_BAR, "condition", grid, out=path)
    values = found.values["condition"]
    return {
        "sums of status": found.status.sum(axis=1).tolist(),
        "in reach": values[np.isfinite(values)].tolist(),
    }


def refused(path):
    """Return how a search or a survey that was ended is refused: its quantities changed."""
    spec = read_spec(DESIGN / "five-bar.toml")
    with TemporaryDirectory() as folder:
        place = copytree(path, Path(folder) / path.name)
        run = search if path.name == "search" else partial(survey, count=256)
        with pytest.raises(OutputError) as caught:
            run(spec, folder=place)
    text = str(caught.value).partition("holds ")[2]
    return re.sub(r"; designs '\w+', not '\w+'", "", text)  # the first designs are others too


def surfaces(path):
    """Write a map's surfaces anew, and return their size, their middle, and their fields' means."""
    with TemporaryDirectory() as folder:
        anew = Path(folder) / path.name
        options = "--index", "condition", "--points", 9, "--out", anew
        command("workspace", ROBOTS / "delta.toml", *options)
        mesh = meshio.read(anew)
    return {
        "points": len(mesh.points),
        "middle": mesh.points.mean(axis=0).tolist(),
        "cells": {block.type: len(block.data) for block in mesh.cells},
        "fields": {name: float(np.nanmean(data)) for name, data in mesh.point_data.items()},
    }


def motion(path):
    """Return what a command makes of a motion, a table of poses or a list of motors."""
    if path.stem == "motors":
        return [vars(motor) for motor in read_motors(path)]
    if path.suffix == ".toml":  # beside an exciting motion, for the log that is to be recorded
        return tomllib.loads(path.read_text("utf-8"))
    if path.stem == "poses":
        return {
            "inverse": command("inverse", FIVE_BAR, "--table", path),
            "cycle": command("cycle", FIVE_BAR, "--via", path, "--duration", 2),
        }
    return {
        "forces": command("forces", FIVE_BAR, "--table", path)[::10],
        "cycle": command("cycle", FIVE_BAR, "--table", path),
        "drives": command("size", FIVE_BAR, "--cycle", path, "--friction", 0)["drives"],
    }


FILES = {
    "robots": (machine, sorted(ROBOTS.glob("*.toml"))),
    "logs": (log, sorted(set((FOLDER / "logs").glob("*")) - set((FOLDER / "logs").glob("*.toml")))),
    "identified": (identified, sorted((FOLDER / "identified").glob("*/identification.json"))),
    "identified machines": (identified_machine, sorted((FOLDER / "identified").glob("*/*.toml"))),
    "maps": (index_map, sorted(MAPS.glob("map.*"))),
    "surfaces": (surfaces, sorted(MAPS.glob("*.vtk"))),
    "continued": (continued, [MAPS / "continued.zarr"]),
    "refused": (refused, [DESIGN / "search", DESIGN / "survey"]),
    "motions": (motion, sorted((FOLDER / "tables").iterdir())),
}
"""For each kind of file a function that reads one, and the files."""


def label(path):
    """Return a file's place in the folder."""
    return path.relative_to(FOLDER).as_posix()


def everything():
    """Return what every file of the folder holds."""
    return {
        kind: {label(path): read(path) for path in paths} for kind, (read, paths) in FILES.items()
    }
