"""Kernels and loops on a GPU that the host emulates: the bits of the target "c".

The CUDA code is compiled by g++ for the host; NVIDIA's compiler, which needs no GPU, compiles it
for two generations of GPUs. Nothing here has run on a GPU.
"""

import json
import re
import subprocess
import sys
from dataclasses import replace
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import nvrtc
import pytest
from commands import refused, run
from emulated_gpu import BLOCK, GRID, DeviceArray, emulated, far_apart, sanitized
from exported_code import compiled
from mechanisms import CATALOG, CLIENTS, gated

import pteron
from pteron.controllers import ComputedTorque, PDGravity
from pteron.export import export_cuda
from pteron.export.functions import exported_functions
from pteron.kernels import FUNCTIONS
from pteron.kernels.loops import loop
from pteron.legs import Drive, Elastic
from pteron.motion import Sensors, machines_about, pick_and_place, simulate_many

GATE = ("quadrupteron", "delta", "3-rrr")
FEW = ("inverse_kinematics", "inverse_dynamics", "direct_step")
BAD = (np.nan, 1e3, 1e6, np.inf, -np.inf)


@pytest.fixture
def cupy():
    """Return the emulated GPU in CuPy's place."""
    with emulated() as module:
        yield module


def arguments_of(kernel, robot, count=30, seed=0):
    """Return inputs of states, some out of reach, one each with a number of `BAD`."""
    rng = np.random.default_rng(seed)
    poses = pteron.random_poses(robot, count, seed=seed)
    joints = pteron.inverse_kinematics(robot, poses)
    poses[:3] += 0.5 * rng.normal(size=poses[:3].shape)
    known = {"pose": poses, "joints": joints}
    inputs = [
        known.get(port.name, rng.normal(size=(count, *port.shape)))[0 if port.shared else ...]
        for port in kernel.inputs
    ]
    states = [array for array, port in zip(inputs, kernel.inputs, strict=True) if not port.shared]
    for k, number in enumerate(BAD if states else ()):
        states[k % len(states)][5 + k].flat[0] = number
    return inputs


def outputs_of(kernel, inputs):
    """Return the outputs as a tuple of arrays."""
    outputs = kernel(*inputs)
    return outputs if isinstance(outputs, tuple) else (outputs,)


def expect_bits_of_c(cupy, robot, what, **options):
    """Compare the results of both targets, bit for bit; return whether there is such a function."""
    try:
        host = pteron.compile(robot, what, "c", **options)
    except pteron.ModelError:
        return False
    device = pteron.compile(robot, what, "cuda", **options)
    inputs = arguments_of(host, robot)
    present = outputs_of(device, [cupy.asarray(array, host.dtype) for array in inputs])
    for expected, result in zip(outputs_of(host, inputs), present, strict=True):
        assert isinstance(result, DeviceArray)
        np.testing.assert_array_equal(np.asarray(result), expected, err_msg=what)
    return True


@pytest.mark.parametrize("name", GATE)
def test_kernels_have_the_bits_of_c(cupy, name):
    assert sum(expect_bits_of_c(cupy, CATALOG[name], what) for what in FEW) == 3


@CLIENTS
@pytest.mark.parametrize("name", gated(pteron.catalog(), ["delta"]))
def test_every_function_has_the_bits_of_c(cupy, name):
    assert sum(expect_bits_of_c(cupy, pteron.load(name), what) for what in FUNCTIONS) > 40
    for options in ({"dtype": "float32"}, {"grade": "parametric"}, {"grade": "general"}):
        assert expect_bits_of_c(cupy, pteron.load(name), "inverse_dynamics", **options)


@pytest.mark.parametrize("options", [{"dtype": "float32"}, {"grade": "parametric"}])
def test_other_numbers_and_inputs_too(cupy, options):
    assert expect_bits_of_c(cupy, CATALOG["delta"], "inverse_dynamics", **options)


def test_arrays_may_have_any_strides(cupy):
    robot = CATALOG["delta"]
    kernel = pteron.compile(robot, "inverse_kinematics", "cuda")
    poses = pteron.random_poses(robot, 24)
    expected = pteron.inverse_kinematics(robot, poses)
    columns = cupy.asarray(np.ascontiguousarray(poses.T)).T
    by_columns = kernel(columns)
    assert by_columns.strides == columns.strides
    np.testing.assert_array_equal(by_columns.get(), expected)
    np.testing.assert_array_equal(kernel(cupy.asarray(poses)[::2]).get(), expected[::2])
    np.testing.assert_array_equal(
        kernel(cupy.asarray(poses.reshape(4, 6, 3))).get(), expected.reshape(4, 6, 3)
    )
    np.testing.assert_array_equal(kernel(poses[5]).get(), expected[5])
    assert kernel(cupy.empty((0, 3))).shape == (0, 3)
    assert kernel(cupy.empty((2, 0, 3))).shape == (2, 0, 3)


def test_leading_axes_broadcast(cupy):
    robot = CATALOG["quadrupteron"]
    poses, rates = pteron.random_poses(robot, 3), np.random.default_rng(0).normal(size=(5, 1, 4))
    kernel = pteron.compile(robot, "inverse_dynamics", "cuda")
    expected = pteron.compile(robot, "inverse_dynamics", "c")(poses, rates, np.zeros(4))
    present = kernel(cupy.asarray(poses), cupy.asarray(rates), np.zeros(4))
    np.testing.assert_array_equal(present.get(), expected)


def test_a_million_states(cupy):
    poses = np.tile(pteron.random_poses("delta", 100), (10_000, 1))
    assert len(poses) > GRID * BLOCK
    present = pteron.compile("delta", "inverse_kinematics", "cuda")(cupy.asarray(poses))
    np.testing.assert_array_equal(present.get(), pteron.inverse_kinematics("delta", poses))


@pytest.mark.parametrize("axis", [0, 1])
def test_offsets_may_exceed_32_bits(cupy, monkeypatch, tmp_path, axis):
    poses = pteron.random_poses("delta", 3)
    expected = pteron.inverse_kinematics("delta", poses)
    module = exported(tmp_path, "delta", ["inverse_kinematics"])
    joints, status = module.inverse_kinematics(far_apart(poses, axis))
    np.testing.assert_array_equal(joints.get(), expected)
    assert not status.any()
    kernel = pteron.compile("delta", "inverse_kinematics", "cuda")
    monkeypatch.setattr(cupy, "empty", lambda shape, dtype: far_apart(np.zeros(shape), 0))
    np.testing.assert_array_equal(kernel(far_apart(poses, axis)).get(), expected)


def test_arrays_of_other_libraries_come_back_as_they_were(cupy):
    jnp = pytest.importorskip("jax").numpy
    kernel = pteron.compile("delta", "inverse_kinematics", "cuda", dtype="float32")
    pose = jnp.asarray([[0.0, 0.0, -0.9]], "float32")
    joints = kernel(pose)
    assert isinstance(joints, type(pose))
    np.testing.assert_allclose(joints, pteron.inverse_kinematics("delta", pose), rtol=1e-5)


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        (np.zeros((2, 4)), r"pose: shape \(2, 4\) given, \(..., 3\) expected"),
        (["a", "b", "c"], "pose: not an array of real numbers"),
        (np.zeros((2, 3), np.float32).view(DeviceArray), "an array of float32 given, float64"),
    ],
)
def test_what_is_no_input_is_refused(cupy, pose, words):
    with pytest.raises(pteron.DataError, match=words):
        pteron.compile("delta", "inverse_kinematics", "cuda")(pose)


def test_without_a_gpu_one_line_says_so():
    with (
        emulated(available=False),
        pytest.raises(pteron.ModelError, match=r'needs an NVIDIA GPU .* use "c"'),
    ):
        pteron.compile("delta", "inverse_kinematics", "cuda")(np.zeros(3))


def test_fused_operations_are_for_the_gpu_alone():
    assert pteron.compile("delta", "inverse_kinematics", "cuda", fast=True).fast
    assert not pteron.compile("delta", "inverse_kinematics", "cuda").fast
    with pytest.raises(pteron.ModelError, match='only "cuda"'):
        pteron.compile("delta", "inverse_kinematics", "c", fast=True)


# Loops: a thread runs a machine.

DRIVE = Drive(0.3, 0.4, 0.05, 1e-5)


def driven(robot, **drive):
    """Return a machine whose drives have dry friction, so that joints stick."""
    drive = replace(DRIVE, **drive)
    return replace(robot, legs=tuple(replace(leg, drive=drive) for leg in robot.legs))


CASES = {
    "tripteron": (CATALOG["tripteron"], [0.0, 0.0, 0.0], PDGravity()),
    "delta with friction": (driven(CATALOG["delta"]), [0.0, 0.0, -0.9], ComputedTorque()),
    "tripteron that bends": (
        driven(CATALOG["tripteron"], rotor_inertia=0.2, elastic=Elastic(2e4, 50.0, encoder="both")),
        [0.0, 0.0, 0.0],
        ComputedTorque(),
    ),
    "3-rrr": (driven(CATALOG["3-rrr"]), [0.0, 0.0, 0.29], PDGravity()),
    "quadrupteron": (driven(CATALOG["quadrupteron"]), [0.0] * 4, ComputedTorque()),
    "par4": (driven(CATALOG["par4"]), [0.0, 0.0, -0.45, 0.0], ComputedTorque()),
    "stewart": (driven(pteron.load("stewart")), [0.0, 0.0, 2.0, 0, 0, 0], ComputedTorque()),
}


@pytest.mark.parametrize("count", [1, 7])
@pytest.mark.parametrize("name", gated(CASES, ["tripteron", "delta with friction"]))
def test_simulations_have_the_bits_of_c(cupy, name, count):
    robot, home, law = CASES[name]
    motion = pick_and_place(robot, home)
    machines = machines_about(robot, count, masses=0.1, friction=0.2)
    sensors = Sensors(encoder=1e-6, noise=1e-5, cutoff=200.0, samples=2)
    options = {"duration": 0.03, "sensors": sensors, "delay": 2e-4}
    host, device = (
        simulate_many(machines, motion, law, device=place, **options) for place in ("cpu", "cuda")
    )
    assert (host.samples > 10).all()
    for field in ("samples", "rms", "largest", "force", "stopped"):
        np.testing.assert_array_equal(getattr(device, field), getattr(host, field))


@pytest.mark.parametrize("axis", [0, 1])
def test_machines_and_samples_may_lie_far_apart(cupy, monkeypatch, axis):
    machines = machines_about("tripteron", 3, masses=0.1)
    options = {"duration": 0.03, "sensors": Sensors(noise=1e-5, samples=2)}
    arguments = machines, pick_and_place("tripteron", [0.0, 0.0, 0.0]), PDGravity()
    host, asarray, shapes = simulate_many(*arguments, **options), cupy.asarray, []

    def asarray_far(values):
        """Return a copy on the emulated GPU; machines or samples lie far apart."""
        if values.ndim < 3 or values.shape[axis] != (3, 31)[axis]:
            return asarray(values)
        shapes.append(values.shape)
        return far_apart(values, axis)

    monkeypatch.setattr(cupy, "asarray", asarray_far)
    device = simulate_many(*arguments, device="cuda", **options)
    assert len(shapes) > 5
    np.testing.assert_array_equal(device.rms, host.rms)
    np.testing.assert_array_equal(device.force, host.force)


def test_an_unknown_device_is_refused():
    motion = pick_and_place("tripteron", [0.0, 0.0, 0.0])
    with pytest.raises(pteron.DataError, match="device: 'gpu' is not one of cpu, cuda"):
        simulate_many(machines_about("tripteron", 2), motion, PDGravity(), device="gpu")


# Sanitizers: the tests above in a process of their own, on an emulated GPU that traps.


def expect_clean(selection, *options):
    """Run a selection of this file's tests under sanitizers; assert that all pass."""
    command = [sys.executable, "-m", "pytest", "-qs", "--timeout", "0", "-p", "no:cacheprovider"]
    done = sanitized([*command, *options, __file__, "-k", selection])
    assert done.returncode == 0, (done.stdout + done.stderr)[-3000:]


LINUX = pytest.mark.skipif(sys.platform != "linux", reason="sanitizers are loaded as on Linux")


@LINUX
def test_nothing_is_read_or_written_beyond_an_array():
    expect_clean("kernels_have_the_bits or strides or broadcast or exported_functions")


@LINUX
@CLIENTS
@pytest.mark.timeout(3600)  # sanitized code of some fifty functions is compiled
@pytest.mark.parametrize("name", gated(pteron.catalog(), ["delta"]))
def test_no_machine_reads_or_writes_beyond_an_array(name):
    expect_clean(f"[{name}] and (every_function or exported_functions_have)", "-m", "")


@LINUX
@CLIENTS
def test_no_loop_reads_or_writes_beyond_an_array():
    expect_clean("simulations", "-m", "")


# NVIDIA's compiler.


@CLIENTS
@pytest.mark.parametrize("architecture", ["sm_80", "sm_90"])
@pytest.mark.parametrize("name", gated(pteron.catalog(), GATE))
def test_nvidia_compiles_it(name, architecture):
    if nvrtc.library() is None:
        pytest.skip("the wheel nvidia-cuda-nvrtc-cu12 is not installed")
    robot = pteron.load(name)
    for what in ("inverse_dynamics", "forward_dynamics", "inverse_kinematics"):
        report = nvrtc.compiled(pteron.compile(robot, what, "cuda").source, architecture)
        assert report.registers <= 255
        most = 200 if robot.joint_count > 4 and what == "forward_dynamics" else 0
        assert report.spilled <= most, (what, report)
    code = loop(robot, pteron.kernels.program(robot, "pd_gravity")).code(1)
    assert nvrtc.compiled(replace(code, device=True).source, architecture).registers <= 255


# Exported code.


def exported(folder, robot, functions=None, **options):
    """Return the module of a machine's exported CUDA, as a user imports it."""
    files = export_cuda(robot, functions, folder, **options)
    (path,) = (file for file in files if file.suffix == ".py")
    spec = spec_from_file_location(path.stem, path)
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", gated(pteron.catalog(), GATE))
def test_exported_functions_have_results_and_status_of_c(cupy, name, tmp_path):
    """Those of the exported C, compiled, at its own examples and at states that have no result."""
    robot = pteron.load(name)
    functions = ["inverse_kinematics", "inverse_dynamics", "forward_dynamics"]
    module = exported(tmp_path, robot, functions)
    call, _ = compiled(robot, functions, tmp_path / "c")
    for item in exported_functions(robot, functions, specialised=False):
        states = [
            np.stack(arrays) for arrays in zip(*(e.inputs for e in item.examples), strict=True)
        ]
        states = [
            array[:1].repeat(3, axis=0) if port.shared else array
            for array, port in zip(states, item.inputs, strict=True)
        ]
        for k, number in enumerate(BAD[-2:]):
            states[0][1 + k, 0] = number
        inputs = [
            array[0] if port.shared else array
            for array, port in zip(states, item.inputs, strict=True)
        ]
        *results, status = getattr(module, item.name)(*map(cupy.asarray, inputs))
        for k in range(3):
            sizes = [port.size for port in item.outputs]
            code, *expected = call(item.name, *(array[k] for array in states), sizes=sizes)
            assert status[k] == code
            for result, row in zip(results, expected, strict=True):
                np.testing.assert_array_equal(result[k].get().ravel(), row)
    assert {0, 1} <= set(status.get().tolist())


def test_exported_parameters_are_the_default(cupy, tmp_path):
    module = exported(tmp_path, "delta", ["inverse_dynamics"])
    pose, zero = [0.0, 0.1, -0.9], np.zeros(3)
    forces, status = module.inverse_dynamics(pose, zero, zero)
    np.testing.assert_allclose(forces.get(), pteron.inverse_dynamics("delta", pose, zero, zero))
    assert status == 0
    heavier = module.inverse_dynamics(pose, zero, zero, 2.0 * module.PARAMETERS)[0]
    np.testing.assert_allclose(heavier.get(), 2.0 * forces.get())
    with pytest.raises(ValueError, match=r"pose: shape \(2,\) given, \(..., 3\) expected"):
        module.inverse_dynamics([0.0, 0.0], zero, zero)


@pytest.mark.parametrize(
    "arrange",
    [
        np.asfortranarray,
        lambda array: array.reshape(4, 6, 3),
        lambda array: array[::2],
        lambda array: array[5],
        lambda array: array[:0],
    ],
)
def test_exported_functions_take_any_layout(cupy, tmp_path, arrange):
    module = exported(tmp_path, "delta", ["inverse_kinematics"])
    poses = pteron.random_poses("delta", 24)
    joints, status = module.inverse_kinematics(arrange(cupy.asarray(poses)))
    expected = arrange(pteron.inverse_kinematics("delta", poses))
    np.testing.assert_array_equal(joints.get(), expected)
    assert not status.any()


@CLIENTS
@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("name", gated(pteron.catalog(), GATE))
def test_nvidia_compiles_exported_code(name, real, tmp_path):
    if nvrtc.library() is None:
        pytest.skip("the wheel nvidia-cuda-nvrtc-cu12 is not installed")
    files = export_cuda(name, None, tmp_path, real=real)
    texts = [file.read_text() for file in files if file.suffix != ".py"]
    header, kernels = sorted(texts, key=lambda text: "__global__" in text)
    nvrtc.compiled(header + kernels)


def test_the_command_writes_it(tmp_path):
    files = json.loads(run(f"export tripteron --cuda {tmp_path / 'out'} --json").stdout)["files"]
    names = sorted(Path(file).name for file in files)
    assert names == ["tripteron.cu", "tripteron.cuh", "tripteron_cuda.py"]
    line = f"export tripteron --cuda {tmp_path} --mjcf {tmp_path}"
    assert "give one at a time; only --c, --st and --cuda go together" in refused(line)


@CLIENTS
def test_the_folder_for_a_machine_with_a_gpu_runs_there(tmp_path):
    """On the emulated one, whose interface a module `cupy` in the folder has."""
    root = Path(__file__).parents[1]
    command = [sys.executable, root / "benchmarks" / "gpu.py", tmp_path, "--quick"]
    subprocess.run(command, check=True, capture_output=True)
    (tmp_path / "cupy.py").write_text(
        f"import sys\nsys.path.append({str(root / 'tests')!r})\n"
        "from emulated_gpu import module\nglobals().update(vars(module()))\n"
    )
    command = [sys.executable, tmp_path / "run.py", "--largest", "1e4", "--seconds", "0.01"]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    for key in ("joints", "forces", "accelerations"):
        assert re.search(rf"tripteron +{key} +3000 of 3000 numbers equal", text)
    assert "rollouts of 7: 42 of 42 numbers equal" in text
    assert re.search(r"tripteron +10000 states: [\d.e+]+ /s", text)
