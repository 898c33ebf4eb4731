"""Code for controllers: compiled without a warning, run, and compared with the library."""

import ctypes
import json
import platform
import re
import shutil
import subprocess
import textwrap
from contextlib import suppress
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
from exported_code import (
    DELTA,
    ROBOT,
    ROBOTS,
    WARNINGS,
    build,
    compiled,
    identification_file,
    run,
    stiff,
)
from logs_of_motions import Friction, log_of, motion
from mechanisms import CATALOG, CLIENTS, LARGE, NIGHTLY, gated, states
from typer.testing import CliRunner

import pteron
from pteron.cli.main import app
from pteron.equations.drives import drive_numbers
from pteron.errors import DataError, ModelError, OutputError, UnlikelyValue
from pteron.export import FUNCTIONS
from pteron.export.functions import exported_functions as exported
from pteron.identification import Terms, identify
from pteron.identification.signals import States
from pteron.kernels.vm import VirtualMachine
from pteron.kinematics import assembly_modes
from pteron.manipulator.machine_record import machine_record
from pteron.motion import with_payload
from pteron.report.identification import numbers

NOT_CLOSED = tuple(name for name in FUNCTIONS if name != "direct_kinematics")

WARNINGS += ["-Wdouble-promotion", "-Wfloat-conversion"]


@CLIENTS
@pytest.mark.parametrize(
    ("name", "real", "compiler"),
    [
        ("five_bar", "float", "gcc"),
        ("delta", "double", "g++"),
        *(
            pytest.param(*case, marks=NIGHTLY)
            for case in (
                *((name, "float", "gcc") for name in ROBOTS if name != "five_bar"),
                ("delta", "double", "clang"),
                ("quadrupteron", "float", "g++"),
            )
        ),
    ],
)
def test_its_test_program_passes(tmp_path, name, real, compiler):
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    files = pteron.export_c(
        ROBOTS[name],
        folder=tmp_path,
        real=real,
        specialised=real == "float",
        wrench=name == "delta",
    )
    build(tmp_path, [files[1].name, files[2].name], compiler=compiler)
    assert run(tmp_path) == (0, "all functions agree with the library\n")


@CLIENTS
@pytest.mark.parametrize("left_out", gated([(), LARGE], [LARGE]), ids=len)
def test_every_function_can_be_exported_and_the_test_program_can_fail(tmp_path, left_out):
    names = [n for n in pteron.kernels.FUNCTIONS if n not in ("base_regressor", *left_out)]
    files = ["five_bar.c", "test_five_bar.c"]
    pteron.export_c(ROBOTS["five_bar"], names, tmp_path)
    build(tmp_path, files)
    assert run(tmp_path)[0] == 0
    source = tmp_path / "five_bar.c"
    length = str(ROBOTS["five_bar"].legs[0].lower_length)
    source.write_text(source.read_text().replace(length, str(1.01 * float(length))))
    build(tmp_path, files, "-O0")
    code, output = run(tmp_path)
    assert code == 1
    assert "direct_kinematics, column 1: off by" in output


@cache
def library(name, real="double"):
    """Return a machine's exported functions, called with arrays."""
    folder = Path(mkdtemp())
    pteron.export_c(ROBOTS[name], folder=folder, real=real)
    build(folder, [f"{name}.c"], "-shared", "-fPIC")
    loaded = ctypes.CDLL(str(folder / "run"))
    shutil.rmtree(folder)
    dtype = np.float32 if real == "float" else np.float64

    def call(function, *inputs, shape):
        output = np.full(shape, 77.0, dtype)
        arrays = [np.ascontiguousarray(value, dtype) for value in inputs]
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in (*arrays, output)]
        return getattr(loaded, f"{name}_{function}")(*pointers), output

    return call


@pytest.mark.parametrize("name", gated(ROBOTS, ["delta", "mixed"]))
def test_random_states_give_the_bits_that_the_library_gives(name):
    robot, call = ROBOTS[name], library(name)
    given = {"parameters": pteron.parameters(robot), "drives": drive_numbers(robot)}
    given |= {"mass": [0.4], "center": [0.01, -0.02, 0.03], "inertia": [1e-3]}
    for pose, velocity, acceleration in zip(*states(robot, 20), strict=True):
        given |= {"pose": pose, "velocity": velocity, "acceleration": acceleration}
        given["joints"] = pteron.inverse_kinematics(robot, pose)
        given["forces"] = pteron.inverse_dynamics(robot, pose, velocity, acceleration)
        functions = FUNCTIONS if name != "par4" else (*NOT_CLOSED, "feed_forward")
        for function in functions:
            if function == "inverse_dynamics_base":
                continue  # it computes with another base set than it is given
            program = pteron.kernels.program(robot, function)
            inputs = [given[port.name] for port in program.inputs]
            (result,) = program.outputs
            kernel = VirtualMachine(function, program.function, program.inputs, program.outputs)
            status, found = call(function, *inputs, shape=result.size)
            assert status == 0
            np.testing.assert_array_equal(found, np.ravel(kernel(*inputs)), function)


@pytest.mark.parametrize("real", ["double", "float"])
@CLIENTS
@pytest.mark.parametrize("name", gated(["quadrupteron", "par4", "ankle", "3-rrr"], ["par4"]))
def test_a_payload_is_set_while_the_code_runs(tmp_path, name, real):
    robot = ROBOTS.get(name) or pteron.load(name)
    mass, center = 0.7, (0.03, -0.02, 0.05)
    inertia = (2e-3, 1e-4, -2e-4, 3e-3, 1e-4, 4e-3) if robot.platform.tilts else (2e-3,)
    carrying = with_payload(robot, mass, center, inertia)
    functions = ["set_payload", "inverse_dynamics"]
    functions += [f"{function}_base" for function in functions]
    call, _ = compiled(robot, functions, tmp_path, real=real)
    state = [part[0] for part in states(robot, 1)]
    expected = pteron.inverse_dynamics(carrying, *state)
    assert np.abs(expected - pteron.inverse_dynamics(robot, *state)).max() > 0.1
    bare = {"": pteron.parameters(robot), "_base": pteron.base_parameters(robot).values()}
    for kind, given in bare.items():
        load = [mass], center, inertia, given
        _, loaded = call(f"set_payload{kind}", *load, sizes=[given.shape])
        _, forces = call(f"inverse_dynamics{kind}", *state, loaded, sizes=[expected.shape])
        exact = 1e-5 if real == "float" else 1e-12
        np.testing.assert_allclose(forces, expected, rtol=0, atol=exact * np.abs(expected).max())
    with pytest.raises(ModelError, match="folds into the code"):
        pteron.export_c(robot, "set_payload", tmp_path, specialised=True)


@pytest.mark.parametrize("name", gated(["quadrupteron-oblique", "delta", "par4", "five-bar"]))
def test_a_motion_of_the_joints_becomes_torques_of_the_motors(tmp_path, name):
    """Each call begins with the pose that the last one found; the first with a pose 1 mm off."""
    robot = stiff(CATALOG[name])
    n = robot.freedom
    call, header = compiled(
        robot, ["joint_feed_forward"], tmp_path, output="torque", specialised=True
    )
    assert "out motor_torques" in header
    assert "torques of the motors, N m: forces at the joints over the ratios 80, -70" in header
    cycle = pteron.motion.pick_and_place(robot, pteron.workspace.home_pose(robot), samples=101)
    state = cycle.pose, cycle.velocity, cycle.acceleration
    joints = pteron.inverse_kinematics(robot, cycle.pose)
    rates = pteron.kinematics.joint_rates(robot, *state[:2]).actuated
    seconds = pteron.kinematics.joint_accelerations(robot, *state).actuated
    expected = pteron.drive_forces(robot, *state, smooth=True)
    expected /= [leg.drive.ratio for leg in robot.legs]
    pose, scale = cycle.pose[0] + 1e-3, np.abs(expected).max()
    for k in range(101):
        motion = joints[k], rates[k], seconds[k]
        status, torques, pose = call("joint_feed_forward", *motion, pose, sizes=(n, n))
        assert status == 0
        np.testing.assert_allclose(pose, cycle.pose[k], rtol=0, atol=1e-12)
        np.testing.assert_allclose(torques, expected[k], rtol=0, atol=1e-11 * scale)
    status, torques, _ = call("joint_feed_forward", *motion, pose + 10.0, sizes=(n, n))
    if name == "quadrupteron-oblique":  # J^-1 is constant over its translations: one step is all
        assert status in (0, 1)
    else:
        assert status == 1
        assert np.isnan(torques).all()


def test_drives_are_told_per_cent_where_they_ask_for_it(tmp_path):
    robot = stiff(DELTA, rated_torque=0.64)
    for output, factor in (("percent", 100.0 / 0.64), ("torque", 1.0)):
        call, header = compiled(robot, ["feed_forward"], tmp_path / output, output=output)
        state = [part[0] for part in states(robot, 1)]
        tables = pteron.parameters(robot), drive_numbers(robot)
        _, found = call("feed_forward", *state, *tables, sizes=(3,))
        forces = pteron.drive_forces(robot, *state, smooth=True)
        expected = factor * forces / [leg.drive.ratio for leg in robot.legs]
        np.testing.assert_allclose(found, expected, rtol=1e-11)
        unit = {"percent": "rated torques, 0.64 N m", "torque": "N m: forces at"}[output]
        assert unit in header


def test_what_a_drive_lacks_for_the_output_is_told_by_leg_and_key(tmp_path):
    def lacking(words, robot, output, functions=None):
        for export in (pteron.export_c, pteron.export_st):
            with pytest.raises(ModelError, match=words) as caught:
                export(robot, functions, tmp_path, output=output)
            assert "\n" not in str(caught.value)

    robot = stiff(DELTA)
    lacking(r"leg 1: drive.rated_torque: missing, but output \"percent\" needs", robot, "percent")
    legs = (*robot.legs[:2], replace(robot.legs[2], drive=pteron.legs.Drive(1.0)))
    lacking(r"leg 3: drive.ratio: missing, but", replace(robot, legs=legs), "torque")
    lacking(r"leg 1: drive.ratio: missing, but", DELTA, "torque")
    lacking("output: 'volt' is not one of force, torque, percent", robot, "volt")
    lacking("none of drive_forces, .* is written", robot, "torque", ["jacobian"])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "shared"),
    [
        pytest.param("quadrupteron", False, marks=NIGHTLY),
        pytest.param("quadrupteron-oblique", False, marks=NIGHTLY),
        ("delta", True),
        ("five-bar", False),
    ],
)
def test_code_takes_base_parameters_as_identification_lists_them(tmp_path, name, shared):
    """Any values of the printed list, through its JSON: forces are base regressor @ values."""
    robot = CATALOG[name]
    base = pteron.base_parameters(robot, shared=shared)
    values = np.random.default_rng(0).normal(size=base.rank)
    friction = [(0.5 + i, 1.0 + i, -0.3 * i) for i in range(robot.freedom)]
    path = identification_file(tmp_path / "identification.json", base, values, friction)
    functions = ["inverse_dynamics_base", "feed_forward_base"]
    call, _ = compiled(robot, functions, tmp_path / "c", base=path)
    source = next((tmp_path / "c").glob("[!t]*.c")).read_text()
    assert listed(source) == dict(zip(base.expressions(), values.tolist(), strict=True))
    folded, _ = compiled(
        robot, ["feed_forward_base"], tmp_path / "folded", base=path, specialised=True
    )
    coulomb, viscous, offset = np.array(friction).T
    drives = np.r_[0 * coulomb, coulomb, viscous, offset, 0 * coulomb, 0 * coulomb + 1.0]
    drives = np.r_[drives, np.full(robot.freedom, 1e-3)]
    for state in zip(*states(robot, 10), strict=True):
        rigid = pteron.base_regressor(robot, base, *state) @ values
        rates = pteron.kinematics.joint_rates(robot, *state[:2]).actuated
        driven = rigid + coulomb * np.tanh(rates / 1e-3) + viscous * rates + offset
        close = {"rtol": 0, "atol": 1e-12 * np.abs(driven).max()}
        n = (robot.freedom,)
        _, found = call("inverse_dynamics_base", *state, values, sizes=n)
        np.testing.assert_allclose(found, rigid, **close)
        _, found = call("feed_forward_base", *state, values, drives, sizes=n)
        np.testing.assert_allclose(found, driven, **close)
        _, found = folded("feed_forward_base", *state, sizes=n)
        np.testing.assert_allclose(found, driven, **close)


def listed(source):
    """Return the table of base parameters in C code: values by what they are."""
    table = re.search(r"_base_parameters\[\d+\] = \{\n(.*?)\n\};", source, re.DOTALL)[1]
    found = re.findall(r"(?m)^ *(\S+?),? /\* (.*), kg[^,]* \*/$", table)
    return {text: float(value.strip("()")) for value, text in found}


class Falling(Friction):
    """Friction that falls by 1 N, or 1 N m, as a joint moves faster."""

    def forces(self, rates):
        return super().forces(rates) + np.sign(rates) * np.exp(-((rates / 0.2) ** 2))


@CLIENTS
@pytest.mark.parametrize("offset", [True, False])
def test_an_identified_machine_goes_to_the_controller_as_it_was_printed(tmp_path, offset):
    """Rotors and friction too, of a machine with two cranks and an inclined slider.

    There a rotor joins mass and offset; without offsets it is a value of its own.
    """
    robot = ROBOTS["mixed"]
    legs = [
        replace(leg, drive=pteron.legs.Drive(rotor_inertia=2e-5, ratio=60.0 + i))
        for i, leg in enumerate(robot.legs)
    ]
    robot = replace(robot, legs=tuple(legs))
    size = {"size": 0.1}
    friction = Falling.of(3)
    friction = replace(friction, offset=friction.offset * offset)
    first, second = (log_of(robot, seed=seed, friction=friction, **size) for seed in (0, 1))
    result = identify(robot, first, held_out=second, terms=Terms(offset=offset, stribeck=0.2))
    assert ("J_m1" in result.model.names) == (not offset)
    assert result.machine.legs[1].drive.stribeck.force == pytest.approx(1.0, rel=0.05)
    path = tmp_path / "identification.json"
    path.write_text(json.dumps(numbers(result)))
    files = pteron.export_c(robot, "feed_forward_base", tmp_path / "c", base=path)
    source = files[1].read_text()
    values = result.base_values.tolist()
    assert listed(source) == dict(zip(result.model.expressions, values, strict=False))
    assert any("J_m" in text for text in listed(source))
    call, _ = compiled(robot, "feed_forward_base", tmp_path / "c", base=path, specialised=True)
    state = motion(robot, np.arange(100) / 100.0, seed=2, **size)
    rates = pteron.kinematics.joint_rates(robot, *state[:2]).actuated
    seconds = pteron.kinematics.joint_accelerations(robot, *state).actuated
    every = States(rates[:, 0], rates, rates, seconds, *state, np.zeros(100))
    fitted = result.model.matrix(every) @ result.estimate.values
    for k in np.flatnonzero(np.abs(rates).min(axis=-1) > 0.02):
        _, found = call("feed_forward_base", *(part[k] for part in state), sizes=(3,))
        np.testing.assert_allclose(found, fitted[k], rtol=0, atol=1e-11 * np.abs(fitted).max())


def test_identified_values_go_to_the_calibrated_machine_with_a_warning(tmp_path):
    """Not to one whose dimensions differ by more than calibration explains."""
    base = pteron.base_parameters(DELTA)
    path = identification_file(tmp_path / "i.json", base, base.values(), [(0.0, 0.0, 0.0)] * 3)
    data = json.loads(path.read_text())
    path.write_text(json.dumps(data | {"machine": machine_record(DELTA)}))

    def with_rods(factor):
        legs = [replace(leg, lower_length=factor * leg.lower_length) for leg in DELTA.legs]
        return replace(DELTA, legs=tuple(legs))

    with pytest.warns(UnlikelyValue, match=r"legs\[1\]\.lower_length .*0\.10% off"):
        pteron.export_c(with_rods(1.001), "inverse_dynamics_base", tmp_path / "c", base=path)
    with pytest.raises(DataError, match=r"legs\[1\]\.lower_length .* off\), at most 1%"):
        pteron.export_c(with_rods(1.05), "inverse_dynamics_base", tmp_path / "d", base=path)


def test_a_file_that_is_no_identification_of_the_machine_is_refused(tmp_path):
    base = pteron.base_parameters(DELTA)
    path = identification_file(tmp_path / "i.json", base, base.values(), [(0.0, 0.0, 0.0)] * 3)
    whole = json.loads(path.read_text())

    def refused(words, robot=DELTA, functions=None, error=DataError, text=None, **changes):
        path.write_text(text or json.dumps(whole | changes))
        with pytest.raises(error, match=words) as caught:
            pteron.export_c(robot, functions, tmp_path / "c", base=path)
        assert "\n" not in str(caught.value)

    refused("not an identification.json of this version", drives=None)
    refused("not an identification.json of this version", text="[]")
    refused("i.json: no JSON; give the identification.json", text="t,rho1")
    refused("values are missing", expressions=[])
    refused("values are missing", base_parameters=whole["base_parameters"] | {"values": [np.nan]})
    far = whole["base_parameters"] | {"values": [10**400]}
    refused("not an identification.json .*OverflowError", base_parameters=far)
    refused("of another machine", CATALOG["tripteron"])
    longer = [replace(leg, lower_length=leg.lower_length + 1e-3) for leg in DELTA.legs]
    refused("of another machine", replace(DELTA, legs=tuple(longer)))
    refused("R1_1: friction of passive joints", kinds=["passive"], estimate={"names": ["Fv_R1_1"]})
    refused("ask for feed_forward_base", functions=["feed_forward"], error=ModelError)
    refused("leave it out, or export the model", functions=["mass_matrix"], error=ModelError)
    with pytest.raises(DataError, match=r"no\.json: No such file"):
        pteron.export_c(DELTA, folder=tmp_path / "c", base=tmp_path / "no.json")
    assert not (tmp_path / "c").exists()


def exported_functions(robot, names):
    """Return those of the functions that the machine has, as they are exported."""
    functions = []
    for name in names:
        with suppress(ModelError):  # the machine has no such function
            functions += exported(robot, name, specialised=False)
    return functions


@pytest.mark.parametrize(
    "name", gated(["tripteron", "quadrupteron", "delta-4", "five-bar"], ["tripteron"], CLIENTS)
)
def test_no_function_is_well_where_a_pose_or_a_joint_is_no_number(name, tmp_path):
    """Not even where the outputs do not depend on it; and no output that is well is NaN."""
    robot = pteron.load(name)
    exported = [
        item
        for item in exported_functions(robot, FUNCTIONS)
        if {"pose", "joints"} & {port.name for port in item.inputs}
    ]
    call, _ = compiled(robot, [item.name for item in exported], tmp_path)
    pose = states(robot, 1)[0][0]
    given = {
        "pose": pose,
        "joints": pteron.inverse_kinematics(robot, pose),
        "parameters": pteron.parameters(robot),
        "drives": drive_numbers(robot),
    }
    rng = np.random.default_rng(0)
    for item in exported:
        inputs = [
            np.array(given.get(port.name, rng.normal(size=port.shape))) for port in item.inputs
        ]
        sizes = [port.size for port in item.outputs]
        assert call(item.name, *inputs, sizes=sizes)[0] == 0, item.name
        for k, port in enumerate(item.inputs):
            if port.name not in ("pose", "joints"):
                continue
            for j, bad in product(range(port.size), (np.nan, np.inf, -np.inf)):
                changed = [value.copy() for value in inputs]
                changed[k][j] = bad
                assert call(item.name, *changed, sizes=sizes)[0] == 1, (item.name, port, j, bad)


@pytest.mark.parametrize("name", gated(["quadrupteron", "delta"], ["delta"]))
def test_direct_kinematics_has_a_row_for_each_assembly_mode(name):
    robot = ROBOTS[name]
    for pose in states(robot, 20)[0]:
        joints = pteron.inverse_kinematics(robot, pose)
        expected = assembly_modes(robot, joints, all_branches=True)
        _, found = library(name)("direct_kinematics", joints, shape=expected.shape)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("name", "real"),
    [
        pytest.param("quadrupteron", "double", marks=NIGHTLY),
        ("quadrupteron", "float"),
        ("mixed", "double"),
    ],
)
def test_out_of_reach_there_is_a_status_and_nan_is_all_there_is(name, real):
    robot, call = ROBOTS[name], library(name, real)
    n, values = robot.freedom, pteron.parameters(robot)
    far, rest = 1.0 + np.arange(n), np.zeros(n)
    for function, inputs, shape in (
        ("inverse_kinematics", (far,), n),
        ("inverse_dynamics", (far, rest, rest, values), n),
        ("forward_dynamics", (far, rest, rest, values), n),
        ("regressor", (far, rest, rest), (n, values.size)),
    ):
        status, found = call(function, *inputs, shape=shape)
        assert status == 1
        assert np.isnan(found).any()
        assert not (found == 77.0).any()
    apart = np.array([20.0, 0.0, 0.0, -20.0][:n])
    status, poses = call("direct_kinematics", apart, shape=(2, n))
    assert status == 1
    assert np.isnan(poses).all()
    nan = np.full(n, np.nan)
    assert call("inverse_kinematics", nan, shape=n)[0] == 1
    home = pteron.random_poses(robot, 1)[0]
    status, found = call("inverse_dynamics", home, nan, rest, values, shape=n)
    assert status == 2
    assert np.isnan(found).any()


def test_one_leg_out_of_reach_leaves_the_others_right():
    pose = np.array([0.0, 0.2, 0.0, 0.0])
    status, found = library("quadrupteron")("inverse_kinematics", pose, shape=4)
    expected = pteron.compile(ROBOT, "inverse_kinematics")(pose)
    assert status == 1
    assert 0 < np.isnan(expected).sum() < 4
    np.testing.assert_array_equal(found, expected)


def test_no_pose_sets_off_a_floating_point_trap(tmp_path):
    """With traps on, as some controllers have them: singular, out of reach, at the edge."""
    poses = {
        "quadrupteron": [
            [0, 0, 0.05, 0.1],
            [5, 5, 5, 0],
            [0, 0, 0, np.pi / 2],
            [0.055, 0, 0, 0],
            [-0.22, 0, 0, 0],
            [0.26, 0, 0, 0],
        ],
        # Level with the cranks, on a crank's axis, rods in a plane, a leg stretched.
        "delta": [[0, 0, -0.9], [5, 5, 5], [0, 0, 0], [0.205, 0, 0], [1.68, 0, 0], [0, 0, -1.4605]],
    }
    for name, rows in poses.items():
        pteron.export_c(ROBOTS[name], folder=tmp_path)
        n = len(rows[0])
        calls = {
            "inverse_kinematics": "p, joints",
            "jacobian": "p, out",
            "inverse_dynamics": f"p, rest, rest, {name}_parameters, out",
            "inverse_dynamics_base": f"p, rest, rest, {name}_base_parameters, out",
            "forward_dynamics": f"p, rest, rest, {name}_parameters, out",
            "regressor": "p, rest, rest, out",
            "direct_kinematics": "turns, out",
        }
        printed = [f'printf("%d", {name}_{f}({given}));' for f, given in calls.items()]
        table = ", ".join(f"{{{', '.join(map(repr, map(float, row)))}}}" for row in rows)
        (tmp_path / "traps.c").write_text(
            textwrap.dedent(f"""
            #define _GNU_SOURCE
            #include <fenv.h>
            #include <stdio.h>
            #include "{name}.h"
            int main(void)
            {{
                static const double poses[6][{n}] = {{{table}}};
                const double rest[4] = {{0.1, 0.2, 0.3, 0.4}};
                double joints[4], turns[4], out[160];
                feenableexcept(FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW);
                for (int k = 0; k < 6; k++) {{
                    const double *p = poses[k];
                    for (int j = 0; j < 4; j++) turns[j] = (double)(j * k);
                    {" ".join(printed)}
                    printf(" ");
                }}
                return 0;
            }}
            """)
        )
        build(tmp_path, ["traps.c", f"{name}.c"], "-std=gnu99")
        code, output = run(tmp_path)
        assert code == 0, output
        found = output.split()
        assert len(found) == 6
        assert found[0] == "0000000"
        assert found[1][0] == "1"
        assert found[1][2:6] == "1111"


@CLIENTS
@pytest.mark.parametrize(("real", "size"), [("double", 1e19), ("float", 1e3)])
def test_large_numbers_overflow_no_sooner_than_the_documents_say(real, size, tmp_path):
    """Gains, motions and poses all as large; flags tell as traps do."""
    fenv = ctypes.CDLL(None)
    flags = 0x0D  # FE_INVALID, FE_DIVBYZERO and FE_OVERFLOW of x86
    if platform.machine() not in ("x86_64", "AMD64") or not hasattr(fenv, "fetestexcept"):
        pytest.skip("flags of another processor")
    robot, rng = CATALOG["delta"], np.random.default_rng(0)
    names = [name for name in pteron.kernels.FUNCTIONS if name not in ("base_regressor", *LARGE)]
    functions = exported_functions(robot, names)
    call, _ = compiled(robot, [item.name for item in functions], tmp_path, real=real)
    known = {"parameters": pteron.parameters(robot), "drives": drive_numbers(robot)}
    for item in functions:
        inputs = [
            np.array(known[p.name])
            if p.name in known
            else size * rng.choice([-1.0, 1.0], size=p.shape) * rng.uniform(0.3, 1.0, size=p.shape)
            for p in item.inputs
        ]
        fenv.feclearexcept(flags)
        call(item.name, *inputs, sizes=[port.size for port in item.outputs])
        assert fenv.fetestexcept(flags) == 0, item.name


def test_the_code_is_what_a_controller_asks_for_and_a_person_can_read(tmp_path):
    files = pteron.export_c(ROBOT, folder=tmp_path)
    header, source = files[0].read_text(), files[1].read_text()
    assert "#include <math.h>" in source
    for word in ("malloc", "static double ", "goto", "stdio"):
        assert word not in source.replace("static double quadrupteron_", "")
    body = source.split("int quadrupteron_inverse_dynamics(")[1].split("\n}\n")[0]
    assert body.count("return ") == 1
    assert pteron.__version__ in header
    assert "pose (4): platform pose in the base frame: x, y, z in m, phi in rad" in header
    assert "It does not ask whether the legs reach." in header
    count = pteron.compile(ROBOT, "inverse_dynamics", grade="parametric").operations
    assert f"{count} arithmetic operations." in header
    assert all(len(line) <= 200 for line in source.splitlines())
    assert source.isascii()


def names_in(source, function):
    """Return the names of a function's intermediate quantities that are more than a number."""
    body = re.search(rf"\nint \w+_{function}\(.*?\n}}\n", source, re.DOTALL)[0]
    found = re.findall(r"const double (\w+) =", body)
    assert len(set(found)) == len(found)
    return [name for name in found if not re.fullmatch(r"t\d+|leg\d+_\d+", name)]


def test_intermediate_quantities_have_the_names_of_the_equations(tmp_path):
    """However sums were regrouped: a value that is a known quantity is called after it."""
    known = {
        "quadrupteron": (60, {"cos_phi", "leg1_u_a", "leg3_delta", "leg4_theta_l_acceleration"}),
        "delta": (34, {"leg1_n2", "leg2_quarter", "leg3_l_l_z", "leg3_joint_acceleration"}),
    }
    for name, (least, expected) in known.items():
        files = pteron.export_c(
            ROBOTS[name], ["inverse_dynamics", "direct_kinematics"], tmp_path / name
        )
        source = files[1].read_text()
        found = names_in(source, "inverse_dynamics")
        assert len(found) >= least
        assert set(found) >= expected
        assert len(names_in(source, "direct_kinematics")) >= 20


def test_what_the_joints_are_is_said(tmp_path):
    texts = {
        name: pteron.export_c(ROBOTS[name], ["direct_kinematics", "inverse_dynamics"], tmp_path)[
            0
        ].read_text()
        for name in ("delta", "mixed", "quadrupteron")
    }
    assert "in  joints (3): joint coordinates leg by leg, rad\n" in texts["delta"]
    assert "out forces (3): actuator forces leg by leg, N m, positive" in texts["delta"]
    assert "out forces (3): actuator forces leg by leg, N, N m, N m, positive" in texts["mixed"]
    assert "bent the other way" in texts["mixed"]
    assert "bent the other way" not in texts["quadrupteron"]
    assert all("Each row is one assembly mode" in text for text in texts.values())


@pytest.mark.parametrize("name", ["five_bar", "quadrupteron"])
def test_every_argument_and_result_of_every_function_has_its_meaning_and_units(tmp_path, name):
    left_out = ("base_regressor", "paper_regressor")
    names = [n for n in pteron.kernels.FUNCTIONS if n not in left_out]
    header = pteron.export_c(ROBOTS[name], names, tmp_path)[0].read_text()
    lines = [line for line in header.splitlines() if line.startswith((" * in  ", " * out "))]
    assert len(lines) > 2 * len(names)
    assert not [line for line in lines if line.rstrip().endswith("):")]
    text = " ".join(header.replace("\n *", " ").split())
    along = f"N along {', '.join(ROBOTS[name].platform.lengths)}"
    along += " and N m along phi" if name == "quadrupteron" else ""
    assert f"out gravity ({ROBOTS[name].freedom}): generalised forces in the order of the" in text
    assert f"pose, {along}" in text
    assert "platform pose in the base frame: x, " in text


def test_a_wrench_on_the_platform_is_an_input_where_it_is_asked_for(tmp_path):
    names = ["inverse_dynamics", "jacobian"]
    for wrench in (False, True):
        header = pteron.export_c(DELTA, names, tmp_path, wrench=wrench)[0].read_text()
        assert ("in  wrench (3): wrench on the platform at P: N\n" in header) == wrench


def test_a_name_stays_inside_its_comment(tmp_path):
    robot = replace(ROBOT, name='9 */ #error "x" \\')
    files = pteron.export_c(robot, ["jacobian"], tmp_path)
    assert re.fullmatch(r"robot_9_error_x_[0-9a-f]{6}\.h", files[0].name)
    build(tmp_path, [files[1].name, files[2].name])
    blocks = pteron.export_st(replace(ROBOT, name="a *) b"), folder=tmp_path)
    assert blocks[0].read_text().count("*)") == blocks[0].read_text().count("(*")


def test_a_file_s_text_stays_inside_its_comment(tmp_path):
    base = pteron.base_parameters(DELTA)
    path = identification_file(tmp_path / "i.json", base, base.values(), [(0.0, 0.0, 0.0)] * 3)
    data = json.loads(path.read_text())
    data["expressions"][0] = data["verdict"]["grade"] = '*/ #error "x" (* \\\n /*'
    path.write_text(json.dumps(data))
    files = pteron.export_c(DELTA, "inverse_dynamics_base", tmp_path, base=path)
    build(tmp_path, [files[1].name, files[2].name])
    (block,) = pteron.export_st(DELTA, "inverse_dynamics_base", tmp_path, base=path)
    assert block.read_text().count("*)") == block.read_text().count("(*")


@CLIENTS
def test_a_project_for_cmake(tmp_path):
    if shutil.which("cmake") is None:
        pytest.skip("cmake is not installed")
    pteron.export_c(CATALOG["tripteron"], ["inverse_kinematics"], tmp_path)
    for command in (["cmake", "-S", ".", "-B", "out"], ["cmake", "--build", "out"]):
        subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    done = subprocess.run(
        ["ctest"], cwd=tmp_path / "out", capture_output=True, text=True, check=True
    )
    assert "100% tests passed" in done.stdout


def test_what_cannot_be_written_is_said(tmp_path):
    with pytest.raises(ModelError, match="functions: 'inverse' cannot be exported; choose from"):
        pteron.export_c(ROBOT, ["inverse"], tmp_path)
    with pytest.raises(ModelError, match="functions: none given"):
        pteron.export_c(ROBOT, [], tmp_path)
    with pytest.raises(ModelError, match="real: 'half' is neither"):
        pteron.export_c(ROBOT, folder=tmp_path, real="half")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="it is a file"):
        pteron.export_c(ROBOT, ["jacobian"], tmp_path / "file")


@CLIENTS
def test_an_edited_file_is_replaced_aloud_and_another_s_file_refused(tmp_path):
    runner = CliRunner()
    folder = tmp_path / "c"
    arguments = ["export", "five-bar", "--c", str(folder), "--function", "jacobian", "--json"]

    def replaced():
        result = runner.invoke(app, arguments)
        assert result.exit_code == 0, result.stderr
        return json.loads(result.stdout)["replaced"]

    assert replaced() == []
    assert replaced() == []
    header = folder / "five_bar.h"
    original = header.read_text()
    header.write_text(original + "/* an edit */")
    assert replaced() == [str(header)]
    assert header.read_text() == original
    header.write_text(original + "/* an edit */")
    assert f"Replaced: {header}\n" in runner.invoke(app, arguments[:-1]).stdout
    foreign = folder / "CMakeLists.txt"
    foreign.write_text("project(mine)")
    header.unlink()
    result = runner.invoke(app, arguments)
    assert result.exit_code == 2
    assert "is there already, and Pteron did not write it" in result.stderr.replace("\n", " ")
    assert foreign.read_text() == "project(mine)"
    assert not header.exists()


def test_the_command(tmp_path):
    runner = CliRunner()
    arguments = ["export", "delta", "--c", str(tmp_path / "c"), "--st", str(tmp_path / "st")]
    result = runner.invoke(app, [*arguments, "--function", "inverse_kinematics"])
    assert result.exit_code == 0
    assert (tmp_path / "c" / "delta.h").exists()
    assert (tmp_path / "st" / "Delta_InverseKinematics.st").exists()
    assert result.output.count("Written:") == 5
    single = ["export", "quadrupteron", "--elbows", "+-+-", "--float", "--function", "jacobian"]
    result = runner.invoke(app, [*single, "--c", str(tmp_path / "f"), "--json"])
    assert '"robot": "quadrupteron"' in result.output
    assert "const float *QUADRUPTERON_RESTRICT pose" in (tmp_path / "f/quadrupteron.h").read_text()
    robot = pteron.save(stiff(DELTA, rated_torque=0.64), tmp_path / "robot.toml")
    base = pteron.base_parameters(DELTA)
    path = identification_file(tmp_path / "i.json", base, base.values(), [(1.0, 2.0, 0.0)] * 3)
    told = ["export", str(robot), "--c", str(tmp_path / "t"), "--output", "percent"]
    result = runner.invoke(app, [*told, "--base", str(path)])
    assert result.exit_code == 0, result.stderr
    told_of = f"Warning: {path}: the verdict on these values is: usable with care"
    assert result.stderr.replace("\n", "") == told_of
    header = (tmp_path / "t" / "delta.h").read_text()
    assert "Verdict of the identification: usable with care." in header.replace("\n * ", " ")
    assert "out percent_of_rated (3): per cent of the motors' rated torques, 0.64 N m" in header
    functions = re.findall(r"(?m)^int delta_(\w+)\(", header)
    assert functions == [
        *("inverse_kinematics", "direct_kinematics", "jacobian", "inverse_dynamics_base"),
        *("regressor", "feed_forward_base", "joint_feed_forward_base", "set_payload_base"),
    ]
    for wrong, words in (
        ([*told, "--base", str(robot)], "robot.toml: no JSON"),
        (
            ["export", "delta", "--c", str(tmp_path / "n"), "--output", "torque"],
            "leg 1: drive.ratio",
        ),
        ([*told[:-1], "volt"], "'volt'"),
    ):
        result = runner.invoke(app, wrong)
        assert result.exit_code == 2
        assert words in result.stderr
        assert result.stderr.count("\n") == 1 or "volt" in words
    assert not (tmp_path / "n").exists()
