"""`pteron size` as a person and as a program meet it."""

import json
import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from commands import done, read, refused, run
from mechanisms import CLIENTS

import pteron
from pteron.motion import Motor, choose, choose_common, pick_and_place, size, with_payload
from pteron.workspace import home_pose

MOTORS = (
    "name,rotor_inertia,rated_torque,peak_torque,max_speed\n"
    "100 W,4e-6,0.32,0.95,600\n400 W,2.6e-5,1.27,3.8,600\n"
)


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def driven() -> str:
    robot = pteron.load("five-bar")
    drive = pteron.legs.Drive(
        *(0.1, 0.01, 0.0, 3e-5, 20.0), rated_torque=0.64, max_force=30.0, max_speed=40.0
    )
    legs = tuple(replace(leg, drive=drive) for leg in robot.legs)
    pteron.save(replace(robot, legs=legs), "driven.toml")
    return "driven.toml"


@lru_cache
def home(robot: pteron.Manipulator) -> np.ndarray:
    return home_pose(robot)


def cycle_table(robot: pteron.Manipulator, **columns: float) -> pl.DataFrame:
    """Return a cycle as a table; `columns` are factors of some."""
    cycle = pick_and_place(robot, home(robot), scale=0.2, samples=51)
    names = [f"{rate}{name}" for rate in ("", "d", "dd") for name in robot.coordinates]
    values = np.hstack([cycle.pose, cycle.velocity, cycle.acceleration])
    found = {"t": cycle.time} | dict(zip(names, values.T, strict=True))
    return pl.DataFrame({name: columns.get(name, 1.0) * value for name, value in found.items()})


def rows_of(line: str) -> pl.DataFrame:
    """Return the table that a command writes."""
    done(f"{line} --out rows.csv")
    return pl.read_csv("rows.csv")


@CLIENTS
def test_a_program_gets_all_numbers_and_a_pipe_what_a_person_sees(driven: str):
    rows = rows_of(f"size {driven}")
    data = json.loads(done(f"size {driven} --json"))
    assert rows.to_dicts() == [pytest.approx(row) for row in data["drives"]]
    assert rows["leg"].to_list() == [1, 2]
    assert data["overloads"] == data["motors"] == []
    assert data["assumed_friction"] == [0.0, 0.0]
    assert data["all"]["energy"] <= (rows["given_energy"] - rows["braked_energy"]).sum()
    assert data["all"]["peak_power"] <= rows["peak_power"].sum()
    assert len(data["worst"]) == 6
    least = min(data["margins"], key=lambda one: one["margin"])
    text = done(f"size {driven}")
    enough = f"Enough: the drives in the file have {least['margin']:.3g} times what the cycle needs"
    assert f"{enough} (1 required)" in text
    assert read(f"size {driven}").split() == text.split()


@CLIENTS
def test_payload_dwell_and_duration_count(driven: str):
    asked = "--payload 0.4 --dwell 0.2 --duration 0.5"
    data = json.loads(done(f"size {driven} {asked} --within here --json"))
    robot = pteron.load(driven)
    cycle = pick_and_place(robot, home(robot), duration=0.5, samples=481)
    found = size(with_payload(robot, 0.4), cycle, dwell=0.2)
    assert data["duration"] == pytest.approx(0.7)
    assert [row["rms_force"] for row in data["drives"]] == pytest.approx(found.rms_forces, 1e-3)
    assert "orientations of the cycle in the workspace" in done(f"size {driven} {asked}")


def test_friction_is_assumed_and_said_and_its_absence_too():
    line = "size five-bar --within here"
    text = done(f"{line} --friction 0.1")
    assert "dry friction of 10 % of the drive's peak is assumed, leg by leg: 0.0111 N m, 0." in text
    free = done(line)
    assert "All drives together: net energy 0 J per cycle (" in free
    assert "J supplied and braked: there is no friction)" in free
    assert "assumed" not in free
    # All commands say the same, and have the same peaks.
    assert "No friction is included: the file has none." in free
    cycle = json.loads(done_with_notes("cycle five-bar --json"))
    assert cycle["friction"] in free
    sized = json.loads(done(f"{line} --json"))["drives"]
    peaks = [peak["size"] for peak in cycle["peaks"] if peak["unit"] == "N m"]
    assert peaks == pytest.approx([drive["peak_force"] for drive in sized], rel=2e-3)


def done_with_notes(line: str) -> str:
    """Return the standard output of a command line that succeeds, with notes or without."""
    result = run(line)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_torque_and_speed_are_told_at_the_motor_with_the_screws_losses(tmp_path):
    screw = pteron.legs.Screw(0.005, 0.016, 0.6, efficiency=0.9)
    ratio = 2 * math.pi / 0.005
    drive = pteron.legs.Drive(rotor_inertia=1e-4, ratio=ratio, screw=screw, rated_torque=0.5)
    robot = pteron.load("tripteron")
    robot = replace(robot, legs=tuple(replace(leg, drive=drive) for leg in robot.legs))
    path = pteron.save(robot, tmp_path / "screws.toml")
    assert pteron.load(path) == robot
    # A rod of steel: own formula of its mass and radius.
    mass = 7850.0 * math.pi * 0.008**2 * 0.6
    assert screw.inertia == pytest.approx(mass * 0.008**2 / 2.0, rel=1e-12)
    assert drive.inertia == pytest.approx(ratio**2 * (1e-4 + screw.inertia), rel=1e-12)
    # Makers' catalogues allow f d / L^2 10^7 rpm, f = 15.1 (fixed, supported), d and L in mm.
    turns = 0.8 * screw.critical_speed / 0.005
    assert turns * 60.0 == pytest.approx(15.1e7 * 16.0 / 600.0**2, rel=2e-3)
    motion = pick_and_place(robot, duration=0.6)
    found = size(robot, motion)
    time = np.linspace(0.0, 0.6, 4001)
    state = motion.at(time)
    rates = pteron.kinematics.joint_rates(robot, *state[:2]).actuated
    gains = pteron.kinematics.joint_accelerations(robot, *state).actuated
    load = pteron.inverse_dynamics(robot, *state)
    way = np.sign(load * rates)
    torque = load / ratio * np.where(way > 0, 1 / 0.9, np.where(way < 0, 0.9, 1.0))
    torque += drive.inertia / ratio * gains
    rms, peak = found.motor_torques
    assert peak == pytest.approx(np.abs(torque).max(axis=0), rel=2e-3)
    assert rms == pytest.approx(np.sqrt((torque**2).mean(axis=0)), rel=5e-3)
    assert found.motor_speeds[1] == pytest.approx(ratio * np.abs(rates).max(axis=0), rel=1e-3)
    assert found.power.max() > (found.forces * found.speeds).max()
    limits = {margin.limit for margin in found.margins}
    assert "80% of the screw's critical speed" in limits
    text = run(f"size {path} --within here").stdout
    assert "At the motors, screws with an efficiency of 0.9." in text
    assert " rpm " in text


def test_motors_of_unknown_ratio_are_said_to_be_unknown():
    assert "the drives have no ratio, which is 2 pi / lead" in " ".join(
        done("size stewart --within here").split()
    )


def test_a_margin_that_is_asked_for_and_missed_is_not_enough(driven: str):
    Path("motors.csv").write_text(MOTORS, encoding="utf-8")
    line = f"size {driven} --within here --motors motors.csv"
    data = json.loads(done(f"{line} --json"))
    margin = min(one["margin"] for one in data["margins"])
    best = max(min(m["rated_margin"], m["peak_margin"]) for m in data["motors"])
    result = run(f"{line} --margin {3.0 * max(margin, best):.6g}")
    assert result.exit_code == 1
    for words in ("leg 1: not enough: max_force of the file: ", "--margin requires "):
        assert words in result.stderr
    assert "Not enough: the drives in the file have " in result.stdout
    assert "leg 1: not enough: no motor of the list is strong enough; " in result.stderr
    assert "Not enough: the first motor listed" in result.stdout


def test_what_the_drives_cannot_do_is_told_and_ends_with_1(driven: str):
    result = run(f"size {driven} --payload 50 --duration 0.3")
    assert result.exit_code == 1
    assert "Warning: leg 1: the motion takes up to " in result.stderr
    assert "but its drive gives 30 N m (max_force)" in result.stderr
    assert "but the motor gives 12.8 N m continuously (rated_torque and ratio)" in result.stderr
    assert "N m about [" in result.stderr
    assert "Not enough: the drives in the file have 0." in result.stdout


@CLIENTS
def test_motors_of_a_list_are_fitted_to_each_joint(driven: str):
    Path("motors.csv").write_text(MOTORS, encoding="utf-8")
    done(f"size {driven} --motors motors.csv --out made")
    rows = pl.read_csv("made/motors.csv")
    assert rows["motor"].to_list() == ["100 W", "400 W"] * 2
    assert rows["serves"].all()
    assert (
        (rows["least_ratio"] <= rows["ratio"]) & (rows["ratio"] <= rows["greatest_ratio"])
    ).all()
    result = run(f"size {driven} --motors motors.csv --payload 500 --duration 0.2")
    assert result.exit_code == 1
    assert (
        "leg 1: not enough: no motor of the list is strong enough; the nearest, 400 W, has 0."
        in result.stderr
    )
    assert "is it in grams?" in result.stderr


@CLIENTS
def test_a_folder_gets_tables_numbers_and_pictures(driven: str):
    Path("motors.csv").write_text(MOTORS, encoding="utf-8")
    result = run(f"size {driven} --motors motors.csv --out made/sizing")
    assert result.exit_code == 0
    names = {path.name for path in Path("made/sizing").iterdir()}
    assert names == {
        *("sizing.csv", "sizing.json", "motors.csv", "power.svg", "force-speed.svg"),
    }
    assert all(f"Written: made/sizing/{name}\n" in result.stdout for name in names)
    data = json.loads(Path("made/sizing/sizing.json").read_text(encoding="utf-8"))
    assert data["drives"] == pl.read_csv("made/sizing/sizing.csv").to_dicts()
    assert len(data["motors"]) == len(pl.read_csv("made/sizing/motors.csv")) == 4


@CLIENTS
def test_one_table_may_be_written(driven: str):
    assert run(f"size {driven} --out sizing.parquet").exit_code == 0
    assert pl.read_parquet("sizing.parquet")["leg"].to_list() == [1, 2]


@CLIENTS
def test_a_person_sees_tables_within_80_columns(driven: str):
    Path("motors.csv").write_text(MOTORS, encoding="utf-8")
    text = read(f"size {driven} --motors motors.csv --payload 0.2", COLUMNS="80")
    assert max(map(len, text.splitlines())) <= 80
    for words in ("with 0.2 kg", "RMS torque", "energy", "braked", "J per cycle", "400 W"):
        assert words in text
    # A table that is too wide breaks its headings; no cell loses its unit.
    rotors = text[text.index("load/rotor") :].splitlines()
    assert rotors[2].split()[0] == "1"
    assert rotors[2].split()[-2:] == ["N", "m"]
    assert "…" not in text


def test_legs_that_are_alike_get_one_motor_and_one_ratio():
    robot = pteron.load("delta")
    # The legs are asked for different loads: the way is not symmetric.
    way = pick_and_place(robot, home(robot) + np.array([0.05, 0.1, 0.0]), scale=0.5, samples=51)
    found = size(robot, way)
    # A motor that is large for the load, so that no limit binds the ratio.
    motor = Motor("one", 4e-5, 100.0, 300.0, 1e5)
    own = [fit.ratio for fit in choose(found, [motor])]
    (common,) = choose_common(found, [motor])
    assert common.legs == (1, 2, 3)
    assert min(own) < common.ratio < max(own)
    assert len(set(np.round(own, 6))) > 1

    def largest(ratio):
        loads = found.loads / ratio + motor.rotor_inertia * ratio * found.accelerations
        return np.sqrt(found.mean(loads**2)).max()

    tried = np.linspace(min(own), max(own), 201)
    assert largest(common.ratio) <= min(map(largest, tried)) * (1 + 1e-9)
    assert common.worst.margin == min(fit.margin for fit in common.fits)
    assert {fit.ratio for fit in common.fits} == {common.ratio}
    with pytest.raises(pteron.DataError, match=r"margin: 0\.5 given"):
        choose_common(found, [motor], margin=0.5)


def test_the_common_motor_is_told_and_torques_are_called_so(driven: str):
    Path("motors.csv").write_text(MOTORS, encoding="utf-8")
    line = f"size {driven} --within here --motors motors.csv"
    first, second = json.loads(done(f"{line} --json"))["common_motors"]
    assert (first["legs"], first["motor"], second["motor"]) == ([1, 2], "100 W", "400 W")
    assert first["least_ratio"] <= first["ratio"] <= first["greatest_ratio"]
    text = done(line)
    assert "One motor and one ratio for equal legs" in text
    assert "peak torque  RMS torque" in text
    assert "force (" not in run(f"cycle {driven}").stdout
    assert "torque (N m)" in run(f"cycle {driven}").stdout
    assert "peak force  RMS force" in done("size tripteron --within here")


def test_a_motion_of_a_table_is_sized_as_it_is():
    robot = pteron.load("delta")
    cycle_table(robot).write_csv("motion.csv")
    rows = rows_of("size delta --cycle motion.csv --friction 0")
    cycle = pick_and_place(robot, home(robot), scale=0.2, samples=51)
    assert rows["rms_force"].to_list() == pytest.approx(size(robot, cycle).rms_forces, rel=1e-9)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("size delta --payload -1", ["payload: -1.0 given", "0 kg or more"]),
        ("size delta --dwell -1", ["dwell: -1.0 given"]),
        ("size delta --duration 0", ["duration: 0.0 given", "above 0"]),
        ("size delta --within here --margin 0.5", ["margin: 0.5 given", "1 or more"]),
        ("size delta --motors nothing.csv", ["nothing.csv: no such file"]),
        ("size delta --cycle adpt", ["adpt"]),
        ("size delta --cycle motion.csv --duration 1", ["--duration is for --cycle adept"]),
        ("size delta --out nowhere/there.csv", ["no folder nowhere"]),
        ("size delta --out motors.csv/there", ["motors.csv", "is a file"]),
        ("size no-such-robot", ["no-such-robot"]),
        ("size delta --friction -1", ["friction: -1.0 given"]),
        ("size delta --dwell 1 --dwell 2", ["dwell: 2 rests given, and 1 motions"]),
        (
            "size delta --within x=0:0.02,y=0:0.02",
            ["the cycle fits nowhere", "region [0.02, 0.02, "],
        ),
        ("size delta --within q=1", ["q: is no coordinate of delta"]),
        ("size delta --within x=0:1:5", ["--within: NAME=LEAST:GREATEST expected"]),
    ],
)
def test_a_mistake_is_one_line(line: str, words: list[str]):
    Path("motors.csv").write_text(MOTORS, encoding="utf-8")
    refused(line, *words)


@pytest.mark.parametrize(
    ("factors", "words"),
    [
        (
            {f"{d}{x}": 1e3 for d in ("", "d", "dd") for x in "xyz"},
            ["at 0 s", "is it in millimetres?"],
        ),
        ({"t": -1.0}, ["motion.csv: row 2", "times must ascend"]),
        ({"z": np.nan}, ["motion.csv: row 1", "column z"]),
        ({"t": 1e3}, ["motion.csv: its poses go", "t must be in s"]),
        ({"x": 30.0}, ["motion.csv: its poses go"]),
    ],
)
def test_a_table_that_is_no_motion_is_one_line(factors: dict[str, float], words: list[str]):
    cycle_table(pteron.load("delta"), **factors).write_csv("motion.csv")
    refused("size delta --cycle motion.csv", *words)


def test_a_table_of_the_joints_alone_is_sized_in_the_home_poses_mode():
    robot = pteron.load("delta")
    cycle = pick_and_place(robot, home(robot), scale=0.2, samples=301)
    joints = pteron.inverse_kinematics(robot, cycle.pose)
    columns = {"t": cycle.time} | dict(zip(robot.joint_names, joints.T, strict=True))
    pl.DataFrame(columns).write_csv("motion.csv")
    rows = rows_of("size delta --cycle motion.csv --friction 0")
    assert rows["rms_force"].to_list() == pytest.approx(size(robot, cycle).rms_forces, rel=1e-2)


def with_drives(**keys: float) -> str:
    """Write a Delta whose drives have these keys."""
    robot = pteron.load("delta")
    legs = tuple(replace(leg, drive=pteron.legs.Drive(**keys)) for leg in robot.legs)
    pteron.save(replace(robot, legs=legs), "slow.toml")
    return "slow.toml"


def test_a_standard_cycle_too_fast_for_the_drives_is_named_first_with_a_slower_one():
    file = with_drives(max_speed=0.05, ratio=100.0)
    second = run(f"size {file}").stdout.splitlines()[1]
    assert second.startswith("The standard cycle is too fast for these drives: it takes leg")
    assert "times max_speed, 0.05 rad/s" in second
    duration = second.partition("--duration ")[2].partition(",")[0]
    assert "too fast" not in run(f"size {file} --duration {duration}").stdout
    # What is asked for is no more than what it takes.
    lines = run(f"size {file} --duration {0.9 * float(duration):g}")
    assert "max_speed" in lines.stderr


def test_motors_that_would_turn_absurdly_fast_without_a_limit_are_doubted():
    lines = done(f"size {with_drives(ratio=1000.0)}").splitlines()
    assert "motors would turn at" in lines[1]
    assert "no max_speed" in lines[1]
    assert "--duration" in lines[1]
    assert "too fast" not in done(f"size {with_drives(ratio=50.0)}")
