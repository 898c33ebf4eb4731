"""Sequential quadratic programming finds minima that are known, inside and on the rows."""

import numpy as np
import pytest

from pteron.identification.excitation.sequential import NonlinearProgram, sequential_minimum

ROSENBROCK = NonlinearProgram(
    lambda x: (
        100.0 * (x[1] - x[0] ** 2) ** 2 + (1.0 - x[0]) ** 2,
        np.array(
            [
                -400.0 * x[0] * (x[1] - x[0] ** 2) - 2.0 * (1.0 - x[0]),
                200.0 * (x[1] - x[0] ** 2),
            ]
        ),
    ),
    lambda x: np.array([1.5 - x @ x]),
    lambda x: -2.0 * x[None, :],
)
SPHERE = NonlinearProgram(
    lambda x: (x.sum() if x[0] > -1.9 else np.nan, np.ones(3)),
    lambda x: np.array([1.0 - x @ x, x[2] + 0.1]),
    lambda x: np.array([-2.0 * x, [0.0, 0.0, 1.0]]),
)


def minimum(program: NonlinearProgram, start: list[float]) -> np.ndarray | None:
    return sequential_minimum(
        program,
        np.array(start),
        tolerance=1e-14,
        iterations=300,
        stop=lambda: False,
    )


def test_a_minimum_on_a_row_is_found():
    # Rosenbrock's function within a circle: Lagrange's condition holds there, and nowhere nearby.
    x = minimum(ROSENBROCK, [-1.0, 0.5])
    gradient = ROSENBROCK.cost(x)[1]
    multiplier = -gradient @ x / (2.0 * x @ x)
    assert x @ x == pytest.approx(1.5, abs=1e-10)
    assert multiplier > 0.0
    assert np.abs(gradient + 2.0 * multiplier * x).max() < 1e-5


@pytest.mark.parametrize("start", [[0.0, 0.0, 0.0], [2.0, -2.0, -3.0], [0.9, -0.1, 0.3]])
def test_a_minimum_where_rows_meet_is_found_from_outside_too(start):
    side = np.sqrt((1.0 - 0.01) / 2.0)
    found = minimum(SPHERE, start)
    assert found == pytest.approx([-side, -side, -0.1], abs=1e-6)


def test_it_does_not_begin_where_there_is_no_value_and_ends_when_told():
    assert minimum(SPHERE, [-2.0, 0.0, 0.0]) is None
    start = np.array([0.1, 0.2, 0.3])
    iterate = sequential_minimum(SPHERE, start, tolerance=1e-9, iterations=9, stop=lambda: True)
    assert (iterate == start).all()
