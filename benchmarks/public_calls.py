"""Times of public functions beside those of the kernels under them.

A call of one pose, and a batch; public function and kernel take turns, so that a ratio is of the
same rounds. The kernel is the function's own: the machine's numbers as inputs, a status beside the
values.
"""

from __future__ import annotations

import numpy as np
from measuring import (
    Array,
    Contestant,
    a_call,
    a_sweep,
    compiled,
    contest,
    quick,
    random_states,
    relative_error,
)

import pteron
from pteron.kernels import numeric

_FUNCTIONS = (pteron.inverse_dynamics, pteron.inverse_kinematics, pteron.jacobian)


def main() -> None:
    """Print a row a machine and function: one pose, a pose of a batch, and the ratio of the two."""
    print(f"{'one pose, us; a pose of a batch, ns':<40}{'one pose':>10}{'kernel':>8}", end="")
    print(f"{'batch':>10}{'kernel':>8}{'ratio':>14}")
    for name in ("quadrupteron", "tripteron", "delta"):
        robot = pteron.load(name)
        for function in _FUNCTIONS:
            states = random_states(robot, 2_000 if quick() else 100_000)
            inputs = states if function is pteron.inverse_dynamics else states[:1]
            public, kernel = compiled(robot, function), numeric(robot, function.__name__)
            expected = kernel(*inputs)[0].reshape(len(states[0]), -1)
            error = relative_error(public(*inputs).reshape(expected.shape), expected)
            rounds = 3 if quick() else 40
            times: dict[str, Array] = {}
            for count, timed in (("one", a_call), ("batch", a_sweep)):
                contestants = [
                    Contestant(f"{what}, {count}", timed(called, inputs), error)
                    for what, called in (("public", public), ("kernel", kernel))
                ]
                times |= {key: 1e9 * value for key, value in contest(contestants, rounds).items()}
            middle = {key: float(np.median(value)) for key, value in times.items()}
            low, ratio, high = np.quantile(
                times["public, batch"] / times["kernel, batch"], [0.25, 0.5, 0.75]
            )
            print(
                f"{name + ', pteron.' + function.__name__:<40}{middle['public, one'] / 1e3:>10.2f}"
                f"{middle['kernel, one'] / 1e3:>8.2f}{middle['public, batch']:>10.1f}"
                f"{middle['kernel, batch']:>8.1f}{f'{ratio:.2f} ({low:.2f}..{high:.2f})':>19}"
            )
            if error > 1e-12:
                raise SystemExit(f"{name}, {function.__name__}: wrong by {error:.0e}")


if __name__ == "__main__":
    main()
