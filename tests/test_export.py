"""Code for controllers: compiled without a warning, run, and compared with the library."""

import ctypes
import re
import shutil
import subprocess
import textwrap
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
from mechanisms import CATALOG, states, with_elbows
from typer.testing import CliRunner

import pteron
from pteron.cli.main import app
from pteron.equations.drives import drive_numbers
from pteron.errors import ModelError, OutputError
from pteron.export import FUNCTIONS
from pteron.kernels import columns_of
from pteron.kinematics import assembly_modes

ROBOT, DELTA = CATALOG["quadrupteron"], CATALOG["delta"]
SLIDER = pteron.Leg(
    guide_point=(0.1, 0.55, -0.5),
    direction=(1.0, 0.0, 0.0),
    slider_direction=(0.8, 0.0, 0.6),
    platform_point=(0.125, 0.0, 0.01),
    upper_length=0.5,
    lower_length=0.45,
    slider_mass=1.3,
    upper=pteron.PlanarInertia.of_body(1.1, (0.2, 0.01), 0.08),
    lower=pteron.PlanarInertia.of_body(0.9, (-0.21, -0.02), 0.07),
    elbow=-1,
)


def with_drives(robot):
    drive = pteron.Drive(3.0, 2.0, 0.1, 2e-5, 50.0, stribeck=pteron.Stribeck(1.0, 0.1))
    return replace(robot, legs=tuple(replace(leg, drive=drive) for leg in robot.legs))


ROBOTS = {
    "quadrupteron": ROBOT,
    "oblique": replace(with_elbows(CATALOG["tripteron-oblique"], "--+"), name="oblique"),
    "delta": DELTA,
    "mixed": replace(DELTA, name="mixed", legs=(SLIDER, *DELTA.legs[1:])),
    "par4": with_drives(CATALOG["par4"]),
    "five_bar": replace(CATALOG["five-bar"], name="five_bar"),
}

NOT_CLOSED = tuple(name for name in FUNCTIONS if name != "direct_kinematics")

COMPILERS = {
    "gcc": ["gcc", "-std=c99"],
    "g++": ["g++", "-x", "c++"],
    "clang": ["clang", "-std=c99"],
}
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror"]
WARNINGS += ["-Wdouble-promotion", "-Wfloat-conversion"]


def build(folder, sources, *flags, compiler="gcc"):
    # -O1 sees all that is warned of, in half the time of -O2.
    done = subprocess.run(
        [*COMPILERS[compiler], "-O1", *WARNINGS, *flags, *sources, "-o", "run", "-lm"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[:2000]


def run(folder):
    done = subprocess.run([folder / "run"], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout


@pytest.mark.parametrize(
    ("name", "real", "compiler"),
    [
        *((name, "float", "gcc") for name in ROBOTS),
        ("delta", "double", "g++"),
        ("delta", "double", "clang"),
        ("quadrupteron", "float", "g++"),
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


def test_every_function_can_be_exported_and_the_test_program_can_fail(tmp_path):
    names = [name for name in pteron.kernels.FUNCTIONS if name != "base_regressor"]
    pteron.export_c(DELTA, names, tmp_path)
    build(tmp_path, ["delta.c", "test_delta.c"])
    assert run(tmp_path)[0] == 0
    source = tmp_path / "delta.c"
    source.write_text(source.read_text().replace("0.205", "0.206"))
    build(tmp_path, ["delta.c", "test_delta.c"])
    code, output = run(tmp_path)
    assert code == 1
    assert "jacobian: off by" in output


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


@pytest.mark.parametrize("name", ROBOTS)
def test_random_states_give_the_bits_that_casadi_gives(name):
    robot, call = ROBOTS[name], library(name)
    base = pteron.cheapest_parameters(robot)
    given = {"parameters": pteron.parameters(robot), "base_parameters": base.values()}
    given["drives"] = drive_numbers(robot)
    for pose, velocity, acceleration in zip(*states(robot, 20), strict=True):
        given |= {"pose": pose, "velocity": velocity, "acceleration": acceleration}
        given["joints"] = pteron.inverse_kinematics(robot, pose)
        given["forces"] = pteron.inverse_dynamics(robot, pose, velocity, acceleration)
        functions = FUNCTIONS if name != "par4" else (*NOT_CLOSED, "feed_forward")
        for function in functions:
            columns = columns_of(base) if function.endswith("_base") else None
            program = pteron.kernels.program(robot, function.removesuffix("_base"), columns)
            inputs = [given[port.name] for port in program.inputs]
            (expected,) = program.function.call(inputs)
            status, found = call(function, *inputs, shape=expected.numel())
            assert status == 0
            np.testing.assert_array_equal(found, np.array(expected).ravel("F"), function)


@pytest.mark.parametrize("name", ["quadrupteron", "delta"])
def test_direct_kinematics_has_a_row_for_each_assembly_mode(name):
    robot = ROBOTS[name]
    for pose in states(robot, 20)[0]:
        joints = pteron.inverse_kinematics(robot, pose)
        expected = assembly_modes(robot, joints, all_branches=True)
        _, found = library(name)("direct_kinematics", joints, shape=expected.shape)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("name", "real"), [("quadrupteron", "double"), ("quadrupteron", "float"), ("mixed", "double")]
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


def test_the_code_is_what_a_controller_asks_for_and_a_person_can_read(tmp_path):
    files = pteron.export_c(ROBOT, folder=tmp_path)
    header, source = files[0].read_text(), files[1].read_text()
    assert "#include <math.h>" in source
    for word in ("malloc", "static double ", "goto", "stdio"):
        assert word not in source.replace("static double quadrupteron_", "")
    body = source.split("int quadrupteron_inverse_dynamics(")[1].split("\n}\n")[0]
    assert body.count("return ") == 1
    assert pteron.__version__ in header
    assert "pose (4): platform pose: x, y, z in m, phi in rad" in header
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
    assert "in  joints (3): joint coordinates, rad\n" in texts["delta"]
    assert "out forces (3): actuator forces, N m, positive" in texts["delta"]
    assert "out forces (3): actuator forces, N, N m, N m (leg by leg), positive" in texts["mixed"]
    assert "bent the other way" in texts["mixed"]
    assert "bent the other way" not in texts["quadrupteron"]
    assert all("Each row is one assembly mode" in text for text in texts.values())


def test_a_wrench_on_the_platform_is_an_input_where_it_is_asked_for(tmp_path):
    names = ["inverse_dynamics", "jacobian"]
    for wrench in (False, True):
        header = pteron.export_c(DELTA, names, tmp_path, wrench=wrench)[0].read_text()
        assert ("in  wrench (3): wrench on the platform at P: N\n" in header) == wrench


def test_a_name_stays_inside_its_comment(tmp_path):
    robot = replace(ROBOT, name='9 */ #error "x" \\')
    files = pteron.export_c(robot, ["jacobian"], tmp_path)
    assert files[0].name == "robot_9_error_x.h"
    build(tmp_path, [files[1].name, files[2].name])
    blocks = pteron.export_st(replace(ROBOT, name="a *) b"), folder=tmp_path)
    assert blocks[0].read_text().count("*)") == blocks[0].read_text().count("(*")


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
