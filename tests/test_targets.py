"""Every target against CasADi's virtual machine: the same bits where the arithmetic is the same."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from pathlib import Path

import casadi as ca
import mpmath
import numpy as np
import pytest
from mechanisms import (
    CATALOG,
    CLIENTS,
    MECHANISMS,
    NEAREST,
    NIGHTLY,
    gated,
    random_machine,
    relative_error,
    states,
)

import pteron
from pteron.controllers import CONTROLLERS
from pteron.errors import DataError, ModelError, OutputError
from pteron.kernels import (
    FUNCTIONS,
    SELECTED,
    TARGETS,
    NoSquareRoot,
    Port,
    cache,
    numeric,
    program,
)
from pteron.kernels.c import Code, compiler
from pteron.kernels.choice import SharedCode, TieredKernel
from pteron.kernels.program_cache import cached_program
from pteron.kernels.programs import geometry_only

ROBOT = CATALOG["quadrupteron"]
DYNAMICS = "inverse_dynamics"
SOME = ("inverse_kinematics", "direct_kinematics", "jacobian", DYNAMICS)
SEVERAL = (
    "quadrupteron",
    "quadrupteron-oblique",
    "quadrupteron +-+-",
    "quadrupteron, gravity along x",
    "tripteron-oblique",
    "delta on a wall",
    "random PRR 0",
    "random 3T 0",
    "random 3T1R 0",
)
needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")


@lru_cache
def compiled(robot, what, target, **options):
    base = pteron.base_parameters(robot) if what in SELECTED else None
    return pteron.compile(robot, what, target, base=base, **options)


@lru_cache
def values_of(robot, what, count=131):
    """Return inputs of a function: motions in reach, and a few rows that are not."""
    pose, velocity, acceleration = states(robot, count)
    pose = pose.copy()
    joints = pteron.inverse_kinematics(robot, pose)
    pose[3, 0] += 9.0
    pose[7, :3] = 50.0
    pose[11, 2] = np.nan
    pose[12, -1] += 2e5
    joints[5] *= [9.0, -9.0, 5.0, 90.0][: robot.freedom]
    known = {
        "pose": pose,
        "velocity": velocity,
        "acceleration": acceleration,
        "forces": acceleration,
        "wrench": velocity,
        "joints": joints,
        "joint_rates": velocity,
        "joint_accelerations": acceleration,
        "twist": np.hstack([velocity, acceleration])[:, :6],
        "mass": np.abs(pose[:, :1]),
        "center": velocity[:, :3],
        "inertia": np.abs(acceleration[:, :1]),
    }
    if what in CONTROLLERS:
        law = CONTROLLERS[what].law(robot)
        known |= {"memory": law.memory(pose, velocity), "gains": law.gains}
    return tuple(known[port.name] for port in compiled(robot, what, "vm").inputs)


def well_inside(robot, kernel):
    """Return inputs away from singularities, which single precision holds exactly."""
    pose = pteron.random_poses(robot, 300, seed=5, type_i=0.7, type_ii=0.15)
    rates = np.random.default_rng(5).normal(size=(2, *pose.shape))
    return [value.astype(np.float32) for value in (pose, *rates)][: len(kernel.inputs)]


def as_tuple(found):
    return found if isinstance(found, tuple) else (found,)


def assert_same_bits(found, expected):
    for a, b in zip(as_tuple(found), as_tuple(expected), strict=True):
        assert a.shape == b.shape
        np.testing.assert_array_equal(a, b)


def assert_close(found, expected, tolerance):
    for a, b in zip(as_tuple(found), as_tuple(expected), strict=True):
        a = np.asarray(a, dtype=float)
        assert a.shape == b.shape
        np.testing.assert_array_equal(np.isnan(a), np.isnan(b))
        rows = b.reshape(len(b), -1)
        size = np.nanmax(np.abs(rows), axis=1, keepdims=True, initial=1e-9)
        error = np.abs(a.reshape(rows.shape) - rows) / size
        assert np.nanmax(error, initial=0.0) < tolerance


def importable(target):
    if target not in ("vm", "c"):
        pytest.importorskip(target)
    if target == "c" and compiler() is None:
        pytest.skip("no C compiler")


# Agreement.


def assert_agrees(robot, what, target, **options):
    values = values_of(robot, what)
    vm, other = (compiled(robot, what, name, **options) for name in ("vm", target))
    expected = vm(*values)
    assert other.operations == vm.operations
    assert_same_bits(other(*values), expected)
    ports = vm.inputs

    def at(rows):
        return [v if p.shared else v[rows].copy() for v, p in zip(values, ports, strict=True)]

    for row in (0, 3, 11, 12):
        single = at(row)
        assert_same_bits(other(*single), tuple(part[row] for part in as_tuple(expected)))
        lists = [value.tolist() for value in single]
        assert_same_bits(other(*lists), tuple(part[row] for part in as_tuple(expected)))
    for count in (0, 1, 15, 16, 31, 32, 33, 64, 65):
        part = at(slice(count))
        assert_same_bits(other(*part), tuple(whole[:count] for whole in as_tuple(expected)))
    return expected


SOME_FUNCTIONS = (
    *("direct_kinematics", "reach", "jacobian", "inverse_dynamics", "computed_torque"),
    "potential_energy",
)
"""Vectors, matrices and numbers, of poses and of motions, with parameters, drives and memory."""


@needs_compiler
@pytest.mark.parametrize("what", gated(FUNCTIONS, SOME_FUNCTIONS))
def test_c_returns_the_same_bits(what):
    assert_agrees(ROBOT, what, "c")


@needs_compiler
@pytest.mark.parametrize("name", gated(SEVERAL, ["quadrupteron +-+-", "random PRR 0"]))
def test_c_on_other_modes_layouts_and_gravity(name):
    robot = MECHANISMS[name]
    found = assert_agrees(robot, DYNAMICS, "c", grade="parametric")
    assert np.isnan(found[[3, 7, 11]]).all()
    assert np.isfinite(found[:3]).all()


@CLIENTS
@pytest.mark.parametrize(
    ("name", "what"),
    [
        pytest.param("quadrupteron-oblique", "direct_kinematics", marks=NIGHTLY),
        pytest.param("quadrupteron-oblique", DYNAMICS, marks=NIGHTLY),
        pytest.param("tripteron", DYNAMICS, marks=NIGHTLY),
        pytest.param("delta", "direct_kinematics", marks=NIGHTLY),
        ("delta", "inverse_kinematics"),
        pytest.param("random PRR 0", DYNAMICS, marks=NIGHTLY),
    ],
)
def test_numba_returns_the_same_bits(name, what):
    pytest.importorskip("numba")
    assert_agrees(MECHANISMS[name], what, "numba")


@pytest.mark.parametrize("name", gated(["quadrupteron-oblique", "tripteron", "delta"], ["delta"]))
def test_general_code_serves_every_machine_of_a_topology(name):
    robot = MECHANISMS[name]
    values = values_of(robot, DYNAMICS)
    general = compiled(robot, DYNAMICS, "vm", grade="general")
    expected = general(*values)
    assert_close(expected[:12], compiled(robot, DYNAMICS, "vm")(*values)[:12], 1e-13)
    if compiler() is not None:
        fast = compiled(robot, DYNAMICS, "c", grade="general")
        assert_same_bits(fast(*values), expected)
        kind = "R" if name == "delta" else "P"
        other = random_machine(3, kind * robot.freedom)
        assert compiled(other, DYNAMICS, "c", grade="general").source == fast.source


EDGES = [
    *(0.0, -0.0, np.nan, np.inf, -np.inf, 1e5, -1e5, np.nextafter(1e5, 1e6), 1e300, 5e-324),
    *(k * np.pi / 2 for k in (-70000, -3, -2, -1, 1, 2, 3, 4, 5, 63661)),
    *(np.nextafter(k * np.pi / 4, 9e9) for k in (-1, 1, 3)),
]


@pytest.mark.parametrize("target", ["c", pytest.param("numba", marks=CLIENTS)])
def test_sines_have_the_same_bits_on_every_target(target):
    importable(target)
    x = ca.SX.sym("x")
    function = ca.Function("turn", [x], [ca.vertcat(ca.cos(x), ca.sin(x))])
    ports = (Port("angle", (1,)),), (Port("turn", (2,)),)
    vm, other = (TARGETS[name]("turn", function, *ports) for name in ("vm", target))
    assert vm.operations == 2
    rng = np.random.default_rng(0)
    spread = np.repeat([4.0, 1e3, 1.1e5, 1e-5], 250_000)
    angles = np.concatenate([EDGES, spread * rng.uniform(-1, 1, len(spread))])[:, None]
    expected = vm(angles)
    assert_same_bits(other(angles), expected)
    for angle, turn in zip(angles[:200], expected, strict=False):
        assert_same_bits(other(angle), turn)
    some = np.isfinite(angles[:, 0]) & (rng.random(len(angles)) < 4e-3) | (angles[:, 0] == np.pi)
    with mpmath.workprec(200):
        for (angle,), turn in zip(angles[some], expected[some], strict=True):
            for found, exact in zip(turn, (mpmath.cos(angle), mpmath.sin(angle)), strict=True):
                assert abs(found - exact) < np.spacing(abs(float(exact)))


@pytest.mark.parametrize("target", gated(["c", "jax"], ["c"], CLIENTS))
def test_comparisons_and_extremes_are_those_of_casadi(target):
    importable(target)
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    truths = [x < y, x <= y, ca.eq(x, y), ca.ne(x, y), ca.logic_not(x), ca.logic_and(x, y)]
    outputs = [*truths, ca.logic_or(x, y), ca.fmin(x, y), ca.fmax(x, y), ca.floor(x)]
    outputs.append(ca.if_else(x <= y, x * y, 2.0))
    function = ca.Function("f", [x, y], [ca.vertcat(*outputs)])
    ports = (Port("x", (1,)), Port("y", (1,))), (Port("f", (len(outputs),)),)
    vm, other = (TARGETS[name]("f", function, *ports) for name in ("vm", target))
    values = np.array([0.0, -1.5, 1.5, 2.0, np.inf, np.nan])
    given = np.repeat(values, 6)[:, None], np.tile(values, 6)[:, None]
    expected = vm(*given)
    if target == "jax":  # whose extremes of a number and NaN are NaN
        found, expected = (np.delete(v, [7, 8], 1) for v in (other(*given), expected))
        np.testing.assert_array_equal(found, expected)
    else:
        assert_same_bits(other(*given), expected)
        assert_same_bits(other(given[0][9], given[1][9]), expected[9])


@needs_compiler
@pytest.mark.parametrize("what", ["jacobian", DYNAMICS])
def test_float32_in_c(what):
    values = values_of(ROBOT, what)
    kernel, exact = compiled(ROBOT, what, "c", dtype="float32"), compiled(ROBOT, what, "vm")
    found = kernel(*values)
    assert found.dtype == np.float32
    # A leg bent by 0.3 rad loses a digit and a half more than one bent by half a right angle.
    assert_close(found[:12], exact(*values)[:12], 1e-4)
    inside = well_inside(ROBOT, kernel)
    assert_close(kernel(*inside), exact(*inside), 1e-5)
    assert kernel(*(value[0].astype(np.float32) for value in values)).dtype == np.float32


@CLIENTS
@pytest.mark.parametrize("what", gated(SOME, ["direct_kinematics", DYNAMICS]))
def test_jax(what):
    pytest.importorskip("jax")
    robot = CATALOG["quadrupteron-oblique"]
    values = values_of(robot, what)
    expected = compiled(robot, what, "vm")(*values)
    assert_close(compiled(robot, what, "jax")(*values), expected, 1e-13)


@CLIENTS
def test_jax_is_a_pure_function_that_jits_maps_and_differentiates():
    jax = pytest.importorskip("jax")
    kernel = compiled(ROBOT, DYNAMICS, "jax", grade="parametric")
    vm = compiled(ROBOT, DYNAMICS, "vm", grade="parametric")
    pose, velocity, acceleration = motion = states(ROBOT, 20)
    assert_close(jax.jit(kernel)(*motion), vm(*motion), 1e-13)
    assert_close(
        jax.vmap(kernel, (0, None, None))(pose, velocity[0], acceleration[0]),
        vm(pose, velocity[0], acceleration[0]),
        1e-13,
    )
    # The forces are linear in the parameters: their slopes are the regressor.
    values = 1.5 * pteron.parameters(ROBOT)
    slopes = jax.jacrev(lambda p: kernel(*motion, parameters=p))(values)
    regressor = pteron.regressor(ROBOT, *motion)
    np.testing.assert_allclose(slopes, regressor, atol=1e-12 * np.abs(regressor).max())
    joints = compiled(ROBOT, "inverse_kinematics", "jax")
    rates = jax.jvp(joints, (pose,), (velocity,))[1]
    expected = (pteron.jacobian(ROBOT, pose) @ velocity[..., None])[..., 0]
    assert_close(rates, expected, 1e-12)


@CLIENTS
def test_jax_float32():
    pytest.importorskip("jax")
    kernel = compiled(ROBOT, DYNAMICS, "jax", dtype="float32")
    motion = well_inside(ROBOT, kernel)
    found = np.asarray(kernel(*motion))
    assert found.dtype == np.float32
    assert_close(found, compiled(ROBOT, DYNAMICS, "vm")(*motion), 1e-5)


def test_exact_arithmetic_is_a_target():
    pose = [Fraction(1, 50), Fraction(-1, 25), Fraction(1, 20), Fraction(1, 7)]
    found = pteron.compile(ROBOT, "jacobian", "exact")(pose)
    angle = 2 * np.arctan(1 / 7)
    expected = pteron.jacobian(ROBOT, [0.02, -0.04, 0.05, angle])
    assert all(isinstance(value, Fraction) for value in found.ravel())
    np.testing.assert_allclose(found.astype(float), expected, rtol=1e-15)
    with pytest.raises(NoSquareRoot, match=r"^link_vectors: .* use another target") as caught:
        pteron.compile(ROBOT, "link_vectors", "exact")(pose)
    assert isinstance(caught.value, pteron.PteronError)
    assert len(str(caught.value)) < 200
    with pytest.raises(DataError, match="one state"):
        pteron.compile(ROBOT, "jacobian", "exact")([pose])


# Reduced models.


@pytest.mark.parametrize(
    "name",
    gated([*NEAREST, "tripteron on a wall", "random 3T 0"], ["tripteron-oblique"]),
)
def test_the_cheapest_base_parameters_give_the_same_forces(name):
    robot = MECHANISMS[name]
    base = pteron.reduction.cheapest_parameters(robot)
    assert base.rank == pteron.base_parameters(robot).rank
    motion = states(robot, 50)
    expected = pteron.inverse_dynamics(robot, *motion)
    kernel = pteron.compile(robot, DYNAMICS, base=base, grade="parametric")
    assert relative_error(kernel(*motion), expected) < 1e-12
    doubled = kernel(*motion, base_parameters=2.0 * base.values())
    assert relative_error(doubled, 2.0 * expected) < 1e-12
    assert relative_error(pteron.compile(robot, DYNAMICS, base=base)(*motion), expected) < 1e-12
    wrench = motion[1]
    loaded = pteron.compile(robot, DYNAMICS, base=base, wrench=True)(*motion, wrench)
    assert relative_error(loaded, pteron.inverse_dynamics(robot, *motion, wrench)) < 1e-12
    standard = pteron.compile(robot, DYNAMICS, grade="parametric").operations
    assert kernel.operations < standard
    heavy = pteron.with_parameters(robot, 2 * pteron.parameters(robot))
    doubled = pteron.compile(heavy, DYNAMICS, base=base, grade="parametric")
    assert relative_error(doubled(*motion), 2 * expected) < 1e-12


@CLIENTS
@pytest.mark.parametrize("size", gated([1e-3, 1e3], [1e-3]))
def test_the_cheapest_base_parameters_know_no_unit_of_length(size):
    machine = random_machine(11, "PPP")
    names = pteron.reduction.cheapest_parameters(machine).names
    legs = tuple(
        replace(
            leg,
            guide_point=tuple(size * np.array(leg.guide_point)),
            platform_point=tuple(size * np.array(leg.platform_point)),
            upper_length=size * leg.upper_length,
            lower_length=size * leg.lower_length,
            limits=None,
        )
        for leg in machine.legs
    )
    assert pteron.reduction.cheapest_parameters(replace(machine, legs=legs)).names == names


@pytest.mark.parametrize("name", gated(NEAREST, ["quadrupteron", "delta"]))
def test_any_choice_of_base_parameters_will_do(name):
    robot = CATALOG[name]
    motion = states(robot, 20)
    expected = pteron.inverse_dynamics(robot, *motion)
    lower = [f"mgx_l{i + 1}" for i in range(len(robot.legs))]
    for base in (
        pteron.base_parameters(robot),
        pteron.base_parameters(robot, keep=lower),
        pteron.base_parameters(robot, "svd"),
    ):
        kernel = pteron.compile(robot, DYNAMICS, base=base)
        assert relative_error(kernel(*motion), expected) < 1e-10


def test_base_parameters_of_another_layout_are_refused():
    base = pteron.base_parameters(CATALOG["tripteron"])
    with pytest.raises(ModelError, match="base: belongs to tripteron"):
        pteron.compile(ROBOT, DYNAMICS, base=base)
    with pytest.raises(ModelError, match="base: a choice for one machine"):
        pteron.compile(ROBOT, DYNAMICS, base=pteron.base_parameters(ROBOT), grade="general")


# What a call accepts.


@pytest.mark.parametrize("target", ["c", pytest.param("numba", marks=CLIENTS)])
def test_layouts_that_are_not_plain_are_served_all_the_same(target):
    importable(target)
    kernel, vm = (compiled(ROBOT, DYNAMICS, name, grade="parametric") for name in (target, "vm"))
    motion = states(ROBOT, 24)
    expected = vm(*motion)
    raw = np.empty(motion[0].nbytes + 1, np.uint8)
    unaligned = raw[1:].view(np.float64).reshape(motion[0].shape)
    unaligned[:] = motion[0]
    frozen = [value.copy() for value in motion]
    for value in frozen:
        value.setflags(write=False)
    for given in (
        [np.asfortranarray(value) for value in motion],
        [np.repeat(value, 2, axis=1)[:, ::2] for value in motion],
        [np.repeat(value, 2, axis=0)[::2] for value in motion],
        [value.tolist() for value in motion],
        [value.astype(">f8") for value in motion],
        [unaligned, *motion[1:]],
        frozen,
    ):
        assert_same_bits(kernel(*given), expected)
        assert_same_bits(kernel(*(value[3:20:4] for value in given)), expected[3:20:4])
        assert_same_bits(kernel(*(value[0] for value in given)), expected[0])
    cube = [value.reshape(2, 3, 4, 4) for value in motion]
    assert_same_bits(kernel(*cube), expected.reshape(2, 3, 4, 4))
    for mixed in (
        (motion[0], motion[1][:1], motion[2][:1]),
        (motion[0], motion[1][0], motion[2][0].tolist()),
        (motion[0][0], motion[1][:5], [1, 2.0, np.float64(3), True]),
        (cube[0], cube[1][0, 0, 0], cube[2]),
        (cube[0], cube[1][0], cube[2][0, 0]),
    ):
        assert_same_bits(kernel(*mixed), vm(*(np.array(value, float) for value in mixed)))
    assert_same_bits(kernel(*np.zeros((3, 0, 4))), np.zeros((0, 4)))
    assert_same_bits(kernel(*np.zeros((2, 0, 4)), [0, 0, 0, 0]), np.zeros((0, 4)))


@pytest.mark.parametrize("target", gated(["vm", "c", "numba", "jax"], ["vm", "c"], CLIENTS))
def test_what_a_call_cannot_take_is_refused(target):
    importable(target)
    kernel = compiled(ROBOT, DYNAMICS, target, grade="parametric")
    zero = np.zeros(4)
    with pytest.raises(DataError, match="2 inputs given, 3 expected"):
        kernel(zero, zero)
    for wrong in (np.zeros(3), np.zeros((4, 3)), 0.0, [1.0, 2.0]):
        with pytest.raises(DataError, match=r"velocity: shape .* given, \(..., 4\) expected"):
            kernel(zero, wrong, zero)
    masked = np.ma.masked_array(np.zeros((5, 4)), np.arange(20).reshape(5, 4) > 17)
    with pytest.raises(DataError, match="acceleration: 2 of 20 elements are masked; leave"):
        kernel(zero, zero, masked)
    assert np.shape(kernel(zero, zero, np.ma.masked_array(np.zeros((5, 4))))) == (5, 4)
    if target == "jax":
        return
    for wrong in ([10**400, 0, 0, 0], np.array(["1", "2", "3", "4"], dtype=object), "zero"):
        with pytest.raises(DataError, match="velocity: not an array of real numbers"):
            kernel(zero, wrong, zero)
    with pytest.raises(DataError, match="pose: 39 axes given, at most 32 expected"):
        kernel(np.zeros((1,) * 38 + (4,)), zero, zero)


@pytest.mark.parametrize("target", gated(["vm", "c", "numba", "jax"], ["vm", "c"], CLIENTS))
def test_fixed_inputs_can_be_given_by_name(target):
    importable(target)
    kernel = compiled(ROBOT, DYNAMICS, target, grade="parametric")
    motion = states(ROBOT, 40)
    assert [port.name for port in kernel.inputs] == ["pose", "velocity", "acceleration"]
    assert [port.name for port in kernel.ports[3:]] == ["parameters"]
    expected = kernel(*motion)
    values = pteron.parameters(ROBOT)
    assert_same_bits(np.asarray(kernel(*motion, parameters=values)), np.asarray(expected))
    doubled = kernel(*motion, parameters=2 * values)
    np.testing.assert_allclose(doubled, 2 * expected, rtol=1e-12, atol=1e-12)
    assert_same_bits(np.asarray(kernel(*motion)), np.asarray(expected))
    with pytest.raises(DataError, match=r"parameters: shape \(3,\) given"):
        kernel(*motion, parameters=np.zeros(3))
    with pytest.raises(DataError, match="'mass' cannot be given by name; inputs that can: param"):
        kernel(*motion, mass=1.0)
    if target != "numba":  # which would be compiled for it
        with pytest.raises(DataError, match=r"'parameters' cannot be given .* that can: none"):
            compiled(ROBOT, DYNAMICS, target)(*motion, parameters=values)


def test_threads_share_a_batch_and_change_no_bit():
    motion = [np.tile(value, (200, 1)) for value in states(ROBOT, 101)]
    expected = compiled(ROBOT, DYNAMICS, "vm")(*motion)
    targets = ("vm", "c") if compiler() else ("vm",)
    for target in targets:
        kernel = compiled(ROBOT, DYNAMICS, target, threads=3)
        assert_same_bits(kernel(*motion), expected)
        with ThreadPoolExecutor(4) as pool:
            for found in pool.map(lambda _, k=kernel: k(*motion), range(8)):
                assert_same_bits(found, expected)


def test_nothing_raises_a_floating_point_warning():
    far = np.full((3, 4), 1e3)
    for target in ("vm", *(["c"] if compiler() else [])):
        with np.errstate(all="raise"):
            assert np.isnan(compiled(ROBOT, DYNAMICS, target)(far, far, far)).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"grade": "best"}, "grade: 'best' is not one of specialised, parametric, general"),
        ({"dtype": "float16"}, "dtype: 'float16' given, target \"vm\" has float64"),
        ({"dtype": "float32"}, "dtype: 'float32' given, target \"vm\" has float64"),
        ({"threads": 0}, "threads: 0 given, 1 or more expected"),
    ],
)
def test_choices_that_are_not_there_are_refused(options, message):
    with pytest.raises(ModelError, match=message):
        pteron.compile(ROBOT, DYNAMICS, **options)


@pytest.mark.parametrize(("package", "name"), [("jax", "JAX"), ("numba", "Numba")])
def test_a_missing_package_is_one_line(monkeypatch, package, name):
    monkeypatch.setitem(sys.modules, package, None)
    kernel = pteron.compile(ROBOT, "jacobian", package, threads=2)
    with pytest.raises(
        ModelError, match=rf'target: "{package}" needs {name}, .* install .*\[{package}\]"'
    ):
        kernel(POSE)


# The cache.


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    monkeypatch.setenv("PTERON_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def entries(folder):
    """Return what is compiled; texts are kept beside it."""
    return [path for path in folder.glob("*") if path.name != cache.TEXTS]


def another():
    """Return a kernel of its own: those of `compile` have loaded their code."""
    built = program(ROBOT, "jacobian")
    return TARGETS["c"](built.name, built.function, built.inputs, built.outputs)


POSE = np.array([0.01, 0.02, 0.03, 0.1])
EXPECTED = pteron.compile(ROBOT, "jacobian")(POSE)


def assert_works():
    np.testing.assert_array_equal(another()(POSE), EXPECTED)


@needs_compiler
def test_a_second_start_compiles_nothing(fresh, monkeypatch):
    assert not another().code.is_cached()
    assert_works()
    (folder,) = entries(fresh)
    assert fresh.stat().st_mode & 0o777 == folder.stat().st_mode & 0o777 == 0o700
    made = {path: path.stat().st_mtime_ns for path in folder.iterdir()}
    assert another().code.is_cached()
    assert_works()
    assert {path: path.stat().st_mtime_ns for path in folder.iterdir()} == made


@needs_compiler
@pytest.mark.parametrize("manifest", gated(["kept", "gone", "", "{}", "[]", "3"], ["kept", "[]"]))
def test_a_damaged_entry_is_built_again(fresh, manifest):
    assert_works()
    (folder,) = entries(fresh)
    (library,) = folder.glob("*.so")
    content = library.read_bytes()
    library.unlink()  # this process goes on using the file that it has loaded
    if manifest == "kept":
        library.write_bytes(content[:-9] + b"123456789")
    elif manifest == "gone":
        library.write_bytes(content)
        (folder / "manifest.json").unlink()
    else:
        (folder / "manifest.json").write_text(manifest)
    assert not another().code.is_cached()
    assert_works()
    assert entries(fresh) == [folder]
    assert another().code.is_cached()


@needs_compiler
@pytest.mark.skipif(os.name == "nt", reason="modes and owners are POSIX's")
@pytest.mark.parametrize("danger", gated(["group", "others", "owner"], ["others", "owner"]))
def test_a_folder_that_others_may_write_to_is_not_trusted(fresh, danger):
    assert_works()
    (library,) = fresh.glob("*/*.so")
    library.unlink()
    library.write_bytes(b"planted")
    if danger == "owner":
        if os.geteuid() != 0:
            pytest.skip("only root can give a folder away")
        os.chown(fresh, 12345, -1)
    else:
        fresh.chmod(0o770 if danger == "group" else 0o707)
    assert_works()
    assert library.read_bytes() == b"planted"
    assert len(entries(fresh)) == 1


@CLIENTS
@needs_compiler
def test_the_sweep_removes_what_a_killed_process_left_and_nothing_else(fresh, tmp_path):
    slow = tmp_path / "slow"
    slow.write_text('#!/bin/sh\ncase "$*" in --version) exit;; esac\nsleep 60\n')
    slow.chmod(0o700)
    script = "import pteron; pteron.compile(pteron.load('tripteron'), 'reach', 'c')([0, 0, 0])"
    process = subprocess.Popen(
        [sys.executable, "-c", script],
        env={**os.environ, "CC": str(slow)},
        start_new_session=True,
    )
    while not list(fresh.glob("*/kernel.c")):
        assert process.poll() is None
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    (left,) = entries(fresh)
    assert_works()
    assert not left.exists()  # nobody works on it any more
    left.mkdir()
    (left / ".made-by-pteron").write_text("another-computer 1")
    others = [fresh / ".config-old", fresh / ".pteron-work-notes", fresh / "c-mine"]
    day = time.time() - 24 * 3600
    for folder in others:
        folder.mkdir()
        (folder / "kernel.c").write_text("")
    (made,) = fresh.glob("c-jacobian-*")
    (made / "manifest.json").unlink()
    assert_works()
    assert left.exists()
    for folder in (left, *others):
        for path in (*folder.iterdir(), folder):
            os.utime(path, (day, day))
    (entry,) = fresh.glob("c-jacobian-*")
    (entry / "manifest.json").unlink()
    assert_works()
    assert not left.exists()
    assert all((folder / "kernel.c").exists() for folder in others)


@CLIENTS
@needs_compiler
def test_a_request_to_end_ends_the_compiler_too(fresh, tmp_path):
    slow, number = tmp_path / "slow", tmp_path / "number"
    slow.write_text(
        f'#!/bin/sh\ncase "$*" in --version) exit;; esac\necho $$ >{number}\nexec sleep 60\n'
    )
    slow.chmod(0o700)
    script = (
        "import pteron\n"
        "from pteron.cli.interrupts import ended_with_compilers\n"
        "with ended_with_compilers():\n"
        "    pteron.compile(pteron.load('tripteron'), 'reach', 'c')([0, 0, 0])\n"
    )
    process = subprocess.Popen([sys.executable, "-c", script], env={**os.environ, "CC": str(slow)})
    while not number.exists() or not number.read_text().strip():
        assert process.poll() is None
        time.sleep(0.05)
    process.terminate()
    assert process.wait(timeout=20) == -signal.SIGTERM
    compiler = Path(f"/proc/{number.read_text().strip()}/cmdline")
    for _ in range(100):
        if not compiler.exists() or not compiler.read_text():  # or it waits to be reaped
            return
        time.sleep(0.05)
    raise AssertionError("the compiler goes on")


@needs_compiler
def test_the_entries_used_least_lately_are_removed(fresh, monkeypatch):
    assert_works()
    (used,) = fresh.glob("c-jacobian-*")
    older = []
    for number in range(3):
        older.append(fresh / f"c-older-{number}")
        older[-1].mkdir()
        (older[-1] / "library").write_bytes(bytes(1000))
        (older[-1] / "manifest.json").write_text("{}")
        os.utime(older[-1] / "manifest.json", (1e9 + number, 1e9 + number))
    size = sum(path.stat().st_size for path in used.iterdir())
    monkeypatch.setattr(cache, "MOST_BYTES", size + 1100)
    pteron.compile(replace(ROBOT, name="one more"), "reach", "c")(POSE)
    assert used.exists()
    assert [folder.exists() for folder in older] == [False, False, True]


@CLIENTS
@needs_compiler
def test_processes_that_compile_at_once_do_not_meet(fresh):
    script = textwrap.dedent("""
        import pteron
        robot = pteron.load("quadrupteron")
        print(pteron.compile(robot, "jacobian", "c")([0.01, 0.02, 0.03, 0.1])[0])
    """)
    running = [
        subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    printed = {process.communicate()[0] for process in running}
    assert [process.returncode for process in running] == [0] * 2
    assert len(printed) == 1
    assert len(entries(fresh)) == 1


@needs_compiler
def test_a_cache_that_cannot_be_written_costs_speed_alone(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("PTERON_CACHE", str(tmp_path / "file" / "cache"))
    assert_works()


@needs_compiler
def test_a_full_disk_is_one_line(fresh):
    """A limit on the size of files fails like a disk that is full."""
    resource = pytest.importorskip("resource")
    script = textwrap.dedent("""
        import resource, pteron
        kernel = pteron.compile(pteron.load("tripteron"), "reach", "c")
        kernel.source
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
        try:
            kernel([0, 0, 0])
        except pteron.OutputError as error:
            print(error)
    """)
    assert resource.RLIMIT_FSIZE is not None
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert run.stdout.startswith(f"{fresh}: compiled code cannot be written (")
    assert run.stdout.endswith("name another folder in the environment variable PTERON_CACHE\n")
    assert issubclass(OutputError, pteron.PteronError)
    assert entries(fresh) == []


@dataclass(frozen=True)
class Foreign:
    """What no source of the package tells of."""


def test_a_second_start_builds_no_program(fresh):
    built, keys = program(ROBOT, "jacobian"), []

    def asked(*key):
        def build():
            keys.append(key)
            return built

        return cached_program(key, build)

    one, close, foreign = (
        (geometry_only(ROBOT), 0.1),
        (geometry_only(ROBOT), np.nextafter(0.1, 1.0).item()),
        Foreign(),
    )
    for key in (one, close, one, (foreign,), (foreign,)):
        found = asked(*key)
        assert (found.inputs, found.outputs) == (built.inputs, built.outputs)
        assert found.function.str(True) == built.function.str(True)
    assert keys == [one, close, (foreign,), (foreign,)]
    for path in (fresh / cache.TEXTS).iterdir():
        path.write_bytes(path.read_bytes()[:-1])
    asked(*one)
    assert keys[4:] == [one]


def test_the_oldest_texts_give_way(fresh):
    for k in range(9):
        cache.store_text(str(k), f"text {k}", most=4)
    assert len([*(fresh / cache.TEXTS).iterdir()]) <= 4
    assert cache.find_text("8") == "text 8"
    assert cache.find_text("0") is None


@CLIENTS
def test_the_numba_code_is_cached_too(fresh):
    pytest.importorskip("numba")
    script = textwrap.dedent("""
        import pteron
        kernel = pteron.compile(pteron.load("tripteron"), "inverse_kinematics", "numba")
        print(kernel.is_cached(), kernel([0.01, 0.02, 0.03]))
    """)
    first, second = (
        subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
        for _ in range(2)
    )
    assert first.stdout.replace("False", "True") == second.stdout != first.stdout


@needs_compiler
@pytest.mark.parametrize("command", ["{} -m64", "env {}"])
def test_the_compilers_command_may_have_several_words(fresh, monkeypatch, command):
    monkeypatch.setenv("CC", command.format(compiler()[0]))
    assert_works()


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("/bin/false -x", r'^target: "c" could not be compiled with /bin/false -x: .*'),
        ("no-such-compiler", 'target: "c" needs a C compiler .* CC=no-such-compiler'),
        ("gcc 'open", 'target: "c" needs a C compiler'),
        ("true", 'target: "c" could not be compiled with .*true: exit code 0, no library'),
    ],
)
def test_a_compiler_that_fails_is_one_line(fresh, monkeypatch, command, message):
    monkeypatch.setenv("CC", command)
    with pytest.raises(ModelError, match=message):
        another()(POSE)
    assert not entries(fresh)


# The policy of the public functions.


def machine_of_its_own(number):
    """Return a machine that no other test has asked for, and its long motion.

    The virtual machine takes more than 0.1 s for it.
    """
    first, *others = ROBOT.legs
    longer = replace(first, upper_length=first.upper_length + 1e-6 * number)
    robot = replace(ROBOT, legs=(longer, *others))
    return robot, [np.tile(value, (2000, 1)) for value in states(robot, 100)]


@pytest.fixture
def automatic(fresh, monkeypatch):
    monkeypatch.setenv("PTERON_KERNELS", "auto")
    return fresh


@needs_compiler
def test_the_public_functions_move_to_c_and_return_the_same_bits(automatic):
    robot, motion = machine_of_its_own(1)
    before = pteron.inverse_dynamics(robot, *motion)
    kernel = numeric(robot, DYNAMICS)
    for _ in range(600):
        if kernel.is_compiled:
            break
        time.sleep(0.05)
        kernel(*motion)  # one is compiled at a time: who finds the compiler busy asks again
    assert kernel.is_compiled
    assert_same_bits(pteron.inverse_dynamics(robot, *motion), before)
    single = [value[0] for value in motion]
    assert_same_bits(pteron.inverse_dynamics(robot, *single), before[0])
    assert type(kernel.call).__name__ == "builtin_function_or_method"
    heavy = pteron.with_parameters(robot, 2 * pteron.parameters(robot))
    assert numeric(heavy, DYNAMICS).tier is kernel.tier
    np.testing.assert_allclose(pteron.inverse_dynamics(heavy, *motion), 2 * before, rtol=1e-11)


SHORT = """
import numpy as np, pteron
robot = pteron.load("five-bar")
poses = np.tile([0.0, 0.12], (2_000_000, 1))
pteron.inverse_dynamics(robot, poses, poses, poses)
"""
"""Longer than the virtual machine is let alone, and over before a compiler is."""

SLOW = """#!{python}
import os, pathlib, subprocess, sys
if "--version" not in sys.argv:
    child = subprocess.Popen(["sleep", "1000"])
    pathlib.Path({told!r}).write_text(f"{{os.getpid()}} {{child.pid}}")
    child.wait()
"""


def ended(script, **environment):
    """Run a script in a process of its own, in which C code is compiled."""
    given = {**os.environ, "PTERON_KERNELS": "auto", **environment}
    subprocess.run([sys.executable, "-c", script], check=True, env=given)


@CLIENTS
@needs_compiler
def test_a_short_script_leaves_its_kernel_to_the_next(fresh):
    ended(SHORT)
    (name,) = [path.name for path in entries(fresh)]
    assert name.startswith("c-")
    (library,) = [path.name for path in (fresh / name).glob("pteron_kernel*")]
    assert cache.find(name, library) is not None


@CLIENTS
@pytest.mark.skipif(sys.platform == "win32", reason="there are no groups of processes")
@needs_compiler
def test_a_compiler_that_takes_long_ends_with_the_script(fresh, tmp_path):
    told, slow = tmp_path / "told", tmp_path / "slow"
    slow.write_text(SLOW.format(python=sys.executable, told=str(told)))
    slow.chmod(0o755)
    ended(SHORT, CC=str(slow))
    assert not entries(fresh)
    started = [int(number) for number in told.read_text().split()]
    for _ in range(200):  # the system takes its time to end what was killed
        left = [number for number in started if is_running(number)]
        if not left:
            break
        time.sleep(0.05)
    assert not left


def is_running(number):
    """Say whether there is such a process, and not only its name."""
    asked = ["ps", "-o", "stat=", "-p", str(number)]
    found = subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip()
    return found != "" and not found.startswith("Z")


class Turning(SharedCode):
    """A tier that is ready when it has been missed three times."""

    def __init__(self, code):
        super().__init__(code, np.inf)
        self.times = 0

    def add_interpreter_time(self, seconds):
        self.times += 1
        if self.times == 3:
            self.ready = self.code.module is not None


class Counted:
    """Code that counts how often it is loaded."""

    instruction_count = 1000

    def __init__(self, cached):
        self.cached, self.source, self.loads = cached, "", 0

    def is_cached(self):
        return self.cached

    @property
    def module(self):
        self.loads += 1


@needs_compiler
def test_cached_code_is_loaded_soon_and_other_code_compiled_when_that_pays(monkeypatch):
    monkeypatch.setenv("PTERON_KERNELS", "auto")
    cached, absent = Counted(cached=True), Counted(cached=False)
    for code, patience in ((cached, 2.0), (absent, 2.0)):
        tier = SharedCode(code, patience)
        tier.add_interpreter_time(0.05)
        assert code.loads == 0
        tier.add_interpreter_time(1.5)
        assert tier.ready is code.cached
    assert (cached.loads, absent.loads) == (1, 0)
    tier.add_interpreter_time(1.0)
    for _ in range(600):
        if tier.ready:
            break
        time.sleep(0.01)
    assert absent.loads == 1


@needs_compiler
def test_a_large_batch_changes_over_on_its_way():
    vm = pteron.compile(ROBOT, DYNAMICS, grade="parametric")
    motion = [np.tile(value, (40, 1)) for value in states(ROBOT, 100)]
    tier = Turning(Code(vm.name, vm.function, vm.ports, vm.outputs))
    kernel = TieredKernel(vm, tier, chunk=64)
    assert_same_bits(kernel(*motion), vm(*motion))
    assert tier.times == 3


@pytest.mark.parametrize(
    ("number", "variable", "value"),
    [
        (2, "PTERON_KERNELS", "vm"),
        (3, "CC", "no-such-compiler"),
        (4, "CC", "/bin/false"),
    ],
)
def test_the_public_functions_do_without_c(automatic, monkeypatch, number, variable, value):
    monkeypatch.setenv(variable, value)
    robot, motion = machine_of_its_own(number)
    first = pteron.inverse_dynamics(robot, *motion)
    time.sleep(0.1)
    assert_same_bits(pteron.inverse_dynamics(robot, *motion), first)
    assert not numeric(robot, DYNAMICS).is_compiled
    assert not entries(automatic)


def test_nothing_is_compiled_at_import(fresh):
    script = (
        "import sys, pteron; r = pteron.load('quadrupteron');"
        "pteron.inverse_dynamics(r, [0] * 4, [0] * 4, [0] * 4);"
        "print(sorted({'numba', 'llvmlite', 'jax', 'jinja2', 'sympy'} & set(sys.modules)))"
    )
    environment = {**os.environ, "PTERON_KERNELS": "auto"}
    run = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, env=environment
    )
    assert run.stdout.strip() == "[]"
    assert not entries(fresh)
