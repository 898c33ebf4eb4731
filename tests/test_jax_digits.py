"""A float64 kernel of JAX has 64 bits from where it is compiled, in a process of its own each."""

import subprocess
import sys
from importlib.util import find_spec

import pytest
from mechanisms import CLIENTS, NIGHTLY

pytestmark = pytest.mark.skipif(find_spec("jax") is None, reason="jax is not installed")

_BEGIN = """
import jax, numpy as np, pteron
from jax import numpy as jnp
robot = pteron.load("quadrupteron")
state = [0.01, -0.02, 0.03, 0.2], [0.1, 0.0, -0.2, 1.0], [2.0, 1.0, 0.0, 5.0]
"""

_STATE = """
kernel = pteron.compile(robot, "inverse_dynamics", "jax")
given = [jnp.array(part) for part in state]
forces, slopes = kernel(*given), jax.jacfwd(kernel)(*given)
assert forces.dtype == slopes.dtype == np.float64
exact = pteron.compile(robot, "inverse_dynamics", "vm")(*state)
assert np.abs(forces - exact).max() < 1e-12 * np.abs(exact).max()
"""

_PARAMETERS = """
kernel = pteron.compile(robot, "inverse_dynamics", "jax", grade="parametric")
values = jnp.array(pteron.parameters(robot))
slopes = jax.grad(lambda given: (kernel(*state, parameters=given) ** 2).sum())(values)
regressor = pteron.compile(robot, "regressor", "vm")(*state)
exact = 2.0 * regressor.T @ (regressor @ pteron.parameters(robot))
assert slopes.dtype == np.float64
assert np.abs(slopes - exact).max() < 1e-12 * np.abs(exact).max()
"""

_BEFORE = """
early = jnp.array(pteron.parameters(robot))
kernel = pteron.compile(robot, "inverse_dynamics", "jax", grade="parametric")
for call in (kernel, jax.jacfwd(lambda given: kernel(*state, parameters=given))):
    try:
        kernel(*state, parameters=early) if call is kernel else call(early)
    except pteron.DataError as error:
        assert "parameters: a float32 array of JAX given, float64 expected" in str(error)
    else:
        raise AssertionError
small = pteron.compile(robot, "inverse_dynamics", "jax", grade="parametric", dtype="float32")
assert small(*state, parameters=early).dtype == np.float32
"""


@CLIENTS
@pytest.mark.parametrize(
    "code",
    [
        pytest.param(_STATE, id="state", marks=NIGHTLY),
        pytest.param(_PARAMETERS, id="slopes"),
        pytest.param(_BEFORE, id="early", marks=NIGHTLY),
    ],
)
def test_digits_of_the_first_kernel_of_a_process(code):
    command = [sys.executable, "-W", "error", "-c", _BEGIN + code]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
