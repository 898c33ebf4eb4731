"""Twenty thousand damaged files: each is refused in words, computed again, or read as it stands.

No robot's file, log, map, store, search or checkpoint that was damaged by chance (bytes, lines,
numbers, keys, files of a folder) may end in anything but an error of Pteron. What carries a
checksum gives what was written, or is refused, or computed again; what carries none is read as it
stands: its numbers are those in the file, finite, and as they would be written again. None may take
2 s of a processor, or 500 MB: digits, nesting and archives that unpack to more are among them.
"""

from __future__ import annotations

import argparse
import csv
import io
import json
import shutil
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from resource import RUSAGE_SELF, getrusage
from time import process_time
from typing import Any

import numpy as np
import polars as pl
from damaging import Chance, damaged_bytes, damaged_folder, damaged_text

import pteron
from pteron.design import Task, read_spec
from pteron.errors import PteronError, UnlikelyValue
from pteron.export.identified_parameters import read_identified
from pteron.identification.logs import Log, read_log
from pteron.maps import Map, TableStore, load_map, map_index, pose_grid, save_map, sweep

_AS_WRITTEN, _AGAIN, _AS_IT_STANDS, _REFUSED = (
    "as it was written",
    "computed again",
    "as it stands",
    "refused",
)
_OUTCOMES = (_AS_WRITTEN, _AGAIN, _AS_IT_STANDS, _REFUSED)
_SLOW, _LARGE = 2.0, 500.0
"""Seconds of a mutant, and megabytes of them all, that are too many."""

_LONGEST = 6000
"""Characters of a message: twenty faults of a file, a line each."""


@dataclass(frozen=True)
class Kind:
    """A kind of file: how many of 20 000 it gets, what makes a mutant, and what reads it."""

    name: str
    share: int
    damage: Callable[[Path, Chance], Path]
    read: Callable[[Path], str]


class Wrong(Exception):
    """A damaged file was read as something that it does not hold."""


def expect(holds: object, what: str) -> None:
    """Say what is wrong where something does not hold."""
    if not holds:
        raise Wrong(what)


# Robots and searches: texts.


def robots(work: Path) -> Kind:
    """Return robots' files, those of the catalog."""
    folder = files("pteron.manipulator") / "catalog"
    texts = [(folder / f"{name}.toml").read_bytes() for name in pteron.catalog()]

    def damage(place: Path, chance: Chance) -> Path:
        file = place / "robot.toml"
        file.write_bytes(damaged_text(texts[int(chance.integers(len(texts)))], chance))
        return file

    def read(file: Path) -> str:
        robot = pteron.load(file)
        again = pteron.save(robot, file.with_name("again.toml"))
        expect(pteron.load(again) == robot, "a robot is another one when it is written and read")
        return _AS_IT_STANDS

    return Kind("robot", 5000, damage, read)


def searches(work: Path) -> Kind:
    """Return files of searches for a design."""
    text = b"""\
robot = "five-bar"
masses = "kept"

[[variables]]
moves = "legs.upper_length"
range = [0.10, 0.35]
each = true

[[variables]]
name = "bases"
moves = ["-legs[1].guide_point.x", "legs[2].guide_point.x"]
by = "factor"
range = [0.5, 1.5]

[workspace]
low = [-0.05, 0.1]
high = [0.05, 0.15]
samples = 3

[floors]
type_i = 0.1
type_ii = 0.05

[motion]
speed = 1.0
acceleration = 10

[[objectives]]
minimise = "links"

[[requirements]]
quantity = "condition"
most = 4.0

[search]
population = 8
generations = 3
refined = 1
seed = 5
"""
    (work / "search.toml").write_bytes(text)
    Task.from_spec(read_spec(work / "search.toml"))

    def damage(place: Path, chance: Chance) -> Path:
        file = place / "search.toml"
        file.write_bytes(damaged_text(text, chance))
        return file

    def read(file: Path) -> str:
        task = Task.from_spec(read_spec(file))
        expect(np.isfinite(task.ranges).all(), "a range is not finite")
        return _AS_IT_STANDS

    return Kind("search", 2000, damage, read)


# Logs.


def logs(work: Path) -> Kind:
    """Return logs with what is known about them, as CSV in two dialects and as Parquet."""
    robot = pteron.load("five-bar")
    time = np.arange(80) / 500.0
    wave = np.sin(np.outer(time, [23.0, 31.0]) + 1.0)
    columns = {"theta": 0.4 * wave + [1.5, 1.5], "torque": 2.0 * wave[:, ::-1]}
    named = {f"{name}{j + 1}": own[:, j] for name, own in columns.items() for j in range(2)}
    log = pl.DataFrame({"t": time, **named})
    log.write_csv(work / "log.csv")
    log.write_parquet(work / "log.parquet")
    plain, parquet = ((work / f"log.{ending}").read_bytes() for ending in ("csv", "parquet"))
    rows = [line.split(",") for line in plain.decode().splitlines()]
    german = "\n".join(";".join(cells).replace(".", ",") for cells in rows).encode()
    about = b"""\
[csv]
separator = ";"
decimal = ","
header_lines = 1
[time]
column = "t"
unit = "s"
[joints]
columns = ["theta1", "theta2"]
unit = "rad"
[forces]
columns = ["torque1", "torque2"]
unit = "N m"
limits = [[-4.0, 4.0]]
[motion]
period = 0.05
start = 0.0
end = 0.15
[drives]
rotor_inertia = [1e-5, 1e-5]
ratio = [10, 10.0]
"""

    (work / "german.csv").write_bytes(german)
    (work / "german.toml").write_bytes(about)
    for name in ("log.csv", "log.parquet", "german.csv"):
        expect(read_log(work / name, robot).rows == len(time), f"{name} is not read whole")

    def damage(place: Path, chance: Chance) -> Path:
        what = int(chance.integers(5))
        file = place / ("log.parquet" if what == 4 else "log.csv")
        if what == 4:
            file.write_bytes(damaged_bytes(parquet, chance))
        elif what > 1:  # its description is damaged, or it is, beside a description
            file.write_bytes(german if what == 2 else damaged_text(german, chance))
            file.with_suffix(".toml").write_bytes(
                damaged_text(about, chance) if what == 2 else about
            )
        else:
            file.write_bytes(damaged_text(plain, chance))
        return file

    def read(file: Path) -> str:
        found = read_log(file, robot)
        arrays = (found.time, found.joints, found.forces)
        expect(all(np.isfinite(values).all() for values in arrays), "a log holds NaN")
        expect((np.diff(found.time) > 0.0).all(), "the time of a log does not rise")
        if file.suffix == ".csv" and not file.with_suffix(".toml").exists():
            expect_in_file(found, file)
        return _AS_IT_STANDS

    return Kind("log", 5000, damage, read)


def expect_in_file(log: Log, file: Path) -> None:
    """Compare a log with its file, read by Python's own module: its forces are in it, in order."""
    csv.field_size_limit(1 << 30)
    text = file.read_bytes().decode("utf-8-sig", errors="replace")
    cells = {cell.strip() for row in csv.reader(io.StringIO(text)) for cell in row}
    known = {float(cell) for cell in cells if _is_number(cell)}
    expect(set(log.forces.ravel().tolist()) <= known, "a log has a force that its file has not")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


# Maps, and what is computed chunk by chunk.


def maps(work: Path) -> list[Kind]:
    """Return maps in each of their files, and the store that is resumed."""
    robot = pteron.load("five-bar")
    grid = pose_grid(robot, {}, {"x": (-0.1, 0.1, 6), "y": (0.1, 0.16, 5)})
    names = ("condition", "margin")
    whole = map_index(robot, names, grid)
    data = {
        ending: save_map(whole, work / f"map{ending}").read_bytes()
        for ending in (".csv", ".npz", ".parquet")
    }
    map_index(robot, names, grid, out=work / "map.zarr")

    def damage_csv(place: Path, chance: Chance) -> Path:
        file = place / "map.csv"
        file.write_bytes(damaged_text(data[".csv"], chance))
        return file

    def read_csv(file: Path) -> str:
        found = load_map(file)
        if not same(found, whole):
            expect_rows(found, file)
        return _AS_WRITTEN if same(found, whole) else _AS_IT_STANDS

    def damage_npz(place: Path, chance: Chance) -> Path:
        file = place / "map.npz"
        if chance.random() < 0.7:
            file.write_bytes(damaged_bytes(data[".npz"], chance))
        else:
            arrays: dict[str, Any] = dict(np.load(work / "map.npz"))
            if chance.random() < 0.1:
                name = ("margin", "other")[int(chance.integers(2))]
                more = {name: np.zeros(int(2 ** chance.uniform(10, 24)))}
                np.savez_compressed(file, **(arrays | more))
                return file
            key = sorted(arrays)[int(chance.integers(len(arrays)))]
            np.savez_compressed(file, **repacked(arrays, key, chance))
        return file

    def damage_parquet(place: Path, chance: Chance) -> Path:
        file = place / "map.parquet"
        file.write_bytes(damaged_bytes(data[".parquet"], chance))
        return file

    def read_checked(file: Path) -> str:
        expect(same(load_map(file), whole), "a changed map was read")
        return _AS_WRITTEN

    def read_store(store: Path) -> str:
        refused: PteronError | None = None
        try:
            expect(same(load_map(store), whole), "a changed store was read")
        except PteronError as error:
            refused = error
        told: list[float] = []
        found = map_index(robot, names, grid, out=store, progress=told.append)
        expect(same(found, whole), "a changed store was resumed")
        expect(same(load_map(store), whole), "a store is not whole after it was resumed")
        expect((refused is None) == (told == [1.0]), "a damaged chunk was not computed again")
        return _AS_WRITTEN if refused is None else _AGAIN

    return [
        Kind("map, CSV", 2000, damage_csv, read_csv),
        Kind("map, NPZ", 1500, damage_npz, read_checked),
        Kind("map, Parquet", 1500, damage_parquet, read_checked),
        Kind("store, Zarr", 1200, damaged_copies(work / "map.zarr"), read_store),
    ]


def damaged_copies(whole: Path) -> Callable[[Path, Chance], Path]:
    """Return a function that puts a damaged copy of a folder into another one."""

    def damage(place: Path, chance: Chance) -> Path:
        folder = shutil.copytree(whole, place / whole.name)
        damaged_folder(folder, chance)
        return folder

    return damage


def same(one: Map, other: Map) -> bool:
    """Say whether two maps hold the same."""
    return (
        one.grid == other.grid
        and np.array_equal(one.status, other.status)
        and one.values.keys() == other.values.keys()
        and all(np.array_equal(v, other.values[k], equal_nan=True) for k, v in one.values.items())
    )


def repacked(arrays: dict[str, Any], key: str, chance: Chance) -> dict[str, Any]:
    """Return an archive's arrays of which one is changed, but whole as the archive has it."""
    values = arrays[key]
    what = int(chance.integers(5))
    if key == "about" and what < 3:
        text = damaged_text(str(values).encode(), chance).decode(errors="replace")
        return {**arrays, key: np.array(text)}
    if what == 0 and values.size > 1:
        return {**arrays, key: np.roll(values, 1)}
    if what == 1:
        return {**arrays, key: values.astype("U3" if chance.random() < 0.5 else "c16")}
    if what == 2:
        return {**arrays, key: values.ravel()[:-1]}
    if what == 3:
        return {name: own for name, own in arrays.items() if name != key}
    return {**arrays, key: np.array([b"x", None], dtype=object)}


def expect_rows(found: Map, file: Path) -> None:
    """Compare a map with its table, read by Python's own module."""
    csv.field_size_limit(1 << 30)
    text = file.read_bytes().decode("utf-8-sig", errors="replace")
    rows = list(csv.reader(io.StringIO(text.replace("\r\n", "\n").replace("\r", "\n"))))
    header, *cells = [[cell.strip() for cell in row] for row in rows if any(map(str.strip, row))]
    at = {name.partition(" [")[0]: k for k, name in enumerate(header)}
    poses = found.grid.poses().reshape(-1, len(found.grid.coordinates))
    wanted = {tuple(np.round(pose, 9)): k for k, pose in enumerate(poses)}
    expect(len(cells) == len(poses), "a map has not one pose a row")
    for row in cells:
        pose = tuple(np.round([float(row[at[name]]) for name in found.grid.coordinates], 9))
        k = wanted[pose]
        for name, values in found.values.items():
            cell = row[at[name]]
            own = float(cell) if cell else np.nan
            own = own if np.isfinite(own) else np.nan
            expect(
                np.array_equal(own, values.flat[k], equal_nan=True),
                f"a map has another {name} than its table",
            )
        expect(float(row[at["status"]]) == found.status.flat[k], "a map has another status")


def rows_of(number: int) -> pl.DataFrame:
    """Return what a chunk of a sweep gives."""
    return pl.DataFrame({"number": [number] * 4, "root": np.sqrt(number + np.arange(4.0))})


def checkpoints(work: Path) -> Kind:
    """Return folders of what a design's search keeps, and goes on with."""
    plan = {"robot": 'name = "a"\nlegs = [1, 2]', "spec": {"seed": 1}, "generation": 3}
    sweep(rows_of, range(3), TableStore(work / "table", plan))
    whole = TableStore(work / "table", plan).scan().collect()

    def read(folder: Path) -> str:
        store = TableStore(folder, plan)
        computed = sweep(rows_of, range(3), store)
        expect(store.scan().collect().equals(whole), "a changed checkpoint was read")
        return _AGAIN if computed else _AS_WRITTEN

    return Kind("checkpoint", 1200, damaged_copies(work / "table"), read)


def identifications(work: Path) -> Kind:
    """Return files of what was identified, as exported code takes it."""
    robot = pteron.load("five-bar")
    base = pteron.base_parameters(robot)
    drive = {"coulomb": 0.1, "viscous": 0.2, "offset": 0.0, "inertia": 1e-5, "stribeck": None}
    text = json.dumps(
        {
            "robot": robot.name,
            "base_parameters": {
                "names": base.names,
                "expressions": base.expressions(digits=12),
                "values": base.values().tolist(),
                "shared": [],
            },
            "drives": [drive, {**drive, "stribeck": {"force": 1.0, "speed": 0.02}}],
            "kinds": ["base"] * base.rank,
            "estimate": {"names": base.names},
            "expressions": base.expressions(),
            "verdict": {"grade": "trustworthy"},
        },
        indent=1,
    ).encode()

    def damage(place: Path, chance: Chance) -> Path:
        file = place / "identification.json"
        file.write_bytes(damaged_text(text, chance))
        return file

    def read(file: Path) -> str:
        found = read_identified(robot, file)
        expect(np.isfinite(found.values).all(), "an identified value is not finite")
        return _AS_IT_STANDS

    (work / "identification.json").write_bytes(text)
    read_identified(robot, work / "identification.json")
    return Kind("identification", 600, damage, read)


# The campaign.


def main() -> None:
    """Print how each kind of file fares; end with an error if one ends in a raw exception."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--quick", action="store_true")
    asked.add_argument("--count", type=int, help="mutants in all")
    asked.add_argument("--kind", default="", help="of the kinds whose names begin so")
    asked.add_argument("--seed", type=int, default=21)
    given = asked.parse_args()
    count = given.count or (300 if given.quick else 20_000)
    warnings.simplefilter("ignore", UnlikelyValue)  # damaged numbers are, and are read
    raw: list[str] = []
    total: Counter[str] = Counter()
    begin, longest = process_time(), 0.0
    print(f"{'':<16}{'mutants':>8}" + "".join(f"{name:>19}" for name in _OUTCOMES) + f"{'raw':>6}")
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        kinds = [robots(work), searches(work), logs(work), *maps(work), checkpoints(work)]
        kinds.append(identifications(work))
        least = getrusage(RUSAGE_SELF).ru_maxrss
        for k, kind in enumerate(kinds):
            if not kind.name.startswith(given.kind):
                continue
            own = max(1, round(count * kind.share / 20_000))
            found = Counter[str]()
            for number in range(own):
                started = process_time()
                found[outcome(kind, work, [given.seed, k, number], raw)] += 1
                seconds = process_time() - started
                longest = max(longest, seconds)
                if seconds > _SLOW and number:  # the first one loads what reads the others
                    raw.append(f"{kind.name}: {seconds:.1f} s, {[given.seed, k, number]}")
            total.update(found)
            line(kind.name, found)
    line("all", total)
    grown = (getrusage(RUSAGE_SELF).ru_maxrss - least) / 1024
    print(f"The slowest takes {longest:.2f} s; memory grows by at most {grown:.0f} MB.")
    if grown > _LARGE:
        raw.append(f"memory grows by {grown:.0f} MB")
    print(f"{process_time() - begin:.0f} s of this processor", file=sys.stderr)
    if raw:
        sys.exit("\n".join(f"{times} x {what}" for what, times in Counter(raw).most_common()))


def outcome(kind: Kind, work: Path, seed: list[int], raw: list[str]) -> str:
    """Return what becomes of one mutant."""
    place = Path(tempfile.mkdtemp(dir=work))
    try:
        file = kind.damage(place, np.random.default_rng(seed))
        return kind.read(file)
    except PteronError as error:
        told = str(error)
        if all(c.isprintable() or c == "\n" for c in told) and 0 < len(told) < _LONGEST:
            return _REFUSED
        raw.append(f"{kind.name}: a message of {len(told)} characters: {told[:200]!r}, {seed}")
    except (KeyboardInterrupt, SystemExit):
        raise
    except OSError as error:
        if error.filename:  # the command line says its name and the reason
            return _REFUSED
        raw.append(f"{kind.name}: {error!r}, {seed}")
    except BaseException as error:  # libraries' panics are no Exceptions
        frames = traceback.extract_tb(error.__traceback__)
        own = [f for f in frames if "/pteron/" in f.filename] or frames
        at = f"{Path(own[-1].filename).name}:{own[-1].lineno}"
        raw.append(f"{kind.name}: {type(error).__name__} at {at}: {str(error)[:120]!r}")
        if raw.count(raw[-1]) == 1:
            print(f"seed {seed}: {raw[-1]}", file=sys.stderr)
    finally:
        shutil.rmtree(place)
    return "raw"


def line(name: str, found: Counter[str]) -> None:
    """Print a line of the table."""
    counts = "".join(f"{found[outcome] or '':>19}" for outcome in _OUTCOMES)
    print(f"{name:<16}{found.total():>8}{counts}{found['raw']:>6}")


if __name__ == "__main__":
    main()
