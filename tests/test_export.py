"""Code for controllers: compiled without a warning, run, and compared with the library."""

import ctypes
import shutil
import subprocess
import textwrap

import numpy as np
import pytest
from mechanisms import CATALOG, MECHANISMS, states
from typer.testing import CliRunner

import pteron
from pteron.cli.main import app
from pteron.errors import ModelError, OutputError
from pteron.export import FUNCTIONS
from pteron.export.c import prefix_of

ROBOT = CATALOG["quadrupteron"]
COMPILERS = {
    "gcc": ["gcc", "-std=c99"],
    "g++": ["g++", "-x", "c++"],
    "clang": ["clang", "-std=c99"],
    "clang++": ["clang++", "-x", "c++"],
}
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror"]
WARNINGS += ["-Wdouble-promotion", "-Wfloat-conversion"]


def build(command, folder, sources, output, *flags):
    # -O1 sees all that is warned of, in half the time of -O2.
    done = subprocess.run(
        [*command, "-O1", *WARNINGS, *flags, *sources, "-o", output, "-lm"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[:2000]


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("name", CATALOG)
def test_it_compiles_without_a_warning_and_its_test_program_passes(tmp_path, name, real, compiler):
    command = COMPILERS[compiler]
    if shutil.which(command[0]) is None:
        pytest.skip(f"{compiler} is not installed")
    specialised = (real == "float") != (compiler == "gcc")
    files = pteron.export_c(CATALOG[name], folder=tmp_path, real=real, specialised=specialised)
    source, test = files[1].name, files[2].name
    build(command, tmp_path, [source, test], "run")
    done = subprocess.run([tmp_path / "run"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "all functions agree with the library\n")


def test_the_test_program_can_fail(tmp_path):
    pteron.export_c(ROBOT, ["jacobian"], tmp_path)
    source = tmp_path / "quadrupteron.c"
    source.write_text(source.read_text().replace("0.04", "0.05"))
    build(COMPILERS["gcc"], tmp_path, ["quadrupteron.c", "test_quadrupteron.c"], "run")
    done = subprocess.run([tmp_path / "run"], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "jacobian: off by" in done.stdout


def library(robot, folder, real="double", **options):
    """Return the exported functions, called with arrays."""
    files = pteron.export_c(robot, folder=folder, real=real, **options)
    build(COMPILERS["gcc"], folder, [files[1].name], "code.so", "-shared", "-fPIC")
    loaded = ctypes.CDLL(str(folder / "code.so"))
    dtype = np.float32 if real == "float" else np.float64

    def call(name, *inputs, shape):
        output = np.full(shape, 77.0, dtype)
        arrays = [np.ascontiguousarray(value, dtype) for value in inputs]
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in (*arrays, output)]
        status = getattr(loaded, f"{prefix_of(robot)}_{name}")(*pointers)
        return status, output

    return call


@pytest.mark.parametrize(
    "name", ["quadrupteron", "quadrupteron-oblique +--+", "tripteron-oblique", "random 3T1R 1"]
)
def test_random_states_give_what_the_virtual_machine_gives(tmp_path, name):
    robot = MECHANISMS[name]
    call = library(robot, tmp_path)
    n = robot.freedom
    values = pteron.parameters(robot)
    base = pteron.compile(
        robot, "inverse_dynamics", base=pteron.cheapest_parameters(robot), grade="parametric"
    ).fixed["base_parameters"]
    for pose, velocity, acceleration in zip(*states(robot, 60), strict=True):
        sliders = pteron.inverse_kinematics(robot, pose)
        motion = pose, velocity, acceleration
        forces = pteron.inverse_dynamics(robot, *motion)
        cases = {
            "inverse_kinematics": ((pose,), sliders),
            "direct_kinematics": ((sliders,), pteron.direct_kinematics(robot, sliders)),
            "jacobian": ((pose,), pteron.jacobian(robot, pose)),
            "inverse_dynamics": ((*motion, values), forces),
            "inverse_dynamics_base": ((*motion, base), forces),
            "forward_dynamics": (
                (pose, velocity, forces, values),
                pteron.forward_dynamics(robot, pose, velocity, forces),
            ),
            "regressor": (motion, pteron.regressor(robot, *motion)),
        }
        assert set(cases) == set(FUNCTIONS)
        for function, (inputs, expected) in cases.items():
            status, found = call(function, *inputs, shape=expected.shape)
            assert status == 0
            # From base parameters it is another sum of the same forces.
            tolerance = 1e-12 if function == "inverse_dynamics_base" else 1e-13
            np.testing.assert_array_equal(np.isnan(found), np.isnan(expected))
            error = np.nanmax(np.abs(found - expected)) / np.nanmax(np.abs(expected))
            assert error < tolerance, (function, n)


@pytest.mark.parametrize("real", ["double", "float"])
def test_out_of_reach_there_is_a_status_and_nan_is_all_there_is(tmp_path, real):
    call = library(ROBOT, tmp_path, real)
    far, rest = np.array([1.0, 2.0, 3.0, 0.1]), np.zeros(4)
    values = pteron.parameters(ROBOT)
    for function, inputs, shape in (
        ("inverse_kinematics", (far,), 4),
        ("inverse_dynamics", (far, rest, rest, values), 4),
        ("forward_dynamics", (far, rest, rest, values), 4),
        ("regressor", (far, rest, rest), (4, 40)),
    ):
        status, found = call(function, *inputs, shape=shape)
        assert status == 1
        assert np.isnan(found).any()
        assert not (found == 77.0).any()
    status, poses = call("direct_kinematics", [0.0, 5.0, 0.0, -5.0], shape=(2, 4))
    assert status == 1
    assert np.isnan(poses).all()
    nan = np.array([np.nan, 0.0, 0.0, 0.0])
    assert call("inverse_kinematics", nan, shape=4)[0] == 1
    home = np.array([0.0, 0.0, 0.05, 0.1])
    status, found = call("inverse_dynamics", home, nan, rest, values, shape=4)
    assert status == 2
    assert np.isnan(found).any()


def test_one_leg_out_of_reach_leaves_the_others_right(tmp_path):
    call = library(ROBOT, tmp_path)
    pose = np.array([0.0, 0.2, 0.0, 0.0])
    with pytest.raises(pteron.UnreachablePose):
        pteron.inverse_kinematics(ROBOT, pose)
    status, found = call("inverse_kinematics", pose, shape=4)
    expected = pteron.compile(ROBOT, "inverse_kinematics")(pose)
    assert status == 1
    assert 0 < np.isnan(expected).sum() < 4
    np.testing.assert_array_equal(found, expected)


def test_no_pose_sets_off_a_floating_point_trap(tmp_path):
    """With traps on, as some controllers have them: singular, out of reach, at the edge."""
    pteron.export_c(ROBOT, folder=tmp_path)
    (tmp_path / "traps.c").write_text(
        textwrap.dedent("""
        #define _GNU_SOURCE
        #include <fenv.h>
        #include <stdio.h>
        #include "quadrupteron.h"
        int main(void)
        {
            static const double poses[6][4] = {
                {0, 0, 0.05, 0.1}, {5, 5, 5, 0}, {0, 0, 0, 1.5707963267948966},
                {0.055, 0, 0, 0}, {-0.22, 0, 0, 0}, {0.26, 0, 0, 0}};
            const double rest[4] = {0.1, 0.2, 0.3, 0.4};
            double forces[4], sliders[4], jacobian[16], acceleration[4], regressor[160], out[8];
            feenableexcept(FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW);
            for (int k = 0; k < 6; k++) {
                const double *p = poses[k];
                const double *q = quadrupteron_parameters;
                printf("%d", quadrupteron_inverse_kinematics(p, sliders));
                printf("%d", quadrupteron_jacobian(p, jacobian));
                printf("%d", quadrupteron_inverse_dynamics(p, rest, rest, q, forces));
                printf("%d", quadrupteron_inverse_dynamics_base(
                    p, rest, rest, quadrupteron_base_parameters, forces));
                printf("%d", quadrupteron_forward_dynamics(p, rest, rest, q, acceleration));
                printf("%d", quadrupteron_regressor(p, rest, rest, regressor));
                for (int j = 0; j < 4; j++) sliders[j] = (double)(j * k);
                printf("%d ", quadrupteron_direct_kinematics(sliders, out));
            }
            return 0;
        }
        """)
    )
    subprocess.run(
        ["gcc", "-std=gnu99", "-O2", "traps.c", "quadrupteron.c", "-o", "traps", "-lm"],
        cwd=tmp_path,
        check=True,
    )
    done = subprocess.run([tmp_path / "traps"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    codes = done.stdout.split()
    assert len(codes) == 6
    assert codes[0] == "0000000"
    assert codes[1][0] == "1"
    assert codes[1][2:4] == "11"


def test_the_code_is_what_a_controller_asks_for(tmp_path):
    files = pteron.export_c(ROBOT, folder=tmp_path)
    header, source = files[0].read_text(), files[1].read_text()
    assert "#include <math.h>" in source
    for word in ("malloc", "static double ", "goto", "stdio"):
        assert word not in source.replace("static double quadrupteron_", "")
    body = source.split("int quadrupteron_inverse_dynamics(")[1].split("\n}\n")[0]
    assert body.count("return ") == 1
    assert "leg2_u_b" in body
    assert pteron.__version__ in header
    assert "pose (4): platform pose: x, y, z in m, phi in rad" in header
    count = pteron.compile(ROBOT, "inverse_dynamics", grade="parametric").operations
    assert f"{count} arithmetic operations." in header
    assert all(len(line) <= 200 for line in source.splitlines())
    assert source.isascii()


def test_a_name_stays_inside_its_comment(tmp_path):
    import dataclasses

    robot = dataclasses.replace(ROBOT, name='9 */ #error "x" \\')
    files = pteron.export_c(robot, ["jacobian"], tmp_path)
    assert files[0].name == "robot_9_error_x.h"
    build(COMPILERS["gcc"], tmp_path, [files[1].name, files[2].name], "run")
    blocks = pteron.export_st(dataclasses.replace(ROBOT, name="a *) b"), folder=tmp_path)
    assert blocks[0].read_text().count("*)") == blocks[0].read_text().count("(*")


def test_every_function_can_be_exported(tmp_path):
    names = [name for name in pteron.kernels.FUNCTIONS if name != "base_regressor"]
    files = pteron.export_c(CATALOG["tripteron"], names, tmp_path)
    build(COMPILERS["gcc"], tmp_path, [files[1].name, files[2].name], "run")
    done = subprocess.run([tmp_path / "run"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


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
    arguments = ["export", "tripteron", "--c", str(tmp_path / "c"), "--st", str(tmp_path / "st")]
    result = runner.invoke(app, arguments)
    assert result.exit_code == 0
    assert (tmp_path / "c" / "tripteron.h").exists()
    assert (tmp_path / "st" / "Tripteron_InverseDynamics.st").exists()
    assert result.output.count("Written:") == 6
    single = ["export", "quadrupteron", "--elbows", "+-+-", "--float", "--function", "jacobian"]
    result = runner.invoke(app, [*single, "--c", str(tmp_path / "f"), "--json"])
    assert '"robot": "quadrupteron"' in result.output
    assert "const float *QUADRUPTERON_RESTRICT pose" in (tmp_path / "f/quadrupteron.h").read_text()
