"""Compiled functions: what they are called with, what they cost, and exact arithmetic."""

import os
import random
import re
from fractions import Fraction
from functools import lru_cache

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from mechanisms import CATALOG, MECHANISMS, states

import pteron
from pteron import atomic
from pteron.errors import DataError, ModelError, OutputError
from pteron.kernels import (
    FUNCTIONS,
    NoSquareRoot,
    PrimeField,
    RationalField,
    count_operations,
    evaluate,
    general_program,
    program,
)
from pteron.reduction.configurations import Topology, rational_rows
from pteron.reduction.exact_geometry import exact_geometry

ROBOT = CATALOG["quadrupteron"]
PRIME = 2**61 - 1


# compile().


def test_unknown_functions_and_targets_are_refused_with_the_choices():
    with pytest.raises(ModelError) as caught:
        pteron.compile(ROBOT, "inverse_dynamic")
    assert str(caught.value) == (
        f"what: 'inverse_dynamic' cannot be compiled; choose from {', '.join(FUNCTIONS)}"
    )
    with pytest.raises(ModelError, match="target: 'fortran' is not known; choose from vm, numba"):
        pteron.compile(ROBOT, "jacobian", "fortran")


@lru_cache
def kernel_of(robot, what):
    """Return the kernel of any function; that of the base regressor needs base parameters."""
    base = pteron.base_parameters(robot) if what == "base_regressor" else None
    return pteron.compile(robot, what, base=base, grade="parametric")


def test_base_parameters_go_with_their_regressor_alone():
    base = pteron.base_parameters(ROBOT)
    with pytest.raises(ModelError, match='base: missing; "base_regressor" needs base='):
        pteron.compile(ROBOT, "base_regressor")
    with pytest.raises(ModelError, match="base: 'jacobian' has no use for it"):
        pteron.compile(ROBOT, "jacobian", base=base)
    motion = states(ROBOT, 5)
    found = kernel_of(ROBOT, "base_regressor")(*motion)
    expected = pteron.regressor(ROBOT, *motion) @ base.selection
    assert found.shape == (5, 4, base.rank)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


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
        "sliders": pteron.inverse_kinematics(robot, pose),
        "slider_rates": velocity,
        "slider_accelerations": acceleration,
    }
    return [known[port.name].reshape(*lead, robot.freedom) for port in kernel.inputs]


@pytest.mark.parametrize("what", FUNCTIONS)
@pytest.mark.parametrize("name", ["quadrupteron", "tripteron-oblique"])
def test_every_function_compiles_and_keeps_its_shapes(name, what):
    robot = CATALOG[name]
    kernel = kernel_of(robot, what)
    for lead in ((), (2, 3)):
        found = kernel(*values_for(robot, kernel, lead))
        found = found if isinstance(found, tuple) else (found,)
        assert len(found) == len(kernel.outputs)
        for array, port in zip(found, kernel.outputs, strict=True):
            assert array.shape == lead + port.shape
            assert np.isfinite(array).any()
    assert kernel.name == what
    assert kernel.operations == count_operations(kernel.function)
    assert what in kernel.source
    assert {port.name for port in kernel.ports} - {"parameters"} == {p.name for p in kernel.inputs}
    for port in kernel.ports:
        assert port.shape == (len(pteron.parameter_names(robot)) if port.shared else robot.freedom,)
        assert port.shared == (port.name == "parameters")
        assert port.name in kernel.source


PUBLIC = {
    "inverse_kinematics": pteron.inverse_kinematics,
    "link_vectors": pteron.link_vectors,
    "jacobian": pteron.jacobian,
    "link_jacobians": pteron.link_jacobians,
    "joint_screws": pteron.joint_screws,
    "inverse_dynamics": pteron.inverse_dynamics,
    "inverse_dynamics_loaded": pteron.inverse_dynamics,
    "forward_dynamics": pteron.forward_dynamics,
    "forward_dynamics_loaded": pteron.forward_dynamics,
    "mass_matrix": pteron.mass_matrix,
    "coriolis_matrix": pteron.coriolis_matrix,
    "bias_forces": pteron.bias_forces,
    "gravity_forces": pteron.gravity_forces,
    "kinetic_energy": pteron.kinetic_energy,
    "potential_energy": pteron.potential_energy,
    "regressor": pteron.regressor,
}


@pytest.mark.parametrize("what", PUBLIC)
def test_a_kernel_gives_what_its_public_function_gives(what):
    kernel = pteron.compile(ROBOT, what, grade="parametric")
    values = values_for(ROBOT, kernel, (5,))
    found, expected = kernel(*values), PUBLIC[what](ROBOT, *values)
    if not isinstance(found, tuple):
        found, expected = (found,), (expected,)
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_array_equal(a, b)


def test_machines_of_one_geometry_share_a_program_but_not_their_parameters():
    heavy = pteron.with_parameters(ROBOT, 2 * pteron.parameters(ROBOT))
    light, heavy = (
        pteron.compile(r, "inverse_dynamics", grade="parametric") for r in (ROBOT, heavy)
    )
    assert light.function is heavy.function
    values = values_for(ROBOT, light, (4,))
    np.testing.assert_allclose(heavy(*values), 2 * light(*values), rtol=1e-13)
    assert pteron.compile(ROBOT, "inverse_dynamics", grade="parametric") is light


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


@pytest.mark.parametrize("batch", [1, 255, 256, 257, 512, 700])
def test_blocks_of_the_virtual_machine_are_seamless(batch):
    kernel = pteron.compile(ROBOT, "joint_accelerations")
    values = states(ROBOT, batch)
    found = kernel(*values)
    for i in {0, batch // 2, min(255, batch - 1), batch - 1}:
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


@pytest.mark.parametrize("what", FUNCTIONS)
def test_the_count_is_that_of_the_listing(what):
    function = kernel_of(ROBOT, what).function
    assert count_operations(function) == walked(function)


def test_the_quadrupterons_inverse_dynamics_is_cheap():
    assert 200 < pteron.compile(ROBOT, "inverse_dynamics").operations <= 450


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
@settings(deadline=None, derandomize=True, max_examples=25)
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


@pytest.mark.parametrize("name", CATALOG)
def test_the_general_program_is_the_machines_own(name):
    """The geometry as an input gives what the geometry folded in gives."""
    robot = CATALOG[name]
    own = program(robot, "regressor").function
    general = general_program(robot.freedom, robot.platform.turns, "regressor").function
    vector = np.array(geometry_vector(robot))
    for state in zip(*states(robot, 5), strict=True):
        expected = own(*state).full()
        scale = np.abs(expected).max()
        found = general(vector, *state).full()
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * scale)


def geometry_vector(robot):
    """Return r, d, e, a, s0, lu, ll and sigma of every leg; then x0, y0, k and gravity."""
    values = []
    for leg in robot.legs:
        across = np.cross(leg.direction, np.eye(3)[np.argmin(np.abs(leg.direction))])
        values += [*leg.guide_point, *leg.direction, *leg.e, *across / np.linalg.norm(across)]
        values += [*leg.platform_point, leg.upper_length, leg.lower_length, leg.elbow]
    return [*values, *np.ravel(robot.platform.frame), *robot.gravity]


@pytest.mark.parametrize("name", ["quadrupteron", "tripteron"])
def test_the_exact_regressor_is_the_float_one_at_a_rational_configuration(name, monkeypatch):
    robot = CATALOG[name]
    topology = Topology(robot.freedom, robot.platform.turns)
    seen = []

    def spy(function, field, inputs):
        if function.name() == "regressor":
            seen.append(inputs)
        return evaluate(function, field, inputs)

    monkeypatch.setattr("pteron.reduction.configurations.evaluate", spy)
    rows = rational_rows(topology, exact_geometry(robot), 3, random.Random(5))
    assert len(rows) == 3 * robot.freedom
    assert all(isinstance(value, Fraction) for row in rows for value in row)
    exact = np.array(rows, dtype=float).reshape(3, robot.freedom, -1)
    general = general_program(robot.freedom, robot.platform.turns, "regressor").function
    for inputs, matrix in zip(seen, exact, strict=True):
        geometry, pose, *motion = (np.array(part, dtype=float) for part in inputs)
        if robot.platform.turns:
            pose[3] = 2 * np.arctan(pose[3])
        found = general(geometry, pose, *motion).full().T
        # A random configuration may be near a singular one, and what comes of it may cancel.
        scale = np.abs(matrix).max(axis=-1, keepdims=True)
        assert (np.abs(found - matrix) / scale).max() < 1e-9


def test_every_working_mode_is_cheap():
    costs = {
        pteron.compile(mode, "inverse_dynamics").operations
        for mode in pteron.working_modes(MECHANISMS["quadrupteron"])
    }
    assert max(costs) <= 450


# Files written whole or not at all.


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
