"""Show how near the simulated machines are to rigid bodies with dry friction.

Run it as `python benchmarks/identification/check.py`, with `--quick` for 5 s of motion. Pteron's
forces for MuJoCo's own motion of the joints, with friction, are compared with the forces applied;
then the base parameters and the friction are fitted to the noise-free recording, and their errors
set against the standard deviations that 1 % of noise in the forces would give. Samples of a joint
slower than 1 mm/s (1 mrad/s) are left out, but for the column "all": it may stick, and sign(v) does
not say what friction holds it.
"""

from __future__ import annotations

import sys
from time import process_time
from typing import NamedTuple

import numpy as np
from plant import (
    Friction,
    Recording,
    State,
    as_built,
    fourier_reference,
    platform_state,
    simulate,
)
from plant.model import Array

import pteron


class Case(NamedTuple):
    """A machine's friction, and the speed of its motion."""

    coulomb: tuple[float, ...] = (6.0, 7.0, 9.0, 8.0)
    viscous: tuple[float, ...] = (10.0, 12.0, 16.0, 14.0)
    offset: tuple[float, ...] = (-1.0, 1.5, 0.5, 0.0)
    joints: float = 0.02
    speed: float = 0.8
    acceleration: float = 8.0


_CASES = {
    "quadrupteron": Case(),
    "quadrupteron-oblique": Case(),
    "tripteron": Case(),
    "tripteron-oblique": Case(),
    "delta": Case((4.0, 3.0, 5.0), (1.0, 1.5, 1.2), (0.5, -0.3, 0.0), 0.02, 6.0, 80.0),
    "par4": Case(
        (0.2, 0.15, 0.25, 0.3), (0.05, 0.06, 0.04, 0.07), (0.02, -0.01, 0.0, 0.03), 1e-3, 6.0, 80.0
    ),
}
_NOISE = 0.01


def main() -> None:
    """Print a row for each machine; all times and errors are of this run."""
    duration = 5.0 if "--quick" in sys.argv[1:] else 20.0
    print(
        f"{duration:g} s at 1 kHz. Force errors are over each actuator's root mean square force, "
        "the\nworst actuator; biases are in standard deviations of the parameters.\n"
    )
    print(_row("", "speed", "acc.", "gap", "error", "slow", "bias", "bias", "all", "run"))
    print(_row("", "m/s *", "m/s^2 *", "m", "force", "samples", "worst", "rms", "worst", "CPU s"))
    for name, case in _CASES.items():
        drawn = pteron.load(name)
        robot, n = as_built(drawn, seed=1), len(drawn.legs)
        friction = Friction(case.coulomb[:n], case.viscous[:n], case.offset[:n], case.joints)
        reference = fourier_reference(
            drawn, seed=3, speed=case.speed, acceleration=case.acceleration
        )
        begin = process_time()
        recording = simulate(robot, reference, friction, duration=duration, drawn=drawn)
        seconds = process_time() - begin
        error, slow, bias = compared(robot, friction, recording)
        _, _, bias_of_all = compared(robot, friction, recording, least=0.0)
        print(
            _row(
                name,
                f"{np.abs(recording.rates).max():.2f}",
                f"{np.abs(recording.accelerations).max():.1f}",
                f"{recording.gap:.0e}",
                f"{error.max():.0e}",
                f"{slow:.2%}",
                f"{np.abs(bias).max():.3f}",
                f"{np.sqrt(np.mean(bias**2)):.3f}",
                f"{np.abs(bias_of_all).max():.1f}",
                f"{seconds:.0f}",
            ),
            flush=True,
        )
    print("\n* rad/s and rad/s^2 of cranks")


def compared(
    robot: pteron.Manipulator, friction: Friction, recording: Recording, least: float = 1e-3
) -> tuple[Array, float, Array]:
    """Return the force errors, the share of slow samples, and the parameters' biases.

    Samples of a joint that is slower than `least`, m/s or rad/s, are left out.
    """
    rates, n = recording.rates, recording.rates.shape[1]
    state = platform_state(robot, recording.joints, rates, recording.accelerations)
    motion = state.pose, state.velocity, state.acceleration
    base = pteron.base_parameters(robot)
    each = np.eye(n)
    columns = np.concatenate(
        [
            pteron.base_regressor(robot, base, *motion),
            np.sign(rates)[:, :, None] * each,
            rates[:, :, None] * each,
            np.broadcast_to(each, (len(rates), n, n)),
            joint_friction(robot, state)[:, :, None],
        ],
        axis=-1,
    )
    braking = (friction.coulomb, friction.viscous, friction.offset, (friction.joints,))
    true = np.concatenate([base.grouping @ pteron.parameters(robot), *braking])
    taken = np.abs(rates) >= least
    off = np.where(taken, recording.forces - columns @ true, 0.0)
    size = np.sqrt(np.mean(recording.forces**2, axis=0))
    error = np.sqrt(np.mean(off**2, axis=0)) / size
    sigma = np.broadcast_to(_NOISE * size, off.shape)[taken]
    rows = columns[taken] / sigma[:, None]
    scale = np.linalg.norm(rows, axis=0)
    q, r = np.linalg.qr(rows / scale)
    inverse = np.linalg.inv(r)
    # Both are in units of the scaled parameters.
    bias = inverse @ (q.T @ (off[taken] / sigma)) / np.linalg.norm(inverse, axis=1)
    return error, float(np.mean(~taken)), bias


def joint_friction(robot: pteron.Manipulator, state: State) -> Array:
    """Return what a unit coefficient in every passive joint asks of the actuators, (T, n).

    By virtual work: J^T F = (dq'/dx')^T q', with the rates q' of all passive joints.
    """
    rates = np.nan_to_num(pteron.kinematics.joint_rates(robot, state.pose, state.velocity).passive)
    unit = np.eye(robot.freedom)
    shares = np.nan_to_num(pteron.kinematics.joint_rates(robot, state.pose[:, None], unit).passive)
    work = np.einsum("tij,tkij->tk", rates, shares)
    transposed = pteron.jacobian(robot, state.pose).swapaxes(-1, -2)
    forces: Array = np.linalg.solve(transposed, work[..., None])[..., 0]
    return forces


def _row(*cells: str) -> str:
    return f"{cells[0]:<22}" + "".join(f"{cell:>9}" for cell in cells[1:])


if __name__ == "__main__":
    main()
