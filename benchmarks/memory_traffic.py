"""Memory traffic of the program that JAX compiles, and of its derivatives: bytes a state.

A state has 12 numbers to read and 4 to write; a program of several loops also writes and reads what
passes between them. XLA counts the bytes itself, for the device on which this runs.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import casadi as ca
import numpy as np
from measuring import Array, States, quick, random_states, relative_error

import pteron

_DOUBLE = 8


def main() -> None:
    """Print bytes a state and loops, then how far the derivatives are from CasADi's."""
    if find_spec("jax") is None:
        print("memory traffic: left out, the package jax is not installed")
        return
    import jax

    robot = pteron.load("quadrupteron")
    states = random_states(robot, 50)
    expected: Array = pteron.compile(robot, "inverse_dynamics", "vm")(*states)
    cheapest = pteron.reduction.cheapest_parameters(robot)
    count = 1 << 10 if quick() else 1 << 16
    programs: list[tuple[str, Any, int]] = []
    forms = [("forces", None), ("forces, base", cheapest)]
    for name, base in forms[: 1 if quick() else None]:
        kernel = pteron.compile(robot, "inverse_dynamics", "jax", base=base)
        error = relative_error(np.asarray(kernel(*states)), expected)
        if not error < 1e-9:
            sys.exit(f"{name}: the forces are wrong, by {error:.0e}")
        programs.append((name, kernel, 12 + 4))
        programs.append((f"gradient of sum of {name}", gradient(kernel), 12 + 12))

    device = jax.devices()[0]
    print(f"JAX {jax.__version__} on {device.device_kind or device.platform}, float64, ", end="")
    print(f"batches of {count} states; bytes a state")
    print(f"{'':<32}{'must move':>10}{'XLA counts':>12}{'temporaries':>15}{'loops':>7}")
    for name, function, numbers in programs:
        moved, kept, loops = traffic(function, count)
        print(f"{name:<32}{_DOUBLE * numbers:>10}{moved:>12.0f}{kept:>15.0f}{loops:>7}")

    error = derivative_error(robot, states)
    print(f"\nderivatives by pose, velocity, acceleration: {error:.0e} from CasADi's, relative")
    if not error < 1e-10:
        sys.exit("the derivatives are wrong")


def gradient(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """Return the derivatives of the sum of all forces by every input of every state."""
    import jax

    derivatives: Callable[..., Any] = jax.grad(
        lambda *motion: kernel(*motion).sum(), argnums=(0, 1, 2)
    )
    return derivatives


def traffic(function: Callable[..., Any], count: int) -> tuple[float, float, int]:
    """Return the bytes a state that are moved, and of temporary arrays; and the loops."""
    import jax

    given = [np.zeros((count, 4))] * 3  # only their shape matters
    compiled = jax.jit(function).lower(*given).compile()
    found: Any = compiled.cost_analysis()
    costs = found[0] if isinstance(found, list) else found
    memory: Any = compiled.memory_analysis()
    text = compiled.as_text() or ""
    loops = text[text.index("\nENTRY") :].count(" fusion(")
    return costs["bytes accessed"] / count, memory.temp_size_in_bytes / count, loops


def derivative_error(robot: pteron.Manipulator, states: States) -> float:
    """Return how far the Jacobians of the forces are from CasADi's, relative to the largest."""
    import jax

    kernel = pteron.compile(robot, "inverse_dynamics", "jax")
    blocks = jax.vmap(jax.jacfwd(kernel, argnums=(0, 1, 2)))(*states)
    found = np.concatenate([np.asarray(block) for block in blocks], axis=-1)
    function = pteron.compile(robot, "inverse_dynamics", "vm").function
    motion = function.sx_in()
    symbolic = ca.jacobian(function(*motion), ca.vertcat(*motion))
    rows = ca.Function("derivatives", motion, [ca.densify(symbolic)])
    expected = np.array([np.array(rows(*state)) for state in zip(*states, strict=True)])
    return relative_error(found.reshape(len(found), -1), expected.reshape(len(found), -1))


if __name__ == "__main__":
    main()
