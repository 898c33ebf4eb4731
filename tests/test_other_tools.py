"""Models for other tools, run by those tools or by what they say that they compute."""

import configparser
import ctypes
import re
import subprocess
import sys
import zipfile
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from xml.etree import ElementTree

import casadi as ca
import fmpy
import numpy as np
import pytest
from compiled_exports import KINDS, EmcPose, driven, kinematics, simulated, started
from fmpy.validation import validate_fmu
from mechanisms import CATALOG, CLIENTS, MECHANISMS, gated, random_machine, states, with_elbows
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

import pteron
from pteron.cli.main import app
from pteron.errors import DataError, ModelError, OutputError, UnreachablePose
from pteron.export import (
    casadi_functions,
    export_casadi,
    export_fmu,
    export_klipper,
    export_linuxcnc,
    export_mjcf,
    export_pinocchio,
    export_sdf,
    export_urdf,
)
from pteron.motion import joint_points

ROBOTS = {
    "quadrupteron": driven(CATALOG["quadrupteron"]),
    "oblique": replace(with_elbows(MECHANISMS["quadrupteron-oblique"], "+--+"), name="oblique"),
    "delta": CATALOG["delta"],
    "par4": driven(CATALOG["par4"]),
    "five-bar": driven(CATALOG["five-bar"]),
    "3-rrr": CATALOG["3-rrr"],
    "mixed": driven(random_machine(3, "PRSU")),
    "sliding": random_machine(5, "RRRRI"),
}


# CasADi


@pytest.mark.parametrize(
    "name", gated(["quadrupteron", "delta", "par4", "mixed"], ["delta"], CLIENTS)
)
def test_casadi_functions_are_the_librarys(name):
    robot = ROBOTS[name]
    functions = casadi_functions(robot)
    rng = np.random.default_rng(2)
    for pose, velocity, acceleration in zip(*states(robot, 3), strict=True):
        wrench = rng.normal(size=robot.freedom)
        motion = pose, velocity, acceleration
        forces = pteron.inverse_dynamics(robot, *motion, wrench=wrench)
        joints = pteron.inverse_kinematics(robot, pose)
        given = {
            "inverse_kinematics": (pose,),
            "jacobian": (pose,),
            "mass_matrix": (pose,),
            "bias_forces": (pose, velocity),
            "inverse_dynamics": (*motion, wrench),
            "forward_dynamics": (pose, velocity, forces, wrench),
            "drive_accelerations": (pose, velocity, forces, wrench),
        }
        for function, values in given.items():
            *state, last = values
            loaded = last is wrench
            own = getattr(pteron, function)
            expected = own(robot, *state, wrench=last) if loaded else own(robot, *values)
            found = np.array(functions[function](*values)).reshape(expected.shape)
            np.testing.assert_allclose(found, expected, 1e-9, 1e-9 * np.abs(expected).max())
        needed = functions["drive_forces"](*motion, wrench)
        back = functions["drive_accelerations"](pose, velocity, needed, wrench)
        np.testing.assert_allclose(np.array(back).ravel(), acceleration, 1e-9, 1e-9)
        rates = functions["state_rates"](np.concatenate([pose, velocity]), needed, wrench)
        expected = np.concatenate([velocity, acceleration])
        np.testing.assert_allclose(np.array(rates).ravel(), expected, 1e-9, 1e-9)
        if "direct_kinematics" in functions:
            poses = np.array(functions["direct_kinematics"](joints))
            assert np.nanmin(np.abs(poses - pose).max(axis=1)) < 1e-9
        else:
            found, *_ = functions["direct_step"](joints, pose + 1e-3)
            np.testing.assert_allclose(np.array(found).ravel(), pose, 0.0, 1e-9)


@pytest.mark.parametrize("name", gated(["quadrupteron", "mixed"], ["mixed"]))
@pytest.mark.parametrize("speed", gated([0.0, 1.0], [0.0]))
def test_casadi_differentiates_friction_also_at_rest(name, speed):
    robot = ROBOTS[name]
    pose, velocity = (value[0] for value in states(robot, 1)[:2])
    zero = ca.DM.zeros(robot.freedom)
    pose, velocity = ca.DM(pose), ca.DM(speed * velocity)
    function = casadi_functions(robot)["drive_forces"]
    jacobian = function.jacobian()
    parts = jacobian(pose, velocity, zero, zero, zero)
    found = np.array(parts[jacobian.name_out().index("jac_forces_velocity")])
    steps = ca.horzsplit(1e-6 * ca.DM.eye(robot.freedom))
    ends = [[function(pose, velocity + h, zero, zero) for h in (step, -step)] for step in steps]
    expected = np.array(ca.horzcat(*((more - less) / 2e-6 for more, less in ends)))
    np.testing.assert_allclose(found, expected, 0.0, 1e-5 * np.abs(found).max())


@CLIENTS
@pytest.mark.parametrize("name", gated(["quadrupteron", "3-rrr"], ["3-rrr"]))
def test_the_casadi_example_finds_a_motion(tmp_path, name):
    files = export_casadi(ROBOTS[name], tmp_path)
    done = subprocess.run(
        [sys.executable, files[-1].name], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "largest forces: [" in done.stdout


# FMU


@cache
def fmu_of(name):
    """Return the path of a machine's FMU."""
    (path,) = export_fmu(ROBOTS[name], mkdtemp())
    return str(path)


@CLIENTS
@pytest.mark.parametrize(
    "name",
    gated(
        ["quadrupteron", "oblique", "delta", "par4", "five-bar", "mixed"],
        ["delta", "five-bar"],
        CLIENTS,
    ),
)
def test_fmpy_simulates_an_fmu_as_scipy_the_librarys_equations(name):
    """With forces, a wrench, and a payload, which here is another platform."""
    robot, path = ROBOTS[name], fmu_of(name)
    assert validate_fmu(path) == []
    n, starts = robot.freedom, started(path)
    pose = np.array([starts[f"pose.{c}"] for c in robot.platform.coordinates])
    inputs = [f"{leg.joint.force}{i}" for i, leg in enumerate(robot.legs, start=1)]
    held = np.array([starts[k] for k in inputs])
    rest = np.zeros(n)
    np.testing.assert_allclose(held, pteron.drive_forces(robot, pose, rest, rest), 1e-12)
    push = 0.02 * np.abs(held).max() * np.array([1.0, -0.5, 0.7, 0.3])[:n] + 0.2
    wrench = 0.1 * push[::-1]
    load = {"payload.mass": 0.3}
    values = pteron.parameters(robot).copy()
    values[-4] += 0.3
    if robot.platform.turns:
        load |= {"payload.x": 0.02, "payload.y": -0.01, "payload.inertia": 1e-3}
        values[-3:] += [0.3 * 0.02, -0.3 * 0.01, 1e-3 + 0.3 * (0.02**2 + 0.01**2)]
    loaded = pteron.with_parameters(robot, values)

    def rates(_, state):
        forward = pteron.drive_accelerations(
            loaded, state[:n], state[n:], held + push, wrench=wrench
        )
        return np.concatenate([state[n:], forward])

    stop = 0.04
    expected = solve_ivp(
        rates, (0.0, stop), [*pose, *rest], method="DOP853", rtol=1e-11, atol=1e-13
    ).y[:, -1]
    assert np.abs(expected[:n] - pose).max() > 1e-5
    coordinates = robot.platform.coordinates
    for kind in KINDS:
        result, said = simulated(
            path,
            kind,
            stop,
            **dict(zip(inputs, held + push, strict=True)),
            **{f"wrench.{c}": w for c, w in zip(coordinates, wrench, strict=True)},
            **load,
        )
        assert said == []
        last = result[-1]
        found = [last[f"pose.{c}"] for c in coordinates]
        found += [last[f"velocity.{c}"] for c in coordinates]
        np.testing.assert_allclose(found, expected, 0.0, 1e-7)
        motion = pteron.jacobian(robot, expected[:n]) @ expected[n:]
        for i, leg in enumerate(robot.legs):
            own = f"{leg.joint.coordinate}{i + 1}"
            joints = pteron.inverse_kinematics(robot, expected[:n])
            assert last[own] == pytest.approx(joints[i], abs=1e-6)
            assert last[f"{own}_rate"] == pytest.approx(motion[i], abs=1e-6)
        forward = rates(0.0, expected)[n:]
        given = [last[f"acceleration.{c}"] for c in coordinates]
        np.testing.assert_allclose(given, forward, 0.0, 1e-4 * np.abs(forward).max())


@CLIENTS
@pytest.mark.parametrize("name", ["quadrupteron", "five-bar"])
@pytest.mark.parametrize("kind", KINDS)
def test_an_fmu_ends_where_a_leg_does_not_reach(name, kind):
    path, robot = fmu_of(name), ROBOTS[name]
    first = f"{robot.legs[0].joint.force}1"
    result, said = simulated(path, kind, 4.0, **{first: started(path)[first] - 8.0})
    assert result["time"][-1] < 4.0
    (text,) = said
    time, leg = re.match(r"([\d.]+) s: leg (\d) is at the edge of its reach", text).groups()
    assert result["time"][-1] - 0.5 <= float(time) <= result["time"][-1] + 0.5
    if kind == "CoSimulation":  # fmpy keeps no sample of the end of model exchange
        assert abs(result[f"reach_reserve{leg}"][-1]) < 1e-6


@CLIENTS
@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"pose.x": 300.0}, "does not reach the platform at the pose to start from"),
        ({"payload.mass": -1.0}, "payload.mass must be 0 or more; -1 was given"),
        ({"payload.inertia": -1.0}, "payload.inertia must be 0 or more; -1 was given"),
        ({"drive2.coulomb": -1.0}, "drive2.coulomb must be 0 or more; -1 was given"),
        ({"drive3.rest_speed": 0.0}, "drive3.rest_speed must be 1e-12 or more; 0 was given"),
        ({"force1": np.nan}, "a number of at most 1e+12 is expected"),
        ({"payload.mass": 1e300}, "a number of at most 1e+12 is expected; 1e+300 was given"),
    ],
)
def test_an_fmu_refuses_what_it_cannot_start_from(values, words):
    said = []
    with pytest.raises(fmpy.fmi1.FMICallException):
        fmpy.simulate_fmu(
            fmu_of("quadrupteron"),
            start_values=values,
            logger=lambda *message: said.append(message[-1].decode()),
        )
    assert words in said[0]


@CLIENTS
def test_an_fmu_refuses_calls_in_the_wrong_mode():
    path, said = fmu_of("delta"), []
    description = fmpy.read_model_description(path)
    folder = fmpy.extract(path)
    unit = fmpy.fmi3.FMU3Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
    )
    unit.instantiate(logMessage=lambda *message: said.append(message[-1].decode()))

    def refused(call, words):
        said.clear()
        with pytest.raises(fmpy.fmi1.FMICallException):
            call()
        assert words in said[0]

    def step(time=0.0, size=0.01):
        return unit.doStep(currentCommunicationPoint=time, communicationStepSize=size)

    refused(step, "fmi3DoStep cannot be called before initialization")
    refused(unit.exitInitializationMode, "fmi3ExitInitializationMode cannot be called before")
    unit.enterInitializationMode()
    refused(unit.enterInitializationMode, "cannot be called in initialization mode")
    refused(step, "fmi3DoStep cannot be called in initialization mode")
    unit.exitInitializationMode()
    step()
    for time, size in ((np.nan, 0.01), (0.01, np.inf), (0.01, np.nan), (0.01, 0.0)):
        refused(lambda time=time, size=size: step(time, size), "steps forward only")
    unit.terminate()
    refused(lambda: step(0.01), "fmi3DoStep cannot be called after the end")
    reference = [description.modelVariables[-1].valueReference]
    refused(lambda: unit.setFloat64(reference, [1.0]), "cannot be called after the end")
    unit.reset()
    refused(step, "before initialization")
    unit.freeInstance()


@CLIENTS
def test_casadi_takes_the_fmu_too():
    robot = ROBOTS["par4"]
    model = ca.DaeBuilder("par4", str(fmpy.extract(fmu_of("par4"))), {})
    function = model.create("f", ["x", "u"], ["ode", "y"])
    n, start = robot.freedom, started(fmu_of("par4"))
    states = np.array([start[name] for name in model.x()]) + np.repeat([0.0, 0.3], n)
    inputs = np.array([start[name] for name in model.u()]) + 0.1 * np.arange(2 * n)
    rates = np.array(function(ca.DM(states), ca.DM(inputs))[0]).ravel()
    forward = pteron.drive_accelerations(
        robot, states[:n], states[n:], inputs[:n], wrench=inputs[n:]
    )
    np.testing.assert_allclose(rates, [*states[n:], *forward], 1e-12)


@CLIENTS
def test_an_fmu_goes_back_to_a_kept_state_and_to_its_start():
    path = fmu_of("delta")
    description = fmpy.read_model_description(path)
    folder = fmpy.extract(path)
    unit = fmpy.instantiate_fmu(folder, description, "CoSimulation")
    references = [v.valueReference for v in description.modelVariables if "pose" in v.name]
    force = [v.valueReference for v in description.modelVariables if v.name == "torque1"]

    def run(time):
        unit.doStep(currentCommunicationPoint=time, communicationStepSize=0.01)
        return unit.getFloat64(references)

    def begin():
        unit.enterInitializationMode()
        unit.exitInitializationMode()
        unit.setFloat64(force, [10.0])

    begin()
    first = run(0.0)
    kept = unit.getFMUState()
    second = run(0.01)
    assert first != second
    unit.setFMUState(kept)
    assert run(0.01) == second
    unit.freeFMUState(kept)
    unit.reset()
    begin()
    assert run(0.0) == first
    with pytest.raises(fmpy.fmi1.FMICallException):
        unit.doStep(currentCommunicationPoint=0.5, communicationStepSize=0.01)
    unit.freeInstance()


@CLIENTS
def test_an_fmu_has_its_sources_and_is_refused_clearly(tmp_path, monkeypatch):
    with zipfile.ZipFile(fmu_of("delta")) as archive:
        names = set(archive.namelist())
    assert {"sources/delta.c", "sources/fmu.c", "sources/buildDescription.xml"} < names
    with pytest.raises(DataError, match=r"pose: shape \(2,\) given, \(3,\) expected: x, y, z"):
        export_fmu(CATALOG["delta"], tmp_path, pose=[0.0, 0.0])
    with pytest.raises(UnreachablePose):
        export_fmu(CATALOG["delta"], tmp_path, pose=[0.0, 0.0, -820.0])
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="it is a file"):
        export_fmu(CATALOG["five-bar"], tmp_path / "file")
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(ModelError, match="an FMU needs a C compiler, which is not here"):
        export_fmu(CATALOG["five-bar"], tmp_path)
    monkeypatch.setenv("CC", "false")
    with pytest.raises(ModelError, match=r"could not be compiled with .*false: exit code 1"):
        export_fmu(CATALOG["five-bar"], tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


# Klipper


def settings(robot, folder):
    """Return the configuration as Klipper reads it, and its text."""
    (path,) = export_klipper(robot, folder)
    parser = configparser.RawConfigParser(
        strict=False, inline_comment_prefixes=(";", "#"), delimiters=(":", "=")
    )
    parser.read_string(path.read_text())
    return parser, path.read_text()


def coefficients(text):
    """Read `carriages` as klippy/kinematics/kinematic_stepper.py does: float*name, +name, -name."""
    found = np.zeros(3)
    for term in re.findall(r"[+-]?[^+-]+", text):
        *factor, axis = term.split("*")
        if not factor:
            sign, axis = (-1.0, axis[1:]) if axis[0] == "-" else (1.0, axis.lstrip("+"))
        assert axis in ("x", "y", "z")
        assert found["xyz".index(axis)] == 0.0
        found["xyz".index(axis)] = float(factor[0]) if factor else sign
    return found


def klipper_steppers(config):
    """Return functions from x, y, z in mm to the steppers' positions, by Klipper's formulas."""
    printer = config["printer"]
    kind = printer["kinematics"]
    if kind == "generic_cartesian":  # klippy/chelper/kin_generic.c
        assert {f"carriage {axis}" for axis in "xyz"} <= set(config.sections())
        rows = [coefficients(config[s]["carriages"]) for s in config if s.startswith("stepper ")]
        assert abs(np.linalg.det(np.array(rows).T @ np.array(rows))) > 1e-5
        return [lambda p, row=row: p @ row for row in rows]
    towers = [config[f"stepper_{name}"] for name in "abc"]
    if kind == "delta":  # klippy/kinematics/delta.py, klippy/chelper/kin_delta.c
        radius = float(printer["delta_radius"])

        def carriage(p, tower):
            arm, angle = float(tower["arm_length"]), np.radians(float(tower["angle"]))
            assert arm > radius
            away = p[:, :2] - radius * np.array([np.cos(angle), np.sin(angle)])
            return np.sqrt(arm**2 - (away**2).sum(axis=1)) + p[:, 2]

        return [lambda p, tower=tower: carriage(p, tower) for tower in towers]
    assert kind == "rotary_delta"  # klippy/chelper/kin_rotary_delta.c

    def arm(p, tower):
        angle = np.radians(float(tower["angle"]))
        cos, sin = np.cos(angle), np.sin(angle)
        upper, lower = (float(tower[f"{k}_arm_length"]) for k in ("upper", "lower"))
        aside = p[:, 1] * cos - p[:, 0] * sin
        dx = p[:, 0] * cos + p[:, 1] * sin - float(printer["shoulder_radius"])
        dy = p[:, 2] - float(printer["shoulder_height"])
        # elbow_y = first - slope elbow_x, from the difference of the two circles
        first = (dx**2 + dy**2 + upper**2 - (lower**2 - aside**2)) / (2.0 * dy)
        slope = dx / dy
        scale = slope**2 + 1.0
        x = first * slope + np.sqrt(scale * upper**2 - first**2)
        return np.arctan2(first * scale - slope * x, x)

    return [lambda p, tower=tower: arm(p, tower) for tower in towers]


def lowered(robot, count=50):
    """Return poses of a Delta whose platform is below."""
    poses = pteron.random_poses(robot, 20 * count, seed=3, type_i=0.1, type_ii=0.0)
    lowest = min(leg.guide_point[2] for leg in robot.legs)
    return poses[poses[:, 2] < lowest - 0.01][:count]


def mirrored(robot):
    """Return a linear Delta whose sliders count downwards."""
    legs = [
        replace(leg, slider_direction=(0.0, 0.0, -1.0), elbow=-leg.elbow, limits=(-0.48, -0.13))
        for leg in robot.legs
    ]
    return driven(replace(robot, legs=tuple(legs)))


def reversed_cranks(robot):
    """Return a rotary Delta whose second crank counts downwards, from another zero."""
    first, leg, last = robot.legs
    r, d = np.array(leg.guide_point), np.array(leg.direction)
    turned = replace(
        leg,
        direction=tuple(-d),
        zero_direction=tuple(-np.array([0.0, 0.0, 1.0])),
        elbow=-leg.elbow,
        limits=(-2.0, 0.5),
        platform_point=tuple(1.1 * np.array(leg.platform_point)),
        guide_point=tuple(r + 0.1 * np.array(leg.platform_point)),
    )
    return driven(replace(robot, legs=(first, turned, last)))


def tooled(robot, tool):
    """Return a machine with a tool."""
    return replace(robot, platform=replace(robot.platform, tool=tool))


def raised(robot, height):
    """Return a machine that stands higher in its frame."""
    legs = [
        replace(leg, guide_point=tuple(np.add(leg.guide_point, (0.0, 0.0, height))))
        for leg in robot.legs
    ]
    return replace(robot, legs=tuple(legs))


KLIPPER = {
    "tripteron": CATALOG["tripteron"],
    "tripteron-router": driven(CATALOG["tripteron-router"]),
    "tripteron-oblique": CATALOG["tripteron-oblique"],
    "tripteron-colinear": CATALOG["tripteron-colinear"],
    "on a wall": MECHANISMS["tripteron on a wall"],
    "random": MECHANISMS["random 3T 0"],
    "linear-delta": CATALOG["linear-delta"],
    "mirrored": mirrored(CATALOG["linear-delta"]),
    "delta": CATALOG["delta"],
    "cranks": reversed_cranks(CATALOG["delta"]),
    "cranks with a tool": tooled(CATALOG["delta"], (0.0, 0.0, -0.045)),
    "raised cranks": tooled(raised(CATALOG["delta"], 1.1), (0.0, 0.0, -0.045)),
    "cranks too high": raised(CATALOG["delta"], 2.0),
    "guides with a tool": tooled(CATALOG["linear-delta"], (0.0, 0.0, -0.045)),
    "guides on high": raised(CATALOG["linear-delta"], 0.5),
    "guides below": raised(CATALOG["linear-delta"], -3.0),
    "a tool aside": tooled(CATALOG["tripteron-oblique"], (0.01, -0.02, -0.045)),
}


def klippers(robot, poses, text):
    """Return Klipper's x, y and z, mm, at poses: the tool's, from the bed."""
    places = 1000.0 * (poses + np.array(robot.platform.tool))
    bed = re.search(r"the bed, is the (pose|tool)'s z = (\S+) mm", text)
    if bed:
        assert bed[1] == ("tool" if any(robot.platform.tool) else "pose")
        places[..., 2] -= float(bed[2])
    return places


@pytest.mark.parametrize(
    "name", gated(KLIPPER, ["tripteron-oblique", "cranks with a tool", "guides below"], CLIENTS)
)
def test_klipper_puts_the_joints_where_the_library_does(tmp_path, name):
    robot = KLIPPER[name]
    config, text = settings(robot, tmp_path)
    rotary = config["printer"]["kinematics"] == "rotary_delta"
    poses = lowered(robot) if rotary else states(robot, 50)[0]
    assert len(poses) > 10
    joints = pteron.inverse_kinematics(robot, poses)
    told = re.findall(r"Its position is (-?)(\w+) in (mm|rad) ([+-]) (\S+) (?:mm|rad)", text)
    unit = 1.0 if rotary else 1000.0
    for i, (stepper, (sign, joint, _, side, offset)) in enumerate(
        zip(klipper_steppers(config), told, strict=True)
    ):
        assert joint == f"{robot.legs[i].joint.coordinate}{i + 1}"
        found = stepper(klippers(robot, poses, text))
        expected = unit * joints[:, i] * (-1.0 if sign else 1.0)
        apart = found - expected
        if rotary:  # whole turns left out
            apart = (apart - apart[0] + np.pi) % (2.0 * np.pi) - np.pi + apart[0]
        np.testing.assert_allclose(apart, apart[0], 0.0, 1e-9 * unit)
        assert apart[0] == pytest.approx(float(side + offset), abs=1e-7 * unit)


@pytest.mark.parametrize("name", ["linear-delta", "mirrored", "delta"])
def test_klippers_end_stops_are_the_joints_upper_limits(tmp_path, name):
    """position_endstop is z on the axis, with all carriages or arms where they end."""
    robot = KLIPPER[name]
    config, text = settings(robot, tmp_path)
    told = re.findall(r"Its position is (-?)(\w+) in (mm|rad) ([+-]) (\S+) (?:mm|rad)", text)
    for leg, letter, stepper, (sign, _, unit, side, offset) in zip(
        robot.legs, "abc", klipper_steppers(config), told, strict=True
    ):
        end = float(config[f"stepper_{letter}"]["position_endstop"])
        limit = -leg.limits[0] if sign else leg.limits[1]
        scale = 1000.0 if unit == "mm" else 1.0
        (found,) = stepper(np.array([[0.0, 0.0, end]]))
        assert found == pytest.approx(scale * limit + float(side + offset), abs=1e-6 * scale)


DELTAS = [name for name in KLIPPER if "delta" in name or "cranks" in name or "guides" in name]


@pytest.mark.parametrize("name", gated(DELTAS, ["cranks", "guides below"], CLIENTS))
def test_klipper_homes_a_delta_and_reaches_its_bed(tmp_path, name):
    """`home` of rotary_delta.py comes from z = -1, that of delta.py from far below."""
    robot = KLIPPER[name]
    config, text = settings(robot, tmp_path)
    printer, towers = config["printer"], [config[f"stepper_{k}"] for k in "abc"]
    ends = [float(tower["position_endstop"]) for tower in towers]
    assert min(ends) > 0.0  # stepper.py refuses one below position_min, which is 0
    if printer["kinematics"] == "rotary_delta":
        start = -1.0
        shoulder = float(printer["shoulder_radius"])
        most = min(
            shoulder + min(float(tower["upper_arm_length"]) for tower in towers),
            min(float(tower["lower_arm_length"]) for tower in towers) - shoulder,
        )
    else:
        radius = float(printer["delta_radius"])
        arms = [float(tower["arm_length"]) for tower in towers]
        most = min(radius, min(arms) - radius)
        start = -1.5 * np.sqrt(max(arms) ** 2 - most**2)
    way = np.zeros((200, 3))
    way[:, 2] = np.linspace(start, min(ends), 200)
    for stepper in klipper_steppers(config):
        steps = stepper(way)
        assert np.isfinite(steps).all()
        assert np.abs(np.diff(steps)).max() < 0.1 * np.ptp(steps)  # no elbow jumps
    told = re.search(r"At the bed P reaches (\d+) mm", text)
    reach = float(told[1]) if told else most
    assert reach > 0.5 * most
    turns = np.linspace(0.0, 2.0 * np.pi, 100)
    rim = np.stack([np.cos(turns), np.sin(turns), np.zeros(100)], axis=-1) * 0.99 * reach
    bed = klippers(robot, np.zeros(3), text)
    joints = pteron.inverse_kinematics(robot, (rim - bed) / 1000.0)
    for leg, values in zip(robot.legs, joints.T, strict=True):
        assert leg.limits[0] <= values.min()
        assert values.max() <= leg.limits[1]


def test_a_tool_beside_the_axis_is_told_to_a_delta(tmp_path):
    robot = tooled(CATALOG["delta"], (0.01, -0.02, -0.045))
    config, text = settings(robot, tmp_path)
    assert "SET_GCODE_OFFSET X=-10 Y=20 makes them the tool's" in " ".join(
        re.sub(r"^# ", "", text, flags=re.MULTILINE).split()
    )
    plain, _ = settings(tooled(robot, (0.0, 0.0, -0.045)), tmp_path)
    assert {k: dict(v) for k, v in config.items()} == {k: dict(v) for k, v in plain.items()}


def test_klippers_box_is_the_tools(tmp_path):
    """The steppers are where they were while the tool is where P was."""
    aside = np.array([0.01, -0.02, -0.045])
    limited = [replace(leg, limits=(-0.05, 0.11)) for leg in CATALOG["tripteron-router"].legs]
    robot = replace(CATALOG["tripteron-router"], legs=tuple(limited))
    (box, _), (moved, _) = (settings(tooled(robot, tool), tmp_path) for tool in ((0, 0, 0), aside))
    for axis, way in zip("xyz", 1000.0 * aside, strict=True):
        for key in ("position_min", "position_max"):
            least, most = (float(c[f"carriage {axis}"][key]) for c in (box, moved))
            assert most - least == pytest.approx(way, abs=1e-3)


def test_klippers_box_keeps_the_joints_limits(tmp_path):
    for name, fills in (("tripteron-router", True), ("tripteron-oblique", False)):
        robot = replace(
            CATALOG[name],
            legs=tuple(replace(leg, limits=(-0.05, 0.11)) for leg in CATALOG[name].legs),
        )
        config, text = settings(robot, tmp_path)
        assert ("its end stop is that axis' own" in text) == fills
        ends = [
            [float(config[f"carriage {a}"][f"position_{k}"]) for a in "xyz"] for k in ("min", "max")
        ]
        corners = np.array(np.meshgrid(*np.transpose(ends))).reshape(3, -1).T / 1000.0
        joints = corners @ pteron.jacobian(robot, np.zeros(3)).T
        joints += np.array(pteron.inverse_kinematics(robot, np.zeros(3)))
        assert joints.min() == pytest.approx(-0.05, abs=1e-6)
        assert joints.max() == pytest.approx(0.11, abs=1e-6)


def test_klipper_is_told_of_the_drives(tmp_path):
    config, _ = settings(KLIPPER["tripteron-router"], tmp_path)
    assert float(config["stepper rho1"]["rotation_distance"]) == pytest.approx(2000 * np.pi / 40.0)
    config, _ = settings(KLIPPER["cranks"], tmp_path)
    assert [config[f"stepper_{k}"]["gear_ratio"] for k in "abc"] == ["40:1", "50:1", "40:1"]


def with_leg(robot, **changes):
    """Return a machine whose second leg is changed."""
    legs = list(robot.legs)
    legs[1] = replace(legs[1], **changes)
    return replace(robot, legs=tuple(legs))


LINEAR, DELTA = CATALOG["linear-delta"], CATALOG["delta"]


@pytest.mark.parametrize(
    ("robot", "words"),
    [
        (CATALOG["quadrupteron"], "this machine's pose is x, y, z, phi; use --linuxcnc"),
        (CATALOG["five-bar"], "this machine's pose is x, y; use --linuxcnc"),
        (CATALOG["orthoglide"], "leg 1: its guide is not vertical"),
        (CATALOG["delta-omnid"], "turn a model over whose platform is above"),
        (MECHANISMS["random PRR 0"], "neither all linear in the pose"),
        (with_leg(LINEAR, guide_point=(0.14, -0.0599, 0.0)), r"leg 2: is [\d.]+ mm from the z"),
        (with_leg(LINEAR, lower_length=0.09), "rod of 90 mm is shorter than the radius, 99.8 mm"),
        (with_elbows(LINEAR, "+++"), "leg 1: its slider is below the platform"),
        (with_elbows(DELTA, "+-+"), "leg 2: its elbow is inside"),
        (with_leg(DELTA, platform_point=(-0.0625, 0.1, 0.0)), "leg 2: its crank's plane passes"),
        (
            replace(DELTA, legs=tuple(replace(leg, limits=(3.0, 3.1)) for leg in DELTA.legs)),
            "nowhere well in reach below its end stops",
        ),
        (
            with_leg(DELTA, platform_point=(-0.0625, 0.10825317547305482, 0.02)),
            "leg 2: has its shoulder at z = -20 mm, leg 1 0 mm",
        ),
        (
            pteron.turned(DELTA, [[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
            "crank's axis is not horizontal",
        ),
    ],
)
def test_klipper_is_not_given_a_machine_that_it_cannot_move(tmp_path, robot, words):
    with pytest.raises(ModelError, match=words) as refusal:
        export_klipper(robot, tmp_path)
    assert "\n" not in str(refusal.value)
    assert not list(tmp_path.iterdir())


# LinuxCNC


LINUXCNC = {name: ROBOTS[name] for name in ("par4", "five-bar", "3-rrr", "mixed", "sliding")} | {
    "tripteron-oblique": CATALOG["tripteron-oblique"],
    "upside": pteron.turned(CATALOG["quadrupteron"], np.diag([1.0, -1.0, -1.0])),
    "mühle": replace(CATALOG["linear-delta"], name="mühle"),
    "sideways": pteron.turned(CATALOG["quadrupteron"], [[0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    "h4": CATALOG["h4"],
    "turning tool": tooled(CATALOG["quadrupteron"], (0.01, -0.02, -0.045)),
    "3-rrr with a tool": tooled(CATALOG["3-rrr"], (0.03, -0.02, 0.5)),
    "five-bar with a tool": tooled(CATALOG["five-bar"], (0.03, -0.02, 0.5)),
    "sideways with a tool": tooled(
        pteron.turned(CATALOG["quadrupteron"], [[0, 0, 1], [1, 0, 0], [0, 1, 0]]),
        (0.01, -0.02, -0.045),
    ),
    "cranks": KLIPPER["cranks"],
}
"""The second of the last one's cranks passes half a turn within its limits, as the five-bar's."""

ANGLE = {
    "upside": ("c", -1.0),
    **dict.fromkeys(("sideways", "sideways with a tool"), ("a", 1.0)),
}


@pytest.mark.parametrize("name", gated(LINUXCNC, ["3-rrr with a tool"], CLIENTS))
def test_linuxcnc_goes_to_the_joints_and_back(tmp_path, name):
    robot = LINUXCNC[name]
    library, _ = kinematics(robot, tmp_path)
    assert library.kinematicsType() == 4
    n, degrees = robot.freedom, 180.0 / np.pi
    units = [degrees if leg.joint.unit == "rad" else 1000.0 for leg in robot.legs]
    letter, sign = ANGLE.get(name, ("c", 1.0))
    joints = (ctypes.c_double * 16)(*[77.0] * 16)
    poses = states(robot, 20)[0] if name != "cranks" else lowered(robot, 20)
    poses = poses.copy()
    if robot.platform.turns and not robot.platform.slides and name != "mixed":
        poses[::2, -1] += 4.0 * np.pi  # a whole turn more is kept
    for pose in poses:
        place = robot.platform.directions @ joint_points(robot, pose).tool
        given = dict(zip("xyz", 1000.0 * place, strict=False))
        if robot.platform.turns:
            given[letter] = sign * degrees * pose[-1]
        world = EmcPose(**given, w=5.0)
        assert library.kinematicsInverse(ctypes.byref(world), joints, None, None) == 0
        expected = units * pteron.inverse_kinematics(robot, pose)
        for i, leg in enumerate(robot.legs):
            if leg.joint.noun == "crank":
                middle = np.degrees(sum(leg.limits or (0.0, 0.0)) / 2.0)
                expected[i] = (expected[i] - middle + 180.0) % 360.0 - 180.0 + middle
        np.testing.assert_allclose(joints[:n], expected, 1e-11, 1e-9)
        assert list(joints[n:]) == [77.0] * (16 - n)
        near = EmcPose(**{key: value + 0.3 for key, value in given.items()}, w=5.0)
        assert library.kinematicsForward(joints, ctypes.byref(near), None, None) == 0
        for key, _ in EmcPose._fields_:
            assert getattr(near, key) == pytest.approx(given.get(key, 0.0), abs=1e-6, rel=1e-9)
    far = EmcPose(x=1e6)
    before = list(joints)
    assert library.kinematicsInverse(ctypes.byref(far), joints, None, None) == -1
    assert list(joints) == before
    nowhere = (ctypes.c_double * 16)(*[1e6 * (k + 1) for k in range(16)])
    assert library.kinematicsForward(nowhere, ctypes.byref(near), None, None) in (0, -1)


def test_linuxcncs_files_tell_home_and_limits(tmp_path):
    robot = driven(CATALOG["delta"], max_speed=2.0)
    library, files = kinematics(robot, tmp_path)
    parser = configparser.RawConfigParser()
    parser.read_string(files["ini"].read_text())
    assert parser["KINS"]["JOINTS"] == "3"
    assert parser["TRAJ"]["COORDINATES"] == "XYZ"
    world = EmcPose(*map(float, parser["TRAJ"]["HOME"].split()))
    joints = (ctypes.c_double * 16)()
    assert library.kinematicsInverse(ctypes.byref(world), joints, None, None) == 0
    for k, leg in enumerate(robot.legs):
        joint = parser[f"JOINT_{k}"]
        assert joint["TYPE"] == "ANGULAR"
        assert float(joint["HOME"]) == pytest.approx(joints[k], abs=1e-4)
        assert float(joint["MIN_LIMIT"]) == pytest.approx(np.degrees(leg.limits[0]), abs=1e-6)
        assert float(joint["MAX_VELOCITY"]) == pytest.approx(np.degrees(2.0), abs=1e-6)
    assert files["hal"].read_text().count("motor-pos-fb") == 4


@pytest.mark.parametrize("tool", [(0.0, 0.0, 0.0), (0.01, -0.02, -0.045)])
@pytest.mark.parametrize("name", ["tripteron-oblique", "random 3T 0"])
def test_matrixkins_moves_the_joints_as_the_library_does(tmp_path, name, tool):
    robot = tooled(MECHANISMS[name], tool)
    *_, path = export_linuxcnc(robot, tmp_path)
    text = path.read_text()
    values = dict(re.findall(r"setp matrixkins\.C_(\w\w) (\S+)", text))
    rows = np.array([[float(values[i + j]) for j in "xyz"] for i in "xyz"])
    told = re.findall(r"= rho\d ([+-]) (\S+) mm", text)
    offsets = [float(side + size) for side, size in told]
    poses = states(robot, 20)[0]
    joints = 1000.0 * pteron.inverse_kinematics(robot, poses) + offsets
    places = 1000.0 * joint_points(robot, poses).tool
    np.testing.assert_allclose(places @ rows.T, joints, 0.0, 1e-6)


# Names

NAMES = [
    200 * "x",
    200 * "翼",
    40 * "\N{ARABIC LIGATURE SALLALLAHOU ALAYHE WASALLAM}",
    "\"*/ *) <a & b='c'> 翼 -- ${x} {{ y }} %s \\",
    "con",
    "double",
]


@pytest.mark.parametrize("name", gated(NAMES, [NAMES[1]]))
def test_every_format_holds_every_name(tmp_path, name):
    robot = replace(CATALOG["tripteron"], name=name)
    sources = pteron.export_c(robot, ["inverse_kinematics"], tmp_path)
    program = [path.name for path in sources if path.suffix == ".c"]
    subprocess.run(["gcc", *program, "-o", "tried", "-lm"], cwd=tmp_path, check=True)
    subprocess.run([tmp_path / "tried"], check=True, capture_output=True)
    pteron.export_st(robot, ["inverse_kinematics"], tmp_path)
    settings(robot, tmp_path)
    kinematics(robot, tmp_path)
    modules = [path for path in export_casadi(robot, tmp_path) if path.suffix == ".py"]
    for path in (*modules, *export_pinocchio(robot, tmp_path)):
        compile(path.read_text(), path.name, "exec")
    for export in (export_mjcf, export_sdf, export_urdf):
        for path in export(robot, tmp_path):
            if path.suffix != ".yaml":
                ElementTree.parse(path)
    assert max(len(path.name) for path in tmp_path.iterdir()) < 160


def test_an_fmus_description_holds_a_name(tmp_path):
    robot = replace(CATALOG["tripteron"], name=NAMES[3])
    (unit,) = export_fmu(robot, tmp_path)
    with zipfile.ZipFile(unit) as members:
        described = ElementTree.fromstring(members.read("modelDescription.xml"))
    assert described.get("modelName") == robot.name
    assert described.find("CoSimulation").get("modelIdentifier") == unit.stem


def test_names_that_differ_in_letters_stay_apart(tmp_path):
    names = ["翼", "鳥", "mühle", "mühle ", "muhle", "a+b", "a-b", "a*b", 120 * "x", 121 * "x"]
    stems = []
    for name in names:
        robot = replace(CATALOG["tripteron"], name=name)
        (path,) = export_klipper(robot, tmp_path)
        (model,) = export_mjcf(robot, tmp_path)
        stems.append((path.stem, model.stem))
    assert len({stem for stem, _ in stems}) == len({stem for _, stem in stems}) == len(names)
    assert stems[4] == ("muhle", "muhle")
    assert stems[6] == ("a_b", "a-b")
    assert all(re.fullmatch(r"[a-z][a-z0-9_]*", stem) for stem, _ in stems)


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("tripod", "tripod_[0-9a-f]{6}kins"),
        (30 * "a", "a{19}_[0-9a-f]{6}kins"),
        ("delta", "deltakins"),
    ],
)
def test_linuxcncs_own_modules_keep_their_names(tmp_path, name, stem):
    path, *_ = export_linuxcnc(replace(CATALOG["tripteron"], name=name), tmp_path)
    assert re.fullmatch(stem, path.stem)
    assert len(path.stem) < 31  # RTAPI_NAME_LEN
    assert f"component {path.stem} " in path.read_text()
    assert f"KINEMATICS = {path.stem}\n" in (tmp_path / f"{name}.ini").read_text()


# The command line


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("", "none given; say what to write, such as --c controller"),
        ("--fmu a --casadi b", "--casadi, --fmu: give one at a time"),
        ("--fmu a --c b", "--c, --fmu: give one at a time"),
        (
            "--klipper a --float --wrench",
            "--float, --wrench: goes with --c, --st and --cuda, not",
        ),
        (
            "--linuxcnc a --base b.json",
            "--base: goes with --c, --st and --cuda, not",
        ),
        ("--st a --float", "--float: goes with --c"),
        ("--klipper a", "Klipper moves x, y and z alone"),
    ],
)
def test_what_cannot_be_written_is_refused_in_one_line(tmp_path, monkeypatch, line, words):
    monkeypatch.chdir(tmp_path)
    result = CliRunner(env={"COLUMNS": "300"}).invoke(
        app, ["export", "quadrupteron", *line.split()]
    )
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("Error: ")
    assert result.stderr.count("\n") == 1
    assert words in result.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("target", "names"),
    [
        ("casadi", ["example_tripteron.py", "load_tripteron.py", "tripteron_jacobian.casadi"]),
        ("fmu", ["tripteron.fmu"]),
        ("klipper", ["tripteron.cfg"]),
        ("linuxcnc", ["tripteron.ini", "tripteronkins.comp"]),
    ],
)
def test_the_command_writes_what_is_asked_for(tmp_path, target, names):
    line = ["export", "tripteron", "--elbows", "+-+", f"--{target}", str(tmp_path / "made")]
    result = CliRunner(env={"COLUMNS": "300"}).invoke(app, line)
    assert (result.exit_code, result.stderr) == (0, "")
    files = [Path(text) for text in re.findall(r"Written: (\S+)", result.stdout)]
    assert set(names) <= {path.name for path in files}
    assert all(path.stat().st_size > 0 for path in files)
