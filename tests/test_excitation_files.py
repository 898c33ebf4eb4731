"""What a machine is given to run: from rest to rest within the limits, in its units, and read back.

The limits are looked at with the public functions, at ten times the samples of a file.
"""

from __future__ import annotations

import tomllib
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from logs_of_motions import machine
from mechanisms import CATALOG, CLIENTS, gated
from typer.testing import CliRunner

import pteron
from pteron.cli.main import app
from pteron.identification import identify, identify_payload
from pteron.identification.excitation import (
    FourierMotion,
    LedMotion,
    Limits,
    MotionLayout,
    found_lead,
    held_out_cycle,
    optimal_excitation,
    random_excitation,
)
from pteron.identification.logs import Description, Log, read_log
from pteron.identification.recordings import periodic_part
from pteron.workspace import home_pose, pose_margins

RATE = 200.0
PLAIN = {"COLUMNS": "100", "NO_COLOR": "1", "FORCE_COLOR": None, "TTY_COMPATIBLE": None}
MACHINES = ["quadrupteron-oblique", "delta", "par4", "five-bar"]
each_machine = pytest.mark.parametrize("name", MACHINES)


@lru_cache
def driven(name: str) -> pteron.Manipulator:
    """Return a machine whose drives have friction and rotors, and little more force than it takes.

    A quarter more than at rest in the home pose, so that the force binds. Machines that turn have
    rotors and Stribeck friction too; logs of the others are explained by the plain model.
    """
    robot = machine(name)
    more = {}
    if robot.platform.turns:
        more = {"rotor_inertia": 1e-5, "ratio": 50.0, "stribeck": pteron.legs.Stribeck(0.5, 0.02)}
    home, n = home_pose(robot), robot.freedom
    held = np.abs(pteron.inverse_dynamics(robot, home, np.zeros(n), np.zeros(n)))
    drives = [
        pteron.legs.Drive(
            coulomb=0.02 * held.max() + 0.05 * k,
            viscous=0.05 * held.max(),
            offset=0.01 * held.max(),
            max_force=1.25 * held[k] + 0.25 * held.max() + 0.5,
            max_speed=0.8 + 0.1 * k,
            **more,
        )
        for k in range(n)
    ]
    legs = zip(robot.legs, drives, strict=True)
    return replace(robot, legs=tuple(replace(leg, drive=drive) for leg, drive in legs))


@lru_cache
def excited(name: str, limits: Limits | None = None):
    """Return a search small enough for a test."""
    return optimal_excitation(
        driven(name),
        harmonics=2,
        period=2.0,
        limits=limits,
        starts=1,
        draws=3,
        seconds=2.0,
        workers=1,
    )


@lru_cache
def drawn(name: str) -> FourierMotion:
    return random_excitation(machine(name), harmonics=2, period=2.0, seed=3)


def left_of(robot, limits: Limits, movement, rate: float) -> dict[str, float]:
    """Return the least margins of a movement, over the sizes of the limits, by public functions."""
    times = np.arange(0.0, movement.duration, 1.0 / rate)
    pose, velocity, acceleration, *_ = movement.states(times)
    rates = pteron.kinematics.joint_rates(robot, pose, velocity).actuated
    second = pteron.kinematics.joint_accelerations(robot, pose, velocity, acceleration).actuated
    forces = pteron.drive_forces(robot, pose, velocity, acceleration)
    room = pose_margins(robot, pose)
    joints = pteron.inverse_kinematics(robot, pose)
    found = {
        "type_i": room.type_i.min() - limits.type_i,
        "type_ii": room.type_ii.min() - limits.type_ii,
        "speed": (1.0 - np.abs(rates) / limits.speed).min(),
        "acceleration": (1.0 - np.abs(second) / limits.acceleration).min(),
        "force": (1.0 - np.abs(forces) / limits.force).min(),
    }
    for k, leg in enumerate(robot.legs):
        if leg.limits is not None:
            low, high = leg.limits
            inside = min(joints[:, k].min() - low, high - joints[:, k].max())
            found[f"joint {k}"] = inside - limits.joint_clearance
    return {key: float(value) for key, value in found.items()}


# From rest to rest


@pytest.mark.parametrize("name", gated(MACHINES, ["five-bar"]))
def test_every_limit_holds_from_rest_to_rest_between_the_samples_too(name: str):
    robot, found = driven(name), excited(name)
    assert found.limits == Limits.of(robot)
    periodic = left_of(robot, found.limits, found.motion, 10.0 * RATE)
    assert min(periodic["force"], periodic["speed"]) < 0.15  # a limit of the drives binds
    for movement in (found.with_leads(1), found.held_out(RATE)):
        left = left_of(robot, found.limits, movement, 10.0 * RATE)
        assert min(left.values()) >= 0.0, left
        assert movement.margins(found.limits, RATE).kept


@each_machine
def test_it_begins_and_ends_at_rest_in_one_pose(name: str):
    motion = drawn(name)
    led = LedMotion(motion, found_lead(motion, Limits()), periods=2)
    before, first, last, after = (
        [value[0] for value in led.states(np.array([time]))]
        for time in (-1.0, 0.0, led.duration, led.duration + 1.0)
    )
    still = np.zeros(motion.robot.freedom)
    for state in (before, first, last, after):
        assert state[0] == pytest.approx(first[0], abs=1e-9)
        for rate in (state[1], state[2], state[4], state[5]):
            assert rate == pytest.approx(still, abs=1e-9)
    assert led.end - led.start == 2.0 * motion.period
    times = np.linspace(led.start, led.end, 50)
    phase = led.lead.phase + times - led.start
    assert led.states(times).pose == pytest.approx(motion.states(phase).pose, abs=1e-9)


@pytest.mark.parametrize("space", ["platform", "joints"])
def test_leads_join_without_a_jump_and_derivatives_are_those_of_differences(space: str):
    motion = random_excitation(machine("quadrupteron-oblique"), space=space, harmonics=3, seed=2)
    led = LedMotion(motion, found_lead(motion, Limits()))
    step = 1e-4
    joins = [0.0, led.start, led.end, led.duration]
    times = np.sort(np.r_[joins, np.linspace(0.3, led.duration - 0.3, 40)])
    before, now, after = (led.states(times + k * step) for k in (-1, 0, 1))
    for value, rate in (("pose", "velocity"), ("velocity", "acceleration"), ("joints", "rates")):
        found = (getattr(after, value) - getattr(before, value)) / (2.0 * step)
        assert found == pytest.approx(getattr(now, rate), abs=2e-5)
    # The jerk has no jump either.
    jerks = (after.acceleration - now.acceleration, now.acceleration - before.acceleration)
    assert jerks[0] / step == pytest.approx(jerks[1] / step, rel=1e-2, abs=0.1)


def test_a_motion_beyond_its_limits_has_no_lead():
    robot = CATALOG["tripteron"]
    circle = FourierMotion(
        robot, "joints", 2.0, pteron.inverse_kinematics(robot, np.zeros(3)), *circle_of(0.02)
    )
    most = 0.02 * np.pi**2
    assert found_lead(circle, Limits(acceleration=1.5 * most)).duration == 2.0
    with pytest.raises(pteron.ModelError, match="no lead-in of up to 8 periods"):
        found_lead(circle, Limits(acceleration=0.9 * most))


def circle_of(radius: float) -> np.ndarray:
    """Return cosines and sines of a circle in two of three coordinates."""
    return radius * np.array([[[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]])


@pytest.mark.parametrize("name", gated(["tripteron", "par4"], ["tripteron"]))
def test_the_held_out_cycle_moves_every_joint_and_repeats_from_rest(name: str):
    robot = machine(name)
    cycles = held_out_cycle(robot, rate=RATE)
    assert cycles.duration >= 10.0
    assert cycles.count >= 4
    assert cycles.length * RATE == pytest.approx(round(cycles.length * RATE))
    state = cycles.states(np.arange(cycles.count + 1) * cycles.length)
    assert state.velocity == pytest.approx(0.0 * state.velocity, abs=1e-9)
    assert state.acceleration == pytest.approx(0.0 * state.acceleration, abs=1e-7)
    joints = cycles.states(np.linspace(0.0, cycles.length, 200)).joints
    assert (np.ptp(joints, axis=0) > 0.01).all()
    slow = held_out_cycle(robot, Limits(speed=0.1), RATE)
    assert slow.length > 2.0 * cycles.length
    assert slow.margins(Limits(speed=0.1), RATE)["speed"].least >= 0.0


def test_limits_come_from_the_drives_where_they_are_known():
    robot = driven("delta")
    limits = Limits.of(robot, acceleration=3.0)
    assert limits.speed == tuple(leg.drive.max_speed for leg in robot.legs)
    assert limits.force == tuple(leg.drive.max_force for leg in robot.legs)
    assert Limits.of(robot, speed=0.2, force=5.0) == Limits(speed=0.2, force=5.0)
    first = replace(robot.legs[0], drive=pteron.legs.Drive(max_force=80.0))
    others = [replace(leg, drive=None) for leg in robot.legs[1:]]
    partly = Limits.of(replace(robot, legs=(first, *others)))
    assert (partly.speed, partly.force) == (1.0, (80.0, np.inf, np.inf))
    motion = random_excitation(replace(robot, legs=(first, *others)), harmonics=2, period=2.0)
    assert held_out_cycle(motion.robot, partly).margins(partly)["force"].leg == 1


# Files, and the logs of what they hold


def written_log(
    folder: Path, movement, layout: MotionLayout, stem: str, *, delay: float = 0.0
) -> Path:
    """Write the log that a machine makes of a movement, beside the description of its motion.

    It has the layout of the motion's file and torques or forces behind; its clock begins at 1000 s,
    and the machine sets off `delay` (s) later.
    """
    robot = movement.robot
    times = np.arange(-delay, movement.duration + 0.5, 1.0 / RATE)
    shifted = Later(movement, delay)
    frame = replace(layout, contents="joints").frame(shifted, RATE)[: len(times)]
    state = shifted.states(np.arange(len(frame)) / RATE)
    forces = pteron.drive_forces(robot, *state[:3])
    unit = frame["t"][1] * RATE
    frame = frame.with_columns(
        t=frame["t"] + 1000.0 * unit,
        **{name: forces[:, k] for k, name in enumerate(robot.force_names)},
    )
    path = folder / f"{stem}.csv"
    comma = layout.decimal == ","
    frame.write_csv(path, separator=layout.dialect.separator, decimal_comma=comma)
    return path


class Later:
    """A movement that sets off later, and rests before and after."""

    def __init__(self, movement, delay: float) -> None:
        self.robot, self._movement, self._delay = movement.robot, movement, delay
        self.duration = movement.duration + delay + 0.5

    def states(self, times):
        inside = np.clip(times - self._delay, 0.0, self._movement.duration)
        return self._movement.states(inside)


LAYOUT = MotionLayout(
    joint_columns=("Axis 1", "Axis 2"),
    length_unit="mm",
    angle_unit="deg",
    time_unit="ms",
    decimal=",",
)
CRANK_AND_SLIDER = {"delta": ("A", "B", "C"), "mixed": ("A", "B", "C"), "five-bar": ("A", "B")}


@CLIENTS
@pytest.mark.parametrize("name", gated(CRANK_AND_SLIDER, ["delta", "five-bar"]))
def test_the_log_of_what_was_written_gives_the_parameters_back(name: str, tmp_path: Path):
    robot, found = driven(name), excited(name)
    layout = replace(LAYOUT, joint_columns=CRANK_AND_SLIDER[name])
    cycles = found.held_out(RATE)
    files = found.write(tmp_path / "motion.csv", RATE, 2, layout, cycles)
    assert [path.name for path in files] == [
        *("motion.csv", "motion.toml", "motion-held-out.csv", "motion-held-out.toml")
    ]
    # The forces of the file are those of the machine.
    about = read_log(files[0], robot)
    state = found.with_leads(2).states(about.time - about.time[0])
    assert about.joints == pytest.approx(state.joints, abs=1e-12)
    assert about.forces == pytest.approx(pteron.drive_forces(robot, *state[:3]), abs=1e-9)

    log = written_log(tmp_path, found.with_leads(2), layout, "log", delay=3.2)
    (tmp_path / "log.toml").write_text(files[1].read_text())
    held = written_log(tmp_path, cycles, layout, "held")
    (tmp_path / "held.toml").write_text(files[3].read_text())
    result = identify(robot, read_log(log, robot), held_out=read_log(held, robot), cad=None)
    assert result.preprocessing[0].period == 2.0
    base = result.model.base.values(robot)
    assert result.base_values == pytest.approx(base, abs=1e-6 * np.abs(base).max())
    coulomb = [leg.drive.coulomb for leg in robot.legs]
    assert result.model.joint_values("coulomb", result.estimate.values) == pytest.approx(
        coulomb, rel=1e-5
    )
    assert result.held_out[0].nrms.max() < 0.5
    message = next(one.message for one in result.findings if one.kind == "periodic")
    assert "repeat after the period of 2 s" in message
    assert result.fitted[0].source == str(log)


@CLIENTS
def test_a_log_that_never_repeats_is_taken_as_it_is(tmp_path: Path):
    found = excited("delta")
    log = written_log(tmp_path, found.with_leads(2), MotionLayout(separator=";"), "log")
    about = found.write_toml(tmp_path / "log.toml", 2, MotionLayout(separator=";"))
    about.write_text(about.read_text().replace("period = 2.0", "period = 1.37"))
    result = identify(driven("delta"), read_log(log, driven("delta")), cad=None)
    assert result.preprocessing[0].derivatives != "periodic"
    words = "nothing in it repeats after the period of 1.37 s; the whole log is taken"
    assert any(words in one.message for one in result.findings)
    assert result.base_values == pytest.approx(result.model.base.values(driven("delta")), rel=1e-2)


@CLIENTS
def test_a_payload_is_found_from_logs_that_lead_in_and_out():
    found = excited("delta")
    led = found.with_leads(2)
    platform = driven("delta").platform
    heavy = replace(platform, inertia=replace(platform.inertia, mass=platform.inertia.mass + 0.4))
    loaded = replace(driven("delta"), platform=heavy)
    about = Description(period=2.0, start=led.start, end=led.end)
    logs = []
    for robot in (driven("delta"), loaded):
        times = np.arange(0.0, led.duration, 1.0 / RATE)
        state = led.states(times)
        forces = pteron.drive_forces(robot, *state[:3])
        symbols = tuple(leg.joint for leg in robot.legs)
        logs.append(Log("log", times, state.joints, forces, description=about, symbols=symbols))
    result = identify_payload(driven("delta"), *logs)
    assert result.mass == pytest.approx(0.4, rel=1e-6)
    both = periodic_part(replace(logs[0], payload=np.arange(len(logs[0])) // 600 % 2))
    assert both.rows == logs[0].rows
    assert both.description.period is None
    assert "two phases of payload" in both.findings[0].message


@pytest.mark.parametrize(
    ("contents", "names"),
    [("joints", ["t", "theta1", "theta2"]), ("poses", ["t", "x", "y"])],
)
def test_a_file_may_hold_the_joints_or_the_poses_alone(contents: str, names: list[str]):
    found = excited("five-bar")
    frame = found.frame(RATE, 1, MotionLayout(contents=contents, length_unit="um", time_unit="us"))
    assert frame.columns == names
    led = found.with_leads(1)
    state = led.states(np.array([1.0]))
    row = frame.row(round(RATE))
    expected = state.joints[0] if contents == "joints" else 1e6 * state.pose[0]
    assert row == pytest.approx([1e6, *expected])
    assert len(frame) == round(led.duration * RATE) + 1


@CLIENTS
def test_units_are_those_of_each_joint():
    robot = driven("mixed")
    found = excited("mixed")
    plain = found.frame(RATE)
    other = found.frame(RATE, 1, MotionLayout(length_unit="mm", angle_unit="deg"))
    for leg, name in zip(robot.legs, robot.joint_names, strict=True):
        factor = 1e3 if leg.joint.unit == "m" else 180.0 / np.pi
        for order in ("", "d", "dd"):
            column = other[f"{order}{name}"].to_numpy()
            assert column == pytest.approx(factor * plain[f"{order}{name}"].to_numpy())
    for name in robot.force_names:
        assert (other[name] == plain[name]).all()
    description = MotionLayout(length_unit="mm", angle_unit="deg").description(robot)
    assert (description.joint_unit, description.joint_angle_unit) == ("mm", "deg")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"length_unit": "cm"}, "length_unit: 'cm' is not one of m, mm, um"),
        ({"contents": "forces"}, "contents: 'forces' is not one of all, joints, poses"),
        ({"separator": ",", "decimal": ","}, "decimal"),
        ({"joint_columns": ("A",)}, "joints.columns: 1 given, but the machine has 3 legs"),
        ({"joint_columns": ("A", "B", "A")}, "'A' is named twice"),
        ({"joint_columns": ("A", "B", "x")}, "'x' would be the name of two columns"),
    ],
)
def test_a_layout_that_cannot_be_is_refused(given: dict, words: str):
    with pytest.raises(pteron.DataError, match=words):
        excited("delta").frame(RATE, 1, MotionLayout(**given))


def run(line: str):
    return CliRunner(env=PLAIN).invoke(app, line.split(" "))


QUICK = "--harmonics 2 --period 2 --starts 1 --draws 2 --workers 1 --seconds 1 --rate 100"


def test_the_command_writes_in_the_units_and_names_asked_for(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run(
        f"excite delta {QUICK} --out motion.csv --angle-unit deg --length-unit mm --time-unit ms "
        "--columns Axis1,Axis2,Axis3 --separator ; --decimal , --contents joints --periods 2"
    )
    assert (result.exit_code, result.stderr) == (0, "")
    lines = Path("motion.csv").read_text().splitlines()
    assert lines[0] == "t;Axis1;Axis2;Axis3"
    assert lines[2].startswith("10,0;")
    assert len(lines) == 802
    motion = "from rest to rest in 8 s: lead-in to 2 s, periodic to 6 s, lead-out."
    for words in ("held-out motion", motion, "Held-out motion, to validate the model: "):
        assert words in result.stdout
    about = tomllib.loads(Path("motion.toml").read_text())
    assert about["joints"] == {"columns": ["Axis1", "Axis2", "Axis3"], "unit": "deg"}
    assert about["motion"] == {"period": 2.0, "start": 2.0, "end": 6.0}
    assert about["csv"]["decimal"] == ","
    assert "motion" not in tomllib.loads(Path("motion-held-out.toml").read_text())
    assert Path("motion-held-out.csv").read_text().startswith("t;Axis1;Axis2;Axis3\n0,0;")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("--out motion.parquet --separator ;", "only a CSV file has a separator"),
        ("--out motion.csv --columns A,B", "joints.columns: 2 given, but the machine has 3 legs"),
        ("--out motion.csv --decimal , --separator ,", "decimal"),
        ("--out robot.csv", "robot.toml: describes a machine, and is kept"),
        ("--out motion.csv --periods 0", "periods: 0 given"),
    ],
)
def test_the_command_refuses_in_one_line_before_it_works(line, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pteron.save(CATALOG["delta"], "robot.toml")
    result = run(f"excite robot.toml {line}")
    assert result.exit_code == 2
    assert words in result.stderr
    assert result.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["robot.toml"]


@CLIENTS
def test_where_no_cycle_fits_it_is_said(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # A machine with a range of the joints that is no more than the clearance leaves.
    robot = CATALOG["delta"]
    q = pteron.inverse_kinematics(robot, home_pose(robot))
    legs = zip(robot.legs, q.tolist(), strict=True)
    narrow = [replace(leg, limits=(at - 0.006, at + 0.006)) for leg, at in legs]
    pteron.save(replace(robot, legs=tuple(narrow)), "narrow.toml")
    result = run(f"excite narrow.toml {QUICK} --out motion.csv")
    assert result.exit_code == 0, result.stderr
    assert result.stderr.startswith("Note: no motion to hold out: delta: no pick-and-place cycle")
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        *("motion.csv", "motion.toml", "narrow.toml")
    ]


def about_home(low: float, high: float) -> pteron.Manipulator:
    """Return a Delta whose joints go so far from the home pose, rad."""
    robot = CATALOG["delta"]
    q = pteron.inverse_kinematics(robot, home_pose(robot)).tolist()
    legs = zip(robot.legs, q, strict=True)
    legs = tuple(replace(leg, limits=(at + low, at + high)) for leg, at in legs)
    return replace(robot, legs=legs)


@CLIENTS
def test_a_safe_distance_from_the_joints_limits_is_kept_unasked(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    robot = about_home(-0.3, 0.3)
    pteron.save(robot, "robot.toml")
    nearest, said = {}, {}
    for given in ("", " --keep-off 0"):
        result = run(f"excite robot.toml {QUICK} --speed 5 --out motion.csv{given}")
        assert result.exit_code == 0, result.stderr
        joints = read_log("motion.csv", robot).joints
        low, high = np.array([leg.limits for leg in robot.legs]).T
        nearest[given] = min((joints - low).min(), (high - joints).min())
        said[given] = " ".join(result.stdout.split())
    # 2 % of 0.6 rad; the limits bind in both, so that a smaller distance is used.
    assert 0.012 <= nearest[""] < 0.02
    assert 0.005 <= nearest[" --keep-off 0"] < 0.012
    assert "where 0.012 was to be kept (--keep-off, --clearance)" in said[""]
    assert "where 0.005 was to be kept" in said[" --keep-off 0"]


def test_a_share_of_the_range_leaves_half_of_what_the_home_pose_has():
    """Its best pose is off the middle of the range: almost half of that is more than it has."""
    robot = about_home(-0.02, 1.3)
    low, high = np.array([leg.limits for leg in robot.legs]).T
    joints = pteron.inverse_kinematics(robot, home_pose(robot))
    has = np.minimum(joints - low, high - joints)
    assert (has < 0.49 * (high - low)).all()
    motion = random_excitation(robot, harmonics=2, period=2.0, limits=Limits(joint_share=0.49))
    moved = motion.joints(motion.uniform_times(2000))[0]
    assert (np.minimum(moved - low, high - moved) >= 0.5 * has - 1e-9).all()


def test_a_share_of_the_range_is_refused_where_nothing_would_be_left():
    with pytest.raises(pteron.DataError, match=r"joint_share 0.5 given, at least 0 and below 0.5"):
        Limits(joint_share=0.5)
