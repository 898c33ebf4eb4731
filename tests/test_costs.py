"""Every form of the model gives the same forces, operations are counted, and Table 1 agrees."""

import numpy as np
import pytest
from mechanisms import CATALOG, gated, relative_error, states

import pteron
from pteron.kernels import count_operations
from pteron.reduction import FORMS, model_forms
from pteron.report import table1


@pytest.mark.parametrize("name", gated(["quadrupteron", "delta", "wrist"], ["delta"]))
def test_every_form_gives_the_same_forces(name):
    robot = pteron.load(name)
    base = pteron.base_parameters(robot)
    motion = states(robot, 40)
    forces = pteron.inverse_dynamics(robot, *motion)
    kernels = model_forms(base)
    sets = {(form, which) for form in FORMS for which in ("complete", "reduced")}
    assert set(kernels) == sets | {("factored", "cheapest")}
    for kernel in kernels.values():
        assert relative_error(kernel(*motion), forces) < 1e-11


def test_operations_of_a_hexapod():
    """Eq. (15) as it is written takes 6064."""
    assert pteron.compile("stewart", "inverse_dynamics", grade="parametric").operations <= 1260


def test_operations_of_the_quadrupteron():
    robot = CATALOG["quadrupteron"]
    kernels = model_forms(pteron.base_parameters(robot))
    count = {key: kernel.operations for key, kernel in kernels.items()}
    assert count["factored", "complete"] <= 430
    assert pteron.compile(robot, "inverse_dynamics").operations <= 400
    # Against Eq. (15) as it is written, shared subexpressions found.
    assert count["factored", "cheapest"] <= 0.42 * count["regressor", "complete"]
    assert count["factored", "cheapest"] <= 0.82 * count["factored", "complete"]
    assert count["factored", "reduced"] <= 0.9 * count["factored", "complete"]
    for form in FORMS:
        assert count[form, "reduced"] < count[form, "complete"]
    assert count["factored", "complete"] < count["regressor", "reduced"]
    # J^-T included: the forces of the complete form depend on phi through it.
    function = kernels["factored", "complete"].function
    assert count_operations(function) == count["factored", "complete"]
    assert function.nnz_in(3) == 40


def test_table_1_agrees_row_by_row():
    rows = table1.rows()
    assert [row.parameter for row in rows] == [f"P_b{i}" for i in range(1, 27)]
    assert all(row.agrees for row in rows)


@pytest.mark.parametrize(
    ("printed", "computed", "agrees"),
    [
        ("m_e - 625 I_e", "m_e - 625 I_e", True),
        ("m_e - 625 I_e", "m_e + 625 I_e", False),
        ("I_u1 + 0.83 I_l1", "I_u1 + 0.828656 I_l1", True),
        ("I_u1 + 0.83 I_l1", "I_u1 + 0.824 I_l1", False),
        ("I_u1 + 0.83 I_l1", "I_u1", False),
    ],
)
def test_a_row_that_differs_is_seen(printed, computed, agrees):
    assert table1.agree(printed, computed) is agrees


def test_a_regressor_needs_its_base():
    robot = CATALOG["quadrupteron"]
    base = pteron.base_parameters(robot)
    motion = states(robot, 5)
    kernel = pteron.compile(robot, "base_regressor", base=base)
    found = pteron.base_regressor(robot, base, *motion)
    np.testing.assert_allclose(kernel(*motion), found, rtol=1e-12, atol=1e-12)
    with pytest.raises(pteron.ModelError, match="base: missing"):
        pteron.compile(robot, "base_regressor")
    with pytest.raises(pteron.ModelError, match="has no use for it"):
        pteron.compile(robot, "jacobian", base=base)
