"""Machines moved by LinuxCNC with simulated joints, beside the library: joints and positions.

    python benchmarks/linuxcnc_moves.py pentapteron 5-rpur hexapteron

Files of `pteron export --linuxcnc` are built by halcompile and run by LinuxCNC 2.9, whose Python
module is that of the same package; the user needs leave to install a component.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from measuring import Array, quick

import pteron
from pteron.export import export_linuxcnc
from pteron.workspace import home_pose, pose_margins

SETTINGS = """
[EMC]
VERSION = 1.1
[DISPLAY]
DISPLAY = ./mover.py
[TASK]
TASK = milltask
CYCLE_TIME = 0.001
[RS274NGC]
PARAMETER_FILE = parameters.var
[EMCMOT]
EMCMOT = motmod
COMM_TIMEOUT = 1.0
SERVO_PERIOD = 1000000
[EMCIO]
EMCIO = io
CYCLE_TIME = 0.1
TOOL_TABLE = tools.tbl
[HAL]
HALFILE = {hal}
HALFILE = loops.hal
"""
"""What a configuration has beside the exported lines."""

LOOPS = """
net stop iocontrol.0.user-enable-out => iocontrol.0.emc-enable-in
net prepare iocontrol.0.tool-prepare => iocontrol.0.tool-prepared
net change iocontrol.0.tool-change => iocontrol.0.tool-changed
"""

VALUES = {
    "MAX_LINEAR_VELOCITY": 300,
    "MAX_VELOCITY": 300,
    "MAX_ACCELERATION": 3000,
    "HOME_SEARCH_VEL": 0,
    "HOME_SEQUENCE": 0,
}
"""Numbers that the user of the exported lines gives, mm or degrees."""

MOVER = """#!/usr/bin/python3
import json, time, linuxcnc

command, status, errors = linuxcnc.command(), linuxcnc.stat(), linuxcnc.error_channel()
moves = json.load(open("moves.json"))

def wait(holds, seconds=30):
    end = time.monotonic() + seconds
    while True:
        status.poll()
        message = errors.poll()
        assert message is None, message
        if holds():
            return
        assert time.monotonic() < end, "no answer"
        time.sleep(0.001)

command.state(linuxcnc.STATE_ESTOP_RESET)
wait(lambda: status.task_state == linuxcnc.STATE_ESTOP_RESET)
command.state(linuxcnc.STATE_ON)
wait(lambda: status.task_state == linuxcnc.STATE_ON)
command.mode(linuxcnc.MODE_MANUAL)
command.wait_complete()
command.teleop_enable(0)
command.wait_complete()
command.home(-1)
wait(lambda: all(status.homed[:status.joints]))
command.mode(linuxcnc.MODE_MDI)
command.wait_complete()
moving, ends = [], []

def sample():
    moving.append([status.joint_actual_position[:status.joints], status.actual_position[:6]])
    return status.interp_state == linuxcnc.INTERP_IDLE and status.inpos and status.queue == 0

for move in moves:
    command.mdi(move)
    time.sleep(0.01)
    wait(sample)
    time.sleep(0.1)
    status.poll()
    ends.append([status.joint_position[:status.joints], status.position[:6]])
json.dump([moving, ends], open("samples.json", "w"))
"""
"""The program that LinuxCNC starts as its screen, and with which it ends."""

PLACES = 12
"""Places to which a machine is moved by MDI commands, one after the other."""

CONSISTENT = 1e-9
"""Difference, m or rad, above which joints and position are of different cycles, 1 ms apart."""

SHARE = 0.3
"""Least margin of the places, as a share of that of the home pose."""


def main() -> None:
    """Move each machine named on the command line, and print the largest differences."""
    names = [word for word in sys.argv[1:] if not word.startswith("-")]
    if not names or shutil.which("halcompile") is None:
        print("linuxcnc: left out; name machines, and install LinuxCNC 2.9 with halcompile")
        return
    for name in names:
        with TemporaryDirectory() as folder:
            move(pteron.load(name), Path(folder))


def move(robot: pteron.Manipulator, folder: Path) -> None:
    """Build, home and move a machine, and print how far joints and poses are off."""
    component, settings, hal, *_ = export_linuxcnc(robot, folder)
    subprocess.run(["halcompile", "--install", component], check=True, capture_output=True)
    text = settings.read_text()
    (letters,) = re.findall(r"COORDINATES = (\w+)", text)
    scales = np.where(robot.platform.angular, np.pi / 180.0, 1e-3)
    places = places_of(robot)
    moves = [
        "G1 F6000 " + " ".join(f"{a}{v:.9f}" for a, v in zip(letters, place, strict=True))
        for place in places / scales
    ]
    (folder / "moves.json").write_text(json.dumps(moves))
    (folder / "loops.hal").write_text(LOOPS)
    (folder / "tools.tbl").write_text("")
    (folder / "mover.py").write_text(MOVER)
    (folder / "mover.py").chmod(0o755)
    settings.write_text(completed(text) + SETTINGS.format(hal=hal.name))
    run = subprocess.run(["linuxcnc", settings], cwd=folder, capture_output=True, timeout=300)
    if not (folder / "samples.json").exists():
        output = (run.stdout + run.stderr).decode()
        raise SystemExit(f"{robot.name}: not moved; see ~/linuxcnc_debug.txt\n{output}")
    axes = ["XYZABC".index(letter) for letter in letters]
    units = np.where([leg.joint.unit == "rad" for leg in robot.legs], np.pi / 180.0, 1e-3)
    moving, ends = (
        [np.array(rows) for rows in zip(*part, strict=True)]
        for part in json.loads((folder / "samples.json").read_text())
    )
    joints, poses = ends[0] * units, ends[1][:, axes] * scales
    off = np.abs(joints - pteron.inverse_kinematics(robot, places)).max()
    feedback, measured = moving[0] * units, moving[1][:, axes] * scales
    away = np.abs(pteron.follow(robot, feedback, measured[0]) - measured).max(axis=-1)
    consistent = away <= CONSISTENT
    print(
        f"{robot.name}, {len(moves)} moves of {len(letters)} axes by {robot.joint_count} joints\n"
        f"  at their ends: joints off by {off:.0e}, "
        f"positions by {np.abs(poses - places).max():.0e}\n"
        f"  along them: {consistent.sum()} positions off by {away[consistent].max():.0e}; "
        f"{(~consistent).sum()} read between two cycles"
    )


def places_of(robot: pteron.Manipulator) -> Array:
    """Return poses (K, m) about home, m and rad, that are away from limits and singularities."""
    home, rng = home_pose(robot), np.random.default_rng(0)
    size = np.where(robot.platform.angular, 0.2, 0.05)
    poses = home + size * rng.uniform(-1.0, 1.0, (200, robot.freedom))
    least = SHARE * pose_margins(robot, home).least
    return poses[pose_margins(robot, poses).least > least][: 3 if quick() else PLACES]


def completed(text: str) -> str:
    """Return exported INI lines with the numbers that their user is to give."""
    text = re.sub(r"#(M\w+_LIMIT) =", lambda m: f"{m[1]} = {'-' * ('MIN' in m[1])}10000", text)
    for key, value in VALUES.items():
        text = text.replace(f"#{key} =", f"{key} = {value}")
    # Joints that are at home when LinuxCNC starts.
    homes = iter(re.findall(r"(?m)^HOME = (\S+)$", text))
    return re.sub("#HOME_OFFSET =", lambda _: f"HOME_OFFSET = {next(homes)}", text)


if __name__ == "__main__":
    main()
