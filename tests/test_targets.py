"""Every target against CasADi's virtual machine: the same bits where the arithmetic is the same."""

import os
import subprocess
import sys
import textwrap
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache

import casadi as ca
import numpy as np
import pytest
from mechanisms import CATALOG, MECHANISMS, random_machine, relative_error, states

import pteron
from pteron.errors import DataError, ModelError
from pteron.kernels import FUNCTIONS, NoSquareRoot, cache, choice, numeric, program
from pteron.kernels import c as c_target
from pteron.kernels.c import compiler

ROBOT = CATALOG["quadrupteron"]
DYNAMICS = "inverse_dynamics"
SOME = ("inverse_kinematics", "direct_kinematics", "jacobian", DYNAMICS)
needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")


@lru_cache
def compiled(robot, what, target, **options):
    base = pteron.base_parameters(robot) if what == "base_regressor" else None
    return pteron.compile(robot, what, target, base=base, **options)


@lru_cache
def values_of(robot, what, count=131):
    """Return inputs of a function: motions in reach, and a few rows that are not."""
    pose, velocity, acceleration = states(robot, count)
    pose = pose.copy()
    sliders = pteron.inverse_kinematics(robot, pose)
    pose[3, 0] += 9.0
    pose[7, :3] = 50.0
    pose[11, 2] = np.nan
    sliders[5] *= [9.0, -9.0, 5.0, 90.0][: robot.freedom]
    known = {
        "pose": pose,
        "velocity": velocity,
        "acceleration": acceleration,
        "forces": acceleration,
        "wrench": velocity,
        "sliders": sliders,
        "slider_rates": velocity,
        "slider_accelerations": acceleration,
    }
    kernel = compiled(robot, what, "vm")
    return tuple(known[port.name] for port in kernel.inputs if port.name not in kernel.fixed)


def well_inside(robot, kernel):
    """Return inputs away from singularities, which single precision holds exactly."""
    pose = pteron.random_poses(robot, 300, seed=5, bend=0.7, hold=0.5)
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


# Agreement.


@needs_compiler
@pytest.mark.parametrize("what", FUNCTIONS)
@pytest.mark.parametrize("name", CATALOG)
def test_c_returns_the_same_bits(name, what):
    robot = CATALOG[name]
    values = values_of(robot, what)
    vm, c = compiled(robot, what, "vm"), compiled(robot, what, "c")
    expected = vm(*values)
    assert c.operations == vm.operations
    assert_same_bits(c(*values), expected)
    for row in (0, 3, 7, 11):
        single = [value[row].copy() for value in values]
        assert_same_bits(c(*single), tuple(part[row] for part in as_tuple(expected)))
    for count in (0, 1, 2, 15, 16, 17, 63, 64, 65, 128):
        part = [value[:count] for value in values]
        assert_same_bits(c(*part), tuple(whole[:count] for whole in as_tuple(expected)))


@needs_compiler
@pytest.mark.parametrize("name", MECHANISMS)
def test_c_on_other_modes_layouts_and_gravity(name):
    robot = MECHANISMS[name]
    values = values_of(robot, DYNAMICS)
    expected = compiled(robot, DYNAMICS, "vm")(*values)
    assert np.isnan(expected[[3, 7, 11]]).all()
    assert np.isfinite(np.delete(expected, [3, 7, 11], axis=0)).all()
    assert_same_bits(compiled(robot, DYNAMICS, "c")(*values), expected)
    parametric = compiled(robot, DYNAMICS, "c", grade="parametric")
    assert_same_bits(
        parametric(*values), compiled(robot, DYNAMICS, "vm", grade="parametric")(*values)
    )
    assert_close(parametric(*values), expected, 1e-13)


@pytest.mark.parametrize("what", SOME)
@pytest.mark.parametrize("name", ["quadrupteron", "tripteron-oblique"])
def test_numba_returns_the_same_bits(name, what):
    robot = CATALOG[name]
    values = values_of(robot, what)
    expected = compiled(robot, what, "vm")(*values)
    numba = compiled(robot, what, "numba")
    assert_same_bits(numba(*values), expected)
    for row in (0, 3):
        single = [value[row].copy() for value in values]
        assert_same_bits(numba(*single), tuple(part[row] for part in as_tuple(expected)))
    assert_same_bits(
        numba(*(value[:1] for value in values)), tuple(p[:1] for p in as_tuple(expected))
    )


@pytest.mark.parametrize("name", ["quadrupteron-oblique", "quadrupteron +-+-", "tripteron"])
def test_numba_on_other_machines(name):
    robot = MECHANISMS[name]
    values = values_of(robot, DYNAMICS)
    expected = compiled(robot, DYNAMICS, "vm")(*values)
    assert_same_bits(compiled(robot, DYNAMICS, "numba")(*values), expected)


@pytest.mark.parametrize(
    "name",
    ["quadrupteron", "quadrupteron-oblique", "tripteron", "tripteron-oblique", "quadrupteron +-+-"],
)
def test_general_code_serves_every_machine_of_a_topology(name):
    robot = MECHANISMS[name]
    values = values_of(robot, DYNAMICS)
    expected = compiled(robot, DYNAMICS, "vm")(*values)
    general = compiled(robot, DYNAMICS, "vm", grade="general")
    assert_close(general(*values), expected, 1e-13)
    if compiler() is not None:
        fast = compiled(robot, DYNAMICS, "c", grade="general")
        assert_same_bits(fast(*values), general(*values))
        other = random_machine(3, robot.platform.turns)
        assert compiled(other, DYNAMICS, "c", grade="general").source == fast.source


@needs_compiler
@pytest.mark.parametrize("name", CATALOG)
@pytest.mark.parametrize("what", ["inverse_kinematics", "jacobian", DYNAMICS])
def test_float32_in_c(name, what):
    robot = CATALOG[name]
    values = values_of(robot, what)
    kernel, exact = compiled(robot, what, "c", dtype="float32"), compiled(robot, what, "vm")
    found = kernel(*values)
    assert found.dtype == np.float32
    # A leg bent by 0.3 rad loses a digit and a half more than one bent by half a right angle.
    assert_close(found, exact(*values), 1e-4)
    inside = well_inside(robot, kernel)
    assert_close(kernel(*inside), exact(*inside), 1e-5)
    assert kernel(*(value[0].astype(np.float32) for value in values)).dtype == np.float32


@pytest.mark.parametrize("what", SOME)
@pytest.mark.parametrize("name", CATALOG)
def test_jax(name, what):
    pytest.importorskip("jax")
    robot = CATALOG[name]
    values = values_of(robot, what)
    expected = compiled(robot, what, "vm")(*values)
    assert_close(compiled(robot, what, "jax")(*values), expected, 1e-13)


def test_jax_is_a_pure_function_that_jits_maps_and_differentiates():
    jax = pytest.importorskip("jax")
    kernel = compiled(ROBOT, DYNAMICS, "jax")
    motion = states(ROBOT, 20)
    expected = compiled(ROBOT, DYNAMICS, "vm")(*motion)
    assert_close(jax.jit(kernel)(*motion), expected, 1e-13)
    assert_close(jax.vmap(kernel)(*motion), expected, 1e-13)
    assert_close(
        jax.vmap(kernel, (0, None, None))(motion[0], motion[1][0], motion[2][0]),
        compiled(ROBOT, DYNAMICS, "vm")(motion[0], motion[1][0], motion[2][0]),
        1e-13,
    )
    function = program(ROBOT, DYNAMICS).function
    symbols = function.sx_in()
    slopes = ca.Function(
        "slopes", symbols, [ca.jacobian(function(*symbols), ca.vertcat(*symbols[:3]))]
    )
    for state in zip(*motion, strict=True):
        known = np.array(slopes(*state, pteron.parameters(ROBOT)))
        found = np.hstack(jax.jacfwd(kernel, (0, 1, 2))(*state))
        assert np.abs(found - known).max() < 1e-10 * np.abs(known).max()
        back = np.hstack(jax.jacrev(kernel, (0, 1, 2))(*state))
        assert np.abs(back - known).max() < 1e-10 * np.abs(known).max()


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
    with pytest.raises(NoSquareRoot):
        pteron.compile(ROBOT, "link_vectors", "exact")(pose)
    with pytest.raises(DataError, match="one state"):
        pteron.compile(ROBOT, "jacobian", "exact")([pose])


# Reduced models.


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_cheapest_base_parameters_give_the_same_forces(name):
    robot = MECHANISMS[name]
    base = pteron.cheapest_parameters(robot)
    assert base.rank == pteron.base_parameters(robot).rank
    motion = states(robot, 50)
    expected = pteron.inverse_dynamics(robot, *motion)
    kernel = pteron.compile(robot, DYNAMICS, base=base, grade="parametric")
    assert [port.shape for port in kernel.inputs[3:]] == [(base.rank,)]
    assert relative_error(kernel(*motion), expected) < 1e-12
    assert relative_error(pteron.compile(robot, DYNAMICS, base=base)(*motion), expected) < 1e-12
    wrench = motion[1]
    loaded = pteron.compile(robot, "inverse_dynamics_loaded", base=base)(*motion, wrench)
    assert relative_error(loaded, pteron.inverse_dynamics(robot, *motion, wrench)) < 1e-12
    standard = pteron.compile(robot, DYNAMICS, grade="parametric").operations
    assert kernel.operations < standard
    heavy = pteron.with_parameters(robot, 2 * pteron.parameters(robot))
    doubled = pteron.compile(heavy, DYNAMICS, base=base, grade="parametric")
    assert relative_error(doubled(*motion), 2 * expected) < 1e-12


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_the_cheapest_base_parameters_know_no_unit_of_length(size):
    legs = tuple(
        replace(
            leg,
            guide_point=tuple(size * np.array(leg.guide_point)),
            platform_point=tuple(size * np.array(leg.platform_point)),
            upper_length=size * leg.upper_length,
            lower_length=size * leg.lower_length,
            slider_limits=None,
        )
        for leg in random_machine(11, True).legs
    )
    machine = replace(random_machine(11, True), legs=legs)
    base = pteron.cheapest_parameters(machine)
    assert base.names == pteron.cheapest_parameters(random_machine(11, True)).names


@pytest.mark.parametrize("name", CATALOG)
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


@needs_compiler
@pytest.mark.parametrize("target", ["c", "numba"])
def test_layouts_that_are_not_plain_are_served_all_the_same(target):
    kernel = compiled(ROBOT, DYNAMICS, target)
    motion = states(ROBOT, 24)
    expected = compiled(ROBOT, DYNAMICS, "vm")(*motion)
    assert_same_bits(kernel(*(np.asfortranarray(value) for value in motion)), expected)
    wide = [np.repeat(value, 2, axis=1)[:, ::2] for value in motion]
    assert not wide[0].flags.c_contiguous
    assert_same_bits(kernel(*wide), expected)
    assert_same_bits(kernel(*(value.tolist() for value in motion)), expected)
    assert_same_bits(kernel(*(value[0].tolist() for value in motion)), expected[0])
    cube = [value.reshape(2, 3, 4, 4) for value in motion]
    assert_same_bits(kernel(*cube), expected.reshape(2, 3, 4, 4))
    assert_same_bits(
        kernel(motion[0], motion[1][:1], motion[2][:1]),
        compiled(ROBOT, DYNAMICS, "vm")(motion[0], motion[1][:1], motion[2][:1]),
    )
    frozen = [value.copy() for value in motion]
    for value in frozen:
        value.setflags(write=False)
    assert_same_bits(kernel(*frozen), expected)
    assert_same_bits(kernel(*(value[0] for value in frozen)), expected[0])
    raw = np.empty(motion[0].nbytes + 1, np.uint8)
    unaligned = raw[1:].view(np.float64).reshape(motion[0].shape)
    unaligned[:] = motion[0]
    assert not unaligned.flags.aligned
    assert_same_bits(kernel(unaligned, *motion[1:]), expected)
    assert_same_bits(kernel(unaligned[0], *(value[0] for value in motion[1:])), expected[0])
    swapped = [value.astype(">f8") for value in motion]
    assert_same_bits(kernel(*swapped), expected)
    assert_same_bits(kernel(np.zeros((0, 4)), np.zeros((0, 4)), np.zeros((0, 4))), np.zeros((0, 4)))


@needs_compiler
@pytest.mark.parametrize("target", ["c", "numba", "jax"])
def test_wrong_shapes_are_refused_as_on_the_virtual_machine(target):
    if target == "jax":
        pytest.importorskip("jax")
    kernel = compiled(ROBOT, DYNAMICS, target)
    zero = np.zeros(4)
    with pytest.raises(DataError, match="2 inputs given, 3 expected"):
        kernel(zero, zero)
    for wrong in ([10**400, 0, 0, 0], np.array(["1", "2", "3", "4"], dtype=object)):
        if target != "jax":
            with pytest.raises(DataError, match="velocity: not an array of real numbers"):
                kernel(zero, wrong, zero)
    for wrong in (np.zeros(3), np.zeros((4, 3)), 0.0):
        with pytest.raises(DataError, match=r"velocity: shape .* given, \(..., 4\) expected"):
            kernel(zero, wrong, zero)


@needs_compiler
def test_threads_share_a_batch_and_change_no_bit():
    motion = [np.tile(value, (200, 1)) for value in states(ROBOT, 101)]
    expected = compiled(ROBOT, DYNAMICS, "c")(*motion)
    for target in ("vm", "c", "numba"):
        assert_same_bits(compiled(ROBOT, DYNAMICS, target, threads=3)(*motion), expected)


@needs_compiler
def test_a_kernel_may_be_called_from_several_threads_at_once():
    kernel = compiled(ROBOT, DYNAMICS, "c")
    motion = [np.tile(value, (100, 1)) for value in states(ROBOT, 50)]
    expected = kernel(*motion)
    with ThreadPoolExecutor(4) as pool:
        for found in pool.map(lambda _: kernel(*motion), range(12)):
            assert_same_bits(found, expected)


def test_nothing_raises_a_floating_point_warning():
    far = np.full((3, 4), 1e3)
    for target in ("vm", "numba", *(["c"] if compiler() else [])):
        with np.errstate(all="raise"):
            assert np.isnan(compiled(ROBOT, DYNAMICS, target)(far, far, far)).all()
            assert np.isnan(compiled(ROBOT, "inverse_kinematics", target)(far)).all()


def test_choices_that_are_not_there_are_refused():
    for options, message in (
        ({"grade": "best"}, "grade: 'best' is not one of specialised, parametric, general"),
        ({"dtype": "float16"}, "dtype: 'float16' given, target \"vm\" has float64"),
        ({"dtype": "float32"}, "dtype: 'float32' given, target \"vm\" has float64"),
        ({"threads": 0}, "threads: 0 given, 1 or more expected"),
    ):
        with pytest.raises(ModelError, match=message):
            pteron.compile(ROBOT, DYNAMICS, **options)


# The cache.


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    monkeypatch.setenv("PTERON_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def another():
    """Return a kernel of its own: the cached ones have loaded their code."""
    built = program(ROBOT, "jacobian")
    return c_target.Compiled(built.name, built.function, built.inputs, built.outputs)


POSE = np.array([0.01, 0.02, 0.03, 0.1])


@needs_compiler
def test_a_second_start_compiles_nothing(fresh, monkeypatch):
    kernel = another()
    assert not kernel.is_cached()
    expected = kernel(POSE)
    assert [path.name for path in fresh.iterdir()] == [kernel._name]
    monkeypatch.setattr(c_target.Compiled, "_build", None)
    again = another()
    assert again.is_cached()
    np.testing.assert_array_equal(again(POSE), expected)


@needs_compiler
@pytest.mark.parametrize("harm", ["cut", "changed", "no manifest", "empty manifest", "no library"])
def test_a_damaged_entry_is_built_again(fresh, harm):
    expected = another()(POSE)
    (folder,) = fresh.iterdir()
    library = next(path for path in folder.iterdir() if path.suffix == ".so")
    content = library.read_bytes()
    library.unlink()  # this process goes on using the file that it has loaded
    if harm == "cut":
        library.write_bytes(content[:1000])
    elif harm == "changed":
        library.write_bytes(content[:-9] + b"123456789")
    elif harm == "no manifest":
        library.write_bytes(content)
        (folder / "manifest.json").unlink()
    elif harm == "empty manifest":
        library.write_bytes(content)
        (folder / "manifest.json").write_text("")
    again = another()
    assert not again.is_cached()
    np.testing.assert_array_equal(again(POSE), expected)
    assert [path.name for path in fresh.iterdir()] == [again._name]
    assert another().is_cached()


@needs_compiler
def test_what_a_killed_process_left_is_removed_in_time(fresh):
    fresh.mkdir()
    old, new = fresh / ".c-old-1", fresh / ".c-new-1"
    for folder in (old, new):
        folder.mkdir()
        (folder / "kernel.c").write_text("")
    day = time.time() - 24 * 3600
    os.utime(old, (day, day))
    another()(POSE)
    assert not old.exists()
    assert new.exists()


@needs_compiler
def test_processes_that_compile_at_once_do_not_meet(fresh):
    script = textwrap.dedent("""
        import pteron
        robot = pteron.load("quadrupteron")
        for what in ("jacobian", "reach"):
            print(pteron.compile(robot, what, "c")([0.01, 0.02, 0.03, 0.1])[0])
    """)
    running = [
        subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
        for _ in range(4)
    ]
    printed = {process.communicate()[0] for process in running}
    assert [process.returncode for process in running] == [0] * 4
    assert len(printed) == 1
    assert len(list(fresh.iterdir())) == 2


@needs_compiler
def test_a_cache_that_cannot_be_written_costs_speed_alone(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("PTERON_CACHE", str(tmp_path / "file" / "cache"))
    np.testing.assert_array_equal(another()(POSE), pteron.compile(ROBOT, "jacobian")(POSE))


def test_the_numba_code_is_cached_too(fresh):
    script = textwrap.dedent("""
        import sys, time, pteron
        kernel = pteron.compile(pteron.load("tripteron"), "inverse_kinematics", "numba")
        cached = kernel.is_cached()
        print(cached, kernel([0.01, 0.02, 0.03]))
    """)
    runs = [
        subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
        for _ in range(2)
    ]
    first, second = (run.stdout for run in runs)
    assert first.replace("False", "True") == second
    assert first != second


@needs_compiler
def test_a_compiler_that_fails_is_one_line(fresh, monkeypatch):
    monkeypatch.setattr(c_target, "compiler", lambda: "/bin/false")
    with pytest.raises(ModelError, match=r'^target: "c" could not be compiled with /bin/false: .*'):
        another()(POSE)
    assert list(fresh.iterdir()) == []
    monkeypatch.setattr(c_target, "compiler", lambda: None)
    with pytest.raises(ModelError, match='target: "c" needs a C compiler'):
        another()(POSE)


def test_a_missing_jax_is_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "jax", None)
    kernel = pteron.compile(ROBOT, "jacobian", "jax", threads=2)
    with pytest.raises(
        ModelError, match=r'target: "jax" needs JAX, .* pip install "pteron\[jax\]"'
    ):
        kernel(POSE)


# The policy of the public functions.


@pytest.fixture
def eager(fresh, monkeypatch):
    """Ask for C code at once, and forget what other tests have loaded."""
    monkeypatch.setenv("PTERON_KERNELS", "auto")
    monkeypatch.setattr(choice, "_PATIENCE", 0.0)
    for known in (choice._known, choice._tier):
        known.cache_clear()
    yield fresh
    for known in (choice._known, choice._tier):
        known.cache_clear()


def wait_for(*kernels):
    for _ in range(600):
        if all(kernel.tier.ready for kernel in kernels):
            return
        time.sleep(0.05)
    raise AssertionError("no C code within 30 s")


@needs_compiler
def test_the_public_functions_move_to_c_and_return_the_same_bits(eager):
    motion = states(ROBOT, 300)
    calls = {
        DYNAMICS: lambda: pteron.inverse_dynamics(ROBOT, *motion),
        "reach": lambda: numeric(ROBOT, "reach")(motion[0]),
        "regularity": lambda: numeric(ROBOT, "regularity")(motion[0]),
        "link_vectors": lambda: pteron.link_vectors(ROBOT, motion[0]),
    }
    before = {what: call() for what, call in calls.items()}
    for what, call in calls.items():
        for _ in range(600):
            call()
            if numeric(ROBOT, what).tier.ready:
                break
            time.sleep(0.05)
        assert numeric(ROBOT, what).tier.ready
    for what, call in calls.items():
        assert_same_bits(call(), before[what])
        assert numeric(ROBOT, what)._direct is not None
    heavy = pteron.with_parameters(ROBOT, 2 * pteron.parameters(ROBOT))
    assert numeric(heavy, DYNAMICS).tier is numeric(ROBOT, DYNAMICS).tier
    np.testing.assert_allclose(
        pteron.inverse_dynamics(heavy, *motion), 2 * before[DYNAMICS], rtol=1e-12
    )


@needs_compiler
def test_a_large_batch_changes_over_on_its_way(eager, monkeypatch):
    monkeypatch.setattr(choice, "_CHUNK", 64)
    motion = [np.tile(value, (40, 1)) for value in states(ROBOT, 100)]
    kernel = numeric(ROBOT, DYNAMICS)
    expected = pteron.compile(ROBOT, DYNAMICS, grade="parametric")(*motion)
    ran = []
    tier = kernel.tier
    original = c_target.Compiled._run

    def missed(seconds):
        ran.append("vm")
        if len(ran) == 3:
            tier.code.prepare()
            tier.ready = True

    monkeypatch.setattr(tier, "missed", missed)
    monkeypatch.setattr(
        c_target.Compiled, "_run", lambda *args: (ran.append("c"), original(*args))[1]
    )
    assert_same_bits(kernel(*motion), expected)
    assert ran[:3] == ["vm"] * 3
    assert set(ran[3:]) == {"c"}
    assert len(ran) == 4000 // 64 + 1


def test_the_virtual_machine_can_be_insisted_on(eager, monkeypatch):
    monkeypatch.setenv("PTERON_KERNELS", "vm")
    motion = states(ROBOT, 10)
    pteron.inverse_dynamics(ROBOT, *motion)
    assert not numeric(ROBOT, DYNAMICS).tier.ready
    assert threading.active_count() == 1 or not any(
        thread.name == "pteron-compile" for thread in threading.enumerate()
    )
    assert not eager.exists()


@pytest.mark.parametrize("broken", [None, "/bin/false"])
def test_without_a_working_compiler_the_public_functions_go_on(eager, monkeypatch, broken):
    monkeypatch.setattr(choice, "compiler", lambda: broken)
    monkeypatch.setattr(c_target, "compiler", lambda: broken)
    motion = states(ROBOT, 10)
    first = pteron.inverse_dynamics(ROBOT, *motion)
    for _ in range(20):
        assert_same_bits(pteron.inverse_dynamics(ROBOT, *motion), first)
        time.sleep(0.01)
    assert not numeric(ROBOT, DYNAMICS).tier.ready


def test_nothing_is_compiled_at_import(fresh):
    script = (
        "import sys, pteron; r = pteron.load('quadrupteron');"
        "pteron.inverse_dynamics(r, [0] * 4, [0] * 4, [0] * 4);"
        "print(sorted({'numba', 'llvmlite', 'jax', 'sympy'} & set(sys.modules)))"
    )
    environment = {**os.environ, "PTERON_KERNELS": "auto"}
    run = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, env=environment
    )
    assert run.stdout.strip() == "[]"
    assert not fresh.exists()


def test_the_cache_has_a_place_of_its_own(monkeypatch):
    monkeypatch.delenv("PTERON_CACHE")
    assert cache.directory().parts[-2:] == ("pteron", "kernels")
