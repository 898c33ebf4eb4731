"""Forces M a + C(x, v) w + g with two velocities v and w, as adaptive control needs them.

C(x, v) v is quadratic in v, and with Christoffel's symbols C(x, v) w is symmetric in v and w. So it
is C(x, u) u for the mean of v and w less that for half their difference (polarisation). The same
holds for J'(x, v) w, the joints' accelerations at x'' = 0.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.equations.drives import joint_motion
from pteron.equations.machine import Machine
from pteron.equations.virtual_work import inverse_dynamics


def mixed_forces(
    machine: Machine,
    pose: Expression,
    rates: Expression,
    reference_rates: Expression,
    reference_accelerations: Expression,
    parameters: Expression,
) -> Expression:
    """Return drive forces (n, K) of M a + C(x, v) w + g with different rates v and w.

    J v = `rates` and J w = `reference_rates`; the joints' acceleration J a + J'(x, v) w is
    `reference_accelerations`; these are (n, 1) each. If reference rates and rates are equal, this
    is inverse dynamics.
    """
    at_rest = machine.state(pose)
    both = machine.closure.rates(ca.horzcat(rates, reference_rates), at_rest.platform, at_rest.legs)
    mean, half = 0.5 * (both[:, 0] + both[:, 1]), 0.5 * (both[:, 0] - both[:, 1])
    drifts = (joint_motion(machine.state(pose, velocity))[1] for velocity in (mean, half))
    drift = next(drifts) - next(drifts)
    acceleration = machine.closure.rates(
        reference_accelerations - drift, at_rest.platform, at_rest.legs
    )
    weightless = replace(machine, gravity=ca.SX.zeros(3))
    return inverse_dynamics(
        machine, machine.state(pose, mean, acceleration), parameters
    ) - inverse_dynamics(weightless, machine.state(pose, half), parameters)
