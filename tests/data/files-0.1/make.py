"""Writes the files of this folder with version 0.1, and what they hold; run in a clone of it.

    PYTHONPATH=CLONE/src python tests/data/files-0.1/make.py

The files are kept as they are: what a later version must still read. No later one writes them anew.
"""

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import polars as pl
from typer.testing import CliRunner

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[1]))

import earlier_files as read  # noqa: E402
import exported_code  # noqa: E402

import pteron  # noqa: E402
from pteron.cli.main import app  # noqa: E402
from pteron.design import read_spec, search, survey  # noqa: E402
from pteron.maps import map_index, pose_grid, save_map  # noqa: E402

DRIVE = pteron.legs.Drive(
    coulomb=0.4,
    viscous=0.2,
    offset=0.05,
    rotor_inertia=2e-5,
    ratio=50.0,
    rest_speed=2e-3,
    stribeck=pteron.legs.Stribeck(0.3, 0.05),
    rated_torque=0.64,
    max_force=200.0,
    max_speed=20.0,
    counts_per_turn=4096.0,
)


def pteron_command(*words):
    done = CliRunner().invoke(app, [*map(str, words)], catch_exceptions=False)
    assert done.exit_code == 0, done.output


def with_legs(robot, **keys):
    return replace(robot, legs=tuple(replace(leg, drive=DRIVE, **keys) for leg in robot.legs))


def with_radii(robot):
    return replace(robot, radii=pteron.manipulator.Radii(0.012, 0.015, 0.008, 0.02))


def robots(folder):
    """Write machines of every kind of leg and platform, each optional key in one of them."""
    folder.mkdir(parents=True)
    plain = ("five-bar", "tripteron-oblique", "quadrupteron-oblique", "h4")
    machines = {name: pteron.load(name) for name in plain}
    machines["quadrupteron"] = with_radii(
        with_legs(pteron.load("quadrupteron"), elbow_limits=(0.1, 3.0))
    )
    leaning = pteron.legs.Cone((0.0, 0.0, 1.0), 1.5)
    delta = with_legs(pteron.load("delta"), bar_length=0.1)
    delta = replace(delta, platform=replace(delta.platform, tool=(0.01, 0.02, -0.1)))
    machines["delta"] = with_radii(delta)
    linear = pteron.load("linear-delta")
    machines["linear-delta"] = replace(
        linear,
        legs=tuple(replace(leg, platform_cone=leaning, drive=DRIVE) for leg in linear.legs),
    )
    par4 = with_legs(pteron.load("par4"))
    machines["par4"] = with_radii(par4)
    turning = pteron.load("delta-4")
    shaft = replace(turning.legs[3], travel=(0.1, 3.0), limits=(-3.0 * pi, 3.0 * pi), drive=DRIVE)
    machines["delta-4"] = replace(turning, legs=(*turning.legs[:3], shaft))
    machines["3-prr"] = with_legs(pteron.load("3-prr"), elbow_limits=(-1.5, 1.5))
    machines["3-rrr"] = with_legs(pteron.load("3-rrr"), elbow_limits=(0.05, 3.1))
    states = {}
    for name, robot in machines.items():
        pteron.save(robot, folder / f"{name}.toml")
        states[f"{name}.toml"] = state(robot)
    # As version 0.1 wrote it at first, and as a person writes it.
    text = (folder / "quadrupteron.toml").read_text("utf-8")
    assert "\nlimits" in text
    (folder / "slider-limits.toml").write_text(text.replace("\nlimits", "\nslider_limits"), "utf-8")
    states["slider-limits.toml"] = states["quadrupteron.toml"]
    mixed = HERE.parent / "mixed.toml"
    shutil.copy(mixed, folder)
    states["mixed.toml"] = state(pteron.load(mixed))
    pteron_command("new", "par4", "--out", folder / "new-par4.toml")
    states["new-par4.toml"] = states["par4.toml"]
    (folder / "states.json").write_text(json.dumps(states, indent=1) + "\n", "utf-8")


def state(robot):
    rng = np.random.default_rng(0)
    pose = pteron.random_poses(robot, 1, seed=rng, type_i=0.3, type_ii=0.15)[0]
    return [pose.tolist(), *rng.normal(size=(2, pose.size)).round(3).tolist()]


def logs(folder):
    """Write short logs as drives and programs write them, most with a description."""
    folder.mkdir()
    t = np.arange(60) / 100.0
    q = 0.05 * np.sin(np.arange(4.0) + np.outer(t, [9.0, 11.0, 13.0, 15.0]))
    f = 20.0 * np.cos(np.outer(t, [9.0, 11.0, 13.0, 15.0])) - 3.0

    def write(name, head, rows, description=None, encoding="utf-8", end="\n"):
        (folder / f"{name}.csv").write_bytes(end.join([*head, *rows, ""]).encode(encoding))
        if description is not None:
            (folder / f"{name}.toml").write_text(description, "utf-8")

    def rows(columns, separator=",", decimal="."):
        return [
            separator.join(f"{v:.6f}".replace(".", decimal) for v in row)
            for row in np.column_stack(columns)
        ]

    names = [f"{word}{k}" for word in ("rho", "force") for k in (1, 2, 3, 4)]
    write("quadrupteron.plain", [",".join(["t", *names])], rows([t, q, f]))
    write(
        "quadrupteron.scope",
        [
            "Name;Scope",
            "recorded;yesterday",
            ";".join(["Time [ms]", *(f"q{k}" for k in range(4)), *(f"i{k}" for k in range(4))]),
        ],
        rows([1e3 * t, 1e3 * q, f / 40.0], ";", ","),
        """[csv]
separator = ";"
decimal = ","
encoding = "latin-1"
header_lines = 3
[time]
column = "Time [ms]"
unit = "ms"
[joints]
columns = ["q0", "q1", "q2", "q3"]
unit = "mm"
[forces]
columns = ["i0", "i1", "i2", "i3"]
unit = "A"
gains = [41.0, 38.5, 38.5, 38.5]
limits = [-400.0, 400.0]
[motion]
period = 0.2
start = 0.02
end = 0.42
assembly_mode = 1
[drives]
rotor_inertia = [2e-5, 1e-5, 1e-5, 1e-5]
ratio = [628.3, 628.3, 628.3, 628.3]
""",
        encoding="latin-1",
        end="\r\n",
    )
    write(
        "quadrupteron.sliders",
        ["t s1 s2 s3 s4 F1 F2 F3 F4 x y z phi payload"],
        rows([t, 1e3 * q, f, 1e3 * q[:, :3], np.degrees(q[:, 3]), t >= 0.3], " "),
        """[sliders] # as version 0.1 called them at first
columns = ["s1", "s2", "s3", "s4"]
unit = "mm"
[forces]
columns = ["F1", "F2", "F3", "F4"]
unit = "N"
[pose]
columns = ["x", "y", "z", "phi"]
length_unit = "mm"
angle_unit = "deg"
[payload]
column = "payload"
mass = 1.5
center_of_mass = [0.0, 0.01]
inertia = 0.002
""",
    )
    stamps = [f"2026-11-22T13:04:05.{round(1e3 * at):03d}+01:00" for at in t]
    cells = rows([np.degrees(q[:, :3]), f[:, :3]], "\t")
    write(
        "delta.stamps",
        [
            "\t".join(
                ["Time", *(f"theta{k}" for k in (1, 2, 3)), *(f"torque{k}" for k in (1, 2, 3))]
            )
        ],
        [f"{stamp}\t{row}" for stamp, row in zip(stamps, cells, strict=True)],
        '[joints]\nunit = "deg"\n',
    )
    turns = [400.0 * q[:, :3], f[:, :3]]
    write(
        "delta.motors",
        ["t,theta1,theta2,theta3,torque1,torque2,torque3"],
        rows([t, *turns]),
        '[joints]\nunit = "turns"\n[forces]\nunit = "%"\n',
    )
    write(
        "delta.controller",
        [
            "|".join(
                [
                    "t_us",
                    *(f"Axis{k}.ActPos" for k in (1, 2, 3)),
                    *(f"Axis{k}.ActForce" for k in (1, 2, 3)),
                ]
            )
        ],
        rows([1e6 * t, q[:, :3], f[:, :3]], "|"),
        '[forces]\nunit = "N m"\n'
        'columns = ["Axis1.ActForce", "Axis2.ActForce", "Axis3.ActForce"]\n',
    )
    pl.DataFrame(np.column_stack([t, q, f]), schema=["t", *names]).write_parquet(
        folder / "quadrupteron.binary.parquet"
    )


def identifications(folder):
    """Identify a five-bar with friction, without and with rotors, and write an exciting motion."""
    folder.mkdir()
    work = folder / "work"
    work.mkdir()
    motion = work / "motion.csv"
    pteron_command(
        "excite", read.FIVE_BAR, "--out", motion, "--rate", 500, "--period", 3, "--periods", 2,
        "--speed", 15, "--acceleration", 300, "--seconds", 20, "--workers", 1,
    )  # fmt: skip
    recording = Path(pteron.__file__).parents[2] / "examples" / "recording.py"
    subprocess.run([sys.executable, recording, read.FIVE_BAR, motion, work / "log.csv"], check=True)
    shutil.copy(work / "motion.toml", work / "log.toml")
    for name, options in (("plain", ()), ("rotors", ("--rotors", "--stribeck", "0.5"))):
        out = folder / name
        pteron_command(
            "identify", work / "log.csv", "--robot", read.FIVE_BAR, "--out", out, *options
        )
        for path in out.iterdir():
            if path.suffix not in (".json", ".toml"):
                path.unlink()
        file = out / "identification.json"
        file.write_text(file.read_text("utf-8").replace(f"{work}/", ""), "utf-8")
    tables = HERE / "tables"
    tables.mkdir()
    pteron_command(
        "excite", read.FIVE_BAR, "--out", tables / "motion.csv", "--rate", 20, "--period", 2,
        "--periods", 1, "--speed", 5, "--acceleration", 50, "--seconds", 2, "--workers", 1,
    )  # fmt: skip
    for path in tables.glob("*held-out*"):
        path.unlink()
    shutil.rmtree(work)


def maps(folder):
    folder.mkdir()
    grid = pose_grid(read.FIVE_BAR, {}, {"x": (-0.1, 0.1, 7), "y": (0.08, 0.16, 5)})
    found = map_index(read.FIVE_BAR, ("condition", "margin"), grid)
    for ending in ("csv", "parquet", "npz", "zarr"):
        save_map(found, folder / f"map.{ending}")
    delta = read.ROBOTS / "delta.toml"
    map_index(delta, "condition", pose_grid(delta, points=9), out=folder / "surfaces.vtk")
    grid = pose_grid(read.FIVE_BAR, {}, {"x": (-0.1, 50.0, 515), "y": (0.1, 50.0, 257)})
    map_index(read.FIVE_BAR, "condition", grid, out=folder / "continued.zarr")
    for path in sorted((folder / "continued.zarr").rglob("c/1*")):
        shutil.rmtree(path) if path.is_dir() else path.unlink()


SPEC = """# A five-bar with shorter links.
robot = "../robots/five-bar.toml"
masses = "per length"

[[variables]]
name = "cranks"
moves = "legs.upper_length"
range = [0.05, 0.12]

[[variables]]
moves = "legs.lower_length"
range = [0.08, 0.2]
by = "value"

[[variables]]
name = "distance of the cranks"
moves = ["legs[1].guide_point.x", "-legs[2].guide_point.x"]
range = [-0.01, 0.01]
by = "offset"

[workspace]
low = [-0.02, 0.11]
high = [0.02, 0.13]

[floors]
type_i = 0.05
type_ii = 0.05

[motion]
speed = 1.0
acceleration = 10.0

[[objectives]]
minimise = "links"

[[objectives]]
minimise = "force"

[[requirements]]
quantity = "condition"
most = 20.0

[search]
population = 8
generations = 2
refined = 0
seed = 3
"""


def designs(folder):
    folder.mkdir()
    (folder / "five-bar.toml").write_text(SPEC, "utf-8")
    spec = read_spec(folder / "five-bar.toml")
    search(spec, folder=folder / "search")
    survey(spec, 256, folder / "survey")
    for last in (
        *folder.glob("search/0002/00000001-*"),
        *folder.glob("survey/proofs-*/00000002-*"),
    ):
        last.unlink()


def tables(folder):
    pteron_command(
        "cycle", read.FIVE_BAR, "--duration", 1, "--rate", 40, "--out", folder / "cycle.csv"
    )
    pteron_command(
        "cycle", read.FIVE_BAR, "--duration", 1, "--rate", 40, "--out", folder / "cycle.parquet"
    )
    pteron_command(
        "simulate", read.FIVE_BAR, "--duration", 2, "--rate", 100, "--step", 0.001,
        "--out", folder / "simulation.csv",
    )  # fmt: skip
    (folder / "poses.csv").write_text("x,y\n-0.02,0.12\n0.0,0.13\n0.02,0.12\n", "utf-8")
    (folder / "motors.csv").write_text(
        "name,rotor_inertia,rated_torque,peak_torque,max_speed\n"
        "small,1e-6,0.05,0.15,600\nlarge,2e-5,0.64,1.9,500\n",
        "utf-8",
    )
    (folder / "motors.toml").write_text(
        '[[motors]]\nname = "small"\nrotor_inertia = 1e-6\nrated_torque = 0.05\n'
        "peak_torque = 0.15\nmax_speed = 600.0\n",
        "utf-8",
    )


if __name__ == "__main__":
    for name in ("robots", "logs", "identified", "maps", "design", "tables"):
        shutil.rmtree(HERE / name, ignore_errors=True)
    robots(HERE / "robots")
    logs(HERE / "logs")
    identifications(HERE / "identified")
    maps(HERE / "maps")
    designs(HERE / "design")
    tables(HERE / "tables")
    exports = {}
    for name in pteron.catalog():
        given = state(pteron.load(name))
        exports[name] = {"state": given, **exported_code.exported(name, given)}
    for name, values in (("values", read.everything()), ("exported-c", exports)):
        (HERE / f"{name}.json").write_text(json.dumps(values, indent=0) + "\n", "utf-8")
