"""Compiled functions: what they are called with, what they cost, and exact arithmetic."""

import os
import re
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st
from mechanisms import CATALOG, CLIENTS, MACHINES, MECHANISMS, NEAREST, gated, states

import pteron
from pteron import atomic
from pteron.controllers import CONTROLLERS
from pteron.dynamics import drive_forces
from pteron.equations.drives import drive_numbers
from pteron.equations.machine import numbers
from pteron.errors import DataError, ModelError, OutputError
from pteron.indices import Tolerances, pose_error
from pteron.kernels import (
    FUNCTIONS,
    LOADED,
    SELECTED,
    NoSquareRoot,
    PrimeField,
    RationalField,
    columns_of,
    count_operations,
    evaluate,
    general_program,
    numeric,
    program,
    sharing_programs,
)
from pteron.manipulator import load, with_dimensions
from pteron.workspace import pose_margins

ROBOT = CATALOG["quadrupteron"]
PRIME = 2**61 - 1


# compile().


def test_unknown_functions_and_options_out_of_place_are_refused_with_the_choices():
    with pytest.raises(ModelError) as caught:
        pteron.compile(ROBOT, "inverse_dynamic")
    assert str(caught.value) == (
        f"what: 'inverse_dynamic' cannot be compiled; choose from {', '.join(FUNCTIONS)}"
    )
    with pytest.raises(ModelError, match="target: 'fortran' is not known; choose from vm, numba"):
        pteron.compile(ROBOT, "jacobian", "fortran")
    with pytest.raises(ModelError, match=r"wrench: 'jacobian' has no use for it; it goes with inv"):
        pteron.compile(ROBOT, "jacobian", wrench=True)
    with pytest.raises(ModelError, match='base: missing; "base_regressor" needs base='):
        pteron.compile(ROBOT, "base_regressor")
    base = pteron.base_parameters(ROBOT)
    with pytest.raises(ModelError, match="base: 'jacobian' has no use for it"):
        pteron.compile(ROBOT, "jacobian", base=base)
    with pytest.raises(ModelError, match='base: a choice for one machine; use grade "specialised"'):
        pteron.compile(ROBOT, "inverse_dynamics", base=base, grade="general")
    with pytest.raises(pteron.ModelError, match="where a machine's numbers are zero"):
        pteron.compile(ROBOT, "constraint", grade="general")


@lru_cache
def kernel_of(robot, what, wrench=False):
    """Return the kernel of any function; that of the base regressor needs base parameters."""
    base = pteron.base_parameters(robot) if what in SELECTED else None
    return pteron.compile(robot, what, base=base, wrench=wrench, grade="parametric")


def values_for(robot, kernel, lead=()):
    """Return inputs for a kernel: poses in reach, and rates at random."""
    count = int(np.prod(lead, dtype=int))
    pose, velocity, acceleration = states(robot, count)
    known = {
        "pose": pose,
        "velocity": velocity,
        "acceleration": acceleration,
        "forces": acceleration,
        "wrench": velocity,
        "joints": pteron.inverse_kinematics(robot, pose),
        "joint_rates": velocity,
        "joint_accelerations": acceleration,
        "twist": pteron.twist(robot, pose, velocity),
        "mass": np.ones((count, 1)),
        "center": np.full((count, 3), 0.1),
        "inertia": np.full((count, 1), 0.01),
        "pivot": np.full((count, 3), 0.1),
    }
    if kernel.name in CONTROLLERS:
        law = CONTROLLERS[kernel.name].law(robot)
        known |= {"memory": law.memory(pose, velocity), "gains": law.gains}
    return [
        known[port.name].reshape(*(() if port.shared else lead), *port.shape)
        for port in kernel.inputs
    ]


PUBLIC = {
    name: getattr(package, name)
    for package in (pteron.kinematics, pteron.dynamics, pteron.reduction)
    for name in FUNCTIONS
    if name in package.__all__ and not name.startswith(("base_", "direct_"))
}


@pytest.mark.parametrize("what", gated(FUNCTIONS, [*FUNCTIONS][::2]))
@pytest.mark.parametrize("name", gated(["quadrupteron", "random PRR 0", "five-bar"], ["five-bar"]))
def test_every_function_compiles_and_gives_what_the_public_one_gives(name, what):
    robot = MACHINES[name]
    for wrench in (False, *([True] if what in LOADED else [])):
        kernel = kernel_of(robot, what, wrench)
        values = values_for(robot, kernel, (2, 3))
        found = kernel(*values)
        found = found if isinstance(found, tuple) else (found,)
        for array, port in zip(found, kernel.outputs, strict=True):
            assert array.shape == (2, 3, *port.shape)
            assert np.isfinite(array).any()
        if what in PUBLIC:
            expected = PUBLIC[what](robot, *values)
            if isinstance(expected, pteron.kinematics.JointMotion):
                expected = tuple(vars(expected).values())
            expected = expected if isinstance(expected, tuple) else (expected,)
            for a, b in zip(found, expected, strict=True):
                # The public one has a status as well, and its sums may be grouped otherwise.
                scale = np.nanmax(np.abs(b), initial=0.0)
                np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * scale)
        assert kernel.name == what
        assert kernel.operations == count_operations(kernel.function) == walked(kernel.function)
        assert what in kernel.source
        inputs = {port.name for port in kernel.inputs}
        fixed = {"parameters": len(pteron.parameters(robot)), "drives": len(drive_numbers(robot))}
        assert {port.name for port in kernel.ports} - fixed.keys() == inputs
        sizes = {**fixed, "twist": 6, "mass": 1, "center": 3, "inertia": 1, "pivot": 3}
        if what in CONTROLLERS:
            law = CONTROLLERS[what].law(robot)
            sizes |= {"gains": law.gains.size, "memory": law.memory(*[values[0][0, 0]] * 2).size}
        for port in kernel.ports:
            assert port.shape == (sizes.get(port.name, robot.freedom),)
            assert port.shared == (port.name in (*fixed, "gains"))
            assert port.name in kernel.source


def test_machines_of_one_geometry_share_a_program_but_not_their_parameters():
    # A machine of no other test, since a program may be forgotten sooner than what it made.
    robot = replace(ROBOT, gravity=(1.0, 2.0, -9.0))
    heavy = pteron.with_parameters(robot, 2 * pteron.parameters(robot))
    light, heavy = (
        pteron.compile(r, "inverse_dynamics", grade="parametric") for r in (robot, heavy)
    )
    assert light.function is heavy.function
    values = values_for(robot, light, (4,))
    np.testing.assert_allclose(heavy(*values), 2 * light(*values), rtol=1e-13)
    assert pteron.compile(robot, "inverse_dynamics", grade="parametric") is light


def test_a_program_of_base_parameters_has_its_status_too():
    base = pteron.base_parameters(ROBOT)
    asked = program(ROBOT, "inverse_dynamics", columns_of(base), guarded=True)
    assert [port.name for port in asked.outputs] == ["forces", "status"]
    pose, velocity, acceleration = states(ROBOT, 1)
    state = [pose[0], velocity[0], acceleration[0], base.values()]
    forces, status = asked.function.call(state)
    expected = pteron.inverse_dynamics(ROBOT, pose[0], velocity[0], acceleration[0])
    np.testing.assert_allclose(forces.full().ravel(), expected, rtol=1e-9)
    assert float(status) == 1.0
    state[0] = pose[0] + 100.0
    assert float(asked.function.call(state)[1]) == 0.0


def test_inputs_of_wrong_number_or_shape_are_refused():
    kernel = pteron.compile(ROBOT, "inverse_dynamics")
    zero = np.zeros(4)
    with pytest.raises(DataError) as caught:
        kernel(zero, zero)
    assert str(caught.value) == (
        "inverse_dynamics: 2 inputs given, 3 expected (pose, velocity, acceleration)"
    )
    with pytest.raises(DataError, match=r"velocity: shape \(3,\) given, \(..., 4\) expected"):
        kernel(zero, np.zeros(3), zero)
    with pytest.raises(DataError, match="acceleration: not an array of real numbers"):
        kernel(zero, zero, "zero")
    with pytest.raises(DataError, match=r"do not broadcast: pose \(2,\), velocity \(3,\), acc"):
        kernel(np.zeros((2, 4)), np.zeros((3, 4)), zero)


def test_leading_axes_broadcast():
    kernel = pteron.compile(ROBOT, "inverse_dynamics")
    pose, velocity, acceleration = states(ROBOT, 6)
    found = kernel(pose[:, None], velocity[:3], acceleration[0])
    assert found.shape == (6, 3, 4)
    np.testing.assert_array_equal(found[4, 2], kernel(pose[4], velocity[2], acceleration[0]))


@pytest.mark.parametrize("batch", [1, 7, 320, 1024, 1300, 1500])
@pytest.mark.parametrize(
    ("name", "what"), [("quadrupteron", "inverse_dynamics"), ("delta", "inverse_kinematics")]
)
def test_blocks_of_the_virtual_machine_are_seamless(name, what, batch):
    robot = pteron.load(name)
    kernel = pteron.compile(robot, what)
    values = [v.copy() for v in states(robot, batch)[: len(kernel.inputs)]]
    values[0][-1, -1] *= 1e7  # sines of large angles are the C library's
    found = kernel(*values)
    for i in {0, batch // 2, min(1023, batch - 1), batch - 1}:
        np.testing.assert_array_equal(found[i], kernel(*(v[i] for v in values)))


def test_the_virtual_machine_is_casadi():
    kernel = pteron.compile(ROBOT, "regressor")
    (state,) = zip(*states(ROBOT, 1), strict=True)
    # Up to the sine and the cosine, which are those of every target.
    expected = kernel.function(*state).full().T
    np.testing.assert_allclose(kernel(*state), expected, atol=1e-14 * np.abs(expected).max())


# Cost.


INSTRUCTION = re.compile(r"^ *(?:@\d+|output\[\d+\]\[\d+\]) = (.*);$", re.MULTILINE)
NO_ARITHMETIC = re.compile(r"nan|input\[\d+\]\[\d+\]|@\d+|-?[\d.]+(?:e[+-]?\d+)?")


def walked(function):
    """Return the operations that CasADi's own listing shows: "@1 = (@2+@3);" and the like.

    Inputs, outputs, moves and constants are instructions without an operation.
    """
    listed = INSTRUCTION.findall(function.str(True))
    assert len(listed) == function.n_instructions()
    return sum(NO_ARITHMETIC.fullmatch(right) is None for right in listed)


X, Y = ca.SX.sym("x"), ca.SX.sym("y")
SMALL = {
    "nothing": ([X], 0),
    "a constant": ([ca.SX(3.0)], 0),
    "a sum": ([X + Y], 1),
    "a square": ([X * X], 1),
    "a shared square": ([X * X + 1, X * X + 2], 3),
    "a norm": ([ca.sqrt(X * X + Y * Y)], 4),
    "a negation": ([-X], 1),
    "a quotient": ([X / Y], 1),
    "an inverse": ([1 / X], 1),
    "twice": ([2 * X], 1),
    "a rotation": ([ca.cos(X) * Y, ca.sin(X) * Y], 4),
    "the same twice": ([ca.cos(X), ca.cos(X)], 1),
    "a polynomial": ([(3 * X + 2) * X + 1], 4),
}


@pytest.mark.parametrize("case", SMALL)
def test_the_count_of_known_functions(case):
    outputs, count = SMALL[case]
    function = ca.Function("small", [X, Y], ca.cse(outputs))
    assert count_operations(function) == count
    assert walked(function) == count


COSTS = {"quadrupteron": (417, 385, 330), "tripteron": (256, 240, 202), "delta": (380, 380, 320)}
"""At most: with the parameters as inputs, folded in, and from the cheapest base parameters."""


@pytest.mark.parametrize("name", gated(COSTS, ["delta"]))
def test_the_inverse_dynamics_are_cheap(name):
    robot = CATALOG[name]
    parametric, specialised, cheapest = COSTS[name]

    def cost(**options):
        return pteron.compile(robot, "inverse_dynamics", **options).operations

    assert cost(grade="parametric") <= parametric
    assert cost() <= specialised
    base = pteron.reduction.cheapest_parameters(robot)
    assert cost(base=base) <= cheapest
    if name == "delta":
        assert base.rank == 13
        assert cost(base=base, grade="parametric") <= cheapest


@CLIENTS
def test_every_working_mode_is_cheap():
    for mode in pteron.working_modes(ROBOT):
        assert pteron.compile(mode, "inverse_dynamics").operations <= 385


# Exact fields.

a, b, c = ca.SX.sym("a"), ca.SX.sym("b"), ca.SX.sym("c")
EXPRESSIONS = {
    "+": a + b,
    "-": a - b,
    "*": a * b,
    "/": a / b,
    "neg": -a,
    "twice": a + a,
    "sq": a * a,
    "inv": 1 / a,
    "constants": 0.25 * a + 3.5 - b / 8,
    "sqrt": ca.sqrt(a * a * b * b),
    "sqrt times": c * ca.sqrt(a * a * b * b) / b,
    "sin": ca.sin(c),
    "cos": ca.cos(c),
    "all": (a + ca.sqrt(a * a * b * b) * ca.sin(c) - a**2 / b) / (1 + (ca.cos(c) - a) ** 2) - (-b),
}
fractions = st.fractions(-20, 20, max_denominator=50)


def on_tape(expression):
    return ca.Function("f", [a, b, c], [expression])


@pytest.mark.parametrize("name", EXPRESSIONS)
@settings(deadline=None, derandomize=True, max_examples=15)
@given(fractions, fractions, fractions)
def test_fields_agree_with_floats(name, first, second, tangent):
    assume(first != 0 and second != 0)
    function = on_tape(EXPRESSIONS[name])
    angle = 2 * np.arctan(float(tangent))
    uses_angle = name in ("sin", "cos", "all")
    third = angle if uses_angle else float(tangent)
    expected = float(function(float(first), float(second), third))
    inputs = [[first], [second], [tangent]]
    ((exact,),) = evaluate(function, RationalField(), inputs)
    assert isinstance(exact, Fraction)
    # Terms of up to 400 may cancel.
    assert float(exact) == pytest.approx(expected, rel=1e-12, abs=1e-12)
    field = PrimeField(PRIME)
    ((residue,),) = evaluate(function, field, [[field.number(v[0])] for v in inputs])
    if name.startswith("sqrt") or name == "all":
        return
    assert residue == field.number(exact)


@settings(deadline=None, derandomize=True, max_examples=50)
@given(st.integers(1, PRIME - 1))
def test_a_root_in_a_prime_field_is_a_root(value):
    field = PrimeField(PRIME)
    square = field.multiply(value, value)
    function = on_tape(ca.sqrt(a))
    ((root,),) = evaluate(function, field, [[square], [0], [0]])
    assert root in (value, PRIME - value)
    assert field.square_root(square) == root
    # -1 is no square where p = 3 (mod 4), so that of x^2 and -x^2 one has a root.
    with pytest.raises(NoSquareRoot):
        evaluate(function, field, [[PRIME - square], [0], [0]])


@pytest.mark.parametrize("value", [2, -4, Fraction(1, 3), Fraction(4, 5), Fraction(-1, 9)])
def test_a_rational_number_without_a_root(value):
    with pytest.raises(NoSquareRoot):
        evaluate(on_tape(ca.sqrt(a)), RationalField(), [[Fraction(value)], [0], [0]])


def test_division_by_zero_is_an_error_in_every_field():
    for field in (RationalField(), PrimeField(PRIME)):
        zero, one = field.number(0), field.number(1)
        for expression in (a / b, 1 / b):
            with pytest.raises(ZeroDivisionError):
                evaluate(on_tape(expression), field, [[one], [zero], [one]])


def test_operations_that_no_field_has_are_refused():
    for expression in (ca.exp(a), ca.atan2(a, b), ca.fabs(a), ca.fmin(a, b), ca.tan(a)):
        with pytest.raises(ValueError, match="is not exact in a field"):
            evaluate(on_tape(expression), RationalField(), [[Fraction(1)]] * 3)


elements = st.integers(0, PRIME - 1)


@settings(deadline=None, derandomize=True, max_examples=100)
@given(elements, elements, elements, fractions, fractions)
def test_a_prime_field_is_a_field(x, y, z, p, q):
    f = PrimeField(PRIME)
    assert f.add(x, y) == f.add(y, x)
    assert f.multiply(x, y) == f.multiply(y, x)
    assert f.add(f.add(x, y), z) == f.add(x, f.add(y, z))
    assert f.multiply(f.multiply(x, y), z) == f.multiply(x, f.multiply(y, z))
    assert f.multiply(x, f.add(y, z)) == f.add(f.multiply(x, y), f.multiply(x, z))
    assert f.add(f.subtract(x, y), y) == x
    if y:
        assert f.multiply(f.divide(x, y), y) == x
    assert all(0 <= v < PRIME for v in (f.add(x, y), f.subtract(x, y), f.multiply(x, y)))
    assert f.number(p + q) == f.add(f.number(p), f.number(q))
    assert f.number(p * q) == f.multiply(f.number(p), f.number(q))
    if q:
        assert f.number(p / q) == f.divide(f.number(p), f.number(q))


def test_a_prime_field_wants_3_modulo_4():
    with pytest.raises(ValueError, match="prime 13: expected 3 modulo 4"):
        PrimeField(13)


@pytest.mark.parametrize("name", [*NEAREST, "random PRR 0"])
def test_the_general_program_is_the_machines_own(name):
    """The geometry as an input gives what the geometry folded in gives."""
    robot = MECHANISMS[name]
    own = program(robot, "regressor").function
    general = general_program(robot, "regressor").function
    vector = np.array(numbers(robot))
    for state in zip(*states(robot, 5), strict=True):
        expected = own(*state).full()
        found = general(vector, *state).full()
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


# Files written whole or not at all.


def test_machines_that_are_alike_share_general_programs():
    robot = load("delta")
    other = with_dimensions(robot, base_radius=0.3, crank=0.45, limits=(-1.6, 1.0))
    poses = np.array([0.0, 0.0, -0.9]) + 0.1 * np.random.default_rng(3).uniform(-1, 1, (9, 3))
    tolerances = Tolerances(joints=1e-5, length=1e-5)

    def results():
        return (
            drive_forces(other, poses, poses, poses),
            pose_error(other, poses, tolerances).worst,
            pose_margins(other, poses).joints,
        )

    own = results()
    with sharing_programs(robot):
        for found, expected in zip(results(), own, strict=True):
            np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-14)
        assert "geometry" in numeric(other, "jacobian").fixed
    assert "geometry" not in numeric(other, "jacobian").fixed


def test_text_is_written_whole(tmp_path):
    file = tmp_path / "out.txt"
    assert atomic.write_text(file, "päivää\n") == file
    assert file.read_bytes() == "päivää\n".encode()
    atomic.write_text(str(file), "new")
    assert file.read_text() == "new"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("step", ["fdopen", "replace", "chmod"])
def test_a_failure_keeps_the_old_file(tmp_path, monkeypatch, step):
    file = tmp_path / "out.txt"
    file.write_text("old")

    def fail(*_args, **_kwargs):
        raise OSError(28, "No space left on device")

    owner = os if step == "fdopen" else atomic.Path
    with monkeypatch.context() as patch:
        patch.setattr(owner, step, fail)
        with pytest.raises(OutputError) as caught:
            atomic.write_text(file, "new")
    assert str(caught.value) == f"{file}: cannot be written (No space left on device)"
    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


def test_text_that_is_not_unicode_keeps_the_old_file(tmp_path):
    file = tmp_path / "out.txt"
    file.write_text("old")
    with pytest.raises(pteron.OutputError, match="cannot be written in UTF-8"):
        atomic.write_text(file, "\ud800")
    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


def test_of_several_files_all_are_written_or_none(tmp_path, monkeypatch):
    texts = {"one.h": "new", "one.c": "new"}
    (tmp_path / "one.h").write_text("old")
    opened, room = os.fdopen, iter([True, False])

    def full(*arguments):
        if next(room):
            return opened(*arguments)
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fdopen", full)
        with pytest.raises(OutputError, match=r"one\.c: cannot be written \(No space left"):
            atomic.write_texts(tmp_path, texts)
    assert [path.name for path in tmp_path.iterdir()] == ["one.h"]
    assert (tmp_path / "one.h").read_text() == "old"
    assert atomic.write_texts(tmp_path, texts) == [tmp_path / name for name in texts]
    assert [path.read_text() for path in tmp_path.iterdir()] == ["new", "new"]


def test_a_rename_that_fails_brings_back_the_files_renamed_before(tmp_path, monkeypatch):
    names = ["one.h", "two.h", "three.h"]
    (tmp_path / "one.h").write_text("old")
    (tmp_path / "three.h").write_text("old")
    replace = atomic.Path.replace

    def fail_at_the_third(self, target):
        if target == tmp_path / "three.h":
            raise OSError(28, "No space left on device")
        return replace(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(atomic.Path, "replace", fail_at_the_third)
        with pytest.raises(OutputError, match=r"three\.h: cannot be written"):
            atomic.write_texts(tmp_path, dict.fromkeys(names, "new"))
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {
        "one.h": "old",
        "three.h": "old",
    }
    (tmp_path / "two.h").mkdir()
    with pytest.raises(OutputError, match=r"two\.h: cannot be written .it is a folder"):
        atomic.write_texts(tmp_path, dict.fromkeys(names, "new"))
    assert (tmp_path / "one.h").read_text() == "old"


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_a_file_keeps_its_permissions(tmp_path):
    file = tmp_path / "secret.toml"
    file.write_text("old")
    file.chmod(0o600)
    atomic.write_text(file, "new")
    assert file.stat().st_mode & 0o777 == 0o600


def test_folders_are_made_or_refused(tmp_path):
    folder = tmp_path / "one" / "two"
    assert atomic.make_folder(folder) == folder
    assert atomic.make_folder(folder) == folder
    assert list(folder.iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"cannot be written to as a folder \(it is a file\)"):
        atomic.make_folder(tmp_path / "file")
    with pytest.raises(OutputError, match="cannot be written to as a folder"):
        atomic.make_folder(tmp_path / "file" / "below")
